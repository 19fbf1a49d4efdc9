"""Finite displacements: equilibrium under a load or at a pose, and the stage with its stacks pushing.

Internal forces, those of preloads too, add to (16). A chain is elastic joints in series, base to platform: hinges by
rotation, axial and shear, in this order, as in `paper`, pieces of elastic links, and what the elastic platform gives. A
stack that pushes with N against its opening g has the potential `-N g`: to the tangent stiffness it adds `-N g''`,
which depends on what its push turns with and on the point it goes through, `Stack.pivot`. What a force along a notch
does to the stiffness of the notch itself is not in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic.elastic_bodies import platform_compliance
from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.network import freedom_motions
from flexfem.analytic.paper import KINDS, PaperModel, apply, first_order, resting, stiffness
from flexfem.analytic.responses import distal_share, link_pieces
from flexfem.arrays import AnyArray, Array, Index, inverse
from flexfem.mechanism.contacts import Follows, Push, Stack
from flexfem.mechanism.designs import Frames, chain_rotation, stage_frames
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.refused import ComputationFailed

STEP = 1e-9  # of the energies' roots, of the last Newton step; the error it leaves is of second order, that is rounding
ITERATIONS = 25
LOAD_STEPS = (1, 4, 16, 64)
LARGEST_TURN = 0.1  # rad in one iteration; beyond it Newton may land on another branch, so the load is divided
BUCKLED = 0.3  # rad, of a joint: beyond it stacks have buckled the stage, or their forces are far too large
ROUND_OFF = 1e-12  # of the largest
ONE = np.tile(np.eye(3), (3, 1))
NONE = np.zeros(0)  # stiffness of no stacks


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

    place : (k,), their numbers in the stage.
    v, turn : (..., k), complex and real, twist of the platform centre at rest; leading axes are designs.
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


class Equilibrium(NamedTuple):
    """A stage in equilibrium with a load on the platform, and forces of its stacks if it has any, in r unknowns.

    pose : (..., 3), mm and rad, away from the stage without any.   load : (..., 3), on the platform, N and N mm.
    displacement : (..., r), in the unknowns of `Serial`; of `under_load` and `at_pose` the joints' own, rad and mm.
    inner : (..., r, r), second derivatives of energy and loads.
    G : (..., 9, r), change of the poses of the chains.   J : (n, r), of the openings.
    nan for a design whose loops are singular at rest.
    """

    pose: Array
    load: Array
    displacement: Array
    inner: Array
    G: Array
    J: Array

    def stiffness(self, stacks: Array = NONE) -> Array:
        """Tangent stiffness (..., 3, 3) of the platform with stacks of stiffness (n,), N/mm, holding their strokes."""
        inner, G = self.inner + (self.J.T * stacks) @ self.J, self.G
        K = ONE.T @ inverse(G @ np.linalg.solve(inner, np.swapaxes(G, -1, -2))) @ ONE  # (16) to (18)
        return np.asarray((K + np.swapaxes(K, -1, -2)) / 2)

    @property
    def without_terms(self) -> Equilibrium:
        """The same without the second-order terms of (16), `- tau_p o H_p - F_u o H_u`, which mean something together
        only: their sum does not depend on which joints are called independent, as each alone does."""
        return self._replace(inner=np.broadcast_to(np.eye(self.inner.shape[-1]), self.inner.shape))

    def stable(self, stacks: Array) -> bool:
        """Whether the equilibrium keeps itself: every motion with closed loops takes energy."""
        from scipy.linalg import null_space

        free = null_space(np.concatenate([self.G[:3] - self.G[3:6], self.G[:3] - self.G[6:]]))
        return bool(np.linalg.eigvalsh(free.T @ (self.inner + (self.J.T * stacks) @ self.J) @ free)[0] > 0)


def under_load(of: PaperModel, load: Array) -> Equilibrium:
    """Equilibrium under a dead platform load (..., 3): force at the platform centre, moving with it, and moment.

    Raises ComputationFailed when Newton's method does not converge even in the smallest load steps.
    """
    return _of_paper(of, np.asarray(load, dtype=float), hold=False)


def at_pose(of: PaperModel, pose: Array) -> Equilibrium:
    """Load that holds the platform exactly at the displacement `pose` (..., 3), mm and rad, and the joints there.

    Raises ComputationFailed as `under_load`; also when the pose is out of reach.
    """
    return _of_paper(of, np.asarray(pose, dtype=float), hold=True)


def loaded(of: Serial, force: Array, load: Array) -> Equilibrium:
    """Exact equilibrium with forces (n,) of the stacks, N, whichever way they move, and a dead load (3,) as in (16).

    Raises ComputationFailed when Newton does not converge: the stage has buckled, or the forces are far too large.
    """
    found = _equilibrium(of, force, load, False, 1)
    eta = of.basis @ found.displacement
    if not max(np.max(np.abs(eta[chain.place] * chain.turn)) for chain in of.chains) <= BUCKLED:  # not for nan
        raise ComputationFailed("no equilibrium with these forces of the stacks: they are at or beyond buckling")
    return found


def _of_paper(of: PaperModel, target: Array, hold: bool) -> Equilibrium:
    root = np.sqrt(of.springs)
    chains = []
    for G, own in zip(first_order(of.joints, resting(of.frames, of.joints)), of.joints.chains, strict=True):
        t = G / root[..., None, own]
        chains.append(ChainJoints(np.arange(own.start, own.stop), t[..., 0, :] + 1j * t[..., 1, :], t[..., 2, :], ()))
    serial = Serial(0, tuple(chains), np.eye(root.shape[-1]))
    singular = np.asarray(np.isnan(stiffness(of).K_uu).any(axis=(-2, -1)))
    for steps in LOAD_STEPS:
        found = _equilibrium(serial, NONE, target, hold, steps)
        lost = np.asarray(np.isnan(found.displacement).any(axis=-1) & ~singular)
        if not lost.any():
            pose, load = (np.where(singular[..., None], np.nan, part) for part in found[:2])
            return found._replace(pose=pose, load=load, displacement=found.displacement / root)
    failed = np.argwhere(lost)
    where = f", design {tuple(failed[0].tolist())} the first of {len(failed)}" if lost.shape else ""
    what = "holding the pose" if hold else "under the load"
    raise ComputationFailed(
        f"no equilibrium {what}{where}: Newton on (13) did not converge in {LOAD_STEPS[-1]} load steps; the target is"
        " beyond a singular configuration or beyond buckling"
    )


def _equilibrium(of: Serial, force: Array, target: Array, hold: bool, steps: int) -> Equilibrium:
    """Equilibrium with forces (n,) and a target (..., 3), a load or (hold) a pose; nan where Newton does not converge.

    With joints q of unit stiffness, wrenches w at the ends of the chains and the pose u: `q = J' f + G' w`, the poses
    of the chains are u, and the wrenches sum up to the load.
    """
    V, r = of.basis, of.basis.shape[1]
    lead = np.broadcast_shapes(target.shape[:-1], of.chains[0].v.shape[:-1])
    q, wrench, u = np.zeros((*lead, r)), np.zeros((*lead, 9)), np.zeros((*lead, 3))
    lost = np.zeros(lead, dtype=bool)
    for share in np.arange(1, steps + 1) / steps:
        for _ in range(ITERATIONS):
            at = moved(of, q, wrench, share * force)
            M = np.zeros((*lead, r + 12, r + 12))
            M[..., :r, :r], M[..., :r, r:-3] = at.inner, -np.swapaxes(at.G, -1, -2)
            M[..., r:-3, :r], M[..., r:-3, -3:] = at.G, -ONE
            if hold:
                M[..., -3:, -3:], last = np.eye(3), share * target - u
            else:
                M[..., -3:, r:-3], last = ONE.T, share * target - wrench @ ONE
            pushed = share * force @ at.J
            first = pushed + apply(np.swapaxes(at.G, -1, -2), wrench) - q
            missing = np.concatenate([first, u @ ONE.T - at.pose, np.broadcast_to(last, (*lead, 3))], axis=-1)
            lost |= ~np.isfinite(M).all(axis=(-2, -1))
            M, missing = np.where(lost[..., None, None], np.eye(r + 12), M), np.where(lost[..., None], 0.0, missing)
            step = np.linalg.solve(M, missing[..., None])[..., 0]
            q, wrench, u = q + step[..., :r], wrench + step[..., r:-3], u + step[..., -3:]
            turns = [np.abs((step[..., :r] @ V.T)[..., each.place] * each.turn) for each in of.chains]
            lost |= ~(np.max(np.concatenate(turns, axis=-1), axis=-1) <= LARGEST_TURN)
            size = np.linalg.norm(q, axis=-1) + np.linalg.norm(at.J.T * share * force)
            small = np.linalg.norm(step[..., :r], axis=-1) <= STEP * size
            if np.all(small | lost):
                break
        lost |= ~small
    at = moved(of, q, wrench, force)
    q[lost] = np.nan
    return Equilibrium(u, wrench @ ONE, q, at.inner, at.G, at.J)


class JointState(NamedTuple):
    """Chains at joint displacements, in the r unknowns of `Serial`.

    pose : (..., 9), of their ends, mm and rad.   G : (..., 9, r), its change.   J : (n, r), change of the openings.
    inner : (..., r, r), unit stiffness less second derivatives times wrenches and forces, which (16) takes off.
    """

    pose: Array
    G: Array
    J: Array
    inner: Array


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
    frames = stage_frames(stage)
    G = freedom_motions(frames.centres[chain - 1] @ [1, 1j], np.exp(1j * frames.axes[chain - 1]))
    allowed = np.array([[kind in hinge for kind in KINDS] for hinge in result.freedoms[chain - 1]])
    R, pieces = chain_rotation(chain - 1), link_pieces(stage, chain, pushes) if result.links else []
    twists, shares, of_links = list[Array](), list[Array](), list[Array]()
    for link in range(3):  # the pad or a link, then the hinge at its end
        for _, c, at in (each for each in pieces if each.link == link):
            twists.append(np.concatenate(list(R @ np.linalg.cholesky(c)), axis=1))
            past = np.array([distal_share(push, link, at) for push in pushes]).reshape(len(pushes), len(at))
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
    at = moved(of._replace(basis=np.eye(len(links))), np.zeros(len(links)), np.zeros(9), np.zeros(of.n))
    rows = np.concatenate([at.G, at.J])[:, links]
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    _, values, V = np.linalg.svd(rows / np.where(size > 0, size, 1.0), full_matrices=False)
    kept = V[values > ROUND_OFF * np.max(values, initial=0.0)]
    alone = np.flatnonzero(~links)
    found = np.zeros((len(links), len(alone) + len(kept)))
    found[alone, np.arange(len(alone))] = 1.0
    found[links, len(alone) :] = kept.T
    return found


def moved(of: Serial, q: Array, wrench: Array, force: Array) -> JointState:
    """The chains at unknowns (..., r), with wrenches (..., 9) on their ends and forces (n,) of the stacks."""
    V, lead = of.basis, q.shape[:-1]
    eta, J = q @ V.T, np.zeros((of.n, len(V)))
    pose, G = np.zeros((*lead, 9)), np.zeros((*lead, 9, len(V)))
    inner = np.broadcast_to(np.eye(V.shape[1]), (*lead, V.shape[1], V.shape[1])).copy()
    for i, chain in enumerate(of.chains):
        mine, own, none = slice(3 * i, 3 * i + 3), eta[..., chain.place], np.zeros((*lead, 1))
        phi = own * chain.turn
        turned = np.cumsum(phi, axis=-1)
        spun = np.exp(1j * np.concatenate([none, turned], axis=-1))
        slid = own * chain.v * np.sinc(phi / (2 * np.pi)) * np.exp(0.5j * phi)
        # where what was at the platform centre has gone, by joint
        origin = np.concatenate([none, np.cumsum(spun[..., :-1] * slid, axis=-1)], axis=-1)
        v = spun[..., :-1] * chain.v - 1j * chain.turn * origin[..., :-1]
        end = v + 1j * chain.turn * origin[..., -1:]
        pose[..., mine] = np.stack([origin[..., -1].real, origin[..., -1].imag, turned[..., -1]], axis=-1)
        G[..., mine, chain.place] = np.stack([end.real, end.imag, np.broadcast_to(chain.turn, end.shape)], axis=-2)
        pull = wrench[..., 3 * i, None] - 1j * wrench[..., 3 * i + 1, None]
        terms = chain.turn[..., :, None] * (pull * 1j * end).real[..., None, :]
        for contact in chain.contacts:
            J[contact.stack, chain.place], nearer, farther = _opening(chain, contact, spun, origin, v)
            terms = terms + np.outer(force[contact.stack] * nearer, farther)
        upper = np.triu(terms)  # the first by the joint nearer the base
        inner -= V[chain.place].T @ (upper + np.swapaxes(np.triu(upper, 1), -1, -2)) @ V[chain.place]
    return JointState(pose, G @ V, J @ V, inner)


def _opening(
    chain: ChainJoints, of: ChainStack, spun: AnyArray, origin: AnyArray, v: AnyArray
) -> tuple[Array, Array, Array]:
    """Derivative (k,) of the opening of a stack by the joints, and two vectors (k,), by the joint nearer the base and
    by the farther one, whose products are its second derivatives.

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


