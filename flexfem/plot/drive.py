"""Figures of a driven stage: strokes and forces for a pose, reachable poses with their limits,
large displacements.
"""

from __future__ import annotations

from itertools import product
from typing import Any, Literal

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from flexfem.arrays import Array
from flexfem.mechanism.plate import body_polygon, extent, plate_polygon
from flexfem.paper.actuators import BODY_NAMES
from flexfem.paper.drive import StageDrive
from flexfem.paper.drives import drive_of
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.reach import StageReach
from flexfem.paper.stage import Stage
from flexfem.plot import style
from flexfem.plot.plate import draw_plate
from flexfem.plot.stage import fit, place_label
from flexfem.plot.style import COLOURS, GREY, INK, NAMES, NOTE_COLOUR, PALE, titled
from flexfem.plot.text import minus, round_factor, significant
from flexfem.questions.driven import CRITERIA, Criterion
from flexfem.questions.large import EXACT, HELD, LOADED, STEPS, TANGENT, WITHOUT, Large
from flexfem.questions.poses import KINDS
from flexfem.refused import BadInput, printed
from flexfem.units import COMMANDS, DIRECTIONS, FORCES, LENGTH, MICROMETRE, Direction, unit_for

WIDTH = 11.69  # in
ROUND_OFF = 1e-9  # of the largest stroke, pose, or command
STACK_LENGTH = 1.3
STACK_WIDTH = 0.5
BALL = 0.2
LONGEST_ARROW = 0.47  # as drawn, over the link width
STROKE_SIGNS = (
    ("stack extends", "#7FB2DC", "", 1.0),
    ("stack contracts", "#F3D9B1", "////", -1.0),
    ("no stroke", "white", "", 0.0),
)
VISIBLE = 0.06  # largest drawn displacement of the platform over the size of the stage


@style.in_house_style
def command_figure(found: StageDrive) -> Figure:
    """Draw a driven stage at a pose: its stacks, and their strokes and forces by criterion."""
    heights = [min(max(0.27 * n + 0.75, 1.9), 9.0) for n in (len(found.command), len(found.stroke))]
    heights[1] = max(heights[1], 5.8 - heights[0])
    factor = (
        " Dashed: the platform at the pose, displacements × "
        f"{significant(platform_factor(found), 1)}."
    )
    load = f" under a load of {_numbers(found.load, FORCES)}" if np.any(found.load) else ""
    pose = (
        f"Pose {_numbers(found.pose, COMMANDS)}{load}; strokes by {found.settings['strokes by']}."
    )
    lines = [f"{pose}{factor if np.any(found.pose) else ''} Stacks are not drawn to scale."]
    lines += [warning for warning in found.warnings if "this pose" in warning]
    title = f"{found.about.name}: strokes and forces for a pose"
    figure = style.below_header((WIDTH, sum(heights) + 1.2), title, lines, found.about)
    ratios: dict[str, Any] = {"width_ratios": [1.5, 1.0], "height_ratios": heights}
    axes: dict[str, Axes] = figure.subplot_mosaic(
        [["stage", "strokes"], ["stage", "forces"]], **ratios
    )
    titled(plot_strokes(axes["strokes"], found), "b", "strokes of the actuators (numbers: stacks)")
    titled(plot_forces(axes["forces"], found), "c", "forces of the stacks")
    handles = style.handles_of([axes["strokes"], axes["forces"]])
    place: Any = {"loc": "upper center", "frameon": False, "bbox_to_anchor": (0.5, -0.14)}
    axes["forces"].legend(handles.values(), handles.keys(), ncols=3, **place)
    # determines the size of the axes, which the placement of labels needs
    figure.draw_without_rendering()
    titled(
        plot_drive(axes["stage"], found),
        "a",
        f"stage at the pose, strokes and forces of {CRITERIA[0]}",
    )
    axes["stage"].legend(ncols=2, **place)
    return figure


def _numbers(values: Any, units: Any) -> str:
    return minus(
        ", ".join(
            f"{unit.factor * value:.5g} {unit}" for value, unit in zip(values, units, strict=True)
        )
    )


