"""The error budget: the right thing in each share, by hand on made-up compliances and by physics on a whole stage."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flexfem
from flexfem.analytic.model import analyse
from flexfem.mechanism import designs
from flexfem.mechanism.stage import load_feasible
from flexfem.refused import BadInput
from flexfem.verify import budget as module
from flexfem.verify.budget import budget, thick_compliance
from flexfem.questions.case import LoadedCase
from flexfem.units import DIRECTIONS
from flexfem.verify.protocol import run_case, solve_stage
from flexfem.verify.summary import summary

ROOT = Path(__file__).parents[2]
PATH = ROOT / "geometry/mobility6.toml"
SMALL = 4  # resolution: a coarse mesh shows the same shares
LEVER = 24.0  # mm, l3 of the stage


@pytest.fixture(scope="module")
def stage():
    return load_feasible(PATH)


@pytest.fixture(scope="module")
def solve():
    """Every mesh is solved once."""
    return cache(solve_stage)


@pytest.fixture(scope="module")
def made(stage, solve):
    return budget(stage, resolution=SMALL, solve=solve)


def share(made, name, direction):
    found = [share for share in made.split[direction].shares if share.name == name]
    return getattr(found[0].points, direction)


@pytest.fixture(scope="module")
def by_hand(stage):
    """Finite elements that converge with n^-4, at a rate and to a limit of their own in each direction and across, and
    whose large displacements add 1, 2 and 3 parts in a thousand of the command along and a fixed motion across."""
    K = analyse(stage).stiffness
    limit, rate = np.array([1.16, 1.17, 1.18]), np.array([3.0, 5.0, 8.0])
    across = np.array([[0.0, 2e-6, 3e-9], [2e-6, 0.0, 5e-9], [3e-9, 5e-9, 0.0]])

    def solve(_, level):
        compliance = np.diag((limit - rate * level**-4.0) / np.diag(K)) + across
        return SimpleNamespace(mesh=level, response=SimpleNamespace(compliance=compliance))

    def bent(mesh, _, force):
        assert mesh == 8  # the finest
        linear = solve(None, 8).response.compliance @ force[0]
        return SimpleNamespace(pose=(linear * (1 + np.array([1e-3, 2e-3, 3e-3])))[None])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "equilibrium", bent)
        patch.setattr(module, "command_warnings", lambda *_: [])
        return K, limit, rate, across, budget(stage, {"x": 0.04, "y": 0.05, "theta": 2e-3}, 8, solve)


def test_a_question_lowers_its_stage_once(stage, monkeypatch):
    """A stage becomes arrays once, its hinges are placed once, whatever of it is asked; the corrected one once more."""
    lowered, placed = [], []
    counted = ((designs, "Designs", lowered), (designs, "frames", placed))
    for owner, name, calls in counted:
        whole = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *a, _f=whole, _c=calls, **k: _c.append(1) or _f(*a, **k))
    rest = SimpleNamespace(neck_stress=np.ones((3, 3)))
    monkeypatch.setattr("flexfem.verify.protocol.load_case", lambda *_: rest)
    monkeypatch.setattr(module, "equilibrium", lambda _, __, force: SimpleNamespace(pose=1e-6 * force))
    solved = SimpleNamespace(mesh=None, response=SimpleNamespace(compliance=np.eye(3)))

    def whole_model(of):
        found = flexfem.analyse(of, 21, "calibrated", links=True)
        return found.neck_stress([1e-3, 0, 0]), found.range_at_yield, found.warnings

    questions = (
        (flexfem.analyse, 1),
        (whole_model, 1),
        (lambda of: summary(of), 2),
        (lambda of: budget(of, resolution=SMALL, solve=lambda *_: solved), 2),
    )
    for ask, times in questions:
        lowered.clear(), placed.clear()
        ask(stage.model_copy(update={"model": "plane_stress"}))
        assert len(lowered) <= times == len(placed), ask


def test_shares_are_steps_from_the_papers_model_to_the_finite_elements(by_hand, stage):
    K, limit, _, _, made = by_hand
    rungs = [
        analyse(stage).compliance,
        analyse(stage, 21).compliance,
        analyse(stage, 21, "calibrated").compliance,
        analyse(stage, 21, "calibrated", links=True).compliance,
        np.diag(limit / np.diag(K)),
    ]
    for k, direction in enumerate(DIRECTIONS):
        found = [(each.name, getattr(each.points, direction)) for each in made.split[direction].shares]
        errors = [100 * (K[k, k] * rung[k, k] - 1) for rung in rungs]
        expected = [*np.diff(errors), 100 * (limit[k] - [3, 5, 8][k] * 8.0**-4) * [1e-3, 2e-3, 3e-3][k]]
        names = (
            "freedoms left out of the model",
            "hinge formula",
            "links, pads and platform as rigid",
            "what the chart and the links leave",
            "large displacement",
        )
        assert [name for name, _ in found] == list(names)
        assert [points for _, points in found] == pytest.approx(expected, abs=1e-7)
        assert getattr(made.split[direction].total, direction) == pytest.approx(sum(expected), abs=1e-7)


def test_the_band_and_the_amplitude_are_those_of_the_commanded_direction(by_hand):
    *_, made = by_hand
    for direction, left, amplitude in zip(DIRECTIONS, (3.0, 5.0, 8.0), (0.04, 0.05, 2e-3), strict=True):
        assert made.split[direction].band == pytest.approx(1.25 * 100 * left * 8.0**-4, rel=1e-6)
        assert made.split[direction].amplitude == amplitude


def test_what_crosses_is_normalised_by_the_lever(by_hand):
    """Motion across by the force K_jj of a unit command; the model and its rungs keep to their axes."""
    K, _, _, across, made = by_hand
    last = {j: made.split[j].shares[3].points for j in DIRECTIONS}
    assert last["x"].y == pytest.approx(100 * across[1, 0] * K[0, 0], rel=1e-6)
    assert last["x"].theta == pytest.approx(100 * across[2, 0] * K[0, 0] * LEVER, rel=1e-6)
    assert last["theta"].y == pytest.approx(100 * across[1, 2] * K[2, 2] / LEVER, rel=1e-6)


def test_hinges_wide_out_of_plane_are_stiffer_by_up_to_nu_squared(by_hand, stage):
    """Towards plane strain, `E / (1 - nu^2)`: negative, and less than nu^2 of the whole compliance."""
    K, *_, made = by_hand
    for k, direction in enumerate(DIRECTIONS):
        whole = 100 * K[k, k] * analyse(stage, 21, "calibrated", links=True).compliance[k, k]
        found = getattr(made.split[direction].out_of_plane, direction)
        assert -(0.33**2) * whole < found < -0.8 * 0.33**2 * whole
    thicker = stage.model_copy(update={"thickness": 26.0})  # b/t = 52 is beyond the chart
    assert module.thick_compliance(thicker) is None


def test_total_is_the_error_of_the_figure_and_large_displacement(made, project, solve):
    small = ("points = 21", f"points = 3\nresolution = {SMALL}")
    case = project.edit("cases/fig5.toml", small, ("mobility3.toml", "mobility6.toml"))
    result, _ = run_case(LoadedCase(case), solve)
    found = result.uncertainty["mobility six"]["x"].extrapolated
    assert found + share(made, "large displacement", "x") == pytest.approx(made.split["x"].total.x, abs=1e-6)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_hinge_formula_is_nearly_all_of_it(made, direction):
    split = made.split[direction]
    formula = share(made, "hinge formula", direction)
    others = [abs(share(made, each.name, direction)) for each in split.shares if each.name != "hinge formula"]
    assert formula > 10 * max(others)
    assert formula > 0.9 * getattr(split.total, direction)


@pytest.mark.slow
def test_large_displacement_grows_with_the_command(made, stage, solve):
    larger = budget(stage, {"x": 0.5, "y": 0.5, "theta": 1e-2}, resolution=SMALL, solve=solve)
    for direction in DIRECTIONS:
        ratio = share(larger, "large displacement", direction) / share(made, "large displacement", direction)
        assert abs(ratio) > 5
        assert share(larger, "hinge formula", direction) == pytest.approx(share(made, "hinge formula", direction))


def test_a_hinge_off_the_chart_is_refused_by_name(project):
    path = project.edit("geometry/mobility6.toml", ("neck_mm = 0.5\nprismatic", "neck_mm = 0.01\nprismatic"))
    with pytest.raises(BadInput, match=r"hinges\.base\.neck_mm.*calibrated"):
        budget(load_feasible(path), resolution=SMALL)


def test_thin_necks_of_a_thick_stage_are_stiffer_than_the_papers_model_and_softer_in_plane_stress(stage):
    """The README's second map, at a corner of it and on both sides of its contour of zero."""
    base = stage
    for radius, neck, thick, plane in (
        (4.0, 0.2193, -7.7, 2.4),
        (1.642, 0.3243, -2.4, 8.2),
        (1.642, 0.4799, 1.7, 12.4),
    ):
        shape = {"radius": radius, "neck": neck}
        hinges = {name: getattr(base.hinges, name).model_copy(update=shape) for name in ("base", "elbow", "platform")}
        stage = base.model_copy(update={"hinges": base.hinges.model_copy(update=hinges)})
        paper = analyse(stage, 6).stiffness
        found = [
            paper[0, 0] * of[0, 0] - 1
            for of in (thick_compliance(stage), analyse(stage, 21, "calibrated", links=True).compliance)
        ]
        assert 100 * np.array(found) == pytest.approx([thick, plane], abs=0.1)


def test_three_dimensional_hinges_and_their_links_do_not_depend_on_the_plane_the_stage_is_taken_in(stage):
    held = stage.model_copy(update={"model": "plane_strain"})
    np.testing.assert_allclose(thick_compliance(held), thick_compliance(stage), rtol=1e-12, atol=1e-18)
