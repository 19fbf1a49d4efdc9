"""The drawing that a hand moves, on a page: what it contains, and what it does in a browser."""

from __future__ import annotations

import json
import re

import pytest
from markupsafe import Markup

import flexfem
from flexfem.page.handle import handled_drawing
from flexfem.page.report import report
from flexfem.page.section import PageSection, html_of

from ..conftest import ROOT

PARALLELOGRAM = ROOT / "geometry/parallelogram.toml"
ABOUT = {"title": "t", "subtitle": "", "assumptions": "", "command": "", "made": "", "versions": {}}
HOSTILE = "</script><b>&amp;"


def numbers_in(html):
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', html)[1])


def test_a_page_allows_the_script_of_the_drawing_only_where_it_has_one():
    moved = handled_drawing(flexfem.load(PARALLELOGRAM))
    for html, scripts in ((moved, 2), (Markup("<p>none</p>"), 1)):
        page = html_of([PageSection("s", "s", html)], **ABOUT)
        assert page.count("sha256-") == scripts
        assert page.count("<script>") == scripts
        assert ("class Handle" in page) == (scripts == 2)


def test_no_name_in_a_file_ends_the_numbers_of_the_drawing(tmp_path):
    text = PARALLELOGRAM.read_text().replace('parts = ["leaf"]', f'parts = ["{HOSTILE}"]')
    (tmp_path / "hostile.toml").write_text(text.replace('name = "leaf"', f'name = "{HOSTILE}"'))
    html = handled_drawing(flexfem.load(tmp_path / "hostile.toml"))
    assert numbers_in(html)["hinges"][0]["name"] == HOSTILE
    assert "<b>" not in html


def test_a_stage_with_a_model_of_its_own_has_no_drawing_to_move():
    assert handled_drawing(flexfem.load(ROOT / "geometry/mobility6.toml")) == ""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("handle") / "page.html"
    report(PARALLELOGRAM, path, sections=["analytic"])
    return path


@pytest.mark.slow
def test_a_hand_moves_the_output_to_the_end_of_its_range(written, browser):
    """By 9.6 mm along -x; the drawing of 85 mm is to scale, so that a pull of 300 px is further."""
    from selenium.webdriver import ActionChains

    low = numbers_in(written.read_text())["range"][0]["low"]
    browser.set_window_size(1000, 900)
    browser.get(written.as_uri())
    output = browser.find_element("css selector", ".handled .output")
    said = browser.find_element("css selector", ".handled-text")
    hinge = browser.find_element("css selector", ".handled .hinge")
    at_rest = hinge.get_attribute("d")
    assert "Drag the output" in said.text
    hand = ActionChains(browser)
    hand.click_and_hold(output).move_by_offset(-10, 0).perform()
    part = float(re.search(r"output x (-[\d.]+) mm", said.text)[1])
    assert low < part < 0
    assert "The range ends here" not in said.text
    assert hinge.get_attribute("d") != at_rest
    hand.move_by_offset(-290, 0).release().perform()
    assert float(re.search(r"output x (-[\d.]+) mm", said.text)[1]) == pytest.approx(low, rel=1e-3)
    assert said.text.endswith("The range ends here: yield of a hinge, at finite displacement.")
    assert browser.get_log("browser") == []


@pytest.mark.slow
def test_a_hand_presses_the_actuator_and_plays_a_mode(written, browser):
    browser.get(written.as_uri())
    said = browser.find_element("css selector", ".handled-text")
    body = browser.find_element("css selector", ".handled .body")
    slider = browser.find_element("css selector", ".controls input")
    full = "arguments[0].value = arguments[0].max; arguments[0].dispatchEvent(new Event('input'))"
    browser.execute_script(full, slider)
    assert "drive opened by 17.4 µm" in said.text
    pressed = body.get_attribute("transform")
    *modes, release = browser.find_elements("css selector", ".controls button")
    assert len(modes) == 3
    modes[0].click()
    assert "Natural mode 1 at 51.7" in said.text
    assert body.get_attribute("transform") != pressed
    release.click()
    assert "Drag the output" in said.text
    assert browser.get_log("browser") == []


@pytest.mark.slow
def test_a_slider_moves_the_output_along_the_curve_of_large_displacements(tmp_path, browser):
    """The output of a parallelogram sinks by 3/5 x^2 / length: 3.0 µm at 0.5 mm."""
    mechanism = flexfem.load(PARALLELOGRAM)
    drawing = handled_drawing(mechanism, None, flexfem.large(mechanism, models="analytic"))
    path = tmp_path / "page.html"
    path.write_text(html_of([PageSection("s", "s", drawing)], **ABOUT))
    browser.get(path.as_uri())
    slider = browser.find_element("xpath", "//label[contains(., 'nonlinear curve')]/input")
    end = "arguments[0].value = arguments[0].max; arguments[0].dispatchEvent(new Event('input'))"
    browser.execute_script(end, slider)
    said = browser.find_element("css selector", ".handled-text").text
    x, y = re.search(r"by beams: output x ([\d.]+) mm, y (-[\d.]+) µm", said).groups()
    assert float(x) == pytest.approx(0.5)
    assert float(y) == pytest.approx(-1e3 * 0.6 * 0.5**2 / 50.0, rel=0.02)
    output = browser.find_element("css selector", ".handled .output")
    assert float(output.get_attribute("cx")) > 0.4
    assert browser.get_log("browser") == []


@pytest.mark.slow
def test_on_paper_and_without_scripts_the_drawing_that_is_still_remains(written, browser):
    shown = "return getComputedStyle(document.querySelector('.by-hand')).display"
    still = "return getComputedStyle(document.querySelector('#drawing svg')).display"
    browser.get(written.as_uri())
    assert browser.execute_script(shown) != "none"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert browser.execute_script(shown) == "none"
    assert browser.execute_script(still) == "block"
    opening = "return getComputedStyle(document.querySelector('.beside')).display"
    assert browser.execute_script(opening) == "block"  # a page may end within it
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "screen"})
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    browser.get(written.as_uri())
    assert browser.execute_script(shown) == "none"
