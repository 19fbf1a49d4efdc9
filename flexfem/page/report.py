"""One page of a stage, a study, stored results or designs: its sections are computed, put together and written."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import Markup

from flexfem import studies
from flexfem.files.inputs import require_unread
from flexfem.files.provenance import is_assumed, values_by_key
from flexfem.files.refusals import checked_path, place_of
from flexfem.files.toml import Path as PathLike
from flexfem.files.toml import kind_of, read_toml
from flexfem.files.writing import check_file, write_atomically
from flexfem.mechanism.stage_file import counted, doubts_said
from flexfem.page.section import Page, PageSection, facts, html_of, notes, shown_figure, table, tables_of
from flexfem.plot.text import SYMBOLS, doubt_rows, percent, significant
from flexfem.questions.life import checked_amplitude
from flexfem.refused import BadInput
from flexfem.results import versions
from flexfem.studies import REPORTS
from flexfem.units import (
    COMMANDS,
    DEGREE,
    DIRECTIONS,
    LENGTH,
    MICROMETRE,
    PLANES,
    RATE,
    STRESS,
    UNITS,
    unit_for,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flexfem.mechanism.stage import Stage
    from flexfem.questions.check import StageReport
    from flexfem.questions.errors import Verification

STANDARD = ("analytic", "elements", "budget", "stress", "drive")
MORE = ("large", "modes", "drift", "life")
SECTIONS = (*STANDARD, *MORE)
OF_A_STAGE = "sections or an amplitude, expected none: they are of a stage"
AT = (0.05, 0.05, 1e-3)  # mm, mm, rad: commands at which stress is drawn, assumed, as in cases/
TAG = Markup('<span class="tag">{}</span>')
Part = tuple[str, Callable[[], PageSection | None]]  # a name, and what makes the section
Through = Callable[[Sequence[Part]], Iterable[Part]]


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
    said = doubts_said(subject.assumed, [], "of the numbers behind this page ")
    said += doubts_said([], subject.not_stated, "" if said else "of its numbers ")
    page = Page(
        title=subject.title,
        subtitle=f"{subject.kind}: {', '.join(map(str, files))}",
        sections=[section for _, make in through(subject.parts) if (section := make()) is not None],
        doubts=f"{'; '.join(said)}. They are listed under “Where the numbers come from”." if said else "",
        command=command_line(files, target, sections, amplitude, checked_path(folder)),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions(),
    )
    content = html_of(page).encode(errors="backslashreplace")  # names of files need not be UTF-8
    write_atomically(target, lambda file: file.write(content))
    names = [each.title for each in page.sections]
    return PageReport(str(target), len(content), names, [], subject.assumed, subject.not_stated)


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
        words += ["--amplitude", *(repr(value) for value in checked_amplitude(amplitude).tolist())]
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
    """What the files are, recognised by their content. Raises BadInput."""
    if not files:
        raise BadInput("no file, expected a stage file, a study file, or results of flexfem verify")
    if len({os.path.realpath(path) for path in files}) < len(files):
        raise BadInput(f"{', '.join(map(place_of, files))}: expected each file once")
    stored = all(path.suffix.lower() == ".json" for path in files)
    if not stored and len(files) > 1:
        raise BadInput(
            f"{place_of(files[0])} and {len(files) - 1} more, expected one stage or study file, or results as .json"
        )
    kind = "results" if stored else kind_of(read_toml(files[0]).data, "stage file")
    if kind not in ("results", "study file", "stage file"):
        expected = "expected a stage file, a study file or results as .json"
        raise BadInput(f"{place_of(files[0])}: this is a {kind or 'TOML file'}, {expected}")
    if kind != "stage file" and (tuple(sections) != STANDARD or amplitude is not None):
        raise BadInput(f"{place_of(files[0])}: {OF_A_STAGE}, and this is {'a study' if kind == 'study file' else kind}")
    if stored:
        return _stored(files)
    return _study(files[0], folder) if kind == "study file" else _stage(files[0], sections, amplitude)


def _study(path: Path, folder: Path) -> Subject:
    from flexfem.page.study import study_parts

    status = studies.study_status(path, folder)
    if status["open"]:
        raise BadInput(
            f"{place_of(path)}: {status['open']} of {status['designs']} designs are open in "
            f"{place_of(status['folder'])}, expected all done by flexfem study run"
        )
    found = studies.study_findings(path, folder)
    loaded = found.source.loaded
    texts = {f"stage: {key}": text for key, text in loaded.stage.sources.items()}
    texts |= {f"study: {key}": text for key, text in loaded.study.sources.items()}
    kinds = (("assumed", "assumed"), ("not_stated", "source not stated"))
    rows = [[key, said, texts.get(key) or ""] for kind, said in kinds for key in status[kind]]
    parts: list[Part] = [*study_parts(found.source, found.found, status)]
    parts.append(("sources", partial(_sources, rows, ["key of the file", "kind", "source"])))
    return Subject(loaded.study.name, "Study", status["assumed"], status["not_stated"], parts)


def _stored(files: Sequence[Path]) -> Subject:
    from flexfem.design.result import is_design, read_design
    from flexfem.page.design import design_parts
    from flexfem.questions.errors import Verification

    drawn = [path for path in files if is_design(path)]
    results = [Verification.read(path) for path in files if path not in drawn]
    designs = [read_design(path) for path in drawn]
    parts: list[Part] = []
    for number, design in enumerate(designs, start=1):
        parts += design_parts(design, number, len(designs) > 1)
    parts += [(one.name, partial(_curves, one, number)) for number, one in enumerate(results, start=1)]
    every: list[Any] = [*results, *designs]
    rows = doubt_rows([(each.name, each) for each in every])
    parts.append(("sources", partial(_sources, rows, ["key of the file", "kind", "in"])))
    found = ([key for each in every for key in getattr(each, kind)] for kind in ("assumed", "not_stated"))
    assumed, not_stated = (list(dict.fromkeys(keys)) for keys in found)
    title = every[0].name if len(every) == 1 else "Verification" if results else "Designs"
    return Subject(title, "Stored results", assumed, not_stated, parts)


def _section(name: str, title: str, *parts: Markup) -> PageSection:
    return PageSection(name, title, Markup("").join(parts))


def _curves(result: Verification, number: int) -> PageSection:
    """The curves of a case with the bands of the meshes."""
    from flexfem.plot.errors import error_figure

    command = unit_for(result.direction, max(map(abs, result.commanded)))
    columns = {f"commanded {SYMBOLS[DIRECTIONS.index(result.direction)]} ({command})": (result.commanded, command)}
    for label in result.curves:
        for symbol, axis in zip(SYMBOLS, DIRECTIONS, strict=True):
            values = result.at("error", curve=label, direction=axis).tolist()
            unit = unit_for(axis, max(map(abs, values)))
            columns[f"{label}: error in {symbol} ({unit})"] = (values, unit)
    shown = [[significant(value * unit.factor, 5) for value in values] for values, unit in columns.values()]
    data = table([*columns], [*zip(*shown, strict=True)], numbers=len(columns))
    said = f"Error curves of the case {result.name} in three panels, X, Y and θ; the table lists their points."
    figure = shown_figure(f"curves-{number}", partial(error_figure, result), said, data)
    return _section(f"case-{number}", result.name, figure, tables_of(result))


def _sources(rows: Sequence[Sequence[str]], head: Sequence[str]) -> PageSection:
    """Where numbers come from: rows of a key, its kind of doubt, and the rest."""
    counts = [sum(row[1] == kind for row in rows) for kind in ("assumed", "source not stated")]
    opening = Markup("<p><strong>{} assumed</strong>, {} no stated source.</p>").format(
        counted(counts[0], "of these numbers is", "of these numbers are"), counted(counts[1], "has", "have")
    )
    marked = [[row[0], row[1] if row[1] == "stated" else TAG.format(row[1]), *row[2:]] for row in rows]
    return _section("provenance", "Where the numbers come from", opening, table(head, marked) if rows else Markup(""))


def _stage(path: Path, sections: Sequence[str], amplitude: ArrayLike | None) -> Subject:
    from flexfem.analytic.responses import require_expansion
    from flexfem.hinges.strength import required_law
    from flexfem.mechanism.stage import load_feasible
    from flexfem.mechanism.stage_file import located
    from flexfem.questions.check import check

    stage = load_feasible(path)
    with located(stage):  # before anything is computed
        if "life" in sections:
            required_law(stage.material)
        if "drift" in sections:
            require_expansion(stage)
    found = check(stage)
    records = [found, *([found.drive] if found.drive else [])]
    found_keys = ([key for each in records for key in getattr(each, kind)] for kind in ("assumed", "not_stated"))
    assumed, not_stated = (list(dict.fromkeys(keys)) for keys in found_keys)
    wanted = [name for name in SECTIONS if name in sections and (name != "drive" or stage.actuator)]
    parts: list[Part] = [("stage", partial(_drawing, stage, found, wanted))]
    made = MADE | {"life": partial(_life, amplitude=amplitude)}
    parts += [(name, partial(made[name], stage)) for name in wanted]
    parts.append(
        ("sources", partial(_sources, _provenance(stage, assumed, not_stated), ["key of the file", "kind", "source"]))
    )
    return Subject(stage.name, "Stage", assumed, not_stated, parts)


def _provenance(stage: Stage, assumed: list[str], not_stated: list[str]) -> list[list[str]]:
    """Every value with where it comes from; those assumed first."""
    values = values_by_key(stage)
    sources = {key: text for key, text in stage.sources.items() if text and key in values}
    every = list(dict.fromkeys([*assumed, *(key for key, text in sources.items() if is_assumed(text))]))
    rows = [[key, "assumed", sources.get(key, "not a number of the file")] for key in every]
    rows += [[key, "source not stated", "no source in the file"] for key in not_stated]
    return rows + [[key, "stated", text] for key, text in sources.items() if key not in {*every, *not_stated}]


def _drawing(stage: Stage, found: StageReport, wanted: list[str]) -> PageSection:
    """Which stage it is, with its dimensions, hinges and actuators."""
    from flexfem.plot.stage import drawing_figure

    material = stage.material
    modulus = f"E {material.youngs_modulus * UNITS['gpa'].factor:g} {UNITS['gpa']}, ν {material.poissons_ratio:g}"
    listed = facts(
        [
            ("file", found.file or "none, made in Python"),
            ("hash of its content", Markup("<code>{}</code>").format(found.hash[:16])),
            ("mobility by (1)", f"{found.mobility}; chains {'alike' if found.chains_alike else 'differ'}"),
            ("modelled in", PLANES[found.model]),
            ("thickness", f"{stage.thickness:g} {LENGTH}"),
            ("material", f"{material.name}: {modulus}, yield strength {material.yield_strength:g} {STRESS}"),
            ("sections", ", ".join(wanted)),
        ]
    )
    head = ["hinge", "chain", "freedoms"]
    head += [f"{name} ({unit})" for name, unit in (*zip("xy", [LENGTH] * 2, strict=True), ("axis", DEGREE))]
    rows = [
        [each.hinge, str(each.chain), "rotation, axial" if each.prismatic else "rotation"]
        + [f"{value:z.4f}" for value in each.centre_mm]
        + [f"{each.axis_deg:.2f}", f"{each.radius_mm:g}", f"{each.neck_mm:g}"]
        for each in found.hinges
    ]
    data = table([*head, f"R ({LENGTH})", f"t ({LENGTH})"], rows, caption="The nine hinges", numbers=5)
    said = f"Drawing to scale of the stage {stage.name}: platform, three chains of two links and three notch hinges."
    figure = shown_figure("drawing", partial(drawing_figure, stage), said, data)
    return _section("stage", "The stage", figure, listed, _actuators(found), notes(found.warnings))


def _actuators(found: StageReport) -> Markup:
    if found.drive is None:
        return Markup("")
    head = ["actuator", "chains", "on, pushing", "stack", f"stroke ({MICROMETRE})", "blocking force (N)"]
    head += [f"stiffness ({RATE})", f"with contact ({RATE})", "preload (N)", "contact"]
    rows = [
        [one.name, ", ".join(map(str, one.chains)), ", ".join(one.between), one.stack or "its own"]
        + [f"{one.stroke * MICROMETRE.factor:g}", f"{one.blocking_force:.4g}"]
        + [f"{k * RATE.factor:.4g}" for k in (one.stiffness, one.stiffness_with_contact)]
        + [f"{one.preload:g}", one.contact]
        for one in found.drive.actuators
    ]
    return table(head, rows, caption="The actuators", numbers=5)


def _answered(name: str, title: str, found: Any, *figures: Markup) -> PageSection:
    """A section of the tables of a result, and its figures."""
    return _section(name, title, tables_of(found), *figures)


def _analytic(stage: Stage) -> PageSection:
    from flexfem.questions.stiffness import stiffness

    return _answered("analytic", "Analytic model", stiffness(stage, models="analytic"))


def _elements(stage: Stage) -> PageSection:
    from flexfem.questions.summary import summary

    return _answered("elements", "Finite elements", summary(stage))


def _stress(stage: Stage) -> PageSection:
    """The stage by finite elements at 50 um in X and at 1 mrad, with its von Mises stress."""
    import numpy as np

    from flexfem.models import solve
    from flexfem.plot.fields import CommandedStage, commanded_figure
    from flexfem.results import Fields

    model, shown, necks = solve(stage), [], []
    for axis in (0, 2):
        pose, unit = np.array(AT) * np.eye(3)[axis], COMMANDS[axis]
        load = model.force(pose)
        moved: Any = {"displacement": model.displacement(load), "stress": model.stress(load)}
        mesh = {name: getattr(model.mesh, name) for name in ("nodes", "triangles", "bodies")}
        shown.append(CommandedStage(f"{SYMBOLS[axis]} = {AT[axis] * unit.factor:g} {unit}", Fields(**mesh, **moved)))
        necks.append(model.neck_stress(pose))
    rows = [
        [f"{name} hinge, chain {chain + 1}", *(significant(float(each[chain, k])) for each in necks)]
        for chain in range(3)
        for k, name in enumerate(("base", "elbow", "platform"))
    ]
    head = ["neck", *(f"{each.said} ({STRESS})" for each in shown)]
    data = table(head, rows, caption="Largest von Mises stress at each neck", numbers=len(shown))
    highest = "; ".join(
        f"{each.said}: {significant(float(stress.max()))} {STRESS} at most, "
        f"{percent(100 * float(stress.max()) / stage.material.yield_strength)} of the yield strength"
        for each, stress in zip(shown, necks, strict=True)
    )
    draw = partial(commanded_figure, "", shown, stage.platform.hub_radius, ([], []))
    figure = shown_figure("stress-figure", draw, "The deformed stage coloured by von Mises stress.", data)
    said = f"The other directions are held; the amplitudes are assumed. {highest}."
    return _section("stress", "Stress", notes([said], "note"), figure)


def _budget(stage: Stage) -> PageSection:
    """The shares of the error of the paper's model."""
    from flexfem.plot.errors import budget_figure
    from flexfem.questions.budget import budget

    found = budget(stage, plane=True)
    said = "Bars of the shares of the error in the commanded direction, a panel for each direction."
    figure = shown_figure("budget-figure", partial(budget_figure, found), said, tables_of(found))
    return _section("budget", "Error budget", figure)


