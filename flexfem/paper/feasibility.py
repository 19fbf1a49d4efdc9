"""Closed-form conditions that n stages can be made, evaluated before any body is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.files.tables import memoized
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.mechanism import Mechanism
from flexfem.paper.bodies import given_angles
from flexfem.paper.designs import Designs, design_arrays
from flexfem.paper.stage_file import HINGE_NAMES, StageContent, key_of
from flexfem.refused import BadInput, printed

PAIRS = list(combinations(product(range(3), range(3)), 2))  # of hinges, each (chain, position)
_FIRST, _SECOND = (np.array([hinges[k] for hinges in PAIRS]).T for k in (0, 1))
_ROUND_OFF = 1e-12  # relative; the largest radius is a difference of decimal fractions


class Broken(NamedTuple):
    """Text of a violated condition, and the designs (n,) that violate it."""

    reason: str
    where: NDArray[np.bool_]


class Condition(NamedTuple):
    """A geometric condition on n designs at p places, such as the hinges of one name on three
    chains.

    key : in the file.   wrong : description of the violation.   expected : text with the limit of
    the value.
    value : (n, p), mm, of the key; for pairs of hinges the sum of radii.   room : (n, p), mm,
    margin to the limit.
    pairs : indices into `PAIRS` of the p places, for a condition on pairs of hinges.
    """

    key: str
    wrong: str
    expected: str
    value: Array
    room: Array
    pairs: tuple[int, ...] = ()

    @property
    def broken(self) -> Broken:
        """Designs that violate the condition."""
        return Broken(f"{self.key}: {self.wrong}", ~np.all(self.room > 0, axis=-1))


def conditions(designs: Designs) -> list[Condition]:
    """Evaluate all conditions of n designs, in the order in which a single stage is checked."""
    return [
        *_of_notches(designs),
        _of_hub(designs),
        *_of_platform(designs),
        *_of_pairs(designs),
    ]


def _of_notches(designs: Designs) -> Iterator[Condition]:
    """Necks and notches must fit into the link."""
    radius = designs.radius
    neck = designs.neck
    width = designs.link_width[:, None, None]
    depth_room = (width - neck) / 2 * (1 + _ROUND_OFF) - radius
    for k, name in enumerate(HINGE_NAMES):
        yield Condition(
            f"hinges.{name}.neck_mm",
            "neck as wide as the link",
            "< chain.link_width_mm = {:g}",
            neck[..., k],
            (width - neck)[..., k],
        )
        yield Condition(
            f"hinges.{name}.radius_mm",
            "notch deeper than the link",
            "<= (chain.link_width_mm - neck_mm)/2 = {:g}",
            radius[..., k],
            depth_room[..., k],
        )


def _of_hub(designs: Designs) -> Condition:
    """The hub must fit into the platform."""
    hub = designs.hub_radius[:, None]
    room = designs.platform_radius[:, None] - hub
    wrong = "hub larger than the platform"
    return Condition("platform.hub_radius_mm", wrong, "< platform.radius_mm = {:g}", hub, room)


def _of_platform(designs: Designs) -> Iterator[Condition]:
    """The platform must not cover a hinge."""
    disc = designs.platform_radius[:, None]
    x, y = np.moveaxis(designs.frames.centres, -1, 0)
    room = np.hypot(x, y) - (disc[..., None] + designs.radius + designs.neck / 2)
    discs = np.repeat(disc, 3, axis=1)
    for k, name in enumerate(HINGE_NAMES):
        wrong = f"the platform covers the {name} hinge"
        limit = "< {:g} (distance of the hinge from the platform centre minus its notch)"
        yield Condition("platform.radius_mm", wrong, limit, discs, room[..., k])


def _of_pairs(designs: Designs) -> Iterator[Condition]:
    """Two hinges must be farther apart than their radii."""
    x, y = np.moveaxis(designs.frames.centres, -1, 0)
    radii = designs.radius[..., *_FIRST] + designs.radius[..., *_SECOND]
    apart = np.hypot(x[..., *_FIRST] - x[..., *_SECOND], y[..., *_FIRST] - y[..., *_SECOND])
    room = apart - radii
    for i, j in combinations_with_replacement(range(len(HINGE_NAMES)), 2):
        pairs = tuple(k for k, (a, b) in enumerate(PAIRS) if {a[1], b[1]} == {i, j})
        names = " and ".join(dict.fromkeys((HINGE_NAMES[i], HINGE_NAMES[j])))
        wrong = f"{names} hinges closer than their radii"
        values = radii[:, pairs]
        yield Condition("chain.link_lengths_mm", wrong, "> {:g}", values, room[:, pairs], pairs)


def check_closed_form(stage: StageContent) -> None:
    """Raise BadInput for a stage that violates one of `conditions`; no outlines are drawn."""
    if isinstance(stage, Mechanism) and not isinstance(stage, StageContent):
        raise BadInput(
            f"{stage.origin}: this is for the nine-hinge stage of a stage file, not for a mechanism"
        )
    if not isinstance(stage, StageContent):
        raise BadInput(
            f"{printed(stage)}, expected a flexfem.Stage or Mechanism, as flexfem.load returns it"
        )
    with naming_place(stage):
        _check_conditions(stage)


@memoized
def _check_conditions(stage: StageContent) -> None:
    for check in conditions(design_arrays(stage)):
        for place in np.flatnonzero(~(check.room[0] > 0)).tolist():
            raise BadInput(_reason(stage, check, place))


def _reason(
    stage: StageContent,
    check: Condition,
    place: int,
) -> str:
    """Return the reason why a stage violates a condition at a place."""
    value = check.value[0, place]
    limit = value + check.room[0, place]
    lengths = f"chain.link_lengths_mm = {list(stage.chain.link_lengths)}"
    if check.pairs:
        names = " and ".join(
            f"{HINGE_NAMES[position]} hinge of chain {chain + 1}"
            for chain, position in PAIRS[check.pairs[place]]
        )
        apart = f"{names} are {limit:.4g} mm apart, expected {check.expected.format(value)}"
        return f"{lengths}, {check.wrong}: {apart}"
    expected = f"expected {check.expected.format(limit)}"
    table, *hinge, key = check.key.split(".")
    if hinge:
        path = key_of(stage, place + 1, hinge[0], key)
        return f"{path} = {value:g}, {check.wrong}, {expected}"
    wrong = check.wrong
    if table == "platform" and len(check.room[0]) > 1:
        wrong = f"{wrong} of chain {place + 1}"
    if key == "radius_mm" and limit <= stage.platform.hub_radius:  # no radius is small enough
        farther = f"this hinge {value - limit:.4g} mm farther from the platform centre"
        return (
            f"{lengths} at {given_angles(stage)}, {wrong} with platform.radius_mm = {value:g}, "
            f"expected {farther}"
        )
    return f"{check.key} = {value:g}, {wrong}, {expected}"
