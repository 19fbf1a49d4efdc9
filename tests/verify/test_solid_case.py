"""Cases in three dimensions: what their errors, bands and fields are, and what they do not take."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexfem.fem.elements import solid_nodal_stress, solid_von_mises
from flexfem.fem.fields import solid_neck_stresses
from flexfem.fem.structure import layers_of, sheet_of
from flexfem.questions.bands import RelativeError, SolidLevels, pose_bounds, solve_solid
from flexfem.refused import BadInput, ComputationFailed
from flexfem.verify import protocol, solid_case
from flexfem.verify.case import Case, LoadedCase
from flexfem.verify.protocol import run_case

ROOT = Path(__file__).parents[2]
CASE = """
name = "extruded"
direction = "y"
amplitude_um = 40.0
points = 3
model = "three_dimensional"
resolution = 4
[[curve]]
label = "six"
stage = "stage.toml"
mobility = 6
[provenance]
amplitude_um = "assumed: a test"
points = "assumed: a test"
"""
UNLIKE = '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.61\n[provenance]'


@pytest.fixture
def case(tmp_path: Path) -> Any:
    """Writes a case and its stage, with changes; returns the case's file."""

    def written(case_edits: tuple[tuple[str, str], ...] = (), stage_edits: tuple[tuple[str, str], ...] = ()) -> Path:
        for name, text, edits in (
            ("case.toml", CASE, case_edits),
            ("stage.toml", (ROOT / "geometry" / "mobility6.toml").read_text(), stage_edits),
        ):
            for old, new in edits:
                assert old in text
                text = text.replace(old, new, 1)
            (tmp_path / name).write_text(text)
        return tmp_path / "case.toml"

    return written


def test_an_error_of_the_compliance_moves_a_pose_by_no_more_than_its_bound() -> None:
    C = np.diag([4.0, 9.0, 0.25])
    error = SolidLevels(C[None], C - np.diag([0.016, 0.0, 0.0]), C).of_layers  # one of three eigenvalues: 0.004
    assert error == pytest.approx((0.0025, 0.0025))  # by 1.25, halved: the middle, and half of the spread
    moved = pose_bounds(error, C, np.array([3.0, 5.0, 7.0]), np.eye(3))
    np.testing.assert_allclose(moved, 0.0025 * np.array([12 + 33.06054, 45 + 49.59083, 1.75 + 8.265138]), rtol=1e-6)
    many = np.array([[4.0, 1.1, 0.3], [1.1, 9.0, -0.7], [0.3, -0.7, 0.25]])
    alike = SolidLevels(C[None], 1.002 * many, many).of_layers  # all entries by as much
    assert alike == pytest.approx((0.0025, 0.0), abs=1e-12)
    moved = pose_bounds(RelativeError(0.0025, 0.0), many, np.array([3.0, 5.0, 7.0]), np.eye(3))
    np.testing.assert_allclose(moved, 0.0025 * np.array([19.6, 43.4, 0.85]))


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_no_load_and_no_reading_escapes_the_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape, lever = rng.normal(size=(3, 3)), np.diag([1.0, 1.0, 0.03])
    many = lever @ (shape @ shape.T + 0.05 * np.eye(3)) @ lever
    change = 0.01 * lever @ (lambda a: a + a.T)(rng.normal(size=(3, 3))) @ lever
    force, readings = rng.normal(size=3), rng.normal(size=(3, 4))
    bounds = pose_bounds(SolidLevels(many[None], many - change, many).of_layers, many, force, readings)
    assert np.all(1.25 * np.abs(readings.T @ change @ force) <= bounds * (1 + 1e-9))


