"""What a design has beyond its study: columns, scatter and warnings by the kind of mechanism."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.design.requirements import LoadedRequirements
from flexfem.design.scatter import CouplingQuantiles
from flexfem.questions.setup import sharp_roots
from flexfem.questions.stiffness import stiffness
from flexfem.results import Result
from flexfem.study.loaded import LoadedStudy, mechanism_of

# numbers by linear theory, and the range at finite displacement that they stand for
LINEAR = {
    "yield_range": ("range", "held"),
    "yield_force": ("range_force", "held"),
    "free_yield_range": ("range", "free"),
}
WORTH_A_WARNING = 1.0  # per cent, of such a number
DISTANT = 0.2  # gap between the models above which one correction may not hold in all ranges


class ScatteredDesigns(NamedTuple):
    """Designs whose necks deviate from those of one design, and the study of these necks."""

    study: LoadedStudy
    values: Array


class ScatterSolver(Protocol):
    """Solver of designs with scattered necks by finite elements."""

    def solve_scattered(
        self,
        values: Array,
        off: Array,
    ) -> list[Array]:
        """Return the couplings (3, designs) of a design (d,) with deviations `off` (designs, 3, 3),
        mm, on each mesh.
        """


class DesignKind:
    """What requirements on a mechanism can use beyond the outputs of its study: nothing in general.

    A kind of mechanism that has more overrides methods, and returns its own from
    `Mechanism.answering("design_kind")`.
    """

    def __init__(self, loaded: LoadedRequirements) -> None:
        self.loaded = loaded
        self.required = loaded.requirements

    def columns(
        self,
        values: Array,
        outputs: Mapping[str, Array],
        reason: AnyArray,
        counts: Counter[str],
    ) -> dict[str, Array]:
        """Return more columns (n,) of designs (n, d) by name.

        outputs : of the study, (n,) by name.   reason : (n,), to which reasons of refusals are
        added.   counts : evaluations by the name of a model, to which others are added.
        """
        return {}

    def quantiles(
        self, values: Array, solver: ScatterSolver, counts: Counter[str]
    ) -> CouplingQuantiles | None:
        """Return the couplings of a design (d,) under tolerance, None where there is none.

        Raises ComputationFailed.
        """
        return None

    def scattered(
        self,
        values: Array,
        off: Array,
    ) -> ScatteredDesigns:
        """Return the designs of deviations `off` (n, 3, 3) of the necks, mm, from a design (d,)."""
        raise NotImplementedError

    def relative_spread(self, values: Array) -> dict[str, float]:
        """Return relative changes of columns of a design (d,) with the spread of actuator forces."""
        return {}

    def warnings(
        self,
        values: Array,
        columns: Mapping[str, float],
        first_gap: float,
    ) -> list[str]:
        """Return warnings about a design (d,).

        columns : of the design.   first_gap : largest difference of the models in the first round.
        """
        warnings = list[str]()
        if first_gap > DISTANT:
            warnings.append(
                f"model and finite elements differed by {100 * first_gap:.3g} % in the first "
                "round: designs in other parts of the ranges may be better"
            )
        warnings += self.loaded.family.left_out
        return [*warnings, *self._by_linear_theory(values), *sharp_roots(self.loaded.base.layout)]

    def _by_linear_theory(self, values: Array) -> list[str]:
        """Warn of quantities that are displacements at yield by linear theory, with their error by
        beams.
        """
        asked = [path for path in self.required.ask if path in self.required.used]
        linear = [path for path in asked if path.split(".")[1] in LINEAR]
        if not linear:
            return []
        found = stiffness(mechanism_of(self.loaded, values), models="analytic")
        if "range" not in found.values:
            return []
        texts = list[str]()
        for path in linear:
            texts += _difference_of_beams(path, found)
        return texts


def _difference_of_beams(path: str, found: Result) -> list[str]:
    """Return a warning on a number by linear theory that beams at finite displacement contradict.

    found : the stiffness of the design.
    """
    _, name, *_, direction = path.split(".")
    quantity, others = LINEAR[name]
    ends = np.abs(found.at(quantity, others=others, direction=direction))
    by_theory = float(found.at(name, direction=direction)[0])
    change = 100 * (float(np.min(ends)) / by_theory - 1)
    if abs(change) <= WORTH_A_WARNING:
        return []
    found_by = f"beams differ by {change:+.2g} %" if np.isfinite(change) else "beams find no end"
    better = f"stiffness.{quantity}.{others}.positive.{direction}"
    return [f"{path} is by linear theory; of {better}, at finite displacement, {found_by}"]


def kind_of(loaded: LoadedRequirements) -> DesignKind:
    """Return what the design of a mechanism has beyond its study."""
    make = loaded.base.answering("design_kind") or DesignKind
    kind: DesignKind = make(loaded)
    return kind
