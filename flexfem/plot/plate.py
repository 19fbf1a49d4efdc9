"""Drawings of a mechanism to scale: bodies, ground, hinges, points, actuators and payload."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, PathPatch, Wedge
from matplotlib.path import Path

from flexfem.arrays import Array, is_largest
from flexfem.mechanism.dimensions import Disc, Span
from flexfem.mechanism.hinge_place import joint_polygon
from flexfem.mechanism.layout import Body, Joint, Layout, LinearActuator
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import body_polygon, extent, plate_polygon
from flexfem.plot.drawing import (
    DIMENSION,
    WHITE_BOX,
    arrow,
    fit,
    frame_cross,
    label_axes,
    scale_bar,
    text_box,
    write,
    xy,
)
from flexfem.plot.fields import RIGID, displaced, plane_fields
from flexfem.plot.labels import DrawnParts, PartLabel, write_labels
from flexfem.plot.style import (
    INK,
    NAMES,
    NOTE_COLOUR,
    PALE,
    VISIBLE_BAND,
    in_house_style,
    new_axes,
    page,
)
from flexfem.plot.text import sentence, significant, typeset
from flexfem.questions.setup import MeshFields
from flexfem.results import SPACE, Result
from flexfem.units import LENGTH, STRESS

OTHER_MATERIAL = ".."  # hatch of parts that have a material of their own
HINGE = "#C25500"
DRIVE = "#0072B2"
MASS = "#007A58"
HATCH = "#9AA2AB"
HUB = "#C9CED6"
BODY_NAME = "#404040"
DRAWN = "#56B4E9"  # contour of a drawing
ALONG_EDGE = np.linspace(0, 1, 33)  # points of a clamped edge, per length
COARSE = 2e-4  # deviation of a drawn polygon, per extent
CROSS = 0.07  # length of the axes at the output relative to the size
MOST_MISSING = 4  # in the header of an unfinished drawing
ALONG_SPAN = (0.5, 0.4, 0.6, 0.3, 0.7)  # places of a length on its line
ARROW_WIDTH = 0.006  # half of that of an actuator relative to the size
LETTERS = 8.0  # points, of labels
WIDTH = 8.27  # in, of a page
LOWEST = 3.0  # in, of the drawing on a page of that width
HIGHEST = 9.0  # in, of a drawing
SMALLEST = 5.2  # in, width of a small drawing
LABEL_AREA = 1.5  # in^2, area of a small drawing for each label


class Recognised(NamedTuple):
    """What a mechanism was recognised in.

    drawn : polygon of the drawing.
    slender : thin parts of it that are no hinges.
    hinges : names of the hinges that the file describes, which are labelled with their sizes.
    """

    drawn: Any
    slender: Sequence[Any]
    hinges: frozenset[str]


def plot_plate(
    ax: Axes | None,
    plate: Mechanism,
    *,
    labels: bool = True,
    layout: Layout | None = None,
    recognised: Recognised | None = None,
) -> Axes:
    """Draw a stage or a mechanism to scale, in mm, with a scale bar; return `ax`, or new axes.

    Parameters
    ----------
    ax : axes, or None.
    plate : Mechanism
    labels : bool
        Write the dimensions of a stage and the names of the parts of a mechanism. They are placed
        for the size of `ax` at the time of the call.
    layout : Layout, optional
        Parts that do not fit together, which are named.
    recognised : Recognised, optional
        The drawing, whose contour is below the plate and whose thin parts are red.
    """
    ax = ax or new_axes()
    shows_sizes = layout is None and not plate.drawing_facts.named
    drawn = layout or plate.layout
    spans = plate.spans(drawn) if shows_sizes else []
    rim = draw_plate(ax, plate, drawn)
    if recognised is not None:
        _draw_recognised(ax, recognised)
    visible = list(map(xy, _labelled_points(drawn, spans))) if labels else []
    size = fit(ax, np.vstack([rim, *visible]), 0.07)
    scale_bar(ax)
    label_axes(ax)
    if not labels:
        return ax
    shape = plate_polygon(drawn)
    marks = [*_draw_ports(ax, drawn, size), *_draw_spans(ax, spans, shape.boundary)]
    marks += [joint_polygon(joint) for joint in drawn.joints]
    if shows_sizes:
        names = [_label(text, xy(z), DIMENSION) for text, z in plate.callouts(drawn)]
    else:
        names = list(_names(drawn, recognised))
    write_labels(ax, names, DrawnParts([shape.boundary], marks, shape))
    return ax


def _labelled_points(layout: Layout, spans: Sequence[Span]) -> Iterator[complex]:
    """Yield the points of a drawing, beside the outlines, that must be within its limits."""
    for _, contact in layout.points:
        yield contact.point
    for actuator in layout.actuators:
        for contact in actuator.contacts:
            yield contact.point
    for span in spans:
        yield from span.line
    for _, output in layout.points[:1]:
        yield output.point + CROSS * (1 + 1j) * extent(plate_polygon(layout))


def draw_plate(
    ax: Axes,
    plate: Mechanism,
    layout: Layout | None = None,
) -> Array:
    """Draw bodies, ground, hinges, clamped edges and rigid discs without names.

    Returns points (n, 2) of the outline, mm. Raises BadInput when the parts cannot be drawn.
    """
    layout = layout or plate.layout
    for number, body in enumerate(layout.bodies):
        _draw_body(ax, layout, number, body)
    for joint in layout.joints:
        _fill(ax, joint_polygon(joint), HINGE, OTHER_MATERIAL if joint.material else "")
    for disc in plate.drawing_facts.discs:
        _draw_disc(ax, disc)
    shape = plate_polygon(layout)
    ax.add_patch(
        PathPatch(
            _path(shape),
            facecolor="none",
            edgecolor=INK,
            linewidth=0.8,
            zorder=3,
        )
    )
    return np.asarray(shapely.get_coordinates(shape))


def _draw_body(
    ax: Axes,
    layout: Layout,
    number: int,
    body: Body,
) -> None:
    """Draw a body, hatched if it is fixed or has another material, with its clamped edges."""
    polygon = body_polygon(layout, number, refuse=False)
    if body.fixed:
        _fill(ax, polygon, RIGID, "////")
    else:
        _fill(ax, polygon, PALE, OTHER_MATERIAL if body.material else "")
    lines = [[xy(z) for z in body.outline[k].at(ALONG_EDGE).tolist()] for k in body.clamped]
    edges = LineCollection(
        lines,
        colors=INK,
        linewidths=2.8,
        zorder=4,
    )
    ax.add_collection(edges, autolim=False)


def _draw_disc(ax: Axes, disc: Disc) -> None:
    look: dict[str, Any] = {
        "facecolor": HUB,
        "edgecolor": INK,
        "linewidth": 0.6,
        "zorder": 2.5,
    }
    ax.add_patch(Circle(xy(disc.centre), disc.radius, **look))


def _draw_spans(
    ax: Axes,
    spans: Sequence[Span],
    outline: Any,
) -> Iterator[Any]:
    """Draw dimension lines with their texts; yield what labels must not cover."""
    for span in spans:
        start, end = span.line
        arrow(ax, xy(start), xy(end), "<|-|>", DIMENSION, 0.8)
        for line in ((span.start, start), (span.end, end)):
            ax.plot(
                *np.transpose([xy(z) for z in line]),
                color=DIMENSION,
                linewidth=0.5,
                zorder=6,
            )
        yield shapely.LineString([xy(start), xy(end)])
        yield _write_span(ax, span, outline)


def _write_span(ax: Axes, span: Span, outline: Any) -> Any:
    """Write a length on its dimension line, in the middle or clear of the outline; return its box."""
    start, end = span.line
    turn = float(np.rad2deg(np.angle(end - start)))
    look: dict[str, Any] = {"rotation": turn, "bbox": WHITE_BOX}
    text = write(ax, xy(start), span.text, DIMENSION, LETTERS, **look)
    boxes = dict[float, Any]()
    for share in ALONG_SPAN:
        text.set_position(xy(start + share * (end - start)))
        boxes[share] = text_box(text)
    clear = [share for share, box in boxes.items() if not box.intersects(outline)]
    share = [*clear, ALONG_SPAN[0]][0]
    text.set_position(xy(start + share * (end - start)))
    return boxes[share]


def _names(layout: Layout, recognised: Recognised | None = None) -> Iterator[PartLabel]:
    """Yield the labels of the parts."""
    for joint in layout.joints:
        text = _named(joint)
        if recognised is not None and text in recognised.hinges:
            text = f"{text}: {joint.profile.neck:.6g} x {joint.profile.length:.6g}"
        yield _label(text, xy(joint.place), HINGE)
    for actuator in layout.actuators:
        near, far = (contact.point for contact in actuator.contacts)
        yield _label(actuator.name, xy((near + far) / 2), DRIVE)
    for name, contact in layout.points:
        yield _label(name, xy(contact.point), NOTE_COLOUR)
    for payload in layout.payloads:
        yield _label(f"payload {1e6 * payload.mass:.6g} g", xy(payload.contact.point), MASS)
    for number, body in enumerate(layout.bodies):
        polygon = body_polygon(layout, number, refuse=False)
        middle = polygon.centroid
        if not polygon.contains(middle):
            middle = shapely.point_on_surface(polygon)
        yield _label(_named(body), (middle.x, middle.y), BODY_NAME, polygon)


def _label(
    text: str,
    at: Any,
    colour: str,
    body: Any = None,
) -> PartLabel:
    """Return a label; names of bodies are italic."""
    slant = "normal" if body is None else "italic"
    look = {"colour": colour, "size": LETTERS, "style": slant}
    return PartLabel(text, np.array(at), look, body)


def _named(part: Body | Joint) -> str:
    """Return the name of a part, and of its material if it has its own."""
    return part.name if part.material is None else f"{part.name} ({part.material.name})"


def _draw_recognised(ax: Axes, recognised: Recognised) -> None:
    """Draw the contour of a drawing below the plate, and thin parts that are no hinges above it."""
    look: dict[str, Any] = {"facecolor": "none", "edgecolor": DRAWN, "linewidth": 3.0}
    ax.add_patch(PathPatch(_path(recognised.drawn), zorder=2.9, **look))
    for polygon in recognised.slender:
        _fill(ax, polygon, NOTE_COLOUR, zorder=3.1)


def _draw_ports(
    ax: Axes,
    layout: Layout,
    size: float,
) -> Iterator[Any]:
    """Draw hinge centres, points, actuators and payloads; yield what labels must not cover."""
    for joint in layout.joints:
        ax.plot(
            *xy(joint.place),
            "o",
            color=HINGE,
            markersize=4,
            markerfacecolor="white",
            zorder=5,
        )
    for actuator in layout.actuators:
        yield _draw_actuator(ax, actuator, size)
    for payload in layout.payloads:
        yield _draw_payload(ax, xy(payload.contact.point), 0.018 * size)
    for _, contact in layout.points[1:]:
        look: dict[str, Any] = {"color": NOTE_COLOUR, "markersize": 9, "markeredgewidth": 1.5}
        ax.plot(*xy(contact.point), "+", zorder=6, **look)
    for _, contact in layout.points[:1]:  # an unfinished file has none
        output = contact.point
        yield from frame_cross(ax, CROSS * size, output)


def _draw_actuator(
    ax: Axes,
    actuator: LinearActuator,
    size: float,
) -> Any:
    """Draw an actuator as an arrow with two heads, and a wall where it stands on the ground.

    Returns its line.
    """
    near, far = (contact.point for contact in actuator.contacts)
    half = max(abs(far - near), 0.03 * size) / 2 * actuator.direction
    tips = [(near + far) / 2 - half, (near + far) / 2 + half]
    arrow(ax, xy(tips[0]), xy(tips[1]), "<|-|>", DRIVE, 1.8)
    for contact, tip in zip(actuator.contacts, tips, strict=True):
        if contact.body < 0:  # on the ground outside the plate
            aside = 0.02j * size * actuator.direction
            wall = [xy(tip - aside), xy(tip + aside)]
            ax.plot(
                *np.transpose(wall),
                color=INK,
                linewidth=2.8,
                zorder=6,
            )
    return shapely.LineString([xy(tip) for tip in tips]).buffer(ARROW_WIDTH * size)


def _draw_payload(
    ax: Axes,
    at: tuple[float, float],
    radius: float,
) -> Any:
    """Draw the symbol of a centre of mass; return its disc."""
    ax.add_patch(
        Circle(
            at,
            radius,
            facecolor="white",
            edgecolor=MASS,
            linewidth=1.2,
            zorder=5,
        )
    )
    for first in (0, 180):
        ax.add_patch(Wedge(at, radius, first, first + 90, facecolor=MASS, zorder=5.1))
    return shapely.Point(at).buffer(radius)


def _fill(
    ax: Axes,
    polygon: Any,
    colour: str,
    hatch: str = "",
    zorder: float = 1.5,
) -> None:
    look: dict[str, Any] = {
        "edgecolor": HATCH,
        "hatch": hatch,
        "linewidth": 0.0,
        "zorder": zorder,
    }
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
    """Draw a page as `plot_plate`, with data of the plate and the meaning of the marks above.

    Parameters
    ----------
    plate, layout, recognised : as of `plot_plate`.
    small : bool
        As small as the labels allow, so that they are legible on narrow screens.
    missing : sequence of str
        What an unfinished file lacks, which the header names instead of the data.
    """
    drawn = layout or plate.layout
    facts = plate.drawing_facts
    if missing:
        more = f" and {len(missing) - MOST_MISSING} more" * (len(missing) > MOST_MISSING)
        data = f"unfinished: {'; '.join(missing[:MOST_MISSING])}{more}"
    else:
        thickness = f"thickness {drawn.thickness:.6g} {LENGTH}"
        data = "; ".join([thickness, plate.material.name, *facts.facts])
    if layout is not None and facts.unmade:
        key = facts.unmade
    else:
        meanings = _meanings(drawn, bool(facts.discs), recognised)
        key = "; ".join(filter(None, [*meanings, facts.unlabelled]))
    lines = [sentence(text) for text in (data, key) if text]
    labels = None
    if small:
        labels = len([*_names(drawn)]) if facts.named else 0
    size = _size_of_page(drawn, labels)
    plot = partial(
        plot_plate,
        plate=plate,
        layout=layout,
        recognised=recognised,
    )
    return page(size, f"{plate.name}: drawing", lines, plot, plate)


def _meanings(
    layout: Layout,
    with_discs: bool,
    recognised: Recognised | None,
) -> list[str]:
    """Return the meanings of the marks that a drawing has."""
    marks = {
        "hatched: fixed": any(body.fixed for body in layout.bodies),
        "heavy lines: clamped": any(body.clamped for body in layout.bodies),
        "orange: hinges": bool(layout.joints),
        "dotted: another material": layout.mixed,
        "blue: actuators": bool(layout.actuators),
        "disc: the hub, rigid in the models": with_discs,
        "x, y: output": bool(layout.points),
        "light blue: the drawing": recognised is not None,
        "red: thin parts that are no hinges": recognised is not None and bool(recognised.slender),
    }
    return [text for text, is_there in marks.items() if is_there]


def _size_of_page(layout: Layout, labels: int | None) -> tuple[float, float]:
    """Return width and height, in, of a drawing; as small as a number of labels allows, if any."""
    bounds = np.reshape(shapely.total_bounds(plate_polygon(layout)), (2, 2))
    wide, high = np.ptp(bounds, axis=0)
    room = 0.14 * max(wide, high)
    width = WIDTH
    if labels is not None:
        width = float(np.clip(np.sqrt(LABEL_AREA * labels * wide / high), SMALLEST, WIDTH))
    height = (width - 0.6) * (high + room) / (wide + room)
    return width, float(np.clip(height, LOWEST * width / WIDTH, HIGHEST)) + 0.5


@in_house_style
def load_figure(found: Result) -> Figure:
    """Draw a mechanism displaced by a load on its output, coloured by von Mises stress."""
    assert isinstance(found.fields, MeshFields)
    load = "; ".join([f"on the output {_load_text(found)}", *_loads_at_points(found)])
    highest = _highest_stress(found)
    lines = [f"Load {load}: {highest}. Displacements"]
    title = f"{found.about.name}: stress under a load"
    fields = {"": plane_fields(found.fields)}
    return displaced(title, lines, fields, 1, found.about, WIDTH - 0.3).figure


def _load_text(found: Result) -> str:
    """Return the components of the load, with zeros in place of round-off and of less than bands."""
    return _components(found.visible_texts("force", VISIBLE_BAND, model=found.axes["model"][-1]))


def _loads_at_points(found: Result) -> list[str]:
    """Return the loads at points other than zero, with the names of these."""
    if "point_load" not in found.values:
        return []
    loads = {name: found.texts("point_load", point=name) for name in found.axes["point"]}
    return [
        f"at {name} {_components(cells)}"
        for name, cells in loads.items()
        if np.any(found.at("point_load", point=name))
    ]


def _components(cells: Sequence[str]) -> str:
    """Return the components of a load that are not zero."""
    named = zip(NAMES.values(), cells, strict=True)
    parts = [f"{name} {typeset(cell)}" for name, cell in named if not cell.startswith("0 ")]
    return ", ".join(part.replace(" ", SPACE) for part in parts) or "zero"


def _highest_stress(found: Result) -> str:
    """Return the highest stress, and where it is."""
    model = found.axes["model"][-1]
    stress = found.at("hinge_stress", model=model)
    parts = [f"hinge {name}" for name in found.axes["hinge"]]
    if "body_stress" in found.values:
        parts += [f"body {name}" for name in found.axes["body"]]
        stress = np.concatenate([stress, found.at("body_stress", model=model)])
    first = int(np.argmax(is_largest(stress)))  # of equal ones, as in the table
    return f"up to {significant(float(np.max(stress)))}{SPACE}{STRESS} at {parts[first]}"
