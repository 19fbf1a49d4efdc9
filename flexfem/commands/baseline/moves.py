"""Nested plain data as named leaves, and which of them moved by more than a rule allows.

The path of a leaf is made of keys and of places in lists. Texts may not move at all; what is not compared is in
`NOT_COMPARED`. A number that is zero but for round-off is held to the size of its neighbours.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.files.refusals import KeyPath, key_path

Leaf: TypeAlias = float | int | str | bool | None
MISSING = "\0missing"
ROUND_OFF = 1e-10  # of the size of its neighbours: a number below is zero but for the arithmetic
JOINTS = 1e-11  # least `Gate.zero` with joints commanded: their zeros were 1e-14, 9e-13 and 1.8e-12 on three processors
NOT_COMPARED = (("*", "versions", "**"), ("*", "written"), ("*", "seconds"))  # what made a record, and when
UNORDERED = ("assumed", "not_stated")  # lists of keys
SENTENCES = (  # their numbers are rounded
    ("*", "warnings", "#"),
    ("*", "*", "warnings", "#"),
)
DECIMAL = re.compile(r"-?\d+(?:\.(\d+))?(?:e([+-]?\d+))?")
LAST_PLACES = 2  # units of the last place that a rounded number may move
EMPTY = 1e-9  # of a rounded round-off zero only the size is said


def leaves(tree: Any) -> dict[KeyPath, Leaf]:
    """Every leaf by its path, in the order of the data."""
    return dict(_walk(tree, ()))


def _walk(tree: Any, path: KeyPath) -> Iterator[tuple[KeyPath, Leaf]]:
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from _walk(value, (*path, str(key)))
    elif isinstance(tree, list | tuple):
        for place, value in enumerate(tree):
            yield from _walk(value, (*path, place))
    else:
        yield path, tree if isinstance(tree, float | int | str | None) else str(tree)


def at(tree: Any, path: KeyPath) -> Any:
    """What is at a path. Raises KeyError, IndexError or TypeError where there is nothing."""
    for part in path:
        tree = tree[part]
    return tree


def printable(line: str) -> str:
    """A line without codes that a terminal would act on."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in line)


def matches(pattern: tuple[str, ...], path: KeyPath) -> bool:
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


def became(was: Leaf, now: Leaf, said: Callable[[Leaf], str] = str) -> str:
    """What became of a leaf, in words; `MISSING` where there is none."""
    if was == MISSING:
        return f"is new: {said(now)}"
    if now == MISSING:
        return f"is gone, was {said(was)}"
    return f"was {said(was)}, is {said(now)}"


class Gate(NamedTuple):
    """What a number may move by: a part of itself, and a part of the size of its neighbours.

    zero : part of that size by which a number that is zero but for round-off may move.
    """

    own: float
    size: float = 0.0
    zero: float = 1e-12


Size: TypeAlias = Callable[[Any, KeyPath], float]


class Dimension(NamedTuple):
    """Units by place in a vector or matrix, and the size of a number's neighbours in the same unit."""

    units: Any
    size: Size

    def unit(self, path: KeyPath) -> str:
        """The unit of the number at a path."""
        found = self.units
        for place in [part for part in path if isinstance(part, int)][-np.ndim(found) :] if np.ndim(found) else ():
            found = found[place]
        return str(found)


class Rule(NamedTuple):
    """The gate of the numbers whose paths have a pattern."""

    pattern: tuple[str, ...]
    gate: Gate
    dimension: Dimension


class Move(NamedTuple):
    """A leaf that is not where the baseline has it; `MISSING` where there is none."""

    file: str
    name: str
    was: Leaf
    now: Leaf
    allowed: float | None
    unit: str

    def __str__(self) -> str:
        """One line for people: was, is, moved, allowed."""
        return printable(f"{self.file}: {self.name} {became(self.was, self.now, _said)}{self._moved}")

    @property
    def _moved(self) -> str:
        if self.allowed is None:
            return ""
        return f", moved {self.now - self.was:+.3g}, allowed {self.allowed:.2g} {self.unit}".rstrip()  # type: ignore[operator]


def _said(value: Leaf) -> str:
    return f"{value:.15g}" if _number(value) else "none" if value is None else str(value)


def _number(value: Leaf) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool)


def compared(path: KeyPath) -> bool:
    """Whether a leaf is compared at all."""
    return not any(matches(pattern, path) for pattern in NOT_COMPARED)


def allowed(record: Any, path: KeyPath, rule: Rule) -> float:
    """What the accepted number at a path may move by."""
    was = abs(float(at(record, path)))
    size = rule.dimension.size(record, path)
    joints = isinstance(record, Mapping) and record.get("result", {}).get("drive", "force") != "force"
    zero = max(rule.gate.zero, JOINTS) if joints else rule.gate.zero
    if was <= max(ROUND_OFF, zero) * size:
        return zero * size
    return rule.gate.own * was + rule.gate.size * size


def moves(file: str, accepted: Any, now: Any, rule_of: Callable[[KeyPath], Rule]) -> list[Move]:
    """Leaves that moved by more than allowed, came or went, in the order of the baseline."""
    was, new = leaves(accepted), leaves(_in_order_of(accepted, now))
    found = []
    for path in [*was, *(path for path in new if path not in was)]:
        old, fresh = was.get(path, MISSING), new.get(path, MISSING)
        rule = rule_of(path)
        limit = allowed(accepted, path, rule) if _number(old) and _number(fresh) else None
        if compared(path) and not _stands(path, old, fresh, limit):
            found.append(Move(file, key_path(path), old, fresh, limit, rule.dimension.unit(path)))
    return found


def _in_order_of(accepted: Any, now: Any, key: str = "") -> Any:
    """What is now, with the lists of keys that differ in order alone, as their file's overrides may, as accepted."""
    if isinstance(accepted, Mapping) and isinstance(now, Mapping):
        return {name: _in_order_of(accepted.get(name), value, str(name)) for name, value in now.items()}
    if isinstance(accepted, list | tuple) and isinstance(now, list | tuple):
        if key in UNORDERED and sorted(map(str, accepted)) == sorted(map(str, now)):
            return accepted
        return [_in_order_of(*pair) for pair in zip(accepted, now, strict=False)] + list(now[len(accepted) :])
    return now


def _stands(path: KeyPath, was: Leaf, now: Leaf, limit: float | None) -> bool:
    if limit is not None:
        return bool(abs(now - was) <= limit)  # type: ignore[operator]
    if isinstance(was, str) and isinstance(now, str) and any(matches(pattern, path) for pattern in SENTENCES):
        return _says_the_same(was, now)
    return type(was) is type(now) and was == now


def _says_the_same(was: str, now: str) -> bool:
    """Whether two sentences have the same words, and the same numbers but for their last places."""
    if DECIMAL.sub("#", was) != DECIMAL.sub("#", now):
        return False
    pairs = zip(DECIMAL.finditer(was), DECIMAL.finditer(now), strict=True)
    return all(_rounded_alike(old, new) for old, new in pairs)


def _rounded_alike(was: re.Match[str], now: re.Match[str]) -> bool:
    old, new = float(was[0]), float(now[0])
    place = 10.0 ** (int(was[2] or 0) - len(was[1] or ""))
    return abs(new - old) <= LAST_PLACES * place or max(abs(old), abs(new)) <= EMPTY
