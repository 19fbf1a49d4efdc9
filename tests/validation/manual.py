"""All problems run one after the other, and the verification manual: a section for each with what
was found.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from flexfem.files.writing import markdown_table
from flexfem.plot.write import write_picture

from . import consistency, hinge, large, plane, practice, vibration, warm
from .problem import PROBLEMS, Finding, MissingSolverError

HEAD = ("quantity", "target", "target ±", "ours", "difference", "allowed ±", "unknowns", "")
REGISTERED = (
    consistency,
    plane,
    hinge,
    large,
    vibration,
    warm,
    practice,
)  # their imports fill PROBLEMS


def run(names: Sequence[str]) -> dict[str, list[Finding]]:
    """Findings of problems by name; progress goes to stderr."""
    found = {}
    for name in names:
        start = time.perf_counter()
        try:
            found[name] = PROBLEMS[name].run()
            verdict = "passed" if all(each.passed for each in found[name]) else "FAILED"
        except MissingSolverError as missing:
            verdict = f"left out, {missing}"
        print(f"{name}: {verdict}, {time.perf_counter() - start:.1f} s", file=sys.stderr)
    return found


MANUAL = (
    "Verification manual",
    "What `make validation` finds. Every target is published or exact, none is a value of our own.",
)
MECHANISMS = (
    "Verified mechanisms",
    "Mechanisms from practice, drawn by others, beside published or independent values. `make "
    "validation` solves them; their files are in `tests/validation/mechanisms`, and each states "
    "its source.",
)


def manual(
    found: Mapping[str, Sequence[Finding]],
    figures: Mapping[str, str],
    heading: tuple[str, str] = MANUAL,
) -> str:
    """The page in Markdown, of findings by the name of their problem; `figures` by the same name.

    heading : title and first sentences of the page.
    """
    findings = [finding for each in found.values() for finding in each]
    failed = sum(not finding.passed for finding in findings)
    verdict = f"{failed} of {len(findings)} fail" if failed else f"All {len(findings)} agree"
    title, purpose = heading
    blocks = [
        f"# {title}",
        f"{purpose} {verdict} within what is allowed: a limit stated beside the target, in its "
        "unit, from the error that the mesh is expected to have and from the digits that the "
        "source prints.",
        *(block for name, own in found.items() for block in _section(name, own, figures.get(name))),
    ]
    return "\n\n".join(blocks) + "\n"


def _section(name: str, own: Sequence[Finding], figure: str | None) -> Iterator[str]:
    problem = PROBLEMS[name]
    yield f"## {problem.title}"
    yield f"Verifies {problem.verifies}. {(problem.run.__doc__ or '').strip()}"
    yield markdown_table(HEAD, map(_row, own), "lrrrrrr")
    notes = [f"- {found.quantity}: {found.note}." for found in own if found.note]
    yield "\n".join([f"- Source: {problem.source}.", *notes])
    if figure is not None:
        yield f"![{problem.title}]({figure})"


def _row(found: Finding) -> list[str]:
    uncertainty = f"{found.uncertainty:.2g}" if found.uncertainty else "exact"
    ours = f"{found.ours:.6g}" + (f" ± {found.band:.2g}" if found.band else "")
    cells = [found.quantity, f"{found.target:.6g}", uncertainty, ours, f"{found.difference:+.1e}"]
    return [
        *cells,
        f"{found.allowed:.2g}",
        f"{found.unknowns or ''}",
        "" if found.passed else "**fails**",
    ]


def draw(name: str, folder: Path) -> str:
    """Draw the figure of a problem into a folder and return its file name, empty without a figure."""
    if name == "elastica":
        file = folder / "verification-elastica.png"
        large.draw_elastica(file)
        return file.name
    if PROBLEMS[name].mechanism:
        file = folder / f"verified-{name}.png"
        write_picture(file, practice.drawing(PROBLEMS[name].mechanism))
        return file.name
    return ""


def write(
    page: Path, names: Sequence[str], heading: tuple[str, str] = MANUAL, figures: str = ""
) -> bool:
    """Run problems and write their page; whether all passed.

    figures : folder of the figures, relative to that of the page.
    """
    folder = page.parent / figures
    folder.mkdir(parents=True, exist_ok=True)
    found = run(names)
    drawn = {name: draw(name, folder) for name in found}
    places = {name: (Path(figures) / file).as_posix() for name, file in drawn.items() if file}
    page.write_text(manual(found, places, heading))
    return all(each.passed for own in found.values() for each in own)


def main() -> int:
    """`python -m tests.validation.manual`: 1 when something failed."""
    from . import solvers  # noqa: F401 - registers the problems that need another program and the test extra

    parser = argparse.ArgumentParser(
        description="Solve problems with known answers and write the verification manual."
    )
    parser.add_argument(
        "names",
        nargs="*",
        choices=[*PROBLEMS, []],
        metavar="NAME",
        help="of problems; by default all",
    )
    parser.add_argument("--page", type=Path, default=Path("reports/verification-manual.md"))
    wanted = parser.parse_args()
    passed = write(wanted.page, wanted.names or list(PROBLEMS))
    print(wanted.page)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
