"""A drawing or a solid of a plate as closed contours: DXF, STEP and SVG files."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.files.refusals import checked_path, place_of, shown
from flexfem.importing.curves import Contents, DrawnCurve
from flexfem.importing.dxf import read_dxf
from flexfem.importing.found import Drawing
from flexfem.importing.marks import Sorted, marks_of, sorted_curves
from flexfem.importing.network import Shapes
from flexfem.importing.regions import DrawnPlate, OpenChain
from flexfem.importing.smooth import SmoothLoop, smoothed
from flexfem.importing.step import read_step
from flexfem.importing.svg import read_svg
from flexfem.importing.units import LARGEST_THICKNESS, DrawingUnit
from flexfem.mechanism.contours import LARGEST_KERF, Part, cut_path
from flexfem.mechanism.outlines import Segment, circle_of, reverse
from flexfem.refused import BadInput

SOLIDS = (".step", ".stp")
FORMATS = (".dxf", *SOLIDS, ".svg")
TOLERANCE = 0.01  # mm; gaps up to this are closed
LARGEST_TOLERANCE = 1.0  # mm
LARGEST_FILE = 100_000_000  # bytes
MOST_SEGMENTS = 200_000
SMALL = 5.0
LARGE = 2000.0  # mm; a plate of another size is a unit error unless the caller states the unit
SMALLEST = 1e-2
LARGEST = 1e5  # mm; the same with a stated unit
FARTHEST = 100 * LARGEST  # mm, from the origin
NAMED = 6  # parts in a note


def read_drawing(
    path: str | os.PathLike[str],
    *,
    units: str | None = None,
    part: int | str | None = None,
    kerf: float = 0.0,
    tolerance: float | None = None,
    thickness: float | None = None,
) -> Drawing:
    """Read one plate from a DXF, STEP or SVG file.

    Parameters
    ----------
    path : path
        File that ends in .dxf, .step, .stp or .svg.
    units : str, optional
        Unit of the lengths in the file, instead of the one that it states: mm, cm, m, um, in, ft,
        mil; px (96 per inch), pt or, for example, 90dpi.
    part : int or str, optional
        Number of the plate, 1 for the largest, or the name of its layer, block, group or solid. By
        default the largest.
    kerf : float
        Width of a cut, mm, whose middle is drawn: the metal loses half of it at every edge.
    tolerance : float, optional
        Gaps between ends of curves that are closed, mm; 0.01 mm by default.
    thickness : float, optional
        Thickness of the plate, mm, instead of that of the file.

    Raises
    ------
    BadInput
        The file is no such drawing, has no closed contour, or an argument is out of range; one
        line.
    """
    file = checked_path(path)
    place = place_of(file)
    unit = None if units is None else DrawingUnit.named(units)
    tolerance = TOLERANCE if tolerance is None else tolerance
    tolerance = arguments.between("tolerance", tolerance, 1e-4, LARGEST_TOLERANCE, " mm")
    kerf = arguments.between("kerf", kerf, 0.0, LARGEST_KERF, " mm")
    if thickness is not None:
        thickness = arguments.positive("thickness", thickness, LARGEST_THICKNESS)
    try:
        contents = _contents(file, unit, part)
        plate = None if file.suffix.lower() in SOLIDS else part  # that of a solid is taken already
        return _drawing(file, contents, _Wanted(unit, plate, kerf, tolerance, thickness))
    except BadInput as error:
        raise BadInput(error.reason, place) from None
    except RecursionError:
        raise BadInput("nested too deeply, expected a simpler file", place) from None


class _Wanted(NamedTuple):
    """Arguments of `read_drawing`."""

    unit: DrawingUnit | None
    part: int | str | None
    kerf: float
    tolerance: float
    thickness: float | None


def _contents(
    file: Path,
    unit: DrawingUnit | None,
    part: int | str | None,
) -> Contents:
    """Return the curves of a file, each reader's own. Raises BadInput."""
    suffix = file.suffix.lower()
    if suffix not in FORMATS:
        given = f"extension {file.suffix!r}" if suffix else "no extension"
        raise BadInput(
            f"{given}, expected a drawing whose name ends in one of {', '.join(FORMATS)}"
        )
    data = _bytes_of(file)
    if suffix == ".dxf":
        return read_dxf(data, file, unit)
    if suffix == ".svg":
        return read_svg(data, unit)
    return read_step(data, file, unit, part)


