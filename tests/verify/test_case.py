"""Case files: what they mean, and how broken ones are refused."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from flexfem.fem.fields import load_case
from flexfem.mechanism.stage import load_stage
from flexfem.plot.text import markdown_report
from flexfem.refused import BadInput
from flexfem.verify.case import LoadedCase
from flexfem.verify.protocol import run_case, solve_stage

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("path", sorted((ROOT / "cases").glob("fig*.toml")), ids=lambda path: path.stem)
def test_shipped_cases_state_where_their_numbers_come_from(path):
    case = LoadedCase(path).case
    assert {"points"} | {key for key in ("amplitude_um", "amplitude_mrad") if getattr(case, key)} <= set(case.assumed)
    assert {curve.mobility for curve in case.curve} == {3, 6}


@pytest.mark.parametrize(("figure", "largest"), [("fig5", 0.05), ("fig6", 0.05), ("fig7", 1e-3)])
def test_commands_are_symmetric_and_in_millimetres_or_radians(figure, largest):
    commanded = LoadedCase(ROOT / f"cases/{figure}.toml").case.commanded
    assert len(commanded) == 21
    assert commanded[10] == 0.0
    np.testing.assert_allclose(commanded, -commanded[::-1], atol=1e-18)
    assert commanded[-1] == pytest.approx(largest)


SMALLER = (("points = 21", "points = 3\nresolution = 4"), ("mobility3.toml", "mobility6.toml"))  # one stage, two models


@pytest.fixture(scope="module")
def solve():
    """Every mesh is solved once."""
    return cache(solve_stage)


def nonlinear_and_linear(project, solve, amplitude):
    case = project.edit("cases/fig5.toml", ("amplitude_um = 50.0", f"amplitude_um = {amplitude}"), *SMALLER)
    linear, _ = run_case(LoadedCase(case), solve)
    bent = project.edit("cases/fig5.toml", ("points = 3", 'points = 3\nanalysis = "nonlinear"'))
    return run_case(LoadedCase(bent), solve)[0], linear


@pytest.mark.slow
def test_small_nonlinear_cases_are_the_linear_ones(project, solve):
    nonlinear, linear = nonlinear_and_linear(project, solve, 0.01)
    for label, percent in linear.error_percent.items():
        for axis in ("x", "y", "theta"):
            found = getattr(nonlinear.error_percent[label], axis)
            assert found == pytest.approx(getattr(percent, axis), abs=2e-5)  # falls with the command


def test_large_commands_bend_the_error_curve_and_its_percentage_is_at_the_largest(project, solve):
    nonlinear, linear = nonlinear_and_linear(project, solve, 500.0)
    for label, curve in nonlinear.curves.items():
        assert nonlinear.commanded == linear.commanded == [-0.5, 0.0, 0.5]
        assert curve.x[1] == pytest.approx(0.0, abs=1e-12)
        assert 1e-3 < abs(curve.x[0] + curve.x[2]) / curve.x[2] < 0.1  # no longer odd in the command
        assert nonlinear.error_percent[label].x == pytest.approx(100 * curve.x[2] / 0.5, rel=1e-12)
        assert nonlinear.error_percent[label].theta == pytest.approx(100 * curve.theta[2] * 24 / 0.5, rel=1e-12)
        straight = linear.curves[label].x
        assert straight[0] == pytest.approx(-straight[2], rel=1e-9)
        # what is even in the command drops out; the rest is the linear error but for terms of third order: 3e-4
        assert curve.x[2] - curve.x[0] == pytest.approx(2 * straight[2], rel=2e-3)


def test_what_a_curve_says_of_its_two_models(project, solve):
    """Force by (18), stress at the full command, and the mesh's band in each direction, of unlike chains."""
    override = '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.43\n'
    project.edit("geometry/mobility6.toml", ("[platform]\n", f"{override}\n[platform]\n"))
    result, fields = run_case(LoadedCase(project.edit("cases/fig6.toml", *SMALLER)), solve)
    for label, model in result.models.items():
        K, C, full = np.array(model.stiffness), np.array(model.compliance), np.array(model.force[-1])
        np.testing.assert_allclose(model.force, np.outer([-0.05, 0.0, 0.05], K[:, 1]), rtol=1e-9, atol=1e-9)
        moved = C @ full - [0.0, 0.05, 0.0]
        percent = result.error_percent[label]
        expected = (100 * moved[0] / 0.05, 100 * moved[1] / 0.05, 100 * moved[2] * 24.0 / 0.05)
        assert (percent.x, percent.y, percent.theta) == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert min(map(abs, expected)) > 0.1
        stage = load_stage(project.path("geometry/mobility6.toml"))
        solved = solve(stage, 4)
        case = load_case(stage, solved.mesh, solved.response, 0.05 * K[:, 1])
        np.testing.assert_allclose(model.neck_stress, case.neck_stress, rtol=1e-9)
        np.testing.assert_allclose(fields[label].displacement, case.field, rtol=0, atol=1e-12)
        along = result.uncertainty[label]["y"]
        assert along.values[-1] == pytest.approx(percent.y, rel=1e-9) and along.resolutions == [2, 3, 4]
        moves = 100 * np.array([solve(stage, n).response.compliance @ K[:, 1] for n in (2, 3, 4)])
        assert along.values == pytest.approx(moves[:, 1] - 100, rel=1e-6)
        assert result.uncertainty[label]["theta"].values == pytest.approx(24.0 * moves[:, 2], rel=1e-6)
        assert 1e-3 < along.band < 1.0


