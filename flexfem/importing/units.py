"""Units of length of drawings."""

from __future__ import annotations

import re
from typing import NamedTuple

from flexfem.files.refusals import nearest
from flexfem.refused import BadInput, printed

INCH = 25.4  # mm
LARGEST_THICKNESS = 1e4  # mm, of a plate; a larger one is a unit error
LENGTHS = {  # mm
    "mm": 1.0,
    "cm": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "um": 1e-3,
    "nm": 1e-6,
    "in": INCH,
    "ft": 12 * INCH,
    "yd": 36 * INCH,
    "mil": INCH / 1000,
    "uin": INCH * 1e-6,
    "px": INCH / 96,
    "pt": INCH / 72,
    "pc": INCH / 6,
}
OTHER_NAMES = {
    "inch": "in",
    "inches": "in",
    '"': "in",
    "feet": "ft",
    "foot": "ft",
    "thou": "mil",
    "µm": "um",
    "μm": "um",
}
OTHER_NAMES |= {
    "micron": "um",
    "microns": "um",
    "millimetre": "mm",
    "millimeter": "mm",
    "metre": "m",
    "meter": "m",
}
DOTS = re.compile(r"(\d+(?:\.\d+)?) ?(?:dpi|ppi)")


class DrawingUnit(NamedTuple):
    """A unit of length and its size in mm."""

    name: str
    millimetres: float

    @classmethod
    def named(cls, name: object) -> DrawingUnit:
        """Return the unit of a name such as mm, in or 90dpi. Raises BadInput."""
        if not isinstance(name, str):
            raise BadInput(f"units {printed(name)}, expected the name of a unit such as mm or in")
        plain = name.strip().lower()
        plain = OTHER_NAMES.get(plain, plain)
        dots = DOTS.fullmatch(plain)
        if dots and float(dots[1]) > 0:
            return cls(plain, INCH / float(dots[1]))
        if plain not in LENGTHS:
            raise BadInput(
                f"units {printed(name)}, expected a unit of length{nearest(plain, LENGTHS)}, or "
                "90dpi"
            )
        return cls(plain, LENGTHS[plain])


MM = DrawingUnit("mm", 1.0)
