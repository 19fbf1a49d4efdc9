"""What a page is made of: everything but markup is escaped, figures clash with nothing and load nothing."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest
from markupsafe import Markup

from flexfem.page.assemble import Page, html_of, policy
from flexfem.page.inline import inline_svg
from flexfem.page.section import Cell, PageFigure, PageSection, facts, figure_html, json_data, notes, table
from flexfem.plot.style import house_style, new_figure
from flexfem.plot.vector import Spot

HOSTILE = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</svg><b>",
    "{{7*7}}",
    "]]>",
    "&lt;",
    "a\x01b",
    "ش‮x",
    "n" * 5000,
)


class Elements(HTMLParser):
    """Names of elements, attributes, and the text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.names.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.text += data


def drawn(text: str, spot: str = "") -> Markup:
    with house_style():
        figure = new_figure(4.0, 3.0)
        ax = figure.subplots()
        ax.plot([0.0, 2.0], [1.0, 3.0], clip_on=True)
        ax.set_title(text)
    return inline_svg(figure, "", [Spot(ax, 1.0, 2.0, spot)] if spot else [])


def page(title: str, *sections: PageSection) -> str:
    return html_of(Page(title, title, title, sections, title, "2026-01-02", {"flexfem": title}))


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_not_markup_is_text_wherever_it_stands(name):
    plain = page("name", section("name"))
    hostile = page(name, section(name))
    assert Elements(hostile).names == Elements(plain).names
    shown = name.replace("\x01", "\ufffd")
    assert shown in Elements(hostile).text and not any(key.startswith("on") for key, _ in Elements(hostile).attributes)
    assert "49" not in Elements(page("{{7*7}}", section("{{7*7}}"))).text.replace("1.49", "")


def section(name: str) -> PageSection:
    figure = PageFigure(
        drawn(name, name), name, name, table([name, "b"], [[name, Cell("1", name)], ["c", "2"]], caption=name)
    )
    return PageSection(
        "s", name, figure_html(figure, "f") + facts([(name, name)]) + notes([name]) + json_data("d", name)
    )


def test_two_figures_share_no_id_and_refer_to_their_own():
    text = page("t", PageSection("a", "A", drawn("one") + drawn("two")))
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids)) and len(ids) > 10
    found = re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', text)
    assert {one or other for one, other in found} <= set(ids)


def test_a_figure_is_the_same_every_time_and_its_text_is_text():
    assert drawn("stiffness") == drawn("stiffness")
    assert "stiffness</text>" in drawn("stiffness") and "<style" not in drawn("x")


def test_a_spot_is_where_its_point_is():
    """Axes of 4 by 3 inches by matplotlib's margins: 0.125 to 0.9 across and 0.11 to 0.88 up; 288 by 216 points."""
    box = re.search(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"><title>7', drawn("x", "7"))
    assert box is not None
    x, y, width, height = map(float, box.groups())
    assert x + width / 2 == pytest.approx(288 * (0.125 + 0.9) / 2, abs=0.01)
    assert y + height / 2 == pytest.approx(216 * (1 - (0.11 + 0.88) / 2), abs=0.01)


def test_nothing_is_loaded_and_only_its_own_scripts_run():
    text = page(
        "t", PageSection("a", "A", drawn("one"), script="let x = 1;"), PageSection("b", "B", Markup("y"), "let x = 1;")
    )
    assert "http:" not in text and "https:" not in text and "//" not in re.sub(r"// .*", "", text.split("</head>")[1])
    assert text.count("let x = 1;") == 1
    rule = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert rule is not None and "default-src &#39;none&#39;" in rule[1] and "unsafe-eval" not in rule[1]
    assert policy(["let x = 1;"]).split("script-src ")[1].startswith("'sha256-qtc3jf64UXA5")


def test_numbers_stand_in_the_last_columns_and_one_row_is_not_sorted():
    found = table(["a", "b", "c"], [["x", "y", "1"], ["z", "w", "2"]], numbers=1)
    assert found.count('class="number"') == 3 and 'class="sortable"' in found
    assert 'class="sortable"' not in table(["a"], [["x"]])
