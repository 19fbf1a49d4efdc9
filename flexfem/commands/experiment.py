"""Commands on the experiment of Section VI: how it would go on a stage, and what its slopes say of a made one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, Links, Resolution, StageFile, Wanted
from flexfem.commands.tables import DIRECTIONS, people, print_ending, table
from flexfem.refused import BadInput
from flexfem.units import COMPLIANCES, LENGTH, MICROMETRE, STIFFNESSES, Unit

if TYPE_CHECKING:
    from flexfem.verify.as_built import AsBuilt
    from flexfem.verify.experiment import Experiment
    from flexfem.verify.identified import Identification
    from flexfem.verify.series import SpringAlone
    from flexfem.verify.slope_fit import Estimate

app = typer.Typer()
UNITS = dict(zip(DIRECTIONS, STIFFNESSES, strict=True))
ADDED = {"translation": COMPLIANCES[0], "rotation": COMPLIANCES[2]}


@app.command()
def experiment(
    stage: StageFile,
    fixture: Annotated[Path, typer.Argument(help="File of the set-up, see flexfem schema fixture.", metavar="FIXTURE")],
    measured: Annotated[
        Path | None, typer.Option(help="File of measured slopes; default those of the fixture, if any.")
    ] = None,
    formula: Annotated[str, typer.Option(help="Hinge formula of the model in the table.")] = "paros-weisbord",
    mobility: Annotated[int | None, typer.Option(help="Its mobility; default: the file's prismatic hinges.")] = None,
    links: Links = False,
    analytic: Annotated[
        bool, typer.Option("--analytic", help="Calibrated hinges and elastic links instead of finite elements.")
    ] = False,
    resolution: Resolution = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Simulate the stiffness experiment of Section VI: readings, slopes with intervals (Figure 11), and Table II."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import experiment as reports

    loaded = load_feasible(stage)
    console.check_links(links, mobility)
    finest = console.finest(analytic, resolution)
    path = console.target(output, f"{stage.stem}-experiment")
    found = reports.experiment(loaded, fixture, measured, mobility, formula, links, finest)
    if path is not None:
        from flexfem.plot.experiment import experiment_figure

        console.keep(found, path, experiment_figure)
    console.show(found, json, print_experiment)


@app.command()
def identify(
    stage: StageFile,
    measured: Annotated[
        Path,
        typer.Argument(help="Measured slopes, with the set-up or alone.", metavar="MEASURED"),
    ],
    unknown: Annotated[
        str | None, typer.Option(help="Of the fixture: pole or springs; default the pole where one is described.")
    ] = None,
    confidence: Annotated[float, typer.Option(min=50, max=99.9, help="Of the intervals, per cent.")] = 95.0,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Which offset of all necks and which soft fixture fit measured slopes, and whether these can tell them apart."""
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import experiment as reports

    console.check_finite(confidence=confidence)
    if unknown not in (None, "pole", "springs"):
        raise BadInput(f"--unknown {unknown}, expected pole or springs")
    loaded, path = load_feasible(stage), console.target(output, f"{stage.stem}-identify")
    found = reports.identify(loaded, measured, unknown, confidence)  # type: ignore[arg-type]
    if path is not None:
        from flexfem.plot.experiment import identification_figure

        console.keep(found, path, identification_figure)
    console.show(found, json, print_identification)


def print_experiment(of: Experiment) -> None:
    """Print Table II and which spring alone would explain what."""
    from flexfem.verify.experiment import NOT_THE_PAPERS

    out = people()
    out.print(f"{of.name}: pushed as in {of.fixture}; the metal is by {of.metal}")
    with_measured = any(row.measured is not None for row in of.table.values())
    head = ["stiffness as pushed", of.model, of.metal, f"simulated, {of.confidence:g} %"]
    out.print(table((*head, *(["measured"] if with_measured else [])), _slopes(of, with_measured)))
    kinds = [name for name in ("metal", "simulated", "measured", "measured from metal") if _has(of, name)]
    rows = ((axis, *(_percent(row.deviation.get(name)) for name in kinds)) for axis, row in of.table.items())
    named = [name.replace("metal", of.metal) for name in kinds]
    out.print(table(("deviation from the model", *named), rows))
    rows = ((axis, *(f"{push.share[part]:.3g} %" for part in push.share)) for axis, push in of.pushed.items())
    out.print(table(("displacement read, share of", "stage", "pole", "bar"), rows))
    out.print(f"what a spring in series alone would make of it, after {of.explained}:")
    for axis, spring in of.alone.items():
        out.print(f"  {axis}: {_spring(spring, UNITS[axis])}")
    out.print(NOT_THE_PAPERS)
    print_ending(out, of)


