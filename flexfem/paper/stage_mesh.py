"""Meshes of stages: a sector per chain, one for three identical chains; their plates and layers.

Element size grows linearly with the distance from a neck, outside the length over which a notch
bends, about `sqrt(t R)`: four triangles across a neck then keep the platform stiffness within 0.1 %
from t/R = 1e-4 to more than 1 (see `benchmarks/study.py`; PLATEAU and GROWTH were chosen for that
on other stages)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator

import numpy as np

from flexfem.arrays import turned
from flexfem.fem.elements import Layers, Plate
from flexfem.fem.mesh import (
    RESOLUTION,
    SAME_PLACE,
    PlaneMesh,
    PoorTriangles,
    Sector,
    by_radius,
    check_triangles,
    mesh_of,
    nodes_on,
    welded,
)
from flexfem.fem.ports import layers_of_layout
from flexfem.fem.sizes import COARSEST, GROWTH, PER_TURN, TIME_LIMIT, first_good, smaller_at
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.outlines import Face, area
from flexfem.meshing.process import Limit, run_mesher
from flexfem.meshing.requests import FaceMesh, Grading, NamedArrays
from flexfem.paper.actuators import HINGE_NAMES
from flexfem.paper.bodies import draw_sector, necks
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage import Stage
from flexfem.paper.stage_file import Hinge
from flexfem.refused import BadInput, ComputationFailed

# distance from a neck up to which triangles are smallest, per sqrt(t R), where a notch bends
PLATEAU = 0.9
# distance, per notch radius, up to which the thickness `t + d^2/R` grows slower than a cone
SLENDER = 0.3
STUBBY = 0.5  # t/R above which the notch radius, not the neck, sets the triangle size
ATTEMPTS = 5  # to mesh sectors


def mesh_sectors(
    stage: Stage, resolution: int | tuple[int, int, int], time_limit: float | Limit = TIME_LIMIT
) -> tuple[Sector, ...]:
    """Mesh a feasible stage: three sectors, or one that represents three identical chains.

    Parameters
    ----------
    resolution : least number of triangles across every neck, or one per chain; the finest applies
        to the cuts.
    time_limit : s, for gmsh on all sectors.

    Raises BadInput for a stage that cannot be made, ComputationFailed when the mesh fails its
    checks, MeshTimeout when it takes too long."""
    check_feasible(stage)
    across = (resolution,) * 3 if isinstance(resolution, int) else resolution
    chains = (1,) if stage.chains_alike and len(set(across)) == 1 else (1, 2, 3)
    limit = time_limit if isinstance(time_limit, Limit) else Limit(time_limit)
    meshed = dict[tuple[object, ...], Sector]()
    sectors = list[Sector]()
    for chain in chains:
        own = across[chain - 1]
        key = (own, *(stage.hinge(chain, name) for name in HINGE_NAMES))
        if key not in meshed:
            meshed[key] = _meshed(sector_drawing(stage, chain, own, max(across)), limit)
        sectors.append(meshed[key])
    _check_cuts(sectors)
    return tuple(sectors)


def _check_cuts(sectors: list[Sector]) -> None:
    """Raise ComputationFailed unless each sector fits the next one."""
    for sector, following in zip(sectors, (*sectors[1:], sectors[0]), strict=True):
        ahead = sector.mesh.nodes[sector.ahead]
        behind = turned(following.mesh.nodes[following.behind], CHAIN_TURN)
        if ahead.shape != behind.shape or np.max(np.abs(ahead - behind)) > SAME_PLACE:
            raise ComputationFailed("meshes of two sectors do not have the same nodes on their cut")


def _meshed(job: FaceMesh, time_limit: Limit) -> Sector:
    """Return a sector; in place of poor triangles there are smaller ones in another attempt."""

    def mesh(job: FaceMesh) -> Sector:
        return _sector(job, run_mesher(job, time_limit))

    return first_good(job, mesh, _next_attempt, ATTEMPTS)


def _next_attempt(job: FaceMesh, failure: ComputationFailed) -> FaceMesh | None:
    """Return the drawing for another attempt after poor triangles, None after other failures."""
    if not isinstance(failure, PoorTriangles):
        return None
    coarse = max((one.largest for one in job.gradings), default=0.0)
    return job._replace(gradings=[*job.gradings, *smaller_at(failure.corners, coarse)])


def build_mesh(stage: Stage, resolution: int = RESOLUTION) -> PlaneMesh:
    """Mesh the whole stage with `mesh_sectors`; it is exactly symmetric for identical chains."""
    return welded(mesh_sectors(stage, resolution))[0]


def sector_drawing(
    stage: Stage,
    chain: int,
    resolution: int,
    finest: int,
) -> FaceMesh:
    """Return drawing and sizes of the sector of a chain.

    finest : the highest resolution of all, which sets the cuts.
    """
    fine = max(resolution, 2)  # a single triangle across an arc would degenerate
    faces = list(draw_sector(stage, chain).values())
    coarse = COARSEST * stage.chain.link_width / fine
    points = _refinement_points(stage, chain, faces, fine)
    rim = stage.platform.radius - stage.platform.hub_radius
    cuts = max(2, math.ceil(rim / (COARSEST * stage.chain.link_width / max(finest, 2))))
    divisions = {
        f"neck {name}": _across(stage.hinge(chain, name), resolution) for name in HINGE_NAMES
    }
    divisions |= {"cut behind": cuts, "cut ahead": cuts}
    return FaceMesh(
        faces, divisions, [grading(*point, coarse, fine) for point in points if point[-1] < coarse]
    )


def grading(
    centre: complex,
    radius: float,
    size: float,
    coarse: float,
    across: float,
) -> Grading:
    """Return sizes, mm, that grow outside a radius as from a neck with `across` triangles."""
    return Grading((centre,), radius, size, coarse, (coarse - size) * across / GROWTH)


def notch_sizes(
    neck: float, radius: float, across: float, resolution: float
) -> Iterator[tuple[float, float]]:
    """Yield distances from a neck and sizes within them, mm.

    The thickness of a notch grows slower there than a cone.
    """
    distance = PLATEAU * math.sqrt(neck * radius)
    yield distance, neck / across
    while distance < SLENDER * radius:
        yield 2 * distance, (neck + 2 * distance**2 / radius) / resolution
        distance *= 2


def _across(hinge: Hinge, resolution: int) -> int:
    """Return the triangles across a neck: more in a stubby hinge, whose notch must be resolved."""
    return math.ceil(resolution * max(1.0, hinge.neck / (STUBBY * hinge.radius)))


def _refinement_points(
    stage: Stage, chain: int, faces: list[Face], resolution: int
) -> Iterator[tuple[complex, float, float]]:
    """Yield centres, radii and sizes within, mm: of necks, the platform and rounded bends."""
    notches = []
    for neck, name in zip(necks(stage, chain), HINGE_NAMES, strict=True):
        hinge = stage.hinge(chain, name)
        sizes = notch_sizes(hinge.neck, hinge.radius, _across(hinge, resolution), resolution)
        yield from ((neck.point, *size) for size in sizes)
        across = (hinge.neck / 2 + hinge.radius) * 1j * cmath.exp(1j * neck.heading)
        notches += [neck.point + across, neck.point - across]
    disc = stage.platform.radius
    hub = stage.platform.hub_radius
    yield 0j, disc, COARSEST * (disc - hub) / resolution
    for arc in dict.fromkeys(segment for face in faces for segment in face.loop):
        if arc.centre in (None, 0j) or any(
            abs(arc.centre - notch) < SAME_PLACE for notch in notches
        ):
            continue  # hub, rim and notches have cones of their own
        radius = abs(arc.start - arc.centre)
        yield arc.centre, radius, radius * 2 * math.pi / PER_TURN


def _sector(job: FaceMesh, arrays: NamedArrays) -> Sector:
    """Return a sector in arrays of `meshing`. Raises ComputationFailed as `check_triangles`."""
    mesh = mesh_of(arrays)
    check_triangles(mesh, sum(area(face.loop) for face in job.faces))
    hub = nodes_on(mesh, "hub")
    behind = by_radius(mesh.nodes, mesh.edges["cut behind"])
    ahead = by_radius(mesh.nodes, mesh.edges["cut ahead"])
    return Sector(mesh, behind[~np.isin(behind, hub)], ahead[~np.isin(ahead, hub)])


def plate_of(stage: Stage) -> Plate:
    """Return the plate of the plane problem of a stage.

    Raises BadInput for a model that is not plane.
    """
    with naming_place(stage):
        if stage.model == "corrected":
            raise BadInput(
                'model = "corrected", with three-dimensional hinges, expected "plane_stress" or '
                '"plane_strain": the finite elements are plane'
            )
    E, nu = stage.elastic
    return Plate(float(E), float(nu), stage.thickness)


def sheet_of(stage: Stage) -> Plate:
    """Return the material and thickness of a stage for a problem in three dimensions."""
    return Plate(stage.material.youngs_modulus, stage.material.poissons_ratio, stage.thickness)


def layers_of(
    stage: Mechanism,
    number: int,
    antisymmetric: bool = False,
) -> Layers:
    """Return the layers of `layers_of_layout` for a stage."""
    return layers_of_layout(stage.layout, number, antisymmetric)
