"""How the quantities of a design follow its dimensions."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.files.refusals import shown
from flexfem.plot.style import COLOURS, GREY, INK, in_house_style, new_axes, panels, wrapped
from flexfem.plot.text import significant
from flexfem.refused import BadInput
from flexfem.synthesis.result import Designed, Goal, Requirement, Stated

ACROSS = 4  # panels beside each other
WIDTH, LABELS, ROW = 2.9, 2.2, 0.34  # in, of a panel, of the dimensions' names, of a bar
LETTERS = 8.5  # points
ROOM = 1.55  # of the longest bar, for its number
SAID = (
    "Change of each quantity in per cent for 1 % more of one dimension, the others kept: logarithmic derivatives of "
    "the corrected model at the design, by central differences, or one-sided ones where only one side can be made; "
    "steps of a shop are left aside."
)


@in_house_style
def sensitivity_figure(found: Designed) -> Figure:
    """Draw how objectives and active requirements follow each dimension."""
    asked = found.decisive
    across = min(ACROSS, len(asked))
    rows = -(-len(asked) // across)
    size = (LABELS + WIDTH * across, rows * (ROW * len(found.design) + 1.15))
    doubts = (found.assumed, found.not_stated)
    figure, axes = panels(size, f"{found.name}: sensitivity to each dimension", [SAID], rows, across, doubts)
    reach = _reach(found, asked)
    for place, ax in enumerate(axes):
        if place >= len(asked):
            ax.remove()
            continue
        plot_sensitivity(ax, found, asked[place].name)
        ax.set(xlim=(-reach, reach))
        ax.set_title(wrapped(_title(asked[place]), WIDTH - 0.2, 9.5), loc="left", size=9.5)
        if place % across:
            ax.set_yticklabels([])
    return figure


def _title(of: Stated) -> str:
    if isinstance(of, Goal):
        return f"{of.label}, the {of.better} the better"
    assert isinstance(of, Requirement)
    return f"{of.label}, " + " and ".join(f"{end} {of.unit}".rstrip() for end in of.wanted)


def _reach(found: Designed, asked: list[Stated]) -> float:
    """How far an axis goes that has room for all bars of some quantities."""
    known = [abs(row[of.name] or 0.0) for row in found.sensitivities.values() for of in asked]
    return ROOM * max(known, default=0.0) or 1.0


def plot_sensitivity(ax: Axes | None, found: Designed, name: str | None = None) -> Axes:
    """Draw by how many per cent a quantity changes for 1 % of each dimension; returns `ax`, or new axes.

    name : of the quantity as the requirements file has it, by default the first objective.
    Raises BadInput when the design has no such quantity.
    """
    every = [each.name for each in (*found.objectives, *found.requirements)]
    name = every[0] if name is None else name
    if name not in every:
        raise BadInput(f"quantity {shown(name)}, expected one of {', '.join(every)}")
    ax = new_axes() if ax is None else ax
    values = [found.sensitivities[dimension][name] for dimension in found.design]
    places = np.arange(len(values))
    lengths = np.array([0.0 if value is None else value for value in values])
    ax.barh(places, lengths, height=0.62, color=COLOURS[0])
    reach = ROOM * float(np.max(np.abs(lengths), initial=0.0)) or 1.0
    for place, value in zip(places, values, strict=True):
        said = "not known" if value is None else ("+" if value > 0 else "") + significant(value, 2)
        before = (value or 0.0) < 0
        ax.annotate(
            said, (value or 0.0, place), xytext=(-4 if before else 4, 0), textcoords="offset points",
            ha="right" if before else "left", va="center", size=LETTERS, color=INK,
        )  # fmt: skip
    ax.set_yticks(places, [wrapped(key, LABELS - 0.2, LETTERS) for key in found.design], size=LETTERS)
    ax.set_ylim(len(values) - 0.5, -0.5)
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.set(xlim=(-reach, reach), xlabel="change (%) for 1 %")
    ax.set_axisbelow(True)
    ax.grid(axis="x")
    return ax
