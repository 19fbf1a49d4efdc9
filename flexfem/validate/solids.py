"""The stage in three dimensions by CalculiX and by NGSolve, on our wedges.

NGSolve's quadratic prisms have 18 unknowns a component and are ours: on wedges deformed as our triangles are curved the
two differ by round-off alone, with quadratures that are both exact enough.

CalculiX's C3D15 has 15 nodes: it lacks those in the middle of the three rectangles. Its displacements are those of the
18-node wedge whose middle values are `(edges) / 2 - (corners) / 4` of the rectangle, a subspace. Our stiffness on that
subspace, T' K T, with its nine points of integration, is that of C3D15, and agrees to the digits printed. The 18-node
wedge itself cannot: it is softer.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexfem.arrays import Array, Index
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import Tied, rigid_motion
from flexfem.fem.solid import Layers, solid
from flexfem.validate import calculix
from flexfem.validate.ngsolve import MORE_ORDERS, import_ngsolve, middles_of

TIME_LIMIT = 600.0  # s


def serendipity_compliance(mesh: StageMesh, plate: Plate, layers: Layers) -> Array:
    """Platform compliance (3, 3) by wedges of 15 nodes with CalculiX's points of integration, half the thickness."""
    n, m = len(mesh.nodes), len(layers.heights)
    every = np.arange(n)
    free = Tied(every, every, every[:0], np.empty((0, 3)))
    whole = solid(mesh, plate, layers._replace(held=()), free, calculix.INTEGRATION)
    lower = whole.lower().tocsr()[:-3, :-3]
    place = whole.loads(np.arange(3.0 * n * m).reshape(1, n, m, 3))[:-3, 0].astype(
        int
    )  # of every unknown, x y z fastest
    K = (lower + sp.tril(lower, -1).T).tocsr()
    T = (sp.kron(_without_centres(mesh, m), sp.eye_array(3)) @ _held(mesh, m)).tocsr()[place]
    reduced = sp.tril(T.T @ K @ T).tocoo()
    loads = np.zeros((reduced.shape[0], 3))
    loads[-3:] = np.eye(3)
    return np.asarray(factorise(reduced)(loads)[-3:])


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


def _held(mesh: StageMesh, m: int) -> sp.csr_array:
    """Matrix (3nm, unknowns + 3): ground and mid-plane held, the hub on the pose, centres of rectangles left out."""
    n, hub = len(mesh.nodes), np.unique(mesh.edges["hub"])
    left = np.ones((n, m, 3), dtype=bool)
    left[np.unique(mesh.edges["ground"])] = left[hub] = left[:, 0, 2] = False
    left[np.ix_(np.unique(mesh.triangles[:, 3:]), np.arange(1, m, 2))] = False
    kept = np.flatnonzero(left.ravel())
    rigid = rigid_motion(mesh.nodes[hub]).reshape(-1, 1, 2, 3)
    at = (hub[:, None, None] * m + np.arange(m)[:, None]) * 3 + np.arange(2)
    rows = np.concatenate([kept, np.repeat(at.ravel(), 3)])
    columns = np.concatenate([np.arange(len(kept)), np.tile(len(kept) + np.arange(3), at.size)])
    values = np.concatenate([np.ones(len(kept)), np.broadcast_to(rigid, (*at.shape, 3)).ravel()])
    return sp.coo_array((values, (rows, columns)), shape=(3 * n * m, len(kept) + 3)).tocsr()


def calculix_compliance(mesh: StageMesh, plate: Plate, layers: Layers) -> Array:
    """Platform compliance (3, 3) by CalculiX's C3D15, half the thickness under half of unit loads.

    Raises BadInput when CalculiX is not installed, ComputationFailed when it fails.
    """
    program = calculix.find_program()
    with tempfile.TemporaryDirectory(prefix="flexfem-") as name:
        folder = Path(name)
        (folder / "stage.inp").write_text("\n".join(_deck(mesh, plate, layers)) + "\n")
        calculix.run([program, "-i", "stage"], folder, TIME_LIMIT)
        poses = calculix.printed_displacements((folder / "stage.dat").read_text(), "platform")
    return np.column_stack([[*centre, theta] for centre, (theta, _) in poses])


def _deck(mesh: StageMesh, plate: Plate, layers: Layers) -> Iterator[str]:
    n, m = len(mesh.nodes), len(layers.heights)
    centre, rotation = n * m + 1, n * m + 2
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
    yield "*SOLID SECTION, ELSET=stage, MATERIAL=metal"
    used, hub = set(np.unique(wedges).tolist()), np.unique(mesh.edges["hub"])
    for i in hub:
        x, y = mesh.nodes[i]
        for node in (i * m + k + 1 for k in range(m)):
            if node in used:
                yield from ("*EQUATION", "3", f"{node}, 1, 1, {centre}, 1, -1, {rotation}, 1, {y:.13g}")
                yield from ("*EQUATION", "3", f"{node}, 2, 1, {centre}, 2, -1, {rotation}, 1, {-x:.13g}")
    yield "*BOUNDARY"
    ground = set(np.unique(mesh.edges["ground"]).tolist())
    for i in range(n):
        clamped, bonded = i in ground, i in set(hub.tolist())
        for k in range(m):
            if i * m + k + 1 in used and (clamped or bonded or k == 0):
                yield f"{i * m + k + 1}, {1 if clamped else 3}, 3"
    for load in np.eye(3) / 2:
        yield from ("*STEP", "*STATIC", "*CLOAD, OP=NEW")
        yield from (f"{centre}, 1, {load[0]}", f"{centre}, 2, {load[1]}", f"{rotation}, 1, {load[2]}")
        yield from ("*NODE PRINT, NSET=platform", "U", "*END STEP")


