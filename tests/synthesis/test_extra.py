"""Mass and the error of a formula, against the commands that say them of one stage."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.synthesis.model import Model

from .conftest import NECK, RADIUS, ROOT, best, require

BASE = np.array([[0.5, 1.5], [0.6, 2.0]])


def test_mass_is_area_times_thickness_times_density(load):
    found = Model(load(NECK, RADIUS, best("minimise", "mass_kg"))).found(BASE).quantities[:, 0]
    assert found[0] == pytest.approx(0.0892, abs=5e-5)  # as `flexfem modes` says of the reference stage
    assert found[1] != found[0]


def test_the_error_of_a_formula_is_its_stiffness_against_the_calibrated_one(load):
    found = Model(load(NECK, RADIUS, best("minimise", "error_x_percent"))).found(BASE).quantities[:, 0]
    for values, error in zip(BASE.tolist(), found, strict=True):
        neck, radius = ({name: value for name in ("elbow", "platform")} for value in values)
        stage = flexfem.load(ROOT / "geometry/mobility6.toml").replace(neck=neck, radius=radius)
        paper, metal = flexfem.analyse(stage), flexfem.analyse(stage, 21, "calibrated")
        assert error == pytest.approx(100 * (paper.stiffness[0, 0] / metal.stiffness[0, 0] - 1), rel=1e-6)


def test_ends_of_both_sides_and_bounds_of_zero_have_a_size(load):
    ends = require("kxx_n_per_mm", 30, 50), require("coupling_xy", -1, 0)
    model = Model(load(NECK, RADIUS, *ends, best("minimise", "envelope_mm")))
    assert model.scales.tolist() == [50.0, 1.0]
    found = model.found(BASE)
    assert model.violations(found)[:, 0] == pytest.approx(np.maximum(0, found.quantities[:, 1] - 50) / 50)
