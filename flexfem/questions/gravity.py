"""A stage or mechanism under its own weight and a payload: displacement of the output and stress in
the hinges.

The plate stands upright in the plane, gravity at an angle to x; in three dimensions it lies
horizontally, gravity along -z. The centre of mass of the payload of a stage is at the platform's
centre, in the mid-plane."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, ClassVar

import numpy as np

from flexfem import arguments
from flexfem.analytic.plates import weighed
from flexfem.arrays import Array
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.ports import hinge_stress
from flexfem.fem.response import factorised_whole
from flexfem.fem.structure import mass_of, structure
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.bodies import carried, carried_out_of_plane, drawn_inertia
from flexfem.paper.fields import neck_maxima
from flexfem.paper.model import analyse
from flexfem.paper.responses import under_weight
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import layers_of, plate_of, sheet_of
from flexfem.questions import finite, plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import highest_band, pose_bands
from flexfem.questions.plates import Values
from flexfem.questions.setup import DEFAULT, LIFTED, Analytic, Models
from flexfem.results import FRESH, STRESS, Progress, Quantity, Result
from flexfem.units import DENSITY, UNITS

GRAVITY = 9806.65  # mm/s^2, standard gravity
HEAVIEST = 1e4  # kg


class Gravity(Result):
    """Displacement and hinge stress of a plate under its own weight and that of its payload and
    actuators.
    """

    title = "displacement under weight"
    main = ("pose", {})
    labels: ClassVar = {"out of plane": LIFTED}
    columns = ("direction", "out of plane")
    pose = Quantity("displacement", "motion", ("model", "point", "direction"), FRESH, "pose")
    sag = Quantity(
        "displacement out of the plane of a horizontal plate",
        ("mm", "rad", "rad"),
        ("model", "out of plane"),
        FRESH,
        "all",
    )
    stress = Quantity("highest hinge stress", "mpa", ("model", "chain", "hinge"), STRESS, "all")
    mass = Quantity("mass, including pads, hub and payload", "kg", only="stage")


class MechanismGravity(Gravity, mechanism=True):
    """The same of a mechanism."""


@setup.options(not_for="payload analytic", only_for="plane")
def gravity(
    stage: Mechanism,
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
) -> Gravity:
    """Displacement and hinge stress of a stage or mechanism under its own weight and that of a
    payload.

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
    Gravity
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        gravity` lists it.

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
    mesh = plates.mesh_of(stage, models, resolution, layers)
    angle = arguments.between("angle", angle, -360.0, 360.0, " degrees")
    g = GRAVITY * np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    settings: dict[str, Any] = {"gravity": f"at {angle:g} degrees"}
    warnings = list[str]()
    values = dict[str, Any]()
    load = Payload()
    if isinstance(stage, Stage):
        load = Payload(
            arguments.between("payload", payload, 0.0, HEAVIEST, " kg") / UNITS["kg"].factor
        )
        warnings += [*warning.of_stage(stage), *warning.of_payload(stage, load.mass)]
        models = "elements" if layers else models
        chosen = analytic.chosen(stage, warnings, models)
        plate = "horizontal" if layers else f"upright, gravity at {angle:g} degrees"
        name = None if models == "elements" else chosen.name
        settings = {"plate": plate, "payload": f"{payload:g} kg", "analytic model": name}
        values["mass"] = drawn_inertia(stage)[0, 0] + load.mass
        if mesh is not None:
            warnings += (warning.held_faces if layers else warning.of_thickness)(stage)

    def of_network(elastic: bool) -> Values:
        if isinstance(stage, Stage):
            pose, stress = under_weight(chosen.stage, analyse(*chosen), load, g)
            return {"pose": pose, "stress": stress}
        parts = plates.joined_parts(stage, elastic)
        motions, wrenches = weighed(stage.layout, g[None], *parts)
        points = 3 * len(stage.layout.points)
        stress = plates.stress_by(stage, wrenches[..., 0], elastic)
        return {"pose": motions[:points].reshape(-1, 3), "stress": stress}

    @cache
    def weighed_on(resolution: int, layers: int) -> tuple[Array, Array]:
        """Motions (k, 1) of the ports and stress (h,) in hinges by finite elements."""
        assert isinstance(stage, MechanismFile)
        model = plates.factorised(stage, resolution, layers)
        found = model.weighed(model.mass, g[None])
        return found.motions, hinge_stress(found, np.ones(1))

    def of_size(resolution: int, layers: int, thick: plates.Thickened | None = None) -> Values:
        if isinstance(stage, Stage):
            return _of_stage(stage, load, g, resolution, layers)
        motions, stress = weighed_on(resolution, layers)
        if thick is not None:
            motions = motions + thick.change(
                lambda parts: weighed(stage.layout, g[None], *parts)[0]
            )
            stress = stress * thick.stress_ratios(
                weighed(stage.layout, g[None], *thick.solid)[1][..., 0]
            )
        points = 3 * len(stage.layout.points)
        values = {"pose": motions[:points].reshape(-1, 3), "stress": stress}
        if layers:
            model = plates.factorised(stage, resolution, layers, lifting=True)
            values["sag"] = model.weighed(model.mass, np.array([[-GRAVITY]])).motions[:, 0]
        return values

    def bands(sizes: Array, each: list[Values], ends: Sequence[Values]) -> dict[str, Any]:
        if isinstance(stage, MechanismFile):
            return plates.value_bands(sizes, each, ends)
        lever = setup.lever_of(stage)
        name = "sag" if ends else "pose"
        poses, few_and_many = (
            np.array([one[name] for one in part])[..., None] for part in (each, ends)
        )
        band = pose_bands(
            sizes, poses, np.array([1.0, lever if ends else 1.0, lever]), few_and_many
        )[:, 0]
        stresses = np.array([one["stress"] for one in each])
        return {name: band} | ({} if ends else {"stress": highest_band(sizes, stresses)})

    found = plates.by_models(stage, mesh, models, of_network, of_size, progress, bands)
    warnings += plates.over_yield(stage, found, "stress", "under the weight")
    if isinstance(stage, MechanismFile) and stage.layout.joints:
        relative = finite.relative_bands(list(found.values())[-1], "pose", "stress")
        warnings += finite.by_weight(stage, g).warnings("under the weight", None, *relative)
    return setup.answer(Gravity, stage, found, mesh, settings, values, warnings=warnings)


def _of_stage(stage: Stage, load: Payload, g: Array, level: int, layers: int) -> Values:
    """Return the values of a stage on one mesh: upright in an acceleration (2,), mm/s^2, or with
    layers horizontal.
    """
    mesh = plates.meshed(stage, level)
    solid = layers > 0
    in_depth = layers_of(stage, layers, antisymmetric=True) if solid else None
    plate = sheet_of(stage) if solid else plate_of(stage)
    whole = structure(mesh, plate, in_depth)
    mass = mass_of(
        whole,
        stage.material.density * DENSITY,
        (carried_out_of_plane if solid else carried)(stage, load),
    )
    response = factorised_whole(whole).weighed(mass, np.array([[-GRAVITY]]) if solid else g[None])
    stress = von_mises(
        nodal_stress(mesh, plate, response.nodal[0], layers=in_depth), stage.layout.out_of_plane
    )
    highest = neck_maxima(stage, mesh, stress.max(axis=1) if solid else stress)
    return {"sag" if solid else "pose": response.motions[:, 0], "stress": highest}
