"""Speed of studies: analytic designs in one process, finite-element designs, and both through a
process pool.

    python benchmarks/study.py [--analytic 1000000] [--meshed 100] [--workers 2] [--collected]
    [--flushed]

Analytic designs vary all 31 dimensions of a stage; finite-element designs vary nine necks. Seconds
are wall time and processor time with that of the workers. `--flushed` compares runs of 10,000
analytic designs with and without the calls that wait until files are on the disk, in turn, in the
folder for temporary files."""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flexfem.sources import ONE_THREAD
from flexfem.study.answer import answer
from flexfem.study.collect import collect
from flexfem.study.columns import Rows
from flexfem.study.loaded import LoadedStudy, load_study
from flexfem.study.run import parts_of, run_parts
from flexfem.study.workers import Workers

STAGE = Path(__file__).parent.parent / "geometry" / "mobility6.toml"
RANGES = {
    "thickness_mm": (5.0, 20.0),
    "material.youngs_modulus_gpa": (70.0, 210.0),
    "material.poissons_ratio": (0.25, 0.35),
    "material.yield_strength_mpa": (200.0, 900.0),
    "chain.link_lengths_mm[0]": (25.0, 40.0),
    "chain.link_lengths_mm[1]": (25.0, 40.0),
    "chain.link_lengths_mm[2]": (21.0, 30.0),
    "chain.joint_angles_deg[0]": (170.0, 190.0),
    "chain.joint_angles_deg[1]": (-100.0, -80.0),
    "chain.joint_angles_deg[2]": (80.0, 100.0),
    "chain.link_width_mm": (8.5, 10.0),
    "platform.radius_mm": (14.0, 17.0),
    "platform.hub_radius_mm": (6.0, 9.0),
    "override.*.*.radius_mm": (1.6, 3.9),
    "override.*.*.neck_mm": (0.1, 0.6),
}
NECKS = {"override.*.*.neck_mm": (0.45, 0.55)}
ANALYTIC = 'model = "analytic"\nformula = "calibrated"\nmobility = 21'


def study(
    folder: Path,
    designs: int,
    head: str = ANALYTIC,
    ranges: dict[str, tuple[float, float]] = RANGES,
) -> Path:
    """A Sobol study of some dimensions."""
    factors = "".join(
        f'[[factor]]\nkey = "{key}"\nfrom = {low}\nto = {high}\n'
        for key, (low, high) in ranges.items()
    )
    path = folder / f"{len(ranges)}.toml"
    path.write_text(
        f'name = "speed"\nstage = "{STAGE}"\n{head}\n'
        f'[sampling]\nmethod = "sobol"\ndesigns = {designs}\nseed = 2003\n'
        f"[drive]\nstroke_um = 17.4\nlever_arm_mm = 10.0\n{factors}"
    )
    return path


def processor_time() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


@contextmanager
def timed(what: str, designs: int) -> Iterator[None]:
    wall = time.perf_counter()
    busy = processor_time()
    yield
    wall = time.perf_counter() - wall
    busy = processor_time() - busy
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{what:45} {wall:8.2f} s, {busy:8.2f} s of processor time, {1e6 * busy / designs:9.1f} "
        f"us a design, {memory:.0f} MB",
        flush=True,
    )


def measure(loaded: LoadedStudy, folder: Path, workers: int, collected: bool) -> None:
    model = loaded.study.model
    count = loaded.count
    answer(loaded, 0, 2)  # imports
    with timed(f"{model}: {count:,} designs in this process", count):
        for start in range(0, count, 8192):
            answer(loaded, start, min(start + 8192, count))
    for number in sorted({1, workers}):
        parts = parts_of(loaded, folder / f"{model}-{number}")
        with timed(f"{model}: run with {number} workers", count), Workers(number) as pool:
            run_parts(parts, pool)
    if collected:
        with timed(f"{model}: collect", count):
            collect(parts, parts.table)


class InThisProcess:
    """In the place of workers: computes in this process."""

    here = True

    def __enter__(self) -> InThisProcess:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def results(
        self, function: Callable[..., Any], next_task: Callable[[], Any], limit: object
    ) -> Iterator[Any]:
        while (task := next_task()) is not None:
            yield task, function(*task)


def unflushed_answer(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """As `answer`, in a process that does not wait for the disk from then on."""
    os.fsync = lambda handle: None
    return answer(loaded, start, stop)


def compare_flushed(loaded: LoadedStudy, folder: Path, workers: int, rounds: int = 9) -> None:
    """Print the time of a run, and its ratio to a run in which `os.fsync` does nothing; medians
    over the rounds.

    Runs with workers take the time to start them, as the command does; runs in this process do not.
    """
    flush = os.fsync
    answer(loaded, 0, loaded.count)
    for place in ("this process", "workers"):
        seconds: dict[str, list[float]] = {"flushed": [], "unflushed": []}
        for turn in range(rounds):
            for name, solve in (("flushed", answer), ("unflushed", unflushed_answer)):
                parts = parts_of(loaded, folder / f"{place}-{name}-{turn}")
                os.fsync = flush
                began = time.perf_counter()
                with InThisProcess() if place == "this process" else Workers(workers) as pool:
                    run_parts(parts, pool, solve)
                seconds[name].append(time.perf_counter() - began)
        os.fsync = flush
        ratios = [
            flushed / not_flushed for flushed, not_flushed in zip(*seconds.values(), strict=True)
        ]
        found = (
            f"{1e3 * statistics.median(seconds['flushed']):.0f} ms, "
            f"{statistics.median(ratios):.3f} times as long as"
        )
        print(
            f"{loaded.count:,} designs in {place}, on the disk: {found} without, medians of "
            f"{rounds}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--analytic", type=int, default=1_000_000)
    parser.add_argument("--meshed", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--collected", action="store_true")
    parser.add_argument("--flushed", action="store_true")
    given = parser.parse_args()
    if not ONE_THREAD.items() <= os.environ.items():  # too late for libraries that are loaded
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **ONE_THREAD})
    with tempfile.TemporaryDirectory() as place:
        if given.flushed:
            compare_flushed(load_study(study(Path(place), 10_000)), Path(place), given.workers)
            return
        if given.analytic:
            measure(
                load_study(study(Path(place), given.analytic)),
                Path(place),
                given.workers,
                given.collected,
            )
        if given.meshed:
            path = study(Path(place), given.meshed, 'model = "fe"', NECKS)
            measure(load_study(path), Path(place), given.workers, given.collected)


if __name__ == "__main__":
    main()