def ngsolve_compliance(mesh: StageMesh, plate: Plate, layers: Layers) -> Array:
    """Platform compliance (3, 3) by NGSolve's quadratic prisms; as `ngsolve.solve`. Raises BadInput without NGSolve."""
    ng = import_ngsolve()
    with ng.TaskManager():
        made, corners = _prisms(mesh, layers), int(mesh.triangles[:, :3].max()) + 1
        straight = ng.Mesh(made)
        level = len(layers.heights) // 2 + 1
        ends = np.array([[corner.nr for corner in edge.vertices] for edge in straight.edges])
        middle = _plane_middles(mesh, ends // level, ends % level)
        probe = ng.GridFunction(ng.H1(straight, order=2))
        probe.vec.FV().NumPy()[straight.nv : straight.nv + straight.nedge] = 1.0
        rule = ng.IntegrationRule([(0.5, 0.5, 0.0)], [1.0])
        bubble = float(np.asarray(probe(straight.MapToAllElements(rule, ng.VOL))).ravel()[0])

        def coefficients(values: Array) -> Array:
            """Of a field (n, 3) that is constant through the thickness."""
            found = np.zeros((ng.H1(straight, order=2).ndof, 3))
            found[: straight.nv] = np.repeat(values[:corners], level, axis=0)
            flat = np.flatnonzero(middle >= 0)
            found[straight.nv + flat] = (values[middle[flat]] - values[ends[flat] // level].mean(axis=1)) / bubble
            return found.T.ravel()

        offset = np.zeros((len(mesh.nodes), 3))
        t = mesh.triangles
        offset[t[:, 3:], :2] = mesh.nodes[t[:, 3:]] - mesh.nodes[t[:, [[0, 1], [1, 2], [2, 0]]]].mean(axis=2)
        bend = ng.GridFunction(ng.VectorH1(straight, order=2))
        bend.vec.FV().NumPy()[:] = coefficients(offset)
        straight.SetDeformation(bend)
        return _by_energy(ng, straight, mesh, plate, coefficients, layers)


def _by_energy(ng: Any, prisms: Any, mesh: StageMesh, plate: Plate, coefficients: Any, layers: Layers) -> Array:
    E, nu = plate.youngs_modulus, plate.poissons_ratio
    held = {"dirichletx": "ground|hub", "dirichlety": "ground|hub", "dirichletz": "ground|hub|middle"}
    space = ng.VectorH1(prisms, order=2, **held)
    u, v = space.TnT()
    dx = ng.dx(bonus_intorder=MORE_ORDERS)

    def strain(w: Any) -> Any:
        return (ng.Grad(w) + ng.Grad(w).trans) / 2

    def stress(w: Any) -> Any:
        return E / (1 + nu) * (strain(w) + nu / (1 - 2 * nu) * ng.Trace(strain(w)) * ng.Id(3))

    energy = ng.BilinearForm(space, symmetric=True)
    energy += 2 * ng.InnerProduct(stress(u), strain(v)) * dx
    energy.Assemble()
    inverse = energy.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    hub = np.zeros((len(mesh.nodes), 1))
    hub[np.unique(mesh.edges["hub"])] = 1.0
    x, y = mesh.nodes.T
    one, zero = np.ones_like(x), np.zeros_like(x)
    motions, free = [], np.array(space.FreeDofs())
    for motion in ((one, zero, zero), (zero, one, zero), (-y, x, zero)):
        field = ng.GridFunction(space)
        field.vec.FV().NumPy()[:] = np.where(free, 0.0, coefficients(hub * np.stack(motion, axis=-1)))
        forces = field.vec.CreateVector()
        forces.data = energy.mat * field.vec
        field.vec.data -= inverse * forces
        motions.append(field)
    work = [[ng.InnerProduct(a.vec, (energy.mat * b.vec).Evaluate()) for b in motions] for a in motions]
    return np.asarray(np.linalg.inv(np.array(work)))


def _prisms(mesh: StageMesh, layers: Layers) -> Any:
    """Our wedges in netgen with straight sides: corner i at level l is vertex `levels * i + l`."""
    from netgen.meshing import FaceDescriptor, Mesh

    corners, level = int(mesh.triangles[:, :3].max()) + 1, layers.number + 1
    made = Mesh(dim=3)
    flat = np.repeat(mesh.nodes[:corners], level, axis=0)
    made.AddPoints(np.column_stack([flat, np.tile(layers.heights[::2], corners)]))
    t = mesh.triangles[:, :3] * level
    every = np.concatenate([np.hstack([t + k, t + k + 1]) for k in range(level - 1)])
    made.AddElements(dim=3, index=1, data=np.ascontiguousarray(every, dtype=np.int32), base=0)
    for number, name in enumerate(("ground", "hub", "middle"), start=1):
        made.Add(FaceDescriptor(surfnr=number, domin=1, domout=0, bc=number))
        if name == "middle":
            faces = t[:, ::-1]
        else:
            a, b = mesh.edges[name][:, :2].T * level
            faces = np.concatenate([np.stack([a + k, b + k, b + k + 1, a + k + 1], 1) for k in range(level - 1)])
        made.AddElements(dim=2, index=number, data=np.ascontiguousarray(faces, dtype=np.int32), base=0)
        made.SetBCName(number - 1, name)
    return made


def _plane_middles(mesh: StageMesh, corners: Index, levels: Index) -> Index:
    """Our node of the plane in the middle of each edge (edges, 2) that stays at a level, -1 for others."""
    found, flat = np.full(len(corners), -1), levels[:, 0] == levels[:, 1]
    found[flat] = middles_of(mesh, np.sort(corners[flat], axis=1))
    return found