PLACES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # between two commands; more change nothing above rounding


class Missed(NamedTuple):
    """Relative values (...), the largest over a box of poses.

    position : distance of the linear from the exact position, rotations by the lever.
    terms : change of the diagonal of the tangent compliance by the second-order terms.
    """

    position: Array
    terms: Array


def outwards(places: Array) -> tuple[Index, Index]:
    """Where ascending places are on either side of rest, from rest outwards."""
    return np.flatnonzero(places > 0), np.flatnonzero(places < 0)[::-1]


def along(commanded: Array, axis: int) -> Array:
    """Poses (..., 3) of commands (...) along one axis."""
    return np.asarray(commanded[..., None] * np.eye(3)[axis])


def summed_loads(of: PaperModel, commanded: Array, axis: int) -> dict[str, Array]:
    """Loads (n, 3) by summing the stiffness `tangent` and `without` from rest on; rest is one of the commands (n,)."""
    half = np.diff(commanded)[:, None] / 2
    found = at_pose(of, along(commanded[:-1, None] + half * (1 + PLACES), axis))
    loads = {}
    for name, each in (("without", found.without_terms), ("tangent", found)):
        steps = np.einsum("kq,kqi->ki", half * WEIGHTS, each.stiffness()[..., axis])
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        loads[name] = total - total[np.argmin(np.abs(commanded))]
    return loads


