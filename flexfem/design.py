"""The stage: what a stage file says, validated, in N-mm-MPa-rad.

A stage is a frozen noun. Its file keys end in their unit; the attributes carry none and hold inside units (the file's
GPa become MPa, its degrees radians; density stays in kg/m^3). Only what one number can be wrong about is checked here;
whether the parts fit together is the business of the feasibility checks.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, get_args, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, BaseModel, Field, field_validator, model_validator

from flexfem.arrays import Array
from flexfem.refusals import refusal, suggestion
from flexfem.tomlfile import Path, Table, validate

HingeName: TypeAlias = Literal["base", "elbow", "platform"]
HINGE_NAMES: tuple[HingeName, HingeName, HingeName] = ("base", "elbow", "platform")
Plane: TypeAlias = Literal["plane_stress", "plane_strain", "corrected"]
CHAINS = (1, 2, 3)
LABEL_LENGTH = 500  # characters; a full citation fits, a pasted page does not


def _gpa(value: float) -> float:
    return 1e3 * value


def _label(value: str) -> str:
    if not value.strip() or not value.isprintable() or len(value) > LABEL_LENGTH:
        raise refusal(f"one line of 1 to {LABEL_LENGTH} printable characters")
    return value


def _at_least(smallest: float) -> Callable[[float], float]:
    def checked(value: float) -> float:
        if value < smallest:
            raise refusal(f"at least {smallest:g}: less is a unit mistake")
        return value

    return checked


Length: TypeAlias = Annotated[float, Field(gt=0, le=1e4), AfterValidator(_at_least(1e-6))]  # 1 nm to 10 m
Modulus: TypeAlias = Annotated[float, Field(gt=0, le=2000), AfterValidator(_at_least(1e-3)), AfterValidator(_gpa)]
Angle: TypeAlias = Annotated[float, Field(ge=-360, le=360), AfterValidator(math.radians)]
Label: TypeAlias = Annotated[str, AfterValidator(_label)]


class Material(Table):
    """Isotropic elastic material: `youngs_modulus` and `yield_strength` in MPa, `density` in kg/m^3."""

    name: Label
    youngs_modulus: Modulus = Field(alias="youngs_modulus_gpa")
    poissons_ratio: float = Field(ge=0, lt=0.5)
    density: float = Field(alias="density_kg_m3", gt=0)
    yield_strength: float = Field(alias="yield_strength_mpa", gt=0)


class Chain(Table):
    """Chain 1; the others are turned by 120 and 240 degrees. Lengths in mm, relative angles as in (19) in rad."""

    link_lengths: tuple[Length, Length, Length] = Field(alias="link_lengths_mm")
    joint_angles: tuple[Angle, Angle, Angle] = Field(alias="joint_angles_deg")
    link_width: Length = Field(alias="link_width_mm")


class Hinge(Table):
    """A circular hinge: cutting `radius` and `neck` in mm; `axis` in rad, None for along the link."""

    radius: Length = Field(alias="radius_mm")
    neck: Length = Field(alias="neck_mm")
    prismatic: bool = False
    axis: Angle | None = Field(default=None, alias="axis_deg")


class Hinges(Table):
    """The three hinges every chain has unless an override says otherwise."""

    base: Hinge
    elbow: Hinge
    platform: Hinge


class Override(Table):
    """What differs at one of the nine hinges; None keeps the value of `Hinges`."""

    chain: int = Field(ge=1, le=3)
    hinge: HingeName
    radius: Length | None = Field(default=None, alias="radius_mm")
    neck: Length | None = Field(default=None, alias="neck_mm")
    prismatic: bool | None = None
    axis: Angle | None = Field(default=None, alias="axis_deg")

    @model_validator(mode="after")
    def _changes_something(self) -> Override:
        if not self.changes:
            raise refusal("at least one of radius_mm, neck_mm, prismatic, axis_deg")
        return self

    @property
    def changes(self) -> dict[str, float | bool]:
        """The attributes of `Hinge` that are replaced, with their new values."""
        values = {name: getattr(self, name) for name in Hinge.model_fields}
        return {name: value for name, value in values.items() if value is not None}


class Platform(Table):
    """The platform disc and its rigid hub, radii in mm."""

    radius: Length = Field(alias="radius_mm")
    hub_radius: Length = Field(alias="hub_radius_mm")


class Elastic(NamedTuple):
    """Constants that make the equations of plane stress those of a stage's model: E (...) in MPa, Poisson's ratio."""

    youngs_modulus: Array
    poissons_ratio: Array


def elastic(model: Plane, youngs_modulus: ArrayLike, poissons_ratio: ArrayLike) -> Elastic:
    """Elastic constants (...) of a plane model of a material; the arguments broadcast.

    Notes
    -----
    Plane strain is plane stress with `E / (1 - nu^2)` and `nu / (1 - nu)`. A corrected model is plane stress with
    factors on the hinges alone (`analytic/thick.py`): links are about as wide as thick.
    """
    E, nu = np.broadcast_arrays(np.asarray(youngs_modulus, dtype=float), np.asarray(poissons_ratio, dtype=float))
    return Elastic(E / (1 - nu**2), nu / (1 - nu)) if model == "plane_strain" else Elastic(E, nu)


def out_of_plane(model: Plane, poissons_ratio: ArrayLike) -> Array:
    """The stress out of the plane over the sum of those in it (...): nu in plane strain, else 0."""
    nu = np.asarray(poissons_ratio, dtype=float)
    return nu if model == "plane_strain" else np.zeros_like(nu)


class Stage(Table):
    """A planar 3-RRR flexure stage; `thickness` out of plane in mm, `provenance` by key path of the file.

    model : how the stage is made a plane problem; "corrected" has hinges of three dimensions, in the analytic model.
    """

    name: Label
    model: Plane = "plane_stress"
    thickness: Length = Field(alias="thickness_mm")
    material: Material
    chain: Chain
    hinges: Hinges
    platform: Platform
    override: tuple[Override, ...] = ()
    provenance: Mapping[str, Label] = Field(default_factory=dict)

    @field_validator("provenance", mode="before")
    @classmethod
    def _key_paths_are_quoted(cls, provenance: Any) -> Any:
        for key, value in provenance.items() if isinstance(provenance, dict) else ():
            if isinstance(value, dict):
                raise refusal('text; write the whole key path in quotes, like "chain.link_lengths_mm"', key)
        return provenance

    @model_validator(mode="after")
    def _overrides_each_hinge_once(self) -> Stage:
        seen: dict[tuple[int, str], int] = {}
        for index, override in enumerate(self.override):
            first = seen.setdefault((override.chain, override.hinge), index)
            if first != index:
                raise refusal(f"each hinge overridden once, and override[{first}] is the same hinge", "override", index)
        return self

    @model_validator(mode="after")
    def _provenance_names_keys(self) -> Stage:
        known = key_paths(self)
        for key in self.provenance:
            if key not in known:
                raise refusal(f"a key path of this file{suggestion(key, known)}", "provenance", key)
        return self

    def __hash__(self) -> int:
        """Hash consistently with equality, so that a stage can be a key."""
        return hash(self.hash)

    def hinge(self, chain: int, name: str) -> Hinge:
        """Return a hinge of chain 1, 2 or 3 with its override applied; ValueError when there is no such hinge."""
        if chain not in CHAINS or name not in HINGE_NAMES:
            raise ValueError(f"no hinge {name!r} in chain {chain}: chains are {CHAINS}, hinges {HINGE_NAMES}")
        hinge: Hinge = getattr(self.hinges, name)
        for override in self.override:
            if (override.chain, override.hinge) == (chain, name):
                return hinge.model_copy(update=override.changes)
        return hinge

    @overload
    def array(self, attr: Literal["radius", "neck"]) -> Array: ...
    @overload
    def array(self, attr: Literal["prismatic"]) -> NDArray[np.bool_]: ...
    def array(self, attr: Literal["radius", "neck", "prismatic"]) -> Array | NDArray[np.bool_]:
        """Return an attribute of all hinges, shape (3 chains, 3 hinges): mm, or bool for `prismatic`."""
        if attr not in ("radius", "neck", "prismatic"):
            raise ValueError(f"no array of {attr!r}: expected radius, neck or prismatic")
        kind = np.bool_ if attr == "prismatic" else np.float64
        return np.array([[getattr(self.hinge(i, name), attr) for name in HINGE_NAMES] for i in CHAINS], dtype=kind)

    @property
    def mobility(self) -> int:
        """Mobility by Gruebler-Kutzbach (1): three, and one for every prismatic hinge."""
        return 3 + int(self.array("prismatic").sum())  # (1)

    @property
    def elastic(self) -> Elastic:
        """Elastic constants of the plane problem, by `model`; `material` keeps the metal's own."""
        return elastic(self.model, self.material.youngs_modulus, self.material.poissons_ratio)

    @property
    def chains_alike(self) -> bool:
        """Whether the hinges of chains 2 and 3 equal those of chain 1, so that the stage is three-fold symmetric."""
        return all(self.hinge(i, name) == self.hinge(1, name) for i in CHAINS for name in HINGE_NAMES)

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths of the values, in order, whose provenance (their own or their table's) starts with "assumed"."""
        sources = {path: provenance_of(self, path) or "" for path, value in _walk(self) if not _is_table(value)}
        return tuple(path for path, source in sources.items() if source.strip().lower().startswith("assumed"))

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content: inside units, overrides applied, no names, no provenance."""
        content = self.model_dump(exclude={"name": True, "provenance": True, "override": True, "material": {"name"}})
        if self.model == "plane_stress":  # the hashes of stages older than the key stay
            del content["model"]
        content["hinges"] = [[self.hinge(i, name).model_dump() for name in HINGE_NAMES] for i in CHAINS]
        text = json.dumps(_canonical(content), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()


def load_stage(path: Path) -> Stage:
    """Read a stage file.

    Raises
    ------
    BadInput
        The file cannot be read, is not TOML, or says something no stage can have; one line naming file, line, key,
        value and expectation.
    """
    return validate(Stage, path)


def key_of(stage: Stage, chain: int, hinge: str, key: str) -> str:
    """Key path in the stage file that sets a hinge's value, an override's where there is one."""
    attribute = key.rsplit("_", 1)[0]
    for index, override in enumerate(stage.override):
        if (override.chain, override.hinge) == (chain, hinge) and getattr(override, attribute) is not None:
            return f"override[{index}].{key}"
    return f"hinges.{hinge}.{key}"


def key_paths(stage: Table) -> tuple[str, ...]:
    """Return the key path of every table and value the file gives, provenance excepted, an array counting as one."""
    return tuple(path for path, _ in _walk(stage))


def numeric_key_paths(stage: Stage) -> tuple[str, ...]:
    """Return the key paths of all measured numbers the file gives; `override[0].chain` is an address, not a number."""
    return tuple(path for path, value in _walk(stage) if _is_number(value))


def provenance_of(stage: Stage, key_path: str) -> str | None:
    """Return where the value at `key_path` comes from, by its own provenance or else its nearest table's, or None.

    Raises
    ------
    KeyError
        The file gives no such key.
    """
    if key_path not in key_paths(stage):
        raise KeyError(key_path)
    while key_path and key_path not in stage.provenance:
        key_path = re.sub(r"(^|\.)[^.\[]+$|\[\d+\]$", "", key_path)
    return stage.provenance.get(key_path)


def _walk(table: BaseModel, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, field in type(table).model_fields.items():
        if name in table.model_fields_set and name != "provenance":
            path, value = prefix + (field.alias or name), getattr(table, name)
            yield path, value
            if isinstance(value, BaseModel):
                yield from _walk(value, f"{path}.")
            for index, item in enumerate(value if _is_table(value) and isinstance(value, tuple) else ()):
                yield f"{path}[{index}]", item
                yield from _walk(item, f"{path}[{index}].")


def _is_table(value: Any) -> bool:
    return isinstance(value, BaseModel) or (isinstance(value, tuple) and all(isinstance(v, BaseModel) for v in value))


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or (isinstance(value, tuple) and any(isinstance(v, float) for v in value))


def _canonical(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _canonical(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    return float(value) + 0.0  # -0.0 is 0.0


assert get_args(HingeName) == HINGE_NAMES
