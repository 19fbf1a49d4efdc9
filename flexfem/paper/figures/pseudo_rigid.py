"""The pseudo-rigid-body model of the stage, Figs. 3 and 4 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon

from flexfem.arrays import Array
from flexfem.files.refusals import shown
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.stage import Stage
from flexfem.paper.verification import CurveModels, HingeDrawing
from flexfem.plot.drawing import arrow, fit, frame_cross
from flexfem.plot.labels import DrawnParts, PartLabel, write_labels
from flexfem.plot.style import GREY, INK, NOTE_COLOUR, in_house_style, page
from flexfem.plot.text import minus
from flexfem.refused import BadInput
from flexfem.units import DEGREE, LENGTH

LINK = "#30465E"
SLIDER = "#0072B2"
SYMBOL = 0.017  # largest radius of the circle of a joint over the size of the stage
PITCH = 3.1  # distance of the symbols of a joint over that radius
ENDS = 3.0  # length that the circles of two joints occupy on a link, over that radius
CROSS = 0.09  # length of the axes at the platform centre over the size of the stage
MEANING = {
    "rotation": "revolute joint: rotation",
    "axial": "slider along the neck: axial elongation",
    "shear": "slider across the neck: shear",
}


@in_house_style
def model_sketch(model: CurveModels) -> Figure:
    """Draw the pseudo-rigid-body model of a stored curve: see `plot_model`."""
    title = f"{model.stage}: model of mobility {model.mobility}"
    plot = partial(plot_model, stage=model)
    figure = page((8.27, 7.9), title, [mobility_line(model)], plot, model)
    ring: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "white"}
    handles: list[Any] = [
        Line2D([], [], linestyle="none", label=MEANING["rotation"], color=INK, **ring)
    ]
    for kind in ("axial", "shear"):
        if any(kind in hinge.freedoms for hinge in model.hinges):
            box: dict[str, Any] = {"facecolor": "white", "edgecolor": SLIDER, "linewidth": 1.6}
            handles.append(Patch(label=MEANING[kind], **box))
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=3,
        frameon=False,
    )
    return figure


def mobility_line(model: CurveModels) -> str:
    """Return a sentence on the mobility by (1)."""
    count = sum(len(hinge.freedoms) for hinge in model.hinges)
    return (
        f"Mobility by (1): M = 3 (8 \N{MINUS SIGN} 1) + {count} \N{MINUS SIGN} 3 · 9 = "
        f"{count - 6}, with {count} joint freedoms in nine hinges and eight links with the ground."
    )


def hinges_of(given: Stage | CurveModels) -> list[HingeDrawing]:
    """Return the hinges of a stage or of a stored model, chain by chain. Raises BadInput."""
    if isinstance(given, CurveModels):
        return given.hinges
    if not isinstance(given, Stage):
        raise BadInput(f"{shown(given)}: expected a stage")
    check_feasible(given)
    axial = given.array("prismatic").tolist()
    freedoms = [[["rotation", *(["axial"] * free)] for free in row] for row in axial]
    return HingeDrawing.of_stage(given, freedoms)


class ChainSizes(NamedTuple):
    """Lengths l1, l2, l3 (3,), mm, and angles phi_1 to phi_3 (3,), rad in (-pi, pi], of chain 1."""

    lengths: Array
    angles: Array


def links_of_chain(hinges: Sequence[HingeDrawing]) -> ChainSizes:
    """Return lengths and angles of chain 1 as in (19), (20)."""
    links = np.diff([*(hinge.centre for hinge in hinges[:3]), (0.0, 0.0)], axis=0)
    relative = np.diff(np.arctan2(links[:, 1], links[:, 0]), prepend=0.0)
    angles = -((-relative + np.pi) % (2 * np.pi) - np.pi)  # -pi becomes +pi
    return ChainSizes(np.linalg.norm(links, axis=1), angles)


def plot_model(ax: Axes, stage: Stage | CurveModels) -> Axes:
    """Draw links, joints with their freedoms, ground, platform and its frame; return `ax`.

    Lengths and angles are written on chain 1. Labels are placed for the size of `ax` at the time of
    the call. Raises BadInput when `stage` is not a stage.
    """
    hinges = hinges_of(stage)
    points = np.array([hinge.centre for hinge in hinges]).reshape(3, 3, 2)
    size = fit(ax, points.reshape(-1, 2), 0.17)
    ax.set_axis_off()
    radius = _symbol_radius(hinges, points, size)
    platform: Any = points[:, 2]
    look: dict[str, Any] = {"facecolor": "#DDE3EA", "edgecolor": LINK, "linewidth": 2.0}
    ax.add_patch(Polygon(platform, joinstyle="round", zorder=1, **look))
    frame_cross(ax, CROSS * size)
    ax.plot(
        0,
        0,
        "o",
        color=NOTE_COLOUR,
        markersize=4,
        zorder=6,
    )
    for chain in points:
        ax.plot(
            *chain.T,
            color=LINK,
            linewidth=4.0,
            solid_capstyle="round",
            zorder=2,
        )
    for hinge in hinges:
        _draw_joint(ax, hinge, radius)
    _label_model(ax, hinges, size, radius)
    return ax


def _symbol_radius(
    hinges: Sequence[HingeDrawing],
    points: Array,
    size: float,
) -> float:
    """Return the radius of the circles of joints; the symbols of two joints fit on every link."""
    shortest = np.linalg.norm(np.diff(points, axis=1), axis=2).min()
    sliders = max(len(hinge.freedoms) for hinge in hinges) - 1
    return float(min(SYMBOL * size, shortest / (ENDS + 2 * PITCH * sliders)))


def _draw_joint(
    axes: Axes,
    hinge: HingeDrawing,
    radius: float,
) -> None:
    """Draw a circle for the rotation, a rectangle on rails for each slider, and a ground."""
    at = np.array(hinge.centre)
    along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
    across = np.array([-along[1], along[0]])
    inwards = along if hinge.hinge == "base" else -along  # where the sliders are
    if hinge.hinge == "base":
        _draw_ground(axes, at, radius * along, radius * across)
    number = 0
    for kind, axis in (("axial", along), ("shear", across)):
        if kind in hinge.freedoms:
            number += 1
            _draw_slider(axes, at + number * PITCH * radius * inwards, radius * axis)
    look: dict[str, Any] = {"facecolor": "white", "edgecolor": INK, "linewidth": 1.8}
    axes.add_patch(Circle((at[0], at[1]), radius, zorder=5, **look))


def _draw_ground(
    axes: Axes,
    at: Array,
    along: Array,
    across: Array,
) -> None:
    """Draw the support of a base hinge on hatched ground; the vectors are as long as a radius."""
    foot = at - 3.2 * along
    support: Any = [at, foot + 1.7 * across, foot - 1.7 * across]
    look: dict[str, Any] = {"facecolor": "white", "edgecolor": LINK, "linewidth": 1.5}
    axes.add_patch(Polygon(support, zorder=2.5, **look))
    ground = [foot + 2.6 * across, foot - 2.6 * across]
    strip: Any = [*ground, *(end - 1.4 * along for end in reversed(ground))]
    hatched: dict[str, Any] = {"facecolor": "none", "edgecolor": INK, "linewidth": 0.0}
    axes.add_patch(Polygon(strip, hatch="//////", zorder=4, **hatched))
    axes.plot(
        *np.transpose(ground),
        color=INK,
        linewidth=2.2,
        zorder=4,
    )


def _draw_slider(
    axes: Axes,
    middle: Array,
    axis: Array,
) -> None:
    """Draw a block between two rails along an axis, a vector as long as the radius of a joint."""
    half = 1.05 * axis
    thick = 0.62 * np.array([-axis[1], axis[0]])
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    block: Any = [middle + x * half + y * thick for x, y in corners]
    look: dict[str, Any] = {"facecolor": "white", "edgecolor": SLIDER, "linewidth": 1.6}
    axes.add_patch(Polygon(block, zorder=4, **look))
    for rail in (1.65 * thick, -1.65 * thick):
        ends = [middle + rail - 1.45 * half, middle + rail + 1.45 * half]
        axes.plot(
            *np.transpose(ends),
            color=SLIDER,
            linewidth=1.6,
            zorder=4,
        )


def _label_model(
    axes: Axes,
    hinges: list[HingeDrawing],
    size: float,
    radius: float,
) -> None:
    """Write the lengths and angles of chain 1, and the number of each chain at its ground."""
    chains = np.array([hinge.centre for hinge in hinges]).reshape(3, 3, 2)
    corners = np.array([*chains[0], (0.0, 0.0)])
    dash_dotted = (0, (6, 2, 1.5, 2))
    axes.plot(
        *corners[2:].T,
        color=GREY,
        linewidth=1.2,
        linestyle=dash_dotted,
        zorder=3,
    )
    joints = [*chains.reshape(-1, 2), corners[3]]
    obstacles: list[Any] = [shapely.Point(at).buffer(2.0 * radius) for at in joints]
    obstacles += [shapely.LineString(line) for line in (*chains, corners)]
    obstacles.append(shapely.LineString(CROSS * size * np.array([[0, 1], [0, 0], [1, 0]])))
    sizes = links_of_chain(hinges)
    labels = list[PartLabel]()
    for anchor, text, colour in _draw_angles(axes, corners, sizes, size, obstacles):
        look = {"colour": colour, "size": 10.0, "parse_math": True}
        labels.append(PartLabel(text, anchor, look))
    for hinge in hinges[::3]:
        along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
        foot = hinge.centre - 4.0 * radius * along
        obstacles.append(shapely.Point(foot).buffer(3.0 * radius))
        labels.append(PartLabel(f"chain {hinge.chain}", foot, {"size": 10.0}))
    write_labels(axes, labels, DrawnParts([], obstacles))


class _Text(NamedTuple):
    """A text about a point (2,), and its colour."""

    anchor: Array
    text: str
    colour: str


def _draw_angles(
    axes: Axes, corners: Array, sizes: ChainSizes, size: float, obstacles: list[Any]
) -> list[_Text]:
    """Draw the angles between links as arcs, and append what labels must avoid.

    Returns the texts of the angles and of the lengths.
    """
    headings = np.cumsum(sizes.angles)
    radius = min(0.1 * size, 0.45 * float(sizes.lengths.min()))
    texts = list[_Text]()
    for k in range(3):
        at = corners[k]
        angle = sizes.angles[k]
        directions = headings[k] - angle + angle * np.linspace(0, 1, 60)
        arc = at + radius * np.column_stack([np.cos(directions), np.sin(directions)])
        reference = np.array([at, at + 1.35 * (arc[0] - at)])
        dashed = (0, (4, 3))
        axes.plot(
            *reference.T,
            color=NOTE_COLOUR,
            linewidth=0.8,
            linestyle=dashed,
            zorder=6,
        )
        axes.plot(
            *arc.T,
            color=NOTE_COLOUR,
            linewidth=1.1,
            zorder=6,
        )
        arrow(axes, arc[-4], arc[-1], colour=NOTE_COLOUR, width=0.01)
        obstacles += [shapely.LineString(arc), shapely.LineString(reference)]
        degrees = f"{np.rad2deg(angle):.4g}{DEGREE}"
        texts.append(_Text(arc[30], minus(rf"$\varphi_{k + 1}$ = {degrees}"), NOTE_COLOUR))
        length = f"$l_{k + 1}$ = {sizes.lengths[k]:.4g} {LENGTH}"
        texts.append(_Text((corners[k] + corners[k + 1]) / 2, length, LINK))
    return texts
