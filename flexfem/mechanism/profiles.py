"""Hinge profiles: height, edges as exact curves, beam integrals, surface stress, triangle sizes.

A profile lies between x = -length / 2 and length / 2, mm, on its axis, the local x axis. Left and
right are seen along the axis: the left edge is the upper one. A profile with one `side` is notched
on this side alone; the other edge is straight, at half a neck from the axis. A new shape is one
subclass with an entry in `SHAPES`: half its notched edge as curves, the radius of this edge at the
neck, and its height where a curve is of the kind `Bezier`.

Dimensions are numbers, or arrays (n, 1) of n designs with one side and the same corners. Heights,
positions, concentrations and compliances then have a leading axis of designs; curves and triangle
sizes are for numbers alone. Arrays are not checked: `impossible` says which designs no profile can
have."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.outlines import SHORTEST, Segment, polyline
from flexfem.refused import BadInput

SHEAR_CORRECTION = 1.2  # kappa of the rectangular section
LEFT = "left"
RIGHT = "right"
FIRST = "first"
SECOND = "second"  # ends of a hinge, at its two bodies
CORNERS = tuple(f"{end} {side}" for end in (FIRST, SECOND) for side in (LEFT, RIGHT))
SIDES = (
    -1.0,
    1.0,
)  # left and right edge of a section, of opposite stress; a positive moment pulls the right one
MIDPLANE_SHEAR = 1.5 * math.sqrt(3.0)  # von Mises stress on the axis, per mean shear stress
PLATEAU = (
    0.9  # distance from a neck up to which triangles are smallest, per sqrt(neck * root radius)
)
GENTLE = 0.8  # slope of the height below which it, not the growth of triangles, sets their size
STUBBY = 0.5  # root radius per neck below which the radius sets the triangle size at the root
# triangle size on a fillet, per radius and resolution; with 2, gmsh divided it alike on coarse
# meshes
ARC = 1.0
MOST_DISCS = 32  # of one size in a row along half a profile
CORNER_POWER = 0.4555  # of the distance in the stress at a right-angled inner corner, negative
SHARP_TURN = math.radians(
    3.0
)  # of the edge at an inner corner; the stress there grows by 2 % per halved triangle
GRADED_TURN = math.radians(20.0)  # the same from which triangles are graded towards the corner
# height of an end over that of the neck, below which its corners with the body count as sharp
LOW_END = 2.0
PER_PIECE = (
    9  # positions between two rows at which the curvature of a smooth table sets the triangle size
)
TIGHTEST = 1e-5  # radius of a smooth table, per neck, below which its edge cannot be meshed
# change of the height per length up to which a part of a table is meshed as the middle of a leaf
UNIFORM = 0.1
# rad, between pieces of a smooth edge: OpenCASCADE joins tangent ones, and then misses areas by 1 %
APART = 1e-9
SLIGHTEST = 1e-6  # neck over root radius below which there is no stress concentration
FILE_KEYS = {
    "span": "length",
    "root": "root_radius",
}  # dimensions whose key in a file differs from their name


def _double_exponential(steps: int, end: float) -> tuple[Array, Array]:
    """Positions and weights (2 steps + 1,) on (0, 1) of the rule of Takahasi and Mori (1974).

    Its points crowd at both ends. There heights have vertical tangents, and 1/height^3 has poles
    near a neck."""
    u = end * np.arange(-steps, steps + 1) / steps
    x = 1 / (1 + np.exp(-np.pi * np.sinh(u)))
    return x, np.pi * np.cosh(u) * x * (1 - x) * end / steps


RULE = _double_exponential(64, 3.3)
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(3)
UNIFORM_RULE = ((1 + POINTS) / 2, WEIGHTS / 2)  # exact for the squares of positions
STRESSED = 400  # steps in all between which the largest stress is searched


class BadDimension(BadInput):
    """A dimension that no profile can have: `key` as in a file and what was `expected`."""

    def __init__(self, key: str, expected: str) -> None:
        super().__init__(f"{key}: expected {expected}")
        self.key = key
        self.expected = expected

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.key, self.expected)


class Bezier(NamedTuple):
    """A Bezier curve with complex control points (n,), mm, of which the first and the last one are
    its ends.
    """

    points: tuple[complex, ...]


class Ellipse(NamedTuple):
    """An arc of an ellipse of at most a quarter turn; `major` is the vector of its major half-axis,
    mm.
    """

    start: complex
    end: complex
    centre: complex
    major: complex


Curve = Segment | Bezier | Ellipse
Refinement = tuple[tuple[complex, ...], float, float]


def mapped(curve: Curve, move: Callable[[complex], complex]) -> Curve:
    """Return a curve after a rigid motion or a reflection of its points."""
    if isinstance(curve, Bezier):
        return Bezier(tuple(map(move, curve.points)))
    start = move(curve.start)
    end = move(curve.end)
    if isinstance(curve, Ellipse):
        centre = move(curve.centre)
        return Ellipse(start, end, centre, move(curve.centre + curve.major) - centre)
    return Segment(start, end, None if curve.centre is None else move(curve.centre))


def backwards(curve: Curve) -> Curve:
    """Return the same curve in the opposite direction."""
    if isinstance(curve, Bezier):
        return Bezier(curve.points[::-1])
    return curve._replace(start=curve.end, end=curve.start)


class Concentration(NamedTuple):
    """Stress concentration factors (...), relative to a straight bar as wide as the neck; functions
    of t/R.

    shear : for a transverse force, off the neck centre: surface stress relative to that of the
    bending moment there."""

    bending: Array
    tension: Array
    shear: Array


def concentration(ratio: Array) -> Concentration:
    """Return the stress concentration at a notch of t/R = `ratio` (...).

    The notch is the deep hyperbolic notch of H. Neuber, Kerbspannungslehre, Springer (1937): with
    `a = t/2R`, `4 a sqrt a / (3 (sqrt a + (a - 1) arctan sqrt a))` in bending and `2 (a + 1) sqrt a
    / ((a + 1) arctan sqrt a + sqrt a)` in tension, both recalled, not copied from a print. For
    shear our own algebra, from Kolosov's `phi = i A w`, `z = c sinh w`, gives `2 a sqrt a (a + 1) /
    (3 ((a + 1) arctan sqrt a
    - sqrt a))` in the limit at the centre; a circular notch agrees within 1 % up to 0.6 R from the
      centre. Against
    plane-stress finite elements of whole stages (t/R 0.13 to 0.60) the highest neck stress agrees
    within 1 % when the forces are those of calibrated hinges and elastic links; other forces are
    worse (`warnings.STRESS_ABOVE`). Smith and Chetwynd's `(1 + t/2R)^0.45` is up to 1.4 % and 3.4 %
    too large; no concentration is 6 to 9 % too small."""
    a = 0.5 * ratio
    root = np.sqrt(a)
    angle = np.arctan(root)
    bending = 4.0 * a * root / (3.0 * (root + (a - 1.0) * angle))
    tension = 2.0 * (a + 1.0) * root / ((a + 1.0) * angle + root)
    shear = 2.0 * a * root * (a + 1.0) / (3.0 * ((a + 1.0) * angle - root))
    return Concentration(bending, tension, shear)


def shoulder(ratio: float, one_sided: bool = False) -> tuple[float, float]:
    """Return the stress concentration in tension and bending at the root of a leaf, of neck /
    fillet radius = `ratio`.

    Our own fit of plane-stress finite elements of leaves between bodies at least 5 times as high as
    their ends, within 1.7 % in tension and 0.9 % in bending for ratios of 0.1 to 100. Small fillets
    follow the power of a right-angled corner (M. L. Williams, J. Appl. Mech. 19, 526, 1952), large
    ones deep notches. Peterson's charts of stepped bars (R. L. Norton's fit at D = 3 d) differ by 2
    % in bending; in tension they are up to 12 % higher.

    With a fillet on one side of the leaf, the other being flush with both bodies, the fit is within
    1.4 % in tension for ratios of 5 to 100, where the fillet governs, and within 0.3 % in bending
    for ratios of 0.1 to 100."""
    fits = (
        ((0.3626, 0.5603), (0.5234, 1.0341)) if one_sided else ((0.8446, 1.1349), (0.3352, 0.9479))
    )
    tension, bending = (
        (1 + factor * ratio**power) ** (CORNER_POWER / power) for factor, power in fits
    )
    return tension, bending


@dataclass(frozen=True)
class Profile:
    """A hinge profile; length and smallest height `neck` in mm, and its notched `side`, None for
    both.
    """

    neck: float
    side: str | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.side not in (None, LEFT, RIGHT):
            raise BadDimension("side", f'"{LEFT}" or "{RIGHT}"')
        for each, value in self._numbers():
            if isinstance(value, int | float) and not (
                0 < value < math.inf or value == each.default == 0
            ):
                raise BadDimension(FILE_KEYS.get(each.name, each.name), "a number > 0")

    @property
    def impossible(self) -> AnyArray:
        """Whether no profile can have the dimensions, by number or as an array of designs."""
        found: AnyArray = np.asarray(False)
        for each, value in self._numbers():
            found = found | ~_positive(value, each.default == 0)
        return found

    def _numbers(self) -> Iterator[tuple[Any, Any]]:
        """Yield the fields that are numbers, with their values."""
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, int | float | np.ndarray):
                yield each, value

    def with_neck(self, neck: float) -> Profile:
        """Return the profile with another neck, mm; all heights change by the same amount."""
        return replace(self, neck=neck)

    @property
    def length(self) -> float:
        """Length along the axis, mm."""
        return 2 * _ends(self.half()[-1])[1].real

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions on the axis, mm, ascending from end to end, between which the height is smooth."""
        ends = [_ends(curve)[1].real for curve in self.half()]
        return (*(-x for x in reversed(ends)), 0.0, *ends)

    @property
    def even(self) -> bool:
        """Whether the profile is the same after half a turn."""
        return self.side is None

    @property
    def section(self) -> float:
        """Position, mm, of the section near the middle of the axis that edges of triangles follow."""
        return 0.0

    @property
    def even_section(self) -> bool:
        """Whether triangles along this section are equally large."""
        return True

    @property
    def sharp(self) -> bool:
        """Whether the edge has a sharp inner corner, at which the stress of finite elements is
        singular.
        """
        return False

    @property
    def bare_corners(self) -> tuple[str, ...]:
        """Those of `CORNERS` at which an edge meets its body, or goes on as its side, without a
        fillet.
        """
        return ()

    @property
    def symmetric(self) -> bool:
        """Whether the profile is symmetric about its axis."""
        return self.side is None

    @property
    def mirrored(self) -> Profile:
        """The profile with its left and its right edge exchanged."""
        if self.side is None:
            return self
        return replace(self, side=RIGHT if self.side == LEFT else LEFT)

    @property
    def _notches(self) -> int:
        return 2 if self.side is None else 1

    @property
    def edge_radius(self) -> float:
        """Radius of curvature of a notched edge at the neck, mm."""
        raise NotImplementedError

    @property
    def root_radius(self) -> float:
        """Radius of curvature, mm, of both edges at the neck of a symmetric profile of the same
        height.
        """
        return self.edge_radius * 2 / self._notches

    def height(self, x: Array) -> Array:
        """Height (...), mm, at positions (...) on the axis."""
        x = np.abs(x)
        found = np.asarray(self.neck)
        for curve in self.half():  # the rise from curve to curve keeps all digits of a slender neck
            first, last = _ends(curve)
            rise = _rise(np.clip(x, first.real, last.real) - first.real, curve, last - first)
            found = found + self._notches * rise
        return np.asarray(found)

    def middle(self, x: Array) -> Array:
        """Position (...), mm, of the middle between both edges, to the left of the axis, at
        positions (...) on it.
        """
        if self.side is None:
            return np.zeros(np.shape(x))
        rise = self.height(x) - self.neck
        return np.asarray(rise / 2 if self.side == LEFT else -rise / 2)

    def half(self) -> list[Curve]:
        """Return a notched left edge from 0 to length / 2, as curves that begin at their lowest
        points.
        """
        raise NotImplementedError

    def edges(self) -> tuple[list[Curve], list[Curve]]:
        """Return the left and the right edge from -length / 2 to length / 2, split at 0."""
        half = self.half()
        notched = [
            backwards(mapped(curve, lambda z: -z.conjugate())) for curve in reversed(half)
        ] + half
        if self.side is None:
            return notched, _mirror_image(notched)
        end = self.length / 2
        straight = 0.5j * self.neck
        flat = list[Curve](polyline(straight - end, straight, straight + end))
        if self.side == LEFT:
            return notched, _mirror_image(flat)
        return flat, _mirror_image(notched)

    @property
    def end_height(self) -> float:
        """Larger height at the two ends, mm."""
        return float(np.max(self.height(np.array([-0.5, 0.5]) * self.length)))

    @property
    def least_cut(self) -> float:
        """Height of the lowest box, symmetric about the axis, that contains both ends, mm."""
        ends = np.array([-0.5, 0.5]) * self.length
        return float(np.max(self.height(ends) + 2 * np.abs(self.middle(ends))))

    def compliance(
        self,
        youngs_modulus: float,
        poissons_ratio: float,
        thickness: float,
        thicker: ArrayLike = 0.0,
    ) -> Array:
        """Compliance (..., 3, 3) of the far end relative to the near one, at the centre: axial,
        transverse, rotation.

        thicker : (...), mm, added to all heights, as a thicker neck does.   nan where no height is
        left.

        Notes
        -----
        A Timoshenko beam of the local height: `int dx / (E A)`, `int x^2 / (E I) dx + kappa int dx
        / (G A)` and `int dx / (E I)`. A force at the centre and a moment are uncoupled for a
        profile symmetric about its centre. Where the mid-line is m off the axis, the section
        carries the moment `M - V x + N m`: an axial force bends, and `int m^2 / (E I) dx`, `int m /
        (E I) dx` and `-int x m / (E I) dx` are added."""
        x, weights = self.quadrature
        added = np.asarray(thicker, dtype=float)[..., None]
        height = self.height(x) + np.where(added > -self.neck, added, np.nan)
        axial = np.sum(weights / height, axis=-1)
        cube = height**3
        rotation, moment, bending = (12 * np.sum(weights * x**n / cube, axis=-1) for n in range(3))
        found = np.zeros((*axial.shape, 3, 3))
        found[..., 0, 0] = axial
        found[..., 2, 2] = rotation
        found[..., 1, 1] = bending + SHEAR_CORRECTION * 2 * (1 + poissons_ratio) * axial
        found[..., 1, 2] = found[..., 2, 1] = -moment
        if not self.symmetric:
            middle = self.middle(x)
            found[..., 0, 0] += 12 * np.sum(weights * middle**2 / cube, axis=-1)
            found[..., 0, 1] = found[..., 1, 0] = -12 * np.sum(weights * x * middle / cube, axis=-1)
            found[..., 0, 2] = found[..., 2, 0] = 12 * np.sum(weights * middle / cube, axis=-1)
        return found / (youngs_modulus * thickness)

    def right_half(self) -> Iterator[tuple[Array, Array, Array]]:
        """Yield positions, weights of integrals and heights (..., q) along each curve of `half`.

        They are those of `quadrature` from the centre to the far end, fewer where the height is
        uniform, and without the terms that vanish in a curve.
        """
        height = np.asarray(self.neck)
        for curve in self.half():
            first, last = _ends(curve)
            step = last - first
            is_uniform = isinstance(curve, Segment) and not np.any(step.imag)
            shares, weights = UNIFORM_RULE if is_uniform else RULE
            along = step.real * shares
            if isinstance(curve, Bezier):
                heights = self.height(first.real + along)
            else:
                heights = height + self._notches * _rise(along, curve, step)
            yield first.real + along, step.real * weights, heights
            height = height + self._notches * step.imag

    def opened_before(self, poissons_ratio: float) -> Array:
        """Return the share (n, 3, 3) of an opening of the hinge that arises before each position of
        `quadrature`.

        Under loads on its ends alone, the section there moves by the motion of the near end plus
        this share of the motion of the far end relative to it, as twists at the centre: axial,
        transverse, rotation."""
        x, weights = self.quadrature
        height = self.height(x)
        axial = weights / height
        bending = 12 * weights / height**3
        moment = np.stack(
            [self.middle(x), -x, np.ones_like(x)], axis=-1
        )  # in the section, of unit loads
        parts = (
            moment[:, :, None] * moment[:, None] * bending[:, None, None]
        )  # of the integrals of `compliance`
        parts[:, 0, 0] += axial
        parts[:, 1, 1] += SHEAR_CORRECTION * 2 * (1 + poissons_ratio) * axial
        return np.asarray(
            (np.cumsum(parts, axis=0) - parts / 2) @ np.linalg.inv(np.sum(parts, axis=0))
        )

    @cached_property
    def quadrature(self) -> tuple[Array, Array]:
        """Positions (..., n) on the axis and weights (..., n) of integrals over it."""
        return self._between(*RULE)

    def _between(self, shares: Array, weights: Array) -> tuple[Array, Array]:
        """Return positions (..., n) at shares (q,) between all breaks, and their weights (..., n).

        weights : (q,), for an integral from 0 to 1.
        """
        ends = np.stack(np.broadcast_arrays(*self.breaks))
        ends = ends.reshape(len(ends), *(ends.shape[1:] or (1,)))
        low = ends[:-1]
        step = np.diff(ends, axis=0)
        return _joined(low + step * shares), _joined(step * weights)

    def concentration(self, x: Array, edge: float) -> Concentration:
        """Return the stress concentration at positions x (n,) of an edge of `SIDES`, (n,) or ().

        It is that of Neuber's notch with the root radius, in bending times the factor of the inner
        or outer edge of a bar whose mid-line has a curvature k, `1 +- k t / 3` (E. Winkler, to
        first order)."""
        K = concentration(np.maximum(self.neck / self.root_radius, SLIGHTEST))
        return K._replace(bending=K.bending * (1 - edge * self._middle_curvature * self.neck / 3))

    @property
    def _middle_curvature(self) -> float:
        """Curvature of the mid-line at the neck, 1/mm, positive with the centre to the left."""
        if self.side is None:
            return 0.0
        return (0.5 if self.side == LEFT else -0.5) / self.edge_radius

    def stress(
        self,
        wrench: Array,
        thickness: ArrayLike,
        out_of_plane: float = 0.0,
        across: ArrayLike = 0.0,
    ) -> Array:
        """Largest von Mises stress (...), MPa, of the hinge under wrenches (..., 3) on its far end.

        wrench : axial force, transverse force, N, and counter-clockwise moment, N mm, which act on
        the far end (the
            second body) at the centre of the hinge and in its frame.   thickness : (...), mm.
        out_of_plane : ratio of the stress out of the plane to that along the axis, Poisson's ratio
        in plane strain.
        across : (...), MPa, a further stress out of the plane, such as that of a warm plate in
        plane strain.

        Notes
        -----
        The section at x carries the moment `M - V x`, and `m = M - V x_n` at the neck; where the
        mid-line is off the axis, `M` contains the axial force times this distance. The surface
        stress, in plane stress, is the sum of `N K_t / (b h)` and `6 (m K_b - V (x - x_n) K_s) / (b
        h^2)` with `concentration`; it is nominal at sharp inner corners, such as the roots of a
        leaf without fillets. On the axis, where bending vanishes, the axial stress combines with
        `tau = 1.5 V / (b h)`; this governs in short hinges only. Finite elements agree within 2 %
        in moment and tension (`benchmarks/hinge_shapes.py`); transverse forces give up to 18 % less
        in short notches deeper than long and between flanks at more than 90 degrees. Of notches on
        one side, with necks of up to a fifth of the radius, they give 0.2 % less by a moment, 2 %
        less in tension, and 10 % more by a transverse force at the centre."""
        x = self.sections
        return np.asarray(
            np.max(
                self.section_stress(x, wrench[..., None, :], thickness, out_of_plane, across),
                axis=-1,
            )
        )

    @cached_property
    def sections(self) -> Array:
        """Positions (n,) on the axis between which the largest stress is searched, mm."""
        ends = np.concatenate(np.broadcast_arrays(*map(np.atleast_1d, self.breaks)), axis=-1)
        within = _double_exponential(max(4, STRESSED // len(self.breaks)), 3.0)[0]
        return np.concatenate([ends, self._between(within, within)[0]], axis=-1)

    def section_stress(
        self,
        x: Array,
        wrench: Array,
        thickness: ArrayLike,
        out_of_plane: float | Array = 0.0,
        across: ArrayLike = 0.0,
    ) -> Array:
        """Largest von Mises stress (..., n), MPa, of the sections at x (n,), as `stress`.

        wrench : (..., n, 3) or (..., 1, 3), at the centre of the hinge.   thickness : (...), mm.
        """
        height = self.height(x)
        area = np.asarray(thickness, dtype=float)[..., None] * height
        N, V, M = (wrench[..., k] for k in range(3))
        neck = self.neck_place
        at_middle = M + N * self.middle(x) - V * neck

        def von_mises(along: Array) -> Array:
            z = out_of_plane * along + np.asarray(across)[..., None]
            return np.asarray(np.sqrt(along**2 - along * z + z**2))

        edges = list[Array]()
        for side in SIDES:
            K = self.concentration(x, side)
            bending = 6 * (at_middle * K.bending - V * (x - neck) * K.shear) / height
            edges.append(von_mises((N * K.tension + side * bending) / area))
        axis = np.hypot(von_mises(N / area), MIDPLANE_SHEAR * V / area)
        return np.asarray(np.maximum(axis, np.maximum(*edges)))

    def sizes(self, resolution: float) -> list[Refinement]:
        """Return points (complex, mm), triangle size, mm, there, and distance from the points up to
        which it holds, mm.

        `resolution` quadratic triangles lie across the neck. Their size grows with the height along
        a slender profile, and is smaller at the edge of a neck with a small root radius. Elsewhere
        sizes may grow with the distance."""
        found = self._sizes(resolution)
        if self.symmetric:
            return found
        return [(self._on_middle(points), size, reach) for points, size, reach in found]

    def _on_middle(self, points: Sequence[complex]) -> tuple[complex, ...]:
        """Return points of the symmetric profile of the same height moved to this one."""
        z = np.array(points)
        return tuple((z + 1j * self.middle(z.real)).tolist())

    def _sizes(self, resolution: float) -> list[Refinement]:
        """Return the sizes in the symmetric profile of the same height."""
        place = self.neck_place
        radius = self.edge_radius
        found = self._levels(place, self.root_radius, resolution)
        if STUBBY * radius < self.neck:
            edge = 0.5j * self.neck
            found.append(((place + edge, place - edge), STUBBY * radius / resolution, radius / 2))
        return found

    def _levels(
        self, place: float, radius: float, resolution: float, sides: tuple[int, ...] = (-1, 1)
    ) -> list[Refinement]:
        """Return sizes within growing distances from a notch of a root radius, while its height
        grows slowly.
        """
        half = self.length / 2
        low = self.neck
        reach = min(PLATEAU * math.sqrt(self.neck * radius), half)
        found = list[Refinement]()
        while True:
            found.append(self._along(place, reach, low / resolution))
            low = self._lowest(place, reach, sides)
            following = min(2 * reach, half)
            if self._lowest(place, following, sides) - low >= GENTLE * (following - reach):
                return found
            reach = following

    @property
    def neck_place(self) -> float:
        """Position of the neck, mm."""
        return 0.0

    def _lowest(self, place: float, reach: float, sides: tuple[int, ...]) -> float:
        """Smallest height, mm, at a distance `reach` from `place`."""
        ends = np.clip(place + reach * np.array(sides), -self.length / 2, self.length / 2)
        return float(np.min(self.height(ends)))

    def _along(self, place: float, reach: float, size: float) -> Refinement:
        """Return the size on the axis up to `reach` from `place`: a disc, or a row of discs in a
        slender profile.
        """
        if reach <= self.end_height:
            return (complex(place),), size, reach
        radius = max(0.6 * self._lowest(place, reach, (-1, 1)), reach / MOST_DISCS)
        inside = reach - 0.8 * radius
        x = np.linspace(place - inside, place + inside, max(2, math.ceil(2 * inside / radius) + 1))
        x = x[np.abs(x) < self.length / 2]
        return tuple(map(complex, x.tolist())), size, radius


def is_one(value: Any) -> bool:
    """Whether a dimension is one number, not an array of designs."""
    return np.ndim(value) == 0


def _positive(value: ArrayLike, or_zero: bool) -> AnyArray:
    """Return whether dimensions (...) are finite and positive, or perhaps zero."""
    number = np.asarray(value)
    least = number >= 0 if or_zero else number > 0
    return np.asarray(least & (number < math.inf))


def _joined(pieces: Array) -> Array:
    """Return positions (..., pieces times q) of positions (pieces, ..., q)."""
    return np.moveaxis(pieces, 0, -2).reshape(*pieces.shape[1:-1], -1)


def _mirror_image(edge: Iterable[Curve]) -> list[Curve]:
    """Return an edge on the other side of the axis."""
    return [mapped(curve, lambda z: z.conjugate()) for curve in edge]


def _ends(curve: Curve) -> tuple[complex, complex]:
    return (
        (curve.points[0], curve.points[-1])
        if isinstance(curve, Bezier)
        else (curve.start, curve.end)
    )


def _rise(x: Array, curve: Curve, step: complex) -> Array:
    """Rise (...) of a line, or of an arc from its lowest point, at distances x (...) from its
    start; `step` to its end.

    Without cancellation: `r - sqrt(r^2 - x^2) = x^2 / (r + sqrt(r^2 - x^2))`.
    """
    assert not isinstance(curve, Bezier)
    if curve.centre is None:
        return np.asarray(x * (step.imag / step.real))
    if isinstance(curve, Ellipse):  # scaled to a circle
        return np.asarray(
            step.imag
            * (x / step.real) ** 2
            / (1 + np.sqrt(np.maximum(1 - (x / step.real) ** 2, 0.0)))
        )
    r = abs(curve.start - curve.centre)
    return np.asarray(x**2 / (r + np.sqrt(np.maximum(r**2 - x**2, 0.0))))


@dataclass(frozen=True)
class Circular(Profile):
    """A right circular hinge of notch radius `radius`, mm."""

    radius: float

    @property
    def edge_radius(self) -> float:
        return self.radius

    def half(self) -> list[Curve]:
        centre = 1j * (self.neck / 2 + self.radius)
        r = self.radius
        return [Segment(centre - 1j * r, centre + r, centre)]


@dataclass(frozen=True)
class Spanned(Profile):
    """A profile whose length is a dimension, `span`, mm."""

    span: float

    @property
    def length(self) -> float:
        return self.span


@dataclass(frozen=True)
class Elliptical(Spanned):
    """Two half-ellipse notches of a depth, mm, each."""

    depth: float

    @property
    def edge_radius(self) -> float:
        return self.span**2 / (4 * self.depth)

    def half(self) -> list[Curve]:
        centre = 1j * (self.neck / 2 + self.depth)
        a = self.span / 2
        b = self.depth
        start = centre - 1j * b
        end = centre + a
        if is_one(a - b) and abs(a - b) <= SHORTEST:
            return [Segment(start, end, centre)]
        major: Any = np.where(a > b, a, 1j * b)
        return [Ellipse(start, end, centre, complex(major) if is_one(major) else major)]


@dataclass(frozen=True)
class Leaf(Spanned):
    """A leaf spring of uniform height with fillets of radius `fillet` at its roots, inside its
    length; mm.

    flush : those of `CORNERS` that have no fillet, because the edge goes on as the side of the
    body."""

    fillet: float = 0.0
    flush: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not set(self.flush) <= set(CORNERS) or len(set(self.flush)) < len(self.flush):
            raise BadDimension(
                "flush", f"corners without a fillet, each once: {', '.join(CORNERS)}"
            )
        if is_one(self._fillets_meet) and self._fillets_meet:
            unit = ": is the unit of both right?" if self.fillet > self.span else ""
            raise BadDimension("fillet", f"less than half of length_mm = {self.span:g}{unit}")

    @property
    def _fillets_meet(self) -> AnyArray:
        return np.asarray(2 * self.fillet >= self.span - SHORTEST)

    @property
    def impossible(self) -> AnyArray:
        return super().impossible | self._fillets_meet

    @property
    def _has_fillets(self) -> bool:
        """Whether there are fillets; some designs of an array may not be without them."""
        return bool(np.all(self.fillet > SHORTEST))

    def half(self) -> list[Curve]:
        half = self.span / 2
        r = self.fillet
        y = 0.5j * self.neck
        straight = Segment(y, half - r + y)
        centre = half - r + y + 1j * r
        if not self._has_fillets:
            return [straight]
        return [straight, Segment(centre - 1j * r, centre + r, centre)]

    def _filleted(self, end: str, side: str) -> bool:
        return self._has_fillets and self.side in (None, side) and f"{end} {side}" not in self.flush

    @property
    def bare_corners(self) -> tuple[str, ...]:
        return tuple(corner for corner in CORNERS if not self._filleted(*corner.split()))

    @property
    def symmetric(self) -> bool:
        return all(
            self._filleted(end, LEFT) == self._filleted(end, RIGHT) for end in (FIRST, SECOND)
        )

    @property
    def even(self) -> bool:
        turned = ((FIRST, LEFT), (SECOND, RIGHT)), ((FIRST, RIGHT), (SECOND, LEFT))
        return all(self._filleted(*one) == self._filleted(*other) for one, other in turned)

    @property
    def mirrored(self) -> Leaf:
        other = {LEFT: RIGHT, RIGHT: LEFT}
        corners = (corner.split() for corner in self.flush)
        flush = tuple(f"{end} {other[side]}" for end, side in corners)
        return replace(self, side=self.side and other[self.side], flush=flush)

    def _rise(self, x: Array, side: str) -> Array:
        """Rise (...) of an edge by its fillets at positions x (...), mm."""
        into = np.clip(np.abs(x) - (self.span / 2 - self.fillet), 0.0, self.fillet)
        rise = into
        if np.any(self.fillet):
            rise = into**2 / (self.fillet + np.sqrt(self.fillet**2 - into**2))
        return np.asarray(
            rise * np.where(x < 0, self._filleted(FIRST, side), self._filleted(SECOND, side))
        )

    def height(self, x: Array) -> Array:
        if not self.flush:
            return super().height(x)
        return np.asarray(self.neck + self._rise(x, LEFT) + self._rise(x, RIGHT))

    def middle(self, x: Array) -> Array:
        if not self.flush:
            return super().middle(x)
        return np.asarray((self._rise(x, LEFT) - self._rise(x, RIGHT)) / 2)

    def edges(self) -> tuple[list[Curve], list[Curve]]:
        if not self.flush:
            return super().edges()
        return self._edge(LEFT), _mirror_image(self._edge(RIGHT))

    def _edge(self, side: str) -> list[Curve]:
        """Return the left edge, or the mirror image of the right one."""
        filleted = self.half()
        straight = list[Curve](polyline(0.5j * self.neck, self.span / 2 + 0.5j * self.neck))
        first, second = (
            filleted if self._filleted(end, side) else straight for end in (FIRST, SECOND)
        )
        return [
            backwards(mapped(curve, lambda z: -z.conjugate())) for curve in reversed(first)
        ] + second

    def concentration(self, x: Array, edge: float) -> Concentration:
        """Return the concentration (n,) at fillets, `shoulder`; one at straight parts and edges and
        at sharp roots.
        """
        side, opposite = (LEFT, RIGHT) if edge < 0 else (RIGHT, LEFT)
        tension, bending = np.ones((2, *np.shape(x)))
        for end, outwards in ((FIRST, -1), (SECOND, 1)):
            if self._filleted(end, side):
                in_fillet = outwards * x >= self.span / 2 - self.fillet - SHORTEST
                factors = shoulder(self.neck / self.fillet, not self._filleted(end, opposite))
                tension, bending = (
                    np.where(in_fillet, K, before)
                    for K, before in zip(factors, (tension, bending), strict=True)
                )
        return Concentration(bending, tension, bending)

    def _sizes(self, resolution: float) -> list[Refinement]:
        """Return sizes as `Profile`: a quarter of the triangles across the middle part, and graded
        at sharp roots.
        """
        t = self.neck
        r = self.fillet
        half = self.span / 2
        found = [self._along(0.0, half - r, t / max(1.0, resolution / 4))]
        if r <= SHORTEST:
            corners = _quadruple(half + 0.5j * t)
            found.append(((complex(-half), complex(half)), t / resolution, t))
            return found + [(corners, t / resolution / 2**k, t / 2 ** (k + 1)) for k in (1, 2, 3)]
        lower = 1 if self.height(np.array(half)) <= self.height(np.array(-half)) else -1
        for points, size, reach in self._levels(lower * (half - r), r, resolution, (lower,)):
            found.append(((*points, *(-z for z in points)), size, max(reach, t)))
        if STUBBY * r < t:
            rise = r * (1 - math.sqrt(0.5))
            arcs = _quadruple(half - rise + 1j * (t + self._notches * rise) / 2)
            if self.flush:
                arcs = tuple(
                    complex(z.real, np.sign(z.imag) * self.height(np.array(z.real)) / 2)
                    for z in arcs
                )
            found.append((arcs, min(t, ARC * r) / resolution, 0.8 * r))
        return found


def _quadruple(z: complex) -> tuple[complex, ...]:
    """Return a point and its mirror images at both axes."""
    return z, z.conjugate(), -z, -z.conjugate()


@dataclass(frozen=True)
class Parabolic(Spanned):
    """Two parabolic notches of a depth, mm, each."""

    depth: float

    @property
    def edge_radius(self) -> float:
        return self.span**2 / (8 * self.depth)

    def height(self, x: Array) -> Array:
        return np.asarray(self.neck + self._notches * self.depth * (x / (self.span / 2)) ** 2)

    def half(self) -> list[Curve]:
        lowest = 0.5j * self.neck
        half = self.span / 2
        return [Bezier((lowest, lowest + half / 2, lowest + half + 1j * self.depth))]


@dataclass(frozen=True)
class Vee(Profile):
    """Two V notches of a depth, mm, each, with flanks at an opening `angle`, rad, and a rounded
    root, mm.
    """

    angle: float
    root: float
    depth: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if is_one(self.angle) and self.angle >= np.pi:
            raise BadDimension("angle", "less than 180 degrees")
        if is_one(self._all_rounded) and self._all_rounded:
            raise BadDimension(
                "depth", "more than the rounding removes, root_radius (1 - sin(angle / 2))"
            )

    @property
    def _all_rounded(self) -> AnyArray:
        """Whether the rounding of the root takes the whole depth."""
        return np.asarray(self.depth <= self.root * (1 - np.sin(self.angle / 2)))

    @property
    def impossible(self) -> AnyArray:
        return super().impossible | (self.angle >= np.pi) | self._all_rounded

    @property
    def _tangent(self) -> complex:
        """Point where the rounded root goes over into the flank, from the lowest point of the
        notch, mm.
        """
        steep = self.angle / 2
        if is_one(steep):
            return self.root * complex(math.cos(steep), 1 - math.sin(steep))
        return self.root * (np.cos(steep) + 1j * (1 - np.sin(steep)))  # type: ignore[no-any-return]

    @property
    def edge_radius(self) -> float:
        return self.root

    def half(self) -> list[Curve]:
        lowest = 0.5j * self.neck
        flank = self.depth - self._tangent.imag
        tangent = lowest + self._tangent
        slope = math.tan(self.angle / 2) if is_one(self.angle) else np.tan(self.angle / 2)
        end = tangent + flank * slope + 1j * flank
        return [Segment(lowest, tangent, lowest + 1j * self.root), Segment(tangent, end)]


@dataclass(frozen=True)
class Tabulated(Profile):
    """A profile through rows of position and height, or of position, left and right edge, mm.

    Positions are taken from the middle of the table. The edges are distances from the axis, to the
    left and to the right. Straight lines join the rows. With `smooth` height and mid-line are
    monotone cubics of F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5, 300 (1984), instead,
    so that no height lies outside those of the rows beside it."""

    neck: float = field(init=False)
    side: None = field(default=None, init=False)
    table: tuple[tuple[float, ...], ...]
    smooth: bool = False

    def __post_init__(self) -> None:
        widths = {len(row) for row in self.table}
        if len(self.table) < 3 or widths not in ({2}, {3}) or not np.all(np.isfinite(self.table)):
            expected = (
                "at least 3 rows, all of a position and a height or all of a position, left and "
                "right edge"
            )
            raise BadDimension("table", expected)
        rows = np.array(self.table, dtype=float)
        heights = rows[:, 1:].sum(axis=1)
        low = np.flatnonzero(heights <= 0)
        if len(low):
            raise BadDimension("table", f"heights > 0, unlike that of row {low[0] + 1}")
        back = np.flatnonzero(np.diff(rows[:, 0]) <= SHORTEST)
        if len(back):
            pair = f"rows {back[0] + 1} and {back[0] + 2}"
            raise BadDimension(
                "table",
                f"ascending positions, unlike those of {pair}; draw a step as a steep flank",
            )
        object.__setattr__(self, "neck", float(heights.min()))
        if self.smooth:
            places, radius = self._curvature
            tightest = int(np.argmin(radius))
            if radius[tightest] < TIGHTEST * self.neck:
                k = int(np.searchsorted(self._rows[0], places[tightest]))
                found = f"between rows {k} and {k + 1} its radius is {radius[tightest]:.1g} mm"
                raise BadDimension(
                    "table", f"rows apart enough for a smooth curve: {found}; lines need no radius"
                )

    def with_neck(self, neck: float) -> Tabulated:
        added = (neck - self.neck) / (len(self.table[0]) - 1)
        return replace(
            self, table=tuple((x, *(edge + added for edge in edges)) for x, *edges in self.table)
        )

    @classmethod
    def of(cls, height: Callable[[Array], Array], length: float, rows: int = 129) -> Tabulated:
        """Return the smooth profile of a height (n,) that is a function of the position (n,) on the
        axis.
        """
        x = np.linspace(-length / 2, length / 2, rows)
        return cls(tuple(zip(x.tolist(), np.asarray(height(x)).tolist(), strict=True)), smooth=True)

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        """Positions from the middle and heights (n,), mm."""
        x, *edges = np.array(self.table, dtype=float).T
        return x - (x[0] + x[-1]) / 2, np.sum(edges, axis=0)

    @cached_property
    def _middles(self) -> Array:
        """Middle (n,) between both edges at every row, mm to the left of the axis."""
        edges = np.array(self.table, dtype=float)[:, 1:]
        return np.asarray((edges[:, 0] - edges[:, -1]) / 2)

    @property
    def symmetric(self) -> bool:
        return not np.any(self._middles)

    @property
    def mirrored(self) -> Tabulated:
        if self.symmetric:
            return self
        return replace(self, table=tuple((x, right, left) for x, left, right in self.table))

    @cached_property
    def _curve(self) -> Any:
        """Height (...) at positions (...) of a smooth profile, as an interpolator of scipy."""
        return self._smooth_curve(self._rows[1])

    @cached_property
    def _middle_curve(self) -> Any:
        """Mid-line (...) at positions (...) of a smooth profile, as an interpolator of scipy."""
        return self._smooth_curve(self._middles)

    def _smooth_curve(self, values: Array) -> Any:
        from scipy.interpolate import (
            PchipInterpolator,
        )  # takes a fifth of a second to import, for tables alone

        return PchipInterpolator(self._rows[0], values)

    @property
    def length(self) -> float:
        return float(self.table[-1][0] - self.table[0][0])

    @property
    def breaks(self) -> tuple[float, ...]:
        x = self._rows[0]
        return tuple(np.concatenate([x[x < -SHORTEST], [0.0], x[x > SHORTEST]]).tolist())

    @property
    def even(self) -> bool:
        odd = all(np.allclose(each, -each[::-1]) for each in (self._rows[0], self._middles))
        return odd and np.allclose(self._rows[1], self._rows[1][::-1])

    @property
    def section(self) -> float:
        """As of any profile; at a row instead of so near to it that triangles between them would be
        needles.
        """
        x = self._rows[0]
        after = int(np.searchsorted(x, 0.0))
        nearest = float(min(x[after - 1], x[after], key=abs))
        return nearest if abs(nearest) < (x[after] - x[after - 1]) / 4 else 0.0

    @property
    def even_section(self) -> bool:
        """As of any profile; at a row triangles may have to be smaller at the edge."""
        return float(np.min(np.abs(self._rows[0] - self.section))) > SHORTEST

    @property
    def neck_place(self) -> float:
        x, h = self._rows
        return float(x[np.argmin(h)])

    @property
    def root_radius(self) -> float:
        """Radius of the parabola through the lowest row and those beside it, mm; infinite at an end
        or in a flat.

        It is infinite between straight lines too: the stress of the beam at a corner is nominal.
        """
        x, h = self._rows
        k = int(np.argmin(h))
        if not self.smooth or k in (0, len(h) - 1):
            return math.inf
        slope = np.diff(h[k - 1 : k + 2]) / np.diff(x[k - 1 : k + 2])
        return (
            float((x[k + 1] - x[k - 1]) / (slope[1] - slope[0]))
            if slope[1] > slope[0]
            else math.inf
        )

    @property
    def _middle_curvature(self) -> float:
        """As of any profile, of the parabola through the rows of the neck; zero where the root
        radius is infinite.
        """
        if not math.isfinite(self.root_radius):
            return 0.0
        x = self._rows[0]
        k = int(np.argmin(self._rows[1]))
        slope = np.diff(self._middles[k - 1 : k + 2]) / np.diff(x[k - 1 : k + 2])
        return float(2 * (slope[1] - slope[0]) / (x[k + 1] - x[k - 1]))

    def height(self, x: Array) -> Array:
        if self.smooth:
            return np.asarray(self._curve(np.clip(x, *self._rows[0][[0, -1]])))
        return np.asarray(np.interp(x, *self._rows))

    def middle(self, x: Array) -> Array:
        if self.symmetric:
            return np.zeros(np.shape(x))
        places = self._rows[0]
        if self.smooth:
            return np.asarray(self._middle_curve(np.clip(x, *places[[0, -1]])))
        return np.asarray(np.interp(x, places, self._middles))

    def edges(self) -> tuple[list[Curve], list[Curve]]:
        left = self._edge(1)
        return left, _mirror_image(left if self.symmetric else self._edge(-1))

    def _edge(self, side: int) -> list[Curve]:
        """Return the left edge (`side` = 1), or the mirror image of the right one (-1)."""
        x, h = self._rows
        points = (x + 1j * (h / 2 + side * self._middles)).tolist()
        if not self.smooth:
            return list[Curve](polyline(*points))
        slopes = (1 + 1j * (self._curve(x, 1) / 2 + side * self._middle_curve(x, 1))).tolist()
        pieces = list[Curve]()
        for k, third in enumerate((np.diff(x) / 3).tolist()):
            leaving = points[k] + third * slopes[k] * cmath.exp(1j * APART)
            arriving = points[k + 1] - third * slopes[k + 1]
            pieces.append(Bezier((points[k], leaving, arriving, points[k + 1])))
        return pieces

    @cached_property
    def _turns(self) -> Array:
        """Larger turn (n,), rad, of both edges at rows, positive at inner corners; at the ends, to
        an upright side.

        The corner at an end counts only where the end is not much higher than the neck.
        """
        x, h = self._rows
        return np.maximum(
            *(self._edge_turns(x, h, h / 2 + side * self._middles) for side in (1, -1))
        )

    def _edge_turns(self, x: Array, h: Array, edge: Array) -> Array:
        """Turns (n,) of one edge, whose distances from the axis are `edge` (n,)."""
        angle = np.arctan(np.diff(edge) / np.diff(x))
        inside = np.zeros(len(x) - 2) if self.smooth else np.diff(angle)
        ends = np.pi / 2 - np.array([-angle[0], angle[-1]])
        first, last = np.where(h[[0, -1]] < LOW_END * self.neck, ends, 0.0)
        return np.array([first, *inside, last])

    @property
    def sharp(self) -> bool:
        return bool(np.any(self._turns > SHARP_TURN))

    def _sizes(self, resolution: float) -> list[Refinement]:
        """Return sizes that follow the height and the edge, a quarter of the triangles across
        uniform parts.

        They are graded at sharp inner corners, and small where rows lie close together or the edge
        is tightly curved."""
        found: dict[tuple[float, float], list[complex]] = {}

        def refine(points: Iterable[complex], size: float, reach: float) -> None:
            found.setdefault((size, reach), []).extend(points)

        x, h = self._rows
        for at, high, coarser in self._stations(max(1.0, resolution / 4)):
            refine([complex(at)], coarser * high / resolution, high)
        for place, height, turn in zip(x.tolist(), h.tolist(), self._turns.tolist(), strict=True):
            if turn > GRADED_TURN:
                corners = [complex(place, height / 2), complex(place, -height / 2)]
                for k in (1, 2, 3):
                    refine(corners, height / resolution / 2**k, height / 2 ** (k + 1))
        for place, height, length in self._details():
            if length < height / resolution:
                size = self._rounded(length)
                refine([complex(place, height / 2), complex(place, -height / 2)], size, size)
        return [(tuple(points), size, reach) for (size, reach), points in found.items()]

    def _stations(self, coarser: float) -> Iterator[tuple[float, float, float]]:
        """Yield positions on the axis, the heights there, and factors of the triangle size,
        `coarser` or one.
        """
        x, h = self._rows
        for (start, end), (low, high) in zip(
            pairwise(x.tolist()), pairwise(h.tolist()), strict=True
        ):
            uniform = abs(high - low) <= UNIFORM * (end - start)
            way = 1 if low <= high else -1
            at = start if way == 1 else end
            while start <= at <= end:
                here = float(self.height(np.array(at)))
                inside = min(at - start, end - at) > max(low, high)
                yield at, self._rounded(here), coarser if uniform and inside else 1.0
                at += way * here / 2
        yield float(x[-1]), self._rounded(float(h[-1])), 1.0

    def _details(self) -> Iterator[tuple[float, float, float]]:
        """Yield positions, the heights there, and the triangle size, mm, that the edge needs there."""
        x, h = self._rows
        left, right = (np.abs(np.diff(x + 1j * (h / 2 + side * self._middles))) for side in (1, -1))
        steps = 2 * np.minimum(left, right)
        near = np.minimum(np.append(steps, np.inf), np.insert(steps, 0, np.inf))
        yield from zip(x.tolist(), h.tolist(), near.tolist(), strict=True)
        if self.smooth:
            places, radius = self._curvature
            sizes = np.minimum(radius, np.tile(steps / 2, PER_PIECE)) / 2
            yield from zip(
                places.tolist(), self.height(places).tolist(), sizes.tolist(), strict=True
            )

    @cached_property
    def _curvature(self) -> tuple[Array, Array]:
        """Positions (n,) between the rows, and radii (n,), mm, of the more curved smooth edge
        there.
        """
        x = self._rows[0]
        share = np.linspace(SHORTEST, 1 - SHORTEST, PER_PIECE)[:, None]
        places = np.ravel(x[:-1] + share * np.diff(x))
        radii = list[Array]()
        for side in (1, -1):
            slope = self._curve(places, 1) / 2 + side * self._middle_curve(places, 1)
            bend = np.abs(self._curve(places, 2) / 2 + side * self._middle_curve(places, 2))
            radii.append((1 + slope**2) ** 1.5 / np.maximum(bend, SHORTEST))
        return places, np.minimum(*radii)

    def _rounded(self, length: float) -> float:
        """Round a length, mm, down to one of few, so that many places share a triangle size."""
        return float(self.neck * 2 ** (math.floor(2 * math.log2(length / self.neck)) / 2))


SHAPES: dict[str, type[Profile]] = {
    "circular": Circular,
    "elliptical": Elliptical,
    "filleted": Leaf,
    "leaf": Leaf,
    "parabolic": Parabolic,
    "v": Vee,
    "profile": Tabulated,
}


def profile_of(shape: str, dimensions: Mapping[str, Any]) -> Profile:
    """Return the profile of a shape with dimensions by key, mm and rad. Raises BadDimension, with
    the key.

    The keys are radius and neck of a circular hinge; length, depth and neck of an elliptical or
    parabolic one; length, neck and perhaps fillet and flush corners of a leaf, which is the
    filleted one; angle, root_radius, depth and neck of a v; table, rows of position and height or
    of position, left and right edge, and perhaps smooth of a profile; perhaps side, "left" or
    "right", of any but a profile."""
    if shape not in SHAPES:
        raise BadDimension("shape", f"one of {', '.join(SHAPES)}")
    known = {
        FILE_KEYS.get(each.name, each.name): each for each in fields(SHAPES[shape]) if each.init
    }
    for key in dimensions.keys() - known.keys():
        raise BadDimension(
            key, f"no such dimension of shape {shape!r}, which has {', '.join(known)}"
        )
    for key, each in known.items():
        if each.default is MISSING and key not in dimensions:
            raise BadDimension(key, f"this dimension of shape {shape!r}")
    values = {known[key].name: value for key, value in dimensions.items()}
    if "flush" in values:
        values["flush"] = tuple(values["flush"])
    if "table" in values:
        values["table"] = tuple(tuple(map(float, row)) for row in values["table"])
    return SHAPES[shape](**values)
