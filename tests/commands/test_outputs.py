"""No command writes over a file that it has read: each option that names what is written, each file that is read."""

from __future__ import annotations

import inspect
import os
import re
import shutil
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

from flexfem import own
from flexfem.commands import cli
from flexfem.study import given
from flexfem.verify.result import write_record

from ..conftest import COMMAND_OF, ROOT
from ..synthesis.recorded import recorded

STUDY = """name = "study"
stage = "s.toml"
model = "analytic"
[sampling]
method = "table"
file = "designs.csv"
[[factor]]
key = "thickness_mm"
"""
FILES = {
    "c.toml": (ROOT / "cases/fig5.toml").read_text().replace("../geometry/mobility3", "s").replace("../geometry/", ""),
    "fixture.toml": (ROOT / "cases/fixture.toml").read_text(),
    "slopes.toml": 'name = "slopes"\n[measured]\nkxx_n_per_mm = 35.4\nkxx_sd_n_per_mm = 0.18\n',
    "points.csv": "stress_mpa, cycles\n300, 1e5\n200, 1e6\n150, 1e7\n",
    "w.toml": 'name = "w"\nstage = "s.toml"\nseed = 7\n[[free]]\nlabel = "neck"\nkey = "hinges.elbow.neck_mm"\n'
    'from = 0.3\nto = 0.7\n[[objective]]\nmaximise = "range_x_um"\n',
    "study.toml": STUDY,
    "designs.csv": "thickness_mm\n9.0\n10.0\n",
    "own.py": 'import pathlib\npathlib.Path("data.txt").read_text()\n',
    "data.txt": "numbers of the user\n",
}
OWN, STAGE = ("own.py", "data.txt"), ("s.toml", "m.toml", "own.py", "data.txt")
POSE = (0.001, 0, 0)
WRITTEN: list[tuple[str, str, list[Any], tuple[str, ...], tuple[str, ...]]] = [
    # command, option, other arguments, names of files that it would write there, files that it reads
    ("solve", "vtu", ["s.toml", "--force", 1, 0, 0], ("x.vtu",), STAGE),
    ("mesh", "output", ["s.toml"], ("x.msh", "x.vtu", "x.inp"), STAGE),
    ("export", "output", ["s.toml"], ("x.svg", "x.dxf", "x.step"), STAGE),
    ("report", "output", ["s.toml", "--sections", "analytic"], ("x.html",), STAGE),
    ("report", "output", ["design.json"], ("x.html",), ("design.json", *OWN)),
    ("report", "output", ["study.toml", "--folder", "done"], ("x.html",), ("study.toml", "designs.csv", *STAGE)),
    ("view", "output", ["s.toml"], ("s-drawing.png", "s-drawing.pdf"), STAGE),
    ("drive", "output", ["s.toml", "--pose", *POSE, "--models", "analytic"], ("s-drive.json", "s-drive.pdf"), STAGE),
    ("drift", "output", ["s.toml"], ("s-drift.json", "s-drift.png"), STAGE),
    ("drift", "output", ["s.toml", "--three-dimensional"], ("s-drift-solid.json", "s-drift-solid.vtu"), STAGE),
    (
        "life",
        "output",
        ["s.toml", "--amplitude", *POSE, "--fit", "points.csv"],
        ("s-life.png",),
        ("points.csv", *STAGE),
    ),
    ("modes", "output", ["s.toml"], ("s-modes.vtu", "s-modes-6.gif", "s-modes.mat", "s-modes-response.pdf"), STAGE),
    ("modes", "output", ["s.toml", "--three-dimensional"], ("s-modes-solid.json", "s-modes-solid.vtu"), STAGE),
    (
        "experiment",
        "output",
        ["s.toml", "fixture.toml", "--measured", "slopes.toml", "--analytic"],
        ("s-experiment.pdf",),
        ("fixture.toml", "slopes.toml", *STAGE),
    ),
    ("identify", "output", ["s.toml", "slopes.toml"], ("s-identify.json",), ("slopes.toml", *STAGE)),
    ("verify", "output", ["c.toml"], ("c.json", "c.npz"), ("c.toml", "mobility6.toml", *STAGE)),
    ("verify", "output", ["c.toml", "--check", "--baselines", "."], ("c.npz", "c.json"), ("c.json", "c.toml")),
    ("budget", "output", ["s.toml"], ("s-budget.json",), STAGE),
    ("large", "output", ["s.toml"], ("s-large.pdf", "s-large.json"), STAGE),
    ("reach", "output", ["s.toml"], ("s-reach.json",), STAGE),
    ("converge", "output", ["s.toml"], ("s-convergence.png",), STAGE),
    ("plot", "output", ["design.json"], ("design.png", "design-front.pdf"), ("design.json", *OWN)),
    ("design", "output", ["w.toml"], ("w-stage.toml", "w-design.json", "w-design.pdf"), ("w.toml", *STAGE)),
    ("formulas", "output", [], ("hinge-chart.png", "hinge-thickness.pdf"), OWN),
    ("schema", "output", [], ("flexfem-stage.schema.json", "flexfem-case.schema.json"), OWN),
    (
        "study collect",
        "to",
        ["study.toml", "-o", "done"],
        ("x.csv", "x.parquet"),
        ("study.toml", "designs.csv", *STAGE),
    ),
    ("study collect", "output", ["study.toml"], ("study/study.parquet",), ("designs.csv", *STAGE)),
    ("study plot", "output", ["study.toml"], ("study/study.parquet",), ("designs.csv", *STAGE)),
]
READ = {
    ("", "formulas"), ("stiffness", "necks"), ("life", "fit"), ("experiment", "measured"), ("report", "folder"),
    ("verify", "baselines"),
}  # fmt: skip
KEPT = {("baseline", "baselines"), *((f"study {name}", "output") for name in ("run", "status", "clean"))}


