"""Natural modes of a stage, and how it answers loads and strokes in time."""

from __future__ import annotations

from flexfem import arguments
from flexfem.mechanism.drives import drive_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.reports.given import LARGEST_PAYLOAD, MOST_MODES, RESOLUTION, Progress, meshed_solid
from flexfem.verify import dynamic_model as verify_dynamic_model
from flexfem.verify import modes as verify_modes
from flexfem.verify import solid_modes as verify_solid_modes
from flexfem.verify.dynamic_model import DynamicModel
from flexfem.verify.modes import Drives, NaturalModes, Vibration
from flexfem.verify.solid_modes import SolidNaturalModes, SolidVibration

PAYLOAD = "mass (kg) and moment of inertia (kg mm^2)"
MOST_DAMPING = 99.0  # % of critical
FLAT = " kg mm^2: no body has less than a flat one, half of its moment of inertia about the normal"


def modes(
    stage: Stage,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    resolution: int = RESOLUTION,
    progress: Progress | None = None,
) -> NaturalModes:
    """Natural frequencies and modes in the plane, by finite elements with bands and by the analytic models.

    Parameters
    ----------
    count : how many, from the lowest.
    payload : mass, kg, and moment of inertia about the platform centre, kg mm^2, of what the platform carries there.
    drives : "engaged" adds the stiffness of the stacks, which hold their strokes; their mass is left out.
    resolution : of the finest of three meshes.   progress : called with a line after each mesh.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; drives are engaged that the stage does not have.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.modes(flexfem.load("geometry/mobility6.toml"), count=3, resolution=4)
    >>> [round(one.frequency) for one in found.modes]  # Hz
    [131, 131, 194]
    """
    return vibration(stage, count, payload, drives, resolution, progress).record


def vibration(
    stage: Stage,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    resolution: int = RESOLUTION,
    progress: Progress | None = None,
) -> Vibration:
    """As `modes`, with the shapes of the modes and the structure that has them. Raises as `modes`."""
    check_feasible(stage)
    wanted = arguments.integer("count", count, MOST_MODES)
    if drives not in verify_modes.DRIVES:
        raise BadInput(f"drives {drives!r}, expected {' or '.join(verify_modes.DRIVES)}")
    given = arguments.pair("payload", payload, LARGEST_PAYLOAD, PAYLOAD)
    carried = verify_modes.payload_of(*given)
    return verify_modes.natural_modes(stage, wanted, carried, drives, arguments.resolution(resolution, 4), progress)


def modes_solid(
    stage: Stage,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    tilting: float | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> SolidNaturalModes:
    """Natural frequencies and modes in three dimensions, in the plane and out of it, without stacks.

    Parameters
    ----------
    count : how many, from the lowest, of both kinds together.
    payload : mass, kg, and moment of inertia about the stage's normal, kg mm^2, with its centre of mass at the
        platform's centre, in the mid-plane.
    tilting : its moment of inertia about every axis in the mid-plane, kg mm^2; by default half of the other, which a
        flat body has, and no body less.
    resolution : triangles across every neck, from 4.   layers : in half the thickness, from 3.
    progress : called with a line when the modes in the plane are done, and when those out of it are.

    Raises
    ------
    BadInput, ComputationFailed
        As `under_load_solid`.
    """
    return vibration_solid(stage, count, payload, tilting, resolution, layers, progress).record


def vibration_solid(
    stage: Stage,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    tilting: float | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> SolidVibration:
    """As `modes_solid`, with the shapes of the modes. Raises as `modes_solid`."""
    check_feasible(stage)
    wanted = arguments.integer("count", count, verify_solid_modes.MOST)
    mass, inertia = arguments.pair("payload", payload, LARGEST_PAYLOAD, PAYLOAD)
    least, most = inertia / 2, LARGEST_PAYLOAD[1]
    about_diameter = least if tilting is None else arguments.between("tilting", tilting, least, most, FLAT)
    finest, through = meshed_solid(resolution, layers, usual=verify_solid_modes.RESOLUTION)
    carried = verify_modes.payload_of(mass, inertia, about_diameter)
    return verify_solid_modes.solid_natural_modes(stage, wanted, carried, finest, through, progress)


def dynamic_model(
    stage: Stage,
    count: int = 12,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    damping: float = 1.0,
    resolution: int = RESOLUTION,
) -> DynamicModel:
    """How the platform answers loads and, of engaged drives, strokes: frequency response, state space, Craig-Bampton.

    Parameters
    ----------
    count : of modes kept; what the others do at rest is added.   damping : of every mode, % of critical; assumed.
    payload, drives, resolution : as of `modes`.

    Raises
    ------
    BadInput, ComputationFailed
        As `modes`.

    Notes
    -----
    R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313. Shapes and units of all matrices: `DynamicModel`.
    """
    found = vibration(stage, count, payload, drives, resolution)
    return reduced(stage, found, damping)


def reduced(stage: Stage, found: Vibration, damping: float = 1.0) -> DynamicModel:
    """As `dynamic_model`, of modes that are known."""
    ratio = arguments.positive("damping", damping, MOST_DAMPING) / 100
    drive = drive_of(stage) if found.record.drives == "engaged" else None
    return verify_dynamic_model.dynamic_model(found.structure, found.modes, ratio, drive)
