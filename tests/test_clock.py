"""Time limits count work, not stops."""

from __future__ import annotations

from flexfem import clock


def test_a_stop_counts_as_one_step_and_the_time_between_looks_in_full(monkeypatch):
    times = iter([10.0, 10.25, 97.25, 98.0])  # the process was stopped for 86 s
    monkeypatch.setattr(clock.time, "monotonic", lambda: next(times))
    watch = clock.Stopwatch()
    assert [watch.step() for _ in range(3)] == [0.25, 1.0, 0.75]
