"""Mechanisms at rest, many designs at once: the numbers of `stiffness` by the analytic network.

Each number is that of `stiffness(mechanism, models="analytic", no_limits=True)` for every design,
to round-off where hinges are plane. In three dimensions the ratios of their compliance to that in
plane stress are given, since each takes milliseconds (`hinges.wide`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from flexfem.analytic.batched import Bond, to_axes, twists_under
from flexfem.analytic.network import GROUND
from flexfem.arrays import AnyArray, Array, inverse
from flexfem.hinges.many import beam_integrals, highest_stress, is_same
from flexfem.mechanism.layout import Constants, Patch
from flexfem.mechanism.layouts import HingeDesigns, Layouts

OF_STRESS = ("stress", "yield_range", "free_yield_range", "yield_force")
AT_REST = (
    "compliance",
    "stiffness",
    "held",
    "free",
    "input_stiffness",
    "amplification",
    *OF_STRESS,
)  # quantities of `Stiffness`
RatiosOf = Callable[[HingeDesigns], Array | None]
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


def at_rest(
    layouts: Layouts, ratios_of: RatiosOf, wanted: Collection[str] = AT_REST
) -> dict[str, Array]:
    """Return quantities of `AT_REST` (n, ...) of n designs, in internal units.

    nan for a design without a solution. Stress, which takes most of the time, is computed where it
    is `wanted`, or a range at yield.
    """
    with np.errstate(all="ignore"):
        groups = [_with_stiffness(layouts, group, ratios_of) for group in alike_hinges(layouts)]
        network = _Network(layouts, groups)
        found = network.response()
        values = _of_output(found.compliance[:, :3, :3])
        values |= _of_inputs(found.compliance)
        if not {*wanted}.isdisjoint(OF_STRESS):
            values |= _of_stress(layouts, groups, found, values)
        return values


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


class _Response(NamedTuple):
    """Motions of the output and of the actuators per load on them, and wrenches by the former.

    compliance : (n, 3 + a, 3 + a).   wrenches : (n, 3, 3), of each hinge per load on the output.
    """

    compliance: Array
    wrenches: list[Array]


class _Network:
    """The bonds of n designs, with the places from the mean of the hinges, against round-off."""

    def __init__(
        self,
        layouts: Layouts,
        groups: Sequence[AlikeHinges],
    ) -> None:
        self.layouts = layouts
        hinges = layouts.hinges
        places = [np.broadcast_to(hinge.place, (layouts.number,)) for hinge in hinges]
        self.centre = np.mean(places, axis=0)
        stiffness = {number: group.stiffness for group in groups for number in group.numbers}
        self.bonds = [
            Bond(
                (self._node(hinge.bodies[0]), self._node(hinge.bodies[1])),
                to_axes(place - self.centre, hinge.heading),
                stiffness[number],
            )
            for number, (hinge, place) in enumerate(zip(hinges, places, strict=True))
        ]

    def _node(self, body: int) -> int:
        return GROUND if body < 0 or self.layouts.held[body] else body

    def response(self) -> _Response:
        """Return the response to unit loads on the output, then on the actuators."""
        loads = self._loads()
        twists = twists_under(self.bonds, loads)
        compliance = np.sum(
            [np.swapaxes(load, -1, -2) @ twists[body] for body, load in loads.items()], axis=0
        )
        of_output = {body: twist[..., :3] for body, twist in twists.items()}
        return _Response(compliance, [bond.wrench(of_output) for bond in self.bonds])

    def _loads(self) -> dict[int, Array]:
        """Return wrenches (n, 3, 3 + a) at the centre, by body."""
        inputs = self.layouts.inputs
        loads = dict[int, Array]()

        def add(
            contact: Patch,
            place: int,
            wrenches: AnyArray,
        ) -> None:
            body = self._node(contact.body)
            if body != GROUND:
                shape = (self.layouts.number, 3, 3 + len(inputs))
                at_centre = to_axes(np.asarray(contact.point) - self.centre, 0.0)
                columns = slice(place, place + wrenches.shape[-1])
                load = loads.setdefault(body, np.zeros(shape))
                load[:, :, columns] += np.swapaxes(at_centre, -1, -2) @ wrenches

        add(self.layouts.points[0], 0, np.eye(3))
        for place, actuator in enumerate(inputs, 3):
            along = np.asarray(actuator.direction)
            parts = [along.real, along.imag, np.zeros(along.shape)]
            force = np.stack(parts, axis=-1)[..., None]
            near, far = actuator.contacts
            add(near, place, -force)
            add(far, place, force)
        return loads


def _of_output(compliance: Array) -> dict[str, Array]:
    K = inverse(compliance)
    K = (K + np.swapaxes(K, -1, -2)) / 2
    return {
        "compliance": compliance,
        "stiffness": K,
        "held": np.diagonal(K, axis1=-2, axis2=-1),
        "free": 1 / np.diagonal(compliance, axis1=-2, axis2=-1),
    }


def _of_inputs(compliance: Array) -> dict[str, Array]:
    """Return the stiffness (n, a) at the actuators and the motion (n, a, 3) per opening of each."""
    openings = np.diagonal(compliance, axis1=-2, axis2=-1)[:, 3:]
    motions = np.swapaxes(compliance[:, :3, 3:], -1, -2)
    return {"input_stiffness": 1 / openings, "amplification": motions / openings[..., None]}


def _of_stress(
    layouts: Layouts, groups: Sequence[AlikeHinges], found: _Response, values: dict[str, Array]
) -> dict[str, Array]:
    """Return the stress (n, h, 3) per displacement, and displacements and forces (n, 3) at yield."""
    count = layouts.number
    stress = np.empty((count, len(layouts.hinges), 3))
    highest = np.zeros((count, 3))
    highest_alone = np.zeros((count, 3))
    for group in groups:
        held, alone = _stress_of(layouts, group, found, values)
        stress[:, group.numbers] = held
        own = layouts.hinges[group.numbers[0]].material.yield_strength
        share = np.broadcast_to(np.divide(layouts.yield_strength, own), (count,))[:, None]
        np.maximum(highest, share * np.max(held, axis=1), out=highest)
        np.maximum(highest_alone, share * np.max(alone, axis=1), out=highest_alone)
    strength = np.broadcast_to(layouts.yield_strength, (count,))[:, None]
    reach = strength / highest
    return {
        "stress": stress,
        "free_yield_range": strength / highest_alone,
        "yield_range": reach,
        "yield_force": values["held"] * reach,
    }


def _stress_of(
    layouts: Layouts, group: AlikeHinges, found: _Response, values: dict[str, Array]
) -> tuple[Array, Array]:
    """Return the highest stress (n, hinges, 3) of alike hinges per displacement of the output.

    First with its other directions held, then free. In wide hinges it follows the deformation.
    """
    hinge = layouts.hinges[group.numbers[0]]
    unit = np.stack([found.wrenches[number] for number in group.numbers], axis=1)
    held = unit @ values["stiffness"][:, None]
    alone = unit * values["free"][:, None, None]
    wrenches = np.swapaxes(np.concatenate([held, alone], axis=-1), -1, -2)
    if group.ratios is not None:
        wrenches = wrenches * _for_each(group.ratios)
    count = len(wrenches)
    columns = wrenches.reshape(count, -1, 3)
    per_thickness = highest_stress(hinge.profile, columns, hinge.material.out_of_plane)
    stress = per_thickness / np.broadcast_to(layouts.thickness, (count,))[:, None]
    stress = stress.reshape(count, len(group.numbers), 6)
    return stress[..., :3], stress[..., 3:]


def _for_each(ratios: Array) -> Any:
    """Return ratios (n, 3), or (3,), for arrays (n, hinges, loads, 3)."""
    return ratios[:, None, None] if ratios.ndim > 1 else ratios
