"""A mechanism under its own weight: displacement of the output and stress in the hinges.

The plate stands upright in the plane, gravity at an angle to x; in three dimensions it also lies
horizontally, gravity along -z.
"""

from __future__ import annotations

from functools import cache
from typing import ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.plates import weight_response
from flexfem.arrays import Array
from flexfem.fem.ports import hinge_stress
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import finite, plates, setup
from flexfem.questions.plates import ON_MESHES, PEAK, ElasticParts, Thickened, Values
from flexfem.questions.setup import DEFAULT, LIFTED, Analytic, MeshFields, ModelAnswer, Models
from flexfem.results import Progress, Quantity, Result

GRAVITY = 9806.65  # mm/s^2, standard gravity
UNDER_WEIGHT = "under the weight"


class MechanismGravity(Result):
    """Displacement and hinge stress of a plate under its own weight and that of its payload and
    actuators.
    """

    title = "displacement under weight"
    main_result = ("pose", {})
    figure = "displaced.gravity_figure"
    has_mesh_fields = True
    drawn_from_fields = True
    labels: ClassVar = {"out of plane": LIFTED}
    columns = ("direction", "out of plane")
    pose = Quantity("displacement", "motion", ("model", "point", "direction"), ON_MESHES, "pose")
    sag = Quantity(
        "displacement out of the plane of a horizontal plate",
        ("mm", "rad", "rad"),
        ("model", "out of plane"),
        ON_MESHES,
        "all",
    )
    stress = Quantity("highest hinge stress", "mpa", ("model", "hinge"), PEAK, "all")


@setup.options(not_for="payload analytic")
def gravity(
    mechanism: Mechanism,
    *,
    angle: float = -90.0,
    payload: float = 0.0,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> MechanismGravity:
    """Displacement and hinge stress of a mechanism under its own weight and that of a payload.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    angle : float
        Direction of gravity in the plane of an upright plate, degrees from x.
    payload : float
        Mass of a payload at the centre of the platform, kg. Of a stage file only.
    solid : bool
        The whole plate by finite elements in three dimensions. The plate is horizontal; a mechanism
        is also computed with an upright plate.
    models : {"both", "analytic", "elements"}
        The models to compute.
    analytic : Analytic
        The analytic model. Of a stage file only.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    MechanismGravity
        Of a stage file `Gravity`. Every number has the unit that its quantity declares: `unit`
        returns it, and `flexfem schema mechanism_gravity` or `flexfem schema gravity` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.gravity(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> (1e3 * found.pose[0, :2]).round(2) + 0.0  # um: upright, the platform sinks
    array([ -0.46, -13.85])
    """
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    weight = acceleration(angle)

    @cache
    def by_mesh(resolution: int, layers: int) -> Values:
        return _by_mesh(mechanism, weight, resolution, layers)

    def element_values(
        resolution: int,
        layers: int,
        thick: Thickened | None = None,
    ) -> Values:
        values = by_mesh(resolution, layers)
        return values if thick is None else _thickened(mechanism, weight, values, thick)

    def by_network(elastic: bool) -> Values:
        return _by_network(mechanism, weight, elastic)

    found = plates.by_models(mechanism, mesh, models, by_network, element_values, progress)
    return setup.answer(
        MechanismGravity,
        mechanism,
        found,
        mesh,
        {"gravity": f"at {angle:g} degrees"},
        warnings=_warnings(mechanism, weight, found),
        fields=_fields(mechanism, weight, mesh),
    )


def acceleration(angle: float) -> Array:
    """Return the acceleration (2,), mm/s^2, of gravity at an angle, degrees. Raises BadInput."""
    radians = np.deg2rad(arguments.between("angle", angle, -360.0, 360.0, " degrees"))
    return GRAVITY * np.array([np.cos(radians), np.sin(radians)])


def _by_network(
    mechanism: Mechanism,
    weight: Array,
    elastic: bool,
) -> Values:
    """Return displacement and hinge stress by the network of bodies and hinges."""
    parts = plates.joined_parts(mechanism, elastic)
    motions, wrenches = weight_response(mechanism.layout, weight[None], *parts)
    return {
        "pose": _at_points(mechanism, motions),
        "stress": plates.stress_by(mechanism, wrenches[..., 0], elastic),
    }


def _by_mesh(
    mechanism: Mechanism,
    weight: Array,
    resolution: int,
    layers: int,
) -> Values:
    """Return displacement and hinge stress by finite elements, with layers also the sag."""
    model = plates.factorised(mechanism, resolution, layers)
    found = model.weight_response(model.mass, weight[None])
    values = {
        "pose": _at_points(mechanism, found.motions),
        "stress": hinge_stress(found, np.ones(1)),
    }
    if layers:
        lifting = plates.factorised(mechanism, resolution, layers, lifting=True)
        along_z = np.array([[-GRAVITY]])
        values["sag"] = lifting.weight_response(lifting.mass, along_z).motions[:, 0]
    return values


def _fields(
    mechanism: Mechanism,
    weight: Array,
    mesh: setup.Mesh | None,
) -> MeshFields | None:
    """Return the displacement of the upright plate by plane finite elements; None without them."""
    if mesh is None:
        return None

    def made() -> dict[str, Array]:
        model = plates.factorised(mechanism, mesh.resolution)
        return {"displacement": model.weight_response(model.mass, weight[None]).fields[0]}

    return MeshFields(plates.meshed(mechanism, mesh.resolution), made)


def _thickened(
    mechanism: Mechanism,
    weight: Array,
    plane: Values,
    thick: Thickened,
) -> Values:
    """Return values of plane finite elements with the change by the thickness of the hinges."""

    def motions(parts: ElasticParts) -> Array:
        return weight_response(mechanism.layout, weight[None], *parts)[0]

    wrenches = weight_response(mechanism.layout, weight[None], *thick.solid)[1]
    return {
        "pose": plane["pose"] + _at_points(mechanism, thick.change(motions)),
        "stress": plane["stress"] * thick.stress_ratios(wrenches[..., 0]),
    }


def _at_points(mechanism: Mechanism, motions: Array) -> Array:
    """Return the displacements (points, 3) of motions (k, 1) of the ports."""
    points = len(mechanism.layout.points)
    return motions[: 3 * points].reshape(points, 3)


def _warnings(
    mechanism: Mechanism,
    weight: Array,
    found: dict[str, ModelAnswer],
) -> list[str]:
    """Warn of yield, and of displacements at which the linear solution is not valid."""
    warnings = plates.over_yield(mechanism, found, "stress", UNDER_WEIGHT)
    if not mechanism.layout.joints:
        return warnings
    bands = finite.relative_bands(list(found.values())[-1], "pose", "stress")
    limits = finite.by_weight(mechanism, weight)
    return [*warnings, *limits.warnings(UNDER_WEIGHT, None, *bands)]
