"""Response of the analytic model to drives, vibration and heat, by `model.network_of`.

Drives: the unit force of a stack is a pair of opposite wrenches on two bodies, and its opening is
the conjugate displacement. A force on an elastic link is distributed over a station, so that pieces
of the link carry shares of it.

Vibration: unit wrenches on all seven moving bodies give the compliance C (21, 21) of their twists
for any freedoms of the hinges; its rank is the mobility. With their mass matrix M, the eigenvalues
of `C M` are `1 / omega^2`. Every body extends to the narrowest section of its hinges: half a notch
moves with either side.

Heat: a chain that expands with its hinges at rest displaces the platform, as does a frame that
expands. The difference is an opening of the chain. The change dT and the gradient are about the
platform's centre. The frame also strains and bows the clamped edge of an elastic pad
(`edge_motions`), which causes 1.1 % of the pose per gradient.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic import network
from flexfem.analytic.network import Dynamics
from flexfem.arrays import Array, direction
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import neck_stress
from flexfem.mechanism import expansion
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.outlines import inertia_of
from flexfem.paper import bodies as drawn
from flexfem.paper.contacts import LINKS, PLATFORM, Push, Stack, Station, share_beyond
from flexfem.paper.designs import Designs, design_arrays, stage_frames
from flexfem.paper.drives import drive_of
from flexfem.paper.equations import Freedoms
from flexfem.paper.frames import Frames, chain_rotation
from flexfem.paper.links import bar_density, body_compliance
from flexfem.paper.model import (
    JOINTS,
    LINK_BODIES,
    AnalyticResult,
    at_necks,
    network_of,
    stress_raised,
)
from flexfem.paper.stage import CHAINS, Stage
from flexfem.refused import BadInput

MOVING = 7  # bodies: the platform and two links of every chain
FREEDOMS = 3 * MOVING
ROUND_OFF = 1e-12  # relative, of the ends of two stations


class DrivenModel(NamedTuple):
    """Response to unit loads on the platform and a unit force of each of n stacks, by design.

    compliance : (..., 3 + n, 3 + n), pose and openings of the stacks, mm and rad, per N and N mm.
    necks : (..., 3 chains, 3 hinges, 3, 3 + n), wrench of each neck at the platform centre.
    """

    compliance: Array
    necks: Array


class LinkParts(NamedTuple):
    """Elastic bodies under loads on the platform and n stacks.

    compliance : (..., 9, 9), of `body_compliance`.
    openings, motions : (..., 9, 3, 3 + n), of joints, and (..., 3 + n, 3 + n), as in
        `network.InternalMotions`.
    """

    compliance: Array
    openings: Array
    motions: Array


def driven_model(
    stage: Stage, result: AnalyticResult, stacks: tuple[Stack, ...] | None = None
) -> DrivenModel:
    """Return the driven model of a stage with the hinges, freedoms and links of `result`.

    stacks : None takes those of the stage.

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
    """Return the driven model of any number of designs.

    frames : (..., 3, 3, 2).   hinges : (..., 3, 3).

    It is nan for a design with a chain that has no compliance in some direction.
    """
    bodies = None
    internal = None
    if elastic is not None:
        bodies = elastic.compliance
        internal = network.InternalMotions(elastic.openings, elastic.motions)
    joined = network_of(frames, hinges, freedoms, bodies)
    response = network.solve(joined, _loads_of(stacks), internal=internal)
    return DrivenModel(response.motions, _by_chain(response.wrenches))


def _by_chain(wrenches: Array) -> Array:
    """Reshape wrenches (..., 9 joints, 3, k) to (..., 3 chains, 3 hinges, 3, k)."""
    return wrenches.reshape(*wrenches.shape[:-3], 3, 3, *wrenches.shape[-2:])


def _loads_of(stacks: tuple[Stack, ...]) -> Array:
    """Loads (..., 7 bodies, 3, 3 + n): unit wrenches on the platform, then forces of stacks."""
    wrenches = [push.wrench for stack in stacks for push in stack.pushes]
    lead = np.broadcast_shapes(*(wrench.shape[:-1] for wrench in wrenches))
    loads = np.zeros((*lead, MOVING, 3, 3 + len(stacks)))
    loads[..., 0, :, :3] = np.eye(3)
    for j, stack in enumerate(stacks):
        for push in stack.pushes:
            if push.body in LINKS or push.body == PLATFORM:
                body = 0 if push.body == PLATFORM else LINK_BODIES[stack.chain][push.body - 1]
                loads[..., body, :, 3 + j] += stack.placed(push)
    return loads


def link_parts(stage: Stage, stacks: tuple[Stack, ...]) -> LinkParts:
    """Return the elastic pads, links and platform of one stage.

    Raises BadInput when they cannot be drawn.
    """
    n = 3 + len(stacks)
    openings = np.zeros((len(JOINTS), 3, n))
    motions = np.zeros((n, n))
    for chain in CHAINS:
        pushes = _pushes_on_links(stacks, chain)
        if not pushes:
            continue
        at_platform = 3 * chain - 1  # joint
        for link, compliance, at in link_pieces(stage, chain, [push for _, push in pushes]):
            Q = np.zeros((len(at), 3, n))
            for j, push in pushes:
                Q[:, :, j] += distal_share(push, link, at)[:, None] * push.wrench
            CQ = compliance @ Q
            openings[at_platform] += chain_rotation(chain - 1) @ np.sum(CQ, axis=0)
            motions += np.tensordot(Q, CQ, axes=([0, 1], [0, 1]))
    return LinkParts(body_compliance(stage), openings, motions)


