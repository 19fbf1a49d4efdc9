"""Worker processes behind `concurrent.futures`: loky on this machine, Dask on a cluster; and what decides results."""

from __future__ import annotations

import hashlib
import importlib
import logging
import os
import re
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, NamedTuple

from flexfem.files.refusals import one_line
from flexfem.own import own_hash
from flexfem.refused import BadInput, ComputationFailed

PACKAGE = Path(__file__).parents[1]
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
CONNECT = 10.0  # s, for a scheduler to answer
LOADING = 300.0  # s, for the first worker to start on a busy machine
POLL = 0.25  # s
AHEAD = 2  # tasks a thread of a cluster, so that none waits for the network
HELD = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Failure(NamedTuple):
    """A task without a result: "time limit", or "crashed" where it ended its worker."""

    status: str
    reason: str


class Workers:
    """Processes that compute tasks; those that die or exceed a limit are replaced, and the task at fault is named.

    Parameters
    ----------
    count : int
        Processes of this machine.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers compute instead. They need no folder in common with this machine.

    Raises
    ------
    BadInput
        The scheduler does not answer.
    """

    def __init__(self, count: int, scheduler: str | None = None, say: Callable[[str], object] = lambda text: None):
        self._count, self._where = count, f"--scheduler {scheduler}: " if scheduler else ""
        self._client: Any = _client(scheduler) if scheduler else None
        self._executor: Executor | None = None
        if self._client is not None:
            self._executor = self._client.get_executor(pure=False, retries=0)
            if not self._client.nthreads():
                say(f"no worker of {scheduler} is running: waiting for one")

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def width(self) -> int:
        """Tasks that keep all workers busy."""
        return self._count if self._client is None else max(1, AHEAD * sum(self._client.nthreads().values()))

    def results(
        self,
        function: Callable[..., Any],
        next_task: Callable[[], tuple[Any, ...] | None],
        limit: Callable[[tuple[Any, ...]], float],
    ) -> Iterator[tuple[tuple[Any, ...], Any]]:
        """Compute `function(*task)`, and yield each task with its result or a `Failure` in the order of completion.

        Parameters
        ----------
        function : callable
            Importable by the workers.
        next_task : callable
            The arguments of the next task, or None; asked again after every result, so that tasks may be added.
        limit : callable
            Seconds that a task may take on this machine. On a cluster only gmsh has a limit, by its own process.

        Raises
        ------
        ComputationFailed
            Workers cannot start, or the scheduler is lost.

        Notes
        -----
        A worker that dies breaks the pool. The tasks that were computed then are tried again one at a time; a task
        that breaks the pool a second time, alone, has failed.
        """
        running: dict[Future[Any], tuple[tuple[Any, ...], float]] = {}
        suspects, again = deque[tuple[Any, ...]](), deque[tuple[Any, ...]]()
        while True:
            while len(running) < (1 if suspects else self.width):
                task = suspects[0] if suspects else again.popleft() if again else next_task()
                if task is None:
                    break
                running[self._submit(function, task)] = task, time.monotonic() + limit(task)
                if suspects:
                    break
            if not running:
                return
            found, broken = list[tuple[tuple[Any, ...], Any]](), list[tuple[Any, ...]]()
            for future in wait(running, POLL, FIRST_COMPLETED).done:
                task, _ = running.pop(future)
                try:
                    found.append((task, self._result(future)))
                except BrokenProcessPool:
                    broken.append(task)
            late = [future for future, (_, end) in running.items() if time.monotonic() > end and self._client is None]
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
                    lost = []
            if suspects and any(task is suspects[0] for task, _ in found):
                suspects.popleft()
            yield from found

    def _submit(self, function: Callable[..., Any], task: tuple[Any, ...]) -> Future[Any]:
        try:
            with signals_held():
                return (self._executor or self._start()).submit(function, *task)
        except BrokenProcessPool as error:
            broken = Future[Any]()
            broken.set_exception(error)
            return broken
        except (OSError, RuntimeError, CancelledError) as error:
            raise ComputationFailed(self._lost(error)) from None

    def _start(self) -> Executor:
        """Start the processes of this machine, and wait until one of them answers."""
        from loky import ProcessPoolExecutor

        about = {"env": ONE_THREAD, "initializer": _begin, "initargs": (os.getpid(),)}
        pool: Executor = ProcessPoolExecutor(self._count, timeout=None, **about)
        self._executor = pool
        try:
            pool.submit(os.getpid).result(LOADING)
        except (BrokenProcessPool, TimeoutError):
            self._kill()
            raise ComputationFailed("worker processes end before they begin: is flexfem installed for them?") from None
        return pool

    def _result(self, future: Future[Any]) -> Any:
        """The result of a task that is done, or the `Failure` of one that ended several workers of a cluster."""
        try:
            return future.result()
        except (BrokenProcessPool, BadInput, ComputationFailed):
            raise
        except CancelledError as error:
            raise ComputationFailed(self._lost(error)) from None
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                return Failure("crashed", "the worker died")
            if self._client is not None and self._client.status not in ("running", "connecting"):
                raise ComputationFailed(self._lost(error)) from None
            reason = one_line(f"{type(error).__name__}: {' '.join(str(error).split())}", 200)
            raise ComputationFailed(f"{self._where}a worker cannot answer: {reason}") from None

    def _lost(self, error: BaseException) -> str:
        if self._client is None:
            return f"worker processes cannot be started: {one_line(str(error), 200)}"
        return f"{self._where}lost; parts are kept, run again to go on"

    def _kill(self) -> None:
        """End all processes of this machine, with those that they have started."""
        if self._client is None and self._executor is not None:
            executor, self._executor = self._executor, None
            executor.shutdown(wait=True, kill_workers=True)  # type: ignore[call-arg]

    def close(self) -> None:
        """End the workers of this machine at once; leave a cluster."""
        self._kill()
        if self._client is not None:
            with suppress(Exception):  # a scheduler that is gone
                self._client.close(timeout=5.0)


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


