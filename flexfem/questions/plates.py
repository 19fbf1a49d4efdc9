"""Models of stages and mechanisms, with bands, and the errors of the analytic ones of mechanisms.

Numbers follow from the motions of the ports and from the stress in the hinges, by the analytic network with rigid
bodies, the network of elastic parts, and finite elements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.plates import respond
from flexfem.arrays import Array
from flexfem.fem.elements import Layers
from flexfem.fem.fields import neck_stresses
from flexfem.fem.mesh import RESOLUTION, StageMesh, welded
from flexfem.fem.plate_bodies import body_compliances, hinge_compliances
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import PlateModel, hinge_stress, plate_model
from flexfem.fem.response import Response
from flexfem.fem.stage_mesh import layers_of as layers_of_plate
from flexfem.files.tables import once
from flexfem.mechanism.layout import ElasticBody, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import SAFETY, coarser, corner_bands, error_bands, levels, solve_solid
from flexfem.questions.setup import ELASTIC, Mesh, ModelAnswer, Models, answer, on_meshes, sectors_of
from flexfem.questions.setup import solved as solved_stage
from flexfem.results import ANALYTIC, COARSER, ELEMENTS, MAGNITUDE, SOLID, STRESS, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

PART_RESOLUTION = 4  # of the finite elements of single parts
ROUND_OFF = 1e-9
PEAK_BAND = 0.01  # least relative band of a highest stress at resolution 8, see `value_bands`
PEAKS = ("stress", "hinge_stress", "yield_range", "yield_force")
ON_MESHES, PEAK = COARSER._replace(band=MAGNITUDE), STRESS._replace(band=MAGNITUDE)
POINTS = ON_MESHES._replace(absolute=100 * COARSER.relative)  # percentage points of a command


class Responses(NamedTuple):
    """Response of one model to c cases, which are unit loads on the k ports unless stated otherwise.

    compliance : (k, c), displacements conjugate to the ports.
    stress : function of loads (..., c), multiples of the cases, returns the highest stress (..., hinges), MPa.
    """

    compliance: Array
    stress: Callable[[Array], Array]


class ElasticParts(NamedTuple):
    """Elastic bodies and compliances (h, 3, 3) of hinges; without them bodies are rigid, and hinges beam integrals."""

    bodies: tuple[ElasticBody, ...] = ()
    hinges: Array | None = None


@once
def meshed(plate: Stage | Mechanism, resolution: int) -> StageMesh:
    """Mesh the plate."""
    if isinstance(plate, Stage):
        return welded(sectors_of(plate, resolution))[0]
    return mesh_layout(plate.layout, resolution)


def layers_of(plate: Stage | Mechanism, number: int) -> Layers | None:
    """Return layers graded for the narrowest neck; None for number 0, in the plane."""
    return layers_of_plate(plate, number) if number else None


@once
def model_of(mechanism: Mechanism, resolution: int) -> PlateModel:
    """Factorise finite elements in the plane."""
    return plate_model(mechanism.layout, meshed(mechanism, resolution))


def factorised(mechanism: Mechanism, resolution: int, layers: int = 0, lifting: bool = False) -> PlateModel:
    """Factorise finite elements; those with layers are not kept, because they take gigabytes.

    lifting : for motion out of the plane, with layers.
    """
    through = layers_of(mechanism, layers)
    if through is None:
        return model_of(mechanism, resolution)
    return plate_model(mechanism.layout, meshed(mechanism, resolution), through.antisymmetric if lifting else through)


def solved(plate: Stage | Mechanism, resolution: int, layers: int = 0) -> Response:
    """Solve finite elements for unit loads on all ports, of a stage on its platform."""
    if isinstance(plate, Stage):
        return solve_solid(plate, resolution, layers) if layers else solved_stage(plate, resolution)
    return factorised(plate, resolution, layers).response() if layers else _in_plane(plate, resolution)


@once
def _in_plane(mechanism: Mechanism, resolution: int) -> Response:
    return model_of(mechanism, resolution).response()


@once
def parts_of(mechanism: Mechanism, resolution: int = PART_RESOLUTION) -> ElasticParts:
    """Return the compliance of every moving body and every hinge by finite elements of it alone."""
    return parts_in(mechanism.layout, meshed(mechanism, resolution))


def parts_in(layout: Layout, mesh: StageMesh) -> ElasticParts:
    """Return the compliance of every moving body and every hinge by finite elements of it alone, on a mesh."""
    return ElasticParts(body_compliances(layout, mesh), hinge_compliances(layout, mesh))


def joined_parts(mechanism: Mechanism, elastic: bool) -> ElasticParts:
    """Return the parts of the analytic network, rigid bodies or elastic ones."""
    return parts_of(mechanism) if elastic else ElasticParts()


def stress_by(mechanism: Mechanism, wrenches: Array) -> Array:
    """Return the highest stress (..., hinges), MPa, of hinges under wrenches (..., hinges, 3)."""
    layout = mechanism.layout
    plate = layout.thickness, layout.out_of_plane
    return np.stack([one.profile.stress(wrenches[..., h, :], *plate) for h, one in enumerate(layout.joints)], axis=-1)


@once
def network(mechanism: Mechanism, elastic: bool = False) -> Responses:
    """Return the response of the analytic network with rigid bodies or with elastic parts."""
    parts = joined_parts(mechanism, elastic)
    found = respond(mechanism.layout, parts.bodies, hinges=parts.hinges)
    return Responses(
        found.compliance,
        lambda loads: stress_by(mechanism, np.einsum("hck,...k->...hc", found.wrenches, loads)),
    )


def elements(plate: Stage | Mechanism, resolution: int, layers: int = 0) -> Responses:
    """Return the response of finite elements."""
    return responses(plate, solved(plate, resolution, layers))


def responses(plate: Stage | Mechanism, response: Response) -> Responses:
    """Return compliance and stress of finite elements; the hinges of a stage are those of (3 chains, 3 hinges)."""

    def stress(loads: Array) -> Array:
        if isinstance(plate, Mechanism):
            return hinge_stress(response, loads)
        return neck_stresses(plate, response, loads.reshape(-1, 3)).highest.reshape(*loads.shape[:-1], 3, 3)

    return Responses(response.compliance, stress)


Values: TypeAlias = dict[str, Any]  # of one model by quantity
Bands: TypeAlias = Callable[[Array, list[Values], Sequence[Values]], Mapping[str, Any]]
"""Function from the resolutions of three meshes and the values on them to bands.

