"""The outline of a stage that nobody has meshed: its bodies and its hub, drawn to scale."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Circle

from flexfem.arrays import Array
from flexfem.plot.style import INK, PALE
from flexfem.stage.bodies import draw_sector, turn
from flexfem.stage.outline import Segment, polygon_points
from flexfem.stage.schema import CHAINS, Stage

STEP = np.pi / 24  # rad of arc between two points of a small drawing


class Outline(NamedTuple):
    """A stage to draw: filled `bodies` (n, 2), their `rims` and `grounds` (n, 2) as lines, mm, and `hub`, a radius."""

    bodies: list[Array]
    rims: list[Array]
    grounds: list[Array]
    hub: float


def outline_of(stage: Stage) -> Outline:
    """The stage's outline. Raises BadInput when its bodies cannot be drawn."""
    outline = Outline([], [], [], stage.platform.hub_radius)
    for chain in CHAINS:
        for face in draw_sector(stage, chain).values():
            loop = turn(face.loop, chain)
            outline.bodies.append(np.asarray(polygon_points(loop, STEP)))
            for segment, label in zip(loop, face.labels, strict=True):
                lines = {"free": outline.rims, "ground": outline.grounds}.get(label)
                if lines is not None:
                    lines.append(_points(segment))
    return outline


def draw_outline(axes: Axes, outline: Outline, at: tuple[float, float] = (0.0, 0.0)) -> None:
    """Draw an outline with the platform centre at a place, in mm; its grounds heavy, its hub as a disc."""
    place = np.array(at)
    fill = PolyCollection(
        [body + place for body in outline.bodies], facecolors=PALE, edgecolors=PALE, linewidths=0.4, zorder=1
    )
    rims = LineCollection([line + place for line in outline.rims], colors=INK, linewidths=0.7, zorder=2)
    grounds = LineCollection([line + place for line in outline.grounds], colors=INK, linewidths=2.4, zorder=3)
    for collection in (fill, rims, grounds):
        axes.add_collection(collection, autolim=False)
    axes.add_patch(Circle(at, outline.hub, facecolor="#C9CED6", edgecolor=INK, linewidth=0.6, zorder=2.5))


def _points(segment: Segment) -> Array:
    z = np.append(segment.points(STEP), segment.end)
    return np.column_stack([z.real, z.imag])
