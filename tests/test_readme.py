"""Numbers that the pages state are the accepted ones, to the digits that they show."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.paper.budget import CHART, SHARES
from flexfem.paper.model import analyse
from flexfem.paper.stage import load_stage

ROOT = Path(__file__).parent.parent
PAGES = "\n".join(
    page.read_text() for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
)
SOLID = "three dimensions"
AXES = ("x", "y", "theta")
ROUND_OFF = 1e-11  # per cent; what the page promises of its zeros
JOINTS_ROUND_OFF = 1e-9  # of those with joints commanded
NUMBER = r"[-+]?\d+(?:\.\d+)?"


def accepted(stem):
    return json.loads((ROOT / f"tests/baselines/{stem}.json").read_text())["numbers"]


def table(header):
    """Cells of the lines below the line of a Markdown table's names."""
    lines = PAGES.partition(f"{header}\n")[2].splitlines()[1:]
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return found[: next(k for k, line in enumerate(lines) if not line.startswith("|"))]


def prose(pattern, page=PAGES):
    """Numbers of the one sentence that has a pattern, where `N` is a number and blanks are any
    white space.
    """
    (found,) = re.findall(
        re.escape(pattern).replace("N", f"({NUMBER})").replace(r"\ ", r"\s+"), page
    )
    return [found] if isinstance(found, str) else list(found)


def require_shown(texts, values):
    """Every text is its value, rounded half up or down to the digits shown; no text of digits is
    left out.
    """
    for text, value in zip(texts, values, strict=True):
        assert abs(float(text) - value) <= 0.5001 * 10.0 ** -len(text.partition(".")[2]), (
            text,
            value,
        )


def require_row(figure, command, model, cells, round_off):
    """The cells of a row are what verify printed, percentage and band by direction; zero is
    round-off.
    """
    numbers = accepted(figure)["errors"]
    for axis, cell in zip(AXES, cells, strict=True):
        percent, band = numbers[f"percent.{model.replace(' ', '_')}.{axis}"]
        if cell == "0":
            assert axis != command.lower() and abs(percent) < round_off and band <= 1e-8
        else:
            require_shown(cell.split(" ± "), (percent, band))


def test_the_tables_of_errors_are_what_verify_printed():
    rows = table("| figure | command | model | x | y | theta |")
    assert [figure for figure, *_ in rows] == list("556677")
    for figure, command, model, *cells in rows:
        require_row(f"fig{figure}", command, model, cells, ROUND_OFF)
    rows = table("| joints commanded | model | x | y | theta |")
    assert [command for command, *_ in rows] == ["x", "x", "theta", "theta"]
    for command, model, *cells in rows:
        require_row(f"joints-{command.lower()}", command, model, cells, JOINTS_ROUND_OFF)


def test_the_table_of_shares_is_what_budget_printed():
    numbers = accepted("mobility6")["budget"]
    rows = table("| share | x | y | theta |")
    outside = [f"outside it: {what}" for what in ("hinges by the chart", "three dimensions")]
    assert [row[0] for row in rows] == [*SHARES, "total", *outside, "total in three dimensions"]
    rows = rows[:-2]  # measured by a slow test of tests/verify/test_solid.py
    for axis, *cells, total, outside in zip(AXES, *(row[1:] for row in rows), strict=True):
        require_shown(
            cells, [numbers[f"share.{share.replace(' ', '_')}.{axis}"][0] for share in SHARES]
        )
        require_shown(total.split(" ± "), numbers[f"share.total.{axis}"])
        require_shown([outside], [numbers[f"solid.{CHART.replace(' ', '_')}.{axis}"][0]])
    other = accepted("mobility3")["budget"]
    require_shown(
        prose("they are N, N, N, N, N in x"),
        [other[f"share.{share.replace(' ', '_')}.x"][0] for share in SHARES],
    )


def test_the_claim_of_5_to_10_percent_holds_between_the_necks_that_the_page_states():
    stage = load_stage(ROOT / "geometry/mobility6.toml")
    low, high = map(float, prose("5 to 10 % holds for necks of N to N mm"))

    def holds(neck):
        thin = stage.replace(neck=dict.fromkeys(("base", "elbow", "platform"), neck))
        compliance = analyse(thin, 21, "calibrated", links=True).compliance
        error = 100 * np.diag(compliance @ analyse(thin, 6).stiffness) - 100
        return bool(np.all((error >= 5) & (error <= 10)))

    assert [holds(neck) for neck in (low - 0.01, low, high, high + 0.01)] == [
        False,
        True,
        True,
        False,
    ]


def test_the_sizes_of_the_reference_meshes_are_those_solved():
    found = re.search(r"reference stages \((\d+),(\d+) and (\d+),(\d+) unknowns\)", PAGES)
    unknowns = [
        accepted(name)["convergence"]["unknowns.8_across_a_neck"][0]
        for name in ("mobility6", "mobility3")
    ]
    assert [int("".join(found.group(k, k + 1))) for k in (1, 3)] == unknowns


@pytest.mark.slow
def test_the_answers_for_the_xy_stage_are_those_of_the_commands(tmp_path):
    flexfem.new_stage(tmp_path / "mine.toml", kind="xy-stage")
    mechanism = flexfem.load(tmp_path / "mine.toml")
    stiffness, reach, modes = (
        ask(mechanism) for ask in (flexfem.stiffness, flexfem.reach, flexfem.modes)
    )
    at_rest = {"free": 1.0, "stress": 1.0}
    asked = [(stiffness, name, factor, {"direction": "x"}) for name, factor in at_rest.items()]
    asked += [(reach, "ends", 1e3, {"others": "free", "end": "high", "direction": "x"})]
    asked += [(modes, "frequency", 1.0, {"mode": "1"})]
    *rows, last = table(
        "| quantity | command | analytic model | finite elements, three dimensions |"
    )
    at = {"others": "free", "sense": "negative", "direction": "x"}
    by_beams = flexfem.stiffness(mechanism, models="analytic")
    require_shown(re.findall(NUMBER, last[2]), [-float(by_beams.at("range", **at))])
    require_shown(
        re.findall(NUMBER, last[3]),
        [-float(stiffness.at("range", **at)), float(stiffness.band("range", **at))],
    )
    for (of, name, factor, at), (_, _, analytic, elements) in zip(asked, rows, strict=True):
        value = {model: factor * of.at(name, model=model, **at) for model in ("analytic", SOLID)}
        require_shown(re.findall(NUMBER, analytic), [float(np.max(value["analytic"]))])
        band = factor * of.band(name, model=SOLID, **at)
        largest = np.argmax(value[SOLID])
        shown = [float(np.ravel(each)[largest]) for each in (value[SOLID], band)]
        require_shown(re.findall(NUMBER, elements), shown)
