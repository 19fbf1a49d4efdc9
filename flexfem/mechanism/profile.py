"""A hinge profile with the sizes of the triangles that resolve it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexfem.mechanism.profile_beam import ProfileBeam

# distance from a neck up to which triangles are smallest, per sqrt(neck * root radius)
PLATEAU = 0.9
GENTLE = 0.8  # slope of the height below which it, not the growth of triangles, sets their size
STUBBY = 0.5  # root radius per neck below which the radius sets the triangle size at the root
MOST_DISCS = 32  # of one size in a row along half a profile

# points (complex, mm), triangle size there, mm, and distance up to which it holds, mm
Refinement = tuple[tuple[complex, ...], float, float]


@dataclass(frozen=True)
class Profile(ProfileBeam):
    """A hinge profile: its shape, its integrals as a beam, and the triangles that resolve it."""

    def sizes(self, resolution: float) -> list[Refinement]:
        """Return points (complex, mm), triangle size, mm, there, and distance from the points up to
        which it holds, mm.

        `resolution` quadratic triangles lie across the neck. Their size grows with the height along
        a slender profile, and is smaller at the edge of a neck with a small root radius. Elsewhere
        sizes may grow with the distance.
        """
        found = self._sizes(resolution)
        if self.symmetric:
            return found
        return [(self._on_middle(points), size, reach) for points, size, reach in found]

    def _on_middle(self, points: Sequence[complex]) -> tuple[complex, ...]:
        """Return points of the symmetric profile of the same height moved to this one."""
        z = np.array(points)
        return tuple((z + 1j * self.middle(z.real)).tolist())

    def _sizes(self, resolution: float) -> list[Refinement]:
        """Return the sizes in the symmetric profile of the same height."""
        place = self.neck_place
        radius = self.edge_radius
        found = self._levels(place, self.root_radius, resolution)
        if STUBBY * radius < self.neck:
            edge = 0.5j * self.neck
            found.append(((place + edge, place - edge), STUBBY * radius / resolution, radius / 2))
        return found

    def _levels(
        self, place: float, radius: float, resolution: float, sides: tuple[int, ...] = (-1, 1)
    ) -> list[Refinement]:
        """Return sizes within growing distances from a notch of a root radius, while its height
        grows slowly.
        """
        half = self.length / 2
        low = self.neck
        reach = min(PLATEAU * math.sqrt(self.neck * radius), half)
        found = list[Refinement]()
        while True:
            found.append(self._along(place, reach, low / resolution))
            low = self._lowest(place, reach, sides)
            following = min(2 * reach, half)
            if self._lowest(place, following, sides) - low >= GENTLE * (following - reach):
                return found
            reach = following

    def _lowest(
        self,
        place: float,
        reach: float,
        sides: tuple[int, ...],
    ) -> float:
        """Smallest height, mm, at a distance `reach` from `place`."""
        ends = np.clip(place + reach * np.array(sides), -self.length / 2, self.length / 2)
        return float(np.min(self.height(ends)))

    def _along(
        self,
        place: float,
        reach: float,
        size: float,
    ) -> Refinement:
        """Return the size on the axis up to `reach` from `place`: a disc, or a row of discs in a
        slender profile.
        """
        if reach <= self.end_height:
            return (complex(place),), size, reach
        radius = max(0.6 * self._lowest(place, reach, (-1, 1)), reach / MOST_DISCS)
        inside = reach - 0.8 * radius
        x = np.linspace(place - inside, place + inside, max(2, math.ceil(2 * inside / radius) + 1))
        x = x[np.abs(x) < self.length / 2]
        return tuple(map(complex, x.tolist())), size, radius
