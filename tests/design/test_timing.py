"""The remaining time of a design."""

from __future__ import annotations

import pytest

from flexfem.design import timing
from flexfem.design.timing import CHECK, SEARCH, Timing


@pytest.fixture
def clock(monkeypatch):
    """A clock that a test sets."""
    now = [100.0]
    monkeypatch.setattr(timing.time, "monotonic", lambda: now[0])
    return now


def test_the_remaining_time_follows_from_the_parts_that_are_done(clock):
    of = Timing()
    assert of.text() == "" and of.left is None
    of.starts(SEARCH, share=lambda: 0.25)
    clock[0] += 3  # of 12 s
    assert of.left is None  # nothing is known of finite elements
    of.starts(CHECK, assumed=40.0)  # the search took 3 s after all
    clock[0] += 12
    assert of.left == pytest.approx(28 + 3 + 40)
    assert of.text() == "; about 70 s left"
    clock[0] += 8
    of.starts(SEARCH)  # finite elements took 20 s
    clock[0] += 1
    assert of.left == pytest.approx(2 + 20)
    of.starts(CHECK)
    clock[0] += 25  # longer than the first ones
    assert of.left == pytest.approx(0)
    of.starts(SEARCH)  # a third round
    assert of.left == pytest.approx(1 + 25)
    of.ends()
    assert of.left is None and of.text() == ""


def test_a_share_that_is_too_large_leaves_no_negative_time(clock):
    of = Timing()
    of.starts(SEARCH, share=lambda: 1.7)
    clock[0] += 300
    of.starts(CHECK, assumed=100.0)
    of.starts(SEARCH, share=lambda: 1.7)
    clock[0] += 1000
    assert of.left == pytest.approx(0)
