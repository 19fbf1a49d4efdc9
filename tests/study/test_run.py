"""Studies that are run: the same table however the work is split or killed, failures as rows,
inputs never mixed.
"""

from __future__ import annotations

import io
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexfem.refused import BadInput, ComputationFailed
from flexfem.studies import shard_of, status_facts
from flexfem.study import run
from flexfem.study import table as table_of
from flexfem.study import workers as worker_module
from flexfem.study.collect import collect, read_table
from flexfem.study.loaded import load_study
from flexfem.study.run import parts_of, read_part, remove_stale, run_parts, survey, write_part
from flexfem.study.workers import Workers, require_same_versions, versions_of

from ..tolerances import DENSE

sys.path.insert(0, str(Path(__file__).parent))  # workers import what they are to run

import strange

ROOT = Path(__file__).parents[2]
STUDY = """
name = "necks of some designs"
stage = "STAGE"
model = "MODEL"

[sampling]
method = "sobol"
designs = DESIGNS
seed = 29

[[factor]]
key = "override.*.*.neck_mm"
distribution = "normal"
sd = 0.05

[[factor]]
key = "hinges.base.radius_mm"
from = 1.0
to = 6.0
"""


def write(folder, model="analytic", designs=300, edit=("", "")):
    text = STUDY.replace("STAGE", str(ROOT / "geometry/mobility6.toml")).replace("MODEL", model)
    path = folder / "necks.toml"
    path.write_text(text.replace("DESIGNS", str(designs)).replace(*edit))
    return path


@pytest.fixture
def study(tmp_path):
    return partial(write, tmp_path)


class Here:
    """In the place of workers: computes in this process, and remembers the designs."""

    here = True

    def __init__(self):
        self.asked = []

    def results(self, function, next_task, limit):
        while (task := next_task()) is not None:
            self.asked += task[3]
            yield task, function(*task)


class Unchecked(Here):
    """Workers of other versions."""

    def results(self, function, next_task, limit):
        while (task := next_task()) is not None:
            solve, parts, chunk, piece, _ = task
            rows = solve(parts.loaded, piece.start, piece.stop)
            yield task, write_part(parts, chunk, run.table_of(parts, piece, rows))


@pytest.fixture(scope="module")
def workers():
    with Workers(2) as pool:
        yield pool


def table(parts):
    return pq.read_table(collect(parts, parts.folder / "table.parquet").path)


def require_same(parts, others, rtol=DENSE):
    """The same rows in the tables of two studies that have run."""
    found = table(parts)
    expected = table(others)
    assert found.schema == expected.schema
    assert found["status"] == expected["status"] and found["reason"] == expected["reason"]
    for name in parts.loaded.outputs:
        np.testing.assert_allclose(found[name], expected[name], rtol=rtol, atol=rtol)


@settings(max_examples=4, deadline=None)
@given(size=st.integers(4, 130), shards=st.integers(1, 5))
def test_any_split_into_parts_and_shards_gives_the_same_rows(tmp_path_factory, size, shards):
    folder = tmp_path_factory.mktemp("split")
    loaded = load_study(write(folder, designs=97))
    whole = parts_of(loaded, folder / "whole")
    split = parts_of(loaded, folder / "split", size)
    run_parts(whole, Here())
    for turn in reversed(range(shards)):
        run_parts(split, Here(), shard=slice(turn, None, shards))
    require_same(split, whole)


