"""The regression: every change of an input, of a mesh, of a number or of a baseline itself is said in one line."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import numpy as np
import pytest

import flexfem as public
from flexfem.commands.baseline import moves as gates
from flexfem.commands.baseline import regression, store
from flexfem.commands.baseline.committed import committed_mesh, read_mesh, write_mesh
from flexfem.commands.baseline.inputs import changes, inputs_of
from flexfem.commands.baseline.moves import at, leaves
from flexfem.commands.baseline.records import meshes, sections
from flexfem.commands.baseline.rules import rule_of
from flexfem.commands.plain import plain
from flexfem.files.refusals import key_path
from flexfem.refused import BadInput

ROOT = Path(__file__).parents[2]
ACCEPTED = sorted((ROOT / "tests/baselines").glob("*.json"))
INPUTS = [
    *sorted((ROOT / "cases").glob("fig*.toml")),
    *sorted((ROOT / "cases").glob("joints-*.toml")),
    *sorted((ROOT / "geometry").glob("*.toml")),
    *sorted((ROOT / "tests/baselines/studies").glob("*.toml")),
    *sorted((ROOT / "flexfem/data").glob("*.json")),
]


def allowed(record, path):
    """What a number of a record may move by."""
    return gates.allowed(record, path, rule_of(path))


def nothing_is_solved(stage, resolution):
    raise AssertionError("a fresh mesh")


def found(path):
    """Lines of one baseline of a project, without solving anything."""
    return [str(each) for each in regression.checked(path, nothing_is_solved).findings]


def test_every_shipped_input_has_a_baseline_and_every_baseline_an_input():
    assert [path.stem for path in ACCEPTED] == sorted(path.stem for path in INPUTS)
    assert list(regression.unaccepted(ROOT / "tests/baselines")) == []


CHEAP = ("check", "stiffness", "mesh", "committed", "formulas", "hinges", "middle", "thickness")


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_what_takes_no_fresh_mesh_is_as_accepted(path):
    """Analytic numbers, charts, and finite elements on committed meshes, whole compliances and stresses among them."""
    folder = ROOT / "tests/baselines"
    baseline = store.read_baseline(store.file_of(path, folder))
    changed = store.changed(path, folder, baseline)
    assert not changed, "\n".join([*map(str, changed), "when that is meant: make baselines REASON=..."])
    makers = sections(path, folder, nothing_is_solved)
    now = {name: plain(makers[name]()) for name in CHEAP if name in makers}
    accepted = {name: baseline.record[name] for name in now} | {
        name: value for name, value in baseline.record.items() if name in ("result", "check")
    }
    moved = gates.moves(path.stem, accepted, {**accepted, **now}, rule_of=rule_of)
    assert not moved, "\n".join([*map(str, moved), "when that is meant: make baselines REASON=..."])


def spoilt(record):
    """The record with every leaf changed: numbers eleven times what they are, round-off zeros twice past their gate."""
    changed = copy.deepcopy(record)
    for path, value in leaves(record).items():
        if isinstance(value, bool) or value is None or isinstance(value, str):
            new = not value if isinstance(value, bool) else "other" if value is None else value + " or so"
        else:
            limit, size = allowed(record, path), rule_of(path).dimension.size(record, path)
            new = 11 * value if limit < 10 * abs(value) else value + 2 * limit if limit else 1.0
            assert limit < 10 * abs(value) or limit <= 5e-9 * size, path
        at(changed, path[:-1])[path[-1]] = new
    return changed


NEVER_COMPARED = {"result.written", "result.seconds"} | {
    f"{section}.versions.{package}"
    for section in ("result", "budget", "workspace", "converge")
    for package in ("flexfem", "numpy", "scipy", "scikit-fem", "gmsh")
}


@pytest.mark.parametrize("path", ACCEPTED, ids=lambda path: path.stem)
def test_no_number_and_no_text_can_change_unseen(path):
    record = store.read_baseline(path).record
    moved = {each.name for each in gates.moves(path.stem, record, spoilt(record), rule_of=rule_of)}
    assert {key_path(leaf) for leaf in leaves(record)} - moved <= NEVER_COMPARED
    assert gates.moves(path.stem, record, record, rule_of=rule_of) == []


def test_a_zero_to_round_off_has_no_more_room_than_round_off():
    record = store.read_baseline(ROOT / "tests/baselines/fig6.json").record
    for label in ("mobility three", "mobility six"):
        for axis in ("x", "theta"):
            path = ("result", "error_percent", label, axis)
            assert abs(at(record, path)) < 1e-10
            assert allowed(record, path) <= 1.0001e-10  # per cent
        assert 1e-4 < allowed(record, ("result", "error_percent", label, "y")) < 5e-3
    held = store.read_baseline(ROOT / "tests/baselines/joints-theta.json").record
    assert allowed(held, ("result", "error_percent", "mobility six", "x")) <= 1.0001e-9  # as docs/drive.md says
    path = ("committed", "mobility six", "compliance", 0, 1)
    assert allowed(record, path) < 1e-13  # mm/N, of 0.026


LARGEST = {  # part of the number that each kind may move by
    ("fig6", "committed.mobility six.compliance[0][0]"): 1e-7,
    ("fig6", "result.models.mobility six.stiffness[1][1]"): 1e-11,
    ("fig6", "result.models.mobility six.force[3][1]"): 1e-11,
    ("fig6", "result.models.mobility six.compliance[2][2]"): 5e-5,
    ("fig6", "result.models.mobility six.neck_stress[0][1]"): 1e-2,
    ("fig6", "result.curves.mobility six.y[3]"): 5e-4,
    ("fig6", "result.error_percent.mobility six.y"): 5e-4,
    ("fig6", "result.uncertainty.mobility six.y.band"): 2e-3,
    ("fig6", "result.uncertainty.mobility six.y.extrapolated"): 5e-3,
    ("mobility6", "budget.split.y.band"): 2e-3,
    ("mobility6", "budget.split.y.out_of_plane.y"): 1e-7,
    ("mobility6", "budget.split.y.shares[4].points.y"): 0.05,
    ("mobility6", "converge.compliance[2][0][0]"): 1e-3,
    ("mobility6", "workspace.box.position"): 1e-6,
    ("mobility6", "workspace.travel.theta.load[7][2]"): 1e-8,
    ("analytic-study", "analytic.table.kxx_n_per_mm[3]"): 1e-11,
    ("element-study", "verify.table.error_x_percent[2]"): 1e-2,
}


def test_no_gate_is_wider_than_its_kind_of_number_needs():
    records = {path.stem: store.read_baseline(path).record for path in ACCEPTED}
    paths = {stem: {key_path(path): path for path in leaves(record)} for stem, record in records.items()}
    for (stem, name), largest in LARGEST.items():
        path = paths[stem][name]
        assert 0 < allowed(records[stem], path) <= largest * abs(at(records[stem], path)), name


@pytest.mark.parametrize(
    ("file", "edit", "line"),
    [
        (
            "geometry/mobility6.toml",
            ("hub_radius_mm = 8.0", "hub_radius_mm = 9.0"),
            "platform.hub_radius_mm was 8.0, is 9.0",
        ),
        (
            "geometry/mobility6.toml",
            ("link_width_mm = 9.0", "link_width_mm = 9.05"),
            "chain.link_width_mm was 9.0, is 9.05",
        ),
        (
            "geometry/mobility6.toml",
            ("\nradius_mm = 17.0", "\nradius_mm = 17.2"),
            "platform.radius_mm was 17.0, is 17.2",
        ),
        ("geometry/mobility6.toml", ("= 503.0", "= 100.0"), "material.yield_strength_mpa was 503.0, is 100.0"),
        (
            "geometry/mobility6.toml",
            ("[30.0, 32.0, 24.0]", "[30.0, 32.5, 24.0]"),
            "chain.link_lengths_mm[1] was 32.0, is 32.5",
        ),
        (
            "geometry/mobility6.toml",
            ("prismatic = true", "prismatic = false"),
            "hinges.base.prismatic was True, is False",
        ),
        (
            "geometry/mobility6.toml",
            ("thickness_mm = 10.0", 'model = "plane_strain"\nthickness_mm = 10.0'),
            "model was plane_stress, is plane_strain",
        ),
        ("cases/fig6.toml", ("points = 21", "points = 21\nresolution = 9"), "resolution was 8, is 9"),
        ("cases/fig6.toml", ("points = 21", "points = 41"), "points was 21, is 41"),
        ("cases/fig6.toml", ("amplitude_um = 50.0", "amplitude_um = 50.1"), "amplitude_um was 50.0, is 50.1"),
        ("cases/fig6.toml", ('points = "assumed: the', 'points = "measured: the'), None),
        (
            "cases/fig6.toml",
            ("mobility = 6", 'mobility = 6\nformula = "koster"'),
            "curve[1].formula was paros-weisbord, is koster",
        ),
        ("cases/fig6.toml", ("mobility = 6", "mobility = 12"), "curve[1].mobility was 6, is 12"),
        (
            "cases/fig6.toml",
            ('label = "mobility three"', 'label = "three"'),
            "curve[0].label was mobility three, is three",
        ),
        ("cases/fig6.toml", ('direction = "y"', 'direction = "x"'), "direction was y, is x"),
    ],
    ids=lambda value: value[1].strip() if isinstance(value, tuple) else "",
)
def test_an_edited_input_is_said_by_key_before_any_number(project, file, edit, line):
    path = project.edit(file, edit)
    lines = found(project.path("tests/baselines/fig6.json"))
    said = line or "provenance.points was assumed: the paper's figures are not available, is measured: the paper's"
    assert lines[0].startswith(f"the input changed: {path}: {said}")
    assert all(each.startswith("the input changed: ") for each in lines)


def test_curves_in_another_order_are_said(project):
    text = project.path("cases/fig6.toml").read_text()
    head, first, second = text.split("[[curve]]")
    second, tail = second.split("[provenance]")
    project.path("cases/fig6.toml").write_text(f"{head}[[curve]]{second}[[curve]]{first}[provenance]{tail}")
    assert "curve[0].label was mobility three, is mobility six" in found(project.path("tests/baselines/fig6.json"))[0]


OVERRIDES = [
    '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.52\n',
    '[[override]]\nchain = 3\nhinge = "base"\nneck_mm = 0.53\n',
]


def test_the_order_of_overrides_says_nothing(tmp_path):
    text, path = (ROOT / "geometry/mobility3.toml").read_text().rstrip() + "\n", tmp_path / "q.toml"

    def made(overrides):
        path.write_text(text + "".join(overrides))
        record = sections(path, tmp_path, nothing_is_solved)
        return inputs_of(path), {name: plain(record[name]()) for name in ("check", "stiffness")}

    (was, accepted), (now, fresh) = made(OVERRIDES), made(OVERRIDES[::-1])
    assert [key for key in was["q.toml"] if key.startswith("override")] == [
        "override.2.elbow.neck_mm",
        "override.3.base.neck_mm",
    ]
    assert accepted["check"]["not_stated"] == fresh["check"]["not_stated"][::-1]
    assert changes(None, was, now) == [] and gates.moves("q", accepted, fresh, rule_of=rule_of) == []
    earlier = {"q.toml": was["q.toml"] | {"override[0].chain": 2, "override[0].hinge": "elbow", "override[1].chain": 3}}
    assert changes(None, earlier, now) == []  # a baseline that lists the places
    now, fresh = made([OVERRIDES[0], OVERRIDES[1].replace("base", "platform")])
    assert [str(each) for each in changes(None, earlier, now)] == [
        "the input changed: q.toml: override.3.base.neck_mm is gone, was 0.53",
        "the input changed: q.toml: override.3.platform.neck_mm is new: 0.53",
    ]
    assert "q: check.not_stated[1] was override.3.base.neck_mm, is override.3.platform.neck_mm" in [
        str(each) for each in gates.moves("q", accepted, fresh, rule_of=rule_of)
    ]


def test_a_mesh_of_another_stage_or_edited_by_hand_is_refused(project):
    folder = project.path("tests/baselines")
    (three, stage), (six, _) = (next(iter(meshes(project.path(f"geometry/mobility{m}.toml")).items())) for m in (3, 6))
    (folder / three).write_bytes((folder / six).read_bytes())
    assert found(folder / "mobility3.json")[0].startswith(f"the input changed: {folder / three}: nodes was ")
    with pytest.raises(BadInput, match="not the mesh of the stage as drawn"):
        committed_mesh(stage, folder / three)
    good = read_mesh(ROOT / "tests/baselines" / three)
    shifted, hub = good.nodes.copy(), np.unique(good.edges["hub"])
    shifted[hub[0]] *= 1.0001
    for name, mesh, said in (
        ("a moved node", good._replace(nodes=shifted), "node .* off|no node near"),
        ("part of the hub", good._replace(edges=good.edges | {"hub": good.edges["hub"][:-1]}), "'hub' are .* mm long"),
        ("no neck", good._replace(edges={k: v for k, v in good.edges.items() if k != "neck 2 elbow"}), "neck 2 elbow"),
        ("a neck elsewhere", good._replace(edges=good.edges | {"neck 2 elbow": good.edges["neck 1 elbow"]}), "neck 2"),
    ):
        write_mesh(mesh, folder / three)
        with pytest.raises(BadInput, match=said):
            committed_mesh(stage, folder / three)
        assert "sha256 was" in "".join(found(folder / "mobility3.json")), name
    (folder / three).write_bytes(b"PK\x03\x04 no archive")
    assert "expected a committed mesh" in found(folder / "mobility3.json")[0]
    (folder / three).unlink()
    assert ": nodes is gone" in found(folder / "mobility3.json")[0]


def test_a_baseline_that_was_tampered_with_fails(project):
    path = project.path("tests/baselines/fig6.json")
    original = json.loads(path.read_text())

    def lines_after(change):
        data = copy.deepcopy(original)
        change(data)
        path.write_text(json.dumps(data))
        return found(path)[0]

    assert "not a baseline" in lines_after(lambda data: data.update(allowed=1e6))
    assert "not a baseline" in lines_after(lambda data: data["source"].update(allowed=1e6))
    assert "not a baseline" in lines_after(lambda data: data.pop("source"))
    assert "is new: 8" in lines_after(lambda data: data["source"]["inputs"]["fig6.toml"].pop("resolution"))
    assert "nodes is new: " in lines_after(lambda data: data["source"].update(meshes={}))
    assert "is new: 2" in lines_after(lambda data: data["source"].update(settings={}))
    assert "the baseline of a stage, but" in lines_after(lambda data: data.update(kind="stage"))
    assert "not a baseline: history" in lines_after(lambda data: data.update(history=[]))
    assert "not a baseline: history.0.reason" in lines_after(lambda data: data["history"][0].update(reason=" "))
    assert "its input is gone" in lines_after(lambda data: data.update(file="../../cases/fig8.toml"))
    assert "expected the name fig5.json" in lines_after(lambda data: data.update(file="../../cases/fig5.toml"))
    for text in ("", "{", "[]", '{"case": "fig5"}', "\x00"):
        path.write_text(text)
        assert "not a baseline" in found(path)[0] and "\n" not in found(path)[0]


def test_a_deleted_or_added_value_is_new_or_gone():
    accepted = {"check": {"kept": 1.5, "gate": {"allowed": 1e6}}}
    lines = [
        str(each)
        for each in gates.moves("s", accepted, {"check": {"kept": 1.5, "stress": [2.5, None]}}, rule_of=rule_of)
    ]
    assert lines == [
        "s: check.gate.allowed is gone, was 1000000",
        "s: check.stress[0] is new: 2.5",
        "s: check.stress[1] is new: none",
    ]


def test_a_line_says_was_is_moved_allowed_and_the_unit():
    accepted = {"budget": {"split": {"y": {"shares": [{"name": "none", "points": {"y": 14.0}}]}}}}
    now = {"budget": {"split": {"y": {"shares": [{"name": "none", "points": {"y": 14.25}}]}}}}
    (line,) = map(str, gates.moves("s", accepted, now, rule_of=rule_of))
    start, _, end = line.partition(", allowed ")
    assert start == "s: budget.split.y.shares[0].points.y was 14, is 14.25, moved +0.25"
    assert end.endswith(" percentage points") and float(end.split()[0]) < 1.0
    now["budget"]["split"]["y"]["shares"][0]["name"] = "other"
    assert "shares[0].name was none, is other" in str(gates.moves("s", accepted, now, rule_of=rule_of)[0])


def test_sentences_may_differ_in_last_places_only():
    def moved(was, now):
        wrap = [{"budget": {"warnings": [text]}} for text in (was, now)]
        return bool(gates.moves("s", *wrap, rule_of=rule_of))

    assert not moved("errors of x 12.536 %, at most 4e-12 % across", "errors of x 12.537 %, at most 9e-13 % across")
    assert moved("errors of x 12.536 %", "errors of x 12.546 %")
    assert moved("errors of x 12.536 %", "errors of y 12.536 %")
    assert moved("at most 4e-12 % across", "at most 4e-04 % across")


def test_a_case_beside_the_others_without_a_baseline_is_said(project, flexfem):
    folder = project.path("tests/baselines")
    (folder / "fig7.json").unlink()
    case = project.path("cases/fig7.toml")
    (line,) = (line for line in regression.unaccepted(folder) if "fig7" in line)
    assert line == f"{case}: no baseline in {folder}; flexfem baseline {case} --baselines {folder} --reason TEXT"
    project.path("cases/fig6.toml").unlink()
    code, out, _ = flexfem("regression", folder / "fig6.json")
    assert (code, out.splitlines()[0]) == (
        1,
        f"{folder / 'fig6.json'}: its input is gone: {project.path('cases/fig6.toml')}",
    )
    code, out, err = flexfem("regression", project.path("geometry"))
    assert (code, out) == (2, "") and "no baselines in this folder" in err


def test_a_baseline_is_accepted_beside_its_case_or_where_told_and_keeps_its_reasons(project, flexfem, tmp_path):
    text = project.path("cases/fig6.toml").read_text().replace("points = 21", "points = 3\nresolution = 4")
    case = project.path("cases/mine.toml")
    case.write_text(text.partition('[[curve]]\nlabel = "mobility six"')[0])
    before = sorted(project.folder.rglob("*"))
    code, out, _ = flexfem("baseline", case, "--reason", "  thicker necks wanted ")
    assert (code, out.strip()) == (0, str(case.parent / "baselines/mine.json"))
    made = sorted(str(path.relative_to(project.folder)) for path in set(project.folder.rglob("*")) - set(before))
    assert [name.partition("-")[0] for name in made] == [
        "cases/baselines",
        "cases/baselines/mine.json",
        "cases/baselines/mobility3",
    ]
    data = json.loads((case.parent / "baselines/mine.json").read_text())
    path = ("result", "models", "mobility three", "neck_stress")
    at(data["record"], path)[0][1] *= 1.01
    (case.parent / "baselines/mine.json").write_text(json.dumps(data))
    code, out, _ = flexfem("verify", "--check", case, "--output", tmp_path, "--json")
    (finding,) = json.loads(out)["findings"]
    assert (
        code == 1 and finding["name"] == "result.models.mobility three.neck_stress[0][1]" and finding["unit"] == "MPa"
    )
    code, _, err = flexfem("baseline", case, "--reason", " ")
    assert code == 2 and "--reason is empty" in err
    other = project.path("geometry/mine.toml")
    other.write_text(project.path("geometry/mobility3.toml").read_text())
    code, out, err = flexfem("baseline", other, "--reason", "x", "--baselines", case.parent / "baselines")
    assert (code, out) == (2, "") and "is the baseline of another file" in err
    assert [entry["reason"] for entry in data["history"]] == ["thicker necks wanted"]


def test_every_acceptance_keeps_its_reason(tmp_path):
    """A chart is accepted without a mesh; the reasons of before stay, in their order."""
    chart = ROOT / "flexfem/data/thickness_chart.json"
    for reason in (" first ", "second"):
        written = public.baseline(chart, reason=reason, baselines=tmp_path)
        assert written == [tmp_path / "thickness_chart.json"]
    assert [each.reason for each in store.read_baseline(written[0]).history] == ["first", "second"]
    (checked,) = public.regression(*written)
    assert (checked.name, checked.findings) == ("thickness_chart", [])


def test_files_that_cannot_all_be_accepted_are_refused_from_python_too(tmp_path):
    """All are looked at before the first is accepted."""
    stage = tmp_path / "geometry.toml"
    other = stage.with_suffix(".json")
    for path in (stage, other):
        path.write_text((ROOT / "geometry/mobility3.toml").read_text())
    for wrong, files, reason in (
        ("reason is empty", [stage], " "),
        ("reason is empty", [stage], None),
        ("3, expected the path", [stage, 3], "x"),
        ("no such file", [stage, tmp_path / "none.toml"], "x"),
        ("is the baseline of another file", [stage, other], "x"),
    ):
        with pytest.raises(BadInput, match=wrong):
            public.baseline(*files, reason=reason)
    with pytest.raises(BadInput, match="3, expected the path"):
        public.regression(3)
    assert not list(tmp_path.rglob("baselines"))


def test_patterns_name_places_by_keys_beginnings_and_numbers():
    path = ("a", "band_x", 2, "c")
    for pattern in ("a band_x 2 c", "a * # c", "a band_* # *", "a band_x **", "a **", "**"):
        assert gates.matches(tuple(pattern.split()), path), pattern
    for pattern in ("b band_x 2 c", "a cross_* # c", "a band_x 3 c", "a band_x #", "a x **", "a b **", "a band_x * c"):
        assert not gates.matches(tuple(pattern.split()), path), pattern


def test_a_file_of_numbers_elsewhere_is_no_chart_of_flexfem(tmp_path):
    (tmp_path / "hinge_chart.json").write_text('{"a": 1.0}')
    with pytest.raises(BadInput, match="this is JSON"):
        store.kind_of(tmp_path / "hinge_chart.json")
