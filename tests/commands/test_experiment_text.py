"""What `flexfem experiment`, `identify` and `stiffness --necks` print of records with unequal numbers, cell by cell."""

from __future__ import annotations

import pytest

from flexfem.commands.experiment import print_as_built, print_experiment, print_identification
from flexfem.verify.as_built import AsBuilt
from flexfem.verify.experiment import Experiment, Pushed, Row
from flexfem.verify.identified import Identification
from flexfem.verify.series import SpringAlone
from flexfem.verify.slope_fit import Estimate

DIRECTIONS = ("x", "y", "theta")
OF_STAGE = {"assumed": [], "not_stated": [], "warnings": []}


def cells(line):
    return [cell for cell in line.split("  ") if cell.strip()]


@pytest.fixture
def printed(capsys):
    def lines(show, record):
        show(record)
        return [[cell.strip() for cell in cells(line)] for line in capsys.readouterr().out.splitlines()]

    return lines


def test_table_ii_has_every_number_in_its_column(printed):
    def row(base, measured):
        return Row(
            model=base,
            metal=base + 1,
            simulated=base + 2,
            measured=measured,
            measured_sd=0.25,
            deviation={"metal": base / 100, "simulated": -base / 50, "measured": 1.25, "measured from metal": -2.5},
        )

    def push(base, low):
        share = {"stage": base, "pole": base / 10, "bar": base / 100}
        return Pushed.model_construct(slope=base + 2, low=low, high=base + 4, share=share)

    found = Experiment.model_construct(
        **OF_STAGE,
        name="a stage",
        fixture="a set-up",
        model="the model",
        metal="the metal",
        confidence=90.0,
        explained="what was said",
        table={axis: row(base, 70.5) for axis, base in zip(DIRECTIONS, (31.0, 43.0, 5100.0), strict=True)},
        pushed={"x": push(31.0, 32.5), "y": push(43.0, 44.5), "theta": push(51.0, None)},
        alone={
            "x": SpringAlone(softer_percent=12.0, stage=33.0, stiffness=242.0, ratio=7.5, pole=610.0),
            "y": SpringAlone(softer_percent=-4.0, stage=41.0, stiffness=None, ratio=None, pole=None),
        },
    )
    out = printed(print_experiment, found)
    assert out[0] == ["a stage: pushed as in a set-up; the metal is by the metal"]
    assert out[1] == ["stiffness as pushed", "the model", "the metal", "simulated, 90 %", "measured"]
    assert out[2] == ["x (N/mm)", "31", "32", "33 (32.5 to 35)", "70.5 ± 0.25"]
    assert out[3] == ["y (N/mm)", "43", "44", "45 (44.5 to 47)", "70.5 ± 0.25"]
    assert out[4] == ["theta (N mm/rad)", "5100", "5101", "5102 (no interval)", "70.5 ± 0.25"]
    assert out[5] == ["deviation from the model", "the metal", "simulated", "measured", "measured from the metal"]
    assert out[6] == ["x", "+0.31 %", "-0.62 %", "+1.25 %", "-2.50 %"]
    assert out[9] == ["displacement read, share of", "stage", "pole", "bar"]
    assert out[10] == ["x", "31 %", "3.1 %", "0.31 %"]
    assert "after what was said" in out[13][0]
    softer = "12 % softer than 33 N/mm takes 242 N/mm, 7.5 times as stiff as the stage; the pole here: 610 N/mm"
    assert out[14] == [f"x: {softer}"]
    assert out[15] == ["y: 4 % stiffer than 41 N/mm, which no spring in series makes"]


def identified(unknown, fixture, offset, **more):
    about = {
        "name": "a stage",
        "source": "slopes",
        "model": "the model",
        "confidence": 90.0,
        "measured": {"x": 31.0, "theta": 5100.0},
        "sd": {"x": 0.31, "theta": 51.0},
        "nominal": {"x": 33.0, "theta": 5300.0},
        "fitted": {"x": 35.0, "theta": 5500.0},
        "chi_square": 1.25,
        "dof": 2,
        "finding": "This is found.",
        "stiffness": {"x": 410.0, "theta": None},
    }
    found = {**OF_STAGE, **about, "correlation": -0.625, **more}
    return Identification.model_construct(unknown=unknown, fixture=fixture, offset=offset, **found)


