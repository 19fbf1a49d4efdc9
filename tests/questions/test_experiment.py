"""The simulated experiment: readings, slopes, Table II, and which spring alone explains what."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.paper.experiment import experiment, simulated, slope_of, spring_in_series
from flexfem.paper.fixture import MeasuredSlopes, Pole, fixture_of, pushes_of
from flexfem.refused import ComputationFailed

from ..conftest import ROOT
from ..tolerances import DENSE

FIXTURE = fixture_of(ROOT / "cases" / "fixture.toml")
QUIET = {"noise": 0.0, "resolution": 0.0}


def changed(**tables):
    """The shipped set-up with some numbers of its tables changed."""
    return FIXTURE.model_copy(
        update={
            name: getattr(FIXTURE, name).model_copy(update=values)
            for name, values in tables.items()
        }
    )


@pytest.fixture(scope="module")
def unlike(stage):
    """Chains of unequal necks and radii."""
    return stage.replace(
        override={
            (1, "elbow"): {"neck": 0.41},
            (2, "base"): {"radius": 3.4},
            (3, "platform"): {"neck": 0.62},
        }
    )


def analytic(stage, fixture, **others):
    """The experiment on a stage by calibrated hinges and elastic links."""
    return experiment(stage, fixture, models="analytic", **others)


def test_without_noise_the_slope_is_that_of_stage_and_pole_in_series(stage):
    """K_xx = 37.981 and the pole's 6004.65; readings of 1 mN in 1.5 N without noise."""
    exact = changed(lvdt=QUIET, sensor=QUIET)
    found = analytic(stage, exact)
    slope = found.at("slope", source="simulated")
    assert slope[0] == pytest.approx(1 / (1 / 37.98114 + 1 / 6004.652), rel=1e-6)
    np.testing.assert_allclose(slope, found.noiseless, rtol=DENSE)
    np.testing.assert_allclose(np.sum(found.share, axis=1), 100.0)
    np.testing.assert_array_equal(found.load[:, 0], found.load[:, 2])
    assert found.share[2, 1] == pytest.approx(100 * found.noiseless[2] / 796514.57)
    assert found.load[2, 0, -1] == pytest.approx(23.99, rel=2e-3)  # 0.8 N at 30 mm


def test_readings_scatter_by_the_stated_noise_and_step_by_the_stated_step(stage):
    C = flexfem.analyse(stage, links=True, formula="calibrated").compliance
    many = changed(
        lvdt=QUIET | {"noise": 3e-4}, sensor=QUIET | {"noise": 0.02}, run={"repeats": 200}
    )
    exact = changed(lvdt=QUIET, sensor=QUIET, run={"repeats": 1})
    noisy, true = (simulated(pushes_of(each), C, each) for each in (many, exact))
    off = [np.std(a - b, axis=(1, 2)) for a, b in zip(noisy, true, strict=True)]
    np.testing.assert_allclose(
        off[0], [0.02, 0.02, 0.6], rtol=0.04
    )  # N, N, and N mm at an arm of 30 mm
    np.testing.assert_allclose(
        off[1], [3e-4, 3e-4, 3e-4 / 60 * np.sqrt(2)], rtol=0.04
    )  # both ends, 60 mm apart
    stepped, moved = simulated(pushes_of(FIXTURE), C, FIXTURE)
    for values, step in ((stepped[:2], 2e-3), (stepped[2], 6e-2), (moved[:2], 2e-5)):
        np.testing.assert_allclose(values / step, np.round(values / step), atol=1e-9)
    reseeded = changed(run={"seed": FIXTURE.run.seed + 1})
    again, other = (simulated(pushes_of(each), C, each) for each in (FIXTURE, reseeded))
    assert np.array_equal(again[0], stepped) and not np.array_equal(other[0], stepped)


