"""The stage solved by NGSolve: its finite elements, assembly and Cholesky factorisation on our
curved elements.

NGSolve's reader of .msh files takes 6-node triangles for three-dimensional, and curving a mesh from
a drawing would place the middle nodes elsewhere. So the mesh is made in memory from the corners,
with straight sides, and then deformed by a quadratic displacement that moves every middle onto
ours: exactly the isoparametric triangles. In three dimensions quadratic prisms, which have 18
unknowns a component, are deformed as our wedges are.

On curved triangles the stiffness is an integral of fractions, which no rule integrates exactly;
NGSolve's default order is that of straight ones: 4e-7 off in pose with eight triangles across a
neck, 1e-4 with one. The mass is an integral of polynomials, and both integrate it exactly.

The hub's displacement is prescribed as the three unit motions of a rigid body. The strain energies
of the answers are the platform's stiffness, `S_ij = int sigma(u_i) : eps(u_j) dV`, and as each
answer minimises its energy, an error e in it becomes e^2 in S. For frequencies the unknowns are
displacements x with ground and hub clamped, and the pose q of the hub: `u = x + Psi q`, Psi being
these answers. They are orthogonal to x in energy, so the stiffness is block diagonal, of NGSolve's
factor and the platform's stiffness, and nothing of our own elimination of the hub is used."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Layers, Plate
from flexfem.fem.mesh import PlaneMesh

from .problem import MissingSolverError

COUNT = 6  # natural frequencies of each kind

# of integration; with two triangles across a neck 4 leave 3e-13 of the pose, and 3e-8 of a
# frequency
MORE_ORDERS = 8
NODES = ((1, 0), (0, 1), (0, 0), (0.5, 0.5), (0, 0.5), (0.5, 0))  # our six, in its triangle
SAME_PLACE = 1e-9  # of the stage's size


def hub_motions(nodes: Array, heights: Array, antisymmetric: bool) -> Array:
    """Displacements (n, m, 3, 3) of nodes (n, 2), mm, at heights (m,), mm, per unit of the pose of
    the hub.

    The pose is x, y, theta; antisymmetric z and the rotations about x and y. Not by our own
    `Layers.rigid_fields`."""
    x, y, z = np.broadcast_arrays(*nodes.T[:, :, None], heights)
    zero = np.zeros_like(x)
    one = np.ones_like(x)
    flat = ((one, zero, zero), (zero, one, zero), (-y, x, zero))
    tilting = ((zero, zero, one), (zero, -z, y), (z, zero, -x))
    return np.stack(
        [np.stack(each, axis=-1) for each in (tilting if antisymmetric else flat)], axis=-1
    )


class Curved(NamedTuple):
    """Our mesh in NGSolve.

    mesh : deformed by `offset`, which must live as long.   levels : bounds of layers, 1 in the
    plane; our corner i at bound l is `levels i + l`.   ends : (edges, 2), corners at the ends of
    its edges.   middles : (edges,), our node of the plane between, or -1.   bubble : value of its
    quadratic edge function in the middle of the edge."""

    mesh: Any
    offset: Any
    levels: int
    ends: Index
    middles: Index
    bubble: float

    def coefficients(self, values: Array) -> Array:
        """Coefficients, component by component, of the field with values (n, levels, d) at our
        nodes.

        The field is quadratic in the plane and linear through every layer.
        """
        d = values.shape[-1]
        flat = np.flatnonzero(self.middles >= 0)
        found = np.zeros((self.offset.space.ndof // self.mesh.dim, d))
        corner, level = np.divmod(self.ends[flat], self.levels)
        found[: self.mesh.nv] = values[: self.mesh.nv // self.levels].reshape(-1, d)
        between = values[self.middles[flat], level[:, 0]] - values[corner, level].mean(axis=1)
        found[self.mesh.nv + flat] = between / self.bubble
        return found.T.ravel()


def curved_mesh(ng: Any, mesh: PlaneMesh, layers: Layers | None = None) -> Curved:
    """Our triangles, or our wedges, in NGSolve; triangles are checked node by node."""
    straight = ng.Mesh(_triangles(mesh) if layers is None else _prisms(mesh, layers))
    levels = 1 if layers is None else len(layers.heights) // 2 + 1
    scalar = ng.H1(straight, order=2)
    ends = np.array([[corner.nr for corner in edge.vertices] for edge in straight.edges])
    corners, level = np.divmod(ends, levels)
    flat = level[:, 0] == level[:, 1]
    middles = np.full(len(ends), -1)
    middles[flat] = _middles_of(mesh, np.sort(corners[flat], axis=1))
    probe = ng.GridFunction(scalar)
    probe.vec.FV().NumPy()[straight.nv : straight.nv + straight.nedge] = 1.0
    rule = ng.IntegrationRule([(0.5, 0.0, 0.0)[: straight.dim]], [1.0])
    bubble = float(np.asarray(probe(straight.MapToAllElements(rule, ng.VOL))).ravel()[0])
    offset = ng.GridFunction(ng.VectorH1(straight, order=2))
    curved = Curved(straight, offset, levels, ends, middles, bubble)
    bend = np.zeros((len(mesh.nodes), levels, straight.dim))
    t = mesh.triangles
    bend[t[:, 3:], :, :2] = (
        mesh.nodes[t[:, 3:]] - mesh.nodes[t[:, [[0, 1], [1, 2], [2, 0]]]].mean(axis=2)
    )[:, :, None]
    offset.vec.FV().NumPy()[:] = curved.coefficients(bend)
    straight.SetDeformation(offset)
    if layers is None:
        places = _at_nodes(ng, ng.CoefficientFunction((ng.x, ng.y)), straight)
        assert np.max(np.abs(places - mesh.nodes[t])) < SAME_PLACE * np.ptp(mesh.nodes)
    return curved


def _triangles(mesh: PlaneMesh) -> Any:
    from netgen.meshing import FaceDescriptor, Mesh

    corners = (
        int(mesh.triangles[:, :3].max()) + 1
    )  # the mesh numbers its corners before its middles
    made = Mesh(dim=2)
    made.AddPoints(np.pad(mesh.nodes[:corners], [(0, 0), (0, 1)]))
    made.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    made.AddElements(dim=2, index=1, data=_numbers(mesh.triangles[:, :3]), base=0)
    for number, name in enumerate(("ground", "hub")):
        made.AddElements(dim=1, index=number + 1, data=_numbers(mesh.edges[name][:, :2]), base=0)
        made.SetBCName(number, name)
    return made


def _prisms(mesh: PlaneMesh, layers: Layers) -> Any:
    from netgen.meshing import FaceDescriptor, Mesh

    corners = int(mesh.triangles[:, :3].max()) + 1
    level = len(layers.heights) // 2 + 1
    made = Mesh(dim=3)
    flat = np.repeat(mesh.nodes[:corners], level, axis=0)
    made.AddPoints(np.column_stack([flat, np.tile(layers.heights[::2], corners)]))
    t = mesh.triangles[:, :3] * level
    every = np.concatenate([np.hstack([t + k, t + k + 1]) for k in range(level - 1)])
    made.AddElements(dim=3, index=1, data=_numbers(every), base=0)
    for number, name in enumerate(("ground", "hub", "middle"), start=1):
        made.Add(FaceDescriptor(surfnr=number, domin=1, domout=0, bc=number))
        if name == "middle":
            faces = t[:, ::-1]
        else:
            a, b = mesh.edges[name][:, :2].T * level
            faces = np.concatenate(
                [np.stack([a + k, b + k, b + k + 1, a + k + 1], 1) for k in range(level - 1)]
            )
        made.AddElements(dim=2, index=number, data=_numbers(faces), base=0)
        made.SetBCName(number - 1, name)
    return made


def _numbers(elements: Index) -> Index:
    return np.ascontiguousarray(elements, dtype=np.int32)


def _middles_of(mesh: PlaneMesh, ends: Index) -> Index:
    """Our node in the middle of each edge given by its corners (edges, 2), the lower first."""
    t = mesh.triangles
    size = len(mesh.nodes)
    sides = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1) @ [size, 1]
    order = np.argsort(sides)
    return np.asarray(
        t[:, 3:].T.ravel()[order[np.searchsorted(sides, ends @ [size, 1], sorter=order)]]
    )


def _strain(ng: Any, u: Any) -> Any:
    return (ng.Grad(u) + ng.Grad(u).trans) / 2


def _stress(ng: Any, u: Any, plate: Plate) -> Any:
    """Of plane stress, or in three dimensions; not by our Lame constants."""
    E = plate.youngs_modulus
    nu = plate.poissons_ratio
    strain = _strain(ng, u)
    share = nu / (1 - nu) if u.dim == 2 else nu / (1 - 2 * nu)
    return E / (1 + nu) * (strain + share * ng.Trace(strain) * ng.Id(u.dim))


class Solved(NamedTuple):
    """NGSolve's answers to the three unit motions of the hub with the ground clamped.

    depth : of the sheet, mm, or 2 where half the thickness is meshed.   stiffness : (3, 3),
    energies between motions.
    inverse : of the stiffness with ground and hub clamped.
    """

    ng: Any
    curved: Curved
    plate: Plate
    depth: float
    space: Any
    motions: list[Any]
    stiffness: Array
    inverse: Any

    def frequencies(self, density: float, carried: Array) -> Array:
        """Lowest frequencies (6,), Hz, with a mass matrix (3, 3) of the hub; quotients of NGSolve's
        energies.
        """
        ng = self.ng
        u, v = self.space.TnT()
        form = ng.BilinearForm(self.space, symmetric=True)
        form += density * self.depth * ng.InnerProduct(u, v) * ng.dx(bonus_intorder=MORE_ORDERS)
        form.Assemble()
        free = np.flatnonzero(np.array(self.space.FreeDofs()))
        motions = np.stack([motion.vec.FV().NumPy() for motion in self.motions], axis=-1)

        def spread(q: Array) -> Array:
            found = motions @ q[-3:]
            found[free] += q[:-3]
            return np.asarray(found)

        def inertia(q: Array) -> Array:
            forces = _times(form.mat, spread(q))
            return np.concatenate([forces[free], motions.T @ forces + carried @ q[-3:]])

        def flexibility(q: Array) -> Array:
            inner = np.zeros(len(motions))
            inner[free] = q[:-3]
            return np.concatenate(
                [_times(self.inverse, inner)[free], np.linalg.solve(self.stiffness, q[-3:])]
            )

        size = len(free) + 3
        M, inverse = (
            LinearOperator((size, size), lambda b, f=f: f(b.ravel()), dtype=float)
            for f in (inertia, flexibility)
        )
        shapes = eigsh(M, COUNT, M=M, sigma=0.0, OPinv=inverse, v0=np.cos(np.arange(size)))[1]
        squares = []
        for q in shapes.T:
            mode = ng.GridFunction(self.space)
            mode.vec.FV().NumPy()[:] = spread(q)
            squares.append(_energy(ng, mode, mode, self.plate, self.depth) / (q @ inertia(q)))
        return np.asarray(np.sqrt(np.sort(squares)) / (2 * math.pi))

    def nodal_stress(self, mesh: PlaneMesh) -> Array:
        """Stress (3, n, 2, 2), MPa, by NGSolve's gradients at the nodes, averaged, of unit loads."""
        found = []
        where = mesh.triangles.ravel()
        for motion in self.motions:
            stress = _at_nodes(self.ng, _stress(self.ng, motion, self.plate), self.curved.mesh)
            parts = [
                np.bincount(where, part) / np.bincount(where) for part in stress.reshape(-1, 4).T
            ]
            found.append(np.stack(parts, axis=-1).reshape(-1, 2, 2))
        return np.tensordot(np.linalg.inv(self.stiffness), np.array(found), axes=1)


