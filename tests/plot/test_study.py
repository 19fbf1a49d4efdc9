"""The figures of a study: what is drawn is what its table says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.colors import CenteredNorm, LogNorm, Normalize

import flexfem
from flexfem.plot.study import (
    distribution_figure,
    edges,
    histogram,
    levels,
    map_figure,
    norm_of,
    pareto_figure,
    sensitivity_figure,
)
from flexfem.refused import BadInput
from flexfem.results import SPACE
from flexfem.study.answer import nominal
from flexfem.study.collect import StudyTable
from flexfem.study.findings import findings
from flexfem.study.fronts import front_of
from flexfem.study.loaded import LoadedStudy, base_factor_values, sample
from flexfem.study.maps import map_of
from flexfem.study.names import asked, output
from flexfem.study.records import (
    AxisText,
    Caption,
    Cells,
    Chosen,
    Distribution,
    ParetoFront,
    Percentile,
    Scatter,
    Sensitivity,
    Share,
    StudyMap,
)
from flexfem.study.source import Source

from ..study.answered import answered, head, study

CAPTION = Caption("A title", ["a line"], ["stage: thickness_mm"])
HEAD = head("A study $y$")
GRID = f"""{HEAD}
[sampling]
method = "grid"
[[factor]]
key = "hinges.base.radius_mm"
from = 2.5
to = 5.5
points = 7
[[factor]]
keys = ["hinges.elbow.neck_mm", "hinges.platform.neck_mm"]
label = "the other necks"
from = 0.4
to = 0.9
points = 4
scale = "log"
[[figure]]
kind = "map"
x = "hinges.base.radius_mm"
y = "the other necks"
value = "kxx_n_per_mm"
[[figure]]
kind = "pareto"
x = "envelope_mm"
y = "kxx_n_per_mm"
x_better = "smaller"
drawn = 2
"""


def source_of(loaded: LoadedStudy, table: StudyTable) -> Source:
    return Source(loaded, table, nominal(loaded))


def texts(figure: Any) -> str:
    legends = [axes.get_legend() for axes in figure.axes] + figure.legends
    found = [text.get_text() for text in figure.texts]
    found += [text.get_text() for legend in legends if legend for text in legend.get_texts()]
    return " | ".join(found).replace("\n", " ").replace(SPACE, " ")


def shown_map(**changes: Any) -> StudyMap:
    x, y = np.meshgrid([1.0, 2.0, 4.0], [0.1, 0.2, 0.3, 0.4], indexing="ij")
    values = 10.0 * x.ravel() + y.ravel()
    values[[2, 7]] = np.nan
    missing = {"refused": np.arange(12) == 2, "time limit": np.arange(12) == 7}
    points = np.column_stack([x.ravel(), y.ravel()])
    given: dict[str, Any] = {
        "x": AxisText("radius", "mm", log=True),
        "y": AxisText("neck $t$", "mm"),
    }
    given |= {"value": output("error_x_percent")}
    cells = {"points": points, "values": values, "missing": missing, "grid": True}
    cells |= {name: changes.pop(name) for name in list(changes) if name in cells}
    return StudyMap(CAPTION, **given, cells=Cells(**cells), **changes)


def test_every_cell_of_a_map_has_the_value_of_its_design() -> None:
    shown = shown_map().cells
    order = np.random.default_rng(1).permutation(12)  # designs may come in any order
    mixed = {why: which[order] for why, which in shown.missing.items()}
    axes = map_figure(
        shown_map(points=shown.points[order], values=shown.values[order], missing=mixed)
    ).axes[0]
    (cells,) = [found for found in axes.collections if isinstance(found, QuadMesh)]
    np.testing.assert_array_equal(
        np.ma.filled(cells.get_array(), np.nan), shown.values.reshape(3, 4).T
    )
    corners = cells.get_coordinates()
    for i, x in enumerate((1.0, 2.0, 4.0)):
        assert corners[0, i, 0] < x < corners[0, i + 1, 0]
    np.testing.assert_allclose(
        corners[0, :, 0], [2**-0.5, 2**0.5, 2**1.5, 2**2.5]
    )  # half way on a log scale
    np.testing.assert_allclose(corners[:, 0, 1], [0.05, 0.15, 0.25, 0.35, 0.45])
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")


def test_the_bar_says_what_the_colours_mean_and_where_the_contours_are() -> None:
    figure = map_figure(shown_map(marks=(15.0, 25.0, 99.0)))
    (axes,) = figure.axes
    (bar,) = axes.child_axes
    (cells,) = [found for found in axes.collections if isinstance(found, QuadMesh)]
    low = np.nanmin(shown_map().cells.values)
    high = np.nanmax(shown_map().cells.values)
    assert bar.get_ylabel() == "error along x (%)"
    assert bar.get_ylim() == (low, high) == (cells.norm.vmin, cells.norm.vmax)
    assert [line.get_ydata()[0] for line in bar.get_lines()] == [15.0, 25.0]
    for text in axes.texts:  # a contour's label is on its contour: the value is 10 x + y
        x, y = text.get_position()
        assert float(text.get_text().split(SPACE)[0]) == pytest.approx(10 * x + y, abs=1.5)
    wide = (
        map_figure(shown_map(values=10.0 ** shown_map().cells.points[:, 0], missing={}))
        .axes[0]
        .child_axes[0]
    )
    assert wide.get_ylim() == pytest.approx((10.0, 1e4))


def test_designs_without_an_answer_are_hatched_and_counted_by_reason() -> None:
    figure = map_figure(shown_map())
    hatched = [found for found in figure.axes[0].collections if isinstance(found, PolyCollection)]
    assert len({found.get_hatch() for found in hatched}) == 2
    for found, (x, y) in zip(hatched, [(1.0, 0.3), (2.0, 0.4)], strict=True):
        (box,) = found.get_paths()
        assert box.contains_point((x, y)) and box.get_extents().width < 2 * x
    assert "refused: 1" in texts(figure) and "time limit: 1" in texts(figure)


@pytest.mark.parametrize(("at", "drawn"), [((1.5, 0.2), True), ((1.5, 0.7), False)])
def test_the_base_stage_is_a_cross_where_it_is_on_the_map(
    at: tuple[float, float], drawn: bool
) -> None:
    figure = map_figure(shown_map(base=at))
    crosses = [line for line in figure.axes[0].get_lines() if line.get_marker() == "+"]
    assert {(*cross.get_xdata(), *cross.get_ydata()) for cross in crosses} == (
        {at} if drawn else set()
    )
    assert ("base design" in texts(figure)) is drawn


def test_a_scattered_sample_is_a_dot_a_design() -> None:
    figure = map_figure(shown_map(grid=False))
    shown = shown_map().cells
    dots = figure.axes[0].collections[0]
    known = np.isfinite(shown.values)
    np.testing.assert_array_equal(dots.get_offsets(), shown.points[known])
    np.testing.assert_array_equal(dots.get_array(), shown.values[known])
    assert "refused: 1" in texts(figure)


def test_colours_are_symmetric_for_both_signs_logarithmic_for_a_wide_range_and_else_linear() -> (
    None
):
    signed, wide, narrow = map(
        norm_of, np.array([[-2.0, 7.0, np.nan], [0.1, 7.0, 7.0], [3.0, 7.0, 7.0]])
    )
    assert isinstance(signed, CenteredNorm) and (signed.vmin, signed.vmax) == (-7.0, 7.0)
    assert (
        isinstance(wide, LogNorm)
        and type(narrow) is Normalize
        and (narrow.vmin, narrow.vmax) == (3.0, 7.0)
    )
    assert 5.0 not in levels(narrow, (5.0,)) and 4.0 in levels(narrow, (5.0,))


def test_the_only_value_of_a_factor_has_a_cell_about_it() -> None:
    for value, log in ((3.0, True), (3.0, False), (0.0, False)):
        low, high = edges(np.array([value]), log)
        assert low < value < high


def test_a_histogram_counts_every_design_and_has_its_percentiles_in_the_legend() -> None:
    values = np.random.default_rng(3).normal(41.0, 0.6, 3000)
    rows = ((2.5, 39.8, 39.71, 39.86), (50.0, 41.0, 40.97, 41.02), (97.5, 42.2, 42.1, 42.4))
    found = [Percentile(*row) for row in rows]
    figure = distribution_figure(
        Distribution(CAPTION, [Scatter(output("kxx_n_per_mm"), values, found, 41.0123)])
    )
    (axes,) = figure.axes
    counts, borders = histogram(values)
    assert counts.sum() == 3000 and borders[0] == values.min() and borders[-1] == values.max()
    np.testing.assert_array_equal(axes.patches[0].get_data().values, counts)
    assert [line.get_xdata()[0] for line in axes.get_lines()] == [39.8, 41.0, 42.2, 41.0123]
    assert "2.5 %: 39.800 N/mm (39.710 to 39.860)" in texts(
        figure
    ) and "base design: 41.012 N/mm" in texts(figure)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("stiffness xx (N/mm)", "designs")
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches[2:]]
    assert spans == [pytest.approx(ends) for ends in ((39.71, 39.86), (40.97, 41.02), (42.1, 42.4))]


def test_a_value_that_does_not_vary_is_one_bar_and_no_outlier_makes_more_than_sixty() -> None:
    counts, _ = histogram(np.full(30, 7.3))
    assert list(counts) == [30.0]
    assert [
        len(histogram(np.append(values, 1e27))[0]) for values in (np.arange(99.0), np.ones(99))
    ] == [60, 10]


def test_bars_and_whiskers_are_the_indices_of_each_value_in_the_order_of_the_factors(
    made: Any,
) -> None:
    values = ([0.5, 0.1, 0.3], [0.05, 0.01, 0.02], [0.6, 0.15, 0.35], [0.04, 0.03, 0.015])
    indices = [Share(*(scale * np.array(v) for v in values)) for scale in (1.0, 0.7)]
    names = ["one $a$", "two", "three"]
    quantities = [output("kxx_n_per_mm"), output("range_y_um")]
    figure = sensitivity_figure(
        Sensitivity(
            CAPTION,
            [each._replace(quantity=of) for each, of in zip(indices, quantities, strict=True)],
            names,
        )
    )
    for axes, found, sums in zip(figure.axes, indices, ("0.90", "0.63"), strict=True):
        assert [bar.get_width() for bar in axes.patches] == [*found.first, *found.total]
        middles = [round(bar.get_y() + bar.get_height() / 2) for bar in axes.patches]
        assert (
            middles == [0, 1, 2, 0, 1, 2]
            and axes.yaxis_inverted()
            and list(axes.get_yticks()) == [0, 1, 2]
        )
        assert all(
            one.get_y() < other.get_y()
            for one, other in zip(axes.patches[:3], axes.patches[3:], strict=True)
        )
        whiskers = [segment for bars in axes.collections for segment in bars.get_segments()]
        expected = np.column_stack(
            [
                np.r_[found.first, found.total] + s * np.r_[found.first_band, found.total_band]
                for s in (-1, 1)
            ]
        )
        np.testing.assert_allclose([segment[:, 0] for segment in whiskers], expected)
        assert axes.get_xlabel() == f"share of the variance\n(sum of first order: {sums})"
        low, high = axes.get_xlim()
        assert low <= 0.0 and 0.64 < high < 0.7
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == names
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "stiffness xx",
        "range in y at yield",
    ]


def rows_of(axes: Any) -> list[list[str]]:
    """Texts of the table in a panel."""
    cells = axes.tables[0].get_celld()
    columns = 1 + max(column for _, column in cells)
    texts = [cells[place].get_text().get_text().replace("\n", " ") for place in sorted(cells)]
    return [texts[k : k + columns] for k in range(0, len(texts), columns)]


def shown_front(folder: Path) -> ParetoFront:
    stage = study(folder, GRID).base
    points = np.array([[1.0, 9.0], [2.0, 5.0], [4.0, 1.0], [0.5, 0.7], [3.0, 3.5]])
    stiff = AxisText("K")
    more = AxisText("length", "mm")
    chosen = [
        Chosen(2, stage, [(stiff, 1.0), (more, 9.0)]),
        Chosen(0, stage, [(stiff, 2.0), (more, 3.0)]),
    ]
    axes = (output("range_x_um"), output("kxx_n_per_mm"), ("larger", "larger"))
    front = np.array([2, 1, 0])
    return ParetoFront(
        CAPTION, *axes, points, front, np.array([4]), chosen, ["not drawn: 7 refused"]
    )


def test_the_front_its_letters_and_the_drawings_belong_together(tmp_path: Path) -> None:
    shown = shown_front(tmp_path)
    figure = pareto_figure(shown._replace(base=(1.5, 2.5)))
    axes, *cells, listed = figure.axes
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
    np.testing.assert_array_equal(axes.get_lines()[0].get_xydata(), shown.points)
    np.testing.assert_array_equal(lines["front: 3 non-dominated designs"], shown.points[[2, 1, 0]])
    np.testing.assert_array_equal(lines["1 off the front cannot be drawn"], shown.points[[4]])
    np.testing.assert_array_equal(lines["base design"], [[1.5, 2.5]])
    assert [(text.get_text(), *text.xy) for text in axes.texts] == [
        ("A", 4.0, 1.0),
        ("B", 1.0, 9.0),
    ]
    assert [cell.get_title() for cell in cells] == ["A", "B"]
    assert rows_of(listed) == [
        ["design", "K", "length (mm)"],
        ["A", "1.00", "9.00"],
        ["B", "2.00", "3.00"],
    ]
    assert "mm, all drawings" in cells[0].texts[0].get_text()
    (front,) = [line for line in axes.get_lines() if str(line.get_label()).startswith("front")]
    assert front.get_drawstyle() == "steps-post"  # no design is as good as the corner between two


def test_drawings_are_to_one_scale_and_the_scale_bar_is_as_long_as_it_says(tmp_path: Path) -> None:
    figure = pareto_figure(shown_front(tmp_path))
    figure.draw_without_rendering()
    _, one, other, _ = figure.axes

    def per_mm(axes: Any) -> float:
        return float(axes.get_window_extent().width / np.ptp(axes.get_xlim()))

    assert per_mm(one) == pytest.approx(per_mm(other), rel=1e-3)
    assert one.get_window_extent().height / np.ptp(one.get_ylim()) == pytest.approx(
        per_mm(one)
    )  # nothing is squeezed
    (bar,) = one.get_lines()
    assert one.texts[0].get_text().startswith(f"{np.ptp(bar.get_xdata()):g}{SPACE}mm")
    assert 0.1 < np.ptp(bar.get_xdata()) / np.ptp(one.get_xlim()) < 0.5


def test_a_map_takes_values_reasons_and_the_base_stage_from_the_table(tmp_path: Path) -> None:
    loaded = study(tmp_path, GRID)
    table = answered(loaded)
    shown = map_of(source_of(loaded, table), loaded.study.figure[0])
    np.testing.assert_array_equal(shown.cells.values, table.columns["kxx_n_per_mm"])
    np.testing.assert_array_equal(shown.cells.points, sample(loaded, 0, loaded.count))
    assert {why: which.sum() for why, which in shown.cells.missing.items()} == {
        "refused": table.counts["refused"]
    }
    assert shown.base == (4.0, 0.5) and shown.x.label == "radius of base hinges (mm)"
    assert (shown.y.label, shown.y.log) == ("the other necks (mm)", True)
    assert shown.caption.title == "Stiffness xx over radius of base hinges and the other necks"
    assert "stage: thickness_mm" in shown.caption.assumed


def test_the_front_of_a_study_is_the_best_of_its_table_and_its_drawings_are_those_designs(
    tmp_path: Path,
) -> None:
    loaded = study(tmp_path, GRID)
    table = answered(loaded)
    source = source_of(loaded, table)
    shown = front_of(source, loaded.study.figure[1])
    x, y = table.with_results("envelope_mm", "kxx_n_per_mm")
    drawable = ~np.isin(np.arange(len(x)), shown.undrawable)
    for place in shown.front:
        assert not (
            drawable & (x <= x[place]) & (y >= y[place]) & ((x < x[place]) | (y > y[place]))
        ).any()
    assert 1 <= len(shown.chosen) <= 2 and {one.place for one in shown.chosen} <= set(shown.front)
    (radius,) = table.with_results("hinges.base.radius_mm")
    for one in shown.chosen:
        assert {q.name: v for q, v in one.numbers}["radius of base hinges"] == radius[one.place]
    assert shown.left_out == [f"not drawn: {table.counts['refused']} refused"]


def test_a_table_without_any_answer_is_refused(tmp_path: Path) -> None:
    loaded = study(tmp_path, GRID)
    table = answered(loaded)
    table.status[:] = "refused"
    with pytest.raises(BadInput, match="none of 28 designs has a result"):
        findings(Source(loaded, table, {}))


def test_every_figure_says_what_is_assumed_as_long_as_something_is(tmp_path: Path) -> None:
    share = Share(*(np.array([0.5]) for _ in range(4)), output("coupling_xy"))
    same = [Percentile(p, 0.5, 0.4, 0.6) for p in (2.5, 50.0, 97.5)]
    scatter = Scatter(output("coupling_xy"), np.linspace(0.0, 1.0, 9), same)
    for caption, said in ((CAPTION, True), (CAPTION._replace(assumed=[]), False)):
        for figure in (
            map_figure(shown_map()._replace(caption=caption)),
            distribution_figure(Distribution(caption, [scatter])),
            sensitivity_figure(Sensitivity(caption, [share], ["one"])),
            pareto_figure(shown_front(tmp_path)._replace(caption=caption)),
        ):
            assert ("assumed dimensions" in texts(figure)) is said and "A title" in texts(figure)


def test_the_base_stage_is_answered_as_a_design_with_its_own_values(tmp_path: Path) -> None:
    one = [
        ("from = 2.5\nto = 5.5\npoints = 7", "values = [4.0]"),
        ("points = 4", "points = 2"),
        ("from = 0.4", "from = 0.5"),
    ]
    loaded = study(tmp_path, GRID, *one, ('scale = "log"\n', ""))
    table = answered(loaded)
    found = nominal(loaded)
    for name in loaded.outputs:
        assert found[name] == pytest.approx(table.columns[name][0], rel=1e-12, abs=1e-12)
    assert base_factor_values(loaded) == {"hinges.base.radius_mm": 4.0, "the other necks": 0.5}


def test_keys_of_different_values_have_no_base_value(tmp_path: Path) -> None:
    necks = '"hinges.elbow.neck_mm", "hinges.platform.neck_mm"'
    unlike = (necks, '"hinges.elbow.radius_mm", "hinges.base.neck_mm"')
    mixed = study(tmp_path, GRID, unlike, ('"the other necks"', '"mixed"'))
    assert set(base_factor_values(mixed)) == {"hinges.base.radius_mm"}


@pytest.mark.parametrize(
    ("path", "mechanism", "said"),
    [
        (
            "stiffness.free.analytic.theta",
            True,
            "stiffness in θ, other directions free (N mm/rad)",
        ),
        (
            "stiffness.stress.analytic.upper_guide.y",
            True,
            "highest hinge stress per displacement in y, other directions held, hinge upper "
            "guide (MPa/µm)",
        ),
        ("modes.frequency.2.analytic", True, "natural frequency, mode 2 (Hz)"),
        ("modes.frequency.2.analytic", False, "natural frequency, mode 2 (Hz)"),
        (
            "drift.stress.uniform.analytic.chain_1.base",
            False,
            "highest hinge stress per K or K/mm, case uniform, chain 1, hinge base (MPa)",
        ),
    ],
)
def test_a_path_becomes_words_with_the_unit(path: str, mechanism: bool, said: str) -> None:
    name = "xy-stage" if mechanism else "mobility6"
    about = flexfem.load(Path(__file__).parents[2] / "geometry" / f"{name}.toml")
    assert asked(path, about).label == said
