"""Export of a mechanism as the part that the workshop makes."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from flexfem import arguments
from flexfem.cad.dxf import dxf_text
from flexfem.cad.sheet import WIRE, Sheet, sheet_of
from flexfem.cad.step import write_step
from flexfem.cad.svg import svg_text
from flexfem.fem.plate_mesh import plate_contours
from flexfem.files.provenance import assumptions_said
from flexfem.files.refusals import checked_path, one_line, place_of
from flexfem.files.writing import check_file, write_atomically
from flexfem.mechanism.contours import LARGEST_KERF, Part, cut_path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.mechanism import Mechanism, of_stage
from flexfem.refused import BadInput

FORMATS = (".dxf", ".svg", ".step")
SMALLEST = (
    0.01  # mm, of kerf and holes; a smaller value is a unit error: wires have 0.02 mm or more
)
LARGEST_HOLE = 1e3  # mm
LONGEST = 100  # characters of a name on a drawing
HOLES_NOT_INCLUDED = "the models do not include the mounting holes, which make the pads softer"


class PartReport(NamedTuple):
    """A part and the file it was written to; lengths in mm.

    area : of the part, mm^2.   volume : area times thickness, mm^3.   cut : length of all contours
    of the part.
    path : length of the wire's path, None without a kerf.   mounting : diameter of the mounting
    holes, or None.
    layers : of a drawing.
    """

    file: str
    name: str
    written: str
    units: str
    thickness: float
    area: float
    volume: float
    cut: float
    kerf: float | None
    path: float | None
    mounting: float | None
    layers: list[str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def export(
    mechanism: Mechanism, output: Path, *, kerf: float | None = None, holes: float | None = None
) -> PartReport:
    """Write a mechanism as a drawing or a solid for the workshop, in mm.

    Parameters
    ----------
    output : path
        File to write: .dxf, .svg or .step.
    kerf : float, optional
        Width of the wire's cut, mm; with it a drawing also has the centre line of the cut.
    holes : float, optional
        Diameter of a mounting hole in every pad of a stage, mm; the models do not include these
        holes.

    Raises
    ------
    BadInput
        The plate cannot be made, kerf or holes do not fit it, or the file cannot be written.
    ComputationFailed
        A written solid, read back, differs from the part; it is not kept.
    """
    target = _checked_target(output, kerf)
    if kerf is not None:
        kerf = arguments.between("kerf", kerf, SMALLEST, LARGEST_KERF, " mm")
    if holes is not None:
        holes = arguments.between("mounting holes", holes, SMALLEST, LARGEST_HOLE, " mm")
    read = [] if mechanism.origin.path is None else [Path(mechanism.origin.path)]
    check_file(target, *read)
    check_feasible(mechanism)
    layout = mechanism.layout if holes is None else mechanism.with_mounting_holes(holes)
    part = Part(plate_contours(layout))
    wire = None if kerf is None else cut_path(part, kerf)
    warnings = _warnings(mechanism, kerf, holes)
    layers = list[str]()
    if target.suffix == ".step":
        write_step(mechanism.name, layout, part, target)
    else:
        notes = [*_notes(mechanism), *warnings, *_notes_on_wire(kerf)]
        sheet = sheet_of(layout, part, wire, mechanism.dimensions(layout), notes)
        _write_sheet(sheet, target)
        layers = list(sheet.paths)
    return PartReport(
        **of_stage(mechanism),
        written=str(target),
        units="mm",
        thickness=mechanism.thickness,
        area=part.area,
        volume=part.area * mechanism.thickness,
        cut=part.length,
        kerf=kerf,
        path=None if wire is None else wire.length,
        mounting=holes,
        layers=layers,
        warnings=warnings,
    )


def _checked_target(output: Path, kerf: float | None) -> Path:
    """Return the path of the file to write. Raises BadInput for another extension."""
    target = checked_path(output)
    if target.suffix not in FORMATS:
        given = f"extension {target.suffix!r}" if target.suffix else "no extension"
        raise BadInput(
            f"{place_of(target)}: {given}, expected a file name that ends in one of "
            f"{', '.join(FORMATS)}"
        )
    if kerf is not None and target.suffix == ".step":
        raise BadInput(
            f"{place_of(target)}: a kerf with .step, expected .dxf or .svg: a wire path is "
            "two-dimensional"
        )
    return target


def _warnings(
    mechanism: Mechanism,
    kerf: float | None,
    holes: float | None,
) -> list[str]:
    """Return how the part differs from the models."""
    warnings = list(mechanism.not_exported)
    if holes is not None:
        warnings.append(HOLES_NOT_INCLUDED)
    if kerf is not None:
        warnings.append(f"the wire cuts sharp inner corners with a radius of {kerf / 2:g} mm")
    return warnings


def _notes(mechanism: Mechanism) -> list[str]:
    """Return notes for the reader of a drawing, one per line; the first is the name."""
    material = one_line(mechanism.material.name, LONGEST)
    notes = [
        one_line(mechanism.name, LONGEST),
        f"mm; thickness {mechanism.thickness:.6g}; {material}",
    ]
    copies = mechanism.drawing_facts.copies
    if copies:
        notes.append(copies)
    return notes + assumptions_said(mechanism.assumed, mechanism.not_stated)


def _notes_on_wire(kerf: float | None) -> list[str]:
    if kerf is None:
        return []
    return [f"{WIRE}: centre line of a cut {kerf:.6g} mm wide, the wire plus its spark gap"]


def _write_sheet(sheet: Sheet, target: Path) -> None:
    text = svg_text(sheet) if target.suffix == ".svg" else dxf_text(sheet)
    write_atomically(target, lambda file: file.write(text.encode()))
