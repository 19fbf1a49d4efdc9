"""HTML pages on a stage, a mechanism, a study, stored results or designs, and figure files of
stored results.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from markupsafe import Markup

from flexfem import studies
from flexfem.arrays import Array
from flexfem.design.result import Designed, is_design, read_design
from flexfem.files.inputs import require_unread
from flexfem.files.provenance import assumptions_said, counted, is_assumed
from flexfem.files.refusals import checked_path, place_of
from flexfem.files.toml import PathLike, kind_of, read_toml
from flexfem.files.writing import check_file, check_folder, write_atomically
from flexfem.hinges.strength import required_law
from flexfem.importing.drawings import NO_READING, Reading, is_drawing, load, require_no_reading
from flexfem.mechanism.content import located
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.page.key import ENDS, SHARES, Ask, opening
from flexfem.page.section import (
    PageSection,
    facts,
    folded,
    html_of,
    notes,
    parts,
    section,
    shown_figure,
    table,
)
from flexfem.page.study import Part, study_parts
from flexfem.paper.figures.errors import error_figure
from flexfem.paper.figures.stored import write_figures
from flexfem.paper.responses import require_expansion
from flexfem.paper.stage import Stage
from flexfem.paper.verification import Verification
from flexfem.plot import figures_of
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.fields import plane_fields, stress_figure
from flexfem.plot.plate import drawing_figure
from flexfem.plot.text import SYMBOLS, assumption_rows, percent, significant
from flexfem.plot.write import write_designs, write_of_result
from flexfem.questions import plates
from flexfem.questions.budget import budget
from flexfem.questions.check import MechanismReport, check
from flexfem.questions.drive import drive
from flexfem.questions.heat import drift
from flexfem.questions.large import large
from flexfem.questions.life import checked_amplitude, life
from flexfem.questions.modes import modes
from flexfem.questions.reach import reach
from flexfem.questions.stiffness import stiffness
from flexfem.questions.summary import summary
from flexfem.refused import BadInput, printed
from flexfem.results import AXES, Fields, Progress, Result, TextTable, record_parts, versions
from flexfem.study import REPORTS
from flexfem.units import COMMANDS, DIRECTIONS, STRESS, unit_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Question: TypeAlias = Callable[..., Any]


ANALYTIC_MODEL = partial(stiffness, models="analytic")
ANSWERED: dict[
    str, tuple[str, tuple[Question, ...], tuple[Question, ...]]
] = {  # title, of a stage, of a mechanism
    "analytic": ("Analytic model", (ANALYTIC_MODEL,), (ANALYTIC_MODEL,)),
    "elements": ("Finite elements", (summary,), (stiffness,)),
    "budget": ("Error budget", (SHARES,), (plates.verification, budget)),
    "stress": ("Stress", (), ()),  # of several displacements, in one figure
    "drive": ("Drive", (ENDS,), (drive, reach)),
    "large": ("Large displacements", (large,), (large,)),
    "modes": ("Natural modes", (modes,), (modes,)),
    "drift": ("Drift by temperature", (drift,), (drift,)),
    "life": ("Fatigue life", (life,), ()),
}
OF_HINGES = ("analytic", "budget", "life")  # sections that a plate without hinges does not have
SECTIONS = tuple(ANSWERED)
STANDARD = tuple(ANSWERED)[:5]
DESIGN_SECTIONS: dict[
    str, tuple[str, Callable[[Designed], Figure] | None]
] = {  # with the function of the figure
    "design": ("Design", design_figure),
    "requirements": ("Requirements", None),
    "sensitivity": ("Sensitivity to each dimension", sensitivity_figure),
    "front": ("Pareto front", front_figure),
    "search": ("Search", None),
}
EXPECTED = "one stage, mechanism or study file, or results of verify and design as .json"
PROVENANCE = "Sources of the numbers"
WITHOUT_MESH = frozenset(("analytic", "drive", "life"))  # sections of a stage
STRESS_AMPLITUDES = np.array(
    [0.05, 0.05, 1e-3]
)  # mm, mm, rad: commands of the stress figure, assumed, as in cases/
KINDS = {
    "assumed": "assumed",
    "not_stated": "source not stated",
}  # labels of the kinds of assumptions


class PageReport(NamedTuple):
    """The written page: its file, its size in bytes, its sections and its assumptions."""

    written: str
    bytes: int
    sections: list[str]
    assumed: list[str]
    not_stated: list[str]


class WrittenFigures(NamedTuple):
    """The written files."""

    written: list[str]


class Subject(NamedTuple):
    """Subject of a page: its title, the kind of its files, its assumptions, and its parts in order."""

    title: str
    kind: str
    assumed: list[str]
    not_stated: list[str]
    parts: list[Part]


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
    """Write one self-contained HTML page of a stage, a mechanism, a study or stored results and
    designs.

    Parameters
    ----------
    files : path or sequence of path
        A stage or mechanism file, a drawing, a study file whose designs are done, or results of
        verify and design as JSON.
    output : Path
        Page to write, .html.
    sections : sequence of str
        Sections of a stage, with commas: analytic, elements, budget, stress, drive, large, modes,
        drift, life; or all. A mechanism has all but life.
    amplitude : tuple of float, optional
        Amplitude of the platform for the section life, fully reversed: mm, mm, rad.
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
    assumptions = assumptions_said(
        subject.assumed, subject.not_stated, "of the numbers of this page "
    )
    page_sections = []
    for name, make in subject.parts:
        if progress is not None:
            progress(name)
        page_sections.append(make())
    content = html_of(
        page_sections,
        title=subject.title,
        subtitle=f"{subject.kind}: {', '.join(map(str, paths))}",
        assumptions=f"{'; '.join(assumptions)}. They are listed under “{PROVENANCE}”."
        if assumptions
        else "",
        command=command_line(paths, target, names, amplitude, studies_folder, reading),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions(),
    ).encode(errors="backslashreplace")  # file names need not be UTF-8
    write_atomically(target, lambda file: file.write(content))
    return PageReport(
        str(target),
        len(content),
        [s.title for s in page_sections],
        subject.assumed,
        subject.not_stated,
    )


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
    words += ["--sections", ",".join(sections)] if tuple(sections) != STANDARD else []
    words += (
        ["--amplitude", *map(repr, checked_amplitude(amplitude).tolist())]
        if amplitude is not None
        else []
    )
    words += reading.options
    return shlex.join(words + (["--folder", str(kept)] if kept != REPORTS else []))


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
    paths = [checked_path(each) for each in results]
    others = {path: result for path in paths if (result := _of_question(path)) is not None}
    verified, designs = _read_stored([path for path in paths if path not in others])
    if not verified and (displacement or not (designs or others)):
        problem = "--displacement without a verified case" if paths else "no file"
        raise BadInput(f"{problem}, expected results of flexfem verify")
    stored = [(result, result.read_fields(path)) for path, result in verified.items()]
    named = [(path.stem, found) for path, found in designs.items()]
    if verified:
        written = write_figures(stored, output, displacement, named)
    else:
        written = write_designs(named, output)
    written += [
        figure
        for path, result in others.items()
        for figure in write_of_result(result, output / path.name)
    ]
    return WrittenFigures([*map(str, written)])


