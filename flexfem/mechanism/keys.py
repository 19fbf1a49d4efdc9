"""Numbers of a stage file by key path, with limits and units: the quantities that a factor of a study can set."""

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
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import OF_ACTUATORS, Hinge, actuators_of
from flexfem.units import unit_of

PARAMETERS = ("parameters",)  # table of a mechanism file
LIFE_CONSTANTS = FATIGUE[:3]  # in the order of `Designs.fatigue`
EXPANDING = ("material", "frame")  # tables in the order of `Designs.expansion`
# attributes of an actuator that need not be stated, each with the attribute without which it has no effect
NEEDED = {"tilt": "arm", "ball_youngs_modulus": "ball_radius", "ball_poissons_ratio": "ball_radius"}


class Key(NamedTuple):
    """One number of a stage file.

    path : as written in files, `hinges.base.neck_mm`, `chain.link_lengths_mm[0]`, `override.2.elbow.neck_mm`.
    table : enclosing tables, ("hinges", "base"); ("override", "2", "elbow") for one of the nine hinges;
        ("actuator", "base"), and ("override", "2", "actuator", "base") on one chain.
    attribute : name in the model.   element : index in an array, else None.
    check : validates the number by the rules of the file format.
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
        """Return the expectation of the file format that `value` (file units) violates; None if it is valid."""
        try:
            self.check.validate_python(float(value))
        except ValidationError as error:
            return problem_of(error.errors(include_url=False)[0], {}).expected
        return None

    def impossible(self, values: Array) -> AnyArray:
        """Return which values (...), in file units, the file format does not allow.

        The valid values of each sign form one interval, so it is sufficient to check the extremes of each sign.
        """
        below, above = values < 0, values > 0
        signs = (values[below], values[~(below | above)], values[above])  # the middle group is zero or nan
        extremes = [extreme(group) for group in signs if group.size for extreme in (np.min, np.max)]
        if all(self.expected(value) is None for value in extremes):
            return np.zeros(values.shape, dtype=bool)
        invalid: AnyArray = np.vectorize(lambda value: self.expected(value) is not None, otypes=[bool])(values)
        return invalid

    def places_in(self, stage: Stage | Mechanism) -> list[tuple[str, tuple[int, ...]]]:
        """Return the fields of `designs.Designs` that the key sets, with indices; empty if no model uses the key.

        A key of a hinge or an actuator does not set the value of one that has its own override of that key. A key of a
        mechanism is a place itself.
        """
        if isinstance(stage, Mechanism) or self.table == PARAMETERS:
            return [] if self.value_in(stage) is None else [(self.path, ())]
        if self.of_drive:
            return [("actuator", place) for place in self._actuators_in(stage)]
        if self.table[:1] == ("override",):
            return [(self.attribute, (int(self.table[1]) - 1, HINGE_NAMES.index(self.table[2])))]
        if self.table[:1] == ("hinges",):
            overridden = {o.place for o in stage.override if getattr(o, self.attribute) is not None}
            name, position = self.table[1], HINGE_NAMES.index(self.table[1])
            return [(self.attribute, (chain - 1, position)) for chain in CHAINS if (chain, name) not in overridden]
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
        """Whether the key is one of an actuator, on all chains or on one."""
        return "actuator" in self.table[::2]

    def _actuators_in(self, stage: Stage) -> list[tuple[int, ...]]:
        """Indices of chain, actuator and number that the key sets, for actuators that use the number."""
        overridden = {o.place for o in stage.override if o.actuator and getattr(o, self.attribute) is not None}
        name, on_one_chain = self.table[-1], self.table[0] == "override"
        number = ActuatorNumbers._fields.index({None: self.attribute, 0: "x", 1: "y"}[self.element])
        stated = NEEDED.get(self.attribute, self.attribute)
        return [
            (chain - 1, index, number)
            for chain in ((int(self.table[1]),) if on_one_chain else CHAINS)
            for index, actuator in enumerate(actuators_of(stage)[chain - 1])
            if actuator.name == name
            and (on_one_chain or (chain, "actuator", name) not in overridden)
            and getattr(actuator, stated) is not None
        ]

    def value_in(self, stage: Stage | Mechanism) -> float | None:
        """Value of the stage in file units; None where the stage uses a default, or has no such key."""
        value: Any
        if not self._is_in(stage):
            return None
        if isinstance(stage, Mechanism) and self.table == PARAMETERS:
            return float(stage.parameters[self.attribute])
        if isinstance(stage, Stage) and self.of_drive:
            row = actuators_of(stage)[int(self.table[1]) - 1] if self.table[0] == "override" else stage.actuator
            named = [actuator for actuator in row if actuator.name == self.table[-1]]
            value = getattr(named[0], self.attribute) if named else None
        elif isinstance(stage, Stage) and self.table[:1] == ("override",):
            value = getattr(stage.hinge(int(self.table[1]), self.table[2]), self.attribute)
        else:
            table: Any = stage
            for name in self.table:
                table = getattr(table, name)
            value = getattr(table, self.attribute)
        value = value if self.element is None or value is None else value[self.element]
        return None if value is None else value / self.unit

    def _is_in(self, stage: Stage | Mechanism) -> bool:
        """Return whether files of the kind of a stage or mechanism have the key."""
        if isinstance(stage, Mechanism):
            is_stated = self.attribute in stage.parameters
            return is_stated if self.table == PARAMETERS else self.table in ((), ("material",), ("frame",))
        return self.table != PARAMETERS


class Keys(dict[str, Key]):
    """All keys by path, in the order of the format; keys of actuators, named in the file, exist for look-up only."""

    def __missing__(self, path: str) -> Key:
        key = _actuator_key(path) or _parameter_key(path)
        if key is None:
            raise KeyError(path)
        return key

    def __contains__(self, path: object) -> bool:
        return super().__contains__(path) or (
            isinstance(path, str) and (_actuator_key(path) or _parameter_key(path)) is not None
        )


def _parameter_key(path: str) -> Key | None:
    """Return the key of a parameter of a mechanism file, in the unit of its name; None for other paths."""
    table, _, name = path.partition(".")
    is_parameter = (table,) == PARAMETERS and name.isidentifier()
    return _key((table, name), PARAMETERS, name, None, float) if is_parameter else None


@lru_cache(maxsize=256)
def _actuator_key(path: str) -> Key | None:
    """Return the key of an actuator that a path denotes in the form of files, None if it denotes none."""
    with suppress(ValueError):
        parts = path_of(path)
        element = parts[-1] if parts and isinstance(parts[-1], int) else None
        *tables, key = parts if element is None else parts[:-1]
        found = _actuator_keys().get((str(key), element)) if _of_actuator(tables) else None
        if found is not None and key_path(parts) == path:
            return found._replace(path=path, table=tuple(map(str, tables)))
    return None


def _of_actuator(tables: list[str | int]) -> bool:
    match tables:
        case ["actuator", str()]:
            return True
        case ["override", str(chain), "actuator", str()]:
            return chain in map(str, CHAINS)
    return False


@cache
def _actuator_keys() -> dict[tuple[str, int | None], Key]:
    """Keys of an actuator by name and index in an array."""
    actuator_keys = _keys_of(Actuator, ("actuator", "name"))
    return {(str(path_of(key.path)[2]), key.element): key for key in actuator_keys if key.attribute in OF_ACTUATORS}


@cache
def keys() -> Keys:
    """All keys of the stage format."""
    hinges = ((str(chain), name) for chain in CHAINS for name in HINGE_NAMES)
    overrides = (key for place in hinges for key in _keys_of(Hinge, ("override", *place)))
    return Keys({key.path: key for key in (*_keys_of(Stage, ()), *overrides)})


def matching_keys(pattern: str) -> tuple[str, ...]:
    """Return the key paths that match a pattern with stars for hinges or chains; empty if none does."""
    if pattern.startswith("override.*.actuator.") and "*" not in pattern[len("override.*") :]:
        paths = tuple(pattern.replace("*", str(chain), 1) for chain in CHAINS)
        return paths if paths[0] in keys() else ()
    *tables, last = pattern.split(".")
    if tables[:1] not in (["hinges"], ["override"]) or "*" in last:
        return ()
    parts = ("[^.]+" if part == "*" else re.escape(part) for part in (*tables, last))
    expression = re.compile(r"\.".join(parts))
    return tuple(path for path in keys() if expression.fullmatch(path))


def key_suggestion(name: str, known: Iterable[str]) -> str:
    """Return a suggestion, as the end of a message, for a name that is not a key path; array members have no index."""
    with suppress(ValueError):
        match path_of(name):
            case [str(array), int(), *rest] if array in ABOUT:
                about = ".".join(f"<{key}>" for key in ABOUT[array])
                return f", did you mean {array}.{about}.{key_path(tuple(rest))}?"
            case [*tables, str()] if _of_actuator(tables):
                return suggestion(name, [key_path((*tables, key)) for key, index in _actuator_keys() if index is None])
    return suggestion(name, known)


def _keys_of(model: type[BaseModel], table: tuple[str, ...]) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        kind, path = field.annotation, (*table, field.alias or name)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _keys_of(kind, (*table, name))
        elif (members := _members(kind)) is not None:
            for index, member in enumerate(members if all(map(_is_float, members)) else ()):
                yield _key((*path, index), table, name, index, member)
        elif _is_float(kind):
            limited = Annotated[kind, *field.metadata] if field.metadata else kind
            yield _key(path, table, name, None, limited)


def _members(kind: Any) -> tuple[Any, ...] | None:
    """Types of the members of an array of fixed length, which may be optional; None for any other type."""
    if get_origin(kind) is tuple and Ellipsis not in get_args(kind):
        return get_args(kind)
    options = [_members(option) for option in get_args(kind) if get_origin(kind) is UnionType]
    return next((members for members in options if members is not None), None)


def _is_float(kind: Any) -> bool:
    return kind is float or any(_is_float(argument) for argument in get_args(kind))


def _key(path: KeyPath, table: tuple[str, ...], attribute: str, index: int | None, kind: Any) -> Key:
    check = TypeAdapter(kind, config=ConfigDict(strict=True, allow_inf_nan=False))
    return Key(key_path(path), table, attribute, index, check)
