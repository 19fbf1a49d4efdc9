"""`flexfem design`: from requirements to a stage, and how it is printed."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, Wanted
from flexfem.commands.tables import print_ending, table
from flexfem.designs import MOST_WORKERS
from flexfem.sources import ONE_THREAD
from flexfem.terminal import people, raw

if TYPE_CHECKING:
    from flexfem.synthesis.result import Designed, Requirement, Stated

app = typer.Typer()
EVERY = 10.0  # s between two lines where no terminal shows how far it is


@app.command()
def design(
    requirements: Annotated[Path, typer.Argument(help="See flexfem schema requirements.", metavar="FILE")],
    output: Wanted = None,
    workers: Annotated[
        int, typer.Option(min=1, max=MOST_WORKERS, help="Processes for finite elements; 1 is this one.")
    ] = 1,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Solve on a Dask cluster.")] = None,
    json: Json = False,
) -> None:
    """Find the best stage that meets requirements, and check it by finite elements; exit code 1 where none does."""
    os.environ.update(ONE_THREAD)  # before numpy is loaded: threads change last bits
    from flexfem import designs

    began = time.monotonic()
    with _told() as say:
        found = designs.design(requirements, output, workers, scheduler, say)
    if output is not None:
        from flexfem.plot.write import write_design_figures

        written = write_design_figures(found, output / f"{requirements.stem}-design.json")
        print(*map(str, written), sep="\n", file=sys.stderr)
    console.show(found, json, print_design)
    print(f"{time.monotonic() - began:.1f} s", file=sys.stderr)
    raise typer.Exit(0 if found.feasible and found.agreed else 1)


@contextmanager
def _told() -> Iterator[Callable[[str], object]]:
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


def print_design(of: Designed) -> None:
    """Print a design: dimensions, objectives, requirements with margins, prices, evaluations."""
    out = people()
    state = "meets all requirements" if of.feasible else "meets not all requirements: the nearest that was found"
    out.print(f"{of.name}: {state}; seed {of.seed}")
    rows = [(name, f"{value:.6g}", f"{of.relaxed[name]:.6g}", _end(of, name)) for name, value in of.design.items()]
    out.print(table(("dimension", "designed", "without steps, model", ""), rows))
    for goal in of.objectives:
        out.print(f"{goal.label}: {_value(goal)}, the {goal.better} the better ({_rests(goal)})")
    if of.requirements:
        head = ("requirement", "wanted", "value", "margin (%)", "", "1 % more costs the objective", "checked by")
        out.print(table(head, (_row(each) for each in of.requirements)))
    for text in of.tightening:
        out.print(text)
    asked = of.decisive
    followed = [(name, *(_followed(row[each.name]) for each in asked)) for name, row in of.sensitivities.items()]
    out.print(table(("change (%) for 1 % more of", *(each.label for each in asked)), followed))
    for each in of.requirements:
        if each.relax_to is not None:
            out.print(f"relaxed least in all, {each.label} would be {each.relax_to:.6g}: {-each.margin_percent:.3g} %")
    for one in of.alternatives:
        alone = "no relaxation of it alone is enough" if one.relax_to is None else (
            f"alone, to {one.relax_to:.6g}, {one.percent:.3g} % (by the model)"
        )  # fmt: skip
        out.print(f"relaxing {one.requirement}: {alone}")
    for coupling in of.scattered:
        out.print(coupling.said)
    if of.front:
        out.print(f"front: {len(of.front)} designs that no other beats in all objectives, by finite elements")
        goals = (goal.headed(plain=True) for goal in of.objectives)
        margins = (f"margin of {each.label} (%)" for each in of.requirements)
        out.print(table(("", *of.front[0].design, *goals, *margins), _of_front(of)))
    counted = ", ".join(f"{count:,} by {name}" for name, count in of.evaluations.items() if name != "drawn")
    out.print(f"evaluations: {counted}; {of.evaluations.get('drawn', 0)} designs drawn")
    gaps = ", ".join(f"{turn.gap_percent:.3g}" for turn in of.rounds)
    out.print(f"largest difference of corrected model and finite elements, by round: {gaps} %")
    print_ending(out, of)


def _of_front(of: Designed) -> Iterator[tuple[str, ...]]:
    for number, one in enumerate(of.front, 1):
        made = (f"{value:.6g}" for value in one.design.values())
        values = (f"{goal.shown(x):.6g}" for goal, x in zip(of.objectives, one.values, strict=True))
        yield (str(number), *made, *values, *(f"{x:.3g}" for x in one.margins_percent))


def _end(of: Designed, name: str) -> str:
    return "at an end of its range" if name in of.at_ends else ""


def _followed(value: float | None) -> str:
    return "not known" if value is None else f"{value:+.3f}" if abs(value) < 1e3 else f"{value:+.2e}"


def _value(of: Stated) -> str:
    band = "" if of.band is None else f" ± {of.band:.2g}"
    sampling = "" if of.sampling is None else f", of that {of.sampling:.2g} by sampling"
    spread = "" if of.push_spread is None else f", ± {of.push_spread:.2g} by the spread of the pushes"
    return f"{of.shown(of.value):.6g}{band} {of.unit.plain}".rstrip() + sampling + spread


def _rests(of: Stated) -> str:
    return f"{of.checked_by}; the model by itself {of.shown(of.uncorrected):.6g}"


def _row(of: Requirement) -> tuple[str, ...]:
    band = "" if of.band_percent is None else f" ± {of.band_percent:.2g}"
    price = "" if not of.active else "not known" if of.price_percent is None else f"{of.price_percent:.3g} %"
    wanted = ", ".join(of.wanted)
    return of.label, wanted, _value(of), f"{of.margin_percent:.3g}{band}", of.verdict, price, of.checked_by