def plot_strokes(ax: Axes, found: StageDrive) -> Axes:
    """Draw the strokes from rest, a bar per actuator and criterion, over the available strokes;
    return `ax`.
    """
    differential = drive_of(found.fields).differential
    low = found.shortest
    high = found.longest
    look: dict[str, Any] = {"height": 0.94, "color": PALE, "edgecolor": GREY, "linewidth": 0.6}
    ax.barh(np.arange(len(low)), high - low, left=low, label="available strokes", **look)
    _bars(ax, dict(zip(found.axes["criterion"], found.command.T, strict=True)))
    stacks = [[str(k + 1) for k in np.flatnonzero(column)] for column in differential.T]
    actuators = zip(found.axes["actuator"], stacks, strict=True)
    _label_rows(ax, [f"{name} ({', '.join(numbers)})" for name, numbers in actuators])
    ax.set_xlabel(f"stroke from rest ({MICROMETRE})")
    return ax


def plot_forces(ax: Axes, found: StageDrive) -> Axes:
    """Draw the forces, a bar per stack and criterion, with preloads and, below, the blocking force;
    return `ax`.
    """
    force = dict(zip(found.axes["criterion"], found.force.T, strict=True))
    preload = found.preload
    blocking = sorted({f"{value:.4g}": value for value in found.blocking_force}.values())
    values = np.concatenate([*force.values(), preload])
    limits = min(0.0, 1.12 * float(values.min())), 1.12 * max(float(values.max()), 1e-9)
    _bars(ax, force)
    ax.plot(
        preload, np.arange(len(preload)), "|", color=INK, markersize=17.0, label="preload", zorder=5
    )
    _label_rows(ax, [f"{k + 1}: {name}" for k, name in enumerate(found.axes["stack"])])
    ends = " to ".join(f"{value:.4g}" for value in dict.fromkeys((blocking[0], blocking[-1])))
    ax.set(
        xlabel=f"force ({FORCES[0]}); limits: 0 and blocking force {ends} {FORCES[0]}", xlim=limits
    )
    return ax


def _bars(ax: Axes, values: dict[Any, Any]) -> None:
    """Draw a group of horizontal bars per row, one for each criterion in `values`."""
    height = 0.8 / len(values)
    for k, (name, value) in enumerate(values.items()):
        index = CRITERIA.index(name)
        rows = np.arange(len(value)) + (k - (len(values) - 1) / 2) * height
        look: Any = {
            "color": COLOURS[index],
            "hatch": style.HATCHES[index],
            "edgecolor": "white",
            "linewidth": 0.4,
        }
        ax.barh(rows, value, height=height, label=name, zorder=3, **look)


def _label_rows(ax: Axes, names: list[str]) -> None:
    style.name_rows(ax, names, 1.6, 8.5 if len(names) <= 24 else 6.0)


