"""The figure of large displacements: every series where it belongs, each against its own linear answer."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flexfem.plot.drive import workspace_figure

SHARE = {"(16) without its second-order terms": 0.61, "(16)": 0.97, "exact equilibrium": 1.0}
HELD, LOADED = "finite elements held at the command", "finite elements under the load of exact equilibrium"
FAR = {"X": (0.3, "µm"), "Y": (0.4, "µm"), "θ": (0.006, "mrad")}  # mm, rad
WAY = {"X": (0.7, 0.31, -0.17), "Y": (0.22, -0.4, 0.13), "θ": (0.0, 0.0, 0.2)}  # per cent at the largest command


@pytest.fixture(scope="module")
def figure(made):
    return workspace_figure(made.workspace())


def shown(axes, label):
    """Points of the lines of a label."""
    return [line.get_xydata() for line in axes.get_lines() if line.get_label() == label]


def test_each_direction_shows_stiffness_and_errors_along_and_across_by_name(made, figure):
    fine, coarse, ends = np.linspace(-1, 1, 41), np.linspace(-1, 1, 9), np.array([-1.0, -0.1, 0.1, 1.0])
    assert len(figure.axes) == 9
    for row, (name, (far, unit)) in enumerate(FAR.items()):
        panels = figure.axes[3 * row : 3 * row + 3]
        for axes in panels:
            assert axes.get_xlabel() == f"commanded {name} ({unit})"
        scale = far / made.size_in(panels[0].get_xlabel())
        along, aside = WAY[name][row], [WAY[name][k] for k in range(3) if k != row]
        for axes, sizes, elements in (
            (panels[0], [2 * along], 1.9 / 2),
            (panels[1], [along], 0.9),
            (panels[2], aside, 0.9),
        ):
            for label, share in SHARE.items():
                for line, size in zip(shown(axes, label), sizes, strict=True):
                    np.testing.assert_allclose(line, np.column_stack([scale * fine, share * size * fine]), atol=1e-12)
            for line, size in zip(shown(axes, HELD), sizes, strict=True):
                np.testing.assert_allclose(
                    line, np.column_stack([scale * coarse, elements * size * coarse]), atol=1e-12
                )
        (loaded,) = shown(panels[1], LOADED)
        np.testing.assert_allclose(loaded, np.column_stack([scale * ends, 1.2 * along * ends]), atol=1e-12)
        assert not shown(panels[0], LOADED) and not shown(panels[2], LOADED)


def test_the_figure_says_what_the_terms_are_worth(made, figure):
    minus = "\N{MINUS SIGN}"
    said = [
        [text.get_text().split("\n")[1] for text in axes.texts] for k in range(3) for axes in figure.axes[3 * k :][:2]
    ]
    expected = [0.72 * 0.7, 0.36 * 0.7, 0.72 * -0.4, 0.36 * -0.4, 0.72 * 0.2, 0.36 * 0.2]
    assert said == [[f"{-worth:+.2f}, {worth:+.2f}".replace("-", minus)] for worth in expected]
    text = " ".join(made.texts(figure))
    assert "within ±30 µm and ±0.6 mrad: 0.12 %, within ±300 µm and ±6 mrad: 1.24 %" in text
    assert re.search(r"up to 0\.0[45] and 0\.68 %", text)
    assert "mobility 6, paros-weisbord" in text and "(1234 unknowns)" in text and "assumed" not in text


def test_a_panel_with_nothing_but_round_off_says_so(made, figure):
    said = [any("round-off only" in text.get_text() for text in axes.texts) for axes in figure.axes]
    assert said == [False] * 8 + [True]
    low, high = figure.axes[8].get_ylim()
    assert [text.get_text() for text in figure.axes[8].texts] == ["round-off only, axis ±1×10⁻⁴ %"]
    assert (low, high) == (-1e-4, 1e-4)
    assert "assumed dimensions" in made.texts(workspace_figure(made.workspace(assumed=["thickness_mm"])))
