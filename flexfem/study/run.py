"""A study on disk and the run that writes its parts.

A part is a Parquet file of some designs. Its name contains a hash of the study, the range of
designs and the versions of software, so parts of other inputs or versions are never used for it.
Its metadata hold a seal of every column, which is a digest of the rows together with the same
inputs: a part that was changed, exchanged or cut is computed again."""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.answer import answer, changed_outputs, factor_warnings
from flexfem.study.columns import Rows, row_of
from flexfem.study.loaded import LoadedStudy, sample
from flexfem.study.plan import Study
from flexfem.study.workers import (
    ExecutorWorkers,
    Failure,
    Workers,
    require_same_versions,
    versions_of,
)

ABOUT = b"flexfem.study"  # key of the metadata of a part: the study and its versions
# key of the metadata of a part: its first design, the first one after it, digests by column
SEAL = b"flexfem.seal"
DIGEST_BYTES = 16  # of a digest
NAMED = 3  # most changed columns that are named
TEXTS = ["status", "reason"]
PARQUET: Mapping[str, Any] = {
    "compression": "zstd",
    "use_dictionary": TEXTS,
    "write_page_checksum": True,
}
# a read-ahead thread of Arrow would abort a process that ends while it reads
READING: Mapping[str, Any] = {"page_checksum_verification": True, "pre_buffer": False}
PART = re.compile(r"part-(\d{10})-([0-9a-f]{16})\.parquet")
RETRIED = ("time limit", "crashed", "failed")  # statuses that may change in another run
PARTS = "parts"  # folder, in the folder of a study
FILE = "study.json"  # in the folder of a study: the path of its study file
ANALYTIC_LIMIT = 600.0  # s, for a part of analytic designs
SLACK = 10.0  # s, added to the time limit of a meshed design
OLD = 3600.0  # s: age at which the temporary file of a killed run is removed
WHOLE = slice(None)
Counts: TypeAlias = Counter[tuple[str, str]]  # designs by status and kind of reason
Solve: TypeAlias = Callable[[LoadedStudy, int, int], Rows]


@dataclass(frozen=True)
class Parts:
    """Folder and names of the parts of a study, each a range of `size` designs, by software of some
    `versions`.
    """

    loaded: LoadedStudy
    folder: Path
    size: int
    versions: dict[str, str]

    @cached_property
    def _key(self) -> str:
        return json.dumps([self.loaded.hash, self.versions], sort_keys=True)

    @cached_property
    def schema(self) -> Any:
        """Columns of the table, with the study and versions as metadata."""
        loaded = self.loaded
        factors = [column.name for column in loaded.columns]
        fields = [
            pa.field("design", pa.int64(), False),
            *(pa.field(name, pa.string(), False) for name in TEXTS),
        ]
        fields += [pa.field(name, pa.float64(), False) for name in factors]
        fields += [pa.field(name, pa.float64()) for name in loaded.outputs]
        about = {
            "stem": loaded.stem,
            "name": loaded.study.name,
            "hash": loaded.hash,
            "versions": self.versions,
            "stress_accuracy": loaded.stress_accuracy,
            **loaded.assumptions._asdict(),
        }
        return pa.schema(fields, metadata={ABOUT: json.dumps(about, sort_keys=True).encode()})

    @property
    def table(self) -> Path:
        """Default path of the collected table."""
        return self.folder.parent / f"{self.loaded.stem}.parquet"

    def chunks(self, shard: slice = WHOLE) -> list[range]:
        """Return the designs of each part of a shard, in their order."""
        designs = range(self.loaded.count)
        return [designs[start : start + self.size] for start in designs[:: self.size][shard]]

    def path(self, chunk: range) -> Path:
        """Return the path of the part of a chunk."""
        digits = hashlib.sha256(self._inputs(chunk)).hexdigest()[:16]
        return self.folder / f"part-{chunk.start:010d}-{digits}.parquet"

    def _inputs(self, chunk: range) -> bytes:
        """Return the study, the versions and the designs of a chunk as text."""
        return f"{self._key} {chunk.start} {chunk.stop}".encode()

    def digests(
        self,
        chunk: range,
        table: Any,
    ) -> dict[str, str]:
        """Return the digest of each column of the rows of a chunk, together with its name and the
        inputs.
        """
        found = dict[str, str]()
        for name in table.column_names:
            column = table[name]
            if pa.types.is_string(column.type):
                rows = json.dumps(column.to_pylist()).encode()
            else:
                rows = np.ascontiguousarray(column.to_numpy()).tobytes()
            content = hashlib.blake2b(self._inputs(chunk), digest_size=DIGEST_BYTES)
            content.update(f" {name} ".encode())
            content.update(rows)
            found[name] = content.hexdigest()
        return found

    def sealed(
        self,
        chunk: range,
        table: Any,
    ) -> Any:
        """Return the table of a chunk with its seal in the metadata."""
        seal = {"start": chunk.start, "stop": chunk.stop, "digests": self.digests(chunk, table)}
        return table.replace_schema_metadata(
            table.schema.metadata | {SEAL: json.dumps(seal).encode()}
        )