def _of_question(path: Path) -> Result | None:
    """Return a stored result that its own figure draws without fields, None of a case or a design."""
    if is_design(path):
        return None
    result = Result.read(path)
    own = (
        bool(result.figure)
        and not result.drawn_from_fields
        and not isinstance(result, Verification)
    )
    return result if own else None


def _read_stored(paths: Sequence[Path]) -> tuple[dict[Path, Verification], dict[Path, Designed]]:
    """Return stored verifications of cases, and designs, by their files. Raises BadInput for other
    results.
    """
    designs = {path: read_design(path) for path in paths if is_design(path)}
    verified = dict[Path, Verification]()
    for path in (path for path in paths if path not in designs):
        result = Result.read(path)
        if not isinstance(result, Verification):
            expected = (
                "results of verify of a case, or of design; other commands draw their results "
                "with --output"
            )
            raise BadInput(f"{place_of(path)}: {result.title}, expected {expected}")
        verified[path] = result
    return verified, designs


def _checked_sections(sections: Sequence[str], amplitude: Any) -> tuple[str, ...]:
    """Return the names of the requested sections; a text may hold several, separated by commas.
    Raises BadInput.
    """
    if isinstance(sections, str) or not isinstance(sections, Sequence):
        raise BadInput(f"sections {printed(sections)}, expected a list of {', '.join(SECTIONS)}")
    names = (
        tuple(name.strip() for text in sections for name in str(text).split(",") if name.strip())
        or STANDARD
    )
    if names == ("all",):
        names = tuple(name for name in SECTIONS if name != "life" or amplitude is not None)
    if unknown := [name for name in names if name not in SECTIONS]:
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
    """Return the subject of a page, whose kind follows from the content of the files. Raises
    BadInput.
    """
    if not files:
        raise BadInput(f"no file, expected {EXPECTED}")
    if len({os.path.realpath(path) for path in files}) < len(files):
        raise BadInput(f"{', '.join(map(place_of, files))}: expected each file once")
    stored = all(path.suffix.lower() == ".json" for path in files)
    first = place_of(files[0])
    if not stored and len(files) > 1:
        raise BadInput(f"{first} and {len(files) - 1} more, expected {EXPECTED}")
    if is_drawing(files[0]):
        return _plate_subject(load(files[0], reading), sections, amplitude)
    require_no_reading(files[0], reading)
    kind = "results" if stored else kind_of(read_toml(files[0]).data, "stage file")
    if kind in ("stage file", MechanismFile.kind):
        return _plate_subject(load(files[0]), sections, amplitude)
    if kind not in ("results", "study file"):
        raise BadInput(f"{first}: this is a {kind or 'TOML file'}, expected {EXPECTED}")
    if tuple(sections) != STANDARD or amplitude is not None:
        this = "a study" if kind == "study file" else kind
        raise BadInput(
            f"{first}: sections or an amplitude, expected none: they apply to a stage, and this "
            f"is {this}"
        )
    return _stored_subject(files) if stored else _study_subject(files[0], folder)


