"""The table of a study: parts joined design after design, and read again column by column."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from flexfem.arrays import AnyArray, Array, Index
from flexfem.files.writing import replacing
from flexfem.refused import BadInput
from flexfem.study.columns import DRIFTS, FEASIBLE, STIFFNESSES, sizes_of
from flexfem.study.loaded import LoadedStudy, judge
from flexfem.study.run import ABOUT, PARQUET, READING, TEXTS, Parts, read_part, survey

FORMATS = (".parquet", ".csv")
GROUP = 65_536  # least designs a row group of Parquet
OK = "ok"


class Collected(NamedTuple):
    """A table written: where, how many designs are in it, and how many are open."""

    path: Path
    designs: int
    open: int


def table_path(parts: Parts) -> Path:
    """Where the table of a study goes when nobody says."""
    return parts.folder.parent / f"{parts.loaded.stem}.parquet"


def collect(parts: Parts, path: Path, partial: bool = False) -> Collected:
    """Write the table of a study; the same parts give the same bytes.

    Parameters
    ----------
    path : a file, Parquet or CSV.   partial : leave out designs that are open instead of refusing.

    Raises
    ------
    BadInput
        Designs are open, a part is damaged, or the table cannot be written.
    """
    if path.suffix not in FORMATS:
        raise BadInput(f"{path}, expected a file name that ends in {' or '.join(FORMATS)}")
    found, loaded = survey(parts), parts.loaded
    if found.damaged:
        raise BadInput(f"{parts.path(found.damaged[0])}: a damaged part; flexfem study run computes it again")
    designs = sum(map(len, found.counts))
    if designs == 0 or (designs < loaded.count and not partial):
        others = f"; {len(found.stale)} parts there are of other inputs or versions" if found.stale else ""
        expected = f"expected {'some' if partial else 'all, or --partial'} to be done by flexfem study run{others}"
        raise BadInput(f"{parts.folder}: {loaded.count - designs} of {loaded.count} designs are open, {expected}")
    about = json.loads(parts.schema.metadata[ABOUT]) | {"count": loaded.count}
    metadata = {ABOUT: json.dumps(about, sort_keys=True).encode()}
    schema = _with_derived(loaded, parts.schema.empty_table()).schema.with_metadata(metadata)
    with replacing(path, ".tmp") as temporary, temporary.open("wb") as file:
        csv = path.suffix == ".csv"
        with pyarrow.csv.CSVWriter(file, schema) if csv else pq.ParquetWriter(file, schema, **PARQUET) as writer:
            for group in _groups(parts, list(found.counts)):
                writer.write_table(_with_derived(loaded, group).replace_schema_metadata(metadata))
    return Collected(path, designs, loaded.count - designs)


def _groups(parts: Parts, chunks: list[range]) -> Iterator[Any]:
    """The tables of parts, small ones joined."""
    held, designs = list[Any](), 0
    for chunk in chunks:
        try:
            held.append(read_part(parts.path(chunk)).replace_schema_metadata(None))
        except FileNotFoundError:
            raise BadInput(f"{parts.path(chunk)}: removed meanwhile, expected to stay while it is collected") from None
        designs += len(held[-1])
        if designs >= GROUP or chunk == chunks[-1]:
            yield pa.concat_tables(held).combine_chunks()
            held, designs = [], 0


def _with_derived(loaded: LoadedStudy, stored: Any) -> Any:
    """A table of designs with columns for the derived outputs, and for whether all constraints are kept."""
    names = [*(column.name for column in loaded.columns), *loaded.outputs]
    columns = {name: np.asarray(stored[name].to_numpy(), dtype=np.float64) for name in names}
    ok = np.asarray(pc.equal(stored["status"], OK).to_numpy(), dtype=bool)
    found = judge(loaded, columns, ok)
    for name, values in found.derived.items():
        stored = stored.append_column(name, pa.array(values, mask=np.isnan(values)))
    if loaded.study.constraint:
        stored = stored.append_column(FEASIBLE, pa.array(found.feasible, mask=~ok))
    return stored


@dataclass(frozen=True)
class StudyTable:
    """What was answered, design after design (n,): numbers of the designs, ascending, and texts.

    columns : factors, outputs and derived outputs by name, in file units; nan where there is no number. Those of a
    table on disk are read when they are asked for, and not kept.
    feasible : designs that have an answer and keep all constraints; None in a study without constraints.
    """

    design: Index
    status: AnyArray
    reason: AnyArray
    columns: Mapping[str, Array]
    feasible: AnyArray | None = None

    @cached_property
    def ok(self) -> AnyArray:
        """Designs that have an answer, bool (n,)."""
        return np.asarray(self.status == OK, dtype=bool)

    @property
    def counts(self) -> dict[str, int]:
        """How many designs have each status, the most frequent first."""
        return dict(Counter(self.status.tolist()).most_common())

    @property
    def warnings(self) -> list[str]:
        """What there is to know of some of the answers, a sentence each."""
        return counted_warnings(Counter(self.reason[self.ok].tolist()))

    @property
    def kept(self) -> AnyArray:
        """Designs that have an answer and keep all constraints, bool (n,)."""
        return self.ok if self.feasible is None else self.ok & self.feasible

    @property
    def infeasible(self) -> AnyArray:
        """Designs that have an answer but break a constraint, bool (n,)."""
        return self.ok & ~self.kept

    @cached_property
    def round_off_sizes(self) -> dict[str, float]:
        """Beside which size numbers of columns that symmetry can make zero are round-off, by medians of the others."""
        beside = [name for name in (*STIFFNESSES[:3], *DRIFTS) if name in self.columns]
        medians = [np.asarray(np.median(np.abs(values))) for values in self.with_answer(*beside)]
        return {name: float(size) for name, size in sizes_of(dict(zip(beside, medians, strict=True))).items()}

    def with_answer(self, *names: str) -> list[Array]:
        """Columns of the designs that have an answer."""
        return [self.columns[name] if self.ok.all() else self.columns[name][self.ok] for name in names]


def counted_warnings(reasons: Counter[str]) -> list[str]:
    """Warnings on the designs with an answer, by what stands as their reason, and how many."""
    return [f"{n:,} of {reasons.total():,} designs with an answer: {text}" for text, n in reasons.most_common() if text]


class _Stored(dict[str, Array]):
    """Columns of a Parquet file, read when they are asked for."""

    def __init__(self, path: Path, names: Iterable[str]) -> None:
        super().__init__()
        self._path, self._names = path, frozenset(names)

    def __missing__(self, name: str) -> Array:
        with _opened(self._path) as file:
            return np.asarray(file.read([name], use_threads=False)[name].to_numpy(), dtype=np.float64)

    def __contains__(self, name: object) -> bool:
        return name in self._names


def read_table(path: Path) -> StudyTable:
    """Read a Parquet table that `collect` wrote. Raises BadInput when it is damaged."""
    with _opened(path) as file:
        names = file.schema_arrow.names
        found = file.read([name for name in ("design", *TEXTS, FEASIBLE) if name in names], use_threads=False)
    texts = list[AnyArray]()
    for name in TEXTS:
        column = found[name].unify_dictionaries().combine_chunks()
        texts.append(np.array(column.dictionary.to_pylist(), dtype=object)[column.indices.to_numpy()])
    feasible = None
    if FEASIBLE in names:
        feasible = np.asarray(pc.fill_null(found[FEASIBLE], False).to_numpy(), dtype=bool)
    status, reason = texts
    return StudyTable(found["design"].to_numpy(), status, reason, _Stored(path, names), feasible)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A Parquet file to read from, opened here: pyarrow takes no name that is not UTF-8."""
    try:
        with (
            path.open("rb") as content,
            pq.ParquetFile(content, read_dictionary=TEXTS, **READING) as file,
        ):
            yield file
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{path}: a damaged Parquet file; flexfem study collect writes it again") from None
