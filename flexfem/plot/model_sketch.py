"""Figs. 3 and 4: the stage as rigid links between joints that have the freedoms of a mobility model."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from flexfem.arrays import Array
from flexfem.plot.marks import clear_spot, frame_cross, hatch_ground, write
from flexfem.plot.placed import HasHinges, Placed, placed
from flexfem.plot.style import GREY, INK, NOTE_COLOUR, in_house_style, inches, panels, text_width
from flexfem.questions.errors import CurveModels, HingeDrawing
from flexfem.units import DEGREE, LENGTH

WIDTH = 8.27  # in
LINK, SLIDER = "#30465E", "#0072B2"
SYMBOL = 0.017  # radius of a joint's circle, per size of the stage, where the links leave room for it
PITCH, ENDS = 3.1, 3.0  # distance of a joint's symbols, and what two joints take of a link besides, per radius
KEY_LINE = 0.34  # in
MEANING = {
    "rotation": "revolute joint: rotation",
    "axial": "slider along the neck: axial elongation",
    "shear": "slider across the neck: shear",
}


@in_house_style
def model_sketch(model: CurveModels) -> Figure:
    """Draw the pseudo-rigid-body model: links, joints with their freedoms, ground, platform and its frame.

    Notes
    -----
    Figs. 3 and 4 of the paper. Lengths and angles of (19) and (20) are written at chain 1.
    """
    kinds = [kind for kind in MEANING if any(kind in hinge.freedoms for hinge in model.hinges)]
    span = np.ptp([hinge.centre for hinge in model.hinges], axis=0)
    heights = (7.6 * min(max(np.divide(*(span + 0.3 * max(span))[::-1]), 0.5), 1.4), KEY_LINE * len(kinds) + 0.1)
    title, doubts = f"{model.stage}: model of mobility {model.mobility}", (model.assumed, model.not_stated)
    size = (WIDTH, sum(heights) + 0.4)
    figure, (axes, key) = panels(size, title, [mobility_line(model)], 2, doubts=doubts, height_ratios=heights)
    key.set_axis_off()
    axes.set_axis_off()
    figure.draw_without_rendering()  # labels are placed at the size that the axes have then
    plot_model(axes, model)
    _draw_key(key, kinds, heights[1])
    return figure


def plot_model(ax: Axes, stage: HasHinges) -> Axes:
    """Draw links, joints with their freedoms, ground, platform and its frame, with the lengths and angles of chain 1.

    `stage` may be the record of `flexfem.check`. Labels stand where there is room at the size that `ax` has when this
    is called; returns `ax`. Raises BadInput when it is no stage.
    """
    model = placed(stage)
    points = np.array([hinge.centre for hinge in model.hinges])
    size = float(np.max(np.ptp(points, axis=0)))
    low, up = points.min(axis=0) - 0.15 * size, points.max(axis=0) + 0.15 * size
    ax.set(xlim=(low[0], up[0]), ylim=(low[1], up[1]), aspect="equal")
    ax.set_axis_off()
    _draw_platform(ax, model, size)
    for chain in (1, 2, 3):
        _draw_chain(ax, model.hinges[3 * chain - 3 : 3 * chain], _symbol_radius(model, size))
    _write_labels(ax, model, size)
    return ax


def mobility_line(model: CurveModels) -> str:
    """Mobility by (1), in words."""
    counts = [len(hinge.freedoms) for hinge in model.hinges]
    return (
        f"Mobility by (1): M = 3 (8 \N{MINUS SIGN} 1) + {sum(counts)} \N{MINUS SIGN} 3 · 9 = {sum(counts) - 6}, "
        f"with {sum(counts)} joint freedoms in nine hinges and eight links with the ground."
    )


def links_of_chain(model: CurveModels | Placed) -> tuple[Array, Array]:
    """Lengths l1, l2, l3 (3,), mm, and angles phi_1 to phi_3 (3,), rad in (-pi, pi], of chain 1 as in (19), (20)."""
    points = np.array([*(hinge.centre for hinge in model.hinges[:3]), (0.0, 0.0)])
    links = np.diff(points, axis=0)
    headings = np.arctan2(links[:, 1], links[:, 0])
    relative = np.diff(headings, prepend=0.0)
    wrapped = -((-relative + np.pi) % (2 * np.pi) - np.pi)  # half a turn counts as +pi
    return np.linalg.norm(links, axis=1), wrapped


def _draw_platform(axes: Axes, model: Placed, size: float) -> None:
    corners = [model.hinges[k].centre for k in (2, 5, 8)]
    axes.add_patch(Polygon(corners, facecolor="#DDE3EA", edgecolor=LINK, linewidth=2.0, joinstyle="round", zorder=1))
    frame_cross(axes, 0.09 * size)
    axes.plot(0, 0, "o", color=NOTE_COLOUR, markersize=4, zorder=6)


def _draw_chain(axes: Axes, hinges: list[HingeDrawing], radius: float) -> None:
    for one, other in pairwise(hinges):
        axes.plot(
            *np.transpose([one.centre, other.centre]), color=LINK, linewidth=4.0, solid_capstyle="round", zorder=2
        )
    _draw_ground(axes, hinges[0], radius)
    for hinge in hinges:
        _draw_joint(axes, np.array(hinge.centre), hinge.axis, hinge.freedoms, _side_of(hinge) * radius)


def _write_labels(axes: Axes, model: Placed, size: float) -> None:
    """Write lengths and angles at chain 1 and the chains' numbers at their ground."""
    points = np.array([*(hinge.centre for hinge in model.hinges[:3]), (0.0, 0.0)])
    lengths, angles = links_of_chain(model)
    axes.plot(*points[2:].T, color=GREY, linewidth=1.2, linestyle=(0, (6, 2, 1.5, 2)), zorder=3)
    radius = _symbol_radius(model, size)
    taken = _occupied(model, size, radius)
    arc = min(0.1 * size, 0.45 * float(lengths.min()))
    headings = np.cumsum(angles)
    for point, heading, angle in zip(points, headings, angles, strict=False):
        taken.append(_draw_angle(axes, point, heading - angle, angle, arc))
    for k, (point, heading, angle) in enumerate(zip(points, headings, angles, strict=False), start=1):
        middle = heading - angle / 2
        name = rf"$\varphi_{k}$ = {DEGREE.factor * angle:.4g}{DEGREE}".replace("-", "\N{MINUS SIGN}")
        _place(axes, point + arc * np.array([np.cos(middle), np.sin(middle)]), name, taken, size, NOTE_COLOUR)
    for k, (start, end) in enumerate(pairwise(points), start=1):
        _place(axes, (start + end) / 2, rf"$l_{k}$ = {lengths[k - 1]:.5g} {LENGTH}", taken, size, LINK)
    for hinge in model.hinges[::3]:
        _place(axes, _behind(hinge, 4.0 * radius), f"chain {hinge.chain}", taken, size, INK)


