"""The command line as people and machines use it: what it prints, what it writes, how it refuses."""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
from io import StringIO
from pathlib import Path

import meshio
import numpy as np
import pytest
from rich.console import Console

from flexfem import sources
from flexfem.commands import cli
from flexfem.commands.catalogue import COMMANDS
from flexfem.commands.console import print_tables
from flexfem.mechanism.profiles import SHAPES
from flexfem.paper.case import LoadedCase
from flexfem.paper.stage import load_feasible
from flexfem.results import Result, TextTable

from .conftest import COMMAND_OF
from .tolerances import SOLVED

ROOT = Path(__file__).parents[1]
STAGE = str(ROOT / "geometry/mobility6.toml")
HOSTILE = 'a "b" <i>&amp; $HOME #1.toml'


def machine(flexfem, *arguments):
    code, out, err = flexfem(*arguments, "--json")
    assert code == 0, err
    return json.loads(out)


def test_the_version_is_said(flexfem):
    assert flexfem("--version") == (0, f"flexfem {importlib.metadata.version('flexfem')}\n", "")


def test_every_option_has_a_help_text_and_every_command_a_summary(flexfem):
    command = COMMAND_OF(cli.app)
    listed = command.list_commands(None)
    assert {"summary", "stiffness", "drift", "verify", "study"} <= set(listed)
    for name, (function, purpose) in COMMANDS.items():
        assert 0 < len(purpose) <= 70, name
        made = command.get_command(None, name)
        assert made.help, name
        if not function:
            continue
        assert all(getattr(each, "help", "") for each in made.params), name


@pytest.mark.parametrize("command", [[], ["stiffness"], ["study"], ["study", "run"], ["design"]])
def test_h_is_help(flexfem, command):
    code, out, err = flexfem(*command, "-h")
    assert (
        (code, err) == (0, "")
        and out.startswith("Usage: ")
        and out == flexfem(*command, "--help")[1]
    )


def test_every_make_target_that_a_page_names_exists():
    makefile = (ROOT / "Makefile").read_text()
    targets = re.findall(r"^([a-z-]+):", makefile, re.MULTILINE)
    assert targets[0] == "install"  # what plain make does
    pages = [*ROOT.glob("*.md"), *ROOT.glob("*/*.md"), ROOT / "pyproject.toml", ROOT / "Makefile"]
    named = {
        name
        for page in pages
        for name in re.findall(r"(?:`|    )make ([a-z][a-z-]+)", page.read_text())
    }
    assert {"test-all", "reproduce-figures"} <= named <= set(targets)


# what is written


@pytest.mark.parametrize("suffix", [".msh", ".vtu", ".inp"])
def test_written_meshes_hold_the_whole_stage(flexfem, suffix, tmp_path):
    path = tmp_path / f"stage{suffix}"
    facts = machine(flexfem, "mesh", STAGE, "-o", path, "--resolution", 2)
    if suffix == ".inp":
        text = path.read_text().upper()
        assert text.count("*STEP") == 3 and "CPS6" in text
        return
    mesh = meshio.read(path)
    assert len(mesh.points) == facts["nodes"]
    assert (
        sum(len(block.data) for block in mesh.cells if block.type == "triangle6")
        == facts["triangles"]
    )
    if suffix == ".msh":
        assert set(mesh.field_data) == {"stage", "ground", "hub"}
        groups = zip(mesh.cells, mesh.cell_data["gmsh:physical"], strict=True)
        (hub,) = (
            block.data[tags == mesh.field_data["hub"][0]]
            for block, tags in groups
            if block.type == "line3"
        )
        np.testing.assert_allclose(
            np.hypot(*mesh.points[hub].reshape(-1, 3)[:, :2].T), 8.0, atol=1e-9
        )


def test_groups_of_a_mesh_can_be_read_whatever_the_names_of_the_parts(flexfem, tmp_path):
    """Names end at quotes, backslashes begin escapes, and readers take at most 128 bytes."""
    text = (ROOT / "geometry/parallelogram.toml").read_text()
    long = 150 * "\u4e2d"
    text = text.replace('"stage"', json.dumps(f"{long}1")).replace(
        '"ground"', json.dumps(f"{long}2")
    )
    text = text.replace('name = "leaf"', "name = 'a\"b\\'").replace('["leaf"]', "['a\"b\\']")
    (tmp_path / "odd.toml").write_text(text)
    machine(flexfem, "mesh", tmp_path / "odd.toml", "-o", tmp_path / "odd.msh", "--resolution", 2)
    groups = meshio.read(tmp_path / "odd.msh").field_data
    clipped = "body " + 38 * "\u4e2d"
    assert list(groups) == [clipped, f"{clipped} 2", "hinge a'b/", "hinge a'b/ 2"]


