"""Numbers that the pages state are the accepted ones, to the digits that they show."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.analytic.model import analyse
from flexfem.mechanism.stage import load_stage

ROOT = Path(__file__).parent.parent
PAGES = "\n".join(page.read_text() for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))])
AXES = ("x", "y", "theta")
ROUND_OFF = 1e-11  # per cent; what the page promises of its zeros
JOINTS_ROUND_OFF = 1e-9  # of those with joints commanded
NUMBER = r"[-+]?\d+(?:\.\d+)?"


def accepted(stem):
    return json.loads((ROOT / f"tests/baselines/{stem}.json").read_text())["record"]


def table(header):
    """Cells of the lines below the line of a Markdown table's names."""
    lines = PAGES.partition(f"{header}\n")[2].splitlines()[1:]
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return found[: next(k for k, line in enumerate(lines) if not line.startswith("|"))]


def prose(pattern, page=PAGES):
    """Numbers of the one sentence that has a pattern, where `N` is a number and blanks are any white space."""
    (found,) = re.findall(re.escape(pattern).replace("N", f"({NUMBER})").replace(r"\ ", r"\s+"), page)
    return [found] if isinstance(found, str) else list(found)


def require_shown(texts, values):
    """Every text is its value, rounded half up or down to the digits shown; no text of digits is left out."""
    for text, value in zip(texts, values, strict=True):
        assert abs(float(text) - value) <= 0.5001 * 10.0 ** -len(text.partition(".")[2]), (text, value)


def test_the_table_of_errors_is_what_verify_printed():
    rows = table("| figure | command | model | X | Y | theta |")
    assert len(rows) == 6
    for (figure, command, model, *cells), expected in zip(rows, "556677", strict=True):
        result = accepted(f"fig{figure}")["result"]
        assert (figure, command.lower()) == (expected, result["direction"])
        for axis, cell in zip(AXES, cells, strict=True):
            percent, band = result["error_percent"][model][axis], result["uncertainty"][model][axis]["band"]
            if axis == command.lower():
                require_shown(cell.split(" ± "), (percent, band))
            else:
                assert cell == "0" and abs(percent) < ROUND_OFF and band <= 1e-8


def test_the_short_table_of_the_front_page_is_what_verify_printed():
    rows = table("| model of the stage | X (Figure 5) | Y (Figure 6) | theta (Figure 7) |")
    assert [row[0] for row in rows] == ["mobility three", "mobility six"]
    for model, *cells in rows:
        found = [accepted(f"fig{figure}")["result"]["error_percent"][model] for figure in (5, 6, 7)]
        require_shown(cells, [percent[axis] for axis, percent in zip(AXES, found, strict=True)])


def test_the_table_of_joints_commanded_is_what_verify_printed():
    rows = table("| joints commanded | model | X | Y | theta |")
    assert len(rows) == 4
    for (command, model, *cells), expected in zip(rows, ["X", "X", "theta", "theta"], strict=True):
        result = accepted(f"joints-{expected.lower()}")["result"]
        assert command == expected and result["drive"] == "joints"
        for axis, cell in zip(AXES, cells, strict=True):
            percent, band = result["error_percent"][model][axis], result["uncertainty"][model][axis]["band"]
            if cell == "0":
                assert abs(percent) < JOINTS_ROUND_OFF and band <= 1e-8
            else:
                require_shown(cell.split(" ± "), (percent, band))


def test_the_table_of_shares_is_what_budget_printed():
    split = accepted("mobility6")["budget"]["split"]
    rows = table("| share | X | Y | theta |")
    shares = [part["name"] for part in split["x"]["shares"]]
    outside = [f"outside it: {what}" for what in ("hinges by the chart", "three dimensions")]
    assert [row[0] for row in rows] == [*shares, "total", *outside, "total in three dimensions"]
    rows = rows[:-2]  # measured by a slow test of tests/verify/test_solid.py
    for axis, *cells, total, outside in zip(AXES, *(row[1:] for row in rows), strict=True):
        require_shown(cells, [part["points"][axis] for part in split[axis]["shares"]])
        require_shown(total.split(" ± "), (split[axis]["total"][axis], split[axis]["band"]))
        require_shown([outside], [split[axis]["out_of_plane"][axis]])
    other = accepted("mobility3")["budget"]["split"]["x"]["shares"]
    require_shown(prose("they are N, N, N, N, N in X"), [part["points"]["x"] for part in other])


def test_the_claim_of_5_to_10_percent_holds_between_the_necks_that_the_page_states():
    stage = load_stage(ROOT / "geometry/mobility6.toml")
    low, high = map(float, prose("5 to 10 % holds for necks of N to N mm"))

    def holds(neck):
        thin = stage.replace(neck=dict.fromkeys(("base", "elbow", "platform"), neck))
        compliance = analyse(thin, 21, "calibrated", links=True).compliance
        error = 100 * np.diag(compliance @ analyse(thin, 6).stiffness) - 100
        return bool(np.all((error >= 5) & (error <= 10)))

    assert [holds(neck) for neck in (low - 0.01, low, high, high + 0.01)] == [False, True, True, False]


def test_what_large_displacements_change_is_what_workspace_printed():
    points = accepted("mobility6")["workspace"]["travel"]["x"]["points"]
    at = {round(1e3 * point["commanded"]): point["position"] for point in points}
    wanted = [at[um][model] for model in ("exact", "elements") for um in (500, 50)]
    shown = prose("exact load is N % above (18), at 50 um N %; nonlinear finite elements say N and N %")
    require_shown(shown, wanted)


def test_what_the_drive_reaches_is_what_reach_says():
    found = flexfem.reach(flexfem.load(ROOT / "geometry/mobility6.toml"), resolution=None).ranges
    (said,) = re.findall(r"X reaches ± ([\d.]+) um and Y ± ([\d.]+) um with the others at zero", PAGES)
    (free,) = re.findall(r"± ([\d.]+) and ± ([\d.]+) um with them free, theta ± ([\d.]+) mrad", PAGES)
    assert said == tuple(f"{1e3 * found[axis].held.high:.1f}" for axis in ("x", "y"))
    assert free == (
        *(f"{1e3 * found[axis].free.high:.1f}" for axis in ("x", "y")),
        f"{1e3 * found['theta'].held.high:.2f}",
    )


def test_the_first_numbers_of_the_changelog_and_the_printed_regression_line_are_accepted_ones():
    error = {axis: accepted(f"fig{5 + k}")["result"]["error_percent"] for k, axis in enumerate(AXES)}
    page = (ROOT / "CHANGELOG.md").read_text()
    three = prose("finite elements move N % (x, y) and N % (theta)", page)
    six = prose("mobility three predicts, and N % and N % further than mobility six does", page)
    for shown, model in ((three, "mobility three"), (six, "mobility six")):
        require_shown(shown, [error[axis][model][axis] for axis in ("x", "theta")])
        assert error["y"][model]["y"] == pytest.approx(error["x"][model]["x"], rel=1e-9)
    was, now, moved, _ = prose("error_percent.mobility six.y was N, is N, moved N, allowed N %")
    require_shown([was], [error["y"]["mobility six"]["y"]])
    assert float(now) - float(was) == pytest.approx(float(moved), abs=6e-4)


def test_the_sizes_of_the_reference_meshes_are_those_solved():
    models = accepted("fig5")["result"]["models"]
    found = re.search(r"reference stages \((\d+),(\d+) and (\d+),(\d+) unknowns\)", PAGES)
    assert [int("".join(found.group(k, k + 1))) for k in (1, 3)] == [
        models[name]["unknowns"] for name in ("mobility six", "mobility three")
    ]
