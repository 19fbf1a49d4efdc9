"""Optima that are known by other routes."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.synthesis.model import WORST, Model
from flexfem.synthesis.prices import prices, sensitivities
from flexfem.synthesis.search import optimum

from .conftest import HEAD, LINK, NECK, RADIUS, best, require

STIFFNESS = 60.0  # N/mm
RANGE = best("maximise", "range_x_um")


def test_a_thin_neck_at_its_rotational_stiffness_has_the_largest_radius_and_the_closed_form_neck(load):
    """K ~ t^(5/2) R^(-1/2) and stress per turn ~ (t/R)^(1/2), so at given K the range grows with R: R at its end.

    Then t = t0 (K/K0 (R/R0)^(1/2))^(2/5), and 1 % more stiffness costs 1/5 % of the range. One neck for all hinges, all
    of one radius, so that the platform's stiffness is that of one hinge times a number; in the thin-neck limit.
    """
    every = ", ".join(f'"hinges.{name}.{{}}"' for name in ("base", "elbow", "platform"))
    neck = f"[[free]]\nlabel = 't'\nkeys = [{every.format(*['neck_mm'] * 3)}]\nfrom = 0.0005\nto = 0.004\n"
    radius = f"[[free]]\nlabel = 'R'\nkeys = [{every.format(*['radius_mm'] * 3)}]\nfrom = 1.0\nto = 2.0\n"
    head = HEAD + 'formula = "paros-weisbord"\nmobility = 3\n'
    start = Model(load(neck, radius, RANGE, head=head)).found(np.array([[0.002, 1.0]])).quantities
    model = Model(load(neck, radius, require("ktt_n_mm_per_rad", 1.0), RANGE, head=head))
    K0 = float(model.found(np.array([[0.002, 1.0]])).quantities[0, 1])
    model = Model(load(neck, radius, require("ktt_n_mm_per_rad", K0), RANGE, head=head))
    found = optimum(model, 3)
    assert found.relaxed == pytest.approx([0.002 * 2**0.2, 2.0], rel=1e-3)
    wider = model.found(found.relaxed[None]).quantities[0, 0] / start[0, 0]
    assert wider == pytest.approx((2.0 / 2**0.2) ** 0.5, rel=1e-3)
    costs = prices(model, found.relaxed)
    assert costs.active == [True] and costs.price[0] == pytest.approx(0.2, rel=0.01)
    assert costs.at_ends == ["R"]
    powers = sensitivities(model, np.array([0.002, 1.5]))  # of the range and of K
    assert powers == pytest.approx(np.array([[-0.5, 2.5], [0.5, -0.5]]), rel=1e-2)


def dense(model, points):
    """Merits over a grid of points (k,) each of two dimensions, and the values."""
    axes = [np.linspace(each.low, each.high, points) for each in model.space.dimensions]
    values = np.array(np.meshgrid(*axes, indexing="ij")).reshape(2, -1).T
    return values, model.merit(model.found(values))


@pytest.mark.parametrize(
    ("pieces", "points"),
    [
        ((NECK, RADIUS, require("kxx_n_per_mm", STIFFNESS), RANGE), 150),
        pytest.param((NECK, RADIUS, require("kxx_n_per_mm", STIFFNESS), RANGE), 1000, marks=pytest.mark.slow),
        pytest.param(
            (
                NECK,
                LINK,
                require("envelope_mm", None, 150),
                require("range_y_um", 640),
                best("maximise", "kxx_n_per_mm"),
            ),
            1000,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_dense_grid_has_no_better_design_and_the_optimum_within_a_step(load, pieces, points):
    model = Model(load(*pieces))
    values, merits = dense(model, points)
    least = int(np.argmin(merits))
    found = optimum(model, 5)
    assert merits[least] < WORST
    objectives = [objective for _, objective, _ in found.history if objective is not None]
    assert objectives == sorted(objectives) and objectives[-1] == pytest.approx(-found.merit, rel=1e-9)
    assert found.merit <= merits[least] + 1e-9 * abs(merits[least])
    near = [np.ptp(values[:, k]) / (points - 1) for k in range(2)]
    alike = values[merits <= merits[least] + 2e-3 * abs(merits[least])]
    assert np.any(np.all(np.abs(alike - found.values) <= near, axis=1))


@pytest.mark.parametrize("slope", [2.0, pytest.param(-4.0, marks=pytest.mark.slow)])
def test_a_price_where_what_can_be_drawn_ends_is_that_of_a_dense_grid(load, monkeypatch, slope):
    """Stiffness and touching bodies, here a line that passes the optimum by, stop it both; programs end beyond."""
    pieces = NECK, RADIUS, require("kxx_n_per_mm", STIFFNESS), RANGE
    at = optimum(Model(load(*pieces)), 5).relaxed

    def room(x):
        return at[1] - 0.5 + slope * (x[..., 0] - at[0]) - x[..., 1]

    monkeypatch.setattr(Model, "drawable", lambda self, x: "" if room(x) >= 0 else "overlap")
    model = Model(load(*pieces))
    found = optimum(model, 5).relaxed
    costs = prices(model, found)
    assert costs.active == [True] and room(found) == pytest.approx(0, abs=1e-3)
    axes = [np.clip(np.linspace(0.985 * x, 1.015 * x, 301), each.low, each.high)
            for x, each in zip(found, model.space.dimensions, strict=True)]  # fmt: skip
    values = np.array(np.meshgrid(*axes, indexing="ij")).reshape(2, -1).T
    reach, stiffness = model.found(values[room(values) >= 0]).quantities.T
    before, after = (reach[stiffness >= more * STIFFNESS].max() for more in (1.0, 1.01))
    assert costs.price[0] == pytest.approx(100 * (1 - after / before), rel=0.05)


def test_a_seed_decides_what_is_searched_and_the_same_one_finds_the_same_again(load, monkeypatch):
    monkeypatch.setattr("flexfem.synthesis.search.GENERATIONS", 2)
    monkeypatch.setattr("flexfem.synthesis.search.LOCAL", 2)
    loaded, asked = load(NECK, RADIUS, require("kxx_n_per_mm", STIFFNESS), RANGE), []

    class Told(Model):
        def found(self, values):
            asked[-1].append(values.copy())
            return super().found(values)

    for seed in (5, 5, 6):
        asked.append([])
        optimum(Told(loaded), seed)
    once, again, other = asked
    assert len(once) == len(again) and all(np.array_equal(a, b) for a, b in zip(once, again, strict=True))
    assert len(once[0]) == 1025 and not np.isin(once[0][1:], other[0][1:]).any()  # the base stage first, then a sample


def price_of(load, wanted, objective=RANGE):
    """The price of the one requirement, which is active."""
    model = Model(load(NECK, wanted, objective))
    costs = prices(model, optimum(model, 5).relaxed)
    assert costs.active == [True]
    return costs.price[0]


@pytest.mark.parametrize("most", [61.2, 60.3])
def test_a_price_between_two_near_ends_is_that_of_the_end_that_is_active(load, most):
    """But for 1 % being of the larger end."""
    alone = price_of(load, require("kxx_n_per_mm", STIFFNESS))
    assert price_of(load, require("kxx_n_per_mm", STIFFNESS, most)) == pytest.approx(alone, rel=0.03)
    least = best("minimise", "range_x_um")
    alone = price_of(load, require("kxx_n_per_mm", None, most), least)
    assert price_of(load, require("kxx_n_per_mm", STIFFNESS, most), least) == pytest.approx(alone, rel=0.03)


def test_a_price_where_no_design_keeps_1_percent_more_is_at_the_rate_of_less(load):
    """The widest neck is 0.4 % stiffer than what is asked."""
    (stiffest,) = Model(load(NECK, best("maximise", "kxx_n_per_mm"))).found(np.array([[0.7]])).quantities[0]
    just = price_of(load, require("kxx_n_per_mm", stiffest / 1.004))
    assert just == pytest.approx(price_of(load, require("kxx_n_per_mm", stiffest / 1.02)), rel=0.02)


def test_where_bodies_touch_sensitivities_are_by_the_side_that_has_an_answer(load):
    """A link as wide as its base hinges are high, 8 mm + 0.5 mm: narrower, or with wider necks, there is no stage."""
    neck = NECK.replace("hinges.elbow", "hinges.base")
    width = '[[free]]\nlabel = "w"\nkey = "chain.link_width_mm"\nfrom = 8.0\nto = 9.0\n'
    model = Model(load(neck, width, best("minimise", "kxx_n_per_mm")))
    touching, apart = (sensitivities(model, np.array([0.5, w]))[0, 0] for w in (8.5, 8.9))
    assert apart == pytest.approx(touching, rel=1e-3) and abs(apart) > 0.1


def test_steps_are_kept_and_no_neighbour_is_better(load):
    pieces = NECK + "step = 0.005\n", RADIUS + "step = 0.25\n"
    model = Model(load(*pieces, require("kxx_n_per_mm", STIFFNESS), RANGE))
    found = optimum(model, 5)
    grid = np.array([[0.3 + 0.005 * i, 1.5 + 0.25 * j] for i in range(81) for j in range(11)])
    merits = model.merit(model.found(grid))
    assert found.merit == pytest.approx(merits.min(), rel=1e-12)
    assert found.values == pytest.approx(grid[int(np.argmin(merits))])
    assert found.relaxed_merit <= found.merit


def test_what_cannot_be_met_is_missed_least_and_the_one_that_is_too_much_is_named(load):
    """No neck of these gives 400 N/mm; the stiffest is the widest neck in the deepest bend."""
    model = Model(load(NECK, RADIUS, require("envelope_mm", None, 200), require("kxx_n_per_mm", 400), RANGE))
    found = optimum(model, 5)
    assert found.merit >= WORST
    assert found.values == pytest.approx([0.7, 1.5], rel=1e-3)
    missed = model.violations(model.found(found.values[None]))[0]
    assert missed[0] == 0 and missed[1] > 0.2


def drawn_stages(model, count, seed):
    """Designs (count, d) drawn at random that can be drawn."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        values = model.space.of_unit(rng.random((1, model.space.size)))[0]
        if model.found(values[None]).reason[0] == "" and model.drawable(values) == "":
            found.append(values)
    return np.array(found)


