"""Contacts of large displacements: rigid motions nearest to those of parts of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from flexfem.arrays import AnyArray, Array
from flexfem.fem.body_stress import moving_bodies
from flexfem.fem.factor import Solve
from flexfem.fem.ports import PlateModel, contact_forces, through_thickness
from flexfem.mechanism.layout import Layout, Patch, Port

EXACTLY = 1e-12  # relative: smaller eigenvalues of a matrix are zero


class _ContactMotion(NamedTuple):
    """Motions of c parts: numbers (c, 4) of `Contacts`, turned part `1 + s + i b` (c,), complex.

    arm : (c,), mm, complex, turned with the part.   rates : (c, 2), of theta by b and s.
    """

    numbers: Array
    turned: AnyArray
    arm: AnyArray
    rates: Array


class Contacts(NamedTuple):
    """Contacts with c parts of bodies; each moves by the rigid motion nearest to its own.

    The motion of the part is linear in four numbers: displacements x and y of the point and
    rotation of small motions, and stretch. With the rotation b and the stretch s, the nearest
    rotation is `theta = arg(1 + s + i b)`: the polar decomposition of `int (r + u) r' dA` in the
    plane, r from the centroid of the part.

    gather : (4 c, size), rows of these numbers, from the unknowns.
    arm : (c,), mm, from the centroid of the part to the point, complex.
    wrenches : (k, c, 3), on the contacts by a unit load on every port.
    """

    gather: sp.csr_array
    arm: AnyArray
    wrenches: Array

    def _motion(self, unknowns: Array) -> _ContactMotion:
        numbers = np.reshape(self.gather @ unknowns, (-1, 4))
        turned = 1 + numbers[:, 3] + 1j * numbers[:, 2]
        rates = 1 / turned
        arm = self.arm * turned / np.abs(turned)
        return _ContactMotion(numbers, turned, arm, np.stack([rates.real, rates.imag], axis=1))

    def motions(
        self,
        unknowns: Array,
        near: Array,
    ) -> Array:
        """Displacements and rotations (k,) of the ports, mm and rad, the latter as of `turns`."""
        numbers, _, arm, _ = self._motion(unknowns)
        moved = numbers[:, 0] + 1j * numbers[:, 1] + arm - self.arm * (1 + 1j * numbers[:, 2])
        motion = np.stack([moved.real, moved.imag, self.turns(unknowns, near)], axis=1)
        return np.asarray(np.einsum("kca,ca->k", self.wrenches, motion))

    def turns(
        self,
        unknowns: Array,
        near: Array,
    ) -> Array:
        """Rotations (c,) of the parts, rad, that are nearest to given ones."""
        angle = np.angle(self._motion(unknowns).turned)
        return np.asarray(angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi)))

    def loads(self, unknowns: Array) -> Array:
        """Loads (size, k) of unit loads on the ports: derivatives of the motions."""
        _, _, arm, rates = self._motion(unknowns)
        slopes = np.zeros((len(arm), 3, 4))  # of the motion by the numbers
        slopes[:, 0, 0] = 1.0
        slopes[:, 1, 1] = 1.0
        swing = np.stack([-arm.imag, arm.real, np.ones_like(arm.real)], axis=1)
        slopes[:, :, 2:] = swing[:, :, None] * rates[:, None]
        slopes[:, 0, 2] += self.arm.imag
        slopes[:, 1, 2] -= self.arm.real
        onto = np.einsum("kca,can->cnk", self.wrenches, slopes)
        return np.asarray(self.gather.T @ onto.reshape(-1, len(self.wrenches)))

    def change_of_loads(
        self,
        unknowns: Array,
        load: Array,
    ) -> tuple[Array, Array]:
        """Derivative `Y H Y'` of loads (k,) by the unknowns: Y (size, 2 c), and H (2 c, 2 c)."""
        _, _, arm, rates = self._motion(unknowns)
        fx, fy, moment = np.einsum("k,kca->ac", load, self.wrenches)
        first = moment - fx * arm.imag + fy * arm.real
        second = -fx * arm.real - fy * arm.imag
        # theta'' = Im(-dz dz / z^2), z' = i db + ds
        squared = (rates[:, 0] + 1j * rates[:, 1]) ** 2
        bb = squared.imag
        bs = -squared.real
        twice = np.moveaxis(np.array([[bb, bs], [bs, -bb]]), 2, 0)
        H = first[:, None, None] * twice
        H += second[:, None, None] * rates[:, :, None] * rates[:, None]
        at = (4 * np.arange(len(arm))[:, None] + [2, 3]).ravel()
        return self.gather[at].T.toarray(), block_diag(*H)

    def softened(
        self,
        solve: Solve,
        unknowns: Array,
        load: Array,
    ) -> tuple[Solve, int]:
        """Solver of a tangent less the derivative of loads (k,), and the negative pivots it adds.

        The derivative by the unknowns is a matrix of rank 2 c. The number of negative pivots
        follows by Haynsworth's sum of the inertias of the tangent bordered by Y, with the inverse
        of -H.
        """
        Y, whole = self.change_of_loads(unknowns, load)
        soft = solve(Y)
        inner = np.eye(len(whole)) - whole @ (Y.T @ soft)

        def solved(b: Array) -> Array:
            x = solve(b)
            return x + soft @ np.linalg.solve(inner, whole @ (Y.T @ x))

        values, vectors = np.linalg.eigh(whole)
        used = np.abs(values) > EXACTLY * np.abs(values).max(initial=0.0)
        within = vectors[:, used]
        rest = np.diag(1 / values[used]) - within.T @ (Y.T @ soft) @ within
        more = np.sum(np.linalg.eigvalsh(rest) < 0) - np.sum(values[used] < 0)
        return solved, int(more)


def contacts(model: PlateModel) -> Contacts:
    """Return the contacts of the ports of a plate, less those with ground that does not move."""
    moving = _moving_patches(model.layout)
    arms = list[complex]()
    rows = list[Array]()
    for patch in moving:
        along_x, along_y, moment = contact_forces(model.layout, model.mesh, patch)
        arms.append(arm_of(along_x, along_y, moment))
        stretch = np.column_stack([moment[:, 1], -moment[:, 0]])
        numbers = np.stack([along_x, along_y, moment, stretch])
        spread = through_thickness(model.structure, numbers)
        rows.append(model.structure.loads(spread).T)
    wrenches = _wrenches_on(moving, model.layout.ports)
    return Contacts(sp.csr_array(np.concatenate(rows)), np.array(arms), wrenches)


def _moving_patches(layout: Layout) -> list[Patch]:
    """Return the patches of the ports of a layout, each once, that are on moving bodies."""
    patches = dict.fromkeys(patch for port in layout.ports for patch, _ in port.parts)
    moving = set(moving_bodies(layout))
    return [patch for patch in patches if patch.body in moving]


def _wrenches_on(patches: Sequence[Patch], ports: Sequence[Port]) -> Array:
    """Return the wrenches (k, c, 3) on patches by a unit load on every port."""
    found = np.zeros((len(ports), len(patches), 3))
    for k, port in enumerate(ports):
        for patch, wrench in port.parts:
            if patch in patches:
                found[k, patches.index(patch)] += wrench
    return found


def arm_of(
    along_x: Array,
    along_y: Array,
    moment: Array,
) -> complex:
    """Return the arm, mm, from the centroid of a contact to its point.

    along_x, along_y, moment : (n, 2), nodal forces of `contact_forces`. A force at the point is one
        at the centroid with a moment.
    """
    x, y = moment.T
    along = along_y[:, 0] @ x / (x @ x)
    across = along_x[:, 1] @ y / (y @ y)
    return complex(along, -across)
