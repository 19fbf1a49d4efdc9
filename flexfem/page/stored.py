"""Stored results and designs: their figures as files, and the sections of their page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import Markup

from flexfem.design.result import Designed, is_design, read_design
from flexfem.files.refusals import checked_path, place_of
from flexfem.files.writing import check_folder
from flexfem.lazy import named
from flexfem.page.section import PageSection, Part, facts, notes, section, shown_figure, table
from flexfem.page.sources import assumptions_of, sources_section
from flexfem.page.subject import Subject
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.text import assumption_rows
from flexfem.plot.write import write_designs, write_of_result
from flexfem.refused import BadInput
from flexfem.results import Result
from flexfem.schemas.formats import results as all_results
from flexfem.study import REPORTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DESIGN_SECTIONS: dict[str, tuple[str, Callable[[Designed], Figure] | None]] = {
    "design": ("Design", design_figure),  # titles, and functions of figures
    "requirements": ("Requirements", None),
    "sensitivity": ("Sensitivity to each dimension", sensitivity_figure),
    "front": ("Pareto front", front_figure),
    "search": ("Search", None),
}
EXPECTED = (
    "results of verify of a case, or of design; other commands draw their results with --output"
)


class WrittenFigures(NamedTuple):
    """The written files."""

    written: list[str]


class StoredFiles(NamedTuple):
    """Stored results by their files.

    designs : results of `flexfem design`.
    kept : results with fields in a file, whose class names the module that shows them.
    others : all others.
    """

    designs: dict[Path, Designed]
    kept: dict[Path, Result]
    others: dict[Path, Result]


def read_stored(paths: Sequence[Path]) -> StoredFiles:
    """Read stored results. Raises BadInput for a file that is none, or that was changed."""
    all_results()  # makes every kind of result known
    stored = StoredFiles({}, {}, {})
    for path in paths:
        if is_design(path):
            stored.designs[path] = read_design(path)
            continue
        result = Result.read(path)
        if result.stored_by:
            stored.kept[path] = result
        else:
            stored.others[path] = result
    return stored


def plot_results(
    *results: Path, output: Path = REPORTS, displacement: bool = False
) -> WrittenFigures:
    """Draw figures and the report page from stored results, as PNG and PDF.

    Parameters
    ----------
    *results : Path
        Results of verify or design, and other results whose figures need no fields, as JSON.
    output : Path
        Folder for the written files.
    displacement : bool
        Show displacements along the commanded direction, and errors across it.

    Raises
    ------
    BadInput
        A file is not a result or was changed since it was stored, or the folder is not writable.
    """
    check_folder(output)
    stored = read_stored([checked_path(each) for each in results])
    for path, result in stored.others.items():
        if not result.figure or result.drawn_from_fields:
            raise _not_drawn(path, result)
    if not stored.kept and (displacement or not (stored.designs or stored.others)):
        problem = "--displacement without a verified case" if results else "no file"
        raise BadInput(f"{problem}, expected results of flexfem verify")
    designs = [(path.stem, found) for path, found in stored.designs.items()]
    if stored.kept:
        written: list[Path] = _write_kept(stored.kept, output, displacement, designs)
    else:
        written = write_designs(designs, output)
    for path, result in stored.others.items():
        written += write_of_result(result, output / path.name)
    return WrittenFigures([*map(str, written)])


def _write_kept(
    kept: dict[Path, Result],
    folder: Path,
    displacement: bool,
    designs: Sequence[tuple[str, Designed]],
) -> list[Path]:
    """Draw the figures of results with fields, and of designs, by the module of the former."""
    (module,) = {result.stored_by for result in kept.values()}
    written: list[Path] = named(f"{module}.write_stored")(
        [*kept.items()], folder, displacement, designs
    )
    return written


def _not_drawn(path: Path, result: Result) -> BadInput:
    return BadInput(f"{place_of(path)}: {result.title}, expected {EXPECTED}")


def stored_subject(files: Sequence[Path]) -> Subject:
    """Return the subject of a page of stored results. Raises BadInput."""
    stored = read_stored(files)
    for path, result in stored.others.items():
        raise _not_drawn(path, result)
    designs = list(stored.designs.values())
    results = list(stored.kept.values())
    made = list[Part]()
    for number, design in enumerate(designs, start=1):
        for name in design.sections():
            draw = partial(_design_section, design, name, number)
            made.append((f"{design.name}: {name}", draw))
    for number, result in enumerate(results, start=1):
        make = named(f"{result.stored_by}.stored_section")
        made.append((_name(result), partial(make, result, number)))
    records: list[Any] = [*results, *designs]
    rows = assumption_rows([(_name(record), record) for record in records])
    made.append(("sources", partial(sources_section, rows, "in")))
    several = "Verification" if results else "Designs"
    title = _name(records[0]) if len(records) == 1 else several
    return Subject(title, "Stored results", *assumptions_of(records), made)


def _name(record: Any) -> str:
    name: str = record.name
    return name


def _design_section(
    design: Designed,
    name: str,
    number: int,
) -> PageSection:
    """Return one section of the tables of a design, with its figure."""
    title, draw = DESIGN_SECTIONS[name]
    anchor = f"design-{number}-{name}"
    title = f"{title}: {design.name}"
    made = list[Markup]()
    if name == "design":
        pairs = [
            ("requirements", design.file),
            ("base stage", design.base),
            ("result", f"it {design.state}"),
            ("seed", str(design.seed)),
        ]
        made = [facts(pairs), notes(design.warnings), notes(design.sentences(), "note")]
    if draw is not None:
        made.append(shown_figure(f"{anchor}-figure", partial(draw, design), title))
    return section(anchor, title, *made, *map(table, design.sections(plain=False)[name]))
