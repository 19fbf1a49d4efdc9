"""A link's strip: tangent everywhere, equally wide everywhere, and no longer than it must be."""

from __future__ import annotations

import cmath
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import brentq

from flexfem.mechanism.outlines import TIGHTEST_TURN, Pose, Segment, shortest_path

ROUND_OFF = (
    1e-9  # mm or rad; a common tangent amplifies roundings by length over the smallest piece
)
RADIUS = 5.6


def random_poses(count: int) -> list[tuple[Pose, Pose]]:
    """Pairs of poses roughly like two hinges of a link, in any direction."""
    rng = np.random.default_rng(29)
    pairs = []
    for _ in range(count):
        ahead = rng.uniform(-np.pi, np.pi)
        turn = rng.uniform(-2.4, 2.4, 2)
        reach = rng.uniform(8.0, 40.0) * cmath.exp(1j * ahead)
        origin = complex(*rng.uniform(-20.0, 20.0, 2))
        pairs.append((Pose(origin, ahead + turn[0]), Pose(origin + reach, ahead + turn[1])))
    return pairs


PAIRS = random_poses(60)
FOUND = [(a, b, path) for a, b in PAIRS if (path := shortest_path(a, b, RADIUS)) is not None]


def heading_at(segment: Segment, place: complex) -> complex:
    """Unit vector along a segment at one of its ends, which is where its shares of the length say."""
    along = segment.end - segment.start
    if segment.centre is not None:
        along = 1j * np.sign(segment.turn) * (place - segment.centre)
    end = 0.0 if place == segment.start else 1.0
    assert abs(segment.at(end) - place) + abs(segment.tangent(end) - along / abs(along)) < ROUND_OFF
    return along / abs(along)


def shortest_length(start: Pose, end: Pose) -> float | None:
    """Reference: search the angle of the first arc for straight pieces that hit the last arc, for
    all four sides.
    """
    lengths = []
    for first, last in product((1, -1), repeat=2):

        def after(alpha: float, first: int = first, last: int = last) -> tuple[complex, float]:
            """End of the straight piece seen from its start, and the angle of the last arc."""
            h0 = start.heading
            h = start.heading + first * alpha
            leave = start.point + first * RADIUS * 1j * (cmath.exp(1j * h0) - cmath.exp(1j * h))
            arrive = end.point + last * RADIUS * 1j * (
                cmath.exp(1j * end.heading) - cmath.exp(1j * h)
            )
            return (arrive - leave) / cmath.exp(1j * h), last * (end.heading - h) % (2 * np.pi)

        grid = np.linspace(0.0, TIGHTEST_TURN, 400)
        for low, high in pairwise(grid):
            if after(low)[0].imag * after(high)[0].imag <= 0:
                alpha = brentq(lambda a, after=after: after(a)[0].imag, low, high, xtol=1e-13)
                straight, beta = after(alpha)
                if straight.real > 0 and beta <= TIGHTEST_TURN:
                    lengths.append(RADIUS * (alpha + beta) + straight.real)
    return min(lengths, default=None)


def test_no_other_arc_line_arc_path_is_shorter() -> None:
    for start, end in PAIRS[:25]:
        path = shortest_path(start, end, RADIUS)
        expected = shortest_length(start, end)
        assert (path is None) == (expected is None), (start, end)
        if path is not None:
            assert sum(segment.length for segment in path) == pytest.approx(
                expected, abs=ROUND_OFF
            ), (start, end)


def test_path_goes_from_pose_to_pose_connected_tangent_and_bends_with_its_radius() -> None:
    assert len(FOUND) > 30
    for start, end, path in FOUND:
        assert (
            abs(path[0].start - start.point) < ROUND_OFF
            and abs(path[-1].end - end.point) < ROUND_OFF
        ), (start, end)
        assert (
            abs(heading_at(path[0], path[0].start) - cmath.exp(1j * start.heading)) < ROUND_OFF
        ), (start, end)
        assert abs(heading_at(path[-1], path[-1].end) - cmath.exp(1j * end.heading)) < ROUND_OFF, (
            start,
            end,
        )
        for one, following in pairwise(path):
            assert abs(one.end - following.start) < ROUND_OFF, (start, end)
            assert (
                abs(heading_at(one, one.end) - heading_at(following, following.start)) < ROUND_OFF
            ), (start, end)
        for arc in (segment for segment in path if segment.centre is not None):
            assert abs(arc.start - arc.centre) == pytest.approx(RADIUS, abs=ROUND_OFF), (start, end)
            assert abs(arc.end - arc.centre) == pytest.approx(RADIUS, abs=ROUND_OFF), (start, end)


@pytest.mark.parametrize(
    "end",
    [Pose(0.5 + 0.0j, np.pi / 2), Pose(-9.0 + 0.0j, 0.0)],
    ids=["side by side", "behind its own start"],
)
def test_no_path_where_every_one_makes_a_loop(end: Pose) -> None:
    assert shortest_path(Pose(0j, 0.0), end, RADIUS) is None
