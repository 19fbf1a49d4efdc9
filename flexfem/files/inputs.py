"""Input files of a command, which its output may not replace, also not through links."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from flexfem.refused import BadInput

_reads: list[dict[tuple[int, int] | None, str]] = []  # names by inode for the running command; empty in Python


@contextmanager
def noted() -> Iterator[None]:
    """Keep the names of the files for which `note` is called in the context."""
    _reads.append({})
    try:
        yield
    finally:
        _reads.pop()


def note(path: Path) -> None:
    """Record that a running command reads a file."""
    if _reads:
        _reads[-1].setdefault(_node(path), str(path))


def _node(path: Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def require_unread(*paths: Path, read: Iterable[Path] = ()) -> None:
    """Raise BadInput for an output file that the command has read, also through a link, or that is one of `read`."""
    from flexfem.files.refusals import place_of  # heavy

    names = {node: name for each in _reads for node, name in each.items()}
    names |= {_node(path): str(path) for path in read}
    for path in paths:
        node = _node(path)
        if node in names and node is not None:
            same = "" if names[node] == str(path) else f"the same file as {place_of(names[node])}, which "
            raise BadInput(f"{place_of(path)}: {same}is an input of this command, expected another file")
