"""Run a study: chunk after chunk to the workers, part after part to disk; what exists is skipped.

Runners on one folder need not know of one another: each walks the chunks in an order of its own, and looks again
whether a part is there before it computes or writes it.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import numpy as np

from flexfem.refused import BadInput
from flexfem.sources import require_unchanged
from flexfem.study.answer import answer
from flexfem.study.content import (
    Counts,
    Kept,
    counts_of,
    counts_of_table,
    forget_rows,
    keep_rows,
    read_part,
    under_way,
    write_part,
)
from flexfem.study.folder import candidates, claim_folder, require_same_arithmetic, set_apart, survey
from flexfem.study.outputs import Rows, failed_row
from flexfem.study.parts import WHOLE, Chunk, Parts, Shard, shuffled, sweep
from flexfem.study.pool import DEATHS, Answer, Pool, require_workers
from flexfem.study.tables import EXTENSIBLE
from flexfem.study.worker import Died

BROADCAST_LIMIT = 600.0  # s, for as many analytic designs as are given out at once
FIRST, SECONDS = 4, 2.0  # analytic designs given out first; how long those given out later take, which a stop loses
STARTUP = 10.0  # s, for a worker to load what it needs, on top of that or of the study's limit for a design
POLL = 0.25  # s


class Task(NamedTuple):
    """Designs of a chunk given to a worker, and how many workers have died over them."""

    chunk: Chunk
    start: int
    stop: int
    deaths: int = 0


class Progress(NamedTuple):
    """How far a run is: `designs` it is to see to, of which `known` were there before; all it knows of by status.

    kept : of a run that has ended, designs in its folder, those of parts under way included.
    """

    designs: int
    known: int
    counts: Counts
    kept: int | None = None


def run_study(
    parts: Parts,
    pool: Pool,
    solve: Answer = answer,
    shard: Shard = WHOLE,
    retry: bool = False,
    watch: Callable[[Progress], object] = lambda progress: None,
    say: Callable[[str], object] = lambda text: None,
) -> Progress:
    """Compute the parts of a study that are missing.

    Parameters
    ----------
    solve : answers a range of designs; importable by workers.
    retry : also compute again the parts that hold designs out of time, crashed or failed.
    watch : is told now and then how far the run is.
    say : is told in a line what the user should know, such as a damaged part.

    Raises
    ------
    BadInput
        The folder takes no file or has rows of another arithmetic, or a worker has another flexfem.
    ComputationFailed
        Workers cannot be started, or are lost. Parts that are written stay in any case.
    SourcesChanged
        flexfem was edited since this process began.
    """
    require_unchanged()  # what this process has loaded by now is what its parts are named after
    require_same_arithmetic(parts)
    sweep(parts.folder)
    for line in set_apart(parts).said(parts.stale):
        say(line)
    run = _Run(parts, pool, solve, shard, retry, say)
    watch(run.progress)
    if run.known < run.designs:
        require_workers(pool, solve, parts.loaded, lambda: watch(run.progress))
        claim_folder(parts)
    try:
        with ThreadPoolExecutor(1) as writer:
            while run.step(writer):
                watch(run.progress)
    finally:  # also of a run that is stopped
        watch(run.progress._replace(kept=run.on_disk()))
    return run.progress


class _Run:
    """The state of a run: chunks to open, tasks to give out, tasks and writes under way."""

    def __init__(
        self, parts: Parts, pool: Pool, solve: Answer, shard: Shard, retry: bool, say: Callable[[str], object]
    ) -> None:
        self.parts, self.pool, self.solve, self.shard, self.say = parts, pool, solve, shard, say
        found = survey(parts, shard, whole=True)
        blocked = {number for number in found.damaged if parts.path(parts.chunk(number)).is_dir()}
        for number, text in found.damaged.items():
            say(f"{text}; {'its designs are left out' if number in blocked else 'computing it again'}")
        unsure = found.unsure if retry else {}
        self.again = set(unsure) | set(found.damaged) - blocked  # parts to replace, though they are there
        self.done = found.done - self.again | blocked
        self.counts = found.counts - sum(unsure.values(), Counter())
        self.known, self.designs = self.counts.total(), shard.designs(parts)
        stale = candidates(parts) if parts.loaded.study.sampling.method in EXTENSIBLE else {}
        self.kept = Kept(parts, retry, frozenset(unsure), stale)
        self.order = shuffled(shard.chunks(parts))
        self.ready: deque[Task] = deque()
        self.pieces: dict[Chunk, dict[int, Rows]] = {}
        self.computing: dict[Future[Any], Task] = {}
        self.begun: dict[Future[Any], float] = {}
        self.at_once = FIRST
        self.writing: dict[Future[Any], Chunk] = {}

    @property
    def progress(self) -> Progress:
        return Progress(self.designs, self.known, self.counts)

    def on_disk(self) -> int:
        """Designs that lie in the folder when all writes are done."""
        written = sum(chunk.stop - chunk.start for chunk in self.writing.values() if self.parts.path(chunk).exists())
        return self.counts.total() + written + under_way(self.parts, self.shard)

    def step(self, writer: ThreadPoolExecutor) -> bool:
        """Give out tasks, wait a little and take in what is done; returns whether there was anything to wait for."""
        while len(self.computing) < self.pool.width and len(self.writing) <= self.pool.width:
            task = self._next(writer)
            if task is None:
                break
            began = time.monotonic()
            future = self.pool.submit(self.solve, self.parts.loaded, task.start, task.stop, self._allowed + STARTUP)
            self.computing[future], self.begun[future] = task, began
        pending = [*self.computing, *self.writing]
        for future in wait(pending, POLL, FIRST_COMPLETED).done:
            if future in self.writing:
                del self.writing[future]
                self.counts.update(future.result())
            else:
                task = self.computing.pop(future)
                self._learn(task, time.monotonic() - self.begun.pop(future))
                self._take(task, future, writer)
        self.pool.check()
        return bool(pending)

    def _learn(self, task: Task, seconds: float) -> None:
        """Give out as many designs at once as take `SECONDS`, after what a task took."""
        count = task.stop - task.start
        self.at_once = max(1, min(int(SECONDS * count / max(seconds, 1e-9)), 8 * max(count, FIRST)))

    @property
    def _allowed(self) -> float:
        """Time for a task, s."""
        study = self.parts.loaded.study
        return BROADCAST_LIMIT if self._broadcast else study.time_limit

    def _next(self, writer: ThreadPoolExecutor) -> Task | None:
        """The next task to give out, of a chunk under way or else of a new one; None when all are given out."""
        while not self.ready:
            number = next(self.order, None)
            if number is None:
                return None
            chunk = self.parts.chunk(number)
            if not self._is_there(chunk):
                kept = self.pieces[chunk] = self.kept.answers(chunk) | self.kept.journalled(chunk)
                missing = [k for k in range(chunk.start, chunk.stop) if k not in kept]
                self.ready += [Task(chunk, *ends) for ends in self._ranges(missing)]
                if not missing:
                    self._write_when_whole(chunk, writer)
        task = self.ready.popleft()
        cut = task.start + self.at_once
        if self._broadcast and cut < task.stop:
            self.ready.appendleft(task._replace(start=cut))
            return task._replace(stop=cut)
        return task

    def _ranges(self, designs: list[int]) -> list[tuple[int, int]]:
        """Designs as ranges: as long as they can be for a model that answers many at once, else of one."""
        if not self._broadcast:
            return [(design, design + 1) for design in designs]
        runs = np.split(np.array(designs), np.flatnonzero(np.diff(designs) != 1) + 1)
        return [(int(run[0]), int(run[-1]) + 1) for run in runs if len(run)]

    @property
    def _broadcast(self) -> bool:
        """Whether the model answers many designs at once."""
        return self.parts.loaded.study.model == "analytic"

    def _is_there(self, chunk: Chunk) -> bool:
        """Whether the part of a chunk is there; counts it when another runner has written it since."""
        if chunk.number in self.done:
            return True
        if chunk.number in self.again and len(self.kept.answers(chunk)) < chunk.stop - chunk.start:
            return False
        try:
            counts = counts_of_table(read_part(self.parts, chunk))
        except FileNotFoundError:
            return False
        except BadInput as error:
            self.say(f"{error}; computing it again")
            self.again.add(chunk.number)
            return False
        self.counts.update(counts)
        self.known += counts.total()
        return True

    def _take(self, task: Task, future: Future[Any], writer: ThreadPoolExecutor) -> None:
        """Take in what became of a task: rows, or the same designs to be tried again."""
        try:
            found = self.pool.outcome(future)
            failure = ("failed", found if isinstance(found, str) else "")
        except TimeoutError:
            found, failure = "", ("time limit", f"no answer in {self._allowed:g} s and {STARTUP:g} s more")
        except Died as death:
            if not death.final and task.deaths + 1 < DEATHS:
                self.ready.appendleft(task._replace(deaths=task.deaths + 1))
                return
            found, failure = "", ("crashed", "the worker died")
        if isinstance(found, Rows):
            self._file(task, found, writer)
        elif task.stop - task.start > 1:  # find the design whose fault it is
            middle = (task.start + task.stop) // 2
            self.ready.extendleft([task._replace(start=middle, deaths=0), task._replace(stop=middle, deaths=0)])
        else:
            self._file(task, failed_row(len(self.parts.loaded.outputs), *failure), writer)

    def _file(self, task: Task, rows: Rows, writer: ThreadPoolExecutor) -> None:
        """Put rows to those of their chunk, and write the part when they are all there."""
        self.pieces[task.chunk][task.start] = rows
        if len(rows.status) < task.chunk.stop - task.chunk.start:
            keep_rows(self.parts, task.chunk, task.start, rows)
        self._write_when_whole(task.chunk, writer)

    def _write_when_whole(self, chunk: Chunk, writer: ThreadPoolExecutor) -> None:
        pieces = self.pieces[chunk]
        if sum(len(piece.status) for piece in pieces.values()) == chunk.stop - chunk.start:
            whole = Rows(*map(np.concatenate, zip(*(pieces[start] for start in sorted(pieces)), strict=True)))
            del self.pieces[chunk]
            self.writing[writer.submit(self._write, chunk, whole)] = chunk

    def _write(self, chunk: Chunk, rows: Rows) -> Counts:
        if chunk.number in self.again or not self.parts.path(chunk).exists():
            kept = self.kept.answers(chunk) if chunk.number in self.kept.unsure else {}
            for design, row in kept.items():  # another runner may have had more luck
                for mine, theirs in zip(rows, row, strict=True):
                    mine[design - chunk.start] = theirs[0]
            write_part(self.parts, chunk, rows)
        forget_rows(self.parts, chunk)
        return counts_of(rows.status, rows.reason)
