"""Initial strains in plane finite elements: bodies that grow freely, a hot spot, and a stage on its warm frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.fem.heat import free_displacement, heat_response, thermal_forces, thermal_stress
from flexfem.fem.plane_stress import Plate, integration, internal_forces, slopes_of, stress_tensor
from flexfem.fem.problem import Support, mapped, nodes_on, solve
from flexfem.fem.response import plate_of, platform_response
from flexfem.fem.sectors import build_mesh

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
ALPHA = 17.3e-6  # 1/K
WARM = PLATE.youngs_modulus * ALPHA  # MPa per kelvin held
ROUND_OFF = 1e-12
NECKS = {(1, "base"): {"neck": 0.61}, (2, "elbow"): {"neck": 0.72}, (3, "platform"): {"radius": 1.9}}


@pytest.fixture(scope="module")
def unlike():
    stage = flexfem.load(Path(__file__).parents[2] / "geometry" / "mobility6.toml").replace(override=NECKS)
    return stage, build_mesh(stage, 3)


def ring(columns, rows, inner, outer):
    """A quarter of a ring, radii mm; `left` is the inner edge, `bottom` lies on X and `top` on Y."""

    def place(u, v):
        radius, angle = inner + (outer - inner) * u, v * np.pi / 2
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)

    return mapped(columns, rows, place)


def warmed(mesh, strains, supports):
    """Displacements (n, 2) by initial strains by batch (1, e, 2, 2, q), and the strains' own stresses by batch."""
    batches = integration(mesh)
    load = -thermal_forces(batches, PLATE, np.zeros((1, *mesh.nodes.shape)), strains)[0]
    field = solve(mesh, PLATE, load, supports).field
    slopes = [slopes_of(batch, field[None]) - strain for batch, strain in zip(batches, strains, strict=True)]
    return field, [stress_tensor(PLATE, each) for each in slopes]


def test_a_free_body_that_warms_evenly_has_no_stress():
    mesh = ring(5, 7, 2.0, 9.0)
    strains = [np.broadcast_to(ALPHA * np.eye(2)[..., None], (1, len(b.triangles), 2, 2, 3)) for b in integration(mesh)]
    corner = np.array([np.argmax(mesh.nodes[:, 0])])
    far = np.array([np.argmax(mesh.nodes[:, 1])])
    supports = [Support(corner, 0), Support(corner, 1), Support(far, 0, float(-9.0 * ALPHA))]
    field, stresses = warmed(mesh, strains, supports)
    assert max(np.max(np.abs(each)) for each in stresses) < ROUND_OFF * 1e2 * WARM
    assert field[far[0], 1] == pytest.approx(9.0 * ALPHA, rel=1e-10), "it grows"


def test_half_of_e_alpha_beside_a_hot_spot_in_an_infinite_plate():
    """Radius 4 mm warmer by 1 K: -E alpha/2 all over the spot; beside it hoop E alpha/2, radially -E alpha/2, as 1/r^2.

    A ring from 1 to 13 mm whose edges move as in the plate, `(1 + nu) alpha/2` times r inside and 16/r outside.
    """
    mesh = ring(48, 30, 1.0, 13.0)
    batches, spot = integration(mesh), 4.0
    centres = [mesh.nodes[batch.triangles[:, :3]].mean(axis=1) for batch in batches]
    hot = [np.hypot(*at.T) < spot for at in centres]
    strains = [ALPHA * (h[:, None, None, None] * np.eye(2)[..., None] * np.ones(3))[None] for h in hot]
    grown = 0.5 * 1.29 * ALPHA
    inner, outer = nodes_on(mesh, "left"), nodes_on(mesh, "right")
    supports = [Support(nodes_on(mesh, "bottom"), 1), Support(nodes_on(mesh, "top"), 0)]
    for nodes, rate in ((inner, grown), (outer, grown * spot**2 / 13.0**2)):
        supports += [Support(nodes, axis, rate * mesh.nodes[nodes, axis]) for axis in (0, 1)]
    _, stresses = warmed(mesh, strains, supports)
    for at, inside, stress in zip(centres, hot, stresses, strict=True):
        r = np.hypot(*at.T)
        n = at / r[:, None]
        mean = stress[0].mean(axis=-1) / WARM
        radial = np.einsum("ea,eab,eb->e", n, mean, n)
        hoop = np.trace(mean, axis1=1, axis2=2) - radial
        assert np.max(np.abs(radial[inside] + 0.5)) < 2e-3 and np.max(np.abs(hoop[inside] + 0.5)) < 2e-3
        outside = np.where(inside, np.nan, 0.5 * spot**2 / r**2)
        assert np.nanmax(np.abs(radial + outside)) < 3e-3 and np.nanmax(np.abs(hoop - outside)) < 3e-3
        assert np.max(hoop) == pytest.approx(0.5, abs=0.03), "right beside the spot"


