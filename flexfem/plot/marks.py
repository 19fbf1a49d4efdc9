"""Marks that drawings share: arrows, hatched ground, frames, joints, and places where a label is clear of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Circle, FancyArrowPatch, Polygon

from flexfem.arrays import Array, Index
from flexfem.plot.style import INK
from flexfem.verify.result import HingeDrawing, Model

Point = Sequence[float] | Array


def arrow(axes: Axes, tail: Point, head: Point, style: str = "-|>", colour: str = INK, width: float = 1.0) -> None:
    """A slim arrow from `tail` to `head`, in data coordinates."""
    points: Any = [(float(p[0]), float(p[1])) for p in (tail, head)]
    shape: dict[str, Any] = {"arrowstyle": style, "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0, "zorder": 6.0}
    axes.add_patch(FancyArrowPatch(*points, color=colour, linewidth=width, **shape))


def write(axes: Axes, at: Point, text: str, colour: str = INK, size: float = 9.0, **style: Any) -> None:
    """A text centred at a place, in data coordinates."""
    axes.text(float(at[0]), float(at[1]), text, ha="center", va="center", size=size, color=colour, zorder=8, **style)


def frame_cross(axes: Axes, length: float) -> None:
    """The platform's frame at the origin: X, Y."""
    for head, beside, name in (((1.0, 0.0), (0.9, -0.3), "X"), ((0.0, 1.0), (-0.3, 0.9), "Y")):
        arrow(axes, (0.0, 0.0), length * np.array(head), colour="#B00000", width=1.2)
        write(axes, length * np.array(beside), name, "#B00000")


def show_window(axes: Axes, low: Array, high: Array) -> None:
    """Show at least the window from corner `low` to `high`, with equal scales, in the whole of the axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    inches = np.array(axes.get_position().size) * figure.get_size_inches()
    half = float(np.max((high - low) / inches)) * inches / 2
    middle = (low + high) / 2
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    axes.set_aspect("equal")


def hatch_ground(axes: Axes, nodes: Array, edges: Index, depth: float) -> None:
    """Hatch a strip of ground so deep, in mm, outside the edges (k, 3) that are walked with the body on the left."""
    ends = nodes[edges[:, :2]]
    along = ends[:, 1] - ends[:, 0]
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    strips = np.concatenate([ends, (ends + depth * outward[:, None])[:, ::-1]], axis=1)
    axes.add_collection(
        PolyCollection(list(strips), facecolors="none", edgecolors=INK, linewidths=0.0, hatch="//////", zorder=4),
        autolim=False,
    )
    axes.add_collection(LineCollection(list(ends), colors=INK, linewidths=2.2, zorder=4), autolim=False)


def clear_spot(anchor: Array, distance: float, taken: Array, enough: float, half: float = 0.0) -> Array:
    """The place (2,) around an anchor, at 1 to 2 times the distance, that is clearest of the points taken (n, 2).

    A clearance of `enough` or more counts as enough: the nearer place is then better. The label reaches `half` to the
    left and right of its place.
    """
    angles = np.arange(24) * (2 * np.pi / 24)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    spots = np.concatenate([anchor + reach * distance * ring for reach in (1.0, 1.35, 1.7, 2.0)])
    near = taken[np.linalg.norm(taken - anchor, axis=1) < 2.0 * distance + 2.0 * enough + half]
    label = spots[:, None] + half * np.array([[-1.0, 0.0], [-0.5, 0.0], [0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    clearance = np.linalg.norm(label[:, :, None] - near, axis=-1).min(axis=(1, 2), initial=np.inf)
    return np.asarray(spots[int(np.argmax(np.round(np.minimum(clearance, enough), 9)))])


LINK, SLIDER = "#30465E", "#0072B2"
SYMBOL = 0.017  # radius of a joint's circle, per size of the stage, where the links leave room for it
PITCH, ENDS = 3.1, 3.0  # distance of a joint's symbols, and what two joints take of a link besides, per radius
KEY_LINE = 0.34  # in
MEANING = {
    "rotation": "revolute joint: rotation",
    "axial": "slider along the neck: axial elongation",
    "shear": "slider across the neck: shear",
}


def symbol_radius(model: Model, size: float) -> float:
    """Radius of the joints' circles, mm, with which all symbols find room on their links."""
    radii = [SYMBOL * size]
    for base, elbow, platform in (model.hinges[k : k + 3] for k in (0, 3, 6)):
        for start, end, sliders in (
            (base, elbow, len(base.freedoms) + len(elbow.freedoms) - 2),
            (elbow, platform, len(platform.freedoms) - 1),
        ):
            length = float(np.hypot(*np.subtract(end.centre, start.centre)))
            radii.append(length / (ENDS + PITCH * sliders))
    return min(radii)


