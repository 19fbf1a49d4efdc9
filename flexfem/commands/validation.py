"""Commands that check the code itself: published problems with known answers, and other solvers on the same mesh."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from flexfem.commands import console, tables
from flexfem.commands.options import Json, Resolution, Stage, Wanted

app = typer.Typer()


@app.command("cross-check")
def cross_check(
    stage: Stage,
    solver: Annotated[str, typer.Option(help="ngsolve or calculix.")] = "ngsolve",
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Solve the same mesh by another program and compare pose, displacements and neck stresses."""
    from flexfem.commands import answers
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.stage.schema import load_feasible
    from flexfem.validate import compare

    loaded = load_feasible(stage)
    found = compare.cross_check(loaded, resolution or RESOLUTION, solver)
    console.show(answers.of_cross_check(loaded, found), json, tables.print_cross_check)
    raise typer.Exit(0 if found.passed else 1)


@app.command()
def benchmark(
    name: Annotated[list[str] | None, typer.Option(help="A benchmark by name, more than once for more; all.")] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Solve published problems with known answers and compare: the verification of the code itself."""
    from flexfem.commands import answers
    from flexfem.validate.registry import run_benchmarks, write_benchmarks

    table = run_benchmarks(name, lambda text: print(text, file=sys.stderr))
    if output is not None:
        from flexfem.plot.accuracy import elastica_figure, taylor_figure
        from flexfem.plot.write import write_beside
        from flexfem.validate import bending

        write_benchmarks(table, output)
        if "elastica" in table.seconds:
            write_beside(output / "elastica.png", elastica_figure(bending.cantilever_bent()))
        if "tangent" in table.seconds:
            write_beside(output / "tangent.png", taylor_figure(bending.remainders()))
    console.show(answers.of_benchmarks(table), json, tables.print_benchmarks)
    raise typer.Exit(0 if table.passed else 1)
