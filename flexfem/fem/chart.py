"""The hinge chart: compliances of `hinge` on two grids of Chebyshev points, as the files that `analytic.chart` reads.

`python -m flexfem.fem.chart [FOLDER]` makes them anew, in the package itself when no folder is given.
"""

from __future__ import annotations

import datetime
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.charting import Progress, chebyshev_points, kept, make_and_say, sampled, versions, write_chart
from flexfem.fem.hinge import FREEDOMS, LENGTH, LEVELS, Hinge, Sample, sample

RATIOS = (0.02, 1.2)  # t/R
DIGITS = 8  # kept of a number; a slender neck's last two, in rotation, depend on who solved the equations
ABOUT = (
    "Compliances of a circular hinge (radius R, neck t, notch height h = 2R + t) between elastic blocks of height H, "
    "about the neck's centre, plane stress, less the blocks' own as beams from x = R on (Euler-Bernoulli bending, "
    "axial, shear with 6/5). Rotation: E b R^2 theta/M; axial: E b dx/F_x; shear: E b dy/F_y at nu = 0. Rows t/R, "
    "columns H/h. Rotation and axial do not depend on Poisson's ratio; shear grows by exactly 4.8 nu R/H. Bands are "
    "relative."
)


class Grid(NamedTuple):
    """Where one of the two charts is sampled.

    name : of its file.   heights : smallest and largest H/h.   shape : samples in t/R and H/h.
    measure, inverse : of H/h, the scale on which its points are Chebyshev's, and back.
    """

    name: str
    heights: tuple[float, float]
    shape: tuple[int, int]
    measure: np.ufunc
    inverse: np.ufunc


LOW = Grid("hinge_chart.json", (1.0, 3.0), (10, 8), np.log, np.exp)
HIGH = Grid("hinge_chart_high.json", (3.0, 60.0), (10, 5), np.reciprocal, np.reciprocal)


def chart_points(grid: Grid) -> tuple[Array, Array]:
    """Sampled t/R, at Chebyshev points in its root, and H/h, at those on the grid's scale; both ascend."""
    ratios = chebyshev_points(grid.shape[0], *np.sqrt(RATIOS)) ** 2
    return np.asarray(ratios), np.sort(grid.inverse(chebyshev_points(grid.shape[1], *grid.measure(grid.heights))))


def make_chart(
    path: Path,
    grid: Grid = LOW,
    workers: int = 1,
    levels: tuple[int, ...] = LEVELS,
    date: str | None = None,
    progress: Progress = lambda done, number: None,
) -> None:
    """Compute the chart of a grid and write it as JSON.

    Parameters
    ----------
    workers : processes.   levels : refinements of the meshes, three or more.
    date : ISO date to state, today's when None.   progress : called with the samples done and their number.

    Raises BadInput when the file cannot be written.
    """
    ratios, heights = chart_points(grid)
    hinges = [Hinge(float(ratio), float(height)) for ratio, height in product(ratios, heights)]
    samples = sampled(partial(sample, levels=levels), hinges, workers, progress)
    write_chart(path, _document(grid, samples, levels, date))


def _document(grid: Grid, samples: list[Sample], levels: tuple[int, ...], date: str | None) -> dict[str, Any]:
    ratios, heights = chart_points(grid)
    values = np.array([made.values for made in samples]).reshape(*grid.shape, 3)
    bands = np.array([made.bands for made in samples]).reshape(*grid.shape, 3)
    return {
        "about": ABOUT,
        "regenerate": "python -m flexfem.fem.chart",
        "date": date or datetime.date.today().isoformat(),
        "versions": versions(),
        "meshes": f"mapped grids of curved quadratic triangles (no gmsh), refinements {list(levels)}, at most "
        f"{max(made.unknowns for made in samples)} unknowns, Richardson extrapolation with order 4; blocks "
        f"{LENGTH:g} H long",
        "largest_band": {name: kept(np.max(bands[..., k]), 2) for k, name in enumerate(FREEDOMS)},
        "range": {"t/R": list(RATIOS), "H/h": list(grid.heights)},
        "t/R": kept(ratios, DIGITS),
        "H/h": kept(heights, DIGITS),
        **{name: kept(values[..., k], DIGITS) for k, name in enumerate(FREEDOMS)},
        "bands": {name: kept(bands[..., k], 2) for k, name in enumerate(FREEDOMS)},
    }


def chart_path(grid: Grid) -> Path:
    """Where the package keeps the chart of a grid."""
    return Path(str(files("flexfem") / "data" / grid.name))


def main() -> None:
    """Make both charts with two processes and say how far they are."""
    for grid in (LOW, HIGH):
        make_and_say(partial(make_chart, grid=grid), chart_path(grid), 10)


if __name__ == "__main__":
    main()
