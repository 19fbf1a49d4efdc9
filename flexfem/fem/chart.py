"""The hinge chart: compliances of `hinge` on a grid of Chebyshev points, as the file that `analytic.chart` reads.

`python -m flexfem.fem.chart [PATH]` makes it anew, in the package itself when no path is given.
"""

from __future__ import annotations

import datetime
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.charting import Progress, chebyshev_points, kept, make_and_say, sampled, versions, write_chart
from flexfem.fem.hinge import FREEDOMS, LENGTH, LEVELS, Hinge, Sample, sample

RATIOS, HEIGHTS = (0.02, 1.2), (1.0, 3.0)  # t/R, H/h
SHAPE = (10, 8)  # samples in t/R and in H/h
DIGITS = 8  # kept of a number; a slender neck's last two, in rotation, depend on who solved the equations
ABOUT = (
    "Compliances of a circular hinge (radius R, neck t, notch height h = 2R + t) between elastic blocks of height H, "
    "about the neck's centre, plane stress, less the blocks' own as beams from x = R on (Euler-Bernoulli bending, "
    "axial, shear with 6/5). Rotation: E b R^2 theta/M; axial: E b dx/F_x; shear: E b dy/F_y at nu = 0. Rows t/R, "
    "columns H/h. Rotation and axial do not depend on Poisson's ratio; shear grows by exactly 4.8 nu R/H. Bands are "
    "relative."
)


def chart_points(shape: tuple[int, int] = SHAPE) -> tuple[Array, Array]:
    """Sampled t/R, at Chebyshev points in its root, and H/h, at those in its logarithm."""
    ratios = chebyshev_points(shape[0], *np.sqrt(RATIOS)) ** 2
    return np.asarray(ratios), np.exp(chebyshev_points(shape[1], *np.log(HEIGHTS)))


def make_chart(
    path: Path,
    workers: int = 1,
    shape: tuple[int, int] = SHAPE,
    levels: tuple[int, ...] = LEVELS,
    date: str | None = None,
    progress: Progress = lambda done, number: None,
) -> None:
    """Compute the chart and write it as JSON.

    Parameters
    ----------
    workers : processes.   shape : samples in t/R and H/h.   levels : refinements of the meshes, three or more.
    date : ISO date to state, today's when None.   progress : called with the samples done and their number.

    Raises BadInput when the file cannot be written.
    """
    ratios, heights = chart_points(shape)
    hinges = [Hinge(float(ratio), float(height)) for ratio, height in product(ratios, heights)]
    samples = sampled(partial(sample, levels=levels), hinges, workers, progress)
    write_chart(path, _document(ratios, heights, samples, levels, date))


def _document(
    ratios: Array, heights: Array, samples: list[Sample], levels: tuple[int, ...], date: str | None
) -> dict[str, Any]:
    shape = (len(ratios), len(heights))
    values = np.array([made.values for made in samples]).reshape(*shape, 3)
    bands = np.array([made.bands for made in samples]).reshape(*shape, 3)
    return {
        "about": ABOUT,
        "regenerate": "python -m flexfem.fem.chart",
        "date": date or datetime.date.today().isoformat(),
        "versions": versions(),
        "meshes": f"mapped grids of curved quadratic triangles (no gmsh), refinements {list(levels)}, at most "
        f"{max(made.unknowns for made in samples)} unknowns, Richardson extrapolation with order 4; blocks "
        f"{LENGTH:g} H long",
        "largest_band": {name: kept(np.max(bands[..., k]), 2) for k, name in enumerate(FREEDOMS)},
        "range": {"t/R": list(RATIOS), "H/h": list(HEIGHTS)},
        "t/R": kept(ratios, DIGITS),
        "H/h": kept(heights, DIGITS),
        **{name: kept(values[..., k], DIGITS) for k, name in enumerate(FREEDOMS)},
        "bands": {name: kept(bands[..., k], 2) for k, name in enumerate(FREEDOMS)},
    }


def chart_path() -> Path:
    """Where the package keeps its chart."""
    return Path(str(files("flexfem") / "data" / "hinge_chart.json"))


def main() -> None:
    """Make the chart with two processes and say how far it is."""
    make_and_say(make_chart, chart_path(), 10)


if __name__ == "__main__":
    main()
