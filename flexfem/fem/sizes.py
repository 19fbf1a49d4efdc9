"""Sizes of triangles of all meshes, and further attempts at a mesh that fails its checks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.layout import Move
from flexfem.meshing.requests import Grading
from flexfem.refused import ComputationFailed

TIME_LIMIT = 60.0  # s, for meshing a plate without what its number of triangles adds
COARSEST = 2.0  # local thickness that sets the triangle size far from the necks, per width
GROWTH = 1.6  # of the triangle size with the distance from a neck, times the triangles across it
PER_TURN = 9.0  # triangles per full turn of a bend; an arc of a notch follows the cone of its neck
SMALLER = 0.3  # size of triangles in place of poor ones, per longest side
SLOPE = 0.4  # growth of their size with the distance, as with 4 triangles across a neck

Drawing = TypeVar("Drawing")
Mesh = TypeVar("Mesh")


def smaller_at(
    corners: Array,
    coarse: float,
    moves: Sequence[Move] = (),
) -> list[Grading]:
    """Return smaller sizes at the places of some triangles, and at the images of these places.

    corners : (n, 3, 2), mm, of the triangles.   coarse : largest size, mm.
    """
    found = list[Grading]()
    for triangle in corners @ [1, 1j]:
        longest = float(np.abs(triangle - np.roll(triangle, 1)).max())
        size = SMALLER * longest
        largest = max(coarse, longest)
        places = [move(complex(triangle.mean())) for move in (Move(), *moves)]
        found.append(Grading(places, longest, size, largest, (largest - size) / SLOPE))
    return found


def first_good(
    drawing: Drawing,
    mesh: Callable[[Drawing], Mesh],
    changed: Callable[[Drawing, ComputationFailed], Drawing | None],
    attempts: int,
) -> Mesh:
    """Return the mesh of a drawing from the first attempt that does not fail.

    changed : returns the drawing of the next attempt after a failure, None if there is none.

    Raises the ComputationFailed of the last attempt.
    """
    for left in range(attempts - 1, -1, -1):
        try:
            return mesh(drawing)
        except ComputationFailed as failure:
            following = changed(drawing, failure) if left else None
            if following is None:
                raise
            drawing = following
    raise ValueError(f"{attempts} attempts, expected at least one")
