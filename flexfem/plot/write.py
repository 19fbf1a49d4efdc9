"""All figures and the page of text of stored verifications, as files; the same results give the same bytes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeAlias

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
from flexfem.questions.errors import CurveModels, Verification
from flexfem.results import Fields

Stored: TypeAlias = tuple[Verification, dict[str, Fields]]
FORMS = ("png", "pdf")
PAGE = "verification.md"


class Plan(NamedTuple):
    """A figure to draw and the name of its files, without extension."""

    name: str
    draw: Callable[[], Figure]


def write_figures(
    results: list[Stored],
    folder: Path,
    each: Callable[..., Iterable[list[bytes]]] = map,
    displacement: bool = False,
) -> list[Path]:
    """Draw every figure of the results as PNG and PDF and write the page of text beside them.

    Parameters
    ----------
    results : list of (Result, dict of Fields)
        Stored verifications, each with its fields by label.
    folder : Path
        Where the files go; made when missing.
    each : callable
        Applies a function to every figure, in order, as `map` does; that of a pool of processes draws side by side.
    displacement : bool
        Show displacements in the commanded direction instead of errors, see `errors.error_figure`.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    BadInput
        When the folder does not take a file.
    """
    planned, paths = plans(results, displacement), []
    stored = [folder / f"{plan.name}.json" for plan in planned]
    require_unread(*figure_files(*stored), folder / PAGE)
    for path, contents in zip(stored, each(drawn, planned), strict=True):
        paths += [_written(file, content) for file, content in zip(figure_files(path), contents, strict=True)]
    pictures = "\n".join(f"![{plan.name}]({plan.name}.png)" for plan in planned)
    page = f"{markdown_report([result for result, _ in results])}\n## Figures\n\n{pictures}\n"
    return [*paths, _written(folder / PAGE, page.encode())]


def drawn(plan: Plan) -> list[bytes]:
    """A figure as the bytes of its files, one for each of `FORMS`."""
    figure = plan.draw()
    return [rendered(figure, form) for form in FORMS]


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


def plans(results: list[Stored], displacement: bool = False) -> list[Plan]:
    """The figures of the results, each stage once, under names that differ even where case does not matter."""
    named: dict[str, Plan] = {}
    for wanted, draw in [*_of_cases(results, displacement), *_of_stages(results)]:
        name, count = wanted, 1
        while name.casefold() in named:
            count += 1
            name = f"{wanted}-{count}"
        named[name.casefold()] = Plan(name, draw)
    return list(named.values())


def _of_cases(results: list[Stored], displacement: bool) -> Iterator[tuple[str, Callable[[], Figure]]]:
    for result, fields in results:
        stem = _file_name(result.case)
        yield f"{stem}-displacement" if displacement else stem, partial(error_figure, result, displacement)
        yield f"{stem}-deformed", partial(deformed_figure, result, fields)


def _of_stages(results: list[Stored]) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Mesh, necks and hinge of every distinct stage, the model of every distinct mobility of it."""
    models = [(model, fields[label]) for result, fields in results for label, model in result.models.items()]
    hashes: dict[str, set[str]] = {}
    for model, _ in models:
        hashes.setdefault(_stem(model).casefold(), set()).add(model.hash)
    seen = set()
    for model, field in models:
        stem = _stem(model)
        if len(hashes[stem.casefold()]) > 1:
            stem = f"{stem}-{model.hash[:6]}"
        freedoms = str([hinge.freedoms for hinge in model.hinges])
        if model.hash not in seen:
            yield f"stage-{stem}", partial(stage_figure, model, field)
            yield f"neck-{stem}", partial(neck_figure, model, field)
            yield f"hinge-{stem}", partial(hinge_sketch, model)
        if (model.hash, freedoms) not in seen:
            yield f"model-{stem}-mobility{model.mobility}", partial(model_sketch, model)
        seen |= {model.hash, (model.hash, freedoms)}


def _stem(model: CurveModels) -> str:
    return _file_name(Path(model.file).stem)


def _file_name(text: str) -> str:
    """The text as a file name in this folder and no other."""
    return re.sub(r"[^\w.+-]+", "_", text).lstrip(".") or "unnamed"


def _written(path: Path, content: bytes) -> Path:
    write_atomically(path, lambda file: file.write(content))
    return path
