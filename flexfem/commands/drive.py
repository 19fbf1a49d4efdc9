"""Commands on a driven stage: the strokes for a pose, and how they are printed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Analytic, Json, Links, Resolution, StageFile, Wanted, check_within
from flexfem.commands.tables import DIRECTIONS, numbers, print_ending, table
from flexfem.terminal import people
from flexfem.units import COMMANDS, FORCES, MICROMETRE, STIFFNESSES, STRESS, unit_for

if TYPE_CHECKING:
    from flexfem.verify.command import Command
    from flexfem.verify.open_loop import OpenLoop

app = typer.Typer()


@app.command()
def command(
    stage: StageFile,
    pose: Annotated[
        tuple[float, float, float], typer.Option(metavar="X Y THETA", help="Pose of the platform: mm, mm, rad.")
    ],
    load: Annotated[
        tuple[float, float, float], typer.Option(metavar="FX FY M", help="Load on the platform: N, N, N mm.")
    ] = (0.0, 0.0, 0.0),
    formula: Annotated[str | None, typer.Option(help="Hinge formula of the commanding model.")] = None,
    mobility: Annotated[int | None, typer.Option(help="Its mobility, with rigid links: 3, 6, 12 or 21.")] = None,
    links: Links = False,
    analytic: Analytic = False,
    resolution: Resolution = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Strokes and forces of every stack for a pose, and where the metal goes when it is given them.

    By default the model has calibrated hinges and elastic links.
    """
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import drive as reports
    from flexfem.reports.given import LARGEST_LOAD, LARGEST_POSE

    check_within("--pose", pose, LARGEST_POSE)
    check_within("--load", load, LARGEST_LOAD)
    console.check_links(links, mobility)
    finest = console.finest(analytic, resolution)
    loaded, path = load_feasible(stage), console.target(output, f"{stage.stem}-command")
    found = reports.command(loaded, pose, load, mobility, formula, links, finest)
    if path is not None:
        from flexfem.plot.drive import command_figure

        console.keep(found, path, lambda record: command_figure(record, loaded))
    console.show(found, json, print_command)


def print_command(of: Command) -> None:
    """Print strokes and forces by stack, and where the metal goes with them."""
    out = people()
    load = f" under {numbers(of.load, FORCES)}" if any(of.load) else ""
    out.print(f"{of.name}: pose {numbers(of.pose, COMMANDS)}{load}; strokes by {of.model}")
    criteria = of.criteria
    head = ("stack", *(cell for name in criteria for cell in (f"{name}: {MICROMETRE.plain}", FORCES[0].plain)))
    out.print(table(head, _stack_rows(of)))
    out.print(table(("", *criteria), _criterion_rows(of)))
    out.print(table(("stiffness, other directions held", *DIRECTIONS, "against engaged (%)"), _stiffness_rows(of)))
    out.print(f"each stack pushes by {', or by '.join(of.contacts)}")
    if of.push_spread is not None:
        out.print(
            "spread of the pushes: over half and twice the 1.5 link widths that are assumed, as far as links reach"
        )
    if of.open_loop:
        round_off = 1e-12 * max(map(abs, of.pose))
        head = ("error of the metal by model", *DIRECTIONS)
        out.print(table(head, (_miss(each, round_off) for each in of.open_loop)))
    out.print(f"stress: {of.stress_accuracy}")
    print_ending(out, of)


def _stack_rows(of: Command) -> Iterator[list[str]]:
    """Stroke beyond rest and force of every stack, by criterion."""
    for k, name in enumerate(of.stacks):
        cells = [(one.stroke[k] * MICROMETRE.factor, one.force[k]) for one in of.criteria.values()]
        yield [name, *(text for stroke, force in cells for text in (f"{stroke:+.4f}", f"{force:.3f}"))]


