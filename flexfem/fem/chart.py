"""The hinge chart and the thickness chart: hinges on grids of Chebyshev points, as files that `hinges.chart` reads.

`python -m flexfem.fem.chart [FOLDER]` makes them anew, in the package itself when no folder is given.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.hinge import (
    FREEDOMS,
    LENGTH,
    LEVELS,
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
RATIOS = (0.02, 1.2)  # t/R, of all charts
STRESSES = ("bending", "tension")


class Chart(NamedTuple):
    """Where a chart is sampled, by name of its file.

    ends : smallest and largest of every axis by name.   scales : on which the points of each are Chebyshev's, and back.
    shape : samples along each.   digits : kept of places and of values.
    """

    name: str
    meshes: str
    ends: dict[str, tuple[float, float]]
    scales: tuple[tuple[np.ufunc, np.ufunc], ...]
    shape: tuple[int, ...]
    digits: tuple[int, int]
    levels: tuple[int, ...]
    compute: Callable[..., tuple[Extrapolation, ...]]

    @property
    def path(self) -> Path:
        """Where the package keeps it."""
        return Path(str(files("flexfem") / "data" / f"{self.name}.json"))

    def points(self) -> list[Array]:
        """Sampled places along every axis, ascending."""
        found = []
        for ends, (measure, back), number in zip(self.ends.values(), self.scales, self.shape, strict=True):
            low, high = measure(ends)
            x = -np.cos((2 * np.arange(number) + 1) * np.pi / (2 * number))
            found.append(np.sort(back(low + (high - low) * (x + 1) / 2)))
        return found


def _plane(point: tuple[float, ...], levels: tuple[int, ...]) -> tuple[Extrapolation, ...]:
    return (sample(PlaneHinge(*point), levels),)


def _thick(point: tuple[float, ...], levels: tuple[int, ...]) -> tuple[Extrapolation, ...]:
    hinge = ThickHinge(*point)
    return thick_sample(hinge, levels), stress_factors(hinge, levels[-2:])


ROOT = (np.sqrt, np.square)
LOW = Chart(
    "hinge_chart", f"mapped grids of curved quadratic triangles (no gmsh){{}}; blocks {LENGTH:g} H long",
    {"t/R": RATIOS, "H/h": (1.0, 3.0)}, (ROOT, (np.log, np.exp)), (10, 8), (8, 8), LEVELS, _plane,
)  # fmt: skip
HIGH = LOW._replace(
    name="hinge_chart_high", ends={"t/R": RATIOS, "H/h": (3.0, 60.0)}, scales=(ROOT, (np.reciprocal, np.reciprocal)),
    shape=(10, 5),
)  # fmt: skip
THICK = Chart(
    "thickness_chart", "curved quadratic triangles times quadratic segments (no gmsh){}",
    {"t/R": RATIOS, "b/t": (0.5, 50.0), "nu": (0.1, 0.45)}, (ROOT, (np.log, np.exp), (np.positive, np.positive)),
    (7, 11, 3), (10, 5), THICK_LEVELS, _thick,
)  # fmt: skip


def kept(values: Any, digits: int) -> Any:
    """Nested lists of numbers rounded to so many significant digits."""
    if np.ndim(values):
        return [kept(value, digits) for value in values]
    return float(f"{values:.{digits - 1}e}")


def make(chart: Chart, path: Path, workers: int = 2, date: str | None = None) -> None:
    """Compute a chart and write it as JSON, one line a key and one a row of a table.

    date : ISO date to state, today's when None. Raises BadInput when the file cannot be written.
    """
    places = [tuple(map(float, point)) for point in product(*chart.points())]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        samples = list(pool.map(partial(chart.compute, levels=chart.levels), places))
    document = _document(chart, samples, date or datetime.date.today().isoformat())
    entries = (f" {json.dumps(key)}: {json.dumps(value)}".replace("], [", "],\n  [") for key, value in document.items())
    text = "{\n" + ",\n".join(entries) + "\n}\n"
    write_atomically(path, lambda file: file.write(text.encode()))


def _document(chart: Chart, samples: list[tuple[Extrapolation, ...]], date: str) -> dict[str, Any]:
    """The packaged file, whose explanations stay, with what was computed."""
    points, (place_digits, digits), of = chart.points(), chart.digits, [each[0] for each in samples]
    values, bands = (
        np.array([getattr(each, name) for each in of]).reshape(*chart.shape, -1) for name in ("values", "bands")
    )
    names = FREEDOMS[: values.shape[-1]]
    solved = (
        f", refinements {list(chart.levels)}, at most {max(each.unknowns for each in of)} unknowns, Richardson "
        "extrapolation with order 4"
    )
    worth = bands * points[2][:, None] ** 2 if "nu" in chart.ends else bands  # of the compliance
    made: dict[str, Any] = {
        "regenerate": "python -m flexfem.fem.chart",
        "date": date,
        "versions": {program: importlib.metadata.version(program) for program in PROGRAMS},
        "meshes": chart.meshes.format(solved),
        "largest_band": {name: kept(np.max(worth[..., k]), 2) for k, name in enumerate(names)},
        "range": {axis: list(ends) for axis, ends in chart.ends.items()},
        **{axis: kept(at, place_digits) for axis, at in zip(chart.ends, points, strict=True)},
        **{name: kept(values[..., k], digits) for k, name in enumerate(names)},
        "bands": {name: kept(bands[..., k], 2) for k, name in enumerate(names)},
    }
    if "nu" in chart.ends:
        stress = np.array([each[1].values for each in samples]).reshape(*chart.shape, -1)
        moved = np.max([each[1].bands / each[1].values for each in samples], axis=0)
        made["stress"] = {name: kept(stress[..., k], digits) for k, name in enumerate(STRESSES)}
        made["largest_band_of_stress"] = {name: kept(moved[k], 2) for k, name in enumerate(STRESSES)}
    packaged: dict[str, Any] = json.loads(chart.path.read_text())
    return packaged | made


def main() -> None:
    """Make all charts in the folder of the command line or else in the package."""
    for chart in (LOW, HIGH, THICK):
        path = Path(sys.argv[1]) / chart.path.name if len(sys.argv) > 1 else chart.path
        make(chart, path)
        print(path)


if __name__ == "__main__":
    main()
