"""The loop of search and finite elements with stand-ins for both, and what a record says that a value rests on."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.synthesis import mapping
from flexfem.synthesis.mapping import Proof, mapped
from flexfem.synthesis.model import WORST, Correction, Model
from flexfem.synthesis.outcome import checked_by
from flexfem.synthesis.search import BestDesign
from flexfem.synthesis.store import Store

from .conftest import HEAD, NECK, best, require

STEPPED = NECK + "step = 0.005\n"
WANTED = require("kxx_n_per_mm", 60.0, 80.0), best("maximise", "range_x_um")


def proof_of(values, gap, stiffness, band):
    """Of 400 um and a stiffness whose band is known; the model is corrected by 0.9."""
    said = {"values": values, "gap": gap, "elements": np.array([400.0, stiffness]), "bands": np.array([7.0, band])}
    said |= {"corrections": {"kxx_n_per_mm": Correction(0.9)}, "shifts": {}}
    return Proof(**(dict.fromkeys(Proof._fields) | said))


@pytest.fixture
def loop(load, monkeypatch):
    """What runs the loop over proofs (gap, stiffness, band), the last again and again: it, guards and starts."""

    def run(free, proofs, merit=-400.0):
        models, starts = [], []

        def searched(model, seed, near, store, say):
            models.append(model)
            starts.append(near)
            return BestDesign(np.array([0.5 + 0.01 * len(models)]), np.array([0.5]), merit, merit, [])

        each = iter([*proofs, *[proofs[-1]] * 10])
        monkeypatch.setattr(mapping, "searched", searched)
        monkeypatch.setattr(mapping, "proof", lambda model, elements, values, say: proof_of(values, *next(each)))
        found = mapped(Model(load(free, *WANTED, head=HEAD + "accuracy_percent = 0.4\n")), SimpleNamespace(store=None))
        return found, [None if model.guard is None else model.guard.tolist() for model in models], models, starts

    return run


def test_ends_are_tightened_by_the_largest_band_so_far_over_their_size_and_without_steps_by_the_accuracy(loop):
    """The end of 80 N/mm is the size of both: a band of 0.32 is 0.4 % of it."""
    proofs = [(0.1, 59.0, 0.32), (0.02, 61.0, 0.16), (0.001, 61.0, 0.16)]
    found, guards, models, starts = loop(STEPPED, proofs)
    assert guards == [None, pytest.approx([0.004]), pytest.approx([0.004])] and found.agreed
    assert [model.corrections for model in models] == [{}, *[{"kxx_n_per_mm": Correction(0.9)}] * 2]
    assert [None if near is None else near.tolist() for near in starts] == [None, [0.51], [0.52]]
    assert len(found.rounds) == len(found.optima) == 3 and found.rounds[-1].gap == 0.001
    guards = loop(NECK, proofs)[1]
    assert guards == [None, pytest.approx([0.008]), pytest.approx([0.008])]


@pytest.mark.parametrize(
    ("gap", "stiffness", "merit", "rounds"),
    [
        (0.0041, 61.0, -400.0, 8),  # beyond the accuracy of 0.4 %
        (0.0039, 61.0, -400.0, 1),
        (0.0039, 60.1, -400.0, 8),  # the band of 0.16 reaches beyond the end of 60
        (0.0039, 79.9, -400.0, 8),
        (0.0039, 60.1, 1.1 * WORST, 1),  # no design meets all: nothing to wait for
    ],
)
def test_a_design_is_proven_when_model_and_metal_agree_and_each_band_is_within_the_ends(
    loop, gap, stiffness, merit, rounds
):
    found, *_ = loop(STEPPED, [(gap, stiffness, 0.16)], merit)
    assert len(found.rounds) == rounds and found.agreed is (rounds == 1)


def test_a_search_that_is_kept_is_not_made_again_and_its_evaluations_are_counted_as_if_it_were(load, monkeypatch):
    found, made = BestDesign(np.array([0.5]), np.array([0.503]), -3.0, -3.5, [(10, None, 0.2), (20, 3.0, 0.0)]), []

    def searched(model, seed, near, say):
        made.append(seed)
        model.counts["analytic"] += 1234
        return found

    monkeypatch.setattr(mapping, "optimum", searched)
    loaded, store = load(NECK, *WANTED), Store(None)
    for _ in range(2):
        counts = Counter()
        model = Model(loaded, counts=counts)
        again = mapping.searched(model, 7, None, store, print)
        assert counts["analytic"] == 1234 and again._replace(values=0, relaxed=0) == found._replace(values=0, relaxed=0)
        assert (again.values.tolist(), again.relaxed.tolist()) == ([0.5], [0.503])
    assert made == [7]
    mapping.searched(model, 7, np.array([0.4]), store, print)
    assert made == [7, 7]


COLUMNS = {"kxx_n_per_mm", "range_x_um", "engaged_kxx_n_per_mm", "drift_x_um_per_k", "frequency_1_hz", "coupling_95"}


@pytest.mark.parametrize(
    ("solid", "checked", "alone"),
    [(False, 8, set()), (False, 0, {"coupling_95"}), (True, 8, COLUMNS - {"kxx_n_per_mm", "range_x_um"})],
)
def test_what_finite_elements_do_not_answer_rests_on_the_model_alone(load, solid, checked, alone):
    asked = "[drive]\nactuators = true\n", "[drift]\n", "[frequencies]\n", best("minimise", "coupling_95")
    model = Model(load(NECK, f"[tolerance]\nneck_um = 5.0\nchecked = {checked}\n", *asked))
    said = {name: checked_by(model, frozenset({name, "thickness_mm"}), solid) for name in COLUMNS}
    assert {name for name, by in said.items() if by == "analytic model alone"} == alone
    others = {by for name, by in said.items() if name not in alone}
    assert others == {"finite elements in three dimensions" if solid else "finite elements"}
    assert checked_by(model, frozenset({"mass_kg", "thickness_mm"}), solid) == "exact"


@pytest.mark.parametrize(
    ("asked", "band"),
    [
        ("kxx_n_per_mm", 1.25 * 0.001 / ((4 / 3) ** 2.13553 - 1)),  # 1 / 4^2.1355 - 1 / 6^2.1355 is thrice the next
        ("stress_x_mpa_per_um", 3 * 0.001 / ((4 / 3) ** 3 - 1)),
        ("range_x_um", 3 * 0.001 / ((4 / 3) ** 3 - 1)),
        ("2 * life_amplitude_x_um", 3 * 0.001 / ((4 / 3) ** 3 - 1)),
        ("life_cycles", 3 * 0.001 / ((4 / 3) ** 3 - 1)),
        ("drift_x_um_per_k", 3 * 0.003 / (2**1.4 - (4 / 3) ** 1.4)),
        ("drift_gradient_um_per_k_per_mm", 3 * 0.003 / (2**1.4 - (4 / 3) ** 1.4)),
        ("drive_range_x_um", 3 * 0.003 / (2**1.4 - (4 / 3) ** 1.4)),
        ("range_x_um / drive", 3 * 0.003 / (2**1.4 - (4 / 3) ** 1.4)),  # the wider, through a derived output
    ],
)
def test_a_band_is_of_the_slowest_of_the_columns_that_a_quantity_uses(load, asked, band):
    """Of 1.004, 1.001, 1 on meshes of 4, 6, 8 triangles across a neck."""
    lasts = "life" in asked
    head = HEAD.replace("geometry/mobility6.toml", "cases/stage-2024.toml") if lasts else HEAD
    about = ["[life]\namplitude_x_um = 50.0\n" if lasts else "[drift]\n[drive]\nactuators = true\n"]
    about += [] if lasts else ['[[output]]\nname = "drive"\nexpression = "engaged_kxx_n_per_mm + 1"\n']
    model = Model(load(NECK, *about, best("maximise", asked), head=head))
    assert mapping._bands(model, (4, 6, 8), np.array([[1.004], [1.001], [1.0]])) == pytest.approx([band], rel=1e-3)