def test_what_exists_is_not_computed_again_and_a_damaged_part_is(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 64)
    said = []
    run_parts(parts, Here())
    expected = table(parts)
    paths = [parts.path(chunk) for chunk in parts.chunks()]
    assert len(paths) == 5 and paths[-1].name.startswith("part-0000000256-")
    content = bytearray(paths[1].read_bytes())
    content[len(content) // 3] ^= 4  # in a page: its checksum tells
    paths[1].write_bytes(content)
    paths[2].write_bytes(b"PAR1 torn")
    assert (
        [*survey(parts).damaged][-1:]
        == parts.chunks()[2:3]
        == [*survey(parts, whole=True).damaged][1:]
    )
    with pytest.raises(BadInput, match="damaged"):
        collect(parts, tmp_path / "t.parquet")
    here = Here()
    run_parts(parts, here, say=said.append)
    assert sorted(here.asked) == [*range(64, 192)]
    assert [text.split(":")[0] for text in said[:2]] == [str(path) for path in paths[1:3]]
    assert table(parts).equals(expected)
    here = Here()
    assert run_parts(parts, here) == 300 and here.asked == []


def changed(table, name, value):
    """A table with another value in the last row of a column."""
    place = table.column_names.index(name)
    values = table[name].to_pylist()
    return table.set_column(
        place, table.field(name), pa.array([*values[:-1], value], table.field(name).type)
    )


def with_seal(table, content):
    """A table with another seal."""
    return table.replace_schema_metadata(table.schema.metadata | {b"flexfem.seal": content})


TAMPERED = {  # the rows of the second part, and those of the first; what is said of the part
    "rewritten": (
        lambda rows, _: changed(rows, "kxx_n_per_mm", 1.0),
        "was changed in kxx_n_per_mm;",
    ),
    "emptied": (
        lambda rows, _: changed(rows, "ktt_n_mm_per_rad", None),
        "was changed in ktt_n_mm_per_rad;",
    ),
    "renamed": (lambda rows, _: changed(rows, "status", "refused"), "was changed in status;"),
    "swapped": (
        lambda rows, _: rows.take([1, 0, *range(2, 64)]),
        "in design, override.1.base.neck_mm, override.1.",
    ),
    "doubled": (
        lambda rows, _: pa.concat_tables([rows, rows.slice(60)]),
        "a part with 68 rows, expected 64",
    ),
    "replaced": (
        lambda rows, _: pa.concat_tables([rows.slice(0, 63), rows.slice(62, 1)]),
        "was changed in design, ",
    ),
    "missing": (lambda rows, _: rows.slice(0, 3), "a part with 3 rows, expected 64"),
    "neighbour": (
        lambda _, before: before,
        "a part of the designs from 0 up to 64, expected those from 64 up to 128",
    ),
    "neighbour's rows": (
        lambda rows, before: before.replace_schema_metadata(rows.schema.metadata),
        "was changed in design, ",
    ),
    "without metadata": (
        lambda rows, _: rows.replace_schema_metadata(None),
        "a part without a seal",
    ),
    "one column less": (
        lambda rows, _: rows.drop_columns("coupling_xy"),
        "a part with other columns",
    ),
    "unreadable seal": (lambda rows, _: with_seal(rows, b"[1"), "a part without a seal"),
    "seal of no table": (lambda rows, _: with_seal(rows, b"[1]"), "a part without a seal"),
}


@pytest.mark.parametrize("tampered", TAMPERED)
def test_a_part_whose_rows_are_not_those_that_were_written_is_named_and_computed_again(
    study, tmp_path, tampered
):
    parts = parts_of(load_study(study(designs=150)), tmp_path, 64)
    said = []
    run_parts(parts, Here(), strange.plain)
    expected = table(parts)
    before, path = (parts.path(chunk) for chunk in parts.chunks()[:2])
    change, fault = TAMPERED[tampered]
    pq.write_table(change(pq.read_table(path), pq.read_table(before)), path)
    with pytest.raises(BadInput) as refused:
        collect(parts, tmp_path / "t.parquet", partial=True)
    text = str(refused.value)
    assert text.startswith(f"{path}: ") and fault in text and "\n" not in text
    assert (
        text.endswith("; flexfem study run computes these designs again")
        and not (tmp_path / "t.parquet").exists()
    )
    here = Here()
    run_parts(parts, here, strange.plain, say=said.append)
    assert sorted(here.asked) == [*range(64, 128)]
    assert (
        said[0].startswith(f"{path}: ")
        and fault in said[0]
        and said[0].endswith("; computed again")
    )
    assert table(parts).equals(expected)


def test_a_part_of_another_study_or_version_is_named_and_computed_again(study, tmp_path):
    """Under the name of one of this study, whose factors and outputs have the same names."""
    parts = parts_of(load_study(study(designs=64)), tmp_path / "one")
    run_parts(parts, Here(), strange.plain)
    for edit in (("sd = 0.05", "sd = 0.04"), ("seed = 29", "seed = 30")):
        other = parts_of(load_study(study(designs=64, edit=edit)), tmp_path / "two")
        run_parts(other, Here(), strange.plain)
        parts.path(range(64)).write_bytes(other.path(range(64)).read_bytes())
        (fault,) = status_facts(parts)["damaged"]
        assert fault == f"{parts.path(range(64))}: a part of another study or of other versions"
        assert status_facts(parts)["open"] == 64
        run_parts(parts, here := Here(), strange.plain)
        assert here.asked == [*range(64)] and status_facts(parts)["damaged"] == []
    newer = replace(parts, versions={**parts.versions, "numpy": "1.0"})
    run_parts(newer, Unchecked(), strange.plain)
    parts.path(range(64)).write_bytes(newer.path(range(64)).read_bytes())
    assert "of other versions" in status_facts(parts)["damaged"][0]


def test_a_part_that_another_run_has_left_damaged_is_computed(study, tmp_path):
    """It appears between the look at the folder and the turn of its designs."""
    parts = parts_of(load_study(study(designs=64)), tmp_path, 32)
    first, second = parts.chunks()

    class Beside(Here):
        def results(self, function, next_task, limit):
            for chunk in (first, second):
                parts.folder.mkdir(exist_ok=True)
                parts.path(chunk).write_bytes(b"PAR1 torn")
            yield from super().results(function, next_task, limit)

    run_parts(parts, Beside(), strange.plain)
    assert len(table(parts)) == 64


def test_no_thread_of_arrow_waits_for_python_to_read_a_table(study, tmp_path, monkeypatch):
    """One that does so while the process ends aborts it, with exit code 134."""
    parts = parts_of(load_study(study(designs=40)), tmp_path)
    threads = set[int]()
    run_parts(parts, Here())
    path = collect(parts, tmp_path / "t.parquet").path

    class Watched(io.FileIO):
        def read(self, *size):
            threads.add(threading.get_ident())
            return super().read(*size)

    monkeypatch.setattr(Path, "open", lambda self, mode: Watched(self))
    assert (
        len(read_part(parts, range(40)))
        == len(read_table(path).columns["kxx_n_per_mm"])
        == len(table_of(path))
    )
    assert threads == {threading.get_ident()}


def test_rows_of_other_inputs_or_versions_are_never_taken_and_clean_removes_those_alone(
    study, tmp_path, monkeypatch
):
    first = parts_of(load_study(study()), tmp_path, 64)
    said = []
    run_parts(first, Here())
    other = parts_of(load_study(study(edit=("sd = 0.05", "sd = 0.04"))), tmp_path, 64)
    with pytest.raises(
        BadInput, match=r"no designs are finished\. Run.*5 parts there belong to other inputs"
    ):
        collect(other, tmp_path / "t.parquet")
    here = Here()
    run_parts(other, here, say=said.append)
    assert len(here.asked) == 300 and "5 parts of other inputs or versions" in said[0]
    again = Here()
    run_parts(
        parts_of(load_study(study()), tmp_path, 64), again
    )  # the first inputs find their own parts
    assert again.asked == []
    monkeypatch.setattr("flexfem.study.run.versions_of", lambda: {"flexfem": "9.9"})
    newer = parts_of(load_study(study()), tmp_path, 64)
    assert not {newer.path(chunk) for chunk in newer.chunks()} & {
        first.path(chunk) for chunk in first.chunks()
    }
    monkeypatch.undo()
    stranger = first.folder / "notes.parquet"
    stranger.write_text("mine")
    assert remove_stale(other, dry_run=True)[0] == 5 and len(survey(other).stale) == 5
    assert remove_stale(other)[0] == 5 and stranger.exists()
    assert survey(other).total.total() == 300 and survey(other).stale == []


def test_versions_are_those_of_all_that_decides_results(monkeypatch):
    monkeypatch.setattr(worker_module, "own_hash", lambda: "ab" * 32)
    own = dict(versions_of.__wrapped__())
    assert {"flexfem", "numpy", "scipy", "gmsh", "scikit-fem", "sources"} < set(own) and own[
        "with"
    ] == "ab" * 8
    monkeypatch.undo()
    require_same_versions(versions_of())
    with pytest.raises(
        BadInput,
        match=r"a worker has numpy .*, the runner 1.0, expected the same versions everywhere",
    ):
        require_same_versions(dict(versions_of()) | {"numpy": "1.0"})


@pytest.mark.parametrize(
    ("method", "kept"), [("sobol", 100), ("monte_carlo", 100), ("latin_hypercube", 0)]
)
def test_a_larger_sample_computes_only_what_is_new(study, tmp_path, method, kept):
    """All of a Latin hypercube, which begins otherwise."""
    for designs in (100, 170):
        here = Here()
        parts = parts_of(load_study(study(designs=designs, edit=("sobol", method))), tmp_path, 20)
        run_parts(parts, here)
    assert sorted(here.asked) == [*range(kept, 170)] and len(table(parts)) == 170


def test_a_design_that_raises_an_error_is_a_row_and_retry_tries_it_again(study, tmp_path):
    parts = parts_of(load_study(study(designs=64)), tmp_path, 16)
    run_parts(parts, Here(), strange.raising)
    rows = table(parts).to_pylist()
    assert [row["design"] for row in rows if row["status"] != "ok"] == [20, 21]
    assert (
        rows[20]["reason"] == "ValueError: a bug in two lines" and rows[20]["kxx_n_per_mm"] is None
    )
    assert rows[21]["status"] == "failed" and rows[21]["reason"].startswith(
        "mesh has a scaled Jacobian = 0.01"
    )
    assert rows[22]["kxx_n_per_mm"] == 22.0
    reasons = {"ValueError: a bug in two lines": 1, "mesh has a scaled Jacobian": 1}
    assert status_facts(parts)["reasons"] == {"failed": reasons}
    here = Here()
    run_parts(parts, here, strange.plain)
    assert here.asked == []
    run_parts(parts, here, strange.plain, retry=True)
    assert here.asked == [*range(16, 32)] and status_facts(parts)["ok"] == 64


@pytest.mark.parametrize(
    "text", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2", "1/2/3", "", "\uff11/2", "1/9999999"]
)
def test_bad_shards_are_refused(text):
    with pytest.raises(BadInput, match="--shard"):
        shard_of(text)


def test_commands_run_count_and_collect(flexfem, study):
    path = study(
        edit=(
            "[sampling]",
            '[[output]]\nname = "half"\nexpression = "kxx_n_per_mm / 2"\n[sampling]',
        )
    )
    code, out, _ = flexfem("study", "status", path, "--json")
    assert (code, json.loads(out)["open"]) == (0, 300)
    code, _, err = flexfem("study", "status", ".")
    assert code == 2 and "no study has run in this folder" in err and err.count("\n") == 1
    code, _, err = flexfem("study", "collect", path)
    assert (
        code == 2
        and "no designs are finished. Run `flexfem study run`" in err
        and err.count("\n") == 1
    )
    for arguments, said in (
        (["run", "--shard", "3/2"], "--shard 3/2"),
        (["collect", "--to", "t.xlsx"], "ends in"),
    ):
        code, out, err = flexfem("study", arguments[0], path, *arguments[1:])
        assert (
            (code, out, err.count("\n")) == (2, "", 1)
            and said in err
            and not Path("reports").exists()
        )
    Path("reports").write_text("a file")
    code, out, err = flexfem("study", "run", path, "--workers", 1)
    assert (code, out, err.count("\n")) == (2, "", 1) and "reports" in err
    Path("reports").unlink()
    code, out, _ = flexfem("study", "run", path, "--workers", 1, "--shard", "2/2", "--json")
    about = json.loads(out)
    assert (code, about["designs"], about["open_elsewhere"]) == (
        0,
        0,
        300,
    )  # one part, which is the other shard's
    code, out, _ = flexfem("study", "run", path, "--workers", 1, "--no-figures", "--json")
    facts = json.loads(out)
    assert (facts["open"], facts["done"], facts["next"]) == (0, 300, f"flexfem study plot {path}")
    for folder in (
        "reports/necks",
        "reports/necks/parts/..",
        "reports/necks/parts",
    ):  # instead of the file
        code, out, _ = flexfem("study", "status", folder, "--json")
        assert (code, json.loads(out)["done"]) == (0, 300)
    code, out, _ = flexfem("study", "run", "reports/necks", "--json")
    facts = json.loads(out)
    assert code == 0 and not Path("necks").exists()
    assert facts["next"] == f"flexfem report {path} -o {Path.cwd() / 'reports/necks/necks.html'}"
    assert Path(facts["written"][0]) == Path.cwd() / "reports/necks/necks.parquet"
    drawn = [Path(name).name for name in facts["written"][1:]]
    assert drawn == [
        "necks-effects.png",
        "necks-effects.pdf",
        "necks-sensitivity.png",
        "necks-sensitivity.pdf",
    ]
    code, out, _ = flexfem("study", "collect", "reports/necks", "--to", "same.csv", "--json")
    assert json.loads(out) == {"written": ["same.csv"], "designs": 300, "open": 0}
    Path("reports/other").mkdir()
    Path("reports/other/study.json").write_text(Path("reports/necks/study.json").read_text())
    code, out, err = flexfem("study", "status", "reports/other")
    assert (code, out) == (2, "") and err.endswith("necks.toml, expected it to be named necks\n")
    for target in ("t.csv", "t.parquet"):
        code, out, _ = flexfem("study", "collect", path, "--to", target, "--json")
        assert json.loads(out) == {"written": [target], "designs": 300, "open": 0}
    frame = table_of("t.parquet")
    assert list(frame["design"]) == [*range(300)]
    np.testing.assert_array_equal(2 * frame["half"], frame["kxx_n_per_mm"])
    assert pyarrow.csv.read_csv("t.csv").num_rows == 300
    code, out, _ = flexfem("study", "clean", path)
    assert code == 0 and out.startswith("0 parts of other inputs")


def test_a_partial_table_lacks_the_open_designs_only(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 64)
    with pytest.raises(BadInput, match="no designs are finished"):
        collect(parts, tmp_path / "t.parquet", partial=True)
    run_parts(parts, Here(), shard=slice(1, None, 2))
    with pytest.raises(BadInput, match="172 of 300 designs are unfinished"):
        collect(parts, tmp_path / "t.parquet")
    made = collect(parts, tmp_path / "t.parquet", partial=True)
    assert (made.designs, made.open) == (128, 172)
    assert pq.read_table(made.path)["design"].to_pylist() == [*range(64, 128), *range(192, 256)]


def test_workers_of_which_one_is_killed_from_outside_give_the_table_of_one_process(
    study, workers, tmp_path
):
    loaded = load_study(study(designs=60))
    here = parts_of(loaded, tmp_path / "here", 4)
    there = parts_of(loaded, tmp_path / "there", 4)
    run_parts(here, Here())
    run_parts(there, workers, strange.once)
    assert (tmp_path / "killed").exists()
    require_same(there, here)


def test_workers_that_cannot_begin_fail_in_one_line(study, tmp_path, monkeypatch):
    monkeypatch.setattr(worker_module, "_begin", os._exit)
    with Workers(1) as pool, pytest.raises(ComputationFailed, match="end at their start"):
        run_parts(parts_of(load_study(study()), tmp_path), pool)


@pytest.mark.slow
def test_hanging_and_crashing_designs_are_named_and_cost_no_other(
    study, workers, tmp_path, monkeypatch
):
    monkeypatch.setattr("flexfem.study.run.SLACK", 1.0)
    loaded = load_study(
        study("fe", designs=32, edit=("[sampling]", "time_limit_s = 12\n[sampling]"))
    )
    parts = parts_of(loaded, tmp_path, 2)
    run_parts(parts, workers, strange.strange)
    rows = table(parts).to_pylist()
    bad = {row["design"]: (row["status"], row["reason"]) for row in rows if row["status"] != "ok"}
    assert [*bad] == [
        strange.HANGS,
        strange.KILLED,
        strange.SEGMENTATION,
        strange.RAISES,
        strange.FAILS,
    ]
    assert bad[strange.HANGS] == ("time limit", "no result in 13 s")
    assert bad[strange.KILLED] == bad[strange.SEGMENTATION] == ("crashed", "the worker died")
    assert all(row["kxx_n_per_mm"] == row["design"] for row in rows if row["status"] == "ok")


RUN = """
import sys
from pathlib import Path
import strange
from flexfem.study import run
from flexfem.study.loaded import load_study
from flexfem.study.workers import Workers

parts = run.parts_of(load_study(sys.argv[1]), Path(sys.argv[2]), 16)
with Workers(2) as pool:
    print("running", flush=True)
    print(run.run_parts(parts, pool, strange.slow))
"""


def start(path, output):
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(Path(__file__).parent)]),
    }
    command = [sys.executable, "-c", RUN, str(path), str(output)]
    pipes = {"stdout": -1, "stderr": -1}
    return subprocess.Popen(command, text=True, env=environment, **pipes)