def _criterion_rows(of: Command) -> Iterator[list[str]]:
    """What every criterion comes to, a row each."""
    found = of.criteria.values()
    yield ["strain energy of the metal (N mm)", *(f"{one.metal:.4g}" for one in found)]
    yield ["and of stacks and contacts", *(f"{one.stacks:.4g}" for one in found)]
    for limit in ("stroke", "contact", "blocking"):
        yield [f"share of the limit of {limit}", *map(_percent, (one.share[limit] for one in found))]
    yield ["largest hinge rotation (mrad)", *(f"{1e3 * _largest(one.rotation):.4g}" for one in found)]
    yield ["stiffness by these forces (%)", *(_changes(one.preloaded, of.engaged) for one in found)]
    for where, bands in (
        ("left open by friction, at most (+-)", [one.friction for one in found]),
        ("the same by finite elements", [one.element_friction for one in found]),
    ):
        if all(each is not None for each in bands):
            yield [where, *(_prefixed(each or ()) for each in bands)]
    yield [f"highest neck stress ({STRESS})", *(_peak(one.stress) for one in found)]
    metal = [one.element_stress for one in found if one.element_stress is not None]
    if metal:
        from flexfem.questions.warnings import stress_below

        low = "" if of.resolution is None else f", {stress_below(of.resolution)}"
        yield [f"by finite elements{low}", *map(_peak, metal)]


def _stiffness_rows(of: Command) -> Iterator[list[str]]:
    """Stiffness of the platform without stacks, with them, and with their preloads, by what the pushes go with.

    K_ii, and last 1 / C_ii, which is what one measures who pushes in one direction alone.
    """
    named: dict[str, list[float] | None] = {"disengaged": of.disengaged, "engaged": of.engaged}
    ways = {"pushed": "preloaded, pushes normal to the pushed body", "carrier": "preloaded, pushes kept by the carrier"}
    named |= {ways[way]: found for way, found in of.preloaded.items()}
    named |= {
        "other directions free, disengaged": of.disengaged_free,
        "other directions free, engaged": of.engaged_free,
    }
    for name, found in named.items():
        cells = [""] * 3
        if found is not None:
            cells = [f"{value:.5g} {unit.plain}" for value, unit in zip(found, STIFFNESSES, strict=True)]
        yield [name, *cells, _changes(found, of.engaged)]
        if name == "engaged" and of.push_spread is not None:
            moved = [f"± {by:.3g} {unit.plain}" for by, unit in zip(of.push_spread, STIFFNESSES, strict=True)]
            share = (f"{100 * by / K:.2g}" for by, K in zip(of.push_spread, of.engaged, strict=True))
            yield ["±, by the spread of the pushes", *moved, f"± {', '.join(share)}"]


def _prefixed(pose: Sequence[float]) -> str:
    """A pose, each number with its prefix."""
    units = [unit_for(axis, value) for axis, value in zip(DIRECTIONS, pose, strict=True)]
    return ", ".join(f"{value * unit.factor:.3g} {unit.plain}" for value, unit in zip(pose, units, strict=True))


def _changes(found: Sequence[float] | None, of: Sequence[float]) -> str:
    """How many per cent stiffnesses are above others."""
    if found is None:
        return "unstable"
    return ", ".join(f"{100 * (one / other - 1):+.3f}" for one, other in zip(found, of, strict=True))


def _percent(share: float | None) -> str:
    return "none allowed" if share is None else f"{100 * share:.3g} %"


def _peak(of: Sequence[Sequence[float]]) -> str:
    """The highest stress of the necks, and where."""
    import numpy as np

    from flexfem.verify.result import NeckPeak

    peak = NeckPeak.of(np.array(of))
    return f"{peak.stress:.4g} ({peak.hinge}, chain {peak.chain})"


def _largest(of: Sequence[Sequence[float]]) -> float:
    return max(abs(value) for row in of for value in row)


def _miss(of: OpenLoop, least: float) -> list[str]:
    """Error of a pose, each number with its prefix, those below the least one as zero."""
    errors = [error if abs(error) > least else 0.0 for error in of.error]
    units = [unit_for(axis, abs(error)) for axis, error in zip(DIRECTIONS, errors, strict=True)]
    cells = zip(errors, units, strict=True)
    return [of.model, *(f"{e * unit.factor:+.4g} {unit.plain}" if e else "0" for e, unit in cells)]
