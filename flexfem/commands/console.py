"""Shared options of commands, and their output: JSON for machines, tables and lines for people."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeAlias

import typer

from flexfem.commands.written import check_output

if TYPE_CHECKING:
    from rich.console import Console

    from flexfem.results import TextTable


def usable(folder: Path | None) -> Path | None:
    """Refuse an output folder that is not writable, before any computation."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


WIDTH = 80  # characters of a line in a file
GAP = 2  # characters between two columns
NARROWEST = 8  # characters of a heading in a table that is too wide
LONGEST = 30  # characters of the name of a row in a table that is too wide

OUTPUT = typer.Option("--output", "-o", callback=usable, help="Folder for the written files.")
OutputFolder = Annotated[Path | None, OUTPUT]
All = Annotated[bool, typer.Option("--all", help="Print matrices and other details, too.")]
NAMES = "File to write, .csv, .json, .html, .png, .pdf or .vtu; or a folder for all files."
OutputOfResult = Annotated[
    Path | None, typer.Option("--output", "-o", callback=check_output, help=NAMES)
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


def plain(value: Any) -> Any:
    """Convert results, records, paths and arrays to plain data; non-finite numbers become None."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "_asdict"):
        value = _fields_and_properties(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def _fields_and_properties(record: Any) -> dict[str, Any]:
    members = vars(type(record)).items()
    properties = [name for name, member in members if isinstance(member, property)]
    return {**record._asdict(), **{name: getattr(record, name) for name in properties}}


def show(
    found: Any,
    as_json: bool,
    whole: bool = False,
) -> None:
    """Print the result of a command as JSON, or as tables and lines; `whole` with all details."""
    if as_json:
        print(json.dumps(plain(found), indent=1, allow_nan=False))
        return
    for result in found if isinstance(found, list) else [found]:
        _print(result, whole)


def _print(found: Any, whole: bool) -> None:
    """Print a result, a named tuple or a text, then its warnings and the counts of assumptions."""
    from flexfem.files.provenance import assumptions_said

    out = _console()
    warnings = getattr(found, "warnings", [])
    key = getattr(found, "main_key", "")  # of the file, on which the main number depends
    first = [text for text in warnings if key and text.startswith(key)]
    for text in first:
        out.print(f"warning: {text}")
    _print_content(out, found, whole)
    for text in warnings:
        if text not in first:
            out.print(f"warning: {text}")
    about = getattr(found, "about", found)
    assumed = getattr(about, "assumed", [])
    not_stated = getattr(about, "not_stated", [])
    for text in assumptions_said(assumed, not_stated):
        out.print(f"{text}: --json lists them")


def _console() -> Console:
    """Return a console without colours; in a file each sentence is a line."""
    from rich.console import Console

    terminal = sys.stdout is not None and sys.stdout.isatty()
    width = None if terminal else shutil.get_terminal_size((WIDTH, 24)).columns
    plain_look: Any = {"highlight": False, "markup": False, "color_system": None}
    return Console(soft_wrap=not terminal, width=width, **plain_look)


def _print_content(
    out: Console,
    found: Any,
    whole: bool,
) -> None:
    """Print the tables and sentences of a result, the parts of a named tuple, or a text."""
    from flexfem.results import record_parts

    if hasattr(found, "left_out"):
        _print_result(out, found, whole)
    elif hasattr(found, "tables"):
        answer = getattr(found, "answer", str)()
        if answer:
            out.print(answer)
        out.print(found.heading())
        print_tables(out, found.tables(), out.width)
        for text in found.sentences():
            out.print(text)
    elif hasattr(found, "_asdict"):
        facts, tables = record_parts(found)
        for title, text in facts:
            out.print(f"{title}:{text}" if text.startswith("\n") else f"{title}: {text}")
        print_tables(out, tables, out.width)
    else:
        out.print(str(found))


def _print_result(
    out: Console,
    found: Any,
    whole: bool,
) -> None:
    """Print the answer of a question, its tables and explanations, and what `--all` adds."""
    answer = found.answer()
    if answer:
        out.print(answer)
    out.print(found.heading())
    print_tables(out, found.tables(brief=not whole), out.width)
    for text in found.sentences(brief=not whole):
        out.print(text)
    more = [] if whole else found.left_out()
    if more:
        out.print(f"--all also shows: {'; '.join(more)}")


Columns: TypeAlias = list[list[str]]  # each with its heading first


class _Division(NamedTuple):
    """A table in parts with the same rows, and the characters between its columns."""

    parts: list[Columns]
    gap: int


def print_tables(
    out: Console,
    tables: Iterable[TextTable],
    width: int,
) -> None:
    """Print tables without rules, each below its caption.

    Those wider than `width` are divided into parts with the same rows.
    """
    for content in tables:
        columns = [list(column) for column in zip(content.head, *content.rows, strict=True)]
        if not _fits(columns, GAP, width):
            columns = _with_short_names(columns)
        names = min(content.names, len(columns) - 1) or 1
        division = _divided(columns, names, width)
        out.print()
        if content.caption:
            out.print(f"{content.caption}:")
        for part in division.parts:
            _print_part(out, part, division.gap, any(content.head))
    out.print()


def _with_short_names(columns: Columns) -> Columns:
    """Return columns whose headings, and whose names of rows, are broken into lines."""
    from flexfem.results import SPACE

    shortened = Columns()
    for heading, *cells in columns:
        words = re.sub(r" (?=[^(]*\)$)", SPACE, heading)  # a unit stays in one line
        broken = fill(words, max(_width(cells), NARROWEST), break_long_words=False)
        shortened.append([broken, *cells])
    shortened[0] = [cell if "\n" in cell else fill(cell, LONGEST) for cell in shortened[0]]
    return shortened


def _divided(
    columns: Columns,
    names: int,
    width: int,
) -> _Division:
    """Divide the columns after those of the names into as few parts as fit a width."""
    tries = [(1, GAP), (1, 1), *((count, GAP) for count in range(2, len(columns)))]
    for count, gap in tries:
        size = math.ceil((len(columns) - names) / count) or 1
        starts = range(names, len(columns), size)
        parts = [columns[:names] + columns[k : k + size] for k in starts] or [columns]
        if size == 1 or all(_fits(part, gap, width) for part in parts):
            break
    return _Division(parts, gap)


def _print_part(
    out: Console,
    columns: Columns,
    gap: int,
    show_header: bool,
) -> None:
    from rich.table import Table

    look: dict[str, Any] = {"box": None, "padding": (0, gap, 0, 0), "pad_edge": False}
    table = Table(*(column[0] for column in columns), **look, show_header=show_header)
    for row in zip(*(column[1:] for column in columns), strict=True):
        table.add_row(*row)
    out.print(table)


def _fits(
    columns: Sequence[Sequence[str]],
    gap: int,
    width: int,
) -> bool:
    return sum(_width(column) + gap for column in columns) - gap <= width


def _width(column: Sequence[str]) -> int:
    return max((len(line) for cell in column for line in cell.split("\n")), default=0)
