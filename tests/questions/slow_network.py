"""The unsymmetric mechanism of the tests as a network of rigid bodies and hinges, written out
slowly, without flexfem.

Lengths of the drawing are in inches and angles in degrees; all else is in mm, N, tonne and rad.
Every moving body has the displacement x, y of the origin and a rotation. A hinge is a spring at its
centre, in its axes, by quadrature."""

from __future__ import annotations

import cmath
import math

import numpy as np
import shapely
from scipy.integrate import cumulative_trapezoid, quad, trapezoid
from scipy.linalg import eigh

INCH = 25.4
E = 72.7e3
NU = 0.34
THICKNESS = 0.4 * INCH
DENSITY = 2810e-12
E_STRAIN = E / (1 - NU**2)
SHEAR = E / (2 * (1 + NU))
FINE = 4001  # sections of a hinge
UNIAXIAL = math.sqrt(
    1 - NU + NU**2
)  # von Mises stress of a stress along a surface, with NU times it across
BODIES = ["leg", "stage", "lever", "leg 2", "leg 3"]


def turn(degrees):
    return cmath.exp(1j * math.radians(degrees))


def reflected(z):
    """The mirror image at the line through (0.03, 0.02) at 8 degrees."""
    return 0.03 + 0.02j + turn(16) * (z - 0.03 - 0.02j).conjugate()


PLACES = {  # of a point and a direction on the first leg, by the name of the leg
    "leg": (lambda z: z, lambda way: way),
    "leg 2": (lambda z: z * turn(-30), lambda way: way * turn(-30)),
    "leg 3": (
        lambda z: reflected(z * turn(-30)),
        lambda way: turn(16) * (way * turn(-30)).conjugate(),
    ),
}


def notch(radius, neck):
    def height(x):
        return neck + 2 * (radius - math.sqrt(max(radius**2 - x**2, 0.0)))

    return height


def leaf(length, neck, fillet):
    def height(x):
        inside = max(abs(x) - (length / 2 - fillet), 0.0)
        return neck + 2 * (fillet - math.sqrt(max(fillet**2 - inside**2, 0.0)))

    return height


