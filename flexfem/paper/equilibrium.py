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
# rad in one iteration; above it Newton may converge to another branch: the load is divided
LARGEST_ROTATION = 0.1
# rad, of a joint; above it the stacks have buckled the stage, or their forces are far too large
BUCKLED = 0.3
ROUND_OFF = 1e-12  # relative to the largest singular value
TO_CHAINS = np.tile(np.eye(3), (3, 1))  # from the pose of the platform to those of the three chains
NO_STACKS = np.zeros(0)  # their forces or stiffnesses


class ChainStack(NamedTuple):
    """One stack as part of its chain, which has k joints.

    number : its index among the stacks.
    pivot, direction : mm, and a unit vector, complex, at rest.
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
        designs.
    """

    slots: Index
    v: AnyArray
    rotation: Array
    stacks: tuple[ChainStack, ...]


class Serial(NamedTuple):
    """A stage of elastic joints with n stacks.

    basis : (size, r), motions of the joints in r unknowns. Every hinge and the platform have their
        own; pieces of links share those of a loaded chain or stack, which neglects terms of second
        order in the forces over their stiffness.
    """

    n: int
    chains: tuple[ChainJoints, ...]
    basis: Array


class Equilibrium(NamedTuple):
    """A stage in equilibrium with a load on the platform and its stacks, if any; r unknowns.

    pose : (..., 3), mm and rad, relative to the unloaded stage.
    load : (..., 3), on the platform, N and N mm.
    displacement : (..., r), in the unknowns of `Serial`; of the joints, rad and mm, from
        `under_load` and `at_pose`.
    hessian : (..., r, r), second derivatives of the energy and the potential of the loads.
    G : (..., 9, r), derivative of the poses of the chains.
    J : (n, r), derivative of the openings. nan for a design whose loops are singular at rest.
    """

    pose: Array
    load: Array
    displacement: Array
    hessian: Array
    G: Array
    J: Array

    def stiffness(self, stacks: Array = NO_STACKS) -> Array:
        """Return the tangent stiffness (..., 3, 3) of the platform.

        stacks : (n,), N/mm, of those that hold their strokes.
        """
        hessian = self.hessian + (self.J.T * stacks) @ self.J
        compliance = self.G @ np.linalg.solve(hessian, np.swapaxes(self.G, -1, -2))
        K = TO_CHAINS.T @ inverse(compliance) @ TO_CHAINS  # (16) to (18)
        return np.asarray((K + np.swapaxes(K, -1, -2)) / 2)

    @property
    def without_terms(self) -> Equilibrium:
        """The same without the second-order terms of (16), `- tau_p o H_p - F_u o H_u`.

        Their sum does not depend on the choice of independent joints, but each term does.
        """
        return self._replace(
            hessian=np.broadcast_to(np.eye(self.hessian.shape[-1]), self.hessian.shape)
        )

    def stable(self, stacks: Array) -> bool:
        """Return whether every motion with closed loops increases the energy."""
        from scipy.linalg import null_space

        free = null_space(np.concatenate([self.G[:3] - self.G[3:6], self.G[:3] - self.G[6:]]))
        hessian = self.hessian + (self.J.T * stacks) @ self.J
        return bool(np.linalg.eigvalsh(free.T @ hessian @ free)[0] > 0)


def under_load(model: PaperModel, load: Array) -> Equilibrium:
    """Return the equilibrium under a dead load (..., 3) at the moving centre of the platform.

    Raises ComputationFailed when Newton's method does not converge even in the smallest load steps.
    """
    return _paper_equilibrium(model, np.asarray(load, dtype=float), hold=False)


def at_pose(model: PaperModel, pose: Array) -> Equilibrium:
    """Return the equilibrium with the platform held at a displacement (..., 3), mm and rad.

    Raises ComputationFailed as `under_load`, and when the pose is out of reach.
    """
    return _paper_equilibrium(model, np.asarray(pose, dtype=float), hold=True)


