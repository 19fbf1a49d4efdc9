"""The live page in a browser: a slider, a fault in the file, its mending, and saving."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

import flexfem

from ..conftest import ROOT

pytest.importorskip("uvicorn", reason="needs flexfem[live]")

PARALLELOGRAM = ROOT / "geometry/parallelogram.toml"
SECONDS = 30.0  # until something is seen; it takes less than one, unless the machine is busy


@pytest.fixture
def file(request, tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text(Path(getattr(request, "param", PARALLELOGRAM)).read_text())
    return copy


@pytest.fixture
def served(file):
    """Address of the page of the file, which the command serves."""
    command = [sys.executable, "-m", "flexfem", "live", str(file), "--no-browser"]
    server = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    with server:
        yield server.stdout.readline().split()[0]
        server.terminate()


def until(holds, what):
    """Return the first value of a function that is true."""
    end = time.monotonic() + SECONDS
    while not (found := holds()):
        assert time.monotonic() < end, what
        time.sleep(0.05)
    return found


class LiveBrowser:
    """What a reader sees of the page."""

    def __init__(self, browser, address) -> None:
        self.browser = browser
        browser.get(address)
        until(lambda: self.texts("#rows tr"), "no numbers")

    def texts(self, selector):
        script = "return [...document.querySelectorAll(arguments[0])].map(e => e.innerText)"
        return self.browser.execute_script(script, selector)

    def drag(self, path):
        """Drag the slider of a number to the right, and wait until it is answered."""
        from selenium.webdriver import ActionChains

        slider = self.one(f"input[type=range][data-path='{path}']")
        ActionChains(self.browser).drag_and_drop_by_offset(slider, 40, 0).perform()
        until(lambda: self.browser.execute_script("return !waiting && !pending"), "no answer")
        until(lambda: "finite elements" in self.texts("#elements")[0], "nothing follows")

    def stiffness(self):
        return float(self.texts("#rows td")[0].split()[0])

    def one(self, selector):
        return self.browser.find_element("css selector", selector)

    @property
    def fault(self):
        return "\n".join(self.texts("#fault:not([hidden])"))

    @property
    def is_stale(self):
        return bool(self.texts("#rows.stale"))


@pytest.mark.slow
def test_a_slider_answers_a_fault_is_shown_at_its_line_and_numbers_are_saved(
    file: Path, served, browser
):
    page = LiveBrowser(browser, served)
    before = page.stiffness()
    assert not page.one("#save").is_enabled()
    drawn = page.one(".handled .hinge").get_attribute("d")
    page.drag("parameters.neck_mm")
    assert page.stiffness() > 1.05 * before  # of a thicker neck
    assert page.one(".handled .hinge").get_attribute("d") != drawn

    text = file.read_text()
    broken = text.replace('length_mm = "length"', 'length_mm = "lenth"')
    line = 1 + broken.splitlines().index('length_mm = "lenth"')
    shown = page.stiffness()
    file.write_text(broken)
    until(lambda: "lenth" in page.fault, "no fault")
    assert f"line {line}" in page.fault
    assert page.texts("#fault .at")[0].split() == [f"{line}", "length_mm", "=", '"lenth"']
    assert page.is_stale
    assert page.stiffness() == shown

    file.write_text(text)
    until(lambda: not page.fault, "the fault stays")
    assert not page.is_stale
    assert page.stiffness() == shown  # the moved slider stays moved
    page.one("#reset").click()
    until(lambda: page.stiffness() == pytest.approx(before), "not back at the file")

    page.drag("parameters.neck_mm")
    assert page.stiffness() > 1.05 * before
    assert page.one("#save").is_enabled()
    page.one("#save").click()
    until(lambda: "saved: parameters.neck_mm" in "".join(page.texts("#saved")), "not saved")
    assert flexfem.load(file).parameters["neck_mm"] > 0.5
    lines = zip(text.splitlines(), file.read_text().splitlines(), strict=True)
    assert len([1 for old, new in lines if old != new]) == 1
    assert browser.get_log("browser") == []


@pytest.mark.slow
@pytest.mark.parametrize("file", [ROOT / "geometry/mobility6.toml"], indirect=True)
def test_the_plain_drawing_of_a_stage_follows_a_slider(file: Path, served, browser):
    page = LiveBrowser(browser, served)
    drawn = "return document.getElementById('drawing').innerHTML"
    before = browser.execute_script(drawn)
    assert 'class="hinge"' in before
    page.drag("chain.link_lengths_mm[0]")
    assert browser.execute_script(drawn) != before