def test_an_output_that_names_a_file_is_that_picture_or_refused_as_a_folder(
    flexfem, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    guide = ROOT / "geometry/parallelogram.toml"
    assert machine(flexfem, "view", guide, "-o", "picture.png")["written"] == ["picture.png"]
    assert (tmp_path / "picture.png").read_bytes()[:4] == b"\x89PNG"
    for arguments in (
        ["view", guide, "-o", "k.csv"],
        ["study", "status", ROOT / "cases/study-reach.toml", "-o", "k.csv"],
        ["formulas", "-o", "k.pdf"],
    ):
        code, out, err = flexfem(*arguments)
        (name,) = {"k.csv", "k.pdf"} & set(arguments)
        said = (
            "the name of a file, expected the name of a folder: the files in it are named after "
            "the input"
        )
        assert (code, out, err) == (2, "", f"flexfem: {name}: {said}\n")
    assert {each.name for each in tmp_path.iterdir() if each.is_file()} == {"picture.png"}
    assert not any(each.suffix for each in tmp_path.iterdir() if each.is_dir())


def test_an_output_with_an_ending_is_that_file_of_the_result(flexfem, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ["stiffness", ROOT / "geometry/parallelogram.toml", "--models", "analytic", "-o"]
    for ending in ("csv", "json", "html"):
        assert flexfem(*asked, f"k.{ending}")[0] == 0
    head, *rows = (tmp_path / "k.csv").read_text().splitlines()
    columns = head.split(",")
    assert (columns[0], columns[-3:]) == ("quantity", ["value", "band", "unit"])
    found = Result.read(tmp_path / "k.json")
    (cell,) = [
        row.split(",")
        for row in rows
        if row.startswith("stiffness,") and row.split(",")[1:3] == ["x", "theta"]
    ]
    assert float(cell[-3]) == pytest.approx(found.at("stiffness", component="x")[0, 2], rel=1e-11)
    assert cell[-1] == "N" and cell[-2] == ""
    assert "other directions free" in (tmp_path / "k.html").read_text()
    assert sorted(tmp_path.glob("k*")) == [tmp_path / f"k.{e}" for e in ("csv", "html", "json")]


def test_matrices_and_other_details_are_printed_with_all_only(flexfem):
    asked = ["stiffness", ROOT / "geometry/parallelogram.toml", "--models", "analytic"]
    code, brief, _ = flexfem(*asked)
    assert code == 0 and "\nstiffness, other directions free:" in brief
    assert "\ncompliance (" not in brief and "--all also shows: stiffness; compliance;" in brief
    assert (
        brief.count("\nother directions (others): the two directions along which the output") == 1
    )
    assert brief.startswith("stiffness, other directions free (analytic): x ")
    whole = flexfem(*asked, "--all")[1]
    assert "\ncompliance (" in whole and "--all" not in whole
    table = [line for line in brief.splitlines() if "   " in line]
    assert max(map(len, table)) <= 80


def test_the_catalogue_lists_stacks_materials_and_shapes_with_their_keys(flexfem):
    found = machine(flexfem, "catalogue")
    stacks = {stack["name"]: stack for stack in found["stacks"]}
    assert (stacks["AE0505D16"]["stroke_um"], stacks["AE0505D16"]["blocking_force_n"]) == (
        17.4,
        935,
    )
    materials = {each["name"]: each for each in found["materials"]}
    assert materials["al-2024-t4"]["fatigue_strength_exponent"] == -0.102
    assert materials["al-6061-t6"]["fatigue_strength_coefficient_mpa"] is None
    assert (stacks["AE0505D16"]["length_mm"], stacks["AE0505D16"]["mass"]) == (20, "not stated")
    shapes = {each["shape"]: each["keys"] for each in found["hinge_shapes"]}
    assert shapes["circular"] == "neck_mm, radius_mm" and set(shapes) == set(SHAPES)
    assert set(found["sources"]) == {*stacks, *materials}
    printed = flexfem("catalogue")[1]
    tables, sources = printed.split("\nsources:\n")
    assert max(map(len, tables.splitlines())) <= 80 and "Young's" in tables
    assert sources.startswith("AE0203D04, AE0203D08, ") and "\nal-7075-t6: typical, ASM" in sources


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["reach", "-o", "k.vtu"], "k.vtu: no field of finite elements of reach of the drive, "),
        (
            ["stiffness", "--models", "analytic", "-o", "k.png"],
            "k.png: this result has no figure, ",
        ),
        (["reach", "-o", "k.xyz"], "k.xyz: ends in .xyz, expected .csv, .json, .html, .png, "),
        (["stiffness", "-o", "no/k.csv"], "no/k.csv: no folder no, expected an existing folder"),
    ],
)
def test_a_file_that_a_result_cannot_give_is_refused(flexfem, tmp_path, monkeypatch, asked, said):
    monkeypatch.chdir(tmp_path)
    command, *options = asked
    code, out, err = flexfem(command, ROOT / "geometry/xy-stage.toml", *options)
    assert out.startswith("stiffness, ") == ("this result" in said)  # what was computed is shown
    assert code == 2 and err.startswith(f"flexfem: {said}") and err.count("\n") == 1
    assert not any(tmp_path.glob("k*"))


