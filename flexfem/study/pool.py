"""Where designs are computed: worker processes of this machine, or those of a Dask scheduler, behind one `submit`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from contextlib import suppress
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

from flexfem.files.refusals import one_line
from flexfem.refused import BadInput, ComputationFailed, SourcesChanged
from flexfem.sources import manifest
from flexfem.study.folder import CURE
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import Rows
from flexfem.study.versions import counts, libraries_of, versions_of
from flexfem.study.worker import Died, Worker

Answer: TypeAlias = Callable[[LoadedStudy, int, int, bool], Rows]
DEATHS = 3  # of workers over one task, after which it is the task's fault
BEGINNING = 600.0  # s, for a worker to say whether it can answer
POLL = 0.25  # s
CLEAR = (BadInput, ComputationFailed, SourcesChanged, Died, TimeoutError)


def deciding(loaded: LoadedStudy) -> dict[str, str]:
    """Versions of what decides the results of a study, as its parts carry them."""
    return dict(versions_of(loaded.study.model != "analytic"))


@lru_cache
def deciding_sources() -> Mapping[str, str]:
    """Hashes of the sources that decide results, taken when this process began; workers load these or none."""
    return MappingProxyType({name: digits for name, digits in manifest().items() if counts(name)})


class Pool(Protocol):
    """What runs tasks: at most `width` at once are useful; `limit` is in s.

    A future raises Died, TimeoutError, or what makes all further work useless: BadInput, ComputationFailed or
    SourcesChanged. `check` is called several times a second.
    """

    @property
    def width(self) -> int: ...
    def submit(self, solve: Answer, loaded: LoadedStudy, start: int, stop: int, limit: float) -> Future[Any]: ...
    def outcome(self, future: Future[Any]) -> Rows | str: ...
    def check(self) -> None: ...
    def close(self) -> None: ...


def answered(solve: Answer, loaded: LoadedStudy, start: int, stop: int, versions: dict[str, str]) -> Rows | str:
    """In a worker: answer designs; an exception comes back as its text. Raises BadInput for other versions.

    Its sources are those of the runner: what loads them checks each.
    """
    own = libraries_of(loaded.study.model != "analytic")
    for name in (name for name in own if own[name] != versions.get(name)):
        raise BadInput(
            f"a worker has {name} {own[name]}, the runner {versions[name]}, expected the same versions everywhere"
            f"{f': {CURE}' if name == 'arithmetic' else ''}"
        )
    if start == stop:  # only asked whether it can
        return ""
    try:
        return solve(loaded, start, stop, True)
    except SourcesChanged:
        raise
    except (BadInput, ComputationFailed) as error:
        return str(error)
    except Exception as error:  # a mistake of ours ends the design, not the run
        return f"{type(error).__name__}: {' '.join(str(error).split())}"


def require_workers(
    pool: Pool, solve: Answer, loaded: LoadedStudy, waiting: Callable[[], object] = lambda: None
) -> None:
    """Start the workers; raises ComputationFailed when all of them die of that."""
    for _ in range(DEATHS):
        futures = [pool.submit(solve, loaded, 0, 0, BEGINNING) for _ in range(pool.width)]
        while wait(futures, POLL).not_done:
            pool.check()
            waiting()
        for future in futures:
            with suppress(Died, TimeoutError):
                pool.outcome(future)
                return
    raise ComputationFailed("all worker processes die before they begin: is flexfem installed for them?")


def outcome_of(future: Future[Any], where: str = "") -> Rows | str:
    """What a task that is done answered. Raises as a pool's future does."""
    try:
        return future.result()  # type: ignore[no-any-return]
    except CLEAR:
        raise
    except Exception as error:  # it lacks a module, or its Python is another
        why = error.__cause__ or error
        reason = one_line(f"{type(why).__name__}: {' '.join(str(why).split())}", 200)
        raise ComputationFailed(f"{where}a worker cannot answer: {reason}") from None


class LocalPool:
    """Processes of this machine; one that dies or exceeds a limit is replaced."""

    def __init__(self, workers: int) -> None:
        self._workers = [Worker() for _ in range(workers)]

    @property
    def width(self) -> int:
        """Number of workers."""
        return len(self._workers)

    def submit(self, solve: Answer, loaded: LoadedStudy, start: int, stop: int, limit: float) -> Future[Any]:
        """Start a task on a free worker; there must be one."""
        worker = next(worker for worker in self._workers if worker.free)
        task = (solve, loaded, start, stop, deciding(loaded))
        return worker.start(answered, task, limit, deciding_sources())  # type: ignore[no-any-return]

    def outcome(self, future: Future[Any]) -> Rows | str:
        """What a task that is done answered."""
        return outcome_of(future)

    def check(self) -> None:
        """End tasks that are out of time."""
        for worker in self._workers:
            worker.check()

    def close(self) -> None:
        """Kill all workers, and wait until they are gone."""
        for worker in self._workers:
            worker.kill()
