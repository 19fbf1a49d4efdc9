"""Export of a plate for the workshop: .dxf and .svg drawings of lines and arcs in mm, and a .step
solid.
"""

from __future__ import annotations

import cmath
import io
import math
import re
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias
from xml.etree import ElementTree

import ezdxf

from flexfem import arguments
from flexfem.fem.mesher import PlateSolid, run_mesher
from flexfem.fem.plate_mesh import plate_contours, regions_of
from flexfem.files.provenance import assumptions_said
from flexfem.files.refusals import checked_path, one_line, place_of
from flexfem.files.writing import check_file, replacing, write_atomically
from flexfem.mechanism.contours import Part, cut_path
from flexfem.mechanism.dimensions import LETTER, Dimensions
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism, of_stage
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.outlines import Segment, area, circle_of, disc, reverse
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput, ComputationFailed

FORMATS = (".dxf", ".svg", ".step")
TIME_LIMIT = 120.0  # s, for gmsh
SMALLEST = (
    0.01  # mm, of kerf and holes; a smaller value is a unit error: wires have 0.02 mm or more
)
LARGEST_KERF = 10.0  # mm, some 30 times a common kerf
LARGEST_HOLE = 1e3  # mm
TOLERANCE = 1e-9  # relative, of the volume of a solid that is read back
OF_ARCS = 1e-5  # the same for a mechanism, where arcs may stand for other curves
METAL = "METAL"
HOLES = "HOLES"
GROUND = "GROUND"  # HOLES: the round ones; GROUND: fixed bodies and clamped edges
MARKS = "CENTRE_MARKS"
SIZES = "DIMENSIONS"
WIRE = "WIRE_PATH"
COLOURS = {  # of each layer, dark on white
    METAL: "#1A1A1A",
    HOLES: "#B00000",
    GROUND: "#0072B2",
    MARKS: "#707070",
    SIZES: "#007A58",
    WIRE: "#CC3399",
}
LIMITS = (
    "the models clamp only the back edges of the pads and fill the hub hole with a rigid disc",
)  # of a stage
LONGEST = 100  # characters of a name on a drawing
LINE = 0.1  # mm, line width in an SVG
HEAD = 3.0  # length over width of an arrow head


