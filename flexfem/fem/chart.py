"""The hinge chart and the thickness chart: hinges on grids of Chebyshev points, as files that `hinges.chart` reads.

`python -m flexfem.fem.chart [FOLDER]` makes them anew, in the package itself when no folder is given.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import multiprocessing
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.hinge import (
    FREEDOMS,
    LENGTH,
    LEVELS,
    THICK_FREEDOMS,
    THICK_LEVELS,
    Extrapolation,
    PlaneHinge,
    ThickHinge,
    sample,
    stress_factors,
    thick_sample,
)
from flexfem.files.writing import write_atomically

PROGRAMS = ("flexfem", "scikit-fem", "numpy", "scipy")

Progress = Callable[[int, int], None]
Point = TypeVar("Point")
Made = TypeVar("Made")


class Make(Protocol):
    """Computes a chart and writes it."""

    def __call__(self, path: Path, *, workers: int, progress: Progress) -> None: ...


def chebyshev_points(number: int, low: float, high: float) -> Array:
    """Zeros (number,) of the Chebyshev polynomial of that degree on an interval, in ascending order."""
    x = -np.cos((2 * np.arange(number) + 1) * np.pi / (2 * number))
    return np.asarray(low + (high - low) * (x + 1) / 2)


def sampled(compute: Callable[[Point], Made], points: Sequence[Point], workers: int, progress: Progress) -> list[Made]:
    """Samples at points, in their order, by so many processes; progress is told the samples done and their number."""
    samples: list[Made] = []

    def take(found: Any) -> None:
        for made in found:
            samples.append(made)
            progress(len(samples), len(points))

    if workers == 1:
        take(map(compute, points))
    else:
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
            take(pool.map(compute, points))
    return samples


def versions() -> dict[str, str]:
    """Versions of the programs that a chart depends on."""
    return {program: importlib.metadata.version(program) for program in PROGRAMS}


def kept(values: Any, digits: int) -> Any:
    """Nested lists of numbers rounded to so many significant digits."""
    if np.ndim(values):
        return [kept(value, digits) for value in values]
    return float(f"{values:.{digits - 1}e}")


def write_chart(path: Path, document: dict[str, Any]) -> None:
    """Write JSON with one line a key and one a row of a table: short enough to read, and to compare.

    Raises BadInput when the file cannot be written.
    """
    entries = (f" {json.dumps(key)}: {json.dumps(value)}".replace("], [", "],\n  [") for key, value in document.items())
    text = "{\n" + ",\n".join(entries) + "\n}\n"
    write_atomically(path, lambda file: file.write(text.encode()))


def make_and_say(make: Make, usual: Path, every: int) -> None:
    """Make a chart with two processes, in the folder of the command line or else the usual one; say how far it is."""

    def say(done: int, number: int) -> None:
        if done % every == 0 or done == number:
            print(f"sample {done} of {number}", flush=True)

    path = Path(sys.argv[1]) / usual.name if len(sys.argv) > 1 else usual
    make(path, workers=2, progress=say)
    print(path)


RATIOS = (0.02, 1.2)  # t/R, of all charts
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
    hinges = [PlaneHinge(float(ratio), float(height)) for ratio, height in product(ratios, heights)]
    samples = sampled(partial(sample, levels=levels), hinges, workers, progress)
    write_chart(path, _document(grid, samples, levels, date))


def _document(grid: Grid, samples: list[Extrapolation], levels: tuple[int, ...], date: str | None) -> dict[str, Any]:
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


WIDTHS, POISSONS = (0.5, 50.0), (0.1, 0.45)  # b/t, nu
THICK_SHAPE = (7, 11, 3)  # samples in t/R, b/t and nu
THICK_DIGITS = 5  # kept of a position: its uncertainty is some 1e-4
STRESSES = ("bending", "tension")
THICK_ABOUT = (
    "Circular hinge (radius R, neck t, thickness b) between elastic blocks as high as the notch, 2R + t, and at least "
    "2(2R + t) and b long, in three dimensions: position p between plane stress and plane strain, "
    "C = C_ps (1 - nu^2 p), of the compliance C in rotation and axially, about the neck's centre, less the blocks'. "
    "Tables [t/R][b/t][nu]. Bands are absolute, of p. Under `stress`, the highest von Mises stress in the notch over "
    "that in plane stress, by a moment and by a pull, on the finest mesh."
)


def thick_chart_points(shape: tuple[int, int, int] = THICK_SHAPE) -> tuple[Array, Array, Array]:
    """Sampled t/R, at Chebyshev points in its root, b/t, at those in its logarithm, and nu, at those in itself."""
    ratios = chebyshev_points(shape[0], *np.sqrt(RATIOS)) ** 2
    widths = np.exp(chebyshev_points(shape[1], *np.log(WIDTHS)))
    return np.asarray(ratios), np.asarray(widths), chebyshev_points(shape[2], *POISSONS)


def make_thickness_chart(
    path: Path,
    workers: int = 1,
    shape: tuple[int, int, int] = THICK_SHAPE,
    levels: tuple[int, ...] = THICK_LEVELS,
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
    points = thick_chart_points(shape)
    hinges = [ThickHinge(*map(float, point)) for point in product(*points)]
    made = sampled(partial(_both, levels=levels), hinges, workers, progress)
    samples, stresses = ([pair[k] for pair in made] for k in (0, 1))
    write_chart(path, _thick_document(points, samples, stresses, levels, date))


def _both(hinge: ThickHinge, levels: tuple[int, ...]) -> tuple[Extrapolation, Extrapolation]:
    return thick_sample(hinge, levels), stress_factors(hinge, levels[-2:])


def _thick_document(
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
        "about": THICK_ABOUT,
        "regenerate": "python -m flexfem.fem.chart",
        "date": date or datetime.date.today().isoformat(),
        "versions": versions(),
        "meshes": f"curved quadratic triangles times quadratic segments (no gmsh), refinements {list(levels)}, at most "
        f"{max(made.unknowns for made in samples)} unknowns, Richardson extrapolation with order 4",
        "largest_band": {name: kept(np.max(worth[..., k]), 2) for k, name in enumerate(THICK_FREEDOMS)},
        "largest_band_is": "of the compliance, relative: nu^2 times the band of p",
        "range": {"t/R": list(RATIOS), "b/t": list(WIDTHS), "nu": list(POISSONS)},
        "t/R": kept(points[0], 10),
        "b/t": kept(points[1], 10),
        "nu": kept(points[2], 10),
        **{name: kept(values[..., k], THICK_DIGITS) for k, name in enumerate(THICK_FREEDOMS)},
        "bands": {name: kept(bands[..., k], 2) for k, name in enumerate(THICK_FREEDOMS)},
        "stress": {name: kept(stress[..., k], THICK_DIGITS) for k, name in enumerate(STRESSES)},
        "largest_band_of_stress": {name: kept(moved[k], 2) for k, name in enumerate(STRESSES)},
    }


def thickness_chart_path() -> Path:
    """Where the package keeps its chart."""
    return Path(str(files("flexfem") / "data" / "thickness_chart.json"))


def main() -> None:
    """Make all charts with two processes and say how far they are."""
    for grid in (LOW, HIGH):
        make_and_say(partial(make_chart, grid=grid), chart_path(grid), 10)
    make_and_say(make_thickness_chart, thickness_chart_path(), 20)


if __name__ == "__main__":
    main()
