"""All figures of stored verifications, and the page of text beside them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

from flexfem.design.result import Designed
from flexfem.files.inputs import require_unread
from flexfem.paper.figures.deformed import deformed_figure
from flexfem.paper.figures.errors import error_figure
from flexfem.paper.figures.hinge import hinge_sketch
from flexfem.paper.figures.mesh import neck_figure, stage_figure
from flexfem.paper.figures.pseudo_rigid import model_sketch
from flexfem.paper.verification import Verification
from flexfem.plot.text import assumption_note, assumption_rows
from flexfem.plot.write import NamedFigure, named_apart, of_designs, write_each, write_text
from flexfem.results import Fields

Stored: TypeAlias = tuple[Verification, dict[str, Fields]]
PAGE = "verification.md"


def write_stored(
    results: Sequence[tuple[Path, Verification]],
    folder: Path,
    displacement: bool,
    designs: Sequence[tuple[str, Designed]],
) -> list[Path]:
    """Draw the figures of verifications that are stored in files, and of designs by name.

    Raises BadInput as `write_figures`, and for files without the fields of the figures.
    """
    stored = [(result, result.read_fields(path)) for path, result in results]
    return write_figures(stored, folder, displacement, designs)


def write_figures(
    results: Sequence[Stored],
    folder: Path,
    displacement: bool = False,
    designs: Sequence[tuple[str, Designed]] = (),
) -> list[Path]:
    """Draw every figure of stored verifications, and of designs by name, as PNG and PDF.

    A page of text on the verifications is written beside them. Raises BadInput when a file cannot
    be written to the folder.

    displacement : show displacements in the commanded direction instead of errors.
    """
    figures = plans(results, displacement, designs)
    require_unread(folder / PAGE)
    paths = write_each({folder / f"{name}.json": draw for name, draw in figures.items()})
    pictures = "\n".join(f"![{name}]({name}.png)" for name in figures)
    page = f"{markdown_report([result for result, _ in results])}\n## Figures\n\n{pictures}\n"
    return [*paths, write_text(folder / PAGE, page)]


def plans(
    results: Sequence[Stored],
    displacement: bool = False,
    designs: Sequence[tuple[str, Designed]] = (),
) -> dict[str, NamedFigure]:
    """Return functions that draw the figures by file names, each stage once."""
    figures = [*_of_cases(results, displacement), *_of_stages(results), *of_designs(designs)]
    return named_apart(figures)


def _of_cases(results: Sequence[Stored], displacement: bool) -> Iterator[tuple[str, NamedFigure]]:
    for result, fields in results:
        stem = _file_name(result.case)
        name = f"{stem}-displacement" if displacement else stem
        yield name, partial(error_figure, result, displacement)
        yield f"{stem}-deformed", partial(deformed_figure, result, fields)


def _of_stages(results: Sequence[Stored]) -> Iterator[tuple[str, NamedFigure]]:
    """Yield mesh, necks and hinge of every distinct stage, and its model at every mobility."""
    seen = set[object]()
    for result, fields in results:
        for label, model in result.models.items():
            stem = _file_name(Path(model.file).stem)
            if model.hash not in seen:
                seen.add(model.hash)
                yield f"stage-{stem}", partial(stage_figure, model, fields[label])
                yield f"neck-{stem}", partial(neck_figure, model, fields[label])
                yield f"hinge-{stem}", partial(hinge_sketch, model)
            at_mobility = (model.hash, str([hinge.freedoms for hinge in model.hinges]))
            if at_mobility not in seen:
                seen.add(at_mobility)
                yield f"model-{stem}-mobility{model.mobility}", partial(model_sketch, model)


def _file_name(text: str) -> str:
    """Return a text as a file name without path separators or a leading dot."""
    return re.sub(r"[^\w.+-]+", "_", text).lstrip(".") or "unnamed"


def markdown_report(results: Sequence[Verification]) -> str:
    """Return a Markdown page: tables of every result, warnings, and numbers without a source."""
    assumed = [key for result in results for key in result.assumed]
    not_stated = [key for result in results for key in result.not_stated]
    note = assumption_note(assumed, not_stated)
    parts = ["# Verification: analytic stage against finite elements"]
    parts.append("The error is the finite-element displacement minus the commanded one.")
    if note:
        parts.append(f"**{note}**: these numbers are listed at the end.")
    parts += [f"## {result.case}\n\n{result.to_markdown()}" for result in results]
    warnings = [f"- {result.case}: {text}" for result in results for text in result.warnings]
    if warnings:
        parts += ["## Warnings", "\n".join(warnings)]
    rows = assumption_rows([(result.case, result) for result in results])
    listed = [f"- `{key}`: {kind} ({names})" for key, kind, names in rows]
    parts.append("## Assumed numbers, and numbers without a source")
    parts.append("\n".join(listed or ["None: every number has a source."]))
    return "\n\n".join(parts) + "\n"
