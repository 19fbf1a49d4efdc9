"""The dimensioned drawing: every number of the file in its place, and of an unfinished file what there is."""

from __future__ import annotations

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

import flexfem
from flexfem.plot import dimensions
from flexfem.plot.stage import drawing_figure, plot_dimensions

from ..conftest import UNLIKE, with_changes

HALF = """
name = "half a stage"
[chain]
link_lengths_mm = [31.0, 33.5, 25.0]
joint_angles_deg = [175.0, -85.0, 92.0]
[hinges.base]
radius_mm = 3.9
neck_mm = 0.53
[hinges.elbow]
radius_mm = 1.6
[platform]
hub_radius_mm = 7.7
"""
METAL = ["youngs_modulus_gpa", "poissons_ratio", "density_kg_m3", "yield_strength_mpa"]
MISSING = [
    "thickness_mm",
    "material.name",
    *(f"material.{key}" for key in METAL),
    "chain.link_width_mm",
    *("hinges.elbow.neck_mm", "hinges.platform.radius_mm", "hinges.platform.neck_mm", "platform.radius_mm"),
]


def texts(ax) -> dict[str, complex]:
    return {text.get_text(): complex(*text.get_position()) for text in ax.texts if text.get_text()}


@pytest.fixture
def ax():
    return Figure(figsize=(8, 8)).add_subplot()


def test_every_dimension_is_on_the_drawing_and_within_it(ax):
    plot_dimensions(ax, with_changes({"override": UNLIKE}))
    said = texts(ax)
    expected = {"l1 31", "l2 33.5", "l3 25", "w 8.9", "platform R 16.3", "hub R 7.7"}
    assert set(said) == expected | {
        *("R 2.3, t 0.53", "R 1.6, t 0.47", "R 1.4, t 0.61"),
        *("R 3.9, t 0.53", "R 1.6, t 0.83", "R 1.9, t 0.41"),
    }
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert all(left < at.real < right and low < at.imag < high for at in said.values())
    assert len([text for text in ax.texts if text.get_text().startswith("R ")]) == 9


def test_a_length_is_written_beside_what_it_measures(ax):
    """Unequal joints: base at (56, -35), elbow at (25, -33), platform hinge at (25, 1), mm."""
    stage = with_changes()
    plot_dimensions(ax, stage)
    said = texts(ax)
    heading = np.cumsum(np.deg2rad([175.0, -85.0, 92.0]))
    steps = np.array([31.0, 33.5, 25.0]) * np.exp(1j * heading)
    ends = np.array([-steps.sum(), -steps[1:].sum(), -steps[2], 0j])
    for k, name in enumerate(("l1 31", "l2 33.5", "l3 25")):
        along = (said[name] - ends[k]) / (steps[k] / abs(steps[k]))
        assert along.real == pytest.approx(abs(steps[k]) / 2, abs=1e-9) and 8 < abs(along.imag) < 19


def test_an_unfinished_stage_is_drawn_as_far_as_it_goes(tmp_path, ax):
    (tmp_path / "half.toml").write_text(HALF)
    found = flexfem.view(tmp_path / "half.toml", tmp_path)
    assert found.missing == MISSING and found.name == "half a stage" and not found.window
    assert [Path(path).name for path in found.written] == ["half-drawing.png", "half-drawing.pdf"]
    assert found.assumed == [] and set(found.not_stated) == {
        *("chain.link_lengths_mm", "chain.joint_angles_deg", "hinges.base.radius_mm", "hinges.base.neck_mm"),
        *("hinges.elbow.radius_mm", "platform.hub_radius_mm"),
    }
    assert found.warnings == [f"{', '.join(MISSING)}: missing, and what needs it is not drawn"]
    plot_dimensions(ax, with_changes(), MISSING)
    assert set(texts(ax)) == {
        *("l1 31", "l2 33.5", "l3 25", "chain 1", "chain 2", "chain 3", "hub R 7.7"),
        *("base hinge R 3.9, t 0.53", "elbow hinge R 1.6", "platform hinge"),
    }
    assert sorted(patch.radius for patch in ax.patches) == [*[3.9] * 6, 7.7]
    bases = [np.mean([complex(*patch.center) for patch in ax.patches[1:][k : k + 2]]) for k in (0, 2, 4)]
    expected = bases[0] * np.exp(2j * np.pi / 3 * np.arange(3))
    np.testing.assert_allclose(bases, expected, rtol=0, atol=1e-9)
    assert bases[0] == pytest.approx(complex(55.8668, -35.3293), abs=1e-4)


