"""Provenance of the numbers of a file: stated with a source, assumed, or not stated."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, Field, field_validator, model_validator

from flexfem.files.expressions import Evaluated
from flexfem.files.refusals import KeyPath, key_path, path_of, refusal, suggestion
from flexfem.files.tables import UNCHANGEABLE, Label, Table, Unchangeable, memoized


class Assumptions(NamedTuple):
    """Key paths of the numbers behind a result that are assumed, and of those without a stated
    source.
    """

    assumed: list[str]
    not_stated: list[str]


class Sourced(Table):
    """A file with a `[provenance]` table: sources by key path of a number, or of a table that
    contains it.
    """

    provenance: Annotated[Mapping[str, Label], UNCHANGEABLE] = Field(
        default_factory=Unchangeable, examples=[{"name": "assumed: an example"}]
    )
    """Where numbers come from: the quoted key path of a number, or of a table, and its source.
    Begin with "assumed" what is assumed. A number that it does not cover is reported as not stated
    """

    @field_validator("provenance", mode="before")
    @classmethod
    def _key_paths_are_quoted(cls, provenance: Any) -> Any:
        for key, value in provenance.items() if isinstance(provenance, dict) else ():
            if isinstance(value, dict):
                raise refusal(
                    'text; write the whole key path in quotes, like "chain.link_lengths_mm"', key
                )
        return provenance

    @model_validator(mode="after")
    def _provenance_names_keys(self) -> Sourced:
        for key in self.provenance:
            if key not in self.entries:
                try:
                    now = key_path(path_of(key), self)  # a member named by index has another path
                except ValueError:
                    now = ""
                close = (
                    f", did you mean {now}?"
                    if now in self.entries
                    else suggestion(key, self.entries)
                )
                raise refusal(f"a key path of this file{close}", "provenance", key)
        return self

    @property
    @memoized
    def entries(self) -> Mapping[str, Any]:
        """All tables and values except provenance by key path; an array counts as one."""
        return Unchangeable({key_path(path, self): value for path, value in _members(self, ())})

    @property
    def values(self) -> dict[str, Any]:
        """All values that are not tables, by key path."""
        return {path: value for path, value in self.entries.items() if not _is_table(value)}

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the physical numbers, which need a source.

        Settings of a computation and integers need none.
        """
        return tuple(path for path, value in self.entries.items() if _is_number(value))

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths of the values, in order, whose provenance (their own or their table's) starts
        with "assumed".
        """
        return tuple(path for path in self.values if is_assumed(self.sources[path] or ""))

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Key paths of the numbers, in order, without a stated source."""
        return tuple(path for path in self.numbers if self.sources[path] is None)

    @property
    @memoized
    def sources(self) -> Mapping[str, str | None]:
        """Source of every table and value by key path: its own, or that of its nearest table."""
        stated = {path_of(key): source for key, source in self.provenance.items()}
        found = dict[str, str | None]()
        for path in self.entries:
            parts = path_of(path)
            ways_up = (parts[:length] for length in range(len(parts), 0, -1))
            found[path] = next((stated[way] for way in ways_up if way in stated), None)
        return Unchangeable(found)


def assumptions(files: Iterable[tuple[str, Sourced]]) -> Assumptions:
    """Return the sorted assumptions of several files, each with the prefix of its key paths.

    The prefix of a stage is empty.
    """
    found = list(files)
    assumed = {f"{prefix}{key}" for prefix, file in found for key in file.assumed}
    return Assumptions(
        sorted(assumed),
        sorted({f"{prefix}{key}" for prefix, file in found for key in file.not_stated}),
    )


def assumptions_said(
    assumed: Collection[str], not_stated: Collection[str], of: str = "of these numbers "
) -> list[str]:
    """Sentences with the count of assumed numbers and of numbers without a stated source.

    There is no sentence for zero.
    """
    verbs = (
        (assumed, ("is assumed", "are assumed")),
        (not_stated, ("has no stated source", "have no stated source")),
    )
    return [counted(len(keys), *(of + verb for verb in both)) for keys, both in verbs if keys]


def counted(
    count: int,
    singular: str,
    plural: str,
) -> str:
    """Return a count with the singular or plural text: "1 number is", "2 numbers are"."""
    return f"{count} {singular if count == 1 else plural}"


def is_assumed(source: str) -> bool:
    """Return whether a source says that the number is assumed."""
    return source.strip().lower().startswith("assumed")


def _members(table: BaseModel, above: KeyPath) -> Iterator[tuple[KeyPath, Any]]:
    for name, field in type(table).model_fields.items():
        path = (*above, field.alias or name)
        value = getattr(table, name)
        if name in table.model_fields_set and name != "provenance" and value is not None:
            yield path, value
            if isinstance(value, BaseModel):
                yield from _members(value, path)
            for key in value if isinstance(value, Mapping) else ():
                yield (*path, key), value[key]
            for index, item in enumerate(
                value if _is_table(value) and isinstance(value, tuple) else ()
            ):
                yield (*path, index), item
                yield from _members(item, (*path, index))


def _is_table(value: Any) -> bool:
    return isinstance(value, BaseModel) or (
        isinstance(value, tuple) and all(isinstance(v, BaseModel) for v in value)
    )


def _is_number(value: Any) -> bool:
    """Return whether a value is or contains a number that is not computed from others."""
    if isinstance(value, tuple):
        return any(map(_is_number, value))
    return isinstance(value, float) and not isinstance(value, Evaluated)
