"""Reduced dynamics of a driven stage: at rest, at resonance, in first order, and by Craig and
Bampton.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.io import loadmat

import flexfem
from flexfem.fem.modes import modes
from flexfem.paper.drives import drive_of
from flexfem.paper.fields import driven_response
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.paper.vibration import payload_of, vibrating
from flexfem.questions.driven import DriveSystem
from flexfem.refused import BadInput

from ..tolerances import SOLVED


@pytest.fixture(scope="module")
def vibration(stage):
    asked = {
        "count": 6,
        "payload": (0.05, 10.0),
        "drives": "engaged",
        "damping": 2.0,
        "models": "elements",
    }
    return flexfem.modes(stage, **asked, resolution=4).fields


@pytest.fixture(scope="module")
def model(stage, vibration):
    return vibration.reduced


def test_at_rest_it_is_the_static_stage_under_loads_and_strokes(stage, vibration, model):
    C = driven_response(vibration.mesh, plate_of(stage), drive_of(stage).stacks).compliance
    of = DriveSystem.of(C, drive_of(stage))
    expected = np.hstack([of.engaged, of.poses])
    found = model.response(np.zeros(1))[0].real
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / scale, expected / scale, atol=SOLVED)
    assert model.inputs.names[:4] == ("load x", "load y", "load theta", "stroke base, chain 1")
    assert model.inputs.units == ("N", "N", "N mm", *["mm"] * 6) and model.outputs.units == (
        "mm",
        "mm",
        "rad",
    )


def test_at_resonance_it_is_one_over_twice_the_damping(model):
    """2 %: twenty-five times the share that the mode has at rest."""
    k = 2  # theta, alone at its frequency
    at = model.response(model.frequencies[[k]])[0, 2, 2]
    share = model.read[2, k] * model.drive[k, 2] / model.frequencies[k] ** 2
    assert abs(at.imag) == pytest.approx(25 * share, rel=1e-2) and at.imag < 0


def test_the_state_space_has_the_same_response(model):
    A, B, C, D = model.state_space
    for w in (300.0, 7000.0, 40000.0):
        found = C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D
        expected = model.response(np.array([w]))[0]
        scale = np.abs(expected).max(axis=0)
        np.testing.assert_allclose(found / scale, expected / scale, atol=SOLVED)


def test_craig_and_bampton_have_the_static_stiffness_and_the_frequencies_up_to_their_cut(
    stage, model
):
    """The cut: the highest frequency kept with the platform held. Six lie below; measured 0.094 %
    too high at most.
    """
    K, M, L = model.craig_bampton
    found = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True))
    cut = np.sqrt(K.diagonal()[3:].max())
    exact = modes(
        vibrating(stage, build_mesh(stage, 4), payload_of(0.05, 10.0), drive_of(stage)), 9
    ).frequencies
    below = exact < cut
    assert below.sum() == 6 and np.all(
        found[below] >= exact[below] * (1 - SOLVED)
    )  # fewer freedoms are stiffer
    np.testing.assert_allclose(found[below], exact[below], rtol=1.2e-3)
    np.testing.assert_allclose(
        found[:3], exact[:3], rtol=5e-4
    )  # with six modes of the held platform; measured 3e-4
    static = np.linalg.solve(K, L)[:3]
    np.testing.assert_allclose(
        static[:, :3], model.response(np.zeros(1))[0].real[:, :3], rtol=1e-7, atol=1e-12
    )
    np.testing.assert_allclose(L[:3, :3], np.eye(3), atol=SOLVED)


def test_files_hold_the_matrices_with_names_and_units(model, tmp_path):
    for ending in ("npz", "mat"):
        path = tmp_path / f"model.{ending}"
        model.write(path)
        found = np.load(path) if ending == "npz" else loadmat(path, simplify_cells=True)
        np.testing.assert_array_equal(found["A"], model.state_space.A)
        np.testing.assert_array_equal(found["K_cb"], model.craig_bampton.stiffness)
        K = found["K_cb"]
        M = found["M_cb"]
        exact = found["frequencies_rad_per_s"]
        above = 100 * (
            np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[: len(exact)]) / exact - 1
        )
        np.testing.assert_allclose(found["K_cb_above_percent"], above, atol=1e-6)
        assert 0.05 < above.max() < 5 and f"to {above.max():.2g} % above" in str(found["K_cb_note"])
        assert (
            list(found["inputs"])[3] == "stroke base, chain 1"
            and list(found["input_units"])[2] == "N mm"
        )
    with pytest.raises(BadInput, match=r"expected .npz or .mat"):
        model.write(tmp_path / "model.txt")