def solve(
    mesh: PlaneMesh, plate: Plate, layers: Layers | None = None, orders: int = MORE_ORDERS
) -> Solved:
    """NGSolve's answers on our mesh; `orders` of integration beyond its default. Raises
    MissingSolverError.
    """
    try:
        import ngsolve as ng
    except ImportError as error:
        raise MissingSolverError(
            f"NGSolve cannot be loaded ({error}): pip install ngsolve"
        ) from None
    with ng.TaskManager():
        return solved(ng, curved_mesh(ng, mesh, layers), mesh, plate, layers, orders)


def solved(
    ng: Any, curved: Curved, mesh: PlaneMesh, plate: Plate, layers: Layers | None, orders: int
) -> Solved:
    """The same on a mesh that NGSolve has."""
    depth = plate.thickness
    held = {"dirichlet": "ground|hub"}
    if layers is not None:
        depth = 2.0
        whole = "ground|hub|middle"  # the mid-plane is held as motion in or out of the plane asks
        plane, normal = (whole, "ground|hub") if layers.fixed else ("ground|hub", whole)
        held = {"dirichletx": plane, "dirichlety": plane, "dirichletz": normal}
    space = ng.VectorH1(curved.mesh, order=2, **held)
    u, v = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += (
        depth
        * ng.InnerProduct(_stress(ng, u, plate), _strain(ng, v))
        * ng.dx(bonus_intorder=orders)
    )
    form.Assemble()
    inverse = form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    hub = np.unique(mesh.edges["hub"])
    free = np.array(space.FreeDofs())
    motions = []
    heights = np.zeros(1) if layers is None else layers.heights[::2]
    rigid = hub_motions(mesh.nodes[hub], heights, layers is not None and bool(layers.fixed))[
        :, :, : curved.mesh.dim
    ]
    for motion in np.moveaxis(rigid, -1, 0):
        values = np.zeros((len(mesh.nodes), *motion.shape[1:]))
        values[hub] = motion
        field = ng.GridFunction(space)
        field.vec.FV().NumPy()[:] = np.where(free, 0.0, curved.coefficients(values))
        forces = field.vec.CreateVector()
        forces.data = form.mat * field.vec
        field.vec.data -= inverse * forces
        motions.append(field)
    work = np.array([[_energy(ng, a, b, plate, depth, orders) for b in motions] for a in motions])
    return Solved(ng, curved, plate, depth, space, motions, work, inverse)


def _energy(
    ng: Any, one: Any, other: Any, plate: Plate, depth: float, orders: int = MORE_ORDERS
) -> float:
    """`int sigma(one) : eps(other) dV`, N mm: from strains, so that rigid-body motion leaves no
    round-off.
    """
    density = depth * ng.InnerProduct(_stress(ng, one, plate), _strain(ng, other))
    return float(ng.Integrate(density * ng.dx(bonus_intorder=orders), one.space.mesh))


def _times(matrix: Any, vector: Array) -> Array:
    """One of NGSolve's matrices, or inverses, times a vector."""
    taken = matrix.CreateRowVector()
    found = matrix.CreateColVector()
    taken.FV().NumPy()[:] = vector
    found.data = matrix * taken
    return np.array(found.FV().NumPy())


def _at_nodes(ng: Any, field: Any, mesh: Any) -> Array:
    """Values (m, 6, components) of any of NGSolve's fields at the nodes of every triangle, as seen
    from inside.
    """
    rule = ng.IntegrationRule(list(NODES), [1 / 12] * 6)
    return np.asarray(field(mesh.MapToAllElements(rule, ng.VOL))).reshape(mesh.ne, 6, -1)
