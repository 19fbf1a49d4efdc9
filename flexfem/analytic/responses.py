"""What the analytic model says of drives, vibration and heat: loads and openings of the network of `model.lowered`.

Drives: one newton of a stack is a pair of opposite wrenches on two bodies; its opening is what they do work on. A push
on an elastic link is spread over a station of it, so that pieces of the link carry shares of it.

Vibration: unit wrenches on all seven moving bodies give the compliance C (21, 21) of their twists, whatever freedoms
the hinges have; its rank is the mobility. With their mass matrix M, the eigenvalues of `C M` are `1 / omega^2`.
Every body is drawn up to the narrowest section of its hinges: half a notch moves with either side.

Heat: a chain that warms with its hinges at rest carries the platform, as the ground does on a frame that warms. The
difference is an opening of the chain. The change dT and the gradient are about the platform's centre. The frame also
strains and bows the edge that an elastic pad is clamped along (`edge_motions`): 1.1 % of the pose per gradient.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic import network
from flexfem.analytic.elastic_bodies import bar_density, body_compliance
from flexfem.analytic.model import JOINTS, AnalyticResult, at_necks, lowered
from flexfem.analytic.model import LINKS as LINKS_OF
from flexfem.analytic.paper import Freedoms, mobility
from flexfem.arrays import Array
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import neck_stress, stress_raised
from flexfem.mechanism import bodies as drawn
from flexfem.mechanism.contacts import LINKS, PLATFORM, Push, Stack, Station, share_beyond
from flexfem.mechanism.designs import Designs, Frames, chain_rotation, direction, lower, stage_frames
from flexfem.mechanism.drives import drive_of
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.refused import BadInput

MOVING = 7  # bodies: the platform and two links of every chain
FREEDOMS = 3 * MOVING
ROUND_OFF = 1e-12  # of the places of two ends of stations


class DrivenModel(NamedTuple):
    """Analytic answer to the loads of the platform and one newton of each of n stacks; leading axes are designs.

    compliance : (..., 3 + n, 3 + n), pose and openings of the stacks, mm and rad, per N and N mm.
    necks : (..., 3 chains, 3 hinges, 3, 3 + n), wrench that each neck carries, at the platform centre.
    """

    compliance: Array
    necks: Array


class LinkParts(NamedTuple):
    """What elastic bodies do: compliance (..., 9, 9) of `body_compliance`; openings (..., 9, 3, 3 + n) of joints and
    motions (..., 3 + n, 3 + n) by loads on the platform and n stacks, as `network.LoadedWithin`."""

    compliance: Array
    openings: Array
    motions: Array


def driven_model(stage: Stage, result: AnalyticResult, stacks: tuple[Stack, ...] | None = None) -> DrivenModel:
    """A driven stage by the hinges, freedoms and links of an analytic model, with its own stacks where None are given.

    Raises BadInput for a stage without actuators.
    """
    stacks = drive_of(stage).stacks if stacks is None else stacks
    elastic = link_parts(stage, stacks) if result.links else None
    return driven(stage_frames(stage), result.hinges, result.freedoms, stacks, elastic)


def driven(
    frames: Frames,
    hinges: Compliance,
    freedoms: Freedoms,
    stacks: tuple[Stack, ...],
    elastic: LinkParts | None = None,
) -> DrivenModel:
    """The driven stage; frames (..., 3, 3, 2), hinges (..., 3, 3) and wrenches of stacks of any number of designs.

    nan for a design with a chain that has no compliance in some direction.
    """
    bodies = None if elastic is None else elastic.compliance
    within = None if elastic is None else network.LoadedWithin(elastic.openings, elastic.motions)
    found = network.solve(lowered(frames, hinges, freedoms, bodies), _loads_of(stacks), within=within)
    return DrivenModel(found.motions, _by_chain(found.wrenches))


def _by_chain(wrenches: Array) -> Array:
    """Wrenches (..., 9 joints, 3, k) as (..., 3 chains, 3 hinges, 3, k)."""
    return wrenches.reshape(*wrenches.shape[:-3], 3, 3, *wrenches.shape[-2:])


def _loads_of(stacks: tuple[Stack, ...]) -> Array:
    """Loads (..., 7 bodies, 3, 3 + n): unit wrenches on the platform, then one newton of each stack."""
    lead = np.broadcast_shapes(*(push.wrench.shape[:-1] for stack in stacks for push in stack.pushes))
    loads = np.zeros((*lead, MOVING, 3, 3 + len(stacks)))
    loads[..., 0, :, :3] = np.eye(3)
    for j, stack in enumerate(stacks):
        for push in stack.pushes:
            if push.body in LINKS or push.body == PLATFORM:
                body = 0 if push.body == PLATFORM else LINKS_OF[stack.chain][push.body - 1]
                loads[..., body, :, 3 + j] += stack.placed(push)
    return loads


def link_parts(stage: Stage, stacks: tuple[Stack, ...]) -> LinkParts:
    """What pads, links and platform of one stage do. Raises BadInput when they cannot be drawn."""
    n = 3 + len(stacks)
    openings, motions = np.zeros((len(JOINTS), 3, n)), np.zeros((n, n))
    for chain in CHAINS:
        # the hub takes the pushes on the platform
        mine = [(j, push) for j, stack in enumerate(stacks, start=3) if stack.chain == chain - 1
                for push in stack.pushes if push.station is not None]  # fmt: skip
        for link, c, at in link_pieces(stage, chain, [push for _, push in mine]) if mine else ():
            Q = np.zeros((len(at), 3, n))
            for j, push in mine:
                Q[:, :, j] += beyond(push, link, at)[:, None] * push.wrench
            moved = c @ Q
            openings[3 * chain - 3] += chain_rotation(chain - 1) @ np.sum(moved, axis=0)  # in the chain's first joint
            motions += np.tensordot(Q, moved, axes=([0, 1], [0, 1]))
    return LinkParts(body_compliance(stage), openings, motions)


class Pieces(NamedTuple):
    """Pieces (q) of a line or arc of a chain's pad (link 0) or link: compliances (q, 3, 3) at the platform in the frame
    of chain 1, and how far, mm, they are along the link."""

    link: int
    compliance: Array
    at: Array


def link_pieces(stage: Stage, chain: int, pushes: list[Push]) -> list[Pieces]:
    """Pieces of pad and links of a chain (1 to 3), base to platform; the ends of the stations of pushes part them."""
    found = []
    for link, path in enumerate(drawn.centrelines(stage, chain)):
        begin = 0.0
        here = [push.station for push in pushes if push.body == link and push.station is not None]
        for segment in path:
            for low, high in _parted(begin, begin + segment.length, here):
                ends = (low - begin) / segment.length, (high - begin) / segment.length
                c, share = bar_density(stage, stage.elastic, segment, *ends)
                found.append(Pieces(link, c, begin + share * segment.length))
            begin += segment.length
    return found


def _parted(begin: float, end: float, stations: list[Station]) -> list[tuple[float, float]]:
    """A length of a path in pieces, parted where stations begin and end; ends that differ by round-off are one."""
    marks = {mark for each in stations for mark in (each.middle - each.half, each.middle + each.half)}
    cuts = [begin, *sorted(mark for mark in marks if begin < mark < end), end]
    least = ROUND_OFF * (abs(begin) + abs(end))
    return list(pairwise([cut for cut, after in pairwise(cuts) if after - cut > least] + [end]))


def beyond(push: Push, link: int, at: Array) -> Array:
    """Share (q,) of a push on the links or the platform that is beyond places (q,), mm along a link (0 the pad)."""
    if push.body == link and push.station is not None:
        return share_beyond(push.station, at)
    return np.full(len(at), float(push.body > link))


class Dynamics(NamedTuple):
    """Of n designs, or one without an axis: bodies in the order platform, then link 1 and link 2 of every chain.

    compliance, mass : (..., 21, 21), of the bodies' twists x, y, theta at the platform centre: mm, rad, N, tonne.
    rank : of the compliance, the mobility; its other eigenvalues are round-off.
    """

    compliance: Array
    mass: Array
    rank: int

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (..., 21), rad/s, rising; inf for freedoms that the hinges do not have, nan for a design
        without an answer."""
        L = np.linalg.cholesky(self.mass)
        A = np.swapaxes(L, -1, -2) @ self.compliance @ L
        bad = ~np.all(np.isfinite(A), axis=(-2, -1), keepdims=True)
        values = np.linalg.eigvalsh(np.where(bad, 0.0, (A + np.swapaxes(A, -1, -2)) / 2))[..., ::-1]
        held = (np.arange(FREEDOMS) >= self.rank) | (values <= 0)
        found = np.where(held, np.inf, 1 / np.sqrt(np.where(held, 1.0, values)))
        return np.where(bad[..., 0], np.nan, found)


