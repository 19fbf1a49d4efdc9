"""What a stage file says, validated, in N-mm-MPa-rad: its tables, overrides, and where they come from.

File keys end in their unit; the attributes carry none and hold inside units (the file's degrees become radians).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias

from pydantic import BaseModel, Field, ValidationError, create_model, model_validator

from flexfem.files.provenance import Sourced
from flexfem.files.refusals import KeyPath, key_path, path_of, place_of, problem_of, refusal, shown, suggestion
from flexfem.files.toml import Label, read_toml
from flexfem.mechanism.actuators import HINGE_NAMES as HINGE_NAMES
from flexfem.mechanism.actuators import Actuator
from flexfem.mechanism.actuators import HingeName as HingeName
from flexfem.mechanism.dimensioned import Angle, Dimensioned, FrameExpansion, Length, once, plain
from flexfem.mechanism.materials import Material, sources_of, with_changes
from flexfem.refused import BadInput

Plane: TypeAlias = Literal["plane_stress", "plane_strain", "corrected"]
CHAINS = (1, 2, 3)


class Chain(Dimensioned):
    """Chain 1; the others are turned by 120 and 240 degrees. Lengths in mm, relative angles as in (19) in rad."""

    link_lengths: tuple[Length, Length, Length] = Field(alias="link_lengths_mm", examples=[[30.0, 32.0, 24.0]])
    """l1 base to elbow hinge, l2 elbow to platform hinge, l3 platform hinge to platform centre"""
    joint_angles: tuple[Angle, Angle, Angle] = Field(alias="joint_angles_deg", examples=[[180.0, -90.0, 90.0]])
    """phi_1, phi_2, phi_3 at rest, counter-clockwise, each relative to the link before it; the first to the x axis"""
    link_width: Length = Field(alias="link_width_mm", examples=[9.0])
    """Width of links, clamped pads and lugs of the platform"""


class Hinge(Dimensioned):
    """A circular hinge: cutting `radius` and `neck` in mm; `axis` in rad, None for along the link."""

    radius: Length = Field(alias="radius_mm", examples=[4.0])
    """R of the two circular cuts"""
    neck: Length = Field(alias="neck_mm", examples=[0.5])
    """t, the narrowest width, which the two cuts leave"""
    prismatic: bool = False
    """Whether the model lets it stretch as well as turn"""
    axis: Angle | None = Field(default=None, alias="axis_deg", examples=[180.0])
    """Direction of the neck in the frame of chain 1, turned with each chain; by default of base and elbow hinge along
    link 1, of the platform hinge along link 2"""


class Hinges(Dimensioned):
    """The three hinges every chain has unless an override says otherwise."""

    base: Hinge
    """The hinge at the clamped pad; link 1 starts here"""
    elbow: Hinge
    """The hinge between link 1 and link 2"""
    platform: Hinge
    """The hinge between link 2 and the platform"""


class Platform(Dimensioned):
    """The platform disc and its rigid hub, where the load acts and the pose is read; radii in mm."""

    radius: Length = Field(alias="radius_mm", examples=[17.0])
    """Of the disc"""
    hub_radius: Length = Field(alias="hub_radius_mm", examples=[8.0])
    """Of the hole in it, taken as filled by a rigid disc: loads act there, the pose is read there"""


class Frame(Dimensioned):
    """What the pads are clamped to: coefficient of linear thermal expansion, 1/K; None for that of the stage."""

    expansion: FrameExpansion | None = Field(default=None, alias="expansion_um_per_m_k", examples=[12.0])
    """Coefficient of linear thermal expansion of the frame. Where it is not stated the frame is assumed to expand as
    the stage does"""


OF_HINGES = tuple(Hinge.model_fields)  # attributes that may be given without naming the table


def merged_changes(held: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a changed stage; `held` is its `model_dump`, changes are as `Stage.replace` takes them.

    Raises BadInput for an override that names no hinge or is no table.
    """
    content, given = plain(held), {name: _plain(value) for name, value in changes.items()}
    for name in [name for name in OF_HINGES if name in given]:
        value = given.pop(name)
        by_hinge = value if isinstance(value, dict) else dict.fromkeys(HINGE_NAMES, value)
        content = _merge(content, {"hinges": {hinge: {name: each} for hinge, each in by_hinge.items()}})
    if "material" in given:
        value = given.pop("material")
        named = {"name": value} if isinstance(value, str) else value
        content["material"] = with_changes(content["material"], value) if isinstance(value, dict) else named
    if isinstance(given.get("override"), dict):
        content["override"] = _overridden(content.get("override", []), given.pop("override"))
    return dict(_merge(content, given))


