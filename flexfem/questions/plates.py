"""Models of mechanisms, with bands, and the errors of the analytic ones.

Numbers follow from the motions of the ports and from the stress in the hinges, by the analytic
network with rigid bodies, the network of elastic parts, and finite elements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from flexfem.analytic.plates import compliance_ratios, respond
from flexfem.arrays import Array
from flexfem.fem.body_stress import (
    BodyStress,
    body_stress,
    corners_of_bodies,
    left_out_within,
    moving_bodies,
    point_stress,
)
from flexfem.fem.elements import Layers
from flexfem.fem.mesh import PlaneMesh
from flexfem.fem.plate_bodies import body_compliances, hinge_compliances
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import (
    PlateModel,
    held_nodes,
    hinge_stress,
    layers_of_layout,
    plate_model,
    plate_modes,
)
from flexfem.fem.response import Response
from flexfem.fem.thickness import FEW_LAYERS, MANY_LAYERS, ThickHinge, thick_hinges
from flexfem.files.tables import memoized
from flexfem.hinges.wide import contraction
from flexfem.mechanism.layout import ElasticBody, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import warnings as warning
from flexfem.questions.bands import (
    SAFETY,
    coarser,
    corner_bands,
    levels,
)
from flexfem.questions.setup import (
    ELASTIC,
    Mesh,
    ModelAnswer,
    Models,
    on_meshes,
)
from flexfem.questions.setup import mesh_of as plain_mesh_of
from flexfem.results import (
    ANALYTIC,
    COARSE_MESHES,
    ELEMENTS,
    MAGNITUDE,
    SOLID,
    STRESS,
    Progress,
)

PART_RESOLUTION = 4  # of the finite elements of single parts
# of a stress per change of temperature, relative to the largest one: smaller ones are zero
ROUND_OFF = 1e-9
MOST_CORNERS = 6  # of a body that a warning lists
BY_ELEMENTS = "stiffness or converge, by finite elements alone"
PEAK_BAND = 0.01  # least relative band of a highest stress at resolution 8, see `value_bands`
PEAKS = (
    "stress",
    "hinge_stress",
    "yield_range",
    "free_yield_range",
    "yield_force",
    "body_stress",
    "body_rate",
    "free_body_rate",
    "point_stress",
    "strain",
)
# of highest stresses, which change from mesh to mesh
PLACES = ("body_x", "body_y", "yield_x", "yield_y", "strain_x", "strain_y")
# Possible errors of `thickness_of`, measured on whole plates in three dimensions
# (`benchmarks/thickness.py`): shares
# of the difference between ends of hinges that keep their thickness and that contract freely,
OF_CONTRACTION = 0.3
OF_PLANE_STRAIN = 0.15  # of the change of bodies from plane stress to plane strain
# of the change of the von Mises stress of a free edge from plane stress to plane strain,
OF_CONSTRAINT = 0.3
OF_THE_RATIO = 0.2  # of the change of the stress in hinges
ORDER_OF_LAYERS = 2  # least order of convergence with the number of layers
# share of bodies in a compliance above which the whole plate is solved in three dimensions
SLENDER_BODIES = 0.4
WHOLE_LAYERS = 3
LIFTED_RESOLUTION = 2  # triangles across every neck, for motion out of the plane
LIFTED_LAYERS = (1, 2)  # in half the thickness
# Possible error of a frequency out of the plane by this resolution: at most 0.15 % was found of
# plates from THIN necks; the error grows in thinner plates, to 1.1 % at half a neck
# (`benchmarks/numbers_in_the_part.py`).
LIFTED_MESH = 2e-3
THIN = 5.0
MOST_OF_THIN = 10.0  # times `LIFTED_MESH`
ON_MESHES = COARSE_MESHES._replace(band=MAGNITUDE)
PEAK = STRESS._replace(band=MAGNITUDE)


class Responses(NamedTuple):
    """Response of one model to c cases, which are unit loads on the k ports unless stated
    otherwise.

    compliance : (k, c), displacements conjugate to the ports.
    stress : function of loads (..., c), multiples of the cases, returns the highest stress (...,
    hinges), MPa.
    bodies : the same of the moving bodies, with its places; None of a model that has no stress of
    bodies.
    points : the same at the points (..., points); None of such a model.
    """

    compliance: Array
    stress: Callable[[Array], Array]
    bodies: Callable[[Array], BodyStress] | None = None
    points: Callable[[Array], Array] | None = None


class ElasticParts(NamedTuple):
    """Elastic bodies and compliances (h, 3, 3) of hinges; without them bodies are rigid, and hinges
    beam integrals.
    """

    bodies: tuple[ElasticBody, ...] = ()
    hinges: Array | None = None


@memoized
def meshed(mechanism: Mechanism, resolution: int) -> PlaneMesh:
    """Mesh the plate."""
    return mesh_layout(mechanism.layout, resolution)


def layers_of(mechanism: Mechanism, number: int) -> Layers | None:
    """Return layers graded for the narrowest neck; None for number 0, in the plane."""
    return layers_of_layout(mechanism.layout, number) if number else None


@memoized
def model_of(mechanism: Mechanism, resolution: int) -> PlateModel:
    """Factorise finite elements in the plane."""
    return plate_model(mechanism.layout, meshed(mechanism, resolution))


def factorised(
    mechanism: Mechanism, resolution: int, layers: int = 0, lifting: bool = False
) -> PlateModel:
    """Factorise finite elements; those with layers are not kept, because they take gigabytes.

    lifting : for motion out of the plane, with layers.
    """
    through = layers_of(mechanism, layers)
    if through is None:
        return model_of(mechanism, resolution)
    if lifting:
        through = through.antisymmetric
    return plate_model(mechanism.layout, meshed(mechanism, resolution), through)


def solved(
    mechanism: Mechanism,
    resolution: int,
    layers: int = 0,
) -> Response:
    """Solve finite elements for unit loads on all ports."""
    if layers:
        return factorised(mechanism, resolution, layers).response()
    return _in_plane(mechanism, resolution)


@memoized
def _in_plane(mechanism: Mechanism, resolution: int) -> Response:
    return model_of(mechanism, resolution).response()


@memoized
def parts_of(mechanism: Mechanism, resolution: int = PART_RESOLUTION) -> ElasticParts:
    """Return the compliance of every moving body and every hinge by finite elements of it alone."""
    return parts_in(mechanism.layout, meshed(mechanism, resolution))


def parts_in(layout: Layout, mesh: PlaneMesh) -> ElasticParts:
    """Return the compliance of every moving body and every hinge by finite elements of it alone, on
    a mesh.
    """
    return ElasticParts(body_compliances(layout, mesh), hinge_compliances(layout, mesh))


class Lifted(NamedTuple):
    """Response of a plate out of the plane: z of the output and its tilts about x and y.

    compliance, stiffness : (3, 3), in mm, rad, N and N mm, with their bands.
    frequency, frequency_band : the first one, rad/s.
    """

    compliance: Array
    compliance_band: Array
    stiffness: Array
    stiffness_band: Array
    frequency: float
    frequency_band: float


@memoized
def lifted(mechanism: Mechanism) -> Lifted:
    """Solve finite elements out of the plane, on a mesh that is coarse in the plane, with few and
    with more layers.

    Raises ComputationFailed for too many unknowns.
    """
    compliances = list[Array]()
    frequencies = list[float]()
    for layers in LIFTED_LAYERS:
        model = factorised(mechanism, LIFTED_RESOLUTION, layers, lifting=True)
        compliances.append(model.response().compliance)
        frequencies.append(float(plate_modes(model, 1).frequencies[0]))
    stiffness = [np.asarray(np.linalg.inv(C), dtype=float) for C in compliances]
    few, many = frequencies
    of_mesh = lifted_mesh_error(mechanism.layout)
    return Lifted(
        compliances[-1],
        _of_layers(compliances[0], compliances[1], of_mesh),
        stiffness[-1],
        _of_layers(stiffness[0], stiffness[1], of_mesh),
        many,
        SAFETY * abs(many - few) + of_mesh * many,
    )


def lifted_mesh_error(layout: Layout) -> float:
    """Return the possible error, relative, of a frequency out of the plane by the mesh in the
    plane.
    """
    neck = min((joint.profile.neck for joint in layout.joints), default=layout.thickness / THIN)
    return LIFTED_MESH * float(np.clip(THIN * neck / layout.thickness, 1.0, MOST_OF_THIN))


def _of_layers(
    few: Array,
    many: Array,
    of_mesh: float,
) -> Array:
    """Band (3, 3) of a matrix out of the plane by its layers and its mesh, which changes it by
    twice a frequency.
    """
    scale = np.sqrt(np.outer(np.diag(many), np.diag(many)))
    return np.asarray(SAFETY * np.abs(many - few) + 2 * of_mesh * scale)


class Thickened(NamedTuple):
    """The plane parts of a mechanism, and the same with hinges in three dimensions.

    hinges : of the layout, in its order.   share : of the change of their stress that is taken.
    of_bodies : ratio of the highest stress of bodies to that in plane stress.
    """

    plane: ElasticParts
    solid: ElasticParts
    hinges: tuple[ThickHinge, ...]
    share: float = 1.0
    of_bodies: float = 1.0

    def change(self, of_parts: Callable[[ElasticParts], Array]) -> Array:
        """Change of a value of the network of parts from plane stress to three dimensions."""
        return of_parts(self.solid) - of_parts(self.plane)

    def stress_ratios(self, wrenches: Array) -> Array:
        """Ratios (..., h) of highest stresses to those in plane stress, of hinges under wrenches
        (..., h, 3).
        """
        alike = dict[int, list[int]]()
        ratios = np.ones(wrenches.shape[:-1])
        for number, hinge in enumerate(self.hinges):
            alike.setdefault(id(hinge), []).append(number)
        for numbers in alike.values():
            ratios[..., numbers] = self.hinges[numbers[0]].stress_ratio(wrenches[..., numbers, :])
        return 1 + self.share * (ratios - 1)

    def strain_ratios(self, wrenches: Array) -> Array:
        """Ratios (h,) of strains to those in plane stress, of hinges under wrenches (h, 3).

        At the faces a hinge bends nearly as in plane stress. One variant has the change of the
        openings instead."""
        assert self.plane.hinges is not None and self.solid.hinges is not None
        works = [
            np.einsum("hi,hij,hj->h", wrenches, C, wrenches)
            for C in (self.plane.hinges, self.solid.hinges)
        ]
        loaded = works[0] > 0
        ratios = np.ones(len(wrenches))
        if self.share != 1:
            ratios[loaded] = works[1][loaded] / works[0][loaded]
        return ratios


@memoized
def thickness_of(mechanism: Mechanism) -> tuple[Thickened, ...]:
    """Return the effect of the thickness, then possible variants of it, whose differences from it
    bound its error.

    Nothing for a plane model, and for a mechanism without hinges.

    Notes
    -----
    In three dimensions the compliance of a plate is that of plane finite elements plus the change
    of the network of its parts when hinges have their compliance in three dimensions. Bodies are in
    plane stress. The variants have ends of hinges that contract, more layers by extrapolation,
    bodies that are partly in plane strain, and another stress."""
    layout = mechanism.layout
    if mechanism.model != "three_dimensional" or not layout.joints:
        return ()
    plane = parts_of(mechanism)
    hinges = thick_hinges(layout, meshed(mechanism, PART_RESOLUTION))
    solid = _hinges_in_depth(layout, plane, hinges)
    held = np.array([hinge.change for hinge in hinges])
    contracting = np.array([hinge.loose for hinge in hinges]) - held
    coarser = np.array([hinge.coarser for hinge in hinges])
    more_layers = (held - coarser) / ((MANY_LAYERS / FEW_LAYERS) ** ORDER_OF_LAYERS - 1)
    nu = max(material.poissons_ratio for material in layout.materials)
    best = Thickened(plane, plane._replace(hinges=solid), hinges)
    return (
        best,
        best._replace(solid=plane._replace(hinges=solid + OF_CONTRACTION * contracting)),
        best._replace(solid=plane._replace(hinges=solid + more_layers)),
        best._replace(solid=best.solid._replace(bodies=_stiffer_bodies(layout, plane.bodies))),
        best._replace(share=1 - OF_THE_RATIO),
        best._replace(of_bodies=1 - OF_CONSTRAINT * (1 - np.sqrt(1 - nu + nu**2))),
    )


def parts_in_depth(layout: Layout, mesh: PlaneMesh) -> ElasticParts:
    """Return the parts of `parts_in`, with hinges in three dimensions."""
    plane = parts_in(layout, mesh)
    return plane._replace(hinges=_hinges_in_depth(layout, plane, thick_hinges(layout, mesh)))


def _hinges_in_depth(
    layout: Layout,
    plane: ElasticParts,
    hinges: Sequence[ThickHinge],
) -> Array:
    """Return the compliances (h, 3, 3) of hinges in three dimensions, whose ends contract in part."""
    assert plane.hinges is not None
    held = np.array([hinge.change for hinge in hinges])
    loose = np.array([hinge.loose for hinge in hinges])
    ends = [layout.thickness / joint.profile.end_height for joint in layout.joints]
    return np.asarray(plane.hinges + held + contraction(ends)[:, None, None] * (loose - held))


def _stiffer_bodies(layout: Layout, bodies: Sequence[ElasticBody]) -> tuple[ElasticBody, ...]:
    """Return bodies that are partly in plane strain."""
    stiffer = list[ElasticBody]()
    for body in bodies:
        nu = layout.materials[body.body].poissons_ratio
        stiffer.append(body._replace(compliance=(1 - OF_PLANE_STRAIN * nu**2) * body.compliance))
    return tuple(stiffer)


@memoized
def has_slender_bodies(mechanism: Mechanism) -> bool:
    """Whether bodies have so much of the compliance of the output that plane stress may not hold
    for them.
    """
    layout = mechanism.layout
    if not layout.joints:
        return True
    parts = parts_of(mechanism)
    whole = respond(layout, parts.bodies, hinges=parts.hinges).compliance
    rigid = respond(layout, (), hinges=parts.hinges).compliance
    shares = 1 - np.diag(rigid)[:3] / np.diag(whole)[:3]
    return bool(np.max(shares) > SLENDER_BODIES)


def mesh_of(
    mechanism: Mechanism,
    models: Models,
    resolution: int | None,
    layers: int | None,
    **usual: int,
) -> Mesh | None:
    """As `setup.mesh_of`; a mechanism whose bodies bend like hinges is by default wholly in three
    dimensions.
    """
    mesh = plain_mesh_of(mechanism, models, resolution, layers, **usual)
    if mesh is None or layers is not None or mechanism.model != "three_dimensional":
        return mesh
    if has_slender_bodies(mechanism):
        return plain_mesh_of(mechanism, models, resolution, WHOLE_LAYERS, **usual)
    return mesh


def joined_parts(mechanism: Mechanism, elastic: bool) -> ElasticParts:
    """Return the parts of the analytic network: rigid bodies, or elastic ones with hinges of the
    model's dimensions.
    """
    if not elastic:
        return ElasticParts()
    thickness = thickness_of(mechanism)
    return thickness[0].solid if thickness else parts_of(mechanism)


def stress_by(
    mechanism: Mechanism, wrenches: Array, elastic: bool = False, across: ArrayLike = 0.0
) -> Array:
    """Return the highest stress (..., hinges), MPa, of hinges under wrenches (..., hinges, 3).

    elastic : of the network of elastic parts, whose hinges have the dimensions of the model.
    across : (..., hinges), MPa, stress out of the plane besides that of plane strain, at the
    centres of the hinges.

    In the analytic network of wide hinges it follows their deformation, which the thickness
    hinders: the highest von Mises stress of a bent wide strip is within some per cent that of a
    narrow one of equal curvature."""
    layout = mechanism.layout
    if not elastic:
        wrenches = wrenches * compliance_ratios(layout)
    stress = _narrow_stress(layout, wrenches, across)
    thickness = thickness_of(mechanism) if elastic else ()
    return stress * thickness[0].stress_ratios(wrenches) if thickness else stress


def _narrow_stress(
    layout: Layout,
    wrenches: Array,
    across: ArrayLike = 0.0,
) -> Array:
    """Return the highest stress (..., hinges), MPa, of hinges under wrenches (..., hinges, 3) in
    the plane.
    """
    across = np.broadcast_to(across, wrenches.shape[:-1])
    highest = list[Array]()
    for h, one in enumerate(layout.joints):
        ratio = layout.material_of(one).out_of_plane
        highest.append(
            one.profile.stress(wrenches[..., h, :], layout.thickness, ratio, across[..., h])
        )
    return np.stack(highest, axis=-1)


def wide_stress_ratios(layout: Layout, wrenches: Array) -> Array:
    """Return the ratios (h,) of the highest stress of wide hinges under wrenches (h, 3) to that in
    plane stress.
    """
    plane = _narrow_stress(layout, wrenches)
    wide = _narrow_stress(layout, wrenches * compliance_ratios(layout))
    return np.divide(wide, plane, out=np.ones_like(plane), where=plane > 0)


@memoized
def network(mechanism: Mechanism, elastic: bool = False) -> Responses:
    """Return the response of the analytic network with rigid bodies or with elastic parts."""
    parts = joined_parts(mechanism, elastic)
    found = respond(mechanism.layout, parts.bodies, hinges=parts.hinges)
    return Responses(
        found.compliance,
        lambda loads: stress_by(
            mechanism, np.einsum("hck,...k->...hc", found.wrenches, loads), elastic
        ),
    )


def elements(
    mechanism: Mechanism, resolution: int, layers: int = 0, thick: Thickened | None = None
) -> Responses:
    """Return the response of finite elements, of plane ones with the change by the thickness of
    hinges if given.
    """
    plane = responses(mechanism, solved(mechanism, resolution, layers))
    return plane if thick is None else _thickened(mechanism.layout, plane, thick)


def _thickened(
    layout: Layout,
    plane: Responses,
    thick: Thickened,
) -> Responses:
    """Return a plane response with the change by the thickness of hinges."""

    def of_parts(parts: ElasticParts) -> Array:
        return respond(layout, parts.bodies, hinges=parts.hinges).compliance

    wrenches = respond(layout, thick.solid.bodies, hinges=thick.solid.hinges).wrenches

    def stress(loads: Array) -> Array:
        of_hinges = np.einsum("hck,...k->...hc", wrenches, loads)
        return plane.stress(loads) * thick.stress_ratios(of_hinges)

    def bodies(loads: Array) -> BodyStress:
        assert plane.bodies is not None
        found = plane.bodies(loads)
        return found._replace(highest=found.highest * thick.of_bodies)

    def points(loads: Array) -> Array:
        assert plane.points is not None
        return plane.points(loads) * thick.of_bodies

    compliance = plane.compliance + thick.change(of_parts)
    return Responses(compliance, stress, plane.bodies and bodies, plane.points and points)


def responses(mechanism: Mechanism, response: Response) -> Responses:
    """Return compliance and stress of finite elements."""
    stress = partial(hinge_stress, response)
    if not response.bodies:
        return Responses(response.compliance, stress)
    layout = mechanism.layout
    bodies = partial(body_stress, response, layout)
    points = partial(point_stress, response, layout)
    return Responses(response.compliance, stress, bodies, points)


Values: TypeAlias = dict[str, Any]  # of one model by quantity
Bands: TypeAlias = Callable[[Array, list[Values], Sequence[Values]], Mapping[str, Any]]
"""Function from the resolutions of three meshes and the values on them to bands.

