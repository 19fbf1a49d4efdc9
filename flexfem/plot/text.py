"""Numbers as people read them, and what the verifications found as a page of text; no matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexfem.files.writing import markdown_table
from flexfem.plot.driven_text import COMMANDED, EXTRUDED, METHOD, OF_STAGE
from flexfem.units import FORCES, LENGTH, STIFFNESSES, STRESS, Unit, unit_for
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.result import CurveModels, Result

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ROUND_DOWN = 1e-9  # a limit that is round but for round-off counts as round
SPACE = "\N{NO-BREAK SPACE}"


def significant(value: float, digits: int = 4) -> str:
    """The number with so many significant digits, in plain decimals where they are short, else with a power of ten."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= power < max(digits, 6):
        return f"{value:.{max(digits - 1 - power, 0)}f}".replace("-", "\N{MINUS SIGN}")
    return scientific(value, digits)


def scientific(value: float, digits: int = 1) -> str:
    """The number as 3×10⁻¹⁴."""
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return mantissa.replace("-", "\N{MINUS SIGN}") + "×10" + str(int(power)).translate(SUPERSCRIPTS)


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
    number = f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
    return f"{number}{SPACE}±{SPACE}{band:.{digits}f}{SPACE}%"


def round_factor(limit: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `limit` (positive)."""
    power = 10.0 ** math.floor(math.log10(limit))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= limit * (1 + ROUND_DOWN))


def markdown_report(results: Sequence[Result]) -> str:
    """A page in Markdown: error percentages, forces, stiffness, meshes, versions, warnings and numbers in doubt.

    Parameters
    ----------
    results : stored verifications, in the order in which they are to appear.
    """
    forced = [each for each in results if each.drive == "force"]
    joints = [each for each in results if each.drive != "force"]
    parts = ["# Verification: analytic stage against finite elements", _opening(results)]
    parts += ["## Errors at the largest command", _errors(results), _normalisation(results)]
    parts += ["## Uncertainty of the meshes", UNCERTAINTY_NOTE, _uncertainty(results)]
    parts += ["## Forces of the analytic model at the largest command", _forces(forced)] if forced else []
    parts += ["## Rotations and strokes imposed at the largest command", _imposed(joints)] if joints else []
    parts += ["## Stiffness of the platform", STIFFNESS_NOTE, _stiffness(results)]
    parts += ["## Meshes", _meshes(results), "## Versions", _versions(results)]
    parts += ["## Warnings", _warnings(results)] if any(result.warnings for result in results) else []
    parts += ["## Assumed numbers, and numbers without a source", _doubts(results)]
    return "\n\n".join(parts) + "\n"


UNCERTAINTY_NOTE = (
    "Half-width, in percentage points, of the band about each of the errors above that holds it for ever finer meshes, "
    "by Richardson extrapolation from three meshes; across the command from the error of the whole compliance matrix, "
    "as one number may agree on two meshes by chance. In brackets how the three meshes behave."
)
STIFFNESS_NOTE = (
    "Diagonal of the analytic stiffness, and of the inverse of the finite-element compliance. The difference is the "
    "analytic one relative to the finite elements."
)


def doubt_note(assumed: Sequence[str], not_stated: Sequence[str] = ()) -> str:
    """What figures and pages must say about keys that are assumed or have no source: nothing when there are none.

    Keys of a case file begin with `case: `; alone they leave the dimensions of the stage undoubted.
    """
    found = [f"assumed {_what(assumed)}"] if assumed else []
    return "; ".join(found + ([f"{_what(not_stated)} without a source"] if not_stated else []))


def _what(keys: Sequence[str]) -> str:
    return "commands" if all(key.startswith("case: ") for key in keys) else "dimensions"


def _opening(results: Sequence[Result]) -> str:
    note = doubt_note(*([key for each in results for key in getattr(each, kind)] for kind in ("assumed", "not_stated")))
    warning = f"**{note}**: these numbers are listed at the end."
    exact = (
        ", in nonlinear cases by its exact equilibrium,"
        if any(each.analysis == "nonlinear" for each in results)
        else ""
    )
    text = " ".join(METHOD[kind] for kind in METHOD if any(each.drive == kind for each in results)).format(exact=exact)
    text += " The error is the finite-element displacement minus the commanded one."
    text += f" {EXTRUDED}" if any(each.elements == "three_dimensional" for each in results) else ""
    return f"{text}\n\n{warning}" if note else text


def _errors(results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        for label, error in result.error_percent.items():
            bands = result.uncertainty[label]
            cells = [banded(getattr(error, key), bands[key].band) for key in DIRECTIONS]
            rows.append([result.case, _command(result), label, *cells])
    return _numbered(["case", "command", "curve", "X", "Y", "θ"], rows, 3)


def _command(result: Result) -> str:
    largest = max(result.commanded)
    unit = unit_for(result.direction, largest)
    name = {"x": "X", "y": "Y", "theta": "θ"}[result.direction]
    return f"{name} = {largest * unit.factor:.6g} {unit.name}{COMMANDED[result.drive]}{OF_STAGE[result.elements]}"


def _normalisation(results: Sequence[Result]) -> str:
    levers = sorted({model.lever for result in results for model in result.models.values()})
    l3 = ", ".join(f"{lever:g} {LENGTH}" for lever in levers)
    return (
        "The commanded direction is relative to the command. In the cross directions a translation is relative to the "
        "commanded translation, a rotation is first multiplied by l₃ "
        f"({l3}), and for a commanded rotation the command is multiplied by l₃. Percentages below 10⁻⁷ are round-off."
    )


def _uncertainty(results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        for label, found in result.uncertainty.items():
            layers = result.models[label].band_layers
            part = {key: f"; layers {significant(getattr(layers, key), 2)}" if layers else "" for key in DIRECTIONS}
            bands = [f"± {significant(found[k].band, 2)} ({found[k].verdict}{part[k]})" for k in DIRECTIONS]
            rows.append([result.case, label, ", ".join(map(str, found["x"].resolutions)), *bands])
    return _numbered(["case", "curve", "triangles across a neck", "X", "Y", "θ"], rows, 3)


def _forces(results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        for label, model in result.models.items():
            force = model.force[int(np.argmax(result.commanded))]
            tiny = 1e-9 * max(abs(value) / scale for value, scale in zip(force, _scales(model), strict=True))
            cells = [
                _force(value, tiny * scale, unit)
                for value, scale, unit in zip(force, _scales(model), FORCES, strict=True)
            ]
            stress = significant(float(np.max(model.neck_stress)), 3)
            rows.append([result.case, label, *cells, f"{stress} {STRESS}"])
    head = ["case", "curve", "F_x", "F_y", "M", "largest stress at the necks (finite elements)"]
    return _numbered(head, rows, 4)


def _imposed(results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        last = int(np.argmax(result.commanded))
        for label, model in result.models.items():
            stress = significant(float(np.max(model.neck_stress)), 3)
            said = "; ".join(f"{name}: {joint_value(result, model, last, k)}" for k, name in enumerate(model.joints))
            rows.append([result.case, label, said, f"{stress} {STRESS}"])
    return _numbered(["case", "curve", "imposed", "largest stress at the necks (finite elements)"], rows, 1)


def joint_value(result: Result, model: CurveModels, point: int, joint: int) -> str:
    """A rotation or stroke that the finite elements were given, with its unit; one that is round-off is 0."""
    values = model.imposed[point]
    unit = unit_for("theta" if result.drive == "joints" else "x", max(map(abs, values)))
    tiny = abs(values[joint]) <= 1e-9 * max(map(abs, values))
    return "0" if tiny else f"{significant(values[joint] * unit.factor)} {unit.name}"


def _scales(model: CurveModels) -> tuple[float, float, float]:
    return (1.0, 1.0, model.lever)


def _force(value: float, round_off: float, unit: Unit) -> str:
    return "0" if abs(value) <= round_off else f"{significant(value)} {unit}"


def _stiffness(results: Sequence[Result]) -> str:
    rows: list[list[str]] = []
    for result in results:
        for label, model in result.models.items():
            elements = np.diag(np.linalg.inv(np.array(model.compliance)))
            for k, (name, unit) in enumerate(zip(("K_xx", "K_yy", "K_θθ"), STIFFNESSES, strict=True)):
                analytic = model.stiffness[k][k]
                difference = percent(100.0 * (analytic / float(elements[k]) - 1.0))
                formula = model.formula if model.formula_in_range else f"{model.formula}, outside its range"
                formula += ", elastic links" if model.links else ""
                formula += "" if model.plane == "plane_stress" else f", {model.plane.replace('_', ' ')}"
                row = [model.stage, label, f"{model.mobility}", formula, f"{name} ({unit})"]
                row += [significant(analytic, 5), significant(float(elements[k]), 5), difference]
                if row not in rows:
                    rows.append(row)
    head = ["stage", "curve", "mobility", "hinge formula", "stiffness", "analytic", "finite elements", "difference"]
    return _numbered(head, rows, 3)


def _meshes(results: Sequence[Result]) -> str:
    rows: list[list[str]] = []
    for result in results:
        for model in result.models.values():
            across = f"{model.resolution}{f', {model.layers} layers' if model.layers else ''}"
            row = [model.stage, model.hash[:12], across, f"{model.triangles}", f"{model.unknowns}"]
            if row not in rows:
                rows.append(row)
    return _numbered(["stage", "hash", "triangles across a neck", "triangles", "unknowns"], rows, 3)


def _versions(results: Sequence[Result]) -> str:
    rows = []
    for result in results:
        versions = ", ".join(f"{name} {version}" for name, version in result.versions.items())
        rows.append([result.case, result.written, f"{result.seconds:g} s", versions])
    return _numbered(["case", "computed (UTC)", "time", "versions"], rows, 0)


def _doubts(results: Sequence[Result]) -> str:
    sources: dict[tuple[str, str], list[str]] = {}
    for result in results:
        for said, keys in (("assumed", result.assumed), ("source not stated", result.not_stated)):
            for key in keys:
                sources.setdefault((key, said), []).append(result.case)
    if not sources:
        return "None: every number has a source."
    return "\n".join(f"- `{key}`: {said} ({', '.join(cases)})" for (key, said), cases in sorted(sources.items()))


def _warnings(results: Sequence[Result]) -> str:
    return "\n".join(f"- {result.case}: {text}" for result in results for text in result.warnings)


def _numbered(head: list[str], rows: list[list[str]], numbers: int) -> str:
    """A table whose last so many columns are numbers."""
    return markdown_table(head, rows, "l" * (len(head) - numbers) + "r" * numbers)
