"""Commands that check the code itself: published problems, other solvers on the same mesh, and accepted numbers."""

from __future__ import annotations

import functools
import sys
from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import comparisons, console
from flexfem.commands.console import FIGURES, Baselines, Json, Resolution, StageFile, Wanted
from flexfem.refused import BadInput

app = typer.Typer()


@app.command("cross-check")
def cross_check(
    stage: StageFile,
    solver: Annotated[str, typer.Option(help="ngsolve or calculix.")] = "ngsolve",
    three_dimensional: Annotated[
        bool,
        typer.Option("--three-dimensional", help="Wedges, two layers in half the thickness; pose and frequencies."),
    ] = False,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Solve the same mesh by another program and compare pose, displacements, neck stresses and natural frequencies."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import validation as reports

    found = reports.cross_check(load_feasible(stage), solver, resolution, three_dimensional)
    console.show(found, json, comparisons.print_cross_check)
    raise typer.Exit(0 if found.passed else 1)


@app.command()
def benchmark(
    name: Annotated[list[str] | None, typer.Option(help="A benchmark by name, more than once for more; all.")] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Solve published problems with known answers and compare: the verification of the code itself."""
    from flexfem.reports import validation as reports

    for stem, endings in (("benchmarks", [".md"]), ("elastica", FIGURES), ("tangent", FIGURES)):
        console.target(output, stem, endings)
    table = reports.benchmark(name, lambda text: print(text, file=sys.stderr))
    if output is not None:
        from flexfem.validate.registry import write_benchmarks

        write_benchmarks(table, output)
        _draw_benchmarks(list(table.seconds), output)
    console.show(table, json, comparisons.print_benchmarks)
    raise typer.Exit(0 if table.passed else 1)


def _draw_benchmarks(names: list[str], output: Path) -> None:
    """The figures of the benchmarks that have one."""
    from flexfem.plot.accuracy import elastica_figure, taylor_figure
    from flexfem.plot.write import write_beside
    from flexfem.validate import bending

    if "elastica" in names:
        write_beside(output / "elastica.png", elastica_figure(bending.cantilever_bent()))
    if "tangent" in names:
        write_beside(output / "tangent.png", taylor_figure(bending.remainders()))


@app.command()
def baseline(
    files: Annotated[list[Path], typer.Argument(help="Stages, cases, claims, studies.", metavar="FILE...")],
    reason: Annotated[str, typer.Option(help="Why the numbers may move; kept in the baseline's history.")],
    baselines: Baselines = None,
    json: Json = False,
) -> None:
    """Accept what flexfem prints of files now as their baselines."""
    from flexfem.commands.baseline import regression

    if not reason.strip():
        raise BadInput("--reason is empty, expected why the numbers may move")
    told = functools.partial(console.told, description="accepting")
    console.show_written(regression.baseline(*files, reason=reason, baselines=baselines, each=told), json)


@app.command()
def regression(
    baselines: Annotated[list[Path], typer.Argument(help="Baselines, or folders of them.", metavar="BASELINE...")],
    json: Json = False,
) -> None:
    """Compare what flexfem prints now with baselines: what changed in the input, else every number that moved."""
    from flexfem.commands.baseline import regression

    comparisons.show_checked(
        regression.regression(*baselines, each=lambda paths: console.told(paths, "checking")), json
    )
