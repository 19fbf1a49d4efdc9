"""Commands on one stage: check, summary, stiffness, solve, mesh; and the hinge formulas."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import console, stage_tables, tables
from flexfem.commands.at_work import working
from flexfem.commands.console import Json, Resolution, StageFile, Wanted, check_within
from flexfem.refused import BadInput

app = typer.Typer()
Triple = tuple[float, float, float]


@app.command()
def check(stage: StageFile, json: Json = False) -> None:
    """Validate a stage file; print dimensions, hinges, mobility and where the numbers come from."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import stage as reports

    console.show(reports.check(load_feasible(stage)), json, stage_tables.print_stage)


@app.command()
def summary(
    stage: StageFile,
    formula: Annotated[
        str | None, typer.Option(help="Hinge formula by name; default calibrated, where it has a value.")
    ] = None,
    elements: Annotated[bool, typer.Option("--elements", help="Also by finite elements.")] = False,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """How far a stage may go before a neck yields, the force that takes, its stiffness, and warnings."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import stage as reports
    from flexfem.reports.given import RESOLUTION

    wanted = elements or resolution is not None
    found = reports.summary(load_feasible(stage), formula, wanted, resolution or RESOLUTION)
    console.show(found, json, stage_tables.print_summary)


@app.command()
def stiffness(
    stage: StageFile,
    mobility: Annotated[int | None, typer.Option(help="3, 6, 12 or 21; default: the file's prismatic hinges.")] = None,
    formula: Annotated[str | None, typer.Option(help="Hinge formula by name; a wrong one lists them.")] = None,
    links: Annotated[bool, typer.Option("--links", help="Elastic links, pads and platform; mobility 21.")] = False,
    necks: Annotated[
        Path | None, typer.Option(help="Nine measured necks, CSV or TOML: also of the stage as it was made.")
    ] = None,
    elements: Annotated[bool, typer.Option("--elements", help="Stress by finite elements too, with bands.")] = False,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Platform stiffness by the analytic model, (16) to (18), and neck stress per displacement.

    By default the model has calibrated hinges, corrected for thickness, and elastic links.
    """
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import stage as reports

    loaded = load_feasible(stage)
    console.check_links(links, mobility)
    if necks is not None and (elements or resolution is not None):
        raise BadInput("--necks with finite elements, expected one of them: stiffness as made is analytic")
    if necks is not None:
        from flexfem.commands.experiment import print_as_built

        console.show(reports.as_built(loaded, necks, mobility, formula, links), json, print_as_built)
        return
    wanted = console.finest(not (elements or resolution), resolution)
    console.show(reports.stiffness(loaded, mobility, formula, links, wanted), json, tables.print_stiffness)


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
def solve(
    stage: StageFile,
    force: Annotated[
        Triple | None, typer.Option(metavar="FX FY M", help="Load at the platform centre: N, N, N mm.")
    ] = None,
    displacement: Annotated[
        Triple | None,
        typer.Option(metavar="X Y THETA", help="Instead: displacement of the platform to hold: mm, mm, rad."),
    ] = None,
    vtu: Annotated[Path | None, typer.Option(help="Write displacement and stress under the load to this file.")] = None,
    three_dimensional: Annotated[
        bool, typer.Option("--three-dimensional", help="Wedges through the thickness, with bands.")
    ] = False,
    layers: Annotated[int | None, typer.Option(min=3, max=16, help="In half the thickness; default 3.")] = None,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Platform compliance by finite elements in the plane, and what a force or a displacement of the platform does."""
    from flexfem.arguments import LARGEST_DISPLACEMENT, LARGEST_FORCE
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import load as reports
    from flexfem.reports.given import RESOLUTION

    loaded = load_feasible(stage)
    if force is not None and displacement is not None:
        raise BadInput("--force and --displacement, expected one of the two")
    check_within("--force", force, LARGEST_FORCE)
    check_within("--displacement", displacement, LARGEST_DISPLACEMENT)
    if layers is not None and not three_dimensional:
        raise BadInput("--layers without --three-dimensional, expected both: layers are through the thickness")
    if three_dimensional:
        with working("meshing and solving"):
            solid = reports.under_load_solid(loaded, force, displacement, resolution, layers, vtu)
        console.show(solid, json, tables.print_solid)
        return
    with working("meshing and solving"):
        found = reports.under_load(loaded, force, displacement, resolution or RESOLUTION, vtu)
    console.show(found, json, tables.print_load)


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
