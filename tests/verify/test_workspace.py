"""Large displacements over the workspace: two witnesses that agree, and numbers that belong to one another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.analytic.large import at_pose, tangents
from flexfem.analytic.model import analyse, assemble
from flexfem.fem.nonlinear import equilibrium
from flexfem.fem.structure import plate_of
from flexfem.mechanism.stage import load_feasible
from flexfem.refused import ComputationFailed
from flexfem.units import DIRECTIONS
from flexfem.verify import workspace as module
from flexfem.verify.protocol import solve_stage
from flexfem.verify.workspace import workspace

ROOT = Path(__file__).parents[2]
PATH = ROOT / "geometry/mobility6.toml"
COARSE = 2  # triangles across a neck: the nonlinearity is within 0.6 % of that with eight
WITNESSES = 0.09  # pseudo-rigid over finite-element nonlinearity, less one: 0.07 in X on any mesh
SUM, SLOPE = 1e-7, 1e-7  # percentage points: Gauss's sums, central differences
EXACT = 1e-9  # of the number itself: the same computed elsewhere


@pytest.fixture(scope="module")
def stage():
    return load_feasible(PATH)


@pytest.fixture(scope="module")
def solved(stage):
    return solve_stage(stage, COARSE)


@pytest.fixture(scope="module")
def made(stage, solved):
    """Finite elements are solved at two commands on either side of rest, not at four."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "SOLVED", np.array([-20, -2, 0, 2, 20]))
        return workspace(stage, resolution=COARSE, solve=lambda *_: solved)


def point(made, direction, commanded):
    """The numbers at a command."""
    return next(each for each in made.travel[direction].points if each.commanded == pytest.approx(commanded))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_16_is_the_slope_of_the_exact_load_and_its_sum_the_load(made, direction):
    travel = made.travel[direction]
    np.testing.assert_allclose(travel.stiffness["tangent"], travel.stiffness["exact"], rtol=0, atol=SLOPE)
    np.testing.assert_allclose(travel.position["tangent"], travel.position["exact"], rtol=0, atol=SUM)
    assert np.abs(np.subtract(travel.stiffness["without"], travel.stiffness["exact"])).max() > 0.05


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_along_the_command_the_position_error_is_what_the_load_deviates_from_18_by(made, stage, direction):
    axis, travel = DIRECTIONS.index(direction), made.travel[direction]
    K, moved = analyse(stage).stiffness, np.array(travel.commanded) != 0
    deviation = np.array(travel.load)[moved, axis] / (K[axis, axis] * np.array(travel.commanded)[moved]) - 1
    found = np.array(travel.position["exact"])[moved, axis]
    np.testing.assert_allclose(found, 100 * deviation, rtol=0, atol=1e-9)  # K is diagonal to round-off
    assert not np.array(travel.position["exact"])[~moved].any()


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_pseudo_rigid_stage_and_finite_elements_agree_on_the_nonlinearity(made, direction):
    for each in made.travel[direction].points:
        assert each.stiffness["exact"] / each.stiffness["elements"] == pytest.approx(1, abs=WITNESSES)
        assert each.position["exact"] / each.position["elements"] == pytest.approx(1, abs=WITNESSES)
        if direction != "theta":
            assert each.across["exact"] / each.across["elements"] == pytest.approx(1, abs=WITNESSES)
            # without its terms (16) is nowhere near them
            assert each.stiffness["without"] / each.stiffness["elements"] < 0.75


def test_a_symmetric_stage_turns_without_moving_aside(made):
    travel = made.travel["theta"]
    aside = [np.array(values)[:, :2] for values in (*travel.position.values(), travel.elements.position)]
    assert max(np.abs(each).max() for each in aside) < 1e-6  # per cent; 0.4 in the other directions


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_small_commands_are_linear_and_the_error_grows_with_the_command(made, direction):
    far = made.amplitude[direction]
    for name in ("without", "exact", "elements"):
        uneven = [
            point(made, direction, part * far).position[name] - point(made, direction, -part * far).position[name]
            for part in (0.1, 1.0)
        ]
        assert uneven[1] / uneven[0] == pytest.approx(10.0, rel=0.05)  # quadratic but for terms of third order
    middle = len(made.travel[direction].commanded) // 2
    assert all(abs(values[middle]) < 1e-6 for values in made.travel[direction].stiffness.values())


def test_the_load_on_the_finite_elements_is_the_exact_one(made, stage, solved):
    axis, command = 1, -0.5
    load = at_pose(assemble(stage), command * np.eye(3)[axis]).load
    pose = equilibrium(solved.mesh, plate_of(stage), load).pose[0]
    np.testing.assert_allclose(made.travel["y"].elements.loaded[0], pose, rtol=0, atol=EXACT * 0.5)
    error = 100 * (solved.response.compliance @ load - pose) * [1, 1, 24] / pose[axis]  # l3 = 24 mm
    found = point(made, "y", command)
    assert (found.position["loaded"], found.across["loaded"]) == pytest.approx((error[1], error[2]), rel=1e-6)
    np.testing.assert_allclose(made.travel["y"].elements.loaded_position[0], error, rtol=1e-6)
    assert found.across["loaded"] == pytest.approx(-0.452, abs=0.005)  # 105 urad of 24 mm over 0.56 mm


def test_the_box_is_searched_at_its_corners_edges_and_faces(made, stage):
    """Distances with rotations by l3 = 24 mm; tangent compliances with the second-order terms over those without."""
    of, C = assemble(stage), analyse(stage).compliance
    ends = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if i or j or k])
    for part, found in ((0.1, made.small), (1.0, made.box)):
        poses = part * ends * [0.5, 0.5, 0.01]
        off = (at_pose(of, poses).load @ C - poses) * [1, 1, 24]
        position = np.max(np.linalg.norm(off, axis=1) / np.linalg.norm(poses * [1, 1, 24], axis=1))
        assert found.position == pytest.approx(100 * position, rel=1e-7)
        at = tangents(of, poses)
        with_terms, without = (np.array([np.diag(np.linalg.inv(K)) for K in each]) for each in (at.tangent, at.without))
        assert found.terms == pytest.approx(100 * np.max(np.abs(with_terms / without - 1)), rel=1e-6)


def test_the_record_says_what_it_is_of(made, stage):
    assert (made.hash, made.mobility, made.resolution, made.plane) == (stage.hash, 6, COARSE, "plane_stress")
    assert made.assumed == list(stage.assumed) and made.assumed
    assert made.amplitude == {"x": 0.5, "y": 0.5, "theta": 0.01}
    assert type(made).model_validate_json(made.model_dump_json()) == made


def test_a_command_out_of_reach_is_refused(stage, solved):
    with pytest.raises(ComputationFailed, match=r"no equilibrium|strain of"):
        workspace(stage, 6000.0, solve=lambda *_: solved)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mobility3", "mobility6"])
def test_a_finer_mesh_moves_the_compliance_and_not_the_nonlinearity(name):
    path = ROOT / f"geometry/{name}.toml"
    coarse, fine = (workspace(load_feasible(path), resolution=n) for n in (4, 8))
    for direction in DIRECTIONS:
        for one, two in zip(coarse.travel[direction].points, fine.travel[direction].points, strict=True):
            assert one.position["elements"] == pytest.approx(two.position["elements"], rel=1e-3)
            assert one.stiffness["elements"] == pytest.approx(two.stiffness["elements"], rel=1e-3)
