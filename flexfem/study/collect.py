"""Join the parts of a study to one table, design after design, one part in memory at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from flexfem.errors import BadInput
from flexfem.files import replacing
from flexfem.study.parts import PARQUET, Chunk, Parts, read_part, sweep
from flexfem.study.status import listed
from flexfem.study.table import with_derived, with_derived_fields

FORMATS = (".parquet", ".csv")
GROUP = 65_536  # least designs a row group of Parquet


class Collected(NamedTuple):
    """A table written: where, how many designs are in it, and how many are open."""

    path: Path
    designs: int
    open: int


def table_path(parts: Parts) -> Path:
    """Where the table of a study goes when nobody says."""
    return parts.folder.parent / f"{parts.loaded.stem}.parquet"


def check_target(path: Path) -> Path:
    """Raise BadInput when a table cannot be written in the format of that name."""
    if path.suffix not in FORMATS:
        raise BadInput(f"{path}, expected a file name that ends in {' or '.join(FORMATS)}")
    return path


def collect(parts: Parts, path: Path, partial: bool = False) -> Collected:
    """Write the table of a study, Parquet or CSV; the same parts give the same bytes.

    Parameters
    ----------
    partial : leave out designs that are open instead of refusing.

    Raises BadInput when designs are open, a part is damaged, or the table cannot be written.
    """
    open_designs = sum(chunk.stop - chunk.start for chunk in _chunks(parts) if not parts.path(chunk).exists())
    if open_designs == parts.loaded.count or (open_designs and not partial):
        foreign = len(listed(parts)[1])
        others = f"; {foreign} files there are of other inputs or versions" if foreign else ""
        raise BadInput(
            f"{parts.folder}: {open_designs} of {parts.loaded.count} designs are open, expected "
            f"{'some' if partial else 'all, or --partial'} to be done by flexfem study run{others}"
        )
    written = 0
    sweep(path.parent, path.stem)
    with (
        replacing(check_target(path), ".tmp") as temporary,
        temporary.open("wb") as file,
        _writer(parts, file, path.suffix) as writer,
    ):
        for table in _groups(parts):
            writer.write_table(with_derived(parts.loaded, table))
            written += len(table)
    return Collected(path, written, parts.loaded.count - written)


def _chunks(parts: Parts) -> Iterator[Chunk]:
    return map(parts.chunk, range(parts.count))


def _groups(parts: Parts) -> Iterator[Any]:
    """The tables of the parts that are there, small ones joined."""
    held, designs = list[Any](), 0
    for chunk in _chunks(parts):
        if parts.path(chunk).exists():
            held.append(read_part(parts, chunk).replace_schema_metadata(parts.table_schema.metadata))
            designs += len(held[-1])
        if designs >= GROUP:
            yield pa.concat_tables(held).combine_chunks()
            held, designs = [], 0
    if held:
        yield pa.concat_tables(held).combine_chunks()


def _writer(parts: Parts, file: BinaryIO, suffix: str) -> Any:
    schema = with_derived_fields(parts.loaded, parts.table_schema)
    if suffix == ".csv":
        return pyarrow.csv.CSVWriter(file, schema)
    return pq.ParquetWriter(file, schema, **PARQUET)
