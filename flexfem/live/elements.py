"""Finite elements in a process of their own, which is ended where a newer question replaces it."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from flexfem.live.answers import rows_by_model
from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput, ComputationFailed, line_of

POLL = 0.1  # s, between two looks at what the process has sent
Report = Callable[[str, Any], None]
"""Function of "progress" with a text, "rows" with rows, or "failed" with a text."""


class Elements:
    """Computes the key results of one mechanism at a time by finite elements.

    `start` ends the computation before. The process remains after it has answered, so that the next
    one does not import everything again.
    """

    def __init__(self) -> None:
        self._process: Any = None
        self._pipe: Connection | None = None
        self._is_busy = False

    async def answer(
        self,
        mechanism: Mechanism,
        report: Report,
    ) -> None:
        """Compute the key results of a mechanism; report progress, then the rows or a failure."""
        if self._is_busy:
            self.close()
        if self._process is None:
            self._open()
        pipe = self._pipe
        assert pipe is not None
        self._is_busy = True
        pipe.send(mechanism)
        while True:
            while not pipe.poll():  # a thread that waits in `recv` could not be cancelled
                await asyncio.sleep(POLL)
            try:
                kind, content = pipe.recv()
            except (EOFError, OSError):  # ended by the system
                return
            self._is_busy = kind == "progress"
            report(kind, content)
            if not self._is_busy:
                return

    def close(self) -> None:
        """End the process and those that it has started."""
        if self._process is None:
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self._process = None
        self._pipe = None
        self._is_busy = False

    def _open(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(
            target=_serve,
            args=(other,),
            daemon=False,
        )
        self._process.start()
        other.close()


def _serve(pipe: Connection) -> None:
    """Answer one mechanism after the other until the pipe is closed."""
    with suppress(AttributeError, PermissionError):  # not on Windows
        os.setpgid(0, 0)  # so that the mesher ends with this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            mechanism = pipe.recv()
        except EOFError:
            return
        pipe.send(_answered(mechanism, pipe))


def _answered(mechanism: Mechanism, pipe: Connection) -> tuple[str, Any]:
    def progress(text: str) -> None:
        pipe.send(("progress", text))

    try:
        return "rows", rows_by_model(mechanism, "elements", progress)
    except (BadInput, ComputationFailed) as refused:
        return "failed", line_of(refused)
