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


def test_the_table_of_claims_is_what_claims_printed():
    record = accepted("claims")["claims"]
    verdicts = {each["id"]: each for each in record["verdicts"]}
    value = {name: each["values"] for name, each in verdicts.items()}
    rows = table("| claim, in our words | verdict | holds in | found on the reference stages |")
    names = (
        "six-commanded", "six-across", "three-along", "three-across", "six-better", "axial-cause", "larger-radius",
        "rotation-more", "diagonal", "second-order", "second-order-error", "minimum-energy", "temperature-gradient",
        "measured-stiffness", "stiffer-simulated",
    )  # fmt: skip
    found, said = {}, {}
    for name, (_, verdict, share, text) in zip(names, rows, strict=True):
        assert verdict == verdicts[name]["verdict"]
        shares = verdicts[name]["shares"]
        require_shown(re.findall(NUMBER, share), [100 * each["share"] for each in shares[:1]])
        said[name] = text
        found[name] = re.findall(rf"{NUMBER}(?:e-\d+)?", re.split("[:;]", text)[0])
    require_shown(found["six-commanded"] * 3, value["six-commanded"])
    require_shown(found["three-along"], value["three-along"])
    require_shown(found["six-better"], (min(value["six-better"]), max(value["six-better"])))
    require_shown(found["second-order-error"], value["second-order-error"])
    require_shown(found["rotation-more"], value["rotation-more"])
    require_shown(found["larger-radius"][:1], value["larger-radius"])
    of_gradients = value["temperature-gradient"]
    require_shown(found["temperature-gradient"][:2], (min(of_gradients), max(of_gradients)))
    assert f"-{found['temperature-gradient'][2]}" in verdicts["temperature-gradient"]["found"]
    assert f"it {re.findall(NUMBER, said['larger-radius'])[-1]} times as large" in verdicts["larger-radius"]["found"]
    x = {
        (each["name"].partition(",")[0].partition(":")[0], each["mobility"]): each["along"]["x"]
        for each in record["alternatives"]
    }
    require_shown(found["axial-cause"], (x["axial freedom left out", 3] - x["none", 6], x["none", 6]))
    box = accepted("mobility6")["workspace"]
    require_shown(
        [found["second-order"][0], found["second-order"][3]], (box["small"]["position"], box["box"]["position"])
    )
    for name in ("six-across", "three-across", "diagonal"):
        assert max(value[name]) < float(*found[name])
    bend = verdicts["second-order"]["depends"]
    assert bend["name"] == "chain.joint_angles_deg[1]"
    require_shown(re.findall(NUMBER, said["second-order"])[-2:], [-each for each in reversed(bend["holding"])])
    assert verdicts["axial-cause"]["depends"]["holding"][0] > -2
    ratio, along = (verdicts[name]["depends"] for name in ("six-commanded", "three-along"))
    assert ratio["name"] == along["name"] == "t/R of the elbow hinges"
    require_shown(re.findall(NUMBER, said["six-commanded"])[-2:], ratio["holding"])
    require_shown(re.findall(NUMBER, said["three-along"])[-1:], along["holding"][:1])


def test_what_the_page_says_of_the_ensemble_is_what_claims_printed():
    record = accepted("claims")["claims"]
    ensemble, (six, *_) = record["ensemble"], [each for each in record["verdicts"] if each["id"] == "six-commanded"]
    require_shown(prose("share of N plausible pairs of stages"), [ensemble["judged"]])
    require_shown(prose("of N drawn pairs, N cannot be made"), [ensemble["drawn"], ensemble["infeasible"]])
    (short,) = [each for each in six["shares"] if each["formula"] == "paros-weisbord-short"]
    assert not short["reference_in_range"] and short["reference_holds"]
    require_shown(prose("short form of (2) errs N % on the reference stage"), short["reference"][:1])


def test_the_claim_of_5_to_10_percent_holds_between_the_necks_that_the_page_states():
    stage = load_stage(ROOT / "geometry/mobility6.toml")
    low, high = map(float, prose("5 to 10 % holds for necks of N to N mm"))

    def holds(neck):
        thin = stage.replace(neck=dict.fromkeys(("base", "elbow", "platform"), neck))
        compliance = analyse(thin, 21, "calibrated", links=True).compliance
        error = 100 * np.diag(compliance @ analyse(thin, 6).stiffness) - 100
        return bool(np.all((error >= 5) & (error <= 10)))

    assert [holds(neck) for neck in (low - 0.01, low, high, high + 0.01)] == [False, True, True, False]


NONE = "none: curved quadratic triangles, as verified"


def test_what_the_page_says_of_alternatives_is_what_claims_printed():
    rows = accepted("claims")["claims"]["alternatives"]
    found = {(row["name"], row["mobility"]): row for row in rows if not row["name"].startswith(("R/t", "axial"))}
    across = {name for name, model in found if model == 3 and found[name, 3]["across"]["x"] > 0.01}  # per cent
    less = {
        name
        for name in across
        if all(
            abs(found[name, 6][part][axis]) < 0.95 * abs(found[name, 3][part][axis])
            for part in ("along", "across")
            for axis in ("x", "y")
        )
    }
    wide = [found[key]["across"][axis] for key in found for axis in AXES if "scatter" in key[0] or "linear" in key[0]]
    require_shown(prose("Cross errors of N to N % come"), [f(w for w in wide if w > 0.1) for f in (min, max)])
    off = [found[key]["across"][axis] for key in found for axis in AXES if "off the centre" in key[0]]
    require_shown(prose("linear triangles, of N to N % from a"), [f(w for w in off if w > 0.1) for f in (min, max)])
    joints, strokes = (f"{what} commanded instead of the platform" for what in ("joints", "strokes"))
    assert less == {joints} and f"({len(rows) - len(rows) % 10} rows of" in PAGES
    six, three = (found[joints, mobility] for mobility in (6, 3))
    shown = prose("platform (N for N % along in X and Y, N for N % in theta; across N for N %)")
    both = [(part, axis) for part, axis in (("along", "x"), ("along", "theta"), ("across", "x"))]
    require_shown(shown, [abs(row[part][axis]) for part, axis in both for row in (six, three)])
    assert all(row["along"]["y"] == pytest.approx(row["along"]["x"], abs=5e-3) for row in (six, three))
    shown = prose("strokes of stacks it is the other way round (N for N %)")
    require_shown(shown, [abs(found[strokes, mobility]["along"]["x"]) for mobility in (6, 3)])
    require_shown(
        prose("short form of formula (2) (N %), and with necks 10 um thicker than drawn (N %)"),
        [
            found[name, 6]["along"]["x"]
            for name in ("hinge formula paros-weisbord-short", "necks of the metal 10 um thicker than drawn")
        ],
    )
    (crossed,) = [row["along"]["x"] for row in rows if row["name"].endswith("on the metal of the mobility-six stage")]
    require_shown(prose("other stage misses by N %"), [crossed])
    bare, pressed = (
        100 + found[name, 6]["along"]["x"]
        for name in (NONE, "base necks pressed with 10 N, which the model leaves out")
    )
    require_shown(prose("base necks is worth N % of it"), [100 * (100 / bare - 100 / pressed)])
    require_shown(prose("eight across a neck (N %)"), [found["linear triangles, 8 across every neck", 6]["along"]["x"]])


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
