"""The page of a study: its numbers are those of its table, all names are text."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from markupsafe import Markup

from flexfem.page.section import html_of
from flexfem.page.study import study_parts
from flexfem.studies import run_study
from flexfem.study.findings import findings
from flexfem.study.loaded import LoadedStudy, base_factor_values
from flexfem.study.source import Source

from ..study.answered import answered, head, study

GRID = f"""{head("A study")}
[sampling]
method = "grid"
[[factor]]
key = "hinges.base.radius_mm"
from = 2.0
to = 3.5
points = 4
[[factor]]
keys = ["hinges.elbow.neck_mm", "hinges.platform.neck_mm"]
label = "other necks"
from = 0.4
to = 0.8
points = 3
"""
MAP = '[[figure]]\nkind = "map"\nx = "hinges.base.radius_mm"\ny = "other necks"\nvalue = "kxx_n_per_mm"\n'
FRONT = '[[figure]]\nkind = "pareto"\nx = "range_x_um"\ny = "kxx_n_per_mm"\n'
STATUS = {
    "designs": 12,
    "ok": 10,
    "refused": 2,
    "failed": 0,
    "open": 0,
    "warnings": [],
    "reasons": {},
}


def source_of(loaded: LoadedStudy, **changed: np.ndarray) -> Source:
    """A study with its answers, some columns replaced."""
    return Source(loaded, answered(loaded, **changed), base_factor_values(loaded))


def page_of(source: Source, **status: list[str]) -> str:
    made = [
        make()
        for _, make in study_parts(source, findings(source), STATUS | status, Path("t.parquet"))
    ]
    said = {
        "subtitle": "",
        "assumptions": "",
        "command": "flexfem report",
        "made": "2026-01-02",
        "versions": {},
    }
    return html_of(made, title=source.loaded.study.name, **said)


def rows_of(html: str) -> dict[str, list[str]]:
    """Numbers in the rows of tables, by what names the row."""
    rows = re.findall(r'<th scope="row"[^>]*>([^<]*)</th>(.*?)</tr>', html, re.S)
    # those of a figure, before those of the designs
    return {name: re.findall(r">([^<>]*)</td>", row) for name, row in reversed(rows)}


def test_the_numbers_of_a_front_are_those_of_the_table(tmp_path):
    scale = np.linspace(1.0, 2.0, 12)
    loaded = study(tmp_path, GRID + FRONT)
    rows = rows_of(
        page_of(source_of(loaded, kxx_n_per_mm=123.456 * scale[::-1], range_x_um=34.5678 * scale))
    )
    assert rows["11"] == ["69.136", "123.46", "3.5000", "0.80000"] and rows["4"][2:] == [
        "2.5000",
        "0.60000",
    ]


def test_what_symmetry_makes_zero_is_zero_on_the_page(tmp_path):
    """Stiffnesses of 100 and 400 N/mm: 1.9e-10 is round-off of what couples them, 2.1e-10 is not."""
    ks = {"kxx_n_per_mm": np.full(12, 100.0), "kyy_n_per_mm": np.full(12, 400.0)}
    across = np.array([1.9e-10, *[2.1e-10] * 11])
    html = page_of(
        source_of(study(tmp_path, GRID + MAP.replace('"kxx', '"kxy')), kxy_n_per_mm=across, **ks)
    )
    rows = rows_of(html)
    assert (rows["least"][0], rows["most"][0]) == ("0", "2.1000×10⁻¹⁰")


def test_the_ends_of_a_map_are_below_it(tmp_path):
    """Stiffnesses from 50 to 61 in no order: 50 at the first design, 61 at the sixth."""
    source = source_of(study(tmp_path, GRID + MAP), kxx_n_per_mm=50.0 + 7 * np.arange(12) % 12)
    html = page_of(source, warnings=["nothing follows it"])
    assert (
        rows_of(html)["least"] == ["50.000", "2.0000", "0.40000"]
        and html.count("nothing follows it") == 1
    )
    assert rows_of(html)["most"] == ["61.000", "2.5000", "0.80000"]


HOSTILE = '</script><img src=x onerror=alert(1)> {{7*7}} $x^2$ "'


def test_hostile_names_stay_text(tmp_path):
    label = HOSTILE.replace('"', '\\"')
    text = GRID.replace('label = "other necks"', f'label = "{label}"').replace("A study", label)
    text += f'[[output]]\nname = "twice"\nexpression = "2 * kxx_n_per_mm"\nlabel = "{label}"\nunit = "<b>"\n'
    text += f'[[constraint]]\nvalue = "twice"\nleast = 0.0\nlabel = "{label}"\n'
    text += FRONT.replace("kxx_n_per_mm", "twice") + f'title = "{label}"\n'
    html = page_of(source_of(study(tmp_path, text), twice=np.linspace(2.0, 3.0, 12)))
    assert "<img" not in html and "<b>" not in html
    assert len(re.findall(r"<script\b", html)) == len(re.findall(r"</script>", html)) == 1
    assert f"<h1><bdi>{Markup.escape(HOSTILE)}" in html


def test_a_figure_that_cannot_be_drawn_says_why_and_the_others_are_there(tmp_path):
    bad = '[[output]]\nname = "root"\nexpression = "sqrt(kxx_n_per_mm - 1e9)"\n' + FRONT.replace(
        "kxx_n_per_mm", "root"
    )
    html = page_of(source_of(study(tmp_path, GRID + bad + MAP), root=np.full(12, np.nan)))
    assert "This figure is not drawn:" in html and "in size for 12 of 12" in html
    assert "least" in rows_of(html)


@pytest.mark.slow
def test_a_study_that_was_run_becomes_a_page(flexfem):
    Path("small.toml").write_text(GRID + FRONT)
    run_study("small.toml", "kept", workers=1)
    code, out, _ = flexfem("report", "small.toml", "--folder", "kept", "-o", "page.html", "--json")
    assert code == 0
    said = json.loads(out)
    html = Path("page.html").read_text()
    assert said["bytes"] == len(html.encode()) < 1e6 and said["written"] == "page.html"
    assert said["sections"][0] == "Stiffness xx against range in x at yield"
    assert "Settings of the study" in said["sections"]
    assert "flexfem report small.toml -o page.html --folder kept" in html


def test_factors_outputs_and_constraints_are_tables(tmp_path):
    """Of every kind of factor; a constraint without a label is named by its expression."""
    sobol = GRID.replace('"grid"', '"sobol"\ndesigns = 12\nseed = 1').replace(
        "points = 4\n", 'scale = "log"\n'
    )
    more = """