@pytest.mark.filterwarnings("default:the font of figures")
def test_a_character_without_a_glyph_is_said_once_on_one_line(flexfem, tmp_path):
    text = (ROOT / "geometry/parallelogram.toml").read_text()
    (tmp_path / "odd.toml").write_text(text.replace('"parallelogram"', '"\u6587\u4e2d"'))
    code, _, err = flexfem("view", tmp_path / "odd.toml", "-o", tmp_path)
    said = "flexfem: warning: the font of figures has no \u4e2d\u6587: boxes are drawn instead\n"
    assert (code, err) == (0, said)


def test_an_exception_of_the_users_file_that_cannot_be_printed_is_one_line(
    flexfem, tmp_path, monkeypatch
):
    monkeypatch.setenv(sources.WITH, "")
    own = tmp_path / "own.py"
    own.write_text(
        "class Odd(Exception):\n    def __str__(self):\n        raise ValueError\n\n\nraise Odd\n"
    )
    code, _, err = flexfem("--with", own, "check", STAGE)
    said = (
        "Odd: an exception without a printable text, expected Python that registers formulas or "
        "materials"
    )
    assert (code, err) == (2, f"flexfem: {own}, line 6: {said}\n")


def test_a_field_file_holds_the_displacement_of_the_load(flexfem, tmp_path):
    load = ("--models", "elements", "--resolution", 4, "--force", 1, 0, 0)
    facts = machine(flexfem, "stiffness", STAGE, *load, "-o", tmp_path)
    moved = facts["quantities"]["pose"]["values"][0]
    grid = meshio.read(tmp_path / "mobility6-stiffness.vtu")
    hub = grid.point_data["hub"] == 1
    ux = grid.point_data["displacement"][hub, 0] + moved[2] * grid.points[hub, 1]
    np.testing.assert_allclose(ux, moved[0], rtol=SOLVED)
    assert np.max(np.abs(grid.point_data["displacement"][grid.point_data["ground"] == 1])) == 0.0


@pytest.mark.parametrize(
    ("question", "with_units", "plain"),
    [
        (
            "stiffness",
            ["--displacement", "100um", "-5e4nm", "2mrad"],
            ["--displacement", 0.1, -0.05, 0.002],
        ),
        ("stiffness", ["--force", "2N", "-3mN", "0.03Nm"], ["--force", 2, -0.003, 30]),
        ("drive", ["--pose", "5 \u03bcm", "0", "-0.1mrad"], ["--pose", 0.005, 0, -0.0001]),
        ("modes", ["--payload", "100g", "3e-6 kg m²"], ["--payload", 0.1, 3]),
        ("gravity", ["--angle", "-60°", "--payload", "20g"], ["--angle", -60, "--payload", 0.02]),
    ],
)
def test_a_number_with_its_unit_is_the_number_in_the_usual_unit(
    flexfem, question, with_units, plain
):
    one, other = (
        machine(flexfem, question, STAGE, "--models", "analytic", *each)
        for each in (with_units, plain)
    )
    assert one["quantities"] == other["quantities"]


