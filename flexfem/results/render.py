"""Tables and sentences of results, for terminals, Markdown and HTML."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from html import escape
from io import StringIO
from itertools import product
from typing import NamedTuple

import numpy as np

from flexfem.arrays import is_largest
from flexfem.files.writing import markdown_table
from flexfem.results.declare import SOLID, Declared, Place, Quantity
from flexfem.results.numbers import number
from flexfem.units import UNITS, Unit, UnitNames, unit_for

SMALLEST_PERCENTAGE = 1e-3  # smaller ones, with their bands, are shown as 0
MOST_LISTED = 3  # values in the line with the main result
# Of the scale of a value: smaller ones, zero on a symmetric mesh, are shown as 0 whatever their
# band.
FLOOR = 1e-6
BAND_FLOOR = 1e-9  # the same of a band that is not shown
MODELS_AS_COLUMNS = 3  # quantities by model alone above which models are columns
CAUSES = ("model", "theory", "share")  # axes of which the main result shows the last label

OTHERS = (
    "other directions (others): the two directions along which the output is not driven; held: "
    "it is kept from moving along them; free: it moves along them as it will"
)


class TextTable(NamedTuple):
    """A table of texts: head, rows, number of columns at the left that name rows, and caption."""

    head: list[str]
    rows: list[list[str]]
    names: int
    caption: str = ""


class TableGroup(NamedTuple):
    """Quantities that share a table.

    rows : axes of the rows.   spread : axis of the columns, "" for a column by quantity.
    """

    rows: tuple[str, ...]
    spread: str
    quantities: list[Quantity]


class Tables:
    """Tables of a result; with `plain`, units are in ASCII and places below a value, for terminals.

    With `short_repr` they leave out details, and lengths and angles in a column share a unit.

    Bands below `least_band`, relative to the value, are left out.
    Differences of the first model from the last follow the rows of the last model.
    """

    def __init__(
        self,
        result: Declared,
        plain: bool,
        brief: bool = False,
        least_band: float = 0.0,
    ) -> None:
        self.result = result
        self.least_band = least_band
        self.plain = plain
        self.brief = brief

    def tables(self) -> list[TextTable]:
        """Return a table for each quantity with axes as rows and columns; others share tables."""
        return [self._table(group) for group in self._groups()]

    def _groups(self) -> list[TableGroup]:
        found = dict[tuple[tuple[str, ...], str, str], TableGroup]()
        for name, quantity in self.result.quantities.items():
            if not quantity.shown or name not in self.result.values:
                continue
            if np.all(np.isnan(self.result.values[name])):
                continue
            if self.brief and quantity.detail:
                continue
            aside = (*self.result.columns, *quantity.largest)
            rows = tuple(axis for axis in quantity.over if axis not in aside)
            spread = self._spread(quantity)
            key = (rows, spread, name if rows and spread else "")
            found.setdefault(key, TableGroup(rows, spread, [])).quantities.append(quantity)
        return list(found.values())

    def _table(self, group: TableGroup) -> TextTable:
        rows, spread, quantities = group
        if not rows:
            return self._table_of_quantities(group)
        if spread:
            return self._table_of_one(group)
        if rows == ("model",) and len(quantities) > MODELS_AS_COLUMNS:
            return self._table_by_model(group)
        head = [*rows, *(self._headed(one.meaning, one, 0) for one in quantities)]
        return TextTable(head, self._rows(group), len(rows))

    def _table_of_quantities(self, group: TableGroup) -> TextTable:
        """Return a table with a row for each quantity."""
        rows = list[list[str]]()
        first = group.quantities[0]
        is_headed = self.brief and bool(group.spread) and _have_equal_units(group.quantities)
        for one in group.quantities:
            (cells,) = self._rows(group._replace(quantities=[one]), with_unit=not is_headed) or [[]]
            rows.append([one.meaning, *cells])
        labels = list(self.result.axes[group.spread]) if group.spread else [""]
        if is_headed:
            labels = [self._headed(label, first, k) for k, label in enumerate(labels)]
        return TextTable(["", *labels], rows, 1)

    def _table_by_model(self, group: TableGroup) -> TextTable:
        """Return a table with a row for each quantity and a column for each model."""
        columns = self._rows(group, with_unit=True)
        rows = [
            [one.meaning, *(column[1 + k] for column in columns)]
            for k, one in enumerate(group.quantities)
        ]
        return TextTable(["", *(column[0] for column in columns)], rows, 1)

    def _table_of_one(self, group: TableGroup) -> TextTable:
        """Return the table of one quantity with an axis as columns, without empty columns."""
        (one,) = group.quantities
        labels = list(self.result.axes[group.spread])
        caption = one.meaning
        if any(isinstance(each, tuple) for each in one.unit):  # of a matrix: units differ by cell
            caption = f"{one.meaning} ({units_text(one.unit, self.plain)})"
        else:
            labels = [self._headed(label, one, k) for k, label in enumerate(labels)]
        head = [*group.rows, *labels]
        rows = self._rows(group)
        names = len(group.rows)
        kept = [k for k in range(len(head)) if k < names or any(row[k] for row in rows)]
        shown = [[row[k] for k in kept] for row in rows]
        return TextTable([head[k] for k in kept], shown, names, caption)

    def _headed(
        self,
        text: str,
        quantity: Quantity,
        column: int,
    ) -> str:
        """Return the heading of a column with its unit, unless the cells contain the unit."""
        spread = self._spread(quantity)
        place = tuple(column if axis == spread else 0 for axis in quantity.over)
        unit = quantity.unit_at(place).label(self.plain)
        if self._shares_units(quantity):
            unit = self._shared_unit(quantity, column).label(self.plain)
        return f"{text} ({unit})" if unit and not self._has_units_in_cells(quantity) else text

    def _has_units_in_cells(self, quantity: Quantity) -> bool:
        """Whether numbers have prefixes of their own, or units differ by row."""
        differs = isinstance(quantity.unit, tuple) and "direction" in quantity.over
        is_by_row = self._spread(quantity) not in ("direction", "component")
        is_prefixed = quantity.prefixed and not self._shares_units(quantity)
        return is_prefixed or (differs and is_by_row)

    def _shares_units(self, quantity: Quantity) -> bool:
        """Whether all numbers of a column have one unit with a prefix, which its heading states."""
        return self.brief and quantity.prefixed and self._spread(quantity) == "direction"

    def _shared_unit(
        self,
        quantity: Quantity,
        column: int,
    ) -> Unit:
        """Return the unit with a prefix of the largest number in the column of a direction."""
        axis = quantity.over.index("direction")
        values = self.result.internal.values[quantity.name]
        sizes = self.result.internal_sizes(quantity.name)
        shown = np.where(np.abs(values) > FLOOR * sizes, np.abs(values), 0.0)
        shown[~np.isfinite(values)] = 0.0
        largest = np.max(np.take(shown, column, axis), initial=0.0)
        place = tuple(column if each == "direction" else 0 for each in quantity.over)
        return _prefixed_unit(quantity.unit_at(place), float(largest), np.nan)

    def _rows(
        self,
        group: TableGroup,
        with_unit: bool = False,
    ) -> list[list[str]]:
        """Return rows of quantities with the same axes, without empty ones."""
        over = group.rows
        rows = list[list[str]]()
        last = tuple[str, ...]()
        last_model = len(self.result.axes.get("model", ())) - 1
        for place, labels in self.result.indices(over):
            cells = list[str]()
            for one in group.quantities:
                has_unit = with_unit or self._has_units_in_cells(one)
                cells += [self.cell(one, at, has_unit) for at in self.shown(one, over, place)]
            if any(cells):
                rows.append([*_changed_names(labels, last), *cells])
                last = labels
            if over and over[-1] == "model" and place[-1] == last_model > 0:
                differences = list[str]()
                for one in group.quantities:
                    differences += self._differences(one, over, place)
                if any(differences):
                    blank = [""] * (len(over) - 1)
                    rows.append([*blank, "difference (%)", *differences])
        return rows

    def _spread(self, quantity: Quantity) -> str:
        """Return the axis of a quantity whose labels are table columns, "" for none."""
        found = [axis for axis in quantity.over if axis in self.result.columns]
        return found[-1] if found else ""

    def shown(
        self,
        quantity: Quantity,
        over: Sequence[str],
        place: Sequence[int],
    ) -> list[Place]:
        """Return the indices of the values in the cells of a row.

        Of axes that are neither rows nor columns it is the first of the largest values.
        """
        spread = self._spread(quantity)
        if spread in over:  # at one of the columns
            spread = ""
        axes = self.result.axes
        sizes = np.abs(self.result.internal.values[quantity.name])
        sizes = np.where(np.isnan(sizes), -1.0, sizes)
        found = list[Place]()
        for k in range(len(axes[spread]) if spread else 1):
            known = dict(zip(over, place, strict=True)) | {spread: k}
            ranges = [
                [known[axis]] if axis in known else range(len(axes[axis])) for axis in quantity.over
            ]
            candidates = list(product(*ranges))
            are_largest = is_largest(np.array([sizes[at] for at in candidates]))
            found.append(candidates[int(np.argmax(are_largest))])  # the first of equal ones
        return found

    def cell(
        self,
        quantity: Quantity,
        at: Place,
        with_unit: bool,
    ) -> str:
        """Return the text of a value with its band; of a largest value with its place."""
        value, band = self._rounded(quantity, at)
        unit = quantity.unit_at(at)
        if quantity.prefixed and not with_unit and self._shares_units(quantity):
            unit = self._shared_unit(quantity, at[quantity.over.index("direction")])
        elif quantity.prefixed:
            unit = _prefixed_unit(unit, value, band)
        text = number(value * unit.factor, band * unit.factor)
        if unit.name == "%" and abs(value) + np.nan_to_num(band) < SMALLEST_PERCENTAGE:
            text = "0"
        if with_unit and text and np.isfinite(value):
            text = f"{text} {unit.label(self.plain)}".rstrip()
        if not (quantity.largest and value and text):
            return text
        index = dict(zip(quantity.over, at, strict=True))
        axes = reversed(quantity.largest)
        where = ", ".join(self.result.axes[axis][index[axis]] for axis in axes)
        if _is_named(quantity):
            return where  # its number is always 1
        return f"{text}\n{where}" if self.plain else f"{text} ({where})"

    def _rounded(
        self,
        quantity: Quantity,
        at: Place,
    ) -> tuple[float, float]:
        """Return a value and its band in internal units: 0 and nan where they are round-off."""
        result = self.result
        value = float(result.internal.values[quantity.name][at])
        band = float(result.array_of(result.internal.bands, quantity.name, {})[at])
        size = result.internal_sizes(quantity.name)[at]
        if abs(value) <= FLOOR * size:
            return 0.0, np.nan
        is_shown = band > BAND_FLOOR * size and band >= self.least_band * abs(value)
        return value, band if is_shown else np.nan

    def _differences(
        self,
        quantity: Quantity,
        over: Sequence[str],
        place: Place,
    ) -> list[str]:
        """Return the differences of the first model from the last, %, for the cells of a row.

        There is none from a value that is zero within its band.
        """
        last = self.shown(quantity, over, place)
        if "model" not in quantity.over or not quantity.compared:
            return [""] * len(last)
        first = self.shown(quantity, over, (*place[:-1], 0))
        values = self.result.internal.values[quantity.name]
        sizes = self.result.internal_sizes(quantity.name)
        stated = self.result.internal.bands.get(quantity.name, np.zeros_like(values))
        bands = np.nan_to_num(stated)
        found = list[str]()
        for a, b in zip(first, last, strict=True):
            is_known = np.isfinite(values[a]) and abs(values[b]) > max(FLOOR * sizes[b], bands[b])
            found.append(f"{100 * (values[a] / values[b] - 1):+z.2f}" if is_known else "")
        return found

    def answer(self) -> str:
        """Return the main result in one line, "" without one."""
        result = self.result
        name, labels = result.main_result or ("", {})
        if name not in result.values:
            return ""
        one = result.quantities[name]
        fixed = {axis: result.axes[axis][-1] for axis in CAUSES if axis in one.over} | dict(labels)
        texts = self._listed(one, fixed)
        if not texts:
            return ""
        parts = list[str]()
        for part, each in texts.items():
            before = f"{part} " if len(texts) > 1 else ""
            parts.append(before + ", ".join(each[:MOST_LISTED]))
        more = f" and {len(parts) - MOST_LISTED} more" if len(parts) > MOST_LISTED else ""
        where = f" ({', '.join(fixed.values())})" if fixed else ""
        return f"{one.meaning}{where}: {'; '.join(parts[:MOST_LISTED])}{more}"

    def _listed(
        self,
        one: Quantity,
        fixed: Mapping[str, str],
    ) -> dict[str, list[str]]:
        """Return the values of a quantity at labels of some axes, by the labels of the others.

        Values along a direction, or along the last axis, share a list.
        """
        rest = [axis for axis in one.over if axis not in fixed and axis != "commanded"]
        listed = "direction" if "direction" in rest else (rest or [""])[-1]
        found = dict[str, list[str]]()
        for at, where in self.result.indices(one.over):
            named = dict(zip(one.over, where, strict=True))
            is_along = named.get("commanded") in (None, named.get("direction"))
            if not is_along or any(named[axis] != label for axis, label in fixed.items()):
                continue
            text = self.cell(one, at, True)
            text = text.partition("\n")[0] if listed in one.largest else text.replace("\n", ", ")
            if text:
                before = "" if listed in ("", "mode") else f"{named[listed]} "
                part = ", ".join(named[axis] for axis in rest if axis != listed)
                found.setdefault(part, []).append(before + text)
        return found


def _have_equal_units(quantities: Sequence[Quantity]) -> bool:
    """Whether quantities have the same units without prefixes, which a heading may state."""
    units = {one.unit for one in quantities}
    return len(units) == 1 and not quantities[0].prefixed and bool(quantities[0].unit)


def _changed_names(labels: Sequence[str], last: Sequence[str]) -> list[str]:
    """Return labels of a row, "" where they and those before them are as in the last row."""
    return [label if labels[: k + 1] != last[: k + 1] else "" for k, label in enumerate(labels)]


def _prefixed_unit(
    unit: Unit,
    value: float,
    band: float,
) -> Unit:
    """Return the unit with a prefix for a length or an angle, of its band where this is larger."""
    if not value:
        return Unit(unit.factor, "")
    size = max(abs(value), float(np.nan_to_num(band)))
    return unit_for("theta" if "rad" in unit.name else "x", size)


def heading(result: Declared) -> str:
    """Return the subject and the settings in one line."""
    texts = [result.title]
    for key, value in result.settings.items():
        if not isinstance(value, Mapping) and value not in (None, "", False):
            texts.append(f"{key} {value}")
    return f"{result.about.name}: {'; '.join(texts)}"


def sentences(result: Declared, brief: bool = False) -> list[str]:
    """Return the explanations below the tables; with `brief` those of details are left out."""
    found = list(result.footnotes)
    explained = list[Quantity]()
    for name, one in result.quantities.items():
        if one.shown and name in result.values and not (_is_named(one) or (brief and one.detail)):
            explained.append(one)
    if any(map(_has_others, explained)) and not any(text.startswith("others:") for text in found):
        found.append(OTHERS)
    found += [f"{one.meaning}: {one.note}" for one in explained if one.note]
    found += result.notes
    if any(np.any(np.isfinite(band)) for band in result.bands.values()):
        source = "meshes of different size"
        if SOLID in result.axes.get("model", ()):
            source += " and from the treatment of the thickness"
        found.append(f"±: numerical uncertainty to either side, estimated from {source}")
    return found


def _has_others(one: Quantity) -> bool:
    """Whether a quantity is that of one direction, with the other ones held or free."""
    return "other directions" in one.meaning or "others" in one.over


def _is_named(one: Quantity) -> bool:
    """Whether tables show words in place of the numbers of a quantity, and no note on these."""
    return one.largest == ("limit",) and one.unit == ""


def left_out(result: Declared) -> list[str]:
    """Return the meanings of the details that a result contains."""
    return [
        one.meaning
        for name, one in result.quantities.items()
        if one.detail and one.shown and not np.all(np.isnan(result.values.get(name, np.nan)))
    ]


def markdown(result: Declared) -> str:
    """Return all tables in Markdown."""
    lines = [f"**{heading(result)}**", ""]
    for each in Tables(result, plain=False).tables():
        if each.caption:
            lines += [f"{each.caption}:", ""]
        align = "l" * each.names + "r" * (len(each.head) - each.names)
        lines += [markdown_table(each.head, each.rows, align), ""]
    return "\n".join([*lines, *(f"- {text}" for text in sentences(result))])


def csv_of(result: Declared) -> str:
    """Return all numbers as one tidy table: quantity, a column for each axis, value, band, unit.

    A row and a column of a matrix are labels of its two last axes. Numbers that are nan are left
    out, an infinite one is "inf", and a number without a band has an empty cell.
    """
    text = StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["quantity", *result.axes, "value", "band", "unit"])
    for name, values in result.values.items():
        quantity = result.quantities[name]
        bands = result.band(name)
        for at, labels in result.indices(quantity.over):
            if np.isnan(values[at]):
                continue
            named = dict(zip(quantity.over, labels, strict=True))
            places = [named.get(axis, "") for axis in result.axes]
            band = "" if np.isnan(bands[at]) else f"{bands[at]:.6g}"
            unit = quantity.unit_at(at).plain
            table.writerow([name, *places, f"{values[at]:.12g}", band, unit])
    return text.getvalue()


def html(result: Declared) -> str:
    """Return heading, main result, tables, sentences and warnings, for notebooks."""
    shown = Tables(result, plain=False)
    tables = "".join(map(html_table, shown.tables()))
    texts = [*sentences(result), *(f"Warning: {text}" for text in result.warnings)]
    listed = "".join(f"<li>{escape(text)}</li>" for text in texts)
    about = f"<p><b>{escape(heading(result))}</b><br>{escape(shown.answer())}</p>"
    return f"{about}{tables}<ul>{listed}</ul>"


def html_table(content: TextTable) -> str:
    """Return a table as an HTML element that needs no style sheet."""
    lines = [_html_row("th", content.head, content.names)]
    lines += [_html_row("td", row, content.names) for row in content.rows]
    caption = f'<caption style="text-align: left">{escape(content.caption)}</caption>'
    return f'<table style="margin-top: 1em">{caption}{"".join(lines)}</table>'


def _html_row(
    tag: str,
    row: Sequence[str],
    names: int,
) -> str:
    cells = list[str]()
    for k, text in enumerate(row):
        side = "left" if k < names else "right"
        cells.append(f'<{tag} style="text-align: {side}">{escape(text)}</{tag}>')
    return f"<tr>{''.join(cells)}</tr>"


def declaration_table(kind: type[Declared]) -> TextTable:
    """Return the declaration of a kind of result as a table for the documentation."""
    rows = list[list[str]]()
    for name, one in kind.quantities.items():
        axes = ", ".join(one.over) or "one number"
        rows.append([f"{kind.kind()}.{name}", one.meaning, units_text(one.unit), axes])
    return TextTable(["quantity", "meaning", "unit", "for each"], rows, 1)


def units_text(unit: UnitNames, plain: bool = False) -> str:
    """Return the distinct units of a quantity, separated by commas."""
    names = np.ravel(unit).tolist()
    return ", ".join(dict.fromkeys(UNITS[name].label(plain) if name else "1" for name in names))