Plate: TypeAlias = Mechanism


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
    stage: Plate, output: Path, *, kerf: float | None = None, holes: float | None = None
) -> PartReport:
    """Write a stage or a mechanism as a drawing or a solid for the workshop, in mm.

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
    kerf = None if kerf is None else arguments.between("kerf", kerf, SMALLEST, LARGEST_KERF, " mm")
    holes = (
        None
        if holes is None
        else arguments.between("mounting holes", holes, SMALLEST, LARGEST_HOLE, " mm")
    )
    check_file(target, *([] if stage.origin.path is None else [Path(stage.origin.path)]))
    check_feasible(stage)
    layout = stage.layout if holes is None else _with_holes(stage, holes)
    part = Part(plate_contours(layout))
    warnings = [*LIMITS] if isinstance(stage, Stage) else list[str]()
    warnings += ["the models do not include the mounting holes, which make the pads softer"] * (
        holes is not None
    )
    wire = None if kerf is None else cut_path(part, kerf)
    if kerf is not None:
        warnings.append(f"the wire cuts sharp inner corners with a radius of {kerf / 2:g} mm")
    layers = list[str]()
    if target.suffix == ".step":
        write_step(stage.name, layout, part, target)
    else:
        notes = [*_notes(stage), *warnings]
        if kerf is not None:
            notes.append(
                f"{WIRE}: centre line of a cut {kerf:.6g} mm wide, the wire plus its spark gap"
            )
        sheet = sheet_of(layout, part, wire, stage.dimensions(layout), notes)
        text = svg_text(sheet) if target.suffix == ".svg" else dxf_text(sheet)
        write_atomically(target, lambda file: file.write(text.encode()))
        layers = [*sheet.paths]
    return PartReport(
        **of_stage(stage),
        written=str(target),
        units="mm",
        thickness=stage.thickness,
        area=part.area,
        volume=part.area * stage.thickness,
        cut=part.length,
        kerf=kerf,
        path=None if wire is None else wire.length,
        mounting=holes,
        layers=layers,
        warnings=warnings,
    )


def _with_holes(plate: Plate, diameter: float) -> Layout:
    """Return the layout of a stage with a hole in the middle of every pad."""
    if isinstance(plate, MechanismFile):
        raise BadInput(
            f"mounting holes of {diameter:g} mm: expected a stage file; a mechanism states holes "
            "of bodies"
        )
    if not diameter < (width := plate.chain.link_width):
        most = f"the pad width: chain.link_width_mm = {width:g}"
        raise BadInput(f"mounting holes of {diameter:g} mm, expected less than {most}")
    bodies = list(plate.layout.bodies)
    for k, body in enumerate(bodies):
        middle = sum(segment.start for segment in body.outline) / len(body.outline)
        bodies[k] = (
            body._replace(holes=(tuple(reverse(disc(middle, diameter / 2).loop)),))
            if body.clamped
            else body
        )
    return plate.layout._replace(bodies=tuple(bodies))


def write_step(name: str, layout: Layout, part: Part, path: Path) -> None:
    """Write the part, extruded from z = 0 to the thickness, as one solid for each piece, and read
    it back.

    Raises ComputationFailed when what is read does not have the part's volume and height in mm,
    BadInput when the file cannot be written."""
    pieces = sum(area(loop) > 0 for loop in part.loops)
    thickness = layout.thickness
    curves = [curve for joint in layout.joints for edge in joint.profile.edges() for curve in edge]
    most = TOLERANCE if all(isinstance(curve, Segment) for curve in curves) else OF_ARCS
    with replacing(path) as temporary:
        read = run_mesher(
            PlateSolid(str(temporary), regions_of(layout, circles=True), thickness), TIME_LIMIT
        )
        found = read["volumes"]
        height = float(read["box"][1, 2] - read["box"][0, 2])
        off = abs(found.sum() / (part.area * thickness) - 1)
        if len(found) != pieces or off > most or abs(height - thickness) > 1e-6:
            raise ComputationFailed(
                f"{path}: read back as {len(found)} solids of {found.sum():.12g} mm^3, "
                f"{height:.6g} mm high, expected {pieces} of {part.area * thickness:.12g} mm^3, "
                f"{thickness:g} mm high; nothing is written"
            )
        name = name.replace("\\", "\\\\").replace("'", "''")  # encoded by ISO 10303-21
        name = re.sub("[\u0080-\uffff]", lambda match: f"\\X2\\{ord(match[0]):04X}\\X0\\", name)
        name = re.sub(
            "[\U00010000-\U0010ffff]", lambda match: f"\\X4\\{ord(match[0]):08X}\\X0\\", name
        )
        product = re.compile(
            r"(= PRODUCT\()'[^']*',\s*'[^']*'"
        )  # shown by CAD programs; OpenCASCADE writes its own
        text = product.sub(
            lambda match: f"{match[1]}'{name}','{name}'", temporary.read_text(), count=1
        )
        text = re.sub(
            r"(FILE_NAME\('[^']*',\s*)'[^']*'", r"\1'1970-01-01T00:00:00'", text, count=1
        )  # no date
        temporary.write_text(text)


class Sheet(NamedTuple):
    """Drawing in mm, x to the right and y upwards, with the platform centre of a stage at the
    origin.

    paths : closed loops of segments by layer, and lines as paths of one segment.
    texts : text, position, and whether the position is the middle of the text or its lower left
    corner."""

    paths: dict[str, list[list[Segment]]]
    dimensions: Dimensions
    texts: list[tuple[str, complex, bool]]


def sheet_of(
    layout: Layout, part: Part, wire: Part | None, sizes: Dimensions, notes: list[str]
) -> Sheet:
    """Return the drawing of a part, with the path of a `wire` if there is one, its dimensions, and
    notes below.
    """
    holes = [loop for loop in part.loops if circle_of(loop) and area(loop) < 0]
    metal = [loop for loop in part.loops if loop not in holes]
    ground = [[*body.outline] for body in layout.bodies if body.fixed]
    ground += [[body.outline[k]] for body in layout.bodies if not body.fixed for k in body.clamped]
    centres = [joint.place for joint in layout.joints] + [
        circle[0] for circle in map(circle_of, holes) if circle
    ]
    corners = [segment.start for loop in metal for segment in loop]
    lowest = min(z.imag for z in [*corners, *(label.place for label in sizes.labels)])
    foot = complex(min(z.real for z in corners), lowest - 5 * sizes.height)
    texts = [(label.text, label.place, True) for label in sizes.labels]
    texts += [(note, foot - 1.6j * line * sizes.height, False) for line, note in enumerate(notes)]
    paths = {
        METAL: metal,
        HOLES: holes,
        GROUND: ground,
        MARKS: [
            [Segment(z - half, z + half)]
            for z in centres
            for half in (sizes.height / 2, 0.5j * sizes.height)
        ],
        SIZES: [[Segment(*label.line)] for label in sizes.labels],
        WIRE: wire.loops if wire else [],
    }
    return Sheet(
        {name: found for name, found in paths.items() if found or name == SIZES}, sizes, texts
    )


def _notes(stage: Plate) -> list[str]:
    """Notes on the plate for the reader of a drawing, one per line; the first is its name."""
    notes = [one_line(stage.name, LONGEST)]
    notes.append(f"mm; thickness {stage.thickness:.6g}; {one_line(stage.material.name, LONGEST)}")
    if isinstance(stage, Stage) and stage.chains_alike:
        notes.append("chains 2 and 3 as chain 1, turned by 120 and 240 degrees")
    return notes + assumptions_said(stage.assumed, stage.not_stated)


# SVG


def svg_text(sheet: Sheet) -> str:
    """Return the text of an SVG file, in which y points down and so is the negative of the
    drawing's y.
    """
    low, high = _corners(sheet)
    box = [low.real, -high.imag, (high - low).real, (high - low).imag]
    size = {
        "width": f"{box[2]!r}mm",
        "height": f"{box[3]!r}mm",
        "viewBox": " ".join(map(repr, box)),
    }
    root = ElementTree.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", **size})
    ElementTree.SubElement(root, "title").text = next(
        text for text, _, centred in sheet.texts if not centred
    )
    look = {"fill": "none", "stroke-width": str(LINE)}
    for name, loops in sheet.paths.items():
        group = ElementTree.SubElement(root, "g", {"id": name, "stroke": COLOURS[name], **look})
        for loop in loops:
            if circle := circle_of(loop):
                centre = dict(zip(("cx", "cy"), _pair(circle[0]).split(), strict=True))
                ElementTree.SubElement(group, "circle", centre | {"r": repr(float(circle[1]))})
            else:
                ElementTree.SubElement(group, "path", {"d": _svg_path(loop)})
        if name == SIZES:
            _svg_dimensions(group, sheet)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _corners(sheet: Sheet) -> tuple[complex, complex]:
    """Lower left and upper right corner of the bounding box of a drawing, with a margin."""
    sizes = sheet.dimensions
    points = [segment.start for paths in sheet.paths.values() for path in paths for segment in path]
    points += [end for span in sizes.spans for end in span.line]
    for text, place, centred in sheet.texts:
        width = sizes.height * LETTER * len(text)
        points += (
            [place - width / 2 - 1j * sizes.height, place + width / 2]
            if centred
            else [place, place + width]
        )
    margin = 3 * sizes.height * (1 + 1j)
    x = [float(z.real) for z in points]
    y = [float(z.imag) for z in points]
    return complex(min(x), min(y)) - margin, complex(max(x), max(y)) + margin


def _pair(z: complex) -> str:
    """Both SVG coordinates in full precision."""
    return f"{float(z.real)!r} {float(-z.imag)!r}"


def _svg_path(path: list[Segment]) -> str:
    """Return SVG path data, closed unless the path is a single line; no arc exceeds 180 degrees."""
    steps = [f"M {_pair(path[0].start)}"]
    for segment in path:
        if segment.centre is None:
            steps.append(f"L {_pair(segment.end)}")
        else:
            radius = float(abs(segment.start - segment.centre))
            steps.append(
                f"A {radius!r} {radius!r} 0 0 {int(segment.turn < 0)} {_pair(segment.end)}"
            )
    return " ".join(steps + ["Z"] * (len(path) > 1))


def _svg_dimensions(group: Any, sheet: Sheet) -> None:
    """Add the dimension lines with their arrow heads, and all texts."""
    height = sheet.dimensions.height
    for span in sheet.dimensions.spans:
        start, end = span.line
        for line in ((span.start, start), (span.end, end), (start, end)):
            ElementTree.SubElement(group, "path", {"d": _svg_path([Segment(*line)])})
        along = (end - start) / abs(end - start)
        for tip, inwards in ((start, along), (end, -along)):
            back = tip + height * inwards
            half = 1j * inwards * height / HEAD / 2
            corners = " ".join(map(_pair, (tip, back + half, back - half)))
            ElementTree.SubElement(group, "polygon", {"points": corners, "fill": COLOURS[SIZES]})
        _svg_text(group, span.text, (start + end) / 2 + 0.4j * along * height, height, along)
    for text, place, centred in sheet.texts:
        _svg_text(
            group,
            text,
            place - 0.35j * height * centred,
            height,
            anchor="middle" if centred else "start",
        )


def _svg_text(
    group: Any, text: str, at: complex, height: float, along: complex = 1, anchor: str = "middle"
) -> None:
    """Add a line of text along a direction, with its base line through a point."""
    rotation = (
        {"transform": f"rotate({-math.degrees(cmath.phase(along)):.6f} {_pair(at)})"}
        if along != 1
        else {}
    )
    place = dict(zip(("x", "y"), _pair(at).split(), strict=True)) | {
        "text-anchor": anchor,
        **rotation,
    }
    look = {
        "fill": COLOURS[SIZES],
        "stroke": "none",
        "font-size": f"{height:.6g}",
        "font-family": "sans-serif",
    }
    ElementTree.SubElement(group, "text", place | look).text = text


# DXF


def dxf_text(sheet: Sheet) -> str:
    """Return the text of a DXF file; equal drawings give equal texts."""
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # without times and random identifiers
    try:
        document = ezdxf.new("R2010")  # UTF-8, and read by current programs
        document.header["$INSUNITS"] = 4
        document.header["$MEASUREMENT"] = 1  # mm, metric
        document.header["$LUNITS"] = 2
        document.header["$LUPREC"] = 8  # decimal
        for name in sheet.paths:
            layer = document.layers.add(
                name
            )  # the part in colour 7: black or white, opposite to the background
            if name != METAL:
                layer.rgb = ezdxf.colors.int2rgb(int(COLOURS[name][1:], 16))
        _dxf_entities(document.modelspace(), sheet)
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = dict(sorted(classes.classes.items()))  # ezdxf keeps them in a set
        stream = io.StringIO()
        document.write(stream)
        return stream.getvalue()
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def _dxf_entities(space: Any, sheet: Sheet) -> None:
    """Add lines, arcs (counter-clockwise in DXF), circles, dimensions (measured by the reader) and
    texts.
    """
    for name, loop in ((name, loop) for name, loops in sheet.paths.items() for loop in loops):
        if circle := circle_of(loop):
            space.add_circle(_point(circle[0]), float(circle[1]), {"layer": name})
            continue
        for segment in loop:
            if segment.centre is None:
                space.add_line(_point(segment.start), _point(segment.end), {"layer": name})
                continue
            ends = (
                (segment.start, segment.end) if segment.turn > 0 else (segment.end, segment.start)
            )
            first, last = (math.degrees(cmath.phase(end - segment.centre)) for end in ends)
            radius = float(abs(segment.start - segment.centre))
            space.add_arc(_point(segment.centre), radius, first, last, dxfattribs={"layer": name})
    height = sheet.dimensions.height
    on = {"layer": SIZES}
    look = {
        "dimtxt": height,
        "dimasz": height,
        "dimexe": height / 2,
        "dimexo": height / 2,
        "dimgap": height / 4,
    }
    look |= {"dimdec": 6, "dimzin": 8, "dimdsep": ord(".")}
    look |= dict.fromkeys(("dimclrd", "dimclre", "dimclrt"), ezdxf.const.BYLAYER)
    for span in sheet.dimensions.spans:
        given = {
            "distance": span.away,
            "text": f"{span.name} <>",
            "override": look,
            "dxfattribs": on,
        }
        space.add_aligned_dim(_point(span.start), _point(span.end), **given).render()
    for text, place, centred in sheet.texts:
        plain = text.replace("%%", 2 * "%%%").replace("^", "^ ")  # % and ^ begin control codes
        side = (
            ezdxf.enums.TextEntityAlignment.MIDDLE_CENTER
            if centred
            else ezdxf.enums.TextEntityAlignment.LEFT
        )
        space.add_text(plain, height=height, dxfattribs=on).set_placement(_point(place), align=side)


def _point(z: complex) -> tuple[float, float]:
    return float(z.real), float(z.imag)
