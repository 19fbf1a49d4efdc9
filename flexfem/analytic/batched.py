"""Networks of rigid bodies and hinges of one topology, for n designs at once.

The stiffness k of a hinge, at an origin common to all twists, joins two bodies. A body b is
eliminated as a star is by a mesh: with `S = sum_j k_bj` over its neighbours,

    k_ij += k_ib S^-1 k_bj,    F_i += k_ib S^-1 F_b,    u_b = S^-1 (F_b + sum_j k_bj u_j),

where the ground is a neighbour with `u = 0`. As a rigid motion of all bodies causes no force, a
diagonal block is the sum of those beside it and need not be stored; nothing is subtracted, so that
stiff hinges in series with compliant ones cost no digits (as for Markov chains: W. K. Grassmann,
M. I. Taksar, D. P. Heyman, Oper. Res. 33, 1107, 1985). The order is found once: bodies with few
neighbours first, which reduces hinges in series and in parallel, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.analytic.network import GROUND
from flexfem.arrays import AnyArray, Array, inverse


class Bond(NamedTuple):
    """A hinge between two bodies, `GROUND` for the ground, of n designs.

    to_axes : (n, 3, 3), from twists at the common origin to motions at its centre in its axes.
    stiffness : (n, 3, 3), there: axial, transverse, rotation.
    """

    bodies: tuple[int, int]
    to_axes: Array
    stiffness: Array

    def wrench(self, twists: Mapping[int, Array]) -> Array:
        """Return the wrenches (n, 3, c) on its far body, at its centre in its axes."""
        near, far = (twists[body] for body in self.bodies)
        return np.asarray(self.stiffness @ (self.to_axes @ (far - near)))


def to_axes(place: AnyArray, heading: AnyArray | float) -> Array:
    """Return the matrices (n, 3, 3) from twists at the origin to motions of points in turned axes.

    place : (n,), complex, mm.   heading : of the axes, rad, (n,) or one number.
    """
    c, s, x, y = np.broadcast_arrays(np.cos(heading), np.sin(heading), place.real, place.imag)
    found = np.zeros((*c.shape, 3, 3))
    found[..., 0, 0] = c
    found[..., 0, 1] = s
    found[..., 0, 2] = s * x - c * y
    found[..., 1, 0] = -s
    found[..., 1, 1] = c
    found[..., 1, 2] = c * x + s * y
    found[..., 2, 2] = 1.0
    return found


def twists_under(bonds: Sequence[Bond], loads: Mapping[int, Array]) -> dict[int, Array]:
    """Return the twists (n, 3, c) of all bodies, and of the ground, under c loads.

    nan for a design that can move without load, or whose hinges differ so much in stiffness that
    no digits are left.

    loads : (n, 3, c), wrenches at the common origin, by body.
    """
    net = _Net(bonds)
    still = np.zeros_like(next(iter(loads.values())))
    forces = dict(loads)
    eliminated = list[_Step]()
    remaining = {body for bond in bonds for body in bond.bodies} - {GROUND}
    while remaining:
        body = min(remaining, key=lambda each: (len(net.beside(each)), each))
        remaining.remove(body)
        step = net.eliminated(body)
        eliminated.append(step)
        if body in forces:
            for other, share in step.shares.items():
                forces[other] = forces.get(other, still) + np.swapaxes(share, -1, -2) @ forces[body]
    twists = {GROUND: still}
    for step in reversed(eliminated):
        found = step.flexibility @ forces.get(step.body, still)
        for other, share in step.shares.items():
            found = found + share @ twists[other]
        twists[step.body] = found
    return twists


class _Step(NamedTuple):
    """The elimination of a body: `S^-1` (n, 3, 3), and `S^-1 k_bj` by moving neighbour j."""

    body: int
    flexibility: Array
    shares: dict[int, Array]


class _Net:
    """Stiffness (n, 3, 3) between bodies, in both directions; none from the ground to a body."""

    def __init__(self, bonds: Sequence[Bond]) -> None:
        self._between = dict[int, dict[int, Array]]()
        for bond in bonds:
            at_origin = np.swapaxes(bond.to_axes, -1, -2) @ bond.stiffness @ bond.to_axes
            self._add(*bond.bodies, at_origin)

    def _add(
        self,
        one: int,
        other: int,
        stiffness: Array,
    ) -> None:
        directions = ((one, other, stiffness), (other, one, np.swapaxes(stiffness, -1, -2)))
        for near, far, value in directions:
            if near != GROUND:
                row = self._between.setdefault(near, {})
                row[far] = row[far] + value if far in row else value

    def beside(self, body: int) -> list[int]:
        """Return the neighbours of a body, the ground among them."""
        return list(self._between.get(body, {}))

    def eliminated(self, body: int) -> _Step:
        """Eliminate a body: its neighbours are joined with each other."""
        row = self._between.pop(body)
        flexibility = inverse(np.sum(list(row.values()), axis=0))
        shares = {other: flexibility @ stiffness for other, stiffness in row.items()}
        moving = [other for other in row if other != GROUND]
        for place, one in enumerate(moving):
            to_body = self._between[one].pop(body)
            for other in (*moving[place + 1 :], *row.keys() - moving):
                self._add(one, other, to_body @ shares[other])
        shares.pop(GROUND, None)
        return _Step(body, flexibility, shares)
