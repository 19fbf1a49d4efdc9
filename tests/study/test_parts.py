"""Parts on disk: named by what is in them, whole or not there, read by other programs as they are."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flexfem.commands.study import collect as collect_command
from flexfem.commands.study import status
from flexfem.refused import BadInput
from flexfem.study.collect import collect
from flexfem.study.collected import read_table
from flexfem.study.content import COUNTS, kind_of, read_part, write_part
from flexfem.study.folder import remove, set_apart, stale_parts, survey
from flexfem.study.loaded import load_study
from flexfem.study.outputs import Rows
from flexfem.study.parts import KEY, Shard, parts_of, sweep
from flexfem.study_answers import clean_facts, status_facts
from flexfem.study_answers import counts_facts as counted

ROOT = Path(__file__).parent.parent.parent
STUDY = f"""
name = "parts of a study"
stage = "{ROOT}/geometry/mobility3.toml"
model = "analytic"

[sampling]
method = "latin_hypercube"
designs = 50
seed = 3

[[factor]]
key = "hinges.*.neck_mm"
from = 0.2
to = 1.1
"""


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "some.toml"
    path.write_text(STUDY)
    parts = parts_of(load_study(path), tmp_path, 20)
    for number in range(parts.count):
        write_part(parts, parts.chunk(number), rows(parts, number))
    return parts


def rows(parts, number):
    """Three kinds of rows."""
    _, start, stop = parts.chunk(number)
    design = np.arange(start, stop)
    status = np.array(["ok", "refused", "time limit"], object)[design % 3]
    reason = np.array(["", "neck = 3 mm, expected less", "no answer in 60 s"], object)[design % 3]
    values = design[:, None] + np.arange(len(parts.loaded.outputs)) / 7
    values[design % 3 != 0] = np.nan
    return Rows(status, reason, values)


def changed(parts, old, new):
    parts.loaded.path.write_text(STUDY.replace(old, new))
    return parts_of(load_study(parts.loaded.path), parts.folder.parent.parent, 20)


def names(parts):
    return [parts.path(parts.chunk(number)).name for number in range(parts.count)]


def test_names_tell_study_range_and_versions_but_not_the_title(written, monkeypatch):
    first = names(written)
    assert len(set(first)) == written.count == 3
    assert names(changed(written, '"parts of a study"', '"another title"')) == first
    for old, new in (("seed = 3", "seed = 4"), ("to = 1.1", "to = 1.2"), ("mobility3", "mobility6")):
        assert not set(names(changed(written, old, new))) & set(first)
    smaller = parts_of(written.loaded, written.folder.parent.parent, 10)
    assert not set(names(smaller)) & set(first)
    monkeypatch.setattr("flexfem.study.parts.versions_of", lambda meshed: {"numpy": "0.1"})
    assert not set(names(changed(written, "", ""))) & set(first)


def test_meshed_studies_depend_on_the_versions_of_mesher_and_solver(written):
    assert "gmsh" not in written.versions
    meshed = changed(written, '"analytic"', '"fe"').versions
    assert {"gmsh", "scikit-fem", "solver", "sources", "numpy"} <= set(meshed)


def test_what_is_written_is_read(written):
    for number in range(written.count):
        chunk = written.chunk(number)
        table, given = read_part(written, chunk), rows(written, number)
        assert table["design"].to_pylist() == list(range(chunk.start, chunk.stop))
        assert table["status"].to_pylist() == list(given.status)
        assert table["reason"].to_pylist() == list(given.reason)
        for name, column in zip(written.loaded.outputs, given.values.T, strict=True):
            np.testing.assert_array_equal(table[name].to_numpy(), column)
            assert table[name].null_count == np.isnan(column).sum()


def test_the_same_rows_are_the_same_bytes(written):
    path = written.path(written.chunk(1))
    before = path.read_bytes()
    path.unlink()
    write_part(written, written.chunk(1), rows(written, 1))
    assert path.read_bytes() == before


def test_no_flipped_bit_of_the_pages_changes_a_number_unnoticed(written):
    chunk = written.chunk(1)
    path, table = written.path(chunk), read_part(written, chunk)
    sound = path.read_bytes()
    footer = len(sound) - 8 - int.from_bytes(sound[-8:-4], "little")
    noticed = 0
    for place in range(4, footer, 53):
        damaged = bytearray(sound)
        damaged[place] ^= 0x10
        path.write_bytes(damaged)
        try:
            assert read_part(written, chunk).equals(table)
        except BadInput:
            noticed += 1
    assert noticed > 10


@pytest.mark.parametrize("key", [KEY, COUNTS])
def test_metadata_nested_without_end_are_those_of_a_damaged_part(written, key):
    path = written.path(written.chunk(1))
    table = pq.read_table(path)
    deep = table.replace_schema_metadata({**table.schema.metadata, key: b"[" * 100_000})
    pq.write_table(deep, path)
    facts = status_facts(written)
    assert (facts["done"], len(facts["damaged"])) == (30, 1)
    assert stale_parts(written) == []
    with pytest.raises(BadInput, match=r"part-0000001-\w{16}.parquet: (a damaged part|not the part)"):
        collect(written, path.parent.parent / "t.parquet")
    pq.write_table(deep, path.parent.parent / "t.parquet")
    if key == KEY:
        with pytest.raises(BadInput, match="a Parquet file of something else"):
            read_table(path.parent.parent / "t.parquet", written.loaded)


def test_a_study_that_may_only_be_read_is_counted(written, monkeypatch, capsys):
    monkeypatch.setattr("flexfem.files.writing.os.access", lambda path, mode: mode != os.W_OK)
    monkeypatch.setattr("flexfem.study.parts.BROADCAST", 20)
    before = sorted(written.folder.parent.parent.rglob("*"))
    status(written.loaded.path, written.folder.parent.parent)
    assert "50 designs, 0 open" in capsys.readouterr().out
    assert sorted(written.folder.parent.parent.rglob("*")) == before
    with pytest.raises(BadInput, match="no permission to write"):
        collect_command(written.loaded.path, written.folder.parent.parent)


def test_other_programs_read_the_parts_as_they_are(written):
    duckdb, pandas, polars = map(pytest.importorskip, ("duckdb", "pandas", "polars"))
    pattern, output = f"{written.folder}/*.parquet", written.loaded.outputs[0]
    (written.folder / ".part-0000001-left-behind.tmp").write_bytes(b"PAR1")
    expected = [float(n) for n in range(50) if n % 3 == 0]
    by_sql = duckdb.sql(f"select {output} from '{pattern}' where status = 'ok' order by design").fetchall()
    assert [value for (value,) in by_sql] == expected
    frame = pandas.read_parquet(written.folder).sort_values("design")
    assert frame[frame["status"] == "ok"][output].to_list() == expected
    assert frame[output].isna().sum() == 50 - len(expected)
    lazy = polars.scan_parquet(pattern).filter(polars.col("status") == "ok").sort("design")
    assert lazy.collect()[output].to_list() == expected


def test_the_table_holds_all_parts_in_order_and_says_what_it_is(written, tmp_path):
    made = collect(written, tmp_path / "all.parquet")
    table = pq.read_table(made.path)
    assert table["design"].to_pylist() == list(range(50))
    joined = pa.concat_tables([read_part(written, written.chunk(number)) for number in range(3)])
    assert table.equals(joined)
    assert b'"hash"' in table.schema.metadata[b"flexfem.study"]
    before = made.path.read_bytes()
    assert collect(written, tmp_path / "all.parquet").path.read_bytes() == before
    lines = collect(written, tmp_path / "all.csv").path.read_text().splitlines()
    assert lines[0].startswith('"design","status","reason","hinges.base.neck_mm"')
    assert lines[2].startswith('1,"refused","neck = 3 mm, expected less",') and lines[2].endswith(",,")


def test_row_groups_do_not_follow_the_parts(written, tmp_path, monkeypatch):
    monkeypatch.setattr("flexfem.study.collect.GROUP", 30)
    made = pq.ParquetFile(collect(written, tmp_path / "all.parquet").path)
    assert [made.metadata.row_group(k).num_rows for k in range(made.num_row_groups)] == [40, 10]
    assert made.read()["design"].to_pylist() == list(range(50))


def test_status_counts_kinds_of_reasons_and_names_strangers(written):
    other = changed(written, "seed = 3", "seed = 4")
    write_part(other, other.chunk(0), rows(other, 0))
    facts = status_facts(written)
    assert (facts["done"], facts["ok"], facts["refused"], facts["failed"], facts["open"]) == (50, 17, 17, 16, 0)
    assert facts["reasons"] == {"refused": {"neck": 17}, "time limit": {"no answer in ... s": 16}}
    assert facts["foreign"] == [names(other)[0]]
    assert survey(written, Shard(1, 2)).done == {1}


@pytest.mark.parametrize(
    ("reason", "kind"),
    [
        ("hinges.base.neck_mm = 20, expected less than 9.5", "hinges.base.neck_mm"),
        ("mesh covers 1.2e+03 mm^2, expected -7.5 to 0.001", "mesh covers ... mm^..., expected ... to ..."),
        ("the worker died", "the worker died"),
        ("", ""),
    ],
)
def test_reasons_of_a_kind_are_counted_together(reason, kind):
    assert kind_of(reason) == kind


def test_only_temporary_files_of_dead_runs_are_swept(written):
    young, old = (written.folder / f".part-0000001-{age}.tmp" for age in ("young", "old"))
    for path in (young, old):
        path.write_bytes(b"")
    os.utime(old, (time.time() - 4000, time.time() - 4000))
    before = set(written.folder.iterdir())
    sweep(written.folder)
    assert before - set(written.folder.iterdir()) == {old}


def test_a_folder_that_takes_no_part_is_refused_in_one_line(written):
    parts = parts_of(written.loaded, written.folder / names(written)[0])
    with pytest.raises(BadInput, match="cannot be written") as refusal:
        write_part(parts, parts.chunk(0), Rows(*(np.concatenate([r] * 3)[:50] for r in rows(written, 0))))
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_killed_while_writing_a_part_is_whole_or_not_there(written):
    script = (
        "import sys\n"
        "from itertools import cycle\n"
        "from flexfem.study.content import write_part\n"
        "from flexfem.study.parts import parts_of\n"
        "from flexfem.study.loaded import load_study\n"
        "from flexfem.study.outputs import failed_row\n"
        "from pathlib import Path\n"
        "parts = parts_of(load_study(sys.argv[1]), Path(sys.argv[2]), 1)\n"
        "rows = failed_row(len(parts.loaded.outputs), 'failed', 'x')\n"
        "write_part(parts, parts.chunk(0), rows)\n"
        "print('begun', flush=True)\n"
        "for number in cycle(range(parts.count)):\n"
        "    write_part(parts, parts.chunk(number), rows)\n"
    )
    draw, left, output = random.Random(7), 0, written.folder / "killed"
    parts = parts_of(written.loaded, output, 1)
    for _ in range(10):
        command = [sys.executable, "-c", script, str(written.loaded.path), str(output)]
        writer = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT)
        assert writer.stdout and writer.stdout.readline() == b"begun\n"
        time.sleep(draw.uniform(0.0, 0.1))
        writer.kill()
        writer.communicate()
        found = survey(parts)
        assert not found.damaged and not found.foreign
        left = len(list(parts.folder.glob(".part-*.tmp")))
        assert len(list(parts.folder.glob("*"))) == len(found.done) + left
    print(f"{len(found.done)} parts, {left} temporary files left behind by 10 kills")
    assert found.done


def test_what_is_stale_is_kept_apart_and_taken_back(written):
    """The glob of the README gives the rows of one study, each once; an edit that is undone finds its parts again."""
    own = sorted(names(written))
    (written.folder / "mine.parquet").write_bytes(b"not flexfem's")
    edited = changed(written, "to = 1.1", "to = 1.2")
    assert set_apart(edited) == (3, 0) and set_apart(edited) == (0, 0)
    for number in range(edited.count):
        write_part(edited, edited.chunk(number), rows(edited, number))
    assert sorted(path.name for path in edited.folder.glob("part-*.parquet")) == sorted(names(edited))
    assert sorted(path.name for path in edited.stale.iterdir()) == own
    assert status_facts(edited)["stale"] == 3 and status_facts(edited)["done"] == 50
    again = changed(written, "", "")
    assert set_apart(again) == (3, 3) and status_facts(again)["done"] == 50
    assert (written.folder / "mine.parquet").read_bytes() == b"not flexfem's"


def test_clean_removes_stale_parts_and_nothing_else(written, tmp_path):
    """Not the study's own parts, nor what only looks like one: links, folders, files of others, other names."""
    edited = changed(written, "to = 1.1", "to = 1.2")
    current = edited.path(edited.chunk(1))
    set_apart(edited)
    write_part(edited, edited.chunk(1), rows(edited, 1))
    beside = written.path(written.chunk(0))  # of a runner that began before the edit
    (written.stale / beside.name).rename(beside)
    victim = tmp_path / "victim.parquet"
    victim.write_bytes((written.stale / names(written)[1]).read_bytes())
    name = "part-0000000-0123456789abcde{}.parquet".format
    (written.stale / name(1)).symlink_to(victim)
    (written.stale / name(2)).mkdir()
    (written.stale / name(3)).write_bytes(b"PAR1 of something else")
    pq.write_table(pa.table({"a": [1]}), written.folder / name(4))
    (written.stale / f"my-{names(written)[1]}").write_bytes(victim.read_bytes())
    found = stale_parts(edited)
    assert sorted(part.path for part in found) == sorted([beside, *(written.stale / n for n in names(written)[1:])])
    (facts,) = clean_facts(found)["stale"]
    assert (facts["study"], facts["parts"], facts["bytes"]) == ("some", 3, sum(p.path.stat().st_size for p in found))
    assert facts["hash"] == written.loaded.hash != edited.loaded.hash
    before = {path for path in written.folder.parent.rglob("*")}
    remove(found, edited.stale)
    assert before - set(written.folder.parent.rglob("*")) == {part.path for part in found}
    assert current.exists() and victim.exists() and stale_parts(edited) == []


