"""Worker processes of this machine by loky or of a cluster by Dask, their tasks, and versions that decide results."""

from __future__ import annotations

import importlib
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
CONNECT = 10.0  # s, for a scheduler to answer
POLL = 0.25  # s
HELD = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Failure(NamedTuple):
    """A task without a result: "time limit"; "crashed", it ended its worker; or "failed", an error of its own."""

    status: str
    reason: str


class Workers:
    """So many processes that compute tasks; those that die or exceed a limit are replaced, the task at fault named.

    With the address of a Dask scheduler its workers compute; they have a folder in common with this machine. Raises
    BadInput where none answers, or a worker has other versions.
    """

    def __init__(self, count: int, scheduler: str | None = None) -> None:
        self._count, self._client = count, None if scheduler is None else client_of(scheduler)
        self._pool: Any = None
        if self._client is not None:
            self._count = sum(self._client.nthreads().values())

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self._kill()
        if self._client is not None:
            with suppress(Exception):  # a scheduler that is gone
                self._client.close(timeout=CONNECT)

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
        next_task : the arguments of the next task, or None; asked after every result, so that tasks may be added.
        limit : seconds that a task may take.

        Raises
        ------
        BadInput, ComputationFailed : the function raises it; or workers cannot start.

        Notes
        -----
        A worker that dies breaks the pool. The tasks that were computed then are tried again one at a time; a task
        that breaks the pool a second time, alone, has failed.
        """
        running: dict[Future[Any], tuple[tuple[Any, ...], float]] = {}
        suspects, again = deque[tuple[Any, ...]](), deque[tuple[Any, ...]]()
        while True:
            while len(running) < (1 if suspects else self._count):
                task = suspects[0] if suspects else again.popleft() if again else next_task()
                if task is None:
                    break
                running[self._submit(function, task)] = task, time.monotonic() + limit(task)
            if not running:
                return
            found, broken = list[tuple[tuple[Any, ...], Any]](), list[tuple[Any, ...]]()
            for future in wait(running, POLL, FIRST_COMPLETED).done:
                task, _ = running.pop(future)
                try:
                    found.append((task, future.result()))
                except BrokenProcessPool:
                    broken.append(task)
                except (BadInput, ComputationFailed):
                    raise
                except Exception as error:
                    if type(error).__name__ == "KilledWorker":
                        found.append((task, Failure("crashed", "the worker died")))
                        continue
                    reason = one_line(f"{type(error).__name__}: {' '.join(str(error).split())}", 200)
                    raise ComputationFailed(f"a worker cannot answer: {reason}") from None
            late = [future for future, (_, end) in running.items() if time.monotonic() > end]
            for future in late:
                task, _ = running.pop(future)
                found.append((task, Failure("time limit", f"no answer in {limit(task):g} s")))
            if broken or late:
                lost = [*broken, *(task for task, _ in running.values())]
                running.clear()
                self._kill()
                if late:
                    again.extend(lost)
                elif suspects:
                    found += [(task, Failure("crashed", "the worker died")) for task in lost]
                else:
                    suspects.extend(lost)
            if suspects and any(task is suspects[0] for task, _ in found):
                suspects.popleft()
            yield from found

    def _submit(self, function: Callable[..., Any], task: tuple[Any, ...]) -> Future[Any]:
        try:
            with signals_held():
                return (self._pool or self._start()).submit(function, *task)  # type: ignore[no-any-return]
        except BrokenProcessPool as error:
            broken = Future[Any]()
            broken.set_exception(error)
            return broken
        except (OSError, RuntimeError) as error:
            raise ComputationFailed(f"worker processes cannot be started: {one_line(str(error), 200)}") from None

    def _start(self) -> Any:
        """Start the processes, and wait until one of them answers."""
        if self._client is not None:
            self._pool = self._client.get_executor(pure=False, retries=0)
            return self._pool
        from loky import ProcessPoolExecutor

        about = {"env": ONE_THREAD, "initializer": _begin, "initargs": (os.getpid(),)}
        self._pool = ProcessPoolExecutor(self._count, timeout=None, **about)
        try:
            self._pool.submit(os.getpid).result(LOADING)
        except (BrokenProcessPool, TimeoutError):
            self._kill()
            raise ComputationFailed("worker processes end before they begin: is flexfem installed for them?") from None
        return self._pool

    def _kill(self) -> None:
        """End all processes, with those that they have started."""
        pool, self._pool = self._pool, None
        if pool is not None and self._client is not None:
            with suppress(Exception):  # nannies start new workers
                self._client.restart(timeout=LOADING)
        elif pool is not None:
            pool.shutdown(wait=True, kill_workers=True)


def client_of(address: str) -> Any:
    """A client of a Dask scheduler whose workers have the versions of this process. Raises BadInput."""
    if not isinstance(address, str) or ":" not in address:
        raise BadInput(f"--scheduler {one_line(str(address), 200)}: expected host:port of one with workers")
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise BadInput(f"--scheduler {address}: Dask is not installed, expected flexfem[dask]") from None
    try:
        client: Any = distributed.Client(address, timeout=CONNECT, set_as_default=False)
        client.wait_for_workers(1, timeout=CONNECT)
    except (OSError, RuntimeError, ValueError) as error:
        reason = one_line(str(error), 200) or f"no answer in {CONNECT:g} s"
        raise BadInput(f"--scheduler {address}: expected host:port of one with workers: {reason}") from None
    try:
        client.run(require_same_versions, versions_of(True), True)
    except BadInput:
        client.close()
        raise
    return client


def _begin(parent: int) -> None:
    """In a worker: leave Ctrl-C to the parent, print nothing, and end with the parent."""
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
    """Hold back Ctrl-C and the like while processes start: they ignore it a moment later, and their pool is whole."""
    if sys.platform == "win32" or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, HELD)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@lru_cache
def versions_of(meshed: bool) -> Mapping[str, str]:
    """Versions by name of what decides results, `meshed` when finite elements take part.

    Those of flexfem and the libraries; of a checkout or an editable installation of flexfem also a hash of its files;
    and a hash of the file that the user gives by `--with`.
    """
    found = {"python": ".".join(map(str, sys.version_info[:2]))}
    for name in ("flexfem", "numpy", "scipy", "shapely", *(("gmsh", "scikit-fem", "cvxopt") if meshed else ())):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    if (PACKAGE.parent / "pyproject.toml").is_file():
        found["sources"] = digest(dict(manifest()))[:16]
    if own_hash():
        found["with"] = own_hash()[:16]
    return MappingProxyType(found)


def require_same_versions(expected: Mapping[str, str], meshed: bool) -> None:
    """In a worker: raise BadInput where it has another flexfem, or other libraries, than the one who asks."""
    own = versions_of(meshed)
    for name in sorted({*own, *expected}):
        if own.get(name) != expected.get(name):
            raise BadInput(
                f"a worker has {name} {own.get(name, 'none')}, the runner {expected.get(name, 'none')}, "
                "expected the same versions everywhere"
            )
