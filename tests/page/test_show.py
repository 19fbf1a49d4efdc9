"""Notebooks: a mechanism as a page inline, and results with their figure."""

from __future__ import annotations

import base64
import re
import sys
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlparse
from xml.etree import ElementTree

import pytest

import flexfem
from flexfem.refused import BadInput

from ..conftest import ROOT

PARALLELOGRAM = ROOT / "geometry/parallelogram.toml"


@pytest.fixture
def opened(monkeypatch):
    """Addresses that the browser is asked to open; the files are removed."""
    addresses = list[str]()
    monkeypatch.setattr("webbrowser.open", addresses.append)
    yield addresses
    for address in addresses:
        Path(urlparse(address).path).unlink()


@pytest.fixture
def notebook(monkeypatch):
    kernel = SimpleNamespace(kernel=object())
    running = SimpleNamespace(get_ipython=lambda: kernel)
    monkeypatch.setitem(sys.modules, "IPython", running)


def test_a_script_opens_the_page_in_the_browser(opened):
    shown = flexfem.show(PARALLELOGRAM)
    (address,) = opened
    assert Path(urlparse(address).path).read_text() == shown.html
    assert 'class="handle"' in shown.html
    assert "N/mm" in shown.html
    assert "29 of the numbers of this page are assumed." in shown.html


def test_a_notebook_shows_the_page_inline_and_opens_nothing(opened, notebook):
    shown = flexfem.show(flexfem.load(PARALLELOGRAM))
    frame = shown._repr_html_()
    assert opened == []
    content = re.fullmatch(r'<iframe [^>]*srcdoc="([^"]*)"></iframe>', frame)[1]
    assert unescape(content) == shown.html


def test_a_stage_is_shown_by_its_still_drawing(opened):
    html = flexfem.show(ROOT / "geometry/mobility6.toml").html
    assert 'class="handle"' not in html
    assert 'id="drawing"' in html


def test_what_is_no_mechanism_is_refused_before_anything_is_opened(opened, tmp_path):
    with pytest.raises(BadInput, match=r"none\.toml"):
        flexfem.show(tmp_path / "none.toml")
    assert opened == []


def test_a_result_with_a_figure_shows_it_below_its_tables():
    found = flexfem.reach(ROOT / "geometry/mobility6.toml", models="analytic")
    html = found._repr_html_()
    tables, image = html.split("<img ")
    assert "</table>" in tables
    content = base64.b64decode(re.search(r"data:image/svg\+xml;base64,([^\"]+)", image)[1])
    assert ElementTree.fromstring(content).tag.endswith("svg")
