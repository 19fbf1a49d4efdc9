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
COMMANDS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)  # control characters
IMPORTER = "<frozen importlib._bootstrap>"  # file name in frames of the import system
LOOK = 0.02
PATIENCE = 2.0  # s between two checks whether an import has ended, and its longest duration
ENDING = 5.0  # s for a stopped command to end; after that the next signal ends it at once


class Stopped(KeyboardInterrupt):
    """A signal stopped the command; `code` is 128 plus the signal number. A note on it replaces its
    message.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code, self.asked = 128 + number, time.monotonic()


class Plain:
    """A text stream that escapes control characters; `raw` is the wrapped stream, for progress
    bars.

    silent : ignore write errors, because progress on a full or closed stream must not end a run.
    """

    def __init__(self, raw: Any, silent: bool) -> None:
        self.raw = raw
        self._silent = silent
        if hasattr(raw, "reconfigure"):
            raw.reconfigure(
                errors="backslashreplace"
            )  # characters that the encoding of the terminal lacks

    def write(self, text: str) -> int:
        """Write text with escaped control characters, except new lines and tabs."""
        with self._lossless():
            self.raw.write(COMMANDS.sub(lambda found: repr(found[0])[1:-1], text))
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
            os.set_inheritable(
                opened, True
            )  # for child processes, whose pipes would get its number


@contextmanager
def plain_streams() -> Iterator[None]:
    """Escape control characters on standard output and error, and ignore write errors on standard
    error.

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


@contextmanager
def stoppable() -> Iterator[list[Stopped]]:
    """Raise Stopped at the first stop signal, and yield a list that then contains it.

    A running import is finished first, because interrupted libraries print messages or stay half
    loaded. Where no exception can be raised, it is raised a moment later. Further signals are
    ignored for `ENDING` s."""
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
        if (
            sys.platform != "win32"
            and _imports(frame)
            and time.monotonic() - raised[0].asked < PATIENCE
        ):
            end_soon()
        else:
            raise raised[0]

    def end_soon() -> None:
        signal.signal(signal.SIGALRM, end)
        signal.setitimer(signal.ITIMER_REAL, LOOK)

    def unraisable(lost: Any) -> None:
        """Raise a stop again that was lost where no exception can be raised, such as in C code."""
        if not isinstance(lost.exc_value, Stopped):
            sys.__unraisablehook__(lost)
        elif sys.platform != "win32":
            end_soon()

    taken = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
    before = {number: signal.getsignal(number) for number in taken}
    hook = sys.unraisablehook
    sys.unraisablehook = unraisable
    for number in taken:
        if before[number] is not signal.SIG_IGN:  # nohup, and background jobs of a shell
            signal.signal(number, stop)
    try:
        yield raised
    finally:
        sys.unraisablehook = hook
        if not raised:  # otherwise the handlers stay until the process ends
            for number, handler in before.items():
                signal.signal(number, handler)
        elif sys.platform != "win32":
            signal.setitimer(
                signal.ITIMER_REAL, 0
            )  # the command ended before the next check: its own exit code counts


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
    where = (
        f" ({os.path.basename(frame.tb_frame.f_code.co_filename)}, line {frame.tb_lineno})"
        if frame
        else ""
    )
    return (
        f"an error in flexfem: {type(error).__name__}: {what}{where}; FLEXFEM_TRACEBACK=1 shows "
        "the traceback"
    )


@contextmanager
def working(description: str, pause: float = 0.0) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows a progress message.

    A terminal shows a spinner, removed at the end. Other streams get a line for each message at
    least `pause` s after the last line, and a line with the time whenever `EVERY` s have passed
    without one."""
    stream = sys.stderr.raw if isinstance(sys.stderr, Plain) else sys.stderr
    if stream.isatty():
        from rich.console import Console
        from rich.text import Text

        with Console(file=stream).status(Text(description)) as sign:
            yield lambda text: sign.update(Text(f"{description}: {text}"))
        return
    began = time.monotonic()
    ended = threading.Event()
    latest = began - pause

    def say(text: str) -> None:
        nonlocal latest
        if time.monotonic() - latest >= pause:
            latest = time.monotonic()
            print(f"{description}: {text}", file=sys.stderr, flush=True)

    def remind() -> None:
        while not ended.wait(EVERY):
            if time.monotonic() - latest >= EVERY:
                print(
                    f"{description}: {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True
                )

    thread = threading.Thread(target=remind, daemon=True)
    thread.start()
    try:
        yield say
    finally:
        ended.set()
        thread.join()
