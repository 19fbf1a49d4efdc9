"""What the figures of a study show, as numbers."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, norm

import flexfem.study.findings
from flexfem.studies import facts_of
from flexfem.study.collect import StudyTable
from flexfem.study.findings import findings
from flexfem.study.judge import judge
from flexfem.study.loaded import LoadedStudy, sample
from flexfem.study.maps import cells_of
from flexfem.study.records import Distribution, ParetoFront, Refused, StudyMap
from flexfem.study.source import Source
from flexfem.study.statistics import percentiles

FREE = 'key = "hinges.base.neck_mm"\nfrom = 0.4\nto = 0.7'
THICKNESS = 'key = "thickness_mm"\nfrom = 8.0\nto = 12.0'
GRID = f"{FREE}\npoints = 4", f"{THICKNESS}\npoints = 3"
SCATTER = '[[figure]]\nkind = "distribution"\nvalues = ["kxx_n_per_mm"]'
MAP = '[[figure]]\nkind = "map"\nx = "thickness_mm"\ny = "hinges.base.neck_mm"\nvalue = "kxx_n_per_mm"'
FRONT = '[[figure]]\nkind = "pareto"\nx = "range_x_um"\ny = "kxx_n_per_mm"'


def found_in(loaded: LoadedStudy, table: StudyTable, nominal=None):
    return [*findings(Source(loaded, table, nominal or {})).values()]


def table_of(loaded: LoadedStudy, **columns: np.ndarray) -> StudyTable:
    """A table in which all have an answer but the second design, given values and else ones."""
    n = loaded.count
    values = sample(loaded, 0, loaded.count)
    status = np.full(n, "ok", dtype=object)
    reason = np.full(n, "", dtype=object)
    status[1] = "refused"
    reason[1] = "no"
    found = {name: np.full(n, 1.0) for name in loaded.outputs} | columns
    found = {name: np.where(status == "ok", value, np.nan) for name, value in found.items()}
    found |= {column.name: values[:, k] for k, column in enumerate(loaded.columns)}
    return StudyTable(np.arange(n), status, reason, found)


def test_the_ends_of_a_map_are_where_its_value_is_least_and_most(studies) -> None:
    loaded = studies.of('method = "grid"', *GRID, tail=MAP)
    values = np.array(
        [3.0, -99.0, 4.0, 2.5, 6.0, 7.0, 8.0, 9.0, 5.0, 5.5, 5.6, 5.7]
    )  # the second has no answer
    (found,) = found_in(loaded, table_of(loaded, kxx_n_per_mm=values))
    neck, thickness = sample(loaded, 0, 12).T
    ends = {"least": (2.5, 3), "most": (9.0, 7)}
    columns = ("end", "kxx_n_per_mm", "thickness_mm", "hinges.base.neck_mm")
    rows = [
        dict(zip(columns, (end, v, thickness[k], neck[k]), strict=True))
        for end, (v, k) in ends.items()
    ]
    assert facts_of(found) == {"rows": rows}


def test_the_power_along_a_front_is_that_of_its_designs_and_not_of_the_others(studies) -> None:
    loaded = studies.of('method = "monte_carlo"\ndesigns = 200\nseed = 3', FREE, tail=FRONT)
    best = np.arange(200) % 10 == 0
    reach = np.random.default_rng(4).uniform(20.0, 60.0, 200)
    reach[best] = np.geomspace(
        20.0, 60.0, 20
    )  # so near to one another that none of the others is on the front
    stiffness = np.where(best, 1e7 * reach**-3.3, 1e6 * reach**-2.9)
    table = table_of(loaded, range_x_um=reach, kxx_n_per_mm=stiffness)
    (found,) = found_in(loaded, table)
    assert isinstance(found, ParetoFront)
    assert (
        found.power == pytest.approx(-3.3, rel=1e-9)
        and len(found.front) == len(facts_of(found)["rows"]) == 20
    )
    assert len(found.chosen) == 4 and {one.place for one in found.chosen} <= set(
        found.front.tolist()
    )
    assert found.gain is None


def test_what_symmetry_makes_zero_makes_no_front(studies) -> None:
    loaded = studies.of(
        'method = "monte_carlo"\ndesigns = 50\nseed = 3',
        FREE,
        tail=FRONT.replace("kxx_n_per_mm", "kxt_n"),
    )
    noise = np.random.default_rng(4).normal(0.0, 1e-14, 50)
    table = table_of(loaded, range_x_um=np.arange(50.0), kxt_n=noise)
    (found,) = found_in(loaded, table, {"range_x_um": 3.0, "kxt_n": 1e-15, "envelope_mm": 9.0})
    assert (
        found.front.tolist() == [48]
        and set(found.points[:, 1]) == {0.0}
        and found.base == (3.0, 0.0)
    )
    assert found.gain is None


def test_a_figure_that_cannot_be_drawn_is_refused_alone(studies) -> None:
    loaded = studies.of(
        'method = "monte_carlo"\ndesigns = 99\nseed = 3',
        FREE,
        tail='[[output]]\nname = "root"\nexpression = "sqrt(kxx_n_per_mm - 2.5)"\n'
        + "".join(
            f'[[figure]]\nkind = "{k}"\nvalues = ["{v}"]\n'
            for k, v in (
                ("distribution", "root"),
                ("sensitivity", "kyy_n_per_mm"),
                ("distribution", "kxx_n_per_mm"),
            )
        ),
    )
    table = table_of(loaded, kxx_n_per_mm=np.arange(99.0), kyy_n_per_mm=np.arange(99.0))
    columns = {name: np.where(table.ok, value, np.nan) for name, value in table.columns.items()}
    found = found_in(
        loaded, replace(table, columns=columns | judge(loaded, columns, table.ok).derived)
    )
    assert [type(one) for one in found] == [Refused, Refused, Distribution]
    assert (
        "1e-100 to 1e+100 in size for 2 of 98 designs" in found[0].reason
        and "the first is design 0" in found[0].reason
    )
    assert "98 designs have a result, expected at least 100" in facts_of(found[1])["refused"]


def test_designs_that_break_a_constraint_are_on_no_front_and_no_map(studies) -> None:
    limit = '[[constraint]]\nvalue = "envelope_mm"\nmost = 5.5\n'
    loaded = studies.of('method = "monte_carlo"\ndesigns = 6\nseed = 3', FREE, tail=limit + FRONT)
    reach = np.array([1.0, 0, 5.0, 3.0, 2.0, 9.0])
    stiffness = np.array([6.0, 0, 2.0, 4.0, 4.5, 9.0])
    table = table_of(
        loaded, range_x_um=reach, kxx_n_per_mm=stiffness, envelope_mm=np.array([5.5, 0, 5, 6, 5, 7])
    )
    table = replace(table, feasible=judge(loaded, table.columns, table.ok).feasible)
    assert table.infeasible.tolist() == [False, False, False, True, False, True]
    (found,) = found_in(loaded, table)
    assert isinstance(found, ParetoFront) and found.points[found.front, 0].tolist() == [
        5.0,
        2.0,
        1.0,
    ]
    assert [row["design"] for row in facts_of(found)["rows"]] == ["2", "4", "0"]
    loaded = studies.of('method = "grid"', *GRID, tail=limit + MAP)
    table = table_of(loaded, kxx_n_per_mm=np.arange(12.0), envelope_mm=np.arange(12.0))
    table = replace(table, feasible=judge(loaded, table.columns, table.ok).feasible)
    (found,) = found_in(loaded, table)
    assert isinstance(found, StudyMap) and [row["kxx_n_per_mm"] for row in found.table.facts] == [
        0.0,
        5.0,
    ]
    cells = cells_of(
        Source(loaded, table, {}), ("thickness_mm", "hinges.base.neck_mm"), "kxx_n_per_mm"
    )
    assert {why: np.flatnonzero(which).tolist() for why, which in cells.missing.items()} == {
        "refused": [1],
        "violates a constraint": [6, 7, 8, 9, 10, 11],
    }
    nothing = replace(table, feasible=np.zeros(12, dtype=bool))
    assert "satisfies all constraints" in facts_of(found_in(loaded, nothing)[0])["refused"]


def test_a_map_of_more_factors_is_of_means_over_the_others(studies) -> None:
    """A plane over x and log y plus what z adds: a cell has the mean of its designs, and stands at
    its centre.
    """
    factors = (
        THICKNESS,
        f'{FREE}\nscale = "log"',
        'label = "z"\nkey = "hinges.elbow.neck_mm"\nfrom = 0.4\nto = 0.6',
    )
    loaded = studies.of('method = "sobol"\ndesigns = 2048\nseed = 3', *factors)
    x, y, z = sample(loaded, 0, 2048).T
    table = table_of(loaded, kxx_n_per_mm=2 * x + 30 * np.log(y) + 50 * (z - 0.5))
    cells = cells_of(
        Source(loaded, table, {}), ("thickness_mm", "hinges.base.neck_mm"), "kxx_n_per_mm"
    )
    plane = 2 * cells.points[:, 0] + 30 * np.log(cells.points[:, 1])
    assert (
        cells.averaged == ("z",) and cells.grid and len(cells.values) == 13**2 and not cells.missing
    )
    assert np.abs(cells.values - plane).max() < 4 * 2.95 / np.sqrt(
        8
    )  # about 12 designs a cell, 2.95 by z and place
    assert np.mean(cells.values - plane) == pytest.approx(0.0, abs=0.05)
    assert cells.scatter == pytest.approx(
        np.hypot(50 * 0.2, np.hypot(8 / 13, 16.8 / 13)) / np.sqrt(12), rel=0.1
    )
    assert cells.size == 12
    grid = studies.of(
        'method = "grid"',
        *GRID,
        'label = "z"\nkey = "hinges.elbow.neck_mm"\nvalues = [0.4, 0.6, 0.5]',
    )
    table = table_of(grid, kxx_n_per_mm=np.arange(36.0))
    cells = cells_of(
        Source(grid, table, {}), ("thickness_mm", "hinges.base.neck_mm"), "kxx_n_per_mm"
    )
    neck = np.round(cells.points[:, 1], 9)
    thickness = cells.points[:, 0]
    first = cells.values[(neck == 0.4) & (thickness == 8.0)]
    assert (
        first == 1.0 and cells.values[(neck == 0.4) & (thickness == 10.0)] == 4.0
    )  # of 0 and 2: the second has none
    assert len(cells.values) == 12 and cells.size == 3


@pytest.mark.parametrize(
    ("x_better", "y_better", "expected"),
    [
        ("larger", "larger", 9.0 / 2.0),
        ("smaller", "larger", 8.0 / 2.0),
        ("larger", "smaller", 3.0 / 2.0),
    ],
)
def test_the_gain_is_over_the_base_stage_at_no_less_reach_and_no_larger_envelope(
    studies, monkeypatch: pytest.MonkeyPatch, x_better: str, y_better: str, expected: float
) -> None:
    loaded = studies.of('method = "monte_carlo"\ndesigns = 7\nseed = 3', FREE, tail=FRONT)
    better = loaded.study.figure[0].model_copy(update={"x_better": x_better, "y_better": y_better})
    loaded = replace(loaded, study=loaded.study.model_copy(update={"figure": (better,)}))
    table = table_of(
        loaded,
        range_x_um=np.array([30.0, 0, 31.0, 29.0, 35.0, 40.0, 30.0]),
        kxx_n_per_mm=np.array([3.0, 0, 9.0, 8.0, 99.0, 70.0, 5.0]),  # 99 in too large an envelope
        envelope_mm=np.array([100.0, 0, 99.0, 98.0, 101.0, 97.0, 96.0]),
    )
    neck = table.columns["hinges.base.neck_mm"][5]  # the best cannot be drawn
    drawable = loaded.family.drawable
    monkeypatch.setattr(
        loaded.family, "drawable", lambda values: None if values[0] == neck else drawable(values)
    )
    base = {"range_x_um": 30.0, "kxx_n_per_mm": 2.0, "envelope_mm": 100.0}
    (found,) = found_in(loaded, table, base)
    assert isinstance(found, ParetoFront) and found.gain == pytest.approx(expected, rel=1e-12)
    (beyond,) = found_in(loaded, table, base | {"envelope_mm": 50.0})
    assert (
        isinstance(beyond, ParetoFront)
        and beyond.gain is None
        and facts_of(found)["gain"] == found.gain
    )


def test_an_open_interval_has_no_end_in_json(studies) -> None:
    loaded = studies.of('method = "monte_carlo"\ndesigns = 20\nseed = 3', FREE, tail=SCATTER)
    (found,) = found_in(loaded, table_of(loaded, kxx_n_per_mm=np.linspace(1.0, 2.0, 20)))
    rows = json.loads(json.dumps(facts_of(found), allow_nan=False))["rows"]
    assert [float(row["percent"][:-1]) for row in rows] == [2.5, 50.0, 97.5]
    assert rows[0]["low"] is None and rows[1]["value"] == found.scatters[0].percentiles[1].value


def test_shares_are_by_factor_and_first_order_is_not_total(studies) -> None:
    """u + 2 v + 6 u v of uniform -1/2..1/2: variances 12, 48 and 36 of 96 by hand, the last of both
    factors.
    """
    figure = '[[figure]]\nkind = "sensitivity"\nvalues = ["kxx_n_per_mm"]'
    loaded = studies.of('method = "saltelli"\nbase = 512\nseed = 5', FREE, THICKNESS, tail=figure)
    table = table_of(loaded)
    table.status[:] = "ok"
    u, v = ((sample(loaded, 0, loaded.count) - [0.4, 8.0]) / [0.3, 4.0] - 0.5).T
    table.columns["kxx_n_per_mm"][:] = 5.0 + u + 2 * v + 6 * u * v
    (found,) = found_in(loaded, table)
    rows = facts_of(found)["rows"]
    assert [row["factor"] for row in rows] == ["neck of base hinges", "thickness"]
    assert [row["first"] for row in rows] == pytest.approx([1 / 8, 1 / 2], abs=0.1)
    assert [row["total"] for row in rows] == pytest.approx([1 / 2, 7 / 8], abs=0.1)
    assert all(0.01 < row[part] < 0.2 for part in ("first_band", "total_band") for row in rows)


def test_a_row_of_saltellis_scheme_is_one_draw(studies, monkeypatch) -> None:
    """Two factors: the rows A, A with a column of B twice, and B; the second design has no answer."""
    loaded = studies.of('method = "saltelli"\nbase = 4\nseed = 3', FREE, THICKNESS, tail=SCATTER)
    asked = []
    monkeypatch.setattr(
        flexfem.study.findings,
        "percentiles",
        lambda values, marked, draws: asked.append(draws) or [],
    )
    found_in(loaded, table_of(loaded))
    assert asked[0].tolist() == [0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]


@pytest.mark.parametrize(("n", "percent"), [(59, 10.0), (400, 2.5), (401, 50.0), (2000, 97.5)])
def test_ranks_have_the_binomial_probability(n: int, percent: float) -> None:
    (found,) = percentiles(np.arange(1.0, n + 1)[::-1], [percent])  # the k-th smallest is k
    chance = binom(n, percent / 100)
    assert chance.cdf(found.high - 1) - chance.cdf(found.low - 1) >= 0.95
    assert chance.cdf(found.low - 1) <= 0.025 < chance.cdf(found.low)  # and no rank nearer does
    assert chance.sf(found.high - 1) <= 0.025 < chance.sf(found.high - 2)


def test_intervals_of_shared_draws_hold_the_true_percentile_as_often_as_they_say() -> None:
    rng = np.random.default_rng(11)
    draws = np.repeat(np.arange(150), 5)
    hits = []
    repeats = 400
    truth = np.sqrt(1.25) * float(norm.ppf(0.9))
    for _ in range(repeats):
        values = np.repeat(rng.normal(size=150), 5) + 0.5 * rng.normal(size=750)
        (found,) = percentiles(values, [90.0], draws)
        hits.append(found.low <= truth <= found.high)
    assert abs(np.mean(hits) - 0.95) <= 4 * np.sqrt(
        0.05 * 0.95 / repeats
    )  # four standard deviations


def test_an_interval_is_open_where_the_sample_is_too_small_for_it() -> None:
    low, middle, high = percentiles(np.linspace(0.0, 1.0, 40), [2.5, 50.0, 97.5])
    assert low.low == -np.inf and high.high == np.inf
    assert 0 < middle.low < middle.value == 0.5 < middle.high < 1
    (one,) = percentiles(np.array([3.7]), [50.0], np.array([0]))
    assert (one.low, one.value, one.high) == (-np.inf, 3.7, np.inf)
