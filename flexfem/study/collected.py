"""The collected table of a study: named columns as arrays, checked as they are read."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import BadInput
from flexfem.study.derived import Judged, judge
from flexfem.study.parts import KEY
from flexfem.study.plan import FEASIBLE, RESERVED, LoadedStudy

OK = "ok"
FILE = re.compile(r"designs-\d{10,}\.parquet")  # of a table in several files, by the number of its first design


class Texts:
    """Texts (n,) of which few differ, a code for each; taken out of it they are an array of objects."""

    def __init__(self, codes: AnyArray, words: list[str]) -> None:
        self.codes, self.words = codes, words

    def __len__(self) -> int:
        return len(self.codes)

    def __getitem__(self, place: Any) -> Any:
        return np.array(self.words, dtype=object)[self.codes[place]]

    def __eq__(self, other: object) -> AnyArray:  # type: ignore[override]
        if other not in self.words:
            return np.zeros(len(self.codes), dtype=bool)
        return np.asarray(self.codes == self.words.index(other))

    __hash__ = None  # type: ignore[assignment]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> AnyArray:
        return np.asarray(self[:])

    def tolist(self) -> list[str]:
        """All of them."""
        return list(self[:])


class StudyTable(NamedTuple):
    """What was answered, design after design.

    design : (n,), numbers of the designs, ascending.   status, reason : (n,), text.
    columns : factors in file units, outputs and derived outputs, (n,) each, by name; the latter two are nan where the
        status is not ok.
    feasible : (n,), which designs have an answer and keep all constraints; None in a study without constraints.

    Columns of a table on disk are read when they are asked for, and not kept.
    """

    design: Index
    status: AnyArray | Texts
    reason: AnyArray | Texts
    columns: Mapping[str, Array]
    feasible: AnyArray | None = None

    @property
    def ok(self) -> AnyArray:
        """Which designs have an answer, bool (n,)."""
        return np.asarray(self.status == OK)

    @property
    def counts(self) -> dict[str, int]:
        """How many designs have each status, the most frequent first."""
        if isinstance(self.status, Texts):
            numbers = np.bincount(self.status.codes, minlength=len(self.status.words)).tolist()
            found = Counter({word: n for word, n in zip(self.status.words, numbers, strict=True) if n})
            return dict(found.most_common())
        return dict(Counter(self.status.tolist()).most_common())

    @property
    def unanswered(self) -> dict[str, AnyArray]:
        """Which designs, bool (n,), have no answer, by status, the most frequent first."""
        return {status: np.asarray(self.status == status) for status in self.counts if status != OK}

    @property
    def doubts(self) -> dict[str, int]:
        """How many designs have an answer with something to know of it, by what it is."""
        if isinstance(self.reason, Texts):
            numbers = np.bincount(self.reason.codes[self.ok], minlength=len(self.reason.words)).tolist()
            found = Counter({word: n for word, n in zip(self.reason.words, numbers, strict=True) if n and word})
        else:
            found = Counter(reason for reason in self.reason[self.ok].tolist() if reason)
        return dict(found.most_common())

    @property
    def warnings(self) -> list[str]:
        """What is to be known of some of the answers, a sentence each."""
        return counted_doubts(self.doubts, int(self.ok.sum()))

    @property
    def infeasible(self) -> AnyArray:
        """Which designs, bool (n,), have an answer but break a constraint."""
        return np.zeros(len(self.design), dtype=bool) if self.feasible is None else self.ok & ~self.feasible

    @property
    def considered(self) -> StudyTable:
        """The table without the designs that break a constraint."""
        keep = ~self.infeasible
        if keep.all():
            return self._replace(feasible=None)
        status, reason = (
            Texts(texts.codes[keep], texts.words) if isinstance(texts, Texts) else texts[keep]
            for texts in (self.status, self.reason)
        )
        return StudyTable(self.design[keep], status, reason, SomeRows(self.columns, keep))

    def answered(self, *names: str) -> list[Array]:
        """Columns of the designs that have an answer."""
        ok = self.ok
        return [self.columns[name] if ok.all() else self.columns[name][ok] for name in names]


def counted_doubts(reasons: Mapping[str, int], ok: int) -> list[str]:
    """Warnings on the designs with an answer, by what stands as their reason, and how many."""
    return [f"{n:,} of {ok:,} designs with an answer: {reason}" for reason, n in reasons.items() if reason]


class Stored(Mapping[str, Array]):
    """Columns of a table on disk by name, read from its files when they are asked for; derived ones made then.

    `order` sorts the rows by their design, None where they are sorted.
    """

    def __init__(self, loaded: LoadedStudy, files: list[Path], order: Index | None = None) -> None:
        self._loaded, self._files, self._order = loaded, files, order
        self._stored, self._rows = names_of(loaded), sum(pq.read_metadata(file).num_rows for file in files)
        self._derived = tuple(output.name for output in loaded.study.output)

    def __getitem__(self, name: str) -> Array:
        if name in self._derived:
            return self._joined(judged.derived[name] for judged in self._judged())
        if name not in self._stored:
            raise KeyError(name)
        return self._joined(_column(file, name).to_numpy() for file in self._files)

    def __iter__(self) -> Iterator[str]:
        return iter((*self._stored, *self._derived))

    def __len__(self) -> int:
        return len(self._stored) + len(self._derived)

    @property
    def feasible(self) -> AnyArray:
        """Which designs, bool (n,), have an answer and keep all constraints."""
        return self._joined(judged.feasible for judged in self._judged()) > 0

    def _judged(self) -> Iterator[Judged]:
        plain = replace(self._loaded, study=self._loaded.study.model_copy(update={"output": (), "constraint": ()}))
        for file in self._files:
            ok = _texts([_column(file, "status")], None) == OK
            yield judge(self._loaded, Stored(plain, [file]), ok)

    def _joined(self, pieces: Iterable[AnyArray]) -> Array:
        values, filled = np.empty(self._rows), 0
        for piece in pieces:
            values[filled : filled + len(piece)] = piece
            filled += len(piece)
        return values if self._order is None else values[self._order]


class SomeRows(Mapping[str, Array]):
    """Some rows, bool (n,), of columns by name."""

    def __init__(self, columns: Mapping[str, Array], keep: AnyArray) -> None:
        self._columns, self._keep = columns, keep

    def __getitem__(self, name: str) -> Array:
        return self._columns[name][self._keep]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)


def files_of(path: Path) -> list[Path]:
    """The Parquet files of a table, in the order of its designs."""
    return sorted(each for each in path.iterdir() if FILE.fullmatch(each.name)) if path.is_dir() else [path]


def names_of(loaded: LoadedStudy) -> tuple[str, ...]:
    """Columns of a part after the reserved ones."""
    return (*(column.name for column in loaded.columns), *loaded.outputs)


def read_table(path: Path, loaded: LoadedStudy) -> StudyTable:
    """Read the collected table of a study, a file or the folder of a data set: its columns when they are asked for.

    Raises
    ------
    BadInput
        The file is missing, not Parquet, not a table of flexfem, or of another study than the one loaded.
    """
    names, files = names_of(loaded), files_of(path)
    for file in files:
        schema = _schema(file, loaded)
        _require_same_study(file, _metadata(file, schema), loaded)
        if lost := [name for name in (*RESERVED, *names) if name not in schema.names]:
            raise BadInput(f"{file}: no column {lost[0]}, expected the collected table of {loaded.path}")
    if not files:
        raise BadInput(f"{path}: an empty folder, expected the collected table of {loaded.path}")
    design = np.concatenate([_column(file, "design").to_numpy() for file in files], dtype=np.int64)
    order = None if np.all(design[1:] > design[:-1]) else np.argsort(design, kind="stable")
    status, reason = (_texts([_column(file, name) for file in files], order) for name in ("status", "reason"))
    columns = Stored(loaded, files, order)
    feasible = columns.feasible if loaded.study.constraint else None
    return StudyTable(design if order is None else design[order], status, reason, columns, feasible)


def _schema(path: Path, loaded: LoadedStudy) -> Any:
    try:
        with path.open("rb") as content:  # pyarrow takes no name that is not UTF-8
            return pq.read_schema(content)
    except (OSError, pa.ArrowException) as error:
        missing = isinstance(error, FileNotFoundError)
        reason = "no such file" if missing else "not a Parquet file, or a damaged one"
        raise BadInput(f"{path}: {reason}, expected the collected table of {loaded.path}") from None


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


def _column(path: Path, name: str) -> Any:
    """One column of a file, its texts as codes. Raises BadInput when it is damaged: every page has a checksum."""
    try:
        with (
            path.open("rb") as content,
            pq.ParquetFile(content, page_checksum_verification=True, read_dictionary=["status", "reason"]) as file,
        ):
            return file.read(columns=[name], use_threads=False)[name]
    except (OSError, ValueError, pa.ArrowException):
        raise BadInput(f"{path}: a damaged Parquet file; flexfem study collect writes it again") from None


def _texts(columns: list[Any], order: Index | None) -> Texts:
    """A column of texts, in pieces, as codes into the words of all pieces."""
    words: dict[str, int] = {}
    codes = list[AnyArray]()
    for chunk in (chunk for column in columns for chunk in column.chunks):
        chunk = chunk if pa.types.is_dictionary(chunk.type) else chunk.dictionary_encode()
        places = [words.setdefault(word or "", len(words)) for word in chunk.dictionary.to_pylist()]
        places.append(words.setdefault("", len(words)))
        codes.append(np.array(places, dtype=np.int32)[chunk.indices.fill_null(-1).to_numpy(zero_copy_only=False)])
    found = np.concatenate([np.empty(0, dtype=np.int32), *codes])
    return Texts(found if order is None else found[order], list(words))


def _metadata(path: Path, schema: Any) -> dict[str, Any]:
    try:
        found = json.loads((schema.metadata or {})[KEY])
    except (KeyError, ValueError, RecursionError):
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