def _study_subject(path: Path, folder: Path) -> Subject:
    parts_on_disk = studies.parts_of(path, folder)
    status = studies.status_facts(parts_on_disk)
    if status["open"]:
        raise BadInput(
            f"{place_of(path)}: {status['open']} of {status['designs']} designs are unfinished in "
            f"{place_of(status['folder'])}. Run `flexfem study run`"
        )
    found = studies.findings_of(parts_on_disk)
    loaded = found.source.loaded
    texts = {f"stage: {key}": text for key, text in loaded.base.sources.items()}
    texts |= {f"study: {key}": text for key, text in loaded.study.sources.items()}
    rows = [
        [key, label, texts.get(key) or ""] for kind, label in KINDS.items() for key in status[kind]
    ]
    made = study_parts(found.source, found.found, status)
    made.append(("sources", partial(_provenance_section, rows, "source")))
    return Subject(loaded.study.name, "Study", status["assumed"], status["not_stated"], made)


def _stored_subject(files: Sequence[Path]) -> Subject:
    verified, read = _read_stored(files)
    results = [*verified.values()]
    designs = [*read.values()]
    made: list[Part] = [
        (f"{design.name}: {name}", partial(_design_section, design, name, number))
        for number, design in enumerate(designs, start=1)
        for name in design.sections()
    ]
    made += [
        (case.name, partial(_case_section, case, number))
        for number, case in enumerate(results, start=1)
    ]
    records: list[Any] = [*results, *designs]
    rows = assumption_rows([(record.name, record) for record in records])
    made.append(("sources", partial(_provenance_section, rows, "in")))
    title = records[0].name if len(records) == 1 else "Verification" if results else "Designs"
    return Subject(title, "Stored results", *_assumptions(records), made)


