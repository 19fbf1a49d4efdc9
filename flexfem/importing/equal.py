"""Equal hinges and copies among the parts that were found in a plate; complex points, mm."""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from flexfem.arrays import AnyArray, Array
from flexfem.importing.found import FoundHinge
from flexfem.mechanism.layout import Move
from flexfem.mechanism.outlines import Segment

EQUAL = 1e-3  # mm, between dimensions, and between edges, of equal parts
EQUAL_ANGLE = 1e-2  # degrees, between angles of equal hinges: 1 um at the end of a flank of 6 mm
OPPOSITE = {None: None, "left": "right", "right": "left"}  # sides of a hinge
MOST_PAIRS = 2000  # pairs of hinges that are searched for lines of symmetry
MOST_TRIED = 12  # moves of each kind, those that most pairs of hinges agree on
MOST_ROUND = 24  # copies of a rotation
MOST_LEVELS = 4  # copies of copies


class EqualHinges(NamedTuple):
    """Hinges of one shape with equal dimensions.

    members : indices of the hinges.   dimensions : mean by key, mm and degrees.
    """

    shape: str
    members: tuple[int, ...]
    dimensions: dict[str, float]


def equal_hinges(hinges: Sequence[FoundHinge]) -> list[EqualHinges]:
    """Return the groups of hinges with one shape and equal dimensions, in their order."""
    groups = list[list[int]]()
    for index, hinge in enumerate(hinges):
        group = next((each for each in groups if _are_equal(hinges[each[0]], hinge)), None)
        if group is None:
            groups.append([index])
        else:
            group.append(index)
    return [_mean_of(hinges, group) for group in groups]


def _mean_of(hinges: Sequence[FoundHinge], group: Sequence[int]) -> EqualHinges:
    """Return equal hinges with the means of their dimensions."""
    first = hinges[group[0]]
    means = dict[str, float]()
    for key in first.dimensions:
        means[key] = float(np.mean([hinges[k].dimensions[key] for k in group]))
    return EqualHinges(first.shape, tuple(group), means)


def _are_equal(one: FoundHinge, other: FoundHinge) -> bool:
    """Whether two hinges have one shape and equal dimensions, perhaps turned round or mirrored."""
    if one.shape != other.shape or one.dimensions.keys() != other.dimensions.keys():
        return False
    if (one.side is None) != (other.side is None):
        return False
    for key, value in one.dimensions.items():
        most = EQUAL_ANGLE if key == "angle" else EQUAL
        if abs(value - other.dimensions[key]) > most:
            return False
    seen = (one, turned_round(one), mirrored(one), mirrored(turned_round(one)))
    return any(_same_edges(each, other) for each in seen)


def _same_edges(one: FoundHinge, other: FoundHinge) -> bool:
    """Whether the sides and the tables of two hinges are the same as they stand."""
    rows = np.array(one.table)
    others = np.array(other.table)
    if one.side != other.side or one.smooth != other.smooth or rows.shape != others.shape:
        return False
    return bool(np.all(np.abs(rows - others) <= EQUAL))


def turned_round(hinge: FoundHinge) -> FoundHinge:
    """Return the same hinge as it is described from its second body to its first."""
    rows = tuple((-row[0], *row[:0:-1]) for row in reversed(hinge.table))
    heading = math.remainder(hinge.heading + math.pi, 2 * math.pi)
    return hinge._replace(
        bodies=hinge.bodies[::-1], heading=heading, table=rows, side=OPPOSITE[hinge.side]
    )


def mirrored(hinge: FoundHinge) -> FoundHinge:
    """Return a hinge with its edges mirrored about its axis."""
    rows = tuple((row[0], *row[:0:-1]) for row in hinge.table)
    return hinge._replace(table=rows, side=OPPOSITE[hinge.side])


class PartShape(NamedTuple):
    """What decides whether a body is a copy of another.

    points : (n,), corners of its loops and middles of their sides.
    clamped : (m,), middles of its clamped edges.
    role : such as "fixed"; None for the output, which is no copy.
    """

    points: AnyArray
    clamped: AnyArray
    role: str | None


