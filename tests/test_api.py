"""The Python API: what a person in a notebook is promised."""

from __future__ import annotations

import ast
import doctest
import hashlib
import os
import re
import subprocess
import sys
from importlib import import_module
from unittest.mock import patch

import numpy as np
import pytest

import flexfem
from flexfem import sources
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.materials import REGISTERED
from flexfem.results import number
from flexfem.study.collect import read_table

from .conftest import ROOT, syntax_of, with_changes
from .tolerances import DENSE

REFERENCE = ROOT / "geometry" / "mobility6.toml"
DOCUMENTED = [
    path for path in sorted((ROOT / "flexfem").rglob("*.py")) if "    >>> " in path.read_text()
]


@pytest.fixture(autouse=True)
def formulas_and_materials_of_this_test_alone():
    flexfem.materials()  # what is shipped is read once
    with patch.dict(FORMULAS), patch.dict(REGISTERED):
        yield


@pytest.fixture(scope="module")
def stage():
    """Unequal numbers, no file."""
    return with_changes({"override": [{"chain": 3, "hinge": "elbow", "neck_mm": 0.55}]}).replace(
        axis={"base": 3.1}
    )


@pytest.mark.slow
def test_type_checkers_know_the_result_of_a_question_about_a_mechanism_and_about_a_stage(tmp_path):
    from mypy import api

    lines = [
        "import flexfem",
        "from typing import assert_type",
        "from flexfem.questions.drive import Drive",
        "from flexfem.questions.modes import MechanismModes",
        "def asked(mechanism: flexfem.Mechanism, stage: flexfem.Stage) -> None:",
        "    assert_type(flexfem.drive(mechanism, solid=True), Drive)",
        "    assert_type(flexfem.modes(stage, count=3), MechanismModes)",
        "    flexfem.stiffness(3)",
        "    flexfem.gravity(mechanism, angel=3.0)",
    ]
    (tmp_path / "asked.py").write_text("\n".join(lines))
    said, _, _ = api.run(
        ["--strict", f"--config-file={ROOT / 'pyproject.toml'}", str(tmp_path / "asked.py")]
    )
    errors = [line for line in said.splitlines() if "error:" in line]
    assert [line.split(":")[1] for line in errors[:2]] == [
        "8",
        "9",
    ] and "Unexpected keyword" in errors[1], said


def test_the_table_of_names_and_the_imports_for_type_checkers_agree():
    nodes = syntax_of(ROOT / "flexfem/__init__.py").body
    (checking,) = [node for node in nodes if isinstance(node, ast.If)]
    imported = {
        alias.asname: node.module.removeprefix("flexfem.")
        for node in checking.body
        for alias in node.names
    }
    assert imported == flexfem.MODULES | flexfem.OTHERS
    assert not set(flexfem.MODULES) & set(flexfem.OTHERS)


def test_import_and_names_load_nothing_that_computes():
    script = (
        "import sys, flexfem; assert flexfem.__version__ and not {'numpy', 'pydantic'} & "
        "set(sys.modules)\nassert set(dir(flexfem)) >= {'load', 'stiffness', 'Stage', "
        "'BadInput', 'design', 'study'}\nassert len(flexfem.__all__) <= 35 and not {'Chain', "
        "'hinge_review', 'view'} & set(flexfem.__all__)\nassert flexfem.Chain.__name__ == 'Chain' "
        "and flexfem.studies.clean_study is flexfem.clean_study\nassert "
        "flexfem.BadInput.__name__ == 'BadInput' and callable(flexfem.stiffness)\nassert "
        "all(getattr(flexfem, name) is not None for name in flexfem.__all__)\nassert not "
        "{'gmsh', 'skfem'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", DOCUMENTED, ids=lambda path: path.name)
def test_examples_in_docstrings_hold(path, monkeypatch):
    monkeypatch.chdir(ROOT)
    module = import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    assert doctest.testmod(module).failed == 0


