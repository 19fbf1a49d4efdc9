"""What differs at one of the nine hinges, or at an actuator of one chain; every chain's actuators with that applied."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from flexfem.files.json_schema import Rule, both, has, ruled, when, without
from flexfem.files.keypath import key_path
from flexfem.files.refusals import problem_of, refusal, suggestion
from flexfem.files.toml import Label
from flexfem.stage.actuators import Actuator, Coordinate, Force, Friction, Preload, Rate, StackName, Stroke, Tilt
from flexfem.stage.cache import once
from flexfem.stage.inside import Angle, Dimensioned, Length, Modulus, Poisson
from flexfem.stage.tables import CHAINS, HINGE_NAMES, Hinge, HingeName

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage


def _as_of(table: type[BaseModel], name: str) -> Any:
    """The key of a table, which an override need not give."""
    key = table.model_fields[name]
    return Field(default=None, alias=key.alias, description=key.description, examples=key.examples)


class Override(Dimensioned):
    """What differs at one of the nine hinges, or at an actuator on one chain; None keeps the value of its table."""

    model_config = ConfigDict(json_schema_extra=ruled(also=lambda schema: _about_one_thing(schema)))

    chain: int = Field(ge=1, le=3, description="The chain that it is about", examples=[2])
    hinge: HingeName | None = Field(default=None, description="The hinge of that chain that it is about")
    actuator: Label | None = Field(
        default=None, description="Instead of `hinge`: the name of the actuator that it is about", examples=["base"]
    )
    radius: Length | None = _as_of(Hinge, "radius")
    neck: Length | None = _as_of(Hinge, "neck")
    prismatic: bool | None = _as_of(Hinge, "prismatic")
    axis: Angle | None = _as_of(Hinge, "axis")
    arm: Length | None = _as_of(Actuator, "arm")
    side: Literal["left", "right"] | None = _as_of(Actuator, "side")
    tilt: Tilt | None = _as_of(Actuator, "tilt")
    point: tuple[Coordinate, Coordinate] | None = _as_of(Actuator, "point")
    direction: Angle | None = _as_of(Actuator, "direction")
    stack: StackName | None = _as_of(Actuator, "stack")
    stroke: Stroke | None = _as_of(Actuator, "stroke")
    stiffness: Rate | None = _as_of(Actuator, "stiffness")
    blocking_force: Force | None = _as_of(Actuator, "blocking_force")
    contact_stiffness: Rate | None = _as_of(Actuator, "contact_stiffness")
    ball_radius: Length | None = _as_of(Actuator, "ball_radius")
    ball_youngs_modulus: Modulus | None = _as_of(Actuator, "ball_youngs_modulus")
    ball_poissons_ratio: Poisson | None = _as_of(Actuator, "ball_poissons_ratio")
    preload: Preload | None = _as_of(Actuator, "preload")
    friction: Friction | None = _as_of(Actuator, "friction")

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


def _about_one_thing(schema: Rule) -> None:
    """A hinge or an actuator, with something that differs there and nothing of the other."""
    hinge, actuator = ([Override.model_fields[n].alias or n for n in of] for of in (OF_HINGES, OF_ACTUATORS))
    schema["allOf"] = [
        when(has("actuator"), without("hinge", *hinge), both(has("hinge"), without(*actuator))),
        {"minProperties": 3},
    ]


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
