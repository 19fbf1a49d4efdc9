"""Table of a study: joined from its parts in the order of designs, and read again by columns."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
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
from flexfem.study.judge import judge
from flexfem.study.loaded import LoadedStudy
from flexfem.study.run import ABOUT, PARQUET, TEXTS, Parts, Survey, opened, read_part, survey

FORMATS = (".parquet", ".csv")
GROUP = 65_536  # least number of designs in a row group of Parquet
OK = "ok"
RUN_AGAIN = "flexfem study run computes these designs again"
DAMAGED = "a damaged Parquet file; flexfem study collect writes it again"


class Collected(NamedTuple):
    """A written table: its path, its number of designs, and the number of unfinished designs."""

    path: Path
    designs: int
    open: int


def collect(
    parts: Parts,
    path: Path,
    partial: bool = False,
) -> Collected:
    """Write the table of a study; the same parts give the same bytes.

    Parameters
    ----------
    path : a Parquet or CSV file.   partial : leave out unfinished designs instead of refusing them.

    Raises
    ------
    BadInput
        Designs are unfinished, a part is damaged, or the table cannot be written.
    """
    if path.suffix not in FORMATS:
        raise BadInput(f"{path}, expected a file name that ends in {' or '.join(FORMATS)}")
    found = survey(parts)
    designs = _finished(parts, found, partial)
    count = parts.loaded.count
    about = json.loads(parts.schema.metadata[ABOUT]) | {"count": count}
    metadata = {ABOUT: json.dumps(about, sort_keys=True).encode()}
    columns = _with_derived(parts.loaded, parts.schema.empty_table()).schema
    with replacing(path, ".tmp") as temporary, temporary.open("wb") as file:
        schema = columns.with_metadata(metadata)
        if path.suffix == ".csv":
            opened_writer = pyarrow.csv.CSVWriter(file, schema)
        else:
            opened_writer = pq.ParquetWriter(file, schema, **PARQUET)
        with opened_writer as writer:
            for table in _groups(parts, list(found.counts)):
                writer.write_table(table.replace_schema_metadata(metadata))
    return Collected(path, designs, count - designs)


def _finished(
    parts: Parts,
    found: Survey,
    partial: bool,
) -> int:
    """Return the number of finished designs. Raises BadInput where these cannot be collected."""
    if found.damaged:
        first, *rest = found.damaged.values()
        more = f", and {len(rest)} more such parts" if rest else ""
        raise BadInput(f"{first}{more}; {RUN_AGAIN}")
    count = parts.loaded.count
    designs = sum(map(len, found.counts))
    if designs == count or (designs and partial):
        return designs
    others = ""
    if found.stale:
        others = f"; {len(found.stale)} parts there belong to other inputs or versions"
    state = "no designs are finished"
    choice = ""
    if designs:
        state = f"{count - designs} of {count} designs are unfinished"
        choice = ", or pass --partial"
    raise BadInput(f"{parts.folder}: {state}. Run `flexfem study run`{choice}{others}")


def _groups(parts: Parts, chunks: list[range]) -> Iterator[Any]:
    """Yield the tables of all chunks in their order, some chunks together."""
    several = -(-GROUP // parts.size)
    for start in range(0, len(chunks), several):
        group = chunks[start : start + several]
        tables = [_checked(parts, chunk).replace_schema_metadata(None) for chunk in group]
        yield _with_derived(parts.loaded, pa.concat_tables(tables).combine_chunks())


def _checked(parts: Parts, chunk: range) -> Any:
    """Return the table of a part. Raises BadInput, which says what to do, where it does not match
    its seal.
    """
    try:
        return read_part(parts, chunk)
    except FileNotFoundError:
        fault = f"{parts.path(chunk)}: removed meanwhile"
    except BadInput as error:
        fault = str(error)
    raise BadInput(f"{fault}; {RUN_AGAIN}")


def _with_derived(loaded: LoadedStudy, stored: Any) -> Any:
    """Return a table of designs with the columns of derived outputs, and of feasibility under
    constraints.
    """
    names = [*(column.name for column in loaded.columns), *loaded.outputs]
    columns = {name: np.asarray(stored[name].to_numpy(), dtype=np.float64) for name in names}
    ok = np.asarray(pc.equal(stored["status"], OK).to_numpy(), dtype=bool)
    judged = judge(loaded, columns, ok)
    for name, values in judged.derived.items():
        stored = stored.append_column(name, pa.array(values, mask=np.isnan(values)))
    if loaded.study.constraint:
        stored = stored.append_column(FEASIBLE, pa.array(judged.feasible, mask=~ok))
    return stored


@dataclass(frozen=True)
class StudyTable:
    """Results of n designs: numbers of the designs (n,), ascending, and status and reason (n,) as
    texts.

    columns : factors, outputs and derived outputs by name, in file units; nan where there is no
    number. Columns of a table on disk are read at each access and not kept.
    feasible : designs that have a result and keep all constraints; None in a study without
    constraints."""

    design: Index
    status: AnyArray
    reason: AnyArray
    columns: Mapping[str, Array]
    feasible: AnyArray | None = None

    @cached_property
    def ok(self) -> AnyArray:
        """Designs with a result, bool (n,)."""
        return np.asarray(self.status == OK, dtype=bool)

    @property
    def counts(self) -> dict[str, int]:
        """Number of designs by status, the most frequent first."""
        return dict(Counter(self.status.tolist()).most_common())

    @property
    def warnings(self) -> list[str]:
        """Warnings about results, each with its number of designs."""
        return counted_warnings(Counter(self.reason[self.ok].tolist()))

    @property
    def kept(self) -> AnyArray:
        """Designs with a result that keep all constraints, bool (n,)."""
        return self.ok if self.feasible is None else self.ok & self.feasible

    @property
    def infeasible(self) -> AnyArray:
        """Designs with a result that break a constraint, bool (n,)."""
        return self.ok & ~self.kept

    @cached_property
    def round_off_sizes(self) -> dict[str, float]:
        """Reference size of each column that symmetry can make zero, by medians of other columns;
        for round-off.
        """
        references = [name for name in (*STIFFNESSES[:3], *DRIFTS) if name in self.columns]
        medians = [
            np.asarray(np.median(np.abs(values))) for values in self.with_results(*references)
        ]
        return {
            name: float(size)
            for name, size in sizes_of(dict(zip(references, medians, strict=True))).items()
        }

    def with_results(self, *names: str) -> list[Array]:
        """Return columns of the designs with a result."""
        return [
            self.columns[name] if self.ok.all() else self.columns[name][self.ok] for name in names
        ]


def counted_warnings(reasons: Counter[str]) -> list[str]:
    """Return the warnings about results, which are their reasons, each with its number of designs."""
    return [
        f"{n:,} of {reasons.total():,} designs with a result: {text}"
        for text, n in reasons.most_common()
        if text
    ]


class _Stored(dict[str, Array]):
    """Columns of a Parquet file, read at each access."""

    def __init__(
        self,
        path: Path,
        names: Iterable[str],
    ) -> None:
        super().__init__()
        self._path = path
        self._names = frozenset(names)

    def __missing__(self, name: str) -> Array:
        with opened(self._path, DAMAGED) as file:
            return np.asarray(
                file.read([name], use_threads=False)[name].to_numpy(), dtype=np.float64
            )

    def __contains__(self, name: object) -> bool:
        return name in self._names


def read_table(path: Path) -> StudyTable:
    """Read a Parquet table that `collect` wrote. Raises BadInput when it is damaged."""
    with opened(path, DAMAGED, read_dictionary=TEXTS) as file:
        names = file.schema_arrow.names
        table = file.read(
            [name for name in ("design", *TEXTS, FEASIBLE) if name in names], use_threads=False
        )
    status, reason = (table[name].unify_dictionaries().to_numpy() for name in TEXTS)
    feasible = (
        np.asarray(pc.fill_null(table[FEASIBLE], False).to_numpy(), bool)
        if FEASIBLE in names
        else None
    )
    return StudyTable(table["design"].to_numpy(), status, reason, _Stored(path, names), feasible)
