"""Drawings of a stage or mechanism: bodies, ground, hinges, dimensions, points, actuators and
payload, to scale.
"""

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
from flexfem.mechanism.dimensions import Span
from flexfem.mechanism.layout import Body, Joint, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.plate import body_polygon, extent, joint_polygon, plate_polygon
from flexfem.paper.stage import Stage
from flexfem.plot import style
from flexfem.plot.fields import RIGID, ROUND_OFF, displaced, plane_fields
from flexfem.plot.stage import (
    DIMENSION,
    HUB,
    WHITE_BOX,
    arrow,
    fit,
    fit_to_one_scale,
    frame_cross,
    label_axes,
    place_label,
    scale_bar,
    write,
    xy,
)
from flexfem.plot.style import (
    INK,
    NAMES,
    NOTE_COLOUR,
    PALE,
    below_header,
    in_house_style,
    new_axes,
    page,
)
from flexfem.plot.text import minus, significant
from flexfem.questions.setup import MeshFields
from flexfem.results import Result
from flexfem.study.findings import Caption
from flexfem.units import DEGREE, LENGTH, STRESS

OTHER_MATERIAL = ".."  # hatch of parts that have a material of their own
HINGE = "#C25500"
DRIVE = "#0072B2"
MASS = "#007A58"
HATCH = "#9AA2AB"
DRAWN = "#56B4E9"  # contour of a drawing
ALONG_EDGE = np.linspace(0, 1, 33)  # points of a clamped edge, per length
COARSE = 2e-4  # deviation of a drawn polygon, per extent
CROSS = 0.07  # length of the axes at the output relative to the size
MOST_MISSING = 4  # in the header of an unfinished drawing
MANY = 40  # labels above which they are small
WIDTH = 8.27
LOWEST = 3.0
HIGHEST = 9.0  # in, of a page and of the drawing on it
SMALLEST = 5.2
LABEL_AREA = 1.5  # width of a small drawing, in, and its area for each label, in^2
COLUMNS = 4
CELL_HEIGHT = 1.5  # drawings per row below a front, height of each, in


class Mark(NamedTuple):
    """A label of a drawing: its text, the point (2,) that it belongs to, its colour, and the
    polygon of a body.
    """

    text: str
    at: Array
    colour: str
    body: Any = None


class Recognised(NamedTuple):
    """What a mechanism was recognised in: the polygon of a drawing, and thin parts of it that are
    no hinges.
    """

    drawn: Any
    slender: Sequence[Any]


def plot_plate(
    ax: Axes | None,
    plate: Mechanism,
    *,
    labels: bool = True,
    layout: Layout | None = None,
    recognised: Recognised | None = None,
) -> Axes:
    """Draw a stage or a mechanism to scale, in mm, with a scale bar; return `ax`, or new axes.

    labels : whether to write the dimensions of a stage and the names of the parts of a mechanism,
    which are placed for the size of `ax` at the time of the call.   layout : parts of a stage that
    cannot be made, which are named.
    recognised : the drawing, whose contour is below the plate and whose thin parts are red; the
    hinges that the file describes are then labelled with their dimensions."""
    ax = ax or new_axes()
    stage = plate if isinstance(plate, Stage) and layout is None else None
    layout = layout or plate.layout
    rim = draw_plate(ax, plate, layout)
    shape = plate_polygon(layout)
    spans = stage.spans(layout) if stage else []
    visible = [contact.point for _, contact in layout.points] + [
        z.point for a in layout.actuators for z in a.contacts
    ]
    visible += [end for span in spans for end in span.line]
    if recognised is not None:
        _draw_recognised(ax, recognised)
    visible += [point.point + CROSS * (1 + 1j) * extent(shape) for _, point in layout.points[:1]]
    size = fit(ax, np.vstack([rim, *map(xy, visible if labels else ())]), 0.07)
    scale_bar(ax)
    label_axes(ax)
    if not labels:
        return ax
    obstacles: list[Any] = [shape.boundary]
    _draw_ports(ax, layout, size, obstacles)
    _draw_spans(ax, spans, obstacles)
    marks = [*_marks(layout)]
    if recognised is not None and isinstance(plate, MechanismFile):
        marks = [_with_dimensions(mark, plate, layout) for mark in marks]
    if stage:
        marks = [
            Mark(text, np.array(xy(anchor)), DIMENSION) for text, anchor in stage.callouts(layout)
        ]
    obstacles += [shapely.Point(mark.at).buffer(0.01 * size) for mark in marks if mark.body is None]
    letters = 7.0 if len(marks) > MANY else 8.0
    for mark in marks:
        look: dict[str, Any] = {
            "style": "normal" if mark.body is None else "italic",
            "bbox": WHITE_BOX,
        }
        near = place_label(
            ax,
            mark.at,
            mark.text,
            obstacles,
            0.035 * size,
            colour=mark.colour,
            size=letters,
            **look,
        )
        if mark.body is None or not shapely.contains_xy(mark.body, *near):
            ax.plot(*np.transpose([mark.at, near]), color=mark.colour, linewidth=0.5, zorder=6)
    return ax


