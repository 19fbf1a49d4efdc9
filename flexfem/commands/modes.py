"""Natural frequencies: the command, its table and what it writes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexfem.commands import console
from flexfem.commands.console import Json, StageFile, Wanted
from flexfem.commands.tables import DIRECTIONS, people, print_ending, table
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
    resolution: Annotated[int, typer.Option(min=4, max=64, help="Triangles across every neck, finest mesh.")] = 8,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Natural frequencies and mode shapes in the plane, by finite elements and by the analytic models.

    With an output folder also the figure of the modes, their shapes as VTU, and an animation (GIF) of each; the
    frequency response drawn; state space and Craig-Bampton matrices as .npz and .mat.
    """
    from flexfem import reports
    from flexfem.stage.schema import load_feasible

    loaded = load_feasible(stage)
    told = console.counted(3, "meshing and solving")
    found = reports.vibration(loaded, count, payload, drives, resolution, told)  # type: ignore[arg-type]
    if output is not None:
        _write(found, reports.reduced(loaded, found, damping), output / f"{stage.stem}-modes.json")
    console.show(found.record, json, print_modes)


def _write(found: Vibration, model: DynamicModel, path: Path) -> None:
    """The record and its figure, all shapes as fields of one VTU file, an animation of each; the reduced model."""
    from flexfem.fem.export import write_vtu
    from flexfem.plot.frequency_response import response_figure
    from flexfem.plot.modes import modes_figure, write_animation
    from flexfem.plot.write import write_beside

    console.keep(found.record, path, lambda _: modes_figure(found))
    shapes = {f"mode {number}": field for number, field in enumerate(found.fields, start=1)}
    write_vtu(found.structure.mesh, path.with_suffix(".vtu"), shapes)
    for number in range(1, len(shapes) + 1):
        write_animation(found, number, path.with_name(f"{path.stem}-{number}.gif"))
    for ending in (".npz", ".mat"):
        model.write(path.with_suffix(ending))
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