def test_what_fits_slopes_is_printed_with_its_ends_and_units(printed):
    fixture = {
        "translation": Estimate(value=3e-3, low=None, high=5e-3),
        "rotation": Estimate(value=7e-6, low=6e-6, high=None),
    }
    found = identified("springs", fixture, Estimate(value=-0.010, low=-0.012, high=-0.007))
    out = printed(print_identification, found)
    assert out[:2] == [["a stage: slopes; the model"], ["slope", "measured", "as drawn, rigid fixture", "fitted"]]
    assert out[2] == ["x (N/mm)", "31 ± 0.31", "33", "35"]
    assert out[3] == ["theta (N mm/rad)", "5100 ± 51", "5300", "5500"]
    assert out[4] == ["offset of all nine necks: -10 um (-12 to -7) (positive: wider)"]
    assert out[5] == ["compliance of the fixture in translation: 0.003 mm/N (up to 0.005, no lower end)"]
    assert out[6] == ["compliance of the fixture in rotation: 7e-06 rad/(N mm) (from 6e-06 on, no upper end)"]
    assert out[7] == ["the fixture at the fit: x 410 N/mm"]
    numbers = "chi square 1.25, degrees of freedom 2; intervals 90 %, profile likelihood"
    assert out[8] == [f"{numbers}; correlation of offset and fixture -0.625"]
    assert out[9] == ["This is found."]


def test_a_pole_is_printed_as_times_as_soft(printed):
    none = Estimate(value=4.0, low=None, high=None)
    found = identified("pole", {"pole": none}, none, correlation=None, stiffness={"x": None})
    out = printed(print_identification, found)
    assert out[1][2] == "as drawn, rigid pole"
    assert out[5] == ["the pole, times as soft as described: 4 (no end on either side)"]
    assert out[6] == ["the fixture at the fit: rigid"]
    assert out[7][0].endswith("the data depend on fewer combinations of these numbers than there are numbers")


def test_a_stage_as_made_is_printed_with_drawn_deviation_and_scatter(printed):
    drawn, made = [[31.0, 0, 0], [0, 41.0, 0], [0, 0, 5100.0]], [[33.0, 0, 0], [0, 43.0, 0], [0, 0, 5300.0]]
    necks, sd = [[0.48, 0.5, 0.51]] * 3, [[0.001, 0.002, 0.003]] * 3
    spread, low, high = [0.21, 0.42, 63.0], [32.5, 42.5, 5250.0], [33.75, 43.75, 5375.0]
    found = AsBuilt.model_construct(
        **OF_STAGE,
        name="a stage",
        model="the model",
        necks=necks,
        sd=sd,
        drawn=drawn,
        stiffness=made,
        deviation=[6.45, 4.88, 3.92],
        spread=spread,
        low=low,
        high=high,
        draws=4000,
        unanswered=7,
    )
    out = printed(print_as_built, found)
    assert out[0] == ["a stage with its measured necks: the model"]
    assert out[1] == ["stiffness", "as drawn", "as made", "deviation", "standard deviation", "95 % of stages"]
    assert out[2] == ["x (N/mm)", "31", "33", "+6.45 %", "0.21", "32.5 to 33.75"]
    assert out[4] == ["theta (N mm/rad)", "5100", "5300", "+3.92 %", "63", "5250 to 5375"]
    scatter = "each known to 3 um (standard deviation) or better; 4000 draws"
    assert out[5] == [f"necks 480 to 510 um, {scatter}"]
    assert out[6] == ["7 draws have no answer and are left out"]
    exact = found.model_copy(update={"sd": [[0.0] * 3] * 3, "unanswered": 0})
    said = "no standard deviation is given: no scatter is known"
    assert printed(print_as_built, exact)[5] == [f"necks 0.48 to 0.51 mm; {said}"]
