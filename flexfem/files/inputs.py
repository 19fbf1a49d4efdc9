"""Files that a command has read: it may replace none of them, whatever they are called where it writes."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from flexfem.refused import BadInput


class Register:
    """Files that were read, by what they were called then, and files written, which may be written again."""

    def __init__(self, read: Iterable[Path] = ()) -> None:
        self.names, self.written = {os.path.abspath(path): str(path) for path in read}, set[str]()
        self._nodes, self._seen, self._lock = dict[tuple[int, int], str](), 0, threading.Lock()

    def called(self, path: Path) -> str | None:
        """What a file that is there was called when it was read, also by a link; None when it was not read."""
        place, node = os.path.abspath(path), _node(path)
        if node is None or place in self.written:
            return None
        with self._lock:  # parts of a study are written by a thread
            new = list(self.names)[self._seen :]
            self._seen += len(new)
            self._nodes |= {found: self.names[each] for each in new if (found := _node(each)) is not None}
        return self.names.get(place) or self._nodes.get(node)


_commands: list[Register] = []  # of the command that runs; none else, as a session in Python may write what it has read
_hooks: list[bool] = []


@contextmanager
def noted() -> Iterator[None]:
    """Take note of every file that is opened for reading meanwhile, by whatever code."""
    if not _hooks:
        _hooks.append(True)
        sys.addaudithook(_note)  # stays for good
    _commands.append(Register())
    try:
        yield
    finally:
        _commands.pop()


def _note(event: str, about: tuple[Any, ...]) -> None:
    if event == "open" and _commands:
        with suppress(OSError, TypeError, ValueError, LookupError):  # such as the number of a file that is open already
            path, _, flags = about
            if not flags & (os.O_WRONLY | os.O_RDWR):
                name = os.fsdecode(path)
                _commands[-1].names.setdefault(os.path.abspath(name), name)


def require_unread(*paths: Path, read: Iterable[Path] = ()) -> None:
    """Raise BadInput when the command has read a file to write, or it is one of `read`."""
    from flexfem.files.refusals import place_of  # heavy

    registers = [*_commands, Register(read)]
    for path in paths:
        found = next((name for each in registers if (name := each.called(path)) is not None), None)
        if found is not None:
            same = "" if found == str(path) else f"the same file as {place_of(found)}, which "
            raise BadInput(f"{place_of(path)}: {same}is read for what is to be written, expected another file")


def wrote(path: Path) -> None:
    """Say that the command has written a file: it may read it back, and write it again."""
    for each in _commands:
        each.written.add(os.path.abspath(path))


def _node(path: str | Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino
