"""The layout of a stage: three pads, six links, the platform without its hub, and nine hinges."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from flexfem.files.tables import memoized
from flexfem.mechanism.layout import Body, Joint, Layout, Patch
from flexfem.mechanism.outlines import Pose, Segment, disc, offset, polyline, reverse
from flexfem.mechanism.profiles import Circular
from flexfem.paper.bodies import (
    BODIES,
    centrelines,
    cut_angle,
    given_angles,
    lug_side,
    necks,
    notch_radii,
    turn,
)
from flexfem.paper.designs import stage_frames
from flexfem.paper.stage_file import CHAINS, HINGE_NAMES, StageContent, key_of
from flexfem.refused import BadInput

OF_CHAIN = BODIES[:3]  # bodies of every chain
PLATFORM = len(CHAINS) * len(OF_CHAIN)  # number of the platform in the layout


@memoized
def stage_layout(stage: StageContent, refuse: bool = True) -> Layout:
    """Return the layout of a stage.

    Raises BadInput for bodies that cannot be drawn. Without `refuse`, for drawings, strips between
    the necks and the disc of the platform stand for them, and the refusal is the key of the body at
    fault.
    """
    bodies = [*_bodies_of_chains(stage, refuse), _platform(stage, refuse)]
    joints = [_joint(stage, chain, k) for chain, k in product(CHAINS, range(len(HINGE_NAMES)))]
    return Layout(
        bodies=tuple(bodies),
        joints=tuple(joints),
        points=(("output", Patch(PLATFORM, 0j)),),
        **stage.plane_problem,
    )


def _bodies_of_chains(stage: StageContent, refuse: bool) -> list[Body]:
    """Return pads and links, chain by chain. Raises BadInput as `stage_layout`."""
    width = stage.chain.link_width
    bodies = list[Body]()
    for chain in CHAINS:
        fault = ""
        try:
            lines: Sequence[Sequence[Segment]] = centrelines(stage, chain)
        except BadInput as refusal:
            if refuse:
                raise
            lines = _straight_lines(stage, chain)
            fault = refusal.reason
        for kind, line in zip(OF_CHAIN, lines, strict=True):
            name = f"{kind} of chain {chain}"
            bodies.append(
                Body(
                    name,
                    tuple(_strip(line, width, chain)),
                    clamped=(0,) if kind == "pad" else (),
                    width=width,
                    key=fault if name in fault else f"{_given(stage)}, {name}",
                )
            )
    return bodies


def _straight_lines(stage: StageContent, chain: int) -> list[list[Segment]]:
    """Return straight centrelines of pad and links between the notches of a chain."""
    poses = necks(stage, chain)
    radii = notch_radii(stage, chain)
    behind_pad = poses[0].ahead(-radii[0] - stage.chain.link_width)
    starts = [behind_pad, *map(Pose.ahead, poses[:2], radii)]
    faces = [pose.ahead(-radius) for pose, radius in zip(poses, radii, strict=True)]
    return [polyline(start.point, face.point) for start, face in zip(starts, faces, strict=True)]


def _strip(
    line: Sequence[Segment],
    width: float,
    chain: int,
) -> list[Segment]:
    """Return the outline of a strip about a centreline, placed on the stage."""
    left = turn(offset(line, width / 2), chain)
    right = turn(offset(line, -width / 2), chain)
    start = Segment(left[0].start, right[0].start)
    end = Segment(right[-1].end, left[-1].end)
    return [start, *right, end, *reverse(left)]


def _platform(stage: StageContent, refuse: bool) -> Body:
    """Return the platform without its hub. Raises BadInput as `stage_layout`."""
    key = f"{_given(stage)}, platform"
    try:
        outline = _platform_outline(stage)
    except BadInput as refusal:
        if refuse:
            raise
        outline = disc(0j, stage.platform.radius).loop
        key = refusal.reason
    hub = reverse(disc(0j, stage.platform.hub_radius).loop)
    return Body("platform", tuple(outline), holes=(tuple(hub),), key=key)


def _platform_outline(stage: StageContent) -> list[Segment]:
    """Outline of the platform: lugs and rims. Raises BadInput when it cannot be drawn."""
    cut_angle(stage)  # refuses lugs that leave no rim
    lugs = [[turn(lug_side(stage, chain, side), chain) for side in (1, -1)] for chain in CHAINS]
    outline = list[Segment]()
    for (left, right), (following, _) in zip(lugs, [*lugs[1:], lugs[0]], strict=True):
        face = Segment(left[0].start, right[0].start)
        rim = Segment(right[-1].end, following[-1].end, 0j)
        outline += [*reverse(left), face, *right, rim]
    return outline


def _given(stage: StageContent) -> str:
    """Return the numbers of the file on which the outlines of all bodies depend."""
    return (
        f"chain.link_lengths_mm = {list(stage.chain.link_lengths)} at {given_angles(stage)}, "
        f"chain.link_width_mm = {stage.chain.link_width:g}, "
        f"platform.radius_mm = {stage.platform.radius:g}"
    )


def _joint(
    stage: StageContent,
    chain: int,
    k: int,
) -> Joint:
    """Return hinge k (from 0, at the base) of a chain (1 to 3)."""
    name = HINGE_NAMES[k]
    hinge = stage.hinge(chain, name)
    near = len(OF_CHAIN) * (chain - 1) + k
    far = PLATFORM if name == "platform" else near + 1
    frames = stage_frames(stage)
    return Joint(
        f"{name} hinge of chain {chain}",
        (near, far),
        complex(*frames.centres[chain - 1, k]),
        float(frames.axes[chain - 1, k]),
        Circular(hinge.neck, hinge.radius),
        0.0,
        key_of(stage, chain, name, "radius_mm").removesuffix(".radius_mm"),
    )