def parts_of(
    loaded: LoadedStudy,
    output: Path,
    size: int | None = None,
) -> Parts:
    """Return the parts of a study in an output folder, by default some seconds of work each."""
    folder = output / loaded.stem / PARTS
    return Parts(loaded, folder, size or loaded.family.part, dict(versions_of()))


def table_of(
    parts: Parts,
    designs: range,
    rows: Rows,
) -> Any:
    """Return the Arrow table of designs: design, status, reason, factors, outputs (null without a
    result).
    """
    missing = np.asarray(rows.status != "ok")
    columns = [pa.array(np.array(designs)), pa.array(rows.status), pa.array(rows.reason)]
    columns += [pa.array(column) for column in sample(parts.loaded, designs.start, designs.stop).T]
    columns += [pa.array(column, mask=missing | np.isnan(column)) for column in rows.values.T]
    return pa.Table.from_arrays(columns, schema=parts.schema)


@contextmanager
def opened(path: Path, state: str, **options: Any) -> Iterator[Any]:
    """Open a Parquet file through Python: pyarrow opens no file whose name is not UTF-8. A damaged
    one is BadInput.
    """
    try:
        with path.open("rb") as content, pq.ParquetFile(content, **READING, **options) as file:
            yield file
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{path}: {state}") from None


def read_part(
    parts: Parts,
    chunk: range,
    columns: list[str] | None = None,
) -> Any:
    """Return some columns of a part as an Arrow table, by default all.

    Raises
    ------
    FileNotFoundError
    BadInput
        The part is damaged, is not that of this chunk, or its rows are not those that were written;
        one line.
    """
    path = parts.path(chunk)
    with opened(path, "a damaged part") as file:
        schema = file.schema_arrow
        rows = file.metadata.num_rows
        known = schema.equals(parts.schema)
        table = file.read(columns=columns, use_threads=False) if known else None
    fault = _fault(parts, chunk, schema, rows, table)
    if fault:
        raise BadInput(f"{path}: {fault}")
    return table


def _fault(
    parts: Parts,
    chunk: range,
    schema: Any,
    rows: int,
    table: Any,
) -> str:
    """Return what is wrong with a part, "" if nothing is; the table is None where its columns are
    others.
    """
    try:
        about, seal = (json.loads(schema.metadata[key]) for key in (ABOUT, SEAL))
        study = about["hash"], about["versions"]
        start = seal["start"]
        stop = seal["stop"]
        digests = dict(seal["digests"])
    except (KeyError, TypeError, ValueError):
        return "a part without a seal, written by other software"
    if study != (parts.loaded.hash, parts.versions):
        return "a part of another study or of other versions"
    if table is None:
        return "a part with other columns"
    if (start, stop) != (chunk.start, chunk.stop):
        return (
            f"a part of the designs from {start} up to {stop}, expected those from {chunk.start} "
            f"up to {chunk.stop}"
        )
    if rows != len(chunk):
        return f"a part with {rows} rows, expected {len(chunk)}"
    found = parts.digests(chunk, table)
    changed = [name for name, digest in found.items() if digests.get(name) != digest]
    if not changed:
        return ""
    more = f" and {len(changed) - NAMED} more" if len(changed) > NAMED else ""
    return f"a part that was changed in {', '.join(changed[:NAMED])}{more}"


def counts_of(table: Any) -> Counts:
    """Return the number of designs by status and kind of reason."""
    status, reasons = (table[name].to_pylist() for name in TEXTS)
    return Counter(zip(status, map(kind_of, reasons), strict=True))


@lru_cache
def kind_of(reason: str) -> str:
    """Return a reason without the numbers of its design: the text before " = ", else with dots for
    every number.
    """
    name, separator, _ = reason.partition(" = ")
    if separator:
        return name
    return re.sub(r"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", "...", reason)


class Survey(NamedTuple):
    """Contents of the folder of a study.

    counts : by chunk, the number of designs by status and kind of reason.
    damaged : by chunk, what is wrong with a part that is damaged or does not match its seal, one
    line with its path.
    stale : parts of other inputs or versions.   elsewhere : number of designs in parts of other
    shards."""

    counts: dict[range, Counts]
    damaged: dict[range, str]
    stale: list[Path]
    elsewhere: int

    @property
    def total(self) -> Counts:
        """Number of designs by status and kind of reason."""
        return sum(self.counts.values(), Counter())


