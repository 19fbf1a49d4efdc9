"""The sections of a page on a study: what it asked, its figures with their numbers, and designs to point at."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from markupsafe import Markup

from flexfem.page.section import PageFigure, PageSection, figure_html, file_text, inline_svg, notes, table
from flexfem.page.study_asked import asked_section, marked
from flexfem.page.study_designs import columns_shown, drawn_designs, farthest
from flexfem.page.study_pointed import designs_data, pointed_html
from flexfem.page.study_points import PointedDesigns, most_of, of_front, of_map
from flexfem.page.study_tables import extremes_table, front_table, marks_table, shares_table
from flexfem.plot.study import named, page_of
from flexfem.plot.study_map import StudyMap
from flexfem.plot.study_pareto import ParetoFront
from flexfem.plot.study_records import Record, record_of
from flexfem.plot.text import significant
from flexfem.study.findings import Best, Extremes, Marks, Refused, Shares, Shown

if TYPE_CHECKING:
    from flexfem.plot.study_records import Source
    from flexfem.study.loaded import LoadedStudy
    from flexfem.study.plan import Figure


Part: TypeAlias = tuple[str, Callable[[], PageSection]]


@dataclass(frozen=True)
class FoundFigure:
    """A figure of a study file: its number on the page, what it shows, and the designs that can be pointed at."""

    place: int
    figure: Figure
    shown: Shown
    points: PointedDesigns | None

    @property
    def id(self) -> str:
        """Of its section; made of nothing that a file says."""
        return f"study-figure-{self.place}"


def study_parts(source: Source, found: dict[str, Shown], status: dict[str, Any]) -> list[Part]:
    """The sections of a study in order, each by a name and what makes it: drawing its figures takes a while.

    Parameters
    ----------
    source, found : as `studies.study_findings` gives them.   status : as `studies.study_status` does.
    """
    figures = _figures(source, list(found.values()))
    designs = drawn_designs(source, (row for one in figures if one.points for row in one.points.rows.tolist()))
    data, reach = designs_data(columns_shown(source), designs), farthest(designs)
    parts: list[Part] = [("what the study asks", partial(asked_section, source, status))]
    for one in figures:
        parts.append((f"figure {one.place}", partial(_figure_section, source, one, reach, data)))
        data = Markup("")  # once on a page
    return [*parts, ("sources", partial(_sources_section, source.loaded))]


def _figures(source: Source, found: list[Shown]) -> list[FoundFigure]:
    asked = [figure for _, figure in named(source.loaded)]
    most = most_of(sum(isinstance(shown, Best | Extremes) for shown in found))
    pairs = zip(asked, found, strict=True)
    return [
        FoundFigure(n, figure, shown, _points(source, figure, shown, most))
        for n, (figure, shown) in enumerate(pairs, 1)
    ]


def _points(source: Source, figure: Figure, shown: Shown, most: int) -> PointedDesigns | None:
    if isinstance(shown, Best):
        return of_front(source, figure, shown, most)
    return of_map(source, figure, shown.cells, most) if isinstance(shown, Extremes) else None


def _figure_section(source: Source, one: FoundFigure, reach: int, data: Markup) -> PageSection:
    """The section of a figure; `data` of the designs to point at, in the first of them."""
    look = {"script": file_text("study.js"), "style": file_text("study.css")}
    if isinstance(one.shown, Refused):
        title = one.figure.title or f"Figure {one.place}: {one.figure.kind}"
        html = notes([f"It is not drawn. {one.shown.reason}"])
        return PageSection(one.id, title, data + html, **look)
    record = record_of(source, one.figure, one.shown)
    said = notes(record.caption.lines if one.points is not None else (), "note")  # others have them in the figure
    parts = [data, _drawn(source, one, record, reach), said, *_numbers(source, one)]
    return PageSection(one.id, record.caption.title, Markup("\n").join(parts), **look)


def _drawn(source: Source, one: FoundFigure, record: Record, reach: int) -> Markup:
    name = f"{one.id}-chart"
    if one.points is not None and isinstance(record, StudyMap | ParetoFront):
        return pointed_html(source, one.figure, record, one.points, reach, name)
    title = record.caption.title
    drawn = PageFigure(inline_svg(page_of(record), name=f"{name}-svg"), title, " ".join(record.caption.lines))
    return figure_html(drawn, name)


def _numbers(source: Source, one: FoundFigure) -> Iterator[Markup]:
    """What a figure shows, as tables and sentences."""
    match one.shown:
        case Extremes():
            yield extremes_table(source, one.figure, one.shown)
        case Marks():
            yield marks_table(source, one.shown)
        case Shares():
            yield shares_table(source, one.shown)
        case Best(power=power, gain=gain, front=front):
            assert one.points is not None
            said = [*_said_of_front(source, one.figure, power, gain), *source.unbeaten(one.figure, front.places)]
            yield notes(said, "note")
            yield front_table(source, one.figure, one.points)


def _said_of_front(source: Source, figure: Figure, power: float | None, gain: float | None) -> Iterator[str]:
    x, y = (source.quantity(name or "").name for name in (figure.x, figure.y))
    if power is not None and np.isfinite(power):
        yield f"Along the front {y} goes as {x} to the power {significant(power, 3)} (least squares of logarithms)."
    if gain is not None:
        better = f"The best design no worse in {x} and no larger than the base stage"
        yield f"{better} has {significant(gain, 3)} times its {y}."


def _sources_section(loaded: LoadedStudy) -> PageSection:
    """Where the numbers come from that are assumed or of which no source is stated."""
    stage, study = loaded.stage.sources, loaded.study.sources
    rows = []
    for doubt in (*loaded.assumed, *loaded.not_stated):
        of, key = doubt.split(": ", 1)
        text = (stage if of == "stage" else study).get(key) or ""
        rows.append((key, of, marked(text)))
    html = (
        table(("number", "of the", "source"), rows, caption="Numbers that are assumed or without a source")
        if rows
        else Markup("<p>Every number of stage and study has a source, and none is assumed.</p>")
    )
    return PageSection("study-sources", "Where the numbers come from", html)
