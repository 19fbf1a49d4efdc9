"""Nested plain data as named leaves: the path of a leaf is made of keys and of places in lists."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeAlias

from flexfem.files.keypath import KeyPath

Leaf: TypeAlias = float | int | str | bool | None
Path: TypeAlias = KeyPath


def leaves(tree: Any) -> dict[Path, Leaf]:
    """Every leaf by its path, in the order of the data."""
    return dict(_walk(tree, ()))


def _walk(tree: Any, path: Path) -> Iterator[tuple[Path, Leaf]]:
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from _walk(value, (*path, str(key)))
    elif isinstance(tree, list | tuple):
        for place, value in enumerate(tree):
            yield from _walk(value, (*path, place))
    else:
        yield path, tree if isinstance(tree, float | int | str | None) else str(tree)


def at(tree: Any, path: Path) -> Any:
    """What is at a path. Raises KeyError, IndexError or TypeError where there is nothing."""
    for part in path:
        tree = tree[part]
    return tree


def printable(line: str) -> str:
    """A line without codes that a terminal would act on."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in line)


def matches(pattern: tuple[str, ...], path: Path) -> bool:
    """Whether a path has the pattern, part by part.

    `#` is any place in a list, `2` the third; `*` is any key, `band_*` one that begins so; `**` at the end is any more.
    """
    if pattern[-1] == "**":
        pattern = pattern[:-1]
        path = path[: len(pattern)]
    return len(pattern) == len(path) and all(map(_matches, pattern, path))


def _matches(wanted: str, part: str | int) -> bool:
    if isinstance(part, int):
        return wanted in ("#", str(part))
    return part == wanted or (wanted.endswith("*") and part.startswith(wanted[:-1]))
