"""The stage in three dimensions by CalculiX, on our wedges: compliance and natural frequencies.

CalculiX's C3D15 has 15 nodes: it lacks those in the middle of the three rectangles. Its displacements are those of the
18-node wedge whose middle values are `(edges) / 2 - (corners) / 4` of the rectangle, a subspace. Our stiffness on that
subspace, T' K T, with its nine points of integration, is that of C3D15, and agrees to the digits printed; so do the
frequencies with T' M T, whose mass CalculiX integrates at the same points. The 18-node wedge itself cannot: it is
softer. For frequencies the hub is drawn, as in `frequencies`: wedges whose nodes all follow the pose.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array
from flexfem.fem.factor import factorise
from flexfem.fem.layers import Layers, rigid_fields
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import lowest
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import Tied, rigid_motion
from flexfem.fem.solid import solid
from flexfem.fem.solid_modes import solid_mass
from flexfem.refused import ComputationFailed
from flexfem.validate import calculix
from flexfem.validate.frequencies import COUNT, HERTZ, Vibrating, drawn_hub, printed_frequencies

TIME_LIMIT = 600.0  # s


class SolidAnswer(NamedTuple):
    """Platform compliance (3, 3) and frequencies (12,), Hz, the lowest six in the plane, then six out of it."""

    compliance: Array
    frequencies: Array
    version: str = ""


def hub_motions(nodes: Array, heights: Array, antisymmetric: bool) -> Array:
    """Displacements (n, m, 3, 3) of nodes (n, 2), mm, at heights (m,), mm, per unit of the pose of the hub.

    The pose is x, y, theta; antisymmetric z and the rotations about x and y. Not by our own `layers.rigid_fields`.
    """
    x, y, z = np.broadcast_arrays(*nodes.T[:, :, None], heights)
    zero, one = np.zeros_like(x), np.ones_like(x)
    flat = ((one, zero, zero), (zero, one, zero), (-y, x, zero))
    tilting = ((zero, zero, one), (zero, -z, y), (z, zero, -x))
    return np.stack([np.stack(each, axis=-1) for each in (tilting if antisymmetric else flat)], axis=-1)


def ours_by_fifteen(of: Vibrating, layers: Layers) -> SolidAnswer:
    """Compliance and frequencies by wedges of 15 nodes with CalculiX's points of integration, as `by_calculix`."""
    drawn, squares = drawn_hub(of), []
    for half in (layers, layers.antisymmetric):
        K, T = _fifteen(drawn.mesh, of.plate, half)
        mass = solid_mass(drawn.mesh, half, of.density, drawn.carried, calculix.INTEGRATION)
        M = T.T @ sp.kron(sp.kron(mass.areal, mass.line), sp.eye_array(3)).tocsr() @ T
        squares.append(lowest(factorise(K), M.tocsc(), COUNT)[0])
    return SolidAnswer(serendipity_compliance(of.mesh, of.plate, layers), np.sqrt(np.concatenate(squares)) * HERTZ)


def serendipity_compliance(mesh: StageMesh, plate: Plate, layers: Layers) -> Array:
    """Platform compliance (3, 3) by wedges of 15 nodes with CalculiX's points of integration, half the thickness."""
    reduced = _fifteen(mesh, plate, layers)[0]
    loads = np.zeros((reduced.shape[0], 3))
    loads[-3:] = np.eye(3)
    return np.asarray(factorise(reduced)(loads)[-3:])


def _fifteen(mesh: StageMesh, plate: Plate, layers: Layers) -> tuple[sp.coo_array, sp.csr_array]:
    """Lower triangle of T' K T, and T from its unknowns, the pose last, to all nodes, x, y and z fastest."""
    n, m = len(mesh.nodes), len(layers.heights)
    every = np.arange(n)
    free = Tied(every, every, every[:0], np.empty((0, 3)))
    whole = solid(mesh, plate, layers._replace(held=(), fixed=()), free, calculix.INTEGRATION)
    lower = whole.lower().tocsr()[:-3, :-3]
    place = whole.loads(np.arange(3.0 * n * m).reshape(1, n, m, 3))[:-3, 0].astype(int)  # of every unknown
    K = (lower + sp.tril(lower, -1).T).tocsr()
    T = (sp.kron(_without_centres(mesh, m), sp.eye_array(3)) @ _held(mesh, layers)).tocsr()
    return sp.tril(T[place].T @ K @ T[place]).tocoo(), T


