"""Stiffness of the driven stage with its stacks pushing: what internal forces, those of preloads too, add to (16).

A stack that pushes with N against its opening g has the potential `-N g`. To the tangent stiffness it adds `-N g''`,
beside the `k g' g'` of its own stiffness: in the terms of (16) the antagonistic load times the second-order influence
coefficients of its contact.

Two stacks on one line that push a body from both sides with equal forces leave no force in any neck. Their own terms
remain: when the body turns by phi about a hinge of a still carrier, a push with a fixed direction through a point of
the body that is h before the hinge, measured along the push, has the moment `N h phi` with the turn; a push that turns
with the body, through a fixed point, has it against the turn. The partner has the same. Which of the two is meant, and
which point, is `Stack.pivot`: normal to a smooth flat of the pushed body, through the centre of a ball on the carrier
("pushed"), or with the carrier, through the contact on the pushed body ("carrier"). A stack that hinges at both ends
is neither.

Single stacks, unequal preloads and commands load the necks. Chains that carry a wrench w then add `-w x''` of their
pose x, as in (16), and the stage is no longer where it was: the joints are taken to exact equilibrium first. An axial
force of 10 N in the base hinges of the reference stage alone changes K_xx by 1.2 %.

Here a chain is elastic joints in series, base to platform: hinges by rotation, axial and shear, in this order, as in
`kinematics`, pieces of elastic links, and what the elastic platform gives between its end and the hub. What a force
along a notch does to the stiffness of the notch itself is not in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic.drive import allowed_in, beyond, hinge_twists, link_pieces
from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.platform import platform_compliance
from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import ComputationFailed
from flexfem.stage.contacts import Follows, Push, Stack
from flexfem.stage.designs import chain_rotation, stage_frames
from flexfem.stage.schema import CHAINS, Stage

ITERATIONS = 25
STEP = 1e-11  # of the energies' roots, of the last Newton step
LARGEST_TURN = 0.3  # rad, of a joint: beyond it the stage has buckled, or the forces are far too large
ROUND_OFF = 1e-12  # of the largest
BLOCK = 256  # joints: as many rows of a matrix of all joints of a chain as are held at a time


class ChainStack(NamedTuple):
    """One stack seen by its chain, whose joints are k.

    stack : its number.   pivot, push : mm, and a unit vector, complex, at rest.
    near, far : (k,), share of the push on the body nearer the base, and on the other one, that is beyond each joint.
    on_far : whether the pivot is on the far body and the direction that of the near one, or the other way about.
    sign : 1 where the far body is the one that is pushed, else -1.
    """

    stack: int
    pivot: complex
    push: complex
    near: Array
    far: Array
    on_far: bool
    sign: float


class ChainJoints(NamedTuple):
    """One chain as elastic joints (k) of unit stiffness in series, base to platform.

    place : (k,), their numbers in the stage.   v, turn : (k,), complex and real, twist of the platform centre at rest.
    """

    place: Index
    v: AnyArray
    turn: Array
    contacts: tuple[ChainStack, ...]


class Serial(NamedTuple):
    """A stage of elastic joints with n stacks.

    basis : (size, r), their motions in r unknowns: every hinge and the platform by itself, and pieces of links as they
    go when a chain or a stack is loaded, which leaves out what is of second order in the forces over their stiffness.
    """

    n: int
    chains: tuple[ChainJoints, ...]
    basis: Array


class Pulls(NamedTuple):
    """A symmetric matrix (k, k): the upper triangle, diagonal included, is that of the product of two (m, k)."""

    before: Array
    after: Array

    def reduced(self, V: Array) -> Array:
        """V' M V of the matrix M with columns V (k, r), in blocks: M itself is large where there are many stacks."""
        r = V.shape[1]
        total, earlier = np.zeros((r, r)), np.zeros((len(self.before), r))
        for start in range(0, len(V), BLOCK):
            B, A, here = (part[..., start : start + BLOCK] for part in (self.before, self.after, V.T))
            total += earlier.T @ (A @ here.T) + here @ np.triu(B.T @ A) @ here.T
            earlier += B @ here.T
        return np.asarray(total + total.T - (V.T * np.sum(self.before * self.after, axis=0)) @ V)


class JointState(NamedTuple):
    """Chains at joint displacements.

    pose : (9,), of their ends, mm and rad.   G : (9, size), its change.   J : (n, size), change of the openings.
    pulls : by chain, second derivatives times wrenches and forces, which (16) takes off the springs.
    """

    pose: Array
    G: Array
    J: Array
    pulls: list[Pulls]


