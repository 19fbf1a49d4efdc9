"""Layers of an extruded stage: quadratic segments through the thickness, thinner towards the free face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.mechanism.stage import Stage

POINTS = 3  # of Gauss in every layer: exact for products of two quadratic shape functions


class Layers(NamedTuple):
    """Quadratic segments through the thickness, and what their nodes cannot do.

    heights : (m,), mm, of the nodes above the mid-plane, ascending: ends and middles of the layers.
    values, slopes : (m, z), of the shape functions at the points of Gauss; slopes in 1/mm.
    weights : (z,), mm, of these; twice where the segments are half of the thickness.
    held : nodes with w = 0.   fixed : nodes with u = v = 0, of motion out of the plane.
    """

    heights: Array
    values: Array
    slopes: Array
    weights: Array
    held: tuple[int, ...]
    fixed: tuple[int, ...] = ()

    @property
    def antisymmetric(self) -> Layers:
        """The same layers for motion out of the plane."""
        return self._replace(held=(), fixed=(0,))

    @property
    def moving(self) -> Index:
        """Nodes with u and v unknown."""
        return np.setdiff1d(np.arange(len(self.heights)), self.fixed)

    @property
    def lifted(self) -> Index:
        """Nodes with w unknown."""
        return np.setdiff1d(np.arange(len(self.heights)), self.held)

    @property
    def kept(self) -> tuple[Index, Index]:
        """Node and direction (unknowns,) of every unknown of one node of the plane."""
        moving, lifted = self.moving, self.lifted
        directions = np.concatenate([np.tile([0, 1], len(moving)), np.full(len(lifted), 2)])
        return np.concatenate([np.repeat(moving, 2), lifted]), directions

    @property
    def number(self) -> int:
        """How many layers there are."""
        return len(self.heights) // 2

    @property
    def unknowns(self) -> int:
        """Unknowns of one node of the plane: u, v of the moving nodes, then w of the lifted ones."""
        return 2 * len(self.moving) + len(self.lifted)


def mirrored(thickness: float, number: int, surface: float, faces_held: bool = False) -> Layers:
    """Layers of half the thickness, thinner towards the free face; the other half is alike.

    Parameters
    ----------
    surface : mm, distance from the face over which the layers grow; below it the stress of a neck that wide changes.
    faces_held : w = 0 on the faces too, as between two rigid walls without friction: plane strain.

    Notes
    -----
    Bounds are at `a sinh(s asinh(b / 2 a))` from the face, s equally spaced: more layers refine all of them alike.
    """
    spaced = np.linspace(1.0, 0.0, number + 1) * np.arcsinh(thickness / 2 / surface)
    bounds = thickness / 2 - surface * np.sinh(spaced)
    bounds[0] = 0.0
    return layered(bounds, (0, 2 * number) if faces_held else (0,), 2)


def layers_of(stage: Stage, number: int, antisymmetric: bool = False) -> Layers:
    """Layers for a stage, graded for its narrowest neck, and for motion in the plane unless it is antisymmetric."""
    found = mirrored(stage.thickness, number, float(stage.array("neck").min()))
    return found.antisymmetric if antisymmetric else found


def layered(bounds: Array, held: tuple[int, ...] = (), copies: int = 1) -> Layers:
    """Layers with given bounds (l + 1,), mm, ascending; integrals count `copies` times."""
    s, w = np.polynomial.legendre.leggauss(POINTS)
    psi, slope = np.array([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2]), np.array([s - 0.5, -2 * s, s + 0.5])
    high, count = np.diff(bounds), len(bounds) - 1
    heights = np.concatenate([np.column_stack([bounds[:-1], bounds[:-1] + high / 2]).ravel(), bounds[-1:]])
    values, slopes = np.zeros((2, 2 * count + 1, POINTS * count))
    for layer in range(count):
        at = slice(2 * layer, 2 * layer + 3), slice(POINTS * layer, POINTS * (layer + 1))
        values[at], slopes[at] = psi, slope * 2 / high[layer]
    return Layers(heights, values, slopes, np.outer(copies * high / 2, w).ravel(), held)


def rigid_fields(layers: Layers, rigid: Array) -> Array:
    """Displacements (n, m, 3, 3) at all heights per pose, from those of the nodes in the plane (2 n, 3)."""
    plane = rigid.reshape(-1, 1, 2, 3)
    found = np.zeros((len(plane), len(layers.heights), 3, 3))
    if not layers.fixed:
        found[:, :, :2] = plane
        return found
    found[:, :, 2, 0], found[:, :, 2, 1:] = 1.0, -plane[..., 2]
    found[:, :, 0, 2], found[:, :, 1, 1] = layers.heights, -layers.heights
    return found
