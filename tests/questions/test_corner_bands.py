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


def test_the_engaged_stiffness_is_held_by_the_order_of_the_corners(benchmark: Any, solved: Any) -> None:
    """Errors fall as 1.4 powers of the resolution: the truth from 12 and 20 triangles, the bands from 4, 6 and 8."""
    places = [benchmark.COLUMNS.index(f"engaged_k{way}") for way in ("xx_n_per_mm", "yy_n_per_mm", "tt_n_mm_per_rad")]
    coarse, middle, fine, finer, finest = np.moveaxis(solved.columns[:, :, places], 1, 0)
    truth = finest + (finest - finer) / ((20 / 12) ** 1.4 - 1)
    last, first = np.abs(fine - middle) / ((8 / 6) ** 1.4 - 1), np.abs(middle - coarse) / (2**1.4 - (8 / 6) ** 1.4)
    over = np.abs(fine - truth) / (3 * np.maximum(last, first))
    assert np.mean(over <= 1) >= 0.95
    np.testing.assert_allclose(benchmark.judged(solved)["engaged stiffness"].ratios, over.ravel(), rtol=1e-6)


def test_bands_a_tenth_as_wide_are_reported(benchmark: Any, solved: Any, monkeypatch: Any, capsys: Any) -> None:
    for name in ("quantity_band", "pose_bands"):
        band = getattr(benchmark, name)
        monkeypatch.setattr(benchmark, name, lambda *given, band=band: band(*given) / 10)
    assert not benchmark.report(benchmark.judged(solved))
    said = capsys.readouterr().out.splitlines()[-1]
    assert said.startswith("less than 95% held: ") and "engaged stiffness" in said and "highest stress" in said


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
