"""Studies from Python: each function returns what its command under `flexfem study` prints.

flexfem.run_study("cases/study-reach.toml")
flexfem.collect_study("cases/study-reach.toml")
flexfem.study.table("reports/study-reach/study-reach.parquet")      # a pandas or Arrow table
"""

from __future__ import annotations

import json
import os
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from flexfem.arguments import integer
from flexfem.arrays import short_repr
from flexfem.files.provenance import assumptions_said
from flexfem.files.refusals import checked_path
from flexfem.files.toml import PathLike
from flexfem.files.writing import check_file, check_folder
from flexfem.refused import BadInput
from flexfem.results import Progress, html_table
from flexfem.study import MOST_WORKERS, REPORTS, run
from flexfem.study.answer import nominal, require_extra_numbers
from flexfem.study.collect import RUN_AGAIN, Collected, collect, counted_warnings, read_table
from flexfem.study.findings import findings
from flexfem.study.listing import left_out, tables_of_designs
from flexfem.study.loaded import load_study
from flexfem.study.overview import overview
from flexfem.study.records import ParetoFront, Record, Refused
from flexfem.study.run import Counts, Parts
from flexfem.study.source import Source
from flexfem.study.workers import workers_of

NO_FIGURE = "no figure: no number differs between designs that differ in a factor"


class Facts(dict[str, Any]):
    """Facts about a study, which print as lines of text; `failed`: the command ends with exit code
    1.
    """

    def __init__(
        self, facts: Mapping[str, Any], lines: Iterable[str], failed: bool = False
    ) -> None:
        super().__init__(facts)
        self.text = "\n".join(lines)
        self.failed = failed

    def __str__(self) -> str:
        return self.text


@short_repr
class StudyFindings(NamedTuple):
    """A collected study: its table, the source data of its figures, and the record of each figure
    by name. A notebook shows its designs and its figures.

    `flexfem.plot` draws records of `found` on axes: `plot_curves` each of the `panels` of curves,
    `plot_map` a map, or each of the `maps` of a page, `plot_effect` a number over a factor,
    `plot_front` a front, `plot_histogram` each of the `scatters` of a distribution, `plot_shares`
    each of the `shares` of a sensitivity with its `factors`."""

    table: Collected
    source: Source
    found: dict[str, Record | Refused]

    def figures(self) -> dict[str, Any]:
        """Return the matplotlib figures of the study by name, drawn anew at each call."""
        from flexfem.plot.study import page_of  # heavy

        drawn = {name: one for name, one in self.found.items() if not isinstance(one, Refused)}
        return {name: page_of(record) for name, record in drawn.items()}

    def _repr_html_(self) -> str:
        """Return the table of the designs and the figures for a notebook."""
        from flexfem.plot.inline import inline_image  # heavy

        html = [html_table(each) for each in tables_of_designs(self.source)]
        html.append(f"<p>{escape(left_out(self.source, self.table.path))}</p>")
        html += [inline_image(each, f"Figure {name}") for name, each in self.figures().items()]
        return "".join(html)


def processors() -> int:
    """Return the number of processors that this process may use, which may be a share of the
    machine.
    """
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def parts_of(study: PathLike, output: PathLike = REPORTS) -> Parts:
    """Return the parts of a study file in an output folder, or of a folder of results. Raises
    BadInput.
    """
    path = checked_path(study)
    folder = checked_path(output)
    if path.is_dir():
        path, folder = _study_of(path)
    parts = run.parts_of(load_study(path), folder)
    check_folder(parts.folder, written=False)
    return parts


