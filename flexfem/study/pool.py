"""Where designs are computed: worker processes of this machine, or those of a Dask scheduler, behind one `submit`.

A local worker is a pebble pool of one. Pebble's workers share a pipe and its locks, so that one killed at the wrong
moment holds up the others; alone in its pool a worker takes nothing along, and whatever it leaves goes with its pool.
"""

from __future__ import annotations

import importlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, InvalidStateError
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache
from multiprocessing import resource_tracker
from typing import Any, Protocol, TypeAlias

from flexfem.errors import BadInput, ComputationFailed
from flexfem.study.answer import Rows
from flexfem.study.plan import LoadedStudy
from flexfem.study.versions import versions_of

Answer: TypeAlias = Callable[[LoadedStudy, int, int, bool], Rows]
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
KILLED_AFTER = 0.2  # s, which a worker has to end by itself; one in the middle of C code cannot
SILENCE = 60.0  # s beyond its limit, after which a task is given up even if pebble has lost it
GRACE = 1.0  # s, for a broken pool to say so itself
SHUTDOWN = 5.0  # s


def deciding(loaded: LoadedStudy) -> dict[str, str]:
    """Versions of what decides the results of a study, as its parts carry them."""
    return dict(versions_of(loaded.study.model != "analytic"))


class Died(Exception):  # noqa: N818
    """The worker of a task ended without an answer; `final` when it has been tried again already."""

    def __init__(self, final: bool = False) -> None:
        super().__init__(final)
        self.final = final


class Pool(Protocol):
    """What runs tasks: at most `width` at once are useful; `limit` is in s.

    A future raises Died, TimeoutError, or what makes all further work useless: BadInput or ComputationFailed.
    """

    @property
    def width(self) -> int: ...
    def submit(self, solve: Answer, loaded: LoadedStudy, start: int, stop: int, limit: float) -> Future[Any]: ...
    def outcome(self, future: Future[Any]) -> Rows | str: ...
    def check(self) -> None: ...
    def close(self) -> None: ...


def answered(
    solve: Answer, loaded: LoadedStudy, start: int, stop: int, inside: bool, versions: dict[str, str]
) -> Rows | str:
    """In a worker: answer designs; an exception comes back as its text. Raises BadInput for other versions."""
    if not inside:
        _one_thread()
    own = deciding(loaded)
    if own != versions:
        name = next(name for name in versions if own.get(name) != versions[name])
        raise BadInput(
            f"a worker has {name} {own.get(name)}, the runner {versions[name]}, expected the same versions everywhere"
        )
    if start == stop:  # only asked whether it can
        return ""
    try:
        return solve(loaded, start, stop, inside)
    except (BadInput, ComputationFailed) as error:
        return str(error)
    except Exception as error:
        return f"{type(error).__name__}: {' '.join(str(error).split())}"


@lru_cache
def _one_thread() -> None:
    """Keep BLAS to one thread in a process that flexfem has not started: libraries yet to load, and loaded ones."""
    os.environ.update(ONE_THREAD)
    with suppress(ImportError):
        importlib.import_module("threadpoolctl").threadpool_limits(1)


class LocalPool:
    """Spawned processes of this machine; one that dies or exceeds a limit is killed and replaced."""

    def __init__(self, workers: int) -> None:
        import pebble

        pebble.CONSTS.term_timeout = KILLED_AFTER
        resource_tracker.ensure_running()  # started later it would let the first worker see Ctrl-C
        self._slots = [_Slot() for _ in range(workers)]
        self._before = {name: os.environ.get(name) for name in ONE_THREAD}
        os.environ.update(ONE_THREAD)  # numpy of the spawned reads them when it is loaded

    @property
    def width(self) -> int:
        """Number of workers."""
        return len(self._slots)

    def submit(self, solve: Answer, loaded: LoadedStudy, start: int, stop: int, limit: float) -> Future[Any]:
        """Start a task on a free worker; there must be one."""
        slot = next(slot for slot in self._slots if slot.future is None or slot.future.done())
        return slot.start((solve, loaded, start, stop, True, deciding(loaded)), limit)

    def outcome(self, future: Future[Any]) -> Rows | str:
        """What a task that is done answered."""
        import pebble

        try:
            return future.result()  # type: ignore[no-any-return]
        except (pebble.ProcessExpired, BrokenProcessPool):
            raise Died from None

    def check(self) -> None:
        """Give up tasks that their pools have lost."""
        for slot in self._slots:
            slot.check()

    def close(self) -> None:
        """Kill all workers, and wait until they are gone."""
        for ending in [slot.stop() for slot in self._slots]:
            ending.join(SHUTDOWN)
        for name, value in self._before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


class _Slot:
    """A pool of one worker, replaced with all it has when the worker dies."""

    def __init__(self) -> None:
        self.future: Future[Any] | None = None
        self._pool: Any = None
        self._latest = 0.0

    def start(self, arguments: tuple[Any, ...], limit: float) -> Future[Any]:
        with _no_interrupt():
            if self._pool is None or not self._sound():
                self.stop()
                self._pool = _pool_of_one()
            self._latest = time.monotonic() + limit + SILENCE
            future: Future[Any] = self._pool.schedule(answered, args=arguments, timeout=limit)
        self.future = future
        return future

    def _sound(self) -> bool:
        from pebble import ProcessExpired

        failure = None if self.future is None or self.future.cancelled() else self.future.exception()
        return bool(self._pool.active) and not isinstance(failure, ProcessExpired | BrokenProcessPool)

    def check(self) -> None:
        if self.future is None or self.future.done():
            return
        now = time.monotonic()
        if not self._pool.active:
            self._latest = min(self._latest, now + GRACE)
        if now > self._latest:
            with suppress(InvalidStateError):  # done meanwhile
                self.future.set_exception(BrokenProcessPool("lost"))

    def stop(self) -> threading.Thread:
        """Kill the worker in a thread: pebble may wait forever for the rest of what a killed worker was sending."""
        pool, self._pool = self._pool, None
        ending = threading.Thread(target=_ended, args=(pool,), daemon=True)
        ending.start()
        return ending


def _pool_of_one() -> Any:
    from pebble import ProcessPool

    context: Any = multiprocessing.get_context("spawn")
    return ProcessPool(max_workers=1, context=context, initializer=begin)


def _ended(pool: Any) -> None:
    if pool is not None:
        pool.stop()
        pool.join()


def begin() -> None:
    """In a worker: be silent, and end at once when the runner does, also in the middle of a design that hangs."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # gmsh prints on both; what matters comes back as a reason
        os.dup2(nowhere, stream)

    def wait() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Let what is started here not see Ctrl-C: the runner does, and ends them."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
