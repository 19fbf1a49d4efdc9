"""The numbers a stage file can give, by key path: what a factor can set, its limits and its unit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache, lru_cache
from types import UnionType
from typing import Annotated, Any, NamedTuple, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import ABOUT, KeyPath, key_path, path_of, problem_of, suggestion
from flexfem.mechanism.actuators import Actuator, ActuatorNumbers
from flexfem.mechanism.materials import FATIGUE
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import OF_ACTUATORS, Hinge, actuators_of
from flexfem.units import unit_of

LIFE_CONSTANTS = FATIGUE[:3]  # those of `Designs.fatigue`
EXPANDING = ("material", "frame")  # tables of those of `Designs.expansion`
NEEDED = {"tilt": "arm", "ball_youngs_modulus": "ball_radius", "ball_poissons_ratio": "ball_radius"}


class Key(NamedTuple):
    """One number of a stage file.

    path : as written in files, `hinges.base.neck_mm`, `chain.link_lengths_mm[0]`, `override.2.elbow.neck_mm`.
    table : the tables on the way, ("hinges", "base"); ("override", "2", "elbow") for one of the nine hinges;
        ("actuator", "base"), and ("override", "2", "actuator", "base") on one chain.
    attribute : its name in the model.   element : place in an array, else None.
    check : what the file format says of the number.
    """

    path: str
    table: tuple[str, ...]
    attribute: str
    element: int | None
    check: TypeAdapter[float]

    @property
    def unit(self) -> float:
        """Inside units per file unit."""
        return 1 / unit_of(self.path).factor

    def expected(self, value: float) -> str | None:
        """What the file format expects instead of `value` (file units), None where it is possible."""
        try:
            self.check.validate_python(float(value))
        except ValidationError as error:
            return problem_of(error.errors(include_url=False)[0], {}).expected
        return None

    def impossible(self, values: Array) -> AnyArray:
        """Which values (...), file units, no file can give.

        The possible ones of either sign fill an interval, some beside zero, so the ends of each sign decide.
        """
        below, above = values < 0, values > 0
        signs = (values[below], values[~(below | above)], values[above])  # those between are zero, or nan
        ends = [part(each) for each in signs if each.size for part in (np.min, np.max)]
        if all(self.expected(end) is None for end in ends):
            return np.zeros(values.shape, dtype=bool)
        found: AnyArray = np.vectorize(lambda value: self.expected(value) is not None, otypes=[bool])(values)
        return found

    def places_in(self, stage: Stage) -> list[tuple[str, tuple[int, ...]]]:
        """Fields of `designs.Designs` that it sets and where in them; none where no model asks for it.

        A hinge or an actuator with an override of its own does not follow the one it overrides; on the expansions drift
        alone depends, on fatigue constants lives alone, and on the density natural frequencies alone.
        """
        if self.of_drive:
            return [("actuator", place) for place in self._actuators_in(stage)]
        if self.table[:1] == ("override",):
            return [(self.attribute, (int(self.table[1]) - 1, HINGE_NAMES.index(self.table[2])))]
        if self.table[:1] == ("hinges",):
            own = {o.place for o in stage.override if getattr(o, self.attribute) is not None}
            position = HINGE_NAMES.index(self.table[1])
            return [(self.attribute, (chain - 1, position)) for chain in CHAINS if (chain, self.table[1]) not in own]
        if self.attribute in LIFE_CONSTANTS:
            return [("fatigue", (LIFE_CONSTANTS.index(self.attribute),))]
        if self.attribute == "expansion":
            return [("expansion", (EXPANDING.index(self.table[0]),))]
        if self.attribute in FATIGUE:
            return []
        field = "_".join((*self.table[:1], self.attribute)) if self.attribute == "radius" else self.attribute
        return [(field, () if self.element is None else (self.element,))]

    @property
    def of_drive(self) -> bool:
        """Whether it is a number of an actuator, of all chains or of one."""
        return "actuator" in self.table[::2]

    def _actuators_in(self, stage: Stage) -> list[tuple[int, ...]]:
        """Chain, actuator and number that it sets, where the actuator there states it or it stands for itself alone."""
        own = {o.place for o in stage.override if o.actuator and getattr(o, self.attribute) is not None}
        name, mine = self.table[-1], self.table[0] == "override"
        number = ActuatorNumbers._fields.index({None: self.attribute, 0: "x", 1: "y"}[self.element])
        stated = NEEDED.get(self.attribute, self.attribute)  # or need not be stated beside this
        return [
            (chain - 1, index, number)
            for chain in ((int(self.table[1]),) if mine else CHAINS)
            for index, each in enumerate(actuators_of(stage)[chain - 1])
            if each.name == name
            and (mine or (chain, "actuator", name) not in own)
            and getattr(each, stated) is not None
        ]

    def value_in(self, stage: Stage) -> float | None:
        """The stage's own value in file units; None where it takes a default."""
        if self.of_drive:
            row = actuators_of(stage)[int(self.table[1]) - 1] if self.table[0] == "override" else stage.actuator
            named = [each for each in row if each.name == self.table[-1]]
            value = getattr(named[0], self.attribute) if named else None
        elif self.table[:1] == ("override",):
            value = getattr(stage.hinge(int(self.table[1]), self.table[2]), self.attribute)
        else:
            found: Any = stage
            for name in self.table:
                found = getattr(found, name)
            value = getattr(found, self.attribute)
        value = value if self.element is None or value is None else value[self.element]
        return None if value is None else value / self.unit


