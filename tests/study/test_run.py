"""Studies that are run: the same table however the work is split, failures as rows, progress kept."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexfem.commands.progress import said
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.collect import collect
from flexfem.study.content import read_part
from flexfem.study.folder import release_folder
from flexfem.study.loaded import load_study
from flexfem.study.parts import Shard, parts_of, shuffled
from flexfem.study.pool import LocalPool
from flexfem.study.run import Progress, run_study
from flexfem.study.worker import Died, Worker, _is_stopped
from flexfem.study_answers import shard_of, status_facts

sys.path.insert(0, str(Path(__file__).parent))  # workers import what they are to run

import strange

ROOT = Path(__file__).parent.parent.parent
STUDY = """
name = "necks of some designs"
stage = "STAGE"
model = "MODEL"

[sampling]
method = "monte_carlo"
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


@pytest.fixture
def study(tmp_path):
    def write(model="analytic", designs=300, name="necks", edit=("", "")):
        text = STUDY.replace("STAGE", str(ROOT / "geometry/mobility6.toml")).replace("MODEL", model)
        path = tmp_path / f"{name}.toml"
        path.write_text(text.replace("DESIGNS", str(designs)).replace(*edit))
        return path

    return write


class Here:
    """A pool that computes at once in this process, so that a run can be tried many times."""

    width = 3

    def submit(self, solve, loaded, start, stop, limit):
        from concurrent.futures import Future

        future = Future()
        future.set_result(solve(loaded, start, stop, False) if start < stop else "")
        return future

    def outcome(self, future):
        return future.result()

    def check(self):
        pass


@pytest.fixture
def workers():
    pool = LocalPool(2)
    yield pool
    pool.close()


def table(parts, path):
    return pq.read_table(collect(parts, path).path)


@settings(max_examples=4)
@given(size=st.integers(4, 130), shards=st.integers(1, 5), order=st.randoms())
def test_any_split_into_chunks_and_shards_gives_the_same_rows(tmp_path_factory, size, shards, order):
    folder = tmp_path_factory.mktemp("split")
    path = folder / "necks.toml"
    text = STUDY.replace("STAGE", str(ROOT / "geometry/mobility6.toml")).replace("MODEL", "analytic")
    path.write_text(text.replace("DESIGNS", "97"))
    loaded = load_study(path)
    whole, split = parts_of(loaded, folder / "whole"), parts_of(loaded, folder / "split", size)
    run_study(whole, Here())
    turns = list(range(shards))
    order.shuffle(turns)
    for turn in turns:
        run_study(split, Here(), shard=Shard(turn, shards))
    assert table(split, folder / "a.parquet").equals(table(whole, folder / "b.parquet"))


@given(st.integers(1, 200), st.integers(1, 9), st.integers(0, 99))
def test_every_chunk_is_seen_to_once_by_one_shard(count, shards, seed):
    numbers = [list(shuffled(range(first, count, shards), seed)) for first in range(shards)]
    assert sorted(chain(*numbers)) == list(range(count))


def test_orders_of_runners_differ():
    assert len({tuple(shuffled(range(1000))) for _ in range(5)}) > 1


def test_worker_processes_give_the_table_of_one_process(study, workers, tmp_path):
    loaded = load_study(study())
    here, there = parts_of(loaded, tmp_path / "here", 64), parts_of(loaded, tmp_path / "there", 64)
    run_study(here, Here())
    run_study(there, workers)
    for a, b in zip(sorted(here.folder.iterdir()), sorted(there.folder.iterdir()), strict=True):
        assert (a.name, a.read_bytes()) == (b.name, b.read_bytes())
    assert status_facts(there)["refused"] > 0  # else no row without numbers was tried


@pytest.mark.slow
def test_finite_elements_are_the_same_in_a_worker_and_with_gmsh_in_a_child_process(study, workers, tmp_path):
    loaded = load_study(study("fe", 5))
    inside, outside = parts_of(loaded, tmp_path / "inside"), parts_of(loaded, tmp_path / "outside")
    run_study(inside, workers)
    run_study(outside, Here())
    assert status_facts(inside)["ok"] > 1
    assert table(inside, tmp_path / "a.parquet").equals(table(outside, tmp_path / "b.parquet"))


