"""The stage in three dimensions: error against a finer mesh with more layers, seconds and memory.

    python benchmarks/solid.py [--stage geometry/mobility6.toml] [--reference 8 4]

Every row is a process of its own, so that its memory is its own. The reference is the finest mesh,
moved to vanishing triangles and layers by the changes of coarser ones with order four."""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
ROWS = ((4, 2), (4, 3), (6, 3))
ORDER = 4.0


def solved(stage: str, resolution: int, layers: int) -> dict[str, object]:
    """One solution: compliance along x, y, theta, unknowns, s, GB."""
    from flexfem import load
    from flexfem.paper.solutions import solve_solid

    of = load(stage)
    started = time.perf_counter()
    found = solve_solid(of, resolution, layers)
    return {
        "compliance": np.diag(found.compliance).tolist(),
        "unknowns": found.unknowns,
        "seconds": time.perf_counter() - started,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }


def in_a_process(stage: str, resolution: int, layers: int) -> dict[str, object]:
    """As `solved`."""
    command = [sys.executable, __file__, "--stage", stage, "--one", str(resolution), str(layers)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stage", default=str(ROOT / "geometry" / "mobility6.toml"))
    parser.add_argument("--one", nargs=2, type=int)
    parser.add_argument("--reference", nargs=2, type=int, default=(8, 4))
    given = parser.parse_args()
    if given.one:
        print(json.dumps(solved(given.stage, *given.one)))
        return
    finest, many = given.reference
    values = {
        key: in_a_process(given.stage, *key)
        for key in dict.fromkeys([*ROWS, (3, 2), (3, many), (finest, 2)])
    }
    at = {key: np.array(each["compliance"]) for key, each in values.items()}
    in_plane = at[finest, 2] + (at[finest, 2] - at[4, 2]) / ((finest / 4) ** ORDER - 1)
    of_layers = at[3, many] + (at[3, many] - at[3, 2]) / ((many / 2) ** ORDER - 1)
    truth = in_plane * of_layers / at[3, 2]  # the two errors hardly depend on each other
    print(f"reference: {truth}")
    for key, each in values.items():
        error = 100 * np.max(np.abs(at[key] / truth - 1))
        print(
            f"resolution {key[0]}, {key[1]} layers: {error:.3f} %, {each['unknowns']} unknowns, "
            f"{each['seconds']:.1f} s, {each['memory']:.2f} GB",
            flush=True,
        )


if __name__ == "__main__":
    main()
