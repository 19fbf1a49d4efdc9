"""Plates without hinges: a cantilever strip against beam formulas and the elastica, and questions
that need hinges.
"""

import numpy as np
import pytest

import flexfem
from flexfem.mechanism.mechanism_file import load_mechanism
from flexfem.refused import BadInput

E = 70e3
NU = 0.29
DENSITY = 2700.0  # MPa, 1, kg/m^3
LENGTH = 60.0
HEIGHT = 1.0
DEPTH = 4.0  # mm
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
# root effects of a clamped strip 60 heights long: about h / L squared, and nu at the clamp
BEAM = 2e-3
# the motion is a mean over the half disc of 0.8 mm at the end, whose centroid is 0.34 mm inside
CONTACT = 1e-2
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
    bending = LENGTH**3 / (3 * bending_stiffness())
    shear = 1.2 * LENGTH / (E / (2 * (1 + NU)) * DEPTH * HEIGHT)
    assert found.at("free", direction="y")[0] == pytest.approx(1 / (bending + shear), rel=BEAM)
    assert found.at("free", direction="x")[0] == pytest.approx(
        E * DEPTH * HEIGHT / LENGTH, rel=CONTACT
    )
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
        (
            lambda strip: flexfem.verification(strip.origin.path, output=None),
            "compared with finite elements",
        ),
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


def plate_of(tmp_path, name, text, **numbers):
    path = tmp_path / f"{name}.toml"
    path.write_text(text.format(**numbers))
    return load_mechanism(path)


PLATE = """
name = "plate"
thickness_mm = 2
model = "plane_stress"
[material]
name = "a metal"
youngs_modulus_gpa = 70
poissons_ratio = 0.29
density_kg_m3 = 2700
yield_strength_mpa = 240
[[body]]
name = "plate"
outline_mm = {outline}
{holes}
clamped_edges = [{clamped}]
[output]
body = "plate"
at_mm = {at}
contact_mm = {contact}
"""
PETERSON = 0.015  # of Howland's factor, and of the stress at the finest mesh
WIDEST = 0.1  # band of a stress at a hole with 16 to 32 triangles around it
GUIDED = 0.03  # the root, and the guide at the end, which acts over the half disc
ROOT = 0.02  # of a beam's stress a quarter of its height from a clamped root


def test_the_highest_stress_of_a_strip_in_tension_is_at_its_hole(tmp_path):
    """Chart 4.1 of W. D. Pilkey, Peterson's stress concentration factors: a hole of 8 mm in a strip
    of 40 mm.
    """
    plate = plate_of(
        tmp_path,
        "hole",
        PLATE,
        outline="[[-60, -20], [70, -20], [70, 20], [-60, 20]]",
        holes="holes = [{centre_mm = [0, 0], radius_mm = 4}]",
        clamped=4,
        at="[60, 0]",
        contact=12,
    )
    found = flexfem.stiffness(plate, force=(1000.0, 0.0, 0.0))
    factor_on_net_section = 2.5065
    expected = factor_on_net_section * 1000 / (32 * 2)
    assert found.body_stress[0, 0] == pytest.approx(expected, rel=PETERSON)
    assert (
        abs(found.body_stress[0, 0] - expected)
        < found.band("body_stress")[0, 0]
        < WIDEST * expected
    )
    assert abs(found.body_x[0, 0]) < 0.8
    assert abs(found.body_y[0, 0]) == pytest.approx(4.0, abs=0.1)


def test_the_range_ends_at_the_first_yield_in_a_body_which_is_named(strip):
    found = flexfem.stiffness(strip, force=(0.0, 1.0, 0.0))
    section = DEPTH * HEIGHT**2 / 6
    at_root = (LENGTH - HEIGHT / 4) / section
    assert found.at("body_stress", body="strip")[0] == pytest.approx(at_root, rel=ROOT)
    assert abs(found.body_x[0, 0]) < HEIGHT
    # with the other directions held, the strip is guided: 6 E I d / L^2 at the root, over the
    # section modulus
    rate = 6 * bending_stiffness() / LENGTH**2 / section * (1 - 2 * HEIGHT / 4 / LENGTH)
    assert found.internal.values["yield_range"][0, 1] == pytest.approx(240 / rate, rel=ROOT)
    assert found.internal.values["yield_force"][0, 1] == pytest.approx(
        12 * bending_stiffness() / LENGTH**3 * 240 / rate, rel=GUIDED
    )
    assert any("y body strip at" in note for note in found.notes)


