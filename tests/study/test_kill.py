"""Runners and workers that are killed, share a folder, run out of disk or of their cluster: the table is the same."""

from __future__ import annotations

import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from flexfem.refused import ComputationFailed
from flexfem.study.cluster import DaskPool
from flexfem.study.collect import collect
from flexfem.study.folder import survey
from flexfem.study.loaded import load_study
from flexfem.study.parts import parts_of
from flexfem.study.pool import LocalPool
from flexfem.study.run import run_study
from flexfem.study_answers import status_facts

sys.path.insert(0, str(Path(__file__).parent))  # workers import what they are to run

import strange

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent
ROOT = HERE.parent.parent
SIZE, DESIGNS = 16, 2800
MOMENTS = 20
STUDY = f"""
name = "a study to be killed"
stage = "{ROOT}/geometry/mobility6.toml"
model = "analytic"

[sampling]
method = "sobol"
designs = {DESIGNS}
seed = 7

[[factor]]
key = "override.*.*.neck_mm"
distribution = "normal"
sd = 0.03

[[factor]]
key = "hinges.base.radius_mm"
from = 1.0
to = 6.0
"""


class Kept:
    """A study, its uninterrupted table, and runners of it on a folder of their own."""

    def __init__(self, folder: Path, reference: bytes) -> None:
        self.folder, self.path, self.reference = folder, folder / "killed.toml", reference
        self.path.write_text(STUDY)

    def parts(self, output="out"):
        return parts_of(load_study(self.path), self.folder / output, SIZE)

    def start(self, output="out", workers=2, shard="1/1", address="", **more):
        script = [sys.executable, str(HERE / "strange.py"), str(self.path), str(self.folder / output)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(HERE)])}
        return subprocess.Popen(
            [*script, str(SIZE), str(workers), shard, address],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            **more,
        )

    def finish(self, *runners):
        for runner in runners:
            out, err = runner.communicate(timeout=120)
            assert runner.returncode == 0, err
            print(out.split("\n")[-2], end="; ")

    def same(self, output="out"):
        made = collect(self.parts(output), self.folder / f"{output}.parquet").path.read_bytes()
        return made == self.reference


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    folder = tmp_path_factory.mktemp("uninterrupted")
    kept = Kept(folder, b"")
    parts, pool = kept.parts(), LocalPool(2)
    try:
        run_study(parts, pool)
    finally:
        pool.close()
    facts = status_facts(parts)
    assert facts["ok"] > 0 and facts["refused"] > 0
    return collect(parts, folder / "out.parquet").path.read_bytes()


@pytest.fixture
def kept(tmp_path, reference):
    return Kept(tmp_path, reference)


def until(condition, seconds=60.0):
    """Wait for a condition; returns whether it came true."""
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        if condition():
            return True
        time.sleep(0.01)
    return False


def children(runner):
    """The workers of a runner, without the process by which Python tracks its semaphores."""
    try:
        found = psutil.Process(runner.pid).children(recursive=True)
        return [child for child in found if "resource_tracker" not in " ".join(child.cmdline())]
    except psutil.Error:
        return []


def gone(processes):
    return all(not p.is_running() or p.status() == psutil.STATUS_ZOMBIE for p in processes)


def written(kept, output="out"):
    return len(list((kept.folder / output / "killed" / "parts").glob("*.parquet")))


