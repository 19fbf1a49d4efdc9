"""Fatigue life of the necks: Basquin's law, mean stress, both models, the fit of S-N points."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

import flexfem
from flexfem.commands import cli
from flexfem.hinges.strength import checked_law, equivalent
from flexfem.paper.life import by_model, element_values
from flexfem.paper.solutions import solved
from flexfem.plot.life import life_figure, plot_life
from flexfem.questions.life import CyclicMotion, cyclic_motion, factor_at
from flexfem.results import ANALYTIC, ELEMENTS

from ..conftest import ROOT
from ..tolerances import SOLVED

GEOMETRY = ROOT / "geometry"
STRESS = [948, 834, 703, 631, 579, 524]
CYCLES = [222, 992, 6004, 14130, 43860, 132150]
UNLIKE = {
    (2, "elbow"): {"neck": 0.43},
    (3, "platform"): {"radius": 1.8},
    (1, "base"): {"neck": 0.57},
}


@pytest.fixture(scope="module")
def unlike():
    """A stage with three different chains, of 2024-T4."""
    return flexfem.load(GEOMETRY / "mobility6.toml").replace(override=UNLIKE, material="al-2024-t4")


def analytic(stage, amplitude, **others):
    """The life by the analytic model."""
    return flexfem.life(stage, amplitude=amplitude, models="analytic", **others)


def test_basquin_counts_reversals_two_a_cycle():
    """sigma'_f 900 MPa, b = -0.102, by hand: at 219.8 MPa (219.8/900)^(1/-0.102) = 1.0045e6
    reversals.
    """
    law = flexfem.Basquin(900.0, -0.102)
    assert float(law.cycles(219.8)) == pytest.approx(5.02e5, rel=3e-3)
    assert float(law.cycles(900.0)) == 0.5  # one reversal
    assert (
        float(law.amplitude(1e6))
        == pytest.approx(900 * 2e6**-0.102)
        == pytest.approx(204.9, abs=0.05)
    )
    assert math.isinf(float(law.cycles(0.0)))


def test_mean_stress_by_walker_and_by_smith_watson_and_topper():
    """Of 100 about 60 MPa: SWT sqrt(160 100) = 126.49; gamma 0.65: 160^0.35 100^0.65 = 117.88; none
    pulled, no harm.
    """
    a = np.array([100.0, 100.0, 100.0, 100.0])
    m = np.array([60.0, 0.0, -60.0, -130.0])
    assert equivalent(a, m, 0.5) == pytest.approx([126.491, 100.0, 63.2456, 0.0], rel=1e-5)
    assert equivalent(a, m, 0.65)[:3] == pytest.approx([117.8805, 100.0, 72.5640], rel=1e-5)
    assert equivalent(a, m, 1.0) == pytest.approx([100.0, 100.0, 100.0, 0.0])


def test_dowlings_example_is_fitted_to_the_digits_of_the_book():
    """Mechanical Behavior of Materials, 4th ed., Example 9.1: A 1587 MPa, B -0.0945, sigma'_f 1695
    MPa.
    """
    found = flexfem.fit_basquin(STRESS, CYCLES)
    assert (round(found.A), round(found.B, 4), round(found.coefficient)) == (1587, -0.0945, 1695)
    assert found.exponent_interval == pytest.approx((-0.1012, -0.0886), abs=1e-4)
    assert found.coefficient_interval == pytest.approx((1600, 1809), abs=1)
    assert found.law.cycles(found.law.amplitude(1e5)) == pytest.approx(1e5) and found.law.range == (
        222,
        132150,
    )
    assert found.scatter == pytest.approx(0.0549, abs=1e-4)
    exact = flexfem.fit_basquin(
        found.law.amplitude(CYCLES), CYCLES
    )  # points on the line: an interval of no width
    assert exact.coefficient_interval == pytest.approx((found.coefficient,) * 2, rel=1e-6)


@pytest.mark.parametrize(
    ("stress", "cycles", "said"),
    [
        ([500, 400, 300], [1e3, 1e4], "expected the same number"),
        ([500, 500, 500], [1e3, 1e4, 1e5], "stress: all are 500 MPa"),
        ([500, 400, 300], [0, 1e4, 1e5], "cycles: expected a list of numbers above 0"),
        ([500, 400, 300], [1e5, 1e4, 1e3], "life must fall with stress"),
        ("many", [1e4], "stress: expected numbers"),
    ],
)
def test_impossible_points_are_refused_in_one_line(stress, cycles, said):
    with pytest.raises(flexfem.BadInput, match=said) as refused:
        flexfem.fit_basquin(stress, cycles)
    assert "\n" not in str(refused.value)
    with pytest.raises(flexfem.BadInput, match="law: range 'ab', expected two numbers of cycles"):
        checked_law(flexfem.Basquin(900.0, -0.1, range="ab"))


def test_the_stress_at_zero_mean_is_the_neck_stress_of_the_models(unlike):
    """By another route, `neck_stress`: no concentration is counted twice, none is left out."""
    pose = (0.031, -0.017, 4e-4)
    found = flexfem.life(unlike, amplitude=pose, resolution=5)
    stresses = flexfem.analyse(unlike).neck_stress(pose), flexfem.solve(unlike, 5).neck_stress(pose)
    for k, stress in enumerate(stresses):
        np.testing.assert_allclose(found.equivalent[k], stress, rtol=SOLVED)
        assert found.life[k] == pytest.approx(
            0.5 * (np.max(stress) / 900) ** (1 / -0.102), rel=1e-6
        )
        assert found.safety[k] == pytest.approx(303.0 / np.max(stress))
    band = np.nanmax(found.band("equivalent", model=ELEMENTS))
    assert band / np.max(stresses[1]) == pytest.approx(0.0071, rel=0.25)


def test_notch_sensitivity_lets_less_of_the_concentration_count_and_all_of_it_for_yield(unlike):
    """By hand: K = 1.0642 in bending at t/R = 1/3, so that (1 + 0.4 0.0642) / 1.0642 = 0.9638
    counts; nine necks.
    """
    by_hand = [
        0.98364,
        0.96382,
        0.96382,
        0.98558,
        0.96847,
        0.96382,
        0.98558,
        0.96382,
        0.96937,
    ]  # t/R 0.125 to 0.333
    asked = {"amplitude": (0.05, 0.02, 0.0), "ratio": 0, "resolution": 4}
    full, part = (flexfem.life(unlike, **asked, notch_sensitivity=q) for q in (1.0, 0.4))
    ratios = np.broadcast_to(np.reshape(by_hand, (3, 3)), (2, 3, 3))
    np.testing.assert_allclose(part.equivalent / full.equivalent, ratios, atol=2e-5)
    np.testing.assert_array_equal(part.peak, full.peak)
    np.testing.assert_array_equal(part.safety, full.safety)
    assert np.all(part.life > full.life)


@pytest.mark.slow
def test_both_models_agree_on_unlike_chains_with_a_mean(unlike):
    """Neck by neck, where it matters, in one plane; the stress within 2 %, the first neck within
    its error.
    """
    asked = {"amplitude": (0.05, 0.02, -3e-4), "mean": (-0.04, 0.05, 6e-4)}
    stage = unlike.replace(model="plane_stress")
    found = flexfem.life(stage, **asked)
    highest = np.max(found.equivalent[1])
    np.testing.assert_allclose(found.equivalent[0], found.equivalent[1], atol=0.02 * highest)
    first = np.argmax(found.equivalent[1])
    assert np.argmax(found.equivalent[0]) == first and abs(found.mean[1].flat[first]) > 10
    assert (
        found.fewest[0] < found.life[1] < found.most[0]
        and found.fewest[1] < found.life[1] < found.most[1]
    )
    finer = flexfem.life(stage, **asked, models="elements", resolution=15)
    assert found.fewest[1] < finer.life[0] < found.most[1]


def test_a_ratio_is_least_over_greatest_and_shortens_life(unlike):
    reversed_, pulsating = (analytic(unlike, (0.05, 0, 0), ratio=r) for r in (-1, 0))
    first = np.argmax(pulsating.equivalent)
    assert pulsating.mean.flat[first] == pytest.approx(pulsating.amplitude.flat[first])
    assert not np.any(reversed_.mean)
    assert pulsating.equivalent.flat[first] == pytest.approx(
        2**0.5 * reversed_.equivalent.flat[first]
    )  # sqrt(2 a a)
    half = analytic(unlike, (0.05, 0, 0), ratio=0.5)
    mean = analytic(unlike, (0.05, 0, 0), mean=(0.15, 0, 0))
    assert mean.life[0] == pytest.approx(half.life[0])
    assert mean.factor[0] > half.factor[0], "the mean stays"


@pytest.fixture(scope="module")
def modelled(unlike):
    return flexfem.analyse(unlike, formula="calibrated", links=True).result


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(*[st.floats(-0.1, 0.1)] * 2, st.floats(-2e-3, 2e-3)).filter(
        lambda p: abs(p[0]) > 1e-3
    ),
    st.one_of(st.floats(-1.0, 0.9), st.tuples(*[st.floats(-0.2, 0.2)] * 2, st.floats(-2e-3, 2e-3))),
    st.floats(1e2, 1e8),
    st.floats(0.2, 1.0),
)
def test_the_amplitude_for_a_life_has_that_life(unlike, modelled, pose, about, cycles, walker):
    law = flexfem.Basquin(1340.0, -0.087, walker)
    mean, ratio = (np.array(about), -1.0) if isinstance(about, tuple) else (None, about)
    motion = cyclic_motion(np.array(pose), mean, ratio, 1e6)
    factor = factor_at(by_model(unlike, modelled, motion), law, cycles, motion.proportional)
    again = by_model(unlike, modelled, cyclic_motion(factor * np.array(pose), mean, ratio, 1e6))
    assert float(law.cycles(np.max(again.equivalent(law.walker)))) == pytest.approx(
        cycles, rel=1e-6
    )


def test_the_amplitude_for_the_wanted_life_has_it(unlike):
    asked = {"mean": (0.1, 0, 0), "cycles": 3e5}
    first = analytic(unlike, (0.05, -0.02, 4e-4), **asked)
    np.testing.assert_allclose(first.largest[0], first.factor[0] * np.array([0.05, -0.02, 4e-4]))
    again = analytic(unlike, tuple(first.largest[0]), **asked)
    assert first.factor[0] > 1.5 and (again.life[0], again.factor[0]) == (
        pytest.approx(3e5),
        pytest.approx(1.0),
    )
    assert first.peak_at_largest[0] == pytest.approx(303.0 / again.safety[0])


def test_what_basquin_is_not_for_is_warned_of(unlike):
    far = analytic(unlike, (0.4, 0, 0))
    assert far.safety[0] < 1 and any(
        "beyond the yield strength of 303" in text for text in far.warnings
    )
    near = analytic(unlike, (0.01, 0, 0), cycles=1e9)
    said = [text for text in near.warnings if "extrapolated" in text]
    assert len(said) == 2 and all("1000 to 1e6" in text for text in said) and near.safety[0] > 1
    far = analytic(unlike, (1.4, 0, 0), mean=(-1.5, 0, 0)).warnings  # a tenth of 24 mm is 2.4 mm
    assert any("farthest pose: the platform moves 2.9 mm" in text for text in far)


def test_off_the_chart_of_hinges_nothing_is_said_of_the_error_of_the_stress(unlike):
    """At t/R = 0.0075 paros-weisbord is 0.8 % high, not the 10 to 22 % of hinges on the chart."""
    hinges = {name: {"neck": 0.03, "radius": 4.0} for name in ("base", "elbow", "platform")}
    found = analytic(unlike.replace(hinges=hinges, override=()), (0.0, 0.0, 1e-3))
    assert found.settings["analytic model"].startswith("paros-weisbord")
    assert "not on the hinge chart" in " ".join(found.warnings)
    assert np.isnan(found.fewest[0]) and np.isnan(found.most[0])
    charted = analytic(unlike, (0.0, 0.0, 1e-3))
    ends = (charted.fewest[0] / charted.life[0], charted.most[0] / charted.life[0])
    assert ends == pytest.approx((0.8203, 1.2144), abs=1e-3)  # 1.0204^(-1/0.102), 0.9804^(-1/0.102)


def test_a_figure_counts_the_necks_whose_life_is_beyond_it(unlike):
    """At 1 um all nine live longer than 1e14 cycles, at 0.1 mm two. Those of less than a reversal
    are drawn there.
    """
    short = analytic(unlike, (100.0, 100.0, 100.0), law=flexfem.Basquin(1000.0, -0.01))
    assert (
        np.any(short.cycles == 0) and 0 < plot_life(Figure().subplots(), short).get_xlim()[0] < 0.5
    )
    for size, count in ((1e-3, 9), (0.1, 2)):
        found = analytic(unlike, (size, size, 0), ratio=0.5)
        axes = plot_life(Figure().subplots(), found)
        drawn = sum(len(line.get_xdata()) for line in axes.lines if ANALYTIC in line.get_label())
        assert drawn == 9 - count == np.sum(found.cycles < 1e14)
        assert (
            axes.get_xlabel() == f"cycles to failure; {count} of 9 points beyond 1×10¹⁴, not drawn"
        )


def test_the_figure_of_a_mechanism_names_its_hinges_and_draws_those_of_every_model():
    """A parallelogram of steel: two leaves, 0.1 um up to 2 mm."""
    plate = flexfem.load(GEOMETRY / "parallelogram.toml").replace(material="steel-4340")
    found = flexfem.life(plate, amplitude=(2.0, 0, 0), models="analytic")
    assert found.life[0] < 1e14
    axes = plot_life(Figure().subplots(), found)
    (drawn,) = (line for line in axes.lines if ANALYTIC in str(line.get_label()))
    np.testing.assert_allclose(np.sort(drawn.get_xdata()), np.sort(found.cycles[0]))
    header = "\n".join(text.get_text() for text in life_figure(found).texts)
    assert (
        re.search(r"first at hinge leaf\b", header.replace("\n", " "))
        and "sensitivity" not in header
    )


@pytest.mark.parametrize("name", ["mobility6", "parallelogram"])
def test_a_stored_life_has_its_law_and_draws_its_figure(name, tmp_path):
    law = flexfem.Basquin(900.0, -0.11, 0.6, (2e3, 3e7), True)
    about = flexfem.load(GEOMETRY / f"{name}.toml")
    found = analytic(about, (0.05, 0.0, 0.0), law=law)
    read = flexfem.Result.read(found.write(tmp_path / "life.json"))
    assert type(read) is type(found) and read.law == found.law == law
    assert read.yield_strength == found.yield_strength == about.material.yield_strength
    drawn = [life_figure(one).axes[0].get_lines() for one in (found, read)]
    for line, again in zip(*drawn, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), again.get_xydata())


def test_a_mean_of_bending_pulls_one_surface_of_a_neck_whatever_its_sign(unlike, modelled):
    pose = np.array([0.02, 0.01, 0.0])
    mean = np.array([0.06, 0.0, 0.0])
    for sign in (1, -1):
        motion = CyclicMotion(pose, sign * mean, False, 1e6)
        of = by_model(unlike, modelled, motion)
        fe = element_values(unlike, solved(unlike, 5), motion)
        assert np.max(of.equivalent(0.5)) == pytest.approx(np.max(fe.equivalent(0.5)), rel=0.02)
        assert np.max(of.equivalent(0.5)) > 1.2 * np.max(of.amplitude)


@pytest.mark.usefixtures("unrendered")
def test_the_command_prints_and_writes_the_answer_with_a_fit(unlike, tmp_path, capsys):
    stage = tmp_path / "stage.toml"
    points = tmp_path / "points.csv"
    unlike.save(stage)
    points.write_text(
        "# house\nstress_mpa, cycles\n" + "\n".join(map("{}, {}".format, STRESS, CYCLES))
    )
    command = [
        "life",
        str(stage),
        "--amplitude",
        "0.05",
        "0",
        "0",
        "--models",
        "analytic",
        "--fit",
        str(points),
    ]
    cli.app([*command, "-o", str(tmp_path)], standalone_mode=False)
    out = capsys.readouterr().out
    assert (tmp_path / "stage-life.png").exists() and (tmp_path / "stage-life.json").exists()
    assert "sigma'_f = 1694.6 MPa, 95 % interval 1600 to 1809" in out and "A = 1587.2 MPa" in out
    for row, said in (("948, 0", "cycles = 0"), ("948", "1 values"), ("x, 1", "stress_mpa = x")):
        bad = tmp_path / "bad.csv"
        bad.write_text(f"{points.read_text()}\n{row}\n")
        with pytest.raises(
            flexfem.BadInput, match=rf"bad\.csv, line 9: {re.escape(said)}"
        ) as refused:
            cli.app([*command[:-1], str(bad)], standalone_mode=False)
        assert str(refused.value).count("bad.csv") == 1
