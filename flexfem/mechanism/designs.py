"""Many designs of one mechanism file at once: numbers, places and profiles with a leading axis.

The designs differ in parameters and other numbers of the file; parts, copies and hinge shapes are
those of the file. Every expression is evaluated once for all designs. A number that is the same in
all designs stays one number, so that what depends on it alone is computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from pydantic import BaseModel

from flexfem.arrays import AnyArray, Array
from flexfem.files.expressions import Evaluated, names_in, text_of, value_of
from flexfem.files.quantities import Limits
from flexfem.mechanism.assembly import GROUND, layout_of
from flexfem.mechanism.copies import PlacedPart, placed_parts
from flexfem.mechanism.layout import Constants, Move, Patch
from flexfem.mechanism.layouts import (
    HingeDesigns,
    InputDesigns,
    Layouts,
    Number,
    PayloadDesigns,
    Refusal,
)
from flexfem.mechanism.materials import FATIGUE, Material
from flexfem.mechanism.parts import Copies, MechanismTables, PlateActuator, PlateHinge
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_shape import BadDimension
from flexfem.mechanism.profiles import profile_of
from flexfem.units import without_unit

ENDS = np.array([-0.5, 0.5])  # of the axis of a hinge, per length
REQUIRED = ("youngs_modulus", "poissons_ratio", "density", "yield_strength")  # of a material
LARGEST = 1e300  # of a parameter, as of one file


def unsupported(mechanism: MechanismTables, keys: Iterable[str]) -> str:
    """Return why designs that differ in numbers by key path cannot be arrays, "" if they can.

    keys : such as `parameters.length_mm` and `thickness_mm`.
    """
    if not mechanism.hinge:
        return "a mechanism without hinges"
    if any(each.preload for each in mechanism.actuator):
        return "preloads of actuators"
    if any(material.residual_stress for material in _materials(mechanism)):
        return "a residual stress"
    varied = _varied_names(mechanism, keys)
    if any(_uses(each.count, varied) for each in mechanism.copies):
        return "a number of copies that varies"
    if any(_uses(each.table, varied) for each in mechanism.hinge):
        return "a table of a profile that varies"
    constants = [getattr(each, name) for each in _materials(mechanism) for name in FATIGUE]
    return "fatigue constants that vary" if _uses(tuple(constants), varied) else ""


def _uses(value: Any, names: set[str]) -> bool:
    """Return whether a number, or one of a tuple, is an expression of named parameters."""
    if isinstance(value, tuple):
        return any(_uses(each, names) for each in value)
    return isinstance(value, Evaluated) and not names.isdisjoint(names_in(value.text))


def _materials(mechanism: MechanismTables) -> list[Material]:
    """Return the materials of the plate and of parts with one of their own."""
    stated = [body.material for body in mechanism.body]
    stated += [hinge.material for hinge in mechanism.hinge]
    return [mechanism.material, *(each for each in stated if each is not None)]


def _varied_names(mechanism: MechanismTables, keys: Iterable[str]) -> set[str]:
    """Return the names, without units, of the parameters that differ when numbers by key path do."""
    given = {key.removeprefix("parameters.") for key in keys if key.startswith("parameters.")}
    varied = {without_unit(key) for key in given}
    texts = {
        without_unit(key): text_of(value)
        for key, value in mechanism.parameters.items()
        if key not in given
    }
    uses = {name: {*names_in(text)} for name, text in texts.items() if text}
    while grown := {name for name, used in uses.items() if used & varied} - varied:
        varied |= grown
    return varied


class Numbers:
    """The numbers of a mechanism file for n designs.

    Parameters
    ----------
    given : arrays (n,) by key path, in file units: `parameters.NAME` and numbers of the file.
    """

    def __init__(
        self,
        mechanism: MechanismTables,
        given: Mapping[str, Array],
        count: int,
    ) -> None:
        self.mechanism = mechanism
        self.given = given
        self.count = count
        self.varied = _varied_names(mechanism, given)
        self.refusals = list[Refusal]()
        self._parameters = self._evaluated_parameters()
        self._fields = dict[int, tuple[str, ...]]()
        self._known = dict[tuple[str, float], Array]()
        self._refuse_limits()

    def _evaluated_parameters(self) -> dict[str, Number]:
        """Return the values of all parameters, in file units, by their names without units."""
        stated = self.mechanism.parameters
        keys = {without_unit(key): key for key in stated}
        texts = {
            name: "" if f"parameters.{key}" in self.given else text_of(stated[key])
            for name, key in keys.items()
        }
        uses = {name: names_in(text) if text else () for name, text in texts.items()}
        values = dict[str, Number]()
        for name in TopologicalSorter(uses).static_order():
            path = f"parameters.{keys[name]}"
            if path in self.given:
                values[name] = self.given[path]
            elif name in self.varied:
                found = value_of(texts[name], values)
                values[name] = self._finite(found, path, float(stated[keys[name]]))
            else:
                values[name] = float(stated[keys[name]])
        return values

    def _finite(
        self,
        found: Array,
        path: str,
        instead: float,
    ) -> Array:
        """Return values (n,) of a parameter; designs where they are not finite are refused."""
        finite = np.abs(found) < LARGEST
        self._refuse(
            ~finite,
            lambda design: f"{path}: expected a finite number, or an expression that has one",
        )
        return np.where(finite, found, instead)

    def _refuse(
        self,
        where: AnyArray,
        reason: Callable[[int], str],
    ) -> None:
        if np.any(where):
            self.refusals.append(Refusal(np.broadcast_to(where, (self.count,)), reason))

    def _refuse_limits(self) -> None:
        """Refuse designs with numbers outside the limits of the file.

        The base's take their place.
        """
        for path, value in _numbers_in(self.mechanism):
            if isinstance(value, Evaluated) and self._varies(value):
                found = value_of(value.text, self._parameters)
                found = np.broadcast_to(found, (self.count,))
                outside = value.kind.refuses(found)
                self._refuse(outside, _outside_limits(path, value, found))
                valid = np.where(outside, float(value), value.kind.factor * found)
                key = (value.text, value.kind.factor)
                if key in self._known and np.any(outside):
                    valid = np.where(outside, self._known[key], valid)
                self._known[key] = valid

    def _varies(self, value: Evaluated) -> bool:
        return not self.varied.isdisjoint(names_in(value.text))

    def __call__(self, value: float) -> Number:
        """Return a number of the file in inside units, for all designs or (n,)."""
        if isinstance(value, Evaluated) and self._varies(value):
            return self._known[value.text, value.kind.factor]
        return float(value)

    def at(
        self,
        path: str,
        value: float,
        factor: float = 1.0,
    ) -> Number:
        """Return the number at a key path, which may be given; `factor` as of its `Limits`."""
        return factor * self.given[path] if path in self.given else self(value)

    def at_design(self, value: Any, design: int) -> Any:
        """Return a table, or a number, with the numbers of one design in place of expressions."""
        if isinstance(value, Evaluated):
            return float(self(value)[design]) if self._varies(value) else value  # type: ignore[index]
        if isinstance(value, tuple):
            return tuple(self.at_design(each, design) for each in value)
        changes = {name: self.at_design(getattr(value, name), design) for name in self._in(value)}
        if not changes:
            return value
        copy = BaseModel.model_copy(value, update=changes)
        for name in copy.__dict__.keys() - type(value).model_fields.keys():
            del copy.__dict__[name]  # what was computed from the numbers of the base
        return copy

    def _in(self, table: Any) -> tuple[str, ...]:
        """Return the names of the fields of a table in which numbers vary."""
        if not isinstance(table, BaseModel):
            return ()
        if id(table) not in self._fields:
            names = tuple(name for name, value in table if self._holds(value))
            self._fields[id(table)] = names
        return self._fields[id(table)]

    def _holds(self, value: Any) -> bool:
        """Return whether a value of a table has a number that varies."""
        if isinstance(value, Evaluated):
            return self._varies(value)
        if isinstance(value, tuple):
            return any(map(self._holds, value))
        return bool(self._in(value))

    def point(self, corner: Sequence[float]) -> AnyArray:
        """Return a point of the file, complex, of all designs () or (n,)."""
        return np.asarray(self(corner[0]) + 1j * np.asarray(self(corner[1])))


def _outside_limits(
    path: str,
    value: Evaluated,
    found: Array,
) -> Callable[[int], str]:
    def reason(design: int) -> str:
        number = float(found[design])
        expected = value.kind.expected(number)
        return f"{path} = {value.text!r}, expected {expected}; its value is {number:g}"

    return reason


def _numbers_in(mechanism: MechanismTables) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a file with their key paths, without parameters."""

    def numbers(path: str, value: Any) -> Iterator[tuple[str, float]]:
        if isinstance(value, float):
            yield path, value
        elif isinstance(value, tuple):
            for index, each in enumerate(value):
                yield from numbers(f"{path}[{index}]", each)

    for path, value in mechanism.values.items():
        if not path.startswith(("parameters", "provenance")):
            yield from numbers(path, value)