def _slopes(of: Experiment, with_measured: bool) -> Iterator[list[str]]:
    for axis, row in of.table.items():
        push, unit = of.pushed[axis], UNITS[axis]
        ends = "no interval" if push.low is None else f"{push.low:.5g} to {push.high:.5g}"
        cells = [f"{axis} ({unit.plain})", f"{row.model:.5g}", f"{row.metal:.5g}", f"{row.simulated:.5g} ({ends})"]
        sd = "" if row.measured_sd is None else f" ± {row.measured_sd:.2g}"
        measured = "" if row.measured is None else f"{row.measured:.5g}{sd}"
        yield [*cells, *([measured] if with_measured else [])]


def _has(of: Experiment, name: str) -> bool:
    return any(name in row.deviation for row in of.table.values())


def _percent(value: float | None) -> str:
    return "" if value is None else f"{value:+.2f} %"


def _spring(of: SpringAlone, unit: Unit) -> str:
    pole = "" if of.pole is None else f"; the pole here: {of.pole:.4g} {unit.plain}"
    if of.stiffness is None or of.ratio is None:
        than = f"{of.stage:.5g} {unit.plain}"
        return f"{-of.softer_percent:.3g} % stiffer than {than}, which no spring in series makes{pole}"
    return (
        f"{of.softer_percent:.3g} % softer than {of.stage:.5g} {unit.plain} takes {of.stiffness:.4g} {unit.plain}, "
        f"{of.ratio:.3g} times as stiff as the stage{pole}"
    )


def print_identification(of: Identification) -> None:
    """Print slopes, what fits them, and what they cannot tell."""
    out = people()
    out.print(f"{of.name}: {of.source}; {of.model}")
    rows = (
        (f"{axis} ({UNITS[axis].plain})", f"{of.measured[axis]:.5g} ± {of.sd[axis]:.2g}", *_fitted(of, axis))
        for axis in of.measured
    )
    stiff = "rigid pole" if of.unknown == "pole" else "rigid fixture"
    out.print(table(("slope", "measured", f"as drawn, {stiff}", "fitted"), rows))
    um = MICROMETRE
    out.print(f"offset of all nine necks: {_estimate(of.offset, um.factor, um.plain)} (positive: wider)")
    for name, found in of.fixture.items():
        if name == "pole":
            out.print(f"the pole, times as soft as described: {_estimate(found, 1.0, '')}")
        else:
            out.print(f"compliance of the fixture in {name}: {_estimate(found, 1.0, ADDED[name].plain)}")
    springs = [f"{axis} {k:.4g} {UNITS[axis].plain}" for axis, k in of.stiffness.items() if k is not None]
    out.print(f"the fixture at the fit: {', '.join(springs) or 'rigid'}")
    numbers = f"chi square {of.chi_square:.3g}, degrees of freedom {of.dof}"
    out.print(f"{numbers}; intervals {of.confidence:g} %, profile likelihood" + _dependence(of))
    out.print(of.finding)
    print_ending(out, of)


def _fitted(of: Identification, axis: str) -> tuple[str, str]:
    return f"{of.nominal[axis]:.5g}", f"{of.fitted[axis]:.5g}"  # type: ignore[index]


def _dependence(of: Identification) -> str:
    if of.correlation is None:
        return "; the data depend on fewer combinations of these numbers than there are numbers"
    return f"; correlation of offset and fixture {of.correlation:+.3f}"


def _estimate(of: Estimate, factor: float, unit: str) -> str:
    low, high = (None if end is None else f"{end * factor:.4g}" for end in (of.low, of.high))
    between = {
        (False, False): f"{low} to {high}",
        (False, True): f"from {low} on, no upper end",
        (True, False): f"up to {high}, no lower end",
        (True, True): "no end on either side",
    }[low is None, high is None]
    return f"{of.value * factor:.4g} {unit}".rstrip() + f" ({between})"


def print_as_built(of: AsBuilt) -> None:
    """Print the stiffness of a stage as drawn and as it was made."""
    out = people()
    out.print(f"{of.name} with its measured necks: {of.model}")
    rows = (
        (
            f"{axis} ({UNITS[axis].plain})",
            f"{of.drawn[k][k]:.5g}",
            f"{of.stiffness[k][k]:.5g}",
            f"{of.deviation[k]:+.2f} %",
            f"{of.spread[k]:.2g}",
            f"{of.low[k]:.5g} to {of.high[k]:.5g}",
        )
        for k, axis in enumerate(DIRECTIONS)
    )
    head = ("stiffness", "as drawn", "as made", "deviation", "standard deviation", "95 % of stages")
    out.print(table(head, rows))
    um, thinnest, widest = MICROMETRE, min(map(min, of.necks)), max(map(max, of.necks))
    largest = max(map(max, of.sd))
    out.print(
        f"necks {um.factor * thinnest:.4g} to {um.factor * widest:.4g} {um.plain}, each known to "
        f"{um.factor * largest:.3g} {um.plain} (standard deviation) or better; {of.draws} draws"
        if largest > 0
        else f"necks {thinnest:.5g} to {widest:.5g} {LENGTH}; no standard deviation is given: no scatter is known"
    )
    if of.unanswered:
        out.print(f"{of.unanswered} draws have no answer and are left out")
    print_ending(out, of)
