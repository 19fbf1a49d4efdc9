"""What figures of large studies hold: the columns they show, one after the other, and no more dots than are seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexfem.plot.study_pareto import thinned
from flexfem.plot.study_records import Source, distribution_of, front_of
from flexfem.study import collected as tables
from flexfem.study.answer import answer
from flexfem.study.collect import collect
from flexfem.study.content import write_part
from flexfem.study.findings import findings
from flexfem.study.parts import parts_of

FIGURES = """
[[figure]]
kind = "distribution"
values = ["ktt_n_mm_per_rad", "envelope_mm"]
[[figure]]
kind = "pareto"
x = "range_x_um"
y = "kxx_n_per_mm"
"""


def test_figures_read_the_columns_they_show(studies: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the factors of all designs, which a large study cannot hold; those of the designs drawn are right."""
    loaded = studies.of('method = "sobol"\ndesigns = 90\nseed = 3', 'key = "hinges.base.neck_mm"\nfrom = 0.3\nto = 0.6',
                        'key = "hinges.elbow.neck_mm"\nfrom = 0.3\nto = 0.6', tail=FIGURES)  # fmt: skip
    parts = parts_of(loaded, tmp_path, 90)
    write_part(parts, parts.chunk(0), answer(loaded, 0, 90))
    table = tables.read_table(collect(parts, tmp_path / "t.parquet").path, loaded)
    asked, read = list[str](), tables._column
    monkeypatch.setattr(tables, "_column", lambda path, name: asked.append(name) or read(path, name))
    scattered, best = findings(loaded, table, {})
    source, (one, other) = Source(loaded, table, {}), loaded.study.figure
    scatters, _ = distribution_of(source, one, scattered)
    drawn = front_of(source, other, best)
    assert set(asked) == {"ktt_n_mm_per_rad", "envelope_mm", "range_x_um", "kxx_n_per_mm"}
    assert all(callable(scatter.values) for scatter in scatters)
    necks = table.columns["hinges.elbow.neck_mm"][table.ok]
    for chosen in drawn.chosen:
        assert best.chosen[chosen.place].hinges.elbow.neck == pytest.approx(necks[chosen.place], rel=1e-15)


def test_of_very_many_designs_some_are_drawn_always_the_same_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(1).normal(size=(1000, 2))
    assert thinned(points) is points
    monkeypatch.setattr("flexfem.plot.study_pareto.MOST_DOTS", 100)
    some = thinned(points)
    assert len(np.unique(some, axis=0)) == 100 and set(some[:, 0]) <= set(points[:, 0])
    np.testing.assert_array_equal(some, thinned(points))
    places = np.searchsorted(np.sort(points[:, 0]), some[:, 0])
    assert 350 < np.mean(places) < 650  # of all the sample, five standard errors
