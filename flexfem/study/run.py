"""A study on disk and the run that writes it: whole parts, named after their inputs and the versions that decide them.

A part is a Parquet file of some designs. Its name holds a hash of the study, the range of designs and the versions, so
that a part that exists is done, and rows of other inputs or versions are never taken for it.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.answer import answer, drawn_one_by_one
from flexfem.study.columns import Rows, failed_row
from flexfem.study.loaded import LoadedStudy, sample
from flexfem.study.workers import Failure, Workers, require_same_versions, versions_of

ABOUT, COUNTS = b"flexfem.study", b"flexfem.counts"  # metadata: what a part belongs to, and what is in it
PARQUET: Mapping[str, Any] = {
    "compression": "zstd",
    "use_dictionary": ["status", "reason"],
    "write_page_checksum": True,
}
SIZES = {"fe": 4, "verify": 4, "three_dimensional": 2}  # designs a part: some seconds of work, which a stop may lose
LINKED, DRAWN, BROADCAST = 32, 512, 8192  # analytic ones: with elastic links, drawn one by one, all at once
PART = re.compile(r"part-(\d{10})-([0-9a-f]{16})\.parquet")
RETRIED = ("time limit", "crashed", "failed")  # statuses that another run may change
FILE = "study.json"  # names the study file in its folder
ANALYTIC_LIMIT, SLACK = 600.0, 10.0  # s, for a part of analytic designs; for a meshed design beyond the limit of gmsh
OLD = 3600.0  # s, after which the temporary file of a killed run is removed
Counts: TypeAlias = Counter[tuple[str, str]]  # designs by status and kind of reason
Solve: TypeAlias = Callable[[LoadedStudy, int, int], Rows]


class Chunk(NamedTuple):
    """Designs from `start` up to `stop`, kept in one part."""

    start: int
    stop: int


class Shard(NamedTuple):
    """The chunks of one of several runners that share them out: number `first`, and every `step` after it."""

    first: int = 0
    step: int = 1


WHOLE = Shard()


@dataclass(frozen=True)
class Parts:
    """Where the parts of a study lie and what each is called; `size` designs a part."""

    loaded: LoadedStudy
    folder: Path
    size: int

    @cached_property
    def meshed(self) -> bool:
        """Whether finite elements take part."""
        return self.loaded.study.model != "analytic"

    @cached_property
    def versions(self) -> dict[str, str]:
        """Versions of what decides the results."""
        return dict(versions_of(self.meshed))

    @cached_property
    def _key(self) -> str:
        return json.dumps([self.loaded.hash, self.versions], sort_keys=True)

    @cached_property
    def schema(self) -> Any:
        """Columns of the table, with what it belongs to as metadata."""
        loaded = self.loaded
        factors = [column.name for column in loaded.columns]
        fields = [pa.field("design", pa.int64(), False), pa.field("status", pa.string(), False)]
        fields += [pa.field("reason", pa.string(), False), *(pa.field(name, pa.float64(), False) for name in factors)]
        fields += [pa.field(name, pa.float64()) for name in loaded.outputs]
        about = {"stem": loaded.stem, "name": loaded.study.name, "hash": loaded.hash, "versions": self.versions}
        about |= {"stress_accuracy": loaded.stress_accuracy}
        about |= {"assumed": list(loaded.assumed), "not_stated": list(loaded.not_stated)}
        return pa.schema(fields, metadata={ABOUT: json.dumps(about, sort_keys=True).encode()})

    def chunks(self, shard: Shard = WHOLE) -> list[Chunk]:
        """The chunks of a shard, in the order of their designs."""
        size, count = self.size, self.loaded.count
        starts = range(shard.first * size, count, shard.step * size)
        return [Chunk(start, min(start + size, count)) for start in starts]

    def path(self, chunk: Chunk) -> Path:
        """Where the part of a chunk lies, once it is written."""
        digits = hashlib.sha256(f"{self._key} {chunk.start} {chunk.stop}".encode()).hexdigest()[:16]
        return self.folder / f"part-{chunk.start:010d}-{digits}.parquet"


def parts_of(loaded: LoadedStudy, output: Path, size: int | None = None) -> Parts:
    """The parts of a study in an output folder, by default of some seconds of work each."""
    study = loaded.study
    analytic = LINKED if study.links else DRAWN if drawn_one_by_one(study) or study.driven else BROADCAST
    return Parts(loaded, output / loaded.stem / "parts", size or SIZES.get(study.model, analytic))


def table_of(parts: Parts, chunk: Chunk, rows: Rows) -> Any:
    """The Arrow table of a chunk: design, status, reason, factors, outputs (null where there is no answer)."""
    factors = sample(parts.loaded, chunk.start, chunk.stop)
    missing = np.asarray(rows.status != "ok")
    columns = [pa.array(np.arange(chunk.start, chunk.stop)), pa.array(rows.status), pa.array(rows.reason)]
    columns += [pa.array(column) for column in factors.T]
    columns += [pa.array(column, mask=missing | np.isnan(column)) for column in rows.values.T]
    kinds = sorted([*kind, n] for kind, n in counts_of(rows.status, rows.reason).items())
    return pa.Table.from_arrays(columns, schema=parts.schema).replace_schema_metadata(
        parts.schema.metadata | {COUNTS: json.dumps(kinds).encode()}
    )


def part_content(parts: Parts, chunk: Chunk, rows: Rows) -> bytes:
    """The file of a part."""
    content = pa.BufferOutputStream()
    pq.write_table(table_of(parts, chunk, rows), content, **PARQUET)
    return content.getvalue().to_pybytes()  # type: ignore[no-any-return]


def read_part(path: Path) -> Any:
    """The Arrow table of a part. Raises FileNotFoundError, or BadInput where it is damaged: pages have checksums."""
    try:
        with path.open("rb") as content, pq.ParquetFile(content, page_checksum_verification=True) as file:
            return file.read(use_threads=False)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{path}: a damaged part") from None


def read_counts(path: Path, whole: bool = False) -> Counts:
    """Designs of each kind in a part, by its footer, or after all of it was read. Raises as `read_part`."""
    try:
        if whole:
            metadata = read_part(path).schema.metadata
        else:
            with path.open("rb") as content:
                metadata = pq.read_metadata(content).metadata
        return Counter({(status, kind): n for status, kind, n in json.loads(metadata[COUNTS])})
    except FileNotFoundError:
        raise
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException):
        raise BadInput(f"{path}: a damaged part") from None


def counts_of(status: Iterable[str], reason: Iterable[str]) -> Counts:
    """Designs of each status and kind of reason."""
    return Counter((s, kind_of(r)) for s, r in zip(status, reason, strict=True))


def kind_of(reason: str) -> str:
    """A reason without the numbers of its design: the text before its value, or else dots for every number."""
    before, found, _ = reason.partition(" = ")
    return before if found or not reason else re.sub(r"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", "...", reason)


class Survey(NamedTuple):
    """What lies in the folder of a study.

    counts : designs by status and kind of reason, by chunk.
    damaged : paths of parts that are there but cannot be read.
    stale : parts of other inputs or versions.
    elsewhere : designs of other shards that have parts.
    """

    counts: dict[Chunk, Counts]
    damaged: list[Path]
    stale: list[Path]
    elsewhere: int

    @property
    def total(self) -> Counts:
        """Designs by status and kind of reason."""
        return sum(self.counts.values(), Counter())


def survey(parts: Parts, shard: Shard = WHOLE, whole: bool = False) -> Survey:
    """Look at the parts of a shard: at their footers, or, where `whole`, at every byte."""
    names = set(os.listdir(parts.folder)) if parts.folder.is_dir() else set[str]()
    mine, counts, damaged, elsewhere = set(parts.chunks(shard)), dict[Chunk, Counts](), list[Path](), 0
    for chunk in parts.chunks():
        path = parts.path(chunk)
        if path.name not in names:
            continue
        names.remove(path.name)
        if chunk not in mine:
            elsewhere += chunk.stop - chunk.start
            continue
        try:
            counts[chunk] = read_counts(path, whole)
        except FileNotFoundError:
            continue
        except BadInput:
            damaged.append(path)
    return Survey(counts, damaged, [parts.folder / name for name in sorted(names) if PART.fullmatch(name)], elsewhere)


class Progress(NamedTuple):
    """How far a run is: `designs` in all, `known` were there before, `counts` by status and kind of reason."""

    designs: int
    known: int
    counts: Counts


def run_parts(
    parts: Parts,
    workers: Workers,
    solve: Solve = answer,
    shard: Shard = WHOLE,
    retry: bool = False,
    watch: Callable[[Progress], object] = lambda progress: None,
    say: Callable[[str], object] = lambda text: None,
) -> Progress:
    """Compute the parts of a study that are missing; several runs may work on one folder at once.

    Parameters
    ----------
    solve : callable
        Answers a range of designs; importable by workers.
    retry : bool
        Also compute again the parts that hold designs out of time, crashed or failed.
    watch, say : callable
        Receive the progress after every part, and lines for the user.

    Raises
    ------
    BadInput
        The folder takes no file, or a worker has another flexfem.
    ComputationFailed
        Workers cannot start or are lost. Parts that are written stay.
    """
    found = survey(parts, shard, whole=True)
    for path in found.damaged:
        say(f"{path}: a damaged part; computing it again")
    if found.stale:
        say(f"{len(found.stale):,} parts of other inputs or versions are in {parts.folder}; study clean removes them")
    again = {chunk for chunk, counts in found.counts.items() if retry and any(kind[0] in RETRIED for kind in counts)}
    done = {chunk: counts for chunk, counts in found.counts.items() if chunk not in again}
    again |= {chunk for chunk in parts.chunks(shard) if parts.path(chunk) in found.damaged}
    todo = deque(chunk for chunk in parts.chunks(shard) if chunk not in done)
    todo.rotate(random.randrange(len(todo) or 1))  # runs on one folder begin at different places
    counts: Counts = sum(done.values(), Counter())
    designs = sum(chunk.stop - chunk.start for chunk in parts.chunks(shard))
    known, pieces, ahead = counts.total(), dict[Chunk, dict[int, Rows]](), deque[Any]()
    watch(Progress(designs, known, counts))
    if todo:
        named = {"study": os.path.relpath(parts.loaded.path, parts.folder.parent)}
        _write(parts.folder.parent / FILE, json.dumps(named).encode())

    def next_task() -> tuple[Any, ...] | None:
        while not ahead and todo:
            chunk = todo.popleft()
            try:
                if chunk in again:
                    raise FileNotFoundError
                counts.update(read_counts(parts.path(chunk)))  # another run has written it meanwhile
            except (FileNotFoundError, BadInput):
                return solve, parts, chunk, *chunk
        return ahead.popleft() if ahead else None

    def limit(task: tuple[Any, ...]) -> float:
        return ((task[4] - task[3]) * (parts.loaded.study.time_limit + SLACK)) if parts.meshed else ANALYTIC_LIMIT

    for task, result in workers.results(solve_task, next_task, limit):
        _, _, chunk, start, stop = task
        if isinstance(result, Failure) and stop - start > 1:  # find the design at fault
            middle = (start + stop) // 2
            ahead += [(solve, parts, chunk, start, middle), (solve, parts, chunk, middle, stop)]
            continue
        if isinstance(result, Failure):
            result = failed_row(len(parts.loaded.outputs), *result)
        if isinstance(result, Rows):
            each = pieces.setdefault(chunk, {})
            each[start] = result
            if sum(len(rows.status) for rows in each.values()) < chunk.stop - chunk.start:
                continue
            rows = joined([each[start] for start in sorted(each)])
            result = part_content(parts, chunk, rows), counts_of(rows.status, rows.reason)
        content, kinds = result
        _write(parts.path(chunk), content)
        counts.update(kinds)
        watch(Progress(designs, known, counts))
    return Progress(designs, known, counts)


def _write(path: Path, content: bytes) -> None:
    write_atomically(path, lambda file: file.write(content), again=True)


def solve_task(solve: Solve, parts: Parts, chunk: Chunk, start: int, stop: int) -> tuple[bytes, Counts] | Rows:
    """In a worker: a whole part as a file with its counts, or rows of a piece of it."""
    require_same_versions(parts.versions, parts.meshed)
    rows = _solved(solve, parts.loaded, start, stop)
    if chunk != (start, stop):
        return rows
    return part_content(parts, chunk, rows), counts_of(rows.status, rows.reason)


def _solved(solve: Solve, loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """Rows of designs; one whose answer raises an error is a row `failed`, and takes no other along."""
    try:
        return solve(loaded, start, stop)
    except Exception as error:
        if stop - start > 1:
            middle = (start + stop) // 2
            return joined([_solved(solve, loaded, start, middle), _solved(solve, loaded, middle, stop)])
        kind = "" if isinstance(error, BadInput | ComputationFailed) else f"{type(error).__name__}: "
        return failed_row(len(loaded.outputs), "failed", kind + " ".join(str(error).split()))


def joined(rows: list[Rows]) -> Rows:
    """Rows one after the other."""
    return Rows(*map(np.concatenate, zip(*rows, strict=True)))


def remove_stale(parts: Parts, dry_run: bool = False) -> tuple[int, int]:
    """Remove parts of other inputs or versions, and what killed runs left; how many parts, of how many bytes."""
    stale = survey(parts).stale
    size = sum(path.stat().st_size for path in stale)
    for path in stale if not dry_run else ():
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise BadInput(f"{path}: cannot be removed: {error.strerror or error}") from None
    for path in parts.folder.glob(".part-*.tmp") if not dry_run else ():
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > OLD:
                path.unlink()
    return len(stale), size
