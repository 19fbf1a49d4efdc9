"""Mechanisms side by side: their numbers, judged by their bands, their files and their plates."""

from __future__ import annotations

import cmath
import math
import os
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Literal, TypeAlias

import shapely

from flexfem.files.refusals import checked_path, place_of
from flexfem.files.toml import PathLike
from flexfem.importing.drawings import (
    NO_READING,
    ImportedPlate,
    Reading,
    imported,
    is_drawing,
    load,
)
from flexfem.importing.roles import Wishes
from flexfem.mechanism.layout import UNMOVED, Layout, Move
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import body_polygon, plate_mass
from flexfem.questions.comparison import Comparison, Labelled, inputs_of
from flexfem.questions.departed import compared_plate, is_other_design, registered
from flexfem.questions.drive import drive
from flexfem.questions.gravity import gravity
from flexfem.questions.heat import drift
from flexfem.questions.modes import modes
from flexfem.questions.reach import reach
from flexfem.questions.setup import Models, check_word
from flexfem.questions.side_by_side import (
    Answers,
    ComparedNumber,
    Names,
    compared_number,
    compared_numbers,
    matched_names,
    parasitic,
)
from flexfem.questions.stiffness import stiffness
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import Progress, Result
from flexfem.units import PLANES

Source: TypeAlias = Mechanism | Path
Asked: TypeAlias = Literal["summary", "stiffness", "modes", "drive", "reach", "drift", "gravity"]
QUESTIONS: dict[str, Callable[..., Any]] = {
    "stiffness": stiffness,
    "modes": modes,
    "drive": drive,
    "reach": reach,
    "drift": drift,
    "gravity": gravity,
}
SOLVED_BOTH = ("drive", "reach")  # questions without finite elements alone
# modes of a whole plate in three dimensions, of which the first ones may leave the plane
MODES_OF_WHOLE = 6
IN_PLANE = "in the plane"  # end of the labels of its other modes
MOST_FOLDERS = 8  # in the name of a file
# short names of the key results; `range.free` is the range with the others free
MAIN = {
    "stiffness": {
        "held": "stiffness, others held",
        "free": "stiffness, others free",
        "range.free": "range, others free",
    },
    "modes": {
        "frequency.1": "first frequency",
        "first_out_of_plane": "first out of plane",
    },
    "drive": {
        "motion": "drive motion",
        "force": "drive force",
        "stress": "drive stress",
    },
    "reach": {"ends": "range of the drive"},
}
# shown where a mechanism has no range at finite displacement
LINEAR = {"yield_range": "linear range at yield"}
EXPLAINED = {  # by a short name that is shown
    "drive motion": "drive motion, force, stress: at the full stroke of an actuator",
    "parasitic motion": (
        "parasitic motion: of the output across a push along x or y, per motion along it, the other "
        "directions free; the direction is that of the drive, or the softest, of the first mechanism"
    ),
    "first out of plane": (
        "first frequency: of the natural modes in the plane; first out of plane: of the others"
    ),
}
BEAMS = "rigid bodies, hinges as beams"  # the analytic model of which answers state nothing else
BY_NUMBER = "modes are compared by their number; modes of one number may have different shapes"


