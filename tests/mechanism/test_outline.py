"""Outlines of lines and arcs against the areas and lengths of textbook shapes."""

from __future__ import annotations

import cmath
from itertools import pairwise

import numpy as np
import pytest

from flexfem.mechanism.bodies import Segment, area, polyline

ROUND_OFF = 1e-12  # relative; sums of a dozen products of numbers near one
PLACE = 3.7 - 11.3j  # shapes away from the origin, so that no term of Green's theorem vanishes by luck


def circle(radius: float, pieces: int = 3, centre: complex = PLACE) -> list[Segment]:
    ends = [centre + radius * cmath.exp(2j * np.pi * k / pieces) for k in range(pieces + 1)]
    return [Segment(a, b, centre) for a, b in pairwise(ends)]


def rounded_rectangle(a: float, b: float, r: float) -> list[Segment]:
    """Sides a, b, the four corners rounded outwards."""
    centres = [PLACE + complex(x, y) for x, y in ((a / 2 - r, b / 2 - r), (r - a / 2, b / 2 - r))]
    centres += [PLACE + complex(x, y) for x, y in ((r - a / 2, r - b / 2), (a / 2 - r, r - b / 2))]
    corners = [Segment(c + r * 1j**k, c + r * 1j ** (k + 1), c) for k, c in enumerate(centres)]
    joined = zip(corners, [*corners[1:], corners[0]], strict=True)
    return [piece for one, following in joined for piece in (one, Segment(one.end, following.start))]


def notched_bar(length: float, radius: float, neck: float) -> list[Segment]:
    """A bar with two facing semicircular notches as deep as it allows, in quarter arcs: all of them clockwise."""
    half = radius + neck / 2
    top, bottom = PLACE + 1j * half, PLACE - 1j * half
    return [
        *polyline(top - radius, top - length / 2, bottom - length / 2, bottom - radius),
        Segment(bottom - radius, bottom + 1j * radius, bottom),
        Segment(bottom + 1j * radius, bottom + radius, bottom),
        *polyline(bottom + radius, bottom + length / 2, top + length / 2, top + radius),
        Segment(top + radius, top - 1j * radius, top),
        Segment(top - 1j * radius, top - radius, top),
    ]


SHAPES = {
    "circle": (circle(2.9), np.pi * 2.9**2, 2 * np.pi * 2.9),
    "rounded rectangle": (
        rounded_rectangle(9.1, 5.3, 1.7),
        9.1 * 5.3 - (4 - np.pi) * 1.7**2,
        2 * (9.1 + 5.3) - (8 - 2 * np.pi) * 1.7,
    ),
    "notched bar": (
        notched_bar(13.0, 3.9, 0.53),
        13.0 * (2 * 3.9 + 0.53) - np.pi * 3.9**2,
        2 * (2 * 3.9 + 0.53) + 2 * (13.0 - 2 * 3.9) + 2 * np.pi * 3.9,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_area_and_perimeter_of_known_shapes(name: str) -> None:
    loop, expected_area, expected_length = SHAPES[name]
    assert area(loop) == pytest.approx(expected_area, rel=1e-11)  # of |PLACE| length products cancel: ten times worse
    assert sum(segment.length for segment in loop) == pytest.approx(expected_length, rel=ROUND_OFF)
