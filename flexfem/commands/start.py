"""Where the program begins: Ctrl-C ends it in one line also while the command line itself is loaded."""

import os
import signal
from types import FrameType


def _end(number: int, frame: FrameType | None) -> None:
    """End at once: nothing is open or begun yet."""
    os.write(2, b"flexfem: stopped\n")
    os._exit(128 + number)


if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not where it is ignored, as in the background
    signal.signal(signal.SIGINT, _end)

from flexfem.commands.cli import main  # noqa: E402

__all__ = ["main"]
