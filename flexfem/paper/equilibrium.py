"""Finite displacements: equilibrium under a load, at a pose, or under forces of the stacks.

Internal forces, including preloads, add to (16). A chain is elastic joints in series, base to
platform: hinges by rotation, axial and shear, in this order, as in `paper`, pieces of elastic
links, and the elastic platform. A stack with the force N and the opening g has the potential `-N g`
and adds `-N g''` to the tangent stiffness, which depends on the body that its force rotates with
and on a point of its line, `Stack.pivot`. The effect of an axial force on the stiffness of a notch
is neglected."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.analytic.network import freedom_motions
from flexfem.arrays import AnyArray, Array, Index, inverse
from flexfem.paper.contacts import Follows, Push, Stack
from flexfem.paper.designs import stage_frames
from flexfem.paper.equations import KINDS, PaperModel, apply, first_order, resting, stiffness
from flexfem.paper.frames import Frames, chain_rotation
from flexfem.paper.links import platform_compliance
from flexfem.paper.model import AnalyticResult
from flexfem.paper.responses import distal_share, link_pieces
from flexfem.paper.stage import CHAINS, Stage
from flexfem.refused import ComputationFailed

# last Newton step relative to the root of the energy; its error is of second order, below rounding
STEP = 1e-9
ITERATIONS = 25
LOAD_STEPS = (1, 4, 16, 64)
LARGEST_ROTATION = (
    0.1  # rad in one iteration; above it Newton may converge to another branch: the load is divided
)
# rad, of a joint; above it the stacks have buckled the stage, or their forces are far too large
BUCKLED = 0.3
ROUND_OFF = 1e-12  # relative to the largest singular value
TO_CHAINS = np.tile(np.eye(3), (3, 1))  # from the pose of the platform to those of the three chains
NO_STACKS = np.zeros(0)  # their forces or stiffnesses


class ChainStack(NamedTuple):
    """One stack as part of its chain, which has k joints.

    number : its index among the stacks.   pivot, direction : mm, and a unit vector, complex, at
    rest.
    near, far : (k,), share of the force on the body nearer the base, and on the other one, that
    acts distal to a joint.
    on_far : whether the pivot is fixed to the far body and the direction to the near one, or vice
    versa.
    sign : 1 where the far body is the actuated one, else -1.
    """

    number: int
    pivot: complex
    direction: complex
    near: Array
    far: Array
    on_far: bool
    sign: float


class ChainJoints(NamedTuple):
    """One chain as k elastic joints of unit stiffness in series, base to platform.

    slots : (k,), their indices in the stage.
    v, rotation : (..., k), complex and real, twist of the platform centre at rest; leading axes are
    designs."""

    slots: Index
    v: AnyArray
    rotation: Array
    stacks: tuple[ChainStack, ...]


class Serial(NamedTuple):
    """A stage of elastic joints with n stacks.

    basis : (size, r), motions of the joints in r unknowns. Every hinge and the platform have their
    own; pieces of links share those of a loaded chain or stack, which neglects terms of second
    order in the forces over their stiffness."""

    n: int
    chains: tuple[ChainJoints, ...]
    basis: Array


class Equilibrium(NamedTuple):
    """A stage in equilibrium with a load on the platform and the forces of its stacks, if any, in r
    unknowns.

    pose : (..., 3), mm and rad, relative to the unloaded stage.   load : (..., 3), on the platform,
    N and N mm.
    displacement : (..., r), in the unknowns of `Serial`; of the joints, rad and mm, from
    `under_load` and `at_pose`.
    hessian : (..., r, r), second derivatives of the energy and the potential of the loads.
    G : (..., 9, r), derivative of the poses of the chains.   J : (n, r), derivative of the
    openings. nan for a design whose loops are singular at rest."""

    pose: Array
    load: Array
    displacement: Array
    hessian: Array
    G: Array
    J: Array

    def stiffness(self, stacks: Array = NO_STACKS) -> Array:
        """Return the tangent stiffness (..., 3, 3) of the platform; stacks (n,), N/mm, hold their
        strokes.
        """
        hessian = self.hessian + (self.J.T * stacks) @ self.J
        G = self.G
        K = (
            TO_CHAINS.T @ inverse(G @ np.linalg.solve(hessian, np.swapaxes(G, -1, -2))) @ TO_CHAINS
        )  # (16) to (18)
        return np.asarray((K + np.swapaxes(K, -1, -2)) / 2)

    @property
    def without_terms(self) -> Equilibrium:
        """The same without the second-order terms of (16), `- tau_p o H_p - F_u o H_u`. Their sum
        does not depend on the choice of independent joints, but each term does."""
        return self._replace(
            hessian=np.broadcast_to(np.eye(self.hessian.shape[-1]), self.hessian.shape)
        )

    def stable(self, stacks: Array) -> bool:
        """Return whether the equilibrium is stable: every motion with closed loops increases the
        energy.
        """
        from scipy.linalg import null_space

        free = null_space(np.concatenate([self.G[:3] - self.G[3:6], self.G[:3] - self.G[6:]]))
        return bool(
            np.linalg.eigvalsh(free.T @ (self.hessian + (self.J.T * stacks) @ self.J) @ free)[0] > 0
        )


def under_load(model: PaperModel, load: Array) -> Equilibrium:
    """Return the equilibrium under a dead platform load (..., 3): force at the moving platform
    centre, and moment.

    Raises ComputationFailed when Newton's method does not converge even in the smallest load steps.
    """
    return _paper_equilibrium(model, np.asarray(load, dtype=float), hold=False)


def at_pose(model: PaperModel, pose: Array) -> Equilibrium:
    """Return the equilibrium with the platform held exactly at the displacement `pose` (..., 3), mm
    and rad.

    Raises ComputationFailed as `under_load`, and when the pose is out of reach.
    """
    return _paper_equilibrium(model, np.asarray(pose, dtype=float), hold=True)


def loaded(joints: Serial, force: Array, load: Array) -> Equilibrium:
    """Return the exact equilibrium with constant forces (n,) of the stacks, N, and a dead load (3,)
    as in (16).

    Raises ComputationFailed when Newton does not converge: the stage has buckled, or the forces are
    far too large."""
    equilibrium = _equilibrium(joints, force, load, False, 1)
    eta = joints.basis @ equilibrium.displacement
    largest = max(np.max(np.abs(eta[chain.slots] * chain.rotation)) for chain in joints.chains)
    if not largest <= BUCKLED:  # also raises for nan
        raise ComputationFailed(
            "no equilibrium with these stack forces: they reach or exceed the buckling load"
        )
    return equilibrium


def _paper_equilibrium(model: PaperModel, target: Array, hold: bool) -> Equilibrium:
    root = np.sqrt(model.springs)
    chains = []
    coefficients = first_order(model.joints, resting(model.frames, model.joints))
    for G, slots in zip(coefficients, model.joints.chains, strict=True):
        x, y, rotation = np.moveaxis(G / root[..., None, slots], -2, 0)
        chains.append(ChainJoints(np.arange(slots.start, slots.stop), x + 1j * y, rotation, ()))
    joints = Serial(0, tuple(chains), np.eye(root.shape[-1]))
    singular = np.asarray(np.isnan(stiffness(model).K_uu).any(axis=(-2, -1)))
    for steps in LOAD_STEPS:
        equilibrium = _equilibrium(joints, NO_STACKS, target, hold, steps)
        diverged = np.asarray(np.isnan(equilibrium.displacement).any(axis=-1) & ~singular)
        if not diverged.any():
            pose, load = (np.where(singular[..., None], np.nan, part) for part in equilibrium[:2])
            return equilibrium._replace(
                pose=pose, load=load, displacement=equilibrium.displacement / root
            )
    failed = np.argwhere(diverged)
    where = (
        f", design {tuple(failed[0].tolist())} the first of {len(failed)}" if diverged.shape else ""
    )
    goal = "holding the pose" if hold else "under the load"
    raise ComputationFailed(
        f"no equilibrium {goal}{where}: Newton's method on (13) did not converge in "
        f"{LOAD_STEPS[-1]} load steps; the target is beyond a singular configuration or beyond "
        "buckling"
    )


def _equilibrium(
    joints: Serial, force: Array, target: Array, hold: bool, steps: int
) -> Equilibrium:
    """Equilibrium with forces (n,) and a target (..., 3), a load or (hold) a pose; nan where Newton
    does not converge.

    With joint displacements q of unit stiffness, wrenches w at the ends of the chains and the pose
    u, `q = J' f + G' w`, the poses of the chains are u, and the wrenches add up to the load."""
    V = joints.basis
    r = joints.basis.shape[1]
    lead = np.broadcast_shapes(target.shape[:-1], joints.chains[0].v.shape[:-1])
    q = np.zeros((*lead, r))
    w = np.zeros((*lead, 9))
    u = np.zeros((*lead, 3))
    diverged = np.zeros(lead, dtype=bool)
    for share in np.arange(1, steps + 1) / steps:
        for _ in range(ITERATIONS):
            at = joint_state(joints, q, w, share * force)
            M = np.zeros((*lead, r + 12, r + 12))
            M[..., :r, :r], M[..., :r, r:-3] = at.hessian, -np.swapaxes(at.G, -1, -2)
            M[..., r:-3, :r] = at.G
            M[..., r:-3, -3:] = -TO_CHAINS
            if hold:
                M[..., -3:, -3:] = np.eye(3)
                last = share * target - u
            else:
                M[..., -3:, r:-3] = TO_CHAINS.T
                last = share * target - w @ TO_CHAINS
            first = share * force @ at.J + apply(np.swapaxes(at.G, -1, -2), w) - q
            residual = np.concatenate(
                [first, u @ TO_CHAINS.T - at.pose, np.broadcast_to(last, (*lead, 3))], axis=-1
            )
            diverged |= ~np.isfinite(M).all(axis=(-2, -1))
            M = np.where(diverged[..., None, None], np.eye(r + 12), M)
            step = np.linalg.solve(M, np.where(diverged[..., None], 0.0, residual)[..., None])[
                ..., 0
            ]
            q = q + step[..., :r]
            w = w + step[..., r:-3]
            u = u + step[..., -3:]
            eta = step[..., :r] @ V.T
            rotations = [np.abs(eta[..., chain.slots] * chain.rotation) for chain in joints.chains]
            diverged |= ~(np.max(np.concatenate(rotations, axis=-1), axis=-1) <= LARGEST_ROTATION)
            size = np.linalg.norm(q, axis=-1) + np.linalg.norm(at.J.T * share * force)
            converged = np.linalg.norm(step[..., :r], axis=-1) <= STEP * size
            if np.all(converged | diverged):
                break
        diverged |= ~converged
    at = joint_state(joints, q, w, force)
    q[diverged] = np.nan
    return Equilibrium(u, w @ TO_CHAINS, q, at.hessian, at.G, at.J)


class JointState(NamedTuple):
    """Chains at joint displacements, in the r unknowns of `Serial`.

    pose : (..., 9), of their ends, mm and rad.   G : (..., 9, r), J : (n, r), derivatives of the
    poses and openings.
    hessian : (..., r, r), unit stiffness less second derivatives times wrenches and forces, as in
    (16)."""

    pose: Array
    G: Array
    J: Array
    hessian: Array


def serial(
    stage: Stage, result: AnalyticResult, stacks: tuple[Stack, ...], follows: Follows
) -> Serial:
    """Return the joints of a stage with the hinges, freedoms and, if any, elastic links of its
    analytic model.
    """
    body = np.zeros((9, 0))
    if (
        result.links
    ):  # motions of the ends of the chains relative to the hub, by nine joints of unit stiffness
        values, vectors = np.linalg.eigh(platform_compliance(stage, stage.elastic))
        body = vectors * np.sqrt(np.maximum(values, 0.0))
    shared = np.arange(body.shape[1])
    size = body.shape[1]
    chains = list[ChainJoints]()
    is_link = [np.zeros(size, dtype=bool)]
    for chain in CHAINS:
        numbers = [j for j, stack in enumerate(stacks) if stack.chain == chain - 1]
        twists, shares, on_links = _joints(
            stage, chain, result, [push for j in numbers for push in stacks[j].pushes]
        )
        slots = np.concatenate([size + np.arange(twists.shape[1]), shared])
        twists = np.append(twists, -body[3 * chain - 3 : 3 * chain], axis=1)
        shares = np.pad(
            shares, ((0, 0), (0, len(shared))), mode="edge"
        )  # the platform is distal to all its hinges
        pairs = zip(numbers, shares.reshape(len(numbers), 2, len(slots)), strict=True)
        chain_stacks = tuple(_chain_stack(j, stacks[j], share, follows) for j, share in pairs)
        chains.append(ChainJoints(slots, twists[0] + 1j * twists[1], twists[2], chain_stacks))
        is_link.append(on_links)
        size += on_links.size
    joints = Serial(len(stacks), tuple(chains), np.zeros((size, 0)))
    return joints._replace(basis=_basis(joints, np.concatenate(is_link)))


def _chain_stack(number: int, stack: Stack, shares: Array, follows: Follows) -> ChainStack:
    """A stack with the shares (2, k) of its forces on the actuated body and on its carrier distal
    to each joint.
    """
    outward = stack.pushes[0].body > stack.pushes[1].body
    far, near = shares if outward else shares[::-1]
    rotation = complex(*chain_rotation(stack.chain)[:2, 0])
    on_far = outward == (follows == "carrier")
    sign = 1.0 if outward else -1.0
    return ChainStack(
        number, rotation * stack.pivot(follows), rotation * stack.direction, near, far, on_far, sign
    )


def _joints(
    stage: Stage, chain: int, result: AnalyticResult, pushes: list[Push]
) -> tuple[Array, Array, Array]:
    """Twists (3, k) of the joints of a chain, shares (pushes, k) distal to them, and which are
    pieces of links.
    """
    root = np.sqrt(np.stack(np.broadcast_arrays(*result.hinges), axis=-1))[chain - 1]
    frames = stage_frames(stage)
    G = freedom_motions(frames.centres[chain - 1] @ [1, 1j], np.exp(1j * frames.axes[chain - 1]))
    allowed = np.array([[kind in hinge for kind in KINDS] for hinge in result.freedoms[chain - 1]])
    R = chain_rotation(chain - 1)
    pieces = link_pieces(stage, chain, pushes) if result.links else []
    twists = list[Array]()
    shares = list[Array]()
    is_link = list[bool]()
    for link in range(3):  # the pad or a link, then the hinge at its end
        parts = [
            (list(R @ np.linalg.cholesky(compliance)), at)
            for k, compliance, at in pieces
            if k == link
        ]
        for motions, at in [
            *parts,
            ([(G[link] * root[link])[:, allowed[link]]], np.array([np.inf])),
        ]:
            twists += motions
            share = np.array([distal_share(push, link, at) for push in pushes]).reshape(
                len(pushes), len(at)
            )
            shares.append(np.repeat(share, motions[0].shape[1], axis=1))
            is_link += [bool(at[0] < np.inf)] * shares[-1].shape[1]
    return np.concatenate(twists, axis=1), np.concatenate(shares, axis=1), np.array(is_link)


def _basis(joints: Serial, is_link: NDArray[np.bool_]) -> Array:
    """The basis of `Serial`; is_link : (size,), which joints are pieces of links."""
    size = len(is_link)
    at = joint_state(
        joints._replace(basis=np.eye(size)), np.zeros(size), np.zeros(9), np.zeros(joints.n)
    )
    rows = np.concatenate([at.G, at.J])[:, is_link]
    norm = np.linalg.norm(rows, axis=1, keepdims=True)
    _, values, V = np.linalg.svd(rows / np.where(norm > 0, norm, 1.0), full_matrices=False)
    modes = V[values > ROUND_OFF * np.max(values, initial=0.0)]
    links = np.zeros((size, len(modes)))
    links[is_link] = modes.T
    return np.concatenate([np.eye(size)[:, ~is_link], links], axis=1)


def joint_state(joints: Serial, q: Array, wrench: Array, force: Array) -> JointState:
    """Return the chains at unknowns (..., r), with wrenches (..., 9) on their ends and forces (n,)
    of the stacks.
    """
    V = joints.basis
    lead = q.shape[:-1]
    eta = q @ V.T
    J = np.zeros((joints.n, len(V)))
    pose = np.zeros((*lead, 9))
    G = np.zeros((*lead, 9, len(V)))
    hessian = np.broadcast_to(np.eye(V.shape[1]), (*lead, V.shape[1], V.shape[1])).copy()
    for i, chain in enumerate(joints.chains):
        rows = slice(3 * i, 3 * i + 3)
        motion = eta[..., chain.slots]
        zero = np.zeros((*lead, 1))
        phi = motion * chain.rotation
        psi = np.cumsum(phi, axis=-1)
        rotor = np.exp(1j * np.concatenate([zero, psi], axis=-1))
        chord = motion * chain.v * np.sinc(phi / (2 * np.pi)) * np.exp(0.5j * phi)
        # displacement, by body, of the point that was at the platform centre
        origin = np.concatenate([zero, np.cumsum(rotor[..., :-1] * chord, axis=-1)], axis=-1)
        v = rotor[..., :-1] * chain.v - 1j * chain.rotation * origin[..., :-1]
        end = v + 1j * chain.rotation * origin[..., -1:]
        pose[..., rows] = np.stack(
            [origin[..., -1].real, origin[..., -1].imag, psi[..., -1]], axis=-1
        )
        G[..., rows, chain.slots] = np.stack(
            [end.real, end.imag, np.broadcast_to(chain.rotation, end.shape)], axis=-2
        )
        F = wrench[..., 3 * i, None] - 1j * wrench[..., 3 * i + 1, None]
        terms = chain.rotation[..., :, None] * (F * 1j * end).real[..., None, :]
        for stack in chain.stacks:
            J[stack.number, chain.slots], proximal, distal = _opening_derivatives(
                chain, stack, rotor, origin, v
            )
            terms = terms + np.outer(force[stack.number] * proximal, distal)
        upper = np.triu(terms)  # the row is the joint nearer the base
        hessian -= (
            V[chain.slots].T @ (upper + np.swapaxes(np.triu(upper, 1), -1, -2)) @ V[chain.slots]
        )
    return JointState(pose, G @ V, J @ V, hessian)


def _opening_derivatives(
    chain: ChainJoints, stack: ChainStack, rotor: AnyArray, origin: AnyArray, v: AnyArray
) -> tuple[Array, Array, Array]:
    """First derivative (k,) of the opening of a stack with respect to the joints, and two vectors
    (k,), for the proximal and the distal joint, whose products are its second derivatives.

    With the pivot on the far body, a proximal joint rotates the motion of the pivot by a distal
    one; with the pivot on the near body, as seen from the far one, the distal joint does. Only
    joints between the two bodies count."""
    far, near = (-np.diff(share, prepend=1.0, append=0.0) for share in (stack.far, stack.near))
    of_pivot, of_direction = (far, near) if stack.on_far else (near, far)
    pivot = np.sum(of_pivot * (origin + rotor * stack.pivot))
    direction = stack.direction * np.sum(of_direction * rotor)
    velocity = v + 1j * chain.rotation * pivot
    rate = (np.conj(direction) * velocity).real
    bend = stack.sign * (np.conj(direction) * 1j * velocity).real
    proximal, distal = (chain.rotation, bend) if stack.on_far else (-bend, chain.rotation)
    return (
        stack.sign * (stack.far - stack.near) * rate,
        (1 - stack.near) * proximal,
        stack.far * distal,
    )


NODES, WEIGHTS = np.polynomial.legendre.leggauss(
    4
)  # between two commands; more change nothing above rounding


class LinearErrors(NamedTuple):
    """Relative errors (...) of the linear theory, the largest over a box of poses.

    position : distance of the linear from the exact position; rotations are multiplied by the
    lever.
    terms : change of the diagonal of the tangent compliance by the second-order terms.
    """

    position: Array
    terms: Array


def outwards(places: Array) -> tuple[Index, Index]:
    """Return the indices of ascending places above and below rest, each from rest outwards."""
    return np.flatnonzero(places > 0), np.flatnonzero(places < 0)[::-1]


def axis_poses(commanded: Array, axis: int) -> Array:
    """Return the poses (..., 3) of commands (...) along one axis."""
    return np.asarray(commanded[..., None] * np.eye(3)[axis])


def summed_loads(model: PaperModel, commanded: Array, axis: int) -> dict[str, Array]:
    """Return loads (n, 3) at commands (n,), one of them rest: integrals of the stiffness `tangent`
    and `without`.
    """
    half = np.diff(commanded)[:, None] / 2
    exact = at_pose(model, axis_poses(commanded[:-1, None] + half * (1 + NODES), axis))
    loads = {}
    for name, equilibrium in (("without", exact.without_terms), ("tangent", exact)):
        steps = np.einsum("kq,kqi->ki", half * WEIGHTS, equilibrium.stiffness()[..., axis])
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        loads[name] = total - total[np.argmin(np.abs(commanded))]
    return loads


def with_pose_axis(model: PaperModel) -> PaperModel:
    """Return the model with one more leading axis, for several poses of each of its designs."""
    frames = Frames(model.frames.centres[..., None, :, :, :], model.frames.axes[..., None, :, :])
    return model._replace(frames=frames, springs=model.springs[..., None, :])


def linear_errors(model: PaperModel, amplitude: Array, lever: ArrayLike) -> LinearErrors:
    """Return the errors of linear positions and tangents at corners, edges and faces of a box of
    poses (3,), mm, rad.

    model : with leading axes (...) of designs, or none.   lever : (...), mm.   Raises
    ComputationFailed as `at_pose`."""
    arm = np.asarray(lever, dtype=float)
    poses = amplitude * np.array(
        [np.subtract(place, 1.0) for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)]
    )
    model = with_pose_axis(model)
    scale = np.stack([np.ones_like(arm), np.ones_like(arm), arm], axis=-1)[..., None, :]
    exact = at_pose(model, poses)
    distance = np.linalg.norm((apply(stiffness(model).C_uu, exact.load) - poses) * scale, axis=-1)
    tangents = (inverse(state.stiffness()) for state in (exact, exact.without_terms))
    with_terms, without = (np.diagonal(compliance, axis1=-2, axis2=-1) for compliance in tangents)
    position = np.max(distance / np.linalg.norm(poses * scale, axis=-1), axis=-1)
    return LinearErrors(position, np.max(np.abs(with_terms / without - 1), axis=(-2, -1)))
