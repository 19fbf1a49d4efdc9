"""The drawing of a mechanism that a hand moves, as a part of a page."""

from __future__ import annotations

import json

from markupsafe import Markup

from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.section import parts
from flexfem.questions.handling import handled, plain
from flexfem.questions.stiffness import Stiffness

CAPTION = (
    "Motion, forces and stress by the analytic model with rigid bodies, linear; the other "
    "directions are free."
)
ENDS = (
    " The motion ends where the range of the key results ends, at finite displacement; the linear "
    "stress there can differ from the yield strength."
)


def handled_drawing(mechanism: Mechanism, at_rest: Stiffness | None = None) -> Markup:
    """Return the drawing that a hand moves, empty for a mechanism without one.

    It is seen where scripts run, and not on paper.

    at_rest : the answer of `stiffness`, whose ranges at finite displacement end the motion.
    """
    numbers = handled(mechanism, at_rest)
    if numbers is None:
        return Markup()
    caption = CAPTION + (ENDS if numbers.range else "")
    return Markup(parts.handled(_embedded(plain(numbers)), caption))


def _embedded(content: object) -> Markup:
    """Return JSON as the text of an element `script`, which no name in it can end."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", r"\u003c").replace(">", r"\u003e").replace("&", r"\u0026"))
