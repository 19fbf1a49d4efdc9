"""The material of a stage, and materials known by name: shipped ones, the user's own, and those of
a file.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from itertools import compress
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    create_model,
    model_validator,
)

from flexfem.files import quantities
from flexfem.files.quantities import INSIDE
from flexfem.files.refusals import key_path, place_of, refusal, shown
from flexfem.files.tables import LABEL_LENGTH, UNCHANGEABLE, Label, Table, Unchangeable
from flexfem.files.toml import PathLike, bad_key, read_toml, validate
from flexfem.refused import BadInput, printed
from flexfem.sources import PACKAGE, load_own

NEAREST = 5  # registered names suggested for an unknown one
SWT = 0.5  # Walker's exponent for which his equation equals that of Smith, Watson and Topper
# limits of sigma'_f / yield strength; sigma'_f is near the true fracture strength, up to ten times
# yield in soft metals
STRENGTHS = (0.5, 50.0)
UNLIKELY = "{:g} to {:g} of {}: other values are a unit mistake"


def unlikely(coefficient: ArrayLike, yield_strength: ArrayLike) -> NDArray[np.bool_]:
    """Return whether a fatigue strength coefficient sigma'_f (...) is implausible for the yield
    strength (...).
    """
    low, high = (np.multiply(ratio, yield_strength) for ratio in STRENGTHS)
    return np.asarray((coefficient < low) | (coefficient > high))


class Material(Table):
    """Isotropic elastic material: `youngs_modulus` and `yield_strength` in MPa, `density` in
    kg/m^3.

    The name of a registered material is sufficient; numbers that differ from it are refused.
    `expansion` in 1/K, `fatigue_strength_coefficient` in MPa; None where a number is not stated.
    """

    model_config = ConfigDict(json_schema_extra=lambda schema: _require_only_name(schema))

    name: Label = Field(examples=["al-7075-t6"])
    """Name of a registered material, which defines all numbers; of a material in `file`; or a name
    of your own, with the numbers in this table """
    youngs_modulus: quantities.Modulus = Field(alias="youngs_modulus_gpa", examples=[71.7])
    """Young's modulus E"""
    poissons_ratio: quantities.Poisson = Field(examples=[0.33])
    """Poisson's ratio"""
    density: quantities.Density = Field(alias="density_kg_m3", examples=[2810.0])
    """Mass density"""
    yield_strength: quantities.Strength = Field(alias="yield_strength_mpa", examples=[503.0])
    """Yield strength"""
    expansion: quantities.Expansion | None = Field(
        default=None, alias="expansion_um_per_m_k", examples=[23.6]
    )
    """Coefficient of linear thermal expansion. Only thermal drift uses it; no other result, and no
    hash of one, depends on it """
    residual_stress: quantities.ResidualStress | None = Field(
        default=None, alias="residual_stress_mpa", examples=[50.0]
    )
    """Stress in all directions of the plane before the plate is released, as of a film on a
    substrate; tension is positive. Bodies that are not fixed relax it. `modes` and `stiffness` of a
    mechanism take it into account """
    fatigue_strength_coefficient: quantities.Strength | None = Field(
        default=None, alias="fatigue_strength_coefficient_mpa", examples=[900.0]
    )
    """sigma'_f of Basquin's law sigma_a = sigma'_f (2 N)^b, for smooth, polished specimens at zero
    mean stress (R = -1). Only lives use it: `flexfem life`, and studies with `[life]` """
    fatigue_strength_exponent: quantities.Exponent | None = Field(default=None, examples=[-0.102])
    """Exponent b of Basquin's law"""
    walker_exponent: quantities.Walker | None = Field(default=None, examples=[0.5])
    """Walker's gamma for mean stress; by default 0.5, for which his equation equals that of Smith,
    Watson and Topper
    """
    fatigue_range: tuple[quantities.Cycles, quantities.Cycles] | None = Field(
        default=None, alias="fatigue_range_cycles", examples=[[1e3, 1e6]]
    )
    """Lowest and highest number of cycles of the fit of Basquin's law; by default 1e3 to 1e6,
    assumed
    """

    @model_validator(mode="before")
    @classmethod
    def _complete_registered(
        cls,
        data: Any,
        info: ValidationInfo,
    ) -> Any:
        if isinstance(data, Material):
            data = data.model_dump(by_alias=info.context != INSIDE, exclude_none=True)
        elif isinstance(data, str) and info.context == INSIDE:
            data = {"name": data}
        if not isinstance(data, dict):
            return data
        known = _known(data.get("name"))
        if known is not None:
            return known.numbers(by_alias=info.context != INSIDE) | data
        stated = {key for key in data if not key.startswith("expansion")}
        if stated == {"name"} and isinstance(data["name"], str):
            nearest = difflib.get_close_matches(data["name"], REGISTERED, n=NEAREST, cutoff=0.0)
            required = [Material.model_fields[name].is_required() for name in NUMBERS]
            others = ", ".join(compress(_keys(info), required))
            raise refusal(
                f"a registered material ({', '.join(nearest)}), or another name with {others}",
                "name",
            )
        return data

    @model_validator(mode="after")
    def _check_fatigue(self, info: ValidationInfo) -> Material:
        key = dict(zip(NUMBERS, _keys(info), strict=True))
        coefficient, exponent, _, cycles = FATIGUE
        given = [name for name in FATIGUE if getattr(self, name) is not None]
        for needed in (coefficient, exponent):
            if given and needed not in given:
                raise refusal(f"{key[needed]} as well", key[given[0]])
        if given and unlikely(self.fatigue_strength_coefficient or 0.0, self.yield_strength):
            raise refusal(UNLIKELY.format(*STRENGTHS, key["yield_strength"]), key[coefficient])
        if self.fatigue_range is not None and not self.fatigue_range[0] < self.fatigue_range[1]:
            raise refusal("the lower number of cycles first", key[cycles])
        return self

    @model_validator(mode="after")
    def _agrees_with_registered(self, info: ValidationInfo) -> Material:
        known = _known(self.name)
        registered = {} if known is None else known.numbers(by_alias=True)
        for name, key, place in zip(NUMBERS, KEYS, _keys(info), strict=True):
            if (
                known is not None
                and key in registered
                and getattr(self, name) != getattr(known, name)
            ):
                number = (
                    f"{registered[key]:g}"
                    if isinstance(registered[key], float)
                    else shown(registered[key])
                )
                raise refusal(
                    f"{number} of the registered material {self.name}, or another name", place
                )
        return self

    @property
    def walker(self) -> float:
        """Walker's exponent; by default that of Smith, Watson and Topper."""
        return SWT if self.walker_exponent is None else self.walker_exponent

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Material:
        """Return a validated copy with some values replaced.

        A changed registered material gets another name.
        """
        return Material(**with_changes(self.model_dump(), update or {}))


