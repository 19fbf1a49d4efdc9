"""Fronts that are known by other routes."""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np
import pytest

from flexfem.refused import BadInput
from flexfem.study.answer import answer
from flexfem.study.findings import non_dominated
from flexfem.study.loaded import load_study
from flexfem.synthesis.elements import ProposedElements
from flexfem.synthesis.front import front
from flexfem.synthesis.many import apart, front_of_many
from flexfem.synthesis.model import Model
from flexfem.synthesis.outcome import designed
from flexfem.synthesis.requirements import load_requirements
from flexfem.synthesis.store import Store
from flexfem.synthesis.surface import gains, sketched

from .conftest import LINK, NECK, RADIUS, ROOT, best, require

NECK_MM, RADIUS_MM = "hinges.elbow.neck_mm", "hinges.elbow.radius_mm"
CIRCLE = f"({NECK_MM} / 0.7) ** 2 + ({RADIUS_MM} / 4.0) ** 2"  # 0.18 to 0.84 and 0.14 to 1 of it within the ends
LINK_MM, OTHER_MM = "chain.link_lengths_mm[0]", "chain.link_lengths_mm[1]"
OTHER = LINK.replace("l1", "l2").replace(LINK_MM, OTHER_MM)
BOTH = best("maximise", NECK_MM) + best("maximise", RADIUS_MM)
LONGEST = best("maximise", LINK_MM)


def test_the_area_that_a_design_adds_is_that_of_rectangles():
    known, reference = np.array([[0.0, 3.0], [1.0, 1.0], [2.0, 2.0]]), np.array([4.0, 5.0])
    asked = np.array([[0.5, 2.0], [2.0, 0.5], [-1.0, -1.0], [1.5, 1.5], [5.0, 0.0]])
    assert gains(known, asked, reference) == pytest.approx([0.5, 1.0, 30.0 - 14.0, 0.0, 0.0])
    assert gains(np.empty((0, 2)), asked[:1], reference) == pytest.approx([3.5 * 3.0])


def test_few_answers_show_where_the_front_within_a_circle_is(load):
    """The largest neck and radius with (t/0.7)^2 + (R/4)^2 <= 1, no one of 14 answers beyond it."""
    model = Model(load(NECK, RADIUS, require(CIRCLE, None, 1.0), BOTH))
    t, R = sketched(model, 3, added=8).T / [[0.7], [4.0]]
    assert model.counts["analytic"] == 14
    assert len(t) >= 5 and np.all(t**2 + R**2 <= 1 + 1e-9) and np.mean(t**2 + R**2) > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("steps", ["", "step = 0.001\n"])
def test_the_front_within_a_circle_is_the_circle(load, steps):
    """The largest neck and radius with (t/0.7)^2 + (R/4)^2 <= 1."""
    model = Model(load(NECK + steps, RADIUS, require(CIRCLE, None, 1.0), BOTH))
    found = np.array(front(model, np.array([0.6, 2.0]), 5, 3))
    t, R = found.T / [[0.7], [4.0]]
    assert len(found) == 5
    assert t**2 + R**2 == pytest.approx(np.ones(5), abs=1e-3 if steps == "" else 3e-3)
    assert t[0] == pytest.approx((1 - (1.5 / 4) ** 2) ** 0.5, abs=2e-3)
    assert t[-1] == pytest.approx(0.3 / 0.7, abs=5e-6)  # objectives are kept within 1e-6 of themselves
    assert np.all(np.diff(t) < 0) and np.all(np.hypot(np.diff(t), np.diff(R)) < 0.4)


@pytest.fixture(scope="module")
def studied():
    """The front (m, 2) of the 4096 designs of study-reach, by the study: range at yield in um, stiffness in N/mm."""
    loaded = load_study(ROOT / "cases/study-reach.toml")
    rows = answer(loaded, 0, 4096)
    names = [loaded.outputs.index(name) for name in ("range_x_um", "kxx_n_per_mm")]
    both = rows.values[rows.status == "ok"][:, names]
    return both[non_dominated(*both.T)]