def plot_drive(ax: Axes, found: StageDrive, criterion: Criterion = "least energy") -> Axes:
    """Draw a stage, in mm, with its stacks, their strokes and forces, and its platform at the pose.

    Stacks are numbered from 1 as in the record and are not to scale. The arrow at each contact is
    in proportion to the force of the stack; the displacement of the platform is multiplied by
    `platform_factor`. Returns `ax`. Raises BadInput for a criterion without strokes."""
    stage = found.fields
    width = found.fields.chain.link_width
    stroke = found.at("stroke", criterion=criterion)
    force = found.at("force", criterion=criterion)
    contact, along = stack_ends(stage)
    boxes = np.array([_box(*end, width) for end in zip(contact, along, strict=True)])
    rim = draw_plate(ax, stage)
    size = fit(ax, np.concatenate([rim, *boxes]), 0.22)
    sign = np.sign(np.where(np.abs(stroke) > ROUND_OFF * np.max(np.abs(stroke)), stroke, 0.0))
    for label, colour, hatch, drawn_sign in STROKE_SIGNS:
        look: dict[str, Any] = {
            "facecolors": colour,
            "hatch": hatch,
            "edgecolors": INK,
            "linewidths": 0.7,
            "zorder": 4,
        }
        if np.any(sign == drawn_sign):
            ax.add_collection(
                PolyCollection(list(boxes[sign == drawn_sign]), label=label, **look), autolim=False
            )
    ax.plot(*(contact - BALL / 2 * width * along).T, "o", color=INK, markersize=3.0, zorder=5)
    for stack, box in zip(drive_of(stage).stacks, boxes, strict=True):
        carrier = BODY_NAMES[stack.pushes[1].body]
        mount = box[2:]
        rear = box[2:].mean(axis=0)
        if carrier != "frame":
            outline = _body(
                stage, carrier if carrier == "platform" else f"{carrier} of chain {stack.chain + 1}"
            )
            mount = shapely.get_coordinates(shapely.shortest_line(shapely.Point(rear), outline))
        look = (
            {"color": INK, "linewidth": 2.4}
            if carrier == "frame"
            else {"color": GREY, "linewidth": 1.2}
        )
        ax.plot(mount[:, 0], mount[:, 1], zorder=3.5, **look)
    shaft = LONGEST_ARROW * width * along * force[:, None] / (np.max(np.abs(force)) or 1.0)
    label = f"force on the pushed body, up to {np.max(np.abs(force)):.4g} {FORCES[0]}"
    scaled: dict[str, Any] = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1.0,
        "width": 0.004,
        "zorder": 6,
    }
    ax.quiver(*contact.T, *shaft.T, color=NOTE_COLOUR, label=label, **scaled)
    if np.any(found.pose):
        x, y, theta = (platform_factor(found) * found.pose).tolist()
        c = np.cos(theta)
        s = np.sin(theta)
        rings = shapely.get_parts(_body(stage, "platform").boundary)
        moved = [
            shapely.get_coordinates(ring) @ np.array([[c, s], [-s, c]]) + [x, y] for ring in rings
        ]
        look = {
            "colors": "#007A58",
            "linewidths": 1.4,
            "linestyles": "dashed",
            "label": "platform at the pose",
        }
        ax.add_collection(LineCollection(moved, zorder=5, **look), autolim=False)
    obstacles = [shapely.LinearRing(rim), *map(shapely.Polygon, boxes)]
    frame = {
        "boxstyle": "round,pad=0.15",
        "facecolor": "white",
        "edgecolor": GREY,
        "linewidth": 0.5,
    }
    for k, box in enumerate(boxes):
        spot = place_label(
            ax, box.mean(axis=0), f"{k + 1}", obstacles, 0.06 * size, size=7.0, bbox=frame
        )
        ax.plot(*np.transpose([box.mean(axis=0), spot]), color=GREY, linewidth=0.6, zorder=3.2)
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")
    return ax


def platform_factor(found: StageDrive) -> float:
    """Return the round factor that multiplies the platform's displacement in a drawing; 1 when
    there is none.
    """
    x, y, theta = found.pose
    stage = found.fields
    rim = shapely.get_coordinates(_body(stage, "platform"))
    largest = float(np.max(np.hypot(x - theta * rim[:, 1], y + theta * rim[:, 0])))
    return (
        round_factor(VISIBLE * extent(plate_polygon(stage.layout)) / largest)
        if largest > 0
        else 1.0
    )


def _body(stage: Stage, name: str) -> Any:
    """Shape of a body, mm."""
    return body_polygon(stage.layout, [body.name for body in stage.layout.bodies].index(name))


def stack_ends(stage: Stage) -> Array:
    """Contact points, mm, and unit force directions of the n stacks of a stage, (2, n, 2)."""
    stacks = drive_of(stage).stacks
    points = np.array([[stack.point, stack.direction] for stack in stacks]).T
    points = points * np.exp(1j * CHAIN_TURN * np.array([stack.chain for stack in stacks]))
    return np.stack([points.real, points.imag], axis=-1)


