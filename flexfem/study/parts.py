"""A study on disk: chunks of designs as Parquet parts that are written once, whole, and the same whoever writes them.

The name of a part says what is in it: the chunk's number, and a hash of the study, the range of designs and the
versions that decide results. What exists is done; nothing else is kept about what was done.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from glob import escape
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput
from flexfem.study.plan import LoadedStudy
from flexfem.study.rows import Rows
from flexfem.study.sampling import sample
from flexfem.study.versions import versions_of

KEY, COUNTS = b"flexfem.study", b"flexfem.counts"  # what a part belongs to; what is in it, for who reads no more
PARQUET: Mapping[str, Any] = {  # how parts and tables are written
    "compression": "zstd",
    "use_dictionary": ["status", "reason"],
    "write_page_checksum": True,
}
BROADCAST = 8192  # designs a part, of a model that answers all of them at once
DRAWN = 512  # analytic designs that are drawn: some milliseconds each
LINKED = 32  # analytic designs whose links bend: a tenth of a second each
MESHED = 16
STALE = 3600.0  # s, after which the temporary file of a killed run is removed
PART = re.compile(r"part-(\d{7,})-([0-9a-f]{16})\.parquet")
RETRIED = ("time limit", "crashed", "failed")  # statuses that another run may change

Counts: TypeAlias = Counter[tuple[str, str]]  # designs by status and kind of reason


class Chunk(NamedTuple):
    """Designs from `start` up to `stop`, kept in one part."""

    number: int
    start: int
    stop: int


@dataclass(frozen=True)
class Parts:
    """Where the parts of a study lie and what each is called; `size` designs a part."""

    loaded: LoadedStudy
    folder: Path
    size: int

    @cached_property
    def versions(self) -> Mapping[str, str]:
        """Versions of what decides the results."""
        return versions_of(self.loaded.study.model != "analytic")

    @cached_property
    def count(self) -> int:
        """Number of parts."""
        return -(-self.designs // self.size)

    @cached_property
    def designs(self) -> int:
        """Number of designs, which takes a study long to say where parts are many."""
        return self.loaded.count

    @cached_property
    def _key(self) -> str:
        return json.dumps([self.loaded.hash, dict(self.versions)], sort_keys=True)

    @cached_property
    def schema(self) -> Any:
        """Columns of the table, with what it belongs to as metadata."""
        loaded = self.loaded
        numbers = [column.name for column in loaded.columns]
        fields = [pa.field("design", pa.int64(), False), pa.field("status", pa.string(), False)]
        fields += [pa.field("reason", pa.string(), False), *(pa.field(name, pa.float64(), False) for name in numbers)]
        fields += [pa.field(name, pa.float64()) for name in loaded.outputs]
        about = {
            "stem": loaded.stem,
            "name": loaded.study.name,
            "hash": loaded.hash,
            "versions": dict(self.versions),
            "assumed": list(loaded.assumed),
            "not_stated": list(loaded.not_stated),
        }
        return pa.schema(fields, metadata={KEY: json.dumps(about, sort_keys=True).encode()})

    @cached_property
    def table_schema(self) -> Any:
        """As `schema`, of the whole table: with how many designs it has when none is open."""
        about = json.loads(self.schema.metadata[KEY]) | {"count": self.loaded.count}
        return self.schema.with_metadata({KEY: json.dumps(about, sort_keys=True).encode()})

    @cached_property
    def stale(self) -> Path:
        """Where parts of other inputs or versions are kept apart."""
        return self.folder.parent / "stale"

    def chunk(self, number: int) -> Chunk:
        """The chunk of a number from 0."""
        return Chunk(number, number * self.size, min((number + 1) * self.size, self.designs))

    def name(self, chunk: Chunk) -> str:
        """What the part of a chunk is called."""
        digits = hashlib.sha256(f"{self._key} {chunk.start} {chunk.stop}".encode()).hexdigest()[:16]
        return f"part-{chunk.number:07d}-{digits}.parquet"

    def path(self, chunk: Chunk) -> Path:
        """Where the part of a chunk lies, once it is written."""
        return self.folder / self.name(chunk)


def parts_of(loaded: LoadedStudy, output: Path, size: int | None = None) -> Parts:
    """The parts of a study in an output folder; `size` designs each, by default as many as are some seconds of work."""
    study = loaded.study
    analytic = LINKED if study.links else DRAWN if study.draws else BROADCAST
    usual = analytic if study.model == "analytic" else MESHED
    return Parts(loaded, output / loaded.stem / "parts", size or usual)


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
    write_atomically(parts.path(chunk), lambda file: file.write(content.getvalue()))


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
    try:
        about = json.loads(metadata[KEY])
        return bool((about["hash"], about["versions"]) == (parts.loaded.hash, dict(parts.versions)))
    except (KeyError, TypeError, ValueError, RecursionError):
        return False


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


def sweep(folder: Path, stem: str = "part") -> None:
    """Remove temporary files and folders that killed runs left behind, not those of a run that may still be writing."""
    for path in folder.glob(f".{escape(stem)}-*.tmp"):
        try:
            if time.time() - path.stat().st_mtime > STALE:
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        except OSError:  # another run was quicker, or may remove what this one may not
            continue
