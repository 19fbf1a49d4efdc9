"""Bands of mechanisms against NGSolve on the drawn plate: drift, compliance, stiffness, amplification.

    pip install ngsolve
    python benchmarks/ngsolve_mechanisms.py [--mechanisms 24] [--seed 7] [--order 5]
    python benchmarks/ngsolve_mechanisms.py --file mechanism.toml

Mechanisms as in random_mechanisms.py. NGSolve meshes the drawn plate by itself and solves it with polynomials of the
stated order. A hinge is the material within its length, and a body is the rest of its outline. A hinge that ends at a
rigid body is held along its end. Heat is an initial strain in three dimensions, with the strain of the frame across a
plate in plane strain. Nothing but the drawing is taken from flexfem.
"""

from __future__ import annotations

import argparse
import cmath
from collections import defaultdict
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from random_mechanisms import guide, legs, ring

import flexfem
from flexfem.arrays import Array
from flexfem.mechanism.layout import Joint, Layout, Patch
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.plate import cut_box, joint_loop
from flexfem.mechanism.profiles import Bezier, Curve
from flexfem.results import ELEMENTS

CURVED = 5  # order of the edges of elements
FROM_NECK = 0.2  # growth of triangle sizes
PER_ARC = 6  # triangles on the arc of a fillet or a notch, at least
ON_LINE = 1e-6  # mm, between a point and a line that it lies on
ROUND_OFF = 1e-7  # relative to the largest number, of numbers that a symmetry makes zero
MEAN_WIDTH = 8.0  # mm, of a body that is no bar
ON_QUARTER = 129  # points of a spline in place of a quarter of an ellipse
FAMILIES = (ring, legs, guide)
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
    z = curve.centre + (curve.start - curve.centre) * np.cos(turn) + (curve.end - curve.centre) * np.sin(turn)
    return occ.SplineInterpolation([point(one) for one in z])


def face(loop: Any) -> Shape:
    return occ.Face(occ.Wire([edge(curve) for curve in loop]))


def end_of(joint: Joint, side: int) -> complex:
    return joint.place + side * joint.profile.length / 2 * cmath.exp(1j * joint.heading)


class Drawn:
    """The mesh of a plate without its rigid bodies, and the names of the parts of every contact."""

    def __init__(self, layout: Layout) -> None:
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
                    disc = occ.WorkPlane().Circle(patch.point.real, patch.point.imag, patch.radius).Face()
                    inside = shape * disc
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
        held = [end_of(joint, side) for joint in layout.joints for side, body in zip((-1, 1), joint.bodies, strict=True)
                if layout.bodies[body].fixed]  # fmt: skip
        clamped = [body.outline[k] for body in layout.bodies if not body.fixed for k in body.clamped]
        for one in whole.edges:
            at = complex(one.center.x, one.center.y)
            on_clamp = any(abs(line.at(line.shares(np.array(at))) - at) < ON_LINE for line in clamped)
            if on_clamp or any(abs(at - end) < ON_LINE for end in held):
                one.name = "ground"
        drawing = occ.OCCGeometry(whole, dim=2)
        size = min(body.width or MEAN_WIDTH for body in layout.bodies) / 3
        made = drawing.GenerateMesh(maxh=size, grading=FROM_NECK)
        self.mesh = ng.Mesh(made)
        self.mesh.Curve(CURVED)


