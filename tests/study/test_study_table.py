"""The collected table, and files that are not it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from flexfem.refused import BadInput
from flexfem.study.collect import check_target, collect, table_path
from flexfem.study.collected import read_table
from flexfem.study.content import table_of, write_part
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import Rows
from flexfem.study.parts import PARQUET, Parts, parts_of
from flexfem.study.sampling import sample

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


def joined(studies, monkeypatch, count: int = COUNT) -> Parts:
    """The parts of a study, and tables split into files of 100 designs."""
    monkeypatch.setattr("flexfem.study.collect.SPLIT", 100)
    loaded = studies.load(("designs = 500", f"designs = {count}"))
    parts, given = parts_of(loaded, studies.folder, 50), rows(loaded)
    for chunk in map(parts.chunk, range(parts.count)):
        write_part(parts, chunk, Rows(*(each[chunk.start : chunk.stop] for each in given)))
    return parts


def test_a_data_set_is_the_table_in_files(studies, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other programs read the folder as one table, and so do we; the same parts give the same bytes."""
    parts = joined(studies, monkeypatch)
    plain, split = collect(parts, tmp_path / "t.parquet"), collect(parts, tmp_path / "t")
    assert sorted(path.name for path in split.path.iterdir()) == [f"designs-0000000{k}00.parquet" for k in range(5)]
    assert pq.read_table(split.path).equals(pq.read_table(plain.path)) and split.designs == COUNT
    one, other = (read_table(made.path, parts.loaded) for made in (plain, split))
    for name in one.columns:
        np.testing.assert_array_equal(one.columns[name], other.columns[name])
    assert one.counts == other.counts == {"ok": COUNT - 5, "refused": 4, "time limit": 1}
    np.testing.assert_array_equal(one.reason, other.reason)
    before = {path.name: path.read_bytes() for path in split.path.iterdir()}
    parts.path(parts.chunk(3)).unlink()
    assert collect(parts, split.path, partial=True).open == 50
    assert len(read_table(split.path, parts.loaded).design) == COUNT - 50
    write_part(parts, parts.chunk(3), Rows(*(each[150:200] for each in rows(parts.loaded))))
    collect(parts, split.path)
    assert {path.name: path.read_bytes() for path in split.path.iterdir()} == before
    assert not list(tmp_path.glob(".*"))


def test_large_tables_are_data_sets_when_nobody_says(studies, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = joined(studies, monkeypatch)
    assert table_path(parts).name == "study.parquet" and table_path(parts, partitioned=True).name == "study-table"
    monkeypatch.setattr("flexfem.study.collect.LARGE", COUNT - 1)
    assert table_path(parts).name == "study-table"


def test_a_folder_of_something_else_is_never_replaced(studies, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = joined(studies, monkeypatch)
    for name, make in {
        "theirs": lambda path: (path.mkdir(), (path / "thesis.txt").write_text("years of work")),
        "file": lambda path: path.write_text("years of work"),
        "link": lambda path: path.symlink_to(tmp_path),
    }.items():
        make(tmp_path / name)
        with pytest.raises(BadInput, match="not a table that flexfem study collect wrote, expected a new folder"):
            collect(parts, tmp_path / name)
        assert (tmp_path / name).exists()
    assert (tmp_path / "theirs" / "thesis.txt").read_text() == "years of work"
    with pytest.raises(BadInput, match=r"expected the name of a folder, without \.parquet"):
        check_target(tmp_path / "t.parquet", partitioned=True)


def test_a_flipped_bit_of_a_table_is_noticed(studies, tmp_path: Path) -> None:
    loaded = studies.load()
    path = written(loaded, tmp_path / "t.parquet")
    pq.write_table(pq.read_table(path), path, **PARQUET)
    sound = bytearray(path.read_bytes())
    sound[len(sound) // 2] ^= 4
    path.write_bytes(sound)
    with pytest.raises(BadInput, match="a damaged Parquet file"):
        table = read_table(path, loaded)
        [table.columns[name] for name in table.columns]


def test_a_table_of_fewer_designs_is_refused(studies, tmp_path: Path) -> None:
    """Which of an extensible sample has the same hash."""
    path = written(studies.load(), tmp_path / "t.parquet")
    with pytest.raises(BadInput, match="a table of 500 designs, expected 501 as"):
        read_table(path, studies.load(("designs = 500", "designs = 501")))
