"""The command that says what files may say: keys for people, JSON schemas for editors."""

from __future__ import annotations

import json as json_text
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, Wanted
from flexfem.terminal import people

if TYPE_CHECKING:
    from flexfem.reference.keys import KeyTable


def schema(
    format_name: Annotated[
        str | None,
        typer.Argument(
            help="stage, case, study, requirements, fixture, measured, material, stack or necks.",
            metavar="[FORMAT]",
        ),
    ] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Say what a kind of file may say, key by key; --json: as a JSON schema, by which editors complete and check it."""
    from flexfem.reference.formats import FORMATS
    from flexfem.reference.keys import tables_of
    from flexfem.reference.schemas import schema_of, write_schemas

    if output is not None:
        names = [*FORMATS] if format_name is None else [format_name]
        console.show_written(write_schemas(names, output), json)
    elif format_name is None:
        console.show({name: of.about for name, of in FORMATS.items()}, json, _print_formats)
    elif json:
        print(json_text.dumps(schema_of(format_name), indent=1))
    else:
        _print_keys(tables_of(format_name))
        if format_name == "study":
            _print_outputs()


def _print_formats(of: dict[str, Any]) -> None:
    out = people()
    for name, about in of.items():
        out.print(f"{name}: {about}")


def _print_keys(of: list[KeyTable]) -> None:
    """Every key in a line, what it means below it; * where it must be given."""
    out = people()
    for table in of:
        out.print(f"{table.header}  {table.about}" if table.name else table.about)
        for row in table.rows:
            default = f"; default {row.default}" if row.default else ""
            unit = f" {row.unit}:" if row.unit else ":"
            out.print(f"  {row.key}{' *' * row.needed}{unit} {row.value}{default}")
            out.print(f"      {row.meaning}")


def _print_outputs() -> None:
    """The columns that a study answers, and what they mean."""
    from flexfem.study.columns import MEANINGS

    out = people()
    out.print("outputs")
    for columns, meaning in MEANINGS.items():
        out.print(f"  {', '.join(columns)}")
        out.print(f"      {meaning}")