def test_a_new_stage_is_the_reference_stage_with_every_number_assumed(flexfem):
    said = machine(flexfem, "new", HOSTILE, "--case", "--study")
    stem = HOSTILE.removesuffix(".toml")
    assert (
        said["written"]
        == [HOSTILE, f"{stem}-case.toml", f"{stem}-study.toml"]
        == sorted(os.listdir(), key=len)
    )
    made, shipped = (load_feasible(path) for path in (HOSTILE, ROOT / "geometry/mobility6.toml"))
    assert (
        made.hash == shipped.hash
        and made.drive_hash == shipped.drive_hash
        and made.heat_hash == shipped.heat_hash
    )
    assert (
        made.name == "my stage"
        and made.not_stated == ()
        and set(made.assumed) >= set(shipped.assumed)
    )
    case = LoadedCase(Path(said["written"][1]))
    assert [each.hash for each in case.stages.values()] == [made.hash] * 2
    assert said["commands"][-1] == f"flexfem study run '{stem}-study.toml'"


def test_view_says_where_the_picture_is(flexfem, monkeypatch):
    monkeypatch.setattr("flexfem.plot.write.rendered", lambda figure, form: form.encode())
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    code, out, err = flexfem("view", STAGE)
    assert (code, err) == (0, "") and f"{Path(STAGE).stem}-drawing.png" in out
    assert Path(f"{Path(STAGE).stem}-drawing.pdf").stat().st_size


def test_names_with_markup_are_printed_as_they_are(flexfem, project):
    path = project.edit(
        "geometry/mobility6.toml", ('name = "mobility six, reference"', 'name = "[red]x[/b] $y$"')
    )
    for command in (["check", path], ["stiffness", path, "--models", "analytic"]):
        code, out, _ = flexfem(*command)
        assert code == 0 and "[red]x[/b] $y$" in out


@pytest.mark.parametrize("name", ["mobility6", "bridge-amplifier"])
def test_drift_says_first_that_the_coefficient_of_the_frame_is_missing(flexfem, name):
    text = (ROOT / f"geometry/{name}.toml").read_text()
    Path("bare.toml").write_text(
        re.sub(r'^\[frame\].*\n.*\n|^"frame\..*\n', "", text, flags=re.MULTILINE)
    )
    code, out, _ = flexfem("drift", "bare.toml", "--models", "analytic")
    first, *others = out.splitlines()
    assert code == 0 and first.startswith(
        "warning: frame.expansion_um_per_m_k is not stated: the frame is assumed"
    )
    assert "under [frame], for example 12" in first and not any(
        "is not stated: the frame" in line for line in others
    )


# refusals


BROKEN = {  # what is changed and said; what else is refused stands in tests/mechanism
    "no such file": ("", None, "no such file"),
    "dust": ("neck_mm = 0.5", "neck_mm = 1e-12", "unit mistake"),
    "a date": ('"mobility six, reference"', "1979-05-27", "name = 1979-05-27, expected text"),
    "no room for link 2": ("[30.0, 32.0, 24.0]", "[30.0, 12.0, 24.0]", "no strip 9 mm wide"),
    "folded link": ("[180.0, -90.0, 90.0]", "[180.0, -179.0, 90.0]", "expected"),
}


