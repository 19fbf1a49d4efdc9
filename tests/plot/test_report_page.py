"""Sections of stored results on a page: percentages, curves with their bands, provenance, escaped throughout."""

from __future__ import annotations

import re
from html import unescape

import pytest

from flexfem.page import results as of_results
from flexfem.page.answers import budget_section
from flexfem.plot.curves import error_figure
from flexfem.plot.told import error_spots

HOSTILE = '"><img src=x onerror=alert(1)><script>{{7*7}}</script></svg>'
ERRORS = {"one": (0.031, 0.007, -0.002), HOSTILE: (0.12, 0.0, 0.004)}


def cells(page):
    return [unescape(re.sub("<[^>]+>", "", each)).strip() for each in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)]


def titles(page):
    return [unescape(each) for each in re.findall("<title>(.*?)</title>", page, re.S)]


def test_percentages_stand_with_their_bands(made):
    found = cells(of_results.curves_section(made.result(ERRORS), 1).html)
    at = len(found) - 1 - found[::-1].index("3.100 ± 0.017")
    assert found[at - 1 : at + 3] == ["one", "3.100 ± 0.017", "0.700 ± 0.027", "-0.200 ± 0.037"]


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
    page = "".join(each.html for each in (of_results.curves_section(one, 1), of_results.doubts_section([one])))
    assert "<img" not in page and "<script" not in page and page.count("<svg") == page.count("</svg>") == 1
    assert any(HOSTILE in each for each in titles(page)) and HOSTILE in cells(page)


def test_the_table_of_a_figure_has_its_numbers(made):
    """Errors of 3.1 % of 50 um in X, and of -0.2 % of it over the lever of 21 mm in theta: 1.55 um, -4.7619 urad."""
    found = cells(of_results.curves_section(made.result({"one": (0.031, 0.007, -0.002)}), 1).html)
    assert found[:4] == ["commanded X (µm)", "one: error in X (µm)", "one: error in Y (nm)", "one: error in θ (µrad)"]
    assert found[found.index("50.000") : found.index("50.000") + 4] == ["50.000", "1.5500", "350.00", "−4.7619"]


def test_a_budget_tells_its_shares(made):
    page = budget_section(made.budget()).html
    assert any(each.startswith("hinge formula") and "percentage points of X" in each for each in titles(page))
    found = cells(page)
    assert found[found.index("hinge formula") + 1 :][:3] == ["11.796", "8.523", "9.685"]
    assert found[found.index("total") + 1 :][:3] == ["12.091 ± 0.013", "9.19 ± 0.13", "9.48 ± 0.24"]


def test_results_of_a_file_make_a_page(made, tmp_path):
    from flexfem.page.report import report

    stored = made.result(ERRORS).write(tmp_path / "fig.json")
    found = report([stored], tmp_path / "page.html")
    assert found.sections == ["A case $y$", "Where the numbers come from"]
    assert (tmp_path / "page.html").stat().st_size == found.bytes
