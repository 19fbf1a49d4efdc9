"""Files of figures; the same results give the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from matplotlib.figure import Figure

from flexfem.design.result import Designed
from flexfem.files.inputs import require_unread
from flexfem.files.writing import write_atomically
from flexfem.plot import figures_of
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.style import rendered

NamedFigure: TypeAlias = Callable[[], Figure]  # draws it when it is its turn
FORMS = ("png", "pdf")
PICTURES = (".png", ".pdf", ".svg")


def write_designs(designs: Sequence[tuple[str, Designed]], folder: Path) -> list[Path]:
    """Draw every figure of designs by name. Raises BadInput as `write_each` does."""
    figures = named_apart(of_designs(designs))
    return write_each({folder / f"{name}.json": draw for name, draw in figures.items()})


def write_design_figures(found: Designed, stored: Path) -> list[Path]:
    """Draw the figures of a design beside its record. Raises BadInput as `write_each` does."""
    return write_designs([(stored.stem, found)], stored.parent)


def of_designs(designs: Iterable[tuple[str, Designed]]) -> Iterator[tuple[str, NamedFigure]]:
    """Yield the figures of designs: the design, its sensitivity to each dimension and its front."""
    for name, found in designs:
        yield name, partial(design_figure, found)
        yield f"{name}-sensitivity", partial(sensitivity_figure, found)
        if found.front:
            yield f"{name}-front", partial(front_figure, found)


def named_apart(figures: Iterable[tuple[str, NamedFigure]]) -> dict[str, NamedFigure]:
    """Return figures by file names that differ even when case is ignored."""
    named: dict[str, NamedFigure] = {}
    used = set[str]()
    for stem, draw in figures:
        name = stem
        count = 1
        while name.casefold() in used:
            count += 1
            name = f"{stem}-{count}"
        used.add(name.casefold())
        named[name] = draw
    return named


def write_each(figures: Mapping[Path, NamedFigure]) -> list[Path]:
    """Draw figures and write each beside its stored numbers.

    Raises BadInput when a file cannot be written.
    """
    require_unread(*(path.with_suffix(f".{form}") for path in figures for form in FORMS))
    return [path for stored, draw in figures.items() for path in write_beside(stored, draw())]


def write_beside(stored: Path, figure: Figure) -> list[Path]:
    """Write a figure as PNG and PDF beside its stored numbers.

    Raises BadInput when a file cannot be written.
    """
    return [_written(stored.with_suffix(f".{form}"), rendered(figure, form)) for form in FORMS]


def write_picture(path: Path, figure: Figure) -> Path:
    """Write a figure in the format of the extension, one of `PICTURES`.

    Raises BadInput when the file cannot be written.
    """
    return _written(path, rendered(figure, path.suffix[1:]))


def write_of_result(found: Any, stored: Path) -> list[Path]:
    """Draw the figures of a result beside its stored numbers.

    Raises BadInput when a file cannot be written.
    """
    written = list[Path]()
    for ending, figure in figures_of(found).items():
        target = stored.with_name(f"{stored.stem}{ending}{stored.suffix}")
        written += figure(target) if callable(figure) else write_beside(target, figure)
    return written


def write_text(path: Path, text: str) -> Path:
    """Write a page of text. Raises BadInput when it cannot be written."""
    return _written(path, text.encode())


def _written(path: Path, content: bytes) -> Path:
    write_atomically(path, lambda file: file.write(content))
    return path