def _pushes_on_links(stacks: tuple[Stack, ...], chain: int) -> list[tuple[int, Push]]:
    """Return the pushes on elastic links of a chain (1 to 3), and the load case of each.

    Forces on the platform act on its rigid hub, and have no station.
    """
    found = list[tuple[int, Push]]()
    for load_case, stack in enumerate(stacks, start=3):
        if stack.chain == chain - 1:
            found += [(load_case, push) for push in stack.pushes if push.station is not None]
    return found


class Pieces(NamedTuple):
    """Pieces (q) of a line or arc of a chain's pad (link 0) or link.

    compliance : (q, 3, 3), at the platform in the frame of chain 1.   at : (q,), mm along the link.
    """

    link: int
    compliance: Array
    at: Array


def link_pieces(
    stage: Stage,
    chain: int,
    pushes: list[Push],
) -> list[Pieces]:
    """Return the pieces of pad and links of a chain (1 to 3), base to platform.

    They are split at the ends of the stations.
    """
    pieces = list[Pieces]()
    for link, path in enumerate(drawn.centrelines(stage, chain)):
        begin = 0.0
        on_link = [push.station for push in pushes if push.body == link]
        stations = [station for station in on_link if station is not None]
        for segment in path:
            for low, high in _intervals(begin, begin + segment.length, stations):
                ends = (low - begin) / segment.length, (high - begin) / segment.length
                compliance, share = bar_density(stage, stage.elastic, segment, *ends)
                pieces.append(Pieces(link, compliance, begin + share * segment.length))
            begin += segment.length
    return pieces


def _intervals(
    begin: float,
    end: float,
    stations: list[Station],
) -> list[tuple[float, float]]:
    """Split a length of a path at the ends of stations, but for round-off."""
    marks = {station.middle - station.half for station in stations}
    marks |= {station.middle + station.half for station in stations}
    cuts = [begin, *sorted(mark for mark in marks if begin < mark < end), end]
    least = ROUND_OFF * (abs(begin) + abs(end))
    kept = [cut for cut, following in pairwise(cuts) if following - cut > least]
    return list(pairwise([*kept, end]))


def distal_share(
    push: Push,
    link: int,
    at: Array,
) -> Array:
    """Return the share (q,) of a force on a body distal to places (q,), mm along a link."""
    if push.body == link and push.station is not None:
        return share_beyond(push.station, at)
    return np.full(len(at), float(push.body > link))


def dynamics(
    stage: Stage, model: AnalyticResult, payload: Payload, stacks: tuple[Stack, ...] = ()
) -> Dynamics:
    """Return the dynamics of one stage by an analytic model.

    The motions are the twists of platform, then link 1 and link 2 of every chain, at the platform
    centre. The openings of `stacks` are appended to the compliance, for `network.with_springs`.
    """
    loads = (*body_loads(stage if model.links else None), *stacks)
    compliance = driven_model(stage, model, loads).compliance
    freedoms = FREEDOMS if model.links else model.mobility
    return Dynamics(compliance, mass_matrix(stage, payload), freedoms)


def mass_matrix(stage: Stage, payload: Payload) -> Array:
    """Return the mass matrix (21, 21) of the moving bodies about the platform centre."""
    areal = drawn.mass_per_area(stage)
    bodies = inertia_of(drawn.body_moments(stage), np.full((len(CHAINS), PLATFORM + 1), areal))
    platform = bodies[:, PLATFORM].sum(axis=0) + drawn.carried(stage, payload)
    links = bodies[:, list(LINKS)].reshape(-1, 3, 3)
    return network.block_diagonal(np.stack([platform, *links]))


def body_loads(stage: Stage | None = None) -> tuple[Stack, ...]:
    """Return unit wrenches, in the frame of the stage, on link 1 and link 2 of every chain.

    stage : distributes them along its elastic links, like inertia forces; None for rigid links.
    """
    loads = list[Stack]()
    for chain in range(len(CHAINS)):
        for link in LINKS:
            station = None
            if stage is not None:
                path = drawn.centrelines(stage, chain + 1)[link]
                half = sum(segment.length for segment in path) / 2
                station = Station(path, stage.chain.link_width, half, half)
            # rows: the stage's directions in the chain's frame
            for wrench in chain_rotation(chain):
                pushes = (Push(link, wrench, station), Push(0, np.zeros(3), None))
                loads.append(Stack(chain, pushes))
    return tuple(loads)


