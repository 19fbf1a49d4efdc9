"""Entry point of the program: Ctrl-C ends it with one line even during the import of the command
line.
"""

import os
import signal
from types import FrameType


def _end(number: int, frame: FrameType | None) -> None:
    """Exit at once: there is nothing to clean up yet."""
    os.write(2, b"flexfem: stopped\n")
    os._exit(128 + number)


if (
    signal.getsignal(signal.SIGINT) is signal.default_int_handler
):  # a background job ignores the signal
    signal.signal(signal.SIGINT, _end)

from flexfem.commands.cli import main  # noqa: E402

__all__ = ["main"]
