"""Time from changed numbers to changed answers of a live page, of ten changes each.

    python benchmarks/live.py [FILE...]

Without files it measures the shipped parallelogram, the shipped XY stage, and this stage as it is
imported from its own drawing. A change is one of the first number of a file by one per cent each
time: the time includes the checked mechanism, its drawing and the analytic model, without the
browser (some milliseconds).
"""

from __future__ import annotations

import statistics
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import flexfem
from flexfem.importing.drawings import NO_READING, Reading, import_drawing
from flexfem.live.session import Session

CHANGES = 10
GEOMETRY = Path(__file__).parents[1] / "geometry"
SHIPPED = (GEOMETRY / "parallelogram.toml", GEOMETRY / "xy-stage.toml")


def main(files: list[str]) -> None:
    """Print the shortest, median and longest time of each file."""
    for file in files or SHIPPED:
        measure(Path(file), str(file))
    if files:
        return
    with TemporaryDirectory() as folder:
        drawing = Path(folder) / "drawing.dxf"
        stage = flexfem.load(SHIPPED[1])
        flexfem.export(stage, drawing)
        reading = Reading(thickness=float(stage.thickness), material=stage.material.name)
        imported = drawing.with_suffix(".toml")
        import_drawing(drawing, imported, reading=reading)
        measure(imported, f"{SHIPPED[1]}, imported from its drawing")


def measure(file: Path, name: str) -> None:
    """Print the times of one file."""
    session = Session(file, NO_READING)
    first = session.sliders[0]
    times = list[float]()
    for k in range(CHANGES):
        began = perf_counter()
        session.change(session.answer.values | {first.path: first.value * (1 + 0.01 * (k + 1))})
        times.append(perf_counter() - began)
        assert session.fault is None, session.fault
    print(
        f"{name}: {min(times):.3f} s, median {statistics.median(times):.3f} s, "
        f"longest {max(times):.3f} s"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