def draw_plate(ax: Axes, plate: Mechanism, layout: Layout | None = None) -> Array:
    """Draw bodies, ground, hinges, clamped edges and the hub of a stage without names.

    Returns points (n, 2) of the outline, mm. Raises BadInput when the parts cannot be drawn.
    """
    layout = layout or plate.layout
    for number, body in enumerate(layout.bodies):
        polygon = body_polygon(layout, number, refuse=False)
        other = OTHER_MATERIAL if body.material else ""
        _fill(ax, polygon, RIGID if body.fixed else PALE, "////" if body.fixed else other)
        lines = [[xy(z) for z in body.outline[k].at(ALONG_EDGE).tolist()] for k in body.clamped]
        ax.add_collection(
            LineCollection(lines, colors=INK, linewidths=2.8, zorder=4), autolim=False
        )
    for joint in layout.joints:
        _fill(ax, joint_polygon(joint), HINGE, OTHER_MATERIAL if joint.material else "")
    if isinstance(plate, Stage):
        ax.add_patch(
            Circle(
                (0, 0),
                plate.platform.hub_radius,
                facecolor=HUB,
                edgecolor=INK,
                linewidth=0.6,
                zorder=2.5,
            )
        )
    shape = plate_polygon(layout)
    ax.add_patch(PathPatch(_path(shape), facecolor="none", edgecolor=INK, linewidth=0.8, zorder=3))
    return np.asarray(shapely.get_coordinates(shape))


def _draw_spans(ax: Axes, spans: Sequence[Span], obstacles: list[Any]) -> None:
    """Draw dimension lines with their texts; append what labels must avoid."""
    for span in spans:
        start, end = span.line
        arrow(ax, xy(start), xy(end), "<|-|>", DIMENSION, 0.8)
        for line in ((span.start, start), (span.end, end)):
            ax.plot(*np.transpose([xy(z) for z in line]), color=DIMENSION, linewidth=0.5, zorder=6)
        middle = xy((start + end) / 2)
        turn = float(np.rad2deg(np.angle(end - start)))
        write(ax, middle, span.text, DIMENSION, 8.0, rotation=turn, bbox=WHITE_BOX)
        obstacles.append(shapely.LineString([xy(start), xy(end)]))


def _marks(layout: Layout) -> Iterator[Mark]:
    """Yield the labels, those with the least freedom of place first."""
    for joint in layout.joints:
        yield Mark(_named(joint), np.array(xy(joint.place)), HINGE)
    for actuator in layout.actuators:
        near, far = (contact.point for contact in actuator.contacts)
        yield Mark(actuator.name, np.array(xy((near + far) / 2)), DRIVE)
    for name, contact in layout.points:
        yield Mark(name, np.array(xy(contact.point)), NOTE_COLOUR)
    for payload in layout.payloads:
        yield Mark(f"payload {1e6 * payload.mass:.6g} g", np.array(xy(payload.contact.point)), MASS)
    for number, body in enumerate(layout.bodies):
        polygon = body_polygon(layout, number, refuse=False)
        yield Mark(
            _named(body),
            shapely.get_coordinates(shapely.point_on_surface(polygon))[0],
            "#404040",
            polygon,
        )


