"""Plane stress against scikit-fem's own weak form, against linear fields it must hold exactly, and against tension."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.fem.elements import (
    QUADRATURE,
    Plate,
    integration,
    internal_forces,
    nodal_stress,
    skfem_mesh,
    stiffness_matrix,
    stress_tensor,
    von_mises,
)
from flexfem.fem.mesh import StageMesh, jacobians

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
ROUND_OFF = 1e-12  # of the largest entry: sums of a few dozen products
PATCH = 1e-10  # of the applied stress: round-off times the ratio of the largest triangle to the smallest
SLOPES = np.array([[1.3e-3, -0.4e-3], [2.1e-3, 0.7e-3]])  # d_b u_a, generic: stretch, shear and rotation


@pytest.fixture(scope="module")
def distorted(bar: Callable[..., StageMesh]) -> StageMesh:
    """Eighteen triangles with every node pushed somewhere else: sides bent, none straight."""
    regular = bar(4.0, 3.0, 3, 3)
    rng = np.random.default_rng(29)
    return regular._replace(nodes=regular.nodes + rng.uniform(-0.08, 0.08, regular.nodes.shape))


@pytest.fixture(scope="module", params=["stage", "distorted"])
def mesh(request: pytest.FixtureRequest, alike, distorted: StageMesh) -> StageMesh:
    found: StageMesh = alike.mesh if request.param == "stage" else distorted
    return found


def linear_field(mesh: StageMesh) -> Array:
    return mesh.nodes @ SLOPES.T + [0.011, -0.023]


def expected_stress() -> Array:
    """Hooke's law of a thin plate, written with the compliances: xx, yy, xy, MPa."""
    e, nu = PLATE.youngs_modulus, PLATE.poissons_ratio
    hooke = np.array([[1 / e, -nu / e, 0.0], [-nu / e, 1 / e, 0.0], [0.0, 0.0, 2 * (1 + nu) / e]])
    return np.linalg.solve(hooke, [SLOPES[0, 0], SLOPES[1, 1], SLOPES[0, 1] + SLOPES[1, 0]])


def inner_nodes(mesh: StageMesh) -> np.ndarray:
    """Nodes on no outer side."""
    t = mesh.triangles
    sides = np.concatenate([t[:, [0, 1, 3]], t[:, [1, 2, 4]], t[:, [2, 0, 5]]])
    _, which, sharing = np.unique(sides[:, 2], return_index=True, return_counts=True)
    return np.setdiff1d(np.arange(len(mesh.nodes)), sides[which[sharing == 1]])


@pytest.mark.parametrize("degree", [QUADRATURE, QUADRATURE + 2])
def test_stiffness_is_scikit_fems_weak_form(mesh: StageMesh, degree: int) -> None:
    from skfem import Basis, BilinearForm, ElementTriP2, ElementVector
    from skfem.helpers import ddot, eye, sym_grad, trace

    e, nu, b = PLATE
    lame, mu = e * nu / (1 - nu**2), e / (2 * (1 + nu))

    @BilinearForm
    def weak_form(u, v, w):
        strain = sym_grad(u)
        return b * ddot(lame * eye(trace(strain), 2) + 2 * mu * strain, sym_grad(v))

    basis = Basis(skfem_mesh(mesh), ElementVector(ElementTriP2()), intorder=degree)
    expected = weak_form.assemble(basis)
    found = stiffness_matrix(integration(mesh, degree), PLATE, len(mesh.nodes))
    assert abs(found - expected).max() < ROUND_OFF * abs(expected).max()


def test_internal_forces_are_the_stiffness_times_displacements(mesh: StageMesh) -> None:
    rng = np.random.default_rng(29)
    fields = rng.normal(size=(2, len(mesh.nodes), 2))
    K = stiffness_matrix(integration(mesh), PLATE, len(mesh.nodes))
    found = internal_forces(integration(mesh), PLATE, fields)
    for force, field in zip(found, fields, strict=True):
        expected = (K @ field.ravel()).reshape(-1, 2)
        assert np.abs(force - expected).max() < ROUND_OFF * np.abs(expected).max() * 10  # stiffest against softest row


