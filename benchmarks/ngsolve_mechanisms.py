"""Bands of mechanisms against NGSolve on the drawn plate: drift, compliance, stiffness,
amplification.

    pip install ngsolve
    python benchmarks/ngsolve_mechanisms.py [--mechanisms 24] [--seed 7] [--order 5]
    python benchmarks/ngsolve_mechanisms.py --file mechanism.toml
    python benchmarks/ngsolve_mechanisms.py --solid --order 3 [--mechanisms 12] [--seed 11]

Mechanisms as in random_mechanisms.py. NGSolve meshes the drawn plate by itself and solves it with
polynomials of the stated order. A hinge is the material within its length, and a body is the rest
of its outline. A hinge that ends at a rigid body is held along its end. Heat is an initial strain
in three dimensions, with the strain of the frame across a plate in plane strain. Nothing but the
drawing is taken from flexfem.

With --solid, the drawn plate is extruded, and half of its thickness is solved in three dimensions
with curved prisms: compliance, stiffness, amplification and the first natural frequency in the
plane. The mechanisms have a thickness of 0.5 to 40 times the thinnest neck, and guides with leaves
on both sides are added."""

from __future__ import annotations

import argparse
import cmath
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from netgen.meshing import IdentificationType
from random_mechanisms import Drawing, Random, guide, legs, ring
from scipy.sparse.linalg import LinearOperator, eigsh

import flexfem
from flexfem.arrays import Array
from flexfem.mechanism.edges import Bezier, Curve
from flexfem.mechanism.hinge_place import cut_box, joint_loop
from flexfem.mechanism.layout import Joint, Layout, Patch
from flexfem.mechanism.outlines import Segment
from flexfem.results import ELEMENTS, SOLID

CURVED = 5  # largest order of the edges of elements
FROM_NECK = 0.2  # growth of triangle sizes
PER_ARC = 6  # triangles on the arc of a fillet or a notch, at least
PER_RADIUS = 4  # triangles on the radius of a patch, whose edge may be near that of its body
SAME_SIZE = 1e-5  # of area or volume of a mesh: triangles that overlap add to it
ON_LINE = 1e-6  # mm, between a point and a line that it lies on
ROUND_OFF = 1e-7  # relative to the largest number, of numbers that a symmetry makes zero
MEAN_WIDTH = 8.0  # mm, of a body that is no bar
ON_QUARTER = 129  # points of a spline in place of a quarter of an ellipse
FAMILIES = (ring, legs, guide)
FROM_FACE = (1.0, 4.0)  # bounds of layers below the free face, of the thinnest neck
LARGEST = 450_000  # unknowns in three dimensions
SLENDERNESS = (0.5, 40.0)  # thickness of plates in three dimensions, of the thinnest neck
Shape = Any


def point(z: complex) -> Shape:
    return occ.Pnt(z.real, z.imag, 0)


def edge(curve: Curve) -> Shape:
    """A curve of a drawing."""
    if isinstance(curve, Segment):
        if curve.centre is None:
            return occ.Segment(point(curve.start), point(curve.end))
        return occ.ArcOfCircle(point(curve.start), point(complex(curve.at(0.5))), point(curve.end))
    if isinstance(curve, Bezier):
        return occ.BezierCurve([point(one) for one in curve.points])
    turn = np.linspace(0, np.pi / 2, ON_QUARTER)
    z = (
        curve.centre
        + (curve.start - curve.centre) * np.cos(turn)
        + (curve.end - curve.centre) * np.sin(turn)
    )
    return occ.SplineInterpolation([point(one) for one in z])


def face(loop: Any) -> Shape:
    return occ.Face(occ.Wire([edge(curve) for curve in loop]))


def end_of(joint: Joint, side: int) -> complex:
    return joint.place + side * joint.profile.length / 2 * cmath.exp(1j * joint.heading)


