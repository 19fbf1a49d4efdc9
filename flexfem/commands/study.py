"""`flexfem study`: run, status, clean, collect, plot."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexfem.commands.console import Json, show, show_written
from flexfem.study import MOST_WORKERS, REPORTS
from flexfem.terminal import EVERY, Stopped, working

if TYPE_CHECKING:
    from flexfem.study.run import Parts, Progress

app = typer.Typer(
    help="Study many designs: run, count finished designs, collect the table, plot.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
STUDY = "Study file, see flexfem schema study, or the folder of its results."
StudyFile = Annotated[Path, typer.Argument(help=STUDY, metavar="STUDY")]
Output = Annotated[Path, typer.Option("--output", "-o", help="Folder of results, with a folder for each study.")]
Partial = Annotated[bool, typer.Option("--partial", help="Leave out unfinished designs.")]
Workers = Annotated[int | None, typer.Option(min=1, max=MOST_WORKERS, help="Processes, by default one per processor.")]


@app.command()
def run(
    study: StudyFile,
    workers: Workers = None,
    shard: Annotated[str, typer.Option(metavar="I/N", help="Compute share I of N, for job arrays.")] = "1/1",
    output: Output = REPORTS,
    retry: Annotated[bool, typer.Option("--retry", help="Repeat designs that failed or timed out.")] = False,
    json: Json = False,
) -> None:
    """Compute the unfinished designs of a study. The same command continues a run that was stopped or killed."""
    from flexfem import studies

    share = studies.shard_of(shard)
    parts = studies.parts_of(study, output)
    with _resumable(parts) as watch:
        studies.compute(parts, workers, share, retry, watch, _note)
    facts = studies.status_facts(parts, share)
    output = parts.folder.parents[1]
    where = [] if output.absolute() == REPORTS.absolute() else ["--output", str(output)]
    command = ["run", "--retry"] if facts["failed"] else ["status"] if facts["open_elsewhere"] else ["plot"]
    facts |= {"shard": shard, "next": shlex.join(["flexfem", "study", *command, facts["file"], *where])}
    show(facts, json, print_status)
    raise typer.Exit(1 if facts["open"] or (facts["failed"] and not facts["ok"]) else 0)


@contextmanager
def _resumable(parts: Parts) -> Iterator[Callable[[Progress], None]]:
    """Show the progress of a run on standard error; a stop reports the designs that are kept."""
    began = time.monotonic()
    latest: list[Progress] = []
    try:
        with working("study", EVERY) as say:

            def watch(step: Progress) -> None:
                latest[:] = [step]
                say(progress_line(step, time.monotonic() - began))

            yield watch
    except Stopped as stop:
        kept = f"{latest[0].counts.total():,} of {latest[0].designs:,} designs are" if latest else "finished parts are"
        stop.said = f"stopped; {kept} kept in {parts.folder}; the same command continues the run"
        raise


def progress_line(step: Progress, seconds: float) -> str:
    """Return one line on a run after `seconds`: designs done, rate, time left, failures."""
    from flexfem.study.run import RETRIED

    done = step.counts.total()
    failed = sum(n for (status, _), n in step.counts.items() if status in RETRIED)
    rate = (done - step.known) / seconds if seconds > 0 else 0.0
    minutes, s = divmod(round((step.designs - done) / rate), 60) if rate > 0 else (0, 0)
    left = f"{minutes // 60} h {minutes % 60:02d} min {s:02d} s left" if rate > 0 else "waiting for the first"
    return f"{done:,}/{step.designs:,} designs, {rate:,.{0 if rate > 10 else 2}f}/s, {left}, {failed:,} failed"


def _note(text: str) -> None:
    print(f"flexfem: {text}", file=sys.stderr, flush=True)


@app.command()
def status(study: StudyFile, output: Output = REPORTS, json: Json = False) -> None:
    """Count the designs of a study by status. The output states the reasons of refusals and failures."""
    from flexfem import studies

    show(studies.study_status(study, output), json, print_status)


def print_status(facts: dict[str, Any]) -> None:
    """Print the state of a study for `study run` and `study status`."""
    from flexfem.mechanism.stage_file import assumptions_said

    share = f", share {facts['shard']}" if facts.get("shard", "1/1") != "1/1" else ""
    elsewhere = f", {facts['open_elsewhere']:,} in other shares" if share else ""
    print(f"{facts['name']}{share}: {facts['designs']:,} designs, {facts['open']:,} unfinished{elsewhere}")
    print(f"done {facts['done']:,}: {facts['ok']:,} ok, {facts['refused']:,} refused, {facts['failed']:,} failed")
    for state, reasons in facts["reasons"].items():
        for reason, n in reasons.items():
            print(f"  {n:,} {state}: {reason}")
    print(f"{facts['parts']:,} part{'s' * (facts['parts'] != 1)} in {facts['folder']}")
    for text in facts["damaged"]:
        print(f"{text}; flexfem study run computes it again")
    if facts["stale"]:
        print(f"{facts['stale']:,} parts there belong to other inputs or versions; flexfem study clean removes them")
    for text in facts["warnings"]:
        print(f"warning: {text}")
    print(f"accuracy: {facts['stress_accuracy']}")
    for text in assumptions_said(facts["assumed"], facts["not_stated"], "of the numbers of the study "):
        print(f"{text}: --json lists them")
    if "next" in facts:
        print(f"next: {facts['next']}")


@app.command()
def clean(
    study: StudyFile,
    output: Output = REPORTS,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Count the parts without removing them.")] = False,
    json: Json = False,
) -> None:
    """Remove parts of other inputs or versions. Parts of the present study file and versions stay."""
    from flexfem import studies

    def print_removed(facts: dict[str, Any]) -> None:
        removed = "removed" if facts["removed"] else "nothing removed"
        print(f"{facts['stale']:,} parts of other inputs or versions, {facts['bytes'] / 1e6:.3g} MB: {removed}")

    show(studies.clean_study(study, output, dry_run), json, print_removed)


@app.command()
def collect(
    study: StudyFile,
    output: Output = REPORTS,
    to: Annotated[Path | None, typer.Option(help="Table to write: .parquet or .csv.")] = None,
    partial: Partial = False,
    json: Json = False,
) -> None:
    """Join the finished designs in one table, in their order."""
    from flexfem import studies

    table = studies.collect_study(study, output, to, partial)
    show_written([table.path], json, designs=table.designs, open=table.open)


@app.command()
def plot(study: StudyFile, output: Output = REPORTS, partial: Partial = False, json: Json = False) -> None:
    """Collect the table and draw the figures. They are PNG and PDF files; --json prints their numbers."""
    from flexfem import studies
    from flexfem.plot.study import write_study_figures
    from flexfem.study.findings import Refused

    table, source, found = studies.study_findings(study, output, partial)
    written = write_study_figures(found, table.path.parent)
    warnings = source.table.warnings
    findings = {name: studies.facts_of(finding) for name, finding in found.items()}
    show_written([table.path, *written], json, warnings=warnings, findings=findings)
    for text in warnings:
        _note(f"warning: {text}")
    refused = {name: finding.reason for name, finding in found.items() if isinstance(finding, Refused)}
    for name, reason in refused.items():
        _note(f"{name} is not drawn: {reason}")
    raise typer.Exit(1 if refused else 0)
