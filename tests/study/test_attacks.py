"""A run under attack: sources edited, clusters stopped, folders spoilt. No wrong row, no wait without a word."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pyarrow.parquet as pq
import pytest

from flexfem.study.cluster import DaskPool
from flexfem.study.collect import collect
from flexfem.study.content import kept_rows
from flexfem.study.loaded import load_study
from flexfem.study.parts import parts_of
from flexfem.study.pool import LocalPool
from flexfem.study.run import run_study

sys.path.insert(0, str(Path(__file__).parent))  # workers import what they are to run

import strange

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
STUDY = f"""
name = "necks under attack"
stage = "{ROOT}/geometry/mobility6.toml"
model = "fe"
resolution = 4
[sampling]
method = "monte_carlo"
designs = 48
seed = 29
[[factor]]
key = "override.*.*.neck_mm"
distribution = "normal"
sd = 0.05
"""
MESHER = "flexfem/fem/mesher.py"
OLD, NEW = '"Mesh.Algorithm": 6', '"Mesh.Algorithm": 5'


def until(condition, seconds=60.0):
    """Wait for a condition; returns whether it came true."""
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        if condition():
            return True
        time.sleep(0.02)
    return False


class Attacked:
    """A study in a folder of its own, and a copy of the package whose sources may be edited."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.path, self.package = folder, folder / "attacked.toml", folder / "copy"
        self.path.write_text(STUDY)
        shutil.copytree(ROOT / "flexfem", self.package / "flexfem", ignore=shutil.ignore_patterns("__pycache__"))

    def environment(self, package=None):
        return {**os.environ, "PYTHONPATH": os.pathsep.join([str(package or self.package), str(HERE)])}

    def start(self, *more, output="out"):
        command = [sys.executable, "-m", "flexfem", "study", "run", str(self.path), "--output", output, *more]
        return subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.environment(), cwd=self.folder
        )

    def edit(self, old=OLD, new=NEW):
        path = self.package / MESHER
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    def parts(self, output="out"):
        return sorted((self.folder / output / "attacked" / "parts").glob("*.parquet"))

    def bytes(self, output="out"):
        return {path.name: path.read_bytes() for path in self.parts(output)}


@pytest.fixture
def attacked(tmp_path):
    return Attacked(tmp_path)


class Cluster:
    """A Dask scheduler and workers of one thread, with the package that is attacked."""

    def __init__(self, attacked: Attacked, workers: int, package: Path | None = None) -> None:
        pytest.importorskip("distributed")
        self.folder = attacked.folder / "dask"
        self.folder.mkdir()
        self.file, self.environment = self.folder / "scheduler.json", attacked.environment(package)
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        assert until(self.file.exists)
        self.workers = [self.add() for _ in range(workers)]
        self.address = json.loads(self.file.read_text())["address"]

    def _start(self, what, *more):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(self.file), *more]
        with (self.folder / f"{what}.log").open("a") as log:
            return subprocess.Popen(command, stdout=log, stderr=log, env=self.environment, cwd=self.folder)

    def add(self, *more):
        return self._start("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1", *more)

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(attacked):
    made = []

    def start(workers, package=None):
        made.append(Cluster(attacked, workers, package))
        return made[0]

    yield start
    for each in made:
        each.close()


def workers_of(process):
    """Worker processes that a runner or a Dask worker has started."""
    found = psutil.Process(process.pid).children(recursive=True)
    return [child for child in found if "flexfem.study.worker" in " ".join(child.cmdline())]


@pytest.mark.parametrize("dask", [False, True])
def test_no_row_of_an_edited_source_lies_under_the_name_of_the_old_one(attacked, cluster, dask):
    """Workers that have begun go on with what was hashed; one that begins after the edit stops the run."""
    grid = cluster(2) if dask else None
    where = ("--scheduler", grid.address) if grid else ("--workers", "2")
    whole = attacked.start(*where, output="whole")
    assert whole.communicate(timeout=900) and whole.returncode == 0
    runner = attacked.start(*where)
    assert until(lambda: len(attacked.parts()) >= 1)
    attacked.edit()
    starters = grid.workers if grid else [runner]
    hit = [workers_of(each)[0] for each in starters]
    for worker in hit:
        worker.kill()
    _, err = runner.communicate(timeout=900)
    print(err)
    assert runner.returncode == 1
    assert err.splitlines()[-1] == (
        f"flexfem: {MESHER} is not what it was when this command began; what is done is kept, run again"
    )
    expected = attacked.bytes("whole")
    assert 0 < len(attacked.parts()) < len(expected)
    assert all(expected[name] == content for name, content in attacked.bytes().items())
    again = attacked.start("--workers", "2")
    assert again.communicate(timeout=900) and again.returncode == 0
    assert not {path.name for path in attacked.parts()} & set(expected)  # new code, new names
    attacked.edit(NEW, OLD)
    back = attacked.start("--workers", "2")
    assert back.communicate(timeout=900) and back.returncode == 0
    assert attacked.bytes() == expected


