"""Studies in three dimensions: a row is the stage's own answer, and what they do not take is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.fem.fields import base_rotations, neck_stresses
from flexfem.fem.response import unit_response
from flexfem.fem.structure import plate_of
from flexfem.questions.bands import solve_solid
from flexfem.study.answer import answer

from .answered import STAGE, study

STUDY = f"""
name = "thickness"
stage = "{STAGE}"
model = "three_dimensional"
layers = 1
[sampling]
method = "grid"
[[factor]]
key = "thickness_mm"
values = [4.0]
[provenance]
"factor[0].values" = "assumed: a test"
"""


def test_a_row_is_what_the_stage_answers(tmp_path: Path) -> None:
    loaded = study(tmp_path, STUDY)
    rows = answer(loaded, 0, 1)
    assert rows.status.tolist() == ["ok"]
    found = dict(zip(loaded.outputs, rows.values[0], strict=True))
    stage = loaded.stage.replace(thickness=4.0)
    response = solve_solid(stage, 4, 1)
    K = np.linalg.inv(response.compliance)
    highest = neck_stresses(stage, response, K).highest.max(axis=(1, 2))
    assert found["kxx_n_per_mm"] == pytest.approx(K[0, 0], rel=1e-6)
    assert found["stress_x_mpa_per_um"] == pytest.approx(1e-3 * highest[0], rel=1e-6)
    assert found["range_y_um"] == pytest.approx(1e3 * 503.0 / highest[1], rel=1e-6)
    plane = unit_response(response.sectors, plate_of(stage))
    turning = np.abs(np.linalg.inv(plane.compliance) @ base_rotations(stage, plane)).max(axis=1)
    solid = np.abs(K @ base_rotations(stage, response)).max(axis=1)
    np.testing.assert_allclose(solid, turning, rtol=0.01)  # per displacement, geometry alone decides
