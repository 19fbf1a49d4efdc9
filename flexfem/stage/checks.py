"""What cannot exist is refused here, before any meshing: closed forms first, then polygons."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import shapely

from flexfem.refused import BadInput
from flexfem.stage.bodies import draw_sector, turn
from flexfem.stage.cache import once
from flexfem.stage.conditions import PLACES, Conditions, conditions, describe
from flexfem.stage.frames import stage_frames
from flexfem.stage.origin import located
from flexfem.stage.outline import polygon_points
from flexfem.stage.tables import HINGE_NAMES, key_of

if TYPE_CHECKING:
    from flexfem.stage.schema import Stage

TOUCHING = 1e-6  # mm^2; round-off of polygons that share an edge


def check_feasible(stage: Stage) -> None:
    """Refuse a stage that cannot be made, looked at once. Raises BadInput with key, value and what was expected."""
    check_closed_form(stage)
    _raise(_refused(stage, _check_bodies))


def check_closed_form(stage: Stage) -> None:
    """Refuse a stage that breaks one of `conditions`. Raises BadInput as `check_feasible`, which also draws."""
    _raise(_refused(stage, _check_conditions))


def _raise(refused: BadInput | None) -> None:
    if refused:
        raise refused


@once
def _refused(stage: Stage, check: Callable[[Stage], None]) -> BadInput | None:
    """What a check says of a stage, looked at once."""
    try:
        with located(stage):
            check(stage)
    except BadInput as refusal:
        return refusal
    return None


def _check_conditions(stage: Stage) -> None:
    radius, neck = stage.array("radius"), stage.array("neck")
    sizes = (stage.chain.link_width, stage.platform.radius, stage.platform.hub_radius)
    found = conditions(stage_frames(stage).centres, radius, neck, *sizes)
    _check_notches(stage, found)
    _check_platform(stage, found)
    _check_distances(stage, found)


def _check_notches(stage: Stage, found: Conditions) -> None:
    width = stage.chain.link_width
    for chain, position in PLACES:
        name = HINGE_NAMES[position]
        hinge = stage.hinge(chain + 1, name)
        if not found.neck_narrow[chain, position]:
            raise BadInput(
                f"{key_of(stage, chain + 1, name, 'neck_mm')} = {hinge.neck:g}, neck as wide as the link, "
                f"expected < chain.link_width_mm = {width:g}"
            )
        if not found.notch_fits[chain, position]:
            raise BadInput(
                f"{key_of(stage, chain + 1, name, 'radius_mm')} = {hinge.radius:g}, notch deeper than the link, "
                f"expected <= (link_width - neck)/2 = {found.deepest[chain, position]:g}"
            )


def _check_platform(stage: Stage, found: Conditions) -> None:
    disc, hub = stage.platform.radius, stage.platform.hub_radius
    if not found.hub_fits:
        raise BadInput(
            f"platform.hub_radius_mm = {hub:g}, hub larger than the platform, expected < platform.radius_mm = {disc:g}"
        )
    for chain, position in PLACES:
        if not found.clear[chain, position]:
            hinge = stage.hinge(chain + 1, HINGE_NAMES[position])
            raise BadInput(
                f"platform.radius_mm = {disc:g}, the platform swallows the {HINGE_NAMES[position]} hinge of chain "
                f"{chain + 1}, expected < {found.distance[chain, position] - hinge.radius - hinge.neck / 2:g} "
                "(distance of the hinge from the platform centre less its notch)"
            )


def _check_distances(stage: Stage, found: Conditions) -> None:
    for pair in np.flatnonzero(~found.apart):
        raise BadInput(
            f"chain.link_lengths_mm = {list(stage.chain.link_lengths)}, hinges closer than their radii: "
            f"{describe(int(pair))} are {found.gap[pair]:.4g} mm apart, expected > {found.radii[pair]:g}"
        )


def _check_bodies(stage: Stage) -> None:
    """No body crosses itself, and bodies meet only at their necks and at the cuts between the thirds."""
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
