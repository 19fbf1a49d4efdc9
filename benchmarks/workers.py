"""Speed-up of worker processes over one, by finite elements and analytic; the tables are the same bytes.

    python benchmarks/workers.py [--meshed 64] [--analytic 200000] [--workers 2]

Each run begins when its workers have loaded what they need.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from flexfem.study.answer import answer
from flexfem.study.collect import collect
from flexfem.study.loaded import LoadedStudy, load_study
from flexfem.study.parts import Parts, parts_of
from flexfem.study.pool import LocalPool, require_workers
from flexfem.study.run import run_study

STAGE = Path(__file__).parent.parent / "geometry" / "mobility6.toml"
STUDY = """
name = "workers"
stage = "{stage}"
model = "{model}"
[sampling]
method = "sobol"
designs = {designs}
seed = 29
[[factor]]
key = "override.*.*.neck_mm"
distribution = "normal"
sd = 0.02
"""


def timed(parts: Parts, workers: int) -> float:
    pool = LocalPool(workers)
    try:
        require_workers(pool, answer, parts.loaded)
        run_first(pool, parts)
        started = time.perf_counter()
        run_study(parts, pool)
        return time.perf_counter() - started
    finally:
        pool.close()


def run_first(pool: LocalPool, parts: Parts) -> None:
    """Let every worker answer a design, so that its lazy imports are not counted."""
    futures = [pool.submit(answer, parts.loaded, 0, 1, 60.0) for _ in range(pool.width)]
    for future in futures:
        pool.outcome(future)


def compare(loaded: LoadedStudy, folder: Path, workers: int) -> None:
    tables, seconds = [], []
    for count in (1, workers):
        parts = parts_of(loaded, folder / str(count))
        seconds.append(timed(parts, count))
        tables.append(collect(parts, folder / f"{count}.parquet").path.read_bytes())
    assert tables[0] == tables[1]
    each = [1e3 * spent / loaded.count for spent in seconds]
    print(
        f"{loaded.study.model}: {loaded.count} designs, {seconds[0]:.2f} s with 1 worker ({each[0]:.4g} ms a design), "
        f"{seconds[1]:.2f} s with {workers} ({each[1]:.4g} ms): ratio {seconds[0] / seconds[1]:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshed", type=int, default=64)
    parser.add_argument("--analytic", type=int, default=200_000)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    for model, designs in (("fe", arguments.meshed), ("analytic", arguments.analytic)):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            path = folder / f"{model}.toml"
            path.write_text(STUDY.format(stage=STAGE, model=model, designs=designs))
            compare(load_study(path), folder, arguments.workers)


if __name__ == "__main__":
    main()
