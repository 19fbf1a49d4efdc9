"""The network against the paper's equations, and against all of its equations solved at once, on
any topology; the inverse of small matrices, and when it is not to be trusted."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.analytic.network import (
    GROUND,
    InternalMotions,
    Network,
    joint_compliance,
    solve,
    stiffness,
    topology,
    with_springs,
)
from flexfem.arrays import inverse
from flexfem.paper.equations import FREEDOMS_BY_MOBILITY, mechanism, rank_revealing
from flexfem.paper.equations import stiffness as stiffness_of_paper
from flexfem.paper.model import JOINTS, network_of

from ..tolerances import DENSE

PARALLELOGRAM = (
    2,
    1,
    ((GROUND, 0), (GROUND, 0), (0, 1), (0, 1)),
)  # two in series, each on two parallel joints
LEVER = (
    3,
    2,
    ((GROUND, 0), (0, 1), (1, 2), (GROUND, 2), (2, GROUND)),
)  # a joint that leads to the ground, too
BRANCHED = (
    5,
    0,
    ((GROUND, 1), (2, 1), (2, 0), (GROUND, 3), (3, 2), (4, 0), (0, GROUND), (2, GROUND)),
)
FOUR_CHAINS = (5, 4, tuple(ends for k in range(4) for ends in ((GROUND, k), (k, 4))))
STAGE = (7, 0, JOINTS)
TOPOLOGIES = (PARALLELOGRAM, LEVER, BRANCHED, FOUR_CHAINS, STAGE)


def compliances(rng, count, freedoms=(1, 1, 1)):
    size = (
        np.array([1e-3, 2e-4, 5e-4])[:, None]
        * rng.uniform(0.5, 2.0, (3, count))
        * np.array(freedoms)[:, None]
    )
    return joint_compliance(
        rng.uniform(-10, 10, (count, 2)), rng.uniform(-np.pi, np.pi, count), *size
    )


def at_once(of: Network, loads, openings):
    """Twists (bodies, 3, k) and wrenches (m, 3, k): `G U - C w = e` and `G' w = F` as they stand."""
    m = len(of.joints)
    b = of.bodies
    G = np.zeros((m, 3, b, 3))
    C = np.zeros((m, 3, m, 3))
    for joint, ends in enumerate(of.joints):
        C[joint, :, joint] += of.compliance[joint]
        for body, sign in zip(ends, (-1, 1), strict=True):
            if body != GROUND:
                G[joint, :, body] += sign * np.eye(3)
    if of.coupling is not None:
        parts = of.coupling.reshape(len(of.coupled), 3, len(of.coupled), 3)
        for i, one in enumerate(of.coupled):
            for j, other in enumerate(of.coupled):
                C[one, :, other] += parts[i, :, j]
    G = G.reshape(3 * m, 3 * b)
    C = C.reshape(3 * m, 3 * m)
    unit = np.max(C)  # of wrenches, so that all entries are of one size
    whole = np.block([[-C / unit, G], [G.T, np.zeros((3 * b, 3 * b))]])
    k = loads.shape[-1]
    found = np.linalg.solve(
        whole, np.concatenate([openings.reshape(-1, k), unit * loads.reshape(-1, k)])
    )
    return found[3 * m :].reshape(b, 3, k), found[: 3 * m].reshape(m, 3, k) / unit


@pytest.mark.parametrize("mobility", [3, 6, 12, 21])
def test_the_network_is_the_paper(generic, error, mobility):
    """K_uu of (16) to (18) on unlike chains: 2e-15 to 3e-13 was seen, with dependent joints by
    elimination.
    """
    freedoms = FREEDOMS_BY_MOBILITY[mobility]
    for seed in range(20):
        frames, hinges = generic(seed)
        found = stiffness(network_of(frames, hinges, freedoms)).matrix
        of = mechanism(frames, hinges, freedoms)
        of = of._replace(choice=rank_revealing(of.frames, of.joints, of.springs))
        assert error(found, stiffness_of_paper(of).K_uu) < DENSE


@pytest.mark.parametrize("of", TOPOLOGIES)
@pytest.mark.parametrize("coupled", [False, True])
def test_paths_give_what_all_equations_give(of, coupled):
    """Loads on every body and openings of every joint, bodies within paths, branches, loops,
    parallel joints.
    """
    rng = np.random.default_rng(11)
    bodies, output, joints = of
    m = len(joints)
    mechanism = Network(bodies, output, joints, compliances(rng, m))
    if coupled:
        L = rng.normal(size=(9, 9)) * np.tile([1e-3, 1e-3, 3e-5], 3)[:, None]
        mechanism = mechanism._replace(coupled=(0, m - 1, 0), coupling=L @ L.T)
    k = 5
    loads = rng.normal(size=(bodies, 3, k)) * np.array([1.0, 1.0, 30.0])[:, None]
    openings = rng.normal(size=(m, 3, k)) * np.array([1e-3, 1e-3, 3e-5])[:, None]
    U, w = at_once(mechanism, loads, openings)
    found = solve(mechanism, loads, openings)
    np.testing.assert_allclose(found.output, U[output], rtol=DENSE, atol=1e-11)
    np.testing.assert_allclose(found.wrenches, w, rtol=1e-7, atol=1e-7 * np.abs(w).max())
    work = np.einsum("bak,bal->kl", loads, U)
    np.testing.assert_allclose(found.motions, work, rtol=DENSE, atol=DENSE * np.abs(work).max())


def test_internal_motions_move_a_body_on_a_path_as_a_kept_one():
    """A third body that hangs on the first makes it a kept one, and carries nothing."""
    rng = np.random.default_rng(15)
    joints = ((GROUND, 0), (0, 1))
    C = compliances(rng, 3)
    loads = rng.normal(size=(3, 3, 2))
    D = rng.normal(size=(2, 2))
    loads[2], openings = (
        0.0,
        np.concatenate([rng.normal(0.0, 1e-3, (2, 3, 2)), np.zeros((1, 3, 2))]),
    )
    on_path = solve(
        Network(2, 1, joints, C[:2]), loads[:2], internal=InternalMotions(openings[:2], D)
    )
    kept = solve(Network(3, 1, (*joints, (0, 2)), C), loads, internal=InternalMotions(openings, D))
    np.testing.assert_allclose(on_path.motions, kept.motions, rtol=DENSE)


def test_springs_along_lines_between_bodies_add_to_the_stiffness_of_all_bodies():
    rng = np.random.default_rng(14)
    rates = np.array([3e3, 8e2])
    of = Network(*FOUR_CHAINS, compliances(rng, 8))
    lines = np.zeros((5, 3, 2))
    lines[0] = rng.normal(size=(3, 2)) * np.array([1.0, 1.0, 20.0])[:, None]
    lines[4] = -lines[0]
    free = solve(of, np.concatenate([np.eye(15).reshape(5, 3, 15), lines], axis=-1)).motions
    G = lines.reshape(15, 2)
    expected = np.linalg.inv(np.linalg.inv(free[:15, :15]) + G * rates @ G.T)
    np.testing.assert_allclose(with_springs(free, rates), expected, rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("of", TOPOLOGIES)
def test_the_output_moved_alone_is_the_inverse_of_its_compliance(of, error):
    rng = np.random.default_rng(12)
    bodies, output, joints = of
    mechanism = Network(bodies, output, joints, compliances(rng, len(joints)))
    loads = np.zeros((bodies, 3, 3))
    loads[output] = np.eye(3)
    free = solve(mechanism, loads)
    held = stiffness(mechanism)
    assert error(held.matrix, inverse(free.output)) < DENSE
    np.testing.assert_allclose(held.wrenches, free.wrenches @ held.matrix, rtol=1e-7, atol=1e-6)


def test_ideal_pivots_need_no_special_case(error):
    """A body on three pivoted struts has the truss's stiffness though each end of a strut turns
    without any effort.
    """
    rng = np.random.default_rng(13)
    joints = list[tuple[int, int]]()
    parts = list[np.ndarray]()
    ends = rng.uniform(-30, 30, (3, 2, 2))
    expected = np.zeros((3, 3))
    for k, (ground, there) in enumerate(ends):
        along = (there - ground) / np.linalg.norm(there - ground)
        joints += [(GROUND, 1 + k), (1 + k, 0)]
        none = np.array(0.0)
        angle = np.array(np.arctan2(along[1], along[0]))
        parts += [
            joint_compliance(ground, angle, np.array(1.0), np.array(4e-5), none)
        ]  # turns, and gives along
        parts += [joint_compliance(there, angle, np.array(1.0), none, none)]
        line = np.array([*along, there[0] * along[1] - there[1] * along[0]])
        expected += np.outer(line, line) / 4e-5
    of = Network(4, 0, tuple(joints), np.array(parts))
    assert error(stiffness(of).matrix, expected) < 1e-5  # springs of the pivots: 1 N mm/rad


def test_designs_broadcast_and_one_in_line_leaves_the_others(generic):
    frames, hinges = generic(3, 4)
    frames.centres[1, 0] = [
        [-30.0, -20.0],
        [-15.0, -10.0],
        [-6.0, -4.0],
    ]  # three pivots of chain 1 in line
    of = network_of(frames, hinges, FREEDOMS_BY_MOBILITY[3], np.zeros((9, 9)))
    found = stiffness(of).matrix
    assert np.isnan(found[1]).all() and np.isfinite(found[[0, 2, 3]]).all()
    one = of._replace(compliance=of.compliance[2], coupling=None)
    np.testing.assert_allclose(found[2], stiffness(one).matrix, rtol=DENSE)


def test_a_body_that_floats_is_named():
    with pytest.raises(ValueError, match=r"\[1, 2\]"):
        topology(3, 0, ((GROUND, 0), (1, 2), (2, 1)))


def conditioned(number: int, condition: float) -> np.ndarray:
    """A matrix of ones and one smaller part, whose condition number in the 1-norm is near the one
    asked for.
    """
    made = np.eye(number)
    made[0, 1] = made[1, 0] = 1.0 - 2.0 / condition
    return made


@pytest.mark.parametrize("number", [3, 6])
def test_six_digits_of_sixteen_are_trusted_and_less_is_not_a_number(number: int) -> None:
    good = conditioned(number, 0.7e10)
    bad = conditioned(number, 1.5e10)
    assert np.linalg.cond(good, 1) < 1e10 < np.linalg.cond(bad, 1)
    found = inverse(np.array([good, bad, np.eye(number), np.zeros((number, number))]))
    assert np.isfinite(found).all(axis=(1, 2)).tolist() == [True, False, True, False]
    np.testing.assert_allclose(found[0] @ good, np.eye(number), atol=1e-5)


def test_units_of_rows_and_columns_do_not_count() -> None:
    matrix = np.array([[2.0, 0.3, -0.5], [0.1, 1.5, 0.4], [-0.2, 0.7, 3.0]])
    units = np.diag([1e-9, 1.0, 1e12])
    back = np.linalg.inv(units)
    np.testing.assert_allclose(
        inverse(units @ matrix @ units), back @ np.linalg.inv(matrix) @ back, rtol=DENSE
    )
    unequal = np.diag([1e7, 1e-8, 3.0]) @ matrix  # rows alone
    np.testing.assert_allclose(inverse(unequal), np.linalg.inv(unequal), rtol=DENSE)