def _bytes_of(file: Path) -> bytes:
    """Return what a file holds. Raises BadInput for one that is missing, too large or empty."""
    try:
        if not file.exists():
            raise BadInput("no such file, expected a drawing")
        if not file.is_file():
            raise BadInput("not a file, expected a drawing")
        if file.stat().st_size > LARGEST_FILE:
            raise BadInput(f"{file.stat().st_size:,} bytes, expected at most {LARGEST_FILE:,}")
        data = file.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise BadInput(f"not readable ({reason}), expected a drawing") from None
    if not data.strip():
        raise BadInput("an empty file, expected a drawing")
    return data


def _drawing(
    file: Path,
    contents: Contents,
    wanted: _Wanted,
) -> Drawing:
    """Return the wanted plate. Raises BadInput."""
    _check_curves(contents, wanted)
    found = sorted_curves(contents.curves, wanted.tolerance)
    plate, others = _wanted_plate(found, contents, wanted)
    _check_plate(plate, found, contents, wanted)
    loops = [smoothed([edge.segment for edge in loop]) for loop in (plate.outside, *plate.holes)]
    outside, *holes = _without_kerf([each.loop for each in loops], wanted.kerf)
    deviation = contents.deviation + max(each.joined for each in loops)
    return Drawing(
        path=file,
        outside=tuple(outside),
        holes=tuple(tuple(hole) for hole in holes),
        thickness=wanted.thickness if wanted.thickness is not None else contents.thickness,
        marks=marks_of(contents.curves, contents.points, wanted.tolerance),
        deviation=max(deviation, *(each.off for each in loops)),
        notes=(*_notes(contents, found, loops, wanted), *_notes_of_parts(others)),
    )


def _check_curves(contents: Contents, wanted: _Wanted) -> None:
    """Refuse no curves, too many, and those of impossible size."""
    if not contents.curves:
        raise BadInput(
            f"no curve of a contour{_left_out(contents)}, expected the closed contours of a plate"
        )
    segments = [segment for curve in contents.curves for segment in curve.segments]
    if len(segments) > MOST_SEGMENTS:
        raise BadInput(f"{len(segments):,} lines and arcs, expected at most {MOST_SEGMENTS:,}")
    points = [[each.start, each.end, each.centre or 0.0] for each in segments]
    numbers = np.array(points, dtype=complex)
    if not np.all(np.isfinite(numbers)):
        raise BadInput("coordinates that are not finite numbers, expected finite ones")
    if np.max(np.abs(numbers[:, :2])) > FARTHEST:
        raise BadInput(
            f"coordinates of {np.max(np.abs(numbers)):.3g} mm, expected at most {FARTHEST:g} mm"
        )
    low, high = _extent(segments)
    _check_size(max((high - low).real, (high - low).imag), 0.0, wanted)


def _extent(segments: Sequence[Segment]) -> tuple[complex, complex]:
    """Lowest and highest corner of the box around lines and arcs, mm."""
    points = Shapes(segments).at(np.arange(len(segments)), np.linspace(0, 1, 33))
    low = complex(float(points.real.min()), float(points.imag.min()))
    return low, complex(float(points.real.max()), float(points.imag.max()))


def _check_size(
    across: float,
    most: float,
    wanted: _Wanted,
) -> None:
    """Refuse a plate whose size does not fit its unit.

    most : 0 when only small ones are refused.
    """
    low, high = (SMALL, LARGE) if wanted.unit is None else (SMALLEST, LARGEST)
    stated = "" if wanted.unit is None else f" in {wanted.unit.name}"
    if across < low:
        raise BadInput(
            f"{across:.3g} mm across{stated}{': inches?' if wanted.unit is None else ''}, "
            f"expected {low:g} mm or more; state the unit of its lengths (units, such as in or mm)"
        )
    if most and across > high:
        raise BadInput(
            f"{across:.3g} mm across{stated}{': um?' if wanted.unit is None else ''}, expected "
            f"{high:g} mm or less; state the unit of its lengths (units, such as um or mm)"
        )


