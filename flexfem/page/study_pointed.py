"""A front or map of a study on a page: its chart, the designs that can be pointed at, a panel for one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from markupsafe import Markup

from flexfem.page.section import POINTS, inline_svg, json_data, markup, places_on
from flexfem.page.study_designs import PARTS, DrawnDesign, ShownColumns, values_at, written
from flexfem.plot.study_chart import HEIGHT, WIDTH, chart_figure
from flexfem.plot.text import SPACE, round_factor
from flexfem.units import LENGTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from flexfem.arrays import Array
    from flexfem.page.study_points import PointedDesigns
    from flexfem.plot.study_labels import Quantity
    from flexfem.plot.study_map import StudyMap
    from flexfem.plot.study_pareto import ParetoFront
    from flexfem.plot.study_records import Source
    from flexfem.study.plan import Figure

DESIGNS = "study-designs"  # id of the data that all charts of a page share


class Target(NamedTuple):
    """A design on a chart: its number, its place in points from the upper left, what is told of it."""

    design: int
    x: str
    y: str
    text: str


def pointed_html(
    source: Source, figure: Figure, record: StudyMap | ParetoFront, points: PointedDesigns, reach: int, name: str
) -> Markup:
    """A chart with its designs and an empty panel, which the script fills; `name` is its id, `reach` of all designs.

    Without scripts the chart is there, and what a place tells when it is pointed at.
    """
    drawn = chart_figure(record)
    svg = inline_svg(drawn, name=f"{name}-chart")
    title = record.caption.title
    bar = round_factor(0.8 * reach / PARTS)
    return markup(
        "pointed.html",
        name=name,
        svg=svg,
        width=WIDTH * POINTS,
        height=HEIGHT * POINTS,
        label=f"Designs of: {title}",
        targets=_targets(source, figure, drawn.axes[0], points),
        caption=f"{title}. {points.said} Point at one, tap it, or go from one to the next by the arrow keys.",
        description=f"{title}. {' '.join(record.caption.lines)}",
        reach=reach,
        bar=int(PARTS * bar),
        bar_text=f"{bar:g}{SPACE}{LENGTH}, as for all designs here",
    )


def _targets(source: Source, figure: Figure, axes: Axes, points: PointedDesigns) -> list[Target]:
    names = [name for name, _ in figure.columns.values()]
    quantities = [source.quantity(name) for name in names]
    values = values_at(source, names, points.rows)
    numbers = source.table.design[points.rows].tolist()
    told = [f"Design {number}: {_told(quantities, row)}" for number, row in zip(numbers, values, strict=True)]
    places = places_on(axes, points.at).tolist()
    return [
        Target(number, f"{x:.1f}", f"{y:.1f}", text)
        for number, (x, y), text in zip(numbers, places, told, strict=True)
        if np.isfinite(x)  # inside the axes
    ]


def _told(quantities: Sequence[Quantity], row: Array) -> str:
    return ", ".join(f"{one.name} {written(value)}{one.after}" for one, value in zip(quantities, row, strict=True))


def designs_data(columns: ShownColumns, designs: Sequence[DrawnDesign]) -> Markup:
    """The designs of all charts of a page, and what their numbers are, for the script."""
    named = [{"name": one.name, "unit": one.unit} for one in columns.quantities]
    told = {str(one.number): one.facts for one in designs}
    return json_data(DESIGNS, {"columns": named, "factors": columns.factors, "designs": told})
