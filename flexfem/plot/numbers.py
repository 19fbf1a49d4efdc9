"""Numbers as people read them: significant digits, powers of ten, bands, round factors."""

from __future__ import annotations

import math

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ROUND_DOWN = 1e-9  # a limit that is round but for round-off counts as round
SPACE = "\N{NO-BREAK SPACE}"


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
