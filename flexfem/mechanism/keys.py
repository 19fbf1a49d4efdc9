"""Numbers of files by key path, with limits and units: what a factor of a study can set."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from importlib import import_module
from typing import Any, NamedTuple

from flexfem.files.quantities import Limits
from flexfem.files.refusals import ABOUT, KeyPath, key_path, path_of, suggestion
from flexfem.mechanism.materials import FATIGUE

PARAMETERS = ("parameters",)  # table of a mechanism file
LIFE_CONSTANTS = FATIGUE[:3]  # in the order of `paper.designs.Designs.fatigue`
# modules with the keys of a kind of file, each an `OF_FORMAT`; read when keys are first looked up
FORMATS = ("flexfem.paper.keys",)


class Key(NamedTuple):
    """One number of a file.

    path : as written in files, `hinges.base.neck_mm`, `chain.link_lengths_mm[0]`,
    `parameters.length_mm`.
    table : names of the enclosing tables, ("hinges", "base").
    attribute : name in the model.   element : index in an array, else None.
    number : its limits and unit.
    """

    path: str
    table: tuple[str, ...]
    attribute: str
    element: int | None
    number: Limits

    @property
    def of_drive(self) -> bool:
        """Whether only results of a driven mechanism depend on the number."""
        return False

    @property
    def address(self) -> tuple[Any, ...]:
        """Names of the enclosing tables as `replace` takes them."""
        return self.table

    def places_in(self, mechanism: Any) -> list[tuple[str, tuple[int, ...]]]:
        """Return what the key sets of a design: names of arrays, with indices.

        The list is empty where no number of the mechanism depends on the key.
        """
        return [] if self.value_in(mechanism) is None else [(self.path, ())]

    def table_in(self, mechanism: Any) -> Any:
        """Return the table of a mechanism that has the number; None where there is none."""
        table = mechanism
        for name in self.table:
            table = getattr(table, name, None)
        return table

    def value_in(self, mechanism: Any) -> float | None:
        """Return the value in a mechanism, in file units.

        It is None where the mechanism uses a default, or has no such key.
        """
        table = self.table_in(mechanism)
        if isinstance(table, Mapping):
            value = table.get(self.attribute)
        else:
            value = getattr(table, self.attribute, None)
        if value is not None and self.element is not None:
            value = value[self.element]
        return None if value is None else float(value) / self.number.factor

    def set_in(
        self,
        changes: dict[str, Any],
        mechanism: Any,
        value: float,
    ) -> None:
        """Set the number, in file units, in changes as `replace` takes them.

        Other elements of an array are those of the mechanism.
        """
        table = changes
        for name in self.address:
            table = table.setdefault(name, {})
        changed: Any = self.number.inside(value)
        if self.element is not None:
            stated = table.get(self.attribute)
            members = list(stated or getattr(self.table_in(mechanism), self.attribute))
            members[self.element] = changed
            changed = members
        table[self.attribute] = changed


class KeyFormat(NamedTuple):
    """The keys of one kind of file.

    listed : returns the keys that every file may have, by path.
    named : returns the key of a path with a name that only the file has; None for another path.
    matching : returns the paths that match a pattern with stars.
    beside : returns the paths in the table to which a path leads, for suggestions.
    """

    listed: Callable[[], Mapping[str, Key]]
    named: Callable[[str], Key | None]
    matching: Callable[[str], tuple[str, ...]]
    beside: Callable[[KeyPath], list[str]]


class Keys(dict[str, Key]):
    """All keys by path; keys that are named in a file exist for look-up only."""

    def __missing__(self, path: str) -> Key:
        key = _named_key(path)
        if key is None:
            raise KeyError(path)
        return key

    def __contains__(self, path: object) -> bool:
        if super().__contains__(path):
            return True
        return isinstance(path, str) and _named_key(path) is not None


@cache
def _formats() -> tuple[KeyFormat, ...]:
    return tuple(import_module(module).OF_FORMAT for module in FORMATS)


@lru_cache(maxsize=256)
def _named_key(path: str) -> Key | None:
    """Return the key that is named by a parameter or a part of a file; None for another path."""
    with suppress(ValueError):
        match path_of(path):
            case ("parameters", str(name)) if name.isidentifier():
                return Key(path, PARAMETERS, name, None, Limits())
    found = (each.named(path) for each in _formats())
    return next((key for key in found if key is not None), None)


@cache
def keys() -> Keys:
    """All keys of all kinds of files, in the order of their formats."""
    known = Keys()
    for each in _formats():
        known.update(each.listed())
    return known


def matching_keys(pattern: str) -> tuple[str, ...]:
    """Return the key paths that match a pattern with stars, such as `hinges.*.neck_mm`."""
    return tuple(path for each in _formats() for path in each.matching(pattern))


def key_suggestion(name: str, known: Iterable[str]) -> str:
    """Return a suggestion, as the end of a message, for a name that is not a key path.

    Members of an array are named by what identifies them, never by their index.
    """
    with suppress(ValueError):
        path = path_of(name)
        match path:
            case (str(array), int(), *rest) if array in ABOUT:
                about = ".".join(f"<{key}>" for key in ABOUT[array])
                return f", did you mean {array}.{about}.{key_path(tuple(rest))}?"
        beside = [other for each in _formats() for other in each.beside(path)]
        if beside:
            return suggestion(name, beside)
    return suggestion(name, known)
