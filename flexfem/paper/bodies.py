"""Outlines and masses of the bodies of a stage: pads, links, platform and the notches between them.

Points are complex numbers, in mm. All three chains are drawn in the frame of chain 1; `turn`
rotates them into place. `geometry/README.md` shows the rules: every body is as wide as the link,
pads are as long as they are wide. Inner bends of links are rounded, because a sharp re-entrant
corner would spoil the convergence of the finite elements. Each side of a lug follows the face of
the hinge if that face meets the disc; otherwise it continues parallel to the neck into the disc,
or, if it would miss the disc, runs tangentially to it. The hub is rigid, so it is not part of the
meshed sectors."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from itertools import product
from types import MappingProxyType

import numpy as np

from flexfem.arrays import AnyArray, Array, turned
from flexfem.files.tables import once
from flexfem.mechanism.layout import Body, Joint, Layout, Patch, Payload
from flexfem.mechanism.outlines import (
    Face,
    Pose,
    Segment,
    area_moments,
    disc,
    inertia_of,
    offset,
    polyline,
    reverse,
    shortest_path,
)
from flexfem.mechanism.profiles import Circular
from flexfem.paper.designs import stage_frames
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage_file import CHAINS, HINGE_NAMES, Hinge, StageContent, key_of
from flexfem.refused import BadInput
from flexfem.units import DENSITY

FILLET = (
    1 / 8
)  # radius of an inner bend, and length of the straight stub next to a notch, per link width
LUG = 1 / 2  # length of the straight part of a lug that is tangential to the disc, per link width
NARROWEST_RIM = np.deg2rad(
    2.0
)  # least free rim between two lugs, where the cut between two sectors lies
BODIES = ("pad", "link 1", "link 2", "platform")


def turn(path: Sequence[Segment], chain: int) -> list[Segment]:
    """Rotate a path of one chain (1 to 3) from the frame of chain 1 to its place on the stage."""
    return [segment.turned((chain - 1) * CHAIN_TURN) for segment in path]


@once
def necks(stage: StageContent, chain: int) -> tuple[Pose, ...]:
    """Neck centres and directions of one chain (1 to 3), base to platform, in the frame of chain 1."""
    frames = stage_frames(stage)
    angle = -(chain - 1) * CHAIN_TURN
    centres = turned(frames.centres[chain - 1], angle)
    axes = frames.axes[chain - 1] + angle
    return tuple(Pose(complex(*centre), axis) for centre, axis in zip(centres, axes, strict=True))


def given_angles(stage: StageContent) -> str:
    """Return the joint angles as a stage file states them."""
    angles = [f"{np.rad2deg(angle):.6g}" for angle in stage.chain.joint_angles]
    return f"chain.joint_angles_deg = [{', '.join(angles)}]"


@once
def centrelines(stage: StageContent, chain: int) -> tuple[tuple[Segment, ...], ...]:
    """Centrelines of pad, link 1 and link 2 of one chain, from notch to notch.

    Raises BadInput when no link can be drawn between two hinges.
    """
    poses = necks(stage, chain)
    width = stage.chain.link_width
    radii = [stage.hinge(chain, name).radius for name in HINGE_NAMES]
    lines = [
        tuple(polyline(poses[0].ahead(-radii[0] - width).point, poses[0].ahead(-radii[0]).point))
    ]
    for k in (1, 2):
        leave = poses[k - 1].ahead(radii[k - 1])
        arrive = poses[k].ahead(-radii[k])
        bend = _bend(leave, arrive, width)
        if bend is None:
            low = 0.0
            high = width
            for _ in range(24):  # bisection: the widest link that can be drawn
                middle = (low + high) / 2
                low, high = (
                    (low, middle) if _bend(leave, arrive, middle) is None else (middle, high)
                )
            raise BadInput(
                f"chain.link_lengths_mm = {list(stage.chain.link_lengths)}, expected room for "
                f"link {k} of chain {chain}: no strip {width:g} mm wide can be drawn from hinge "
                f"to hinge at {given_angles(stage)}, "
                f"{f'only with chain.link_width_mm < {high:.4g}' if low else 'nor with any other chain.link_width_mm'}"
            )
        lines.append(
            (*polyline(leave.point, bend[0].start), *bend, *polyline(bend[-1].end, arrive.point))
        )
    return tuple(lines)


def _bend(leave: Pose, arrive: Pose, width: float) -> list[Segment] | None:
    stub = FILLET * width
    return shortest_path(leave.ahead(stub), arrive.ahead(-stub), width / 2 + stub)


def notch_side(
    neck: Pose, hinge: Hinge, width: float, side: int
) -> tuple[list[Segment], list[Segment]]:
    """Both halves of the notch on one side (1 left, -1 right) along the neck: wall and arc, then
    arc and wall.
    """
    along = cmath.exp(1j * neck.heading)
    radius = hinge.radius
    across = 1j * side * along
    bottom = neck.point + hinge.neck / 2 * across
    middle = bottom + radius * across
    enter = middle - radius * along
    leave = middle + radius * along
    edge = (width / 2 - hinge.neck / 2 - radius) * across
    return (
        [*polyline(enter + edge, enter), Segment(enter, bottom, middle)],
        [Segment(bottom, leave, middle), *polyline(leave, leave + edge)],
    )


def body_sides(stage: StageContent, chain: int, side: int) -> list[list[Segment]]:
    """Edges of pad, link 1, link 2 and platform lug on one side (1 left, -1 right), each from neck
    to neck.
    """
    width = stage.chain.link_width
    lines = [offset(line, side * width / 2) for line in centrelines(stage, chain)]
    notches = [
        notch_side(neck, stage.hinge(chain, name), width, side)
        for neck, name in zip(necks(stage, chain), HINGE_NAMES, strict=True)
    ]
    pad, first, second = ([*line, *notch[0]] for line, notch in zip(lines, notches, strict=True))
    return [
        pad,
        notches[0][1] + first,
        notches[1][1] + second,
        [*notches[2][1], *lug_side(stage, chain, side)],
    ]


@once
def lug_side(stage: StageContent, chain: int, side: int) -> tuple[Segment, ...]:
    """Edge of a lug on one side (1 left, -1 right), from the face of the hinge to the disc.

    Raises BadInput when the lug cannot reach the disc.
    """
    neck = necks(stage, chain)[2]
    width = stage.chain.link_width
    hinge = stage.hinge(chain, "platform")
    along = cmath.exp(1j * neck.heading)
    across = 1j * side * along
    corner = neck.ahead(hinge.radius).point + width / 2 * across
    front = -(corner / along).real
    aside = side * (-(corner / along)).imag  # centre of the disc relative to the corner
    disc = stage.platform.radius
    fillet = FILLET * width
    if front < width - disc:
        given = given_angles(stage)
        if hinge.axis is not None:
            given = f"{key_of(stage, chain, 'platform', 'axis_deg')} = {np.rad2deg(hinge.axis):.6g}"
        raise BadInput(
            f"{given}: the neck of chain {chain} points past the platform, expected the platform "
            f"centre at least link_width - platform.radius = {width - disc:g} mm ahead of the "
            f"hinge's face, not {front:g}, or platform.radius_mm >= {width - front:g}"
        )
    if aside > 0 and front < disc:  # the face of the hinge meets the disc
        return tuple(_filleted(corner, across, -along, disc, fillet))
    if abs(aside) < disc - fillet:
        return tuple(_filleted(corner, along, across, disc, fillet))
    end = corner + LUG * width * along
    touch = cmath.phase(end) - side * np.arccos(disc / abs(end))
    return tuple(polyline(corner, end, disc * cmath.exp(1j * touch)))


def _filleted(
    start: complex, heading: complex, outside: complex, disc: float, fillet: float
) -> list[Segment]:
    """Line from `start` along `heading` into the disc, with a fillet on the side `outside` (unit
    vectors).
    """
    height = ((start + fillet * outside) / outside).real
    centre = height * outside - np.sqrt((disc + fillet) ** 2 - height**2) * heading
    foot = centre - fillet * outside
    if ((foot - start) / heading).real < 0:
        front = -(start / heading).real
        most = f"<= {np.hypot(front, height) - fillet:.6g}, or " * bool(front > 0)
        raise BadInput(
            f"platform.radius_mm = {disc:g}, the platform covers the platform hinge; expected "
            f"{most}a longer chain.link_lengths_mm[2]"
        )
    return [*polyline(start, foot), Segment(foot, centre * disc / (disc + fillet), centre)]


@once
def cut_angle(stage: StageContent) -> float:
    """Direction, rad, of the radial cut clockwise of the lug of chain 1, half way to the adjacent
    lug.

    Raises BadInput when the lugs leave no free rim between them.
    """
    middle = cmath.phase(sum(necks(stage, chain)[2].point for chain in CHAINS))
    first, last = (
        [
            cmath.phase(lug_side(stage, chain, side)[-1].end * cmath.exp(-1j * middle))
            for chain in CHAINS
        ]
        for side in (1, -1)
    )
    covered = max(last) - min(first)
    if covered > CHAIN_TURN - NARROWEST_RIM:
        raise BadInput(
            f"platform.radius_mm = {stage.platform.radius:g}, expected a platform large enough "
            f"for its three lugs, each covers {np.rad2deg(covered):.0f} of 120 degrees and may "
            f"cover {np.rad2deg(CHAIN_TURN - NARROWEST_RIM):.0f} at chain.link_width_mm = "
            f"{stage.chain.link_width:g}"
        )
    return float(middle + (min(first) + max(last) - CHAIN_TURN) / 2)


@once
def draw_sector(stage: StageContent, chain: int) -> Mapping[str, Face]:
    """Return the faces of the bodies in the sector of one chain (1 to 3), in the frame of chain 1.

    Raises BadInput when they cannot be drawn.
    """
    left, right = (body_sides(stage, chain, side) for side in (1, -1))
    faces = {}
    sections = ["ground", *(f"neck {name}" for name in HINGE_NAMES)]
    for k, (right_edge, left_edge) in enumerate(zip(right, left, strict=True)):
        start = Segment(left_edge[0].start, right_edge[0].start)
        end = Segment(right_edge[-1].end, left_edge[-1].end)
        distal = [(sections[k + 1], [end])] if k < 3 else _platform(stage, end)
        pieces = [
            (sections[k], [start]),
            ("free", right_edge),
            *distal,
            ("free", reverse(left_edge)),
        ]
        path = [(segment, label) for label, piece in pieces for segment in piece]
        faces[BODIES[k]] = Face([segment for segment, _ in path], [label for _, label in path])
    return MappingProxyType(faces)


def _platform(stage: StageContent, rim: Segment) -> list[tuple[str, list[Segment]]]:
    """Outline of the platform in a sector, from the end of the lug's right side to the end of its
    left side.
    """
    disc = stage.platform.radius
    hub = stage.platform.hub_radius
    first = cut_angle(stage)
    behind, middle, ahead = (cmath.exp(1j * (first + k * CHAIN_TURN / 2)) for k in (0, 1, 2))
    return [
        ("free", [Segment(rim.start, disc * ahead, 0j)]),
        ("cut ahead", polyline(disc * ahead, hub * ahead)),
        ("hub", [Segment(hub * ahead, hub * middle, 0j), Segment(hub * middle, hub * behind, 0j)]),
        ("cut behind", polyline(hub * behind, disc * behind)),
        ("free", [Segment(disc * behind, rim.end, 0j)]),
    ]


@once
def stage_layout(stage: StageContent, refuse: bool = True) -> Layout:
    """Return a stage as any other mechanism: three pads and six links, the platform without its
    hub, nine hinges.

    Raises BadInput for bodies that cannot be drawn. Without `refuse`, for drawings, strips between
    the necks and the disc of the platform stand for them, and the refusal is the key of the body at
    fault."""
    width = stage.chain.link_width
    drawn = dict[str, list[Segment]]()
    faults = list[str]()
    for chain in CHAINS:
        try:
            lines: Sequence[Sequence[Segment]] = centrelines(stage, chain)
        except BadInput as refusal:
            if refuse:
                raise
            poses = necks(stage, chain)
            radii = [stage.hinge(chain, at).radius for at in HINGE_NAMES]
            starts = [poses[0].ahead(-radii[0] - width), *map(Pose.ahead, poses, radii)]
            faces = [pose.ahead(-radius) for pose, radius in zip(poses, radii, strict=True)]
            lines = [
                polyline(start.point, face.point)
                for start, face in zip(starts, faces, strict=False)
            ]
            faults.append(refusal.reason)
        for name, line in zip(BODIES, lines, strict=False):
            left, right = (turn(offset(line, side * width / 2), chain) for side in (1, -1))
            ends = Segment(left[0].start, right[0].start), Segment(right[-1].end, left[-1].end)
            drawn[f"{name} of chain {chain}"] = [ends[0], *right, ends[1], *reverse(left)]
    try:
        drawn["platform"] = _platform_outline(stage)
    except BadInput as refusal:
        if refuse:
            raise
        drawn["platform"] = disc(0j, stage.platform.radius).loop
        faults.append(refusal.reason)
    given = f"chain.link_lengths_mm = {list(stage.chain.link_lengths)} at {given_angles(stage)}"
    given += f", chain.link_width_mm = {width:g}, platform.radius_mm = {stage.platform.radius:g}"
    bodies = [
        Body(
            name,
            tuple(loop),
            holes=(tuple(reverse(disc(0j, stage.platform.hub_radius).loop)),)
            if name == "platform"
            else (),
            clamped=(0,) if name.startswith("pad") else (),
            width=None if name == "platform" else width,
            key=next((fault for fault in faults if name in fault), f"{given}, {name}"),
        )
        for name, loop in drawn.items()
    ]
    joints = list[Joint]()
    frames = stage_frames(stage)
    for chain, k in product(range(3), range(3)):
        name = HINGE_NAMES[k]
        hinge = stage.hinge(chain + 1, HINGE_NAMES[k])
        joined = 3 * chain + k, 3 * chain + k + 1 if k < 2 else len(bodies) - 1
        place = complex(*frames.centres[chain, k])
        heading = float(frames.axes[chain, k])
        key = key_of(stage, chain + 1, name, "radius_mm").removesuffix(".radius_mm")
        profile = Circular(hinge.neck, hinge.radius)
        joints.append(
            Joint(f"{name} hinge of chain {chain + 1}", joined, place, heading, profile, 0.0, key)
        )
    return Layout(
        bodies=tuple(bodies),
        joints=tuple(joints),
        points=(("output", Patch(len(bodies) - 1, 0j)),),
        **stage.plane_problem,
    )


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


@once
def body_moments(stage: StageContent) -> AnyArray:
    """Area moments (3 chains, 4 bodies, 3), complex, of pad, links and platform sector, frame of
    the stage.
    """
    sectors = [draw_sector(stage, chain).values() for chain in CHAINS]
    moments = np.array([[area_moments(face.loop)[:3] for face in sector] for sector in sectors])
    moments[..., 1] *= np.exp(1j * CHAIN_TURN * np.arange(3.0))[:, None]
    return moments


def hub_moments(stage: StageContent) -> Array:
    """Area moments (3,), mm^2 to mm^4, of the hub."""
    r = stage.platform.hub_radius
    return np.array([math.pi * r**2, 0.0, math.pi * r**4 / 2])


def mass_per_area(stage: StageContent) -> float:
    """Thickness times density, tonne/mm^2."""
    return stage.thickness * stage.material.density * DENSITY


def carried(stage: StageContent, payload: Payload) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm^2, of hub and payload, which move with the pose."""
    return inertia_of(hub_moments(stage), mass_per_area(stage)) + payload.matrix


def carried_out_of_plane(stage: StageContent, payload: Payload) -> Array:
    """Mass matrix (3, 3), tonne, tonne mm^2, of hub and payload for z and the rotations about x and
    y.

    The moment of inertia of a disc of radius r and thickness b about a diameter is `m (r^2 / 4 +
    b^2 / 12)`."""
    mass, _, second = np.diag(inertia_of(hub_moments(stage), mass_per_area(stage)))
    tilting = second / 2 + mass * stage.thickness**2 / 12 + payload.tilting
    return np.diag([mass + payload.mass, tilting, tilting])


def drawn_inertia(stage: StageContent) -> Array:
    """Mass matrix (3, 3) of the whole stage, pads and hub included, about the platform centre."""
    moments = body_moments(stage).sum(axis=(0, 1)) + hub_moments(stage)
    return inertia_of(moments, mass_per_area(stage))
