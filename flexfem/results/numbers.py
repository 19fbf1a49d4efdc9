"""Numbers as text: with the digits that their band justifies."""

from __future__ import annotations

import numpy as np

from flexfem.units import short

NEGLIGIBLE = 0.1  # of its band; a smaller value is shown as 0
MOST_DIGITS = 7  # significant digits of a printed number
WHOLE_FROM = 1e5  # numbers from here without a band are printed as whole ones,
EXPONENT_FROM = 1e7  # and from here, or
EXPONENT_BELOW = 1e-4  # below this, with an exponent
MOST_PLACES = 12  # after the decimal point
SPACE = "\N{NO-BREAK SPACE}"


def number(value: float, band: float = np.nan) -> str:
    """Return a number with the digits that its band justifies, five significant ones without one.

    The text is "" for nan and "unlimited" for infinity.
    """
    if np.isnan(value):
        return ""
    if np.isinf(value):
        return "unlimited"
    if not band > 0:
        return _without_band(value)
    if abs(value) < NEGLIGIBLE * band < np.inf:
        value = 0.0
    places = _places(band)
    digits = places + int(np.floor(np.log10(abs(value)))) + 1 if value else 0
    if digits > MOST_DIGITS + 2:  # the band is less than half of the last printed digit
        return short(value, f".{MOST_DIGITS}g")
    is_tiny = places > 6 and abs(value) < EXPONENT_BELOW
    if abs(value) >= EXPONENT_FROM or is_tiny or digits > MOST_DIGITS:
        significant = min(max(digits, 1), MOST_DIGITS)
        return f"{short(value, f'.{significant}g')} ± {short(band, '.2g')}"
    if places < 0:
        value = round(value, places)
        band = round(band, places)
        places = 0
    return f"{value:.{places}f} ± {band:.{places}f}" if value else f"0 ± {band:.{places}f}"


def _without_band(value: float) -> str:
    if WHOLE_FROM <= abs(value) < EXPONENT_FROM:
        return f"{float(f'{value:.5g}'):.0f}"
    return short(value, "z.5g")


def _places(band: float) -> int:
    """Return the decimal places that show two digits of a band."""
    if not np.isfinite(band):
        return 0
    return int(min(1 - np.floor(np.log10(band)), MOST_PLACES))


def thousands(count: int) -> str:
    """Return a count with separated thousands."""
    return f"{count:,}".replace(",", SPACE)
