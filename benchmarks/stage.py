"""One stage solve at the default mesh, from stage file to error percentages: where the time goes.

    python benchmarks/stage.py [--repeats 5]

Shares of one run and their medians, so that a slow machine shows the same picture as a fast one. The first row is
measured in a fresh process; meshing counts its child process.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
STAGE = ROOT / "geometry/mobility6.toml"
IMPORTS = "import flexfem.questions.errors, flexfem.fem.factor, skfem, cvxopt.cholmod"


class Clock:
    """Seconds by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def __call__(self, name: str, work: Callable[[], Any]) -> Any:
        started = time.perf_counter()
        result = work()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started
        return result


def run() -> dict[str, float]:
    from flexfem.analytic.model import analyse
    from flexfem.fem.elements import integration, tied_lower
    from flexfem.fem.factor import factorise
    from flexfem.fem.mesh import RESOLUTION, build_mesh
    from flexfem.fem.response import platform_response
    from flexfem.fem.structure import plate_of, tie_hub
    from flexfem.mechanism.stage import load_feasible
    from flexfem.questions.bands import error_matrix

    clock = Clock()
    clock("import", lambda: subprocess.run([sys.executable, "-c", IMPORTS], check=True))
    stage = clock("stage file and checks", lambda: load_feasible(STAGE))
    mesh = clock("mesh", lambda: build_mesh(stage, RESOLUTION))
    plate, tied = plate_of(stage), tie_hub(mesh)
    strips = clock("assembly", lambda: integration(mesh))
    equations = clock("assembly", lambda: tied_lower(strips, plate, tied.number, tied.rigid))
    clock("factor", lambda: factorise(equations))
    started = time.perf_counter()
    response = platform_response(mesh, plate)
    whole = time.perf_counter() - started
    clock.seconds["solve, refine, check"] = whole - clock.seconds["assembly"] - clock.seconds["factor"]
    analytic = clock("analytic model", lambda: analyse(stage))
    clock("comparison", lambda: error_matrix(analytic.stiffness, response.compliance, 24.0))
    return clock.seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    runs = [run() for _ in range(repeats)]
    print(f"{'part':24} {'seconds':>8} {'share':>7}   (medians of {repeats})")
    for name in runs[0]:
        seconds = statistics.median(each[name] for each in runs)
        share = statistics.median(each[name] / sum(each.values()) for each in runs)
        print(f"{name:24} {seconds:8.3f} {100 * share:6.1f} %")


if __name__ == "__main__":
    main()