def heights(layout: Layout) -> list[float]:
    """Bounds of layers in half the thickness, which are thinner near the free face, from the
    mid-plane.
    """
    half = layout.thickness / 2
    neck = min(joint.profile.neck for joint in layout.joints)
    return [
        0.0,
        *(half - one * neck for one in reversed(FROM_FACE) if 1.5 * one * neck < half),
        half,
    ]


def extruded(plate: Shape, levels: list[float]) -> Shape:
    """Extrude a plate in layers whose faces are meshed alike, so that prisms are between them."""
    layers = []
    for low, high in pairwise(levels):
        for part in plate.faces:
            layer = part.Move(occ.gp_Vec(0, 0, low)).Extrude((high - low) * occ.Z)
            layer.solids.name = part.name
            layers.append(layer)
    return occ.Glue(layers)


class Drawn:
    """The mesh of a plate without its rigid bodies, and the names of the parts of every contact.

    order : of the edges of elements, at most that of displacements, which otherwise cannot rotate
    rigidly.
    levels : bounds of layers in half the thickness, for three dimensions.
    """

    def __init__(self, layout: Layout, order: int, levels: list[float] | None = None) -> None:
        patches = dict.fromkeys(patch for port in layout.ports for patch, _ in port.parts)
        self.parts: dict[Patch, str] = {}
        faces = []
        for number, body in enumerate(layout.bodies):
            if body.fixed:
                continue
            shape = face(body.outline)
            for hole in body.holes:
                shape = shape - face(hole)
            for joint in layout.joints:
                if number in joint.bodies and joint.cut:
                    shape = shape - face(cut_box(joint))
            shape.faces.name = f"body {number}"
            for index, patch in enumerate(patches):
                if patch.body == number and patch.radius is not None:
                    disc = (
                        occ.WorkPlane()
                        .Circle(patch.point.real, patch.point.imag, patch.radius)
                        .Face()
                    )
                    inside = shape * disc
                    inside.edges.maxh = patch.radius / PER_RADIUS
                    inside.faces.name = f"patch {index} of body {number}"
                    faces.append(inside)
                    shape = shape - disc
                    self.parts[patch] = f"patch {index} of body {number}"
                elif patch.body == number:
                    self.parts[patch] = f"body {number}|patch .* of body {number}"
            faces.append(shape)
        for joint in layout.joints:
            shape = face(joint_loop(joint))
            shape.faces.name = "hinge"
            shape.faces.maxh = joint.profile.neck / 2
            for curve, one in zip(joint_loop(joint), shape.edges, strict=True):
                if isinstance(curve, Segment) and curve.centre is not None:
                    one.maxh = min(joint.profile.neck / 2, curve.length / PER_ARC)
            faces.append(shape)
        whole = occ.Glue(faces)
        held = [
            end_of(joint, side)
            for joint in layout.joints
            for side, body in zip((-1, 1), joint.bodies, strict=True)
            if layout.bodies[body].fixed
        ]
        clamped = [
            body.outline[k] for body in layout.bodies if not body.fixed for k in body.clamped
        ]
        if levels:
            whole = extruded(whole, levels)
        for one in whole.faces if levels else whole.edges:
            at = complex(one.center.x, one.center.y)
            on_clamp = any(
                abs(line.at(line.shares(np.array(at))) - at) < ON_LINE for line in clamped
            )
            if on_clamp or any(abs(at - end) < ON_LINE for end in held):
                one.name = "ground"
        for solid in whole.solids:
            low = solid.faces.Min(occ.Z)
            high = solid.faces.Max(occ.Z)
            low.name = "level" if low.center.z > 0 else "middle"
            high.name = "level"
            up = occ.gp_Trsf.Translation((high.center.z - low.center.z) * occ.Z)
            low.Identify(high, "through", IdentificationType.CLOSESURFACES, up)
        drawing = occ.OCCGeometry(whole, dim=3 if levels else 2)
        size = min(body.width or MEAN_WIDTH for body in layout.bodies) / 3
        made = drawing.GenerateMesh(maxh=size, grading=FROM_NECK)
        self.mesh = ng.Mesh(made)
        self.mesh.Curve(order)
        drawn_size = sum(part.mass for part in (whole.solids if levels else whole.faces))
        size = ng.Integrate(1, self.mesh, order=2 * order)
        if not abs(size - drawn_size) < SAME_SIZE * drawn_size:
            raise ArithmeticError(f"the mesh has the size {size}, the drawing {drawn_size}")


