"""The analytic network of many designs of one mechanism: its bonds, its response and its stress."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.batched import Bond, to_axes, twists_under
from flexfem.analytic.network import GROUND
from flexfem.arrays import AnyArray, Array, inverse
from flexfem.hinges.many import beam_integrals, highest_stress, is_same
from flexfem.mechanism.layout import Constants, Patch
from flexfem.mechanism.layouts import HingeDesigns, Layouts, Number

RatiosOf: TypeAlias = Callable[[HingeDesigns], Array | None]
"""Function of a hinge that returns ratios (n, 3), or (3,), of its axial, transverse and rotational
compliance to those in plane stress; None where they are one."""


class AlikeHinges(NamedTuple):
    """Hinges of equal profile and material in all designs.

    numbers : of the hinges.   stiffness : (n, 3, 3), at the centre in their axes.   ratios : as of
    `RatiosOf`.
    """

    numbers: tuple[int, ...]
    stiffness: Array
    ratios: Array | None


def alike_hinges(layouts: Layouts) -> list[tuple[int, ...]]:
    """Return the numbers of the hinges that are alike in profile and material, in groups."""
    groups = list[list[int]]()
    for number, hinge in enumerate(layouts.hinges):
        for group in groups:
            first = layouts.hinges[group[0]]
            if is_same(first.profile, hinge.profile) and _same(first.material, hinge.material):
                group.append(number)
                break
        else:
            groups.append([number])
    return [tuple(group) for group in groups]


def _same(one: Constants, other: Constants) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one[:5], other[:5], strict=True))


def _with_stiffness(
    layouts: Layouts,
    numbers: tuple[int, ...],
    ratios_of: RatiosOf,
) -> AlikeHinges:
    hinge = layouts.hinges[numbers[0]]
    E, nu, *_ = hinge.material
    integrals = beam_integrals(hinge.profile, layouts.number)
    compliance = integrals.compliance(E, nu, layouts.thickness)
    ratios = ratios_of(hinge)
    if ratios is not None:
        roots = np.sqrt(ratios)
        compliance = compliance * roots[..., :, None] * roots[..., None, :]
    return AlikeHinges(numbers, inverse(compliance), ratios)


class DesignResponse(NamedTuple):
    """Motions of k ports per load on them: 3 of each point, the output first, then of actuators.

    compliance : (n, k, k).   wrenches : (n, 3, k), of each hinge per load on a port.
    """

    compliance: Array
    wrenches: list[Array]


class DesignNetwork:
    """The bonds of n designs, with the places from the mean of the hinges, against round-off."""

    def __init__(
        self,
        layouts: Layouts,
        ratios_of: RatiosOf,
    ) -> None:
        self.layouts = layouts
        self.groups = [
            _with_stiffness(layouts, group, ratios_of) for group in alike_hinges(layouts)
        ]
        hinges = layouts.hinges
        places = [np.broadcast_to(hinge.place, (layouts.number,)) for hinge in hinges]
        self.centre = np.mean(places, axis=0)
        stiffness = {number: group.stiffness for group in self.groups for number in group.numbers}
        self.bonds = [
            Bond(
                (self.node(hinge.bodies[0]), self.node(hinge.bodies[1])),
                to_axes(place - self.centre, hinge.heading),
                stiffness[number],
            )
            for number, (hinge, place) in enumerate(zip(hinges, places, strict=True))
        ]

    def node(self, body: int) -> int:
        """Return the number of a body, that of the ground where it is held."""
        return GROUND if body < 0 or self.layouts.held[body] else body

    def for_each(self, number: Number) -> Array:
        """Return a number of all designs for each of them (n,)."""
        return np.broadcast_to(np.asarray(number, dtype=float), (self.layouts.number,))

    @cached_property
    def response(self) -> DesignResponse:
        """The response to unit loads on the ports."""
        loads = self._loads()
        twists = twists_under(self.bonds, loads)
        compliance = np.sum(
            [np.swapaxes(load, -1, -2) @ twists[body] for body, load in loads.items()], axis=0
        )
        return DesignResponse(compliance, [bond.wrench(twists) for bond in self.bonds])

    def _loads(self) -> dict[int, Array]:
        """Return wrenches (n, 3, k) at the centre, by body."""
        layouts = self.layouts
        first = 3 * len(layouts.points)
        shape = (layouts.number, 3, first + len(layouts.inputs))
        loads = dict[int, Array]()

        def add(
            contact: Patch,
            place: int,
            wrenches: AnyArray,
        ) -> None:
            body = self.node(contact.body)
            if body != GROUND:
                columns = slice(place, place + wrenches.shape[-1])
                load = loads.setdefault(body, np.zeros(shape))
                load[:, :, columns] += np.swapaxes(self.to_point(contact), -1, -2) @ wrenches

        for place, point in enumerate(layouts.points):
            add(point, 3 * place, np.eye(3))
        for place, actuator in enumerate(layouts.inputs, first):
            along = np.asarray(actuator.direction)
            parts = [along.real, along.imag, np.zeros(along.shape)]
            force = np.stack(parts, axis=-1)[..., None]
            near, far = actuator.contacts
            add(near, place, -force)
            add(far, place, force)
        return loads

    def to_point(self, contact: Patch) -> Array:
        """Return the matrices (n, 3, 3) from twists at the centre to motions of a contact."""
        return to_axes(np.asarray(contact.point) - self.centre, 0.0)

    def stress_under(self, loads: Array) -> Array:
        """Return the highest stress (n, h, c) of hinges under c loads (n, k, c) on the first k ports.

        In wide hinges it follows the deformation.
        """
        layouts = self.layouts
        ports = loads.shape[-2]
        stress = np.empty((layouts.number, len(layouts.hinges), loads.shape[-1]))
        thickness = self.for_each(layouts.thickness)[:, None]
        for group in self.groups:
            hinge = layouts.hinges[group.numbers[0]]
            wrenches = [self.response.wrenches[number][..., :ports] for number in group.numbers]
            under = np.swapaxes(np.stack(wrenches, axis=1) @ loads[:, None], -1, -2)
            if group.ratios is not None:
                under = under * _for_loads(group.ratios)
            columns = under.reshape(layouts.number, -1, 3)
            found = highest_stress(hinge.profile, columns, hinge.material.out_of_plane) / thickness
            stress[:, group.numbers] = found.reshape(layouts.number, len(group.numbers), -1)
        return stress


def _for_loads(ratios: Array) -> Any:
    """Return ratios (n, 3), or (3,), for arrays (n, hinges, loads, 3)."""
    return ratios[:, None, None] if ratios.ndim > 1 else ratios
