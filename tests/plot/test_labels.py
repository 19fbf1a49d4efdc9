"""Labels of drawings are clear of one another, of marks and of outlines, and always the same."""

import itertools

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure

import flexfem
from flexfem.plot.drawing import text_box
from flexfem.plot.labels import DrawnParts, PartLabel, write_labels
from flexfem.plot.plate import drawing_figure

COVERED = 0.01  # of a text's box: corners of boxes are blank


def canvas(width=6.0, height=4.0):
    """Axes that fill a figure, with 10 mm for an inch."""
    figure = Figure(figsize=(width, height))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 10 * width), ylim=(0, 10 * height))
    return ax


def boxes(ax, names):
    return {text.get_text(): text_box(text) for text in ax.texts if text.get_text() in names}


def covers(first, second):
    return first.intersection(second).area > COVERED * min(first.area, second.area)


def test_names_of_close_hinges_are_apart_and_clear_of_their_leaves():
    """Twelve leaves 2.5 mm apart, whose names are longer than that."""
    ax = canvas()
    leaves = [shapely.box(10 + 2.5 * k, 5, 10.4 + 2.5 * k, 35) for k in range(12)]
    names = [f"leaf {k}" for k in range(12)]
    labels = [
        PartLabel(name, np.array([10.2 + 2.5 * k, 20.0]), {"size": 8.0})
        for k, name in enumerate(names)
    ]
    faults = write_labels(ax, labels, DrawnParts([leaf.boundary for leaf in leaves], leaves))
    found = boxes(ax, names)
    window = shapely.box(0, 0, 60, 40)
    assert faults == 0 and len(found) == 12
    assert not any(covers(*pair) for pair in itertools.combinations(found.values(), 2))
    assert not any(covers(box, leaf) for box in found.values() for leaf in leaves)
    assert all(window.covers(box) for box in found.values())


def test_a_name_without_room_is_counted_and_stays_within_the_drawing():
    ax = canvas(1.0, 1.0)
    labels = [
        PartLabel(f"a long name {k}", np.array([5.0, 5.0 + k]), {"size": 9.0}) for k in (0, 1)
    ]
    wall = shapely.box(0, 0, 10, 10)
    assert write_labels(ax, labels, DrawnParts([], [wall])) == 2


def test_the_name_of_a_body_is_within_it_and_upright_where_it_is_wide():
    ax = canvas()
    wide = shapely.box(5, 5, 30, 12)
    tall = shapely.box(40, 5, 43, 35)
    labels = [
        PartLabel("carriage", np.array([17.0, 8.0]), {"size": 8.0}, wide),
        PartLabel("column", np.array([41.5, 20.0]), {"size": 8.0}, tall),
    ]
    write_labels(ax, labels, DrawnParts([wide.boundary, tall.boundary], [], wide.union(tall)))
    found = boxes(ax, {"carriage", "column"})
    assert wide.contains(found["carriage"]) and tall.contains(found["column"])
    assert [text.get_rotation() for text in ax.texts] == [0.0, 90.0]
    assert ax.lines == [] or len(ax.lines) == 0


@pytest.mark.parametrize("small", [False, True])
@pytest.mark.parametrize("name", ["lever-amplifier", "xy-stage", "four-chains", "mobility6"])
def test_no_label_of_a_shipped_mechanism_covers_another(name, small):
    mechanism = flexfem.load(f"geometry/{name}.toml")
    figure = drawing_figure(mechanism, small=small)
    (ax,) = figure.axes
    figure.draw_without_rendering()
    window = shapely.box(*np.transpose([ax.get_xlim(), ax.get_ylim()]).ravel())
    texts = [text for text in ax.texts if text.get_text()]
    found = [text_box(text) for text in texts]
    again = drawing_figure(mechanism, small=small).axes[0]
    assert not any(covers(*pair) for pair in itertools.combinations(found, 2))
    assert all(window.covers(box) for box in found)
    assert [text.get_position() for text in again.texts] == [text.get_position() for text in texts]
