"""A driven stage: every stack in its place, with its stroke and force, and the platform at the pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.bodies import Segment, draw_sector, turn
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.plot.marks import clear_spot, write
from flexfem.plot.stage import draw_outline, fit, outline_of
from flexfem.plot.style import GREY, INK, inches
from flexfem.plot.text import round_factor
from flexfem.questions.drive import Drive, StackPlace
from flexfem.questions.driven import Criterion
from flexfem.units import FORCES, LENGTH, MICROMETRE

LONG, BROAD, GAP, ARROW = 1.3, 0.5, 0.2, 0.47  # of a drawn stack, its ball and the longest force, per link width
FORCE, POSE = "#B00000", "#007A58"
SIGNS = (  # of strokes
    ("stack becomes longer", "#7FB2DC", "", 1.0),
    ("stack becomes shorter", "#F3D9B1", "////", -1.0),
    ("stack stays", "white", "", 0.0),
)
ROUND_OFF = 1e-9  # of the largest stroke
MOST_LABELLED = 12  # stacks that have their stroke and force beside them; of more only the numbers
VISIBLE = 0.06  # largest drawn displacement of the platform, per size of the stage
LABEL, NUMBER = np.array([0.85, 0.28]), np.array([0.2, 0.16])  # in, of what is written beside a stack
WIDER = 1.1  # than now the axes may become to hold the labels
STEP = np.pi / 24  # rad of arc between two drawn points


def plot_drive(ax: Axes, found: Drive, criterion: Criterion = "least energy") -> Axes:
    """Draw a stage with its stacks in their places, their strokes and forces, and its platform at the pose, in mm.

    Stacks are numbered from 1 as in the record; their size is that of no catalogue. An arrow starts at every contact,
    in the direction of the push and in proportion to the force; the platform is drawn `platform_factor` times as far.
    Returns `ax`. Raises BadInput for a criterion that has no strokes.
    """
    stage, places = found.fields
    stroke, force = found.at("stroke", criterion=criterion), found.at("force", criterion=criterion)
    outline, width = outline_of(stage), stage.chain.link_width
    draw_outline(ax, outline)
    boxes = [_box(place, width) for place in places]
    fit(ax, np.concatenate([*outline.bodies, *boxes]))
    _draw_stacks(ax, width, places, boxes, stroke)
    _draw_carriers(ax, stage, places, boxes)
    _draw_forces(ax, places, force, width)
    _draw_platform(ax, found)
    _number(ax, boxes, stroke, force, np.concatenate(outline.bodies))
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")
    return ax


def platform_factor(found: Drive) -> float:
    """The round factor by which the platform's displacement is drawn; 1 when it does not move."""
    stage = found.fields.stage
    rim = np.concatenate(_platform(stage))
    x, y, theta = found.pose
    largest = float(np.max(np.abs(x + 1j * y + rim * 1j * theta)))
    size = float(np.ptp(np.concatenate(outline_of(stage).bodies), axis=0).max())
    return round_factor(VISIBLE * size / largest) if largest > 0 else 1.0


def _draw_platform(ax: Axes, found: Drive) -> None:
    """The rim and the hub of the platform at the pose, exaggerated; nothing when it does not move."""
    x, y, theta = platform_factor(found) * found.pose
    if not any((x, y, theta)):
        return
    lines = [x + 1j * y + line * np.exp(1j * theta) for line in _platform(found.fields.stage)]
    drawn = LineCollection([np.column_stack([line.real, line.imag]) for line in lines], zorder=5)
    drawn.set(colors=POSE, linewidths=1.4, linestyles="dashed", label="platform at the pose")
    ax.add_collection(drawn, autolim=False)


def _platform(stage: Stage) -> list[AnyArray]:
    """Lines, complex, of the platform's rim and hub."""
    found = []
    for chain in CHAINS:
        face = draw_sector(stage, chain)["platform"]
        loop = zip(turn(face.loop, chain), face.labels, strict=True)
        found += [_points(segment) for segment, label in loop if label in ("free", "hub")]
    return found


def _points(segment: Segment) -> AnyArray:
    return np.append(segment.points(STEP), segment.end)


def _box(place: StackPlace, width: float) -> Array:
    """Corners (4, 2) of a drawn stack behind its contact: the two at the ball, then those where it is carried."""
    contact, push = np.array(place.contact), np.array(place.push)
    aside = BROAD / 2 * width * np.array([-push[1], push[0]])
    front, rear = contact - GAP * width * push, contact - (GAP + LONG) * width * push
    return np.array([front + aside, front - aside, rear - aside, rear + aside])


def _draw_stacks(ax: Axes, width: float, places: list[StackPlace], boxes: list[Array], stroke: Array) -> None:
    """Stacks by the sign of their strokes, with balls at their contacts."""
    sign = np.sign(np.where(np.abs(stroke) > ROUND_OFF * np.max(np.abs(stroke)), stroke, 0.0))
    for label, colour, hatch, wanted in SIGNS:
        mine = [box for box, own in zip(boxes, sign, strict=True) if own == wanted]
        look: dict[str, Any] = {"facecolors": colour, "hatch": hatch, "edgecolors": INK, "linewidths": 0.7, "zorder": 4}
        if mine:
            ax.add_collection(PolyCollection(mine, label=label, **look), autolim=False)
    contact, push = (np.array([getattr(place, name) for place in places]) for name in ("contact", "push"))
    ax.plot(*(contact - GAP / 2 * width * push).T, "o", color=INK, markersize=3.0, linestyle="none", zorder=5)