def test_what_exists_is_not_computed_again(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 64)
    asked = []

    def counting(loaded, start, stop, inside):
        asked.extend(range(start, stop))
        assert start // 64 == (stop - 1) // 64
        return strange.plain(loaded, start, stop, inside)

    run_study(parts, Here(), counting)
    assert sorted(asked) == list(range(300))
    gone = sorted(parts.folder.iterdir())[2]
    gone.unlink()
    asked.clear()
    progress = run_study(parts, Here(), counting)
    assert sorted(asked) == list(range(128, 192))
    assert (progress.known, progress.designs, progress.counts.total()) == (236, 300, 300)


def test_a_run_that_is_stopped_within_a_part_keeps_its_designs_and_says_how_many(study, tmp_path, monkeypatch):
    """Designs of 10 ms and tasks of 50 ms: a part of 300 designs is answered in pieces, of which three are lost."""
    monkeypatch.setattr("flexfem.study.run.SECONDS", 0.05)
    parts, whole = (parts_of(load_study(study()), tmp_path / name, 300) for name in ("a", "b"))
    asked, seen = [], []

    def slow(loaded, start, stop, inside):
        if len(asked) > 60:
            raise KeyboardInterrupt
        asked.extend(range(start, stop))
        time.sleep(0.01 * (stop - start))
        return strange.plain(loaded, start, stop, inside)

    with pytest.raises(KeyboardInterrupt):
        run_study(parts, Here(), slow, watch=seen.append)
    facts = status_facts(parts)
    assert 0.5 * len(asked) < seen[-1].kept == facts["under_way"] <= len(asked) < 130
    assert (seen[-1].designs, facts["open"]) == (300, 300)
    before, begun = seen[-1].kept, len(asked)
    asked.clear()
    monkeypatch.setattr("flexfem.study.run.SECONDS", 5.0)
    run_study(parts, Here(), lambda *task: asked.extend(range(*task[1:3])) or strange.plain(*task), watch=seen.append)
    assert len(asked) == 300 - before and begun >= before and seen[-1].kept == 300
    run_study(whole, Here(), strange.plain)
    assert table(parts, tmp_path / "a.parquet").equals(table(whole, tmp_path / "b.parquet"))


@pytest.mark.slow
def test_hanging_and_crashing_designs_become_rows_and_the_rest_completes(study, tmp_path, monkeypatch):
    monkeypatch.setattr("flexfem.study.run.STARTUP", 1.0)
    loaded = load_study(study("fe", 40, edit=("[sampling]", "time_limit_s = 1.0\n[sampling]")))
    parts, pool = parts_of(loaded, tmp_path), LocalPool(2)
    began = time.monotonic()
    try:
        run_study(parts, pool, strange.strange)
    finally:
        pool.close()
    print(f"{time.monotonic() - began:.1f} s")
    made = table(parts, tmp_path / "t.parquet").to_pydict()
    bad = {n: (s, r) for n, s, r in zip(made["design"], made["status"], made["reason"], strict=True) if s != "ok"}
    assert bad == {
        strange.HANGS: ("time limit", "no answer in 1 s and 1 s more"),
        strange.KILLED: ("crashed", "the worker died"),
        strange.SEGMENTATION: ("crashed", "the worker died"),
        strange.RAISES: ("failed", "ValueError: a bug in two lines"),
        strange.FAILS: ("failed", "mesh has a scaled Jacobian = 0.01, expected > 0.1"),
    }
    assert made["design"] == list(range(40))
    for name in loaded.outputs:
        without = {n for n, value in zip(made["design"], made[name], strict=True) if value is None}
        assert without == {*bad, strange.NAN}
    first = [value for value in made[loaded.outputs[0]] if value is not None]
    assert first == sorted(first)
    facts = status_facts(parts)
    assert facts["reasons"]["failed"] == {"ValueError: a bug in two lines": 1, "mesh has a scaled Jacobian": 1}
    assert (facts["failed"], facts["ok"], facts["open"]) == (5, 35, 0)


