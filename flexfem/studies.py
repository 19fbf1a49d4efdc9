"""Studies from Python: every function gives what its command under `flexfem study` prints.

flexfem.run_study("cases/study-reach.toml")
flexfem.collect_study("cases/study-reach.toml")
flexfem.study.table("reports/study-reach/study-reach.parquet")      # a pandas or Arrow table
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from flexfem.arguments import integer
from flexfem.files.refusals import checked_path
from flexfem.files.toml import PathLike
from flexfem.files.writing import check_file, check_folder
from flexfem.refused import BadInput
from flexfem.study import MOST_WORKERS, REPORTS, run
from flexfem.study.answer import nominal, require_extra_numbers
from flexfem.study.collect import Collected, collect, counted_warnings, read_table, table_path
from flexfem.study.findings import ParetoFront, Record, Refused, Source, findings
from flexfem.study.loaded import load_study
from flexfem.study.run import Counts, Parts, Progress
from flexfem.study.workers import Workers


class StudyFindings(NamedTuple):
    """A collected study: its table, what its figures are drawn from, and what each of them shows, by name.

    `flexfem.plot` draws records of `found`: `plot_map` a map, `plot_front` a front, `plot_histogram` each of the
    `scatters` of a distribution, `plot_shares` each of the `shares` of a sensitivity with its `factors`.
    """

    table: Collected
    source: Source
    found: dict[str, Record | Refused]


def processors() -> int:
    """Processors that this process may use: a job's share, not the whole machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def parts_of(study: PathLike, output: PathLike = REPORTS) -> Parts:
    """Where the parts of a study file lie below a folder. Raises BadInput."""
    parts = run.parts_of(load_study(checked_path(study)), checked_path(output))
    check_folder(parts.folder, written=False)
    return parts


