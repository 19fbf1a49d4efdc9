"""The command `flexfem schema`: JSON schemas as values, texts and files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from operator import methodcaller
from pathlib import Path
from typing import Any

from flexfem.files.inputs import require_unread
from flexfem.files.refusals import checked_path
from flexfem.files.writing import check_folder, write_atomically
from flexfem.schemas.formats import FORMATS, results
from flexfem.schemas.keys import tables_of
from flexfem.schemas.of_files import schema_of

FILE = "flexfem-{}.schema.json"


class Schema(dict[str, Any]):
    """A JSON schema that prints as a table of the keys of the file."""

    text = ""

    def __str__(self) -> str:
        return self.text


def schema(name: str | None = None, *, output: Path | None = None) -> Schema | list[Path]:
    """Give the JSON schema of a kind of file, or the table of its keys.

    Editors and programs use the schema to check the file. It lists the hinge formulas, materials
    and stacks that are known now, including your own. Editors that know TOML complete and check a
    file whose first line is `#:schema` and the path of a schema.

    Parameters
    ----------
    name : str, optional
        Kind of input file: stage, case, study, requirements, fixture, measured, material, necks or
        mechanism; or of result: stiffness, drift and others. By default all kinds are listed.
    output : path, optional
        Folder for the schema as a file; without a name, for the schemas of all input files.

    Returns
    -------
    dict or list of path
        The schema, or the files written. Raises BadInput when there is no such kind, or the folder
        cannot be written.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.schema("stage")["properties"]["thickness_mm"]["x-unit"]
    'mm'
    """
    if output is not None:
        return _write([*FORMATS] if name is None else [name], checked_path(output))
    if name is None:
        found = Schema({each: kind.about for each, kind in FORMATS.items()})
        found |= {each: f"Result: {kind.title}." for each, kind in results().items()}
        found.text = "\n".join(f"{each}: {about}" for each, about in found.items())
    else:
        found = Schema(schema_of(name))
        found.text = "\n".join(_lines(name))
    return found


def _write(names: list[str], folder: Path) -> list[Path]:
    """Write schemas to a folder; return the files."""
    texts = {
        folder / FILE.format(name): json.dumps(schema_of(name), indent=1) + "\n" for name in names
    }
    check_folder(folder)
    require_unread(*texts)
    for path, text in texts.items():
        write_atomically(path, methodcaller("write", text.encode()))
    return list(texts)


def _lines(name: str) -> Iterator[str]:
    """Yield the keys of a file, or the quantities of a result, each with its meaning below."""
    if name not in FORMATS:
        for quantity, meaning, unit, axes in results()[name].reference().rows:
            labelled = f"{quantity} {unit}" if unit else quantity
            over = axes if axes == "one number" else f"for each {axes}"
            yield f"{labelled}: {over}\n    {meaning}"
        return
    for table in tables_of(name):
        yield f"{table.header}  {table.about}" if table.name else FORMATS[name].about
        for row in table.rows:
            unit = f" {row.unit}:" if row.unit else ":"
            default = f"; default {row.default}" if row.default else ""
            star = " *" if row.needed else ""
            yield f"  {row.key}{star}{unit} {row.value}{default}\n      {row.meaning}"
