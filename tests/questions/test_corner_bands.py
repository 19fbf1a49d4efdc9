"""Whether bands of drives, drift and highest stresses hold the truth: over random stages that a
benchmark solved once.

`benchmarks/corner_bands.py` drew them after the bands were chosen, for this alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem

KEPT = np.load(Path(__file__).with_name("corner_bands.npz"))


@pytest.fixture
def corner(benchmark):
    """The program that drew and solved them."""
    return benchmark("corner_bands")


def test_bands_hold_the_truth_of_all_kinds_of_numbers(corner):
    arrays = (KEPT[name] for name in corner.Solved._fields[:3])
    solved = corner.Solved(*arrays, list(map(str, KEPT["stages"])))
    kinds = corner.judged(solved)
    assert len(solved.stages) == 8 and sum(len(each.ratios) for each in kinds.values()) > 180
    for kind, each in kinds.items():
        settled = each.doubts <= 0.5
        assert np.mean(each.ratios[settled] <= 1) >= 0.95 and np.median(each.doubts) < 0.15, kind
        assert 1 / np.median(each.ratios) < 15, kind


def test_what_is_kept_comes_out_of_the_solver(corner, tmp_path):
    MESHER = (
        1e-3  # gmsh's versions mesh a little differently, and a highest stress changes its node
    )
    path = tmp_path / "stage.toml"
    path.write_text(str(KEPT["stages"][2]))
    stage = flexfem.load(path)
    columns, poses = corner._answered(stage, 4)
    np.testing.assert_allclose(columns, KEPT["columns"][2, 0], rtol=20 * MESHER, atol=1e-9)
    np.testing.assert_allclose(
        poses, KEPT["poses"][2, 0], rtol=MESHER, atol=MESHER * np.max(np.abs(poses))
    )


@pytest.mark.slow
def test_bands_hold_the_truth_on_a_stage_never_seen(corner):
    kinds = corner.judged(corner.solved_stages([7919], 1))
    ratios = np.concatenate([each.ratios for each in kinds.values()])
    assert len(ratios) > 22 and np.mean(ratios <= 1) >= 0.95