def _named(part: Body | Joint) -> str:
    """Return the name of a part, and of its material if it has its own."""
    return part.name if part.material is None else f"{part.name} ({part.material.name})"


def _draw_recognised(ax: Axes, recognised: Recognised) -> None:
    """Draw the contour of a drawing below the plate, and thin parts that are no hinges in red above
    it.
    """
    contour: dict[str, Any] = {
        "facecolor": "none",
        "edgecolor": DRAWN,
        "linewidth": 3.0,
        "zorder": 2.9,
    }
    ax.add_patch(PathPatch(_path(recognised.drawn), **contour))
    for polygon in recognised.slender:
        _fill(ax, polygon, NOTE_COLOUR, zorder=3.1)


def _with_dimensions(mark: Mark, plate: Mechanism, layout: Layout) -> Mark:
    """Return the label of a hinge that the file describes with its neck and length; any other label
    as it is.
    """
    described = {hinge.name for hinge in plate.hinge}
    for joint in layout.joints:
        if mark.body is None and mark.text == joint.name and joint.name in described:
            size = f"{joint.profile.neck:.6g} x {joint.profile.length:.6g}"
            return mark._replace(text=f"{joint.name}: {size}")
    return mark


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
        at = xy(payload.contact.point)
        radius = 0.018 * size
        ax.add_patch(Circle(at, radius, facecolor="white", edgecolor=MASS, linewidth=1.2, zorder=5))
        for first in (0, 180):
            ax.add_patch(Wedge(at, radius, first, first + 90, facecolor=MASS, zorder=5.1))
    if not layout.points:  # of an unfinished file
        return
    for _, contact in layout.points[1:]:
        ax.plot(
            *xy(contact.point), "+", color=NOTE_COLOUR, markersize=9, markeredgewidth=1.5, zorder=6
        )
    output = layout.points[0][1].point
    frame_cross(ax, CROSS * size, output)
    obstacles.append(
        shapely.LineString([xy(output + 0.09j * size), xy(output), xy(output + 0.09 * size)])
    )


def _fill(ax: Axes, polygon: Any, colour: str, hatch: str = "", zorder: float = 1.5) -> None:
    look: dict[str, Any] = {"edgecolor": HATCH, "hatch": hatch, "linewidth": 0.0, "zorder": zorder}
    ax.add_patch(PathPatch(_path(polygon), facecolor=colour, **look))


def _path(shape: Any) -> Path:
    """Path of one or several polygons with holes, with few points, to keep vector files small."""
    parts = shapely.get_parts(shapely.simplify(shape, COARSE * extent(shape)))
    rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
    return Path.make_compound_path(*(Path(ring.coords, closed=True) for ring in rings))


