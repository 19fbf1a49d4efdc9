"""The layouts of many designs of one mechanism, as the network of rigid bodies reads them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.layout import Constants, Layout, Patch
from flexfem.mechanism.profile import Profile

Number: TypeAlias = float | AnyArray
"""A number of all designs, or an array (n,)."""


class Refusal(NamedTuple):
    """Designs that cannot be made: `where` (n,), bool, and the reason of a design by its index."""

    where: AnyArray
    reason: Callable[[int], str]


class HingeDesigns(NamedTuple):
    """A hinge of n designs, as `layout.Joint`; place and heading are numbers or arrays (n,).

    profile : with dimensions that are numbers or arrays (n, 1).   material : with numbers or
    arrays (n,).
    """

    name: str
    bodies: tuple[int, int]
    place: AnyArray
    heading: Number
    profile: Profile
    material: Constants
    key: str


class InputDesigns(NamedTuple):
    """An actuator of n designs, as `layout.LinearActuator`, with numbers or arrays (n,).

    contacts : whose points are numbers or arrays (n,).   direction : (n,), of its force, complex.
    """

    name: str
    contacts: tuple[Patch, Patch]
    direction: AnyArray
    stiffness: Number
    stroke: Number
    mass: Number


class PayloadDesigns(NamedTuple):
    """A rigid payload of n designs, as `layout.PayloadMass`, with numbers or arrays (n,)."""

    contact: Patch
    mass: Number
    inertia: Number


class Layouts(NamedTuple):
    """The layouts of n designs of a mechanism, as the network of rigid bodies reads them.

    number : n.   held : whether each body is ground.   thickness : mm, and yield_strength : MPa, of
    the plate, numbers or arrays (n,).   points : contacts to read, the output first.
    refusals : what the closed-form conditions of the drawing refuse.
    bodies : constants of their materials, numbers or arrays (n,).
    drawn : function that returns the layout of one design by its index, with the outlines of its
        bodies; its thickness and materials are those of the base. It raises BadInput for parts that
        do not fit together.
    """

    number: int
    held: tuple[bool, ...]
    hinges: tuple[HingeDesigns, ...]
    points: tuple[Patch, ...]
    inputs: tuple[InputDesigns, ...]
    thickness: Number
    yield_strength: Number
    refusals: tuple[Refusal, ...]
    bodies: tuple[Constants, ...]
    payloads: tuple[PayloadDesigns, ...]
    drawn: Callable[[int], Layout]

    @property
    def refused(self) -> AnyArray:
        """Which designs (n,) are refused."""
        found = np.zeros(self.number, bool)
        for refusal in self.refusals:
            found |= refusal.where
        return found

    def reason(self, design: int) -> str:
        """Return why a design is refused, "" for one that is not."""
        found = (each.reason(design) for each in self.refusals if each.where[design])
        return next(found, "")