def _without_centres(mesh: StageMesh, m: int) -> sp.csr_array:
    """Matrix (nm, nm) from values at nodes and heights to those whose rectangles' centres follow their edges."""
    ends = np.full((len(mesh.nodes), 2), -1)
    t = mesh.triangles
    ends[t[:, 3:]] = t[:, [[0, 1], [1, 2], [2, 0]]]
    middles, heights = np.flatnonzero(ends[:, 0] >= 0), np.arange(1, m, 2)
    centre, k = (each.ravel() for each in np.meshgrid(middles, heights, indexing="ij"))
    a, b = ends[centre].T
    rows = centre * m + k
    parts = [(rows, -np.ones(len(rows)))]
    parts += [(centre * m + k + step, np.full(len(rows), 0.5)) for step in (-1, 1)]
    parts += [(end * m + k, np.full(len(rows), 0.5)) for end in (a, b)]
    parts += [(end * m + k + step, np.full(len(rows), -0.25)) for end in (a, b) for step in (-1, 1)]
    columns, values = (np.concatenate(each) for each in zip(*parts, strict=True))
    size = len(mesh.nodes) * m
    change = sp.coo_array((values, (np.tile(rows, len(parts)), columns)), shape=(size, size))
    return (sp.eye_array(size) + change).tocsr()


def _held(mesh: StageMesh, layers: Layers) -> sp.csr_array:
    """Matrix (3nm, unknowns + 3): ground and mid-plane held, the hub on the pose, centres of rectangles left out."""
    n, m, hub = len(mesh.nodes), len(layers.heights), np.unique(mesh.edges["hub"])
    left = np.zeros((n, m, 3), dtype=bool)
    left[:, *layers.kept] = True
    left[np.unique(mesh.edges["ground"])] = left[hub] = False
    left[np.ix_(np.unique(mesh.triangles[:, 3:]), np.arange(1, m, 2))] = False
    kept = np.flatnonzero(left.ravel())
    rigid = rigid_fields(layers, rigid_motion(mesh.nodes[hub]))
    at = (hub[:, None, None] * m + np.arange(m)[:, None]) * 3 + np.arange(3)
    rows = np.concatenate([kept, np.repeat(at.ravel(), 3)])
    columns = np.concatenate([np.arange(len(kept)), np.tile(len(kept) + np.arange(3), at.size)])
    values = np.concatenate([np.ones(len(kept)), rigid.ravel()])
    return sp.coo_array((values, (rows, columns)), shape=(3 * n * m, len(kept) + 3)).tocsr()


def by_calculix(of: Vibrating, layers: Layers) -> SolidAnswer:
    """Compliance, of half the thickness under half of unit loads, and frequencies of a drawn hub, by CalculiX's C3D15.

    Raises BadInput when CalculiX is not installed, ComputationFailed when it fails.
    """
    poses = calculix.printed_displacements(_run(_deck(of, layers, _static(_poses(of.mesh, layers)))), "platform")
    drawn, hertz = drawn_hub(of), []
    for half in (layers, layers.antisymmetric):
        hertz.append(printed_frequencies(_run(_deck(drawn, half, ("*STEP", "*FREQUENCY", str(COUNT), "*END STEP")))))
        if len(hertz[-1]) != COUNT:
            raise ComputationFailed(f"CalculiX gave {len(hertz[-1])} frequencies, expected {COUNT}")
    compliance = np.column_stack([[*centre, theta] for centre, (theta, _) in poses])
    return SolidAnswer(compliance, np.concatenate(hertz), calculix.version())


