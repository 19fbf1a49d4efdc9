"""Contacts of the stacks of one stage, placed on the outlines of its bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.mechanism.outlines import Segment
from flexfem.paper.actuators import BODY_NAMES, ENDS
from flexfem.paper.bodies import centrelines, draw_sector
from flexfem.paper.contacts import Stack, nearest, placed_stack
from flexfem.paper.frames import CHAIN_TURN
from flexfem.paper.stage_file import CHAINS, StageContent, actuators_of, key_of_actuator
from flexfem.refused import BadInput

# distance of a contact from the outline of its body, per link width: coordinates are rounded
ON_OUTLINE = 0.01
STEEPEST = 84  # degrees from the inward normal, up to which a force may be tilted
LEAST_COSINE = 0.1  # of this angle
# margin at the ends of a link per link width: at a corner there is no normal
BESIDE = 1e-6
ON_ARC = 1e-9  # distance from an arc, per radius, at which a point of its circle is on it


class Contact(NamedTuple):
    """A point, complex, mm, and the direction of the force there, rad, in the frame of chain 1."""

    point: complex
    direction: float


def contacts(
    stage: StageContent,
    chain: int,
    index: int,
) -> tuple[Stack, ...]:
    """Stack of an actuator on one chain (1 to 3), followed by the partner of a pair.

    Raises BadInput for a contact off the outline of its body.
    """
    placing = _Placing(stage, chain, index)
    first = placing.stack_at(placing.stated)
    if not placing.actuator.pair:
        return (first,)
    return first, placing.stack_at(placing.opposite(first))


class _Placing:
    """An actuator of one chain, and the outline of the body that it pushes."""

    def __init__(
        self,
        stage: StageContent,
        chain: int,
        index: int,
    ) -> None:
        self.stage = stage
        self.chain = chain
        self.index = index
        self.actuator = actuators_of(stage)[chain - 1][index]
        self.body = self.actuator.between[1]
        self.name = f"{self.body} of chain {chain}"
        self.margin = ON_OUTLINE * stage.chain.link_width
        self.outline = _free_edges(stage, chain, self.body)

    def key(self, name: str) -> str:
        """Return the key path of a number of the actuator."""
        return key_of_actuator(self.stage, self.chain, self.index, name)

    @property
    def stated(self) -> Contact:
        """The contact that the file states. Raises BadInput for an arm outside the link."""
        actuator = self.actuator
        if actuator.point is None or actuator.direction is None:
            return self._on_link()
        return Contact(complex(*actuator.point), actuator.direction)

    def _on_link(self) -> Contact:
        """Return the contact at an arm from a hinge. Raises BadInput for an arm off the link."""
        actuator = self.actuator
        assert actuator.hinge is not None and actuator.arm is not None
        path = centrelines(self.stage, self.chain)[BODY_NAMES.index(self.body)]
        length = sum(segment.length for segment in path)
        radius = self.stage.hinge(self.chain, actuator.hinge).radius
        width = self.stage.chain.link_width
        along = actuator.arm - radius
        if not BESIDE * width < along < length - BESIDE * width:
            raise BadInput(
                f"{self.key('arm_mm')} = {actuator.arm:g}, contact off the link: expected between "
                f"{radius:g} and {radius + length:.6g}, from notch to notch of {self.name}"
            )
        if actuator.hinge != ENDS[self.body][0]:
            along = length - along
        segment, share = _at(path, along)
        side = 1 if actuator.side == "left" else -1
        outward = 1j * side * complex(segment.tangent(share))
        point = complex(segment.at(share)) + outward * width / 2
        return Contact(point, float(np.angle(-outward)) + (actuator.tilt or 0.0))

    def stack_at(self, contact: Contact) -> Stack:
        """Return a stack at a contact.

        Raises BadInput, with the key of its position, off the outline or with an outward force.
        """
        point, direction = contact
        found = nearest(self.outline, point)
        if found.distance > self.margin:
            raise self._off_body(found.place)
        if (np.exp(1j * direction) * np.conj(found.normal)).real < LEAST_COSINE:
            raise self._outwards(contact, found.normal)
        actuator = self.actuator
        ball = actuator.ball_radius or 0.0
        return placed_stack(self.stage, self.chain - 1, actuator.between, point, direction, ball)

    def _off_body(self, near: complex) -> BadInput:
        """Return the refusal of a contact off its body, of which a point is near."""
        actuator = self.actuator
        if actuator.point:
            stated = f"{self.key('point_mm')} = {list(actuator.point)}"
        else:
            stated = f"{self.key('arm_mm')} = {actuator.arm:g}"
        return BadInput(
            f"{stated}, contact off the body: expected a point of the outline of {self.name}, the "
            f"nearest is [{near.real:.4g}, {near.imag:.4g}]"
        )

    def _outwards(
        self,
        contact: Contact,
        inward: complex,
    ) -> BadInput:
        """Return the refusal of a force that is not directed into the body."""
        key = "direction_deg"
        angle = contact.direction
        if not self.actuator.point:
            key = "tilt_deg"
            angle = self.actuator.tilt or 0.0
        at = f"[{contact.point.real:.4g}, {contact.point.imag:.4g}]"
        normal = np.rad2deg(np.angle(inward)) % 360
        return BadInput(
            f"{self.key(key)} = {np.rad2deg(angle):g}, not directed into {self.name} at {at}: "
            f"expected within {STEEPEST} degrees of {normal:.4g}, the inward normal there"
        )

    def opposite(self, first: Stack) -> Contact:
        """Return the contact of the partner of a stack. Raises BadInput where there is no edge."""
        distances = [
            distance
            for segment in self.outline
            for distance in _crossings(segment, first.point, first.direction)
            if distance > self.margin
        ]
        if not distances:
            raise BadInput(
                f"{self.key('pair')} = true: {self.name} has no outline opposite to the contact, "
                "expected one for the second stack"
            )
        point = first.point + min(distances) * first.direction
        return Contact(point, float(np.angle(-first.direction)))


def _free_edges(
    stage: StageContent,
    chain: int,
    body: str,
) -> list[Segment]:
    """Return the free edges of a body, which lies to their left, in the frame of chain 1."""
    edges = list[Segment]()
    for sector in CHAINS if body == "platform" else (chain,):
        face = draw_sector(stage, sector)[body]
        angle = (sector - chain) * CHAIN_TURN
        for segment, label in zip(face.loop, face.labels, strict=True):
            if label == "free":
                edges.append(segment.turned(angle))
    return edges


def _at(path: tuple[Segment, ...], along: float) -> tuple[Segment, float]:
    """Return the segment, and the share of its length, at a distance along a path, mm."""
    for segment in path:
        if along <= segment.length or segment is path[-1]:
            break
        along -= segment.length
    return segment, min(along / segment.length, 1.0)


def _crossings(
    segment: Segment,
    point: complex,
    direction: complex,
) -> list[float]:
    """Signed distances, mm, from a point to the intersections of a line through it with a segment."""
    if segment.centre is None:
        start = (segment.start - point) / direction
        end = (segment.end - point) / direction
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
        float(distance)
        for distance in on_circle
        if nearest([segment], point + distance * direction).distance < ON_ARC * radius
    ]