@pytest.mark.parametrize("motion", ["x", "y", "rotation"])
def test_rigid_motions_need_no_force_and_cause_no_stress(mesh: StageMesh, motion: str) -> None:
    x, y = mesh.nodes.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    field = {"x": np.stack([one, zero], -1), "y": np.stack([zero, one], -1), "rotation": np.stack([-y, x], -1)}[motion]
    batches = integration(mesh)
    K = stiffness_matrix(batches, PLATE, len(mesh.nodes))
    scale = abs(K).max() * np.abs(field).max()
    assert np.abs(internal_forces(batches, PLATE, field[None])).max() < PATCH * scale
    assert np.abs(K @ field.ravel()).max() < PATCH * scale
    size = np.sqrt(jacobians(mesh)[:, -1].min())
    slope = np.abs(field).max() / size  # what a motion of one side of the smallest triangle alone would be
    assert np.abs(nodal_stress(mesh, PLATE, field)).max() < PATCH * PLATE.youngs_modulus * slope


def test_patch_of_constant_stress(mesh: StageMesh) -> None:
    """A linear displacement is held exactly by curved triangles too: one stress everywhere, no force inside."""
    field, expected = linear_field(mesh), expected_stress()
    found = nodal_stress(mesh, PLATE, field)
    np.testing.assert_allclose(found, np.tile(expected, (len(mesh.nodes), 1)), rtol=0, atol=PATCH * abs(expected).max())
    force = internal_forces(integration(mesh), PLATE, field[None])[0]
    inner = inner_nodes(mesh)
    assert len(inner) > 0
    assert np.abs(force[inner]).max() < PATCH * np.abs(force).max()


def test_uniaxial_tension_recovers_youngs_modulus_and_no_side_stress() -> None:
    """In plane strain, or with the constants swapped, the free side would not be free."""
    stretch, nu = 0.8e-3, PLATE.poissons_ratio
    slopes = np.array([[stretch, 0.0], [0.0, -nu * stretch]])[..., None]
    stress = stress_tensor(PLATE, slopes)[..., 0]
    assert stress[0, 0] == pytest.approx(PLATE.youngs_modulus * stretch, rel=ROUND_OFF)
    assert abs(stress[1, 1]) < ROUND_OFF * stress[0, 0] and stress[0, 1] == 0.0


def test_simple_shear_recovers_the_shear_modulus_and_rotation_costs_nothing() -> None:
    shear = PLATE.youngs_modulus / (2 * (1 + PLATE.poissons_ratio))
    slopes = np.array([[[0.0, 1e-3], [0.0, 0.0]], [[0.0, 1e-3], [-1e-3, 0.0]]]).transpose(1, 2, 0)
    stress = stress_tensor(PLATE, slopes)
    assert stress[0, 1, 0] == pytest.approx(1e-3 * shear, rel=ROUND_OFF)
    assert stress[1, 0, 0] == stress[0, 1, 0]
    np.testing.assert_array_equal(stress[..., 1], 0.0)


@pytest.mark.parametrize(
    ("stress", "expected"),
    [((7.0, 0.0, 0.0), 7.0), ((0.0, 0.0, 3.0), 3.0 * np.sqrt(3)), ((4.0, 4.0, 0.0), 4.0), ((5.0, -2.0, 1.5), None)],
    ids=["tension", "shear", "equal both ways", "anything"],
)
def test_von_mises_stress(stress: tuple[float, float, float], expected: float | None) -> None:
    xx, yy, xy = stress
    one, two = np.linalg.eigvalsh([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, 0.0]])[[0, 2]]
    three = np.trace([[xx, xy], [xy, yy]]) - one - two
    by_principals = np.sqrt(((one - two) ** 2 + (two - three) ** 2 + (three - one) ** 2) / 2)
    found = float(von_mises(np.array(stress)))
    assert found == pytest.approx(by_principals, rel=ROUND_OFF)
    if expected is not None:
        assert found == pytest.approx(expected, rel=ROUND_OFF)


def test_gradients_and_weights_are_scikit_fems(distorted: StageMesh) -> None:
    """By its own mapping, at points of another degree too."""
    from skfem import ElementTriP2
    from skfem.quadrature import get_quadrature

    for degree in (QUADRATURE, 4):
        points, rule = get_quadrature(ElementTriP2().refdom, degree)
        mapping = skfem_mesh(distorted).mapping()
        slopes = [ElementTriP2().lbasis(points, node)[1] for node in range(6)]
        gradients = np.einsum("ijeq,niq->enjq", mapping.invDF(points), slopes)
        weights = np.abs(mapping.detDF(points)) * rule
        ours = integration(distorted, degree)
        for name, theirs in (("gradients", gradients), ("weights", weights)):
            found = np.concatenate([getattr(batch, name) for batch in ours])
            np.testing.assert_allclose(found, theirs, rtol=0, atol=1e-13 * np.abs(theirs).max())