class Hinge:
    """A hinge from one body to another: centre and axis, complex, mm, and its profile."""

    def __init__(self, modulus, name, near, far, centre, axis, radius, neck, length=None):
        self.modulus = modulus
        self.name, self.near, self.far, self.axis = name, near, far, axis / abs(axis)
        self.centre = INCH * centre
        self.radius = INCH * radius
        self.neck = INCH * neck
        self.is_notch = length is None
        self.length = 2 * self.radius if length is None else INCH * length
        profile = (
            notch(self.radius, self.neck)
            if length is None
            else leaf(self.length, self.neck, self.radius)
        )
        self.height = profile
        breaks = [-self.length / 2 + self.radius, 0.0, self.length / 2 - self.radius]

        def integral(function):
            return quad(
                function, -self.length / 2, self.length / 2, points=breaks, epsrel=1e-11, limit=400
            )[0]

        axial = integral(lambda x: 1 / profile(x)) / THICKNESS
        rotation = integral(lambda x: 12 / profile(x) ** 3) / THICKNESS
        bending = integral(lambda x: 12 * x**2 / profile(x) ** 3) / THICKNESS
        stretched = np.array([axial, bending, rotation])  # per Young's modulus of the plane problem
        self.compliance = stretched / modulus + np.array([0.0, 1.2 * axial / SHEAR, 0.0])

    def ends(self, bodies):
        """Rows (3, unknowns) of the near and of the far end: motion at the centre, in the axes."""
        c = self.axis.real
        s = self.axis.imag
        axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return [axes @ at(body, self.centre, bodies) for body in (self.near, self.far)]

    def motion(self, bodies):
        """Rows (3, unknowns): motion of the far end relative to the near one, at the centre, in the
        axes.
        """
        near, far = self.ends(bodies)
        return far - near

    def mass(self):
        """Mass matrix (6, 6) of motions of the near and the far end, as a beam of sections that
        bends without inertia.

        By integration along the axis: u' = N / EA, theta' = (M - V x) / EI, v' = theta + 1.2 V /
        GA."""
        x = np.linspace(-self.length / 2, self.length / 2, FINE)
        h = np.array([self.height(each) for each in x])
        sections = []
        for column in np.eye(6):
            near = column[:3]
            far = column[3:]
            N, V, M = (far - near) / self.compliance
            bent = cumulative_trapezoid(
                (M - V * x) * 12 / (self.modulus * THICKNESS * h**3), x, initial=0.0
            )
            slid = cumulative_trapezoid(bent + 1.2 * V / (SHEAR * THICKNESS * h), x, initial=0.0)
            along = cumulative_trapezoid(N / (self.modulus * THICKNESS * h), x, initial=0.0)
            sections.append([near[0] + along, near[1] + near[2] * x + slid, near[2] + bent])
        u, v, theta = np.moveaxis(sections, 1, 0)
        squares = np.einsum("ix,jx->ijx", u, u) + np.einsum("ix,jx->ijx", v, v)
        turns = np.einsum("ix,jx->ijx", theta, theta)
        return DENSITY * THICKNESS * trapezoid(squares * h + turns * h**3 / 12, x, axis=-1)

    def stress(self, wrench):
        """Largest von Mises stress, MPa, by stress concentrations at sections that are close
        together.
        """
        tension, transverse, moment = wrench
        highest = 0.0
        for x in np.linspace(-self.length / 2, self.length / 2, 2001):
            h = self.height(x)
            k_moment, k_tension, k_shear = self.concentration(x)
            bent = abs(moment * k_moment - transverse * x * k_shear)
            surface = UNIAXIAL * (abs(tension) * k_tension + 6 * bent / h)
            middle = math.hypot(UNIAXIAL * tension, 1.5 * math.sqrt(3) * transverse)
            highest = max(highest, max(surface, middle) / (THICKNESS * h))
        return highest

    def concentration(self, x):
        if self.is_notch:  # Neuber's deep hyperbolic notch
            a = self.neck / (2 * self.radius)
            root = math.sqrt(a)
            angle = math.atan(math.sqrt(a))
            return (
                4 * a * root / (3 * (root + (a - 1) * angle)),
                2 * (a + 1) * root / ((a + 1) * angle + root),
                2 * a * root * (a + 1) / (3 * ((a + 1) * angle - root)),
            )
        if abs(x) < self.length / 2 - self.radius:
            return 1.0, 1.0, 1.0
        ratio = self.neck / self.radius
        tension = (1 + 0.8446 * ratio**1.1349) ** (0.4555 / 1.1349)
        bending = (1 + 0.3352 * ratio**0.9479) ** (0.4555 / 0.9479)
        return bending, tension, bending

    def half(self, at_end):
        """Area, first moments x, y and polar moment about the origin of the half at the near (-1)
        or far (1) end.
        """
        found = np.zeros(4)
        for k, power in enumerate(((0, 0), (1, 0), (0, 2), (2, 0))):  # of x and y in the axes
            low, high = sorted((0.0, at_end * self.length / 2))
            shape = (
                (lambda x: self.height(x))
                if power[1] == 0
                else (lambda x: self.height(x) ** 3 / 12)
            )
            cuts = [
                y
                for y in (-self.length / 2 + self.radius, self.length / 2 - self.radius)
                if low < y < high
            ]
            found[k] = quad(lambda x: x ** power[0] * shape(x), low, high, points=cuts or None)[0]  # noqa: B023
        area, along, square_y, square_x = found
        first = area * self.centre + along * self.axis
        polar = square_x + square_y + area * abs(self.centre) ** 2
        polar += 2 * along * (self.centre.conjugate() * self.axis).real
        return np.array([area, first.real, first.imag, polar])


def at(body, point, bodies):
    """Rows (3, unknowns): displacement x, y and rotation at a point of a body, zero for the ground."""
    rows = np.zeros((3, 3 * len(bodies)))
    if body in bodies:
        k = 3 * bodies.index(body)
        rows[:, k : k + 3] = np.eye(3)
        rows[0, k + 2] = -point.imag
        rows[1, k + 2] = point.real
    return rows


