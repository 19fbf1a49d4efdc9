"""Actuators with the rating of a stack, and the shipped catalogue of stacks."""

from __future__ import annotations

import tomllib
from functools import cache
from typing import Annotated, NamedTuple, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from flexfem.files import quantities
from flexfem.files.refusals import nearest, refusal
from flexfem.files.tables import Keywords, Label, Table, one_form
from flexfem.sources import read_data


def _of_catalogue(name: str) -> str:
    if name not in catalogue():
        raise refusal(f"a stack of the catalogue{nearest(name, catalogue())}")
    return name


StackName: TypeAlias = Annotated[
    Label, AfterValidator(_of_catalogue), Keywords(lambda: {"enum": list(catalogue())})
]


class StackRating(NamedTuple):
    """Rating of a stack at its highest voltage: free stroke, mm, stiffness, N/mm, and blocking
    force, N.
    """

    stroke: float
    stiffness: float
    blocking_force: float


class CataloguedStack(Table):
    """A stack of the shipped catalogue: stroke, its tolerance, mm, and blocking force, N, at the
    highest voltage, V; overall length, mm.
    """

    name: str
    maker: str
    voltage: float = Field(alias="voltage_v")
    stroke: quantities.Stroke = Field(alias="stroke_um")
    tolerance: quantities.Stroke = Field(alias="tolerance_um")
    blocking_force: quantities.Force = Field(alias="blocking_force_n")
    length: quantities.Length = Field(alias="length_mm")
    source: str


@cache
def catalogue() -> dict[str, CataloguedStack]:
    """Return the shipped stacks by name."""
    stacks = map(CataloguedStack.model_validate, tomllib.loads(read_data("stacks.toml"))["stack"])
    return {stack.name: stack for stack in stacks}


BLOCKING_ROUND_OFF = 1e-12  # relative; a blocking force may be the product of stroke and stiffness


class RatedActuator(Table):
    """A named actuator with the rating of its stack, of the catalogue or in numbers; mm, N."""

    name: Label = Field(examples=["drive"])
    """Unique name of the actuator, used in key paths such as `actuator.drive.stroke_um`"""
    stack: StackName | None = Field(default=None, examples=["AE0505D16"])
    """Name of a stack of the catalogue"""
    stroke: quantities.Stroke | None = Field(
        default=None,
        alias="stroke_um",
        examples=[17.4],
    )
    """Free stroke, of a stack at its highest voltage; instead of `stack`, with `stiffness_n_per_um`
    or `blocking_force_n` """
    stiffness: quantities.Rate | None = Field(
        default=None, alias="stiffness_n_per_um", examples=[53.7]
    )
    """Stiffness of the actuator: blocking force over stroke"""
    blocking_force: quantities.Force | None = Field(
        default=None, alias="blocking_force_n", examples=[935.0]
    )
    """Blocking force of the actuator at its full stroke"""

    @model_validator(mode="after")
    def _rating_is_stated(self) -> Self:
        one_form(self, ("stack",), ("stroke", "stiffness"), ("stroke", "blocking_force"))
        return self

    @property
    def rating(self) -> StackRating:
        """Free stroke, stiffness and blocking force."""
        source = self if self.stack is None else catalogue()[self.stack]
        stroke = source.stroke or np.nan
        force = source.blocking_force or np.nan
        stiffness = self.stiffness
        if stiffness is None:
            return StackRating(stroke, force / stroke, force)
        return StackRating(stroke, stiffness, stroke * stiffness)
