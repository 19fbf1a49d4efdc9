"""The page in a real browser: nothing is requested, nothing complains, figures are seen, tables sort by keyboard."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexfem.page.report import report

ROOT = Path(__file__).parents[2]
HOSTILE = "<script>document.title='run'</script><img src=x onerror=\"document.title='run'\">"
pytestmark = pytest.mark.slow
SIZES = ((1366, 768), (390, 844))


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> str:
    """A stage with a hostile name, with all that is drawn by default."""
    folder = tmp_path_factory.mktemp("browser")
    text = (ROOT / "geometry/mobility6.toml").read_text()
    (folder / "stage.toml").write_text(text.replace('name = "mobility six, reference"', f"name = '''{HOSTILE}'''", 1))
    report(folder / "stage.toml", folder / "page.html")
    return (folder / "page.html").as_uri()


def opened(browser, page, width, height, scheme="light"):
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    browser.get(page)
    return browser


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_every_figure_is_seen_and_nothing_is_wider_than_the_screen(browser, page, width, height):
    opened(browser, page, width, height)
    assert browser.get_log("browser") == []
    boxes = browser.execute_script(
        "return [...document.querySelectorAll('svg.drawn')].map(s => {const b = s.getBoundingClientRect();"
        "return [b.width, b.height, s.checkVisibility()]})"
    )
    assert len(boxes) == 4 and all(wide > 200 and high > 150 and visible for wide, high, visible in boxes)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width


def test_nothing_is_requested_but_the_page(browser, page):
    opened(browser, page, *SIZES[0])
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith("data:")] == []


def test_a_hostile_name_stays_text(browser, page):
    opened(browser, page, *SIZES[0])
    assert browser.title == browser.find_element("css selector", "h1").text == HOSTILE
    assert browser.find_elements("css selector", "img, h1 *:not(bdi)") == []


def test_a_table_sorts_by_keyboard(browser, page):
    from selenium.webdriver.common.keys import Keys

    opened(browser, page, *SIZES[0])
    table = "#drawing table.sortable"
    browser.execute_script("document.querySelector('#drawing details').open = true")
    button = browser.find_elements("css selector", f"{table} thead button")[3]

    def column() -> list[float]:
        return [float(cell.text) for cell in browser.find_elements("css selector", f"{table} tbody td:nth-child(4)")]

    before = column()
    assert before != sorted(before) and len(before) == 9
    browser.execute_script("arguments[0].focus()", button)
    button.send_keys(Keys.ENTER)
    assert column() == sorted(before)
    assert button.find_element("xpath", "..").get_attribute("aria-sort") == "ascending"
    button.send_keys(Keys.SPACE)
    assert column() == sorted(before, reverse=True) and column()[-1] < 0
    assert browser.find_element("id", "told").get_attribute("textContent").endswith("descending")


def test_values_are_read_with_pointer_and_keyboard(browser, page):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    opened(browser, page, *SIZES[0])
    tip = browser.find_element("id", "tip")
    assert not tip.is_displayed()
    spot = browser.find_element("css selector", "#drawing .spots rect")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", spot)
    ActionChains(browser).move_to_element(spot).perform()
    assert tip.is_displayed() and tip.text.startswith("base hinge, chain 1\nnotch radius 4 mm, neck 0.5 mm")
    plate = browser.find_element("css selector", "#drawing .plate")
    browser.execute_script("arguments[0].focus()", plate)
    plate.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    told = browser.find_element("id", "told").get_attribute("textContent")
    assert told.startswith("elbow hinge, chain 1\nnotch radius 1.5 mm") and tip.text == told
    plate.send_keys(Keys.ESCAPE)
    assert not tip.is_displayed()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read_in_either_scheme(browser, page, scheme):
    """Contrast by WCAG 2.1 of 4.5 at least, of text on its ground."""
    opened(browser, page, *SIZES[0], scheme)
    read = "const s = getComputedStyle(document.querySelector(arguments[0])); return [s.color, s.backgroundColor]"
    ground = browser.execute_script(read, "body")[1]
    for place in ("body", "figcaption", "nav a", ".subtitle", ".tag"):
        assert contrast(browser.execute_script(read, place)[0], ground) >= 4.5, place
    assert contrast(*browser.execute_script(read, ".doubts")) >= 4.5


def contrast(one: str, other: str) -> float:
    low, high = sorted(map(luminance, (one, other)))
    return (high + 0.05) / (low + 0.05)


def luminance(colour: str) -> float:
    """Of `rgb(r, g, b)`, relative, as WCAG defines it."""
    shares = [int(part) / 255 for part in colour.partition("(")[2].rstrip(")").split(",")[:3]]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return sum(weight * share for weight, share in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
