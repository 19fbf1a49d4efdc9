"""Plane stress against scikit-fem's own weak form."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from flexfem.fem.elements import QUADRATURE, Plate, von_mises
from flexfem.fem.mesh import PlaneMesh
from flexfem.fem.structure import NONE, structure

from .conftest import bar

PLATE = Plate(youngs_modulus=68.3e3, poissons_ratio=0.29, thickness=9.7)
ROUND_OFF = 1e-12  # of the largest entry: sums of a few dozen products


@pytest.fixture(scope="module")
def distorted():
    """Eighteen triangles with every node pushed somewhere else: sides bent, none straight."""
    regular = bar(4.0, 3.0, 3, 3)
    rng = np.random.default_rng(29)
    return regular._replace(nodes=regular.nodes + rng.uniform(-0.08, 0.08, regular.nodes.shape))


@pytest.fixture(scope="module", params=["stage", "distorted"])
def mesh(request, alike, distorted):
    found: PlaneMesh = alike.mesh if request.param == "stage" else distorted
    return found


def stiffness(mesh, degree=QUADRATURE):
    """Of all nodes, degrees of freedom x, y node by node."""
    lower = structure(mesh, PLATE, degree=degree, held=NONE).lower()
    return lower + sp.tril(lower, -1).T


@pytest.mark.parametrize("degree", [QUADRATURE, QUADRATURE + 2])
def test_stiffness_is_scikit_fems_weak_form(mesh, degree):
    from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, MeshTri2
    from skfem.helpers import ddot, eye, sym_grad, trace

    e, nu, b = PLATE
    lame = e * nu / (1 - nu**2)
    mu = e / (2 * (1 + nu))

    @BilinearForm
    def weak_form(u, v, w):
        strain = sym_grad(u)
        return b * ddot(lame * eye(trace(strain), 2) + 2 * mu * strain, sym_grad(v))

    theirs = MeshTri2(
        np.ascontiguousarray(mesh.nodes.T), np.ascontiguousarray(mesh.triangles[:, :3].T)
    )
    basis = Basis(theirs, ElementVector(ElementTriP2()), intorder=degree)
    expected = weak_form.assemble(basis)
    found = stiffness(mesh, degree)
    assert abs(found - expected).max() < ROUND_OFF * abs(expected).max()


@pytest.mark.parametrize(
    ("stress", "expected"),
    [
        ((7.0, 0.0, 0.0), 7.0),
        ((0.0, 0.0, 3.0), 3.0 * np.sqrt(3)),
        ((4.0, 4.0, 0.0), 4.0),
        ((5.0, -2.0, 1.5), None),
    ],
    ids=["tension", "shear", "equal both ways", "anything"],
)
def test_von_mises_stress(stress, expected):
    xx, yy, xy = stress
    one, two = np.linalg.eigvalsh([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, 0.0]])[[0, 2]]
    three = np.trace([[xx, xy], [xy, yy]]) - one - two
    by_principals = np.sqrt(((one - two) ** 2 + (two - three) ** 2 + (three - one) ** 2) / 2)
    found = float(von_mises(np.array([[xx, xy], [xy, yy]])))
    assert found == pytest.approx(by_principals, rel=ROUND_OFF)
    if expected is not None:
        assert found == pytest.approx(expected, rel=ROUND_OFF)
