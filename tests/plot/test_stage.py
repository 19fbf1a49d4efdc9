"""Drawings of a stage show its dimensions, mesh, necks and model at their places, and say when
numbers are assumed.
"""

from __future__ import annotations

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import flexfem
from flexfem.paper.figures.deformed import deformed_figure, largest_stress
from flexfem.paper.figures.hinge import hinge_rows, hinge_sketch
from flexfem.paper.figures.mesh import neck_figure, stage_figure
from flexfem.paper.figures.pseudo_rigid import links_of_chain, mobility_line, model_sketch
from flexfem.plot.fields import exaggeration
from flexfem.plot.plate import plot_plate
from flexfem.results import Fields

from ..conftest import UNLIKE, with_changes

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
PICTURES = {
    "stage": lambda made, model: stage_figure(model, made.fields()),
    "neck": lambda made, model: neck_figure(model, made.fields()),
    "hinge": lambda made, model: hinge_sketch(model),
    "model": lambda made, model: model_sketch(model),
}


def texts(ax) -> dict[str, np.ndarray]:
    return {text.get_text(): np.array(text.get_position()) for text in ax.texts if text.get_text()}


@pytest.mark.parametrize("assumed", [[], ["chain.link_lengths_mm"]])
@pytest.mark.parametrize("name", PICTURES)
def test_assumed_numbers_are_announced_exactly_when_there_are_some(made, name, assumed):
    said = made.texts(PICTURES[name](made, made.model(assumed=assumed)))
    assert ("assumed dimensions" in said) == bool(assumed)


def test_the_stage_is_drawn_in_mm_with_numbers_hub_and_ground(made):
    axes = stage_figure(made.model(), made.fields()).axes[0]
    model, fields = (made.model(), made.fields())
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("x (mm)", "y (mm)", 1.0)
    labels = texts(axes)
    for number in range(1, 10):
        distances = [np.linalg.norm(labels[str(number)] - other.centre) for other in model.hinges]
        assert np.argmin(distances) == number - 1
    mesh = axes.collections[0].get_paths()
    assert len(mesh) == len(fields.triangles)
    sides = [{tuple(np.round(point, 9)) for point in path.vertices} for path in mesh]
    assert all(
        tuple(np.round(fields.nodes[n], 9)) in sides[k]
        for k, t in enumerate(fields.triangles)
        for n in t
    )
    (ground,) = [each for each in axes.collections if max(each.get_linewidth()) > 2.0]
    assert (
        len(ground.get_paths()[0].vertices) == 3 * 3
    )  # one clamped side of each chain: ends and middle
    (hub,) = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert hub.radius == 7.0


def test_necks_are_seen_along_themselves_with_their_own_dimensions(made):
    hinges = [
        one.model_copy(update={"radius": 1.3 + 0.1 * k, "neck": 0.4 + 0.1 * k})
        for k, one in enumerate(made.hinges())
    ]
    figure = neck_figure(made.model(hinges=hinges), made.fields())
    assert [ax.texts[0].get_text() for ax in figure.axes] == [
        "R = 1.3 mm",
        "R = 1.4 mm",
        "R = 1.5 mm",
        "t = 0.4 mm",
        "t = 0.5 mm",
        "t = 0.6 mm",
    ]
    for ax, hinge in zip(figure.axes[:3], hinges, strict=False):
        corner = (
            np.array(made.fields().nodes[made.fields().triangles[hinges.index(hinge), 0]])
            - hinge.centre
        )
        along = (
            corner @ [np.cos(hinge.axis), np.sin(hinge.axis)],
            corner @ [-np.sin(hinge.axis), np.cos(hinge.axis)],
        )
        shown = np.concatenate([path.vertices for path in ax.collections[0].get_paths()])
        assert np.linalg.norm(shown - along, axis=1).min() < 1e-9


def test_hinges_alike_share_a_row(made):
    assert [row[0] for row in hinge_rows(made.model())] == ["1, 4, 7", "2, 5, 8", "3, 6, 9"]
    assert hinge_rows(made.model())[1][1:] == ("1.5", "0.4", "3.4", "0.267")
    (table,) = hinge_sketch(made.model()).axes[1].tables
    said = {cell.get_text().get_text() for cell in table.get_celld().values()}
    assert {"R (mm)", "1, 4, 7", "1.3", "0.4", "3"} <= said