def _wanted_plate(
    found: Sorted, contents: Contents, wanted: _Wanted
) -> tuple[DrawnPlate, list[tuple[int, DrawnPlate]]]:
    """Return the wanted plate, and the others with their numbers. Raises BadInput."""
    plates = found.regions.plates
    if not plates:
        _refuse_crossing(found.regions.crossings.tolist())
        _refuse_open(found.regions.open, found)
        raise BadInput(f"no closed contour{_left_out(contents)}, expected those of a plate")
    chosen = 0 if wanted.part is None else _number_of(wanted.part, found)
    return plates[chosen], [(k + 1, plate) for k, plate in enumerate(plates) if k != chosen]


def _number_of(part: int | str, found: Sorted) -> int:
    """Return the index of the plate with a number or a name. Raises BadInput."""
    plates = found.regions.plates
    if isinstance(part, bool) or not isinstance(part, int | str):
        raise BadInput(f"part {part!r}, expected a number from 1 to {len(plates)} or a name")
    text = str(part).strip()
    if text.isdecimal() and len(text) < 10:
        if not 1 <= int(text) <= len(plates):
            raise BadInput(f"part {text}, expected a number from 1 to {len(plates)}")
        return int(text) - 1
    for k, plate in enumerate(plates):
        if text.lower() in {name.lower() for name in _names_of(plate, found.metal)}:
            return k
    names = dict.fromkeys(name for plate in plates for name in _names_of(plate, found.metal))
    raise BadInput(
        f"part {shown(text)}, expected a number from 1 to {len(plates)} or one of "
        f"{', '.join(names)}"[:300]
    )


def _names_of(plate: DrawnPlate, curves: Sequence[DrawnCurve]) -> list[str]:
    """Return the layers, and the blocks or groups, of the outer contour of a plate."""
    owners = [curves[k] for k in dict.fromkeys(edge.curve for edge in plate.outside)]
    return list(dict.fromkeys(name for curve in owners for name in (*curve.groups, curve.layer)))


def _check_plate(
    plate: DrawnPlate,
    found: Sorted,
    contents: Contents,
    wanted: _Wanted,
) -> None:
    """Refuse a plate of a size that does not fit its unit, or with other contours that are wrong.

    They are open or cross each other within the box around the plate, or touch each other.
    """
    low, high = _extent([edge.segment for edge in plate.outside])
    _check_size(max((high - low).real, (high - low).imag), 1.0, wanted)
    slack = complex(wanted.tolerance, wanted.tolerance)

    def overlaps(box: tuple[complex, complex]) -> bool:
        first = box[0] - high - slack
        last = box[1] - low + slack
        return max(first.real, first.imag) <= 0 <= min(last.real, last.imag)

    _refuse_crossing([z for z in found.regions.crossings.tolist() if overlaps((z, z))])
    near = [
        chain
        for chain in found.regions.open
        if overlaps(_extent([edge.segment for edge in chain.edges]))
    ]
    _refuse_open(near, found)
    if plate.touches:
        raise BadInput(
            f"contours touch each other at {_at(plate.touches[0])}: a neck or a gap of no width, "
            "expected some width"
        )


def _refuse_crossing(points: Sequence[complex]) -> None:
    """Refuse contours that cross."""
    if points:
        more = f", one of {len(points)} crossings" if len(points) > 1 else ""
        raise BadInput(
            f"contours cross at {_at(points[0])}{more}, expected closed contours that do not cross"
        )


