"""Contours of a map of a study, labelled where they are long enough."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, MaxNLocator

from flexfem.arrays import Array
from flexfem.plot.style import INK

LINES = 8  # contours, about
LONG = 0.4  # of the side of the map: shorter contours have no label


def draw_contours(
    axes: Axes, grid: tuple[Array, Array, Any], norm: Normalize, marks: tuple[float, ...], unit: str
) -> list[Any]:
    """Draw labelled contours of values on a grid (x, y, masked values), the marks heavier; returns their legend entry.

    Labels have the `unit` after the number; contours that are too short for one have none.
    """
    low, high = float(grid[2].min()), float(grid[2].max())
    heavy = np.array([mark for mark in sorted(marks) if low < mark < high])
    thin = levels(norm, marks)
    for where, width in ((thin[(thin > low) & (thin < high)], 0.7), (heavy, 2.2)):
        if len(where):
            drawn = axes.contour(*grid, levels=where, colors=INK, linewidths=width, zorder=3)
            named = [
                level
                for level, path in zip(where, drawn.get_paths(), strict=True)
                if where is heavy or length_of(axes, path) > LONG
            ]
            names = axes.clabel(drawn, levels=named, fontsize=8.5, fmt=lambda value: shortest(value) + unit)
            for name in names:
                name.set_bbox({"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.8})
    if not len(heavy):
        return []
    said = " and ".join(f"{mark:g}{unit}" for mark in heavy)
    return [Line2D([], [], color=INK, linewidth=2.2, label=f"contours of {said}")]


def levels(norm: Normalize, marks: tuple[float, ...]) -> Array:
    """Round values for thin contours between the ends of the colours, none of them a mark."""
    locator = LogLocator(subs=(1.0, 2.0, 5.0)) if isinstance(norm, LogNorm) else MaxNLocator(LINES)
    assert norm.vmin is not None and norm.vmax is not None
    found = np.asarray(locator.tick_values(norm.vmin, norm.vmax))
    inside = (found > norm.vmin) & (found < norm.vmax)
    return np.setdiff1d(found[inside], marks)


def shortest(value: float) -> str:
    """A round number in as few digits as it has."""
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def length_of(axes: Axes, path: Path) -> float:
    """Length of a path of one or more lines, in parts of the side of the axes."""
    lines = path.transformed(axes.transData + axes.transAxes.inverted()).to_polygons(closed_only=False)
    return float(sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in lines))
