"""A design by finite elements: every column against the ordinary path, and against the other
witness where there is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import flexfem.paper.stage_mesh
from flexfem.arrays import Array
from flexfem.fem.response import unit_response
from flexfem.meshing.faces import mesh_faces
from flexfem.meshing.process import MeshTimeout
from flexfem.paper.fields import base_rotations, neck_maxima, neck_stresses, plane_stress
from flexfem.paper.model import analyse
from flexfem.paper.solutions import solve_solid
from flexfem.paper.solutions import solved as solve_stage
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import mesh_sectors, plate_of
from flexfem.questions.bands import error_matrix, grid_convergence, mesh_band
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.answer import answer
from flexfem.study.columns import (
    BANDS,
    COUPLINGS,
    CROSSES,
    ERRORS,
    RANGES,
    STIFFNESSES,
    STRESSES,
    TRAVELS,
)
from flexfem.study.loaded import LoadedStudy

from ..tolerances import SOLVED

MESHES = 2e-3  # two meshes of resolution 4, each within 0.1 % of no mesh
STRESS = 1e-2  # averaged nodal stress at a notch on two coarse meshes
MODELS = 0.03  # of the rotation of a base hinge: the bodies beside it are not quite rigid
DRIVE = "[drive]\nstroke_um = 17.4\nlever_arm_mm = 11.3"
ONE = ("method = 'grid'", 'key = "thickness_mm"\nvalues = [9.7]')


def columns(loaded: LoadedStudy, stage: Stage) -> dict[str, float]:
    return dict(zip(loaded.outputs, loaded.family.solved(stage).tolist(), strict=True))


def of(found: dict[str, float], names: tuple[str, ...]) -> Array:
    return np.array([found[name] for name in names])


@pytest.fixture(params=["alike", "different"])
def stage(request: pytest.FixtureRequest, studies: Any) -> Stage:
    base: Stage = studies.of(*ONE, head='model = "fe"').base
    return base if request.param == "different" else base.model_copy(update={"override": ()})


def test_stiffness_stress_and_reach_are_those_of_the_ordinary_path(
    stage: Stage, studies: Any
) -> None:
    found = columns(studies.of(*ONE, head='model = "fe"'), stage)
    slow = solve_stage(stage, 4)
    K = np.linalg.inv(slow.compliance)
    assert tuple(found) == (*STIFFNESSES, *COUPLINGS, *STRESSES, *RANGES, "envelope_mm")
    size = np.sqrt(np.diag(K))
    np.testing.assert_allclose(of(found, STIFFNESSES[:3]), np.diag(K), rtol=MESHES)
    coupling = (K / np.outer(size, size))[[0, 0, 1], [1, 2, 2]]
    np.testing.assert_allclose(of(found, COUPLINGS), coupling, rtol=0, atol=MESHES / 10)
    unit = size[[0, 0, 1]] * size[[1, 2, 2]]
    np.testing.assert_allclose(
        of(found, STIFFNESSES[3:]) / unit, coupling, rtol=0, atol=MESHES / 10
    )
    fields = slow.under(K.T).nodal
    stress = [
        neck_maxima(stage, slow.mesh, plane_stress(stage, slow.mesh, field)).max()
        for field in fields
    ]
    np.testing.assert_allclose(of(found, STRESSES), 1e-3 * np.array(stress), rtol=STRESS)
    np.testing.assert_allclose(
        of(found, RANGES) * of(found, STRESSES), stage.material.yield_strength, rtol=SOLVED
    )
    assert found["envelope_mm"] == pytest.approx(2 * np.hypot(*slow.mesh.nodes.T).max(), rel=1e-6)


def test_travel_agrees_with_the_analytic_rotation_of_the_base_hinges(
    stage: Stage, studies: Any
) -> None:
    """The hinges' own compliances in both; at the travel the first base hinge has turned by stroke
    over lever arm.
    """
    found = columns(studies.of(*ONE, head='model = "fe"', tail=DRIVE), stage)
    head = 'model = "analytic"\nformula = "calibrated"\nmobility = 21\nlinks = true'
    beside = replace(studies.of(*ONE, head=head, tail=DRIVE), base=stage)
    expected = answer(beside, 0, 1).values[0, [beside.outputs.index(name) for name in TRAVELS]]
    np.testing.assert_allclose(of(found, TRAVELS), expected, rtol=MODELS)


def test_errors_are_those_of_the_protocol(stage: Stage, studies: Any) -> None:
    head = 'model = "verify"\nmobility = 6\nformula = "paros-weisbord"\nbands = false'
    found = columns(studies.of(*ONE, head=head), stage)
    K = analyse(stage, 6, "paros-weisbord").stiffness
    C = solve_stage(stage, 4).compliance
    for k in range(3):
        percent = error_matrix(K, C, stage.chain.link_lengths[2])[:, k]
        assert found[ERRORS[k]] == pytest.approx(percent[k], abs=100 * MESHES)
        assert found[CROSSES[k]] == pytest.approx(
            np.abs(np.delete(percent, k)).max(), abs=100 * MESHES
        )
    assert not set(BANDS) & set(found)


def test_a_band_is_never_less_than_that_of_grid_convergence_and_of_two_meshes_thrice_roaches_index() -> (
    None
):
    resolutions = np.array([2.0, 3.0, 4.0])
    steep = 1 + resolutions**-5.5
    noisy = np.array([1.0, 1.3, 1.1])
    for values in (steep, noisy):
        assert mesh_band(resolutions, values) >= grid_convergence(resolutions, values).band
    assert mesh_band(resolutions, steep) > 1.2 * grid_convergence(resolutions, steep).band
    assert mesh_band(np.array([3.0, 4.0]), np.array([7.0, 7.2])) == pytest.approx(
        3 * 0.2 / ((4 / 3) ** 4 - 1)
    )


def test_a_coarse_mesh_that_folds_widens_the_band_and_loses_no_design(
    stage: Stage, studies: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = studies.of(*ONE, head='model = "verify"\nmobility = 6')
    whole = columns(loaded, stage)

    def folding(of: Stage, resolution: int, *others: Any) -> Any:
        if resolution == 2:
            raise ComputationFailed("folded")
        return mesh_sectors(of, resolution, *others)

    monkeypatch.setattr("flexfem.paper.stage_mesh.mesh_sectors", folding)
    without = columns(loaded, stage)
    assert [without[name] for name in ERRORS] == [whole[name] for name in ERRORS]
    assert all(0 < without[name] < 1 for name in BANDS)  # percentage points


def test_every_design_has_its_row(studies: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Good, impossible by a number, impossible to draw, not meshed, out of time."""
    loaded = studies.of(
        *(ONE[0], 'key = "hinges.base.neck_mm"\nvalues = [0.5, 12.0, 0.6, 0.7]'),
        head='model = "fe"',
    )

    def meshed_once(job: Any) -> Any:
        if any(abs(grading.size - 0.7 / 4) < 1e-12 for grading in job.gradings):
            raise MeshTimeout("too slow")
        if any(abs(grading.size - 0.6 / 4) < 1e-12 for grading in job.gradings):
            raise ComputationFailed("no mesh")
        return mesh_faces(job)

    monkeypatch.setattr(flexfem.paper.stage_mesh, "run_mesher", lambda job, limit: meshed_once(job))
    rows = answer(loaded, 0, 4)
    assert rows.status.tolist() == ["ok", "refused", "failed", "time limit"]
    assert (
        rows.reason[0] == ""
        and rows.reason[1].startswith("hinges.base.neck_mm = 12")
        and all(rows.reason[2:])
    )
    assert np.isfinite(rows.values[0]).all() and np.isnan(rows.values[1:]).all()


