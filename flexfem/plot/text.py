"""Numbers as people read them, and the tables of stored verifications; no matplotlib."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from flexfem.files.writing import markdown_table
from flexfem.results import TextTable
from flexfem.units import FORCES, LENGTH, STIFFNESSES, STRESS, unit_for
from flexfem.verify.case import DIRECTIONS, Drive, Elements
from flexfem.verify.result import Result

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ROUND_DOWN = 1e-9  # a limit that is round but for round-off counts as round
SPACE = "\N{NO-BREAK SPACE}"
SYMBOLS = ("X", "Y", "θ")
OF_STAGE: dict[Elements, str] = {"fe": "", "three_dimensional": ", in three dimensions"}
BANDS: dict[Elements, str] = {"fe": "mesh band", "three_dimensional": "band of mesh and layers"}
SHOWN_OF_SOLID = "Displacement of the mid-plane; stress: the highest through the thickness."
EXTRUDED = (
    "In three dimensions the stage is extruded: wedges of 18 nodes in layers, both faces free. Bands are then of the "
    "mesh in the plane and of the layers, whose share is the change from fewer to more of them times 1.25."
)
COMMANDED: dict[Drive, str] = {"force": "", "joints": ", joints imposed", "strokes": ", strokes commanded"}
BRIEF: dict[Drive, str] = {
    "force": "force by (18)",
    "joints": "joints imposed by (29)",
    "strokes": "strokes commanded by (29)",
}
METHOD: dict[Drive, str] = {
    "force": (
        "The force that the analytic model predicts for a platform displacement by (18){exact} is applied to the "
        "finite-element stage."
    ),
    "joints": (
        "Where joints are imposed, the hinges of the finite-element stage are given the rotations that the model "
        "computes for the displacement by (29) and (30), those of the base with mobility three, else of base and "
        "elbow, and no force is on the platform. A hinge turns by the mean rotation of the sections directly beyond "
        "its notch less that of those directly before."
    ),
    "strokes": (
        "Where strokes are commanded, the stacks of the finite-element stage are given the strokes that the model "
        "computes for the displacement by least energy, and no force is on the platform."
    ),
}


def significant(value: float, digits: int = 4) -> str:
    """The number with so many significant digits, in plain decimals where they are short, else with a power of ten."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= power < max(digits, 6):
        return minus(f"{value:.{max(digits - 1 - power, 0)}f}")
    return scientific(value, digits)


def scientific(value: float, digits: int = 1) -> str:
    """The number as 3×10⁻¹⁴."""
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return minus(mantissa) + "×10" + str(int(power)).translate(SUPERSCRIPTS)


def percent(value: float) -> str:
    """A percentage as one reads it: 14.07 %, 0.123 %, and one digit where it is round-off: 3×10⁻¹⁴ %."""
    if abs(value) < 1e-6:
        return scientific(value) + SPACE + "%"
    return significant(value, 4 if abs(value) >= 1 else 3) + SPACE + "%"


def banded(value: float, band: float) -> str:
    """A percentage with its band, both to the band's second digit: 14.071 ± 0.015 %; round-off as `percent` has it."""
    if abs(value) < 1e-6 or band <= 0:
        return percent(value)
    digits = min(max(1 - math.floor(math.log10(band)), 0), 9)
    return f"{minus(f'{value:.{digits}f}')}{SPACE}±{SPACE}{band:.{digits}f}{SPACE}%"


def minus(text: str) -> str:
    """The text with minus signs for its hyphens."""
    return text.replace("-", "\N{MINUS SIGN}")