def _draw_carriers(ax: Axes, stage: Stage, places: list[StackPlace], boxes: list[Array]) -> None:
    """What carries the stacks: ground behind them, or a line to the nearest point of the body."""
    rears = [box[2:] for box in boxes]
    on_frame = [place.between[0] == "frame" for place in places]
    grounds = [rear for rear, held in zip(rears, on_frame, strict=True) if held]
    ax.add_collection(LineCollection(grounds, colors=INK, linewidths=2.4, zorder=4.5), autolim=False)
    for place, rear, held in zip(places, rears, on_frame, strict=True):
        if not held:
            middle = np.mean(rear, axis=0)
            ax.plot(*np.transpose([middle, _carrier(stage, place, middle)]), color=GREY, linewidth=1.2, zorder=3.5)


def _carrier(stage: Stage, place: StackPlace, point: Array) -> Array:
    """The point (2,) nearest to one of the outline of the body that carries a stack."""
    body, found = place.between[0], []
    for chain in CHAINS if body == "platform" else (place.chain,):
        face = draw_sector(stage, chain)[body]
        loop = zip(turn(face.loop, chain), face.labels, strict=True)
        found += [_along(segment) for segment, label in loop if label == "free"]
    outline = np.concatenate(found)
    nearest = outline[np.argmin(np.abs(outline - complex(*point)))]
    return np.array([nearest.real, nearest.imag])


def _along(segment: Segment) -> AnyArray:
    """Points, complex, of a line or arc, close enough to be the nearest ones."""
    if segment.centre is not None:
        return _points(segment)
    return np.asarray(segment.start + np.linspace(0.0, 1.0, 33) * (segment.end - segment.start))


def _draw_forces(ax: Axes, places: list[StackPlace], force: Array, width: float) -> None:
    """Arrows from the contacts, the longest `ARROW` link widths; a stack that would have to pull points back."""
    contact, push = (np.array([getattr(place, name) for place in places]) for name in ("contact", "push"))
    longest = float(np.max(np.abs(force)))
    shaft = ARROW * width * push * force[:, None] / (longest or 1.0)
    ax.quiver(
        *contact.T, *shaft.T, angles="xy", scale_units="xy", scale=1.0, color=FORCE, width=0.004, zorder=6,
        label=f"force on the pushed body, the longest {longest:.4g} {FORCES[0]}",
    )  # fmt: skip


def _number(ax: Axes, boxes: list[Array], strokes: Array, forces: Array, bodies: Array) -> None:
    """Number every stack, with its stroke and force when there is room for all, where the drawing is clear."""
    full = len(boxes) <= MOST_LABELLED
    scale = WIDER * float(np.max(np.ptp([ax.get_xlim(), ax.get_ylim()], axis=1) / inches(ax)))  # mm per inch
    half, high = (LABEL if full else NUMBER) / 2 * scale
    inside = half * np.array([[x, y * high / half] for x in (-1.0, -0.5, 0.0, 0.5, 1.0) for y in (-1.0, 0.0, 1.0)])
    taken = [bodies, *(_around(box) for box in boxes)]
    for k, (box, stroke, force) in enumerate(zip(boxes, strokes.tolist(), forces.tolist(), strict=True)):
        anchor = box.mean(axis=0)
        spot = clear_spot(anchor, half + high, np.concatenate(taken), 2.2 * high, half)
        taken.append(spot + inside)
        ax.plot(*np.transpose([anchor, spot]), color=GREY, linewidth=0.6, zorder=3.2)
        said = f": {MICROMETRE.factor * stroke:+.3g} {MICROMETRE}\n{force:.4g} {FORCES[0]}" if full else ""
        frame = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.5}
        write(ax, spot, f"{k + 1}{said}".replace("-", "\N{MINUS SIGN}"), size=7.0, bbox=frame)
    _hold(ax, np.concatenate(taken))


def _hold(ax: Axes, points: Array) -> None:
    """Widen the axes until they hold points (n, 2)."""
    low, high, pad = points.min(axis=0), points.max(axis=0), 0.015 * np.ptp(points)
    left, right, bottom, top = (*ax.get_xlim(), *ax.get_ylim())
    ax.set_xlim(min(left, low[0] - pad), max(right, high[0] + pad))
    ax.set_ylim(min(bottom, low[1] - pad), max(top, high[1] + pad))


def _around(box: Array) -> Array:
    """Points (n, 2) along the sides of a drawn stack."""
    share = np.linspace(0.0, 1.0, 4, endpoint=False)[:, None, None]
    return np.asarray((box + share * (np.roll(box, -1, axis=0) - box)).reshape(-1, 2))
