"""The lowered form of stages: n designs as arrays. Both models start from it; one stage is n = 1."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index
from flexfem.mechanism.actuators import Numbers
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage_file import CHAINS, Plane, StageContent, actuators_of, hinges_of

CHAIN_TURN = 2.0 * np.pi / 3.0
SHARED = ("plane", "prismatic")  # fields that all designs have in common


class Frames(NamedTuple):
    """Hinge frames of the stage at rest; leading axes are designs.

    centres : (..., 3 chains, 3 hinges, 2), mm, the platform centre at the origin.
    axes : (..., 3, 3), rad, direction of each neck from its base-side body to its platform-side body.
    """

    centres: Array
    axes: Array


class Elastic(NamedTuple):
    """Constants that make the equations of plane stress those of a plane: E (...) in MPa, Poisson's ratio (...)."""

    youngs_modulus: Array
    poissons_ratio: Array


@dataclass(frozen=True, eq=False)
class Designs:
    """n stages as arrays in inside units (mm, MPa, rad), the leading axis designs; nothing is checked.

    plane : how all of them are made a plane problem.   prismatic : (3 chains, 3 hinges), bool, the same for all.
    thickness, youngs_modulus, poissons_ratio, yield_strength, link_width, platform_radius, hub_radius : (n,).
    density : (n,), kg/m^3, asked for by natural frequencies alone.
    expansion : (n, 2), 1/K, of stage and frame, nan where not stated; for answers on heat alone.
    fatigue : (n, 3), Basquin's coefficient, MPa, and exponent, nan where not known, and Walker's; for lives alone.
    link_lengths, joint_angles : (n, 3).
    radius, neck, axis : (n, 3 chains, 3 hinges); axis nan where the neck follows its link.
    actuator : (n, 3 chains, actuators, numbers), of `actuators.Numbers`, asked for by answers on the drive alone.
    """

    plane: Plane
    prismatic: NDArray[np.bool_]
    thickness: Array
    youngs_modulus: Array
    poissons_ratio: Array
    yield_strength: Array
    density: Array
    expansion: Array
    fatigue: Array
    link_width: Array
    platform_radius: Array
    hub_radius: Array
    link_lengths: Array
    joint_angles: Array
    radius: Array
    neck: Array
    axis: Array
    actuator: Array

    @cached_property
    def frames(self) -> Frames:
        """Hinge frames: centres (n, 3, 3, 2), axes (n, 3, 3)."""
        return frames(self.link_lengths, self.joint_angles, self.axis)

    @property
    def elastic(self) -> Elastic:
        """Elastic constants (n,) of the plane problem.

        Plane strain is plane stress with `E / (1 - nu^2)` and `nu / (1 - nu)`. "corrected" is plane stress with factors
        on the hinges alone (`hinges/chart.py`): links are about as wide as thick.
        """
        E, nu = self.youngs_modulus, self.poissons_ratio
        return Elastic(E / (1 - nu**2), nu / (1 - nu)) if self.plane == "plane_strain" else Elastic(E, nu)

    @property
    def out_of_plane(self) -> Array:
        """The stress out of the plane over the sum of those in it (n,): nu in plane strain, else 0."""
        return self.poissons_ratio * (self.plane == "plane_strain")

    @property
    def alike(self) -> bool:
        """Whether the three chains are alike in every design, so that all are three-fold symmetric."""
        parts = (self.prismatic[None], self.radius, self.neck, np.nan_to_num(self.axis, nan=np.inf))
        return all(bool(np.all(part == part[:, :1])) for part in parts)

    def repeated(self, count: int) -> Designs:
        """`count` copies of one design, each to be changed in place."""
        return self.chosen(np.zeros(count, dtype=np.int64))

    def chosen(self, which: Index) -> Designs:
        """Copies of some designs, by their places (k,)."""
        names = [field.name for field in fields(self) if field.name not in SHARED]
        copies: dict[str, Any] = {name: getattr(self, name)[which] for name in names}
        return replace(self, **copies)


