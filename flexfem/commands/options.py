"""Arguments and options that commands share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from flexfem.refused import BadInput


def _usable(folder: Path | None) -> Path | None:
    """Refuse an output folder before anything is computed for it."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


FOLDER = typer.Option("--output", "-o", callback=_usable, help="Folder for what is written.")
Output = Annotated[Path, FOLDER]
Wanted = Annotated[Path | None, FOLDER]
Stage = Annotated[Path, typer.Argument(help="Stage file, see geometry/README.md.", metavar="STAGE")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Resolution = Annotated[int | None, typer.Option(min=2, max=64, help="Triangles across every neck.")]
Baselines = Annotated[Path | None, typer.Option(help="Folder of baselines; default `baselines` beside each file.")]


def check_finite(**amplitudes: float) -> None:
    """Raise BadInput for an option that is not a number; the limits of options do not catch nan."""
    for name, value in amplitudes.items():
        if not math.isfinite(value):
            raise BadInput(f"--{name.replace('_', '-')} {value}, expected a number")


def check_within(option: str, values: tuple[float, ...] | None, largest: float) -> None:
    """Raise BadInput for numbers that are not numbers, or absurdly large."""
    if values is not None and not all(abs(value) <= largest for value in values):
        raise BadInput(f"{option} {' '.join(map(str, values))}, expected three numbers within ±{largest:g}")
