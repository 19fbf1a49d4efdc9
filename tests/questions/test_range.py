"""Range at finite displacement: guides whose leaves stretch, columns that buckle, and the elastica."""

import numpy as np
import pytest
from scipy.optimize import brentq

import flexfem
from flexfem.analytic.paths import BUCKLING, YIELD, DrivenPlate
from flexfem.fem.nonlinear import driven
from flexfem.questions import ranges, stiffness
from flexfem.questions.plates import model_of
from flexfem.refused import ComputationFailed

from ..conftest import ROOT

E = 70_000.0
B = 9.0
T = 0.4
L = 37.0
STRENGTH = 400.0  # MPa, mm
EI = E * B * T**3 / 12
EA = E * B * T
SHEAR = (
    1e-3  # relative to the load of Euler: the shear of a leaf, and its division into eight beams
)
CURVE = 2e-3  # relative: eight beams along a curve with boundary layers, and their shear
ONE_SIDED = 0.03  # relative: shear, and the moment of tension and compression of the two leaves
ELEMENTS = (
    0.04  # relative: elastic roots make a leaf longer by about a third of its thickness at each end
)


def guide(strength=STRENGTH, sides=(1, -1), **others):
    """A stage between leaves along y on both sides, or on one side: these stretch only if there are
    two sides.
    """
    bodies = [{"name": "stage", "outline": [(-15, -8), (15, -8), (15, 8), (-15, 8)]}]
    hinges = []
    for side in sides:
        y = side * (8 + L)
        edge = [(-20, y), (20, y), (20, y + 9 * side), (-20, y + 9 * side)]
        bodies.append({"name": f"ground {side}", "outline": edge[::side], "fixed": True})
        for x in (-11, 11):
            hinges.append(
                {
                    "name": f"leaf {side} {x}",
                    "between": (f"ground {side}", "stage"),
                    "at": (x, side * (8 + L / 2)),
                    "direction": -side * np.pi / 2,
                    "shape": "leaf",
                    "neck": T,
                    "length": L,
                }
            )
    return flexfem.Mechanism(
        name="guide",
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.29,
            "density": 2700.0,
            "yield_strength": strength,
        },
        body=bodies,
        hinge=hinges,
        output={"body": "stage", "at": (0, 0)},
        **others,
    )


def column(x):
    """Transverse force, tension and end moment of a leaf between two bodies that move across it by
    x, mm.

    A beam under tension P has the slope `c (1 - cosh(k s) / cosh(u))` with `k = sqrt(P / EI)` and
    `u = k L / 2`, and its tension is `EA` times half the mean square of this slope."""

    def slope(u):
        return x / L / (1 - np.tanh(u) / u)

    def excess(u):
        mean = 1 - 2 * np.tanh(u) / u + (1 / np.cosh(u) ** 2 + np.tanh(u) / u) / 2
        return EA / 2 * slope(u) ** 2 * mean - EI * (2 * u / L) ** 2

    u = brentq(excess, 1e-3, 60.0)
    P = EI * (2 * u / L) ** 2
    F = P * slope(u)
    return F, P, F * L / 2 * np.tanh(u) / u


def test_small_stretching_follows_the_closed_form():
    """The curve `x (3 s^2 - 2 s^3)` is longer by `3 x^2 / 5 L`, and the tension is `EA` times this
    strain.
    """
    x = 0.05
    at = DrivenPlate(guide().layout).reached(0, [], x)
    assert at.forces[0] == pytest.approx(
        4 * (12 * EI / L**3 * x + 18 / 25 * EA / L**3 * x**3), rel=SHEAR
    )


def test_leaves_on_both_sides_stretch_and_yield_as_beams_under_tension():
    found = flexfem.stiffness(guide(), models="analytic", plane=True)
    x, force = (
        float(found.at(name, others="free", sense="positive", direction="x"))
        for name in ("range", "range_force")
    )
    F, P, M = column(x)
    assert force == pytest.approx(4 * F, rel=CURVE)
    surface = P / (B * T) + 6 * M / (B * T**2)
    assert surface == pytest.approx(STRENGTH, rel=CURVE)
    assert x < 0.5 * STRENGTH * L**2 / (3 * E * T)  # of leaves that do not stretch
    assert found.at("range", others="held", sense="negative", direction="x") == pytest.approx(
        -x, rel=1e-6
    )
    assert any("yield of hinge" in note and "+x (others free)" in note for note in found.notes)


def test_leaves_on_one_side_do_not_stretch_and_linear_theory_nearly_holds():
    found = flexfem.stiffness(guide(strength=40.0, sides=(1,)), models="analytic", plane=True)
    reached = float(found.at("range", others="free", sense="positive", direction="x"))
    assert reached == pytest.approx(40.0 * L**2 / (3 * E * T), rel=ONE_SIDED)


@pytest.mark.parametrize(("held", "factor"), [((), 0.25), ((0, 2), 4.0), ((2,), 1.0)])
def test_a_pushed_leaf_ends_at_eulers_load(held, factor):
    """Driven towards its root: free at the other end, clamped there, and guided."""
    single = guide(strength=4000.0, sides=(1,))
    hinges = [single.hinge[0].model_copy(update={"at": (0.0, 8 + L / 2)})]
    alone = single.model_copy(
        update={
            "hinge": tuple(hinges),
            "output": single.output.model_copy(update={"at": (0.0, 8.0)}),
        }
    )
    end = DrivenPlate(alone.layout).end(1, held, 0.4)
    assert end.kind == BUCKLING
    assert end.force == pytest.approx(factor * np.pi**2 * EI / L**2, rel=3 * SHEAR)


