"""How commands run: facts to people or machines, cases read before any is run, progress on a terminal only."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import Progress

from flexfem.commands.streams import raw
from flexfem.errors import BadInput
from flexfem.stage.schema import Stage
from flexfem.verify.case import LoadedCase
from flexfem.verify.protocol import Solved, run_case, solve_stage
from flexfem.verify.result import Fields, Result

Item = TypeVar("Item")


def show(facts: Any, as_json: bool, people: Callable[[Any], None]) -> None:
    """Print facts as JSON, or hand them to the function that prints them for people."""
    if as_json:
        print(json.dumps(facts, indent=1, allow_nan=False))
    else:
        people(facts)


def load_cases(paths: Sequence[Path]) -> list[LoadedCase]:
    """Read all cases before any is run. Raises BadInput, also when two would write the same result."""
    loaded = [LoadedCase(path) for path in paths]
    seen: dict[str, Path] = {}
    for case in loaded:
        if case.stem in seen:
            raise BadInput(
                f"{case.path}: its results would overwrite those of {seen[case.stem]}, expected another name"
            )
        seen[case.stem] = case.path
    return loaded


def solved_once() -> Callable[[Stage, int], Solved]:
    """A `solve_stage` that solves each stage and resolution once."""
    return functools.cache(solve_stage)


def run_cases(
    loaded: Sequence[LoadedCase], solve: Callable[[Stage, int], Solved] | None = None
) -> Iterator[tuple[Result, dict[str, Fields]]]:
    """Run cases one by one, each stage solved once; says on standard error how far it is."""
    solve = solve or solved_once()
    console = Console(file=raw(sys.stderr))
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        for case in progress.track(loaded, description="verifying"):
            result, fields = run_case(case, solve)
            if not console.is_terminal:
                print(f"{case.stem}: {len(result.curves)} curves in {result.seconds:.1f} s", file=sys.stderr)
            yield result, fields


def told(items: Sequence[Item], description: str) -> Iterator[Item]:
    """The items one by one; says on standard error how far it is, on a terminal only."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        yield from progress.track(items, description=description)


def with_progress(steps: int, description: str) -> Callable[[Stage, int], Solved]:
    """A `solve_stage` that says on standard error how far it is, after every one of `steps` calls."""
    done = 0

    def solve(stage: Stage, resolution: int) -> Solved:
        nonlocal done
        solved = solve_stage(stage, resolution)
        done += 1
        print(f"{description} {done}/{steps}: {solved.response.unknowns} unknowns", file=sys.stderr)
        return solved

    return solve
