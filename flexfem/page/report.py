"""One page of a stage or of stored results: what is asked is computed, put together and written as one file."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from flexfem import studies
from flexfem.files.inputs import require_unread
from flexfem.files.refusals import checked_path, place_of
from flexfem.files.toml import kind_of, read_toml
from flexfem.files.writing import check_file, write_atomically
from flexfem.mechanism.stage_file import doubts_said
from flexfem.page.assemble import Page, html_of
from flexfem.page.section import PageSection
from flexfem.questions.life import checked_amplitude
from flexfem.refused import BadInput
from flexfem.reports.given import PathLike
from flexfem.studies import REPORTS
from flexfem.verify.result import stamp, versions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flexfem.synthesis.result import Designed
    from flexfem.verify.result import Result

STANDARD = ("analytic", "elements", "budget", "stress", "drive")
MORE = ("large", "modes", "drift", "life")
SECTIONS = (*STANDARD, *MORE)
OF_A_STAGE = "sections or an amplitude, expected none: they are of a stage"


Part = tuple[str, Callable[[], PageSection | None]]  # a name, and what makes the section


class PageReport(NamedTuple):
    """The page that was written: its file, its size in bytes, the sections that it has."""

    written: str
    bytes: int
    sections: list[str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class Subject(NamedTuple):
    """What a page is about.

    kind : of its files, in words.   assumed, not_stated : key paths of numbers in doubt.
    parts : by name what makes each section, in order; a part that does not apply gives None.
    """

    title: str
    kind: str
    assumed: list[str]
    not_stated: list[str]
    parts: list[Part]


Through = Callable[[Sequence[Part]], Iterable[Part]]


def report(
    paths: PathLike | Sequence[PathLike],
    output: PathLike,
    sections: Sequence[str] = STANDARD,
    amplitude: ArrayLike | None = None,
    through: Through = iter,
    folder: PathLike = REPORTS,
) -> PageReport:
    """Write one self-contained page, which opens offline, of a stage, of a study or of stored results.

    Parameters
    ----------
    paths : a stage file, a study file whose designs are done, or any number of results of `flexfem verify` and
        records of `flexfem design`, all JSON.
    output : the file to write, .html.
    sections : of a stage, of `STANDARD` and `MORE`; the drawing and the sources of its numbers are always there.
    amplitude : (3,), mm, mm, rad, of the platform, fully reversed, for the section `life`.
    through : is given the parts of the page by name and yields each before it is computed, to tell how far it is.
    folder : of a study, where `flexfem study run` keeps what is done.

    Raises
    ------
    BadInput, ComputationFailed
        As the functions that answer each section; then nothing is written.
    """
    files = [checked_path(each) for each in (paths if isinstance(paths, list | tuple) else [paths])]
    target = checked_path(output)
    if target.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"{place_of(target)}: expected a file that ends in .html")
    _check_sections(sections, amplitude)
    check_file(target, *files)
    subject = _subject(files, sections, amplitude, checked_path(folder))
    require_unread(target)  # stages, studies and materials are read by now
    made = [section for _, make in through(subject.parts) if (section := make()) is not None]
    command = command_line(files, target, sections, amplitude, checked_path(folder))
    page = Page(
        title=subject.title,
        subtitle=f"{subject.kind}: {', '.join(map(str, files))}",
        doubts=doubts_line(subject),
        sections=made,
        command=command,
        made=stamp(),
        versions=versions(),
    )
    content = html_of(page).encode(errors="backslashreplace")  # names of files need not be UTF-8
    write_atomically(target, lambda file: file.write(content))
    names = [each.title for each in made]
    return PageReport(str(target), len(content), names, [], subject.assumed, subject.not_stated)


def doubts_line(subject: Subject) -> str:
    """What a page says first of numbers in doubt; "" without any."""
    said = doubts_said(subject.assumed, [], "of the numbers behind this page ")
    said += doubts_said([], subject.not_stated, "" if said else "of its numbers ")
    return f"{'; '.join(said)}. They are listed under “Where the numbers come from”." if said else ""


def command_line(
    files: Sequence[Path],
    target: Path,
    sections: Sequence[str] = STANDARD,
    amplitude: ArrayLike | None = None,
    folder: Path = REPORTS,
) -> str:
    """The command that makes a page again, for a shell."""
    words = ["flexfem", "report", *map(str, files), "-o", str(target)]
    if tuple(sections) != STANDARD:
        words += ["--sections", ",".join(sections)]
    if amplitude is not None:
        import numpy as np

        words += ["--amplitude", *(repr(float(value)) for value in np.asarray(amplitude))]
    if folder != REPORTS:
        words += ["--folder", str(folder)]
    return shlex.join(words)


def _check_sections(sections: Sequence[str], amplitude: ArrayLike | None) -> None:
    if isinstance(sections, str) or not isinstance(sections, Sequence):
        raise BadInput(f"sections {sections!r}, expected a list of {', '.join(SECTIONS)}")
    unknown = [each for each in sections if each not in list(SECTIONS)]
    if unknown:
        raise BadInput(f"sections {', '.join(map(repr, unknown))}, expected some of {', '.join(SECTIONS)}")
    if "life" in sections and amplitude is None:
        raise BadInput("section life without an amplitude, expected the amplitude of the platform: mm, mm, rad")
    if amplitude is not None:
        checked_amplitude(amplitude)
        if "life" not in sections:
            raise BadInput("an amplitude without section life, expected none: it is of no other section")


def _subject(files: Sequence[Path], sections: Sequence[str], amplitude: ArrayLike | None, folder: Path) -> Subject:
    """What the files are, told by their content. Raises BadInput."""
    if not files:
        raise BadInput("no file, expected a stage file, a study file, or results of flexfem verify")
    if len({os.path.realpath(path) for path in files}) < len(files):
        raise BadInput(f"{', '.join(map(place_of, files))}: expected each file once")
    stored = [path for path in files if path.suffix.lower() == ".json"]
    if len(stored) == len(files):
        if tuple(sections) != STANDARD or amplitude is not None:
            raise BadInput(f"{place_of(files[0])}: {OF_A_STAGE}, and these are results")
        return _stored(files)
    if len(files) > 1:
        raise BadInput(
            f"{place_of(files[0])} and {len(files) - 1} more, expected one stage or study file, or results as .json"
        )
    kind = kind_of(read_toml(files[0]).data, "stage file")
    if kind == "study file":
        if tuple(sections) != STANDARD or amplitude is not None:
            raise BadInput(f"{place_of(files[0])}: {OF_A_STAGE}, and this is a study")
        return _study(files[0], folder)
    if kind != "stage file":
        raise BadInput(
            f"{place_of(files[0])}: this is a {kind or 'TOML file'}, expected a stage file, a study file or results as "
            ".json"
        )
    from flexfem.mechanism.stage import load_feasible
    from flexfem.page.of_stage import stage_parts
    from flexfem.page.stage import doubted
    from flexfem.reports.stage import check

    stage = load_feasible(files[0])
    found = check(stage)
    return Subject(stage.name, "Stage", *doubted(found), stage_parts(stage, found, sections, amplitude))


def _study(path: Path, folder: Path) -> Subject:
    from flexfem.page.study import study_parts

    status = studies.study_status(path, folder)
    if status["open"]:
        raise BadInput(
            f"{place_of(path)}: {status['open']} of {status['designs']} designs are open in "
            f"{place_of(status['folder'])}, expected all done by flexfem study run"
        )
    found = studies.study_findings(path, folder)
    parts: list[Part] = [*study_parts(found.source, found.found, status)]
    return Subject(found.source.loaded.study.name, "Study", status["assumed"], status["not_stated"], parts)


def _stored(files: Sequence[Path]) -> Subject:
    from flexfem.page import results as of_results
    from flexfem.page.design import design_parts
    from flexfem.synthesis.stored import is_design, read_design
    from flexfem.verify.result_files import read_result

    drawn = [path for path in files if is_design(path)]
    results = [read_result(path) for path in files if path not in drawn]
    designs = [read_design(path) for path in drawn]
    parts: list[Part] = []
    for number, design in enumerate(designs, start=1):
        parts += design_parts(design, number, len(designs) > 1)
    if results:
        parts += [("errors", lambda: of_results.errors_section(results))]
        for number, result in enumerate(results, start=1):
            parts.append((result.name, lambda one=result, k=number: of_results.curves_section(one, k)))  # type: ignore[misc]
    if results:
        parts += [("models", lambda: of_results.models_section(results))]
    every: list[Result | Designed] = [*results, *designs]
    parts += [("sources", lambda: of_results.doubts_section(results, designs))]
    found = ([key for each in every for key in getattr(each, kind)] for kind in ("assumed", "not_stated"))
    assumed, not_stated = (list(dict.fromkeys(keys)) for keys in found)
    title = every[0].name if len(every) == 1 else "Verification" if results else "Designs"
    return Subject(title, "Stored results", assumed, not_stated, parts)


def _numbered(section: PageSection, number: int) -> PageSection:
    return replace(section, id=f"{section.id}-{number}")