def _study_of(results: Path) -> tuple[Path, Path]:
    """Return the study file and the output folder of a folder of results, or of its parts. Raises
    BadInput.
    """
    folder = Path(os.path.abspath(results))
    folder = folder.parent if folder.name == run.PARTS else folder
    try:
        stored = json.loads((folder / run.FILE).read_text(encoding="utf-8"))
        file = Path(os.path.normpath(folder / stored["study"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise BadInput(
            f"{results}: no study has run in this folder, expected a study file or its results"
        ) from None
    if file.stem != folder.name:
        raise BadInput(
            f"{results}: a folder of results of {file}, expected it to be named {file.stem}"
        )
    return file, folder.parent


def run_study(
    study: PathLike,
    output: PathLike = REPORTS,
    *,
    workers: int | None = None,
    shard: str = "1/1",
    retry: bool = False,
    scheduler: str | None = None,
    executor: Executor | None = None,
    no_figures: bool = False,
    progress: Progress | None = None,
) -> Facts:
    """Compute the unfinished designs of a study, then write its table and draw its figures.

    The same call continues a run that was stopped or killed.

    Parameters
    ----------
    study : path
        Study file, see flexfem schema study, or the folder of its results, such as
        `reports/study-reach`.
    output : path
        Folder of results, with a folder for each study. The command also takes the name of a file
        that ends in .csv, .parquet, .json, .html, .png or .pdf.
    workers : int, optional
        Number of processes on this machine, at most 1024, by default one per processor. Not with
        another executor.
    shard : str
        Compute share I of N, written I/N, for job arrays.
    retry : bool
        Repeat designs that failed or ran out of time.
    scheduler : str, optional
        Compute on the workers of a Dask scheduler: its address, host:port, or the path of its
        scheduler file.
    executor : concurrent.futures.Executor, optional
        Compute on the workers of this executor, such as `client.get_executor()` of a Dask client.
    no_figures : bool
        Compute only, without the table and the figures. A share of a study never has them.
    progress : callable, optional
        Called with a line of text after every part.

    Returns
    -------
    dict
        As that of `study_status`, for this share, with the `next` command, and the files `written`:
        the table, then the figures. Raises BadInput or ComputationFailed; written parts are kept in
        any case.
    """
    share = shard_of(shard)
    parts = parts_of(study, output)
    count = processors() if workers is None else integer("workers", workers, MOST_WORKERS)
    if workers is not None and (scheduler is not None or executor is not None):
        raise BadInput(
            f"workers = {workers}, expected none with a scheduler or an executor, which have "
            "their own"
        )
    if not all(parts.path(chunk).exists() for chunk in parts.chunks(share)):
        require_extra_numbers(parts.loaded)
    check_folder(parts.folder)
    with workers_of(max(1, min(count, len(parts.chunks(share)))), scheduler, executor) as pool:
        run.run_parts(
            parts,
            pool,
            shard=share,
            retry=retry,
            say=progress or (lambda text: None),
        )
    facts = status_facts(parts, share)
    facts |= {"shard": shard, "written": [], "not_drawn": {}}
    if facts["ok"] and not (facts["open"] or facts["open_elsewhere"] or no_figures):
        if progress is not None:
            progress("table and figures")
        facts |= _drawn(findings_of(parts))
    facts["next"] = _next_command(facts, parts.folder.parents[1])
    return Facts(facts, _lines(facts), bool(facts["open"] or (facts["failed"] and not facts["ok"])))


def _next_command(facts: Mapping[str, Any], folder: Path) -> str:
    """Return the command that follows a run, by its facts and the folder of results."""
    elsewhere = folder.absolute() != REPORTS.absolute()
    where = ["--output", str(folder)] if elsewhere else []
    command = ["study", "plot", facts["file"], *where]
    if facts["failed"]:
        command = ["study", "run", "--retry", facts["file"], *where]
    elif facts["open_elsewhere"]:
        command = ["study", "status", facts["file"], *where]
    elif facts["written"]:
        page = str(Path(facts["written"][0]).with_suffix(".html"))
        where = ["--folder", str(folder)] if elsewhere else []
        command = ["report", facts["file"], *where, "-o", page]
    return shlex.join(["flexfem", *command])


def _drawn(findings: StudyFindings) -> dict[str, Any]:
    """Draw the figures of a study; return the written files, and why a figure is not drawn."""
    from flexfem.plot.study import write_study_figures  # heavy

    images = write_study_figures(findings.found, findings.table.path.parent)
    refused = {
        name: record.reason
        for name, record in findings.found.items()
        if isinstance(record, Refused)
    }
    written = [str(path) for path in (findings.table.path, *images)]
    return {"written": written, "not_drawn": refused}


def study_status(study: PathLike, output: PathLike = REPORTS) -> Facts:
    """Count the designs of a study by status. The output states the reasons of refusals and
    failures.

    Parameters
    ----------
    study : path
        Study file, see flexfem schema study, or the folder of its results.
    output : path
        Folder of results, with a folder for each study.

    Returns
    -------
    dict
        Numbers of finished, refused, failed and unfinished designs, with reasons. Raises BadInput.
    """
    facts = status_facts(parts_of(study, output))
    return Facts(facts, _lines(facts))


def clean_study(
    study: PathLike,
    output: PathLike = REPORTS,
    *,
    dry_run: bool = False,
) -> Facts:
    """Remove parts of other inputs or versions. Parts of the present study file and versions stay.

    Parameters
    ----------
    study : path
        Study file, see flexfem schema study, or the folder of its results.
    output : path
        Folder of results, with a folder for each study.
    dry_run : bool
        Count the parts without removing them.

    Returns
    -------
    dict
        Number and bytes of the parts. Raises BadInput.
    """
    count, size = run.remove_stale(parts_of(study, output), dry_run)
    removed = bool(count) and not dry_run
    done = "removed" if removed else "nothing removed"
    line = f"{count:,} parts of other inputs or versions, {size / 1e6:.3g} MB: {done}"
    return Facts({"stale": count, "bytes": size, "removed": removed}, [line])


def collect_study(
    study: PathLike,
    output: PathLike = REPORTS,
    *,
    to: PathLike | None = None,
    partial: bool = False,
) -> Facts:
    """Join the finished designs in one table, in their order.

    Parameters
    ----------
    study : path
        Study file, see flexfem schema study, or the folder of its results.
    output : path
        Folder of results, with a folder for each study.
    to : path, optional
        Table to write, .parquet or .csv.
    partial : bool
        Leave out unfinished designs instead of refusing them.

    Returns
    -------
    dict
        The written table, and the numbers of its designs and of unfinished ones. Raises BadInput:
        designs are unfinished, a part is damaged, or the table cannot be written.
    """
    parts = parts_of(study, output)
    target = parts.table if to is None else checked_path(to)
    if to is not None:
        check_file(target)
    table = collect(parts, target, partial)
    return Facts(
        {"written": [str(table.path)], "designs": table.designs, "open": table.open},
        [str(table.path)],
    )


def plot_study(
    study: PathLike,
    output: PathLike = REPORTS,
    *,
    partial: bool = False,
) -> Facts:
    """Collect the table and draw the figures. They are PNG and PDF files; --json prints their
    numbers.

    Parameters
    ----------
    study : path
        Study file, see flexfem schema study, or the folder of its results.
    output : path
        Folder of results, with a folder for each study. The command also takes the name of a file
        that ends in .csv, .parquet, .json, .html, .png or .pdf.
    partial : bool
        Leave out unfinished designs instead of refusing them.

    Returns
    -------
    dict
        The written files, warnings, and the rows of every figure, or why it cannot be drawn. Raises
        BadInput.
    """
    findings = study_findings(study, output, partial)
    drawn = _drawn(findings)
    warnings = [
        *run.warnings_of_factors(parts_of(study, output)),
        *findings.source.table.warnings,
    ]
    facts = drawn | {
        "warnings": warnings,
        "findings": {name: facts_of(finding) for name, finding in findings.found.items()},
    }
    lines = [*_lines_of_files(drawn), *(f"warning: {text}" for text in warnings)]
    return Facts(facts, lines, bool(drawn["not_drawn"]))


def study_findings(
    study: PathLike, output: PathLike = REPORTS, partial: bool = False
) -> StudyFindings:
    """Collect the table of a study and compute the records of its figures. Raises BadInput as
    `collect_study`.
    """
    return findings_of(parts_of(study, output), partial)


def findings_of(parts: Parts, partial: bool = False) -> StudyFindings:
    """Return the findings of a study from its parts, as `study_findings`."""
    collected = collect(parts, parts.table, partial)
    source = Source(parts.loaded, read_table(collected.path), nominal(parts.loaded))
    found: dict[str, Record | Refused] = {**findings(source), **overview(source)}
    return StudyFindings(collected, source, found)


def shard_of(text: str) -> slice:
    """Return the slice of parts of `--shard I/N`, I from 1. Raises BadInput."""
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text) if isinstance(text, str) else None
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise BadInput(f"--shard {text}, expected I/N with 1 <= I <= N, such as 3/8")
    return slice(int(match[1]) - 1, None, int(match[2]))


def status_facts(parts: Parts, share: slice = slice(None)) -> dict[str, Any]:
    """Return the facts of `study status` on all parts or those of a share."""
    loaded = parts.loaded
    found = run.survey(parts, share)
    counts = found.total
    designs = sum(map(len, parts.chunks(share)))
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
        "reasons": {
            status: dict(_reasons(counts, status)) for status in sorted(by_status) if status != "ok"
        },
        "warnings": [*run.warnings_of_factors(parts), *counted_warnings(_reasons(counts, "ok"))],
        "open": designs - by_status.total(),
        "open_elsewhere": loaded.count - designs - found.elsewhere,
        "folder": str(parts.folder),
        "parts": len(found.counts),
        "damaged": [*found.damaged.values()],
        "stale": len(found.stale),
        "stress_accuracy": loaded.stress_accuracy,
        **loaded.assumptions._asdict(),
    }


def _reasons(counts: Counts, status: str) -> Counter[str]:
    """Return the number of designs of a status by kind of reason, the most frequent first."""
    reasons = [(reason, n) for (other, reason), n in counts.items() if other == status]
    return Counter(dict(sorted(reasons, key=lambda item: (-item[1], item[0]))))


def _lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield the facts of `study run` and `study status` as text."""
    share = f", share {facts['shard']}" if facts.get("shard", "1/1") != "1/1" else ""
    elsewhere = f", {facts['open_elsewhere']:,} in other shares" if share else ""
    yield (
        f"{facts['name']}{share}: {facts['designs']:,} designs, {facts['open']:,} "
        f"unfinished{elsewhere}"
    )
    yield (
        f"done {facts['done']:,}: {facts['ok']:,} ok, {facts['refused']:,} refused, "
        f"{facts['failed']:,} failed"
    )
    for state, reasons in facts["reasons"].items():
        yield from (f"  {n:,} {state}: {reason}" for reason, n in reasons.items())
    yield f"{facts['parts']:,} part{'s' * (facts['parts'] != 1)} in {facts['folder']}"
    yield from (f"{text}; {RUN_AGAIN}" for text in facts["damaged"])
    if facts["stale"]:
        yield (
            f"{facts['stale']:,} parts there belong to other inputs or versions; flexfem study "
            "clean removes them"
        )
    yield from (f"warning: {text}" for text in facts["warnings"])
    yield f"accuracy: {facts['stress_accuracy']}"
    for text in assumptions_said(
        facts["assumed"], facts["not_stated"], "of the numbers of the study "
    ):
        yield f"{text}: --json lists them"
    if "next" in facts:
        yield from _lines_of_files(facts)
        yield f"next: {facts['next']}"


def _lines_of_files(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield the table and the figures that were written, and why others were not drawn."""
    if facts["written"]:
        table, *images = facts["written"]
        yield f"table: {table}"
        pictures = [name for name in images if name.endswith(".png")]
        yield from (f"figure: {name} (and .pdf)" for name in pictures)
        if not pictures and not facts["not_drawn"]:
            yield NO_FIGURE
    yield from (f"{name} is not drawn: {reason}" for name, reason in facts["not_drawn"].items())


def facts_of(record: Record | Refused) -> dict[str, Any]:
    """Return a figure as plain data: rows of its table, None for numbers not finite; or why it is
    not drawn.
    """
    if isinstance(record, Refused):
        return {"refused": record.reason}
    front = {"power": record.power, "gain": record.gain} if isinstance(record, ParetoFront) else {}
    return {"rows": record.table.facts} | front
