"""The figures that suit a study: curves over one factor, maps of two, effects of more."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np

from flexfem.arrays import Array
from flexfem.refused import BadInput
from flexfem.study.curves import AskedNumber, curves_of
from flexfem.study.effects import effects_of
from flexfem.study.findings import FLAT, LEAST, sensitivity_of
from flexfem.study.maps import map_of
from flexfem.study.names import model_of, sentence
from flexfem.study.records import AxisText, FigureTable, Record, StudyMap, StudyMaps
from flexfem.study.source import Source
from flexfem.study.tables import Figure

PANELS = 6  # numbers on one page
RESOLVED = 12  # most numbers of a figure of sensitivities
Item = TypeVar("Item")
MODEL_WORDS = {
    "analytic": "analytic model",
    "fe": "finite elements",
    "three_dimensional": "finite elements in three dimensions",
    "verify": "",
    "both": "",
}
LABEL_WORDS = {
    "analytic": "analytic model",
    "elastic bodies": "analytic model, elastic bodies",
}


def overview(source: Source) -> dict[str, Record]:
    """Return the records of the figures of every number asked, by the name of their image.

    Numbers that a figure of the file already shows in the same way, and constant numbers, have
    none.
    """
    varied = varied_factors(source)
    numbers, notes = _changing(source, asked_numbers(source))
    if not varied or not numbers:
        return {}
    make = {1: _curves, 2: _maps}.get(len(varied), _effects)
    found = dict[str, Record]()
    for kind, record in make(source, varied, numbers, notes):
        stem = f"{source.loaded.stem}-{kind}"
        count = sum(name.startswith(stem) for name in found)
        found[f"{stem}-{count + 1}" if count else stem] = record
    return found


def varied_factors(source: Source) -> list[str]:
    """Return the columns of the factors that differ between the designs of the table."""
    names = [column.name for column in source.loaded.columns]
    return [name for name in names if np.ptp(source.table.columns[name]) > 0]


def asked_numbers(source: Source) -> list[AskedNumber]:
    """Return the numbers that a study asks for, those of several models together.

    These are the numbers of `ask` and the derived outputs, and in a study of a stage those of its
    figures and constraints; all outputs where these are none. A derived output that only names a
    column gives it its label and unit.
    """
    loaded = source.loaded
    names = _requested(source)
    labels = dict[str, AxisText]()
    for derived in loaded.study.output:
        renamed = derived.expression.strip("` ")
        if renamed in names and derived.label:
            labels.setdefault(renamed, source.quantity(derived.name))
            names.remove(derived.name)
    groups = dict[str, dict[str, str]]()
    for name in names:
        model = model_of(name, loaded.base) if name in loaded.study.ask else ""
        alike = name.replace(f".{model.replace(' ', '_')}", ".", 1) if model else name
        groups.setdefault(alike, {})[_model_words(source, model)] = name
    numbers = list[AskedNumber]()
    for columns in groups.values():
        first = next(iter(columns.values()))
        quantity = source.quantity(first)
        if len(columns) == 1:
            quantity = labels.get(first, quantity)
        numbers.append(AskedNumber(quantity, columns))
    return numbers


def _requested(source: Source) -> list[str]:
    study = source.loaded.study
    names = [*study.ask, *(derived.name for derived in study.output)]
    shown = [name for figure in study.figure for name in figure.names]
    limited = study.names_of(*(constraint.value for constraint in study.constraint))
    names += [name for name in study.columns if name in {*shown, *limited}]
    return names or [*study.columns]


def _model_words(source: Source, label: str) -> str:
    if not label:
        return MODEL_WORDS[source.loaded.study.model]
    return LABEL_WORDS.get(label, f"finite elements, {label}")


def _changing(
    source: Source, numbers: Sequence[AskedNumber]
) -> tuple[list[AskedNumber], list[str]]:
    """Return the numbers that differ between designs, and lines on the others."""
    changing = list[AskedNumber]()
    constant = list[str]()
    absent = list[str]()
    for number in numbers:
        known = [_known(source, name) for name in number.columns.values()]
        if not any(map(len, known)):
            absent.append(number.quantity.name)
        elif all(map(_is_flat, known)):
            value = next(float(values[0]) for values in known if len(values))
            constant.append(f"{number.quantity.name} {value:.4g}{number.quantity.after}")
        else:
            changing.append(number)
    lines = [f"Constant: {'; '.join(constant)}."] if constant else []
    lines += [f"Not known in any design: {'; '.join(absent)}."] if absent else []
    return changing, lines


def _known(source: Source, name: str) -> Array:
    values = source.drawable(name)[source.table.ok]
    return values[np.isfinite(values)]


def _is_flat(values: Array) -> bool:
    return len(values) == 0 or bool(np.ptp(values) <= FLAT * np.abs(values).max())


def _curves(
    source: Source,
    varied: Sequence[str],
    numbers: Sequence[AskedNumber],
    notes: Sequence[str],
) -> Iterator[tuple[str, Record]]:
    for page in _pages(numbers):
        yield "curves", curves_of(source, varied[0], page, *notes)


def _pages(items: Sequence[Item]) -> Iterator[Sequence[Item]]:
    """Yield so many items as a page has panels for."""
    return (items[start : start + PANELS] for start in range(0, len(items), PANELS))


def columns_of_numbers(source: Source) -> dict[str, AxisText]:
    """Return the columns of the numbers that a study asks for, with their names."""
    return _columns(source, asked_numbers(source))


def _columns(source: Source, numbers: Sequence[AskedNumber]) -> dict[str, AxisText]:
    """Return the names of the columns of numbers, with the model where there are several."""
    named = dict[str, AxisText]()
    for number in numbers:
        for model, name in number.columns.items():
            several = f", {model}" if len(number.columns) > 1 else ""
            named[name] = number.quantity._replace(name=number.quantity.name + several)
    return {name: axis for name, axis in named.items() if len(_known(source, name))}


def _maps(
    source: Source,
    varied: Sequence[str],
    numbers: Sequence[AskedNumber],
    notes: Sequence[str],
) -> Iterator[tuple[str, Record]]:
    x, y = varied
    figures = source.loaded.study.figure
    drawn = {each.value for each in figures if each.kind == "map" and {each.x, each.y} == {x, y}}
    columns = {name: axis for name, axis in _columns(source, numbers).items() if name not in drawn}
    for page in _pages([*columns.items()]):
        yield "maps", _page_of_maps(source, (x, y), dict(page), notes)


def _page_of_maps(
    source: Source,
    factors: tuple[str, str],
    columns: Mapping[str, AxisText],
    notes: Sequence[str],
) -> StudyMaps:
    """Return the maps of columns, with their names, over two factors."""
    x, y = factors
    maps = list[StudyMap]()
    rows = list[Sequence[str | float]]()
    for name, axis in columns.items():
        made = map_of(source, Figure.model_construct(kind="map", x=x, y=y, value=name))
        maps.append(made._replace(value=axis))
        rows += [(axis.label, *row) for row in made.table.rows]
    what = maps[0].value.name if len(maps) == 1 else "numbers"
    title = sentence(f"{what} over {maps[0].x.name} and {maps[0].y.name}")[:-1]
    head = {
        "quantity": "number",
        "end": "",
        "value": "value",
        "x": maps[0].x.label,
        "y": maps[0].y.label,
    }
    data = FigureTable("Extremes of the maps", head, rows)
    return StudyMaps(source.caption(title, columns, *notes), maps, data)


def _effects(
    source: Source,
    varied: Sequence[str],
    numbers: Sequence[AskedNumber],
    notes: Sequence[str],
) -> Iterator[tuple[str, Record]]:
    columns = _columns(source, numbers)
    for page in _pages([*columns]):
        yield "effects", effects_of(source, varied, page, *notes)
    sampling = source.loaded.study.sampling.method
    shown = any(figure.kind == "sensitivity" for figure in source.loaded.study.figure)
    if shown or sampling in ("grid", "table") or int(source.table.ok.sum()) < LEAST:
        return
    complete = tuple(name for name in columns if _is_complete(source, name))[:RESOLVED]
    if complete:
        figure = Figure.model_construct(kind="sensitivity", values=complete)
        try:
            yield "sensitivity", sensitivity_of(source, figure)
        except BadInput:  # a design of Saltelli's scheme without a result
            return


def _is_complete(source: Source, name: str) -> bool:
    """Return whether a number differs between designs and all with a result have it."""
    known = _known(source, name)
    return len(known) == int(source.table.ok.sum()) and not _is_flat(known)
