"""Mechanisms at large displacements: exact arcs, tangents, closed forms of parallelograms,
published solutions.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexfem
from flexfem.analytic.finite import displaced
from flexfem.analytic.plates import respond
from flexfem.fem.nonlinear import driven, equilibria
from flexfem.questions.plates import elements, model_of, parts_of, solved
from flexfem.refused import BadInput, ComputationFailed

from ..conftest import ROOT

LENGTH = 250.0
UNIT = 210e3 * 50 * 5**3 / 12 / 250**2  # mm, and N of the normalised force F L^2 / (E I)
SCALE = np.array([LENGTH, LENGTH, 1.0])
SHARES = np.array([0.5, 5.0, 10.0, 20.0])


@pytest.fixture
def parallelogram(benchmark):
    """That of Su, or with thinner leaves."""
    return benchmark("su_parallelogram").parallelogram


def upwards(layout, forces):
    """Loads (s, k) along y."""
    return np.outer(forces, np.eye(len(layout.ports))[1])


def test_a_moment_bends_a_leaf_into_an_arc_and_does_work_on_the_rotation_of_its_body():
    """Body forces of fixed directions would lose two thirds of the moment at 1.2 rad; the output is
    off the body.
    """
    leaf = {
        "name": "leaf",
        "between": ("ground", "tip"),
        "at": (50, 0),
        "direction": 0.0,
        "shape": "leaf",
    }
    one = flexfem.Mechanism(
        name="leaf",
        thickness=4.0,
        material={
            "name": "steel",
            "youngs_modulus": 2e5,
            "poissons_ratio": 0.0,
            "density": 7.9,
            "yield_strength": 1e3,
        },
        body=[
            {"name": "ground", "outline": [(-9, -9), (0, -9), (0, 9), (-9, 9)], "fixed": True},
            {"name": "tip", "outline": [(100, -9), (115, -9), (115, 9), (100, 9)]},
        ],
        hinge=[{**leaf, "length": 100.0, "neck": 1.0}],
        output={"body": "tip", "at": (103.0, 20.0)},
    )
    EI = 2e5 * 4 / 12
    moments = np.array([0.012, 0.6, 1.2]) * 2e5 * 4 / 12 / 100
    found = equilibria(model_of(one, 2), np.outer(moments, [0, 0, 1]))
    turn = found.pose[:, 2]
    np.testing.assert_allclose(turn / moments, turn[0] / moments[0], rtol=1e-3)
    assert turn[0] == pytest.approx(
        moments[0] * 100 / EI, rel=6e-3
    )  # softer by the elastic root: half a height
    np.testing.assert_allclose(found.energy, moments * turn / 2, rtol=2e-3)
    tip = 100j * (1 - np.exp(1j * turn)) / turn + (3 + 20j) * np.exp(1j * turn) - (103 + 20j)
    np.testing.assert_allclose(found.pose[:, 0] + 1j * found.pose[:, 1], tip, rtol=5e-3)


def test_small_loads_find_the_linear_compliance_and_tangents_the_change_of_the_equilibrium():
    mechanism = flexfem.load(ROOT / "geometry" / "parallelogram.toml")
    model = model_of(mechanism, 2)
    C = solved(mechanism, 2).compliance
    scale = np.sqrt(np.diag(C))
    load = np.array([1.0, 0.7, 0.4, 0.9])
    small = equilibria(model, 1e-6 * load / scale)
    np.testing.assert_allclose(
        small.pose[0] / scale, 1e-6 * (C @ (load / scale)) / scale, rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(
        small.compliance[0] / np.outer(scale, scale), C / np.outer(scale, scale), atol=1e-5
    )
    large = load / scale
    step = 1e-3 * np.eye(4) / scale
    ahead, behind = (
        np.array([equilibria(model, large + side * one).pose[0] for one in step])
        for side in (1, -1)
    )
    tangent = equilibria(model, large).compliance[0] / np.outer(scale, scale)
    np.testing.assert_allclose(tangent, (ahead - behind) / scale / 2e-3, rtol=0, atol=1e-5)
    assert np.abs(tangent - C / np.outer(scale, scale)).max() > 1e-2


@pytest.mark.parametrize("finite", [True, False], ids=["finite elements", "beams"])
def test_a_parallelogram_shortens_and_stiffens_as_the_beam_constraint_model(parallelogram, finite):
    """`u_x = -0.6 u_y^2 / L` and `K_y = (24 + 1.2 A - A^2 / 1400) E I / L^3` with an axial force A
    (S. Awtar, A. H. Slocum, E. Sevincer, J. Mech. Des. 129 (2007) 625). Elastic roots lengthen
    leaves of 1 mm by 0.3 %."""
    mechanism = parallelogram("plane_stress", 1.0)
    unit = UNIT / 125

    def moved(*loads):
        loads = unit * np.array(loads)
        found = (
            equilibria(model_of(mechanism, 2), loads).pose
            if finite
            else displaced(mechanism.layout, loads).motions
        )
        return found[:, :3] / SCALE

    rest, pulled, pushed = (moved((A, 0, 0), (A, 0.2, 0), (A, 0.4, 0)) for A in (0.0, 6.0, -6.0))
    assert rest[2, 0] == pytest.approx(-0.6 * rest[2, 1] ** 2, rel=4e-3)
    for poses, A in ((pulled, 6.0), (pushed, -6.0)):
        assert rest[1, 1] / poses[1, 1] == pytest.approx(1 + 0.05 * A - A**2 / 33600, rel=3e-3)


def test_a_parallelogram_follows_published_finite_elements_in_three_dimensions(parallelogram):
    """H.-J. Su, github.com/haijunsu-osu/parallelogram_model_comparison: CalculiX, tetrahedra of 10
    mm; A_y = 5 of 3 mm.

    The leaves are ten times as wide as thick: linear finite elements place them between plane
    stress and plane strain. Tetrahedra of 10 mm are 0.6 % too stiff at A_y = 5. Strongly bent
    leaves lose their anticlastic curvature and become stiffer, which adds about 1 % at A_y = 20.
    Su's stage is 24 times stiffer: loads of finite elements are reduced by the share of the stage
    in the compliance; its bending changes small rotations, but not those of large displacements.
    """
    published = np.array(
        [[-2.430e-4, 0.020062], [-0.022847, 0.193272], [-0.078428, 0.352388], [-0.215222, 0.559876]]
    )
    planes = [parallelogram(plane) for plane in ("plane_stress", "plane_strain")]
    stress, strain = (solved(plane, 4).compliance[1, 1] for plane in planes)
    place = (stress - elements(planes[0], 4, 2).compliance[1, 1]) / (stress - strain)
    assert place == pytest.approx(0.35, abs=0.02)
    between = np.array([1 - place, place])
    beams = [
        displaced(each.layout, upwards(each.layout, UNIT * SHARES)).motions[:, :3] / SCALE
        for each in planes
    ]
    element_values = []
    for each in planes:
        rigid, elastic = (
            respond(each.layout, parts).compliance[1, 1] for parts in ((), parts_of(each).bodies)
        )
        loads = upwards(each.layout, UNIT * SHARES * rigid / elastic)
        element_values.append(equilibria(model_of(each, 4), loads).pose[:, :3] / SCALE)
    for found in (beams, element_values):
        pose = np.tensordot(between, found, axes=1)
        np.testing.assert_allclose(pose[:, 1], published[:, 1], rtol=0.02)
        np.testing.assert_allclose(pose[:, 0], published[:, 0], rtol=0.026)
        np.testing.assert_allclose(pose[1, :2], [-5.7723 / LENGTH, 48.6102 / LENGTH], rtol=6e-3)
        assert pose[3, 2] == pytest.approx(0.034597, rel=0.035)


def test_an_amplitude_is_reached_by_beams_and_finite_elements_whose_leaves_stretch():
    """The linear force of 2 mm moves the finite elements of this guide by 3 % more."""
    mechanism = flexfem.load(ROOT / "geometry" / "parallelogram.toml")
    found = flexfem.large(mechanism, amplitude=2.0)
    np.testing.assert_allclose(
        found.pose[:, :, 0], np.outer([0.5, 1.0, 1.5, 2.0], np.ones(3)), rtol=1e-9
    )
    assert "force" not in found.values
    again = equilibria(
        model_of(mechanism, 4), np.append(found.driving[:, 2], np.zeros((4, 1)), axis=1)
    )
    np.testing.assert_allclose(
        again.pose[:, :3], found.pose[:, 2] * [1, 1, 1], rtol=1e-5, atol=1e-9
    )


def test_linear_theory_is_the_tangent_of_the_beams_at_rest():
    """Two leaves clamped in blocks need `24 E I / L^3` a displacement; they stretch as its square."""
    mechanism = flexfem.load(ROOT / "geometry" / "parallelogram.toml")
    found = flexfem.large(mechanism, amplitude=0.01, models="analytic")
    linear, beams = found.driving[0, :, 0]
    assert linear == pytest.approx(beams, rel=1e-4)


def test_an_amplitude_with_an_angle_turns_the_output():
    pivot = flexfem.load(ROOT / "geometry/pivot.toml")
    found = flexfem.large(pivot, amplitude="5deg", models="analytic")
    np.testing.assert_allclose(found.pose[-1, :, 2], np.radians(5), rtol=1e-9)
    with pytest.raises(BadInput, match=r"amplitude '5kg', expected a length or an angle"):
        flexfem.large(pivot, amplitude="5kg", models="analytic")


def test_rotations_grow_beyond_half_a_turn():
    """A moment bends a leaf to an arc of the angle `M L / E I`; an angle that wraps at pi has no
    such moment.
    """
    leaf = {
        "name": "leaf",
        "between": ("ground", "tip"),
        "at": (50, 0),
        "direction": 0.0,
        "shape": "leaf",
    }
    one = flexfem.Mechanism(
        name="leaf",
        thickness=4.0,
        material={
            "name": "steel",
            "youngs_modulus": 2e5,
            "poissons_ratio": 0.0,
            "density": 7.9,
            "yield_strength": 1e3,
        },
        body=[
            {"name": "ground", "outline": [(-9, -9), (0, -9), (0, 9), (-9, 9)], "fixed": True},
            {"name": "tip", "outline": [(100, -9), (115, -9), (115, 9), (100, 9)]},
        ],
        hinge=[{**leaf, "length": 100.0, "neck": 1.0}],
        output={"body": "tip", "at": (103.0, 0.0)},
    )
    angles = np.array([1.2, 2.4, 3.6])
    found = driven(model_of(one, 2), [2], angles[:, None])
    np.testing.assert_allclose(found.pose[:, 2], angles, rtol=1e-9)
    np.testing.assert_allclose(found.load[:, 2], 2e5 * 4 / 12 / 100 * angles, rtol=6e-3)


def test_a_load_without_equilibrium_is_said_with_its_units_and_direction():
    """The load is the one that moves the linear pivot by 9 mm along its softest translation, x or
    y.
    """
    pivot = flexfem.load(ROOT / "geometry/pivot.toml")
    compliance = flexfem.stiffness(pivot, models="analytic").at("compliance")[0]
    axis = int(np.argmax(np.diag(compliance)[:2]))
    asked = (
        f"the load was to grow to {9 / compliance[axis, axis]:.3g} N on output {'xy'[axis]}, "
        "expected a smaller"
    )
    with pytest.raises(ComputationFailed) as failed:
        flexfem.large(
            pivot, force=tuple(9 / compliance[axis, axis] * np.eye(3)[axis]), models="analytic"
        )
    said = re.match(r"no equilibrium beyond (\S+) N on output (\w): ", str(failed.value))
    assert said is not None and asked in str(failed.value)
    assert said[2] == "xy"[axis] and 0 < float(said[1]) < 9 / compliance[axis, axis]


def test_large_answers_by_both_models_with_bands_and_takes_forces_for_mechanisms_only(stage):
    mechanism = flexfem.load(ROOT / "geometry" / "parallelogram.toml")
    found = flexfem.large(mechanism, force=(3.0, 20.0, 100.0))
    fine = equilibria(model_of(mechanism, 6), np.append(found.force, np.zeros((4, 1)), axis=1))
    distance = np.abs(found.pose[:, 2] - fine.pose[:, :3]) / found.bands["pose"][:, 2]
    assert distance.max() < 1 and np.isnan(found.bands["pose"][:, :2]).all()
    np.testing.assert_allclose(found.pose[:, 1, 0], found.pose[:, 2, 0], rtol=0.02)
    assert found.pose[-1, 0, 0] / found.pose[-1, 1, 0] > 1.05  # pulled leaves are stiffer
    with pytest.raises(BadInput, match=r"force .*: not an option for a stage file"):
        flexfem.large(stage, force=(1.0, 0.0, 0.0))
