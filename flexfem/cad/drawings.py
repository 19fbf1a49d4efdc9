"""Drawings of a part, layer by layer, as SVG and as DXF: true lines, arcs and circles in mm."""

from __future__ import annotations

import cmath
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

import ezdxf

from flexfem.files.refusals import one_line
from flexfem.mechanism.bodies import Segment, necks
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.mechanism.drawing import LETTER, Dimensions, Hole, Part, cut_path, dimensions_of
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.mechanism.stage_file import counted

if TYPE_CHECKING:
    from ezdxf.layouts import Modelspace

METAL, HUB, MOUNTING, PADS = "METAL", "HUB_HOLE", "MOUNTING_HOLES", "CLAMPED_PADS"
MARKS, SIZES, WIRE = "CENTRE_MARKS", "DIMENSIONS", "WIRE_PATH"
LONGEST = 100  # letters of a name on a drawing
COLOURS = {  # of each layer, dark on white
    METAL: "#1A1A1A",
    HUB: "#B00000",
    MOUNTING: "#B00000",
    PADS: "#0072B2",
    MARKS: "#707070",
    SIZES: "#007A58",
    WIRE: "#CC3399",
}


class Sheet(NamedTuple):
    """A drawing in mm, x to the right and y upwards, the platform centre at the origin.

    loops : closed loops of segments by layer.   holes : circles by layer.   marks : centres to mark (complex).
    notes : lines of text below it, from `foot`, the complex place of the first.
    """

    loops: dict[str, list[list[Segment]]]
    holes: dict[str, list[Hole]]
    marks: list[complex]
    dimensions: Dimensions
    notes: list[str]
    foot: complex

    @property
    def layers(self) -> list[str]:
        """Names of the layers that hold anything, in the order of `COLOURS`."""
        used = {*self.loops, *self.holes, MARKS, SIZES}
        return [name for name in COLOURS if name in used]


def sheet_of(stage: Stage, part: Part, kerf: float | None = None) -> Sheet:
    """The drawing of a stage's part, with the path of a wire that cuts `kerf` mm wide where that is given.

    Raises BadInput for a kerf too wide for the part.
    """
    loops, holes = {METAL: [part.outer], PADS: part.pads}, {HUB: [part.hub]}
    if part.mounting:
        holes[MOUNTING] = part.mounting
    if kerf is not None:
        path = cut_path(part, kerf)
        loops[WIRE], holes[WIRE] = [path.outer], path.holes
    placed = [pose.point * cmath.exp(1j * (chain - 1) * CHAIN_TURN) for chain in CHAINS for pose in necks(stage, chain)]
    sizes = dimensions_of(stage, part)
    ends = [each.start for each in part.outer]
    lowest = min(z.imag for z in [*ends, *(label.place for label in sizes.labels)])
    foot = complex(min(z.real for z in ends), lowest - 5 * sizes.height)
    marks = [*placed, *(hole.centre for hole in part.holes)]
    return Sheet(loops, holes, marks, sizes, list(notes_of(stage, part, kerf)), foot)


def notes_of(stage: Stage, part: Part, kerf: float | None) -> Iterator[str]:
    """What a reader of the drawing must know, one line each."""
    yield one_line(stage.name, LONGEST)
    yield f"mm; thickness {stage.thickness:.6g}; {one_line(stage.material.name, LONGEST)}"
    if stage.chains_alike:
        yield "chains 2 and 3 as chain 1, turned by 120 and 240 degrees"
    for said, keys in (("ASSUMED", stage.assumed), ("NO STATED SOURCE", stage.not_stated)):
        if keys:
            yield f"{said}: {counted(len(keys), 'number', 'numbers')} of geometry and material"
    yield "In the models: clamped along the back edges of the pads, the hub hole filled by a rigid disc."
    if part.mounting:
        yield "Not in the models: the mounting holes."
    if kerf is not None:
        yield f"{WIRE}: middle of a cut {kerf:.6g} mm wide, wire and spark gap together"


# SVG

LINE = 0.1  # mm, width of the lines
HEAD = 3.0  # length of an arrow per half of its width


