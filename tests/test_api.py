"""The Python API: what a person in a notebook is promised."""

from __future__ import annotations

import copy
import doctest
import hashlib
import itertools
import os
import pickle
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib import pyplot

import flexfem
from flexfem import own
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.materials import REGISTERED

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "geometry" / "mobility6.toml"
DOCUMENTED = [path for path in sorted((ROOT / "flexfem").rglob("*.py")) if "    >>> " in path.read_text()]


def generic(**changes):
    """Unequal numbers, no file."""
    content = {
        "name": "made in Python",
        "thickness": 9.7,
        "material": {
            "name": "metal", "youngs_modulus": 68300.0, "poissons_ratio": 0.29, "density": 2739.0,
            "yield_strength": 411.0,
        },
        "chain": {
            "link_lengths": (31.0, 33.5, 25.0), "joint_angles": np.deg2rad([175.0, -85.0, 92.0]), "link_width": 8.9
        },
        "hinges": {
            "base": flexfem.Hinge(radius=3.9, neck=0.53, prismatic=True, axis=3.1),
            "elbow": {"radius": 1.6, "neck": 0.47},
            "platform": {"radius": 1.4, "neck": 0.61},
        },
        "platform": flexfem.Platform(radius=16.3, hub_radius=7.7),
        "override": ({"chain": 3, "hinge": "elbow", "neck": 0.55},),
    }  # fmt: skip
    return flexfem.Stage(**content | changes)


@pytest.fixture(autouse=True)
def formulas_and_materials_of_this_test_alone():
    flexfem.materials()  # what is shipped is read once
    with patch.dict(FORMULAS), patch.dict(REGISTERED):
        yield


@pytest.fixture(scope="module")
def stage():
    return generic()


@pytest.fixture(scope="module")
def fe(stage):
    return flexfem.solve(stage, resolution=2)


def test_import_and_names_load_nothing_that_computes():
    script = (
        "import sys, flexfem; assert flexfem.__version__ and not {'numpy', 'pydantic'} & set(sys.modules)\n"
        "assert set(dir(flexfem)) >= {'load', 'analyse', 'solve', 'errors', 'Stage', 'BadInput', 'study'}\n"
        "assert flexfem.BadInput.__name__ == 'BadInput' and callable(flexfem.errors)\n"
        "assert all(getattr(flexfem, name) is not None for name in flexfem.__all__)\n"
        "assert not {'gmsh', 'skfem', 'matplotlib'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", DOCUMENTED, ids=lambda path: path.name)
def test_examples_in_docstrings_hold(path, monkeypatch):
    monkeypatch.chdir(ROOT)
    module = import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    assert doctest.testmod(module).failed == 0


def test_a_file_and_python_give_the_same_stage(tmp_path):
    """Keys carry the unit of the file, names those inside: 71.7 GPa and 180 degrees against 71700 MPa and pi."""
    read = flexfem.load(REFERENCE)
    material = flexfem.Material(
        name="aluminium 7075-T6",
        youngs_modulus=71700,
        poissons_ratio=0.33,
        density=2810.0,
        yield_strength=503.0,
        expansion=23.6e-6,
    )
    chain = flexfem.Chain(link_lengths=[30, 32, 24], joint_angles=[np.pi, -np.pi / 2, np.pi / 2], link_width=9)
    hinge = flexfem.Hinge(radius=1.5, neck=0.5)
    hinges = flexfem.Hinges(base={"radius": 4.0, "neck": 0.5, "prismatic": True}, elbow=hinge, platform=hinge)
    made = flexfem.Stage(
        name="x", thickness=10, material=material, chain=chain, hinges=hinges, platform={"radius": 17, "hub_radius": 8}
    )
    assert made.hash == read.hash and made.material == read.material