def test_intervals_hold_the_slope_of_the_fixture_in_95_per_cent_of_seeds(stage):
    """What a run would find without noise, pole and bar in it; quantised readings."""
    C = flexfem.analyse(stage, links=True, formula="calibrated").compliance
    few = changed(run={"increments": 5, "repeats": 1})
    of = pushes_of(few)
    held = np.zeros(3)
    true = 1 / sum(of.shares(C))
    for seed in range(300):
        load, moved = simulated(
            of, C, few.model_copy(update={"run": few.run.model_copy(update={"seed": seed})})
        )
        for k in range(3):
            found = slope_of(few.run.strokes, load[k, 0], moved[k, 0], 0.95)
            held[k] += found.low <= true[k] <= found.high
    assert np.all(held >= 272) and np.all(held <= 297)  # 285 of 300, four standard deviations


def test_a_spring_of_twice_or_37_times_the_stiffness_explains_the_papers_deviations(stage):
    """31 % softer by 0.69 / 0.31 = 2.226 K_theta, 2.6 % by 0.974 / 0.026 = 37.46 K_xx."""
    found = analytic(stage, FIXTURE)
    np.testing.assert_allclose(found.ratio, [37.4615, 37.4615, 2.2258], rtol=1e-4)
    assert found.spring[2] == pytest.approx(2.2258 * 46376.8, rel=1e-4)  # about 1e5 N mm/rad
    assert np.all(np.isnan(found.at("slope", source="measured")))
    assert spring_in_series(40.0, 30.0) == pytest.approx(120.0) and np.isnan(
        spring_in_series(40.0, 40.0)
    )
    round_pole = Pole(
        diameter=3.79, height=15.6, youngs_modulus=206e3, poissons_ratio=0.3
    ).compliance
    assert 1 / round_pole.torsion == pytest.approx(found.spring[2], rel=0.03), "as the README says"
    assert 1 / round_pole.end == pytest.approx(found.spring[0], rel=0.03)


def test_measured_slopes_are_compared_with_the_model_and_the_stage(stage):
    given = FIXTURE.model_copy(
        update={"measured": MeasuredSlopes(kxx=37.0, kxx_sd=0.2, ktt=47000.0)}
    )
    found = analytic(stage, given)
    measured = found.at("slope", source="measured")
    assert (measured[0], found.measured_sd[0]) == (37.0, 0.2) and np.isnan(measured[1])
    x = dict(zip(found.axes["against"], found.deviation[0], strict=True))
    assert x["measured"] == pytest.approx(100 * (37.0 / 42.7434 - 1), rel=1e-5)
    assert x["measured relative to stage"] == pytest.approx(100 * (37.0 / 37.98114 - 1), rel=1e-4)
    assert x["stage"] == pytest.approx(-11.1415, rel=1e-4)
    assert np.isnan(found.spring[1]) and np.isnan(found.spring[2]), (
        "not measured, and stiffer than the stage"
    )
    assert found.spring[0] == pytest.approx(37.0 * 37.98114 / 0.98114, rel=1e-4)


def test_a_push_leaves_the_other_directions_free_and_on_the_bar_is_a_force_too(unlike):
    """Of 1 N at 30 mm along y: C_tt + C_ty / 30 is read, not C_tt. A measured slope is explained
    from there.
    """
    found = analytic(unlike, FIXTURE.model_copy(update={"measured": MeasuredSlopes(ktt=36000.0)}))
    C = flexfem.analyse(unlike, links=True, formula="calibrated").compliance
    np.testing.assert_allclose(found.at("slope", source="stage"), 1 / np.diag(C), rtol=DENSE)
    assert any(
        text.startswith("a force in x leaves the other directions free") for text in found.warnings
    )
    read = 1 / (C[2, 2] + C[2, 1] / 30.0)
    assert abs(read * C[2, 2] - 1) > 0.005
    said = f"on a rigid fixture the slope is {read:.5g}, and 1/C is {1 / C[2, 2]:.5g}"
    assert any(
        text.startswith("a force in theta also loads other") and said in text
        for text in found.warnings
    )
    assert not any("a force in x also" in text for text in found.warnings)
    assert found.spring[2] == pytest.approx(36000.0 * read / (read - 36000.0), rel=DENSE)


