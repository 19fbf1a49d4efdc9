"""The drive of one stage or of many designs: stacks with their positions, ratings and commands.

Contacts of one stage are placed on its outlines. Those of many designs are placed in closed form on
straight links, otherwise on the outlines, once for every distinct geometry."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.files.tables import once
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF
from flexfem.mechanism.content import located
from flexfem.mechanism.layout import ActuatorSet as ActuatorSet
from flexfem.mechanism.outlines import Segment
from flexfem.paper.actuators import (
    BODY_NAMES,
    ENDS,
    GEOMETRY,
    Actuator,
    ActuatorNumbers,
    series_stiffness,
)
from flexfem.paper.bodies import FILLET, centrelines, draw_sector
from flexfem.paper.contacts import Push, Stack, nearest, placed_stack, wrench_of
from flexfem.paper.designs import Designs, lower
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage_file import CHAINS, StageContent, actuators_of, key_of_actuator
from flexfem.refused import BadInput

# distance of a contact from the outline of its body, per link width: coordinates are rounded
ON_OUTLINE = 0.01
LEAST_COSINE = 0.1  # between the direction of a force and the inward normal


@once
def drive_of(stage: StageContent) -> ActuatorSet:
    """Return the drive of a stage. Raises BadInput for a stage without actuators or a contact off
    its body.
    """
    with located(stage):
        if not stage.actuator:
            raise BadInput("no [[actuator]]: the stage has no drive")
        places = product(CHAINS, range(len(stage.actuator)))
        stacks = [stack for chain, index in places for stack in contacts(stage, chain, index)]
        return _drive_with(stacks, lower(stage), actuators_of(stage)).at(0)


def contacts(stage: StageContent, chain: int, index: int) -> tuple[Stack, ...]:
    """Stack of an actuator on one chain (1 to 3); for a pair, followed by the partner on the
    opposite side.

    Raises BadInput for a contact off the outline of its body.
    """
    actuator = actuators_of(stage)[chain - 1][index]
    width = stage.chain.link_width
    body = actuator.between[1]
    sectors = CHAINS if body == "platform" else (chain,)
    faces = [
        (draw_sector(stage, sector)[body], (sector - chain) * CHAIN_TURN) for sector in sectors
    ]
    outline = [  # the free edges of the body, which lies to their left
        segment.turned(angle)
        for face, angle in faces
        for segment, label in zip(face.loop, face.labels, strict=True)
        if label == "free"
    ]

    def checked(point: complex, direction: float) -> Stack:
        """Stack at a point. Raises BadInput, with the key of its position, off the outline or with
        an outward force.
        """
        distance, _, place, inward = nearest(outline, point)
        at = f"[{point.real:.4g}, {point.imag:.4g}]"
        of_chain = f"{body} of chain {chain}"
        on_link = not actuator.point
        if distance > ON_OUTLINE * width:
            key, value = (
                ("arm_mm", f"{actuator.arm:g}")
                if on_link
                else ("point_mm", f"{list(actuator.point or ())}")
            )
            raise BadInput(
                f"{key_of_actuator(stage, chain, index, key)} = {value}, contact off the body: "
                f"expected a point of the outline of {of_chain}, the nearest is "
                f"[{place.real:.4g}, {place.imag:.4g}]"
            )
        if (np.exp(1j * direction) * np.conj(inward)).real < LEAST_COSINE:
            key, angle = (
                ("tilt_deg", actuator.tilt or 0.0) if on_link else ("direction_deg", direction)
            )
            raise BadInput(
                f"{key_of_actuator(stage, chain, index, key)} = {np.rad2deg(angle):g}, not "
                f"directed into {of_chain} at {at}: expected within 84 degrees of "
                f"{np.rad2deg(np.angle(inward)) % 360:.4g}, the inward normal there"
            )
        return placed_stack(
            stage, chain - 1, actuator.between, point, direction, actuator.ball_radius or 0.0
        )

    if actuator.point is None or actuator.direction is None:
        first = checked(*_on_link(stage, chain, index))
    else:
        first = checked(complex(*actuator.point), actuator.direction)
    if not actuator.pair:
        return (first,)
    crossings = [
        t for segment in outline for t in _crossings(segment, first.point, first.direction)
    ]
    opposite = min((t for t in crossings if t > ON_OUTLINE * width), default=None)
    if opposite is None:
        raise BadInput(
            f"{key_of_actuator(stage, chain, index, 'pair')} = true: {body} of chain {chain} has "
            "no outline opposite to the contact, expected one for the second stack"
        )
    return first, checked(
        first.point + opposite * first.direction, float(np.angle(-first.direction))
    )


def _on_link(stage: StageContent, chain: int, index: int) -> tuple[complex, float]:
    """Point and direction of the force, rad, at an arm from a hinge. Raises BadInput for an arm
    outside the strip.
    """
    actuator = actuators_of(stage)[chain - 1][index]
    assert actuator.hinge is not None and actuator.arm is not None
    body = actuator.between[1]
    width = stage.chain.link_width
    path = centrelines(stage, chain)[BODY_NAMES.index(body)]
    length = sum(segment.length for segment in path)
    radius = stage.hinge(chain, actuator.hinge).radius
    s = actuator.arm - radius
    if not BESIDE * width < s < length - BESIDE * width:  # at a corner there is no normal
        raise BadInput(
            f"{key_of_actuator(stage, chain, index, 'arm_mm')} = {actuator.arm:g}, contact off "
            f"the link: expected between {radius:g} and {radius + length:.6g}, from notch to "
            f"notch of {body} of chain {chain}"
        )
    s = s if actuator.hinge == ENDS[body][0] else length - s
    for segment in path:
        if s <= segment.length or segment is path[-1]:
            break
        s -= segment.length
    share = min(s / segment.length, 1.0)
    outward = 1j * (1 if actuator.side == "left" else -1) * complex(segment.tangent(share))
    return complex(segment.at(share)) + outward * width / 2, float(np.angle(-outward)) + (
        actuator.tilt or 0.0
    )


def _crossings(segment: Segment, point: complex, direction: complex) -> list[float]:
    """Signed distances, mm, from a point to the intersections of a line through it with a segment."""
    start, end = ((z - point) / direction for z in (segment.start, segment.end))
    if segment.centre is None:
        if start.imag * end.imag > 0 or start.imag == end.imag:
            return []
        return [(start.real * end.imag - end.real * start.imag) / (end.imag - start.imag)]
    centre = (segment.centre - point) / direction
    radius = abs(segment.start - segment.centre)
    if abs(centre.imag) > radius:
        return []
    half_chord = np.sqrt(radius**2 - centre.imag**2)
    on_circle = [centre.real - half_chord, centre.real + half_chord]
    return [
        float(t)
        for t in on_circle
        if nearest([segment], point + t * direction).distance < 1e-9 * radius
    ]


STRAIGHT = 1e-12  # rad, and mm per mm: tolerance for two collinear necks
# margin at the ends of a link per link width; contacts within it are placed on the outline
BESIDE = 1e-6
SHAPE = (
    "link_lengths",
    "joint_angles",
    "link_width",
    "radius",
    "neck",
    "axis",
    "platform_radius",
    "hub_radius",
)


def drives_of(
    stage: StageContent, designs: Designs, reason: AnyArray, stage_at: Callable[[int], StageContent]
) -> ActuatorSet:
    """Return the drives of n designs, with stacks that have no stations.

    stage : with actuators; defines the stacks and the bodies between which they act.
    reason : (n,), reason of refusal, "" for a design not refused so far; reasons of the drive are
    added in place.
    stage_at : returns a design as a stage.
    """
    chains = actuators_of(stage)
    numbers = _numbers(designs)
    preload = numbers.preload
    limit = _blocking(numbers) * (1 + BLOCKING_ROUND_OFF)
    refused = {
        "preload_n: above the blocking force of the stack": preload > limit,
        "ball_radius_mm: a ball without preload": (preload == 0) & ~np.isnan(numbers.ball_radius),
    }
    for index, actuator in enumerate(chains[0]):
        for text, where in refused.items():
            reason[np.any(where[:, :, index], axis=1) & (reason == "")] = (
                f"actuator.{actuator.name}.{text}"
            )
    places = [(*place, chains[place[0]][place[1]]) for place in np.ndindex(numbers.arm.shape[1:])]
    wrenches = np.empty((*numbers.arm.shape[1:], len(numbers.arm), 3))
    stacks = list[Stack]()
    to_draw = np.zeros(len(numbers.arm), dtype=bool)
    for chain, index, actuator in places:
        wrenches[chain, index], valid, outside = _contact(designs, chain, index, actuator)
        reason[outside & (reason == "")] = f"actuator.{actuator.name}.arm_mm: contact off the link"
        to_draw |= ~valid
    _draw(designs, np.flatnonzero(to_draw & (reason == "")), wrenches, reason, stage_at)
    for chain, index, actuator in places:
        carrier, driven = (BODY_NAMES.index(body) for body in actuator.between)
        for q in (wrenches[chain, index], -wrenches[chain, index])[: 1 + actuator.pair]:
            stacks.append(Stack(chain, (Push(driven, q, None), Push(carrier, -q, None))))
    return _drive_with(stacks, designs, chains)


def _numbers(designs: Designs) -> ActuatorNumbers:
    """Numbers of the actuators of n designs, (n, 3 chains, actuators) each."""
    return ActuatorNumbers(*np.moveaxis(designs.actuator, -1, 0))


def _blocking(numbers: ActuatorNumbers) -> Array:
    return np.where(
        np.isnan(numbers.stiffness), numbers.blocking_force, numbers.stroke * numbers.stiffness
    )


def _contact(
    designs: Designs, chain: int, index: int, actuator: Actuator
) -> tuple[Array, AnyArray, AnyArray]:
    """Evaluate the first contact of an actuator of a chain (from 0) in closed form.

    Returns wrenches (n, 3) of one newton, frame of chain 1; where they are valid (n,); where off a
    straight link (n,)."""
    numbers = ActuatorNumbers(*(values[:, chain, index] for values in _numbers(designs)))
    if actuator.point is not None:
        nowhere = np.zeros(len(numbers.arm), dtype=bool)
        return (
            wrench_of(numbers.x + 1j * numbers.y, np.exp(1j * numbers.direction)),
            nowhere,
            nowhere,
        )
    first = BODY_NAMES.index(actuator.between[1]) - 1
    rotation = np.exp(-1j * CHAIN_TURN * chain)
    centres = (designs.frames.centres[:, chain] @ np.array([1, 1j])) * rotation
    along = np.exp(1j * designs.frames.axes[:, chain]) * rotation
    (begin, end), (e, last), (r, r_last) = (
        (values[:, first], values[:, first + 1])
        for values in (centres, along, designs.radius[:, chain])
    )
    apart = (end - begin) / e
    straight = (np.abs(last / e - 1) < STRAIGHT) & (np.abs(apart.imag) < STRAIGHT * np.abs(apart))
    width = designs.link_width
    length = apart.real - r - r_last
    straight &= length > 2 * FILLET * width * (1 + BESIDE)
    from_begin = actuator.hinge == ENDS[actuator.between[1]][0]
    arm = numbers.arm
    s = arm - r if from_begin else length - (arm - r_last)
    side = 1.0 if actuator.side == "left" else -1.0
    tilt = np.where(np.isnan(numbers.tilt), 0.0, numbers.tilt)
    opposite = s + side * width * np.tan(tilt) if actuator.pair else s
    gap = BESIDE * width
    outward = 1j * side * e
    inside = (np.minimum(s, opposite) > gap) & (np.maximum(s, opposite) < length - gap)
    middle = begin + arm * e if from_begin else end - arm * e
    wrench = wrench_of(middle + outward * width / 2, -outward * np.exp(1j * tilt))
    return wrench, straight & inside, straight & ((s < -gap) | (s > length + gap))


def _draw(
    designs: Designs,
    to_draw: AnyArray,
    wrenches: Array,
    reason: AnyArray,
    stage_at: Callable[[int], StageContent],
) -> None:
    """Set the wrenches (3, actuators, n, 3), or reasons of refusal, of the designs `to_draw` from
    their outlines.
    """
    if not len(to_draw):
        return
    shape = [getattr(designs, name)[to_draw].reshape(len(to_draw), -1) for name in SHAPE]
    shape.append(designs.actuator[to_draw][..., : len(GEOMETRY)].reshape(len(to_draw), -1))
    rows = np.nan_to_num(np.concatenate(shape, axis=1), nan=-1e300)
    _, firsts, group_of = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    for group, first in enumerate(firsts):
        members = to_draw[np.ravel(group_of) == group]
        try:
            drive = drive_of(stage_at(int(to_draw[first])))
        except BadInput as refusal:
            reason[members] = str(refusal)
            continue
        starts = np.argmax(drive.differential != 0, axis=0)  # the first stack of every command
        drawn = np.array([drive.stacks[k].pushes[0].wrench for k in starts])
        wrenches[:, :, members] = drawn.reshape(*wrenches.shape[:2], 1, 3)


def _drive_with(
    stacks: list[Stack], designs: Designs, chains: tuple[tuple[Actuator, ...], ...]
) -> ActuatorSet:
    """Return the drive of n designs with given stacks, by chain and actuator, the partners of a
    pair adjacent.
    """
    numbers = _numbers(designs)
    blocking = _blocking(numbers)
    rate = np.where(np.isnan(numbers.stiffness), blocking / numbers.stroke, numbers.stiffness)
    material = designs.youngs_modulus[:, None, None], designs.poissons_ratio[:, None, None]
    loose = np.array([[bool(actuator.ball_loose) for actuator in row] for row in chains])
    pair = np.array([actuator.pair for row in chains for actuator in row])
    owner = np.repeat(np.arange(len(pair)), 1 + pair)
    second = np.append(False, owner[1:] == owner[:-1])
    differential = np.zeros((len(stacks), len(pair)))
    differential[np.arange(len(stacks)), owner] = np.where(second, -1.0, 1.0)
    stroke = numbers.stroke.reshape(-1, len(pair))
    stiffness, preload, blocking = (
        values.reshape(-1, len(pair))[:, owner]
        for values in (series_stiffness(numbers, rate, *material, loose), numbers.preload, blocking)
    )
    return ActuatorSet(
        stacks=tuple(stacks),
        names=tuple(
            f"{actuator.name}, chain {chain + 1}"
            for chain, row in enumerate(chains)
            for actuator in row
        ),
        stiffness=stiffness,
        preload=preload,
        blocking_force=blocking,
        differential=differential,
        lowest=np.where(pair, -stroke / 2, 0.0 * stroke),
        highest=np.where(pair, stroke / 2, stroke),
        friction=np.array(
            [np.nan if one.friction is None else one.friction for row in chains for one in row]
        )[owner],
    )
