"""What all files of plates share: sources of a registered material, origin, text, changes, hash,
lines of refusals.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self, TypeVar

from pydantic import AfterValidator, BaseModel, WithJsonSchema, model_validator

from flexfem.files.expressions import Scaled
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import LONGEST, STATED
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
from flexfem.files.tables import KEPT, Unchangeable, once, plain
from flexfem.files.toml import PathLike, bad_key, in_mm, paths_in, read_toml, validate
from flexfem.files.writing import canonical, check_file, digest, toml_text, write_atomically
from flexfem.mechanism.dimensions import Callout, Dimensions, Span, hinge_callouts, placed
from flexfem.mechanism.keys import PARAMETERS, Key
from flexfem.mechanism.layout import Constants, Layout
from flexfem.mechanism.materials import Material, sources_of, with_changes, with_material_of_file
from flexfem.mechanism.plate import check_layout
from flexfem.refused import BadInput
from flexfem.units import DENSITY

INCH = 25.4  # mm


def _in_file(units: str) -> str:
    if units != "mm":
        raise refusal('"mm", or in a file "in"')
    return units


class Origin(NamedTuple):
    """The file of a plate, None without one, and whether the content was changed since it was read."""

    path: str | None = None
    changed: bool = False

    def __str__(self) -> str:
        return "" if self.path is None else self.path + ", changed" * self.changed


class Mechanism(Sourced):
    """A planar flexure mechanism that is cut from one plate: what every question is about.

    Each kind of file that describes one is a subclass, with a layout by its own keys.
    """

    kind: ClassVar[str]  # of file, such as "mechanism file"
    _drawn: ClassVar[type[Mechanism]]  # the kind whose keys are bodies and hinges

    if TYPE_CHECKING:
        name: str
        model: str
        thickness: float
        material: Material

    units: Annotated[str, AfterValidator(_in_file), WithJsonSchema({"enum": ["mm", "in"]})] = "mm"
    """Unit of lengths. In a file with `"in"` the keys of lengths end in `_in` instead of `_mm`, and
    expressions are in inches; all output is in mm """

    def __new__(cls, *_: Any, **content: Any) -> Self:
        """Make a mechanism of bodies and hinges, as `pathlib.Path` makes one of its kinds."""
        kind: Any = cls._drawn if cls is Mechanism else cls
        made: Self = super().__new__(kind)
        return made

    @model_validator(mode="before")
    @classmethod
    def _add_registered_sources(cls, data: Any) -> Any:
        material, stated = (
            (data.get(key) for key in ("material", "provenance"))
            if isinstance(data, dict)
            else (0, 0)
        )
        name = (
            material.get("name")
            if isinstance(material, dict)
            else getattr(material, "name", material)
        )
        sources = sources_of(name) | _sources_of_parts(data)
        if not sources or not isinstance(stated, dict | None):
            return data
        return data | {"provenance": sources | (stated or {})}

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        for array, members in self:
            named = (
                [part for part in members if hasattr(part, "name")]
                if isinstance(members, tuple)
                else []
            )
            for index, part in enumerate(named):
                if part.name in [other.name for other in named[:index]] or (array, part.name) == (
                    "point",
                    "output",
                ):
                    raise refusal(f"a name that no other {array} has", array, index, "name")
        return self

    @cached_property
    def origin(self) -> Origin:
        """Origin of the content; not part of its hash, and ignored when plates are compared."""
        return Origin()

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} "
            f"{self.name!r}{f' of {self.origin}' if self.origin.path else ''}>"
        )

    __str__ = __repr__

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content."""
        raise NotImplementedError

    @property
    def layout(self) -> Layout:
        """The plate with all its parts in place. Raises BadInput for parts that cannot be drawn."""
        raise NotImplementedError

    @property
    def lever(self) -> float:
        """Lever, mm: a rotation times it is comparable with a translation."""
        return self.layout.lever

    def replace(self, **changes: Any) -> Self:
        """Return a changed mechanism. Raises BadInput."""
        raise NotImplementedError

    def check(self) -> None:
        """Raise BadInput, with key, value and expectation, for a mechanism that cannot be made."""
        with located(self):
            _check_parts(self)

    def spans(self, layout: Layout) -> list[Span]:
        """Return the dimensioned lengths of a drawing of a layout of this mechanism."""
        return []

    def callouts(self, layout: Layout) -> list[Callout]:
        """Return the texts of a workshop drawing of a layout of this mechanism."""
        return hinge_callouts(layout)

    def dimensions(self, layout: Layout) -> Dimensions:
        """Return dimensions and texts of a workshop drawing, placed clear of each other.

        layout : of this mechanism, perhaps with further holes.
        """
        return placed(layout, self.spans(layout), self.callouts(layout))

    def expected_of(self, key: Key) -> str | None:
        """Return what is expected instead of a key of a study that sets nothing here, else None."""
        if key.places_in(self):
            return None
        parameters: Mapping[str, float] = getattr(self, "parameters", {})
        known = ", ".join(f"{PARAMETERS[0]}.{name}" for name in parameters) or "it has none"
        return f"a parameter of the mechanism ({known})"

    def answering(self, question: str) -> Callable[..., Any] | None:
        """Return the function that answers a question in the way of this kind of file, if there is one.

        It takes this mechanism and, by name, those options of the question that apply to it.
        """
        return None

    @property
    def plane_problem(self) -> dict[str, Any]:
        """Thickness and material of the `Layout`."""
        constants = self.constants_of(self.material)._asdict()
        constants.pop("name")
        residual_stress = self.material.residual_stress or 0.0
        return {"thickness": float(self.thickness), **constants, "residual_stress": residual_stress}

    def constants_of(self, material: Material) -> Constants:
        """Return the constants of a material: plane strain is plane stress with other elastic
        constants.
        """
        E = material.youngs_modulus
        nu = material.poissons_ratio
        strain = self.model == "plane_strain"
        return Constants(
            youngs_modulus=E / (1 - nu**2) if strain else E,
            poissons_ratio=nu / (1 - nu) if strain else nu,
            density=DENSITY * material.density,
            yield_strength=material.yield_strength,
            out_of_plane=nu if strain else 0.0,
            expansion=material.expansion,
        )

    def _digest(
        self, excluded: set[str], more: Mapping[str, Any] | None = None, **options: Any
    ) -> str:
        """Return the SHA-256 of `model_dump` with `options`, without names, sources, expansions and
        excluded keys.
        """
        left_out = {"name", "units", "provenance", "frame", *excluded}
        content = self.model_dump(exclude=left_out, **options) | dict(more or {})
        return digest(canonical(_without_names_of_materials(content)))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a validated copy with values replaced by name; it has no file, and its feasibility
        is not checked.
        """
        return self._with_content(
            {name: getattr(self, name) for name in self.model_fields_set} | dict(update or {})
        )

    def _with_content(self, content: dict[str, Any], mark: bool = False) -> Self:
        """Return a table of this content, without the provenance of keys of this one that no longer
        exist.

        mark : whether changed values lose the sources of this one.
        """
        sources = content.pop("provenance", {})
        if not isinstance(sources, Mapping):
            return type(self)(**content, provenance=sources)  # which refuses it
        table = type(self)(**content)
        kept = {
            key: source
            for key, source in sources.items()
            if key not in self.provenance or key in table.entries
        }
        if not kept.items() <= self.provenance.items():  # sources of the caller, which are checked
            table = type(self)(**content, provenance=kept)
        else:
            table = table._with_provenance({**table.provenance, **kept})
        if not mark:
            return table
        before = self.values
        stated = table.sources
        changed = [
            key
            for key, value in table.values.items()
            if before.get(key) != value and stated[key] is not None
        ]
        sources = {**table.provenance, **dict.fromkeys(changed, "replaced in Python")}
        registered = sources_of(table.material.name)
        if registered and table.material != self.material:
            sources = registered | {
                key: text for key, text in sources.items() if not key.startswith("material")
            }
        return table._with_provenance(sources)

    def _with_provenance(self, sources: Mapping[str, str]) -> Self:
        """Return this table with sources by its own key paths, which are not checked."""
        changed = BaseModel.model_copy(self, update={"provenance": Unchangeable(sources)})
        changed.__dict__.pop(KEPT, None)
        return changed

    def merged(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stated content by attribute names, with changes as `replace` takes them.
        Raises BadInput.
        """
        content = self.model_dump(exclude_unset=True, exclude_none=True, context=STATED)
        given = plain(changes, tables=True)
        if "material" in given:
            value = given.pop("material")
            content["material"] = (
                with_changes(content["material"], value)
                if isinstance(value, dict)
                else {"name": value}
            )
        for name, value in given.items():
            if isinstance(value, dict) and isinstance(getattr(self, name, None), tuple):
                given[name] = self._members_changed(name, content.get(name, []), value)
        return dict(merged_tables(content, given))

    def _members_changed(self, array: str, members: list[Any], changes: dict[Any, Any]) -> Any:
        """Return the members of an array changed by their names; the changes where the members have
        none.
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
        """Return a changed table with the origin of this one. Raises BadInput, which names the
        origin.
        """
        content = self.merged(changes)
        origin = self.origin._replace(changed=self.origin.path is not None)
        try:
            changed = self._with_content(content, mark="provenance" not in changes)
        except BadInput as refused:
            raise BadInput(
                refused.reason.removeprefix(f"{type(self).__name__}: "), str(origin)
            ) from None
        changed.__dict__["origin"] = origin
        return changed

    def to_toml(self) -> str:
        """Return the text of a file that reads back as an equal table with the same hash, bit for
        bit.
        """
        content = self.model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
        sources = content.pop("provenance", {})
        return toml_text(content | ({"provenance": sources} if sources else {}))

    def save(self, path: PathLike) -> None:
        """Write `to_toml` to a file. Raises BadInput when its folder does not exist or is not
        writable.
        """
        target = checked_path(path)
        check_file(target)
        write_atomically(target, lambda file: file.write(self.to_toml().encode()))

    def __hash__(self) -> int:
        """Hash consistently with equality, so that a plate can be a key."""
        return hash(self.hash)


@once
def _check_parts(mechanism: Mechanism) -> None:
    check_layout(mechanism.layout)


def _sources_of_parts(data: Any) -> dict[str, str]:
    """Return the provenance of registered materials of bodies and hinges by key path."""
    found = dict[str, str]()
    for array in ("body", "hinge"):
        parts = data.get(array) if isinstance(data, dict) else None
        for index, part in enumerate(parts if isinstance(parts, list | tuple) else ()):
            material = (
                part.get("material") if isinstance(part, dict) else getattr(part, "material", None)
            )
            name = (
                material.get("name")
                if isinstance(material, dict)
                else getattr(material, "name", material)
            )
            above = key_path((array, index), data)
            found |= {f"{above}.{key}": text for key, text in sources_of(name).items()}
    return found


def _without_names_of_materials(content: Any) -> Any:
    """Return a content whose materials, also those of its parts, have no name, expansion and
    missing number.
    """
    if isinstance(content, list | tuple):
        return [_without_names_of_materials(each) for each in content]
    if not isinstance(content, dict):
        return content
    found = {key: _without_names_of_materials(value) for key, value in content.items()}
    if isinstance(material := found.get("material"), dict):
        unused = ("name", "expansion")
        found["material"] = {
            key: v for key, v in material.items() if key not in unused and v is not None
        }
    return found


def merged_tables(old: Any, new: Any) -> Any:
    """Return nested tables with the values of others."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    return old | {key: merged_tables(old.get(key), value) for key, value in new.items()}


