"""Departure of a plate from a mechanism: by hinge, at the edge, and what it does to stiffness and
frequency.
"""

from __future__ import annotations

import math

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf.math import Matrix44

import flexfem as api
from flexfem.importing.departure import departure, fine_polygon
from flexfem.mechanism.edges import mapped
from flexfem.mechanism.layout import Move
from flexfem.mechanism.outlines import disc, reverse
from flexfem.questions.departed import moved, registered
from flexfem.refused import BadInput

STAGE = "geometry/parallelogram.toml"


def inverse(move):
    """The move that takes moved points back."""
    factor = move.factor if move.mirrored else move.factor.conjugate()
    back = Move(factor, 0j, move.mirrored)
    return back._replace(shift=-back(move.shift))


@pytest.fixture
def written(tmp_path):
    def write(file, **changes):
        path = tmp_path / file
        api.load(STAGE).replace(**changes).save(path)
        return path

    return write


def test_a_thicker_leaf_is_named_with_what_it_does_to_the_stiffness(written):
    changed = written("thick.toml", parameters={"neck_mm": 0.512})
    found = api.compare(STAGE, changed, models="analytic")
    (plate,) = found.plates
    assert [each.hinge for each in plate.hinges] == ["leaf", "leaf 2"]
    assert [each.neck_um for each in plate.hinges] == pytest.approx([12.0, 12.0], rel=1e-6)
    assert [each.length_um for each in plate.hinges] == [0.0, 0.0]
    assert plate.edge_off_um == pytest.approx(6.0, rel=1e-3)  # half of it on each side
    assert plate.edge_off.endswith("more material") and "leaf" in plate.edge_off
    along = found.change("stiffness.free.x")[1]
    # leaves in bending: the cube of the thickness, less in the fillets
    assert along == pytest.approx(100 * ((0.512 / 0.5) ** 3 - 1), rel=0.02)
    frequency = found.change("modes.frequency.1")[1]
    assert frequency == pytest.approx(
        100 * (math.sqrt(1 + along / 100) - 1), rel=0.02
    )  # the masses hardly change


def test_equal_plates_depart_nowhere(written):
    same = written("same.toml", name="another name")
    found = api.compare(STAGE, same, question="modes", models="analytic")
    (plate,) = found.plates
    assert plate.hinges == [] and plate.edge_off_um < 1e-2 and plate.area_off < 1e-9
    assert {each.judged for each in found.numbers} == {("", "equal")}
    assert all(each.changes_percent[1] == 0 for each in found.numbers)
    assert "same: 2 of 2 hinges are equal, and not listed" in found.sentences()


def test_a_hinge_that_is_missing_or_elsewhere_is_named(written):
    other = api.load(STAGE).replace(copies=(), hinge={"leaf": {"at": (12.0, 25.0)}})
    path = written("moved.toml")
    other.save(path)
    found = api.compare(STAGE, path, question="modes", models="analytic")
    first, second = found.plates[0].hinges
    assert (first.hinge, first.other, first.neck_um) == ("leaf", "there is none at its place", None)
    assert (second.hinge, second.off_um, second.neck_um) == ("leaf 2", 8000.0, 0.0)


def test_the_place_of_the_largest_departure_is_that_of_a_bump():
    plate = shapely.box(0, 0, 30, 20)
    bump = shapely.Polygon([(z.start.real, z.start.imag) for z in disc(30 + 7j, 0.02).loop])
    found = departure(plate, shapely.union(plate, bump))
    assert found.largest == pytest.approx(0.02, rel=1e-6)
    assert abs(found.place - (30.02 + 7j)) < 1e-6 and not found.inside
    assert departure(shapely.union(plate, bump), plate).inside
    assert found.area == pytest.approx(0.02**2 / 600, rel=1e-6)  # half of a square of diagonal 0.04