def test_a_linked_folder_of_stale_parts_is_refused(written, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    written.stale.symlink_to(elsewhere)
    edited = changed(written, "to = 1.1", "to = 1.2")
    for act in (set_apart, stale_parts):
        with pytest.raises(BadInput, match="stale: a link or a file"):
            act(edited)
    assert len(list(written.folder.iterdir())) == 3


def test_footers_alone_say_what_is_in_a_part(written, monkeypatch):
    """`status` reads no rows: a part whose pages are gone is still counted, and found out by who reads it whole."""
    monkeypatch.setattr("flexfem.study.folder.read_part", None)
    assert survey(written).counts == survey_of(written)
    path = written.path(written.chunk(1))
    sound = path.read_bytes()
    path.write_bytes(sound[:4] + bytes(len(sound) // 4) + sound[4 + len(sound) // 4 :])
    assert not survey(written).damaged
    monkeypatch.undo()
    assert set(survey(written, whole=True).damaged) == {1}


def survey_of(parts):
    """Counts of the rows that were written."""
    kinds = [("ok", ""), ("refused", "neck"), ("time limit", "no answer in ... s")]
    return Counter(kinds[design % 3] for design in range(parts.loaded.count))


def test_a_part_whose_counts_are_not_of_its_rows_is_damaged(written):
    chunk = written.chunk(0)
    path, table = written.path(chunk), read_part(written, chunk)
    for counts in (b'[["ok", "", 20]]', b'[["ok", "", 9]]', b"1", b"[" * 100_000):
        said = counts if counts == b"[" * 100_000 else b'{"start": 0, "kinds": ' + counts + b"}"
        pq.write_table(table.replace_schema_metadata(table.schema.metadata | {b"flexfem.counts": said}), path)
        assert set(survey(written, whole=True).damaged) == {0}
    assert set(survey(written).damaged) == {0}


def test_a_share_counts_its_own_parts_and_only_names_those_of_others(written, monkeypatch):
    asked = []
    monkeypatch.setattr("flexfem.study.folder.read_counts", lambda parts, chunk: asked.append(chunk) or Counter())
    written.path(written.chunk(2)).unlink()
    facts = status_facts(written, Shard(1, 2))
    assert [chunk.number for chunk in asked] == [1]
    assert (facts["designs"], facts["open_elsewhere"]) == (20, 10)


def test_designs_of_all_shares_are_those_of_the_study(written):
    for step in (1, 2, 3, 4):
        shares = [Shard(first, step).designs(written) for first in range(step)]
        assert sum(shares) == 50 and len(shares) == step
    assert [Shard(first, 3).designs(written) for first in range(3)] == [20, 20, 10]


def test_a_dry_run_of_clean_removes_nothing_and_says_what_would_go(written, flexfem):
    edited = changed(written, "to = 1.1", "to = 1.2")
    set_apart(edited)
    arguments = ("study", "clean", edited.loaded.path, "--output", edited.folder.parents[1])
    code, out, _ = flexfem(*arguments, "--dry-run")
    assert code == 0 and "3 parts" in out and len(list(edited.stale.iterdir())) == 3
    assert flexfem(*arguments)[0] == 0 and not edited.stale.exists()


def test_warnings_on_answers_are_counted_among_answers():
    counts = Counter({("ok", ""): 3, ("ok", "formula outside its range"): 2, ("refused", "neck"): 7})
    assert counted(counts)["warnings"] == ["2 of 5 designs with an answer: formula outside its range"]


def test_a_figure_that_is_refused_is_said_and_the_exit_code_is_one(written, flexfem):
    """50 designs are too few for indices: the table is there, the figure is not."""
    figure = '[[figure]]\nkind = "sensitivity"\nvalues = ["kxx_n_per_mm"]\n[sampling]'
    written.loaded.path.write_text(STUDY.replace("[sampling]", figure))
    output = written.folder.parents[1]
    parts = parts_of(load_study(written.loaded.path), output)
    write_part(parts, parts.chunk(0), rows(parts, 0))
    code, out, err = flexfem("study", "plot", written.loaded.path, "--output", output)
    assert (code, out) == (1, f"{output}/some/some.parquet\n")
    assert "some-sensitivity is not drawn" in err and "expected at least 100" in err


def test_a_run_all_of_whose_designs_failed_exits_with_one(written, flexfem):
    """Nothing is open any more: nothing is computed, and what failed is said with the command that tries it again."""
    output = written.folder.parents[1]
    parts = parts_of(load_study(written.loaded.path), output)
    found = rows(parts, 0)
    failed = found._replace(status=np.full(50, "failed", object), values=np.full_like(found.values, np.nan))
    write_part(parts, parts.chunk(0), failed)
    code, out, _ = flexfem("study", "run", written.loaded.path, "--output", output, "--workers", 1)
    assert code == 1 and "study run --retry" in out
