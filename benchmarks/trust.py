"""Where the paper's model can be trusted on a stage as thick as it is: the map of
cases/study-trust.toml once more.

    python benchmarks/trust.py [--output reports]

The designs of the study, but in the place of plane finite elements the hinges of three-dimensional
ones (the thickness chart) with elastic links. Draws the map, and prints the error along x and theta
where the plane one says that necks are thin, and the neck at which it changes its sign."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper.budget import thick_compliance
from flexfem.paper.model import CALIBRATED, analyse
from flexfem.paper.stage import Stage
from flexfem.plot.study import map_figure
from flexfem.plot.write import write_beside
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput
from flexfem.study.loaded import load_study, mechanism_of, sample
from flexfem.study.names import factor, output
from flexfem.study.records import Caption, Cells, StudyMap

STUDY = Path(__file__).parents[1] / "cases" / "study-trust.toml"
LINES = (
    "Hinges of three-dimensional finite elements and elastic links against the analytic model "
    "(paros-weisbord, mobility 6), stages 10 mm thick. The same designs as in plane stress."
)


def errors(stage: Stage) -> np.ndarray:
    """Errors (thick or plane, x or theta), per cent; nan off the charts or for a design that cannot
    be made.
    """
    found = np.full((2, 2), np.nan)
    try:
        check_feasible(stage)
        real = (thick_compliance(stage), analyse(stage, 21, CALIBRATED, links=True).compliance)
    except BadInput:
        return found
    stiffness = analyse(stage, 6).stiffness
    lever = stage.chain.link_lengths[2]
    for row, compliance in enumerate(real):
        if compliance is not None:
            found[row] = np.diag(error_matrix(stiffness, compliance, lever))[[0, 2]]
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--output", type=Path, default=Path("reports"))
    loaded = load_study(STUDY)
    values = sample(loaded, 0, loaded.count)
    found = np.array([errors(mechanism_of(loaded, row)) for row in values])
    radii = np.unique(values[:, 0])
    necks = np.unique(values[:, 1])
    thick, plane, turned = (
        found[:, i, j].reshape(len(radii), len(necks)) for i, j in ((0, 0), (1, 0), (0, 1))
    )
    print(
        "| radius, mm | t, mm | plane, x, % | thick, x, % | thick, theta, % | thick changes sign "
        "at t, mm |"
    )
    print("|---:|---:|---:|---:|---:|---:|")
    for k in (0, 5, 10, 19):
        inside = np.isfinite(thick[k])
        zero = np.interp(0.0, thick[k][inside], necks[inside])
        for j in np.flatnonzero(inside)[:: max(1, inside.sum() // 4)]:
            row = f"{plane[k, j]:+.2f} | {thick[k, j]:+.2f} | {turned[k, j]:+.2f} | {zero:.3f}"
            print(f"| {radii[k]:.2f} | {necks[j]:.3f} | {row} |")
    without = np.isnan(thick).ravel()
    across, up = (factor(column) for column in loaded.columns)
    lines = [f"Base stage: {loaded.base.name}.", LINES]
    shown = StudyMap(
        Caption("Error along x of a stage 10 mm thick", lines, *loaded.assumptions),
        *(across, up, output("error_x_percent")),
        Cells(values, thick.ravel(), {"refused or off the charts": without}, True),
        marks=(-5.0, 5.0, 10.0),
    )
    write_beside(parser.parse_args().output / "study-trust-thick.png", map_figure(shown))


if __name__ == "__main__":
    main()
