"""The part as a STEP solid, which is read back before it is kept."""

from __future__ import annotations

import re
from pathlib import Path

from flexfem.fem.plate_mesh import regions_of
from flexfem.files.writing import replacing
from flexfem.mechanism.contours import Part
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.outlines import Segment, area
from flexfem.meshing.process import run_mesher
from flexfem.meshing.requests import PlateSolid
from flexfem.refused import ComputationFailed

TIME_LIMIT = 120.0  # s, for gmsh
TOLERANCE = 1e-9  # relative, of the volume of a solid that is read back
OF_ARCS = 1e-5  # the same where arcs may stand for other curves
HEIGHT = 1e-6  # mm, of the height of a solid that is read back
PRODUCT = re.compile(r"(= PRODUCT\()'[^']*',\s*'[^']*'")
DATED = re.compile(r"(FILE_NAME\('[^']*',\s*)'[^']*'")
NO_DATE = "1970-01-01T00:00:00"


def write_step(
    name: str,
    layout: Layout,
    part: Part,
    path: Path,
) -> None:
    """Write the part as one solid for each piece, from z = 0 to the thickness, and read it back.

    Raises ComputationFailed when what is read does not have the part's volume and height in mm,
    BadInput when the file cannot be written.
    """
    with replacing(path) as temporary:
        regions = regions_of(layout, circles=True)
        read = run_mesher(PlateSolid(str(temporary), regions, layout.thickness), TIME_LIMIT)
        volumes = read["volumes"]
        height = float(read["box"][1, 2] - read["box"][0, 2])
        pieces = sum(area(loop) > 0 for loop in part.loops)
        volume = part.area * layout.thickness
        is_off = abs(volumes.sum() / volume - 1) > _tolerance(layout)
        if len(volumes) != pieces or is_off or abs(height - layout.thickness) > HEIGHT:
            raise ComputationFailed(
                f"{path}: read back as {len(volumes)} solids of {volumes.sum():.12g} mm^3, "
                f"{height:.6g} mm high, expected {pieces} of {volume:.12g} mm^3, "
                f"{layout.thickness:g} mm high; nothing is written"
            )
        temporary.write_text(_named(temporary.read_text(), _encoded(name)))


def _tolerance(layout: Layout) -> float:
    """Return the accepted relative difference of the volume."""
    curves = [curve for joint in layout.joints for edge in joint.profile.edges() for curve in edge]
    return TOLERANCE if all(isinstance(curve, Segment) for curve in curves) else OF_ARCS


def _named(text: str, name: str) -> str:
    """Return a STEP file with the name that CAD programs show, and without its date.

    OpenCASCADE writes a name of its own.
    """
    text = PRODUCT.sub(lambda match: f"{match[1]}'{name}','{name}'", text, count=1)
    return DATED.sub(rf"\1'{NO_DATE}'", text, count=1)


def _encoded(name: str) -> str:
    """Return a text as ISO 10303-21 encodes it."""
    name = name.replace("\\", "\\\\").replace("'", "''")
    name = re.sub("[\u0080-\uffff]", lambda match: f"\\X2\\{ord(match[0]):04X}\\X0\\", name)
    return re.sub("[\U00010000-\U0010ffff]", lambda match: f"\\X4\\{ord(match[0]):08X}\\X0\\", name)
