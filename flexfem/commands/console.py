"""How commands run: answers to people or machines, cases read before any is run, progress on a terminal only."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import typer

from flexfem.commands.streams import raw
from flexfem.refused import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexfem.commands.baseline.store import Checked
    from flexfem.stage.schema import Stage
    from flexfem.verify.case import LoadedCase
    from flexfem.verify.protocol import Solved
    from flexfem.verify.result import Fields, Record, Result

Item = TypeVar("Item")
Kept = TypeVar("Kept", bound="Record")


def plain(value: Any) -> Any:
    """Records, named tuples and arrays as plain data: the keys of the JSON are the names of the fields."""
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return value.tolist() if hasattr(value, "tolist") else value


def show(answer: Any, as_json: bool, people: Callable[[Any], None]) -> None:
    """Print a record as JSON, or hand the same data to the function that prints them for people."""
    data = plain(answer)
    if as_json:
        print(json.dumps(data, indent=1, allow_nan=False))
    else:
        people(data)


def show_written(paths: Sequence[Path], as_json: bool, **others: Any) -> None:
    """Print the files written."""
    show({"written": [str(path) for path in paths], **others}, as_json, lambda data: print(*data["written"], sep="\n"))


def show_checked(checked: Sequence[Checked], as_json: bool) -> NoReturn:
    """Print what changed or moved by baseline, each as data and as a line, and end the command accordingly."""
    from flexfem.commands.tables import print_regression

    found = [{"baseline": each.name, **each.data(one), "line": str(one)} for each in checked for one in each.findings]
    show({"checked": [each.name for each in checked], "findings": found}, as_json, print_regression)
    raise typer.Exit(1 if found else 0)


def keep(record: Kept, path: Path, draw: Callable[[Kept], Figure]) -> None:
    """Store a record as JSON and its figure beside it. Raises BadInput when the folder takes no file."""
    from flexfem.plot.write import write_beside
    from flexfem.verify.result import write_record

    write_beside(write_record(record, path), draw(record))


def load_cases(paths: Sequence[Path]) -> list[LoadedCase]:
    """Read all cases before any is run. Raises BadInput, also when two would write the same result."""
    from flexfem.verify.case import LoadedCase

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
    from flexfem.verify.protocol import solve_stage

    return functools.cache(solve_stage)


def run_cases(
    loaded: Sequence[LoadedCase], solve: Callable[[Stage, int], Solved] | None = None
) -> Iterator[tuple[Result, dict[str, Fields]]]:
    """Run cases one by one, each stage solved once; says on standard error how far it is."""
    from flexfem.verify.protocol import run_case

    solve, terminal = solve or solved_once(), raw(sys.stderr).isatty()
    for case in told(loaded, "verifying"):
        result, fields = run_case(case, solve)
        if not terminal:
            print(f"{case.stem}: {len(result.curves)} curves in {result.seconds:.1f} s", file=sys.stderr)
        yield result, fields


def told(items: Sequence[Item], description: str) -> Iterator[Item]:
    """The items one by one; says on standard error how far it is, on a terminal only."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(file=raw(sys.stderr))
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        yield from progress.track(items, description=description)


def with_progress(steps: int, description: str) -> Callable[[Stage, int], Solved]:
    """A `solve_stage` that says on standard error how far it is, after every one of `steps` calls."""
    from flexfem.verify.protocol import solve_stage

    done = 0

    def solve(stage: Stage, resolution: int) -> Solved:
        nonlocal done
        solved = solve_stage(stage, resolution)
        done += 1
        print(f"{description} {done}/{steps}: {solved.response.unknowns} unknowns", file=sys.stderr)
        return solved

    return solve
