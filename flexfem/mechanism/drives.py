"""The drive of one stage or of many designs of it: every stack in its place, what it can do and how it is commanded.

Contacts of one stage are placed on its drawn outlines; those of many designs in closed form on straight links, others
on the outlines, once for every geometry among the designs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.actuators import (
    BLOCKING_ROUND_OFF,
    BODY_NAMES,
    ENDS,
    GEOMETRY,
    Actuator,
    ActuatorNumbers,
    series_stiffness,
)
from flexfem.mechanism.bodies import FILLET, centrelines, draw_sector
from flexfem.mechanism.contacts import Push, Stack, nearest, placed_stack, wrench_of
from flexfem.mechanism.designs import CHAIN_TURN, Designs, lower
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.stage_file import CHAINS, StageContent, actuators_of, key_of_actuator, located
from flexfem.refused import BadInput

ON_OUTLINE = 0.01  # distance of a contact from the outline of its body, per link width: coordinates are rounded
NUMBERS = ("stiffness", "preload", "blocking_force", "lowest", "highest")  # of a drive, each design its own
INTO = 0.1  # least cosine between the direction of a push and the inward normal


class StageDrive(NamedTuple):
    """The stacks (n) of a stage and the commands (m) that drive them, chain by chain, actuator by actuator.

    Of many designs the numbers have a leading axis; what stacks there are, and their names, is the same for all.

    stacks : in their places.   names : (m,), of the commands.
    stiffness : (..., n), N/mm, of stack and contact in series.   preload, blocking_force : (..., n), N.
    differential : (n, m), stroke of each stack beyond its rest per command: 1, and -1 for the partner of a pair.
    lowest, highest : (..., m), mm, the commands that the strokes allow; a pair rests at half its stroke.
    friction : (n,), coefficient at each contact, nan where it is not stated; without any, of no length.
    """

    stacks: tuple[Stack, ...]
    names: tuple[str, ...]
    stiffness: Array
    preload: Array
    blocking_force: Array
    differential: Array
    lowest: Array
    highest: Array
    friction: Array = np.zeros(0)

    def at(self, which: AnyArray | int | None) -> StageDrive:
        """With the numbers of some designs (k,), or of one, of many; None gives them an axis of one design."""
        return self._replace(**{name: getattr(self, name)[which] for name in NUMBERS})

    @property
    def rubbing(self) -> tuple[int, ...]:
        """The stacks whose contacts have a stated friction."""
        return tuple(np.flatnonzero(~np.isnan(self.friction)).tolist())


@once
def drive_of(stage: StageContent) -> StageDrive:
    """The drive of a stage. Raises BadInput for a stage without actuators, and for a contact off the metal."""
    with located(stage):
        if not stage.actuator:
            raise BadInput("no [[actuator]]: the stage has no drive")
        chains, stacks, friction = actuators_of(stage), list[Stack](), list[float]()
        for chain, row in zip(CHAINS, chains, strict=True):
            for index, one in enumerate(row):
                for contact in contacts(stage, chain, index):
                    stacks.append(placed_stack(stage, chain - 1, one.between, *contact, one.ball_radius or 0.0))
                    friction.append(np.nan if one.friction is None else one.friction)
        return _of_stacks(lower(stage), chains, stacks).at(0)._replace(friction=np.array(friction))


def check_drive(stage: StageContent) -> None:
    """Raise BadInput for the first contact that is not on the outline of the body it pushes, or not into it."""
    if stage.actuator:
        drive_of(stage)


class Contact(NamedTuple):
    """A contact, mm, complex, and the direction, rad, in which it is pushed, frame of chain 1."""

    point: complex
    direction: float


def contacts(stage: StageContent, chain: int, index: int) -> tuple[Contact, ...]:
    """The contact of an actuator on one chain (1 to 3); with a pair, that of the partner on the opposite side too.

    Raises BadInput when one is off the metal.
    """
    actuator = actuators_of(stage)[chain - 1][index]
    body = actuator.between[1]
    around = CHAINS if body == "platform" else (chain,)
    faces = [(draw_sector(stage, each)[body], (each - chain) * CHAIN_TURN) for each in around]
    outline = [  # the free edges of the body, metal to their left
        segment.turned(angle)
        for face, angle in faces
        for segment, label in zip(face.loop, face.labels, strict=True)
        if label == "free"
    ]
    if actuator.point is None or actuator.direction is None:
        first = _on_link(stage, chain, index)
    else:
        first = Contact(complex(*actuator.point), actuator.direction)
    _check_contact(stage, chain, index, first, outline)
    if not actuator.pair:
        return (first,)
    push = np.exp(1j * first.direction)
    crossed = [t for segment in outline for t in _crossings(segment, first.point, push)]
    beyond = [t for t in crossed if t > ON_OUTLINE * stage.chain.link_width]
    if not beyond:
        raise BadInput(
            f"{key_of_actuator(stage, chain, index, 'pair')} = true: nothing of {body} of chain {chain} is opposite "
            "to the contact, expected an outline there for the partner to push on"
        )
    partner = Contact(complex(first.point + min(beyond) * push), first.direction + np.pi)
    _check_contact(stage, chain, index, partner, outline)
    return first, partner


def _on_link(stage: StageContent, chain: int, index: int) -> Contact:
    """The contact at an arm from a hinge, on the side of a link. Raises BadInput for an arm that is off its strip."""
    actuator = actuators_of(stage)[chain - 1][index]
    assert actuator.hinge is not None and actuator.arm is not None
    body = actuator.between[1]
    path = centrelines(stage, chain)[BODY_NAMES.index(body)]
    length, radius = sum(segment.length for segment in path), stage.hinge(chain, actuator.hinge).radius
    s, gap = actuator.arm - radius, BESIDE * stage.chain.link_width
    if not gap < s < length - gap:  # at a corner there is no normal
        raise BadInput(
            f"{key_of_actuator(stage, chain, index, 'arm_mm')} = {actuator.arm:g}, contact off the metal: expected "
            f"between {radius:g} and {radius + length:.6g}, from notch to notch of {body} of chain {chain}"
        )
    s = s if actuator.hinge == ENDS[body][0] else length - s
    for segment in path:
        if s <= segment.length or segment is path[-1]:
            break
        s -= segment.length
    share = min(s / segment.length, 1.0)
    outward = 1j * (1 if actuator.side == "left" else -1) * complex(segment.tangent(share))
    point = complex(segment.at(share)) + outward * stage.chain.link_width / 2
    return Contact(point, float(np.angle(-outward)) + (actuator.tilt or 0.0))


def _check_contact(stage: StageContent, chain: int, index: int, contact: Contact, outline: list[Segment]) -> None:
    """Refuse a contact that is off the outline, or pushed not into the metal, with the key that places it."""
    actuator, (point, direction) = actuators_of(stage)[chain - 1][index], contact
    body = f"{actuator.between[1]} of chain {chain}"
    distance, _, place, inward = nearest(outline, point)
    if distance > ON_OUTLINE * stage.chain.link_width:
        on_link = actuator.point is None
        key, value = ("arm_mm", f"{actuator.arm:g}") if on_link else ("point_mm", str(list(actuator.point or ())))
        raise BadInput(
            f"{key_of_actuator(stage, chain, index, key)} = {value}, contact off the metal: expected a point of the "
            f"outline of {body}, the nearest is [{place.real:.4g}, {place.imag:.4g}]"
        )
    if (np.exp(1j * direction) * np.conj(inward)).real < INTO:
        key, turned = ("tilt_deg", actuator.tilt) if actuator.direction is None else ("direction_deg", direction)
        raise BadInput(
            f"{key_of_actuator(stage, chain, index, key)} = {np.rad2deg(turned or 0.0):g}, not into the metal of "
            f"{body} at [{point.real:.4g}, {point.imag:.4g}]: expected within 84 degrees of "
            f"{np.rad2deg(np.angle(inward)) % 360:.4g}, the inward normal there"
        )


def _crossings(segment: Segment, point: complex, push: complex) -> list[float]:
    """Distances, mm, along a line from a point, at which it crosses a line or arc."""
    start, end = ((z - point) / push for z in (segment.start, segment.end))
    if segment.centre is None:
        if start.imag * end.imag > 0 or start.imag == end.imag:
            return []
        return [(start.real * end.imag - end.real * start.imag) / (end.imag - start.imag)]
    centre, radius = (segment.centre - point) / push, abs(segment.start - segment.centre)
    if abs(centre.imag) > radius:
        return []
    chord = np.sqrt(radius**2 - centre.imag**2)
    found = [centre.real - chord, centre.real + chord]
    return [float(t) for t in found if nearest([segment], point + t * push).distance < 1e-9 * radius]


STRAIGHT = 1e-12  # rad, and mm per mm: two necks in line
BESIDE = 1e-6  # of its width: how near to the end of a link a contact is looked at on the drawn outline
SHAPE = ("link_lengths", "joint_angles", "link_width", "radius", "neck", "axis", "platform_radius", "hub_radius")
Which = NDArray[np.bool_]


def drives_of(
    stage: StageContent, designs: Designs, reason: AnyArray, stage_at: Callable[[int], StageContent]
) -> StageDrive:
    """The drives of n designs, stacks without stations.

    stage : with actuators; of it come what stacks there are, and what they act between.
    reason : (n,), why a design is refused, "" where it is not so far; the drive's own reasons are put in.
    stage_at : a design as a stage.
    """
    chains = actuators_of(stage)
    of = _numbers(designs)
    refused = {
        "preload_n: above the blocking force of the stack": of.preload > _blocking(of) * (1 + BLOCKING_ROUND_OFF),
        "ball_radius_mm: a ball without preload": (of.preload == 0) & ~np.isnan(of.ball_radius),
    }
    for index, actuator in enumerate(chains[0]):
        for text, where in refused.items():
            reason[np.any(where[:, :, index], axis=1) & (reason == "")] = f"actuator.{actuator.name}.{text}"
    wrenches = np.empty((*of.arm.shape[1:], len(of.arm), 3))
    unsure = np.zeros(len(of.arm), dtype=bool)
    for chain, row in enumerate(chains):
        for index, one in enumerate(row):
            wrenches[chain, index], sure, off = _contact(designs, chain, index, one)
            reason[off & (reason == "")] = f"actuator.{one.name}.arm_mm: contact off the metal"
            unsure |= ~sure
    _draw(designs, np.flatnonzero(unsure & (reason == "")), wrenches, reason, stage_at)
    stacks = list[Stack]()
    for chain, row in enumerate(chains):
        for one, q in zip(row, wrenches[chain], strict=True):
            carrier, pushed = (BODY_NAMES.index(body) for body in one.between)
            for sign in (1.0, -1.0) if one.pair else (1.0,):
                stacks.append(Stack(chain, (Push(pushed, sign * q, None), Push(carrier, -sign * q, None))))
    return _of_stacks(designs, chains, stacks)


def _numbers(designs: Designs) -> ActuatorNumbers:
    """Of the actuators of n designs, (n, 3 chains, actuators) each."""
    return ActuatorNumbers(*np.moveaxis(designs.actuator, -1, 0))


def _blocking(of: ActuatorNumbers) -> Array:
    return np.where(np.isnan(of.stiffness), of.blocking_force, of.stroke * of.stiffness)


def _contact(designs: Designs, chain: int, index: int, actuator: Actuator) -> tuple[Array, Which, Which]:
    """The first contact of an actuator of a chain (from 0), in closed form where that holds.

    Returns the wrenches (n, 3) of one newton, frame of chain 1; where they are sure (n,), and where off the metal (n,).
    """
    own = ActuatorNumbers(*(each[:, chain, index] for each in _numbers(designs)))
    if actuator.point is not None:
        nowhere = np.zeros(len(own.arm), dtype=bool)
        return wrench_of(own.x + 1j * own.y, np.exp(1j * own.direction)), nowhere, nowhere
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
    wrench = wrench_of(middle + outward * width / 2, -outward * np.exp(1j * tilt))
    return wrench, straight & inside, straight & ((s < -gap) | (s > length + gap))


def _draw(
    designs: Designs, unsure: AnyArray, wrenches: Array, reason: AnyArray, stage_at: Callable[[int], StageContent]
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


def _of_stacks(designs: Designs, chains: tuple[tuple[Actuator, ...], ...], stacks: list[Stack]) -> StageDrive:
    """The drive of n designs with their stacks in place, by chain and actuator, the partners of a pair side by side."""
    of = _numbers(designs)
    blocking = _blocking(of)
    rate = np.where(np.isnan(of.stiffness), blocking / of.stroke, of.stiffness)
    metal = designs.youngs_modulus[:, None, None], designs.poissons_ratio[:, None, None]
    loose = np.array([[bool(one.ball_loose) for one in row] for row in chains])
    pair = np.array([one.pair for row in chains for one in row])
    owner = np.repeat(np.arange(len(pair)), 1 + pair)
    second = np.append(False, owner[1:] == owner[:-1])
    differential = np.zeros((len(stacks), len(pair)))
    differential[np.arange(len(stacks)), owner] = np.where(second, -1.0, 1.0)
    stroke = of.stroke.reshape(-1, len(pair))
    stiffness, preload, blocking = (
        each.reshape(-1, len(pair))[:, owner]
        for each in (series_stiffness(of, rate, *metal, loose), of.preload, blocking)
    )
    return StageDrive(
        stacks=tuple(stacks),
        names=tuple(f"{one.name}, chain {chain + 1}" for chain, row in enumerate(chains) for one in row),
        stiffness=stiffness,
        preload=preload,
        blocking_force=blocking,
        differential=differential,
        lowest=np.where(pair, -stroke / 2, 0.0 * stroke),
        highest=np.where(pair, stroke / 2, stroke),
    )
