"""The command on temperature: drift of the platform, and how it is printed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.at_work import working
from flexfem.commands.console import Analytic, Json, Links, Resolution, StageFile, Wanted
from flexfem.commands.solid_drift import (
    AT_EDGES,
    band_texts,
    edge_text,
    highest,
    pose_texts,
    print_solid_drift,
    write_solid,
)
from flexfem.commands.tables import DIRECTIONS, people, print_ending, table
from flexfem.units import EXPANSION, STRESS

if TYPE_CHECKING:
    from flexfem.verify.drift import Drift, DriftCase, DriftFields

app = typer.Typer()


@app.command()
def drift(
    stage: StageFile,
    formula: Annotated[str | None, typer.Option(help="Hinge formula of the analytic model.")] = None,
    mobility: Annotated[int | None, typer.Option(help="Its mobility, with rigid links: 3, 6, 12 or 21.")] = None,
    links: Links = False,
    analytic: Analytic = False,
    resolution: Resolution = None,
    three_dimensional: Annotated[
        bool, typer.Option("--three-dimensional", help="Wedges through the thickness: also a gradient along it.")
    ] = False,
    layers: Annotated[int | None, typer.Option(min=3, max=16, help="In half the thickness; default 3.")] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Pose and stresses per kelvin, and per kelvin per mm along X and Y, of a stage on its frame.

    By default the model has calibrated hinges and elastic links. With an output folder also the figure of the warm
    stage, but with --analytic; in three dimensions displacements and stresses as VTU instead.
    """
    from flexfem.mechanism.stage import load_feasible
    from flexfem.refused import BadInput
    from flexfem.reports import heat as reports

    if layers is not None and not three_dimensional:
        raise BadInput("--layers without --three-dimensional, expected both: layers are through the thickness")
    if three_dimensional:
        given = {"--formula": formula, "--mobility": mobility, "--links": links, "--analytic": analytic}
        for option, value in given.items():
            if value not in (None, False):
                raise BadInput(f"{option} with --three-dimensional, expected one of the two: it has no analytic model")
        loaded, path = load_feasible(stage), console.target(output, f"{stage.stem}-drift-solid", [".vtu"])
        with working("warm", 2) as say:
            solid = reports.drift_fields_solid(loaded, resolution, layers, say)
        if path is not None:
            write_solid(solid, path)
        console.show(solid.record, json, print_solid_drift)
        return
    finest = console.finest(analytic, resolution)
    loaded, path = load_feasible(stage), console.target(output, f"{stage.stem}-drift")
    found = reports.drift_fields(loaded, mobility, formula, links, finest)
    if path is not None:
        _write(found, path)
    console.show(found.record, json, print_drift)


def _write(found: DriftFields, path: Path) -> None:
    """The record, and its figure where there are fields to draw."""
    from flexfem.verify.result import write_record

    if not found.fields:
        write_record(found.record, path)
        return
    from flexfem.plot.drift import drift_figure

    console.keep(found.record, path, lambda _: drift_figure(found))


def print_drift(of: Drift) -> None:
    """Print pose and highest neck stress by case and model."""
    out = people()
    factor, unit = EXPANSION.factor, EXPANSION.plain
    out.print(f"{of.name}: expansion {factor * of.expansion:g} {unit}, frame {factor * of.frame_expansion:g} {unit}")
    head = ("temperature", f"by {of.model}", *DIRECTIONS, f"highest neck stress ({STRESS})", "at clamped edges")
    out.print(table(head, (row for name, case in of.cases.items() for row in _rows(of, name, case))))
    out.print("uniform: per K; gradients: per K/mm about the platform's centre, in stage and frame alike")
    out.print("proportional to the difference of both coefficients; through the thickness uniform; in the plane")
    without = "the clamped edges of pads may carry more than the necks do: finite elements say how much"
    out.print(AT_EDGES if of.resolution else without)
    print_ending(out, of)


def _rows(of: Drift, name: str, case: DriftCase) -> Iterator[list[str]]:
    """Both models, their difference and the band of one case."""
    from flexfem.verify.drift import UNLIKE

    model, metal, lever = case.analytic, case.elements, of.lever
    yield [name, "", *pose_texts(model.pose, lever), f"{highest(model.stress):.4g}", ""]
    if metal is not None:
        yield [
            "",
            "finite elements",
            *pose_texts(metal.pose, lever),
            f"{highest(metal.stress):.4g}",
            edge_text(metal.edges),
        ]
        off = [
            100 * (one / other - 1) if text != "0" else None
            for one, other, text in zip(model.pose, metal.pose, pose_texts(metal.pose, lever), strict=True)
        ]
        stress = 100 * (highest(model.stress) / highest(metal.stress) - 1) if highest(metal.stress) else None
        yield ["", "difference (%)", *("" if each is None else f"{each:+.2f}" for each in (*off, stress)), ""]
    if case.band is not None and metal is not None:
        yield [
            "",
            "mesh band (+-)",
            *band_texts(case.band, metal.pose, lever),
            "",
            f"{case.edge_band:.2g}" if case.edge_band else "",
        ]
    if case.unlike is not None:
        yield ["", f"necks of chains {UNLIKE:g} % unlike", *pose_texts(case.unlike, lever), "", ""]
