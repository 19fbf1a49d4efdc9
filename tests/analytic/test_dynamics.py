"""Natural frequencies of the pseudo-rigid model against (16) and a mass matrix of its joints."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from flexfem.mechanism.layout import Payload
from flexfem.mechanism.outlines import inertia_of
from flexfem.paper.bodies import body_moments, drawn_inertia, mass_per_area
from flexfem.paper.equations import first_order, resting, stiffness
from flexfem.paper.model import analyse, assemble
from flexfem.paper.responses import dynamics
from flexfem.paper.vibration import payload_of

from ..conftest import UNLIKE, with_changes
from ..tolerances import DENSE

PAYLOAD = Payload(4e-5, 0.021)


@pytest.mark.parametrize(
    ("mobility", "formula"),
    [(3, "koster"), (6, "paros-weisbord"), (12, "wu-zhou"), (21, "calibrated")],
)
def test_frequencies_are_those_of_the_independent_joints(mobility, formula):
    """K_aa of (16) and the kinetic energy of every body by the Jacobian of its own joints."""
    stage = with_changes({"override": UNLIKE})
    found = dynamics(stage, analyse(stage, mobility, formula), PAYLOAD)
    of = assemble(stage, mobility, formula)
    at = stiffness(of)
    G = at.influence.G_a
    joints = of.joints
    columns = first_order(joints, resting(of.frames, joints))
    M = at.influence.G_u.T @ found.mass[:3, :3] @ at.influence.G_u
    for k, (chain, link) in enumerate((chain, link) for chain in range(3) for link in (1, 2)):
        mine = joints.chains[chain]
        J = (columns[chain] * (joints.hinge[mine] < link)) @ G[mine]
        M += J.T @ found.mass[3 + 3 * k : 6 + 3 * k, 3 + 3 * k : 6 + 3 * k] @ J
    expected = np.sqrt(scipy.linalg.eigh(at.K_aa, M, eigvals_only=True))
    np.testing.assert_allclose(found.frequencies[:mobility], expected, rtol=1e-6)
    assert np.isinf(found.frequencies[mobility:]).all()


def test_bodies_that_move_have_the_drawn_mass_less_the_pads_and_the_payload_once():
    stage = with_changes({"override": UNLIKE})
    found = dynamics(stage, analyse(stage), PAYLOAD)
    pads = inertia_of(body_moments(stage)[:, 0].sum(axis=0), mass_per_area(stage))
    together = found.mass.reshape(7, 3, 7, 3).sum(axis=(0, 2)) + pads
    expected = drawn_inertia(stage) + np.diag([4e-5, 4e-5, 0.021])
    np.testing.assert_allclose(together, expected, rtol=DENSE, atol=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_a_freedom_that_hinges_do_not_have_has_no_frequency_of_round_off(seed):
    """Of mobility three also where round-off leaves 1e-12 of the softest eigenvalue, and with 1000
    tonnes on it.
    """
    rng = np.random.default_rng(seed)
    stage = with_changes(
        {
            "hinges.elbow.neck_mm": float(rng.uniform(0.1, 0.6)),
            "thickness_mm": float(rng.uniform(4, 20)),
        }
    )
    of = dynamics(stage, analyse(stage, 3), payload_of(1e6, 1e9))
    noisy = of._replace(compliance=of.compliance + 1e-11 * np.max(of.compliance) * np.eye(21))
    assert np.isfinite(of.frequencies[:3]).all() and np.isinf(noisy.frequencies[3:]).all()
    full = dynamics(stage, analyse(stage, 21, "calibrated"), payload_of(1e6, 1e9)).frequencies
    assert np.isfinite(full).all()


@pytest.mark.parametrize("links", [False, True])
def test_a_heavy_payload_vibrates_on_the_static_stiffness(links):
    """Also in rotation, where only its moment of inertia counts."""
    stage = with_changes({"override": UNLIKE})
    model = analyse(stage, 21, "calibrated", links)
    found = dynamics(stage, model, payload_of(500.0, 4e5)).frequencies[:3]
    expected = np.sqrt(
        scipy.linalg.eigh(model.stiffness, np.diag([0.5, 0.5, 400.0]), eigvals_only=True)
    )
    np.testing.assert_allclose(found, expected, rtol=5e-4)
