"""Shapes of hinge profiles.

A profile lies between x = -length / 2 and length / 2, mm, on its axis, the local x axis. Left and
right are seen along the axis: the left edge is the upper one. A profile with one `side` is notched
on this side alone; the other edge is straight, at half a neck from the axis. A new shape is one
subclass of `Profile` with an entry in `SHAPES`: half its notched edge as curves, the radius of this
edge at the neck, and its height where a curve is of the kind `Bezier`.

Dimensions are numbers, or arrays (n, 1) of n designs with one side and the same corners. Heights,
positions, concentrations and compliances then have a leading axis of designs; curves and triangle
sizes are for numbers alone. Arrays are not checked: `impossible` says which designs no profile can
have.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.edges import Bezier, Curve, Ellipse, backwards, mapped, mirror_image
from flexfem.mechanism.outlines import SHORTEST, Segment, polyline
from flexfem.mechanism.profile import STUBBY, Profile, Refinement
from flexfem.mechanism.profile_shape import (
    CORNERS,
    FILE_KEYS,
    FIRST,
    LEFT,
    RIGHT,
    SECOND,
    BadDimension,
    is_one,
)
from flexfem.mechanism.stress_concentration import Concentration, shoulder
from flexfem.mechanism.tabulated import Tabulated

# triangle size on a fillet, per radius and resolution; with 2, gmsh divided it alike on coarse
# meshes
ARC = 1.0


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
    body.
    """

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

    def _filleted(
        self,
        end: str,
        side: str,
    ) -> bool:
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

    def _rise(
        self,
        x: Array,
        side: str,
    ) -> Array:
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
        return self._edge(LEFT), mirror_image(self._edge(RIGHT))

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

    def concentration(
        self,
        x: Array,
        edge: float,
    ) -> Concentration:
        """Return the concentration (n,) at fillets, `shoulder`.

        It is one at straight parts and edges and at sharp roots.
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
    """Return the profile of a shape with dimensions by key, mm and rad.

    Raises BadDimension, with the key.

    The keys are radius and neck of a circular hinge; length, depth and neck of an elliptical or
    parabolic one; length, neck and perhaps fillet and flush corners of a leaf, which is the
    filleted one; angle, root_radius, depth and neck of a v; table, rows of position and height or
    of position, left and right edge, and perhaps smooth of a profile; perhaps side, "left" or
    "right", of any but a profile.
    """
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
