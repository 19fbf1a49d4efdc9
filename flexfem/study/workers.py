"""Worker processes on this machine, other executors such as a Dask cluster, and versions of the
software they use.
"""

from __future__ import annotations

import importlib
import logging
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from flexfem.files.refusals import one_line
from flexfem.files.writing import digest
from flexfem.refused import BadInput, ComputationFailed
from flexfem.sources import ONE_THREAD, PACKAGE, manifest, own_hash

LOADING = 300.0  # s, for the first worker to start on a busy machine
CONNECTING = 10.0  # s, for a scheduler to respond
# s without a result besides the time limit of a task; Dask notices a paused worker after 300 s
SILENCE = 900.0
# tasks that an executor has at a time: some for every worker, and few enough for its memory
SUBMITTED = 1024
KILLED_WORKER = "KilledWorker"  # error of Dask on a task during which several workers have died
POLL = 0.25  # s
HELD = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Failure(NamedTuple):
    """A task without a result: "time limit"; "crashed", its worker died; or "failed", it raised an
    error.
    """

    status: str
    reason: str


OVERDUE = "time limit"  # status of a task that takes too long
CRASHED = Failure("crashed", "the worker died")
_ALONE = threading.Lock()


class _Running(NamedTuple):
    """A task in a process, and the time at which it is overdue, s."""

    process: Any
    task: tuple[Any, ...]
    end: float


class Workers:
    """A number of processes that compute tasks; a process that dies or exceeds a limit is replaced.

    They have the folders of this machine (`here`), and therefore write what they compute.
    """

    here = True

    def __init__(self, count: int) -> None:
        self._count = count
        self._idle = list[Any]()
        self._ready = False

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
        """Compute `function(*task)`, and yield each task with its result or a `Failure` in the
        order of completion.

        Parameters
        ----------
        function : importable by the workers.
        next_task : returns the arguments of the next task, or None; called after every result, when
        tasks may be added.
        limit : seconds that a task may take.

        Raises
        ------
        BadInput, ComputationFailed : raised by the function; or workers cannot start.

        Notes
        -----
        A task whose process dies is repeated once, because the process may have been killed from
        outside."""
        running: dict[Future[Any], _Running] = {}
        again = deque[tuple[Any, ...]]()
        repeated = list[tuple[Any, ...]]()
        try:
            while True:
                while len(running) < self._count:
                    task = again.popleft() if again else next_task()
                    if task is None:
                        break
                    process = self._idle.pop() if self._idle else self._started()
                    end = time.monotonic() + limit(task)
                    running[_submitted(process, function, task)] = _Running(process, task, end)
                if not running:
                    return
                for future in _finished(running):
                    process, task, _ = running[future]
                    result = _result(future) if future.done() else _overdue(limit(task))
                    del running[future]
                    self._release(process, result)
                    if result is CRASHED and not any(task is each for each in repeated):
                        again.append(task)
                        repeated.append(task)
                    else:
                        yield task, result
        finally:
            for process, *_ in running.values():
                _end(process)

    def _release(
        self,
        process: Any,
        result: Any,
    ) -> None:
        """Keep the process of a result for another task, or end it where the task did not end."""
        if isinstance(result, Failure) and result.status in (CRASHED.status, OVERDUE):
            _end(process)
        else:
            self._idle.append(process)

    def _started(self) -> Any:
        """Start a process as a pool of its own, so that its end stops no other; wait until the
        first one responds.
        """
        from loky import ProcessPoolExecutor

        process = ProcessPoolExecutor(
            1, timeout=None, env=ONE_THREAD, initializer=_begin, initargs=(os.getpid(),)
        )
        if not self._ready and _result(_submitted(process, os.getpid, ()), LOADING) is CRASHED:
            _end(process)
            raise ComputationFailed(
                "worker processes end at their start: is flexfem installed for them?"
            )
        self._ready = True
        return process


