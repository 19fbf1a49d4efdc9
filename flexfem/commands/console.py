"""How commands print: the options that they share, documents for machines, tables and lines for people."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from flexfem.terminal import people, print_ending, table

LONG = 40  # characters: texts of a list that are longer have lines of their own


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
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value.tolist() if hasattr(value, "tolist") else value


def show(found: Any, as_json: bool, say: Callable[[Any], None] | None = None) -> None:
    """Print what a command found as JSON, or for people by a function, by default that for its type."""
    if as_json:
        print(json.dumps(plain(found), indent=1, allow_nan=False))
    elif say is not None:
        say(found)
    else:
        for each in found if isinstance(found, list) else [found]:
            if hasattr(each, "tables"):
                print_result(each)
            elif hasattr(each, "_asdict"):
                print_record(each)
            else:  # files written, or what says itself
                people().print(str(each))


def show_written(paths: Sequence[Path], as_json: bool, **others: Any) -> None:
    """Print the files written."""
    show({"written": [str(path) for path in paths], **others}, as_json, lambda data: print(*data["written"], sep="\n"))


def print_result(found: Any) -> None:
    """Print the heading, the tables, how they are read, warnings, and how many numbers are in doubt."""
    out = people()
    out.print(found.heading())
    for each in found.tables():
        if each.caption:
            out.print(f"{each.caption}:")
        out.print(table(each.head, each.rows))
    for text in found.sentences():
        out.print(text)
    print_ending(out, found)


def print_record(found: Any) -> None:
    """Print a named tuple: a line for each field, a table for a list of named tuples, keys with equal texts are one."""
    out = people()
    for name, value in found._asdict().items():
        title = name.replace("_", " ")
        if name in ("warnings", "assumed", "not_stated") or value in (None, "", [], False):
            continue
        if isinstance(value, list) and hasattr(value[0], "_fields"):
            out.print(f"{title}:")
            head = [field.replace("_", " ") for field in value[0]._fields]
            out.print(table(head, [[_text(part) for part in one] for one in value]))
        elif hasattr(value, "lines"):
            print(f"{title}:", *value.lines, sep="\n  ")
        elif isinstance(value, dict):
            for text in dict.fromkeys(map(_text, value.values())):
                out.print(f"{', '.join(key for key, each in value.items() if _text(each) == text)}: {text}")
        elif isinstance(value, list) and any(len(str(each)) > LONG for each in value):
            print(f"{title}:", *value, sep="\n")
        else:
            out.print(f"{title}: {_text(value)}")
    print_ending(out, found)


def _text(value: Any) -> str:
    if hasattr(value, "_asdict"):
        return _text(value._asdict())
    if isinstance(value, dict):
        return "; ".join(f"{key.replace('_', ' ')} {_text(each)}" for key, each in value.items() if each is not None)
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value))
    return f"{round(value, 12) + 0.0:.8g}" if isinstance(value, float) else str(value)
