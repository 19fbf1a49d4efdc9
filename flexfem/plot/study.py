"""The figures a study file asks for, from its table, as files; the same table gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.figure

from flexfem.files.inputs import require_unread
from flexfem.plot.study_map import StudyMap, map_figure
from flexfem.plot.study_pareto import ParetoFront, pareto_figure
from flexfem.plot.study_records import Record, Source, record_of
from flexfem.plot.study_scatter import Distribution, Sensitivity, distribution_figure, sensitivity_figure
from flexfem.plot.write import figure_files, write_beside
from flexfem.study.findings import Refused, Shown
from flexfem.study.plan import Figure

if TYPE_CHECKING:
    from flexfem.study.loaded import LoadedStudy


def write_study_figures(source: Source, found: Sequence[Shown], folder: Path) -> list[Path]:
    """Draw every figure of a study file as PNG and PDF, but those that are refused.

    Parameters
    ----------
    source : the study, its collected table, which may still lack designs, and its base stage.
    found : what each figure shows, as `study.findings` finds it.
    folder : where the files go, named after study, kind of figure and what a map shows; made when missing.

    Returns the paths written. Raises BadInput when the folder does not take a file.
    """
    drawn = {folder / f"{name}.png": page_of(record) for name, record in records(source, found).items()}
    require_unread(*figure_files(*drawn))
    return [path for beside, page in drawn.items() for path in write_beside(beside, page)]


def records(source: Source, found: Sequence[Shown]) -> dict[str, Record]:
    """What the figures of a study file show, by the names of their files, but for those that are refused."""
    figures = zip(named(source.loaded), found, strict=True)
    drawn = ((*known, shown) for known, shown in figures if not isinstance(shown, Refused))
    return {name: record_of(source, figure, shown) for name, figure, shown in drawn}


def page_of(record: Record) -> matplotlib.figure.Figure:
    """The page of one record."""
    match record:
        case StudyMap():
            return map_figure(record)
        case Distribution():
            return distribution_figure(record)
        case Sensitivity():
            return sensitivity_figure(record)
        case ParetoFront():
            return pareto_figure(record)


def named(loaded: LoadedStudy) -> Iterator[tuple[str, Figure]]:
    """The figures with the names of their files, which differ."""
    seen: dict[str, int] = {}
    for figure in loaded.study.figure:
        shown = figure.value if figure.kind == "map" else None
        name = "-".join(part for part in (loaded.stem, figure.kind, shown) if part)
        seen[name] = seen.get(name, 0) + 1
        yield (name if seen[name] == 1 else f"{name}-{seen[name]}"), figure
