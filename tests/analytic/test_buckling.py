"""Buckling of leaves under loads on the output: Euler's columns, and guides of unequal leaves."""

import numpy as np
import pytest

import flexfem
from flexfem.analytic.finite import buckling_factors

E = 70_000.0
B = 9.0
T = 0.4
L = 37.0  # MPa, mm
EULER = np.pi**2 * E * B * T**3 / 12 / L**2  # N, of a column with two pinned ends
SHEAR = (
    1e-3  # relative to the load of Euler: the shear of a leaf, and its division into eight beams
)


def leaf(turn=0.0):
    """A leaf along an axis that is turned by an angle, rad, from a fixed body to the output."""
    axis = np.exp(1j * turn)

    def at(x):
        z = axis * x
        return z.real, z.imag

    return flexfem.Mechanism(
        name="leaf",
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.29,
            "density": 2700.0,
            "yield_strength": 400.0,
        },
        body=[
            {"name": "base", "path": [at(-12), at(0)], "width": 11, "fixed": True},
            {"name": "top", "path": [at(L), at(L + 13)], "width": 8},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ("base", "top"),
                "at": at(L / 2),
                "direction": turn,
                "shape": "leaf",
                "neck": T,
                "length": L,
            }
        ],
        output={"body": "top", "at": at(L)},
    )


def compression(turn=0.0):
    """A load of one newton on the output towards the fixed body."""
    return -np.array([[np.cos(turn), np.sin(turn), 0.0]])


@pytest.mark.parametrize(
    ("held", "factor"),
    [((), 0.25), ((1, 2), 4.0), ((2,), 1.0), ((1,), 2.0457)],
    ids=["clamped and free", "clamped at both ends", "guided", "clamped and pinned"],
)
def test_a_leaf_buckles_at_eulers_loads(held, factor):
    found = buckling_factors(leaf().layout, compression(), [held])
    np.testing.assert_allclose(found, [factor * EULER], rtol=SHEAR)


def test_a_turned_leaf_buckles_at_the_same_load():
    found = buckling_factors(leaf(0.7).layout, 3.0 * compression(0.7), [()])
    np.testing.assert_allclose(found, [EULER / 12], rtol=SHEAR)


def test_tension_and_no_load_do_not_buckle_a_leaf():
    loads = np.concatenate([-compression(), 0 * compression()])
    assert np.all(np.isinf(buckling_factors(leaf().layout, loads, [(), ()])))


def test_stiffness_states_eulers_loads_and_warns_of_yield_beyond_them():
    found = flexfem.stiffness(leaf(), models="analytic")
    pushed = {"sense": "negative", "direction": "x"}
    assert float(found.at("buckling_load", others="held", **pushed)) == pytest.approx(
        -4 * EULER, rel=SHEAR
    )
    assert float(found.at("buckling_load", others="free", **pushed)) == pytest.approx(
        -EULER / 4, rel=SHEAR
    )
    assert np.isnan(found.at("buckling_load", others="held", sense="positive", direction="x"))
    warned = [text for text in found.warnings if "buckle before they yield" in text]
    assert len(warned) == 1
    assert (
        "along -x: at 96.83 N with the other directions held and 6.055 N with them free"
        in warned[0]
    )