def test_lengths_and_angles_of_the_model_close_the_chain_and_are_written(made):
    lengths, angles = links_of_chain(made.hinges())
    heading = np.cumsum(angles)
    end = made.hinges()[0].centre + lengths @ np.column_stack(
        [np.cos(heading), np.sin(heading)]
    )  # (19), (20)
    np.testing.assert_allclose(end, 0.0, atol=1e-12)
    labels = texts(model_sketch(made.model()).axes[0])
    wanted = {
        "$l_1$ = 27.02 mm",
        "$l_2$ = 34.23 mm",
        "$l_3$ = 21.21 mm",
        "chain 1",
        "chain 2",
        "chain 3",
    }
    angles_written = {
        rf"$\varphi_{k}$ = {angle}°"
        for k, angle in enumerate(("−177.9", "−85.41", "91.42"), start=1)
    }
    assert wanted | angles_written <= labels.keys()
    hinges = made.hinges()
    hinges[1] = hinges[1].model_copy(update={"centre": (20.0, hinges[0].centre[1])})
    assert links_of_chain(hinges)[1][0] == pytest.approx(np.pi)  # half a turn counts as positive


@pytest.mark.parametrize(("mobility", "sliders"), [(3, 0), (6, 3), (12, 9), (21, 18)])
def test_joints_of_the_model_have_its_freedoms(made, mobility, sliders):
    hinges = made.hinges(mobility)
    model = made.model(hinges=hinges, mobility=mobility)
    figure = model_sketch(model)
    axes = figure.axes[0]
    circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
    np.testing.assert_allclose(
        [circle.center for circle in circles], [hinge.centre for hinge in hinges]
    )
    blocks = [
        patch.get_xy() for patch in axes.patches if to_hex(patch.get_edgecolor()) == "#0072b2"
    ]
    assert f"= {mobility}," in mobility_line(model) and len(blocks) == sliders
    if mobility == 21:  # along the neck for axial, across it for shear
        for k, hinge in enumerate(hinges):
            along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
            for block, way in zip(
                blocks[2 * k : 2 * k + 2], (along, [-along[1], along[0]]), strict=True
            ):
                assert abs((block[0] - block[1]) @ way) == pytest.approx(
                    np.linalg.norm(block[0] - block[1])
                )
    meant = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [text.split(":")[0].split()[0] for text in meant] == [
        "revolute",
        *["slider"] * {3: 0, 21: 2}.get(mobility, 1),
    ]


def test_a_deformed_stage_has_the_displacement_and_stress_that_are_said(made):
    one = made.fields()
    models = {"a": made.model(), "b": made.model()}
    other = one._replace(displacement=-0.7 * one.displacement, stress=1.4 * one.stress[::-1])
    result = made.result({"a": (0.1, 0.0, 0.0), "b": (0.2, 0.1, 0.0)}, direction="y", models=models)
    figure = deformed_figure(result, {"a": one, "b": other})
    assert "Stress in the displaced stage, y = 50.0 µm A case $y$: finite" in " ".join(
        made.texts(figure)
    )
    assert "displacements × 100; grey: at rest" in " ".join(made.texts(figure))
    *shown, bar = figure.axes
    for axes, fields, value in zip(shown, (one, other), ("31.7", "44.4"), strict=True):
        lines = [each for each in axes.collections if isinstance(each, PathCollection)]
        rest, moved = (each.get_paths()[0].vertices for each in lines)
        corners = [np.argmin(np.linalg.norm(rest - node, axis=1)) for node in fields.nodes]
        np.testing.assert_allclose(
            moved[corners] - rest[corners], 100 * fields.displacement, atol=1e-9
        )
        colours = axes.collections[0]
        np.testing.assert_allclose(colours.get_array(), np.clip(fields.stress, 44.38e-4, None))
        assert any(text.get_text().startswith(f"largest {value} MPa near ") for text in axes.texts)
        node = int(np.argmax(fields.stress))
        np.testing.assert_allclose(
            axes.lines[0].get_xydata()[0], fields.nodes[node] + 100 * fields.displacement[node]
        )
    assert bar.get_xlabel() == "von Mises stress (MPa)"