class ExecutorWorkers:
    """The workers of any executor of `concurrent.futures`, on any machine; they return what they
    compute.

    An executor cannot end a task that hangs. It is expected to repeat tasks of workers that die or
    no longer respond, as Dask does."""

    here = False

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def results(
        self,
        function: Callable[..., Any],
        next_task: Callable[[], tuple[Any, ...] | None],
        limit: Callable[[tuple[Any, ...]], float],
    ) -> Iterator[tuple[tuple[Any, ...], Any]]:
        """Compute `function(*task)`, and yield each task with its result or a `Failure` in the
        order of completion.

        The arguments are those of `Workers.results`. A task may wait for a worker while others are
        computed, so its limit counts from the last result of any task.

        Raises
        ------
        BadInput, ComputationFailed : raised by the function; a worker has other versions; the
        executor has lost its
            workers; or no result arrives in `SILENCE` seconds besides the limit.
        """
        running: dict[Future[Any], tuple[Any, ...]] = {}
        versions = dict(versions_of())
        silent = 0.0  # s, counted in polls: a pause of this process is no silence of the executor
        try:
            while True:
                while len(running) < SUBMITTED:
                    task = next_task()
                    if task is None:
                        break
                    running[self._submitted(versions, function, task)] = task
                if not running:
                    return
                done = wait(running, POLL, FIRST_COMPLETED).done
                for future in done:
                    yield running.pop(future), _executed(future)
                silent = 0.0 if done else silent + POLL
                longest = SILENCE + max(map(limit, running.values()), default=0.0)
                if silent > longest:
                    about = f"no result of {len(running)} tasks in {longest:g} s"
                    raise ComputationFailed(
                        f"{about}: does the executor have workers, and do they respond?"
                    )
        finally:
            for future in running:
                future.cancel()

    def _submitted(
        self, versions: Mapping[str, str], function: Callable[..., Any], task: tuple[Any, ...]
    ) -> Any:
        try:
            return self._executor.submit(compute_alone, versions, function, *task)
        except (BrokenExecutor, OSError, RuntimeError) as error:
            raise ComputationFailed(f"the executor takes no tasks: {_line(error)}") from None


def _finished(running: Mapping[Future[Any], _Running]) -> list[Future[Any]]:
    """Wait a moment; return the tasks with a result, then those that are overdue."""
    done = wait(running, POLL, FIRST_COMPLETED).done
    now = time.monotonic()
    late = [future for future, task in running.items() if now > task.end and future not in done]
    return [*done, *late]


def _overdue(seconds: float) -> Failure:
    return Failure(OVERDUE, f"no result in {seconds:g} s")


def _executed(future: Future[Any]) -> Any:
    """Return the result of a task of an executor, or `CRASHED` where several workers have died of
    it.
    """
    try:
        return future.result()
    except (BadInput, ComputationFailed):
        raise
    except (BrokenExecutor, CancelledError) as error:
        raise ComputationFailed(f"the executor has lost its workers: {_line(error)}") from None
    except Exception as error:
        if type(error).__name__ == KILLED_WORKER:
            return CRASHED
        raise ComputationFailed(f"a worker failed: {_line(error)}") from None


def compute_alone(versions: Mapping[str, str], function: Callable[..., Any], *task: Any) -> Any:
    """In a worker, compute a task with the versions of the runner.

    One task at a time: samples, meshers and solvers keep their state in the process, and a worker
    may have threads."""
    require_same_versions(versions)
    with _ALONE:
        return function(*task)


def _line(error: BaseException) -> str:
    """Return an error that another package has raised as one line."""
    return one_line(
        f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": "), 200
    )


@contextmanager
def workers_of(
    count: int, scheduler: str | None = None, executor: Executor | None = None
) -> Iterator[Workers | ExecutorWorkers]:
    """Yield `count` processes on this machine, or the workers of a Dask scheduler or of an
    executor. Raises BadInput.

    scheduler : `host:port`, or the path of a scheduler file.
    """
    if scheduler is not None and executor is not None:
        raise BadInput("scheduler and executor, expected one of them")
    if executor is not None:
        if not isinstance(executor, Executor):
            raise BadInput(
                f"executor {one_line(repr(executor), 200)}, expected one of concurrent.futures"
            )
        yield ExecutorWorkers(executor)
    elif scheduler is not None:
        with dask_client(scheduler) as client:
            yield ExecutorWorkers(client.get_executor(pure=False))
    else:
        with Workers(count) as workers:
            yield workers


