"""Case files: what they mean, and how broken ones are refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flexfem.paper.case import LoadedCase
from flexfem.paper.fields import neck_stresses
from flexfem.paper.solutions import solve_solid, solved
from flexfem.paper.stage import load_stage
from flexfem.paper.verification import Verification, run_case
from flexfem.questions.bands import error_matrix
from flexfem.questions.verification import verification
from flexfem.refused import BadInput

from ..conftest import ROOT
from ..tolerances import DENSE, SOLVED


@pytest.mark.parametrize(
    "path", sorted((ROOT / "cases").glob("fig*.toml")), ids=lambda path: path.stem
)
def test_shipped_cases_state_where_their_numbers_come_from(path):
    case = LoadedCase(path).case
    assert {"points"} | {
        key for key in ("amplitude_um", "amplitude_mrad") if getattr(case, key)
    } <= set(case.assumed)
    assert {curve.mobility for curve in case.curve} == {3, 6}


SMALLER = (
    ("points = 21", "points = 3\nresolution = 4"),
    ("mobility3.toml", "mobility6.toml"),
)  # one stage, two models


def test_large_commands_bend_the_error_curve_and_its_percentage_is_at_the_largest(project):
    case = project.edit(
        "cases/fig5.toml", ("amplitude_um = 50.0", "amplitude_um = 500.0"), *SMALLER
    )
    linear = run_case(LoadedCase(case))
    bent = project.edit("cases/fig5.toml", ("points = 3", 'points = 3\nanalysis = "nonlinear"'))
    nonlinear = run_case(LoadedCase(bent))
    np.testing.assert_allclose(nonlinear.commanded, [-0.5, 0.0, 0.5])
    for k in range(2):
        first, middle, last = nonlinear.error[k, :, 0]
        assert (
            abs(middle) < SOLVED * last and 1e-3 < abs(first + last) / last < 0.1
        )  # no longer odd in the command
        assert nonlinear.percent[k, 0] == pytest.approx(100 * last / 0.5, rel=1e-12)
        assert nonlinear.percent[k, 2] == pytest.approx(
            100 * nonlinear.error[k, 2, 2] * 24 / 0.5, rel=1e-12
        )
        # what is even in the command drops out; the rest is the linear error but for terms of third
        # order: 3e-4
        assert last - first == pytest.approx(2 * linear.error[k, 2, 0], rel=2e-3)


def test_a_curve_has_the_force_of_its_model_and_the_errors_of_its_meshes(project):
    """Force by (18), stress at the full command, and the mesh's band in each direction, of unlike
    chains.
    """
    override = '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.43\n'
    project.edit("geometry/mobility6.toml", ("[platform]\n", f"{override}\n[platform]\n"))
    result = run_case(LoadedCase(project.edit("cases/fig6.toml", *SMALLER)))
    stage = load_stage(project.path("geometry/mobility6.toml"))
    meshes = [solved(stage, n) for n in (2, 3, 4)]
    for k, label in enumerate(result.curves):
        K = result.stiffness[k]
        C = result.compliance[k]
        np.testing.assert_allclose(
            result.force[k], np.outer([-0.05, 0.0, 0.05], K[:, 1]), rtol=DENSE, atol=1e-9
        )
        moved = C @ result.load[k] - [0.0, 0.05, 0.0]
        np.testing.assert_allclose(
            result.percent[k], 100 * moved * [1, 1, 24] / 0.05, rtol=SOLVED, atol=1e-9
        )
        assert np.min(np.abs(result.percent[k])) > 0.1
        load = 0.05 * K[None, :, 1]
        necks = neck_stresses(stage, meshes[-1], load).highest[0]
        field = meshes[-1].under(load).nodal[0]
        np.testing.assert_allclose(result.neck_stress[k], necks, rtol=SOLVED)
        np.testing.assert_allclose(
            result.fields[label].displacement, field, rtol=0, atol=SOLVED * 0.05
        )
        moves = (
            100
            * (np.array([each.compliance @ K[:, 1] for each in meshes]) - [0, 1, 0])
            * [1, 1, 24]
        )
        np.testing.assert_allclose(result.on_meshes[k], moves, rtol=1e-6, atol=1e-9)
        assert 1e-3 < result.band("percent", curve=label)[1] < 1.0


def test_a_curve_takes_its_formula_and_elastic_links(project):
    linked = ("mobility = 3", 'mobility = 21\nformula = "calibrated"\nlinks = true')
    found = run_case(LoadedCase(project.edit("cases/fig5.toml", linked, *SMALLER)))
    assert abs(found.percent[0, 0]) < 0.1 and found.percent[1, 0] > 10  # 0.5 % with rigid links


def test_the_errors_of_two_models_follow_from_their_compliances():
    """Softer by a tenth: 10 % along and nothing across; what is across counts by the lever."""
    K = np.diag([40.0, 50.0, 46000.0])
    np.testing.assert_allclose(
        error_matrix(K, 1.1 * np.linalg.inv(K), 24.0), 10 * np.eye(3), atol=DENSE
    )
    coupled = np.eye(3)
    coupled[0, 2] = coupled[2, 0] = 0.06
    found = error_matrix(np.eye(3), coupled, 24.0)
    assert found[2, 0] == pytest.approx(100 * 0.06 * 24) and found[0, 2] == pytest.approx(
        100 * 0.06 / 24
    )


def test_a_result_reads_back_with_its_fields_and_of_another_run_they_are_refused(project, tmp_path):
    path = project.edit("cases/fig5.toml", *SMALLER)
    (made,) = verification(path, output=tmp_path)
    again = Verification.read(tmp_path / "fig5.json")
    np.testing.assert_allclose(again.percent, made.percent)
    assert again.models == made.models and again.direction == "x"
    assert set(again.read_fields(tmp_path / "fig5.json")) == set(made.curves)
    with np.load(tmp_path / "fig5.npz") as held:
        arrays = dict(held)
    np.savez(tmp_path / "fig5.npz", **arrays | {"0.stress": arrays["0.stress"] * 1.01})
    with pytest.raises(BadInput, match="not the fields that were stored"):
        again.read_fields(tmp_path / "fig5.json")


def test_results_that_cannot_be_kept_are_refused_before_any_case_is_run(project, tmp_path):
    other = tmp_path / "fig5.toml"
    other.write_text(
        project.path("cases/fig5.toml").read_text().replace("../geometry", str(ROOT / "geometry"))
    )
    with pytest.raises(BadInput, match="would overwrite those of"):
        verification(project.path("cases/fig5.toml"), other, output=tmp_path)
    (tmp_path / "fig5.json").mkdir()
    with pytest.raises(BadInput, match=r"fig5.json: is a folder, expected a file"):
        verification(other, output=tmp_path)


SOLID = ("points = 21", 'points = 3\nmodel = "three_dimensional"\nresolution = 4')


@pytest.mark.slow
def test_a_case_in_three_dimensions_is_what_the_extruded_stage_does(project):
    path = project.edit("cases/fig6.toml", SOLID, ("mobility3.toml", "mobility6.toml"))
    loaded = LoadedCase(path)
    result = run_case(loaded)
    response = solve_solid(loaded.stages["mobility six"], 4, 3)
    K = result.at("stiffness", curve="mobility six")
    expected = 100 * (response.compliance @ K - np.eye(3))[:, 1] * [1, 1, 24]
    np.testing.assert_allclose(
        result.at("percent", curve="mobility six"), expected, rtol=DENSE, atol=1e-9
    )
    assert np.all(result.band("percent")[:, 1] > result.layer_band[:, 1]) and np.all(
        result.layer_band[:, 1] > 0
    )
    assert result.elements == "three_dimensional" and result.models["mobility six"].layers == 3


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ('analysis = "nonlinear"', 'analysis = "nonlinear", expected "linear" with model = "three'),
        ('drive = "joints"', 'drive = "joints", expected "force" with model = "three_dimensional"'),
        ("thickness_resolution = 2", "thickness_resolution = 2"),
        ("layers = 3", "layers: this key is now thickness_resolution"),
    ],
)
def test_what_a_case_in_three_dimensions_does_not_take_is_refused(edit, said, project):
    path = project.edit("cases/fig6.toml", (SOLID[0], f"{SOLID[1]}\n{edit}"))
    with pytest.raises(BadInput, match=re.escape(said)):
        LoadedCase(path)


HOSTILE = {
    "unit of the other direction": (('direction = "x"', 'direction = "theta"'), "amplitude_mrad"),
    "unknown direction": (('direction = "x"', 'direction = "z"'), "direction"),
    "no points": (("points = 21", "points = 1"), "points"),
    "stage missing": (
        ("../geometry/mobility6.toml", "nowhere.toml"),
        'line 16: curve[1].stage = "nowhere.toml": ',
    ),
    "stage that is no stage": (
        ("../geometry/mobility6.toml", "../cases/fig6.toml"),
        "this is a case file",
    ),
    "mobility that nothing has": (("mobility = 6", "mobility = 7"), "mobility"),
    "labels alike": (('label = "mobility six"', 'label = "mobility three"'), "label"),
    "negative amplitude": (("amplitude_um = 50.0", "amplitude_um = -50.0"), "amplitude_um"),
    "links without all freedoms": (
        ("mobility = 6", "mobility = 12\nlinks = true"),
        "curve[1].links = true",
    ),
    "two amplitudes": (
        ("amplitude_um = 50.0", "amplitude_um = 50.0\namplitude_mrad = 1.0"),
        "direction",
    ),
    "unknown key": (("points = 21", "points = 21\nspeed = 3"), "speed"),
    "resolution out of reach": (("points = 21", "points = 21\nresolution = 1"), "resolution"),
    "provenance of nothing": (("[provenance]", '[provenance]\nweight = "assumed"'), "weight"),
}


@pytest.mark.parametrize(("edit", "named"), HOSTILE.values(), ids=HOSTILE)
def test_a_broken_case_is_refused_in_one_line_that_names_the_key(project, edit, named):
    path = project.edit("cases/fig5.toml", edit)
    with pytest.raises(BadInput) as refusal:
        LoadedCase(path)
    assert named in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_refusal_of_a_stage_in_a_run_names_the_case_and_the_curve(project):
    path = project.edit("cases/fig5.toml", ("points = 21", "points = 21\nresolution = 4"))
    project.edit(
        "geometry/mobility3.toml",
        ("thickness_mm = 10.0", 'thickness_mm = 10.0\nmodel = "corrected"'),
    )
    said = r'fig5\.toml, line \d+: curve\[0\], "mobility three": \S*mobility3\.toml, line \d+: model = "corrected", '
    with pytest.raises(BadInput, match=said):
        verification(path, output=None)