@pytest.fixture
def reach(tmp_path):
    """The same question, asked for its front."""
    text = (ROOT / "cases/study-reach.toml").read_text()
    free = text[text.index("[[factor]]") : text.index("[drive]")].replace("[[factor]]", "[[free]]")
    head = f'name = "reach"\nstage = "{ROOT / "geometry/mobility6.toml"}"\nseed = 2003\n'
    path = tmp_path / "reach.toml"
    path.write_text(head + free + best("maximise", "range_x_um") + best("maximise", "kxx_n_per_mm"))
    return load_requirements(path)


def share_beaten(both, low, high):
    """Share of points between `low` and `high`, even in logarithms, that some design beats in both values."""
    grid = np.exp(np.array(np.meshgrid(*np.linspace(np.log(low), np.log(high), 300).T)).reshape(2, -1))
    beaten = np.zeros(grid.shape[1], dtype=bool)
    for x, y in both:
        beaten |= (x >= grid[0]) & (y >= grid[1])
    return np.mean(beaten)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_the_front_of_study_reach_is_beaten_with_a_hundredth_of_its_evaluations(studied, reach, seed):
    """As a whole: 41 answers dominate more than the 4096 do, and none of them is beaten by any of these.

    Not point by point: 50 to 55 of its 58 designs are reached or beaten, the others to within 7 % of both values.
    """
    model = Model(reach)
    designs = sketched(model, seed)
    assert model.counts["analytic"] == 41
    assert all(model.drawable(each) == "" for each in designs)
    found = Model(reach).found(designs).quantities
    ends = studied.min(axis=0), 1.1 * np.maximum(studied.max(axis=0), found.max(axis=0))
    assert share_beaten(found, *ends) > 1.01 * share_beaten(studied, *ends)
    assert not any(np.any(np.all(studied >= each, axis=1)) for each in found)
    short = [np.min(np.max(each / found, axis=1)) for each in studied]
    assert len(studied) == 58 and np.sum(np.array(short) <= 1) >= 50 and max(short) < 1.07


@pytest.mark.slow
def test_the_front_of_three_lengths_within_an_ellipsoid_is_the_ellipsoid(load):
    """The largest neck, radius and link with (t/0.7)^2 + (R/4)^2 + (l/40)^2 <= 1.6.

    Neck and link reach the ends of their ranges, the radius what the least neck, 0.3, and the shortest link, 26, leave.
    """
    pytest.importorskip("pymoo")
    model = Model(load(NECK, RADIUS, LINK, require(f"{CIRCLE} + ({LINK_MM} / 40) ** 2", None, 1.6), BOTH + LONGEST))
    found = np.array(front_of_many(model, np.array([0.6, 2.0, 30.0]), 9, 3))
    t, R, length = found.T / [[0.7], [4.0], [40.0]]
    assert len(found) == 9
    assert t**2 + R**2 + length**2 == pytest.approx(np.full(9, 1.6), abs=1e-5)
    widest = (1.6 - (0.3 / 0.7) ** 2 - (26 / 40) ** 2) ** 0.5
    assert [t.max(), R.max(), length.max()] == pytest.approx([1.0, widest, 1.0], abs=1e-4)


