"""Numbers as people read them, and units: each written once, each with its size."""

from __future__ import annotations

import pytest

from flexfem import units
from flexfem.mechanism.keys import keys
from flexfem.plot.text import percent
from flexfem.units import UNITS, unit_for, unit_of, without_unit

SIZES = {  # what one of the file unit is in N, mm, MPa, rad, K, s, tonne
    "µm/(m K)": 1e-6,
    "µm": 1e-3,
    "mrad": 1e-3,
    "°": 0.017453292519943295,
    "GPa": 1e3,
    "MPa/µm": 1e3,
    "N/µm": 1e3,
    "MPa/mrad": 1e3,
    "Hz": 6.283185307179586,
    "kg": 1e-3,
    "µm/K": 1e-3,
    "µrad/K": 1e-6,
    "µm/(K/mm)": 1e-3,
    "µrad/(K/mm)": 1e-6,
    "kg mm²": 1e-3,
    "g": 1e-6,
    "µm² mrad": 1e-9,
    "mm/rad": 1.0,
    "rad/mm": 1.0,
    "mm": 1.0,
    "rad": 1.0,
    "": 1.0,
    "in": 25.4,
    **dict.fromkeys(
        (
            "N",
            "N mm",
            "MPa",
            "kg/m³",
            "%",
            "N/mm",
            "N mm/rad",
            "mm/N",
            "rad/(N mm)",
            "1/N",
            "V",
            "s",
        ),
        1.0,
    ),
}


def test_every_unit_has_its_size() -> None:
    assert {unit.name for unit in UNITS.values()} == set(SIZES) - {""}
    for unit in UNITS.values():
        assert unit.factor == pytest.approx(1 / SIZES[unit.name], rel=1e-15), unit
    for path, key in keys().items():
        assert key.number.factor == pytest.approx(SIZES[unit_of(path).name], rel=1e-15), path


SI = {  # what one of a unit on the command line is in metre, newton, kilogram and rad
    "m": 1.0,
    "mm": 1e-3,
    "µm": 1e-6,
    "nm": 1e-9,
    "in": 0.0254,
    "rad": 1.0,
    "mrad": 1e-3,
    "µrad": 1e-6,
    "°": 0.017453292519943295,
    "kN": 1e3,
    "N": 1.0,
    "mN": 1e-3,
    "µN": 1e-6,
    "N m": 1.0,
    "N mm": 1e-3,
    "mN m": 1e-3,
    "µN m": 1e-6,
    "kg": 1.0,
    "g": 1e-3,
    "kg m²": 1.0,
    "kg mm²": 1e-6,
    "g mm²": 1e-9,
}


def test_a_number_with_a_unit_is_converted_to_every_similar_one() -> None:
    assert {unit.name for each in units.SIMILAR for unit in each} == SI.keys()
    for similar in units.SIMILAR:
        for given in similar:
            for wanted in similar:
                expected = 3 * SI[given.name] / SI[wanted.name]
                assert units.in_unit(f"3{given.plain}", wanted) == pytest.approx(
                    expected, rel=1e-14
                ), (given, wanted)


def test_the_unit_of_a_column_or_key_is_what_its_name_ends_in() -> None:
    for name, unit in (
        ("kxt_n", "N"),
        ("drift_gradient_um_per_k_per_mm", "µm/(K/mm)"),
        ("life_cycles", ""),
    ):
        assert unit_of(name).name == unit
    assert unit_of("chain.link_lengths_mm[2]").name == "mm" and without_unit("a_mm[2]") == "a[2]"


def test_every_direction_has_its_unit() -> None:
    assert [unit.name for unit in (units.LENGTH, units.MICROMETRE, units.STRESS)] == [
        "mm",
        "µm",
        "MPa",
    ]
    assert [unit.plain for unit in (units.MICROMETRE, UNITS["deg"], units.STRESS)] == [
        "um",
        "deg",
        "MPa",
    ]
    for found, names in (
        (units.POSES, ["mm", "mm", "rad"]),
        (units.COMMANDS, ["µm", "µm", "mrad"]),
        (units.FORCES, ["N", "N", "N mm"]),
        (units.STIFFNESSES, ["N/mm", "N/mm", "N mm/rad"]),
        (units.COMPLIANCES, ["mm/N", "mm/N", "rad/(N mm)"]),
    ):
        assert list(map(str, found)) == names


PREFIXES = [
    ("x", 1e-6, "nm", 1.0),
    ("y", 5.0, "mm", 5.0),
    ("x", 0.05, "µm", 50.0),
    ("x", 999.4e-6, "nm", 999.4),
    ("y", 2300.0, "m", 2.3),
    ("theta", 1e-3, "mrad", 1.0),
    ("theta", 142e-6, "µrad", 142.0),
    ("x", 0.0, "µm", 0.0),
    ("x", 1e-30, "am", 1e-15),
    ("y", float("inf"), "µm", float("inf")),
]


@pytest.mark.parametrize(("freedom", "largest", "name", "shown"), PREFIXES)
def test_unit_is_the_prefix_that_reads_well(freedom, largest, name, shown):
    unit = unit_for(freedom, largest)
    assert unit.name == name
    assert largest * unit.factor == pytest.approx(shown)


def test_percentages_have_sensible_digits():
    found = [
        percent(value).replace("\N{NO-BREAK SPACE}", " ")
        for value in (14.0712, 300.0, -0.12345, -8.2e-13, 0.0)
    ]
    assert found == ["14.07 %", "300.0 %", "−0.123 %", "0 %", "0 %"]
