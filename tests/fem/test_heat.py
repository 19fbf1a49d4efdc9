"""Initial strains in plane finite elements: bodies that grow freely, a hot spot, and a stage on its
warm frame.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.fem.elements import nodal_stress
from flexfem.fem.response import free_displacement, heat_response, platform_response
from flexfem.fem.structure import NONE, structure
from flexfem.paper.stage_mesh import build_mesh, plate_of

from ..tolerances import SOLVED

NECKS = {
    (1, "base"): {"neck": 0.61},
    (2, "elbow"): {"neck": 0.72},
    (3, "platform"): {"radius": 1.9},
}


@pytest.fixture(scope="module")
def unlike():
    stage = flexfem.load(Path(__file__).parents[2] / "geometry" / "mobility6.toml").replace(
        override=NECKS
    )
    return stage, build_mesh(stage, 3)


def test_free_fields_are_without_shear_and_grow_with_the_temperature():
    points = np.array([[1.7, -2.3], [0.4, 3.1]])
    step = 1e-6
    slopes = np.stack(
        [
            (free_displacement(points + e) - free_displacement(points - e)) / (2 * step)
            for e in step * np.eye(2)
        ],
        axis=-1,
    )
    for case, warm in enumerate((points[:, 0], points[:, 1], np.ones(2))):
        assert slopes[case, :, 0, 0] == pytest.approx(warm) and slopes[
            case, :, 1, 1
        ] == pytest.approx(warm)
        assert slopes[case, :, 0, 1] + slopes[case, :, 1, 0] == pytest.approx(np.zeros(2), abs=1e-9)


def test_a_warm_stage_moves_as_reciprocity_says(unlike):
    """Betti: the pose is the work of the reactions to unit loads on what the frame moves beyond the
    metal.
    """
    stage, mesh = unlike
    metal = 23.6e-6
    frame = 9.3e-6
    found = heat_response(mesh, plate_of(stage), metal, frame)
    plate = plate_of(stage)
    unit = platform_response(mesh, plate)
    forces = structure(mesh, plate, held=NONE).forces(unit.fields)
    x, y = mesh.nodes[np.unique(mesh.edges["ground"])].T
    moved = (frame - metal) * np.array(
        [[x, y], [(x**2 - y**2) / 2, x * y], [x * y, (y**2 - x**2) / 2]]
    )
    work = np.einsum("jnd,kdn->jk", forces[:, np.unique(mesh.edges["ground"])], moved)
    assert found.motions == pytest.approx(-work, rel=10 * SOLVED, abs=1e-12)
    assert np.max(np.abs(found.reactions)) < SOLVED * np.max(np.abs(found.pads))
    hub = np.unique(mesh.edges["hub"])
    pose = found.motions[:, 0]
    r = mesh.nodes[hub]
    rigid = pose[:2] + pose[2] * np.stack([-r[:, 1], r[:, 0]], axis=-1)
    assert found.nodal[0, hub] == pytest.approx(rigid, rel=SOLVED, abs=1e-15), (
        "relative to free metal the hub is rigid"
    )


def test_a_stage_whose_frame_expands_alike_neither_moves_nor_is_stressed(unlike):
    stage, mesh = unlike
    same, other = (heat_response(mesh, plate_of(stage), 23.6e-6, frame) for frame in (23.6e-6, 0.0))
    assert np.max(np.abs(same.motions)) <= SOLVED * np.max(np.abs(other.motions))
    assert np.max(np.abs(same.nodal)) <= SOLVED * np.max(np.abs(other.nodal))
    stress = nodal_stress(mesh, plate_of(stage), 23.6e-6 * free_displacement(mesh.nodes)[2])
    assert np.median(stress[:, 0, 0]) == pytest.approx(71.7e3 * 23.6e-6 / 0.67, rel=1e-6), (
        "held instead: E alpha/(1 - nu)"
    )


def test_a_frame_that_expands_nearly_alike_moves_the_stage_by_the_difference(unlike):
    """Linear in the difference to the last digits, and solved at all."""
    stage, mesh = unlike
    near, far = (
        heat_response(mesh, plate_of(stage), 23.6e-6, 23.6e-6 + part)
        for part in (2.0**-36, 2.0**-16)
    )
    assert 2.0**20 * near.motions == pytest.approx(
        far.motions, rel=1e-4, abs=1e-6 * np.max(np.abs(far.motions))
    )
    assert 2.0**20 * near.nodal == pytest.approx(
        far.nodal, rel=1e-4, abs=1e-6 * np.max(np.abs(far.nodal))
    )
