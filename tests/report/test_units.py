"""Numbers as people read them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexfem.report.units import percent, round_factor, scientific, significant, unit_for


@pytest.mark.parametrize(
    ("freedom", "largest", "name", "shown"),
    [
        ("x", 1e-6, "nm", 1.0),
        ("y", 5.0, "mm", 5.0),
        ("x", 0.05, "µm", 50.0),
        ("x", 999.4e-6, "nm", 999.4),
        ("y", 2300.0, "m", 2.3),
        ("theta", 1e-3, "mrad", 1.0),
        ("theta", 142e-6, "µrad", 142.0),
        ("x", 0.0, "µm", 0.0),
        ("x", 1e-30, "am", 1e-15),
    ],
)
def test_unit_is_the_prefix_that_reads_well(freedom, largest, name, shown):
    unit = unit_for(freedom, largest)
    assert unit.name == name
    assert largest * unit.factor == pytest.approx(shown)


@given(st.floats(1e-14, 1e5), st.sampled_from(["x", "y", "theta"]))
def test_numbers_read_between_one_and_a_thousand(largest, freedom):
    largest = min(largest, 900.0) if freedom == "theta" else largest  # rad and m are the largest units
    assert 1 - 1e-6 <= largest * unit_for(freedom, largest).factor <= 1000  # round-off at a power of ten


@pytest.mark.parametrize(
    ("value", "text"),
    [(14.0712, "14.07 %"), (300.0, "300.0 %"), (-0.12345, "−0.123 %"), (-8.2e-13, "−8×10⁻¹³ %"), (0.0, "0 %")],
)
def test_percentages_have_sensible_digits(value, text):
    assert percent(value).replace("\N{NO-BREAK SPACE}", " ") == text


def test_powers_of_ten_are_superscript():
    assert scientific(3.2e-14) == "3×10⁻¹⁴"
    assert significant(9.99996, 4) == "10.00"
    assert significant(47321.7, 5) == "47322"
    assert significant(2e6, 1) == "2×10⁶"


@given(st.floats(1e-9, 1e9))
def test_round_factor_is_the_next_below(limit):
    factor = round_factor(limit)
    assert factor <= limit * (1 + 1e-8)  # a limit that is round but for round-off counts as round
    assert factor > limit / 2.5 * (1 - 1e-8)
