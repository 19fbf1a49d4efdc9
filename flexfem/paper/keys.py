"""Numbers of a stage file by key path: what a factor of a study of the stage can set."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from flexfem.files.quantities import Limits
from flexfem.files.refusals import KeyPath, key_path, path_of
from flexfem.mechanism.keys import LIFE_CONSTANTS, Key, KeyFormat
from flexfem.mechanism.materials import FATIGUE
from flexfem.paper.actuators import Actuator, ActuatorNumbers
from flexfem.paper.stage_file import (
    CHAINS,
    HINGE_NAMES,
    OF_ACTUATORS,
    Hinge,
    StageContent,
    actuators_of,
)

EXPANDING = ("material", "frame")  # tables in the order of `Designs.expansion`
# attributes of an actuator that need not be stated, each with the attribute without which it has no
# effect
NEEDED = {"tilt": "arm", "ball_youngs_modulus": "ball_radius", "ball_poissons_ratio": "ball_radius"}
ON_ALL_CHAINS = "override.*.actuator."  # start of a pattern for an actuator on each chain alone


class StageKey(Key):
    """One number of a stage file.

    Besides tables of the file, `table` may be ("override", "2", "elbow") for one of the nine
    hinges, ("actuator", "base"), and ("override", "2", "actuator", "base") for one on one chain.
    """

    __slots__ = ()

    @property
    def of_drive(self) -> bool:
        """Whether the key is one of an actuator, on all chains or on one."""
        return "actuator" in self.table[::2]

    @property
    def address(self) -> tuple[Any, ...]:
        """Names of the enclosing tables as `replace` takes them.

        An override is named by a tuple.
        """
        if self.table[:1] == ("override",):
            return "override", (int(self.table[1]), *self.table[2:])
        return self.table

    def places_in(self, mechanism: Any) -> list[tuple[str, tuple[int, ...]]]:
        """Return the fields of `designs.Designs` that the key sets, with indices.

        The list is empty where no model uses the key. A key of a hinge or an actuator does not set
        the value of one that has its own override of that key.
        """
        if not isinstance(mechanism, StageContent):
            return super().places_in(mechanism)
        if self.of_drive:
            return [("actuator", place) for place in self._actuators_in(mechanism)]
        if self.table[:1] == ("override",):
            return [(self.attribute, (int(self.table[1]) - 1, HINGE_NAMES.index(self.table[2])))]
        if self.table[:1] == ("hinges",):
            return self._hinges_in(mechanism)
        if self.attribute in LIFE_CONSTANTS:
            return [("fatigue", (LIFE_CONSTANTS.index(self.attribute),))]
        if self.attribute == "expansion":
            return [("expansion", (EXPANDING.index(self.table[0]),))]
        if self.attribute in FATIGUE:
            return []
        field = self.attribute
        if field == "radius":
            field = f"{self.table[0]}_radius"
        return [(field, () if self.element is None else (self.element,))]

    def _hinges_in(self, stage: StageContent) -> list[tuple[str, tuple[int, ...]]]:
        """Return the places of the hinges of one name that have no override of the number."""
        overridden = self._overridden_in(stage)
        name = self.table[1]
        position = HINGE_NAMES.index(name)
        chains = [chain for chain in CHAINS if (chain, name) not in overridden]
        return [(self.attribute, (chain - 1, position)) for chain in chains]

    def _actuators_in(self, stage: StageContent) -> list[tuple[int, ...]]:
        """Return chain, actuator and number that the key sets, for actuators that use the number."""
        overridden = self._overridden_in(stage)
        name = self.table[-1]
        on_one_chain = self.table[0] == "override"
        chains = (int(self.table[1]),) if on_one_chain else CHAINS
        number = ActuatorNumbers._fields.index({None: self.attribute, 0: "x", 1: "y"}[self.element])
        stated = NEEDED.get(self.attribute, self.attribute)
        places = list[tuple[int, ...]]()
        for chain in chains:
            if not on_one_chain and (chain, "actuator", name) in overridden:
                continue
            for index, actuator in enumerate(actuators_of(stage)[chain - 1]):
                if actuator.name == name and getattr(actuator, stated) is not None:
                    places.append((chain - 1, index, number))
        return places

    def _overridden_in(self, stage: StageContent) -> set[tuple[int | str, ...]]:
        """Return the places of the overrides of a stage that change the number."""
        overrides: tuple[Any, ...] = stage.override
        return {
            override.place
            for override in overrides
            if getattr(override, self.attribute, None) is not None
        }

    def table_in(self, mechanism: Any) -> Any:
        """Return the table of a stage that has the number, overrides applied; None without one."""
        if isinstance(mechanism, StageContent):
            match self.table:
                case ("override", chain, hinge):
                    return mechanism.hinge(int(chain), hinge)
                case (*on, "actuator", name):
                    row = actuators_of(mechanism)[int(on[1]) - 1] if on else mechanism.actuator
                    return next((actuator for actuator in row if actuator.name == name), None)
        return super().table_in(mechanism)


def _named(path: str) -> Key | None:
    """Return the key of an actuator that a path denotes; None if it denotes none."""
    with suppress(ValueError):
        return next((key for key in _keys_of_actuator(path_of(path)) if key.path == path), None)
    return None


def _keys_of_actuator(parts: KeyPath) -> list[Key]:
    """Return the keys of the actuator, on all chains or on one, in whose table a path is."""
    match parts:
        case ("actuator", str(), *_):
            table = parts[:2]
        case ("override", "1" | "2" | "3", "actuator", str(), *_):
            table = parts[:4]
        case _:
            return []
    found = _keys_of(Actuator, tuple(map(str, table)))
    return [key for key in found if key.attribute in OF_ACTUATORS]


@cache
def _listed() -> dict[str, Key]:
    """All keys of the stage format, except those of actuators, by path."""
    found = list(_keys_of(StageContent, ()))
    for chain in CHAINS:
        for name in HINGE_NAMES:
            found += _keys_of(Hinge, ("override", str(chain), name))
    return {key.path: key for key in found}


def _matching(pattern: str) -> tuple[str, ...]:
    """Return the key paths that match a pattern with stars for hinges or chains."""
    if pattern.startswith(ON_ALL_CHAINS) and "*" not in pattern.removeprefix(ON_ALL_CHAINS):
        paths = tuple(pattern.replace("*", str(chain), 1) for chain in CHAINS)
        return paths if _named(paths[0]) is not None else ()
    *tables, last = pattern.split(".")
    if tables[:1] not in (["hinges"], ["override"]) or "*" in last:
        return ()
    parts = ("[^.]+" if part == "*" else re.escape(part) for part in (*tables, last))
    expression = re.compile(r"\.".join(parts))
    return tuple(path for path in _listed() if expression.fullmatch(path))


def _beside(path: KeyPath) -> list[str]:
    """Return the paths of the numbers of the actuator in whose table a path is."""
    return [key.path for key in _keys_of_actuator(path) if key.element is None]


OF_FORMAT = KeyFormat(_listed, _named, _matching, _beside)


def _keys_of(model: type[BaseModel], table: tuple[str, ...]) -> Iterator[Key]:
    """Yield the keys of the numbers of a model and of the tables in it."""
    for name, field in model.model_fields.items():
        kind: Any = field.annotation
        path = (*table, field.alias or name)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _keys_of(kind, (*table, name))
        numbers = _numbers_in(Annotated[kind, *field.metadata] if field.metadata else kind)
        is_array = any(get_origin(each) is tuple for each in (kind, *get_args(kind)))
        for index, number in enumerate(numbers):
            if is_array:
                yield StageKey(key_path((*path, index)), table, name, index, number)
            else:
                yield StageKey(key_path(path), table, name, None, number)


def _numbers_in(kind: Any) -> list[Limits]:
    """Return the numbers of a type: of a number, of an array of fixed length, or of an optional
    one.
    """
    if get_origin(kind) is Annotated:
        return [each for each in kind.__metadata__ if isinstance(each, Limits)]
    parts = [part for part in get_args(kind) if Ellipsis not in get_args(kind)]
    return [number for part in parts for number in _numbers_in(part)]
