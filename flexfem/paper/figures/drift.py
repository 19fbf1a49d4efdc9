"""The stage displaced by heating: by 1 K everywhere, and by gradients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.paper.drift import Drift, WarmFields
from flexfem.plot.drawing import fit
from flexfem.plot.fields import (
    ROUND_OFF,
    draw_scale,
    exaggeration,
    plot_displacement,
    stress_scale,
)
from flexfem.plot.mesh import draw_boundary
from flexfem.plot.style import INK, NAMES, in_house_style, panels, titled
from flexfem.plot.text import significant
from flexfem.questions.heat import CASES
from flexfem.refused import BadInput, printed
from flexfem.results import ELEMENTS
from flexfem.units import DIRECTIONS, MICROMETRE, STRESS, unit_for


class Heating(NamedTuple):
    """How a case is drawn: its title, the divisor of the stress unit, and an arrow to the warm
    side.

    The arrow is in fractions of the axes.
    """

    title: str
    per: str
    arrow: tuple[float, float] = (0.0, 0.0)


HEATINGS = {
    "uniform": Heating("1 K everywhere", "K"),
    "gradient in x": Heating("1 K/mm along x", "K/mm", (0.1, 0.0)),
    "gradient in y": Heating("1 K/mm along y", "K/mm", (0.0, 0.1)),
}


@in_house_style
def drift_figure(found: Drift) -> Figure:
    """Draw the three cases, each with its own exaggeration and stress scale."""
    about = found.about
    fields = _warm(found).cases
    settings = found.settings
    expansion = f"{settings['expansion']}, of the frame {settings['frame']}"
    lines = [
        "Plane finite elements. Expansion of the stage "
        f"{expansion.replace('um/', f'{MICROMETRE}/')}. Gradients are zero at the platform centre. "
        "Grey: at rest. Heavy lines: clamped edges, which move with the frame."
    ]
    title = f"{about.name}: displacement and stress by heating"
    figure, axes = panels((12.0, 5.0), title, lines, 1, 3, about)
    factors = {name: exaggeration(each) for name, each in fields.items()}
    moved = [each.nodes + factors[name] * each.displacement for name, each in fields.items()]
    for letter, ax, name in zip("abc", axes, CASES, strict=True):
        fit(plot_drift(ax, found, name), np.concatenate(moved), 0.03)
        times = significant(factors[name], 1)
        titled(ax, letter, f"{HEATINGS[name].title}, displacements × {times}")
        place = {"aspect": 30, "shrink": 0.9, "extend": "min"}
        draw_scale(figure, ax, stress_scale(fields[name]), _scale_label(found, name), **place)
    return figure


def _scale_label(found: Drift, case: str) -> str:
    """Return the label of the stress scale of a case, with its pose and its highest stress."""
    pose = _pose(found.at("pose", case=case, model=ELEMENTS), found.about.lever)
    highest = float(np.max(found.at("stress", case=case, model=ELEMENTS)))
    return (
        f"von Mises stress ({STRESS} per {HEATINGS[case].per})\n\nplatform: {pose}\n"
        f"necks: up to {significant(highest, 3)} {STRESS}"
    )


def _warm(found: Drift) -> WarmFields:
    """Return the plane fields of a result. Raises BadInput when it has none."""
    if not isinstance(found.fields, WarmFields):
        raise BadInput("a drift without plane finite elements, expected a result with them")
    return found.fields


def plot_drift(
    ax: Axes | None,
    found: Drift,
    case: str,
) -> Axes:
    """Draw a stage displaced by 1 K or 1 K/mm, coloured by von Mises stress.

    Returns `ax`, or new axes. Raises BadInput for an unknown case, or a result without finite
    elements.
    """
    warm = _warm(found)
    if case not in warm.cases:
        raise BadInput(f"case {printed(case)}, expected one of: {', '.join(warm.cases)}")
    fields = warm.cases[case]
    factor = exaggeration(fields)
    ax = plot_displacement(ax, fields, factor=factor)
    moved = fields.nodes + factor * fields.displacement
    draw_boundary(ax, moved, warm.ground, INK, 3.0, zorder=4)
    x, y = HEATINGS[case].arrow
    if x or y:
        look = {
            "arrowstyle": "-|>",
            "color": INK,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        tip = (0.02 + x, 0.86 + y)
        ax.annotate("", tip, (0.02, 0.86), xycoords="axes fraction", arrowprops=look)
        ax.text(
            0.04 + x,
            0.86 + y / 2,
            "warmer",
            transform=ax.transAxes,
            va="center",
            size=8.5,
        )
    return ax


def _pose(pose: Array, lever: float) -> str:
    """Return a pose with unit prefixes and zeros in place of round-off."""
    sizes = np.abs(pose) * [1.0, 1.0, lever]
    cells = list[str]()
    for axis, value, size in zip(DIRECTIONS, pose, sizes, strict=True):
        unit = unit_for(axis, abs(value))
        is_known = size > ROUND_OFF * np.max(sizes)
        shown = f"{significant(unit.factor * value)} {unit}" if is_known else "0"
        cells.append(f"{NAMES[axis]} {shown}")
    return ", ".join(cells)
