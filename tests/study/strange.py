"""Answers that are slow, hang, crash or raise, for workers to import; run as a script, a runner to kill."""

from __future__ import annotations

import ctypes
import hashlib
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.answer import answer
from flexfem.study.cluster import DaskPool
from flexfem.study.loaded import LoadedStudy, load_study
from flexfem.study.outputs import Rows
from flexfem.study.parts import parts_of
from flexfem.study.pool import LocalPool
from flexfem.study.run import run_study
from flexfem.study_answers import shard_of

PAUSE = 0.004  # s a design: time to be killed in
HANGS, KILLED, SEGMENTATION, RAISES, FAILS, NAN = 3, 5, 18, 20, 21, 22


def slow(loaded: LoadedStudy, start: int, stop: int, inside: bool) -> Rows:
    """The analytic answer, not so fast."""
    time.sleep(PAUSE * (stop - start))
    return answer(loaded, start, stop, inside)


def plain(loaded: LoadedStudy, start: int, stop: int, inside: bool) -> Rows:
    """Numbers of designs for answers."""
    numbers = np.arange(start, stop)
    values = numbers[:, None] + np.arange(len(loaded.outputs)) / 100
    return Rows(np.full(len(numbers), "ok", object), np.full(len(numbers), "", object), values)


def strange(loaded: LoadedStudy, start: int, stop: int, inside: bool) -> Rows:
    """As `plain`, but some designs are the end of the process that has to do with them."""
    numbers = range(start, stop)
    if HANGS in numbers:
        hang()
    if KILLED in numbers:
        os.kill(os.getpid(), signal.SIGKILL)
    if SEGMENTATION in numbers:
        ctypes.string_at(0)
    if RAISES in numbers:
        raise ValueError("a bug\nin two lines")
    if FAILS in numbers:
        raise ComputationFailed("mesh has a scaled Jacobian = 0.01, expected > 0.1")
    rows = plain(loaded, start, stop, inside)
    rows.values[np.array(numbers) == NAN] = np.nan
    return rows


def once(loaded: LoadedStudy, start: int, stop: int, inside: bool) -> Rows:
    """As `plain`, but one design is killed from outside, as it were: only the first two times."""
    tries = sorted(loaded.path.parent.glob("try-*"))
    if KILLED in range(start, stop) and len(tries) < 2:
        (loaded.path.parent / f"try-{len(tries)}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return plain(loaded, start, stop, inside)


def hanging(loaded: LoadedStudy, start: int, stop: int, inside: bool) -> Rows:
    """No answer."""
    hang()
    return plain(loaded, start, stop, inside)


def hang() -> None:
    """As gmsh may: signals of Python end nothing, other threads go on."""
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)


def main(study: str, output: str, size: str, workers: str, shard: str, address: str) -> None:
    """Run a study with `slow`, as the command does."""
    parts = parts_of(load_study(study), Path(output), int(size))
    try:
        pool = DaskPool(address) if address else LocalPool(int(workers))
        try:
            print("running", flush=True)
            found = run_study(parts, pool, slow, shard_of(shard), say=lambda text: print(text, file=sys.stderr))
        finally:
            pool.close()
    except BadInput as refusal:
        print(f"flexfem: {refusal}", file=sys.stderr)
        sys.exit(2)
    except ComputationFailed as failure:
        print(f"flexfem: {failure}", file=sys.stderr)
        sys.exit(1)
    print(found.counts.total(), found.known, flush=True)


if __name__ == "__main__":
    import strange  # whose functions workers can import

    strange.main(*sys.argv[1:])
