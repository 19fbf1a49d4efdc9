"""The stage on its warm frame, displacements exaggerated, coloured by von Mises stress: per kelvin and per K/mm."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from flexfem.plot.curves import NAMES
from flexfem.plot.displacement import COLOURS, exaggeration, plot_displacement, stress_scale
from flexfem.plot.marks import drawn_edges
from flexfem.plot.style import INK, in_house_style, new_axes, panels
from flexfem.plot.text import significant
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, EXPANSION, STRESS, unit_for
from flexfem.verify.drift import CASES, Case, DriftFields, WarmStage

PANEL, BELOW = 4.4, 1.25  # in, width of a panel; title and scale of stress
ROUND_OFF = 1e-9  # of the largest component of a pose: zero by symmetry
PER: dict[Case, str] = {"uniform": "K", "gradient in x": "K/mm", "gradient in y": "K/mm"}
SAID: dict[Case, str] = {
    "uniform": "1 K everywhere",
    "gradient in x": "1 K/mm along X",
    "gradient in y": "1 K/mm along Y",
}
WARMER = {"gradient in x": (0.1, 0.0), "gradient in y": (0.0, 0.1)}  # arrows, per size of the axes
CORNER = (0.02, 0.86)  # where they start


@in_house_style
def drift_figure(found: DriftFields) -> Figure:
    """Draw the three cases, each with its own exaggeration and scale of stress."""
    of = found.record
    height = PANEL * float(np.divide(*np.ptp(found.fields["uniform"].nodes, axis=0)[::-1]))
    lines = [
        f"Expansion {significant(EXPANSION.factor * of.expansion)} {EXPANSION}, frame "
        f"{significant(EXPANSION.factor * of.frame_expansion)} {EXPANSION}; both have the same temperature at every "
        "place, gradients are about the platform's centre. Plane finite elements; grey: at rest; bars: clamped edges, "
        "which the frame carries along. Stress at the corners of these grows with finer meshes; titles: at the necks."
    ]
    size = (3 * PANEL + 0.3, height + BELOW)
    figure, axes = panels(size, f"{of.name}: warm", lines, 1, 3, (of.assumed, of.not_stated))
    for letter, ax, name in zip("abc", axes, CASES, strict=True):
        plot_drift(ax, found, name)
        elements = of.cases[name].elements
        assert elements is not None
        factor = significant(exaggeration({"": found.fields[name]}), 1)
        title = f"({letter}) {SAID[name]}, displacements × {factor}\n{_pose(elements, of.lever)}; "
        title += f"necks to {significant(float(np.max(elements.stress)), 3)} {STRESS}"
        ax.set_title(title, size=9.5, loc="left")
        _draw_scale(figure, ax, found, name)
    return figure


def plot_drift(ax: Axes | None, found: DriftFields, case: Case) -> Axes:
    """Draw a stage displaced by 1 K or 1 K/mm, coloured by von Mises stress; returns `ax`, or new axes.

    Raises BadInput for another case, or without finite elements.
    """
    if case not in found.fields:
        known = ", ".join(found.fields) or "those of finite elements, which were left out"
        raise BadInput(f"case {case!r}, expected {known}")
    ax, fields = ax or new_axes(), found.fields[case]
    plot_displacement(ax, fields, hub_radius=found.hub_radius)
    moved = fields.nodes + exaggeration({"": fields}) * fields.displacement
    clamped = LineCollection(drawn_edges(moved, found.ground, 6), colors=INK, linewidths=3.0, zorder=4)
    ax.add_collection(clamped, autolim=False)
    if case in WARMER:
        (x, y), (left, low) = WARMER[case], CORNER
        arrow = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", (left + x, low + y), CORNER, xycoords="axes fraction", arrowprops=arrow)
        ax.text(left + x + 0.02, low + y / 2, "warmer", transform=ax.transAxes, va="center", size=8.5)
    return ax


def _pose(of: WarmStage, lever: float) -> str:
    """A pose with prefixes, round-off as zero."""
    sizes = np.abs(of.pose) * [1.0, 1.0, lever]
    cells = []
    for axis, value, size in zip(DIRECTIONS, of.pose, sizes, strict=True):
        unit = unit_for(axis, abs(value))
        text = f"{significant(unit.factor * value)} {unit}" if size > ROUND_OFF * np.max(sizes) else "0"
        cells.append(f"{NAMES[axis]} {text}")
    return ", ".join(cells)


def _draw_scale(figure: Figure, ax: Axes, found: DriftFields, case: Case) -> None:
    norm = stress_scale({"": found.fields[case]})
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=ax, location="bottom", extend="min", aspect=30, shrink=0.9)
    bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    bar.ax.xaxis.set_minor_formatter(NullFormatter())
    bar.set_label(f"von Mises stress ({STRESS} per {PER[case]})")
