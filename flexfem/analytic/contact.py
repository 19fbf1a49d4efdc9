"""Contact of parts of a mechanism of beams that moves: rigid bodies, and hinges that bend."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely

from flexfem.analytic.finite import FinitePlate
from flexfem.analytic.plates import moving_bodies
from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.gaps import (
    MIDDLE,
    Gap,
    box_distances,
    gap_between,
    names_of_parts,
    pairs_of_parts,
)
from flexfem.mechanism.hinge_place import ALONG
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.plate import body_polygon

# of a gap: the least share that displacements must be able to close for the gap to be measured
CLOSED = 0.5
MOST_BETWEEN = 32  # positions between two equilibria at which contact is sought


class Clearance:
    """Gaps of the parts of a mechanism at displaced positions, against those at rest.

    A pair of parts is measured where the displacements of both could close the share `CLOSED` of
    its gap."""

    def __init__(
        self,
        layout: Layout,
        plate: FinitePlate,
        marks: Array,
    ) -> None:
        """`marks` (h, beams + 1): positions of the nodes of every hinge on its axis, mm."""
        self.layout = layout
        self.plate = plate
        self.marks = marks
        self.bodies = [
            body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))
        ]
        self.column = {body: 3 * number for number, body in enumerate(moving_bodies(layout))}
        still = np.zeros(plate.size)
        count = len(self.bodies) + 2 * plate.hinges
        self.rest = np.array([self.polygon(part, still) for part in range(count)])
        self.one, self.other = pairs_of_parts(layout)
        self.least = box_distances(shapely.bounds(self.rest), self.one, self.other)
        self.thinnest = min((joint.profile.neck for joint in layout.joints), default=np.inf)
        self.high = np.array([joint.profile.end_height for joint in layout.joints])
        self.known = dict[tuple[int, int], float]()

    def polygon(
        self,
        part: int,
        q: Array,
    ) -> Any:
        """Return the polygon of a part at unknowns q (size,)."""
        number = part - len(self.bodies)
        if number < 0:
            return self._body(part, q)
        hinges = self.plate.hinges
        return self._hinge(number % hinges, q, ALONG if number < hinges else MIDDLE)

    def _body(
        self,
        body: int,
        q: Array,
    ) -> Any:
        at = self.column.get(body)
        if at is None:
            return self.bodies[body]
        centre = self.plate.nodes.centre[at // 3]
        shift = q[at] + 1j * q[at + 1]
        turn = np.exp(1j * q[at + 2])

        def moved(points: Array) -> Array:
            z = centre + shift + turn * (points @ [1, 1j] - centre)
            return np.column_stack([z.real, z.imag])

        return shapely.transform(self.bodies[body], moved)

    def _hinge(
        self,
        number: int,
        q: Array,
        shares: Array,
    ) -> Any:
        """Return the polygon of a bent hinge at shares of its length."""
        joint = self.layout.joints[number]
        x = shares * joint.profile.length
        breaks = np.array(joint.profile.breaks)
        x = np.union1d(x, breaks[(breaks > x[0]) & (breaks < x[-1])])
        place, turn = self.nodes(q)
        heading = joint.heading + turn[number]
        centre = _bent(self.marks[number], place[number], heading, x)
        across = np.interp(x, self.marks[number], turn[number]) + joint.heading + np.pi / 2
        upper = np.exp(1j * across) * joint.profile.height(x) / 2
        z = np.concatenate([centre + upper, (centre - upper)[::-1]])
        return shapely.Polygon(np.column_stack([z.real, z.imag]))

    def nodes(self, q: Array) -> tuple[AnyArray, Array]:
        """Return places (h, beams + 1), mm, complex, and rotations, rad, of nodes of the hinges."""
        at = self.plate.nodes
        full = np.append(q, np.zeros(3))
        turn = full[at.column + 2]
        swung = at.arm * (np.exp(1j * turn) - 1)
        return at.place + full[at.column] + 1j * full[at.column + 1] + swung, turn

    def moved(self, q: Array) -> Array:
        """Return bounds (parts,), mm, of the displacements of all parts."""
        found = np.zeros(len(self.rest))
        boxes = shapely.bounds(self.rest)
        for body, at in self.column.items():
            corners = boxes[body][[0, 2, 0, 2]] + 1j * boxes[body][[1, 1, 3, 3]]
            arm = np.abs(corners - self.plate.nodes.centre[at // 3]).max()
            swing = arm * abs(np.exp(1j * q[at + 2]) - 1)
            found[body] = abs(q[at] + 1j * q[at + 1]) + swing
        place, turn = self.nodes(q)
        still, _ = self.nodes(np.zeros(len(q)))
        of_sections = self.high * np.minimum(1.0, np.abs(turn).max(axis=1))
        furthest = np.abs(place - still).max(axis=1) + of_sections
        # a curve between nodes goes beyond them
        found[len(self.bodies) :] = np.tile(2 * furthest, 2)
        return found

    def smallest(
        self,
        q: Array,
        closed: float = CLOSED,
    ) -> tuple[float, Gap | None]:
        """Return the least gap at unknowns q (size,), per gap at rest, and this gap; 1 without one.

        closed : the pairs are those of which displacements could close this share of the gap.
        """
        least = 1.0
        found: Gap | None = None
        made = dict[int, Any]()
        for pair in self._near(self.moved(q) / closed):
            for part in pair:
                if part not in made:
                    made[part] = self.polygon(part, q)
            gap = gap_between(pair, made[pair[0]], made[pair[1]])
            if gap.width < least * self.known[pair]:
                least = gap.width / self.known[pair]
                found = gap
        return least, found

    def gap(
        self,
        q: Array,
        parts: tuple[int, int],
    ) -> Gap:
        """Return the gap between two parts at unknowns q (size,)."""
        one, other = parts
        return gap_between(parts, self.polygon(one, q), self.polygon(other, q))

    def _near(self, bound: Array) -> Iterable[tuple[int, int]]:
        """Yield the pairs, apart at rest, whose displacements of at most a bound close their gap.

        bound : (parts,), mm.
        """
        for number in np.flatnonzero(self.least <= bound[self.one] + bound[self.other]):
            pair = int(self.one[number]), int(self.other[number])
            if pair not in self.known:
                self.known[pair] = float(shapely.distance(self.rest[pair[0]], self.rest[pair[1]]))
            if 0.0 < self.known[pair] <= bound[pair[0]] + bound[pair[1]]:
                yield pair

    def share_to_contact(
        self,
        before: Array,
        after: Array,
    ) -> float | None:
        """Return the share of the way between two positions q (size,) at which parts touch.

        It is None if they do not.

        The way is divided into steps that are not longer than the thinnest hinge, so that no part
        passes through another unseen."""
        way = self.moved(after - before).max()
        steps = int(np.clip(np.ceil(way / self.thinnest), 1, MOST_BETWEEN))
        for step in range(1, steps + 1):
            share = step / steps
            if self.smallest(before + share * (after - before), 1.0)[0] <= 0:
                return share
        return None

    def said(self, gap: Gap) -> str:
        """Return which parts a gap is between, and where."""
        names = names_of_parts(self.layout)
        one, other = (names[part] for part in gap.parts)
        return f"{one!r} and {other!r} at ({gap.place.real:.4g}, {gap.place.imag:.4g}) mm"


def _bent(
    marks: Array,
    places: AnyArray,
    headings: Array,
    x: Array,
) -> AnyArray:
    """Return points (m,), complex, mm, of cubic curves through the nodes of a bent hinge.

    marks : (n,), mm, positions of the nodes on the axis at rest.
    places, headings : (n,), complex, mm, and rad, of the nodes.
    x : (m,), positions of the points at rest.
    """
    beam = np.clip(np.searchsorted(marks, x, side="right") - 1, 0, len(marks) - 2)
    length = np.diff(marks)[beam]
    share = (x - marks[beam]) / length
    start = places[beam]
    end = places[beam + 1]
    out = np.exp(1j * headings)[beam] * length
    into = np.exp(1j * headings)[beam + 1] * length
    points = start + (end - start) * (share**2 * (3 - 2 * share))
    points += out * share * (1 - share) ** 2 - into * share**2 * (1 - share)
    return np.asarray(points)
