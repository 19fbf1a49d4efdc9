"""Numbers of a stage file by key path, with limits and units: the quantities that a factor of a
study can set.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from pydantic import BaseModel

from flexfem.files.quantities import Limits
from flexfem.files.refusals import ABOUT, KeyPath, key_path, path_of, suggestion
from flexfem.mechanism.actuators import Actuator, ActuatorNumbers
from flexfem.mechanism.materials import FATIGUE
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.paper.stage_file import OF_ACTUATORS, Hinge, actuators_of

PARAMETERS = ("parameters",)  # table of a mechanism file
LIFE_CONSTANTS = FATIGUE[:3]  # in the order of `Designs.fatigue`
EXPANDING = ("material", "frame")  # tables in the order of `Designs.expansion`
# attributes of an actuator that need not be stated, each with the attribute without which it has no
# effect
NEEDED = {"tilt": "arm", "ball_youngs_modulus": "ball_radius", "ball_poissons_ratio": "ball_radius"}


class Key(NamedTuple):
    """One number of a stage file.

    path : as written in files, `hinges.base.neck_mm`, `chain.link_lengths_mm[0]`,
    `override.2.elbow.neck_mm`.
    table : enclosing tables, ("hinges", "base"); ("override", "2", "elbow") for one of the nine
    hinges;
        ("actuator", "base"), and ("override", "2", "actuator", "base") on one chain.
    attribute : name in the model.   element : index in an array, else None.   number : its limits
    and unit."""

    path: str
    table: tuple[str, ...]
    attribute: str
    element: int | None
    number: Limits

    def places_in(self, stage: Mechanism) -> list[tuple[str, tuple[int, ...]]]:
        """Return the fields of `designs.Designs` that the key sets, with indices; empty if no model
        uses the key.

        A key of a hinge or an actuator does not set the value of one that has its own override of
        that key. A key of a mechanism is a place itself."""
        if isinstance(stage, MechanismFile) or self.table == PARAMETERS:
            return [] if self.value_in(stage) is None else [(self.path, ())]
        if self.of_drive:
            return [("actuator", place) for place in self._actuators_in(stage)]
        if self.table[:1] == ("override",):
            return [(self.attribute, (int(self.table[1]) - 1, HINGE_NAMES.index(self.table[2])))]
        if self.table[:1] == ("hinges",):
            overridden = {o.place for o in stage.override if getattr(o, self.attribute) is not None}
            name = self.table[1]
            position = HINGE_NAMES.index(self.table[1])
            return [
                (self.attribute, (chain - 1, position))
                for chain in CHAINS
                if (chain, name) not in overridden
            ]
        if self.attribute in LIFE_CONSTANTS:
            return [("fatigue", (LIFE_CONSTANTS.index(self.attribute),))]
        if self.attribute == "expansion":
            return [("expansion", (EXPANDING.index(self.table[0]),))]
        if self.attribute in FATIGUE:
            return []
        field = (
            "_".join((*self.table[:1], self.attribute))
            if self.attribute == "radius"
            else self.attribute
        )
        return [(field, () if self.element is None else (self.element,))]

    @property
    def of_drive(self) -> bool:
        """Whether the key is one of an actuator, on all chains or on one."""
        return "actuator" in self.table[::2]

    def _actuators_in(self, stage: Stage) -> list[tuple[int, ...]]:
        """Indices of chain, actuator and number that the key sets, for actuators that use the
        number.
        """
        overridden = {
            o.place for o in stage.override if o.actuator and getattr(o, self.attribute) is not None
        }
        name = self.table[-1]
        on_one_chain = self.table[0] == "override"
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

    def table_in(self, stage: Mechanism) -> Any:
        """Table of the stage that has the number, overrides applied; None where there is none."""
        table: Any = stage
        match self.table:
            case ("override", chain, hinge) if isinstance(stage, Stage):
                return stage.hinge(int(chain), hinge)
            case (*on, "actuator", name) if isinstance(stage, Stage):
                row = actuators_of(stage)[int(on[1]) - 1] if on else stage.actuator
                return next((actuator for actuator in row if actuator.name == name), None)
        for name in self.table:
            table = getattr(table, name, None)
        return table

    def value_in(self, stage: Mechanism) -> float | None:
        """Value of the stage in file units; None where the stage uses a default, or has no such
        key.
        """
        table = self.table_in(stage)
        value = (
            table.get(self.attribute)
            if isinstance(table, Mapping)
            else getattr(table, self.attribute, None)
        )
        value = value if self.element is None or value is None else value[self.element]
        return None if value is None else float(value) / self.number.factor

    def set_in(self, changes: dict[str, Any], stage: Mechanism, value: float) -> None:
        """Set the number, in file units, in changes as `replace` takes them; other elements are
        those of the stage.
        """
        table = changes
        names = list[Any](self.table)
        if names[:1] == ["override"]:
            names = ["override", (int(self.table[1]), *self.table[2:])]
        for name in names:
            table = table.setdefault(name, {})
        changed: Any = self.number.inside(value)
        if self.element is not None:
            members = list(
                table.get(self.attribute) or getattr(self.table_in(stage), self.attribute)
            )
            changed = [*members[: self.element], changed, *members[self.element + 1 :]]
        table[self.attribute] = changed


class Keys(dict[str, Key]):
    """All keys by path, in the order of the format; keys named in the file, of actuators, exist for
    look-up only.
    """

    def __missing__(self, path: str) -> Key:
        key = _named_key(path)
        if key is None:
            raise KeyError(path)
        return key

    def __contains__(self, path: object) -> bool:
        return super().__contains__(path) or (
            isinstance(path, str) and _named_key(path) is not None
        )


@lru_cache(maxsize=256)
def _named_key(path: str) -> Key | None:
    """Return the key of a parameter of a mechanism, or of an actuator, that a path denotes; None if
    it denotes none.
    """
    with suppress(ValueError):
        match path_of(path):
            case ("parameters", str(name)) if name.isidentifier():
                return Key(path, PARAMETERS, name, None, Limits())
            case parts:
                return next((key for key in _keys_of_actuator(parts) if key.path == path), None)
    return None


def _keys_of_actuator(parts: KeyPath) -> list[Key]:
    """Return the keys of an actuator, on all chains or on one, whose tables a path begins with;
    none without it.
    """
    match parts:
        case ("actuator", str(), *_) | ("override", "1" | "2" | "3", "actuator", str(), *_):
            table = map(str, parts[: 2 if parts[0] == "actuator" else 4])
            return [
                key for key in _keys_of(Actuator, tuple(table)) if key.attribute in OF_ACTUATORS
            ]
    return []


@cache
def keys() -> Keys:
    """All keys of the stage format."""
    hinges = ((str(chain), name) for chain in CHAINS for name in HINGE_NAMES)
    overrides = (key for place in hinges for key in _keys_of(Hinge, ("override", *place)))
    return Keys({key.path: key for key in (*_keys_of(Stage, ()), *overrides)})


def matching_keys(pattern: str) -> tuple[str, ...]:
    """Return the key paths that match a pattern with stars for hinges or chains; empty if none
    does.
    """
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
    """Return a suggestion, as the end of a message, for a name that is not a key path; array
    members have no index.
    """
    with suppress(ValueError):
        match path_of(name):
            case (str(array), int(), *rest) if array in ABOUT:
                about = ".".join(f"<{key}>" for key in ABOUT[array])
                return f", did you mean {array}.{about}.{key_path(tuple(rest))}?"
            case parts if keys_of_actuator := _keys_of_actuator(parts):
                return suggestion(
                    name, [key.path for key in keys_of_actuator if key.element is None]
                )
    return suggestion(name, known)


def _keys_of(model: type[BaseModel], table: tuple[str, ...]) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        kind = field.annotation
        path = (*table, field.alias or name)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _keys_of(kind, (*table, name))
        numbers = _numbers_in(Annotated[kind, *field.metadata] if field.metadata else kind)
        is_array = any(get_origin(each) is tuple for each in (kind, *get_args(kind)))
        for index, number in enumerate(numbers):
            yield Key(
                key_path((*path, index) if is_array else path),
                table,
                name,
                index if is_array else None,
                number,
            )


def _numbers_in(kind: Any) -> list[Limits]:
    """Numbers of a type: of a number, of an array of fixed length, or of one of these that is
    optional.
    """
    if get_origin(kind) is Annotated:
        return [each for each in kind.__metadata__ if isinstance(each, Limits)]
    return [
        number
        for part in get_args(kind)
        if Ellipsis not in get_args(kind)
        for number in _numbers_in(part)
    ]
