"""Modes of models stand side by side by shape, and what moves in them is said in words."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.fem.mesh import PlaneMesh
from flexfem.questions.mode_order import NONE, partners
from flexfem.questions.mode_shapes import motions_of_parts, what_moves

from ..conftest import ROOT

TRIANGLES = ([0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7])  # of a square of corners 0 to 3
SQUARE = np.array(
    [[0, 0], [2, 0], [2, 2], [0, 2], [1, 0], [2, 1], [1, 2], [0, 1], [1, 1]], dtype=float
)
PARTS = ("stage (output)", "truss", "leaf")
APART = 10.0  # mm, between the squares of the parts
X, Y = (SQUARE - 1).T  # about the centre
ZERO = 0 * X
ALONG_X = np.stack([1 + ZERO, ZERO], axis=1)
ALONG_Y = np.stack([ZERO, 1 + ZERO], axis=1)
TURNING = np.stack([-Y, X], axis=1)
SWINGING = np.stack([-Y, X + 2], axis=1)  # about a point beside it
BENDING = np.stack([ZERO, X**2 - 0.25], axis=1)
LIFTED = np.stack([ZERO, ZERO, 1 + ZERO], axis=1)
TILTING = np.stack([ZERO, ZERO, Y], axis=1)


def mesh_of_squares():
    count = len(SQUARE)
    nodes = [SQUARE + np.array([APART * part, 0]) for part in range(len(PARTS))]
    triangles = [np.array(TRIANGLES) + count * part for part in range(len(PARTS))]
    bodies = np.repeat(range(len(PARTS)), len(TRIANGLES))
    return PlaneMesh(np.concatenate(nodes), np.concatenate(triangles), bodies, {})


@pytest.mark.parametrize(
    ("stage", "truss", "leaf", "said"),
    [
        (ALONG_X, 0.1 * ALONG_X, ALONG_X, "stage (output) along x"),
        (
            0.9 * ALONG_X,
            -ALONG_X,
            0 * ALONG_X,
            "truss and stage (output) in opposite directions along x",
        ),
        (ALONG_Y, 0.9 * ALONG_Y, ALONG_Y, "stage (output) and truss along y"),
        (ALONG_X + ALONG_Y, 0 * ALONG_X, ALONG_X, "stage (output) along a line at 45 degrees to x"),
        (0.4 * ALONG_X, ALONG_Y, ALONG_Y, "truss along y, stage (output) along x"),
        (TURNING, 0 * ALONG_X, ALONG_X, "stage (output) turning"),
        (SWINGING, 0 * ALONG_X, ALONG_X, "stage (output) turning"),
        (0.01 * ALONG_X, BENDING, 0 * ALONG_X, "truss bending"),
        (0.01 * ALONG_X, 0 * ALONG_X, ALONG_Y, "hinge leaf bending, bodies almost at rest"),
        (
            0.2 * ALONG_X,
            0 * ALONG_X,
            ALONG_Y,
            "hinge leaf bending, and less stage (output) along x",
        ),
        (
            LIFTED,
            -0.8 * LIFTED,
            LIFTED,
            "stage (output) and truss in opposite directions out of the plane",
        ),
        (TILTING, 0 * LIFTED, 0.5 * LIFTED, "stage (output) tilting about x"),
    ],
)
def test_the_parts_that_move_most_are_named_with_their_motion(stage, truss, leaf, said):
    field = np.concatenate([stage, truss, leaf])
    motions = motions_of_parts(mesh_of_squares(), [(0,), (1,), (2,)], PARTS, field)
    assert what_moves(motions[:2], motions[2:]) == said


def test_a_motion_of_a_part_is_divided_without_remainder():
    """u = (1 - 3 y, 2 + 3 x) of a square of side 2: mean 1, 2; rotation 3 times sqrt(2 / 3)."""
    field = np.concatenate([ALONG_X + 2 * ALONG_Y + 3 * TURNING, ALONG_X, ALONG_X])
    motion = motions_of_parts(mesh_of_squares(), [(0,)], PARTS[:1], field)[0]
    np.testing.assert_allclose(motion.mean, [1.0, 2.0, 0.0], atol=1e-12)
    assert motion.turning == pytest.approx(3 * np.sqrt(2 / 3))
    assert motion.bending == pytest.approx(0.0, abs=1e-6)


def test_modes_are_partners_by_shape_and_not_by_number():
    alike = np.array([[0.99, 0.0, 0.0, 0.0], [0.0, 0.02, 0.04, 0.97], [0.0, 0.4, 0.0, 0.0]])
    found = partners(alike, np.array([50.0, 5000.0, 6000.0]), np.array([50, 1000, 1100, 4800.0]))
    assert found.tolist() == [0, NONE, NONE, 1]


def test_a_pair_of_equal_frequency_that_is_turned_is_matched():
    """By 45 degrees: no mode of one model is that of the other by itself."""
    half = np.full((2, 2), 0.5)
    pair = [100.0, 100.0]
    assert sorted(partners(half, np.array(pair), np.array([103.0, 103.0]))) == [0, 1]
    assert sorted(partners(half, np.array(pair), np.array([103.0, 120.0]))) == [0, 1]
    apart = partners(half, np.array([100.0, 120.0]), np.array([103.0, 125.0]))
    assert apart.tolist() == [NONE, NONE]
    overlapping = np.array([[0.9, 0.0], [0.0, 0.0]])  # in one direction alone
    assert partners(overlapping, np.array(pair), np.array(pair)).tolist() == [0, NONE]


COUPLED = """
name = "two coupled masses"
thickness_mm = 8
[material]
name = "al-7075-t6"
[[body]]
name = "frame"
fixed = true
outline_mm = [[-40, -20], [80, -20], [80, 0], [-40, 0]]
[[body]]
name = "first"
outline_mm = [[-30, 30], [0, 30], [0, 40], [-30, 40]]
[[body]]
name = "second"
outline_mm = [[30, 30], [60, 30], [60, 40], [30, 40]]
[output]
body = "second"
at_mm = [45, 35]
"""
LEAF = """
[[hinge]]
name = "{name}"
between = ["{near}", "{far}"]
at_mm = [{x}, {y}]
direction_deg = {heading}
shape = "leaf"
length_mm = 30
neck_mm = {neck}
"""


def coupled(folder):
    """Two equal masses on leaves along y, which a thinner leaf along x couples."""
    leaves = [
        LEAF.format(name=f"leaf {x}", near="frame", far=far, x=x, y=15, heading=90, neck=0.5)
        for x, far in ((-25, "first"), (-5, "first"), (35, "second"), (55, "second"))
    ]
    link = LEAF.format(name="link", near="first", far="second", x=15, y=35, heading=0, neck=0.3)
    file = folder / "coupled.toml"
    file.write_text(COUPLED + "".join([*leaves, link]))
    return file


def test_coupled_masses_move_together_and_then_in_opposite_directions(tmp_path):
    found = flexfem.modes(coupled(tmp_path), count=2, models="analytic")
    assert found.notes[:2] == [
        "mode 1: first and second (output) along x",
        "mode 2: first and second (output) in opposite directions along x",
    ]


def test_finite_elements_of_a_parallelogram_have_four_modes_of_leaves_between_two_analytic_ones():
    found = flexfem.modes(ROOT / "geometry/parallelogram.toml", count=6, resolution=4)
    analytic, elastic, elements = found.frequency.T
    assert np.isfinite(analytic).tolist() == np.isfinite(elastic).tolist()
    assert np.isfinite(analytic).tolist() == [True, False, False, False, False, True]
    assert elements[5] == pytest.approx(elastic[5], rel=0.01)
    assert elements[1] < 0.3 * elements[5]
    said = " ".join(found.notes)
    assert "mode 2: hinges leaf and leaf 2 in opposite directions bending" in said
    assert "mode 6: stage (output) along y" in said
