"""Figures as files, and the page of text of stored verifications; the same results give the same bytes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

from matplotlib.figure import Figure

from flexfem.design.result import Designed
from flexfem.files.inputs import require_unread
from flexfem.files.writing import write_atomically
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.errors import error_figure
from flexfem.plot.fields import deformed_figure
from flexfem.plot.hinge import hinge_sketch
from flexfem.plot.stage import model_sketch, neck_figure, stage_figure
from flexfem.plot.style import rendered
from flexfem.plot.text import markdown_report
from flexfem.questions.errors import Verification
from flexfem.results import Fields

Stored: TypeAlias = tuple[Verification, dict[str, Fields]]
Draw: TypeAlias = Callable[[], Figure]
FORMS = ("png", "pdf")
PAGE = "verification.md"


def write_figures(
    results: list[Stored], folder: Path, displacement: bool = False, designs: Sequence[tuple[str, Designed]] = ()
) -> list[Path]:
    """Draw every figure of stored verifications, and of designs by name, as PNG and PDF.

    A page of text on the verifications is written beside them. `displacement` : show displacements in the commanded
    direction instead of errors. Raises BadInput when the folder does not take a file.
    """
    drawn = plans(results, displacement, designs)
    require_unread(folder / PAGE)
    paths = write_each({folder / f"{name}.json": draw for name, draw in drawn.items()})
    if not results:
        return paths
    pictures = "\n".join(f"![{name}]({name}.png)" for name in drawn)
    page = f"{markdown_report([result for result, _ in results])}\n## Figures\n\n{pictures}\n"
    return [*paths, _written(folder / PAGE, page.encode())]


def write_design_figures(found: Designed, stored: Path) -> list[Path]:
    """Draw a design beside its record, see `plans`. Raises BadInput."""
    return write_each({stored.with_name(f"{name}.json"): draw for name, draw in _of_design(stored.stem, found)})


def write_each(figures: Mapping[Path, Draw]) -> list[Path]:
    """Draw figures and write each beside its stored numbers. Raises BadInput, first of all, when a file cannot be."""
    require_unread(*(path.with_suffix(f".{form}") for path in figures for form in FORMS))
    return [path for stored, draw in figures.items() for path in write_beside(stored, draw())]


def write_beside(stored: Path, figure: Figure) -> list[Path]:
    """Write a figure as PNG and PDF beside its stored numbers. Raises BadInput when the folder takes no file."""
    return [_written(stored.with_suffix(f".{form}"), rendered(figure, form)) for form in FORMS]


def plans(
    results: list[Stored], displacement: bool = False, designs: Sequence[tuple[str, Designed]] = ()
) -> dict[str, Draw]:
    """What draws each figure, each stage once, by names of files that differ even where case does not matter."""
    named: dict[str, Draw] = {}
    of_designs = [each for name, found in designs for each in _of_design(name, found)]
    for wanted, draw in [*_of_cases(results, displacement), *_of_stages(results), *of_designs]:
        name, count, taken = wanted, 1, {each.casefold() for each in named}
        while name.casefold() in taken:
            count += 1
            name = f"{wanted}-{count}"
        named[name] = draw
    return named


def _of_design(name: str, found: Designed) -> Iterator[tuple[str, Draw]]:
    """A design, its sensitivity to each dimension and its front."""
    yield name, partial(design_figure, found)
    yield f"{name}-sensitivity", partial(sensitivity_figure, found)
    if found.front:
        yield f"{name}-front", partial(front_figure, found)


def _of_cases(results: list[Stored], displacement: bool) -> Iterator[tuple[str, Draw]]:
    for result, fields in results:
        stem = _file_name(result.case)
        yield f"{stem}-displacement" if displacement else stem, partial(error_figure, result, displacement)
        yield f"{stem}-deformed", partial(deformed_figure, result, fields)


def _of_stages(results: list[Stored]) -> Iterator[tuple[str, Draw]]:
    """Mesh, necks and hinge of every distinct stage, the model of every distinct mobility of it."""
    seen = set()
    for result, fields in results:
        for label, model in result.models.items():
            stem, freedoms = _file_name(Path(model.file).stem), str([hinge.freedoms for hinge in model.hinges])
            if model.hash not in seen:
                yield f"stage-{stem}", partial(stage_figure, model, fields[label])
                yield f"neck-{stem}", partial(neck_figure, model, fields[label])
                yield f"hinge-{stem}", partial(hinge_sketch, model)
            if (model.hash, freedoms) not in seen:
                yield f"model-{stem}-mobility{model.mobility}", partial(model_sketch, model)
            seen |= {model.hash, (model.hash, freedoms)}


def _file_name(text: str) -> str:
    """The text as a file name in this folder and no other."""
    return re.sub(r"[^\w.+-]+", "_", text).lstrip(".") or "unnamed"


def _written(path: Path, content: bytes) -> Path:
    write_atomically(path, lambda file: file.write(content))
    return path
