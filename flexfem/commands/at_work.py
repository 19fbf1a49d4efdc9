"""How a command that takes a while says so on standard error: moving on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from flexfem.commands.streams import raw

EVERY = 10.0  # s between two lines


@contextmanager
def working(description: str, steps: int = 0) -> Iterator[Callable[[str], None]]:
    """Yield what takes a word whenever one of `steps` is done or begins; with none the time alone is shown.

    On a terminal a bar, or without steps a sign that moves, with the time since the beginning, gone at the end. Else a
    line for every step, and one whenever `EVERY` seconds have passed without any.
    """
    stream = raw(sys.stderr)
    with _bar(stream, description, steps) if stream.isatty() else _lines(description, steps) as say:
        yield say


@contextmanager
def _bar(stream: Any, description: str, steps: int) -> Iterator[Callable[[str], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    shown = (BarColumn(),) if steps else (SpinnerColumn(),)
    columns = (TextColumn("{task.description}", markup=False), *shown, TimeElapsedColumn())
    with Progress(*columns, console=Console(file=stream), transient=True) as progress:
        task = progress.add_task(description, total=steps or None)

        def say(text: str) -> None:
            progress.update(task, advance=1, description=f"{description}: {text}")

        yield say


@contextmanager
def _lines(description: str, steps: int) -> Iterator[Callable[[str], None]]:
    began, done, ended = time.monotonic(), 0, threading.Event()
    spoken = threading.Event()

    def say(text: str) -> None:
        nonlocal done
        done += 1
        spoken.set()
        print(f"{description} {done}/{steps}: {text}" if steps else f"{description}: {text}", file=sys.stderr)

    def remind() -> None:
        while not ended.wait(EVERY):
            if not spoken.is_set():
                print(f"{description}: {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
            spoken.clear()

    thread = threading.Thread(target=remind, daemon=True)
    thread.start()
    try:
        yield say
    finally:
        ended.set()
        thread.join()
