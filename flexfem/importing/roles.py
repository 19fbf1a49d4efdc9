"""Ground, output and actuators of a plate that was found in a drawing.

They follow from marks, from points, else from a stated rule."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import Array
from flexfem.files.refusals import place_of, shown
from flexfem.importing.found import DrawnMark, FoundBody, FoundPlate
from flexfem.importing.layers import is_ground, is_output
from flexfem.mechanism.layout import Move
from flexfem.mechanism.outlines import Segment, circle_of, polygon_points
from flexfem.refused import BadInput

FINE = np.pi / 256  # rad of arc per vertex of a polygon in which points are looked up
AT_EDGE = 0.02  # mm, distance of a point from an edge that it means
AT_EDGE_SHARE = 1e-3  # the same per extent of the plate
CONTACT = 1 / 20  # radius of the output on a clamped body, per extent of the body
WIDEST = 1 / 5  # the largest one
SAME = 0.9  # common area of two contours per area of both, above which they mean one body
COVERED = 0.5  # of the area of a body within a contour, above which it is marked
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
POINT = re.compile(rf"\s*({NUMBER})\s*(?:mm)?\s*,\s*({NUMBER})\s*(?:mm)?\s*")


class PushedPoints(NamedTuple):
    """An actuator: its two points, the bodies at them, -1 for the ground outside, and its stack."""

    points: tuple[complex, complex]
    bodies: tuple[int, int]
    stack: str


class Roles(NamedTuple):
    """What the bodies of a plate are for.

    fixed : indices of bodies that are rigid ground.
    clamped : by elastic body, segments of its outline.
    output, at : body whose pose is read, and the point.
    contact : mm, radius around it; None for the whole body.
    sources : why, by "ground" and "output", for provenance.
    """

    fixed: tuple[int, ...]
    clamped: dict[int, tuple[int, ...]]
    output: int
    at: complex
    contact: float | None
    actuators: tuple[PushedPoints, ...]
    sources: dict[str, str]


class Wishes(NamedTuple):
    """What the user states about the parts of a drawing; points in mm.

    ground : points of bodies that are rigid ground, or on edges at which an elastic body is
    clamped.
    output : point of the body that is the output.   pose : point at which its pose is read.
    clamp_holes : whether bodies with round holes are ground.
    actuators : pairs of points and the stack between them, "" for an assumed one.
    """

    ground: tuple[complex, ...] = ()
    output: complex | None = None
    pose: complex | None = None
    clamp_holes: bool = False
    actuators: tuple[tuple[complex, complex, str], ...] = ()

    def moved(self, move: Move) -> Wishes:
        """Return the same wishes of a drawing that is moved."""
        return self._replace(
            ground=tuple(move(z) for z in self.ground),
            output=None if self.output is None else move(self.output),
            pose=None if self.pose is None else move(self.pose),
            actuators=tuple((move(near), move(far), stack) for near, far, stack in self.actuators),
        )


def point_of(name: str, text: Any) -> complex:
    """Return a point from a text such as 12.5,-3 or from two numbers.

    Raises BadInput with the name of the option.
    """
    found = POINT.fullmatch(text) if isinstance(text, str) else None
    if found is not None:
        return complex(float(found[1]), float(found[2]))
    if not isinstance(text, str):
        with suppress(TypeError, ValueError):
            x, y = map(float, text)
            return complex(x, y)
    raise BadInput(f"{name} {shown(text)}, expected a point x,y in mm, such as 12.5,-3")


def actuator_of(name: str, text: Any) -> tuple[complex, complex, str]:
    """Return both points and the stack of a text such as 0,0:20,0,AE0505D16. Raises BadInput."""
    first, colon, rest = text.partition(":") if isinstance(text, str) else ("", "", "")
    second = POINT.match(rest)
    stack = rest[second.end() :].lstrip(",").strip() if second else ""
    if not colon or second is None:
        raise BadInput(
            f"{name} {shown(text)}, expected two points and perhaps a stack, such as "
            "0,0:20,0,AE0505D16"
        )
    points = point_of(name, first), point_of(name, second[0])
    if points[0] == points[1]:
        raise BadInput(
            f"{name} {shown(text)}, expected two different points, which give the direction of "
            "the force"
        )
    return *points, stack


def roles_of(found: FoundPlate, wishes: Wishes) -> Roles:
    """Return what the bodies of a plate are for.

    Raises BadInput for a point off the plate, a plate without hinges and ground, or ground without
    a body that moves.
    """
    return _Assignment(found, wishes).roles()


class _Assignment:
    """The bodies of a plate as polygons, and the search for their roles."""

    def __init__(
        self,
        found: FoundPlate,
        wishes: Wishes,
    ) -> None:
        self.found = found
        self.wishes = wishes
        self.place = place_of(found.drawing.path)
        self.polygons = [body_shape(body) for body in found.bodies]
        left, low, right, high = shapely.total_bounds(self.polygons)
        self.bounds = left, low, right, high
        self.near = max(AT_EDGE, AT_EDGE_SHARE * float(max(right - left, high - low)))
        self.sources = dict[str, str]()

    def roles(self) -> Roles:
        """Return the roles. Raises BadInput as `roles_of`."""
        fixed, clamped = self._ground()
        output, at = self._output(fixed, clamped)
        contact = self._contact(output, at) if output in clamped else None
        return Roles(
            tuple(sorted(fixed)), clamped, output, at, contact, self._actuators(), self.sources
        )

    def _ground(self) -> tuple[set[int], dict[int, tuple[int, ...]]]:
        if self.wishes.ground:
            self.sources["ground"] = "stated with the import"
            return self._stated_ground()
        marked = self._marked_ground()
        if marked is not None:
            return marked
        holed = self._most_holed()
        if self.wishes.clamp_holes:
            fixed = {k for k, body in enumerate(self.found.bodies) if _screws(body)}
            if not fixed:
                raise BadInput(
                    f"{self.place}: no body with a round hole, expected no --clamp-holes, or "
                    "--ground X,Y"
                )
            self.sources["ground"] = "stated with the import: the bodies with round holes"
            return fixed, {}
        if not self.found.hinges:
            left, low, right, high = self.bounds
            raise BadInput(
                f"{self.place}: no hinges were found, expected --ground X,Y with a point on the "
                f"edge that is clamped; the plate lies between {left:.5g},{low:.5g} and "
                f"{right:.5g},{high:.5g} mm"
            )
        around = [k for k, polygon in enumerate(self.polygons) if self._covers_plate(polygon)]
        if around:
            self.sources["ground"] = "assumed: the body around all others is the ground"
            return {around[0]}, {}
        if holed is not None:
            self.sources["ground"] = "assumed: the body with the most round holes is the ground"
            return {holed}, {}
        self.sources["ground"] = "assumed: the largest body is the ground"
        return {int(np.argmax([polygon.area for polygon in self.polygons]))}, {}

    def _stated_ground(self) -> tuple[set[int], dict[int, tuple[int, ...]]]:
        fixed = set[int]()
        clamped = dict[int, tuple[int, ...]]()
        for point in self.wishes.ground:
            body, segment = self._edge_at("ground", point)
            if segment is None:
                fixed.add(body)
            else:
                clamped[body] = (*clamped.get(body, ()), segment)
        both = fixed & clamped.keys()
        if both:
            point = self.polygons[min(both)].representative_point()
            raise BadInput(
                f"{self.place}: ground both in the body around {point.x:.4g},{point.y:.4g} and on "
                "an edge of it, expected one of the two"
            )
        return fixed, clamped

    def _marked_ground(self) -> tuple[set[int], dict[int, tuple[int, ...]]] | None:
        clamped = {k: body.clamped for k, body in enumerate(self.found.bodies) if body.clamped}
        marks = [mark for mark in self.found.drawing.marks if is_ground(mark.layer)]
        fixed = set[int]()
        for mark in marks:
            fixed |= self._marked(mark) - clamped.keys()
        if not fixed and not clamped:
            return None
        layers = ", ".join(dict.fromkeys(mark.layer for mark in marks)) or "the ground"
        self.sources["ground"] = f"read from {self.found.drawing.path.name}, layer {layers}"
        return fixed, clamped

    def _output(
        self,
        fixed: set[int],
        clamped: dict[int, tuple[int, ...]],
    ) -> tuple[int, complex]:
        moving = [k for k in range(len(self.polygons)) if k not in fixed]
        if not moving:
            raise BadInput(f"{self.place}: every body is ground, expected one that moves")
        if self.wishes.output is not None:
            self.sources["output"] = "stated with the import"
            pose = self.wishes.output if self.wishes.pose is None else self.wishes.pose
            return self._stated_output(self.wishes.output, moving), pose
        for mark in self.found.drawing.marks:
            marked = self._marked(mark) & set(moving) if is_output(mark.layer) else set()
            if marked:
                self.sources["output"] = (
                    f"read from {self.found.drawing.path.name}, layer {mark.layer}"
                )
                return min(marked), _middle(mark)
        depth = self._depths(fixed | clamped.keys())
        hinges = Counter(body for hinge in self.found.hinges for body in hinge.bodies)
        body = max(moving, key=lambda k: (depth[k], hinges[k], self.polygons[k].area))
        self.sources["output"] = (
            "assumed: the centre of the body with the most hinges between it and the ground"
        )
        centre = self.polygons[body].centroid
        return body, complex(round(centre.x, 4), round(centre.y, 4)) + 0j

    def _contact(
        self,
        body: int,
        at: complex,
    ) -> float:
        """Return the radius of the output on a body that is clamped itself.

        It is half the edge that the output is on, or a share of the body.
        """
        left, low, right, high = self.polygons[body].bounds
        extent = math.hypot(right - left, high - low)
        dot = _dot(at)
        lines = [_line(segment) for segment in self.found.bodies[body].outside]
        edge = min(lines, key=lambda line: shapely.distance(line, dot))
        radius = CONTACT * extent
        if shapely.distance(edge, dot) <= self.near:
            radius = shapely.length(edge) / 2
        return round(float(min(radius, WIDEST * extent)), 4)

    def _stated_output(
        self,
        point: complex,
        moving: Sequence[int],
    ) -> int:
        body = self._at(point, moving)
        if body is not None:
            return body
        gaps = self._distances(point)
        if np.min(gaps) <= self.near:
            raise BadInput(
                f"output {_said(point)}: this point is on the ground, expected a body that moves"
            )
        raise BadInput(
            f"output {_said(point)}: {np.min(gaps):.3g} mm from the plate, expected a point of a "
            "body"
        )

    def _at(
        self,
        point: complex,
        bodies: Sequence[int],
    ) -> int | None:
        """Return which of the bodies a point is in, or in whose hole; None without one."""
        gaps = self._distances(point)
        inside = [k for k in bodies if gaps[k] <= self.near]
        if inside:
            return min(inside, key=lambda k: gaps[k])
        dot = _dot(point)
        filled = list[int]()
        for k in bodies:
            if any(ring.contains(dot) for ring in _filled(self.polygons[k])):
                filled.append(k)
        return min(filled, key=lambda k: self.polygons[k].area, default=None)

    def _actuators(self) -> tuple[PushedPoints, ...]:
        found = list[PushedPoints]()
        for first, second, stack in self.wishes.actuators:
            bodies = [self._pushed(point) for point in (first, second)]
            if bodies[1] < 0:
                raise BadInput(
                    f"actuator at {_said(second)}: {np.min(self._distances(second)):.3g} mm from "
                    "the plate, expected a point of the body that is pushed as the second one"
                )
            found.append(PushedPoints((first, second), (bodies[0], bodies[1]), stack))
        return tuple(found)

    def _pushed(self, point: complex) -> int:
        gaps = self._distances(point)
        nearest = int(np.argmin(gaps))
        return nearest if gaps[nearest] <= self.near else -1

    def _edge_at(
        self,
        option: str,
        point: complex,
    ) -> tuple[int, int | None]:
        """Return the body at a point, and the segment of its outline if the point is on one."""
        gaps = self._distances(point)
        body = int(np.argmin(gaps))
        if gaps[body] > self.near:
            raise BadInput(
                f"{option} {_said(point)}: {gaps[body]:.3g} mm from the nearest body, expected a "
                "point in a body, which is then fixed, or on an edge, which is then clamped"
            )
        ends = [_line(hinge_end) for hinge_end in self._hinge_ends(body)]
        edges = [_line(segment) for segment in self.found.bodies[body].outside]
        distances = np.array([shapely.distance(edge, _dot(point)) for edge in edges])
        segment = int(np.argmin(distances))
        at_hinge = any(shapely.distance(end, _dot(point)) <= distances[segment] for end in ends)
        return body, None if distances[segment] > self.near or at_hinge else segment

    def _hinge_ends(self, body: int) -> list[Segment]:
        """Return the segments of the outline of a body at which hinges end."""
        hinges = [hinge for hinge in self.found.hinges if body in hinge.bodies]
        found = list[Segment]()
        for segment in self.found.bodies[body].outside:
            middle = complex(segment.at(0.5))
            for hinge in hinges:
                half = hinge.dimensions.get("length", 0.0) / 2
                if abs(middle - hinge.place) < half * (1 + 1e-6):
                    found.append(segment)
        return found

    def _marked(self, mark: DrawnMark) -> set[int]:
        """Return the bodies that a mark is for.

        It is a point in one, or a contour of one, around some or in one of them.
        """
        if len(mark.points) == 1:
            at = self._at(mark.points[0], range(len(self.polygons)))
            return set() if at is None else {at}
        if not mark.closed or len(mark.points) < 3:
            return set()
        marked = shapely.buffer(shapely.Polygon([(z.real, z.imag) for z in mark.points]), 0)
        alike = list[float]()
        for polygon in self.polygons:
            alike.append(max(_alike(marked, ring) for ring in _filled(polygon)))
        if max(alike) > SAME:
            return {int(np.argmax(alike))}
        areas = np.array([polygon.area for polygon in self.polygons])
        shared = np.asarray(shapely.area(shapely.intersection(marked, self.polygons)))
        covered = np.flatnonzero(shared > COVERED * areas)
        if 0 < len(covered) < len(self.polygons):
            return set(covered.tolist())
        return {int(np.argmax(shared))} if np.max(shared) > 0 else set()

    def _most_holed(self) -> int | None:
        counts = [_screws(body) for body in self.found.bodies]
        most = max(counts)
        return counts.index(most) if most and counts.count(most) == 1 else None

    def _covers_plate(self, polygon: Any) -> bool:
        """Whether a body reaches as far as the plate on all four sides."""
        return bool(np.max(np.abs(np.subtract(polygon.bounds, self.bounds))) <= self.near)

    def _depths(self, held: set[int]) -> list[int]:
        """Return the number of hinges from the held bodies to each body."""
        depth = [0 if k in held else -1 for k in range(len(self.polygons))]
        ahead = sorted(held)
        while ahead:
            body = ahead.pop(0)
            for hinge in self.found.hinges:
                for one, other in (hinge.bodies, hinge.bodies[::-1]):
                    if one == body and depth[other] < 0:
                        depth[other] = depth[body] + 1
                        ahead.append(other)
        return depth

    def _distances(self, point: complex) -> Array:
        return np.asarray(shapely.distance(self.polygons, _dot(point)))


def body_shape(body: FoundBody) -> Any:
    """Return the polygon of a body."""
    return shapely.Polygon(
        polygon_points(body.outside, FINE), [polygon_points(hole, FINE) for hole in body.holes]
    )


def _filled(polygon: Any) -> list[Any]:
    """Return what the outer contour and each hole of a body enclose."""
    return [shapely.Polygon(ring) for ring in (polygon.exterior, *polygon.interiors)]


def _alike(one: Any, other: Any) -> float:
    """Return the common area of two polygons per area of both together."""
    return float(
        shapely.area(shapely.intersection(one, other)) / shapely.area(shapely.union(one, other))
    )


def _middle(mark: DrawnMark) -> complex:
    """Return a marked point, or the centre of what a contour encloses."""
    if len(mark.points) < 3:
        return sum(mark.points) / len(mark.points)
    centre = shapely.Polygon([(z.real, z.imag) for z in mark.points]).centroid
    return complex(round(centre.x, 4), round(centre.y, 4)) + 0j


def _screws(body: FoundBody) -> int:
    return sum(circle_of(hole) is not None for hole in body.holes)


def _dot(point: complex) -> Any:
    return shapely.Point(point.real, point.imag)


def _line(segment: Segment) -> Any:
    points = segment.at(np.linspace(0, 1, 33 if segment.centre is not None else 2))
    return shapely.LineString(np.column_stack([points.real, points.imag]))


def _said(point: complex) -> str:
    return f"{point.real:.6g},{point.imag:.6g}"
