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
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexfem.refused import BadInput
from flexfem.studies import processors

if TYPE_CHECKING:
    pass


def _usable(folder: Path | None) -> Path | None:
    """Refuse an output folder before anything is computed for it."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


FOLDER = typer.Option("--output", "-o", callback=_usable, help="Folder for what is written.")
Output = Annotated[Path, FOLDER]
Wanted = Annotated[Path | None, FOLDER]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
MOST = 4  # processes that draw; each loads matplotlib and holds the fields that it draws


def check_within(option: str, values: tuple[float, ...] | None, largest: float) -> None:
    """Raise BadInput for numbers that are not numbers, or absurdly large."""
    if values is not None and not all(abs(value) <= largest for value in values):
        raise BadInput(f"{option} {' '.join(map(str, values))}, expected three numbers within ±{largest:g}")


def plain(value: Any) -> Any:
    """Records, named tuples and arrays as plain data: the keys of the JSON are the names of fields and properties.

    A number that is not finite is None.
    """
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "_asdict"):
        said = [name for name, part in vars(type(value)).items() if isinstance(part, property)]
        value = value._asdict() | {name: getattr(value, name) for name in said}
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.tolist() if hasattr(value, "tolist") else value


def show(record: Any, as_json: bool, people: Callable[[Any], None]) -> None:
    """Print a record as JSON, or hand it to the function that prints it for people."""
    if as_json:
        print(json.dumps(plain(record), indent=1, allow_nan=False))
    else:
        people(record)


def show_written(paths: Sequence[Path], as_json: bool, **others: Any) -> None:
    """Print the files written."""
    show({"written": [str(path) for path in paths], **others}, as_json, lambda data: print(*data["written"], sep="\n"))


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
