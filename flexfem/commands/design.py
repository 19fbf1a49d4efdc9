"""`flexfem design`: from requirements to a stage."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, Wanted, print_result
from flexfem.sources import ONE_THREAD
from flexfem.terminal import raw

app = typer.Typer()
EVERY = 10.0  # s between two lines where no terminal shows how far it is


@app.command()
def design(
    requirements: Annotated[Path, typer.Argument(help="See flexfem schema requirements.", metavar="FILE")],
    output: Wanted = None,
    workers: Annotated[int, typer.Option(min=1, max=1024, help="Processes for finite elements; 1 is this one.")] = 1,
    json: Json = False,
) -> None:
    """Find the best stage that meets requirements, and check it by finite elements; exit code 1 where none does."""
    os.environ.update(ONE_THREAD)  # before numpy is loaded: threads change last bits
    from flexfem.design.run import run_design

    began = time.monotonic()
    with _progress() as say:
        found = run_design(requirements, output, workers, say)
    if output is not None:
        from flexfem.plot.write import write_design_figures

        written = write_design_figures(found, output / f"{requirements.stem}-design.json")
        print(*map(str, written), sep="\n", file=sys.stderr)
    console.show(found, json, print_result)
    print(f"{time.monotonic() - began:.1f} s", file=sys.stderr)
    raise typer.Exit(0 if found.feasible and found.agreed else 1)


@contextmanager
def _progress() -> Iterator[Callable[[str], object]]:
    """What shows on standard error how far a search is: a line that changes on a terminal, else one now and then."""
    from rich.console import Console

    shown = Console(file=raw(sys.stderr))
    if shown.is_terminal:
        with shown.status("reading") as status:
            yield lambda text: status.update(text)
        return
    latest = time.monotonic()

    def line(text: str) -> None:
        nonlocal latest
        if time.monotonic() - latest > EVERY:
            latest = time.monotonic()
            print(text, file=sys.stderr, flush=True)

    yield line
