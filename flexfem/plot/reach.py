"""The poses that a drive reaches: their section at theta = 0, and all of them as a solid, with what bounds them.

The solid is seen from afar: parallel lines stay parallel, and rotations are drawn as long as their translation at l3.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

from flexfem.arrays import Array
from flexfem.plot.curves import DASHES, NAMES
from flexfem.plot.marks import write
from flexfem.plot.style import GREY, INK, in_house_style, panels, wrapped
from flexfem.plot.text import significant
from flexfem.questions.reach import KINDS, PoseEdge, Reach
from flexfem.results import ANALYTIC
from flexfem.units import COMMANDS, FORCES, LENGTH, MICROMETRE

WIDTH, HEIGHT = 11.69, 7.6  # in
LISTED = 12  # edges whose limits are written out: the longest ones
TURNED, RAISED = np.deg2rad(-62.0), np.deg2rad(24.0)  # of the eye, from the X axis and from the plane
FILLS = dict(zip(KINDS, ("#E4E8EC", "#9DC3E0", "#C9B458", "#D98A6A"), strict=True))  # of the rarest kind of limit there
HATCHES = dict(zip(KINDS, ("", "////", "\\\\\\\\", "...."), strict=True))
NONE = "no area is reached at θ = 0"
SIGNS = ((", longest", " +"), (", shortest", " \N{MINUS SIGN}"))  # of strokes, in lists of limits


@in_house_style
def reach_figure(found: Reach) -> Figure:
    """Draw the section at theta = 0 with the limits of its edges, and the solid with the limits of its faces."""
    title = f"{found.about.name}: the poses that the drive reaches within all its limits"
    doubts = (found.about.assumed, found.about.not_stated)
    ratios = {"height_ratios": (3.2, 1.0)}
    figure, every = panels((WIDTH, HEIGHT), title, _lines(found), 2, 2, doubts, **ratios)
    plot_section(every[0], found).set_title("(a) at θ = 0", loc="left")
    plot_solid(every[1], found).set_title("(b) all poses, rotations drawn as l₃ θ", loc="left")
    edges = listed(found)
    for axes, part in zip(every[2:], (edges[: (len(edges) + 1) // 2], edges[(len(edges) + 1) // 2 :]), strict=True):
        axes.axis("off")
        text = "\n".join(wrapped(f"{k}  {_said(edge)}", WIDTH / 2 - 0.8, 7.5) for k, edge in part)
        axes.text(0.0, 1.0, text, transform=axes.transAxes, va="top", size=7.5, color=INK, linespacing=1.3)
    return figure


def _lines(found: Reach) -> list[str]:
    load = [f"{significant(v)} {unit}" for v, unit in zip(found.load, FORCES, strict=True)]
    um, model = MICROMETRE, found.settings["analytic model"]
    ranges = ", ".join(f"{NAMES[axis]} {_ends(found, k)}" for k, axis in enumerate(NAMES))
    return [
        f"Limits of stroke, of contacts that only push, of blocking force and of yield at the necks, by {model}; "
        f"{'load ' + ', '.join(load) if np.any(found.load) else 'no load'}; linear. Below, what bounds the edges; "
        "strokes: + the longest, \N{MINUS SIGN} the shortest.",
        f"Ranges with the other two at zero: {ranges}. About rest: a circle of "
        f"{um.factor * float(found.circle):.4g} {um} at θ = 0, and a ball of {um.factor * float(found.ball):.4g} {um} "
        f"with rotations times l₃ = {found.about.lever:g} {LENGTH}.",
    ]


def _ends(found: Reach, axis: int) -> str:
    unit = COMMANDS[axis]
    low, high = (unit.factor * float(each[axis]) for each in found.at("ends", others="zero", model=ANALYTIC))
    if np.isnan(low):
        return "none"
    text = f"{low:z.4g} to {high:z.4g} {unit}"
    return text.replace("-", "\N{MINUS SIGN}")


def listed(found: Reach) -> list[tuple[int, PoseEdge]]:
    """The longest edges of the section, `LISTED` at most, numbered counter-clockwise."""
    long = sorted(found.fields.section, key=_length)[-LISTED:]
    return [(k, edge) for k, edge in enumerate((edge for edge in found.fields.section if edge in long), start=1)]


def _said(edge: PoseEdge) -> str:
    """The limits of an edge, short."""
    text = str(edge.by)
    for word, sign in SIGNS:
        text = text.replace(word, sign)
    return text


def _length(edge: PoseEdge) -> float:
    return float(np.linalg.norm(np.subtract(edge.end, edge.start)))


def plot_section(ax: Axes, found: Reach) -> Axes:
    """Draw the poses at theta = 0, each edge by the kinds of its limits, the longest numbered; returns `ax`."""
    unit = COMMANDS[0]
    ax.set(xlabel=f"X ({unit})", ylabel=f"Y ({unit})", aspect="equal")
    ax.grid()
    ax.plot(*(unit.factor * found.rest[:2]), "+", color=INK, markersize=9.0, label="zero commands")
    if not found.fields.section:
        ax.text(0.5, 0.7, NONE, transform=ax.transAxes, ha="center", va="center", color=INK)
        return ax
    corners = unit.factor * np.array([edge.start for edge in found.fields.section])
    ax.add_patch(Polygon(list(map(tuple, corners)), facecolor=FILLS["stroke"], edgecolor="none", zorder=1))
    shown = _in_order({edge.by.kinds for edge in found.fields.section})
    for index, each in enumerate(shown):
        lines = [unit.factor * np.array([e.start, e.end]) for e in found.fields.section if e.by.kinds == each]
        look: Any = {"linestyles": DASHES[index % len(DASHES)], "colors": INK, "linewidths": 2.2 - 0.3 * (index % 3)}
        ax.add_collection(LineCollection(lines, label=" and ".join(each) or "no limit", zorder=3, **look))
    middle, size = corners.mean(axis=0), np.ptp(corners, axis=0).max()
    for k, edge in listed(found):
        at = unit.factor * np.mean([edge.start, edge.end], axis=0)
        away = (at - middle) / np.linalg.norm(at - middle)
        write(ax, at + 0.05 * size * away, f"{k}", size=8.5)
    if found.circle > 0:
        around = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 181)) * float(found.circle) + complex(*found.rest[:2])
        ax.plot(
            unit.factor * around.real, unit.factor * around.imag, color=GREY, linewidth=0.9, label="circle about rest"
        )
    low, high = corners.min(axis=0), corners.max(axis=0)
    ax.set(xlim=(low[0] - 0.12 * size, high[0] + 0.12 * size), ylim=(low[1] - 0.12 * size, high[1] + 0.34 * size))
    ax.legend(loc="upper center", ncols=2, frameon=False)
    return ax


def _in_order(found: set[tuple[str, ...]]) -> list[tuple[str, ...]]:
    return sorted(found, key=lambda each: [KINDS.index(kind) for kind in reversed(each)])


def plot_solid(ax: Axes, found: Reach) -> Axes:
    """Draw all poses as a solid seen from outside, each face by the kinds of its limits; returns `ax`."""
    ax.set(aspect="equal", xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set_visible(False)
    scale = MICROMETRE.factor * np.array([1.0, 1.0, found.about.lever])
    solid = found.fields.solid
    if not solid.faces:
        ax.text(0.5, 0.7, "the poses are no solid", transform=ax.transAxes, ha="center", va="center", color=INK)
        return ax
    V = scale * solid.vertices
    _box(ax, found, V)
    towards = np.array([np.cos(TURNED) * np.cos(RAISED), np.sin(TURNED) * np.cos(RAISED), np.sin(RAISED)])
    faces = list(zip(solid.faces, solid.by, solid.normals @ towards > 0, strict=True))
    for face in (face for face, _, seen in faces if not seen):
        ends = _seen(V[[*face, face[0]]])
        ax.plot(*ends, color=GREY, linewidth=0.5, linestyle=(0, (2, 3)), zorder=2)
    for each in _in_order({by.kinds for _, by, seen in faces if seen}):
        corners = [_seen(V[list(face)]).T for face, by, seen in faces if seen and by.kinds == each]
        ax.add_collection(PolyCollection(corners, zorder=3, alpha=0.93, **_look(each)))
    handles = [Patch(label=" and ".join(each), **_look(each)) for each in _in_order({by.kinds for by in solid.by})]
    ax.legend(handles=handles, loc="upper center", ncols=2, frameon=False, handleheight=1.4)
    return ax


def _look(of: Sequence[str]) -> dict[str, Any]:
    fill = FILLS[of[-1]] if of else "white"
    return {"facecolor": fill, "edgecolor": INK, "linewidth": 0.9, "hatch": "".join(HATCHES[kind] for kind in of)}


def _seen(points: Array) -> Array:
    """Points (n, 3) as they are seen, (2, n): to the right and up."""
    c, s = np.cos(TURNED), np.sin(TURNED)
    right = np.array([-s, c, 0.0])
    up = np.array([-c * np.sin(RAISED), -s * np.sin(RAISED), np.cos(RAISED)])
    return np.asarray(np.stack([points @ right, points @ up]))


def _box(ax: Axes, found: Reach, V: Array) -> None:
    """The box that holds the poses, with the ends of its sides; the side of each axis that faces the eye, below."""
    low, high = V.min(axis=0), V.max(axis=0)
    size = float(np.max(high - low)) or 1.0
    low, high = low - 0.04 * size, high + 0.04 * size
    corners = np.array(list(product(*zip(low, high, strict=True))))
    for a, b in product(range(8), repeat=2):
        if a < b and np.sum(corners[a] != corners[b]) == 1:
            ax.plot(*_seen(corners[[a, b]]), color=GREY, linewidth=0.4, zorder=1)
    exact = np.array([V.min(axis=0), V.max(axis=0)])
    sides = ([None, low[1], low[2]], [high[0], None, low[2]], [low[0], low[1], None])
    beside: Any = ({"ha": "center", "va": "top"}, {"ha": "left", "va": "top"}, {"ha": "right", "va": "center"})
    for axis, (side, place, unit) in enumerate(zip(sides, beside, COMMANDS, strict=True)):
        turn = unit.factor / (MICROMETRE.factor * (found.about.lever if axis == 2 else 1.0))
        spots = [
            (exact[0, axis], None),
            (exact[1, axis], None),
            (exact[:, axis].mean(), f"{list(NAMES.values())[axis]} ({unit})"),
        ]
        for at, name in spots:
            x, y = _seen(np.array([[at if each is None else each for each in side]]))[:, 0]
            text = name or f"{turn * at:z.3g}".replace("-", "\N{MINUS SIGN}")
            pad = 0.10 * size if name else 0.03 * size
            shift = {0: (-0.3 * pad, -pad), 1: (0.6 * pad, -0.8 * pad), 2: (-pad, 0.0)}[axis]
            ax.text(x + shift[0], y + shift[1], text, size=8.5 if name else 7.5, color=INK, **place)
    seen = _seen(corners)
    ax.set(xlim=(seen[0].min() - 0.25 * size, seen[0].max() + 0.15 * size))
    ax.set(ylim=(seen[1].min() - 0.2 * size, seen[1].max() + 0.3 * size))
