"""The driven stage at a pose: its stacks, and their strokes and forces by criterion."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.mechanism.plate import body_polygon, extent, plate_polygon
from flexfem.paper.actuators import BODY_NAMES
from flexfem.paper.contacts import Stack
from flexfem.paper.drive import StageDrive
from flexfem.paper.drives import drive_of
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage import Stage
from flexfem.plot import style
from flexfem.plot.drawing import fit, label_axes
from flexfem.plot.labels import DrawnParts, PartLabel, write_labels
from flexfem.plot.plate import draw_plate
from flexfem.plot.style import COLOURS, GREY, INK, NOTE_COLOUR, PALE, titled
from flexfem.plot.text import minus, round_factor, significant
from flexfem.questions.driven import CRITERIA, Criterion
from flexfem.units import COMMANDS, FORCES, MICROMETRE

WIDTH = 11.69  # in
ROUND_OFF = 1e-9  # of the largest stroke
STACK_LENGTH = 1.3  # of a stack as drawn, over the link width
STACK_WIDTH = 0.5  # the same
BALL = 0.2  # diameter of the ball of a stack as drawn, over the link width
LONGEST_ARROW = 0.47  # as drawn, over the link width
STROKE_SIGNS = (  # label, colour and hatch of a stack by the sign of its stroke
    ("stack extends", "#7FB2DC", "", 1.0),
    ("stack contracts", "#F3D9B1", "////", -1.0),
    ("no stroke", "white", "", 0.0),
)
MOVED = "#007A58"
NUMBERS = 7.0  # points, of the numbers of stacks
VISIBLE = 0.06  # largest drawn displacement of the platform over the size of the stage


@style.in_house_style
def command_figure(found: StageDrive) -> Figure:
    """Draw a driven stage at a pose: its stacks, and their strokes and forces by criterion."""
    upper = _height_of_rows(len(found.command))
    lower = max(_height_of_rows(len(found.stroke)), 5.8 - upper)
    size = (WIDTH, upper + lower + 1.2)
    title = f"{found.about.name}: strokes and forces for a pose"
    figure = style.below_header(size, title, _header(found), found.about)
    ratios: dict[str, Any] = {"width_ratios": [1.5, 1.0], "height_ratios": [upper, lower]}
    mosaic: list[Any] = [["stage", "strokes"], ["stage", "forces"]]
    axes: dict[str, Axes] = figure.subplot_mosaic(mosaic, **ratios)
    titled(plot_strokes(axes["strokes"], found), "b", "strokes of the actuators (numbers: stacks)")
    titled(plot_forces(axes["forces"], found), "c", "forces of the stacks")
    handles = style.handles_of([axes["strokes"], axes["forces"]])
    place: Any = {"loc": "upper center", "frameon": False, "bbox_to_anchor": (0.5, -0.14)}
    axes["forces"].legend(handles.values(), handles.keys(), ncols=3, **place)
    # determines the size of the axes, which the placement of labels needs
    figure.draw_without_rendering()
    text = f"stage at the pose, strokes and forces of {CRITERIA[0]}"
    titled(plot_drive(axes["stage"], found), "a", text)
    axes["stage"].legend(ncols=2, **place)
    return figure


def _height_of_rows(count: int) -> float:
    """Return the height, in, of a panel with rows of bars."""
    return min(max(0.27 * count + 0.75, 1.9), 9.0)


def _header(found: StageDrive) -> list[str]:
    """Return the lines on the pose and the load, and the warnings on this pose."""
    load = f" under a load of {numbers(found.load, FORCES)}" if np.any(found.load) else ""
    pose = f"Pose {numbers(found.pose, COMMANDS)}{load}; strokes by {found.settings['strokes by']}."
    factor = ""
    if np.any(found.pose):
        times = significant(platform_factor(found), 1)
        factor = f" Dashed: the platform at the pose, displacements × {times}."
    warnings = [warning for warning in found.warnings if "this pose" in warning]
    return [f"{pose}{factor} Stacks are not drawn to scale.", *warnings]


def numbers(values: Any, units: Any) -> str:
    """Return values in units with SI prefixes."""
    texts = [f"{unit.factor * value:.5g} {unit}" for value, unit in zip(values, units, strict=True)]
    return minus(", ".join(texts))


def plot_strokes(ax: Axes, found: StageDrive) -> Axes:
    """Draw the strokes from rest, a bar per actuator and criterion, over the available strokes.

    Returns `ax`.
    """
    low = found.shortest
    rows = np.arange(len(low))
    look: dict[str, Any] = {
        "height": 0.94,
        "color": PALE,
        "edgecolor": GREY,
        "linewidth": 0.6,
    }
    ax.barh(rows, found.longest - low, left=low, label="available strokes", **look)
    _bars(ax, dict(zip(found.axes["criterion"], found.command.T, strict=True)))
    labels = list[str]()
    differential = drive_of(found.fields).differential
    for name, column in zip(found.axes["actuator"], differential.T, strict=True):
        stacks = ", ".join(str(k + 1) for k in np.flatnonzero(column))
        labels.append(f"{name} ({stacks})")
    _label_rows(ax, labels)
    ax.set_xlabel(f"stroke from rest ({MICROMETRE})")
    return ax


def plot_forces(ax: Axes, found: StageDrive) -> Axes:
    """Draw the forces, a bar per stack and criterion, with preloads and the blocking force.

    Returns `ax`.
    """
    force = dict(zip(found.axes["criterion"], found.force.T, strict=True))
    preload = found.preload
    values = np.concatenate([*force.values(), preload])
    _bars(ax, force)
    rows = np.arange(len(preload))
    ax.plot(
        preload,
        rows,
        "|",
        color=INK,
        markersize=17.0,
        label="preload",
        zorder=5,
    )
    _label_rows(ax, [f"{k + 1}: {name}" for k, name in enumerate(found.axes["stack"])])
    blocking = sorted({f"{value:.4g}": value for value in found.blocking_force}.values())
    ends = " to ".join(f"{value:.4g}" for value in dict.fromkeys((blocking[0], blocking[-1])))
    ax.set_xlabel(f"force ({FORCES[0]}); limits: 0 and blocking force {ends} {FORCES[0]}")
    ax.set_xlim(min(0.0, 1.12 * float(values.min())), 1.12 * max(float(values.max()), 1e-9))
    return ax


def _bars(ax: Axes, values: dict[Any, Any]) -> None:
    """Draw a group of horizontal bars per row, one for each criterion in `values`."""
    height = 0.8 / len(values)
    for k, (name, value) in enumerate(values.items()):
        index = CRITERIA.index(name)
        rows = np.arange(len(value)) + (k - (len(values) - 1) / 2) * height
        look: Any = {"color": COLOURS[index], "hatch": style.HATCHES[index], "label": name}
        ax.barh(rows, value, height=height, edgecolor="white", linewidth=0.4, zorder=3, **look)


def _label_rows(ax: Axes, names: list[str]) -> None:
    style.name_rows(ax, names, 1.6, 8.5 if len(names) <= 24 else 6.0)


def plot_drive(
    ax: Axes,
    found: StageDrive,
    criterion: Criterion = "least energy",
) -> Axes:
    """Draw a stage, in mm, with its stacks, their strokes and forces, and its platform at the pose.

    Stacks are numbered from 1 as in the record and are not to scale. The arrow at each contact is
    in proportion to the force of the stack; the displacement of the platform is multiplied by
    `platform_factor`. Returns `ax`. Raises BadInput for a criterion without strokes.
    """
    stage = found.fields
    stroke = found.at("stroke", criterion=criterion)
    force = found.at("force", criterion=criterion)
    contacts, along = stack_ends(stage)
    width = stage.chain.link_width
    boxes = np.array([_box(*end, width) for end in zip(contacts, along, strict=True)])
    rim = draw_plate(ax, stage)
    fit(ax, np.concatenate([rim, *boxes]), 0.22)
    _draw_stacks(ax, boxes, stroke)
    ax.plot(
        *(contacts - BALL / 2 * width * along).T,
        "o",
        color=INK,
        markersize=3.0,
        zorder=5,
    )
    for stack, box in zip(drive_of(stage).stacks, boxes, strict=True):
        _draw_mount(ax, stage, stack, box)
    _draw_forces(ax, contacts, width * along, force)
    if np.any(found.pose):
        _draw_moved_platform(ax, found)
    frame = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": GREY}
    look = {"size": NUMBERS, "bbox": frame | {"linewidth": 0.5}}
    numbers = [PartLabel(f"{k + 1}", box.mean(axis=0), look) for k, box in enumerate(boxes)]
    outlines = [plate_polygon(stage.layout).boundary]
    write_labels(ax, numbers, DrawnParts(outlines, list(map(shapely.Polygon, boxes))))
    label_axes(ax)
    return ax


def _draw_stacks(
    ax: Axes,
    boxes: Array,
    stroke: Array,
) -> None:
    """Draw the boxes (n, 4, 2) of stacks with colours by the signs of their strokes (n,)."""
    is_zero = np.abs(stroke) <= ROUND_OFF * np.max(np.abs(stroke))
    sign = np.sign(np.where(is_zero, 0.0, stroke))
    for label, colour, hatch, drawn_sign in STROKE_SIGNS:
        shown = list(boxes[sign == drawn_sign])
        if shown:
            look: dict[str, Any] = {"facecolors": colour, "hatch": hatch, "edgecolors": INK}
            stacks = PolyCollection(shown, label=label, linewidths=0.7, zorder=4, **look)
            ax.add_collection(stacks, autolim=False)


def _draw_mount(
    ax: Axes,
    stage: Stage,
    stack: Stack,
    box: Array,
) -> None:
    """Draw the rear of a stack as clamped to the frame, or its connection with another carrier."""
    carrier = BODY_NAMES[stack.pushes[1].body]
    if carrier == "frame":
        ax.plot(
            *box[2:].T,
            color=INK,
            linewidth=2.4,
            zorder=3.5,
        )
        return
    name = carrier if carrier == "platform" else f"{carrier} of chain {stack.chain + 1}"
    rear = shapely.Point(box[2:].mean(axis=0))
    mount = shapely.get_coordinates(shapely.shortest_line(rear, _body(stage, name)))
    ax.plot(
        *mount.T,
        color=GREY,
        linewidth=1.2,
        zorder=3.5,
    )


def _draw_forces(
    ax: Axes,
    contacts: Array,
    along: Array,
    force: Array,
) -> None:
    """Draw forces (n,) at contacts (n, 2) along vectors (n, 2) that are as long as a link is wide."""
    largest = np.max(np.abs(force))
    shaft = LONGEST_ARROW * along * force[:, None] / (largest or 1.0)
    label = f"force on the pushed body, up to {largest:.4g} {FORCES[0]}"
    scaled: dict[str, Any] = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1.0,
        "width": 0.004,
    }
    ax.quiver(*contacts.T, *shaft.T, color=NOTE_COLOUR, label=label, zorder=6, **scaled)


def _draw_moved_platform(ax: Axes, found: StageDrive) -> None:
    """Draw the outline of the platform at the pose, with exaggerated displacements."""
    x, y, theta = (platform_factor(found) * found.pose).tolist()
    c = np.cos(theta)
    s = np.sin(theta)
    turned = np.array([[c, s], [-s, c]])
    rings = shapely.get_parts(_body(found.fields, "platform").boundary)
    moved = [shapely.get_coordinates(ring) @ turned + [x, y] for ring in rings]
    look: dict[str, Any] = {"colors": MOVED, "linewidths": 1.4, "linestyles": "dashed"}
    outline = LineCollection(moved, zorder=5, label="platform at the pose", **look)
    ax.add_collection(outline, autolim=False)


def platform_factor(found: StageDrive) -> float:
    """Return the round factor by which the platform's displacement is drawn; 1 without one."""
    x, y, theta = found.pose
    stage = found.fields
    rim = shapely.get_coordinates(_body(stage, "platform"))
    largest = float(np.max(np.hypot(x - theta * rim[:, 1], y + theta * rim[:, 0])))
    if largest == 0:
        return 1.0
    return round_factor(VISIBLE * extent(plate_polygon(stage.layout)) / largest)


def _body(stage: Stage, name: str) -> Any:
    """Return the shape of a body, mm."""
    return body_polygon(stage.layout, [body.name for body in stage.layout.bodies].index(name))


def stack_ends(stage: Stage) -> Array:
    """Return contact points, mm, and unit force directions of the n stacks of a stage, (2, n, 2)."""
    stacks = drive_of(stage).stacks
    turns = CHAIN_TURN * np.array([stack.chain for stack in stacks])
    points = np.array([[stack.point, stack.direction] for stack in stacks]).T * np.exp(1j * turns)
    return np.stack([points.real, points.imag], axis=-1)


def _box(
    contact: Array,
    along: Array,
    width: float,
) -> Array:
    """Return the corners (4, 2) of a drawn stack: two at its ball, then two at its carrier."""
    aside = STACK_WIDTH / 2 * width * np.array([-along[1], along[0]])
    front = contact - BALL * width * along
    rear = contact - (BALL + STACK_LENGTH) * width * along
    return np.array([front + aside, front - aside, rear - aside, rear + aside])
