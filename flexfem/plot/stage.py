"""Drawings of a stage: mesh, details of the necks, and the pseudo-rigid model; and the elements of
all drawings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, Patch, Polygon
from matplotlib.path import Path

from flexfem.arrays import AnyArray, Array, Index
from flexfem.files.refusals import shown
from flexfem.mechanism.dimensions import clearest
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.stage import CHAINS, Stage
from flexfem.paper.verification import CurveModels, HingeDrawing
from flexfem.plot.style import (
    GREY,
    INK,
    LETTER,
    NOTE_COLOUR,
    PALE,
    in_house_style,
    page,
    panels,
    wrapped,
)
from flexfem.plot.text import minus, round_factor
from flexfem.refused import BadInput
from flexfem.results import SPACE, Fields, thousands
from flexfem.units import DEGREE, LENGTH

Point = Sequence[float] | Array
MESH_COLOUR = "#5B7FA6"
HUB = "#C9CED6"
LINK = "#30465E"
SLIDER = "#0072B2"
DIMENSION = "#00664A"
CLASH = "#D00000"
CHAIN_COLOURS = ("#0072B2", "#B34700", "#007A58")
KEY = (
    "Hinges 1 to 9: base, elbow and platform hinge of chains 1 to 3. Heavy lines: clamped. Disc: "
    "rigid hub."
)
SIDES = np.array(((0, 1, 3), (1, 2, 4), (2, 0, 5)))  # ends and middle of the sides of a triangle
QUARTERS = np.array(
    ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
)  # linear triangles on the nodes of a quadratic one
SYMBOL = (
    0.017  # largest radius of a joint's circle over the size of the stage; short links reduce it
)
PITCH = 3.1
ENDS = (
    3.0  # over that radius: distance of a joint's symbols; length that two joints occupy on a link
)
MEANING = {
    "rotation": "revolute joint: rotation",
    "axial": "slider along the neck: axial elongation",
    "shear": "slider across the neck: shear",
}
WHITE_BOX = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"}


def arrow(
    axes: Axes,
    tail: Point,
    head: Point,
    style: str = "-|>",
    colour: str = INK,
    width: float = 1.0,
    **shape: Any,
) -> None:
    """Draw a thin arrow from `tail` to `head`, in data coordinates."""
    look: dict[str, Any] = {
        "mutation_scale": 9.0,
        "shrinkA": 0.0,
        "shrinkB": 0.0,
        "zorder": 6.0,
    } | shape
    ends: Any = (tail[0], tail[1]), (head[0], head[1])
    axes.add_patch(FancyArrowPatch(*ends, arrowstyle=style, color=colour, linewidth=width, **look))


def write(
    axes: Axes, at: Point, text: str, colour: str = INK, size: float = 9.0, **style: Any
) -> None:
    """Write a text centred at a point, in data coordinates."""
    axes.text(
        float(at[0]),
        float(at[1]),
        text,
        ha="center",
        va="center",
        size=size,
        color=colour,
        zorder=8,
        **style,
    )


def place_label(
    axes: Axes, anchor: Array, text: str, obstacles: list[Any], distance: float, **style: Any
) -> Array:
    """Write a text at 1 to 2.5 times a distance from an anchor, where its clearance from the
    obstacles is largest.

    Appends its box to `obstacles`; returns its centre (2,).
    """
    lines = text.replace(r"\varphi", "m").replace("$", "").split("\n")
    spans = np.ptp([axes.get_xlim(), axes.get_ylim()], axis=1)
    pixels = np.array(axes.get_window_extent().size)
    inch = axes.figure.dpi * float(np.max(spans / pixels))  # in data coordinates
    half = (
        style.get("size", 9.0)
        / 144
        * inch
        * np.array([LETTER["normal"] * max(map(len, lines)), 1.2 * len(lines)])
    )
    window = shapely.box(*np.transpose([axes.get_xlim(), axes.get_ylim()]).ravel())
    reaches = distance * np.array([1.0, 1.35, 1.7, 2.0, 2.5])
    place, box = clearest(
        complex(*anchor), complex(*half), reaches, obstacles, 0.6 * distance, window
    )
    obstacles.append(box)
    write(axes, xy(place), text, **style)
    return np.array(xy(place))


def boundary_of(triangles: AnyArray) -> Index:
    """Boundary edges (k, 3) of a mesh of triangles (m, 6): end nodes and middle node."""
    sides = triangles[:, SIDES].reshape(-1, 3)
    _, first, count = np.unique(sides[:, 2], return_index=True, return_counts=True)
    return np.asarray(sides[first[count == 1]])


def draw_boundary(
    axes: Axes, nodes: Array, edges: Index, colour: str, width: float, zorder: float = 3
) -> None:
    """Draw quadratic edges (k, 3) as polylines through their middle nodes, in one path, to keep
    vector files small.
    """
    points = nodes[edges[:, [0, 2, 1]]].reshape(-1, 2)
    path = Path(points, np.tile([Path.MOVETO, Path.LINETO, Path.LINETO], len(edges)))
    look: dict[str, Any] = {
        "facecolors": "none",
        "edgecolors": colour,
        "linewidths": width,
        "zorder": zorder,
    }
    axes.add_collection(PathCollection([path], **look), autolim=False)


def draw_mesh(axes: Axes, nodes: Array, triangles: AnyArray, width: float) -> None:
    """Draw filled triangles (m, 6), and their boundary as a thicker line."""
    look: dict[str, Any] = {
        "facecolors": PALE,
        "edgecolors": MESH_COLOUR,
        "linewidths": width,
        "zorder": 2,
    }
    outlines = nodes[triangles[:, [0, 3, 1, 4, 2, 5]]]
    axes.add_collection(PolyCollection(list(outlines), rasterized=True, **look), autolim=False)
    draw_boundary(axes, nodes, boundary_of(triangles), INK, max(0.8, 2 * width))


def frame_cross(axes: Axes, length: float, at: complex = 0j) -> None:
    """Draw the X and Y axes of the platform or output at a point."""
    look: dict[str, Any] = {
        "textcoords": "offset points",
        "ha": "center",
        "va": "center",
        "color": NOTE_COLOUR,
    }
    for tip, offset, name in (
        (at + length, (0.0, -9.0), "X"),
        (at + 1j * length, (-9.0, 0.0), "Y"),
    ):
        arrow(axes, xy(at), xy(tip), colour=NOTE_COLOUR, width=1.2)
        axes.annotate(name, xy(tip), offset, size=9.0, zorder=8, **look)


def fit(axes: Axes, nodes: Array, room: float = 0.1) -> float:
    """Set equal scales with room for labels around the nodes; return the size of the stage, mm."""
    low = nodes.min(axis=0)
    high = nodes.max(axis=0)
    size = float(max(high - low))
    axes.set_xlim(low[0] - room * size, high[0] + room * size)
    axes.set_ylim(low[1] - room * size, high[1] + room * size)
    axes.set_aspect(
        "equal", anchor="N"
    )  # else the layout engine overestimates the room for the title
    return size


def hinges_of(given: Stage | CurveModels) -> list[HingeDrawing]:
    """Return the hinges of a stage or of a stored model, chain by chain. Raises BadInput."""
    if isinstance(given, CurveModels):
        return given.hinges
    if not isinstance(given, Stage):
        raise BadInput(f"{shown(given)}: expected a stage")
    check_feasible(given)
    axial = given.array("prismatic").tolist()
    return HingeDrawing.of_stage(
        given, [[["rotation", *(["axial"] * free)] for free in row] for row in axial]
    )


def fit_to_one_scale(axes: Sequence[Axes], points: Array) -> None:
    """Set all axes to one scale for drawings through points (n, 2), with a scale bar of a round
    length on the first.
    """
    low = points.min(axis=0)
    high = points.max(axis=0)
    room = 0.02 * np.ptp(points)
    for ax in axes:
        ax.set(
            xlim=(low[0] - room, high[0] + room),
            ylim=(low[1] - 5 * room, high[1] + room),
            aspect="equal",
        )
    _draw_bar(axes[0], low - [0.0, 3 * room], 0.4 * float(high[0] - low[0]), ", all drawings")


def scale_bar(ax: Axes) -> None:
    """Draw a scale bar of a round length below a drawing, whose limits are lowered for it."""
    low, high = ax.get_xlim()
    bottom, top = ax.get_ylim()
    ax.set_ylim(bottom - 0.03 * (top - bottom), top)
    _draw_bar(ax, np.array([low + 0.02 * (high - low), bottom]), 0.25 * (high - low))


def _draw_bar(ax: Axes, at: Array, longest: float, note: str = "") -> None:
    length = round_factor(longest)
    ax.plot(
        [at[0], at[0] + length], [at[1], at[1]], color=INK, linewidth=2.5, solid_capstyle="butt"
    )
    text = f"{length:g}{SPACE}{LENGTH}{note}"
    x = at[0] + length + 0.05 * longest
    ax.text(x, at[1], text, size=7.5, va="center", in_layout=False)


def label_axes(ax: Axes) -> None:
    """Label both axes."""
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")


def xy(z: complex) -> tuple[float, float]:
    """Return the coordinates of a point."""
    return float(z.real), float(z.imag)


@in_house_style
def stage_figure(model: CurveModels, fields: Fields) -> Figure:
    """Draw the stage of one curve of a stored verification with its mesh; see `plot_mesh`."""
    plot = partial(plot_mesh, model=model, fields=fields)
    lines = [mesh_size(model), KEY]
    return page((8.27, 7.6), f"{model.stage}: mesh", lines, plot, model)


def plot_mesh(ax: Axes, model: CurveModels, fields: Fields) -> Axes:
    """Draw the mesh of a stage, in mm, the numbers of its hinges and chains, clamped edges and hub;
    return `ax`.
    """
    nodes = fields.nodes
    triangles = fields.triangles
    hub = model.hub_radius
    draw_mesh(ax, nodes, triangles, width=0.18)
    size = fit(ax, nodes)
    boundary = boundary_of(triangles)
    clamped = ~np.any(fields.displacement != 0.0, axis=1)
    draw_boundary(ax, nodes, boundary[clamped[boundary].all(axis=1)], INK, 2.8, zorder=4)
    ax.add_patch(Circle((0, 0), hub, facecolor=HUB, edgecolor=INK, linewidth=0.9, zorder=2.5))
    frame_cross(ax, max(0.6 * hub, 0.04 * size))
    obstacles: list[Any] = [shapely.MultiPoint(nodes[::4])]
    for number, hinge in enumerate(model.hinges, start=1):
        colour = CHAIN_COLOURS[hinge.chain - 1]
        at = np.array(hinge.centre)
        box = {
            "boxstyle": "circle,pad=0.25",
            "facecolor": "white",
            "edgecolor": colour,
            "linewidth": 1.2,
        }
        label = place_label(
            ax, at, str(number), obstacles, 0.06 * size, colour=colour, weight="bold", bbox=box
        )
        ax.plot(
            *np.transpose([at, label]),
            "o-",
            color=colour,
            linewidth=0.9,
            markersize=3.5,
            markevery=[0],
            zorder=6,
        )
    for chain, colour in zip(CHAINS, CHAIN_COLOURS, strict=True):
        middle = np.mean(
            [hinge.centre for hinge in model.hinges[3 * chain - 2 : 3 * chain]], axis=0
        )
        place_label(
            ax,
            middle,
            f"chain {chain}",
            obstacles,
            0.09 * size,
            colour=colour,
            size=10,
            weight="bold",
        )
    label_axes(ax)
    return ax


def mesh_size(model: CurveModels) -> str:
    """Sentence on the size and the resolution of the mesh."""
    layers = f", {model.layers} layers in half the thickness" if model.layers else ""
    return (
        f"{thousands(model.triangles)} curved quadratic triangles, {thousands(model.unknowns)} "
        f"unknowns, {model.resolution} triangles across every neck{layers}."
    )


@in_house_style
def neck_figure(model: CurveModels, fields: Fields) -> Figure:
    """Draw the mesh, in mm, at the three notches of chain 1, with radii, and below at their necks,
    with widths.
    """
    figure, axes = panels(
        (10.0, 7.1), f"{model.stage}: necks of chain 1", [mesh_size(model)], 2, 3, model
    )
    for column, hinge in enumerate(model.hinges[:3]):
        plot_neck(axes[column], fields, hinge, whole=True).set_title(f"{hinge.hinge} hinge")
        plot_neck(axes[3 + column], fields, hinge)
    for ax in (*axes[1:3], *axes[4:]):
        ax.set_ylabel("")
    return figure


def plot_neck(ax: Axes, fields: Fields, hinge: HingeDrawing, whole: bool = False) -> Axes:
    """Draw the mesh at a neck in its local frame, in mm: the narrowest section with t, or the
    `whole` notch with R.

    Returns `ax`.
    """
    half = 1.2 * (hinge.radius + hinge.neck) if whole else 1.1 * hinge.neck
    c = np.cos(hinge.axis)
    s = np.sin(hinge.axis)
    local = np.asarray((fields.nodes - np.array(hinge.centre)) @ np.array([[c, -s], [s, c]]))
    near = (np.abs(local[fields.triangles]) < 1.5 * half).all(axis=2).any(axis=1)
    draw_mesh(ax, local, fields.triangles[near], width=0.45)
    ax.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    ax.set(xlabel=f"along the neck ({LENGTH})", ylabel=f"across the neck ({LENGTH})")
    ax.locator_params(nbins=4)
    if whole:
        middle = np.array([0.0, -hinge.radius - hinge.neck / 2])
        ax.plot(*middle, "+", color=INK, markersize=8, zorder=5)
        arrow(ax, middle, middle + hinge.radius * np.array([-np.sqrt(0.5), np.sqrt(0.5)]))
        ax.text(
            0.0,
            middle[1] - 0.1 * hinge.radius,
            f"R = {hinge.radius:g} {LENGTH}",
            size=10,
            ha="center",
            va="top",
        )
    else:
        arrow(ax, (0.0, hinge.neck / 2), (0.0, -hinge.neck / 2), "<|-|>")
        box = WHITE_BOX | {"edgecolor": GREY, "linewidth": 0.5}
        ax.text(
            0.12 * hinge.neck,
            0.0,
            f"t = {hinge.neck:g} {LENGTH}",
            size=10,
            va="center",
            zorder=6,
            bbox=box,
        )
    return ax


@in_house_style
def model_sketch(model: CurveModels) -> Figure:
    """Draw the pseudo-rigid-body model, Figs. 3 and 4 of the paper: see `plot_model`."""
    title = f"{model.stage}: model of mobility {model.mobility}"
    figure = page(
        (8.27, 7.9), title, [mobility_line(model)], partial(plot_model, stage=model), model
    )
    ring: dict[str, Any] = {
        "marker": "o",
        "markersize": 9,
        "markerfacecolor": "white",
        "color": INK,
    }
    handles: list[Any] = [Line2D([], [], linestyle="none", label=MEANING["rotation"], **ring)]
    handles += [
        Patch(facecolor="white", edgecolor=SLIDER, linewidth=1.6, label=MEANING[kind])
        for kind in ("axial", "shear")
        if any(kind in hinge.freedoms for hinge in model.hinges)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def mobility_line(model: CurveModels) -> str:
    """Sentence on the mobility by (1)."""
    count = sum(len(hinge.freedoms) for hinge in model.hinges)
    return (
        f"Mobility by (1): M = 3 (8 \N{MINUS SIGN} 1) + {count} \N{MINUS SIGN} 3 · 9 = "
        f"{count - 6}, with {count} joint freedoms in nine hinges and eight links with the ground."
    )


def links_of_chain(hinges: Sequence[HingeDrawing]) -> tuple[Array, Array]:
    """Lengths l1, l2, l3 (3,), mm, and angles phi_1 to phi_3 (3,), rad in (-pi, pi], of chain 1 as
    in (19), (20).
    """
    links = np.diff([*(hinge.centre for hinge in hinges[:3]), (0.0, 0.0)], axis=0)
    relative = np.diff(np.arctan2(links[:, 1], links[:, 0]), prepend=0.0)
    return np.linalg.norm(links, axis=1), -(
        (-relative + np.pi) % (2 * np.pi) - np.pi
    )  # -pi becomes +pi


def plot_model(ax: Axes, stage: Stage | CurveModels) -> Axes:
    """Draw links, joints with their freedoms, ground, platform and its frame, with the lengths and
    angles of chain 1.

    Labels are placed for the size of `ax` at the time of the call. Returns `ax`. Raises BadInput
    when `stage` is not a stage."""
    hinges = hinges_of(stage)
    points = np.array([hinge.centre for hinge in hinges]).reshape(3, 3, 2)
    size = fit(ax, points.reshape(-1, 2), 0.17)
    ax.set_axis_off()
    shortest = np.linalg.norm(np.diff(points, axis=1), axis=2).min()
    radius = min(
        SYMBOL * size,
        shortest / (ENDS + 2 * PITCH * (max(len(hinge.freedoms) for hinge in hinges) - 1)),
    )
    platform: Any = points[:, 2]
    ax.add_patch(
        Polygon(
            platform,
            facecolor="#DDE3EA",
            edgecolor=LINK,
            linewidth=2.0,
            joinstyle="round",
            zorder=1,
        )
    )
    frame_cross(ax, 0.09 * size)
    ax.plot(0, 0, "o", color=NOTE_COLOUR, markersize=4, zorder=6)
    for chain in points:
        ax.plot(*chain.T, color=LINK, linewidth=4.0, solid_capstyle="round", zorder=2)
    for hinge in hinges:
        _draw_joint(ax, hinge, radius)
    _label_model(ax, hinges, points, size, radius)
    return ax


def _draw_joint(axes: Axes, hinge: HingeDrawing, radius: float) -> None:
    """Draw a circle for the rotation and the sliders: along the axis of a base hinge, opposite to
    that of another.
    """
    at = np.array(hinge.centre)
    along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
    across = np.array([-along[1], along[0]])
    base = hinge.hinge == "base"
    if base:
        foot = at - 3.2 * radius * along
        side = radius * across
        corners = [at, foot + 1.7 * side, foot - 1.7 * side]
        axes.add_patch(
            Polygon(corners, facecolor="white", edgecolor=LINK, linewidth=1.5, zorder=2.5)
        )
        ground = [foot + 2.6 * side, foot - 2.6 * side]
        strip = [*ground, *(end - 1.4 * radius * along for end in reversed(ground))]
        axes.add_patch(
            Polygon(strip, facecolor="none", edgecolor=INK, linewidth=0.0, hatch="//////", zorder=4)
        )
        axes.plot(*np.transpose(ground), color=INK, linewidth=2.2, zorder=4)
    sliders = [
        axis for kind, axis in (("axial", along), ("shear", across)) if kind in hinge.freedoms
    ]
    for number, axis in enumerate(sliders, start=1):
        middle = at + (1 if base else -1) * number * PITCH * radius * along
        half = 1.05 * radius * axis
        thick = 0.62 * radius * np.array([-axis[1], axis[0]])
        block = [
            middle + half + thick,
            middle - half + thick,
            middle - half - thick,
            middle + half - thick,
        ]
        axes.add_patch(Polygon(block, facecolor="white", edgecolor=SLIDER, linewidth=1.6, zorder=4))
        for rail in (1.65 * thick, -1.65 * thick):
            ends = [middle + rail - 1.45 * half, middle + rail + 1.45 * half]
            axes.plot(*np.transpose(ends), color=SLIDER, linewidth=1.6, zorder=4)
    axes.add_patch(
        Circle((at[0], at[1]), radius, facecolor="white", edgecolor=INK, linewidth=1.8, zorder=5)
    )


def _label_model(
    axes: Axes, hinges: list[HingeDrawing], points: Array, size: float, radius: float
) -> None:
    """Write the lengths and angles of chain 1, and the number of each chain at its ground."""
    corners = np.array([*points[0], (0.0, 0.0)])
    lengths, angles = links_of_chain(hinges)
    headings = np.cumsum(angles)
    arc = min(0.1 * size, 0.45 * float(lengths.min()))
    axes.plot(*corners[2:].T, color=GREY, linewidth=1.2, linestyle=(0, (6, 2, 1.5, 2)), zorder=3)
    obstacles: list[Any] = [
        shapely.Point(at).buffer(2.0 * radius) for at in (*points.reshape(-1, 2), corners[3])
    ]
    obstacles += [shapely.LineString(line) for line in (*points, corners)]
    obstacles.append(shapely.LineString(0.09 * size * np.array([[0, 1], [0, 0], [1, 0]])))
    labels: list[tuple[Array, str, str]] = []
    for k, (at, heading, angle) in enumerate(zip(corners, headings, angles, strict=False), start=1):
        directions = heading - angle + angle * np.linspace(0, 1, 60)
        curve = at + arc * np.column_stack([np.cos(directions), np.sin(directions)])
        reference = np.array([at, at + 1.35 * (curve[0] - at)])
        axes.plot(*reference.T, color=NOTE_COLOUR, linewidth=0.8, linestyle=(0, (4, 3)), zorder=6)
        axes.plot(*curve.T, color=NOTE_COLOUR, linewidth=1.1, zorder=6)
        arrow(axes, curve[-4], curve[-1], colour=NOTE_COLOUR, width=0.01)
        obstacles += [shapely.LineString(curve), shapely.LineString(reference)]
        angle_text = minus(rf"$\varphi_{k}$ = {np.rad2deg(angle):.4g}{DEGREE}")
        length_text = f"$l_{k}$ = {lengths[k - 1]:.4g} {LENGTH}"
        labels += [
            (curve[30], angle_text, NOTE_COLOUR),
            ((corners[k - 1] + corners[k]) / 2, length_text, LINK),
        ]
    for anchor, text, colour in labels:
        place_label(
            axes,
            anchor,
            text,
            obstacles,
            0.05 * size,
            colour=colour,
            size=10,
            parse_math=True,
            bbox=WHITE_BOX,
        )
    for hinge in hinges[::3]:
        foot = hinge.centre - 4.0 * radius * np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
        obstacles.append(shapely.Point(foot).buffer(3.0 * radius))
        place_label(axes, foot, f"chain {hinge.chain}", obstacles, 0.06 * size, size=10)


def mark_clashes(ax: Axes, refusal: BadInput | None, clashes: Sequence[Any]) -> None:
    """Draw polygons at fault in red, with the refusal, if any, as title."""
    if refusal is None:
        return
    look: dict[str, Any] = {
        "facecolor": f"{CLASH}80",
        "edgecolor": CLASH,
        "linewidth": 2.0,
        "zorder": 7,
    }
    for polygon in clashes:
        ax.add_patch(Polygon(polygon.exterior.coords, **look))
    text = f"{refusal}{'. Red: the parts at fault' * bool(clashes)}"
    ax.set_title(wrapped(text, 7.4, 9), color=CLASH, size=9)


def show_window(draw: Callable[[Axes], object], title: str) -> bool:
    """Show a drawing in a window and wait until it is closed; return False where no window can be
    opened.
    """
    from matplotlib import pyplot

    try:
        figure, ax = pyplot.subplots(figsize=(8.27, 8.27), layout="constrained")
    except ImportError:  # the backend that the user has set is not available
        return False
    interactive = figure.canvas.required_interactive_framework is not None
    if interactive:
        ax.set_title(title, wrap=True)
        draw(ax)
        pyplot.show()
    pyplot.close(figure)
    return interactive
