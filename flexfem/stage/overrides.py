"""What differs at one of the nine hinges, or at an actuator of one chain."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from flexfem.files.json_schema import Rule, both, has, ruled, when, without
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label
from flexfem.stage.actuators import Actuator, Coordinate, Friction, Preload, Tilt
from flexfem.stage.inside import Angle, Dimensioned, Length, Modulus, Poisson
from flexfem.stage.stacks import Force, Rate, StackName, Stroke
from flexfem.stage.tables import Hinge, HingeName


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
