"""What `flexfem drift` prints of both models: poses, differences, bands and stresses in units one can tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.commands.heat import print_drift
from flexfem.verify.drift import CASES, DriftCase, WarmStage

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
MODEL = ([4e-14, -3.3e-5, 5.1e-6], [-0.0303, 0.0041, -4.4e-5], [0.0102, -0.0204, 1.0e-12])
METAL = ([2e-14, -3.0e-5, 5.0e-6], [-0.0300, 0.0040, -4.0e-5], [0.0100, -0.0200, 1.25e-12])
BAND = ([1e-13, 6e-7, 7e-8], [8e-5, 9e-5, 3e-7], [1e-4, 2e-4, 5e-7])
FURTHER = [0.0, 1.7e-4, 6.0e-6]


def warm(pose, stress):
    """Any stage with this pose, the highest stress in its last neck."""
    necks = [[0.1, 0.2, 0.3]] * 2 + [[0.1, 0.2, stress]]
    return WarmStage(pose=pose, stress=necks, reaction=np.eye(3).tolist(), edges=[1.0, 2 * stress, 3.0])


@pytest.fixture(scope="module")
def rows():
    """Cells of the printed table by case, then by what stands second in a row."""
    record = flexfem.drift(flexfem.load(STAGE), mobility=6, formula="quadrature", resolution=None)
    cases = {
        name: DriftCase(
            analytic=warm(MODEL[k], 11.0 + k),
            elements=warm(METAL[k], 10.0 + k),
            band=BAND[k],
            edge_band=1.5 + k,
            unlike=FURTHER if k == 0 else None,
        )
        for k, name in enumerate(CASES)
    }
    return record.model_copy(update={"cases": cases})


def test_every_row_has_its_numbers_in_their_units(rows, capsys):
    print_drift(rows)
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    first = next(k for k, line in enumerate(lines) if line.startswith("temperature"))
    assert (
        lines[first]
        == "temperature by quadrature, mobility 6, plane stress x y theta highest neck stress (MPa) at clamped edges"
    )
    assert lines[first + 1 : first + 12] == [
        "uniform 0 -33 nm 5.1 urad 11",
        "finite elements 0 -30 nm 5 urad 10 20",
        "difference (%) +10.00 +2.00 +10.00",
        "mesh band (+-) 0.6 nm 0.07 urad 1.5",
        "necks of chains 10 % unlike 0 170 nm 6 urad",
        "gradient in x -30.3 um 4.1 um -44 urad 12",
        "finite elements -30 um 4 um -40 urad 11 22",
        "difference (%) +1.00 +2.50 +10.00 +9.09",
        "mesh band (+-) 0.08 um 0.09 um 0.3 urad 2.5",
        "gradient in y 10.2 um -20.4 um 1 prad 13",
        "finite elements 10 um -20 um 1.25 prad 12 24",
    ]
    assert lines[first + 12] == "difference (%) +2.00 +2.00 -20.00 +8.33"
