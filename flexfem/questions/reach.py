"""Ends of the motion of the output of a mechanism by the strokes of all its actuators."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from flexfem.analytic.strokes import Displaced
from flexfem.arrays import Array, Index
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import finite, plates, setup
from flexfem.questions.driven import DriveSystem, stroke_limits
from flexfem.questions.plates import ON_MESHES
from flexfem.questions.poses import PoseSet
from flexfem.questions.setup import DEFAULT, Analytic, elements_through, options
from flexfem.results import ANALYTIC, ELEMENTS, SOLID, Quantity, Result

# actuators whose strokes are all combined: beams take 0.05 s for each combination
MOST_STACKS = 5


class Reach(Result):
    """Ends of the motion of the output of a mechanism by the strokes of all actuators."""

    kind_name = "mechanism_reach"
    title = "reach of the drive"
    main_result = ("ends", {"others": "free"})
    labels: ClassVar = {"others": ("zero", "free"), "end": ("low", "high")}
    footnotes: ClassVar[tuple[str, ...]] = (
        "others: the other two directions, free, or kept at zero by at least three actuators",
        "motion is counted from zero strokes; an actuator acts along its line at rest",
        "analytic, elastic bodies: linear theory; other models: at finite displacement",
    )
    ends = Quantity(
        "ends of the motion by the actuators, other directions zero or free",
        "motion",
        ("others", "end", "model", "direction"),
        ON_MESHES,
        "all",  # all components of an end may be round-off
    )


@options(not_for="load analytic")
def reach(
    mechanism: Mechanism,
    *,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
) -> Reach:
    """Poses that the drive of a stage reaches within all limits, or that a mechanism reaches within
    its strokes.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    load : tuple of float
        Load on the platform: N, N, N mm. Of a stage file only.
    models : {"both", "analytic"}
        "both" adds the ranges along the axes by finite elements.
    resolution : int, optional
        Triangles across every neck.
    solid : bool
        The whole plate of a mechanism by finite elements in three dimensions.
    analytic : Analytic
        The analytic model. Of a stage file only.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.

    Returns
    -------
    Reach
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        mechanism_reach` lists it. Of a stage file a result of kind `reach`.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.reach(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> [round(1e3 * float(x), 1) for x in found.at("ends", end="high", model="analytic", direction="x")]  # um
    [24.0, 28.6]
    """  # noqa: E501
    layers = elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    return motion_by_strokes(mechanism, mesh, models)


def motion_by_strokes(
    mechanism: Mechanism,
    mesh: setup.Mesh | None,
    models: setup.Models,
) -> Reach:
    """Return the ends of the motion of the output by the strokes of all actuators."""
    layout = mechanism.layout
    corners = _corners(mechanism)
    commands = [finite.by_strokes(layout, x) for x in corners.commands]
    changes = finite.changes(mechanism, mesh, commands)

    def of_network(elastic: bool) -> plates.Values:
        return {"poses": _poses(mechanism, plates.network(mechanism, elastic), corners, None)}

    def on_mesh(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> plates.Values:
        label = SOLID if layers or thick is not None else ELEMENTS
        response = plates.elements(mechanism, resolution, layers, thick)
        return {"poses": _poses(mechanism, response, corners, changes.of(label))}

    by_model = plates.by_models(mechanism, mesh, models, of_network, on_mesh)
    found = {label: _ends(one, corners, changes) for label, one in by_model.items()}
    warnings = changes.warnings("at the ends", mesh)
    notes = changes.notes("at the ends", mesh)
    return setup.answer(Reach, mechanism, found, mesh, warnings=warnings, notes=notes)


class _Corners(NamedTuple):
    """Commands (c, m) of a mechanism at the ends of its ranges by linear theory, and their numbers.

    numbers : (2 others zero or free, 2 low and high, 3), -1 where no commands hold the others at
    zero.
    """

    commands: Array
    numbers: Index


def _corners(mechanism: Mechanism) -> _Corners:
    """Return the commands at the ends of the ranges, by the network or, without hinges, by coarse
    finite elements.

    With the others free they are those of few actuators that beams with finite rotations move
    farthest."""
    layout = mechanism.layout
    if layout.joints:
        response = plates.network(mechanism)
    else:
        response = plates.elements(mechanism, plates.PART_RESOLUTION)
    system = DriveSystem.of_mechanism(mechanism, response.compliance)
    commands = PoseSet(system, stroke_limits(system), np.zeros(3)).ranges().commands
    if layout.joints and len(layout.actuators) <= MOST_STACKS:
        by_beams = _farthest_by_beams(mechanism, system)
        if by_beams is not None:
            commands[1] = by_beams
    rows = commands.reshape(-1, commands.shape[-1])
    known = ~np.isnan(rows).any(axis=1)
    unique, numbers = np.unique(rows[known], axis=0, return_inverse=True)
    found = np.full(len(rows), -1)
    found[known] = numbers.ravel()
    return _Corners(unique, found.reshape(commands.shape[:-1]))


def _farthest_by_beams(mechanism: Mechanism, system: DriveSystem) -> Array | None:
    """Return the commands (2 low and high, 3, m) of all combinations of ends of strokes that beams
    with finite rotations move farthest; None where they find no equilibrium.
    """
    drive = mechanism.layout.drive
    combined = np.array(list(product(*zip(drive.lowest, drive.highest, strict=True))))
    commands = [finite.by_strokes(mechanism.layout, x) for x in combined]
    changes = finite.changes(mechanism, None, commands).of(ANALYTIC)
    if changes is None:
        return None
    poses = combined @ system.poses.T + _of_output(changes)
    return combined[[np.argmin(poses, axis=0), np.argmax(poses, axis=0)]]


def _of_output(changes: Sequence[Displaced]) -> Array:
    """Return the motions (c, 3) of the output."""
    return np.array([one.motions[:3] for one in changes])


def _poses(
    mechanism: Mechanism,
    response: plates.Responses,
    corners: _Corners,
    changes: Sequence[Displaced] | None,
) -> Array:
    """Return the poses (c, 3) at commands by one model: linear theory, and changes (c) to add."""
    poses = corners.commands @ DriveSystem.of_mechanism(mechanism, response.compliance).poses.T
    return poses if changes is None else poses + _of_output(changes)


def _ends(
    found: setup.ModelAnswer, corners: _Corners, changes: finite.Changes
) -> setup.ModelAnswer:
    """Return the ends of the ranges from the poses at commands, and their bands with the errors of
    the changes.

    With the others free an end is that of the poses at all commands, since a finite displacement
    also moves the output along directions in which linear theory does not."""
    poses = found.values["poses"]
    widths = np.full(poses.shape, np.nan)
    if "poses" in found.bands and not changes.failure:
        widths = found.bands["poses"] + _of_output(changes.errors())
    at_rest = np.zeros(3)
    poses = np.vstack([poses, at_rest])
    widths = np.vstack([widths, at_rest])
    numbers = corners.numbers.copy()
    numbers[1] = [np.argmin(poses, axis=0), np.argmax(poses, axis=0)]
    axis = np.arange(3)
    known = numbers >= 0
    ends = np.where(known, poses[numbers, axis], np.nan)
    bands = np.where(known, widths[numbers, axis], np.nan)
    return setup.ModelAnswer({"ends": ends}, {"ends": bands} if found.bands else {})
