"""Natural frequencies in plane finite elements: dense reference, masses, payloads and stacks."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

from flexfem.fem.elements import Plate, integration
from flexfem.fem.mesh import nodes_on, quadrature, shape_functions
from flexfem.fem.modes import _aligned, modes, vibrating_structure
from flexfem.fem.structure import NONE, mass_of, structure
from flexfem.paper.drives import drive_of
from flexfem.paper.fields import driven_response
from flexfem.paper.stage import load_stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.paper.vibration import payload_of, vibrating
from flexfem.refused import ComputationFailed

from ..tolerances import SOLVED
from ..validation.vibration import tapered
from .conftest import GEOMETRY

PLATE = Plate(youngs_modulus=68e3, poissons_ratio=0.29, thickness=3.7)
DENSITY = 2739e-12


@pytest.fixture(scope="module")
def membrane():
    mesh = tapered(2)
    return vibrating_structure(
        mass_of(structure(mesh, PLATE, held=nodes_on(mesh, "left")), DENSITY)
    )


def dense(mesh, held):
    """Stiffness and mass (m, m) of the unknowns that are not held."""
    of = structure(mesh, PLATE, held=NONE)
    K = of.lower().toarray()
    M = mass_of(of, DENSITY).loads(np.eye(of.size))
    K = K + np.tril(K, -1).T
    free = np.setdiff1d(np.arange(len(K)), np.concatenate([2 * held, 2 * held + 1]))
    return K[np.ix_(free, free)], M[np.ix_(free, free)]


def test_frequencies_are_those_of_dense_matrices(membrane):
    K, M = dense(membrane.structure.mesh, nodes_on(membrane.structure.mesh, "left"))
    expected = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[:7])
    np.testing.assert_allclose(modes(membrane, 7).frequencies, expected, rtol=SOLVED)


def test_consistent_mass_is_exact_on_curved_triangles(unlike):
    """Kinetic energy of a velocity that is linear in x and y, against a quadrature of far higher
    degree.
    """
    mesh = unlike.mesh
    field = (mesh.nodes @ np.array([[0.3, -0.7], [1.1, 0.2]]) + [2.0, 1.0])[None]
    energy = float(
        np.sum(field * mass_of(structure(mesh, Plate(1.0, 0.3, 1.0)), 1.0).forces(field))
    )
    N = shape_functions(quadrature(12)[0])[0]
    fine = 0.0
    for batch in integration(mesh, 12):
        fine += float(
            np.sum(
                batch.weights[:, None] * np.einsum("eid,iq->edq", field[0][batch.triangles], N) ** 2
            )
        )
    assert energy == pytest.approx(fine, rel=1e-12)


def test_stacks_add_their_stiffness():
    """Against all stacks' springs written into a dense 3 x 3 problem, by a payload far heavier than
    the stage.
    """
    stage = load_stage(GEOMETRY / "mobility6.toml")
    of = vibrating(stage, build_mesh(stage, 4), payload_of(500.0, 4e5), drive_of(stage))
    drive = drive_of(stage)
    C = driven_response(of.structure.mesh, plate_of(stage), drive.stacks).compliance
    springs = np.linalg.inv(np.diag(1 / drive.stiffness) + C[3:, 3:])
    K = np.linalg.inv(C[:3, :3] - C[:3, 3:] @ springs @ C[3:, :3])
    expected = np.sqrt(scipy.linalg.eigh(K, np.diag([0.5, 0.5, 400.0]), eigvals_only=True))
    np.testing.assert_allclose(modes(of, 3).frequencies, expected, rtol=5e-4)


def test_modes_of_one_frequency_are_turned_into_x_and_y():
    participation = np.array([[0.3, 0.8, 0.0], [0.8, -0.3, 0.0], [0.1, 0.2, 5.0]])
    Q = _aligned(np.array([4.0, 4.0 * (1 + 1e-9), 9.0]), participation)
    np.testing.assert_allclose(Q @ Q.T, np.eye(3), atol=1e-12)
    turned = Q.T @ participation
    assert abs(turned[1, 0]) < 1e-12 and abs(turned[0, 1]) < 1e-12
    assert abs(turned[0, 0]) == pytest.approx(math.hypot(0.3, 0.8))
    np.testing.assert_array_equal(turned[2], participation[2])


def test_more_modes_than_unknowns_are_refused(membrane):
    with pytest.raises(ComputationFailed, match="modes of"):
        modes(membrane, membrane.structure.size)
