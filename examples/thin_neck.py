"""
Thinner elbow necks
===================

The figure shows how the range at yield and the stiffness of a stage change with the width of its
elbow necks. The analytic model with elastic links gives values for eleven necks, finite elements
for two of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot

import flexfem

STAGE = Path("../geometry/mobility6.toml")


def compare(
    file: str | Path | None = None, resolution: int = 8
) -> list[tuple[float, float, float]]:
    """Print a row for every neck solved by finite elements and draw both models.

    Returns neck (mm), stiffness (N/mm) and range (um) in x.
    """
    stage = flexfem.load(STAGE)
    necks = np.linspace(0.3, 0.6, 11)
    models = [
        flexfem.analyse(stage.replace(neck={"elbow": t}), formula="calibrated", links=True)
        for t in necks
    ]
    solved = {t: flexfem.solve(stage.replace(neck={"elbow": t}), resolution) for t in (0.4, 0.5)}
    rows = [(t, fe.stiffness[0, 0], 1e3 * fe.range_at_yield[0]) for t, fe in solved.items()]
    print("elbow neck mm   stiffness N/mm   range at yield um   (finite elements)")
    for row in rows:
        print("{:13.2f} {:16.2f} {:19.0f}".format(*row))

    figure, (left, middle, right) = pyplot.subplots(1, 3, figsize=(12, 4.2), layout="constrained")
    middle.plot(necks, [model.stiffness[0, 0] for model in models], label="analytic, elastic links")
    middle.plot(*zip(*(row[:2] for row in rows), strict=True), "o", label="finite elements")
    right.plot(necks, [1e3 * model.range_at_yield[0] for model in models])
    right.plot(*zip(*(row[::2] for row in rows), strict=True), "o")
    middle.set(xlabel="elbow neck (mm)", ylabel="stiffness in x (N/mm)")
    right.set(xlabel="elbow neck (mm)", ylabel="range at yield in x (µm)")
    middle.legend(frameon=False)
    fe = solved[0.4]
    fe.plot(fe.force([0.05, 0, 0]), ax=left)
    left.set_title("elbow necks 0.4 mm, 50 µm in x (exaggerated):\nvon Mises stress", fontsize=10)
    if stage.assumed:
        figure.supxlabel(
            f"assumed dimensions: {len(stage.assumed)} numbers of {STAGE.name}",
            fontsize=8,
            color="0.4",
        )
    if file:
        figure.savefig(file, dpi=120)
    return rows


if __name__ == "__main__":
    compare(sys.argv[1] if len(sys.argv) > 1 else None)
