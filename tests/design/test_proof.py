"""Finite elements of proposed designs and the loop around them, with stand-ins for what is slow."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.design import proof as module
from flexfem.design.model import MISSED, Correction, Model
from flexfem.design.outcome import checked_by
from flexfem.design.proof import ElementSolver, Proof, column_band, proof, space_mapping
from flexfem.design.search import BestDesign
from flexfem.refused import ComputationFailed
from flexfem.study.workers import Failure

from .conftest import (
    HEAD,
    NECK,
    RADIUS,
    RANGE,
    REFERENCE,
    STEPPED,
    STIFFEST,
    best,
    require,
    tolerance,
)

OWN = np.array([0.55, 2.0])


@pytest.fixture
def solved(monkeypatch):
    """Studies and stages that are solved in this process; every output is the resolution of the
    mesh.
    """
    found = []

    def solve(study, stage):
        found.append((study.study, stage))
        return [float(study.study.resolution)] * len(study.outputs)

    monkeypatch.setattr(module, "solved", solve)
    return found


def test_a_design_is_solved_on_three_meshes_up_to_the_resolution_coarse_to_fine(load, solved):
    loaded = load(
        NECK,
        RADIUS,
        require("error_x_percent", None, 20),
        STIFFEST,
        head=HEAD + "resolution = 13\n",
    )
    found = ElementSolver(loaded, Counter()).solve(OWN)
    assert [columns["kxx_n_per_mm"] for columns in found] == [
        7.0,
        10.0,
        13.0,
    ] and "error_x_percent" in found[0]
    for study, stage in solved:
        assert (
            stage.hinges.elbow.neck,
            stage.hinges.platform.radius,
            stage.hinges.base.radius,
        ) == (0.55, 2.0, 4.0)
        assert (study.model, study.formula, study.mobility) == ("verify", "paros-weisbord", None)


def test_a_stage_corrected_for_its_thickness_is_solved_as_it_is_on_two_meshes(
    load, solved, tmp_path
):
    base = tmp_path / "base.toml"
    counts = Counter()
    base.write_text('model = "corrected"\n' + REFERENCE.read_text())
    loaded = load(NECK, RADIUS, STIFFEST, head=HEAD.replace(str(REFERENCE), base.name))
    ElementSolver(loaded, counts).solve(OWN)
    meshes = [(study.model, study.resolution, study.layers) for study, _ in solved]
    assert meshes == [("three_dimensional", 4, 2), ("three_dimensional", 6, 3)]
    assert {stage.model for _, stage in solved} == {"plane_stress"}
    assert counts == {"finite elements in three dimensions": 2}


class InOrder:
    """What computes tasks in this process, the last first."""

    def results(self, function, next_task, limit):
        for task in reversed([*iter(next_task, None)]):
            yield task, function(*task)


@pytest.mark.parametrize("parallel", [False, True])
def test_what_is_known_is_neither_solved_nor_counted_again(load, solved, parallel):
    counts = Counter()
    proposed = ElementSolver(load(NECK, RADIUS, STIFFEST), counts, InOrder() if parallel else None)
    first = proposed.solve(OWN)
    again = proposed.solve(OWN)
    assert first == again and len(solved) == 3 and counts == {"finite elements": 3}
    proposed.solve(OWN + 0.01)
    assert len(solved) == 6 and counts == {"finite elements": 6}


def test_scattered_stages_are_solved_with_their_own_nine_necks_for_couplings_xy_xt_yt(
    load, monkeypatch
):
    loaded = load(NECK, RADIUS, tolerance(checked=8), best("minimise", "coupling_95"))
    off = np.random.default_rng(2).normal(scale=0.01, size=(2, 3, 3))
    names = {
        "coupling_xy": (1, "elbow"),
        "coupling_xt": (2, "platform"),
        "coupling_yt": (3, "base"),
    }

    def solve(study, stage):
        return [
            stage.hinge(*names[n]).neck if n in names else study.study.resolution
            for n in study.outputs
        ]

    monkeypatch.setattr(module, "solved", solve)
    coarse, fine = ElementSolver(loaded, Counter()).solve_scattered(OWN, off)
    assert np.array_equal(coarse, fine)
    assert (
        pytest.approx(np.array([[0.55, 0.55, 0.5] + each[[0, 1, 2], [1, 2, 0]] for each in off]))
        == coarse.T
    )


def test_a_solution_that_fails_says_why_and_is_not_kept(load, monkeypatch):
    proposed = ElementSolver(load(NECK, RADIUS, STIFFEST), Counter())
    with (
        monkeypatch.context() as patched,
        pytest.raises(ComputationFailed, match="proposed design: the mesh folds"),
    ):
        patched.setattr(module, "solved", lambda *task: Failure("failed", "the mesh folds"))
        proposed.solve(OWN)
    monkeypatch.setattr(module, "solved", lambda study, stage: [4.0] * len(study.outputs))
    assert proposed.solve(OWN)[0]["kxx_n_per_mm"] == 4.0


def test_a_kept_solution_is_read_again_and_a_torn_file_is_not(load, solved, tmp_path):
    loaded = load(NECK, RADIUS, STIFFEST)
    folder = tmp_path / "found"
    first = ElementSolver(loaded, Counter(), folder=folder).solve(OWN)
    again = ElementSolver(loaded, Counter(), folder=folder)
    assert again.solve(OWN) == first and len(solved) == 3 and again.counts == {"finite elements": 3}
    torn = sorted(folder.iterdir())[0]
    torn.write_bytes(torn.read_bytes()[:-4])
    assert ElementSolver(loaded, Counter(), folder=folder).solve(OWN) == first and len(solved) == 4


def proof_of(model, values, gap, stiffness, band):
    """Of 400 um and a stiffness whose band is known; the model is corrected by 0.9."""
    fields = {
        "values": values,
        "gap": gap,
        "elements": np.array([400.0, stiffness]),
        "bands": np.array([7.0, band]),
    }
    fields |= {"model": replace(model, corrections={"kxx_n_per_mm": Correction(0.9)})}
    return Proof(**(dict.fromkeys(Proof._fields) | fields))


@pytest.fixture
def loop(load, monkeypatch):
    """What runs the loop over proofs (gap, stiffness, band), the last again and again: rounds,
    agreed, and starts.
    """

    def run(free, proofs, merit=-400.0):
        starts = []

        def optimum(model, near, everywhere):
            starts.append((None if near is None else near.tolist(), everywhere))
            return BestDesign(np.array([0.5 + 0.01 * len(starts)]), np.array([0.5]), merit, [])

        each = iter([*proofs, *[proofs[-1]] * 10])
        monkeypatch.setattr(module, "optimum", optimum)
        monkeypatch.setattr(
            module, "proof", lambda model, elements, values: proof_of(model, values, *next(each))
        )
        loaded = load(
            free, require("kxx_n_per_mm", 60.0, 80.0), RANGE, head=HEAD + "accuracy_percent = 0.4\n"
        )
        return *space_mapping(Model(loaded), None), starts

    return run


def test_ends_are_tightened_by_the_largest_band_so_far_over_their_size_and_without_steps_by_the_accuracy(
    loop,
):
    """The end of 80 N/mm is the size of both: a band of 0.32 is 0.4 % of it. Near the answer all is
    not searched.
    """
    proofs = [(0.1, 59.0, 0.32), (0.008, 61.0, 0.16), (0.001, 61.0, 0.16)]
    for free, guard in ((STEPPED[0], 0.004), (NECK, 0.008)):
        rounds, agreed, starts = loop(free, proofs)
        guards = np.ravel([each.proposing.guard for each in rounds])
        assert guards == pytest.approx([0, 0, 0, guard, 0, guard]) and agreed
        corrections = [each.proposing.corrections for each in rounds]
        assert corrections == [{}, *[{"kxx_n_per_mm": Correction(0.9)}] * 2]
        assert (
            starts == [(None, True), ([0.51], True), ([0.52], False)]
            and rounds[-1].proof.gap == 0.001
        )


@pytest.mark.parametrize(
    ("gap", "stiffness", "merit", "rounds"),
    [
        (0.0041, 61.0, -400.0, 8),  # beyond the accuracy of 0.4 %
        (0.0039, 61.0, -400.0, 1),
        (0.0039, 60.1, -400.0, 8),  # the band of 0.16 reaches beyond the end of 60
        (0.0039, 79.9, -400.0, 8),
        (0.0039, 60.1, 1.1 * MISSED, 1),  # no design meets all: nothing to wait for
    ],
)
def test_a_design_is_proven_when_both_models_agree_and_each_band_is_within_the_ends(
    loop, gap, stiffness, merit, rounds
):
    found, agreed, _ = loop(STEPPED[0], [(gap, stiffness, 0.16)], merit)
    assert len(found) == rounds and agreed is (rounds == 1)


COLUMNS = {
    "kxx_n_per_mm",
    "range_x_um",
    "engaged_kxx_n_per_mm",
    "drift_x_um_per_k",
    "frequency_1_hz",
    "coupling_95",
}


@pytest.mark.parametrize(
    ("solid", "checked", "alone"),
    [
        (False, 8, set()),
        (False, 0, {"coupling_95"}),
        (True, 8, COLUMNS - {"kxx_n_per_mm", "range_x_um"}),
    ],
)
def test_what_finite_elements_do_not_answer_rests_on_the_model_alone(load, solid, checked, alone):
    pieces = (
        "[drive]\nactuators = true\n",
        "[drift]\n",
        "[frequencies]\n",
        best("minimise", "coupling_95"),
    )
    of = load(NECK, tolerance(checked=checked), *pieces).requirements
    loaded = SimpleNamespace(requirements=of, solid=solid)
    by = {name: checked_by(loaded, frozenset({name, "thickness_mm"})) for name in COLUMNS}
    assert {name for name in COLUMNS if by[name] == "analytic model alone"} == alone
    others = {by[name] for name in COLUMNS - alone}
    assert others == {"finite elements in three dimensions" if solid else "finite elements"}
    assert checked_by(loaded, frozenset({"mass_kg", "thickness_mm"})) == "exact"


def test_a_band_follows_the_unit_in_which_a_quantity_is_asked(load, solved):
    loaded = load(
        NECK, require("kxx_n_per_mm / 1e9", 1e-7), best("minimise", "1 / kxx_n_per_mm"), STIFFEST
    )
    of = proof(Model(loaded), ElementSolver(loaded, Counter()), OWN[:1])
    inverse, stiffness, small = of.bands / of.elements
    assert small == pytest.approx(stiffness) and inverse > 0 and of.round_off.tolist() == [0, 0, 0]


CORNER = 3 * 0.003 / (2**1.4 - (4 / 3) ** 1.4)
STRESS = 3 * 0.001 / ((4 / 3) ** 3 - 1)


@pytest.mark.parametrize(
    ("name", "band"),
    [
        (
            "kxx_n_per_mm",
            1.25 * 0.001 / ((4 / 3) ** 2.13553 - 1),
        ),  # 1 / 4^2.1355 - 1 / 6^2.1355 is thrice the next
        ("range_x_um", STRESS),
        ("life_cycles", STRESS),
        ("drift_x_um_per_k", CORNER),
        ("engaged_kxx_n_per_mm", CORNER),
    ],
)
def test_a_band_is_of_the_rate_at_which_a_column_converges(name, band):
    """Of 1.004, 1.001, 1 on meshes of 4, 6, 8 triangles across a neck."""
    found = column_band(name, np.array([4.0, 6.0, 8.0]), np.array([1.004, 1.001, 1.0]))
    assert found == pytest.approx(band, rel=1e-3)
