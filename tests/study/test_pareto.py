"""The designs that no other beats."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from flexfem.study.fronts import drawable_front, non_dominated, spread

SIDES = st.tuples(st.booleans(), st.booleans())
POINTS = hnp.arrays(
    float, st.tuples(st.integers(1, 40), st.just(2)), elements=st.integers(-6, 6).map(float)
)  # whole numbers: many ties


def beats(one: np.ndarray, other: np.ndarray, larger: tuple[bool, bool]) -> np.ndarray:
    """Whether designs are no worse in both values and better in one: the definition, slowly."""
    gain = np.where(larger, 1.0, -1.0) * (one - other)
    return (gain >= 0).all(axis=-1) & (gain > 0).any(axis=-1)


@given(points=POINTS, larger=SIDES)
def test_the_front_is_what_no_design_beats_from_the_best_in_x_to_the_best_in_y(
    points: np.ndarray, larger: tuple[bool, bool]
) -> None:
    front = non_dominated(points, larger)
    beaten = beats(points[:, None], points[None], larger).any(axis=0)
    assert sorted(front) == list(np.flatnonzero(~beaten))
    found = np.where(larger, 1.0, -1.0) * points[front]
    assert (np.diff(found[:, 0]) <= 0).all() and (np.diff(found[:, 1]) >= 0).all()


def test_the_front_of_a_million_designs_is_found_among_them() -> None:
    """All pairs of them would not fit in any memory."""
    rng = np.random.default_rng(2)
    x = rng.uniform(size=1_000_000)
    y = 1.0 - x - rng.uniform(1e-9, 1.0, size=len(x))
    best = np.sort(rng.choice(len(x), 50, replace=False))
    y[best] = 1.0 - x[best]
    assert set(best) <= set(non_dominated(np.column_stack([x, y])))


@given(points=POINTS, larger=SIDES, data=st.data())
def test_what_cannot_be_drawn_makes_room_for_what_is_behind(
    points: np.ndarray, larger: tuple[bool, bool], data: st.DataObject
) -> None:
    possible = np.array(
        data.draw(st.lists(st.booleans(), min_size=len(points), max_size=len(points)))
    )
    places, undrawable, unchecked = drawable_front(
        points,
        larger,
        lambda places: [place if possible[place] else None for place in places],
        1000,
    )
    left = np.flatnonzero(possible)
    assert set(places) == set(left[non_dominated(points[left], larger)])
    assert unchecked == 0 and not possible[undrawable].any()
    for place in undrawable:  # each stood in the way of the front that was found
        assert not beats(points[places], points[place], larger).any()


def test_when_attempts_run_out_the_rest_is_counted_as_unchecked() -> None:
    asked = []
    points = np.arange(10.0)[:, None] * [1, -1]

    def drawn(places: np.ndarray) -> list[int | None]:
        asked.extend(places)
        return [None if place % 2 else place for place in places]

    places, undrawable, unchecked = drawable_front(points, (True, True), drawn, 4)
    assert asked == [9, 8, 7, 6]
    assert list(undrawable) == [7, 9] and list(places) == [8, 6, 5, 4, 3, 2, 1, 0]
    assert unchecked == 6


def test_chosen_designs_lie_equally_far_apart_along_the_front() -> None:
    t = np.linspace(0.0, np.pi / 2, 1001) ** 1.7  # points unevenly along a quarter of a circle
    t *= np.pi / 2 / t[-1]
    places = spread(
        np.column_stack([3e6 * np.cos(t), 2e-3 * np.sin(t)]), 4
    )  # spans count as one, whatever the units
    np.testing.assert_allclose(
        t[places], np.linspace(0, np.pi / 2, 4), atol=2e-3
    )  # the points' own distance
    assert list(spread(np.array([[2.0, 0.0], [1.0, 5.0]]), 4)) == [0, 1]
    assert list(spread(np.array([[2.0, 0.0]]), 4)) == [0]
