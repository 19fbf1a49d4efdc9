"""The deformed stage at full command, exaggerated, coloured by von Mises stress."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from matplotlib.tri import Triangulation

from flexfem.arrays import Array
from flexfem.mechanism.bodies import BODIES
from flexfem.plot.curves import NAMES
from flexfem.plot.driven_text import SHOWN_OF_SOLID
from flexfem.plot.marks import clear_spot, edges_of, loops_of, polygon, quarters
from flexfem.plot.style import INK, in_house_style, new_axes, panels, wrapped
from flexfem.plot.text import round_factor, significant
from flexfem.questions.errors import CurveModels, Verification
from flexfem.units import STRESS, unit_for
from flexfem.verify.result import Fields

VISIBLE = 0.05  # largest drawn displacement, per size of the stage
DECADES = 4  # of stress; what is below has the last colour
ALIKE = 1e-6  # relative difference of stresses that symmetry makes equal: far above round-off, far below mesh noise
COLOURS = "viridis"
PANEL, TITLE, SCALE = 5.0, 0.6, 0.8  # in, width of a panel, heights of its title and of the scale of stress


class Peak(NamedTuple):
    """Node of the largest stress and the name of its place."""

    node: int
    place: str


@in_house_style
def deformed_figure(result: Verification, fields: dict[str, Fields]) -> Figure:
    """Draw the deformed stage of every curve at full command, with von Mises stress and the largest one named.

    Parameters
    ----------
    result, fields : a stored verification; mm and MPa. All panels share one exaggeration and one scale of stress.
    """
    columns = max(2, len(result.curves) if len(result.curves) < 4 else int(np.ceil(np.sqrt(len(result.curves)))))
    rows = -(-len(result.curves) // columns)
    size = (columns * PANEL + 0.3, rows * (panel_height(fields) + TITLE) + SCALE)
    factor, norm = exaggeration(fields), stress_scale(fields)
    command = unit_for(result.direction, result.commanded[-1])
    value = significant(result.commanded[-1] * command.factor, 3)
    lines = [
        f"Deformed stage at the full command {NAMES[result.direction]} = {value} {command.name}, displacements "
        f"× {significant(factor, 1)}; grey: undeformed. Colour: von Mises stress on a logarithmic scale."
    ]
    if result.elements == "three_dimensional":
        lines.append(f"Three dimensions. {SHOWN_OF_SOLID}")
    figure, found = panels(size, result.name, lines, rows, columns, (result.assumed, result.not_stated))
    for axes in found[len(result.curves) :]:
        axes.remove()
    for axes, label in zip(found, result.curves, strict=False):
        axes.set_title(wrapped(label, PANEL - 0.3, 11), size=11)
        model = result.models[label]
        plot_displacement(axes, fields[label], factor=factor, norm=norm, hub_radius=model.hub_radius)
        _name_largest(axes, model, fields[label], factor)
    draw_scale(figure, norm)
    return figure


def panel_height(fields: dict[str, Fields]) -> float:
    """Height of a panel, in inches, that holds the tallest stage."""
    ratios = [float(np.divide(*np.ptp(field.nodes, axis=0)[::-1])) for field in fields.values()]
    return PANEL * min(max(*ratios, 0.6), 1.5)


def exaggeration(fields: dict[str, Fields]) -> float:
    """A round factor by which the largest displacement becomes visible but does not spoil the shape."""
    largest = max(
        float(np.linalg.norm(field.displacement, axis=1).max() / np.ptp(field.nodes, axis=0).max())
        for field in fields.values()
    )
    return round_factor(VISIBLE / largest) if largest > 0 else 1.0


def stress_scale(fields: dict[str, Fields]) -> LogNorm:
    """Colours for some decades below the largest stress, MPa."""
    largest = max(float(field.stress.max()) for field in fields.values()) or 1.0
    return LogNorm(largest / 10**DECADES, largest)


def largest_stress(model: CurveModels, fields: Fields) -> Peak:
    """Node of the largest stress and the name of its place; of places alike, as by symmetry, the first by name."""
    nodes = np.flatnonzero(fields.stress >= fields.stress.max() * (1 - ALIKE))
    places = {name_of_place(model, fields, int(node)): int(node) for node in reversed(nodes)}
    first, *others = sorted(places)
    return Peak(places[first], f"{first} and {len(others)} more alike" if others else first)


def name_of_place(model: CurveModels, fields: Fields, node: int) -> str:
    """The hinge whose notch holds a node, else the body."""
    at = fields.nodes[node]
    for number, hinge in enumerate(model.hinges, start=1):
        if np.hypot(*(at - hinge.centre)) <= hinge.radius + hinge.neck:
            return f"hinge {number} ({hinge.hinge}, chain {hinge.chain})"
    triangle = int(np.argmax((fields.triangles == node).any(axis=1)))
    chain, body = divmod(int(fields.bodies[triangle]), len(BODIES))
    return BODIES[body] if BODIES[body] == "platform" else f"{BODIES[body]} of chain {chain + 1}"


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
    fields : nodes and displacement, mm, and stress, MPa, under one load.
    factor, norm : exaggeration and scale of stress; by default those that suit these fields.
    hub_radius : mm, of the rigid disc at the platform centre, which is filled; 0 leaves its hole.

    Returns `ax`, or new axes.
    """
    ax = ax or new_axes()
    factor, norm = factor or exaggeration({"": fields}), norm or stress_scale({"": fields})
    moved = fields.nodes + factor * fields.displacement
    loops = loops_of(edges_of(fields.triangles).boundary)
    at_rest = LineCollection([polygon(fields.nodes, loop) for loop in loops], colors="#8A8A8A", linewidths=0.9)
    outline = LineCollection([polygon(moved, loop) for loop in loops], colors=INK, linewidths=0.5, zorder=3)
    hubs = [polygon(moved, loop) for loop in loops if _around_origin(polygon(fields.nodes, loop), hub_radius)]
    hub = PolyCollection(hubs, facecolors="#D0D0D0", edgecolors=INK, linewidths=0.5)
    stress = np.clip(fields.stress, norm.vmin, None)
    grid = Triangulation(moved[:, 0], moved[:, 1], quarters(fields.triangles))
    ax.tripcolor(grid, stress, shading="gouraud", cmap=COLOURS, norm=norm, rasterized=True, zorder=2)
    for collection in (at_rest, outline, hub):
        ax.add_collection(collection, autolim=False)
    both = np.concatenate([fields.nodes, moved])
    low, high, pad = both.min(axis=0), both.max(axis=0), 0.03 * np.ptp(both, axis=0)
    ax.set(xlim=(low[0] - pad[0], high[0] + pad[0]), ylim=(low[1] - pad[1], high[1] + pad[1]))
    ax.set_aspect("equal", anchor="N")  # else a layout engine sees room above the stage that its title does not have
    ax.set_axis_off()
    return ax


