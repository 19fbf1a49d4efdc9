"""The numbers behind the paper's claims, `examples/claims.py`, on the first pairs of its ensemble."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexfem

FOUND = {  # mean of the values, per cent, and in how many of 37 pairs the claim holds
    "six-commanded": (27.06726052649, 14),
    "six-across": (0.0, 37),
    "three-along": (319.7269956342, 24),
    "three-across": (0.0, 0),
    "six-better": (292.6597351077, 36),
    "axial-cause": (4.353150844914, 1),
    "larger-radius": (9.461415432955, 0),
    "rotation-more": (0.6010313877084, 23),
    "diagonal": (0.0, 37),
    "second-order": (59.20571610630, 3),
    "second-order-error": (89.94387187390, 0),
    "minimum-energy": (1.0, 37),
    "temperature-gradient": (4.701350157460, 37),
    "measured-stiffness": (13.36747456169, 37),
    "stiffer-simulated": (13.36747456169, 37),
}


@pytest.fixture(scope="module")
def script() -> Any:
    sys.path.append(str(Path(__file__).parents[1] / "examples"))
    return importlib.import_module("claims")


@pytest.mark.slow
def test_numbers_of_the_first_sixty_pairs_do_not_move(script: Any) -> None:
    ensemble = script.draw_ensemble(60)
    assert (len(ensemble.pairs.six.stages), ensemble.infeasible, ensemble.off_chart) == (37, 23, 0)
    for claim in script.CLAIMS:
        values = claim.values(ensemble.pairs)
        mean, holding = FOUND[claim.id]
        assert np.nanmean(values) == pytest.approx(mean, rel=1e-6, abs=1e-8), claim.id
        assert int(np.sum(claim.holds(values))) == holding, claim.id


@pytest.mark.slow
def test_commanded_joints_leave_the_error_of_the_hinges_and_links_alone(script: Any) -> None:
    found = dict(script.of_stage(flexfem.load("geometry/mobility6.toml"), 6))
    for drive, percent in (
        ("joints", (-0.238, -0.238, -0.566)),
        ("strokes", (-0.245, -0.245, -0.312)),
    ):
        np.testing.assert_allclose(
            np.diag(found[f"{drive} commanded instead of the platform"]), percent, atol=2e-3
        )


def test_a_verdict_is_by_the_whole_interval(script: Any) -> None:
    """Clopper and Pearson: 10 of 10 leave 69.2 % to 100 %, too few to decide."""
    claim = script.Claim("a", "", "", None, low=5.0, slack=0.5)
    few = script.share_of(claim, "f", np.full((10, 1), 6.0))
    assert (few.low, few.high) == (
        pytest.approx(0.6915, abs=1e-4),
        1.0,
    ) and few.verdict == "cannot be decided"
    assert script.share_of(claim, "f", np.full((100, 1), 6.0)).verdict == "holds"
    assert script.share_of(claim, "f", np.full((100, 1), 4.0)).verdict == "does not hold"
    near = script.share_of(claim, "f", np.full((100, 1), 5.2))  # within the slack of the limit
    assert (near.surely, near.holding, near.perhaps, near.verdict) == (
        0,
        100,
        100,
        "cannot be decided",
    )
    both = np.where(np.arange(100)[:, None] % 2, 9.0, 1.0)
    assert script.share_of(claim, "f", both).verdict == "depends on the dimensions"