def survey(
    parts: Parts,
    shard: slice = WHOLE,
    whole: bool = False,
) -> Survey:
    """Read the status of all designs in the parts of a shard; with `whole` read and check every
    column.
    """
    names = set(os.listdir(parts.folder)) if parts.folder.is_dir() else set[str]()
    of_shard = set(parts.chunks(shard))
    found = Survey({}, {}, [], 0)
    present = [chunk for chunk in parts.chunks() if parts.path(chunk).name in names]
    for chunk in present:
        try:
            if chunk in of_shard:
                found.counts[chunk] = counts_of(read_part(parts, chunk, None if whole else TEXTS))
        except BadInput as fault:
            found.damaged[chunk] = str(fault)
        except FileNotFoundError:  # removed meanwhile
            pass
    stale = sorted(names - {parts.path(chunk).name for chunk in present})
    elsewhere = sum(len(chunk) for chunk in present if chunk not in of_shard)
    return found._replace(
        stale=[parts.folder / name for name in stale if PART.fullmatch(name)], elsewhere=elsewhere
    )


class Task(NamedTuple):
    """Arguments of `solve_task`: a piece of the designs of a chunk.

    write : whether the worker writes the part and returns its counts, or returns the table.
    """

    solve: Solve
    parts: Parts
    chunk: range
    piece: range
    write: bool


def run_parts(
    parts: Parts,
    workers: Workers | ExecutorWorkers,
    solve: Solve = answer,
    shard: slice = WHOLE,
    retry: bool = False,
    say: Callable[[str], object] = lambda text: None,
) -> int:
    """Compute the missing parts of a study; several runs may work in the same folder at the same
    time.

    Workers on this machine write the parts that they compute. Those of another executor return the
    rows, which are written here: they need neither the study file nor the folder.

    Parameters
    ----------
    solve : computes the rows of a range of designs; importable by workers.
    retry : also compute parts again whose designs ran out of time, crashed or failed.
    say : called with lines for the user: on damaged and other parts, and on the progress after
    every part.

    Returns the number of designs that were known before. A stop notes how many designs are kept.

    Raises
    ------
    BadInput : no file can be written in the folder, or a worker has another flexfem.
    ComputationFailed : workers cannot start. Written parts are kept.
    """
    found = survey(parts, shard, whole=True)
    for fault in found.damaged.values():
        say(f"{fault}; computed again")
    if found.stale:
        say(
            f"{len(found.stale):,} parts of other inputs or versions in {parts.folder}: see "
            "flexfem study clean"
        )
    run = _Run(parts, solve, workers.here, found, parts.chunks(shard), retry)
    known = run.counts.total()
    if run.todo:
        _write_facts(parts)
    try:
        say(run.progress())
        for task, result in workers.results(solve_task, run.next_task, _limit):
            if run.take(Task(*task), result):
                say(run.progress())
    except KeyboardInterrupt as stop:
        kept = f"{run.counts.total():,} of {run.designs:,} designs are kept in {parts.folder}"
        stop.add_note(f"stopped; {kept}; the same command continues the run")
        raise
    return known


class _Run:
    """State of a run: chunks to compute, pieces of chunks that are computed, and counts of designs."""

    def __init__(
        self,
        parts: Parts,
        solve: Solve,
        write: bool,
        found: Survey,
        chunks: list[range],
        retry: bool,
    ) -> None:
        self.parts = parts
        self.solve = solve
        self.write = write
        self.again = {*found.damaged}
        if retry:
            self.again |= {chunk for chunk, counts in found.counts.items() if _failed(counts)}
        kept = {chunk: counts for chunk, counts in found.counts.items() if chunk not in self.again}
        self.todo = deque((chunk, chunk) for chunk in chunks if chunk not in kept)
        # runs in the same folder start with different parts
        self.todo.rotate(random.randrange(len(self.todo) or 1))
        self.counts: Counts = sum(kept.values(), Counter())
        self.designs = sum(map(len, chunks))
        self.pieces = defaultdict[range, list[Any]](list)
        self._known = self.counts.total()
        self._began = time.monotonic()

    def next_task(self) -> Task | None:
        """Return the next task, None where no chunk is left."""
        while self.todo:
            chunk, piece = self.todo.popleft()
            whole = piece == chunk
            if whole and chunk not in self.again and self._is_written(chunk):
                continue
            return Task(self.solve, self.parts, chunk, piece, self.write and whole)
        return None

    def _is_written(self, chunk: range) -> bool:
        """Count the designs of a chunk that another run has written since."""
        try:
            self.counts.update(counts_of(read_part(self.parts, chunk, TEXTS)))
        except (FileNotFoundError, BadInput):
            return False
        return True

    def take(
        self,
        task: Task,
        result: Any,
    ) -> bool:
        """Take the result of a task; return whether a chunk is complete."""
        if isinstance(result, Failure):
            if len(task.piece) > 1:  # bisect to find the design at fault
                middle = len(task.piece) // 2
                halves = (task.piece[middle:], task.piece[:middle])
                self.todo.extendleft((task.chunk, half) for half in halves)
                return False
            nothing = np.full(len(self.parts.loaded.outputs), np.nan)
            result = table_of(self.parts, task.piece, row_of(*result, nothing))
        if isinstance(result, pa.Table):
            pieces = self.pieces[task.chunk]
            pieces.append(result)
            if sum(map(len, pieces)) < len(task.chunk):
                return False
            del self.pieces[task.chunk]
            result = write_part(self.parts, task.chunk, pa.concat_tables(pieces).sort_by("design"))
        self.counts.update(result)
        return True

    def progress(self) -> str:
        """Return one line on the progress."""
        computed = self.counts.total() - self._known
        rate = computed / (time.monotonic() - self._began) if computed else 0.0
        return progress_line(self.counts, self.designs, rate)


