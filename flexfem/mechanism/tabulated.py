"""A hinge profile through the rows of a table."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.edges import Bezier, Curve, mirror_image
from flexfem.mechanism.outlines import SHORTEST, polyline
from flexfem.mechanism.profile import Profile, Refinement
from flexfem.mechanism.profile_shape import BadDimension

# turn of the edge at an inner corner; the stress there grows by 2 % per halved triangle
SHARP_TURN = math.radians(3.0)
GRADED_TURN = math.radians(20.0)  # the same from which triangles are graded towards the corner
# height of an end over that of the neck, below which its corners with the body count as sharp
LOW_END = 2.0
# positions between two rows at which the curvature of a smooth table sets the triangle size
PER_PIECE = 9
TIGHTEST = 1e-5  # radius of a smooth table, per neck, below which its edge cannot be meshed
# change of the height per length up to which a part of a table is meshed as the middle of a leaf
UNIFORM = 0.1
# rad, between pieces of a smooth edge: OpenCASCADE joins tangent ones, and then misses areas by 1 %
APART = 1e-9


@dataclass(frozen=True)
class Tabulated(Profile):
    """A profile through rows of position and height, or of position, left and right edge, mm.

    Positions are taken from the middle of the table. The edges are distances from the axis, to the
    left and to the right. Straight lines join the rows. With `smooth` height and mid-line are
    monotone cubics of F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5, 300 (1984), instead,
    so that no height lies outside those of the rows beside it.
    """

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
    def of(
        cls,
        height: Callable[[Array], Array],
        length: float,
        rows: int = 129,
    ) -> Tabulated:
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
        # takes a fifth of a second to import, for tables alone
        from scipy.interpolate import PchipInterpolator

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
        """Radius of the parabola through the lowest row and those beside it, mm.

        It is infinite at an end or in a flat.

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
        """As of any profile, of the parabola through the rows of the neck.

        It is zero where the root radius is infinite.
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
        return left, mirror_image(left if self.symmetric else self._edge(-1))

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
        """Larger turn (n,), rad, of both edges at rows, positive at inner corners.

        At the ends it is the turn to an upright side.

        The corner at an end counts only where the end is not much higher than the neck.
        """
        x, h = self._rows
        return np.maximum(
            *(self._edge_turns(x, h, h / 2 + side * self._middles) for side in (1, -1))
        )

    def _edge_turns(
        self,
        x: Array,
        h: Array,
        edge: Array,
    ) -> Array:
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
        is tightly curved.
        """
        found: dict[tuple[float, float], list[complex]] = {}

        def refine(
            points: Iterable[complex],
            size: float,
            reach: float,
        ) -> None:
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
