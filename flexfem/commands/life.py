"""The command on fatigue, and how it is printed: life of a stage, and the fit of S-N points."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Analytic, Json, Resolution, Wanted, check_finite, check_within
from flexfem.commands.tables import numbers, people, print_ending, table
from flexfem.refused import BadInput
from flexfem.units import COMMANDS, STRESS

if TYPE_CHECKING:
    from flexfem.hinges.strength import BasquinFit
    from flexfem.verify.life import Law, Life, Witness

app = typer.Typer()
Pose = tuple[float, float, float]


@app.command()
def life(
    stage: Annotated[
        Path | None, typer.Argument(help="Stage file, see flexfem schema stage.", metavar="[STAGE]", show_default=False)
    ] = None,
    amplitude: Annotated[
        Pose | None, typer.Option(metavar="X Y THETA", help="Amplitude of the platform's pose: mm, mm, rad.")
    ] = None,
    mean: Annotated[Pose | None, typer.Option(metavar="X Y THETA", help="Its mean: mm, mm, rad.")] = None,
    ratio: Annotated[
        float | None, typer.Option(help="Instead: least over greatest displacement, from -1 to 0.99; default -1.")
    ] = None,
    cycles: Annotated[float, typer.Option(help="The wanted life.")] = 1e6,
    fit: Annotated[
        Path | None, typer.Option(help="S-N points, CSV with stress_mpa, cycles: take the law fitted to them.")
    ] = None,
    notch_sensitivity: Annotated[
        float, typer.Option(help="From 0 to 1: how much of the notch's stress concentration counts for fatigue.")
    ] = 1.0,
    analytic: Analytic = False,
    resolution: Resolution = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Cycles that the necks bear at an amplitude, and the amplitude for a wanted life; or the fit of S-N points."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import life as reports

    fitted = None if fit is None else _fitted(fit)
    if stage is None:
        if fitted is None or amplitude is not None or output is not None:
            raise BadInput("life: expected a stage file and --amplitude, or --fit alone")
        console.show(fitted, json, print_fit)
        return
    if amplitude is None:
        raise BadInput("--amplitude is missing, expected three numbers: mm, mm, rad")
    check_finite(ratio=-1.0 if ratio is None else ratio, cycles=cycles, notch_sensitivity=notch_sensitivity)
    _check_poses(amplitude, mean, ratio)
    finest = console.finest(analytic, resolution)
    repeated = (-1.0 if ratio is None else ratio, cycles)
    asked = (amplitude, mean, *repeated, fitted, finest)
    loaded, path = load_feasible(stage), console.target(output, f"{stage.stem}-life")
    found = reports.life(loaded, *asked, notch_sensitivity=notch_sensitivity)
    if path is not None:
        from flexfem.plot.life import life_figure

        console.keep(found, path, life_figure)
    console.show(found, json, print_life)


def _check_poses(amplitude: Pose, mean: Pose | None, ratio: float | None) -> None:
    from flexfem.reports.given import LARGEST_POSE

    for option, pose in (("--amplitude", amplitude), ("--mean", mean)):
        check_within(option, pose, LARGEST_POSE)
    if mean is not None and ratio is not None:
        raise BadInput("--mean and --ratio, expected one of the two")


def _fitted(path: Path) -> BasquinFit:
    from flexfem.hinges.strength import fit_basquin
    from flexfem.verify.sn_points import read_points

    stress, cycles = read_points(path)
    try:
        return fit_basquin(stress, cycles)
    except BadInput as refusal:
        raise BadInput(f"{path}: {refusal}") from None


def print_fit(of: BasquinFit) -> None:
    """Print a law and its intervals."""
    out = people()
    out.print(f"Basquin's law through {of.points} points, sigma_a = sigma'_f (2 N)^b = A N^b:")
    unit = STRESS.plain
    out.print(f"  sigma'_f = {of.coefficient:.5g} {unit}{_interval(of.coefficient_interval, of.confidence)}")
    out.print(f"  b        = {of.exponent:.4g}{_interval(of.exponent_interval, of.confidence)}")
    out.print(f"  A        = {of.A:.5g} {unit}")
    out.print(
        f"standard deviation of log10 N {of.scatter:.3g}; points from {of.range[0]:.4g} to {of.range[1]:.4g} cycles"
    )


def _interval(ends: tuple[float, float] | None, confidence: float) -> str:
    if ends is None:
        return f", no interval: at {confidence:g} % life may not fall with stress"
    return f", {confidence:g} % interval {ends[0]:.4g} to {ends[1]:.4g}"


def print_life(of: Life) -> None:
    """Print lives, amplitudes and safety factors, a line for every model."""
    out = people()
    about = [of.amplitude.x, of.amplitude.y, of.amplitude.theta]
    mean = [of.mean.x, of.mean.y, of.mean.theta]
    out.print(f"{of.name}: {of.material}, amplitude {numbers(about, COMMANDS)} about {numbers(mean, COMMANDS)}")
    out.print(_law(of.law))
    stress = STRESS.plain
    head = ("", "first neck", f"amplitude, mean, equivalent ({stress})", "cycles", "by the error of the stress")
    more = (f"amplitude for {of.wanted:g} cycles", "times this one", "yield over largest stress")
    out.print(table((*head, *more), (_row(each) for each in (of.analytic, of.elements) if each is not None)))
    out.print(f"life: {of.left_out}; notch sensitivity {of.notch_sensitivity:g} on the stress at the notch")
    print_ending(out, of)


def _law(of: Law) -> str:
    low, high = of.range
    stated = "" if of.range_stated else ", assumed"
    rule = "Smith, Watson and Topper" if of.walker == 0.5 else f"Walker, {of.walker:g}"
    return (
        f"Basquin's law with {of.coefficient:g} {STRESS.plain} and {of.exponent:g}, for {low:.4g} to {high:.4g} cycles"
        f"{stated}; mean stress by {rule}. {of.source}"
    )


def _row(of: Witness) -> Iterator[str]:
    neck = of.necks[of.first]
    yield of.model
    yield f"{neck.hinge} hinge, chain {neck.chain}"
    yield f"{neck.amplitude:.4g}, {neck.mean:z.4g}, {neck.equivalent:.4g}"
    yield _cycles(of.cycles)
    yield "not known" if of.fewest is None or of.most is None else f"{of.fewest:.3g} to {of.most:.3g}"
    largest = of.largest
    yield "any" if largest is None else numbers([largest.x, largest.y, largest.theta], COMMANDS)
    yield "" if of.factor is None else f"{of.factor:.4g}"
    yield f"{of.safety:.4g}"


def _cycles(cycles: float | None) -> str:
    return "endless" if cycles is None else f"{cycles:.3g}"
