"""The force that a stiffness predicts for a command, applied to a compliance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.questions.bands import percentages
from flexfem.units import DIRECTIONS, Direction


class Comparison(NamedTuple):
    """Analytic forces and the finite elements' answer.

    force : (points, 3), N, N, N mm, by (18), or of the exact equilibrium.
    error : (points, 3), mm, mm, rad, finite-element pose minus commanded.
    percent : (3,), at the largest command.
    """

    force: Array
    error: Array
    percent: Array


def compare(stiffness: Array, compliance: Array, direction: Direction, commanded: Array, lever: float) -> Comparison:
    """Apply the force that an analytic stiffness predicts to a finite-element compliance.

    Parameters
    ----------
    stiffness, compliance : (3, 3), order x, y, theta.
    commanded : (points,), mm or rad.
    lever : l3, mm, by which rotations become comparable with translations.
    """
    axis = DIRECTIONS.index(direction)
    command = np.zeros((len(commanded), 3))
    command[:, axis] = commanded
    force = command @ stiffness.T  # (18)
    error = force @ compliance.T - command
    largest = int(np.argmax(commanded))
    return Comparison(force, error, percentages(error[largest], commanded[largest], direction, lever))
