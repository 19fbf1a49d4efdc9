"""The mesh of a stage: a sector of 120 degrees for each chain, one for three alike, welded into the whole on demand.

Sizes are cones about the necks that stay at their least over the length on which a notch bends, about `sqrt(t R)`: four
triangles across a neck then keep the platform stiffness within 0.1 % from t/R = 1e-4 to more than 1 (see
`benchmarks/study.py`). Curves are drawn by gmsh's own kernel, and nothing is smoothed. BENT and GROWTH were chosen
for that accuracy on 12 stages other than those of the benchmark.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Index
from flexfem.clock import Limit
from flexfem.fem.gmsh_process import run_jobs
from flexfem.fem.mesh import (
    COARSEST,
    RESOLUTION,
    TIME_LIMIT,
    StageMesh,
    check_triangles,
    estimate_triangles,
    ordered,
    outwards,
    refuse_size,
    rim_of,
)
from flexfem.fem.mesher import Cone, Job, mesh_faces
from flexfem.mechanism.bodies import Face, area, draw_sector, necks
from flexfem.mechanism.designs import CHAIN_TURN, turned
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import HINGE_NAMES, Hinge, Stage
from flexfem.refused import ComputationFailed

BENT = 0.9  # distance from a neck up to which triangles are smallest, per sqrt(t R), over which a notch bends
GROWTH = 1.6  # of the triangles with the distance from a neck, per triangle across it
SLENDER = 0.3  # of a notch's radius: up to here its own thickness `t + d^2/R` grows slower than a cone
STUBBY = 0.5  # t/R from which on the notch and not the neck sets the size
PER_TURN = 9.0  # triangles per full turn of a bend; an arc of a notch has its neck's cone
SAME_PLACE = 1e-6  # mm; nodes of two sectors on their common cut, centres of arcs


class Sector(NamedTuple):
    """Curved quadratic triangles of one chain with its sector of the platform, in the frame of chain 1.

    mesh : bodies 0 to 3 in the order of `stage.bodies.BODIES`; edges on `ground`, `hub`, `cut ahead`, `cut behind`
        and, for each hinge, `neck base` and so on.
    behind, ahead : (k,), nodes on the cuts without those on the hub, outwards; ahead is behind turned by 120 degrees.
    """

    mesh: StageMesh
    behind: Index
    ahead: Index


def mesh_sectors(
    stage: Stage, resolution: int, time_limit: float | Limit = TIME_LIMIT, inside: bool = False
) -> tuple[Sector, ...]:
    """Mesh a feasible stage: three sectors, or the one that three alike chains share.

    Parameters
    ----------
    resolution : quadratic triangles across every neck, or more.
    time_limit : s, for gmsh on all sectors; not watched over inside.
    inside : run gmsh in this very process, which must be one that may be killed, and in its main thread.

    Raises BadInput for a stage that cannot be made, ComputationFailed when the mesh would be too large or fails its
    checks, MeshTimeout when it takes too long.
    """
    check_feasible(stage)
    limit = time_limit if isinstance(time_limit, Limit) else Limit(time_limit)
    chains = (1,) if stage.chains_alike else (1, 2, 3)
    jobs = [sector_drawing(stage, chain, resolution) for chain in chains]
    areas = [sum(area(face.loop) for face in job.faces) for job in jobs]
    refuse_size(estimate_triangles(stage, sum(areas) * 3 / len(chains), resolution))
    kinds = [tuple(stage.hinge(chain, name) for name in HINGE_NAMES) for chain in chains]
    unlike = [kinds.index(kind) for kind in dict.fromkeys(kinds)]
    wanted = [jobs[place] for place in unlike]
    made = [_meshed_inside(job) for job in wanted] if inside else run_jobs(wanted, limit)
    sectors = {kinds[place]: _sector(each, areas[place]) for place, each in zip(unlike, made, strict=True)}
    return _fitting(tuple(sectors[kind] for kind in kinds))


def uneven_sectors(stage: Stage, resolutions: tuple[int, int, int]) -> tuple[Sector, ...]:
    """Three sectors of different resolutions, whose common cuts have the nodes of the finest; as `mesh_sectors`."""
    chains = (1, 1, 1) if stage.chains_alike else (1, 2, 3)
    jobs = [sector_drawing(stage, chain, n) for chain, n in zip(chains, resolutions, strict=True)]
    cuts = {f"cut {side}": max(job.divisions[f"cut {side}"] for job in jobs) for side in ("behind", "ahead")}
    jobs = [job._replace(divisions={**job.divisions, **cuts}) for job in jobs]
    areas = [sum(area(face.loop) for face in job.faces) for job in jobs]
    made = run_jobs(jobs, TIME_LIMIT)
    return _fitting(tuple(_sector(each, drawn) for each, drawn in zip(made, areas, strict=True)))


def build_mesh(stage: Stage, resolution: int = RESOLUTION, time_limit: float | Limit = TIME_LIMIT) -> StageMesh:
    """The whole stage as `mesh_sectors` meshes it. Alike chains share one mesh, turned: it is exactly symmetric.

    Raises BadInput for a stage that cannot be made, and as `mesh_sectors`.
    """
    check_feasible(stage)
    return welded(mesh_sectors(stage, resolution, time_limit))[0]


def welded(sectors: tuple[Sector, ...]) -> tuple[StageMesh, list[Index]]:
    """The whole stage from one or three sectors, and for each chain where the nodes of its sector are in it."""
    mesh, places = joined(sectors)
    mesh, back = ordered(mesh)
    return mesh, [back[place] for place in places]


def joined(sectors: tuple[Sector, ...]) -> tuple[StageMesh, list[Index]]:
    """As `welded`, with the nodes in no order.

    Notes
    -----
    `cut ahead` of each chain is `cut behind` of the next.
    """
    parts = [sector.mesh for sector in (sectors if len(sectors) == 3 else sectors * 3)]
    first = np.concatenate([[0], np.cumsum([len(part.nodes) for part in parts])])
    number = np.arange(first[-1])
    for chain, part in enumerate(parts):
        ahead, behind = outwards(part.nodes, part.edges["cut ahead"]), parts[(chain + 1) % 3]
        number[first[chain] + ahead] = first[(chain + 1) % 3] + outwards(behind.nodes, behind.edges["cut behind"])
    kept, number = np.unique(number, return_inverse=True)
    places = [number[first[chain] : first[chain + 1]] for chain in range(3)]
    nodes = np.concatenate([turned(part.nodes, chain * CHAIN_TURN) for chain, part in enumerate(parts)])[kept]
    edges: dict[str, list[Index]] = {}
    for chain, (part, place) in enumerate(zip(parts, places, strict=True)):
        for label, found in part.edges.items():
            if not label.startswith(("cut", "free")):
                edges.setdefault(label.replace("neck", f"neck {chain + 1}"), []).append(place[found])
    triangles = np.concatenate([place[part.triangles] for part, place in zip(parts, places, strict=True)])
    bodies = np.concatenate([4 * chain + part.bodies for chain, part in enumerate(parts)])
    return StageMesh(nodes, triangles, bodies, {name: np.concatenate(e) for name, e in edges.items()}), places


def sector_drawing(stage: Stage, chain: int, resolution: int) -> Job:
    """Drawing and sizes of the sector that holds one chain."""
    fine = max(resolution, 2)  # a single triangle from side to side of an arc would fold
    faces, coarse = list(draw_sector(stage, chain).values()), COARSEST * stage.chain.link_width / fine
    places = _fine_places(stage, chain, faces, fine)
    cones = tuple(cone(*place, coarse, fine) for place in places if place[-1] < coarse)
    cuts = max(2, math.ceil(rim_of(stage)[0] / coarse))
    divisions = {f"neck {name}": _across(stage.hinge(chain, name), resolution) for name in HINGE_NAMES}
    divisions |= {"cut behind": cuts, "cut ahead": cuts}
    return Job(faces, divisions, cones)


def cone(centre: complex, radius: float, least: float, coarse: float, across: float) -> Cone:
    """Sizes, mm, that grow from `least` beyond a radius as they do from a neck with so many triangles across."""
    return Cone(centre, radius, least, coarse, (coarse - least) * across / GROWTH)


def notch_sizes(neck: float, radius: float, across: float, resolution: float) -> Iterator[tuple[float, float]]:
    """Distances from a neck and the sizes up to there, mm: the notch's own thickness grows slower than a cone."""
    distance = BENT * math.sqrt(neck * radius)
    yield distance, neck / across
    while distance < SLENDER * radius:
        yield 2 * distance, (neck + 2 * distance**2 / radius) / resolution
        distance *= 2


