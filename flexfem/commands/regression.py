"""Commands that hold what flexfem prints to accepted numbers: baseline, regression."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import console
from flexfem.commands.options import Baselines, Json
from flexfem.refused import BadInput

app = typer.Typer()


@app.command()
def baseline(
    files: Annotated[list[Path], typer.Argument(help="Stages, cases, claims, studies.", metavar="FILE...")],
    reason: Annotated[str, typer.Option(help="Why the numbers may move; kept in the baseline's history.")],
    baselines: Baselines = None,
    json: Json = False,
) -> None:
    """Accept what flexfem prints of files now as their baselines."""
    from flexfem.commands.baseline import store
    from flexfem.files.writing import check_folder

    if not reason.strip():
        raise BadInput("--reason is empty, expected why the numbers may move")
    places = store.places([(path, baselines or store.folder_of(path)) for path in files])
    for _, folder in places:
        check_folder(folder)
    solve = console.solved_once()
    written = [store.accept(path, folder, reason, solve) for path, folder in console.told(places, "accepting")]
    console.show_written(written, json)


@app.command()
def regression(
    baselines: Annotated[list[Path], typer.Argument(help="Baselines, or folders of them.", metavar="BASELINE...")],
    json: Json = False,
) -> None:
    """Compare what flexfem prints now with baselines: what changed in the input, else every number that moved."""
    from flexfem.commands.baseline import store

    paths, solve = store.listed(baselines), console.solved_once()
    checked = [store.checked(path, solve) for path in console.told(paths, "checking")]
    checked += [store.Checked(str(place), list(store.unaccepted(place))) for place in baselines if place.is_dir()]
    console.show_checked(checked, json)
