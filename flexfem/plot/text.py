"""Texts of figures and pages: numbers, and notes on assumptions; matplotlib is not needed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from flexfem.results import SPACE, number

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
NUMBER = r"(?<![\w.])(-?\d+\.?\d*)(?:e([+-]?\d+))?(?![\w])"  # its digits and its power of ten
ROUND_DOWN = 1e-9  # tolerance within which a limit counts as round
SYMBOLS = ("x", "y", "θ")


def significant(value: float, digits: int = 4) -> str:
    """Format a number to significant digits, as a decimal where that is short."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= power < max(digits, 6):
        return minus(f"{value:.{max(digits - 1 - power, 0)}f}")
    return scientific(value, digits)


def scientific(value: float, digits: int = 1) -> str:
    """Format a number in scientific notation, such as 3×10⁻¹⁴."""
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return minus(mantissa) + "×10" + str(int(power)).translate(SUPERSCRIPTS)


def percent(value: float) -> str:
    """Format a percentage: 14.07 %, 0.123 %, or 0 % where it is round-off."""
    if abs(value) < 1e-6:
        return f"0{SPACE}%"
    return significant(value, 4 if abs(value) >= 1 else 3) + SPACE + "%"


def banded(value: float, band: float) -> str:
    """Format a percentage and its band to the band's second digit, such as 14.071 ± 0.015 %."""
    if abs(value) < 1e-6 or band <= 0:
        return percent(value)
    return minus(number(value, band)).replace(" ", SPACE) + SPACE + "%"


def typeset(text: str) -> str:
    """Return a text with minus signs and powers of ten as figures have them, not -2.1e-05."""
    return re.sub(NUMBER, _as_typeset, text)


def _as_typeset(found: re.Match[str]) -> str:
    digits, power = found.groups()
    if power is None:
        return minus(digits)
    factor = "10" + str(int(power)).translate(SUPERSCRIPTS)
    return factor if digits == "1" else f"{minus(digits)}×{factor}"


def sentence(text: str) -> str:
    """Return a text with a capital and a full stop."""
    return f"{text[:1].upper()}{text[1:]}."


def minus(text: str) -> str:
    """Replace the hyphens of a text by minus signs."""
    return text.replace("-", "\N{MINUS SIGN}")


def round_factor(limit: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that does not exceed a positive limit."""
    power = 10.0 ** math.floor(math.log10(limit))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= limit * (1 + ROUND_DOWN))


def assumption_note(assumed: Sequence[str], not_stated: Sequence[str] = ()) -> str:
    """Return the note on keys that are assumed or have no source; empty without such keys."""
    notes = []
    if assumed:
        notes.append(f"assumed {_subject(assumed)}")
    if not_stated:
        notes.append(f"{_subject(not_stated)} without a source")
    return "; ".join(notes)


def _subject(keys: Sequence[str]) -> str:
    """Return what keys are about: commands of a case, what bodies are for, or else dimensions."""
    if all(key.startswith("case: ") for key in keys):
        return "commands"
    if all(key.startswith("output.") or key.endswith((".fixed", ".clamped_edges")) for key in keys):
        return "ground or output"
    return "dimensions"


def assumption_rows(named: Sequence[tuple[str, Any]]) -> list[list[str]]:
    """Return rows of key, kind of assumption, and names of the records that list the key."""
    names: dict[tuple[str, str], list[str]] = {}
    for name, record in named:
        for kind, keys in (("assumed", record.assumed), ("source not stated", record.not_stated)):
            for key in keys:
                names.setdefault((key, kind), []).append(name)
    return [[key, kind, ", ".join(listed)] for (key, kind), listed in sorted(names.items())]