def loaded(
    joints: Serial,
    force: Array,
    load: Array,
) -> Equilibrium:
    """Return the equilibrium with constant forces (n,) of the stacks, N, and a dead load (3,).

    It is exact, as in (16).

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


def _paper_equilibrium(
    model: PaperModel,
    target: Array,
    hold: bool,
) -> Equilibrium:
    joints = _serial_of(model)
    singular = np.asarray(np.isnan(stiffness(model).K_uu).any(axis=(-2, -1)))
    for steps in LOAD_STEPS:
        found = _equilibrium(joints, NO_STACKS, target, hold, steps)
        diverged = np.asarray(np.isnan(found.displacement).any(axis=-1) & ~singular)
        if not diverged.any():
            of_singular = singular[..., None]
            return found._replace(
                pose=np.where(of_singular, np.nan, found.pose),
                load=np.where(of_singular, np.nan, found.load),
                displacement=found.displacement / np.sqrt(model.springs),
            )
    failed = np.argwhere(diverged)
    where = ""
    if diverged.shape:
        where = f", design {tuple(failed[0].tolist())} the first of {len(failed)}"
    goal = "holding the pose" if hold else "under the load"
    raise ComputationFailed(
        f"no equilibrium {goal}{where}: Newton's method on (13) did not converge in "
        f"{LOAD_STEPS[-1]} load steps; the target is beyond a singular configuration or beyond "
        "buckling"
    )


def _serial_of(model: PaperModel) -> Serial:
    """Return the joints of the paper's model, scaled to unit stiffness."""
    root = np.sqrt(model.springs)
    chains = list[ChainJoints]()
    coefficients = first_order(model.joints, resting(model.frames, model.joints))
    for G, slots in zip(coefficients, model.joints.chains, strict=True):
        x, y, rotation = np.moveaxis(G / root[..., None, slots], -2, 0)
        chains.append(ChainJoints(np.arange(slots.start, slots.stop), x + 1j * y, rotation, ()))
    return Serial(0, tuple(chains), np.eye(root.shape[-1]))


class _Unknowns(NamedTuple):
    """Unknowns of the equilibrium.

    q : (..., r), joint displacements of unit stiffness.
    w : (..., 9), wrenches at the ends of the chains.
    u : (..., 3), the pose.
    """

    q: Array
    w: Array
    u: Array

    def moved(self, step: Array) -> _Unknowns:
        """Add a step (..., r + 12)."""
        r = self.q.shape[-1]
        q = self.q + step[..., :r]
        w = self.w + step[..., r:-3]
        u = self.u + step[..., -3:]
        return _Unknowns(q, w, u)


def _equilibrium(
    joints: Serial, force: Array, target: Array, hold: bool, steps: int
) -> Equilibrium:
    """Equilibrium with forces (n,) of the stacks; nan where Newton's method does not converge.

    target : (..., 3), a load or (hold) a pose.

    Notes
    -----
    With the unknowns q, w and u, `q = J' f + G' w`, the poses of the chains are u, and the wrenches
    add up to the load.
    """
    lead = np.broadcast_shapes(target.shape[:-1], joints.chains[0].v.shape[:-1])
    r = joints.basis.shape[1]
    x = _Unknowns(np.zeros((*lead, r)), np.zeros((*lead, 9)), np.zeros((*lead, 3)))
    diverged = np.zeros(lead, dtype=bool)
    for share in np.arange(1, steps + 1) / steps:
        x, diverged = _newton(joints, share * force, share * target, hold, x, diverged)
    at = joint_state(joints, x.q, x.w, force)
    x.q[diverged] = np.nan
    return Equilibrium(x.u, x.w @ TO_CHAINS, x.q, at.hessian, at.G, at.J)