def test_a_file_and_python_give_the_same_stage(tmp_path):
    """Keys carry the unit of the file, names those inside: 71.7 GPa and 180 degrees against 71700
    MPa and pi.
    """
    read = flexfem.load(REFERENCE)
    numbers = {
        "youngs_modulus": 71700,
        "poissons_ratio": 0.33,
        "density": 2810.0,
        "yield_strength": 503.0,
    }
    material = flexfem.Material(name="aluminium 7075-T6", **numbers, expansion=23.6e-6)
    chain = flexfem.Chain(
        link_lengths=[30, 32, 24], joint_angles=[np.pi, -np.pi / 2, np.pi / 2], link_width=9
    )
    hinge = flexfem.Hinge(radius=1.5, neck=0.5)
    hinges = flexfem.Hinges(
        base={"radius": 4.0, "neck": 0.5, "prismatic": True}, elbow=hinge, platform=hinge
    )
    parts = {
        "material": material,
        "chain": chain,
        "hinges": hinges,
        "platform": {"radius": 17, "hub_radius": 8},
    }
    made = flexfem.Stage(name="x", thickness=10, **parts)
    assert made.hash == read.hash and made.material == read.material


def test_every_stage_is_written_and_read_back_bit_for_bit(stage, tmp_path):
    """Moduli and angles that no file states exactly, among them, as random numbers often are."""
    rng = np.random.default_rng(29)
    for k in range(30):
        drawn = stage.replace(
            material={
                "youngs_modulus": rng.uniform(128e3, 131e3),
                "poissons_ratio": rng.uniform(0.1, 0.4),
            },
            thickness=rng.uniform(1, 12),
            name='quoted "é" \\ ' + str(k),
            axis={"platform": 1.57 + rng.uniform(-0.2, 0.2)},
            provenance={"override.3.elbow.neck_mm": "assumed: drawn"},
        )
        drawn.save(tmp_path / "stage.toml")
        read = flexfem.load(tmp_path / "stage.toml")
        assert read == drawn and read.hash == drawn.hash and read.provenance == drawn.provenance
    assert (
        flexfem.Material.model_validate(drawn.material.model_dump(by_alias=True)) == drawn.material
    )
    with pytest.raises(flexfem.BadInput, match="None, expected the path of a file"):
        drawn.save(None)


def test_replace_changes_what_is_named_and_nothing_else(stage):
    """The axis of 3.1 rad and 68.3 GPa go through units and back."""
    other = stage.replace(
        neck={"elbow": 0.41},
        override={(np.int64(2), "platform"): {"radius": 1.9}, (3, "elbow"): {"radius": 1.7}},
    )
    necks = stage.array("neck").copy()
    radii = stage.array("radius").copy()
    necks[:2, 1] = 0.41
    radii[1, 2] = 1.9
    radii[2, 1] = 1.7
    np.testing.assert_array_equal(other.array("neck"), necks)
    np.testing.assert_array_equal(other.array("radius"), radii)
    assert (
        other.material == stage.material
        and other.hinges.base == stage.hinges.base
        and other.chain == stage.chain
    )
    assert (
        stage.array("neck")[0, 1] == 0.47
        and other.replace(neck={"elbow": 0.47}, override=stage.override) == stage
    )
    assert stage.replace(neck=0.5).array("neck").tolist() == [
        [0.5, 0.5, 0.5],
        [0.5, 0.5, 0.5],
        [0.5, 0.55, 0.5],
    ]


def test_a_replaced_number_no_longer_has_the_source_of_the_old_one():
    read = flexfem.load(REFERENCE)
    assert "hinges.elbow.neck_mm" in read.assumed and "chain.link_width_mm" in read.assumed
    thin = read.replace(neck={"elbow": 0.4})
    assert set(read.assumed) - set(thin.assumed) == {"hinges.elbow.neck_mm"}
    assert thin.provenance["hinges.elbow.neck_mm"] == "replaced in Python"


