"""What a page says of stored verifications: curves with bands, percentages, provenance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.mechanism.stage_file import counted
from flexfem.page.drawn import shown_figure
from flexfem.page.section import Content, PageSection, notes, table
from flexfem.plot.curves import driven_by, error_figure
from flexfem.plot.text import banded, significant
from flexfem.plot.told import error_spots
from flexfem.synthesis.result import Designed
from flexfem.units import LENGTH, STRESS, unit_for
from flexfem.verify.case import DIRECTIONS

if TYPE_CHECKING:
    from flexfem.verify.result import Result

SYMBOLS = {"x": "X", "y": "Y", "theta": "θ"}
TAG = Markup('<span class="tag">{}</span>')


def errors_section(results: Sequence[Result]) -> PageSection:
    """Error percentages of all curves, and how they were come by."""
    rows = []
    for result in results:
        for label, error in result.error_percent.items():
            bands = result.uncertainty[label]
            cells = [banded(getattr(error, axis), bands[axis].band) for axis in DIRECTIONS]
            rows.append([result.case, commanded(result), driven_by(result), label, *cells])
    head = ["case", "command", "the metal is given", "curve", *SYMBOLS.values()]
    said = Markup(
        "<p>Finite-element displacement minus the commanded one, at the largest command, in per cent of it "
        "(rotations times l<sub>3</sub>); ± is the band of the meshes.</p>"
    )
    parts = said + table(head, rows, numbers=3, caption="Errors at the largest command")
    warnings = [f"{result.case}: {text}" for result in results for text in result.warnings]
    return PageSection("errors", "Errors", parts + notes(warnings))


def commanded(result: Result) -> str:
    """The largest command in words."""
    largest = max(result.commanded)
    unit = unit_for(result.direction, largest)
    return f"{SYMBOLS[result.direction]} = {largest * unit.factor:.6g} {unit}"


def curves_section(result: Result, number: int) -> PageSection:
    """The curves of a case with the bands of the meshes."""
    command = unit_for(result.direction, max(map(abs, result.commanded)))
    heads, columns = (
        [f"commanded {SYMBOLS[result.direction]} ({command})"],
        [[v * command.factor for v in result.commanded]],
    )
    for label, series in result.curves.items():
        for axis in DIRECTIONS:
            values = getattr(series, axis)
            unit = unit_for(axis, max(map(abs, values)))
            heads.append(f"{label}: error in {SYMBOLS[axis]} ({unit})")
            columns.append([value * unit.factor for value in values])
    rows = [[significant(value, 5) for value in row] for row in zip(*columns, strict=True)]
    data = table(heads, rows, numbers=len(heads) - 1)
    said = "; ".join(
        f"{label}: "
        + ", ".join(f"{SYMBOLS[a]} {banded(getattr(error, a), result.uncertainty[label][a].band)}" for a in DIRECTIONS)
        for label, error in result.error_percent.items()
    )
    figure = shown_figure(
        f"curves-{number}",
        lambda: error_figure(result),
        f"Error curves of the case {result.name} in three panels, X, Y and θ. At the largest command: {said}.",
        lambda figure: error_spots(figure, result),
        data,
    )
    return PageSection(f"case-{number}", result.name, figure)


def models_section(results: Sequence[Result]) -> PageSection:
    """The two models behind every curve: stage, formula, mesh, stress."""
    rows = []
    for result in results:
        for label, model in result.models.items():
            formula = f"{model.formula}{', elastic links' if model.links else ''}"
            formula += "" if model.formula_in_range else ", outside its range"
            stress = significant(max(value for row in model.neck_stress for value in row), 4)
            row = [label, result.case, model.stage, model.hash[:12], str(model.mobility), formula]
            rows.append([*row, f"{model.lever:g}", str(model.resolution), f"{model.unknowns:,}", stress])
    head = [
        "curve",
        "case",
        "stage",
        "hash",
        "mobility",
        "hinge formula",
        f"l3 ({LENGTH})",
        "triangles across a neck",
        "unknowns",
    ]
    head.append(f"largest neck stress ({STRESS})")
    return PageSection("models", "Models and meshes", table(head, rows, numbers=4))


def doubts_section(results: Sequence[Result], others: Sequence[Designed] = ()) -> PageSection:
    """Numbers that are assumed or have no source, and versions of what computed the results."""
    named: list[tuple[str, Result | Designed]] = [
        *((each.case, each) for each in results),
        *((each.name, each) for each in others),
    ]
    kinds: dict[tuple[str, str], list[str]] = {}
    for name, each in named:
        for kind, keys in (("assumed", each.assumed), ("not stated", each.not_stated)):
            for key in keys:
                kinds.setdefault((key, kind), []).append(name)
    rows: list[list[Content]] = [
        [key, TAG.format(kind), ", ".join(where)] for (key, kind), where in sorted(kinds.items())
    ]
    assumed = sum(kind == "assumed" for _, kind in kinds)
    parts = Markup("<p><strong>{} assumed</strong>, {} no stated source.</p>").format(
        counted(assumed, "number is", "numbers are"), counted(len(kinds) - assumed, "has", "have")
    )
    parts += table(["key of the file", "kind", "in"], rows) if rows else Markup("")
    made = [[name, *_computed(each), _versions(each.versions)] for name, each in named]
    parts += Markup("<h3>Computed with</h3>") + table(["of", "computed (UTC)", "time", "versions"], made)
    return PageSection("provenance", "Where the numbers come from", parts)


def _computed(of: Result | Designed) -> tuple[str, str]:
    """When a result was computed and how long that took; of designs neither is stored."""
    return ("", "") if isinstance(of, Designed) else (of.written, f"{of.seconds:g} s")


def _versions(of: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in of.items())
