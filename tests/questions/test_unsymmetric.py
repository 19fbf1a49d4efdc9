"""Every question about a mechanism without symmetry, against a network that is written out slowly
without flexfem.

Literal numbers are those of `slow_network`. Values are read in internal units: N, mm, rad, tonne
and s."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh

import flexfem
from flexfem.analytic.finite import displaced
from flexfem.design.model import Model
from flexfem.design.requirements import load_requirements
from flexfem.fem.elements import Plate
from flexfem.fem.ports import hinge_stress, plate_modes, plate_of_layout
from flexfem.paper.stage_mesh import layers_of
from flexfem.plot.plate import plot_plate
from flexfem.questions import plates
from flexfem.questions.check import check
from flexfem.questions.errors import errors_of
from flexfem.questions.plates import value_bands
from flexfem.study.loaded import load_study

from ..conftest import ROOT
from ..tolerances import DENSE, SOLVED
from .slow_network import BODIES, INCH, SlowNetwork, bodies_drawn

FILE = ROOT / "tests/baselines/mechanisms/unsymmetric.toml"
QUADRATURE = 1e-8  # relative, of adaptive integrals over each hinge
SAMPLED = 2e-4  # relative, of the highest stress at sections
DRAWN = 1e-5  # relative, of masses whose arcs are polygons on either side
SMALL = 1e-4
LINEAR = 1e-5  # of a load of some newtons; its displacement is linear to 3e-6 of the largest
FORCE = np.array([1.0, -2.0, 30.0])
POSE = np.array([0.005, -0.002, 5e-4])
LEVER = (
    math.hypot(0.605 - 0.05, 0.1 + 0.08) * INCH
)  # from the output to the coupler; 14.82 mm, 8.05 mm to the nearest
COARSE = 3  # triangles across every neck


@pytest.fixture(scope="module")
def mechanism():
    return flexfem.load(FILE)


@pytest.fixture(scope="module")
def slow():
    return SlowNetwork()


def analytic(question, mechanism, **options):
    """Values of the network with rigid bodies, with the axis of models in its place."""
    return question(mechanism, models="analytic", **options)


def test_the_mirror_image_of_a_turned_copy_is_where_both_moves_take_it(mechanism, slow):
    """Leg 2 is the first one turned by -30 degrees to 75; the line at 8 degrees takes it to 16 - 75
    = -59 degrees.
    """
    joints = {joint.name: joint for joint in mechanism.layout.joints}
    assert list(joints) == [hinge.name for hinge in slow.hinges]
    for hinge in slow.hinges:
        assert joints[hinge.name].place == pytest.approx(hinge.centre, abs=1e-9)
        assert np.exp(1j * joints[hinge.name].heading) == pytest.approx(hinge.axis, abs=1e-9)
    assert math.degrees(joints["tip 3"].heading) == pytest.approx(-59.0)
    assert joints["root 3"].place == pytest.approx(14.2797 - 23.1630j, abs=1e-4)


def test_stiffness_amplification_and_stress_are_those_of_the_slow_network(mechanism, slow):
    found = analytic(flexfem.stiffness, mechanism, force=tuple(FORCE)).internal.values
    C = slow.compliance()
    K = np.linalg.inv(C[:3, :3])
    np.testing.assert_allclose(found["stiffness"][0], K, rtol=QUADRATURE)
    np.testing.assert_allclose(found["free"][0], 1 / np.diag(C)[:3], rtol=QUADRATURE)
    np.testing.assert_allclose(found["free"][0], [18770.467, 108290.54, 556240.59], rtol=1e-6)
    np.testing.assert_allclose(found["input_stiffness"][:, 0], 1 / np.diag(C)[9:], rtol=QUADRATURE)
    np.testing.assert_allclose(
        found["amplification"][:, 0], C[:3, 9:].T / np.diag(C)[9:, None], rtol=10 * QUADRATURE
    )
    np.testing.assert_allclose(found["pose"][0].ravel(), C[:9, :3] @ FORCE, rtol=10 * QUADRATURE)
    assert found["energy"][0] == pytest.approx(FORCE @ C[:3, :3] @ FORCE / 2, rel=QUADRATURE)
    under = slow.under(slow.output.T @ FORCE)
    np.testing.assert_allclose(found["hinge_stress"][0], slow.stress(under), rtol=SAMPLED)
    held = np.array([slow.stress(slow.held_at(unit)) for unit in np.eye(3)])
    np.testing.assert_allclose(found["stress"][0].T, held, rtol=SAMPLED)
    np.testing.assert_allclose(found["yield_range"][0], 503 / held.max(axis=1), rtol=SAMPLED)
    np.testing.assert_allclose(
        found["yield_force"][0], np.diag(K) * 503 / held.max(axis=1), rtol=SAMPLED
    )


def test_each_actuator_moves_the_output_and_opens_the_other_one(mechanism, slow):
    """The second column of a table of openings is not its second row: 2.8 and 5.0 % of unlike
    strokes.
    """
    found = analytic(flexfem.drive, mechanism).internal.values
    for k, other in ((0, 1), (1, 0)):
        strokes = slow.STROKES * (np.arange(2) == k)
        u = slow.driven(strokes)
        stroke = slow.STROKES[k]
        motion = slow.ports[:9] @ u
        opening = slow.openings @ u
        np.testing.assert_allclose(found["motion"][k].ravel(), motion, rtol=10 * QUADRATURE)
        np.testing.assert_allclose(
            found["transmission"][k, 0], motion[:3] / stroke, rtol=10 * QUADRATURE
        )
        assert found["used"][k, 0] == pytest.approx(100 * opening[k] / stroke, rel=QUADRATURE)
        assert found["coupling"][k, other, 0] == pytest.approx(
            100 * opening[other] / stroke, rel=10 * QUADRATURE
        )
        assert found["force"][k, 0] == pytest.approx(
            slow.SPRINGS[k] * (stroke - opening[k]), rel=QUADRATURE
        )
        np.testing.assert_allclose(found["stress"][k, 0], slow.stress(u), rtol=SAMPLED)
        assert found["cross"][k, 0] == pytest.approx(
            100 * motion[1] / motion[0], rel=10 * QUADRATURE
        )
        assert found["rotation"][k, 0] == pytest.approx(motion[2] / motion[0], rel=10 * QUADRATURE)
    assert found["coupling"][[0, 1], [1, 0], 0] == pytest.approx([-2.791249, -5.024248], rel=1e-6)
    engaged = np.linalg.inv(slow.output @ slow.under(slow.output.T, slow.SPRINGS))
    np.testing.assert_allclose(found["engaged"][0], np.diag(engaged), rtol=10 * QUADRATURE)


def test_the_first_actuator_alone_at_twice_its_stroke_doubles_its_own_stress(mechanism):
    """With the blocking force doubled too, which keeps its stiffness."""
    stronger = mechanism.replace(actuator={"first": {"stroke": 24e-3, "blocking_force": 600.0}})
    before, after = (
        analytic(flexfem.drive, one).internal.values["stress"] for one in (mechanism, stronger)
    )
    np.testing.assert_allclose(after[0], 2 * before[0], rtol=DENSE)
    np.testing.assert_allclose(after[1], before[1], rtol=DENSE)


def test_actuators_answer_each_other_alike_and_their_work_is_the_energy_of_the_hinges(
    mechanism, slow
):
    """Reciprocity: the second opens by a stroke of the first times k1 as the first by one of the
    second times k2.
    """
    found = flexfem.drive(mechanism, resolution=4).internal.values
    k = slow.SPRINGS
    s = slow.STROKES
    coupling = found["coupling"][:, :, :2] / 100  # of the networks, which are linear
    np.testing.assert_allclose(coupling[0, 1] * k[1], coupling[1, 0] * k[0], rtol=SOLVED)
    for network in (plates.network(mechanism), plates.network(mechanism, elastic=True)):
        C = network.compliance
        size = np.sqrt(np.diag(network.compliance))
        np.testing.assert_allclose(C / np.outer(size, size), C.T / np.outer(size, size), atol=DENSE)
    C = plates.solved(mechanism, COARSE).motions
    size = np.sqrt(np.diag(C))
    np.testing.assert_allclose(C / np.outer(size, size), C.T / np.outer(size, size), atol=SOLVED)
    u = slow.driven(s)
    pairs = zip(slow.hinges, slow.wrenches(u), strict=True)
    stored = sum(float(w @ (hinge.compliance * w)) / 2 for hinge, w in pairs)
    together = np.array(
        [found["used"][j, 0] / 100 * s[j] + coupling[1 - j, j, 0] * s[1 - j] for j in range(2)]
    )
    assert float(k * (s - together) @ together) / 2 == pytest.approx(stored, rel=10 * QUADRATURE)


def test_finite_elements_answer_as_the_network_of_elastic_parts(mechanism):
    """And as their compliance says: the drive, whose springs are written out, and the lever of
    errors.
    """
    rest = flexfem.stiffness(mechanism, resolution=4).internal.values
    np.testing.assert_allclose(rest["free"][1], rest["free"][2], rtol=0.05)
    assert np.all(rest["free"][0] > 1.2 * rest["free"][2]), (
        "stout notches are as stiff as the bodies"
    )
    weak = {
        "first": {"stroke": 12e-6, "blocking_force": 0.3},
        "second": {"stroke": 20e-6, "blocking_force": 0.9},
    }
    C = plates.solved(mechanism, 4).compliance
    small = mechanism.replace(actuator=weak)
    found = flexfem.drive(small, resolution=4).internal.values
    Y = np.linalg.inv(np.diag([1 / 25e3, 1 / 45e3]) + C[9:, 9:])
    strokes = np.diag([12e-6, 20e-6])
    np.testing.assert_allclose(
        found["motion"][:, :, 2].reshape(2, 9), (C[:9, 9:] @ Y @ strokes).T, rtol=10 * SOLVED
    )
    opened = 100 * C[9:, 9:] @ Y
    np.testing.assert_allclose(found["used"][:, 2], np.diag(opened), rtol=SOLVED)
    np.testing.assert_allclose(
        found["coupling"][[0, 1], [1, 0], 2], [opened[1, 0], opened[0, 1]], rtol=SOLVED
    )


def test_natural_frequencies_have_the_payload_and_the_masses_of_actuators(mechanism, slow):
    for drives, springs in (("disengaged", (0.0, 0.0)), ("engaged", slow.SPRINGS)):
        found = analytic(flexfem.modes, mechanism, drives=drives).internal.values["frequency"][:, 0]
        np.testing.assert_allclose(found, slow.frequencies(springs)[:6], rtol=DRAWN)
    assert analytic(flexfem.modes, mechanism).internal.values["frequency"][0, 0] == pytest.approx(
        2961.903, rel=DRAWN
    )


def test_a_payload_tilts_with_half_of_its_inertia_about_the_normal(mechanism):
    """A payload a thousand times as heavy: frequencies out of the plane follow from the static
    compliance alone.
    """
    heavy = mechanism.replace(payload={"mass": 0.22, "inertia": 60.0})
    model = plates.factorised(heavy, 2, 1, lifting=True)
    C = model.response().compliance[:3, :3]
    expected = np.sqrt(eigh(np.linalg.inv(C), np.diag([0.22, 30.0, 30.0]), eigvals_only=True))
    np.testing.assert_allclose(plate_modes(model, 3).frequencies, expected, rtol=2e-3)


def test_weight_displaces_every_point(mechanism, slow):
    found = analytic(flexfem.gravity, mechanism, angle=-60.0).internal.values
    u = slow.weight_response(9806.65 * np.array([0.5, -math.sqrt(0.75)]))
    size = np.abs(slow.ports[:9] @ u).max()
    np.testing.assert_allclose(
        found["pose"][0].ravel(), slow.ports[:9] @ u, rtol=0, atol=10 * DRAWN * size
    )
    np.testing.assert_allclose(
        found["stress"][0], slow.stress(u), rtol=1e-3
    )  # small differences of large terms
    doubled = mechanism.replace(payload={"mass": 440e-6, "inertia": 0.06})
    more = analytic(flexfem.gravity, doubled, angle=-60.0).internal.values["pose"] - found["pose"]
    weight = 220e-6 * 9806.65 * np.array([0.5, -math.sqrt(0.75), 0.0])
    np.testing.assert_allclose(
        more[0].ravel(), slow.compliance()[:9, :3] @ weight, rtol=100 * QUADRATURE
    )


def test_a_plate_on_a_frame_of_another_metal_drifts_as_its_hinges_let_it(mechanism):
    """In plane stress; with a frame of the same metal all points move as those of free metal."""
    sheet = mechanism.replace(model="plane_stress")
    slow = SlowNetwork(72.7e3)
    found = analytic(flexfem.drift, sheet).internal.values["pose"][0, :, 0].ravel()
    expected = slow.thermal_response(23.4e-6, 11.7e-6)
    size = 23.4e-6 * LEVER
    np.testing.assert_allclose(found[3:], expected[3:], rtol=0, atol=QUADRATURE * size)
    np.testing.assert_allclose(
        found[:3], expected[:3], rtol=0, atol=3e-4 * size
    )  # the mean of a body counts corners
    alike = analytic(flexfem.drift, sheet.replace(frame={"expansion": 23.4e-6}))
    free = 23.4e-6 * np.array([23.622, 12.7, 0.0, 8.636, -12.7, 0.0])
    np.testing.assert_allclose(
        alike.internal.values["pose"][0, 1:, 0].ravel(), free, rtol=0, atol=QUADRATURE * size
    )


def test_a_life_follows_from_the_highest_stress(mechanism, slow):
    """Basquin's law, half of (stress / 900 MPa)^-10 cycles, and the amplitude for 1e5 cycles."""
    law = flexfem.Basquin(900.0, -0.1)
    found = analytic(
        flexfem.life, mechanism, amplitude=tuple(POSE), law=law, cycles=1e5
    ).internal.values
    stress = slow.stress(slow.held_at(POSE))
    np.testing.assert_allclose(found["equivalent"][0], stress, rtol=SAMPLED)
    np.testing.assert_allclose(found["cycles"][0], 0.5 * (stress / 900) ** -10, rtol=20 * SAMPLED)
    assert found["life"][0] == pytest.approx(0.5 * (stress.max() / 900) ** -10, rel=20 * SAMPLED)
    assert found["safety"][0] == pytest.approx(503 / stress.max(), rel=SAMPLED)
    factor = 900 * (2e5) ** -0.1 / stress.max()
    assert found["factor"][0] == pytest.approx(factor, rel=SAMPLED)
    np.testing.assert_allclose(found["largest"][0], factor * POSE, rtol=SAMPLED)