def compare(
    *files: Mechanism | PathLike,
    question: Asked = "summary",
    models: Models = "elements",
    resolution: int | None = None,
    solid: bool = False,
    reading: Reading = NO_READING,
    progress: Progress | None = None,
) -> Comparison:
    """Compare mechanisms side by side: their numbers, files and plates.

    Changes are per cent of the first mechanism, and are within or beyond the bands, the ± of both
    numbers together. Of several files, the first that is no drawing is the first mechanism.

    Parameters
    ----------
    *files : path or Mechanism
        Two or more mechanism files, stage files or drawings. A drawing takes thickness,
        material, ground and output from the first mechanism where they are not stated.
    question : {"summary", "stiffness", "modes", "drive", "reach", "drift", "gravity"}
        What is compared: the key results, or the answers of one command.
    models : {"both", "analytic", "elements"}
        Models that answer. The analytic model is quick and has no bands.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes.
    solid : bool
        Whole plates by finite elements in three dimensions.
    reading : Reading
        Of drawings: their units, part and so on.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Comparison
        Numbers of all mechanisms with their changes, in the units that they state.

    Raises
    ------
    BadInput
        There are less than two files, one of them cannot be read, a question does not apply to
        one, or the first is a drawing without thickness and material.
    ComputationFailed
        A mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> guide = flexfem.load("geometry/parallelogram.toml")
    >>> found = flexfem.compare(guide, guide.replace(thickness=20.0), models="analytic")
    >>> found.change("stiffness.free.x").round(1)  # per cent; wide leaves are stiffer
    array([  nan, 105.8])
    """
    check_word("question", question, Asked)
    check_word("models", models, Models)
    if len(files) < 2:
        counted = "no file" if not files else "1 file"
        raise BadInput(f"{counted}, expected two or more: mechanism files, stage files or drawings")
    notes = list[str]()
    subjects = _in_one_plane(_subjects(files, reading, notes), solid, notes)
    asked = {"models": models, "resolution": resolution, "solid": solid}
    if models == "analytic" and not all(each.layout.joints for each in subjects):
        asked["models"] = "elements"
        notes.append("a plate without hinges has finite elements alone, which answer for all")
    answers = _answers(subjects, question, asked, progress)
    names = _names(subjects, notes)
    if question == "modes":
        notes.append(BY_NUMBER)
    if asked["models"] != "elements":
        notes += _analytic_models(subjects, answers)
    numbers = _numbers(subjects, question, answers, names, models == "both")
    shown = {each.quantity for each in numbers if each.main and not each.is_zero}
    notes += [text for name, text in EXPLAINED.items() if name in shown]
    base = subjects[0].layout
    plates = [compared_plate(each.label, base, each.layout) for each in subjects[1:]]
    return Comparison(
        subjects=subjects,
        settings={"question": question, **asked},
        numbers=numbers,
        inputs=inputs_of(subjects),
        plates=plates,
        notes=notes,
        warnings=_warnings(subjects, answers),
        results=answers,
    )


def _subjects(
    files: Sequence[Mechanism | PathLike],
    reading: Reading,
    notes: list[str],
) -> list[Labelled]:
    """Load the mechanisms; the first one is no drawing, where there is such a file."""
    sources = [each if isinstance(each, Mechanism) else checked_path(each) for each in files]
    if _is_drawn(sources[0]) and not all(map(_is_drawn, sources)):
        first = next(each for each in sources if not _is_drawn(each))
        sources.remove(first)
        sources.insert(0, first)
        notes.append(f"changes are from {_name_of(first)}, the first that is no drawing")
    subjects = list[Labelled]()
    for label, source in zip(distinct_labels(sources), sources, strict=True):
        if isinstance(source, Mechanism):
            subjects.append(Labelled(label, source))
        elif is_drawing(source) and subjects:
            subjects.append(_drawn(label, source, reading, subjects[0].mechanism, notes))
        else:
            stated = reading if is_drawing(source) else NO_READING
            subjects.append(Labelled(label, load(source, stated)))
    return subjects


def _is_drawn(source: Source) -> bool:
    return isinstance(source, Path) and is_drawing(source)


def distinct_labels(sources: Sequence[Source]) -> list[str]:
    """Return short names that differ: of files without endings or folders where these suffice.

    The same file, and mechanisms of the same name, are numbered.
    """
    different = len({_identity(each) for each in sources})
    labels = list[str]()
    for folders, ending in product(range(MOST_FOLDERS), (False, True)):
        labels = [_name_of(each, folders, ending) for each in sources]
        if len({*labels}) == different:
            break
    found = list[str]()
    for number, label in enumerate(labels):
        before = labels[:number].count(label)
        found.append(f"{label} ({before + 1})" if before else label)
    return found


def _identity(source: Source) -> str:
    return source.name if isinstance(source, Mechanism) else os.path.realpath(source)


def _name_of(
    source: Source,
    folders: int = 0,
    ending: bool = False,
) -> str:
    """Return the name of a file with some of its folders, or that of a mechanism without file."""
    if isinstance(source, Mechanism):
        return source.name
    path = Path(os.path.realpath(source))
    inside = path.parts[-1 - folders : -1]
    return "/".join([*inside, path.name if ending else path.stem])