def test_corners_without_radius_are_left_out_and_named(tmp_path):
    outline = "[[0, 0], [10, 0], [10, 40], [60, 40], [60, 50], [0, 50]]"
    bracket = plate_of(
        tmp_path, "bracket", PLATE, outline=outline, holes="", clamped=1, at="[57, 45]", contact=1.5
    )
    found = flexfem.stiffness(bracket, force=(0.0, -10.0, 0.0))
    (warned,) = (text for text in found.warnings if "sharp in the drawing" in text)
    width = 2 * 1000 / 220  # twice the area over the perimeter
    assert f"plate within {width / 4:.3g} mm of (0, 0), (10, 0), (10, 40)" in warned
    x = found.body_x[0, 0]
    y = found.body_y[0, 0]
    assert min(np.hypot(x - a, y - b) for a, b in ((0, 0), (10, 0), (10, 40))) >= width / 4 - 1e-6
    rounded = outline.replace("[10, 40]", "[10, 40, 3]")
    smooth = plate_of(
        tmp_path, "smooth", PLATE, outline=rounded, holes="", clamped=1, at="[57, 45]", contact=1.5
    )
    (warned,) = (
        text for text in flexfem.stiffness(smooth).warnings if "sharp in the drawing" in text
    )
    assert "(10, 40)" not in warned


JAWS = (
    STRIP
    + """
[[body]]
name = "other jaw"
path_mm = [[0, 12], [50, 12]]
width_mm = 1.0
clamped_edges = [1]
[[point]]
name = "other tip"
body = "other jaw"
at_mm = [50, 12]
contact_mm = 0.8
[[point]]
name = "side"
body = "strip"
at_mm = [20, 0.25]
contact_mm = 0.8
[[point]]
name = "middle"
body = "strip"
at_mm = [30, 0]
contact_mm = 0.8
"""
)


@pytest.fixture(scope="module")
def jaws(tmp_path_factory):
    path = tmp_path_factory.mktemp("jaws") / "jaws.toml"
    path.write_text(JAWS)
    return load_mechanism(path)


def test_a_pair_of_forces_between_two_jaws_opens_both_as_cantilevers(jaws):
    found = flexfem.stiffness(
        jaws, force_at={"output": (0.0, -0.6, 0.0), "other tip": (0.0, 0.6, 0.0)}
    )
    moved = found.internal.values["pose"][0, :, 1]
    assert moved[0] == pytest.approx(-0.6 * LENGTH**3 / (3 * bending_stiffness()), rel=BEAM)
    assert moved[1] == pytest.approx(0.6 * 50.0**3 / (3 * bending_stiffness()), rel=BEAM)
    assert found.energy[0] == pytest.approx(0.3 * (moved[1] - moved[0]), rel=1e-9)
    stress = found.at("body_stress", model="finite elements")
    section = DEPTH * HEIGHT**2 / 6
    assert stress == pytest.approx(
        [0.6 * (LENGTH - 0.25) / section, 0.6 * (50.0 - 0.25) / section], rel=ROOT
    )


def test_a_load_and_a_stress_at_a_point_are_those_of_a_beam(jaws):
    found = flexfem.stiffness(jaws, force=(0.0, 0.2, 0.0), force_at=["middle=0,0.5 N,0"])
    by_load = 0.5 * 30.0**2 * (3 * LENGTH - 30.0) / 6 + 0.2 * LENGTH**3 / 3
    assert found.internal.values["pose"][0, 0, 1] == pytest.approx(
        by_load / bending_stiffness(), rel=BEAM
    )
    stress = found.at("point_stress", model="finite elements")
    names = found.axes["point"]
    moment = 0.2 * (LENGTH - 20.0) + 0.5 * (30.0 - 20.0)
    assert stress[names.index("side")] == pytest.approx(
        moment * 3 / (DEPTH * HEIGHT**2), rel=ROOT
    )  # halfway
    assert np.isnan(stress[names.index("output")])
    np.testing.assert_array_equal(found.point_load[names.index("middle")], [0.0, 0.5, 0.0])


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({"midle": (0, 1, 0)}, "did you mean middle"),
        (["middle=0,1"], "expected NAME=FX,FY,M"),
        (["middle=0,1 kg,0"], "expected a number in N"),
        ({"middle": (0, 1)}, r"expected \(3\)"),
    ],
)
def test_a_load_at_no_point_or_of_another_form_is_refused(jaws, stated, expected):
    with pytest.raises(BadInput, match=expected):
        flexfem.stiffness(jaws, force_at=stated)


