"""Plates without hinges: a cantilever strip against beam formulas and the elastica, and questions that need hinges."""

import numpy as np
import pytest

import flexfem
from flexfem.mechanism.mechanism import load_mechanism
from flexfem.refused import BadInput

E, NU, DENSITY = 70e3, 0.29, 2700.0  # MPa, 1, kg/m^3
LENGTH, HEIGHT, DEPTH = 60.0, 1.0, 4.0  # mm
STRIP = f"""
name = "cantilever strip"
thickness_mm = {DEPTH}
model = "plane_stress"
[material]
name = "a metal"
youngs_modulus_gpa = {E / 1e3}
poissons_ratio = {NU}
density_kg_m3 = {DENSITY}
yield_strength_mpa = 240
expansion_um_per_m_k = 23
[[body]]
name = "strip"
path_mm = [[0, 0], [{LENGTH}, 0]]
width_mm = {HEIGHT}
clamped_edges = [1]
[output]
body = "strip"
at_mm = [{LENGTH}, 0]
contact_mm = 0.8
"""
BEAM = 2e-3  # root effects of a clamped strip 60 heights long: about h / L squared, and nu at the clamp
CONTACT = 1e-2  # the motion is a mean over the half disc of 0.8 mm at the end, whose centroid is 0.34 mm inside
MODE = 3e-3  # Timoshenko's correction of the first mode of such a strip, and the root


@pytest.fixture(scope="module")
def strip(tmp_path_factory):
    path = tmp_path_factory.mktemp("strip") / "strip.toml"
    path.write_text(STRIP)
    return load_mechanism(path)


def bending_stiffness():
    return E * DEPTH * HEIGHT**3 / 12


def test_a_strip_without_hinges_has_the_stiffness_of_a_beam_by_default(strip):
    found = flexfem.stiffness(strip)
    assert found.axes["model"] == ("finite elements",)
    bending, shear = LENGTH**3 / (3 * bending_stiffness()), 1.2 * LENGTH / (E / (2 * (1 + NU)) * DEPTH * HEIGHT)
    assert found.at("free", direction="y")[0] == pytest.approx(1 / (bending + shear), rel=BEAM)
    assert found.at("free", direction="x")[0] == pytest.approx(E * DEPTH * HEIGHT / LENGTH, rel=CONTACT)
    assert sum("no hinges" in note for note in found.notes) == 1


def test_a_strip_without_hinges_sags_and_vibrates_as_a_beam_by_default(strip):
    weight = DENSITY * 1e-12 * 9806.65 * DEPTH * HEIGHT  # N/mm
    sag = flexfem.gravity(strip).internal.values["pose"][0, 0, 1]
    assert sag == pytest.approx(-weight * LENGTH**4 / (8 * bending_stiffness()), rel=BEAM)
    mass = DENSITY * 1e-12 * DEPTH * HEIGHT
    first = 1.87510407**2 / (2 * np.pi) * np.sqrt(bending_stiffness() / mass) / LENGTH**2
    assert flexfem.modes(strip, count=1).frequency[0, 0] == pytest.approx(first, rel=MODE)


def test_large_displacement_of_a_strip_is_that_of_the_elastica(strip):
    load = 2 * bending_stiffness() / LENGTH**2
    found = flexfem.large(strip, force=(0.0, load, 0.0))
    assert found.axes["theory"] == ("linear", "finite elements")
    pose = found.internal.values["pose"][-1]
    assert pose[0, 1] == pytest.approx(2 / 3 * LENGTH, rel=BEAM)
    # K. E. Bisshopp, D. C. Drucker, Quart. Appl. Math. 3 (1945) 272: P L^2 / (E I) = 2
    assert pose[1] == pytest.approx([-0.16064 * LENGTH, 0.49346 * LENGTH, 0.78175], rel=BEAM)


@pytest.mark.parametrize(
    ("ask", "needed"),
    [
        (lambda strip: flexfem.stiffness(strip, models="analytic"), "the analytic models need"),
        (lambda strip: flexfem.large(strip, models="analytic"), "the analytic models need"),
        (lambda strip: flexfem.budget(strip), "the analytic model needs whose error is split"),
        (lambda strip: flexfem.verification(strip.origin.path, output=None), "compared with finite elements"),
        (lambda strip: flexfem.life(strip, amplitude=(0.0, 0.1, 0.0)), "whose fatigue life"),
        (lambda strip: flexfem.as_built(strip, "necks.csv"), "whose necks are measured"),
        (lambda strip: flexfem.reach(strip), "no actuator"),
        (lambda strip: flexfem.drive(strip), "no actuator"),
    ],
)
def test_a_question_about_hinges_says_in_one_line_that_there_are_none(strip, ask, needed):
    with pytest.raises(BadInput, match=needed) as refusal:
        ask(strip)
    assert "strip.toml" in str(refusal.value)
    assert "\n" not in str(refusal.value)
