"""gmsh in processes of its own, which can hang or crash without taking flexfem along.

A process meshes one list of jobs after the other: starting it takes longer than most meshes.
"""

from __future__ import annotations

import atexit
import os
import pickle
import time
from collections.abc import Sequence
from contextlib import suppress
from subprocess import PIPE, Popen
from tempfile import TemporaryFile
from threading import Thread
from typing import TypeAlias

from flexfem.arrays import AnyArray
from flexfem.fem.mesher import Request
from flexfem.refused import ComputationFailed, SourcesChanged
from flexfem.sources import CHANGED, child_command, manifest

LOOK = 0.25  # s between two looks at a process
STEP = 1.0  # s; a longer gap between two looks is taken for a stop of whoever looks: of the machine, or of the job
MOST_KEPT = 10_000_000  # bytes of meshes; the process of a larger answer ends, so that its memory is free again

Made: TypeAlias = dict[str, AnyArray]


class Stopwatch:
    """Seconds of the monotonic clock, of every gap between two looks `STEP` at most; look more often than that."""

    def __init__(self) -> None:
        self._seen = time.monotonic()

    def step(self) -> float:
        """Seconds since the look before."""
        before, self._seen = self._seen, time.monotonic()
        return min(self._seen - before, STEP)


class Limit:
    """Seconds that are `left` for work of several pieces, each of which takes off what it has used."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds


class MeshTimeout(ComputationFailed):
    """gmsh was stopped because it took too long."""


def run_mesher(job: Request, time_limit: float | Limit) -> Made:
    """Mesh, or write a mesh or a solid; as `run_jobs`."""
    return run_jobs([job], time_limit)[0]


def run_jobs(jobs: Sequence[Request], time_limit: float | Limit) -> list[Made]:
    """What some tasks make, one after the other in one process.

    Raises ComputationFailed when it fails, MeshTimeout when it is still busy after `time_limit` s, SourcesChanged when
    its sources are not those that this process began with.
    """
    process = _idle()
    try:
        made = process.answer(list(jobs), time_limit if isinstance(time_limit, Limit) else Limit(time_limit))
    except BaseException:  # Ctrl-C too: what it still answers would be taken for the answer to the next question
        process.end()
        raise
    if sum(array.nbytes for each in made for array in each.values()) > MOST_KEPT:
        process.end()
    else:
        _waiting.append(process)
    return made


class _Process:
    """A running `mesher.main`."""

    def __init__(self) -> None:
        self._said = TemporaryFile()  # noqa: SIM115  open as long as the process
        self._child = Popen(child_command("flexfem.fem.mesher"), stdin=PIPE, stdout=PIPE, stderr=self._said)
        self._request = pickle.dumps(dict(manifest()))

    @property
    def alive(self) -> bool:
        return self._child.poll() is None

    def answer(self, jobs: list[Request], limit: Limit) -> list[Made]:
        """As `run_jobs`; no stop of flexfem counts for the limit."""
        self._request += pickle.dumps(jobs)
        found: list[list[Made]] = []
        asking, watch, allowed = Thread(target=self._ask, args=(found,), daemon=True), Stopwatch(), limit.left
        asking.start()
        while asking.is_alive():
            asking.join(min(LOOK, max(limit.left, 0.0)))
            limit.left -= watch.step()
            if asking.is_alive() and limit.left <= 0:
                raise MeshTimeout(f"gmsh was stopped: not done within {allowed:g} s")
        if not found:
            raise self._failure()
        return found[0]

    def _ask(self, found: list[list[Made]]) -> None:
        """Ask and wait, in a thread; leaves nothing when the process ends before it has answered."""
        assert self._child.stdin and self._child.stdout
        with suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
            self._child.stdin.write(self._request)
            self._child.stdin.flush()
            self._request = b""
            found.append(pickle.load(self._child.stdout))

    def _failure(self) -> ComputationFailed | SourcesChanged:
        """Why the process ended: the last line that it said."""
        code = self._child.wait()
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"gmsh ended with exit code {code}"
        return (SourcesChanged if code == CHANGED else ComputationFailed)(reason)

    def end(self) -> None:
        self._child.kill()
        with self._child, self._said:
            pass


_waiting: list[_Process] = []


def _idle() -> _Process:
    """A process that waits for jobs, or a new one."""
    while _waiting:
        process = _waiting.pop()
        if process.alive:
            return process
        process.end()
    return _Process()


@atexit.register
def end_processes() -> None:
    """End the processes that wait for jobs."""
    while _waiting:
        _waiting.pop().end()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_waiting.clear)  # they are the parent's
