"""How commands run: options they share, answers to people or machines, cases read before any is run, progress."""

from __future__ import annotations

import json
import math
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from flexfem.commands.plain import plain
from flexfem.refused import BadInput
from flexfem.studies import processors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexfem.verify.result import Record

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
