"""What `flexfem drift --three-dimensional` answers: literal numbers, bands, plane stress beside it, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexfem
from flexfem.arrays import Array
from flexfem.commands import cli
from flexfem.verify import solid_drift
from flexfem.verify.solid_drift import CASES, SolidDriftFields, layer_bands

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
NECKS = {(1, "base"): {"neck": 0.61}, (2, "elbow"): {"neck": 0.72}, (3, "platform"): {"radius": 1.9}}


@pytest.fixture(scope="module")
def warm() -> SolidDriftFields:
    return flexfem.drift_fields_solid(flexfem.load(STAGE))


def poses(found: Any) -> Array:
    return np.array([found.cases[name].pose for name in CASES])


@pytest.mark.slow
def test_a_symmetric_stage_drifts_as_the_plane_says_and_rises_with_a_gradient_through_it(
    warm: SolidDriftFields,
) -> None:
    """Resolution 6, three layers; on 9 triangles across a neck, one layer, x goes -0.022993 and z rises 0.0012457."""
    uniform, x, y, z = (warm.record.cases[name] for name in CASES)
    assert uniform.pose == pytest.approx([0.0, 0.0, 5.474e-6], rel=1e-3, abs=1e-15)
    assert x.pose == pytest.approx([-0.022996, 0.0029614, 0.0], rel=1e-3, abs=1e-15)
    assert y.pose == pytest.approx([-0.0029614, -0.022996, 0.0], rel=1e-3, abs=1e-15)
    assert z.pose == pytest.approx([0.001226, 0.0, 0.0], rel=2e-3, abs=1e-15)
    assert abs(z.pose[0] - 0.0012457) < z.band[0] < 1.2e-4 and abs(x.pose[0] + 0.022993) < x.band[0] < 2e-4
    assert x.plane_stress == pytest.approx([-0.022614, 0.0029776, 0.0], rel=1e-3, abs=1e-15)
    assert z.plane_stress is None and np.max(z.stress) == pytest.approx(37.67, rel=0.02)
    assert np.max(x.stress) == pytest.approx(13.68, rel=0.02)
    assert max(x.edges) == pytest.approx(118.9, rel=0.03)  # held across too: far more than the 68.5 of plane stress
    for case in (uniform, x, y, z):
        assert case.band == pytest.approx(np.add(case.band_plane, case.band_thickness))
    assert warm.record.hash == flexfem.drift(warm.stage, resolution=None).hash


@pytest.mark.slow
def test_the_fields_carry_the_clamped_faces_with_the_frame_and_the_hub_with_metal_and_pose(
    warm: SolidDriftFields,
) -> None:
    mesh, z = warm.mesh, warm.heights
    for name, middle in (("uniform", None), ("gradient in z", 1.226e-3)):
        field, stress = warm.field(name)  # type: ignore[arg-type]
        ground, hub = (np.unique(mesh.edges[edge]) for edge in ("ground", "hub"))
        (x, y), (hx, hy) = mesh.nodes[ground].T[..., None], mesh.nodes[hub].T[..., None]
        if middle is None:
            assert field[ground, :, 0] == pytest.approx(np.broadcast_to(12e-6 * x, field[ground, :, 0].shape))
            assert field[hub, :, 2] == pytest.approx(np.broadcast_to(23.6e-6 * z, field[hub, :, 2].shape), abs=1e-15)
        else:
            assert field[ground, :, 2] == pytest.approx(12e-6 * (z**2 - x**2 - y**2) / 2)
            assert field[hub, :, 2] == pytest.approx(middle + 23.6e-6 * (z**2 - hx**2 - hy**2) / 2, abs=4e-6)
        assert stress.shape == field.shape[:2] and np.min(stress) >= 0.0


@pytest.mark.slow
def test_unlike_chains_tilt_and_a_frame_of_the_same_metal_leaves_the_stage_at_rest() -> None:
    unlike = flexfem.load(STAGE).replace(override=NECKS, thickness=4.0)
    told: list[str] = []
    found = solid_drift.solid_drift(unlike, 4, 3, told.append)
    turned = found.record.cases["gradient in z"].pose
    assert min(abs(each) * 24.0 for each in turned[1:]) > 1e-3 * abs(turned[0]) > 0.0
    for name in CASES[:3]:
        case = found.record.cases[name]
        assert case.pose == pytest.approx(case.plane_stress, abs=0.03 * np.max(np.abs(case.plane_stress or 0.0)))
    same = solid_drift.solid_drift(unlike.replace(frame={"expansion": 23.6e-6}), 4, 3)
    assert not np.any(poses(same.record)) and not np.any([same.record.cases[name].stress for name in CASES])
    field, stress = same.field("gradient in x")
    x, y = same.mesh.nodes.T[..., None]
    assert field[..., 0] == pytest.approx(23.6e-6 * (x**2 - y**2 - same.heights**2) / 2) and not np.any(stress)
    assert len(told) == 2


def test_the_band_of_the_layers_is_the_largest_change_of_a_case() -> None:
    few, many = np.array([[1.0, 0.0], [2.0, 1e-12], [0.0, 3.0]]), np.array([[1.1, 0.0], [1.7, 2e-12], [0.0, 3.2]])
    found = layer_bands(few, many)
    assert found[:, 0] == pytest.approx([0.375, 0.375, 0.0]) and found[:, 1] == pytest.approx([0.0, 2e-12, 0.25])


def small(stage: flexfem.Stage, resolution: int, layers: int, progress: Any = None) -> Any:
    """As `solid_drift`, on meshes too coarse to be asked for."""
    return solid_drift.solid_drift(stage, 4, 3, progress)


@pytest.mark.slow
def test_the_command_prints_and_keeps_both_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from flexfem.reports import heat

    found = small(flexfem.load(STAGE), 4, 3)
    monkeypatch.setattr(heat, "drift_fields_solid", lambda *_: found)
    given = ["drift", str(STAGE), "--three-dimensional"]
    cli.app([*given, "--json", "-o", str(tmp_path)], standalone_mode=False)
    printed = json.loads(capsys.readouterr().out)
    assert printed == found.record.model_dump(mode="json")
    assert json.loads((tmp_path / "mobility6-drift-solid.json").read_text())["cases"] == printed["cases"]
    assert b"displacement, gradient in z" in (tmp_path / "mobility6-drift-solid.vtu").read_bytes()
    cli.app(given, standalone_mode=False)
    said = capsys.readouterr().out
    assert (
        "tilt x" in said
        and "gradient in z" in said
        and "-23.03 um" in said
        and "1.205 um" in said
        and "at clamped edges" in said
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--layers", "3"], "--layers without --three-dimensional"),
        (["--three-dimensional", "--analytic"], "--analytic with --three-dimensional"),
        (["--three-dimensional", "--links"], "--links with --three-dimensional"),
        (["--three-dimensional", "--mobility", "6"], "--mobility with --three-dimensional"),
        (["--three-dimensional", "--formula", "koster"], "--formula with --three-dimensional"),
        (["--three-dimensional", "--resolution", "5"], "resolution 5, expected an integer from 6"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options: list[str], said: str) -> None:
    with pytest.raises(flexfem.BadInput, match=said) as refused:
        cli.app(["drift", str(STAGE), *options], standalone_mode=False)
    assert "\n" not in str(refused.value)
