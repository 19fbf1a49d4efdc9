"""The drawing of a mechanism that a hand moves, as a part of a page."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.section import parts
from flexfem.questions.handling import handled, plain
from flexfem.questions.large import Large
from flexfem.questions.stiffness import Stiffness

CAPTION = (
    "Motion, forces and stress by the analytic model with rigid bodies, linear; the other "
    "directions are free."
)
ENDS = (
    " The motion ends where the range of the key results ends, at finite displacement; the linear "
    "stress there can differ from the yield strength."
)


class HandledCurve(NamedTuple):
    """Points of a nonlinear curve: pose, mm, mm, rad, and the force that drives it, N, N, N mm."""

    theory: str
    pose: list[list[float]]
    force: list[list[float]]


def handled_drawing(
    mechanism: Mechanism, at_rest: Stiffness | None = None, bent: Large | None = None
) -> Markup:
    """Return the drawing that a hand moves, empty for a mechanism without one.

    It is seen where scripts run, and not on paper.

    at_rest : the answer of `stiffness`, whose ranges at finite displacement end the motion.
    bent : the answer of `large`, along whose curve the output can be moved.
    """
    numbers = handled(mechanism, at_rest)
    if numbers is None:
        return Markup()
    caption = CAPTION + (ENDS if numbers.range else "")
    content = plain(numbers)
    content["curve"] = None if bent is None else plain(_curve(bent))
    return Markup(parts.handled(_embedded(content), caption))


def _curve(bent: Large) -> HandledCurve | None:
    """Return the curve by the last theory, None for an answer without one."""
    theory = bent.axes["theory"][-1]
    pose = bent.at("curve_pose", theory=theory)
    force = bent.at("curve_force", theory=theory)
    known = np.isfinite(pose).all(axis=1) & np.isfinite(force).all(axis=1)
    if np.count_nonzero(known) < 2:
        return None
    return HandledCurve(theory, pose[known].tolist(), force[known].tolist())


def _embedded(content: object) -> Markup:
    """Return JSON as the text of an element `script`, which no name in it can end."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", r"\u003c").replace(">", r"\u003e").replace("&", r"\u0026"))
