"""The output columns of a study: their names, the values that the model answers in them, and rows without an answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import ROUND_OFF, AnyArray, Array
from flexfem.files.refusals import one_line
from flexfem.units import unit_of

if TYPE_CHECKING:
    from flexfem.verify.questions import Answers

RESERVED = ("design", "status", "reason")
FEASIBLE = "feasible"  # column of a study with constraints
LONGEST = 200  # characters of a reason
STIFFNESSES = ("kxx_n_per_mm", "kyy_n_per_mm", "ktt_n_mm_per_rad", "kxy_n_per_mm", "kxt_n", "kyt_n")
COUPLINGS = ("coupling_xy", "coupling_xt", "coupling_yt")
STRESSES = ("stress_x_mpa_per_um", "stress_y_mpa_per_um", "stress_theta_mpa_per_mrad")
RANGES = ("range_x_um", "range_y_um", "range_theta_mrad")
ENVELOPE = ("envelope_mm",)
TRAVELS = ("travel_x_um", "travel_y_um", "travel_theta_mrad")
DRIVE_RANGES = ("drive_range_x_um", "drive_range_y_um", "drive_range_theta_mrad")
ENGAGED = ("engaged_kxx_n_per_mm", "engaged_kyy_n_per_mm", "engaged_ktt_n_mm_per_rad")
FREQUENCIES = ("frequency_1_hz", "frequency_2_hz", "frequency_3_hz")
DRIFTS = ("drift_x_um_per_k", "drift_y_um_per_k", "drift_theta_urad_per_k")
GRADIENTS = ("drift_gradient_um_per_k_per_mm", "drift_gradient_theta_urad_per_k_per_mm")
LIFE_AMPLITUDES = ("life_amplitude_x_um", "life_amplitude_y_um", "life_amplitude_theta_mrad")
ERRORS = ("error_x_percent", "error_y_percent", "error_theta_percent")
CROSSES = ("cross_x_percent", "cross_y_percent", "cross_theta_percent")
BANDS = ("band_x_percent", "band_y_percent", "band_theta_percent")
CROSS = {  # stiffnesses between two directions, and those along them
    "kxy_n_per_mm": ("kxx_n_per_mm", "kyy_n_per_mm"),
    "kxt_n": ("kxx_n_per_mm", "ktt_n_mm_per_rad"),
    "kyt_n": ("kyy_n_per_mm", "ktt_n_mm_per_rad"),
}
PARTS = dict.fromkeys(COUPLINGS, 1.0) | dict.fromkeys(CROSSES, 100.0)  # others that may vanish, and their wholes
COMMON = (*STIFFNESSES, *COUPLINGS, *STRESSES, *RANGES, *ENVELOPE)
_ENTRIES = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))


def outputs_of(
    travels: bool,
    verify: bool,
    bands: bool,
    driven: bool,
    vibrating: bool = False,
    moved: Sequence[bool] | None = None,
    drifting: bool = False,
) -> tuple[str, ...]:
    """Names of the output columns: travels, those of the drive, natural frequencies, lives and drift where asked,
    errors of a verification and bands.

    moved : whether the amplitude of which lives are asked has each of the directions, None where none are.
    """
    travel = (*(TRAVELS if travels else ()), *((*DRIVE_RANGES, *ENGAGED) if driven else ()))
    errors = (*ERRORS, *CROSSES, *(BANDS if bands else ())) if verify else ()
    others = (*(FREQUENCIES if vibrating else ()), *(() if moved is None else lasting(moved)))
    return (*COMMON, *travel, *others, *((*DRIFTS, *GRADIENTS) if drifting else ()), *errors)


def lasting(moved: Sequence[bool]) -> tuple[str, ...]:
    """Names of the columns on lives at an amplitude that has some of the directions."""
    return ("life_cycles", *compress(LIFE_AMPLITUDES, moved), "safety_factor")


def values_of(answers: Answers, rotation: float | None) -> Array:
    """Values (n, outputs) of the columns, with the travels where a base hinge may turn by `rotation`, rad."""
    asked = [answers.stiffness[:, *_ENTRIES], answers.coupling, answers.stress * _factors(STRESSES)]
    asked += [answers.range_at_yield * _factors(RANGES), answers.envelope[:, None]]
    if rotation is not None:
        asked.append(answers.travel(rotation) * _factors(TRAVELS))
    if answers.drives is not None:
        asked.append(answers.drives.range * _factors(DRIVE_RANGES))
        asked.append(np.diagonal(answers.drives.engaged, axis1=1, axis2=2) * _factors(ENGAGED))
    if answers.frequencies is not None:
        asked.append(answers.frequencies * _factors(FREQUENCIES))
    if answers.lives is not None:
        of = answers.lives
        largest = (of.largest * _factors(LIFE_AMPLITUDES))[:, of.moved]
        asked.append(np.column_stack([of.cycles, largest, of.safety]))
    if answers.drift is not None:
        asked.append(answers.drift.uniform * _factors(DRIFTS))
        asked.append(answers.drift.gradient * _factors(GRADIENTS))
    asked += [each for each in answers.errors or () if each is not None]
    return np.concatenate(asked, axis=1)


def round_off_of(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Up to which size numbers of the columns that symmetry can make zero are round-off, by name, (n,) each or one.

    columns : (n,) each, stiffnesses and drift by name.   Drift in X and Y is beside the rotation's at 1 mm, too.
    """
    sizes = {name: np.sqrt(np.abs(columns[one] * columns[other])) for name, (one, other) in CROSS.items()}
    sizes |= {name: np.asarray(size) for name, size in PARTS.items()}
    if DRIFTS[0] in columns:
        x, y, turn = (np.abs(columns[name]) for name in DRIFTS)
        sizes |= dict.fromkeys(DRIFTS[:2], np.maximum(np.maximum(x, y), 1e-3 * turn))  # um per urad at 1 mm
    return {name: ROUND_OFF * size for name, size in sizes.items()}


def _factors(columns: tuple[str, ...]) -> Array:
    """What turns numbers in N, mm, MPa, rad into those of the columns (k,)."""
    return np.array([unit_of(column).factor for column in columns])


class Rows(NamedTuple):
    """What a model answers for n designs.

    Attributes
    ----------
    status : (n,) text: "ok"; "refused", the design is impossible; "failed", mesh or solver; "time limit"; "crashed".
    reason : (n,) one line why not, or where ok what to know of the answer, mostly "".
    values : (n, outputs) in the columns' units; nan where not ok.
    """

    status: AnyArray
    reason: AnyArray
    values: Array


def row_of(status: str, reason: str, values: ArrayLike) -> Rows:
    """The row of one design, values (outputs,)."""
    return Rows(np.array([status], object), np.array([reason], object), np.array([values], float))


def failed_row(outputs: int, status: str, reason: str) -> Rows:
    """The row of one design without an answer."""
    return row_of(status, one_line(reason, LONGEST), np.full(outputs, np.nan))
