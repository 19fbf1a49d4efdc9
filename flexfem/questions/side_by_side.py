"""Numbers of several mechanisms side by side: changes from the first, judged by their bands."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.results import FLOOR, Quantity, Result, number
from flexfem.units import DIRECTIONS, Unit, unit_for

WITHIN = "within the bands"
BEYOND = "beyond the bands"
NO_BAND = "no band"
EQUAL = "equal"
MISSING = "not comparable"
JUDGED = (
    f"{WITHIN}: the difference is at most the sum of the ± of both numbers; {BEYOND}: it is larger"
)
ROUND_OFF = 1e-9  # of a number without a band: a smaller difference is that of the arithmetic
SMALLEST = 5e-4  # %, a smaller change is printed as 0.00
TIMES_FROM = 1000.0  # %, changes from here are printed as a factor
# labels that are written before a direction
BEFORE = {"positive": "+", "negative": "-", "low": "min ", "high": "max "}

Answers = Mapping[str, Result]  # of one mechanism, by question
Names = Mapping[str, Mapping[str, str]]  # by axis: names of the first mechanism, by own names


class ComparedNumber(NamedTuple):
    """A number of every mechanism, and its changes from that of the first.

    path : question, quantity and labels.   quantity, at : the same in words.
    unit : of values and bands, which are nan where there are none; its factor is 1.
    changes_percent : nan of the first, from a zero, and of a number that is missing.
    judged : in words; "" of the first.
    main : whether a terminal shows it without `--all`.
    """

    path: str
    quantity: str
    at: str
    unit: Unit
    values: tuple[float, ...]
    bands: tuple[float, ...]
    changes_percent: tuple[float, ...]
    judged: tuple[str, ...]
    main: bool = True

    @property
    def is_zero(self) -> bool:
        """Whether all values are zero, where there are any."""
        return not any(np.nan_to_num(self.values))

    def change_text(self, which: int) -> str:
        """Return the change of one mechanism from the first as text; "" where it is not defined."""
        change = self.changes_percent[which]
        if math.isnan(change):
            return ""
        if change < -100:
            return "opposite sign"
        if change >= TIMES_FROM:
            return f"{1 + change / 100:.4g} times"
        if abs(change) < SMALLEST:
            return "0.00 %" if change else "0 %"
        if abs(change) < 0.01:
            return f"{change:+.1g} %"
        places = max(0, 2 - int(math.log10(max(abs(change), 1.0))))
        return f"{change:+.{places}f} %"

    def texts(self) -> list[str]:
        """Return the values with their bands as texts, in the unit of `unit_text`."""
        factor = self._shown_unit.factor
        return [
            number(value * factor, band * factor)
            for value, band in zip(self.values, self.bands, strict=True)
        ]

    def unit_text(self, plain: bool) -> str:
        """Return the unit of the texts, with a prefix for lengths and angles."""
        return self._shown_unit.label(plain)

    @property
    def _shown_unit(self) -> Unit:
        if self.unit.name not in ("mm", "rad"):
            return self.unit
        sizes = [abs(value) for value in self.values if math.isfinite(value)]
        return unit_for("theta" if self.unit.name == "rad" else "x", max(sizes, default=0.0))


class _Place(NamedTuple):
    """Where a number is: question, quantity, model, and labels by axis."""

    question: str
    quantity: str
    model: str
    labels: tuple[tuple[str, str], ...]


class _Cell(NamedTuple):
    """A value with its band, their unit, and what the quantity is."""

    value: float
    band: float
    unit: Unit
    meaning: str
    is_detail: bool


def judge(first: tuple[float, float], other: tuple[float, float]) -> str:
    """Return in words whether a value with its band differs from another beyond both bands.

    Bands are half-widths: where the intervals do not meet, the difference is beyond both. Numbers
    without a band are not judged, but for those that are equal. Where neither has a value, there is
    nothing to judge: the text is empty.
    """
    values = np.array([first[0], other[0]])
    if np.all(np.isnan(values)):
        return ""
    if np.any(np.isnan(values)):
        return MISSING
    band = first[1] + other[1]
    difference = 0.0 if values[0] == values[1] else float(abs(values[1] - values[0]))
    if math.isnan(band):
        return EQUAL if difference <= ROUND_OFF * np.max(np.abs(values)) else NO_BAND
    return BEYOND if difference > band else WITHIN


def change_of(first: tuple[float, float], other: float) -> float:
    """Return the change of a value, %; nan from one that is zero within its band, or unlimited."""
    value, band = first
    if not abs(value) > np.nan_to_num(band) or not (math.isfinite(value) and math.isfinite(other)):
        return math.nan if value != other else 0.0
    return 100 * (other / value - 1)


def compared_number(
    path: str,
    words: tuple[str, str],
    unit: str,
    found: Sequence[tuple[float, float]],
    main: bool = True,
) -> ComparedNumber:
    """Return a number of all mechanisms with changes and judgements.

    Parameters
    ----------
    path : of the number.
    words : the quantity, and of which part or direction.
    unit : of values and bands.
    found : value and band of each mechanism, nan where there is none.
    main : whether a terminal always shows it.
    """
    first, *others = found
    changes = [math.nan, *(change_of(first, value) for value, _ in others)]
    judged = ["", *(judge(first, each) for each in others)]
    return ComparedNumber(
        path=path,
        quantity=words[0],
        at=words[1],
        unit=Unit(1.0, unit),
        values=tuple(value for value, _ in found),
        bands=tuple(band for _, band in found),
        changes_percent=tuple(changes),
        judged=tuple(judged),
        main=main,
    )


def compared_numbers(
    sides: Sequence[Answers],
    names: Sequence[Names],
    main: Mapping[str, Mapping[str, str]],
    every_model: bool = False,
) -> list[ComparedNumber]:
    """Return the numbers of several mechanisms side by side, the main ones first.

    Parameters
    ----------
    sides : answers of each mechanism.
    names : of each mechanism, names of parts of the first by its own ones.
    main : short names of quantities that a terminal shows without `--all`, by question and
        quantity, or those at their first label, `range.free`; of another question it shows those
        that are no details.
    """
    cells = [_cells(answers, own, every_model) for answers, own in zip(sides, names, strict=True)]
    by_quantity = dict[tuple[str, str], dict[_Place, None]]()
    for side in cells:
        for place in side:
            by_quantity.setdefault(place[:2], {}).setdefault(place)
    found = list[ComparedNumber]()
    for (question, _), places in by_quantity.items():
        several = _axes_with_several([each for each in places if each in cells[0]] or places)
        for place in places:
            listed = [side.get(place) for side in cells]
            found.append(_compared(place, listed, several, main.get(question)))
    return sorted(found, key=lambda each: not each.main)


def _compared(
    place: _Place,
    listed: Sequence[_Cell | None],
    several: set[str],
    main: Mapping[str, str] | None,
) -> ComparedNumber:
    """Return the number at a place of all mechanisms.

    several : axes with more than one label.   main : short names; None where details are left out.
    """
    one = next(cell for cell in listed if cell is not None)
    labels = [label for _, label in place.labels]
    short = _short_name(main or {}, place.quantity, labels)
    shown = not one.is_detail if main is None else bool(short.text)
    parts = [place.question, place.quantity, place.model, *labels]
    return compared_number(
        path=".".join(filter(None, parts)),
        words=(
            _meaning(short.text or one.meaning, place),
            _at(place.labels[short.labels :], several),
        ),
        unit=one.unit.name,
        found=[(math.nan, math.nan) if each is None else each[:2] for each in listed],
        main=shown and not place.model,
    )


class _ShortName(NamedTuple):
    """A short name of a quantity, and how many of its labels it contains."""

    text: str
    labels: int


def _short_name(
    main: Mapping[str, str],
    quantity: str,
    labels: Sequence[str],
) -> _ShortName:
    """Return the short name of a quantity, or of one at its first label; "" where it has none."""
    if quantity in main or not labels:
        return _ShortName(main.get(quantity, ""), 0)
    text = main.get(f"{quantity}.{labels[0]}", "")
    return _ShortName(text, 1 if text else 0)


def _meaning(words: str, place: _Place) -> str:
    return f"{words} ({place.model})" if place.model else words


def _axes_with_several(places: Iterable[_Place]) -> set[str]:
    """Return the axes along which the numbers of a quantity have more than one label."""
    labels = dict[str, set[str]]()
    for place in places:
        for axis, label in place.labels:
            labels.setdefault(axis, set()).add(label)
    return {axis for axis, found in labels.items() if len(found) > 1}


def _at(listed: Sequence[tuple[str, str]], several: set[str]) -> str:
    """Return the labels of a number as words; labels that all numbers share are left out."""
    words = list[str]()
    labels = dict(listed)
    sign = "".join(BEFORE[labels.pop(axis)] for axis in ("sense", "end") if axis in labels)
    for axis, label in labels.items():
        if axis in ("direction", "component"):
            words.append(f"{sign}{label}")
        elif axis == "others":
            words.append(f"others {label}")
        elif axis not in several:
            continue
        elif axis == "mode":
            words.append(f"mode {label}")
        else:
            words.append(label)
    return ", ".join(words)


def _cells(
    answers: Answers,
    names: Names,
    every_model: bool,
) -> dict[_Place, _Cell]:
    """Return the numbers of the answers of one mechanism by their places."""
    found = dict[_Place, _Cell]()
    for question, result in answers.items():
        for name in result.values:
            declared = result.quantities[name]
            if not declared.shown or "limit" in declared.over:
                continue
            for at, cell in _cells_of(result, declared):
                model = at.pop("model", "")
                is_best = not model or model == result.axes["model"][-1]
                labels = tuple(
                    (axis, names.get(axis, {}).get(label, label)) for axis, label in at.items()
                )
                if is_best or every_model:
                    found[_Place(question, name, "" if is_best else model, labels)] = cell
    return found


def _cells_of(result: Result, declared: Quantity) -> Iterator[tuple[dict[str, str], _Cell]]:
    """Yield the known numbers of a quantity, with their labels by axis."""
    sizes = result.sizes(declared.name)
    for at in _places(result, declared):
        cell = _cell(result, declared, sizes, at)
        if not math.isnan(cell.value):
            yield at, cell


def _places(result: Result, declared: Quantity) -> Iterator[dict[str, str]]:
    """Yield the labels of the numbers of a quantity; of the hinges, only the largest counts."""
    over = [axis for axis in declared.over if axis not in declared.largest]
    for _, labels in result.indices(over):
        yield dict(zip(over, labels, strict=True))


def _cell(
    result: Result,
    declared: Quantity,
    sizes: Array,
    at: Mapping[str, str],
) -> _Cell:
    """Return the number at labels, the largest one of all hinges; round-off is zero."""
    name = declared.name
    values = np.atleast_1d(result.at(name, **at)).ravel()
    bands = np.atleast_1d(result.band(name, **at)).ravel()
    size = np.atleast_1d(result.array_of({name: sizes}, name, at)).ravel()
    known = np.where(np.isnan(values), -1.0, np.abs(values))
    which = int(np.argmax(known))
    value = float(values[which])
    if abs(value) <= FLOOR * size[which]:
        value = 0.0
    index = [result.axes[axis].index(at[axis]) if axis in at else 0 for axis in declared.over]
    unit = declared.unit_at(tuple(index))
    return _Cell(
        value=value,
        band=float(bands[which]),
        unit=unit,
        meaning=declared.meaning,
        is_detail=declared.detail,
    )


def parasitic(sides: Sequence[Answers]) -> list[ComparedNumber]:
    """Return the motions across one translation of the output, per its motion along it.

    The output is pushed along this direction with the others free. It is x or y: that in which the
    drive of the first mechanism moves it most, without a drive its softest one.
    """
    along = _used_direction(sides[0])
    pushed = DIRECTIONS[along]
    found = list[ComparedNumber]()
    for across in range(3):
        if across == along:
            continue
        unit = "µrad/mm" if across == 2 else "µm/mm"
        factor = 1e6 if across == 2 else 1e3
        ratios = [_ratio(answers["stiffness"], along, across) for answers in sides]
        found.append(
            compared_number(
                f"stiffness.parasitic.{pushed}.{DIRECTIONS[across]}",
                ("parasitic motion", f"{DIRECTIONS[across]} per {pushed}"),
                unit,
                [(factor * value, factor * band) for value, band in ratios],
            )
        )
    return found


def _used_direction(answers: Answers) -> int:
    """Return the index of the translation, x or y, for which a mechanism is likely made."""
    if "drive" in answers:
        driven = answers["drive"]
        output = driven.axes["point"][0]
        motion = driven.at("motion", point=output, model=driven.axes["model"][-1])
        return int(np.argmax(np.max(np.abs(motion[:, :2]), axis=0)))
    at_rest = answers["stiffness"]
    compliance = at_rest.at("compliance", model=at_rest.axes["model"][-1])
    return int(np.argmax(np.diag(compliance)[:2]))


def _ratio(
    result: Result,
    along: int,
    across: int,
) -> tuple[float, float]:
    """Return the motion across a push per motion along it, and its band."""
    model = result.axes["model"][-1]
    compliance = result.at("compliance", model=model)
    bands = result.band("compliance", model=model)
    least = FLOOR * math.sqrt(compliance[along, along] * compliance[across, across])
    ratio = compliance[across, along] / compliance[along, along]
    band = (bands[across, along] + abs(ratio) * bands[along, along]) / compliance[along, along]
    if abs(compliance[across, along]) <= least:
        ratio = 0.0
    return float(ratio), float(band)


def matched_names(
    axis: str,
    first: Sequence[str],
    other: Sequence[str],
) -> tuple[dict[str, str], list[str]]:
    """Return the names of parts of the first mechanism by those of another, and notes.

    Equal names are the same part. If one name is left in each, these are the same part, too.
    """
    found = {name: name for name in other if name in first}
    mine = [name for name in first if name not in other]
    theirs = [name for name in other if name not in first]
    if len(mine) == len(theirs) == 1:
        found[theirs[0]] = mine[0]
        return found, [f"{axis} {theirs[0]!r} is compared with {mine[0]!r} of the first"]
    notes = list[str]()
    if mine:
        notes.append(f"has no {axis} {_listed(mine)}: their numbers are not comparable")
    if theirs:
        notes.append(f"{axis} {_listed(theirs)} is not in the first: not comparable")
    return found, notes


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))
