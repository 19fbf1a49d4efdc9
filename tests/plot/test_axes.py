"""Every `plot_...` function draws on the axes it is given, in a figure of the user's, and leaves
the rest alone.
"""

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
from flexfem.paper.fixture import MeasuredSlopes, Measurement
from flexfem.plot.errors import WaterfallBar
from flexfem.questions.check import hinge_review, thickness_review
from flexfem.results import Result
from flexfem.study.records import (
    AxisText,
    Caption,
    Cells,
    Chosen,
    CurvePanel,
    Curves,
    Effects,
    FactorCurve,
    ParetoFront,
    Percentile,
    Scatter,
    Share,
    StudyMap,
    Trend,
)

from ..design.recorded import recorded

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
FIXTURE = STAGE.parents[1] / "cases" / "fixture.toml"
CAPTION = Caption("A title", ["a line"], [])
X = AxisText("across", "mm")
Y = AxisText("up", "N/mm")
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
        CAPTION,
        X,
        Y,
        ("larger", "larger"),
        POINTS,
        np.array([2, 1, 0]),
        np.array([3]),
        chosen,
        ["none"],
    )


identified_slopes = MeasuredSlopes(kxx=35.4, kxx_sd=0.2, ktt=33e3, ktt_sd=200.0)


def curves() -> Curves:
    places = np.array([1.0, 2.0, 4.0])
    curve = FactorCurve("finite elements", np.array([3.0, 5.0, 4.0]), np.full(3, 0.1), 4.5)
    missing = {"refused": np.array([True, False, False])}
    panels = [CurvePanel(Y, [curve])]
    return Curves(Caption("", [], []), Y, places, panels, missing, {"refused": 1}, 2.5)


def effects() -> Effects:
    trend = Trend(*map(np.array, ([1.0, 2.0], [3.0, 5.0], [2.0, 4.0], [4.0, 6.0])))
    points = np.array([[1.0], [2.0]])
    base = np.array([1.5]), np.array([4.0])
    return Effects(Caption("", [], []), [Y], [Y], [[trend]], points, 3 * points, base)


share = Share(*map(np.array, ([0.5, 0.3], [0.05, 0.02], [0.6, 0.4], [0.04, 0.03])), Y)
percentiles = [Percentile(p, p / 10, p / 11, p / 9) for p in (2.5, 50.0, 97.5)]
plain = cache(lambda: flexfem.load(STAGE))  # each answered once
pushed = cache(lambda: flexfem.experiment(plain(), FIXTURE, models="analytic"))
identified = cache(
    lambda: flexfem.identify(plain(), Measurement(name="slopes", measured=identified_slopes))
)
driven = cache(lambda: flexfem.drive(plain(), pose=(2e-3, -1e-3, 5e-5), resolution=2))
reached = cache(lambda: flexfem.reach(plain(), models="analytic"))
displaced = cache(lambda: flexfem.large(plain(), models="analytic"))
vibrating = cache(lambda: flexfem.modes(plain(), count=2, models="elements", resolution=4))
tiring = {"amplitude": (0.05, 0.02, 3e-4), "ratio": 0, "resolution": 4}
tired = cache(lambda: flexfem.life(plain().replace(material="al-2024-t4"), **tiring))
DRAWN: dict[str, Any] = {
    "plot_plate": lambda made: (flexfem.load("geometry/parallelogram.toml"),),
    "plot_overlay": lambda made: (
        flexfem.compare(
            "geometry/pivot.toml",
            "geometry/mobility6.toml",
            question="modes",
            models="analytic",
        ),
    ),
    "plot_budget": lambda made: (made.budget(), "theta"),
    "plot_convergence": lambda made: (made.mesh_study(),),
    "plot_displacement": lambda made: (made.fields(),),
    "plot_drift": lambda made: (
        flexfem.drift(plain(), models="elements", resolution=4),
        "gradient in x",
    ),
    "plot_drive": lambda made: (driven(),),
    "plot_errors": lambda made: (
        made.result({"one": (0.1, 0.2, -0.1), "two": (0.2, 0.1, 0.1)}),
        "y",
    ),
    "plot_mechanism_errors": lambda made: (made.guide_errors(), "y"),
    "plot_forces": lambda made: (driven(),),
    "plot_formulas": lambda made: (hinge_review(), "axial"),
    "plot_front": lambda made: (front(),),
    "plot_hinge": lambda made: (),
    "plot_history": lambda made: (recorded(),),
    "plot_hinge_table": lambda made: (made.model(),),
    "plot_curves": lambda made: (curves(), curves().panels[0]),
    "plot_effect": lambda made: (effects(), 0, 0),
    "plot_histogram": lambda made: (Scatter(Y, np.linspace(0.0, 10.0, 30), percentiles, 5.0),),
    "plot_large": lambda made: (displaced(), "y", "across"),
    "plot_life": lambda made: (tired(),),
    "plot_lives": lambda made: (tired(),),
    "plot_map": lambda made: (study_map(),),
    "plot_margins": lambda made: (recorded(),),
    "plot_mesh": lambda made: (made.model(), made.fields()),
    "plot_mode": lambda made: (vibrating(), 2),
    "plot_model": lambda made: (made.model(),),
    "plot_neck": lambda made: (made.fields(), made.model().hinges[0]),
    "plot_push": lambda made: (pushed(), "theta"),
    "plot_region": lambda made: (identified(),),
    "plot_remains": lambda made: (pushed(), "y"),
    "plot_response": lambda made: (vibrating().fields.reduced, "theta", "load", "phase"),
    "plot_section": lambda made: (reached(),),
    "plot_sensitivity": lambda made: (recorded(), "envelope_mm"),
    "plot_shares": lambda made: (share, ["one", "two"]),
    "plot_shares_of_error": lambda made: (made.guide_budget(), "y"),
    "plot_steps": lambda made: (
        [WaterfallBar("one", 2.0, 0.0), WaterfallBar("sum", 2.0, 0.1, True)],
        1,
    ),
    "plot_solid": lambda made: (reached(),),
    "plot_strokes": lambda made: (driven(),),
    "plot_thickness": lambda made: (thickness_review(), "rotation"),
    "plot_tradeoff": lambda made: (recorded(),),
}


