"""Wedges of 18 nodes: rigid modes, limits that are plane problems, and symmetry against the whole."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from flexfem.fem.elements import Plate, layered, mirrored, nodal_stress
from flexfem.fem.mesh import PlaneMesh, Sector, joined
from flexfem.fem.response import platform_response, unit_response
from flexfem.paper.fields import neck_stresses
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import mesh_sectors

from ..tolerances import SOLVED
from ..validation.consistency import curved_cells, unsupported

E = 68300.0
NU = 0.29
B = 9.7
FULL = 4  # degree of the quadrature in the plane, of both
LOADS = np.array([[1.3, -0.7, 5.0], [0.2, 1.1, 31.0], [0.0, 0.0, 40.0]])  # N, N, N mm


class Meshed(NamedTuple):
    stage: Stage
    sectors: tuple[Sector, ...]
    whole: PlaneMesh


def meshed(stage):
    sectors = mesh_sectors(stage, 2)
    return Meshed(stage, sectors, joined(sectors)[0])


@pytest.fixture(scope="module")
def generic_mesh(alike):
    return meshed(alike.stage)


@pytest.fixture(scope="module")
def unlike_mesh(unlike):
    return meshed(unlike.stage)


def test_the_stiffness_and_the_forces_are_of_the_same_energy():
    mesh = curved_cells()
    free, K = unsupported(mesh, layered(np.array([-0.4, 0.3, 1.1])))
    fields = np.random.default_rng(5).normal(size=(2, len(mesh.nodes), 5, 3))
    motion = free.loads(fields)
    np.testing.assert_allclose(free.loads(free.forces(fields)), K @ motion, atol=1e-12 * E)


@pytest.mark.parametrize("thickness", [0.3, 9.7, 80.0])
def test_without_poissons_ratio_every_thickness_is_plane_stress(generic_mesh, thickness):
    plate = Plate(E, 0.0, thickness)
    plane = platform_response(generic_mesh.whole, plate, FULL)
    found = unit_response(generic_mesh.sectors, plate, mirrored(thickness, 1, 0.47))
    np.testing.assert_allclose(
        found.compliance, plane.compliance, atol=SOLVED * plane.compliance[0, 0]
    )
    np.testing.assert_allclose(found.compliance[2, 2], plane.compliance[2, 2], rtol=SOLVED)


def test_between_two_held_faces_it_is_plane_strain(generic_mesh):
    strain = Plate(E / (1 - NU**2), NU / (1 - NU), B)
    plane = platform_response(generic_mesh.whole, strain, FULL).compliance
    held = unit_response(
        generic_mesh.sectors, Plate(E, NU, B), mirrored(B, 2, 0.47)._replace(held=(0, 4))
    )
    np.testing.assert_allclose(held.compliance, plane, atol=SOLVED * plane[0, 0])
    np.testing.assert_allclose(held.compliance[2, 2], plane[2, 2], rtol=SOLVED)
    assert np.max(np.abs(held.fields[..., 2])) < SOLVED * np.max(np.abs(held.fields[..., :2]))


def test_a_thin_sheet_is_plane_stress_but_for_the_mesh(generic_mesh):
    """What is left at 0.02 mm is that w is continuous from triangle to triangle while strains are
    not.
    """
    off = []
    plate = Plate(E, NU, 0.02)
    for sectors in (generic_mesh.sectors, mesh_sectors(generic_mesh.stage, 4)):
        plane = platform_response(joined(sectors)[0], plate, FULL).compliance
        found = unit_response(sectors, plate, mirrored(0.02, 1, 0.47)).compliance
        off.append(np.max(np.abs(np.diag(found) / np.diag(plane) - 1)))
    assert off[0] < 3e-4
    assert off[1] < 4e-5


def test_plane_stress_and_plane_strain_bound_it(generic_mesh):
    """Zettl, Szyszkowski and Zhang, J. Mech. Des. 127 (2005) 782: of hinges, up to about 12 %
    apart.
    """
    stress = Plate(E, NU, B)
    strain = Plate(E / (1 - NU**2), NU / (1 - NU), B)
    soft, hard = (
        platform_response(generic_mesh.whole, plate, FULL).compliance for plate in (stress, strain)
    )
    found = unit_response(generic_mesh.sectors, stress, mirrored(B, 2, 0.47)).compliance
    scale = np.diag(np.diag(soft) ** -0.5)
    for more, less in ((soft, found), (found, hard)):
        assert np.linalg.eigvalsh(scale @ (more - less) @ scale)[0] > 1e-3
    assert 1 - hard[0, 0] / soft[0, 0] == pytest.approx(NU**2, abs=2e-3)


def test_one_third_answers_as_the_whole_ring(generic_mesh):
    plate = Plate(E, NU, B)
    layers = mirrored(B, 1, 0.47)
    third = unit_response(generic_mesh.sectors, plate, layers)
    ring = unit_response(generic_mesh.sectors * 3, plate, layers)
    np.testing.assert_allclose(
        third.compliance, ring.compliance, atol=SOLVED * ring.compliance[0, 0]
    )
    np.testing.assert_allclose(third.compliance[2, 2], ring.compliance[2, 2], rtol=SOLVED)
    size = np.max(np.abs(ring.fields), axis=(1, 2, 3), keepdims=True)
    np.testing.assert_allclose(third.fields / size, ring.fields / size, atol=SOLVED)
    np.testing.assert_allclose(third.reactions, -np.eye(3), atol=1e-6)
    assert third.unknowns == ring.unknowns


@pytest.mark.parametrize("which", ["generic_mesh", "unlike_mesh"])
def test_neck_stresses_without_poissons_ratio_are_those_in_the_plane(which, request):
    stage, sectors, _ = request.getfixturevalue(which)
    stage = stage.model_copy(
        update={"material": stage.material.model_copy(update={"poissons_ratio": 0.0})}
    )
    plate = Plate(E, 0.0, B)
    found = neck_stresses(stage, unit_response(sectors, plate, mirrored(B, 1, 0.47)), LOADS)
    plane = neck_stresses(stage, unit_response(sectors, plate), LOADS)
    np.testing.assert_allclose(found.highest, plane.highest, rtol=2e-3)  # their quadratures differ


def test_neck_stresses_between_held_faces_are_those_of_plane_strain(generic_mesh):
    strain = Plate(E / (1 - NU**2), NU / (1 - NU), B)
    layers = mirrored(B, 1, 0.47)._replace(held=(0, 2))
    response = unit_response(generic_mesh.sectors, Plate(E, NU, B), layers)
    found = neck_stresses(generic_mesh.stage, response, LOADS)
    stage = generic_mesh.stage.model_copy(update={"model": "plane_strain"})
    plane = neck_stresses(stage, unit_response(generic_mesh.sectors, strain), LOADS)
    np.testing.assert_allclose(found.highest, plane.highest, rtol=2e-3)


def test_the_stress_of_a_field_that_is_quadratic_through_the_thickness():
    mesh = curved_cells()
    layers = layered(np.array([-0.4, 0.3, 1.1]))
    field = np.zeros((len(mesh.nodes), len(layers.heights), 3))
    field[..., 0] = 1e-3 * layers.heights
    field[..., 2] = 1e-3 * layers.heights**2
    stress = nodal_stress(mesh, Plate(100e3, 0.25, 1.0), field, layers=layers)
    for height, found in zip(
        layers.heights, stress.swapaxes(0, 1), strict=True
    ):  # lambda and mu are 40 GPa
        z = 80.0 * height
        wanted = np.array([[z, 0.0, 40.0], [0.0, z, 0.0], [40.0, 0.0, 3 * z]])
        np.testing.assert_allclose(found, np.broadcast_to(wanted, found.shape), atol=1e-9)


@pytest.mark.parametrize(("rises", "height"), [(True, 4.85), (False, 0.0)])
def test_the_highest_stress_of_a_neck_is_where_it_is(rises, height, generic_mesh):
    stage, sectors, _ = generic_mesh
    plate = Plate(E, NU, B)
    layers = mirrored(B, 1, 0.47)
    solved = unit_response(sectors, plate, layers, FULL)
    z = layers.heights
    field = np.zeros_like(solved.nodal)
    field[..., 2] = 1e-4 * (z**2 if rises else 2 * 4.85 * z - z**2)
    found = neck_stresses(stage, replace(solved, nodal=field), LOADS)
    np.testing.assert_allclose(found.height, height, atol=1e-12)