@pytest.mark.parametrize("held", [[], [0, 1]])
def test_the_end_of_a_turn_that_buckles_a_leaf_on_the_way_is_one_for_all_steps(held):
    """The leaf that is pushed bows near `4 pi^2 E I / L^2`, and the other path of equilibria, on
    which it stays straight, is close by: a step too far leads to it.
    """
    mechanism = flexfem.load(ROOT / "geometry/parallelogram.toml")
    plate = DrivenPlate(mechanism.layout)
    steps = [0.0131, 0.0147, 0.0158, 0.0169, 0.0194]  # rad; linear theory yields at 0.0158
    ends = [plate.end(2, held, scale) for scale in steps]
    assert {end.kind for end in ends} == {YIELD}
    assert [end.displacement for end in ends] == pytest.approx([ends[0].displacement] * 5, rel=1e-5)
    assert ends[0].softest < 0.3
    if not held:  # the moment is that of a bowed leaf, 40 mm from the other
        euler = 4 * np.pi**2 * 71.7e3 * 10.0 * 0.5**3 / 12 / 50.0**2
        assert ends[0].at.forces[2] / 40.0 == pytest.approx(euler, rel=0.05)


def test_a_moment_at_the_end_of_a_leaf_yields_it_on_an_arc():
    """With the others free a pure moment bends a leaf to a circle: `M = E I theta / L`, `sigma = E
    T theta / 2 L`.
    """
    single = guide(strength=400.0, sides=(1,))
    alone = single.model_copy(update={"hinge": single.hinge[:1]})
    end = DrivenPlate(alone.layout).end(2, (), 1.0)
    assert end.kind == YIELD
    assert end.displacement == pytest.approx(2 * 400.0 * L / (E * T), rel=1e-5)
    assert end.force == pytest.approx(EI * end.displacement / L, rel=1e-5)


def test_finite_elements_are_driven_to_a_displacement_and_stretch_by_the_closed_form():
    """At three times the force of leaves that only bend; the load is that of the driven port alone."""
    found = driven(model_of(guide(), 2), [0], np.array([[1.5]]))
    F, _, _ = column(1.5)
    assert found.pose[0, 0] == pytest.approx(1.5, rel=1e-12)
    np.testing.assert_allclose(found.load[0], [4 * F, 0.0, 0.0], rtol=ELEMENTS)


@pytest.mark.parametrize(
    "kind", ["bridge-amplifier", "double-parallelogram", "four-chains", "pivot"]
)
def test_ranges_of_shipped_mechanisms_end_at_a_named_limit_without_warnings_of_numbers(kind):
    """A path that reached one displacement twice divided by zero."""
    found = flexfem.stiffness(flexfem.load(ROOT / f"geometry/{kind}.toml"), models="analytic")
    ends = found.at("range")
    np.testing.assert_array_equal(
        np.sign(ends), np.array([1.0, -1.0])[:, None] * np.ones(ends.shape)
    )
    assert any("yield of hinge" in note for note in found.notes)


def test_a_range_without_an_equilibrium_near_its_limit_leaves_the_other_answers(monkeypatch):
    """Finite elements that do not converge at the limit, or beams that find no equilibrium at all."""
    mechanism = flexfem.load(ROOT / "geometry/parallelogram.toml")

    def refused(*_):
        raise ComputationFailed("no equilibrium")

    monkeypatch.setattr(ranges, "_finite", refused)
    found = flexfem.stiffness(mechanism, models="elements", resolution=4)
    assert np.isfinite(found.free).all() and np.isnan(found.range[:, :, 0]).any()
    assert any("finite elements find no equilibrium" in note for note in found.notes)
    monkeypatch.setattr(stiffness, "ranges", refused)
    found = flexfem.stiffness(mechanism, models="analytic")
    assert (
        "range" not in found.values
        and "no range at finite displacements: no equilibrium" in found.warnings
    )


def test_without_limits_the_stiffness_is_the_same_and_no_range_is_followed(monkeypatch):
    """Studies of numbers at rest must not pay for the range of each design."""
    plate = flexfem.load(ROOT / "geometry/parallelogram.toml")
    whole = flexfem.stiffness(plate, models="analytic")
    monkeypatch.setattr(ranges, "DrivenPlate", None)
    alone = flexfem.stiffness(plate, models="analytic", no_limits=True)
    assert {"range", "range_force", "buckling_load"} <= set(whole.values)
    assert not {"range", "range_force", "buckling_load"} & set(alone.values)
    np.testing.assert_array_equal(alone.free, whole.free)
    np.testing.assert_array_equal(alone.stress, whole.stress)


def test_the_stress_of_a_wide_leaf_follows_its_curvature_and_not_the_force_that_its_thickness_adds():
    """3 E t / L^2 per displacement of a leaf between bodies that stay parallel, whatever the force."""
    plate = guide(sides=(1,)).replace(thickness=40.0)
    wide = flexfem.stiffness(plate, models="analytic", no_limits=True)
    narrow = flexfem.stiffness(
        plate.replace(model="plane_stress"), models="analytic", no_limits=True
    )
    free = {"model": "analytic", "direction": "x"}
    assert float(wide.at("free", **free)) > 1.07 * float(
        narrow.at("free", **free)
    )  # it is nearly plane strain
    highest = 1e3 * float(np.max(wide.at("stress", **free)))  # MPa/mm
    assert highest == pytest.approx(3 * E * T / L**2, rel=0.015)
