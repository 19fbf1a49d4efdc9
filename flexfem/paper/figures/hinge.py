"""The circular hinge of the paper, Fig. 2, and the dimensions of the hinges of a stage."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.paper.figures.pseudo_rigid import hinges_of
from flexfem.paper.stage import Stage
from flexfem.paper.verification import CurveModels
from flexfem.plot import style
from flexfem.plot.hinge import plot_hinge
from flexfem.plot.style import panels
from flexfem.plot.text import significant
from flexfem.units import LENGTH

WIDTH = 8.27  # in
HEAD = ("hinge", f"R ({LENGTH})", f"t ({LENGTH})", f"h ({LENGTH})", "t/R")
ABOUT = (
    "Circular hinge of (2) and (3), not to scale; its thickness b is out of the plane. Red: loads."
)


@style.in_house_style
def hinge_sketch(model: CurveModels) -> Figure:
    """Draw the labelled sketch of the circular hinge, and a table of the hinges of a stored model."""
    heights = (3.4, 0.22 * (1 + len(hinge_rows(model))))
    size = (WIDTH, sum(heights) + 0.4)
    title = f"{model.stage}: circular hinge"
    figure, (upper, lower) = panels(
        size, title, [ABOUT], 2, assumptions=model, height_ratios=heights
    )
    plot_hinge(upper)
    plot_hinge_table(lower, model)
    return figure


def hinge_rows(stage: Stage | CurveModels) -> list[tuple[str, ...]]:
    """Return numbers; R, t, h, mm; and t/R of the hinges of a stage, identical ones in one row.

    Raises BadInput when `stage` is not a stage.
    """
    groups: dict[tuple[float, float], list[str]] = {}
    for number, hinge in enumerate(hinges_of(stage), start=1):
        groups.setdefault((hinge.radius, hinge.neck), []).append(str(number))
    rows = list[tuple[str, ...]]()
    for (radius, neck), numbers in groups.items():
        height = 2 * radius + neck
        sizes = (f"{radius:g}", f"{neck:g}", f"{height:g}", significant(neck / radius, 3))
        rows.append((", ".join(numbers), *sizes))
    return rows


def plot_hinge_table(ax: Axes, stage: Stage | CurveModels) -> Axes:
    """Write the dimensions of a stage's hinges as a table, identical hinges in one row.

    Returns `ax`. Raises BadInput when `stage` is not a stage.
    """
    return style.table(ax, [HEAD, *hinge_rows(stage)], [1.5] * len(HEAD))
