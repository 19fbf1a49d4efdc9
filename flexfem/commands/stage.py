"""Commands on one stage: check, summary, stiffness, solve, mesh; and the hinge formulas."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import console, stage_tables
from flexfem.commands.console import Json, Resolution, StageFile, Wanted
from flexfem.terminal import working

app = typer.Typer()
Triple = tuple[float, float, float]


@app.command()
def check(stage: StageFile, json: Json = False) -> None:
    """Validate a stage file; print dimensions, hinges, mobility and where the numbers come from."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import stage as reports

    console.show(reports.check(load_feasible(stage)), json, stage_tables.print_stage)


@app.command()
def mesh(
    stage: StageFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write: .msh, .vtu or .inp.")],
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Mesh a stage and write it with the groups stage, ground and hub."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import stage as reports
    from flexfem.reports.given import RESOLUTION

    loaded = load_feasible(stage)
    with working("meshing"):
        found = reports.mesh(loaded, output, resolution or RESOLUTION)
    console.show(found, json, stage_tables.print_mesh)


@app.command()
def formulas(output: Wanted = None, json: Json = False) -> None:
    """List the hinge formulas with source, freedoms and range; draw them against the finite-element hinge chart."""
    from flexfem.verify import hinges

    chart, thickness = (console.target(output, f"hinge-{name}") for name in ("chart", "thickness"))
    if chart is not None and thickness is not None:
        from flexfem.plot.hinge_chart import hinge_chart_figure, thickness_figure
        from flexfem.plot.write import write_beside

        write_beside(chart, hinge_chart_figure(hinges.hinge_review()))
        write_beside(thickness, thickness_figure(hinges.thickness_review()))
    console.show(hinges.known_formulas(), json, stage_tables.print_formulas)
