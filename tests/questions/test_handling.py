"""Numbers by which a drawing is moved: the same as those that the questions state."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.questions.handling import handled

SAME = 1e-5  # relative; the numbers of a page have six digits
SECTIONS = 1e-3  # relative; a page has the stress at fewer sections


@pytest.fixture(
    scope="module", params=["geometry/parallelogram.toml", "flexfem/data/mechanism-xy-stage.toml"]
)
def both(request):
    mechanism = flexfem.load(request.param)
    return mechanism, handled(mechanism)


def test_compliance_stress_and_frequency_are_those_of_the_questions():
    mechanism = flexfem.load("geometry/parallelogram.toml")
    found = handled(mechanism)
    at_rest = flexfem.stiffness(mechanism, models="analytic", no_limits=True).internal.values
    C = np.array(found.compliance)[:3, :3]
    np.testing.assert_allclose(1 / np.diag(C), at_rest["free"][0], rtol=SAME)
    K = np.linalg.inv(C)
    highest = [np.abs(np.array(hinge.stress)[:, :3] @ K).max(axis=0) for hinge in found.hinges]
    np.testing.assert_allclose(highest, at_rest["stress"][0], rtol=SECTIONS)
    modes = flexfem.modes(mechanism, models="analytic", count=1)
    assert found.modes[0].frequency == pytest.approx(modes.values["frequency"][0, 0], rel=SAME)


@pytest.mark.parametrize("load", [(670.4, -19.29, 0.0), (-4.779, 19.59, 0.0), (0.0, 0.0, 900.0)])
def test_the_stress_of_short_hinges_is_that_of_the_question_under_any_load(load):
    """In the lever's pivot shear on the axis governs, which no edge shows."""
    mechanism = flexfem.load("geometry/lever-amplifier.toml")
    at_rest = flexfem.stiffness(mechanism, models="analytic", no_limits=True, force=load)
    stated = at_rest.internal.values["hinge_stress"][0]
    loads = np.array([*load, 0.0])
    for hinge, stress in zip(handled(mechanism).hinges, stated, strict=True):
        edges = np.abs(np.array(hinge.stress) @ loads).max()
        on_axis = np.hypot(*(np.array(hinge.axis) @ loads))
        assert max(edges, on_axis) == pytest.approx(stress, rel=0.01)


def test_the_output_moves_with_its_body(both):
    _, found = both
    x, y = found.output
    of_output = np.array(found.twists)[found.output_body]
    moved = np.array(
        [of_output[0] - y * of_output[2], of_output[1] + x * of_output[2], of_output[2]]
    )
    np.testing.assert_allclose(moved, np.array(found.compliance)[:3], rtol=SAME, atol=1e-12)


def test_a_mode_keeps_the_work_of_its_bodies_in_proportion_to_their_mass():
    """Of a guide whose leaves are light, the stage of the first mode moves along x alone."""
    found = handled(flexfem.load("geometry/parallelogram.toml"))
    u, v, turn = found.modes[0].twists[0]
    x, y = found.output
    at_output = np.array([u - turn * y, v + turn * x])
    assert abs(at_output[1] / at_output[0]) < 1e-2


def test_ranges_are_those_at_finite_displacement():
    mechanism = flexfem.load("geometry/parallelogram.toml")
    at_rest = flexfem.stiffness(mechanism, models="analytic")
    found = handled(mechanism, at_rest)
    stated = at_rest.internal.values["range"]
    free = list(at_rest.axes["others"]).index("free")
    positive = list(at_rest.axes["sense"]).index("positive")
    for direction in range(2):
        assert found.range[direction].high == pytest.approx(stated[free, positive, direction])
    assert found.range[0].above in at_rest.axes["limit"]
    # a leaf bows on the way of a turn, under a force that hardly grows, which linear theory has not
    assert stated[free, positive, 2] > 10 * found.range[2].high
    moment = at_rest.at("range_force", others="free", sense="positive", direction="theta")
    stiffness = at_rest.at("free", direction="theta")[-1]
    assert found.range[2].high == pytest.approx(moment / stiffness)
    assert found.range[2].above == "the force at which parts nearly buckle"


def test_a_plate_without_hinges_is_not_moved(tmp_path):
    file = tmp_path / "plate.toml"
    file.write_text(
        'name = "tongue"\nthickness_mm = 5\n[material]\nname = "al-7075-t6"\n'
        '[[body]]\nname = "ground"\nclamped_edges = [3]\n'
        "outline_mm = [[0, 0], [20, 0], [20, 4], [0, 4]]\n"
        '[output]\nbody = "ground"\nat_mm = [18, 2]\ncontact_mm = 1\n'
    )
    assert handled(flexfem.load(file)) is None
