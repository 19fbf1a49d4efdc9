"""The figures of stored results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem import studies
from flexfem.commands import console
from flexfem.commands.console import Json, Output
from flexfem.refused import BadInput

app = typer.Typer()


@app.command()
def plot(
    results: Annotated[list[Path], typer.Argument(help="Results of flexfem verify or design.", metavar="RESULT...")],
    output: Output = studies.REPORTS,
    displacement: Annotated[
        bool, typer.Option("--displacement", help="Show displacements in the commanded direction, errors across.")
    ] = False,
    json: Json = False,
) -> None:
    """Draw figures and the report page from stored results, as PNG and PDF."""
    from flexfem.design.result import is_design, read_design
    from flexfem.files.refusals import place_of
    from flexfem.plot.write import write_design_figures, write_figures
    from flexfem.questions.errors import Verification

    designs = [(path, read_design(path)) for path in results if is_design(path)]
    read = [(path, Verification.read(path)) for path in results if path not in dict(designs)]
    if displacement and not read:
        raise BadInput(f"{place_of(results[0])}: --displacement with a design, expected results of flexfem verify")
    stored, written = [(result, result.read_fields(path)) for path, result in read], list[Path]()
    if stored:
        with console.side_by_side() as each:
            written += write_figures(stored, output, each, displacement)
    for path, found in designs:
        written += write_design_figures(found, output / path.name)
    console.show_written(written, json)
