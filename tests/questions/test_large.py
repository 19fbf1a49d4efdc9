"""Large displacements: two models that agree, numbers that belong to one another, figure and
command.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.fem.nonlinear import equilibrium
from flexfem.paper import large as module
from flexfem.paper.equilibrium import at_pose
from flexfem.paper.figures.large import large_figure
from flexfem.paper.large import EXACT, HELD, LOADED, TANGENT, WITHOUT, StageLarge
from flexfem.paper.model import analyse, assemble
from flexfem.paper.solutions import solved
from flexfem.paper.stage_mesh import plate_of
from flexfem.units import DIRECTIONS

COARSE = 2  # triangles across a neck: the nonlinearity is within 0.6 % of that with eight
AGREE = 0.09  # pseudo-rigid over finite-element nonlinearity, less one: 0.07 in X on any mesh
SUM = 1e-7
SLOPE = 1e-7  # percentage points: Gauss's sums, central differences


@pytest.fixture(scope="module")
def found(stage) -> StageLarge:
    """Finite elements are solved at two commands on either side of rest, not at four."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "ELEMENT_STEPS", np.array([-20, -2, 0, 2, 20]))
        return flexfem.large(stage, resolution=COARSE)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_16_is_the_slope_of_the_exact_load_and_its_sum_the_load(found, direction):
    tangent = found.at("tangent", direction=direction)
    errors = found.at("errors", direction=direction)
    np.testing.assert_allclose(tangent[:, TANGENT], tangent[:, EXACT], rtol=0, atol=SLOPE)
    np.testing.assert_allclose(errors[:, TANGENT], errors[:, EXACT], rtol=0, atol=SUM)
    assert np.abs(tangent[:, WITHOUT] - tangent[:, EXACT]).max() > 0.05


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_pseudo_rigid_stage_and_finite_elements_agree_on_the_nonlinearity(found, direction):
    for name in ("stiffness", "error", *(["aside"] if direction != "theta" else [])):
        of = found.at(name, direction=direction)
        np.testing.assert_allclose(of[:, EXACT] / of[:, HELD], 1.0, atol=AGREE)
    stiffness = found.at("stiffness", direction=direction)
    assert np.all(stiffness[:, WITHOUT] / stiffness[:, HELD] < 0.75), (
        "(16) without its terms is nowhere near them"
    )


def test_the_load_on_the_finite_elements_is_the_exact_one(found, stage):
    load = at_pose(assemble(stage), np.array([0.0, -0.5, 0.0])).load
    response = solved(stage, COARSE)
    pose = equilibrium(response.mesh, plate_of(stage), load).pose[0]
    error = 100 * (response.compliance @ load - pose) * [1, 1, 24] / pose[1]  # l3 = 24 mm
    np.testing.assert_allclose(found.at("errors", direction="y")[0, LOADED], error, rtol=1e-6)
    aside = found.at("aside", direction="y", at="-100 %")[LOADED]
    assert aside == pytest.approx(error[2], rel=1e-6)
    assert aside == pytest.approx(-0.452, abs=0.005)  # 105 urad of 24 mm over 0.56 mm


def test_the_box_is_searched_at_its_corners_edges_and_faces(found, stage):
    """Distances with rotations by l3 = 24 mm; tangent compliances with the second-order terms over
    those without.
    """
    of = assemble(stage)
    C = analyse(stage).compliance
    ends = np.array(
        [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if i or j or k]
    )
    for part, position, terms in zip((0.1, 1.0), found.position, found.terms, strict=True):
        poses = part * ends * [0.5, 0.5, 0.01]
        off = (at_pose(of, poses).load @ C - poses) * [1, 1, 24]
        size = np.linalg.norm(poses * [1, 1, 24], axis=1)
        assert position == pytest.approx(100 * np.max(np.linalg.norm(off, axis=1) / size), rel=1e-7)
        at = at_pose(of, poses)
        with_terms, without = (
            np.array([np.diag(np.linalg.inv(K)) for K in each.stiffness()])
            for each in (at, at.without_terms)
        )
        assert terms == pytest.approx(100 * np.max(np.abs(with_terms / without - 1)), rel=1e-6)


def test_a_command_out_of_reach_is_refused(stage):
    with pytest.raises(flexfem.ComputationFailed, match=r"no equilibrium|strain of"):
        flexfem.large(stage, amplitude=900.0, models="analytic")


def test_the_figure_draws_every_theory_over_the_command(found):
    lines = {
        line.get_label(): line.get_xydata() for line in large_figure(found).axes[1].get_lines()
    }
    exact = np.column_stack(
        [np.linspace(-500, 500, 41), found.at("errors", direction="x")[:, EXACT, 0]]
    )
    np.testing.assert_allclose(lines["exact equilibrium"], exact, atol=1e-9)
    np.testing.assert_allclose(
        lines["finite elements held at the command"][:, 0], [-500, -50, 0, 50, 500], atol=1e-9
    )
    loaded = lines["finite elements under the load of exact equilibrium"]
    np.testing.assert_allclose(loaded[:, 1], found.at("error", direction="x")[:, LOADED])
