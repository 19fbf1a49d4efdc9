"""Parts of another material: series of bars, mass, yield, a bimetal strip and constrained
expansion, by hand.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexfem
from flexfem.analytic.finite import displaced
from flexfem.analytic.plates import inertia, modes, respond, thermal_response
from flexfem.fem import ports
from flexfem.fem.elements import mirrored
from flexfem.fem.export import write_plate_mesh
from flexfem.fem.nonlinear import driven
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.plate_symmetry import symmetry_of
from flexfem.mechanism.layout import Body, Constants, Joint, Layout, Patch
from flexfem.mechanism.outlines import polyline
from flexfem.mechanism.profiles import Leaf
from flexfem.questions.plates import parts_in
from flexfem.refused import BadInput

from ..tolerances import DENSE, SOLVED

B = 5.0
H = 4.0  # thickness and height of strips, mm
SOFT = Constants(2e3, 0.0, 1.1e-9, 40.0, expansion=70e-6, name="soft")
HARD = Constants(210e3, 0.0, 7.8e-9, 600.0, expansion=11e-6, name="hard")
LARGE = 0.05  # of a range whose end is not quite linear
ENDS = 0.01  # of the curvature of a bimetal strip: the mean over discs, and shear near its ends


def box(name, x0, x1, low, high, **more):
    corners = complex(x0, low), complex(x1, low), complex(x1, high), complex(x0, high)
    return Body(name, tuple(polyline(*corners, corners[0])), **more)


def layout_of(bodies, hinges, points, plate=SOFT):
    return Layout(tuple(bodies), tuple(hinges), B, *plate[:4], points, expansion=plate.expansion)


def strip(*materials, plate=SOFT):
    """Ground, a leaf 10 mm long, and a body 30 mm long, all 4 mm high, in a row along x."""
    leaf, body = materials
    bodies = [
        box("ground", -20, 0, -H / 2, H / 2, fixed=True),
        box("bar", 10, 40, -H / 2, H / 2, material=body),
    ]
    joint = Joint("leaf", (0, 1), 5 + 0j, 0.0, Leaf(H, 10.0), H, material=leaf)
    return layout_of(bodies, [joint], (("output", Patch(1, 25 + 0j)),), plate)


@pytest.mark.parametrize("layers", [None, mirrored(B, 2, H)], ids=["plane", "solid"])
def test_bars_in_series_stretch_each_by_its_modulus(layers):
    """Without contraction: L / (E A) of the leaf and L / (3 E A), the mean of a bar under a body
    force, of the body.
    """
    layout = strip(SOFT, HARD)
    found = ports.plate_response(layout, mesh_layout(layout, 2), layers).compliance[0, 0]
    area = B * H
    assert found == pytest.approx(10 / (2e3 * area) + 30 / (3 * 210e3 * area), rel=SOLVED)
    assert respond(layout).compliance[0, 0] == pytest.approx(10 / (2e3 * area), rel=DENSE)
    swapped = strip(HARD, SOFT)
    found = ports.plate_response(swapped, mesh_layout(swapped, 2), layers).compliance[0, 0]
    assert found == pytest.approx(10 / (210e3 * area) + 30 / (3 * 2e3 * area), rel=SOLVED)


def with_own(layout):
    """The same plate whose parts all state its material."""
    own = layout.material_of(layout.bodies[0])
    bodies = tuple(body._replace(material=own) for body in layout.bodies)
    return layout._replace(
        bodies=bodies, joints=tuple(joint._replace(material=own) for joint in layout.joints)
    )


@pytest.mark.parametrize("layers", [None, mirrored(B, 2, H)], ids=["plane", "solid"])
def test_parts_that_state_the_material_of_the_plate_change_nothing(layers):
    """By another way through the elements: their constants are arrays."""
    steel = Constants(210e3, 0.29, 7.8e-9, 600.0, expansion=11e-6)
    one = strip(None, None, plate=steel)
    other = with_own(one)
    assert other.mixed and not one.mixed
    mesh = mesh_layout(one, 2)
    models = [ports.plate_model(each, mesh, layers) for each in (one, other)]
    first, second = (model.response() for model in models)
    assert second.compliance == pytest.approx(first.compliance, rel=SOLVED, abs=1e-12)
    first, second = (ports.plate_modes(model, 3).frequencies for model in models)
    assert second == pytest.approx(first, rel=SOLVED)
    rates = np.full(3, 11e-6)
    first = ports.thermal_response(models[0], 11e-6, 25e-6)
    second = ports.thermal_response(models[1], 11e-6, 25e-6, rates)
    assert second.motions == pytest.approx(first.motions, rel=SOLVED, abs=1e-12)
    if layers is None:
        pushed = [driven(model, [1], np.array([[3.0]])).load for model in models]
        assert pushed[1] == pytest.approx(pushed[0], rel=SOLVED, abs=1e-6)
        parts = [parts_in(each, mesh) for each in (one, other)]
        assert parts[1].hinges == pytest.approx(parts[0].hinges, rel=SOLVED, abs=1e-12)


def test_the_mass_of_a_body_is_that_of_its_material():
    """A heavy body on a leaf without mass: four times the density, half the frequency, in both
    models.
    """
    light = HARD._replace(density=1e-15)
    frequencies = []
    for heavy in (HARD, HARD._replace(density=4 * HARD.density)):
        layout = strip(light, heavy)
        of_elements = ports.plate_modes(
            ports.plate_model(layout, mesh_layout(layout, 1)), 1
        ).frequencies[0]
        frequencies.append((modes(layout).frequencies[0], of_elements))
    assert np.divide(*frequencies) == pytest.approx([2, 2], rel=1e-6)
    _, mass = inertia(strip(SOFT, HARD), lumped=True)
    assert mass[0, 0] == pytest.approx(B * H * (30 * 7.8e-9 + 5 * 1.1e-9), rel=DENSE)


@pytest.mark.slow
def test_a_bimetal_strip_bends_by_timoshenko():
    """A body 0.6 mm thick, and on it a hinge and a body, together 1.4 mm, of another modulus and
    expansion.

    S. Timoshenko, J. Opt. Soc. Am. 11, 233 (1925): with m and n the ratios of thickness and
    modulus, the curvature is 6 (a2 - a1) (1 + m)^2 / (h (3 (1 + m)^2 + (1 + m n) (m^2 + 1 / (m
    n))))."""
    first = Constants(70e3, 0.33, 2.7e-9, 300.0, expansion=23e-6)
    second = Constants(140e3, 0.33, 8e-9, 300.0, expansion=9e-6, name="second")
    bodies = [
        box("first", 0, 60, -0.6, 0, clamped=(3,)),
        box("second", 0, 60, 0.7, 1.4, material=second),
    ]
    joint = Joint("bond", (0, 1), 30 + 0.35j, np.pi / 2, Leaf(60.0, 0.7), 60.0, material=second)
    points = tuple((f"at {x}", Patch(0, complex(x, -0.3), 0.3)) for x in (20, 40))
    layout = layout_of(bodies, [joint], points, first)
    model = ports.plate_model(layout, mesh_layout(layout, 16))
    rates = np.array([23e-6, 9e-6, 9e-6])
    motions = ports.thermal_response(model, 23e-6, 23e-6, rates).motions
    m = 0.6 / 1.4
    n = 70e3 / 140e3
    curvature = (
        6
        * (23e-6 - 9e-6)
        * (1 + m) ** 2
        / (2.0 * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
    )
    assert motions[5, 0] - motions[2, 0] == pytest.approx(20 * curvature, rel=ENDS)


def held_row():
    """Ground, leaf, bar, leaf, ground in a row, 4 mm high; the leaves 10 mm long, the bar 30 mm."""
    row = strip(HARD, None)
    bodies = [*row.bodies, box("wall", 50, 70, -H / 2, H / 2, fixed=True)]
    last = row.joints[0]._replace(name="last", bodies=(1, 2), place=45 + 0j)
    return row._replace(bodies=tuple(bodies), joints=(row.joints[0], last))


def test_a_row_between_walls_moves_by_all_its_expansions():
    """By hand: the force closes the row, and the bar moves by what is left of it. Without
    contraction it is exact.

    Leaves of 10 mm, hard and soft, the bar of 30 mm soft; the walls expand by 5e-6 / K.
    """
    layout = held_row()
    layout = layout._replace(joints=(layout.joints[0], layout.joints[1]._replace(material=SOFT)))
    rates = np.array([one.expansion for one in layout.materials])
    found = ports.thermal_response(
        ports.plate_model(layout, mesh_layout(layout, 2)), 70e-6, 5e-6, rates
    )
    missing = 50 * 5e-6 - (10 * 11e-6 + 40 * 70e-6)
    stress = missing / (10 / 210e3 + 40 / 2e3)
    expected = 10 * 11e-6 + 15 * 70e-6 + stress * (10 / 210e3 + 15 / 2e3)
    assert found.motions[0, 0] == pytest.approx(expected, rel=SOLVED)
    motions, wrenches = thermal_response(layout, 70e-6, 5e-6, of_parts=rates)
    stress = missing / (10 / 210e3 + 10 / 2e3)  # of a rigid bar
    assert wrenches[:, 0, 0] == pytest.approx([stress * B * H] * 2, rel=DENSE)
    assert motions[0, 0] == pytest.approx(10 * 11e-6 + 15 * 70e-6 + stress * 10 / 210e3, rel=DENSE)


@pytest.mark.parametrize("layers", [None, mirrored(B, 2, H)], ids=["plane", "solid"])
def test_parts_that_all_expand_as_the_walls_are_free_of_stress(layers):
    """Whatever the expansion of the plate, which no part has: 20e-6 against 70e-6."""
    layout = held_row()
    rates = np.full(5, 20e-6)
    found = ports.thermal_response(
        ports.plate_model(layout, mesh_layout(layout, 2), layers), 70e-6, 20e-6, rates
    )
    assert found.motions[0, 0] == pytest.approx(25 * 20e-6, rel=SOLVED)
    assert (
        np.abs(ports.warm_stress(found, 0.0, rates[3:] - 70e-6)[0]).max() < SOLVED * 210e3 * 50e-6
    )


def test_beams_of_two_materials_begin_with_the_compliance_of_the_network():
    layout = held_row()._replace(points=(("output", Patch(1, 25 + 3j)),))
    layout = layout._replace(joints=(layout.joints[0], layout.joints[1]._replace(material=SOFT)))
    C = respond(layout).compliance
    small = np.diag([1.0, 0.1, 1.0])
    assert displaced(layout, small).motions == pytest.approx(small @ C, rel=1e-4, abs=1e-9)


def test_an_image_of_another_material_is_no_image():
    """A row of equal leaves turns by half a turn into itself, one of unlike leaves only mirrors its
    upper half.
    """
    layout = held_row()
    (turn,) = symmetry_of(layout)
    assert not turn.mirrored
    (mirror,) = symmetry_of(
        layout._replace(joints=(layout.joints[0], layout.joints[1]._replace(material=SOFT)))
    )
    assert mirror.mirrored and mirror(25 + 1j) == pytest.approx(25 - 1j)


def test_a_deck_has_a_section_for_every_material(tmp_path):
    layout = strip(SOFT, HARD)
    write_plate_mesh(mesh_layout(layout, 1), layout, tmp_path / "row.inp")
    lines = (tmp_path / "row.inp").read_text().splitlines()
    elastic = [lines[k + 1] for k, line in enumerate(lines) if line == "*ELASTIC"]
    assert elastic == ["2000, 0", "210000, 0"]
    assert sum(line.startswith("*SOLID SECTION") for line in lines) == 2


STEEL = (
    'material = {name = "s", youngs_modulus_gpa = 200, poissons_ratio = 0.3, density_kg_m3 = 7800, '
    "yield_strength_mpa = 100}"
)
TEXT = """
name = "linked"
thickness_mm = 8
model = "plane_stress"
material = {name = "al-7075-t6"}
output = {body = "tip", at_mm = [30, 0]}
body = [{name="ground", fixed=true, outline_mm=[[-9, -4], [0, -4], [0, 4], [-9, 4]]},
{name="link", outline_mm=[[8, -4], [20, -4], [20, 4], [8, 4]]},
{name="tip", outline_mm=[[28, -4], [40, -4], [40, 4], [28, 4]]}]
[[hinge]]
name = "root"
between = ["ground", "link"]
at_mm = [4, 0]
direction_deg = 0
shape = "leaf"
length_mm = 8
neck_mm = 0.5
fillet_mm = 0.5
[[hinge]]
name = "end"
between = ["link", "tip"]
at_mm = [24, 0]
direction_deg = 0
shape = "leaf"
length_mm = 8
neck_mm = 0.5
fillet_mm = 0.5
"""


def written(tmp_path, old="", new=""):
    (tmp_path / "linked.toml").write_text(TEXT.replace(old, new, 1))
    return tmp_path / "linked.toml"


def test_a_file_states_materials_of_parts_by_name_or_by_numbers(tmp_path):
    plain = flexfem.load(written(tmp_path))
    named = flexfem.load(written(tmp_path, 'name="link",', 'name="link", material="steel-304",'))
    link = named.layout.bodies[1].material
    assert (link.youngs_modulus, link.density) == pytest.approx((193e3, 8e-9), rel=0.02)
    assert not any("material" in key for key in named.not_stated)
    assert named.hash != plain.hash
    assert named.layout.joints[0].material is None
    again = flexfem.Mechanism(**named.model_dump(exclude_unset=True, exclude_none=True))
    assert again.hash == named.hash
    hinge = flexfem.load(written(tmp_path, 'name = "end"', f'name = "end"\n{STEEL}')).layout.joints[
        1
    ]
    assert hinge.material[:4] == pytest.approx((200e3, 0.3, 7.8e-9, 100.0))


REFUSED = [
    (
        '"steal-304"',
        'line 7: body.link.material = "steal-304", expected a registered material (steel-304',
    ),
    ('{name = "x", youngs_modulus_gpa = -1}', "line 7: body.link.material."),
]


@pytest.mark.parametrize(("material", "said"), REFUSED)
def test_a_material_of_a_part_that_is_not_known_is_refused(material, said, tmp_path):
    with pytest.raises(BadInput, match=re.escape(said)):
        flexfem.load(written(tmp_path, 'name="link",', f'name="link", material={material},'))


@pytest.mark.parametrize("models", ["analytic", pytest.param("elements", marks=pytest.mark.slow)])
def test_the_range_ends_at_the_yield_strength_of_the_hinge_that_yields(models, tmp_path):
    """With a tenth of the strength, 503 MPa, the hinge at the end yields first, not that at the
    root.

    A force along y at 30 mm bends the roots of the fillets at 0.5 and 20.5 mm most, with arms of
    29.5 and 9.5 mm."""
    al = 'material = {name = "al", youngs_modulus_gpa = 71.7, poissons_ratio = 0.33, density_kg_m3 = 2810, '
    reached = []
    for strength in (503.0, 50.3):
        weak = f'name = "end"\n{al}yield_strength_mpa = {strength}}}'
        mechanism = flexfem.load(written(tmp_path, 'name = "end"', weak))
        found = flexfem.stiffness(mechanism, models=models, plane=models == "elements")
        reached.append(found.values["free_yield_range"][-1, 1])
        if strength < 503.0:
            assert found.values["range"][1, 0, 1] == pytest.approx(reached[-1], rel=LARGE)
            assert found.values["range_stress"][1, 0, :, 1].max() == pytest.approx(
                50.3 * 29.5 / 9.5, rel=LARGE
            )
    assert reached[1] / reached[0] == pytest.approx(0.1 * 29.5 / 9.5, rel=0.02)


def test_drift_of_another_material_needs_its_expansion(tmp_path):
    with pytest.raises(BadInput, match=r"link\.material\.expansion_um_per_m_k is missing"):
        flexfem.drift(
            flexfem.load(written(tmp_path, 'name="link",', f'name="link", {STEEL},')),
            models="analytic",
        )
