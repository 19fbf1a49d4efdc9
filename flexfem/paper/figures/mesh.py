"""The mesh of the stage of a stored verification, and its details at the necks of chain 1."""

from __future__ import annotations

from functools import partial

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from flexfem.paper.stage import CHAINS
from flexfem.paper.verification import CurveModels, HingeDrawing
from flexfem.plot.drawing import WHITE_BOX, arrow, fit, frame_cross, label_axes
from flexfem.plot.labels import DrawnParts, PartLabel, write_labels
from flexfem.plot.mesh import boundary_of, draw_boundary, draw_mesh
from flexfem.plot.plate import HUB
from flexfem.plot.style import GREY, INK, in_house_style, page, panels
from flexfem.results import Fields, thousands
from flexfem.units import LENGTH

CHAIN_COLOURS = ("#0072B2", "#B34700", "#007A58")
KEY = (
    "Hinges 1 to 9: base, elbow and platform hinge of chains 1 to 3. Heavy lines: clamped. Disc: "
    "rigid hub."
)


@in_house_style
def stage_figure(model: CurveModels, fields: Fields) -> Figure:
    """Draw the stage of one curve of a stored verification with its mesh; see `plot_mesh`."""
    plot = partial(plot_mesh, model=model, fields=fields)
    lines = [mesh_size(model), KEY]
    return page((8.27, 7.6), f"{model.stage}: mesh", lines, plot, model)


def plot_mesh(
    ax: Axes,
    model: CurveModels,
    fields: Fields,
) -> Axes:
    """Draw the mesh of a stage, in mm, the numbers of its hinges, clamped edges and hub.

    Returns `ax`.
    """
    nodes = fields.nodes
    draw_mesh(ax, nodes, fields.triangles, width=0.18)
    size = fit(ax, nodes)
    _draw_clamped(ax, fields)
    hub = model.hub_radius
    ax.add_patch(
        Circle(
            (0, 0),
            hub,
            facecolor=HUB,
            edgecolor=INK,
            linewidth=0.9,
            zorder=2.5,
        )
    )
    cross = frame_cross(ax, max(0.6 * hub, 0.04 * size))
    labels = [_number(hinge, str(number)) for number, hinge in enumerate(model.hinges, start=1)]
    for chain, colour in zip(CHAINS, CHAIN_COLOURS, strict=True):
        link_ends = [hinge.centre for hinge in model.hinges[3 * chain - 2 : 3 * chain]]
        look = {"colour": colour, "size": 10.0, "weight": "bold"}
        labels.append(PartLabel(f"chain {chain}", np.mean(link_ends, axis=0), look))
    edges = nodes[boundary_of(fields.triangles)[:, [0, 2, 1]]]
    outline = shapely.MultiLineString(list(edges))
    material = shapely.unary_union(shapely.polygons(nodes[fields.triangles[:, :3]]))
    write_labels(ax, labels, DrawnParts([outline], cross, material))
    label_axes(ax)
    return ax


def _draw_clamped(ax: Axes, fields: Fields) -> None:
    """Draw the edges without displacement as heavy lines."""
    boundary = boundary_of(fields.triangles)
    clamped = ~np.any(fields.displacement != 0.0, axis=1)
    edges = boundary[clamped[boundary].all(axis=1)]
    draw_boundary(ax, fields.nodes, edges, INK, 2.8, zorder=4)


def _number(hinge: HingeDrawing, number: str) -> PartLabel:
    """Return the number of a hinge in a ring of the colour of its chain."""
    colour = CHAIN_COLOURS[hinge.chain - 1]
    ring = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": colour}
    look = {"colour": colour, "size": 9.0, "weight": "bold", "bbox": ring | {"linewidth": 1.2}}
    return PartLabel(number, np.array(hinge.centre), look)


def mesh_size(model: CurveModels) -> str:
    """Return a sentence on the size and the resolution of the mesh."""
    layers = f", {model.layers} layers in half the thickness" if model.layers else ""
    return (
        f"{thousands(model.triangles)} curved quadratic triangles, {thousands(model.unknowns)} "
        f"unknowns, {model.resolution} triangles across every neck{layers}."
    )


@in_house_style
def neck_figure(model: CurveModels, fields: Fields) -> Figure:
    """Draw the mesh at the three notches of chain 1, with radii, and below at their necks."""
    title = f"{model.stage}: necks of chain 1"
    figure, axes = panels((10.0, 7.1), title, [mesh_size(model)], 2, 3, model)
    for column, hinge in enumerate(model.hinges[:3]):
        plot_neck(axes[column], fields, hinge, whole=True).set_title(f"{hinge.hinge} hinge")
        plot_neck(axes[3 + column], fields, hinge)
    for ax in (*axes[1:3], *axes[4:]):
        ax.set_ylabel("")
    return figure


def plot_neck(
    ax: Axes,
    fields: Fields,
    hinge: HingeDrawing,
    whole: bool = False,
) -> Axes:
    """Draw the mesh at a neck in its local frame, in mm; return `ax`.

    whole : the notch with its radius R, instead of the narrowest section with its width t.
    """
    half = 1.2 * (hinge.radius + hinge.neck) if whole else 1.1 * hinge.neck
    c = np.cos(hinge.axis)
    s = np.sin(hinge.axis)
    local = np.asarray((fields.nodes - np.array(hinge.centre)) @ np.array([[c, -s], [s, c]]))
    near = (np.abs(local[fields.triangles]) < 1.5 * half).all(axis=2).any(axis=1)
    draw_mesh(ax, local, fields.triangles[near], width=0.45)
    ax.set(
        xlim=(-half, half),
        ylim=(-half, half),
        aspect="equal",
    )
    ax.set(xlabel=f"along the neck ({LENGTH})", ylabel=f"across the neck ({LENGTH})")
    ax.locator_params(nbins=4)
    if whole:
        _mark_radius(ax, hinge)
    else:
        _mark_width(ax, hinge)
    return ax


def _mark_radius(ax: Axes, hinge: HingeDrawing) -> None:
    middle = np.array([0.0, -hinge.radius - hinge.neck / 2])
    ax.plot(
        *middle,
        "+",
        color=INK,
        markersize=8,
        zorder=5,
    )
    arrow(ax, middle, middle + hinge.radius * np.array([-np.sqrt(0.5), np.sqrt(0.5)]))
    text = f"R = {hinge.radius:g} {LENGTH}"
    ax.text(
        0.0,
        middle[1] - 0.1 * hinge.radius,
        text,
        size=10,
        ha="center",
        va="top",
    )


def _mark_width(ax: Axes, hinge: HingeDrawing) -> None:
    arrow(ax, (0.0, hinge.neck / 2), (0.0, -hinge.neck / 2), "<|-|>")
    box = WHITE_BOX | {"edgecolor": GREY, "linewidth": 0.5}
    text = f"t = {hinge.neck:g} {LENGTH}"
    ax.text(
        0.12 * hinge.neck,
        0.0,
        text,
        size=10,
        va="center",
        zorder=6,
        bbox=box,
    )
