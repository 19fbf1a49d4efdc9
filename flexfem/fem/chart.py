"""The hinge chart: compliances of `hinge` on a grid of Chebyshev points, as the file that `analytic.chart` reads.

`python -m flexfem.fem.chart [PATH]` makes it anew, in the package itself when no path is given.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.hinge import FREEDOMS, LENGTH, LEVELS, Hinge, Sample, sample
from flexfem.files import write_atomically

RATIOS, HEIGHTS = (0.02, 1.2), (1.0, 3.0)  # t/R, H/h
SHAPE = (10, 8)  # samples in t/R and in H/h
DIGITS = 8  # kept of a number; a slender neck's last two, in rotation, depend on who solved the equations
PROGRAMS = ("flexfem", "scikit-fem", "numpy", "scipy")
ABOUT = (
    "Compliances of a circular hinge (radius R, neck t, notch height h = 2R + t) between elastic blocks of height H, "
    "about the neck's centre, plane stress, less the blocks' own as beams from x = R on (Euler-Bernoulli bending, "
    "axial, shear with 6/5). Rotation: E b R^2 theta/M; axial: E b dx/F_x; shear: E b dy/F_y at nu = 0. Rows t/R, "
    "columns H/h. Rotation and axial do not depend on Poisson's ratio; shear grows by exactly 4.8 nu R/H. Bands are "
    "relative."
)

Progress = Callable[[int, int], None]


def chebyshev_points(number: int, low: float, high: float) -> Array:
    """Zeros (number,) of the Chebyshev polynomial of that degree on an interval, in ascending order."""
    x = -np.cos((2 * np.arange(number) + 1) * np.pi / (2 * number))
    return np.asarray(low + (high - low) * (x + 1) / 2)


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
    samples = []
    for made in _sampled(hinges, levels, workers):
        samples.append(made)
        progress(len(samples), len(hinges))
    text = _lines(_document(ratios, heights, samples, levels, date))
    write_atomically(path, lambda file: file.write(text.encode()))


def _sampled(hinges: list[Hinge], levels: tuple[int, ...], workers: int) -> Iterator[Sample]:
    compute = partial(sample, levels=levels)
    if workers == 1:
        yield from map(compute, hinges)
        return
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(compute, hinges)


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
        "versions": {program: importlib.metadata.version(program) for program in PROGRAMS},
        "meshes": f"mapped grids of curved quadratic triangles (no gmsh), refinements {list(levels)}, at most "
        f"{max(made.unknowns for made in samples)} unknowns, Richardson extrapolation with order 4; blocks "
        f"{LENGTH:g} H long",
        "largest_band": {name: _kept(np.max(bands[..., k]), 2) for k, name in enumerate(FREEDOMS)},
        "range": {"t/R": list(RATIOS), "H/h": list(HEIGHTS)},
        "t/R": _kept(ratios),
        "H/h": _kept(heights),
        **{name: _kept(values[..., k]) for k, name in enumerate(FREEDOMS)},
        "bands": {name: _kept(bands[..., k], 2) for k, name in enumerate(FREEDOMS)},
    }


def _lines(document: dict[str, Any]) -> str:
    """JSON with one line a key and one a row of a table: short enough to read, and to compare."""
    entries = (f" {json.dumps(key)}: {json.dumps(value)}".replace("], [", "],\n  [") for key, value in document.items())
    return "{\n" + ",\n".join(entries) + "\n}\n"


def _kept(values: Any, digits: int = DIGITS) -> Any:
    """Nested lists of numbers rounded to so many significant digits."""
    if np.ndim(values):
        return [_kept(value, digits) for value in values]
    return float(f"{values:.{digits - 1}e}")


def chart_path() -> Path:
    """Where the package keeps its chart."""
    return Path(str(files("flexfem") / "data" / "hinge_chart.json"))


def main() -> None:
    """Make the chart with two processes and say how far it is."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else chart_path()
    make_chart(path, workers=2, progress=_say)
    print(path)


def _say(done: int, number: int) -> None:
    if done % 10 == 0 or done == number:
        print(f"sample {done} of {number}", flush=True)


if __name__ == "__main__":
    main()