def under_weight(
    stage: Stage, model: AnalyticResult, payload: Payload, gravity: Array
) -> tuple[Array, Array]:
    """Return the pose (3,) and the highest neck stress (3 chains, 3 hinges), MPa, by own weight.

    gravity : (2,), acceleration in the plane, mm/s^2.
    """
    loaded = driven_model(stage, model, body_loads(stage if model.links else None))
    weights = mass_matrix(stage, payload) @ np.tile([*gravity, 0.0], MOVING)
    stress = _stress(design_arrays(stage), (loaded.necks @ weights)[None, ..., None])
    return loaded.compliance[:3] @ weights, stress[0, ..., 0]


def _stress(designs: Designs, wrenches: Array) -> Array:
    """Largest von Mises stress (n, 3 chains, 3 hinges, k), MPa, by wrenches of the necks.

    wrenches : (n, 3, 3, 3, k).
    """
    wrench = at_necks(designs.frames, wrenches)
    return neck_stress(wrench, designs.neck, designs.thickness, stress_raised(designs))


class WarmModel(NamedTuple):
    """Response of n designs to three cases, the last axis: 1 K, 1 K/mm along x, 1 K/mm along y.

    pose : (n, 3, 3 cases), of the platform, mm and rad.
    reaction : (n, 3 chains, 3, 3 cases), of the ground on each chain about the platform's centre,
        N and N mm.
    stress : (n, 3 chains, 3 hinges, 3 cases), largest von Mises stress at each neck, MPa.
    """

    pose: Array
    reaction: Array
    stress: Array


class WarmBodies(NamedTuple):
    """Elastic bodies of n designs.

    compliance : (n, 9, 9), of `body_compliance`.   edges : (n, 3, 3, 3), of `edge_motions`.
    """

    compliance: Array
    edges: Array


class DriftRates(NamedTuple):
    """Pose (n, 3), mm and rad per K, and largest translation and rotation (n, 2) per K/mm."""

    uniform: Array
    gradient: Array


def require_expansion(stage: Mechanism, frame: bool = False) -> None:
    """Raise BadInput without an expansion of the stage or, if `frame`, of its frame."""
    expansion.require_expansion(stage)
    if frame and isinstance(stage, Stage) and stage.frame.expansion is None:
        reason = "with the expansion of the stage it does not move the platform"
        raise BadInput(f"frame.{expansion.KEY} {expansion.MISSING} of the frame: {reason}")


def in_plane(designs: Designs) -> tuple[Array, Array]:
    """Return the in-plane expansions (n,), 1/K, of stage and frame; equal without a frame."""
    stage, frame = designs.expansion.T
    frame = np.where(np.isnan(frame), stage, frame)
    return expansion.expansion_in_plane(stage, frame, designs.out_of_plane), frame


def rates_of(pose: Array) -> DriftRates:
    """Return the drift rates of poses (n, 3, 3 cases), largest over directions of the gradient.

    Notes
    -----
    The translation is the largest singular value, in closed form, of the matrix (2, 2) of both
    gradients. Translation and rotation may be largest for different directions.
    """
    (a, b), (c, d), rotation = np.moveaxis(pose[:, :, 1:], 0, -1)
    translation = (np.hypot(a + d, c - b) + np.hypot(a - d, b + c)) / 2
    return DriftRates(pose[:, :, 0], np.stack([translation, np.hypot(*rotation)], axis=-1))


def drift(
    designs: Designs,
    hinges: Compliance,
    freedoms: Freedoms,
    stage_expansion: Array,
    frame_expansion: Array,
    bodies: WarmBodies | None = None,
) -> WarmModel:
    """Return the drift of n designs with hinges of compliances (n, 3, 3).

    Parameters
    ----------
    stage_expansion, frame_expansion : (n,), 1/K, in the plane.
    bodies : None where pads, links and platform are rigid.
    """
    misfit = misfits(designs, stage_expansion, frame_expansion)
    compliance = None
    if bodies is not None:
        compliance = bodies.compliance
        difference = frame_expansion - stage_expansion
        misfit = misfit + difference[:, None, None, None] * bodies.edges
    openings = np.zeros((len(misfit), len(JOINTS), 3, 3))
    openings[:, ::3] = misfit  # of each chain, in its first joint
    joined = network_of(designs.frames, hinges, freedoms, compliance)
    pose, wrenches, _ = network.solve(joined, np.zeros((MOVING, 3, 3)), openings)
    return WarmModel(pose, -wrenches[:, ::3], _stress(designs, _by_chain(wrenches)))


def misfits(
    designs: Designs,
    stage_expansion: Array,
    frame_expansion: Array,
) -> Array:
    """Return the displacements (n, 3 chains, 3, 3 cases) of the platform on each chain alone.

    The hinges are at rest. That of the ground about the platform's centre is the same for any path
    of the chain.
    """
    centres, axes = designs.frames
    pad = designs.radius[:, :, 0] + designs.link_width[:, None]
    ground = centres[:, :, 0] - pad[..., None] * direction(axes[:, :, 0])
    difference = frame_expansion - stage_expansion  # exactly zero for equal expansions
    motions = network.ground_motions(ground @ [1, 1j])
    return np.asarray(difference[:, None, None, None] * motions)
