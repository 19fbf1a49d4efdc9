"""Sections of stored results on a page: percentages, curves with their bands, provenance, escaped throughout."""

from __future__ import annotations

import re
from html import unescape

import pytest

from flexfem.page import results as of_results
from flexfem.page.answers import budget_section
from flexfem.plot.errors import error_figure
from flexfem.plot.told import error_spots
from flexfem.verify.result import write_record

HOSTILE = '"><img src=x onerror=alert(1)><script>{{7*7}}</script></svg>'
ERRORS = {"one": (0.031, 0.007, -0.002), HOSTILE: (0.12, 0.0, 0.004)}


def cells(page):
    return [unescape(re.sub("<[^>]+>", "", each)).strip() for each in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)]


def titles(page):
    return [unescape(each) for each in re.findall("<title>(.*?)</title>", page, re.S)]


def test_percentages_stand_with_their_bands(made):
    found = cells(of_results.errors_section([made.result(ERRORS, warnings=["beyond yield"])]).html)
    at = found.index("one")
    assert found[at - 2] == "X = 50 µm"
    assert found[at + 1 : at + 4] == [
        "3.100\xa0±\xa00.017\xa0%",
        "0.700\xa0±\xa00.027\xa0%",
        "−0.200\xa0±\xa00.037\xa0%",
    ]


def test_the_table_of_models_has_the_highest_stress_of_all_chains(made):
    """31.7 MPa at the elbow hinge of chain 2."""
    found = cells(of_results.models_section([made.result(ERRORS)]).html)
    at = found.index("one")
    assert found[at - 10 : at][-4:] == ["l3 (mm)", "triangles across a neck", "unknowns", "largest neck stress (MPa)"]
    assert found[at + 3 : at + 10] == ["1234567890ab", "6", "paros-weisbord", "21", "5", "54,321", "31.70"]


def test_a_spot_tells_command_error_and_band(made):
    """At 50 um an error of 3.1 % is 1.55 um; its band of 0.0173 points is 0.00865 um, which is 8.7 nm."""
    one = made.result(ERRORS)
    spots = error_spots(error_figure(one), one)
    assert len(spots) == 2 * 3 * 3
    found = [spot for spot in spots if spot.text.startswith("one") and spot.x > 0]
    assert found[0].text == "one\ncommanded X 50.00 µm\nerror in X 1.550 ± 0.0086 µm"
    assert (found[0].x, found[0].y) == pytest.approx((50.0, 1.55))


def test_hostile_labels_and_names_are_text(made):
    one = made.result(ERRORS, name=HOSTILE, case=HOSTILE, warnings=[HOSTILE], assumed=[HOSTILE])
    sections = (of_results.errors_section([one]), of_results.curves_section(one, 1), of_results.models_section([one]))
    page = "".join(each.html for each in (*sections, of_results.doubts_section([one])))
    assert "<img" not in page and "<script" not in page and page.count("<svg") == page.count("</svg>") == 1
    assert any(HOSTILE in each for each in titles(page)) and HOSTILE in cells(page)


def test_the_table_of_a_figure_has_its_numbers(made):
    """Errors of 3.1 % of 50 um in X, and of -0.2 % of it over the lever of 21 mm in theta: 1.55 um, -4.7619 urad."""
    found = cells(of_results.curves_section(made.result({"one": (0.031, 0.007, -0.002)}), 1).html)
    assert found[:4] == ["commanded X (µm)", "one: error in X (µm)", "one: error in Y (nm)", "one: error in θ (µrad)"]
    assert found[-4:] == ["50.000", "1.5500", "350.00", "−4.7619"]


def test_a_budget_tells_its_shares(made):
    page = budget_section(made.budget()).html
    share = made.budget().split["x"].shares[1]
    assert any(each.startswith(share.name) and "percentage points of X" in each for each in titles(page))
    found = cells(page)
    for name, *along in (
        ("share (percentage points)", "X", "Y", "θ"),
        ("formula", "+11.796", "+8.523", "+9.685"),
        ("what is left", "−0.308", "+0.092", "+0.051"),
        ("total", "12.091\xa0±\xa00.013\xa0%", "9.19\xa0±\xa00.13\xa0%", "9.48\xa0±\xa00.24\xa0%"),
    ):
        assert found[found.index(name) + 1 : found.index(name) + 4] == along


def test_results_of_a_file_make_a_page(made, tmp_path):
    from flexfem.page.report import report

    stored = write_record(made.result(ERRORS), tmp_path / "fig.json")
    found = report([stored], tmp_path / "page.html")
    assert found.sections == ["Errors", "A case $y$", "Models and meshes", "Where the numbers come from"]
    assert (tmp_path / "page.html").stat().st_size == found.bytes
