"""The stage solved by NGSolve: its finite elements, assembly and Cholesky factorisation on our curved triangles.

NGSolve's reader of .msh files takes 6-node triangles for three-dimensional, and curving a mesh from a drawing would
place the middle nodes elsewhere. So the mesh is made in memory from the corners, with straight sides, and then
deformed by a quadratic displacement that moves every middle onto ours: exactly the isoparametric triangles.

On curved triangles the integrand is a fraction, which no rule integrates exactly, and NGSolve's default order is
that of straight ones: 4e-7 off in pose on the default mesh, 1e-4 on the coarsest.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.refused import BadInput, ComputationFailed
from flexfem.validate.records import Answer

MORE_ORDERS = 4  # of integration; measured with two triangles across a neck: 2 leave 6e-11 of the pose, 4 leave 3e-13
NODES = ((1, 0), (0, 1), (0, 0), (0.5, 0.5), (0, 0.5), (0.5, 0))  # our six, in its triangle
SAME_PLACE = 1e-9  # of the stage's size


def import_ngsolve() -> Any:
    """NGSolve. Raises BadInput with the way to install it."""
    try:
        import ngsolve
    except ImportError as error:
        raise BadInput(f"NGSolve cannot be loaded ({error}), expected it installed: pip install ngsolve") from None
    return ngsolve


class Curved(NamedTuple):
    """Our mesh in NGSolve.

    mesh : deformed by `offset`, which must live as long.
    ends : (edges, 2), corners at the ends of its edges.  middles : (edges,), our nodes between them.
    bubble : value of its quadratic edge function in the middle of the edge.
    """

    mesh: Any
    offset: Any
    ends: Index
    middles: Index
    bubble: float

    def coefficients(self, values: Array) -> Array:
        """Coefficients (2 (corners + edges),) of the quadratic field with values (n, 2) at our nodes."""
        corners = values[: len(values) - len(self.middles)]
        edges = (values[self.middles] - values[self.ends].mean(axis=1)) / self.bubble
        return np.concatenate([corners, edges]).T.ravel()

    def values(self, coefficients: Array) -> Array:
        """Values (n, 2) at our nodes of the field with these coefficients."""
        parts = coefficients.reshape(2, -1).T
        values = np.empty_like(parts)
        count = len(parts) - len(self.middles)
        values[:count] = parts[:count]
        values[self.middles] = parts[self.ends].mean(axis=1) + self.bubble * parts[count:]
        return values


def solve(mesh: StageMesh, plate: Plate, more_orders: int = MORE_ORDERS) -> Answer:
    """Answer to unit loads on the rigid hub with the ground clamped.

    more_orders : of integration, beyond NGSolve's own for quadratic triangles.

    Raises BadInput when NGSolve is not installed, ComputationFailed when its triangles are not ours.

    Notes
    -----
    The hub's displacement is prescribed as the three unit motions of a rigid body, `X`, `Y` and `theta x r`. The
    strain energies of the answers are the platform's stiffness, `S_ij = b int sigma(u_i) : eps(u_j) dA`, and as each
    answer minimises its energy, an error e in it becomes e^2 in S. Then C = S^-1, and C combines the three fields to
    those of unit loads. Nothing of our own elimination of the hub is used.
    """
    ng = import_ngsolve()
    started = time.perf_counter()
    with ng.TaskManager():
        curved = curved_mesh(ng, mesh)
        motions, stiffness, *_ = rigid_motions(ng, curved, mesh, plate, more_orders)
        stress = np.array([_nodal_stress(ng, motion, plate, mesh) for motion in motions])
    fields = np.array([curved.values(motion.vec.FV().NumPy()) for motion in motions])
    compliance = np.asarray(np.linalg.inv(stiffness), dtype=np.float64)
    return Answer(
        version=str(ng.__version__),
        compliance=compliance,
        fields=np.tensordot(compliance, fields, axes=1),
        stress=np.tensordot(compliance, stress, axes=1),
        seconds=time.perf_counter() - started,
    )


def curved_mesh(ng: Any, mesh: StageMesh) -> Curved:
    """Our triangles in NGSolve, checked node by node. Raises ComputationFailed when any is elsewhere."""
    straight = ng.Mesh(_straight_mesh(mesh))
    ends = np.sort([[corner.nr for corner in edge.vertices] for edge in straight.edges], axis=1)
    middles = middles_of(mesh, ends)
    quadratic = ng.VectorH1(straight, order=2)
    probe = ng.GridFunction(ng.H1(straight, order=2))
    probe.vec.FV().NumPy()[straight.nv :] = 1.0
    bubble = float(_at_nodes(ng, probe, straight)[0, 5, 0])
    curved = Curved(straight, ng.GridFunction(quadratic), ends, middles, bubble)
    offset = np.zeros_like(mesh.nodes)
    offset[middles] = mesh.nodes[middles] - mesh.nodes[ends].mean(axis=1)
    curved.offset.vec.FV().NumPy()[:] = curved.coefficients(offset)
    straight.SetDeformation(curved.offset)
    places = _at_nodes(ng, ng.CoefficientFunction((ng.x, ng.y)), straight)
    if np.max(np.abs(places - mesh.nodes[mesh.triangles])) > SAME_PLACE * np.ptp(mesh.nodes):
        raise ComputationFailed(
            f"NGSolve {ng.__version__} numbers or places the nodes of triangles unlike its 6.2.2608"
        )
    return curved


def _straight_mesh(mesh: StageMesh) -> Any:
    from netgen.meshing import FaceDescriptor, Mesh

    corners = int(mesh.triangles[:, :3].max()) + 1  # the mesh numbers its corners before its middles
    made = Mesh(dim=2)
    made.AddPoints(np.pad(mesh.nodes[:corners], [(0, 0), (0, 1)]))
    made.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    made.AddElements(dim=2, index=1, data=np.ascontiguousarray(mesh.triangles[:, :3], dtype=np.int32), base=0)
    for number, name in enumerate(("ground", "hub")):
        ends = np.ascontiguousarray(mesh.edges[name][:, :2], dtype=np.int32)
        made.AddElements(dim=1, index=number + 1, data=ends, base=0)
        made.SetBCName(number, name)
    return made


def middles_of(mesh: StageMesh, ends: Index) -> Index:
    """Our node in the middle of each edge given by its corners (edges, 2), the lower first."""
    t, size = mesh.triangles, len(mesh.nodes)
    sides = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1) @ [size, 1]
    order = np.argsort(sides)
    return np.asarray(t[:, 3:].T.ravel()[order[np.searchsorted(sides, ends @ [size, 1], sorter=order)]])


def _strain(ng: Any, u: Any) -> Any:
    return (ng.Grad(u) + ng.Grad(u).trans) / 2


def _stress(ng: Any, u: Any, plate: Plate) -> Any:
    E, nu, strain = plate.youngs_modulus, plate.poissons_ratio, _strain(ng, u)
    return E / (1 - nu**2) * ((1 - nu) * strain + nu * ng.Trace(strain) * ng.Id(2))  # not by our Lame constants


class RigidMotions(NamedTuple):
    """The stage's answers to the three unit motions of the hub, in its `space`, and the energies (3, 3) between them.

    inverse : of the stiffness with ground and hub clamped.
    """

    motions: list[Any]
    stiffness: Array
    space: Any
    inverse: Any


def rigid_motions(ng: Any, curved: Curved, mesh: StageMesh, plate: Plate, more_orders: int) -> RigidMotions:
    """Solve for the three unit motions of the hub with the ground clamped."""
    space = ng.VectorH1(curved.mesh, order=2, dirichlet="ground|hub")
    u, v = space.TnT()
    dx = ng.dx(bonus_intorder=more_orders)
    energy = ng.BilinearForm(space, symmetric=True)
    energy += plate.thickness * ng.InnerProduct(_stress(ng, u, plate), _strain(ng, v)) * dx
    energy.Assemble()
    inverse = energy.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    motions = []
    for prescribed in _prescribed(curved, mesh):
        motion = ng.GridFunction(space)
        motion.vec.FV().NumPy()[:] = prescribed
        forces = motion.vec.CreateVector()
        forces.data = energy.mat * motion.vec
        motion.vec.data -= inverse * forces
        motions.append(motion)
    work = [[energy_of(ng, a, b, plate, more_orders) for b in motions] for a in motions]
    return RigidMotions(motions, np.array(work), space, inverse)


def energy_of(ng: Any, one: Any, other: Any, plate: Plate, more_orders: int) -> float:
    """`b int sigma(one) : eps(other) dA`, N mm: from strains, so that rigid-body motion leaves no round-off."""
    density = plate.thickness * ng.InnerProduct(_stress(ng, one, plate), _strain(ng, other))
    return float(ng.Integrate(density * ng.dx(bonus_intorder=more_orders), one.space.mesh))


def _prescribed(curved: Curved, mesh: StageMesh) -> list[Array]:
    """Coefficients of the three unit motions on the hub and of none elsewhere."""
    hub = np.unique(mesh.edges["hub"])
    held = np.zeros((len(mesh.nodes), 1), dtype=bool)
    held[hub] = True
    at_hub = np.concatenate([held[: len(held) - len(curved.middles)], held[curved.middles]])
    x, y = mesh.nodes.T
    one, zero = np.ones_like(x), np.zeros_like(x)
    motions = [np.stack(motion, axis=-1) for motion in ((one, zero), (zero, one), (-y, x))]
    return [np.where(at_hub, curved.coefficients(motion).reshape(2, -1).T, 0.0).T.ravel() for motion in motions]


def _nodal_stress(ng: Any, motion: Any, plate: Plate, mesh: StageMesh) -> Array:
    """Stress (n, 3), MPa, as xx, yy, xy, from NGSolve's gradients at the nodes of every triangle, averaged."""
    stress = _at_nodes(ng, _stress(ng, motion, plate), motion.space.mesh).reshape(-1, 4)[:, [0, 3, 1]]
    where = mesh.triangles.ravel()
    return np.stack([np.bincount(where, part) for part in stress.T], axis=-1) / np.bincount(where)[:, None]


def _at_nodes(ng: Any, field: Any, mesh: Any) -> Array:
    """Values (m, 6, components) of any of NGSolve's fields at the nodes of every triangle, as seen from inside."""
    rule = ng.IntegrationRule(list(NODES), [1 / 12] * 6)
    return np.asarray(field(mesh.MapToAllElements(rule, ng.VOL))).reshape(mesh.ne, 6, -1)
