"""Measured necks of a mechanism, and the files that list them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, ValidationError, model_validator

from flexfem.arrays import Array
from flexfem.files import refusals
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import Neck, NeckDeviation
from flexfem.files.tables import Label, Table
from flexfem.files.toml import bad_key, read_csv, validate
from flexfem.refused import BadInput
from flexfem.units import MICROMETRE

# measured neck / drawn neck; outside this range the unit or the hinge is probably wrong
PLAUSIBLE = (0.5, 2.0)
LARGEST_DEVIATION = 0.2  # standard deviation / neck
HingePlace: TypeAlias = tuple[int | None, str]  # chain, none in a mechanism, and name of the hinge
Refusal: TypeAlias = Callable[[Sequence[str | int], str], BadInput]
"""Function from the key of a value and a text to the refusal with file and line."""


class Widths(NamedTuple):
    """Neck thicknesses and their standard deviations, both (hinges,), mm."""

    neck: Array
    sd: Array


class MeasuredNeck(Table):
    """A measured neck thickness and the standard deviation of the measurement, mm."""

    chain: int | None = Field(
        default=None,
        ge=1,
        le=3,
        examples=[2],
    )
    """Chain of a hinge of the nine-hinge stage; a hinge of a mechanism has none"""
    hinge: Label = Field(examples=["elbow"])
    """Hinge of this chain: base, elbow or platform; or a hinge of a mechanism, by its name in
    `flexfem check`
    """
    neck: Neck = Field(alias="neck_um", examples=[512.0])
    """Measured neck thickness; must be between half and twice the drawn one"""
    sd: NeckDeviation = Field(
        default=0.0,
        alias="sd_um",
        examples=[3.0],
    )
    """Standard deviation of the measurement, for all necks or for none; at most a fifth of the neck
    """

    @property
    def place(self) -> HingePlace:
        """Chain and name of the hinge."""
        return self.chain, self.hinge


class Necks(Sourced):
    """The measured necks of a mechanism, one entry per hinge."""

    kind: ClassVar[str] = "necks file"

    neck: tuple[MeasuredNeck, ...] = Field(min_length=1)
    """A measured neck; one entry for each of the nine hinges of a stage, or for any hinges of a
    mechanism
    """

    @model_validator(mode="after")
    def _every_hinge_once(self) -> Necks:
        hinges = [entry.place for entry in self.neck]
        for index, hinge in enumerate(hinges):
            if hinge in hinges[:index]:
                raise refusals.refusal("each hinge once", "neck", index)
        without = [
            index for index, entry in enumerate(self.neck) if "sd" not in entry.model_fields_set
        ]
        if 0 < len(without) < len(self.neck):  # a missing deviation is not a deviation of zero
            raise refusals.refusal("sd_um of all necks or of none", "neck", without[0])
        return self

    def over(self, drawn: Mapping[HingePlace, float]) -> Widths:
        """Return necks and standard deviations of all hinges.

        A hinge that is not listed has the drawn neck, and deviation 0.
        """
        listed = {entry.place: (entry.neck, entry.sd) for entry in self.neck}
        rows = [listed.get(place, (neck, 0.0)) for place, neck in drawn.items()]
        return Widths(*np.transpose(rows))


class NecksFile(NamedTuple):
    """The content of a file of necks, and the function that refuses one of its keys."""

    necks: Necks
    refused: Refusal


def read_necks(path: str | os.PathLike[str], drawn: Mapping[HingePlace, float]) -> Necks:
    """Read measured necks: CSV with columns chain, of a stage, hinge, neck_um and, if known, sd_um;
    or TOML, [[neck]].

    drawn : necks of all hinges, mm; those with chains all need a measured neck.

    Raises BadInput with file and line, also for a neck that is not between half and twice the drawn
    one.
    """
    path = refusals.checked_path(path)
    chained = any(chain is not None for chain, _ in drawn)
    if path.suffix.lower() == ".toml":
        file = NecksFile(validate(Necks, path), partial(bad_key, path))
    else:
        file = _read_csv(path, chained)
    for index, entry in enumerate(file.necks.neck):
        for key, problem in _problems(entry, drawn, chained):
            at = refusals.key_path(("neck", index, key), file.necks)
            raise file.refused(("neck", index), f"{at}{problem}")
    if chained:
        _require_all(file, drawn)
    return file.necks


def _require_all(file: NecksFile, drawn: Mapping[HingePlace, float]) -> None:
    """Raise BadInput for hinges without a measured neck."""
    places = {entry.place for entry in file.necks.neck}
    missing = [f"{name} of chain {chain}" for chain, name in drawn if (chain, name) not in places]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        listed = ", ".join(missing)
        raise file.refused(("neck",), f"neck: expected nine hinges: {listed} {verb} missing")


def _problems(
    entry: MeasuredNeck, drawn: Mapping[HingePlace, float], chained: bool
) -> Iterator[tuple[str, str]]:
    """Yield the keys of a measured neck that do not suit the drawn hinges, and what is expected."""
    if chained != (entry.chain is not None):
        found = "" if entry.chain is None else f" = {entry.chain}"
        yield (
            "chain",
            f"{found}, expected 1, 2 or 3 for a hinge of a stage, none for one of a mechanism",
        )
    if entry.place not in drawn:
        names = dict.fromkeys(name for _, name in drawn)
        listed = refusals.one_line(", ".join(names), refusals.SHOWN)
        close = refusals.suggestion(entry.hinge, names) or f", one of {listed}"
        yield "hinge", f" = {refusals.shown(entry.hinge)}, expected the name of a hinge{close}"
    low, high = (MICROMETRE.factor * ratio * drawn[entry.place] for ratio in PLAUSIBLE)
    neck = MICROMETRE.factor * entry.neck
    sd = MICROMETRE.factor * entry.sd
    if not low <= neck <= high:
        yield (
            "neck_um",
            f" = {neck:g}, expected {low:g} to {high:g}, half to twice the drawn neck: is the "
            "unit right?",
        )
    if sd > LARGEST_DEVIATION * neck:
        yield "sd_um", f" = {sd:g}, expected at most {LARGEST_DEVIATION:g} of the neck"


def _read_csv(path: Path, chained: bool) -> NecksFile:
    """Read a CSV file, with a column of the chain if `chained`. Raises BadInput."""
    names = [field.alias or name for name, field in MeasuredNeck.model_fields.items()]
    chain, hinge, neck, sd = names
    needed = (chain, hinge, neck) if chained else (hinge, neck)
    rows = read_csv(path, needed, (sd,))
    refused = partial(_refused_row, path, list(rows))
    data = {"neck": [_entry(row, hinge) for row in rows.values()]}
    try:
        return NecksFile(Necks.model_validate(data), refused)
    except ValidationError as error:
        first = refusals.problems_of(error, data)[0]
    if first.kind == "missing":
        raise refused(first.path, f"{first.path[-1]} is missing")
    raise refused(first.path, refusals.sentence(first, Necks, data))


def _entry(row: Mapping[str, str], hinge: str) -> dict[str, int | float | str]:
    """Return the cells of a row that are not empty: numbers, but for the name of the hinge."""
    cells = {key: cell for key, cell in row.items() if cell}
    return {key: cell if key == hinge else _number(cell) for key, cell in cells.items()}


def _refused_row(
    path: Path,
    lines: Sequence[int],
    at: Sequence[str | int],
    text: str,
) -> BadInput:
    """Return the refusal of a value, with the line of the row whose index is in its key."""
    indices = [part for part in at if isinstance(part, int)]
    line = lines[indices[0]] if indices else None
    return BadInput(refusals.one_line(f"{refusals.place_of(path, line)}: {text}"))


def _number(cell: str) -> int | float | str:
    """Return a cell as a number if it is one, otherwise as text."""
    try:
        return int(cell) if cell.isdecimal() else float(cell)
    except ValueError:
        return cell
