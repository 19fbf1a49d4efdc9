"""A workshop drawing as DXF."""

from __future__ import annotations

import cmath
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import ezdxf

from flexfem.cad.sheet import COLOURS, METAL, SIZES, Sheet, Text
from flexfem.mechanism.dimensions import Span
from flexfem.mechanism.outlines import Segment, circle_of

VERSION = "R2010"  # UTF-8, and read by current programs
MILLIMETRES = 4  # of $INSUNITS
METRIC = 1  # of $MEASUREMENT
DECIMAL = 2  # of $LUNITS
ALIGNMENT = ezdxf.enums.TextEntityAlignment


def dxf_text(sheet: Sheet) -> str:
    """Return the text of a DXF file; equal drawings give equal texts."""
    with _fixed_metadata():
        document = ezdxf.new(VERSION)
        document.header["$INSUNITS"] = MILLIMETRES
        document.header["$MEASUREMENT"] = METRIC
        document.header["$LUNITS"] = DECIMAL
        document.header["$LUPREC"] = 8  # decimals
        for name in sheet.paths:
            layer = document.layers.add(name)
            if name != METAL:  # the part is in colour 7: black or white, opposite to the background
                layer.rgb = ezdxf.colors.int2rgb(int(COLOURS[name][1:], 16))
        _add_entities(document.modelspace(), sheet)
        classes = document.classes
        classes.add_required_classes(document.dxfversion)
        classes.classes = dict(sorted(classes.classes.items()))  # ezdxf keeps them in a set
        stream = io.StringIO()
        document.write(stream)
        return stream.getvalue()


@contextmanager
def _fixed_metadata() -> Iterator[None]:
    """Let ezdxf write no times and no random identifiers."""
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def _add_entities(space: Any, sheet: Sheet) -> None:
    """Add contours, dimensions (measured by the reader) and texts."""
    for name, loops in sheet.paths.items():
        for loop in loops:
            _add_loop(space, loop, name)
    height = sheet.dimensions.height
    for span in sheet.dimensions.spans:
        _add_dimension(space, span, height)
    for text in sheet.texts:
        _add_text(space, text, height)


def _add_loop(
    space: Any,
    loop: list[Segment],
    layer: str,
) -> None:
    """Add a loop as a circle if it is one, else as lines and arcs, counter-clockwise in DXF."""
    on = {"layer": layer}
    circle = circle_of(loop)
    if circle is not None:
        centre, radius = circle
        space.add_circle(_point(centre), float(radius), on)
        return
    for segment in loop:
        if segment.centre is None:
            space.add_line(_point(segment.start), _point(segment.end), on)
            continue
        ends = [segment.start, segment.end]
        if segment.turn <= 0:
            ends.reverse()
        first, last = (math.degrees(cmath.phase(end - segment.centre)) for end in ends)
        radius = float(abs(segment.start - segment.centre))
        space.add_arc(_point(segment.centre), radius, first, last, dxfattribs=on)


def _add_dimension(
    space: Any,
    span: Span,
    height: float,
) -> None:
    """Add an aligned dimension, whose length the reader measures."""
    look = {
        "dimtxt": height,
        "dimasz": height,
        "dimexe": height / 2,
        "dimexo": height / 2,
        "dimgap": height / 4,
        "dimdec": 6,
        "dimzin": 8,
        "dimdsep": ord("."),
        **dict.fromkeys(("dimclrd", "dimclre", "dimclrt"), ezdxf.const.BYLAYER),
    }
    given = {"text": f"{span.name} <>", "override": look, "dxfattribs": {"layer": SIZES}}
    ends = (_point(span.start), _point(span.end))
    space.add_aligned_dim(*ends, distance=span.away, **given).render()


def _add_text(
    space: Any,
    text: Text,
    height: float,
) -> None:
    plain = text.text.replace("%%", 2 * "%%%").replace("^", "^ ")  # % and ^ begin control codes
    side = ALIGNMENT.MIDDLE_CENTER if text.is_centred else ALIGNMENT.LEFT
    added = space.add_text(plain, height=height, dxfattribs={"layer": SIZES})
    added.set_placement(_point(text.place), align=side)


def _point(z: complex) -> tuple[float, float]:
    return float(z.real), float(z.imag)
