"""Which chunks a runner sees to, and in which order."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator
from typing import NamedTuple

from flexfem.refused import BadInput
from flexfem.study.parts import Parts


class Shard(NamedTuple):
    """The chunks of one of several runners that share them out: number `first`, and every `step` after it."""

    first: int
    step: int

    def chunks(self, parts: Parts) -> range:
        """Numbers of the chunks."""
        return range(self.first, parts.count, self.step)

    def designs(self, parts: Parts) -> int:
        """Number of designs in the chunks."""
        chunks = self.chunks(parts)
        missing = parts.count * parts.size - parts.loaded.count if parts.count - 1 in chunks else 0
        return len(chunks) * parts.size - missing


WHOLE = Shard(0, 1)


def shard_of(text: str) -> Shard:
    """The shard that --shard I/N says, I from 1. Raises BadInput."""
    found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise BadInput(f"--shard {text}, expected I/N with 1 <= I <= N, such as 3/8")
    return Shard(int(found[1]) - 1, int(found[2]))


def shuffled(numbers: range, seed: int | None = None) -> Iterator[int]:
    """Numbers, each once, in an order that differs from runner to runner; none are held."""
    draw, size = random.Random(seed), len(numbers)
    if size == 0:
        return
    first, step = draw.randrange(size), draw.randrange(1, size + 1)
    while math.gcd(step, size) != 1:
        step = draw.randrange(1, size + 1)
    for k in range(size):
        yield numbers[(first + step * k) % size]