def _overridden(held: list[Any], given: Mapping[Any, Any]) -> list[Any]:
    found = {place_of_override(each): each for each in held}
    for place, values in given.items():
        about = tuple(plain(place)) if isinstance(place, tuple) else (None, place)
        match about:
            case (int(chain), str(hinge)) if chain in CHAINS and hinge in HINGE_NAMES:
                named: dict[str, Any] = {"chain": chain, "hinge": hinge}
            case (int(chain), "actuator", str(name)) if chain in CHAINS:
                named = {"chain": chain, "actuator": name}
            case _:
                names = ", ".join(HINGE_NAMES)
                expected = f'(1, 2 or 3, one of {names}) or (1, 2 or 3, "actuator", its name)'
                raise BadInput(f"override: no hinge {shown(str(place))}, expected {expected}")
        if not isinstance(values, Mapping):
            keys = f", any of {', '.join(OF_HINGES)}" if "hinge" in named else ""
            raise BadInput(f"{key_path(('override', *map(str, about)))} = {shown(values)}, expected a table{keys}")
        found[about] = found.get(about, named) | dict(values)
    return list(found.values())


Place: TypeAlias = tuple[int | str, ...]


def place_of_override(override: Mapping[str, Any]) -> Place:
    """What an override is about: chain and hinge, or chain, "actuator" and the actuator's name."""
    if override.get("actuator") is not None:
        return override["chain"], "actuator", override["actuator"]
    return override["chain"], override["hinge"]


def _merge(old: Any, new: Any) -> Any:
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    return old | {key: _merge(old.get(key), value) for key, value in new.items()}


def _plain(value: Any, member: bool = False) -> Any:
    """A table built in Python by its content, which replaces what is held as far as it says anything.

    member : whether it is one of an array, which replaces another whole, so that None says nothing.
    """
    value = value.model_dump(exclude_unset=True) if isinstance(value, BaseModel) else value
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items() if not (member and item is None)}
    return [_plain(item, True) for item in value] if isinstance(value, list | tuple) else plain(value)


def of_drive(key: str) -> bool:
    """Whether a key path of a stage file, or of its provenance, is one of the drive."""
    return re.match(r"actuator|override\.\d\.actuator", key.removeprefix("provenance.").lstrip('"')) is not None


def of_heat(key: str) -> bool:
    """Whether a key path of a stage file, or of its provenance, is about expansion."""
    return re.match(r"frame|material\.expansion", key.removeprefix("provenance.").lstrip('"')) is not None


def assumptions_said(assumed: Collection[str], not_stated: Collection[str], of: str = "of these numbers ") -> list[str]:
    """How many numbers are assumed and how many have no stated source, in words, each if there are any."""
    verbs = ((assumed, ("is assumed", "are assumed")), (not_stated, ("has no stated source", "have no stated source")))
    return [counted(len(keys), *(of + verb for verb in both)) for keys, both in verbs if keys]


def counted(count: int, one: str, many: str) -> str:
    """A count with what agrees with it: "1 number is", "2 numbers are"."""
    return f"{count} {one if count == 1 else many}"


class _About(Dimensioned):
    """The part of an override that says what it is about."""

    described_by: ClassVar = (Hinge, Actuator)

    chain: int = Field(ge=1, le=3, examples=[2])
    """The chain that it is about"""
    hinge: HingeName | None = None
    """The hinge of that chain that it is about"""
    actuator: Label | None = Field(default=None, examples=["base"])
    """Instead of `hinge`: the name of the actuator that it is about"""

    @model_validator(mode="after")
    def _changes_one_thing(self) -> Self:
        if (self.hinge is None) == (self.actuator is None):
            raise refusal("the hinge or the actuator that it is about, one of the two")
        about, possible = ("a hinge", OF_HINGES) if self.actuator is None else ("an actuator", OF_ACTUATORS)
        keys = {name: field.alias or name for name, field in type(self).model_fields.items()}
        known = ", ".join(keys[name] for name in possible)
        for name in self.changes:
            if name not in possible:
                raise refusal(f"with {about} only {known}", keys[name])
        if not self.changes:
            raise refusal(f"at least one of {known}")
        return self

    @property
    def changes(self) -> dict[str, Any]:
        """The attributes of its `Hinge` or `Actuator` that are replaced, with their new values."""
        return {name: value for name, value in self if value is not None and name not in ABOUT_IT}

    @property
    def place(self) -> Place:
        """What it is about."""
        return place_of_override(vars(self))


