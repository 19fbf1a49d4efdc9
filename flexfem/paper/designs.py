"""Stages as arrays: n designs, the input of both models; one stage is n = 1."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array, Index, direction
from flexfem.files.tables import memoized
from flexfem.paper.actuators import ActuatorNumbers
from flexfem.paper.frames import Frames, frames
from flexfem.paper.stage_file import CHAINS, Plane, StageContent, actuators_of, hinges_of

SHARED = ("plane", "prismatic")  # fields without a leading axis of designs


class Elastic(NamedTuple):
    """Elastic constants of the equivalent plane-stress problem: E (...) in MPa, Poisson's ratio
    (...).
    """

    youngs_modulus: Array
    poissons_ratio: Array


@dataclass(frozen=True, eq=False)
class Designs:
    """n stages as arrays in inside units (mm, MPa, rad) with a leading axis of designs.

    The values are not validated.

    plane : plane model of all designs.   prismatic : (3 chains, 3 hinges), bool, the same for all.
    thickness, youngs_modulus, poissons_ratio, yield_strength, link_width, platform_radius,
    hub_radius : (n,).
    density : (n,), kg/m^3, used for natural frequencies only.
    expansion : (n, 2), 1/K, of stage and frame, nan where not stated; used for thermal drift only.
    fatigue : (n, 3), Basquin's coefficient, MPa, and exponent, nan where not known, and Walker's;
    for lives only.
    link_lengths, joint_angles : (n, 3).
    radius, neck, axis : (n, 3 chains, 3 hinges); axis nan where the neck follows its link.
    actuator : (n, 3 chains, actuators, numbers), of `actuators.ActuatorNumbers`, used for the drive
    only.
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
        """Hinge frames at rest: centres (n, 3, 3, 2), axes (n, 3, 3)."""
        return frames(self.link_lengths, self.joint_angles, self.axis)

    @property
    def elastic(self) -> Elastic:
        """Elastic constants (n,) of the plane problem.

        Plane strain is plane stress with `E / (1 - nu^2)` and `nu / (1 - nu)`. "corrected" is plane
        stress with factors on the hinges only (`hinges/chart.py`), because links are about as wide
        as thick.
        """
        E = self.youngs_modulus
        nu = self.poissons_ratio
        return (
            Elastic(E / (1 - nu**2), nu / (1 - nu))
            if self.plane == "plane_strain"
            else Elastic(E, nu)
        )

    @property
    def out_of_plane(self) -> Array:
        """Ratio (n,) of the out-of-plane normal stress to the sum of the in-plane ones: nu in plane
        strain, else 0.
        """
        return self.poissons_ratio * (self.plane == "plane_strain")

    def repeated(self, count: int) -> Designs:
        """Return `count` copies of the first design, as arrays that may be changed in place."""
        return self.chosen(np.zeros(count, dtype=np.int64))

    def chosen(self, which: Index) -> Designs:
        """Return copies of the designs at the indices `which` (k,)."""
        names = [field.name for field in fields(self) if field.name not in SHARED]
        copies: dict[str, Any] = {name: getattr(self, name)[which] for name in names}
        return replace(self, **copies)


@memoized
def design_arrays(stage: StageContent) -> Designs:
    """Return one stage as n = 1 designs with read-only arrays."""
    hinges = hinges_of(stage)
    values = {"thickness": stage.thickness, **_of_material(stage), **_of_bodies(stage)}
    for name in ("radius", "neck", "axis"):
        values[name] = [[getattr(hinge, name) for hinge in row] for row in hinges]
    numbers = [[actuator.numbers for actuator in row] for row in actuators_of(stage)]
    values["actuator"] = np.reshape(numbers, (len(CHAINS), -1, len(ActuatorNumbers._fields)))
    arrays = {name: np.array([value], dtype=float) for name, value in values.items()}
    prismatic = np.array([[hinge.prismatic for hinge in row] for row in hinges])
    designs = Designs(stage.model, prismatic, **arrays)
    for array in (prismatic, *arrays.values(), *designs.frames):
        array.setflags(write=False)
    return designs


def _of_material(stage: StageContent) -> dict[str, Any]:
    """Return the numbers of the material and of the frame; None for those that are not stated."""
    material = stage.material
    return {
        "youngs_modulus": material.youngs_modulus,
        "poissons_ratio": material.poissons_ratio,
        "yield_strength": material.yield_strength,
        "density": material.density,
        "expansion": (material.expansion, stage.frame.expansion),
        "fatigue": (
            material.fatigue_strength_coefficient,
            material.fatigue_strength_exponent,
            material.walker,
        ),
    }


def _of_bodies(stage: StageContent) -> dict[str, Any]:
    """Return the dimensions of links and platform."""
    return {
        "link_width": stage.chain.link_width,
        "link_lengths": stage.chain.link_lengths,
        "joint_angles": stage.chain.joint_angles,
        "platform_radius": stage.platform.radius,
        "hub_radius": stage.platform.hub_radius,
    }


def stage_frames(stage: StageContent) -> Frames:
    """Hinge frames of one stage: centres (3, 3, 2) in mm, axes (3, 3) in rad, read-only."""
    centres, axes = design_arrays(stage).frames
    return Frames(centres[0], axes[0])


def envelope(designs: Designs) -> Array:
    """Diameter (n,), mm, of the circle about the platform centre around platform, hinges and pads.

    Each notch counts as a box 2R long and as wide as the link, and the pad of a base hinge is as
    long as it is wide. Only the outer edge of a link's bend can lie outside the circle, if no hinge
    lies farther out.
    """
    centres, axes = designs.frames
    along = direction(axes)
    left = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    across = left * 0.5 * designs.link_width[:, None, None, None]
    back = designs.radius.copy()
    back[:, :, 0] += designs.link_width[:, None]
    ends = (centres + designs.radius[..., None] * along, centres - back[..., None] * along)
    corners = np.array([end + side * across for end in ends for side in (1.0, -1.0)])
    farthest = np.max(np.hypot(corners[..., 0], corners[..., 1]), axis=(0, 2, 3))
    return np.asarray(2.0 * np.maximum(farthest, designs.platform_radius))