def test_bands_are_of_the_mesh_and_of_the_layers(make_stage: Any, monkeypatch: Any) -> None:
    """The mesh errs as with one layer: a difference of all entries there is one of as many per cent here."""
    C = np.array([[0.020, 0.001, 2e-5], [0.001, 0.025, -3e-5], [2e-5, -3e-5, 1.8e-5]])
    planes = 1.1 * C * np.array([0.992, 0.998, 1.0])[:, None, None]  # one layer: a tenth softer
    monkeypatch.setattr(solid_case, "solve_solid", lambda *_: SimpleNamespace(compliance=C, mesh=None, unknowns=7))
    monkeypatch.setattr(solid_case, "solid_levels", lambda *_: SolidLevels(planes, 1.001 * C, C))
    monkeypatch.setattr(solid_case, "_full", lambda *_: None)
    given = {"name": "a", "direction": "y", "amplitude_um": 40.0, "points": 3, "model": "three_dimensional"}
    case = Case.model_validate(given | {"curve": [{"label": "a", "stage": "b"}]})
    assert (case.resolution, case.layers) == (6, 3)
    K = np.array([[50.0, 2.0, 40.0], [2.0, 41.0, 30.0], [40.0, 30.0, 52000.0]])
    found = solid_case.answer_of_solid(make_stage(), SimpleNamespace(stiffness=K), case)
    pose = C @ K[:, 1]
    percent = 100 * (pose - [0, 1, 0]) * [1, 1, 25]  # l3 is 25 mm
    np.testing.assert_allclose(found.found.percent, percent)
    np.testing.assert_allclose(found.of_layers, 100 * 0.00125 * np.abs(pose) * [1, 1, 25], rtol=1e-9)
    own = 100 * 1.1 * pose[1] * np.array([-0.008, -0.002, 0.0])
    np.testing.assert_allclose(found.bands[1].values, percent[1] + own, rtol=1e-9)
    assert found.bands[1].extrapolated > percent[1]
    of_mesh = 3 * 100 * 1.1 * pose[1] * 0.002 / (1.5**4 - 1)  # Roache's, from 4 to 6 triangles
    assert found.bands[1].band == pytest.approx(of_mesh + found.of_layers[1], rel=1e-9)
    assert (found.layers, found.unknowns, found.warnings) == (3, 7, ())
    held = solid_case.answer_of_solid(make_stage({"model": "plane_strain"}), SimpleNamespace(stiffness=K), case)
    assert held.warnings == ('model = "plane_strain" holds the faces of the stage; in three dimensions they are free',)


@pytest.mark.slow
def test_a_case_of_unlike_chains_in_three_dimensions_is_what_the_extruded_stage_does(case: Any) -> None:
    loaded = LoadedCase(case((), (("[provenance]", UNLIKE), ("thickness_mm = 10.0", "thickness_mm = 6.0"))))
    result, fields = run_case(loaded)
    model, stage = result.models["six"], loaded.stages["six"]
    response = solve_solid(stage, 4, 3)
    C, K = response.compliance, np.array(model.stiffness)
    percent = 100 * (C @ K - np.eye(3))[:, 1] * [1, 1, 24]
    stored = result.error_percent["six"]
    np.testing.assert_allclose([stored.x, stored.y, stored.theta], percent, rtol=1e-9)
    assert (result.elements, model.layers, model.resolution, model.unknowns) == (
        "three_dimensional", 3, 4, response.unknowns,
    )  # fmt: skip
    bands = result.uncertainty["six"]
    assert model.band_layers is not None
    for axis in ("x", "y", "theta"):
        assert bands[axis].band > getattr(model.band_layers, axis) > 0
    necks = solid_neck_stresses(stage, sheet_of(stage), response, 0.04 * K[:, 1][None]).highest[0]
    np.testing.assert_allclose(model.neck_stress, necks)
    assert fields["six"].stress.max() == pytest.approx(necks.max(), rel=1e-6)
    hub = np.hypot(*fields["six"].nodes.T) < 8.0 + 1e-6
    x, y = fields["six"].nodes[hub].T
    pose = 0.04 * C @ K[:, 1]
    moved = np.stack([pose[0] - pose[2] * y, pose[1] + pose[2] * x], axis=-1)
    np.testing.assert_allclose(fields["six"].displacement[hub], moved, atol=1e-12)
    assert layers_of(stage, 3).heights[-1] == 3.0