def _drive(stage: Stage) -> PageSection:
    """How far the actuators move the platform, and the limits of it."""
    from flexfem.plot.drive import reach_figure
    from flexfem.questions.reach import reach

    found = reach(stage, models="analytic")
    figure = shown_figure("reach-figure", partial(reach_figure, found), "Poses that the drive reaches.")
    return _answered("drive", "Drive", found, figure)


def _large(stage: Stage) -> PageSection:
    """What large displacements change."""
    from flexfem.plot.drive import large_figure
    from flexfem.questions.large import large

    found = large(stage)
    said = "Tangent stiffness and errors of linear theory over the command, a row for each direction."
    figure = shown_figure("large-figure", partial(large_figure, found), said)
    return _answered("large", "Large displacements", found, figure)


def _modes(stage: Stage) -> PageSection:
    """Natural frequencies in the plane, with their shapes."""
    from flexfem.plot.modes import modes_figure
    from flexfem.questions.modes import modes

    found = modes(stage)
    figure = shown_figure("modes-figure", partial(modes_figure, found), "Shapes of the modes listed in the table.")
    return _section("modes", "Natural modes", tables_of(found), figure)


def _drift(stage: Stage) -> PageSection:
    from flexfem.plot.fields import drift_figure
    from flexfem.questions.heat import drift

    found, said = drift(stage), "The stage on its warm frame under each change of temperature."
    figure = shown_figure("drift-figure", partial(drift_figure, found), said)
    return _answered("drift", "Drift by temperature", found, figure)


def _life(stage: Stage, amplitude: Any) -> PageSection:
    from flexfem.plot.life import life_figure
    from flexfem.questions.life import life

    found, said = life(stage, amplitude=amplitude), "The S-N curve of the material with the necks."
    return _answered("life", "Fatigue life", found, shown_figure("life-figure", partial(life_figure, found), said))


MADE: dict[str, Callable[..., PageSection]] = {
    "analytic": _analytic,
    "elements": _elements,
    "budget": _budget,
    "stress": _stress,
    "drive": _drive,
    "large": _large,
    "modes": _modes,
    "drift": _drift,
}
