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
from collections.abc import Callable, Mapping
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
from flexfem.study.answer import answer, factor_warnings, needs_stages
from flexfem.study.columns import Rows, failed_row
from flexfem.study.loaded import LoadedStudy, sample
from flexfem.study.workers import Failure, Workers, require_same_versions, versions_of

ABOUT = b"flexfem.study"  # metadata: what a part belongs to
TEXTS = ["status", "reason"]
PARQUET: Mapping[str, Any] = {"compression": "zstd", "use_dictionary": TEXTS, "write_page_checksum": True}
# a thread of Arrow that reads ahead would abort a process that ends meanwhile
READING: Mapping[str, Any] = {"page_checksum_verification": True, "pre_buffer": False}
SIZES = {"fe": 4, "verify": 4, "three_dimensional": 2}  # designs a part: some seconds of work, which a stop may lose
LINKED, DRAWN, BROADCAST = 32, 512, 8192  # analytic ones: with links or questions, drawn, all at once
PART = re.compile(r"part-(\d{10})-([0-9a-f]{16})\.parquet")
RETRIED = ("time limit", "crashed", "failed")  # statuses that another run may change
FILE = "study.json"  # names the study file in its folder
ANALYTIC_LIMIT, SLACK = 600.0, 10.0  # s, for a part of analytic designs; for a meshed design beyond the limit of gmsh
OLD = 3600.0  # s, after which the temporary file of a killed run is removed
WHOLE = slice(None)
Counts: TypeAlias = Counter[tuple[str, str]]  # designs by status and kind of reason
Solve: TypeAlias = Callable[[LoadedStudy, int, int], Rows]


@dataclass(frozen=True)
class Parts:
    """Where the parts of a study lie and what each is called; `size` designs a part, which is a range of designs."""

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
    def factor_warnings(self) -> list[str]:
        """Warnings on factors that change nothing of what the study shows."""
        return factor_warnings(self.loaded)

    @cached_property
    def _key(self) -> str:
        return json.dumps([self.loaded.hash, self.versions], sort_keys=True)

    @cached_property
    def schema(self) -> Any:
        """Columns of the table, with what it belongs to as metadata."""
        loaded = self.loaded
        factors = [column.name for column in loaded.columns]
        fields = [pa.field("design", pa.int64(), False), *(pa.field(name, pa.string(), False) for name in TEXTS)]
        fields += [pa.field(name, pa.float64(), False) for name in factors]
        fields += [pa.field(name, pa.float64()) for name in loaded.outputs]
        about = {"stem": loaded.stem, "name": loaded.study.name, "hash": loaded.hash, "versions": self.versions}
        about |= {"stress_accuracy": loaded.stress_accuracy}
        about |= loaded.assumptions._asdict()
        return pa.schema(fields, metadata={ABOUT: json.dumps(about, sort_keys=True).encode()})

    def chunks(self, shard: slice = WHOLE) -> list[range]:
        """The designs of each part of a shard, in their order."""
        designs = range(self.loaded.count)
        return [designs[start : start + self.size] for start in designs[:: self.size][shard]]

    def path(self, chunk: range) -> Path:
        """Where the part of a chunk lies, once it is written."""
        digits = hashlib.sha256(f"{self._key} {chunk.start} {chunk.stop}".encode()).hexdigest()[:16]
        return self.folder / f"part-{chunk.start:010d}-{digits}.parquet"


def parts_of(loaded: LoadedStudy, output: Path, size: int | None = None) -> Parts:
    """The parts of a study in an output folder, by default of some seconds of work each."""
    study = loaded.study
    analytic = LINKED if study.links or study.ask else DRAWN if needs_stages(study) or study.driven else BROADCAST
    return Parts(loaded, output / loaded.stem / "parts", size or SIZES.get(study.model, analytic))


def table_of(parts: Parts, designs: range, rows: Rows) -> Any:
    """The Arrow table of designs: design, status, reason, factors, outputs (null where there is no answer)."""
    missing = np.asarray(rows.status != "ok")
    columns = [pa.array(np.array(designs)), pa.array(rows.status), pa.array(rows.reason)]
    columns += [pa.array(column) for column in sample(parts.loaded, designs.start, designs.stop).T]
    columns += [pa.array(column, mask=missing | np.isnan(column)) for column in rows.values.T]
    return pa.Table.from_arrays(columns, schema=parts.schema)


def read_part(path: Path, columns: list[str] | None = None) -> Any:
    """The Arrow table of a part. Raises FileNotFoundError, or BadInput where it is damaged: pages have checksums."""
    try:
        with path.open("rb") as content, pq.ParquetFile(content, **READING) as file:
            return file.read(columns=columns, use_threads=False)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{path}: a damaged part") from None


def counts_of(table: Any) -> Counts:
    """Designs of each status and kind of reason."""
    found: Counts = Counter()
    for (status, reason), n in Counter(zip(*(table[name].to_pylist() for name in TEXTS), strict=True)).items():
        found[status, kind_of(reason)] += n
    return found


def kind_of(reason: str) -> str:
    """A reason without the numbers of its design: the text before its value, or else dots for every number."""
    before, found, _ = reason.partition(" = ")
    return before if found or not reason else re.sub(r"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", "...", reason)


class Survey(NamedTuple):
    """What lies in the folder of a study.

    counts : designs by status and kind of reason, by chunk.   damaged : chunks whose parts cannot be read.
    stale : parts of other inputs or versions.   elsewhere : designs of other shards that have parts.
    """

    counts: dict[range, Counts]
    damaged: list[range]
    stale: list[Path]
    elsewhere: int

    @property
    def total(self) -> Counts:
        """Designs by status and kind of reason."""
        return sum(self.counts.values(), Counter())