The last argument is empty in the plane. In three dimensions it has variants of values, then these
values, whose differences bound the error by the thickness: on the coarsest mesh with few and with
many layers, or `thickness_of`. """
OnMesh: TypeAlias = Callable[..., Values]
"""Function from a resolution and a number of layers, 0 in the plane, to values.

For a mechanism a third argument, `Thickened`, is the effect of the thickness to be added to a plane
solution. """


def value_bands(
    sizes: Array,
    each: list[Values],
    ends: Sequence[Values] = (),
) -> dict[str, Any]:
    """Return the bands of values on three meshes of resolutions `sizes`, in three dimensions with
    those of `Bands`.

    Highest stresses on three meshes can agree by chance. Their bands have a least value, which
    falls with the square of the resolution. `benchmarks/mechanism_bands.py` counts how many bands
    contain the values of a finer mesh."""
    kept = [name for name in each[0] if name not in PLACES]
    found = {name: corner_bands(sizes, np.array([one[name] for one in each])) for name in kept}
    if ends:
        *variants, best = ends
        for name, band in found.items():
            changes = np.abs([one[name] - best[name] for one in variants])
            found[name] = band + SAFETY * np.sum(changes, axis=0)
    least = PEAK_BAND * (8 / sizes[-1]) ** 2
    return found | {
        name: np.maximum(found[name], least * np.abs(each[-1][name]))
        for name in PEAKS
        if name in found
    }


def element_values(
    mesh: Mesh,
    solve: OnMesh,
    progress: Progress | None = None,
    bands: Bands = value_bands,
    thickness: Sequence[Thickened] = (),
) -> dict[str, ModelAnswer]:
    """Return the values of plane finite elements, or of three dimensions, and their bands.

    thickness : as of `thickness_of`; without layers the values are then in three dimensions by this
    effect.

    Notes
    -----
    A value with layers is that of the coarsest mesh with all layers, plus the change to the finest
    mesh with one layer: `v(coarse, layers) + v(fine, 1) - v(coarse, 1)`. So no fine mesh has many
    layers. On a stage with 24 leaf springs this is within 1e-5 of the compliance, and 0.5 % of the
    stress, of the finest mesh with three layers."""
    steps = levels(mesh.resolution)
    sizes = np.array(steps, dtype=float)
    if not mesh.layers and thickness:
        best, *variants = thickness
        each = on_meshes(steps, lambda level: solve(level, 0, best), progress)
        ends = [*(solve(mesh.resolution, 0, one) for one in variants), each[-1]]
        return {SOLID: ModelAnswer(each[-1], bands(sizes, each, ends))}
    each = on_meshes(steps, lambda level: solve(level, 0), progress)
    found = {ELEMENTS: ModelAnswer(each[-1], bands(sizes, each, ()))}
    if mesh.layers:
        planes, (few, many) = coarser(solve, *mesh, progress)
        joined = _joined(planes, many)
        found[SOLID] = ModelAnswer(joined, bands(sizes, planes, (few, many)))
    return found


def _joined(planes: Sequence[Values], many: Values) -> Values:
    """Return values on the finest mesh with many layers, from those on meshes with one layer,
    coarse to fine, and with many layers on the coarsest."""
    joined = {name: planes[-1][name] + many[name] - planes[0][name] for name in many}
    return joined | {name: planes[-1][name] for name in PLACES if name in joined}


def by_models(
    mechanism: Mechanism,
    mesh: Mesh | None,
    models: Models,
    of_network: Callable[[bool], Values],
    on_mesh: OnMesh,
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return the values of all requested models, with bands of finite elements.

    A plate without hinges has no analytic model. That with elastic parts takes finite elements of
    these, and is left out of analytic models alone.

    of_network : values with rigid bodies or, for True, with elastic parts.
    """
    found = dict[str, ModelAnswer]()
    if models != "elements" and mechanism.layout.joints:
        found[ANALYTIC] = ModelAnswer(of_network(False))
        if models == "both":
            found[ELASTIC] = ModelAnswer(of_network(True))
    if mesh is None:
        return found
    thickness = () if mesh.layers else thickness_of(mechanism)
    return found | element_values(mesh, on_mesh, progress, bands, thickness=thickness)


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


