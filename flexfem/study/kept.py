"""Rows that need not be computed: of a part under way, tried again, or of another sample.

Rows of a part under way are kept as they come: a killed run loses the designs it was at, not their whole part. A line
is a checksum and a design's row as JSON, whose numbers are exact. A line that is torn, mixed with another runner's or
not of this part is as if it were not there; the journal goes when the part is written.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flexfem.refused import BadInput
from flexfem.study.content import RETRIED, read_part, read_prefix, rows_of
from flexfem.study.outputs import Rows
from flexfem.study.parts import Chunk, Parts

NOTHING = Rows(np.empty(0, object), np.empty(0, object), np.empty((0, 0)))


def journal_path(parts: Parts, chunk: Chunk) -> Path:
    """Where the rows of a part under way are kept; the name holds all that the part's does."""
    return parts.folder / f".{parts.path(chunk).stem}.rows"


def keep_row(parts: Parts, chunk: Chunk, design: int, row: Rows) -> None:
    """Add a design's row; a folder that takes none is told of when the part is written."""
    path = journal_path(parts, chunk)
    content = json.dumps([design, str(row.status[0]), str(row.reason[0]), row.values[0].tolist()])
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab", buffering=0) as file:
            file.write(f"\n{_checksum(path, content)} {content}\n".encode())


def kept_rows(parts: Parts, chunk: Chunk) -> dict[int, Rows]:
    """Rows by design that runs before this one have kept."""
    path, found = journal_path(parts, chunk), dict[int, Rows]()
    try:
        lines = path.read_text(errors="replace").splitlines()
    except OSError:
        return {}
    for line in lines:
        checksum, _, content = line.partition(" ")
        if checksum == _checksum(path, content):
            design, status, reason, values = json.loads(content)
            found[design] = Rows(np.array([status], object), np.array([reason], object), np.array([values], float))
    return found


def forget_rows(parts: Parts, chunk: Chunk) -> None:
    """Remove the journal of a part that is written."""
    with suppress(OSError):
        journal_path(parts, chunk).unlink(missing_ok=True)


def _checksum(path: Path, content: str) -> str:
    return hashlib.sha256(f"{path.name} {content}".encode()).hexdigest()[:16]


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