@in_house_style
def drawing_figure(
    plate: Mechanism,
    layout: Layout | None = None,
    small: bool = False,
    missing: Sequence[str] = (),
    recognised: Recognised | None = None,
) -> Figure:
    """Draw a page as `plot_plate`, and in its header data of the plate and the meaning of the
    marks.

    small : as small as the labels allow, so that they are legible on narrow screens.
    missing : what an unfinished file lacks, which the header names instead of the data.
    recognised : the drawing in which the plate was recognised.
    """
    drawn = layout or plate.layout
    facts = [f"thickness {drawn.thickness:.6g} {LENGTH}", plate.material.name]
    marks = {
        "hatched: fixed": any(body.fixed for body in drawn.bodies),
        "heavy lines: clamped": any(body.clamped for body in drawn.bodies),
        "orange: hinges": bool(drawn.joints),
        "dotted: another material": drawn.mixed,
        "blue: actuators": bool(drawn.actuators),
        "disc: the hub, rigid in the models": isinstance(plate, Stage),
        "X, Y: output": bool(drawn.points),
        "light blue: the drawing": recognised is not None,
        "red: thin parts that are no hinges": recognised is not None and bool(recognised.slender),
    }
    key = "; ".join(text for text, there in marks.items() if there)
    if isinstance(plate, Stage):
        angles = minus(", ".join(f"{angle:.6g}" for angle in np.rad2deg(plate.chain.joint_angles)))
        facts += [
            f"link width {plate.chain.link_width:.6g} {LENGTH}",
            f"joint angles {angles} {DEGREE}",
        ]
        if layout is not None:
            key = (
                "The stage cannot be made. Strips between the hinges stand for links that cannot "
                "be drawn"
            )
        elif plate.chains_alike:
            key += (
                "; hinges are labelled on chain 1: chains 2 and 3 are the same, turned by 120 "
                "and 240 degrees"
            )
    wide, high = np.ptp(np.reshape(shapely.total_bounds(plate_polygon(drawn)), (2, 2)), axis=0)
    room = 0.14 * max(wide, high)
    width = WIDTH
    if small:
        parts = 0 if isinstance(plate, Stage) else len([*_marks(drawn)])
        width = float(np.clip(np.sqrt(LABEL_AREA * parts * wide / high), SMALLEST, WIDTH))
    height = (
        float(
            np.clip((width - 0.6) * (high + room) / (wide + room), LOWEST * width / WIDTH, HIGHEST)
        )
        + 0.5
    )
    plot = partial(plot_plate, plate=plate, layout=layout, recognised=recognised)
    if missing:
        more = f" and {len(missing) - MOST_MISSING} more" * (len(missing) > MOST_MISSING)
        facts = [f"unfinished: {'; '.join(missing[:MOST_MISSING])}{more}"]
    lines = [f"{text[:1].upper()}{text[1:]}." for text in ("; ".join(facts), key) if text]
    return page((width, height), f"{plate.name}: drawing", lines, plot, plate)


def front_page(
    caption: Caption,
    plane: Callable[[Axes], object],
    designs: Sequence[Mechanism],
    rows: list[list[str]],
) -> Figure:
    """Draw a front and, below it, designs to one scale and the table of their numbers; its first
    column names them.
    """
    widths = [0.75, *[(WIDTH - 1.35) / max(len(rows[0]) - 1, 1)] * (len(rows[0]) - 1)]
    lines = -(-len(designs) // COLUMNS)
    heights = [5.0, *[CELL_HEIGHT] * lines, sum(style.fitted(rows, widths)[1])][: 2 * lines + 1]
    cells = [
        [f"{k}" if k < len(designs) else "." for k in range(COLUMNS * n, COLUMNS * (n + 1))]
        for n in range(lines)
    ]
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
        fit_to_one_scale(drawings, np.vstack(outlines))
        style.table(axes["table"], rows, widths)
    return figure


@in_house_style
def load_figure(found: Result) -> Figure:
    """Draw a mechanism displaced by a load on its output, coloured by von Mises stress."""
    assert isinstance(found.fields, MeshFields)
    model = found.axes["model"][-1]
    force = found.at("force", model=model)
    stress = found.at("hinge_stress", model=model)
    force = np.where(np.abs(force) > ROUND_OFF * found.sizes("force")[-1], force, 0.0)
    load = zip(NAMES.values(), force.tolist(), ("N", "N", "N mm"), strict=True)
    parts = ", ".join(f"{name} {significant(value)} {unit}" for name, value, unit in load)
    parts_loaded = [f"hinge {name}" for name in found.axes["hinge"]]
    if "body_stress" in found.values:
        parts_loaded += [f"body {name}" for name in found.axes["body"]]
        stress = np.concatenate([stress, found.at("body_stress", model=model)])
    worst = (
        f"up to {significant(float(np.max(stress)))} {STRESS} at "
        f"{parts_loaded[int(stress.argmax())]}"
    )
    fields = plane_fields(found.fields)
    lines = [f"Load on the output {parts}: {worst}. Displacements"]
    title = f"{found.about.name}: stress under a load"
    return displaced(title, lines, {"": fields}, 1, found.about, WIDTH - 0.3)[0]
