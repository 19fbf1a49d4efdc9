"""Symbols of the mobility models: circles for rotations, sliders along and across the neck, brackets for the ground."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from flexfem.arrays import Array
from flexfem.plot.marks import hatch_ground
from flexfem.plot.style import INK
from flexfem.verify.result import HingeDrawing, Model

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
