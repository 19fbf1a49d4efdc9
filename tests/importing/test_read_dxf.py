"""DXF drawings in the dialects of other programs: the same plate, whose area follows from its
dimensions.
"""

from __future__ import annotations

import math
from itertools import pairwise

import ezdxf
import numpy as np
import pytest
from ezdxf.math import Matrix44

from flexfem.importing.read import read_drawing
from flexfem.mechanism.outlines import area, circle_of
from flexfem.refused import BadInput

ROUND_OFF = 1e-9  # relative, of an area from coordinates with 16 digits
# relative: curves within 0.3 um of an arc, over edges of 226 mm and an area of 2,346 mm^2, are
# below it
CURVES = 1e-6
PLACE = 1e-3  # mm; the largest distance from what is drawn that a hinge does not notice

# A plate of 60 x 40 mm with a round notch of radius 4 mm in its upper side and a hole of radius 3
# mm
PLATE = 60.0 * 40.0 - math.pi * 4.0**2 / 2 - math.pi * 3.0**2
CORNERS = [(26, 40), (0, 40), (0, 0), (60, 0), (60, 40), (34, 40)]


def area_of(drawing):
    return sum(map(area, (drawing.outside, *drawing.holes)))


def lines(space, *points, **attributes):
    for start, end in pairwise(points):
        space.add_line(start, end, dxfattribs=attributes)


def points_of_arc(centre, radius, first, last, number):
    angles = np.radians(np.linspace(first, last, number + 1))
    return [(centre[0] + radius * math.cos(t), centre[1] + radius * math.sin(t)) for t in angles]


def as_entities(space, **on):
    lines(space, *CORNERS, **on)
    space.add_arc((30, 40), 4, 180, 360, dxfattribs=on)
    space.add_circle((12, 15), 3, dxfattribs=on)


def as_bulges(space):
    corners = [(x, y, 0) for x, y in CORNERS[:-1]] + [(34, 40, -1.0)]
    space.add_lwpolyline(corners, format="xyb", close=True)
    space.add_lwpolyline([(9, 15, 1.0), (15, 15, 1.0)], format="xyb", close=True)


def as_old_polylines(space):
    outline = space.add_polyline2d([*CORNERS], close=True)
    outline.vertices[-1].dxf.bulge = -1.0
    hole = space.add_polyline2d([(9, 15), (15, 15)], close=True)
    for vertex in hole.vertices:
        vertex.dxf.bulge = 1.0


def as_splines(space):
    lines(space, *CORNERS)
    notch = ezdxf.math.BSpline.from_arc(ezdxf.math.ConstructionArc((30, 40), 4, 180, 360))
    space.add_spline(dxfattribs={"degree": 2}).apply_construction_tool(notch)
    for first in (0, 180):
        half = ezdxf.math.BSpline.from_arc(
            ezdxf.math.ConstructionArc((12, 15), 3, first, first + 180)
        )
        space.add_spline().apply_construction_tool(half)


def as_fitted_splines(space):
    lines(space, *CORNERS)
    space.add_spline(fit_points=points_of_arc((30, 40), 4, 180, 360, 48))
    space.add_circle((12, 15), 3)


def as_short_lines(space):
    lines(space, *CORNERS)
    lines(space, *points_of_arc((30, 40), 4, 180, 360, 200))
    space.add_lwpolyline(points_of_arc((12, 15), 3, 0, 360, 200)[:-1], close=True)


def as_blocks(space):
    document = space.doc
    inner = document.blocks.new("NOTCHED")
    as_entities(inner)
    outer = document.blocks.new("MIRRORED")
    outer.add_blockref("NOTCHED", (0, 0), {"xscale": -0.5, "yscale": 0.5, "rotation": 30})
    space.add_blockref("MIRRORED", (100, 20), {"xscale": 2, "yscale": 2, "rotation": -75})


