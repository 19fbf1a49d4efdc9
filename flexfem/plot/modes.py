"""Vibration: mode shapes coloured by how far they move, animations of them, and the frequency response."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from matplotlib.tri import Triangulation

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.files.writing import replacing
from flexfem.plot import style
from flexfem.plot.fields import draw_field, draw_scale
from flexfem.plot.stage import QUARTERS, boundary_of, draw_boundary, draw_hub, fit
from flexfem.plot.style import INK, NAMES, new_axes, panels, wrapped
from flexfem.plot.text import significant
from flexfem.plot.write import write_beside
from flexfem.questions.modes import DynamicModel, NaturalModes, Vibration
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, UNITS, Direction

DRAWN = 0.07  # largest drawn displacement, per size of the stage
SHARE = Normalize(0, 1)
PANEL = 3.6  # in, width
FRAMES, RATE, SIZE = 24, 16, (4.6, 4.9)  # of an animation: frames of a cycle, per second, and its size in inches
CONTOURS = np.arange(-4, 5) / 5  # of w over its largest size
POINTS = 1500
LOWEST, HIGHEST = 0.05, 1.2  # of the drawn frequencies, over the first and the last natural one
Part = Literal["magnitude", "phase"]
Kind = Literal["load", "stroke"]


def figures(found: NaturalModes) -> dict[str, Any]:
    """What is written beside natural modes: their shapes, the frequency response, and an animation of each mode."""
    drawn: dict[str, Any] = {"": modes_figure(found)}
    if (model := _fields(found).reduced) is not None:
        drawn["-response"] = lambda beside: write_beside(beside, response_figure(model, found))
        for number in range(1, len(found.axes["mode"]) + 1):
            drawn[f"-{number}"] = partial(write_animation, found, number)
    return drawn


@style.in_house_style
def modes_figure(found: NaturalModes) -> Figure:
    """Draw all modes, each with its frequency and band and the share of the mass that goes with it."""
    count = len(found.axes["mode"])
    columns = min(3, count)
    rows = -(-count // columns)
    size, title = (max(columns * PANEL + 0.3, 7.4), rows * (0.92 * PANEL + 0.55) + 0.8), "natural modes"
    figure, axes = panels(size, f"{found.about.name}: {title}", [_said_of(found)], rows, columns, found.about, count)
    for number, each in enumerate(axes, start=1):
        plot_mode(each, found, number).set_title(wrapped(title_of(found, number), PANEL - 0.2, 10), size=10)
    draw_scale(figure, figure.axes, SHARE, "displacement, over the largest of the mode")
    return figure


def _fields(found: NaturalModes) -> Vibration:
    """The modes of finite elements. Raises BadInput when a result has none."""
    if not isinstance(found.fields, Vibration):
        raise BadInput("natural modes without finite elements, expected them for their shapes")
    return found.fields


def _said_of(found: NaturalModes) -> str:
    """What the modes are of, and what is not in them."""
    solid, asked, mass = _fields(found).heights is not None, found.settings, UNITS["kg"]
    said = "Finite elements in three dimensions;" if solid else "Plane finite elements, motion in the plane only;"
    said += f" drives {asked['drives']};" + (f" payload {asked['payload']};" if asked["payload"] else "")
    said += (
        f" mass {mass.factor * float(found.mass):.4g} {mass}. Titles: the largest effective modal mass, "
        "of the whole mass or, in theta, moment of inertia. Displacements are exaggerated, each mode by its own "
        "factor; grey: at rest."
    )
    drawn = " The mid-plane is drawn; out of its plane by contours every 0.2 of the largest w, dashed where it is "
    return said + (f"{drawn}opposite, thick where it is zero." if solid else "")


def title_of(found: NaturalModes, number: int) -> str:
    """Number, kind, frequency with band and the largest share of the mass of a mode."""
    share, hertz = found.share[number - 1], UNITS["hz"].factor
    most = int(np.argmax(share))
    value, band = (hertz * each[number - 1, -1] for each in (found.frequency, found.band("frequency")))
    label, frequency = found.axes["mode"][number - 1], f"{value:.5g} ± {significant(band, 1)} {UNITS['hz']}"
    return f"mode {label}: {frequency}; moves {share[most]:.2g} % in {found.axes['base'][most]}"


def plot_mode(ax: Axes | None, found: NaturalModes, number: int, *, phase: float = math.pi / 2) -> Axes:
    """Draw the stage in one mode (from 1) at a phase, rad, of its vibration; returns `ax`, or new axes.

    Colours are the size of the displacement over the largest, at any phase. In three dimensions the mid-plane is drawn:
    displaced in its plane, or contours of how far it leaves it. Raises BadInput for a mode that is not there.
    """
    fields, count = _fields(found), len(found.axes["mode"])
    if not 1 <= number <= count:
        raise BadInput(f"mode {number!r}, expected 1 to {count}")
    ax, mesh = ax or new_axes(), fields.mesh
    field = fields.shapes[number - 1]
    if fields.heights is not None:
        field = field[:, len(fields.heights) // 2]  # of the mid-plane
    if fields.tilting[number - 1]:
        w = field[:, 2] / np.abs(field[:, 2]).max()
        linked = mesh.bodies % 4 > 0  # on the pads, whose backs are clamped, w is nearly zero, its contour says nothing
        grid = Triangulation(mesh.nodes[:, 0], mesh.nodes[:, 1], mesh.triangles[linked][:, QUARTERS].reshape(-1, 3))
        looks: dict[str, Any] = {"negative_linestyles": "dashed"} if w.min() < 0.0 < w.max() else {}
        widths = np.where(CONTOURS == 0.0, 1.6, 0.6)
        ax.tricontour(grid, w, levels=CONTOURS, colors=INK, linewidths=widths, zorder=2.5, **looks)
        moved, values = mesh.nodes, np.abs(w)
    else:
        sizes = np.linalg.norm(field[:, :2], axis=1)
        moved, values = mesh.nodes + math.sin(phase) * _exaggerated(mesh, field[:, :2]), sizes / sizes.max()
    draw_field(ax, mesh.nodes, mesh.triangles, moved, values, SHARE)
    draw_hub(ax, mesh.nodes, moved)
    fit(ax, mesh.nodes, DRAWN + 0.01)
    return ax


def _exaggerated(mesh: StageMesh, field: Array) -> Array:
    """A field (n, 2) made so large that its largest displacement is visible, mm."""
    largest = float(np.linalg.norm(field, axis=1).max())
    return np.asarray(DRAWN * float(np.ptp(mesh.nodes, axis=0).max()) / largest * field)


def write_animation(found: NaturalModes, number: int, path: Path) -> list[Path]:
    """Write one mode (from 1) in the plane as an animated GIF of one cycle: the outline, and that at rest in grey.

    Raises BadInput when the folder takes no file.
    """
    fields, path = _fields(found), path.with_suffix(".gif")
    mesh, title = fields.mesh, f"{found.about.name}: {title_of(found, number)}"
    field, boundary = _exaggerated(mesh, fields.shapes[number - 1]), boundary_of(mesh.triangles)
    figure = Figure(figsize=SIZE)
    ax = figure.add_axes((0.02, 0.02, 0.96, 0.86))
    figure.text(0.5, 0.98, wrapped(title, SIZE[0] - 0.3, 9), size=9, ha="center", va="top")
    draw_boundary(ax, mesh.nodes, boundary, "#9A9A9A", 0.7)
    moving = LineCollection([], colors=INK, linewidths=1.1, zorder=4)
    ax.add_collection(moving)
    fit(ax, mesh.nodes, DRAWN + 0.01)
    ax.set_axis_off()

    def draw(frame: int) -> list[LineCollection]:
        moved = mesh.nodes + math.sin(2 * math.pi * frame / FRAMES) * field
        moving.set_segments(list(moved[boundary[:, [0, 2, 1]]]))
        return [moving]

    with style.house_style(), replacing(path, ".gif") as temporary:
        animation = FuncAnimation(figure, draw, frames=FRAMES, interval=1000 / RATE)
        animation.save(str(temporary), writer=PillowWriter(fps=RATE), dpi=90)
    return [path]


@style.in_house_style
def response_figure(model: DynamicModel, of: NaturalModes) -> Figure:
    """Draw magnitude and phase of all three poses, each under its own load and under every stroke."""
    kinds: tuple[Kind, ...] = ("load", "stroke") if _strokes(model) else ("load",)
    lines = [
        f"Plane finite elements, {len(model.frequencies)} modes and what the others do at rest; drives "
        f"{of.settings['drives']}. Damping of every mode {100 * model.damping:g} % of critical, assumed. Motion in the "
        "plane only."
    ]
    size, title = (12.6, 5.0 * len(kinds)), f"{of.about.name}: frequency response"
    figure, axes = panels(size, title, lines, 2 * len(kinds), 3, of.about)
    for row, kind in enumerate(kinds):
        for column, name in enumerate(DIRECTIONS):
            upper, lower = axes[6 * row + column], axes[6 * row + 3 + column]
            plot_response(upper, model, name, kind, "magnitude")
            plot_response(lower, model, name, kind, "phase")
            upper.set_title(f"{NAMES[name]} under {'its load' if kind == 'load' else 'strokes'}", loc="left", size=11)
        if kind == "stroke":
            style.legend_beside(upper, fontsize=8)
    return figure


def plot_response(
    ax: Axes | None, model: DynamicModel, direction: Direction, kind: Kind = "load", part: Part = "magnitude"
) -> Axes:
    """Draw the response of one direction of the pose under its own load, or under every stroke; returns `ax`.

    Raises BadInput for a direction, kind or part that is not there.
    """
    if direction not in DIRECTIONS or part not in ("magnitude", "phase"):
        raise BadInput(f"response {direction!r}, {part!r}, expected x, y or theta, and magnitude or phase")
    row = DIRECTIONS.index(direction)
    inputs = [row] if kind == "load" else _strokes(model)
    if not inputs:
        raise BadInput("no strokes: the drives are not engaged")
    ax = ax or new_axes()
    natural = model.frequencies
    w = np.geomspace(LOWEST * natural[0], HIGHEST * natural[-1], POINTS)
    w = np.unique(np.concatenate([w, *(each * np.linspace(0.9, 1.1, 201) for each in natural)]))
    found = model.response(w)[:, row]
    for k, column in enumerate(inputs):
        values = found[:, column]
        drawn = np.abs(values) if part == "magnitude" else np.rad2deg(np.unwrap(np.angle(values)))
        look: dict[str, Any] = {"color": style.COLOURS[k % 8], "linestyle": style.DASHES[k % 7]}
        ax.semilogx(w / (2 * math.pi), drawn, linewidth=1.2, label=model.inputs.names[column], **look)
    ax.set_xlabel(f"frequency ({UNITS['hz']})")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    if part == "magnitude":
        unit = model.inputs.units[inputs[0]]
        ax.set(yscale="log", ylabel=f"magnitude ({model.outputs.units[row]}/{f'({unit})' if ' ' in unit else unit})")
        ax.yaxis.set_major_formatter("{x:.0e}")
        ax.yaxis.set_minor_formatter(NullFormatter())
    else:
        ax.set_ylabel(f"phase ({UNITS['deg']})")
    ax.grid(which="major")
    return ax


def _strokes(model: DynamicModel) -> list[int]:
    """Which inputs are strokes."""
    return [k for k, name in enumerate(model.inputs.names) if name.startswith("stroke")]
