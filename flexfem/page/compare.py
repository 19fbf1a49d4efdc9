"""The page of compared mechanisms: numbers side by side, drawings over each other, sources."""

from __future__ import annotations

import shlex
from datetime import UTC, datetime
from functools import partial

from flexfem.files.provenance import assumptions_said
from flexfem.page.section import html_of, notes, section, sentence, shown_figure, table
from flexfem.page.sources import sources_section
from flexfem.plot.compare import overlay_figure
from flexfem.plot.text import assumption_rows
from flexfem.questions.comparison import Comparison
from flexfem.results import versions


def comparison_page(found: Comparison) -> str:
    """Return the text of one self-contained HTML page."""
    numbers, *others = found.tables(plain=False, brief=True)
    answer = notes(found.answer().split("\n"), "note")
    drawing = shown_figure("overlay", partial(overlay_figure, found), "The plates over each other")
    explained = notes(found.sentences(brief=True), "note")
    rows = assumption_rows([(each.label, each.mechanism) for each in found.subjects])
    doubts = assumptions_said(found.assumed, found.not_stated, "of the numbers of this page ")
    return html_of(
        [
            section("numbers", "Numbers side by side", answer, table(numbers, False)),
            section("plates", "Plates and inputs", drawing, *(table(each) for each in others)),
            section("notes", "Notes", notes(found.warnings), explained),
            sources_section(rows, "in"),
        ],
        title=f"Comparison with {found.labels[0]}",
        subtitle=found.heading(),
        assumptions=sentence("; ".join(doubts)),
        command=_command_line(found),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions(),
    )


def _command_line(found: Comparison) -> str:
    """Return the shell command that makes the page again; a mechanism without file has its label."""
    words = ["flexfem", "compare"]
    words += [str(each.mechanism.origin.path or each.label) for each in found.subjects]
    for name, value in found.settings.items():
        if value is True:
            words.append(f"--{name}")
        elif value:
            words += [f"--{name}", str(value)]
    return shlex.join([*words, "-o", "compare.html"])
