"""Displacement fields: the stage deformed by a command or by heat, exaggerated, coloured by von Mises stress."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from matplotlib.tri import Triangulation

from flexfem.arrays import Array
from flexfem.mechanism.bodies import BODIES
from flexfem.plot.stage import boundary_of, draw_boundary, draw_hub, fit, place_label, quarters
from flexfem.plot.style import INK, NAMES, NOTE_COLOUR, in_house_style, new_axes, panels, titled, wrapped
from flexfem.plot.text import SHOWN_OF_SOLID, round_factor, significant
from flexfem.questions.errors import CurveModels, Verification
from flexfem.questions.heat import CASES, Drift, WarmFields
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, Fields
from flexfem.units import DIRECTIONS, STRESS, unit_for

VISIBLE = 0.05  # largest drawn displacement, per size of the stage
DECADES = 4  # of stress; what is below has the last colour
ALIKE = 1e-6  # relative difference of stresses that symmetry makes equal: far above round-off, far below mesh noise
ROUND_OFF = 1e-9  # of the largest component of a pose: zero by symmetry
COLOURS = "viridis"
PANEL, TITLE, SCALE = 5.0, 0.6, 0.8  # in, width of a panel, heights of its title and of the scale of stress
WARM: dict[str, tuple[str, str, tuple[float, float]]] = {  # in words, what stress is per, arrow per size of the axes
    "uniform": ("1 K everywhere", "K", (0.0, 0.0)),
    "gradient in x": ("1 K/mm along X", "K/mm", (0.1, 0.0)),
    "gradient in y": ("1 K/mm along Y", "K/mm", (0.0, 0.1)),
}


class CommandedStage(NamedTuple):
    """A stage at a command: what is said of it, and its fields."""

    said: str
    fields: Fields


def plot_displacement(
    ax: Axes | None,
    fields: Fields,
    *,
    factor: float | None = None,
    norm: LogNorm | None = None,
    hub_radius: float = 0.0,
) -> Axes:
    """Draw a stage displaced by finite elements, coloured by von Mises stress; in grey its outline at rest.

    Parameters
    ----------
    ax : Axes or None
        None makes new axes.
    fields : Fields
        Nodes and displacement, mm, and stress, MPa, under one load.
    factor, norm : float, LogNorm, optional
        Exaggeration and scale of stress; by default those that suit these fields.
    hub_radius : float
        Of the rigid disc at the platform centre, mm, which is filled; 0 leaves its hole.

    Returns
    -------
    Axes
        Those that were drawn on.
    """
    nodes, triangles, displacement, stress = fields.nodes, fields.triangles, fields.displacement, fields.stress
    ax = ax or new_axes()
    factor, norm = factor or exaggeration(fields), norm or stress_scale(fields)
    moved, boundary = nodes + factor * displacement, boundary_of(triangles)
    grid = Triangulation(moved[:, 0], moved[:, 1], quarters(triangles))
    colours: Any = {"cmap": COLOURS, "norm": norm}
    ax.tripcolor(grid, np.clip(stress, norm.vmin, None), shading="gouraud", rasterized=True, zorder=2, **colours)
    draw_boundary(ax, nodes, boundary, "#8A8A8A", 0.9, zorder=1)
    draw_boundary(ax, moved, boundary, INK, 0.5)
    draw_hub(ax, nodes, moved, hub_radius)
    fit(ax, np.concatenate([nodes, moved]), 0.03)
    ax.set_axis_off()
    return ax


def exaggeration(*fields: Fields) -> float:
    """A round factor by which the largest displacement becomes visible but does not spoil the shape."""
    largest = max(
        float(np.linalg.norm(field.displacement, axis=1).max() / np.ptp(field.nodes, axis=0).max()) for field in fields
    )
    return round_factor(VISIBLE / largest) if largest > 0 else 1.0


def stress_scale(*fields: Fields) -> LogNorm:
    """Colours for some decades below the largest stress, MPa."""
    largest = max(float(field.stress.max()) for field in fields) or 1.0
    return LogNorm(largest / 10**DECADES, largest)


def draw_scale(figure: Figure, axes: Any, norm: LogNorm, per: str = "", **place: Any) -> None:
    """Colour bar of stress below one or several panels."""
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=axes, location="bottom", extend="min", **place)
    bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    bar.ax.xaxis.set_minor_formatter(NullFormatter())
    bar.set_label(f"von Mises stress ({STRESS}{per})")


def _panel_height(*fields: Fields) -> float:
    """Height of a panel, in inches, that holds the tallest stage."""
    ratios = [float(np.divide(*np.ptp(field.nodes, axis=0)[::-1])) for field in fields]
    return PANEL * min(max(*ratios, 0.6), 1.5)


@in_house_style
def deformed_figure(result: Verification, fields: dict[str, Fields]) -> Figure:
    """Draw the deformed stage of every curve at full command, with von Mises stress and the largest one named.

    All panels share one exaggeration and one scale of stress.
    """
    doubts, models = (result.assumed, result.not_stated), result.models
    count, factor, norm = len(fields), exaggeration(*fields.values()), stress_scale(*fields.values())
    columns = max(2, count if count < 4 else int(np.ceil(np.sqrt(count))))
    rows = -(-count // columns)
    size = (columns * PANEL + 0.3, rows * (_panel_height(*fields.values()) + TITLE) + SCALE)
    command = unit_for(result.direction, result.commanded[-1])
    value = significant(result.commanded[-1] * command.factor, 3)
    lines = [
        f"Deformed stage at the full command {NAMES[result.direction]} = {value} {command}, displacements "
        f"× {significant(factor, 1)}; grey: undeformed. Colour: von Mises stress on a logarithmic scale."
    ]
    if result.elements == "three_dimensional":
        lines.append(f"Three dimensions. {SHOWN_OF_SOLID}")
    figure, found = panels(size, result.name, lines, rows, columns, doubts)
    for axes in found[count:]:
        axes.remove()
    for axes, label in zip(found, result.curves, strict=False):
        axes.set_title(wrapped(label, PANEL - 0.3, 11), size=11)
        plot_displacement(axes, fields[label], factor=factor, norm=norm, hub_radius=models[label].hub_radius)
        _name_largest(axes, models[label], fields[label], factor)
    draw_scale(figure, figure.axes, norm, aspect=38, shrink=6.0 / size[0])
    return figure


def largest_stress(model: CurveModels, fields: Fields) -> tuple[int, str]:
    """Node of the largest stress and the name of its place; of places alike, as by symmetry, the first by name."""
    nodes = np.flatnonzero(fields.stress >= fields.stress.max() * (1 - ALIKE))
    places = {name_of_place(model, fields, int(node)): int(node) for node in reversed(nodes)}
    first, *others = sorted(places)
    return places[first], f"{first} and {len(others)} more alike" if others else first


def name_of_place(model: CurveModels, fields: Fields, node: int) -> str:
    """The hinge whose notch holds a node, else the body."""
    at = fields.nodes[node]
    for number, hinge in enumerate(model.hinges, start=1):
        if np.hypot(*(at - hinge.centre)) <= hinge.radius + hinge.neck:
            return f"hinge {number} ({hinge.hinge}, chain {hinge.chain})"
    triangle = int(np.argmax((fields.triangles == node).any(axis=1)))
    chain, body = divmod(int(fields.bodies[triangle]), len(BODIES))
    return BODIES[body] if BODIES[body] == "platform" else f"{BODIES[body]} of chain {chain + 1}"


def _name_largest(axes: Axes, model: CurveModels, fields: Fields, factor: float) -> None:
    """Point at the largest stress and write value and place below the stage."""
    moved = fields.nodes + factor * fields.displacement
    node, place = largest_stress(model, fields)
    text = f"largest {significant(float(fields.stress[node]), 3)} {STRESS} at {place}"
    axes.text(0.5, -0.03, text, transform=axes.transAxes, ha="center", va="center", size=9.5)
    style: dict[str, Any] = {"colour": NOTE_COLOUR, "weight": "bold"}
    spot = place_label(axes, moved[node], "max", [moved[::4], fields.nodes[::4]], 0.09 * np.ptp(moved), **style)
    arrow = {"arrowstyle": "-|>", "color": NOTE_COLOUR, "linewidth": 1.2, "shrinkA": 8.0, "shrinkB": 4.0}
    axes.annotate("", tuple(moved[node]), tuple(spot), arrowprops=arrow, zorder=6)
    axes.plot(*moved[node], "o", markersize=6, markerfacecolor="none", markeredgecolor=NOTE_COLOUR, zorder=6)


@in_house_style
def commanded_figure(
    title: str, found: list[CommandedStage], hub_radius: float, doubts: tuple[list[str], ...]
) -> Figure:
    """Draw the stage at every command, one exaggeration and one scale of stress; mm, MPa."""
    fields = [each.fields for each in found]
    factor, norm = exaggeration(*fields), stress_scale(*fields)
    lines = [f"Displacements × {significant(factor, 1)}; grey: at rest. Colour: von Mises stress, logarithmic scale."]
    size = (len(found) * PANEL + 0.3, _panel_height(*fields) + SCALE)
    figure, axes = panels(size, title, lines, 1, len(found), doubts)
    for ax, each in zip(axes, found, strict=True):
        plot_displacement(ax, each.fields, factor=factor, norm=norm, hub_radius=hub_radius)
        ax.set_title(each.said, size=11)
    draw_scale(figure, axes, norm, aspect=38, shrink=6.0 / size[0])
    return figure


@in_house_style
def drift_figure(found: Drift) -> Figure:
    """Draw the three cases, each with its own exaggeration and scale of stress."""
    of, fields, stated = found.about, _warm(found).cases, found.settings
    width = 0.88 * PANEL
    height = width * float(np.divide(*np.ptp(fields["uniform"].nodes, axis=0)[::-1])) + 1.25
    lines = [
        f"Expansion {stated['expansion']}, frame {stated['frame']}; both have the same temperature at every place, "
        "gradients are about the platform's centre. Plane finite elements; grey: at rest; bars: clamped edges, which "
        "the frame carries along. Stress at the corners of these grows with finer meshes; titles: at the necks."
    ]
    doubts = (of.assumed, of.not_stated)
    figure, axes = panels((3 * width + 0.3, height), f"{of.name}: warm", lines, 1, 3, doubts)
    for letter, ax, name in zip("abc", axes, CASES, strict=True):
        plot_drift(ax, found, name)
        pose, stress = (found.at(quantity, case=name, model=ELEMENTS) for quantity in ("pose", "stress"))
        text = f"{WARM[name][0]}, displacements × {significant(exaggeration(fields[name]), 1)}\n{_pose(pose, of.lever)}"
        titled(ax, letter, f"{text}; necks to {significant(float(np.max(stress)), 3)} {STRESS}", size=9.5)
        draw_scale(figure, ax, stress_scale(fields[name]), f" per {WARM[name][1]}", aspect=30, shrink=0.9)
    return figure


def _warm(found: Drift) -> WarmFields:
    """The plane fields of a result. Raises BadInput when it has none."""
    if not isinstance(found.fields, WarmFields):
        raise BadInput("a drift without plane finite elements, expected them for its figure")
    return found.fields


def plot_drift(ax: Axes | None, found: Drift, case: str) -> Axes:
    """Draw a stage displaced by 1 K or 1 K/mm, coloured by von Mises stress; returns `ax`, or new axes.

    Raises BadInput for another case, or without finite elements.
    """
    warm = _warm(found)
    if case not in warm.cases:
        raise BadInput(f"case {case!r}, expected one of: {', '.join(warm.cases)}")
    ax, fields = ax or new_axes(), warm.cases[case]
    plot_displacement(ax, fields, hub_radius=warm.hub_radius)
    moved = fields.nodes + exaggeration(fields) * fields.displacement
    draw_boundary(ax, moved, warm.ground, INK, 3.0, zorder=4)
    x, y = WARM[case][2]
    if x or y:
        arrow = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", (0.02 + x, 0.86 + y), (0.02, 0.86), xycoords="axes fraction", arrowprops=arrow)
        ax.text(0.04 + x, 0.86 + y / 2, "warmer", transform=ax.transAxes, va="center", size=8.5)
    return ax


def _pose(pose: Array, lever: float) -> str:
    """A pose with prefixes, round-off as zero."""
    sizes, cells = np.abs(pose) * [1.0, 1.0, lever], []
    for axis, value, size in zip(DIRECTIONS, pose, sizes, strict=True):
        unit = unit_for(axis, abs(value))
        shown = f"{significant(unit.factor * value)} {unit}" if size > ROUND_OFF * np.max(sizes) else "0"
        cells.append(f"{NAMES[axis]} {shown}")
    return ", ".join(cells)
