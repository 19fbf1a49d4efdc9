"""Join the parts of a study to one table, design after design, one part in memory at a time."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from flexfem.files.inputs import require_unread
from flexfem.files.writing import replacing
from flexfem.refused import BadInput
from flexfem.study.collected import FILE
from flexfem.study.content import read_part
from flexfem.study.designs import judge
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import FEASIBLE
from flexfem.study.parts import PARQUET, Chunk, Parts, listed, sweep
from flexfem.study.study_table import OK

FORMATS = (".parquet", ".csv")
GROUP = 65_536  # least designs a row group of Parquet
SPLIT = 2**20  # designs a file of a data set, about
LARGE = 2**22  # designs, beyond which the table is a data set when nobody says


class Collected(NamedTuple):
    """A table written: where, how many designs are in it, and how many are open."""

    path: Path
    designs: int
    open: int


def table_path(parts: Parts, partitioned: bool = False) -> Path:
    """Where the table of a study goes when nobody says: a file, or the folder of a data set."""
    split = partitioned or parts.loaded.count > LARGE
    return parts.folder.parent / (f"{parts.loaded.stem}-table" if split else f"{parts.loaded.stem}.parquet")


def check_target(path: Path, partitioned: bool = False) -> Path:
    """Raise BadInput when a table cannot be written under that name: a file by its format, a data set by a folder."""
    if partitioned:
        if path.suffix in FORMATS:
            raise BadInput(f"{path}, expected the name of a folder, without {path.suffix}, for a partitioned table")
        _require_replaceable(path)
    elif path.suffix not in FORMATS:
        raise BadInput(f"{path}, expected a file name that ends in {' or '.join(FORMATS)}")
    return path


def collect(parts: Parts, path: Path, partial: bool = False) -> Collected:
    """Write the table of a study; the same parts give the same bytes.

    Parameters
    ----------
    path : a file, Parquet or CSV, or the folder of a data set, a Parquet file for every `SPLIT` designs or so.
    partial : leave out designs that are open instead of refusing.

    Raises BadInput when designs are open, a part is damaged, or the table cannot be written.
    """
    chunks, foreign = listed(parts)
    open_designs = parts.loaded.count - sum(chunk.stop - chunk.start for chunk in chunks)
    if open_designs == parts.loaded.count or (open_designs and not partial):
        others = f"; {len(foreign)} files there are of other inputs or versions" if foreign else ""
        raise BadInput(
            f"{parts.folder}: {open_designs} of {parts.loaded.count} designs are open, expected "
            f"{'some' if partial else 'all, or --partial'} to be done by flexfem study run{others}"
        )
    sweep(path.parent, path.stem)
    if path.suffix in FORMATS:
        written = _write_file(parts, chunks, path)
    else:
        with _replacing_folder(check_target(path, partitioned=True)) as folder:
            written = sum(_write_file(parts, some, folder / name) for name, some in _split(parts, chunks))
    return Collected(path, written, parts.loaded.count - written)


def _split(parts: Parts, chunks: list[Chunk]) -> Iterator[tuple[str, list[Chunk]]]:
    """Chunks by the file of a data set that they go to, which does not depend on what else is there."""
    together = max(SPLIT // parts.size, 1)
    files: dict[int, list[Chunk]] = {}
    for chunk in chunks:
        files.setdefault(chunk.number // together, []).append(chunk)
    for number, some in files.items():
        yield f"designs-{number * together * parts.size:010d}.parquet", some


def _write_file(parts: Parts, chunks: list[Chunk], path: Path) -> int:
    """Write the rows of chunks to a file; returns how many there are."""
    written = 0
    with (
        replacing(path, ".tmp") as temporary,
        temporary.open("wb") as file,
        _writer(parts, file, path.suffix) as writer,
    ):
        for table in _groups(parts, chunks):
            writer.write_table(with_derived(parts.loaded, table))
            written += len(table)
    return written


def _groups(parts: Parts, chunks: list[Chunk]) -> Iterator[Any]:
    """The tables of the parts that are there, small ones joined."""
    held, designs = list[Any](), 0
    for chunk in chunks:
        try:
            held.append(read_part(parts, chunk).replace_schema_metadata(parts.table_schema.metadata))
        except FileNotFoundError:
            raise BadInput(f"{parts.path(chunk)}: removed meanwhile, expected to stay while it is collected") from None
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


@contextmanager
def _replacing_folder(path: Path) -> Iterator[Path]:
    """Yield a new folder that takes the place of `path` when all went well; an earlier data set there goes then."""
    temporary = path.parent / f".{path.name}-{secrets.token_hex(4)}.tmp"
    earlier = path.parent / f".{path.name}-{secrets.token_hex(4)}.tmp"
    try:
        temporary.mkdir(parents=True)
        yield temporary
        _require_replaceable(path)
        if path.exists():
            path.rename(earlier)
        temporary.rename(path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        for folder in (temporary, earlier):
            shutil.rmtree(folder, ignore_errors=True)


def _require_replaceable(path: Path) -> None:
    """Raise BadInput when something is there that is no data set of ours."""
    if not os.path.lexists(path):
        return
    ours = path.is_dir() and not path.is_symlink() and all(FILE.fullmatch(each.name) for each in path.iterdir())
    if not ours:
        raise BadInput(f"{path}: not a table that flexfem study collect wrote, expected a new folder")
    require_unread(*path.iterdir())


def with_derived(loaded: LoadedStudy, stored: Any) -> Any:
    """An Arrow table of designs with columns for the derived outputs, and for whether all constraints are kept."""
    names = [*(column.name for column in loaded.columns), *loaded.outputs]
    columns = {name: np.asarray(stored[name].to_numpy(), dtype=np.float64) for name in names}
    ok = np.asarray(pc.equal(stored["status"], OK).to_numpy(), dtype=bool)
    found = judge(loaded, columns, ok)
    added = {name: pa.array(values, mask=np.isnan(values)) for name, values in found.derived.items()}
    if loaded.study.constraint:
        added[FEASIBLE] = pa.array(found.feasible, mask=~ok)
    for name, values in added.items():
        stored = stored.append_column(name, values)
    return stored


def with_derived_fields(loaded: LoadedStudy, schema: Any) -> Any:
    """The schema of `with_derived`, from that of the parts."""
    for output in loaded.study.output:
        schema = schema.append(pa.field(output.name, pa.float64()))
    return schema.append(pa.field(FEASIBLE, pa.bool_())) if loaded.study.constraint else schema