def test_the_reach_is_the_sum_of_what_each_stroke_moves(mechanism, slow):
    """Two strokes cannot hold two other directions at zero."""
    found = analytic(flexfem.reach, mechanism).internal.values["ends"][:, :, 0]
    by_stroke = np.array(
        [slow.output @ slow.driven(slow.STROKES * (np.arange(2) == k)) for k in range(2)]
    )
    assert np.all(np.isnan(found[0]))
    np.testing.assert_allclose(
        found[1, 0], np.minimum(by_stroke, 0).sum(axis=0), rtol=10 * QUADRATURE, atol=1e-12
    )
    np.testing.assert_allclose(
        found[1, 1], np.maximum(by_stroke, 0).sum(axis=0), rtol=10 * QUADRATURE, atol=1e-12
    )


def test_small_loads_on_unlike_ports_displace_exact_beams_by_the_linear_compliance(mechanism, slow):
    """Stout notches shear, which slender hinges do not show."""
    C = slow.compliance()
    loads = np.array([1.0, -2.0, 30.0, 0.5, 0.7, -9.0, -0.4, 1.1, 6.0, 3.0, 5.0])
    found = displaced(mechanism.layout, SMALL * loads[None])
    size = np.sqrt(np.diag(C))
    moved = C @ (SMALL * loads)
    np.testing.assert_allclose(
        found.motions[0] / size, moved / size, rtol=0, atol=LINEAR * np.abs(moved / size).max()
    )
    np.testing.assert_allclose(
        found.compliance[0] / np.outer(size, size), C / np.outer(size, size), atol=LINEAR
    )


