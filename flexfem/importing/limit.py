"""Time limit of the readers of drawings."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from flexfem.refused import BadInput

TIME_LIMIT = 30.0  # s, to read the curves of one file

Item = TypeVar("Item")


def started() -> float:
    """Return the time at which a file begins to be read, for `within_limit`.

    It is the time that this thread computes, s. Waiting for other programs, or being suspended,
    does not count.
    """
    return time.thread_time()


def within_limit(items: Iterable[Item], start: float) -> Iterator[Item]:
    """Yield what a file holds. Raises BadInput when `TIME_LIMIT` has passed since a start."""
    for item in items:
        if time.thread_time() - start > TIME_LIMIT:
            raise BadInput(f"not read within {TIME_LIMIT:g} s, expected a simpler drawing")
        yield item
