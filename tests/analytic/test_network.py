"""The network against the paper's equations, and against all of its equations solved at once."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.analytic.model import hinge_matrices
from flexfem.analytic.network import ElasticBodies, joint_compliance, solve, stiffness, with_springs
from flexfem.analytic.paper import FREEDOMS_BY_MOBILITY, mechanism, rank_revealing
from flexfem.analytic.paper import stiffness as stiffness_of_paper
from flexfem.arrays import inverse

UNIT = np.array([1.0, 1.0, 30.0])[:, None]  # of wrenches


def compliances(rng):
    size = np.array([1e-3, 2e-4, 5e-4])[:, None, None] * rng.uniform(0.5, 2.0, (3, 3, 3))
    return joint_compliance(rng.uniform(-10, 10, (3, 3, 2)), rng.uniform(-np.pi, np.pi, (3, 3)), *size)


def at_once(hinges, loads, gaps, coupling):
    """Twists (7, 3, k) of all bodies and wrenches (3, 3, 3, k) in all hinges: `G U - C w = e` and `G' w = F`."""
    G, C = np.zeros((9, 3, 7, 3)), np.zeros((9, 3, 9, 3))
    for chain, hinge in np.ndindex(3, 3):
        joint, far = 3 * chain + hinge, 0 if hinge == 2 else 1 + 2 * chain + hinge
        C[joint, :, joint] = hinges[chain, hinge]
        G[joint, :, far] = np.eye(3)
        if hinge:
            G[joint, :, 2 * chain + hinge] = -np.eye(3)
    C[2::3, :, 2::3] += coupling.reshape(3, 3, 3, 3)
    G, C, k = G.reshape(27, 21), C.reshape(27, 27), loads.shape[-1]
    openings = np.zeros((9, 3, k))
    openings[::3] = gaps
    unit = np.max(C)
    whole = np.block([[-C / unit, G], [G.T, np.zeros((21, 21))]])
    found = np.linalg.solve(whole, np.concatenate([openings.reshape(27, k), unit * loads.reshape(21, k)]))
    return found[27:].reshape(7, 3, k), found[:27].reshape(3, 3, 3, k) / unit


@pytest.mark.parametrize("mobility", [3, 6, 12, 21])
def test_the_network_is_the_paper(generic, error, mobility):
    """K_uu of (16) to (18) on unlike chains: 2e-15 to 3e-13 was seen, with dependent joints by elimination."""
    freedoms = FREEDOMS_BY_MOBILITY[mobility]
    for seed in range(20):
        frames, hinges = generic(seed)
        of = mechanism(frames, hinges, freedoms)
        of = of._replace(choice=rank_revealing(of.frames, of.joints, of.springs))
        found, _ = stiffness(hinge_matrices(frames, hinges, freedoms))
        assert error(found, stiffness_of_paper(of).K_uu) < 1e-12


@pytest.mark.parametrize("elastic", [0.0, 1.0])
def test_chains_give_what_all_equations_give(elastic, error):
    """Loads on every body, gaps of the chains, and a platform that couples them; the stiffness is the inverse."""
    rng = np.random.default_rng(11)
    hinges, L = compliances(rng), rng.normal(size=(9, 9)) * np.tile([1e-3, 1e-3, 3e-5], 3)[:, None]
    loads, gaps = rng.normal(size=(7, 3, 5)) * UNIT, rng.normal(size=(3, 3, 5)) * 1e-3 / UNIT
    coupling = elastic * L @ L.T
    U, w = at_once(hinges, loads, gaps, coupling)
    found = solve(hinges, loads, gaps, ElasticBodies(coupling))
    np.testing.assert_allclose(found.platform, U[0], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(found.wrenches, w, rtol=1e-7, atol=1e-7 * np.abs(w).max())
    free, (U, _) = solve(hinges, loads, bodies=ElasticBodies(coupling)), at_once(hinges, loads, 0 * gaps, coupling)
    np.testing.assert_allclose(free.motions, np.einsum("bak,bal->kl", loads, U), rtol=1e-7, atol=1e-9)
    alone = np.concatenate([np.eye(3)[None], np.zeros((6, 3, 3))])
    moved, (K, pulls) = solve(hinges, alone, bodies=ElasticBodies(coupling)), stiffness(hinges, coupling)
    assert error(K, inverse(moved.platform)) < 1e-10
    np.testing.assert_allclose(pulls, moved.wrenches[:, 0] @ K, rtol=1e-7, atol=1e-6)


def test_springs_along_lines_between_bodies_add_to_the_stiffness_of_all_bodies():
    rng, rates = np.random.default_rng(14), np.array([3e3, 8e2])
    lines = np.zeros((7, 3, 2))
    lines[0] = rng.normal(size=(3, 2)) * UNIT
    lines[4] = -lines[0]
    free = solve(compliances(rng), np.concatenate([np.eye(21).reshape(7, 3, 21), lines], axis=-1)).motions
    G = lines.reshape(21, 2)
    expected = np.linalg.inv(np.linalg.inv(free[:21, :21]) + G * rates @ G.T)
    np.testing.assert_allclose(with_springs(free, rates), expected, rtol=1e-6, atol=1e-11)


def test_designs_broadcast_and_one_in_line_leaves_the_others(generic):
    frames, hinges = generic(3, 4)
    frames.centres[1, 0] = [[-30.0, -20.0], [-15.0, -10.0], [-6.0, -4.0]]  # three pivots of chain 1 in line
    each = hinge_matrices(frames, hinges, FREEDOMS_BY_MOBILITY[3])
    found, _ = stiffness(each, np.zeros((9, 9)))
    assert np.isnan(found[1]).all() and np.isfinite(found[[0, 2, 3]]).all()
    np.testing.assert_allclose(found[2], stiffness(each[2])[0], rtol=1e-9)
