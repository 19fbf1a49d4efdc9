"""Natural frequencies: the command, its table and what it writes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, StageFile, Wanted
from flexfem.commands.solid_modes import show_solid_modes
from flexfem.commands.tables import DIRECTIONS, print_ending, table
from flexfem.refused import BadInput
from flexfem.terminal import people, working
from flexfem.units import UNITS

if TYPE_CHECKING:
    from flexfem.verify.dynamic_model import DynamicModel
    from flexfem.verify.modes import Mode, NaturalModes, Vibration

app = typer.Typer()
HERTZ, KILOGRAM, INERTIA = UNITS["hz"].plain, UNITS["kg"].plain, UNITS["kg_mm2"].plain


@app.command()
def modes(
    stage: StageFile,
    count: Annotated[int, typer.Option(min=1, max=100, help="How many, from the lowest.")] = 6,
    payload: Annotated[
        tuple[float, float],
        typer.Option(metavar="MASS INERTIA", help="On the platform: kg, and kg mm^2 about the platform centre."),
    ] = (0.0, 0.0),
    drives: Annotated[str, typer.Option(help="disengaged, or engaged: stacks as springs.")] = "disengaged",
    damping: Annotated[float, typer.Option(help="Of every mode, % of critical; assumed.")] = 1.0,
    resolution: Annotated[
        int | None, typer.Option(min=4, max=64, help="Triangles across every neck, finest mesh; default 8, in 3-D 4.")
    ] = None,
    three_dimensional: Annotated[
        bool, typer.Option("--three-dimensional", help="Wedges through the thickness: also modes out of the plane.")
    ] = False,
    layers: Annotated[int | None, typer.Option(min=3, max=16, help="In half the thickness; default 3.")] = None,
    tilting: Annotated[
        float | None, typer.Option(help="Of the payload about x and y, kg mm^2; default that of a flat one, half.")
    ] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Natural frequencies and mode shapes: in the plane, also by the analytic models; or in three dimensions.

    With an output folder also the figure of the modes and their shapes as VTU; of modes in the plane an animation (GIF)
    of each, the frequency response drawn, and state space and Craig-Bampton matrices as .npz and .mat.
    """
    from flexfem import arguments
    from flexfem.mechanism.stage import load_feasible
    from flexfem.reports import modes as reports
    from flexfem.reports.given import RESOLUTION

    arguments.positive("damping", damping, reports.MOST_DAMPING)
    loaded = load_feasible(stage)
    if three_dimensional:
        if drives != "disengaged":
            raise BadInput(f"--drives {drives} --three-dimensional, expected disengaged: stacks are of the plane")
        path = console.target(output, f"{stage.stem}-modes-solid", [*console.FIGURES, ".vtu"])
        asked = (count, payload, tilting, resolution, layers)
        show_solid_modes(partial(reports.vibration_solid, loaded, *asked), path, json)
        return
    for option, value in (("--layers", layers), ("--tilting", tilting)):
        if value is not None:
            raise BadInput(f"{option} without --three-dimensional, expected both: modes are in the plane")
    animated = (f"-{number}.gif" for number in range(1, count + 1))
    response = (f"-response{ending}" for ending in console.FIGURES)
    path = console.target(
        output, f"{stage.stem}-modes", [*console.FIGURES, *response, *animated, ".vtu", ".npz", ".mat"]
    )
    with working("meshing and solving", 3) as say:
        found = reports.vibration(loaded, count, payload, drives, resolution or RESOLUTION, say)  # type: ignore[arg-type]
    if path is not None:
        _write(found, reports.reduced(loaded, found, damping), path)
    console.show(found.record, json, print_modes)


def _write(found: Vibration, model: DynamicModel, path: Path) -> None:
    """The record and its figure, all shapes as fields of one VTU file, an animation of each; the reduced model."""
    from flexfem.fem.export import write_vtu
    from flexfem.plot.modes import modes_figure, response_figure, write_animation
    from flexfem.plot.write import write_beside

    console.keep(found.record, path, lambda _: modes_figure(found))
    shapes = {f"mode {number}": field for number, field in enumerate(found.fields, start=1)}
    write_vtu(found.structure.mesh, path.with_suffix(".vtu"), shapes)
    for number in range(1, len(shapes) + 1):
        write_animation(found, number, path.with_name(f"{path.stem}-{number}.gif"))
    for ending in (".npz", ".mat"):
        model.write(path.with_suffix(ending))
    print(model.truncation_note, file=sys.stderr)
    write_beside(path.with_name(f"{path.stem}-response.npz"), response_figure(model, found.record))


def print_modes(of: NaturalModes) -> None:
    """Print frequencies with bands, shares of the mass that moves, and what the analytic models say."""
    out = people()
    carried = f", payload {of.payload_mass:g} {KILOGRAM}, {of.payload_inertia:g} {INERTIA}"
    loaded = carried if of.payload_mass or of.payload_inertia else ""
    out.print(
        f"{of.name}: drives {of.drives}{loaded}; mass {of.mass:.4g} {KILOGRAM}, of it the hub {of.hub_mass:.3g}, "
        f"moment of inertia {of.inertia:.4g} {INERTIA}"
    )
    models = list(of.modes[0].analytic)
    shares = (f"{name} mass (%)" for name in DIRECTIONS)
    head = ("mode", f"frequency ({HERTZ})", "band", *shares, *(f"{model} ({HERTZ})" for model in models))
    out.print(table(head, _rows(of.modes)))
    out.print("mass: effective modal mass for a base that moves in x, y, theta, of the whole mass or moment of inertia")
    print_ending(out, of)


def _rows(modes: list[Mode]) -> Iterator[list[str]]:
    for number, one in enumerate(modes, start=1):
        shares = (f"{getattr(one.share, name):.2f}" for name in DIRECTIONS)
        models = ("-" if value is None else f"{value:.6g}" for value in one.analytic.values())
        yield [str(number), f"{one.frequency:.6g}", f"{one.band:.2g}", *shares, *models]
