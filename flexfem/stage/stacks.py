"""Piezo stacks: their numbers, their stiffness in series with a contact, and the shipped catalogue."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from flexfem.arrays import AnyArray, Array
from flexfem.files import quantities
from flexfem.files.json_schema import Keywords
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label, Table, validate
from flexfem.stage.inside import Dimensioned, converted

CATALOGUE = Path(__file__).parents[1] / "data" / "stacks.toml"
STEEL = (206e3, 0.3)  # bearing steel, MPa and Poisson's ratio: of balls and of ends of stacks if no file states it

Stroke: TypeAlias = Annotated[
    float, *quantities.above_zero(quantities.STROKE), *converted(lambda um: 1e-3 * um, lambda mm: mm / 1e-3)
]
Rate: TypeAlias = Annotated[
    float,
    *quantities.above_zero(quantities.STACK_STIFFNESS),
    *converted(lambda n_um: 1e3 * n_um, lambda n_mm: n_mm / 1e3),
]
Force: TypeAlias = Annotated[float, *quantities.above_zero(quantities.FORCE)]
Voltage: TypeAlias = Annotated[float, *quantities.above_zero(quantities.VOLTAGE)]
StackName: TypeAlias = Annotated[Label, Keywords(lambda: {"enum": list(catalogue())})]


class StackRating(NamedTuple):
    """A stack at its highest voltage: free stroke, mm, stiffness, N/mm, and blocking force, N, their product."""

    stroke: float
    stiffness: float
    blocking_force: float


class Numbers(NamedTuple):
    """The numbers of actuators (...), inside units, as in `Actuator`; nan where nothing is said; x, y of its point."""

    arm: AnyArray
    tilt: AnyArray
    x: AnyArray
    y: AnyArray
    direction: AnyArray
    stroke: AnyArray
    stiffness: AnyArray
    blocking_force: AnyArray
    contact_stiffness: AnyArray
    ball_radius: AnyArray
    ball_youngs_modulus: AnyArray
    ball_poissons_ratio: AnyArray
    preload: AnyArray


GEOMETRY = Numbers._fields[:5]  # where the contact is


def series_stiffness(of: Numbers, stack: ArrayLike, E: ArrayLike, nu: ArrayLike, loose: ArrayLike = False) -> Array:
    """Stiffness (...), N/mm, of stacks of stiffness `stack` (...) and their contacts in series, on a metal (E, nu).

    loose : (...), bool, balls that dent a steel end of the stack as well.
    """
    given = np.where(np.isnan(of.contact_stiffness), np.inf, of.contact_stiffness)
    ball = tuple(
        np.where(np.isnan(own), steel, own)
        for own, steel in zip((of.ball_youngs_modulus, of.ball_poissons_ratio), STEEL, strict=True)
    )
    contact = np.where(np.isnan(of.ball_radius), given, hertz(of.ball_radius, of.preload, ball, (E, nu)))
    behind = np.where(loose, 1 / hertz(of.ball_radius, of.preload, ball, STEEL), 0.0)
    return np.asarray(1 / (1 / np.asarray(stack) + 1 / contact + behind))


def hertz(radius: ArrayLike, force: ArrayLike, ball: tuple[Any, ...], flat: tuple[Any, ...]) -> Array:
    """Stiffness (...), N/mm, of a ball (E, nu) of `radius` mm pressed on a flat (E, nu) by `force` N.

    Notes
    -----
    The approach is `(9 F^2 / (16 R E*^2))^(1/3)`, its slope `(6 R E*^2 F)^(1/3)`, with
    `1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2`: K. L. Johnson, Contact Mechanics, 1985, (4.23).
    """
    modulus = 1 / sum((1 - nu**2) / E for E, nu in (ball, flat))
    return np.asarray((6 * np.asarray(radius) * modulus**2 * np.asarray(force)) ** (1 / 3))


class CataloguedStack(Dimensioned):
    """A stack of the shipped catalogue: stroke in mm, force in N, at its highest voltage, with their source."""

    name: Label = Field(description="By which stage files name it", examples=["AE0505D16"])
    maker: Label = Field(description="Who makes it", examples=["NEC/Tokin"])
    voltage: Voltage = Field(alias="voltage_v", description="The highest", examples=[150.0])
    stroke: Stroke = Field(alias="stroke_um", description="Free stroke at that voltage", examples=[17.4])
    tolerance: Stroke = Field(alias="tolerance_um", description="Of the stroke, less than it", examples=[2.0])
    blocking_force: Force = Field(alias="blocking_force_n", description="At that voltage", examples=[935.0])
    source: Label = Field(description="Where the numbers come from", examples=["data sheet of the maker"])

    @model_validator(mode="after")
    def _plausible(self) -> CataloguedStack:
        if not self.tolerance < self.stroke:
            raise refusal("less than the stroke", "tolerance_um")
        if not 1 <= self.blocking_force / self.stroke / 1e3 <= 5000:
            raise refusal("1 to 5000 N/um with the stroke, as stacks have", "blocking_force_n")
        return self


class Catalogue(Table):
    """The file of all stacks that are known by name."""

    stack: tuple[CataloguedStack, ...] = Field(description="A stack, as many as wanted")


@cache
def catalogue() -> dict[str, CataloguedStack]:
    """The shipped stacks by name. Raises BadInput for a number out of range."""
    return {stack.name: stack for stack in validate(Catalogue, CATALOGUE).stack}