def test_no_part_is_drawn_through_another():
    """Two triangles 0.3 mm apart on a length of 20 mm; one moves by 1 um to the other: 1 mm would
    be through it.
    """
    x = np.array([[0, 9.85, 0, 4.9, 4.9, 0], [10.15, 20, 20, 15, 20, 15]])
    y = np.array([0, 0, 8, 0, 4, 4])
    nodes = np.column_stack([x.ravel(), np.tile(y, 2)])
    fields = Fields(nodes, np.arange(12).reshape(2, 6), np.zeros(2), np.zeros((12, 2)), np.ones(12))
    for sign, signs, factor in ((1, (1.0,), 200), (-1, (1.0,), 1000), (-1, (1.0, -1.0), 200)):
        moved = np.where(np.arange(12)[:, None] < 6, [sign * 1e-3, 0.0], 0.0)
        assert exaggeration(fields._replace(displacement=moved), signs=signs) == factor


def test_the_largest_stress_is_near_a_hinge_and_round_off_does_not_choose(made):
    fields = made.fields()
    model = made.model()
    for high in (0, 18, 36):
        stress = np.ones(len(fields.nodes))
        stress[[0, 18, 36]] = 5.0
        stress[high] += 1e-12
        assert largest_stress(model, fields._replace(stress=stress)) == (
            0,
            "hinge 1 (base, chain 1)",
        )


def test_every_dimension_is_on_the_drawing_beside_what_it_measures():
    ax = Figure(figsize=(8, 8)).add_subplot()
    stage = with_changes({"override": UNLIKE})
    plot_plate(ax, stage)
    said = texts(ax)
    assert said.keys() - {"x", "y", "20\xa0mm"} == {
        *("l1 31", "l2 33.5", "l3 25", "w 8.9", "platform R 16.3", "hub R 7.7"),
        *(
            "R 2.3, t 0.53",
            "R 1.6, t 0.47",
            "R 1.4, t 0.61",
            "R 3.9, t 0.53",
            "R 1.6, t 0.83",
            "R 1.9, t 0.41",
        ),
    }
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    assert all(left < x < right and low < y < high for x, y in said.values())
    steps = np.array([31.0, 33.5, 25.0]) * np.exp(1j * np.cumsum(np.deg2rad([175.0, -85.0, 92.0])))
    ends = np.array([-steps.sum(), -steps[1:].sum(), -steps[2]])
    for k, name in enumerate(("l1 31", "l2 33.5", "l3 25")):
        along = (complex(*said[name]) - ends[k]) / (steps[k] / abs(steps[k]))
        assert along.real == pytest.approx(abs(steps[k]) / 2, abs=1e-9)


def test_with_a_display_a_window_opens_and_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with_changes().save("stage.toml")
    opened = []
    pyplot.switch_backend("agg")  # before it seems to need a display
    monkeypatch.setattr(FigureCanvasAgg, "required_interactive_framework", "any")
    with patch.object(pyplot, "show", lambda: opened.append(pyplot.gcf().axes[0].get_title())):
        found = flexfem.view("stage.toml")
    assert found.window and found.written == [] and opened == ["generic stage"]
    assert [path.name for path in tmp_path.iterdir()] == [
        "stage.toml"
    ] and pyplot.get_fignums() == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "x"\n', r"\.toml: .*thickness_mm.* missing"),
        ("[chain]\nlink_lengths_mm = [31.0]\n", r"link_lengths_mm = \[31.0\], expected 3 values"),
        ("[hinges.base]\nneckmm = 1.0\n", r"hinges\.base\.neckmm is an unknown key"),
        (
            '[[curve]]\ndirection = "x"\npoints = 3\n',
            "this is a case file, expected a mechanism or stage file",
        ),
    ],
)
def test_what_is_wrong_in_a_file_is_refused(tmp_path, text, said):
    (tmp_path / "half.toml").write_text(text)
    with pytest.raises(flexfem.BadInput, match=said) as refused:
        flexfem.view(tmp_path / "half.toml", output=tmp_path)
    assert "\n" not in str(refused.value) and len(list(tmp_path.iterdir())) == 1
    assert re.match(r".*half\.toml", str(refused.value))
