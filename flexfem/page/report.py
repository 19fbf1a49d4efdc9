"""One page of a stage, a study, stored results or designs, and the figures of stored ones as files."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from markupsafe import Markup

from flexfem import studies
from flexfem.analytic.responses import require_expansion
from flexfem.design.result import Designed, is_design, read_design
from flexfem.fem.fields import neck_maxima
from flexfem.files.inputs import require_unread
from flexfem.files.provenance import is_assumed, values_by_key
from flexfem.files.refusals import checked_path, place_of
from flexfem.files.toml import PathLike, kind_of, read_toml
from flexfem.files.writing import check_file, check_folder, write_atomically
from flexfem.hinges.strength import required_law
from flexfem.mechanism.stage import HINGE_NAMES, Stage, load_feasible
from flexfem.mechanism.stage_file import assumptions_said, counted, located
from flexfem.models import solve
from flexfem.page.section import PageSection, facts, html_of, notes, shown_figure, table, tables_of
from flexfem.page.study import Part, study_parts
from flexfem.plot import figures_of
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.errors import error_figure
from flexfem.plot.fields import stress_figure
from flexfem.plot.stage import drawing_figure
from flexfem.plot.text import SYMBOLS, assumption_rows, percent, significant
from flexfem.plot.write import write_figures
from flexfem.questions.budget import budget
from flexfem.questions.check import StageReport, check
from flexfem.questions.errors import Verification
from flexfem.questions.heat import drift
from flexfem.questions.large import large
from flexfem.questions.life import checked_amplitude, life
from flexfem.questions.modes import modes
from flexfem.questions.reach import reach
from flexfem.questions.stiffness import stiffness, summary
from flexfem.refused import BadInput
from flexfem.results import Fields, Progress, TextTable, record_parts, versions
from flexfem.study import REPORTS
from flexfem.units import COMMANDS, DIRECTIONS, STRESS, unit_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STANDARD = ("analytic", "elements", "budget", "stress", "drive")
SECTIONS = (*STANDARD, "large", "modes", "drift", "life")
Section: TypeAlias = tuple[str, Callable[..., Any], str]  # title, question, alternative text of its figure
QUESTIONS: dict[str, Section] = {
    "analytic": ("Analytic model", partial(stiffness, models="analytic"), ""),
    "elements": ("Finite elements", summary, ""),
    "budget": ("Error budget", partial(budget, plane=True), "Bars of the shares of the error, a panel a direction."),
    "drive": ("Drive", partial(reach, models="analytic"), "Poses that the drive reaches."),
    "large": ("Large displacements", large, "Tangent stiffness and errors of linear theory over the command."),
    "modes": ("Natural modes", modes, "Shapes of the modes listed in the table."),
    "drift": ("Drift by temperature", drift, "The stage on its warm frame under each change of temperature."),
    "life": ("Fatigue life", life, "The S-N curve of the material with the necks."),
}
OF_DESIGNS: dict[str, tuple[str, Callable[[Designed], Figure] | None, str]] = {  # likewise, with what draws it
    "design": ("Design", design_figure, "Outline of the stage, margins of its requirements, history of the search."),
    "requirements": ("Requirements", None, ""),
    "sensitivity": ("Sensitivity to each dimension", sensitivity_figure, "Bars of how quantities follow it."),
    "front": ("Front", front_figure, "The front by finite elements, and its designs to one scale."),
    "search": ("Search", None, ""),
}
WHERE = "Where the numbers come from"
AT = np.array([0.05, 0.05, 1e-3])  # mm, mm, rad: commands at which stress is drawn, assumed, as in cases/
KINDS = {"assumed": "assumed", "not_stated": "source not stated"}  # of assumptions, as pages say them


class PageReport(NamedTuple):
    """The page that was written: its file, its size in bytes, the sections that it has."""

    written: str
    bytes: int
    sections: list[str]
    assumed: list[str]
    not_stated: list[str]


class Drawn(NamedTuple):
    """The files that were written."""

    written: list[str]


class Subject(NamedTuple):
    """What a page is about: its title, the kind of its files in words, assumed keys, and its parts in order."""

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
) -> PageReport:
    """Write one self-contained HTML page of a stage, a study or stored results and designs.

    Parameters
    ----------
    files : path or sequence of path
        A stage file, a study file whose designs are done, or results of verify and design as JSON.
    output : Path
        Page to write, .html.
    sections : sequence of str
        Of a stage, with commas: analytic, elements, budget, stress, drive, large, modes, drift, life; or all.
    amplitude : tuple of float, optional
        Of the platform, mm, mm, rad, fully reversed, for the section life.
    folder : Path
        Of a study, where its designs are kept.
    progress : callable, optional
        Called with the name of every part before it is computed.

    Raises
    ------
    BadInput, ComputationFailed
        As the functions that answer each section; then nothing is written.
    """
    paths = [checked_path(each) for each in (files if isinstance(files, list | tuple) else [files])]
    target, kept = checked_path(output), checked_path(folder)
    if target.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"{place_of(target)}: expected a file that ends in .html")
    wanted = _checked_sections(sections, amplitude)
    check_file(target, *paths)
    subject = _subject(paths, wanted, amplitude, kept)
    require_unread(target)  # stages, studies and materials are read by now
    said = assumptions_said(subject.assumed, subject.not_stated, "of the numbers behind this page ")
    shown = []
    for name, make in subject.parts:
        if progress is not None:
            progress(name)
        shown.append(make())
    content = html_of(
        shown,
        title=subject.title,
        subtitle=f"{subject.kind}: {', '.join(map(str, paths))}",
        assumptions=f"{'; '.join(said)}. They are listed under “{WHERE}”." if said else "",
        command=command_line(paths, target, wanted, amplitude, kept),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions(),
    ).encode(errors="backslashreplace")  # names of files need not be UTF-8
    write_atomically(target, lambda file: file.write(content))
    return PageReport(str(target), len(content), [each.title for each in shown], subject.assumed, subject.not_stated)


def command_line(
    files: Sequence[Path], target: Path, sections: Sequence[str] = STANDARD, amplitude: Any = None, kept: Path = REPORTS
) -> str:
    """The command that makes a page again, for a shell."""
    words = ["flexfem", "report", *map(str, files), "-o", str(target)]
    words += ["--sections", ",".join(sections)] if tuple(sections) != STANDARD else []
    words += ["--amplitude", *map(repr, checked_amplitude(amplitude).tolist())] if amplitude is not None else []
    return shlex.join(words + (["--folder", str(kept)] if kept != REPORTS else []))


def plot_results(*results: Path, output: Path = REPORTS, displacement: bool = False) -> Drawn:
    """Draw figures and the report page from stored results, as PNG and PDF.

    Parameters
    ----------
    *results : Path
        Results of verify or design, as JSON.
    output : Path
        Folder for what is written.
    displacement : bool
        Show displacements in the commanded direction, errors across.

    Raises
    ------
    BadInput
        A file is no result, was changed since it was stored, or the folder takes no file.
    """
    check_folder(output)
    paths = [checked_path(each) for each in results]
    designs = [(path.stem, read_design(path)) for path in paths if is_design(path)]
    found = [(path, Verification.read(path)) for path in paths if not is_design(path)]
    if not found and (displacement or not designs):
        said = "--displacement with designs alone" if designs else "no file"
        raise BadInput(f"{said}, expected results of flexfem verify")
    stored = [(result, result.read_fields(path)) for path, result in found]
    return Drawn([str(path) for path in write_figures(stored, output, displacement, designs)])


def _checked_sections(sections: Sequence[str], amplitude: Any) -> tuple[str, ...]:
    """Names of sections; a text may have several with commas."""
    if isinstance(sections, str) or not isinstance(sections, Sequence):
        raise BadInput(f"sections {sections!r}, expected a list of {', '.join(SECTIONS)}")
    wanted = tuple(name.strip() for each in sections for name in str(each).split(",") if name.strip()) or STANDARD
    if wanted == ("all",):
        wanted = tuple(name for name in SECTIONS if name != "life" or amplitude is not None)
    if unknown := [name for name in wanted if name not in SECTIONS]:
        raise BadInput(f"sections {', '.join(map(repr, unknown))}, expected some of {', '.join(SECTIONS)}")
    if "life" in wanted and amplitude is None:
        raise BadInput("section life without an amplitude, expected the amplitude of the platform: mm, mm, rad")
    if "life" not in wanted and amplitude is not None:
        raise BadInput("an amplitude without section life, expected none: it is of no other section")
    if amplitude is not None:
        checked_amplitude(amplitude)
    return wanted


def _subject(files: Sequence[Path], sections: Sequence[str], amplitude: Any, folder: Path) -> Subject:
    """What the files are, recognised by their content. Raises BadInput."""
    if not files:
        raise BadInput("no file, expected a stage file, a study file, or results of flexfem verify")
    if len({os.path.realpath(path) for path in files}) < len(files):
        raise BadInput(f"{', '.join(map(place_of, files))}: expected each file once")
    stored, first = all(path.suffix.lower() == ".json" for path in files), place_of(files[0])
    if not stored and len(files) > 1:
        raise BadInput(f"{first} and {len(files) - 1} more, expected one stage or study file, or results as .json")
    kind = "results" if stored else kind_of(read_toml(files[0]).data, "stage file")
    if kind == "stage file":
        return _stage(files[0], sections, amplitude)
    if kind not in ("results", "study file"):
        raise BadInput(
            f"{first}: this is a {kind or 'TOML file'}, expected a stage file, a study file or results as .json"
        )
    if tuple(sections) != STANDARD or amplitude is not None:
        this = "a study" if kind == "study file" else kind
        raise BadInput(f"{first}: sections or an amplitude, expected none: they are of a stage, and this is {this}")
    return _stored(files) if stored else _study(files[0], folder)


def _study(path: Path, folder: Path) -> Subject:
    parts_on_disk = studies.parts_of(path, folder)
    status = studies.status_facts(parts_on_disk)
    if status["open"]:
        raise BadInput(
            f"{place_of(path)}: {status['open']} of {status['designs']} designs are open in "
            f"{place_of(status['folder'])}, expected all done by flexfem study run"
        )
    found = studies.findings_of(parts_on_disk)
    loaded = found.source.loaded
    texts = {f"stage: {key}": text for key, text in loaded.stage.sources.items()}
    texts |= {f"study: {key}": text for key, text in loaded.study.sources.items()}
    rows = [[key, said, texts.get(key) or ""] for kind, said in KINDS.items() for key in status[kind]]
    parts = study_parts(found.source, found.found, status)
    parts.append(("sources", partial(_sources, rows, "source")))
    return Subject(loaded.study.name, "Study", status["assumed"], status["not_stated"], parts)


def _stored(files: Sequence[Path]) -> Subject:
    designs = [read_design(path) for path in files if is_design(path)]
    results = [Verification.read(path) for path in files if not is_design(path)]
    parts: list[Part] = []
    for number, design in enumerate(designs, start=1):
        for name in design.sections():
            parts.append((f"{design.name}: {name}", partial(_of_design, design, name, number)))
    parts += [(one.name, partial(_curves, one, number)) for number, one in enumerate(results, start=1)]
    every: list[Any] = [*results, *designs]
    parts.append(("sources", partial(_sources, assumption_rows([(each.name, each) for each in every]), "in")))
    title = every[0].name if len(every) == 1 else "Verification" if results else "Designs"
    return Subject(title, "Stored results", *_assumptions(every), parts)


def _stage(path: Path, sections: Sequence[str], amplitude: Any) -> Subject:
    stage = load_feasible(path)
    with located(stage):  # before anything is computed
        if "life" in sections:
            required_law(stage.material)
        if "drift" in sections:
            require_expansion(stage)
    found = check(stage)
    assumed, not_stated = _assumptions([found, *([found.drive] if found.drive else [])])
    wanted = [name for name in SECTIONS if name in sections and (name != "drive" or stage.actuator)]
    parts: list[Part] = [("stage", partial(_drawing, stage, found))]
    for name in wanted:
        options = {"amplitude": amplitude} if name == "life" else {}
        parts.append((name, partial(_stress, stage) if name == "stress" else partial(_answer, name, stage, **options)))
    parts.append(("sources", partial(_sources, _provenance(stage, assumed, not_stated), "source")))
    return Subject(stage.name, "Stage", assumed, not_stated, parts)


def _assumptions(records: Sequence[Any]) -> tuple[list[str], list[str]]:
    """Keys that are assumed in any of the records, and those without a source."""
    assumed, not_stated = (list(dict.fromkeys(k for each in records for k in getattr(each, kind))) for kind in KINDS)
    return assumed, not_stated


def _provenance(stage: Stage, assumed: list[str], not_stated: list[str]) -> list[list[str]]:
    """Every value with where it comes from; those assumed first."""
    values = values_by_key(stage)
    sources = {key: text for key, text in stage.sources.items() if text and key in values}
    every = list(dict.fromkeys([*assumed, *(key for key, text in sources.items() if is_assumed(text))]))
    rows = [[key, "assumed", sources.get(key, "not a number of the file")] for key in every]
    rows += [[key, "source not stated", "no source in the file"] for key in not_stated]
    return rows + [[key, "stated", text] for key, text in sources.items() if key not in {*every, *not_stated}]


# sections


def _section(name: str, title: str, *parts: Markup) -> PageSection:
    return PageSection(name, title, Markup("").join(parts))


def _answer(name: str, stage: Stage, **options: Any) -> PageSection:
    """The tables of the result of a question, and its figure."""
    title, ask, said = QUESTIONS[name]
    found = ask(stage, **options)
    figure = [shown_figure(f"{name}-figure", lambda: figures_of(found)[""], said)] if said else []
    return _section(name, title, tables_of(found), *figure)


def _of_design(of: Designed, name: str, number: int) -> PageSection:
    """The tables of a design that are about one thing, with their figure."""
    title, draw, said = OF_DESIGNS[name]
    first = [("requirements", of.file), ("base stage", of.base), ("result", f"it {of.state}"), ("seed", str(of.seed))]
    parts = [facts(first), notes(of.warnings), notes(of.sentences(), "note")] if name == "design" else []
    parts += [shown_figure(f"design-{number}-{name}-figure", partial(draw, of), said)] if draw else []
    parts += map(table, of.sections(plain=False)[name])
    return _section(f"design-{number}-{name}", f"{title}: {of.name}", *parts)


def _curves(result: Verification, number: int) -> PageSection:
    """The curves of a case with the bands of the meshes."""
    command = unit_for(result.direction, max(map(abs, result.commanded)))
    columns = {f"commanded {SYMBOLS[DIRECTIONS.index(result.direction)]} ({command})": (result.commanded, command)}
    for label in result.curves:
        for symbol, axis in zip(SYMBOLS, DIRECTIONS, strict=True):
            values = result.at("error", curve=label, direction=axis).tolist()
            unit = unit_for(axis, max(map(abs, values)))
            columns[f"{label}: error in {symbol} ({unit})"] = (values, unit)
    shown = [[significant(value * unit.factor, 5) for value in values] for values, unit in columns.values()]
    data = table(TextTable([*columns], [*map(list, zip(*shown, strict=True))], 0))
    said = f"Error curves of the case {result.name} in three panels, X, Y and θ; the table lists their points."
    figure = shown_figure(f"curves-{number}", partial(error_figure, result), said, data)
    return _section(f"case-{number}", result.name, figure, tables_of(result))


def _sources(rows: Sequence[Sequence[str]], last: str) -> PageSection:
    """Where numbers come from: rows of a key, "assumed" or "source not stated", and its source or its records."""
    counts = [sum(row[1] == kind for row in rows) for kind in KINDS.values()]
    opening = Markup("<p><strong>{} assumed</strong>, {} no stated source.</p>").format(
        counted(counts[0], "of these numbers is", "of these numbers are"), counted(counts[1], "has", "have")
    )
    tag = Markup('<span class="tag">{}</span>')
    marked = [[row[0], row[1] if row[1] == "stated" else tag.format(row[1]), row[2]] for row in rows]
    return _section("provenance", WHERE, opening, table(TextTable(["key of the file", "kind", last], marked, 3)))


def _drawing(stage: Stage, found: StageReport) -> PageSection:
    """Which stage it is, with its dimensions, hinges and actuators."""
    drive = found.drive and found.drive._replace(provenance={})  # which have a section of their own
    listed, tables = record_parts(found._replace(drive=drive, provenance={}), plain=False)
    said = f"Drawing to scale of the stage {stage.name}: platform, three chains of two links and three notch hinges."
    figure = shown_figure("drawing", partial(drawing_figure, stage), said, table(tables[0]))
    return _section("stage", "The stage", figure, facts(listed), *map(table, tables[1:]), notes(found.warnings))


def _stress(stage: Stage) -> PageSection:
    """The stage by finite elements at 50 um in X and at 1 mrad, with its von Mises stress."""
    model, shown, necks = solve(stage), dict[str, Fields](), {}
    for axis in (0, 2):
        name, pose = f"{SYMBOLS[axis]} = {AT[axis] * COMMANDS[axis].factor:g} {COMMANDS[axis]}", AT * np.eye(3)[axis]
        shown[name] = model.fields(model.force(pose))
        necks[name] = neck_maxima(stage, model.mesh, shown[name].stress)
    rows = [
        [f"{hinge} hinge, chain {chain + 1}", *(significant(float(each[chain, k])) for each in necks.values())]
        for chain in range(3)
        for k, hinge in enumerate(HINGE_NAMES)
    ]
    head = ["neck", *(f"{name} ({STRESS})" for name in necks)]
    data = table(TextTable(head, rows, 1, "Largest von Mises stress at each neck"))
    highest = "; ".join(
        f"{name}: {significant(float(stress.max()))} {STRESS} at most, "
        f"{percent(100 * float(stress.max()) / stage.material.yield_strength)} of the yield strength"
        for name, stress in necks.items()
    )
    draw = partial(stress_figure, shown)
    figure = shown_figure("stress-figure", draw, "The deformed stage coloured by von Mises stress.", data)
    said = f"The other directions are held; the amplitudes are assumed. {highest}."
    return _section("stress", "Stress", notes([said], "note"), figure)
