"""Mass and the error of a formula, against the commands that say them of one stage."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.refused import BadInput
from flexfem.synthesis import extra
from flexfem.synthesis.model import Correction, Model

from .conftest import NECK, RADIUS, ROOT, best, require

BASE = np.array([[0.5, 1.5], [0.6, 2.0]])


def test_mass_is_area_times_thickness_times_density(load):
    found = Model(load(NECK, RADIUS, best("minimise", "mass_kg"))).found(BASE).quantities[:, 0]
    assert found[0] == pytest.approx(0.0892, abs=5e-5)  # as `flexfem modes` says of the reference stage
    assert found[1] != found[0]


def test_what_cannot_be_drawn_has_no_mass_and_says_why(load, monkeypatch):
    def refused(stage):
        raise BadInput("links overlap")

    monkeypatch.setattr(extra, "drawn_inertia", refused)
    found = Model(load(NECK, RADIUS, best("minimise", "mass_kg"))).found(BASE)
    assert found.reason.tolist() == ["links overlap"] * 2 and np.isnan(found.quantities).all()


def test_the_error_of_a_formula_is_its_stiffness_against_the_calibrated_one(load):
    found = Model(load(NECK, RADIUS, best("minimise", "error_x_percent"))).found(BASE).quantities[:, 0]
    for values, error in zip(BASE.tolist(), found, strict=True):
        neck, radius = ({name: value for name in ("elbow", "platform")} for value in values)
        stage = flexfem.load(ROOT / "geometry/mobility6.toml").replace(neck=neck, radius=radius)
        paper, metal = flexfem.analyse(stage, formula="paros-weisbord"), flexfem.analyse(stage, 21, "calibrated")
        assert error == pytest.approx(100 * (paper.stiffness[0, 0] / metal.stiffness[0, 0] - 1), rel=1e-6)


def test_errors_along_each_direction_are_of_the_whole_stiffness_of_a_stage_without_symmetry(load):
    """What a force of the paper's model moves the stage by, along x, y, theta, less the unit that was commanded."""
    names = ("error_x_percent", "error_y_percent", "error_theta_percent")
    wide = '[[free]]\nlabel = "one neck"\nkey = "override.1.elbow.neck_mm"\nfrom = 0.5\nto = 1.2\n'
    found = Model(load(wide, *(best("minimise", name) for name in names))).found(np.array([[1.0]])).quantities[0]
    stage = flexfem.load(ROOT / "geometry/mobility6.toml").replace(override={(1, "elbow"): {"neck": 1.0}})
    models = flexfem.analyse(stage, formula="paros-weisbord"), flexfem.analyse(stage, 21, "calibrated")
    paper, metal = (model.stiffness for model in models)
    assert found == pytest.approx(100 * (np.diag(np.linalg.solve(metal, paper)) - 1), rel=1e-6)
    assert abs(found[0] - found[1]) > 0.05


def test_a_derived_output_is_corrected_through_the_columns_that_it_uses(load):
    output = '[[output]]\nname = "both"\nexpression = "kxx_n_per_mm + kyy_n_per_mm"\n'
    wanted = best("maximise", "both ** 2"), best("maximise", "kyy_n_per_mm")
    plain = Model(load(NECK, RADIUS, output, *wanted)).found(BASE).quantities
    corrected = Model(load(NECK, RADIUS, output, *wanted), corrections={"kyy_n_per_mm": Correction(1.5, -4.0)})
    kyy = plain[:, 1]
    found = corrected.found(BASE).quantities
    assert found[:, 1] == pytest.approx(1.5 * kyy - 4)
    assert found[:, 0] == pytest.approx((plain[:, 0] ** 0.5 + 0.5 * kyy - 4) ** 2)


def test_ends_of_both_sides_and_bounds_of_zero_have_a_size(load):
    ends = require("kxx_n_per_mm", 30, 50), require("coupling_xy", -1, 0)
    model = Model(load(NECK, RADIUS, *ends, best("minimise", "envelope_mm")))
    assert model.scales.tolist() == [50.0, 1.0]
    found = model.found(BASE)
    assert model.violations(found)[:, 0] == pytest.approx(np.maximum(0, found.quantities[:, 1] - 50) / 50)
