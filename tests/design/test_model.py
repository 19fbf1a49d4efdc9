"""The analytic model of requirements: merit, ends, mass, errors of a formula, corrections."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.design.model import MISSED, Correction, Model, correction_of
from flexfem.refused import BadInput

from .conftest import NECK, RADIUS, REFERENCE, STIFFEST, best, require

BASE = np.array([[0.5, 1.5], [0.6, 2.0]])
THICKNESS = '[[free]]\nlabel = "b"\nkey = "thickness_mm"\nfrom = 6.0\nto = 12.0\n'
SOFTEST = best("minimise", "kxx_n_per_mm")


def test_mass_is_area_times_thickness_times_density(load):
    found = Model(load(NECK, RADIUS, best("minimise", "mass_kg"))).evaluate(BASE)[:, 0]
    assert found[0] == pytest.approx(
        0.0892, abs=5e-5
    )  # as `flexfem modes` says of the reference stage
    assert found[1] != found[0]


def test_what_cannot_be_drawn_has_no_mass_and_says_why(load, monkeypatch):
    def refused(stage):
        raise BadInput("links overlap")

    monkeypatch.setattr("flexfem.paper.design.drawn_inertia", refused)
    model = Model(load(NECK, RADIUS, best("minimise", "mass_kg")))
    assert (
        model.columns(BASE)[1].tolist() == ["links overlap"] * 2
        and np.isnan(model.evaluate(BASE)).all()
    )


def test_errors_along_each_direction_are_of_the_whole_stiffness_of_a_stage_without_symmetry(load):
    """What a force of the paper's model moves the stage by, along x, y, theta, less the unit that
    was commanded.
    """
    wide = '[[free]]\nlabel = "one neck"\nkey = "override.1.elbow.neck_mm"\nfrom = 0.5\nto = 1.2\n'
    stage = flexfem.load(REFERENCE).replace(override={(1, "elbow"): {"neck": 1.0}})
    models = (
        flexfem.analyse(stage, formula="paros-weisbord"),
        flexfem.analyse(stage, 21, "calibrated"),
    )
    paper, calibrated = (model.stiffness for model in models)
    expected = 100 * (np.diag(np.linalg.solve(calibrated, paper)) - 1)
    for name, error in zip(
        ("error_x_percent", "error_y_percent", "error_theta_percent"), expected, strict=True
    ):
        found = Model(load(wide, best("minimise", name))).evaluate(np.array([[1.0]]))
        assert found[0, 0] == pytest.approx(error, rel=1e-6)
    assert abs(expected[0] - expected[1]) > 0.05


def test_a_derived_output_is_corrected_through_the_columns_that_it_uses(load):
    output = '[[output]]\nname = "both"\nexpression = "kxx_n_per_mm + kyy_n_per_mm"\n'
    loaded = load(
        NECK, RADIUS, output, best("maximise", "both ** 2"), best("maximise", "kyy_n_per_mm")
    )
    plain = Model(loaded).evaluate(BASE)
    found = Model(loaded, corrections={"kyy_n_per_mm": Correction(1.5, -4.0)}).evaluate(BASE)
    kyy = plain[:, 1]
    assert found[:, 1] == pytest.approx(1.5 * kyy - 4)
    assert found[:, 0] == pytest.approx((plain[:, 0] ** 0.5 + 0.5 * kyy - 4) ** 2)


def test_a_number_that_vanishes_is_corrected_by_a_term_and_others_by_a_factor():
    assert correction_of(2.0, 2.2) == (1.1, 0.0)
    assert correction_of(1e-17, 3e-4) == pytest.approx((1.0, 3e-4))
    assert correction_of(0.0, 0.0) == (1.0, 0.0)


def test_ends_of_both_sides_and_bounds_of_zero_have_a_size(load):
    ends = require("kxx_n_per_mm", 30, 50), require("coupling_xy", -1, 0)
    model = Model(load(NECK, RADIUS, *ends, best("minimise", "envelope_mm")))
    assert model.sizes.tolist() == [0.0, 50.0, 1.0]
    q = model.evaluate(BASE)
    assert model.violations(q)[:, 1] == pytest.approx(np.maximum(0, q[:, 1] - 50) / 50)


def test_an_objective_goes_the_way_that_is_asked_and_a_miss_is_worse_than_any_value(load):
    designs = np.array([[7.0], [9.0], [11.0]])
    for objective, order in ((STIFFEST, [1, 0, 2]), (SOFTEST, [0, 1, 2])):
        model = Model(load(THICKNESS, require("thickness_mm", None, 10.0), objective))
        merit = model.merit(model.evaluate(designs))
        assert np.argsort(merit).tolist() == order
        assert merit[2] == pytest.approx(1.1 * MISSED) and np.all(np.abs(merit[:2]) < MISSED)


@pytest.mark.parametrize(("high", "ends"), [(10.0, (7.5, 9.5)), (7.2, (7.09, 7.11))])
def test_a_guard_moves_each_end_inward_by_its_part_of_the_size_as_far_as_there_is_room(
    load, high, ends
):
    model = Model(
        load(THICKNESS, require("thickness_mm", 7.0, high), STIFFEST), guard=np.array([0.0, 0.05])
    )
    low, high = (
        model.both_margins(np.array([[0.0, end]]))[side][0, 1] for side, end in enumerate(ends)
    )
    assert [low, high] == pytest.approx([0.0, 0.0], abs=1e-12)
