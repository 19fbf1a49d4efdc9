"""What mechanisms side by side are compared by: numbers, inputs and plates, as tables and files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import StringIO
from pathlib import Path
from textwrap import shorten
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem.arrays import LONGEST, Array
from flexfem.files.provenance import Assumptions
from flexfem.files.refusals import as_key, checked_path, nearest
from flexfem.lazy import named
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.departed import ComparedPlate
from flexfem.questions.side_by_side import (
    BEYOND,
    EQUAL,
    JUDGED,
    MISSING,
    NO_BAND,
    WITHIN,
    Answers,
    ComparedNumber,
)
from flexfem.refused import BadInput
from flexfem.results import (
    FORMAT,
    TextTable,
    html_table,
    record_parts,
    versions,
    write_sealed,
)
from flexfem.units import UNITS, unit_of

MOST_LISTED = 3  # changes in the answer
MOST_INPUTS = 12  # rows of inputs without `--all`
LONGEST_INPUT = 24  # characters of an input
MOST_NAMED = 5  # quantities that `--all` adds, by name
EQUAL_EDGES = 1e-2  # um, largest distance of the edges of plates that are said to be equal
ALWAYS_SHOWN = ("thickness", "material")  # inputs that are shown of different designs, too
SHORT = {BEYOND: "beyond", WITHIN: "within"}  # in a narrow table
COUNTED = {
    BEYOND: BEYOND,
    WITHIN: WITHIN,
    EQUAL: EQUAL,
    NO_BAND: "without a band",
    MISSING: MISSING,
}


class Labelled(NamedTuple):
    """A compared mechanism, and its label."""

    label: str
    mechanism: Mechanism

    @property
    def layout(self) -> Layout:
        """The layout of the mechanism, in its own axes."""
        return self.mechanism.layout


class ComparedInput(NamedTuple):
    """A number or a material of the files that is not the same in all; "" where it is not stated.

    main : whether it is one number that all state.
    """

    key: str
    values: list[str]
    main: bool


@dataclass(frozen=True, repr=False)
class Comparison:
    """Mechanisms side by side.

    Attributes
    ----------
    subjects : sequence of Labelled
        The mechanisms with their labels; changes are from the first.
    settings : mapping
        What was compared, and the options of the models that answered.
    numbers : list of ComparedNumber
        The numbers of all mechanisms, their changes and whether these are beyond the bands.
    inputs : list of ComparedInput
        Numbers of the files that differ.
    plates : list of ComparedPlate
        Departure of every other plate from the first: hinges and edges.
    results : sequence of mapping
        The answers of each mechanism by question, each a `Result`.
    notes, warnings : list of str
        Explanations, and limits of validity.
    """

    subjects: Sequence[Labelled]
    settings: Mapping[str, Any]
    numbers: list[ComparedNumber]
    inputs: list[ComparedInput]
    plates: list[ComparedPlate]
    results: Sequence[Answers]
    notes: list[str]
    warnings: list[str]

    title: ClassVar[str] = "comparison"
    figure: ClassVar[str] = "compare.overlay_figure"
    page: ClassVar[str] = "page.compare.comparison_page"
    drawn_from_fields: ClassVar[bool] = False
    has_mesh_fields: ClassVar[bool] = False
    fields: ClassVar[None] = None

    @property
    def labels(self) -> list[str]:
        """Names of the mechanisms, which differ."""
        return [each.label for each in self.subjects]

    @property
    def assumed(self) -> list[str]:
        """Key paths of assumed numbers of all mechanisms, with their labels."""
        return self._doubts.assumed

    @property
    def not_stated(self) -> list[str]:
        """Key paths of numbers without a stated source of all mechanisms, with their labels."""
        return self._doubts.not_stated

    @property
    def _doubts(self) -> Assumptions:
        found = Assumptions([], [])
        for label, mechanism in self.subjects:
            found.assumed.extend(f"{label}: {key}" for key in mechanism.assumed)
            found.not_stated.extend(f"{label}: {key}" for key in mechanism.not_stated)
        return found

    def number(self, path: str) -> ComparedNumber:
        """Return a number by its path, such as `stiffness.free.x`. Raises BadInput."""
        for each in self.numbers:
            if each.path == path:
                return each
        paths = [each.path for each in self.numbers]
        near = nearest(path, paths)
        expected = f"did you mean {near}?" if near else f"expected one of: {', '.join(paths)}"
        raise BadInput(f"no number {as_key(path)} in this comparison, {expected}")

    def change(self, path: str) -> Array:
        """Return the changes of a number from the first mechanism, %: nan of the first itself."""
        return np.array(self.number(path).changes_percent)

    def __repr__(self) -> str:
        text = f"<Comparison of {', '.join(self.labels)}: {self.answer()}>"
        return shorten(text, LONGEST, placeholder=" ...>")

    def answer(self) -> str:
        """Return in one line which numbers of each mechanism are beyond the bands."""
        texts = list[str]()
        for which, label in enumerate(self.labels[1:], start=1):
            counts = list[str]()
            for word, said in COUNTED.items():
                count = sum(each.judged[which] == word for each in self._main())
                if count:
                    counts.append(f"{count} {said}")
            changed = [each for each in self._main() if each.judged[which] in (BEYOND, NO_BAND)]
            changed = [each for each in changed if each.change_text(which) not in ("", "0 %")]
            largest = sorted(changed, key=lambda each: -abs(each.changes_percent[which]))
            listed = [
                f"{_in_words(each)} {each.change_text(which)}" for each in largest[:MOST_LISTED]
            ]
            most = f"; largest changes: {'; '.join(listed)}" if listed else ""
            texts.append(f"{label}: {', '.join(counts)}{most}")
        return "\n".join(texts)

    def heading(self) -> str:
        """Return the subjects and the settings in one line."""
        labels = ", ".join(self.labels[1:])
        stated = [
            f"{name} {value}".removesuffix(" True")
            for name, value in self.settings.items()
            if value
        ]
        asked = "; ".join(stated).replace("question summary", "key results")
        return f"{labels} compared with {self.labels[0]}: {asked}"

    def tables(self, plain: bool = True, brief: bool = False) -> list[TextTable]:
        """Return the tables: numbers, inputs that differ, plates, and hinges that differ.

        plain : write units in ASCII, for terminals.
        brief : leave out details.
        """
        found = [self._numbers_table(plain, brief)]
        found.append(self._inputs_table(brief))
        found.append(self._plates_table(plain))
        if not brief or len(self.plates) == 1:
            found += list(self._hinge_tables(plain))
        return [table for table in found if table.rows]

    def sentences(self, brief: bool = False) -> list[str]:
        """Return the explanations below the tables."""
        found = [JUDGED]
        judged = {word for each in self._shown(brief) for word in each.judged}
        if NO_BAND in judged:
            found.append(f"{NO_BAND}: a number states no ±, and the difference is not judged")
        if MISSING in judged:
            found.append(f"{MISSING}: a mechanism has no such number")
        shown = {each.quantity for each in self._shown(brief)}
        hidden = dict.fromkeys(each.quantity for each in self._main() if each.quantity not in shown)
        if hidden:
            found.append(f"of {self.labels[0]} alone, and {MISSING}: {', '.join(hidden)}")
        for each in self.plates:
            if each.other_design:
                found.append(f"{each.mechanism}: another design, whose plate is not compared")
            elif each.equal_hinges:
                total = each.equal_hinges + len(each.hinges)
                found.append(
                    f"{each.mechanism}: {each.equal_hinges} of {total} hinges are equal, and not "
                    "listed"
                )
        limits = limits_said(self.labels, self.results, ("free",) if brief else ("held", "free"))
        return [*found, *self.notes, *limits]

    def left_out(self) -> list[str]:
        """Return what brief tables leave out."""
        shown = {*self._shown(True)}
        names = dict.fromkeys(
            each.quantity for each in self.numbers if each not in shown and not each.is_zero
        )
        found = [*names][:MOST_NAMED]
        if len(names) > MOST_NAMED:
            found.append(f"{len(names) - MOST_NAMED} more quantities")
        hidden = len(self.inputs) - len(self._shown_inputs(True))
        if hidden:
            found.append(f"{hidden} inputs that differ")
        if len(self.plates) > 1 and any(each.hinges for each in self.plates):
            found.append("hinges that differ")
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document; null where there is no number, "unlimited" for infinity."""
        mechanisms = [
            {
                "label": label,
                "name": mechanism.name,
                "file": str(mechanism.origin),
                "hash": mechanism.hash,
            }
            for label, mechanism in self.subjects
        ]
        return {
            "result": "comparison",
            "format": FORMAT,
            "mechanisms": mechanisms,
            "settings": dict(self.settings),
            "numbers": [
                _plain(each._asdict() | {"unit": each.unit.plain}) for each in self.numbers
            ],
            "inputs": [each._asdict() for each in self.inputs],
            "plates": [
                each._asdict() | {"hinges": [hinge._asdict() for hinge in each.hinges]}
                for each in self.plates
            ],
            "notes": self.notes,
            "warnings": self.warnings,
            "assumed": self.assumed,
            "not_stated": self.not_stated,
            "versions": dict(versions()),
        }

    def write(self, path: Path) -> Path:
        """Store the document as JSON with a digest; return the path."""
        return write_sealed(checked_path(path), self.to_dict())

    def to_csv(self) -> str:
        """Return a row for each number: its path, unit, and value, band, change and judgement of
        each mechanism.
        """
        text = StringIO()
        table = csv.writer(text, lineterminator="\n")
        columns = ("value", "band", "change (%)", "judged")
        heads = [f"{label} {column}" for label in self.labels for column in columns]
        table.writerow(["path", "quantity", "at", "unit", *heads])
        for each in self.numbers:
            row = [each.path, each.quantity, each.at, each.unit.plain]
            for which in range(len(self.labels)):
                row += [_in_csv(each.values[which], ".12g"), _in_csv(each.bands[which], ".6g")]
                row += [_in_csv(each.changes_percent[which], ".6g"), each.judged[which]]
            table.writerow(row)
        return text.getvalue()

    def to_frame(self, long: bool = False) -> Any:
        """Return the numbers as a pandas DataFrame, with a row for each number.

        Columns are the values, bands, changes and judgements of each mechanism; the unit is in the
        name of the row, such as `stiffness, other directions free, x (N/mm)`.

        Parameters
        ----------
        long : bool
            Return a row for each number of each mechanism instead.
        """
        import pandas as pd

        if long:
            return pd.DataFrame(self._long_rows())
        columns = dict[str, Sequence[Any]]()
        for which, label in enumerate(self.labels):
            columns[label] = [each.values[which] for each in self.numbers]
            columns[f"{label} band"] = [each.bands[which] for each in self.numbers]
            if which:
                changes = [each.changes_percent[which] for each in self.numbers]
                columns[f"{label} change (%)"] = changes
                columns[f"{label} judged"] = [each.judged[which] for each in self.numbers]
        names = [f"{_in_words(each)}{_bracketed(each.unit.plain)}" for each in self.numbers]
        return pd.DataFrame(columns, index=pd.Index(names, name="number"))

    def _long_rows(self) -> list[dict[str, Any]]:
        rows = list[dict[str, Any]]()
        for each in self.numbers:
            for which, label in enumerate(self.labels):
                rows.append(
                    {
                        "path": each.path,
                        "mechanism": label,
                        "value": each.values[which],
                        "band": each.bands[which],
                        "unit": each.unit.plain,
                        "change_percent": each.changes_percent[which],
                        "judged": each.judged[which],
                    }
                )
        return rows

    def _repr_html_(self) -> str:
        """Return the tables and the figure for a notebook, which alone loads what draws it."""
        tables = "".join(map(html_table, self.tables(plain=False, brief=True)))
        about = f"<p><b>{escape(self.heading())}</b><br>{escape(self.answer())}</p>"
        return f"{about}{tables}{named('plot.inline.inline_figure')(self)}"

    # tables

    def _main(self) -> list[ComparedNumber]:
        """Return the main numbers that the first mechanism has, and that are not zero in all."""
        return [
            each
            for each in self.numbers
            if each.main and not each.is_zero and not math.isnan(each.values[0])
        ]

    def _shown(self, brief: bool) -> list[ComparedNumber]:
        if not brief:
            return self.numbers
        return [each for each in self._main() if {*each.judged[1:]} != {MISSING}]

    def _numbers_table(self, plain: bool, brief: bool) -> TextTable:
        """Return the numbers with a column for each mechanism; quantities head their rows."""
        several = len(self.subjects) > 2 and plain
        rows = list[list[str]]()
        last = ""
        for each in self._shown(brief):
            cells = self._cells(each, plain, several)
            unit = _bracketed(each.unit_text(plain))
            if not plain:
                rows.append([f"{_in_words(each)}{unit}", *cells])
                continue
            if not each.at:
                rows.append([f"{each.quantity}{unit}", *cells])
                last = ""
                continue
            if each.quantity != last:
                rows.append([each.quantity, *[""] * len(cells)])
                last = each.quantity
            rows.append([f"  {each.at}{unit}", *cells])
        head = ["", self.labels[0]]
        for label in self.labels[1:]:
            head += [label] if several else [label, "change", "bands"]
        caption = f"numbers, and changes from {self.labels[0]}"
        return TextTable(head, rows, 2 if several else 1, caption)

    def _cells(
        self,
        each: ComparedNumber,
        plain: bool,
        several: bool,
    ) -> list[str]:
        """Return the cells of a number; of `several` mechanisms the change is below the value."""
        first, *texts = each.texts()
        cells = [first]
        for which, text in enumerate(texts, start=1):
            change = each.change_text(which)
            word = each.judged[which]
            if plain and word in SHORT:
                word = SHORT[word]
            if several:
                said = " ".join(filter(None, [change, word]))
                cells.append("\n".join(filter(None, [text, said])))
            else:
                cells += [text, change, word]
        return cells

    def _shown_inputs(self, brief: bool) -> list[ComparedInput]:
        if not brief:
            return self.inputs
        found = [each for each in self.inputs if each.main]
        if len(found) <= MOST_INPUTS:
            return found
        return [each for each in found if each.key.startswith(ALWAYS_SHOWN)]

    def _inputs_table(self, brief: bool) -> TextTable:
        rows = [[each.key, *each.values] for each in self._shown_inputs(brief)]
        return TextTable(["", *self.labels], rows, 1, "inputs that differ")

    def _plates_table(self, plain: bool) -> TextTable:
        """Return the departure of every plate from the first, without those of other designs."""
        rows = list[list[str]]()
        for each in self.plates:
            if each.other_design:
                continue
            if each.edge_off_um < EQUAL_EDGES:
                rows.append([each.mechanism, "0", "the same outline", "", ""])
                continue
            x, y = each.edge_off_at_mm
            largest = f"{each.edge_off_um:g}"
            share = f"{100 * each.area_off:.2g} %"
            rows.append([each.mechanism, largest, each.edge_off, f"{x:.4g}, {y:.4g}", share])
        unit = UNITS["um"].label(plain)
        head = ["", f"edge off by ({unit})", "where", "at (mm)", "area off"]
        return TextTable(head, rows, 1, f"plates, from that of {self.labels[0]}")

    def _hinge_tables(self, plain: bool) -> Iterator[TextTable]:
        for each in self.plates:
            if each.hinges and not each.other_design:
                (hinges,) = record_parts(_Listed(each.hinges), plain)[1]
                yield hinges._replace(caption=f"hinges of {each.mechanism} that differ")


