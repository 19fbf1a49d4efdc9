"""Analytic designs of a study, all dimensions sampled, against a plain loop over designs.

    python benchmarks/study.py [--designs 1000000] [--looped 200]

Both answer the same designs with all outputs: `answer` by the broadcasting kernels, the loop by the public functions
for one stage. It is timed on fewer designs and scaled; the two must agree. The peak memory is that of this process.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from flexfem.analytic.model import analyse
from flexfem.mechanism.feasibility import check_closed_form
from flexfem.refused import BadInput
from flexfem.study.answer import answer
from flexfem.study.designs import stage_of
from flexfem.study.loaded import LoadedStudy, load_study
from flexfem.study.sampling import sample

STAGE = Path(__file__).parent.parent / "geometry" / "mobility6.toml"
CHUNK = 8192
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


def study(folder: Path, designs: int) -> LoadedStudy:
    """A Sobol study of all dimensions, nine hinges of their own."""
    factors = "".join(f'[[factor]]\nkey = "{key}"\nfrom = {low}\nto = {high}\n' for key, (low, high) in RANGES.items())
    path = folder / "study.toml"
    path.write_text(
        f'name = "speed"\nstage = "{STAGE}"\nmodel = "analytic"\nformula = "calibrated"\nmobility = 21\n'
        f'[sampling]\nmethod = "sobol"\ndesigns = {designs}\nseed = 2003\n'
        f"[drive]\nstroke_um = 17.4\nlever_arm_mm = 10.0\n{factors}"
    )
    return load_study(path)


def one_by_one(loaded: LoadedStudy, values: Any) -> Any:
    """Stiffness (3, 3) and peak stress (3,) of one design by the functions for one stage; nan when refused."""
    try:
        stage = stage_of(loaded, values)
        check_closed_form(stage)
        found = analyse(stage, loaded.study.mobility, loaded.study.formula)
    except BadInput:
        return np.full(12, np.nan)
    return np.concatenate([found.stiffness.ravel(), found.stress.max(axis=(0, 1))])


def peak_memory() -> float:
    """Largest resident memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--designs", type=int, default=1_000_000)
    parser.add_argument("--looped", type=int, default=200)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        loaded = study(Path(folder), arguments.designs)
    answer(loaded, 0, CHUNK)
    print(f"peak memory after {CHUNK} designs: {peak_memory():.0f} MB")
    started, busy, answered = time.perf_counter(), time.process_time(), 0
    for start in range(0, loaded.count, CHUNK):
        rows = answer(loaded, start, min(start + CHUNK, loaded.count))
        answered += int(np.sum(rows.status == "ok"))
    together, busy = time.perf_counter() - started, time.process_time() - busy
    print(f"peak memory after {loaded.count} designs: {peak_memory():.0f} MB")
    count = min(arguments.looped, loaded.count)
    values = sample(loaded, 0, count)
    started = time.perf_counter()
    single = np.array([one_by_one(loaded, each) for each in values])
    loop = (time.perf_counter() - started) / count * loaded.count
    batch = answer(loaded, 0, count).values
    np.testing.assert_allclose(batch[:, :3], single[:, [0, 4, 8]], rtol=1e-9)
    np.testing.assert_allclose(batch[:, 9:12], 1e-3 * single[:, 9:], rtol=1e-9)
    print(
        f"{loaded.count} designs of {len(loaded.columns)} factors, {answered} of them possible: {together:.1f} s "
        f"({busy:.1f} s of processor time, {1e6 * busy / loaded.count:.1f} us a design); one by one {loop:.0f} s, "
        f"ratio {loop / together:.0f}"
    )


if __name__ == "__main__":
    main()