def _client(address: str) -> Any:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise BadInput(f"--scheduler {address}: Dask is not installed, expected flexfem[dask]") from None
    if not re.fullmatch(r"((tcp|ws)://)?[^/\s]+:[0-9]{1,5}", address):
        raise BadInput(f"--scheduler {address}, expected host:port, such as tcp://127.0.0.1:8786")
    for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # a lost scheduler is reported in one line
    try:
        return distributed.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, RuntimeError, ValueError, CancelledError) as error:
        reason = one_line(str(error), 200) or f"no word in {CONNECT:g} s"
        raise BadInput(f"--scheduler {address}: no scheduler answers there: {reason}") from None


@lru_cache
def versions_of(meshed: bool) -> Mapping[str, str]:
    """Versions by name of what decides results, `meshed` when finite elements take part.

    Those of flexfem and the libraries; of a checkout or an editable installation of flexfem also a hash of its files;
    and a hash of the file that the user gives by `--with`.
    """
    names = ("flexfem", "numpy", "scipy", "shapely", *(("gmsh", "scikit-fem", "cvxopt") if meshed else ()))
    found = {"python": ".".join(map(str, sys.version_info[:2]))} | {name: _version(name) for name in names}
    if (PACKAGE.parent / "pyproject.toml").is_file():
        found["sources"] = sources_hash()
    if own_hash():
        found["with"] = own_hash()[:16]
    return MappingProxyType(found)


def sources_hash(package: Path = PACKAGE) -> str:
    """First 16 digits of the SHA-256 of the sources and data files of a package."""
    total = hashlib.sha256()
    for path in sorted((*package.rglob("*.py"), *(package / "data").glob("*.[jt]*"))):
        total.update(f"{path.relative_to(package).as_posix()}\0".encode() + path.read_bytes())
    return total.hexdigest()[:16]


def require_same_versions(expected: Mapping[str, str], meshed: bool) -> None:
    """In a worker: raise BadInput where it has another flexfem, or other libraries, than the one who asks."""
    own = versions_of(meshed)
    for name in sorted({*own, *expected}):
        if own.get(name) != expected.get(name):
            raise BadInput(
                f"a worker has {name} {own.get(name, 'none')}, the runner {expected.get(name, 'none')}, "
                "expected the same versions everywhere"
            )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
