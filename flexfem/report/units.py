"""Numbers as people read them: SI prefixes, significant digits, powers of ten, round factors."""

from __future__ import annotations

import math
from typing import NamedTuple

from flexfem.verify.case import Direction

PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: ""}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ROUND_DOWN = 1e-9  # a thousandth less round-off takes the next smaller prefix no more than 1.0000 does
SPACE = "\N{NO-BREAK SPACE}"


class Unit(NamedTuple):
    """A unit for display: a stored number (mm or rad) times `factor` is the number in the unit `name`."""

    factor: float
    name: str


def unit_for(freedom: Direction, largest: float) -> Unit:
    """The prefixed unit in which `largest` (mm for x and y, rad for theta) reads between 1 and 1000.

    Numbers below 1 am (or arad) keep that unit, numbers from 1000 m keep the metre; zero gets um or urad.
    """
    base, symbol = (1.0, "rad") if freedom == "theta" else (1e-3, "m")
    power = -6
    if largest > 0:
        power = 3 * math.floor((math.log10(largest) + math.log10(base)) / 3 + ROUND_DOWN)
        power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return Unit(base * 10.0**-power, PREFIXES[power] + symbol)


def significant(value: float, digits: int = 4) -> str:
    """The number with so many significant digits, in plain decimals where they are short, else with a power of ten."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= power < max(digits, 6):
        return f"{value:.{max(digits - 1 - power, 0)}f}".replace("-", "\N{MINUS SIGN}")
    return scientific(value, digits)


def scientific(value: float, digits: int = 1) -> str:
    """The number as 3×10⁻¹⁴."""
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return mantissa.replace("-", "\N{MINUS SIGN}") + "×10" + str(int(power)).translate(SUPERSCRIPTS)


def percent(value: float) -> str:
    """A percentage as one reads it: 14.07 %, 0.123 %, and one digit where it is round-off: 3×10⁻¹⁴ %."""
    if abs(value) < 1e-6:
        return scientific(value) + SPACE + "%"
    return significant(value, 4 if abs(value) >= 1 else 3) + SPACE + "%"


def banded(value: float, band: float) -> str:
    """A percentage with its band, both to the band's second digit: 14.071 ± 0.015 %; round-off as `percent` has it."""
    if abs(value) < 1e-6 or band <= 0:
        return percent(value)
    digits = min(max(1 - math.floor(math.log10(band)), 0), 9)
    number = f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
    return f"{number}{SPACE}±{SPACE}{band:.{digits}f}{SPACE}%"


def round_factor(limit: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `limit` (positive)."""
    power = 10.0 ** math.floor(math.log10(limit))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= limit * (1 + ROUND_DOWN))