def _newton(
    joints: Serial,
    force: Array,
    target: Array,
    hold: bool,
    x: _Unknowns,
    diverged: NDArray[np.bool_],
) -> tuple[_Unknowns, NDArray[np.bool_]]:
    """Return the unknowns at a target as of `_equilibrium`, and which designs diverge."""
    for _ in range(ITERATIONS):
        at = joint_state(joints, x.q, x.w, force)
        M = _newton_matrix(at, hold)
        residual = _residual(at, x, force, target, hold)
        diverged = diverged | ~np.isfinite(M).all(axis=(-2, -1))
        M = np.where(diverged[..., None, None], np.eye(M.shape[-1]), M)
        right = np.where(diverged[..., None], 0.0, residual)[..., None]
        step = np.asarray(np.linalg.solve(M, right)[..., 0])
        x = x.moved(step)
        change = step[..., : x.q.shape[-1]]
        diverged |= ~(_largest_rotation(joints, change) <= LARGEST_ROTATION)
        size = np.linalg.norm(x.q, axis=-1) + np.linalg.norm(at.J.T * force)
        converged = np.linalg.norm(change, axis=-1) <= STEP * size
        if np.all(converged | diverged):
            break
    return x, diverged | ~converged


def _newton_matrix(at: JointState, hold: bool) -> Array:
    """Derivative (..., r + 12, r + 12) of the equations of `_equilibrium` by the unknowns."""
    r = at.hessian.shape[-1]
    M = np.zeros((*at.hessian.shape[:-2], r + 12, r + 12))
    M[..., :r, :r] = at.hessian
    M[..., :r, r:-3] = -np.swapaxes(at.G, -1, -2)
    M[..., r:-3, :r] = at.G
    M[..., r:-3, -3:] = -TO_CHAINS
    if hold:
        M[..., -3:, -3:] = np.eye(3)
    else:
        M[..., -3:, r:-3] = TO_CHAINS.T
    return M


def _residual(
    at: JointState,
    x: _Unknowns,
    force: Array,
    target: Array,
    hold: bool,
) -> Array:
    """What is left (..., r + 12) of the equations of `_equilibrium`."""
    of_joints = force @ at.J + apply(np.swapaxes(at.G, -1, -2), x.w) - x.q
    of_poses = x.u @ TO_CHAINS.T - at.pose
    of_target = target - (x.u if hold else x.w @ TO_CHAINS)
    last = np.broadcast_to(of_target, (*x.u.shape[:-1], 3))
    return np.concatenate([of_joints, of_poses, last], axis=-1)


def _largest_rotation(joints: Serial, change: Array) -> Array:
    """Largest rotation (...), rad, of a joint by changes (..., r) of the unknowns."""
    eta = change @ joints.basis.T
    rotations = [np.abs(eta[..., chain.slots] * chain.rotation) for chain in joints.chains]
    return np.asarray(np.max(np.concatenate(rotations, axis=-1), axis=-1))


class JointState(NamedTuple):
    """Chains at joint displacements, in the r unknowns of `Serial`.

    pose : (..., 9), of their ends, mm and rad.
    G : (..., 9, r), J : (n, r), derivatives of the poses and openings.
    hessian : (..., r, r), unit stiffness less second derivatives times wrenches and forces, as in
        (16).
    """

    pose: Array
    G: Array
    J: Array
    hessian: Array


def serial(
    stage: Stage, result: AnalyticResult, stacks: tuple[Stack, ...], follows: Follows
) -> Serial:
    """Return the joints of a stage with the hinges, freedoms and links of its analytic model."""
    platform = _platform_joints(stage) if result.links else np.zeros((9, 0))
    size = platform.shape[1]
    chains = list[ChainJoints]()
    is_link = [np.zeros(size, dtype=bool)]
    for chain in CHAINS:
        numbers = _stacks_on(stacks, chain)
        own = _joints(stage, chain, result, [push for j in numbers for push in stacks[j].pushes])
        to_hub = -platform[3 * chain - 3 : 3 * chain]
        joints = _with_platform(own, to_hub, size)
        shares = _shares_with_platform(own, to_hub).reshape(len(numbers), 2, len(joints.slots))
        own_stacks = [
            _chain_stack(j, stacks[j], share, follows)
            for j, share in zip(numbers, shares, strict=True)
        ]
        chains.append(joints._replace(stacks=tuple(own_stacks)))
        is_link.append(own.is_link)
        size += own.is_link.size
    whole = Serial(len(stacks), tuple(chains), np.zeros((size, 0)))
    return whole._replace(basis=_basis(whole, np.concatenate(is_link)))


