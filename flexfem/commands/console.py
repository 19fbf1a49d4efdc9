"""How commands print: the options that they share, documents for machines, tables and lines for people."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from flexfem.results import TextTable


def usable(folder: Path | None) -> Path | None:
    """Refuse an output folder before anything is computed for it."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


OUTPUT = typer.Option("--output", "-o", callback=usable, help="Folder for what is written.")
Wanted = Annotated[Path | None, OUTPUT]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


def plain(value: Any) -> Any:
    """Results, records, named tuples, paths and arrays as plain data; a number that is not finite is None."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "_asdict"):
        said = [name for name, part in vars(type(value)).items() if isinstance(part, property)]
        value = value._asdict() | {name: getattr(value, name) for name in said}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def show(found: Any, as_json: bool, say: Callable[[Any], None] | None = None) -> None:
    """Print what a command found as JSON, or for people by a function, by default that for its type."""
    if as_json:
        print(json.dumps(plain(found), indent=1, allow_nan=False))
    elif say is not None:
        say(found)
    else:
        for each in found if isinstance(found, list) else [found]:
            _print(each)


def show_written(paths: Sequence[Path], as_json: bool, **others: Any) -> None:
    """Print the files written."""
    show({"written": [str(path) for path in paths], **others}, as_json, lambda data: print(*data["written"], sep="\n"))


def _print(found: Any) -> None:
    """Print a result, a named tuple or a text, then warnings and how many numbers are in doubt."""
    from rich.console import Console

    from flexfem.mechanism.stage_file import assumptions_said
    from flexfem.results import record_parts

    terminal = sys.stdout is not None and sys.stdout.isatty()  # else wide: no table is folded in a file
    out = Console(soft_wrap=True, highlight=False, markup=False, color_system=None, width=None if terminal else 200)
    if hasattr(found, "tables"):
        out.print(found.heading())
        _print_tables(out, found.tables())
        for text in found.sentences():
            out.print(text)
    elif hasattr(found, "_asdict"):
        facts, tables = record_parts(found)
        for title, text in facts:
            out.print(f"{title}:{text}" if text.startswith("\n") else f"{title}: {text}")
        _print_tables(out, tables)
    else:  # files written, or what says itself
        out.print(str(found))
    assumptions = getattr(found, "about", found)
    for text in getattr(found, "warnings", []):
        out.print(f"warning: {text}")
    for text in assumptions_said(getattr(assumptions, "assumed", []), getattr(assumptions, "not_stated", [])):
        out.print(f"{text}: --json lists them")


def _print_tables(out: Console, tables: Iterable[TextTable]) -> None:
    """Print tables without lines, each below its caption."""
    from rich.table import Table

    for each in tables:
        made = Table(*each.head, box=None, padding=(0, 2, 0, 0), show_header=any(each.head))
        for row in each.rows:
            made.add_row(*row)
        if each.caption:
            out.print(f"{each.caption}:")
        out.print(made)
