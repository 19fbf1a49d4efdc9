"""Bodies and hinges found in the plate of a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
import shapely

from flexfem.importing.divide import NOTHING, Cut, Divided, Edges, cut_of, divided, overlap
from flexfem.importing.found import Drawing, FoundBody, FoundHinge, FoundPlate
from flexfem.importing.layers import is_ground
from flexfem.importing.metal import Paths, Room
from flexfem.importing.necks import Neck, Triangles, necks_of, triangles_of
from flexfem.importing.shapes import ALLOWED, fits_of
from flexfem.importing.strips import joined
from flexfem.mechanism.outlines import Segment, area, circle_of
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.tabulated import Tabulated

THIN = 2.7  # width of the narrower body per neck from which a neck is a hinge
THICKER = 6.0  # neck per that of the thinnest hinge, from which it must be thinner in its bodies
THINNER = 8.0  # width of the narrower body per neck, from which such a neck is a hinge
FLEXIBLE = 20.0  # flexibility from which a neck is a hinge in bodies less wide
AMONG_OTHERS = 0.05  # its compliance per that of the most compliant hinge, from which it is one
STIFF = 5.0  # flexibility up to which a neck is no hinge
STIFF_RIM = 40.0  # the same of the rim of a round hole
OF_PLATE = 1e-6  # of its area, by which bodies and hinges may differ from a plate
# A plate with a narrower neck is enlarged, so that differences of a micrometre are small in it.
LEAST = 0.1  # mm
ON_MARK = np.linspace(0, 1, 5)  # points of a side, per length, that are on a mark
MOST_WEAK = 60  # necks in bodies less wide, of which any can be a hinge
MOST_FITS = 8  # of one neck that are tried


def recognise(drawing: Drawing) -> FoundPlate:
    """Return the bodies and hinges of the plate of a drawing.

    A hinge is a place where the metal is thin compared with what it connects at both ends. What no
    shape of a hinge reproduces within a thousandth of a millimetre, in a plate thinner than a tenth
    of a millimetre within a hundredth of that, stays a part of a body. Bodies and hinges together
    are the plate.
    """
    loops = [_cyclic(loop) for loop in (drawing.outside, *drawing.holes)]
    triangles = triangles_of(loops)
    between, closing = _necks(triangles)
    thinnest = min((neck.width for neck in between), default=LEAST)
    scale = max(LEAST / thinnest, 1.0)
    edges = Edges([[resized(segment, scale) for segment in loop] for loop in loops])
    cuts, result = _hinges_and_bodies(edges, between, scale)
    slender = Paths(triangles).slender(_left_over([*between, *closing], cuts))
    return FoundPlate(
        drawing,
        tuple(_body(body, drawing, 1 / scale) for body in result.bodies),
        tuple(_hinges(cuts, result, 1 / scale)),
        slender,
    )


def _necks(triangles: Triangles) -> tuple[list[Neck], list[Neck]]:
    """Return the chords in hinges between two bodies, and in narrow places of one body."""
    between, closing = necks_of(triangles)
    weak = [neck for neck in between if neck.beyond <= THIN * neck.width]
    if len(weak) > MOST_WEAK:  # a perforated plate
        return necks_of(triangles, THIN)
    return between, closing


def _left_over(necks: Sequence[Neck], cuts: Sequence[Cut]) -> list[Neck]:
    """Return the thin ones of necks that are no hinges."""
    taken = {cut.neck.chord for cut in cuts}
    left = [neck for neck in necks if neck.chord not in taken]
    return [neck for neck in left if neck.beyond > THIN * neck.width]


def _hinges(
    cuts: Sequence[Cut],
    result: Divided,
    scale: float,
) -> list[FoundHinge]:
    """Return the hinges in the size of the drawing."""
    pairs = zip(cuts, result.between, strict=True)
    return [_hinge(cut, bodies, scale) for cut, bodies in pairs]


def _hinges_and_bodies(
    edges: Edges, necks: Sequence[Neck], scale: float
) -> tuple[list[Cut], Divided]:
    """Return the hinges at necks, and the bodies between them; none where they are not the plate.

    scale : size of the edges per that of the necks.
    """
    cuts, result = _settled(edges, _flexible(edges, _first(edges, necks, scale)))
    if _is_whole(edges, cuts, result):
        return cuts, result
    return [], divided(edges, [])


def _first(
    edges: Edges,
    necks: Sequence[Neck],
    scale: float,
) -> list[Cut]:
    """Return the first fit of each neck that is apart from those of narrower necks."""
    room = Room(edges.loops)
    cuts = list[Cut]()
    for neck in sorted(necks, key=lambda neck: neck.width):
        sized = neck._replace(width=scale * neck.width, beyond=scale * neck.beyond)
        for cut in _cuts(edges, sized):
            if not overlap(cut, cuts) and room.widens(cut.fit) and room.is_clear(cut.fit):
                cuts.append(cut)
                break
    return cuts


def _settled(edges: Edges, cuts: Sequence[Cut]) -> tuple[list[Cut], Divided]:
    """Return the hinges between two bodies, and these.

    A hinge that touches another one is made shorter. One whose ends are on one body is none.
    """
    result = divided(edges, cuts)
    settled = list[Cut]()
    for cut, pair in zip(cuts, result.between, strict=True):
        settled.append(_shortened(edges, cut) if NOTHING in pair else cut)
    result = divided(edges, settled)
    while not all(_is_between_bodies(pair) for pair in result.between):
        settled = [
            cut
            for cut, pair in zip(settled, result.between, strict=True)
            if _is_between_bodies(pair)
        ]
        result = divided(edges, settled)
    return settled, result


def _is_between_bodies(pair: tuple[int, int]) -> bool:
    """Return whether the ends of a hinge are on two bodies."""
    return pair[0] != pair[1] and NOTHING not in pair


def _shortened(edges: Edges, cut: Cut) -> Cut:
    """Return a hinge at the same neck that ends where the metal is low; else the hinge itself."""
    for fit in fits_of(edges.loops, cut.neck, low=True):
        shorter = cut_of(edges, cut.neck, fit)
        if shorter is not None and fit.deviation <= ALLOWED:
            return shorter
    return cut


def _is_whole(
    edges: Edges,
    cuts: Sequence[Cut],
    result: Divided,
) -> bool:
    """Return whether bodies and hinges have the area of the plate.

    It may differ by the deviations of the edges of hinges.
    """
    plate = sum(map(area, edges.loops))
    profiles = [cut.fit.profile for cut in cuts]
    parts = sum(map(_area_of, profiles))
    parts += sum(area(loop) for body in result.bodies for loop in (body.outside, *body.holes))
    lengths = np.array([2 * (profile.length + profile.end_height) for profile in profiles])
    deviations = np.array([cut.fit.deviation for cut in cuts])
    return bool(abs(parts - plate) < OF_PLATE * plate + lengths @ deviations)


def _cyclic(loop: Sequence[Segment]) -> list[Segment]:
    """Return a closed loop in which lines that continue each other are one."""
    path = joined(loop)
    if len(path) > 2 and len(joined([path[-1], path[0]])) == 1:
        path = [*joined([path[-1], path[0]]), *path[1:-1]]
    return path


def _cuts(edges: Edges, neck: Neck) -> Iterator[Cut]:
    """Yield the hinges that fit at a neck."""
    for fit in islice(fits_of(edges.loops, neck), MOST_FITS):
        if fit.deviation <= ALLOWED:
            cut = cut_of(edges, neck, fit)
            if cut is not None:
                yield cut


def _area_of(profile: Profile) -> float:
    x, weights = profile.quadrature
    return float(weights @ profile.height(x))


def _rotation(profile: Profile) -> float:
    """Integral of 1 / height^3 along a profile, 1/mm^2.

    Its compliance in bending is proportional to it.
    """
    x, weights = profile.quadrature
    return float(np.sum(weights / profile.height(x) ** 3))


def _flexible(edges: Edges, cuts: Sequence[Cut]) -> list[Cut]:
    """Return the hinges that are thin and flexible.

    They are compared with their bodies and with the other hinges. Flexibility is the length, per
    width of the body, of a bar as wide as the body that bends as much.
    """
    rotations = [_rotation(cut.fit.profile) for cut in cuts]
    most = max(rotations, default=0.0)
    thinnest = min((cut.neck.width for cut in cuts), default=0.0)
    kept = list[Cut]()
    for cut, rotation in zip(cuts, rotations, strict=True):
        width = cut.neck.width
        beyond = cut.neck.beyond
        flexibility = rotation * beyond**2
        is_thin = beyond > (THIN if width < THICKER * thinnest else THINNER) * width
        is_flexible = flexibility > FLEXIBLE and rotation > AMONG_OTHERS * most
        is_stiff = flexibility < (STIFF_RIM if _is_rim(edges, cut) else STIFF)
        if (is_thin or is_flexible) and not is_stiff:
            kept.append(cut)
    return kept


def _is_rim(edges: Edges, cut: Cut) -> bool:
    """Return whether a hinge lies between a round hole and another edge."""
    right, left = (edges.loops[stretch.loop] for stretch in cut.stretches)
    return right is not left and (circle_of(right) is None) != (circle_of(left) is None)


def _hinge(
    cut: Cut,
    bodies: tuple[int, int],
    scale: float,
) -> FoundHinge:
    """Return a hinge in the size of the drawing."""
    fit = cut.fit
    rows: tuple[tuple[float, ...], ...] = ()
    is_smooth = False
    if isinstance(fit.profile, Tabulated):
        rows = tuple(tuple(scale * value for value in row) for row in fit.profile.table)
        is_smooth = fit.profile.smooth
    dimensions = {
        key: value if key == "angle" else scale * value for key, value in fit.dimensions.items()
    }
    return FoundHinge(
        bodies=bodies,
        place=scale * fit.frame.place,
        heading=fit.frame.heading,
        shape=fit.shape,
        dimensions=dimensions,
        table=rows,
        deviation=scale * fit.deviation,
        smooth=is_smooth,
        side=fit.side,
    )


def _body(
    body: FoundBody,
    drawing: Drawing,
    scale: float,
) -> FoundBody:
    """Return a body in the size of the drawing, with the sides on its open marks of the ground."""
    outside = tuple(resized(segment, scale) for segment in body.outside)
    holes = tuple(tuple(resized(segment, scale) for segment in hole) for hole in body.holes)
    marks = [
        mark.points
        for mark in drawing.marks
        if is_ground(mark.layer) and not mark.closed and len(mark.points) > 1
    ]
    if not marks:
        return FoundBody(outside, holes)
    lines = shapely.MultiLineString([[(z.real, z.imag) for z in points] for points in marks])
    clamped = list[int]()
    for k, segment in enumerate(outside):
        z = segment.at(ON_MARK)
        if np.all(shapely.dwithin(lines, shapely.points(z.real, z.imag), ALLOWED)):
            clamped.append(k)
    return FoundBody(outside, holes, tuple(clamped))


def resized(segment: Segment, scale: float) -> Segment:
    """Return a segment in another size."""
    centre = None if segment.centre is None else scale * segment.centre
    return Segment(scale * segment.start, scale * segment.end, centre)