def _stacks_on(stacks: tuple[Stack, ...], chain: int) -> list[int]:
    """Return the numbers of the stacks of a chain (1 to 3)."""
    return [number for number, stack in enumerate(stacks) if stack.chain == chain - 1]


def _with_platform(
    own: _OwnJoints,
    to_hub: Array,
    first: int,
) -> ChainJoints:
    """Return the joints of a chain, numbered from `first`, then those of the platform, from 0.

    All chains share the latter. to_hub : (3, p), their twists.
    """
    slots = np.concatenate([first + np.arange(len(own.is_link)), np.arange(to_hub.shape[1])])
    twists = np.append(own.twists, to_hub, axis=1)
    return ChainJoints(slots, twists[0] + 1j * twists[1], twists[2], ())


def _shares_with_platform(own: _OwnJoints, to_hub: Array) -> Array:
    """Return the shares (pushes, k + p) of forces; the platform is distal to all its hinges."""
    return np.pad(own.shares, ((0, 0), (0, to_hub.shape[1])), mode="edge")


def _platform_joints(stage: Stage) -> Array:
    """Motions (9, 9) of the ends of the chains relative to the hub, by joints of unit stiffness."""
    values, vectors = np.linalg.eigh(platform_compliance(stage, stage.elastic))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _chain_stack(
    number: int,
    stack: Stack,
    shares: Array,
    follows: Follows,
) -> ChainStack:
    """Return a stack as part of its chain.

    shares : (2, k), of its forces on the actuated body and on its carrier distal to each joint.
    """
    outward = stack.pushes[0].body > stack.pushes[1].body
    far, near = shares if outward else shares[::-1]
    rotation = complex(*chain_rotation(stack.chain)[:2, 0])
    pivot = rotation * stack.pivot(follows)
    on_far = outward == (follows == "carrier")
    sign = 1.0 if outward else -1.0
    return ChainStack(number, pivot, rotation * stack.direction, near, far, on_far, sign)


class _OwnJoints(NamedTuple):
    """The k joints of one chain: its hinges and pieces of links.

    twists : (3, k).   shares : (pushes, k), of forces distal to them.   is_link : (k,).
    """

    twists: Array
    shares: Array
    is_link: NDArray[np.bool_]


def _joints(
    stage: Stage,
    chain: int,
    result: AnalyticResult,
    pushes: list[Push],
) -> _OwnJoints:
    """Return the joints of a chain; where pushes act, there are shares of their forces."""
    pieces = link_pieces(stage, chain, pushes) if result.links else []
    R = chain_rotation(chain - 1)
    twists = list[Array]()
    shares = list[Array]()
    is_link = list[bool]()
    for link, of_hinge in enumerate(_hinge_twists(stage, chain, result)):
        # the pad or a link, then the hinge at its end
        parts = [
            (list(R @ np.linalg.cholesky(compliance)), at)
            for number, compliance, at in pieces
            if number == link
        ]
        for motions, at in [*parts, ([of_hinge], np.array([np.inf]))]:
            twists += motions
            distal = [distal_share(push, link, at) for push in pushes]
            share = np.array(distal).reshape(len(pushes), len(at))
            shares.append(np.repeat(share, motions[0].shape[1], axis=1))
            is_link += [bool(at[0] < np.inf)] * shares[-1].shape[1]
    return _OwnJoints(
        np.concatenate(twists, axis=1), np.concatenate(shares, axis=1), np.array(is_link)
    )


