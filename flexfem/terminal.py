"""Standard streams, signals and progress of a command: nothing printed can command a terminal or end the command."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import Any

from flexfem.refused import SourcesChanged

EVERY = 10.0  # s between two lines
COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")  # escapes, overwriting
IMPORTER = "<frozen importlib._bootstrap>"  # of what Python imports with
LOOK, PATIENCE = 0.02, 2.0  # s between two looks whether an import is over, and how long it may take
ENDING = 5.0  # s that a stopped command has to end in order, before the next signal ends it at once


class Stopped(KeyboardInterrupt):
    """A signal asks the command to stop; the exit code is 128 and the signal's number, `said` the line about it."""

    said = "stopped"

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code, self.asked = 128 + number, time.monotonic()


class Plain:
    """A text stream through which control characters go escaped; `raw` is the stream itself, for progress bars.

    `silent` : what cannot be written is lost without a word: progress to a full or closed stream ends no run.
    """

    def __init__(self, raw: Any, silent: bool) -> None:
        self.raw, self._silent = raw, silent
        if hasattr(raw, "reconfigure"):
            raw.reconfigure(errors="backslashreplace")  # a title that the terminal's encoding lacks

    def write(self, text: str) -> int:
        """Write text, its control characters escaped but for new lines and tabs."""
        with self._lossless():
            self.raw.write(COMMANDS.sub(lambda found: repr(found[0])[1:-1], text))
        return len(text)

    def flush(self) -> None:
        """As of any stream."""
        with self._lossless():
            self.raw.flush()

    @contextmanager
    def _lossless(self) -> Iterator[None]:
        try:
            yield
        except OSError:
            if not self._silent:
                raise
            discard(self.raw)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.raw, name)


def discard(stream: Any) -> None:
    """Let what a stream still holds go nowhere."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def open_streams() -> None:
    """Open standard streams that are closed: else the next file or pipe would take their place."""
    for stream in (0, 1, 2):
        try:
            os.fstat(stream)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, this one
            os.set_inheritable(opened, True)  # for child processes, whose pipes would take its place


@contextmanager
def plain_streams() -> Iterator[None]:
    """Let nothing but text reach standard output and error, and losing the latter end nothing."""
    before = sys.stdout, sys.stderr
    sys.stdout = Plain(sys.stdout, False) if sys.stdout is not None else None
    sys.stderr = Plain(sys.stderr, True) if sys.stderr is not None else None
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        sys.stdout, sys.stderr = before


@contextmanager
def stoppable() -> Iterator[list[Stopped]]:
    """Raise Stopped at the first signal to stop, and yield a list that has it; later ones wait `ENDING` s.

    A library that is being imported is imported first: broken off, it prints what it likes, or goes on in pieces. Where
    nothing can be raised, the stop is raised a moment later.
    """
    raised: list[Stopped] = []
    if threading.current_thread() is not threading.main_thread():
        yield raised
        return

    def stop(number: int, frame: FrameType | None) -> None:
        if not raised:
            raised.append(Stopped(number))
            end(number, frame)
        elif time.monotonic() - raised[0].asked > ENDING:
            os._exit(128 + number)

    def end(number: int, frame: FrameType | None) -> None:
        if sys.platform != "win32" and _imports(frame) and time.monotonic() - raised[0].asked < PATIENCE:
            end_soon()
        else:
            raise raised[0]

    def end_soon() -> None:
        signal.signal(signal.SIGALRM, end)
        signal.setitimer(signal.ITIMER_REAL, LOOK)

    def unraisable(lost: Any) -> None:
        """Raise a stop again that came where nothing can be raised, such as in C code of a library."""
        if not isinstance(lost.exc_value, Stopped):
            sys.__unraisablehook__(lost)
        elif sys.platform != "win32":
            end_soon()

    taken = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
    before = {number: signal.getsignal(number) for number in taken}
    hook, sys.unraisablehook = sys.unraisablehook, unraisable
    for number in taken:
        if before[number] is not signal.SIG_IGN:  # nohup, and jobs in the background of a shell
            signal.signal(number, stop)
    try:
        yield raised
    finally:
        sys.unraisablehook = hook
        if not raised:  # else they stay, until the process is gone
            for number, handler in before.items():
                signal.signal(number, handler)
        elif sys.platform != "win32":
            signal.setitimer(signal.ITIMER_REAL, 0)  # a command that ended before it looked again ends by its own code


def _imports(frame: FrameType | None) -> bool:
    """Whether a frame is run for an import."""
    while frame is not None and frame.f_code.co_filename != IMPORTER:
        frame = frame.f_back
    return frame is not None


def deepest(error: BaseException) -> TracebackType | None:
    """Where an error was raised."""
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    return frame


def reason_of(error: BaseException) -> str:
    """What went wrong in one line, for an error that nobody has put into words."""
    from flexfem.files.refusals import one_line  # heavy
    from flexfem.sources import require_unchanged

    if isinstance(error, MemoryError):
        return "out of memory"
    what = one_line(" ".join(str(error).split()), 300)
    if isinstance(error, OSError):
        return what or type(error).__name__
    if isinstance(error, ImportError):
        return f"a library cannot be loaded: {what}"
    try:
        require_unchanged()  # parts of two versions together can fail anywhere
    except SourcesChanged as changed:
        return str(changed)
    frame = deepest(error)
    where = f" ({os.path.basename(frame.tb_frame.f_code.co_filename)}, line {frame.tb_lineno})" if frame else ""
    return f"an error in flexfem: {type(error).__name__}: {what}{where}; FLEXFEM_TRACEBACK=1 shows all of it"


@contextmanager
def working(description: str, pause: float = 0.0) -> Iterator[Callable[[str], None]]:
    """Yield what takes a word whenever something is done or begins.

    On a terminal a sign that moves, gone at the end; else a line for every word that comes `pause` s after the last
    line, and one whenever `EVERY` seconds have passed without any.
    """
    stream = sys.stderr.raw if isinstance(sys.stderr, Plain) else sys.stderr
    if stream.isatty():
        from rich.console import Console
        from rich.text import Text

        with Console(file=stream).status(Text(description)) as sign:
            yield lambda text: sign.update(Text(f"{description}: {text}"))
        return
    began, ended = time.monotonic(), threading.Event()
    latest = began - pause

    def say(text: str) -> None:
        nonlocal latest
        if time.monotonic() - latest >= pause:
            latest = time.monotonic()
            print(f"{description}: {text}", file=sys.stderr, flush=True)

    def remind() -> None:
        while not ended.wait(EVERY):
            if time.monotonic() - latest >= EVERY:
                print(f"{description}: {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)

    thread = threading.Thread(target=remind, daemon=True)
    thread.start()
    try:
        yield say
    finally:
        ended.set()
        thread.join()