def draw_ground(axes: Axes, hinge: HingeDrawing, radius: float) -> None:
    """A bracket behind the base joint, on hatched ground."""
    at, s = np.array(hinge.centre), radius
    along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
    across = np.array([-along[1], along[0]])
    foot = at - 3.2 * s * along
    axes.add_patch(
        Polygon(
            [at, foot + 1.7 * s * across, foot - 1.7 * s * across],
            facecolor="white",
            edgecolor=LINK,
            linewidth=1.5,
            zorder=2.5,
        )
    )
    ends = np.array([foot + 2.6 * s * across, foot - 2.6 * s * across])
    hatch_ground(axes, ends, np.array([[0, 1, 0]]), 1.4 * s)


def side_of(hinge: HingeDrawing) -> int:
    """Where along the neck its sliders are drawn: ahead of a base hinge, else behind, there lies a link by default."""
    return 1 if hinge.hinge == "base" else -1


def draw_joint(axes: Axes, at: Array, axis: float, freedoms: list[str], radius: float) -> None:
    """A circle for the rotation, then a slider along the neck and one across it, as the freedoms say.

    The sliders are ahead of the circle, behind it where the radius is negative.
    """
    along = np.array([np.cos(axis), np.sin(axis)])
    across = np.array([-along[1], along[0]])
    place = at
    for kind, way in (("axial", along), ("shear", across)):
        if kind in freedoms:
            place = place + PITCH * radius * along
            _draw_slider(axes, place, way, radius)
    axes.add_patch(Circle((at[0], at[1]), abs(radius), facecolor="white", edgecolor=INK, linewidth=1.8, zorder=5))


def _draw_slider(axes: Axes, at: Array, way: Array, radius: float) -> None:
    """A block between two rails that run along its way."""
    side = np.array([-way[1], way[0]])
    half, thick = 1.05 * radius * way, 0.62 * radius * side
    block = [at + half + thick, at - half + thick, at - half - thick, at + half - thick]
    axes.add_patch(Polygon(block, facecolor="white", edgecolor=SLIDER, linewidth=1.6, zorder=4))
    for rail in (1.65 * thick, -1.65 * thick):
        ends = [at + rail - 1.45 * half, at + rail + 1.45 * half]
        axes.plot(*np.transpose(ends), color=SLIDER, linewidth=1.6, zorder=4)


def draw_key(axes: Axes, kinds: list[str], height: float) -> None:
    """What the symbols mean."""
    axes.set_xlim(0, 7.6)
    axes.set_ylim(0, height)
    axes.set_axis_off()
    for line, kind in enumerate(kinds):
        at = np.array([0.35, height - KEY_LINE * (line + 0.5)])
        if kind == "rotation":
            draw_joint(axes, at, 0.0, [kind], 0.1)
        else:
            _draw_slider(axes, at, np.array([1.0, 0.0] if kind == "axial" else [0.0, 1.0]), 0.1)
        axes.text(0.75, at[1], MEANING[kind], va="center", size=9)
