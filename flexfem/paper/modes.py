"""Natural frequencies and modes of the nine-hinge stage, and its reduced dynamics.

The plane problem is that of the stage, with stacks engaged or not; in three dimensions both faces
are free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.network import Dynamics
from flexfem.arrays import Array
from flexfem.mechanism.layout import Payload
from flexfem.paper import answers, bodies
from flexfem.paper import warnings as warning
from flexfem.paper.drives import drive_of
from flexfem.paper.reduced import DynamicModel
from flexfem.paper.stage import Stage
from flexfem.paper.vibration import (
    INERTIA,
    KILOGRAM,
    Found,
    VibratingStage,
    Vibration,
    analytic_dynamics,
    in_depth,
    in_plane,
    payload_of,
)
from flexfem.questions import setup
from flexfem.questions.mode_order import in_rows, lowest_modes, side_by_side
from flexfem.questions.modes import MOST, SOLID_RESOLUTION, Drives
from flexfem.questions.setup import LIFTED, Mesh, ModelAnswer, Models, question
from flexfem.questions.warnings import of_payload
from flexfem.refused import BadInput
from flexfem.results import NEW_MESH, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

ALL_BASES = (*DIRECTIONS, *LIFTED)
KINDS = ("in plane", "out of plane")
MOST_SOLID = 40  # modes
MOST_DAMPING = 99.0  # % of critical
LARGEST_PAYLOAD = (1e4, 1e10)  # kg, kg mm^2; no stage with necks carries a hundredth of it
RIGID_MODES = 3  # modes of the platform on its hinges; in higher ones links swing and bend
ABOVE_THIRD = (
    "analytic frequencies above the third are not reliable: links swing and bend in these modes. "
    "On 40 random stages with disengaged drives, they were 0.8 to 28 % too low with elastic "
    "links (half of them by more than 10 %), and 5 to 163 % too high with rigid links and "
    "calibrated hinges. The error of the first three was at most 0.11 % with elastic and 3.4 % "
    "with rigid links"
)
OUT_OF_PLANE = (
    "modes in which the platform leaves the plane are not computed; the lowest of them can be "
    "below these modes"
)
NO_STACKS = (
    "engaged stacks are springs that hold their strokes; the mass of the stacks is neglected"
)
AT_ITS_PLACE = (
    "payload: its centre of mass is at the platform's centre, in the mid-plane; a payload above "
    "the mid-plane couples motion in and out of the plane, which is neglected"
)
FREQUENCY = Gate(NEW_MESH.relative, 0.2)


class NaturalModes(Result):
    """Natural frequencies, effective modal masses and the masses that vibrate."""

    title = "natural modes"
    has_mesh_fields = True
    main_result = ("frequency", {})
    columns: ClassVar[tuple[str, ...]] = ("model", "base")
    figure = "paper.figures.modes.figures"
    drawn_from_fields = True
    footnotes: ClassVar[tuple[str, ...]] = (
        "effective modal mass: share of the whole mass or moment of inertia, for a motion of the "
        "base",
    )
    frequency = Quantity("natural frequency", "hz", ("mode", "model"), FREQUENCY)
    share = Quantity(
        "effective modal mass", "percent", ("mode", "base"), Gate(1e-3, absolute=1e-6), "all"
    )
    band_plane = Quantity("band by the mesh in the plane", "hz", ("mode",), Gate(0.2), shown=False)
    band_thickness = Quantity("band by the layers", "hz", ("mode",), Gate(0.2), shown=False)
    mass = Quantity("mass, including pads, hub and payload", "kg")
    inertia = Quantity("moment of inertia about the platform's centre", "kg_mm2")
    tilting_inertia = Quantity("moments of inertia about x and y", "kg_mm2", ("tilt",), NEW_MESH)
    meshed_mass = Quantity("mass by the finite elements", "kg", gate=NEW_MESH, shown=False)
    hub_mass = Quantity("mass of the hub", "kg")
    first_out_of_plane = Quantity(
        "first natural frequency out of the plane",
        "hz",
        gate=FREQUENCY,
    )
    labels: ClassVar = {"base": DIRECTIONS, "tilt": ("x", "y")}


def modes(
    stage: Stage,
    *,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    tilting: float | None = None,
    drives: Drives = "disengaged",
    damping: float = 1.0,
    models: Models = "both",
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> NaturalModes:
    """Natural frequencies and modes of a stage with a payload, in plane or three dimensions."""
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = answers.mesh_of(stage, models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    count = arguments.integer("count", count, MOST_SOLID if solid else MOST)
    carried = _payload(payload, tilting, solid)
    ratio = arguments.positive("damping", damping, MOST_DAMPING) / 100
    asked = VibratingStage(stage, carried, None, count)
    if drives == "engaged":
        if solid:
            raise BadInput(
                "drives 'engaged' with solid, expected disengaged: stacks act in the plane"
            )
        asked = asked._replace(drive=drive_of(stage))
    warnings = [*warning.of_stage(stage), *of_payload(stage, carried.mass)]
    analytic = dict[str, Dynamics]()
    if models != "elements":
        analytic = analytic_dynamics(asked, warnings)
        if count > RIGID_MODES:
            warnings.append(ABOVE_THIRD)
    found = {name: ModelAnswer({"frequency": by.frequencies}) for name, by in analytic.items()}
    values = _masses(asked)
    axes: dict[str, Sequence[str]] = {"mode": [str(k + 1) for k in range(count)]}
    notes = list[str]()
    fields: Vibration | None = None
    alike = dict[str, Array]()
    if mesh is not None:
        elements = _by_elements(asked, mesh, ratio, progress)
        found |= elements.models
        values |= elements.values
        fields = elements.vibration
        axes |= _axes_of(fields)
        warnings += _warnings_of(asked, mesh)
        notes += [f"mode {number}: {words}" for number, words in enumerate(fields.words, start=1)]
        if fields.reduced is not None:
            notes.append(fields.reduced.truncation_note)
        alike = {name: fields.likeness(by) for name, by in analytic.items()}
    rows = side_by_side(found, lowest_modes(found, count), count, alike)
    axes["mode"] = [*axes["mode"], *rows.alone]
    return setup.result_of(
        NaturalModes,
        answers.about(stage) if asked.drive is None else answers.about_driven(stage),
        in_rows(found, rows),
        mesh,
        {"drives": drives, "payload": _described(carried)},
        _with_rows(values, len(rows.alone)),
        axes,
        warnings=warnings,
        notes=notes,
        fields=fields,
    )


def _by_elements(
    asked: VibratingStage, mesh: Mesh, ratio: float, progress: Progress | None
) -> Found:
    """Return the modes by finite elements in the plane or, with layers, in three dimensions."""
    if mesh.layers:
        return in_depth(asked, mesh, progress)
    return in_plane(asked, mesh, ratio, progress)


def _with_rows(values: Mapping[str, Any], more: int) -> dict[str, Any]:
    """Return values by mode with more rows, of modes that finite elements do not have."""
    found = dict(values)
    for name, quantity in NaturalModes.quantities.items():
        if name in found and quantity.over[:1] == ("mode",):
            known = np.asarray(found[name])
            found[name] = np.concatenate([known, np.full((more, *known.shape[1:]), np.nan)])
    return found


def _masses(asked: VibratingStage) -> dict[str, Any]:
    """Return the masses that vibrate."""
    stage = asked.stage
    matrix = bodies.drawn_inertia(stage) + asked.payload.matrix
    return {
        "mass": matrix[0, 0],
        "inertia": matrix[2, 2],
        "hub_mass": bodies.hub_moments(stage)[0] * bodies.mass_per_area(stage),
    }


def _axes_of(found: Vibration) -> dict[str, Sequence[str]]:
    """Return the labels of modes and of motions of the base, in three dimensions."""
    if found.heights is None:
        return {}
    names = [f"{number} {KINDS[out]}" for number, out in enumerate(found.tilting, start=1)]
    return {"mode": names, "base": ALL_BASES}


def _warnings_of(asked: VibratingStage, mesh: Mesh) -> list[str]:
    """Warn of what finite elements leave out."""
    stage = asked.stage
    if mesh.layers:
        found = warning.held_faces(stage)
        return [*found, AT_ITS_PLACE] if any(asked.payload) else found
    found = [*warning.of_thickness(stage), OUT_OF_PLANE]
    return found if asked.drive is None else [*found, NO_STACKS]


def _described(payload: Payload) -> str | None:
    """Return a payload in words, None without one."""
    if not any(payload):
        return None
    return f"{payload.mass * KILOGRAM:g} kg, {payload.inertia * INERTIA:g} kg mm^2"


def _payload(
    payload: tuple[float, float],
    tilting: float | None,
    solid: bool,
) -> Payload:
    """Return the payload in internal units. Raises BadInput."""
    expected = "mass (kg) and moment of inertia (kg mm^2)"
    mass, inertia = arguments.pair("payload", payload, LARGEST_PAYLOAD, expected)
    least = inertia / 2
    if tilting is None:
        return payload_of(mass, inertia, least)
    if not solid:
        raise BadInput("tilting without solid, expected both: modes are in the plane")
    reason = " kg mm^2: a flat body has the least, half of its moment of inertia about the normal"
    most = LARGEST_PAYLOAD[1]
    return payload_of(mass, inertia, arguments.between("tilting", tilting, least, most, reason))


@question
def dynamic_model(
    stage: Stage,
    count: int = 12,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    damping: float = 1.0,
    resolution: int | None = None,
) -> DynamicModel:
    """Frequency response, state space and Craig-Bampton matrices of the platform under loads and
    strokes.

    Parameters
    ----------
    stage : Stage
        The stage.
    count : int
        Number of modes that are kept; the static part of the others is added.
    payload, drives, damping
        See `modes`.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.

    Returns
    -------
    DynamicModel

    Raises
    ------
    BadInput
        The stage cannot be made, or an option or a file is not valid.
    ComputationFailed
        The stage is singular, or a mesh or a solution does not pass its checks.

    Notes
    -----
    R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313. Shapes and units of all matrices:
    `DynamicModel`."""
    found = modes(
        stage,
        count=count,
        payload=payload,
        drives=drives,
        damping=damping,
        models="elements",
        resolution=resolution,
    )
    reduced: DynamicModel = found.fields.reduced
    return reduced
