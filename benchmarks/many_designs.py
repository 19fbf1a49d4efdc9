"""Analytic designs of the shipped parallelogram and XY stage as arrays against one after the other.

    python benchmarks/many_designs.py [--designs 100000] [--looped 20]

Both are studies of the same designs with stiffness, stress and range at yield; in the second every
design is drawn, too. The second is timed on fewer designs and scaled. The largest relative
difference of their numbers is printed, and the error of the fits of wide hinges."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from flexfem.study.answer import answer
from flexfem.study.arrays import ArrayBatch
from flexfem.study.loaded import LoadedStudy, load_study

ROOT = Path(__file__).parent.parent
FACTORS = {
    "parallelogram": {"length_mm": (30, 60), "neck_mm": (0.3, 0.8), "distance_mm": (20, 60)},
    "xy-stage": {"leaf_mm": (12, 25), "neck_mm": (0.3, 0.8), "half_mm": (12, 20)},
}
LIMITS = {"parallelogram": 5.0, "xy-stage": 15.0}  # s, for 100,000 designs on one core
STRESSED = {"parallelogram": "leaf", "xy-stage": "link"}


def study_of(folder: Path, name: str, designs: int, check: str) -> LoadedStudy:
    factors = "".join(
        f'[[factor]]\nkey = "parameters.{key}"\nfrom = {low}\nto = {high}\n'
        for key, (low, high) in FACTORS[name].items()
    )
    asked = ["free.analytic.x", "free.analytic.y", "yield_range.analytic.x"]
    asked.append(f"stress.analytic.{STRESSED[name]}.x")
    path = folder / f"{name}-{check}.toml"
    path.write_text(
        f'name = "{name}"\nstage = "{ROOT / "geometry" / name}.toml"\nmodel = "analytic"\n'
        f'check = "{check}"\nask = {[f"stiffness.{each}" for each in asked]}\n'
        f'[sampling]\nmethod = "sobol"\ndesigns = {designs}\nseed = 1\n{factors}'
    )
    return load_study(path)


def compared(folder: Path, name: str, designs: int, looped: int) -> None:
    arrays = study_of(folder, name, designs, "closed_form")
    started = time.perf_counter()
    together = answer(arrays, 0, designs)
    seconds = time.perf_counter() - started
    drawn = study_of(folder, name, designs, "drawing")
    answer(drawn, 0, 1)
    started = time.perf_counter()
    alone = answer(drawn, 0, looped)
    loop = (time.perf_counter() - started) / looped * designs
    made = np.flatnonzero(alone.status == "ok")
    off = np.max(np.abs(together.values[made] / alone.values[made] - 1))
    batch = arrays.family.batch
    assert isinstance(batch, ArrayBatch)
    limit = LIMITS[name] * designs / 100_000
    print(
        f"{name}: {designs} designs in {seconds:.2f} s as arrays (limit {limit:g} s), {loop:.0f} s "
        f"one after the other, ratio {loop / seconds:.0f}; {1e6 * seconds / designs:.1f} us a "
        f"design; numbers of {len(made)} of {looped} designs, which can be drawn, differ by at "
        f"most {off:.1e}; fits of hinges err by at most {batch.error_of_fits:.1e}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--designs", type=int, default=100_000)
    parser.add_argument("--looped", type=int, default=20)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in FACTORS:
            compared(Path(folder), name, arguments.designs, arguments.looped)


if __name__ == "__main__":
    main()
