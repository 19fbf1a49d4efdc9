"""Time from changed numbers to changed answers of a live page, of ten changes each.

    python benchmarks/live.py FILE...

A change is one of the first number of a file by one per cent each time: the time includes the
checked mechanism, its drawing and the analytic model, without the browser (some milliseconds).
"""

from __future__ import annotations

import statistics
import sys
from time import perf_counter

from flexfem.importing.drawings import NO_READING
from flexfem.live.session import Session

CHANGES = 10


def main(files: list[str]) -> None:
    """Print the shortest, median and longest time of each file."""
    for file in files:
        session = Session(file, NO_READING)
        first = session.sliders[0]
        times = list[float]()
        for k in range(CHANGES):
            began = perf_counter()
            session.change(session.answer.values | {first.path: first.value * (1 + 0.01 * (k + 1))})
            times.append(perf_counter() - began)
            assert session.fault is None, session.fault
        print(
            f"{file}: {min(times):.3f} s, median {statistics.median(times):.3f} s, "
            f"longest {max(times):.3f} s"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
