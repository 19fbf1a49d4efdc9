"""Rows on disk: parts, written once and whole, checked as they are read and counted in their footer; and what of a part
under way is kept.

Rows of a part under way are kept as they come: a killed run loses the designs it was at, not their whole part. A line
is a checksum and a design's row as JSON, whose numbers are exact. A line that is torn, mixed with another runner's or
not of this part is as if it were not there; the journal goes when the part is written.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput
from flexfem.study.outputs import Rows, row_of
from flexfem.study.parts import PARQUET, WHOLE, Chunk, Parts, Shard, about_of, chunk_of, names_in
from flexfem.study.sampling import sample

COUNTS = b"flexfem.counts"  # of the metadata that count what is in a part
RETRIED = ("time limit", "crashed", "failed")  # statuses that another run may change
Counts: TypeAlias = Counter[tuple[str, str]]  # designs by status and kind of reason
NOTHING = Rows(np.empty(0, object), np.empty(0, object), np.empty((0, 0)))


def table_of(parts: Parts, chunk: Chunk, rows: Rows) -> Any:
    """The Arrow table of a chunk: design, status, reason, factors, outputs (null where there is no answer)."""
    factors = sample(parts.loaded, chunk.start, chunk.stop)
    missing = np.asarray(rows.status != "ok")
    columns = [pa.array(np.arange(chunk.start, chunk.stop)), pa.array(rows.status), pa.array(rows.reason)]
    columns += [pa.array(column) for column in factors.T]
    columns += [pa.array(column, mask=missing | np.isnan(column)) for column in rows.values.T]
    return pa.Table.from_arrays(columns, schema=parts.schema)


def rows_of(parts: Parts, table: Any) -> Rows:
    """The rows that a part's Arrow table holds."""
    status, reason = (np.array(table[name].to_pylist(), dtype=object) for name in ("status", "reason"))
    values = [table[name].to_numpy() for name in parts.loaded.outputs]  # null is nan
    return Rows(status, reason, np.stack(values, axis=-1))


def write_part(parts: Parts, chunk: Chunk, rows: Rows) -> None:
    """Write the part of a chunk, and in its footer the counts of it. Raises BadInput as `write_atomically`."""
    kinds = sorted([*kind, n] for kind, n in counts_of(rows.status, rows.reason).items())
    counts = json.dumps({"start": chunk.start, "kinds": kinds}).encode()
    table = table_of(parts, chunk, rows)
    table = table.replace_schema_metadata(table.schema.metadata | {COUNTS: counts})
    content = pa.BufferOutputStream()
    pq.write_table(table, content, **PARQUET)
    write_atomically(parts.path(chunk), lambda file: file.write(content.getvalue()), again=True)


def read_part(parts: Parts, chunk: Chunk) -> Any:
    """The Arrow table of a chunk, checked to be that.

    Raises
    ------
    FileNotFoundError
        The part is not written.
    BadInput
        The file is damaged (every page has a checksum), or is not the part that its name says.
    """
    path = parts.path(chunk)
    table = read_whole(path)
    stands = _belongs(parts, table.schema.metadata) and table.schema.equals(parts.schema, check_metadata=False)
    if not stands or not np.array_equal(table["design"], np.arange(chunk.start, chunk.stop)):
        raise BadInput(f"{path}: not the part that its name says")
    if _counts_in(parts, chunk, table.schema.metadata) != counts_of_table(table):
        raise BadInput(f"{path}: a damaged part")
    return table


def read_counts(parts: Parts, chunk: Chunk) -> Counts:
    """How many designs of each kind are in the part of a chunk, by its footer alone. Raises as `read_part`."""
    path = parts.path(chunk)
    with _opened(path) as file:
        metadata, rows = file.metadata.metadata or {}, file.metadata.num_rows
    if not _belongs(parts, metadata):
        raise BadInput(f"{path}: not the part that its name says")
    counts = _counts_in(parts, chunk, metadata)
    if not rows == counts.total() == chunk.stop - chunk.start:
        raise BadInput(f"{path}: a damaged part")
    return counts