def at_every(of: PaperModel) -> PaperModel:
    """The mechanism with one more leading axis, for poses: each of its designs at each of them."""
    frames = Frames(of.frames.centres[..., None, :, :, :], of.frames.axes[..., None, :, :])
    return of._replace(frames=frames, springs=of.springs[..., None, :])


def missed(of: PaperModel, amplitude: Array, lever: ArrayLike) -> Missed:
    """What linear positions and tangents miss at corners, edges and faces of a box of poses (3,), mm and rad.

    of : with leading axes (...) of designs, or none.   lever : (...), mm.   Raises ComputationFailed as `at_pose`.
    """
    far = np.asarray(lever, dtype=float)
    poses = amplitude * np.array([np.subtract(place, 1.0) for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)])
    each, scale = at_every(of), np.stack([np.ones_like(far), np.ones_like(far), far], axis=-1)[..., None, :]
    found = at_pose(each, poses)
    off = np.linalg.norm((apply(stiffness(each).C_uu, found.load) - poses) * scale, axis=-1)
    with_, less = (np.diagonal(inverse(one.stiffness()), axis1=-2, axis2=-1) for one in (found, found.without_terms))
    position = np.max(off / np.linalg.norm(poses * scale, axis=-1), axis=-1)
    return Missed(position, np.max(np.abs(with_ / less - 1), axis=(-2, -1)))