def test_free_fields_are_without_shear_and_grow_with_the_temperature():
    points = np.array([[1.7, -2.3], [0.4, 3.1]])
    step = 1e-6
    slopes = np.stack(
        [(free_displacement(points + e) - free_displacement(points - e)) / (2 * step) for e in step * np.eye(2)],
        axis=-1,
    )
    for case, warm in enumerate((np.ones(2), points[:, 0], points[:, 1])):
        assert slopes[case, :, 0, 0] == pytest.approx(warm) and slopes[case, :, 1, 1] == pytest.approx(warm)
        assert slopes[case, :, 0, 1] + slopes[case, :, 1, 0] == pytest.approx(np.zeros(2), abs=1e-9)


def test_a_warm_stage_moves_as_reciprocity_says(unlike):
    """Betti: the pose is the work of the reactions to unit loads on what the frame moves beyond the metal."""
    stage, mesh = unlike
    metal, frame = 23.6e-6, 9.3e-6
    found, plate = heat_response(mesh, plate_of(stage), metal, frame), plate_of(stage)
    unit = platform_response(mesh, plate)
    forces = internal_forces(integration(mesh), plate, unit.fields)
    x, y = mesh.nodes[np.unique(mesh.edges["ground"])].T
    moved = (frame - metal) * np.array([[x, y], [(x**2 - y**2) / 2, x * y], [x * y, (y**2 - x**2) / 2]])
    work = np.einsum("jnd,kdn->jk", forces[:, np.unique(mesh.edges["ground"])], moved)
    assert found.pose == pytest.approx(-work, rel=1e-6, abs=1e-12)
    assert np.max(np.abs(found.reactions.sum(axis=1))) < 1e-7 * np.max(np.abs(found.reactions))
    hub, pose = np.unique(mesh.edges["hub"]), found.pose[:, 0]
    r = mesh.nodes[hub]
    rigid = pose[:2] + pose[2] * np.stack([-r[:, 1], r[:, 0]], axis=-1)
    assert found.fields[0, hub] - rigid == pytest.approx(metal * r, rel=1e-9, abs=1e-15), "the hub grows"


def test_a_stage_whose_frame_expands_alike_neither_moves_nor_is_stressed(unlike):
    stage, mesh = unlike
    same, other = (heat_response(mesh, plate_of(stage), 23.6e-6, frame) for frame in (23.6e-6, 0.0))
    assert np.max(np.abs(same.pose)) <= ROUND_OFF * np.max(np.abs(other.pose))
    assert np.max(np.abs(same.stress)) <= ROUND_OFF * np.max(np.abs(other.stress))
    assert same.fields[0] == pytest.approx(23.6e-6 * mesh.nodes, rel=1e-9)
    stress = thermal_stress(mesh, plate_of(stage), same.fields, 0 * same.fields)
    assert np.median(stress[0, :, 0]) == pytest.approx(71.7e3 * 23.6e-6 / 0.67, rel=1e-6), (
        "held instead: E alpha/(1 - nu)"
    )