def left_out_corners(layout: Layout, mesh: PlaneMesh) -> list[str]:
    """Warn of sharp corners of bodies near which no stress is stated, with the rule; corners of
    hinges apart.
    """
    fixed = [index for index, body in enumerate(layout.bodies) if body.fixed]
    moving = np.isin(mesh.bodies, fixed, invert=True)
    part = mesh._replace(triangles=mesh.triangles[moving], bodies=mesh.bodies[moving])
    of_hinges = part.triangles[part.bodies >= len(layout.bodies)]
    texts = list[str]()
    corners = corners_of_bodies(layout, part, held_nodes(layout, mesh))
    for index, sharp in zip(moving_bodies(layout), corners, strict=True):
        places = mesh.nodes[np.setdiff1d(sharp, of_hinges)]
        if len(places):
            body = layout.bodies[index]
            named = _named_places(places)
            texts.append(f"{body.name} within {left_out_within(body):.3g} mm of {named}")
    if not texts:
        return []
    return [
        "the stress of bodies is singular at corners that are sharp in the drawing and at ends "
        "of clamped edges: it is not stated within a quarter of the mean width of the body from "
        f"there ({'; '.join(texts)})"
    ]


def _named_places(places: Array) -> str:
    """Return the first of some places (n, 2), mm, as a text."""
    ordered = sorted(places.round(4).tolist())
    text = ", ".join(f"({x:g}, {y:g})" for x, y in ordered[:MOST_CORNERS])
    if len(ordered) > MOST_CORNERS:
        text += f" and {len(ordered) - MOST_CORNERS} more"
    return text