def as_mirrored_entities(space):
    """Drawn from below: a mirror program gives its entities an extrusion along -Z."""
    as_entities(space)
    for entity in space:
        entity.transform(Matrix44.scale(-1, 1, 1))
    assert [entity.dxf.extrusion.z for entity in space if entity.dxftype() == "ARC"] == [-1]


def as_lines_drawn_twice(space):
    as_entities(space)
    as_entities(space)
    lines(space, (10, 0), (45, 0))
    lines(space, (60, -0.0), (60, 17))
    space.add_arc((30, 40), 4, 200, 290)


def with_small_gaps(space):
    points = [np.array(each, dtype=float) for each in CORNERS]
    for start, end in pairwise(points):
        ahead = (end - start) / np.linalg.norm(end - start)
        space.add_line(start + 0.0005 * ahead, end - 0.0005 * ahead)
    space.add_arc((30, 40), 4, 180, 360)
    space.add_circle((12, 15), 3)


DIALECTS = {  # relative error of the area
    as_entities: ROUND_OFF,
    as_bulges: ROUND_OFF,
    as_old_polylines: ROUND_OFF,
    as_splines: ROUND_OFF,
    as_fitted_splines: CURVES,
    as_short_lines: CURVES,
    as_blocks: ROUND_OFF,
    as_mirrored_entities: ROUND_OFF,
    as_lines_drawn_twice: ROUND_OFF,
    with_small_gaps: CURVES,
}


def drawn(draw, folder, release="R2010", units=4, name="part.dxf"):
    document = ezdxf.new(release)
    document.header["$INSUNITS"] = units
    draw(document.modelspace())
    path = folder / name
    document.saveas(path)
    return path


@pytest.mark.parametrize("draw", DIALECTS)
def test_dialects_give_the_same_plate(draw, tmp_path):
    drawing = read_drawing(drawn(draw, tmp_path))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=DIALECTS[draw])
    arcs = [each for each in drawing.outside if each.centre is not None]
    assert len(drawing.outside) - len(arcs) == 5
    assert math.isclose(sum(abs(each.turn) for each in arcs), math.pi, rel_tol=1e-3)
    assert max(abs(each.turn) for each in arcs) < math.pi
    assert all(abs(abs(each.start - each.centre) - 4.0) < PLACE for each in arcs)
    (hole,) = drawing.holes
    assert area(hole) < 0 < area(drawing.outside)
    assert circle_of(hole) is not None and abs(circle_of(hole)[1] - 3.0) < PLACE
    for loop in (drawing.outside, *drawing.holes):
        assert all(
            before.end == after.start
            for before, after in zip(loop, [*loop[1:], loop[0]], strict=True)
        )


@pytest.mark.parametrize("release", ["R12", "R2000", "R2004", "R2007", "R2013", "R2018"])
def test_releases(release, tmp_path):
    drawing = read_drawing(drawn(as_old_polylines, tmp_path, release))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)


def test_binary_file(tmp_path):
    document = ezdxf.new()
    document.header["$INSUNITS"] = 4
    as_bulges(document.modelspace())
    with (tmp_path / "part.dxf").open("wb") as file:
        document.write(file, fmt="bin")
    assert math.isclose(area_of(read_drawing(tmp_path / "part.dxf")), PLATE, rel_tol=ROUND_OFF)


def test_what_is_done_to_a_drawing_is_said(tmp_path):
    (note,) = read_drawing(drawn(with_small_gaps, tmp_path)).notes
    assert (
        note == "Gaps that were closed: 6, of at most 0.000707 mm."
    )  # 4 corners of 0.5 um each way, 2 ends at the arc
    assert any(
        "were merged: " in each
        for each in read_drawing(drawn(as_lines_drawn_twice, tmp_path)).notes
    )
    drawing = read_drawing(drawn(as_short_lines, tmp_path))
    assert drawing.notes == (
        "Rows of short lines that are read as arcs: 2, at most 0.37 um off them.",
    )
    assert math.isclose(drawing.deviation, 3.0 * (1 - math.cos(math.pi / 200)), rel_tol=1e-6)