def shape_of(
    sides: Sequence[Segment],
    clamped: Sequence[int],
    role: str | None,
) -> PartShape:
    """Return the shape of a body from its sides, of which some are clamped."""
    corners = [side.start for side in sides]
    middles = [complex(side.at(0.5)) for side in sides]
    return PartShape(np.array(corners + middles), np.array([middles[k] for k in clamped]), role)


class Images(NamedTuple):
    """The parts to which a move takes others, by the index of the part that it moves."""

    bodies: Mapping[int, int]
    hinges: Mapping[int, int]


class CopiedParts(NamedTuple):
    """One [[copy]]: indices of the bodies and hinges that are copied, and how.

    times, about : of a rotation, the original counted.
    mirror : two points of the line of a mirror image, else None.
    images : by step of the rotation, the copies.
    """

    bodies: tuple[int, ...]
    hinges: tuple[int, ...]
    times: int
    about: complex
    mirror: tuple[complex, complex] | None
    images: tuple[Images, ...]

    @property
    def copied(self) -> int:
        """Number of parts that need not be described."""
        return (len(self.bodies) + len(self.hinges)) * (self.times - 1)

    @property
    def moves(self) -> list[Move]:
        """Moves from the copied parts to their copies."""
        if self.mirror is not None:
            return [mirror_image(*self.mirror)]
        turns = [cmath.exp(2j * math.pi * k / self.times) for k in range(1, self.times)]
        return [Move(turn, self.about - turn * self.about) for turn in turns]


def mirror_image(first: complex, second: complex) -> Move:
    """Return the mirror image about the line through two points."""
    turn = (second - first) / (second - first).conjugate()
    return Move(turn, first - turn * first.conjugate(), mirrored=True)


def find_copies(
    hinges: Sequence[FoundHinge],
    groups: Sequence[EqualHinges],
    shapes: Sequence[PartShape],
    rounded: Callable[[complex], complex],
) -> list[CopiedParts]:
    """Return copies in the order in which they apply, so that few parts have to be described.

    rounded : centre of a rotation or point of a line of symmetry as it will be written.
    """
    parts = _Parts(hinges, groups, shapes)
    bodies = set(range(len(shapes)))
    kept = set(range(len(hinges)))
    found = list[CopiedParts]()
    while len(found) < MOST_LEVELS:
        tried = [parts.copied(move, bodies, kept) for move in parts.moves(kept, rounded)]
        best = max(tried, key=lambda each: each.copied, default=None)
        if best is None or not best.hinges:
            break
        found.append(best)
        for images in best.images:
            bodies -= set(images.bodies.values())
            kept -= set(images.hinges.values())
    return found[::-1]


class _Rotation(NamedTuple):
    about: complex
    times: int


class _Mirror(NamedTuple):
    first: complex
    second: complex


class _Steps(NamedTuple):
    """The moves of a copy, and what they do.

    movable : bodies that every move takes to another one.   chosen : those of them that are copied.
    """

    moves: list[Move]
    images: list[Images]
    movable: set[int]
    chosen: set[int]


