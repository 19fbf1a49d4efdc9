"""Case files: what they mean, and how broken ones are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.errors import BadInput
from flexfem.verify.case import LoadedCase
from flexfem.verify.protocol import run_case

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


def test_small_nonlinear_cases_are_the_linear_ones(project):
    small = ("amplitude_um = 50.0", "amplitude_um = 0.01"), ("points = 21", "points = 3\nresolution = 4")
    linear, _ = run_case(LoadedCase(project.edit("cases/fig5.toml", *small)))
    bent = project.edit("cases/fig5.toml", ("points = 3", 'points = 3\nanalysis = "nonlinear"'))
    nonlinear, _ = run_case(LoadedCase(bent))
    for label, percent in linear.error_percent.items():
        assert nonlinear.error_percent[label].x == pytest.approx(percent.x, abs=1e-4)  # falls with the command


def test_large_commands_bend_the_error_curve(project):
    large = (
        ("amplitude_um = 50.0", "amplitude_um = 500.0"),
        ("points = 21", 'points = 3\nanalysis = "nonlinear"\nresolution = 4'),
    )
    result, _ = run_case(LoadedCase(project.edit("cases/fig5.toml", *large)))
    for curve in result.curves.values():
        assert curve.x[1] == pytest.approx(0.0, abs=1e-12)
        assert abs(curve.x[0] + curve.x[2]) > 1e-4 * abs(curve.x[2])  # no longer odd in the command


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
