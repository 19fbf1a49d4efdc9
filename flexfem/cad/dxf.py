"""A drawing as DXF, by ezdxf: true lines, arcs and circles on named layers, in mm."""

from __future__ import annotations

import cmath
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import ezdxf

from flexfem.cad.sheet import COLOURS, MARKS, METAL, SIZES, Sheet

if TYPE_CHECKING:
    from ezdxf.layouts import Modelspace

    from flexfem.mechanism.bodies import Segment

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
        _add_dimensions(space, sheet)
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


def _add_dimensions(space: Modelspace, sheet: Sheet) -> None:
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
        _add_text(space, label.text, label.place, sizes.height, centred=True)
    for line, note in enumerate(sheet.notes):
        _add_text(space, note, sheet.foot - 1.6j * line * sizes.height, sizes.height)


def _add_text(space: Modelspace, text: str, at: complex, height: float, centred: bool = False) -> None:
    """A line of text, in which `%%` and `^` begin no codes."""
    plain = text.replace("%%", 2 * "%%%").replace("^", "^ ")
    side = ezdxf.enums.TextEntityAlignment.MIDDLE_CENTER if centred else ezdxf.enums.TextEntityAlignment.LEFT
    space.add_text(plain, height=height, dxfattribs={"layer": SIZES}).set_placement(_point(at), align=side)
