"""Numbers by which a drawing of a mechanism can be moved: motions, forces and stress per unit load.

They are those of the analytic model with rigid bodies, linear, for pages that answer a hand without
the server that made them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.analytic.plates import compliance_ratios, inertia, moving_bodies, respond
from flexfem.arrays import Array
from flexfem.mechanism.layout import Joint, Layout, Patch, Port
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import body_polygon
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_beam import MIDPLANE_SHEAR, SIDES
from flexfem.questions.ranges import SAME_PATH
from flexfem.questions.stiffness import Stiffness, stiffness
from flexfem.units import DIRECTIONS

MODES = 3  # that are drawn
SECTIONS = 32  # of a hinge at which its stress is computed, half of all
PIECES = 9  # points between two breaks of the edge of a hinge where it is drawn
DIGITS = 6  # significant digits of numbers, and
DECIMALS = 3  # decimals of coordinates, mm, in pages


class HandledHinge(NamedTuple):
    """A hinge: how it is drawn between its bodies, and its stress.

    bodies : indices of `Handled.bodies`, -1 for the ground.   place : x, y, mm.   heading : rad.
    edges : rows x, upper and lower edge, mm, in its frame.   strength : MPa.
    stress : (n, k), MPa per unit load on each port, at both edges of some sections.
    axis : (2, k), the same on the axis at the neck, by tension and by shear, which add as squares.
    """

    name: str
    bodies: tuple[int, int]
    place: list[float]
    heading: float
    edges: list[list[float]]
    strength: float
    stress: list[list[float]]
    axis: list[list[float]]


class HandledMode(NamedTuple):
    """A natural mode: its frequency, Hz, and twists (b, 3) of the bodies at the origin."""

    frequency: float
    twists: list[list[float]]


class HandledActuator(NamedTuple):
    """An actuator: its ends x1, y1, x2, y2, mm, its bodies, and its free stroke, mm."""

    name: str
    ends: list[float]
    bodies: tuple[int, int]
    stroke: float


class HandledRange(NamedTuple):
    """Ends of the range of the output in one direction, mm or rad, and what limits each."""

    low: float
    high: float
    below: str
    above: str


class Handled(NamedTuple):
    """A mechanism that can be moved. Ports are x, y, theta of the output, then the actuators.

    box : left, low, width, height, mm.   ground, bodies : paths in the notation of SVG.
    output : x, y, mm.   output_body : its index.   compliance : (k, k), of the ports.
    twists : (b, 3, k), of the bodies at the origin, per unit load on each port.
    range : of x, y and theta, the other directions free; empty where it is not known.
    """

    box: list[float]
    ground: list[str]
    bodies: list[str]
    hinges: list[HandledHinge]
    actuators: list[HandledActuator]
    output: list[float]
    output_body: int
    compliance: list[list[float]]
    twists: list[list[list[float]]]
    modes: list[HandledMode]
    range: list[HandledRange]


def handled(mechanism: Mechanism, at_rest: Stiffness | None = None) -> Handled | None:
    """Return the numbers by which a mechanism can be moved.

    It is None for a plate without hinges, and for a mechanism whose file has an analytic model of
    its own, whose numbers differ from those of the network of the layout.

    at_rest : the answer of `stiffness`, whose ranges at finite displacement end the motion; without
    it the motion ends where a hinge yields by linear theory.
    """
    layout = mechanism.layout
    if not layout.joints or mechanism.answering("stiffness") is not None:
        return None
    moving = moving_bodies(layout)
    number = {body: index for index, body in enumerate(moving)}
    units = _unit_responses(layout, moving)
    shapes = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    output = layout.points[0][1]
    return Handled(
        box=_box(shapes),
        ground=[svg_path(shape) for index, shape in enumerate(shapes) if index not in number],
        bodies=[svg_path(shapes[body]) for body in moving],
        hinges=[
            _hinge(layout, joint, number, wrenches)
            for joint, wrenches in zip(layout.joints, units.wrenches, strict=True)
        ],
        actuators=_actuators(layout, number),
        output=[output.point.real, output.point.imag],
        output_body=number[output.body],
        compliance=_significant(units.compliance),
        twists=_significant(units.twists),
        modes=_modes(layout, len(moving)),
        range=[] if at_rest is None else _ranges(at_rest),
    )


class _UnitResponses(NamedTuple):
    """Responses to unit loads on k ports: x, y, theta of the output, then the actuators.

    compliance : (k, k).   twists : (b, 3, k), of the bodies at the origin.
    wrenches : (h, 3, k), of the hinges, by which their stress has the thickness of the plate.
    """

    compliance: Array
    twists: Array
    wrenches: Array


def _unit_responses(layout: Layout, moving: Sequence[int]) -> _UnitResponses:
    ports = [layout.ports[index] for index in (*range(3), *layout.drive_ports)]
    of_bodies = [_port_of_body(body, row) for body in moving for row in range(3)]
    found = respond(layout, ports=[*ports, *of_bodies])
    k = len(ports)
    return _UnitResponses(
        found.compliance[:k, :k],
        found.compliance[k:, :k].reshape(-1, 3, k),
        compliance_ratios(layout)[:, :, None] * found.wrenches[:, :, :k],
    )


def _box(shapes: Sequence[Any]) -> list[float]:
    """Return left, low, width and height of shapes, mm."""
    left, low, right, high = shapely.total_bounds(np.array(shapes))
    return _rounded(np.array([left, low, right - left, high - low]))


def quick_stiffness(mechanism: Mechanism, **asked: Any) -> Stiffness:
    """Return the answer of `stiffness` without ranges, where leaving them out is an option."""
    if mechanism.answering("stiffness") is None:
        asked["no_limits"] = True
    found: Stiffness = stiffness(mechanism, **asked)
    return found


def plain(value: Any) -> Any:
    """Return named tuples as mappings, also within lists."""
    if hasattr(value, "_asdict"):
        return {name: plain(part) for name, part in value._asdict().items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return value


def _port_of_body(body: int, row: int) -> Port:
    """Return the port of one component of the twist of a body at the origin."""
    unit = tuple(np.eye(3)[row].tolist())
    return Port(f"body {body} {row}", row == 2, ((Patch(body, 0j), unit),))


def _hinge(
    layout: Layout,
    joint: Joint,
    number: dict[int, int],
    wrenches: Array,
) -> HandledHinge:
    profile = joint.profile
    breaks = np.unique(np.array(profile.breaks, dtype=float))
    x = np.unique(np.linspace(breaks[:-1], breaks[1:], PIECES))
    middle = profile.middle(x)
    half = profile.height(x) / 2
    material = layout.material_of(joint)
    first, second = (number.get(body, -1) for body in joint.bodies)
    neck = layout.thickness * profile.neck
    on_axis = np.diag([_von_mises(material.out_of_plane), MIDPLANE_SHEAR, 0.0])[:2] / neck
    return HandledHinge(
        name=joint.name,
        bodies=(first, second),
        place=_rounded(np.array([joint.place.real, joint.place.imag])),
        heading=joint.heading,
        edges=[_rounded(row) for row in np.column_stack([x, middle + half, middle - half])],
        strength=material.yield_strength,
        stress=_significant(
            _edge_stress(profile, layout.thickness, material.out_of_plane) @ wrenches
        ),
        axis=_significant(on_axis @ wrenches),
    )


def _von_mises(out_of_plane: float) -> float:
    """Return the von Mises stress per stress along a hinge."""
    return float(np.sqrt(1 - out_of_plane + out_of_plane**2))


def _edge_stress(
    profile: Profile,
    thickness: float,
    out_of_plane: float,
) -> Array:
    """Return the von Mises stress (n, 3) at both edges of some sections per unit wrench.

    With the sign of the stress along the edge, so that it adds; see `Profile.stress`.
    """
    sections = np.unique(profile.sections)
    crowded = np.linspace(0, len(sections) - 1, SECTIONS).round().astype(int)  # at breaks
    even = np.linspace(sections[0], sections[-1], SECTIONS)
    x = np.union1d(sections[crowded], [*even, profile.neck_place])
    area = thickness * profile.height(x)
    arm = x - profile.neck_place
    von_mises = _von_mises(out_of_plane)
    found = list[Array]()
    for side in SIDES:
        K = profile.concentration(x, side)
        lever = 6 * side / profile.height(x)
        of_moment = lever * K.bending
        of_tension = K.tension + of_moment * profile.middle(x)
        of_shear = -of_moment * profile.neck_place - lever * arm * K.shear
        rows = np.broadcast_arrays(of_tension, of_shear, of_moment)
        found.append(von_mises * np.column_stack(rows) / area[:, None])
    return np.concatenate(found)


def _actuators(layout: Layout, number: dict[int, int]) -> list[HandledActuator]:
    found = list[HandledActuator]()
    for actuator in layout.actuators:
        near, far = actuator.contacts
        ends = [near.point.real, near.point.imag, far.point.real, far.point.imag]
        bodies = (number.get(near.body, -1), number.get(far.body, -1))
        found.append(HandledActuator(actuator.name, ends, bodies, actuator.stroke))
    return found


def _modes(layout: Layout, bodies: int) -> list[HandledMode]:
    """Return the lowest modes of the mechanism with its payloads."""
    ports, M = inertia(layout)
    C = respond(layout, ports=ports).compliance
    L = np.linalg.cholesky(M)
    squares, vectors = np.linalg.eigh(L.T @ C @ L)  # 1 / omega^2, and L' q
    found = list[HandledMode]()
    for k in range(1, min(MODES, 3 * bodies) + 1):
        frequency = 1 / (2 * np.pi * np.sqrt(squares[-k]))
        motion = np.linalg.solve(L.T, vectors[:, -k])
        twists = motion[: 3 * bodies].reshape(-1, 3)
        found.append(HandledMode(float(f"{frequency:.5g}"), _significant(twists)))
    return found


def _ranges(at_rest: Stiffness) -> list[HandledRange]:
    """Return the ranges with the other directions free, and what limits them.

    The drawing follows linear theory. Where parts nearly buckle on the way, it ends where linear
    theory has the force of the end of the range.
    """
    if "range" not in at_rest.values:
        return []
    values = at_rest.internal.values
    found = list[HandledRange]()
    for direction in DIRECTIONS:
        at = {"others": "free", "direction": direction}
        ends = list[float]()
        limits = list[str]()
        for sense in ("negative", "positive"):
            place = at | {"sense": sense}
            end = abs(float(at_rest.array_of(values, "range", place)))
            which = int(np.argmax(np.nan_to_num(at_rest.at("range_limit", **place))))
            limit = at_rest.axes["limit"][which]
            force = abs(float(at_rest.array_of(values, "range_force", place)))
            stiffness = float(at_rest.array_of(values, "free", {"direction": direction})[-1])
            if force / stiffness < end / SAME_PATH:
                end = force / stiffness
                limit = "the force at which parts nearly buckle"
            ends.append(end if np.isfinite(end) else np.inf)
            limits.append(limit)
        found.append(HandledRange(-ends[0], ends[1], limits[0], limits[1]))
    return found if np.all(np.isfinite([each[:2] for each in found])) else []


def svg_path(shape: Any) -> str:
    """Return polygons as a path of SVG, mm."""
    parts = list[str]()
    for polygon in shapely.get_parts(shape):
        for ring in (polygon.exterior, *polygon.interiors):
            points = shapely.get_coordinates(ring)[:-1]
            text = " ".join(f"{x:.{DECIMALS}f},{y:.{DECIMALS}f}" for x, y in points)
            parts.append(f"M{text}Z")
    return "".join(parts)


def _rounded(values: Array) -> list[float]:
    return [round(float(value), DECIMALS) for value in values]


def _significant(values: Array) -> Any:
    """Return an array as nested lists with few digits, for small pages."""
    return np.vectorize(lambda value: float(f"{value:.{DIGITS}g}"), otypes=[float])(values).tolist()
