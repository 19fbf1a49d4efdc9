"""A study's page in a browser: designs are shown where they are pointed at, tapped, or reached by keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ..study.answered import study
from .test_study import FRONT, GRID, HOSTILE, MAP, data_of, page_of, source_of, targets_of

pytestmark = pytest.mark.slow
SIZES = {"laptop": (1366, 768), "phone": (390, 844)}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A page with a front and a map, and a hostile name of a factor."""
    folder = tmp_path_factory.mktemp("page")
    label = HOSTILE.replace('"', '\\"')
    text = (GRID + FRONT + MAP).replace("other necks", label)
    rising = np.linspace(1.0, 2.0, 12)
    html = page_of(source_of(study(folder, text), kxx_n_per_mm=40.0 * rising, range_x_um=100.0 / rising))
    path = folder / "study.html"
    path.write_text(html)
    return path, html


def opened(browser: Any, made: tuple[Path, str], size: str) -> tuple[Any, dict[str, Any]]:
    width, height = SIZES[size]
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == "phone"}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.get(made[0].as_uri())
    return browser.find_elements("css selector", ".pointed"), data_of(made[1])["designs"]


def shown(browser: Any, box: Any) -> tuple[str, str]:
    """Heading and drawn path of a panel."""
    path = box.find_element("css selector", ".metal").get_attribute("d")
    return box.find_element("css selector", "h3").text, path


@pytest.mark.parametrize("size", SIZES)
def test_the_page_is_whole_on_every_screen(browser, made, size):
    boxes, _ = opened(browser, made, size)
    assert len(boxes) == 2
    for box in boxes:
        for each in (".plate svg", ".targets", ".design", ".panel"):
            found = box.find_element("css selector", each)
            assert found.is_displayed() and found.size["width"] > 150 and found.size["height"] > 100, each
        chart, targets = (box.find_element("css selector", each).rect for each in (".plate svg", ".targets"))
        assert [targets[side] for side in ("x", "y", "width", "height")] == pytest.approx(
            [chart[side] for side in ("x", "y", "width", "height")], abs=1.0
        )
    wide = browser.execute_script("return [document.documentElement.scrollWidth, innerWidth]")
    assert wide[0] <= wide[1]
    assert browser.get_log("browser") == []
    assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0
    assert browser.execute_script("return document.querySelectorAll('img').length") == 0


def test_arrow_keys_go_from_design_to_design_and_say_it(browser, made):
    (front, chart), designs = opened(browser, made, "laptop")
    keys = pytest.importorskip("selenium.webdriver.common.keys").Keys
    order = [design for design, *_ in targets_of(made[1])[:12]]
    assert order == list(range(11, -1, -1))  # from the least range on
    first = front.find_element("css selector", "[role=option][tabindex='0']")
    first.send_keys(keys.ARROW_RIGHT)
    browser.switch_to.active_element.send_keys(keys.ARROW_RIGHT)
    assert shown(browser, front) == ("Design 9 (3 of 12)", designs["9"]["m"])
    said = front.find_element("css selector", ".said").get_attribute("textContent")
    assert said.startswith("Design 9: range in X at yield 55.000") and f"{HOSTILE} 0.40000 mm" in said
    assert browser.switch_to.active_element.get_attribute("aria-selected") == "true"
    browser.switch_to.active_element.send_keys(keys.END)
    assert shown(browser, front)[0] == "Design 0 (12 of 12)"
    start = chart.find_element("css selector", "[role=option][tabindex='0']")
    start.send_keys(keys.ARROW_UP)
    browser.switch_to.active_element.send_keys(keys.ARROW_RIGHT)
    assert shown(browser, chart) == ("Design 4 (5 of 12)", designs["4"]["m"])  # second radius, second neck


def test_a_design_is_shown_under_the_pointer_and_kept_when_it_is_tapped(browser, made):
    (front, _), designs = opened(browser, made, "phone")
    chains = pytest.importorskip("selenium.webdriver").ActionChains
    spots = front.find_elements("css selector", "[role=option]")
    browser.execute_script(
        "arguments[0].scrollIntoView({block: 'center'})", front.find_element("css selector", "figure")
    )
    chains(browser).move_to_element(spots[6]).perform()
    assert shown(browser, front) == ("Design 5 (7 of 12)", designs["5"]["m"])
    chains(browser).move_to_element(front.find_element("css selector", "figcaption")).perform()
    assert shown(browser, front)[0] == "Design 11 (1 of 12)"
    chains(browser).move_to_element_with_offset(spots[6], 3, -3).click().perform()
    chains(browser).move_to_element(front.find_element("css selector", "figcaption")).perform()
    assert shown(browser, front)[0] == "Design 5 (7 of 12)"
    front.find_element("css selector", "[data-step='1']").click()
    assert shown(browser, front)[0] == "Design 4 (8 of 12)"


def test_the_numbers_beside_the_drawing_are_those_of_the_design(browser, made):
    (front, _), designs = opened(browser, made, "laptop")
    rows = front.find_elements("css selector", ".panel tbody tr")
    texts = [row.get_attribute("textContent") for row in rows]
    assert texts[0] == "Factors" and texts[2] == f"{HOSTILE}0.80000 mm"
    values = [row.find_element("css selector", "td").get_attribute("textContent") for row in rows[1:3]]
    assert [value.split(" ")[0] for value in values] == designs["11"]["v"][:2] == ["3.5000", "0.80000"]


def test_without_scripts_the_table_of_the_front_and_what_a_place_tells_are_there(browser, made):
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        browser.get(made[0].as_uri())
        (front, _) = browser.find_elements("css selector", ".pointed")
        assert not front.find_element("css selector", ".panel").is_displayed()
        assert len(front.find_elements("css selector", ".targets circle title")) == 12
        caption = browser.find_element("xpath", "//caption[text()='Designs of the front']")
        assert caption.is_displayed()
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
