"""The page of a study: designs to point at are those of its table, drawn with their own factors, all names as text."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from markupsafe import Markup

from flexfem.mechanism.bodies import Segment
from flexfem.mechanism.drawing import part_of
from flexfem.mechanism.stage import load_stage
from flexfem.page.section import html_of
from flexfem.page.study import marks_table, of_front, of_map, outline_paths, path_of, range_of, study_parts
from flexfem.plot.study import Source, map_of, named
from flexfem.plot.study_figures import chart_figure
from flexfem.study.answer import own_values
from flexfem.study.factors import Factor, columns_of
from flexfem.study.findings import Marks, Percentile, cells_of, findings
from flexfem.study.loaded import LoadedStudy

from ..study.answered import STAGE, answered, head, study

HEAD = head("A study")
GRID = f"""{HEAD}
[sampling]
method = "grid"
[[factor]]
key = "hinges.base.radius_mm"
from = 2.0
to = 3.5
points = 4
[[factor]]
keys = ["hinges.elbow.neck_mm", "hinges.platform.neck_mm"]
label = "other necks"
from = 0.4
to = 0.8
points = 3
"""
MAP = '[[figure]]\nkind = "map"\nx = "hinges.base.radius_mm"\ny = "other necks"\nvalue = "kxx_n_per_mm"\n'
FRONT = '[[figure]]\nkind = "pareto"\nx = "range_x_um"\ny = "kxx_n_per_mm"\n'
SCATTERED = f"""{HEAD}
[sampling]
method = "monte_carlo"
designs = 400
seed = 4
[[factor]]
key = "hinges.base.radius_mm"
from = 2.0
to = 3.5
[[factor]]
key = "hinges.base.neck_mm"
from = 0.4
to = 0.8
[[factor]]
key = "thickness_mm"
from = 8.0
to = 12.0
"""
STATUS = {"designs": 12, "ok": 10, "refused": 2, "failed": 0, "open": 0, "warnings": []}
REASONS = {"reasons": {"refused": {"bodies overlap": 2}}}


def cells(source: Source):
    """The cells of the first figure of a study, a map."""
    figure = source.loaded.study.figure[0]
    return cells_of(source.loaded, source.table, (figure.x, figure.y), figure.value)


def source_of(loaded: LoadedStudy, **changed: np.ndarray) -> Source:
    """A study with its answers, some columns replaced."""
    return Source(loaded, answered(loaded, **changed), own_values(loaded))


def page_of(source: Source) -> str:
    found = dict(
        zip(
            (name for name, _ in named(source.loaded)),
            findings(source.loaded, source.table, source.nominal),
            strict=True,
        )
    )
    made = [make() for _, make in study_parts(source, found, STATUS | REASONS)]
    said = {"subtitle": "", "doubts": "", "command": "flexfem report", "made": "2026-01-02", "versions": {}}
    return html_of(made, title=source.loaded.study.name, **said)


def data_of(html: str) -> dict:
    (text,) = re.findall(r'<script type="application/json" id="study-designs">(.*?)</script>', html, re.S)
    return json.loads(text)


def targets_of(html: str) -> list[tuple[int, float, float, str]]:
    found = re.findall(r'<circle cx="(.*?)" cy="(.*?)" r="4" data-design="(\d+)"><title>(.*?)</title>', html)
    return [(int(design), float(x), float(y), unescape(text)) for x, y, design, text in found]


def points_of(path: str) -> np.ndarray:
    """Ends of the steps of a path, mm, y upwards, read without the code that wrote it."""
    at, found = np.zeros(2), []
    for letter, text in re.findall(r"([Mla])([^MlaZ]*)", path):
        numbers = [int(each) for each in text.split()]
        at = np.array(numbers[-2:]) if letter == "M" else at + numbers[-2:]
        found.append(at)
    return np.array(found) * [0.01, -0.01]


def test_a_line_and_an_arc_are_written_in_hundredths_of_a_millimetre_with_y_downwards():
    line = [Segment(0j, 10 + 0j), Segment(10 + 0j, 20 + 10j, 10 + 10j), Segment(20 + 10j, 20 + 12.346j)]
    assert path_of(line) == "M0 0l1000 0a1000 1000 0 0 0 1000 -1000l0 -235"
    clockwise = [Segment(20 + 10j, 10 + 0j, 10 + 10j)]
    assert path_of(clockwise) == "M2000 -1000a1000 1000 0 0 1 -1000 1000"


def test_rounding_does_not_add_up_along_a_path():
    steps = [Segment(complex(0.004 * k), complex(0.004 * (k + 1))) for k in range(1000)]
    assert points_of(path_of(steps))[-1] == pytest.approx([4.0, 0.0])


def test_the_drawn_outline_of_a_design_is_that_of_the_stage_with_its_factors(tmp_path):
    source = source_of(study(tmp_path, GRID + FRONT))
    html = page_of(source)
    data, targets = data_of(html), targets_of(html)
    assert len(targets) > 2
    for design, *_ in targets:
        radius, neck = 2.0 + 0.5 * (design // 3), 0.4 + 0.2 * (design % 3)  # a grid counts its last factor fastest
        stage = load_stage(STAGE).replace(radius={"base": radius}, neck={"elbow": neck, "platform": neck})
        ends = np.array([[each.end.real, each.end.imag] for each in part_of(stage).outer])
        drawn = points_of(data["designs"][str(design)]["m"])
        for end in ends:
            assert np.hypot(*(drawn - end).T).min() < 0.0072, (design, end)
        assert len(drawn) <= len(ends) + 1


def test_the_numbers_of_a_design_are_those_of_the_table(tmp_path):
    scale = np.linspace(1.0, 2.0, 12)
    loaded = study(tmp_path, GRID + FRONT)
    source = source_of(loaded, kxx_n_per_mm=123.456 * scale[::-1], range_x_um=34.5678 * scale)
    html = page_of(source)
    data = data_of(html)
    names = [one["name"] for one in data["columns"]]
    assert data["factors"] == 2 and names[:2] == ["radius of base hinges", "other necks"]
    place = names.index("stiffness XX")
    assert data["columns"][place]["unit"] == "N/mm"
    assert data["designs"]["0"]["v"][place] == "246.91" and data["designs"]["11"]["v"][place] == "123.46"
    assert data["designs"]["4"]["v"][:2] == ["2.5000", "0.60000"]
    told = {design: text for design, _, _, text in targets_of(html)}
    assert told[11] == "Design 11: range in X at yield 69.136\xa0µm, stiffness XX 123.46\xa0N/mm"
    row = re.search(r'<th scope="row" data-key="11">11</th>(.*?)</tr>', html, re.S)
    assert row is not None
    assert re.findall(r">([^<>]+)</td>", row[1]) == ["69.136", "123.46", "3.5000", "0.80000"]


def test_what_symmetry_makes_zero_is_zero_on_the_page(tmp_path):
    """Stiffnesses of 100 and 400 N/mm: 1.9e-10 is round-off of what couples them, 2.1e-10 is not."""
    across = np.array([1.9e-10, -2.1e-10, *[-8.88e-15] * 10])
    ks = {"kxx_n_per_mm": 100 + 1e-3 * np.arange(12)[::-1], "kyy_n_per_mm": np.full(12, 400.0), "kxy_n_per_mm": across}
    source = source_of(study(tmp_path, GRID + FRONT), range_x_um=np.arange(12.0), **ks)
    data = data_of(page_of(source))
    place = [one["name"] for one in data["columns"]].index("stiffness XY")
    shown = [data["designs"][str(design)]["v"][place] for design in range(12)]
    assert shown == ["0", "\N{MINUS SIGN}2.1000×10⁻¹⁰", *["0"] * 10]
    marks = Marks({name: [Percentile(50.0, 1e-15, -2.1e-10, 1e-10)] for name in ("kxy_n_per_mm", "range_x_um")})
    cells = re.findall(r">([^<>]+ to [^<>]+)<", marks_table(source, marks))
    assert cells == ["0 (\N{MINUS SIGN}2.1000×10⁻¹⁰ to 0)", "1.0000×10⁻¹⁵ (\N{MINUS SIGN}2.1000×10⁻¹⁰ to 1.0000×10⁻¹⁰)"]


def test_designs_of_a_map_are_where_its_axes_have_their_ticks(tmp_path):
    """Stiffnesses from 50 to 61 in no order: 50 at the first design, 61 at the sixth."""
    html = page_of(source_of(study(tmp_path, GRID + MAP), kxx_n_per_mm=50.0 + 7 * np.arange(12) % 12))
    ends = dict(re.findall(r'<th scope="row"[^>]*>(least|most)</th>(.*?)</tr>', html, re.S))
    assert [re.findall(r">([^<>]+)</td>", ends[name]) for name in ("least", "most")] == [
        ["50.000", "2.0000", "0.40000"], ["61.000", "2.5000", "0.80000"]
    ]  # fmt: skip
    found = {
        which: {float(value): float(place) for place, value in re.findall(pattern, html, re.S)}
        for which, pattern in (
            ("x", r'-xtick_\d+">.*?<use [^>]*?x="([\d.]+)".*?>([\d.]+)</text>'),
            ("y", r'-ytick_\d+">.*?<use [^>]*?y="([\d.]+)".*?>([\d.]+)</text>'),
        )
    }
    targets = targets_of(html)
    assert len(targets) == 12
    checked = 0
    for design, x, y, _ in targets:
        radius, neck = 2.0 + 0.5 * (design // 3), round(0.4 + 0.2 * (design % 3), 9)
        for place, wanted in ((x, found["x"].get(radius)), (y, found["y"].get(neck))):
            if wanted is not None:
                assert place == pytest.approx(wanted, abs=0.06)
                checked += 1
    assert checked >= 12


def test_of_a_long_front_some_designs_are_shown_its_ends_among_them_and_the_page_says_so(tmp_path):
    loaded = study(tmp_path, SCATTERED.replace("designs = 400", "designs = 60") + FRONT)
    rising = np.linspace(1.0, 2.0, 60)
    source = source_of(loaded, kxx_n_per_mm=rising, range_x_um=3.0 - rising)
    (found,) = findings(loaded, source.table, {})
    points = of_front(source, loaded.study.figure[0], found, 10)
    assert points.rows[[0, -1]].tolist() == [59, 0] and len(points.rows) == 10
    assert points.at[0].tolist() == [1.0, 2.0]
    assert points.said == "10 of the 60 designs of the front, spread along it, can be pointed at."
    assert of_front(source, loaded.study.figure[0], found, 60).said == (
        "All 60 designs of the front can be pointed at."
    )


def test_a_front_shows_its_designs_though_others_have_no_answer_or_break_a_constraint(tmp_path):
    limited = GRID + FRONT + '[[constraint]]\nvalue = "kxx_n_per_mm"\nmost = 90.0\n'
    loaded = study(tmp_path, limited)
    stiffness = np.array([10.0, 99.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 89.0, 80.0, 11.0, 12.0])
    source = source_of(loaded, kxx_n_per_mm=stiffness, range_x_um=stiffness)
    status = np.array(["refused", *["ok"] * 11], dtype=object)
    feasible = (status == "ok") & (stiffness <= 90.0)
    source = source._replace(table=replace(source.table, status=status, feasible=feasible))
    (found,) = findings(loaded, source.table, {})
    points = of_front(source, loaded.study.figure[0], found, 10)
    assert points.rows.tolist() == [8] and points.at.tolist() == [[89.0, 89.0]]


def test_a_cell_of_means_is_pointed_at_by_the_design_nearest_to_its_middle(tmp_path):
    """The radius on a linear axis, the neck on a logarithmic one."""
    text = MAP.replace("other necks", "hinges.base.neck_mm")
    loaded = study(tmp_path, SCATTERED.replace("to = 0.8\n", 'to = 0.8\nscale = "log"\n') + text)
    source = source_of(loaded)
    points = of_map(source, loaded.study.figure[0], cells(source), 400)
    x, y = source.table.columns["hinges.base.radius_mm"], np.log(source.table.columns["hinges.base.neck_mm"])
    low, high = (np.array([edge(x), edge(y)]) for edge in (np.min, np.max))
    middles = low + (high - low) * (np.stack(np.meshgrid(range(5), range(5)), -1).reshape(-1, 2) + 0.5) / 5
    expected = {
        int(np.argmin(((x - a) / (high[0] - low[0])) ** 2 + ((y - b) / (high[1] - low[1])) ** 2)) for a, b in middles
    }
    assert set(points.rows.tolist()) == expected and len(expected) == 25
    assert points.said == "All 25 cells, each by the design nearest to its middle, can be pointed at."
    few = of_map(source, loaded.study.figure[0], cells(source), 7)
    assert len(few.rows) == 7 and set(few.rows.tolist()) < expected
    assert few.said.startswith("7 of 25 cells") and few.said.endswith("taken at random.")


HOSTILE = '</script><img src=x onerror=alert(1)> {{7*7}} $x^2$ "'


def test_hostile_names_stay_text(tmp_path):
    label = HOSTILE.replace('"', '\\"')
    text = GRID.replace('label = "other necks"', f'label = "{label}"').replace("A study", label)
    text += f'[[output]]\nname = "twice"\nexpression = "2 * kxx_n_per_mm"\nlabel = "{label}"\nunit = "<b>"\n'
    text += f'[[constraint]]\nvalue = "twice"\nleast = 0.0\nlabel = "{label}"\n'
    text += FRONT.replace("kxx_n_per_mm", "twice") + f'title = "{label}"\n'
    html = page_of(source_of(study(tmp_path, text), twice=np.linspace(2.0, 3.0, 12)))
    assert "<img" not in html and "<b>" not in html
    assert len(re.findall(r"<script\b", html)) == len(re.findall(r"</script>", html)) == 3
    assert [one["name"] for one in data_of(html)["columns"]].count(HOSTILE) == 2
    assert HOSTILE in targets_of(html)[0][3]
    assert f"<h1><bdi>{Markup.escape(HOSTILE)}" in html


def test_what_was_asked_is_said_with_the_reasons_of_what_could_not_be_made(tmp_path):
    html = page_of(source_of(study(tmp_path, GRID + MAP)))
    for text in ("grid, 12 designs", "Analytic model: calibrated, mobility 21", "2 to 3.5, 4 points", "bodies overlap"):
        assert text in html.replace("\xa0", " "), text
    assert "The study has no constraints." in html


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"from": 0.2, "to": 1.0, "scale": "log"}, "0.2 to 1, logarithmic"),
        ({"values": list(range(1, 12))}, "1, 2, 3, 4, 5, 6, 7, 8 and 3 more"),
        (
            {"distribution": "normal", "mean": 9.0, "sd": 0.5, "lower": 8.0},
            "normal, 9 ± 0.5 (one standard deviation), from 8",
        ),
        ({"distribution": "uniform", "lower": 8.0, "upper": 9.5}, "uniform, 8 to 9.5"),
        ({}, "of the table of designs"),
    ],
)
def test_the_values_of_a_factor_are_said_as_they_are_drawn(given, said):
    (column,) = columns_of([Factor.model_validate({"key": "thickness_mm", **given})])
    assert range_of(column).replace("\xa0", " ") == said


def test_a_figure_that_cannot_be_drawn_says_why_and_the_others_are_there(tmp_path):
    bad = '[[output]]\nname = "root"\nexpression = "sqrt(kxx_n_per_mm - 1e9)"\n' + FRONT.replace("kxx_n_per_mm", "root")
    source = source_of(study(tmp_path, GRID + bad + MAP), root=np.full(12, np.nan))
    html = page_of(source)
    assert "It is not drawn." in html and "no finite number for 12 of 12" in html
    assert len(targets_of(html)) == 12 and data_of(html)["designs"]


def test_a_design_whose_bodies_cannot_be_drawn_has_numbers_and_no_outline(tmp_path):
    text = GRID.replace('key = "hinges.base.radius_mm"', 'key = "chain.joint_angles_deg[1]"')
    text = text.replace("from = 2.0\nto = 3.5", "from = 60.0\nto = 178.0")
    source = source_of(study(tmp_path, text + FRONT))
    from flexfem.page.study import drawn_designs

    drawn = drawn_designs(source, np.flatnonzero(source.table.ok).tolist())
    missing = [one for one in drawn if one.outline is None]
    assert missing and len(missing) < len(drawn)
    assert missing[0].facts["m"] == "" and len(missing[0].values) == 2 + len(source.loaded.outputs)


def test_the_outline_has_its_hub_and_three_clamped_edges():
    paths = outline_paths(load_stage(STAGE))
    stage = load_stage(STAGE)
    assert paths.hub == round(100 * stage.platform.hub_radius)
    edges = [points_of(each) for each in re.findall(r"M[^M]+", paths.grounds)]
    assert len(edges) == 3
    assert [np.hypot(*(b - a)) for a, b in edges] == pytest.approx([stage.chain.link_width] * 3, abs=0.02)
    assert paths.reach == pytest.approx(100 * np.abs(points_of(paths.metal)).max(), abs=1.5)


def test_a_long_name_of_an_axis_is_broken_so_that_it_stays_on_the_chart(tmp_path):
    long = "a name that goes on and on " * 6
    text = GRID.replace("other necks", long) + MAP.replace("other necks", long)
    source = source_of(study(tmp_path, text))
    drawn = chart_figure(map_of(source, source.loaded.study.figure[0], cells(source)))
    drawn.draw_without_rendering()
    box, figure = drawn.axes[0].yaxis.label.get_window_extent(), drawn.bbox
    assert "\n" in drawn.axes[0].get_ylabel()
    assert box.y0 >= 0 and box.y1 <= figure.y1 and box.x0 >= 0
