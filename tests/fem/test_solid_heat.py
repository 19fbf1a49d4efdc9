"""Wedges that warm: free bodies, a free strip that bows, sheets, a turned sector against the whole,
reciprocity.
"""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.fem.elements import Plate, mirrored, nodal_stress
from flexfem.fem.mesh import joined
from flexfem.fem.response import (
    factorised_sectors,
    factorised_whole,
    free_displacement,
    heat_response,
    unit_response,
)
from flexfem.fem.structure import structure

from ..tolerances import SOLVED
from ..validation.fields import on_chords
from ..validation.vibration import third
from .conftest import bar

E = 68e3
NU = 0.29
B = 3.7
PLATE = Plate(E, NU, B)
FLAT = mirrored(B, 2, 0.8)
TWIST = 0.7  # rad, of the cuts: without it a sector is its own mirror image


def test_free_metal_has_no_stress_however_its_temperature_changes():
    """Of E alpha per kelvin, and per K/mm times the size: with the free strain taken from the
    temperature itself.
    """
    mesh = bar(8.3, 5.1, 3, 2)
    mesh = mesh._replace(nodes=mesh.nodes @ np.array([[0.8, 0.6], [-0.6, 0.8]]) + [3.1, -2.3])
    held = E / (1 - 2 * NU)
    x, y, z = np.broadcast_arrays(*mesh.nodes.T[:, :, None], FLAT.heights)
    seen = 0
    for layers, warm in ((FLAT, (x, y, np.ones_like(x))), (FLAT.antisymmetric, (0 * x, 0 * x, z))):
        for field, temperature in zip(free_displacement(mesh.nodes, layers), warm, strict=True):
            stress = nodal_stress(mesh, PLATE, field, layers=layers)
            elastic = stress - held * temperature[..., None, None] * np.eye(3)
            assert np.max(np.abs(elastic)) < 1e-12 * held * max(1.0, np.max(np.abs(temperature)))
            seen += np.any(temperature)
            if layers.fixed:
                assert np.all(field[:, 0, :2] == 0.0), "u = v = 0 on the mid-plane"
            else:
                assert np.all(field[:, 0, 2] == 0.0), "w = 0 on the mid-plane"
    assert seen == 4


def test_a_free_strip_bows_by_its_expansion_through_the_thickness_and_along_y():
    """Clamped on a frame that bows, it turns by the curvature times its length: 40 mm, per unit of
    expansion and K/mm.

    Straight it is over the platform, its end; the frame is 40^2 / 2 mm below there, per K/mm
    through the thickness."""
    plate = Plate(E, 0.0, 2.1)
    layers = mirrored(2.1, 1, 0.5)
    mesh = bar(40.0, 3.0, 6, 2)
    z, tilt_x, tilt_y = (
        factorised_whole(structure(mesh, plate, layers.antisymmetric))
        .thermal_response()
        .motions[:, 2]
    )
    assert tilt_y == pytest.approx(-40.0, rel=SOLVED)
    assert tilt_x == pytest.approx(0.0, abs=0.1), (
        "but for the diagonals of the mesh in the warped face"
    )
    assert z == pytest.approx(800.0, rel=2e-3), (
        "but for the warp of the clamped face, of its size squared"
    )
    along_x, along_y, even = (
        factorised_whole(structure(mesh, plate, layers)).thermal_response().motions.T
    )
    assert even[[0, 2]] == pytest.approx([-40.0, 0.0], rel=SOLVED, abs=1e-7)
    assert along_x[0] == pytest.approx(800.0, rel=2e-3)
    assert along_y[1:] == pytest.approx([800.0, 40.0], rel=2e-3)


@pytest.mark.parametrize("thickness", [0.4, 9.7])
def test_without_poissons_ratio_it_drifts_as_in_the_plane(thickness):
    """By reciprocity with loads even through the thickness, u is read as its mean: -b^2 / 24 along
    a gradient.
    """
    sector = third(3, 2, TWIST)
    mesh = joined((sector,) * 3)[0]
    mesh = on_chords(mesh._replace(nodes=mesh.nodes + 0.9 * np.sin(0.1 * mesh.nodes[:, ::-1])))
    plate = Plate(E, 0.0, thickness)
    plane = heat_response(mesh, plate, 17.3e-6, 9.1e-6).motions[:, [1, 2, 0]]
    mean = np.diag([1.0, 1.0, 0.0]) * -(thickness**2) / 24
    found = (
        factorised_whole(structure(mesh, plate, mirrored(thickness, 1, 0.3)))
        .thermal_response()
        .motions
    )
    np.testing.assert_allclose(-8.2e-6 * (found - mean), plane, atol=SOLVED * np.max(np.abs(plane)))


@pytest.mark.parametrize("antisymmetric", [False, True])
def test_one_third_warms_as_the_whole(antisymmetric):
    sector = third(3, 3, TWIST)
    layers = mirrored(B, 1, 0.8)
    half = layers.antisymmetric if antisymmetric else layers
    one, whole = (factorised_sectors((sector,) * n, PLATE, half).thermal_response() for n in (1, 3))
    used = [2] if antisymmetric else [0, 1, 2]
    np.testing.assert_allclose(
        one.motions, whole.motions, atol=SOLVED * np.max(np.abs(whole.motions))
    )
    np.testing.assert_allclose(np.diag(one.energy)[used], np.diag(whole.energy)[used], rtol=SOLVED)
    np.testing.assert_allclose(one.fields, whole.fields, atol=SOLVED * np.max(np.abs(whole.fields)))
    assert one.unknowns == whole.unknowns and np.max(np.abs(one.motions)) > 1e-3


def test_the_pose_is_the_work_of_the_reactions_to_unit_loads():
    """Betti, by the solution under loads: on what the frame does beyond the metal, written out
    here.
    """
    sector = third(3, 2, TWIST)
    layers = mirrored(B, 1, 0.8)
    unit = unit_response((sector,) * 3, PLATE, layers)
    found = factorised_sectors((sector,) * 3, PLATE, layers).thermal_response()
    mesh = unit.mesh
    forces = structure(mesh, PLATE, layers).forces(unit.fields)
    ground = np.unique(mesh.edges["ground"])
    x, y, z = np.broadcast_arrays(*mesh.nodes[ground].T[:, :, None], layers.heights)
    moved = [
        [(x**2 - y**2 - z**2) / 2, x * y, x * z],
        [x * y, (y**2 - x**2 - z**2) / 2, y * z],
        [x, y, z],
    ]
    work = np.einsum("jnmd,kdnm->jk", forces[:, ground], np.array(moved))
    np.testing.assert_allclose(found.motions, -work, atol=SOLVED * np.max(np.abs(work)))
    held = structure(found.mesh, PLATE, layers).forces(found.fields)
    np.testing.assert_allclose(
        np.diag(found.energy), np.einsum("knmd,knmd->k", found.fields, held), rtol=SOLVED
    )