def _hinge_twists(
    stage: Stage,
    chain: int,
    result: AnalyticResult,
) -> list[Array]:
    """Return the twists (3, k) of the k freedoms of each hinge of a chain, of unit stiffness."""
    root = np.sqrt(np.stack(np.broadcast_arrays(*result.hinges), axis=-1))[chain - 1]
    frames = stage_frames(stage)
    places = frames.centres[chain - 1] @ [1, 1j]
    G = freedom_motions(places, np.exp(1j * frames.axes[chain - 1]))
    found = list[Array]()
    for hinge, freedoms in enumerate(result.freedoms[chain - 1]):
        allowed = [kind in freedoms for kind in KINDS]
        found.append((G[hinge] * root[hinge])[:, allowed])
    return found


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


class _ChainBodies(NamedTuple):
    """Bodies of a chain of k joints, base to platform, at joint displacements.

    rotor : (..., k + 1), complex, rotations.
    origin : (..., k + 1), complex, displacements of the point that was at the platform centre.
    v : (..., k), complex, motion of this point of the whole distal part, per motion of a joint.
    turn : (...), rad, of the last body.
    """

    rotor: AnyArray
    origin: AnyArray
    v: AnyArray
    turn: Array

    @property
    def pose(self) -> Array:
        """Pose (..., 3) of the last body."""
        last = self.origin[..., -1]
        return np.stack([last.real, last.imag, self.turn], axis=-1)


def _bodies_of(chain: ChainJoints, motion: Array) -> _ChainBodies:
    """Return the bodies of a chain at joint displacements (..., k)."""
    zero = np.zeros((*motion.shape[:-1], 1))
    phi = motion * chain.rotation
    psi = np.cumsum(phi, axis=-1)
    rotor = np.exp(1j * np.concatenate([zero, psi], axis=-1))
    chord = motion * chain.v * np.sinc(phi / (2 * np.pi)) * np.exp(0.5j * phi)
    origin = np.concatenate([zero, np.cumsum(rotor[..., :-1] * chord, axis=-1)], axis=-1)
    v = rotor[..., :-1] * chain.v - 1j * chain.rotation * origin[..., :-1]
    return _ChainBodies(rotor, origin, v, psi[..., -1])


def joint_state(
    joints: Serial,
    q: Array,
    wrench: Array,
    force: Array,
) -> JointState:
    """Return the chains at unknowns (..., r).

    wrench : (..., 9), on the ends of the chains.   force : (n,), of the stacks.
    """
    V = joints.basis
    lead = q.shape[:-1]
    eta = q @ V.T
    J = np.zeros((joints.n, len(V)))
    pose = np.zeros((*lead, 9))
    G = np.zeros((*lead, 9, len(V)))
    hessian = np.tile(np.eye(V.shape[1]), (*lead, 1, 1))
    for i, chain in enumerate(joints.chains):
        rows = slice(3 * i, 3 * i + 3)
        bodies = _bodies_of(chain, eta[..., chain.slots])
        pose[..., rows] = bodies.pose
        end = _end_motions(chain, bodies)
        G[..., rows, chain.slots] = end
        terms = chain.rotation[..., :, None] * _turned_work(wrench[..., rows], end)[..., None, :]
        for stack in chain.stacks:
            opening = _opening_derivatives(chain, stack, bodies)
            J[stack.number, chain.slots] = opening.first
            terms = terms + np.outer(force[stack.number] * opening.proximal, opening.distal)
        hessian -= V[chain.slots].T @ _symmetric(terms) @ V[chain.slots]
    return JointState(pose, G @ V, J @ V, hessian)


def _end_motions(chain: ChainJoints, bodies: _ChainBodies) -> Array:
    """Return the motions (..., 3, k) of the end of a chain per motion of each joint."""
    end = bodies.v + 1j * chain.rotation * bodies.origin[..., -1:]
    rotation = np.broadcast_to(chain.rotation, end.shape)
    return np.stack([end.real, end.imag, rotation], axis=-2)


