"""What cannot exist is refused here, before any meshing: closed-form conditions of n designs, then polygons of one."""

from __future__ import annotations

from itertools import combinations, combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.mechanism.bodies import draw_sector, turn
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.outlines import polygon_points
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

    key : of the file.   wrong : in words.   expected : in words, with the limit of the value.
    value : (n, p), mm, of the key, of pairs of hinges the sum of their radii.   room : (n, p), mm, up to the limit.
    pairs : places in `PAIRS`, of conditions on pairs of hinges.
    """

    key: str
    wrong: str
    expected: str
    value: Array
    room: Array
    pairs: tuple[int, ...] = ()

    @property
    def broken(self) -> Broken:
        """Which designs break it."""
        return Broken(f"{self.key}: {self.wrong}", ~np.all(self.room > 0, axis=-1))


def conditions(designs: Designs) -> list[Condition]:
    """Evaluate all conditions of n designs, in the order in which one stage is refused for them."""
    radius, neck, disc, centres = designs.radius, designs.neck, designs.platform_radius[:, None], designs.frames.centres
    width = designs.link_width[:, None, None]
    x, y = centres[..., 0], centres[..., 1]
    deeper = (width - neck) / 2 * (1 + _ROUND_OFF) - radius
    clear = np.hypot(x, y) - (disc[..., None] + radius + neck / 2)
    radii = radius[..., *_FIRST] + radius[..., *_SECOND]
    apart = np.hypot(x[..., *_FIRST] - x[..., *_SECOND], y[..., *_FIRST] - y[..., *_SECOND]) - radii
    hub, discs, found = designs.hub_radius[:, None], np.repeat(disc, 3, axis=1), list[Condition]()
    for k, name in enumerate(HINGE_NAMES):
        key, wrong, limit = f"hinges.{name}.neck_mm", "neck as wide as the link", "< chain.link_width_mm = {:g}"
        found.append(Condition(key, wrong, limit, neck[..., k], (width - neck)[..., k]))
        key, wrong, limit = f"hinges.{name}.radius_mm", "notch deeper than the link", "<= (link_width - neck)/2 = {:g}"
        found.append(Condition(key, wrong, limit, radius[..., k], deeper[..., k]))
    wrong, limit = "hub larger than the platform", "< platform.radius_mm = {:g}"
    found.append(Condition("platform.hub_radius_mm", wrong, limit, hub, disc - hub))
    for k, name in enumerate(HINGE_NAMES):
        wrong = f"the platform swallows the {name} hinge"
        limit = "< {:g} (distance of the hinge from the platform centre less its notch)"
        found.append(Condition("platform.radius_mm", wrong, limit, discs, clear[..., k]))
    for one, other in combinations_with_replacement(range(len(HINGE_NAMES)), 2):
        pairs = tuple(k for k, (a, b) in enumerate(PAIRS) if {a[1], b[1]} == {one, other})
        wrong = f"{' and '.join(dict.fromkeys((HINGE_NAMES[one], HINGE_NAMES[other])))} hinges closer than their radii"
        found.append(Condition("chain.link_lengths_mm", wrong, "> {:g}", radii[:, pairs], apart[:, pairs], pairs))
    return found


def check_feasible(stage: StageContent) -> None:
    """Refuse a stage that cannot be made, looked at once. Raises BadInput with key, value and what was expected."""
    check_closed_form(stage)
    with located(stage):
        _check_bodies(stage)


def check_closed_form(stage: StageContent) -> None:
    """Refuse a stage that breaks one of `conditions`. Raises BadInput as `check_feasible`, which also draws."""
    if not isinstance(stage, StageContent):
        raise BadInput(f"{stage!r}, expected a flexfem.Stage, as flexfem.load gives it for a file")
    with located(stage):
        _check_conditions(stage)


@once
def _check_conditions(stage: StageContent) -> None:
    for each in conditions(lower(stage)):
        for place in np.flatnonzero(~(each.room[0] > 0)).tolist():
            value, limit = each.value[0, place], each.value[0, place] + each.room[0, place]
            if each.pairs:
                ends = PAIRS[each.pairs[place]]
                names = " and ".join(f"{HINGE_NAMES[position]} hinge of chain {chain + 1}" for chain, position in ends)
                said = f"{list(stage.chain.link_lengths)}, {each.wrong}: {names} are {limit:.4g} mm apart"
                raise BadInput(f"{each.key} = {said}, expected {each.expected.format(value)}")
            table, *hinge, key = each.key.split(".")
            path = key_of(stage, place + 1, hinge[0], key) if hinge else each.key
            chain = f" of chain {place + 1}" if table == "platform" and len(each.room[0]) > 1 else ""
            raise BadInput(f"{path} = {value:g}, {each.wrong}{chain}, expected {each.expected.format(limit)}")


@once
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
