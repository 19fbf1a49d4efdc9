"""Whether bands in three dimensions hold the truth: over random stages, solved once by `benchmarks/solid_bands.py`.

Nine notches differ on each of the stages, which were drawn for this alone.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import SolidLevels, solid_bands, solve_solid

ROOT = Path(__file__).parents[2]
KEPT = np.load(Path(__file__).with_name("solid_bands.npz"))


def test_bands_hold_the_truth_and_are_no_more_than_several_times_the_error() -> None:
    """At resolution 4 with three layers: all entries of twelve compliances, of plane and layers together."""
    over, shares = [], []
    for answer, truth, levels in zip(KEPT["answer"], KEPT["truth"], KEPT["levels"], strict=True):
        plane, thickness = solid_bands(SolidLevels(levels[:3], *levels[3:]), 4)
        over.append((plane + thickness) / np.abs(answer - truth))
        shares.append(np.diag(thickness) / np.diag(plane + thickness))
        assert np.all(np.abs(np.diag(answer / truth) - 1) < 2e-3)
    assert len(over) == 12
    assert np.min(over) >= 1
    assert 2 < np.median(np.diagonal(over, axis1=1, axis2=2)) < 5
    assert 0.05 < np.min(shares) < 0.2 and 0.4 < np.max(shares) < 0.7


@pytest.mark.slow
def test_what_is_kept_comes_out_of_the_solver() -> None:
    MESHER = 1e-4  # gmsh's versions mesh a little differently, at resolution 2
    stage = Stage.model_validate(json.loads(str(KEPT["stages"][4])))
    found, kept = solve_solid(stage, 2, 1).compliance, KEPT["levels"][4, 0]
    assert np.max(np.abs(found - kept) / np.sqrt(np.outer(np.diag(kept), np.diag(kept)))) < MESHER


@pytest.mark.slow
def test_bands_hold_the_truth_on_a_stage_never_seen(monkeypatch: Any) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from solid_bands import ratios, solved_stages

    found = solved_stages([7919], 1)
    assert np.min(ratios(*(each[0] for each in found[:3]))) >= 1