class Loaded(NamedTuple):
    """A stage in equilibrium with forces of its stacks and a load on the platform, in r unknowns.

    pose : (3,), mm and rad, away from the stage without any.   inner : (r, r), second derivatives of energy and loads.
    G : (9, r), change of the poses of the chains.   J : (n, r), of the openings.
    """

    pose: Array
    inner: Array
    G: Array
    J: Array

    def stiffness(self, stacks: Array) -> Array:
        """Tangent stiffness (3, 3) of the platform with stacks of stiffness (n,), N/mm, that hold their strokes."""
        inner, one = self.inner + (self.J.T * stacks) @ self.J, np.tile(np.eye(3), (3, 1))
        K = one.T @ np.linalg.solve(self.G @ np.linalg.solve(inner, self.G.T), one)  # (16) to (18)
        return np.asarray((K + K.T) / 2)

    def stable(self, stacks: Array) -> bool:
        """Whether the equilibrium keeps itself: every motion with closed loops takes energy."""
        from scipy.linalg import null_space

        free = null_space(np.concatenate([self.G[:3] - self.G[3:6], self.G[:3] - self.G[6:]]))
        return bool(np.linalg.eigvalsh(free.T @ (self.inner + (self.J.T * stacks) @ self.J) @ free)[0] > 0)


def serial(stage: Stage, result: AnalyticResult, stacks: tuple[Stack, ...], follows: Follows) -> Serial:
    """The joints of a stage by hinges, freedoms and, where it has them, elastic links of an analytic model of it."""
    body = _body(stage) if result.links else np.zeros((9, 0))
    shared, size = np.arange(body.shape[1]), body.shape[1]
    chains, links = list[ChainJoints](), [np.zeros(size, dtype=bool)]
    for chain in CHAINS:
        mine = [(j, stack) for j, stack in enumerate(stacks) if stack.chain == chain - 1]
        twists, shares, pieces = _joints(stage, chain, result, [push for _, stack in mine for push in stack.pushes])
        place = np.concatenate([size + np.arange(twists.shape[1]), shared])
        v, turn = twists[0] + 1j * twists[1], twists[2]
        own = body[3 * chain - 3 : 3 * chain]
        shares = np.pad(shares, ((0, 0), (0, len(shared))), mode="edge")  # beyond the platform's hinge is the platform
        contacts = tuple(_contact(j, stack, shares[2 * k : 2 * k + 2], follows) for k, (j, stack) in enumerate(mine))
        chains.append(ChainJoints(place, np.append(v, -own[0] - 1j * own[1]), np.append(turn, -own[2]), contacts))
        links.append(pieces)
        size += twists.shape[1]
    of = Serial(len(stacks), tuple(chains), np.zeros((size, 0)))
    return of._replace(basis=_basis(of, np.concatenate(links)))


def _contact(number: int, stack: Stack, shares: Array, follows: Follows) -> ChainStack:
    """A stack by what (2, k) of its pushes, on the pushed body and on its carrier, is beyond each joint."""
    outwards = stack.pushes[0].body > stack.pushes[1].body
    far, near = shares if outwards else shares[::-1]
    spin = complex(*chain_rotation(stack.chain)[:2, 0])
    on_far = outwards == (follows == "carrier")
    return ChainStack(
        number, spin * stack.pivot(follows), spin * stack.direction, near, far, on_far, 1.0 if outwards else -1.0
    )


def _joints(stage: Stage, chain: int, result: AnalyticResult, pushes: list[Push]) -> tuple[Array, Array, Array]:
    """Twists (3, k) of the joints of a chain, share (pushes, k) of each push beyond them, and which are of links."""
    root = np.sqrt(np.stack(np.broadcast_arrays(*result.hinges), axis=-1))[chain - 1]
    G, allowed = hinge_twists(stage_frames(stage))[chain - 1], allowed_in(result.freedoms)[chain - 1] > 0
    R, pieces = chain_rotation(chain - 1), link_pieces(stage, chain, pushes) if result.links else []
    twists, shares, of_links = list[Array](), list[Array](), list[Array]()
    for link in range(3):  # the pad or a link, then the hinge at its end
        for _, c, at in (each for each in pieces if each.link == link):
            twists.append(np.concatenate(list(R @ np.linalg.cholesky(c)), axis=1))
            past = np.array([beyond(push, link, at) for push in pushes]).reshape(len(pushes), len(at))
            shares.append(np.repeat(past, 3, axis=1))
            of_links.append(np.ones(3 * len(at), dtype=bool))
        twists.append((G[link] * root[link])[:, allowed[link]])
        past = np.array([float(push.body > link) for push in pushes]).reshape(len(pushes), 1)
        shares.append(np.repeat(past, twists[-1].shape[1], axis=1))
        of_links.append(np.zeros(twists[-1].shape[1], dtype=bool))
    return np.concatenate(twists, axis=1), np.concatenate(shares, axis=1), np.concatenate(of_links)