def dynamics(stage: Stage, of: AnalyticResult, payload: drawn.Payload, stacks: tuple[Stack, ...] = ()) -> Dynamics:
    """The dynamics of one stage by an analytic model, with openings of `stacks` at the end of the compliance, for
    `network.with_springs`."""
    found = driven_model(stage, of, (*on_bodies(stage if of.links else None), *stacks))
    return Dynamics(found.compliance, _mass_of(stage, payload), FREEDOMS if of.links else of.mobility)


def many(
    frames: Frames, hinges: Compliance, freedoms: Freedoms, mass: Array, elastic: LinkParts | None = None
) -> Dynamics:
    """The dynamics of n designs; hinges (n, 3, 3), mass (n, 21, 21) of `mass_matrix`.

    elastic : (n, ...) each, of `link_parts` with the loads `on_bodies`; None where links are rigid.
    """
    rank = mobility(freedoms) if elastic is None else FREEDOMS
    return Dynamics(driven(frames, hinges, freedoms, on_bodies(), elastic).compliance, mass, rank)


def mass_matrix(bodies: Array, hub: Array, areal: Array, payload: drawn.Payload) -> Array:
    """Mass matrix (..., 21, 21) of the moving bodies, about the platform centre.

    Parameters
    ----------
    bodies : (..., 3 chains, 4 bodies, 4) of `body_moments`.   hub : (..., 4).   areal : (...), tonne/mm^2.
    """
    platform = drawn.inertia_of(bodies[..., PLATFORM, :].sum(axis=-2) + hub, areal) + payload.matrix
    links = drawn.inertia_of(bodies, np.asarray(areal)[..., None, None])
    M = np.zeros((*platform.shape[:-2], FREEDOMS, FREEDOMS))
    M[..., :3, :3] = platform
    for k, (chain, link) in enumerate((chain, link) for chain in range(len(CHAINS)) for link in LINKS):
        at = slice(3 + 3 * k, 6 + 3 * k)
        M[..., at, at] = links[..., chain, link, :, :]
    return M


