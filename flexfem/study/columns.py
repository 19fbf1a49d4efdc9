"""Table of the output columns of a study: name, which ends in the unit, label and meaning.

These are the columns of studies of a nine-hinge stage, in the order of the table. Any other number
in a result of flexfem is a column by its path, such as `drift.pose.uniform.analytic.x`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import one_line
from flexfem.units import DIRECTIONS

RESERVED = ("design", "status", "reason")
FEASIBLE = "feasible"  # column of a study with constraints
LONGEST = 200  # characters of a reason


class Group(NamedTuple):
    """Columns that are computed together.

    labels : label by column.
    table : table of the study file that requests them, "" where every study has them.
    """

    labels: dict[str, str]
    meaning: str
    table: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.labels)


def _by_direction(
    name: str,
    label: str,
    unit: str = "um",
    angular: str = "mrad",
) -> dict[str, str]:
    """Return the label of one column for each direction."""
    units = zip(DIRECTIONS, "xyθ", (unit, unit, angular), strict=True)
    return {f"{name}_{axis}_{ending}": label.format(letter) for axis, letter, ending in units}


GROUPS = (
    Group(
        {
            "kxx_n_per_mm": "stiffness xx",
            "kyy_n_per_mm": "stiffness yy",
            "ktt_n_mm_per_rad": "stiffness θθ",
            "kxy_n_per_mm": "stiffness xy",
            "kxt_n": "stiffness xθ",
            "kyt_n": "stiffness yθ",
        },
        "stiffness of the platform, `K_ij`: along one direction with the other two held",
    ),
    Group(
        {"coupling_xy": "coupling xy", "coupling_xt": "coupling xθ", "coupling_yt": "coupling yθ"},
        "`K_ij / sqrt(K_ii K_jj)`",
    ),
    Group(
        _by_direction("stress", "peak neck stress per {}", "mpa_per_um", "mpa_per_mrad"),
        "highest von Mises stress at a neck per displacement of the platform in that direction, others held; `fe`: "  # noqa: E501
        "up to 1 % low at resolution 4, falling with the square of the resolution; `analytic`: bending and tension "  # noqa: E501
        "with Neuber's stress concentration, without shear. Against finite elements: within 1 % with "
        '`formula = "calibrated"` and `links`, 1 to 9 % high with rigid links; 10 to 22 % and 14 to 34 % high with the '  # noqa: E501
        "default formula, because its hinges are too stiff (`benchmarks/stress.py`). On a base stage with "  # noqa: E501
        '`model = "corrected"`: within 2 % of three dimensions with `formula = "calibrated"` and `links` '  # noqa: E501
        "(`benchmarks/solid_stress.py`)",
    ),
    Group(
        _by_direction("range", "range in {} at yield"),
        "displacement at which the first hinge yields; where the stress is high, it is low by "
        "the same factor",
    ),
    Group(
        {"envelope_mm": "diameter of the envelope"},
        "diameter of the circle about the platform centre that encloses the stage",
    ),
    Group(
        _by_direction("travel", "travel in {}, base hinges"),
        "with `[drive]` `stroke_um`: displacement at which the first base hinge has rotated by "
        "stroke over lever arm. Other hinges, contacts and forces are ignored: the range of a "
        "real drive is less, `drive_range_x_um`",
        "travel",
    ),
    Group(
        _by_direction("drive_range", "range of the drive in {}"),
        "with `[drive]` `actuators`: displacement of the platform from rest that commands reach "
        "with the other two directions at zero, within strokes, contacts (none may be lost), "
        "blocking forces and yield, without load, as in `flexfem reach` (others zero): the "
        "smaller of both senses, thus zero where single stacks drive one sense only; `fe`: with "
        "the neck loads of the finite elements",
        "drive",
    ),
    Group(
        {
            "engaged_kxx_n_per_mm": "engaged stiffness xx",
            "engaged_kyy_n_per_mm": "engaged stiffness yy",
            "engaged_ktt_n_mm_per_rad": "engaged stiffness θθ",
        },
        "with `[drive]` `actuators`: stiffness with constant strokes of the stacks, other two "
        "directions held; rigid links make it 50 % too large on the reference stages, elastic "
        "links agree with `fe` within 0.3 %",
        "drive",
    ),
    Group(
        {f"frequency_{k}_hz": f"natural frequency {k}" for k in (1, 2, 3)},
        "with `[frequencies]`: the three lowest natural frequencies in the plane, drives "
        "disengaged; `analytic`: platform and links as rigid bodies (with `links`: elastic "
        "links) on the model's hinges, 6 to 7 % high with the default formula on the reference "
        "stages because its hinges are too stiff, within 0.01 % with calibrated hinges and "
        "`links`; `fe`: as `flexfem modes` on one mesh. Modes out of the plane can be lower",
        "frequencies",
    ),
    Group(
        {"life_cycles": "cycles at the amplitude"}
        | _by_direction("life_amplitude", "amplitude in {} for the required life")
        | {"safety_factor": "yield strength over neck stress"},
        "with `[life]`: cycles at the amplitude, amplitude of each moved direction for the "
        "required life, and yield strength over the largest neck stress in a cycle, as in "
        "`flexfem life`. The relative error of a life is about ten times that of the stress: use "
        "calibrated hinges with `links`, or `fe`. Lives beyond yield, or outside the cycles of "
        "Basquin's law, are counted in warnings. Preloads of single stacks are not included",
        "life",
    ),
    Group(
        _by_direction("drift", "drift in {} per kelvin", "um_per_k", "urad_per_k"),
        "with `[drift]`: pose per kelvin of a uniform temperature change, as in `flexfem drift`; "
        "round-off in x and y where chains are identical",
        "drift",
    ),
    Group(
        {
            "drift_gradient_um_per_k_per_mm": "largest drift by a gradient",
            "drift_gradient_theta_urad_per_k_per_mm": "largest drift in θ by a gradient",
        },
        "with `[drift]`: largest translation and rotation under a gradient of 1 K/mm, each in "
        "its worst direction in the plane, zero at the platform's centre. All five numbers of "
        "drift against finite elements: within 0.2 % with calibrated hinges and `links`; with "
        "rigid links, which neglect that the frame bends the clamped edges, within 1.4 % with "
        "calibrated hinges and 13 % with the default formula. Stacks, and gradients through the "
        "thickness, are not included",
        "drift",
    ),
    Group(
        _by_direction("error", "error along {}", "percent", "percent"),
        "`verify`: error along the command",
        "verify",
    ),
    Group(
        _by_direction("cross", "largest cross error under {}", "percent", "percent"),
        "`verify`: largest error across the command",
        "verify",
    ),
    Group(
        _by_direction("band", "mesh band of the error along {}", "percent", "percent"),
        "`verify` with `bands`: mesh band of the error along the command",
        "bands",
    ),
)
(
    STIFFNESSES,
    COUPLINGS,
    STRESSES,
    RANGES,
    ENVELOPE,
    TRAVELS,
    DRIVE_RANGES,
    ENGAGED,
    FREQUENCIES,
    LIVES,
    DRIFTS,
    GRADIENTS,
    ERRORS,
    CROSSES,
    BANDS,
) = (group.names for group in GROUPS)
OPTIONAL = tuple(dict.fromkeys(group.table for group in GROUPS if group.table))
LIFE_AMPLITUDES = LIVES[1:4]
MEANINGS = {group.names: group.meaning for group in GROUPS}
LABELS = {name: label for group in GROUPS for name, label in group.labels.items()}
# stiffnesses across directions, each with those along both
CROSS = dict(zip(STIFFNESSES[3:], combinations(STIFFNESSES[:3], 2), strict=True))
# sizes of other columns that may vanish
SCALES = dict.fromkeys(COUPLINGS, 1.0) | dict.fromkeys(CROSSES, 100.0)


def outputs_of(*tables: str, moved: Sequence[float] = ()) -> tuple[str, ...]:
    """Return the output columns of a study with the given tables, without life amplitudes where
    `moved` has zeros.
    """
    unmoved = {name for name, moves in zip(LIFE_AMPLITUDES, moved, strict=False) if not moves}
    groups = [group for group in GROUPS if group.table in ("", *tables)]
    return tuple(name for group in groups for name in group.names if name not in unmoved)


def sizes_of(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return the reference size, (n,) or one number, of each column that symmetry can make zero;
    for round-off.

    columns : (n,) each, stiffnesses and drift by name.   Drift in x and y also refers to that of
    the rotation at 1 mm."""
    sizes = {name: np.asarray(scale) for name, scale in SCALES.items()}
    for name, (first, second) in CROSS.items():
        if {first, second} <= columns.keys():
            sizes[name] = np.sqrt(np.abs(columns[first] * columns[second]))
    if DRIFTS[0] in columns:
        x, y, theta = (np.abs(columns[name]) for name in DRIFTS)
        translation = np.maximum(np.maximum(x, y), 1e-3 * theta)  # um per urad at 1 mm
        sizes |= dict.fromkeys(DRIFTS[:2], translation)
    return sizes


class Rows(NamedTuple):
    """Results of n designs by a model.

    status : (n,), "ok"; "refused", the design is impossible; "failed", mesh or solver; "time
    limit"; "crashed".
    reason : (n,), one line: why the status is not "ok", else warnings about the result, mostly "".
    values : (n, outputs), in the columns' units; nan where not ok.
    """

    status: AnyArray
    reason: AnyArray
    values: Array


def row_of(
    status: str,
    reason: str,
    values: ArrayLike,
) -> Rows:
    """Return the row of one design with values (outputs,), which are nan where the status is not
    "ok".
    """
    return Rows(
        np.array([status], object),
        np.array([one_line(reason, LONGEST)], object),
        np.array([values], float),
    )