def _named_only(value: Any) -> Any:
    """Return the table of a material that is stated by its name alone."""
    return {"name": value} if isinstance(value, str) else value


PartMaterial: TypeAlias = Annotated[Material, BeforeValidator(_named_only)]
NUMBERS = tuple(name for name in Material.model_fields if name != "name")
FATIGUE = (
    "fatigue_strength_coefficient",
    "fatigue_strength_exponent",
    "walker_exponent",
    "fatigue_range",
)
KEYS = tuple(Material.model_fields[name].alias or name for name in NUMBERS)  # in files
_FILE = {
    "type": "string",
    "description": "Name of a TOML file next to this file that defines a material of this name",
    "examples": ["my-materials.toml"],
}


def _require_only_name(schema: dict[str, Any]) -> None:
    """Require only the name in the schema, since a registered material, or one of a file, needs no
    numbers.
    """
    schema["properties"] = {
        "name": schema["properties"]["name"],
        "file": _FILE,
        **schema["properties"],
    }
    schema["required"] = ["name"]


def _keys(info: ValidationInfo) -> tuple[str, ...]:
    return NUMBERS if info.context == INSIDE else KEYS


class Entry(Material):
    """A registered material, or a table of a file of materials, whose name is the name of the
    material.

    source : of all numbers except those with an entry in `sources`.
    """

    model_config = ConfigDict(json_schema_extra=lambda schema: schema["properties"].pop("name"))

    name: Label = "of a file"  # replaced by the name of the table
    source: Label = Field(examples=["works certificate 7"])
    """Source of the numbers; begins with "assumed" if they are assumed"""
    sources: Annotated[Mapping[str, Label], UNCHANGEABLE] = Field(
        default_factory=Unchangeable, examples=[{"poissons_ratio": "assumed: as of others"}]
    )
    """Sources of single numbers by key, where they differ from `source`"""

    @model_validator(mode="after")
    def _check_source_keys(self) -> Entry:
        for key in self.sources:
            if key not in KEYS:
                raise refusal(f"a key of a material: {', '.join(KEYS)}", "sources", key)
        return self

    def numbers(self, by_alias: bool) -> dict[str, Any]:
        """Name and stated numbers, by file keys or by names in inside units."""
        return self.model_dump(
            by_alias=by_alias,
            exclude_none=True,
            exclude={"source", "sources"},
        )

    @property
    def material(self) -> Material:
        """The material without its sources."""
        return Material(**self.numbers(by_alias=False))

    @property
    def provenance(self) -> dict[str, str]:
        """Sources by key path of a stage file."""
        sources = {
            "material": self.source,
            **{f"material.{key}": text for key, text in self.sources.items()},
        }
        return {key: f"{text} ({self.name})" for key, text in sources.items()}


REGISTERED: dict[str, Entry] = {}
_unread = [PACKAGE / "data" / "materials.toml"]


def _known(name: Any) -> Entry | None:
    """Return the registered material of a name, or None.

    The first call reads the shipped and the user's files.
    """
    while _unread:
        REGISTERED.update(read_materials(_unread.pop()))
    load_own()
    return REGISTERED.get(name) if isinstance(name, str) else None


