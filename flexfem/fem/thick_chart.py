"""The thickness chart: positions and stress factors of `thick` on a grid of Chebyshev points, as a JSON file.

`python -m flexfem.fem.thick_chart [FOLDER]` makes it anew, in the package itself when no folder is given.
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
from flexfem.fem.chart import Progress, chebyshev_points, kept, make_and_say, sampled, versions, write_chart
from flexfem.fem.hinge import Extrapolation
from flexfem.fem.thick import FREEDOMS, LEVELS, ThickHinge, sample, stress_factors

RATIOS, WIDTHS, POISSONS = (0.02, 1.2), (0.5, 50.0), (0.1, 0.45)  # t/R, b/t, nu
SHAPE = (7, 11, 3)  # samples in t/R, b/t and nu
DIGITS = 5  # kept of a position: its uncertainty is some 1e-4
STRESSES = ("bending", "tension")
ABOUT = (
    "Circular hinge (radius R, neck t, thickness b) between elastic blocks as high as the notch, 2R + t, and at least "
    "2(2R + t) and b long, in three dimensions: position p between plane stress and plane strain, "
    "C = C_ps (1 - nu^2 p), of the compliance C in rotation and axially, about the neck's centre, less the blocks'. "
    "Tables [t/R][b/t][nu]. Bands are absolute, of p. Under `stress`, the highest von Mises stress in the notch over "
    "that in plane stress, by a moment and by a pull, on the finest mesh."
)


def chart_points(shape: tuple[int, int, int] = SHAPE) -> tuple[Array, Array, Array]:
    """Sampled t/R, at Chebyshev points in its root, b/t, at those in its logarithm, and nu, at those in itself."""
    ratios = chebyshev_points(shape[0], *np.sqrt(RATIOS)) ** 2
    widths = np.exp(chebyshev_points(shape[1], *np.log(WIDTHS)))
    return np.asarray(ratios), np.asarray(widths), chebyshev_points(shape[2], *POISSONS)


def make_thickness_chart(
    path: Path,
    workers: int = 1,
    shape: tuple[int, int, int] = SHAPE,
    levels: tuple[int, ...] = LEVELS,
    date: str | None = None,
    progress: Progress = lambda done, number: None,
) -> None:
    """Compute the chart and write it as JSON.

    Parameters
    ----------
    workers : processes.   shape : samples in t/R, b/t and nu.   levels : refinements of the meshes, three or more.
    date : ISO date to state, today's when None.   progress : called with the samples done and their number.

    Raises BadInput when the file cannot be written.
    """
    points = chart_points(shape)
    hinges = [ThickHinge(*map(float, point)) for point in product(*points)]
    made = sampled(partial(_both, levels=levels), hinges, workers, progress)
    samples, stresses = ([pair[k] for pair in made] for k in (0, 1))
    write_chart(path, _document(points, samples, stresses, levels, date))


def _both(hinge: ThickHinge, levels: tuple[int, ...]) -> tuple[Extrapolation, Extrapolation]:
    return sample(hinge, levels), stress_factors(hinge, levels[-2:])


def _document(
    points: tuple[Array, Array, Array],
    samples: list[Extrapolation],
    stresses: list[Extrapolation],
    levels: tuple[int, ...],
    date: str | None,
) -> dict[str, Any]:
    shape = tuple(map(len, points))
    values, stress = (np.array([each.values for each in made]).reshape(*shape, 2) for made in (samples, stresses))
    bands = np.array([made.bands for made in samples]).reshape(*shape, 2)
    moved = np.max([made.bands / made.values for made in stresses], axis=0)
    worth = bands * points[2][:, None] ** 2
    return {
        "about": ABOUT,
        "regenerate": "python -m flexfem.fem.thick_chart",
        "date": date or datetime.date.today().isoformat(),
        "versions": versions(),
        "meshes": f"curved quadratic triangles times quadratic segments (no gmsh), refinements {list(levels)}, at most "
        f"{max(made.unknowns for made in samples)} unknowns, Richardson extrapolation with order 4",
        "largest_band": {name: kept(np.max(worth[..., k]), 2) for k, name in enumerate(FREEDOMS)},
        "largest_band_is": "of the compliance, relative: nu^2 times the band of p",
        "range": {"t/R": list(RATIOS), "b/t": list(WIDTHS), "nu": list(POISSONS)},
        "t/R": kept(points[0], 10),
        "b/t": kept(points[1], 10),
        "nu": kept(points[2], 10),
        **{name: kept(values[..., k], DIGITS) for k, name in enumerate(FREEDOMS)},
        "bands": {name: kept(bands[..., k], 2) for k, name in enumerate(FREEDOMS)},
        "stress": {name: kept(stress[..., k], DIGITS) for k, name in enumerate(STRESSES)},
        "largest_band_of_stress": {name: kept(moved[k], 2) for k, name in enumerate(STRESSES)},
    }


def thickness_chart_path() -> Path:
    """Where the package keeps its chart."""
    return Path(str(files("flexfem") / "data" / "thickness_chart.json"))


def main() -> None:
    """Make the chart with two processes and say how far it is."""
    make_and_say(make_thickness_chart, thickness_chart_path(), 20)


if __name__ == "__main__":
    main()
