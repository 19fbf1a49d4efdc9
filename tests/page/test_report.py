"""The page of a stage: its numbers are those of the records, hostile names stay text, bad input writes nothing."""

from __future__ import annotations

import json
import os
import re
from html import unescape
from pathlib import Path

import pytest

import flexfem
from flexfem.page.report import STANDARD, command_line, doubts_line, report
from flexfem.page.stage import provenance_section
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
    """42.743 N/mm, 0.023395 mm/N and 46377 N mm/rad are the documented stiffness; 659.2 um the range in X."""
    found = cells(written.read_text())
    for name, value, unit in (
        ("K XX", "42.743", "N/mm"),
        ("K XY", "0", "N/mm"),
        ("K θθ", "46377", "N mm/rad"),
        ("C XX", "0.023395", "mm/N"),
    ):
        at = found.index(name)
        assert found[at : at + 3] == [name, value, unit]
    at = found.index("±659.2\xa0µm")
    assert found[at + 1 : at + 4] == ["25.04\xa0N", "0.7631\xa0MPa/µm", "elbow hinge, chain 3"]


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
        ([ROOT / "tests/baselines/claims.json"], "page.html", STANDARD, "expected a result|not a result|not what"),
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
        with pytest.raises(BadInput, match=r"html: is read for what is to be written, expected another file"):
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
        (b'{"verdicts":' + 100_000 * b"[", "not a result of flexfem verify: no JSON"),
        (b'{"verdicts": []}', "claims stores: name: Field required"),
        (b'{"verdicts": NaN}', "claims stores: name: Field required"),
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


def test_a_page_may_lie_where_a_name_is_not_utf_8(tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff<b>")
    folder.mkdir()
    accepted = json.loads((ROOT / "tests/baselines/claims.json").read_text())["record"]["claims"]
    (folder / "claims.json").write_text(json.dumps(accepted))
    report(folder / "claims.json", folder / "page.html")
    assert "\\udcff&lt;b&gt;/claims.json" in (folder / "page.html").read_text()


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


def test_verdicts_of_a_file_stand_with_what_was_found(tmp_path):
    accepted = json.loads((ROOT / "tests/baselines/claims.json").read_text())["record"]["claims"]
    accepted |= {"verdicts": accepted["verdicts"][:2], "assumed": ["one", "two", "three"], "not_stated": []}
    accepted["verdicts"][0]["verdict"] = "holds"
    changed = {"statement": HOSTILE, "verdict": "does not hold", "found": "in 12.3 % of 45 stages", "where": "Fig. 5"}
    accepted["verdicts"][1] |= changed
    (tmp_path / "claims.json").write_text(json.dumps(accepted))
    found = report(tmp_path / "claims.json", tmp_path / "page.html")
    assert found.sections == ["Verdicts", "Where the numbers come from"] and len(found.assumed) == 3
    page = (tmp_path / "page.html").read_text()
    assert "<p>holds: 1; does not hold: 1.</p>" in page
    row = cells(page)[cells(page).index(HOSTILE) :]
    assert row[1:3] == ["Fig. 5", "does not hold"] and row[3].startswith("In 12.3 % of 45 stages.")


def test_a_study_that_is_not_done_has_no_page(tmp_path):
    with pytest.raises(BadInput, match=r"400 of 400 designs are open in .*expected all done by flexfem study run$"):
        report(ROOT / "cases/study-trust.toml", tmp_path / "page.html", folder=tmp_path / "none")
    assert not (tmp_path / "page.html").exists()
