"""The command that writes one page to send to a colleague."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexfem import studies
from flexfem.commands import console
from flexfem.commands.console import Json, check_within
from flexfem.terminal import people, print_ending, working

if TYPE_CHECKING:
    from flexfem.page.report import PageReport

app = typer.Typer()
NAMES = "analytic, elements, budget, stress, drive (these by default), large, modes, drift, life; or all"


@app.command()
def report(
    files: Annotated[
        list[Path],
        typer.Argument(help="A stage file, a study file, or results as JSON.", metavar="STAGE|STUDY|RESULT..."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Page to write, .html.")] = Path("report.html"),
    sections: Annotated[str, typer.Option(help=f"Of a stage, with commas: {NAMES}.")] = "",
    amplitude: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y THETA", help="Of the platform, mm, mm, rad, fully reversed, for the section life."),
    ] = None,
    folder: Annotated[Path, typer.Option(help="Of a study, where its designs are kept.")] = studies.REPORTS,
    json: Json = False,
) -> None:
    """Write one self-contained HTML page of a stage, a study or stored results and designs."""
    from flexfem.page import report as page

    check_within("--amplitude", amplitude, 1e3)
    wanted: Sequence[str] = [each.strip() for each in sections.split(",") if each.strip()] or page.STANDARD
    if list(wanted) == ["all"]:
        wanted = [each for each in page.SECTIONS if each != "life" or amplitude is not None]
    found = page.report(files, output, wanted, amplitude, _told, folder)
    console.show(found, json, print_page)


def _told(parts: Sequence[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """The parts one by one; says on standard error which is made."""
    with working("report", len(parts)) as say:
        for part in parts:
            say(part[0])
            yield part


def print_page(of: PageReport) -> None:
    """Print where the page is, and what it has."""
    out = people()
    out.print(f"written: {of.written} ({of.bytes / 1e6:.2f} MB)")
    out.print(f"sections: {', '.join(of.sections)}")
    print_ending(out, of)
