"""All problems run one after the other, and the verification manual: a section for each with what was found."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from flexfem.files.writing import markdown_table

from . import consistency, hinge, large, plane, vibration, warm
from .problem import PROBLEMS, Finding, MissingSolverError

HEAD = ("quantity", "target", "target ±", "ours", "difference", "allowed ±", "unknowns", "")
REGISTERED = (consistency, plane, hinge, large, vibration, warm)  # their imports fill PROBLEMS


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


def manual(found: Mapping[str, Sequence[Finding]], figures: Mapping[str, str]) -> str:
    """The verification manual in Markdown, of findings by the name of their problem; `figures` by the same name."""
    findings = [finding for each in found.values() for finding in each]
    failed, count = sum(not finding.passed for finding in findings), len(findings)
    verdict = f"{failed} of {count} fail" if failed else f"All {count} agree"
    blocks = [
        "# Verification manual",
        f"What `make validation` finds. Every target is published or exact, none is a value of our own. {verdict} "
        "within what is allowed: a limit stated beside the target, in its unit, from the error that the mesh is "
        "expected to have and from the digits that the source prints.",
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
    cells = [found.quantity, f"{found.target:.6g}", uncertainty, f"{found.ours:.6g}", f"{found.difference:+.1e}"]
    return [*cells, f"{found.allowed:.2g}", f"{found.unknowns or ''}", "" if found.passed else "**fails**"]


def write(page: Path, names: Sequence[str], figure: str = "verification-elastica.png") -> bool:
    """Run problems and write the manual, and beside it the figure of the elastica; whether all passed."""
    (page.parent / figure).parent.mkdir(parents=True, exist_ok=True)
    found = run(names)
    if "elastica" in found:
        large.draw_elastica(page.parent / figure)
    page.write_text(manual(found, {"elastica": figure}))
    return all(each.passed for own in found.values() for each in own)


def main() -> int:
    """`python -m tests.validation.manual`: 1 when something failed."""
    from . import solvers  # noqa: F401 - registers the problems that need another program and the test extra

    parser = argparse.ArgumentParser(description="Solve problems with known answers and write the verification manual.")
    parser.add_argument("names", nargs="*", choices=[*PROBLEMS, []], metavar="NAME", help="of problems; by default all")
    parser.add_argument("--page", type=Path, default=Path("reports/verification-manual.md"))
    wanted = parser.parse_args()
    passed = write(wanted.page, wanted.names or list(PROBLEMS))
    print(wanted.page)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
