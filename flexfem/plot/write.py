"""All figures and the page of text of stored verifications, as files; the same results give the same bytes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
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
FORMS = ("png", "pdf")
PAGE = "verification.md"


def write_figures(results: list[Stored], folder: Path, displacement: bool = False) -> list[Path]:
    """Draw every figure of stored verifications as PNG and PDF and write the page of text beside them.

    `displacement` : show displacements in the commanded direction instead of errors. Raises BadInput when the folder
    does not take a file.
    """
    planned = plans(results, displacement)
    require_unread(*figure_files(*(folder / f"{name}.json" for name in planned)), folder / PAGE)
    paths = [path for name, draw in planned.items() for path in write_beside(folder / f"{name}.json", draw())]
    pictures = "\n".join(f"![{name}]({name}.png)" for name in planned)
    page = f"{markdown_report([result for result, _ in results])}\n## Figures\n\n{pictures}\n"
    return [*paths, _written(folder / PAGE, page.encode())]


def figure_files(*stored: Path) -> list[Path]:
    """The files of the figures beside stored numbers, two for each."""
    return [path.with_suffix(f".{form}") for path in stored for form in FORMS]


def write_beside(stored: Path, figure: Figure) -> list[Path]:
    """Write a figure as PNG and PDF beside its stored numbers. Raises BadInput when the folder takes no file."""
    paths = figure_files(stored)
    require_unread(*paths)
    return [_written(path, rendered(figure, form)) for path, form in zip(paths, FORMS, strict=True)]


def write_design_figures(found: Designed, stored: Path) -> list[Path]:
    """Draw a design, its sensitivity to each dimension and its front beside its record. Raises BadInput."""
    figures = {"": design_figure, "-sensitivity": sensitivity_figure} | (
        {"-front": front_figure} if found.front else {}
    )
    named = {stored.with_name(f"{stored.stem}{part}.json"): draw for part, draw in figures.items()}
    require_unread(*figure_files(*named))
    return [path for beside, draw in named.items() for path in write_beside(beside, draw(found))]


def plans(results: list[Stored], displacement: bool = False) -> dict[str, Callable[[], Figure]]:
    """What draws each figure, each stage once, by names of files that differ even where case does not matter."""
    named: dict[str, Callable[[], Figure]] = {}
    taken = set[str]()
    for wanted, draw in [*_of_cases(results, displacement), *_of_stages(results)]:
        name, count = wanted, 1
        while name.casefold() in taken:
            count += 1
            name = f"{wanted}-{count}"
        taken.add(name.casefold())
        named[name] = draw
    return named


def _of_cases(results: list[Stored], displacement: bool) -> Iterator[tuple[str, Callable[[], Figure]]]:
    for result, fields in results:
        stem = _file_name(result.case)
        yield f"{stem}-displacement" if displacement else stem, partial(error_figure, result, displacement)
        yield f"{stem}-deformed", partial(deformed_figure, result, fields)


def _of_stages(results: list[Stored]) -> Iterator[tuple[str, Callable[[], Figure]]]:
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
