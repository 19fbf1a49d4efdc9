"""Dask schedulers that do not speak or have no workers: said in a line, and waited for no longer than told."""

from __future__ import annotations

import sys
import threading
from types import SimpleNamespace

import pytest

from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.cluster import DaskPool

ADDRESS = "tcp://127.0.0.1:8786"


class Closed(Exception):  # noqa: N818  as there
    """As Dask's ClosedClientError, whose only base is Exception."""


@pytest.fixture
def dask(monkeypatch):
    """Dask by a client that is told which workers there are."""
    about = SimpleNamespace(workers={}, connects=threading.Event())
    about.connects.set()

    class Client:
        status = "running"

        def __init__(self, address, timeout, set_as_default):
            about.connects.wait(30)

        def scheduler_info(self, n_workers):
            return {"workers": about.workers}

        def processing(self, workers):
            return {}

        def submit(self, *task, pure):
            raise Closed("Client is closed")

        def close(self, timeout):
            raise Closed("Client is closed")

    made = SimpleNamespace(Client=Client, client=SimpleNamespace(ClosedClientError=Closed))
    monkeypatch.setitem(sys.modules, "distributed", made)
    return about


def test_a_listener_that_never_speaks_is_left_behind(dask, monkeypatch):
    dask.connects.clear()
    monkeypatch.setattr("flexfem.study.cluster.CONNECT", 0.1)
    with pytest.raises(BadInput, match=r"no scheduler answers there: no word in 0\.1 s"):
        DaskPool(ADDRESS)
    dask.connects.set()


def test_a_run_without_workers_says_for_whom_it_waits_and_ends(dask, monkeypatch):
    now, told = [0.0], []
    monkeypatch.setattr("flexfem.clock.time.monotonic", lambda: now[0])
    pool = DaskPool(ADDRESS, told.append)

    def pass_time(seconds):
        for _ in range(4 * seconds):
            now[0] += 0.25
            pool.check()

    running = {"tcp://a": {"status": "running", "nthreads": 3}}
    pass_time(500)
    assert told == [f"no worker of {ADDRESS} is running: waiting 10 min for one"]
    dask.workers = {**running, "tcp://b": {"status": "paused", "nthreads": 5}}
    pass_time(700)
    assert len(told) == 1 and pool.width == 6
    dask.workers = {"tcp://b": {"status": "paused", "nthreads": 5}}
    pass_time(590)
    assert len(told) == 2
    with pytest.raises(ComputationFailed, match="no worker was running for 10 min; parts are kept, run again to go on"):
        pass_time(20)


def test_a_client_that_ends_between_two_calls_is_said_in_one_line(dask):
    pool = DaskPool(ADDRESS)
    loaded = SimpleNamespace(study=SimpleNamespace(model="analytic"))
    with pytest.raises(ComputationFailed, match=f"--scheduler {ADDRESS}: lost; parts are kept, run again to go on"):
        pool.submit(None, loaded, 0, 1, 1.0)
    pool.close()