def layouts_of(
    mechanism: MechanismTables,
    given: Mapping[str, Array],
    count: int,
) -> Layouts:
    """Return the layouts of n designs of a mechanism whose layout is possible.

    Designs that are refused have numbers without a meaning, perhaps nan. `unsupported` must allow
    the keys.

    given : arrays (n,) by key path, in file units, with values inside their limits.
    count : n.
    """
    numbers = Numbers(mechanism, given, count)
    placed = placed_parts(mechanism, lambda copies: _moves(copies, numbers))
    bodies = [part for part in placed if part.kind == "body"]
    index = {part.name: k for k, part in enumerate(bodies)}
    held = tuple(bool(part.table.fixed or part.table.clamped_edges) for part in bodies)
    fixed = (k for k, part in enumerate(bodies) if part.table.fixed)
    index.setdefault(GROUND, next(fixed, -1))
    hinges = list[HingeDesigns]()
    at_output: Any = numbers.point(mechanism.output.at)
    points = [Patch(index[mechanism.output.body], at_output)]
    inputs = list[InputDesigns]()
    refusals = list[Refusal]()
    for part in placed:
        if part.kind == "hinge":
            hinges.append(_hinge(part, numbers, index, bodies, refusals))
        elif part.kind == "point":
            place: Any = part.move(numbers.point(part.table.at))
            points.append(Patch(index[part.bodies[0]], place))
        elif part.kind == "actuator":
            inputs.append(_input(part, numbers, index, refusals))
    plate = _constants(numbers, mechanism.material)
    return Layouts(
        count,
        held,
        tuple(hinges),
        tuple(points),
        tuple(inputs),
        numbers.at("thickness_mm", mechanism.thickness),
        plate.yield_strength,
        (*numbers.refusals, *refusals),
        tuple(_material_of(part, numbers) for part in bodies),
        tuple(_payloads(numbers, points[0])),
        lambda design: layout_of(numbers.at_design(mechanism, design)),
    )


