"""The drive of one stage or of many designs: stacks with their positions, ratings and commands.

Contacts of one stage are placed on its outlines. Those of many designs are placed in closed form on
straight links, otherwise on the outlines, once for every distinct geometry.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array
from flexfem.files.tables import memoized
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.layout import ActuatorSet as ActuatorSet
from flexfem.paper.actuators import (
    BODY_NAMES,
    ENDS,
    GEOMETRY,
    Actuator,
    ActuatorNumbers,
    series_stiffness,
)
from flexfem.paper.bodies import FILLET
from flexfem.paper.contact_points import BESIDE
from flexfem.paper.contact_points import contacts as contacts
from flexfem.paper.contacts import Push, Stack, wrench_of
from flexfem.paper.designs import Designs, design_arrays
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage_file import CHAINS, StageContent, actuators_of
from flexfem.refused import BadInput

STRAIGHT = 1e-12  # rad, and mm per mm: tolerance for two collinear necks
SHAPE = (  # fields of `Designs` on which the outlines depend
    "link_lengths",
    "joint_angles",
    "link_width",
    "radius",
    "neck",
    "axis",
    "platform_radius",
    "hub_radius",
)
NOWHERE = -1e300  # stands for nan where rows of numbers are compared

StageAt = Callable[[int], StageContent]  # returns a design as a stage
Rows = tuple[tuple[Actuator, ...], ...]  # the actuators of every chain


@memoized
def drive_of(stage: StageContent) -> ActuatorSet:
    """Return the drive of a stage.

    Raises BadInput for a stage without actuators or a contact off its body.
    """
    with naming_place(stage):
        if not stage.actuator:
            raise BadInput("no [[actuator]]: the stage has no drive")
        places = product(CHAINS, range(len(stage.actuator)))
        stacks = [stack for chain, index in places for stack in contacts(stage, chain, index)]
        return _drive_with(stacks, design_arrays(stage), actuators_of(stage)).at(0)


def drives_of(
    stage: StageContent, designs: Designs, reason: AnyArray, stage_at: StageAt
) -> ActuatorSet:
    """Return the drives of n designs, with stacks that have no stations.

    stage : with actuators; defines the stacks and the bodies between which they act.
    reason : (n,), reason of refusal, "" for a design not refused so far; reasons of the drive are
    added in place.
    stage_at : returns a design as a stage.
    """
    chains = actuators_of(stage)
    numbers = _numbers(designs)
    _refuse_preloads(numbers, chains[0], reason)
    wrenches = np.empty((*numbers.arm.shape[1:], len(numbers.arm), 3))
    to_draw = np.zeros(len(numbers.arm), dtype=bool)
    for chain, row in enumerate(chains):
        for index, actuator in enumerate(row):
            found = _contact(designs, chain, index, actuator)
            wrenches[chain, index] = found.wrench
            refused = found.outside & (reason == "")
            reason[refused] = f"actuator.{actuator.name}.arm_mm: contact off the link"
            to_draw |= ~found.valid
    _draw(designs, np.flatnonzero(to_draw & (reason == "")), wrenches, reason, stage_at)
    return _drive_with(_stacks(chains, wrenches), designs, chains)


def _stacks(chains: Rows, wrenches: Array) -> list[Stack]:
    """Return the stacks of all chains with wrenches (3, actuators, n, 3) on the driven bodies."""
    stacks = list[Stack]()
    for chain, row in enumerate(chains):
        for index, actuator in enumerate(row):
            carrier, driven = (BODY_NAMES.index(body) for body in actuator.between)
            wrench = wrenches[chain, index]
            for q in (wrench, -wrench) if actuator.pair else (wrench,):
                stacks.append(Stack(chain, (Push(driven, q, None), Push(carrier, -q, None))))
    return stacks


def _numbers(designs: Designs) -> ActuatorNumbers:
    """Numbers of the actuators of n designs, (n, 3 chains, actuators) each."""
    return ActuatorNumbers(*np.moveaxis(designs.actuator, -1, 0))


def _blocking(numbers: ActuatorNumbers) -> Array:
    """Blocking forces (...), N."""
    by_stiffness = numbers.stroke * numbers.stiffness
    return np.where(np.isnan(numbers.stiffness), numbers.blocking_force, by_stiffness)


def _refuse_preloads(
    numbers: ActuatorNumbers, actuators: tuple[Actuator, ...], reason: AnyArray
) -> None:
    """Set the reasons (n,) of designs with a preload above the blocking force, or none on a ball."""
    preload = numbers.preload
    limit = _blocking(numbers) * (1 + BLOCKING_ROUND_OFF)
    refused = {
        "preload_n: above the blocking force of the stack": preload > limit,
        "ball_radius_mm: a ball without preload": (preload == 0) & ~np.isnan(numbers.ball_radius),
    }
    for index, actuator in enumerate(actuators):
        for text, where in refused.items():
            of_actuator = np.any(where[:, :, index], axis=1) & (reason == "")
            reason[of_actuator] = f"actuator.{actuator.name}.{text}"


class _ClosedForm(NamedTuple):
    """The first contact of an actuator of n designs, in closed form.

    wrench : (n, 3), of one newton on the driven body, frame of chain 1.
    valid : (n,), whether it holds.   outside : (n,), whether it is off a straight link.
    """

    wrench: Array
    valid: NDArray[np.bool_]
    outside: NDArray[np.bool_]


class _Links(NamedTuple):
    """A link of n designs between two hinges, in the frame of chain 1.

    begin, end : (n,), complex, mm, of the necks.   along : (n,), unit vectors of the first neck.
    radius, last_radius : (n,), mm, of the notches.   straight : (n,), whether the link is straight.
    """

    begin: AnyArray
    end: AnyArray
    along: AnyArray
    radius: Array
    last_radius: Array
    straight: NDArray[np.bool_]

    @property
    def length(self) -> Array:
        """Length (n,) from notch to notch, mm, of straight links."""
        apart = (self.end - self.begin) / self.along
        return np.asarray(apart.real - self.radius - self.last_radius)


def _links(
    designs: Designs,
    chain: int,
    first: int,
) -> _Links:
    """Return the links of n designs that begin at a hinge (from 0) of a chain (from 0)."""
    to_first_chain = np.exp(-1j * CHAIN_TURN * chain)
    centres = (designs.frames.centres[:, chain] @ np.array([1, 1j])) * to_first_chain
    axes = np.exp(1j * designs.frames.axes[:, chain]) * to_first_chain
    radius = designs.radius[:, chain]
    along = axes[:, first]
    apart = (centres[:, first + 1] - centres[:, first]) / along
    parallel = np.abs(axes[:, first + 1] / along - 1) < STRAIGHT
    aligned = np.abs(apart.imag) < STRAIGHT * np.abs(apart)
    return _Links(
        centres[:, first],
        centres[:, first + 1],
        along,
        radius[:, first],
        radius[:, first + 1],
        parallel & aligned,
    )


def _contact(
    designs: Designs,
    chain: int,
    index: int,
    actuator: Actuator,
) -> _ClosedForm:
    """Evaluate the first contact of an actuator of a chain (from 0) in closed form."""
    numbers = ActuatorNumbers(*(values[:, chain, index] for values in _numbers(designs)))
    if actuator.point is not None:
        nowhere = np.zeros(len(numbers.arm), dtype=bool)
        wrench = wrench_of(numbers.x + 1j * numbers.y, np.exp(1j * numbers.direction))
        return _ClosedForm(wrench, nowhere, nowhere)
    links = _links(designs, chain, BODY_NAMES.index(actuator.between[1]) - 1)
    return _on_links(links, designs.link_width, numbers, actuator)


def _on_links(
    links: _Links, width: Array, numbers: ActuatorNumbers, actuator: Actuator
) -> _ClosedForm:
    """Evaluate the contact of an actuator at an arm from a hinge of a link of a width (n,), mm."""
    length = links.length
    straight = links.straight & (length > 2 * FILLET * width * (1 + BESIDE))
    if actuator.hinge == ENDS[actuator.between[1]][0]:
        along = numbers.arm - links.radius
        middle = links.begin + numbers.arm * links.along
    else:
        along = length - (numbers.arm - links.last_radius)
        middle = links.end - numbers.arm * links.along
    side = 1.0 if actuator.side == "left" else -1.0
    tilt = np.where(np.isnan(numbers.tilt), 0.0, numbers.tilt)
    partner = along + side * width * np.tan(tilt) if actuator.pair else along
    gap = BESIDE * width
    inside = (np.minimum(along, partner) > gap) & (np.maximum(along, partner) < length - gap)
    outside = (along < -gap) | (along > length + gap)
    outward = 1j * side * links.along
    wrench = wrench_of(middle + outward * width / 2, -outward * np.exp(1j * tilt))
    return _ClosedForm(wrench, straight & inside, straight & outside)


def _draw(
    designs: Designs, to_draw: AnyArray, wrenches: Array, reason: AnyArray, stage_at: StageAt
) -> None:
    """Set the wrenches (3, actuators, n, 3), or reasons of refusal, of the designs `to_draw` from
    their outlines.
    """
    if not len(to_draw):
        return
    firsts, group_of = _distinct(designs, to_draw)
    for group, first in enumerate(firsts):
        members = to_draw[group_of == group]
        try:
            drive = drive_of(stage_at(int(to_draw[first])))
        except BadInput as refusal:
            reason[members] = str(refusal)
            continue
        starts = np.argmax(drive.differential != 0, axis=0)  # the first stack of every command
        drawn = np.array([drive.stacks[k].pushes[0].wrench for k in starts])
        wrenches[:, :, members] = drawn.reshape(*wrenches.shape[:2], 1, 3)


def _distinct(designs: Designs, which: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the first design of each geometry among some designs, and the geometry of each."""
    shape = [getattr(designs, name)[which].reshape(len(which), -1) for name in SHAPE]
    contact = designs.actuator[which][..., : len(GEOMETRY)]
    shape.append(contact.reshape(len(which), -1))
    rows = np.nan_to_num(np.concatenate(shape, axis=1), nan=NOWHERE)
    _, firsts, group_of = np.unique(
        rows,
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    return firsts, np.ravel(group_of)


def _drive_with(
    stacks: list[Stack],
    designs: Designs,
    chains: Rows,
) -> ActuatorSet:
    """Return the drive of n designs with given stacks, by chain and actuator, the partners of a
    pair adjacent.
    """
    actuators = [actuator for row in chains for actuator in row]
    pair = np.array([actuator.pair for actuator in actuators])
    owner = np.repeat(np.arange(len(pair)), 1 + pair)
    friction = np.array(
        [np.nan if one.friction is None else one.friction for one in actuators], dtype=float
    )
    numbers = _numbers(designs)
    stroke = numbers.stroke.reshape(-1, len(pair))

    def by_stack(values: Array) -> Array:
        """Return values (n, 3 chains, actuators) for every stack, (n, stacks)."""
        return np.asarray(values.reshape(-1, len(pair))[:, owner])

    return ActuatorSet(
        stacks=tuple(stacks),
        names=tuple(
            f"{actuator.name}, chain {chain}"
            for chain, row in zip(CHAINS, chains, strict=True)
            for actuator in row
        ),
        stiffness=by_stack(_stiffness(designs, numbers, chains)),
        preload=by_stack(numbers.preload),
        blocking_force=by_stack(_blocking(numbers)),
        differential=_differential(owner, len(pair)),
        lowest=np.where(pair, -stroke / 2, 0.0 * stroke),
        highest=np.where(pair, stroke / 2, stroke),
        friction=friction[owner],
    )


def _stiffness(
    designs: Designs,
    numbers: ActuatorNumbers,
    chains: Rows,
) -> Array:
    """Stiffness (n, 3 chains, actuators), N/mm, of stacks and contacts in series."""
    by_stroke = _blocking(numbers) / numbers.stroke
    stack = np.where(np.isnan(numbers.stiffness), by_stroke, numbers.stiffness)
    E = designs.youngs_modulus[:, None, None]
    nu = designs.poissons_ratio[:, None, None]
    loose = np.array([[bool(actuator.ball_loose) for actuator in row] for row in chains])
    return series_stiffness(numbers, stack, E, nu, loose)


def _differential(owner: AnyArray, commands: int) -> Array:
    """Stroke (n stacks, commands) per command: 1 for the first stack of a command, -1 for the next.

    owner : (n,), the command of every stack.
    """
    second = np.append(False, owner[1:] == owner[:-1])
    found = np.zeros((len(owner), commands))
    found[np.arange(len(owner)), owner] = np.where(second, -1.0, 1.0)
    return found
