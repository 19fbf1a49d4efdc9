"""Stations: the whole push is spread over a link width, section by section, with the stresses of a
beam.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.paper.bodies import centrelines
from flexfem.paper.contacts import (
    SPREAD,
    Station,
    bend_stresses,
    body_forces,
    nearest,
    share_beyond,
    station,
)
from flexfem.paper.stage import Stage, load_stage

GEOMETRY = Path(__file__).parents[2] / "geometry"
GRID = (
    0.05  # of the sums below: cells cross the edges of the strip, which reaches a hundredth beyond
)


def station_at(stage: Stage, link: int, point: complex) -> Station:
    return station(stage, 1, link, nearest(centrelines(stage, 1)[link], point).along)


@pytest.mark.parametrize(("a", "b"), [(1.0, 9.0), (3.7, 5.1)])
def test_stresses_in_a_bend_are_those_of_a_unit_moment_pull_and_shear(a, b):
    nodes, weights = np.polynomial.legendre.leggauss(60)
    r = a + (b - a) * (nodes + 1) / 2
    dr = weights * (b - a) / 2
    moment, pull, shear, _ = bend_stresses(a, b, r)
    resultants = [moment @ dr, moment @ (r * dr), pull @ dr, pull @ (r * dr), shear @ dr]
    np.testing.assert_allclose(resultants, [0, 1, 1, 0, 1], atol=1e-9)
    assert bend_stresses(a, b, np.array([a, b]))[2] == pytest.approx(
        [0, 0], abs=1e-12
    )  # free edges
    thin = bend_stresses(
        1000.0, 1002.0, np.linspace(1000.0, 1002.0, 5)
    )  # as good as straight, 2 mm high
    np.testing.assert_allclose(thin[0], -1.5 * np.linspace(1, -1, 5), atol=5e-3)
    np.testing.assert_allclose(thin[2], 0.75 * (1 - np.linspace(-1, 1, 5) ** 2), atol=2e-3)


@pytest.mark.parametrize(("link", "point"), [(1, 40 - 36.5j), (2, 15 - 20j), (2, 24 - 12j)])
def test_a_station_bears_the_wrench_of_its_push(link, point):
    """On a straight link, in the sharp bend of the other, across the joint of line and arc."""
    stage = load_stage(GEOMETRY / "mobility6.toml")
    of = station_at(stage, link, point)
    low, high = np.array([[-40, -45], [70, 45]])
    step = 0.1
    x, y = (np.arange(a, b, step) + step / 2 for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    near = grid[np.hypot(*(grid - [point.real, point.imag]).T) < 25]
    fx, fy = np.moveaxis(body_forces(of, near), -1, 0) * step**2
    total = np.stack([fx.sum(axis=1), fy.sum(axis=1), fy @ near[:, 0] - fx @ near[:, 1]])
    np.testing.assert_allclose(
        total * np.outer([24, 24, 1], [1 / 24, 1 / 24, 1]), np.eye(3), atol=GRID
    )


def test_a_station_is_as_long_as_links_are_wide_and_stays_on_its_strip():
    stage = load_stage(GEOMETRY / "mobility6.toml")
    length = sum(segment.length for segment in centrelines(stage, 1)[1])  # from 50 to 25.5 mm
    assert length == pytest.approx(24.5)
    for x, middle in ((40.0, 10.0), (49.0, 6.75), (26.0, 24.5 - 6.75)):
        of = station_at(stage, 1, complex(x, -36.5))
        assert (of.middle, of.half) == pytest.approx((middle, 6.75))
    s = np.linspace(of.middle - of.half, of.middle + of.half, 2001)
    weights = of.weight(s) * (s[1] - s[0])
    assert weights.sum() == pytest.approx(1.0)
    deviation = np.sqrt(weights @ (s - of.middle) ** 2)
    assert deviation == pytest.approx(9.0 / np.sqrt(12), rel=0.02)  # as of an even spread over 9 mm
    np.testing.assert_allclose(share_beyond(of, s), 1 - np.cumsum(weights) + weights / 2, atol=1e-6)
    np.testing.assert_allclose(
        share_beyond(of, np.array([0.0, of.middle, 99.0])), [1, 0.5, 0], atol=1e-12
    )
    assert pytest.approx(0.75) == SPREAD
