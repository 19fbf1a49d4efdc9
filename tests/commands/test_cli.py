"""The command line as people and machines use it: what it prints, what it writes, how it refuses."""

from __future__ import annotations

import importlib.metadata
import json
import re
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest

from flexfem.arrays import without_round_off
from flexfem.verify import protocol

from ..conftest import stored

ROOT = Path(__file__).parents[2]
STAGE = str(ROOT / "geometry/mobility6.toml")


@pytest.fixture
def coarsely(monkeypatch):
    """Stages are solved on half the resolution that is asked for: what is tested does not depend on it."""
    solve = protocol.solve_stage
    monkeypatch.setattr(protocol, "solve_stage", lambda stage, resolution: solve(stage, resolution // 2))


def machine(flexfem, *arguments):
    code, out, _ = flexfem(*arguments, "--json")
    assert code == 0
    return json.loads(out)


def test_what_symmetry_makes_zero_is_printed_as_zero_and_kept_in_json(flexfem):
    """Off the diagonals of K and C of the alike chains, and Y and theta under a force in X."""
    for command in (("stiffness", STAGE), ("solve", STAGE, "--resolution", 2, "--force", 3, 0, 0)):
        raw = np.array(machine(flexfem, *command)["stiffness"])
        lines = [line.split() for line in flexfem(*command)[1].splitlines()]
        heads = [k for k, line in enumerate(lines) if line[-3:] == ["(x,", "y,", "theta)"]]
        for head in heads:
            shown = np.array(lines[head + 1 : head + 4], dtype=float)
            np.testing.assert_array_equal(shown != 0, np.eye(3, dtype=bool))
        assert len(heads) == 2 and np.count_nonzero(raw - np.diag(np.diag(raw))) >= 4
    (moved,) = (line for line in lines if line[0] == "displacement")
    assert float(moved[1]) > 0 and [float(each) for each in moved[2:4]] == [0, 0]


def test_no_more_than_round_off_is_printed_as_zero():
    K = np.array([[4.0, 5e-11, 1e-7], [3e-12, 9.0, 2e-8], [1e-8, -4e-8, 1e8]])  # sizes 6, 2e4 and 3e4
    kept = [[4.0, 5e-11, 1e-7], [0.0, 9.0, 0.0], [0.0, -4e-8, 1e8]]
    np.testing.assert_array_equal(without_round_off(K), kept)


def test_stiffness_and_compliance_are_inverse_and_in_the_stated_order(flexfem):
    facts = machine(flexfem, "stiffness", STAGE, "--mobility", 21)
    assert facts["mobility"] == 21
    np.testing.assert_allclose(np.array(facts["stiffness"]) @ facts["compliance"], np.eye(3), atol=1e-9)
    assert facts["stiffness"][2][2] > 100 * facts["stiffness"][0][0]  # N mm/rad against N/mm


def test_more_freedoms_soften_the_stage_in_every_direction(flexfem):
    found = [np.array(machine(flexfem, "stiffness", STAGE, "--mobility", n)["stiffness"]) for n in (3, 6, 12, 21)]
    for fewer, more in pairwise(found):
        assert np.all(np.diag(fewer) > (1 + 1e-7) * np.diag(more))
        assert np.linalg.eigvalsh(fewer - more).min() > -1e-9 * fewer[2][2]


def test_displacement_is_compliance_times_force(flexfem):
    facts = machine(flexfem, "solve", STAGE, "--resolution", 2, "--force", 1.5, -2, 30)
    np.testing.assert_allclose(np.array(facts["compliance"]) @ [1.5, -2, 30], facts["displacement"], rtol=1e-12)
    np.testing.assert_allclose(facts["reaction"], [-1.5, 2, -30], rtol=1e-9)
    assert facts["force"] == [1.5, -2, 30]
    (said,) = facts["warnings"]
    assert "+10 % in x, +10 % in y, +10 % in theta" in said and "--three-dimensional" in said
    assert facts["unknowns"] > 1000


UNLIKE = '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.43\n'


def test_a_displacement_takes_the_force_that_holds_it(flexfem, project):
    """Of a stage with coupling."""
    unlike = project.edit("geometry/mobility6.toml", ("[platform]\n", f"{UNLIKE}\n[platform]\n"))
    held = machine(flexfem, "solve", unlike, "--resolution", 2, "--displacement", 0.01, -0.02, 3e-4)
    assert abs(held["stiffness"][0][2]) > 10.0
    np.testing.assert_allclose(held["displacement"], [0.01, -0.02, 3e-4], rtol=1e-9)
    np.testing.assert_allclose(np.array(held["stiffness"]) @ [0.01, -0.02, 3e-4], held["force"], rtol=1e-9)
    assert held["force"][0] > 0 > held["force"][1] and np.min(held["neck_stress"]) > 0


def test_a_summary_is_what_finite_elements_say(flexfem, project):
    """Ranges within 2 % on a coarse mesh; stiffness as `stiffness`, and the force is stiffness times range."""
    facts = machine(flexfem, "summary", STAGE, "--resolution", 4)
    linked = machine(flexfem, "stiffness", STAGE)["stiffness"]
    np.testing.assert_allclose(facts["analytic"]["stiffness"], linked, rtol=1e-12)
    more = [facts["thickness"][axis] for axis in ("x", "y", "theta")]
    plane = np.array(machine(flexfem, "stiffness", STAGE, "--links", "--formula", "calibrated")["stiffness"])
    np.testing.assert_allclose(np.diag(linked), np.diag(plane) * (1 + np.array(more) / 100), rtol=1e-12)
    np.testing.assert_allclose(more, [10.33, 10.33, 10.30], atol=0.02)
    same = project.edit("geometry/mobility6.toml", ("thickness_mm = 10.0", 'thickness_mm = 10\nmodel = "plane_stress"'))
    flat = machine(flexfem, "summary", same, "--resolution", 4)
    for k, axis in enumerate(("x", "y", "theta")):
        analytic, elements = facts["analytic"]["limits"][axis], flat["elements"]["limits"][axis]
        assert flat["analytic"]["limits"][axis]["range_at_yield"] == pytest.approx(elements["range_at_yield"], rel=0.02)
        assert analytic["hinge"] == elements["hinge"] == ("platform" if axis == "theta" else "elbow")
        assert analytic["force"][axis] == pytest.approx(linked[k][k] * analytic["range_at_yield"], rel=1e-12)
        assert analytic["stress"] * analytic["range_at_yield"] == pytest.approx(503.0, rel=1e-12)
    assert facts["warnings"] == [] and facts["not_stated"] == [] and len(facts["assumed"]) == 17
    reached = facts["drive"]["ranges"]
    assert 1e3 * reached["x"]["held"]["high"] == pytest.approx(24.03, rel=3e-4)
    assert 1e3 * reached["y"]["free"]["low"] == pytest.approx(-27.28, rel=3e-4)
    assert set(facts["drive"]["assumed"]) > set(facts["assumed"])


def test_a_summary_for_people_is_in_the_units_it_names(flexfem, project):
    out = flexfem("summary", STAGE)[1]
    assert re.search(r"x +41\.90\d N/mm +±641\.\d um +26\.8\d N +0\.784\d MPa/um +elbow hinge, chain 3", out)
    assert re.search(r"theta +4545\d N mm/rad +±28\.\d+ mrad +129\d N mm +17\.6\d MPa/mrad", out)
    assert re.search(r"x +-24\.03 to 24\.03 um +-28\.6 to 28\.6 um +stroke: elbow, chain 1, longest \| base,", out)
    thin = project.edit("geometry/mobility6.toml", ("neck_mm = 0.5\nprismatic", "neck_mm = 0.05\nprismatic"))
    out = flexfem("summary", thin)[1]
    assert "analytic, paros-weisbord, elastic links, plane stress" in out
    assert "warning: hinges.base.neck_mm = 0.05: t/R = 0.0125 is not on the hinge chart" in out


KINDS = {
    "geometry/mobility6.toml": ("stage file", ["check"]),
    "cases/fig5.toml": ("case file", ["verify"]),
    "cases/study-reach.toml": ("study file", ["study", "status"]),
    "fig5.json": ("result of flexfem verify", ["plot"]),
}


def test_a_file_of_another_kind_is_named_as_what_it_is(flexfem, tmp_path):
    (tmp_path / "fig5.json").write_text('{"case": "fig5", "curves": {}}')
    for name, (found, _) in KINDS.items():
        path = tmp_path / name if name.endswith("json") else ROOT / name
        for expected, command in KINDS.values():
            if found != expected:
                said = "this is JSON" if name.endswith("json") else f"this is a {found}, expected a {expected}"
                code, out, err = flexfem(*command, path)
                assert (code, out) == (2, "") and said in err and err.count("\n") == 1, (name, command)
    (tmp_path / "other.json").write_text('{"split": {}}')
    assert "this is JSON, but not a result of flexfem verify" in flexfem("plot", tmp_path / "other.json")[2]
    assert "fig5.json: has no digest" in flexfem("plot", tmp_path / "fig5.json")[2]


def test_the_version_is_said(flexfem):
    assert flexfem("--version") == (0, f"flexfem {importlib.metadata.version('flexfem')}\n", "")


def test_every_make_target_that_a_page_names_exists():
    makefile = (ROOT / "Makefile").read_text()
    targets = re.findall(r"^([a-z-]+):", makefile, re.MULTILINE)
    assert targets[0] == "install"  # what plain make does
    pages = [*ROOT.glob("*.md"), *ROOT.glob("*/*.md"), ROOT / "pyproject.toml", ROOT / "Makefile"]
    named = {name for page in pages for name in re.findall(r"(?:`|    )make ([a-z][a-z-]+)", page.read_text())}
    assert {"test-all", "reproduce-figures"} <= named <= set(targets)


@pytest.mark.parametrize("suffix", [".msh", ".vtu", ".inp"])
def test_written_meshes_hold_the_whole_stage(flexfem, suffix, tmp_path):
    path = tmp_path / f"stage{suffix}"
    facts = machine(flexfem, "mesh", STAGE, "-o", path, "--resolution", 2)
    if suffix == ".inp":
        text = path.read_text()
        assert text.upper().count("*STEP") == 3
        assert "CPS6" in text.upper()
        return
    mesh = meshio.read(path)
    assert len(mesh.points) == facts["nodes"]
    assert sum(len(block.data) for block in mesh.cells if block.type == "triangle6") == facts["triangles"]
    if suffix == ".msh":
        assert set(mesh.field_data) == {"stage", "ground", "hub"}
        hub = mesh.cell_sets_dict["hub"]["line3"]
        lines = np.concatenate([block.data for block in mesh.cells if block.type == "line3"])
        assert len(hub) > 0
        np.testing.assert_allclose(np.hypot(*mesh.points[lines[hub]].reshape(-1, 3)[:, :2].T), 8.0, atol=1e-9)


def test_a_field_file_holds_the_displacement_of_the_load(flexfem, tmp_path):
    path = tmp_path / "stage.vtu"
    facts = machine(flexfem, "solve", STAGE, "--resolution", 2, "--force", 1, 0, 0, "--vtu", path)
    grid = meshio.read(path)
    hub = grid.point_data["hub"] == 1
    ux = grid.point_data["displacement"][hub, 0] + facts["displacement"][2] * grid.points[hub, 1]
    np.testing.assert_allclose(ux, facts["displacement"][0], rtol=1e-9)
    assert np.max(np.abs(grid.point_data["displacement"][grid.point_data["ground"] == 1])) == 0.0


@pytest.mark.usefixtures("coarsely")
def test_verify_prints_and_stores_the_same_result_and_says_that_numbers_are_assumed(flexfem, tmp_path):
    five, six = ROOT / "cases/fig5.toml", ROOT / "cases/fig6.toml"
    out = flexfem("verify", five, "--output", tmp_path)[1]
    alone = stored(tmp_path / "fig5.json")
    listed = len(alone["assumed"])  # of the case, too: `check` reads stages alone
    counted = "(2 of the case, 17 of geometry and material)"
    assert f"{listed} of these numbers are assumed {counted}: --json lists them" in out
    assert alone["direction"] == "x"
    for label, curve in alone["curves"].items():
        largest = alone["commanded"][-1]
        assert alone["error_percent"][label]["x"] == pytest.approx(100 * curve["x"][-1] / largest, rel=1e-12)
        assert len(curve["theta"]) == len(alone["commanded"]) == 21
    several = machine(flexfem, "verify", five, six, "--output", tmp_path)
    assert [result["case"] for result in several] == ["fig5", "fig6"]
    assert several == [stored(tmp_path / f"{name}.json") for name in ("fig5", "fig6")]
    dated = {"seconds": 0, "written": ""}
    assert several[0] | dated == alone | dated


@pytest.mark.usefixtures("coarsely")
def test_an_edited_stage_is_said_by_key_and_exits_with_one(flexfem, project, tmp_path):
    stage = project.edit("geometry/mobility6.toml", ("\nneck_mm = 0.5", "\nneck_mm = 0.5005"))
    command = ("verify", project.path("cases/fig6.toml"), "--check", "--baselines", project.path("tests/baselines"))
    code, out, _ = flexfem(*command, "--output", tmp_path)
    assert code == 1
    assert out.splitlines()[0] == f"the input changed: {stage}: hinges.base.neck_mm was 0.5, is 0.5005"
    assert out.splitlines()[-1] == "checked fig6: 3 not as accepted"  # three necks


def test_check_tells_where_every_number_comes_from(flexfem):
    code, out, _ = flexfem("check", STAGE)
    assert code == 0
    assert "mobility 6" in out
    for key in ("chain.link_lengths_mm", "hinges.base.neck_mm", "material.youngs_modulus_gpa"):
        assert f"{key}: assumed" in out
    assert machine(flexfem, "check", STAGE)["mobility"] == 6


def test_every_table_for_people_says_that_numbers_are_assumed(flexfem):
    for command in (["stiffness", STAGE], ["solve", STAGE, "--resolution", 2], ["check", STAGE]):
        assert "assumed" in flexfem(*command)[1]


def test_nothing_is_said_of_the_paper_where_a_file_of_ones_own_is_assumed(flexfem, tmp_path):
    text = Path(STAGE).read_text().partition("[provenance]")[0].replace("reference", "of my own")
    (tmp_path / "own.toml").write_text(f'{text}[provenance]\n"platform.radius_mm" = "assumed"\n')
    for command, said in (
        ("check", "assumed: platform.radius_mm"),
        ("stiffness", "1 of these numbers is assumed (1 of"),
    ):
        out = flexfem(command, tmp_path / "own.toml")[1]
        assert said in out and "paper" not in out


def test_meshing_says_what_was_written(flexfem, tmp_path):
    code, out, _ = flexfem("mesh", STAGE, "-o", tmp_path / "stage.vtu", "--resolution", 2)
    assert code == 0 and f"written: {tmp_path / 'stage.vtu'}" in out


BROKEN = {
    "no such file": ("", None, "no such file"),
    "not TOML": ("name", "name = = ", "not TOML"),
    "a word for a number": ("thickness_mm = 10.0", 'thickness_mm = "ten"', "expected a number"),
    "negative neck": ("neck_mm = 0.5", "neck_mm = -0.5", "expected > 0"),
    "zero radius": ("radius_mm = 1.5", "radius_mm = 0", "expected > 0"),
    "nan": ("thickness_mm = 10.0", "thickness_mm = nan", "finite"),
    "infinite": ("link_width_mm = 9.0", "link_width_mm = inf", "link_width_mm"),
    "missing table": ("[platform]", "[plattform]", "platform"),
    "unknown key": ("thickness_mm", "thickness_cm", "thickness_cm"),
    "two link lengths": ("[30.0, 32.0, 24.0]", "[30.0, 32.0]", "link_lengths_mm"),
    "rubber without volume change": ("poissons_ratio = 0.33", "poissons_ratio = 0.5", "poissons_ratio"),
    "provenance of nothing": ("[provenance]", '[provenance]\n"chain.colour" = "red"', "chain.colour"),
    "chain four": ("[provenance]", '[[override]]\nchain = 4\nhinge = "base"\nneck_mm = 1\n[provenance]', "chain"),
    "override of nothing": ("[provenance]", '[[override]]\nchain = 2\nhinge = "base"\n[provenance]', "override"),
    "notch deeper than the link": ("radius_mm = 4.0", "radius_mm = 6.0", "notch deeper than the link"),
    "override deeper than the link": (
        "[provenance]",
        '[[override]]\nchain = 3\nhinge = "elbow"\nradius_mm = 5\n[provenance]',
        "override.3.elbow.radius_mm",
    ),
    "hinges too close": ("[30.0, 32.0, 24.0]", "[5.0, 32.0, 24.0]", "closer than their radii"),
    "no room for link 2": ("[30.0, 32.0, 24.0]", "[30.0, 12.0, 24.0]", "no strip 9 mm wide"),
    "hub larger than platform": ("hub_radius_mm = 8.0", "hub_radius_mm = 17.5", "hub larger than the platform"),
    "platform swallows a hinge": ("\nradius_mm = 17.0", "\nradius_mm = 23.0", "swallows"),
    "chain folded onto the platform": ("[180.0, -90.0, 90.0]", "[180.0, -90.0, 170.0]", "swallows"),
    "folded link": ("[180.0, -90.0, 90.0]", "[180.0, -179.0, 90.0]", "expected"),
    "neck as wide as a finger": ("neck_mm = 0.5", "neck_mm = 20", "neck as wide as the link"),
    "dust": ("neck_mm = 0.5", "neck_mm = 1e-12", "unit mistake"),
    "a planet": ("thickness_mm = 10.0", "thickness_mm = 1e30", "thickness_mm"),
    "chains across one another": (
        "[30.0, 32.0, 24.0]      # l1 base-elbow, l2 elbow-platform hinge, l3 platform hinge-centre\n"
        "joint_angles_deg = [180.0, -90.0, 90.0]",
        "[130.0, 32.0, 24.0]\njoint_angles_deg = [0.0, 90.0, 90.0]",
        "overlap",
    ),
}


def test_a_stage_that_cannot_be_is_refused_in_one_line_and_nothing_is_written(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    text = path.read_text()
    asked = [["check", path], ["solve", path, "--vtu", "out.vtu"], ["mesh", path, "-o", "out.msh"]]
    for number, (name, (old, new, said)) in enumerate(BROKEN.items()):
        path.write_text(text)
        if new is None:
            path.unlink()
        else:
            project.edit("geometry/mobility6.toml", (old, new))
        for command in asked[number % 3 : number % 3 + 1]:  # all read a stage by one function
            code, out, err = flexfem(*command)
            assert (code, out) == (2, ""), name
            assert err.count("\n") == 1 and err.startswith("flexfem: "), (name, err)
            assert path.name in err and said in err, (name, err)
    assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["solve", STAGE, "--force", "nan", "0", "0"],
        ["solve", STAGE, "--vtu", "field.txt"],
        ["solve", STAGE, "--displacement", "0", "inf", "0"],
        ["solve", STAGE, "--force", "1", "0", "0", "--displacement", "1", "0", "0"],
        ["summary", STAGE, "--formula", "guess"],
        ["budget", STAGE, "--amplitude-mrad", "nan"],
        ["solve", STAGE, "--force", "one", "0", "0"],
        ["solve", STAGE, "--resolution", "1"],
        ["mesh", STAGE, "-o", "stage.stl"],
        ["mesh", STAGE, "-o", "none/stage.msh"],
        ["solve", STAGE, "--vtu", "none/field.vtu"],
        ["solve", STAGE, "--three-dimensional", "--vtu", "none/field.vtu"],
        ["study", "collect", ROOT / "cases/study-reach.toml", "--to", "none/reach.csv"],
        ["stiffness", STAGE, "--mobility", "4"],
        ["stiffness", STAGE, "--formula", "guess"],
        ["verify", STAGE],
        ["verify", ROOT / "cases/fig5.toml", ROOT / "cases/../cases/fig5.toml"],
        ["verify", ROOT / "cases/fig5.toml", "--check", "--baselines", "nowhere"],
        ["baseline", ROOT / "cases/fig5.toml", "--reason", " ", "--baselines", "."],
        ["plot", STAGE],
        ["plot", "nowhere.json"],
        ["polish", STAGE],
    ],
    ids=lambda arguments: " ".join(Path(str(argument)).name for argument in arguments),
)
def test_a_wrong_option_exits_with_two_and_writes_nothing(flexfem, arguments):
    code, out, err = flexfem(*arguments)
    assert code == 2
    assert out == ""
    assert "Traceback" not in err and err.strip()
    assert list(Path.cwd().iterdir()) == []


def test_a_folder_that_takes_no_file_is_one_line(flexfem, tmp_path):
    (tmp_path / "taken").write_text("a file, not a folder")
    code, _, err = flexfem("verify", ROOT / "cases/fig5.toml", "--output", tmp_path / "taken")
    assert code == 2
    assert err.count("\n") == 1 and err.startswith("flexfem: ") and "is a file, expected a folder" in err


@pytest.mark.usefixtures("unrendered")
def test_a_mesh_study_is_stored_and_drawn(flexfem, tmp_path):
    levels = ["--level", 2, "--level", 3, "--level", 4]
    facts = machine(flexfem, "converge", STAGE, *levels, "--output", tmp_path)
    assert facts["resolutions"] == [2, 3, 4]
    assert facts["unknowns"] == sorted(facts["unknowns"])
    assert stored(tmp_path / "mobility6-convergence.json") == facts
    assert (tmp_path / "mobility6-convergence.png").read_bytes() == b"png"
    finest = facts["compliance"][-1][0][0]
    assert abs(facts["uncertainty"]["x"]["extrapolated"] / finest - 1) < 0.01
    code, _, err = flexfem("converge", STAGE, "--level", 4, "--level", 5)
    assert code == 2 and "three or more" in err


@pytest.mark.slow
@pytest.mark.usefixtures("coarsely", "unrendered")
def test_a_budget_is_stored_and_drawn(flexfem, tmp_path):
    amplitudes = ("--amplitude-um", 120, "--amplitude-mrad", 3)
    facts = machine(flexfem, "budget", STAGE, *amplitudes, "--plane", "--output", tmp_path)
    assert {axis: split["amplitude"] for axis, split in facts["split"].items()} == {
        "x": 0.12,
        "y": 0.12,
        "theta": 0.003,
    }
    assert (tmp_path / "mobility6-budget.png").read_bytes() == b"png"
    assert "hinge formula" in (tmp_path / "mobility6-budget.json").read_text()


def test_formulas_name_their_sources(flexfem):
    facts = machine(flexfem, "formulas")
    assert {"paros-weisbord", "calibrated", "koster"} <= set(facts)
    assert all(fact["source"] and fact["freedoms"] for fact in facts.values())


def test_names_with_markup_are_printed_as_they_are(flexfem, project):
    path = project.edit("geometry/mobility6.toml", ('name = "mobility six, reference"', 'name = "[red]x[/b] $y$"'))
    for command in ("check", "stiffness"):
        code, out, _ = flexfem(command, path)
        assert code == 0 and "[red]x[/b] $y$" in out


def test_a_hinge_off_the_chart_is_named_with_file_and_line(flexfem, project):
    path = project.edit("geometry/mobility6.toml", ("neck_mm = 0.5\nprismatic", "neck_mm = 0.05\nprismatic"))
    code, out, err = flexfem("stiffness", path, "--formula", "calibrated")
    assert (code, out) == (2, "")
    assert "mobility6.toml, line 22: hinges.base.neck_mm = 0.05" in err


def test_a_wrong_value_in_a_curve_is_named_itself(flexfem, project):
    path = project.edit("cases/fig5.toml", ("mobility = 6", "mobility = 7"))
    code, _, err = flexfem("verify", path)
    assert code == 2 and "curve[1].mobility = 7, expected 3, 6, 12 or 21" in err


def test_links_soften_the_stage_and_go_with_all_freedoms(flexfem):
    rigid = machine(flexfem, "stiffness", STAGE, "--mobility", 21, "--formula", "calibrated")
    elastic = machine(flexfem, "stiffness", STAGE, "--links", "--formula", "calibrated")
    assert elastic["mobility"] == 21
    for k in range(3):
        assert 0.99 < elastic["stiffness"][k][k] / rigid["stiffness"][k][k] < 1.0
    np.testing.assert_allclose(np.array(elastic["stiffness"]) @ elastic["compliance"], np.eye(3), atol=1e-9)
    code, _, err = flexfem("stiffness", STAGE, "--links", "--mobility", 6)
    assert code == 2 and "--links" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("stiffness", STAGE, "--formla", "koster"), ["--formla", "--formula", "(see flexfem stiffness --help)"]),
        (("--bogus",), ["--bogus", "(see flexfem --help)"]),
        (("stiffness",), ["'STAGE'", "(see flexfem stiffness --help)"]),
        (("drive", STAGE), ["'--pose'", "(see flexfem drive --help)"]),
        (("drive", STAGE, "--pose", "1", "2"), ["--pose", "3 arguments"]),
        (("stifness", STAGE), ["'stifness'", "Did you mean 'stiffness'?", "(see flexfem --help)"]),
        (("study", "rn"), ["'rn'", "Did you mean 'run'?", "(see flexfem study --help)"]),
        (("stiffness", STAGE, "--mobility", "six"), ["'--mobility'", "integer"]),
        (("stiffness", STAGE, "no.toml"), ["no.toml"]),
    ],
)
def test_a_wrong_command_line_is_refused_in_one_line(flexfem, arguments, said):
    code, out, err = flexfem(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("flexfem: ")
    assert [part for part in said if part not in err] == []


def test_a_command_without_arguments_shows_its_help(flexfem):
    for arguments, commands in (((), ("stiffness", "study")), (("study",), ("run", "collect"))):
        code, _, err = flexfem(*arguments)
        assert code == 2 and "Usage: flexfem" in err
        assert all(f"\n  {name} " in err for name in commands)
