"""Parts of a design on problems of one free dimension, whose answers are read off."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from flexfem.synthesis.elements import ProposedElements, Solve
from flexfem.synthesis.mapping import Proof, _kept, content
from flexfem.synthesis.model import WORST, Correction, Model
from flexfem.synthesis.prices import prices
from flexfem.synthesis.relaxed import alternatives

from .conftest import NECK, best, require

THICKNESS = '[[free]]\nlabel = "b"\nkey = "thickness_mm"\nfrom = 6.0\nto = 12.0\n'
STIFFEST, SOFTEST = best("maximise", "kxx_n_per_mm"), best("minimise", "kxx_n_per_mm")


@pytest.mark.parametrize(
    ("ends", "objective"), [((None, 8.0), STIFFEST), ((8.0, None), SOFTEST)], ids=["at most", "at least"]
)
def test_one_per_cent_less_thickness_costs_one_per_cent_of_the_stiffness_and_more_likewise(load, ends, objective):
    """Whatever the guard of the search was; an end that is 0.6 % away is not active."""
    near = require("2 * thickness_mm", *(None if end is None else 16.1 if end is ends[1] else 15.9 for end in ends))
    model = Model(load(THICKNESS, near, require("thickness_mm", *ends), objective), guard=np.array([0.05, 0.05]))
    costs = prices(model, np.array([8.0]))
    assert costs.active == [False, True] and costs.price == pytest.approx([np.nan, 1.0], rel=1e-4, nan_ok=True)
    assert costs.at_ends == []


def test_an_objective_goes_the_way_that_is_asked_and_a_miss_is_worse_than_any_value(load):
    designs = np.array([[7.0], [9.0], [11.0]])
    for objective, order in ((STIFFEST, [1, 0, 2]), (SOFTEST, [0, 1, 2])):
        model = Model(load(THICKNESS, require("thickness_mm", None, 10.0), objective))
        merit = model.merit(model.found(designs))
        assert np.argsort(merit).tolist() == order
        assert merit[2] == pytest.approx(1.1 * WORST) and np.all(np.abs(merit[:2]) < WORST)


def test_a_guard_moves_each_end_inward_by_its_part_of_the_size(load):
    model = Model(load(THICKNESS, require("thickness_mm", 7.0, 10.0), STIFFEST), guard=np.array([0.05]))
    low, high = model.ends
    assert low == pytest.approx([7.5]) and high == pytest.approx([9.5])


def test_ends_that_are_near_leave_room_between_their_guards_and_for_the_band(load):
    model = Model(load(THICKNESS, require("thickness_mm", 7.0, 7.2), STIFFEST), guard=np.array([0.05]))
    low, high = model.ends
    assert low == pytest.approx([7.09]) and high == pytest.approx([7.11])
    for value, kept in ((7.1, True), (7.05, False)):
        said = {"elements": np.array([0.0, value]), "bands": np.array([0.0, 0.3])}
        assert _kept(model, Proof(**(dict.fromkeys(Proof._fields) | said))) is kept


def test_relaxations_are_of_the_corrected_model_and_each_of_its_own_requirement(load):
    """Of a metal that is twice as stiff; thickness 11 mm and the stiffness of 13 mm cannot both be had."""
    of = Model(load(THICKNESS, require("kxx_n_per_mm", 1.0), STIFFEST)).found(np.array([[12.0]])).quantities[0, 0]
    ends = require("thickness_mm", None, 11.0), require("kxx_n_per_mm", 13 / 6 * of)
    model = Model(load(THICKNESS, *ends, SOFTEST), corrections={"kxx_n_per_mm": Correction(2.0)})
    first, second = alternatives(model, np.array([7.0]), 3)
    assert (first.requirement, first.relax_to, first.percent) == ("thickness_mm", None, None)
    assert second.requirement == "kxx_n_per_mm" and second.relax_to == pytest.approx(11 / 6 * of, rel=1e-6)
    assert second.percent == pytest.approx(200 / 13, rel=1e-6)


@pytest.mark.parametrize(("value", "kept"), [(60.6, True), (60.4, False), (69.6, False), (69.4, True)])
def test_an_end_is_kept_where_the_band_is_within_it_too(load, value, kept):
    model = Model(load(NECK, require("kxx_n_per_mm", 60, 70), STIFFEST))
    said = {"elements": np.array([value, value]), "bands": np.array([0.5, 0.5])}
    assert _kept(model, Proof(**(dict.fromkeys(Proof._fields) | said))) is kept


def test_what_is_stored_answers_its_own_question_alone(load):
    loaded = load(THICKNESS, NECK, STIFFEST)
    elements = ProposedElements(loaded, Counter())
    thin, thick = (elements._study(loaded.stage.replace(thickness=b), 4, 2) for b in (8.0, 9.0))
    finer = elements._study(loaded.stage.replace(thickness=8.0), 6, 2)
    asked = [Solve(thin, 0), Solve(thin, 1), Solve(thick, 0), Solve(finer, 0)]
    assert len({each.question for each in asked}) == 4 and Solve(thin, 0).question == asked[0].question
    model = Model(loaded)
    corrected = model.changed(corrections={"kxx_n_per_mm": Correction(1.01)})
    guarded = model.changed(guard=np.zeros(0))
    shifted, other = model.changed(shifts={"coupling_95": 1.01}), Model(load(THICKNESS, NECK, SOFTEST))
    second, bounded, tightened = (
        model.changed(**each) for each in ({"objective": 1}, {"bounded": {1: 3.0}}, {"tightened": {0: 0.01}})
    )
    states = [content(each) for each in (model, corrected, guarded, shifted, other, second, bounded, tightened)]
    assert all(a != b for k, a in enumerate(states) for b in states[:k]) and content(Model(loaded)) == states[0]