def state(figure: Any, other: Any) -> tuple[Any, ...]:
    """What a figure has outside one of its axes, and what holds for all figures."""
    kept = (
        figure.axes,
        figure.texts,
        figure.legends,
        figure.artists,
        figure.lines,
        figure.patches,
        figure.images,
    )
    look = (
        tuple(figure.get_size_inches()),
        figure.dpi,
        figure.get_layout_engine(),
        figure.get_suptitle(),
    )
    beside = (
        len(other.get_children()),
        other.get_xlim(),
        other.get_ylim(),
        other.get_aspect(),
        other.axison,
    )
    return (
        *map(list, kept),
        look,
        beside,
        other.get_position().bounds,
        dict(mpl.rcParams),
        pyplot.get_fignums(),
    )


def test_every_function_draws_on_its_axes_and_changes_nothing_outside_them(made):
    """A function without a record here fails the first line."""
    assert set(DRAWN) == set(flexfem.plot.__all__)
    for name, given in DRAWN.items():
        figure = pyplot.figure(figsize=(11, 5))
        other, ax = (
            figure.add_subplot(1, 2, k, projection="3d" if name == "plot_solid" else None)
            for k in (1, 2)
        )
        before = state(figure, other)
        empty = len(ax.get_children())
        assert getattr(flexfem.plot, name)(ax, *given(made)) is ax, name
        assert len(ax.get_children()) > empty, name
        assert state(figure, other) == before, name
        figure.draw_without_rendering()
        pyplot.close(figure)


def test_every_figure_that_a_result_names_is_there():
    import_module("flexfem.baselines")  # and with it every question
    named = {kind.figure for kind in Result.kinds.values() if kind.figure}
    assert {"paper.figures.modes.figures", "paper.figures.reach.reach_figure"} <= named
    for module, _, function in (each.rpartition(".") for each in named):
        home = "flexfem" if module.startswith("paper.") else "flexfem.plot"
        assert callable(getattr(import_module(f"{home}.{module}"), function))


@pytest.mark.parametrize("name", ["plot_model", "plot_hinge_table"])
def test_a_stage_is_drawn_and_what_is_none_is_refused(name):
    ax = pyplot.figure().subplots()
    assert getattr(flexfem.plot, name)(ax, flexfem.load(STAGE)) is ax
    for wrong in (None, "geometry/mobility6.toml"):
        with pytest.raises(flexfem.BadInput, match=r"expected a stage"):
            getattr(flexfem.plot, name)(ax, wrong)
    pyplot.close("all")


@pytest.mark.parametrize(
    ("name", "first", "expected"),
    [
        ("plot_budget", lambda made: made.budget(), "direction .*, expected one of: x, y, theta"),
        (
            "plot_formulas",
            lambda made: hinge_review(),
            "freedom {}, expected one of rotation, axial, shear",
        ),
        (
            "plot_thickness",
            lambda made: thickness_review(),
            "freedom {}, expected one of rotation, axial",
        ),
    ],
)
def test_what_is_not_among_the_choices_is_refused(made, name, first, expected):
    for asked, shown in (("q", '"q"'), (None, "None"), (["x"], r'\["x"\]')):
        with pytest.raises(flexfem.BadInput, match=expected.format(shown)):
            getattr(flexfem.plot, name)(pyplot.figure().subplots(), first(made), asked)
        pyplot.close()
