"""Figures of displaced mechanisms, and of large displacements."""

import numpy as np
import pytest

import flexfem
from flexfem.mechanism.expansion import expansion_of
from flexfem.plot import figures_of
from flexfem.plot.large import along_of
from flexfem.plot.text import typeset

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


def test_a_figure_of_heat_states_once_that_nothing_is_stressed_and_prints_no_round_off(
    parallelogram,
):
    found = flexfem.drift(parallelogram, models="elements", resolution=4, plane=True)
    shown = texts_of(figures_of(found)[""])
    assert shown.count("No case causes stress") == 1
    assert "0 MPa" not in shown and "e\N{MINUS SIGN}" not in shown and "e-" not in shown


def test_bars_are_named_where_they_are(parallelogram):
    found = flexfem.large(parallelogram, models="analytic")
    assert "Bars" not in texts_of(figures_of(found)[""])


def test_the_life_of_every_hinge_is_named(parallelogram):
    steel = parallelogram.replace(material="steel-4340")
    found = flexfem.life(steel, amplitude=(2.0, 0, 0), models="analytic")
    figure = figures_of(found)[""]
    rows = [label.get_text() for label in figure.axes[1].get_yticklabels()]
    assert sorted(rows) == ["leaf", "leaf 2"]
    (drawn,) = (line for line in figure.axes[1].lines if line.get_label() == "analytic")
    np.testing.assert_allclose(np.sort(drawn.get_xdata()), np.sort(found.cycles[0]))
    assert "amplitude x 2000" in texts_of(figure).replace("\n", " ")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("x -26.55 ± 2e-05 um", "x \u221226.55 ± 2×10⁻⁵ um"),
        ("for 1000 to 1e6 cycles", "for 1000 to 10⁶ cycles"),
        ("2.1e+04 N/mm of al-7075-t6", "2.1×10⁴ N/mm of al-7075-t6"),
    ],
)
def test_numbers_of_figures_have_minus_signs_and_powers_of_ten(text, shown):
    assert typeset(text) == shown