def _box(contact: Array, along: Array, width: float) -> Array:
    """Corners (4, 2) of a drawn stack: the two at its ball, then the two at its carrier."""
    aside = STACK_WIDTH / 2 * width * np.array([-along[1], along[0]])
    front = contact - BALL * width * along
    rear = contact - (BALL + STACK_LENGTH) * width * along
    return np.array([front + aside, front - aside, rear - aside, rear + aside])


AZIMUTH = -62.0
ELEVATION = 24.0  # degrees, of the line of sight, from the X axis and from the plane
FILLS = dict(
    zip(KINDS, ("#E4E8EC", "#9DC3E0", "#C9B458", "#D98A6A"), strict=True)
)  # by a face's rarest kind
LIMIT_HATCHES = dict(zip(KINDS, ("", "////", "\\\\\\\\", "...."), strict=True))


@style.in_house_style
def reach_figure(found: StageReach) -> Figure:
    """Draw the reachable poses with the limits that bound them: the section at theta = 0, and the
    solid.
    """
    load = f"load {_numbers(found.load, FORCES)}" if np.any(found.load) else "no load"
    lines = [
        f"Limits: stroke, contact opening, blocking force and yield at the necks; {load}. Model: "
        f"{found.settings['analytic model']}. Largest ball of poses about rest: {found.ball:.4g} "
        f"{MICROMETRE}, with θ as l₃ θ, l₃ = {found.about.lever:g} {LENGTH}."
    ]
    title = f"{found.about.name}: reachable poses within all limits of the drive"
    figure = style.below_header((WIDTH, 5.6), title, lines, found.about)
    section, solid = (
        figure.add_subplot(1, 2, k, projection=projection)
        for k, projection in ((1, None), (2, "3d"))
    )
    titled(plot_section(section, found), "a", "poses at θ = 0")
    titled(plot_solid(solid, found), "b", "all poses")
    return figure


def plot_section(ax: Axes, found: StageReach) -> Axes:
    """Draw the reachable poses at theta = 0, with edges by kind of limit; return `ax`."""
    unit = COMMANDS[0]
    section = found.fields.section
    rest = found.rest[:2]
    ax.set(xlabel=f"X ({unit})", ylabel=f"Y ({unit})", aspect="equal")
    ax.grid()
    ax.plot(*(unit.factor * rest), "+", color=INK, markersize=9.0)
    ax.text(
        float(unit.factor * rest[0]), float(unit.factor * rest[1]), "  rest", va="bottom", color=INK
    )
    if not section:
        ax.text(
            0.5, 0.7, "no reachable area at θ = 0", transform=ax.transAxes, ha="center", color=INK
        )
        return ax
    ends = unit.factor * np.array([(edge.start, edge.end) for edge in section])
    corners = ends[:, 0]
    ax.add_patch(Polygon(list(corners), facecolor=FILLS["stroke"], edgecolor="none", zorder=1))
    for index, kinds in enumerate(_sorted_kinds({edge.by.kinds for edge in section})):
        lines = [line for line, edge in zip(ends, section, strict=True) if edge.by.kinds == kinds]
        dashes = style.DASHES[index % len(style.DASHES)]
        look: Any = {"linestyles": dashes, "colors": INK, "linewidths": 2.2 - 0.3 * (index % 3)}
        ax.add_collection(
            LineCollection(lines, label=" and ".join(kinds) or "no limit", zorder=3, **look)
        )
    if found.circle > 0:
        x, y = unit.factor * rest
        radius = float(found.circle)
        ax.add_patch(Circle((x, y), radius, fill=False, edgecolor=GREY, linewidth=0.9))
        text = f"largest circle about rest\nradius {radius:.4g} {unit}"
        ax.text(x, y - 0.75 * radius, text, ha="center", va="center", color=GREY)
    ax.margins(0.08)
    ax.legend(
        loc="upper left",
        bbox_to_anchor=(1.02, 1.0),
        frameon=False,
        title="limited by",
        alignment="left",
    )
    return ax


