"""A process that answers tasks one at a time and can be killed: started, watched over and served here.

Parent and child speak in pickles over the child's standard input and output, and nothing else is shared: no lock that a
killed one could hold, no semaphore that it could leave behind. It need not be allowed children by multiprocessing, so a
Dask worker has one for each of its threads.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, InvalidStateError
from contextlib import contextmanager, suppress
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired
from typing import Any

from flexfem.clock import Stopwatch
from flexfem.sources import ONE_THREAD, child_command

STOPPED = 60.0  # s, after which a worker that somebody has stopped is given up
LOADING = 300.0  # s for a new worker to import what a task needs, on a busy machine or from a slow disk
BEGUN = "begun"  # what a worker says when it has a task in hand: its limit counts from then
IDLE = 300.0  # s without a task, after which a worker ends
GONE = 5.0  # s, for a killed process to be gone


class Died(Exception):  # noqa: N818
    """The worker of a task ended without an answer; `final` when it has been tried again already."""

    def __init__(self, final: bool = False) -> None:
        super().__init__(final)
        self.final = final


class Worker:
    """A child process under a limit: started when there is a task, replaced when it has died or was killed."""

    def __init__(self) -> None:
        self.future: Future[Any] | None = None
        self._process: Popen[bytes] | None = None
        self._manifest: Mapping[str, str] = {}
        self._watch, self._begun, self._left = Stopwatch(), threading.Event(), {"at work": 0.0}

    @property
    def free(self) -> bool:
        """Whether it has no task."""
        return self.future is None or self.future.done()

    def start(self, function: Callable[..., Any], arguments: tuple[Any, ...], limit: float, manifest: Any) -> Any:
        """Give it a task: a function and what it takes, `limit` s once it is loaded, and the sources it may load.

        Returns a future that raises Died, TimeoutError after the limit, or what the function raises.
        """
        content = pickle.dumps((function, arguments))
        if self._process is None or self._process.poll() is not None or manifest != self._manifest:
            self.kill()
            self._process, self._manifest = _started(), manifest
            content = pickle.dumps(dict(manifest)) + pickle.dumps(content)
        else:
            content = pickle.dumps(content)
        self._watch, self._begun = Stopwatch(), threading.Event()
        self._left = {"at work": limit, "loading": LOADING, "stopped": STOPPED}
        self.future = Future()
        arguments = (self._process, content, self._begun, self.future)
        threading.Thread(target=_exchange, args=arguments, daemon=True).start()
        return self.future

    def check(self) -> None:
        """Take off the time since the last look; kill the process when its limit is over. Look often."""
        if self.future is None or self.future.done() or self._process is None:
            return
        begun = "at work" if self._begun.is_set() else "loading"
        self._left["stopped" if _is_stopped(self._process.pid) else begun] -= self._watch.step()
        if min(self._left.values()) <= 0:
            with suppress(InvalidStateError):  # done meanwhile
                self.future.set_exception(TimeoutError() if self._left["at work"] <= 0 else Died())
                self.kill()

    def kill(self) -> None:
        """Kill the process, and wait until it is gone."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with suppress(TimeoutExpired):
                process.wait(GONE)
                for pipe in (process.stdin, process.stdout):
                    with suppress(OSError):  # what it never read
                        pipe.close()  # type: ignore[union-attr]


def _started() -> Popen[bytes]:
    with no_interrupt():
        return Popen(
            child_command("flexfem.study.worker"), stdin=PIPE, stdout=PIPE, stderr=DEVNULL, env=os.environ | ONE_THREAD
        )


def _exchange(process: Popen[bytes], content: bytes, begun: threading.Event, future: Future[Any]) -> None:
    """In a thread: send a task, and put what comes back into the future."""
    try:
        process.stdin.write(content)  # type: ignore[union-attr]
        process.stdin.flush()  # type: ignore[union-attr]
        answer = pickle.load(process.stdout)  # type: ignore[arg-type]
        if answer == BEGUN:
            begun.set()
            answer = pickle.load(process.stdout)  # type: ignore[arg-type]
    except Exception:  # however an answer breaks off
        answer = Died()
        process.kill()
        with suppress(TimeoutExpired):
            process.wait(GONE)  # else the next task is given to one that is still on its way out
    with suppress(InvalidStateError):  # given up meanwhile
        future.set_exception(answer) if isinstance(answer, Exception) else future.set_result(answer)


def _is_stopped(pid: int) -> bool:
    """Whether a process is stopped by a signal, where the system tells; its time does not count then."""
    try:
        return Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()[0] in (b"T", b"t")
    except (OSError, IndexError):
        return False


@contextmanager
def no_interrupt() -> Iterator[None]:
    """Let processes that are started here not see Ctrl-C before they ignore it: who starts them does, and ends them."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def main() -> None:
    """In the child: answer tasks in the main thread, where gmsh must be, until the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers, nowhere = os.fdopen(os.dup(1), "wb"), os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):  # gmsh prints on both; what matters comes back as a reason
        os.dup2(nowhere, stream)
    tasks: queue.Queue[bytes] = queue.Queue()
    threading.Thread(target=_receive, args=(tasks,), daemon=True).start()
    while True:
        try:
            content = tasks.get(timeout=IDLE)
        except queue.Empty:
            return
        for answer in _answers(content):
            answers.write(answer)
            answers.flush()


def _receive(tasks: queue.Queue[bytes]) -> None:
    try:
        while True:
            tasks.put(pickle.load(sys.stdin.buffer))
    finally:  # the parent is gone: so is this, also in the middle of a design that hangs
        os._exit(1)


def _answers(content: bytes) -> Iterator[bytes]:
    """What a worker says of a task: that it has begun, and the answer or the exception."""
    try:
        function, arguments = pickle.loads(content)
        yield pickle.dumps(BEGUN)
        yield pickle.dumps(function(*arguments))
    except Exception as error:  # whatever it is, the parent raises it
        yield pickle.dumps(error)