def svg_text(sheet: Sheet) -> str:
    """The text of an SVG file; its y axis points down, so that every y is the negative of the drawing's."""
    low, high = _corners(sheet)
    box = (low.real, -high.imag, (high - low).real, (high - low).imag)
    size = {"width": f"{_digits(box[2])}mm", "height": f"{_digits(box[3])}mm", "viewBox": " ".join(map(_digits, box))}
    root = ElementTree.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", **size})
    ElementTree.SubElement(root, "title").text = sheet.notes[0]
    look = {"fill": "none", "stroke-width": str(LINE)}
    groups = {
        name: ElementTree.SubElement(root, "g", {"id": name, "stroke": COLOURS[name], **look}) for name in sheet.layers
    }
    for name, loops in sheet.loops.items():
        for loop in loops:
            ElementTree.SubElement(groups[name], "path", {"d": _svg_path(loop)})
    for name, holes in sheet.holes.items():
        for hole in holes:
            round_about = {"cx": _digits(hole.centre.real), "cy": _digits(-hole.centre.imag), "r": _digits(hole.radius)}
            ElementTree.SubElement(groups[name], "circle", round_about)
    arm = sheet.dimensions.height / 2
    for centre in sheet.marks:
        for way in (arm, 1j * arm):
            _svg_line(groups[MARKS], centre - way, centre + way)
    _svg_dimensions(groups[SIZES], sheet)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _corners(sheet: Sheet) -> tuple[complex, complex]:
    """Lower left and upper right corner of all that is drawn."""
    sizes = sheet.dimensions
    points = [each.start for loops in sheet.loops.values() for loop in loops for each in loop]
    points += [end for span in sizes.spans for end in span.line]
    for label in sizes.labels:
        points += [label.place - label.half, label.place + label.half]
    for line, note in enumerate(sheet.notes):
        points += [sheet.foot + sizes.height * (step - 1.6j * line) for step in (0.0, LETTER * len(note))]
    margin = 3 * sizes.height * (1 + 1j)
    x, y = [z.real for z in points], [z.imag for z in points]
    return complex(min(x), min(y)) - margin, complex(max(x), max(y)) + margin


def _digits(value: float) -> str:
    """All digits of a number."""
    return repr(float(value))


def _pair(z: complex) -> str:
    return f"{_digits(z.real)} {_digits(-z.imag)}"


def _svg_path(loop: list[Segment]) -> str:
    """A closed path; no arc is longer than half a turn, and counter-clockwise is no positive sense where y is down."""
    steps = [f"M {_pair(loop[0].start)}"]
    for segment in loop:
        if segment.centre is None:
            steps.append(f"L {_pair(segment.end)}")
        else:
            radius = _digits(abs(segment.start - segment.centre))
            steps.append(f"A {radius} {radius} 0 0 {int(segment.turn < 0)} {_pair(segment.end)}")
    return " ".join([*steps, "Z"])


def _svg_line(group: Any, start: complex, end: complex) -> None:
    ends = {"x1": start.real, "y1": -start.imag, "x2": end.real, "y2": -end.imag}
    ElementTree.SubElement(group, "line", {name: _digits(value) for name, value in ends.items()})


def _svg_dimensions(group: Any, sheet: Sheet) -> None:
    sizes = sheet.dimensions
    for span in sizes.spans:
        start, end = span.line
        for foot, head in ((span.start, start), (span.end, end)):
            _svg_line(group, foot, head)
        _svg_line(group, start, end)
        along = (end - start) / abs(end - start)
        for tip, way in ((start, along), (end, -along)):
            back = tip + sizes.height * way
            half = 1j * way * sizes.height / HEAD / 2
            corners = " ".join(map(_pair, (tip, back + half, back - half)))
            ElementTree.SubElement(group, "polygon", {"points": corners, "fill": COLOURS[SIZES]})
        _svg_text(group, span.text, (start + end) / 2 + 0.4j * along * sizes.height, sizes.height, along)
    for label in sizes.labels:
        _svg_line(group, *label.line)
        _svg_text(group, label.text, label.place - 0.35j * sizes.height, sizes.height)
    for line, note in enumerate(sheet.notes):
        _svg_text(group, note, sheet.foot - 1.6j * line * sizes.height, sizes.height, anchor="start")