def _across(hinge: Hinge, resolution: int) -> int:
    """Triangles across a neck: more in a stubby hinge, whose notch is what must be resolved."""
    return math.ceil(resolution * max(1.0, hinge.neck / (STUBBY * hinge.radius)))


def _fine_places(
    stage: Stage, chain: int, faces: list[Face], resolution: int
) -> Iterator[tuple[complex, float, float]]:
    """Centres and radii, mm, within which triangles have the size given last: necks, the platform, rounded bends."""
    notches = []
    for neck, name in zip(necks(stage, chain), HINGE_NAMES, strict=True):
        hinge = stage.hinge(chain, name)
        sizes = notch_sizes(hinge.neck, hinge.radius, _across(hinge, resolution), resolution)
        yield from ((neck.point, *size) for size in sizes)
        across = (hinge.neck / 2 + hinge.radius) * 1j * cmath.exp(1j * neck.heading)
        notches += [neck.point + across, neck.point - across]
    yield 0j, stage.platform.radius, COARSEST * rim_of(stage)[0] / resolution
    for arc in dict.fromkeys(segment for face in faces for segment in face.loop):
        if arc.centre in (None, 0j) or any(abs(arc.centre - notch) < SAME_PLACE for notch in notches):
            continue  # hub and rim of the platform, and notches, have their cones
        radius = abs(arc.start - arc.centre)
        yield arc.centre, radius, radius * 2 * math.pi / PER_TURN


