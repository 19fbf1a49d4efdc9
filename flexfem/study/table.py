"""The collected table of a study: named columns as arrays, read with suspicion."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from flexfem.arrays import AnyArray, Array, Index
from flexfem.errors import BadInput
from flexfem.study.derived import judge
from flexfem.study.parts import KEY
from flexfem.study.plan import FEASIBLE, RESERVED, LoadedStudy

OK = "ok"


class StudyTable(NamedTuple):
    """What was answered, design after design.

    design : (n,), numbers of the designs, ascending.   status, reason : (n,), text.
    columns : factors in file units, outputs and derived outputs, (n,) each, by name; the latter two are nan where the
        status is not ok.
    feasible : (n,), which designs have an answer and keep all constraints; None in a study without constraints.
    """

    design: Index
    status: AnyArray
    reason: AnyArray
    columns: Mapping[str, Array]
    feasible: AnyArray | None = None

    @property
    def ok(self) -> AnyArray:
        """Which designs have an answer, bool (n,)."""
        return np.asarray(self.status == OK)

    @property
    def counts(self) -> dict[str, int]:
        """How many designs have each status, the most frequent first."""
        return dict(Counter(self.status.tolist()).most_common())

    @property
    def unanswered(self) -> dict[str, AnyArray]:
        """Which designs, bool (n,), have no answer, by status, the most frequent first."""
        return {status: np.asarray(self.status == status) for status in self.counts if status != OK}

    @property
    def infeasible(self) -> AnyArray:
        """Which designs, bool (n,), have an answer but break a constraint."""
        return np.zeros(len(self.design), dtype=bool) if self.feasible is None else self.ok & ~self.feasible

    @property
    def considered(self) -> StudyTable:
        """The table without the designs that break a constraint."""
        keep = ~self.infeasible
        columns = {name: values[keep] for name, values in self.columns.items()}
        return StudyTable(self.design[keep], self.status[keep], self.reason[keep], columns)

    def answered(self, *names: str) -> list[Array]:
        """Columns of the designs that have an answer."""
        ok = self.ok
        return [self.columns[name][ok] for name in names]


def read_table(path: Path, loaded: LoadedStudy) -> StudyTable:
    """Read the collected table of a study.

    Raises
    ------
    BadInput
        The file is missing, not Parquet, not a table of flexfem, or of another study than the one loaded.
    """
    try:
        stored = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        missing = isinstance(error, FileNotFoundError)
        reason = "no such file" if missing else "not a Parquet file, or a damaged one"
        raise BadInput(f"{path}: {reason}, expected the collected table of {loaded.path}") from None
    _require_same_study(path, _metadata(path, stored), loaded)
    names = [*RESERVED, *(column.name for column in loaded.columns), *loaded.outputs]
    if lost := [name for name in names if name not in stored.column_names]:
        raise BadInput(f"{path}: no column {lost[0]}, expected the collected table of {loaded.path}")
    stored = stored.sort_by("design")
    columns = {name: np.asarray(stored[name].to_numpy(), dtype=np.float64) for name in names[len(RESERVED) :]}
    design = np.asarray(stored["design"].to_numpy(), dtype=np.int64)
    table = StudyTable(design, _text(stored["status"]), _text(stored["reason"]), columns)
    found = judge(loaded, columns, table.ok)
    feasible = found.feasible if loaded.study.constraint else None
    return table._replace(columns=columns | found.derived, feasible=feasible)


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


def _metadata(path: Path, stored: Any) -> dict[str, Any]:
    try:
        found = json.loads((stored.schema.metadata or {})[KEY])
    except (KeyError, ValueError):
        found = None
    if not isinstance(found, dict) or "hash" not in found:
        raise BadInput(f"{path}: a Parquet file of something else, expected one that flexfem study collect wrote")
    return found


def _require_same_study(path: Path, found: Mapping[str, Any], loaded: LoadedStudy) -> None:
    if found["hash"] != loaded.hash:
        raise BadInput(
            f"{path}: results of {found.get('stem', 'a study')} with hash {str(found['hash'])[:8]}, expected "
            f"{loaded.hash[:8]} of {loaded.path}: the study has changed since, or it is another one"
        )

    if found.get("count") != loaded.count:
        raise BadInput(
            f"{path}: a table of {found.get('count')} designs, expected {loaded.count} as {loaded.path} says"
        )


def _text(column: Any) -> AnyArray:
    """Strings as an array of objects, equal ones shared: a million reasons are few different ones."""
    coded = column.combine_chunks().dictionary_encode()
    words: AnyArray = np.array([*coded.dictionary.to_pylist(), ""], dtype=object)
    return np.asarray(words[coded.indices.fill_null(-1).to_numpy()])
