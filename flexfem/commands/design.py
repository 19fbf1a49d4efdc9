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
from flexfem.sources import ONE_THREAD
from flexfem.terminal import people, print_ending, raw, table

if TYPE_CHECKING:
    from flexfem.design.result import Designed, Requirement, Stated

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
    console.show(found, json, print_design)
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


def print_design(of: Designed) -> None:
    """Print a design: dimensions, objectives, requirements with margins, sensitivities, front, evaluations."""
    out = people()
    state = "meets all requirements" if of.feasible else "meets not all requirements: the nearest that was found"
    out.print(f"{of.name}: {state}; seed {of.seed}")
    rows = [
        (name, f"{x:.6g}", f"{of.relaxed[name]:.6g}", "at an end of its range" if name in of.at_ends else "")
        for name, x in of.design.items()
    ]
    out.print(table(("dimension", "designed", "without steps, model", ""), rows))
    for goal in of.objectives:
        by = f"{goal.checked_by}; the model by itself {goal.uncorrected:.6g}"
        out.print(f"{goal.label}: {_value(goal)}, the {goal.better} the better ({by})")
    if of.requirements:
        head = ("requirement", "wanted", "value", "margin (%)", "", "", "checked by")
        out.print(table(head, map(_row, of.requirements)))
    for text in of.notes:
        out.print(text)
    changes = [(name, *(_change(row[each.name]) for each in of.decisive)) for name, row in of.sensitivities.items()]
    out.print(table(("change (%) for 1 % more of", *(each.label for each in of.decisive)), changes))
    for each in of.requirements:
        if each.relax_to is not None:
            out.print(f"relaxed least in all, {each.label} would be {each.relax_to:.6g}: {-each.margin_percent:.3g} %")
    for one in of.alternatives:
        alone = "no relaxation of it alone is enough"
        if one.relax_to is not None:
            alone = f"alone, to {one.relax_to:.6g}, {one.percent:.3g} % (by the model)"
        out.print(f"relaxing {one.requirement}: {alone}")
    if of.front:
        out.print(f"front: {len(of.front)} designs that no other beats in both objectives, by finite elements")
        margins = (f"margin of {each.label} (%)" for each in of.requirements)
        columns = ("", *of.front[0].design, *(goal.headed(plain=True) for goal in of.objectives), *margins)
        numbered = enumerate(of.front, 1)
        out.print(table(columns, ((str(k), *(f"{x:.6g}" for x in (*one.design.values(), *one.values)),
                                *(f"{x:.3g}" for x in one.margins_percent)) for k, one in numbered)))  # fmt: skip
    counted = ", ".join(f"{count:,} by {name}" for name, count in of.evaluations.items() if name != "drawn")
    out.print(f"evaluations: {counted}; {of.evaluations.get('drawn', 0)} designs drawn")
    gaps = ", ".join(f"{each.gap_percent:.3g}" for each in of.rounds)
    out.print(f"largest difference of corrected model and finite elements, by round: {gaps} %")
    print_ending(out, of)


def _change(value: float | None) -> str:
    return "not known" if value is None else f"{value:+.3f}" if abs(value) < 1e3 else f"{value:+.2e}"


def _value(of: Stated) -> str:
    band = "" if of.band is None else f" ± {of.band:.2g}"
    sampling = "" if of.sampling is None else f", of that {of.sampling:.2g} by sampling"
    spread = "" if of.push_spread is None else f", ± {of.push_spread:.2g} by the spread of the pushes"
    return f"{of.value:.6g}{band} {of.unit.plain}".rstrip() + sampling + spread


def _row(of: Requirement) -> tuple[str, ...]:
    band = "" if of.band_percent is None else f" ± {of.band_percent:.2g}"
    active = "limits the objective" if of.active else ""
    margin = f"{of.margin_percent:.3g}{band}"
    return of.label, ", ".join(of.wanted), _value(of), margin, of.verdict, active, of.checked_by