def test_ellipse_of_a_block_with_unequal_scales_stays_within_its_deviation(tmp_path):
    def squeezed(space):
        ring = space.doc.blocks.new("RING")
        ring.add_circle((0, 0), 10)
        space.add_blockref("RING", (5, 7), {"xscale": 3, "yscale": 1.25, "rotation": 20})

    drawing = read_drawing(drawn(squeezed, tmp_path))
    assert 0 < drawing.deviation <= 1.5e-4
    perimeter = 141.0  # mm, at most: that of an ellipse with half axes 30 and 12.5 mm
    assert math.isclose(
        area_of(drawing), math.pi * 30 * 12.5, abs_tol=perimeter * drawing.deviation
    )
    z = (
        np.concatenate([each.at(np.linspace(0, 1, 40)) for each in drawing.outside]) - (5 + 7j)
    ) * np.exp(-1j * np.deg2rad(20))
    assert np.all(np.abs(np.hypot(z.real / 30, z.imag / 12.5) - 1) < drawing.deviation / 12.5)


def test_units_of_the_file_and_of_the_user(tmp_path):
    inches = drawn(as_bulges, tmp_path, units=1)
    assert math.isclose(area_of(read_drawing(inches)), PLATE * 25.4**2, rel_tol=ROUND_OFF)
    assert math.isclose(area_of(read_drawing(inches, units="mm")), PLATE, rel_tol=ROUND_OFF)
    assert math.isclose(area_of(read_drawing(inches, units="cm")), PLATE * 100, rel_tol=ROUND_OFF)
    unstated = read_drawing(drawn(as_bulges, tmp_path, units=0))
    assert unstated.notes == ("The file states no unit, and mm is assumed.",)


def test_what_is_no_edge_of_metal_is_left_out(tmp_path):
    def annotated(space):
        as_entities(space)
        space.doc.linetypes.add("VERDECKT", [1.5, 1.0, -0.5])
        space.doc.layers.add("behind", linetype="VERDECKT")
        space.doc.layers.add("old").off()
        space.add_line((0, 20), (60, 20), {"linetype": "VERDECKT"})
        space.add_circle((40, 20), 2, {"layer": "behind"})
        space.add_circle((40, 20), 5, {"layer": "old"})
        space.add_circle((40, 20), 6, {"layer": "Dimensions"})
        space.add_text("60", dxfattribs={"insert": (30, -8)})
        space.add_mtext("two\nlines")
        space.add_linear_dim((30, -5), (0, 0), (60, 0)).render()
        space.add_hatch().paths.add_polyline_path([(1, 1), (5, 1), (5, 5)])
        space.add_xline((0, 0), (1, 1))
        space.doc.layout("Layout1").add_line((0, 0), (200, 0))

    drawing = read_drawing(drawn(annotated, tmp_path))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    (note,) = drawing.notes
    for each in (
        "texts (2)",
        "dimensions (1)",
        "hatches (1)",
        "curves of line type VERDECKT (2)",
        "layer old, which is off (1)",
    ):
        assert each in note
    assert (
        "entities on layer Dimensions (1)" in note
        and "construction lines" in note
        and "paper space" in note
    )


def test_largest_of_several_parts_is_taken_and_the_others_are_named(tmp_path):
    def three(space):
        as_entities(space, layer="PLATE")
        space.add_lwpolyline(
            [(80, 0), (100, 0), (100, 10), (80, 10)], close=True, dxfattribs={"layer": "LEVER"}
        )
        space.add_circle((120, 5), 4)

    path = drawn(three, tmp_path)
    drawing = read_drawing(path)
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    assert drawing.notes == (
        "Part 2, 200 mm^2 around (90, 5), was left out.",
        "Part 3, a disc 8 mm in diameter around (120, 5), was left out.",
    )
    assert math.isclose(area_of(read_drawing(path, part=2)), 200.0)
    assert math.isclose(area_of(read_drawing(path, part="lever")), 200.0)
    assert math.isclose(area_of(read_drawing(path, part="3")), math.pi * 16)
    with pytest.raises(BadInput, match=r"part 4, expected a number from 1 to 3"):
        read_drawing(path, part=4)
    with pytest.raises(BadInput, match=r'part "arm", expected .* one of PLATE, LEVER, 0'):
        read_drawing(path, part="arm")


