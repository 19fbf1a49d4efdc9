"""Read and check TOML files: every error is one line that names file, line, key, value and expected
value.

The text is split into statements before `tomllib` parses it. This gives the line of every key, and
it rejects nesting that would overflow the stack of `tomllib` or take quadratic time.
"""

from __future__ import annotations

import csv
import os
import re
import stat
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Any, TypeAlias, TypeVar

from pydantic import BaseModel, ValidationError

from flexfem.files.refusals import (
    SHOWN,
    KeyPath,
    Problem,
    checked_path,
    needed,
    one_line,
    place_of,
    problems_of,
    sentence,
    suggestion,
)
from flexfem.refused import BadInput

MAX_BYTES = 2**20
# files that are no TOML, and that many commands take instead of it
DRAWINGS = (".dxf", ".step", ".stp", ".svg")
MAX_DEPTH = 32  # brackets around a value, parts of a dotted key; shipped files have at most four
PORTS = (f"{port}{n}" for port in ("COM", "LPT") for n in range(1, 10))
DEVICES = {"CON", "PRN", "AUX", "NUL", *PORTS}  # of Windows
_STRING = r"""
    (?: \"{3} (?: [^"\\] | \\.? | "{1,2}(?!") )*+ (?: "{3,5} | \Z ) | \'{3} (?: [^'] | '{1,2}(?!') )*+ (?: '{3,5} | \Z )
      | " (?: [^"\\\n] | \\[^\n]? )*+ "? | ' [^'\n]*+ '? )"""  # possessive, also unclosed: linear time on any text  # noqa: E501
_PART = rf"(?: {_STRING} | [^\s\"'\#\[\]{{}}=,.]++ )"
_TOKEN = re.compile(
    rf"(?P<deep> {_PART} (?: [ \t]*+ \. [ \t]*+ {_PART} ){{{MAX_DEPTH}}} ) | \#[^\n]*+ | {_PART} | [\n\[\]{{}}]",  # noqa: E501
    re.VERBOSE | re.DOTALL,
)


class DepthError(Exception):
    """Nesting deeper than `MAX_DEPTH` at a character offset."""


def _ends(text: str) -> Iterator[int]:
    """Yield the offsets at which statements (header, key with value, comment) end.

    Raises DepthError.
    """
    depth = 0
    for match in _TOKEN.finditer(text):
        token = match[0]
        depth += (token in "[{") - (token in "]}" and depth > 0)
        if match["deep"] or depth > MAX_DEPTH:
            raise DepthError(match.start())
        if token == "\n" and depth == 0:
            yield match.end()
    yield len(text)


