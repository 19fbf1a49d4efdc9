"""Standard streams, signals and progress of a command; printed text cannot control the terminal."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import Any

EVERY = 10.0  # s between two progress lines
LOOK_AGAIN = 1.0  # s between two updates of a message on a terminal
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
IMPORTER = "<frozen importlib._bootstrap>"  # file name in frames of the import system
LOOK = 0.02  # s between two checks whether an import has ended
PATIENCE = 2.0  # s for an import to end
ENDING = 5.0  # s for a stopped command to end; after that the next signal ends it at once
HAS_TIMER = sys.platform != "win32"


class Stopped(KeyboardInterrupt):
    """A signal stopped the command; `code` is 128 plus its number. A note replaces its message."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code = 128 + number
        self.asked = time.monotonic()


class Plain:
    """A text stream that escapes control characters; `raw` is the wrapped stream, for progress
    bars.

    silent : ignore write errors, because progress on a full or closed stream must not end a run.
    """

    def __init__(
        self,
        raw: Any,
        silent: bool,
    ) -> None:
        self.raw = raw
        self._silent = silent
        if hasattr(raw, "reconfigure"):  # characters that the encoding of the terminal lacks
            raw.reconfigure(errors="backslashreplace")

    def write(self, text: str) -> int:
        """Write text with escaped control characters, except new lines and tabs."""
        with self._lossless():
            self.raw.write(CONTROL.sub(lambda found: repr(found[0])[1:-1], text))
        return len(text)

    def flush(self) -> None:
        """Flush the stream."""
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
    """Redirect a stream to the null device, so that its buffered text is discarded."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def open_streams() -> None:
    """Open closed standard streams; otherwise the next file or pipe would get their numbers."""
    for stream in (0, 1, 2):
        try:
            os.fstat(stream)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, this one
            # for child processes, whose pipes would get its number
            os.set_inheritable(opened, True)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Escape control characters on standard output and error; ignore write errors on the latter.

    Warnings of libraries are printed on one line, without their place in the code.
    """
    before = sys.stdout, sys.stderr
    show_warning = warnings.showwarning
    warnings.showwarning = _show_warning
    sys.stdout = Plain(sys.stdout, False) if sys.stdout is not None else None
    sys.stderr = Plain(sys.stderr, True) if sys.stderr is not None else None
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        sys.stdout, sys.stderr = before
        warnings.showwarning = show_warning


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    if sys.stderr is not None:
        print(f"flexfem: warning: {' '.join(str(message).split())}", file=sys.stderr)


class _StopHandlers:
    """Handlers of stop signals; `raised` contains the first stop.

    A running import is finished first, because interrupted libraries print messages or stay half
    loaded. Where no exception can be raised, such as in C code, it is raised a moment later.
    """

    def __init__(self) -> None:
        self.raised: list[Stopped] = []

    def stop(
        self,
        number: int,
        frame: FrameType | None,
    ) -> None:
        """Raise Stopped at the first signal; ignore further ones for `ENDING` s, then end at once."""
        if not self.raised:
            self.raised.append(Stopped(number))
            self._end(number, frame)
        elif self._since_asked > ENDING:
            os._exit(128 + number)

    def unraisable(self, lost: Any) -> None:
        """Raise a stop again that was lost where no exception can be raised."""
        if not isinstance(lost.exc_value, Stopped):
            sys.__unraisablehook__(lost)
        elif HAS_TIMER:
            self._end_soon()

    @property
    def _since_asked(self) -> float:
        return time.monotonic() - self.raised[0].asked

    def _end(
        self,
        number: int,
        frame: FrameType | None,
    ) -> None:
        if HAS_TIMER and _imports(frame) and self._since_asked < PATIENCE:
            self._end_soon()
        else:
            raise self.raised[0]

    def _end_soon(self) -> None:
        signal.signal(signal.SIGALRM, self._end)
        signal.setitimer(signal.ITIMER_REAL, LOOK)


@contextmanager
def stoppable() -> Iterator[list[Stopped]]:
    """Raise Stopped at the first stop signal, and yield a list that then contains it."""
    handlers = _StopHandlers()
    if threading.current_thread() is not threading.main_thread():
        yield handlers.raised
        return
    numbers = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGHUP"):
        numbers.append(signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in numbers}
    hook = sys.unraisablehook
    sys.unraisablehook = handlers.unraisable
    for number in numbers:
        if before[number] is not signal.SIG_IGN:  # nohup, and background jobs of a shell
            signal.signal(number, handlers.stop)
    try:
        yield handlers.raised
    finally:
        sys.unraisablehook = hook
        if not handlers.raised:  # otherwise the handlers stay until the process ends
            for number, handler in before.items():
                signal.signal(number, handler)
        elif HAS_TIMER:  # the command ended before the next check: its own exit code counts
            signal.setitimer(signal.ITIMER_REAL, 0)


def _imports(frame: FrameType | None) -> bool:
    """Return whether a frame belongs to an import."""
    while frame is not None and frame.f_code.co_filename != IMPORTER:
        frame = frame.f_back
    return frame is not None


def deepest(error: BaseException) -> TracebackType | None:
    """Return the innermost frame of an error."""
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    return frame


def reason_of(error: BaseException) -> str:
    """Return one line on an unexpected error."""
    from flexfem.files.refusals import one_line  # heavy
    from flexfem.refused import line_of

    if isinstance(error, MemoryError):
        return "out of memory"
    what = one_line(line_of(error), 300)
    if isinstance(error, OSError):
        return what or type(error).__name__
    if isinstance(error, ImportError):
        return f"a library cannot be loaded: {what}"
    frame = deepest(error)
    where = ""
    if frame is not None:
        file = os.path.basename(frame.tb_frame.f_code.co_filename)
        where = f" ({file}, line {frame.tb_lineno})"
    return (
        f"an error in flexfem: {type(error).__name__}: {what}{where}; FLEXFEM_TRACEBACK=1 shows "
        "the traceback"
    )


@contextmanager
def showing_progress(
    description: str,
    pause: float = 0.0,
    more: Callable[[], str] = str,
) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows a progress message.

    A terminal shows a spinner, removed at the end. Other streams get a line for each message at
    least `pause` s after the last line, and a line with the time whenever `EVERY` s have passed
    without one.

    more : function that returns what is shown after the message, such as the remaining time; ""
        for nothing.
    """
    stream = sys.stderr.raw if isinstance(sys.stderr, Plain) else sys.stderr
    if stream.isatty():
        from rich.console import Console
        from rich.text import Text

        with Console(file=stream).status(Text(description)) as sign:
            message = [description]

            def update(text: str) -> None:
                message[0] = f"{description}: {text}"
                sign.update(Text(message[0] + more()))

            with _every(LOOK_AGAIN, lambda: sign.update(Text(message[0] + more()))):
                yield update
        return
    began = time.monotonic()
    latest = began - pause

    def say(text: str) -> None:
        nonlocal latest
        if time.monotonic() - latest >= pause:
            latest = time.monotonic()
            print(f"{description}: {text}{more()}", file=sys.stderr, flush=True)

    def remind() -> None:
        if time.monotonic() - latest >= EVERY:
            seconds = time.monotonic() - began
            print(f"{description}: {seconds:.0f} s{more()}", file=sys.stderr, flush=True)

    with _every(EVERY, remind):
        yield say


@contextmanager
def _every(pause: float, remind: Callable[[], object]) -> Iterator[None]:
    """Call a function every `pause` s, in a thread."""
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(pause):
            remind()

    thread = threading.Thread(target=repeat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
