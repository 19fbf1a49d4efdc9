"""A mesh study on made-up compliances: every direction with its own limit, rate and order."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.mechanism.stage import load_stage
from flexfem.verify.converge import converge

PATH = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
LIMIT, RATE, ORDER = np.array([0.025, 0.020, 2e-5]), np.array([-0.3, -0.5, -0.9]), np.array([2.0, 3.0, 4.0])


def solve(_, resolution):
    compliance = np.diag(LIMIT * (1 + RATE * float(resolution) ** -ORDER)) + 1e-9 * resolution * np.ones((3, 3))
    np.fill_diagonal(compliance, np.diag(compliance) - 1e-9 * resolution)
    response = SimpleNamespace(compliance=compliance, unknowns=100 * resolution)
    return SimpleNamespace(triangles=40 * resolution, response=response)


def test_each_direction_has_its_own_values_order_limit_and_band():
    made = converge(load_stage(PATH), (4, 6, 8), solve)
    for k, axis in enumerate(("x", "y", "theta")):
        found, left = made.uncertainty[axis], LIMIT[k] * abs(RATE[k]) * 8.0 ** -ORDER[k]
        assert found.values == pytest.approx(LIMIT[k] * (1 + RATE[k] * np.array([4.0, 6, 8]) ** -ORDER[k]), rel=1e-12)
        assert found.verdict == "converging" and found.resolutions == [4, 6, 8]
        assert found.observed == pytest.approx(ORDER[k], rel=1e-5)
        assert found.extrapolated == pytest.approx(LIMIT[k], rel=1e-6)
        assert found.band == pytest.approx(1.25 * left, rel=1e-4)
    assert made.resolutions == [4, 6, 8]
    assert made.triangles == [160, 240, 320] and made.unknowns == [400, 600, 800]
    np.testing.assert_array_equal(made.compliance, [solve(None, n).response.compliance for n in (4, 6, 8)])


def test_an_answer_names_the_file_of_its_stage():
    """As it was read; said when it was changed since; empty when no file was read."""
    stage = load_stage(PATH)
    changed, free = stage.replace(thickness=9.0), stage.model_copy()
    found = [converge(each, (4, 6, 8), solve) for each in (stage, changed, free)]
    assert [each.file for each in found] == [str(PATH), f"{PATH}, changed", ""]
    assert found[0].hash == found[2].hash != found[1].hash
