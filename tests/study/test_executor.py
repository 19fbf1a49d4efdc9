"""Studies on other executors: the table of one process, whichever threads or machines compute and
however they end.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from flexfem.refused import BadInput, ComputationFailed
from flexfem.studies import collect_study, run_study, status_facts
from flexfem.study import workers as worker_module
from flexfem.study.loaded import load_study
from flexfem.study.run import parts_of, read_part, run_parts, survey
from flexfem.study.workers import ExecutorWorkers, compute_alone, versions_of

from .test_run import Here, require_same, table, write

sys.path.insert(0, str(Path(__file__).parent))  # workers import what they are to run

import strange

LATE = 90.0  # s, after which a run hangs


class Immediate(Executor):
    """Computes at once, in this process."""

    def submit(self, function, /, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class KilledWorker(Exception):  # noqa: N818
    """What Dask says of a task during which several workers have died."""


class Deadly(Immediate):
    """An executor whose workers die of one design."""

    def submit(self, function, /, *arguments):
        if strange.KILLED not in arguments[5]:
            return super().submit(function, *arguments)
        future = Future()
        future.set_exception(KilledWorker("Attempted to run a task on 4 different workers"))
        return future


class Silent(Executor):
    """An executor without workers, or with paused ones; remembers its futures."""

    def __init__(self):
        self.futures = []

    def submit(self, function, /, *arguments):
        self.futures.append(Future())
        return self.futures[-1]


@pytest.fixture
def loaded(tmp_path):
    return load_study(write(tmp_path, designs=300))


def test_threads_of_an_executor_give_the_table_of_one_process(loaded, tmp_path):
    """The Sobol sequence of a process has one position."""
    here = parts_of(loaded, tmp_path / "here", 10)
    there = parts_of(loaded, tmp_path / "there", 10)
    run_parts(here, Here())
    with ThreadPoolExecutor(8) as pool:
        run_parts(there, ExecutorWorkers(pool), shard=slice(0, None, 2))
        for chunk in there.chunks()[:4:2]:
            there.path(chunk).write_bytes(b"PAR1 torn")
        known = run_parts(there, ExecutorWorkers(pool))
    assert known == 130  # of 150 in the share, without the torn parts
    require_same(there, here)
    for chunk in here.chunks():
        assert read_part(there, chunk).equals(read_part(here, chunk))  # the same seals, too


def test_workers_elsewhere_need_no_folder_in_common(loaded, tmp_path, monkeypatch):
    """The runner writes the parts: here its folder is relative, and that of the workers another."""
    (tmp_path / "far").mkdir()

    class Far(Immediate):
        def submit(self, function, /, *arguments):
            monkeypatch.chdir(tmp_path / "far")
            try:
                return super().submit(function, *arguments)
            finally:
                monkeypatch.chdir(tmp_path)

    monkeypatch.chdir(tmp_path)
    facts = run_study("necks.toml", "reports", executor=Far())
    assert (facts["ok"] + facts["refused"], facts["open"]) == (300, 0)
    assert (
        collect_study("necks.toml", "reports")["designs"] == 300
        and os.listdir(tmp_path / "far") == []
    )


def test_a_design_of_which_workers_die_is_named_and_costs_no_other(loaded, tmp_path):
    parts = parts_of(loaded, tmp_path, 32)
    run_parts(parts, ExecutorWorkers(Deadly()), strange.plain)
    rows = table(parts).to_pylist()
    bad = [(row["design"], row["status"], row["reason"]) for row in rows if row["status"] != "ok"]
    assert bad == [(strange.KILLED, "crashed", "the worker died")]
    assert all(row["kxx_n_per_mm"] == row["design"] for row in rows if row["status"] == "ok")


def test_a_run_on_an_executor_that_never_answers_ends_in_one_line(loaded, tmp_path, monkeypatch):
    monkeypatch.setattr(worker_module, "SILENCE", 0.3)
    monkeypatch.setattr("flexfem.study.run.ANALYTIC_LIMIT", 0.2)
    parts = parts_of(loaded, tmp_path, 100)
    silent = Silent()
    with pytest.raises(
        ComputationFailed, match=r"no result of 3 tasks in 0\.5 s: does the executor have workers"
    ):
        run_parts(parts, ExecutorWorkers(silent))
    assert [future.cancelled() for future in silent.futures] == [True] * 3
    assert status_facts(parts)["open"] == 300


def test_an_executor_that_is_shut_or_breaks_ends_the_run_in_one_line(loaded, tmp_path):
    shut = ThreadPoolExecutor(1)
    shut.shutdown()
    with pytest.raises(
        ComputationFailed, match="the executor takes no tasks: RuntimeError: cannot schedule"
    ):
        run_parts(parts_of(loaded, tmp_path), ExecutorWorkers(shut))

    class Gone(Silent):
        def submit(self, function, /, *arguments):
            future = super().submit(function)
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with pytest.raises(
        ComputationFailed, match="the executor has lost its workers: CancelledError"
    ):
        run_parts(parts_of(loaded, tmp_path), ExecutorWorkers(Gone()))


def test_a_worker_with_threads_computes_one_task_at_a_time():
    """Samples, meshers and solvers keep their state in the process."""
    inside = []
    together = []

    def task(number):
        inside.append(number)
        time.sleep(0.01)
        together.append(len(inside))
        inside.remove(number)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda number: compute_alone(versions_of(), task, number), range(8)))
    assert together == [1] * 8


def test_a_worker_with_other_versions_is_refused():
    assert compute_alone(versions_of(), max, 1, 2) == 2
    with pytest.raises(
        BadInput, match=r"a worker has numpy .*, the runner 1\.0, expected the same versions"
    ):
        compute_alone(dict(versions_of()) | {"numpy": "1.0"}, max, 1, 2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"executor": "dask"}, "executor 'dask', expected one of concurrent.futures"),
        (
            {"executor": Immediate(), "workers": 2},
            "workers = 2, expected none with a scheduler or an executor",
        ),
        (
            {"executor": Immediate(), "scheduler": "a:1"},
            "scheduler and executor, expected one of them",
        ),
        (
            {"scheduler": "nowhere"},
            "--scheduler nowhere: expected host:port of a Dask scheduler, or its scheduler file",
        ),
    ],
)
def test_wrong_executors_are_refused(loaded, tmp_path, given, said):
    with pytest.raises(BadInput) as refused:
        run_study(loaded.path, tmp_path / "reports", **given)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_missing_package_or_scheduler_is_named(loaded, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        BadInput, match=r"--scheduler a:1: Dask is not installed, expected flexfem\[dask\]"
    ):
        run_study(loaded.path, tmp_path / "reports", scheduler="a:1")


def paused_and_killed(pids, parts, said):
    """Kill one worker and pause the other as soon as both have returned parts."""
    ends = time.monotonic() + LATE
    while len(survey(parts).counts) < 4 and time.monotonic() < ends:
        time.sleep(0.02)
    os.kill(pids[0], signal.SIGSTOP)
    os.kill(pids[1], signal.SIGKILL)
    said.append(len(survey(parts).counts))


@pytest.mark.slow
def test_a_cluster_with_a_killed_and_a_paused_worker_gives_the_table_of_one_process(tmp_path):
    """The scheduler notices the paused worker by its time to live, and repeats its task and that of
    the killed one.
    """
    dask = pytest.importorskip("dask")
    distributed = pytest.importorskip("distributed")
    loaded = load_study(write(tmp_path, designs=600))
    here = parts_of(loaded, tmp_path / "here", 12)
    there = parts_of(loaded, tmp_path / "there", 12)
    run_parts(here, Here())
    said = []
    with (
        dask.config.set(
            {
                "distributed.scheduler.worker-ttl": "3s",
                "distributed.logging.distributed": "critical",
            }
        ),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        pids = list(client.run(os.getpid).values())
        chaos = threading.Thread(target=paused_and_killed, args=(pids, there, said))
        chaos.start()
        began = time.monotonic()
        try:
            run_parts(there, ExecutorWorkers(client.get_executor()), strange.slow)
            lasted = time.monotonic() - began
        finally:
            chaos.join()
            if psutil.pid_exists(pids[0]):
                os.kill(pids[0], signal.SIGKILL)
    assert 4 <= said[0] < 50 and lasted < LATE  # in the middle of the run
    require_same(there, here)


@pytest.mark.slow
def test_the_command_computes_on_a_scheduler_by_its_address_or_file(tmp_path):
    distributed = pytest.importorskip("distributed")
    path = write(tmp_path, designs=40)
    command = [sys.executable, "-m", "flexfem", "study", "run", str(path), "-o"]
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        file = tmp_path / "scheduler.json"
        client.write_scheduler_file(str(file))
        for name, scheduler in (("by address", cluster.scheduler_address), ("by file", str(file))):
            done = subprocess.run(
                [*command, str(tmp_path / name), "--scheduler", scheduler],
                capture_output=True,
                text=True,
                timeout=LATE,
            )
            assert done.returncode == 0 and "40 designs, 0 unfinished" in done.stdout, done.stderr
    done = subprocess.run(
        [*command, str(tmp_path / "gone"), "--scheduler", cluster.scheduler_address],
        capture_output=True,
        text=True,
        timeout=LATE,
    )
    assert done.returncode == 2 and "expected host:port of a Dask scheduler" in done.stderr
    assert [line for line in done.stderr.splitlines() if not line.startswith("study: ")][
        1:
    ] == [], done.stderr