@pytest.mark.slow
def test_the_front_of_four_lengths_within_an_ellipsoid_is_the_ellipsoid(load):
    """The largest neck, radius and two links with (t/0.7)^2 + (R/4)^2 + (l1/40)^2 + (l2/40)^2 <= 1.9.

    Links reach the ends of their ranges; neck and radius what the least of the others, 0.3, 1.5 and 26, leave.
    """
    pytest.importorskip("pymoo")
    lengths = f"{CIRCLE} + ({LINK_MM} / 40) ** 2 + ({OTHER_MM} / 40) ** 2"
    loaded = load(NECK, RADIUS, LINK, OTHER, require(lengths, None, 1.9), BOTH + LONGEST + best("maximise", OTHER_MM))
    sizes = np.array([0.7, 4.0, 40.0, 40.0])
    found = np.array(front_of_many(Model(loaded), np.array([0.5, 2.5, 30.0, 30.0]), 24, 3)) / sizes
    assert len(found) == 24
    assert np.sum(found**2, axis=1) == pytest.approx(np.full(24, 1.9), abs=1e-5)
    least = np.array([0.3, 1.5, 26.0, 26.0]) / sizes
    most = np.minimum(1.0, np.sqrt(1.9 - np.sum(least**2) + least**2))
    assert most == pytest.approx([0.9562, 0.9334, 1.0, 1.0], abs=1e-4)
    assert found.max(axis=0) == pytest.approx(most, abs=1e-4)
    grid = np.stack(np.meshgrid(*np.linspace(least[:3], 1, 41).T), axis=-1).reshape(-1, 3)
    last = np.sqrt(np.maximum(1.9 - np.sum(grid**2, axis=1), 0.0))
    known = np.column_stack([grid, last])[(last >= least[3]) & (last <= 1)]
    far = np.linalg.norm((known[:, None] - found) / (most - least), axis=2).min(axis=1)
    assert len(known) > 10_000 and far.max() < 0.5


@pytest.mark.slow
def test_evolution_and_bounded_objectives_find_the_same_front(load):
    pytest.importorskip("pymoo")
    loaded = load(NECK, RADIUS, best("maximise", "range_x_um"), best("maximise", "kxx_n_per_mm"))
    model, first = Model(loaded), np.array([0.3, 4.0])
    bounded, evolved = (
        Model(loaded).found(np.array(search(model, first, 9, 3))).quantities for search in (front, front_of_many)
    )
    for k, one in enumerate(bounded):
        assert not np.any(np.all(evolved > one * 1.002, axis=1)), k
    for k, one in enumerate(evolved):
        assert not np.any(np.all(bounded > one * 1.002, axis=1)), k
    assert evolved.max(axis=0) == pytest.approx(bounded.max(axis=0), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("search", [front, front_of_many])
def test_a_front_whose_search_was_stopped_goes_on_to_the_same(load, tmp_path, monkeypatch, search):
    """Stopped before its last evaluation: the other run makes less than half of them, and counts the same."""
    pytest.importorskip("pymoo")
    loaded, first = load(NECK, RADIUS, require(CIRCLE, None, 1.0), BOTH), np.array([0.6, 2.0])
    whole, again = Counter(), Counter()
    designs = search(Model(loaded, counts=whole), first, 4, 3)
    original, made, last = Model.columns, Counter(), whole["analytic"] - 1

    def stopped(self, values):
        made["analytic"] += len(values)
        if made["analytic"] > last:
            raise KeyboardInterrupt
        return original(self, values)

    monkeypatch.setattr(Model, "columns", stopped)
    with pytest.raises(KeyboardInterrupt):
        search(Model(loaded), first, 4, 3, store=Store(tmp_path / "found"))
    made.clear()
    resumed = search(Model(loaded, counts=again), first, 4, 3, store=Store(tmp_path / "found"))
    np.testing.assert_array_equal(resumed, designs)
    assert again == whole and 0 < made["analytic"] < last / 2


def test_designs_of_a_front_are_chosen_far_from_each_other():
    t = np.linspace(0, np.pi / 2, 91)
    assert apart(np.column_stack([np.cos(t), 100 * np.sin(t)]), 5) == [90, 67, 45, 22, 0]


def test_without_pymoo_three_objectives_are_refused_in_one_line(load, monkeypatch):
    loaded = load(NECK, RADIUS, LINK, BOTH + LONGEST)
    monkeypatch.setitem(sys.modules, "pymoo", None)
    with pytest.raises(BadInput, match=r"wanted.toml: objective: 3 of them need pymoo, expected flexfem\[fronts\]"):
        designed(loaded, ProposedElements(loaded, Counter()))