def _drawn(
    label: str,
    path: Path,
    reading: Reading,
    base: Mechanism,
    notes: list[str],
) -> Labelled:
    """Return the mechanism of a drawing in the axes of the first one, with the roles of its parts."""
    stated = reading._replace(material=reading.material or "al-7075-t6")
    if reading.thickness is None:
        stated = stated._replace(thickness=float(base.thickness))
    plate = imported(path, stated)
    move = registered(base.layout, plate.mechanism.layout)
    wishes = None
    if is_other_design(base.layout, plate.mechanism.layout, move):
        move = UNMOVED
        notes.append(f"{label}: ground and output are those recognised in the drawing")
    elif reading.wishes == Wishes():
        wishes = _wishes(base.layout)
    if move != UNMOVED or wishes is not None:
        plate = _again(path, stated, wishes, move)
    if move != UNMOVED:
        turn = math.degrees(cmath.phase(move.factor))
        flipped = ", turned over" if move.mirrored else ""
        notes.append(
            f"the drawing {label} has other axes: it was turned by {turn:.6g} degrees{flipped} and "
            f"moved by {move.shift.real:.6g}, {move.shift.imag:.6g} mm"
        )
    mechanism: Mechanism = plate.mechanism
    if not reading.material:
        mechanism = mechanism.replace(material=base.material.model_dump(exclude_none=True))
    return Labelled(label, mechanism)


def _again(
    path: Path,
    stated: Reading,
    wishes: Wishes | None,
    move: Move,
) -> ImportedPlate:
    """Return the plate of a drawing in the axes of the first mechanism, and with its roles."""
    try:
        return imported(path, stated, wishes=wishes, move=move)
    except BadInput as refused:
        raise BadInput(f"{refused}, as in the first mechanism", place_of(path)) from None


def _wishes(base: Layout) -> Wishes:
    """Return the ground and the output of a layout as points."""
    ground = list[complex]()
    for index, body in enumerate(base.bodies):
        if body.fixed:
            ground.append(_inside(body_polygon(base, index)))
        ground += [complex(body.outline[segment].at(0.5)) for segment in body.clamped]
    output = base.points[0][1]
    return Wishes(tuple(ground), _inside(body_polygon(base, output.body)), output.point)


def _inside(polygon: Any) -> complex:
    point = shapely.point_on_surface(polygon)
    return complex(point.x, point.y)


def _in_one_plane(
    subjects: list[Labelled],
    solid: bool,
    notes: list[str],
) -> list[Labelled]:
    """Return all mechanisms in plane stress where some are so, and others in three dimensions.

    A difference between both models would otherwise be one between the mechanisms.
    """
    stated = {each.mechanism.model for each in subjects}
    if solid or not {"three_dimensional", "plane_stress"} <= stated:
        if len(stated) > 1 and not solid:
            named = ", ".join(f"{each.label}: {PLANES[each.mechanism.model]}" for each in subjects)
            notes.append(f"the models of the thickness differ, and so do the numbers ({named})")
        return subjects
    found = list[Labelled]()
    changed = list[str]()
    for each in subjects:
        if each.mechanism.model == "three_dimensional":
            changed.append(each.label)
            each = each._replace(mechanism=each.mechanism.replace(model="plane_stress"))
        found.append(each)
    notes.append(
        f"all are computed in plane stress, {', '.join(changed)} too, which otherwise has three "
        "dimensions: a difference is then not one between models"
    )
    return found


def _answers(
    subjects: Sequence[Labelled],
    question: str,
    asked: dict[str, Any],
    progress: Progress | None,
) -> list[dict[str, Result]]:
    """Return the answers of every mechanism by question; equal mechanisms are asked once."""
    found = list[dict[str, Result]]()
    for number, each in enumerate(subjects):
        same = [other for other in range(number) if subjects[other].mechanism == each.mechanism]
        if same:
            found.append(found[same[0]])
            continue
        answers = dict[str, Result]()
        for name in _questions_of(each.mechanism, question):
            options = dict(asked)
            if name in SOLVED_BOTH and options["models"] == "elements":
                options["models"] = "both"
            if name == "modes" and question == "summary":
                is_whole = options["solid"] or not each.layout.joints
                options["count"] = MODES_OF_WHOLE if is_whole else 1
            answers[name] = _asked(name, each, options)
        found.append(answers)
        if progress is not None:
            progress(f"{number + 1} of {len(subjects)} mechanisms")
    return found