def _plate_subject(plate: Mechanism, names: Sequence[str], amplitude: Any) -> Subject:
    stage = plate if isinstance(plate, Stage) else None
    if stage is None and "life" in names:
        raise BadInput(f"{plate.origin}: section life, expected some of {', '.join(SECTIONS[:-1])}")
    with located(plate):  # before anything is computed
        if "life" in names:
            required_law(plate.material)
        if "drift" in names:
            require_expansion(plate)
    if not plate.layout.joints:
        names = [name for name in names if name not in OF_HINGES]
        if not names:
            raise BadInput(
                f"{plate.origin}: no [[hinge]], expected sections other than {', '.join(OF_HINGES)}"
            )
    checked = check(plate)
    meshed = not (WITHOUT_MESH if stage else {"analytic"}).issuperset(names)
    if stage and meshed:  # both models are in the same plane problem
        plate = stage.model_copy(update={"model": stage.model})
        plate.__dict__["origin"] = stage.origin
    ask = cache(lambda question: question(plate))
    assumed, not_stated = _assumptions(
        [each for each in (checked, getattr(checked, "drive", None)) if each]
    )
    kind = type(plate).__name__
    opened = partial(opening, plate, ask, names, meshed)
    made: list[Part] = [(kind.lower(), partial(_drawing_section, plate, checked, opened))]
    driven = plate.actuator if isinstance(plate, Stage) else plate.layout.actuators
    for name, (_, of_stage, of_mechanism) in ANSWERED.items():
        if name == "stress" and name in names:
            made.append((name, partial(_stress_section, plate)))
        elif name in names and (name != "drive" or driven):
            questions = of_stage if stage else of_mechanism
            questions = (partial(life, amplitude=amplitude),) if name == "life" else questions
            made.append((name, partial(_answers_section, name, ask, questions)))
    made.append(
        ("sources", partial(_provenance_section, _provenance(plate, assumed, not_stated), "source"))
    )
    return Subject(plate.name, kind, assumed, not_stated, made)


def _assumptions(records: Sequence[Any]) -> tuple[list[str], list[str]]:
    """Return the assumed keys of all records, and those without a source."""
    assumed, not_stated = (
        list(dict.fromkeys(k for each in records for k in getattr(each, kind))) for kind in KINDS
    )
    return assumed, not_stated


def _provenance(stage: Mechanism, assumed: list[str], not_stated: list[str]) -> list[list[str]]:
    """Return rows of key, kind and source for all values of a file, those assumed first."""
    sources = {key: text for key, text in stage.sources.items() if text and key in stage.values}
    assumed = list(
        dict.fromkeys([*assumed, *(key for key, text in sources.items() if is_assumed(text))])
    )
    rows = [[key, "assumed", sources.get(key, "not a number of the file")] for key in assumed]
    rows += [[key, "source not stated", "no source in the file"] for key in not_stated]
    return rows + [
        [key, "stated", text] for key, text in sources.items() if key not in {*assumed, *not_stated}
    ]


def _answers_section(name: str, ask: Ask, questions: Sequence[Question]) -> PageSection:
    """Return the tables of the results of questions, and their figures."""
    title = ANSWERED[name][0]
    answers = [ask(question) for question in questions]
    drawn = [found for found in answers if found.figure and name not in ("analytic", "elements")]
    figures = [
        shown_figure(f"{name}-figure", partial(_main_figure, found), title) for found in drawn
    ]
    return section(name, title, *map(parts.answered, answers), *figures)


def _main_figure(found: Any) -> Any:
    return figures_of(found)[""]


def _drawing_section(
    subject: Mechanism,
    checked: MechanismReport,
    opened: Callable[[Markup], Markup],
) -> PageSection:
    """Return the drawing of a stage or mechanism and its key results, then its dimensions and
    parts.
    """
    pairs, tables = record_parts(checked, plain=False)
    pairs = [
        pair for pair in pairs if not (pair[0] == "sources" and pair[1].startswith("\n"))
    ]  # in another section
    kind = type(subject).__name__.lower()
    figure = shown_figure(
        "drawing",
        partial(drawing_figure, subject, small=True),
        f"Drawing to scale of {subject.name}",
        table(tables[0]),
    )
    listed = folded("Dimensions, material and parts", facts(pairs), *map(table, tables[1:]))
    return section(kind, f"The {kind}", opened(figure), notes(checked.warnings), listed)


