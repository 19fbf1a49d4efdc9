"""Figures of every number that a study asks for, by the number of factors that differ."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flexfem.plot.curves import runs_of, tick_text
from flexfem.plot.study import page_of
from flexfem.results import SPACE
from flexfem.studies import run_study
from flexfem.study.collect import StudyTable
from flexfem.study.listing import left_out, tables_of_designs
from flexfem.study.loaded import LoadedStudy, load_study, sample
from flexfem.study.overview import overview
from flexfem.study.records import Curves, Effects, StudyMaps
from flexfem.study.source import Source

GUIDE = Path(__file__).parents[2] / "geometry" / "parallelogram.toml"
X = "stiffness.free.analytic.x"
Y = "stiffness.free.analytic.y"
NECK = '[[factor]]\nlabel = "leaf"\nkey = "parameters.neck_mm"\nvalues = [0.8, 0.2, 0.4]\n'
LENGTH = '[[factor]]\nlabel = "length"\nkey = "parameters.length_mm"\nvalues = [40, 60]\n'
WIDTH = '[[factor]]\nkey = "parameters.width_mm"\nvalues = [8, 12]\n'


def written(folder: Path, *tables: str, ask: tuple[str, ...] = (X, Y), model: str = "analytic"):
    """A study file about the parallelogram."""
    text = f'name = "leaves"\nstage = "{GUIDE}"\nmodel = "{model}"\nask = {json.dumps(ask)}\n'
    path = folder / "leaves.toml"
    path.write_text("\n".join([text, '[sampling]\nmethod = "grid"', *tables]))
    return path


def source_of(path: Path, nominal: dict[str, float] | None = None, **columns: object) -> Source:
    """A study with invented numbers: column names with dots written as double underlines."""
    loaded: LoadedStudy = load_study(path)
    values = sample(loaded, 0, loaded.count)
    found = {column.name: values[:, k] for k, column in enumerate(loaded.columns)}
    found |= {name.replace("__", "."): np.array(each, float) for name, each in columns.items()}
    status = np.full(loaded.count, "ok", object)
    missing = np.isnan(found[loaded.outputs[0]])
    status[missing] = "refused"
    reason = np.full(loaded.count, "", object)
    table = StudyTable(np.arange(loaded.count), status, reason, found)
    return Source(loaded, table, nominal or {})


def test_one_factor_gives_ascending_curves_with_bands_of_each_model(tmp_path):
    solid = "stiffness.free.three_dimensions.x"
    path = written(tmp_path, NECK, ask=(X, solid), model="both")
    (shown,) = overview(
        source_of(
            path,
            {"leaf": 0.5, X: 3.5},
            stiffness__free__analytic__x=[8.0, np.nan, 2.0],
            stiffness__free__three_dimensions__x=[7.0, np.nan, 1.0],
            **{"stiffness__free__analytic__x__band": [np.nan] * 3},
            **{"stiffness__free__three_dimensions__x__band": [0.7, np.nan, 0.02]},
        )
    ).values()
    assert isinstance(shown, Curves)
    assert shown.places.tolist() == [0.2, 0.4, 0.8] and shown.base == 0.5
    (panel,) = shown.panels
    first, second = panel.curves
    assert (first.model, second.model) == ("analytic model", "finite elements, three dimensions")
    np.testing.assert_array_equal(first.values, [np.nan, 2.0, 8.0])
    np.testing.assert_array_equal(second.bands, [np.nan, 0.02, 0.7])
    assert shown.missing["refused"].tolist() == [True, False, False]
    assert "at most 10 % of the number" in shown.caption.lines[-1]
    (axes, *_) = page_of(shown).axes
    lines = [line for line in axes.lines if len(line.get_xdata()) == 3]
    assert lines[0].get_color() != lines[1].get_color() and len(axes.collections) == 3


def test_two_factors_give_a_map_of_each_number_and_state_those_that_are_constant(tmp_path):
    renamed = f'[[output]]\nname = "soft"\nexpression = "{X}"\nlabel = "softness"\nunit = "N/mm"\n'
    path = written(tmp_path, NECK, LENGTH, renamed)
    numbers = np.arange(6.0) + 1
    source = source_of(
        path,
        stiffness__free__analytic__x=numbers,
        soft=numbers,
        stiffness__free__analytic__y=[50.0] * 6,
    )
    found = overview(source)
    assert [*found] == ["leaves-maps"]
    shown = found["leaves-maps"]
    assert isinstance(shown, StudyMaps)
    (one,) = shown.maps
    assert one.value.label == "softness (N/mm)" and one.cells.values.tolist() == numbers.tolist()
    said = "Constant: stiffness in y, other directions free 50 N/mm."
    assert shown.caption.lines[-1].replace(SPACE, " ") == said


def test_more_factors_give_the_median_over_each(tmp_path):
    path = written(tmp_path, NECK, LENGTH, WIDTH, ask=(X,))
    values = np.array([5.0, 7, 6, 8, 1, 1, 1, 1, 2, 4, 3, 5])  # the neck varies slowest
    (shown,) = overview(source_of(path, stiffness__free__analytic__x=values)).values()
    assert isinstance(shown, Effects)
    neck, length, _ = shown.trends[0]
    assert neck.places.tolist() == [0.2, 0.4, 0.8] and neck.medians.tolist() == [1.0, 3.5, 6.5]
    assert length.medians.tolist() == [np.median([5, 7, 1, 1, 2, 4]), np.median([6, 8, 1, 1, 3, 5])]
    assert len(page_of(shown).axes) == 3


def test_nothing_is_drawn_where_nothing_differs(tmp_path):
    path = written(tmp_path, NECK, ask=(X,))
    assert overview(source_of(path, stiffness__free__analytic__x=[3.0] * 3)) == {}


def test_stretches_end_midway_between_neighbours():
    places = np.array([1.0, 3.0, 4.0, 8.0])
    marked = np.array([True, False, True, True])
    assert runs_of(places, marked, False) == [(1.0, 1.0), (3.5, 4.5)]
    ((start, length),) = runs_of(np.array([1.0, 4.0]), np.array([False, True]), True)
    assert (start, start + length) == pytest.approx((2.0, 4.0))


def test_ticks_have_powers_of_ten():
    assert [tick_text(value) for value in (0.25, 70000.0, 2.5e7, -1e-6)] == [
        "0.25",
        "70000",
        "2.5×10⁷",
        "\N{MINUS SIGN}1×10⁻⁶",
    ]


def test_a_table_has_the_first_designs_with_their_bands_and_says_how_many_are_left_out(tmp_path):
    many = NECK.replace("values = [0.8, 0.2, 0.4]", "from = 0.2\nto = 0.8\npoints = 61")
    source = source_of(written(tmp_path, many, ask=(X,)), stiffness__free__analytic__x=range(61))
    (table,) = tables_of_designs(source)
    assert len(table.rows) == 50 and table.rows[2] == ["2", "0.22", "2"]
    said = left_out(source, Path("all.parquet"))
    assert "first 50 of 61 designs; 11 are left out" in said and "all.parquet" in said


def test_a_run_names_the_table_and_the_figures_that_it_has_drawn(tmp_path, flexfem, monkeypatch):
    path = written(tmp_path, NECK)
    facts = run_study(path, tmp_path / "out", workers=1)
    table, picture, page = map(Path, facts["written"])
    assert table.exists() and picture.name == "leaves-curves.png" and picture.exists()
    assert f"table: {table}\nfigure: {picture} (and .pdf)\nnext: " in str(facts)
    assert page.exists()
    stiff = [row["most"] / row["least"] for row in json_rows(flexfem, path, tmp_path)]
    # leaves in bending, and in tension: cube and first power of the thickness
    assert stiff == pytest.approx([4.0**3, 4.0], rel=0.15)
    monkeypatch.chdir(tmp_path)
    code, _, err = flexfem("study", "plot", path, "-o", "k.xyz")
    assert (code, err.count("\n")) == (2, 1) and ".html" in err
    for name in ("k.csv", "k.html", "k.png"):
        code, _, err = flexfem("study", "plot", tmp_path / "out" / "leaves", "-o", name)
        assert code == 0 and err.endswith(f"written: {name}\n") and Path(name).exists()
    assert "finite elements" not in Path("k.html").read_text()
    assert len(Path("k.csv").read_text().splitlines()) == 4


def json_rows(flexfem, path: Path, folder: Path) -> list[dict[str, float]]:
    """Extremes of the curves of a study, as the command prints them."""
    code, out, _ = flexfem("study", "plot", path, "-o", folder / "out", "--json")
    assert code == 0
    return json.loads(out)["findings"]["leaves-curves"]["rows"]
