"""A study of many analytic designs of 31 factors through the commands: run by shards, status, collect, plot.

Every command is a process of its own; its processor time and that of its workers, and the largest memory of any of
them, are what the system counts. Slopes are between the smallest and the largest size: linear is 1.

    python benchmarks/study_large.py --designs 100000 1000000 10000000 --shards 10 --folder /scratch
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from study import study

FIGURES = """
[[figure]]
kind = "distribution"
values = ["kxx_n_per_mm", "ktt_n_mm_per_rad", "coupling_xy", "range_x_um"]
[[figure]]
kind = "pareto"
x = "range_x_um"
y = "kxx_n_per_mm"
"""


class Cost(NamedTuple):
    """Wall and processor time in s, largest memory in MB, of a command or of the worst and the sum of several."""

    wall: float
    processor: float
    memory: float


def command(*words: str) -> Cost:
    """Run a command of flexfem to its end."""
    started = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "flexfem", *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"flexfem {' '.join(words)}: exit code {os.waitstatus_to_exitcode(status)}")
    return Cost(time.perf_counter() - started, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def commands(file: Path, output: Path, shards: int) -> Iterator[tuple[str, Cost]]:
    """The commands of a study, one after the other, with what they cost."""
    where = ("--output", str(output))
    shares = [f"{k}/{shards}" for k in range(1, shards + 1)]
    runs = [command("study", "run", str(file), "--workers", "1", "--shard", share, *where) for share in shares]
    yield "run", Cost(sum(r.wall for r in runs), sum(r.processor for r in runs), max(r.memory for r in runs))
    yield "a finished share again", command("study", "run", str(file), "--workers", "1", "--shard", shares[0], *where)
    yield "status", command("study", "status", str(file), *where)
    yield "collect --partitioned", command("study", "collect", str(file), "--partitioned", *where)
    yield "plot", command("study", "plot", str(file), *where)


@contextmanager
def folder_in(place: Path | None, kept: bool) -> Iterator[Path]:
    """A folder to write in, removed at the end unless it is kept."""
    folder = Path(tempfile.mkdtemp(dir=place))
    try:
        yield folder
    finally:
        if not kept:
            shutil.rmtree(folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, nargs="+", default=[20_000, 200_000])
    parser.add_argument("--shards", type=int, default=10)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--keep", action="store_true")
    arguments = parser.parse_args()
    found: dict[str, dict[int, Cost]] = {}
    for designs in arguments.designs:
        with folder_in(arguments.folder, arguments.keep) as folder:
            file = study(folder, designs).path
            file.write_text(file.read_text() + FIGURES)
            for name, cost in commands(file, folder, arguments.shards):
                found.setdefault(name, {})[designs] = cost
                print(f"{designs:>11,} {name:24} {cost.wall:8.1f} s, {cost.processor:8.1f} s of processor time, "
                      f"{cost.memory:6.0f} MB", flush=True)  # fmt: skip
    few, many = min(arguments.designs), max(arguments.designs)
    for name, costs in found.items() if many > few else ():
        more = costs[many].processor - costs[few].processor
        slope = np.log(costs[many].processor / costs[few].processor) / np.log(many / few)
        print(f"{name:24} {1e6 * more / (many - few):7.2f} us a design more, time goes with designs^{slope:.2f}")


if __name__ == "__main__":
    main()
