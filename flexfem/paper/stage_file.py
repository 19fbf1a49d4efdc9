"""Validated content of a stage file in N-mm-MPa-rad: tables, overrides, and their location in the
file.

File keys end in their unit; attributes carry none and are in inside units (degrees of the file
become radians)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias, TypeVar

from pydantic import Field, ValidationError, create_model, model_validator
from pydantic.fields import FieldInfo

from flexfem.files.quantities import Angle, Length
from flexfem.files.refusals import KeyPath, key_path, nearest, problems_of, refusal, shown
from flexfem.files.tables import Label, Table, memoized, plain
from flexfem.mechanism.actuators import RatedActuator
from flexfem.mechanism.content import merged_tables
from flexfem.mechanism.materials import Frame, Material
from flexfem.mechanism.mechanism import Mechanism
from flexfem.paper.actuators import HINGE_NAMES as HINGE_NAMES
from flexfem.paper.actuators import Actuator
from flexfem.paper.actuators import HingeName as HingeName
from flexfem.refused import BadInput

Plane: TypeAlias = Literal["plane_stress", "plane_strain", "corrected"]
CHAINS = (1, 2, 3)


class Chain(Table):
    """Chain 1; the others are rotated by 120 and 240 degrees. Lengths in mm, relative angles as in
    (19) in rad.
    """

    link_lengths: tuple[Length, Length, Length] = Field(
        alias="link_lengths_mm", examples=[[30.0, 32.0, 24.0]]
    )
    """l1 from base to elbow hinge, l2 from elbow to platform hinge, l3 from platform hinge to
    platform centre
    """
    joint_angles: tuple[Angle, Angle, Angle] = Field(
        alias="joint_angles_deg", examples=[[180.0, -90.0, 90.0]]
    )
    """phi_1, phi_2, phi_3 at rest, counter-clockwise: phi_1 relative to the x axis, the others to
    the previous link
    """
    link_width: Length = Field(alias="link_width_mm", examples=[9.0])
    """Width of links, clamped pads and lugs of the platform"""


class Hinge(Table):
    """A circular hinge: cutting `radius` and `neck` in mm; `axis` in rad, None for along the link."""

    radius: Length = Field(alias="radius_mm", examples=[4.0])
    """Radius R of the two circular cuts"""
    neck: Length = Field(alias="neck_mm", examples=[0.5])
    """Width t of the neck, the narrowest section between the two cuts"""
    prismatic: bool = False
    """Whether the analytic model includes the axial compliance of the hinge besides its rotational
    compliance
    """
    axis: Angle | None = Field(
        default=None,
        alias="axis_deg",
        examples=[180.0],
    )
    """Direction of the neck in the frame of chain 1, rotated with each chain; by default along link
    1 for the base and elbow hinges, along link 2 for the platform hinge """


class Hinges(Table):
    """The three hinges of every chain, before overrides."""

    base: Hinge
    """Hinge between the clamped pad and link 1"""
    elbow: Hinge
    """Hinge between link 1 and link 2"""
    platform: Hinge
    """Hinge between link 2 and the platform"""


class Platform(Table):
    """The platform disc and its rigid hub, where the load acts and the pose is read; radii in mm."""

    radius: Length = Field(alias="radius_mm", examples=[17.0])
    """Radius of the disc"""
    hub_radius: Length = Field(alias="hub_radius_mm", examples=[8.0])
    """Radius of the hole in the disc, modelled as a rigid hub on which loads act and of which the
    pose is read
    """


OF_HINGES = tuple(Hinge.model_fields)  # attributes that changes may name without the table
Place: TypeAlias = tuple[int | str, ...]
Overridden = TypeVar("Overridden", bound=Table)


def place_of_override(override: Mapping[str, Any]) -> Place:
    """Return the target of an override: chain and hinge, or chain, "actuator" and the name of the
    actuator.
    """
    if override.get("actuator") is not None:
        return override["chain"], "actuator", override["actuator"]
    return override["chain"], override["hinge"]


def of_drive(key: str) -> bool:
    """Return whether a key path of a stage file, or of its provenance, belongs to the drive."""
    return (
        re.match(r"actuator|override\.\d\.actuator", key.removeprefix("provenance.").lstrip('"'))
        is not None
    )


def of_heat(key: str) -> bool:
    """Return whether a key path of a stage file, or of its provenance, belongs to thermal
    expansion.
    """
    return (
        re.match(r"frame|material\.expansion", key.removeprefix("provenance.").lstrip('"'))
        is not None
    )


class _Target(Table):
    """The target of an override."""

    described_by: ClassVar = (Hinge, RatedActuator, Actuator)

    chain: int = Field(
        ge=1,
        le=3,
        examples=[2],
    )
    """Chain of the overridden hinge or actuator"""
    hinge: HingeName | None = None
    """Overridden hinge of the chain"""
    actuator: Label | None = Field(default=None, examples=["base"])
    """Instead of `hinge`: name of the overridden actuator"""

    @model_validator(mode="after")
    def _has_one_target(self) -> Self:
        if (self.hinge is None) == (self.actuator is None):
            raise refusal("either a hinge or an actuator")
        about, possible = (
            ("a hinge", OF_HINGES) if self.actuator is None else ("an actuator", OF_ACTUATORS)
        )
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
        """Overridden attributes of the `Hinge` or `Actuator` with their new values."""
        return {
            name: value for name, value in self if value is not None and name not in TARGET_FIELDS
        }

    @property
    def place(self) -> Place:
        """Target of the override, as in `place_of_override`."""
        return place_of_override(vars(self))


TARGET_FIELDS = tuple(_Target.model_fields)
NOT_OVERRIDDEN = ("name", "between", "hinge", "pair", "ball_loose")
OF_ACTUATORS = tuple(name for name in Actuator.model_fields if name not in NOT_OVERRIDDEN)


def _optional(field: FieldInfo) -> Any:
    """Return a field of a table as an optional field of an override."""
    kind: Any = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return kind | None, Field(
        default=None,
        alias=field.alias,
        examples=field.examples,
    )


_FIELDS = {name: _optional(Hinge.model_fields[name]) for name in OF_HINGES}
_FIELDS |= {name: _optional(Actuator.model_fields[name]) for name in OF_ACTUATORS}
if TYPE_CHECKING:
    Override = _Target
else:
    Override = create_model(
        "Override",
        __base__=_Target,
        __module__=__name__,
        __doc__=(
            "Changed values of one of the nine hinges, or of an actuator on one chain; None "
            "keeps a value."
        ),
        **_FIELDS,
    )


class StageContent(Mechanism):
    """The content of a stage file, from which `Stage` derives further properties."""

    kind: ClassVar[str] = "stage file"

    name: Label = Field(examples=["my stage"])
    """Name of the stage in tables and figures"""
    model: Plane = "plane_stress"
    """Plane model of the stage: `plane_stress`, as in the paper; `plane_strain`; or `corrected`:
    plane stress with hinge compliances and neck stresses corrected for their thickness by
    three-dimensional finite elements, in the analytic model only, because the finite elements of
    the stage are plane """
    thickness: Length = Field(alias="thickness_mm", examples=[10.0])
    """Out-of-plane thickness b"""
    material: Material
    """Material of the stage, isotropic"""
    chain: Chain
    """Chain 1; the others are the same, rotated by 120 and 240 degrees"""
    hinges: Hinges
    """Hinges of every chain, from the base to the platform"""
    platform: Platform
    """Disc whose pose is controlled"""
    frame: Frame = Field(default_factory=Frame)
    """Frame to which the pads are clamped. Only thermal drift uses it: `flexfem drift`, and studies
    with `[drift]`
    """
    override: tuple[Override, ...] = ()
    """Changed values of a single one of the nine hinges, or of an actuator on one chain: its place,
    and keys of that hinge or actuator with their values. Any number of overrides in any order, at
    most one for each hinge or actuator """
    actuator: tuple[Actuator, ...] = ()
    """A piezo stack, or a pair of stacks, at the same position on every chain; any number of them.
    Only results of the driven stage depend on them, not those of the passive stage """

    @model_validator(mode="after")
    def _check_overrides(self) -> Self:
        places = [override.place for override in self.override]
        actuators = {actuator.name: actuator for actuator in self.actuator}
        for index, override in enumerate(self.override):
            if places[index] in places[:index]:
                raise refusal(
                    f"one override for each {'hinge' if override.hinge else 'actuator'}",
                    "override",
                    index,
                )
            if override.actuator is None:
                continue
            if override.actuator not in actuators:
                expected = f"an actuator of this stage{nearest(override.actuator, actuators)}"
                raise refusal(expected, "override", index, "actuator")
            stated = override.model_dump(
                by_alias=True,
                exclude_none=True,
                exclude={*TARGET_FIELDS},
            )
            content = (
                actuators[override.actuator].model_dump(by_alias=True, exclude_none=True) | stated
            )
            try:
                Actuator.model_validate(content)
            except ValidationError as error:
                problem = problems_of(error, content)[0]
                at = [part for part in problem.path if part in stated]
                raise refusal(problem.expected, "override", index, *at) from None
        return self

    def merged(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stated content with changes, also of `OF_HINGES`, for all hinges or by name.
        Raises BadInput.
        """
        given = plain(changes, tables=True)
        for attribute in [name for name in OF_HINGES if name in given]:
            value = given.pop(attribute)
            by_hinge = value if isinstance(value, dict) else dict.fromkeys(HINGE_NAMES, value)
            hinges = {name: {attribute: number} for name, number in by_hinge.items()}
            given["hinges"] = merged_tables(hinges, given.get("hinges", {}))
        return super().merged(given)

    def _members_changed(
        self,
        array: str,
        members: list[Any],
        changes: dict[Any, Any],
    ) -> Any:
        """Return the overrides changed by their places."""
        if array != "override":
            return super()._members_changed(array, members, changes)
        merged = {place_of_override(override): override for override in members}
        for place, values in changes.items():
            about = tuple(plain(place)) if isinstance(place, tuple) else (None, place)
            match about:
                case (int(chain), str(hinge)) if chain in CHAINS and hinge in HINGE_NAMES:
                    target: dict[str, Any] = {"chain": chain, "hinge": hinge}
                case (int(chain), "actuator", str(name)) if chain in CHAINS:
                    target = {"chain": chain, "actuator": name}
                case _:
                    names = ", ".join(HINGE_NAMES)
                    expected = f'(1, 2 or 3, one of {names}) or (1, 2 or 3, "actuator", its name)'
                    raise BadInput(f"override: no hinge {shown(str(place))}, expected {expected}")
            if not isinstance(values, Mapping):
                keys = f", any of {', '.join(OF_HINGES)}" if "hinge" in target else ""
                raise BadInput(
                    f"{key_path(('override', *map(str, about)))} = {shown(values)}, expected a "
                    f"table{keys}"
                )
            merged[about] = merged.get(about, target) | dict(values)
        return list(merged.values())

    def hinge(
        self,
        chain: int,
        name: str,
    ) -> Hinge:
        """Return a hinge of chain 1, 2 or 3 with its override applied; ValueError when there is no
        such hinge.
        """
        if chain not in CHAINS or name not in HINGE_NAMES:
            raise ValueError(
                f"no hinge {name!r} in chain {chain}: chains are {CHAINS}, hinges {HINGE_NAMES}"
            )
        return hinges_of(self)[chain - 1][HINGE_NAMES.index(name)]


