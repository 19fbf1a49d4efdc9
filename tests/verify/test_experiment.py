"""The simulated experiment: readings, slopes, Table II, and which spring alone explains what."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.refused import ComputationFailed
from flexfem.verify.experiment import experiment, simulated
from flexfem.verify.fixture import Pole, read_fixture
from flexfem.verify.measured import MeasuredSlopes
from flexfem.verify.pushes import pole_compliance, pushes_of, read_compliance, stage_share
from flexfem.verify.series import spring_in_series

ROOT = Path(__file__).parents[2]
FIXTURE = read_fixture(ROOT / "cases" / "fixture.toml")
AXES = ("x", "y", "theta")


def changed(**tables):
    """The shipped set-up with some numbers of its tables changed."""
    return FIXTURE.model_copy(
        update={name: getattr(FIXTURE, name).model_copy(update=values) for name, values in tables.items()}
    )


@pytest.fixture(scope="module")
def stage():
    return flexfem.load(ROOT / "geometry" / "mobility6.toml")


@pytest.fixture(scope="module")
def unlike():
    """Chains of unequal necks and radii."""
    return flexfem.load(ROOT / "geometry" / "mobility6.toml").replace(
        override={(1, "elbow"): {"neck": 0.41}, (2, "base"): {"radius": 3.4}, (3, "platform"): {"neck": 0.62}}
    )


def test_without_noise_the_slope_is_that_of_stage_and_pole_in_series(stage):
    """K_xx = 37.981 and the pole's 6004.65; readings of 1 mN in 1.5 N without noise."""
    exact = changed(lvdt={"noise": 0.0, "resolution": 0.0}, sensor={"noise": 0.0, "resolution": 0.0})
    found = experiment(stage, exact)
    assert found.pushed["x"].slope == pytest.approx(1 / (1 / 37.98114 + 1 / 6004.652), rel=1e-6)
    for axis in AXES:
        push = found.pushed[axis]
        assert push.slope == pytest.approx(push.noiseless, rel=1e-9) and push.dof == 61
        assert sum(push.share.values()) == pytest.approx(100.0)
        assert push.load[0] == push.load[2] and push.displacement[0][0] == 0.0
    assert found.pushed["theta"].share["pole"] == pytest.approx(100 * found.pushed["theta"].noiseless / 796514.57)
    assert np.asarray(found.pushed["theta"].load)[0, -1] == pytest.approx(23.99, rel=2e-3)  # 0.8 N at 30 mm


def test_readings_scatter_by_the_stated_noise_and_step_by_the_stated_step(stage):
    C = flexfem.analyse(stage, links=True, formula="calibrated").compliance
    many = changed(
        lvdt={"noise": 3e-4, "resolution": 0.0}, sensor={"noise": 0.02, "resolution": 0.0}, run={"repeats": 200}
    )
    exact = changed(
        lvdt={"noise": 0.0, "resolution": 0.0}, sensor={"noise": 0.0, "resolution": 0.0}, run={"repeats": 1}
    )
    noisy, true = (simulated(pushes_of(each), C, each) for each in (many, exact))
    off = [np.std(a - b, axis=(1, 2)) for a, b in zip(noisy, true, strict=True)]
    np.testing.assert_allclose(off[0], [0.02, 0.02, 0.6], rtol=0.04)  # N, N, and N mm at an arm of 30 mm
    np.testing.assert_allclose(off[1], [3e-4, 3e-4, 3e-4 / 60 * np.sqrt(2)], rtol=0.04)  # both ends, 60 mm apart
    stepped = simulated(pushes_of(FIXTURE), C, FIXTURE)
    for values, step in ((stepped.load[:2], 2e-3), (stepped.load[2], 6e-2), (stepped.displacement[:2], 2e-5)):
        np.testing.assert_allclose(values / step, np.round(values / step), atol=1e-9)
    again, other = (
        simulated(pushes_of(each), C, each) for each in (FIXTURE, changed(run={"seed": FIXTURE.run.seed + 1}))
    )
    assert np.array_equal(again.load, stepped.load) and not np.array_equal(other.load, stepped.load)


def test_intervals_hold_the_slope_of_the_fixture_in_95_per_cent_of_seeds(stage):
    """What a run would find without noise, pole and bar in it; quantised readings."""
    from flexfem.verify.slopes import slope_of

    C = flexfem.analyse(stage, links=True, formula="calibrated").compliance
    few = changed(run={"increments": 5, "repeats": 1})
    of, held = pushes_of(few), np.zeros(3)
    true = 1 / read_compliance(of, C)
    for seed in range(300):
        load, moved = simulated(of, C, few.model_copy(update={"run": few.run.model_copy(update={"seed": seed})}))
        for k in range(3):
            found = slope_of(few.run.strokes, load[k, 0], moved[k, 0], 0.95)
            held[k] += found.low <= true[k] <= found.high
    assert np.all(held >= 272) and np.all(held <= 297)  # 285 of 300, four standard deviations


def test_a_spring_of_twice_or_37_times_the_stiffness_explains_the_papers_deviations(stage):
    """31 % softer by 0.69 / 0.31 = 2.226 K_theta, 2.6 % by 0.974 / 0.026 = 37.46 K_xx."""
    found = experiment(stage, FIXTURE)
    assert found.alone["theta"].ratio == pytest.approx(2.2258, rel=1e-4)
    assert [found.alone[axis].ratio for axis in "xy"] == pytest.approx([37.4615, 37.4615], rel=1e-5)
    assert found.alone["theta"].stiffness == pytest.approx(2.2258 * 46376.8, rel=1e-4)  # about 1e5 N mm/rad
    assert found.explained == "the paper's text" and found.table["x"].measured is None
    assert spring_in_series(40.0, 30.0) == pytest.approx(120.0) and spring_in_series(40.0, 40.0) is None


