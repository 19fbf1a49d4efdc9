"""What moves in a mode is said by the parts with the largest motion."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.questions.mode_shapes import unlike_models, what_moves

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [0.5, 0.5]], dtype=float)
FRAME, STAGE, TRUSS, LEAF = range(4)
LAYOUT = SimpleNamespace(
    bodies=[
        SimpleNamespace(name="frame", fixed=True),
        SimpleNamespace(name="stage", fixed=False),
        SimpleNamespace(name="truss", fixed=False),
    ],
    joints=[SimpleNamespace(name="leaf")],
)
MESH = SimpleNamespace(triangles=np.arange(24).reshape(4, 6), bodies=np.arange(4))
TURNING = np.stack([0.5 - SQUARE[:, 1], SQUARE[:, 0] - 0.5], axis=1)


@pytest.mark.parametrize(
    ("motions", "said"),
    [
        ({STAGE: (1, 0), TRUSS: (0.1, 0)}, "stage along x"),
        ({STAGE: (1, 0), TRUSS: (-0.9, 0)}, "stage and truss in opposite directions, along x"),
        ({STAGE: (0, 1), TRUSS: (0, 0.9)}, "stage and truss along y"),
        ({STAGE: (1, 1)}, "stage at 45 degrees to x"),
        ({STAGE: TURNING}, "stage turning"),
        ({LEAF: (0, 1), STAGE: (0.1, 0)}, "hinge leaf bending, with bodies almost at rest"),
    ],
)
def test_the_parts_that_move_most_are_named_with_their_motion(motions, said):
    field = np.zeros((4, 6, 2))
    for part, motion in motions.items():
        field[part] = motion
    assert what_moves(LAYOUT, MESH, field.reshape(24, 2)) == said


def test_modes_that_the_analytic_models_lack_are_said_by_number():
    leaf = "mode 2: hinge leaf bending, with bodies almost at rest"
    (said,) = unlike_models(["mode 1: stage along x", leaf, "mode 3: stage along y"])
    assert said.startswith("from mode 2 on, ") and unlike_models(["mode 1: stage turning"]) == []
