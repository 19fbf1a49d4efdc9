"""Stress of the metal at commands of the platform, side by side; what pages draw beside their numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.mechanism.stage import HINGE_NAMES
from flexfem.plot.displacement import PANEL, SCALE, draw_scale, exaggeration, panel_height, plot_displacement
from flexfem.plot.displacement import stress_scale as scale_of
from flexfem.plot.style import in_house_style, panels
from flexfem.plot.text import significant
from flexfem.plot.vector import Spot
from flexfem.units import STRESS
from flexfem.verify.result import Fields


class CommandedStage(NamedTuple):
    """A stage at a command: what is said of it, fields, and the highest stress at each neck (3 chains, 3 hinges)."""

    said: str
    fields: Fields
    neck_stress: Array


@in_house_style
def commanded_figure(
    title: str, found: list[CommandedStage], hub_radius: float, doubts: tuple[list[str], ...]
) -> Figure:
    """Draw the stage at every command, one exaggeration and one scale of stress; mm, MPa."""
    fields = {each.said: each.fields for each in found}
    factor, norm = exaggeration(fields), scale_of(fields)
    lines = [f"Displacements × {significant(factor, 1)}; grey: at rest. Colour: von Mises stress, logarithmic scale."]
    size = (len(found) * PANEL + 0.3, panel_height(fields) + SCALE)
    figure, axes = panels(size, title, lines, 1, len(found), doubts)
    for ax, each in zip(axes, found, strict=True):
        plot_displacement(ax, each.fields, factor=factor, norm=norm, hub_radius=hub_radius)
        ax.set_title(each.said, size=11)
    draw_scale(figure, norm)
    return figure


def neck_spots(figure: Figure, found: list[CommandedStage], centres: Array, size: float) -> list[Spot]:
    """Spots on the necks of a `commanded_figure` that tell the stress there.

    centres : (3 chains, 3 hinges, 2), mm, at rest.   size : mm, of a spot.
    """
    factor, spots = exaggeration({each.said: each.fields for each in found}), []
    for ax, each in zip(figure.axes, found, strict=False):
        for chain, position in np.ndindex(3, 3):
            at = centres[chain, position]
            node = int(np.argmin(np.hypot(*(each.fields.nodes - at).T)))
            x, y = (at + factor * each.fields.displacement[node]).tolist()
            stress = significant(float(each.neck_stress[chain, position]), 4)
            text = f"{HINGE_NAMES[position]} hinge, chain {chain + 1}\n{stress} {STRESS}"
            spots.append(Spot(ax, x, y, text, size, size))
    return spots
