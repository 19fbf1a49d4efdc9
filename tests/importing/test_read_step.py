"""Solids that another program, Open CASCADE through netgen, writes: in any position and unit,
chamfered, with holes.
"""

from __future__ import annotations

import math

import pytest

from flexfem.importing.read import read_drawing
from flexfem.mechanism.outlines import area, circle_of
from flexfem.refused import BadInput

occ = pytest.importorskip("netgen.occ")

ROUND_OFF = 1e-9  # relative, of an area of a solid that was turned and written with 15 digits
THICK = 6.5  # mm
PLATE = (
    60.0 * 40.0 - math.pi * 4.0**2 / 2 - math.pi * 3.0**2
)  # mm^2, notch of radius 4 mm, hole of radius 3 mm


def area_of(drawing):
    return sum(map(area, (drawing.outside, *drawing.holes)))


def cylinder(x, y, radius, low=0.0, height=THICK):
    return occ.Cylinder(occ.Pnt(x, y, low), occ.Z, radius, height)


def plate():
    return (
        occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(60, 40, THICK))
        - cylinder(30, 40, 4)
        - cylinder(12, 15, 3)
    )


def written(shape, folder, name="part.step"):
    path = folder / name
    shape.WriteStep(str(path))
    return path


def test_outline_and_thickness(tmp_path):
    drawing = read_drawing(written(plate(), tmp_path))
    assert math.isclose(drawing.thickness, THICK, rel_tol=ROUND_OFF)
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    assert all(
        abs(each.centre - (30 + 40j)) < 1e-6 for each in drawing.outside if each.centre is not None
    )
    centre, radius = circle_of(drawing.holes[0])
    assert abs(centre - (12 + 15j)) < 1e-6 and math.isclose(radius, 3.0, rel_tol=1e-6)
    assert drawing.deviation < 1e-6


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, -1), (1, -2, 0.7)])
def test_any_position_in_space(axis, tmp_path):
    turned = plate().Rotate(occ.Axis(occ.Pnt(3, 5, 7), occ.Dir(*axis)), 73.0).Move((11, -90, 35))
    drawing = read_drawing(written(turned, tmp_path, "part.stp"))
    assert math.isclose(drawing.thickness, THICK, rel_tol=1e-7)
    assert math.isclose(area_of(drawing), PLATE, rel_tol=1e-7)


def test_thick_part_is_not_taken_from_its_side(tmp_path):
    """20 x 16 mm and 50 mm deep: the notch is round along one direction only."""
    thick = occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(20, 16, 50)) - cylinder(10, 16, 5, 0, 50)
    drawing = read_drawing(written(thick, tmp_path))
    assert math.isclose(drawing.thickness, 50.0, rel_tol=1e-7)
    assert math.isclose(area_of(drawing), 320 - math.pi * 25 / 2, rel_tol=1e-7)


def test_chamfers_and_blind_holes_are_left_out_and_named(tmp_path):
    cone = occ.Cone(
        occ.Axes(occ.Pnt(45, 20, 0), occ.Z), 4.0, 3.0, 1.0, 2 * math.pi
    )  # a chamfer of 1 mm at a hole
    solid = plate() - cylinder(45, 20, 3) - cone - cylinder(50, 30, 2, THICK - 2.0, 2.0)
    drawing = read_drawing(written(solid, tmp_path))
    assert math.isclose(area_of(drawing), PLATE - math.pi * 9, rel_tol=1e-7)
    (note,) = (each for each in drawing.notes if "left out" in each)
    assert "cone (1, " in note and "plane (1, 12.57 mm^2)" in note
    removed = (
        math.pi * 4 * 2 + math.pi * (16 + 12 + 9) / 3 - math.pi * 9
    )  # mm^3, the blind hole and the chamfer
    change = 100 * removed / ((PLATE - math.pi * 9) * THICK - removed)
    assert f"changes the volume by {change:+.2g} %" in note


def test_solid_that_is_no_plate_is_refused(tmp_path):
    step = plate() + occ.Box(occ.Pnt(0, 0, THICK), occ.Pnt(30, 20, 2 * THICK))
    with pytest.raises(BadInput, match=r"no plate of one thickness: .* plane \("):
        read_drawing(written(step, tmp_path))
    with pytest.raises(BadInput, match="without two parallel plane faces"):
        read_drawing(written(occ.Sphere(occ.Pnt(0, 0, 0), 20), tmp_path))


def test_solids_of_an_assembly(tmp_path):
    small = occ.Box(occ.Pnt(100, 0, 0), occ.Pnt(110, 10, 2))
    small.name = "shim"
    large = plate()
    large.name = "frame"
    path = written(occ.Compound([small, large]), tmp_path)
    drawing = read_drawing(path)
    assert math.isclose(area_of(drawing), PLATE, rel_tol=1e-7)
    assert drawing.notes[-1] == "Other solids of the file were left out: shim."
    for part in (2, "2", "Shim"):
        shim = read_drawing(path, part=part)
        assert math.isclose(area_of(shim), 100.0, rel_tol=1e-7) and math.isclose(
            shim.thickness, 2.0
        )
    with pytest.raises(
        BadInput, match=r"part 3, expected a number from 1 to 2 or one of frame, shim"
    ):
        read_drawing(path, part=3)


@pytest.mark.parametrize(
    ("unit", "factor"), [("SI_UNIT(.CENTI.,.METRE.)", 10.0), ("SI_UNIT($,.METRE.)", 1000.0)]
)
def test_units_of_the_file(unit, factor, tmp_path):
    text = written(plate(), tmp_path).read_text()
    assert text.count("SI_UNIT(.MILLI.,.METRE.)") == 1
    small = occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(2, 1, 0.25))
    path = tmp_path / "unit.step"
    path.write_text(written(small, tmp_path).read_text().replace("SI_UNIT(.MILLI.,.METRE.)", unit))
    drawing = read_drawing(path)
    assert math.isclose(drawing.thickness, 0.25 * factor, rel_tol=1e-7)
    assert math.isclose(area_of(drawing), 2 * factor**2, rel_tol=1e-7)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("solid of another kind", "no STEP file, expected one that begins with ISO-10303-21"),
        ("ISO-10303-21;\nHEADER;\n", "ends without END-ISO-10303-21"),
        (
            "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n",
            "not readable as STEP|no solid",
        ),
    ],
)
def test_files_that_are_no_solid(content, message, tmp_path):
    path = tmp_path / "part.step"
    path.write_text(content)
    with pytest.raises(BadInput, match=message) as raised:
        read_drawing(path)
    assert len(str(raised.value).splitlines()) == 1


def test_surface_alone_is_no_solid(tmp_path):
    face = occ.WorkPlane().Rectangle(60, 40).Face()
    with pytest.raises(BadInput, match="no solid, expected a plate as a solid"):
        read_drawing(written(face, tmp_path))
