"""Gaps between parts of a plate that is drawn with gaps of known widths."""

import pytest

import flexfem
from flexfem.mechanism.gaps import smallest_gaps

ROUND_OFF = 1e-9  # mm, of polygons without arcs


def guide():
    """A stage between two leaves, a stop at 2.3 mm on its right side, and a slit of 0.35 mm beside
    each leaf.

    The slits are in the ground, whose blocks reach 12 mm down beside the leaves of 0.4 mm.
    """
    leaf = {
        "between": ("ground", "stage"),
        "direction": -1.5707963267948966,
        "shape": "leaf",
        "neck": 0.4,
    }
    return flexfem.Mechanism(
        name="guide",
        thickness=9.0,
        material={
            "name": "m",
            "youngs_modulus": 7e4,
            "poissons_ratio": 0.3,
            "density": 2700.0,
            "yield_strength": 400,
        },
        body=[
            {"name": "stage", "outline": [(-15, -8), (15, -8), (15, 8), (-15, 8)]},
            {
                "name": "ground",
                "outline": [(-20, 45), (-20, 33), (20, 33), (20, 45), (20, 54), (-20, 54)],
                "fixed": True,
            },
            {"name": "stop", "outline": [(17.3, -5), (25, -5), (25, 1), (17.3, 1)], "fixed": True},
        ],
        hinge=[
            {**leaf, "name": f"leaf {x}", "at": (x, 26.5), "length": 37.0, "cut": 1.1}
            for x in (-11, 11)
        ],
        output={"body": "stage", "at": (0.0, 0.0)},
    )


def test_the_smallest_gaps_are_those_of_the_drawing():
    """A slit is (1.1 - 0.4) / 2 wide. Ground and stop are both fixed, and 32 mm apart; they cannot
    touch.
    """
    found = smallest_gaps(guide().layout, 10)
    by_parts = {gap.parts: gap for gap in found}
    stage, ground, stop, left, right = range(5)
    assert [gap.width for gap in found[:2]] == pytest.approx([0.35, 0.35], abs=ROUND_OFF)
    assert {gap.parts for gap in found[:2]} == {(ground, left), (ground, right)}
    assert by_parts[stage, stop].width == pytest.approx(2.3, abs=ROUND_OFF)
    assert by_parts[stage, stop].place.real == pytest.approx(16.15, abs=ROUND_OFF)
    assert -5 <= by_parts[stage, stop].place.imag <= 1
    assert by_parts[stage, ground].width == pytest.approx(25.0, abs=ROUND_OFF)
    assert by_parts[left, right].width == pytest.approx(21.6, abs=ROUND_OFF)
    assert (ground, stop) not in by_parts


def test_a_short_list_has_the_smallest_of_all():
    layout = guide().layout
    whole = [gap.width for gap in smallest_gaps(layout, 10)]
    for count in range(1, 7):
        assert [gap.width for gap in smallest_gaps(layout, count)] == pytest.approx(
            whole[:count], abs=ROUND_OFF
        )


def test_check_lists_the_gaps():
    found = flexfem.check(guide()).gaps
    assert found[2].between == "stage - stop"
    assert found[2].gap_mm == pytest.approx(2.3, abs=ROUND_OFF)