def test_bodies_drawn_side_by_side_are_one_plate(tmp_path):
    """Two blocks and a leaf between them, each a closed outline; the leaf ends within a side of
    each block.
    """

    def bodies(space):
        space.add_lwpolyline([(0, 0), (20, 0), (20, 30), (0, 30)], close=True)
        space.add_lwpolyline([(50, 0), (65, 0), (65, 30), (50, 30)], close=True)
        space.add_lwpolyline([(20, 12), (50, 12), (50, 12.4), (20, 12.4)], close=True)

    drawing = read_drawing(drawn(bodies, tmp_path))
    assert math.isclose(area_of(drawing), 600 + 450 + 30 * 0.4, rel_tol=ROUND_OFF)
    assert drawing.holes == () and len(drawing.outside) == 12


def test_two_leaves_side_by_side_enclose_a_void(tmp_path):
    def bodies(space):
        space.add_lwpolyline([(0, 0), (20, 0), (20, 30), (0, 30)], close=True)
        space.add_lwpolyline([(50, 0), (65, 0), (65, 30), (50, 30)], close=True)
        for y in (3, 24):
            lines(space, (20, y), (50, y))
            lines(space, (20, y + 0.4), (50, y + 0.4))

    drawing = read_drawing(drawn(bodies, tmp_path))
    assert math.isclose(area_of(drawing), 600 + 450 + 2 * 30 * 0.4, rel_tol=ROUND_OFF)
    assert [math.isclose(-area(hole), 30 * 20.6, rel_tol=ROUND_OFF) for hole in drawing.holes] == [
        True
    ]


def test_island_in_a_void_is_another_part(tmp_path):
    def ring(space):
        for radius in (30, 20, 10):
            space.add_circle((0, 0), radius)

    drawing = read_drawing(drawn(ring, tmp_path))
    assert math.isclose(area_of(drawing), math.pi * (900 - 400), rel_tol=ROUND_OFF)
    assert drawing.notes == ("Part 2, a disc 20 mm in diameter around (0, 0), was left out.",)


def test_kerf_takes_half_its_width_from_every_edge(tmp_path):
    drawing = read_drawing(drawn(as_entities, tmp_path), kerf=0.5)
    # straight sides move by 0.25 mm, the arc of the notch to 4.25 mm and the hole to 3.25 mm; the
    # notch keeps its sharp
    # corners in the metal, which are now those of the circle and the lowered side: a sector less a
    # triangle
    half = math.acos(0.25 / 4.25)
    notch = 4.25**2 * half - 0.25 * math.sqrt(4.25**2 - 0.25**2)
    expected = 59.5 * 39.5 - notch - math.pi * 3.25**2
    assert math.isclose(area_of(drawing), expected, rel_tol=ROUND_OFF)
    with pytest.raises(BadInput, match=r"part\.dxf: kerf of 9 mm, expected less than every width"):
        read_drawing(drawn(as_entities, tmp_path), kerf=9)


# Layers that mark a place


def test_marks_do_not_change_the_metal(tmp_path):
    def marked(space):
        as_entities(space, layer="CUT")
        space.add_lwpolyline(
            [(0, 0), (60, 0), (60, 6), (0, 6)], close=True, dxfattribs={"layer": "GROUND"}
        )
        space.add_lwpolyline(
            [(-5, 20), (5, 20), (5, 30), (-5, 30)], close=True, dxfattribs={"layer": "Clamp left"}
        )
        space.add_point((50, 35), {"layer": "OUTPUT"})
        space.add_circle((40, 20), 2, {"layer": "SCREWS"})

    drawing = read_drawing(drawn(marked, tmp_path))
    assert math.isclose(area_of(drawing), PLATE - math.pi * 4, rel_tol=ROUND_OFF)
    marks = {mark.layer: mark for mark in drawing.marks}
    assert set(marks) == {"GROUND", "Clamp left", "OUTPUT", "SCREWS"}
    assert marks["OUTPUT"].points == (50 + 35j,)
    assert set(marks["GROUND"].points) == {0, 60, 60 + 6j, 6j} and marks["GROUND"].closed


