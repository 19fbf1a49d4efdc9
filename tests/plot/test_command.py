"""The figure of `flexfem command`: every bar is a stored number, arrows start at contacts, the platform moves."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.collections import PolyCollection
from matplotlib.quiver import Quiver

import flexfem as package
from flexfem.mechanism.drives import drive_of
from flexfem.plot.drive import command_figure, plot_drive, plot_forces, plot_open_loop, plot_strokes
from flexfem.plot.stage import outline_of
from flexfem.verify.open_loop import OpenLoop

POSE = [3e-3, -1e-3, 2e-4]
RIM = 17.0 * np.exp(1j * np.deg2rad(100.0))  # mm
ERRORS = {"one": [-12.5e-6, 8.25e-6, 0.0], "two": [-0.5e-6, 9e-7, 2.5e-9]}  # mm, mm, rad


@pytest.fixture(scope="module")
def stage():
    """Unlike chains; a pair on the frame, a weak single stack that link 2 carries, one on the platform."""
    first, second = package.load("geometry/mobility6.toml").actuator
    weak = second.model_copy(update={"pair": False, "stack": "AE0203D16", "preload": 213.0})
    rim = {"name": "rim", "between": ("frame", "platform"), "point": (RIM.real, RIM.imag), "preload": 30.0}
    rim |= {"direction": np.deg2rad(310.0), "stroke": 0.012, "stiffness": 20e3}
    made = package.load("geometry/mobility6.toml").replace(override={(2, "elbow"): {"neck": 0.62}})
    return made.replace(actuator=[first, weak, rim])


@pytest.fixture(scope="module")
def found(stage):
    loop = [OpenLoop(model=name, pose=POSE, error=error) for name, error in ERRORS.items()]
    return package.command(stage, POSE, resolution=None).model_copy(update={"open_loop": loop})


@pytest.fixture
def ax():
    figure, axes = pyplot.subplots()
    yield axes
    pyplot.close(figure)


def bars(ax):
    """By label ends (n, 2) and middles (n,) of the bars."""
    found = {}
    for group in ax.containers:
        ends = [(bar.get_x(), bar.get_x() + bar.get_width(), bar.get_y() + bar.get_height() / 2) for bar in group]
        found[group.get_label()] = np.array(ends)
    return found


def test_the_record_says_where_every_stack_pushes(stage, found):
    """The known place of the first pair; of all, that the moment of the push is that of its line of action."""
    one, two = found.places[:2]
    np.testing.assert_allclose([one.contact, two.contact], [(44.0, -36.5), (44.0, -27.5)], atol=1e-9)
    np.testing.assert_allclose([one.push, two.push], [(0.0, 1.0), (0.0, -1.0)], atol=1e-12)
    np.testing.assert_allclose(found.places[4].contact, (9.6099, 56.3551), atol=1e-4)  # of chain 2: by 120 degrees
    drive = drive_of(stage)
    for place, stack in zip(found.places, drive.stacks, strict=True):
        (x, y), (u, v) = place.contact, place.push
        np.testing.assert_allclose(stack.placed(stack.pushes[0]), [u, v, x * v - y * u], atol=1e-9)
    said = [(each.chain, *each.between, each.actuator, 1e3 * each.lowest, 1e3 * each.highest) for each in found.places]
    pair = ("frame", "link 1", 3, -8.7, 8.7)
    expected = [(2, *pair), (2, *pair), (2, "link 2", "link 1", 4, 0.0, 17.4), (2, "frame", "platform", 5, 0.0, 12.0)]
    for one, wanted in zip(said[4:8], expected, strict=True):
        assert one[:4] == wanted[:4] and one[4:] == pytest.approx(wanted[4:])
    forces = [(each.preload, each.blocking_force) for each in found.places[:4]]
    np.testing.assert_allclose(forces, [(50.0, 935.0), (50.0, 935.0), (213.0, 224.0), (30.0, 240.0)])


def test_every_bar_of_the_strokes_is_the_stored_number_on_the_strokes_that_it_has(found, ax):
    plot_strokes(ax, found)
    drawn = bars(ax)
    assert ax.get_xlabel() == "stroke beyond rest (µm)"
    np.testing.assert_allclose(drawn["strokes it has"][:3, :2], [(-8.7, 8.7), (0.0, 17.4), (0.0, 12.0)], atol=1e-9)
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names[:4] == ["base, chain 1 (1, 2)", "elbow, chain 1 (3)", "rim, chain 1 (4)", "base, chain 2 (5, 6)"]
    assert set(drawn) == {"strokes it has", *found.criteria} and len(found.criteria) == 3
    for name, one in found.criteria.items():
        np.testing.assert_allclose(drawn[name][:, :2], [(0.0, 1e3 * stroke) for stroke in one.command], atol=1e-12)
        assert np.all(np.abs(drawn[name][:, 2] - np.arange(9)) < 0.4)  # each beside its name


def test_every_bar_of_the_forces_is_the_stored_number_with_preload_and_blocking_force(found, ax):
    plot_forces(ax, found)
    drawn, lines = bars(ax), {line.get_label(): line.get_xydata() for line in ax.get_lines()}
    assert ax.get_xlabel().startswith("force (N)")
    for name, one in found.criteria.items():
        np.testing.assert_allclose(drawn[name][:, 1], one.force)
        assert np.all(np.abs(drawn[name][:, 2] - np.arange(12)) < 0.4)
    np.testing.assert_allclose(lines["preload"][:4], [(50.0, 0), (50.0, 1), (213.0, 2), (30.0, 3)])
    reached = lines["blocking force"]
    assert {tuple(point) for point in reached.round(6)} >= {(224.0, 2.0), (224.0, 6.0), (224.0, 10.0)}
    assert not np.any(reached[:, 0] == 935.0)
    beside = {text.get_position()[1]: text.get_text() for text in ax.texts}
    assert [beside[row] for row in range(4)] == ["935 N", "935 N", "224 N", "240 N"]
    assert [label.get_text() for label in ax.get_yticklabels()][:3] == [
        "1: base, chain 1",
        "2: base, chain 1, partner",
        "3: elbow, chain 1",
    ]


@pytest.mark.parametrize(
    ("direction", "label", "values", "said"),
    [
        ("x", "error (nm)", [-12.5, -0.5], ["\N{MINUS SIGN}12.5", "\N{MINUS SIGN}0.500"]),
        ("y", "error (nm)", [8.25, 0.9], ["8.25", "0.900"]),
        ("theta", "error (nrad)", [0.0, 2.5], ["0", "2.50"]),
    ],
)
def test_every_bar_of_the_errors_is_the_stored_number(found, ax, direction, label, values, said):
    plot_open_loop(ax, found, direction)
    ((drawn),) = bars(ax).values()
    assert ax.get_xlabel() == label
    np.testing.assert_allclose(drawn[:, 0] + drawn[:, 1], values, atol=1e-12)  # one end of every bar is zero
    assert [text.get_text() for text in ax.texts] == said
    assert [text.get_text() for text in ax.get_yticklabels()] == ["one", "two"]


def test_an_arrow_starts_at_every_contact_along_its_push_in_proportion_to_its_force(stage, found, ax):
    plot_drive(ax, found, stage)
    (arrows,) = (part for part in ax.collections if isinstance(part, Quiver))
    force = np.array(found.criteria["least energy"].force)
    np.testing.assert_allclose(arrows.get_offsets(), [place.contact for place in found.places], atol=1e-9)
    along = np.column_stack([arrows.U, arrows.V])
    np.testing.assert_allclose(
        along / np.linalg.norm(along, axis=1).max(),
        force[:, None] / np.abs(force).max() * [place.push for place in found.places],
        atol=1e-9,
    )
    assert arrows.get_label().endswith(f"{np.abs(force).max():.4g} N")
    pulling = found.criteria["least energy"].model_copy(update={"force": [-2.0, *force[1:]]})
    plot_drive(ax, found.model_copy(update={"criteria": {"least energy": pulling}}), stage)
    *_, back = (part for part in ax.collections if isinstance(part, Quiver))
    assert back.V[0] < 0 < arrows.V[0]  # a stack that would have to pull


def test_stacks_that_become_longer_and_shorter_are_told_apart_behind_their_contacts(stage, found, ax):
    plot_drive(ax, found, stage)
    stroke = np.array(found.criteria["least energy"].stroke)
    for label, which in (("stack becomes longer", stroke > 0), ("stack becomes shorter", stroke < 0)):
        (drawn,) = (part for part in ax.collections if isinstance(part, PolyCollection) and part.get_label() == label)
        assert len(drawn.get_paths()) == np.count_nonzero(which) > 0
        for path, k in zip(drawn.get_paths(), np.flatnonzero(which), strict=True):
            behind = (path.vertices[:4] - found.places[k].contact) @ found.places[k].push
            assert np.all(behind < 0)
    said = " ".join(text.get_text() for text in ax.texts).replace("\N{MINUS SIGN}", "-")
    force = found.criteria["least energy"].force
    for k in range(12):
        assert f"{k + 1}: {1e3 * stroke[k]:+.3g} µm\n{force[k]:.4g} N" in said


@pytest.fixture(scope="module")
def figure(stage, found):
    return command_figure(found.model_copy(update={"pose": [0.02, -0.01, 1e-3]}), stage)


def header(figure):
    return " ".join(text.get_text() for text in figure.texts).replace("\n", " ").replace("\N{MINUS SIGN}", "-")


def of_platform(ax):
    return [each for each in ax.collections if each.get_label() == "platform at the pose"]


def test_the_platform_is_drawn_at_the_pose_times_the_stated_factor(stage, found, figure, ax):
    """(20, -10) um and 1 mrad, times 100: by (2, -1) mm and 0.1 rad from the outline at rest, the hub too."""
    assert "Pose 20 µm, -10 µm, 1 mrad" in header(figure) and "displacements × 100." in header(figure)
    (drawn,) = of_platform(figure.subfigs[0].axes[0])
    points = np.concatenate([path.vertices for path in drawn.get_paths()]) @ [1, 1j] - (2.0 - 1.0j)
    at_rest = points * np.exp(-0.1j)
    rims = [rim @ [1, 1j] for rim in outline_of(stage).rims]
    outline = np.concatenate([np.linspace(rim[:-1], rim[1:], 33).ravel() for rim in rims])
    off = np.min(np.abs(at_rest[:, None] - outline), axis=1)
    on_hub = np.abs(np.abs(at_rest) - 8.0) < 1e-6
    assert np.all(on_hub | (off < 1e-6)) and np.count_nonzero(on_hub) > 40 < np.count_nonzero(off < 1e-6)
    plot_drive(ax, found.model_copy(update={"pose": [0.0, 0.0, 0.0]}), stage)
    assert of_platform(ax) == []


def test_what_does_not_belong_together_is_refused(stage, found, ax):
    with pytest.raises(package.BadInput, match="expected that of the record, with the same drive"):
        plot_drive(ax, found, package.load("geometry/mobility6.toml"))
    with pytest.raises(package.BadInput, match="expected that of the record"):
        plot_drive(ax, found, None)
    with pytest.raises(package.BadInput, match="expected one that has strokes: least energy, least stroke, within"):
        plot_drive(ax, found, stage, "least force")
    with pytest.raises(package.BadInput, match="expected one of x, y, theta"):
        plot_open_loop(ax, found, "z")
    with pytest.raises(package.BadInput, match="expected one with finite elements"):
        plot_open_loop(ax, found.model_copy(update={"open_loop": []}), "x")
