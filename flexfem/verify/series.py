"""Which spring in series with a stage alone makes it look as soft as an experiment says."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.units import DIRECTIONS, Direction
from flexfem.verify.pushes import Pushes, pole_share
from flexfem.verify.result import Record

SOFTER = (2.6, 2.6, 31.0)  # per cent, in x, y, theta: what Section VI says of its experiment against its own model


class SpringAlone(Record):
    """The spring of a fixture that alone makes a stage of this stiffness look so many per cent softer.

    stiffness : of the spring, None where none in series does.   ratio : to the stage's.
    pole : the stiffness of the fixture's own pole in that reading, None where that does not read it.
    """

    softer_percent: float
    stage: float
    stiffness: float | None
    ratio: float | None
    pole: float | None


def spring_in_series(stage: float, seen: float) -> float | None:
    """Stiffness that in series with the stage's makes it look as it is seen; None where it is seen no softer.

    Notes
    -----
    `1/K_seen = 1/K + 1/K_f`, `K_f = K_seen K / (K - K_seen)`.
    """
    return seen * stage / (stage - seen) if seen < stage else None


def springs_alone(of: Pushes, model: Array, metal: Array, measured: Array | None) -> dict[Direction, SpringAlone]:
    """Which spring alone explains measured slopes (3,) on the metal, or what the paper's text says against its model.

    model : (3,), as pushed, 1/C_ii.   metal : (3,), as read on a rigid fixture.   Directions without a measured slope
    are left out.
    """
    found: dict[Direction, SpringAlone] = {}
    stages = model if measured is None else metal
    looks = model * (1 - np.array(SOFTER) / 100) if measured is None else measured
    for k, axis in enumerate(DIRECTIONS):
        if np.isnan(looks[k]):
            continue
        stage, look, share = float(stages[k]), float(looks[k]), float(pole_share(of)[k])
        spring = spring_in_series(stage, look)
        found[axis] = SpringAlone(
            softer_percent=100 * (1 - look / stage),
            stage=stage,
            stiffness=spring,
            ratio=None if spring is None else spring / stage,
            pole=1 / share if share > 0 else None,
        )
    return found