def _payloads(numbers: Numbers, output: Patch) -> Iterator[PayloadDesigns]:
    load = numbers.mechanism.payload
    if load is not None:
        yield PayloadDesigns(output, numbers(load.mass), numbers(load.inertia))


def _material_of(part: PlacedPart, numbers: Numbers) -> Constants:
    """Return the constants of the material of a body or a hinge."""
    if part.table.material is None:
        return _constants(numbers, numbers.mechanism.material)
    return _constants(numbers, part.table.material, f"{part.key}.material")


def _moves(copies: Copies, numbers: Numbers) -> Iterator[Move]:
    """Yield the moves of copies, whose factors and shifts are numbers or arrays (n,)."""
    if copies.mirror is not None:
        first, second = map(numbers.point, copies.mirror)
        turn: Any = (second - first) / (second - first).conjugate()
        yield Move(turn, first - turn * first.conjugate(), mirrored=True)
        return
    count = int(copies.count or 1)
    about = numbers.point(copies.about or (0.0, 0.0))
    angle = 2 * np.pi / count if copies.angle is None else numbers(copies.angle)
    for k in range(1, count):
        step: Any = np.exp(1j * k * np.asarray(angle))
        yield Move(step, about - step * about)


def _heading(move: Move, angle: Number) -> Number:
    """Return the moved direction, rad, of all designs or (n,)."""
    ahead = np.exp(1j * np.asarray(angle))
    return np.angle(move.factor * (ahead.conjugate() if move.mirrored else ahead))


def _constants(
    numbers: Numbers,
    material: Material,
    table: str = "material",
) -> Constants:
    """Return the constants of a material, with numbers or arrays (n,)."""
    found = dict[str, Any]()
    for name in REQUIRED:
        field = Material.model_fields[name]
        limits = next(each for each in field.metadata if isinstance(each, Limits))
        path = f"{table}.{field.alias or name}"
        found[name] = numbers.at(path, getattr(material, name), limits.factor)
    return numbers.mechanism.constants_of(Material.model_construct(name=material.name, **found))


