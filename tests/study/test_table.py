"""The collected table, and files that are not it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from flexfem.errors import BadInput
from flexfem.study.answer import Rows
from flexfem.study.parts import parts_of, table_of
from flexfem.study.plan import LoadedStudy
from flexfem.study.sampling import sample
from flexfem.study.table import read_table

COUNT = 500


def rows(loaded: LoadedStudy) -> Rows:
    values = np.random.default_rng(8).normal(size=(COUNT, len(loaded.outputs)))
    status, reason = np.full(COUNT, "ok", dtype=object), np.full(COUNT, "", dtype=object)
    status[3:7], reason[3:7] = "refused", "neck_mm = 9, expected less"
    status[11], reason[11] = "time limit", "more than 60 s"
    values[status != "ok"] = np.nan
    return Rows(status, reason, values)


def written(loaded: LoadedStudy, path: Path, order: np.ndarray | None = None) -> Path:
    parts = parts_of(loaded, path.parent, COUNT)
    table = table_of(parts, parts.chunk(0), rows(loaded)).replace_schema_metadata(parts.table_schema.metadata)
    pq.write_table(table if order is None else table.take(order), path)
    return path


def test_what_was_answered_is_what_is_read(studies, tmp_path: Path) -> None:
    loaded = studies.load()
    shuffled = np.random.default_rng(2).permutation(COUNT)
    table, given = read_table(written(loaded, tmp_path / "t.parquet", shuffled), loaded), rows(loaded)
    np.testing.assert_array_equal(table.design, np.arange(COUNT))
    np.testing.assert_array_equal(table.status, given.status)
    np.testing.assert_array_equal(table.reason, given.reason)
    for k, column in enumerate(loaded.columns):
        np.testing.assert_array_equal(table.columns[column.name], sample(loaded, 0, COUNT)[:, k])
    for k, name in enumerate(loaded.outputs):
        np.testing.assert_array_equal(table.columns[name], given.values[:, k])
    assert table.counts == {"ok": COUNT - 5, "refused": 4, "time limit": 1}
    (answered,) = table.answered("envelope_mm")
    assert len(answered) == COUNT - 5 and np.isfinite(answered).all()


def test_a_table_without_a_single_answer_can_be_read(studies, tmp_path: Path) -> None:
    loaded = studies.load()
    parts = parts_of(loaded, tmp_path, COUNT)
    nothing = Rows(
        np.full(COUNT, "refused", dtype=object),
        np.full(COUNT, "no", dtype=object),
        np.full((COUNT, len(loaded.outputs)), np.nan),
    )
    table = table_of(parts, parts.chunk(0), nothing).replace_schema_metadata(parts.table_schema.metadata)
    pq.write_table(table, tmp_path / "t.parquet")
    table = read_table(tmp_path / "t.parquet", loaded)
    assert not table.ok.any() and np.isnan(table.columns["envelope_mm"]).all()


def test_the_table_of_another_study_is_refused(studies, tmp_path: Path) -> None:
    path = written(studies.load(), tmp_path / "t.parquet")
    with pytest.raises(BadInput, match=r"t\.parquet: results of study with hash .*the study has changed since"):
        read_table(path, studies.load(("to = 0.7", "to = 0.8")))


def test_a_new_title_does_not_make_it_another_study(studies, tmp_path: Path) -> None:
    path = written(studies.load(), tmp_path / "t.parquet")
    assert len(read_table(path, studies.load(('"generic study"', '"renamed"'))).design) == COUNT


def spoilt(path: Path, how: str) -> None:
    if how == "missing":
        path.unlink()
    elif how == "text":
        path.write_text("design,status\n1,ok\n")
    elif how == "cut short":
        path.write_bytes(path.read_bytes()[:-700])
    elif how == "of something else":
        pq.write_table(pq.read_table(path).replace_schema_metadata({}), path)
    elif how == "strange metadata":
        pq.write_table(pq.read_table(path).replace_schema_metadata({"flexfem.study": "[1"}), path)
    else:
        pq.write_table(pq.read_table(path).drop_columns(["envelope_mm"]), path)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("missing", "no such file"),
        ("text", "not a Parquet file"),
        ("cut short", "not a Parquet file"),
        ("of something else", "a Parquet file of something else"),
        ("strange metadata", "a Parquet file of something else"),
        ("a column less", "no column envelope_mm"),
    ],
)
def test_what_is_no_table_is_refused_in_one_line(studies, tmp_path: Path, how: str, said: str) -> None:
    loaded = studies.load()
    path = written(loaded, tmp_path / "t.parquet")
    spoilt(path, how)
    with pytest.raises(BadInput) as refusal:
        read_table(path, loaded)
    assert str(refusal.value).startswith(f"{path}: {said}") and "\n" not in str(refusal.value)