def of_stage(plate: Mechanism) -> dict[str, Any]:
    """Description of the stage in every result: file, name, and assumed and unstated numbers."""
    assumptions = {"assumed": list(plate.assumed), "not_stated": list(plate.not_stated)}
    return {"file": str(plate.origin), "name": plate.name, **assumptions}


@contextmanager
def located(plate: Mechanism) -> Iterator[None]:
    """Prefix BadInput messages that begin with a key path with the file and line of the plate."""
    try:
        yield
    except BadInput as refused:
        path, changed = plate.origin
        if refused.located or path is None:
            raise
        line = None
        key = re.match(r"(?:\.?\w+|\[\d+\])*", str(refused))
        with suppress(BadInput):  # the file no longer exists or has changed
            file = read_toml(path)
            line = file.line(path_of(key[0] if key else "", file.data))
        raise BadInput(
            str(refused), str(plate.origin) if changed else place_of(path, line)
        ) from None


Plate = TypeVar("Plate", bound=Mechanism)


def read_plate(
    model: type[Plate], path: PathLike, completed: Callable[[Any], Any] | None = None
) -> Plate:
    """Read a file of a plate, with the material of another file, and note where it came from.

    completed : adds the content of further files.

    Raises BadInput as `validate`.
    """

    def whole(data: dict[str, Any]) -> dict[str, Any]:
        found = with_material_of_file(path, in_millimetres(path, data))
        return found if completed is None else dict(completed(found))

    plate = validate(model, path, whole)
    plate.__dict__["origin"] = Origin(os.fspath(path))
    return plate


