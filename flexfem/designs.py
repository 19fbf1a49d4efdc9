"""Design from Python: requirements in, a stage with the proof of it out."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING

from flexfem.refused import BadInput

if TYPE_CHECKING:
    from flexfem.study.workers import Workers
    from flexfem.synthesis.result import Designed

PathLike = str | os.PathLike[str]
MOST_WORKERS = 1024
STAGE = "{}-stage.toml"
FRONT = "{}-front-{}.toml"  # by the number of the design on the front, from 1


def design(
    requirements: PathLike,
    output: PathLike | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    say: Callable[[str], object] = lambda text: None,
) -> Designed:
    """Find the best stage that meets requirements, or the one that misses least, and check it by finite elements.

    Parameters
    ----------
    requirements : their file.
    output : folder for the stage file, `<stem>-stage.toml`, those of the front, `<stem>-front-1.toml` and so on, and
        the record, `<stem>-design.json`; a search that was stopped goes on there where it was. None writes nothing.
    workers : processes for finite elements, 1 for this one.   scheduler : address of a Dask cluster instead.
    say : is told in a line now and then how far it is.

    Returns
    -------
    The record; `stage` of it is the text of a stage file, with what was designed in its provenance.

    Raises
    ------
    BadInput : the file, or an argument, cannot be used; one line with file, line, key and what was expected.
    ComputationFailed : finite elements of a proposed design fail, or workers are lost.
    """
    from flexfem.arguments import integer
    from flexfem.files.refusals import checked_path
    from flexfem.files.writing import check_file, check_folder
    from flexfem.synthesis.elements import ProposedElements
    from flexfem.synthesis.outcome import designed
    from flexfem.synthesis.requirements import load_requirements
    from flexfem.synthesis.store import Store

    workers = integer("workers", workers, MOST_WORKERS)
    if scheduler is not None and not isinstance(scheduler, str):
        raise BadInput(f"scheduler {scheduler!r}, expected its address as text")
    if not callable(say):
        raise BadInput(f"say {say!r}, expected a function of a line of text")
    loaded = load_requirements(checked_path(requirements))
    folder = None if output is None else checked_path(output)
    if folder is not None:
        check_folder(folder)
        base = Path(loaded.stage.origin.path or "")
        stem, count = loaded.path.stem, loaded.requirements.front if len(loaded.requirements.objective) > 1 else 0
        figures = (f"{stem}-design{part}.{form}" for part in ("", "-sensitivity", "-front") for form in ("png", "pdf"))
        stages = (STAGE.format(stem), *(FRONT.format(stem, number + 1) for number in range(count)))
        for name in (*stages, f"{stem}-design.json", *figures):
            if folder.is_dir():
                check_file(folder / name, base, loaded.path)
    store = Store(None if folder is None else folder / f".{loaded.path.stem}-design.found")
    with _pool(workers, scheduler, say) as pool:
        found = designed(loaded, ProposedElements(loaded, Counter(), pool, store), say)
    if folder is not None:
        _remove_older(folder, write_design(found, folder), base)
        store.forget()
    return found


def write_design(found: Designed, folder: Path) -> list[Path]:
    """Write the stage file of a design, those of its front, and the record; returns their paths. Raises BadInput."""
    from flexfem.files.writing import write_atomically
    from flexfem.verify.result import write_record

    stem = Path(found.file).stem
    written = [folder / STAGE.format(stem)]
    write_atomically(written[0], lambda file: file.write(found.stage.encode()))
    for number, one in enumerate(found.front, 1):
        written.append(folder / FRONT.format(stem, number))
        write_atomically(written[-1], lambda file, text=one.stage: file.write(text.encode()))  # type: ignore[misc]
    written.append(write_record(found, folder / f"{stem}-design.json"))
    return written


def _remove_older(folder: Path, written: list[Path], base: Path) -> None:
    """Remove stage files of an earlier, longer front: they would pass for designs of this one."""
    stem = written[-1].stem.removesuffix("-design")
    for path in folder.glob(FRONT.format(escape(stem), "*")):
        if path in written or not path.stem.rpartition("-")[2].isdecimal():
            continue
        with suppress(OSError):
            if "designed: " in path.read_text(errors="replace") and not path.samefile(base):
                path.unlink()


@contextmanager
def _pool(workers: int, scheduler: str | None, say: Callable[[str], object]) -> Iterator[Workers | None]:
    """Workers of a cluster, or processes of this machine; None for this process alone. Raises BadInput."""
    from flexfem.study.workers import Workers

    if scheduler is not None and workers != 1:
        raise BadInput("workers with a scheduler, expected one of them: the scheduler has its own workers")
    if scheduler is None and workers == 1:
        yield None
        return
    with Workers(workers, scheduler, say) as pool:
        yield pool
