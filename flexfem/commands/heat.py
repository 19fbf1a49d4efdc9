"""The command on temperature: drift of the platform, and how it is printed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, Resolution, StageFile, Wanted
from flexfem.commands.tables import DIRECTIONS, people, print_ending, table
from flexfem.refused import BadInput
from flexfem.units import EXPANSION, STRESS, unit_for

if TYPE_CHECKING:
    from flexfem.verify.drift import Drift, DriftCase

app = typer.Typer()
ROUND_OFF = 1e-9  # of the largest component of a pose: zero by symmetry


@app.command()
def drift(
    stage: StageFile,
    formula: Annotated[str | None, typer.Option(help="Hinge formula of the analytic model.")] = None,
    mobility: Annotated[int | None, typer.Option(help="Its mobility, with rigid links: 3, 6, 12 or 21.")] = None,
    links: Annotated[bool, typer.Option("--links", help="Its links elastic; mobility 21.")] = False,
    analytic: Annotated[bool, typer.Option("--analytic", help="Without finite elements.")] = False,
    resolution: Resolution = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Pose and stresses per kelvin, and per kelvin per mm along X and Y, of a stage on its frame.

    By default the model has calibrated hinges and elastic links.
    """
    from flexfem import reports
    from flexfem.stage.schema import load_feasible

    if analytic and resolution is not None:
        raise BadInput("--analytic and --resolution, expected one of the two")
    finest = None if analytic else resolution or reports.RESOLUTION
    loaded = load_feasible(stage)
    found = reports.drift(loaded, mobility, formula, links, finest)
    if output is not None:
        from flexfem.verify.result import write_record

        write_record(found, output / f"{stage.stem}-drift.json")
    console.show(found, json, print_drift)


def print_drift(of: Drift) -> None:
    """Print pose and highest neck stress by case and model."""
    out = people()
    factor, unit = EXPANSION.factor, EXPANSION.plain
    out.print(f"{of.name}: expansion {factor * of.expansion:g} {unit}, frame {factor * of.frame_expansion:g} {unit}")
    head = ("temperature", f"by {of.model}", *DIRECTIONS, f"highest neck stress ({STRESS})")
    out.print(table(head, (row for name, case in of.cases.items() for row in _rows(of, name, case))))
    out.print("uniform: per K; gradients: per K/mm about the platform's centre, in stage and frame alike")
    out.print("proportional to the difference of both coefficients; through the thickness uniform; in the plane")
    print_ending(out, of)


def _rows(of: Drift, name: str, case: DriftCase) -> Iterator[list[str]]:
    """Both models, their difference and the band of one case."""
    model, metal, lever = case.analytic, case.elements, of.lever
    yield [name, "", *_pose(model.pose, lever), f"{_highest(model.stress):.4g}"]
    if metal is not None:
        yield ["", "finite elements", *_pose(metal.pose, lever), f"{_highest(metal.stress):.4g}"]
        off = [
            100 * (one / other - 1) if text != "0" else None
            for one, other, text in zip(model.pose, metal.pose, _pose(metal.pose, lever), strict=True)
        ]
        stress = 100 * (_highest(model.stress) / _highest(metal.stress) - 1) if _highest(metal.stress) else None
        yield ["", "difference (%)", *("" if each is None else f"{each:+.2f}" for each in (*off, stress))]
    if case.band is not None and metal is not None:
        yield ["", "mesh band (+-)", *_bands(case.band, metal.pose, lever), ""]
    if case.unlike is not None:
        yield ["", "necks of chain 1 unlike by 10 %", *_pose(case.unlike, lever), ""]


def _pose(pose: list[float], lever: float) -> list[str]:
    """A pose, each number with its prefix, round-off as zero; rotations count with the lever."""
    largest = max(abs(pose[0]), abs(pose[1]), abs(pose[2] * lever))
    sizes = (1.0, 1.0, lever)
    kept = [value if abs(value) * size > ROUND_OFF * largest else 0.0 for value, size in zip(pose, sizes, strict=True)]
    units = [unit_for(axis, abs(value)) for axis, value in zip(DIRECTIONS, kept, strict=True)]
    return [f"{v * unit.factor:.4g} {unit.plain}" if v else "0" for v, unit in zip(kept, units, strict=True)]


def _bands(band: list[float], pose: list[float], lever: float) -> list[str]:
    """Half-widths in the units of the pose, none of what is zero by symmetry."""
    zero = [text == "0" for text in _pose(pose, lever)]
    units = [unit_for(axis, abs(value)) for axis, value in zip(DIRECTIONS, pose, strict=True)]
    return [
        "" if none else f"{each * unit.factor:.2g} {unit.plain}"
        for none, each, unit in zip(zero, band, units, strict=True)
    ]


def _highest(stress: list[list[float]]) -> float:
    return max(max(row) for row in stress)