class Fields:
    """A space of displacements of a drawn plate: loads on contacts, and their mean motions."""

    def __init__(self, layout: Layout, drawn: Drawn, order: int, lifted: bool = False) -> None:
        self.mesh = drawn.mesh
        self.layout = layout
        self.parts = drawn.parts
        self.lifted = lifted
        held = {"dirichlet": "ground"}
        if self.mesh.dim == 3:
            held = {"dirichletx": "ground", "dirichlety": "ground", "dirichletz": "ground|middle"}
        if lifted:  # antisymmetric: the mid-plane moves along z alone
            held = {
                "dirichletx": "ground|middle",
                "dirichlety": "ground|middle",
                "dirichletz": "ground",
            }
        self.space = ng.VectorH1(self.mesh, order=order, **held)

    def inertia(self, mass: float, moment: float) -> tuple[float, float, float]:
        """Mass and moment of inertia of a body in the motions of `_basis`."""
        return mass, mass, moment

    def factorised(self, mu: float, volume: float) -> tuple[Any, Any]:
        """Stiffness matrix for both elastic constants, and its inverse."""
        u, v = self.space.TnT()
        stress = 2 * mu * strain_of(u) + volume * ng.Trace(strain_of(u)) * ng.Id(self.mesh.dim)
        K = ng.BilinearForm(self.space, symmetric=True)
        K += ng.InnerProduct(stress, strain_of(v)) * ng.dx(
            bonus_intorder=4 if self.mesh.dim == 2 else 2
        )
        K.Assemble()
        return K, K.mat.Inverse(self.space.FreeDofs(), "sparsecholesky")

    def _basis(self, patch: Patch) -> tuple[Any, list[Any], Array]:
        region = self.mesh.Materials(self.parts[patch])
        x = ng.x - patch.point.real
        y = ng.y - patch.point.imag
        still = (0,) * (self.mesh.dim - 2)
        rigid = [ng.CF((1, 0, *still)), ng.CF((0, 1, *still)), ng.CF((-y, x, *still))]
        if self.lifted:
            rigid = [ng.CF((0, 0, 1)), ng.CF((0, 0, y)), ng.CF((0, 0, -x))]
        M = [
            [ng.Integrate(a * b, self.mesh, definedon=region, order=8) for a in rigid]
            for b in rigid
        ]
        return region, rigid, np.linalg.inv(np.array(M))

    def mean(self, field: Any, patch: Patch) -> Array:
        """Mean rigid motion of a contact, at its point."""
        region, rigid, inverse = self._basis(patch)
        return inverse @ [
            ng.Integrate(field * one, self.mesh, definedon=region, order=10) for one in rigid
        ]

    def force(self, parts: Any) -> Any:
        """Body force of a unit load on a port."""
        load = ng.LinearForm(self.space)
        v = self.space.TestFunction()
        for patch, wrench in parts:
            if patch in self.parts:
                region, rigid, inverse = self._basis(patch)
                for share, one in zip(inverse @ np.array(wrench), rigid, strict=True):
                    load += float(share) * one * v * ng.dx(definedon=region, bonus_intorder=4)
        load.Assemble()
        return load.vec

    def compliance(self, inverse: Any) -> Array:
        """Displacements (k, k) of all ports for unit loads on them."""
        forces = [self.force(port.parts) for port in self.layout.ports]
        fields = []
        for force in forces:
            field = ng.GridFunction(self.space)
            field.vec.data = inverse * force
            fields.append(field)
        return np.array(
            [[ng.InnerProduct(force, field.vec) for field in fields] for force in forces]
        )


