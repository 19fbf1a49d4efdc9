"""The poses that the drive of the stage reaches, with the limits that bound them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from flexfem.arrays import Array
from flexfem.paper.figures.drive import WIDTH, numbers
from flexfem.paper.polytope import Polytope
from flexfem.paper.reach import StageReach
from flexfem.plot import style
from flexfem.plot.style import GREY, INK, NAMES, titled
from flexfem.questions.poses import KINDS
from flexfem.units import COMMANDS, FORCES, LENGTH, MICROMETRE

AZIMUTH = -62.0  # degrees, of the line of sight, from the X axis
ELEVATION = 24.0  # degrees, of the line of sight, from the plane
COLOURS = ("#E4E8EC", "#9DC3E0", "#C9B458", "#D98A6A")
FILLS = dict(zip(KINDS, COLOURS, strict=True))  # by a face's rarest kind
LIMIT_HATCHES = dict(zip(KINDS, ("", "////", "\\\\\\\\", "...."), strict=True))


@style.in_house_style
def reach_figure(found: StageReach) -> Figure:
    """Draw the reachable poses with their limits: the section at theta = 0, and the solid."""
    load = f"load {numbers(found.load, FORCES)}" if np.any(found.load) else "no load"
    lines = [
        f"Limits: stroke, contact opening, blocking force and yield at the necks; {load}. Model: "
        f"{found.settings['analytic model']}. Largest ball of poses about rest: {found.ball:.4g} "
        f"{MICROMETRE}, with θ as l₃ θ, l₃ = {found.about.lever:g} {LENGTH}."
    ]
    title = f"{found.about.name}: reachable poses within all limits of the drive"
    figure = style.below_header((WIDTH, 5.6), title, lines, found.about)
    section = figure.add_subplot(1, 2, 1)
    titled(plot_section(section, found), "a", "poses at θ = 0")
    solid = figure.add_subplot(1, 2, 2, projection="3d")
    titled(plot_solid(solid, found), "b", "all poses")
    return figure


def plot_section(ax: Axes, found: StageReach) -> Axes:
    """Draw the reachable poses at theta = 0, with edges by kind of limit; return `ax`."""
    unit = COMMANDS[0]
    section = found.fields.section
    x, y = (unit.factor * found.rest[:2]).tolist()
    ax.set(
        xlabel=f"x ({unit})",
        ylabel=f"y ({unit})",
        aspect="equal",
    )
    ax.grid()
    ax.plot(x, y, "+", color=INK, markersize=9.0)
    ax.text(x, y, "  rest", va="bottom", color=INK)
    if not section:
        note = "no reachable area at θ = 0"
        ax.text(
            0.5,
            0.7,
            note,
            transform=ax.transAxes,
            ha="center",
            color=INK,
        )
        return ax
    ends = unit.factor * np.array([(edge.start, edge.end) for edge in section])
    corners = list(ends[:, 0])
    ax.add_patch(
        Polygon(
            corners,
            facecolor=FILLS["stroke"],
            edgecolor="none",
            zorder=1,
        )
    )
    combinations = _sorted_kinds({edge.by.kinds for edge in section})
    for index, kinds in enumerate(combinations):
        lines = [line for line, edge in zip(ends, section, strict=True) if edge.by.kinds == kinds]
        look: Any = {"linestyles": style.DASHES[index % len(style.DASHES)], "colors": INK}
        look |= {"linewidths": 2.2 - 0.3 * (index % 3), "label": " and ".join(kinds) or "no limit"}
        ax.add_collection(LineCollection(lines, zorder=3, **look))
    if found.circle > 0:
        radius = float(found.circle)
        ax.add_patch(
            Circle(
                (x, y),
                radius,
                fill=False,
                edgecolor=GREY,
                linewidth=0.9,
            )
        )
        text = f"largest circle about rest\nradius {radius:.4g} {unit}"
        ax.text(
            x,
            y - 0.75 * radius,
            text,
            ha="center",
            va="center",
            color=GREY,
        )
    ax.margins(0.08)
    look = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0), "frameon": False}
    ax.legend(title="limited by", alignment="left", **look)
    return ax


def _sorted_kinds(combinations: set[tuple[str, ...]]) -> list[tuple[str, ...]]:
    return sorted(combinations, key=lambda kinds: [KINDS.index(kind) for kind in reversed(kinds)])


def plot_solid(ax: Any, found: StageReach) -> Any:
    """Draw all reachable poses on axes of projection 3d, with faces by kind of limit; return `ax`.

    The projection is orthographic; rotations are scaled by l3.
    """
    solid = found.fields
    axes = zip((ax.xaxis, ax.yaxis, ax.zaxis), NAMES.values(), COMMANDS, strict=True)
    for axis, name, unit in axes:
        axis.set_label_text(f"{name} ({unit})")
        axis.labelpad = 8.0
    ax.set_proj_type("ortho")
    ax.view_init(ELEVATION, AZIMUTH)
    if not solid.faces:
        note = "the reachable poses have no volume"
        ax.text2D(
            0.5,
            0.7,
            note,
            transform=ax.transAxes,
            ha="center",
            color=INK,
        )
        return ax
    factors = np.array([unit.factor for unit in COMMANDS])
    corners = factors * solid.vertices
    low = corners.min(axis=0)
    high = corners.max(axis=0)
    ax.set(
        xlim=(low[0], high[0]),
        ylim=(low[1], high[1]),
        zlim=(low[2], high[2]),
    )
    ax.locator_params(nbins=5)
    ax.set_box_aspect((high - low) / factors * [1.0, 1.0, found.about.lever], zoom=0.85)
    handles = _draw_faces(ax, solid, corners)
    place: Any = {"loc": "upper right", "alignment": "left", "frameon": False}
    ax.legend(handles=handles, handleheight=1.4, title="limited by", **place)
    return ax


def _draw_faces(
    ax: Any,
    solid: Polytope,
    corners: Array,
) -> list[Patch]:
    """Draw the faces that the eye sees; return handles of their kinds of limits for the legend."""
    elevation, azimuth = np.deg2rad([ELEVATION, AZIMUTH])
    in_plane = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    visible = solid.normals @ np.array([*in_plane, np.sin(elevation)]) > 0
    handles = list[Patch]()
    for kinds in _sorted_kinds({by.kinds for by in solid.by}):
        look: dict[str, Any] = {
            "facecolor": FILLS[kinds[-1]] if kinds else "white",
            "edgecolor": INK,
            "linewidth": 0.9,
            "hatch": "".join(LIMIT_HATCHES[kind] for kind in kinds),
        }
        faces = zip(solid.faces, solid.by, visible, strict=True)
        polygons = [corners[list(face)] for face, by, shown in faces if shown and by.kinds == kinds]
        ax.add_collection3d(Poly3DCollection(polygons, **look))
        handles.append(Patch(label=" and ".join(kinds), **look))
    return handles