def test_a_stage_that_cannot_be_is_refused_in_one_line_and_nothing_is_written(flexfem, project):
    path = project.path("geometry/mobility6.toml")
    text = path.read_text()
    for name, (old, new, said) in BROKEN.items():
        path.write_text(text.replace(old, new or ""))
        assert path.read_text() != text or not old
        if new is None:
            path.unlink()
        code, out, err = flexfem("check", path)
        assert (code, out) == (2, ""), name
        assert (
            err.count("\n") == 1
            and err.startswith("flexfem: ")
            and path.name in err
            and said in err
        ), (name, err)
    assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["stiffness", STAGE, "--force", "one", "0", "0"], "'--force'"),
        (
            ["stiffness", STAGE, "--displacement", "0", "0", "2mm"],
            "'--displacement': 2mm, expected a number in rad,",
        ),
        (
            ["stiffness", STAGE, "--force", "0", "0", "2N"],
            "or a number with its unit: Nm, Nmm, mNm, uNm",
        ),
        (
            ["stiffness", STAGE, "--displacement", "0", "200", "0"],
            "y = 200 mm, expected at most 132 mm, the size of",
        ),
        (
            ["drive", STAGE, "--pose", "0", "0", "2"],
            "theta = 2 rad, expected at most 1 rad; write 2mrad",
        ),
        (["large", STAGE, "--amplitude", "500"], "amplitude = 500 mm, expected at most 132 mm"),
        (["gravity", STAGE, "--angle", "90mm"], "'--angle': 90mm, expected a number in deg"),
        (
            ["stiffness", STAGE, "--mobility", "six"],
            "'--mobility': six, expected a valid integer (see",
        ),
        (["stiffness", STAGE, "--formla", "koster"], "--formula"),
        (["stiffness", STAGE, "no.toml"], "no.toml"),
        (["stiffness"], "'FILE'"),
        (["stifness", STAGE], "Did you mean 'stiffness'?"),
        (
            ["summary", STAGE, "--models", "none"],
            "'--models': none, expected one of 'both', 'analytic', 'elements'",
        ),
        (
            ["drive", STAGE, "--models", "elements"],
            "'--models': elements, expected one of 'both', 'analytic' (see",
        ),
        (
            ["design", "none.toml", "--workers", "0"],
            "'--workers': 0, expected a number greater than or equal to 1",
        ),
        (["life", STAGE], "'--amplitude'"),
        (
            ["converge", STAGE, "--resolutions", "2", "4"],
            "resolutions [2, 4], expected three or more",
        ),
        (["mesh", STAGE, "-o", "stage.stl"], "stage.stl"),
        (["mesh", STAGE, "-o", "none/stage.msh"], "no folder none"),
        (["verify", STAGE], "expected a case file"),
        (["study", "rn"], "Did you mean 'run'?"),
        (["--bogus"], "--bogus"),
        (
            ["stiffness", STAGE, "--layers", "3"],
            "--layers: this option is now: --solid with --thickness-resolution N",
        ),
        (
            ["modes", STAGE, "--layers=4"],
            "--layers: this option is now: --solid with --thickness-resolution N",
        ),
        (
            ["verify", ROOT / "cases/fig6.toml", "--solid"],
            "solid is for mechanisms, expected model =",
        ),
        (["solve", STAGE], "this command is now: flexfem stiffness --models elements"),
        (
            ["--with", "pipe.py", "check", STAGE],
            "pipe.py: a directory, pipe, socket or device, expected a Python file",
        ),
        (
            ["--install-completion", "nosh"],
            "--install-completion nosh: expected no argument after it",
        ),
        (["drift", STAGE, "-o", STAGE], "is a file, expected a folder"),
        (["check", STAGE, "-o", "new"], "no such option: -o"),
        (
            ["new", "there.toml"],
            "there.toml: exists, expected the name of a new file; nothing is written",
        ),
        (["new", "there", "--case"], "there: expected a file name that ends in .toml"),
        (["new", "fresh.toml", "--study"], "fresh-study.toml: exists"),
        (["new", "link.toml"], "link.toml: exists"),
        (["new", "none/mine.toml"], "no folder none, expected an existing folder"),
        (["new", "two\nlines.toml"], r"two\nlines.toml: expected a plain file name"),
        (["new", ".hidden.toml"], ".hidden.toml: expected a plain file name"),
        (["new", f"{234 * 'x'}.toml", "--case"], "x-case.toml: a name of more than 240 bytes"),
        (["new", f"{300 * 'x'}.toml"], "cannot be written: File name too long"),
        (["new"], "missing argument 'FILE'"),
        (["export", "there.toml"], "missing option '--output'"),
        (
            ["export", "there.toml", "-o", "part.dxf", "--kerf", "nan"],
            "kerf nan, expected a number from 0.01",
        ),
        (["export", "none.toml", "-o", "part.dxf"], "none.toml: no such file"),
        (["view", "none.toml"], "none.toml: no such file"),
        (["view", "fresh-study.toml"], "fresh-study.toml: name, thickness_mm"),
        (["view", "there.toml", "-o", "there.toml"], "there.toml is a file, expected a folder"),
        (["export", "fresh-study.toml", "-o", "part.dxf"], "fresh-study.toml"),
    ],
)
def test_what_is_wrong_or_cannot_be_done_is_refused_in_one_line_and_nothing_is_written(
    flexfem, arguments, said
):
    Path("there.toml").write_text((ROOT / "geometry/mobility6.toml").read_text())
    Path("fresh-study.toml").write_text("")
    Path("link.toml").symlink_to("nowhere")
    Path("folder.svg").mkdir()
    os.mkfifo("pipe.py")
    before = sorted(os.listdir())
    code, out, err = flexfem(*arguments)
    assert (
        (code, out, err.count("\n")) == (2, "", 1) and err.startswith("flexfem: ") and said in err
    ), err
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize(
    "given", ["geometry/mobilty6.toml", "geometry/mobility6", "geometry/mobility-6.tml"]
)
def test_a_file_that_does_not_exist_is_refused_with_the_nearest_name(flexfem, given):
    Path("geometry").mkdir()
    for name in ("mobility6.toml", "mobility6.png", "mobility6.csv", "pivot.toml"):
        Path("geometry", name).touch()
    said = f"flexfem: {given}: no such file, did you mean geometry/mobility6.toml?\n"
    assert flexfem("check", given) == (2, "", said)
    assert flexfem("check", "geometry/rhombus.toml") == (
        2,
        "",
        "flexfem: geometry/rhombus.toml: no such file\n",
    )
    assert flexfem("check", "nowhere/pivot.toml") == (
        2,
        "",
        "flexfem: nowhere/pivot.toml: no such file\n",
    )