def test_metal_on_a_layer_of_marks_is_metal(tmp_path):
    """The lower side is drawn on GROUND only, as an open line; without it the plate would be open."""

    def grounded(space):
        lines(space, (0, 0), (0, 40), (60, 40), (60, 0), layer="0")
        lines(space, (60, 0), (0, 0), layer="GROUND")

    drawing = read_drawing(drawn(grounded, tmp_path))
    assert math.isclose(area_of(drawing), 2400.0)
    (mark,) = drawing.marks
    assert mark.layer == "GROUND" and set(mark.points) == {0, 60} and not mark.closed
    assert drawing.notes == ("Curves on layer GROUND are edges of metal too.",)


def test_body_beside_others_on_a_layer_of_marks_is_metal(tmp_path):
    def bodies(space):
        space.add_lwpolyline(
            [(0, 0), (20, 0), (20, 30), (0, 30)], close=True, dxfattribs={"layer": "GROUND"}
        )
        space.add_lwpolyline(
            [(50, 0), (65, 0), (65, 30), (50, 30)], close=True, dxfattribs={"layer": "OUTPUT"}
        )
        space.add_lwpolyline(
            [(20, 12), (50, 12), (50, 12.4), (20, 12.4)], close=True, dxfattribs={"layer": "LEAF"}
        )

    drawing = read_drawing(drawn(bodies, tmp_path))
    assert math.isclose(area_of(drawing), 600 + 450 + 12, rel_tol=ROUND_OFF)
    assert {mark.layer: set(mark.points) for mark in drawing.marks}["GROUND"] == {
        0,
        20,
        20 + 30j,
        30j,
    }


# Refusals


def crossing(space):
    space.add_lwpolyline([(0, 0), (40, 30), (40, 0), (0, 30)], close=True)


def crossing_contours(space):
    as_entities(space)
    space.add_circle((59, 15), 3)


def open_contour(space):
    lines(space, (0, 0), (60, 0), (60, 40), (0, 40), (0, 0.25))
    space.add_circle((20, 20), 5)


def touching(space):
    as_entities(space)
    space.add_lwpolyline([(40, 20), (45, 15), (60, 20), (45, 25)], close=True)


def endless(space):
    space.doc.blocks.new("A").add_blockref("B", (0, 0))
    space.doc.blocks.new("B").add_blockref("A", (0, 0))
    space.add_blockref("A", (0, 0))


def too_many(space):
    tile = space.doc.blocks.new("T")
    tile.add_circle((0, 0), 1)
    row = space.doc.blocks.new("ROW")
    row.add_blockref(
        "T", (0, 0), {"row_count": 500, "column_count": 500, "row_spacing": 3, "column_spacing": 3}
    )
    space.add_blockref(
        "ROW",
        (0, 0),
        {"row_count": 500, "column_count": 500, "row_spacing": 9, "column_spacing": 9},
    )


REFUSED = {
    crossing: r"contours cross at \(20, 15\)",
    crossing_contours: r"contours cross at \(60, 1[27]\.8284\)",
    open_contour: r"a gap of 0\.25 mm between \(0, 0\) and \(0, 0\.25\) \(layer \"0\"\)",
    touching: r"contours touch each other at \(60, 20\)",
    endless: r"blocks in blocks deeper than 32",
    too_many: r"entities with those of blocks, expected fewer|repeated",
    lambda space: None: r"no curve of a contour, expected the closed contours",
    lambda space: space.add_text("only text"): r"no curve of a contour; left out: texts \(1\)",
    lambda space: space.add_circle((1.025, 0), 1.025): r"2\.05 mm across: inches\?",
    lambda space: space.add_circle((0, 0), 60_000): r"1\.2e\+05 mm across: um\?",
    lambda space: space.add_circle((math.nan, 0), 60): r"finite numbers",
    lambda space: space.add_circle((1e12, 0), 60): r"coordinates of 1e\+12 mm",
}


