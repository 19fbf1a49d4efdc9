"""More designs of a sample that begins alike: what is known is not computed again, and nothing else changes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from flexfem.study.collect import collect
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import Rows
from flexfem.study.parts import Parts, Shard, parts_of
from flexfem.study.run import run_study

sys.path.insert(0, str(Path(__file__).parent))

import strange

SIZE = 20  # designs a part
SAMPLINGS = {
    "sobol": 'method = "sobol"\ndesigns = {}\nseed = 3',
    "monte_carlo": 'method = "monte_carlo"\ndesigns = {}\nseed = 3',
    "latin_hypercube": 'method = "latin_hypercube"\ndesigns = {}\nseed = 3',
}
NECK = 'key = "hinges.base.neck_mm"\nfrom = 0.3\nto = 0.6'


class Here:
    """A pool that computes at once in this process, and remembers which designs."""

    width = 2

    def __init__(self) -> None:
        self.asked: list[int] = []

    def submit(self, solve: Callable[..., Rows], loaded: LoadedStudy, start: int, stop: int, limit: float) -> Any:
        self.asked += range(start, stop)
        future: Future[Any] = Future()
        future.set_result(solve(loaded, start, stop, False) if start < stop else "")
        return future

    def outcome(self, future: Future[Any]) -> Any:
        return future.result()

    def check(self) -> None:
        pass

    def close(self) -> None:
        pass


def run(studies: Any, method: str, designs: int, output: Path, shards: int = 1, **options: Any) -> tuple[Parts, list]:
    loaded = studies.of(SAMPLINGS[method].format(designs), NECK, head=options.pop("head", 'model = "analytic"'))
    parts, pool = parts_of(loaded, output, SIZE), Here()
    for first in range(shards):
        run_study(parts, pool, options.get("solve", strange.plain), Shard(first, shards))
    return parts, sorted(pool.asked)


@pytest.mark.parametrize(("method", "head"), [("sobol", 'model = "analytic"'), ("monte_carlo", 'model = "fe"')])
def test_a_larger_or_smaller_sample_computes_only_what_is_new(method: str, head: str, studies: Any) -> None:
    """The last part of the smaller sample ends within a chunk of the larger one."""
    output = studies.folder / "out"
    assert run(studies, method, 47, output, head=head)[1] == list(range(47))
    for designs, shards, fresh in ((95, 3, range(47, 95)), (52, 1, ()), (95, 2, ()), (100, 1, range(95, 100))):
        parts, asked = run(studies, method, designs, output, shards, head=head)
        assert asked == list(fresh), designs
        rows = pq.read_table(parts.folder)["design"].to_pylist()
        assert sorted(rows) == list(range(designs))  # by the glob of the README
        again, _ = run(studies, method, designs, studies.folder / f"new-{designs}-{shards}", head=head)
        tables = [collect(each, each.folder.parent / "table.parquet").path.read_bytes() for each in (parts, again)]
        assert tables[0] == tables[1]


def test_a_larger_hypercube_begins_otherwise_and_keeps_nothing(studies: Any) -> None:
    output = studies.folder / "out"
    run(studies, "latin_hypercube", 47, output)
    parts, asked = run(studies, "latin_hypercube", 95, output)
    assert asked == list(range(95)) and len(list(parts.folder.iterdir())) == 5


def test_rows_of_another_study_begin_nothing(studies: Any) -> None:
    output = studies.folder / "out"
    run(studies, "sobol", 47, output)
    loaded = studies.of(SAMPLINGS["sobol"].format(95), NECK.replace("0.6", "0.61"))
    pool = Here()
    run_study(parts_of(loaded, output, SIZE), pool, strange.plain)
    assert sorted(pool.asked) == list(range(95))
