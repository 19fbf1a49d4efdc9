"""Studies from Python: every function gives what its command under `flexfem study` prints.

flexfem.run_study("cases/study-reach.toml")
flexfem.collect_study("cases/study-reach.toml")
flexfem.study.table("reports/study-reach/study-reach.parquet")      # a pandas or Arrow table
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem.refused import BadInput

if TYPE_CHECKING:
    from flexfem.plot.study_records import Record, Source
    from flexfem.study.collect import Collected
    from flexfem.study.findings import Shown
    from flexfem.study.parts import Parts
    from flexfem.study.pool import Pool

PathLike = str | os.PathLike[str]
REPORTS = Path("reports")
MOST_WORKERS = 1024


class StudyFindings(NamedTuple):
    """A collected study: its table, what its figures are drawn from, and what each of them shows, by name."""

    table: Collected
    source: Source
    found: dict[str, Shown]


def processors() -> int:
    """Processors that this process may use: a job's share, not the whole machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def parts_of(study: PathLike, output: PathLike = REPORTS) -> Parts:
    """Where the parts of a study file lie below a folder. Raises BadInput."""
    from flexfem.files.refusals import checked_path
    from flexfem.study import parts
    from flexfem.study.loaded import load_study

    return parts.parts_of(load_study(checked_path(study)), checked_path(output))


def run_study(
    study: PathLike,
    output: PathLike = REPORTS,
    workers: int | None = None,
    shard: str = "1/1",
    scheduler: str | None = None,
    retry: bool = False,
) -> dict[str, Any]:
    """Compute the designs of a study that are still open; stopped or killed, it goes on where it was.

    Parameters
    ----------
    study : its file.   output : folder for what is written, in a folder of the study.
    workers : processes on this machine, by default one a processor.   scheduler : address of a Dask cluster instead.
    shard : `I/N`, only the I-th of N shares.   retry : also try again what failed or ran out of time.

    Returns
    -------
    What `study_status` gives, of this share.

    Raises
    ------
    BadInput, ComputationFailed, SourcesChanged
        As `flexfem study run`; parts that are written stay in any case.
    """
    from flexfem.files.writing import check_folder
    from flexfem.study.run import run_study as compute
    from flexfem.study_answers import shard_of, status_facts

    share, parts = shard_of(shard), parts_of(study, output)
    check_folder(parts.folder)
    with pool_for(parts, workers, scheduler) as pool:
        compute(parts, pool, shard=share, retry=retry)
    return status_facts(parts, share)


@contextmanager
def pool_for(
    parts: Parts, workers: int | None, scheduler: str | None, say: Callable[[str], object] = lambda text: None
) -> Iterator[Pool]:
    """Workers of a cluster, or processes of this machine, no more than there are tasks for. Raises BadInput."""
    from flexfem.arguments import integer
    from flexfem.study.cluster import DaskPool
    from flexfem.study.pool import LocalPool

    workers = None if workers is None else integer("workers", workers, MOST_WORKERS)
    if scheduler is not None and not isinstance(scheduler, str):
        raise BadInput(f"scheduler {scheduler!r}, expected its address as text")
    if scheduler is not None and workers is not None:
        raise BadInput("workers with a scheduler, expected one of them: the scheduler has its own workers")
    tasks = parts.count if parts.loaded.study.model == "analytic" else parts.loaded.count
    pool = DaskPool(scheduler, say) if scheduler is not None else LocalPool(min(workers or processors(), tasks))
    try:
        yield pool
    finally:
        pool.close()


def study_status(study: PathLike, output: PathLike = REPORTS) -> dict[str, Any]:
    """How many designs of a study are done, refused, failed with reasons, and open, as `flexfem study status --json`.

    Raises BadInput when the file cannot be used.
    """
    from flexfem.files.writing import check_folder
    from flexfem.study_answers import status_facts

    parts = parts_of(study, output)
    check_folder(parts.folder, written=False)
    return status_facts(parts)


def clean_study(study: PathLike, output: PathLike = REPORTS, dry_run: bool = False) -> dict[str, Any]:
    """Remove parts of other inputs or versions than a study has now; with `dry_run` only say which. Raises BadInput."""
    from flexfem.files.writing import check_folder
    from flexfem.study.folder import release_folder, remove, stale_parts
    from flexfem.study_answers import clean_facts

    parts = parts_of(study, output)
    check_folder(parts.folder)
    found = stale_parts(parts)
    if not dry_run:
        remove(found, parts.stale)
        release_folder(parts)
    return {**clean_facts(found), "removed": bool(found) and not dry_run}


def collect_study(
    study: PathLike,
    output: PathLike = REPORTS,
    to: PathLike | None = None,
    partitioned: bool = False,
    partial: bool = False,
) -> Collected:
    """Join what is done to one table, design after design.

    Parameters
    ----------
    to : the table to write, .parquet or .csv, or where `partitioned` a folder of Parquet files.
    partial : leave out designs that are still open instead of refusing.

    Raises
    ------
    BadInput
        Designs are open, a part is damaged, or the table cannot be written.
    """
    return _collected(parts_of(study, output), to, partitioned, partial)


def _collected(parts: Parts, to: PathLike | None, partitioned: bool, partial: bool) -> Collected:
    from flexfem.files.refusals import checked_path
    from flexfem.files.writing import check_file, check_folder
    from flexfem.study.collect import check_target, collect, table_path

    target = checked_path(to) if to is not None else table_path(parts, partitioned)
    check_target(target, partitioned or (to is None and target.suffix == ""))
    if to is not None and not partitioned:
        check_file(target)
    check_folder(target.parent)
    return collect(parts, target, partial)


def study_findings(study: PathLike, output: PathLike = REPORTS, partial: bool = False) -> StudyFindings:
    """Collect the table of a study and find what its figures show. Raises BadInput as `collect_study`."""
    from flexfem.plot.study import named
    from flexfem.plot.study_records import Source
    from flexfem.study.collected import read_table
    from flexfem.study.findings import findings
    from flexfem.study.probes import nominal, unseen

    parts = parts_of(study, output)
    made, loaded = _collected(parts, None, False, partial), parts.loaded
    table, base = read_table(made.path, loaded), nominal(loaded)
    names, found = (name for name, _ in named(loaded)), findings(loaded, table, base)
    return StudyFindings(made, Source(loaded, table, base, unseen(loaded)), dict(zip(names, found, strict=True)))


def study_records(study: PathLike, output: PathLike = REPORTS, partial: bool = False) -> dict[str, Record]:
    """What every figure of a study shows, by the name of its files, for `flexfem.plot.plot_map` and the others.

    Maps go to `plot_map`, fronts to `plot_front`, each of the `scatters` of a distribution to `plot_histogram`, each of
    the `shares` of a sensitivity, with its `factors`, to `plot_shares`; what is refused is left out.

    Raises BadInput as `collect_study`.
    """
    from flexfem.plot.study import records

    shown = study_findings(study, output, partial)
    return records(shown.source, list(shown.found.values()))