def _meshed_inside(job: Job) -> dict[str, AnyArray]:
    try:
        return mesh_faces(job)
    except SystemExit as missing:
        raise ComputationFailed(str(missing)) from None
    except Exception as error:  # gmsh raises bare Exception
        raise ComputationFailed(f"gmsh: {' '.join(str(error).split())}") from None


def curved(made: dict[str, AnyArray]) -> StageMesh:
    """The mesh of straight triangles and edges with the middles of their sides, those of arcs on the arcs."""
    nodes, corners, edges, centres = made["nodes"], made["triangles"], made["edges"], made["edge_centres"]
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]], edges])
    keys, side = np.unique(ends.min(axis=1) * len(nodes) + ends.max(axis=1), return_inverse=True)
    middles = np.mean(nodes[np.stack(np.divmod(keys, len(nodes)))], axis=0)
    on_arc = ~np.isnan(centres)
    bent, centre = side[3 * len(corners) :][on_arc], np.stack([centres.real, centres.imag], axis=-1)[on_arc]
    outward, radius = middles[bent] - centre, np.linalg.norm(nodes[edges[on_arc, 0]] - centre, axis=1)
    middles[bent] = centre + outward * (radius / np.linalg.norm(outward, axis=1))[:, None]
    side += len(nodes)
    triangles = np.column_stack([corners, side[: 3 * len(corners)].reshape(3, -1).T])
    whole = np.column_stack([edges, side[3 * len(corners) :]])
    groups = {str(label): whole[made["edge_labels"] == label] for label in np.unique(made["edge_labels"])}
    return StageMesh(np.concatenate([nodes, middles]), triangles, made["faces"], groups)


def _sector(made: dict[str, AnyArray], drawn: float) -> Sector:
    mesh = curved(made)
    check_triangles(mesh, drawn)
    edges = mesh.edges
    hub = np.unique(edges["hub"])
    behind, ahead = (outwards(mesh.nodes, edges[f"cut {side}"]) for side in ("behind", "ahead"))
    return Sector(mesh, behind[~np.isin(behind, hub)], ahead[~np.isin(ahead, hub)])


def _fitting(sectors: tuple[Sector, ...]) -> tuple[Sector, ...]:
    """The sectors, when the nodes on their common cuts are the same. Raises ComputationFailed."""
    for one, following in zip(sectors, (*sectors[1:], sectors[0]), strict=True):
        ahead, behind = one.mesh.nodes[one.ahead], turned(following.mesh.nodes[following.behind], CHAIN_TURN)
        if ahead.shape != behind.shape or np.max(np.abs(ahead - behind)) > SAME_PLACE:
            raise ComputationFailed("meshes of two sectors do not have the same nodes on their cut")
    return sectors
