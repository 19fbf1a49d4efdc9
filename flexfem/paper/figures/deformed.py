"""The deformed stage of a stored verification, with its largest stress."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.paper.verification import CurveModels, Verification
from flexfem.plot.drawing import arrow
from flexfem.plot.fields import displaced
from flexfem.plot.style import NAMES, NOTE_COLOUR, in_house_style
from flexfem.plot.text import significant
from flexfem.results import Fields
from flexfem.units import STRESS, unit_for

# relative difference of stresses equal by symmetry: above round-off, below mesh noise
EQUAL_STRESS = 1e-6


@in_house_style
def deformed_figure(result: Verification, fields: Mapping[str, Fields]) -> Figure:
    """Draw the deformed stage of every curve at full command, with its largest von Mises stress."""
    command = unit_for(result.direction, result.commanded[-1])
    value = significant(result.commanded[-1] * command.factor, 3)
    title = f"Stress in the displaced stage, {NAMES[result.direction]} = {value} {command}"
    lines = [f"{result.name}: finite elements at the largest command, displacements"]
    if result.elements == "three_dimensional":
        lines.append(
            "Three dimensions: the mid-plane, with the highest stress through the thickness."
        )
    columns = len(fields) if len(fields) < 4 else int(np.ceil(np.sqrt(len(fields))))
    drawn = {label: fields[label] for label in result.curves}
    page = displaced(title, lines, drawn, max(2, columns), result)
    for ax, (label, field) in zip(page.axes, drawn.items(), strict=True):
        moved = field.nodes + page.factor * field.displacement
        _mark_largest(ax, result.models[label], field, moved)
    return page.figure


def _mark_largest(
    ax: Axes,
    model: CurveModels,
    field: Fields,
    moved: Array,
) -> None:
    """Mark the node of the largest stress, and write the stress below the panel."""
    node, hinge = largest_stress(model, field)
    text = f"largest {significant(float(field.stress[node]), 3)} {STRESS} near {hinge}"
    ax.text(
        0.5,
        -0.03,
        text,
        transform=ax.transAxes,
        ha="center",
        va="center",
        size=9.5,
    )
    at = moved[node]
    outwards = 0.12 * np.ptp(moved) * at / np.linalg.norm(at)
    arrow(
        ax,
        at + outwards,
        at,
        colour=NOTE_COLOUR,
        width=1.6,
        shrinkB=4.0,
    )
    ring: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": NOTE_COLOUR}
    ax.plot(*at, "o", markersize=6, zorder=6, **ring)


class Highest(NamedTuple):
    """The node of the largest stress, and the name of the hinge nearest to it."""

    node: int
    hinge: str


def largest_stress(model: CurveModels, fields: Fields) -> Highest:
    """Return where the stress is largest; of equal stresses, the one at the first hinge."""
    nodes = np.flatnonzero(fields.stress >= fields.stress.max() * (1 - EQUAL_STRESS))
    centres = np.array([hinge.centre for hinge in model.hinges])
    nearest = np.linalg.norm(fields.nodes[nodes, None] - centres, axis=2).argmin(axis=1)
    number = int(nearest.min())
    hinge = model.hinges[number]
    name = f"hinge {number + 1} ({hinge.hinge}, chain {hinge.chain})"
    return Highest(int(nodes[nearest.argmin()]), name)
