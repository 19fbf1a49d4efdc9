"""What a page says of a design: every cell of its tables, on a record of which every number is another."""

from __future__ import annotations

import html
import re

import pytest
from markupsafe import Markup

from flexfem.page import design
from flexfem.page.design import design_parts

from ..design.recorded import REQUIREMENTS, recorded

SIGNS = str.maketrans("\N{NO-BREAK SPACE}\N{MINUS SIGN}\N{MICRO SIGN}", " -u")


def text_of(markup: str) -> str:
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", markup)).translate(SIGNS).split())


@pytest.fixture
def section(monkeypatch):
    """What makes a section of a record: the rows of its tables, and its text, a figure being its name in brackets."""
    for name in ("design_figure", "sensitivity_figure", "front_figure"):
        monkeypatch.setattr(design, name, lambda of, name=name: name)
    said = Markup("<p>[{}]</p>")
    monkeypatch.setattr(design, "shown_figure", lambda id, draw, about, data="": said.format(draw()) + data)

    def made(of, name):
        found = dict(design_parts(of, 1, False))[name]().html
        rows = re.findall(r"<tr.*?</tr>", found, re.DOTALL)
        table = [[text_of(cell) for cell in re.findall(r"<t[hd][ >].*?</t[hd]>", row, re.DOTALL)] for row in rows]
        return table, text_of(found)

    return made


def test_dimensions_and_objectives_stand_below_their_headings(section):
    rows, text = section(recorded(), "Recorded")
    assert rows == [
        ["dimension (units of the stage file)", "designed", "without steps, by the model", "limit"],
        ["neck", "0.505", "0.5042", ""],
        ["l1", "31.5", "31.62", "at an end of its range"],
        ["objective", "value", "better", "checked by", "model by itself"],
        ["reach", "412.000 ± 1.2 um", "larger", "finite elements", "433.000"],
        ["mass", "0.0893000 kg", "smaller", "exact", "0.0871000"],
    ]
    for said in ("requirements wanted.toml", "base stage base.toml", "life extrapolated", "[design_figure]",
                 "it does not meet all requirements", "82.4 % of 2,000 stages"):  # fmt: skip
        assert said in text
    assert "it meets all requirements" in section(recorded(feasible=True), "Recorded")[1]
    tight = [REQUIREMENTS[0].model_copy(update={"tightened_percent": 0.41}), *REQUIREMENTS[1:]]
    assert "stiffness by 0.41 %" in section(recorded(requirements=tight), "Recorded")[1]


def test_requirements_have_their_margins_and_relaxations(section):
    rows, _ = section(recorded(), "Recorded: requirements")
    assert rows == [
        ["requirement", "wanted", "value", "verdict", "margin (% of the end)", "limits the objective", "checked by",
         "model by itself"],
        ["stiffness", "at least 60 and at most 80", "61.5000 ± 0.25 N/mm", "met", "1.88 ± 0.31", "yes",
         "finite elements", "66.0000"],
        ["diameter", "at most 150", "153.000 mm", "missed", "-2.00", "yes", "analytic model alone", "152.000"],
        ["coupling", "at most 0.0135", "0.0131000 ± 0.00090", "within the band", "2.96 ± 6.7", "",
         "analytic model alone", "0.0142000"],
        ["requirement", "relaxed to", "by (%)"],
        ["stiffness", "57.4000", "4.33000"],
        ["diameter", "none is enough", ""],
    ]  # fmt: skip


def test_sensitivities_front_and_rounds_are_those_of_the_record(section):
    rows, text = section(recorded(), "Recorded: sensitivity")
    assert rows == [
        ["dimension", "stiffness", "diameter", "coupling", "reach", "mass"],
        ["neck", "-2.43", "0.540", "not known", "-1.31", "0.120"],
        ["l1", "1.87", "0.980", "1.09", "0.650", "0.760"],
    ]
    assert "[sensitivity_figure]" in text
    rows, text = section(recorded(), "Recorded: front")
    assert rows == [
        ["design", "neck", "l1", "reach (um)", "mass (kg)", "reach (um), corrected model", "mass (kg), corrected model",
         "requirements"],
        ["1", "0.43", "36", "405.00", "0.081000", "407.00", "0.082000", "met"],
        ["2", "0.52", "30", "466.00", "0.093000", "469.00", "0.094000", "not met"],
    ]  # fmt: skip
    assert "[front_figure]" in text
    rows, text = section(recorded(), "Recorded: search")
    assert rows[:4] == [["model", "designs"], ["analytic", "53,345"], ["drawn", "17"], ["finite elements", "12"]]
    assert rows[4:] == [
        ["round", "designs by the model", "largest difference (%)"],
        ["1", "41,000", "7.53"],
        ["2", "12,345", "0.0660"],
    ]
    assert "came to agree within 0.3 % at the design. Seed 2003." in text
    assert "did not come to agree" in section(recorded(agreed=False), "Recorded: search")[1]
