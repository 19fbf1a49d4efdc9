"""Stiffness and frequencies under axial loads, preloads and residual stress, against exact
solutions of beams.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

import flexfem

E = 155_000.0
NU = 0.23
DENSITY = 2330.0
B = 2.0  # MPa, kg/m^3, mm
T = 0.2
L = 20.0  # mm, of a leaf or a strip
BENDING = E * B * T**3 / 12
AXIAL = E * B * T  # N mm^2, N
PLANE = 2e-3  # relative: shear of a slender leaf, eight beams, and the mesh
ROOTS = 1.5e-2  # relative: leaves clamped in elastic bodies
STRIP = 3e-3  # of a frequency: clamped ends that do not contract, and shear


BOTH = ["analytic", pytest.param("elements", marks=pytest.mark.slow)]


def material(residual=None):
    stated = {
        "name": "m",
        "youngs_modulus": E,
        "poissons_ratio": NU,
        "density": DENSITY,
        "yield_strength": 1200.0,
    }
    return stated | ({} if residual is None else {"residual_stress": residual})


def strip(residual=None):
    """A strip of one width between two clamped edges."""
    return flexfem.Mechanism(
        name="strip",
        thickness=B,
        model="plane_stress",
        material=material(residual),
        body=[
            {"name": "strip", "outline": [(0, 0), (L, 0), (L, T), (0, T)], "clamped_edges": [2, 4]}
        ],
        output={"body": "strip", "at": (L / 2, T / 2)},
    )


def clamped_frequency(tension):
    """First frequency, Hz, of a beam clamped at both ends under a tension, N: root of the exact
    equation.
    """
    mass = DENSITY * 1e-12 * B * T  # tonne/mm

    def determinant(w):
        half = tension / (2 * BENDING)
        root = np.sqrt(half**2 + mass * w**2 / BENDING)
        a = np.sqrt(root + half)
        b = np.sqrt(root - half)
        first = 2 * a * b * (1 / np.cosh(a * L) - np.cos(b * L))
        return first + (a**2 - b**2) * np.tanh(a * L) * np.sin(b * L)

    string = np.pi / L * np.sqrt(max(tension, 0.0) / mass)
    beam = 4.73004**2 / L**2 * np.sqrt(BENDING / mass)
    above = np.linspace(0.3 * beam, 1.5 * (beam + string), 200)
    values = [determinant(w) for w in above]
    first = next(k for k in range(199) if values[k] * values[k + 1] < 0)
    return brentq(determinant, above[first], above[first + 1]) / 2 / np.pi


@pytest.mark.parametrize(
    "residual", [60.0, *(pytest.param(stress, marks=pytest.mark.slow) for stress in (None, -15.0))]
)
def test_a_clamped_strip_with_residual_stress_vibrates_as_a_beam_under_tension(residual):
    """The stress that both clamped ends leave along the strip is s (1 - nu)."""
    tension = (residual or 0.0) * (1 - NU) * B * T
    found = flexfem.modes(strip(residual), count=1, models="elements", resolution=4)
    assert found.frequency[0, -1] == pytest.approx(clamped_frequency(tension), rel=STRIP)


def test_tension_of_sixty_megapascals_raises_the_frequency_of_the_strip():
    """By hand, of a beam without tension: 4.73004^2 / (2 pi) * sqrt(E / (12 rho)) * T / L^2 =
    4191.6 Hz.
    """
    assert clamped_frequency(0.0) == pytest.approx(4191.6, rel=1e-4)
    assert clamped_frequency(60.0 * (1 - NU) * B * T) > 1.3 * 4191.6


def leaf(actuator=None, residual=None):
    """A leaf along x from a fixed body, with an actuator that pulls its end if stated."""
    return flexfem.Mechanism(
        name="leaf",
        thickness=B,
        model="plane_stress",
        material=material(residual),
        body=[
            {"name": "base", "path": [(-8, 0), (0, 0)], "width": 8, "fixed": True},
            {"name": "top", "path": [(L, 0), (L + 4, 0)], "width": 5},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ("base", "top"),
                "at": (L / 2, 0),
                "direction": 0.0,
                "shape": "leaf",
                "neck": T,
                "length": L,
            }
        ],
        output={"body": "top", "at": (L, 0)},
        **({} if actuator is None else {"actuator": [actuator]}),
    )


def pull(force):
    """Actuator between a ground at the left and the end of the leaf, which pushes it to the right."""
    return {
        "name": "drive",
        "between": ("ground", "top"),
        "at": [(-20, 0), (L, 0)],
        "contact": 1.0,
        "stroke": 0.01,
        "stiffness": 20_000.0,
        "preload": force,
    }


def lateral(force):
    """Lateral stiffness, N/mm, of a clamped leaf under a dead tension, N, at its free end."""
    k = np.sqrt(abs(force) / BENDING)
    if force > 0:
        return force / (L - np.tanh(k * L) / k)
    return -force / (np.tan(k * L) / k - L)


@pytest.mark.parametrize("models", BOTH)
@pytest.mark.parametrize("force", [25.0, -0.9])
def test_the_tangent_of_a_leaf_under_tension_and_compression_is_exact(models, force):
    found = flexfem.stiffness(
        leaf(),
        force=(force, 0.0, 0.0),
        tangent=True,
        models=models,
        **({"resolution": 4} if models != "analytic" else {}),
    )
    expected = lateral(force)
    at_rest = 3 * BENDING / L**3
    assert found.free[-1, 1] == pytest.approx(expected, rel=PLANE if force > 0 else 2 * PLANE)
    assert abs(expected / at_rest - 1) > 0.4  # so that the load matters


@pytest.mark.parametrize("models", BOTH)
def test_the_preload_of_an_actuator_is_a_load_along_its_line(models):
    options = {"models": models} | ({"resolution": 4} if models != "analytic" else {})
    found = flexfem.stiffness(leaf(pull(25.0)), **options)
    assert found.free[-1, 1] == pytest.approx(lateral(25.0), rel=PLANE)
    assert "25 N on drive" in found.settings["preload"]


def guide(residual=None):
    """A plate on four leaves between two fixed bodies, as a film resonator."""
    half = L + 3.0
    leaves = [
        {
            "name": f"leaf {number}",
            "between": ("plate", where),
            "at": (x, sign * (3.0 + L / 2)),
            "direction": sign * np.pi / 2,
            "shape": "leaf",
            "neck": T,
            "length": L,
        }
        for number, (x, sign, where) in enumerate(
            [(-8, 1, "upper"), (8, 1, "upper"), (-8, -1, "lower"), (8, -1, "lower")]
        )
    ]
    return flexfem.Mechanism(
        name="guide",
        thickness=B,
        model="plane_stress",
        material=material(residual),
        body=[
            {"name": "plate", "outline": [(-10, -3), (10, -3), (10, 3), (-10, 3)]},
            {"name": "upper", "path": [(-12, half + 2), (12, half + 2)], "width": 4, "fixed": True},
            {
                "name": "lower",
                "path": [(-12, -half - 2), (12, -half - 2)],
                "width": 4,
                "fixed": True,
            },
        ],
        hinge=leaves,
        output={"body": "plate", "at": (0, 0)},
    )


@pytest.mark.slow
def test_frequencies_of_both_models_follow_the_residual_stress_of_guided_leaves():
    """The plate shrinks, too: leaves of 2 L are stretched by a length of 2 L + 6 mm."""
    residual = 30.0
    tension = residual * (1 - NU) * B * T * (2 * L + 6.0) / (2 * L)
    half = np.sqrt(tension / BENDING) * L / 2
    ratio = tension / L * half / (half - np.tanh(half)) / (12 * BENDING / L**3)
    options = {"count": 1, "resolution": 4}
    loose, tight = (flexfem.modes(guide(stress), **options) for stress in (None, residual))
    raised = [
        float(
            tight.at("frequency", mode="1", model=model)
            / loose.at("frequency", mode="1", model=model)
        )
        for model in ("analytic", "finite elements")
    ]
    np.testing.assert_allclose(raised, np.sqrt(ratio), rtol=ROOTS)
    assert raised[0] == pytest.approx(np.sqrt(ratio), rel=PLANE)
    assert ratio > 1.5


@pytest.mark.slow
def test_frequencies_in_three_dimensions_follow_the_residual_stress_in_and_out_of_the_plane():
    """A strip as high as it is thick has one frequency in and out of the plane, under tension, too."""
    square = strip(60.0).replace(thickness=T, model="three_dimensional")
    found = flexfem.modes(square, count=1, models="elements", resolution=4)
    expected = clamped_frequency(60.0 * (1 - NU) * B * T)  # independent of the thickness
    np.testing.assert_allclose(
        found.at("frequency", model="three dimensions"), expected, rtol=2 * STRIP
    )
    assert float(found.first_out_of_plane) == pytest.approx(expected, rel=2 * STRIP)


def test_frequencies_under_a_static_load_fall_to_zero_towards_buckling():
    critical = np.pi**2 * BENDING / (4 * L**2)
    options = {"count": 1, "models": "analytic"}
    at_rest = float(flexfem.modes(leaf(), **options).frequency[0, 0])
    near = float(
        flexfem.modes(leaf(), **options, force=(-0.99 * critical, 0.0, 0.0)).frequency[0, 0]
    )
    assert near < 0.15 * at_rest
    with pytest.raises(flexfem.ComputationFailed, match="buckles"):
        flexfem.modes(leaf(), **options, force=(-1.05 * critical, 0.0, 0.0))


def test_other_questions_say_that_they_do_not_contain_the_residual_stress():
    found = flexfem.reach(leaf(pull(25.0)), models="analytic")
    assert any("without the residual stress and the preloads" in text for text in found.warnings)
    assert not any(
        "residual stress" in text
        for text in flexfem.reach(leaf(pull(0.0)), models="analytic").warnings
    )


def test_preloads_that_are_not_possible_are_refused():
    with pytest.raises(flexfem.BadInput, match=r"preload.*at most the blocking force"):
        leaf(pull(1e4))
    with pytest.raises(flexfem.BadInput, match="tangent, expected force or force_at"):
        flexfem.stiffness(leaf(), tangent=True, models="analytic")