@contextmanager
def dask_client(scheduler: str) -> Iterator[Any]:
    """Yield a client of a Dask scheduler that has workers.

    Raises
    ------
    BadInput : Dask is not installed, or no scheduler responds.
    ComputationFailed : the scheduler has no workers.
    """
    named = f"--scheduler {one_line(str(scheduler), 200)}"
    expected = "expected host:port of a Dask scheduler, or its scheduler file"
    if not isinstance(scheduler, str) or not (":" in scheduler or Path(scheduler).is_file()):
        raise BadInput(f"{named}: {expected}")
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise BadInput(f"{named}: Dask is not installed, expected flexfem[dask]") from None
    # an error is one line, that of flexfem
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    place = {"scheduler_file": scheduler} if Path(scheduler).is_file() else {"address": scheduler}
    try:
        client: Any = distributed.Client(**place, timeout=CONNECTING, set_as_default=False)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{named}: {expected}: {_line(error)}") from None
    try:
        try:
            client.wait_for_workers(1, timeout=LOADING)
        except TimeoutError:
            raise ComputationFailed(f"{named}: no worker has joined in {LOADING:g} s") from None
        yield client
    finally:
        with suppress(Exception):  # the scheduler may have ended
            client.close(timeout=CONNECTING)


def _submitted(
    process: Any,
    function: Callable[..., Any],
    task: tuple[Any, ...],
) -> Future[Any]:
    try:
        with signals_held():
            return process.submit(function, *task)  # type: ignore[no-any-return]
    except BrokenProcessPool as error:
        broken = Future[Any]()
        broken.set_exception(error)
        return broken
    except (OSError, RuntimeError) as error:
        raise ComputationFailed(
            f"worker processes cannot be started: {one_line(str(error), 200)}"
        ) from None


def _result(future: Future[Any], seconds: float | None = None) -> Any:
    """Return the result of a task, or `CRASHED` where its process died or does not respond."""
    try:
        return future.result(seconds)
    except (BrokenProcessPool, TimeoutError):
        return CRASHED
    except (BadInput, ComputationFailed):
        raise
    except Exception as error:
        raise ComputationFailed(f"a worker failed: {_line(error)}") from None


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
    threading.Thread(
        target=_end_with,
        args=(parent,),
        daemon=True,
    ).start()


def _end_with(parent: int) -> None:
    while sys.platform == "win32" or os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


@contextmanager
def signals_held() -> Iterator[None]:
    """Block Ctrl-C and similar signals while processes start, until they ignore them and the pool
    is complete.
    """
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

    These are versions of flexfem and the libraries, a hash of the files of flexfem in a checkout or
    an editable installation, and a hash of the file that the user gives by `--with`."""
    versions = {"python": ".".join(map(str, sys.version_info[:2]))}
    for name in (
        "flexfem",
        "numpy",
        "scipy",
        "shapely",
        "gmsh",
        "scikit-fem",
        "cvxopt",
        "pypardiso",
    ):
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    if (PACKAGE.parent / "pyproject.toml").is_file():
        versions["sources"] = digest(dict(manifest()))[:16]
    if own_hash():
        versions["with"] = own_hash()[:16]
    return MappingProxyType(versions)


def require_same_versions(expected: Mapping[str, str]) -> None:
    """Raise BadInput in a worker whose versions of flexfem or libraries are not those of the
    runner.
    """
    own = versions_of()
    for name in {**expected, **own}:
        if own.get(name) != expected.get(name):
            said = (
                f"a worker has {name} {own.get(name, 'none')}, the runner "
                f"{expected.get(name, 'none')}"
            )
            raise BadInput(f"{said}, expected the same versions everywhere")