def materials() -> Mapping[str, Material]:
    """Return the registered materials by name, including the user's own.

    A stage file names one in `[material]`.

    Examples
    --------
    >>> materials()["al-6061-t6"].youngs_modulus
    68900.0
    """
    _known(None)
    return MappingProxyType({name: registered.material for name, registered in REGISTERED.items()})


def register_material(name: str, *, source: str, **numbers: Any) -> Material:
    """Register a material of your own under a name, which stage files and studies can then use.

    Parameters
    ----------
    name : one line of text.
    source : source of the numbers, one line; begins with "assumed" if they are assumed.
    **numbers : `youngs_modulus` and `yield_strength`, MPa, `poissons_ratio`, from 0, below 0.5, and
    `density`, kg/m^3;
        optional ones are `expansion`, `fatigue_strength_coefficient`, `fatigue_strength_exponent`,
        `walker_exponent` and `fatigue_range`, as in `Material`.

    Raises
    ------
    BadInput
        The name belongs to another material, or a number is missing or not possible.

    Examples
    --------
    >>> import flexfem
    >>> invar = register_material("invar, lot 7", youngs_modulus=141e3, poissons_ratio=0.29,
    ...     yield_strength=276.0, density=8050.0, source="assumed: example")
    >>> flexfem.load("geometry/mobility6.toml").replace(material="invar, lot 7").material == invar
    True
    """
    known = _known(name)
    if (
        not isinstance(source, str)
        or not source.strip()
        or not source.isprintable()
        or len(source) > LABEL_LENGTH // 2
    ):
        raise BadInput(
            f"material {printed(name)}: source = {shown(source)}, expected one line of text"
        )
    try:
        entry = Entry(**{"name": name, **numbers}, source=source)
    except BadInput as refused:
        raise BadInput(
            f"material {printed(name)}: {refused.reason.removeprefix('Entry: ')}"
        ) from None
    if known is not None and source != known.source:
        raise BadInput(f"material {printed(name)} is known already, expected another name")
    REGISTERED[name] = entry
    return entry.material


def sources_of(name: Any) -> dict[str, str]:
    """Return the provenance of a registered material by key path; empty for any other name."""
    known = _known(name)
    return {} if known is None else known.provenance


def with_changes(content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a changed material by attribute name.

    A changed registered material gets another name.

    A registered name among the changes replaces all numbers.
    """
    content = {name: value for name, value in content.items() if value is not None}
    if "name" in changes:
        return dict(changes) if _known(changes["name"]) else {**content, **changes}
    changed = {**content, **changes}
    if changed != content and _known(content["name"]):
        changed["name"] = f"{content['name']}, changed"
    return changed


def read_materials(path: PathLike) -> dict[str, Entry]:
    """Return the materials of a TOML file by name; each is a table with its numbers and `source`.

    Raises BadInput, naming file and line, when a key is missing, unknown or has a value that is not
    possible.
    """
    data = read_toml(path).data
    fields: Any = {f"table_{k}": (Entry, Field(alias=name)) for k, name in enumerate(data)}
    tables = validate(create_model("MaterialsFile", __base__=Table, **fields), path, _named)
    registered = {name: getattr(tables, field) for name, field in zip(data, fields, strict=True)}
    for name in (name for name in data if "name" in data[name]):
        text = (
            f"{key_path((name, 'name'))} = {shown(data[name]['name'])}, expected no name: that of "
            "the table is used"
        )
        raise bad_key(path, (name, "name"), text)
    return registered


def _named(data: dict[str, Any]) -> dict[str, Any]:
    """Add the name of every table of a file of materials to its content."""
    return {
        name: {"name": name} | table if isinstance(table, dict) else table
        for name, table in data.items()
    }


def with_material_of_file(path: PathLike, data: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a file with the numbers of a material that it takes from another file.

    Raises BadInput as `read_materials`, and when the file has no material of that name.
    """
    table = data.get("material")
    stated = data.get("provenance", {})
    if not isinstance(table, dict) or "file" not in table or not isinstance(stated, dict):
        return data
    file = table["file"]
    name = table.get("name")
    at = ("material", "file")
    if set(table) != {"name", "file"} or not isinstance(file, str) or not isinstance(name, str):
        expected = "expected a file name, and no other key but name"
        raise bad_key(path, at, f"material.file = {shown(file)}, {expected}")
    source = Path(path).parent / file
    available = read_materials(source)
    if name not in available:
        names = ", ".join(available) or "one material or more"
        expected = f"expected one of {place_of(source)}: {names}"
        raise bad_key(path, at, f"material.name = {shown(name)}, {expected}")
    sources = {key: f"{text}, {file}" for key, text in available[name].provenance.items()}
    return data | {
        "material": available[name].numbers(by_alias=True),
        "provenance": sources | stated,
    }


class Frame(Table):
    """The frame to which a mechanism is fixed: its coefficient of linear thermal expansion, 1/K.

    None stands for the coefficient of the mechanism.
    """

    expansion: quantities.FrameExpansion | None = Field(
        default=None, alias="expansion_um_per_m_k", examples=[12.0]
    )
    """Coefficient of linear thermal expansion of the frame; by default the frame is assumed to
    expand like the stage
    """