ABOUT_IT = tuple(_About.model_fields)
NOT_OVERRIDDEN = ("name", "between", "hinge", "pair", "ball_loose")
OF_ACTUATORS = tuple(name for name in Actuator.model_fields if name not in NOT_OVERRIDDEN)


def _optional(table: type[BaseModel], name: str) -> Any:
    """The field of a table, which an override need not give."""
    of = table.model_fields[name]
    kind: Any = Annotated[of.annotation, *of.metadata] if of.metadata else of.annotation
    extra: dict[str, Any] = {"json_schema_extra": of.json_schema_extra} if of.json_schema_extra else {}
    return kind | None, Field(default=None, alias=of.alias, examples=of.examples, **extra)


_FIELDS: dict[str, Any] = {name: _optional(Hinge, name) for name in OF_HINGES}
_FIELDS |= {name: _optional(Actuator, name) for name in OF_ACTUATORS}
if TYPE_CHECKING:
    Override = _About
else:
    Override = create_model(
        "Override",
        __base__=_About,
        __module__=__name__,
        __doc__="What differs at one of the nine hinges, or at an actuator on one chain; None keeps its table's value.",
        **_FIELDS,
    )


class Origin(NamedTuple):
    """The file of a stage, None without one, and whether it was changed since it was read."""

    path: str | None = None
    changed: bool = False

    def __str__(self) -> str:
        return "" if self.path is None else self.path + ", changed" * self.changed


class StageContent(Dimensioned, Sourced):
    """The content of a stage file, without what `Stage` computes of it."""

    kind: ClassVar[str] = "stage file"

    name: Label = Field(examples=["my stage"])
    """Shown in tables and figures"""
    model: Plane = "plane_stress"
    """How the stage is made a plane problem, in both models: `plane_stress`, the paper's; `plane_strain`; or
    `corrected`: plane stress with the hinges' compliances and neck stresses corrected for their thickness by
    three-dimensional finite elements, in the analytic model alone, because the finite elements of the stage are
    plane"""
    thickness: Length = Field(alias="thickness_mm", examples=[10.0])
    """b, out of plane"""
    material: Material
    """What the stage is made of, isotropic"""
    chain: Chain
    """Chain 1; the others are the same, turned by 120 and 240 degrees"""
    hinges: Hinges
    """The hinges of every chain, from the base to the platform"""
    platform: Platform
    """The disc that is moved"""
    frame: Frame = Field(default_factory=Frame)
    """What the pads are clamped to. Drift alone asks for it: `flexfem drift`, and studies with `[drift]`"""
    override: tuple[Override, ...] = ()
    """What differs at one of the nine hinges alone, or at an actuator on one chain: beside what it is about, keys of
    that hinge or actuator with their values there. As many as wanted, in any order, each about something else"""
    actuator: tuple[Actuator, ...] = ()
    """A piezo stack, or a pair of them, at the same place of every chain; as many as wanted. They make the stage a
    driven one; what is asked of the passive stage does not depend on them"""

    @model_validator(mode="before")
    @classmethod
    def _registered_material_has_its_source(cls, data: Any) -> Any:
        material, stated = (data.get(key) for key in ("material", "provenance")) if isinstance(data, dict) else (0, 0)
        sources = sources_of(material.get("name") if isinstance(material, dict) else getattr(material, "name", None))
        if not sources or not isinstance(stated, dict | None):
            return data
        return data | {"provenance": sources | (stated or {})}

    @model_validator(mode="after")
    def _names_each_actuator_once(self) -> Self:
        names = [actuator.name for actuator in self.actuator]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise refusal("a name that no other actuator has", "actuator", index, "name")
        _check_overrides(self)
        return self

    @cached_property
    def origin(self) -> Origin:
        """Where the stage comes from; no part of its hash, and two stages may be equal without it."""
        return Origin()

    def hinge(self, chain: int, name: str) -> Hinge:
        """Return a hinge of chain 1, 2 or 3 with its override applied; ValueError when there is no such hinge."""
        if chain not in CHAINS or name not in HINGE_NAMES:
            raise ValueError(f"no hinge {name!r} in chain {chain}: chains are {CHAINS}, hinges {HINGE_NAMES}")
        return hinges_of(self)[chain - 1][HINGE_NAMES.index(name)]


