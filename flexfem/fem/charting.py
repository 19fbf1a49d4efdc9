"""What the two charts of hinges are made with: Chebyshev points, samples by several processes, a file to read."""

from __future__ import annotations

import importlib.metadata
import json
import multiprocessing
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from flexfem.arrays import Array
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