def test_the_time_limit_stops_a_mesher_of_its_own(studies: Any) -> None:
    loaded = studies.of(*ONE, head='model = "fe"\ntime_limit_s = 0.001')
    assert answer(loaded, 0, 1).status.tolist() == ["time limit"]


def test_a_formula_off_its_chart_refuses_the_design(stage: Stage, studies: Any) -> None:
    loaded = studies.of(*ONE, head='model = "verify"\nformula = "calibrated"\nbands = false')
    with pytest.raises(BadInput, match="chart"):
        loaded.family.solved(stage.replace(radius={"base": 0.4}))


@pytest.mark.parametrize(
    ("head", "model"),
    [('model = "analytic"\nmobility = 21', "analytic"), ('model = "fe"', "finite elements")],
)
def test_a_study_asks_any_number_of_a_question_by_its_path(
    studies: Any, head: str, model: str
) -> None:
    path = f"stiffness.compliance.{model.replace(' ', '_')}.x.x"
    rows = answer(studies.of(*ONE, head=f'{head}\nask = ["{path}"]'), 0, 1)
    K = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
    assert rows.values[0, -1] == pytest.approx(np.linalg.inv(rows.values[0][K])[0, 0], rel=1e-6)
    refused = answer(studies.of(*ONE, head=f'{head}\nask = ["stiffness.nothing"]'), 0, 1)
    assert (
        refused.status[0] == "refused" and "ask: no number stiffness.nothing" in refused.reason[0]
    )
    with pytest.raises(BadInput, match=r"question\.quantity\.labels"):
        studies.of(*ONE, head=f'{head}\nask = ["kxx"]')


def test_three_dimensions_are_those_of_the_stage(studies: Any) -> None:
    loaded = studies.of(*ONE, head='model = "three_dimensional"\nthickness_resolution = 1')
    found = columns(loaded, loaded.base)
    stage = loaded.base
    response = solve_solid(stage, 4, 1)
    K = np.linalg.inv(response.compliance)
    highest = neck_stresses(stage, response, K).highest.max(axis=(1, 2))
    assert found["kxx_n_per_mm"] == pytest.approx(K[0, 0], rel=1e-6)
    assert found["stress_x_mpa_per_um"] == pytest.approx(1e-3 * highest[0], rel=1e-6)
    assert found["range_y_um"] == pytest.approx(1e3 * 411.0 / highest[1], rel=1e-6)
    plane = unit_response(response.sectors, plate_of(stage))
    turning = np.abs(np.linalg.inv(plane.compliance) @ base_rotations(stage, plane)).max(axis=1)
    solid = np.abs(K @ base_rotations(stage, response)).max(axis=1)
    np.testing.assert_allclose(
        solid, turning, rtol=0.01
    )  # per displacement, geometry alone decides