class TomlFile:
    """The data of a TOML text, and the lines of its key paths.

    Elements of arrays count from zero.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.ends = [*_ends(text)]
        self.data = tomllib.loads(text)

    @cached_property
    def places(self) -> dict[KeyPath, tuple[int, int]]:
        """Line, from 1, of the statement that contains each key path, and rank of the path."""
        found = dict[KeyPath, tuple[int, int]]()
        counts = Counter[KeyPath]()
        line = 1
        table = KeyPath()
        for start, end in pairwise([0, *self.ends]):
            statement = self.text[start:end]
            content: Any = tomllib.loads(statement)
            if statement.lstrip().startswith("["):
                *above, table = _tables_of_header(content, counts)
                for path in above:
                    found.setdefault(path, (line, len(found)))
                # a better line than that of [table.below] before it
                found[table] = (line, len(found))
            else:
                for path in paths_in(content, table):
                    found.setdefault(path, (line, len(found)))
            line += statement.count("\n")
        return {tuple(map(in_mm, path)): place for path, place in found.items()} | found

    def place(self, path: KeyPath) -> tuple[int, int]:
        """Return line and rank of a path, or of its nearest existing table, or (0, -1)."""
        ways_up = (path[:length] for length in range(len(path), 0, -1))
        return next((self.places[way] for way in ways_up if way in self.places), (0, -1))

    def line(self, path: KeyPath) -> int | None:
        """Return the line of a path, or of its nearest existing table, or None."""
        return self.place(path)[0] or None


def _tables_of_header(content: Any, counts: Counter[KeyPath]) -> list[KeyPath]:
    """Return the paths of the tables in a header, the outermost first.

    content : of the header alone.   counts : of the members of each array so far; one is added for
    the header of an array.
    """
    paths = list[KeyPath]()
    table = KeyPath()
    while content:
        if isinstance(content, list):
            counts[table] += 1
            return [*paths, (*table, counts[table] - 1)]
        part, content = next(iter(content.items()))
        table = (*table, part)
        paths.append(table)
        if isinstance(content, dict) and counts[table]:  # in the last table of an array
            table = (*table, counts[table] - 1)
            paths.append(table)
    return paths


def in_mm(key: Any) -> Any:
    """Return the key in mm of a length in inches; any other key, or index, is itself."""
    return re.sub("_in$", "_mm", key) if isinstance(key, str) else key


def line_of(text: str, offset: int) -> int:
    """Return the line, counted from 1, at a character offset."""
    return text.count("\n", 0, offset) + 1


def paths_in(content: Any, above: KeyPath = ()) -> Iterator[KeyPath]:
    """Yield the paths of all keys and indices in a content, which stands at the path `above`."""
    inner = (
        content.items()
        if isinstance(content, dict)
        else enumerate(content)
        if isinstance(content, list)
        else ()
    )
    for part, value in inner:
        yield (*above, part)
        yield from paths_in(value, (*above, part))


PathLike: TypeAlias = str | os.PathLike[str]
Model = TypeVar("Model", bound=BaseModel)


KINDS = {  # by the keys that only files of that kind have
    "stage file": ("material", "chain", "hinges", "platform", "thickness_mm"),
    "mechanism file": (
        "material",
        "thickness_mm",
        "body",
        "hinge",
        "parameters",
        "output",
        "payload",
        "copy",
    ),
    "case file": ("direction", "curve", "points"),
    "study file": ("sampling", "factor", "figure", "model"),
    "requirements file": ("free", "require", "objective"),
    "fixture file": ("pole", "bar", "lvdt", "sensor", "run"),
    "measured file": ("measured",),
    "necks file": ("neck",),
}


def kind_of(data: Mapping[str, Any], expected: str | None = None) -> str | None:
    """Return the kind of file that most keys indicate; `expected` wins a tie.

    It is None where no key indicates one.
    """
    votes = {kind: sum(key in data for key in keys) for kind, keys in KINDS.items()}
    most = max(votes.values())
    leading = [kind for kind, count in votes.items() if count == most]
    return None if most == 0 else expected if expected in leading else leading[0]


def read_toml(path: PathLike) -> TomlFile:
    """Read a TOML file of at most `MAX_BYTES`, nested at most `MAX_DEPTH` deep.

    Raises BadInput for any other file.
    """
    if PurePath(path).suffix.lower() in DRAWINGS:
        made = "which flexfem import makes of a drawing"
        raise BadInput(f"{place_of(path)}: this is a drawing, expected a TOML file, {made}")
    text = read_text(path)
    try:
        return TomlFile(text)
    except DepthError as error:
        place = place_of(path, line_of(text, error.args[0]))
        raise BadInput(f"{place}: nested deeper than {MAX_DEPTH} levels") from None
    except tomllib.TOMLDecodeError as error:
        reason, _, at = str(error).rpartition(" (at ")
        found = re.match(r"line (\d+)", at)
        place = place_of(path, int(found[1]) if found else line_of(text, len(text.rstrip())))
        reason = "this is JSON, such as flexfem writes" if text.startswith("{") else reason
        raise BadInput(f"{place}: not TOML: {one_line(reason, 2 * SHOWN)}") from None
    except ValueError:  # int() refuses more than 4300 digits, and tomllib names no line
        digits = re.search(r"[0-9_]{4000}", text)
        place = place_of(path, line_of(text, digits.start()) if digits else None)
        raise BadInput(f"{place}: not TOML: a number with too many digits") from None


def bad_key(
    path: PathLike,
    key: KeyPath,
    message: str,
) -> BadInput:
    """Return the error for a key of a file, with the file and the line of the key."""
    return BadInput(f"{place_of(path, read_toml(path).line(key))}: {message}")


def validate(
    model_class: type[Model],
    path: PathLike,
    completed: Callable[[dict[str, Any]], dict[str, Any]] | None = None,
) -> Model:
    """Read a TOML file into its model.

    `completed` adds the data of other files that the file names.

    Raises BadInput as `read_toml`, and for a file of another kind and for missing, unknown or
    invalid keys. The first invalid value in the file is named and the others are counted; all
    missing keys are named.
    """
    file = read_toml(path)
    require_plain_stem(path)
    expected = getattr(model_class, "kind", None)
    found = kind_of(file.data, expected)
    data = file.data if completed is None else completed(file.data)
    try:
        return model_class.model_validate(data)
    except ValidationError as error:
        problems = problems_of(error, data)
    if expected and found and found != expected:
        raise BadInput(f"{place_of(path)}: this is a {found}, expected a {expected}")
    ordered = sorted(problems, key=lambda problem: file.place(problem.path))
    wrong = [problem for problem in ordered if problem.kind != "missing"]
    messages = list[str]()
    if wrong:
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        messages.append(sentence(wrong[0], model_class, data) + more)
    if len(wrong) < len(problems):
        messages.append(_missing(problems, model_class, data))
    text = "; ".join(messages)
    if file.data.get("units") == "in":
        text += " (in mm, to which this file is converted)"
    first = wrong[0] if wrong else ordered[0]
    raise BadInput(one_line(f"{place_of(path, file.line(first.path))}: {text}"))


def _missing(
    problems: list[Problem],
    model_class: type[BaseModel],
    data: dict[str, Any],
) -> str:
    """Return which keys are missing."""
    keys = list[str]()
    for problem in problems:
        if problem.kind == "missing":
            keys += needed(problem.path, model_class, data)
    if len(keys) == 1:
        return f"{keys[0]} is missing"
    return f"{', '.join(keys[:-1])} and {keys[-1]} are missing"


def require_plain_stem(path: PathLike) -> None:
    """Raise BadInput for a file whose stem would name results that are hidden, misplaced, or read
    as options.
    """
    stem = PurePath(path).stem
    device = stem.partition(".")[0].rstrip().upper() in DEVICES
    if (
        stem[:1] in ("", ".", "-", " ")
        or stem[-1] in ". "
        or device
        or not stem.isprintable()
        or "\\" in stem
    ):
        raise BadInput(
            f"{place_of(path)}: expected a plain file name, since results are named after it: no "
            "leading dot, blank or hyphen, no trailing dot or blank, no control character, no "
            "backslash, no device of Windows such as CON"
        )


def read_text(path: PathLike) -> str:
    """Return the text of a file of at most `MAX_BYTES`.

    Raises BadInput: not readable, or not UTF-8.
    """
    data = read_bytes(path)
    if data.startswith(b"\xef\xbb\xbf"):
        raise BadInput(
            f"{place_of(path, 1)}: starts with a byte order mark, expected UTF-8 without one"
        )
    if b"\0" in data:
        place = place_of(path, data.count(b"\n", 0, data.index(0)) + 1)
        raise BadInput(f"{place}: a NUL byte, expected UTF-8 text")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        place = place_of(path, data.count(b"\n", 0, error.start) + 1)
        raise BadInput(f"{place}: byte {data[error.start]:#04x} is not UTF-8") from None


def read_csv(
    path: PathLike, required: Sequence[str], optional: Sequence[str] = ()
) -> dict[int, dict[str, str]]:
    """Return the rows of a CSV file by line and column; lines that begin with # are comments.

    Raises BadInput.
    """
    texts = {
        k: text
        for k, text in enumerate(read_text(path).splitlines(), 1)
        if text.strip() and text[0] != "#"
    }
    try:
        rows = [
            (k, [cell.strip() for cell in next(csv.reader([text]))]) for k, text in texts.items()
        ] or [(1, [])]
    except csv.Error as error:
        raise BadInput(f"{place_of(path)}: {error}, expected CSV") from None
    line, head = rows.pop(0)
    if len(set(head)) < len(head) or not set(required) <= set(head) <= {*required, *optional}:
        columns = f"{one_line(', '.join(head), 60) or 'none'}, expected {', '.join(required)}"
        raise BadInput(
            f"{place_of(path, line)}: columns {columns}{''.join(f', [{key}]' for key in optional)}"
        )
    for line, row in rows:
        if len(row) != len(head):
            raise BadInput(
                f"{place_of(path, line)}: {len(row)} values, expected {len(head)}, as the first "
                "line has"
            )
    return {line: dict(zip(head, row, strict=True)) for line, row in rows}


def read_bytes(path: PathLike, most: int = MAX_BYTES) -> bytes:
    """Return the content of a regular file of at most `most` bytes (whole MiB).

    Raises BadInput for any other.
    """
    path = checked_path(path)
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode):
            found = "a directory" if stat.S_ISDIR(mode) else "a pipe, socket or device"
            raise BadInput(f"{place_of(path)}: {found}, expected a regular file")
        with open(path, "rb") as file:
            data = file.read(most + 1)
    except FileNotFoundError:
        raise BadInput(f"{place_of(path)}: no such file{_similar(path)}") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(
            f"{place_of(path)}: cannot be read: {one_line(str(reason), 2 * SHOWN)}"
        ) from None
    if len(data) > most:
        raise BadInput(
            f"{place_of(path)}: more than {most} bytes, expected at most {most >> 20} MiB"
        )
    return data


def _similar(path: Path) -> str:
    """Return ", did you mean ...?" with the file of the same folder whose name without extension is
    closest, or "".
    """
    try:
        files = sorted(name for name in os.listdir(path.parent) if path.with_name(name).is_file())
    except OSError:
        return ""
    # of equal stems the last counts
    files.sort(key=lambda name: (name.endswith(path.suffix), name.endswith(".toml")))
    names = {PurePath(name).stem: name for name in files}
    return suggestion(path.stem, names, lambda stem: place_of(path.with_name(names[stem])))
