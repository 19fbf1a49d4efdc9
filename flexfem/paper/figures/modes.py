"""Figures of vibration: mode shapes coloured by displacement, their animations, and the frequency
response.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import product
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
from flexfem.fem.mesh import PlaneMesh
from flexfem.files.writing import replacing
from flexfem.paper.modes import NaturalModes
from flexfem.paper.reduced import DynamicModel
from flexfem.paper.vibration import Vibration
from flexfem.plot import style
from flexfem.plot.drawing import fit
from flexfem.plot.fields import VISIBLE, draw_field, draw_scale, exaggeration
from flexfem.plot.mesh import QUARTERS, boundary_of, draw_boundary
from flexfem.plot.style import INK, NAMES, new_axes, panels, wrapped
from flexfem.plot.text import scientific
from flexfem.plot.write import write_beside
from flexfem.refused import BadInput, printed
from flexfem.results import Fields
from flexfem.results import number as digits
from flexfem.units import DIRECTIONS, UNITS, Direction

SHARE = Normalize(0, 1)
PANEL = 3.6  # in, width
FRAMES = 24
RATE = 16
SIZE = (4.6, 4.9)  # of an animation: frames per cycle and per second; in
CONTOURS = np.arange(-4, 5) / 5  # of w over its largest magnitude
POINTS = 1500  # frequencies of a response
LOWEST = 0.05
HIGHEST = 1.2  # drawn frequencies over the first and over the last natural frequency
Part = Literal["magnitude", "phase"]
Kind = Literal["load", "stroke"]


def figures(found: NaturalModes) -> dict[str, Any]:
    """Figures of natural modes by file-name suffix: shapes, frequency response, and an animation of
    each mode.
    """
    by_suffix: dict[str, Any] = {"": modes_figure(found)}
    if (model := _fields(found).reduced) is not None:
        by_suffix["-response"] = lambda stored: write_beside(stored, response_figure(model, found))
        for number in range(1, len(_fields(found).shapes) + 1):
            by_suffix[f"-{number}"] = partial(write_animation, found, number)
    return by_suffix


@style.in_house_style
def modes_figure(found: NaturalModes) -> Figure:
    """Draw all modes, each with its frequency, its band and its largest effective mass."""
    count = len(_fields(found).shapes)
    columns = min(3, count)
    rows = -(-count // columns)
    title = f"{found.about.name}: natural modes"
    size = (max(columns * PANEL + 0.3, 7.4), rows * (0.8 * PANEL + 0.55) + 0.8)
    figure, axes = panels(size, title, [_header(found)], rows, columns, found.about, count)
    for number, ax in enumerate(axes, start=1):
        plot_mode(ax, found, number).set_title(title_of(found, number), size=10)
    draw_scale(figure, figure.axes, SHARE, "displacement / largest of the mode")
    return figure


def _fields(found: NaturalModes) -> Vibration:
    """Return the finite-element modes of a result. Raises BadInput when it has none."""
    if not isinstance(found.fields, Vibration):
        raise BadInput(
            "natural modes without finite elements, expected a result with finite elements"
        )
    return found.fields


def _header(found: NaturalModes) -> str:
    """Header of the modes: model, drives, payload, mass and drawing conventions."""
    solid = _fields(found).heights is not None
    settings = found.settings
    mass = UNITS["kg"]
    text = (
        "Finite elements in three dimensions,"
        if solid
        else "Plane finite elements, motion in the plane only,"
    )
    text += f" drives {settings['drives']}," + (
        f" payload {settings['payload']}," if settings["payload"] else ""
    )
    text += (
        f" mass {float(found.mass):.4g} {mass}. Displacements are exaggerated, each mode by its "
        "own factor; grey: at rest. Effective mass: the largest share of the mass, or of the "
        "moment of inertia in rotation."
    )
    mid_plane = " The mid-plane is drawn; contours: deflection w in steps of 0.2 of its maximum, "
    return text + (f"{mid_plane}dashed: opposite sign, thick: zero." if solid else "")


def title_of(found: NaturalModes, number: int) -> str:
    """Label, frequency with band and largest effective mass of a mode."""
    share = found.share[number - 1]
    largest = int(np.argmax(share))
    value, band = (
        float(values[number - 1, -1]) for values in (found.frequency, found.band("frequency"))
    )
    direction = found.axes["base"][largest].replace("theta", NAMES["theta"])
    mode = f"mode {found.axes['mode'][number - 1]}: {digits(value, band)} {UNITS['hz']}"
    return f"{mode}\neffective mass {share[largest]:.2g} % in {direction}"


def plot_mode(
    ax: Axes | None, found: NaturalModes, number: int, *, phase: float = math.pi / 2
) -> Axes:
    """Draw the stage in one mode (from 1) at a phase, rad, of its vibration; return `ax`, or new
    axes.

    Colours are the amplitude over its largest value, at any phase. In three dimensions the
    mid-plane is drawn: its displacement in the plane, or contours of w, its deflection. Raises
    BadInput for a mode that does not exist."""
    fields = _fields(found)
    count = len(_fields(found).shapes)
    if not 1 <= number <= count:
        raise BadInput(f"mode {printed(number)}, expected 1 to {count}")
    ax = ax or new_axes()
    mesh = fields.mesh
    field = fields.shapes[number - 1]
    if fields.heights is not None:
        field = field[:, len(fields.heights) // 2]  # of the mid-plane
    if fields.tilting[number - 1]:
        w = field[:, 2] / np.abs(field[:, 2]).max()
        linked = mesh.bodies % 4 > 0  # not the pads: their backs are clamped and w nearly zero
        grid = Triangulation(
            mesh.nodes[:, 0], mesh.nodes[:, 1], mesh.triangles[linked][:, QUARTERS].reshape(-1, 3)
        )
        looks: dict[str, Any] = {"negative_linestyles": "dashed"} if w.min() < 0.0 < w.max() else {}
        widths = np.where(CONTOURS == 0.0, 1.6, 0.6)
        ax.tricontour(grid, w, levels=CONTOURS, colors=INK, linewidths=widths, zorder=2.5, **looks)
        moved = mesh.nodes
        values = np.abs(w)
    else:
        sizes = np.linalg.norm(field[:, :2], axis=1)
        moved = mesh.nodes + math.sin(phase) * _exaggerated(mesh, field[:, :2])
        values = sizes / sizes.max()
    draw_field(ax, mesh.nodes, mesh.triangles, moved, values, SHARE)
    fit(ax, mesh.nodes, VISIBLE + 0.01)
    return ax


def _exaggerated(mesh: PlaneMesh, field: Array) -> Array:
    """Field (n, 2), mm, scaled so that its largest displacement is visible in both senses."""
    fields = Fields(mesh.nodes, mesh.triangles, mesh.bodies, field, field[:, 0])
    return exaggeration(fields, signs=(1.0, -1.0)) * field


def write_animation(
    found: NaturalModes,
    number: int,
    path: Path,
) -> list[Path]:
    """Write an in-plane mode (from 1) as an animated GIF of one cycle: its outline, and in grey the
    outline at rest.

    Raises BadInput when the file cannot be written.
    """
    fields = _fields(found)
    path = path.with_suffix(".gif")
    mesh = fields.mesh
    title = f"{found.about.name}: {title_of(found, number)}"
    field = _exaggerated(mesh, fields.shapes[number - 1])
    boundary = boundary_of(mesh.triangles)
    figure = Figure(figsize=SIZE)
    ax = figure.add_axes((0.02, 0.02, 0.96, 0.86))
    figure.text(
        0.5,
        0.98,
        wrapped(title, SIZE[0] - 0.3, 9),
        size=9,
        ha="center",
        va="top",
    )
    draw_boundary(ax, mesh.nodes, boundary, "#9A9A9A", 0.7)
    moving = LineCollection(
        [],
        colors=INK,
        linewidths=1.1,
        zorder=4,
    )
    ax.add_collection(moving)
    fit(ax, mesh.nodes, VISIBLE + 0.01)
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
def response_figure(model: DynamicModel, found: NaturalModes) -> Figure:
    """Draw magnitude and phase of all three pose components, each under its own load and under
    every stroke.
    """
    kinds: tuple[Kind, ...] = ("load", "stroke") if _strokes(model) else ("load",)
    lines = [
        f"Plane finite elements, {len(model.frequencies)} modes and the static part of the "
        f"others; drives {found.settings['drives']}. Damping of every mode "
        f"{100 * model.damping:g} % of critical, assumed. Motion in the plane only."
    ]
    size = (12.6, 5.0 * len(kinds))
    title = f"{found.about.name}: frequency response"
    figure, axes = panels(size, title, lines, 2 * len(kinds), 3, found.about)
    for k, (kind, name) in enumerate(product(kinds, DIRECTIONS)):
        upper = axes[k + 3 * (k // 3)]
        lower = axes[k + 3 * (k // 3) + 3]
        plot_response(upper, model, name, kind, "magnitude").set_xlabel("")
        plot_response(lower, model, name, kind, "phase")
        under = "strokes" if kind == "stroke" else "moment" if name == "theta" else "force"
        style.titled(upper, "abcdef"[k], f"{NAMES[name]} under {under}")
        if under == "strokes" and name == "theta":
            style.legend_beside(upper, fontsize=8)
    return figure


def plot_response(
    ax: Axes | None,
    model: DynamicModel,
    direction: Direction,
    kind: Kind = "load",
    part: Part = "magnitude",
) -> Axes:
    """Draw the response of one pose component under its own load, or under every stroke; return
    `ax`, or new axes.

    Raises BadInput for an unknown direction, kind or part, or for strokes of a model without
    engaged drives."""
    if (
        direction not in DIRECTIONS
        or kind not in ("load", "stroke")
        or part not in ("magnitude", "phase")
    ):
        expected = "expected x, y or theta; load or stroke; and magnitude or phase"
        raise BadInput(
            f"response {printed(direction)}, {printed(kind)}, {printed(part)}, {expected}"
        )
    row = DIRECTIONS.index(direction)
    inputs = [row] if kind == "load" else _strokes(model)
    if not inputs:
        raise BadInput("no strokes: the drives are not engaged")
    ax = ax or new_axes()
    natural = model.frequencies
    w = np.geomspace(LOWEST * natural[0], HIGHEST * natural[-1], POINTS)
    w = np.unique(
        np.concatenate([w, *(frequency * np.linspace(0.9, 1.1, 201) for frequency in natural)])
    )
    response = model.response(w)[:, row]
    for k, column in enumerate(inputs):
        values = response[:, column]
        y = np.abs(values) if part == "magnitude" else np.rad2deg(np.unwrap(np.angle(values)))
        look: dict[str, Any] = {"color": style.COLOURS[k % 8], "linestyle": style.DASHES[k % 7]}
        ax.semilogx(w / (2 * math.pi), y, linewidth=1.2, label=model.inputs.names[column], **look)
    ax.set_xlabel(f"frequency ({UNITS['hz']})")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    if part == "magnitude":
        unit = model.inputs.units[inputs[0]]
        ax.set(
            yscale="log",
            ylabel=f"magnitude ({model.outputs.units[row]}/{f'({unit})' if ' ' in unit else unit})",
        )
        ax.yaxis.set_major_formatter(lambda value, _: scientific(value).removeprefix("1×"))
        ax.yaxis.set_minor_formatter(NullFormatter())
    else:
        ax.set_ylabel(f"phase ({UNITS['deg']})")
    ax.grid(which="major")
    return ax


def _strokes(model: DynamicModel) -> list[int]:
    """Indices of the inputs that are strokes."""
    return [k for k, name in enumerate(model.inputs.names) if name.startswith("stroke")]