class _Listed(NamedTuple):
    """Records that make a table."""

    hinges: list[Any]


def _in_words(each: ComparedNumber) -> str:
    return f"{each.quantity}, {each.at}" if each.at else each.quantity


def _bracketed(unit: str) -> str:
    return f" ({unit})" if unit else ""


def _in_csv(value: float, form: str) -> str:
    return "" if math.isnan(value) else f"{value:{form}}"


def _plain(value: Any) -> Any:
    """Return values as JSON has them: null for nan, "unlimited" for infinity."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "unlimited"
    return value


def inputs_of(subjects: Sequence[Labelled]) -> list[ComparedInput]:
    """Return the numbers and the materials of the files that are not the same in all."""
    mechanisms = [each.mechanism for each in subjects]
    keys = dict.fromkeys(key for each in mechanisms for key in ("material.name", *each.numbers))
    found = list[ComparedInput]()
    for key in keys:
        values = [each.values.get(key) for each in mechanisms]
        texts = ["" if value is None else _input_text(key, value) for value in values]
        if any(value != values[0] for value in values):
            is_single = not any(isinstance(value, tuple) for value in values)
            found.append(
                ComparedInput(
                    key=key,
                    values=texts,
                    main=is_single and "" not in texts and _is_of_one_part(key, mechanisms),
                )
            )
    return found


def _is_of_one_part(key: str, mechanisms: Sequence[Mechanism]) -> bool:
    """Return whether a key with a number of a part, `hinge[2].neck_mm`, is of equal names in all."""
    part = key.rpartition("]")[0]
    names = {each.values.get(f"{part}].name") for each in mechanisms}
    return not part or len(names) == 1


def _input_text(key: str, value: Any) -> str:
    """Return an input in the unit of its key."""
    if isinstance(value, tuple | list):
        inside = ", ".join(_input_text(key, part) for part in value)
        return shorten(inside, LONGEST_INPUT, placeholder=" ...")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return shorten(str(value), LONGEST_INPUT, placeholder=" ...")
    return f"{value * unit_of(key).factor:.7g}"


def limits_said(
    labels: Sequence[str],
    results: Sequence[Answers],
    others: Sequence[str],
) -> Iterator[str]:
    """Yield which limits end the ranges, where one is not that of the first mechanism.

    others : whether those with the others "held", "free" or both.
    """
    found = [answers.get("stiffness") for answers in results]
    if any(each is None or "range_limit" not in each.values for each in found):
        return
    first, *rest = [_limits(each, others) for each in found]
    for place, limit in first.items():
        differ = [
            f"{each[place]} ({label})"
            for label, each in zip(labels[1:], rest, strict=True)
            if each[place] != limit
        ]
        if differ:
            yield f"range {place} ends by: {limit} ({labels[0]}), {', '.join(differ)}"


def _limits(result: Any, listed: Sequence[str]) -> dict[str, str]:
    """Return the limits that govern the ranges of an answer by sense, direction and `others`."""
    found = dict[str, str]()
    for others in listed:
        for sense in result.axes["sense"]:
            for direction in result.axes["direction"]:
                at = {"others": others, "sense": sense, "direction": direction}
                which = int(np.argmax(np.nan_to_num(result.at("range_limit", **at))))
                sign = "+" if sense == "positive" else "-"
                found[f"along {sign}{direction}, others {others},"] = result.axes["limit"][which]
    return found