@pytest.mark.parametrize(
    ("key", "inside", "outside"),
    [
        ("resolution", (4, 64), (3, 65)),
        ("points", (3, 10_001), (2, 10_002)),
        ("amplitude_um", (1e-9, 1e6), (0.0, 0.99e-9, 1.001e6)),
    ],
)
def test_limits_of_a_case_are_just_where_they_are_said_to_be(project, key, inside, outside):
    edit = {"points": "points = 21", "amplitude_um": "amplitude_um = 50.0", "resolution": "points = 21"}[key]
    text = project.path("cases/fig5.toml").read_text()
    for values, accepted in ((inside, True), (outside, False)):
        for value in values:
            new = f"points = 21\n{key} = {value}" if key == "resolution" else f"{key} = {value}"
            project.path("cases/fig5.toml").write_text(text.replace(edit, new))
            if accepted:
                assert getattr(LoadedCase(project.path("cases/fig5.toml")).case, key) == value
            else:
                with pytest.raises(BadInput, match=key):
                    LoadedCase(project.path("cases/fig5.toml"))


HOSTILE = {
    "unit of the other direction": (('direction = "x"', 'direction = "theta"'), "amplitude_mrad"),
    "unknown direction": (('direction = "x"', 'direction = "z"'), "direction"),
    "no points": (("points = 21", "points = 1"), "points"),
    "too many points": (("points = 21", "points = 1000000000"), "points"),
    "stage missing": (("../geometry/mobility6.toml", "nowhere.toml"), "nowhere.toml: no such file"),
    "stage that is no stage": (("../geometry/mobility6.toml", "../cases/fig6.toml"), "fig6.toml"),
    "mobility that nothing has": (("mobility = 6", "mobility = 7"), "mobility"),
    "unknown formula": (("mobility = 6", 'mobility = 6\nformula = "guess"'), "paros-weisbord"),
    "labels alike": (('label = "mobility six"', 'label = "mobility three"'), "label"),
    "negative amplitude": (("amplitude_um = 50.0", "amplitude_um = -50.0"), "amplitude_um"),
    "infinite amplitude": (("amplitude_um = 50.0", "amplitude_um = inf"), "amplitude_um"),
    "links without all freedoms": (("mobility = 6", "mobility = 12\nlinks = true"), "curve[1].links = true"),
    "two amplitudes": (("amplitude_um = 50.0", "amplitude_um = 50.0\namplitude_mrad = 1.0"), "direction"),
    "analysis that nobody does": (("points = 21", 'points = 21\nanalysis = "plastic"'), "analysis"),
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


def test_elastic_links_bring_the_force_to_that_of_the_finite_elements(project):
    """Links and platform are worth 0.5 % on the reference stage, and what the chart and the links leave 0.01 %."""
    linked = 'mobility = 21\nformula = "calibrated"\nlinks = true'
    edits = (("mobility = 3", linked.replace("true", "false")), ("mobility = 6", linked), ("mobility3", "mobility6"))
    path = project.edit("cases/fig5.toml", *edits)
    solved = solve_stage(LoadedCase(path).stages["mobility six"], 6)
    result, _ = run_case(LoadedCase(path), lambda *_: solved)
    rigid, elastic = (result.error_percent[label].x for label in ("mobility three", "mobility six"))
    assert 0.4 < rigid < 0.7 and abs(elastic) < 0.05
    assert "calibrated, elastic links" in markdown_report([result])
    project.edit("cases/fig5.toml", ("points = 21", 'points = 21\nanalysis = "nonlinear"'))
    with pytest.raises(BadInput, match=r"curve\[1\].links = true, expected no links"):
        LoadedCase(path)
