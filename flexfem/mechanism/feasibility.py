"""The check that a mechanism can be made, before any meshing."""

from __future__ import annotations

from typing import Any

from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput, printed


def check_feasible(mechanism: Any) -> None:
    """Raise BadInput, with key, value and expectation, for a mechanism that cannot be made.

    Anything else than a mechanism is refused, too.
    """
    match mechanism:
        case Mechanism():
            mechanism.check()
        case _:
            expected = "expected a flexfem.Mechanism, as flexfem.load returns it"
            raise BadInput(f"{printed(mechanism)}, {expected}")