@pytest.mark.slow
def test_a_worker_killed_twice_from_outside_changes_no_row(study, workers, tmp_path):
    parts = parts_of(load_study(study("fe", 20)), tmp_path / "out")
    run_study(parts, workers, strange.once)
    assert len(list(tmp_path.glob("try-*"))) == 2
    assert status_facts(parts)["ok"] == 20


def test_a_worker_on_its_way_out_is_given_no_task_and_loading_eats_no_limit(monkeypatch):
    """A death counted twice, or a slow start, would be a false row."""
    worker = Worker()
    try:
        leaving = "__import__('os').closerange(0, 64) or __import__('time').sleep(99)"
        with pytest.raises(Died):
            worker.start(eval, (leaving,), 60.0, {}).result(60)
        monkeypatch.setattr("flexfem.study.worker.LOADING", 1e9)
        future = worker.start(eval, ("6 * 7",), 1e-9, {})
        worker.check()
        assert future.result(60) == 42
        late = worker.start(eval, ("__import__('time').sleep(99)",), 0.05, {})
        while not late.done():
            worker.check()
        with pytest.raises(TimeoutError):
            late.result()
    finally:
        worker.kill()


def test_a_stopped_worker_keeps_its_limit_and_is_given_up_in_the_end(monkeypatch):
    worker, now = Worker(), [0.0]
    monkeypatch.setattr("flexfem.clock.time.monotonic", lambda: now[0])

    def pass_time(seconds):
        for _ in range(4 * seconds):
            now[0] += 0.25
            worker.check()

    def stopped(pid):
        os.kill(pid, signal.SIGSTOP)
        while not _is_stopped(pid):
            pass

    try:
        late = worker.start(eval, ("[f.open().read() for f in [__import__('pathlib').Path('/dev/stdin')]]",), 5.0, {})
        worker._begun.wait(60)
        stopped(worker._process.pid)
        pass_time(55)
        assert not late.done()
        os.kill(worker._process.pid, signal.SIGCONT)
        while _is_stopped(worker._process.pid):
            pass
        pass_time(4)
        assert not late.done()
        stopped(worker._process.pid)
        pass_time(6)
        with pytest.raises(Died):
            late.result(60)
    finally:
        worker.kill()


@pytest.mark.slow
def test_one_bad_design_takes_no_other_of_its_chunk_along(study, workers, tmp_path):
    parts = parts_of(load_study(study(designs=8)), tmp_path)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("flexfem.study.run.BROADCAST_LIMIT", 2.0)
        run_study(parts, workers, strange.strange)
    made = table(parts, tmp_path / "t.parquet").to_pydict()
    bad = {n: s for n, s in zip(made["design"], made["status"], strict=True) if s != "ok"}
    assert bad == {strange.HANGS: "time limit", strange.KILLED: "crashed"}
    assert made["design"] == list(range(8))


def test_retry_computes_only_parts_with_designs_that_may_be_answered(study, tmp_path):
    parts = parts_of(load_study(study("fe", 64)), tmp_path)
    failing = {"now": True}

    def sometimes(loaded, start, stop, inside):
        rows = strange.plain(loaded, start, stop, inside)
        if start == 17 and failing["now"]:
            rows.status[:], rows.reason[:] = "time limit", "no answer in 60 s"
        if start == 40:
            rows.status[:], rows.reason[:] = "refused", "neck = 20, expected less"
        return rows

    run_study(parts, Here(), sometimes)
    before = {path.name: path.stat().st_mtime_ns for path in parts.folder.iterdir()}
    failing["now"] = False
    run_study(parts, Here(), sometimes)
    assert status_facts(parts)["failed"] == 1
    run_study(parts, Here(), sometimes, retry=True)
    facts = status_facts(parts)
    assert (facts["failed"], facts["refused"], facts["ok"]) == (0, 1, 63)
    changed = [path.name for path in parts.folder.iterdir() if path.stat().st_mtime_ns != before[path.name]]
    assert [name[:12] for name in changed] == ["part-0000001"]


