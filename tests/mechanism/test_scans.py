"""A scan of both edges of a neck gives the hinge its profile, unequal sides included."""

from __future__ import annotations

import math

import numpy as np
import pytest

import flexfem as api
from flexfem.mechanism.scans import scanned_rows
from flexfem.refused import BadInput

R_LEFT = 1.506
R_RIGHT = 1.679
GAP = 0.01533  # mm, of circles fitted to a public scan of a flexure
SCATTER = 2e-5  # mm
TEXT = """
name = "scanned"
thickness_mm = 6.35
model = "plane_stress"
[material]
name = "CuBe"
youngs_modulus_gpa = 131
poissons_ratio = 0.3
density_kg_m3 = 8250
yield_strength_mpa = 1000
[[body]]
name = "ground"
fixed = true
outline_mm = [[-3.175, 0], [3.175, 0], [3.175, 8], [-3.175, 8]]
[[body]]
name = "beam"
outline_mm = [[-3.175, -8], [3.175, -8], [3.175, 0], [-3.175, 0]]
[[hinge]]
name = "neck"
between = ["ground", "beam"]
at_mm = [0, 0]
direction_deg = -90
table_csv = "scan.csv"
cut_mm = 6.5
[output]
body = "beam"
at_mm = [0, 0]
"""


@pytest.fixture
def scan(tmp_path):
    def write(scatter=SCATTER, count=1500, seed=3, digits=9):
        rng = np.random.default_rng(seed)
        lines = ["# edges of a neck", "edge, x_mm, y_mm"]
        for edge, radius, side in (("left", R_LEFT, 1), ("right", R_RIGHT, -1)):
            x = np.sort(rng.uniform(-1.3, 1.3, count))
            y = side * (
                GAP / 2 + radius - np.sqrt(radius**2 - x**2)
            ) + scatter * rng.standard_normal(count)
            lines += [f"{edge}, {a:.{digits}f}, {b:.7f}" for a, b in zip(x, y, strict=True)]
        (tmp_path / "scan.csv").write_text("\n".join(lines) + "\n")
        return tmp_path / "scan.csv"

    return write


def test_a_scan_becomes_a_neck_with_unequal_notches(scan, tmp_path):
    scan(digits=6)
    (tmp_path / "scanned.toml").write_text(TEXT)
    mechanism = api.load(tmp_path / "scanned.toml")
    (joint,) = mechanism.layout.joints
    assert joint.profile.neck == pytest.approx(GAP, rel=3e-3)
    # thin circular notches, 2 E b t^2.5 / (9 pi sqrt R) with 2/R = 1/R_left + 1/R_right (Paros and
    # Weisbord, 1965)
    radius = 2 / (1 / R_LEFT + 1 / R_RIGHT)
    closed = 2 * 131e3 * 6.35 * GAP**2.5 / (9 * math.pi * math.sqrt(radius))
    compliance = joint.profile.compliance(131e3, 0.3, 6.35)
    assert 1 / compliance[2, 2] == pytest.approx(closed, rel=0.015)


def test_scatter_is_smoothed_and_rows_are_dense_at_the_neck(scan):
    rows = np.array(scanned_rows(scan()))
    height = rows[:, 1] + rows[:, 2]
    exact = GAP + sum(radius - np.sqrt(radius**2 - rows[:, 0] ** 2) for radius in (R_LEFT, R_RIGHT))
    near = np.abs(rows[:, 0]) < 0.9
    assert np.max(np.abs(height - exact)[near]) < SCATTER  # of 1,500 points on each edge
    assert np.max(np.abs(height - exact)) < 1e-3  # at the ends, where the edge is steep
    spacing = np.diff(rows[:, 0])
    assert spacing[len(spacing) // 2] < 0.1 * spacing[0]


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ("edge, x_mm\nleft, 1", "columns edge, x_mm, expected edge, x_mm, y_mm"),
        (
            "edge, x_mm, y_mm\nupper, 1, 2",
            "line 2: upper, 1, 2, expected left or right, and two numbers",
        ),
        ("edge, x_mm, y_mm\nleft, 1, 2", "the left edge, expected at least 8 points"),
    ],
)
def test_other_tables_are_refused_in_one_line(tmp_path, text, refusal):
    path = tmp_path / "scan.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=refusal):
        scanned_rows(path)
