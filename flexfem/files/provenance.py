"""Provenance of the numbers of a file: stated with a source, assumed, or not stated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel, Field, field_validator, model_validator

from flexfem.files.expressions import Evaluated
from flexfem.files.refusals import KeyPath, key_path, path_of, refusal, suggestion
from flexfem.files.toml import Label, Table


class Sourced(Table):
    """A file with a `[provenance]` table: sources by key path of a number, or of a table that contains it."""

    provenance: Mapping[str, Label] = Field(default_factory=dict, examples=[{"name": "assumed: an example"}])
    """Where numbers come from: the quoted key path of a number, or of a table, and its source. Begin with "assumed"
    what is assumed. A number that it does not cover is reported as not stated"""

    @field_validator("provenance", mode="before")
    @classmethod
    def _key_paths_are_quoted(cls, provenance: Any) -> Any:
        for key, value in provenance.items() if isinstance(provenance, dict) else ():
            if isinstance(value, dict):
                raise refusal('text; write the whole key path in quotes, like "chain.link_lengths_mm"', key)
        return provenance

    @model_validator(mode="after")
    def _provenance_names_keys(self) -> Sourced:
        known = key_paths(self) if self.provenance else ()
        for key in self.provenance:
            if key not in known:
                try:
                    now = key_path(path_of(key), self)  # a member named by index has another path
                except ValueError:
                    now = ""
                close = f", did you mean {now}?" if now in known else suggestion(key, known)
                raise refusal(f"a key path of this file{close}", "provenance", key)
        return self

    @property
    def entries(self) -> tuple[tuple[str, Any], ...]:
        """All tables and values except provenance with their key paths; an array counts as one."""
        return tuple((key_path(path, self), value) for path, value in _members(self, ()))

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source; settings of a computation need none."""
        return numeric_key_paths(self)

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths of the values, in order, whose provenance (their own or their table's) starts with "assumed"."""
        values = values_by_key(self)
        return tuple(path for path, source in self.sources.items() if path in values and is_assumed(source or ""))

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Key paths of the numbers, in order, without a stated source."""
        sources = self.sources
        return tuple(path for path in self.numbers if sources[path] is None)

    @property
    def sources(self) -> dict[str, str | None]:
        """Source of every table and value by key path: its own, or that of its nearest table."""
        stated = {path_of(key): source for key, source in self.provenance.items()}
        found = dict[str, str | None]()
        for path in key_paths(self):
            parts = path_of(path)
            ways_up = (parts[:length] for length in range(len(parts), 0, -1))
            found[path] = next((stated[way] for way in ways_up if way in stated), None)
        return found


class Assumptions(NamedTuple):
    """Sorted key paths of the numbers behind a result that are assumed, and of those without a stated source."""

    assumed: list[str]
    not_stated: list[str]


def assumptions(files: Iterable[tuple[str, Sourced]]) -> Assumptions:
    """Return the assumptions of several files, each with the prefix of its key paths; "" for stages."""
    found = list(files)
    assumed = {f"{prefix}{key}" for prefix, file in found for key in file.assumed}
    return Assumptions(sorted(assumed), sorted({f"{prefix}{key}" for prefix, file in found for key in file.not_stated}))


def is_assumed(source: str) -> bool:
    """Return whether a source says that the number is assumed."""
    return source.strip().lower().startswith("assumed")


def key_paths(file: Sourced) -> tuple[str, ...]:
    """Return the key paths of all tables and values in the file except provenance; an array counts as one."""
    return tuple(path for path, _ in file.entries)


def values_by_key(file: Sourced) -> dict[str, Any]:
    """Return all values in the file that are not tables, by key path."""
    return {path: value for path, value in file.entries if not _is_table(value)}


def numeric_key_paths(file: Sourced) -> tuple[str, ...]:
    """Return the key paths of all physical numbers in the file; integers such as a chain are none."""
    return tuple(path for path, value in file.entries if _is_number(value))


def _members(table: BaseModel, above: KeyPath) -> Iterator[tuple[KeyPath, Any]]:
    for name, field in type(table).model_fields.items():
        if name in table.model_fields_set and name != "provenance":
            path, value = (*above, field.alias or name), getattr(table, name)
            yield path, value
            if isinstance(value, BaseModel):
                yield from _members(value, path)
            for key in value if isinstance(value, Mapping) else ():
                yield (*path, key), value[key]
            for index, item in enumerate(value if _is_table(value) and isinstance(value, tuple) else ()):
                yield (*path, index), item
                yield from _members(item, (*path, index))


def _is_table(value: Any) -> bool:
    return isinstance(value, BaseModel) or (isinstance(value, tuple) and all(isinstance(v, BaseModel) for v in value))


def _is_number(value: Any) -> bool:
    """Return whether a value is or contains a number that is not computed from others."""
    if isinstance(value, tuple):
        return any(map(_is_number, value))
    return isinstance(value, float) and not isinstance(value, Evaluated)
