"""Pictures of stage, necks, hinge and models."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from flexfem.report import style
from flexfem.report.deformed import deformed_figure, exaggeration, largest_stress, name_of_place
from flexfem.report.hinge_sketch import hinge_rows, hinge_sketch
from flexfem.report.mesh_pictures import neck_figure, stage_figure
from flexfem.report.model_sketch import links_of_chain, mobility_line, model_sketch
from flexfem.report.style import rendered
from flexfem.report.triangles import clamped_edges, curves, edges_of, loops_of

PICTURES = {
    "stage": lambda made, model: stage_figure(model, made.fields()),
    "neck": lambda made, model: neck_figure(model, made.fields()),
    "hinge": lambda made, model: hinge_sketch(model),
    "model": lambda made, model: model_sketch(model),
    "deformed": lambda made, model: deformed_figure(
        made.result({"a": (0.1, 0.0, 0.0)}, models={"a": model}, assumed=model.assumed), {"a": made.fields()}
    ),
}


def texts(figure):
    return [text.get_text() for where in (figure, *figure.axes) for text in where.texts]


@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.parametrize("assumed", [[], ["chain.link_lengths_mm"]])
def test_assumed_numbers_are_announced_exactly_when_there_are_some(made, name, assumed):
    figure = PICTURES[name](made, made.model(assumed=assumed))
    assert ("assumed dimensions" in texts(figure)) == bool(assumed)


def test_settings_of_the_user_change_nothing(made):
    usual = rendered(PICTURES["model"](made, made.model()), "png")
    with mpl.rc_context({"font.size": 25, "lines.linewidth": 9, "savefig.dpi": 40, "text.color": "green"}):
        assert rendered(PICTURES["model"](made, made.model()), "png") == usual
        assert mpl.rcParams["font.size"] == 25


def test_every_figure_is_drawn_in_the_style_of_the_house():
    folder = Path(style.__file__).parent
    modules = [import_module(f"flexfem.report.{path.stem}") for path in folder.glob("*.py")]
    drawing = {
        name: found
        for module in modules
        for name, found in vars(module).items()
        if name.endswith(("_figure", "_sketch")) and name != "new_figure"
    }
    assert {"error_figure", "budget_figure", "map_figure", "hinge_sketch"} <= drawing.keys()
    assert all(found.__code__.co_name == "styled" for found in drawing.values())


def test_nine_hinges_are_numbered(made):
    assert {str(number) for number in range(1, 10)} <= set(texts(stage_figure(made.model(), made.fields())))


def test_lengths_and_angles_of_the_sketch_close_the_chain(made):
    lengths, angles = links_of_chain(made.model())
    heading = np.cumsum(angles)
    end = made.hinges()[0].centre + lengths @ np.column_stack([np.cos(heading), np.sin(heading)])  # (19), (20)
    np.testing.assert_allclose(end, 0.0, atol=1e-12)
    assert np.all(np.abs(angles) <= np.pi)


def test_half_a_turn_counts_as_positive(made):
    hinges = made.hinges()
    hinges[1] = hinges[1].model_copy(update={"centre": (20.0, hinges[0].centre[1])})
    assert links_of_chain(made.model(hinges=hinges))[1][0] == pytest.approx(np.pi)


@pytest.mark.parametrize("mobility", [3, 6, 12, 21])
def test_mobility_of_the_sketch_is_that_of_its_joints(made, mobility):
    model = made.model(hinges=made.hinges(mobility), mobility=mobility)
    assert f"= {mobility}," in mobility_line(model)
    sliders = {3: 0, 6: 3, 12: 9, 21: 18}[mobility]
    blocks = [patch for patch in model_sketch(model).axes[0].patches if patch.get_edgecolor()[2] > 0.6]
    assert len(blocks) == sliders


def test_largest_stress_is_named_with_its_place(made):
    fields, model = made.fields(), made.model()
    assert name_of_place(model, fields, 0) == "pad of chain 1"
    assert any("31.7 MPa" in text for text in texts(PICTURES["deformed"](made, model)))
    nodes = fields.nodes.copy()
    nodes[0] = np.array(model.hinges[4].centre) + 0.1
    moved = fields.model_copy(update={"nodes": nodes})
    assert name_of_place(model, moved, 0) == "hinge 5 (elbow, chain 2)"


def test_round_off_does_not_decide_between_places_alike(made):
    fields, model = made.fields(), made.model()
    for high in (0, 18, 36):
        stress = np.ones(len(fields.nodes))
        stress[[0, 18, 36]] = 5.0
        stress[high] += 1e-12
        found = largest_stress(model, fields.model_copy(update={"stress": stress}))
        assert found == (0, "pad of chain 1 and 2 more alike")


def test_exaggeration_is_stated(made):
    factor = exaggeration({"a": made.fields()})
    assert any(f"× {factor:g};" in text for text in texts(PICTURES["deformed"](made, made.model())))


def test_hinges_alike_share_a_row(made):
    assert [row[0] for row in hinge_rows(made.model())] == ["1, 4, 7", "2, 5, 8", "3, 6, 9"]
    assert hinge_rows(made.model())[1][1:4] == ("1.5", "0.4", "3.4")


def test_curved_sides_pass_through_their_middles(made):
    fields = made.fields()
    every = edges_of(fields.triangles).every
    np.testing.assert_allclose(curves(fields.nodes, every, 2)[:, 1], fields.nodes[every[:, 2]], atol=1e-12)


def test_boundary_of_two_triangles_is_one_loop():
    edges = edges_of(np.array([[0, 1, 2, 3, 4, 5], [1, 6, 2, 7, 8, 4]]))
    assert len(edges.every) == 5
    (loop,) = loops_of(edges.boundary)
    assert set(loop[:, 2].tolist()) == {3, 5, 7, 8}
    np.testing.assert_array_equal(loop[:, 1], np.roll(loop[:, 0], -1))


def test_clamped_edges_are_those_that_stand_still(made):
    fields = made.fields()
    held = clamped_edges(edges_of(fields.triangles).boundary, fields.displacement)
    assert sorted(held[:, 2].tolist()) == [5, 23, 41]
