"""The page docs/verification-manual.md and its figures, made at every build from `flexfem benchmark`: some 15 s."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/verification-manual.md"
FIGURES = ROOT / "docs/reference"  # not kept by git, as the page


def write() -> None:
    """Solve the problems, draw the figures that there are, and write the page."""
    from flexfem import benchmark
    from flexfem.plot.accuracy import elastica_figure, taylor_figure
    from flexfem.validate import bending
    from flexfem.validate.manual import manual
    from flexfem.validate.registry import BENCHMARKS

    FIGURES.mkdir(exist_ok=True)
    drawn = {"elastica": elastica_figure(bending.cantilever_bent()), "tangent": taylor_figure(bending.remainders())}
    for name, figure in drawn.items():
        figure.savefig(FIGURES / f"verification-{name}.png", dpi=120)
    found = {name: benchmark([name]).findings for name in BENCHMARKS}
    PAGE.write_text(manual(found, {name: f"reference/verification-{name}.png" for name in drawn}))


def setup(app: Any) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", lambda _: write())
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    write()
