"""A stage by its outline, with its mesh, and its necks close up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from flexfem.arrays import Array, Index
from flexfem.mechanism.bodies import Segment, draw_sector, polygon_points, turn
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.plot.marks import (
    Edges,
    arrow,
    clamped_edges,
    clear_spot,
    drawn_edges,
    edges_of,
    frame_cross,
    hatch_ground,
    loops_of,
    polygon,
    write,
)
from flexfem.plot.style import GREY, INK, PALE, in_house_style, new_axes, panels
from flexfem.plot.text import SPACE
from flexfem.questions.errors import CurveModels, HingeDrawing
from flexfem.units import LENGTH
from flexfem.verify.result import Fields

MESH_COLOUR = "#5B7FA6"
CHAIN_COLOURS = ("#0072B2", "#B34700", "#007A58")
KEY = "Hinges 1 to 9: base, elbow and platform hinge of chains 1 to 3. Hatched: clamped. Disc: rigid hub."
STEP = np.pi / 24  # rad of arc between two points of a small drawing
MOST_VECTORS = 2500  # sides of triangles; more are rasterised in a PDF


def plot_stage(ax: Axes | None, stage: Stage) -> Axes:
    """Draw the outline of a stage to scale, in mm, its grounds heavy, its hub as a disc; returns `ax`, or new axes.

    Raises BadInput when its bodies cannot be drawn.
    """
    outline = outline_of(stage)
    ax = ax or new_axes()
    draw_outline(ax, outline)
    fit(ax, np.concatenate(outline.bodies))
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")
    return ax


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


@in_house_style
def stage_figure(model: CurveModels, fields: Fields) -> Figure:
    """Draw the stage with its mesh, the numbers of its hinges and chains, its clamped edges and its rigid hub, in mm.

    Parameters
    ----------
    model, fields : of one curve of a stored verification; nodes in mm.
    """
    across, up = np.ptp(fields.nodes, axis=0) + 0.2 * np.ptp(fields.nodes, axis=0).max()
    size, doubts = (8.27, 7.2 * min(max(up / across, 0.5), 1.5) + 0.7), (model.assumed, model.not_stated)
    figure, (axes,) = panels(size, model.stage, [mesh_size(model), KEY], 1, doubts=doubts)
    plot_mesh(axes, model, fields)
    return figure


def plot_mesh(ax: Axes, model: CurveModels, fields: Fields) -> Axes:
    """Draw the mesh of a stage, the numbers of its hinges and chains, clamped edges and hub, in mm; returns `ax`."""
    edges = edges_of(fields.triangles)
    draw_mesh(ax, fields.nodes, edges, width=0.18)
    size = fit(ax, fields.nodes)
    hatch_ground(ax, fields.nodes, clamped_edges(edges.boundary, fields.displacement), 0.025 * size)
    ax.add_patch(Circle((0, 0), model.hub_radius, facecolor="#C9CED6", edgecolor=INK, linewidth=0.9, zorder=2.5))
    frame_cross(ax, max(0.6 * model.hub_radius, 0.04 * size))
    _number_hinges(ax, model, fields.nodes, size)
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")
    return ax


def mesh_size(model: CurveModels) -> str:
    """Size of the mesh, in words."""
    triangles, unknowns = (f"{count:,}".replace(",", SPACE) for count in (model.triangles, model.unknowns))
    across = f"{model.resolution} triangles across every neck"
    across += f", {model.layers} layers in half the thickness" if model.layers else ""
    return f"{triangles} curved quadratic triangles, {unknowns} unknowns, {across}."


def draw_mesh(axes: Axes, nodes: Array, edges: Edges, width: float) -> None:
    """Draw filled bodies, every side of the triangles in a thin line and the outline in a thicker one."""
    loops = [polygon(nodes, loop) for loop in loops_of(edges.boundary)]
    fill = PolyCollection([loops[0]], facecolors=PALE, edgecolors="none", zorder=1)
    holes = PolyCollection(loops[1:], facecolors="white", edgecolors="none", zorder=1.1)
    lines = drawn_edges(nodes, edges.every, 6)
    mesh = LineCollection(lines, linewidths=width, colors=MESH_COLOUR, zorder=2, rasterized=True)
    outline = LineCollection(loops, linewidths=max(0.8, 2 * width), colors=INK, zorder=3)
    for collection in (fill, holes, mesh, outline):
        axes.add_collection(collection, autolim=False)


def fit(axes: Axes, nodes: Array) -> float:
    """Equal scales with room for labels around the nodes; returns the size of the stage, mm."""
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    size = float(max(high - low))
    axes.set_xlim(low[0] - 0.1 * size, high[0] + 0.1 * size)
    axes.set_ylim(low[1] - 0.1 * size, high[1] + 0.1 * size)
    axes.set_aspect("equal", anchor="N")
    return size


def _number_hinges(axes: Axes, model: CurveModels, nodes: Array, size: float) -> None:
    """Write the hinges' numbers and the chains' names where there is room."""
    taken = [nodes[::4], *(np.array([hinge.centre]) for hinge in model.hinges)]
    for number, hinge in enumerate(model.hinges, start=1):
        colour = CHAIN_COLOURS[hinge.chain - 1]
        at = np.array(hinge.centre)
        spot = clear_spot(at, 0.06 * size, np.concatenate(taken), 0.05 * size)
        taken.append(np.linspace(at, spot, 4))
        axes.plot(*np.transpose([at, spot]), color=colour, linewidth=0.9, zorder=5)
        axes.plot(*at, "o", color=colour, markersize=3.5, zorder=6)
        box = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": colour, "linewidth": 1.2}
        write(axes, spot, str(number), colour, weight="bold", bbox=box)
    for chain in (1, 2, 3):
        elbow, platform = (np.array(hinge.centre) for hinge in model.hinges[3 * chain - 2 : 3 * chain])
        spot = clear_spot((elbow + platform) / 2, 0.09 * size, np.concatenate(taken), 0.05 * size, 0.05 * size)
        taken.append(spot + size * np.array([[-0.05, 0.0], [0.0, 0.0], [0.05, 0.0]]))
        colour = CHAIN_COLOURS[chain - 1]
        write(axes, spot, f"chain {chain}", colour, size=10, weight="bold")


@in_house_style
def neck_figure(model: CurveModels, fields: Fields) -> Figure:
    """Draw the three notches of chain 1 and, below, their narrowest sections, with mesh, radius and neck, in mm.

    Parameters
    ----------
    model, fields : of one curve of a stored verification; nodes in mm. Coordinates run along and across each neck.
    """
    line = f"{mesh_size(model)} Curved sides are drawn as curves."
    doubts = (model.assumed, model.not_stated)
    figure, found = panels((10.0, 7.1), f"{model.stage}: necks of chain 1", [line], 2, 3, doubts)
    for column, hinge in enumerate(model.hinges[:3]):
        plot_notch(found[column], fields, hinge).set_title(f"{hinge.hinge} hinge")
        plot_neck(found[3 + column], fields, hinge)
        if column:
            found[column].set_ylabel("")
            found[3 + column].set_ylabel("")
    return figure


def plot_notch(ax: Axes, fields: Fields, hinge: HingeDrawing) -> Axes:
    """Draw the mesh about a notch, seen along its neck, with the radius, in mm; returns `ax`."""
    _draw_close(ax, fields, hinge, 1.2 * (hinge.radius + hinge.neck))
    _dimension_notch(ax, hinge)
    return ax


def plot_neck(ax: Axes, fields: Fields, hinge: HingeDrawing) -> Axes:
    """Draw the mesh at the narrowest section of a neck, seen along it, with its width, in mm; returns `ax`."""
    _draw_close(ax, fields, hinge, 1.1 * hinge.neck)
    _dimension_neck(ax, hinge)
    return ax


def _along_neck(nodes: Array, hinge: HingeDrawing) -> Array:
    """Nodes (n, 2) seen from the centre of a neck: along and across it."""
    c, s = np.cos(hinge.axis), np.sin(hinge.axis)
    return np.asarray((nodes - np.array(hinge.centre)) @ np.array([[c, -s], [s, c]]))


def _draw_close(axes: Axes, fields: Fields, hinge: HingeDrawing, half: float) -> None:
    """Draw the part of the mesh in a window so wide to each side of the neck's centre, along and across the neck."""
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    axes.set(xlabel=f"along the neck ({LENGTH})", ylabel=f"across the neck ({LENGTH})")
    axes.locator_params(nbins=4)
    local, edges = _along_neck(fields.nodes, hinge), edges_of(fields.triangles)
    near = Edges(*(_inside(local, group, 1.5 * half) for group in edges))
    outer, *holes = (_clipped(polygon(local, loop, 8), 2.0 * half) for loop in loops_of(edges.boundary))
    axes.add_collection(PolyCollection([outer], facecolors=PALE, edgecolors="none", zorder=1), autolim=False)
    axes.add_collection(PolyCollection(holes, facecolors="white", edgecolors="none", zorder=1.1), autolim=False)
    lines, many = drawn_edges(local, near.every, 12), len(near.every) > MOST_VECTORS
    mesh = LineCollection(lines, linewidths=0.45, colors=MESH_COLOUR, zorder=2, rasterized=many)
    outline = LineCollection(drawn_edges(local, near.boundary, 12), linewidths=1.3, colors=INK, zorder=3)
    for collection in (mesh, outline):
        axes.add_collection(collection, autolim=False)