def test_every_stage_is_written_and_read_back_bit_for_bit(tmp_path):
    """Moduli and angles that no file states exactly, among them, as random numbers often are."""
    rng = np.random.default_rng(29)
    for k in range(30):
        drawn = generic().replace(
            material={"youngs_modulus": rng.uniform(128e3, 131e3), "poissons_ratio": rng.uniform(0.1, 0.4)},
            thickness=rng.uniform(1, 12),
            name='quoted "é" \\ ' + str(k),
            axis={"platform": 1.57 + rng.uniform(-0.2, 0.2)},
            provenance={"override.3.elbow.neck_mm": "assumed: drawn"},
        )
        drawn.save(tmp_path / "stage.toml")
        read = flexfem.load(tmp_path / "stage.toml")
        assert read == drawn and read.hash == drawn.hash and read.provenance == drawn.provenance
    assert flexfem.Material.model_validate(drawn.material.model_dump(by_alias=True)) == drawn.material


def test_replace_changes_what_is_named_and_nothing_else(stage):
    """The axis of 3.1 rad and 68.3 GPa go through units and back."""
    other = stage.replace(
        neck={"elbow": 0.41}, override={(2, "platform"): {"radius": 1.9}, (3, "elbow"): {"radius": 1.7}}
    )
    necks, radii = stage.array("neck").copy(), stage.array("radius").copy()
    necks[:2, 1], radii[1, 2], radii[2, 1] = 0.41, 1.9, 1.7
    np.testing.assert_array_equal(other.array("neck"), necks)
    np.testing.assert_array_equal(other.array("radius"), radii)
    assert other.material == stage.material and other.hinges.base == stage.hinges.base and other.chain == stage.chain
    assert stage.array("neck")[0, 1] == 0.47 and other.replace(neck={"elbow": 0.47}, override=stage.override) == stage
    assert stage.replace(neck=0.5).array("neck").tolist() == [[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [0.5, 0.55, 0.5]]


def test_a_replaced_number_no_longer_has_the_source_of_the_old_one():
    read = flexfem.load(REFERENCE)
    assert "hinges.elbow.neck_mm" in read.assumed and "chain.link_width_mm" in read.assumed
    thin = read.replace(neck={"elbow": 0.4})
    assert set(read.assumed) - set(thin.assumed) == {"hinges.elbow.neck_mm"}
    assert thin.provenance["hinges.elbow.neck_mm"] == "replaced in Python"


HOSTILE = {
    "neck=20": ({"neck": 20.0}, "hinges.base.neck_mm = 20, neck as wide as the link, expected < chain.link_width_mm"),
    "negative": ({"thickness": -12}, "thickness = -12, expected > 0"),
    "nan": ({"chain": {"link_width": float("nan")}}, "chain.link_width = nan, expected a finite number"),
    "text": ({"neck": {"elbow": "0.4"}}, 'hinges.elbow.neck = "0.4", expected a number'),
    "GPa": ({"material": {"youngs_modulus": 3e6}}, "youngs_modulus = 3000000.0, expected youngs_modulus_gpa <= 2000"),
    "degrees": ({"axis": {"elbow": 90.0}}, "hinges.elbow.axis = 90.0, expected axis_deg <= 360"),
    "file key": ({"thickness_mm": 9.0}, "thickness_mm is an unknown name, did you mean thickness?"),
    "no hinge": ({"neck": {"elbw": 0.4}}, "hinges.elbw is an unknown name, did you mean elbow?"),
    "no chain": ({"override": {(4, "elbow"): {"neck": 0.4}}}, "override: no hinge"),
    "no table": ({"override": {(2, "elbow"): 0.5}}, "override.2.elbow = 0.5, expected a table, any of radius, neck,"),
    "nothing": ({"override": {(2, "elbow"): None}}, "override.2.elbow = None, expected a table, any of radius, neck,"),
    "hub": ({"platform": {"hub_radius": 17.0}}, "platform.hub_radius_mm = 17, hub larger than the platform"),
    "two at once": ({"thickness": 0, "neck": -1}, "(and 3 more)"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_no_door_leads_to_a_stage_that_cannot_be(stage, name):
    changes, said = HOSTILE[name]
    with pytest.raises(flexfem.BadInput) as refused:
        stage.replace(**changes)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_copies_are_validated_too(stage):
    for attempt in (
        lambda: stage.model_copy(update={"thickness": -12}),
        lambda: stage.hinges.elbow.model_copy(update={"neck": -1.0}),
        lambda: flexfem.Hinge.model_construct(radius=-1.0, neck=1.0),
        lambda: flexfem.Hinge(radius_mm=1.0, neck_mm=1.0),
        lambda: flexfem.Stage(name="empty"),
    ):
        with pytest.raises(flexfem.BadInput):
            attempt()
    for same in (copy.copy(stage), copy.deepcopy(stage), pickle.loads(pickle.dumps(stage)), stage.replace()):
        assert same == stage and same.hash == stage.hash


def test_refusals_name_the_file_and_where_it_is_still_the_file_its_line(tmp_path):
    path = tmp_path / "wide.toml"
    path.write_text(REFERENCE.read_text().replace("neck_mm = 0.5", "neck_mm = 20.0", 1))
    line = 1 + path.read_text().split("neck_mm = 20.0")[0].count("\n")
    with pytest.raises(flexfem.BadInput, match=rf"wide\.toml, line {line}: hinges\.base\.neck_mm = 20"):
        flexfem.load(path)
    with pytest.raises(flexfem.BadInput, match=r"mobility6\.toml, changed: hinges\.elbow\.neck_mm = 20"):
        flexfem.load(REFERENCE).replace(neck={"elbow": 20.0})


@pytest.mark.parametrize(
    "ask",
    [
        flexfem.analyse,
        flexfem.solve,
        flexfem.errors,
        lambda stage: flexfem.analyse(stage, links=True, formula="calibrated"),
        lambda stage: stage.plot(),
    ],
)
def test_a_stage_that_cannot_be_made_is_refused_by_every_question(ask):
    """Nobody asked whether it can be made when it was built."""
    wide = generic(hinges={name: {"radius": 1.0, "neck": 20.0} for name in ("base", "elbow", "platform")})
    with pytest.raises(flexfem.BadInput, match="neck as wide as the link"):
        ask(wide)


def test_a_joint_of_known_springs_gives_the_stiffness_of_the_sum_over_chains(stage):
    """Hinges in series, chains in parallel, summed here hinge by hinge, against the model by loops."""
    model = flexfem.analyse(stage, mobility=21)
    from flexfem.mechanism.designs import stage_frames

    placed, K = stage_frames(stage), np.zeros((3, 3))
    for chain in range(3):
        C = np.zeros((3, 3))
        for hinge in range(3):
            (x, y), a = placed.centres[chain, hinge], placed.axes[chain, hinge]
            turn, stretch, slide = (part[chain, hinge] for part in model.result.hinges)
            for v, c in (((y, -x, 1), turn), ((np.cos(a), np.sin(a), 0), stretch), ((-np.sin(a), np.cos(a), 0), slide)):
                C += c * np.outer(v, v)
        K += np.linalg.inv(C)
    np.testing.assert_allclose(model.stiffness, K, rtol=1e-9, atol=1e-9 * np.abs(K).max())


def test_poses_and_forces_broadcast_and_invert_each_other(stage, fe):
    poses = np.random.default_rng(3).normal(size=(4, 2, 3)) * [1e-2, 1e-2, 1e-4]
    for model in (flexfem.analyse(stage, mobility=12), fe):
        loads = model.force(poses)
        assert loads.shape == (4, 2, 3) and model.neck_stress(poses[0]).shape == (2, 3, 3)
        np.testing.assert_allclose(loads[3, 1], model.stiffness @ poses[3, 1], rtol=1e-9)
        np.testing.assert_allclose(model.pose(loads), poses, rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(model.neck_stress(-2 * poses[0, 1]), 2 * model.neck_stress(poses[0, 1]), rtol=1e-9)
        for wrong in ([1.0, 2.0], [[1.0]], "x", [np.nan, 0, 0]):
            with pytest.raises(flexfem.BadInput):
                model.force(wrong)


def test_the_neck_that_limits_the_range_carries_the_yield_strength_there(stage, fe):
    for model in (flexfem.analyse(stage, mobility=12), fe):
        for axis, far in enumerate(model.range_at_yield):
            assert model.neck_stress(far * np.eye(3)[axis]).max() == pytest.approx(411.0, rel=1e-6)


def test_stresses_of_two_motions_do_not_simply_add(stage):
    """Moments of x and theta may cancel at a neck: the stress of both together is at most the sum, and not it."""
    model = flexfem.analyse(stage, mobility=12)
    x, theta = np.array([0.02, 0, 0]), np.array([0, 0, 8e-4])
    both, apart = model.neck_stress(x + theta), model.neck_stress(x) + model.neck_stress(theta)
    assert np.all(both <= apart * (1 + 1e-9)) and np.any(both < 0.9 * apart)


def test_fields_belong_to_the_loads_in_their_order(fe):
    loads = np.array([[1.0, 0, 0], [0, 0, 50.0], [0.3, -2.0, 7.0]])
    u = fe.displacement(loads)
    assert u.shape == (3, len(fe.mesh.nodes), 2) and fe.stress(loads).shape == (3, len(fe.mesh.nodes))
    np.testing.assert_allclose(fe.displacement(loads[2]), u[2], rtol=1e-12)
    hub = np.unique(fe.mesh.edges["hub"])  # rigid: the mean of its nodes moves as the pose does
    np.testing.assert_allclose(u[2][hub].mean(axis=0), fe.pose(loads[2])[:2], rtol=1e-2)


def test_errors_are_those_of_force_and_pose(stage):
    found = flexfem.errors(stage, mobility=12, resolution=4)
    model, fe = flexfem.analyse(stage, mobility=12), flexfem.solve(stage, resolution=4)
    for j, command in enumerate(([1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0])):
        error = (fe.pose(model.force(command)) - command) * [1, 1, 25.0] / (25.0 if j == 2 else 1.0)
        np.testing.assert_allclose(found.percent[:, j], 100 * error, rtol=1e-9, atol=1e-9)
    assert found.band.shape == (3, 3) and np.all(found.band > 0)
    assert np.abs(found.band).max() < 1.0 and fe.band.shape == (3, 3)
    size = np.sqrt(np.outer(np.diag(fe.compliance), np.diag(fe.compliance)))
    assert np.all(fe.band > 0) and np.all(fe.band < 0.01 * size)


def test_a_formula_of_ones_own_answers_everywhere(stage):
    """Half as soft in rotation as Koster's: mobility three, which has rotations alone, is twice as stiff."""
    koster = flexfem.analyse(stage, mobility=3, formula="koster").stiffness
    own = flexfem.register_formula(
        "half-koster", lambda r: 0.5 / (0.093 * np.sqrt(0.5 * r) * r**2), source="a test", valid=(0.3, 0.9)
    )
    model = flexfem.analyse(stage, mobility=3, formula="half-koster")
    np.testing.assert_allclose(model.stiffness, 2 * koster, rtol=1e-9, atol=1e-9 * koster.max())
    assert any("half-koster is meant for t/R from 0.3 to 0.9, and is used at 0.136" in said for said in model.warnings)
    assert "half-koster" in flexfem.formulas() and own.source == "a test"
    errors = [flexfem.errors(stage, 3, formula, resolution=4).percent[0, 0] for formula in ("koster", "half-koster")]
    assert 100 + errors[1] == pytest.approx(2 * (100 + errors[0]), rel=1e-9)  # twice the force moves twice as far
    bad = {"koster": own.rotation, "no name": own.rotation, "scalar": lambda r: 1.0, "minus": lambda r: -r}
    for name, function in bad.items():
        with pytest.raises(flexfem.BadInput, match=name):
            flexfem.register_formula(name, function, source="a test", valid=(0.1, 1.0))
    for valid, source in itertools.chain([((1.0, 0.1), "x"), ((0.0, 1.0), "x"), ((0.1, 1.0), " ")]):
        with pytest.raises(flexfem.BadInput):
            flexfem.register_formula("other", own.rotation, source=source, valid=valid)


def raises(ratio):
    raise ValueError("two\nlines")


NO_FORMULA = [
    ({"function": None}, "function = None, expected a function of t/R"),
    ({"function": 3}, "function = 3, expected a function of t/R"),
    ({"axial": 3}, "axial = 3, expected a function of t/R"),
    ({"function": raises}, "function at t/R from 0.1 to 1: ValueError: two\\nlines, expected finite positive numbers"),
    ({"bending": raises}, "bending at t/R from 0.1 to 1: ValueError: two\\nlines, expected finite positive numbers"),
    ({"function": lambda: 1.0}, "function at t/R from 0.1 to 1: TypeError: "),
    ({"function": lambda ratio: "soft"}, "function at t/R from 0.1 to 1: expected finite positive numbers"),
    ({"function": lambda ratio: 1j * ratio}, "function at t/R from 0.1 to 1: "),
    ({"valid": "ab"}, 'valid = "ab", expected 0 < smallest t/R < largest'),
    ({"valid": None}, "valid = None, expected 0 < smallest t/R < largest"),
    ({"valid": (0.1, "b")}, 'valid = [0.1, "b"], expected 0 < smallest t/R < largest'),
]


@pytest.mark.parametrize(("given", "said"), NO_FORMULA, ids=[said for _, said in NO_FORMULA])
def test_what_is_no_formula_is_refused_when_it_is_registered(given, said):
    wanted = {"function": lambda ratio: 15 * ratio**-2.5, "source": "a test", "valid": (0.1, 1.0)} | given
    with pytest.raises(flexfem.BadInput) as refused:
        flexfem.register_formula("not-one", **wanted)
    assert str(refused.value).startswith(f"hinge formula 'not-one': {said}") and "\n" not in str(refused.value)
    assert "not-one" not in flexfem.formulas()
    for name in (None, 5, ["a"]):
        with pytest.raises(flexfem.BadInput, match="expected a name of letters, digits and hyphens"):
            flexfem.register_formula(name, abs, source="a test", valid=(0.1, 1.0))


def test_the_example_of_the_pages_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.syspath_prepend(ROOT / "examples")
    monkeypatch.chdir(ROOT / "examples")
    rows = import_module("thin_neck").compare(tmp_path / "figure.png", resolution=2)
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    figure = pyplot.gcf()
    assert figure.axes[0].title.get_window_extent(dpi=120).y1 <= 120 * 4.2  # the title is whole, as saved
    pyplot.close(figure)
    (thin, stiff_thin, far_thin), (thick, stiff_thick, far_thick) = rows
    assert (thin, thick) == (0.4, 0.5) and stiff_thin < stiff_thick and far_thin != far_thick
    assert "range at yield" in capsys.readouterr().out


def test_what_is_wrong_in_a_users_file_is_said_with_its_line(tmp_path, monkeypatch):
    numbers = "youngs_modulus=7e4, poissons_ratio={}, yield_strength=400.0, density=2700.0, source='a test'"
    wrong = {
        f"\n\nflexfem.register_material('bad', {numbers.format(0.5)})": "material 'bad': poissons_ratio = 0.5, exp",
        "\n\nflexfem.register_formula('koster', abs, source='a', valid=(0.1, 1))": "hinge formula 'koster' is known",
        "\ndef f():\n    return 1 / 0\nf()": "ZeroDivisionError: division by zero, expected Python that registers",
        "\n\nx =": "SyntaxError: invalid syntax",
    }
    for text, said in wrong.items():
        path = tmp_path / "own.py"
        path.write_text(f"import flexfem{text}\n")
        monkeypatch.setenv(own.VARIABLE, "")
        with pytest.raises(flexfem.BadInput) as refused:
            own.use(path)
        assert str(refused.value).startswith(f"{path}, line 3: {said}") and "\n" not in str(refused.value)
    path.write_text("\0")
    with pytest.raises(flexfem.BadInput, match=r"own\.py: \w+Error: source code"):
        own.use(path)


def test_a_users_file_that_changes_under_a_command_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "own.py"
    path.write_text("x = 1\n")
    monkeypatch.setenv(own.VARIABLE, "")
    own.use(path)
    assert own.own_hash() == hashlib.sha256(b"x = 1\n").hexdigest()  # among the versions of the answers of a study
    path.write_text("x = 2\n")
    monkeypatch.setattr(own, "_begun", set())  # as in a child process
    with pytest.raises(flexfem.BadInput, match=r"own\.py: changed since this command began"):
        own.load()


def test_stage_and_displacement_draw_on_given_axes(stage, fe):
    from matplotlib.figure import Figure

    left, right = Figure().subplots(1, 2)
    assert stage.plot(ax=left) is left and fe.plot([1.0, 0, 0], ax=right) is right
    assert left.collections and right.collections
    with pytest.raises(flexfem.BadInput):
        fe.plot([[1.0, 0, 0]], ax=right)


OWN = """
import numpy as np
import flexfem
def rotation(ratio):
    return 0.5 / (0.093 * np.sqrt(0.5 * ratio) * ratio**2)
flexfem.register_formula("half-koster", rotation, source="a test", valid=(0.02, 1.0))
flexfem.register_material("own metal", youngs_modulus=143.4e3, poissons_ratio=0.33, yield_strength=503.0,
    density=2810.0, source="a test")
assert {"half-koster", "koster"} < set(flexfem.formulas()) and "own metal" in flexfem.materials()
"""
WITH_OWN = """name = "own formula"
stage = "stage.toml"
model = "analytic"
formula = "half-koster"
mobility = 3
[sampling]
method = "grid"
[[factor]]
key = "thickness_mm"
values = [9.0, 10.0]
"""


@pytest.mark.slow
def test_commands_and_the_workers_of_a_study_take_a_users_formula_and_material_from_a_file(tmp_path):
    """Twice as stiff as by Koster's, and of a metal twice as stiff."""
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "study.toml").write_text(WITH_OWN)
    reference = ROOT / "geometry" / "mobility3.toml"
    text = re.sub(r"(\[material\]\nname = ).*\n(?:.+\n){5}", r'\1"own metal"\n', reference.read_text())
    text = re.sub(r'"material.expansion.*\n', "", text)
    (tmp_path / "stage.toml").write_text(text)

    def run(*arguments):
        command = [sys.executable, "-m", "flexfem", *map(str, arguments)]
        return subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}
        )

    refused = run("--with", "none.py", "stiffness", "stage.toml")
    assert refused.returncode == 2 and "none.py: cannot be read: No such file" in refused.stderr
    with pytest.raises(flexfem.BadInput, match="registered material"):
        flexfem.load(tmp_path / "stage.toml")
    for step in (("run", "--workers", 1), ("collect", "--to", "out/study.parquet")):
        done = run("--with", "own.py", "study", step[0], "study.toml", "--output", "out", *step[1:])
        assert done.returncode == 0, done.stderr
    place = tmp_path / "out/study.parquet"
    table, koster = flexfem.study.table(place), flexfem.analyse(flexfem.load(reference), 3, "koster").stiffness[0, 0]
    np.testing.assert_allclose(table["kxx_n_per_mm"], [3.6 * koster, 4.0 * koster], rtol=1e-9)
    assert table["thickness_mm"].tolist() == [9.0, 10.0] and set(table["status"]) == {"ok"}
    assert flexfem.study.table(place, as_arrow=True).num_rows == 2
    for wrong in ("stage.toml", "missing.parquet"):
        with pytest.raises(flexfem.BadInput, match=wrong):
            flexfem.study.table(tmp_path / wrong)