def strain_of(u: Any) -> Any:
    return (ng.Grad(u) + ng.Grad(u).trans) / 2


def values_of_ports(layout: Layout, C: Array) -> dict[str, Array]:
    """Numbers by quantity of flexfem, from the compliance of the ports."""
    drives = layout.drive_ports
    found = {
        "stiffness": np.linalg.inv(C[:3, :3]),
        "free": 1 / np.diag(C)[:3],
        "compliance": C[:3, :3],
    }
    return found | ({"amplification": (C[:3, drives] / np.diag(C)[drives]).T} if drives else {})


def reference(mechanism: flexfem.Mechanism, order: int) -> dict[str, Array]:
    """NGSolve's numbers of a plane plate by quantity of flexfem; `pose` is the drift (3 cases, 3)."""
    layout = mechanism.layout
    material = mechanism.material
    fields = Fields(layout, Drawn(layout, min(order, CURVED)), order)
    E = material.youngs_modulus
    nu = material.poissons_ratio
    strain = mechanism.model == "plane_strain"
    plate = float(material.expansion)
    frame = float(mechanism.frame.expansion)
    mu = E / 2 / (1 + nu)
    lame = E * nu / (1 + nu) / (1 - 2 * nu)
    K, inverse = fields.factorised(mu, lame if strain else E * nu / (1 - nu**2))
    v = fields.space.TestFunction()
    x = ng.x
    y = ng.y
    cases = [
        (ng.CF(1), ng.CF((x, y))),
        (x, ng.CF(((x * x - y * y) / 2, x * y))),
        (y, ng.CF((x * y, (y * y - x * x) / 2))),
    ]
    drift = np.zeros((3, 3))
    for number, (warmth, free) in enumerate(cases):
        hot = E / (1 - nu) * plate * warmth
        if strain:
            hot = (2 * mu + 3 * lame) * plate * warmth - lame * frame * warmth
        load = ng.LinearForm(fields.space)
        load += hot * ng.Trace(strain_of(v)) * ng.dx(bonus_intorder=4)
        load.Assemble()
        field = ng.GridFunction(fields.space)
        field.Set(frame * free, definedon=fields.mesh.Boundaries("ground"))
        residual = (load.vec - K.mat * field.vec).Evaluate()
        field.vec.data += inverse * residual
        drift[number] = fields.mean(field, layout.points[0][1])
    return {"pose": drift} | values_of_ports(layout, fields.compliance(inverse) / layout.thickness)


def solid_reference(mechanism: flexfem.Mechanism, order: int) -> dict[str, Array]:
    """NGSolve's numbers in three dimensions by quantity of flexfem; `frequency` is the first in the
    plane, Hz.

    A load on half of the plate is half of that on the plate. Payloads and masses of actuators move
    with the mean motions of their contacts."""
    layout = mechanism.layout
    fields = Fields(layout, Drawn(layout, min(order, CURVED), heights(layout)), order)
    if fields.space.ndof > LARGEST:
        raise MemoryError(f"more than {LARGEST} unknowns: {fields.space.ndof}")
    E = layout.youngs_modulus
    nu = layout.poissons_ratio
    _, inverse = fields.factorised(E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu))
    C = fields.compliance(inverse) / 2
    return (
        values_of_ports(layout, C)
        | {"frequency": first_frequency(fields, inverse)}
        | out_of_plane(mechanism, order)
    )