def _sorted_kinds(combinations: set[tuple[str, ...]]) -> list[tuple[str, ...]]:
    return sorted(combinations, key=lambda kinds: [KINDS.index(kind) for kind in reversed(kinds)])


def plot_solid(ax: Any, found: StageReach) -> Any:
    """Draw all reachable poses as a solid on axes of projection 3d, with faces by kind of limit;
    return `ax`.

    The projection is orthographic; rotations are scaled by l3.
    """
    solid = found.fields
    factors = np.array([unit.factor for unit in COMMANDS])
    corners = factors * solid.vertices
    axes = zip((ax.xaxis, ax.yaxis, ax.zaxis), NAMES.values(), COMMANDS, strict=True)
    for axis, name, unit in axes:
        axis.set_label_text(f"{name} ({unit})")
        axis.labelpad = 8.0
    ax.set_proj_type("ortho")
    ax.view_init(ELEVATION, AZIMUTH)
    if not solid.faces:
        ax.text2D(
            0.5,
            0.7,
            "the reachable poses have no volume",
            transform=ax.transAxes,
            ha="center",
            color=INK,
        )
        return ax
    low = corners.min(axis=0)
    high = corners.max(axis=0)
    ax.set(
        **{
            f"{which}lim": ends
            for which, ends in zip("xyz", np.transpose([low, high]), strict=True)
        }
    )
    ax.locator_params(nbins=5)
    ax.set_box_aspect((high - low) / factors * [1.0, 1.0, found.about.lever], zoom=0.85)
    elevation, azimuth = np.deg2rad([ELEVATION, AZIMUTH])
    eye = [
        np.cos(azimuth) * np.cos(elevation),
        np.sin(azimuth) * np.cos(elevation),
        np.sin(elevation),
    ]
    visible = solid.normals @ np.array(eye) > 0
    handles = list[Patch]()
    for kinds in _sorted_kinds({by.kinds for by in solid.by}):
        fill = FILLS[kinds[-1]] if kinds else "white"
        hatch = "".join(LIMIT_HATCHES[kind] for kind in kinds)
        look: dict[str, Any] = {
            "facecolor": fill,
            "edgecolor": INK,
            "linewidth": 0.9,
            "hatch": hatch,
        }
        faces = zip(solid.faces, solid.by, visible, strict=True)
        polygons = [corners[list(face)] for face, by, shown in faces if shown and by.kinds == kinds]
        ax.add_collection3d(Poly3DCollection(polygons, **look))
        handles.append(Patch(label=" and ".join(kinds), **look))
    place: Any = {"loc": "upper right", "alignment": "left", "frameon": False}
    ax.legend(handles=handles, handleheight=1.4, title="limited by", **place)
    return ax


COLUMNS: dict[Any, str] = {
    "tangent": "tangent stiffness",
    "along": "error of (18) along the command",
    "across": "error of (18) across the command",
}
MARKS: Any = {
    "linestyle": "none",
    "markerfacecolor": "none",
    "markersize": 7.5,
    "markeredgewidth": 1.4,
    "zorder": 4,
}
THEORIES: dict[int, tuple[str, dict[str, Any]]] = {
    WITHOUT: (
        "(16) without its second-order terms",
        {"color": COLOURS[1], "dashes": (5, 2), "linewidth": 1.9},
    ),
    TANGENT: ("(16)", {"color": COLOURS[0], "linewidth": 2.6}),
    EXACT: (
        "exact equilibrium",
        {"color": INK, "linestyle": "none", "marker": ".", "markevery": 4},
    ),
    HELD: ("finite elements held at the command", MARKS | {"marker": "s", "color": COLOURS[2]}),
    LOADED: (
        "finite elements under the load of exact equilibrium",
        MARKS | {"marker": "v", "color": COLOURS[3]},
    ),
}


