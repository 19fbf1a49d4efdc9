"""Whether bands of drives, drift and highest stresses hold the truth: over random stages that a benchmark solved once.

`benchmarks/corner_bands.py` drew them after the bands were chosen, for this alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexfem.mechanism.stage import Stage

ROOT = Path(__file__).parents[2]
KEPT = np.load(Path(__file__).with_name("corner_bands.npz"))


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The program that drew and solved them."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    import corner_bands

    return corner_bands


@pytest.fixture
def solved(benchmark: Any) -> Any:
    """What is kept, as the benchmark has it."""
    return benchmark.Solved(*(KEPT[name] for name in benchmark.Solved._fields[:3]), list(map(str, KEPT["stages"])))


def test_bands_hold_the_truth_of_all_kinds_of_numbers(benchmark: Any, solved: Any) -> None:
    kinds = benchmark.judged(solved)
    assert len(solved.stages) == 8 and sum(len(each.ratios) for each in kinds.values()) > 180
    for kind, each in kinds.items():
        settled = each.doubts <= 0.5
        assert np.mean(each.ratios[settled] <= 1) >= 0.95 and np.median(each.doubts) < 0.15, kind
        assert 1 / np.median(each.ratios) < 15, kind


def test_what_is_kept_comes_out_of_the_solver(benchmark: Any, tmp_path: Path) -> None:
    MESHER = 1e-3  # gmsh's versions mesh a little differently, and a highest stress changes its node
    import flexfem

    path = tmp_path / "stage.toml"
    path.write_text(str(KEPT["stages"][2]))
    stage = flexfem.load(path)
    assert isinstance(stage, Stage)
    columns, poses = benchmark._answered(stage, 4)
    kept = KEPT["columns"][2, 0]
    np.testing.assert_allclose(columns, kept, rtol=20 * MESHER, atol=1e-9)
    np.testing.assert_allclose(poses, KEPT["poses"][2, 0], rtol=MESHER, atol=MESHER * np.max(np.abs(poses)))


@pytest.mark.slow
def test_bands_hold_the_truth_on_stages_never_seen(benchmark: Any) -> None:
    kinds = benchmark.judged(benchmark.solved_stages([7919], 2))
    ratios = np.concatenate([each.ratios for each in kinds.values()])
    assert len(ratios) > 45 and np.mean(ratios <= 1) >= 0.95
