"""Motion of the output of a mechanism by the full free stroke of each of its actuators."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from flexfem.analytic.strokes import Displaced
from flexfem.arrays import Array, Index
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import finite, plates, setup
from flexfem.questions.driven import ROUND_OFF, DriveSystem
from flexfem.questions.plates import ON_MESHES, PEAK
from flexfem.questions.setup import DEFAULT, Analytic, MeshFields, elements_through, options
from flexfem.results import ELEMENTS, FLOOR, SOLID, Quantity, Result


class Drive(Result):
    """Motion of a mechanism by its actuators, with all of them in place."""

    kind_name = "mechanism_drive"
    has_mesh_fields = True
    title = "drive"
    main_result = ("motion", {})
    figure = "displaced.drive_figure"
    drawn_from_fields = True
    footnotes: ClassVar[tuple[str, ...]] = (
        "all actuators are in place with their stiffness; a motion is that for the free stroke "
        "of one actuator, which acts along its line at rest",
        "analytic, elastic bodies: linear theory; other models: at finite displacement",
    )
    motion = Quantity(
        "motion for the full free stroke",
        "motion",
        ("actuator", "point", "model", "direction"),
        ON_MESHES,
        "all",
    )
    transmission = Quantity(
        "output motion per free stroke, at small strokes",
        ("", "", "rad_per_mm"),
        ("actuator", "model", "direction"),
        ON_MESHES,
        "all",
    )
    used = Quantity(
        "opening of the actuator over its free stroke",
        "percent",
        ("actuator", "model"),
        ON_MESHES,
        note="the rest of the stroke is lost to the elasticity of the actuator",
    )
    coupling = Quantity(
        "opening of the other actuators over the free stroke",
        "percent",
        ("actuator", "other", "model"),
        ON_MESHES,
        "all",
        detail=True,
    )
    cross = Quantity(
        "cross motion of the output over its main translation",
        "percent",
        ("actuator", "model"),
        ON_MESHES._replace(absolute=5e-3),
        "all",
    )
    rotation = Quantity(
        "parasitic rotation of the output over its main translation",
        "rad_per_mm",
        ("actuator", "model"),
        ON_MESHES._replace(absolute=1e-6),
        "all",
    )
    force = Quantity("force of the actuator at full stroke", "n", ("actuator", "model"), ON_MESHES)
    stress = Quantity(
        "highest hinge stress at full stroke",
        "mpa",
        ("actuator", "model", "hinge"),
        PEAK,
        "all",
        detail=True,
    )
    engaged = Quantity(
        "stiffness of the output with all actuators, other directions held",
        "stiffness",
        ("model", "direction"),
        ON_MESHES._replace(relative=1e-3),
        compared=False,  # it has that of bodies at small contacts
        detail=True,
    )
    engaged_free = Quantity(
        "stiffness of the output with all actuators, other directions free",
        "stiffness",
        ("model", "direction"),
        ON_MESHES._replace(relative=1e-3),
    )


@options(not_for="pose load analytic")
def drive(
    mechanism: Mechanism,
    *,
    pose: tuple[float, float, float] | None = None,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    models: Literal["both", "analytic"] = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
) -> Drive:
    """Motion of a mechanism by its actuators; of a stage, strokes and forces of the stacks for a
    pose.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    pose : tuple of float, optional
        Pose of the platform: mm, mm, rad. Of a stage file only.
    load : tuple of float
        Load on the platform: N, N, N mm. Of a stage file only.
    models : {"both", "analytic"}
        "both" adds finite elements; of a stage, under the strokes of the analytic model.
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
    Drive
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        mechanism_drive` lists it. Of a stage file a result of kind `drive`.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drive(flexfem.load("geometry/mobility6.toml"), pose=(2e-3, 1e-3, 0.0), models="analytic")
    >>> [round(float(stroke), 2) for stroke in found.at("command", criterion="least energy")]  # um, six pairs
    [0.33, 0.29, -0.75, 0.7, 0.42, -1.0]
    """  # noqa: E501
    layers = elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    layout = mechanism.layout
    commands = [finite.by_strokes(layout, strokes) for strokes in np.diag(layout.drive.highest)]
    changes = finite.changes(mechanism, mesh, commands)

    def of_network(elastic: bool) -> plates.Values:
        return _at_strokes(mechanism, plates.network(mechanism, elastic), None)

    def on_mesh(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> plates.Values:
        label = SOLID if layers or thick is not None else ELEMENTS
        response = plates.elements(mechanism, resolution, layers, thick)
        return _at_strokes(mechanism, response, changes.of(label))

    by_model = plates.by_models(mechanism, mesh, models, of_network, on_mesh)
    found = {label: _with_errors(layout, one, changes) for label, one in by_model.items()}
    warnings = plates.over_yield(mechanism, found, "stress", "full stroke")
    warnings += changes.warnings("at full stroke", mesh)
    return setup.answer(
        Drive,
        mechanism,
        found,
        mesh,
        axes={"other": layout.drive.names},
        warnings=warnings,
        notes=changes.notes("at full stroke", mesh),
        fields=_fields(mechanism, mesh),
    )


def _fields(mechanism: Mechanism, mesh: setup.Mesh | None) -> MeshFields | None:
    """Return the displacements by the full stroke of each actuator by plane finite elements."""
    if mesh is None:
        return None

    def made() -> dict[str, Array]:
        drive = mechanism.layout.drive
        response = plates.solved(mechanism, mesh.resolution)
        forces = DriveSystem.of_mechanism(mechanism, response.compliance).Y * drive.highest
        on_drives = response.fields[mechanism.layout.drive_ports]
        fields = np.tensordot(forces.T, on_drives, 1)
        return dict(zip(drive.names, fields, strict=True))

    return MeshFields(plates.meshed(mechanism, mesh.resolution), made)


class AtStrokes(NamedTuple):
    """State of a mechanism, or of designs (...), at the full stroke of each of a actuators.

    motions, loads : (..., a, k), of and on the ports, the actuators last.   stress : (..., a,
    hinges), MPa.
    """

    motions: Array
    loads: Array
    stress: Array

    def plus(self, changes: Sequence[Displaced]) -> AtStrokes:
        """Add the changes by finite displacements."""
        added = _states_of(changes)
        return AtStrokes(*(first + second for first, second in zip(self, added, strict=True)))


def _states_of(changes: Sequence[Displaced]) -> AtStrokes:
    return AtStrokes(
        np.array([one.motions for one in changes]),
        np.array([one.loads for one in changes]),
        np.array([one.stress for one in changes]),
    )


def _at_strokes(
    mechanism: Mechanism, response: plates.Responses, changes: Sequence[Displaced] | None
) -> dict[str, Any]:
    """Return the values of one model at the full stroke of each actuator.

    changes : (a), of linear theory by finite displacements.
    """
    layout = mechanism.layout
    strokes = layout.drive.highest
    C = response.compliance
    driven = DriveSystem.of_mechanism(mechanism, C)
    loads = (driven.Y * strokes).T @ np.eye(len(C))[layout.drive_ports]
    linear = AtStrokes(loads @ C, loads, response.stress(loads))
    at = linear if changes is None else linear.plus(changes)
    return {
        **values_at_strokes(at, linear, strokes, layout.lever),
        "engaged": driven.stiffness,
        "engaged_free": 1 / np.diag(driven.engaged),
    }


def values_at_strokes(
    at: AtStrokes,
    linear: AtStrokes,
    strokes: Array,
    lever: Array | float,
) -> dict[str, Array]:
    """Return quantities of `Drive` at the strokes (..., a) of the actuators of designs (...).

    at : state at finite displacement or by linear theory.   linear : the latter.   lever : (...),
    mm, of the output.
    """
    drives = slice(-strokes.shape[-1], None)
    opening = at.motions[..., drives] / strokes[..., None]
    coupled = np.where(np.eye(strokes.shape[-1]), np.nan, opening)
    main = _main_translation(at.motions)
    cross = main.across / main.along
    rotation = main.rotation / main.along
    arm = np.asarray(lever)[..., None]
    return {
        "motion": _of_points(at.motions, strokes.shape[-1]),
        "transmission": linear.motions[..., :3] / strokes[..., None],
        "used": 100 * _diagonal(opening),
        "coupling": 100 * np.where(np.abs(coupled) < ROUND_OFF, 0.0, coupled),
        "cross": 100 * np.where(np.abs(cross) < FLOOR, 0.0, cross),
        "rotation": np.where(np.abs(rotation) * arm < FLOOR, 0.0, rotation),
        "force": _diagonal(at.loads[..., drives]),
        "stress": at.stress,
    }


def _diagonal(matrices: Array) -> Array:
    """Return the diagonals (..., a) of matrices (..., a, a)."""
    return np.diagonal(matrices, axis1=-2, axis2=-1)


def _of_points(motions: Array, drives: int) -> Array:
    """Return the motions (..., points, 3) of the points from those of all ports (..., k).

    drives : number of ports of actuators, the last ones.
    """
    of_points = motions[..., : motions.shape[-1] - drives]
    return of_points.reshape(*of_points.shape[:-1], -1, 3)


class _MainTranslation(NamedTuple):
    """Motions of the output by each actuator, (..., a) each.

    axis : 0 or 1, of the larger translation.   along, across : this and the other translation, mm;
    the larger one is nan where it is round-off.   rotation : rad.
    """

    axis: Index
    along: Array
    across: Array
    rotation: Array


def _main_translation(motions: Array) -> _MainTranslation:
    """Return the main translations of motions (..., a, k) of the ports."""
    axis = np.argmax(np.abs(motions[..., :2]), axis=-1)
    along = np.take_along_axis(motions, axis[..., None], axis=-1)[..., 0]
    across = np.take_along_axis(motions, 1 - axis[..., None], axis=-1)[..., 0]
    moved = np.abs(along) > ROUND_OFF * np.max(np.abs(motions), axis=(-2, -1))[..., None]
    return _MainTranslation(axis, np.where(moved, along, np.nan), across, motions[..., 2])


LINEAR = ("transmission", "engaged", "engaged_free")  # quantities at small strokes


def _with_errors(
    layout: Layout, found: setup.ModelAnswer, changes: finite.Changes
) -> setup.ModelAnswer:
    """Add the possible errors of finite displacements to the bands of values at full stroke.

    Where these errors are not known, only values at small strokes keep their bands.
    """
    if "motion" not in found.bands:
        return found
    bands = dict(found.bands)
    if changes.failure:
        return found._replace(bands={name: band for name, band in bands.items() if name in LINEAR})
    error = _states_of(changes.errors())
    each = np.arange(len(error.motions))
    opening = 100 * error.motions[:, layout.drive_ports] / layout.drive.highest[:, None]
    main = _main_translation(found.values["motion"].reshape(len(each), -1))
    along = np.abs(main.along)
    relative = error.motions[each, main.axis] / along
    across = error.motions[each, 1 - main.axis] / along
    added = {
        "motion": _of_points(error.motions, len(each)),
        "used": np.diag(opening),
        "coupling": opening,
        "cross": 100 * across + np.abs(found.values["cross"]) * relative,
        "rotation": error.motions[:, 2] / along + np.abs(found.values["rotation"]) * relative,
        "force": np.diag(error.loads[:, layout.drive_ports]),
        "stress": error.stress,
    }
    for name, width in added.items():
        bands[name] = bands[name] + width
    return found._replace(bands=bands)