def _check_overrides(stage: StageContent) -> None:
    """Raise a refusal where two are about the same, or one makes an actuator that there is not or cannot be."""
    places = [override.place for override in stage.override]
    actuators = {actuator.name: actuator for actuator in stage.actuator}
    for index, override in enumerate(stage.override):
        if places[index] in places[:index]:
            raise refusal(f"each {'hinge' if override.hinge else 'actuator'} overridden once", "override", index)
        if override.actuator is None:
            continue
        if override.actuator not in actuators:
            close = suggestion(override.actuator, actuators) or (f", one of {', '.join(actuators)}" * bool(actuators))
            raise refusal(f"an actuator of this stage{close}", "override", index, "actuator")
        held = _content(actuators[override.actuator], override)
        try:
            Actuator.model_validate(held)
        except ValidationError as error:
            problem = problem_of(error.errors(include_url=False)[0], held)
            said = override.model_dump(by_alias=True, exclude_none=True)
            at = [part for part in problem.path if part in said]
            raise refusal(problem.expected, "override", index, *at) from None


def _content(actuator: Actuator, override: Override) -> dict[str, Any]:
    """What a file would say of an overridden actuator."""
    own = override.model_dump(by_alias=True, exclude_none=True, exclude=set(ABOUT_IT))
    return actuator.model_dump(by_alias=True, exclude_unset=True, exclude_none=True) | own


@once
def hinges_of(stage: StageContent) -> tuple[tuple[Hinge, ...], ...]:
    """The nine hinges, 3 chains by 3 hinges, overrides applied."""
    changes = {override.place: override.changes for override in stage.override}
    rows = [[(getattr(stage.hinges, name), changes.get((chain, name))) for name in HINGE_NAMES] for chain in CHAINS]
    return tuple(tuple(hinge.model_copy(update=new) if new else hinge for hinge, new in row) for row in rows)


@once
def actuators_of(stage: StageContent) -> tuple[tuple[Actuator, ...], ...]:
    """The actuators of every chain, overrides applied."""
    own = {override.place: override for override in stage.override}
    rows = [[(each, own.get((chain, "actuator", each.name))) for each in stage.actuator] for chain in CHAINS]
    return tuple(tuple(Actuator.model_validate(_content(one, new)) if new else one for one, new in row) for row in rows)


def key_of_actuator(stage: StageContent, chain: int, index: int, key: str) -> str:
    """Key path in the stage file of a value of an actuator on a chain, an override's where there is one."""
    return _key(stage, (chain, "actuator", stage.actuator[index].name), ("actuator", index), key)


def key_of(stage: StageContent, chain: int, hinge: str, key: str) -> str:
    """Key path in the stage file that sets a hinge's value, an override's where there is one."""
    return _key(stage, (chain, hinge), ("hinges", hinge), key)


def _key(stage: StageContent, place: Place, table: KeyPath, key: str) -> str:
    for index, override in enumerate(stage.override):
        if override.place == place and key in override.model_dump(by_alias=True, exclude_none=True):
            table = ("override", index)
    return key_path((*table, key), stage)


def of_stage(stage: StageContent) -> dict[str, Any]:
    """What every answer says of its stage: which it is, and which of its numbers are in doubt."""
    assumptions = {"assumed": list(stage.assumed), "not_stated": list(stage.not_stated)}
    return {"file": str(stage.origin), "name": stage.name, **assumptions}


@contextmanager
def located(stage: StageContent) -> Iterator[None]:
    """Put file and line of a stage that has a file in front of refusals that begin with a key path of it."""
    try:
        yield
    except BadInput as refusal:
        if refusal.located or stage.origin.path is None:
            raise
        raise BadInput(str(refusal), _file_and_line(stage.origin, str(refusal))) from None


def _file_and_line(origin: Origin, refusal: str) -> str:
    if origin.path is None or origin.changed:
        return str(origin)
    try:
        file = read_toml(origin.path)
        key = re.match(r"(?:\.?\w+|\[\d+\])*", refusal)
        return place_of(origin.path, file.line(path_of(key[0] if key else "", file.data)))
    except BadInput:  # gone since
        return place_of(origin.path)