[[factor]]
key = "material.youngs_modulus_gpa"
distribution = "normal"
mean = 70.0
sd = 1.5
lower = 66.0
[[factor]]
key = "thickness_mm"
values = [8.0, 10.5]
[[output]]
name = "ratio"
expression = "kxx_n_per_mm / kyy_n_per_mm"
label = "Kxx over Kyy"
unit = "1"
[[constraint]]
value = "kxx_n_per_mm"
least = 12.5
most = 400
[[constraint]]
label = "<small>"
value = "envelope_mm"
most = 200
"""
    html = page_of(source_of(study(tmp_path, sobol.replace("points = 3\n", "") + more)))
    rows = rows_of(html)
    assert rows["radius of base hinges"] == [
        "hinges.base.radius_mm",
        "mm",
        "from 2 to 3.5, logarithmic",
    ]
    assert rows["other necks"] == [
        "hinges.elbow.neck_mm, hinges.platform.neck_mm",
        "mm",
        "from 0.4 to 0.8",
    ]
    normal = "normal, mean 70, standard deviation 1.5, at least 66"
    assert rows["Young&#39;s modulus"] == ["material.youngs_modulus_gpa", "GPa", normal]
    assert rows["thickness"] == ["thickness_mm", "mm", "8, 10.5"]
    assert rows["stiffness xx"] == ["kxx_n_per_mm", "N/mm", ""]
    assert rows["Kxx over Kyy"] == ["ratio", "1", "kxx_n_per_mm / kyy_n_per_mm"]
    assert rows["kxx_n_per_mm"] == ["kxx_n_per_mm", "at least 12.5 and at most 400"]
    assert rows["&lt;small&gt;"] == ["envelope_mm", "at most 200"]
