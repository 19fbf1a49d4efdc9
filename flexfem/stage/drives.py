"""The drive of a stage: every stack of every chain in its place, with what it can do and how it is commanded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.refused import BadInput
from flexfem.stage.actuators import BODY_NAMES, ENDS, Actuator
from flexfem.stage.bodies import centrelines, draw_sector, turn
from flexfem.stage.cache import once
from flexfem.stage.contacts import Stack, middle_at, placed_stack, tangent_at
from flexfem.stage.content import StageContent, actuators_of, key_of_actuator
from flexfem.stage.designs import chain_rotation
from flexfem.stage.origin import located
from flexfem.stage.outline import Segment
from flexfem.stage.tables import CHAINS

ON_OUTLINE = 0.01  # distance of a contact from the outline of its body, per link width: coordinates are rounded
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
        return _drive(stage)


def check_drive(stage: StageContent) -> None:
    """Raise BadInput for the first contact that is not on the outline of the body it pushes, or not into it."""
    if stage.actuator:
        drive_of(stage)


def _drive(stage: StageContent) -> StageDrive:
    placed = [(chain, index) for chain in CHAINS for index in range(len(stage.actuator))]
    actuators = [actuators_of(stage)[chain - 1][index] for chain, index in placed]
    stacks, owners, signs = list[Stack](), list[int](), list[float]()
    for command, (chain, index) in enumerate(placed):
        for side, contact in enumerate(contacts(stage, chain, index)):
            of = actuators[command]
            stacks.append(placed_stack(stage, chain - 1, of.between, *contact, of.ball_radius or 0.0))
            owners.append(command)
            signs.append(1.0 - 2.0 * side)
    differential = np.zeros((len(stacks), len(placed)))
    differential[np.arange(len(stacks)), owners] = signs
    limits = np.array([_limits(actuator) for actuator in actuators])
    return StageDrive(
        stacks=tuple(stacks),
        names=tuple(f"{stage.actuator[index].name}, chain {chain}" for chain, index in placed),
        stiffness=np.array([actuators[k].stiffness_with(stage.material) for k in owners]),
        preload=np.array([actuators[k].preload for k in owners]),
        blocking_force=np.array([actuators[k].rating.blocking_force for k in owners]),
        differential=differential,
        lowest=limits[:, 0],
        highest=limits[:, 1],
        friction=np.array([np.nan if actuators[k].friction is None else actuators[k].friction for k in owners]),
    )


def _limits(actuator: Actuator) -> tuple[float, float]:
    """Least and largest command, mm: that of a pair is about the middle of its strokes."""
    stroke = actuator.rating.stroke
    return (-stroke / 2, stroke / 2) if actuator.pair else (0.0, stroke)


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
    outline = _outline(stage, chain, body)
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
    body, width = actuator.between[1], stage.chain.link_width
    path = centrelines(stage, chain)[BODY_NAMES.index(body)]
    length, radius = sum(segment.length for segment in path), stage.hinge(chain, actuator.hinge).radius
    s = actuator.arm - radius
    if not 0 <= s <= length:
        raise BadInput(
            f"{_place_of(stage, chain, index)}, contact off the metal: expected {radius:g} to "
            f"{radius + length:.6g}, from notch to notch of {body} of chain {chain}"
        )
    s = s if actuator.hinge == ENDS[body][0] else length - s
    for segment in path:
        if s <= segment.length or segment is path[-1]:
            break
        s -= segment.length
    share = np.array(min(s / segment.length, 1.0))
    outward = 1j * (1 if actuator.side == "left" else -1) * complex(tangent_at(segment, share))
    point = complex(middle_at(segment, share)) + outward * width / 2
    return Contact(point, float(np.angle(-outward)) + (actuator.tilt or 0.0))


def _check_contact(stage: StageContent, chain: int, index: int, contact: Contact, outline: list[Segment]) -> None:
    actuator, (point, direction) = actuators_of(stage)[chain - 1][index], contact
    body = f"{actuator.between[1]} of chain {chain}"
    distance, nearest, inward = min((_nearest(segment, point) for segment in outline), key=lambda found: found[0])
    if distance > ON_OUTLINE * stage.chain.link_width:
        raise BadInput(
            f"{_place_of(stage, chain, index)}, contact off the metal: expected a point of the outline of {body}, the "
            f"nearest is [{nearest.real:.4g}, {nearest.imag:.4g}]"
        )
    if (np.exp(1j * direction) * np.conj(inward)).real < INTO:
        key, turned = ("tilt_deg", actuator.tilt) if actuator.direction is None else ("direction_deg", direction)
        normal = np.rad2deg(np.angle(inward)) % 360
        said = f"{key_of_actuator(stage, chain, index, key)} = {np.rad2deg(turned or 0.0):g}"
        raise BadInput(
            f"{said}, not into the metal of {body} at "
            f"[{point.real:.4g}, {point.imag:.4g}]: expected within 84 degrees of {normal:.4g}, the inward normal there"
        )


def _place_of(stage: StageContent, chain: int, index: int) -> str:
    """The key that says where a contact is, and its value."""
    actuator = actuators_of(stage)[chain - 1][index]
    if actuator.point is None:
        return f"{key_of_actuator(stage, chain, index, 'arm_mm')} = {actuator.arm:g}"
    return f"{key_of_actuator(stage, chain, index, 'point_mm')} = {list(actuator.point)}"


def _outline(stage: StageContent, chain: int, body: str) -> list[Segment]:
    """The free edges of a body of a chain, metal to their left, in the frame of chain 1; the platform's all around."""
    if body != "platform":
        return _free(stage, chain, body)
    back = np.exp(-1j * np.angle(complex(*chain_rotation(chain - 1)[:2, 0])))
    turned = [segment for each in CHAINS for segment in turn(_free(stage, each, body), each)]
    return [segment.turned(float(np.angle(back))) for segment in turned]


def _free(stage: StageContent, chain: int, body: str) -> list[Segment]:
    face = draw_sector(stage, chain)[body]
    return [segment for segment, label in zip(face.loop, face.labels, strict=True) if label == "free"]


def _nearest(segment: Segment, point: complex) -> tuple[float, complex, complex]:
    """Distance of a point from a line or arc, mm, the nearest point of it, and the unit normal to its left there."""
    if segment.centre is None:
        along = (segment.end - segment.start) / segment.length
        s = min(max(((point - segment.start) / along).real, 0.0), segment.length)
        found = segment.start + s * along
        return abs(point - found), found, 1j * along
    spoke = segment.start - segment.centre
    swept = float(np.angle((point - segment.centre) / spoke * np.exp(-0.5j * segment.turn)))
    half = abs(segment.turn) / 2
    away = spoke * np.exp(1j * (segment.turn / 2 + min(max(swept, -half), half)))
    return abs(point - segment.centre - away), segment.centre + away, -np.sign(segment.turn) * away / abs(away)


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
    return [float(t) for t in found if _nearest(segment, point + t * push)[0] < 1e-9 * radius]
