"""The figure of the warm stage: every number of a case at its panel, what moves, and which way it is warmer."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation

import flexfem
from flexfem.page.motion import drift_section
from flexfem.plot.fields import drift_figure, exaggeration, plot_drift
from flexfem.verify.drift import CASES, DriftFields, WarmStage

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
POSES = ([0.0, 1e-15, 5.5e-6], [-0.0226, 0.003, -4e-5], [-0.0041, -0.0213, 3e-5])
EDGES = np.array([[0, 1, 3], [18, 19, 21]])


@pytest.fixture(scope="module")
def found(made):
    """Poses, stresses and fields that differ in every case."""
    record = flexfem.drift(flexfem.load(STAGE), resolution=None)
    cases, fields = {}, {}
    for k, name in enumerate(CASES):
        stress = [[1.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, (2.0 + 11.0 * k)]]
        elements = WarmStage(pose=POSES[k], stress=stress, reaction=np.eye(3).tolist())
        cases[name] = record.cases[name].model_copy(update={"elements": elements})
        one = made.fields()
        fields[name] = one.model_copy(update={"displacement": (k + 1) * one.displacement, "stress": 3**k * one.stress})
    return DriftFields(record.model_copy(update={"cases": cases}), fields, EDGES, 7.0)


def test_every_panel_has_the_numbers_of_its_case(found, made):
    figure = drift_figure(found)
    titles = [ax.get_title(loc="left") for ax in figure.axes[:3]]
    assert titles[0].startswith("(a) 1 K everywhere, displacements × ") and "\nX 0, Y 0, θ 5.500 µrad; " in titles[0]
    assert "along X" in titles[1] and "X −22.60 µm, Y 3.000 µm, θ −40.00 µrad; necks to 13.0 MPa" in titles[1]
    assert "along Y" in titles[2] and "X −4.100 µm, Y −21.30 µm, θ 30.00 µrad; necks to 24.0 MPa" in titles[2]
    assert [float(t.split("× ")[1].split("\n")[0]) for t in titles] == pytest.approx(
        [exaggeration({"": each}) for each in found.fields.values()]
    )
    assert [ax.get_xlabel() for ax in figure.axes[3:]] == [
        f"von Mises stress (MPa per {per})" for per in ("K", "K/mm", "K/mm")
    ]
    assert [ax.get_xlim()[1] for ax in figure.axes[3:]] == pytest.approx([31.7, 3 * 31.7, 9 * 31.7])
    page = drift_section(found).html
    rows = [re.findall("<t[hd][^>]*>(?:<button[^>]*>)?([^<]*)", row) for row in page.split("<tr")]
    assert ["change of temperature", "model", "X (µm)", "Y (µm)", "θ (µrad)", "highest neck stress (MPa)"] in rows
    assert ["1 K/mm along X", "finite elements", "−22.60", "3.000", "−40.00", "13.00"] in rows
    (words,) = [text for text in made.texts(figure) if text.startswith("Expansion")]
    assert "Expansion 23.60 µm/(m K), frame 12.00 µm/(m K);" in words and "grows with finer meshes" in words


@pytest.mark.parametrize(("case", "way"), [("gradient in x", (0.1, 0.0)), ("gradient in y", (0.0, 0.1))])
def test_a_gradient_has_an_arrow_to_where_it_is_warmer_and_clamped_edges_move(found, case, way):
    ax = plot_drift(Figure().subplots(), found, case)
    (arrow,) = [each for each in ax.texts if isinstance(each, Annotation)]
    assert np.subtract(arrow.xyann, arrow.xy) == pytest.approx(-np.array(way))
    fields = found.fields[case]
    moved = fields.nodes + exaggeration({"": fields}) * fields.displacement
    (bars,) = [each for each in ax.collections if each.get_linewidth()[0] == 3.0]
    assert [line[0] for line in bars.get_segments()] == pytest.approx(moved[EDGES[:, 0]])


def test_a_uniform_change_has_no_arrow_and_without_elements_there_is_nothing_to_draw(found):
    assert not plot_drift(Figure().subplots(), found, "uniform").texts
    with pytest.raises(flexfem.BadInput, match="case 'uniform', expected those of finite elements"):
        plot_drift(None, found._replace(fields={}), "uniform")
