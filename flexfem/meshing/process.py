"""gmsh in separate processes, which can hang or crash alone.

A process serves one request after the other, since starting it takes longer than most meshes. It
runs `serve.main`, which reads pickled requests from standard input and writes pickled results to
standard output.
"""

from __future__ import annotations

import atexit
import os
import pickle
import time
from contextlib import suppress
from subprocess import PIPE, Popen
from tempfile import TemporaryFile
from threading import Thread
from typing import Any

from flexfem.meshing.requests import Request
from flexfem.refused import ComputationFailed
from flexfem.sources import child_command

POLL = 0.25  # s between two polls of a process
# s between two polls; a longer gap means that this process or the machine was suspended
LONGEST_GAP = 1.0
MOST_KEPT = 10_000_000  # bytes of meshes; after a larger result the process ends to free its memory


class Limit:
    """Seconds `left` for a sequence of tasks.

    Of a gap between two polls at most `LONGEST_GAP` counts.
    """

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def start(self) -> None:
        """Start the clock."""
        self._last = time.monotonic()

    def update(self) -> None:
        """Subtract the time since the last poll."""
        before = self._last
        self._last = time.monotonic()
        self.left -= min(self._last - before, LONGEST_GAP)


class MeshTimeout(ComputationFailed):
    """gmsh exceeded its time limit and was stopped."""


def run_mesher(request: Request, time_limit: float | Limit) -> Any:
    """Serve a request in a process and return its result.

    Raises ComputationFailed when it fails, MeshTimeout when it takes more than `time_limit` s.
    """
    while _idle and not _idle[-1].alive:
        _idle.pop().end()
    process = _idle.pop() if _idle else _Process()
    try:
        limit = time_limit if isinstance(time_limit, Limit) else Limit(time_limit)
        result = process.run(request, limit)
    except BaseException:  # Ctrl-C too: a late result would be taken for that of the next request
        process.end()
        raise
    size = sum(array.nbytes for array in result.values()) if isinstance(result, dict) else 0
    if size > MOST_KEPT:
        process.end()
    else:
        _idle.append(process)
    return result


class _Process:
    """A process that runs `main`."""

    def __init__(self) -> None:
        self._stderr = TemporaryFile()  # noqa: SIM115  open as long as the process
        self._child = Popen(
            child_command("flexfem.meshing.serve"), stdin=PIPE, stdout=PIPE, stderr=self._stderr
        )

    @property
    def alive(self) -> bool:
        return self._child.poll() is None

    def run(
        self,
        request: Request,
        limit: Limit,
    ) -> Any:
        """Serve a request as `run_mesher`; time while flexfem is suspended does not count."""
        self._request = pickle.dumps(request)
        received = list[Any]()
        exchange = Thread(
            target=self._exchange,
            args=(received,),
            daemon=True,
        )
        allowed = limit.left
        exchange.start()
        limit.start()
        while exchange.is_alive():
            exchange.join(min(POLL, max(limit.left, 0.0)))
            limit.update()
            if exchange.is_alive() and limit.left <= 0:
                raise MeshTimeout(f"gmsh was stopped: not done within {allowed:g} s")
        if not received:
            raise self._failure()
        return received[0]

    def _exchange(self, received: list[Any]) -> None:
        """Send the request and append the result, or nothing if the process ends early."""
        assert self._child.stdin and self._child.stdout
        with suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
            self._child.stdin.write(self._request)
            self._child.stdin.flush()
            self._request = b""
            received.append(pickle.load(self._child.stdout))

    def _failure(self) -> ComputationFailed:
        """Return the error of the ended process, with the last line of its standard error."""
        code = self._child.wait()
        self._stderr.seek(0)
        lines = self._stderr.read().decode(errors="replace").strip().splitlines()
        return ComputationFailed(lines[-1] if lines else f"gmsh ended with exit code {code}")

    def end(self) -> None:
        self._child.kill()
        with self._child, self._stderr:
            pass


_idle: list[_Process] = []


@atexit.register
def end_processes() -> None:
    """End the idle processes."""
    while _idle:
        _idle.pop().end()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # they belong to the parent
