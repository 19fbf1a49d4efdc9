"""A design that is stored: read, printed, drawn and put on a page; what is none is refused."""

from __future__ import annotations

import html
import re
from collections import Counter

import numpy as np
import pytest
from matplotlib.text import Text

import flexfem as api
from flexfem.commands.design import print_design
from flexfem.designs import write_design
from flexfem.synthesis import outcome
from flexfem.synthesis.model import Model
from flexfem.synthesis.result import SoleRelaxation
from flexfem.synthesis.stored import is_design, read_design
from flexfem.verify.result import write_record

from ..conftest import stored as told
from .conftest import HEAD, best, require
from .test_outcome import STEPPED, Softer, load_requirements

HOSTILE = "<script>alert(1)</script> & $x$"
WANTED = (
    f'[[require]]\nlabel = "{HOSTILE}"\nquantity = "kxx_n_per_mm"\nat_least = 60.0\n',
    require("envelope_mm", None, 200),
    '[[objective]]\nlabel = "stiffness"\nmaximise = "range_x_um"\n',
    best("maximise", "ktt_n_mm_per_rad"),
)

PLAIN = str.maketrans("\N{NO-BREAK SPACE}\N{MINUS SIGN}", " -")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A record of two objectives beside its file, by elements that are not solved."""
    path = tmp_path_factory.mktemp("stored") / "wanted.toml"
    path.write_text("\n".join([HEAD, "front = 3", *STEPPED, *WANTED]))
    loaded = load_requirements(path)
    found = outcome.designed(loaded, Softer(loaded, Counter()))
    record = path.with_name("wanted-design.json")
    return write_record(found, record)


def test_a_stored_design_reads_back(stored):
    found = read_design(stored)
    assert is_design(stored) and told(stored) == found.model_dump(mode="json")
    assert {*found.sensitivities["neck"]} == {"range_x_um", "ktt_n_mm_per_rad", "kxx_n_per_mm", "envelope_mm"}
    assert [each.name for each in found.decisive] == ["range_x_um", "ktt_n_mm_per_rad", "kxx_n_per_mm"]


def test_sensitivities_of_objectives_and_active_requirements_are_printed(stored, capsys):
    found = read_design(stored)
    row = {"range_x_um": -0.5, "ktt_n_mm_per_rad": 0.0, "kxx_n_per_mm": 12345.6, "envelope_mm": 9.0}
    rows = {"neck": row, "radius": row | {"kxx_n_per_mm": None}}
    print_design(found.model_copy(update={"sensitivities": rows}))
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["neck", "-0.500", "+0.000", "+1.23e+04"] in lines
    assert ["radius", "-0.500", "+0.000", "not", "known"] in lines


def test_any_design_of_the_front_is_a_stage_and_has_its_row(stored, tmp_path, capsys):
    found = read_design(stored)
    write_design(found, tmp_path)
    print_design(found)
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    for number, one in enumerate(found.front, 1):
        stage = api.load(tmp_path / f"wanted-front-{number}.toml")
        assert stage.hinges.elbow.radius == pytest.approx(one.design["radius"])
        columns, _ = Model(load_requirements(stored.with_name("wanted.toml"))).columns(
            np.array([[*one.design.values()]])
        )
        stiffness = 0.97 * columns["kxx_n_per_mm"][0]
        assert one.margins_percent[0] == pytest.approx(100 * (stiffness / 60 - 1))
        row = [str(number), *(f"{x:.6g}" for x in (*one.design.values(), *one.values))]
        assert [*row, *(f"{x:.3g}" for x in one.margins_percent)] in printed
    assert len(found.front) >= 2


def written_on(figure):
    """All words of a figure."""
    return " ".join(text.get_text() for text in figure.findobj(Text))


def test_a_stored_design_is_drawn_as_when_it_was_found(stored, tmp_path, flexfem, monkeypatch):
    monkeypatch.setattr("flexfem.plot.write.rendered", lambda figure, form: written_on(figure).encode())
    code, out, _ = flexfem("plot", stored, "-o", tmp_path / "drawn")
    names = [f"wanted-design{part}.{form}" for part in ("", "-sensitivity", "-front") for form in ("png", "pdf")]
    assert code == 0 and out.split() == [str(tmp_path / "drawn" / name) for name in names]
    assert sorted(names) == sorted(path.name for path in (tmp_path / "drawn").iterdir())
    said = {
        "": "margins of the requirements",
        "-sensitivity": "for 1 % more of one dimension",
        "-front": "by its number",
    }
    for part in said:
        shown = " ".join((tmp_path / "drawn" / f"wanted-design{part}.png").read_text().split())
        assert [words in shown for words in said.values()] == [other == part for other in said]
    code, out, err = flexfem("plot", stored, "--displacement", "-o", tmp_path / "none")
    assert (code, out) == (2, "") and "--displacement with a design" in err and not (tmp_path / "none").exists()


def cells(page):
    """Text of every cell of the tables of a page, without what marks it up."""
    found = re.findall(r"<t[hd](?: [^>]*)?>(.*?)</t[hd]>", page, re.DOTALL)
    return [html.unescape(re.sub(r"<[^>]+>", "", cell)).translate(PLAIN) for cell in found]


def test_a_page_of_a_design_has_its_margins_prices_and_sensitivities_and_hostile_names_as_text(stored, tmp_path):
    found = read_design(stored)
    written = api.report(stored, tmp_path / "page.html")
    assert written.assumed == found.assumed and "Front" in written.sections
    page = (tmp_path / "page.html").read_text()
    assert "<script>alert" not in page and f"{len(found.assumed)} of the numbers behind this page are assumed" in page
    every = cells(page)
    row = every[every.index(HOSTILE) :]
    one = found.requirements[0]
    assert (
        row[1] == "at least 60"
        and row[3] == one.verdict == "met"
        and row[6:8] == ["finite elements", f"{one.uncorrected:.4f}"]
    )
    assert row[2].startswith(f"{one.value:.4f} ± ") and row[2].endswith("N/mm")
    assert float(row[4].split(" ± ")[0]) == pytest.approx(one.margin_percent, rel=1e-2)
    assert float(row[5]) == pytest.approx(one.price_percent, rel=1e-2)
    row = every[every.index("dimension", every.index(HOSTILE)) :]
    assert row[1:5] == [HOSTILE, "envelope_mm", "stiffness", "ktt_n_mm_per_rad"] and row[5] == "neck"
    assert float(row[6]) == pytest.approx(found.sensitivities["neck"]["kxx_n_per_mm"], rel=1e-2)
    assert f"{found.evaluations['analytic']:,}" in every


def test_a_page_of_two_designs_says_which_is_which_and_what_is_not_known(stored, tmp_path):
    found = read_design(stored)
    one = found.requirements[0].model_copy(update={"price_percent": None, "active": True, "verdict": "missed"})
    alone = [SoleRelaxation(requirement="reach", relax_to=12.5, percent=3.25)]
    changes = {"name": "Other", "requirements": [one], "alternatives": alone, "front": [], "feasible": False}
    rows = {key: {name: None for name in row if name != "envelope_mm"} for key, row in found.sensitivities.items()}
    other = write_record(found.model_copy(update={**changes, "sensitivities": rows}), tmp_path / "other.json")
    written = api.report([stored, other], tmp_path / "page.html")
    assert "Requirements: Other" in written.sections and "Front: a test" in written.sections
    assert "Front: Other" not in written.sections
    page = (tmp_path / "page.html").read_text()
    every = cells(page)
    assert every[every.index("reach") : every.index("reach") + 3] == ["reach", "12.5000", "3.25000"]
    assert "it does not meet all requirements: the nearest that was found" in page
    assert every.count("not known") == 1 + 3 * len(rows)
