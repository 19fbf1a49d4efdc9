"""What differs at one of the nine hinges, or at an actuator of one chain; every chain's actuators with that applied."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, ValidationError, model_validator

from flexfem.files.keypath import key_path
from flexfem.files.refusals import problem_of, refusal, suggestion
from flexfem.files.toml import Label
from flexfem.stage.actuators import Actuator, Coordinate, Force, Rate, Stroke, Tilt
from flexfem.stage.cache import once
from flexfem.stage.inside import Angle, Dimensioned, Length, Modulus
from flexfem.stage.tables import CHAINS, HINGE_NAMES, Hinge, HingeName

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage


class Override(Dimensioned):
    """What differs at one of the nine hinges, or at an actuator on one chain; None keeps the value of its table."""

    chain: int = Field(ge=1, le=3)
    hinge: HingeName | None = None
    actuator: Label | None = None
    radius: Length | None = Field(default=None, alias="radius_mm")
    neck: Length | None = Field(default=None, alias="neck_mm")
    prismatic: bool | None = None
    axis: Angle | None = Field(default=None, alias="axis_deg")
    arm: Length | None = Field(default=None, alias="arm_mm")
    side: Literal["left", "right"] | None = None
    tilt: Tilt | None = Field(default=None, alias="tilt_deg")
    point: tuple[Coordinate, Coordinate] | None = Field(default=None, alias="point_mm")
    direction: Angle | None = Field(default=None, alias="direction_deg")
    stack: Label | None = None
    stroke: Stroke | None = Field(default=None, alias="stroke_um")
    stiffness: Rate | None = Field(default=None, alias="stiffness_n_per_um")
    blocking_force: Force | None = Field(default=None, alias="blocking_force_n")
    contact_stiffness: Rate | None = Field(default=None, alias="contact_stiffness_n_per_um")
    ball_radius: Length | None = Field(default=None, alias="ball_radius_mm")
    ball_youngs_modulus: Modulus | None = Field(default=None, alias="ball_youngs_modulus_gpa")
    ball_poissons_ratio: float | None = Field(default=None, ge=0, lt=0.5)
    preload: float | None = Field(default=None, alias="preload_n", ge=0, le=1e6)
    friction: float | None = Field(default=None, ge=0, le=2)

    @model_validator(mode="after")
    def _of_one_thing(self) -> Override:
        if (self.hinge is None) == (self.actuator is None):
            raise refusal("the hinge or the actuator that it is about, one of the two")
        return self

    @model_validator(mode="after")
    def _changes_something(self) -> Override:
        known = [field.alias or name for name, field in type(self).model_fields.items() if name in self._possible]
        for name, field in type(self).model_fields.items():
            if getattr(self, name) is not None and name not in (*ABOUT_IT, *self._possible):
                thing = "a hinge" if self.actuator is None else "an actuator"
                raise refusal(f"with {thing} only {', '.join(known)}", field.alias or name)
        if not self.changes:
            raise refusal(f"at least one of {', '.join(known)}")
        return self

    @property
    def _possible(self) -> tuple[str, ...]:
        return OF_HINGES if self.actuator is None else OF_ACTUATORS

    @property
    def changes(self) -> dict[str, Any]:
        """The attributes of its `Hinge` or `Actuator` that are replaced, with their new values."""
        return {name: getattr(self, name) for name in self._possible if getattr(self, name) is not None}

    @property
    def place(self) -> tuple[int | str, ...]:
        """What it is about: chain and hinge, or chain, "actuator" and the actuator's name."""
        return (self.chain, str(self.hinge)) if self.actuator is None else (self.chain, "actuator", self.actuator)


ABOUT_IT = ("chain", "hinge", "actuator")
OF_HINGES = tuple(Hinge.model_fields)
OF_ACTUATORS = tuple(name for name in Override.model_fields if name not in (*ABOUT_IT, *OF_HINGES))


def check_overrides(stage: Stage) -> None:
    """Raise a refusal where two are about the same, or one makes an actuator that there is not or cannot be."""
    places = [override.place for override in stage.override]
    names = [actuator.name for actuator in stage.actuator]
    for index, override in enumerate(stage.override):
        if places[index] in places[:index]:
            raise refusal(f"each {'hinge' if override.hinge else 'actuator'} overridden once", "override", index)
        if override.actuator is not None:
            if override.actuator not in names:
                close = suggestion(override.actuator, names) or (f", one of {', '.join(names)}" if names else "")
                raise refusal(f"an actuator of this stage{close}", "override", index, "actuator")
            _check(stage.actuator[names.index(override.actuator)], override, index)


def _check(actuator: Actuator, override: Override, index: int) -> None:
    held = _content(actuator, override)
    try:
        Actuator.model_validate(held)
    except ValidationError as error:
        problem = problem_of(error.errors(include_url=False)[0], held)
        said = override.model_dump(by_alias=True, exclude_none=True)
        raise refusal(problem.expected, "override", index, *(part for part in problem.path if part in said)) from None


def _content(actuator: Actuator, override: Override) -> dict[str, Any]:
    """What a file would say of an overridden actuator."""
    own = override.model_dump(by_alias=True, exclude_none=True, exclude=set(ABOUT_IT))
    return actuator.model_dump(by_alias=True, exclude_unset=True, exclude_none=True) | own


@once
def hinges_of(stage: Stage) -> tuple[tuple[Hinge, ...], ...]:
    """The nine hinges, 3 chains by 3 hinges, overrides applied."""
    changes = {override.place: override.changes for override in stage.override}
    own = [(name, getattr(stage.hinges, name)) for name in HINGE_NAMES]
    return tuple(
        tuple(hinge.model_copy(update=changes[i, name]) if (i, name) in changes else hinge for name, hinge in own)
        for i in CHAINS
    )


@once
def actuators_of(stage: Stage) -> tuple[tuple[Actuator, ...], ...]:
    """The actuators of every chain, overrides applied."""
    own = {override.place: override for override in stage.override}
    return tuple(
        tuple(
            Actuator.model_validate(_content(each, own[place]))
            if (place := (chain, "actuator", each.name)) in own
            else each
            for each in stage.actuator
        )
        for chain in CHAINS
    )


def drive_content(stage: Stage) -> list[Any]:
    """What of the drive is part of a hash, of every chain, or of one where all are alike: no names.

    Friction that is not stated is left out, as in hashes older than that key.
    """
    chains = [
        [
            [one.model_dump(exclude={"name", "stack"} | ({"friction"} if one.friction is None else set())), one.rating]
            for one in chain
        ]
        for chain in actuators_of(stage)
    ]
    return chains[0] if all(chain == chains[0] for chain in chains) else chains


def key_of_actuator(stage: Stage, chain: int, index: int, key: str) -> str:
    """Key path in the stage file of a value of an actuator on a chain, an override's where there is one."""
    for place, override in enumerate(stage.override):
        mine = (chain, "actuator", stage.actuator[index].name)
        if override.place == mine and key in override.model_dump(by_alias=True, exclude_none=True):
            return key_path(("override", place, key), stage)
    return key_path(("actuator", index, key), stage)
