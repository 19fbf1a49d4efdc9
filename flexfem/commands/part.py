"""Commands for the way to a part: new files to start from, and drawings and solids for the workshop."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console, reference
from flexfem.commands.console import Json, StageFile, Wanted
from flexfem.commands.tables import people, print_ending
from flexfem.units import LENGTH

if TYPE_CHECKING:
    from flexfem.cad.export import PartReport
    from flexfem.files.templates import NewFiles
    from flexfem.reports.part import View

app = typer.Typer()
app.command()(reference.schema)


@app.command()
def new(
    file: Annotated[Path, typer.Argument(help="Stage file to write, .toml; must not be there yet.", metavar="FILE")],
    case: Annotated[bool, typer.Option("--case", help="Also a case of it, FILE-case.toml, for verify.")] = False,
    study: Annotated[bool, typer.Option("--study", help="Also a study of it, FILE-study.toml, for study run.")] = False,
    json: Json = False,
) -> None:
    """Write a commented stage file to start from."""
    from flexfem.reports import part

    console.show(part.new_stage(file, case, study), json, print_new)


@app.command()
def export(
    stage: StageFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write: .dxf, .step or .svg.")],
    kerf: Annotated[
        float | None, typer.Option(help="Width of the wire's cut, mm: also draws the path of its middle.")
    ] = None,
    holes: Annotated[
        float | None, typer.Option(help="Diameter of a mounting hole in every pad, mm; in no model.")
    ] = None,
    json: Json = False,
) -> None:
    """Write the stage as a drawing or a solid for the workshop, in mm."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import part

    console.show(part.export(load_feasible(stage), output, kerf, holes), json, print_part)


@app.command()
def view(stage: StageFile, output: Wanted = None, json: Json = False) -> None:
    """Draw a stage with its dimensions, in a window where there is a display; an unfinished one as far as it goes."""
    from flexfem.reports import part

    console.show(part.view(stage, output), json, print_view)


def print_view(of: View) -> None:
    """Print where the picture is, and what is missing."""
    out = people()
    out.print(f"file: {of.file}")
    for path in of.written:
        out.print(f"written: {path}")
    if of.window:
        out.print("drawn in a window")
    print_ending(out, of)


def print_new(of: NewFiles) -> None:
    """Print the files written, and what to do with them."""
    out = people()
    for path in of.written:
        out.print(f"written: {path}")
    for text in of.warnings:
        out.print(f"warning: {text}")
    for command in of.commands:
        out.print(f"next: {command}")


def print_part(of: PartReport) -> None:
    """Print what `export` wrote, one value a line."""
    out = people()
    area, volume = f"{LENGTH}^2", f"{LENGTH}^3"
    for what, value, unit in (
        ("file", of.file, ""),
        ("name", of.name, ""),
        ("written", of.written, ""),
        ("thickness", of.thickness, LENGTH),
        ("area", of.area, area),
        ("volume", of.volume, volume),
        ("length of the contours", of.cut, LENGTH),
        ("length of the wire's path", of.path, LENGTH),
        ("kerf", of.kerf, LENGTH),
        ("mounting holes", of.mounting, LENGTH),
        ("layers", ", ".join(of.layers), ""),
    ):
        if value:
            out.print(f"{what}: {value if isinstance(value, str) else f'{value:.8g} {unit}'}")
    print_ending(out, of)