def over_yield(
    mechanism: Mechanism, found: Mapping[str, ModelAnswer], stress: str, where: str
) -> list[str]:
    """Warn of a highest stress above the yield strength; `stress` names the quantity, `where` the
    load.

    Stresses of bodies under the load count, too.
    """
    highest = list[float]()
    for model in found.values():
        for name in (stress, "body_stress"):
            if name in model.values:
                shares = shares_of_yield(mechanism, name)
                highest.append(float(np.max(model.values[name] * shares, initial=0.0)))
    return warning.of_yield(max(highest), mechanism.material.yield_strength, where)


def shares_of_yield(mechanism: Mechanism, stress: str) -> Array | float:
    """Return the yield strength of the plate over those of the hinges or bodies of a named stress;
    1 where all parts are of one material.
    """
    layout = mechanism.layout
    if not layout.mixed:
        return 1.0
    if stress.startswith("body"):
        return layout.yield_strength / layout.body_strengths
    return layout.hinge_shares


def amplification(layout: Layout, compliance: Array) -> Array:
    """Return the motion (..., a, 3) of the free output per opening of one actuator, from
    compliances (..., k, k).
    """
    drives = layout.drive_ports
    opening = np.diagonal(compliance, axis1=-2, axis2=-1)[..., None, drives]
    return np.asarray(np.swapaxes(compliance[..., :3, drives] / opening, -1, -2))
