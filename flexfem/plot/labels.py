"""Labels of drawings, placed together: clear of one another, of outlines and of what is drawn.

Every label has a number of possible places. A place costs the more, the farther it is from what the
label is about and the more it covers. Two labels cost where they or their leader lines meet. Labels
are moved one by one to their cheapest places until none moves. The same labels on the same drawing
have the same places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes

from flexfem.arrays import Array
from flexfem.plot.drawing import WHITE_BOX, write

DIRECTIONS = 24  # of leader lines
LEADERS = np.array([0.8, 1.2, 1.8, 2.6, 3.6, 5.0, 7.0, 10.0])  # lengths over the text height
GRID = 15  # places across and along a body for its name
SIZES = (1.0, 0.875, 0.75)  # of letters, smaller ones where labels meet
SWEEPS = 12  # at most, over all labels
GAP = 0.25  # around a label, over the height of its text
APART = 0.9  # two labels, over half of the lesser height
SYMBOL = 0.35  # radius of what a label is about, over the height of its text
CLEAR = 0.4  # around a label, from outlines, over the same height

OUTSIDE = 2000.0  # costs: a label leaves the drawing
MEETING = 500.0  # two labels cover each other
THROUGH = 150.0  # a leader line passes below another label
ON_MARK = 120.0  # a label covers an arrow, a hinge or what another label is about
CROSSING = 60.0  # two leader lines cross
OVER_MARK = 25.0  # a leader line passes over an arrow, or over what another label is about
ON_LINE = 12.0  # a label covers an outline
NEAR_LINE = 2.0  # a label nearly touches an outline
ON_MATERIAL = 1.5  # a label that is not of a body is on one
OVER_LINE = 0.7  # a leader line crosses an outline
TURNED = 2.5  # a label is written upwards
BESIDE = 3.0  # a name of a body is not in it
LENGTH = 0.8  # a leader line has the length of the text height
OFF_CENTRE = 0.15  # a name of a body is as far from its middle
PLACES = 120  # at most, of a label, the cheapest ones
PUSHES = 150  # trials at most of a place from which other labels are pushed
SAME = 1e-9  # a cost that is lower by less is the same
SEVERE = OVER_MARK  # costs from this on are a fault of the drawing


class PartLabel(NamedTuple):
    """A text of a drawing, the point (2,) that it is about, and the text's properties.

    body : polygon of a body within which its name needs no leader line.
    """

    text: str
    at: Array
    look: dict[str, Any]
    body: Any = None


class DrawnParts(NamedTuple):
    """What is drawn where labels are placed, in data coordinates.

    outlines : lines that labels should not cover.
    marks : symbols and lines that labels must not cover.
    material : polygon of all bodies.
    """

    outlines: Sequence[Any]
    marks: Sequence[Any]
    material: Any = None


class _Places(NamedTuple):
    """Possible places (k,) of a label.

    centre, half : (k, 2) centre, and half of width and height.
    foot, tip : (k, 2) ends of the leader line, both in the centre without one.
    cost : (k,) of the place alone.
    turned : (k,) whether the text is written upwards.
    """

    centre: Array
    half: Array
    foot: Array
    tip: Array
    cost: Array
    turned: Array

    def at(self, chosen: Any) -> _Places:
        """Return some of the places."""
        return _Places(*(each[chosen] for each in self))


def write_labels(
    ax: Axes,
    labels: Sequence[PartLabel],
    drawn: DrawnParts,
) -> int:
    """Write labels with leader lines to what they are about.

    Returns how many labels cover another label or a mark, because there is no room.

    ax : the drawing, whose size and limits are final.
    """
    if not labels:
        return 0
    tried = list[tuple[int, float, _Arrangement]]()
    for size in SIZES:
        made = _arranged(list(_options(ax, labels, drawn, size)))
        costs = made.costs()
        tried.append((int(np.sum(costs >= SEVERE)), -size, made))
        if not tried[-1][0]:
            break
    faults, smaller, best = min(tried, key=lambda each: each[:2])
    for number, label in enumerate(labels):
        _write(ax, label, best.now.at(number), -smaller)
    return faults


def _write(
    ax: Axes,
    label: PartLabel,
    place: _Places,
    size: float,
) -> None:
    """Write a label at its place."""
    look = {"bbox": WHITE_BOX} | label.look
    look["size"] = size * look["size"]
    upwards = 90.0 if place.turned else 0.0
    write(ax, place.centre, label.text, rotation=upwards, **look)
    if np.any(place.foot != place.centre):
        ax.plot(
            *np.transpose([place.foot, place.centre]),
            color=look.get("colour", "black"),
            linewidth=0.6,
            zorder=6,
        )


def _options(
    ax: Axes,
    labels: Sequence[PartLabel],
    drawn: DrawnParts,
    size: float,
) -> Iterator[_Places]:
    """Yield the possible places of every label for letters of a size, relative to the stated one."""
    lines = _Shapes(_segments(drawn.outlines))
    shapely.prepare(drawn.material)
    marks = _Shapes(drawn.marks)
    anchors = [shapely.Point(label.at) for label in labels]
    sizes = [_half_size(ax, label, size) for label in labels]
    symbols = _Shapes(
        [each.buffer(SYMBOL * height) for each, (_, height) in zip(anchors, sizes, strict=True)]
    )
    for label, anchor, (half, height) in zip(labels, anchors, sizes, strict=True):
        made = _joined(_around(label.at, half, height), _upwards(label.at, half, height))
        if label.body is not None:
            made = made._replace(cost=made.cost + BESIDE)
            made = _joined(_inside(label.body, half, height, label.at), made)
        boxes = _boxes(made, GAP * height)
        leaders = _leaders(made, SYMBOL * height)
        cost = made.cost + OUTSIDE * ~shapely.covers(_window(ax), boxes)
        cost += ON_LINE * (lines.met(boxes) > 0)
        roomy = _boxes(made, CLEAR * height)
        cost += NEAR_LINE * (lines.met(roomy) > 0)
        cost += ON_MARK * (marks.met(roomy) + symbols.met(boxes, anchor) > 0)
        cost += OVER_LINE * lines.met(leaders)
        cost += OVER_MARK * (marks.met(leaders, anchor) + symbols.met(leaders, anchor))
        if drawn.material is not None and label.body is None:
            cost += ON_MATERIAL * shapely.intersects(drawn.material, boxes)
        yield made._replace(cost=cost).at(np.argsort(cost, kind="stable")[:PLACES])


def _window(ax: Axes) -> Any:
    """Return the area of a drawing as a polygon."""
    return shapely.box(*np.transpose([ax.get_xlim(), ax.get_ylim()]).ravel())


def _half_size(
    ax: Axes,
    label: PartLabel,
    size: float,
) -> tuple[Array, float]:
    """Return half of width and height (2,) of a text, and the height of its letters."""
    look = {key: label.look[key] for key in ("style", "weight", "parse_math") if key in label.look}
    points = size * label.look["size"]
    text = ax.text(float(label.at[0]), float(label.at[1]), label.text, size=points, **look)
    extent = text.get_window_extent()
    text.remove()
    spans = np.ptp([ax.get_xlim(), ax.get_ylim()], axis=1)
    pixel = float(np.max(spans / np.array(ax.get_window_extent().size)))
    height = pixel * points * ax.figure.dpi / 72
    return pixel / 2 * np.array([extent.width, extent.height]), height


def _around(
    at: Array,
    half: Array,
    height: float,
) -> _Places:
    """Return places around a point, with leader lines of `LEADERS` lengths."""
    angles = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    units = np.column_stack([np.cos(angles), np.sin(angles)])
    with np.errstate(divide="ignore"):
        within = np.min(half / np.abs(units), axis=1)  # of a leader line below the text
    lengths = np.repeat(height * LEADERS, DIRECTIONS)
    units = np.tile(units, (len(LEADERS), 1))
    tip = at + lengths[:, None] * units
    centre = tip + np.tile(within, len(LEADERS))[:, None] * units
    foot = np.broadcast_to(at, tip.shape)
    cost = LENGTH * lengths / height
    turned = np.zeros(len(tip), dtype=bool)
    return _Places(centre, np.broadcast_to(half, tip.shape), foot, tip, cost, turned)


def _upwards(
    at: Array,
    half: Array,
    height: float,
) -> _Places:
    """Return places around a point of a text that is written upwards."""
    made = _around(at, half[::-1], height)
    return made._replace(cost=made.cost + TURNED, turned=np.ones(len(made.cost), dtype=bool))


def _inside(
    body: Any,
    half: Array,
    height: float,
    middle: Array,
) -> _Places:
    """Return places of a name within its body, upright and turned, without a leader line."""
    bounds = np.reshape(body.bounds, (2, 2))
    shares = (np.arange(GRID) + 0.5) / GRID
    x, y = (bounds[0] + np.outer(shares, bounds[1] - bounds[0])).T
    centre = np.vstack([middle, np.array(np.meshgrid(x, y)).reshape(2, -1).T])
    far = np.linalg.norm(centre - middle, axis=1) / height
    upright = _Places(
        centre,
        np.broadcast_to(half, centre.shape),
        centre,
        centre,
        OFF_CENTRE * far,
        np.zeros(len(centre), dtype=bool),
    )
    upwards = upright._replace(
        half=np.broadcast_to(half[::-1], centre.shape),
        cost=upright.cost + TURNED,
        turned=np.ones(len(centre), dtype=bool),
    )
    both = _joined(upright, upwards)
    shapely.prepare(body)
    return both.at(shapely.covers(body, _boxes(both, GAP * height)))


def _joined(first: _Places, second: _Places) -> _Places:
    """Return the places of both."""
    return _Places(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))


def _boxes(places: _Places, room: float) -> Array:
    """Return the boxes (k,) of places with some room around them, as polygons."""
    low = places.centre - places.half - room
    high = places.centre + places.half + room
    return np.asarray(shapely.box(*low.T, *high.T))


def _leaders(places: _Places, hidden: float) -> Array:
    """Return the leader lines (k,) of places from a distance to what they are about."""
    along = places.tip - places.foot
    length = np.linalg.norm(along, axis=1, keepdims=True)
    start = places.foot + np.minimum(hidden, length) * along / np.maximum(length, hidden)
    return np.asarray(shapely.linestrings(np.stack([start, places.tip], axis=1)))


def _segments(lines: Sequence[Any]) -> list[Any]:
    """Return lines as their straight segments, of which few are near one place."""
    parts = shapely.get_parts(list(lines))
    segments = list[Any]()
    for part in parts:
        points = shapely.get_coordinates(part)
        pairs = np.stack([points[:-1], points[1:]], axis=1)
        segments += np.asarray(shapely.linestrings(pairs)).tolist()
    return segments


class _Shapes:
    """Geometries that places meet or not."""

    def __init__(self, shapes: Sequence[Any]) -> None:
        self.tree = shapely.STRtree(shapes)

    def met(self, places: Array, beside: Any = None) -> Array:
        """Return how many of the shapes each of some places (k,) meets.

        beside : point; the shapes that contain it are not counted.
        """
        place, shape = self.tree.query(places, "intersects")
        if beside is not None:
            place = place[~np.isin(shape, self.tree.query(beside, "within"))]
        return np.bincount(place, minlength=len(places)).astype(float)


class _Arrangement:
    """A place for every label.

    chosen : (n,) its number among the options of the label.
    near : the labels (.,) that each label can meet.
    now : the places (n,).
    """

    def __init__(
        self,
        options: Sequence[_Places],
        chosen: Sequence[int],
        near: Sequence[Any],
    ) -> None:
        self.options = options
        self.chosen = list(chosen)
        self.near = near
        places = [each.at(k) for each, k in zip(options, chosen, strict=True)]
        self.now = _Places(*(np.array(each) for each in zip(*places, strict=True)))

    def costs(self) -> Array:
        """Return the costs (n,) of the labels where they are."""
        every = _meetings(self.now, self.now)
        np.fill_diagonal(every, 0.0)
        return np.asarray(self.now.cost + every.sum(axis=1))

    def move(self, label: int, place: int) -> None:
        """Move a label to one of its places."""
        self.chosen[label] = place
        for there, option in zip(self.now, self.options[label], strict=True):
            there[label] = option[place]

    def settle(self, label: int) -> bool:
        """Move a label to its cheapest place; return whether it moved."""
        places = self.options[label]
        others = self.now.at(self.near[label])
        costs = places.cost + _meetings(places, others).sum(axis=1)
        best = int(np.argmin(costs))
        if costs[best] >= costs[self.chosen[label]] - SAME:
            return False
        self.move(label, best)
        return True

    def pushed(self, label: int, place: int) -> _Arrangement:
        """Return the arrangement with a label at a place, and those that it meets there moved."""
        made = _Arrangement(self.options, self.chosen, self.near)
        made.move(label, place)
        near = self.near[label]
        meeting = _meetings(self.options[label].at([place]), made.now.at(near))[0]
        for other in near[meeting > 0].tolist():
            made.settle(other)
        return made


def _arranged(options: Sequence[_Places]) -> _Arrangement:
    """Return an arrangement that hardly any move of a label, or of those it pushes, makes cheaper."""
    made = _Arrangement(options, [0] * len(options), list(_neighbours(options)))
    _settle(made)
    costs = made.costs()
    for place in range(PUSHES // max(int(np.sum(costs >= SEVERE)), 1)):
        for label in np.flatnonzero(costs >= SEVERE).tolist():
            own = options[label].cost
            if place < len(own) and own[place] < costs[label]:
                trial = made.pushed(label, place)
                found = trial.costs()
                if found.sum() < costs.sum() - SAME:
                    made = trial
                    costs = found
    _settle(made)
    return made


def _settle(made: _Arrangement) -> None:
    """Move every label to its cheapest place, several times, until none moves."""
    for _ in range(SWEEPS):
        order = np.argsort(-made.costs(), kind="stable").tolist()
        moved = [made.settle(label) for label in order]
        if not any(moved):
            break


def _neighbours(options: Sequence[_Places]) -> Iterator[Any]:
    """Yield the other labels (.,) that each label can meet at any of their places."""
    corners = list[Array]()
    for each in options:
        ends = np.concatenate([each.centre - each.half, each.centre + each.half, each.foot])
        corners.append(np.concatenate([ends.min(axis=0), ends.max(axis=0)]))
    areas: Any = shapely.box(*np.transpose(corners))
    for label, area in enumerate(areas):
        meets = shapely.intersects(areas, area)
        meets[label] = False
        yield np.flatnonzero(meets)


def _meetings(places: _Places, others: _Places) -> Array:
    """Return the costs (k, n) of some places (k,) together with other labels (n,)."""
    one = _Places(*(np.expand_dims(each, 1) for each in places))
    apart = np.abs(one.centre - others.centre)
    room = one.half + others.half + APART * np.min(others.half, axis=-1)[..., None]
    cost = MEETING * np.all(apart < room, axis=-1)
    cost += THROUGH * _passes(one.foot, one.tip, others)
    cost += THROUGH * _passes(others.foot, others.tip, one)
    cost += CROSSING * _crosses(one.foot, one.tip, others.foot, others.tip)
    return np.asarray(cost)


def _passes(start: Array, end: Array, boxes: _Places) -> Array:
    """Return whether lines pass through the boxes of places.

    They do where neither the axes nor the normal of the line separates them.
    """
    along = end - start
    middle = (start + end) / 2 - boxes.centre
    near = np.all(np.abs(middle) < np.abs(along) / 2 + boxes.half, axis=-1)
    far = np.abs(_cross(along, middle))
    width = np.sum(np.abs(along[..., ::-1]) * boxes.half, axis=-1)
    is_line = np.any(along != 0.0, axis=-1)
    return np.asarray(near & (far < width) & is_line)


def _crosses(
    start: Array,
    end: Array,
    other_start: Array,
    other_end: Array,
) -> Array:
    """Return whether lines cross other lines."""
    along = end - start
    other = other_end - other_start
    sides = _cross(along, other_start - start) * _cross(along, other_end - start)
    other_sides = _cross(other, start - other_start) * _cross(other, end - other_start)
    return np.asarray((sides < 0) & (other_sides < 0))


def _cross(first: Array, second: Array) -> Array:
    """Return the component of the cross product of vectors (..., 2) out of the plane."""
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
