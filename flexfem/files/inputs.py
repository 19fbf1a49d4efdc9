"""Input files of a command, which its output may not replace, also not through links."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from flexfem.refused import BadInput

_reads: list[
    dict[tuple[int, int] | None, str]
] = []  # names by inode for the running command; empty in Python
_written: set[str] = set()
_hooked: list[bool] = []


@contextmanager
def recording_inputs() -> Iterator[None]:
    """Record every file that any code opens for reading in the context."""
    if not _hooked:
        _hooked.append(True)
        sys.addaudithook(_note)  # cannot be removed
    _reads.append({})
    _written.clear()
    try:
        yield
    finally:
        _reads.pop()


def _note(event: str, about: tuple[Any, ...]) -> None:
    if event == "open" and _reads:
        with suppress(TypeError, ValueError, LookupError):  # such as a file descriptor
            path, _, flags = about
            if not flags & (os.O_WRONLY | os.O_RDWR):
                _reads[-1].setdefault(_node(os.fsdecode(path)), os.fsdecode(path))


def _node(path: str | Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def require_unread(*paths: Path, read: Iterable[Path] = ()) -> None:
    """Raise BadInput for an output file that the command has read, also through a link, or that is
    one of `read`.
    """
    from flexfem.files.refusals import place_of  # heavy

    names = {node: name for each in _reads for node, name in list(each.items())}
    names |= {_node(path): str(path) for path in read}
    for path in paths:
        node = _node(path)
        if node in names and node is not None and os.path.abspath(path) not in _written:
            same = (
                ""
                if names[node] == str(path)
                else f"the same file as {place_of(names[node])}, which "
            )
            raise BadInput(
                f"{place_of(path)}: {same}is an input of this command, expected another file"
            )


def may_write(path: Path) -> None:
    """Record that a command changes one of its inputs, because the user asks for it."""
    wrote(path)


def wrote(path: Path) -> None:
    """Record that the command has written a file, so that it may read it and write it again."""
    if _reads:
        _written.add(os.path.abspath(path))
