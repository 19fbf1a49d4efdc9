"""A user's own table of designs, CSV or Parquet: one row a design, one column a factor, in file units."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.files.refusals import one_line, place_of, shown, suggestion
from flexfem.mechanism.keys import keys
from flexfem.refused import BadInput

if TYPE_CHECKING:
    from flexfem.study.columns import Column

FORMATS = (".csv", ".parquet")
MOST_CSV = 64 * 2**20  # bytes; a CSV file is held in memory, a Parquet file one row group at a time
BLOCK = 2**20  # bytes hashed at a time


class Given(NamedTuple):
    """A table of designs that was found sound: its file, the SHA-256 of what is in it, and how many rows it has."""

    path: Path
    digest: str
    rows: int


def given_of(path: Path, columns: Sequence[Column]) -> Given:
    """Read a table of designs through, and check every value.

    Raises
    ------
    BadInput
        The file is missing, not CSV or Parquet, damaged, too large for CSV or without rows; a column is missing or
        there twice; a value is no finite number or outside the limits of its key. One line naming file, row, column,
        value and what was expected.
    """
    path = Path(os.path.abspath(path))
    digest, rows = _digest(path, _signature(path)), 0
    for values in _blocks(path, tuple(column.name for column in columns)):
        _require_possible(path, columns, values, rows)
        rows += len(values)
    if rows == 0:
        raise BadInput(f"{place_of(path)}: no rows, expected one for each design")
    return Given(path, digest, rows)


def rows_of(given: Given, names: tuple[str, ...], start: int, stop: int) -> Array:
    """Values (stop - start, columns) of the rows from `start` up to `stop`.

    Raises BadInput when the file is not the one that was checked.
    """
    if _digest(given.path, _signature(given.path)) != given.digest:
        raise BadInput(
            f"{place_of(given.path)}: changed since the study was read, expected the same content: run again"
        )
    if given.path.suffix == ".csv":
        return _csv(given.path, given.digest, names)[start:stop]
    ends = np.cumsum([0, *_group_sizes(given.path, given.digest)])
    first, last = np.searchsorted(ends, [start, stop - 1], side="right") - 1
    found = [_group(given.path, given.digest, names, group) for group in range(int(first), int(last) + 1)]
    return np.concatenate(found)[start - ends[first] :][: stop - start]


def _signature(path: Path) -> tuple[int, ...]:
    """What changes when a file is written: inode, size and time of its last change."""
    try:
        status = os.stat(path)
    except (OSError, ValueError) as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else "cannot be read"
        raise BadInput(f"{place_of(path)}: {reason}, expected a table of designs") from None
    if not stat.S_ISREG(status.st_mode):
        raise BadInput(f"{place_of(path)}: a folder, pipe or device, expected a table of designs")
    if path.suffix not in FORMATS:
        raise BadInput(f"{place_of(path)}, expected a file name that ends in {' or '.join(FORMATS)}")
    if path.suffix == ".csv" and status.st_size > MOST_CSV:
        raise BadInput(f"{place_of(path)}: {status.st_size} bytes, expected CSV of at most {MOST_CSV}, or Parquet")
    return status.st_ino, status.st_size, status.st_mtime_ns


@lru_cache(maxsize=4)
def _digest(path: Path, signature: tuple[int, ...]) -> str:
    total = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            while block := file.read(BLOCK):
                total.update(block)
    except OSError as error:
        raise BadInput(f"{place_of(path)}: cannot be read: {error.strerror}") from None
    return total.hexdigest()


def _blocks(path: Path, names: tuple[str, ...]) -> Iterator[Array]:
    digest = _digest(path, _signature(path))
    if path.suffix == ".csv":
        yield _csv(path, digest, names)
        return
    for group in range(len(_group_sizes(path, digest))):
        yield _group(path, digest, names, group)


@lru_cache(maxsize=1)
def _csv(path: Path, digest: str, names: tuple[str, ...]) -> Array:
    import pyarrow as pa
    import pyarrow.csv

    try:
        as_text = pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=False)
        table = pyarrow.csv.read_csv(path, convert_options=as_text)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise BadInput(f"{place_of(path)}: not CSV with commas between columns: {one_line(str(error), 160)}") from None
    _require_columns(path, names, table.column_names)
    return np.column_stack([_numbers(path, name, table[name]) for name in names])


def _numbers(path: Path, name: str, column: Any) -> Array:
    import pyarrow as pa

    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)
    except pa.ArrowException:
        for row, text in enumerate(column.to_pylist(), 1):
            try:
                pa.scalar(text).cast(pa.float64())
            except pa.ArrowException:
                raise _unexpected(path, row, name, shown(text), "a number") from None
        raise


@lru_cache(maxsize=2)
def _group_sizes(path: Path, digest: str) -> tuple[int, ...]:
    about = _parquet(path).metadata
    return tuple(about.row_group(group).num_rows for group in range(about.num_row_groups))


@lru_cache(maxsize=1)
def _group(path: Path, digest: str, names: tuple[str, ...], group: int) -> Array:
    """Values (rows, columns) of a row group; empty cells are nan."""
    import pyarrow as pa

    file = _parquet(path)
    _require_columns(path, names, file.schema_arrow.names)
    for name in names:
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise BadInput(f"{place_of(path)}: column {shown(name)} of {kind}, expected numbers")
    try:
        table = file.read_row_group(group, columns=list(names), use_threads=False)
        return np.column_stack([table[name].cast(pa.float64()).to_numpy() for name in names])
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{place_of(path)}: a damaged Parquet file") from None


def _parquet(path: Path) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.ParquetFile(path)
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{place_of(path)}: not a Parquet file, or a damaged one") from None


def _require_columns(path: Path, names: Sequence[str], there: Sequence[str]) -> None:
    for name in names:
        if there.count(name) != 1:
            close = suggestion(name, set(there)) or f", found {one_line(', '.join(there), 160)}"
            state = "is there twice" if name in there else "is missing"
            raise BadInput(f"{place_of(path)}: column {shown(name)} {state}, expected one for each factor{close}")


def _require_possible(path: Path, columns: Sequence[Column], values: Array, before: int) -> None:
    """Raise BadInput at the first value (rows, columns) that no stage file can give; `before`: rows before these."""
    for index, column in enumerate(columns):
        for key in column.keys:
            bad = np.flatnonzero(~np.isfinite(values[:, index]) | keys()[key].impossible(values[:, index]))
            if len(bad):
                value = float(values[bad[0], index])
                expected = "a finite number" if not np.isfinite(value) else f"{keys()[key].expected(value)} for {key}"
                raise _unexpected(path, before + int(bad[0]) + 1, column.name, f"{value:g}", expected)


def _unexpected(path: Path, row: int, column: str, value: str, expected: str) -> BadInput:
    return BadInput(f"{place_of(path)}: row {row}, column {shown(column)} = {value}, expected {expected}")