def test_retry_asks_for_nothing_that_has_its_answer_and_never_loses_one(study, tmp_path):
    """On a busy machine a second try may be out of time too: it must not take the answers along."""
    parts, asked = parts_of(load_study(study("fe", 16)), tmp_path), []

    def busy(late):
        def late_ones(loaded, start, stop, inside):
            asked.append(start)
            rows = strange.plain(loaded, start, stop, inside)
            if start in late:
                rows.status[:], rows.reason[:] = "time limit", "no answer in 60 s"
            return rows

        return late_ones

    run_study(parts, Here(), busy({3, 5}))
    first = read_part(parts, parts.chunk(0))
    asked.clear()
    run_study(parts, Here(), busy(range(16)), retry=True)
    assert sorted(asked)[-2:] == [3, 5]
    assert read_part(parts, parts.chunk(0)).equals(first)

    def another_succeeds(loaded, start, stop, inside):
        if start == 3:
            run_study(parts, Here(), busy({3}), retry=True)
        return busy({5})(loaded, start, stop, inside)

    run_study(parts, Here(), another_succeeds, retry=True)
    assert status_facts(parts)["ok"] == 16


def test_a_damaged_part_is_named_and_computed_again(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 64)
    run_study(parts, Here())
    first, second, third, *_ = sorted(parts.folder.iterdir())
    sound = {path: path.read_bytes() for path in (first, second, third)}
    first.write_bytes(sound[first][:1000])
    broken = bytearray(sound[second])
    broken[400] ^= 1  # a bit in a page
    second.write_bytes(broken)
    third.write_bytes(sound[first])
    with pytest.raises(BadInput, match=r"part-000000[0-2]-.*damaged|not the part"):
        collect(parts, tmp_path / "t.parquet")
    assert len(status_facts(parts)["damaged"]) == 2  # a bit in a page is found by who reads it
    said = []
    run_study(parts, Here(), say=said.append)
    assert [path.name in line for path, line in zip(sound, said, strict=True)] == [True] * 3
    assert {path: path.read_bytes() for path in sound} == sound


@pytest.mark.slow
def test_workers_that_cannot_begin_are_no_failed_designs(study, workers, tmp_path):
    parts = parts_of(load_study(study()), tmp_path)
    missing = tmp_path / "gone.py"
    missing.write_text("def solve(loaded, start, stop, inside): pass\n")
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(tmp_path)
        import gone

        missing.unlink()
        with pytest.raises(ComputationFailed, match="a worker cannot answer: ModuleNotFoundError"):
            run_study(parts, workers, gone.solve)
    assert not parts.folder.exists()


def test_a_part_that_another_runner_writes_meanwhile_is_counted_not_computed(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 30)
    asked = []

    def both(loaded, start, stop, inside):
        asked.append(start)
        if len(asked) == 1:
            run_study(parts, Here())
        return strange.answer(loaded, start, stop, inside)

    progress = run_study(parts, Here(), both)
    assert len(asked) <= Here.width + 1
    assert progress.counts.total() == 300


def test_the_folder_stays_small_in_the_runner(study, tmp_path):
    """Chunks under way are bounded by the width of the pool, however long the study."""
    parts = parts_of(load_study(study(designs=400)), tmp_path, 10)
    held = []

    def watching(loaded, start, stop, inside):
        held.append(len(list(parts.folder.glob("*.parquet"))) if parts.folder.exists() else 0)
        return strange.plain(loaded, start, stop, inside)

    run_study(parts, Here(), watching)
    behind = [asked - written for asked, written in enumerate(held)]
    assert max(behind) <= 3 * Here.width  # asked for, computing and being written


def test_progress_tells_rate_and_time_left():
    step = Progress(10_000, 1000, Counter({("ok", ""): 2800, ("time limit", "x"): 200}))
    assert said(step, 40.0) == "3,000/10,000 designs, 50/s, 2 min 20 s left, 200 failed"
    assert said(step._replace(known=3000), 1.0).endswith("waiting for the first, 200 failed")


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2", "1/2/3", "", "\uff11/2", "1/9999999"])
def test_bad_shards_are_refused(text):
    with pytest.raises(BadInput, match="--shard"):
        shard_of(text)


