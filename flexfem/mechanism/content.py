"""The content of a file that describes a mechanism: its origin, hash and text, and changed copies."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self, TypeVar

from pydantic import AfterValidator, BaseModel, WithJsonSchema, model_validator

from flexfem.files.inches import in_millimetres
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import STATED
from flexfem.files.refusals import (
    as_key,
    checked_path,
    key_path,
    path_of,
    place_of,
    refusal,
    shown,
    suggestion,
)
from flexfem.files.tables import KEPT, Unchangeable, plain
from flexfem.files.toml import PathLike, read_toml, validate
from flexfem.files.writing import canonical, check_file, digest, toml_text, write_atomically
from flexfem.mechanism.materials import Material, sources_of, with_changes, with_material_of_file
from flexfem.refused import BadInput

NOT_PHYSICAL = {"name", "units", "provenance", "frame"}  # keys that no hash depends on
# numbers that a registered material got later; without them hashes are those of older files
LATER = {"al-7075-t6": {"fatigue_strength_coefficient", "fatigue_strength_exponent"}}
REPLACED = "replaced in Python"  # source of a number that a copy changes


def _in_file(units: str) -> str:
    if units != "mm":
        raise refusal('"mm", or in a file "in"')
    return units


class Origin(NamedTuple):
    """The file of a content, None without one, and whether it was changed since it was read."""

    path: str | None = None
    changed: bool = False

    def __str__(self) -> str:
        if self.path is None:
            return ""
        return f"{self.path}, changed" if self.changed else self.path


class FileContent(Sourced):
    """The validated tables of a file that describes a mechanism.

    It cannot be changed; `model_copy` and `replace` of its kinds return changed copies. Sources of
    registered materials are added to `provenance`.
    """

    if TYPE_CHECKING:  # fields that every kind of file has
        name: str
        material: Material

    units: Annotated[str, AfterValidator(_in_file), WithJsonSchema({"enum": ["mm", "in"]})] = "mm"
    """Unit of lengths. In a file with `"in"` the keys of lengths end in `_in` instead of `_mm`, and
    expressions are in inches; all output is in mm """

    @model_validator(mode="before")
    @classmethod
    def _add_registered_sources(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        stated = data.get("provenance")
        sources = sources_of(_name_of(data.get("material"))) | _sources_of_parts(data)
        if not sources or not isinstance(stated, dict | None):
            return data
        return data | {"provenance": sources | (stated or {})}

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        for array, members in self:
            names = {"output"} if array == "point" else set[str]()
            for index, part in enumerate(members if isinstance(members, tuple) else ()):
                name = getattr(part, "name", None)
                if name in names:
                    raise refusal(f"a name that no other {array} has", array, index, "name")
                if name is not None:
                    names.add(name)
        return self

    @cached_property
    def origin(self) -> Origin:
        """Origin of the content; not part of its hash, and ignored when contents are compared."""
        return Origin()

    def __repr__(self) -> str:
        of_file = f" of {self.origin}" if self.origin.path else ""
        return f"<{type(self).__name__} {self.name!r}{of_file}>"

    __str__ = __repr__

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content."""
        raise NotImplementedError

    def __hash__(self) -> int:
        """Hash consistently with equality, so that a content can be a key."""
        return hash(self.hash)

    def _digest(
        self, excluded: set[str], more: Mapping[str, Any] | None = None, **options: Any
    ) -> str:
        """Return the SHA-256 of the physical content.

        excluded : further keys that are left out.   more : further content.
        options : of `model_dump`.
        """
        content = self.model_dump(exclude=NOT_PHYSICAL | excluded, **options) | dict(more or {})
        return digest(canonical(_without_names_of_materials(content)))

    def model_copy(
        self,
        *,
        update: Mapping[str, Any] | None = None,
        deep: bool = False,
    ) -> Self:
        """Return a validated copy with values replaced by name.

        It has no file, and whether it can be made is not checked.
        """
        content = {name: getattr(self, name) for name in self.model_fields_set}
        return self._with_content(content | dict(update or {}))

    def merged(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stated content by attribute names, with changes as `replace` takes them.

        Raises BadInput.
        """
        content = self.model_dump(
            exclude_unset=True,
            exclude_none=True,
            context=STATED,
        )
        given = plain(changes, tables=True)
        if "material" in given:
            value = given.pop("material")
            if isinstance(value, dict):
                content["material"] = with_changes(content["material"], value)
            else:
                content["material"] = {"name": value}
        for name, value in given.items():
            if isinstance(value, dict) and isinstance(getattr(self, name, None), tuple):
                given[name] = self._members_changed(name, content.get(name, []), value)
        return dict(merged_tables(content, given))

    def _members_changed(
        self,
        array: str,
        members: list[Any],
        changes: dict[Any, Any],
    ) -> Any:
        """Return the members of an array, changed by their names.

        Without names of members the changes themselves are returned, which validation refuses.
        """
        if not all("name" in part for part in members):
            return changes
        names = [part["name"] for part in members]
        for name, values in changes.items():
            if name not in names:
                near = suggestion(as_key(name), names) or f", expected one of {names}"
                raise BadInput(f"{array}: no {shown(name)}{near}")
            if not isinstance(values, dict):
                raise BadInput(f"{array}: {shown(name)} = {shown(values)}, expected a table")
        return [{**part, **changes.get(part["name"], {})} for part in members]

    def _replaced(self, changes: Mapping[str, Any]) -> Self:
        """Return a changed copy with the origin of this one. Raises BadInput, with the origin."""
        content = self.merged(changes)
        origin = self.origin._replace(changed=self.origin.path is not None)
        try:
            changed = self._with_content(content, mark="provenance" not in changes)
        except BadInput as refused:
            reason = refused.reason.removeprefix(f"{type(self).__name__}: ")
            raise BadInput(reason, str(origin)) from None
        changed.__dict__["origin"] = origin
        return changed

    def _with_content(
        self,
        content: dict[str, Any],
        mark: bool = False,
    ) -> Self:
        """Return a copy with other content, without sources of keys that no longer exist.

        mark : whether changed values lose the sources of this one.
        """
        sources = content.pop("provenance", {})
        if not isinstance(sources, Mapping):
            return type(self)(**content, provenance=sources)  # which refuses it
        copy = type(self)(**content)
        kept = {
            key: source
            for key, source in sources.items()
            if key not in self.provenance or key in copy.entries
        }
        if kept.items() <= self.provenance.items():
            copy = copy._with_provenance({**copy.provenance, **kept})
        else:  # sources of the caller, which are checked
            copy = type(self)(**content, provenance=kept)
        return copy._with_changes_marked(self) if mark else copy

    def _with_changes_marked(self, before: Self) -> Self:
        """Return a copy in which values that are not those of another content have no old source."""
        old = before.values
        stated = self.sources
        changed = [
            key
            for key, value in self.values.items()
            if old.get(key) != value and stated[key] is not None
        ]
        sources = {**self.provenance, **dict.fromkeys(changed, REPLACED)}
        registered = sources_of(self.material.name)
        if registered and self.material != before.material:
            others = {key: text for key, text in sources.items() if not key.startswith("material")}
            sources = registered | others
        return self._with_provenance(sources)

    def _with_provenance(self, sources: Mapping[str, str]) -> Self:
        """Return a copy with sources by its own key paths, which are not checked."""
        changed = BaseModel.model_copy(self, update={"provenance": Unchangeable(sources)})
        changed.__dict__.pop(KEPT, None)
        return changed

    def to_toml(self) -> str:
        """Return the text of a file that reads back as equal content with the same hash."""
        content = self.model_dump(
            by_alias=True,
            exclude_unset=True,
            exclude_none=True,
        )
        sources = content.pop("provenance", {})
        if sources:
            content["provenance"] = sources  # as the last table
        return toml_text(content)

    def save(self, path: PathLike) -> None:
        """Write `to_toml` to a file.

        Raises BadInput when its folder does not exist or is not writable.
        """
        target = checked_path(path)
        check_file(target)
        write_atomically(target, lambda file: file.write(self.to_toml().encode()))


def _name_of(material: Any) -> Any:
    """Return the name of a material in raw data: a name, a table, or a `Material`."""
    if isinstance(material, dict):
        return material.get("name")
    return getattr(material, "name", material)


def _sources_of_parts(data: dict[str, Any]) -> dict[str, str]:
    """Return the provenance of registered materials of bodies and hinges by key path."""
    found = dict[str, str]()
    for array in ("body", "hinge"):
        parts = data.get(array)
        for index, part in enumerate(parts if isinstance(parts, list | tuple) else ()):
            stated = (
                part.get("material") if isinstance(part, dict) else getattr(part, "material", None)
            )
            above = key_path((array, index), data)
            for key, text in sources_of(_name_of(stated)).items():
                found[f"{above}.{key}"] = text
    return found


def _without_names_of_materials(content: Any) -> Any:
    """Return a content whose materials, those of parts, too, are without what no hash depends on.

    It is their names, their expansions, numbers that are not stated and those of `LATER`.
    """
    if isinstance(content, list | tuple):
        return [_without_names_of_materials(each) for each in content]
    if not isinstance(content, dict):
        return content
    found = {key: _without_names_of_materials(value) for key, value in content.items()}
    material = found.get("material")
    if isinstance(material, dict):
        left_out = {"name", "expansion", *LATER.get(material["name"], ())}
        found["material"] = {
            key: value
            for key, value in material.items()
            if key not in left_out and value is not None
        }
    return found


def merged_tables(old: Any, new: Any) -> Any:
    """Return nested tables with the values of others."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    return old | {key: merged_tables(old.get(key), value) for key, value in new.items()}


@contextmanager
def naming_place(content: FileContent) -> Iterator[None]:
    """Prefix BadInput messages that begin with a key path with file and line of the content."""
    try:
        yield
    except BadInput as refused:
        path, changed = content.origin
        if refused.has_place or path is None:
            raise
        line = None
        key = re.match(r"(?:\.?\w+|\[\d+\])*", str(refused))
        with suppress(BadInput):  # the file no longer exists or has changed
            file = read_toml(path)
            line = file.line(path_of(key[0] if key else "", file.data))
        place = str(content.origin) if changed else place_of(path, line)
        raise BadInput(str(refused), place) from None


Content = TypeVar("Content", bound=FileContent)


def read_content(
    model: type[Content], path: PathLike, completed: Callable[[Any], Any] | None = None
) -> Content:
    """Read a file, with the material of another file, and note where it came from.

    completed : adds the content of further files.

    Raises BadInput as `validate`.
    """

    def whole(data: dict[str, Any]) -> dict[str, Any]:
        found = with_material_of_file(path, in_millimetres(path, data))
        return found if completed is None else dict(completed(found))

    content = validate(model, path, whole)
    content.__dict__["origin"] = Origin(os.fspath(path))
    return content