def run_study(
    study: PathLike,
    output: PathLike = REPORTS,
    workers: int | None = None,
    shard: str = "1/1",
    retry: bool = False,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Compute the designs of a study that are still open; stopped or killed, it goes on where it was.

    Parameters
    ----------
    study, output : the study file, and the folder for what is written, in a folder of the study.
    workers : processes on this machine, by default one a processor.
    shard : `I/N`, only the I-th of N shares.
    retry : also try again what failed or ran out of time.
    scheduler : address of a Dask scheduler, whose workers compute instead and have the folder in common.

    Returns what `study_status` says, of this share. Raises BadInput or ComputationFailed as `flexfem study run`; parts
    that are written stay in any case.
    """
    share, parts = shard_of(shard), parts_of(study, output)
    compute(parts, workers, share, retry, scheduler)
    return status_facts(parts, share)


def compute(
    parts: Parts,
    workers: int | None,
    share: slice,
    retry: bool,
    scheduler: str | None = None,
    watch: Callable[[Progress], object] = lambda progress: None,
    say: Callable[[str], object] = lambda text: None,
) -> None:
    """Compute what is open of a share by as many workers as there are, no more than there are parts for."""
    if scheduler is not None and workers is not None:
        raise BadInput("workers with a scheduler, expected one of them: the scheduler has its own workers")
    count = processors() if workers is None else integer("workers", workers, MOST_WORKERS)
    require_extra_numbers(parts.loaded)
    check_folder(parts.folder)
    with Workers(max(1, min(count, len(parts.chunks(share)))), scheduler) as pool:
        run.run_parts(parts, pool, shard=share, retry=retry, watch=watch, say=say)


def study_status(study: PathLike, output: PathLike = REPORTS) -> dict[str, Any]:
    """How many designs of a study are done, refused, failed with reasons, and open, as `flexfem study status --json`.

    `study` : the study file, or the folder that its run writes, such as `reports/study-reach`.   Raises BadInput.
    """
    path = checked_path(study)
    if not path.is_dir():
        return status_facts(parts_of(path, output))
    folder = Path(os.path.abspath(path))
    try:
        named = json.loads((path / run.FILE).read_text(encoding="utf-8"))["study"]
        parts = parts_of(os.path.normpath(folder / named), folder.parent)
    except (OSError, ValueError, KeyError, TypeError):
        raise BadInput(f"{path}: no study has run in this folder, expected a study file or its results") from None
    if parts.loaded.stem != folder.name:
        raise BadInput(
            f"{path}: a folder of results of {parts.loaded.path}, expected it to be called {parts.loaded.stem}"
        )
    return status_facts(parts)


def clean_study(study: PathLike, output: PathLike = REPORTS, dry_run: bool = False) -> dict[str, Any]:
    """Remove parts of other inputs or versions than a study has; with `dry_run` only count them. Raises BadInput."""
    found, size = run.remove_stale(parts_of(study, output), dry_run)
    return {"stale": found, "bytes": size, "removed": bool(found) and not dry_run}


def collect_study(
    study: PathLike, output: PathLike = REPORTS, to: PathLike | None = None, partial: bool = False
) -> Collected:
    """Join what is done to one table, design after design.

    Parameters
    ----------
    to : the table to write, .parquet or .csv.
    partial : leave out designs that are still open instead of refusing.

    Raises BadInput: designs are open, a part is damaged, or the table cannot be written.
    """
    parts = parts_of(study, output)
    target = table_path(parts) if to is None else checked_path(to)
    if to is not None:
        check_file(target)
    return collect(parts, target, partial)


def study_findings(study: PathLike, output: PathLike = REPORTS, partial: bool = False) -> StudyFindings:
    """Collect the table of a study and find what its figures show. Raises BadInput as `collect_study`."""
    return findings_of(parts_of(study, output), partial)


def findings_of(parts: Parts, partial: bool = False) -> StudyFindings:
    """As `study_findings`."""
    made = collect(parts, table_path(parts), partial)
    source = Source(parts.loaded, read_table(made.path), nominal(parts.loaded), parts.factor_warnings)
    return StudyFindings(made, source, findings(source))


def shard_of(text: str) -> slice:
    """The parts that --shard I/N says, I from 1. Raises BadInput."""
    found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text) if isinstance(text, str) else None
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise BadInput(f"--shard {text}, expected I/N with 1 <= I <= N, such as 3/8")
    return slice(int(found[1]) - 1, None, int(found[2]))


def status_facts(parts: Parts, share: slice = slice(None)) -> dict[str, Any]:
    """What `study status` says, of all parts or of those of a share."""
    loaded, found = parts.loaded, run.survey(parts, share)
    counts, designs = found.total, sum(map(len, parts.chunks(share)))
    by_status: Counter[str] = Counter()
    for (status, _), n in counts.items():
        by_status[status] += n
    return {
        "file": str(loaded.path),
        "name": loaded.study.name,
        "hash": loaded.hash,
        "designs": designs,
        "done": by_status.total(),
        "ok": by_status["ok"],
        "refused": by_status["refused"],
        "failed": sum(by_status[status] for status in run.RETRIED),
        "reasons": {status: dict(_reasons(counts, status)) for status in sorted(by_status) if status != "ok"},
        "warnings": [*parts.factor_warnings, *counted_warnings(_reasons(counts, "ok"))],
        "open": designs - by_status.total(),
        "open_elsewhere": loaded.count - designs - found.elsewhere,
        "folder": str(parts.folder),
        "parts": len(found.counts),
        "damaged": [f"{parts.path(chunk)}: a damaged part" for chunk in found.damaged],
        "stale": len(found.stale),
        "stress_accuracy": loaded.stress_accuracy,
        **loaded.assumptions._asdict(),
    }


def _reasons(counts: Counts, wanted: str) -> Counter[str]:
    """Designs of a status by kind of reason, the most frequent first."""
    found = [(reason, n) for (status, reason), n in counts.items() if status == wanted]
    return Counter(dict(sorted(found, key=lambda item: (-item[1], item[0]))))


def facts_of(found: Record | Refused) -> dict[str, Any]:
    """What a figure shows as plain data: rows of its table, None for what is not finite; or why it is not drawn."""
    if isinstance(found, Refused):
        return {"refused": found.reason}
    about = {"power": found.power, "gain": found.gain} if isinstance(found, ParetoFront) else {}
    return {"rows": found.table.facts} | about