@style.in_house_style
def large_figure(found: Large) -> Figure:
    """Draw tangent stiffness and errors of linear theory over the command, one row per direction.

    Every model is compared with its own linear solution, so that all curves pass through zero at
    rest."""
    settings = found.settings
    ends = [(COMMANDS[k], float(found.amplitude[k])) for k in (0, 2)]  # x, theta
    near, far = (
        " and ".join(f"±{unit.factor * share * end:g} {unit}" for unit, end in ends)
        for share in (0.1, 1.0)
    )
    mesh = (
        f", and nonlinear finite elements ({settings['unknowns']} unknowns)"
        if "unknowns" in settings
        else ""
    )
    lines = [
        f"Pseudo-rigid stage of mobility {settings['mobility']}, {settings['formula']}{mesh}; "
        "each model is compared with its own linear solution, (18). Error: displacement by (18) "
        "under the load that holds the stage at the command, minus the command. Rotations are "
        "multiplied by l₃.",
        f"Largest error of (18) within {near}: {found.position[0]:.2f} %, within {far}: "
        f"{found.position[1]:.2f} %. The second-order terms change the tangent compliance there "
        f"by up to {found.terms[0]:.2f} and {found.terms[1]:.2f} %.",
    ]
    title = f"{found.about.name}: large displacements and the second-order terms of (16)"
    figure, axes = style.panels((WIDTH, 8.5), title, lines, 3, 3, found.about)
    for ax, letter, (direction, column) in zip(
        axes, "abcdefghi", product(DIRECTIONS, COLUMNS), strict=True
    ):
        titled(
            plot_large(ax, found, direction, column),
            letter,
            f"{NAMES[direction]}: {COLUMNS[column]}",
        )
    style.legend_below(figure, axes[1:2], 3, fontsize=9.5, handlelength=3.6)
    return figure


def plot_large(
    ax: Axes,
    found: Large,
    direction: Direction,
    column: Literal["tangent", "along", "across"] = "tangent",
) -> Axes:
    """Draw one quantity of every model over the command in one direction; return `ax`.

    `column` : the change of the tangent stiffness, or the error of linear theory along or across
    the command."""
    if column not in COLUMNS:
        raise BadInput(f"column {printed(column)}, expected one of: {', '.join(COLUMNS)}")
    amplitude = float(found.at("amplitude", direction=direction))
    across = column == "across"
    unit = unit_for(direction, amplitude)
    commanded = unit.factor * amplitude * np.arange(-STEPS, STEPS + 1) / STEPS
    ax.set(xlabel=f"commanded {NAMES[direction]} ({unit})")
    ax.set_ylabel("change from rest (%)" if column == "tangent" else "error (% of the command)")
    ax.axhline(0.0, color=GREY, linewidth=1.1, zorder=1, label="linear theory, (18)")
    ax.grid()
    components = [component for component in DIRECTIONS if (component != direction) == across]
    values = [
        found.at("errors", direction=direction, component=component) for component in components
    ]
    if column == "tangent":
        values = [found.at("tangent", direction=direction)]
    for curves, (theory, (label, look)) in product(values, THEORIES.items()):
        known = np.isfinite(curves[:, theory])
        if known.any() and not (across and theory == LOADED):
            ax.plot(commanded[known], curves[known, theory], label=label, **look)
    if not across:
        return ax
    if max(np.max(np.abs(curves[:, EXACT])) for curves in values) < ROUND_OFF:
        ax.clear()
        ax.set_axis_off()
        ax.text(
            0.5,
            0.5,
            "zero (round-off)",
            transform=ax.transAxes,
            ha="center",
            va="center",
            color=INK,
            size=10,
        )
        return ax
    last = np.array([curves[-1, EXACT] for curves in values])
    close = np.ptp(last) < 0.1 * np.ptp(ax.get_ylim())
    text: dict[str, Any] = {"textcoords": "offset points", "va": "center", "size": 9.5}
    for component, end in zip(components, last.tolist(), strict=True):
        up = 6.0 * np.sign(end - last.mean()) if close else 0.0
        ax.annotate(f"in {NAMES[component]}", (float(commanded[-1]), end), (7, up), **text)
    ax.set_xlim(right=1.4 * float(commanded[-1]))
    return ax