def _mass_of(stage: Stage, payload: drawn.Payload) -> Array:
    return mass_matrix(
        drawn.body_moments(stage), drawn.hub_moments(stage), np.asarray(drawn.mass_per_area(stage)), payload
    )


def on_bodies(stage: Stage | None = None) -> tuple[Stack, ...]:
    """Unit wrenches on the links as pushes: x, y, theta of link 1 and link 2 of every chain, in the stage's frame.

    stage : to spread them all along elastic links, where inertia acts; None where links are rigid.
    """
    found = []
    for chain in range(len(CHAINS)):
        for link in LINKS:
            place = None
            if stage is not None:
                path = drawn.centrelines(stage, chain + 1)[link]
                half = sum(segment.length for segment in path) / 2
                place = Station(path, stage.chain.link_width, half, half)
            for wrench in np.eye(3) @ chain_rotation(chain):  # rows: the stage's directions in the chain's frame
                found.append(Stack(chain, (Push(link, wrench, place), Push(0, np.zeros(3), None))))
    return tuple(found)


def under_weight(stage: Stage, of: AnalyticResult, payload: drawn.Payload, acceleration: Array) -> tuple[Array, Array]:
    """Pose (3,) and highest neck stress (3 chains, 3 hinges), MPa, of a stage whose bodies weigh on it.

    acceleration : (2,), of gravity in the plane, mm/s^2.
    """
    found = driven_model(stage, of, on_bodies(stage if of.links else None))
    weights = _mass_of(stage, payload) @ np.tile([*acceleration, 0.0], MOVING)
    stress = _highest(lower(stage), (found.necks @ weights)[None, ..., None])
    return found.compliance[:3] @ weights, stress[0, ..., 0]


def _highest(designs: Designs, wrenches: Array) -> Array:
    """Largest von Mises stress (n, 3 chains, 3 hinges, k), MPa, of wrenches (n, 3, 3, 3, k) that the necks carry."""
    carried = at_necks(designs.frames, wrenches)
    return neck_stress(carried, designs.neck, designs.thickness, stress_raised(designs))


MISSING = "is missing, expected um/(m K), the coefficient of linear thermal expansion"


class WarmModel(NamedTuple):
    """What n designs do per kelvin, per K/mm along x, per K/mm along y, the three cases of the last axis.

    pose : (n, 3, 3 cases), of the platform, mm and rad.
    reaction : (n, 3 chains, 3, 3 cases), of the ground on each chain about the platform's centre, N and N mm.
    stress : (n, 3 chains, 3 hinges, 3 cases), largest von Mises stress at each neck, MPa.
    """

    pose: Array
    reaction: Array
    stress: Array


