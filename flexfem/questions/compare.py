"""Where a drawing, or another mechanism, departs from a mechanism, and what that does."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely

from flexfem.arrays import short_repr
from flexfem.files.refusals import checked_path, place_of
from flexfem.importing.departure import Departure, departure, fine_polygon
from flexfem.importing.drawings import NO_READING, Reading, imported, is_drawing, load
from flexfem.importing.roles import Wishes
from flexfem.mechanism.hinge_place import joint_polygon
from flexfem.mechanism.layout import Joint, Layout, Move
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.outlines import polygon_points
from flexfem.mechanism.plate import body_polygon, plate_polygon
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profiles import Circular, Leaf
from flexfem.questions.modes import modes
from flexfem.questions.stiffness import stiffness
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS

# distance of a hinge from that of the mechanism, per its length, up to which they are the same one
NEAR = 0.5
# area of which only one plate consists, per area, up to which both have the same axes
SAME_FRAME = 0.05
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


class ComparedNumber(NamedTuple):
    """A quantity of the mechanism and of the other plate, and the change."""

    quantity: str
    mechanism: float
    other: float
    change_percent: float


@short_repr
class Comparison(NamedTuple):
    """Departure of a plate from a mechanism.

    edge_off_um, edge_off_at_mm : largest distance of an edge, and its place; edge_off : at which
    part, and which way.
    area_off : area of which only one of the plates consists, per area of the mechanism.
    """

    file: str
    name: str
    other: str
    edge_off_um: float
    edge_off_at_mm: tuple[float, float]
    edge_off: str
    area_off: float
    hinges: list[ComparedHinge]
    numbers: list[ComparedNumber]
    notes: list[str]
    warnings: list[str]


def compare(
    *files: Path,
    reading: Reading = NO_READING,
    models: Literal["analytic", "elements"] = "analytic",
) -> Comparison:
    """Show where a drawing, or another mechanism, departs from a mechanism, and what that does to
    stiffness.

    Parameters
    ----------
    *files : path
        A drawing and a mechanism file in either order, or the mechanism and another one. A drawing
        takes thickness, material, ground and output from the mechanism where they are not stated.
    reading : Reading
        Of the drawing: its units, part and so on.
    models : {"analytic", "elements"}
        Model of stiffness and frequency.

    Raises
    ------
    BadInput
        There are not two files, one of them cannot be read, or both are drawings without thickness
        and material.
    """
    if len(files) != 2:
        raise BadInput(
            f"{len(files)} files, expected two: a drawing and a mechanism file, or two mechanism "
            "files"
        )
    paths = [checked_path(path) for path in files]
    if is_drawing(paths[0]) and not is_drawing(paths[1]):
        paths.reverse()
    base = _mechanism(paths[0], reading if is_drawing(paths[0]) else NO_READING)
    notes = list[str]()
    if is_drawing(paths[1]):
        other, move = _drawn(paths[1], reading, base, notes)
    else:
        other = _mechanism(paths[1])
        move = Move()
    compared = [*_hinges(base.layout, other.layout, move)]
    hinges = [each for each in compared if each.other or any(each[1:-1])]
    if len(hinges) < len(compared):
        notes.append(
            f"{len(compared) - len(hinges)} of {len(compared)} hinges are equal, and not listed"
        )
    found = departure(fine_polygon(base.layout), moved(fine_polygon(other.layout), move))
    return Comparison(
        file=str(paths[0]),
        name=base.name,
        other=str(paths[1]),
        edge_off_um=_digits(1e3 * found.largest, 3),
        edge_off_at_mm=(_digits(found.place.real), _digits(found.place.imag)),
        edge_off=_part_at(base.layout, found),
        area_off=_digits(found.area, 3),
        hinges=hinges,
        numbers=[*_numbers(base, other, models)],
        notes=notes,
        warnings=[],
    )


def _mechanism(path: Path, reading: Reading = NO_READING) -> Mechanism:
    """Load a mechanism file or a drawing. Raises BadInput for another kind of file."""
    mechanism = load(path, reading)
    if mechanism.kind != MechanismFile.kind:
        raise BadInput(
            f"{place_of(path)}: this is a {mechanism.kind}, expected a mechanism file or a drawing"
        )
    return mechanism


def _drawn(
    path: Path, reading: Reading, base: Mechanism, notes: list[str]
) -> tuple[Mechanism, Move]:
    """Return the mechanism of a drawing with the roles of the parts of another, and the move to its
    axes.
    """
    stated = reading._replace(material=reading.material or "al-7075-t6")
    if reading.thickness is None:
        stated = stated._replace(thickness=float(base.thickness))
    plate = imported(path, stated)
    move = registered(base.layout, plate.mechanism.layout)
    if move != Move():
        turn = math.degrees(cmath.phase(move.factor))
        flipped = ", turned over" if move.mirrored else ""
        notes.append(
            f"the drawing has other axes: it was turned by {turn:.6g} degrees{flipped} and moved "
            f"by {move.shift.real:.6g}, {move.shift.imag:.6g} mm"
        )
    if reading.wishes == Wishes():
        plate = imported(path, stated, wishes=_wishes(base.layout, move))
    mechanism: Mechanism = plate.mechanism
    if not reading.material:
        mechanism = mechanism.replace(material=base.material.model_dump(exclude_none=True))
    return mechanism, move


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


def _wishes(base: Layout, move: Move) -> Wishes:
    """Return the ground and the output of a layout as points of a drawing that a move takes to its
    axes.
    """
    back = inverse(move)
    ground = list[complex]()
    for index, body in enumerate(base.bodies):
        if body.fixed:
            ground.append(back(_inside(body_polygon(base, index))))
        ground += [back(complex(body.outline[segment].at(0.5))) for segment in body.clamped]
    output = base.points[0][1]
    return Wishes(tuple(ground), back(_inside(body_polygon(base, output.body))), back(output.point))


def inverse(move: Move) -> Move:
    """Return the move that takes moved points back."""
    factor = move.factor if move.mirrored else move.factor.conjugate()
    back = Move(factor, 0j, move.mirrored)
    return back._replace(shift=-back(move.shift))


def _inside(polygon: Any) -> complex:
    point = shapely.point_on_surface(polygon)
    return complex(point.x, point.y)


def _hinges(
    base: Layout,
    other: Layout,
    move: Move,
) -> Iterator[ComparedHinge]:
    """Yield the differences of all hinges, and the hinges that only one of the plates has."""
    places = np.array([move(joint.place) for joint in other.joints])
    taken = set[int]()
    for joint in base.joints:
        gaps = np.abs(places - joint.place)
        nearest = int(np.argmin(gaps)) if len(gaps) else -1
        if nearest < 0 or gaps[nearest] > NEAR * joint.profile.length or nearest in taken:
            yield ComparedHinge(joint.name, None, None, None, None, "there is none at its place")
            continue
        taken.add(nearest)
        yield _compared(joint, other.joints[nearest], move)
    for index, joint in enumerate(other.joints):
        if index not in taken:
            at = f"{places[index].real:.4g}, {places[index].imag:.4g} mm"
            yield ComparedHinge(
                joint.name, None, None, None, None, f"at {at}, not in the mechanism"
            )


def _compared(
    one: Joint,
    other: Joint,
    move: Move,
) -> ComparedHinge:
    first = one.profile
    second = other.profile
    angle = move.heading(other.heading) - one.heading
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
        off_um=_microns(abs(move(other.place) - one.place)),
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


def _numbers(
    base: Mechanism, other: Mechanism, models: Literal["analytic", "elements"]
) -> Iterator[ComparedNumber]:
    """Yield stiffness in all directions and the first frequency of both plates."""
    if not (base.layout.joints and other.layout.joints):
        models = "elements"
    answers = [stiffness(each, models=models, no_limits=True) for each in (base, other)]
    for others in ("held", "free"):
        values = [np.ravel(found.at(others)) for found in answers]
        units = np.ravel(answers[0].unit(others))
        for direction, unit, first, second in zip(DIRECTIONS, units, *values, strict=True):
            yield _number(
                f"stiffness {direction}, others {others} ({unit})", float(first), float(second)
            )
    frequencies = list[float]()
    for each in (base, other):
        found = modes(each, models=models, count=1)
        frequencies.append(float(np.ravel(found.at("frequency"))[0]))
    yield _number("first frequency (Hz)", *frequencies)


def _number(
    quantity: str,
    first: float,
    second: float,
) -> ComparedNumber:
    change = 100 * (second / first - 1) if first else math.nan
    return ComparedNumber(quantity, _digits(first), _digits(second), _digits(round(change, 4), 3))


def _microns(difference: float) -> float:
    microns = 1e3 * difference
    return 0.0 if abs(microns) < SIGNIFICANT else _digits(microns, 4)


def _digits(value: float, count: int = 6) -> float:
    return float(f"{value:.{count}g}")
