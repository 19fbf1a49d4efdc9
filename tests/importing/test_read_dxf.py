"""DXF drawings in the dialects of other programs: the same plate, whose area follows from its dimensions."""

from __future__ import annotations

import math
from itertools import pairwise

import ezdxf
import pytest

from flexfem.importing.read import read_drawing
from flexfem.mechanism.outlines import area, circle_of
from flexfem.refused import BadInput

ROUND_OFF = 1e-9  # relative, of an area from coordinates with 16 digits

# A plate of 60 x 40 mm with a round notch of radius 4 mm in the middle of its upper side and a hole of 3 mm radius
PLATE = 60.0 * 40.0 - math.pi * 4.0**2 / 2 - math.pi * 3.0**2


def area_of(drawing):
    return sum(map(area, (drawing.outside, *drawing.holes)))


def saved(document, folder, name="part.dxf"):
    path = folder / name
    document.saveas(path)
    return path


def lines(space, *points, **attributes):
    for start, end in pairwise(points):
        space.add_line(start, end, dxfattribs=attributes)


def as_entities(space, scale=1.0, layer="0"):
    on = {"layer": layer}
    corners = [(26, 40), (0, 40), (0, 0), (60, 0), (60, 40), (34, 40)]
    lines(space, *((x * scale, y * scale) for x, y in corners), **on)
    space.add_arc((30 * scale, 40 * scale), 4 * scale, 180, 360, dxfattribs=on)
    space.add_circle((12 * scale, 15 * scale), 3 * scale, dxfattribs=on)


def drawn(release="R2010", units=4, draw=as_entities, **arguments):
    document = ezdxf.new(release)
    document.header["$INSUNITS"] = units
    draw(document.modelspace(), **arguments)
    return document


def test_lines_arcs_and_circles_stay_what_they_are(tmp_path):
    drawing = read_drawing(saved(drawn(), tmp_path))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    assert len([each for each in drawing.outside if each.centre is None]) == 5
    assert {each.centre for each in drawing.outside if each.centre is not None} == {30 + 40j}
    centre, radius = circle_of(drawing.holes[0])
    assert abs(centre - (12 + 15j)) < 1e-9 and math.isclose(radius, 3.0)
    assert drawing.deviation == 0.0 and drawing.thickness is None and drawing.notes == ()


def test_gap_is_refused_with_both_coordinates(tmp_path):
    document = ezdxf.new()
    document.header["$INSUNITS"] = 4
    lines(document.modelspace(), (0, 0), (60, 0), (60, 40), (0, 40), (0, 0.25))
    with pytest.raises(BadInput, match=r"part\.dxf: a gap of 0\.25 mm between \(0, 0\) and \(0, 0\.25\)"):
        read_drawing(saved(document, tmp_path))
