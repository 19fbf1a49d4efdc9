"""A Pareto front, and below it drawings of designs and the table of their numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.mechanism.mechanism import Mechanism
from flexfem.plot import style
from flexfem.plot.drawing import fit_to_one_scale
from flexfem.plot.plate import draw_plate
from flexfem.plot.style import below_header
from flexfem.study.records import Caption

WIDTH = 8.27  # in
COLUMNS = 4  # drawings per row
FRONT_HEIGHT = 5.0  # in
CELL_HEIGHT = 1.5  # in, of a row of drawings
NAME_WIDTH = 0.75  # in, of the first column of the table


def front_page(
    caption: Caption,
    plane: Callable[[Axes], object],
    designs: Sequence[Mechanism],
    rows: list[list[str]],
) -> Figure:
    """Draw a front and, below it, designs to one scale and the table of their numbers.

    Parameters
    ----------
    caption : title and lines of the header.
    plane : draws the front on axes.
    designs : may be none; then there is no table either.
    rows : of the table, its head first; the first column names the designs.
    """
    numbers = len(rows[0]) - 1
    widths = [NAME_WIDTH, *[(WIDTH - 0.6 - NAME_WIDTH) / max(numbers, 1)] * numbers]
    heights = [FRONT_HEIGHT]
    mosaic: list[Any] = [["front"] * COLUMNS]
    if designs:
        lines = -(-len(designs) // COLUMNS)
        mosaic += [_cells(line, len(designs)) for line in range(lines)]
        mosaic.append(["table"] * COLUMNS)
        heights += [*[CELL_HEIGHT] * lines, sum(style.fitted(rows, widths)[1])]
    figure = below_header((WIDTH, sum(heights) + 0.3), caption.title, caption.lines, caption)
    axes: dict[Any, Axes] = figure.subplot_mosaic(mosaic, height_ratios=heights)
    plane(axes["front"])
    if not designs:
        return figure
    drawings = [axes[f"{k}"] for k in range(len(designs))]
    outlines = list(map(draw_plate, drawings, designs))
    for ax, (name, *_) in zip(drawings, rows[1:], strict=True):
        ax.set_title(name, weight="bold")
        ax.set_axis_off()
    fit_to_one_scale(drawings, np.vstack(outlines))
    style.table(axes["table"], rows, widths)
    return figure


def _cells(line: int, count: int) -> list[str]:
    """Return the names of the drawings in a line of the mosaic, "." for an empty cell."""
    numbers = range(COLUMNS * line, COLUMNS * (line + 1))
    return [f"{k}" if k < count else "." for k in numbers]
