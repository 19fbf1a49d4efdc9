"""Workers of a Dask scheduler, which starts them under Slurm, Kubernetes or in a cloud.

Each thread of a Dask worker keeps a process of its own that answers under the limit, as a worker of this machine does.
The client keeps its own time too: a task that a paused or lost worker holds is asked of another.
"""

from __future__ import annotations

import importlib
import logging
import re
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, InvalidStateError, wait
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from flexfem.clock import Stopwatch
from flexfem.files.refusals import one_line
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import Rows
from flexfem.study.pool import Answer, answered, deciding, deciding_sources, outcome_of
from flexfem.study.worker import Died, Worker

CONNECT = 10.0  # s, for a scheduler to answer
AHEAD = 2  # tasks a thread, so that none waits for the network
COUNTED = 5.0  # s between two looks at the workers
POLL = 0.25  # s
PAUSED = 20.0  # s on a paused worker, after which a task is asked of another
SLACK = 60.0  # s beyond the limits of the tasks before it and its own, after which a task is asked again
PATIENCE = 600.0  # s without any worker, after which a run ends
SHUTDOWN = 5.0  # s
LOST = (OSError, RuntimeError, CancelledError)  # what Dask raises when the scheduler is gone, time limits among them

_here = threading.local()


def supervised(arguments: tuple[Any, ...], limit: float, sources: dict[str, str]) -> Any:
    """On a Dask worker: answer in the process of this thread; TimeoutError and Died are returned, not raised."""
    worker: Worker = _here.__dict__.setdefault("worker", Worker())
    future = worker.start(answered, arguments, limit, sources)
    while wait([future], POLL).not_done:
        worker.check()
    error = future.exception()
    return error if isinstance(error, TimeoutError | Died) else future.result()


@dataclass
class _Asked:
    """A task under way: Dask's future and ours, s that are left for it, and s that a paused worker has had it."""

    dask: Any
    future: Future[Any]
    left: float
    paused: float = 0.0
    watch: Stopwatch = field(default_factory=Stopwatch)


