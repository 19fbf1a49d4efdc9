"""Section V with joints commanded: rotations and strokes of the model, imposed on the metal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import lstsq

from flexfem.paper.case import LoadedCase
from flexfem.paper.contacts import hinge_couples
from flexfem.paper.designs import stage_frames
from flexfem.paper.equations import KINDS, freedoms_of
from flexfem.paper.fields import driven_response
from flexfem.paper.imposed import commanded_hinges, imposed
from flexfem.paper.model import analyse, hinge_compliance
from flexfem.paper.responses import driven_model
from flexfem.paper.stage import Stage, load_stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.paper.verification import run_case
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput

from ..conftest import ROOT, UNLIKE, with_changes
from ..tolerances import DENSE

GEOMETRY = ROOT / "geometry"
COARSE = 0.004  # percentage points: four triangles across a neck instead of eight
CHART = 0.02  # percentage points: bodies as beams right beside the notches
POSE = np.array([0.031, -0.017, 4.3e-4])


@pytest.fixture(scope="module")
def unlike() -> Stage:
    return with_changes({"override": UNLIKE})


def by_least_energy(
    stage: Stage, mobility: Any, rows: list[tuple[np.ndarray, float]], pose: np.ndarray | None
):
    """Rotations (9,) and pose (3,) of a stage with rigid links, by constrained minimum energy.

    Unknowns are the displacements of the joints and the pose; the chains meet at the pose, `rows`
    are conditions on the 9 rotations, and the pose is given or free. Each is weighted by the root
    of its spring; a free pose has none."""
    frames = stage_frames(stage)
    allowed = freedoms_of(mobility) if isinstance(mobility, int) else mobility
    table = np.stack(hinge_compliance(stage), axis=-1)
    joints = [
        (i, j, k) for i in range(3) for j in range(3) for k in range(3) if KINDS[k] in allowed[i][j]
    ]
    G = np.zeros((3, 3, len(joints)))
    for n, (i, j, k) in enumerate(joints):
        x, y = frames.centres[i, j]
        a = frames.axes[i, j]
        G[i, :, n] = [(y, -x, 1.0), (np.cos(a), np.sin(a), 0.0), (-np.sin(a), np.cos(a), 0.0)][k]
    root = np.sqrt([table[i, j, k] for i, j, k in joints])
    turning = np.array(
        [[(i, j, k) == (r // 3, r % 3, 0) for (i, j, k) in joints] for r in range(9)], dtype=float
    )
    if pose is None:  # chains 2 and 3 end where chain 1 does
        A = np.concatenate([G[1] - G[0], G[2] - G[0]])
        b = np.zeros(6)
    else:
        A = G.reshape(9, -1)
        b = np.tile(pose, 3)
    for row, value in rows:
        A = np.vstack([A, row @ turning])
        b = np.append(b, value)
    size = np.linalg.norm(A * root, axis=1)
    q = root * lstsq(A * root / size[:, None], b / size, cond=1e-13)[0]
    return turning @ q, G[0] @ q


@pytest.mark.parametrize("mobility", [3, 6])
def test_rotations_are_those_of_least_energy_and_metal_takes_them_by_least_energy(unlike, mobility):
    """A stage with unlike chains as rigid links and springs, its constrained energy minimised by
    another route.
    """
    positions = (0,) if mobility == 3 else (0, 1)
    wanted, _ = by_least_energy(unlike, mobility, [], POSE)
    given = imposed(unlike, analyse(unlike, mobility), "joints")
    numbers = [3 * chain + position for position in positions for chain in range(3)]
    np.testing.assert_allclose(given.per_command @ POSE, wanted[numbers], rtol=DENSE, atol=1e-12)
    rows = [(np.eye(9)[r], wanted[r]) for r in numbers]
    _, reached = by_least_energy(unlike, 21, rows, None)
    metal = driven_model(unlike, analyse(unlike, 21), given.drive.stacks).compliance
    np.testing.assert_allclose(given.poses(metal) @ POSE, reached, rtol=1e-6, atol=1e-11)
    assert np.max(np.abs(reached - POSE) / np.abs(POSE)) > 1e-5


@pytest.mark.parametrize("mobility", [None, 3, 12, 21])
def test_a_model_takes_the_pose_by_its_own_rotations(unlike, mobility):
    """With more freedoms than rotations too, with fewer, and with one chain of two axial freedoms
    and one of none.
    """
    stage = unlike
    if mobility is None:
        stage = unlike.replace(
            override={
                (1, "base"): {"prismatic": False},
                (2, "elbow"): {"prismatic": True},
                (3, "base"): {"radius": 3.1},
            }
        )
    found = analyse(stage, mobility)
    given = imposed(stage, found, "joints")
    positions = commanded_hinges(found.mobility)
    numbers = [3 * chain + position for position in positions for chain in range(3)]
    rows = [(np.eye(9)[r], turn) for r, turn in zip(numbers, given.per_command @ POSE, strict=True)]
    _, reached = by_least_energy(stage, found.freedoms, rows, None)
    np.testing.assert_allclose(reached, POSE, rtol=1e-6)


def test_both_witnesses_read_and_impose_rotations_alike_with_unlike_chains(unlike):
    positions = (0, 1)
    couples = tuple(hinge_couples(unlike, positions).values())
    metal = driven_response(build_mesh(unlike, 6), plate_of(unlike), couples).compliance
    model = driven_model(unlike, analyse(unlike, 21, "calibrated", links=True), couples).compliance
    size = np.sqrt(np.diag(metal))
    assert np.max(np.abs(model - metal) / np.outer(size, size)) < 1e-3
    given = imposed(unlike, analyse(unlike, 6), "joints")
    of_model, of_metal = (error_matrix(np.eye(3), given.poses(C), 25.0) for C in (model, metal))
    assert np.max(np.abs(of_model - of_metal)) < CHART and np.max(np.abs(of_metal)) > 10 * CHART


# --- the reference stages
# -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """Cases by drive and direction, on coarse meshes."""
    folder = tmp_path_factory.mktemp("cases")
    found = {}
    for drive, name in (
        ("joints", "joints-x"),
        ("joints", "joints-theta"),
        ("strokes", "joints-x"),
    ):
        text = (
            (GEOMETRY.parent / f"cases/{name}.toml")
            .read_text()
            .replace("../geometry", str(GEOMETRY))
        )
        path = folder / f"{drive}-{name.removeprefix('joints-')}.toml"
        path.write_text(
            text.replace('"joints"', f'"{drive}"').replace(
                "points = 21", "points = 3\nresolution = 4"
            )
        )
        found[path.stem] = run_case(LoadedCase(path))
    return found


# resolution 8; with rotations of stations of no length -1.109, -0.939, -0.256 and -0.587 along
PERCENT = {
    ("joints-x", "mobility three"): (-1.049, -0.059, 0.0),
    ("joints-x", "mobility six"): (-0.238, 0.037, 0.0),
    ("joints-theta", "mobility three"): (0.0, 0.0, -0.885),
    ("joints-theta", "mobility six"): (0.0, 0.0, -0.566),
    ("strokes-x", "mobility three"): (-0.196, 0.029, 0.0),
    ("strokes-x", "mobility six"): (-0.245, 0.178, 0.0),
}


@pytest.mark.parametrize(("case", "label"), PERCENT, ids=str)
def test_errors_of_the_reference_stages_with_joints_commanded(shipped, case, label):
    found = shipped[case].at("percent", curve=label)
    band = shipped[case].band("percent", curve=label)
    np.testing.assert_allclose(found, PERCENT[case, label], atol=COARSE)
    assert np.all(np.abs(found - PERCENT[case, label]) < band + 0.0006)  # rounded


def test_a_result_has_what_was_imposed(shipped):
    result = shipped["joints-x"]
    assert result.drive == "joints" and "force" not in result.values
    assert result.axes["joint"][:3] == ("base, chain 1", "base, chain 2", "base, chain 3")
    given = result.at("rotation", curve="mobility three")
    np.testing.assert_allclose(
        given[2, :3], [0.0, 1.4434e-3, -1.4434e-3], atol=1e-7
    )  # 0.05 / (2 * 30 sin 60)
    np.testing.assert_allclose(given[0], -given[2], atol=1e-18)
    assert np.all(np.isnan(given[:, 3:])) and not np.any(
        np.isnan(result.at("rotation", curve="mobility six"))
    )
    fields = result.fields["mobility six"]
    hub = np.hypot(*fields.nodes.T) < 8.0 + 1e-9
    moved = fields.displacement[hub].mean(axis=0)
    np.testing.assert_allclose(moved, [0.05 * (1 - 0.00238), 0.05 * 0.00037], atol=3e-6)


def test_strokes_are_of_the_drive_and_beyond_their_limits_it_is_said(shipped):
    result = shipped["strokes-x"]
    stage = load_stage(GEOMETRY / "mobility6.toml")
    assert result.models["mobility six"].hash == stage.drive_hash != stage.hash
    assert result.axes["joint"][1] == "elbow, chain 1"
    assert any(key.startswith("actuator") for key in result.assumed)
    strokes = 1e3 * result.at("stroke", curve="mobility six")[2]
    np.testing.assert_allclose(strokes, [0, 15.62, -14.61, 6.62, 14.61, -22.24], atol=0.01)
    limits = [text for text in result.warnings if "outside -8.7 to 8.7 um" in text]
    assert limits and all(text.startswith("curve 'mobility") for text in limits)
    assert not any("outside -8.7" in text for text in shipped["joints-x"].warnings)


def test_cases_that_cannot_be_driven_so_are_refused_in_one_line(project):
    path = project.edit(
        "cases/joints-x.toml", ('drive = "joints"', 'drive = "joints"\nanalysis = "nonlinear"')
    )
    with pytest.raises(
        BadInput,
        match=r'^\S*joints-x.toml, line 8: drive = "joints", expected "force" with analysis',
    ):
        LoadedCase(path)
    path = project.edit("cases/joints-theta.toml", ('drive = "joints"', 'drive = "strokes"'))
    stage = project.path("geometry/mobility6.toml")
    load_stage(stage).replace(actuator=[]).save(stage)
    with pytest.raises(
        BadInput, match=r"joints-theta.toml, line 8: drive = .strokes.*mobility6.toml has no"
    ):
        LoadedCase(path)
