"""Every `plot_...` function draws on the axes it is given, in a figure of the user's, and leaves the rest alone."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot

import flexfem
from flexfem.design.result import Designed, FrontDesign, Goal, Requirement, Step
from flexfem.plot.design import sensitivity_figure
from flexfem.questions.check import hinge_review, thickness_review
from flexfem.questions.fixture import MeasuredSlopes, Measurement
from flexfem.results import Result
from flexfem.study.findings import (
    AxisText,
    Caption,
    Cells,
    Chosen,
    Indices,
    ParetoFront,
    Percentile,
    Scatter,
    Share,
    StudyMap,
)

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
FIXTURE = STAGE.parents[1] / "cases" / "fixture.toml"
CAPTION = Caption("A title", ["a line"], [])
X, Y = AxisText("across", "mm"), AxisText("up", "N/mm", "$K$")
POINTS = np.array([[1.0, 9.0], [2.0, 5.0], [4.0, 1.0], [0.5, 0.7]])
STEPS = np.geomspace(1e-6, 1.0, 7)
LOADS = np.array([0.0, 1.0, 3.0, 5.0, 10.0])


def study_map() -> StudyMap:
    points = np.stack(np.meshgrid([1.0, 2.0, 3.0], [4.0, 5.0, 7.0]), axis=-1).reshape(-1, 2)
    missing = {"refused": np.arange(9) == 8}
    values = np.where(missing["refused"], np.nan, points.sum(axis=1))
    return StudyMap(CAPTION, X, X, Y, Cells(points, values, missing, True), (7.0,), (2.0, 5.0))


def front() -> ParetoFront:
    chosen = [Chosen(2, flexfem.load(STAGE), [(Y, 1.0)])]
    return ParetoFront(
        CAPTION, X, Y, ("larger", "larger"), POINTS, np.array([2, 1, 0]), np.array([3]), chosen, ["none"]
    )


@cache
def pushed() -> Any:
    return flexfem.experiment(flexfem.load(STAGE), FIXTURE, models="analytic")


@cache
def identified() -> Any:
    slopes = MeasuredSlopes(kxx=35.4, kxx_sd=0.2, ktt=33e3, ktt_sd=200.0)
    return flexfem.identify(flexfem.load(STAGE), Measurement(name="slopes", measured=slopes))


def indices() -> Indices:
    return Indices(*(np.array(values) for values in ([0.5, 0.3], [0.05, 0.02], [0.6, 0.4], [0.04, 0.03])))


def percentiles() -> list[Percentile]:
    return [Percentile(p, p / 10, p / 11, p / 9) for p in (2.5, 50.0, 97.5)]


@cache
def driven() -> Any:
    return flexfem.drive(flexfem.load(STAGE), pose=(2e-3, -1e-3, 5e-5), resolution=2)


@cache
def reached() -> Any:
    return flexfem.reach(flexfem.load(STAGE), models="analytic")


@cache
def displaced() -> Any:
    return flexfem.large(flexfem.load(STAGE), models="analytic")


@cache
def vibrating() -> Any:
    return flexfem.modes(flexfem.load(STAGE), count=2, models="elements", resolution=4)


def lived() -> Any:
    stage = flexfem.load(STAGE).replace(material="al-2024-t4")
    return flexfem.life(stage, amplitude=(0.05, 0.02, 3e-4), ratio=0, resolution=4)


def responding() -> Any:
    return vibrating().fields.reduced


def designed() -> Designed:
    """Two objectives, two requirements of which one is missed, and two designs of a front."""
    said = {"label": "stiffness", "band": 0.5, "uncorrected": 99.0, "checked_by": "finite elements"}
    goals = [
        Goal(name="kxx_n_per_mm", value=101.0, better="larger", **said),
        Goal(name="mass_kg", value=0.2, better="smaller", **said),
    ]
    ends = {"at_least": 90.0, "at_most": None, "size": 90.0, "active": True, "band_percent": 0.6, "relax_to": None}
    met = {"value": 101.0, "margin": 11.0, "margin_percent": 12.2, "verdict": "met"}
    missed = {"value": 81.0, "margin": -9.0, "margin_percent": -10.0, "verdict": "missed"}
    asked = [Requirement(name=name, **found, **said, **ends) for name, found in (("a", met), ("b", missed))]
    front = [FrontDesign(design={}, values=[k, k / 500], predicted=[k, k / 499], margins_percent=[], met=True, stage="")
             for k in (99.0, 101.0)]  # fmt: skip
    history = [Step(evaluations=n, objective=k, missed=0.0) for n, k in ((10, None), (40, 90.0), (90, 99.0))]
    design = {"neck": 0.5, "link": 22.0, "pad": 3.0}
    rows = zip(design, [(2.4, 1.0, 0.0, 0.7), (-1.0, 0.4, 0.0, -0.2), (None, 0.0, 0.0, 0.0)], strict=True)
    followed = {key: dict(zip(("kxx_n_per_mm", "mass_kg", "a", "b"), row, strict=True)) for key, row in rows}
    return Designed.model_construct(
        name="One", objectives=goals, requirements=asked, front=front, history=history, design=design,
        sensitivities=followed, at_ends=["link"], assumed=["a key"], not_stated=[],
    )  # fmt: skip


DRAWN: dict[str, Any] = {
    "plot_budget": lambda made: (made.budget(), "theta"),
    "plot_convergence": lambda made: (made.mesh_study(),),
    "plot_displacement": lambda made: (made.fields(),),
    "plot_drift": lambda made: (flexfem.drift(flexfem.load(STAGE), models="elements", resolution=4), "gradient in x"),
    "plot_drive": lambda made: (driven(),),
    "plot_errors": lambda made: (made.result({"one": (0.1, 0.2, -0.1), "two": (0.2, 0.1, 0.1)}), "y"),
    "plot_forces": lambda made: (driven(),),
    "plot_formulas": lambda made: (hinge_review(), "axial"),
    "plot_front": lambda made: (front(),),
    "plot_hinge": lambda made: (),
    "plot_history": lambda made: (designed(),),
    "plot_hinge_table": lambda made: (made.model(),),
    "plot_histogram": lambda made: (Scatter(Y, np.linspace(0.0, 10.0, 30), percentiles(), 5.0),),
    "plot_large": lambda made: (displaced(), "y", "across"),
    "plot_life": lambda made: (lived(),),
    "plot_map": lambda made: (study_map(),),
    "plot_margins": lambda made: (designed(),),
    "plot_mesh": lambda made: (made.model(), made.fields()),
    "plot_mode": lambda made: (vibrating(), 2),
    "plot_model": lambda made: (made.model(),),
    "plot_neck": lambda made: (made.fields(), made.model().hinges[0]),
    "plot_open_loop": lambda made: (driven(), "x"),
    "plot_push": lambda made: (pushed(), "theta"),
    "plot_region": lambda made: (identified(),),
    "plot_remains": lambda made: (pushed(), "y"),
    "plot_response": lambda made: (responding(), "theta", "load", "phase"),
    "plot_section": lambda made: (reached(),),
    "plot_sensitivity": lambda made: (designed(), "b"),
    "plot_shares": lambda made: (Share(Y, indices()), ["one", "two"]),
    "plot_solid": lambda made: (reached(),),
    "plot_stage": lambda made: (flexfem.load(STAGE),),
    "plot_dimensions": lambda made: (flexfem.load(STAGE),),
    "plot_strokes": lambda made: (driven(),),
    "plot_thickness": lambda made: (thickness_review(), "rotation"),
    "plot_tradeoff": lambda made: (designed(),),
}


def state(figure: Any, other: Any) -> tuple[Any, ...]:
    """What a figure has outside one of its axes, and what holds for all figures."""
    kept = (figure.axes, figure.texts, figure.legends, figure.artists, figure.lines, figure.patches, figure.images)
    look = (tuple(figure.get_size_inches()), figure.dpi, figure.get_layout_engine(), figure.get_suptitle())
    beside = (len(other.get_children()), other.get_xlim(), other.get_ylim(), other.get_aspect(), other.axison)
    return *map(list, kept), look, beside, other.get_position().bounds, dict(mpl.rcParams), pyplot.get_fignums()


def test_every_function_draws_on_its_axes_and_changes_nothing_outside_them(made):
    """A function without a record here fails the first line."""
    assert set(DRAWN) == set(flexfem.plot.__all__)
    for name, given in DRAWN.items():
        figure = pyplot.figure(figsize=(11, 5))
        other, ax = (figure.add_subplot(1, 2, k, projection="3d" if name == "plot_solid" else None) for k in (1, 2))
        before, empty = state(figure, other), len(ax.get_children())
        assert getattr(flexfem.plot, name)(ax, *given(made)) is ax, name
        assert len(ax.get_children()) > empty, name
        assert state(figure, other) == before, name
        figure.draw_without_rendering()
        pyplot.close(figure)


def test_every_figure_that_a_result_names_is_there():
    import_module("flexfem.baselines")  # and with it every question
    named = {kind.figure for kind in Result.kinds.values() if kind.figure}
    assert {"errors.budget_figure", "modes.figures", "drive.reach_figure"} <= named
    for module, _, function in (each.rpartition(".") for each in named):
        assert callable(getattr(import_module(f"flexfem.plot.{module}"), function))


@pytest.mark.parametrize("name", ["plot_model", "plot_hinge_table"])
def test_a_stage_is_drawn_and_what_is_none_is_refused(name):
    ax = pyplot.figure().subplots()
    assert getattr(flexfem.plot, name)(ax, flexfem.load(STAGE)) is ax
    for wrong in (None, "geometry/mobility6.toml"):
        with pytest.raises(flexfem.BadInput, match=r"expected a stage"):
            getattr(flexfem.plot, name)(ax, wrong)
    pyplot.close("all")


def test_a_budget_in_no_direction_is_refused(made):
    for direction, shown in (("q", '"q"'), (None, "None"), (["x"], r'\["x"\]')):
        with pytest.raises(flexfem.BadInput, match=f"direction {shown}, expected one of x, y, theta"):
            flexfem.plot.plot_budget(pyplot.figure().subplots(), made.budget(), direction)
        pyplot.close()


def test_margins_history_and_front_of_a_design_are_its_numbers():
    figure, (margins, history, front) = pyplot.subplots(1, 3)
    flexfem.plot.plot_margins(margins, designed())
    ends = sorted(float(line.get_xdata()[-1]) for line in margins.lines if len(line.get_xdata()) == 2)
    assert -10.0 in ends and 12.2 in ends
    flexfem.plot.plot_history(history, designed())
    assert history.lines[0].get_xydata().tolist() == [[40.0, 90.0], [90.0, 99.0]]
    flexfem.plot.plot_tradeoff(front, designed())
    assert front.lines[0].get_xydata().tolist() == [[99.0, 0.198], [101.0, 0.202]]
    assert front.lines[-1].get_xydata().tolist() == [[101.0, 0.2]]
    assert "N/mm" in front.get_xlabel() and "larger" in front.get_xlabel() and "smaller" in front.get_ylabel()
    pyplot.close(figure)


def test_bars_of_a_sensitivity_are_its_numbers_and_what_is_not_known_has_none():
    figure, ax = pyplot.subplots()
    flexfem.plot.plot_sensitivity(ax, designed())
    assert [bar.get_width() for bar in ax.patches] == [2.4, -1.0, 0.0]
    assert [text.get_text() for text in ax.texts] == ["+2.4", "\N{MINUS SIGN}1.0", "not known"]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["neck", "link", "pad"]
    assert ax.yaxis_inverted() and -ax.get_xlim()[0] == ax.get_xlim()[1] > 2.4
    with pytest.raises(flexfem.BadInput, match='quantity "kyy_n_per_mm", expected one of kxx_n_per_mm, mass_kg, a, b'):
        flexfem.plot.plot_sensitivity(ax, designed(), "kyy_n_per_mm")
    pyplot.close(figure)


def test_a_figure_of_sensitivities_has_objectives_and_active_requirements_on_one_scale():
    one = designed()
    free = one.requirements[0].model_copy(update={"active": False})
    figure = sensitivity_figure(one.model_copy(update={"requirements": [free, one.requirements[1]]}))
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "stiffness, the larger the better", "stiffness, the smaller the better", "stiffness, at least 90"
    ]  # fmt: skip
    assert [ax.patches[0].get_width() for ax in figure.axes] == [2.4, 1.0, 0.7]
    assert len({ax.get_xlim() for ax in figure.axes}) == 1