def _turned_work(wrench: Array, end: Array) -> Array:
    """Return the work (..., k) of a wrench (..., 3) on motions of `_end_motions`, turned by 90 deg.

    It is the second derivative of the work by the joint and by a unit rotation nearer the base.
    """
    along_y = wrench[..., 1, None] * end[..., 0, :]
    along_x = wrench[..., 0, None] * end[..., 1, :]
    return np.asarray(along_y - along_x)


def _symmetric(terms: Array) -> Array:
    """Return a symmetric matrix (..., k, k) by its part whose row is the joint nearer the base."""
    upper = np.triu(terms)
    return np.asarray(upper + np.swapaxes(np.triu(upper, 1), -1, -2))


class _OpeningDerivatives(NamedTuple):
    """Derivatives of the opening of a stack by the k joints of its chain.

    first : (k,).
    proximal, distal : (k,), for the proximal and the distal joint; their products are the second
        derivatives.
    """

    first: Array
    proximal: Array
    distal: Array


def _opening_derivatives(
    chain: ChainJoints, stack: ChainStack, bodies: _ChainBodies
) -> _OpeningDerivatives:
    """Return the derivatives of the opening of a stack.

    With the pivot on the far body, a proximal joint rotates the motion of the pivot by a distal
    one; with the pivot on the near body, as seen from the far one, the distal joint does. Only
    joints between the two bodies count.
    """
    far = -np.diff(stack.far, prepend=1.0, append=0.0)
    near = -np.diff(stack.near, prepend=1.0, append=0.0)
    of_pivot, of_direction = (far, near) if stack.on_far else (near, far)
    pivot = np.sum(of_pivot * (bodies.origin + bodies.rotor * stack.pivot))
    direction = stack.direction * np.sum(of_direction * bodies.rotor)
    velocity = bodies.v + 1j * chain.rotation * pivot
    rate = (np.conj(direction) * velocity).real
    bend = stack.sign * (np.conj(direction) * 1j * velocity).real
    proximal, distal = (chain.rotation, bend) if stack.on_far else (-bend, chain.rotation)
    first = stack.sign * (stack.far - stack.near) * rate
    return _OpeningDerivatives(first, (1 - stack.near) * proximal, stack.far * distal)


# between two commands; more change nothing above rounding
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)


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


def summed_loads(
    model: PaperModel,
    commanded: Array,
    axis: int,
) -> dict[str, Array]:
    """Return loads (n, 3) at commands (n,), one of them rest.

    The loads are integrals of the stiffness, `tangent` and `without` the second-order terms.
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


def linear_errors(
    model: PaperModel,
    amplitude: Array,
    lever: ArrayLike,
) -> LinearErrors:
    """Return the errors of linear positions and tangents over a box of poses.

    They are taken at its corners and the middles of edges and faces.

    amplitude : (3,), mm and rad.
    model : with leading axes (...) of designs, or none.
    lever : (...), mm.   Raises ComputationFailed as `at_pose`.
    """
    arm = np.asarray(lever, dtype=float)
    places = [place for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)]
    poses = amplitude * (np.array(places) - 1.0)
    model = with_pose_axis(model)
    scale = np.stack([np.ones_like(arm), np.ones_like(arm), arm], axis=-1)[..., None, :]
    exact = at_pose(model, poses)
    distance = np.linalg.norm((apply(stiffness(model).C_uu, exact.load) - poses) * scale, axis=-1)
    tangents = (inverse(state.stiffness()) for state in (exact, exact.without_terms))
    with_terms, without = (np.diagonal(compliance, axis1=-2, axis2=-1) for compliance in tangents)
    position = np.max(distance / np.linalg.norm(poses * scale, axis=-1), axis=-1)
    return LinearErrors(position, np.max(np.abs(with_terms / without - 1), axis=(-2, -1)))
