"""`flexfem modes` and `flexfem.modes`: what they answer, print, write and refuse."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import flexfem as package
from flexfem.verify.modes import OUT_OF_PLANE

from ..conftest import UNLIKE, with_changes

SAME_PLANE = "calibrated, elastic links, plane stress"


def test_a_payload_far_heavier_than_the_stage_is_a_mass_on_a_spring_in_hertz():
    """500 kg with 4e5 kg mm^2: sqrt(k / m) / 2 pi, k of the static stiffness, in both witnesses and in rotation too."""
    stage = with_changes()
    found = package.modes(stage, 3, (500.0, 4e5), resolution=4)
    K = package.solve(stage, 4).stiffness
    expected = [math.sqrt(K[0, 0] / 0.5) / 2 / math.pi, math.sqrt(K[2, 2] / 400.0) / 2 / math.pi]
    pair = [one.frequency for one in found.modes if one.share.theta < 50]
    (turning,) = (one for one in found.modes if one.share.theta > 50)
    assert pair == pytest.approx([expected[0]] * 2, rel=1e-3) and turning.frequency == pytest.approx(
        expected[1], rel=1e-3
    )
    assert turning.share.theta == pytest.approx(100, abs=0.1) and found.payload_mass == 500
    assert found.mass == pytest.approx(500.09, abs=0.03) and found.meshed_mass == pytest.approx(found.mass, rel=1e-7)
    for one in found.modes:
        assert one.analytic[SAME_PLANE] == pytest.approx(one.frequency, rel=2e-3)


def test_modes_of_the_reference_stage(flexfem, project):
    """Literals of resolution 4; the analytic model with elastic links is the independent witness."""
    code, out, _ = flexfem("modes", project.path("geometry/mobility6.toml"), "--resolution", 4, "--count", 3, "--json")
    found = json.loads(out)
    assert code == 0
    np.testing.assert_allclose([one["frequency"] for one in found["modes"]], [131.3, 131.3, 193.6], atol=0.05)
    assert all(abs(one["analytic"][SAME_PLANE] / one["frequency"] - 1) < 1e-3 for one in found["modes"])
    assert all(0 < one["band"] < 0.01 * one["frequency"] for one in found["modes"])
    assert found["mass"] == pytest.approx(0.0892, abs=1e-4) and found["hub_mass"] == pytest.approx(0.00565, abs=1e-5)
    assert "material.density_kg_m3" in found["assumed"] or "material.density_kg_m3" not in found["not_stated"]
    assert OUT_OF_PLANE in found["warnings"]


@pytest.mark.usefixtures("unrendered")
def test_modes_print_and_write(flexfem, project, tmp_path, monkeypatch):
    monkeypatch.setattr("flexfem.plot.modes.FRAMES", 2)
    path = project.path("geometry/mobility3.toml")
    out_folder = tmp_path / "out"
    code, out, err = flexfem("modes", path, "--resolution", 4, "--count", 1, "-o", out_folder, "--drives", "engaged")
    assert code == 0 and "drives engaged" in out and "frequency (Hz)" in out and "their own mass is left out" in out
    assert "K_cb and M_cb are truncated, 1 mode with the platform held" in err
    names = sorted(each.name for each in out_folder.iterdir())
    assert names == sorted(
        f"mobility3-modes{end}"
        for end in (*(".json", ".png", ".pdf", ".vtu", ".npz", ".mat"), *("-1.gif", "-response.png", "-response.pdf"))
    )
    (one,) = json.loads((out_folder / "mobility3-modes.json").read_text())["modes"]
    assert one["analytic"][SAME_PLANE] == pytest.approx(one["frequency"], rel=5e-3), "stacks in both"


def test_of_unlike_chains_the_shares_lie_in_all_directions():
    found = package.modes(with_changes({"override": UNLIKE}), 3, resolution=4)
    assert all(min(one.share.x, one.share.y) > 0 for one in found.modes[:2])
    assert found.modes[0].frequency < found.modes[1].frequency * (1 - 1e-4)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--drives", "on"), "drives 'on', expected disengaged or engaged"),
        (("--payload", "nan", "0"), "payload nan 0, expected two numbers from 0"),
        (("--payload", "-1", "0"), "payload -1 0, expected two numbers from 0"),
        (("--count", "0"), "--count"),
        (("--damping", "nan"), "damping nan, expected a number above 0, at most 99"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(flexfem, project, options, said):
    code, out, err = flexfem("modes", project.path("geometry/mobility6.toml"), *options)
    assert code == 2 and out == "" and said in err and len(err.strip().splitlines()) == 1
