"""The error budget: shares that add up, and the right thing in each of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexfem.layout.feasibility import load_feasible
from flexfem.verify.budget import CALIBRATED, SHARES, budget
from flexfem.verify.case import DIRECTIONS, LoadedCase
from flexfem.verify.protocol import run_case, solve_stage

ROOT = Path(__file__).parents[2]
ROUND_OFF = 1e-9  # percentage points
SMALL = 4  # resolution: a coarse mesh shows the same shares


@pytest.fixture(scope="module")
def made():
    path = ROOT / "geometry/mobility6.toml"
    return budget(path, load_feasible(path), resolution=SMALL)


def share(made, name, direction):
    found = [share for share in made.split[direction].shares if share.name == name]
    return getattr(found[0].points, direction)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_shares_add_up_to_the_total(made, direction):
    split = made.split[direction]
    assert [share.name for share in split.shares] == list(SHARES)
    for axis in DIRECTIONS:
        total = sum(getattr(share.points, axis) for share in split.shares)
        assert total == pytest.approx(getattr(split.total, axis), abs=ROUND_OFF)


def test_total_is_the_error_of_the_figure_and_large_displacement(made, project):
    case = project.edit("cases/fig5.toml", ("points = 21", f"points = 21\nresolution = {SMALL}"))
    result, _ = run_case(LoadedCase(case))
    found = result.uncertainty["mobility six"]["x"].extrapolated
    assert found + share(made, "large displacement", "x") == pytest.approx(made.split["x"].total.x, abs=1e-6)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_hinge_formula_is_nearly_all_of_it(made, direction):
    split = made.split[direction]
    formula = share(made, "hinge formula", direction)
    others = [abs(share(made, name, direction)) for name in SHARES if name != "hinge formula"]
    assert formula > 10 * max(others)
    assert formula > 0.9 * getattr(split.total, direction)


def test_large_displacement_grows_with_the_command(made):
    path = ROOT / "geometry/mobility6.toml"
    larger = budget(path, load_feasible(path), {"x": 0.5, "y": 0.5, "theta": 1e-2}, resolution=SMALL, solve=solve_stage)
    for direction in DIRECTIONS:
        assert abs(share(larger, "large displacement", direction)) > 5 * abs(
            share(made, "large displacement", direction)
        )
        assert share(larger, "hinge formula", direction) == pytest.approx(share(made, "hinge formula", direction))


def test_a_hinge_off_the_chart_is_refused_by_name(project):
    from flexfem.errors import BadInput

    path = project.edit("geometry/mobility6.toml", ("neck_mm = 0.5\nprismatic", "neck_mm = 0.01\nprismatic"))
    with pytest.raises(BadInput, match=rf"hinges\.base\.neck_mm.*{CALIBRATED}"):
        budget(path, load_feasible(path), resolution=SMALL)
