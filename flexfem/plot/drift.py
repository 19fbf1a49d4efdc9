"""The stage on its warm frame, displacements exaggerated, coloured by von Mises stress: per kelvin and per K/mm."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from flexfem.arrays import Array
from flexfem.plot.curves import NAMES
from flexfem.plot.displacement import COLOURS, exaggeration, plot_displacement, stress_scale
from flexfem.plot.marks import drawn_edges
from flexfem.plot.style import INK, in_house_style, new_axes, panels
from flexfem.plot.text import significant
from flexfem.questions.heat import CASES, Drift, WarmFields
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS
from flexfem.units import DIRECTIONS, STRESS, unit_for
from flexfem.verify.result import Fields

PANEL, BELOW = 4.4, 1.25  # in, width of a panel; title and scale of stress
ROUND_OFF = 1e-9  # of the largest component of a pose: zero by symmetry
PER = {"uniform": "K", "gradient in x": "K/mm", "gradient in y": "K/mm"}
SAID = {
    "uniform": "1 K everywhere",
    "gradient in x": "1 K/mm along X",
    "gradient in y": "1 K/mm along Y",
}
WARMER = {"gradient in x": (0.1, 0.0), "gradient in y": (0.0, 0.1)}  # arrows, per size of the axes
CORNER = (0.02, 0.86)  # where they start


@in_house_style
def drift_figure(found: Drift) -> Figure:
    """Draw the three cases, each with its own exaggeration and scale of stress."""
    of, fields = found.about, fields_of(found).cases
    height = PANEL * float(np.divide(*np.ptp(fields["uniform"].nodes, axis=0)[::-1]))
    lines = [
        f"Expansion {found.settings['expansion']}, frame {found.settings['frame']}; both have the same temperature at "
        "every place, gradients are about the platform's centre. Plane finite elements; grey: at rest; bars: clamped "
        "edges, which the frame carries along. Stress at the corners of these grows with finer meshes; titles: at the "
        "necks."
    ]
    size = (3 * PANEL + 0.3, height + BELOW)
    figure, axes = panels(size, f"{of.name}: warm", lines, 1, 3, (of.assumed, of.not_stated))
    for letter, ax, name in zip("abc", axes, CASES, strict=True):
        plot_drift(ax, found, name)
        stress = found.at("stress", case=name, model=ELEMENTS)
        factor = significant(exaggeration({"": fields[name]}), 1)
        pose = _pose(found.at("pose", case=name, model=ELEMENTS), of.lever)
        title = f"({letter}) {SAID[name]}, displacements × {factor}\n{pose}; "
        title += f"necks to {significant(float(np.max(stress)), 3)} {STRESS}"
        ax.set_title(title, size=9.5, loc="left")
        _draw_scale(figure, ax, fields[name], PER[name])
    return figure


def fields_of(found: Drift) -> WarmFields:
    """The plane fields of a result. Raises BadInput when it has none."""
    if not isinstance(found.fields, WarmFields):
        raise BadInput("a drift without plane finite elements, expected them for its figure")
    return found.fields


def plot_drift(ax: Axes | None, found: Drift, case: str) -> Axes:
    """Draw a stage displaced by 1 K or 1 K/mm, coloured by von Mises stress; returns `ax`, or new axes.

    Raises BadInput for another case, or without finite elements.
    """
    warm = fields_of(found)
    if case not in warm.cases:
        raise BadInput(f"case {case!r}, expected one of: {', '.join(warm.cases)}")
    ax, fields = ax or new_axes(), warm.cases[case]
    plot_displacement(ax, fields, hub_radius=warm.hub_radius)
    moved = fields.nodes + exaggeration({"": fields}) * fields.displacement
    clamped = LineCollection(drawn_edges(moved, warm.ground, 6), colors=INK, linewidths=3.0, zorder=4)
    ax.add_collection(clamped, autolim=False)
    if case in WARMER:
        (x, y), (left, low) = WARMER[case], CORNER
        arrow = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", (left + x, low + y), CORNER, xycoords="axes fraction", arrowprops=arrow)
        ax.text(left + x + 0.02, low + y / 2, "warmer", transform=ax.transAxes, va="center", size=8.5)
    return ax


def _pose(pose: Array, lever: float) -> str:
    """A pose with prefixes, round-off as zero."""
    sizes = np.abs(pose) * [1.0, 1.0, lever]
    cells = []
    for axis, value, size in zip(DIRECTIONS, pose, sizes, strict=True):
        unit = unit_for(axis, abs(value))
        text = f"{significant(unit.factor * value)} {unit}" if size > ROUND_OFF * np.max(sizes) else "0"
        cells.append(f"{NAMES[axis]} {text}")
    return ", ".join(cells)


def _draw_scale(figure: Figure, ax: Axes, fields: Fields, per: str) -> None:
    norm = stress_scale({"": fields})
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=ax, location="bottom", extend="min", aspect=30, shrink=0.9)
    bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    bar.ax.xaxis.set_minor_formatter(NullFormatter())
    bar.set_label(f"von Mises stress ({STRESS} per {per})")
