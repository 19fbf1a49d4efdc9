"""Numbers as people read them, and what the verifications found as a page of text; no matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flexfem.plot.driven_text import EXTRUDED, METHOD
from flexfem.questions.errors import Verification

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


def markdown_report(results: Sequence[Verification]) -> str:
    """A page in Markdown: the tables of every result, warnings, and numbers in doubt with the cases that use them.

    Parameters
    ----------
    results : stored verifications, in the order in which they are to appear.
    """
    note = doubt_note(*([key for each in results for key in getattr(each, kind)] for kind in ("assumed", "not_stated")))
    said = " ".join(METHOD[kind] for kind in METHOD if any(each.drive == kind for each in results))
    exact = ", in nonlinear cases by its exact equilibrium," if any(r.analysis == "nonlinear" for r in results) else ""
    said = f"{said.format(exact=exact)} The error is the finite-element displacement minus the commanded one."
    said += f" {EXTRUDED}" if any(each.elements == "three_dimensional" for each in results) else ""
    parts = ["# Verification: analytic stage against finite elements", said]
    parts += [f"**{note}**: these numbers are listed at the end."] if note else []
    parts += [f"## {each.case}\n\n{each.to_markdown()}" for each in results]
    warnings = [f"- {each.case}: {text}" for each in results for text in each.warnings]
    parts += ["## Warnings", "\n".join(warnings)] if warnings else []
    sources: dict[tuple[str, str], list[str]] = {}
    for each in results:
        for what, keys in (("assumed", each.assumed), ("source not stated", each.not_stated)):
            for key in keys:
                sources.setdefault((key, what), []).append(each.case)
    lines = [f"- `{key}`: {what} ({', '.join(cases)})" for (key, what), cases in sorted(sources.items())]
    parts += [
        "## Assumed numbers, and numbers without a source",
        "\n".join(lines) or "None: every number has a source.",
    ]
    return "\n\n".join(parts) + "\n"


def doubt_note(assumed: Sequence[str], not_stated: Sequence[str] = ()) -> str:
    """What figures and pages must say about keys that are assumed or have no source: nothing when there are none.

    Keys of a case file begin with `case: `; alone they leave the dimensions of the stage undoubted.
    """
    found = [f"assumed {_what(assumed)}"] if assumed else []
    return "; ".join(found + ([f"{_what(not_stated)} without a source"] if not_stated else []))


def _what(keys: Sequence[str]) -> str:
    return "commands" if all(key.startswith("case: ") for key in keys) else "dimensions"
