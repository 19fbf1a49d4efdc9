"""The highest neck stress per displacement, where users look: which neck, by both models, with a band by meshes."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.commands.comparisons import print_results
from flexfem.commands.tables import print_stiffness
from flexfem.verify.case import LoadedCase
from flexfem.verify.protocol import run_case, solve_stage
from flexfem.verify.result import NeckPeak

GEOMETRY = Path(__file__).parents[2] / "geometry"
NAMES = ("base", "elbow", "platform")
CASE = """name = "peaks"
direction = "theta"
amplitude_mrad = 0.4
points = 3
resolution = 4
[[curve]]
label = "six"
stage = "stage.toml"
mobility = 6
"""


@pytest.fixture(scope="module")
def unlike():
    unlike = {(2, "elbow"): {"neck": 0.43}, (3, "platform"): {"radius": 1.8}, (1, "base"): {"neck": 0.67}}
    return flexfem.load(GEOMETRY / "mobility6.toml").replace(override=unlike)


@pytest.fixture(scope="module")
def solve():
    """Every mesh is solved once."""
    return cache(solve_stage)


def where(stress):
    chain, hinge = np.argwhere(stress == stress.max())[0]
    return int(chain) + 1, NAMES[hinge]


def test_of_necks_as_high_but_for_round_off_the_first_is_named(capsys):
    tied = np.array([[3.0, 7.0 - 1e-12, 2.0], [1.0, 7.0, 4.0], [5.0, 7.0 - 2e-12, 6.0]])
    found = NeckPeak.of(tied)
    assert (found.chain, found.hinge, found.stress) == (1, "elbow", 7.0)
    assert NeckPeak.of(tied + np.array([[0.0], [1e-6], [0.0]])).chain == 2
    for number in (3, 6):
        print_stiffness(flexfem.stiffness(flexfem.load(GEOMETRY / f"mobility{number}.toml")))
        (line,) = [text for text in capsys.readouterr().out.splitlines() if text.startswith("  theta")]
        assert line.endswith("platform hinge, chain 1"), line


def test_verify_says_the_highest_neck_stress_by_both_models_and_where(unlike, solve, tmp_path, capsys):
    """Of the model for a pose; of the metal under the same force, by the displacement that it reaches; N, mm, rad."""
    unlike.save(tmp_path / "stage.toml")
    (tmp_path / "case.toml").write_text(CASE)
    result, _ = run_case(LoadedCase(tmp_path / "case.toml"), solve)
    of, model = result.models["six"], flexfem.analyse(unlike, mobility=6)
    stress = model.neck_stress([0, 0, 1.0])
    assert of.model_peak.stress == pytest.approx(stress.max()) and (of.model_peak.chain, of.model_peak.hinge) == where(
        stress
    )
    metal = flexfem.solve(unlike, 4)
    reached = metal.pose(model.force([0, 0, 4e-4]))
    stress = metal.neck_stress(reached) / reached[2]
    assert of.element_peak.stress == pytest.approx(stress.max(), rel=1e-5)
    assert (of.element_peak.chain, of.element_peak.hinge) == where(stress)
    assert 1.02 < of.model_peak.stress / of.element_peak.stress < 1.3
    assert 0.001 < of.peak_band / of.element_peak.stress < 0.03
    print_results([result], tmp_path)
    (line,) = [text for text in capsys.readouterr().out.splitlines() if "MPa/mrad" in text]
    values = [each.stress / 1e3 for each in (of.model_peak, of.element_peak)]
    cells = [cell for cell in re.split(r"\s{2,}", line.strip()) if cell]
    assert cells == [
        "case", "MPa/mrad", "six", f"{values[0]:.4g}", f"{of.model_peak.hinge}, chain {of.model_peak.chain}",
        f"{values[1]:.4g} ± {of.peak_band / 1e3:.2g}", f"{of.element_peak.hinge}, chain {of.element_peak.chain}",
    ]  # fmt: skip


@pytest.mark.slow
def test_stiffness_says_the_stress_of_finite_elements_with_a_band_that_holds_a_finer_mesh(unlike, capsys):
    found = flexfem.stiffness(unlike, resolution=4)
    finer = flexfem.solve(unlike, 7)
    for axis in range(3):
        stress = found.elements.stress[..., axis]
        same = flexfem.solve(unlike, 4).neck_stress(np.eye(3)[axis])
        assert stress == pytest.approx(same, rel=1e-6)
        highest = float(np.max(finer.neck_stress(np.eye(3)[axis])))
        assert abs(highest - stress.max()) < found.elements.band[axis] < 0.03 * highest
    print_stiffness(found)
    lines = [line for line in capsys.readouterr().out.splitlines() if "finite elements, resolution 4: " in line]
    for axis, (line, unit) in enumerate(zip(lines, ("MPa/um", "MPa/um", "MPa/mrad"), strict=True)):
        stress = found.elements.stress[..., axis]
        chain, hinge = where(stress)
        said = f"{stress.max() / 1e3:.4g} ± {found.elements.band[axis] / 1e3:.2g} {unit}, {hinge} hinge, chain {chain}"
        assert line.endswith(said)
    assert flexfem.stiffness(unlike).elements is None


@pytest.mark.parametrize("resolution", [3, 4.5, "8", 1000])
def test_a_stiffness_with_no_resolution_is_refused(unlike, resolution):
    with pytest.raises(flexfem.BadInput, match="resolution"):
        flexfem.stiffness(unlike, resolution=resolution)