def options(command, name=""):
    """Every option of a command, and of those in it, that takes a path."""
    hints = get_type_hints(inspect.unwrap(command.callback)) if command.callback else {}
    paths = {key for key, kind in hints.items() if Path in (kind, *get_args(kind))}
    found = {(name, each.name) for each in command.params if each.param_type_name == "option" and each.name in paths}
    return found.union(*(options(each, f"{name} {n}".strip()) for n, each in getattr(command, "commands", {}).items()))


def test_every_option_that_takes_a_path_is_known_here():
    """One to write is tried below; files that flexfem keeps for itself it reads to write them again."""
    assert options(COMMAND_OF(cli.app)) == {(command, option) for command, option, *_ in WRITTEN} | READ | KEPT


@pytest.fixture
def inputs(tmp_path, monkeypatch, flexfem):
    """A folder of files of all kinds, the current one, with a study that is done."""
    folder = tmp_path / "inputs"
    folder.mkdir()
    monkeypatch.chdir(folder)
    text = (ROOT / "geometry/mobility3.toml").read_text()
    numbers = re.search(r"\[material\]\nname = .*\n((?:.+\n){5})", text)[1]
    Path("m.toml").write_text(f'["own metal"]\nsource = "assumed"\n{numbers}')
    text = text.replace(numbers, 'file = "m.toml"\n').replace('name = "aluminium 7075-T6"', 'name = "own metal"')
    Path("s.toml").write_text(text)
    Path("mobility6.toml").write_text((ROOT / "geometry/mobility6.toml").read_text())
    for name, content in FILES.items():
        Path(name).write_text(content)
    write_record(recorded(), Path("design.json"))
    shutil.copy(ROOT / "tests/baselines/fig5.json", "c.json")
    monkeypatch.setenv(own.VARIABLE, "")
    return folder


@pytest.mark.parametrize(("command", "option", "others", "names", "read"), WRITTEN)
def test_no_command_writes_over_a_file_that_it_has_read(
    command, option, others, names, read, inputs, flexfem, monkeypatch
):
    """By a hard link or a symbolic one: exit 2, one line that names both, and all is as it was."""
    if command.startswith("study") or "study.toml" in others:
        for step in (["run", "--workers", 1], ["collect"]):
            assert flexfem("study", *step, "study.toml", "-o", "done")[0] == 0
        shutil.copytree("done", "out")
    for number, source in enumerate(read):
        name = names[number % len(names)]
        target = Path("out", name)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.unlink(missing_ok=True)
        (os.link if number % 2 else os.symlink)(Path(source).absolute(), target)
        before = contents(inputs)
        monkeypatch.setattr(own, "_begun", set())  # as of a process of its own
        given._digest.cache_clear()
        where = target if Path(name).stem == "x" else "out"
        code, out, err = flexfem("--with", "own.py", *command.split(), *others, f"--{option}", where)
        assert (code, out) == (2, ""), (source, name, err)
        assert err.startswith(f"flexfem: {target}: the same file as ") and err.count("\n") == 1
        assert err.endswith(f"{source}, which is read for what is to be written, expected another file\n")
        assert contents(inputs) == before
        target.unlink()


@pytest.mark.parametrize("name", ["s.vtu", "s.svg", "s.msh", "s.html"])
def test_a_file_is_not_replaced_under_its_own_name_and_an_output_is(name, inputs, flexfem):
    text = shutil.copy("s.toml", name) and Path(name).read_text()
    command = {"vtu": ["solve", "--force", 1, 0, 0, "--vtu"], "svg": ["export", "-o"], "msh": ["mesh", "-o"]}
    word, *others = command.get(name[2:], ["report", "--sections", "analytic", "-o"])
    code, out, err = flexfem(word, name, *others, name)
    assert (code, out) == (2, "") and Path(name).read_text() == text
    assert err == f"flexfem: {name}: is read for what is to be written, expected another file\n"
    for _ in range(2):  # its own output it may replace
        assert flexfem(word, "s.toml", *others, Path(f"other{name[1:]}").absolute())[0] == 0


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