def _asked(
    name: str,
    subject: Labelled,
    options: Mapping[str, Any],
) -> Result:
    """Return the answer of a question about one mechanism, which a failure names."""
    try:
        found: Result = QUESTIONS[name](subject.mechanism, **options)
    except ComputationFailed as failure:
        raise ComputationFailed(f"{subject.label}: {failure}") from None
    return found


def _analytic_models(subjects: Sequence[Labelled], answers: Sequence[Answers]) -> list[str]:
    """Return a note where the analytic models of the mechanisms are not the same."""
    found = list[str]()
    for own in answers:
        stated = [result.settings.get("analytic model", BEAMS) for result in own.values()]
        found.append(str(stated[0]))
    if len({*found}) < 2:
        return []
    named = [f"{each.label}: {model}" for each, model in zip(subjects, found, strict=True)]
    return [f"the analytic models differ, and so do the numbers ({'; '.join(named)})"]


def _questions_of(mechanism: Mechanism, question: str) -> list[str]:
    """Return the questions whose answers make a summary, or the one that is asked."""
    if question != "summary":
        return [question]
    driven = any(key.startswith("actuator") for key in mechanism.values)
    if mechanism.layout.actuators:
        return ["stiffness", "modes", "drive"]
    return ["stiffness", "modes", "reach"] if driven else ["stiffness", "modes"]


def _names(subjects: Sequence[Labelled], notes: list[str]) -> list[Names]:
    """Return the names of the parts of the first mechanism by those of each one."""
    first = _parts_of(subjects[0].layout)
    found = list[Names]()
    for each in subjects:
        names = dict[str, dict[str, str]]()
        for axis, own in _parts_of(each.layout).items():
            names[axis], said = matched_names(axis, first[axis], own)
            if axis != "body":
                notes += [f"{each.label}: {text}" for text in said]
        found.append(names)
    return found


def _add_first_mode(names: Sequence[Names], answers: Sequence[Answers]) -> list[Names]:
    """Return names of parts, and of the first mode in the plane, which is then mode 1 in all."""
    found = list[Names]()
    for each, own in zip(names, answers, strict=True):
        modes_in_plane = [name for name in own["modes"].axes["mode"] if name.endswith(IN_PLANE)]
        found.append({**each, "mode": dict.fromkeys(modes_in_plane[:1], "1")})
    return found


def _parts_of(layout: Layout) -> dict[str, list[str]]:
    return {
        "actuator": [actuator.name for actuator in layout.actuators],
        "point": [name for name, _ in layout.points],
        "body": [body.name for body in layout.bodies if not body.fixed],
    }


def _numbers(
    subjects: Sequence[Labelled],
    question: str,
    answers: Sequence[Answers],
    names: Sequence[Names],
    every_model: bool,
) -> list[ComparedNumber]:
    """Return the compared numbers; those of a summary with mass and parasitic motion."""
    if question != "summary":
        return compared_numbers(answers, names, {}, every_model)
    names = _add_first_mode(names, answers)
    main = dict(MAIN)
    if not all("range" in each["stiffness"].values for each in answers):
        main["stiffness"] = MAIN["stiffness"] | LINEAR
    found = compared_numbers(answers, names, main, every_model)
    grams = [_grams(each, own) for each, own in zip(subjects, answers, strict=True)]
    mass = compared_number(
        "mass",
        ("mass", ""),
        "g",
        [(value, math.nan) for value in grams],
    )
    details = [each for each in found if not each.main]
    return [mass, *(each for each in found if each.main), *parasitic(answers), *details]


def _grams(subject: Labelled, answers: Answers) -> float:
    """Return the mass that moves or is fixed, as its modes have it, where they state one."""
    vibrating = answers["modes"]
    if "mass" in vibrating.values:
        return 1e3 * float(vibrating.at("mass"))
    return 1e6 * plate_mass(subject.layout)


def _warnings(subjects: Sequence[Labelled], answers: Sequence[Answers]) -> list[str]:
    """Return the warnings of all answers, each with the mechanisms that it is about."""
    about = dict[str, list[str]]()
    for each, found in zip(subjects, answers, strict=True):
        for text in dict.fromkeys(text for result in found.values() for text in result.warnings):
            about.setdefault(text, []).append(each.label)
    return [f"{', '.join(labels)}: {text}" for text, labels in about.items()]
