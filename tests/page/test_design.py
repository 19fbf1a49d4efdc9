"""What a page says of a design: its tables and figures, on a record of which every number is another."""

from __future__ import annotations

import html
import re

from flexfem.page import design
from flexfem.page.design import SECTIONS, design_parts

from ..design.recorded import recorded


def test_a_page_has_every_table_of_a_record_and_its_figures(monkeypatch):
    drawn = []
    monkeypatch.setattr(design, "shown_figure", lambda anchor, draw, about: drawn.append(draw.func) or "")
    of = recorded()
    sections = {name: make() for name, make in design_parts(of, 1, False)}
    assert [*sections] == [f"Recorded: {name}" for name in SECTIONS]
    assert drawn == [one.figure for one in SECTIONS.values() if one.figure]
    for name, tables in of.sections(plain=False).items():
        text = html.unescape(re.sub(r"\s*<[^>]+>\s*", "|", sections[f"Recorded: {name}"].html))
        for cell in (cell for one in tables for row in (one.head, *one.rows) for cell in row):
            assert f"|{cell}|" in text, cell
    first = sections["Recorded: design"]
    assert first.title == "Recorded" and "life extrapolated" in first.html and "82.4 % of 2,000 stages" in first.html
    names = dict(design_parts(recorded(front=[], requirements=[], alternatives=[]), 1, True))
    assert [*names] == ["Recorded: design", "Recorded: sensitivity", "Recorded: search"]
    assert names["Recorded: search"]().title == "Search: Recorded"
