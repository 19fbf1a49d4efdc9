"""One name for a number, whatever says it: refusals, provenance, studies, baselines."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from flexfem.baselines import inputs_of
from flexfem.files.refusals import key_path, path_of
from flexfem.mechanism.keys import keys
from flexfem.paper.stage import load_feasible, load_stage
from flexfem.refused import BadInput
from flexfem.study.loaded import load_study

ENTRIES = (
    (3, "base", "radius_mm", 3.7),
    (1, "platform", "neck_mm", 0.43),
    (2, "base", "neck_mm", 0.57),
)
SHIPPED = (
    (Path(__file__).parents[2] / "geometry/mobility6.toml").read_text().partition("[provenance]")[0]
)
STUDY = """name = "one factor"
stage = "stage.toml"
model = "analytic"
[sampling]
method = "grid"
[[factor]]
key = "KEY"
values = [0.51, 0.53]
"""


def write(folder, entries=ENTRIES, tail=""):
    """A stage whose overrides stand in no order; returns the file, and the line of each override's
    number.
    """
    text = SHIPPED.rstrip("\n") + "\n"
    for chain, hinge, key, value in entries:
        text += f'[[override]]\nchain = {chain}\nhinge = "{hinge}"\n{key} = {value}\n'
    path = folder / "stage.toml"
    path.write_text(text + tail)
    first = SHIPPED.rstrip("\n").count("\n") + 1
    return path, [first + 4 * (place + 1) for place in range(len(entries))]


def test_a_number_of_an_override_has_one_name_wherever_it_is_said(tmp_path):
    path, lines = write(
        tmp_path, tail='[provenance]\n"override.2.base.neck_mm" = "assumed: worn"\n'
    )
    stage = load_stage(path)
    stored = inputs_of(path)[path.name]
    assert stage.assumed == ("override.2.base.neck_mm",)
    for place, (chain, hinge, key, value) in enumerate(ENTRIES):
        name = f"override.{chain}.{hinge}.{key}"
        assert (
            name in stage.numbers
            and stored[name] == value
            and keys()[name].value_in(stage) == value
        )
        spoilt = [
            (*entry[:3], -8.0 if index == place else entry[3])
            for index, entry in enumerate(ENTRIES)
        ]
        with pytest.raises(
            BadInput,
            match=re.escape(f"stage.toml, line {lines[place]}: {name} = -8.0, expected > 0"),
        ):
            load_stage(write(tmp_path, spoilt)[0])
        spoilt = [
            (*entry[:3], 9.5 if index == place else entry[3]) for index, entry in enumerate(ENTRIES)
        ]
        with pytest.raises(
            BadInput, match=re.escape(f"stage.toml, line {lines[place]}: {name} = 9.5, n")
        ):  # or too wide
            load_feasible(write(tmp_path, spoilt)[0])


def test_a_name_by_the_place_of_an_override_is_refused_with_its_name(tmp_path):
    path, _ = write(tmp_path, tail='[provenance]\n"override[1].neck_mm" = "assumed: worn"\n')
    with pytest.raises(
        BadInput,
        match=re.escape("a key path of this file, did you mean override.1.platform.neck_mm?"),
    ):
        load_stage(path)
    write(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY.replace("KEY", "override[1].neck_mm"))
    with pytest.raises(BadInput, match=re.escape("did you mean override.<chain>.<hinge>.neck_mm?")):
        load_study(tmp_path / "study.toml")


def test_what_an_override_is_about_is_found_by_place_where_it_is_wrong(tmp_path):
    with pytest.raises(BadInput, match=r"override\[1\]\.chain = 7, expected <= 3"):
        load_stage(write(tmp_path, [ENTRIES[0], (7, *ENTRIES[1][1:])])[0])
    with pytest.raises(
        BadInput, match=r"override\.3\.base = \{.*\}, expected one override for each hinge"
    ):
        load_stage(write(tmp_path, [ENTRIES[0], ENTRIES[1], ENTRIES[0]])[0])


def test_a_key_path_is_read_as_it_was_written():
    data = {
        "override": [
            {"chain": chain, "hinge": hinge, key: value} for chain, hinge, key, value in ENTRIES
        ]
    }
    for path in (
        ("a", 2, "b", 0),
        ("with.dot", 'q"', "ü x"),
        ("override", 2, "neck_mm"),
        ("override", 0, "chain"),
        (),
    ):
        assert path_of(key_path(path, data), data) == path
    assert path_of("override.2.base.neck_mm") == ("override", "2", "base", "neck_mm")
    assert path_of("override.1.base.neck_mm", data) == (
        "override",
        "1",
        "base",
        "neck_mm",
    )  # there is none
    for text in ("a..b", "a[x]", 'a."', "a]"):
        with pytest.raises(ValueError, match="no key path"):
            path_of(text)
