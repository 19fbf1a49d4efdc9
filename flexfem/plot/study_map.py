"""A value over two factors of a study, with contours, and where there is no design."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import CenteredNorm, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, MaxNLocator

from flexfem.arrays import AnyArray, Array, wide
from flexfem.plot.study_labels import Caption, Quantity, ends_of, log_ticks, name_axis, thousands
from flexfem.plot.style import GREY, INK, NOTE_COLOUR, in_house_style, inches, panels

WIDTH, HEIGHT = 8.27, 6.0  # in
BELOW = 0.56  # in, from the axes to the legend
ONE_HUE, TWO_HUES = "viridis", "PuOr_r"  # the first alone reads in grey; the contours' labels say the rest
HATCHES = ("////", "xxxx", "....", "||||", "----")
HATCHED = "#A8A8A8"
DOTS = 5000  # more are rasterised in a PDF


class StudyMap(NamedTuple):
    """What the figure shows.

    x, y, value : what the axes and the colours are.
    points : (n, 2), factors x and y of every design, in file units.
    values : (n,), nan without an answer.   missing : which designs, bool (n,), have none, by why.
    grid : whether the points are all pairs of the values of x and y.
    marks : contours that matter, drawn heavier.   base : x and y of the base stage.
    """

    caption: Caption
    x: Quantity
    y: Quantity
    value: Quantity
    points: Array
    values: Array
    missing: Mapping[str, AnyArray]
    grid: bool
    marks: tuple[float, ...] = ()
    base: tuple[float, float] | None = None


@in_house_style
def map_figure(shown: StudyMap) -> Figure:
    """Draw a map on a page of its own."""
    title, lines, *doubts = shown.caption
    figure, (axes,) = panels((WIDTH, HEIGHT), title, lines, 1, doubts=doubts)
    plot_map(axes, shown)
    return figure


def plot_map(ax: Axes, shown: StudyMap) -> Axes:
    """Draw a value as colours over two factors: cells with labelled contours for a grid, else a dot per design.

    Returns `ax`; the bar that says what the colours mean is an inset of it.

    Notes
    -----
    A cell is one design, with its value, or a mean of several, as the caption says; nothing is interpolated but the
    contours. Values of both signs have two hues, and the contours of negative values are dashed.
    """
    norm = norm_of(shown.values)
    hues = TWO_HUES if isinstance(norm, CenteredNorm) else ONE_HUE
    colours: dict[str, Any] = {"norm": norm, "cmap": hues}
    entries = _draw_grid(ax, shown, colours) if shown.grid else _draw_dots(ax, shown, colours)
    _set_axes(ax, shown)
    entries += _draw_base(ax, shown)
    if np.isfinite(shown.values).any():
        _draw_bar(ax.inset_axes((1.035, 0.0, 0.04, 1.0)), ax.collections[0], shown)
    if entries:
        place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.0, -BELOW / inches(ax)[1])}
        ax.legend(handles=entries, **place, borderaxespad=0.0, frameon=False, ncols=3, handlelength=2.4)
    return ax


def norm_of(values: Array) -> Normalize:
    """How values become colours: symmetric about zero for both signs, logarithmic for a wide range, else linear."""
    found = values[np.isfinite(values)]
    low, high = (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)
    if low < 0 < high:
        return CenteredNorm(0.0, max(-low, high))
    if len(found) and wide(found):
        return LogNorm(low, high)
    return Normalize(low, high)


def edges(ticks: Array, log: bool) -> Array:
    """Borders (n + 1,) of the cells about the values (n,) of a factor: half way between neighbours."""
    places = np.log(ticks) if log else ticks
    if len(places) == 1:
        half = 0.05 if log else 0.05 * (abs(float(places[0])) or 1.0)
        ends = np.array([places[0] - half, places[0] + half])
    else:
        middle = (places[1:] + places[:-1]) / 2
        ends = np.concatenate([[2 * places[0] - middle[0]], middle, [2 * places[-1] - middle[-1]]])
    return np.asarray(np.exp(ends) if log else ends)


def _draw_grid(axes: Axes, shown: StudyMap, colours: dict[str, Any]) -> list[Any]:
    (xs, column), (ys, row) = (np.unique(shown.points[:, k], return_inverse=True) for k in (0, 1))
    across, up = edges(xs, shown.x.log), edges(ys, shown.y.log)
    cells = np.full((len(ys), len(xs)), np.nan)
    cells[row, column] = shown.values
    axes.pcolormesh(across, up, np.ma.masked_invalid(cells), **colours, rasterized=True, zorder=1)
    entries = []
    for hatch, (why, which) in zip(HATCHES, shown.missing.items(), strict=False):
        boxes = [
            [(across[i], up[j]), (across[i + 1], up[j]), (across[i + 1], up[j + 1]), (across[i], up[j + 1])]
            for i, j in zip(column[which], row[which], strict=True)
        ]
        look: dict[str, Any] = {"facecolor": "white", "edgecolor": HATCHED, "linewidth": 0.0, "hatch": hatch}
        axes.add_collection(PolyCollection(boxes, **look, zorder=1.5), autolim=False)
        entries.append(Patch(**look, label=f"{why}: {thousands(int(np.sum(which)))}"))
    if min(cells.shape) > 1 and np.isfinite(cells).sum() > 3:
        entries += draw_contours(
            axes,
            (xs, ys, np.ma.masked_invalid(cells)),
            colours["norm"],
            shown.marks,
            shown.value.after if shown.value.unit == "%" else "",
        )
    return entries


def _draw_dots(axes: Axes, shown: StudyMap, colours: dict[str, Any]) -> list[Any]:
    known = np.isfinite(shown.values)
    many = len(shown.values) > DOTS
    size = float(np.clip(4e4 / max(len(shown.values), 1), 1.5, 30.0))
    look: dict[str, Any] = {"s": size, "linewidths": 0, "rasterized": many, "zorder": 2}
    axes.scatter(shown.points[known, 0], shown.points[known, 1], c=shown.values[known], **look, **colours)
    entries = []
    for mark, (why, which) in zip("x+123", shown.missing.items(), strict=False):
        at = shown.points[which].T
        axes.plot(*at, mark, color=GREY, markersize=3.5, markeredgewidth=0.6, rasterized=many, zorder=1)
        entries.append(
            Line2D([], [], color=GREY, linestyle="none", marker=mark, label=f"{why}: {thousands(len(at[0]))}")
        )
    return entries


def _set_axes(axes: Axes, shown: StudyMap) -> None:
    names: tuple[Literal["x", "y"], Literal["x", "y"]] = ("x", "y")
    for which, quantity, values in zip(names, (shown.x, shown.y), shown.points.T, strict=True):
        ends = edges(np.unique(values), quantity.log)[[0, -1]] if shown.grid else ends_of(values, quantity.log)
        name_axis(axes, which, quantity, (float(ends[0]), float(ends[1])))


def _draw_bar(axes: Axes, drawn: Any, shown: StudyMap) -> None:
    """What the colours mean, with the contours that matter."""
    bar = axes.figure.colorbar(drawn, cax=axes)
    bar.set_label(shown.value.label, parse_math=bool(shown.value.symbol))
    low, high = axes.get_ylim()
    if isinstance(drawn.norm, LogNorm):
        log_ticks(axes.yaxis, (low, high))
    for mark in shown.marks:
        if low < mark < high:
            axes.axhline(mark, color=INK, linewidth=2.2)


def _draw_base(axes: Axes, shown: StudyMap) -> list[Any]:
    """A cross where the base stage is, if that is on the map; returns its entry in the legend."""
    if shown.base is None:
        return []
    limits = zip(shown.base, (axes.get_xlim(), axes.get_ylim()), strict=True)
    if not all(low <= value <= high for value, (low, high) in limits):
        return []
    axes.plot(*shown.base, "+", color="white", markersize=15, markeredgewidth=4.5, zorder=5)
    look: dict[str, Any] = {"color": NOTE_COLOUR, "marker": "+", "markersize": 13, "markeredgewidth": 2.2}
    axes.plot(*shown.base, linestyle="none", zorder=6, **look)
    return [Line2D([], [], linestyle="none", label="base stage", **look)]


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