def test_killed_at_random_moments_the_table_is_that_of_an_uninterrupted_run(kept):
    draw = random.Random(20)
    runner, runners, log = kept.start(), 1, []
    try:
        for _ in range(MOMENTS):
            before = written(kept)
            if draw.random() < 0.8:  # else it is still starting, or has just been started again
                assert until(lambda before=before, runner=runner: written(kept) > before or runner.poll() is not None)
            time.sleep(draw.uniform(0.0, 0.4))
            assert runner.poll() is None, "the study is too short for so many kills"
            workers = children(runner)
            whom = draw.choice(["runner", "worker"]) if workers else "runner"
            if whom == "worker":
                draw.choice(workers).kill()
            else:
                runner.kill()
                runner.communicate()
                assert until(lambda workers=workers: gone(workers)), "workers outlived their runner"
                runner, runners = kept.start(), runners + 1
            log.append(f"{whom} {written(kept)}")
            assert not survey(kept.parts()).damaged
        kept.finish(runner)
    finally:
        runner.kill()
    print(f"{runners} runners; killed when so many of {kept.parts().count} parts were there: {', '.join(log)}")
    assert kept.same()


def test_a_hanging_design_does_not_keep_a_worker_alive_after_its_runner(kept):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "if __name__ == '__main__':\n"
        "    import strange; from pathlib import Path\n"
        "    parts = strange.parts_of(strange.load_study(sys.argv[2]), Path(sys.argv[3]), 1)\n"
        "    pool = strange.LocalPool(2)\n"
        "    print('running', flush=True)\n"
        "    strange.run_study(parts, pool, strange.hanging)\n"
    )
    path = kept.folder / "hanging.py"
    path.write_text(script)
    runner = subprocess.Popen([sys.executable, path, HERE, kept.path, kept.folder / "out"], stdout=subprocess.PIPE)
    assert runner.stdout and runner.stdout.readline()
    assert until(lambda: len(children(runner)) == 2)
    workers = children(runner)
    assert until(lambda: all(worker.cpu_times().user > 1.5 for worker in workers), 60), "gmsh does not hang"
    runner.kill()
    began = time.monotonic()
    assert until(lambda: gone(workers), 5.0)
    print(f"workers in gmsh were gone after {time.monotonic() - began:.2f} s")
    runner.communicate()


def test_two_shards_make_the_table_of_one_run(kept):
    kept.finish(kept.start(workers=1, shard="1/2"), kept.start(workers=1, shard="2/2"))
    assert kept.same()


def test_two_runners_on_one_folder_make_the_table_of_one_run(kept):
    runners = [kept.start(workers=1), kept.start(workers=1)]
    kept.finish(*runners)
    assert kept.same()


def test_two_runners_of_which_one_is_killed_make_the_table_of_one_run(kept):
    first, second = kept.start(workers=1), kept.start(workers=1)
    assert until(lambda: written(kept) > 20)
    first.kill()
    first.communicate()
    kept.finish(second)
    assert kept.same()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_by_a_signal_parts_are_kept_and_workers_gone(kept, number, code):
    command = [sys.executable, "-m", "flexfem", "study", "run", kept.path, "--workers", "2", "--output", kept.folder]
    kept.path.write_text(STUDY.replace(f"designs = {DESIGNS}", "designs = 3000000"))
    runner = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    folder = kept.folder / "killed" / "parts"
    assert until(lambda: len(list(folder.glob("*.parquet"))) > 3)
    workers = children(runner)
    runner.send_signal(number)
    _, err = runner.communicate(timeout=60)
    assert runner.returncode == code
    said = [line for line in err.splitlines() if "designs, " not in line]  # without the progress of a slow machine
    assert len(said) == 1
    kept_designs = re.fullmatch(r"flexfem: stopped; ([\d,]+) of 3,000,000 designs are kept in (\S+), the .*", said[0])
    assert int(kept_designs[1].replace(",", "")) >= 4 * 8192
    assert gone(workers)
    parts = parts_of(load_study(kept.path), kept.folder)
    assert not survey(parts).damaged and not list(folder.glob(".*"))


