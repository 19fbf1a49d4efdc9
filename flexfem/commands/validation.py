"""Commands that compare with accepted numbers."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import comparisons, console
from flexfem.commands.console import Baselines, Json
from flexfem.refused import BadInput

app = typer.Typer()


@app.command()
def baseline(
    files: Annotated[list[Path], typer.Argument(help="Stages, cases, studies.", metavar="FILE...")],
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
