"""What moves in a mode: rigid motions of the parts, and the parts that move most, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from flexfem.analytic.plates import body_moments, moving_bodies, to_axes
from flexfem.arrays import Array, Index
from flexfem.fem.mesh import PlaneMesh
from flexfem.mechanism.layout import Joint, Layout

# motion of a part, relative to that of the part that moves most, from which it is named, too
NAMED_FROM = 0.7
OUTPUT_FROM = 0.3  # the same of the output
AT_REST = 0.1  # motion of a part, relative to the largest one, up to which it is almost at rest
# distance from the pole of a motion, per radius of gyration, up to which a part is said to turn
FROM_ITS_POLE = 3.0
MOST_NAMED = 2
ALIKE_TO = (
    3  # decimals of the relative motion of parts, which are else named in the order of the file
)
ALONG_AXIS = math.cos(math.radians(10.0))  # of the angle to an axis that is called along it
# product of the rigid motions of two parts, relative to that of their whole motions, from which they
# move in opposite directions
OPPOSED = -0.5
OUTPUT = "output"
MIDDLES = slice(3, 6)  # nodes of a triangle at the middles of its sides, which integrate squares


class PartMotion(NamedTuple):
    """Motion of a part in a mode: its name, and its rigid motion about its centre.

    Displacements are root mean squares over the part.

    mean : (3,), mean displacement.   turning : of the rotation in the plane, with its sign.
    tilting : (2,), of the rotations about x and about y.   bending : of all the rest.
    """

    name: str
    mean: Array
    turning: float
    tilting: Array
    bending: float

    @property
    def is_output(self) -> bool:
        """Whether the part is the output, by its name."""
        return OUTPUT in self.name

    @property
    def sizes(self) -> tuple[float, float, float, float]:
        """Displacement by the mean, turning, tilting and bending."""
        tilting = float(np.linalg.norm(self.tilting))
        return float(np.linalg.norm(self.mean)), abs(self.turning), tilting, self.bending

    @property
    def size(self) -> float:
        """Displacement of the part."""
        return math.hypot(*self.sizes)

    @property
    def words(self) -> str:
        """What the part mainly does."""
        mean, turning, *rest = self.sizes
        if FROM_ITS_POLE * turning > mean and turning > max(rest):
            return "turning"
        which = int(np.argmax(self.sizes))
        if which == 0:
            return _along(self.mean)
        if which == 2:
            return f"tilting about {_axis(*self.tilting.tolist())}"
        return "bending"

    def opposes(self, other: PartMotion) -> bool:
        """Whether the part moves against another one that does the same."""
        ours = np.concatenate([self.mean, [self.turning], self.tilting])
        theirs = np.concatenate([other.mean, [other.turning], other.tilting])
        return bool(ours @ theirs < OPPOSED * self.size * other.size)


def _along(mean: Array) -> str:
    """Return the direction of a displacement (3,) in words."""
    if abs(mean[2]) > np.hypot(*mean[:2]):
        return "out of the plane"
    return f"along {_axis(*mean[:2].tolist())}"


def _axis(x: float, y: float) -> str:
    """Return the name of an axis along x and y, or its angle."""
    length = math.hypot(x, y)
    if abs(x) > ALONG_AXIS * length:
        return "x"
    if abs(y) > ALONG_AXIS * length:
        return "y"
    return f"a line at {math.degrees(math.atan2(y, x)) % 180.0:.0f} degrees to x"


def motions_of_parts(
    mesh: PlaneMesh,
    numbers: Sequence[tuple[int, ...]],
    names: Sequence[str],
    field: Array,
) -> list[PartMotion]:
    """Return the motions of parts of a mesh in a mode.

    numbers : of the triangles of each part in `mesh.bodies`.
    field : (n, 2) or (n, 3), displacements of the nodes, of the mid-plane in three dimensions.
    """
    found = list[PartMotion]()
    for name, own in zip(names, numbers, strict=True):
        places, weights = _points_of(mesh, own)
        moved = np.pad(field, [(0, 0), (0, 3 - field.shape[1])])[places]
        found.append(_motion_of(name, mesh.nodes[places], weights, moved))
    return found


def _points_of(mesh: PlaneMesh, own: tuple[int, ...]) -> tuple[Index, Array]:
    """Return nodes (p,) and weights (p,), whose sum is 1, by which to integrate over a part."""
    triangles = mesh.triangles[np.isin(mesh.bodies, own)]
    first, second, third = np.moveaxis(mesh.nodes[triangles[:, :3]] @ [1, 1j], 1, 0)
    areas = ((second - first).conjugate() * (third - first)).imag
    shares = np.array(areas / (3 * max(areas.sum(), np.finfo(float).tiny)), dtype=np.float64)
    return triangles[:, MIDDLES].ravel(), np.repeat(shares, 3)


def _motion_of(
    name: str,
    places: Array,
    weights: Array,
    moved: Array,
) -> PartMotion:
    """Return the motion of a part by displacements (p, 3) at places (p, 2) with weights (p,)."""
    mean = weights @ moved
    arms = places - weights @ places
    spread = (weights[:, None] * arms).T @ arms
    radius = math.sqrt(max(float(np.trace(spread)), np.finfo(float).tiny))
    turn = float(weights @ (arms[:, 0] * moved[:, 1] - arms[:, 1] * moved[:, 0])) / radius**2
    slopes = np.linalg.lstsq(spread, arms.T @ (weights * moved[:, 2]), rcond=None)[0]
    tilting = np.array([slopes[1], -slopes[0]]) * np.sqrt(np.diag(spread)[::-1])
    whole = float(weights @ np.sum(moved**2, axis=1))
    rest = whole - float(mean @ mean) - (turn * radius) ** 2 - float(tilting @ tilting)
    return PartMotion(name, mean, turn * radius, tilting, math.sqrt(max(rest, 0.0)))


def rigid_fields(
    mesh: PlaneMesh,
    numbers: Sequence[tuple[int, ...]],
    twists: Array,
) -> Array:
    """Return displacements (m, n, 2) of the nodes of a mesh by twists (parts, 3, m) at the origin.

    numbers : of the triangles of each part in `mesh.bodies`. Nodes of other parts do not move.
    """
    fields = np.zeros((twists.shape[-1], *mesh.nodes.shape))
    for own, (u, v, turn) in zip(numbers, twists, strict=True):
        nodes = np.unique(mesh.triangles[np.isin(mesh.bodies, own)])
        x, y = mesh.nodes[nodes].T
        fields[:, nodes, 0] = u[:, None] - np.outer(turn, y)
        fields[:, nodes, 1] = v[:, None] + np.outer(turn, x)
    return fields


def network_fields(
    layout: Layout,
    mesh: PlaneMesh,
    twists: Array,
) -> Array:
    """Return displacements (m, n, 2) of the nodes of a mesh by twists (b, 3, m) of moving bodies.

    Sections of hinges move as in their static deflection between two bodies.
    """
    moving = moving_bodies(layout)
    fields = rigid_fields(mesh, [(body,) for body in moving], twists)
    still = np.zeros(twists.shape[1:])
    for number, joint in enumerate(layout.joints, start=len(layout.bodies)):
        nodes = np.unique(mesh.triangles[mesh.bodies == number])
        to_hinge = to_axes(joint.place, joint.heading)
        ends = [twists[moving.index(body)] if body in moving else still for body in joint.bodies]
        near, far = (to_hinge @ end for end in ends)
        local = (mesh.nodes[nodes] @ [1, 1j] - joint.place) * np.exp(-1j * joint.heading)
        sections = near + _opened_before(layout, joint, local.real) @ (far - near)
        moved = sections[:, 0] + 1j * sections[:, 1] + 1j * sections[:, 2] * local[:, None]
        turned = (moved * np.exp(1j * joint.heading)).T
        fields[:, nodes] = np.stack([turned.real, turned.imag], axis=-1)
    return fields


def _opened_before(
    layout: Layout,
    joint: Joint,
    x: Array,
) -> Array:
    """Return the share (p, 3, 3) of the opening of a hinge that occurs before sections at x, mm."""
    profile = joint.profile
    ends = np.array([-0.5, 0.5]) * profile.length
    at = np.concatenate([ends[:1], profile.quadrature[0], ends[1:]])
    within = profile.opened_before(layout.material_of(joint).poissons_ratio)
    known = np.concatenate([np.zeros((1, 3, 3)), within, np.eye(3)[None]]).reshape(-1, 9)
    return np.stack([np.interp(x, at, column) for column in known.T], axis=-1).reshape(-1, 3, 3)


def names_of_bodies(layout: Layout) -> list[str]:
    """Return the names of bodies; that of the output is marked."""
    names = [body.name for body in layout.bodies]
    output = layout.points[0][1].body
    if OUTPUT not in names[output]:
        names[output] += f" ({OUTPUT})"
    return names


def motions_by_twists(layout: Layout, twists: Array) -> list[PartMotion]:
    """Return the motions of moving bodies by their twists (b, 3) at the origin."""
    names = names_of_bodies(layout)
    found = list[PartMotion]()
    for body, (u, v, turn) in zip(moving_bodies(layout), twists.tolist(), strict=True):
        area, first, polar = body_moments(layout, body, hinges=False)[:3]
        centre = complex(first / area)
        radius = math.sqrt(max(float(np.real(polar / area)) - abs(centre) ** 2, 0.0))
        mean = np.array([u - turn * centre.imag, v + turn * centre.real, 0.0])
        found.append(PartMotion(names[body], mean, turn * radius, np.zeros(2), 0.0))
    return found


def what_moves(bodies: Sequence[PartMotion], hinges: Sequence[PartMotion] = ()) -> str:
    """Return the parts that move most in a mode, and how; the output also if it moves less."""
    largest = max(part.size for part in [*bodies, *hinges])
    if any(part.size >= NAMED_FROM * largest for part in bodies):
        return _said(_named(bodies, largest))
    bending = _said(_named(hinges, largest), lambda _: "bending")
    hinge = "hinge" if len(_named(hinges, largest)) == 1 else "hinges"
    first = max((part.size for part in bodies), default=0.0)
    if first <= AT_REST * largest:
        return f"{hinge} {bending}, bodies almost at rest"
    return f"{hinge} {bending}, and less {_said(_named(bodies, first))}"


def _named(parts: Sequence[PartMotion], largest: float) -> list[PartMotion]:
    """Return the parts that move almost as much as the largest motion, and the output from less."""
    return [
        part
        for part in parts
        if part.size >= (OUTPUT_FROM if part.is_output else NAMED_FROM) * largest
    ]


def _said(
    moving: Sequence[PartMotion],
    words: Callable[[PartMotion], str] = lambda part: part.words,
) -> str:
    """Return parts and what they do, those first that move most; the output is never left out."""
    largest = max(part.size for part in moving)
    ordered = sorted(moving, key=lambda part: -round(part.size / largest, ALIKE_TO))
    firsts = [words(part) for part in ordered]
    alike = sorted(ordered, key=lambda part: firsts.index(words(part)))
    groups = [list(parts) for _, parts in groupby(alike, words)]
    shown = [
        parts
        for place, parts in enumerate(groups)
        if place < MOST_NAMED or any(part.is_output for part in parts)
    ]
    said = [_of_group(parts, words(parts[0])) for parts in shown]
    rest = len(ordered) - sum(map(len, shown))
    return ", ".join([*said, f"{rest} more otherwise"] if rest else said)


def _of_group(parts: Sequence[PartMotion], words: str) -> str:
    """Return the names of parts that do the same, and whether some do so against others."""
    against = [part for part in parts if part.opposes(parts[0])]
    names = _listed([part.name for part in parts if part not in against])
    if not against:
        return f"{names} {words}"
    if len(parts) == 2:
        return f"{names} and {against[0].name} in opposite directions {words}"
    return f"{names} against {_listed([part.name for part in against])} {words}"


def _listed(names: Sequence[str]) -> str:
    """Return names in a row; of many, the first ones and the count of the others."""
    rest = len(names) - MOST_NAMED
    if rest > 0:
        return f"{', '.join(names[:MOST_NAMED])} and {rest} more"
    return " and ".join(names)
