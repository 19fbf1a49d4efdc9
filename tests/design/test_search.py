"""Optima that are known by other routes."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.design import search
from flexfem.design.model import MISSED, Model
from flexfem.design.outcome import relaxations, sensitivities
from flexfem.design.search import optimum

from ..tolerances import DENSE
from .conftest import HEAD, NECK, RADIUS, RANGE, STEPPED, best, require

STIFFNESS = 60.0  # N/mm


def test_a_thin_neck_at_its_rotational_stiffness_has_the_largest_radius_and_the_closed_form_neck(
    load,
):
    """K ~ t^(5/2) R^(-1/2) and stress per turn ~ (t/R)^(1/2), so at given K the range grows with R:
    R at its end.

    Then t = t0 (K/K0 (R/R0)^(1/2))^(2/5). One neck for all hinges, all of one radius, so that the
    platform's stiffness is that of one hinge times a number; in the thin-neck limit."""
    every = ", ".join(f'"hinges.{name}.{{}}"' for name in ("base", "elbow", "platform"))
    neck = (
        f"[[free]]\nlabel = 't'\nkeys = [{every.format(*['neck_mm'] * 3)}]\nfrom = 0.0005\nto = "
        "0.004\n"
    )
    radius = (
        f"[[free]]\nlabel = 'R'\nkeys = [{every.format(*['radius_mm'] * 3)}]\nfrom = 1.0\nto = "
        "2.0\n"
    )
    head = HEAD + 'formula = "paros-weisbord"\nmobility = 3\n'
    start = np.array([[0.002, 1.0]])
    model = Model(load(neck, radius, require("ktt_n_mm_per_rad", 1.0), RANGE, head=head))
    reach, K0 = model.evaluate(start)[0]
    model = Model(load(neck, radius, require("ktt_n_mm_per_rad", K0), RANGE, head=head))
    found = optimum(model)
    assert found.relaxed == pytest.approx([0.002 * 2**0.2, 2.0], rel=1e-3)
    assert -found.merit / reach == pytest.approx((2.0 / 2**0.2) ** 0.5, rel=1e-3)
    powers = sensitivities(model, np.array([0.002, 1.5]))  # of the range and of K
    assert powers == pytest.approx(np.array([[-0.5, 2.5], [0.5, -0.5]]), rel=1e-2)


def test_a_dense_grid_has_no_better_design_and_the_optimum_within_a_step(load):
    model = Model(load(NECK, RADIUS, require("kxx_n_per_mm", STIFFNESS), RANGE))
    points = 150
    axes = np.linspace(model.space.low, model.space.high, points).T
    values = np.array(np.meshgrid(*axes)).reshape(2, -1).T
    merits = model.merit(model.evaluate(values))
    least = int(np.argmin(merits))
    found = optimum(model)
    assert merits[least] < MISSED
    objectives = [objective for _, objective, _ in found.history if objective is not None]
    assert objectives == sorted(objectives) and objectives[-1] == pytest.approx(
        -found.merit, rel=DENSE
    )
    assert found.merit <= merits[least] + 1e-9 * abs(merits[least])
    near = [np.ptp(values[:, k]) / (points - 1) for k in range(2)]
    alike = values[merits <= merits[least] + 2e-3 * abs(merits[least])]
    assert np.any(np.all(np.abs(alike - found.values) <= near, axis=1))


def test_a_seed_decides_what_is_searched_and_the_same_one_finds_the_same_again(load, monkeypatch):
    monkeypatch.setattr(search, "FULL", search.FULL._replace(generations=2, local=2))
    pieces = (NECK, RADIUS, require("kxx_n_per_mm", STIFFNESS), RANGE)
    searched = []

    class Recording(Model):
        def evaluate(self, values):
            searched[-1].append(values.copy())
            return super().evaluate(values)

    for seed in (5, 5, 6):
        searched.append([])
        optimum(Recording(load(*pieces, head=HEAD.replace("seed = 7", f"seed = {seed}"))))
    once, again, other = searched
    assert len(once) == len(again) and all(
        np.array_equal(a, b) for a, b in zip(once, again, strict=True)
    )
    assert (
        len(once[0]) == 1025 and not np.isin(once[0][1:], other[0][1:]).any()
    )  # the base stage first, then a sample


def test_a_design_that_cannot_be_drawn_is_never_the_answer(load, monkeypatch):
    """The best by its numbers cannot be drawn here, nor can what is made of it by rounding."""
    model = Model(load(*STEPPED, require("kxx_n_per_mm", STIFFNESS), RANGE))
    monkeypatch.setattr(
        Model, "drawable", lambda self, values: not (values[1] > 2.3 and values[1] % 0.25 == 0)
    )
    found = optimum(model)
    grid = np.array([[0.3 + 0.005 * i, 1.5 + 0.25 * j] for i in range(81) for j in range(4)])
    merits = model.merit(model.evaluate(grid))
    assert found.values[1] == 2.25 and found.merit == pytest.approx(merits.min(), rel=DENSE)


def test_what_cannot_be_met_is_missed_least_and_each_requirement_says_how_much_it_would_have_to_give(
    load,
):
    """No neck of these gives 400 N/mm; the stiffest is the widest neck in the deepest bend."""
    model = Model(
        load(NECK, RADIUS, require("envelope_mm", None, 200), require("kxx_n_per_mm", 400), RANGE)
    )
    found = optimum(model)
    assert found.merit >= MISSED
    assert found.values == pytest.approx([0.7, 1.5], rel=1e-3)
    q = model.evaluate(found.values[None])
    envelope, stiffness = relaxations(model, found.values)
    assert model.violations(q)[0, 1] == 0 and (envelope.relax_to, envelope.percent) == (None, None)
    assert stiffness.relax_to == pytest.approx(q[0, 2], rel=1e-6)
    assert stiffness.percent == pytest.approx(100 * (1 - q[0, 2] / 400), rel=1e-6)


def test_sensitivities_are_by_the_side_that_has_an_answer_where_bodies_touch_and_zero_where_nothing_follows(
    load,
):
    """A link as wide as its base hinges are high, 8 mm + 0.5 mm: narrower, or with wider necks,
    there is no stage.
    """
    neck = NECK.replace("hinges.elbow", "hinges.base")
    width = '[[free]]\nlabel = "w"\nkey = "chain.link_width_mm"\nfrom = 8.0\nto = 9.0\n'
    model = Model(load(neck, width, best("minimise", "kxx_n_per_mm")))
    touching, apart = (sensitivities(model, np.array([0.5, w]))[0, 0] for w in (8.5, 8.9))
    assert apart == pytest.approx(touching, rel=1e-3) and abs(apart) > 0.1
    thickness = '[[free]]\nkey = "thickness_mm"\nfrom = 6.0\nto = 12.0\n'
    model = Model(
        load(
            thickness,
            best("maximise", "kxx_n_per_mm / ktt_n_mm_per_rad"),
            best("maximise", "stress_x_mpa_per_um"),
        )
    )
    assert [sensitivities(model, np.array([t])).tolist() for t in (7.0, 9.1)] == [[[0.0, 0.0]]] * 2
