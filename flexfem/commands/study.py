"""`flexfem study`: run, status, clean, collect, plot."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexfem.refused import BadInput
from flexfem.study.worker import ONE_THREAD

if TYPE_CHECKING:
    from flexfem.study.parts import Parts, Shard
    from flexfem.study.pool import Pool

app = typer.Typer(
    help="Study many designs: run, see how far it is, collect the table, plot.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@app.callback()
def _begin() -> None:
    """Study many designs: run, see how far it is, collect the table, plot."""
    from flexfem.sources import manifest

    manifest()  # before what computes is loaded
    os.environ.update(ONE_THREAD)  # as for the workers, before numpy is loaded: threads change last bits


MOST_WORKERS = 1024
StudyFile = Annotated[Path, typer.Argument(help="Study file, see cases/README.md.", metavar="STUDY")]
Output = Annotated[Path, typer.Option("--output", "-o", help="Folder for what is written, in a folder of the study.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Partial = Annotated[bool, typer.Option("--partial", help="Leave out designs that are still open.")]
REPORTS = Path("reports")


def _parts(study: Path, output: Path) -> Parts:
    from flexfem.study.loaded import load_study
    from flexfem.study.parts import parts_of

    return parts_of(load_study(study), output)


@app.command()
def run(
    study: StudyFile,
    workers: Annotated[
        int | None, typer.Option(min=1, max=MOST_WORKERS, help="Processes on this machine; default one a processor.")
    ] = None,
    shard: Annotated[str, typer.Option(metavar="I/N", help="Only the I-th of N shares, for job arrays.")] = "1/1",
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Compute on a Dask cluster.")] = None,
    output: Output = REPORTS,
    retry: Annotated[bool, typer.Option("--retry", help="Also try again what failed or ran out of time.")] = False,
    json: Json = False,
) -> None:
    """Compute the designs of a study that are still open; stopped or killed, it goes on where it was."""
    from flexfem.commands import console
    from flexfem.commands.processes import processors
    from flexfem.commands.progress import print_status, watching
    from flexfem.commands.study_answers import shard_of
    from flexfem.files.writing import check_folder
    from flexfem.study.probes import unseen
    from flexfem.study.run import run_study

    part = shard_of(shard)
    if scheduler is not None and workers is not None:
        raise BadInput("--workers with --scheduler, expected one of them: the scheduler has its own workers")
    parts = _parts(study, output)
    check_folder(parts.folder)
    told = unseen(parts.loaded)  # before a run that may take days; not again after it
    for text in told:
        _note(f"warning: {text}")
    tasks = parts.count if parts.loaded.study.model == "analytic" else parts.loaded.count
    with _resumable(parts), _pool(min(workers or processors(), tasks), scheduler) as pool, watching() as watch:
        run_study(parts, pool, shard=part, retry=retry, watch=watch, say=_note)
    facts, lost = _run_facts(parts, part), _lost(parts, part)
    later = [text for text in facts["warnings"] if text not in told]
    console.show(facts, json, lambda shown: print_status(shown | {"warnings": later}))
    if lost:
        blocked = [path for path in lost if path.exists()]
        cure = f"; first remove {shlex.quote(str(blocked[0]))}, which is no file" if blocked else ""
        _note(f"{len(lost)} parts of this run are not in {parts.folder}: the same command computes them{cure}")
    raise typer.Exit(1 if lost or (facts["failed"] and not facts["ok"]) else 0)


def _lost(parts: Parts, part: Shard) -> list[Path]:
    """Where parts of a share that has been computed are not there: removed meanwhile, or never taken."""
    return [path for number in part.chunks(parts) if not (path := parts.path(parts.chunk(number))).is_file()]


@contextmanager
def _pool(workers: int, scheduler: str | None) -> Iterator[Pool]:
    from flexfem.study.cluster import DaskPool
    from flexfem.study.pool import LocalPool

    pool = DaskPool(scheduler, _note) if scheduler is not None else LocalPool(workers)
    try:
        yield pool
    finally:
        pool.close()


@contextmanager
def _resumable(parts: Parts) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        _note(f"stopped; what is done is kept in {parts.folder}, the same command goes on")
        raise


def _note(text: str) -> None:
    print(f"flexfem: {text}", file=sys.stderr, flush=True)


@app.command()
def status(study: StudyFile, output: Output = REPORTS, json: Json = False) -> None:
    """Count the designs of a study that are done, refused, failed with reasons, and open."""
    from flexfem.commands import console
    from flexfem.commands.progress import print_status
    from flexfem.commands.study_answers import status_facts
    from flexfem.files.writing import check_folder

    parts = _parts(study, output)
    check_folder(parts.folder, written=False)
    console.show(status_facts(parts), json, print_status)


@app.command()
def clean(
    study: StudyFile,
    output: Output = REPORTS,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be removed.")] = False,
    json: Json = False,
) -> None:
    """Remove parts of other inputs or versions than the study has now; nothing else."""
    from flexfem.commands import console
    from flexfem.commands.progress import print_cleaned
    from flexfem.commands.study_answers import clean_facts
    from flexfem.files.writing import check_folder
    from flexfem.study.folder import release_folder, remove, stale_parts

    parts = _parts(study, output)
    check_folder(parts.folder)
    found = stale_parts(parts)
    if not dry_run:
        remove(found, parts.stale)
        release_folder(parts)
    console.show({**clean_facts(found), "removed": bool(found) and not dry_run}, json, print_cleaned)


@app.command()
def collect(
    study: StudyFile,
    output: Output = REPORTS,
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
    from flexfem.files.writing import check_folder
    from flexfem.study.collect import check_target, table_path
    from flexfem.study.collect import collect as join

    parts = _parts(study, output)
    target = to or table_path(parts, partitioned)
    check_target(target, partitioned or (to is None and target.suffix == ""))
    check_folder(target.parent)
    made = join(parts, target, partial)
    console.show_written([made.path], json, designs=made.designs, open=made.open)


@app.command()
def plot(study: StudyFile, output: Output = REPORTS, partial: Partial = False, json: Json = False) -> None:
    """Collect the table of a study and draw its figures, as PNG and PDF; what they show is in the JSON, as numbers."""
    from flexfem.commands import console
    from flexfem.commands.study_answers import facts_of
    from flexfem.files.writing import check_folder
    from flexfem.plot.study import Source, named, write_study_figures
    from flexfem.study.collect import collect as join
    from flexfem.study.collect import table_path
    from flexfem.study.collected import read_table
    from flexfem.study.findings import Refused, findings
    from flexfem.study.probes import nominal, unseen

    parts = _parts(study, output)
    check_folder(parts.folder.parent)
    loaded, made = parts.loaded, join(parts, table_path(parts), partial)
    table, base = read_table(made.path, loaded), nominal(loaded)
    found = findings(loaded, table, base)
    nothing = unseen(loaded)
    doubts = [*nothing, *table.warnings]
    by_name = dict(zip((name for name, _ in named(loaded)), found, strict=True))
    written = write_study_figures(Source(loaded, table, base, nothing), found, parts.folder.parent)
    shown = {name: facts_of(one) for name, one in by_name.items()}
    console.show_written([made.path, *written], json, warnings=doubts, findings=shown)
    for text in doubts:
        _note(f"warning: {text}")
    refused = {name: one.reason for name, one in by_name.items() if isinstance(one, Refused)}
    for name, reason in refused.items():
        _note(f"{name} is not drawn: {reason}")
    raise typer.Exit(1 if refused else 0)


def _run_facts(parts: Parts, shard: Shard) -> dict[str, Any]:
    from flexfem.commands.study_answers import status_facts

    facts = status_facts(parts, shard)
    file, folder = facts["file"], parts.folder.parent.parent
    where = [] if folder == REPORTS else ["--output", str(folder)]
    opened = facts["open"] or facts["open_elsewhere"]
    wanted = ["run", "--retry"] if facts["failed"] else ["status"] if opened else ["plot"]
    going_on = shlex.join(["flexfem", "study", *wanted, str(file), *where])
    return facts | {"shard": f"{shard.first + 1}/{shard.step}", "next": going_on}
