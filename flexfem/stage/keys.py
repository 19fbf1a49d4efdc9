"""The numbers a stage file can give, by key path: what a factor can set, its limits and its unit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from flexfem.arrays import AnyArray, Array
from flexfem.files.keypath import ABOUT, KeyPath, key_path, path_of
from flexfem.files.refusals import problem_of, suggestion
from flexfem.stage.schema import CHAINS, HINGE_NAMES, Override, Stage

_PROBE = 0.25  # possible for every key, and a power of two: the unit comes out exact


class Key(NamedTuple):
    """One number of a stage file.

    Attributes
    ----------
    path : as written in files, `hinges.base.neck_mm`, `chain.link_lengths_mm[0]`, `override.2.elbow.neck_mm`.
    table : the tables on the way, ("hinges", "base"); ("override", "2", "elbow") for one of the nine hinges.
    attribute : its name in the model.
    element : place in an array, else None.
    check : what the file format says of the number.
    unit : inside units per file unit.
    """

    path: str
    table: tuple[str, ...]
    attribute: str
    element: int | None
    check: TypeAdapter[float]
    unit: float

    def expected(self, value: float) -> str | None:
        """What the file format expects instead of `value` (file units), None where it is possible."""
        try:
            self.check.validate_python(float(value))
        except ValidationError as error:
            return problem_of(error.errors(include_url=False)[0], {}).expected
        return None

    def impossible(self, values: Array) -> AnyArray:
        """Which values (...), file units, no file can give. The possible ones fill an interval, so the ends decide."""
        if values.size == 0 or all(self.expected(end) is None for end in (np.min(values), np.max(values))):
            return np.zeros(values.shape, dtype=bool)
        found: AnyArray = np.vectorize(lambda value: self.expected(value) is not None, otypes=[bool])(values)
        return found

    def places_in(self, stage: Stage) -> list[tuple[str, tuple[int, ...]]]:
        """Fields of `stage.designs.Designs` that it sets and where in them; none where no model asks for it.

        A hinge with an override of its own does not follow the one it overrides; no output depends
        on the density.
        """
        if self.table[:1] == ("override",):
            return [(self.attribute, (int(self.table[1]) - 1, HINGE_NAMES.index(self.table[2])))]
        if self.table[:1] == ("hinges",):
            own = {(o.chain, o.hinge) for o in stage.override if getattr(o, self.attribute) is not None}
            position = HINGE_NAMES.index(self.table[1])
            return [(self.attribute, (chain - 1, position)) for chain in CHAINS if (chain, self.table[1]) not in own]
        if self.attribute == "density":
            return []
        field = "_".join((*self.table[:1], self.attribute)) if self.attribute == "radius" else self.attribute
        return [(field, () if self.element is None else (self.element,))]

    def value_in(self, stage: Stage) -> float | None:
        """The stage's own value in file units; None where it takes a default."""
        if self.table[:1] == ("override",):
            value = getattr(stage.hinge(int(self.table[1]), self.table[2]), self.attribute)
        else:
            found: Any = stage
            for name in self.table:
                found = getattr(found, name)
            value = getattr(found, self.attribute)
        value = value if self.element is None else value[self.element]
        return None if value is None else value / self.unit


@cache
def keys() -> dict[str, Key]:
    """All of them, in the order of the format."""
    return {key.path: key for key in _keys()}


def starred(pattern: str) -> tuple[str, ...]:
    """The key paths that a pattern with stars for hinges or chains names, none when it names none."""
    *tables, last = pattern.split(".")
    if tables[:1] not in (["hinges"], ["override"]) or "*" in last:
        return ()
    return tuple(path for path in keys() if _matches(path_of(path), (*tables, last)))


def _matches(path: KeyPath, wanted: tuple[str, ...]) -> bool:
    return len(path) == len(wanted) and all(one in ("*", other) for one, other in zip(wanted, path, strict=True))


def meant(name: str, known: Iterable[str]) -> str:
    """What may be meant by a name that is no key path, as a refusal goes on; a member of an array goes by no place."""
    with suppress(ValueError):
        match path_of(name):
            case [str(array), int(), *below] if array in ABOUT:
                about = ".".join(f"<{key}>" for key in ABOUT[array])
                return f", did you mean {array}.{about}.{key_path(tuple(below))}?"
    return suggestion(name, known)


def _keys() -> Iterator[Key]:
    yield from _numbers(Stage, ())
    for chain in CHAINS:
        for name in HINGE_NAMES:
            yield from _numbers(Override, ("override", str(chain), name))


def _numbers(model: type[BaseModel], table: tuple[str, ...]) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        kind, path = field.annotation, (*table, field.alias or name)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _numbers(kind, (*table, name))
        elif get_origin(kind) is tuple and Ellipsis not in get_args(kind):
            for index, each in enumerate(get_args(kind)):
                yield _key((*path, index), table, name, index, each)
        elif _is_float(kind):
            limited = Annotated[kind, *field.metadata] if field.metadata else kind
            yield _key(path, table, name, None, limited)


def _is_float(kind: Any) -> bool:
    return kind is float or any(_is_float(inner) for inner in get_args(kind))


def _key(path: KeyPath, table: tuple[str, ...], attribute: str, index: int | None, kind: Any) -> Key:
    check = TypeAdapter(kind, config=ConfigDict(strict=True, allow_inf_nan=False))
    return Key(key_path(path), table, attribute, index, check, check.validate_python(_PROBE) / _PROBE)
