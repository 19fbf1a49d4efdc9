"""What of a value's variance each factor causes: Sobol indices."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.errors import BadInput
from flexfem.study.percentiles import CONFIDENCE

if TYPE_CHECKING:
    from flexfem.study.plan import LoadedStudy
    from flexfem.study.table import StudyTable

RESAMPLES = 200  # of the bootstrap
FLAT = 1e-9  # spread over size: round-off of a value that no factor changes
CROSS = {
    "kxy_n_per_mm": ("kxx_n_per_mm", "kyy_n_per_mm"),
    "kxt_n": ("kxx_n_per_mm", "ktt_n_mm_per_rad"),
    "kyt_n": ("kyy_n_per_mm", "ktt_n_mm_per_rad"),
}


class Indices(NamedTuple):
    """Sobol indices of one value, (k,) in the order of the factors, and half-widths of their confidence intervals."""

    first: Array
    first_band: Array
    total: Array
    total_band: Array


def sensitivity(loaded: LoadedStudy, table: StudyTable, value: str) -> Indices:
    """Sobol indices of an output column.

    Raises
    ------
    BadInput
        The study is not sampled for it, a design has no answer (each belongs to as many differences as there are
        factors, so that none can be left out), or the value does not vary.
    """
    where = f"{loaded.path}: sensitivity of {value}"
    method = loaded.study.sampling.method
    if method != "saltelli":
        raise BadInput(f'{where}: sampling.method = "{method}", expected "saltelli"')
    if missing := loaded.count - len(table.design):
        raise BadInput(f"{where}: {missing} of {loaded.count} designs are not computed, expected all")
    bad = np.flatnonzero(~table.ok)
    if len(bad):
        first = bad[0]
        raise BadInput(
            f"{where}: {len(bad)} of {loaded.count} designs have no answer, expected all to have one; the first is "
            f"design {table.design[first]}: {table.status[first]}: {table.reason[first]}"
        )
    answers = table.columns[value]
    if np.ptp(answers) <= FLAT * scale_of(table, value):
        raise BadInput(f"{where}: no factor changes it, expected a value that varies")
    return sobol_indices(answers, len(loaded.columns))


def sobol_indices(answers: Array, factors: int) -> Indices:
    """First-order and total indices of answers (base * (factors + 2),) in the order of SALib's Saltelli sample.

    Notes
    -----
    A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, without second order; the intervals are those of a normal
    distribution with the spread of a bootstrap, drawn alike every time.
    """
    from SALib.analyze import sobol  # loads pandas

    problem = {"num_vars": factors, "names": [str(k) for k in range(factors)]}
    found = sobol.analyze(
        problem, answers, calc_second_order=False, num_resamples=RESAMPLES, conf_level=CONFIDENCE, seed=1
    )
    return Indices(*(np.asarray(found[key], dtype=np.float64) for key in ("S1", "S1_conf", "ST", "ST_conf")))


def scale_of(table: StudyTable, value: str) -> float:
    """Size against which a change of an output is round-off or not.

    A stiffness between two directions and a coupling are nought by symmetry where they do not vary; what they are
    measured by is the stiffness along the two.
    """
    if value.startswith("coupling_"):
        return 1.0
    if value in CROSS:
        one, other = CROSS[value]
        return float(np.sqrt(np.median(table.columns[one] * table.columns[other])))
    return float(np.abs(table.columns[value]).max())