def test_large_displacements_begin_as_the_linear_ones(mechanism, slow):
    found = flexfem.large(mechanism, force=tuple(FORCE), resolution=4).internal.values
    linear, exact, elements = np.moveaxis(found["pose"], 1, 0)
    C = slow.compliance()[:3, :3]
    np.testing.assert_allclose(linear, found["force"] @ C, rtol=10 * QUADRATURE)
    np.testing.assert_allclose(exact, linear, rtol=1e-3)
    element_values = found["force"] @ plates.solved(mechanism, 4).compliance[:3, :3]
    np.testing.assert_allclose(elements, element_values, rtol=2e-3)


def test_three_dimensions_have_the_numbers_of_the_material_and_lie_between_the_plane_problems(
    mechanism,
):
    layout = mechanism.layout
    plane = plate_of_layout(layout)
    solid = plate_of_layout(layout, layers_of(mechanism, 3))
    assert plane == pytest.approx(Plate(72.7e3 / (1 - 0.34**2), 0.34 / 0.66, 10.16))
    assert solid == pytest.approx(Plate(72.7e3, 0.34, 10.16))
    sheet = plates.solved(mechanism.replace(model="plane_stress"), 2).compliance
    held, found = (plates.solved(mechanism, 2, layers).compliance for layers in (0, 1))
    assert np.all(np.diag(held) < np.diag(found)) and np.all(np.diag(found) < np.diag(sheet))