def _occupied(model: Placed, size: float, radius: float) -> list[Array]:
    """Points along all that is drawn before the labels."""
    chains = [np.array([hinge.centre for hinge in model.hinges[3 * k : 3 * k + 3]]) for k in range(3)]
    corners = np.array([chain[2] for chain in (*chains, chains[0])])
    frame = 0.09 * size * np.array([[-0.3, 0.9], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.9, -0.3]])
    lines = [*chains, corners, frame, np.array([chains[0][2], [0.0, 0.0]])]
    for hinge in model.hinges:
        first = 4.6 if hinge.hinge == "base" else -1.0
        reach = 1.0 + 3.6 * (len(hinge.freedoms) - 1)
        for side in (-1.5, 0.0, 1.5):
            ends = [_behind(hinge, _side_of(hinge) * length * radius) for length in (first, -reach)]
            shift = side * radius * np.array([-np.sin(hinge.axis), np.cos(hinge.axis)])
            lines.append(np.array(ends) + shift)
    return [_along(line) for line in lines]


def _behind(hinge: HingeDrawing, distance: float) -> Array:
    """The place so far behind the centre of a hinge, against the direction of its neck."""
    return np.array(hinge.centre) - distance * np.array([np.cos(hinge.axis), np.sin(hinge.axis)])


def _draw_angle(axes: Axes, at: Array, start: float, angle: float, arc: float) -> Array:
    """Reference line and arc with an arrow from `start` over `angle`, rad; returns points (n, 2) on them."""
    reference = np.array([at, at + 1.35 * arc * np.array([np.cos(start), np.sin(start)])])
    axes.plot(*reference.T, color=NOTE_COLOUR, linewidth=0.8, linestyle=(0, (4, 3)), zorder=6)
    turn = start + angle * np.linspace(0, 1, 60)
    curve = at + arc * np.column_stack([np.cos(turn), np.sin(turn)])
    axes.plot(*curve.T, color=NOTE_COLOUR, linewidth=1.1, zorder=6)
    if abs(angle) * arc > 0:
        style = {"arrowstyle": "-|>", "color": NOTE_COLOUR, "linewidth": 0.01, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", curve[-1], curve[-4], arrowprops=style, zorder=6)
    return np.concatenate([curve[::3], _along(reference)])


def _place(axes: Axes, anchor: Array, text: str, taken: list[Array], size: float, colour: str) -> None:
    """Write a label near its anchor where it is clear of all that is taken, and take its place."""
    plain = text.replace("$", "").replace(r"\varphi", "m").replace("_", "")
    half = text_width(plain, 10) / 2 * _per_inch(axes)
    spot = clear_spot(anchor, 0.05 * size, np.concatenate(taken), 0.03 * size, half)
    taken.append(spot + half * np.column_stack([np.linspace(-1, 1, 9), np.zeros(9)]))
    write(axes, spot, text, colour, size=10, parse_math=True)


def _per_inch(axes: Axes) -> float:
    """How much of the drawing, in mm, an inch on paper is, with equal scales."""
    return float(np.max([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())] / inches(axes)))


def _along(corners: Array) -> Array:
    """Points (n, 2) along a polyline."""
    steps = np.linspace(0, 1, 24)[:, None]
    return np.concatenate([a + steps * (b - a) for a, b in pairwise(corners)])


def _symbol_radius(model: Placed, size: float) -> float:
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


def _draw_ground(axes: Axes, hinge: HingeDrawing, radius: float) -> None:
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


def _side_of(hinge: HingeDrawing) -> int:
    """Where along the neck its sliders are drawn: ahead of a base hinge, else behind, there lies a link by default."""
    return 1 if hinge.hinge == "base" else -1


def _draw_joint(axes: Axes, at: Array, axis: float, freedoms: list[str], radius: float) -> None:
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


def _draw_key(axes: Axes, kinds: list[str], height: float) -> None:
    """What the symbols mean."""
    axes.set_xlim(0, 7.6)
    axes.set_ylim(0, height)
    axes.set_axis_off()
    for line, kind in enumerate(kinds):
        at = np.array([0.35, height - KEY_LINE * (line + 0.5)])
        if kind == "rotation":
            _draw_joint(axes, at, 0.0, [kind], 0.1)
        else:
            _draw_slider(axes, at, np.array([1.0, 0.0] if kind == "axial" else [0.0, 1.0]), 0.1)
        axes.text(0.75, at[1], MEANING[kind], va="center", size=9)
