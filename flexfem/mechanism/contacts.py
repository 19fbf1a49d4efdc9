"""Where stacks push on the bodies of a chain, over which length of a link, and where couples turn the hinges.

A ball dents the metal under it in three dimensions: that is the stiffness of its contact, which the plane stage must
not hold a second time. Both models therefore load a link, and read its motion, on the cross-sections of one length of
its strip, `Station`, with the moment of the true line of action. Of the platform they load and read the rigid hub. A
hinge turns by the mean rotation of a short station directly beyond its notch, less that of one directly before it; a
unit couple on the same stations is conjugate to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.actuators import BODY_NAMES, Body
from flexfem.mechanism.bodies import centrelines
from flexfem.mechanism.designs import chain_rotation
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.stage_file import CHAINS, HINGE_NAMES, StageContent

SPREAD = 0.75  # half a station per link width, assumed: pushes spread evenly over one width have the same deviation
PLAUSIBLE = (0.5, 2.0)  # times that length over which pushes may be spread instead
EDGE = 0.505  # of its width a strip reaches to either side: triangles cut arcs a little outside
LINKS = (1, 2)  # of `BODY_NAMES`, those that are strips


class Station(NamedTuple):
    """The length of a link over which a push is spread, in the frame of chain 1.

    path : lines and arcs along the middle of the link, from notch to notch.   width : of the link, mm.
    middle, half : mm along the path, the middle of the station and half its length.
    """

    path: tuple[Segment, ...]
    width: float
    middle: float
    half: float

    def weight(self, s: Array) -> Array:
        """Share of the push per length (...), 1/mm, at `s` mm along the path: (1 - xi^2)^2, its integral one."""
        xi = np.clip((s - self.middle) / self.half, -1.0, 1.0)
        return np.asarray(15 / (16 * self.half) * (1 - xi**2) ** 2)

    @property
    def starts(self) -> Array:
        """Where each line or arc of the path begins, and where the last ends, mm along the path."""
        return np.cumsum([0.0, *(segment.length for segment in self.path)])

    def spread(self, times: float) -> Station:
        """With so many times its length about the same middle, as far as the strip reaches."""
        return self._replace(half=float(min(times * self.half, self.middle, self.starts[-1] - self.middle)))


def station(stage: StageContent, chain: int, body: int, middle: float, spread: float = SPREAD) -> Station:
    """The station of pad or link (0 to 2) of a chain (1 to 3) about `middle`, mm along its path, within the strip.

    spread : half its length, per link width.
    """
    path, width = centrelines(stage, chain)[body], stage.chain.link_width
    length = sum(segment.length for segment in path)
    half = min(spread * width, length / 2)
    return Station(path, width, min(max(middle, half), length - half), half)


class Nearest(NamedTuple):
    """A place of a path: how far it is from a point, and along the path, mm; where, and the unit normal to the left."""

    distance: float
    along: float
    place: complex
    normal: complex


def nearest(path: Sequence[Segment], point: complex) -> Nearest:
    """The place of a path that is nearest to a point."""
    found, start = list[Nearest](), 0.0
    for segment in path:
        share = np.clip(segment.shares(np.array(point)), 0.0, 1.0)
        place, normal = complex(segment.at(share)), 1j * complex(segment.tangent(share))
        found.append(Nearest(abs(point - place), start + float(share) * segment.length, place, normal))
        start += segment.length
    return min(found, key=lambda each: each[:2])


def spread(of: Station, points: Array) -> Array:
    """Body forces (3, n, 2) per area at points (n, 2) of the link, mm, of unit forces in x and y and a unit couple.

    Frame of chain 1; zero off the station.

    Every section of the station takes its share of the whole wrench, with the stresses of a beam: in a straight strip
    even, parabolic and linear, in a bend those of `bend_stresses`. Under this load the
    stresses of a beam are in equilibrium everywhere.
    """
    z, found, start = points[:, 0] + 1j * points[:, 1], np.zeros((3, len(points)), dtype=complex), 0.0
    for segment in of.path:
        share = segment.shares(z)
        tangent = segment.tangent(share)
        across = ((z - segment.at(share)) / (1j * tangent)).real
        inside = (share >= 0) & (share < 1) & (np.abs(across) < EDGE * of.width)
        weight = of.weight(start + share[inside] * segment.length)
        found[:, inside] += weight * _section(segment, of.width, z[inside], tangent[inside], across[inside])
        start += segment.length
    return np.stack([found.real, found.imag], axis=-1)


def _section(segment: Segment, width: float, z: AnyArray, tangent: AnyArray, across: Array) -> AnyArray:
    """Tractions (3, n), complex, at points of sections that carry a unit force in x, in y, and a unit couple."""
    force, couple = np.array([[1.0], [1j], [0.0]]), np.array([[0.0], [0.0], [1.0]])
    if segment.centre is None:
        moment = couple - (np.conj(z - 1j * tangent * across) * force).imag
        along, aside = (force / tangent).real / width, (force / (1j * tangent)).real / width
        even = along - 12 * across / width**3 * moment
        return np.asarray(even * tangent + aside * 1.5 * (1 - (2 * across / width) ** 2) * 1j * tangent)
    spoke = (z - segment.centre) / np.abs(z - segment.centre)
    moment = couple - (np.conj(segment.centre) * force).imag
    radius, r = abs(segment.start - segment.centre), np.abs(z - segment.centre)
    bent, pulled, sheared, _ = bend_stresses(radius - width / 2, radius + width / 2, r)
    round_about = moment * bent + (force / (1j * spoke)).real * pulled
    return np.asarray((round_about * 1j * spoke + (force / spoke).real * sheared * spoke) * radius / r)


def bend_stresses(a: float, b: float, r: Array) -> tuple[Array, Array, Array, Array]:
    """Stresses (n,) in a section of a bend from radius a to b, at r: of a unit moment, pull and shear, thickness one.

    Moment about the centre of curvature, pull and shear by forces through it. The last is the radial stress of the
    moment; that of the pull is the stress of the shear.

    Golovin's solutions, S. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., 1970, sections 29 and 33; their
    integrals: of the moment's stress times r, of the pull's and of the shear's, are one.
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