def out_of_plane(mechanism: flexfem.Mechanism, order: int) -> dict[str, Array]:
    """NGSolve's numbers out of the plane by quantity of flexfem: z, tilt x and tilt y of the
    output.
    """
    layout = mechanism.layout
    fields = Fields(layout, Drawn(layout, min(order, CURVED), heights(layout)), order, lifted=True)
    E = layout.youngs_modulus
    nu = layout.poissons_ratio
    _, inverse = fields.factorised(E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu))
    units = [[(layout.points[0][1], tuple(unit))] for unit in np.eye(3)]
    forces = [fields.force(unit) for unit in units]
    moved = []
    for force in forces:
        field = ng.GridFunction(fields.space)
        field.vec.data = inverse * force
        moved.append(field)
    C = np.array([[ng.InnerProduct(force, field.vec) for field in moved] for force in forces]) / 2
    return {"lifted_held": np.diag(np.linalg.inv(C)), "lifted_free": 1 / np.diag(C)}


def first_frequency(fields: Fields, inverse: Any) -> Array:
    """First natural frequency (1,), Hz, of half a plate, in the displacements of a space."""
    layout = fields.layout
    u, v = fields.space.TnT()
    M = ng.BilinearForm(fields.space, symmetric=True)
    M += layout.density * u * v * ng.dx
    M.Assemble()
    carried = [(load.contact, fields.inertia(load.mass, load.inertia)) for load in layout.payloads]
    carried += [
        (at, fields.inertia(one.mass / 2, 0.0)) for one in layout.actuators for at in one.contacts
    ]
    means = []
    masses = []
    for contact, inertia in carried:
        for unit, one in zip(np.eye(3), inertia, strict=True):
            if one and contact in fields.parts:
                means.append(fields.force([(contact, unit)]).FV().NumPy().copy())
                masses.append(one / 2)
    means = np.reshape(means, (len(masses), fields.space.ndof))
    masses = np.array(masses)
    given = M.mat.CreateColVector()
    found = M.mat.CreateColVector()

    def through(matrix: Any, values: Array) -> Array:
        given.FV().NumPy()[:] = np.ravel(values)
        found.data = matrix * given
        return found.FV().NumPy().copy()

    def mass(values: Array) -> Array:
        return through(M.mat, values) + means.T @ (masses * (means @ np.ravel(values)))

    shape = 2 * (fields.space.ndof,)
    inertia = LinearOperator(shape, mass, dtype=float)
    solve = LinearOperator(shape, lambda values: through(inverse, values), dtype=float)
    start = solve @ fields.force([(layout.points[0][1], (1.0, 0.7, 0.3))]).FV().NumPy()
    start = start + np.abs(start).max() * np.random.default_rng(1).uniform(
        -0.1, 0.1, len(start)
    )  # all modes
    squares = eigsh(
        solve, 3, M=inertia, sigma=0, OPinv=solve, v0=start, tol=1e-8, return_eigenvectors=False
    )
    return np.sqrt(np.sort(squares)[:1]) / 2 / np.pi


Compared = dict[str, list[tuple[float, float, str]]]


def ratios(mechanism: flexfem.Mechanism, order: int, solid: bool = False) -> Compared:
    """Error per band of every number with a band, the band per number, and a text, by quantity."""
    label = SOLID if solid else ELEMENTS
    if solid:
        references = solid_reference(mechanism, order)
        others = {"frequency": flexfem.modes(mechanism, models="elements", count=1)}
    else:
        references = reference(mechanism, order)
        others = {"pose": flexfem.drift(mechanism, models="elements")}
    stiff = flexfem.stiffness(mechanism, models="elements", out_of_plane=solid)
    found: Compared = defaultdict(list)
    for name, wanted in references.items():
        answer = others.get(name, stiff)
        wanted = np.squeeze(wanted)
        of_model = {"model": label} if "model" in answer.quantities[name].over else {}
        value = np.squeeze(answer.at(name, **of_model))
        band = np.squeeze(answer.band(name, **of_model))
        lengths = np.array([1.0, 1.0, mechanism.layout.lever])
        if name in ("compliance", "stiffness"):
            scale = np.sqrt(np.outer(np.diag(value), np.diag(value)))
        elif name in ("free", "frequency", "lifted_held", "lifted_free"):
            scale = value
        else:
            scale = np.max(np.abs(value * lengths), axis=-1, keepdims=True) / lengths
        for where in np.ndindex(value.shape):
            if (
                band[where] > 0
                and abs(value[where]) > ROUND_OFF * np.broadcast_to(scale, value.shape)[where]
            ):
                text = (
                    f"{mechanism.name} {name}{list(where)}: {value[where]:.8g} ± "
                    f"{band[where]:.2g}, {wanted[where]:.8g}"
                )
                relative = band[where] / abs(value[where])
                found[name].append(
                    (abs(value[where] - wanted[where]) / band[where], relative, text)
                )
    return found