def test_commands_run_count_and_collect(flexfem, study, tmp_path):
    path = study()
    code, out, _ = flexfem("study", "status", path, "--json")
    assert (code, json.loads(out)["open"]) == (0, 300)
    code, _, err = flexfem("study", "collect", path)
    assert code == 2 and "300 of 300 designs are open" in err and err.count("\n") == 1
    code, out, _ = flexfem("study", "run", path, "--workers", 1, "--shard", "2/2", "--json")
    about = json.loads(out)
    assert (code, about["designs"], about["open_elsewhere"]) == (0, 0, 300)  # one chunk, which is the other shard's
    code, out, _ = flexfem("study", "run", path, "--workers", 1, "--json")
    facts = json.loads(out)
    assert (facts["open"], facts["done"], facts["next"]) == (0, 300, f"flexfem study plot {path}")
    for target in ("t.csv", "t.parquet"):
        code, out, _ = flexfem("study", "collect", path, "--to", target, "--json")
        assert json.loads(out) == {"written": [target], "designs": 300, "open": 0}
    assert (Path("t.csv")).read_text().count("\n") == 301
    assert len(pq.read_table("t.parquet")) == 300


@pytest.mark.slow
def test_plot_collects_and_draws(flexfem, study, tmp_path):
    path = study(edit=("[sampling]", '[[figure]]\nkind = "distribution"\nvalues = ["kxx_n_per_mm"]\n[sampling]'))
    assert flexfem("study", "run", path, "--workers", 1)[0] == 0
    code, out, _ = flexfem("study", "plot", path, "--json")
    assert code == 0
    found = json.loads(out)["written"]
    assert found[0] == "reports/necks/necks.parquet" and {Path(name).suffix for name in found[1:]} == {".png", ".pdf"}
    assert all(Path(name).stat().st_size > 1000 for name in found)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "--shard", "3/2"], "--shard 3/2"),
        (["run", "--workers", "1", "--scheduler", "127.0.0.1:1"], "--workers with --scheduler"),
        (["run", "--scheduler", "nonsense://x"], "expected host:port"),
        (["collect", "--to", "t.xlsx"], "expected a file name that ends in"),
    ],
)
def test_bad_options_are_refused_in_one_line(flexfem, study, arguments, said):
    code, out, err = flexfem("study", arguments[0], study(), *arguments[1:])
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err


def test_a_partial_table_lacks_the_open_designs_only(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 64)
    run_study(parts, Here(), shard=Shard(1, 2))
    with pytest.raises(BadInput, match="172 of 300 designs are open"):
        collect(parts, tmp_path / "t.parquet")
    made = collect(parts, tmp_path / "t.parquet", partial=True)
    assert (made.designs, made.open) == (128, 172)
    assert pq.read_table(made.path)["design"].to_pylist() == [*range(64, 128), *range(192, 256)]


@pytest.mark.parametrize("address", ["nonsense", "", "tcp://", "http://localhost:80", "inproc://x", "/no/such.json"])
def test_what_is_no_address_of_a_scheduler_is_refused_at_once(flexfem, study, address):
    code, _, err = flexfem("study", "run", study(), "--scheduler", address)
    assert code == 2 and err.count("\n") == 1 and "expected host:port" in err


def test_a_pipe_in_the_place_of_a_part_is_named_and_replaced(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path, 100)
    run_study(parts, Here())
    path = parts.path(parts.chunk(1))
    whole = path.read_bytes()
    path.unlink()
    os.mkfifo(path)
    told = []
    run_study(parts, Here(), say=told.append)
    assert len(told) == 1 and str(path) in told[0]
    assert path.read_bytes() == whole


def test_processors_that_round_otherwise_are_refused_not_mixed_and_nothing_moves(study, tmp_path, monkeypatch):
    loaded = load_study(study())
    own, other = parts_of(loaded, tmp_path, 30), parts_of(loaded, tmp_path, 30)
    other.__dict__["versions"] = dict(own.versions) | {"arithmetic": "0123456789abcdef"}
    refused = []

    def beside(loaded, start, stop, inside):
        if not refused:  # before there is a part
            with pytest.raises(
                BadInput, match=r"of arithmetic \w{16}, those of this .* 0123456789abcdef: .*OPENBLAS_CORETYPE"
            ):
                run_study(other, Here())
            refused.append(sorted(tmp_path.rglob("*.parquet")))
        return strange.plain(loaded, start, stop, inside)

    run_study(own, Here(), beside, shard=Shard(0, 2))
    before = sorted(own.folder.iterdir())
    with pytest.raises(BadInput, match="OPENBLAS_CORETYPE"):
        run_study(other, Here())
    assert refused == [[]] and sorted(own.folder.iterdir()) == before and len(before) == 5
    release_folder(own)  # its own: stays
    with pytest.raises(BadInput, match="OPENBLAS_CORETYPE"):
        run_study(other, Here())
    release_folder(other)  # as study clean does there
    run_study(other, Here(), strange.plain)
    with pytest.raises(BadInput, match="OPENBLAS_CORETYPE"):
        run_study(own, Here())