class DaskPool:
    """The workers of a Dask scheduler, which restarts those that die. Raises BadInput when it does not answer."""

    def __init__(self, address: str, say: Callable[[str], object] = lambda text: None) -> None:
        try:
            distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise BadInput(f"--scheduler {address}: Dask is not installed, expected flexfem[dask]") from None
        if not re.fullmatch(r"((tcp|ws)://)?[^/\s]+:[0-9]{1,5}", address):
            tls = "; flexfem has no certificate to show: a tunnel and tcp://" if address[:3] in ("tls", "wss") else ""
            raise BadInput(f"--scheduler {address}, expected host:port, such as tcp://127.0.0.1:8786{tls}")
        for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
            logging.getLogger(name).setLevel(logging.CRITICAL)  # a lost scheduler is told in one line
        self._address, self._say = address, say
        closed = getattr(getattr(distributed, "client", None), "ClosedClientError", CancelledError)
        self._lost_by = (*LOST, closed)  # that one of a client which has ended between two calls
        self._client = self._connected(distributed)
        self._asked: list[_Asked] = []
        self._threads, self._paused_keys = 0, frozenset[str]()
        self._watch, self._counted, self._alone, self._told = Stopwatch(), 0.0, 0.0, False

    def _connected(self, distributed: Any) -> Any:
        """A client, made in a thread that is left behind when whoever listens there never speaks."""
        made: Future[Any] = Future()

        def connect() -> None:
            try:
                made.set_result(distributed.Client(self._address, timeout=CONNECT, set_as_default=False))
            except Exception as error:  # whatever it is, the one who waits below tells it
                made.set_exception(error)

        threading.Thread(target=connect, daemon=True).start()
        try:
            return made.result(CONNECT + POLL)
        except (*LOST, ValueError) as error:
            reason = one_line(str(error), 200) or f"no word in {CONNECT:g} s"
            raise BadInput(f"--scheduler {self._address}: no scheduler answers there: {reason}") from None

    @property
    def width(self) -> int:
        """Tasks that keep all threads of all workers busy, as of a few seconds ago."""
        return max(1, AHEAD * self._threads)

    def submit(self, solve: Answer, loaded: LoadedStudy, start: int, stop: int, limit: float) -> Future[Any]:
        """Hand a task to the scheduler."""
        task, sources = (solve, loaded, start, stop, deciding(loaded)), dict(deciding_sources())
        future: Future[Any] = Future()
        self._require_scheduler()
        try:
            asked = self._client.submit(supervised, task, limit, sources, pure=False)
        except self._lost_by:
            raise self._lost() from None
        self._asked.append(_Asked(asked, future, AHEAD * limit + SLACK))
        asked.add_done_callback(lambda done: _settle(future, done))
        return future

    def outcome(self, future: Future[Any]) -> Rows | str:
        """What a task that is done answered."""
        from distributed import KilledWorker

        error = future.exception()
        if isinstance(error, KilledWorker):
            raise Died(final=True)
        if isinstance(error, CancelledError):
            raise self._lost()
        return outcome_of(future, f"--scheduler {self._address}: ")

    def check(self) -> None:
        """Ask again what is lost. Raises ComputationFailed when the scheduler is gone, or no worker comes."""
        self._require_scheduler()
        passed = self._watch.step()
        self._counted -= passed
        if self._counted <= 0:
            self._counted = COUNTED
            with suppress(*self._lost_by):  # told by `outcome`
                self._count()
        self._wait_for_workers(passed)
        self._asked = [asked for asked in self._asked if not asked.future.done()]
        for asked in self._asked:
            self._look_at(asked)

    def _count(self) -> None:
        """Look which workers there are: threads of those that run, tasks of those that are paused."""
        try:
            found = self._client.scheduler_info(n_workers=-1)["workers"]
        except TypeError:  # of an older Dask
            found = self._client.scheduler_info()["workers"]
        running = [about for about in found.values() if about.get("status", "running") == "running"]
        self._threads = sum(about["nthreads"] for about in running)
        paused = [address for address, about in found.items() if about.get("status") == "paused"]
        held = self._client.processing(workers=paused) if paused else {}
        self._paused_keys = frozenset(key for keys in held.values() for key in keys)

    def _wait_for_workers(self, passed: float) -> None:
        if self._threads:
            self._alone, self._told = 0.0, False
            return
        self._alone += passed
        if self._alone > COUNTED and not self._told:
            self._told = True
            self._say(f"no worker of {self._address} is running: waiting {PATIENCE / 60:g} min for one")
        if self._alone > PATIENCE:
            raise ComputationFailed(
                f"--scheduler {self._address}: no worker was running for {PATIENCE / 60:g} min; parts are kept, "
                "run again to go on"
            )

    def _look_at(self, asked: _Asked) -> None:
        passed = asked.watch.step()
        if not self._threads:
            return
        asked.left -= passed
        asked.paused = asked.paused + passed if asked.dask.key in self._paused_keys else 0.0
        if asked.left <= 0 or asked.paused > PAUSED:
            with suppress(InvalidStateError, *self._lost_by):  # done meanwhile, or lost
                asked.future.set_exception(Died())
                asked.dask.cancel()

    def close(self) -> None:
        """Cancel what is under way, and leave."""
        with suppress(*self._lost_by):
            for asked in self._asked:
                asked.dask.release()
            self._client.close(timeout=SHUTDOWN)

    def _require_scheduler(self) -> None:
        if self._client.status not in ("running", "connecting"):
            raise self._lost()

    def _lost(self) -> ComputationFailed:
        return ComputationFailed(f"--scheduler {self._address}: lost; parts are kept, run again to go on")


def _settle(future: Future[Any], done: Any) -> None:
    """Put what Dask has answered into a future of ours."""
    with suppress(InvalidStateError):  # given up meanwhile
        try:
            found = done.result()
        except BaseException as error:  # whatever the worker raised: `outcome` raises it where it is asked for
            future.set_exception(error)
            return
        future.set_exception(found) if isinstance(found, Exception) else future.set_result(found)