class _Parts:
    """The parts of a plate among which copies are searched."""

    def __init__(
        self,
        hinges: Sequence[FoundHinge],
        groups: Sequence[EqualHinges],
        shapes: Sequence[PartShape],
    ) -> None:
        self.hinges = hinges
        self.shapes = shapes
        self.groups = groups
        self.group = {member: k for k, group in enumerate(groups) for member in group.members}
        self.places = np.array([hinge.place for hinge in hinges])
        self.centres = np.array([shape.points.mean() for shape in shapes])
        self.trees = [cKDTree(_columns(shape.points)) for shape in shapes]
        self.tree = cKDTree(_columns(self.places)) if len(hinges) else None

    def moves(
        self, kept: set[int], rounded: Callable[[complex], complex]
    ) -> Iterator[_Rotation | _Mirror]:
        """Yield the moves that may take many of the kept hinges to others."""
        alike = [[k for k in group.members if k in kept] for group in self.groups]
        for members in alike:
            if len(members) > 2:
                centre = rounded(complex(self.places[members].mean()))
                for times in range(MOST_ROUND, 2, -1):
                    if len(members) % times == 0:
                        yield _Rotation(centre, times)
        pairs = [pair for members in alike for pair in combinations(members, 2)]
        one, other = np.array(pairs[:MOST_PAIRS], dtype=np.int64).reshape(-1, 2).T
        apart = self.places[other] - self.places[one]
        distinct = np.abs(apart) > EQUAL
        middle = (self.places[one] + self.places[other])[distinct] / 2
        yield from _mirrors(apart[distinct], middle, rounded)
        for _, k in _frequent([(round(z.real, 3), round(z.imag, 3)) for z in middle.tolist()]):
            yield _Rotation(rounded(complex(middle[k])), 2)

    def copied(
        self,
        move: _Rotation | _Mirror,
        bodies: set[int],
        kept: set[int],
    ) -> CopiedParts:
        """Return the parts, of those given, that a move takes to others again and again."""
        if isinstance(move, _Mirror):
            plan = CopiedParts((), (), 2, 0j, (move.first, move.second), ())
        else:
            plan = CopiedParts((), (), move.times, move.about, None, ())
        images = [
            Images(self._body_images(step, bodies), self._hinge_images(step, kept))
            for step in plan.moves
        ]
        orbits = _orbits(bodies, [step.bodies for step in images])
        movable = {body for orbit in orbits for body in orbit}
        chosen = self._connected(orbits, kept)
        steps = _Steps(plan.moves, images, movable, chosen)
        hinges = self._copied_hinges(_orbits(kept, [step.hinges for step in images]), steps)
        copies = [
            Images(
                {body: step.bodies[body] for body in sorted(chosen)},
                {hinge: step.hinges[hinge] for hinge in hinges},
            )
            for step in images
        ]
        return plan._replace(
            bodies=tuple(sorted(chosen)), hinges=tuple(hinges), images=tuple(copies)
        )

    def _copied_hinges(
        self,
        orbits: Sequence[Sequence[int]],
        steps: _Steps,
    ) -> list[int]:
        """Return one hinge of each orbit whose images connect the images of its bodies.

        The hinges lie near to each other.
        """
        found = list[int]()
        for orbit in orbits:
            near = self.places[found[0] if found else orbit[0]]
            distances = {k: round(abs(self.places[k] - near), 3) for k in orbit}
            for hinge in sorted(orbit, key=lambda k: (distances[k], k)):
                if self._follows(hinge, steps):
                    found.append(hinge)
                    break
        return found

    def _body_images(
        self,
        move: Move,
        bodies: set[int],
    ) -> dict[int, int]:
        """Return the bodies to which a move takes bodies."""
        images = dict[int, int]()
        for body in bodies:
            centre = move(self.shapes[body].points).mean()
            for other in np.flatnonzero(np.abs(self.centres - centre) <= EQUAL).tolist():
                if other in bodies and self._same_body(body, other, move):
                    images[body] = other
        return images

    def _hinge_images(
        self,
        move: Move,
        kept: set[int],
    ) -> dict[int, int]:
        """Return the hinges to which a move takes hinges."""
        if self.tree is None:
            return {}
        order = sorted(kept)
        distance, nearest = self.tree.query(_columns(move(self.places[order])))
        found = np.where(distance <= EQUAL, nearest, -1).tolist()
        images = dict[int, int]()
        for hinge, other in zip(order, found, strict=True):
            if other not in kept or self.group[other] != self.group[hinge]:
                continue
            if self._same_axis(hinge, other, move):
                images[hinge] = other
        return images

    def _same_body(
        self,
        one: int,
        other: int,
        move: Move,
    ) -> bool:
        shape = self.shapes[one]
        target = self.shapes[other]
        if shape.role is None or shape.role != target.role:
            return False
        if len(shape.points) != len(target.points) or len(shape.clamped) != len(target.clamped):
            return False
        gaps = self.trees[other].query(_columns(move(shape.points)))[0]
        apart = np.abs(move(shape.clamped)[:, None] - target.clamped).min(axis=1, initial=np.inf)
        return bool(np.max(gaps) <= EQUAL and np.all(apart <= EQUAL))

    def _same_axis(
        self,
        one: int,
        other: int,
        move: Move,
    ) -> bool:
        """Whether axis and edges of a hinge become those of another.

        The other one may be described in the opposite sense.
        """
        image = self.hinges[one]
        target = self.hinges[other]
        turn = cmath.exp(1j * (move.heading(image.heading) - target.heading))
        reach = sum(image.dimensions.values()) or 1.0
        if move.mirrored:
            image = mirrored(image)
        if turn.real <= 0:
            image = turned_round(image)
        return abs(turn.imag) * reach <= EQUAL and _same_edges(image, target)

    def _connected(
        self,
        orbits: Sequence[Sequence[int]],
        kept: set[int],
    ) -> set[int]:
        """Return one body of each orbit, those that hinges connect where there is a choice."""
        orbit_of = {body: k for k, orbit in enumerate(orbits) for body in orbit}
        beside: dict[int, list[int]] = {}
        for k in sorted(kept):
            first, second = self.hinges[k].bodies
            beside.setdefault(first, []).append(second)
            beside.setdefault(second, []).append(first)
        chosen = set[int]()
        seen = set[int]()
        for orbit in orbits:
            ahead = [min(orbit)]
            while ahead:
                body = ahead.pop(0)
                if body in orbit_of and orbit_of[body] not in seen:
                    seen.add(orbit_of[body])
                    chosen.add(body)
                    ahead += beside.get(body, [])
        return chosen

    def _follows(
        self,
        index: int,
        steps: _Steps,
    ) -> bool:
        """Whether the images of a hinge connect what a [[copy]] connects them to."""
        hinge = self.hinges[index]
        if any(end in steps.movable and end not in steps.chosen for end in hinge.bodies):
            return False
        for move, images in zip(steps.moves, steps.images, strict=True):
            image = self.hinges[images.hinges[index]]
            same_sense = math.cos(move.heading(hinge.heading) - image.heading) > 0
            bodies = image.bodies if same_sense else image.bodies[::-1]
            wanted = [images.bodies[end] if end in steps.chosen else end for end in hinge.bodies]
            if tuple(wanted) != bodies:
                return False
        return True


