"""The figure of what a drive reaches: the section, the solid, and what bounds them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import flexfem
from flexfem.plot.drive import reach_figure
from flexfem.verify.limits import kinds
from flexfem.verify.reach import Reach

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"


@pytest.fixture(scope="module")
def found() -> Reach:
    """Light preloads and a load: edges and faces by strokes alone and by contacts too; nothing symmetric."""
    stage = flexfem.load(STAGE)
    light = stage.replace(
        model="plane_stress", actuator=[each.model_copy(update={"preload": 4.0}) for each in stage.actuator]
    )
    return flexfem.reach(light, [0.7, -0.4, 7.0], resolution=None)


@pytest.fixture(scope="module")
def figure(found):
    return reach_figure(found)


def test_the_section_is_drawn_in_micrometres_each_edge_by_its_limits(found, figure):
    section = figure.axes[0]
    assert (section.get_xlabel(), section.get_ylabel(), section.get_aspect()) == ("X (µm)", "Y (µm)", 1.0)
    drawn = {each.get_label(): each for each in section.collections if isinstance(each, LineCollection)}
    assert set(drawn) == {"stroke", "stroke and contact"}
    for label, each in drawn.items():
        wanted = [[e.start, e.end] for e in found.section if " and ".join(kinds(e.by)) == label]
        np.testing.assert_allclose(each.get_segments(), 1e3 * np.array(wanted))
    assert len({str(each.get_linestyle()) for each in drawn.values()}) == 2
    circle = section.get_lines()[-1].get_xydata()
    np.testing.assert_allclose(np.linalg.norm(circle - 1e3 * np.array(found.rest[:2]), axis=1), 1e3 * found.circle)
    inside = np.array([edge.start for edge in found.section])
    assert np.all(np.ptp(inside, axis=0) < [0.055, 0.055]) and np.all(np.ptp(inside, axis=0) > 0.045)


def test_the_longest_edges_are_numbered_and_their_limits_written_out(found, figure):
    numbers = {text.get_text(): text.get_position() for text in figure.axes[0].texts}
    assert list(numbers) == [str(k) for k in range(1, 13)]
    long = sorted(found.section, key=lambda e: np.hypot(e.end[0] - e.start[0], e.end[1] - e.start[1]))[-12:]
    in_order = [edge for edge in found.section if edge in long]
    written = "\n".join(text.get_text() for axes in figure.axes[2:] for text in axes.texts)
    for k, edge in enumerate(in_order, start=1):
        middle = 1e3 * np.mean([edge.start, edge.end], axis=0)
        assert np.linalg.norm(np.subtract(numbers[str(k)], middle)) < 4.0
        line = written.replace("\n", " ").split(f"{k}  ")[1].split("  ")[0]
        for name in edge.by:
            kind, _, rest = name.partition(" of ")
            short = rest.replace(", longest", " +").replace(", shortest", " \N{MINUS SIGN}")
            assert f"{kind}: " in line and short in line


def test_the_faces_that_are_seen_are_drawn_by_their_limits(found, figure):
    solid = figure.axes[1]
    filled = [each for each in solid.patches if each.get_fill()]
    assert len(filled) == sum(
        np.array(face.normal) @ [np.cos(np.deg2rad(62)) * 0.91355, -np.sin(np.deg2rad(62)) * 0.91355, 0.40674] > 0
        for face in found.faces
    )
    assert len({(each.get_hatch(), tuple(each.get_facecolor())) for each in filled}) == 2
    assert [text.get_text() for text in solid.get_legend().get_texts()] == ["stroke", "stroke and contact"]
    said = {text.get_text().replace("\N{MINUS SIGN}", "-") for text in solid.texts}
    V = np.array(found.vertices) * [1e3, 1e3, 1e3]
    assert {"X (µm)", "Y (µm)", "θ (mrad)"} < said
    assert {f"{value:.3g}" for value in (*V.min(axis=0), *V.max(axis=0))} <= said


def test_the_figure_says_ranges_load_and_whose_dimensions(found, figure, made):
    texts = " ".join(made.texts(figure)).replace("\N{MINUS SIGN}", "-")
    held = [each.held for each in found.ranges.values()]
    for each, unit in zip(held, ("µm", "µm", "mrad"), strict=True):
        assert each is not None and f"{1e3 * each.low:.4g} to {1e3 * each.high:.4g} {unit}" in texts
    assert "load 0.7 N, -0.4 N, 7 N mm" in texts and "assumed dimensions" in texts
    assert f"a circle of {1e3 * found.circle:.4g} µm" in texts and f"a ball of {1e3 * found.ball:.4g} µm" in texts


def test_what_has_no_area_and_no_volume_is_drawn_too(found):
    flat = found.model_copy(update={"section": [], "faces": [], "circle": 0.0, "ball": 0.0, "dimension": 2})
    figure = reach_figure(flat)
    assert [text.get_text() for text in figure.axes[0].texts] == ["no area is reached at θ = 0"]
    assert len(figure.axes[1].get_lines()[-1].get_xdata()) == len(found.vertices) + 1