KINDS = {
    "geometry/mobility6.toml": ("stage file", "mechanism or stage file", ["check"]),
    "cases/fig5.toml": ("case file", "case file", ["verify"]),
    "cases/study-reach.toml": ("study file", "study file", ["study", "status"]),
}


def test_a_file_of_another_kind_is_named_as_what_it_is(flexfem):
    for name, (found, kind, _) in KINDS.items():
        for _, expected, command in KINDS.values():
            if kind != expected:
                code, out, err = flexfem(*command, ROOT / name)
                assert (code, out) == (2, "") and f"this is a {found}, expected a {expected}" in err


def test_a_hinge_off_the_chart_is_named_with_file_and_line(flexfem, project):
    path = project.edit(
        "geometry/mobility6.toml", ("neck_mm = 0.5\nprismatic", "neck_mm = 0.05\nprismatic")
    )
    code, out, err = flexfem("stiffness", path, "--formula", "calibrated")
    assert (code, out) == (2, "") and "mobility6.toml, line 22: hinges.base.neck_mm = 0.05" in err


@pytest.mark.parametrize(
    ("command", "target", "read"),
    [
        (["drift", "s.toml", "--models", "analytic", "-o", "out"], "out/s-drift.json", "s.toml"),
        (
            ["life", "s.toml", "--amplitude", 0.001, 0, 0, "--models", "analytic", "-o", "out"],
            "out/s-life.json",
            "data.txt",
        ),
        (["mesh", "s.toml", "-o", "x.msh"], "x.msh", "s.toml"),
        (["export", "s.toml", "-o", "x.svg"], "x.svg", "own.py"),
        (["view", "s.toml", "-o", "out"], "out/s-drawing.png", "s.toml"),
    ],
)
def test_no_command_writes_over_a_file_that_it_has_read(
    flexfem, monkeypatch, command, target, read
):
    """By a hard link: exit code 2, one line that names both, and all is as it was; also of a file
    read by --with.
    """
    constants = "fatigue_strength_coefficient_mpa = 900.0\nfatigue_strength_exponent = -0.1\n"
    Path("s.toml").write_text(Path(STAGE).read_text().replace("\n[chain]", f"{constants}\n[chain]"))
    Path("own.py").write_text('import pathlib\npathlib.Path("data.txt").read_text()\n')
    Path("data.txt").write_text("numbers of the user\n")
    Path(target).parent.mkdir(exist_ok=True)
    os.link(read, target)
    before = {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()}
    monkeypatch.setenv(sources.WITH, "")
    monkeypatch.setattr(sources, "_begun", set())
    code, out, err = flexfem("--with", "own.py", *command)
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert target in err and "which is an input of this command, expected another file" in err
    assert {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()} == before


def test_a_table_that_is_too_wide_has_narrow_gaps_or_parts_of_equal_size():
    out = Console(file=StringIO(), width=200, color_system=None)
    for cell, count in ((18, 3), (24, 4)):
        rows = [["x", *["9" * cell] * count]]
        print_tables(out, [TextTable(["row", *"abcde"[:count]], rows, 1)], 60)
    said = [line.split() for line in out.file.getvalue().splitlines() if line]
    assert [row for row in said if row[0] == "row"] == [
        ["row", "a", "b", "c"],
        ["row", "a", "b"],
        ["row", "c", "d"],
    ]
    assert max(map(len, out.file.getvalue().splitlines())) <= 60