class Keys(dict[str, Key]):
    """All of them by path, in the order of the format; those of actuators, whose names are the file's, when asked."""

    def __missing__(self, path: str) -> Key:
        found = _actuator_key(path)
        if found is None:
            raise KeyError(path)
        return found

    def __contains__(self, path: object) -> bool:
        return super().__contains__(path) or (isinstance(path, str) and _actuator_key(path) is not None)


@lru_cache(maxsize=256)
def _actuator_key(path: str) -> Key | None:
    """The number of an actuator that a path names as files write it, None where it names none."""
    with suppress(ValueError):
        parts = path_of(path)
        element = parts[-1] if parts and isinstance(parts[-1], int) else None
        *tables, key = parts if element is None else parts[:-1]
        known = _actuator_keys().get((str(key), element)) if _of_actuator(tables) else None
        if known is not None and key_path(parts) == path:
            return known._replace(path=path, table=tuple(map(str, tables)))
    return None


def _of_actuator(tables: list[str | int]) -> bool:
    chains = tuple(map(str, CHAINS))
    match tables:
        case ["actuator", str()]:
            return True
        case ["override", str(chain), "actuator", str()]:
            return chain in chains
    return False


@cache
def _actuator_keys() -> dict[tuple[str, int | None], Key]:
    """The numbers of an actuator by key and place in an array."""
    found = _numbers(Actuator, ("actuator", "name"))
    return {(str(path_of(each.path)[2]), each.element): each for each in found if each.attribute in OF_ACTUATORS}


@cache
def keys() -> Keys:
    """All of them."""
    return Keys({key.path: key for key in _keys()})


def starred(pattern: str) -> tuple[str, ...]:
    """The key paths that a pattern with stars for hinges or chains names, none when it names none."""
    if pattern.startswith("override.*.actuator.") and "*" not in pattern[len("override.*") :]:
        found = tuple(pattern.replace("*", str(chain), 1) for chain in CHAINS)
        return found if found[0] in keys() else ()
    *tables, last = pattern.split(".")
    if tables[:1] not in (["hinges"], ["override"]) or "*" in last:
        return ()
    parts = ("[^.]+" if part == "*" else re.escape(part) for part in (*tables, last))
    matching = re.compile(r"\.".join(parts))
    return tuple(path for path in keys() if matching.fullmatch(path))


def meant(name: str, known: Iterable[str]) -> str:
    """What may be meant by a name that is no key path, as a refusal goes on; a member of an array goes by no place."""
    with suppress(ValueError):
        match path_of(name):
            case [str(array), int(), *below] if array in ABOUT:
                about = ".".join(f"<{key}>" for key in ABOUT[array])
                return f", did you mean {array}.{about}.{key_path(tuple(below))}?"
            case [*tables, str()] if _of_actuator(tables):
                return suggestion(name, [key_path((*tables, key)) for key, place in _actuator_keys() if place is None])
    return suggestion(name, known)


def _keys() -> Iterator[Key]:
    yield from _numbers(Stage, ())
    for chain in CHAINS:
        for name in HINGE_NAMES:
            yield from _numbers(Hinge, ("override", str(chain), name))


def _numbers(model: type[BaseModel], table: tuple[str, ...]) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        kind, path = field.annotation, (*table, field.alias or name)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _numbers(kind, (*table, name))
        elif (members := _members(kind)) is not None:
            for index, each in enumerate(members if all(map(_is_float, members)) else ()):
                yield _key((*path, index), table, name, index, each)
        elif _is_float(kind):
            limited = Annotated[kind, *field.metadata] if field.metadata else kind
            yield _key(path, table, name, None, limited)


def _members(kind: Any) -> tuple[Any, ...] | None:
    """The types of the members of an array of fixed length, or of one that may be left out; None for another type."""
    if get_origin(kind) is tuple and Ellipsis not in get_args(kind):
        return get_args(kind)
    found = [_members(inner) for inner in get_args(kind) if get_origin(kind) is UnionType]
    return next((each for each in found if each is not None), None)


def _is_float(kind: Any) -> bool:
    return kind is float or any(_is_float(inner) for inner in get_args(kind))


def _key(path: KeyPath, table: tuple[str, ...], attribute: str, index: int | None, kind: Any) -> Key:
    check = TypeAdapter(kind, config=ConfigDict(strict=True, allow_inf_nan=False))
    return Key(key_path(path), table, attribute, index, check)
