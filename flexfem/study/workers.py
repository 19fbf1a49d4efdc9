"""Worker processes on this machine by loky or on a cluster by Dask, and versions of the software they use."""

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
CONNECT = 10.0  # s, for a scheduler to respond
POLL = 0.25  # s
HELD = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Failure(NamedTuple):
    """A task without a result: "time limit"; "crashed", its worker died; or "failed", it raised an error."""

    status: str
    reason: str


class Workers:
    """A number of processes that compute tasks; processes that die or exceed a limit are replaced.

    With the address of a Dask scheduler, its workers compute; they share a folder with this machine. Raises BadInput
    where no scheduler responds, or a worker has other versions.
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
            with suppress(Exception):  # the scheduler may have ended
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
        next_task : returns the arguments of the next task, or None; called after every result, when tasks may be added.
        limit : seconds that a task may take.

        Raises
        ------
        BadInput, ComputationFailed : raised by the function; or workers cannot start.

        Notes
        -----
        A worker that dies breaks the pool. The tasks that were running are repeated one at a time; a task that breaks
        the pool alone has crashed.
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
            finished, broken = list[tuple[tuple[Any, ...], Any]](), list[tuple[Any, ...]]()
            for future in wait(running, POLL, FIRST_COMPLETED).done:
                task, _ = running.pop(future)
                try:
                    finished.append((task, future.result()))
                except BrokenProcessPool:
                    broken.append(task)
                except (BadInput, ComputationFailed):
                    raise
                except Exception as error:
                    if type(error).__name__ == "KilledWorker":
                        finished.append((task, Failure("crashed", "the worker died")))
                        continue
                    reason = one_line(f"{type(error).__name__}: {' '.join(str(error).split())}", 200)
                    raise ComputationFailed(f"a worker failed: {reason}") from None
            late = [future for future, (_, end) in running.items() if time.monotonic() > end]
            for future in late:
                task, _ = running.pop(future)
                finished.append((task, Failure("time limit", f"no result in {limit(task):g} s")))
            if broken or late:
                lost = [*broken, *(task for task, _ in running.values())]
                running.clear()
                self._kill()
                if late:
                    again.extend(lost)
                elif suspects:
                    finished += [(task, Failure("crashed", "the worker died")) for task in lost]
                else:
                    suspects.extend(lost)
            if suspects and any(task is suspects[0] for task, _ in finished):
                suspects.popleft()
            yield from finished

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
        """Start the processes, and wait until one of them responds."""
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
            raise ComputationFailed("worker processes end at their start: is flexfem installed for them?") from None
        return self._pool

    def _kill(self) -> None:
        """End all processes and their children."""
        pool, self._pool = self._pool, None
        if pool is not None and self._client is not None:
            with suppress(Exception):  # nannies start new workers
                self._client.restart(timeout=LOADING)
        elif pool is not None:
            pool.shutdown(wait=True, kill_workers=True)


def client_of(address: str) -> Any:
    """Return a client of a Dask scheduler whose workers have the versions of this process. Raises BadInput."""
    if not isinstance(address, str) or ":" not in address:
        raise BadInput(f"--scheduler {one_line(str(address), 200)}: expected host:port of a scheduler with workers")
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise BadInput(f"--scheduler {address}: Dask is not installed, expected flexfem[dask]") from None
    try:
        client: Any = distributed.Client(address, timeout=CONNECT, set_as_default=False)
        client.wait_for_workers(1, timeout=CONNECT)
    except (OSError, RuntimeError, ValueError) as error:
        reason = one_line(str(error), 200) or f"no response in {CONNECT:g} s"
        raise BadInput(f"--scheduler {address}: expected host:port of a scheduler with workers: {reason}") from None
    try:
        client.run(require_same_versions, versions_of(True), True)
    except BadInput:
        client.close()
        raise
    return client


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
def versions_of(meshed: bool) -> Mapping[str, str]:
    """Return the versions of the software on which results depend, with that of finite elements where `meshed`.

    These are versions of flexfem and the libraries, a hash of the files of flexfem in a checkout or an editable
    installation, and a hash of the file that the user gives by `--with`.
    """
    versions = {"python": ".".join(map(str, sys.version_info[:2]))}
    of_elements = ("gmsh", "scikit-fem", "cvxopt", "pypardiso") if meshed else ()
    for name in ("flexfem", "numpy", "scipy", "shapely", *of_elements):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "none"
    if (PACKAGE.parent / "pyproject.toml").is_file():
        versions["sources"] = digest(dict(manifest()))[:16]
    if own_hash():
        versions["with"] = own_hash()[:16]
    return MappingProxyType(versions)


def require_same_versions(expected: Mapping[str, str], meshed: bool) -> None:
    """Raise BadInput in a worker whose versions of flexfem or libraries are not those of the runner."""
    actual = versions_of(meshed)
    for name in sorted({*actual, *expected}):
        if actual.get(name) != expected.get(name):
            raise BadInput(
                f"a worker has {name} {actual.get(name, 'none')}, the runner {expected.get(name, 'none')}, "
                "expected the same versions everywhere"
            )
