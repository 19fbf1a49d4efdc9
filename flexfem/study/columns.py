"""The output columns of a study, one table: name, label, unit (the ending of the name), meaning, and how it is found.

A column is computed from the `DesignAnswers` of a batch of designs by the analytic model, or of one design by finite
elements. Any other number that a question of flexfem answers is a column by its path, such as
`drift.pose.uniform.analytic.x`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import compress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import ROUND_OFF, AnyArray, Array
from flexfem.files.refusals import one_line
from flexfem.units import DIRECTIONS, unit_of

if TYPE_CHECKING:
    from flexfem.questions.batch import DesignAnswers

RESERVED = ("design", "status", "reason")
FEASIBLE = "feasible"  # column of a study with constraints
LONGEST = 200  # characters of a reason


class Group(NamedTuple):
    """Columns that are found together.

    labels : name by column.
    values : (n, columns) of the answers on n designs and the largest rotation of a base hinge, in inside units.
    table : of a study that asks for them, "" where every study has them.
    """

    labels: dict[str, str]
    meaning: str
    values: Callable[[Any, float], Array]
    table: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.labels)


def _each(name: str, said: str, unit: str = "um", turned: str = "mrad") -> dict[str, str]:
    """A column for each direction."""
    units = zip(DIRECTIONS, "XYθ", (unit, unit, turned), strict=True)
    return {f"{name}_{axis}_{ending}": said.format(letter) for axis, letter, ending in units}


GROUPS = (
    Group(
        {
            "kxx_n_per_mm": "stiffness XX",
            "kyy_n_per_mm": "stiffness YY",
            "ktt_n_mm_per_rad": "stiffness θθ",
            "kxy_n_per_mm": "stiffness XY",
            "kxt_n": "stiffness Xθ",
            "kyt_n": "stiffness Yθ",
        },
        "stiffness of the platform, `K_ij`: along one direction with the other two held",
        lambda of, _: of.stiffness[:, (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)],
    ),
    Group(
        {
            "coupling_xy": "coupling XY",
            "coupling_xt": "coupling Xθ",
            "coupling_yt": "coupling Yθ",
        },
        "`K_ij / sqrt(K_ii K_jj)`",
        lambda of, _: of.coupling,
    ),
    Group(
        _each("stress", "peak neck stress per {}", "mpa_per_um", "mpa_per_mrad"),
        "highest von Mises stress at a neck per displacement of the platform in that direction, the others held; `fe`: "
        "up to 1 % low at resolution 4, by the square of it less at a finer one; `analytic`: bending and tension with "
        "Neuber's stress concentration, shear left out. Against finite elements: within 1 % with "
        '`formula = "calibrated"` and `links`, 1 to 9 % high with rigid links; 10 to 22 % and 14 to 34 % high with the '
        "default formula, because its hinges are too stiff (`benchmarks/stress.py`). On a base stage with "
        '`model = "corrected"`: within 2 % of three dimensions with `formula = "calibrated"` and `links` '
        "(`benchmarks/solid_stress.py`)",
        lambda of, _: of.stress,
    ),
    Group(
        _each("range", "range in {} at yield"),
        "displacement at which the first hinge yields; low by as much as the stress is high",
        lambda of, _: of.range_at_yield,
    ),
    Group(
        {"envelope_mm": "diameter of the envelope"},
        "diameter of the circle about the platform centre that holds the stage",
        lambda of, _: of.envelope[:, None],
    ),
    Group(
        _each("travel", "travel in {}, base hinges"),
        "with `[drive]` `stroke_um`: displacement at which the first base hinge has turned by stroke over lever arm. "
        "No other hinge, contact or force is counted: what a drive really reaches is less, `drive_range_x_um`",
        lambda of, rotation: of.travel(rotation),
        "travel",
    ),
    Group(
        _each("drive_range", "range of the drive in {}"),
        "with `[drive]` `actuators`: how far commands drive the platform from rest with the other two directions at "
        "zero, within strokes, contacts (none may be lost), blocking forces and yield, as `flexfem reach` has it "
        "(others zero), without load: the lesser of both ways, so zero where single stacks go one way only; `fe`: with "
        "what necks carry by the finite elements",
        lambda of, _: of.drives.range,
        "drive",
    ),
    Group(
        {
            "engaged_kxx_n_per_mm": "engaged stiffness XX",
            "engaged_kyy_n_per_mm": "engaged stiffness YY",
            "engaged_ktt_n_mm_per_rad": "engaged stiffness θθ",
        },
        "with `[drive]` `actuators`: stiffness with the stacks holding their strokes, the other two directions held; "
        "links that are rigid make it 50 % too large on the reference stages, elastic links agree with `fe` to 0.3 %",
        lambda of, _: np.diagonal(of.drives.engaged, axis1=1, axis2=2),
        "drive",
    ),
    Group(
        {f"frequency_{k}_hz": f"natural frequency {k}" for k in (1, 2, 3)},
        "with `[frequencies]`: the three lowest natural frequencies in the plane, drives disengaged; `analytic`: "
        "platform and links as rigid bodies (with `links` on elastic links) on the model's hinges, the default "
        "formula's 6 to 7 % high on the reference stages because its hinges are too stiff, calibrated with `links` "
        "within 0.01 %; `fe`: as `flexfem modes` on one mesh. Modes out of the plane can lie lower",
        lambda of, _: np.asarray(of.frequencies),
        "frequencies",
    ),
    Group(
        {"life_cycles": "cycles at the amplitude"}
        | _each("life_amplitude", "amplitude in {} for the wanted life")
        | {"safety_factor": "yield strength over neck stress"},
        "with `[life]`: cycles at the amplitude, the amplitude of each moved direction for the wanted life, and yield "
        "strength over the largest neck stress on the way, as `flexfem life` has them. A life is out by ten times what "
        "the stress is: calibrated hinges with `links`, or `fe`, or it means little. Lives beyond yield, or beyond the "
        "cycles of Basquin's law, are counted as such. Preloads of single stacks are not in them",
        lambda of, _: np.column_stack([of.lives.cycles, of.lives.largest, of.lives.safety]),
        "life",
    ),
    Group(
        _each("drift", "drift in {} per kelvin", "um_per_k", "urad_per_k"),
        "with `[drift]`: pose per kelvin of a uniform change, as `flexfem drift` has it; in X and Y round-off where "
        "chains are alike",
        lambda of, _: of.drift.uniform,
        "drift",
    ),
    Group(
        {
            "drift_gradient_um_per_k_per_mm": "largest drift by a gradient",
            "drift_gradient_theta_urad_per_k_per_mm": "largest drift in θ by a gradient",
        },
        "with `[drift]`: largest translation, and largest rotation, by a gradient of 1 K/mm of any direction in the "
        "plane about the platform's centre; each has a direction of its own. All five numbers of drift against finite "
        "elements: calibrated hinges with `links` within 0.2 %, rigid links, which leave out that the frame bows the "
        "clamped edges, within 1.4 % with calibrated hinges and 13 % with the default formula. Stacks, and gradients "
        "through the thickness, are not in them",
        lambda of, _: of.drift.gradient,
        "drift",
    ),
    Group(
        _each("error", "error along {}", "percent", "percent"),
        "`verify`: error along the command",
        lambda of, _: of.errors.along,
        "verify",
    ),
    Group(
        _each("cross", "largest cross error under {}", "percent", "percent"),
        "`verify`: largest error across the command",
        lambda of, _: of.errors.across,
        "verify",
    ),
    Group(
        _each("band", "mesh band of the error along {}", "percent", "percent"),
        "`verify` with `bands`: mesh band of the error along the command",
        lambda of, _: np.asarray(of.errors.bands),
        "bands",
    ),
)
(STIFFNESSES, COUPLINGS, STRESSES, RANGES, ENVELOPE, TRAVELS, DRIVE_RANGES, ENGAGED, FREQUENCIES, LIVES, DRIFTS,
 GRADIENTS, ERRORS, CROSSES, BANDS) = (group.names for group in GROUPS)  # fmt: skip
OPTIONAL = tuple(dict.fromkeys(group.table for group in GROUPS if group.table))
LIFE_AMPLITUDES = LIVES[1:4]
MEANINGS = {group.names: group.meaning for group in GROUPS}
LABELS = {name: label for group in GROUPS for name, label in group.labels.items()}
CROSS = {  # stiffnesses between two directions, and those along them
    "kxy_n_per_mm": ("kxx_n_per_mm", "kyy_n_per_mm"),
    "kxt_n": ("kxx_n_per_mm", "ktt_n_mm_per_rad"),
    "kyt_n": ("kyy_n_per_mm", "ktt_n_mm_per_rad"),
}
PARTS = dict.fromkeys(COUPLINGS, 1.0) | dict.fromkeys(CROSSES, 100.0)  # others that may vanish, and their wholes


def outputs_of(*tables: str, moved: Sequence[bool] = (True, True, True)) -> tuple[str, ...]:
    """Names of the output columns where a study has some tables, of lives those of the directions that are `moved`."""
    left_out = set(LIFE_AMPLITUDES) - set(life_columns(moved))
    groups = [group for group in GROUPS if group.table in ("", *tables)]
    return tuple(name for group in groups for name in group.names if name not in left_out)


def life_columns(moved: Sequence[bool]) -> tuple[str, ...]:
    """Names of the columns on lives at an amplitude that has some of the directions."""
    return ("life_cycles", *compress(LIFE_AMPLITUDES, moved), "safety_factor")


def values_of(answers: DesignAnswers, names: Sequence[str], rotation: float | None) -> Array:
    """Values (n, names) of columns, of which `answers` has the groups; `rotation` of base hinges, rad, for travels."""
    found: dict[str, Array] = {}
    for group in GROUPS:
        if not set(group.names).isdisjoint(names):
            factors = [unit_of(name).factor for name in group.names]
            found |= dict(zip(group.names, (group.values(answers, rotation or 0.0) * factors).T, strict=True))
    return np.stack([found[name] for name in names], axis=1)


def sizes_of(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Beside which sizes numbers of the columns that symmetry can make zero are round-off, by name, (n,) each or one.

    columns : (n,) each, stiffnesses and drift by name.   Drift in X and Y is beside the rotation's at 1 mm, too.
    """
    sizes = {name: np.sqrt(np.abs(columns[one] * columns[other])) for name, (one, other) in CROSS.items()}
    sizes |= {name: np.asarray(size) for name, size in PARTS.items()}
    if DRIFTS[0] in columns:
        x, y, turn = (np.abs(columns[name]) for name in DRIFTS)
        sizes |= dict.fromkeys(DRIFTS[:2], np.maximum(np.maximum(x, y), 1e-3 * turn))  # um per urad at 1 mm
    return sizes


def round_off_of(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Up to which size numbers of such columns are round-off."""
    return {name: ROUND_OFF * size for name, size in sizes_of(columns).items()}


class Rows(NamedTuple):
    """What a model answers for n designs.

    status : (n,), "ok"; "refused", the design is impossible; "failed", mesh or solver; "time limit"; "crashed".
    reason : (n,), one line why not, or where ok what to know of the answer, mostly "".
    values : (n, outputs), in the columns' units; nan where not ok.
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