def _body(stage: Stage) -> Array:
    """Motions (9, 9) of the ends of the chains against the hub, of nine joints of unit stiffness."""
    values, vectors = np.linalg.eigh(platform_compliance(stage, stage.elastic))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _basis(of: Serial, links: NDArray[np.bool_]) -> Array:
    """The basis of `Serial`; links : (size,), which joints are pieces of links."""
    at = moved(of, np.zeros(len(links)), np.zeros(9), np.zeros(of.n))
    rows = np.concatenate([at.G, at.J])[:, links]
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    _, values, V = np.linalg.svd(rows / np.where(size > 0, size, 1.0), full_matrices=False)
    kept = V[values > ROUND_OFF * np.max(values, initial=0.0)]
    alone = np.flatnonzero(~links)
    found = np.zeros((len(links), len(alone) + len(kept)))
    found[alone, np.arange(len(alone))] = 1.0
    found[links, len(alone) :] = kept.T
    return found


def moved(of: Serial, eta: Array, wrench: Array, force: Array) -> JointState:
    """The chains at joint displacements (size,), with wrenches (9,) on their ends and forces (n,) of the stacks."""
    size = len(eta)
    at = JointState(np.zeros(9), np.zeros((9, size)), np.zeros((of.n, size)), [])
    for i, chain in enumerate(of.chains):
        phi, mine = eta[chain.place] * chain.turn, slice(3 * i, 3 * i + 3)
        spun = np.exp(1j * np.append(0.0, np.cumsum(phi)))
        slid = eta[chain.place] * chain.v * np.sinc(phi / (2 * np.pi)) * np.exp(0.5j * phi)
        origin = np.append(0.0, np.cumsum(spun[:-1] * slid))  # where what was at the platform centre has gone, by joint
        v = spun[:-1] * chain.v - 1j * chain.turn * origin[:-1]
        end = v + 1j * chain.turn * origin[-1]
        at.pose[mine] = origin[-1].real, origin[-1].imag, np.sum(phi)
        at.G[mine, chain.place] = end.real, end.imag, chain.turn
        before, after = [chain.turn], [(np.conj(complex(*wrench[mine][:2])) * 1j * end).real]
        for contact in chain.contacts:
            at.J[contact.stack, chain.place], nearer, farther = _opening(chain, contact, spun, origin, v)
            before.append(force[contact.stack] * nearer)
            after.append(farther)
        at.pulls.append(Pulls(np.array(before), np.array(after)))
    return at


def _opening(
    chain: ChainJoints, of: ChainStack, spun: AnyArray, origin: AnyArray, v: AnyArray
) -> tuple[Array, Array, Array]:
    """Derivative (k,) of the opening of a stack by the joints, and two vectors (k,), the first by the joint nearer
    the base, the second by the farther one, whose products are its second derivatives.

    Notes
    -----
    Where the pivot is on the far body, a joint nearer the base turns how it is moved by one beyond it; where it is on
    the near body, seen from the far one, the other way about. Only joints between the two bodies count.
    """
    far, near = (-np.diff(share, prepend=1.0, append=0.0) for share in (of.far, of.near))
    on, along = (far, near) if of.on_far else (near, far)
    pivot, push = np.sum(on * (origin + spun * of.pivot)), of.push * np.sum(along * spun)
    here = v + 1j * chain.turn * pivot
    rate, swing = (np.conj(push) * here).real, of.sign * (np.conj(push) * 1j * here).real
    nearer, farther = (chain.turn, swing) if of.on_far else (-swing, chain.turn)
    return of.sign * (of.far - of.near) * rate, (1 - of.near) * nearer, of.far * farther


def loaded(of: Serial, force: Array, load: Array) -> Loaded:
    """Exact equilibrium with forces (n,) of the stacks, N, whichever way they move, and a dead load (3,) as in (16).

    Raises ComputationFailed when Newton does not converge: the stage has buckled, or the forces are far too large.
    """
    V, one, r = of.basis, np.tile(np.eye(3), (3, 1)), of.basis.shape[1]
    q, wrench, u = np.zeros(r), np.zeros(9), np.zeros(3)
    for _ in range(ITERATIONS):
        at = moved(of, V @ q, wrench, force)
        G, J, inner = at.G @ V, at.J @ V, np.eye(r)
        for chain, pulls in zip(of.chains, at.pulls, strict=True):
            inner -= pulls.reduced(V[chain.place])
        missing = np.concatenate([J.T @ force + G.T @ wrench - q, one @ u - at.pose, load - one.T @ wrench])
        rows = [inner, -G.T, np.zeros((r, 3))], [G, np.zeros((9, 9)), -one], [np.zeros((3, r)), one.T, np.zeros((3, 3))]
        step = np.linalg.solve(np.block(list(rows)), missing)
        if np.linalg.norm(step[:r]) <= STEP * (np.linalg.norm(q) + np.linalg.norm(J.T * force)):
            return Loaded(u + step[-3:], inner, G, J)
        q, wrench, u = q + step[:r], wrench + step[r:-3], u + step[-3:]
        if not max(np.max(np.abs((V @ q)[chain.place] * chain.turn)) for chain in of.chains) <= LARGEST_TURN:
            break
    raise ComputationFailed("no equilibrium with these forces of the stacks: they are at or beyond buckling")