@pytest.mark.parametrize("draw", REFUSED)
def test_refusals_are_one_line(draw, tmp_path):
    path = drawn(draw, tmp_path)
    with pytest.raises(BadInput, match=REFUSED[draw]) as raised:
        read_drawing(path)
    assert str(raised.value).startswith(f"{path}: ") and len(str(raised.value).splitlines()) == 1


def test_a_file_that_takes_too_long_is_refused(tmp_path, monkeypatch):
    path = drawn(as_entities, tmp_path)
    monkeypatch.setattr("flexfem.importing.limit.TIME_LIMIT", 0.0)
    with pytest.raises(BadInput, match=r"part\.dxf: not read within 0 s, expected a simpler"):
        read_drawing(path)


def test_copies_of_an_empty_block_are_refused_in_time(tmp_path, monkeypatch):
    """Each reference counts as one entity, however many copies of nothing it draws."""

    def repeated(space):
        space.doc.blocks.new("NOTHING")
        for _ in range(20):
            space.add_blockref(
                "NOTHING", (0, 0), {"row_count": 1000, "column_count": 100, "row_spacing": 1}
            )

    monkeypatch.setattr("flexfem.importing.limit.TIME_LIMIT", 0.2)
    with pytest.raises(BadInput, match=r"not read within 0.2 s"):
        read_drawing(drawn(repeated, tmp_path))


def test_wider_tolerance_closes_a_gap(tmp_path):
    drawing = read_drawing(drawn(open_contour, tmp_path), tolerance=0.3)
    assert math.isclose(area_of(drawing), 2400 - math.pi * 25, rel_tol=0.3 * 60 / 2400)
    assert drawing.notes == ("Gaps that were closed: 1, of at most 0.25 mm.",)


LINE = b"0\nLINE\n8\n0\n10\n0\n20\n0\n11\n1\n21\n1\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"0\nSECTION\n2\nENTITIES\n" + LINE * 250_000 + b"0\nENDSEC\n0\nEOF\n",
            "250,003 entities, expected at most",
        ),
        (b"", "an empty file"),
        (b" \n\t\n", "an empty file"),
        (b"PK\x03\x04\x00\x00", "neither text nor a binary DXF file"),
        (b"AC1027\x00\x00", "a DWG file, expected DXF"),
        (b"<svg/>", "no entity, expected a DXF file"),
        (b"  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n", "without its end marker EOF"),
    ],
)
def test_files_that_are_no_drawing(content, message, tmp_path):
    path = tmp_path / "part.dxf"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=message):
        read_drawing(path)


def test_paths_and_arguments(tmp_path):
    path = drawn(as_entities, tmp_path)
    for arguments, message in (
        ({"units": "furlong"}, "units 'furlong', expected"),
        ({"kerf": -0.1}, "kerf -0.1, expected a number from 0"),
        ({"tolerance": math.nan}, "tolerance nan, expected"),
        ({"thickness": 0}, "thickness 0, expected"),
        ({"part": True}, "part True, expected"),
    ):
        with pytest.raises(BadInput, match=message):
            read_drawing(path, **arguments)
    with pytest.raises(BadInput, match="no such file"):
        read_drawing(tmp_path / "other.dxf")
    with pytest.raises(
        BadInput, match=r"extension '\.dwg', expected .* \.dxf, \.step, \.stp, \.svg"
    ):
        read_drawing(tmp_path / "part.dwg")
    assert read_drawing(path, thickness=6).thickness == 6.0
