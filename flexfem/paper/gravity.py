"""The nine-hinge stage under its own weight and that of a payload.

The stage stands upright in the plane, gravity at an angle to x; in three dimensions it lies
horizontally, gravity along -z. The centre of mass of the payload is at the platform's centre, in
the mid-plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.response import factorised_whole
from flexfem.fem.structure import mass_of, structure
from flexfem.mechanism.layout import Payload
from flexfem.paper import answers
from flexfem.paper import warnings as warning
from flexfem.paper.bodies import carried, carried_out_of_plane, drawn_inertia
from flexfem.paper.fields import neck_maxima
from flexfem.paper.model import analyse
from flexfem.paper.responses import under_weight
from flexfem.paper.solutions import meshed
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import layers_of, plate_of, sheet_of
from flexfem.questions import plates, setup
from flexfem.questions.bands import highest_band, pose_bands
from flexfem.questions.gravity import GRAVITY, UNDER_WEIGHT, MechanismGravity, acceleration
from flexfem.questions.plates import Values
from flexfem.questions.setup import DEFAULT, Analytic, Models
from flexfem.questions.warnings import of_payload
from flexfem.results import NEW_MESH, STRESS, Progress, Quantity
from flexfem.units import DENSITY, UNITS

HEAVIEST = 1e4  # kg


class Gravity(MechanismGravity):
    """Displacement and neck stress of a stage under its own weight and that of its payload."""

    figure = ""
    has_mesh_fields = False
    drawn_from_fields = False
    pose = Quantity("displacement", "motion", ("model", "direction"), NEW_MESH, "pose")
    sag = Quantity(
        "displacement out of the plane of a horizontal plate",
        ("mm", "rad", "rad"),
        ("model", "out of plane"),
        NEW_MESH,
        "all",
    )
    stress = Quantity("highest hinge stress", "mpa", ("model", "chain", "hinge"), STRESS, "all")
    mass = Quantity("mass, including pads, hub and payload", "kg")


def gravity(
    stage: Stage,
    *,
    angle: float = -90.0,
    payload: float = 0.0,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> Gravity:
    """Displacement and neck stress of a stage under its own weight and that of a payload."""
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = answers.mesh_of(stage, models, resolution, layers)
    weight = acceleration(angle)
    mass = arguments.between("payload", payload, 0.0, HEAVIEST, " kg") / UNITS["kg"].factor
    load = Payload(mass)
    warnings = [*warning.of_stage(stage), *of_payload(stage, load.mass)]
    if layers:
        models = "elements"  # the analytic model has no motion out of the plane
    chosen = answers.chosen(stage, analytic, warnings, models)
    solve = partial(_upright, stage, load, weight)
    bands = partial(_bands_upright, stage.lever)
    if layers:
        solve = partial(_horizontal, stage, load)
        bands = partial(_bands_horizontal, stage.lever)
        warnings += warning.held_faces(stage)
    elif mesh is not None:
        warnings += warning.of_thickness(stage)

    def by_pivots() -> Values:
        pose, stress = under_weight(chosen.stage, analyse(*chosen), load, weight)
        return {"pose": pose, "stress": stress}

    found = answers.by_models(mesh, models, by_pivots, solve, progress, bands)
    settings = {
        "plate": "horizontal" if layers else f"upright, gravity at {angle:g} degrees",
        "payload": f"{payload:g} kg",
        "analytic model": None if models == "elements" else chosen.name,
    }
    warnings += plates.over_yield(stage, found, "stress", UNDER_WEIGHT)
    values = {"mass": drawn_inertia(stage)[0, 0] + load.mass}
    about = answers.about(stage)
    return setup.result_of(Gravity, about, found, mesh, settings, values, warnings=warnings)


def _bands_upright(
    lever: float, sizes: Array, each: list[Values], _: Sequence[Values]
) -> dict[str, Array]:
    """Return the bands of displacement and neck stress by their values on three meshes."""
    poses = np.array([one["pose"] for one in each])[..., None]
    stresses = np.array([one["stress"] for one in each])
    return {
        "pose": pose_bands(sizes, poses, np.array([1.0, 1.0, lever]))[:, 0],
        "stress": highest_band(sizes, stresses),
    }


def _bands_horizontal(
    lever: float, sizes: Array, each: list[Values], ends: Sequence[Values]
) -> dict[str, Array]:
    """Return the band of the displacement out of the plane by three meshes and by few layers."""
    sags = np.array([one["sag"] for one in each])[..., None]
    few_and_many = np.array([one["sag"] for one in ends])[..., None]
    levers = np.array([1.0, lever, lever])
    return {"sag": pose_bands(sizes, sags, levers, few_and_many)[:, 0]}


def _upright(
    stage: Stage,
    load: Payload,
    weight: Array,
    resolution: int,
    _: int,
) -> Values:
    """Return displacement and neck stress of an upright stage in an acceleration (2,), mm/s^2."""
    mesh = meshed(stage, resolution)
    plate = plate_of(stage)
    whole = structure(mesh, plate)
    mass = mass_of(whole, stage.material.density * DENSITY, carried(stage, load))
    response = factorised_whole(whole).weight_response(mass, weight[None])
    stress = von_mises(nodal_stress(mesh, plate, response.nodal[0]), stage.layout.out_of_plane)
    return {"pose": response.motions[:, 0], "stress": neck_maxima(stage, mesh, stress)}


def _horizontal(
    stage: Stage,
    load: Payload,
    resolution: int,
    layers: int,
) -> Values:
    """Return displacement out of the plane and neck stress of a horizontal stage."""
    mesh = meshed(stage, resolution)
    plate = sheet_of(stage)
    in_depth = layers_of(stage, layers, antisymmetric=True)
    whole = structure(mesh, plate, in_depth)
    mass = mass_of(whole, stage.material.density * DENSITY, carried_out_of_plane(stage, load))
    response = factorised_whole(whole).weight_response(mass, np.array([[-GRAVITY]]))
    stress = von_mises(
        nodal_stress(mesh, plate, response.nodal[0], layers=in_depth), stage.layout.out_of_plane
    )
    highest = neck_maxima(stage, mesh, stress.max(axis=1))
    return {"sag": response.motions[:, 0], "stress": highest}
