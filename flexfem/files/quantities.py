"""Types of the numbers of files: their units and limits, also for the JSON schemas, and expressions
of parameters.

A value beyond a limit is a mistake of the unit or of typing, and would overflow or vanish in the
computation. Unusual values are inside; `questions.warnings` reports some of them. A number is in
inside units (mm, N, MPa, rad) where its type names a unit of files, else in the unit of its key.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import SerializationInfo, ValidationInfo, ValidatorFunctionWrapHandler
from pydantic_core import CoreSchema, core_schema

from flexfem.arrays import AnyArray, Array
from flexfem.files.expressions import Evaluated, Scaled, require_names, value_of
from flexfem.files.refusals import refusal
from flexfem.units import NONE, UNITS

UNIT = "x-unit"  # keyword of every number in a schema: its unit
COUNT = "1"  # unit of a dimensionless number
OF_THE_KEY = "of the key"  # unit of a number in the unit of another key
INSIDE = "inside units"  # context of a validation whose numbers are in mm, N, MPa and rad
STATED = "stated"  # context of a dump: expressions by their texts
KNOWN: ContextVar[Mapping[str, float] | None] = ContextVar(
    "parameters by name without unit", default=None
)


@dataclass(frozen=True)
class Limits:
    """Annotation of a number of a file: limits in the unit of the file, and the unit where it is
    converted.

    unit : key of `units.UNITS`, `COUNT` or `OF_THE_KEY`; "" for a number that keeps the unit of its
    key.
    gt, ge, le, lt : ends of the valid values.   least : smallest valid size but zero.
    said : end of the message of a size below `least`.   reason : of the limits `ge` and `le`, in
    the message.
    """

    unit: str = ""
    gt: float = -math.inf
    ge: float = -math.inf
    le: float = math.inf
    lt: float = math.inf
    least: float = 0.0
    whole: bool = False
    said: str = ""
    reason: str = ""

    @property
    def limits(self) -> tuple[tuple[Callable[[Any, Any], Any], str, str, float], ...]:
        """Comparison of each limit, its sign, its keyword in a schema, and its value."""
        return (
            (operator.gt, ">", "exclusiveMinimum", self.gt),
            (operator.ge, ">=", "minimum", self.ge),
            (operator.le, "<=", "maximum", self.le),
            (operator.lt, "<", "exclusiveMaximum", self.lt),
        )

    def expected(self, value: float) -> str | None:
        """Return what is expected of a number in the unit of the file, None of a valid one."""
        if not math.isfinite(value):
            return "a finite number"
        for holds, sign, _, limit in self.limits:
            if not holds(value, limit):
                return (
                    f"{self.ge:g} to {self.le:g}: {self.reason}"
                    if self.reason
                    else f"{sign} {limit:g}"
                )
        if 0 < abs(value) < self.least:
            zero = "" if self.gt == 0 else "0, or "
            return f"{zero}at least {self.least:g}{self.said}: smaller values are a unit mistake"
        return "a whole number" if self.whole and value != round(value) else None

    def refuses(self, values: Array) -> AnyArray:
        """Return which values (...), in the unit of the file, are not valid."""
        valid = [holds(values, limit) for holds, _, _, limit in self.limits]
        too_small = (np.abs(values) < self.least) & (values != 0)
        broken = self.whole & (values != np.round(values))
        return np.asarray(~np.all(valid, axis=0) | too_small | broken)

    @property
    def factor(self) -> float:
        """Inside units per unit of the file, 1 where the number is not converted."""
        return 1 / UNITS.get(self.unit, NONE).factor

    def inside(self, value: float) -> float:
        """Return a number of a file in inside units."""
        return self.factor * value

    def in_file(self, value: float) -> float:
        """Return the number of a file that converts to `value`: the shortest exact one, otherwise
        the nearest.
        """
        near = [value / self.factor]
        for _ in range(3):
            near = [math.nextafter(near[0], -math.inf), *near, math.nextafter(near[-1], math.inf)]
        return min(near, key=lambda number: (abs(self.inside(number) - value), len(repr(number))))

    def __get_pydantic_core_schema__(
        self, source: Any, handler: Callable[[Any], CoreSchema]
    ) -> CoreSchema:
        dumped = core_schema.plain_serializer_function_ser_schema(self._dumped, info_arg=True)
        return core_schema.with_info_wrap_validator_function(
            self._validated, handler(source), serialization=dumped
        )

    def _validated(
        self, value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> float:
        """Return a number in inside units.

        Where there are parameters, it may be the value of an expression.
        """
        known = KNOWN.get()
        text = value.text if isinstance(value, Evaluated) else value
        if known is not None and isinstance(text, str):
            require_names(text, known)
            text = text.product if isinstance(text, Scaled) else text
            number = float(value_of(text, known))
            expected = self.expected(number)
            if expected is not None:
                raise refusal(f"{expected}; its value is {number:g}")
            return Evaluated(self.inside(number), text, self)
        if info.context == INSIDE and type(value) in (int, float) and abs(value) < 1e300:
            value = self.in_file(float(value))
        number = handler(value)
        expected = self.expected(number)
        if expected is not None:
            raise refusal(expected)
        return self.inside(number)

    def _dumped(
        self,
        value: float,
        info: SerializationInfo,
    ) -> float | str:
        if isinstance(value, Evaluated) and (info.by_alias or info.context == STATED):
            return value.text
        return self.in_file(value) if info.by_alias else value

    def __get_pydantic_json_schema__(
        self, core: Any, handler: Callable[[Any], dict[str, Any]]
    ) -> dict[str, Any]:
        found = handler(core) | {
            word: limit for _, _, word, limit in self.limits if math.isfinite(limit)
        }
        if self.least and self.gt == 0:
            del found["exclusiveMinimum"]
            found["minimum"] = self.least
        elif self.least:
            below = [{"maximum": -self.least}] if self.ge < 0 else []
            found["anyOf"] = [{"const": 0}, {"minimum": self.least}, *below]
        if self.whole:
            found["multipleOf"] = 1
        return found | ({UNIT: self.unit} if self.unit in (COUNT, OF_THE_KEY) else {})


def positive(
    least: float,
    most: float,
    unit: str = "",
) -> Limits:
    """Return the annotation of a positive number."""
    return Limits(
        unit,
        gt=0,
        le=most,
        least=least,
    )


def from_zero(
    least: float,
    most: float,
    unit: str = "",
) -> Limits:
    """Return the annotation of a number that is positive or zero."""
    return Limits(
        unit,
        ge=0,
        le=most,
        least=least,
    )


def either_sign(
    least: float,
    most: float,
    unit: str = "",
) -> Limits:
    """Return the annotation of a number of either sign, or zero."""
    return Limits(
        unit,
        ge=-most,
        le=most,
        least=least,
    )


LONGEST = 1e4  # mm; largest coordinate
OF_ANY_KEY = 1e-12, 1e12, OF_THE_KEY  # contains the ranges of all keys
_ALUMINIUM = " um/(m K), aluminium 23.6"  # states the unit, which is easily taken for 1/K

Length: TypeAlias = Annotated[float, positive(1e-6, LONGEST)]  # mm: 1 nm to 10 m
LengthOrZero: TypeAlias = Annotated[float, from_zero(1e-6, LONGEST)]
Coordinate: TypeAlias = Annotated[float, Limits(ge=-LONGEST, le=LONGEST)]  # mm
Angle: TypeAlias = Annotated[float, Limits("deg", ge=-360, le=360)]
Turn: TypeAlias = Annotated[float, Limits("deg", ge=-3600, le=3600)]
Tilt: TypeAlias = Annotated[float, Limits("deg", ge=-80, le=80)]
Modulus: TypeAlias = Annotated[float, positive(1e-3, 2000, "gpa")]  # rubber, and twice diamond
Poisson: TypeAlias = Annotated[float, Limits(COUNT, ge=0, lt=0.5)]
Strength: TypeAlias = Annotated[float, positive(1e-3, 1e5)]  # MPa: gels to graphene
ResidualStress: TypeAlias = Annotated[float, either_sign(1e-4, 1e4)]  # MPa: films
Density: TypeAlias = Annotated[float, positive(0.1, 1e5)]  # kg/m^3: aerogels, and four times osmium
Expansion: TypeAlias = Annotated[  # glass ceramics and polymers
    float,
    Limits(
        "um_per_m_k",
        ge=0,
        le=300,
        least=0.01,
        said=_ALUMINIUM,
    ),
]
FrameExpansion: TypeAlias = Annotated[  # zero-expansion glass as measured; alloys
    float,
    Limits(
        "um_per_m_k",
        ge=-50,
        le=300,
        least=1e-3,
        said=_ALUMINIUM,
    ),
]
Walker: TypeAlias = Annotated[float, positive(0.01, 1, COUNT)]
Cycles: TypeAlias = Annotated[
    float, positive(0.1, 1e12, COUNT)
]  # a quarter of a cycle; a thousand years at 30 Hz
Stroke: TypeAlias = Annotated[float, positive(1e-3, 1e4, "um")]
Rate: TypeAlias = Annotated[float, positive(1e-6, 1e6, "n_per_um")]  # stiffness of stacks
Force: TypeAlias = Annotated[float, positive(1e-6, 1e6)]  # N
ForceOrZero: TypeAlias = Annotated[float, from_zero(1e-6, 1e6)]
Friction: TypeAlias = Annotated[float, Limits(COUNT, ge=0, le=2)]
Grams: TypeAlias = Annotated[float, from_zero(1e-9, 1e7, "g")]
Inertia: TypeAlias = Annotated[float, from_zero(1e-12, 1e10, "kg_mm2")]
Spring: TypeAlias = Annotated[float, positive(1e-6, 1e9)]  # N/mm
Torsion: TypeAlias = Annotated[float, positive(1e-3, 1e12)]  # N mm/rad
Reading: TypeAlias = Annotated[float, from_zero(1e-9, 1e3, "um")]  # far below any sensor
ForceReading: TypeAlias = Annotated[float, from_zero(1e-9, 1e3)]  # N
Neck: TypeAlias = Annotated[float, positive(1e-3, 1e7, "um")]
NeckDeviation: TypeAlias = Annotated[float, from_zero(1e-3, 1e7, "um")]
CommandUm: TypeAlias = Annotated[
    float, positive(1e-9, 1e6)
]  # um: from far below an atom to the largest stage
CommandMrad: TypeAlias = Annotated[float, positive(1e-9, 1e3)]
Amplitude: TypeAlias = Annotated[float, either_sign(1e-6, 1e5)]  # um, mrad, of a life
Kilograms: TypeAlias = Annotated[
    float, from_zero(1e-12, 1e4)
]  # no stage of necks carries a hundredth of it
KilogramsMm2: TypeAlias = Annotated[float, from_zero(1e-12, 1e10)]
Seconds: TypeAlias = Annotated[float, positive(1e-3, 86_400)]
Scatter: TypeAlias = Annotated[float, positive(1e-6, 1000)]  # um
Percent: TypeAlias = Annotated[float, positive(1e-6, 100)]
AnyNumber: TypeAlias = Annotated[float, either_sign(*OF_ANY_KEY)]
AnyPositive: TypeAlias = Annotated[float, positive(*OF_ANY_KEY)]
Unlimited: TypeAlias = Annotated[float, Limits(OF_THE_KEY)]
Count: TypeAlias = Annotated[
    float,
    Limits(
        COUNT,
        ge=2,
        le=1000,
        whole=True,
    ),
]
STEEPEST = -0.5
FLATTEST = -0.01  # limits of Basquin's exponent; metals have -0.05 to -0.15
Exponent: TypeAlias = Annotated[
    float,
    Limits(
        COUNT,
        ge=STEEPEST,
        le=FLATTEST,
        reason="stress falls with the number of cycles",
    ),
]