def _overridden(stage: StageContent, table: Overridden, *place: int | str) -> Overridden:
    """Return the table of a hinge or actuator with its override applied."""
    changes = next(
        (override.changes for override in stage.override if override.place == place), None
    )
    return table.model_copy(update=changes) if changes else table


@memoized
def hinges_of(stage: StageContent) -> tuple[tuple[Hinge, ...], ...]:
    """Return the nine hinges, 3 chains by 3 hinges, overrides applied."""
    named = [(name, getattr(stage.hinges, name)) for name in HINGE_NAMES]
    return tuple(
        tuple(_overridden(stage, hinge, chain, name) for name, hinge in named) for chain in CHAINS
    )


@memoized
def actuators_of(stage: StageContent) -> tuple[tuple[Actuator, ...], ...]:
    """Return the actuators of every chain, overrides applied."""
    return tuple(
        tuple(_overridden(stage, a, chain, "actuator", a.name) for a in stage.actuator)
        for chain in CHAINS
    )


def key_of_actuator(
    stage: StageContent,
    chain: int,
    index: int,
    key: str,
) -> str:
    """Key path in the stage file of a value of an actuator on a chain, in its override where there
    is one.
    """
    return _key(stage, (chain, "actuator", stage.actuator[index].name), ("actuator", index), key)


def key_of(
    stage: StageContent,
    chain: int,
    hinge: str,
    key: str,
) -> str:
    """Key path in the stage file of a value of a hinge, in its override where there is one."""
    return _key(stage, (chain, hinge), ("hinges", hinge), key)


def _key(
    stage: StageContent,
    place: Place,
    table: KeyPath,
    key: str,
) -> str:
    for index, override in enumerate(stage.override):
        if override.place == place and key in override.model_dump(by_alias=True, exclude_none=True):
            table = ("override", index)
    return key_path((*table, key), stage)
