"""The material of a stage, and those that are known by name: shipped ones and the user's own, each with its source.

A table `[material]` with the name of a registered material alone has the numbers of that one.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from pydantic import Field, ValidationInfo, model_validator

from flexfem import own
from flexfem.files.refusals import refusal, shown
from flexfem.files.toml import LABEL_LENGTH, Label
from flexfem.refused import BadInput
from flexfem.sources import read_data
from flexfem.stage.inside import INSIDE, Dimensioned, Modulus

NEAREST = 5  # names listed beside one that is not known


class Material(Dimensioned):
    """Isotropic elastic material: `youngs_modulus` and `yield_strength` in MPa, `density` in kg/m^3.

    The name of a registered material alone gives its numbers; other numbers beside such a name are refused.
    """

    name: Label
    youngs_modulus: Modulus = Field(alias="youngs_modulus_gpa")
    poissons_ratio: float = Field(ge=0, lt=0.5)
    density: float = Field(alias="density_kg_m3", gt=0)
    yield_strength: float = Field(alias="yield_strength_mpa", gt=0)

    @model_validator(mode="before")
    @classmethod
    def _has_the_numbers_of_its_name(cls, data: Any, info: ValidationInfo) -> Any:
        known = _known(data.get("name")) if isinstance(data, dict) else None
        if known is None and isinstance(data, dict) and set(data) == {"name"} and isinstance(data["name"], str):
            nearest = difflib.get_close_matches(data["name"], REGISTERED, n=NEAREST, cutoff=0.0)
            others = ", ".join(_keys(info))
            raise refusal(f"a registered material ({', '.join(nearest)}), or beside it {others}", "name")
        return data if known is None else known.material.model_dump(by_alias=info.context != INSIDE) | data

    @model_validator(mode="after")
    def _contradicts_no_registered_one(self, info: ValidationInfo) -> Material:
        known = _known(self.name)
        for name, key, place in zip(NUMBERS, KEYS, _keys(info), strict=True):
            if known is not None and getattr(self, name) != getattr(known.material, name):
                number = known.material.model_dump(by_alias=True)[key]
                raise refusal(f"{number:g} as of the registered material {self.name}, or another name", place)
        return self

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Material:
        """A copy with values replaced by name, validated like any other; a registered material changed is another."""
        return self.from_names(with_changes(self.model_dump(), update or {}))


NUMBERS = tuple(name for name in Material.model_fields if name != "name")
KEYS = tuple(Material.model_fields[name].alias or name for name in NUMBERS)  # in files


def _keys(info: ValidationInfo) -> tuple[str, ...]:
    return NUMBERS if info.context == INSIDE else KEYS


class Registered(NamedTuple):
    """A material known by its name, and where its numbers come from."""

    material: Material
    source: str


REGISTERED: dict[str, Registered] = {}
_unread = ["materials.toml"]  # files below data/


def _known(name: Any) -> Registered | None:
    """The registered material of a name, None of none; what is shipped or the user's own is read when first asked."""
    while _unread:
        for each, content in tomllib.loads(read_data(_unread.pop())).items():
            source = content.pop("source")
            REGISTERED[each] = Registered(Material.model_validate({"name": each, **content}), source)
    own.load()
    return REGISTERED.get(name) if isinstance(name, str) else None


def materials() -> Mapping[str, Material]:
    """The registered materials by name, the user's own included; a stage file names one in `[material]`.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.materials()["al-6061-t6"].youngs_modulus
    68900.0
    """
    _known(None)
    return MappingProxyType({name: each.material for name, each in REGISTERED.items()})


def register_material(
    name: str, *, youngs_modulus: float, poissons_ratio: float, yield_strength: float, density: float, source: str
) -> Material:
    """Make a material of one's own known by a name, to every stage file and study that says so.

    Parameters
    ----------
    name : one line of text.
    youngs_modulus, yield_strength : MPa.
    poissons_ratio : from 0, below 0.5.
    density : kg/m^3.
    source : where the numbers come from, one line; begins with "assumed" when they are.

    Raises
    ------
    BadInput
        The name is taken by another material, or a number is not possible.

    Examples
    --------
    >>> import flexfem
    >>> invar = flexfem.register_material("invar, lot 7", youngs_modulus=141e3, poissons_ratio=0.29,
    ...     yield_strength=276.0, density=8050.0, source="assumed: example")
    >>> flexfem.load("geometry/mobility6.toml").replace(material="invar, lot 7").material == invar
    True
    """
    known = _known(name)
    try:
        made = Material.from_names(
            {
                "name": name,
                "youngs_modulus": youngs_modulus,
                "poissons_ratio": poissons_ratio,
                "yield_strength": yield_strength,
                "density": density,
            }
        )
    except BadInput as refused:
        raise BadInput(f"material {name!r}: {refused.reason.removeprefix('Material: ')}") from None
    if not isinstance(source, str) or not source.strip() or not source.isprintable() or len(source) > LABEL_LENGTH // 2:
        raise BadInput(f"material {name!r}: source = {shown(source)}, expected one line of text")
    if known is not None and source != known.source:
        raise BadInput(f"material {name!r} is known already, expected another name")
    REGISTERED[name] = Registered(made, source)
    return made


def source_of(name: Any) -> str | None:
    """Where the numbers of a registered material come from, as a provenance; None of another name."""
    known = _known(name)
    return None if known is None else f"{known.source} ({name})"


def with_changes(held: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a changed material, by attribute names: changed numbers are not those of a registered name.

    A registered name among the changes brings its own numbers.
    """
    if "name" in changes:
        return dict(changes) if _known(changes["name"]) else {**held, **changes}
    content = {**held, **changes}
    if content != dict(held) and _known(held["name"]):
        content["name"] = f"{held['name']}, changed"
    return content