QUANTITIES = ("kxx_n_per_mm", "ktt_n_mm_per_rad", "range_y_um", "range_theta_mrad", "envelope_mm")


@pytest.mark.slow
def test_requirements_drawn_from_random_stages_are_all_met(load):
    own = [best("maximise", "range_x_um"), *(require(name, 0) for name in QUANTITIES)]
    any_of = Model(load(NECK, RADIUS, LINK, *own))
    for k, values in enumerate(drawn_stages(any_of, 10, 2003)):
        of = any_of.found(values[None]).quantities[0, 1:]
        ends = [
            require(name, *((None, x) if name == "envelope_mm" else (x,)))
            for name, x in zip(QUANTITIES, of, strict=True)
        ]
        model = Model(load(NECK, RADIUS, LINK, *ends, RANGE))
        found = optimum(model, 11 + k)
        assert found.merit < WORST, (k, found.values, values)
        assert found.merit <= -any_of.found(values[None]).quantities[0, 0] * (1 - 1e-6), k


@pytest.mark.slow
def test_of_ten_impossible_sets_the_culprit_is_named(load):
    """One end is moved beyond what any design has, by a dense grid; the others stay those of a random stage."""
    own = [best("maximise", "range_x_um"), *(require(name, 0) for name in QUANTITIES)]
    any_of = Model(load(NECK, RADIUS, LINK, *own))
    cube = np.array(np.meshgrid(*[np.linspace(0, 1, 25)] * 3)).reshape(3, -1).T
    every = any_of.found(any_of.space.of_unit(cube)).quantities[:, 1:]
    for k, values in enumerate(drawn_stages(any_of, 10, 1999)):
        of, culprit = any_of.found(values[None]).quantities[0, 1:], k % len(QUANTITIES)
        low = QUANTITIES[culprit] == "envelope_mm"
        of[culprit] = 0.8 * np.nanmin(every[:, culprit]) if low else 1.3 * np.nanmax(every[:, culprit])
        ends = [
            require(name, *((None, x) if name == "envelope_mm" else (x,)))
            for name, x in zip(QUANTITIES, of, strict=True)
        ]
        model = Model(load(NECK, RADIUS, LINK, *ends, RANGE))
        found = optimum(model, 31 + k)
        assert found.merit >= WORST
        missed = model.violations(model.found(found.values[None]))[0]
        assert missed[culprit] == missed.max() > 0.15, (k, missed)


def test_a_design_that_cannot_be_drawn_is_never_the_answer(load, monkeypatch):
    """The best by its numbers cannot be drawn here, nor can what is made of it by rounding."""
    pieces = NECK + "step = 0.005\n", RADIUS + "step = 0.25\n"
    model = Model(load(*pieces, require("kxx_n_per_mm", STIFFNESS), RANGE))
    monkeypatch.setattr(
        Model, "drawable", lambda self, values: "overlap" if values[1] > 2.3 and values[1] % 0.25 == 0 else ""
    )
    found = optimum(model, 5)
    grid = np.array([[0.3 + 0.005 * i, 1.5 + 0.25 * j] for i in range(81) for j in range(4)])
    merits = model.merit(model.found(grid))
    assert found.relaxed[1] > 2.3 > found.values[1] == 2.25
    assert found.merit == pytest.approx(merits.min(), rel=1e-12)
