"""Units of all output: their names, and their factors on internal numbers (N, mm, MPa, rad, tonne,
s).
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from typing import Literal, NamedTuple, TypeAlias

Direction: TypeAlias = Literal["x", "y", "theta"]
DIRECTIONS: tuple[Direction, ...] = ("x", "y", "theta")
PLANES = {  # reductions of a stage to a plane problem
    "plane_stress": "plane stress",
    "plane_strain": "plane strain",
    "corrected": "corrected for thickness",
    "three_dimensional": "three dimensions",
}
COMPUTED_IN = PLANES | {"corrected": "plane stress, corrected for thickness"}  # of headings
PREFIXES = {
    -18: "a",
    -15: "f",
    -12: "p",
    -9: "n",
    -6: "µ",
    -3: "m",
    0: "",
}
ROUND_DOWN = (
    1e-9  # of a power of 1000; a number below it by round-off keeps the prefix of that power
)


class Unit(NamedTuple):
    """A unit: an internal number times `factor` is the number in the unit `name`."""

    factor: float
    name: str

    def __str__(self) -> str:
        return self.name

    def label(self, plain: bool) -> str:
        """Return the name, or its ASCII form."""
        return self.plain if plain else self.name

    @property
    def plain(self) -> str:
        """The name in ASCII, for terminals."""
        return self.name.replace("µ", "u").replace("°", "deg").replace("²", "^2").replace("³", "^3")


UNITS = {  # by the suffix of file keys and study columns
    "mm": Unit(1.0, "mm"),
    "um": Unit(1e3, "µm"),
    "in": Unit(1 / 25.4, "in"),
    "rad": Unit(1.0, "rad"),
    "mrad": Unit(1e3, "mrad"),
    "deg": Unit(180.0 / math.pi, "°"),
    "n": Unit(1.0, "N"),
    "n_mm": Unit(1.0, "N mm"),
    "mpa": Unit(1.0, "MPa"),
    "gpa": Unit(1e-3, "GPa"),
    "kg_m3": Unit(1.0, "kg/m³"),
    "percent": Unit(1.0, "%"),  # internal percentages are percentages, not fractions
    "n_per_mm": Unit(1.0, "N/mm"),
    "n_per_um": Unit(1e-3, "N/µm"),
    "n_mm_per_rad": Unit(1.0, "N mm/rad"),
    "mm_per_n": Unit(1.0, "mm/N"),
    "mm_per_rad": Unit(1.0, "mm/rad"),
    "rad_per_mm": Unit(1.0, "rad/mm"),
    "um2_mrad": Unit(1e9, "µm² mrad"),
    "rad_per_n_mm": Unit(1.0, "rad/(N mm)"),
    "per_n": Unit(1.0, "1/N"),
    "mpa_per_um": Unit(1e-3, "MPa/µm"),
    "mpa_per_mrad": Unit(1e-3, "MPa/mrad"),
    "v": Unit(1.0, "V"),
    "s": Unit(1.0, "s"),
    "hz": Unit(1 / (2 * math.pi), "Hz"),  # from rad/s
    "g": Unit(1e6, "g"),
    "kg": Unit(1e3, "kg"),  # from tonne, the mass unit consistent with N, mm and s
    "kg_mm2": Unit(1e3, "kg mm²"),
    "um_per_m_k": Unit(1e6, "µm/(m K)"),
    "um_per_k": Unit(1e3, "µm/K"),
    "urad_per_k": Unit(1e6, "µrad/K"),
    "um_per_k_per_mm": Unit(1e3, "µm/(K/mm)"),
    "urad_per_k_per_mm": Unit(1e6, "µrad/(K/mm)"),
}
DENSITY = 1e-12  # tonne/mm^3 per kg/m^3
NONE = Unit(1.0, "")
ENDING = re.compile(rf"_({'|'.join(UNITS)})(\[\d+\])?$")

SIMILAR = (  # units that a number on the command line may have, of the same quantity
    (Unit(1e-3, "m"), UNITS["mm"], UNITS["um"], Unit(1e6, "nm"), UNITS["in"]),
    (UNITS["rad"], UNITS["mrad"], Unit(1e6, "µrad"), UNITS["deg"]),
    (Unit(1e-3, "kN"), UNITS["n"], Unit(1e3, "mN"), Unit(1e6, "µN")),
    (Unit(1e-3, "N m"), UNITS["n_mm"], Unit(1.0, "mN m"), Unit(1e3, "µN m")),
    (UNITS["kg"], UNITS["g"]),
    (Unit(1e-3, "kg m²"), UNITS["kg_mm2"], Unit(1e6, "g mm²")),
)
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")

LENGTH = UNITS["mm"]
MICROMETRE = UNITS["um"]
STRESS = UNITS["mpa"]
DEGREE = UNITS["deg"]
EXPANSION = UNITS["um_per_m_k"]
RATE = UNITS["n_per_um"]  # stiffness of stacks and contacts, as data sheets give it
UnitNames: TypeAlias = str | tuple[str, ...] | tuple[tuple[str, ...], ...]
BY_DIRECTION: dict[object, UnitNames] = {  # keys of `UNITS` for x, y and theta
    "motion": ("mm", "mm", "rad"),
    "command": ("um", "um", "mrad"),
    "wrench": ("n", "n", "n_mm"),
    "percents": ("percent",) * 3,
    "stiffness": ("n_per_mm", "n_per_mm", "n_mm_per_rad"),
    "compliance": ("mm_per_n", "mm_per_n", "rad_per_n_mm"),
    "stress per motion": ("mpa_per_um", "mpa_per_um", "mpa_per_mrad"),
    "stiffness matrix": (("n_per_mm", "n_per_mm", "n"),) * 2 + (("n", "n", "n_mm_per_rad"),),
    "compliance matrix": (("mm_per_n", "mm_per_n", "per_n"),) * 2
    + (("per_n", "per_n", "rad_per_n_mm"),),
}
POSES, COMMANDS, FORCES, STIFFNESSES, COMPLIANCES = (
    tuple(UNITS[str(name)] for name in BY_DIRECTION[quantity])
    for quantity in ("motion", "command", "wrench", "stiffness", "compliance")
)


def unit_of(name: str) -> Unit:
    """Return the unit in the suffix of a column name or key path; `NONE` without one."""
    match = ENDING.search(name)
    return UNITS[match[1]] if match else NONE


def in_unit(text: str, unit: Unit) -> float:
    """Return a number in `unit` from a text such as 0.1 or 100um. Raises ValueError that names the
    expected units.
    """
    with suppress(ValueError):
        return float(text)
    units = next(each for each in SIMILAR if unit in each)
    found = NUMBER.match(text)
    spelled = {_spelled(each.name): each for each in units}
    if found is None or (given := spelled.get(_spelled(text[found.end() :]))) is None:
        names = ", ".join(each.plain.replace(" ", "") for each in units)
        raise ValueError(
            f"{text}, expected a number in {unit.plain}, or a number with its unit: {names}"
        )
    return float(found[0]) / given.factor * unit.factor


def _spelled(name: str) -> str:
    """Return the name of a unit without the signs in which spellings differ."""
    return re.sub(r"[\s^*·]", "", Unit(1.0, name.replace("\u03bc", "µ")).plain)


def short(value: float, form: str = "g") -> str:
    """Return a number in a format of Python, with a power of ten such as 1e6."""
    return re.sub(r"e([-+])0?", lambda found: f"e{found[1].strip('+')}", format(value, form))


def without_unit(name: str) -> str:
    """Return a column name or key path without its unit suffix."""
    return ENDING.sub(r"\2", name)


def in_words(name: str) -> str:
    """Return the words of a key or field without its unit: "Young's modulus" of
    `youngs_modulus_gpa`.
    """
    words = without_unit(name).replace("_", " ")
    return re.sub(r"\b(young|poisson)s\b", lambda found: f"{found[1].title()}'s", words)


def unit_for(freedom: Direction, largest: float) -> Unit:
    """Return the prefixed unit in which `largest` (mm for x and y, rad for theta) reads between 1
    and 1000.

    The smallest unit is 1 am (or arad), the largest 1 m (or rad); zero and infinity get um or urad.
    """
    base, symbol = (1.0, "rad") if freedom == "theta" else (1e-3, "m")
    power = -6
    if 0 < largest < math.inf:
        power = 3 * math.floor((math.log10(largest) + math.log10(base)) / 3 + ROUND_DOWN)
        power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return Unit(base * 10.0**-power, PREFIXES[power] + symbol)
