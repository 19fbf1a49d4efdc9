"""Bodies and hinges found in the plate of a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from flexfem.importing.divide import NOTHING, Cut, Edges, cut_of, divided, overlap
from flexfem.importing.found import Drawing, FoundHinge, FoundPlate
from flexfem.importing.necks import Neck, Triangles, necks_of, triangles_of
from flexfem.importing.shapes import ALLOWED, Fit, fits_of
from flexfem.importing.strips import joined
from flexfem.mechanism.outlines import Segment, circle_of, polygon_points
from flexfem.mechanism.profiles import Profile, Tabulated

THIN = 2.7  # width of the narrower body per neck from which a neck is a hinge
THICKER = 6.0  # neck per that of the thinnest hinge, from which it must be thinner compared with its bodies
THINNER = 8.0  # width of the narrower body per neck, from which such a neck is a hinge
FLEXIBLE = 20.0  # flexibility from which a neck is a hinge in bodies less wide
AMONG_OTHERS = 0.05  # its compliance per that of the most compliant hinge, from which it is one
STIFF = 5.0  # flexibility up to which a neck is no hinge
STIFF_RIM = 40.0  # the same of the rim of a round hole
WIDENS = 1.6  # width of a body near the end of a hinge, per height of this end
BEYOND = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)  # distances from the end of a hinge, per height of this end, where it widens
ASIDE = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)  # of them, distances from the axis, per height of this end
STEP = np.pi / 64  # rad of arc per side of the polygon from which distances are taken
SLENDER = 1.5  # width of slender metal per width of its narrowest place
MOST_FITS = 8  # of one neck that are tried


def recognise(drawing: Drawing) -> FoundPlate:
    """Return the bodies and hinges of the plate of a drawing.

    A hinge is a place where the metal is thin compared with what it connects at both ends. What no shape of a hinge
    reproduces within a thousandth of a millimetre stays a part of a body. Bodies and hinges together are the plate.
    """
    loops = [_cyclic(loop) for loop in (drawing.outside, *drawing.holes)]
    triangles = triangles_of(loops)
    between, closing = necks_of(triangles)
    paths, room = _Paths(triangles), _Room(loops)
    edges = Edges(loops)
    cuts = list[Cut]()
    for neck in sorted(between, key=lambda neck: neck.width):
        found = next((cut for cut in _cuts(edges, neck) if not overlap(cut, cuts) and room.widens(cut.fit)), None)
        if found is not None:
            cuts.append(found)
    cuts = _flexible(edges, cuts)
    result = divided(edges, cuts)
    while unconnected := [k for k, pair in enumerate(result.between) if pair[0] == pair[1] or NOTHING in pair]:
        cuts = [cut for k, cut in enumerate(cuts) if k not in unconnected]
        result = divided(edges, cuts)
    kept = {cut.neck.chord for cut in cuts}
    thin = [neck for neck in (*between, *closing) if neck.chord not in kept and neck.beyond > THIN * neck.width]
    hinges = tuple(_hinge(cut, ends) for cut, ends in zip(cuts, result.between, strict=True))
    return FoundPlate(drawing, tuple(result.bodies), hinges, paths.slender(thin))


def _cyclic(loop: Sequence[Segment]) -> list[Segment]:
    """Return a closed loop in which lines that continue each other are one."""
    path = joined(loop)
    if len(path) > 2 and len(joined([path[-1], path[0]])) == 1:
        path = [*joined([path[-1], path[0]]), *path[1:-1]]
    return path


def _cuts(edges: Edges, neck: Neck) -> Iterator[Cut]:
    """Yield the hinges that fit at a neck."""
    for number, fit in enumerate(fits_of(edges.loops, neck)):
        if number == MOST_FITS:
            return
        if fit.deviation <= ALLOWED and (cut := cut_of(edges, neck, fit)) is not None:
            yield cut


def _rotation(profile: Profile) -> float:
    """Integral of 1 / height^3 along a profile, 1/mm^2, to which its compliance in bending is proportional."""
    x, weights = profile.quadrature
    return float(np.sum(weights / profile.height(x) ** 3))


def _flexible(edges: Edges, cuts: Sequence[Cut]) -> list[Cut]:
    """Return the hinges that are thin and flexible compared with their bodies and with the other hinges.

    Flexibility is the length, per width of the body, of a bar as wide as the body that bends as much.
    """
    rotations = [_rotation(cut.fit.profile) for cut in cuts]
    most, thinnest = max(rotations, default=0.0), min((cut.neck.width for cut in cuts), default=0.0)
    kept = list[Cut]()
    for cut, rotation in zip(cuts, rotations, strict=True):
        width, beyond = cut.neck.width, cut.neck.beyond
        flexibility = rotation * beyond**2
        is_thin = beyond > (THIN if width < THICKER * thinnest else THINNER) * width
        is_flexible = flexibility > FLEXIBLE and rotation > AMONG_OTHERS * most
        is_stiff = flexibility < (STIFF_RIM if _is_rim(edges, cut) else STIFF)
        if (is_thin or is_flexible) and not is_stiff:
            kept.append(cut)
    return kept


def _is_rim(edges: Edges, cut: Cut) -> bool:
    """Return whether a hinge lies between a round hole and another edge."""
    loops = [edges.loops[stretch.loop] for stretch in (cut.right, cut.left)]
    return loops[0] is not loops[1] and sum(circle_of(loop) is not None for loop in loops) == 1


def _hinge(cut: Cut, bodies: tuple[int, int]) -> FoundHinge:
    fit = cut.fit
    table = fit.profile.table if isinstance(fit.profile, Tabulated) else ()
    smooth = isinstance(fit.profile, Tabulated) and fit.profile.smooth
    place, heading = fit.frame
    return FoundHinge(bodies, place, heading, fit.shape, fit.dimensions, table, fit.deviation, smooth, fit.side)


class _Room:
    """Room for discs in the metal of a plate."""

    def __init__(self, loops: Sequence[Sequence[Segment]]) -> None:
        rings = [polygon_points(loop, STEP) for loop in loops]
        sides = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
        self._tree = shapely.STRtree(np.asarray(shapely.linestrings(sides)))
        self._metal = shapely.Polygon(rings[0], rings[1:])
        shapely.prepare(self._metal)

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


class _Paths:
    """Ways through the triangles of a plate from chord to chord."""

    def __init__(self, triangles: Triangles) -> None:
        self.triangles = triangles
        self.middles = triangles.points[triangles.chords].mean(axis=1)
        order = np.argsort(triangles.beside.ravel(), kind="stable")
        self._chords = order // 2
        self._first = np.searchsorted(triangles.beside.ravel()[order], np.arange(len(triangles.corners) + 1))

    def beyond(self, chord: int, side: int, widest: float, reach: float) -> Iterator[tuple[int, int]]:
        """Yield the chords, and triangles behind them, on one side of a chord that narrower and near ones lead to."""
        start = int(self.triangles.beside[chord, side])
        stack, seen = [start], {start}
        while stack:
            triangle = stack.pop()
            for other in self._chords[self._first[triangle] : self._first[triangle + 1]].tolist():
                ends = self.triangles.beside[other].tolist()
                behind = ends[0] if ends[1] == triangle else ends[1]
                if other == chord or behind in seen:
                    continue
                yield other, behind
                seen.add(behind)
                is_near = abs(self.middles[other] - self.middles[chord]) < reach
                if is_near and self.triangles.lengths[other] < widest:
                    stack.append(behind)

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