def _refuse_open(chains: Sequence[OpenChain], found: Sorted) -> None:
    """Refuse open contours, with the coordinates of the two ends of the smallest gap."""
    ends = [end for chain in chains for end in chain.ends]
    if not ends:
        return
    every = np.array([end for chain in found.regions.open for end in chain.ends])
    best = (math.inf, ends[0], ends[0])
    for end in ends[:2000]:
        apart = np.abs(every - end)
        apart[apart == 0] = np.inf
        k = int(np.argmin(apart))
        best = min(best, (float(apart[k]), end, complex(every[k])), key=lambda each: each[0])
    gap, one, other = best
    layer = found.metal[chains[0].edges[0].curve].layer
    more = f", one of {len(ends)} open ends" if len(ends) > 2 else ""
    if math.isinf(gap):
        raise BadInput(
            f"a curve with an open end at {_at(one)} (layer {shown(layer)}{more}), expected "
            "closed contours"
        )
    raise BadInput(
        f"a gap of {gap:.4g} mm between {_at(one)} and {_at(other)} (layer {shown(layer)}{more}), "
        "expected closed contours, or a larger tolerance"
    )


def _at(z: complex) -> str:
    return f"({round(z.real, 6) + 0.0:.6g}, {round(z.imag, 6) + 0.0:.6g})"


def _without_kerf(loops: list[list[Segment]], kerf: float) -> list[list[Segment]]:
    """Take half the width of a cut from the metal at every edge."""
    if not kerf:
        return loops
    try:  # the path that cuts the voids is half a kerf inside the metal
        voids = cut_path(Part([reverse(loop) for loop in loops]), kerf)
    except BadInput:
        raise BadInput(
            f"kerf of {kerf:g} mm, expected less than every width and radius of the metal"
        ) from None
    return [smoothed(reverse(loop)).loop for loop in voids.loops]


def _left_out(contents: Contents) -> str:
    """Return what was left out, for a message."""
    if not contents.left_out:
        return ""
    return f"; left out: {_counted(contents)}"


def _counted(contents: Contents) -> str:
    """Number and names of what was left out."""
    return ", ".join(f"{what} ({number})" for what, number in contents.left_out.most_common(8))


def _notes(
    contents: Contents, found: Sorted, loops: Sequence[SmoothLoop], wanted: _Wanted
) -> list[str]:
    """Sentences about what was assumed, closed, merged or left out."""
    notes = [contents.unit] if contents.unit else []
    notes += contents.notes
    if contents.left_out:
        notes.append(f"Left out: {_counted(contents)}.")
    gaps = [gap for gap in found.network.gaps if gap > 0]
    if gaps:
        notes.append(f"Gaps that were closed: {len(gaps)}, of at most {max(gaps):.3g} mm.")
    if found.network.doubles:
        notes.append(
            "Lines and arcs that are drawn more than once, and were merged: "
            f"{found.network.doubles}."
        )
    if found.regions.dividing:
        notes.append(f"Lines inside the metal that were left out: {len(found.regions.dividing)}.")
    if found.layers:
        notes.append(f"Curves on layer {', '.join(found.layers)} are edges of metal too.")
    arcs = sum(each.arcs for each in loops)
    if arcs:
        off = max(each.off for each in loops) * 1e3
        notes.append(
            f"Rows of short lines that are read as arcs: {arcs}, at most {off:.2g} um off them."
        )
    if contents.deviation > 1e-9:
        off = 1e3 * (contents.deviation + max(each.joined for each in loops))
        notes.append(
            f"Splines, ellipses or Bezier curves are read as arcs, at most {off:.2g} um off."
        )
    if wanted.kerf:
        notes.append(
            f"The metal was reduced by {wanted.kerf / 2:g} mm at every edge, half the kerf."
        )
    return notes


def _notes_of_parts(others: Sequence[tuple[int, DrawnPlate]]) -> list[str]:
    """Sentences about the plates that were not taken."""
    notes = list[str]()
    for number, plate in others[:NAMED]:
        circle = circle_of([edge.segment for edge in plate.outside])
        where = circle[0] if circle else np.mean([edge.segment.start for edge in plate.outside])
        what = (
            f"a disc {2 * circle[1]:.4g} mm in diameter"
            if circle and not plate.holes
            else f"{plate.size:.4g} mm^2"
        )
        notes.append(f"Part {number}, {what} around {_at(complex(where))}, was left out.")
    if len(others) > NAMED:
        notes.append(f"Smaller parts that were left out: {len(others) - NAMED}.")
    return notes