The last argument has the values on the coarsest mesh with few and with many layers, or is empty in the plane.
"""


def value_bands(sizes: Array, each: list[Values], ends: Sequence[Values] = ()) -> dict[str, Any]:
    """Return the bands of values on three meshes of resolutions `sizes`, in three dimensions with those of layers.

    Highest stresses on three meshes can agree by chance. Their bands have a least value, which falls with the square of
    the resolution. `benchmarks/mechanism_bands.py` counts how many bands contain the values of a finer mesh.
    """
    found = {name: corner_bands(sizes, np.array([one[name] for one in each])) for name in each[0]}
    if ends:
        few, many = ends
        found = {name: band + SAFETY * np.abs(many[name] - few[name]) for name, band in found.items()}
    least = PEAK_BAND * (8 / sizes[-1]) ** 2
    return found | {name: np.maximum(found[name], least * np.abs(each[-1][name])) for name in PEAKS if name in found}


def by_elements(
    mesh: Mesh,
    solve: Callable[[int, int], Values],
    progress: Progress | None = None,
    bands: Bands = value_bands,
    whole: bool = False,
) -> dict[str, ModelAnswer]:
    """Return the values of plane finite elements, of three dimensions if they are asked for, and their bands.

    solve : values with a resolution and a number of layers, 0 in the plane.
    whole : in three dimensions, solve the finest mesh with all layers, and no plane problem.

    Notes
    -----
    Otherwise a value in three dimensions is that of the coarsest mesh with all layers, plus the change to the finest
    mesh with one layer: `v(coarse, layers) + v(fine, 1) - v(coarse, 1)`. So no fine mesh has many layers. On a stage
    with 24 leaf springs this is within 1e-5 of the compliance, and 0.5 % of the stress, of the finest mesh with three
    layers.
    """
    steps, found = levels(mesh.resolution), dict[str, ModelAnswer]()
    sizes = np.array(steps, dtype=float)
    if not (whole and mesh.layers):
        each = on_meshes(steps, lambda level: solve(level, 0), progress)
        found[ELEMENTS] = ModelAnswer(each[-1], bands(sizes, each, ()))
    if mesh.layers:
        planes, (few, many) = coarser(solve, *mesh, progress)
        joined = None if whole else {name: planes[-1][name] + many[name] - planes[0][name] for name in many}
        found[SOLID] = ModelAnswer(joined or solve(*mesh), bands(sizes, planes, (few, many)))
    return found


def by_models(
    plate: Stage | Mechanism,
    mesh: Mesh | None,
    models: Models,
    of_network: Callable[[bool], Values],
    of_size: Callable[[int, int], Values],
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return the values of all requested models, with bands of finite elements; a stage has one analytic model.

    of_network : values with rigid bodies or, for True, with elastic parts.   of_size : see `by_elements`.
    """
    stage = isinstance(plate, Stage)
    labels = () if models == "elements" else (ANALYTIC,) if stage or models == "analytic" else (ANALYTIC, ELASTIC)
    found = {label: ModelAnswer(of_network(label == ELASTIC)) for label in labels}
    return found if mesh is None else found | by_elements(mesh, of_size, progress, bands, whole=stage)