class Late(Exception):  # noqa: N818
    """A run that goes on for ever."""


def watched(parts, pool, solve, seconds=400.0):
    """Run a study; raises Late where it hangs. Returns rows by design."""
    began = time.monotonic()

    def watch(progress):
        if time.monotonic() - began > seconds:
            raise Late(progress)

    try:
        run_study(parts, pool, solve, watch=watch)
    finally:
        pool.close()
    return table_of(parts)


def table_of(parts):
    return pq.read_table(collect(parts, parts.folder.parent / "table.parquet").path).to_pydict()


def test_a_design_that_hangs_under_dask_is_a_row_with_its_reason(attacked, cluster, monkeypatch):
    monkeypatch.setattr("flexfem.study.run.STARTUP", 1.0)
    attacked.path.write_text(
        STUDY.replace("designs = 48", "designs = 12").replace("[sampl", "time_limit_s = 2\n[sampl")
    )
    parts = parts_of(load_study(attacked.path), attacked.folder / "out")
    made = watched(parts, DaskPool(cluster(2, ROOT).address), strange.strange)
    assert {n: s for n, s in zip(made["design"], made["status"], strict=True) if s != "ok"} == {
        strange.HANGS: "time limit",
        strange.KILLED: "crashed",
    }
    assert made["reason"][strange.HANGS] == "no answer in 2 s and 1 s more"


def test_what_a_paused_dask_worker_holds_is_asked_of_another(attacked, cluster, monkeypatch):
    """Paused as for memory: it keeps what it has, and begins nothing."""
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__WORK_STEALING", "False")  # which often helps, not always
    monkeypatch.setattr("flexfem.study.cluster.PAUSED", 1.0)
    monkeypatch.setattr("flexfem.study.cluster.SLACK", 1e9)
    monkeypatch.setattr("flexfem.study.cluster.COUNTED", 0.5)
    attacked.path.write_text(STUDY.replace("designs = 48", "designs = 40"))
    parts, pool = parts_of(load_study(attacked.path), attacked.folder / "out"), DaskPool(cluster(2, ROOT).address)
    assert until(lambda: len(pool._client.scheduler_info()["workers"]) == 2)
    paused = []

    def pausing(dask_worker):
        from distributed.core import Status

        dask_worker.status = Status.paused

    def submitted(*task, submit=pool.submit):
        future = submit(*task)
        if len(pool._asked) >= 4 and not paused:
            paused.append(min(pool._client.scheduler_info()["workers"]))
            pool._client.run(pausing, workers=paused)
        return future

    monkeypatch.setattr(pool, "submit", submitted)
    made = watched(parts, pool, strange.plain)
    assert paused and made["design"] == list(range(40)) and set(made["status"]) == {"ok"}


def test_a_killed_run_computes_no_finished_design_again_and_ends_in_the_same_bytes(attacked):
    whole = attacked.start("--workers", "2", output="whole")
    assert whole.communicate(timeout=900) and whole.returncode == 0
    runner, loaded = attacked.start("--workers", "1"), load_study(attacked.path)
    parts = parts_of(loaded, attacked.folder / "out")

    def finished():
        return {k for number in range(parts.count) for k in kept_rows(parts, parts.chunk(number))}

    assert until(lambda: len(finished()) >= 3)
    runner.kill()
    runner.communicate()
    before, asked = finished(), []
    assert before and not attacked.parts()

    class Here:
        width = 1

        def submit(self, solve, loaded, start, stop, limit):
            asked.extend(range(start, stop))
            return pool.submit(solve, loaded, start, stop, limit)

        def __getattr__(self, name):
            return getattr(pool, name)

    pool = LocalPool(1)
    try:
        run_study(parts, Here())
    finally:
        pool.close()
    assert sorted(asked) == sorted(set(range(48)) - before)
    assert attacked.bytes() == attacked.bytes("whole")
    assert not list(parts.folder.glob(".*"))