def test_an_unfinished_stage_of_unlike_chains_shows_every_hinge_that_is_given(ax):
    """Overrides stand for what is missing on their chain; hinges that differ are labelled on theirs."""
    plot_dimensions(ax, with_changes({"override": UNLIKE}), ["thickness_mm", "hinges.base.radius_mm", *MISSING])
    assert {"base hinge R 2.3, t 0.53", "base hinge t 0.53", "elbow hinge R 1.6"} < set(texts(ax))
    assert {"elbow hinge R 1.6, t 0.83", "platform hinge R 1.9, t 0.41"} < set(texts(ax))
    assert sorted(patch.radius for patch in ax.patches) == [1.6, 1.6, 1.9, 1.9, 2.3, 2.3, 7.7]


def test_a_drawing_says_what_it_does_not_show():
    def said(stage, missing=()):
        return " ".join(" ".join(text.get_text() for text in drawing_figure(stage, missing).texts).split())

    stage = flexfem.load(Path(__file__).parents[2] / "geometry" / "mobility6.toml")
    whole = said(stage)
    assert "thickness 10 mm; link width 9 mm; joint angles 180, -90, 90 deg; aluminium 7075-T6" in whole
    assert "assumed dimensions" in whole and "missing" not in whole
    partly = said(stage, ["thickness_mm"])
    assert "missing: thickness_mm" in partly and "thickness 10" not in partly and "Heavy lines: clamped" in partly
    assert "labelled on chain 1" not in said(with_changes({"override": UNLIKE}))


def test_with_a_display_a_window_opens_and_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with_changes().save("stage.toml")
    shown = []
    monkeypatch.setattr(dimensions, "has_display", lambda: True)
    with patch.object(pyplot, "show", lambda: shown.append(pyplot.gcf().axes[0].get_title())):
        found = flexfem.view("stage.toml")
    assert found.window and found.written == [] and shown == ["generic stage"]
    assert [path.name for path in tmp_path.iterdir()] == ["stage.toml"] and pyplot.get_fignums() == []


def test_without_a_display_there_is_none(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert not dimensions.has_display()
    monkeypatch.setenv("DISPLAY", ":99")
    with patch("matplotlib.get_backend", lambda: "TkAgg"):
        assert dimensions.has_display()
    with patch("matplotlib.get_backend", lambda: "agg"):
        assert not dimensions.has_display()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "x"\n', r"nothing to draw, expected chain\.link_lengths_mm and chain\.joint_angles_deg"),
        (HALF.replace("25.0]", "]"), r"link_lengths_mm = \[31.0, 33.5\], expected 3 values"),
        (HALF.replace("= 1.6", '= "1.6"'), r"hinges\.elbow\.radius_mm = \"1\.6\", expected a number"),
        (HALF.replace("neck_mm", "neckmm"), r"hinges\.base\.neckmm is an unknown key"),
        (HALF + "[[override]]\nchain = 2\n", "override"),
        ('[[curve]]\ndirection = "x"\npoints = 3\n', "this is a case file, expected a stage file"),
    ],
)
def test_what_is_wrong_in_an_unfinished_file_is_refused(tmp_path, text, said):
    (tmp_path / "half.toml").write_text(text)
    with pytest.raises(flexfem.BadInput, match=said) as refused:
        flexfem.view(tmp_path / "half.toml", tmp_path)
    assert "\n" not in str(refused.value) and len(list(tmp_path.iterdir())) == 1
    assert re.match(r".*half\.toml", str(refused.value))
