"""Modes of extruded stages: a turned sector against the whole, dense matrices, plane stress, masses
of rigid bodies.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from flexfem.fem.elements import Plate, mirrored
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import joined
from flexfem.fem.modes import modes, sector_modes, vibrating_structure
from flexfem.fem.structure import mass_of, structure
from flexfem.mechanism.layout import Payload
from flexfem.paper.bodies import carried_out_of_plane, drawn_inertia
from flexfem.paper.stage_mesh import layers_of, mesh_sectors, sheet_of

from ..tolerances import SOLVED, SUMS
from ..validation.vibration import third
from .conftest import bar

PLATE = Plate(youngs_modulus=68e3, poissons_ratio=0.29, thickness=3.7)
DENSITY = 2739e-12
FLAT = mirrored(3.7, 1, 0.8)
HALVES = {"in plane": FLAT, "out of plane": FLAT.antisymmetric}
CARRIED = np.diag([3e-5, 3e-5, 2e-3])
TILTED = np.diag([3e-5, 1.3e-3, 1.3e-3])
TWIST = 0.7  # rad, of the cuts: without it a sector is its own mirror image


@pytest.mark.parametrize(("half", "load"), [("in plane", CARRIED), ("out of plane", TILTED)])
def test_one_sector_turned_vibrates_as_the_whole(half, load):
    sector = third(3, 3, TWIST)
    one, whole = (
        sector_modes((sector,) * n, PLATE, HALVES[half], DENSITY, load, 8) for n in (1, 3)
    )
    np.testing.assert_allclose(one.frequencies, whole.frequencies, rtol=SOLVED)
    np.testing.assert_allclose(one.total, whole.total, atol=SUMS * one.total[2, 2])
    effective = [found.participation**2 / np.diag(found.total) for found in (one, whole)]
    np.testing.assert_allclose(*effective, atol=SOLVED)
    assert effective[0].max() > 0.2
    for k in range(8):
        same = one.field(k) * np.sign(np.sum(one.field(k) * whole.field(k)))
        size = np.abs(same).max()
        pair = np.min(np.abs(np.delete(whole.frequencies, k) / whole.frequencies[k] - 1)) < 1e-6
        assert pair or np.allclose(same, whole.field(k), atol=1e-5 * size)


@pytest.mark.parametrize(("half", "load"), [("in plane", CARRIED), ("out of plane", TILTED)])
def test_frequencies_and_effective_masses_are_those_of_dense_matrices(half, load):
    """All of them add up to the mass, and to the moments of inertia, of all that is free."""
    mesh = joined((third(3, 2, TWIST),) * 3)[0]
    mesh = mesh._replace(
        nodes=mesh.nodes + 0.03 * np.sin(mesh.nodes[:, ::-1])
    )  # no symmetry: no pairs
    found = modes(
        vibrating_structure(mass_of(structure(mesh, PLATE, HALVES[half]), DENSITY, load)), 5
    )
    equations = found.structure
    mass = mass_of(found.structure, DENSITY, load)
    lower = equations.lower().toarray()
    M = mass.loads(np.eye(equations.size))
    squares, shapes = scipy.linalg.eigh(lower + np.tril(lower, -1).T, M)
    np.testing.assert_allclose(found.frequencies, np.sqrt(squares[:5]), rtol=SOLVED)
    x, y, z = np.broadcast_arrays(*mesh.nodes.T[:, :, None], HALVES[half].heights)
    zero = np.zeros_like(x)
    one = np.ones_like(x)
    motions = {
        "in plane": [(one, zero, zero), (zero, one, zero), (-y, x, zero)],
        "out of plane": [(zero, zero, one), (zero, -z, y), (z, zero, -x)],
    }
    rigid = np.stack([np.stack(each, axis=-1) for each in motions[half]])
    base = equations.loads(mass.forces(rigid))
    base[-3:] += load
    np.testing.assert_allclose(
        np.abs(found.participation), np.abs(shapes[:, :5].T @ base), atol=SOLVED
    )
    moved = np.linalg.solve(M, base)
    np.testing.assert_allclose(
        np.sum((shapes.T @ base) ** 2, axis=0), np.sum(base * moved, axis=0), rtol=SOLVED
    )
    np.testing.assert_allclose(
        found.total, np.einsum("inmd,jnmd->ij", rigid, mass.forces(rigid)) + load, atol=1e-15
    )
    assert np.all(np.sum((shapes.T @ base) ** 2, axis=0) < np.diag(found.total))


def test_without_poissons_ratio_modes_in_the_plane_are_those_of_plane_stress_at_any_thickness():
    mesh = bar(31.0, 4.0, 6, 2)
    plate = Plate(68e3, 0.0, 9.7)
    both = (structure(mesh, plate, layers) for layers in (None, mirrored(9.7, 2, 0.8)))
    flat, found = (modes(vibrating_structure(mass_of(of, DENSITY, CARRIED)), 5) for of in both)
    np.testing.assert_allclose(found.frequencies, flat.frequencies, rtol=SOLVED)
    np.testing.assert_allclose(found.participation, flat.participation, atol=SOLVED)


HEAVY = Payload(0.5, 400.0, 300.0)  # 500 kg, 4e5 kg mm^2 and, tilting, 3e5


@pytest.fixture(scope="module")
def loaded(unlike):
    """A stage of three unlike chains, 9.7 mm thick, and its modes out of the plane with a payload
    on a coarse mesh.
    """
    stage = unlike.stage
    sectors = mesh_sectors(unlike.stage, 2)
    half = layers_of(stage, 1).antisymmetric
    load = carried_out_of_plane(stage, HEAVY)
    return stage, sector_modes(sectors, sheet_of(stage), half, 2739e-12, load, 3)


def test_the_mass_is_that_of_the_drawn_stage_and_tilts_with_its_thickness(loaded):
    """Moments of inertia of a prism about x and y add up to that about z and `m b^2 / 6`."""
    stage, found = loaded
    drawn = drawn_inertia(stage)
    total = found.total - np.diag([0.5, 300.0, 300.0])
    assert total[0, 0] == pytest.approx(drawn[0, 0], rel=3e-4)
    tilting = drawn[2, 2] + drawn[0, 0] * 9.7**2 / 6
    assert total[1, 1] + total[2, 2] == pytest.approx(tilting, rel=3e-4)
    assert drawn[0, 0] * 9.7**2 / 6 > 0.01 * tilting


def test_a_payload_far_heavier_than_the_stage_tilts_on_the_static_stiffness(loaded):
    """A 3 x 3 problem of what loads out of the plane do at rest."""
    stage, found = loaded
    equations = structure(found.mesh, sheet_of(stage), found.layers)
    C = factorise(equations.lower())(np.pad(np.eye(3), [(equations.size - 3, 0), (0, 0)]))[-3:]
    expected = np.sqrt(
        scipy.linalg.eigh(np.linalg.inv(C), np.diag([0.5, 300.0, 300.0]), eigvals_only=True)
    )
    np.testing.assert_allclose(found.frequencies, expected, rtol=5e-4)