def test_finite_elements_are_the_stage(unlike):
    compliance = flexfem.solve(unlike, resolution=3).compliance
    found = experiment(unlike, FIXTURE, resolution=3)
    assert found.settings["stage"] == "finite elements, plane stress"
    np.testing.assert_allclose(
        found.at("slope", source="stage"), 1 / np.diag(compliance), rtol=DENSE
    )
    own = analytic(unlike, FIXTURE).at("slope", source="stage")
    np.testing.assert_allclose(own, found.at("slope", source="stage"), rtol=2e-3)


def test_what_the_run_cannot_say_is_said(stage):
    quiet = changed(lvdt={"noise": 1e-6})
    said = " ".join(analytic(stage, quiet).warnings)
    assert "lvdt.noise_um is below half of lvdt.resolution_um" in said
    assert [text[:12] for text in analytic(stage, FIXTURE).warnings] == [
        "plane stress"
    ]  # the thickness
    strong = changed(actuator={"stroke": 9.0}, run={"increment": 0.4})
    assert "beyond the yield strength" in " ".join(analytic(stage, strong).warnings)
    for sensor, what, step in (("lvdt", "displacement", 0.9), ("sensor", "load", 900.0)):  # mm, N
        with pytest.raises(
            ComputationFailed, match=f"the {what} reading in x does not change with the stroke"
        ):
            analytic(stage, changed(**{sensor: {"noise": 0.0, "resolution": step}}))


@pytest.mark.filterwarnings("error")
def test_a_pole_like_a_hair_leaves_no_slope_to_read(stage):
    """0.001 mm thick, 1.5e-12 N/mm: the noise of 0.02 N buries its force, and without noise its
    slope is read.
    """
    with pytest.raises(
        ComputationFailed, match=r"slope in x, -?\d.*cannot be distinguished from zero: expected a"
    ):
        analytic(stage, changed(pole={"diameter": 0.001}))
    found = analytic(
        stage, changed(pole={"diameter": 0.001}, lvdt=QUIET, sensor=QUIET, bar={"angle": 0.7})
    )
    slope = found.at("slope", direction="x", source="simulated")
    assert slope == pytest.approx(found.pole[0], rel=DENSE) and slope == pytest.approx(
        1.517e-12, rel=1e-3
    )
    C = flexfem.analyse(stage, links=True, formula="calibrated").compliance
    np.testing.assert_allclose(
        pushes_of(changed(pole={"diameter": 0.001})).shares(C)[0], np.diag(C), rtol=DENSE
    )


# slopes


STROKE = np.array([0.0, 1.0, 2.0, 3.5, 5.0])


def noisy(seed, command, force_sd, displacement_sd, slope=7.0):
    noise = np.random.default_rng(seed).normal(size=(2, len(command)))
    return 3.0 + slope * 0.4 * command + force_sd * noise[
        0
    ], 0.2 + 0.4 * command + displacement_sd * noise[1]


def test_a_line_without_errors_has_its_slope_and_intercept():
    """Also when the command bends: it is only the instrument."""
    for command in (STROKE, STROKE**1.7):
        found = slope_of(STROKE, 2.0 + 7.0 * 0.4 * command, 0.4 * command, 0.95)
        assert found.slope == pytest.approx(7.0, rel=1e-12) and found.intercept == pytest.approx(
            2.0, rel=1e-10
        )
        assert found.low == pytest.approx(7.0, rel=1e-6) and found.high == pytest.approx(
            7.0, rel=1e-6
        )


def test_errors_of_the_displacement_do_not_flatten_the_slope():
    """Its variance is a quarter of that of the displacements: a regression on it would be 20 % low."""
    command = np.linspace(0.0, 5.0, 40)
    sd = 0.5 * np.std(0.4 * command)
    found = [slope_of(command, *noisy(seed, command, 0.1, sd), 0.95).slope for seed in range(300)]
    assert np.median(found) == pytest.approx(7.0, rel=0.02)


def test_readings_that_do_not_follow_the_command_bound_no_slope():
    found = slope_of(STROKE, *noisy(4, STROKE, 0.5, 20.0), 0.95)
    assert np.isnan([found.low, found.high]).all() and np.isfinite(found.slope)
    assert np.isnan(slope_of(STROKE, STROKE, np.zeros(5), 0.95).slope)
