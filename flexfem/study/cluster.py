"""Workers of a Dask scheduler: Slurm, Kubernetes and clouds are its business."""

from __future__ import annotations

import importlib
import logging
import re
import time
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from typing import Any

from flexfem.errors import BadInput, ComputationFailed
from flexfem.refusals import one_line
from flexfem.study.answer import Rows
from flexfem.study.plan import LoadedStudy
from flexfem.study.pool import SHUTDOWN, Answer, Died, answered, deciding

CONNECT = 10.0  # s, for a scheduler to answer
AHEAD = 2  # tasks a thread, so that none waits for the network
COUNTED = 5.0  # s between two looks at how many threads there are


class DaskPool:
    """The workers of a Dask scheduler, which restarts those that die. Raises BadInput when it does not answer."""

    def __init__(self, address: str) -> None:
        try:
            distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise BadInput(f"--scheduler {address}: Dask is not installed, expected flexfem[dask]") from None
        if not re.fullmatch(r"((tcp|tls|ws|wss)://)?[^/\s]+:[0-9]{1,5}", address):
            raise BadInput(f"--scheduler {address}, expected host:port, such as tcp://127.0.0.1:8786")
        for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
            logging.getLogger(name).setLevel(logging.CRITICAL)  # a lost scheduler is told in one line
        try:
            self._client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as error:
            raise BadInput(f"--scheduler {address}: no scheduler answers there: {one_line(str(error), 200)}") from None
        self._address = address
        self._executor = self._client.get_executor(pure=False)
        self._width, self._counted = 1, float("-inf")

    @property
    def width(self) -> int:
        """Tasks that keep all threads of all workers busy, as of a few seconds ago."""
        if time.monotonic() - self._counted > COUNTED:
            self._counted = time.monotonic()
            with suppress(OSError, CancelledError, RuntimeError):  # lost: told by `outcome`
                self._width = max(1, AHEAD * sum(self._client.nthreads().values()))
        return self._width

    def submit(self, solve: Answer, loaded: LoadedStudy, start: int, stop: int, limit: float) -> Future[Any]:
        """Hand a task to the scheduler; the limit is the answering function's business there."""
        try:
            future: Future[Any] = self._executor.submit(answered, solve, loaded, start, stop, False, deciding(loaded))
        except RuntimeError:
            raise self._lost() from None
        return future

    def outcome(self, future: Future[Any]) -> Rows | str:
        """What a task that is done answered."""
        from distributed import KilledWorker

        try:
            return future.result()  # type: ignore[no-any-return]
        except KilledWorker:
            raise Died(final=True) from None
        except CancelledError:
            raise self._lost() from None
        except (BadInput, ComputationFailed):
            raise
        except Exception as error:  # its flexfem is missing, or its Python another
            why = error.__cause__ or error
            reason = one_line(f"{type(why).__name__}: {' '.join(str(why).split())}", 200)
            raise ComputationFailed(f"--scheduler {self._address}: a worker cannot answer: {reason}") from None

    def check(self) -> None:
        """Raise ComputationFailed when the scheduler is gone."""
        if self._client.status not in ("running", "connecting"):
            raise self._lost()

    def close(self) -> None:
        """Cancel what is under way, and leave."""
        with suppress(Exception):  # the scheduler may be gone
            self._executor.shutdown(wait=False)
            self._client.close(timeout=SHUTDOWN)

    def _lost(self) -> ComputationFailed:
        return ComputationFailed(f"--scheduler {self._address}: lost; parts are kept, run again to go on")
