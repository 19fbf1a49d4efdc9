"""Commands that compare both models: verify, budget, converge; and the figures of results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem import studies
from flexfem.commands import comparisons, console
from flexfem.commands.console import Baselines, Json, Output, StageFile, Wanted, check_finite
from flexfem.refused import BadInput
from flexfem.terminal import working
from flexfem.units import Direction

app = typer.Typer()


@app.command()
def verify(
    cases: Annotated[list[Path], typer.Argument(help="Case files, see flexfem schema case.", metavar="CASE...")],
    output: Output = studies.REPORTS,
    check: Annotated[
        bool, typer.Option("--check", help="Compare with the baselines; exit 1 if a number moved.")
    ] = False,
    baselines: Baselines = None,
    json: Json = False,
) -> None:
    """Apply the analytic force of (18), or joint commands, to the finite elements; errors as in Figures 5 to 7."""
    from flexfem.commands.baseline import store
    from flexfem.verify.result_files import write_result

    loaded = console.load_cases(cases)
    folders = [baselines or store.folder_of(case.path) for case in loaded]
    if check:  # before anything is computed
        for case, folder in zip(loaded, folders, strict=True):
            store.read_baseline(store.file_of(case.path, folder))
    for case in loaded:
        console.target(output, case.stem, [".npz"])
    solve, results = console.solved_once(), []
    for result, fields in console.run_cases(loaded, solve):
        write_result(result, fields, output)
        results.append(result)
    if check:
        made = zip(loaded, folders, results, strict=True)
        comparisons.show_checked([store.checked_case(case, folder, solve, one) for case, folder, one in made], json)
    console.show(
        results[0] if len(results) == 1 else results, json, lambda _: comparisons.print_results(results, output)
    )


@app.command()
def budget(
    stage: StageFile,
    amplitude_um: Annotated[
        float, typer.Option(min=1e-3, max=1e4, help="Command in X and Y of the large-displacement share.")
    ] = 50.0,
    amplitude_mrad: Annotated[float, typer.Option(min=1e-3, max=1e3, help="And in theta.")] = 1.0,
    three_dimensional: Annotated[
        bool, typer.Option("--three-dimensional/--plane", help="Measure what three dimensions change, or leave it out.")
    ] = True,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Split the error of the stage's own analytic model into named shares that add up to it."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import verification as reports
    from flexfem.units import unit_of

    loaded = load_feasible(stage)
    check_finite(amplitude_um=amplitude_um, amplitude_mrad=amplitude_mrad)
    length, angle = amplitude_um / unit_of("amplitude_um").factor, amplitude_mrad / unit_of("amplitude_mrad").factor
    amplitudes: dict[Direction, float] = {"x": length, "y": length, "theta": angle}
    path = console.target(output, f"{stage.stem}-budget")
    with working("meshing and solving", 3) as say:
        found = reports.budget(loaded, amplitudes, progress=say, three_dimensional=three_dimensional)
    if path is not None:
        from flexfem.plot.errors import budget_figure

        console.keep(found, path, budget_figure)
    console.show(found, json, comparisons.print_budget)


@app.command()
def converge(
    stage: StageFile,
    level: Annotated[
        list[int] | None,
        typer.Option(min=2, max=64, help="Triangles across every neck, coarse to fine; give three or more."),
    ] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Solve a stage on finer and finer meshes: observed order, extrapolated compliance, band."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import verification as reports
    from flexfem.verify.converge import RESOLUTIONS

    loaded, resolutions = load_feasible(stage), level or RESOLUTIONS
    path = console.target(output, f"{stage.stem}-convergence")
    with working("refining", len(resolutions)) as say:
        found = reports.converge(loaded, resolutions, say)
    if path is not None:
        from flexfem.plot.errors import convergence_figure

        console.keep(found, path, convergence_figure)
    console.show(found, json, comparisons.print_convergence)


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
    from flexfem.verify.result_files import read_fields, read_result

    designs = [(path, read_design(path)) for path in results if is_design(path)]
    read = [(path, read_result(path)) for path in results if path not in dict(designs)]
    if displacement and not read:
        raise BadInput(f"{place_of(results[0])}: --displacement with a design, expected results of flexfem verify")
    stored, written = [(result, read_fields(path, result)) for path, result in read], list[Path]()
    if stored:
        with console.side_by_side() as each:
            written += write_figures(stored, output, each, displacement)
    for path, found in designs:
        written += write_design_figures(found, output / path.name)
    console.show_written(written, json)
