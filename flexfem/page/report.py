"""The command `flexfem report`: one self-contained HTML page of files or of stored results."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from flexfem.files.inputs import require_unread
from flexfem.files.provenance import assumptions_said
from flexfem.files.refusals import checked_path, place_of
from flexfem.files.toml import PathLike, kind_of, read_toml
from flexfem.files.writing import check_file, write_atomically
from flexfem.importing.drawings import NO_READING, Reading, is_drawing, load, require_no_reading
from flexfem.lazy import named
from flexfem.mechanism.loading import KINDS
from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.section import html_of
from flexfem.page.sources import TITLE
from flexfem.page.stored import stored_subject
from flexfem.page.study import study_subject
from flexfem.page.subject import SECTIONS, STANDARD, MechanismPage, Subject
from flexfem.questions.life import checked_amplitude
from flexfem.refused import BadInput, printed
from flexfem.results import Progress, versions
from flexfem.study import REPORTS

EXPECTED = "one stage, mechanism or study file, or results of verify and design as .json"
STUDY = "study file"
# pages of kinds of mechanisms with sections of their own, imported when one is made
PAGES = {"stage file": "paper.page.StagePage"}


class PageReport(NamedTuple):
    """The written page: its file, its size in bytes, its sections and its assumptions."""

    written: str
    bytes: int
    sections: list[str]
    assumed: list[str]
    not_stated: list[str]


def report(
    files: PathLike | Sequence[PathLike],
    output: Path = Path("report.html"),
    *,
    sections: Sequence[str] = STANDARD,
    amplitude: tuple[float, float, float] | None = None,
    folder: Path = REPORTS,
    progress: Progress | None = None,
    reading: Reading = NO_READING,
) -> PageReport:
    """Write one self-contained HTML page of a mechanism, a study or stored results and designs.

    Parameters
    ----------
    files : path or sequence of path
        A mechanism or stage file, a drawing, a study file whose designs are done, or results of
        verify and design as JSON.
    output : Path
        Page to write, .html.
    sections : sequence of str
        Sections of the page, with commas: analytic, elements, budget, stress, drive, large, modes,
        drift, and of a stage life; or all.
    amplitude : tuple of float, optional
        Amplitude of the platform of a stage for the section life, fully reversed: mm, mm, rad.
    folder : Path
        Folder of the results of a study.
    progress : callable, optional
        Called with the name of every part before it is computed.
    reading : Reading
        Of a drawing: its thickness, material, ground, output and so on.

    Raises
    ------
    BadInput, ComputationFailed
        Like the functions that compute the sections; then nothing is written.
    """
    paths = [checked_path(path) for path in (files if isinstance(files, list | tuple) else [files])]
    target = checked_path(output)
    studies_folder = checked_path(folder)
    if target.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"{place_of(target)}: expected a file that ends in .html")
    names = _checked_sections(sections, amplitude)
    check_file(target, *paths)
    subject = _subject(paths, names, amplitude, studies_folder, reading)
    require_unread(target)  # stages, studies and materials are read by now
    page_sections = []
    for name, make in subject.parts:
        if progress is not None:
            progress(name)
        page_sections.append(make())
    content = html_of(
        page_sections,
        title=subject.title,
        subtitle=f"{subject.kind}: {', '.join(map(str, paths))}",
        assumptions=_assumptions(subject),
        command=command_line(paths, target, names, amplitude, studies_folder, reading),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions(),
    ).encode(errors="backslashreplace")  # file names need not be UTF-8
    write_atomically(target, lambda file: file.write(content))
    titles = [each.title for each in page_sections]
    return PageReport(str(target), len(content), titles, subject.assumed, subject.not_stated)


def _assumptions(subject: Subject) -> str:
    """Return the sentence on assumed numbers at the top of a page, "" where there are none."""
    of = "of the numbers of this page "
    counts = assumptions_said(subject.assumed, subject.not_stated, of)
    if not counts:
        return ""
    return f"{'; '.join(counts)}. They are listed under “{TITLE}”."


def command_line(
    files: Sequence[Path],
    target: Path,
    sections: Sequence[str] = STANDARD,
    amplitude: Any = None,
    kept: Path = REPORTS,
    reading: Reading = NO_READING,
) -> str:
    """Return the shell command that makes a page again."""
    words = ["flexfem", "report", *map(str, files), "-o", str(target)]
    if tuple(sections) != STANDARD:
        words += ["--sections", ",".join(sections)]
    if amplitude is not None:
        words += ["--amplitude", *map(repr, checked_amplitude(amplitude).tolist())]
    words += reading.options
    if kept != REPORTS:
        words += ["--folder", str(kept)]
    return shlex.join(words)


def _checked_sections(sections: Sequence[str], amplitude: Any) -> tuple[str, ...]:
    """Return the names of the requested sections; a text may hold several, separated by commas.

    Raises BadInput.
    """
    if isinstance(sections, str) or not isinstance(sections, Sequence):
        raise BadInput(f"sections {printed(sections)}, expected a list of {', '.join(SECTIONS)}")
    stated = [name.strip() for text in sections for name in str(text).split(",")]
    names = tuple(filter(None, stated)) or STANDARD
    if names == ("all",):
        names = tuple(name for name in SECTIONS if name != "life" or amplitude is not None)
    unknown = [name for name in names if name not in SECTIONS]
    if unknown:
        raise BadInput(
            f"sections {', '.join(map(repr, unknown))}, expected some of {', '.join(SECTIONS)}"
        )
    if "life" in names and amplitude is None:
        raise BadInput(
            "section life without an amplitude, expected the amplitude of the platform: mm, mm, rad"
        )
    if "life" not in names and amplitude is not None:
        raise BadInput("an amplitude without section life, expected none: no other section uses it")
    if amplitude is not None:
        checked_amplitude(amplitude)
    return names


def _subject(
    files: Sequence[Path], sections: Sequence[str], amplitude: Any, folder: Path, reading: Reading
) -> Subject:
    """Return the subject of a page, whose kind follows from the content of the files.

    Raises BadInput.
    """
    _check_files(files)
    first = files[0]
    if is_drawing(first):
        return _page_of(load(first, reading), sections, amplitude).subject()
    require_no_reading(first, reading)
    stored = _are_stored(files)
    kind = "results" if stored else kind_of(read_toml(first).data, "stage file")
    if kind in KINDS:
        return _page_of(load(first), sections, amplitude).subject()
    if kind not in ("results", STUDY):
        raise BadInput(f"{place_of(first)}: this is a {kind or 'TOML file'}, expected {EXPECTED}")
    if tuple(sections) != STANDARD or amplitude is not None:
        this = "a study" if kind == STUDY else kind
        raise BadInput(
            f"{place_of(first)}: sections or an amplitude, expected none: they apply to a stage, "
            f"and this is {this}"
        )
    return stored_subject(files) if stored else study_subject(first, folder)


def _check_files(files: Sequence[Path]) -> None:
    """Raise BadInput for no file, one file twice, or several that are no stored results."""
    if not files:
        raise BadInput(f"no file, expected {EXPECTED}")
    if len({os.path.realpath(path) for path in files}) < len(files):
        raise BadInput(f"{', '.join(map(place_of, files))}: expected each file once")
    if len(files) > 1 and not _are_stored(files):
        raise BadInput(f"{place_of(files[0])} and {len(files) - 1} more, expected {EXPECTED}")


def _are_stored(files: Sequence[Path]) -> bool:
    return all(path.suffix.lower() == ".json" for path in files)


def _page_of(
    mechanism: Mechanism,
    sections: Sequence[str],
    amplitude: Any,
) -> MechanismPage:
    """Return the page of a mechanism. Raises BadInput for sections that it does not have."""
    place = PAGES.get(mechanism.kind)
    kind = MechanismPage if place is None else named(place)
    page: MechanismPage = kind(mechanism, sections, amplitude)
    return page
