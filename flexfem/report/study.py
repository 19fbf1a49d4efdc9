"""The figures a study file asks for, as files; the same table gives the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from matplotlib.figure import Figure as Drawing

from flexfem.errors import BadInput
from flexfem.report.study_distribution import distribution_figure
from flexfem.report.study_map import map_figure
from flexfem.report.study_pareto import pareto_figure
from flexfem.report.study_sensitivity import sensitivity_figure
from flexfem.report.study_shown import Source, front_of, map_of, scatters_of, shares_of
from flexfem.report.write import write_beside
from flexfem.study.figure import Figure, FigureKind
from flexfem.study.nominal import nominal
from flexfem.study.plan import LoadedStudy
from flexfem.study.table import StudyTable

DRAW: dict[FigureKind, Callable[[Source, Figure], Drawing]] = {
    "map": lambda source, figure: map_figure(map_of(source, figure)),
    "distribution": lambda source, figure: distribution_figure(*scatters_of(source, figure)),
    "sensitivity": lambda source, figure: sensitivity_figure(*shares_of(source, figure)),
    "pareto": lambda source, figure: pareto_figure(front_of(source, figure)),
}


def write_study_figures(loaded: LoadedStudy, table: StudyTable, folder: Path) -> list[Path]:
    """Draw every figure of a study file as PNG and PDF.

    Parameters
    ----------
    loaded, table : the study and its collected table, which may still lack designs.
    folder : where the files go, named after study, kind of figure and what a map shows; made when missing.

    Returns the paths written. Raises BadInput when a figure cannot be drawn from the table (nothing answered, or
    sensitivity with designs that have no answer) or the folder does not take a file.
    """
    if not table.ok.any():
        raise BadInput(f"{loaded.path}: none of {len(table.design)} designs has an answer, expected some to draw")
    source = Source(loaded, table, nominal(loaded))
    drawn = [(name, DRAW[figure.kind](source, figure)) for name, figure in named(loaded)]
    return [path for name, drawing in drawn for path in write_beside(folder / f"{name}.png", drawing)]


def named(loaded: LoadedStudy) -> Iterator[tuple[str, Figure]]:
    """The figures with the names of their files, which differ."""
    seen: dict[str, int] = {}
    for figure in loaded.study.figure:
        shown = figure.value if figure.kind == "map" else None
        name = "-".join(part for part in (loaded.stem, figure.kind, shown) if part)
        seen[name] = seen.get(name, 0) + 1
        yield (name if seen[name] == 1 else f"{name}-{seen[name]}"), figure
