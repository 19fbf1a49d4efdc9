"""Plausible ranges of the values of keys by quantity, also for the JSON schemas.

A value outside is a mistake of the unit or of typing, and would overflow or vanish in the computation. Unusual values
are inside; `questions.warnings` reports some of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from pydantic import AfterValidator, Field

from flexfem.files.refusals import refusal

UNIT = "x-unit"  # keyword of every number: its unit
COUNT: dict[str, Any] = {UNIT: "1"}  # of a dimensionless number
OF_THE_KEY: dict[str, Any] = {UNIT: "of the key"}  # of a number in the unit of another key


class Keywords(NamedTuple):
    """Annotation of a type: additional keywords of its JSON schema, computed when the schema is made."""

    found: Callable[[], dict[str, Any]]

    def __get_pydantic_json_schema__(self, core: Any, handler: Callable[[Any], Any]) -> dict[str, Any]:
        return {**handler(core), **self.found()}


def keywords(**given: Any) -> Keywords:
    """Return fixed keywords."""
    return Keywords(lambda: given)


class Ends(NamedTuple):
    """Smallest nonzero size and largest size, in the unit of the file."""

    least: float
    most: float


LENGTH = Ends(1e-6, 1e4)  # mm: 1 nm to 10 m
NECK = Ends(1e-3, 1e7)  # um: the same lengths
MODULUS = Ends(1e-3, 2000)  # GPa: rubber, and twice diamond
STRENGTH = Ends(1e-3, 1e5)  # MPa: gels to graphene
DENSITY = Ends(0.1, 1e5)  # kg/m^3: aerogels, and four times osmium
WALKER = Ends(0.01, 1)
CYCLES = Ends(0.1, 1e12)  # less than the quarter of a cycle that breaks a specimen; a thousand years at 30 Hz
STROKE = Ends(1e-3, 1e4)  # um
FORCE = Ends(1e-6, 1e6)  # N
STACK_STIFFNESS = Ends(1e-6, 1e6)  # N/um
SPRING = Ends(1e-6, 1e9)  # N/mm
TORSION = Ends(1e-3, 1e12)  # N mm/rad
COMMAND_UM, COMMAND_MRAD = Ends(1e-9, 1e6), Ends(1e-9, 1e3)  # from far below an atom to the largest stage
AMPLITUDE = Ends(1e-6, 1e5)  # um, mrad, of a life
READING = Ends(1e-9, 1e3)  # um, N: far below any sensor
TOLERANCE = Ends(1e-6, 1000)  # um
MASS, INERTIA = Ends(1e-12, 1e4), Ends(1e-12, 1e10)  # kg, kg mm^2: no stage of necks carries a hundredth of it
GRAMS = Ends(1e-9, 1e7)
PER_CENT = Ends(1e-6, 100)
TIME = Ends(1e-3, 86_400)  # s
OF_ANY_KEY = Ends(1e-12, 1e12)  # in the unit of the key; contains the ranges of all keys


def above_zero(ends: Ends) -> tuple[Any, ...]:
    """Return annotations of a positive number that reject an implausibly small one."""

    def checked(value: float) -> float:
        if value < ends.least:
            raise refusal(f"at least {ends.least:g}: smaller values are a unit mistake")
        return value

    return Field(gt=0, le=ends.most), AfterValidator(checked), keywords(minimum=ends.least)


def from_zero(ends: Ends) -> tuple[Any, ...]:
    """Return annotations of a number that is positive or zero."""
    return Field(ge=0, le=ends.most), *zero_or(ends.least)


def either_sign(ends: Ends) -> tuple[Any, ...]:
    """Return annotations of a number of either sign, or zero."""
    return Field(ge=-ends.most, le=ends.most), *zero_or(ends.least, signed=True)


def zero_or(least: float, signed: bool = False, unit: str = "") -> tuple[AfterValidator, Keywords]:
    """Return annotations of a number that is zero or at least `least` in size; `unit` ends the error message."""

    def checked(value: float) -> float:
        if 0 < abs(value) < least:
            raise refusal(f"0, or at least {least:g}{unit}: smaller values are a unit mistake")
        return value

    possible: list[dict[str, float]] = [{"const": 0}, {"minimum": least}]
    return AfterValidator(checked), keywords(anyOf=possible + ([{"maximum": -least}] if signed else []))
