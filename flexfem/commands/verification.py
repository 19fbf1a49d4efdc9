"""Commands that compare both models: verify, budget, workspace, converge; and the figures of results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem import studies
from flexfem.commands import comparisons, console
from flexfem.commands.console import Json, Output, StageFile, Wanted, check_finite
from flexfem.refused import BadInput
from flexfem.terminal import working

app = typer.Typer()


@app.command()
def workspace(
    stage: StageFile,
    amplitude_um: Annotated[
        float, typer.Option(min=1e-3, max=1e4, help="Largest command in X and Y; in theta 0.02 mrad for every um.")
    ] = 500.0,
    load: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="FX FY M", help="Load on the platform of a driven stage: N, N, N mm."),
    ] = (0.0, 0.0, 0.0),
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Large displacements: linear, tangent (16) with and without its second-order terms, exact, finite elements.

    Of a driven stage also the poses that strokes, contacts, blocking forces and yield allow together.
    """
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import drive as reports
    from flexfem.reports.given import LARGEST_LOAD
    from flexfem.units import unit_of

    loaded = load_feasible(stage)
    check_finite(amplitude_um=amplitude_um)
    console.check_within("--load", load, LARGEST_LOAD)
    largest = amplitude_um / unit_of("amplitude_um").factor
    path, beside = (console.target(output, f"{stage.stem}-{name}") for name in ("workspace", "reach"))
    with working("workspace", reports.steps_of(loaded)) as say:
        found = reports.workspace(loaded, largest, progress=say, load=load)
    if path is not None:
        from flexfem.plot.drive import workspace_figure

        console.keep(found, path, workspace_figure)
        if beside is not None and found.reach is not None:
            from flexfem.plot.drive import reach_figure

            console.keep(found.reach, beside, reach_figure)
    console.show(found, json, comparisons.print_workspace)


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