@contextmanager
def small_disk(folder, size):
    folder.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", folder], capture_output=True)
    if made.returncode:
        pytest.skip(f"no tmpfs may be mounted here: {made.stderr.decode().strip()}")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def test_a_full_disk_is_one_line_loses_nothing_and_more_disk_completes(kept):
    with small_disk(kept.folder / "out", "600k"):
        runner = kept.start()
        workers = []
        while runner.poll() is None:
            workers = children(runner) or workers
            time.sleep(0.05)
        _, err = runner.communicate()
        print(err.strip().replace(str(kept.folder), "..."), f"({written(kept)} parts)")
        assert runner.returncode == 2
        assert err.count("\n") == 1 and "No space left on device" in err
        assert gone(workers)
        found = survey(kept.parts())
        assert found.done and not found.damaged
        assert not list((kept.folder / "out/killed/parts").glob(".*"))
        subprocess.run(["mount", "-o", "remount,size=50m", kept.folder / "out"], check=True)
        kept.finish(kept.start())
        assert kept.same()


def test_a_file_that_may_not_grow_is_one_line_and_leaves_no_part(kept):
    limit = 4096  # bytes; a part of this study is larger

    def small():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    runner = kept.start(preexec_fn=small)
    _, err = runner.communicate(timeout=60)
    assert runner.returncode == 2
    assert err.count("\n") == 1 and "cannot be written: File too large" in err
    left = list((kept.folder / "out/killed/parts").iterdir())
    assert [path.name for path in left if path.suffix != ".rows"] == []
    kept.finish(kept.start())
    assert kept.same()


class Cluster:
    """A Dask scheduler and two workers of one thread, as processes of their own."""

    def __init__(self, folder: Path, knows: Path = HERE) -> None:
        file = folder / "scheduler.json"
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(knows)])}
        environment["DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED"] = "False"
        log = (folder / "dask.log").open("w")

        def start(what, *more):
            command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(file), *more]
            return subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=folder)

        self.scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        assert until(file.exists, 60), (folder / "dask.log").read_text()
        common = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        self.workers = [start("worker", *common) for _ in range(2)]
        log.close()
        self.address = json.loads(file.read_text())["address"]

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path):
    pytest.importorskip("distributed")
    folder = tmp_path / "dask"
    folder.mkdir()
    cluster = Cluster(folder)
    yield cluster
    cluster.close()


def test_a_dask_cluster_makes_the_same_table_though_a_worker_is_killed(kept, cluster):
    runner = kept.start(address=cluster.address)
    assert until(lambda: written(kept) >= 20, 60), runner.communicate(timeout=1)
    cluster.workers[0].kill()
    print(f"a worker killed at {written(kept)} parts", end="; ")
    kept.finish(runner)
    assert kept.same()


def test_a_lost_scheduler_is_one_line_and_parts_are_kept(kept, cluster):
    runner = kept.start(address=cluster.address)
    assert until(lambda: written(kept) >= 5, 60)
    cluster.scheduler.kill()
    began = time.monotonic()
    _, err = runner.communicate(timeout=120)
    print(f"after {time.monotonic() - began:.1f} s: {err.strip()}")
    assert runner.returncode == 1
    assert err.count("\n") == 1 and "lost; parts are kept" in err
    assert not survey(kept.parts()).damaged
    kept.finish(kept.start())
    assert kept.same()


def test_dask_workers_that_lack_the_code_are_one_line(kept, tmp_path):
    pytest.importorskip("distributed")
    cluster = Cluster(tmp_path, ROOT)
    try:
        pool = DaskPool(cluster.address)
        try:
            with pytest.raises(ComputationFailed, match=r"a worker cannot answer: \w+Error: ") as lack:
                run_study(kept.parts(), pool, strange.slow)
        finally:
            pool.close()
    finally:
        cluster.close()
    assert "\n" not in str(lack.value)
    assert not (kept.folder / "out").exists()


def test_a_scheduler_that_is_not_there_is_refused(kept):
    runner = kept.start(address="tcp://127.0.0.1:9")
    _, err = runner.communicate(timeout=60)
    assert runner.returncode == 2
    assert err.count("\n") == 1 and "no scheduler answers there" in err
