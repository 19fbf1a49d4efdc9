"""The collected table of a study: named columns as arrays, read with suspicion."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.arrays import AnyArray, Array, Index
from flexfem.errors import BadInput
from flexfem.study.parts import KEY
from flexfem.study.plan import RESERVED, LoadedStudy

OK = "ok"


class StudyTable(NamedTuple):
    """What was answered, design after design.

    design : (n,), numbers of the designs, ascending.   status, reason : (n,), text.
    columns : factors in file units and outputs, (n,) each, by name; outputs are nan where the status is not ok.
    """

    design: Index
    status: AnyArray
    reason: AnyArray
    columns: Mapping[str, Array]

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
    return StudyTable(design, _text(stored["status"]), _text(stored["reason"]), columns)


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
