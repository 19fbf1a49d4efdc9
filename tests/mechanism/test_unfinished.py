"""Drawings of mechanism files that are not finished: what there is, and the names of what is
missing.
"""

from __future__ import annotations

import pytest

from flexfem.mechanism.hinge_place import joint_polygon
from flexfem.mechanism.unfinished import read_drawable
from flexfem.refused import BadInput

GUIDE = """
name = "guide"
thickness_mm = 10
material.name = "al-7075-t6"
[parameters]
high_mm = 17
[[body]]
name = "base"
fixed = true
outline_mm = [[-20, -8], [20, -8], [20, 0], [-20, 0]]
[[body]]
name = "stage"
outline_mm = [[-20, "high"], [20, "high"], [20, 29], [-20, 29]]
[[hinge]]
name = "a"
between = ["base", "stage"]
at_mm = [-15, "high / 2"]
direction_deg = 90
shape = "leaf"
length_mm = "high"
neck_mm = 0.4
[[copy]]
parts = ["a"]
mirror_mm = [[0, 0], [0, 1]]
[output]
body = "stage"
at_mm = [0, 23]
[provenance]
hinge = "assumed: a test"
"""
OUTPUT = GUIDE[GUIDE.index("[output]") : GUIDE.index("[provenance]")]
# the change of the file, the names of bodies and hinges that are drawn, and what is named
FAULTS = {
    "material": (
        ('material.name = "al-7075-t6"\n', ""),
        "base stage",
        "a, a 2",
        ["material is missing"],
    ),
    "output": ((OUTPUT, ""), "base stage", "a, a 2", ["output is missing"]),
    "ground": (("fixed = true\n", ""), "base stage", "a, a 2", ["no body is fixed, expected"]),
    "hinge": (
        ("neck_mm = 0.4\n", ""),
        "base stage",
        "",
        [
            "line 14: hinge.a.neck_mm",
            'parts[0] = "a"',
            "body.stage: hinges connect it to no other body",
        ],
    ),
    "body": (
        ('name = "stage"', 'name = "slide"'),
        "base slide",
        "a, a 2",
        ['line 16: hinge.a.between[1] = "stage"', 'line 26: output.body = "stage"'],
    ),
    "key": (
        ("at_mm = [0, 23]", "at_mm = [0, 23]\nturn = 3"),
        "base stage",
        "a, a 2",
        ["line 28: output.turn is an unknown"],
    ),
    "outline": (
        ('[20, "high"], [20, 29]', '[20, "hihg"], [20, 29]'),
        "base",
        "a, a 2",
        [
            "line 13: body.stage.outline_mm[1][1]",
            "line 16: hinge.a.between[1]",
            "line 26: output.body",
        ],
    ),
}


@pytest.mark.parametrize(("change", "bodies", "hinges", "named"), FAULTS.values(), ids=FAULTS)
def test_what_there_is_is_drawn_and_what_is_missing_is_named_with_its_line(
    tmp_path, change, bodies, hinges, named
):
    assert change[0] in GUIDE
    path = tmp_path / "guide.toml"
    path.write_text(GUIDE.replace(*change))
    found = read_drawable(path)
    assert " ".join(body.name for body in found.layout.bodies) == bodies
    assert ", ".join(joint.name for joint in found.layout.joints) == hinges
    assert len(found.missing) == len(named)
    for text, expected in zip(found.missing, named, strict=True):
        assert expected in text
    assert all(joint_polygon(joint).area > 0.39 * 17 for joint in found.layout.joints)


def test_a_finished_file_lacks_nothing_and_one_without_a_body_is_refused(tmp_path):
    path = tmp_path / "guide.toml"
    path.write_text(GUIDE)
    found = read_drawable(path)
    assert found.missing == [] and found.mechanism.assumed
    path.write_text('[[body]]\nname = "a"\n')
    with pytest.raises(BadInput, match=r"line 1: body.a = .*expected one of outline_mm"):
        read_drawable(path)


def test_view_draws_an_unfinished_file_with_a_list_of_what_is_missing_and_succeeds(
    tmp_path, flexfem, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "guide.toml"
    path.write_text(
        GUIDE.replace(OUTPUT, "").replace(
            'between = ["base", "stage"]', 'between = ["base", "top"]'
        )
    )
    code, out, _ = flexfem("view", path, "-o", "drawn")
    assert code == 0 and "output is missing" in out and 'hinge.a.between[1] = "top"' in out
    assert (tmp_path / "drawn" / "guide-drawing.png").stat().st_size > 10_000
    code, _, err = flexfem("check", path)
    assert code == 2 and "output" in err
