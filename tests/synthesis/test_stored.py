"""A design that is stored: read, printed, drawn and put on a page; what is none is refused."""

from __future__ import annotations

import json
from collections import Counter

import pytest

from flexfem.commands.design import print_design
from flexfem.refused import BadInput
from flexfem.synthesis import outcome
from flexfem.synthesis.stored import is_design, read_design

from .conftest import HEAD, best, require
from .test_outcome import STEPPED, Softer, load_requirements

HOSTILE = "<script>alert(1)</script> & $x$"
WANTED = (
    f'[[require]]\nlabel = "{HOSTILE}"\nquantity = "kxx_n_per_mm"\nat_least = 60.0\n',
    require("envelope_mm", None, 200),
    '[[objective]]\nlabel = "stiffness"\nmaximise = "range_x_um"\n',
    best("maximise", "ktt_n_mm_per_rad"),
)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A record of two objectives beside its file, by elements that are not solved."""
    path = tmp_path_factory.mktemp("stored") / "wanted.toml"
    path.write_text("\n".join([HEAD, "front = 3", *STEPPED, *WANTED]))
    loaded = load_requirements(path)
    found = outcome.designed(loaded, Softer(loaded, Counter()))
    record = path.with_name("wanted-design.json")
    record.write_text(found.model_dump_json())
    return record


def test_a_stored_design_reads_back(stored):
    found = read_design(stored)
    assert is_design(stored) and json.loads(stored.read_text()) == found.model_dump(mode="json")
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


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (["name"], "a\x00b", "name: "),
        (["stage"], "thickness_mm = 3", "stage: expected the text of a stage file"),
        (["sensitivities", "neck"], {"kxx_n_per_mm": 1.0}, "sensitivities.neck: expected each of the quantities"),
        (["relaxed"], {}, "relaxed: expected each of the dimensions"),
        (["front", 0, "values"], [1.0], "front.0: expected a value of each objective"),
        (["history"], [], "history: "),
        (["requirements", 0, "margin"], "wide", "requirements.0.margin: "),
    ],
)
def test_a_design_whose_parts_do_not_belong_together_is_refused(stored, tmp_path, place, value, said):
    data = inner = json.loads(stored.read_text())
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path = tmp_path / "design.json"
    path.write_text(json.dumps(data))
    with pytest.raises(BadInput, match=f"flexfem design stores: {said}") as refused:
        read_design(path)
    assert "\n" not in str(refused.value)


def test_a_stored_design_is_drawn_as_when_it_was_found(stored, tmp_path, flexfem):
    code, out, _ = flexfem("plot", stored, "-o", tmp_path / "drawn")
    names = [f"wanted-design{part}.{form}" for part in ("", "-sensitivity") for form in ("png", "pdf")]
    assert code == 0 and out.split() == [str(tmp_path / "drawn" / name) for name in names]
    assert sorted(names) == sorted(path.name for path in (tmp_path / "drawn").iterdir())
    code, out, err = flexfem("plot", stored, "--displacement", "-o", tmp_path / "none")
    assert (code, out) == (2, "") and "--displacement with a design" in err and not (tmp_path / "none").exists()