def read_prefix(parts: Parts, chunk: Chunk, path: Path) -> Rows | None:
    """Rows of the first designs of a chunk in a part of another size of the same study, None where it is none."""
    try:
        table = read_whole(path).slice(0, chunk.stop - chunk.start)
    except (FileNotFoundError, BadInput):
        return None
    same = _belongs(parts, table.schema.metadata) and table.schema.equals(parts.schema, check_metadata=False)
    begins = same and np.array_equal(table["design"], np.arange(chunk.start, chunk.start + len(table)))
    return rows_of(parts, table) if begins else None


def read_whole(path: Path) -> Any:
    """The Arrow table of any Parquet file. Raises FileNotFoundError, or BadInput when it is none or damaged."""
    with _opened(path) as file:
        return file.read(use_threads=False)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    if path.exists() and not path.is_file():
        what = "a folder in the place of a part: remove it" if path.is_dir() else "a pipe or device, no part"
        raise BadInput(f"{path}: {what}")
    try:
        with path.open("rb") as content, pq.ParquetFile(content, page_checksum_verification=True) as file:
            yield file  # opened here: pyarrow takes no name that is not UTF-8
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{path}: a damaged part") from None


def _belongs(parts: Parts, metadata: Mapping[bytes, bytes]) -> bool:
    """Whether a file is of the study and versions of the parts; a study's title may have changed since."""
    about = about_of(metadata)
    return (about.get("hash"), about.get("versions")) == (parts.loaded.hash, dict(parts.versions))


def _counts_in(parts: Parts, chunk: Chunk, metadata: Mapping[bytes, bytes]) -> Counts:
    try:
        found = json.loads(metadata[COUNTS])
        start, kinds = found["start"], {(str(status), str(kind)): int(n) for status, kind, n in found["kinds"]}
    except (KeyError, TypeError, ValueError, RecursionError):
        raise BadInput(f"{parts.path(chunk)}: a damaged part") from None
    if start != chunk.start:
        raise BadInput(f"{parts.path(chunk)}: not the part that its name says")
    return Counter(kinds)


def counts_of(status: Iterable[str], reason: Iterable[str]) -> Counts:
    """How many designs have each status and kind of reason."""
    return Counter((s, kind_of(r)) for s, r in zip(status, reason, strict=True))


def kind_of(reason: str) -> str:
    """A reason without the numbers of its design: the text before its value, or else dots for every number."""
    before, found, _ = reason.partition(" = ")
    return before if found or not reason else re.sub(r"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", "...", reason)


def counts_of_table(table: Any) -> Counts:
    """As `counts_of`, of an Arrow table."""
    return counts_of(table["status"].to_pylist(), table["reason"].to_pylist())


def journal_path(parts: Parts, chunk: Chunk) -> Path:
    """Where the rows of a part under way are kept; the name holds all that the part's does."""
    return parts.folder / f".{parts.path(chunk).stem}.rows"


def keep_rows(parts: Parts, chunk: Chunk, start: int, rows: Rows) -> None:
    """Add the rows of the designs from `start` on; a folder that takes none is told of when the part is written."""
    path = journal_path(parts, chunk)
    each = enumerate(zip(rows.status, rows.reason, rows.values, strict=True), start)
    lines = [json.dumps([k, str(status), str(reason), values.tolist()]) for k, (status, reason, values) in each]
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab", buffering=0) as file:
            file.write("".join(f"\n{_checksum(path, line)} {line}\n" for line in lines).encode())


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
            found[design] = row_of(status, reason, values)
    return found


def under_way(parts: Parts, shard: Shard = WHOLE) -> int:
    """How many designs of parts that are not written yet runs have kept."""
    chunks = [chunk_of(parts, f"{name[1:-5]}.parquet") for name in names_in(parts.folder) if name.endswith(".rows")]
    mine = [chunk for chunk in chunks if chunk is not None and chunk.number % shard.step == shard.first]
    return sum(len(kept_rows(parts, chunk)) for chunk in mine if not parts.path(chunk).exists())


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