class Reference:
    """NGSolve's answers: drift (3 cases, 3), and the compliance (k, k) of all ports."""

    def __init__(self, mechanism: flexfem.Mechanism, order: int) -> None:
        layout, material = mechanism.layout, mechanism.material
        drawn = Drawn(layout)
        self.mesh, self.layout, self.parts = drawn.mesh, layout, drawn.parts
        E, nu, strain = material.youngs_modulus, material.poissons_ratio, mechanism.model == "plane_strain"
        plate, frame = float(material.expansion), float(mechanism.frame.expansion)
        mu, lame = E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu)
        self.space = ng.VectorH1(self.mesh, order=order, dirichlet="ground")
        u, v = self.space.TnT()

        def strain_of(u: Any) -> Any:
            return (ng.Grad(u) + ng.Grad(u).trans) / 2

        volume = lame if strain else E * nu / (1 - nu**2)
        K = ng.BilinearForm(self.space, symmetric=True)
        stress = 2 * mu * strain_of(u) + volume * ng.Trace(strain_of(u)) * ng.Id(2)
        K += ng.InnerProduct(stress, strain_of(v)) * ng.dx(bonus_intorder=4)
        K.Assemble()
        inverse = K.mat.Inverse(self.space.FreeDofs(), "sparsecholesky")
        self.triangles = self.mesh.ne
        x, y = ng.x, ng.y
        cases = [(ng.CF(1), ng.CF((x, y))), (x, ng.CF(((x * x - y * y) / 2, x * y))),
                 (y, ng.CF((x * y, (y * y - x * x) / 2)))]  # fmt: skip
        output = layout.points[0][1]
        self.drift = np.zeros((3, 3))
        for number, (warmth, free) in enumerate(cases):
            hot = (
                (2 * mu + 3 * lame) * plate * warmth - lame * frame * warmth
                if strain
                else E / (1 - nu) * plate * warmth
            )
            load = ng.LinearForm(self.space)
            load += hot * ng.Trace(strain_of(v)) * ng.dx(bonus_intorder=4)
            load.Assemble()
            field = ng.GridFunction(self.space)
            field.Set(frame * free, definedon=self.mesh.Boundaries("ground"))
            residual = (load.vec - K.mat * field.vec).Evaluate()
            field.vec.data += inverse * residual
            self.drift[number] = self.mean(field, output)
        forces = [self.force(port.parts) for port in layout.ports]
        fields = []
        for force in forces:
            field = ng.GridFunction(self.space)
            field.vec.data = inverse * force
            fields.append(field)
        thick = layout.thickness
        self.compliance = np.array([[ng.InnerProduct(f, one.vec) / thick for one in fields] for f in forces])

    def _basis(self, patch: Patch) -> tuple[Any, list[Any], Array]:
        region = self.mesh.Materials(self.parts[patch])
        x, y = ng.x - patch.point.real, ng.y - patch.point.imag
        rigid = [ng.CF((1, 0)), ng.CF((0, 1)), ng.CF((-y, x))]
        M = [[ng.Integrate(a * b, self.mesh, definedon=region, order=8) for a in rigid] for b in rigid]
        return region, rigid, np.linalg.inv(np.array(M))

    def mean(self, field: Any, patch: Patch) -> Array:
        """Mean rigid motion of a contact, at its point."""
        region, rigid, inverse = self._basis(patch)
        return inverse @ [ng.Integrate(field * one, self.mesh, definedon=region, order=10) for one in rigid]

    def force(self, parts: Any) -> Any:
        """Body force of a unit load on a port."""
        load, v = ng.LinearForm(self.space), self.space.TestFunction()
        for patch, wrench in parts:
            if patch in self.parts:
                region, rigid, inverse = self._basis(patch)
                for share, one in zip(inverse @ np.array(wrench), rigid, strict=True):
                    load += float(share) * one * v * ng.dx(definedon=region, bonus_intorder=4)
        load.Assemble()
        return load.vec

    def values(self) -> dict[str, Array]:
        """Numbers by quantity of flexfem."""
        C, drives = self.compliance, self.layout.drive_ports
        K, opening = np.linalg.inv(C[:3, :3]), np.diag(C)[drives]
        free = 1 / np.diag(C)[:3]
        found = {"pose": self.drift, "stiffness": K, "free": free, "compliance": C[:3, :3]}
        return found | ({"amplification": (C[:3, drives] / opening).T} if drives else {})


def ratios(mechanism: flexfem.Mechanism, order: int) -> dict[str, list[tuple[float, str]]]:
    """Error per band of every number with a band, with a text, by quantity."""
    warm = flexfem.drift(mechanism, models="elements")
    stiff = flexfem.stiffness(mechanism, models="elements")
    found = defaultdict[str, list[tuple[float, str]]](list)
    for name, wanted in Reference(mechanism, order).values().items():
        answer = warm if name == "pose" else stiff
        wanted = np.squeeze(wanted)
        value = np.squeeze(answer.at(name, model=ELEMENTS))
        band = np.squeeze(answer.band(name, model=ELEMENTS))
        lengths = np.array([1.0, 1.0, mechanism.layout.lever])
        if name in ("compliance", "stiffness"):
            scale = np.sqrt(np.outer(np.diag(value), np.diag(value)))
        else:
            scale = np.max(np.abs(value * lengths), axis=-1, keepdims=True) / lengths
        for where in np.ndindex(value.shape):
            if band[where] > 0 and abs(value[where]) > ROUND_OFF * np.broadcast_to(scale, value.shape)[where]:
                text = (
                    f"{mechanism.name} {name}{list(where)}: {value[where]:.8g} ± {band[where]:.2g}, {wanted[where]:.8g}"
                )
                found[name].append((abs(value[where] - wanted[where]) / band[where], text))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mechanisms", type=int, default=24)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--order", type=int, default=5)
    parser.add_argument("--file")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    if arguments.file:
        chosen = [flexfem.load(arguments.file)]
    else:
        families = (FAMILIES[int(rng.integers(3))] for _ in range(arguments.mechanisms))
        chosen = (family(rng, f"{family.__name__} {k + 1}") for k, family in enumerate(families))
    found = defaultdict[str, list[tuple[float, str]]](list)
    for mechanism in chosen:
        try:
            for name, one in ratios(mechanism, arguments.order).items():
                found[name] += one
            print(mechanism.name, mechanism.model, flush=True)
        except Exception as error:
            print(mechanism.name, "not compared:", repr(error)[:300], flush=True)
    for name, one in found.items():
        worst = sorted(one, reverse=True)
        outside = sum(ratio > 1 for ratio, _ in one)
        print(f"{name:14} {outside:4} of {len(one):4} outside their bands; largest error / band {worst[0][0]:.2f}")
        print(*(f"    {ratio:6.2f}: {text}" for ratio, text in worst[:6]), sep="\n")


if __name__ == "__main__":
    main()