def _failed(counts: Counts) -> bool:
    """Return whether designs ran out of time, crashed or failed."""
    return any(status in RETRIED for status, _ in counts)


def _limit(task: Any) -> float:
    """Return the seconds that a `Task` may take."""
    study: Study = task.parts.loaded.study
    if study.model == "analytic":
        return ANALYTIC_LIMIT
    seconds: float = len(task.piece) * (study.time_limit + SLACK)
    return seconds


def _write_facts(parts: Parts) -> None:
    """Write what is known of a study before it is computed: its file, and effects of its factors."""
    content: dict[str, Any] = {
        "study": os.path.relpath(parts.loaded.path, parts.folder.parent),
        "hash": parts.loaded.hash,
        "changes": stored_changes(parts),
    }
    if content["changes"] is None:
        # whatever a formula of the user raises is the reason of a design
        with suppress(Exception):
            content["changes"] = changed_outputs(parts.loaded)
    text = json.dumps(content).encode()
    write_atomically(parts.folder.parent / FILE, lambda file: file.write(text), again=True)


def stored_changes(parts: Parts) -> dict[str, list[str]] | None:
    """Return the outputs that each factor changes, as a run of this study has stored them; None
    without such a run.
    """
    try:
        content = json.loads((parts.folder.parent / FILE).read_text(encoding="utf-8"))
        return dict(content["changes"]) if content["hash"] == parts.loaded.hash else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def warnings_of_factors(parts: Parts) -> list[str]:
    """Return a warning for each factor that changes none of the requested numbers, as far as a run
    has found out.
    """
    return factor_warnings(parts.loaded, stored_changes(parts) or {})


def progress_line(
    counts: Counts,
    designs: int,
    rate: float,
) -> str:
    """Return one line on a run with `rate` designs a second: designs done, rate, time left,
    failures.
    """
    done = counts.total()
    failed = sum(n for (status, _), n in counts.items() if status in RETRIED)
    left = "waiting for the first"
    if rate > 0:
        minutes, s = divmod(round((designs - done) / rate), 60)
        left = f"{minutes // 60} h {minutes % 60:02d} min {s:02d} s left"
    digits = 0 if rate > 10 else 2
    return f"{done:,}/{designs:,} designs, {rate:,.{digits}f}/s, {left}, {failed:,} failed"


def write_part(
    parts: Parts,
    chunk: range,
    table: Any,
) -> Counts:
    """Write the part of a chunk with its seal and return its counts."""
    sealed = parts.sealed(chunk, table)
    write_atomically(
        parts.path(chunk), lambda file: pq.write_table(sealed, file, **PARQUET), again=True
    )
    return counts_of(table)


def solve_task(
    solve: Solve,
    parts: Parts,
    chunk: range,
    piece: range,
    write: bool,
) -> Any:
    """In a worker, solve a task: with `write` write the part and return its counts, else return the
    table of its designs; return a `Failure` where solving raises an error.
    """
    require_same_versions(parts.versions)
    try:
        rows = solve(parts.loaded, piece.start, piece.stop)
    except Exception as error:
        text = " ".join(str(error).split())
        if not isinstance(error, BadInput | ComputationFailed):
            text = f"{type(error).__name__}: {text}"
        return Failure("failed", text)
    table = table_of(parts, piece, rows)
    return write_part(parts, chunk, table) if write else table


def remove_stale(parts: Parts, dry_run: bool = False) -> tuple[int, int]:
    """Remove parts of other inputs or versions, and old temporary files; return number and bytes of
    the parts.
    """
    stale = survey(parts).stale
    size = sum(path.stat().st_size for path in stale)
    left = [
        path
        for path in parts.folder.glob(".part-*.tmp")
        if time.time() - path.stat().st_mtime > OLD
    ]
    for path in () if dry_run else (*stale, *left):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise BadInput(f"{path}: cannot be removed: {error.strerror or error}") from None
    return len(stale), size