def round_factor(limit: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `limit` (positive)."""
    power = 10.0 ** math.floor(math.log10(limit))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= limit * (1 + ROUND_DOWN))


def doubt_note(assumed: Sequence[str], not_stated: Sequence[str] = ()) -> str:
    """What figures and pages must say about keys that are assumed or have no source: nothing when there are none.

    Keys of a case file begin with `case: `; alone they leave the dimensions of the stage undoubted.
    """
    found = [f"assumed {_what(assumed)}"] if assumed else []
    return "; ".join(found + ([f"{_what(not_stated)} without a source"] if not_stated else []))


def _what(keys: Sequence[str]) -> str:
    return "commands" if all(key.startswith("case: ") for key in keys) else "dimensions"


def markdown_report(results: Sequence[Result]) -> str:
    """A page in Markdown: errors, forces, stiffness, meshes, versions, warnings and numbers in doubt of verifications.

    Parameters
    ----------
    results : list of Result
        Stored verifications, in the order in which they are to appear.
    """
    parts = ["# Verification: analytic stage against finite elements", _opening(results)]
    for each in verification_tables(results):
        align = "l" * each.names + "r" * (len(each.head) - each.names)
        shown = markdown_table(each.head, each.rows, align) if each.rows else "None: every number has a source."
        parts += [f"## {each.caption}", note_on(each, results), shown]
    warnings = [f"- {result.case}: {text}" for result in results for text in result.warnings]
    parts += ["## Warnings", "\n".join(warnings)] if warnings else []
    return "\n\n".join(part for part in parts if part) + "\n"


def verification_tables(results: Sequence[Result]) -> list[TextTable]:
    """What verifications found, as tables for Markdown and pages; the last is of numbers in doubt and may be empty."""
    forced = [each for each in results if each.drive == "force"]
    imposed = [each for each in results if each.drive != "force"]
    tables = [
        TextTable(ERRORS, list(_errors(results)), 3, "Errors at the largest command"),
        TextTable(UNCERTAIN, list(_uncertainty(results)), 3, "Uncertainty of the meshes"),
        TextTable(FORCED, list(_forces(forced)), 2, "Forces of the analytic model at the largest command"),
        TextTable(IMPOSED, list(_imposed(imposed)), 3, "Rotations and strokes imposed at the largest command"),
        TextTable(STIFF, _once(_stiffness(results)), 5, "Stiffness of the platform"),
        TextTable(MESHES, _once(_meshes(results)), 2, "Meshes"),
        TextTable(["case", "computed (UTC)", "time", "versions"], list(_versions(results)), 4, "Versions"),
    ]
    doubts = doubt_rows([(each.case, each) for each in results])
    last = TextTable(["key of the file", "kind", "in"], doubts, 3, "Assumed numbers, and numbers without a source")
    return [*(each for each in tables if each.rows), last]


def note_on(table: TextTable, results: Sequence[Result]) -> str:
    """What is to be said of a table of verifications; "" for nothing."""
    levers = ", ".join(f"{lever:g} {LENGTH}" for lever in sorted({m.lever for r in results for m in r.models.values()}))
    notes = {"Uncertainty of the meshes": UNCERTAINTY, "Stiffness of the platform": STIFFNESS_NOTE}
    return (notes | {"Errors at the largest command": NORMALISATION.format(levers)}).get(table.caption, "")


NORMALISATION = (
    "The commanded direction is relative to the command. In the cross directions a translation is relative to the "
    "commanded translation, a rotation is first multiplied by l₃ ({}), and for a commanded rotation the command is "
    "multiplied by l₃. Percentages below 10⁻⁷ are round-off."
)
UNCERTAINTY = (
    "Half-width, in percentage points, of the band about each of the errors above that holds it for ever finer meshes, "
    "by Richardson extrapolation from three meshes; across the command from the error of the whole compliance matrix, "
    "as one number may agree on two meshes by chance. In brackets how the three meshes behave."
)
STIFFNESS_NOTE = (
    "Diagonal of the analytic stiffness, and of the inverse of the finite-element compliance. The difference is the "
    "analytic one relative to the finite elements."
)
ERRORS = ["case", "command", "curve", *SYMBOLS]
UNCERTAIN = ["case", "curve", "triangles across a neck", *SYMBOLS]
FORCED = ["case", "curve", "F_x", "F_y", "M", "largest stress at the necks (finite elements)"]
IMPOSED = ["case", "curve", "imposed", "largest stress at the necks (finite elements)"]
STIFF = ["stage", "curve", "mobility", "hinge formula", "stiffness", "analytic", "finite elements", "difference"]
MESHES = ["stage", "hash", "triangles across a neck", "triangles", "unknowns"]


def _opening(results: Sequence[Result]) -> str:
    note = doubt_note(*([key for each in results for key in getattr(each, kind)] for kind in ("assumed", "not_stated")))
    nonlinear = any(each.analysis == "nonlinear" for each in results)
    exact = ", in nonlinear cases by its exact equilibrium," if nonlinear else ""
    drives = {each.drive for each in results}
    text = " ".join(said for drive, said in METHOD.items() if drive in drives).format(exact=exact)
    text += " The error is the finite-element displacement minus the commanded one."
    text += f" {EXTRUDED}" if any(each.elements == "three_dimensional" for each in results) else ""
    return f"{text}\n\n**{note}**: these numbers are listed at the end." if note else text


def _once(rows: Iterator[list[str]]) -> list[list[str]]:
    return [list(row) for row in dict.fromkeys(map(tuple, rows))]


def _errors(results: Sequence[Result]) -> Iterator[list[str]]:
    for result in results:
        for label, error in result.error_percent.items():
            cells = [banded(getattr(error, key), result.uncertainty[label][key].band) for key in DIRECTIONS]
            yield [result.case, command_text(result), label, *cells]


def command_text(result: Result) -> str:
    """The largest command, and what the finite elements are given."""
    largest = max(result.commanded)
    unit, symbol = unit_for(result.direction, largest), SYMBOLS[DIRECTIONS.index(result.direction)]
    return f"{symbol} = {largest * unit.factor:.6g} {unit}{COMMANDED[result.drive]}{OF_STAGE[result.elements]}"


def _uncertainty(results: Sequence[Result]) -> Iterator[list[str]]:
    for result in results:
        for label, found in result.uncertainty.items():
            layers = result.models[label].band_layers
            part = {key: f"; layers {significant(getattr(layers, key), 2)}" if layers else "" for key in DIRECTIONS}
            bands = [f"± {significant(found[k].band, 2)} ({found[k].verdict}{part[k]})" for k in DIRECTIONS]
            yield [result.case, label, ", ".join(map(str, found["x"].resolutions)), *bands]


def _forces(results: Sequence[Result]) -> Iterator[list[str]]:
    for result in results:
        for label, model in result.models.items():
            force = np.array(model.force[int(np.argmax(result.commanded))])
            size = np.abs(force) / [1.0, 1.0, model.lever]
            shown = np.where(size > 1e-9 * size.max(), force, 0.0).tolist()
            cells = [
                f"{significant(value)} {unit}" if value else "0" for value, unit in zip(shown, FORCES, strict=True)
            ]
            yield [result.case, label, *cells, f"{significant(float(np.max(model.neck_stress)), 3)} {STRESS}"]


def _imposed(results: Sequence[Result]) -> Iterator[list[str]]:
    for result in results:
        for label, model in result.models.items():
            values = model.imposed[int(np.argmax(result.commanded))]
            largest = max(map(abs, values))
            unit = unit_for("theta" if result.drive == "joints" else "x", largest)
            cells = [f"{significant(v * unit.factor)} {unit}" if abs(v) > 1e-9 * largest else "0" for v in values]
            said = "; ".join(f"{name}: {cell}" for name, cell in zip(model.joints, cells, strict=True))
            yield [result.case, label, said, f"{significant(float(np.max(model.neck_stress)), 3)} {STRESS}"]


def _stiffness(results: Sequence[Result]) -> Iterator[list[str]]:
    for result in results:
        for label, model in result.models.items():
            elements = np.diag(np.linalg.inv(np.array(model.compliance))).tolist()
            formula = model.formula if model.formula_in_range else f"{model.formula}, outside its range"
            formula += ", elastic links" if model.links else ""
            formula += "" if model.plane == "plane_stress" else f", {model.plane.replace('_', ' ')}"
            for k, (name, unit) in enumerate(zip(("K_xx", "K_yy", "K_θθ"), STIFFNESSES, strict=True)):
                analytic = model.stiffness[k][k]
                numbers = [significant(analytic, 5), significant(elements[k], 5)]
                difference = percent(100.0 * (analytic / elements[k] - 1.0))
                yield [model.stage, label, f"{model.mobility}", formula, f"{name} ({unit})", *numbers, difference]


def _meshes(results: Sequence[Result]) -> Iterator[list[str]]:
    for model in (model for result in results for model in result.models.values()):
        across = f"{model.resolution}{f', {model.layers} layers' if model.layers else ''}"
        yield [model.stage, model.hash[:12], across, f"{model.triangles}", f"{model.unknowns}"]


def _versions(results: Sequence[Result]) -> Iterator[list[str]]:
    for result in results:
        versions = ", ".join(f"{name} {version}" for name, version in result.versions.items())
        yield [result.case, result.written, f"{result.seconds:g} s", versions]


def doubt_rows(named: Sequence[tuple[str, object]]) -> list[list[str]]:
    """Keys of numbers in doubt with their kind and the names of the records that list them."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, record in named:
        for kind, attribute in (("assumed", "assumed"), ("source not stated", "not_stated")):
            for key in getattr(record, attribute):
                found.setdefault((key, kind), []).append(name)
    return [[key, kind, ", ".join(names)] for (key, kind), names in sorted(found.items())]
