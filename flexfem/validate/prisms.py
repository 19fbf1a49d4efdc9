"""The stage in three dimensions by NGSolve's quadratic prisms, deformed as our wedges are: compliance and frequencies.

They have 18 unknowns a component and are ours, so that the two differ by round-off alone, with quadratures that are
both exact enough. On curved triangles the stiffness is an integral of fractions: our degree 4 is 4e-7 off, degree 8
5e-8, degree 12 1e-10. The mass is one of polynomials, and both integrate it exactly.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.layers import Layers
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.validate.frequencies import Vibrating, lowest_of_ngsolve
from flexfem.validate.ngsolve import RigidMotions, import_ngsolve, middles_of
from flexfem.validate.solids import SolidAnswer, hub_motions

MORE_ORDERS = 8  # of integration; measured with two triangles across a neck: 4 leave 3e-8 of a frequency


class Prisms(NamedTuple):
    """Our wedges in NGSolve.

    mesh : deformed by `bend`, which must live as long.   levels : bounds of layers; corner i at l is `levels i + l`.
    ends : (edges, 2), corners at the ends of its edges.   middle : (edges,), our node of the plane between, or -1.
    bubble : value of its quadratic edge function in the middle of the edge.
    """

    mesh: Any
    bend: Any
    levels: int
    ends: Index
    middle: Index
    bubble: float

    def coefficients(self, values: Array, size: int) -> Array:
        """Coefficients (3 size,) of the field, linear through every layer, with values (n, levels, 3) at our nodes."""
        found, flat = np.zeros((size, 3)), np.flatnonzero(self.middle >= 0)
        corner, level = np.divmod(self.ends[flat], self.levels)
        found[: self.mesh.nv] = values[: self.mesh.nv // self.levels].reshape(-1, 3)
        between = values[self.middle[flat], level[:, 0]] - values[corner, level].mean(axis=1)
        found[self.mesh.nv + flat] = between / self.bubble
        return found.T.ravel()


def solve(of: Vibrating, layers: Layers) -> SolidAnswer:
    """NGSolve's compliance and frequencies. Raises BadInput when it is not installed."""
    ng = import_ngsolve()
    with ng.TaskManager():
        prisms, hertz = _curved(ng, of.mesh, layers), []
        flat, tilting = (_motions(ng, prisms, of, each) for each in (layers, layers.antisymmetric))
        for half, carried in ((flat, of.disc), (tilting, tilting_disc(of))):
            found = lowest_of_ngsolve(
                ng, half, _mass(ng, half.space, of), carried, lambda u: _energy(ng, u, u, of.plate)
            )
            hertz.append(found)
    return SolidAnswer(np.asarray(np.linalg.inv(flat.stiffness)), np.concatenate(hertz), str(ng.__version__))


def tilting_disc(of: Vibrating) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm^2, of the hub as a disc, for z and the rotations about x and y."""
    mass = of.disc[0, 0]
    tilting = mass * (3 * of.hub_radius**2 + of.plate.thickness**2) / 12
    return np.diag([mass, tilting, tilting])


def _curved(ng: Any, mesh: StageMesh, layers: Layers) -> Prisms:
    straight = ng.Mesh(_prisms(mesh, layers))
    levels, scalar = layers.number + 1, ng.H1(straight, order=2)
    ends = np.array([[corner.nr for corner in edge.vertices] for edge in straight.edges])
    middle = _plane_middles(mesh, ends // levels, ends % levels)
    probe = ng.GridFunction(scalar)
    probe.vec.FV().NumPy()[straight.nv : straight.nv + straight.nedge] = 1.0
    rule = ng.IntegrationRule([(0.5, 0.5, 0.0)], [1.0])
    bubble = float(np.asarray(probe(straight.MapToAllElements(rule, ng.VOL))).ravel()[0])
    prisms = Prisms(straight, ng.GridFunction(ng.VectorH1(straight, order=2)), levels, ends, middle, bubble)
    offset, t = np.zeros((len(mesh.nodes), levels, 3)), mesh.triangles
    bent = mesh.nodes[t[:, 3:]] - mesh.nodes[t[:, [[0, 1], [1, 2], [2, 0]]]].mean(axis=2)
    offset[t[:, 3:], :, :2] = bent[:, :, None]
    prisms.bend.vec.FV().NumPy()[:] = prisms.coefficients(offset, scalar.ndof)
    straight.SetDeformation(prisms.bend)
    return prisms


def _strain(ng: Any, u: Any) -> Any:
    return (ng.Grad(u) + ng.Grad(u).trans) / 2


def _density(ng: Any, u: Any, v: Any, plate: Plate) -> Any:
    """`sigma(u) : eps(v)`, N/mm^2, of both halves of the thickness."""
    E, nu, strain = plate.youngs_modulus, plate.poissons_ratio, _strain(ng, u)
    stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * ng.Trace(strain) * ng.Id(3))
    return 2 * ng.InnerProduct(stress, _strain(ng, v))


def _energy(ng: Any, u: Any, v: Any, plate: Plate) -> float:
    return float(ng.Integrate(_density(ng, u, v, plate) * ng.dx(bonus_intorder=MORE_ORDERS), u.space.mesh))


def _mass(ng: Any, space: Any, of: Vibrating) -> Any:
    u, v = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += 2 * of.density * ng.InnerProduct(u, v) * ng.dx(bonus_intorder=MORE_ORDERS)
    form.Assemble()
    return form.mat


def _motions(ng: Any, prisms: Prisms, of: Vibrating, layers: Layers) -> RigidMotions:
    """As `ngsolve.rigid_motions`, of half the thickness, the mid-plane held as its motion asks."""
    plane, normal = "ground|hub", "ground|hub|middle"
    if layers.fixed:
        plane, normal = normal, plane
    space = ng.VectorH1(prisms.mesh, order=2, dirichletx=plane, dirichlety=plane, dirichletz=normal)
    u, v = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += _density(ng, u, v, of.plate) * ng.dx(bonus_intorder=MORE_ORDERS)
    form.Assemble()
    inverse = form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    hub, free, motions = np.unique(of.mesh.edges["hub"]), np.array(space.FreeDofs()), []
    rigid = hub_motions(of.mesh.nodes[hub], layers.heights[::2], bool(layers.fixed))
    for motion in np.moveaxis(rigid, -1, 0):
        values = np.zeros((len(of.mesh.nodes), *motion.shape[1:]))
        values[hub] = motion
        field = ng.GridFunction(space)
        field.vec.FV().NumPy()[:] = np.where(free, 0.0, prisms.coefficients(values, space.ndof // 3))
        forces = field.vec.CreateVector()
        forces.data = form.mat * field.vec
        field.vec.data -= inverse * forces
        motions.append(field)
    work = [[_energy(ng, a, b, of.plate) for b in motions] for a in motions]
    return RigidMotions(motions, np.array(work), space, inverse)


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