def test_the_neighbourhood_of_a_loaded_point_is_left_out(tmp_path):
    """A couple on a disc of 3 mm stresses the disc most; the bending of the plate is a tenth of
    this.
    """
    text = PLATE + '[[point]]\nname = "pin"\nbody = "plate"\nat_mm = [20, 0]\ncontact_mm = 3\n'
    outline = "[[-60, -20], [70, -20], [70, 20], [-60, 20]]"
    plate = plate_of(
        tmp_path, "pin", text, outline=outline, holes="", clamped=4, at="[60, 0]", contact=2
    )
    found = flexfem.stiffness(plate, force_at={"pin": (0.0, 0.0, 1000.0)}, resolution=6)
    assert np.hypot(found.body_x[0, 0] - 20, found.body_y[0, 0]) >= 9.0
    bending = 1000.0 * 6 / (2 * 40**2)
    assert (
        bending < found.body_stress[0, 0] < 0.5 * 1000 * 2 / (np.pi * 3**3 * 2)
    )  # of a disc in torsion


def test_the_highest_stress_of_a_bent_bar_is_at_the_inside_of_its_bend(tmp_path):
    """A bar 4 mm high whose axis has a radius of 8 mm, under a moment: M (r_n - a) / (A e a) by E.
    Winkler (1858).
    """
    text = PLATE.replace(
        "outline_mm = {outline}", "path_mm = [[8, -20], [8, 8, 8], [-20, 8]]\nwidth_mm = 4"
    )
    bar = plate_of(tmp_path, "bend", text, holes="", clamped=1, at="[-18, 8]", contact=1.5)
    found = flexfem.stiffness(bar, force=(0.0, 0.0, 1000.0))
    inner = 6.0
    outer = 10.0
    section = 8.0
    neutral = (outer - inner) / np.log(outer / inner)
    expected = 1000.0 * (neutral - inner) / (section * (8.0 - neutral) * inner)
    assert found.body_stress[0, 0] == pytest.approx(expected, rel=ROOT)
    assert np.hypot(found.body_x[0, 0], found.body_y[0, 0]) == pytest.approx(inner, abs=0.02)


# of the stress by an independent mesh in plane stress, second order, of unknown refinement
INDEPENDENT = 0.02


def test_a_load_cell_has_its_stiffness_and_its_stress_in_the_neck_beside_the_hole(tmp_path):
    """A bar with two overlapping holes at 98.1 N: 75.87 N/mm and 840 MPa by an independent mesh in
    plane stress.
    """
    union = (
        "[[0, 4.4721359550], [1.7082039325, 6, 6], [10, 6, 6], [10, -6, 6], [1.7082039325, -6, "
        "6], [0, -4.4721359550], [-1.7082039325, -6, 6], [-10, -6, 6], [-10, 6, 6], "
        "[-1.7082039325, 6, 6]]"
    )
    text = (
        PLATE.replace("= 70\n", "= 73.1\n")
        .replace("0.29", "0.33")
        .replace("_mm = 2\n", "_mm = 12.7\n")
    )
    cell = plate_of(
        tmp_path,
        "cell",
        text,
        outline="[[-20, -6.35], [20, -6.35], [20, 6.35], [-20, 6.35]]",
        holes=f"holes = [{{outline_mm = {union}}}]",
        clamped=4,
        at="[19, 0]",
        contact=2,
    )
    found = flexfem.stiffness(cell, force=(0.0, 98.1, 0.0))
    assert found.at("free", direction="y")[0] == pytest.approx(75.87, rel=5e-4)  # both meshes
    assert found.body_stress[0, 0] == pytest.approx(840, rel=INDEPENDENT)
    assert [abs(found.body_x[0, 0]), abs(found.body_y[0, 0])] == pytest.approx([4.2, 6.0], abs=0.1)
