"""Designs of mechanisms: closed forms of two leaves, infeasible designs inside the range, proof,
files and refusals.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import flexfem
from flexfem.design.model import Model
from flexfem.design.proof import ElementSolver
from flexfem.design.search import optimum
from flexfem.plot.design import design_figure
from flexfem.refused import BadInput

from ..tolerances import SOLVED
from .conftest import ROOT, best, require, tolerance

PARALLELOGRAM = ROOT / "geometry/parallelogram.toml"
LEVER = ROOT / "geometry/lever-amplifier.toml"
HELD = "stiffness.stiffness.analytic.x.x"
FREE = "stiffness.free.analytic.x"
MODE = "modes.frequency.1.analytic"
LENGTH = '[[free]]\nkey = "parameters.length_mm"\nfrom = 20.0\nto = 70.0\n'
SHORTEST = best("minimise", "parameters.length_mm")


def head(base, *ask):
    return f'name = "a test"\nstage = "{base}"\nseed = 7\nask = {list(ask)}\n'


@pytest.fixture
def sharp(tmp_path):
    """Two leaves without fillets in plane stress, each 0.5 mm x 10 mm."""
    path = tmp_path / "leaves.toml"
    path.write_text(
        'model = "plane_stress"\n'
        + PARALLELOGRAM.read_text().replace("fillet_mm = 0.5", "fillet_mm = 0")
    )
    return path


@pytest.mark.slow
def test_the_shortest_leaves_of_a_stiffness_are_those_of_the_closed_form(load, sharp):
    """Guided leaves in parallel: 1 / k = (L^3 / (12 E I) + 6 L / (5 G A)) / 2, with E = 71.7 GPa
    and nu = 0.33.
    """
    E = 71_700.0
    G = 71_700.0 / 2.66
    A = 5.0
    second = 10.0 * 0.5**3 / 12
    roots = np.roots([1 / (12 * E * second), 0, 1.2 / (G * A), -2 / 3.0])
    length = float(roots[np.isreal(roots)].real[0])
    model = Model(load(LENGTH, require(HELD, None, 3.0), SHORTEST, head=head(sharp, HELD)))
    assert optimum(model).values == pytest.approx([length], rel=1e-5)
    assert 0 < model.counts["drawn"] < 50 < model.counts["analytic"] < 1500
    stepped = Model(
        load(LENGTH + "step = 0.5\n", require(HELD, None, 3.0), SHORTEST, head=head(sharp, HELD))
    )
    assert optimum(stepped).values.item() == 0.5 * np.ceil(2 * length)


@pytest.mark.slow
def test_designs_whose_parts_touch_are_refused_and_the_search_goes_on(load):
    """The roots of two leaves are each 0.5 mm + 2 x 0.5 mm high: nearer than 1.5 mm they are one."""
    near = '[[free]]\nkey = "parameters.distance_mm"\nfrom = 0.25\nto = 20.0\nstep = 0.25\n'
    model = Model(
        load(near, best("minimise", "parameters.distance_mm"), head=head(PARALLELOGRAM, FREE))
    )
    assert optimum(model).values.tolist() == [1.75]
    values = np.array([[0.25], [1.5], [1.75]])
    assert [model.drawable(each) for each in values] == [False, False, True]
    with pytest.raises(BadInput, match="touches leaf 2"):
        model.loaded.family.mechanism(values[1])


def test_a_parameter_that_is_an_expression_follows_the_free_ones(load):
    """x of the output of the lever is -ratio x arm, with an arm of 10 mm."""
    ratio = '[[free]]\nkey = "parameters.ratio"\nfrom = 3.0\nto = 6.0\n'
    model = Model(load(ratio, best("maximise", "2 * parameters.tip_mm"), head=head(LEVER, MODE)))
    assert model.evaluate(np.array([[3.5], [5.0]])).ravel().tolist() == [-70.0, -100.0]


@pytest.mark.slow
def test_a_design_is_proven_by_finite_elements_and_its_file_has_the_same_numbers(load, tmp_path):
    wanted = require(FREE, None, 2.0), require(MODE, 40.0)
    path = load(
        LENGTH + "step = 0.5\n", *wanted, SHORTEST, head=head(PARALLELOGRAM, FREE, MODE)
    ).path
    found = flexfem.run_design(path, tmp_path / "out")
    assert (
        found.feasible
        and found.agreed
        and {each.checked_by for each in found.requirements} == {"finite elements"}
    )
    made = flexfem.load(tmp_path / "out/wanted-mechanism.toml")
    assert made.provenance["parameters.length_mm"] == "designed: a test, seed 7"
    assert (
        made.parameters["length_mm"] == found.design["parameters.length_mm"]
        and made.hash == found.hash
    )
    assert made.body[1].path[0][1].text == "length + width / 2"
    stiffness, frequency = found.requirements
    assert (stiffness.unit, frequency.unit, found.objectives[0].unit) == ("N/mm", "Hz", "mm")
    at_rest = flexfem.stiffness(made, models="elements", resolution=8)
    assert stiffness.value == pytest.approx(
        at_rest.at("free", model="three dimensions", direction="x"), rel=SOLVED
    )
    assert stiffness.band == pytest.approx(
        at_rest.band("free", model="three dimensions", direction="x"), rel=1e-6
    )
    shorter = made.replace(parameters={"length_mm": found.design["parameters.length_mm"] - 0.5})
    again = (
        flexfem.stiffness(shorter, models="elements", resolution=8).at("free", direction="x").item()
    )
    assert stiffness.value + stiffness.band <= 2.0 < again and frequency.margin > 0
    figure = design_figure(found)
    assert figure.axes[0].get_title(loc="left").endswith("designed mechanism")


@pytest.mark.slow
def test_numbers_of_a_drive_are_by_finite_elements(load):
    """The question has no finite elements without the analytic model, whose rigid bodies move it 13
    % further.
    """
    motion = "drive.motion.drive.output.analytic.y"
    ratio = '[[free]]\nkey = "parameters.ratio"\nfrom = 3.0\nto = 6.0\n'
    loaded = load(ratio, best("maximise", f"abs({motion})"), head=head(LEVER, motion))
    values = loaded.base_values
    (solved,) = ElementSolver(loaded, Counter()).solve(values)
    found = Model(loaded).columns(values[None])[0]
    assert found[motion][0] / solved[motion] == pytest.approx(1.134, abs=0.01)


@pytest.mark.slow
def test_a_yield_range_by_linear_theory_is_told_apart_from_the_range(load, tmp_path):
    """Held in the other directions, the leaves of a parallelogram stretch: the range is far below
    the linear one.
    """
    linear = "stiffness.yield_range.analytic.x"
    path = load(
        LENGTH + "step = 10.0\n", best("maximise", linear), head=head(PARALLELOGRAM, linear)
    ).path
    found = flexfem.run_design(path, tmp_path / "out")
    (text,) = [each for each in found.warnings if "linear theory" in each]
    percent = float(text.partition("differ by ")[2].partition(" %")[0])
    made = flexfem.load(tmp_path / "out/wanted-mechanism.toml")
    at_rest = flexfem.stiffness(made, models="analytic")
    ends = abs(at_rest.at("range", others="held", direction="x")).min()
    assert percent == pytest.approx(
        100 * (ends / at_rest.at("yield_range", direction="x")[0] - 1), abs=0.6
    )
    assert percent < -30


NECK = '[[free]]\nkey = "hinges.elbow.neck_mm"\nfrom = 0.3\nto = 0.7\n'


@pytest.mark.parametrize(
    ("ask", "pieces", "message"),
    [
        (
            (HELD,),
            (tolerance(),),
            "expected no tolerance in a design of a mechanism, whose numbers are",
        ),
        ((HELD,), ("[drift]\n",), "expected no drift in a design of a mechanism"),
        ((), (), "expected ask = [...]: the numbers that a design of a mechanism computes"),
        (
            (HELD + ".z",),
            (),
            "ask: no number stiffness.stiffness.analytic.x.x.z of this stage and model",
        ),
        ((HELD,), (best("maximise", "mass_kg"),), 'not "mass_kg"'),
        (
            (HELD,),
            (best("minimise", "parameters.neck_mm"),),
            "expected a quantity that free dimensions change",
        ),
    ],
)
def test_what_does_not_apply_to_a_mechanism_is_refused_in_one_line(load, ask, pieces, message):
    with pytest.raises(BadInput, match=r"wanted\.toml") as refusal:
        load(LENGTH, *pieces, SHORTEST, head=head(PARALLELOGRAM, *ask))
    assert message in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_stage_has_no_numbers_of_other_questions(load):
    with pytest.raises(BadInput, match="expected no ask in a design of a stage"):
        load(
            NECK, best("maximise", "range_x_um"), head=head(ROOT / "geometry/mobility6.toml", HELD)
        )
