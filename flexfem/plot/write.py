"""Files of figures, and the text page of stored verifications; the same results give the same
bytes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from matplotlib.figure import Figure

from flexfem.design.result import Designed
from flexfem.files.inputs import require_unread
from flexfem.files.writing import write_atomically
from flexfem.paper.verification import Verification
from flexfem.plot import figures_of
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.errors import error_figure
from flexfem.plot.fields import deformed_figure
from flexfem.plot.hinge import hinge_sketch
from flexfem.plot.stage import model_sketch, neck_figure, stage_figure
from flexfem.plot.style import rendered
from flexfem.plot.text import markdown_report
from flexfem.results import Fields

Stored: TypeAlias = tuple[Verification, dict[str, Fields]]
Draw: TypeAlias = Callable[[], Figure]
FORMS = ("png", "pdf")
PICTURES = (".png", ".pdf", ".svg")
PAGE = "verification.md"


def write_figures(
    results: list[Stored],
    folder: Path,
    displacement: bool = False,
    designs: Sequence[tuple[str, Designed]] = (),
) -> list[Path]:
    """Draw every figure of stored verifications, and of designs by name, as PNG and PDF.

    A page of text on the verifications is written beside them. `displacement` : show displacements
    in the commanded direction instead of errors. Raises BadInput when a file cannot be written to
    the folder."""
    figures = plans(results, displacement, designs)
    require_unread(folder / PAGE)
    paths = write_each({folder / f"{name}.json": draw for name, draw in figures.items()})
    if not results:
        return paths
    pictures = "\n".join(f"![{name}]({name}.png)" for name in figures)
    page = f"{markdown_report([result for result, _ in results])}\n## Figures\n\n{pictures}\n"
    return [*paths, _written(folder / PAGE, page.encode())]


def write_design_figures(found: Designed, stored: Path) -> list[Path]:
    """Draw the figures of a design beside its record. Raises BadInput as `write_each` does."""
    return write_each(
        {stored.with_name(f"{name}.json"): draw for name, draw in _of_design(stored.stem, found)}
    )


def write_each(figures: Mapping[Path, Draw]) -> list[Path]:
    """Draw figures and write each beside its stored numbers. Raises BadInput when a file cannot be
    written.
    """
    require_unread(*(path.with_suffix(f".{form}") for path in figures for form in FORMS))
    return [path for stored, draw in figures.items() for path in write_beside(stored, draw())]


def write_beside(stored: Path, figure: Figure) -> list[Path]:
    """Write a figure as PNG and PDF beside its stored numbers. Raises BadInput when a file cannot
    be written.
    """
    return [_written(stored.with_suffix(f".{form}"), rendered(figure, form)) for form in FORMS]


def write_picture(path: Path, figure: Figure) -> Path:
    """Write a figure in the format of the extension, one of `PICTURES`. Raises BadInput when it
    cannot be written.
    """
    return _written(path, rendered(figure, path.suffix[1:]))


def write_of_result(found: Any, stored: Path) -> list[Path]:
    """Draw the figures of a result beside its stored numbers. Raises BadInput when a file cannot be
    written.
    """
    written = list[Path]()
    for ending, figure in figures_of(found).items():
        target = stored.with_name(f"{stored.stem}{ending}{stored.suffix}")
        written += figure(target) if callable(figure) else write_beside(target, figure)
    return written


def plans(
    results: list[Stored], displacement: bool = False, designs: Sequence[tuple[str, Designed]] = ()
) -> dict[str, Draw]:
    """Functions that draw the figures, each stage once, by file names that differ even when case is
    ignored.
    """
    figures: dict[str, Draw] = {}
    of_designs = [figure for name, found in designs for figure in _of_design(name, found)]
    for stem, draw in [*_of_cases(results, displacement), *_of_stages(results), *of_designs]:
        name = stem
        count = 1
        used = {other.casefold() for other in figures}
        while name.casefold() in used:
            count += 1
            name = f"{stem}-{count}"
        figures[name] = draw
    return figures


def _of_design(name: str, found: Designed) -> Iterator[tuple[str, Draw]]:
    """Yield the figures of a design: the design, its sensitivity to each dimension and its front."""
    yield name, partial(design_figure, found)
    yield f"{name}-sensitivity", partial(sensitivity_figure, found)
    if found.front:
        yield f"{name}-front", partial(front_figure, found)


def _of_cases(results: list[Stored], displacement: bool) -> Iterator[tuple[str, Draw]]:
    for result, fields in results:
        stem = _file_name(result.case)
        yield (
            f"{stem}-displacement" if displacement else stem,
            partial(error_figure, result, displacement),
        )
        yield f"{stem}-deformed", partial(deformed_figure, result, fields)


def _of_stages(results: list[Stored]) -> Iterator[tuple[str, Draw]]:
    """Yield mesh, necks and hinge of every distinct stage, and its model at every distinct
    mobility.
    """
    seen = set()
    for result, fields in results:
        for label, model in result.models.items():
            stem = _file_name(Path(model.file).stem)
            freedoms = str([hinge.freedoms for hinge in model.hinges])
            if model.hash not in seen:
                yield f"stage-{stem}", partial(stage_figure, model, fields[label])
                yield f"neck-{stem}", partial(neck_figure, model, fields[label])
                yield f"hinge-{stem}", partial(hinge_sketch, model)
            if (model.hash, freedoms) not in seen:
                yield f"model-{stem}-mobility{model.mobility}", partial(model_sketch, model)
            seen |= {model.hash, (model.hash, freedoms)}


def _file_name(text: str) -> str:
    """Return a text as a file name without path separators or a leading dot."""
    return re.sub(r"[^\w.+-]+", "_", text).lstrip(".") or "unnamed"


def _written(path: Path, content: bytes) -> Path:
    write_atomically(path, lambda file: file.write(content))
    return path
