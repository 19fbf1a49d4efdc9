"""The figures a study file asks for, as files; the same table gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure as Drawing

from flexfem.plot.study_distribution import distribution_figure
from flexfem.plot.study_map import map_figure
from flexfem.plot.study_pareto import pareto_figure
from flexfem.plot.study_sensitivity import sensitivity_figure
from flexfem.plot.study_shown import Source, front_of, map_of, scatters_of, shares_of
from flexfem.plot.write import write_beside
from flexfem.study.figure import Figure
from flexfem.study.findings import Best, Extremes, Finding, Marks, Refused, Shares

if TYPE_CHECKING:
    from flexfem.study.plan import LoadedStudy


def write_study_figures(source: Source, found: Sequence[Finding], folder: Path) -> list[Path]:
    """Draw every figure of a study file as PNG and PDF, but those that are refused.

    Parameters
    ----------
    source : the study, its collected table, which may still lack designs, and its base stage.
    found : what each figure shows, as `study.findings` finds it.
    folder : where the files go, named after study, kind of figure and what a map shows; made when missing.

    Returns the paths written. Raises BadInput when the folder does not take a file.
    """
    figures = zip(named(source.loaded), found, strict=True)
    drawn = [(name, draw(source, figure, shown)) for (name, figure), shown in figures if not isinstance(shown, Refused)]
    return [path for name, drawing in drawn for path in write_beside(folder / f"{name}.png", drawing)]


def draw(source: Source, figure: Figure, found: Extremes | Marks | Shares | Best) -> Drawing:
    """Draw one figure of a study file from what was found for it."""
    match found:
        case Extremes():
            return map_figure(map_of(source, figure))
        case Marks():
            return distribution_figure(*scatters_of(source, figure, found))
        case Shares():
            return sensitivity_figure(*shares_of(source, figure, found))
        case Best():
            return pareto_figure(front_of(source, figure, found))


def named(loaded: LoadedStudy) -> Iterator[tuple[str, Figure]]:
    """The figures with the names of their files, which differ."""
    seen: dict[str, int] = {}
    for figure in loaded.study.figure:
        shown = figure.value if figure.kind == "map" else None
        name = "-".join(part for part in (loaded.stem, figure.kind, shown) if part)
        seen[name] = seen.get(name, 0) + 1
        yield (name if seen[name] == 1 else f"{name}-{seen[name]}"), figure
