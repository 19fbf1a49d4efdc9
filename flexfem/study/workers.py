"""Worker processes on this machine, and versions of the software that they use."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import Any, NamedTuple

from flexfem.files.refusals import one_line
from flexfem.files.writing import digest
from flexfem.refused import BadInput, ComputationFailed
from flexfem.sources import ONE_THREAD, PACKAGE, manifest, own_hash

LOADING = 300.0  # s, for the first worker to start on a busy machine
POLL = 0.25  # s
HELD = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Failure(NamedTuple):
    """A task without a result: "time limit"; "crashed", its worker died; or "failed", it raised an error."""

    status: str
    reason: str


CRASHED = Failure("crashed", "the worker died")


class Workers:
    """A number of processes that compute tasks; a process that dies or exceeds a limit is replaced."""

    def __init__(self, count: int) -> None:
        self._count, self._idle, self._ready = count, list[Any](), False

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._idle:
            _end(process)

    def results(
        self,
        function: Callable[..., Any],
        next_task: Callable[[], tuple[Any, ...] | None],
        limit: Callable[[tuple[Any, ...]], float],
    ) -> Iterator[tuple[tuple[Any, ...], Any]]:
        """Compute `function(*task)`, and yield each task with its result or a `Failure` in the order of completion.

        Parameters
        ----------
        function : importable by the workers.
        next_task : returns the arguments of the next task, or None; called after every result, when tasks may be added.
        limit : seconds that a task may take.

        Raises
        ------
        BadInput, ComputationFailed : raised by the function; or workers cannot start.

        Notes
        -----
        A task whose process dies is repeated once, because the process may have been killed from outside.
        """
        running: dict[Future[Any], tuple[Any, tuple[Any, ...], float]] = {}
        again, repeated = deque[tuple[Any, ...]](), list[tuple[Any, ...]]()
        try:
            while True:
                while len(running) < self._count and (task := again.popleft() if again else next_task()) is not None:
                    process = self._idle.pop() if self._idle else self._started()
                    running[_submitted(process, function, task)] = process, task, time.monotonic() + limit(task)
                if not running:
                    return
                done = wait(running, POLL, FIRST_COMPLETED).done
                late = {future for future, (*_, end) in running.items() if time.monotonic() > end} - done
                for future in (*done, *late):
                    process, task, _ = running[future]
                    overdue = Failure("time limit", f"no result in {limit(task):g} s")
                    result = overdue if future in late else _result(future)
                    del running[future]
                    if result is overdue or result is CRASHED:
                        _end(process)
                    else:
                        self._idle.append(process)
                    if result is CRASHED and not any(task is each for each in repeated):
                        again.append(task)
                        repeated.append(task)
                    else:
                        yield task, result
        finally:
            for process, *_ in running.values():
                _end(process)

    def _started(self) -> Any:
        """Start a process as a pool of its own, so that its end stops no other; wait until the first one responds."""
        from loky import ProcessPoolExecutor

        process = ProcessPoolExecutor(1, timeout=None, env=ONE_THREAD, initializer=_begin, initargs=(os.getpid(),))
        if not self._ready and _result(_submitted(process, os.getpid, ()), LOADING) is CRASHED:
            _end(process)
            raise ComputationFailed("worker processes end at their start: is flexfem installed for them?")
        self._ready = True
        return process


def _submitted(process: Any, function: Callable[..., Any], task: tuple[Any, ...]) -> Future[Any]:
    try:
        with signals_held():
            return process.submit(function, *task)  # type: ignore[no-any-return]
    except BrokenProcessPool as error:
        broken = Future[Any]()
        broken.set_exception(error)
        return broken
    except (OSError, RuntimeError) as error:
        raise ComputationFailed(f"worker processes cannot be started: {one_line(str(error), 200)}") from None


def _result(future: Future[Any], seconds: float | None = None) -> Any:
    """Return the result of a task, or `CRASHED` where its process died or does not respond."""
    try:
        return future.result(seconds)
    except (BrokenProcessPool, TimeoutError):
        return CRASHED
    except (BadInput, ComputationFailed):
        raise
    except Exception as error:
        reason = one_line(f"{type(error).__name__}: {' '.join(str(error).split())}", 200)
        raise ComputationFailed(f"a worker failed: {reason}") from None


def _end(process: Any) -> None:
    """End a process and its children."""
    process.shutdown(wait=True, kill_workers=True)


def _begin(parent: int) -> None:
    """Initialise a worker: it ignores Ctrl-C, prints nothing and ends when its parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, HELD)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while sys.platform == "win32" or os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


@contextmanager
def signals_held() -> Iterator[None]:
    """Block Ctrl-C and similar signals while processes start, until they ignore them and the pool is complete."""
    if sys.platform == "win32" or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, HELD)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@lru_cache
def versions_of() -> Mapping[str, str]:
    """Return the versions of the software on which results depend.

    These are versions of flexfem and the libraries, a hash of the files of flexfem in a checkout or an editable
    installation, and a hash of the file that the user gives by `--with`.
    """
    versions = {"python": ".".join(map(str, sys.version_info[:2]))}
    for name in ("flexfem", "numpy", "scipy", "shapely", "gmsh", "scikit-fem", "cvxopt", "pypardiso"):
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    if (PACKAGE.parent / "pyproject.toml").is_file():
        versions["sources"] = digest(dict(manifest()))[:16]
    if own_hash():
        versions["with"] = own_hash()[:16]
    return MappingProxyType(versions)


def require_same_versions(expected: Mapping[str, str]) -> None:
    """Raise BadInput in a worker whose versions of flexfem or libraries are not those of the runner."""
    own = versions_of()
    for name in {**expected, **own}:
        if own.get(name) != expected.get(name):
            said = f"a worker has {name} {own.get(name, 'none')}, the runner {expected.get(name, 'none')}"
            raise BadInput(f"{said}, expected the same versions everywhere")