@pytest.mark.parametrize("layers", [0, 1])
def test_the_highest_stress_has_the_stress_across_the_plate(layers, mechanism):
    """Plane strain: 0.34 of the sum of those in the plane; with layers it is one of the stresses."""
    response = plates.solved(mechanism, 2, layers)
    loads = np.zeros((1, 11))
    loads[0, [0, 2, 9]] = 1.0, 30.0, 7.0
    expected = []
    for stress in response.stresses:
        tensors = np.tensordot(loads[0], stress, 1).reshape(-1, *stress.shape[-2:])
        full = np.zeros((len(tensors), 3, 3))
        full[:, : stress.shape[-1], : stress.shape[-1]] = tensors
        if not layers:
            full[:, 2, 2] = 0.34 * (full[:, 0, 0] + full[:, 1, 1])
        deviator = full - np.trace(full, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        expected.append(np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))).max())
    np.testing.assert_allclose(hinge_stress(response, loads)[0], expected, rtol=SOLVED)


def test_errors_refer_to_the_farthest_hinge_of_the_output(mechanism, slow):
    """Percentages across a command have the lever: x by a rotation over the lever, a rotation by x
    times the lever.
    """
    assert (
        mechanism.layout.lever == pytest.approx(LEVER) and pytest.approx(14.8199, abs=1e-4) == LEVER
    )
    C = slow.compliance()
    of_elements = plates.solved(mechanism, 8).compliance
    scale = np.array([1.0, 1.0, LEVER])
    softness = np.diag(C)[:3]
    error = (of_elements - C)[
        :3, :3
    ] / softness  # of motions by the force along one direction alone
    expected = (100 * error * scale[:, None] / scale).T  # by command, then direction
    found = errors_of(mechanism).internal.values
    np.testing.assert_allclose(found["percent"][0], expected, rtol=10 * SOLVED, atol=10 * SOLVED)
    np.testing.assert_allclose(found["free"][0], 1 / softness, rtol=10 * QUADRATURE)
    gains = [scale[:, None] * each[:3, 9:] / np.diag(each)[9:] for each in (C, of_elements)]
    along = np.sum(gains[0] * gains[1], axis=0) / np.sum(gains[1] ** 2, axis=0)
    np.testing.assert_allclose(found["driven"][0], 100 * (along - 1), rtol=10 * SOLVED)
    shares = flexfem.budget(mechanism, plane=True).internal.values
    for name, total in (("share", np.diag(expected)), ("driven", 100 * (along - 1))):
        np.testing.assert_allclose(shares[name][3], total, rtol=10 * SOLVED)
        np.testing.assert_allclose(np.sum(shares[name][:3], axis=0), total, rtol=10 * SOLVED)


