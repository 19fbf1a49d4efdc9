"""How the plate of a mechanism departs from that of another: by hinge, and at the edge."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.importing.departure import Departure, departure, fine_polygon
from flexfem.mechanism.hinge_place import joint_polygon
from flexfem.mechanism.layout import Joint, Layout, Move
from flexfem.mechanism.outlines import polygon_points
from flexfem.mechanism.plate import plate_polygon
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profiles import Circular, Leaf

# distance of a hinge from that of the mechanism, per its length, up to which they are the same one
NEAR = 0.5
# area of which only one plate consists, per area, up to which both have the same axes
SAME_FRAME = 0.05
# area of which only one plate consists, per area, above which a plate is another design
OTHER_DESIGN = 0.5
SIGNIFICANT = 1e-4  # um, a smaller difference is round-off
QUARTERS = (1, 1j, -1, -1j)


class ComparedHinge(NamedTuple):
    """Differences of a hinge from that of the mechanism; `radius_um`: of its notches or fillets,
    `off_um`: its centre.

    other : what else is different.
    """

    hinge: str
    neck_um: float | None
    length_um: float | None
    radius_um: float | None
    off_um: float | None
    other: str


class ComparedPlate(NamedTuple):
    """Departure of a plate from that of the first mechanism.

    edge_off_um, edge_off_at_mm : largest distance of an edge, and its place; edge_off : at which
    part, and which way.
    area_off : area of which only one of the plates consists, per area of the first.
    hinges : those that differ.   equal_hinges : number of the others.
    other_design : whether the areas differ so much that hinges and edges do not correspond.
    """

    mechanism: str
    edge_off_um: float
    edge_off_at_mm: tuple[float, float]
    edge_off: str
    area_off: float
    hinges: list[ComparedHinge]
    equal_hinges: int
    other_design: bool


def compared_plate(
    label: str,
    base: Layout,
    other: Layout,
) -> ComparedPlate:
    """Return the departure of a plate from the first one."""
    compared = [*_hinges(base, other)]
    hinges = [each for each in compared if each.other or any(each[1:-1])]
    found = departure(fine_polygon(base), fine_polygon(other))
    return ComparedPlate(
        mechanism=label,
        edge_off_um=_digits(1e3 * found.largest, 3),
        edge_off_at_mm=(_digits(found.place.real), _digits(found.place.imag)),
        edge_off=_part_at(base, found),
        area_off=_digits(found.area, 3),
        hinges=hinges,
        equal_hinges=len(compared) - len(hinges),
        other_design=found.area > OTHER_DESIGN,
    )


def registered(base: Layout, other: Layout) -> Move:
    """Return the move of the second plate after which it covers the first best."""
    one = plate_polygon(base)
    two = plate_polygon(other)
    if _area_off(one, two) <= SAME_FRAME:
        return Move()
    found = list[tuple[float, Move]]()
    for turn, mirrored in product(QUARTERS, (False, True)):
        turned = moved(two, Move(turn, 0j, mirrored))
        for corner in (0, 2):
            shift = _corner(one, corner) - _corner(turned, corner)
            move = Move(turn, shift, mirrored)
            found.append((_area_off(one, moved(two, move)), move))
    off, best = min(found, key=lambda each: each[0])
    return best if off < _area_off(one, two) else Move()


def is_other_design(
    base: Layout,
    other: Layout,
    move: Move,
) -> bool:
    """Return whether the areas of two plates differ so much that their parts do not correspond."""
    return _area_off(plate_polygon(base), moved(plate_polygon(other), move)) > OTHER_DESIGN


def _corner(shape: Any, first: int) -> complex:
    bounds = shapely.total_bounds(shape)
    return complex(bounds[first], bounds[first + 1])


def _area_off(one: Any, other: Any) -> float:
    return float(shapely.area(shapely.symmetric_difference(one, other)) / shapely.area(one))


def moved(shape: Any, move: Move) -> Any:
    """Return a moved polygon."""
    if move == Move():
        return shape

    def image(points: Any) -> Any:
        z = move(points[:, 0] + 1j * points[:, 1])
        return np.column_stack([z.real, z.imag])

    return shapely.transform(shape, image)


def _hinges(base: Layout, other: Layout) -> Iterator[ComparedHinge]:
    """Yield the differences of all hinges, and the hinges that only one of the plates has."""
    places = np.array([joint.place for joint in other.joints])
    taken = set[int]()
    for joint in base.joints:
        gaps = np.abs(places - joint.place)
        nearest = int(np.argmin(gaps)) if len(gaps) else -1
        if nearest < 0 or gaps[nearest] > NEAR * joint.profile.length or nearest in taken:
            yield ComparedHinge(joint.name, None, None, None, None, "there is none at its place")
            continue
        taken.add(nearest)
        yield _compared(joint, other.joints[nearest])
    for index, joint in enumerate(other.joints):
        if index not in taken:
            at = f"{places[index].real:.4g}, {places[index].imag:.4g} mm"
            yield ComparedHinge(
                joint.name, None, None, None, None, f"at {at}, not in the mechanism"
            )


def _compared(one: Joint, other: Joint) -> ComparedHinge:
    first = one.profile
    second = other.profile
    angle = other.heading - one.heading
    turned = math.degrees(cmath.phase(cmath.exp(2j * angle))) / 2  # a neck has no sense
    remarks = list[str]()
    if type(first) is not type(second):
        remarks.append(f"{_shape(second)} instead of {_shape(first)}")
    if abs(turned) > 1e-3:
        remarks.append(f"turned by {turned:.3g} degrees")
    return ComparedHinge(
        hinge=one.name,
        neck_um=_microns(second.neck - first.neck),
        length_um=_microns(second.length - first.length),
        radius_um=_larger_radius(first, second),
        off_um=_microns(abs(other.place - one.place)),
        other=", ".join(remarks),
    )


def _larger_radius(first: Profile, second: Profile) -> float | None:
    """Return the difference of the radii, um; None if one of both has none."""
    before = _radius(first)
    after = _radius(second)
    if before is None or after is None:
        return None
    return _microns(after - before)


def _shape(profile: Profile) -> str:
    return type(profile).__name__.lower()


def _radius(profile: Profile) -> float | None:
    """Return the radius of the notches or fillets, mm; None of a hinge without one."""
    if isinstance(profile, Leaf):
        return profile.fillet
    radius = profile.radius if isinstance(profile, Circular) else profile.root_radius
    return radius if math.isfinite(radius) else None


def _part_at(layout: Layout, found: Departure) -> str:
    """Return at which part an edge departs most, and which way."""
    point = shapely.Point(found.place.real, found.place.imag)
    parts = [(joint.name, joint_polygon(joint)) for joint in layout.joints]
    parts += [(body.name, shapely.Polygon(polygon_points(body.outline))) for body in layout.bodies]
    gaps = [shapely.distance(polygon.exterior, point) for _, polygon in parts]
    name = parts[int(np.argmin(np.round(gaps, 6)))][0]
    return f"at {name}: {'less' if found.inside else 'more'} material"


def _microns(difference: float) -> float:
    microns = 1e3 * difference
    return 0.0 if abs(microns) < SIGNIFICANT else _digits(microns, 4)


def _digits(value: float, count: int = 6) -> float:
    return float(f"{value:.{count}g}")