def test_a_round_pole_of_steel_16_mm_high_and_4_mm_thick_explains_both(stage):
    """As the README says: pushed at its end it has both stiffnesses, to 1 %."""
    found = pole_compliance(Pole(diameter=3.79, height=15.6, youngs_modulus=206e3, poissons_ratio=0.3))
    alone = experiment(stage, FIXTURE).alone
    assert 1 / found.torsion == pytest.approx(alone["theta"].stiffness, rel=0.03)
    assert 1 / found.bending[1] == pytest.approx(alone["x"].stiffness, rel=0.03)


def test_measured_slopes_are_compared_with_model_and_metal(stage):
    given = FIXTURE.model_copy(update={"measured": MeasuredSlopes(kxx=37.0, kxx_sd=0.2, ktt=47000.0)})
    found = experiment(stage, given)
    row = found.table["x"]
    assert (row.measured, row.measured_sd) == (37.0, 0.2) and found.table["y"].measured is None
    assert row.deviation["measured"] == pytest.approx(100 * (37.0 / 42.7434 - 1), rel=1e-5)
    assert row.deviation["measured from metal"] == pytest.approx(100 * (37.0 / 37.98114 - 1), rel=1e-4)
    assert row.deviation["metal"] == pytest.approx(-11.1415, rel=1e-4)
    assert set(found.alone) == {"x", "theta"} and found.alone["theta"].stiffness is None  # stiffer than the metal
    assert found.alone["x"].stiffness == pytest.approx(37.0 * 37.98114 / 0.98114, rel=1e-4)
    assert found.explained == "the measured slopes"


def test_a_push_leaves_the_other_directions_free(unlike):
    found = experiment(unlike, FIXTURE)
    C = np.linalg.inv(found.metal_stiffness)
    for k, axis in enumerate(AXES):
        assert found.table[axis].metal == pytest.approx(1 / C[k, k], rel=1e-9)
    assert found.metal_stiffness[0][0] > 1.001 * found.table["x"].metal
    assert any(text.startswith("a push in x leaves the other directions free") for text in found.warnings)


def test_a_push_on_the_bar_is_a_force_too(unlike):
    """Of 1 N at 30 mm along y: C_tt + C_ty / 30 is read, not C_tt. A measured slope is explained from there."""
    found = experiment(unlike, FIXTURE.model_copy(update={"measured": MeasuredSlopes(ktt=36000.0)}))
    C = np.linalg.inv(found.metal_stiffness)
    read = 1 / (C[2, 2] + C[2, 1] / 30.0)
    assert abs(read * C[2, 2] - 1) > 0.005
    said = f"on a rigid fixture the slope is {read:.5g}, where 1/C is {1 / C[2, 2]:.5g}"
    assert any(text.startswith("a push in theta is also one in other") and said in text for text in found.warnings)
    assert not any("a push in x is also" in text for text in found.warnings)
    assert found.alone["theta"].stiffness == pytest.approx(36000.0 * read / (read - 36000.0), rel=1e-9)


def test_finite_elements_are_the_metal(unlike):
    solved = flexfem.solve(unlike, resolution=3)
    found = experiment(unlike, FIXTURE, solved=solved.solved)
    assert found.metal == "finite elements, plane stress"
    assert found.table["theta"].metal == pytest.approx(1 / solved.compliance[2, 2], rel=1e-12)
    analytic = experiment(unlike, FIXTURE)
    assert analytic.metal == "calibrated, elastic links, plane stress"
    assert analytic.table["theta"].metal == pytest.approx(found.table["theta"].metal, rel=2e-3)


def test_what_the_run_cannot_say_is_said(stage):
    quiet = changed(lvdt={"noise": 1e-6, "rotation": "one end"})
    said = " ".join(experiment(stage, quiet).warnings)
    assert "lvdt.noise_um is below half of lvdt.resolution_um" in said
    assert "the translation of the platform is read as rotation" in said
    assert [text[:12] for text in experiment(stage, FIXTURE).warnings] == ["plane stress"]  # the thickness
    strong = changed(actuator={"stroke": 9.0}, run={"increment": 0.4})
    assert "beyond the yield strength" in " ".join(experiment(stage, strong).warnings)
    for sensor, what, step in (("lvdt", "displacement", 0.9), ("sensor", "load", 900.0)):  # mm, N
        with pytest.raises(ComputationFailed, match=f"the {what} read in x does not change with the stroke"):
            experiment(stage, changed(**{sensor: {"noise": 0.0, "resolution": step}}))


@pytest.mark.filterwarnings("error")
def test_a_pole_like_a_hair_leaves_no_slope_to_read_and_the_stage_behind_it_as_stiff_as_it_is(stage):
    """0.001 mm thick, 1.5e-12 N/mm: the noise of 0.02 N buries its force, and without noise its slope is read."""
    with pytest.raises(ComputationFailed, match=r"slope read in x, -?\d.*cannot be told from zero: expected a stiffer"):
        experiment(stage, changed(pole={"diameter": 0.001}))
    quiet = {"noise": 0.0, "resolution": 0.0}
    found = experiment(stage, changed(pole={"diameter": 0.001}, lvdt=quiet, sensor=quiet, bar={"angle": 0.7}))
    assert found.pushed["x"].slope == pytest.approx(found.alone["x"].pole, rel=1e-9)
    assert found.pushed["x"].slope == pytest.approx(1.517e-12, rel=1e-3)
    C = flexfem.analyse(stage, links=True, formula="calibrated").compliance
    np.testing.assert_allclose(stage_share(pushes_of(changed(pole={"diameter": 0.001})), C), np.diag(C), rtol=1e-12)
