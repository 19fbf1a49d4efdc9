"""The driven stage as one compliance of platform loads and stack forces, at any mobility, with elastic links or rigid.

Flexibility method. Every section of a chain carries the wrench w of the platform's end and that of all pushes beyond
it, Q f; a hinge, or a length of a link, of compliance c, all at the platform centre, moves what is beyond it by
c (w + Q f). Of each chain, then, with sums over its hinges and links,

    U = A w + B f,   opening of the stacks = B' w + D f,   A = sum c, B = sum c Q, D = sum Q' c Q

where U is the same for all chains and their wrenches balance the load: no dependent joints are needed.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flexfem.analytic.kinematics import KINDS, Freedoms, checked
from flexfem.analytic.links import bar_density
from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.notch import Compliance
from flexfem.analytic.platform import platform_compliance
from flexfem.arrays import Array, inverse
from flexfem.stage.bodies import centrelines
from flexfem.stage.contacts import LINKS, Push, Stack, Station, share_beyond
from flexfem.stage.designs import Frames, chain_rotation, stage_frames
from flexfem.stage.drives import drive_of
from flexfem.stage.schema import CHAINS, Stage

PLATFORM = 3  # of `actuators.BODY_NAMES`
ROUND_OFF = 1e-12  # of the places of two ends of stations


class DrivenModel(NamedTuple):
    """Analytic answer to the loads of the platform and one newton of each of n stacks; leading axes are designs.

    compliance : (..., 3 + n, 3 + n), pose and openings of the stacks, mm and rad, per N and N mm.
    necks : (..., 3 chains, 3 hinges, 3, 3 + n), wrench that each neck carries, at the platform centre.
    """

    compliance: Array
    necks: Array


class LinkParts(NamedTuple):
    """What elastic links add to A (..., 3 chains, 3, 3), B (..., 3, 3, n) and D (..., n, n), `platform` (..., 9, 9)."""

    A: Array
    B: Array
    D: Array
    platform: Array


def driven_model(stage: Stage, result: AnalyticResult, stacks: tuple[Stack, ...] | None = None) -> DrivenModel:
    """The driven stage by the hinges and freedoms of an analytic model of it, with elastic links where it has them.

    Parameters
    ----------
    stacks : None takes the stage's own.

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
    c, Q = hinge_compliances(frames, hinges, freedoms), beyond_hinges(stacks)
    moving = c @ Q
    A, B = np.sum(c, axis=-3), np.sum(moving, axis=-3)
    D = np.einsum("...chan,...cham->...nm", Q, moving)
    body = np.zeros((9, 9))
    if elastic is not None:
        A, B, D, body = A + elastic.A, B + elastic.B, D + elastic.D, elastic.platform
    lead, n = B.shape[:-3], len(stacks)
    W = inverse(body + np.einsum("ij,...iab->...iajb", np.eye(3), A).reshape(*lead, 9, 9))  # wrenches per opening
    one, B = np.tile(np.eye(3), (3, 1)), B.reshape(*lead, 9, n)
    C_uu = inverse(one.T @ W @ one)
    T = on_hub(stacks) + one.T @ W @ B  # the load of the platform that a stack is as good as
    moved = C_uu @ np.concatenate([np.broadcast_to(np.eye(3), (*lead, 3, 3)), T], axis=-1)
    closed = np.concatenate([np.zeros((*lead, 9, 3)), B], axis=-1)
    w = W @ (one @ moved - closed)
    opened = np.swapaxes(T, -1, -2) @ moved
    opened[..., 3:] += D - np.swapaxes(B, -1, -2) @ W @ B
    carried = np.concatenate([np.zeros((*Q.shape[:-1], 3)), Q], axis=-1)
    necks = w.reshape(*lead, 3, 1, 3, 3 + n) + carried
    return DrivenModel(np.concatenate([moved, opened], axis=-2), necks)


