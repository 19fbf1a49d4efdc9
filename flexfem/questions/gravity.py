"""A stage or mechanism under its own weight and a payload: displacement of the output and stress in the hinges.

The plate stands upright in the plane, gravity at an angle to x; in three dimensions it lies horizontally, gravity along
-z. The centre of mass of the payload of a stage is at the platform's centre, in the mid-plane.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import analyse
from flexfem.analytic.plates import weighed
from flexfem.analytic.responses import under_weight
from flexfem.arrays import Array
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.fields import neck_maxima
from flexfem.fem.mesh import welded
from flexfem.fem.ports import hinge_stress
from flexfem.fem.response import factorised_whole
from flexfem.fem.stage_mesh import layers_of, out_of_plane_ratio_of, plate_of, sheet_of
from flexfem.fem.structure import mass_of, structure
from flexfem.mechanism.bodies import Payload, carried, carried_out_of_plane, drawn_inertia
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.questions import plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import highest_band, levels, pose_bands, solid_pose_bands
from flexfem.questions.plates import ON_MESHES, PEAK
from flexfem.questions.setup import DEFAULT, LIFTED, Analytic, Mesh, ModelAnswer, Models, on_meshes
from flexfem.results import ANALYTIC, ELEMENTS, FRESH, SOLID, STRESS, Progress, Quantity, Result
from flexfem.units import DENSITY, UNITS

GRAVITY = 9806.65  # mm/s^2, standard gravity
HEAVIEST = 1e4  # kg


class Gravity(Result):
    """Displacement and neck stress of a stage under its own weight and that of its payload."""

    title = "displacement under weight"
    main = ("pose", {})
    labels: ClassVar = {"out of plane": LIFTED}
    columns = ("direction", "out of plane")
    pose = Quantity("displacement of the platform", "motion", ("model", "direction"), FRESH, "pose", prefixed=True)
    sag = Quantity(
        "displacement of the platform out of the plane", ("mm", "rad", "rad"), ("model", "out of plane"), FRESH, "all",
        prefixed=True,
    )  # fmt: skip
    stress = Quantity(
        "highest neck stress", "mpa", ("model", "chain", "hinge"), STRESS, "all", largest=("chain", "hinge")
    )
    mass = Quantity("mass, including pads, hub and payload", "kg")


class MechanismGravity(Result):
    """Displacement and hinge stress of an upright mechanism under its own weight, payload and actuators included."""

    title = "displacement under weight"
    main = ("pose", {})
    labels: ClassVar = {"motion": LIFTED}
    columns = ("direction", "motion")
    pose = Quantity("displacement", "motion", ("model", "point", "direction"), ON_MESHES, "pose", prefixed=True)
    sag = Quantity(
        "displacement of the output out of the plane of a horizontal plate", ("mm", "rad", "rad"), ("model", "motion"),
        ON_MESHES, "all", prefixed=True,
    )  # fmt: skip
    stress = Quantity("highest hinge stress", "mpa", ("model", "hinge"), PEAK, "all", largest=("hinge",))


@setup.for_mechanisms(Gravity, MechanismGravity, not_for="payload analytic")
def gravity(
    stage: Stage | Mechanism,
    *,
    angle: float = -90.0,
    payload: float = 0.0,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> Gravity | MechanismGravity:
    """Displacement and hinge stress of a stage or mechanism under its own weight and that of a payload.

    Parameters
    ----------
    angle : float
        Direction of gravity in the plane of an upright plate, degrees from x.
    payload : float
        Mass of a payload at the centre of the platform, kg.
    layers : int, optional
        Three-dimensional model with this number of layers in half the thickness, from 3. The plate is horizontal; a
        mechanism is also computed with an upright plate.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.gravity(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> (1e3 * found.pose[0, :2]).round(2) + 0.0  # um: upright, the platform sinks
    array([ -0.46, -13.85])
    """
    mesh = setup.mesh_of(models, resolution, layers, usual_solid=setup.usual_solid(stage))
    angle = arguments.between("angle", angle, -360.0, 360.0, " degrees")
    g = GRAVITY * np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    if isinstance(stage, Mechanism):
        found = _of_mechanism(stage, g, mesh, models, progress)
        return setup.answer(MechanismGravity, stage, found, mesh, {"gravity": f"at {angle:g} degrees"})
    load = Payload(arguments.between("payload", payload, 0.0, HEAVIEST, " kg") / UNITS["kg"].factor)
    warnings, analytic_name, results = list(warning.of_stage(stage)), None, dict[str, ModelAnswer]()
    in_plane = models != "elements" and not layers
    chosen = analytic.chosen(stage, warnings if in_plane else [])
    if in_plane:
        pose, stress = under_weight(chosen.stage, analyse(*chosen), load, g)
        results[ANALYTIC], analytic_name = ModelAnswer({"pose": pose, "stress": stress}), chosen.name
    if mesh is not None and mesh.layers:
        results[SOLID] = _horizontal(stage, load, mesh)
        warnings += warning.held_faces(stage)
    elif mesh is not None:
        results[ELEMENTS] = _upright(stage, load, g, mesh.resolution, progress)
        warnings += warning.of_thickness(stage)
    highest = max(float(np.max(model.values["stress"])) for model in results.values())
    warnings += warning.of_yield(highest, stage.material.yield_strength, "under the weight")
    plate = "horizontal" if layers else f"upright, gravity at {angle:g} degrees"
    settings = {"plate": plate, "payload": f"{payload:g} kg", "analytic model": analytic_name}
    mass = drawn_inertia(stage)[0, 0] + load.mass
    return setup.answer(Gravity, stage, results, mesh, settings, {"mass": mass}, warnings=warnings)


def _of_mechanism(
    mechanism: Mechanism, g: Array, mesh: Mesh | None, models: Models, progress: Progress | None
) -> dict[str, ModelAnswer]:
    """Return the response of all models of a mechanism, upright and with layers also horizontal."""
    points = 3 * len(mechanism.layout.points)

    def of_network(elastic: bool) -> dict[str, Any]:
        motions, wrenches = weighed(mechanism.layout, g[None], *plates.joined_parts(mechanism, elastic))
        return {"pose": motions[:points].reshape(-1, 3), "stress": plates.stress_by(mechanism, wrenches[..., 0])}

    def of_size(resolution: int, layers: int) -> dict[str, Any]:
        model = plates.factorised(mechanism, resolution, layers)
        found = model.weighed(model.mass, g[None])
        values = {"pose": found.motions[:points].reshape(-1, 3), "stress": hinge_stress(found, np.ones(1))}
        if layers:
            model = plates.factorised(mechanism, resolution, layers, lifting=True)
            values["sag"] = model.weighed(model.mass, np.array([[-GRAVITY]])).motions[:, 0]
        return values

    return plates.by_models(mechanism, mesh, models, of_network, of_size, progress)


def _upright(stage: Stage, load: Payload, g: Array, resolution: int, progress: Progress | None) -> ModelAnswer:
    """Return the response of an upright plate by plane finite elements on three meshes."""
    steps, lever = levels(resolution), stage.chain.link_lengths[2]
    solutions = on_meshes(steps, lambda level: _by_elements(stage, load, g, level), progress)
    poses, stresses = (np.array(part) for part in zip(*solutions, strict=True))
    sizes = np.array(steps, dtype=float)
    bands = {"pose": pose_bands(sizes, poses[..., None], lever)[:, 0], "stress": highest_band(sizes, stresses)}
    return ModelAnswer({"pose": poses[-1], "stress": stresses[-1]}, bands)


def _horizontal(stage: Stage, load: Payload, mesh: Mesh) -> ModelAnswer:
    """Return the response in three dimensions; bands add those of the mesh in the plane and of the layers."""
    lever, g = stage.chain.link_lengths[2], np.array([-GRAVITY, 0.0])
    scale = np.array([[1.0], [lever], [lever]])
    sag, stress = _by_elements(stage, load, g, *mesh)
    bands = solid_pose_bands(lambda *sizes: scale * _by_elements(stage, load, g, *sizes)[0][:, None], *mesh)
    return ModelAnswer({"sag": sag, "stress": stress}, {"sag": (bands / scale)[:, 0]})


def _by_elements(stage: Stage, load: Payload, g: Array, level: int, layers: int = 0) -> tuple[Array, Array]:
    """Return pose and neck stress on one mesh under an acceleration (2,), mm/s^2: in x and y, or with layers in z."""
    mesh, solid = welded(setup.sectors_of(stage, level))[0], layers > 0
    in_depth = layers_of(stage, layers, antisymmetric=True) if solid else None
    plate = sheet_of(stage) if solid else plate_of(stage)
    platform = (carried_out_of_plane if solid else carried)(stage, load)
    whole = structure(mesh, plate, in_depth)
    mass = mass_of(whole, stage.material.density * DENSITY, platform)
    response = factorised_whole(whole).weighed(mass, g[None, : 1 if solid else 2])
    stress = von_mises(nodal_stress(mesh, plate, response.nodal[0], layers=in_depth), out_of_plane_ratio_of(stage))
    return response.motions[:, 0], neck_maxima(stage, mesh, stress.max(axis=1) if solid else stress)