class WarmBodies(NamedTuple):
    """What n designs' elastic bodies do: compliance (n, 9, 9) of `body_compliance`, (n, 3, 3, 3) of `edge_motions`."""

    compliance: Array
    edges: Array


class DriftRates(NamedTuple):
    """Of n designs: pose per kelvin (n, 3), mm and rad; largest translation and rotation per K/mm (n, 2)."""

    uniform: Array
    gradient: Array


def require_expansion(stage: Stage, frame: bool = False) -> None:
    """Raise BadInput where a stage states no expansion of its own, or, where it is asked for, none of its frame."""
    if stage.material.expansion is None:
        raise BadInput(f"material.expansion_um_per_m_k {MISSING} (aluminium 23.6)")
    if frame and stage.frame.expansion is None:
        still = "one that expands as the stage does leaves the platform at rest"
        raise BadInput(f"frame.expansion_um_per_m_k {MISSING} of the frame: {still}")


def in_plane(designs: Designs) -> tuple[Array, Array]:
    """What the plane problem sees (n,) of the expansions, 1/K, of stage and frame; a frame of none is as the stage.

    Notes
    -----
    In plane strain the faces are held at the frame's strain across, and `nu (a - a_frame)` more goes into the plane.
    """
    own, frame = designs.expansion.T
    frame = np.where(np.isnan(frame), own, frame)
    return own + designs.out_of_plane * (own - frame), frame


def rates_of(pose: Array) -> DriftRates:
    """Rates of poses (n, 3, 3 cases), the largest over gradients of all directions.

    Notes
    -----
    The translation is the largest singular value of the matrix (2, 2) of both gradients, in closed form; each may
    have a direction of its own.
    """
    (a, b), (c, d), turn = np.moveaxis(pose[:, :, 1:], 0, -1)
    moved = (np.hypot(a + d, c - b) + np.hypot(a - d, b + c)) / 2
    return DriftRates(pose[:, :, 0], np.stack([moved, np.hypot(*turn)], axis=-1))


def drift(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    stage_expansion: Array,
    frame_expansion: Array,
    bodies: WarmBodies | None = None,
) -> WarmModel:
    """Drift of n designs by hinges of compliances (n, 3, 3).

    Parameters
    ----------
    stage_expansion, frame_expansion : (n,), 1/K, in the plane.
    bodies : None where pads, links and platform are rigid.
    """
    gaps = misfits(designs, stage_expansion, frame_expansion)
    if bodies is not None:
        gaps = gaps + (frame_expansion - stage_expansion)[:, None, None, None] * bodies.edges
    openings = np.zeros((len(gaps), len(JOINTS), 3, 3))
    openings[:, ::3] = gaps  # of each chain, in its first joint
    of = lowered(designs.frames, hinges, freedoms, None if bodies is None else bodies.compliance)
    found = network.solve(of, np.zeros((MOVING, 3, 3)), openings)
    return WarmModel(found.output, -found.wrenches[:, ::3], _highest(designs, _by_chain(found.wrenches)))


def misfits(designs: Designs, stage_expansion: Array, frame_expansion: Array) -> Array:
    """Displacements (n, 3 chains, 3, 3 cases) of the platform on each chain alone, its hinges at rest.

    Notes
    -----
    A free body has, per expansion and by 1 K, 1 K/mm along x and along y, at z = x + iy the displacements z, `z^2/2`
    and `-i z^2/2` and the turns 0, y and -x. As rigid motions of the ground they are `(x, y, 0)`, `(r^2/2, 0, y)` and
    `(0, r^2/2, -x)` at the platform's centre, whatever the path of the chain.
    """
    centres, axes = designs.frames
    pad = designs.radius[:, :, 0] + designs.link_width[:, None]
    ground = centres[:, :, 0] - pad[..., None] * direction(axes[:, :, 0])
    x, y = np.moveaxis(ground, -1, 0)
    none, half = np.zeros_like(x), (x**2 + y**2) / 2
    grown = np.array([[x, half, none], [y, none, half], [none, y, -x]])
    further = (frame_expansion - stage_expansion)[:, None, None, None]  # zero, not round-off, where they are the same
    return np.asarray(further * np.moveaxis(grown, (0, 1), (2, 3)))
