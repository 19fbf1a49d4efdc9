"""The drives of many designs of one stage: contacts, ratings and limits as arrays.

Contacts on a straight link, and their partners opposite, are placed in closed form, as `drives.drive_of` places them.
What else there is, a contact on a bent link, at the end of one or anywhere by its point, is placed and looked at on the
drawn outlines, once for every geometry among the designs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array
from flexfem.refused import BadInput
from flexfem.stage.actuators import BLOCKING_ROUND_OFF, BODY_NAMES, ENDS, Actuator
from flexfem.stage.bodies import FILLET
from flexfem.stage.contacts import Push, Stack
from flexfem.stage.content import actuators_of
from flexfem.stage.designs import CHAIN_TURN, Designs
from flexfem.stage.drives import StageDrive, drive_of
from flexfem.stage.stacks import GEOMETRY, Numbers, series_stiffness

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

STRAIGHT = 1e-12  # rad, and mm per mm: two necks in line
BESIDE = 1e-6  # of its width: how near to the end of a link a contact is looked at on the drawn outline
SHAPE = ("link_lengths", "joint_angles", "link_width", "radius", "neck", "axis", "platform_radius", "hub_radius")
Which = NDArray[np.bool_]


class _Placed(NamedTuple):
    """Wrenches (n, 3) of one newton at contacts of n designs, frame of chain 1, right where they are sure.

    sure : (n,), bool.   off : (n,), bool, of contacts that are off the metal.
    """

    wrench: Array
    sure: Which
    off: Which


def drives_of(stage: Stage, designs: Designs, reason: AnyArray, stage_at: Callable[[int], Stage]) -> StageDrive:
    """The drives of n designs, stacks without stations.

    Parameters
    ----------
    stage : with actuators; of it come what stacks there are, and what they act between.
    reason : (n,), why a design is refused, "" where it is not so far; the drive's own reasons are put in.
    stage_at : a design as a stage.
    """
    chains = actuators_of(stage)
    numbers = Numbers(*np.moveaxis(designs.actuator, -1, 0))  # (n, 3, actuators) each
    _refuse_numbers(chains, numbers, reason)
    placed = [[_contact(designs, chain, index, one) for index, one in enumerate(chains[chain])] for chain in range(3)]
    for chain, row in enumerate(placed):
        for index, each in enumerate(row):
            said = f"actuator.{chains[chain][index].name}.arm_mm: contact off the metal"
            reason[each.off & (reason == "")] = said
    wrenches = np.array([[each.wrench for each in row] for row in placed])  # (3, actuators, n, 3)
    unsure = np.any([~each.sure for row in placed for each in row], axis=0) & (reason == "")
    _draw(designs, np.flatnonzero(unsure), wrenches, reason, stage_at)
    return _of_placed(designs, chains, numbers, wrenches)


def _refuse_numbers(chains: tuple[tuple[Actuator, ...], ...], numbers: Numbers, reason: AnyArray) -> None:
    most = _blocking(numbers)
    for index, actuator in enumerate(chains[0]):
        above = np.any(numbers.preload[:, :, index] > most[:, :, index] * (1 + BLOCKING_ROUND_OFF), axis=1)
        loose = np.any((numbers.preload[:, :, index] == 0) & ~np.isnan(numbers.ball_radius[:, :, index]), axis=1)
        for text, where in (
            ("preload_n: above the blocking force of the stack", above),
            ("ball_radius_mm: a ball without preload", loose),
        ):
            reason[where & (reason == "")] = f"actuator.{actuator.name}.{text}"


def _blocking(of: Numbers) -> Array:
    return np.where(np.isnan(of.stiffness), of.blocking_force, of.stroke * of.stiffness)


def _contact(designs: Designs, chain: int, index: int, actuator: Actuator) -> _Placed:
    """The first contact of an actuator of a chain (from 0), in closed form where that holds."""
    own = Numbers(*np.moveaxis(designs.actuator[:, chain, index], -1, 0))
    nowhere = np.zeros(len(own.arm), dtype=bool)
    if actuator.point is not None:
        return _Placed(_wrench(own.x + 1j * own.y, np.exp(1j * own.direction)), nowhere, nowhere)
    first = BODY_NAMES.index(actuator.between[1]) - 1
    turn = np.exp(-1j * CHAIN_TURN * chain)
    centres = (designs.frames.centres[:, chain] @ np.array([1, 1j])) * turn
    along = np.exp(1j * designs.frames.axes[:, chain]) * turn
    (begin, end), (e, last), (r, r_last) = (
        (each[:, first], each[:, first + 1]) for each in (centres, along, designs.radius[:, chain])
    )
    apart = (end - begin) / e
    straight = (np.abs(last / e - 1) < STRAIGHT) & (np.abs(apart.imag) < STRAIGHT * np.abs(apart))
    width, length = designs.link_width, apart.real - r - r_last
    straight &= length > 2 * FILLET * width * (1 + BESIDE)
    ahead = actuator.hinge == ENDS[actuator.between[1]][0]
    s = own.arm - r if ahead else length - (own.arm - r_last)
    side, tilt = 1.0 if actuator.side == "left" else -1.0, np.where(np.isnan(own.tilt), 0.0, own.tilt)
    opposite = s + side * width * np.tan(tilt) if actuator.pair else s
    gap = BESIDE * width
    inside = (np.minimum(s, opposite) > gap) & (np.maximum(s, opposite) < length - gap)
    outward = 1j * side * e
    middle = begin + own.arm * e if ahead else end - own.arm * e
    wrench = _wrench(middle + outward * width / 2, -outward * np.exp(1j * tilt))
    return _Placed(wrench, straight & inside, straight & ((s < -gap) | (s > length + gap)))


def _wrench(point: AnyArray, push: AnyArray) -> Array:
    """As `contacts.placed_stack` has it, of points and directions (n,), complex."""
    return np.stack([push.real, push.imag, (np.conj(point) * push).imag], axis=-1)


def _draw(
    designs: Designs, unsure: AnyArray, wrenches: Array, reason: AnyArray, stage_at: Callable[[int], Stage]
) -> None:
    """Put in the wrenches (3, actuators, n, 3), or the reasons, that the drawn outlines give to some designs."""
    if not len(unsure):
        return
    shape = [getattr(designs, name)[unsure].reshape(len(unsure), -1) for name in SHAPE]
    shape.append(designs.actuator[unsure][..., : len(GEOMETRY)].reshape(len(unsure), -1))
    rows = np.nan_to_num(np.concatenate(shape, axis=1), nan=-1e300)
    _, firsts, alike = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    for group, first in enumerate(firsts):
        mine = unsure[np.ravel(alike) == group]
        try:
            drive = drive_of(stage_at(int(unsure[first])))
        except BadInput as refusal:
            reason[mine] = str(refusal)
            continue
        starts = np.argmax(drive.differential != 0, axis=0)  # the first stack of every command
        found = np.array([drive.stacks[k].pushes[0].wrench for k in starts])
        wrenches[:, :, mine] = found.reshape(*wrenches.shape[:2], 1, 3)


def _commands(stroke: Array, pair: bool) -> tuple[Array, Array]:
    """Least and largest commands (n,), mm, as of one stage."""
    return (-stroke / 2, stroke / 2) if pair else (0 * stroke, stroke)


def _of_placed(designs: Designs, chains: tuple[tuple[Actuator, ...], ...], of: Numbers, wrenches: Array) -> StageDrive:
    """The drive of designs whose contacts are placed."""
    blocking = _blocking(of)
    rate = np.where(np.isnan(of.stiffness), blocking / of.stroke, of.stiffness)
    metal = designs.youngs_modulus[:, None, None], designs.poissons_ratio[:, None, None]
    loose = np.array([[bool(one.ball_loose) for one in row] for row in chains])
    series = series_stiffness(of, rate, *metal, loose)
    stacks, owners, signs, names = list[Stack](), list[tuple[int, int, int]](), list[float](), list[str]()
    lowest, highest = list[Array](), list[Array]()
    for chain, row in enumerate(chains):
        for index, one in enumerate(row):
            stroke = of.stroke[:, chain, index]
            carrier, pushed = (BODY_NAMES.index(body) for body in one.between)
            for sign in (1.0, -1.0) if one.pair else (1.0,):
                q = sign * wrenches[chain, index]
                stacks.append(Stack(chain, (Push(pushed, q, None), Push(carrier, -q, None))))
                owners.append((chain, index, len(names)))
                signs.append(sign)
            names.append(f"{one.name}, chain {chain + 1}")
            low, high = _commands(stroke, one.pair)
            lowest.append(low)
            highest.append(high)
    where = np.array(owners)
    differential = np.zeros((len(stacks), len(names)))
    differential[np.arange(len(stacks)), where[:, 2]] = signs
    chain_of, index_of = where[:, 0], where[:, 1]
    series, preload, blocking = (each[:, chain_of, index_of] for each in (series, of.preload, blocking))
    ends = np.stack(lowest, axis=-1), np.stack(highest, axis=-1)
    return StageDrive(tuple(stacks), tuple(names), series, preload, blocking, differential, *ends)
