"""How commands run: options they share, answers to people or machines, cases read before any is run, progress."""

from __future__ import annotations

import functools
import json
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from flexfem.commands.plain import plain
from flexfem.refused import BadInput
from flexfem.studies import processors
from flexfem.terminal import raw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexfem.mechanism.stage import Stage
    from flexfem.verify.case import LoadedCase
    from flexfem.verify.protocol import Solved
    from flexfem.verify.result import Fields, Record, Result

Item = TypeVar("Item")
Kept = TypeVar("Kept", bound="Record")


def _usable(folder: Path | None) -> Path | None:
    """Refuse an output folder before anything is computed for it."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


FOLDER = typer.Option("--output", "-o", callback=_usable, help="Folder for what is written.")
Output = Annotated[Path, FOLDER]
Wanted = Annotated[Path | None, FOLDER]
StageFile = Annotated[Path, typer.Argument(help="Stage file, see flexfem schema stage.", metavar="STAGE")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Resolution = Annotated[int | None, typer.Option(min=2, max=64, help="Triangles across every neck.")]
Analytic = Annotated[bool, typer.Option("--analytic", help="Without finite elements.")]
Links = Annotated[bool, typer.Option("--links", help="Its links elastic; mobility 21.")]
Baselines = Annotated[Path | None, typer.Option(help="Folder of baselines; default `baselines` beside each file.")]
FIGURES = (".png", ".pdf")  # how the names of the files of a figure end
MOST = 4  # processes that draw; each loads matplotlib and holds the fields that it draws


def check_finite(**amplitudes: float) -> None:
    """Raise BadInput for an option that is not a number; the limits of options do not catch nan."""
    for name, value in amplitudes.items():
        if not math.isfinite(value):
            raise BadInput(f"--{name.replace('_', '-')} {value}, expected a number")


def check_links(links: bool, mobility: int | None) -> None:
    """Raise BadInput for elastic links with a mobility that is not theirs."""
    if links and mobility not in (None, 21):
        raise BadInput(f"--links --mobility {mobility}, expected 21 or none: elastic links go with all freedoms")


def finest(analytic: bool, resolution: int | None) -> int | None:
    """The resolution of the finite elements, None without them. Raises BadInput when both options are given."""
    from flexfem.reports.given import RESOLUTION

    if analytic and resolution is not None:
        raise BadInput("--analytic and --resolution, expected one of the two")
    return None if analytic else resolution or RESOLUTION


def check_within(option: str, values: tuple[float, ...] | None, largest: float) -> None:
    """Raise BadInput for numbers that are not numbers, or absurdly large."""
    if values is not None and not all(abs(value) <= largest for value in values):
        raise BadInput(f"{option} {' '.join(map(str, values))}, expected three numbers within ±{largest:g}")


def show(record: Any, as_json: bool, people: Callable[[Any], None]) -> None:
    """Print a record as JSON, or hand it to the function that prints it for people."""
    if as_json:
        print(json.dumps(plain(record), indent=1, allow_nan=False))
    else:
        people(record)


def show_written(paths: Sequence[Path], as_json: bool, **others: Any) -> None:
    """Print the files written."""
    show({"written": [str(path) for path in paths], **others}, as_json, lambda data: print(*data["written"], sep="\n"))


def target(folder: Path | None, name: str, beside: Sequence[str] = FIGURES) -> Path | None:
    """Where a record goes, `<name>.json`; None without a folder.

    beside : how the names of the files beside it end, after its own.

    Raises BadInput when one of them is a file that the command has read by now.
    """
    from flexfem.files.inputs import require_unread

    if folder is not None:
        require_unread(*(folder / f"{name}{ending}" for ending in (".json", *beside)))
    return None if folder is None else folder / f"{name}.json"


def keep(record: Kept, path: Path, draw: Callable[[Kept], Figure]) -> None:
    """Store a record as JSON and its figure beside it. Raises BadInput when the folder takes no file."""
    from flexfem.plot.write import write_beside
    from flexfem.verify.result import write_record

    target(path.parent, path.stem)  # again, for what was read since
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
    loaded: Sequence[LoadedCase], solve: Callable[[Stage, int], Solved]
) -> Iterator[tuple[Result, dict[str, Fields]]]:
    """Run cases one by one; says on standard error how far it is."""
    from flexfem.verify.protocol import run_case

    terminal = raw(sys.stderr).isatty()
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


def now_and_then(description: str, every: int = 50) -> Callable[[int, int], None]:
    """What says on a terminal how far a command is, told how many of how many are done."""

    def say(done: int, of: int) -> None:
        if done % every == 0 and sys.stderr.isatty():
            print(f"{description}: {done} of {of}", file=sys.stderr)

    return say


@contextmanager
def side_by_side(workers: int | None = None) -> Iterator[Callable[..., Any]]:
    """Yield a `map` that works in processes of its own, by default one a processor; plain `map` where that is one."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    from flexfem.study.workers import signals_held

    count = workers or min(processors(), MOST)
    if count == 1:
        yield map
        return
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _begin)

    def started(*tasks: Any) -> Iterator[Any]:
        with signals_held():
            return pool.map(*tasks)

    try:
        yield started
    finally:
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Leave Ctrl-C to the command, and end when it has ended, however it did."""
    import multiprocessing

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(multiprocessing.parent_process(),), daemon=True).start()


def _end_with(command: Any) -> None:
    command.join()
    os._exit(1)