def test_measured_necks_change_the_stiffness_as_drawn_ones_do(mechanism, tmp_path):
    """All three copies of one notch, 27 um wider."""
    measured = tmp_path / "necks.csv"
    measured.write_text("hinge, neck_um\ntip, 1170\ntip 2, 1170\ntip 3, 1170\n")
    found = flexfem.as_built(mechanism, measured).internal.values
    drawn, wider = (
        plates.network(one, elastic=True).compliance[:3, :3]
        for one in (mechanism, mechanism.replace(parameters={"neck_in": 1.170 / 25.4}))
    )
    np.testing.assert_allclose(found["drawn"], np.linalg.inv(drawn), rtol=SOLVED)
    np.testing.assert_allclose(
        found["stiffness"], np.linalg.inv(wider), rtol=1e-4
    )  # another mesh of the parts
    assert np.all(np.diag(found["stiffness"]) > np.diag(found["drawn"]))


def test_the_drawing_and_its_masses_are_stated_in_grams(mechanism):
    """A leg without its hinges is 0.45 x 0.18 square inches; the payload is 220 g of 60 kg mm^2."""
    report = check(mechanism)
    masses = {each.body: each.mass_g for each in report.bodies}
    assert masses["leg 3"] == pytest.approx(0.45 * 0.18 * INCH**2 * 10.16 * 2.81e-3, rel=1e-8)
    for name, polygon in bodies_drawn().items():
        assert (
            masses[name] == pytest.approx(polygon.area * 10.16 * 2.81e-3, rel=1e-4)
            and name in BODIES
        )
    assert report.dimensions["payload"] == [
        {"mass_g": pytest.approx(220.0), "inertia_kg_mm2": pytest.approx(60.0)}
    ]
    assert "payload 220 g" in [text.get_text() for text in plot_plate(None, mechanism).texts]
    first, second = report.actuators
    assert (first.mass_g, first.stroke_um, first.stiffness_n_per_um) == pytest.approx(
        (6.0, 12.0, 25.0)
    )
    assert (second.mass_g, second.stroke_um, second.stiffness_n_per_um) == pytest.approx(
        (9.0, 20.0, 45.0)
    )