def hinge_compliances(frames: Frames, hinges: Compliance, freedoms: Freedoms) -> Array:
    """Compliance (..., 3 chains, 3 hinges, 3, 3) of each hinge at the platform centre: G k^-1 G^T."""
    G, own = hinge_twists(frames), np.stack(np.broadcast_arrays(*hinges), axis=-1) * allowed_in(freedoms)
    return np.asarray(np.einsum("...ak,...k,...bk->...ab", G, own, G))


def hinge_twists(frames: Frames) -> Array:
    """Twist (..., 3 chains, 3 hinges, 3, 3) of the platform centre by rotation, axial and shear of each hinge."""
    x, y = frames.centres[..., 0], frames.centres[..., 1]
    c, s = np.cos(frames.axes), np.sin(frames.axes)
    zero, one = np.zeros_like(x), np.ones_like(x)
    return np.stack(
        [np.stack(column, axis=-1) for column in ((y, -x, one), (c, s, zero), (-s, c, zero))], axis=-1
    )  # as in `chains.chain_compliance`


def allowed_in(freedoms: Freedoms) -> Array:
    """Which freedoms (3 chains, 3 hinges, 3) hinges have, one or zero."""
    return np.array([[[float(kind in hinge) for kind in KINDS] for hinge in chain] for chain in checked(freedoms)])


def beyond_hinges(stacks: tuple[Stack, ...]) -> Array:
    """Wrench (..., 3 chains, 3 hinges, 3, n) of one newton of each stack beyond each hinge, at the platform centre."""
    Q = np.zeros((*_lead(stacks), 3, 3, 3, len(stacks)))
    for j, stack in enumerate(stacks):
        for push in stack.pushes:
            if push.body in LINKS:
                Q[..., stack.chain, : push.body, :, j] += stack.placed(push)[..., None, :]
    return Q


def on_hub(stacks: tuple[Stack, ...]) -> Array:
    """Wrench (..., 3, n) of one newton of each stack on the platform."""
    P = np.zeros((*_lead(stacks), 3, len(stacks)))
    for j, stack in enumerate(stacks):
        for push in stack.pushes:
            if push.body == PLATFORM:
                P[..., :, j] += stack.placed(push)
    return P


def _lead(stacks: tuple[Stack, ...]) -> tuple[int, ...]:
    return np.broadcast_shapes(*(push.wrench.shape[:-1] for stack in stacks for push in stack.pushes))


def link_parts(stage: Stage, stacks: tuple[Stack, ...]) -> LinkParts:
    """What pads, links and platform of one stage add to the compliances of its chains.

    Raises BadInput when they cannot be drawn.
    """
    n = len(stacks)
    A, B, D = np.zeros((3, 3, 3)), np.zeros((3, 3, n)), np.zeros((n, n))
    for chain in CHAINS:
        R = chain_rotation(chain - 1)
        here = [(j, push) for j, stack in enumerate(stacks) if stack.chain == chain - 1 for push in stack.pushes]
        mine = [(j, push) for j, push in here if push.station is not None]  # the hub takes those on the platform
        for link, c, at in link_pieces(stage, chain, [push for _, push in mine]):
            Q = np.zeros((len(at), 3, n))
            for j, push in mine:
                Q[:, :, j] += beyond(push, link, at)[:, None] * push.wrench
            A[chain - 1] += R @ np.sum(c, axis=0) @ R.T
            moved = c @ Q
            B[chain - 1] += R @ np.sum(moved, axis=0)
            D += np.tensordot(Q, moved, axes=([0, 1], [0, 1]))
    return LinkParts(A, B, D, platform_compliance(stage, stage.elastic))


class Pieces(NamedTuple):
    """Pieces (q) of a line or arc of a chain's pad (link 0) or link: compliances (q, 3, 3) at the platform in the frame
    of chain 1, and how far, mm, they are along the link."""

    link: int
    compliance: Array
    at: Array


def link_pieces(stage: Stage, chain: int, pushes: list[Push]) -> list[Pieces]:
    """Pieces of pad and links of a chain (1 to 3), base to platform; the ends of the stations of pushes part them."""
    found = []
    for link, path in enumerate(centrelines(stage, chain)):
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
