"""What several questions are asked with: limits of what is given, the model, finite elements."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

from flexfem import arguments

if TYPE_CHECKING:
    from flexfem.mechanism.stage import Stage
    from flexfem.verify.protocol import Solved

RESOLUTION = 8  # quadratic triangles across every neck: the default of `flexfem.solve`
LARGEST_POSE = 1e2  # of a driven stage, mm, rad; no piezo drive goes a thousandth of it
LARGEST_LOAD = 1e6  # on a driven stage, N, N mm
LARGEST_PAYLOAD = (1e4, 1e10)  # kg, kg mm^2; no stage of necks carries a hundredth of it
MOST_MODES = 100
LARGEST_LIFE = 1e12  # cycles; a thousand years at 30 Hz
LARGEST_AMPLITUDE = 1e3  # mm, rad; whether the stage bears it is found out
Progress = Callable[[str], object]
PathLike = str | os.PathLike[str]


def finest_of(resolution: int | None, least: int = 2) -> int | None:
    """The resolution of the finite elements, None where they are left out. Raises BadInput."""
    return None if resolution is None else arguments.resolution(resolution, least)


def meshed_solid(
    resolution: int | None, layers: int | None, least: int = 4, usual: int | None = None
) -> tuple[int, int]:
    """Triangles across every neck, from `least`, and layers in half the thickness, from 3; None takes the usual ones.

    Raises BadInput.
    """
    from flexfem.fem.mesh import LAYERS, SOLID_RESOLUTION

    finest = arguments.resolution((usual or SOLID_RESOLUTION) if resolution is None else resolution, least)
    return finest, arguments.layers(LAYERS if layers is None else layers, 3)


def solver(progress: Progress | None = None) -> Callable[[Stage, int], Solved]:
    """Finite elements that are kept with their stage, so that several questions solve a mesh once."""
    from flexfem.models import solved

    def solve(stage: Stage, resolution: int) -> Solved:
        found = solved(stage, resolution)
        if progress is not None:
            progress(f"{found.response.unknowns} unknowns")
        return found

    return solve
