"""The page of a stage: its numbers are those of the records, hostile names stay text, bad input writes nothing."""

from __future__ import annotations

import os
import re
from html import unescape
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import flexfem
from flexfem.page import answers, motion
from flexfem.page import stage as of_stage
from flexfem.page.report import STANDARD, command_line, doubts_line, report
from flexfem.page.stage import provenance_section
from flexfem.plot.told import hinge_spots
from flexfem.refused import BadInput

ROOT = Path(__file__).parents[2]
STAGE = ROOT / "geometry/mobility6.toml"
OF_METAL = r"(?m)^expansion_um_per_m_k = 23.*$|^.material.expansion_um_per_m_k.*$"
HOSTILE = '<script>alert(1)</script>"><img src=x onerror=alert(1)></svg>{{7*7}}'


def cells(page: str) -> list[str]:
    return [unescape(re.sub("<[^>]+>", "", each)).strip() for each in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", page)]


def headings(page: str) -> list[str]:
    return [unescape(each) for each in re.findall(r"<h2[^>]*>(.*?)</h2>", page)]


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """A page of the reference stage under a hostile name, without finite elements."""
    folder = tmp_path_factory.mktemp("page")
    text = STAGE.read_text().replace('name = "mobility six, reference"', f"name = '{HOSTILE}'", 1)
    assert HOSTILE in text
    (folder / "hostile.toml").write_text(text)
    found = report(folder / "hostile.toml", folder / "out.html", ["analytic", "drive"])
    assert found.bytes == (folder / "out.html").stat().st_size < 5e6
    return folder / "out.html"


def test_every_section_has_a_heading_that_the_contents_lead_to(written):
    page = written.read_text()
    expected = ["What was asked", "Drawing and dimensions", "Analytic model", "Drive", "Where the numbers come from"]
    assert headings(page) == expected
    assert re.findall(r'<li><a href="#([^"]+)"', page) == re.findall(r'<h2 id="([^"]+)"', page)


def test_a_hostile_name_of_a_stage_is_text(written):
    page = written.read_text()
    assert "<img" not in page and page.count("<script") == 1 and "49" not in re.findall("<h1>.*</h1>", page)[0]
    assert page.count("</svg>") == page.count("<svg") == 2
    assert HOSTILE in unescape(page)


def test_numbers_of_the_page_are_those_of_the_records(written):
    """41.903 N/mm, 0.023865 mm/N and 45453 N mm/rad are what `stiffness` prints; 641.2 um the range in X."""
    found = cells(written.read_text())
    for name, value, unit in (
        ("K XX", "41.903", "N/mm"),
        ("K XY", "0", "N/mm"),
        ("K θθ", "45453", "N mm/rad"),
        ("C XX", "0.023865", "mm/N"),
    ):
        at = found.index(name)
        assert found[at : at + 3] == [name, value, unit]
    at = found.index("±641.2\xa0µm")
    assert found[at + 1 : at + 4] == ["26.87\xa0N", "0.7844\xa0MPa/µm", "elbow hinge, chain 3"]


@pytest.fixture(scope="module")
def unlike() -> flexfem.Stage:
    """Chains that differ, so that no two directions, chains or hinges have the same numbers; fatigue constants."""
    override = {(2, "elbow"): {"neck": 0.43}, (3, "platform"): {"radius": 1.8}, (1, "base"): {"neck": 0.57}}
    return flexfem.load(STAGE).replace(override=override, material="al-2024-t4")


@pytest.fixture
def table(monkeypatch):
    """The rows of the tables of a section, by their first cells; of its figures the data alone."""

    def shown(name, draw, description, spots=None, data="", caption=""):
        return data

    for module in (answers, motion, of_stage):
        monkeypatch.setattr(module, "shown_figure", shown)
    plain = str.maketrans("\N{NO-BREAK SPACE}\N{MINUS SIGN}", " -")

    def read(html):
        rows = [[cell.translate(plain) for cell in cells(row)] for row in re.findall(r"<tr.*?</tr>", html, re.DOTALL)]
        return {key: line for key, *line in rows}

    return read


def told(cell):
    """The numbers of a cell, and the unit after them."""
    number = r"-?\d+\.?\d*"
    return [float(each) for each in re.findall(number, cell)], re.sub(rf"^±?{number}( (±|to) {number})? ?", "", cell)


def near(*values, rel=6e-4):
    """Numbers as they are printed with four digits."""
    return pytest.approx(list(values), rel=rel)


FREEDOMS = {"X": ("µm", "N", "MPa/µm"), "Y": ("µm", "N", "MPa/µm"), "θ": ("mrad", "N mm", "MPa/mrad")}


def test_finite_elements_are_those_of_the_record_in_every_direction(unlike, table):
    model, side = flexfem.solve(unlike, 4), None
    errors, own = flexfem.errors(unlike, resolution=4), flexfem.stiffness(unlike).stiffness
    found = table(answers.elements_section(model, side, errors, own).html)
    for k, (axis, units) in enumerate(FREEDOMS.items()):
        stiff, share = model.stiffness[k, k], model.band[k, k] / model.compliance[k, k]
        first, second, third, error = found[f"K {axis}{axis}"]
        unit = "N mm/rad" if axis == "θ" else "N/mm"
        assert told(first) == (near(own[k, k]), unit)
        assert told(second) == (near(stiff, stiff * share, rel=0.05), unit) and told(second)[0][:1] == near(stiff)
        free = 1 / model.compliance[k, k]
        assert told(third) == (near(free, free * share, rel=0.05), unit) and told(third)[0][:1] == near(free)
        assert told(error) == (near(errors.percent[k, k], errors.band[k, k], rel=0.05), "%")
        limit, name = list(side.limits.values())[k], ("x", "y", "theta")[k]
        values = 1e3 * limit.range_at_yield, getattr(limit.force, name), 1e-3 * limit.stress
        assert [told(cell) for cell in found[axis][:3]] == [(near(v), u) for v, u in zip(values, units, strict=True)]
        assert found[axis][3] == f"{limit.hinge} hinge, chain {limit.chain}"


def test_stress_on_a_page_is_that_of_each_neck(unlike, table):
    model = flexfem.solve(unlike, 4)
    found = table(answers.stress_section(unlike, model).html)
    assert found.pop("neck") == ["X = 50 µm (MPa)", "θ = 1 mrad (MPa)"]
    stress = [model.neck_stress(pose) for pose in ([0.05, 0.0, 0.0], [0.0, 0.0, 1e-3])]
    for chain in range(3):
        for k, hinge in enumerate(("base", "elbow", "platform")):
            line = found.pop(f"{hinge} hinge, chain {chain + 1}")
            assert list(map(float, line)) == near(*(each[chain, k] for each in stress))
    assert not found


def test_modes_drive_and_life_on_a_page_are_those_of_their_records(unlike, table):
    vibration = flexfem.vibration(unlike, 3, resolution=4)
    found = table(motion.modes_section(vibration).html)
    assert found.pop("mode") == [
        "frequency (Hz)", "± (Hz)", "mass in X (%)", "in Y (%)", "inertia in θ (%)"
    ]  # fmt: skip
    for number, one in enumerate(vibration.record.modes, start=1):
        frequency, band, *shares = map(float, found.pop(str(number)))
        assert [frequency] == near(one.frequency) and [band] == near(one.band, rel=0.05)
        assert shares == pytest.approx(list(one.share.model_dump().values()), abs=0.005)

    reach = flexfem.reach(unlike, models="analytic")
    section = str(motion.drive_section(reach, of_stage.drive_table(flexfem.check(unlike))).html)
    assert reach.to_html() in section and "actuators" in section.lower()

    life = flexfem.life(unlike, [0.05, 0.02, 1e-4], resolution=None)
    ((model, line),) = [row for row in table(motion.life_section(life).html).items() if row[0] != "model"]
    of, first = life.analytic, life.analytic.necks[life.analytic.first]
    assert (model, line[0]) == (of.model, f"{first.hinge} hinge, chain {first.chain}")
    assert [float(line[1]), float(line[-1])] == near(first.equivalent, of.safety, rel=6e-3)
    shown = [
        float(each.replace("×10", "e").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-"))) for each in line[2:5]
    ]
    assert shown == near(of.cycles, of.fewest, of.most, rel=6e-3) and of.fewest < 0.95 * of.most


def test_the_table_of_hinges_has_each_in_its_row(unlike):
    found = flexfem.check(unlike)
    page = str(of_stage.drawing_section(unlike, found).html)
    lines = [cells(row) for row in re.findall(r"<tr.*?</tr>", page, re.DOTALL)]
    assert lines[0][-2:] == ["R (mm)", "t (mm)"]
    shown = {(int(line[1]), line[0]): line[-2:] for line in lines[1:]}
    assert shown[2, "elbow"] == ["1.5", "0.43"] and shown[3, "platform"] == ["1.8", "0.5"]
    assert shown[1, "base"] == ["4", "0.57"] and shown[2, "base"] == ["4", "0.5"]
    pointed = [spot.text.split("\n")[:2] for spot in hinge_spots(Figure().subplots(), unlike)]
    assert ["elbow hinge, chain 2", "notch radius 1.5 mm, neck 0.43 mm"] in pointed
    assert ["platform hinge, chain 3", "notch radius 1.8 mm, neck 0.5 mm"] in pointed


def test_assumed_numbers_are_counted_first_and_listed(written):
    page = written.read_text()
    stage = flexfem.load(written.with_name("hostile.toml"))
    keys = {*stage.assumed, *stage.drive_doubts.assumed}
    scopes = "(17 of geometry and material, 2 of expansion, 14 of the drive)"
    assert f"{len(keys)} of the numbers behind this page are assumed {scopes}" in page.split("<nav")[0]
    listed = cells(page.split("Where the numbers come from</h2>")[1])
    assert {key for key in keys if listed[listed.index(key) + 1] == "assumed"} == keys and len(keys) > 20


def test_no_number_whose_source_says_assumed_is_called_stated(tmp_path):
    """Sources of whole tables, one number without a source, and expansion, which no section of this page takes."""
    flexfem.new_stage(tmp_path / "mine.toml")
    text = (tmp_path / "mine.toml").read_text().split("[[actuator]]")[0]
    sources = {"thickness_mm": "assumed", "material": "assumed: a guess", "chain": "Drawing 7", "frame": "Assumed"}
    lines = "".join(f'"{key}" = "{source}"\n' for key, source in sources.items())
    (tmp_path / "mine.toml").write_text(f'{text}\n[provenance]\n{lines}"hinges" = "measured"\n"platform" = "measured"')
    stage = flexfem.load(tmp_path / "mine.toml")
    found = cells(provenance_section(stage, flexfem.check(stage)).html)
    rows = {key: (kind, source) for key, kind, source in zip(*(found[k::3] for k in range(3)), strict=True)}
    assert rows["frame.expansion_um_per_m_k"] == ("assumed", "Assumed")
    assert rows["chain.link_width_mm"] == ("stated", "Drawing 7") and "chain" not in rows and "material" not in rows
    assert not any(kind == "stated" and source.lower().startswith("assumed") for kind, source in rows.values())
    kinds = [kind for kind, _ in rows.values()]
    opening = provenance_section(stage, flexfem.check(stage)).html.split("</p>")[0]
    assert f"{kinds.count('assumed')} of these numbers are assumed</strong>, 0 have no stated source" in opening


def test_the_line_that_made_a_page_is_on_it_and_quoted(written):
    assert "flexfem report " in written.read_text().split("<footer")[1]
    assert command_line([Path("a b.toml")], Path("$x.html")) == "flexfem report 'a b.toml' -o '$x.html'"
    line = command_line([Path("a.toml")], Path("x.html"), ["life"], [0.02, 0.0, 1e-4])
    assert line == "flexfem report a.toml -o x.html --sections life --amplitude 0.02 0.0 0.0001"


def test_a_page_loads_nothing(written):
    page = written.read_text()
    assert not re.search(r"https?:|<[^>]*\bsrc=|@import|url\((?!#)", page)
    assert {found for found in re.findall(r'href="([^"]{5})', page) if not found.startswith("#")} == {"data:"}


@pytest.mark.parametrize(
    ("files", "output", "sections", "said"),
    [
        ([STAGE], "page.pdf", ["analytic"], "ends in .html"),
        ([STAGE], "page.html", ["magic"], "sections 'magic', expected some of analytic, elements"),
        ([STAGE], "page.html", ["life"], "without an amplitude"),
        ([STAGE, ROOT / "geometry/mobility3.toml"], "page.html", ["analytic"], "expected one stage"),
        ([STAGE, STAGE], "page.html", ["analytic"], "expected each file once"),
        ([STAGE], "none/page.html", ["analytic"], "no folder .*none, expected one that is there"),
        ([STAGE], f"{300 * 'x'}.html", ["analytic"], "cannot be written: File name too long"),
        ([ROOT / "two\nlines.json"], "page.html", STANDARD, r"two\\nlines.json: no such file"),
        ([Path("/dev/zero.json")], "page.html", ["analytic"], "expected none: they are of a stage, and these are"),
        ([], "page.html", ["analytic"], "no file"),
        ([ROOT / "cases/fig5.toml"], "page.html", ["analytic"], "this is a case file"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, files, output, sections, said):
    with pytest.raises(BadInput, match=said) as refused:
        report(files, tmp_path / output, sections)
    assert "\n" not in str(refused.value) and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("without", "section", "amplitude", "said"),
    [
        ("^$", "life", (0.1, 0.0, 0.0), r"toml, line \d+: material.fatigue_strength_coefficient_mpa is missing"),
        ("^$", "life", (0.0, 0.0, 0.0), "amplitude: expected a motion"),
        ("^$", "life", (0.1, 0.0, float("nan")), "amplitude: expected finite numbers"),
        (
            OF_METAL,
            "drift",
            None,
            r"toml, line \d+: material.expansion_um_per_m_k",
        ),
    ],
)
def test_a_section_that_cannot_be_is_refused_before_any_is_computed(tmp_path, without, section, amplitude, said):
    (tmp_path / "stage.toml").write_text(re.sub(without, "", STAGE.read_text()))

    def through(parts):
        raise AssertionError("computed")

    with pytest.raises(BadInput, match=said):
        report(tmp_path / "stage.toml", tmp_path / "page.html", ["analytic", section], amplitude, through)
    assert [path.name for path in tmp_path.iterdir()] == ["stage.toml"]


def test_a_page_never_replaces_what_it_is_of(tmp_path):
    stage = tmp_path / "stage.html"
    stage.write_text(STAGE.read_text())
    (tmp_path / "other.html").symlink_to(stage)
    for output in ("stage.html", "other.html"):
        with pytest.raises(BadInput, match=r"html.*: .*is read for what is to be written, expected another file"):
            report(stage, tmp_path / output, ["analytic"])
    with pytest.raises(BadInput, match=r"folder\.html: is a folder, expected a file"):
        (tmp_path / "folder.html").mkdir()
        report(stage, tmp_path / "folder.html", ["analytic"])
    assert stage.read_text() == STAGE.read_text()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not a result of flexfem verify: no JSON"),
        (100_000 * b"[", "not a result of flexfem verify: no JSON"),
        (b"\xff\x00", "not a result of flexfem verify: no JSON"),
    ],
)
def test_stored_json_that_is_no_answer_is_refused_in_one_line(tmp_path, content, said):
    path = tmp_path / "two\nlines.json"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=said) as refused:
        report(path, tmp_path / "page.html")
    assert "\n" not in str(refused.value) and list(tmp_path.iterdir()) == [path]


