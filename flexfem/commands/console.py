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
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from flexfem.results import TextTable


def usable(folder: Path | None) -> Path | None:
    """Refuse an output folder that is not writable, before any computation."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


WIDTH = 80
GAP = 2  # characters of a line in a file, and between two columns
NARROWEST = 8
LONGEST = 30  # characters of a heading, and of the name of a row, in tables that are too wide

OUTPUT = typer.Option("--output", "-o", callback=usable, help="Folder for the written files.")
OutputFolder = Annotated[Path | None, OUTPUT]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


def plain(value: Any) -> Any:
    """Convert results, records, named tuples, paths and arrays to plain data; non-finite numbers
    become None.
    """
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "_asdict"):
        properties = [
            name for name, part in vars(type(value)).items() if isinstance(part, property)
        ]
        value = value._asdict() | {name: getattr(value, name) for name in properties}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def show(found: Any, as_json: bool) -> None:
    """Print the result of a command as JSON, or as tables and lines."""
    if as_json:
        print(json.dumps(plain(found), indent=1, allow_nan=False))
    else:
        for result in found if isinstance(found, list) else [found]:
            _print(result)


def _print(found: Any) -> None:
    """Print a result, a named tuple or a text, then its warnings and the counts of assumptions."""
    from rich.console import Console

    from flexfem.paper.stage_file import assumptions_said
    from flexfem.results import record_parts

    terminal = sys.stdout is not None and sys.stdout.isatty()  # in a file each sentence is a line
    width = None if terminal else shutil.get_terminal_size((WIDTH, 24)).columns
    out = Console(
        soft_wrap=not terminal, highlight=False, markup=False, color_system=None, width=width
    )
    warnings = getattr(found, "warnings", [])
    key = getattr(found, "main_key", "")
    for text in (first := [text for text in warnings if key and text.startswith(key)]):
        out.print(f"warning: {text}")
    if hasattr(found, "tables"):
        if answer := getattr(found, "answer", str)():
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
    assumptions = getattr(found, "about", found)
    for text in warnings:
        if text not in first:
            out.print(f"warning: {text}")
    for text in assumptions_said(
        getattr(assumptions, "assumed", []), getattr(assumptions, "not_stated", [])
    ):
        out.print(f"{text}: --json lists them")


def print_tables(out: Console, tables: Iterable[TextTable], width: int) -> None:
    """Print tables without rules, each below its caption; those wider than `width` in parts with
    the same rows.
    """
    from rich.table import Table

    from flexfem.results import SPACE

    for content in tables:
        columns = [list(column) for column in zip(content.head, *content.rows, strict=True)]
        if not _fits(columns, GAP, width):
            for column in columns:
                words = re.sub(r" (?=[^(]*\)$)", SPACE, column[0])  # a unit stays in one line
                column[0] = fill(words, max(_width(column[1:]), NARROWEST), break_long_words=False)
            columns[0] = [fill(cell, LONGEST) if "\n" not in cell else cell for cell in columns[0]]
        names = min(content.names, len(columns) - 1) or 1
        for gap, count in ((GAP, 1), (1, 1), *((GAP, count) for count in range(2, len(columns)))):
            size = -(-(len(columns) - names) // count) or 1
            parts = [
                columns[:names] + columns[k : k + size] for k in range(names, len(columns), size)
            ] or [columns]
            if size == 1 or all(_fits(part, gap, width) for part in parts):
                break
        out.print()
        if content.caption:
            out.print(f"{content.caption}:")
        for part in parts:
            look: dict[str, Any] = {"box": None, "padding": (0, gap, 0, 0), "pad_edge": False}
            table = Table(*(column[0] for column in part), **look, show_header=any(content.head))
            for row in zip(*(column[1:] for column in part), strict=True):
                table.add_row(*row)
            out.print(table)
    out.print()


def _fits(columns: Sequence[Sequence[str]], gap: int, width: int) -> bool:
    return sum(_width(column) + gap for column in columns) - gap <= width


def _width(column: Sequence[str]) -> int:
    return max((len(line) for cell in column for line in cell.split("\n")), default=0)