def _clipped(points: Array, reach: float) -> Array:
    """A polygon (n, 2) with what is beyond the window pushed to its border, where it does no harm and is left out."""
    pushed = np.clip(points, -reach, reach)
    return np.asarray(pushed[np.any(pushed != np.roll(pushed, 1, axis=0), axis=1)]).reshape(-1, 2)


def _inside(local: Array, edges: Index, reach: float) -> Index:
    seen = np.asarray((np.abs(local[edges]) < reach).all(axis=2))
    return np.asarray(edges[seen.any(axis=1)])


def _dimension_notch(axes: Axes, hinge: HingeDrawing) -> None:
    """Radius, from the centre of the lower arc."""
    middle = np.array([0.0, -hinge.radius - hinge.neck / 2])
    tip = middle + hinge.radius * np.array([-np.sqrt(0.5), np.sqrt(0.5)])
    axes.plot(*middle, "+", color=INK, markersize=8, zorder=5)
    arrow(axes, middle, tip)
    axes.text(
        middle[0], middle[1] - 0.1 * hinge.radius, f"R = {hinge.radius:g} {LENGTH}", size=10, ha="center", va="top"
    )


def _dimension_neck(axes: Axes, hinge: HingeDrawing) -> None:
    """Width of the narrowest section, between two arrows."""
    arrow(axes, (0.0, hinge.neck / 2), (0.0, -hinge.neck / 2), "<|-|>")
    box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.5}
    axes.text(0.12 * hinge.neck, 0.0, f"t = {hinge.neck:g} {LENGTH}", size=10, va="center", zorder=6, bbox=box)