def in_millimetres(path: PathLike, data: dict[str, Any]) -> Any:
    """Return the content of a file in mm. Raises BadInput for a key in mm in a file with `units =
    "in"`.
    """
    if data.get("units") != "in":
        return data
    for at in paths_in(data):
        if str(at[-1]).endswith("_mm") and at[0] != "provenance":
            raise bad_key(
                path, at, f'{key_path(at, data)}, expected a key that ends in _in: units = "in"'
            )
    kept = {
        key: data[key] for key in ("parameters", "provenance") if key in data
    }  # parameters are in their own units
    if isinstance(sources := kept.get("provenance"), dict):
        kept["provenance"] = {
            key if key.startswith("parameters") else in_mm(key): sources[key] for key in sources
        }
    return _metric({key: data[key] for key in data if key not in ("units", *kept)}) | kept


def _metric(value: Any, key: str = "") -> Any:
    """Return a value with lengths, whose keys end in _in, in mm; an expression is multiplied."""
    if isinstance(value, list):
        return [_metric(each, key) for each in value]
    if isinstance(value, dict):
        return {in_mm(name): _metric(each, name) for name, each in value.items()}
    if not key.endswith("_in") or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return Scaled(value, INCH)
    return (
        float(f"{INCH * value:.15g}")
        if isinstance(value, int | float) and abs(value) < LONGEST
        else value
    )