def survey(parts: Parts, shard: slice = WHOLE, whole: bool = False) -> Survey:
    """Look at the parts of a shard: at what became of their designs, or, where `whole`, at every byte."""
    names = set(os.listdir(parts.folder)) if parts.folder.is_dir() else set[str]()
    mine, found = set(parts.chunks(shard)), Survey({}, [], [], 0)
    there = [chunk for chunk in parts.chunks() if parts.path(chunk).name in names]
    for chunk in there:
        try:
            if chunk in mine:
                found.counts[chunk] = counts_of(read_part(parts.path(chunk), None if whole else TEXTS))
        except BadInput:
            found.damaged.append(chunk)
        except FileNotFoundError:  # removed meanwhile
            pass
    stale = sorted(names - {parts.path(chunk).name for chunk in there})
    elsewhere = sum(len(chunk) for chunk in there if chunk not in mine)
    return found._replace(stale=[parts.folder / each for each in stale if PART.fullmatch(each)], elsewhere=elsewhere)


class Progress(NamedTuple):
    """How far a run is: `designs` in all, `known` were there before, `counts` by status and kind of reason."""

    designs: int
    known: int
    counts: Counts


def run_parts(
    parts: Parts,
    workers: Workers,
    solve: Solve = answer,
    shard: slice = WHOLE,
    retry: bool = False,
    watch: Callable[[Progress], object] = lambda progress: None,
    say: Callable[[str], object] = lambda text: None,
) -> Progress:
    """Compute the parts of a study that are missing; several runs may work on one folder at once.

    Parameters
    ----------
    solve : answers a range of designs; importable by workers.
    retry : also compute again the parts that hold designs out of time, crashed or failed.
    watch, say : receive the progress after every part, and lines for the user.

    Raises
    ------
    BadInput : the folder takes no file, or a worker has another flexfem.
    ComputationFailed : workers cannot start. Parts that are written stay.
    """
    found, chunks = survey(parts, shard, whole=True), parts.chunks(shard)
    for chunk in found.damaged:
        say(f"{parts.path(chunk)}: a damaged part; computing it again")
    if found.stale:
        say(f"{len(found.stale):,} parts of other inputs or versions are in {parts.folder}; study clean removes them")
    again = set(found.damaged)
    again |= {chunk for chunk, counts in found.counts.items() if retry and any(kind[0] in RETRIED for kind in counts)}
    todo = deque(chunk for chunk in chunks if chunk not in found.counts or chunk in again)
    todo.rotate(random.randrange(len(todo) or 1))  # runs on one folder begin at different places
    counts: Counts = sum((n for chunk, n in found.counts.items() if chunk not in again), Counter())
    designs, known = sum(map(len, chunks)), counts.total()
    pieces, ahead = dict[range, dict[int, Any]](), deque[Any]()
    watch(Progress(designs, known, counts))
    if todo:
        named = {"study": os.path.relpath(parts.loaded.path, parts.folder.parent)}
        write_atomically(parts.folder.parent / FILE, lambda file: file.write(json.dumps(named).encode()), again=True)

    def next_task() -> tuple[Any, ...] | None:
        while not ahead and todo:
            chunk = todo.popleft()
            try:
                if chunk in again:
                    raise FileNotFoundError
                counts.update(counts_of(read_part(parts.path(chunk), TEXTS)))  # another run has written it meanwhile
            except (FileNotFoundError, BadInput):
                return solve, parts, chunk, chunk
        return ahead.popleft() if ahead else None

    def limit(task: tuple[Any, ...]) -> float:
        return len(task[-1]) * (parts.loaded.study.time_limit + SLACK) if parts.meshed else ANALYTIC_LIMIT

    for (_, _, chunk, piece), result in workers.results(solve_task, next_task, limit):
        if isinstance(result, Failure) and len(piece) > 1:  # find the design at fault
            middle = len(piece) // 2
            ahead += [(solve, parts, chunk, half) for half in (piece[:middle], piece[middle:])]
            continue
        if isinstance(result, Failure):
            result = table_of(parts, piece, failed_row(len(parts.loaded.outputs), *result))
        if isinstance(result, pa.Table):
            each = pieces.setdefault(chunk, {})
            each[piece.start] = result
            if sum(map(len, each.values())) < len(chunk):
                continue
            result = write_part(parts, chunk, pa.concat_tables(each[start] for start in sorted(each)))
        counts.update(result)
        watch(Progress(designs, known, counts))
    return Progress(designs, known, counts)


def write_part(parts: Parts, chunk: range, table: Any) -> Counts:
    """Write the part of a chunk; returns what is in it."""
    write_atomically(parts.path(chunk), lambda file: pq.write_table(table, file, **PARQUET), again=True)
    return counts_of(table)


def solve_task(solve: Solve, parts: Parts, chunk: range, piece: range) -> Any:
    """In a worker: write the part of a whole chunk and return its counts, or return the table of a piece of it; a
    `Failure` where the answer of a design raises an error."""
    require_same_versions(parts.versions, parts.meshed)
    try:
        rows = solve(parts.loaded, piece.start, piece.stop)
    except Exception as error:
        kind = "" if isinstance(error, BadInput | ComputationFailed) else f"{type(error).__name__}: "
        return Failure("failed", kind + " ".join(str(error).split()))
    table = table_of(parts, piece, rows)
    return write_part(parts, chunk, table) if piece == chunk else table


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
