"""STEP files: one solid as a plate, by a section half way through its thickness, mm."""

from __future__ import annotations

from collections import Counter
from itertools import groupby
from pathlib import Path

from flexfem.importing.curves import Contents, DrawnCurve
from flexfem.importing.limit import TIME_LIMIT
from flexfem.importing.units import DrawingUnit
from flexfem.meshing.process import MeshTimeout, run_mesher
from flexfem.meshing.requests import FoundSection, SolidSection
from flexfem.meshing.solids import SECTION_ERROR
from flexfem.refused import BadInput, ComputationFailed, line_of, printed

LARGEST_FILE = 50_000_000  # bytes
LEFT_OUT = 0.05  # most of the volume that other faces than those of a plate may change
NAMED = 12  # solids in a message


def read_step(
    data: bytes, path: Path, unit: DrawingUnit | None, part: int | str | None
) -> Contents:
    """Read the section of a solid, in a separate process with a time limit.

    Raises BadInput for a file that is no complete STEP file, and for a solid that is no plate.
    """
    if not data.lstrip()[:20].startswith(b"ISO-10303-21"):
        raise BadInput("no STEP file, expected one that begins with ISO-10303-21")
    if b"END-ISO-10303-21" not in data[-2000:]:
        raise BadInput("the file ends without END-ISO-10303-21, expected a complete STEP file")
    if len(data) > LARGEST_FILE:
        raise BadInput(f"{len(data):,} bytes, expected at most {LARGEST_FILE:,}")
    if part is not None and (isinstance(part, bool) or not isinstance(part, int | str)):
        raise BadInput(f"part {printed(part)}, expected a number or the name of a solid")
    if unit is not None:
        raise BadInput(f"units {unit.name} with a STEP file, which states its unit; expected none")
    try:
        found: FoundSection = run_mesher(
            SolidSection(str(path.resolve()), 1 if part is None else part), TIME_LIMIT
        )
    except MeshTimeout:
        raise BadInput(f"not read within {TIME_LIMIT:g} s, expected a simpler solid") from None
    except ComputationFailed as error:
        raise BadInput(f"not readable as STEP: {line_of(error)[:120]}") from None
    _check(found, part)
    curves = [DrawnCurve(tuple(loop), "0", (found.names[found.chosen],)) for loop in found.contours]
    return Contents(
        curves,
        [],
        Counter(),
        0.0 if found.exact else SECTION_ERROR,
        "",
        found.thickness,
        tuple(_notes(found)),
    )


def _check(found: FoundSection, part: int | str | None) -> None:
    """Refuse a file without the wanted solid, and a solid that is no plate."""
    if not found.names:
        raise BadInput("no solid, expected a plate as a solid: surfaces alone do not enclose it")
    if found.chosen < 0:
        names = [name for name, _ in groupby(found.names) if name][:NAMED]
        named = f" or one of {', '.join(names)}" if names else ""
        raise BadInput(
            f"part {printed(part)}, expected a number from 1 to {len(found.names)}{named}"
        )
    if not found.contours:
        raise BadInput("a solid without two parallel plane faces, expected a plate")
    change = found.plate / found.solid - 1 if found.solid else float("inf")
    if abs(change) > LEFT_OUT:
        raise BadInput(
            f"a solid of {found.solid:.4g} mm^3 that is no plate of one thickness: its middle "
            f"section times {found.thickness:.4g} mm is {found.plate:.4g} mm^3 (faces: "
            f"{_faces(found) or 'all are perpendicular'}); expected a difference of at most "
            f"{LEFT_OUT:.0%}"
        )


def _faces(found: FoundSection) -> str:
    """Kinds, numbers and areas of the faces that are left out."""
    kinds = found.other.items()
    return ", ".join(
        f"{kind.lower()} ({number}, {size:.4g} mm^2)" for kind, (number, size) in kinds
    )


def _notes(found: FoundSection) -> list[str]:
    """Sentences about other solids and faces that are left out."""
    notes = [f"The section half way through the thickness of {found.thickness:.6g} mm is taken."]
    if found.other:
        change = 100 * (found.plate / found.solid - 1)
        notes.append(
            "Faces that are not perpendicular to the plate are left out, such as chamfers and "
            f"blind holes: {_faces(found)}; this changes the volume by {change:+.2g} %."
        )
    others = [name or f"solid {k + 1}" for k, name in enumerate(found.names) if k != found.chosen]
    if others:
        more = f" and {len(others) - NAMED} more" if len(others) > NAMED else ""
        notes.append(f"Other solids of the file were left out: {', '.join(others[:NAMED])}{more}.")
    return notes