def test_the_least_band_of_a_highest_stress_falls_with_the_square_of_the_resolution(mechanism):
    """1 % at resolution 8: 4 % at 4, and a quarter of a percent at 16."""
    for finest, least in ((4, 4.0), (8, 1.0), (16, 0.25)):
        sizes = finest * np.array([0.5, 0.75, 1.0])
        bands = value_bands(sizes, [{"stress": np.array([100.0, 20.0])}] * 3)
        np.testing.assert_allclose(bands["stress"], [least, least / 5])
    found = flexfem.stiffness(mechanism, models="elements", resolution=4)
    assert np.all(
        found.internal.bands["stress"] >= 0.04 * found.internal.values["stress"] * (1 - SOLVED)
    )


ASKED = ("modes.frequency.1.finite_elements", "stiffness.yield_range.finite_elements.theta")


@pytest.mark.slow
def test_a_column_of_a_study_and_its_band_have_one_unit(mechanism, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        f'name = "necks"\nstage = "{FILE}"\nmodel = "fe"\nresolution = 4\nask = {list(ASKED)}\n'
        '[sampling]\nmethod = "sobol"\ndesigns = 2\nseed = 1\n'
        '[[factor]]\nlabel = "neck"\nkey = "parameters.neck_in"\nfrom = 0.04\nto = 0.05\n'
    )
    found = load_study(path).family.numbers(mechanism)
    modes = flexfem.modes(mechanism, models="elements", resolution=4)
    value = modes.internal.values["frequency"][0, -1]
    band = modes.internal.bands["frequency"][0, -1]
    np.testing.assert_allclose(found[0], np.array([value, band]) / (2 * math.pi), rtol=1e-4)
    assert 400 < found[0, 0] < 471.5 and 0 < found[0, 1] < 0.01 * found[0, 0]  # Hz, of rigid bodies


def test_a_requirement_of_a_design_reads_the_number_in_its_unit(mechanism, slow, tmp_path):
    """471.4 Hz by the slow network, and 2.79 % of the first stroke."""
    first = "modes.frequency.1.analytic"
    coupled = "drive.coupling.first.second.analytic"
    path = tmp_path / "wanted.toml"
    path.write_text(
        f'name = "a test"\nstage = "{FILE}"\nseed = 7\nask = ["{first}", "{coupled}"]\n'
        '[[free]]\nlabel = "neck"\nkey = "parameters.neck_in"\nfrom = 0.04\nto = 0.05\n'
        f'[[require]]\nquantity = "{first}"\nat_least = 460.0\n'
        f'[[objective]]\nmaximise = "{coupled}"\n'
    )
    model = Model(load_requirements(path))
    values = dict(
        zip(
            model.loaded.requirements.quantities,
            model.evaluate(np.array([[0.045]]))[0],
            strict=True,
        )
    )
    assert values[first] == pytest.approx(slow.frequencies()[0] / (2 * math.pi), rel=DRAWN)
    assert values[coupled] == pytest.approx(-2.791249, rel=1e-6)