def double_guide(rng: Random, name: str) -> flexfem.Mechanism:
    """A bar between two fixed bars, on leaves on both of its sides, which are stretched as it
    moves.
    """
    draw = Drawing(rng)
    width = float(rng.uniform(6, 10))
    half = float(rng.uniform(12, 25))
    span = half + width
    neck = float(rng.uniform(0.4, 1.0))
    draw.bar("stage", [-span + 0j, span + 0j], width)
    for side, where in ((1j, "upper"), (-1j, "lower")):
        long = float(rng.uniform(12, 30)) * neck
        leaf = {
            "shape": "leaf",
            "neck": neck,
            "length": long,
            "fillet": float(rng.uniform(0.3, 1)) * neck,
        }
        base = side * (width + long)
        draw.bar(where, [base - span, base + span], width, fixed=True)
        for k, x in enumerate((-half, half)):
            place = x + side * (width + long) / 2
            draw.hinge(f"{where} {k}", ("stage", where), place, side, leaf)
    draw.drive("drive", ("ground", "stage"), -span - 20, 1 - span)
    return draw.mechanism(name, "stage", complex(rng.uniform(-half, half), 0))


def drawn_at_random(rng: Random, count: int, solid: bool) -> Iterator[flexfem.Mechanism]:
    for k in range(count):
        if not solid:
            family = FAMILIES[int(rng.integers(3))]
            yield family(rng, f"{family.__name__} {k + 1}")
            continue
        family = (*FAMILIES, double_guide)[k % 4]
        drawn = family(rng, f"{family.__name__} {k + 1}")
        neck = min(joint.profile.neck for joint in drawn.layout.joints)
        slenderness = float(np.exp(rng.uniform(*np.log(SLENDERNESS))))
        name = f"{drawn.name}, b/t {slenderness:.2g},"
        yield drawn.replace(name=name, model="three_dimensional", thickness=slenderness * neck)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mechanisms", type=int, default=24)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--order", type=int, default=5)
    parser.add_argument("--solid", action="store_true")
    parser.add_argument("--file", action="append")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    if arguments.file:
        chosen = map(flexfem.load, arguments.file)
    else:
        chosen = drawn_at_random(rng, arguments.mechanisms, arguments.solid)
    found: Compared = defaultdict(list)
    for mechanism in chosen:
        try:
            for name, one in ratios(mechanism, arguments.order, arguments.solid).items():
                found[name] += one
            print(mechanism.name, mechanism.model, flush=True)
        except Exception as error:
            print(mechanism.name, "not compared:", repr(error)[:300], flush=True)
    for name, one in found.items():
        worst = sorted(one, reverse=True)
        outside = sum(ratio > 1 for ratio, _, _ in one)
        width = 100 * np.median([relative for _, relative, _ in one])
        print(
            f"{name:14} {outside:4} of {len(one):4} outside their bands; largest error / band "
            f"{worst[0][0]:.2f}; median band {width:.2g} %"
        )
        print(*(f"    {ratio:6.2f}: {text}" for ratio, _, text in worst[:6]), sep="\n")


if __name__ == "__main__":
    main()
