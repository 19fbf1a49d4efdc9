"""Closed-form conditions that n stages can be made, evaluated before any body is drawn."""

from __future__ import annotations

from itertools import combinations, combinations_with_replacement, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.files.tables import once
from flexfem.mechanism.content import located
from flexfem.mechanism.mechanism import Mechanism
from flexfem.paper.bodies import given_angles
from flexfem.paper.designs import Designs, lower
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
    radius = designs.radius
    neck = designs.neck
    disc = designs.platform_radius[:, None]
    centres = designs.frames.centres
    width = designs.link_width[:, None, None]
    x = centres[..., 0]
    y = centres[..., 1]
    depth_margin = (width - neck) / 2 * (1 + _ROUND_OFF) - radius
    disc_margin = np.hypot(x, y) - (disc[..., None] + radius + neck / 2)
    radii = radius[..., *_FIRST] + radius[..., *_SECOND]
    gap = np.hypot(x[..., *_FIRST] - x[..., *_SECOND], y[..., *_FIRST] - y[..., *_SECOND]) - radii
    hub = designs.hub_radius[:, None]
    discs = np.repeat(disc, 3, axis=1)
    checks = list[Condition]()
    for k, name in enumerate(HINGE_NAMES):
        key = f"hinges.{name}.neck_mm"
        wrong = "neck as wide as the link"
        limit = "< chain.link_width_mm = {:g}"
        checks.append(Condition(key, wrong, limit, neck[..., k], (width - neck)[..., k]))
        key = f"hinges.{name}.radius_mm"
        wrong = "notch deeper than the link"
        limit = "<= (chain.link_width_mm - neck_mm)/2 = {:g}"
        checks.append(Condition(key, wrong, limit, radius[..., k], depth_margin[..., k]))
    wrong = "hub larger than the platform"
    limit = "< platform.radius_mm = {:g}"
    checks.append(Condition("platform.hub_radius_mm", wrong, limit, hub, disc - hub))
    for k, name in enumerate(HINGE_NAMES):
        wrong = f"the platform covers the {name} hinge"
        limit = "< {:g} (distance of the hinge from the platform centre minus its notch)"
        checks.append(Condition("platform.radius_mm", wrong, limit, discs, disc_margin[..., k]))
    for i, j in combinations_with_replacement(range(len(HINGE_NAMES)), 2):
        pairs = tuple(k for k, (a, b) in enumerate(PAIRS) if {a[1], b[1]} == {i, j})
        wrong = (
            f"{' and '.join(dict.fromkeys((HINGE_NAMES[i], HINGE_NAMES[j])))} hinges closer than "
            "their radii"
        )
        checks.append(
            Condition(
                "chain.link_lengths_mm", wrong, "> {:g}", radii[:, pairs], gap[:, pairs], pairs
            )
        )
    return checks


def check_closed_form(stage: StageContent) -> None:
    """Raise BadInput for a stage that violates one of `conditions`; unlike `check_feasible`, draw
    no outlines.
    """
    if isinstance(stage, Mechanism) and not isinstance(stage, StageContent):
        raise BadInput(
            f"{stage.origin}: this is for the nine-hinge stage of a stage file, not for a mechanism"
        )
    if not isinstance(stage, StageContent):
        raise BadInput(
            f"{printed(stage)}, expected a flexfem.Stage or Mechanism, as flexfem.load returns it"
        )
    with located(stage):
        _check_conditions(stage)


@once
def _check_conditions(stage: StageContent) -> None:
    for check in conditions(lower(stage)):
        for place in np.flatnonzero(~(check.room[0] > 0)).tolist():
            value = check.value[0, place]
            limit = check.value[0, place] + check.room[0, place]
            if check.pairs:
                pair = PAIRS[check.pairs[place]]
                names = " and ".join(
                    f"{HINGE_NAMES[position]} hinge of chain {chain + 1}"
                    for chain, position in pair
                )
                reason = (
                    f"{check.wrong}: {names} are {limit:.4g} mm apart, expected "
                    f"{check.expected.format(value)}"
                )
                raise BadInput(f"{check.key} = {list(stage.chain.link_lengths)}, {reason}")
            table, *hinge, key = check.key.split(".")
            path = key_of(stage, place + 1, hinge[0], key) if hinge else check.key
            chain = (
                f" of chain {place + 1}" if table == "platform" and len(check.room[0]) > 1 else ""
            )
            if (
                key == "radius_mm" and not hinge and limit <= stage.platform.hub_radius
            ):  # no radius is small enough
                given = (
                    f"chain.link_lengths_mm = {list(stage.chain.link_lengths)} at "
                    f"{given_angles(stage)}"
                )
                farther = f"this hinge {value - limit:.4g} mm farther from the platform centre"
                raise BadInput(
                    f"{given}, {check.wrong}{chain} with platform.radius_mm = {value:g}, expected "
                    f"{farther}"
                )
            raise BadInput(
                f"{path} = {value:g}, {check.wrong}{chain}, expected {check.expected.format(limit)}"
            )
