"""The thickness chart: positions of `thick` on a grid of Chebyshev points, as the file that `analytic.thick` reads.

`python -m flexfem.fem.thick_chart [PATH]` makes it anew, in the package itself when no path is given.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import multiprocessing
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.chart import PROGRAMS, Progress, _kept, _lines, chebyshev_points
from flexfem.fem.thick import FREEDOMS, LEVELS, Sample, ThickHinge, sample
from flexfem.files import write_atomically

RATIOS, WIDTHS, POISSONS = (0.02, 1.2), (0.5, 50.0), (0.1, 0.45)  # t/R, b/t, nu
SHAPE = (7, 11, 3)  # samples in t/R, b/t and nu
DIGITS = 5  # kept of a position: its uncertainty is some 1e-4
ABOUT = (
    "Circular hinge (radius R, neck t, thickness b) between elastic blocks as high as the notch, 2R + t, and at least "
    "2(2R + t) and b long, in three dimensions: position p between plane stress and plane strain, "
    "C = C_ps (1 - nu^2 p), of the compliance C in rotation and axially, about the neck's centre, less the blocks'. "
    "Tables [t/R][b/t][nu]. Bands are absolute, of p."
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
    samples = []
    for made in _sampled(hinges, levels, workers):
        samples.append(made)
        progress(len(samples), len(hinges))
    text = _lines(_document(points, samples, levels, date))
    write_atomically(path, lambda file: file.write(text.encode()))


def _sampled(hinges: list[ThickHinge], levels: tuple[int, ...], workers: int) -> Iterator[Sample]:
    compute = partial(sample, levels=levels)
    if workers == 1:
        yield from map(compute, hinges)
        return
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(compute, hinges)


def _document(
    points: tuple[Array, Array, Array], samples: list[Sample], levels: tuple[int, ...], date: str | None
) -> dict[str, Any]:
    shape = tuple(map(len, points))
    values = np.array([made.values for made in samples]).reshape(*shape, 2)
    bands = np.array([made.bands for made in samples]).reshape(*shape, 2)
    worth = bands * points[2][:, None] ** 2
    return {
        "about": ABOUT,
        "regenerate": "python -m flexfem.fem.thick_chart",
        "date": date or datetime.date.today().isoformat(),
        "versions": {program: importlib.metadata.version(program) for program in PROGRAMS},
        "meshes": f"curved quadratic triangles times quadratic segments (no gmsh), refinements {list(levels)}, at most "
        f"{max(made.unknowns for made in samples)} unknowns, Richardson extrapolation with order 4",
        "largest_band": {name: _kept(np.max(worth[..., k]), 2) for k, name in enumerate(FREEDOMS)},
        "largest_band_is": "of the compliance, relative: nu^2 times the band of p",
        "range": {"t/R": list(RATIOS), "b/t": list(WIDTHS), "nu": list(POISSONS)},
        "t/R": _kept(points[0], 10),
        "b/t": _kept(points[1], 10),
        "nu": _kept(points[2], 10),
        **{name: _kept(values[..., k], DIGITS) for k, name in enumerate(FREEDOMS)},
        "bands": {name: _kept(bands[..., k], 2) for k, name in enumerate(FREEDOMS)},
    }


def thickness_chart_path() -> Path:
    """Where the package keeps its chart."""
    return Path(str(files("flexfem") / "data" / "thickness_chart.json"))


def main() -> None:
    """Make the chart with two processes and say how far it is."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else thickness_chart_path()
    make_thickness_chart(path, workers=2, progress=_say)
    print(path)


def _say(done: int, number: int) -> None:
    if done % 20 == 0 or done == number:
        print(f"sample {done} of {number}", flush=True)


if __name__ == "__main__":
    main()