def hinges(modulus):
    """The eight hinges, in the order of the file and then of the copies."""
    first = turn(105)
    found = []
    for number, leg in enumerate(("leg", "leg 2", "leg 3"), 1):
        place, way = PLACES[leg]
        name = "" if number == 1 else f" {number}"
        found.append(
            Hinge(modulus, f"tip{name}", "stage", leg, place(0.44 * first), way(first), 0.06, 0.045)
        )
        found.append(
            Hinge(
                modulus, f"root{name}", leg, "foot", place(1.1 * first), way(first), 0.03, 0.03, 0.3
            )
        )
        if number == 1:
            found.append(Hinge(modulus, "pivot", "block", "lever", 0.95 - 0.33j, 1j, 0.08, 0.06))
            found.append(
                Hinge(modulus, "coupler", "stage", "lever", 0.605 + 0.1j, 1.0, 0.04, 0.03, 0.49)
            )
    return found


def box(centre, axis, length, height):
    corners = [
        centre + axis * complex(x * length / 2, y * height / 2)
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return shapely.Polygon([(INCH * z.real, INCH * z.imag) for z in corners])


def moments(polygon):
    """Area, first moments x, y and polar moment about the origin of a polygon without holes, by
    Green's theorem.
    """
    x, y = np.array(shapely.orient_polygons(polygon).exterior.coords).T
    cross = x[:-1] * y[1:] - x[1:] * y[:-1]
    area = cross.sum() / 2
    first = [np.sum((v[:-1] + v[1:]) * cross) / 6 for v in (x, y)]
    second = [np.sum((v[:-1] ** 2 + v[:-1] * v[1:] + v[1:] ** 2) * cross) / 12 for v in (x, y)]
    return np.array([area, *first, sum(second)])


def bodies_drawn():
    """Polygons of the moving bodies after the cuts for their hinges, mm."""
    first = turn(105)
    legs = {}
    tips = []
    for leg, (place, way) in PLACES.items():
        axis = way(first)
        tips.append(box(place(0.44 * first), axis, 0.12, 0.24))
        legs[leg] = box(place(0.725 * first), axis, 0.95 - 0.5, 0.18)
    coupler = box(0.605 + 0.1j, 1.0, 0.49, 1.02 * 0.24)
    disc = shapely.Point(0, 0).buffer(0.4 * INCH, quad_segs=4000)
    stage = shapely.difference(disc, shapely.union_all([*tips, coupler]))
    lever = shapely.difference(box(0.95 + 0.175j, 1.0, 0.24, 0.85), coupler)
    return legs | {"stage": stage, "lever": lever}


class SlowNetwork:
    """The network with its ports: x, y, theta of the output and of both points, then the openings
    of both actuators.
    """

    SPRINGS = np.array([25e3, 45e3])  # N/mm, blocking force over stroke
    STROKES = np.array([12e-3, 20e-3])

    def __init__(self, modulus=E_STRAIN):
        self.hinges = hinges(modulus)
        self.unknowns = 3 * len(BODIES)
        self.K = np.zeros((self.unknowns, self.unknowns))
        for hinge in self.hinges:
            rows = hinge.motion(BODIES)
            self.K += rows.T @ np.diag(1 / hinge.compliance) @ rows
        output = 0.05 - 0.08j
        probe = 0.93 + 0.5j
        arm = 0.34 - 0.5j
        places = (("stage", output), ("lever", probe), ("leg 3", arm))
        points = [at(body, INCH * place, BODIES) for body, place in places]
        self.openings = np.array(
            [
                self._opening(("ground", 1.2 - 0.12j), ("lever", 1.07 - 0.12j)),
                self._opening(("lever", 0.84 + 0.52j), ("leg 2", 0.29 + 0.7j)),
            ]
        )
        self.ports = np.vstack([*points, self.openings])
        self.output = points[0]

    def _opening(self, near, far):
        one, start = near
        other, end = far
        way = (end - start) / abs(end - start)
        apart = at(other, INCH * end, BODIES) - at(one, INCH * start, BODIES)
        return way.real * apart[0] + way.imag * apart[1]

    def under(self, forces, springs=(0.0, 0.0)):
        """Displacements of the unknowns under forces on them, with springs in place of the
        actuators.
        """
        K = self.K.copy()
        for spring, row in zip(springs, self.openings, strict=True):
            K += spring * np.outer(row, row)
        return np.linalg.solve(K, forces)

    def compliance(self):
        return self.ports @ self.under(self.ports.T)

    def wrenches(self, u):
        return [np.diag(1 / hinge.compliance) @ hinge.motion(BODIES) @ u for hinge in self.hinges]

    def stress(self, u):
        return np.array(
            [hinge.stress(w) for hinge, w in zip(self.hinges, self.wrenches(u), strict=True)]
        )

    def held_at(self, pose):
        """Displacements of the unknowns with the output held at a pose."""
        n = self.unknowns
        K = np.zeros((n + 3, n + 3))
        K[:n, :n] = self.K
        K[:n, n:] = self.output.T
        K[n:, :n] = self.output
        return np.linalg.solve(K, np.concatenate([np.zeros(n), pose]))[:n]

    def driven(self, strokes):
        """Displacements of the unknowns with both actuators in place, at free strokes."""
        return self.under(self.openings.T @ (self.SPRINGS * strokes), self.SPRINGS)

    def mass(self, halved=False):
        """Mass matrix of the unknowns; with `halved`, each half of a hinge moves with its body."""
        M = np.zeros((self.unknowns, self.unknowns))
        drawn = bodies_drawn()
        for k, body in enumerate(BODIES):
            total = moments(drawn[body])
            for hinge in self.hinges if halved else ():
                for end, name in ((-1, hinge.near), (1, hinge.far)):
                    if name == body:
                        total = total + hinge.half(end)
            area, x, y, polar = total * DENSITY * THICKNESS
            M[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = [[area, 0, -y], [0, area, x], [-y, x, polar]]
        for hinge in () if halved else self.hinges:
            ends = np.vstack(hinge.ends(BODIES))
            M += ends.T @ hinge.mass() @ ends
        M += self.output.T @ np.diag([220e-6, 220e-6, 60e-3]) @ self.output
        ends = (
            ("lever", 1.07 - 0.12j, 3e-6),
            ("lever", 0.84 + 0.52j, 4.5e-6),
            ("leg 2", 0.29 + 0.7j, 4.5e-6),
        )
        for body, point, tonne in ends:
            rows = at(body, INCH * point, BODIES)[:2]
            M += tonne * rows.T @ rows
        return M

    def frequencies(self, springs=(0.0, 0.0)):
        K = self.K + sum(
            k * np.outer(row, row) for k, row in zip(springs, self.openings, strict=True)
        )
        return np.sqrt(eigh(K, self.mass(), eigvals_only=True))

    def thermal_response(self, expansion, frame):
        """Motions (9,) of the points per kelvin: the free plate, and the ground that moves by more
        or less.
        """
        forces = np.zeros(self.unknowns)
        for hinge in self.hinges:
            for body, sign in ((hinge.near, -1), (hinge.far, 1)):
                if body not in BODIES:  # rigid ground, whose end of the hinge moves with the frame
                    moved = (
                        (frame - expansion)
                        * (hinge.centre + sign * hinge.length / 2 * hinge.axis)
                        / hinge.axis
                    )
                    pulled = np.array([moved.real, moved.imag, 0.0]) / hinge.compliance
                    forces -= sign * hinge.motion(BODIES).T @ pulled
        stage = moments(bodies_drawn()["stage"])
        centroid = complex(*stage[1:3]) / stage[0]
        probe = INCH * (0.93 + 0.5j)
        arm = INCH * (0.34 - 0.5j)
        free = [part for z in (centroid, probe, arm) for part in (z.real, z.imag, 0.0)]
        return self.ports[:9] @ self.under(forces) + expansion * np.array(free)

    def weight_response(self, acceleration):
        return self.under(self.mass(halved=True) @ np.tile([*acceleration, 0.0], len(BODIES)))