def _mirrors(
    apart: AnyArray, middle: AnyArray, rounded: Callable[[complex], complex]
) -> Iterator[_Mirror]:
    """Yield the lines of symmetry that most of the pairs of hinges have.

    apart, middle : (n,), vectors between the two hinges of each pair, and points between them.
    """
    across = apart / np.abs(apart)
    is_backward = (across.real < -EQUAL) | ((np.abs(across.real) <= EQUAL) & (across.imag < 0))
    across *= np.where(is_backward, -1, 1)
    level = (middle / across).real
    columns = [np.round(part, 3).tolist() for part in (across.real, across.imag, level)]
    for _, k in _frequent(list(zip(*columns, strict=True))):
        axis = complex(1j * across[k])
        foot = rounded(complex(level[k] * across[k]))
        if _is_square(axis):
            axis = 1 + 0j if abs(axis.real) > abs(axis.imag) else 1j
        yield _Mirror(foot, foot + axis)


def _orbits(parts: set[int], steps: Sequence[Mapping[int, int]]) -> list[list[int]]:
    """Return the parts that all steps take to different ones, each with its images."""
    seen = set[int]()
    found = list[list[int]]()
    for part in sorted(parts):
        orbit = [part, *(step[part] for step in steps if part in step)]
        if len(orbit) == len(steps) + 1 == len(set(orbit)) and not seen & set(orbit):
            found.append(orbit)
            seen |= set(orbit)
    return found


def _frequent(keys: Sequence[tuple[float, ...]]) -> list[tuple[tuple[float, ...], int]]:
    """Return the most frequent keys, each with the index of its first member."""
    first = dict[tuple[float, ...], int]()
    for k, key in enumerate(keys):
        first.setdefault(key, k)
    return [(key, first[key]) for key, _ in Counter(keys).most_common(MOST_TRIED)]


def _is_square(axis: complex) -> bool:
    """Whether a direction is along x or y up to round-off."""
    return min(abs(axis.real), abs(axis.imag)) < 1e-9 * abs(axis)


def _columns(points: AnyArray) -> Array:
    return np.column_stack([points.real, points.imag])
