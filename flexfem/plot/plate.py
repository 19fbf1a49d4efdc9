"""Drawings of a mechanism: its bodies, ground, hinges, points, actuators and payload, to scale."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, PathPatch, Wedge
from matplotlib.path import Path

from flexfem.arrays import Array
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import body_polygon, joint_polygon
from flexfem.mechanism.stage import Stage
from flexfem.plot import stage, style
from flexfem.plot.fields import RIGID, ROUND_OFF, displaced, plane_fields
from flexfem.plot.stage import WHITE_BOX, arrow, fit, frame_cross, label_axes, place_label, scale_bar, xy
from flexfem.plot.style import INK, NAMES, NOTE_COLOUR, PALE, below_header, in_house_style, new_axes, page
from flexfem.plot.text import significant
from flexfem.questions.setup import MeshFields
from flexfem.results import Result
from flexfem.study.findings import Caption
from flexfem.units import LENGTH, STRESS

HINGE, DRIVE, MASS = "#C25500", "#0072B2", "#007A58"
HATCH = "#9AA2AB"
CROSS = 0.07  # length of the axes at the output relative to the size
MANY = 40  # labels above which they are small
WIDTH, LOWEST, HIGHEST = 8.27, 3.0, 9.0  # in, of a page and of the drawing on it
COLUMNS, CELL_HEIGHT = 4, 1.5  # drawings per row below a front, height of each, in


class Mark(NamedTuple):
    """A label of a drawing: its text, the point (2,) that it belongs to, its colour, and the polygon of a body."""

    text: str
    at: Array
    colour: str
    body: Any = None


def plot_mechanism(ax: Axes | None, mechanism: Mechanism) -> Axes:
    """Draw a mechanism to scale, in mm, with the names of its parts and a scale bar; return `ax`, or new axes.

    Labels are placed for the size of `ax` at the time of the call.
    """
    ax, layout = ax or new_axes(), mechanism.layout
    rim, output = draw_plate(ax, mechanism), layout.points[0][1].point
    visible = [contact.point for _, contact in layout.points] + [z.point for a in layout.actuators for z in a.contacts]
    visible.append(output + CROSS * (1 + 1j) * float(np.max(np.ptp(rim, axis=0))))
    size = fit(ax, np.vstack([rim, *map(xy, visible)]), 0.07)
    scale_bar(ax)
    bodies = _bodies(layout)
    obstacles: list[Any] = [_plate(layout).boundary]
    _draw_ports(ax, layout, size, obstacles)
    marks = [*_marks(layout, bodies)]
    obstacles += [shapely.Point(mark.at).buffer(0.01 * size) for mark in marks if mark.body is None]
    letters = 7.0 if len(marks) > MANY else 8.0
    for mark in marks:
        look: dict[str, Any] = {"style": "normal" if mark.body is None else "italic", "bbox": WHITE_BOX}
        near = place_label(ax, mark.at, mark.text, obstacles, 0.035 * size, colour=mark.colour, size=letters, **look)
        if mark.body is None or not shapely.contains_xy(mark.body, *near):
            ax.plot(*np.transpose([mark.at, near]), color=mark.colour, linewidth=0.5, zorder=6)
    label_axes(ax)
    return ax


def _bodies(layout: Layout) -> list[Any]:
    return [body_polygon(layout, k, refuse=False) for k in range(len(layout.bodies))]


def _plate(layout: Layout) -> Any:
    return shapely.union_all([*_bodies(layout), *map(joint_polygon, layout.joints)], grid_size=1e-6)


def draw_plate(ax: Axes, design: Stage | Mechanism) -> Array:
    """Draw bodies, ground, hinges and clamped edges without names; return points (n, 2) of the outline, mm."""
    if isinstance(design, Stage):
        return stage.draw_outline(ax, design)
    layout = design.layout
    for body, polygon in zip(layout.bodies, _bodies(layout), strict=True):
        _fill(ax, polygon, RIGID if body.fixed else PALE, "////" if body.fixed else "")
        lines = [[xy(body.outline[k].start), xy(body.outline[k].end)] for k in body.clamped]
        ax.add_collection(LineCollection(lines, colors=INK, linewidths=2.8, zorder=4), autolim=False)
    for joint in layout.joints:
        _fill(ax, joint_polygon(joint), HINGE)
    plate = _plate(layout)
    ax.add_patch(PathPatch(_path(plate), facecolor="none", edgecolor=INK, linewidth=0.8, zorder=3))
    return np.asarray(shapely.get_coordinates(plate))


def _marks(layout: Layout, bodies: list[Any]) -> Iterator[Mark]:
    """Yield the labels, those with the least freedom of place first."""
    for joint in layout.joints:
        yield Mark(joint.name, np.array(xy(joint.place)), HINGE)
    for actuator in layout.actuators:
        near, far = (contact.point for contact in actuator.contacts)
        yield Mark(actuator.name, np.array(xy((near + far) / 2)), DRIVE)
    for name, contact in layout.points:
        yield Mark(name, np.array(xy(contact.point)), NOTE_COLOUR)
    for payload in layout.payloads:
        yield Mark(f"payload {1e6 * payload.mass:.6g} g", np.array(xy(payload.contact.point)), MASS)
    for body, polygon in zip(layout.bodies, bodies, strict=True):
        yield Mark(body.name, shapely.get_coordinates(shapely.point_on_surface(polygon))[0], "#404040", polygon)


def _draw_ports(ax: Axes, layout: Layout, size: float, obstacles: list[Any]) -> None:
    """Draw hinge centres, points, actuators and payloads; append what labels must avoid."""
    for joint in layout.joints:
        ax.plot(*xy(joint.place), "o", color=HINGE, markersize=4, markerfacecolor="white", zorder=5)
    for actuator in layout.actuators:
        ends = [contact.point for contact in actuator.contacts]
        half = max(abs(ends[1] - ends[0]), 0.03 * size) / 2 * actuator.direction
        tips = [sum(ends) / 2 - half, sum(ends) / 2 + half]
        arrow(ax, xy(tips[0]), xy(tips[1]), "<|-|>", DRIVE, 1.8)
        for contact, tip in zip(actuator.contacts, tips, strict=True):
            if contact.body < 0:  # on the ground outside the plate
                wall = [xy(tip + side * 0.02j * size * actuator.direction) for side in (-1, 1)]
                ax.plot(*np.transpose(wall), color=INK, linewidth=2.8, zorder=6)
        obstacles.append(shapely.LineString([xy(tip) for tip in tips]))
    for payload in layout.payloads:
        at, radius = xy(payload.contact.point), 0.018 * size
        ax.add_patch(Circle(at, radius, facecolor="white", edgecolor=MASS, linewidth=1.2, zorder=5))
        for first in (0, 180):
            ax.add_patch(Wedge(at, radius, first, first + 90, facecolor=MASS, zorder=5.1))
    for _, contact in layout.points[1:]:
        ax.plot(*xy(contact.point), "+", color=NOTE_COLOUR, markersize=9, markeredgewidth=1.5, zorder=6)
    output = layout.points[0][1].point
    frame_cross(ax, CROSS * size, output)
    obstacles.append(shapely.LineString([xy(output + 0.09j * size), xy(output), xy(output + 0.09 * size)]))


def _fill(ax: Axes, polygon: Any, colour: str, hatch: str = "") -> None:
    ax.add_patch(PathPatch(_path(polygon), facecolor=colour, edgecolor=HATCH, hatch=hatch, linewidth=0.0, zorder=1.5))


def _path(shape: Any) -> Path:
    """Path of one or several polygons with holes."""
    rings = [ring for part in shapely.get_parts(shape) for ring in (part.exterior, *part.interiors)]
    return Path.make_compound_path(*(Path(ring.coords, closed=True) for ring in rings))


@in_house_style
def mechanism_figure(mechanism: Mechanism) -> Figure:
    """Draw a page with a mechanism, and in its header its data and the meaning of the marks."""
    layout = mechanism.layout
    marks = {
        "hatched: fixed": any(body.fixed for body in layout.bodies),
        "heavy lines: clamped": any(body.clamped for body in layout.bodies),
        "orange: hinges": True,
        "blue: actuators": bool(layout.actuators),
    }
    key = "; ".join(text for text, there in marks.items() if there)
    facts = f"Thickness {layout.thickness:.6g} {LENGTH}; {mechanism.material.name}."
    lines = [facts, f"{key.capitalize()}; X, Y: output."]
    outlines = shapely.get_coordinates(_bodies(layout))
    wide, high = np.ptp(outlines, axis=0) + 0.14 * np.ptp(outlines, axis=0).max()
    height = float(np.clip((WIDTH - 0.6) * high / wide, LOWEST, HIGHEST)) + 0.5
    plot = partial(plot_mechanism, mechanism=mechanism)
    return page((WIDTH, height), f"{mechanism.name}: drawing", lines, plot, mechanism)


def front_page(
    caption: Caption, plane: Callable[[Axes], object], designs: Sequence[Stage | Mechanism], rows: list[list[str]]
) -> Figure:
    """Draw a front and, below it, designs to one scale and the table of their numbers; its first column names them."""
    widths = [0.75, *[(WIDTH - 1.35) / max(len(rows[0]) - 1, 1)] * (len(rows[0]) - 1)]
    lines = -(-len(designs) // COLUMNS)
    heights = [5.0, *[CELL_HEIGHT] * lines, sum(style.fitted(rows, widths)[1])][: 2 * lines + 1]
    cells = [[f"{k}" if k < len(designs) else "." for k in range(COLUMNS * n, COLUMNS * (n + 1))] for n in range(lines)]
    mosaic: list[Any] = [["front"] * COLUMNS, *cells, ["table"] * COLUMNS][: len(heights)]
    figure = below_header((WIDTH, sum(heights) + 0.3), caption.title, caption.lines, caption)
    axes = figure.subplot_mosaic(mosaic, height_ratios=heights)
    plane(axes["front"])
    drawings = [axes[f"{k}"] for k in range(len(designs))]
    outlines = list(map(draw_plate, drawings, designs))
    for ax, (name, *_) in zip(drawings, rows[1:], strict=True):
        ax.set_title(name, weight="bold")
        ax.set_axis_off()
    if designs:
        stage.fit_to_one_scale(drawings, np.vstack(outlines))
        style.table(axes["table"], rows, widths)
    return figure


@in_house_style
def load_figure(found: Result) -> Figure:
    """Draw a mechanism displaced by a load on its output, coloured by von Mises stress."""
    assert isinstance(found.fields, MeshFields)
    model = found.axes["model"][-1]
    force, stress = found.at("force", model=model), found.at("hinge_stress", model=model)
    force = np.where(np.abs(force) > ROUND_OFF * found.sizes("force")[-1], force, 0.0)
    load = zip(NAMES.values(), force.tolist(), ("N", "N", "N mm"), strict=True)
    parts = ", ".join(f"{name} {significant(value)} {unit}" for name, value, unit in load)
    worst = f"up to {significant(float(np.max(stress)))} {STRESS} at hinge {found.axes['hinge'][int(stress.argmax())]}"
    fields, lines = plane_fields(found.fields), [f"Load on the output {parts}: {worst}. Displacements"]
    title = f"{found.about.name}: stress under a load"
    return displaced(title, lines, {"": fields}, 1, found.about, WIDTH - 0.3)[0]