def of_models(
    mechanism: Mechanism,
    mesh: Mesh | None,
    models: Models,
    values: Callable[[Responses], Values],
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return values that follow from the response to loads on the ports, by all requested models."""
    return by_models(
        mechanism,
        mesh,
        models,
        lambda elastic: values(network(mechanism, elastic)),
        lambda *size: values(elements(mechanism, *size)),
        progress,
        bands,
    )


def over_yield(plate: Stage | Mechanism, found: Mapping[str, ModelAnswer], stress: str, where: str) -> list[str]:
    """Warn of a highest stress above the yield strength; `stress` names the quantity, `where` the load."""
    highest = max(
        float(np.max(model.values[stress], initial=0.0)) for model in found.values() if stress in model.values
    )
    return warning.of_yield(highest, plate.material.yield_strength, where)


class MechanismErrors(Result):
    """Error of the finite-element displacement under the force that the analytic network predicts for a command."""

    title = "errors of the finite-element displacement"
    main = ("percent", {})
    labels: ClassVar = {"commanded": DIRECTIONS}
    reading = ("rotations are multiplied by the lever of the output",)
    percent = Quantity(
        "positioning error, % of the commanded motion", "percents", ("model", "commanded", "direction"), POINTS
    )
    stiffness = Quantity("stiffness", "stiffness", ("model", "direction"), ON_MESHES, shown=False)
    lever = Quantity("lever of the output: distance to its farthest hinge", "mm")


def compliances(mechanism: Mechanism, steps: Sequence[int], progress: Progress | None = None) -> Array:
    """Return the compliances (levels, 3, 3) of the output by plane finite elements."""
    return np.array([one.compliance[:3, :3] for one in on_meshes(steps, partial(solved, mechanism), progress)])


def verification(mechanism: Mechanism) -> MechanismErrors:
    """Return the errors of both analytic networks of a mechanism."""
    steps, lever, models = levels(RESOLUTION), mechanism.layout.lever, dict[str, ModelAnswer]()
    C = compliances(mechanism, steps)
    for label in (ANALYTIC, ELASTIC):
        K = np.asarray(np.linalg.inv(network(mechanism, label == ELASTIC).compliance[:3, :3]))
        values, bands = error_bands(K, C, steps, lever)
        models[label] = ModelAnswer({"percent": values.T, "stiffness": np.diag(K)}, {"percent": bands.T})
    return answer(MechanismErrors, mechanism, models, Mesh(RESOLUTION, 0), {}, {"lever": lever})
