"""What cannot exist is refused here, before any meshing: closed-form conditions of n designs, then polygons of one."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
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

PLACES = [(chain, position) for chain in range(3) for position in range(3)]
PAIRS = list(combinations(PLACES, 2))
_FIRST, _SECOND = (np.array([places[k] for places in PAIRS]).T for k in (0, 1))
TOUCHING = 1e-6  # mm^2; round-off of polygons that share an edge
_ROUND_OFF = 1e-12  # the deepest radius is a difference of decimals


class Conditions(NamedTuple):
    """What holds of n designs, and the lengths (mm) it depends on.

    Attributes
    ----------
    neck_narrow : (n, 3 chains, 3 hinges), the neck is narrower than the link.
    notch_fits : (n, 3, 3), the notch is no deeper than the link, its radius at most `deepest` (n, 3, 3).
    hub_fits : (n,), the hub is smaller than the platform.
    clear : (n, 3, 3), the hinge is outside the platform: its `distance` (n, 3, 3) from the centre exceeds the
        platform's radius and half its own height.
    apart : (n, 36), the hinges of each of `PAIRS` are farther apart, `gap` (n, 36), than their `radii` together.
    """

    neck_narrow: Holds
    notch_fits: Holds
    deepest: Array
    hub_fits: Holds
    clear: Holds
    distance: Array
    apart: Holds
    gap: Array
    radii: Array


class Broken(NamedTuple):
    """One condition in words, and the designs (n,) that break it."""

    reason: str
    where: Holds


def conditions(designs: Designs) -> Conditions:
    """Evaluate the conditions of n designs."""
    radius, neck, disc, centres = designs.radius, designs.neck, designs.platform_radius, designs.frames.centres
    width = designs.link_width[:, None, None]
    deepest = (width - neck) / 2
    x, y = centres[..., 0], centres[..., 1]
    distance = np.hypot(x, y)
    gap = np.hypot(x[..., *_FIRST] - x[..., *_SECOND], y[..., *_FIRST] - y[..., *_SECOND])
    radii = radius[..., *_FIRST] + radius[..., *_SECOND]
    return Conditions(
        neck_narrow=neck < width,
        notch_fits=radius <= deepest * (1 + _ROUND_OFF),
        deepest=deepest,
        hub_fits=designs.hub_radius < disc,
        clear=distance > disc[:, None, None] + radius + neck / 2,
        distance=distance,
        apart=gap > radii,
        gap=gap,
        radii=radii,
    )


def broken(found: Conditions) -> list[Broken]:
    """Every condition by its reason, the key first, and which designs break it, in the order of `check_feasible`."""
    of_hinge = {
        "neck_mm: neck as wide as the link": found.neck_narrow,
        "radius_mm: notch deeper than the link": found.notch_fits,
    }
    all_broken = [
        Broken(f"hinges.{name}.{reason}", ~np.all(holds[..., position], axis=-1))
        for position, name in enumerate(HINGE_NAMES)
        for reason, holds in of_hinge.items()
    ]
    all_broken.append(Broken("platform.hub_radius_mm: hub larger than the platform", ~found.hub_fits))
    for position, name in enumerate(HINGE_NAMES):
        reason = f"platform.radius_mm: the platform swallows the {name} hinge"
        all_broken.append(Broken(reason, ~np.all(found.clear[..., position], axis=-1)))
    for one, other in sorted({(min(a[1], b[1]), max(a[1], b[1])) for a, b in PAIRS}):
        pairs = [k for k, (a, b) in enumerate(PAIRS) if {a[1], b[1]} == {one, other}]
        names = f"{HINGE_NAMES[one]} and {HINGE_NAMES[other]} hinges" if one != other else f"{HINGE_NAMES[one]} hinges"
        reason = f"chain.link_lengths_mm: {names} closer than their radii"
        all_broken.append(Broken(reason, ~np.all(found.apart[..., pairs], axis=-1)))
    return all_broken


def describe(pair: int) -> str:
    """The two hinges of a pair, "base hinge of chain 1 and elbow hinge of chain 2"."""
    return " and ".join(f"{HINGE_NAMES[position]} hinge of chain {chain + 1}" for chain, position in PAIRS[pair])


def check_feasible(stage: StageContent) -> None:
    """Refuse a stage that cannot be made, looked at once. Raises BadInput with key, value and what was expected."""
    check_closed_form(stage)
    _raise(_refused(stage, _check_bodies))


def check_closed_form(stage: StageContent) -> None:
    """Refuse a stage that breaks one of `conditions`. Raises BadInput as `check_feasible`, which also draws."""
    if not isinstance(stage, StageContent):
        raise BadInput(f"{stage!r}, expected a flexfem.Stage, as flexfem.load gives it for a file")
    _raise(_refused(stage, _check_conditions))


def _raise(refused: BadInput | None) -> None:
    if refused:
        raise refused


@once
def _refused(stage: StageContent, check: Callable[[StageContent], None]) -> BadInput | None:
    """What a check says of a stage, looked at once."""
    try:
        with located(stage):
            check(stage)
    except BadInput as refusal:
        return refusal
    return None


def _check_conditions(stage: StageContent) -> None:
    found = conditions(lower(stage))
    one = Conditions(*(part[0] for part in found))
    _check_notches(stage, one)
    _check_platform(stage, one)
    _check_distances(stage, one)


def _check_notches(stage: StageContent, found: Conditions) -> None:
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


def _check_platform(stage: StageContent, found: Conditions) -> None:
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


def _check_distances(stage: StageContent, found: Conditions) -> None:
    for pair in np.flatnonzero(~found.apart):
        raise BadInput(
            f"chain.link_lengths_mm = {list(stage.chain.link_lengths)}, hinges closer than their radii: "
            f"{describe(int(pair))} are {found.gap[pair]:.4g} mm apart, expected > {found.radii[pair]:g}"
        )


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
