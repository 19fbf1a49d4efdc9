"""What moves in a mode: the bodies with the largest motion, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.fem.mesh import PlaneMesh
from flexfem.mechanism.layout import Layout

# motion of a part, relative to that of the part that moves most, from which it is named, too
NAMED_FROM = 0.7
MOST_NAMED = 2
# share of the mean displacement in the motion of a body above which it moves along a direction
STRAIGHT = 0.7
ALONG_AXIS = math.cos(math.radians(10.0))  # of the angle to an axis that is called along it
ALONE = "bending, with bodies almost at rest"
OPPOSED = -0.7  # cosine of the angle between two motions in opposite directions


def unlike_models(modes: Sequence[str]) -> list[str]:
    """Return a note on modes in which hinges bend alone, which the analytic models do not have."""
    first = next((k for k, words in enumerate(modes, start=1) if words.endswith(ALONE)), None)
    if first is None:
        return []
    return [
        f"from mode {first} on, analytic and elastic bodies have modes of other shapes than finite "
        "elements: none in which hinges bend alone; compare modes by what moves, not by number"
    ]


class PartMotion(NamedTuple):
    """Motion of a part in a mode: its name, root mean square size, and mean displacement (2,)."""

    name: str
    size: float
    mean: Array

    @property
    def is_straight(self) -> bool:
        """Whether the part mainly moves along a direction, and does not turn or bend."""
        return float(np.linalg.norm(self.mean)) > STRAIGHT * self.size

    @property
    def words(self) -> str:
        """What the part does."""
        if not self.is_straight:
            return "turning"
        x, y = np.abs(self.mean / np.linalg.norm(self.mean)).tolist()
        if x > ALONG_AXIS:
            return "along x"
        if y > ALONG_AXIS:
            return "along y"
        degrees = math.degrees(math.atan2(self.mean[1], self.mean[0])) % 180.0
        return f"at {degrees:.0f} degrees to x"


def what_moves(
    layout: Layout,
    mesh: PlaneMesh,
    field: Array,
) -> str:
    """Return the parts that move most in a mode, with displacements (n, 2) of the nodes of a mesh."""
    names = [body.name for body in layout.bodies]
    names += [f"hinge {joint.name}" for joint in layout.joints]
    parts = [_motion_of(name, mesh.bodies == k, mesh, field) for k, name in enumerate(names)]
    is_fixed = [body.fixed for body in layout.bodies]
    bodies = [part for part, fixed in zip(parts, is_fixed, strict=False) if not fixed]
    hinges = parts[len(is_fixed) :]
    largest = max(part.size for part in [*bodies, *hinges])
    moving = [part for part in bodies if part.size > NAMED_FROM * largest]
    if not moving:
        vibrating = [part for part in hinges if part.size > NAMED_FROM * largest]
        return f"{_listed([part.name for part in vibrating])} {ALONE}"
    return _said(moving)


def _motion_of(
    name: str,
    of_part: AnyArray,
    mesh: PlaneMesh,
    field: Array,
) -> PartMotion:
    """Return the motion of the part with these triangles."""
    nodes = np.unique(mesh.triangles[of_part])
    moved = field[nodes, :2] if len(nodes) else np.zeros((1, 2))
    size = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
    return PartMotion(name, size, np.mean(moved, axis=0))


def _said(moving: Sequence[PartMotion]) -> str:
    """Return the bodies that move most, and how."""
    ordered = sorted(moving, key=lambda part: -part.size)
    first = ordered[0]
    if len(ordered) == 2 and all(part.is_straight for part in ordered):
        second = ordered[1]
        sizes = np.linalg.norm(first.mean) * np.linalg.norm(second.mean)
        cosine = float(first.mean @ second.mean / sizes)
        if cosine < OPPOSED:
            return f"{first.name} and {second.name} in opposite directions, {first.words}"
    return f"{_listed([part.name for part in ordered])} {first.words}"


def _listed(names: Sequence[str]) -> str:
    """Return names in a row; of many, the first ones and the count of the others."""
    shown = " and ".join(names[:MOST_NAMED])
    rest = len(names) - MOST_NAMED
    return f"{shown} and {rest} more" if rest > 0 else shown