def _svg_text(group: Any, text: str, at: complex, height: float, along: complex = 1, anchor: str = "middle") -> None:
    """A line of text along a direction, its base line through a place."""
    turned = {"transform": f"rotate({-math.degrees(cmath.phase(along)):.6f} {_pair(at)})"} if along != 1 else {}
    place = {"x": _digits(at.real), "y": _digits(-at.imag), "text-anchor": anchor, **turned}
    look = {"fill": COLOURS[SIZES], "stroke": "none", "font-size": f"{height:.6g}", "font-family": "sans-serif"}
    ElementTree.SubElement(group, "text", place | look).text = text


# DXF

VERSION = "R2010"  # UTF-8, and read by what is in use
MILLIMETRE = 4  # of $INSUNITS


def dxf_text(sheet: Sheet) -> str:
    """The text of a DXF file; the same drawing gives the same text."""
    with _reproducible():
        document = ezdxf.new(VERSION)
        document.header["$INSUNITS"] = MILLIMETRE
        document.header["$MEASUREMENT"] = 1  # metric
        document.header["$LUNITS"], document.header["$LUPREC"] = 2, 8  # decimal
        for name in sheet.layers:
            layer = document.layers.add(name)  # metal in colour 7, black or white as the background is not
            if name != METAL:
                layer.rgb = ezdxf.colors.int2rgb(int(COLOURS[name][1:], 16))
        space = document.modelspace()
        for name, loops in sheet.loops.items():
            for segment in (each for loop in loops for each in loop):
                _add_segment(space, segment, name)
        for name, holes in sheet.holes.items():
            for hole in holes:
                space.add_circle(_point(hole.centre), float(hole.radius), {"layer": name})
        arm = sheet.dimensions.height / 2
        for centre in sheet.marks:
            for way in (arm, 1j * arm):
                space.add_line(_point(centre - way), _point(centre + way), {"layer": MARKS})
        _dxf_dimensions(space, sheet)
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = dict(sorted(classes.classes.items()))  # ezdxf has them in a set
        stream = io.StringIO()
        document.write(stream)
        return stream.getvalue()


@contextmanager
def _reproducible() -> Iterator[None]:
    """ezdxf without times and random identifiers in what it writes."""
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def _point(z: complex) -> tuple[float, float]:
    return float(z.real), float(z.imag)


def _add_segment(space: Modelspace, segment: Segment, layer: str) -> None:
    """A line, or an arc, which runs counter-clockwise in DXF."""
    if segment.centre is None:
        space.add_line(_point(segment.start), _point(segment.end), {"layer": layer})
        return
    ends = (segment.start, segment.end) if segment.turn > 0 else (segment.end, segment.start)
    first, last = (math.degrees(cmath.phase(end - segment.centre)) for end in ends)
    radius = float(abs(segment.start - segment.centre))
    space.add_arc(_point(segment.centre), radius, first, last, dxfattribs={"layer": layer})


def _dxf_dimensions(space: Modelspace, sheet: Sheet) -> None:
    """Dimension entities, which measure what is drawn, labels with their lines, and the notes."""
    sizes, on = sheet.dimensions, {"layer": SIZES}
    look = {"dimtxt": sizes.height, "dimasz": sizes.height, "dimexe": sizes.height / 2, "dimexo": sizes.height / 2}
    look |= {"dimdec": 6, "dimzin": 8, "dimdsep": ord("."), "dimgap": sizes.height / 4}
    look |= dict.fromkeys(("dimclrd", "dimclre", "dimclrt"), ezdxf.const.BYLAYER)
    for span in sizes.spans:
        ends = _point(span.start), _point(span.end)
        text = f"{span.name} <>"
        space.add_aligned_dim(*ends, distance=span.away, text=text, override=look, dxfattribs=on).render()
    for label in sizes.labels:
        anchor, edge = label.line
        space.add_line(_point(anchor), _point(edge), on)
        _dxf_text(space, label.text, label.place, sizes.height, centred=True)
    for line, note in enumerate(sheet.notes):
        _dxf_text(space, note, sheet.foot - 1.6j * line * sizes.height, sizes.height)


def _dxf_text(space: Modelspace, text: str, at: complex, height: float, centred: bool = False) -> None:
    """A line of text, in which `%%` and `^` begin no codes."""
    plain = text.replace("%%", 2 * "%%%").replace("^", "^ ")
    side = ezdxf.enums.TextEntityAlignment.MIDDLE_CENTER if centred else ezdxf.enums.TextEntityAlignment.LEFT
    space.add_text(plain, height=height, dxfattribs={"layer": SIZES}).set_placement(_point(at), align=side)
