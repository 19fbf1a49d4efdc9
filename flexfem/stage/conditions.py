"""The closed-form conditions of a stage that can be made, of any number of designs at once."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexfem.arrays import Array
from flexfem.stage.tables import HINGE_NAMES

Holds = NDArray[np.bool_]

PLACES = [(chain, position) for chain in range(3) for position in range(3)]
PAIRS = list(combinations(PLACES, 2))
_FIRST, _SECOND = (np.array([places[k] for places in PAIRS]).T for k in (0, 1))
_ROUND_OFF = 1e-12  # the deepest radius is a difference of decimals


class Conditions(NamedTuple):
    """What holds, and the lengths (mm) it depends on; leading axes are designs.

    Attributes
    ----------
    neck_narrow : (..., 3 chains, 3 hinges), the neck is narrower than the link.
    notch_fits : (..., 3, 3), the notch is no deeper than the link, its radius at most `deepest` (..., 3, 3).
    hub_fits : (...), the hub is smaller than the platform.
    clear : (..., 3, 3), the hinge is outside the platform: its `distance` (..., 3, 3) from the centre exceeds the
        platform's radius and half its own height.
    apart : (..., 36), the hinges of each of `PAIRS` are farther apart, `gap` (..., 36), than their `radii` together.
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
    """One condition in words, and the designs (...) that break it."""

    reason: str
    where: Holds


def conditions(
    centres: Array, radius: Array, neck: Array, link_width: ArrayLike, platform_radius: ArrayLike, hub_radius: ArrayLike
) -> Conditions:
    """Evaluate the conditions of designs.

    Parameters
    ----------
    centres : (..., 3, 3, 2) of the hinges; `radius`, `neck` : (..., 3, 3); the others (...). All in mm.
    """
    width, disc = (np.asarray(value, dtype=float)[..., None, None] for value in (link_width, platform_radius))
    deepest = (width - neck) / 2
    x, y = centres[..., 0], centres[..., 1]
    distance = np.hypot(x, y)
    gap = np.hypot(x[..., *_FIRST] - x[..., *_SECOND], y[..., *_FIRST] - y[..., *_SECOND])
    radii = radius[..., *_FIRST] + radius[..., *_SECOND]
    return Conditions(
        neck_narrow=neck < width,
        notch_fits=radius <= deepest * (1 + _ROUND_OFF),
        deepest=deepest,
        hub_fits=np.asarray(hub_radius) < np.asarray(platform_radius),
        clear=distance > disc + radius + neck / 2,
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
