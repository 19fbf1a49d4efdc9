"""`flexfem study`: run, status, clean, collect, plot."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexfem import studies
from flexfem.refused import BadInput
from flexfem.sources import ONE_THREAD
from flexfem.terminal import Stopped

if TYPE_CHECKING:
    from flexfem.study.parts import Parts, Shard
    from flexfem.study.run import Progress

app = typer.Typer(
    help="Study many designs: run, see how far it is, collect the table, plot.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.callback()
def _begin() -> None:
    """Study many designs: run, see how far it is, collect the table, plot."""
    os.environ.update(ONE_THREAD)  # as for the workers, before numpy is loaded: threads change last bits


StudyFile = Annotated[Path, typer.Argument(help="Study file, see flexfem schema study.", metavar="STUDY")]
Output = Annotated[Path, typer.Option("--output", "-o", help="Folder for what is written, in a folder of the study.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Partial = Annotated[bool, typer.Option("--partial", help="Leave out designs that are still open.")]


@app.command()
def run(
    study: StudyFile,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=studies.MOST_WORKERS, help="Processes on this machine; default one a processor."),
    ] = None,
    shard: Annotated[str, typer.Option(metavar="I/N", help="Only the I-th of N shares, for job arrays.")] = "1/1",
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Compute on a Dask cluster.")] = None,
    output: Output = studies.REPORTS,
    retry: Annotated[bool, typer.Option("--retry", help="Also try again what failed or ran out of time.")] = False,
    json: Json = False,
) -> None:
    """Compute the designs of a study that are still open; stopped or killed, it goes on where it was."""
    from flexfem.commands import console
    from flexfem.commands.progress import print_status
    from flexfem.files.writing import check_folder
    from flexfem.study.probes import unseen
    from flexfem.study_answers import shard_of

    part = shard_of(shard)
    if scheduler is not None and workers is not None:
        raise BadInput("--workers with --scheduler, expected one of them: the scheduler has its own workers")
    parts = studies.parts_of(study, output)
    check_folder(parts.folder)
    told = unseen(parts.loaded)  # before a run that may take days; not again after it
    _warn(told)
    _compute(parts, workers, scheduler, part, retry)
    facts, lost = _run_facts(parts, part), _lost(parts, part)
    later = [text for text in facts["warnings"] if text not in told]
    console.show(facts, json, lambda shown: print_status(shown | {"warnings": later}))
    _say_lost(lost, parts.folder)
    raise typer.Exit(1 if lost or (facts["failed"] and not facts["ok"]) else 0)


def _compute(parts: Parts, workers: int | None, scheduler: str | None, part: Shard, retry: bool) -> None:
    """Compute what is open of a share, with a bar; a stop says how it goes on."""
    from flexfem.commands.progress import watching
    from flexfem.study.run import run_study

    latest: list[Progress] = []

    def seen(step: Progress) -> None:
        latest[:] = [step]
        watch(step)

    with _resumable(parts, latest), studies.pool_for(parts, workers, scheduler, _note) as pool, watching() as watch:
        run_study(parts, pool, shard=part, retry=retry, watch=seen, say=_note)


def _lost(parts: Parts, part: Shard) -> list[Path]:
    """Where parts of a share that has been computed are not there: removed meanwhile, or never taken."""
    return [path for number in part.chunks(parts) if not (path := parts.path(parts.chunk(number))).is_file()]


def _say_lost(lost: list[Path], folder: Path) -> None:
    if lost:
        blocked = [path for path in lost if path.exists()]
        cure = f"; first remove {shlex.quote(str(blocked[0]))}, which is no file" if blocked else ""
        _note(f"{len(lost)} parts of this run are not in {folder}: the same command computes them{cure}")


@contextmanager
def _resumable(parts: Parts, latest: list[Progress]) -> Iterator[None]:
    try:
        yield
    except Stopped as stop:
        known = latest and latest[0].kept is not None
        kept = f"{latest[0].kept:,} of {latest[0].designs:,} designs are" if known else "what is done is"
        stop.said = f"stopped; {kept} kept in {parts.folder}, the same command goes on"
        raise


def _warn(texts: Iterable[str]) -> None:
    for text in texts:
        _note(f"warning: {text}")


def _note(text: str) -> None:
    print(f"flexfem: {text}", file=sys.stderr, flush=True)


@app.command()
def status(study: StudyFile, output: Output = studies.REPORTS, json: Json = False) -> None:
    """Count the designs of a study that are done, refused, failed with reasons, and open."""
    from flexfem.commands import console
    from flexfem.commands.progress import print_status

    console.show(studies.study_status(study, output), json, print_status)


@app.command()
def clean(
    study: StudyFile,
    output: Output = studies.REPORTS,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be removed.")] = False,
    json: Json = False,
) -> None:
    """Remove parts of other inputs or versions than the study has now; nothing else."""
    from flexfem.commands import console
    from flexfem.commands.progress import print_cleaned

    console.show(studies.clean_study(study, output, dry_run), json, print_cleaned)


@app.command()
def collect(
    study: StudyFile,
    output: Output = studies.REPORTS,
    to: Annotated[
        Path | None, typer.Option(help="Table to write: .parquet, .csv, or with --partitioned a folder.")
    ] = None,
    partitioned: Annotated[
        bool, typer.Option("--partitioned", help="A folder of Parquet files; so are tables of millions of designs.")
    ] = False,
    partial: Partial = False,
    json: Json = False,
) -> None:
    """Join what is done to one table, design after design."""
    from flexfem.commands import console

    made = studies.collect_study(study, output, to, partitioned, partial)
    console.show_written([made.path], json, designs=made.designs, open=made.open)


@app.command()
def plot(study: StudyFile, output: Output = studies.REPORTS, partial: Partial = False, json: Json = False) -> None:
    """Collect the table of a study and draw its figures, as PNG and PDF; what they show is in the JSON, as numbers."""
    from flexfem.commands import console
    from flexfem.plot.study import write_study_figures
    from flexfem.study.findings import Refused
    from flexfem.study_answers import facts_of

    table, source, found = studies.study_findings(study, output, partial)
    written = write_study_figures(source, list(found.values()), table.path.parent)
    doubts = [*source.unseen, *source.table.warnings]
    shown = {name: facts_of(one) for name, one in found.items()}
    console.show_written([table.path, *written], json, warnings=doubts, findings=shown)
    _warn(doubts)
    refused = {name: one.reason for name, one in found.items() if isinstance(one, Refused)}
    for name, reason in refused.items():
        _note(f"{name} is not drawn: {reason}")
    raise typer.Exit(1 if refused else 0)


def _run_facts(parts: Parts, shard: Shard) -> dict[str, Any]:
    from flexfem.study_answers import status_facts

    facts = status_facts(parts, shard)
    file, folder = facts["file"], parts.folder.parent.parent
    where = [] if folder == studies.REPORTS else ["--output", str(folder)]
    opened = facts["open"] or facts["open_elsewhere"]
    wanted = ["run", "--retry"] if facts["failed"] else ["status"] if opened else ["plot"]
    going_on = shlex.join(["flexfem", "study", *wanted, str(file), *where])
    return facts | {"shard": f"{shard.first + 1}/{shard.step}", "next": going_on}