def _run(deck: Iterable[str]) -> str:
    """What CalculiX prints of a deck."""
    program = calculix.find_program()
    with tempfile.TemporaryDirectory(prefix="flexfem-") as name:
        folder = Path(name)
        (folder / "stage.inp").write_text("\n".join(deck) + "\n")
        calculix.run([program, "-i", "stage"], folder, TIME_LIMIT)
        return calculix.read(folder / "stage.dat")


def _poses(mesh: StageMesh, layers: Layers) -> tuple[tuple[int, int], ...]:
    """Nodes, and directions of theirs, that carry the three components of the pose."""
    last = len(mesh.nodes) * len(layers.heights)
    return (last + 1, 1), (last + 1, 2), (last + 2, 1)


def _deck(of: Vibrating, layers: Layers, steps: Iterable[str]) -> Iterator[str]:
    mesh, m, plate = of.mesh, len(layers.heights), of.plate
    (centre, _), _, (rotation, _) = _poses(mesh, layers)
    yield from ("*HEADING", "stage in three dimensions", "*NODE, NSET=all")
    for i, (x, y) in enumerate(mesh.nodes):
        yield from (f"{i * m + k + 1}, {x:.13g}, {y:.13g}, {z:.13g}" for k, z in enumerate(layers.heights))
    yield "*NODE, NSET=platform"
    yield from (f"{node}, 0, 0, 0" for node in (centre, rotation))
    yield "*ELEMENT, TYPE=C3D15, ELSET=stage"
    corners, middles = mesh.triangles[:, :3] * m + 1, mesh.triangles[:, 3:] * m + 1
    wedges = np.concatenate(
        [
            np.hstack([corners + k, corners + k + 2, middles + k, middles + k + 2, corners + k + 1])
            for k in range(0, m - 1, 2)
        ]
    )
    yield from (", ".join(map(str, (number, *row))) for number, row in enumerate(wedges.tolist(), start=1))
    yield from ("*MATERIAL, NAME=metal", "*ELASTIC", f"{plate.youngs_modulus:.12g}, {plate.poissons_ratio:.12g}")
    yield from ("*DENSITY", f"{of.density:.12g}", "*SOLID SECTION, ELSET=stage, MATERIAL=metal")
    yield from _supports(mesh, layers, set(np.unique(wedges).tolist()))
    yield from steps


def _supports(mesh: StageMesh, layers: Layers, used: set[int]) -> Iterator[str]:
    """The hub on the pose, by equations; ground and mid-plane held, and what of the hub no pose moves."""
    m, hub, poses = len(layers.heights), np.unique(mesh.edges["hub"]), _poses(mesh, layers)
    rigid, held = hub_motions(mesh.nodes[hub], layers.heights, bool(layers.fixed)), []
    for i, motions in zip(hub, rigid, strict=True):
        for node, k in ((i * m + k + 1, k) for k in range(m) if i * m + k + 1 in used):
            for axis, row in enumerate(motions[k], start=1):
                terms = [f"{at}, {way}, {-c:.13g}" for (at, way), c in zip(poses, row, strict=True) if c]
                if terms:
                    yield from ("*EQUATION", str(1 + len(terms)), ", ".join([f"{node}, {axis}, 1", *terms]))
                else:
                    held.append(f"{node}, {axis}, {axis}")
    yield from ("*BOUNDARY", *held)
    ground, bonded = (set(each.tolist()) for each in (np.unique(mesh.edges["ground"]), hub))
    middle = "1, 2" if layers.fixed else "3, 3"
    for i in set(range(len(mesh.nodes))) - bonded:
        for k in range(m):
            if i * m + k + 1 in used and (i in ground or k == 0):
                yield f"{i * m + k + 1}, {'1, 3' if i in ground else middle}"


def _static(poses: tuple[tuple[int, int], ...]) -> Iterator[str]:
    """Half of unit loads, on half of the thickness."""
    for load in np.eye(3) / 2:
        yield from ("*STEP", "*STATIC", "*CLOAD, OP=NEW")
        yield from (f"{node}, {way}, {size}" for (node, way), size in zip(poses, load, strict=True))
        yield from ("*NODE PRINT, NSET=platform", "U", "*END STEP")