def test_polygons_follow_arcs_and_curves_of_hinges():
    """Area in closed form of an elliptical hinge between blocks."""
    content = {
        "name": "one",
        "thickness_mm": 5.0,
        "material": {"name": "al-7075-t6"},
        "body": [
            {
                "name": "a",
                "fixed": True,
                "outline_mm": [[-20.0, -6.0], [-4.0, -6.0], [-4.0, 6.0], [-20.0, 6.0]],
            },
            {"name": "b", "outline_mm": [[4.0, -6.0], [20.0, -6.0], [20.0, 6.0], [4.0, 6.0]]},
        ],
        "hinge": [
            {
                "name": "h",
                "between": ["a", "b"],
                "at_mm": [0.0, 0.0],
                "direction_deg": 0.0,
                "shape": "elliptical",
            }
            | {"length_mm": 8.0, "depth_mm": 1.3, "neck_mm": 0.7}
        ],
        "output": {"body": "b", "at_mm": [12.0, 0.0]},
    }
    layout = api.MechanismFile.model_validate(content).layout
    exact = 2 * 16 * 12 + 8 * (0.7 + 2 * 1.3) - 2 * math.pi / 2 * 4 * 1.3
    assert shapely.area(fine_polygon(layout)) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("move", [Move(1j, 30 - 7j), Move(-1, 3j, True), Move(1, 200 + 0j)])
def test_a_drawing_with_other_axes_is_brought_back(move):
    layout = api.load("geometry/lever-amplifier.toml").layout
    elsewhere = move_layout(layout, inverse(move))
    found = registered(layout, elsewhere)
    assert found.mirrored == move.mirrored
    assert found.factor == pytest.approx(move.factor) and found.shift == pytest.approx(
        move.shift, abs=1e-5
    )


@pytest.mark.parametrize("side", [1, -1])
def test_numbers_of_a_turned_drawing_are_those_in_the_axes_of_the_mechanism(side, tmp_path):
    """Its stiffness along x is along y of the sheet; a thicker leaf counts with its cube."""
    base = tmp_path / "plane.toml"
    plane = api.load(STAGE).replace(model="plane_stress", actuator=())
    plane.save(base)
    sheet = tmp_path / "turned.dxf"
    api.export(plane.replace(parameters={"neck_mm": 0.51}), sheet)
    document = ezdxf.readfile(sheet)
    turn = Matrix44.scale(side, 1, 1) @ Matrix44.z_rotate(math.pi / 2)
    for entity in document.modelspace():
        entity.transform(turn @ Matrix44.translate(100, 30, 0))
    document.saveas(sheet)
    found = api.compare(base, sheet, question="stiffness", models="analytic")
    assert any("turned over" in text for text in found.notes) == (side == -1)
    assert any("turned has other axes" in text for text in found.notes)
    change = found.change("stiffness.free.x")[1]
    assert change == pytest.approx(100 * ((0.51 / 0.5) ** 3 - 1), rel=0.02)
    assert found.change("stiffness.free.y")[1] == pytest.approx(2.0, abs=0.1)
    coupling = found.number("stiffness.compliance.x.theta")
    assert coupling.values[1] == pytest.approx(coupling.values[0], rel=0.1)  # with its sign
    (plate,) = found.plates
    assert [each.neck_um for each in plate.hinges] == pytest.approx([10.0, 10.0], abs=0.1)


def move_layout(layout, move):
    """A layout with all bodies and hinges moved rigidly; loops keep their sense."""

    def loop(segments):
        moved = [mapped(segment, move) for segment in segments]
        return tuple(reverse(moved)) if move.mirrored else tuple(moved)

    bodies = [
        body._replace(outline=loop(body.outline), holes=tuple(map(loop, body.holes)), clamped=())
        for body in layout.bodies
    ]
    joints = [
        joint._replace(place=move(joint.place), heading=move.heading(joint.heading))
        for joint in layout.joints
    ]
    return layout._replace(bodies=tuple(bodies), joints=tuple(joints))


def test_moved_polygons_keep_their_area_and_come_back():
    plate = shapely.box(1, 2, 5, 9)
    move = Move(np.exp(0.7j), 4 - 2j, True)
    there = moved(plate, move)
    assert shapely.area(there) == pytest.approx(28.0)
    back = moved(there, inverse(move))
    assert shapely.hausdorff_distance(back, plate) < 1e-12


def test_other_files_are_refused():
    with pytest.raises(BadInput, match="1 file, expected two or more"):
        api.compare(STAGE)
    with pytest.raises(BadInput, match="this is a case file"):
        api.compare(STAGE, "cases/fig5.toml")
