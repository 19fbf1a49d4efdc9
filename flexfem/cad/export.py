"""A stage as a file for the workshop: .dxf and .svg, drawings, and .step, a solid; all of one outline."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from flexfem.cad.drawings import dxf_text, sheet_of, svg_text
from flexfem.fem.mesher import Extruded, run_mesher
from flexfem.files.refusals import place_of
from flexfem.files.writing import check_file, replacing, write_atomically
from flexfem.mechanism.drawing import Part, cut_path, part_of
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput, ComputationFailed

FORMATS = (".dxf", ".svg", ".step")
TIME_LIMIT = 120.0  # s, for gmsh
EPOCH = "1970-01-01T00:00:00"
SAME = 1e-9  # relative, of volume and box of a solid that was read back


class PartReport(NamedTuple):
    """A part and the file it was written to; lengths in mm.

    area : of the metal, mm^2.   volume : area times thickness, mm^3.   cut : length of all contours of the metal.
    path : length of the wire's path about them, None without a kerf.   mounting : diameter of the holes, or None.
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


def export_part(stage: Stage, path: Path, kerf: float | None, mounting: float | None) -> PartReport:
    """Write a part by its file's extension; `kerf` and `mounting`, a diameter, in mm.

    Raises
    ------
    BadInput
        The stage cannot be made, a hole or kerf does not fit, the extension is not in `FORMATS`, or the file cannot be
        written.
    ComputationFailed
        A solid that was read back is not the part.
    """
    if path.suffix not in FORMATS:
        found = f"extension {path.suffix!r}" if path.suffix else "no extension"
        raise BadInput(f"{place_of(path)}: {found}, expected a file name that ends in one of {', '.join(FORMATS)}")
    check_file(path, *([] if stage.origin.path is None else [Path(stage.origin.path)]))
    if kerf is not None and path.suffix == ".step":
        raise BadInput(f"{place_of(path)}: a kerf with .step, expected .dxf or .svg: the path of a wire is flat")
    part, layers = part_of(stage, mounting), list[str]()
    if path.suffix == ".step":
        write_step(stage, part, path)
    else:
        sheet = sheet_of(stage, part, kerf)
        layers, text = sheet.layers, svg_text(sheet) if path.suffix == ".svg" else dxf_text(sheet)
        write_atomically(path, lambda file: file.write(text.encode()))
    return PartReport(
        stage.origin.path or "",
        stage.name,
        str(path),
        "mm",
        stage.thickness,
        part.area,
        part.area * stage.thickness,
        part.length,
        kerf,
        None if kerf is None else cut_path(part, kerf).length,
        mounting,
        layers,
        _warnings(part, kerf),
        list(stage.assumed),
        list(stage.not_stated),
    )


def _warnings(part: Part, kerf: float | None) -> list[str]:
    found = ["the models clamp the pads along their back edges alone, and fill the hub hole with a rigid disc"]
    if part.mounting:
        found.append("the mounting holes are in no model: they make the pads softer")
    if kerf is not None:
        found.append(f"the wire leaves sharp inner corners filled with a radius of {kerf / 2:g} mm")
    return found


def write_step(stage: Stage, part: Part, path: Path) -> None:
    """Write the part extruded, from z = 0 to the thickness, and read it back.

    Raises ComputationFailed when it is not one solid of the part's volume and size in mm, BadInput when the file cannot
    be written.
    """
    holes = [(hole.centre, hole.radius) for hole in part.holes]
    with replacing(path) as temporary:
        read = run_mesher(Extruded(str(temporary), part.outer, holes, stage.thickness), TIME_LIMIT)
        volume, height = part.area * stage.thickness, float(read["box"][1, 2] - read["box"][0, 2])
        found = read["volumes"]
        if len(found) != 1 or abs(found[0] / volume - 1) > SAME or abs(height - stage.thickness) > 1e-6:
            raise ComputationFailed(
                f"{path}: read back as {len(found)} solids of {found.sum():.12g} mm^3, {height:.6g} mm high, expected "
                f"one of {volume:.12g} mm^3, {stage.thickness:g} mm high; nothing is written"
            )
        temporary.write_text(undated(named(temporary.read_text(), stage.name)))


def named(text: str, name: str) -> str:
    """The text of a STEP file with a name of the product, which CAD programs show, in place of OpenCASCADE's."""
    plain = "".join(
        each if each.isascii() else f"\\X2\\{each.encode('utf-16-be').hex().upper()}\\X0\\"
        for each in name.replace("\\", "\\\\").replace("'", "''")
    )
    return re.sub(r"(= PRODUCT\()'[^']*',\s*'[^']*'", lambda found: f"{found[1]}'{plain}','{plain}'", text, count=1)


def undated(text: str) -> str:
    """The text of a STEP file with a fixed time in its header, so that the same part gives the same file."""
    return re.sub(r"(FILE_NAME\('[^']*',\s*)'[^']*'", rf"\1'{EPOCH}'", text, count=1)
