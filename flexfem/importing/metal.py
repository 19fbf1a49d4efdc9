"""What surrounds the hinges of a plate: where the metal widens, and where else it is narrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from flexfem.importing.necks import Neck, Triangles
from flexfem.importing.shapes import Fit
from flexfem.mechanism.outlines import Segment, polygon_points

WIDENS = 1.6  # width of a body near the end of a hinge, per height of this end
# Places where a body widens, per height of the end of a hinge: beyond this end, and off the axis.
BEYOND = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
ASIDE = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
STEP = np.pi / 64  # rad of arc per side of the polygon from which distances are taken
SLENDER = 1.5  # width of slender metal per width of its narrowest place
# Distance from the middle of a hinge, per length or height, of what is surely inside it.
WITHIN = 0.49


class Room:
    """Room for discs in the metal of a plate."""

    def __init__(self, loops: Sequence[Sequence[Segment]]) -> None:
        rings = [polygon_points(loop, STEP) for loop in loops]
        sides = np.concatenate(
            [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
        )
        self._points = np.concatenate(rings) @ [1, 1j]
        self._tree = shapely.STRtree(np.asarray(shapely.linestrings(sides)))
        self._metal = shapely.Polygon(rings[0], rings[1:])
        shapely.prepare(self._metal)

    def is_clear(self, fit: Fit) -> bool:
        """Return whether no edge of the plate is inside a hinge."""
        local = fit.frame.into(self._points)
        inside = np.abs(local.real) < WITHIN * fit.profile.length
        x = local[inside].real
        y = local[inside].imag
        aside = np.abs(y - fit.profile.middle(x))
        return not np.any(aside < WITHIN * fit.profile.height(x))

    def widens(self, fit: Fit) -> bool:
        """Return whether the metal widens soon beyond both ends of a hinge."""
        half = fit.profile.length / 2
        for side in (-1, 1):
            height = float(fit.profile.height(np.array(side * half)))
            if height > WIDENS * fit.profile.neck:
                continue
            ahead = side * (half + height * np.array(BEYOND))
            local = ahead[:, None] + 1j * height * np.array(ASIDE)
            z = np.asarray(fit.frame.out(local)).ravel()
            inside = shapely.contains_xy(self._metal, z.real, z.imag)
            points = shapely.points(z.real[inside], z.imag[inside])
            distances = self._tree.query_nearest(points, all_matches=False, return_distance=True)[1]
            if max(distances, default=0.0) < WIDENS * height / 2:
                return False
        return True


class Paths:
    """Ways through the triangles of a plate from chord to chord."""

    def __init__(self, triangles: Triangles) -> None:
        self.triangles = triangles
        self.middles = triangles.points[triangles.chords].mean(axis=1)
        order = np.argsort(triangles.beside.ravel(), kind="stable")
        self._chords = order // 2
        self._first = np.searchsorted(
            triangles.beside.ravel()[order], np.arange(len(triangles.corners) + 1)
        )

    def beyond(
        self, chord: int, side: int, widest: float, reach: float
    ) -> Iterator[tuple[int, int]]:
        """Yield the chords, and triangles behind them, on one side of a chord.

        Chords that are narrower than `widest` and nearer than `reach`, mm, lead to them.
        """
        start = int(self.triangles.beside[chord, side])
        stack = [start]
        seen = {start}
        while stack:
            triangle = stack.pop()
            for other in self._chords_of(triangle):
                ends = self.triangles.beside[other].tolist()
                behind = ends[0] if ends[1] == triangle else ends[1]
                if other == chord or behind in seen:
                    continue
                yield other, behind
                seen.add(behind)
                is_near = abs(self.middles[other] - self.middles[chord]) < reach
                if is_near and self.triangles.lengths[other] < widest:
                    stack.append(behind)

    def _chords_of(self, triangle: int) -> list[int]:
        """Return the chords at a triangle."""
        own = slice(self._first[triangle], self._first[triangle + 1])
        return list(self._chords[own].tolist())

    def slender(self, necks: Sequence[Neck]) -> tuple[Any, ...]:
        """Return the polygons of the narrow metal at necks."""
        found = set[int]()
        for neck in necks:
            for side in (0, 1):
                if int(self.triangles.beside[neck.chord, side]) in found:
                    continue
                for chord, triangle in self.beyond(neck.chord, side, SLENDER * neck.width, np.inf):
                    if self.triangles.lengths[chord] < SLENDER * neck.width:
                        found.add(triangle)
        corners = self.triangles.points[self.triangles.corners[sorted(found)]]
        rings = np.stack([corners.real, corners.imag], axis=-1)
        if not len(rings):
            return ()
        whole = shapely.union_all(shapely.polygons(rings))
        return tuple(shapely.get_parts(whole))