def _stress_section(subject: Mechanism) -> PageSection:
    """Return the von Mises stress by finite elements for displacements in X, in Y (of a mechanism)
    and in theta.
    """
    drawn = dict[str, Fields]()
    stresses = dict[str, Array]()
    stage = isinstance(subject, Stage)
    for axis in (0, 2) if stage else (0, 1, 2):
        held = tuple(STRESS_AMPLITUDES[axis] * np.eye(3)[axis])
        found = stiffness(subject, models="elements", displacement=held, no_limits=not stage)
        unit = COMMANDS[axis]
        name = f"{SYMBOLS[axis]} = {held[axis] * unit.factor:g} {unit}"
        drawn[name] = plane_fields(found.fields)
        model = found.axes["model"][-1]
        stresses[name] = np.ravel(found.at("neck_stress" if stage else "hinge_stress", model=model))
        if "body_stress" in found.values:
            stresses[name] = np.concatenate([stresses[name], found.at("body_stress", model=model)])
    labels = [f"{h} hinge, {chain}" for chain in AXES["chain"] for h in AXES["hinge"]]
    if not stage:
        labels = [*found.axes["hinge"], *(f"body {name}" for name in found.axes.get("body", ()))]
    rows = [
        [label, *map(significant, row)]
        for label, *row in zip(labels, *stresses.values(), strict=True)
    ]
    head = ["part", *(f"{name} ({STRESS})" for name in drawn)]
    data = table(TextTable(head, rows, 1, "Highest von Mises stress of each hinge and body"))
    highest = "; ".join(
        f"{name}: {significant(float(stress.max()))} {STRESS} at most, "
        f"{percent(100 * float(stress.max()) / subject.material.yield_strength)} of the yield "
        "strength"
        for name, stress in stresses.items()
    )
    note = f"The other directions are held; the amplitudes are assumed. {highest}."
    figure = shown_figure(
        "stress-figure", partial(stress_figure, drawn), "Von Mises stress when displaced", data
    )
    return section("stress", "Stress", notes([note], "note"), figure)


def _design_section(design: Designed, name: str, number: int) -> PageSection:
    """Return one section of the tables of a design, with its figure."""
    title, draw = DESIGN_SECTIONS[name]
    anchor = f"design-{number}-{name}"
    made = list[Markup]()
    title = f"{title}: {design.name}"
    if name == "design":
        pairs = [
            ("requirements", design.file),
            ("base stage", design.base),
            ("result", f"it {design.state}"),
        ]
        made += (
            facts([*pairs, ("seed", str(design.seed))]),
            notes(design.warnings),
            notes(design.sentences(), "note"),
        )
    made += [shown_figure(f"{anchor}-figure", partial(draw, design), title)] if draw else []
    return section(anchor, title, *made, *map(table, design.sections(plain=False)[name]))


def _case_section(result: Verification, number: int) -> PageSection:
    """Return the error curves of a case with their mesh bands."""
    command = unit_for(result.direction, max(map(abs, result.commanded)))
    columns = {
        f"commanded {SYMBOLS[DIRECTIONS.index(result.direction)]} ({command})": (
            result.commanded,
            command,
        )
    }
    for label in result.curves:
        for symbol, axis in zip(SYMBOLS, DIRECTIONS, strict=True):
            values = result.at("error", curve=label, direction=axis).tolist()
            unit = unit_for(axis, max(map(abs, values)))
            columns[f"{label}: error in {symbol} ({unit})"] = (values, unit)
    texts = [
        [significant(value * unit.factor, 5) for value in values]
        for values, unit in columns.values()
    ]
    data = table(TextTable([*columns], [*map(list, zip(*texts, strict=True))], 0))
    figure = shown_figure(
        f"curves-{number}", partial(error_figure, result), f"Errors of {result.name}", data
    )
    return section(f"case-{number}", result.name, figure, parts.answered(result))


def _provenance_section(rows: Sequence[Sequence[str]], last: str) -> PageSection:
    """Return the table of rows of a key, its kind, and its source or records; `last` is the heading
    of these.
    """
    assumed, not_stated = (sum(row[1] == kind for row in rows) for kind in KINDS.values())
    tag = Markup('<span class="tag">{}</span>')
    marked = [
        [key, kind if kind == "stated" else tag.format(kind), text] for key, kind, text in rows
    ]
    counts = (
        counted(assumed, "of these numbers is", "of these numbers are"),
        counted(not_stated, "has", "have"),
    )
    listed = TextTable(["key of the file", "kind", last], marked, 3)
    return section("provenance", PROVENANCE, parts.sources(listed, *counts))
