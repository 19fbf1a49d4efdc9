"""Where every key of a TOML text stands: one pass over its tokens, which `tomllib` does not tell."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from typing import NamedTuple

from flexfem.files.keypath import KeyPath

MAX_DEPTH = 32  # keys and brackets on the way to a value; the deepest shipped file has four


class LineIndex(NamedTuple):
    """Where every key path of a TOML text stands; array elements and tables of an array count from zero."""

    text: str
    offsets: dict[KeyPath, int]

    def offset(self, path: KeyPath) -> int:
        """Return the character offset of `path`, else of its nearest table that is there, else -1."""
        ways_up = (path[:length] for length in range(len(path), 0, -1))
        return next((self.offsets[way] for way in ways_up if way in self.offsets), -1)

    def line(self, path: KeyPath) -> int | None:
        """Return the line, counted from 1, of `path`, else of its nearest table that is there, else None."""
        offset = self.offset(path)
        return None if offset < 0 else line_of(self.text, offset)


def line_of(text: str, offset: int) -> int:
    """Return the line, counted from 1, at a character offset."""
    return text.count("\n", 0, offset) + 1


# Possessive, and an unclosed string is a token too: linear time on any text.
_TOKEN = re.compile(
    r'''(?P<space> [^\S\n]++ | \#[^\n]*+ )
      | (?P<newline> \n )
      | (?P<string> """ (?: [^"\\] | \\.? | "{1,2}(?!") )*+ (?: "{3,5} | \Z )
                  | \'\'\' (?: [^'] | '{1,2}(?!') )*+ (?: '{3,5} | \Z )
                  | " (?: [^"\\\n] | \\[^\n]? )*+ "? | ' [^'\n]*+ '? )
      | (?P<mark> [\[\]{}=,.] )
      | (?P<bare> [^\s"'\#\[\]{}=,.]++ )''',
    re.VERBOSE | re.DOTALL,
)


class DepthError(Exception):
    """Nesting deeper than `MAX_DEPTH`, at a character offset."""

    def __init__(self, offset: int) -> None:
        self.offset = offset


@dataclass
class _Frame:
    """A table or array being read: its path, where its last value belongs, and how many commas an array has had."""

    path: KeyPath
    is_array: bool = False
    value: KeyPath = ()
    commas: int = 0


@dataclass
class Scan:
    """One pass over the tokens; exact on TOML, harmless on anything else, because `tomllib` judges the text later."""

    offsets: dict[KeyPath, int] = field(default_factory=dict)
    tables: dict[KeyPath, int] = field(default_factory=dict)  # how many [[...]] of each array of tables so far
    stack: list[_Frame] = field(default_factory=lambda: [_Frame(())])
    key: list[str] = field(default_factory=list)
    key_offset: int = 0
    dotted: bool = False  # a dot came last
    brackets: int = 0  # of the header in this line
    in_value: bool = False

    def read(self, text: str) -> dict[KeyPath, int]:
        """Return the character offset of every key path of the text; raise DepthError."""
        for match in _TOKEN.finditer(text):
            kind, token, offset = match.lastgroup, match.group(), match.start()
            if kind == "newline" and len(self.stack) == 1:
                self.key, self.dotted, self.brackets, self.in_value = [], False, 0, False
            elif kind in ("newline", "space"):
                continue
            elif self.in_value:
                self._value(token, offset)
            else:
                self._key(token, offset)
        return self.offsets

    def _note(self, path: KeyPath, offset: int) -> None:
        if len(path) > MAX_DEPTH:
            raise DepthError(offset)
        self.offsets.setdefault(path, offset)

    def _key(self, token: str, offset: int) -> None:
        if token == "[" and not self.key and len(self.stack) == 1:
            self.brackets += 1
        elif token == "]" and self.key and self.brackets:
            self._header()
        elif token == "=":
            self._assign()
        elif token == "}":
            self._close()
        elif token == ".":
            self.dotted = True
        elif token not in ("[", "]", "{", ","):
            if not self.dotted:  # else a line of prose would count as a deep key
                self.key, self.key_offset = [], offset
            self.key, self.dotted = [*self.key, _unquoted(token)], False
            if len(self.key) > MAX_DEPTH:
                raise DepthError(offset)

    def _header(self) -> None:
        path: KeyPath = ()
        for part in self.key[:-1]:
            path = (*path, part)
            self._note(path, self.key_offset)
            path = (*path, self.tables[path] - 1) if path in self.tables else path
        path = (*path, self.key[-1])
        if self.brackets > 1:
            self._note(path, self.key_offset)
            self.tables[path] = self.tables.get(path, 0) + 1
            path = (*path, self.tables[path] - 1)
        self.offsets.pop(path, None)  # its own header is a better place than [path.below] before it
        self._note(path, self.key_offset)
        self.stack, self.key = [_Frame(path)], []

    def _assign(self) -> None:
        frame = self.stack[-1]
        for length in range(1, len(self.key) + 1):
            frame.value = (*frame.path, *self.key[:length])
            self._note(frame.value, self.key_offset)
        self.key, self.in_value = [], True

    def _value(self, token: str, offset: int) -> None:
        frame = self.stack[-1]
        path = (*frame.path, frame.commas) if frame.is_array else frame.value
        if token in ("]", "}"):
            self._close()
        elif token == "," and frame.is_array:
            frame.commas += 1
        elif token == ",":
            self.in_value = len(self.stack) == 1
        else:
            self._note(path, offset)
            if token in ("[", "{"):
                self.stack.append(_Frame(path, is_array=token == "["))
                self.in_value = token == "["

    def _close(self) -> None:
        if len(self.stack) > 1:
            self.stack.pop()
        self.in_value = True


def _unquoted(token: str) -> str:
    if token[0] == '"' and "\\" in token:
        try:
            return str(tomllib.loads(f"key = {token}")["key"])
        except ValueError:
            return token
    return token[1:-1] if token[0] in "\"'" else token
