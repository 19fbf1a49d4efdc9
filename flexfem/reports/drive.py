"""Driven stages: strokes for a pose, and the poses that are reached."""

from __future__ import annotations

from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.analytic.model import model_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput, ComputationFailed
from flexfem.reports.given import (
    LARGEST_AMPLITUDE,
    LARGEST_LOAD,
    LARGEST_POSE,
    RESOLUTION,
    Progress,
    finest_of,
    solver,
)
from flexfem.verify import command as verify_command
from flexfem.verify import reach as verify_reach
from flexfem.verify import workspace as verify_workspace
from flexfem.verify.command import Command
from flexfem.verify.reach import Reach
from flexfem.verify.workspace import Workspace


def command(
    stage: Stage,
    pose: ArrayLike,
    load: ArrayLike = (0.0, 0.0, 0.0),
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Command:
    """Strokes and forces of the stacks of a driven stage for a pose, and where its metal goes with them.

    Parameters
    ----------
    pose, load : (3,), of the platform and on it: mm, mm, rad and N, N, N mm.
    mobility, formula, links : of the model that computes the strokes, see `analyse`; without any, calibrated hinges
        and elastic links.
    resolution : of the finite elements; None leaves them out.

    Raises
    ------
    BadInput
        The stage has no actuators, cannot be made, or mobility and formula do not suit it.
    ComputationFailed
        Its commands do not move the platform in three directions, or as `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.command(flexfem.load("geometry/mobility6.toml"), [2e-3, 1e-3, 0], resolution=None)
    >>> [round(1e3 * stroke, 2) for stroke in found.criteria["least energy"].command]  # um, six pairs
    [0.33, 0.29, -0.75, 0.7, 0.42, -1.0]
    """
    check_feasible(stage)
    model = model_of(mobility, formula, links)
    at = arguments.vectors("pose", pose, 1, LARGEST_POSE)
    loaded = arguments.vectors("load", load, 1, LARGEST_LOAD)
    finest = finest_of(resolution)
    return verify_command.command(stage, at, loaded, model, finest)


def reach(
    stage: Stage,
    load: ArrayLike = (0.0, 0.0, 0.0),
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Reach:
    """The poses that a drive reaches within its limits: strokes, contacts that only push, blocking forces, yield.

    Parameters
    ----------
    load : (3,), on the platform, N, N, N mm.   mobility, formula, links, resolution : as of `command`.

    Raises
    ------
    BadInput
        As `command`.
    ComputationFailed
        The limits allow no pose at all, or as `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.reach(flexfem.load("geometry/mobility6.toml"), resolution=None)
    >>> x = found.ranges["x"]
    >>> round(1e3 * x.held.high, 1), round(1e3 * x.free.high, 1), len(found.faces)  # um
    (24.0, 28.6, 30)
    """
    check_feasible(stage)
    model = model_of(mobility, formula, links)
    loaded = arguments.vectors("load", load, 1, LARGEST_LOAD)
    finest = finest_of(resolution)
    return verify_reach.reach(stage, loaded, model, finest)


def workspace(
    stage: Stage,
    amplitude: float = 0.5,
    resolution: int = 4,
    progress: Progress | None = None,
    load: ArrayLike = (0.0, 0.0, 0.0),
) -> Workspace:
    """What large displacements do, and the poses that a drive reaches.

    Parameters
    ----------
    amplitude : mm, of displacements in X and Y; in theta 0.02 rad for every mm.
    resolution : of the finite elements.   progress : called with a line after every one of `steps_of` the stage.
    load : (3,), on the platform of a driven stage, N, N, N mm, see `reach`.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; a pose is out of reach.
    """
    check_feasible(stage)
    largest = arguments.positive("amplitude", amplitude, LARGEST_AMPLITUDE)
    loaded = arguments.vectors("load", load, 1, LARGEST_LOAD)
    if loaded.any() and not stage.actuator:
        raise BadInput("load: expected none, it is for the poses of a drive and the stage has no [[actuator]]")
    finest, say = arguments.resolution(resolution), progress or (lambda text: None)
    found = verify_workspace.workspace(stage, largest, finest, solver(progress), lambda axis: say(f"along {axis}"))
    if not stage.actuator:
        return found.model_copy(update={"no_reach": "no [[actuator]]: which poses a drive reaches is not known"})
    try:
        found = found.model_copy(update={"reach": reach(stage, loaded, resolution=resolution)})
    except ComputationFailed as failure:
        found = found.model_copy(update={"no_reach": str(failure)})
    say("limits of the drive")
    return found


def steps_of(stage: Stage) -> int:
    """How many steps `workspace` tells of: the mesh, three directions, the limits of the drive where there is one."""
    return 5 if stage.actuator else 4
