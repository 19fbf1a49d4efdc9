"""The shape of a hinge profile: its dimensions, its height and mid-line, and its two edges."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.edges import Curve, backwards, ends_of, mapped, mirror_image, rise_of
from flexfem.mechanism.outlines import polyline
from flexfem.refused import BadInput

LEFT = "left"
RIGHT = "right"
FIRST = "first"  # end of a hinge at its first body
SECOND = "second"
CORNERS = tuple(f"{end} {side}" for end in (FIRST, SECOND) for side in (LEFT, RIGHT))
# dimensions whose key in a file differs from their name
FILE_KEYS = {"span": "length", "root": "root_radius"}


class BadDimension(BadInput):
    """A dimension that no profile can have: `key` as in a file and what was `expected`."""

    def __init__(
        self,
        key: str,
        expected: str,
    ) -> None:
        super().__init__(f"{key}: expected {expected}")
        self.key = key
        self.expected = expected

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.key, self.expected)


@dataclass(frozen=True)
class ProfileShape:
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

    def with_neck(self, neck: float) -> Self:
        """Return the profile with another neck, mm; all heights change by the same amount."""
        return replace(self, neck=neck)

    @property
    def length(self) -> float:
        """Length along the axis, mm."""
        return 2 * ends_of(self.half()[-1])[1].real

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions on the axis, mm, ascending from end to end, between which the height is smooth."""
        ends = [ends_of(curve)[1].real for curve in self.half()]
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
    def mirrored(self) -> Self:
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
            first, last = ends_of(curve)
            rise = rise_of(np.clip(x, first.real, last.real) - first.real, curve, last - first)
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
            return notched, mirror_image(notched)
        end = self.length / 2
        straight = 0.5j * self.neck
        flat = list[Curve](polyline(straight - end, straight, straight + end))
        if self.side == LEFT:
            return notched, mirror_image(flat)
        return flat, mirror_image(notched)

    @property
    def end_height(self) -> float:
        """Larger height at the two ends, mm."""
        return float(np.max(self.height(np.array([-0.5, 0.5]) * self.length)))

    @property
    def least_cut(self) -> float:
        """Height of the lowest box, symmetric about the axis, that contains both ends, mm."""
        ends = np.array([-0.5, 0.5]) * self.length
        return float(np.max(self.height(ends) + 2 * np.abs(self.middle(ends))))

    @property
    def neck_place(self) -> float:
        """Position of the neck, mm."""
        return 0.0


def is_one(value: Any) -> bool:
    """Whether a dimension is one number, not an array of designs."""
    return np.ndim(value) == 0


def _positive(value: ArrayLike, or_zero: bool) -> AnyArray:
    """Return whether dimensions (...) are finite and positive, or perhaps zero."""
    number = np.asarray(value)
    least = number >= 0 if or_zero else number > 0
    return np.asarray(least & (number < math.inf))
