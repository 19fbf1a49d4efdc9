"""Loads of stacks on the bodies of a chain, the length of a link that carries them, and couples on
the hinges.

The local indentation under a ball is three-dimensional. It belongs to the contact stiffness and
must not be counted again in the plane model of the stage. Both models therefore load a link, and
average its motion, over a finite length of its strip, a `Station`, with the moment of the true line
of action. On the platform they use the rigid hub. The rotation of a hinge is the mean rotation of a
short station directly distal to its notch less that of one directly proximal to it; a unit couple
on the same stations is conjugate to this rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.outlines import Segment
from flexfem.paper.actuators import BODY_NAMES, Body
from flexfem.paper.bodies import centrelines
from flexfem.paper.frames import chain_rotation
from flexfem.paper.stage_file import CHAINS, HINGE_NAMES, StageContent

# half length of a station per link width, assumed: same deviation as a uniform load over one width
SPREAD = 0.75
PLAUSIBLE = (0.5, 2.0)  # plausible lengths of a station relative to the assumed one
# half width of a strip per link width; above 0.5 because triangles cut arcs a little outside
EDGE = 0.505
LINKS = (1, 2)  # indices of the links in `BODY_NAMES`


class Station(NamedTuple):
    """Length of a link over which a load is distributed, in the frame of chain 1.

    path : centreline of the link, from notch to notch.   width : of the link, mm.
    middle, half : mm along the path, the middle of the station and half its length.
    """

    path: tuple[Segment, ...]
    width: float
    middle: float
    half: float

    def weight(self, s: Array) -> Array:
        """Distribution of the load (...), 1/mm, at `s` mm along the path: (1 - xi^2)^2, normalized
        to integral one.
        """
        xi = np.clip((s - self.middle) / self.half, -1.0, 1.0)
        return np.asarray(15 / (16 * self.half) * (1 - xi**2) ** 2)

    @property
    def starts(self) -> Array:
        """Starts of all lines and arcs of the path, and the end of the last, mm along the path."""
        return np.cumsum([0.0, *(segment.length for segment in self.path)])

    def spread(self, times: float) -> Station:
        """The station scaled about its middle to `times` its length, limited to the strip."""
        return self._replace(
            half=float(min(times * self.half, self.middle, self.starts[-1] - self.middle))
        )


def station(
    stage: StageContent, chain: int, body: int, middle: float, spread: float = SPREAD
) -> Station:
    """Station of a pad or link (0 to 2) of a chain (1 to 3) about `middle`, mm along its path,
    moved into the strip.

    spread : half length of the station per link width.
    """
    path = centrelines(stage, chain)[body]
    width = stage.chain.link_width
    length = sum(segment.length for segment in path)
    half = min(spread * width, length / 2)
    return Station(path, width, min(max(middle, half), length - half), half)


class Nearest(NamedTuple):
    """Projection of a point on a path: distance and arc length, mm, position, and unit normal to
    the left.
    """

    distance: float
    along: float
    place: complex
    normal: complex


def nearest(path: Sequence[Segment], point: complex) -> Nearest:
    """Return the point of a path that is nearest to a given point."""
    projections = list[Nearest]()
    start = 0.0
    for segment in path:
        share = float(np.clip(segment.shares(np.array(point)), 0.0, 1.0))
        place = complex(segment.at(share))
        normal = 1j * complex(segment.tangent(share))
        projections.append(
            Nearest(abs(point - place), start + share * segment.length, place, normal)
        )
        start += segment.length
    return min(projections, key=lambda projection: projection[:2])


def body_forces(station: Station, points: Array) -> Array:
    """Body forces (3, n, 2) per area at points (n, 2) of the link, mm, for unit forces in x and y
    and a unit couple.

    Frame of chain 1; zero outside the station.

    Every section of the station takes its share of the whole wrench with the stress distribution of
    a beam: uniform, parabolic and linear in a straight strip, `bend_stresses` in a bend. Beam
    stresses balance this load at every point.
    """
    z = points[:, 0] + 1j * points[:, 1]
    force = np.zeros((3, len(points)), dtype=complex)
    start = 0.0
    for segment in station.path:
        share = segment.shares(z)
        tangent = segment.tangent(share)
        across = ((z - segment.at(share)) / (1j * tangent)).real
        inside = (share >= 0) & (share < 1) & (np.abs(across) < EDGE * station.width)
        weight = station.weight(start + share[inside] * segment.length)
        force[:, inside] += weight * _section(
            segment, station.width, z[inside], tangent[inside], across[inside]
        )
        start += segment.length
    return np.stack([force.real, force.imag], axis=-1)


def _section(
    segment: Segment, width: float, z: AnyArray, tangent: AnyArray, across: Array
) -> AnyArray:
    """Tractions (3, n), complex, at points of cross-sections that carry a unit force in x or y, or
    a unit couple.
    """
    force = np.array([[1.0], [1j], [0.0]])
    couple = np.array([[0.0], [0.0], [1.0]])
    if segment.centre is None:
        moment = couple - (np.conj(z - 1j * tangent * across) * force).imag
        axial = (force / tangent).real / width
        shear = (force / (1j * tangent)).real / width
        normal = axial - 12 * across / width**3 * moment
        return np.asarray(
            normal * tangent + shear * 1.5 * (1 - (2 * across / width) ** 2) * 1j * tangent
        )
    spoke = (z - segment.centre) / np.abs(z - segment.centre)
    moment = couple - (np.conj(segment.centre) * force).imag
    radius = abs(segment.start - segment.centre)
    r = np.abs(z - segment.centre)
    by_moment, by_pull, by_shear, _ = bend_stresses(radius - width / 2, radius + width / 2, r)
    hoop = moment * by_moment + (force / (1j * spoke)).real * by_pull
    return np.asarray((hoop * 1j * spoke + (force / spoke).real * by_shear * spoke) * radius / r)


def bend_stresses(
    a: float,
    b: float,
    r: Array,
) -> tuple[Array, Array, Array, Array]:
    """Stresses (n,) at r in a bend from radius a to b, thickness one, for a unit moment, axial
    force and shear force.

    Hoop stresses of the moment about the centre of curvature and of an axial force through it,
    shear stress of a shear force through it, and radial stress of the moment. The radial stress of
    the axial force equals the third result.

    Golovin's solutions, S. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., 1970, sections
    29 and 33. Over the section, the first result times r, the second and the third integrate to one
    each.
    """
    log = np.log(b / a)
    q = (a * b / r) ** 2 * log
    radial = q + b**2 * np.log(r / b) + a**2 * np.log(a / r)
    moment = radial - 2 * q + b**2 - a**2
    pull = 3 * r - (a * b) ** 2 / r**3 - (a**2 + b**2) / r
    shear = r + (a * b) ** 2 / r**3 - (a**2 + b**2) / r
    by_moment = (b**2 - a**2) ** 2 / 4 - (a * b * log) ** 2
    by_force = b**2 - a**2 - (a**2 + b**2) * log
    return moment / by_moment, pull / by_force, shear / by_force, radial / by_moment


def share_beyond(station: Station, s: Array) -> Array:
    """Share (n,) of the load of a station that acts distal to `s` (n,), mm along the path."""
    xi = np.clip((s - station.middle) / station.half, -1.0, 1.0)
    return np.asarray(0.5 - 15 / 16 * (xi - 2 * xi**3 / 3 + xi**5 / 5))


class Push(NamedTuple):
    """Load of one newton of a stack on one body of a chain.

    body : index into `actuators.BODY_NAMES`.
    wrench : (..., 3), of that newton about the platform centre, frame of chain 1: N, N, N mm;
    leading axes are designs.
    station : length of a link that carries the load, None on the platform and the frame.
    """

    body: int
    wrench: Array
    station: Station | None


Follows: TypeAlias = Literal["pushed", "carrier"]
FOLLOWS: tuple[Follows, ...] = get_args(Follows)


class Stack(NamedTuple):
    """One stack of the stage: its chain (from 0), and its loads on two bodies along one line of
    action.

    pushes : on the driven body and on the carrier.   point : mm, complex, of the contact, frame of
    chain 1.
    ball : radius, mm, of the ball at the end of the stack, zero for a tip.
    """

    chain: int
    pushes: tuple[Push, Push]
    point: complex = 0j
    ball: float = 0.0

    @property
    def direction(self) -> complex:
        """Unit vector, complex, of the force on the driven body, frame of chain 1."""
        return complex(*self.pushes[0].wrench[:2])

    def pivot(self, follows: Follows) -> complex:
        """Point, mm, frame of chain 1, through which the force acts at every rotation of the
        bodies.

        pushed : the centre of the ball, which is fixed to the carrier; the force is normal to a
        smooth flat of the
            driven body and rotates with it.
        carrier : the contact, a point of the driven body; the force rotates with the carrier.
        """
        return self.point - self.ball * self.direction if follows == "pushed" else self.point

    @property
    def across(self) -> Stack:
        """The friction force of the contact, as a stack whose force is rotated by 90 degrees
        counter-clockwise.
        """
        wrench = wrench_of(self.point, 1j * self.direction)
        driven, carrier = self.pushes
        return self._replace(
            pushes=(driven._replace(wrench=wrench), carrier._replace(wrench=-wrench))
        )

    def spread_over(self, times: float) -> Stack:
        """The stack with its loads on links distributed over `times` the assumed length."""
        first, second = (
            push._replace(station=push.station and push.station.spread(times))
            for push in self.pushes
        )
        return self._replace(pushes=(first, second))

    def placed(self, push: Push) -> Array:
        """Wrench (..., 3) of one load of the stack in the frame of the stage."""
        return np.asarray(push.wrench @ chain_rotation(self.chain).T)


def wrench_of(point: complex | AnyArray, force: complex | AnyArray) -> Array:
    """Wrenches (..., 3) about the origin of forces (...) at points (...), complex."""
    force = np.asarray(force)
    return np.stack([force.real, force.imag, (np.conj(point) * force).imag], axis=-1)


def placed_stack(
    stage: StageContent,
    chain: int,
    between: tuple[Body, Body],
    point: complex,
    direction: float,
    ball: float = 0.0,
) -> Stack:
    """Return a stack of a chain (from 0) that loads the second body at a point, mm, in a direction,
    rad.

    Both are in the frame of chain 1. A link that carries the stack is loaded at the section nearest
    to the point.
    """
    wrench = wrench_of(point, np.exp(1j * direction))
    carrier, driven = (BODY_NAMES.index(body) for body in between)

    def load(body: int, wrench: Array) -> Push:
        if body not in LINKS:
            return Push(body, wrench, None)
        middle = nearest(centrelines(stage, chain + 1)[body], point).along
        return Push(body, wrench, station(stage, chain + 1, body, middle))

    return Stack(chain, (load(driven, wrench), load(carrier, -wrench)), point, ball)


# half length of a hinge's stations per link width, the least that 4 triangles across a neck resolve
BESIDE = 0.05
PLATFORM = len(BODY_NAMES) - 1


def hinge_couples(stage: StageContent, positions: tuple[int, ...]) -> dict[str, Stack]:
    """Unit couples, N mm, on the hinges at `positions` (0 for the base) of all chains, by the name
    of the hinge.
    """
    unit = np.array([0.0, 0.0, 1.0])
    couples = dict[str, Stack]()
    for position, chain in product(positions, CHAINS):
        distal = position + 1
        first = None if distal == PLATFORM else station(stage, chain, distal, 0.0, BESIDE)
        pushes = (
            Push(distal, unit, first),
            Push(position, -unit, station(stage, chain, position, np.inf, BESIDE)),
        )
        couples[f"{HINGE_NAMES[position]}, chain {chain}"] = Stack(chain - 1, pushes)
    return couples