HOSTILE = {
    "neck=20": (
        {"neck": 20.0},
        "hinges.base.neck_mm = 20, neck as wide as the link, expected < chain.link_width_mm",
    ),
    "negative": ({"thickness": -12}, "thickness = -12, expected > 0"),
    "text": ({"neck": {"elbow": "0.4"}}, 'hinges.elbow.neck = "0.4", expected a number'),
    "GPa": (
        {"material": {"youngs_modulus": 3e6}},
        "youngs_modulus = 3000000.0, expected youngs_modulus_gpa <= 2000",
    ),
    "file key": ({"thickness_mm": 9.0}, "thickness_mm is an unknown name, did you mean thickness?"),
    "no hinge": ({"neck": {"elbw": 0.4}}, "hinges.elbw is an unknown name, did you mean elbow?"),
    "no chain": ({"override": {(4, "elbow"): {"neck": 0.4}}}, "override: no hinge"),
    "nothing": (
        {"override": {(2, "elbow"): None}},
        "override.2.elbow = None, expected a table, any of radius, neck,",
    ),
    "hub": (
        {"platform": {"hub_radius": 17.0}},
        "platform.hub_radius_mm = 17, hub larger than the platform",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_no_door_leads_to_a_stage_that_cannot_be(stage, name):
    changes, said = HOSTILE[name]
    with pytest.raises(flexfem.BadInput) as refused:
        stage.replace(**changes)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_refusals_name_the_file_and_where_it_is_still_the_file_its_line(tmp_path):
    path = tmp_path / "wide.toml"
    path.write_text(REFERENCE.read_text().replace("neck_mm = 0.5", "neck_mm = 20.0", 1))
    line = 1 + path.read_text().split("neck_mm = 20.0")[0].count("\n")
    with pytest.raises(
        flexfem.BadInput, match=rf"wide\.toml, line {line}: hinges\.base\.neck_mm = 20"
    ):
        flexfem.load(path)
    with pytest.raises(
        flexfem.BadInput, match=r"mobility6\.toml, changed: hinges\.elbow\.neck_mm = 20"
    ):
        flexfem.load(REFERENCE).replace(neck={"elbow": 20.0})


def rigid(stage, **analytic):
    """The analytic stiffness by rigid links."""
    found = flexfem.stiffness(stage, models="analytic", analytic=flexfem.Analytic(**analytic))
    return found.at("stiffness", model="analytic"), found.warnings


@pytest.mark.parametrize("models", ["analytic", "both"])
def test_a_stage_that_cannot_be_made_is_refused_before_anything_is_computed(models):
    wide = with_changes({"hinges.base.neck_mm": 20.0})
    for question in (flexfem.stiffness, flexfem.summary, flexfem.drift):
        with pytest.raises(flexfem.BadInput, match="neck as wide as the link"):
            question(wide, models=models)


def test_a_result_has_labelled_arrays_and_is_read_back_as_it_was_written(stage, tmp_path):
    found = flexfem.stiffness(stage, models="analytic", force=(1.0, -2.0, 30.0))
    K = found.at("stiffness", model="analytic")
    pose = found.at("pose", model="analytic")
    np.testing.assert_allclose(K @ pose, [1.0, -2.0, 30.0], rtol=DENSE)
    np.testing.assert_allclose(K @ found.at("compliance", model="analytic"), np.eye(3), atol=DENSE)
    read = type(found).read(found.write(tmp_path / "found.json"))
    np.testing.assert_allclose(read.at("stiffness", model="analytic"), K, rtol=1e-12)
    assert read.about.hash == stage.hash and len(read.to_frame(long=True)) == len(
        list(found.entries())
    )
    with pytest.raises(flexfem.BadInput, match="direction 'z', expected one of: x, y, theta"):
        found.at("stiffness", direction="z")


def test_a_formula_of_ones_own_answers(stage):
    """Half as soft in rotation as Koster's: mobility three, which has rotations alone, is twice as
    stiff.
    """
    koster, _ = rigid(stage, mobility=3, formula="koster")
    made = flexfem.register_formula(
        "half-koster",
        lambda r: 0.5 / (0.093 * np.sqrt(0.5 * r) * r**2),
        source="a test",
        valid=(0.3, 0.9),
    )
    stiffness, warnings = rigid(stage, mobility=3, formula="half-koster")
    np.testing.assert_allclose(stiffness, 2 * koster, rtol=DENSE, atol=1e-9 * koster.max())
    assert any(
        "half-koster is valid for t/R from 0.3 to 0.9, and is used at 0.136" in each
        for each in warnings
    )
    assert "half-koster" in flexfem.formulas() and made.source == "a test"


NO_FORMULA = [
    ({"function": None}, "function = None, expected a function of t/R"),
    (
        {"function": lambda ratio: {}["two\nlines"]},
        "function at t/R from 0.1 to 1: KeyError: 'two\\nlines', expected",
    ),
    (
        {"function": lambda ratio: "soft"},
        "function at t/R from 0.1 to 1: expected finite positive numbers",
    ),
    ({"source": "two\nlines"}, "expected a source, one line of text"),
    ({"valid": "ab"}, 'valid = "ab", expected 0 < smallest t/R < largest'),
    ({"valid": (0.1, "b")}, 'valid = [0.1, "b"], expected 0 < smallest t/R < largest'),
]


@pytest.mark.parametrize(("given", "said"), NO_FORMULA, ids=[said for _, said in NO_FORMULA])
def test_what_is_no_formula_is_refused_when_it_is_registered(given, said):
    wanted = {
        "function": lambda ratio: 15 * ratio**-2.5,
        "source": "a test",
        "valid": (0.1, 1.0),
    } | given
    with pytest.raises(flexfem.BadInput) as refused:
        flexfem.register_formula("not-one", **wanted)
    assert str(refused.value).startswith(f"hinge formula 'not-one': {said}") and "\n" not in str(
        refused.value
    )
    assert "not-one" not in flexfem.formulas()
    for name in (None, 5, ["a"]):
        with pytest.raises(
            flexfem.BadInput, match="expected a name of letters, digits and hyphens"
        ):
            flexfem.register_formula(name, abs, source="a test", valid=(0.1, 1.0))


def test_what_is_wrong_in_a_users_file_is_said_with_its_line(tmp_path, monkeypatch):
    numbers = (
        "youngs_modulus=7e4, poissons_ratio={}, yield_strength=400.0, density=2700.0, source='a "
        "test'"
    )
    wrong = {
        f"\n\nflexfem.register_material('bad', {numbers.format(0.5)})": "material 'bad': poissons_ratio = 0.5, exp",
        "\n\nflexfem.register_formula('koster', abs, source='a', valid=(0.1, 1))": "hinge formula 'koster' is known",
        "\ndef f():\n    return 1 / 0\nf()": "ZeroDivisionError: division by zero, expected Python that registers",
        "\n\nx =": "SyntaxError: invalid syntax",
    }
    for text, said in wrong.items():
        path = tmp_path / "own.py"
        path.write_text(f"import flexfem{text}\n")
        monkeypatch.setenv(sources.WITH, "")
        with pytest.raises(flexfem.BadInput) as refused:
            sources.use_own(path)
        assert str(refused.value).startswith(f"{path}, line 3: {said}") and "\n" not in str(
            refused.value
        )
    path.write_text("\0")
    with pytest.raises(flexfem.BadInput, match=r"own\.py: \w+Error: source code"):
        sources.use_own(path)


def test_a_users_file_that_changes_under_a_command_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "own.py"
    path.write_text("x = 1\n")
    monkeypatch.setenv(sources.WITH, "")
    sources.use_own(path)
    assert (
        sources.own_hash() == hashlib.sha256(b"x = 1\n").hexdigest()
    )  # among the versions of the answers of a study
    path.write_text("x = 2\n")
    monkeypatch.setattr(sources, "_begun", set())  # as in a child process
    with pytest.raises(flexfem.BadInput, match=r"own\.py: changed since this command began"):
        sources.load_own()


OWN = """
import numpy, flexfem
rotation = lambda ratio: 0.5 / (0.093 * numpy.sqrt(0.5 * ratio) * ratio**2)
flexfem.register_formula("half-koster", rotation, source="a test", valid=(0.02, 1.0))
flexfem.register_material("own metal", youngs_modulus=143.4e3, poissons_ratio=0.33, yield_strength=503.0,
    density=2810.0, source="a test")
"""
WITH_OWN = """name = "own formula"
stage = "stage.toml"
model = "analytic"
formula = "half-koster"
mobility = 3
sampling.method = "grid"
factor = [{ key = "thickness_mm", values = [9.0, 10.0] }]
"""


@pytest.mark.slow
def test_commands_and_the_workers_of_a_study_take_a_users_formula_and_material_from_a_file(
    tmp_path,
):
    """Twice as stiff as by Koster's, and of a metal twice as stiff."""
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "study.toml").write_text(WITH_OWN)
    reference = ROOT / "geometry" / "mobility3.toml"
    text = re.sub(
        r"(\[material\]\nname = ).*\n(?:.+\n){5}", r'\1"own metal"\n', reference.read_text()
    )
    text = re.sub(r'"material.expansion.*\n', "", text)
    (tmp_path / "stage.toml").write_text(text)

    def run(*arguments):
        where = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
        command = [sys.executable, "-m", "flexfem", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, **where)

    with pytest.raises(flexfem.BadInput, match="registered material"):
        flexfem.load(tmp_path / "stage.toml")
    for step in (("run", "--workers", 1), ("collect", "--to", "out/study.parquet")):
        done = run("--with", "own.py", "study", step[0], "study.toml", "--output", "out", *step[1:])
        assert done.returncode == 0, done.stderr
    place = tmp_path / "out/study.parquet"
    table = flexfem.study.table(place)
    koster = rigid(flexfem.load(reference), mobility=3, formula="koster")[0][0, 0]
    np.testing.assert_allclose(table["kxx_n_per_mm"], [3.6 * koster, 4.0 * koster], rtol=DENSE)
    assert table["thickness_mm"].tolist() == [9.0, 10.0] and set(table["status"]) == {"ok"}
    other = place.parent.rename(tmp_path / os.fsdecode(b"\xff")) / place.name  # no UTF-8
    assert flexfem.study.table(other, as_arrow=True).num_rows == 2
    np.testing.assert_array_equal(read_table(other).columns["thickness_mm"], [9.0, 10.0])
    for wrong in ("stage.toml", "missing.parquet"):
        with pytest.raises(flexfem.BadInput, match=wrong):
            flexfem.study.table(tmp_path / wrong)


def test_a_result_is_shown_in_one_short_line_with_its_subject_and_its_main_number(stage):
    """The stiffness is 1 N over the displacement under it; neither arrays nor the stage itself are
    shown.
    """
    model = flexfem.analyse(stage)
    fine = flexfem.stiffness(stage, models="analytic")
    stiffness = number(1.0 / model.pose([1.0, 0.0, 0.0])[0])
    shown = [
        model,
        fine,
        model.result,
        stage,
        flexfem.check(stage),
        flexfem.thickness_review(),
        flexfem.Errors(*[np.eye(3)] * 2),
    ]
    texts = [repr(each) for each in shown]
    assert all(len(text) <= 300 and "\n" not in text and "[" not in text for text in texts), texts
    for text in texts[:2]:
        assert f"x {stiffness} N/mm" in text and repr(stage.name) in text
    assert "1.0 ± 1.0" in texts[-1] and "mobility=6" in texts[4] and repr(stage.name) in texts[3]
