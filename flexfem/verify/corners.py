"""Bands of what converges slowly or unevenly.

The corners of clamped edges decide drift, ranges and stiffness of a drive; a highest stress changes its place.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.verify.errors import CAUTIOUS, ROUND_OFF

CORNER_ORDER = 1.4  # twice the exponent of stress at a clamped edge's corner, 0.69 at nu = 0.33, 0.71 at 0.3 (Williams)
STRESS_ORDER = 3.0  # between 2, of strains in quadratic triangles, and 4, of the platform compliance


def corner_bands(resolutions: Array, values: Array) -> Array:
    """Half-widths (...) of the mesh uncertainty of values (3 levels, ...) that clamped edges' corners decide.

    Notes
    -----
    Both differences between the meshes are taken to the finest by the order of the corners; the larger counts, with a
    safety factor. Of eight random driven stages on meshes of 4, 6 and 8 triangles across a neck it held ranges and
    stiffness of the drive, and drift, on one of 20 in all 68 numbers that were not round-off; `mesh_band`, of the
    platform's order, left out 23 of them. Of eight others on 20 it held all whose truth these meshes settle
    (`benchmarks/corner_bands.py`).
    """
    return _by_order(resolutions, values, CORNER_ORDER)


def stress_bands(resolutions: Array, values: Array) -> Array:
    """Half-widths (...) of the mesh uncertainty of highest neck stresses (3 levels, ...), and of what follows them.

    Notes
    -----
    As `corner_bands`, by an order of 3. Of 48 highest neck stresses (16 stages, 14 of them random, x, y and theta) on
    meshes of 4, 6 and 8 triangles across a neck it held all on one of 32, the nearest at 0.59 of the band; the grid
    convergence index left out 3, one by nine times its band: its finest two values happened to agree. It held all 24
    of eight other stages (`benchmarks/corner_bands.py`).
    """
    return _by_order(resolutions, values, STRESS_ORDER)


def _by_order(resolutions: Array, values: Array, order: float) -> Array:
    n3, n2, n1 = resolutions**order
    errors = (values[2] - values[1]) / (n1 / n2 - 1), (values[1] - values[0]) / (n1 / n3 - n1 / n2)
    return np.asarray(CAUTIOUS * np.max(np.abs(errors), axis=0))


def pose_bands(resolutions: Array, poses: Array, lever: float) -> Array:
    """Half-widths (3, cases) of the mesh uncertainty of poses (levels, 3, cases) on three meshes, coarse to fine.

    Notes
    -----
    The larger of `corner_bands` bounds every component, rotations with the lever. One that is round-off on every mesh
    has the largest of its values.
    """
    scale = np.array([1.0, 1.0, lever])[:, None]
    scaled = poses * scale
    common = np.max(corner_bands(resolutions, scaled), axis=0)
    largest = np.max(np.abs(scaled), axis=0)
    silent = largest <= ROUND_OFF * np.max(largest, axis=0)
    return np.asarray(np.where(silent, largest, common) / scale)
