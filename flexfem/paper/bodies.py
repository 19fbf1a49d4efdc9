"""Outlines and masses of the bodies of a stage: pads, links, platform and the notches between them.

Points are complex numbers, in mm. All three chains are drawn in the frame of chain 1; `turn`
rotates them into place. `geometry/README.md` shows the rules: every body is as wide as the link,
pads are as long as they are wide. Inner bends of links are rounded, because a sharp re-entrant
corner would spoil the convergence of the finite elements. Each side of a lug follows the face of
the hinge if that face meets the disc; otherwise it continues parallel to the neck into the disc,
or, if it would miss the disc, runs tangentially to it. The hub is rigid, so it is not part of the
meshed sectors.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from flexfem.arrays import AnyArray, Array, turned
from flexfem.files.tables import memoized
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.outlines import (
    Face,
    Pose,
    Segment,
    area_moments,
    inertia_of,
    offset,
    polyline,
    reverse,
    shortest_path,
)
from flexfem.paper.designs import stage_frames
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage_file import CHAINS, HINGE_NAMES, Hinge, StageContent, key_of
from flexfem.refused import BadInput
from flexfem.units import DENSITY

# radius of an inner bend, and length of the straight stub next to a notch, per link width
FILLET = 1 / 8
LUG = 1 / 2  # length of the straight part of a lug that is tangential to the disc, per link width
# least free rim between two lugs, rad, where the cut between two sectors lies
NARROWEST_RIM = np.deg2rad(2.0)
BISECTIONS = 24  # of the widest link that can be drawn
BODIES = ("pad", "link 1", "link 2", "platform")


def turn(path: Sequence[Segment], chain: int) -> list[Segment]:
    """Rotate a path of one chain (1 to 3) from the frame of chain 1 to its place on the stage."""
    return [segment.turned((chain - 1) * CHAIN_TURN) for segment in path]


@memoized
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


@memoized
def centrelines(stage: StageContent, chain: int) -> tuple[tuple[Segment, ...], ...]:
    """Centrelines of pad, link 1 and link 2 of one chain, from notch to notch.

    Raises BadInput when no link can be drawn between two hinges.
    """
    poses = necks(stage, chain)
    width = stage.chain.link_width
    radii = notch_radii(stage, chain)
    face = poses[0].ahead(-radii[0])
    lines = [tuple(polyline(face.ahead(-width).point, face.point))]
    for k in (1, 2):
        leave = poses[k - 1].ahead(radii[k - 1])
        arrive = poses[k].ahead(-radii[k])
        bend = _bend(leave, arrive, width)
        if bend is None:
            raise _no_room(stage, f"link {k} of chain {chain}", leave, arrive)
        start = polyline(leave.point, bend[0].start)
        end = polyline(bend[-1].end, arrive.point)
        lines.append((*start, *bend, *end))
    return tuple(lines)


def notch_radii(stage: StageContent, chain: int) -> list[float]:
    """Return the radii of the notches of one chain (1 to 3), mm."""
    return [stage.hinge(chain, name).radius for name in HINGE_NAMES]


def _no_room(
    stage: StageContent,
    link: str,
    leave: Pose,
    arrive: Pose,
) -> BadInput:
    """Return the refusal of a link between two hinges, with the widest one that can be drawn."""
    width = stage.chain.link_width
    possible = 0.0
    impossible = width
    for _ in range(BISECTIONS):
        middle = (possible + impossible) / 2
        if _bend(leave, arrive, middle) is None:
            impossible = middle
        else:
            possible = middle
    otherwise = "nor with any other chain.link_width_mm"
    if possible:
        otherwise = f"only with chain.link_width_mm < {impossible:.4g}"
    return BadInput(
        f"chain.link_lengths_mm = {list(stage.chain.link_lengths)}, expected room for {link}: no "
        f"strip {width:g} mm wide can be drawn from hinge to hinge at {given_angles(stage)}, "
        f"{otherwise}"
    )


def _bend(
    leave: Pose,
    arrive: Pose,
    width: float,
) -> list[Segment] | None:
    stub = FILLET * width
    return shortest_path(leave.ahead(stub), arrive.ahead(-stub), width / 2 + stub)


def notch_side(
    neck: Pose, hinge: Hinge, width: float, side: int
) -> tuple[list[Segment], list[Segment]]:
    """Both halves of the notch on one side (1 left, -1 right) along the neck.

    They are wall and arc, then arc and wall.
    """
    along = cmath.exp(1j * neck.heading)
    radius = hinge.radius
    across = 1j * side * along
    bottom = neck.point + hinge.neck / 2 * across
    middle = bottom + radius * across
    enter = middle - radius * along
    leave = middle + radius * along
    edge = (width / 2 - hinge.neck / 2 - radius) * across
    first = [*polyline(enter + edge, enter), Segment(enter, bottom, middle)]
    second = [Segment(bottom, leave, middle), *polyline(leave, leave + edge)]
    return first, second


def body_sides(
    stage: StageContent,
    chain: int,
    side: int,
) -> list[list[Segment]]:
    """Edges of pad, link 1, link 2 and platform lug on one side (1 left, -1 right), from neck to
    neck.
    """
    width = stage.chain.link_width
    pad, first, second = (offset(line, side * width / 2) for line in centrelines(stage, chain))
    poses = necks(stage, chain)
    hinges = [stage.hinge(chain, name) for name in HINGE_NAMES]
    base, elbow, platform = (
        notch_side(neck, hinge, width, side) for neck, hinge in zip(poses, hinges, strict=True)
    )
    lug = lug_side(stage, chain, side)
    return [
        [*pad, *base[0]],
        [*base[1], *first, *elbow[0]],
        [*elbow[1], *second, *platform[0]],
        [*platform[1], *lug],
    ]


@memoized
def lug_side(
    stage: StageContent,
    chain: int,
    side: int,
) -> tuple[Segment, ...]:
    """Edge of a lug on one side (1 left, -1 right), from the face of the hinge to the disc.

    Raises BadInput when the lug cannot reach the disc.
    """
    neck = necks(stage, chain)[2]
    width = stage.chain.link_width
    along = cmath.exp(1j * neck.heading)
    across = 1j * side * along
    corner = neck.ahead(stage.hinge(chain, "platform").radius).point + width / 2 * across
    front = -(corner / along).real
    aside = side * (-(corner / along)).imag  # centre of the disc relative to the corner
    disc = stage.platform.radius
    fillet = FILLET * width
    if front < width - disc:
        raise _past_platform(stage, chain, front)
    if aside > 0 and front < disc:  # the face of the hinge meets the disc
        return tuple(_filleted(corner, across, -along, disc, fillet))
    if abs(aside) < disc - fillet:
        return tuple(_filleted(corner, along, across, disc, fillet))
    end = corner + LUG * width * along
    touch = cmath.phase(end) - side * np.arccos(disc / abs(end))
    return tuple(polyline(corner, end, disc * cmath.exp(1j * touch)))


def _past_platform(
    stage: StageContent,
    chain: int,
    front: float,
) -> BadInput:
    """Return the refusal of a neck that points past the platform, `front` mm before its centre."""
    width = stage.chain.link_width
    axis = stage.hinge(chain, "platform").axis
    given = given_angles(stage)
    if axis is not None:
        given = f"{key_of(stage, chain, 'platform', 'axis_deg')} = {np.rad2deg(axis):.6g}"
    least = f"link_width - platform.radius = {width - stage.platform.radius:g} mm"
    return BadInput(
        f"{given}: the neck of chain {chain} points past the platform, expected the platform "
        f"centre at least {least} ahead of the hinge's face, not {front:g}, or "
        f"platform.radius_mm >= {width - front:g}"
    )


def _filleted(
    start: complex, heading: complex, outside: complex, disc: float, fillet: float
) -> list[Segment]:
    """Line from `start` along `heading` into the disc, with a fillet on the side `outside`.

    Directions are unit vectors.
    """
    height = ((start + fillet * outside) / outside).real
    centre = height * outside - np.sqrt((disc + fillet) ** 2 - height**2) * heading
    foot = centre - fillet * outside
    if ((foot - start) / heading).real < 0:
        front = -(start / heading).real
        expected = "a longer chain.link_lengths_mm[2]"
        if front > 0:
            expected = f"<= {np.hypot(front, height) - fillet:.6g}, or {expected}"
        raise BadInput(
            f"platform.radius_mm = {disc:g}, the platform covers the platform hinge; expected "
            f"{expected}"
        )
    return [*polyline(start, foot), Segment(foot, centre * disc / (disc + fillet), centre)]


@memoized
def cut_angle(stage: StageContent) -> float:
    """Direction, rad, of the radial cut clockwise of the lug of chain 1, half way to the adjacent
    lug.

    Raises BadInput when the lugs leave no free rim between them.
    """
    middle = cmath.phase(sum(necks(stage, chain)[2].point for chain in CHAINS))
    back = cmath.exp(-1j * middle)

    def reached(side: int) -> list[float]:
        """Directions, rad, from the middle, where the lugs of all chains meet the disc on a side."""
        return [cmath.phase(lug_side(stage, chain, side)[-1].end * back) for chain in CHAINS]

    first = min(reached(1))
    last = max(reached(-1))
    covered = last - first
    free = CHAIN_TURN - NARROWEST_RIM
    if covered > free:
        raise BadInput(
            f"platform.radius_mm = {stage.platform.radius:g}, expected a platform large enough "
            f"for its three lugs, each covers {np.rad2deg(covered):.0f} of 120 degrees and may "
            f"cover {np.rad2deg(free):.0f} at chain.link_width_mm = "
            f"{stage.chain.link_width:g}"
        )
    return float(middle + (first + last - CHAIN_TURN) / 2)


Edges = list[tuple[str, list[Segment]]]  # labels and segments of an outline


@memoized
def draw_sector(stage: StageContent, chain: int) -> Mapping[str, Face]:
    """Return the faces of the bodies in the sector of one chain (1 to 3), in the frame of chain 1.

    Raises BadInput when they cannot be drawn.
    """
    left = body_sides(stage, chain, 1)
    right = body_sides(stage, chain, -1)
    sections = ["ground", *(f"neck {name}" for name in HINGE_NAMES)]
    faces = dict[str, Face]()
    for k, name in enumerate(BODIES):
        start = Segment(left[k][0].start, right[k][0].start)
        end = Segment(right[k][-1].end, left[k][-1].end)
        far: Edges = _platform(stage, end) if name == "platform" else [(sections[k + 1], [end])]
        outline: Edges = [(sections[k], [start]), ("free", right[k])]
        outline += [*far, ("free", reverse(left[k]))]
        faces[name] = _face(outline)
    return MappingProxyType(faces)


def _face(outline: Edges) -> Face:
    """Return the face within an outline."""
    segments = [segment for _, edge in outline for segment in edge]
    labels = [label for label, edge in outline for _ in edge]
    return Face(segments, labels)


def _platform(stage: StageContent, rim: Segment) -> Edges:
    """Outline of the platform in a sector, from the right side of the lug to its left side."""
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


@memoized
def body_moments(stage: StageContent) -> AnyArray:
    """Area moments (3 chains, 4 bodies, 3), complex, of pad, links and platform sector.

    They are in the frame of the stage.
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
    """Mass matrix (3, 3), tonne, tonne mm^2, of hub and payload for z and the tilts about x and y.

    The moment of inertia of a disc of radius r and thickness b about a diameter is
    `m (r^2 / 4 + b^2 / 12)`.
    """
    mass, _, second = np.diag(inertia_of(hub_moments(stage), mass_per_area(stage)))
    tilting = second / 2 + mass * stage.thickness**2 / 12 + payload.tilting
    return np.diag([mass + payload.mass, tilting, tilting])


def drawn_inertia(stage: StageContent) -> Array:
    """Mass matrix (3, 3) of the whole stage, pads and hub included, about the platform centre."""
    moments = body_moments(stage).sum(axis=(0, 1)) + hub_moments(stage)
    return inertia_of(moments, mass_per_area(stage))