@once
def lower(stage: StageContent) -> Designs:
    """One stage as n = 1 designs, its arrays read-only."""
    material, hinges = stage.material, hinges_of(stage)
    owners = {
        "thickness": stage,
        **dict.fromkeys(("youngs_modulus", "poissons_ratio", "yield_strength", "density"), material),
        **dict.fromkeys(("link_width", "link_lengths", "joint_angles"), stage.chain),
    }
    values = {name: getattr(owner, name) for name, owner in owners.items()}
    values |= {name: [[getattr(hinge, name) for hinge in row] for row in hinges] for name in ("radius", "neck", "axis")}
    values |= {"platform_radius": stage.platform.radius, "hub_radius": stage.platform.hub_radius}
    values["expansion"] = material.expansion, stage.frame.expansion
    values["fatigue"] = material.fatigue_strength_coefficient, material.fatigue_strength_exponent, material.walker
    numbers = [[actuator.numbers for actuator in row] for row in actuators_of(stage)]
    values["actuator"] = np.reshape(numbers, (len(CHAINS), -1, len(Numbers._fields)))
    found = {name: np.array([value], dtype=float) for name, value in values.items()}  # nan for None
    prismatic = np.array([[hinge.prismatic for hinge in row] for row in hinges])
    made = Designs(stage.model, prismatic, **found)
    for each in (prismatic, *found.values(), *made.frames):
        each.setflags(write=False)
    return made


def stage_frames(stage: StageContent) -> Frames:
    """Hinge frames of one stage: centres (3, 3, 2) in mm, axes (3, 3) in rad, read-only."""
    centres, axes = lower(stage).frames
    return Frames(centres[0], axes[0])


def envelope(designs: Designs) -> Array:
    """Diameter (n,), mm, of the circle about the platform centre that holds platform, hinges and pads.

    The farthest corner: each notch is a box 2R long and as wide as the link, the pad behind a base hinge is as long as
    it is wide. Only the outside of a link's bend can lie farther out, when it does not lead to a farther hinge.
    """
    centres, axes = designs.frames
    along = direction(axes)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1) * 0.5 * designs.link_width[:, None, None, None]
    back = designs.radius.copy()
    back[:, :, 0] += designs.link_width[:, None]
    ends = (centres + designs.radius[..., None] * along, centres - back[..., None] * along)
    corners = [end + side * across for end in ends for side in (1.0, -1.0)]
    farthest = np.max([np.hypot(corner[..., 0], corner[..., 1]) for corner in corners], axis=(0, 2, 3))
    return np.asarray(2.0 * np.maximum(farthest, designs.platform_radius))


def frames(link_lengths: Array, joint_angles: Array, axes: Array | None = None) -> Frames:
    """Place the hinges of three chains, 120 degrees apart, around a platform centred at the origin.

    link_lengths : (..., 3), mm: base to elbow, elbow to platform hinge, platform hinge to platform centre.
    joint_angles : (..., 3), rad: relative angles at rest, as in (19).
    axes : (..., 3, 3), rad, in the frame of chain 1 and turned with each chain; nan where the default holds: base
        and elbow along link 1, platform along link 2. A neck has no arrow, so an axis and its opposite are the same.

    With (19) and (20) and the platform centre at the origin, `x_B = -(l1 e1 + l2 e2 + l3 e3)`.
    """
    heading = np.cumsum(np.asarray(joint_angles, dtype=float), axis=-1)
    towards = direction(heading)
    links = np.asarray(link_lengths, dtype=float)[..., None] * towards
    centres = -np.flip(np.cumsum(np.flip(links, axis=-2), axis=-2), axis=-2)  # (19), (20)
    towards[..., 1:, :] += direction(heading[..., :-1])  # of both links at a hinge
    default = heading[..., None, [0, 0, 1]]
    given = np.full(3, np.nan) if axes is None else np.asarray(axes, dtype=float)
    axis = np.where(np.isnan(given), default, given) + np.zeros((3, 3))
    backwards = np.sum(direction(axis) * towards[..., None, :, :], axis=-1) < -1e-9
    turns = CHAIN_TURN * np.arange(3.0)
    axis = axis + np.where(backwards, np.pi, 0.0) + turns[:, None]
    return Frames(turned(centres[..., None, :, :], turns[:, None]), axis)


def direction(angle: Array) -> Array:
    """Unit vectors (..., 2) at the angles (...), rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def chain_rotation(chain: int) -> Array:
    """Matrix (3, 3) that turns x, y, theta from the frame of chain 1 into that of the stage, chains from 0."""
    c, s = np.cos(chain * CHAIN_TURN), np.sin(chain * CHAIN_TURN)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned(points: Array, angle: Array | float) -> Array:
    """Points (..., 2) turned about the origin by `angle` (...), rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * points[..., 0] - s * points[..., 1], s * points[..., 0] + c * points[..., 1]], axis=-1)
