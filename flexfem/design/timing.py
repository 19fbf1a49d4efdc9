"""How long a design will still take, from the times of its parts that are done."""

from __future__ import annotations

import time
from collections.abc import Callable

SEARCH = "search"
CHECK = "check by finite elements"
USUAL_ROUNDS = 2  # of search and finite elements: the second one confirms the first
SILENT = 10.0  # s, before which nothing is said
LEAST_SHARE = 0.02  # of a part, from which its time follows


class Timing:
    """Times of the rounds of a design, each a search and then finite elements.

    The time of a part that was not done yet follows from the share of it that is done, or is
    assumed.
    """

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._since = self._began
        self._part = ""
        self._rounds = 0
        self._share: Callable[[], float] = lambda: 0.0
        self._times = dict[str, float]()

    def starts(
        self,
        part: str,
        assumed: float | None = None,
        share: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Note that a part of a round starts, and that the part before has ended.

        part : `SEARCH` or `CHECK`.   assumed : s, its time until it was done once.
        share : function that returns the share of the part that is done, perhaps too large.
        """
        now = time.monotonic()
        if self._part:
            self._times[self._part] = now - self._since
        if part == SEARCH:
            self._rounds += 1
        if assumed is not None:
            self._times.setdefault(part, assumed)
        self._since = now
        self._part = part
        self._share = share

    def ends(self) -> None:
        """Note that all rounds are done; what follows has no known time."""
        self._part = ""

    @property
    def left(self) -> float | None:
        """The remaining time of the rounds, s; None while nothing is known of it, or after them."""
        if not self._part:
            return None
        elapsed = time.monotonic() - self._since
        times = dict(self._times)
        share = min(self._share(), 1.0)
        if self._part not in times and share >= LEAST_SHARE:
            times[self._part] = elapsed / share
        if not {SEARCH, CHECK} <= times.keys():
            return None
        rest = max(times[self._part] - elapsed, 0.0)
        if self._part == SEARCH:
            rest += times[CHECK]
        rounds = max(USUAL_ROUNDS - self._rounds, 0)
        return rest + rounds * (times[SEARCH] + times[CHECK])

    def text(self) -> str:
        """The remaining time as text, such as "; about 20 s left", "" in the first seconds."""
        if time.monotonic() - self._began < SILENT:
            return ""
        left = self.left
        return "" if left is None else f"; about {_rounded(left)} left"


def _rounded(seconds: float) -> str:
    """Return a time as text, no more exact than it is known."""
    if seconds < 100:
        return f"{max(5 * round(seconds / 5), 5)} s"
    return f"{round(seconds / 60)} min"
