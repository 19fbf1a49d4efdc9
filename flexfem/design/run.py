"""Design from Python: from a requirements file to a verified stage or mechanism."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import nullcontext, suppress
from glob import escape
from pathlib import Path
from typing import Any

from flexfem.arguments import integer
from flexfem.design.model import silent
from flexfem.design.outcome import designed
from flexfem.design.proof import ElementSolver
from flexfem.design.requirements import LoadedRequirements, load_requirements
from flexfem.design.result import Designed
from flexfem.design.timing import Timing
from flexfem.files.refusals import checked_path
from flexfem.files.toml import PathLike
from flexfem.files.writing import check_folder, check_name, write_atomically
from flexfem.refused import BadInput, printed
from flexfem.results import write_sealed
from flexfem.study import MOST_WORKERS
from flexfem.study.workers import workers_of

PLATE = "{}-{}.toml"  # by the kind of the file, "stage" or "mechanism"
FRONT = "{}-front-{}.toml"  # by the number of the design on the front, from 1


def run_design(
    requirements: PathLike,
    output: PathLike | None = None,
    workers: int = 1,
    say: Callable[[str], object] = silent,
    scheduler: str | None = None,
    executor: Executor | None = None,
    timing: Timing | None = None,
) -> Designed:
    """Find the best stage or mechanism for requirements, or the nearest one, and check it by finite
    elements.

    Parameters
    ----------
    requirements : path
        Requirements file.
    output : path, optional
        Folder for the stage or mechanism file, `<stem>-stage.toml` or `<stem>-mechanism.toml`,
        those of the front, `<stem>-front-1.toml` and so on, and the record, `<stem>-design.json`.
        If a run was stopped, its finite-element solutions in this folder are used again. None
        writes nothing.
    workers : int
        Processes for finite elements, 1 for this one.
    say : callable
        Called with a line of text on the progress.
    scheduler : str, optional
        Solve finite elements on the workers of a Dask scheduler: its address, host:port, or its
        scheduler file.
    executor : concurrent.futures.Executor, optional
        Solve finite elements on the workers of this executor.
    timing : Timing, optional
        Is told of the parts of the design as they start, for the remaining time.

    Returns
    -------
    Designed
        The record; its `stage` is the text of the stage or mechanism file, whose provenance names
        what is designed.

    Raises
    ------
    BadInput
        The file or an argument is invalid; one line with file, line, key and the expected value.
    ComputationFailed
        Finite elements of a proposed design fail, or workers are lost.
    """
    workers = integer("workers", workers, MOST_WORKERS)
    elsewhere = scheduler is not None or executor is not None
    if workers > 1 and elsewhere:
        raise BadInput(
            f"workers = {workers}, expected none with a scheduler or an executor, which have "
            "their own"
        )
    if not callable(say):
        raise BadInput(f"say {printed(say)}, expected a function of a line of text")
    loaded = load_requirements(checked_path(requirements))
    folder = None if output is None else checked_path(output)
    kept = None
    if folder is not None:
        _check_output(loaded, folder)
        kept = folder / f".{loaded.path.stem}-design.found"
    pool: Any = nullcontext()
    if workers > 1 or elsewhere:
        pool = workers_of(workers, scheduler, executor)
    with pool as processes:
        solver = ElementSolver(loaded, Counter(), processes, kept, say)
        found = designed(loaded, solver, timing)
    if folder is not None and kept is not None:
        _write(found, folder, _base_file(loaded))
        shutil.rmtree(kept, ignore_errors=True)
    return found


def _base_file(loaded: LoadedRequirements) -> Path:
    return Path(loaded.base.origin.path or "")


def _check_output(loaded: LoadedRequirements, folder: Path) -> None:
    """Raise BadInput for a folder that takes no files, or where one would replace an input file."""
    check_folder(folder)
    required = loaded.requirements
    stem = loaded.path.stem
    kind = type(loaded.base).kind.removesuffix(" file")
    names = [PLATE.format(stem, kind), f"{stem}-design.json"]
    if len(required.objective) > 1:
        names += [FRONT.format(stem, number) for number in range(1, required.front + 1)]
    for part in ("", "-sensitivity", "-front"):
        names += [f"{stem}-design{part}.png", f"{stem}-design{part}.pdf"]
    for name in sorted(names, key=len, reverse=True):
        check_name(folder / name, _base_file(loaded), loaded.path)


def _write(
    found: Designed,
    folder: Path,
    base: Path,
) -> None:
    """Write the stage file of a design, those of its front, and the record. Raises BadInput.

    Stage files of an earlier, longer front are removed, since they look like designs of this one.
    """
    stem = Path(found.file).stem
    texts = {PLATE.format(stem, found.kind): found.stage}
    texts |= {
        FRONT.format(stem, number): design.stage for number, design in enumerate(found.front, 1)
    }
    for name, text in texts.items():
        write_atomically(folder / name, lambda file, text=text: file.write(text.encode()))  # type: ignore[misc]
    write_sealed(folder / f"{stem}-design.json", found.model_dump(mode="json"))
    for path in folder.glob(FRONT.format(escape(stem), "*")):
        if path.name not in texts and path.stem.rpartition("-")[2].isdecimal():
            with suppress(OSError):
                if "designed: " in path.read_text(errors="replace") and not path.samefile(base):
                    path.unlink()
