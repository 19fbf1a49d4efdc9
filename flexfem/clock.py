"""Time limits in which stops do not count: of a suspended machine, of a stopped job, or by a clock that was set."""

from __future__ import annotations

import time

STEP = 1.0  # s; a longer gap between two looks is taken for a stop of whoever looks


class Stopwatch:
    """Seconds of the monotonic clock, of every gap between two looks `STEP` at most; look more often than that."""

    def __init__(self) -> None:
        self._seen = time.monotonic()

    def step(self) -> float:
        """Seconds since the look before."""
        before, self._seen = self._seen, time.monotonic()
        return min(self._seen - before, STEP)


class Limit:
    """Seconds that are `left` for work of several pieces, each of which takes off what it has used."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds
