"""Pages: numbers are those of the records, assumptions come first, all text is escaped, bad input
is refused.
"""

from __future__ import annotations

import re
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from markupsafe import Markup
from matplotlib.figure import Figure

import flexfem
from flexfem.page import stored as page_of_files
from flexfem.page.key import rows_at_rest
from flexfem.page.report import SECTIONS, STANDARD, command_line, report
from flexfem.page.section import (
    PageSection,
    dark_of,
    facts,
    html_of,
    inline_svg,
    moving_svg,
    notes,
    places_on,
    shown_figure,
    table,
)
from flexfem.paper.commanding import driven_elements
from flexfem.paper.page import driven_field
from flexfem.paper.stiffness import StageStiffness
from flexfem.plot.style import house_style
from flexfem.questions.stiffness import Stiffness
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, ELEMENTS, About, TextTable
from flexfem.units import DIRECTIONS

from ..conftest import ROOT
from ..design.recorded import recorded
from ..plot.conftest import result

STAGE = ROOT / "geometry/mobility6.toml"
OF_EXPANSION = r"(?m)^expansion_um_per_m_k = 23.*$|^.material.expansion_um_per_m_k.*$"
HOSTILE = '<script>alert(1)</script>"><img src=x onerror=alert(1)></svg>{{7*7}}'


def cells(page: str) -> list[str]:
    return [
        unescape(re.sub("<[^>]+>", "", each)).strip()
        for each in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)
    ]


def headings(page: str) -> list[str]:
    return [unescape(each) for each in re.findall(r"<h2[^>]*>(.*?)</h2>", page)]


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """A page of the reference stage under a hostile name, without finite elements."""
    folder = tmp_path_factory.mktemp("page")
    text = STAGE.read_text().replace('name = "mobility six, reference"', f"name = '{HOSTILE}'", 1)
    (folder / "hostile.toml").write_text(text)
    found = report(folder / "hostile.toml", folder / "out.html", sections=["analytic", "drive"])
    assert found.bytes == (folder / "out.html").stat().st_size < 5e6
    return folder / "out.html"


def test_a_page_of_a_hostile_name_is_text_and_loads_nothing(written):
    page = written.read_text()
    assert headings(page) == ["The stage", "Analytic model", "Drive", "Sources of the numbers"]
    assert re.findall(r'<li><a href="#([^"]+)"', page) == re.findall(r'<h2 id="([^"]+)"', page)
    assert "flexfem report " in page.split("<footer")[1]
    assert (
        "<img" not in page
        and page.count("<script") == 1
        and "49" not in re.findall("<h1>.*</h1>", page)[0]
    )
    assert page.count("</svg>") == page.count("<svg") == 2 and HOSTILE in unescape(page)
    assert not re.search(r"(?<!xmlns=\")(?<!xlink=\")https?:|<[^>]*\bsrc=|@import|url\((?!#)", page)


def test_numbers_of_the_page_are_those_of_the_records(written):
    """41.903 N/mm and 45453 N mm/rad are what `stiffness` prints; hinges and drive as the file has
    them.
    """
    page = written.read_text()
    found = [cell.replace("\N{NO-BREAK SPACE}", " ") for cell in cells(page)]
    assert any(cell.startswith("41.90") for cell in found) and any(
        cell.startswith("4545") for cell in found
    )
    rows = [cells(row) for row in re.findall(r"<tr.*?</tr>", page, re.DOTALL)]
    hinges = {
        (int(row[0]), row[1]): row[-3:-1] for row in rows if len(row) == 7 and row[0].isdigit()
    }
    assert (
        len(hinges) == 9
        and hinges[2, "base"] == ["4", "0.5"]
        and hinges[3, "elbow"] == ["1.5", "0.5"]
    )
    reach = flexfem.reach(flexfem.load(STAGE), models="analytic")
    assert f"{float(reach.circle):.5g} µm" in found


def test_assumed_numbers_are_counted_first_and_listed(written):
    page = written.read_text()
    stage = flexfem.load(written.with_name("hostile.toml"))
    keys = {*stage.assumed, *stage.drive_assumptions.assumed}
    assert f"{len(keys)} of the numbers of this page are assumed" in page.split("<nav")[0]
    listed = cells(page.split("Sources of the numbers</h2>")[1])
    assert {key for key in keys if listed[listed.index(key) + 1] == "assumed"} == keys and len(
        keys
    ) > 20


def test_no_number_whose_source_says_assumed_is_called_stated(tmp_path):
    """Sources of whole tables, and expansion, which no section of this page takes."""
    flexfem.new_stage(tmp_path / "mine.toml")
    text = (tmp_path / "mine.toml").read_text().split("[[actuator]]")[0]
    sources = {
        "thickness_mm": "assumed",
        "material": "assumed: a guess",
        "chain": "Drawing 7",
        "frame": "Assumed",
    }
    lines = "".join(f'"{key}" = "{source}"\n' for key, source in sources.items())
    (tmp_path / "mine.toml").write_text(
        f'{text}\n[provenance]\n{lines}"hinges" = "measured"\n"platform" = "measured"'
    )
    report(tmp_path / "mine.toml", tmp_path / "page.html", sections=["analytic"])
    found = cells((tmp_path / "page.html").read_text().split("Sources of the numbers</h2>")[1])
    rows = {
        key: (kind, source)
        for key, kind, source in zip(*(found[k::3] for k in range(3)), strict=True)
    }
    assert rows["frame.expansion_um_per_m_k"] == ("assumed", "Assumed")
    assert (
        rows["chain.link_width_mm"] == ("stated", "Drawing 7")
        and "chain" not in rows
        and "material" not in rows
    )
    assert not any(
        kind == "stated" and source.lower().startswith("assumed") for kind, source in rows.values()
    )


def test_a_page_of_stored_results_has_their_tables_curves_and_assumptions(tmp_path):
    one = result(
        {"one": (0.05, 0.01, 0.02), "two": (0.2, 0.1, 0.02)}, assumed=["chain.link_width_mm"]
    )
    found = report(one.write(tmp_path / "fig.json"), tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert found.sections == ["A case $y$", "Sources of the numbers"] and found.assumed == [
        "chain.link_width_mm"
    ]
    shown = [cell.replace("\N{NO-BREAK SPACE}", " ") for cell in cells(page)]
    assert {"5.000 ± 0.017", "20.00 ± 0.12", "chain.link_width_mm"} <= {
        cell.removesuffix(" %") for cell in shown
    }
    told = re.findall(r"<rect [^>]*><title>([^<]*)</title>", page)
    assert (
        "one\ncommanded x (µm): 50.00\nPositioning error, % of the commanded motion: 5.000" in told
    )


def test_the_line_that_made_a_page_is_quoted():
    assert (
        command_line([Path("a b.toml")], Path("$x.html"), STANDARD)
        == "flexfem report 'a b.toml' -o '$x.html'"
    )


@pytest.mark.parametrize(
    ("files", "output", "sections", "said"),
    [
        ([STAGE], "page.pdf", ["analytic"], "ends in .html"),
        ([STAGE], "page.html", ["magic"], "sections 'magic', expected some of analytic, elements"),
        ([STAGE], "page.html", ["life"], "without an amplitude"),
        (
            [STAGE, ROOT / "geometry/mobility3.toml"],
            "page.html",
            ["analytic"],
            "expected one stage",
        ),
        ([STAGE], "none/page.html", ["analytic"], "no folder .*none, expected an existing folder"),
        (
            [Path("/dev/zero.json")],
            "page.html",
            ["analytic"],
            "expected none: they apply to a stage",
        ),
        ([], "page.html", ["analytic"], "no file"),
        (
            [ROOT / "cases/study-trust.toml"],
            "page.html",
            ["modes"],
            "they apply to a stage, and this is a study",
        ),
        ([ROOT / "cases/fig5.toml"], "page.html", STANDARD, "this is a case file"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, files, output, sections, said):
    with pytest.raises(BadInput, match=said) as refused:
        report(files, tmp_path / output, sections=sections)
    assert "\n" not in str(refused.value) and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("without", "section", "amplitude", "said"),
    [
        (
            "^$",
            "life",
            (0.1, 0.0, 0.0),
            r"toml, line \d+: material.fatigue_strength_coefficient_mpa is missing",
        ),
        ("^$", "life", (0.0, 0.0, 0.0), "amplitude: expected a motion"),
        (OF_EXPANSION, "drift", None, r"toml, line \d+: material.expansion_um_per_m_k"),
    ],
)
def test_a_section_that_cannot_be_is_refused_before_any_is_computed(
    tmp_path, without, section, amplitude, said
):
    (tmp_path / "stage.toml").write_text(re.sub(without, "", STAGE.read_text()))
    with pytest.raises(BadInput, match=said):
        report(
            tmp_path / "stage.toml",
            tmp_path / "page.html",
            sections=["analytic", section],
            amplitude=amplitude,
            progress=pytest.fail,
        )
    assert [path.name for path in tmp_path.iterdir()] == ["stage.toml"]


def test_a_page_never_replaces_what_it_is_of(tmp_path):
    stage = tmp_path / "stage.html"
    stage.write_text(STAGE.read_text())
    (tmp_path / "other.html").symlink_to(stage)
    for output in ("stage.html", "other.html"):
        with pytest.raises(
            BadInput, match=r"html.*: .*is an input of this command, expected another file"
        ):
            report(stage, tmp_path / output, sections=["analytic"])
    assert stage.read_text() == STAGE.read_text()


NAN = b'{"result": "verification", "digest": "", "x": NaN}'


@pytest.mark.parametrize("content", [b"", 100_000 * b"[", b"\xff\x00", NAN])
def test_stored_json_that_is_no_answer_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "two\nlines.json"
    path.write_bytes(content)
    with pytest.raises(BadInput, match="expected a result that flexfem stored as JSON") as refused:
        report(path, tmp_path / "page.html")
    assert "\n" not in str(refused.value) and list(tmp_path.iterdir()) == [path]


def test_a_study_that_is_not_done_has_no_page(tmp_path):
    with pytest.raises(
        BadInput, match=r"400 of 400 designs are unfinished in .*Run `flexfem study run`$"
    ):
        report(ROOT / "cases/study-trust.toml", tmp_path / "page.html", folder=tmp_path / "none")
    assert not (tmp_path / "page.html").exists()


@pytest.mark.slow
def test_a_page_of_everything_is_small_and_complete(tmp_path):
    flexfem.load(STAGE).replace(material="al-2024-t4").save(
        tmp_path / "stage.toml"
    )  # has fatigue constants
    asked = {"sections": ["all"], "amplitude": [0.2, 0.0, 0.0]}
    found = flexfem.report(tmp_path / "stage.toml", tmp_path / "all.html", **asked)
    assert found.bytes < 5e6 and len(found.sections) == len(SECTIONS) + 2
    page = (tmp_path / "all.html").read_text()
    assert page.count("<figure") >= 8 and page.count("<h2") == len(found.sections)


def figure_of(text: str) -> Figure:
    with house_style():
        figure = Figure(figsize=(4.0, 3.0))
        figure.subplots(subplot_kw={"title": text}).plot([0.0, 2.0], [1.0, 3.0], "o-", label=text)
    return figure


class Elements(HTMLParser):
    """Names of elements, attributes, and the text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names = []
        self.attributes = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.names.append(tag)
        self.attributes += [key for key, _ in attrs]

    def handle_data(self, data):
        self.text += data


@pytest.mark.parametrize("name", [HOSTILE, "</svg><b>", "]]>", "&lt;", "a\x01b", "n" * 5000])
def test_what_is_not_markup_is_text_wherever_it_stands(name):
    def page(said: str) -> Elements:
        data = table(TextTable([said, "b"], [[said, said]], 1, said))
        html = (
            shown_figure("f", lambda: figure_of(said), said, data)
            + facts([(said, said)])
            + notes([said])
        )
        about = {
            "subtitle": said,
            "assumptions": said,
            "command": said,
            "made": "2026",
            "versions": {"a": said},
        }
        return Elements(html_of([PageSection("s", said, html)], title=said, **about))

    assert page(name).names == page("plain").names and not any(
        key.startswith("on") for key in page(name).attributes
    )
    assert name.replace("\x01", "\ufffd") in page(name).text


def test_two_figures_share_no_id_and_refer_to_their_own():
    text = inline_svg(figure_of("one"), "f") + inline_svg(figure_of("two"), "g")
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert (
        len(ids) == len(set(ids))
        and len(ids) > 10
        and "<style" not in text
        and "two</text>" in text
    )
    found = re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', text)
    assert found and {one or other for one, other in found} <= set(ids)


def test_a_point_tells_its_values_where_it_is():
    """Axes of 4 by 3 inches by matplotlib's margins: 0.125 to 0.9 across and 0.11 to 0.88 up; 288
    by 216 points.
    """
    figure = Figure(figsize=(4.0, 3.0))
    ax = figure.subplots()
    ax.set(xlim=(0.0, 2.0), ylim=(1.0, 3.0))
    found = places_on(ax, np.array([[1.0, 2.0], [5.0, 2.0]]))
    assert found[0] == pytest.approx(
        [288 * (0.125 + 0.9) / 2, 216 * (1 - (0.11 + 0.88) / 2)], abs=0.01
    )
    assert np.isnan(found[1]).all()
    assert "<title>one\n: 2.000\n: 3.000</title>" in inline_svg(figure_of("one"), "f")


@pytest.mark.slow
def test_in_a_browser_nothing_complains_and_figures_are_seen_and_tables_sort(written, browser):
    browser.set_window_size(500, 844)
    browser.get(written.as_uri())
    assert browser.get_log("browser") == []
    boxes = browser.execute_script(
        "return [...document.querySelectorAll('svg.drawn')].map(s => {const b = "
        "s.getBoundingClientRect();return [b.width, b.height]})"
    )
    assert len(boxes) == 2 and all(wide > 200 and high > 150 for wide, high in boxes)
    assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    column = (
        "return [...document.querySelectorAll('#drawing tbody td:nth-child(5)')].map(c => "
        "Number(c.textContent))"
    )
    button = "document.querySelectorAll('#drawing thead button')[4].click();"
    browser.execute_script(button)
    assert browser.execute_script(column) == sorted(browser.execute_script(column))


def test_a_page_has_every_table_of_a_design_and_its_figures(monkeypatch, tmp_path):
    shown = []
    drawing = {"shown_figure": lambda anchor, draw, about: shown.append(draw.func) or Markup("")}
    for name, made in (
        drawing | {"is_design": lambda path: True, "read_design": lambda path: recorded()}
    ).items():
        monkeypatch.setattr(page_of_files, name, made)
    report(tmp_path / "one.json", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert shown == [draw for _, draw in page_of_files.DESIGN_SECTIONS.values() if draw]
    found = cells(page)
    for one in recorded().tables(plain=False):
        assert {cell for row in (one.head, *one.rows) for cell in row} <= set(found)
    assert headings(page)[0] == "Design: Recorded" and "82.4 % of 2,000 stages" in page


def test_colours_of_a_figure_have_values_for_the_dark_theme():
    """Blue 0072b2 has hue 201.6 degrees, lightness 0.349; at 0.630 its channels are 0.261, 0.734,
    1.
    """
    text = inline_svg(figure_of("one"), "f")
    assert "var(--cffffff, #ffffff)" in text and not re.search(r"(fill|stroke): #", text)
    page = html_of(
        [PageSection("s", "s", text)],
        title="t",
        subtitle="",
        assumptions="",
        command="",
        made="",
        versions={},
    )
    assert "--cffffff: #171717; " in page.split("screen and (prefers-color-scheme: dark)")[1]
    assert dark_of("000000") == "#ebebeb" and dark_of("0072b2") == "#42bbff"


def test_a_moving_outline_has_the_points_of_the_mesh_at_both_ends():
    """A square of 10 mm whose right side moves by x: drawn by 7 % of the size, in 560 px across
    11.6 mm.
    """
    nodes = np.array(
        [[0, 0], [10, 0], [10, 10], [0, 10], [5, 0], [10, 5], [5, 5], [5, 10], [0, 5]], dtype=float
    )
    field = np.zeros((9, 2))
    field[[1, 5, 2], 0] = 0.003
    svg = moving_svg(nodes, np.array([[0, 1, 2, 4, 5, 6], [0, 2, 3, 6, 7, 8]]), field)
    right, left = (
        set(end.strip("MZ").split()) for end in re.search(r'values="([^;]*);([^;]*);', svg).groups()
    )
    across = [560 * (0.8 + x) / 11.6 for x in (0.0, 10.0, 10.7, 9.3)]
    assert {
        f"{across[0]:.1f},{across[1]:.1f}",
        f"{across[2]:.1f},{across[0]:.1f}",
    } <= right and len(right) == 8
    assert (
        f"{across[3]:.1f},{across[0]:.1f}" in left
        and f"{across[1]:.1f},{across[1]:.1f}" not in left
    )


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_motion_by_the_actuators_of_a_stage_is_that_of_the_platform_in_one_direction(direction):
    elements = driven_elements(flexfem.load(STAGE), 2)
    nodes = elements.mesh.nodes
    field = driven_field(elements, direction)
    hub = np.hypot(*nodes.T) < 8.0 + 1e-6
    x, y = nodes[hub].T
    expected = {"x": [1 + 0 * x, 0 * x], "y": [0 * x, 1 + 0 * x], "theta": [-y, x]}[direction]
    assert np.count_nonzero(hub) >= 12
    np.testing.assert_allclose(
        field[hub], np.transpose(expected), atol=1e-6 * np.max(np.abs(expected))
    )


def test_key_results_are_those_of_finite_elements_with_errors_of_the_analytic_model():
    """Stiffness 40 +- 0.1 N/mm against 44: 10 % too stiff; 40 N/mm over 0.5 +- 0.005 mm: 20 N +-
    (0.25 + 1) %.
    """
    stiff = np.array([np.diag([44.0, 60.0, 9e4]), np.diag([40.0, 50.0, 1e5])])
    width = np.stack([np.full((3, 3), np.nan), np.diag([0.1, 0.2, 100.0])])
    reach = np.full((2, 3), 0.5)
    force = np.einsum("mii->mi", stiff) * 0.5
    values = {
        "stiffness": stiff,
        "free": force,
        "yield_range": reach,
        "yield_force": force,
        "stress": np.ones((2, 3, 3, 3)),
    }
    free = np.array([[44.0, 60.0, 9e4], [40.0, 50.0, 1e5]])
    values |= {"free": free, "compliance": np.array([np.diag(1 / each) for each in free])}
    bands = {
        "stiffness": width,
        "free": np.array([[np.nan] * 3, [0.1, 0.2, 100.0]]),
        "yield_range": np.stack([np.full(3, np.nan), np.full(3, 0.005)]),
    }
    found = StageStiffness(About("one", lever=50.0), values, bands, {"model": (ANALYTIC, ELEMENTS)})
    rows = {title: cells for title, *cells in rows_at_rest(found, ELEMENTS, "beams")}
    assert rows["stiffness, other directions held"][:2] == [
        "40.00 ± 0.10 N/mm",
        "50.00 ± 0.20 N/mm",
    ]
    assert rows["force at first yield, other directions held, linear"][0] == "20.00 ± 0.25 N"
    assert rows["displacement at first yield, other directions held, linear"][1] == "500.0 ± 5.0 µm"
    errors = rows["error of the stiffness, other directions free, by the analytic model (beams)"]
    assert errors[0] == "10.00 ± 0.28 %" and errors[2].startswith("-10.00")
    values["compliance"] = values["compliance"] * np.diag(
        [1.0, 1.0, 1 / 101]
    )  # as stiff as 4040 N/mm at the lever
    turned = StageStiffness(
        About("one", lever=50.0), values, bands, {"model": (ANALYTIC, ELEMENTS)}
    )
    assert [
        cells[3]
        for cells in rows_at_rest(turned, ELEMENTS, "beams")
        if cells[0].startswith("error")
    ] == ["stiff: not compared"]


def test_the_key_results_state_the_range_at_finite_displacement_and_its_limit():
    """Both senses, with the limit that ends each; numbers by linear theory do not stand beside it."""
    stiff = np.eye(3)[None] * [40.0, 50.0, 1e5]
    values = {
        "stiffness": stiff,
        "free": np.array([[40.0, 50.0, 1e5]]),
        "compliance": np.linalg.inv(stiff),
    }
    values |= {"yield_range": np.ones((1, 3)), "yield_force": np.ones((1, 3))}
    reach = np.array([[0.8, 0.3, 0.02], [-0.8, -0.1, np.nan]])
    values |= {"range": np.array([reach / 2, reach]), "range_force": np.array([reach, 2 * reach])}
    limit = np.zeros((2, 2, 7, 3))
    limit[:, :, 0] = 1.0
    limit[1, 1, :, 1] = np.eye(7)[2]
    values["range_limit"] = limit
    band = np.full((2, 2, 3), 0.01)
    found = Stiffness(About("one", lever=50.0), values, {"range": band}, {"model": (ANALYTIC,)})
    rows = rows_at_rest(found, ANALYTIC, "beams")
    free, ends, force, held = rows[2:6]
    titles = [title for title, *_ in rows]
    assert free[:3] == [
        "range until the first limit, other directions free",
        "800 ± 10 µm each way",
        "300 ± 10 µm to -100 ± 10 µm",
    ]
    assert free[3].endswith("to not known")
    assert ends[1:3] == ["yield of a hinge", "yield of a hinge; buckling"]
    assert force[1:3] == ["1.6 N each way", "0.6 N to -0.2 N"]
    assert held[1] == "400 ± 10 µm each way"
    assert not [title for title in titles if "linear" in title]


def test_a_page_without_finite_elements_opens_with_the_analytic_model(written):
    page = written.read_text()
    opened = page.split('class="key"')[1].split("</table>")[0]
    assert (
        "Key results by the analytic model (calibrated, elastic links, corrected for thickness)"
        in opened
    )
    assert "41.903 N/" in opened and "finite elements" not in opened and "23.836" not in opened