def share_beyond(of: Station, s: Array) -> Array:
    """Share (n,) of a push that is beyond `s` (n,), mm along the path."""
    xi = np.clip((s - of.middle) / of.half, -1.0, 1.0)
    return np.asarray(0.5 - 15 / 16 * (xi - 2 * xi**3 / 3 + xi**5 / 5))


class Push(NamedTuple):
    """What one newton of a stack does to one body of a chain.

    body : index into `actuators.BODY_NAMES`.
    wrench : (..., 3), of that newton at the platform centre, frame of chain 1: N, N, N mm; leading axes are designs.
    station : where a link takes it, None on the platform and the frame.
    """

    body: int
    wrench: Array
    station: Station | None


Follows: TypeAlias = Literal["pushed", "carrier"]
FOLLOWS: tuple[Follows, ...] = get_args(Follows)


class Stack(NamedTuple):
    """One stack in its place: its chain (from 0), and the two bodies that it pushes apart along one line.

    pushes : on the body that it pushes, and on its carrier.   point : mm, complex, of the contact, frame of chain 1.
    ball : radius, mm, of the ball at its end, zero for a tip.
    """

    chain: int
    pushes: tuple[Push, Push]
    point: complex = 0j
    ball: float = 0.0

    @property
    def direction(self) -> complex:
        """Unit vector, complex, of the push on the pushed body, frame of chain 1."""
        return complex(*self.pushes[0].wrench[:2])

    def pivot(self, follows: Follows) -> complex:
        """Point, mm, frame of chain 1, that the force goes through whichever way the bodies turn.

        pushed : the centre of the ball, which is fixed to the carrier; the force is normal to a smooth flat of the
            pushed body and turns with it.
        carrier : the contact, a point of the pushed body; the force keeps the direction that the carrier has.
        """
        return self.point - self.ball * self.direction if follows == "pushed" else self.point

    @property
    def across(self) -> Stack:
        """The same contact pushed along its face, a quarter turn counter-clockwise of its push: what friction does."""
        wrench = wrench_of(self.point, 1j * self.direction)
        pushed, carrier = self.pushes
        return self._replace(pushes=(pushed._replace(wrench=wrench), carrier._replace(wrench=-wrench)))

    def spread_over(self, times: float) -> Stack:
        """The stack with its pushes on links spread over so many times the length that is assumed."""
        first, second = (push._replace(station=push.station and push.station.spread(times)) for push in self.pushes)
        return self._replace(pushes=(first, second))

    def placed(self, push: Push) -> Array:
        """Wrench (..., 3) of one of its pushes in the frame of the stage."""
        return np.asarray(push.wrench @ chain_rotation(self.chain).T)


def wrench_of(point: complex | AnyArray, push: complex | AnyArray) -> Array:
    """Wrenches (..., 3) about the origin of forces `push` (...) at points (...), complex."""
    force = np.asarray(push)
    return np.stack([force.real, force.imag, (np.conj(point) * force).imag], axis=-1)


def placed_stack(
    stage: StageContent, chain: int, between: tuple[Body, Body], point: complex, direction: float, ball: float = 0.0
) -> Stack:
    """A stack of a chain (from 0) that pushes the second body at a point, mm, in a direction, rad.

    Both in the frame of chain 1. A link that carries the stack takes its other end at the section nearest to the point.
    """
    wrench = wrench_of(point, np.exp(1j * direction))
    carrier, pushed = (BODY_NAMES.index(body) for body in between)

    def push(body: int, q: Array) -> Push:
        if body not in LINKS:
            return Push(body, q, None)
        middle = nearest(centrelines(stage, chain + 1)[body], point).along
        return Push(body, q, station(stage, chain + 1, body, middle))

    return Stack(chain, (push(pushed, wrench), push(carrier, -wrench)), point, ball)


BESIDE = 0.05  # half a station per link width; as short as meshes of 4 triangles across a neck resolve
PLATFORM = len(BODY_NAMES) - 1


def hinge_couples(stage: StageContent, positions: tuple[int, ...]) -> tuple[Stack, ...]:
    """Unit couples, N mm, that turn the hinges at `positions` (0 the base's) of all chains, position by position."""
    unit, found = np.array([0.0, 0.0, 1.0]), list[Stack]()
    for position, chain in product(positions, CHAINS):
        beyond = position + 1
        first = None if beyond == PLATFORM else station(stage, chain, beyond, 0.0, BESIDE)
        last = station(stage, chain, position, np.inf, BESIDE)
        found.append(Stack(chain - 1, (Push(beyond, unit, first), Push(position, -unit, last))))
    return tuple(found)


def couple_names(positions: tuple[int, ...]) -> tuple[str, ...]:
    """What the hinges of `hinge_couples` are called, in its order."""
    return tuple(f"{HINGE_NAMES[position]}, chain {chain}" for position in positions for chain in CHAINS)