@pytest.mark.slow
def test_hinges_of_three_dimensions_bring_the_error_to_that_of_the_mesh(case: Any) -> None:
    """All freedoms, calibrated hinges, elastic links and the thickness chart: two witnesses of one real stage."""
    edits = (("mobility = 6", 'mobility = 21\nlinks = true\nformula = "calibrated"'),)
    path = case(edits, (("thickness_mm", 'model = "corrected"\nthickness_mm'),))
    result, _ = run_case(LoadedCase(path))
    assert abs(result.error_percent["six"].y) < 0.3
    assert abs(result.uncertainty["six"]["y"].extrapolated) < 0.1


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (("resolution = 4", 'analysis = "nonlinear"'), 'analysis = "nonlinear", expected "linear" with model = "three'),
        (("resolution = 4", 'drive = "joints"'), 'drive = "joints", expected "force" with model = "three_dimensional"'),
        (("resolution = 4", 'drive = "strokes"'), 'drive = "strokes", expected "force" with model'),
        (("resolution = 4", "layers = 2"), "layers = 2"),
        (('model = "three_dimensional"', "layers = 3"), 'layers = 3, expected no layers with model = "fe"'),
        (('"three_dimensional"', '"corrected"'), 'model = "corrected", expected'),
    ],
)
def test_what_a_case_in_three_dimensions_does_not_take_is_refused(edit: tuple[str, str], said: str, case: Any) -> None:
    with pytest.raises(BadInput) as refusal:
        LoadedCase(case((edit,)))
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_the_usual_mesh_is_that_of_its_finite_elements(case: Any) -> None:
    of_solid = LoadedCase(case((("resolution = 4\n", ""),))).case
    of_plane = LoadedCase(case((('model = "three_dimensional"\nresolution = 4\n', ""),))).case
    assert (of_solid.resolution, of_solid.layers, of_plane.resolution, of_plane.model) == (6, 3, 8, "fe")


def test_a_case_in_three_dimensions_asks_the_extruded_stage(case: Any, monkeypatch: Any) -> None:
    def asked(stage: Any, analytic: Any, of: Any) -> None:
        raise ComputationFailed(f"{analytic.mobility} {of.layers} {stage.thickness:g}")

    monkeypatch.setattr(protocol, "answer_of_solid", asked)
    with pytest.raises(ComputationFailed, match="6 4 10"):
        run_case(LoadedCase(case((("resolution = 4", "layers = 4"),))))


def test_fields_are_of_the_mid_plane_and_of_the_highest_stress(make_stage: Any) -> None:
    """Bent necks are stressed most in the mid-plane, where they cannot contract; away from them the faces may be."""
    stage = make_stage()
    response, force = solve_solid(stage, 2, 1), np.array([0.7, -1.3, 20.0])
    found = solid_case._full(stage, response, force)
    every = np.tensordot(force, response.fields, axes=1)
    np.testing.assert_allclose(found.field, every[:, 0, :2])
    np.testing.assert_allclose(found.pose, response.compliance @ force)
    mesh = response.mesh
    stress = solid_von_mises(
        solid_nodal_stress(mesh, sheet_of(stage), response.layers, every, np.arange(len(mesh.nodes)))
    )
    np.testing.assert_allclose(found.stress, np.maximum(np.maximum(stress[:, 0], stress[:, 1]), stress[:, 2]))
    assert np.sum(found.stress > 1.01 * stress[:, 0]) > 10
    assert found.neck_stress.max() == pytest.approx(found.stress.max(), rel=1e-6)


def test_curves_of_one_stage_solve_it_once(case: Any) -> None:
    twice = CASE[CASE.index("[[curve]]") : CASE.index("[provenance]")].replace('"six"', '"again"')
    loaded = LoadedCase(case((("[provenance]", f"{twice}[provenance]"),)))
    assert loaded.stages["six"] is loaded.stages["again"]


def test_baselines_of_cases_in_three_dimensions_need_no_plane_mesh(case: Any, tmp_path: Path) -> None:
    from flexfem.commands.baseline import records

    path = case()
    assert records.meshes(path) == {}
    assert list(records.sections(path, tmp_path, lambda *_: None)) == ["result"]