def test_open_designs_in_the_end_are_no_success_and_a_folder_in_the_way_is_named(flexfem, study, monkeypatch):
    path, spoilt = study("fe", 32), []

    @contextmanager
    def here(*_):
        yield Here()

    def spoiling(parts, pool, solve=None, **more):
        made = run_study(parts, pool, strange.plain, **more)
        first, second = (parts.path(parts.chunk(number)) for number in (0, 1))
        if not spoilt:
            first.unlink()
            second.unlink()
            second.mkdir()
        spoilt.append(second)
        return made

    monkeypatch.setattr("flexfem.studies.pool_for", here)
    monkeypatch.setattr("flexfem.study.run.run_study", spoiling)
    code, out, err = flexfem("study", "run", path)
    lines = err.splitlines()
    assert code == 1 and "32 designs, 32 open" in out
    assert lines[-1].startswith(
        "flexfem: 2 parts of this run are not in reports/necks/parts: the same command computes"
    )
    assert lines[-1].endswith(f"; first remove {spoilt[0]}, which is no file")
    code, out, err = flexfem("study", "run", path)
    assert code == 1 and "32 designs, 16 open" in out and "a folder in the place of a part: remove it" in err
    spoilt[0].rmdir()
    code, out, err = flexfem("study", "run", path)
    assert (code, err) == (0, "") and "32 designs, 0 open" in out


def test_a_warning_is_said_once_before_the_run(flexfem, study, monkeypatch):
    @contextmanager
    def here(*_):
        yield Here()

    monkeypatch.setattr("flexfem.studies.pool_for", here)
    shown = '[[figure]]\nkind = "distribution"\nvalues = ["kxx_n_per_mm"]\n[sampling]'
    path = study(
        designs=4,
        edit=(
            "[sampling]",
            f'[[factor]]\nkey = "material.yield_strength_mpa"\nsd = 1.0\ndistribution = "normal"\n{shown}',
        ),
    )
    code, out, err = flexfem("study", "run", path)
    assert code == 0
    assert err.count("changes none of kxx_n_per_mm") == 1 and "changes none" not in out
    assert "changes none of kxx_n_per_mm" in flexfem("study", "status", path)[1]


def test_a_partial_table_of_nothing_replaces_none(study, tmp_path):
    parts = parts_of(load_study(study()), tmp_path)
    with pytest.raises(BadInput, match="300 of 300 designs are open, expected some"):
        collect(parts, tmp_path / "t.parquet", partial=True)
    assert not (tmp_path / "t.parquet").exists()


@pytest.mark.slow
def test_a_run_that_answers_nothing_and_fails_exits_with_one_and_names_the_cure(flexfem, study):
    path = study("fe", 2, edit=("[sampling]", "resolution = 64\n[sampling]"))  # more triangles than are allowed
    code, out, _ = flexfem("study", "run", path)
    assert code == 1 and " 0 ok" in out and "study run --retry" in out


@pytest.mark.slow
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_closed_standard_streams_take_no_worker_along(flexfem, study, closed):
    path = study("fe", 3)
    command = f"exec {sys.executable} -m flexfem study run {path} --workers 2 {closed}"
    subprocess.run(["sh", "-c", command], check=True, capture_output=True, timeout=120)
    code, out, _ = flexfem("study", "status", path, "--json")
    facts = json.loads(out)
    assert (code, facts["open"], facts["failed"]) == (0, 0, 0) and facts["ok"] > 0
