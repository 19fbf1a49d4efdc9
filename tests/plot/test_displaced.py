"""Figures of displaced mechanisms, and of large displacements."""

import numpy as np
import pytest

import flexfem
from flexfem.mechanism.expansion import expansion_of
from flexfem.plot import figures_of
from flexfem.plot.large import along_of

STAGE = "geometry/parallelogram.toml"


@pytest.fixture(scope="module")
def parallelogram():
    return flexfem.load(STAGE)


def texts_of(figure):
    return " ".join(text.get_text() for text in [*figure.texts, *(ax.title for ax in figure.axes)])


def test_the_figure_of_weight_states_the_numbers_of_the_table(parallelogram):
    found = flexfem.gravity(parallelogram, models="elements", resolution=4, plane=True)
    field = found.fields.made()["displacement"]
    model = found.axes["model"][-1]
    x, y, _ = found.at("pose", model=model, point=found.axes["point"][0])
    assert np.abs(field).max() >= 0.9 * np.hypot(x, y)
    shown = texts_of(figures_of(found)[""])
    stress = found.texts("stress", model=model)[0]
    assert stress.split(" ")[0] in shown
    assert "displacement by weight" in shown


def test_a_free_plate_expands_evenly_by_heat(parallelogram):
    found = flexfem.drift(parallelogram, models="elements", resolution=4, plane=True)
    fields = found.fields.made()
    # ground and plate expand alike
    expected = expansion_of(parallelogram).plate * found.fields.mesh.nodes
    assert fields["uniform"] == pytest.approx(expected, abs=1e-9)
    assert "1 K everywhere" in texts_of(figures_of(found)[""])


def test_the_curve_of_large_displacements_is_drawn_along_the_driven_direction(parallelogram):
    found = flexfem.large(parallelogram, models="analytic")
    force, tangent = figures_of(found)[""].axes
    assert along_of(found) == "x"
    assert force.get_ylabel() == "force (N)"
    assert "in x" in tangent.get_xlabel()
