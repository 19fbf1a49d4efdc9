"""What all files of plates share: sources of a registered material, origin, text, copies, and lines of refusals."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from pydantic import BaseModel, model_validator

from flexfem.files.provenance import Sourced, key_paths, values_by_key
from flexfem.files.refusals import checked_path, path_of, place_of
from flexfem.files.toml import PathLike, read_toml, validate
from flexfem.files.writing import check_file, toml_text, write_atomically
from flexfem.mechanism.dimensioned import KEPT, Dimensioned, once
from flexfem.mechanism.materials import Material, sources_of
from flexfem.refused import BadInput


class Origin(NamedTuple):
    """The file of a plate, None without one, and whether the content was changed since it was read."""

    path: str | None = None
    changed: bool = False

    def __str__(self) -> str:
        return "" if self.path is None else self.path + ", changed" * self.changed


class PlateFile(Dimensioned, Sourced):
    """The content of a file that describes a plate to be cut; subclasses have a name and a material."""

    if TYPE_CHECKING:
        name: str
        material: Material

    @model_validator(mode="before")
    @classmethod
    def _add_registered_sources(cls, data: Any) -> Any:
        material, stated = (data.get(key) for key in ("material", "provenance")) if isinstance(data, dict) else (0, 0)
        name = material.get("name") if isinstance(material, dict) else getattr(material, "name", material)
        sources = sources_of(name)
        if not sources or not isinstance(stated, dict | None):
            return data
        return data | {"provenance": sources | (stated or {})}

    @cached_property
    def origin(self) -> Origin:
        """Origin of the content; not part of its hash, and ignored when plates are compared."""
        return Origin()

    @property
    @once
    def entries(self) -> tuple[tuple[str, Any], ...]:
        return super().entries

    @property
    @once
    def sources(self) -> dict[str, str | None]:
        return super().sources

    @property
    @once
    def assumed(self) -> tuple[str, ...]:
        return super().assumed

    @property
    @once
    def not_stated(self) -> tuple[str, ...]:
        return super().not_stated

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content."""
        raise NotImplementedError

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a validated copy with values replaced by name; it has no file, and its feasibility is not checked."""
        return self._with_content(self._stated() | dict(update or {}))

    def _stated(self) -> dict[str, Any]:
        """Return the stated content by attribute names."""
        return {name: getattr(self, name) for name in self.model_fields_set}

    def _with_content(self, content: dict[str, Any]) -> Self:
        """Return a table of this content, without the provenance of keys of this one that no longer exist."""
        sources = content.pop("provenance", {})
        table = type(self)(**content)
        removed = {key for key in sources if key in self.provenance} - {*key_paths(table)} if sources else ()
        kept = {key: source for key, source in sources.items() if key not in removed}
        if kept.items() <= self.provenance.items():
            return table._with_provenance({**table.provenance, **kept})
        return type(self)(**content, provenance=kept)

    def _with_provenance(self, sources: Mapping[str, str]) -> Self:
        """Return this table with sources by its own key paths, which are not checked."""
        changed = BaseModel.model_copy(self, update={"provenance": sources})
        changed.__dict__.pop(KEPT, None)
        return changed

    def _sources_of(self, changed: Self) -> dict[str, str]:
        """Return the provenance of a changed table, in which changed values lose the sources of this one."""
        before, stated = values_by_key(self), changed.sources
        different = [key for key, value in values_by_key(changed).items() if before.get(key) != value]
        sources = dict(changed.provenance) | {key: "replaced in Python" for key in different if stated[key] is not None}
        registered = sources_of(changed.material.name)
        if not registered or changed.material == self.material:
            return sources
        return registered | {key: text for key, text in sources.items() if not key.startswith("material")}

    def _replaced(self, content: dict[str, Any], changes: Mapping[str, Any]) -> Self:
        """Return a table of changed content with the origin of this one. Raises BadInput, which names the origin."""
        origin = self.origin._replace(changed=self.origin.path is not None)
        try:
            changed = self._with_content(content)
            if "provenance" not in changes:
                changed = changed._with_provenance(self._sources_of(changed))
        except BadInput as refusal:
            raise BadInput(refusal.reason.removeprefix(f"{type(self).__name__}: "), str(origin)) from None
        changed.__dict__["origin"] = origin
        return changed

    def to_toml(self) -> str:
        """Return the text of a file that reads back as an equal table with the same hash, bit for bit."""
        content = self.model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
        sources = content.pop("provenance", {})
        return toml_text(content | ({"provenance": sources} if sources else {}))

    def save(self, path: PathLike) -> None:
        """Write `to_toml` to a file. Raises BadInput when its folder does not exist or is not writable."""
        target = checked_path(path)
        check_file(target)
        write_atomically(target, lambda file: file.write(self.to_toml().encode()))

    def __getstate__(self) -> dict[Any, Any]:
        """Return fields and origin for a pickle, without cached results."""
        state = super().__getstate__()
        content = {key: value for key, value in state["__dict__"].items() if key != KEPT}
        return state | {"__dict__": content}

    def __eq__(self, other: object) -> bool:
        """Compare the content; origin and cached results are ignored."""
        if not isinstance(other, type(self)):
            return False
        return all(getattr(self, name) == getattr(other, name) for name in type(self).model_fields)

    def __hash__(self) -> int:
        """Hash consistently with equality, so that a plate can be a key."""
        return hash(self.hash)


def of_stage(plate: PlateFile) -> dict[str, Any]:
    """Description of the stage in every result: file, name, and assumed and unstated numbers."""
    assumptions = {"assumed": list(plate.assumed), "not_stated": list(plate.not_stated)}
    return {"file": str(plate.origin), "name": plate.name, **assumptions}


@contextmanager
def located(plate: PlateFile) -> Iterator[None]:
    """Prefix BadInput messages that begin with a key path with the file and line of the plate."""
    try:
        yield
    except BadInput as refusal:
        if refusal.located or plate.origin.path is None:
            raise
        raise BadInput(str(refusal), _file_and_line(plate.origin, str(refusal))) from None


def _file_and_line(origin: Origin, refusal: str) -> str:
    if origin.path is None or origin.changed:
        return str(origin)
    try:
        file = read_toml(origin.path)
        key = re.match(r"(?:\.?\w+|\[\d+\])*", refusal)
        return place_of(origin.path, file.line(path_of(key[0] if key else "", file.data)))
    except BadInput:  # the file no longer exists or has changed
        return place_of(origin.path)


Plate = TypeVar("Plate", bound=PlateFile)


def read_plate(model: type[Plate], path: PathLike, complete: Callable[[dict[str, Any]], dict[str, Any]]) -> Plate:
    """Read a file of a plate and note where it came from. Raises BadInput as `validate`."""
    plate = validate(model, path, complete)
    plate.__dict__["origin"] = Origin(os.fspath(path))
    return plate