def _around_origin(points: Array, hub_radius: float) -> bool:
    return bool(np.hypot(*points.T).max() < 1.01 * hub_radius)


def _name_largest(axes: Axes, model: CurveModels, fields: Fields, factor: float) -> None:
    """Point at the largest stress and write value and place below the stage."""
    moved = fields.nodes + factor * fields.displacement
    size = float(np.ptp(np.concatenate([fields.nodes, moved]), axis=0).max())
    node, place = largest_stress(model, fields)
    text = f"largest {significant(float(fields.stress[node]), 3)} {STRESS} at {place}"
    axes.text(0.5, -0.03, text, transform=axes.transAxes, ha="center", va="center", size=9.5)
    spot = clear_spot(moved[node], 0.09 * size, np.concatenate([moved[::4], fields.nodes[::4]]), 0.05 * size)
    arrow = {"arrowstyle": "-|>", "color": "#B00000", "linewidth": 1.2, "shrinkA": 2.0, "shrinkB": 4.0}
    axes.annotate(
        "max",
        (float(moved[node, 0]), float(moved[node, 1])),
        (float(spot[0]), float(spot[1])),
        size=9,
        weight="bold",
        color="#B00000",
        ha="center",
        va="center",
        arrowprops=arrow,
        zorder=6,
    )
    axes.plot(*moved[node], "o", markersize=6, markerfacecolor="none", markeredgecolor="#B00000", zorder=6)


def draw_scale(figure: Figure, norm: LogNorm) -> None:
    """Colour bar below the panels."""
    place: Any = {"ax": figure.axes, "location": "bottom", "aspect": 38, "shrink": 6.0 / figure.get_figwidth()}
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), extend="min", **place)
    ticks = [10.0**power for power in range(-15, 12)]
    bar.set_ticks([tick for tick in ticks if 0.0 <= norm(tick) <= 1.0])
    bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    bar.ax.xaxis.set_minor_formatter(NullFormatter())
    bar.set_label(f"von Mises stress ({STRESS})")
