"""Answers that are slow, hang, crash or raise, for workers to import."""

from __future__ import annotations

import ctypes
import hashlib
import os
import signal
import time

import numpy as np

from flexfem.refused import ComputationFailed
from flexfem.study.answer import answer
from flexfem.study.columns import Rows
from flexfem.study.loaded import LoadedStudy

PAUSE = 0.01  # s a design: time to be killed in
HANGS = 3
KILLED = 5
SEGMENTATION = 18
RAISES = 20
FAILS = 21


def slow(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """The analytic answer, not so fast."""
    time.sleep(PAUSE * (stop - start))
    return answer(loaded, start, stop)


def plain(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """Numbers of designs for answers."""
    numbers = np.arange(start, stop)
    values = numbers[:, None] + np.arange(len(loaded.outputs)) / 100
    return Rows(np.full(len(numbers), "ok", object), np.full(len(numbers), "", object), values)


def raising(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """As `plain`, but two designs raise an error."""
    if RAISES in range(start, stop):
        raise ValueError("a bug\nin two lines")
    if FAILS in range(start, stop):
        raise ComputationFailed("mesh has a scaled Jacobian = 0.01, expected > 0.1")
    return plain(loaded, start, stop)


def strange(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """As `raising`, but some designs are the end of the process that has to do with them."""
    numbers = range(start, stop)
    if HANGS in numbers:  # as gmsh may: signals of Python end nothing, other threads go on
        hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)
    if KILLED in numbers:
        os.kill(os.getpid(), signal.SIGKILL)
    if SEGMENTATION in numbers:
        ctypes.string_at(0)
    return raising(loaded, start, stop)


def once(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """The analytic answer, but the worker of one design is killed the first time."""
    mark = loaded.path.parent / "killed"
    if KILLED in range(start, stop) and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return answer(loaded, start, stop)
