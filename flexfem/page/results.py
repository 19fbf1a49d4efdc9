"""What a page says of stored verifications: curves with bands, percentages, provenance."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from flexfem.mechanism.stage_file import counted
from flexfem.page.drawn import shown_figure
from flexfem.page.section import Content, PageSection, table
from flexfem.plot.curves import error_figure, error_text
from flexfem.plot.text import significant
from flexfem.plot.told import error_spots
from flexfem.synthesis.result import Designed
from flexfem.units import DIRECTIONS, unit_for

if TYPE_CHECKING:
    from flexfem.questions.errors import Verification

SYMBOLS = {"x": "X", "y": "Y", "theta": "θ"}
TAG = Markup('<span class="tag">{}</span>')


def curves_section(result: Verification, number: int) -> PageSection:
    """The curves of a case with the bands of the meshes, and its numbers."""
    command = unit_for(result.direction, float(np.max(np.abs(result.commanded))))
    heads = [f"commanded {SYMBOLS[result.direction]} ({command})"]
    columns = [result.commanded * command.factor]
    for label, axis in product(result.curves, DIRECTIONS):
        values = result.at("error", curve=label, direction=axis)
        unit = unit_for(axis, float(np.max(np.abs(values))))
        heads.append(f"{label}: error in {SYMBOLS[axis]} ({unit})")
        columns.append(values * unit.factor)
    rows = [[significant(value, 5) for value in row] for row in zip(*columns, strict=True)]
    said = "; ".join(
        f"{label}: {', '.join(f'{SYMBOLS[axis]} {error_text(result, label, axis)}' for axis in DIRECTIONS)}"
        for label in result.curves
    )
    figure = shown_figure(
        f"curves-{number}",
        lambda: error_figure(result),
        f"Error curves of the case {result.name} in three panels, X, Y and θ. At the largest command: {said}.",
        lambda figure: error_spots(figure, result),
        table(heads, rows, numbers=len(heads) - 1),
    )
    return PageSection(f"case-{number}", result.name, figure + Markup(result.to_html()))


def doubts_section(results: Sequence[Verification], others: Sequence[Designed] = ()) -> PageSection:
    """Numbers that are assumed or have no source, and versions of what computed the results."""
    named: list[tuple[str, Verification | Designed]] = [
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
    made = [[name, _versions(each.versions)] for name, each in named]
    parts += Markup("<h3>Computed with</h3>") + table(["of", "versions"], made)
    return PageSection("provenance", "Where the numbers come from", parts)


def _versions(of: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in of.items())