def test_a_pipe_or_a_file_too_large_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    with (tmp_path / "large.json").open("wb") as file:
        file.truncate(2**26 + 1)
    for name, said in (("pipe", "a pipe, socket or device"), ("large", "expected at most 64 MiB")):
        with pytest.raises(BadInput, match=said):
            report(tmp_path / f"{name}.json", tmp_path / "page.html")


def test_an_amplitude_that_no_section_takes_is_refused(tmp_path):
    with pytest.raises(BadInput, match="an amplitude without section life"):
        report(STAGE, tmp_path / "page.html", ["analytic"], (0.1, 0.0, 0.0))
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_in_doubt_is_not_said_to_be():
    from flexfem.page.report import Subject

    assert doubts_line(Subject("", "", [], [], [])) == ""
    assert doubts_line(Subject("", "", ["a"], ["b", "c"], [])).startswith(
        "1 of the numbers behind this page is assumed (1 of geometry and material); 2 have no stated source (2 of geo"
    )


@pytest.mark.slow
def test_a_page_of_everything_is_small_and_complete(tmp_path):
    sections = flexfem.page.report.SECTIONS
    flexfem.load(STAGE).replace(material="al-2024-t4").save(tmp_path / "stage.toml")  # has fatigue constants
    found = flexfem.report(tmp_path / "stage.toml", tmp_path / "all.html", sections, [0.2, 0.0, 0.0])
    assert found.bytes < 5e6 and len(found.sections) == len(sections) + 3
    page = (tmp_path / "all.html").read_text()
    assert page.count("<figure") >= 8 and page.count("<h2") == len(found.sections)
    assert {"1 K/mm along X", "1 K/mm along Y", "elbow hinge, chain 3"} < set(cells(page))


def test_a_study_that_is_not_done_has_no_page(tmp_path):
    with pytest.raises(BadInput, match=r"400 of 400 designs are open in .*expected all done by flexfem study run$"):
        report(ROOT / "cases/study-trust.toml", tmp_path / "page.html", folder=tmp_path / "none")
    assert not (tmp_path / "page.html").exists()