def until(condition, seconds=60.0):
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.02)


@pytest.mark.slow
def test_killed_at_random_moments_the_table_is_that_of_an_uninterrupted_run(study, tmp_path):
    path = study(designs=600)
    draw = random.Random(5)
    whole, parts = (parts_of(load_study(path), tmp_path / name, 16) for name in ("whole", "killed"))
    run_parts(whole, Here())
    for _ in range(4):
        runner = start(path, tmp_path / "killed")
        children = psutil.Process(runner.pid)
        assert runner.stdout.readline() == "running\n"
        before = len(survey(parts).counts)
        until(lambda least=before + 1: len(survey(parts).counts) >= least)
        time.sleep(draw.uniform(0.0, 0.5))
        left = children.children(recursive=True)
        runner.kill()
        runner.communicate()
        psutil.wait_procs(left, 10.0)
        assert not [
            child for child in left if child.is_running() and child.status() != psutil.STATUS_ZOMBIE
        ]
    done = survey(parts, whole=True)
    assert 0 < done.total.total() < 600 and done.damaged == {}
    out, err = start(path, tmp_path / "killed").communicate(timeout=120)
    assert int(out.split()[-1]) == done.total.total(), (
        err
    )  # nothing that was there is computed again
    require_same(parts, whole)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_ends_soon_with_one_line_and_leaves_no_process(study, tmp_path, number):
    path = study("fe", designs=200)
    command = [
        sys.executable,
        "-m",
        "flexfem",
        "study",
        "run",
        str(path),
        "-o",
        str(tmp_path),
        "--workers",
        "2",
    ]
    runner = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    until(lambda: list((tmp_path / "necks").glob("parts/part-*")))
    left = psutil.Process(runner.pid).children(recursive=True)
    began = time.monotonic()
    os.killpg(runner.pid, number)  # all of them, as a terminal does
    _, err = runner.communicate(timeout=30)
    assert time.monotonic() - began < 8 and runner.returncode == 128 + number
    *before, last = err.splitlines()
    assert "of 200 designs are kept in" in last and all(
        line.startswith("study: ") for line in before
    ), err
    _, alive = psutil.wait_procs(left, 10.0)
    assert alive == []