def _hinge(
    part: PlacedPart,
    numbers: Numbers,
    index: Mapping[str, int],
    bodies: Sequence[PlacedPart],
    refusals: list[Refusal],
) -> HingeDesigns:
    table: PlateHinge = part.table
    dimensions = {
        name: _column(numbers(value)) if isinstance(value, float) else value
        for name, value in table.dimensions.items()
    }
    profile = profile_of(table.shape, dimensions)
    ends = (index[part.bodies[0]], index[part.bodies[1]])
    refusals += _refused_profiles(part, profile, numbers)
    if table.cut is not None:
        refusals += _refused_cuts(part, profile, numbers)
    if part.move.mirrored:
        profile = profile.mirrored
    return HingeDesigns(
        part.name,
        ends,
        np.asarray(part.move(numbers.point(table.at))),
        _heading(part.move, numbers(table.direction)),
        profile,
        _material_of(part, numbers),
        part.key,
    )


def _column(number: Number) -> Number:
    """Return a dimension of a profile: one number, or (n, 1)."""
    return number[:, None] if isinstance(number, np.ndarray) else number


def profile_at(profile: Profile, design: int) -> Profile:
    """Return the profile of one design. Raises BadDimension."""
    values = dict[str, Any]()
    for each in fields(profile):
        if each.init:
            value = getattr(profile, each.name)
            values[each.name] = float(value[design, 0]) if isinstance(value, np.ndarray) else value
    return type(profile)(**values)


def _refused_profiles(
    part: PlacedPart,
    profile: Profile,
    numbers: Numbers,
) -> Iterator[Refusal]:
    """Yield the designs whose dimensions no profile can have."""
    impossible = np.broadcast_to(np.squeeze(profile.impossible), (numbers.count,))

    def reason(design: int) -> str:
        try:
            profile_at(profile, design)
        except BadDimension as error:
            key = PlateHinge.model_fields[error.key].alias or error.key
            return f"{part.key}.{key}, expected {error.expected}"
        return part.key

    if np.any(impossible):
        yield Refusal(impossible, reason)


def least_cut(profile: Profile, count: int) -> Array:
    """Return the height (n,) of the lowest box, symmetric about the axis, that contains both ends."""
    ends = ENDS * profile.length
    height = profile.height(ends) + 2 * np.abs(profile.middle(ends))
    return np.broadcast_to(np.max(height, axis=-1), (count,))


def _refused_cuts(
    part: PlacedPart,
    profile: Profile,
    numbers: Numbers,
) -> Iterator[Refusal]:
    """Yield the designs whose cut is lower than the ends of the profile."""
    cut = np.broadcast_to(numbers(part.table.cut), (numbers.count,))
    with np.errstate(all="ignore"):
        least = least_cut(profile, numbers.count)
    low = cut < least

    def reason(design: int) -> str:
        return (
            f"{part.key}.cut_mm = {cut[design]:g}, expected at least {least[design]:g}, the height "
            "that the ends of the profile need"
        )

    if np.any(low):
        yield Refusal(low, reason)


def _input(
    part: PlacedPart, numbers: Numbers, index: Mapping[str, int], refusals: list[Refusal]
) -> InputDesigns:
    places: list[Any] = [part.move(numbers.point(point)) for point in part.table.at]
    between = np.asarray(places[1] - places[0])
    alike = np.broadcast_to(between == 0, (numbers.count,))
    if np.any(alike):
        text = f"{part.key}.at_mm: expected two different points, which give the direction"
        refusals.append(Refusal(alike, lambda design: text))
    with np.errstate(all="ignore"):
        direction = between / np.abs(between)
    near, far = (Patch(index[name], place) for name, place in zip(part.bodies, places, strict=True))
    stroke, stiffness = _rating(part.table, numbers)
    mass = numbers(part.table.mass)
    return InputDesigns(
        part.name,
        (near, far),
        direction,
        stiffness,
        stroke,
        mass,
    )


def _rating(table: PlateActuator, numbers: Numbers) -> tuple[Number, Number]:
    """Return free stroke and stiffness of an actuator, as `RatedActuator.rating`."""
    if table.stack is not None or table.stroke is None:
        return table.rating.stroke, table.rating.stiffness
    stroke = numbers(table.stroke)
    if table.stiffness is not None:
        return stroke, numbers(table.stiffness)
    assert table.blocking_force is not None
    return stroke, numbers(table.blocking_force) / stroke
