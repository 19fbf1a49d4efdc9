"""Pictures of stage, necks, hinge and models."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Polygon

from flexfem.mechanism.stage import load_feasible
from flexfem.plot import style
from flexfem.plot.displacement import deformed_figure, largest_stress, name_of_place, plot_displacement
from flexfem.plot.hinge_sketch import hinge_rows, hinge_sketch
from flexfem.plot.marks import clamped_edges, curves, edges_of, hatch_ground, loops_of
from flexfem.plot.model_sketch import links_of_chain, mobility_line, model_sketch
from flexfem.plot.stage import neck_figure, plot_stage, stage_figure
from flexfem.plot.style import rendered

PICTURES = {
    "stage": lambda made, model: stage_figure(model, made.fields()),
    "neck": lambda made, model: neck_figure(model, made.fields()),
    "hinge": lambda made, model: hinge_sketch(model),
    "model": lambda made, model: model_sketch(model),
    "deformed": lambda made, model: deformed_figure(
        made.result({"a": (0.1, 0.0, 0.0)}, models={"a": model}, assumed=model.assumed), {"a": made.fields()}
    ),
}


BLUE, RED = "#0072B2", "#B00000"
CHAINS = ("#0072B2", "#B34700", "#007A58")


def unequal(made, mobility=6):
    """Nine hinges of nine radii, necks and axes."""
    return [
        hinge.model_copy(update={"radius": 1.3 + 0.11 * k, "neck": 0.3 + 0.05 * k, "axis": hinge.axis + 0.05 * k})
        for k, hinge in enumerate(made.hinges(mobility))
    ]


@pytest.fixture(scope="module")
def pictures(made):
    """Each picture of a stage whose nine hinges differ."""
    model, fields = made.model(hinges=unequal(made)), made.fields()
    figures = {name: draw(model, fields) for name, draw in {"stage": stage_figure, "neck": neck_figure}.items()}
    return figures | {name: draw(model) for name, draw in {"hinge": hinge_sketch, "model": model_sketch}.items()}


def arrows(axes):
    """Tails and heads (n, 2, 2) of the arrows, and their colours."""
    found = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    return np.array([arrow._posA_posB for arrow in found]), [to_hex(arrow.get_edgecolor()).upper() for arrow in found]


def words(axes):
    """Texts in the axes and where they are."""
    return {text.get_text(): np.array(text.get_position()) for text in axes.texts if text.get_text()}


def away(spot, anchor, distance):
    """Whether a label is at one of the four distances from its anchor at which labels are put."""
    return min(abs(np.linalg.norm(spot - anchor) / distance - k) for k in (1.0, 1.35, 1.7, 2.0)) < 1e-9


def texts(figure):
    return [text.get_text() for where in (figure, *figure.axes) for text in where.texts]


@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.parametrize("assumed", [[], ["chain.link_lengths_mm"]])
def test_assumed_numbers_are_announced_exactly_when_there_are_some(made, name, assumed):
    figure = PICTURES[name](made, made.model(assumed=assumed))
    assert ("assumed dimensions" in texts(figure)) == bool(assumed)


def test_settings_of_the_user_change_nothing(made):
    usual = rendered(PICTURES["model"](made, made.model()), "png")
    with mpl.rc_context({"font.size": 25, "lines.linewidth": 9, "savefig.dpi": 40, "text.color": "green"}):
        assert rendered(PICTURES["model"](made, made.model()), "png") == usual
        assert mpl.rcParams["font.size"] == 25


def test_every_figure_is_drawn_in_the_style_of_the_house():
    folder = Path(style.__file__).parent
    modules = [import_module(f"flexfem.plot.{path.stem}") for path in folder.glob("*.py")]
    drawing = {
        name: found
        for module in modules
        for name, found in vars(module).items()
        if name.endswith(("_figure", "_sketch")) and name != "new_figure"
    }
    assert {"error_figure", "budget_figure", "map_figure", "hinge_sketch"} <= drawing.keys()
    assert all(found.__code__.co_name == "styled" for found in drawing.values())


def test_hinges_and_chains_have_their_numbers_beside_them(made, pictures):
    (axes,) = pictures["stage"].axes
    places, hinges = np.array([hinge.centre for hinge in made.hinges()]), words(axes)
    dots = [line for line in axes.get_lines() if line.get_marker() == "o"]
    np.testing.assert_allclose([line.get_xydata()[0] for line in dots], places)
    assert [line.get_color() for line in dots] == [colour for colour in CHAINS for _ in range(3)]
    leads = [line.get_xydata() for line in axes.get_lines() if line.get_marker() == "None"]
    for k, (place, lead) in enumerate(zip(places, leads, strict=True)):
        np.testing.assert_allclose(lead, [place, hinges[str(k + 1)]])
    size = np.ptp(made.fields().nodes, axis=0).max()
    for chain in (1, 2, 3):
        middle = (places[3 * chain - 2] + places[3 * chain - 1]) / 2
        assert away(hinges[f"chain {chain}"], middle, 0.09 * size)
    colours = {text.get_text(): text.get_color() for text in axes.texts}
    assert [colours[str(k + 1)] for k in range(9)] == [CHAINS[k // 3] for k in range(9)]


def test_the_stage_is_drawn_in_mm_with_hub_frame_and_ground(made, pictures):
    (axes,) = pictures["stage"].axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (mm)", "y (mm)")
    (hub,) = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert (hub.center, hub.radius) == ((0, 0), 7.0)
    ends, colours = arrows(axes)
    np.testing.assert_allclose(ends, [[[0, 0], [4.2, 0]], [[0, 0], [0, 4.2]]], rtol=0.5, atol=1e-12)
    assert ends[0, 1, 0] == ends[1, 1, 1] > 0 and colours == [RED, RED]
    size = "12 345 curved quadratic triangles, 54 321 unknowns, 5 triangles across every neck."
    assert size in " ".join(made.texts(pictures["stage"]))
    hatch_ground(axes, np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[0, 1, 0]]), 0.5)  # the body is above
    (strip,) = axes.collections[-2].get_paths()
    assert strip.get_extents().extents.tolist() == [0.0, -0.5, 2.0, 0.0]


def test_necks_are_seen_along_themselves_with_their_own_dimensions(made, pictures):
    columns = np.reshape(pictures["neck"].axes, (2, 3)).T
    corners = 4.0 * np.array([[1.0, 0.1], [-0.4, 0.9], [-0.6, -0.8]])
    for k, (hinge, (notch, neck)) in enumerate(zip(unequal(made)[:3], columns, strict=True)):
        R, t = (1.3, 1.41, 1.52)[k], (0.3, 0.35, 0.4)[k]
        assert notch.get_title() == f"{('base', 'elbow', 'platform')[k]} hinge"
        assert [axes.get_xlabel() for axes in (notch, neck)] == 2 * ["along the neck (mm)"]
        assert [axes.get_ylabel() for axes in (notch, neck)] == 2 * ["across the neck (mm)" if k == 0 else ""]
        assert [*words(notch)] == [f"R = {R:g} mm"] and [*words(neck)] == [f"t = {t:g} mm"]
        ((radius,), _), ((width,), _) = arrows(notch), arrows(neck)
        np.testing.assert_allclose(radius[0], [0.0, -R - t / 2])
        np.testing.assert_allclose(np.hypot(*(radius[1] - radius[0])), R)
        np.testing.assert_allclose(width, [[0.0, t / 2], [0.0, -t / 2]])
        along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
        local = np.column_stack([corners @ along, corners @ [-along[1], along[0]]])
        straight = [piece for found in notch.collections[2:] for piece in found.get_segments() if len(piece) == 2]
        assert straight
        for end in np.concatenate(straight):
            assert np.min(np.linalg.norm(local - end, axis=1)) < 1e-9
        assert notch.get_xlim()[1] > R and neck.get_xlim()[1] < 2 * t


def test_every_hinge_has_its_dimensions_in_the_table(pictures):
    table = pictures["hinge"].axes[1]
    written = [text.get_text() for text in table.texts]
    assert written[:5] == ["hinge", "R (mm)", "t (mm)", "h (mm)", "t/R"]
    rows = [(1.3 + 0.11 * k, 0.3 + 0.05 * k) for k in range(9)]
    expected = [[f"{k + 1}", f"{R:g}", f"{t:g}", f"{2 * R + t:g}", f"{t / R:.3f}"] for k, (R, t) in enumerate(rows)]
    assert [written[5 * k : 5 * k + 5] for k in range(1, 10)] == expected
    heights = [text.get_position()[1] for text in table.texts[::5]]
    assert heights == sorted(heights, reverse=True)


def test_dimensions_and_loads_of_the_hinge_are_what_their_letters_say(pictures):
    sketch = pictures["hinge"].axes[0]
    (ends, colours), labels, t = arrows(sketch), words(sketch), 0.42  # t/R of the drawing, R = 1

    def nearest(name):
        found = np.argmin(np.linalg.norm(ends.reshape(-1, 2) - labels[name], axis=1)) // 2
        middle = np.argmin(np.linalg.norm(ends.mean(axis=1) - labels[name], axis=1))
        return ends[middle] if name in ("$h = 2R + t$", "$b$", "$R$", "$t$") else ends[found], colours[found]

    (low, high), _ = nearest("$h = 2R + t$")
    assert high[1] - low[1] == pytest.approx(2 + t) and high[0] == low[0] < -1
    assert np.hypot(*np.diff(nearest("$R$")[0], axis=0)[0]) == pytest.approx(1.0)
    tail, head = nearest("$t$")[0]
    assert (head[1], tail[1] < head[1]) == (pytest.approx(-t / 2), True)
    assert any(np.allclose(end, [(0.0, t / 2 + 0.45), (0.0, t / 2)]) for end in ends)
    (tail, head), colour = nearest("$F_x$")
    assert head[0] > tail[0] > 1 and head[1] == tail[1] == 0.0 and colour == RED
    (tail, head), colour = nearest(r"$\Delta x$")
    assert head[0] > tail[0] and head[1] == tail[1] and colour == BLUE
    for name, way in (("$x$", (0.7, 0.0)), ("$y$", (0.0, 0.7))):
        assert np.allclose(np.diff(nearest(name)[0], axis=0)[0], way)
    assert {"$M_z$", r"$\alpha_z$", "$z$", "$b$"} <= labels.keys()


def test_lengths_and_angles_of_the_model_are_written_where_they_are(made, pictures):
    axes = pictures["model"].axes[0]
    points = np.array([(52.0, -30.0), (25.0, -31.0), (21.0, 3.0), (0.0, 0.0)])
    labels, minus = words(axes), "\N{MINUS SIGN}"
    size = np.ptp([hinge.centre for hinge in made.hinges()], axis=0).max()
    for k, length in enumerate(("27.019", "34.234", "21.213")):
        assert away(labels[f"$l_{k + 1}$ = {length} mm"], points[k : k + 2].mean(axis=0), 0.05 * size)
    headings = np.deg2rad([0.0, -177.879, 96.710, -171.870])
    arcs = [line.get_xydata() for line in axes.get_lines() if len(line.get_xdata()) == 60]
    for k, (arc, angle) in enumerate(zip(arcs, (f"{minus}177.9", f"{minus}85.41", "91.42"), strict=True)):
        name = rf"$\varphi_{k + 1}$ = {angle}°"
        inward = (arc[29] + arc[30]) / 2 - points[k]
        middle = points[k] + np.linalg.norm(arc[0] - points[k]) * inward / np.linalg.norm(inward)
        assert away(labels[name], middle, 0.05 * size)
        for place, heading in ((arc[0], headings[k]), (arc[-1], headings[k + 1])):
            way = (place - points[k]) / np.linalg.norm(place - points[k])
            np.testing.assert_allclose(way, [np.cos(heading), np.sin(heading)], atol=1e-4)
    assert {"chain 1", "chain 2", "chain 3", "X", "Y"} <= labels.keys()
    grounds = [hinge.centre for hinge in made.hinges()[::3]]
    for chain in (1, 2, 3):
        distances = [np.linalg.norm(labels[f"chain {chain}"] - other) for other in grounds]
        assert np.argmin(distances) == chain - 1
    (platform,) = [patch for patch in axes.patches if isinstance(patch, Polygon) and patch.get_zorder() == 1]
    np.testing.assert_allclose(platform.get_xy()[:3], [hinge.centre for hinge in made.hinges()[2::3]])
    assert "M = 3 (8 \N{MINUS SIGN} 1) + 12 \N{MINUS SIGN} 3 · 9 = 6" in " ".join(made.texts(pictures["model"]))


def test_sliders_run_along_the_neck_for_axial_and_across_it_for_shear(made):
    hinges = unequal(made, 21)
    axes, key = model_sketch(made.model(hinges=hinges, mobility=21)).axes
    circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
    np.testing.assert_allclose([circle.center for circle in circles], [hinge.centre for hinge in hinges])
    blocks = [patch.get_xy() for patch in axes.patches if to_hex(patch.get_edgecolor()).upper() == BLUE]
    for k, hinge in enumerate(hinges):
        along = np.array([np.cos(hinge.axis), np.sin(hinge.axis)])
        for block, way, far in zip(blocks[2 * k : 2 * k + 2], (along, [-along[1], along[0]]), (1, 2), strict=True):
            long = (block[0] - block[1]) / np.linalg.norm(block[0] - block[1])
            assert abs(long @ way) == pytest.approx(1.0)
            apart = (block[:4].mean(axis=0) - hinge.centre) @ along / circles[k].radius
            assert apart == pytest.approx((3.1 if hinge.hinge == "base" else -3.1) * far)
    feet = [patch.get_xy() for patch in axes.patches if isinstance(patch, Polygon) and patch.get_zorder() == 2.5]
    for foot, hinge in zip(feet, hinges[::3], strict=True):
        assert (foot[:3].mean(axis=0) - hinge.centre) @ [np.cos(hinge.axis), np.sin(hinge.axis)] < 0
    meaning = [text.get_text() for text in key.texts]
    assert meaning == [
        "revolute joint: rotation",
        "slider along the neck: axial elongation",
        "slider across the neck: shear",
    ]
    drawn = [patch.get_xy() for patch in key.patches if isinstance(patch, Polygon)]
    assert [np.ptp(block, axis=0).argmax() for block in drawn] == [0, 1]
    assert [block[:4, 1].mean() for block in drawn] == pytest.approx([text.get_position()[1] for text in key.texts[1:]])


@pytest.fixture(scope="module")
def deformed(made):
    """Two curves whose fields differ, at a full command in Y."""
    one, other = made.fields(), made.fields()
    other = other.model_copy(update={"displacement": -0.7 * other.displacement, "stress": 1.4 * other.stress[::-1]})
    models = {"a": made.model(), "b": made.model(hinges=unequal(made))}
    result = made.result({"a": (0.1, 0.0, 0.0), "b": (0.2, 0.1, 0.0)}, direction="y", models=models)
    return deformed_figure(result, {"a": one, "b": other}), (one, other)


def test_the_stage_is_deformed_as_much_as_is_said(made, deformed):
    figure, stored = deformed
    text = " ".join(made.texts(figure))
    assert "full command Y = 50.0 µm, displacements × 100; grey: undeformed" in text
    for axes, fields, name in zip(figure.axes, stored, "ab", strict=False):
        assert axes.get_title() == name
        rest, outline = (np.concatenate(found.get_segments()) for found in axes.collections[1:3])
        corners = [np.argmin(np.linalg.norm(rest - node, axis=1)) for node in fields.nodes]
        np.testing.assert_allclose(rest[corners], fields.nodes, atol=1e-9)
        np.testing.assert_allclose(outline[corners] - rest[corners], 100 * fields.displacement, atol=1e-9)
        assert to_hex(axes.collections[1].get_edgecolor()[0]) == "#8a8a8a"
    largest = max(np.linalg.norm(one.displacement, axis=1).max() / np.ptp(one.nodes, axis=0).max() for one in stored)
    assert 0.02 < 100 * largest <= 0.05


def test_stress_has_one_scale_of_four_decades_and_each_largest_its_value(made, deformed):
    figure, (one, other) = deformed
    *panels, bar = figure.axes
    for axes, fields, value in zip(panels, (one, other), ("31.7", "44.4"), strict=True):
        colours = axes.collections[0]
        assert (colours.norm.vmin, colours.norm.vmax) == pytest.approx((44.38e-4, 44.38))
        np.testing.assert_allclose(colours.get_array(), np.clip(fields.stress, 44.38e-4, None))
        assert any(text.get_text().startswith(f"largest {value} MPa at ") for text in axes.texts)
        (mark,) = [line.get_xydata()[0] for line in axes.get_lines()]
        node = int(np.argmax(fields.stress))
        np.testing.assert_allclose(mark, fields.nodes[node] + 100 * fields.displacement[node])
        (peak,) = [text for text in axes.texts if text.get_text() == "max"]
        np.testing.assert_allclose(peak.xy, mark)
    assert bar.get_xlabel() == "von Mises stress (MPa)"
    ticks = [label.get_text() for label in bar.get_xticklabels()]
    assert [float(tick) for tick in ticks] == pytest.approx(list(bar.get_xticks())) and len(ticks) == 4


def test_lengths_and_angles_of_the_sketch_close_the_chain(made):
    lengths, angles = links_of_chain(made.model())
    heading = np.cumsum(angles)
    end = made.hinges()[0].centre + lengths @ np.column_stack([np.cos(heading), np.sin(heading)])  # (19), (20)
    np.testing.assert_allclose(end, 0.0, atol=1e-12)
    assert np.all(np.abs(angles) <= np.pi)


def test_half_a_turn_counts_as_positive(made):
    hinges = made.hinges()
    hinges[1] = hinges[1].model_copy(update={"centre": (20.0, hinges[0].centre[1])})
    assert links_of_chain(made.model(hinges=hinges))[1][0] == pytest.approx(np.pi)


@pytest.mark.parametrize("mobility", [3, 6, 12, 21])
def test_mobility_of_the_sketch_is_that_of_its_joints(made, mobility):
    model = made.model(hinges=made.hinges(mobility), mobility=mobility)
    assert f"= {mobility}," in mobility_line(model)
    sliders = {3: 0, 6: 3, 12: 9, 21: 18}[mobility]
    blocks = [patch for patch in model_sketch(model).axes[0].patches if patch.get_edgecolor()[2] > 0.6]
    assert len(blocks) == sliders


def test_largest_stress_is_named_with_its_place(made):
    fields, model = made.fields(), made.model()
    assert name_of_place(model, fields, 0) == "pad of chain 1"
    assert any("31.7 MPa" in text for text in texts(PICTURES["deformed"](made, model)))
    nodes = fields.nodes.copy()
    nodes[0] = np.array(model.hinges[4].centre) + 0.1
    moved = fields.model_copy(update={"nodes": nodes})
    assert name_of_place(model, moved, 0) == "hinge 5 (elbow, chain 2)"


def test_round_off_does_not_decide_between_places_alike(made):
    fields, model = made.fields(), made.model()
    for high in (0, 18, 36):
        stress = np.ones(len(fields.nodes))
        stress[[0, 18, 36]] = 5.0
        stress[high] += 1e-12
        found = largest_stress(model, fields.model_copy(update={"stress": stress}))
        assert found == (0, "pad of chain 1 and 2 more alike")


def test_hinges_alike_share_a_row(made):
    assert [row[0] for row in hinge_rows(made.model())] == ["1, 4, 7", "2, 5, 8", "3, 6, 9"]
    assert hinge_rows(made.model())[1][1:4] == ("1.5", "0.4", "3.4")


def test_curved_sides_pass_through_their_middles(made):
    fields = made.fields()
    every = edges_of(fields.triangles).every
    np.testing.assert_allclose(curves(fields.nodes, every, 2)[:, 1], fields.nodes[every[:, 2]], atol=1e-12)


def test_boundary_of_two_triangles_is_one_loop():
    edges = edges_of(np.array([[0, 1, 2, 3, 4, 5], [1, 6, 2, 7, 8, 4]]))
    assert len(edges.every) == 5
    (loop,) = loops_of(edges.boundary)
    assert set(loop[:, 2].tolist()) == {3, 5, 7, 8}
    np.testing.assert_array_equal(loop[:, 1], np.roll(loop[:, 0], -1))


def test_clamped_edges_are_those_that_stand_still(made):
    fields = made.fields()
    held = clamped_edges(edges_of(fields.triangles).boundary, fields.displacement)
    assert sorted(held[:, 2].tolist()) == [5, 23, 41]


def test_a_stage_is_drawn_on_axes_of_the_users():
    """The chains of the reference stage are alike: its outline turned by 120 degrees is itself."""
    figure = Figure()
    ax = figure.subplots(1, 2)[1]
    stage = load_feasible(Path(__file__).parents[2] / "geometry" / "mobility6.toml")
    assert plot_stage(ax, stage) is ax and not figure.axes[0].patches and len(figure.axes) == 2
    points = np.concatenate([path.vertices for path in ax.collections[0].get_paths()])
    turned = points @ np.array([[-0.5, 0.75**0.5], [-(0.75**0.5), -0.5]])
    gap = np.linalg.norm(turned[:, None] - points, axis=2).min(axis=1)
    assert gap.max() < 1.2  # half of 7.5 degrees on the radius of the platform, 17 mm
    (hub,) = [patch for patch in ax.patches if isinstance(patch, Circle)]
    assert hub.radius == 8.0 and np.hypot(*hub.center) == 0.0
    low, high = ax.get_xlim()
    assert low < points[:, 0].min() and points[:, 0].max() < high and ax.get_aspect() == 1.0
    assert ax.get_xlabel() == "x (mm)" and ax.get_ylabel() == "y (mm)"


def test_displacements_are_drawn_on_axes_of_the_users_as_many_times_as_asked(made):
    fields = made.fields()
    ax = Figure().subplots()
    assert plot_displacement(ax, fields, factor=3.0) is ax
    grid = ax.collections[0]._triangulation
    drawn = np.column_stack([grid.x, grid.y])
    assert drawn == pytest.approx(fields.nodes + 3.0 * fields.displacement, abs=1e-12)
    assert ax.collections[0].get_array().max() == 31.7
    own = Figure().subplots()
    assert plot_displacement(own, fields).collections[0].norm.vmax == 31.7
