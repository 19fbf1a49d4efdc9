"""Mode shapes: the stage displaced in each mode, coloured by how far it moves; a grid of them, and animations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.files.writing import replacing
from flexfem.plot.marks import edges_of, loops_of, polygon, quarters
from flexfem.plot.style import INK, MARGIN, house_style, in_house_style, new_axes, new_figure, panels, wrapped
from flexfem.plot.text import significant
from flexfem.refused import BadInput
from flexfem.units import UNITS
from flexfem.verify.modes import NaturalModes, Vibration
from flexfem.verify.result import OfStage

KILOGRAM = UNITS["kg"].name
DRAWN = 0.07  # largest drawn displacement, per size of the stage
COLOURS = "viridis"
PANEL, TITLE, SCALE = 3.6, 0.55, 0.8  # in, width of a panel, heights of its title and of the scale
FRAMES, RATE, SIZE = 24, 16, (4.6, 4.9)  # of an animation: frames of a cycle, per second, and its size in inches
CYCLE_DOTS = 90  # per inch, of an animation


@in_house_style
def modes_figure(found: Vibration) -> Figure:
    """Draw all modes, each with its frequency and band and the share of the mass that goes with it."""
    of = found.record
    lines = [
        f"{said_of(of)} Titles: the largest effective modal mass, of the whole mass or, "
        "in theta, moment of inertia. Displacements are exaggerated, each mode by its own factor; grey: at rest."
    ]
    titles = [title_of(of, number) for number in range(1, len(of.modes) + 1)]
    return grid_of(of, found.structure.mesh, lines, titles, lambda ax, number: plot_mode(ax, found, number))


def grid_of(
    of: OfStage, mesh: StageMesh, lines: list[str], titles: list[str], draw: Callable[[Axes, int], Axes]
) -> Figure:
    """A panel for each title, drawn by number from 1, above one scale of displacements."""
    columns = min(3, len(titles))
    rows = -(-len(titles) // columns)
    height = PANEL * float(np.divide(*np.ptp(mesh.nodes, axis=0)[::-1])) + TITLE
    size = (max(columns * PANEL + 0.3, 7.4), rows * height + SCALE)
    name = f"{of.name}: natural modes"  # type: ignore[attr-defined]
    figure, axes = panels(size, name, lines, rows, columns, (of.assumed, of.not_stated))
    for spare in axes[len(titles) :]:
        spare.remove()
    used = axes[: len(titles)]
    for number, (each, title) in enumerate(zip(used, titles, strict=True), start=1):
        draw(each, number)
        each.set_title(wrapped(title, PANEL - 0.2, 10), size=10)
    place = {"location": "bottom", "aspect": 38, "shrink": 6.0 / figure.get_figwidth()}
    bar = figure.colorbar(ScalarMappable(Normalize(0, 1), COLOURS), ax=used, **place)  # type: ignore[arg-type]
    bar.set_label("displacement, over the largest of the mode")
    return figure


def said_of(of: NaturalModes) -> str:
    """What the modes are of, and what is not in them."""
    payload = ""
    if of.payload_mass or of.payload_inertia:
        payload = f" payload {of.payload_mass:g} {KILOGRAM}, {of.payload_inertia:g} {UNITS['kg_mm2']};"
    return (
        f"Plane finite elements, motion in the plane only; drives {of.drives};{payload} mass {of.mass:.4g} {KILOGRAM}."
    )


def title_of(of: NaturalModes, number: int) -> str:
    """Number, frequency with band and the largest share of the mass of a mode."""
    one = of.modes[number - 1]
    return f"mode {number}: {said_of_mode(one.frequency, one.band, one.share.model_dump())}"


def said_of_mode(frequency: float, band: float, shares: Mapping[str, float]) -> str:
    """Frequency with band, Hz, and the largest of the shares of the mass, %, by name."""
    most = max(shares, key=lambda name: shares[name])
    return f"{frequency:.5g} ± {significant(band, 1)} {UNITS['hz']}; moves {shares[most]:.2g} % in {most}"


def plot_mode(ax: Axes | None, found: Vibration, number: int, *, phase: float = math.pi / 2) -> Axes:
    """Draw the stage in one mode (from 1) at a phase, rad, of its vibration; returns `ax`, or new axes.

    Colours are the size of the displacement over the largest, at any phase. Raises BadInput for a mode that is not
    there.
    """
    if not 1 <= number <= len(found.record.modes):
        raise BadInput(f"mode {number!r}, expected 1 to {len(found.record.modes)}")
    return draw_shape(ax or new_axes(), found.structure.mesh, found.fields[number - 1], math.sin(phase))


def draw_shape(ax: Axes, mesh: StageMesh, field: Array, phase: float = 1.0) -> Axes:
    """Draw a mesh displaced by so much of a field (n, 2) that is exaggerated, coloured by how far it moves."""
    size = np.linalg.norm(field, axis=1)
    moved = mesh.nodes + phase * exaggerated(mesh, field)
    loops = loops_of(edges_of(mesh.triangles).boundary)
    at_rest = LineCollection([polygon(mesh.nodes, loop) for loop in loops], colors="#8A8A8A", linewidths=0.8)
    ax.add_collection(at_rest, autolim=False)
    grid = Triangulation(moved[:, 0], moved[:, 1], quarters(mesh.triangles))
    shade(ax, grid, size / size.max())
    outline(ax, mesh, moved)
    return ax


def shade(ax: Axes, grid: Triangulation, values: Array) -> None:
    """Colour triangles by values from 0 to 1."""
    colours = Normalize(0, 1)
    ax.tripcolor(grid, values, shading="gouraud", cmap=COLOURS, norm=colours, rasterized=True, zorder=2)


def outline(ax: Axes, mesh: StageMesh, nodes: Array) -> None:
    """Draw the boundary and the hub of a mesh with its nodes at these places, and frame it at rest."""
    loops = loops_of(edges_of(mesh.triangles).boundary)
    lines = LineCollection([polygon(nodes, loop) for loop in loops], colors=INK, linewidths=0.5, zorder=3)
    hub = [polygon(nodes, loop) for loop in loops_of(mesh.edges["hub"])]
    for collection in (lines, PolyCollection(hub, facecolors="#D0D0D0", edgecolors=INK, linewidths=0.5)):
        ax.add_collection(collection, autolim=False)
    _frame(ax, mesh.nodes)


def exaggerated(mesh: StageMesh, field: Array) -> Array:
    """A field (n, 2) made so large that its largest displacement is visible, mm."""
    largest = float(np.linalg.norm(field, axis=1).max())
    return np.asarray(DRAWN * float(np.ptp(mesh.nodes, axis=0).max()) / largest * field)


def _frame(ax: Axes, nodes: np.ndarray) -> None:
    low, high, pad = nodes.min(axis=0), nodes.max(axis=0), (DRAWN + 0.01) * np.ptp(nodes, axis=0)
    ax.set(xlim=(low[0] - pad[0], high[0] + pad[0]), ylim=(low[1] - pad[1], high[1] + pad[1]))
    ax.set_aspect("equal", anchor="N")
    ax.set_axis_off()


def write_animation(found: Vibration, number: int, path: Path) -> Path:
    """Write one mode (from 1) as an animated GIF of one cycle: the outline, and that at rest in grey.

    Raises BadInput when the folder takes no file.
    """
    mesh = found.structure.mesh
    field = exaggerated(mesh, found.fields[number - 1])
    loops = loops_of(edges_of(mesh.triangles).boundary)
    figure = new_figure(*SIZE)
    ax = figure.add_axes((0.02, 0.02, 0.96, 0.86))
    title = wrapped(f"{found.record.name}: {title_of(found.record, number)}", SIZE[0] - MARGIN, 9)
    figure.text(0.5, 0.98, title, size=9, ha="center", va="top")
    ax.add_collection(LineCollection([polygon(mesh.nodes, loop) for loop in loops], colors="#9A9A9A", linewidths=0.7))
    moving = LineCollection([], colors=INK, linewidths=1.1)
    ax.add_collection(moving)
    _frame(ax, mesh.nodes)

    def draw(frame: int) -> list[LineCollection]:
        moved = mesh.nodes + math.sin(2 * math.pi * frame / FRAMES) * field
        moving.set_segments([polygon(moved, loop) for loop in loops])
        return [moving]

    with house_style(), replacing(path, ".gif") as temporary:
        animation = FuncAnimation(figure, draw, frames=FRAMES, interval=1000 / RATE)
        animation.save(str(temporary), writer=PillowWriter(fps=RATE), dpi=CYCLE_DOTS)
    return path
