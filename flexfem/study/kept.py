"""Rows that need not be computed: of a part that is tried again, of another sample's part, of a run that was killed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flexfem.refused import BadInput
from flexfem.study.journal import kept_rows
from flexfem.study.parts import RETRIED, Chunk, Parts, read_part, read_prefix, rows_of
from flexfem.study.rows import Rows

NOTHING = Rows(np.empty(0, object), np.empty(0, object), np.empty((0, 0)))


class Kept(NamedTuple):
    """What to look for: parts that hold designs to try again, stale parts by chunk, and whether failures count."""

    parts: Parts
    retried: bool
    unsure: frozenset[int]
    candidates: Mapping[int, list[Path]]

    def answers(self, chunk: Chunk) -> dict[int, Rows]:
        """Rows by design: of the part itself where it is tried again, else of one of a smaller or larger sample."""
        if chunk.number in self.unsure:
            try:
                rows = rows_of(self.parts, read_part(self.parts, chunk))
            except (FileNotFoundError, BadInput):
                return {}
        else:
            found = (read_prefix(self.parts, chunk, path) for path in self.candidates.get(chunk.number, ()))
            rows = max((each for each in found if each is not None), key=lambda each: len(each.status), default=NOTHING)
        each = {chunk.start + k: Rows(*(one[k : k + 1] for one in rows)) for k in range(len(rows.status))}
        return self._good(each)

    def journalled(self, chunk: Chunk) -> dict[int, Rows]:
        """Rows by design of a part under way that a killed run has left."""
        return self._good(kept_rows(self.parts, chunk))

    def _good(self, rows: dict[int, Rows]) -> dict[int, Rows]:
        return {design: row for design, row in rows.items() if not (self.retried and row.status[0] in RETRIED)}
