"""The stage: what a stage file says, validated, in N-mm-MPa-rad.

A stage is a frozen noun. Its file keys end in their unit; the attributes carry none and hold inside units (the file's
GPa become MPa, its degrees radians; density stays in kg/m^3). Only what one number can be wrong about is checked here;
whether the parts fit together is the business of the feasibility checks.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias, get_args, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, Field, model_validator

from flexfem.arrays import Array
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label as Label
from flexfem.files.toml import Path, Table, validate

HingeName: TypeAlias = Literal["base", "elbow", "platform"]
HINGE_NAMES: tuple[HingeName, HingeName, HingeName] = ("base", "elbow", "platform")
Plane: TypeAlias = Literal["plane_stress", "plane_strain", "corrected"]
CHAINS = (1, 2, 3)


def _gpa(value: float) -> float:
    return 1e3 * value


def _at_least(smallest: float) -> Callable[[float], float]:
    def checked(value: float) -> float:
        if value < smallest:
            raise refusal(f"at least {smallest:g}: less is a unit mistake")
        return value

    return checked


Length: TypeAlias = Annotated[float, Field(gt=0, le=1e4), AfterValidator(_at_least(1e-6))]  # 1 nm to 10 m
Modulus: TypeAlias = Annotated[float, Field(gt=0, le=2000), AfterValidator(_at_least(1e-3)), AfterValidator(_gpa)]
Angle: TypeAlias = Annotated[float, Field(ge=-360, le=360), AfterValidator(math.radians)]


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


class Stage(Sourced):
    """A planar 3-RRR flexure stage; `thickness` out of plane in mm, `provenance` by key path of the file.

    model : how the stage is made a plane problem; "corrected" has hinges of three dimensions, in the analytic model.
    """

    kind: ClassVar[str] = "stage file"

    name: Label
    model: Plane = "plane_stress"
    thickness: Length = Field(alias="thickness_mm")
    material: Material
    chain: Chain
    hinges: Hinges
    platform: Platform
    override: tuple[Override, ...] = ()

    @model_validator(mode="after")
    def _overrides_each_hinge_once(self) -> Stage:
        seen: dict[tuple[int, str], int] = {}
        for index, override in enumerate(self.override):
            first = seen.setdefault((override.chain, override.hinge), index)
            if first != index:
                raise refusal(f"each hinge overridden once, and override[{first}] is the same hinge", "override", index)
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


def _canonical(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _canonical(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    return float(value) + 0.0  # -0.0 is 0.0


assert get_args(HingeName) == HINGE_NAMES
