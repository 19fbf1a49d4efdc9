"""The collected table of a study on disk: its columns as arrays, checked as they are read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.arrays import AnyArray, Array, Index
from flexfem.refused import BadInput
from flexfem.study.designs import Judged, judge
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import RESERVED
from flexfem.study.parts import about_of
from flexfem.study.study_table import OK, StudyTable, Texts

FILE = re.compile(r"designs-\d{10,}\.parquet")  # of a table in several files, by the number of its first design


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
    found = about_of(schema.metadata)
    if "hash" not in found:
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
