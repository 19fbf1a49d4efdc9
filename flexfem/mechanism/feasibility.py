"""What cannot exist is refused here, before any meshing: closed-form conditions of n designs, then polygons of one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations, combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.mechanism.bodies import draw_sector, polygon_points, turn
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage_file import HINGE_NAMES, StageContent, key_of, located
from flexfem.refused import BadInput

Holds = NDArray[np.bool_]

PAIRS = list(combinations(product(range(3), range(3)), 2))  # of hinges, (chain, position)
_FIRST, _SECOND = (np.array([places[k] for places in PAIRS]).T for k in (0, 1))
TOUCHING = 1e-6  # mm^2; round-off of polygons that share an edge
_ROUND_OFF = 1e-12  # the deepest radius is a difference of decimals


class Broken(NamedTuple):
    """One condition in words, and the designs (n,) that break it."""

    reason: str
    where: Holds


class Condition(NamedTuple):
    """What must hold of n designs at p places, such as the hinges of one name on three chains.

    reason : the key, and what is wrong.   room : (n, p), mm, what is left; negative where the condition is broken.
    said : of a stage, a place and its room there: the key of the file, its value, and what else a refusal says.
    """

    reason: str
    holds: Holds
    room: Array
    said: Callable[[StageContent, int, float], tuple[str, object, str]]


def conditions(designs: Designs) -> list[Condition]:
    """Evaluate all conditions of n designs, in the order in which one stage is refused for them."""
    radius, neck, disc, centres = designs.radius, designs.neck, designs.platform_radius, designs.frames.centres
    width = designs.link_width[:, None, None]
    deepest = (width - neck) / 2
    x, y = centres[..., 0], centres[..., 1]
    clear = np.hypot(x, y) - (disc[:, None, None] + radius + neck / 2)
    gap = np.hypot(x[..., *_FIRST] - x[..., *_SECOND], y[..., *_FIRST] - y[..., *_SECOND])
    apart = gap - (radius[..., *_FIRST] + radius[..., *_SECOND])
    narrow, fits, found = width - neck, radius <= deepest * (1 + _ROUND_OFF), list[Condition]()
    for k, name in enumerate(HINGE_NAMES):
        key, at = f"hinges.{name}", (..., k)
        reason, room = f"{key}.neck_mm: neck as wide as the link", narrow[at]
        found.append(Condition(reason, room > 0, room, partial(_neck, name)))
        reason = f"{key}.radius_mm: notch deeper than the link"
        found.append(Condition(reason, fits[at], (deepest - radius)[at], partial(_notch, name)))
    hub = (disc - designs.hub_radius)[:, None]
    found.append(Condition("platform.hub_radius_mm: hub larger than the platform", hub > 0, hub, _hub))
    for k, name in enumerate(HINGE_NAMES):
        reason, room = f"platform.radius_mm: the platform swallows the {name} hinge", clear[..., k]
        found.append(Condition(reason, room > 0, room, _swallows))
    for one, other in combinations_with_replacement(range(len(HINGE_NAMES)), 2):
        pairs = [k for k, (a, b) in enumerate(PAIRS) if {a[1], b[1]} == {one, other}]
        names = f"{HINGE_NAMES[one]} and {HINGE_NAMES[other]} hinges" if one != other else f"{HINGE_NAMES[one]} hinges"
        reason, room = f"chain.link_lengths_mm: {names} closer than their radii", apart[:, pairs]
        found.append(Condition(reason, room > 0, room, partial(_closer, pairs)))
    return found


def broken(found: list[Condition]) -> list[Broken]:
    """Every condition by its reason, and which designs break it."""
    return [Broken(each.reason, ~np.all(each.holds, axis=-1)) for each in found]


def _neck(name: str, stage: StageContent, chain: int, room: float) -> tuple[str, object, str]:
    expected = f", expected < chain.link_width_mm = {stage.chain.link_width:g}"
    return key_of(stage, chain + 1, name, "neck_mm"), f"{stage.hinge(chain + 1, name).neck:g}", expected


def _notch(name: str, stage: StageContent, chain: int, room: float) -> tuple[str, object, str]:
    radius = stage.hinge(chain + 1, name).radius
    expected = f", expected <= (link_width - neck)/2 = {radius + room:g}"
    return key_of(stage, chain + 1, name, "radius_mm"), f"{radius:g}", expected


def _hub(stage: StageContent, _: int, room: float) -> tuple[str, object, str]:
    expected = f", expected < platform.radius_mm = {stage.platform.radius:g}"
    return "platform.hub_radius_mm", f"{stage.platform.hub_radius:g}", expected


def _swallows(stage: StageContent, chain: int, room: float) -> tuple[str, object, str]:
    far = f"{stage.platform.radius + room:g} (distance of the hinge from the platform centre less its notch)"
    return "platform.radius_mm", f"{stage.platform.radius:g}", f" of chain {chain + 1}, expected < {far}"


def _closer(pairs: list[int], stage: StageContent, place: int, room: float) -> tuple[str, object, str]:
    ends = [(chain + 1, HINGE_NAMES[position]) for chain, position in PAIRS[pairs[place]]]
    radii = sum(stage.hinge(*end).radius for end in ends)
    names = " and ".join(f"{name} hinge of chain {chain}" for chain, name in ends)
    expected = f": {names} are {radii + room:.4g} mm apart, expected > {radii:g}"
    return "chain.link_lengths_mm", list(stage.chain.link_lengths), expected


def check_feasible(stage: StageContent) -> None:
    """Refuse a stage that cannot be made, looked at once. Raises BadInput with key, value and what was expected."""
    check_closed_form(stage)
    _raise_refused(stage, _check_bodies)


def check_closed_form(stage: StageContent) -> None:
    """Refuse a stage that breaks one of `conditions`. Raises BadInput as `check_feasible`, which also draws."""
    if not isinstance(stage, StageContent):
        raise BadInput(f"{stage!r}, expected a flexfem.Stage, as flexfem.load gives it for a file")
    _raise_refused(stage, _check_conditions)


def _raise_refused(stage: StageContent, check: Callable[[StageContent], None]) -> None:
    if refused := _refused(stage, check):
        raise refused


@once
def _refused(stage: StageContent, check: Callable[[StageContent], None]) -> BadInput | None:
    """What a check says of a stage."""
    try:
        with located(stage):
            check(stage)
    except BadInput as refusal:
        return refusal
    return None


def _check_conditions(stage: StageContent) -> None:
    for each in conditions(lower(stage)):
        for place in np.flatnonzero(~each.holds[0]):
            key, value, expected = each.said(stage, int(place), float(each.room[0, place]))
            raise BadInput(f"{key} = {value}, {each.reason.partition(': ')[2]}{expected}")


def _check_bodies(stage: StageContent) -> None:
    """No body crosses itself, and bodies meet only at their necks and at the cuts between the sectors."""
    bodies = {}
    for chain in (1, 2, 3):
        for body, face in draw_sector(stage, chain).items():
            bodies[f"{body} of chain {chain}"] = shapely.Polygon(polygon_points(turn(face.loop, chain)))
    size = (
        f"at chain.link_lengths_mm = {list(stage.chain.link_lengths)}, chain.link_width_mm = "
        f"{stage.chain.link_width:g}, platform.radius_mm = {stage.platform.radius:g}"
    )
    for name, outline in bodies.items():
        if not outline.is_valid:
            raise BadInput(f"chain: {name} overlaps itself {size}, expected an outline that does not cross itself")
    for (one, first), (other, second) in combinations(bodies.items(), 2):
        if first.intersects(second) and first.intersection(second).area > TOUCHING:
            raise BadInput(f"chain: {one} and {other} overlap {size}, expected bodies that meet only at their hinges")
