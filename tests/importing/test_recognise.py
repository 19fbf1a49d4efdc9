"""Bodies and hinges found in the plate of a mechanism are those of the mechanism, whose file says
what they are.
"""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from random_mechanisms import guide, legs, ring
from recognised import chain, departures

import flexfem
from flexfem.fem.plate_mesh import plate_contours
from flexfem.importing.found import Drawing, FoundHinge, FoundPlate
from flexfem.importing.recognise import recognise
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.outlines import (
    Segment,
    area,
    bowed,
    disc,
    polygon_points,
    polyline,
    reverse,
    rounded,
)
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profiles import profile_of

from ..conftest import ROOT

ROUND_OFF = 1e-6  # mm and rad, of a dimension of an exact drawing
OF_PLATE = 1e-6  # of the area of a plate, by which its parts may differ from it

OF_CURVES = (
    1e-5  # the same where arcs within 1e-4 mm stand for ellipses and parabolas in the contour
)


def drawn(outside: list[Segment], *holes: list[Segment]) -> Drawing:
    return Drawing(Path("part.dxf"), tuple(outside), tuple(map(tuple, holes)), None, (), 0.0, ())


def drawing_of(layout: Layout) -> Drawing:
    return drawn(*plate_contours(layout))


def profile_found(hinge: FoundHinge) -> Profile:
    values = {
        key: math.radians(value) if key == "angle" else value
        for key, value in hinge.dimensions.items()
    }
    if hinge.table:
        values |= {"table": hinge.table, "smooth": hinge.smooth}
    if hinge.side:
        values["side"] = hinge.side
    return profile_of(hinge.shape, values)


def nearest(joint: Joint, found: FoundPlate) -> FoundHinge:
    return min(found.hinges, key=lambda hinge: abs(hinge.place - joint.place))


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "geometry").glob("*.toml")))
def test_a_shipped_mechanism_is_found_again_in_its_plate(name):
    layout = flexfem.load(ROOT / f"geometry/{name}.toml").layout
    drawing = drawing_of(layout)
    found = recognise(drawing)
    assert (len(found.hinges), len(found.bodies)) == (len(layout.joints), len(layout.bodies))
    for joint in layout.joints:
        hinge = nearest(joint, found)
        profile = profile_found(hinge)
        assert abs(hinge.place - joint.place) < ROUND_OFF
        assert abs(cmath.sin(hinge.heading - joint.heading)) < ROUND_OFF
        assert type(profile) is type(joint.profile)
        values = {
            key: value for key, value in vars(joint.profile).items() if isinstance(value, float)
        }
        assert {key: getattr(profile, key) for key in values} == pytest.approx(
            values, abs=ROUND_OFF
        )
        assert hinge.deviation < ROUND_OFF
    plate = sum(map(area, (drawing.outside, *drawing.holes)))
    bodies = sum(area(loop) for body in found.bodies for loop in (body.outside, *body.holes))
    hinges = sum(map(area_between, map(profile_found, found.hinges)))
    assert bodies + hinges == pytest.approx(plate, rel=OF_PLATE)


def area_between(profile: Profile) -> float:
    x, weights = profile.quadrature
    return float(weights @ profile.height(x))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(16))
def test_a_random_mechanism_of_any_shapes_is_found_again_and_its_parts_cover_the_plate(number):
    family = (chain, ring, legs, guide)[number % 4]
    layout = family(np.random.default_rng([7, number]), "random").layout
    drawing = drawing_of(layout)
    found = recognise(drawing)
    assert departures(layout, found) == []
    assert uncovered(drawing, found) < OF_CURVES


def face_of(loops) -> shapely.Polygon:
    outside, *holes = (polygon_points(loop, FINE) for loop in loops)
    return shapely.Polygon(outside, holes)


def uncovered(drawing: Drawing, found: FoundPlate) -> float:
    """Share of a plate by which the union of its parts differs from it; polygons of equal arcs
    differ by round-off.
    """
    plate = face_of((drawing.outside, *drawing.holes))
    parts = [face_of((body.outside, *body.holes)) for body in found.bodies]
    for hinge in found.hinges:
        profile = profile_found(hinge)
        x = np.union1d(ALONG * profile.length, profile.breaks)
        left, right = (profile.middle(x) + side * profile.height(x) / 2 for side in (1, -1))
        local = np.concatenate([x + 1j * left, (x + 1j * right)[::-1]])
        z = hinge.place + cmath.exp(1j * hinge.heading) * local
        parts.append(shapely.Polygon(np.column_stack([z.real, z.imag])))
    union = shapely.union_all(parts, grid_size=GRID)
    return shapely.symmetric_difference(union, plate, grid_size=GRID).area / plate.area


FINE = np.pi / 2000  # rad, of polygons of arcs
ALONG = (
    np.sin(np.linspace(-np.pi / 2, np.pi / 2, 4001)) / 2
)  # positions on the axis of a hinge, per length
GRID = 1e-7  # mm, of coordinates


def bodies_with(*middle: complex) -> list[Segment]:
    """Two blocks of 20 x 30 mm, 30 mm apart, whose connection has a lower edge; the upper one is
    its mirror image.
    """
    upper = [z.conjugate() for z in reversed(middle)]
    left = (-15 - 15j, -15 + 15j)
    right = (15 + 15j, 15 - 15j)
    return polyline(
        -35 - 15j,
        left[0],
        *middle,
        right[1],
        35 - 15j,
        35 + 15j,
        right[0],
        *upper,
        left[1],
        -35 + 15j,
        -35 - 15j,
    )


def test_a_leaf_with_sharp_roots_between_two_blocks():
    found = recognise(drawn(bodies_with(-15 - 0.2j, 15 - 0.2j)))
    (hinge,) = found.hinges
    assert (hinge.shape, hinge.bodies) in {("leaf", (0, 1)), ("leaf", (1, 0))}
    assert hinge.dimensions == pytest.approx({"length": 30.0, "neck": 0.4}, abs=ROUND_OFF)
    assert [area(body.outside) for body in found.bodies] == pytest.approx([600.0, 600.0])


def test_a_rod_between_two_notches_is_a_body_and_the_notches_are_hinges_of_their_own_scale():
    """Hinges of 0.28 and 0.80 mm between links 4 mm wide."""
    lower = [
        -15 - 2j,
        -10 - 2j,
        -9.5 - 0.14j,
        -8.5 - 0.14j,
        -8 - 2j,
        8 - 2j,
        8.5 - 0.4j,
        9.5 - 0.4j,
        10 - 2j,
        15 - 2j,
    ]
    found = recognise(drawn(bodies_with(*lower)))
    assert len(found.bodies) == 3
    necks = sorted(profile_found(hinge).neck for hinge in found.hinges)
    assert necks == pytest.approx([0.28, 0.8], abs=ROUND_OFF)
    assert uncovered(drawn(bodies_with(*lower)), found) < OF_PLATE


def test_notches_shallower_than_half_circles_become_a_table_of_the_drawn_edge():
    notch = bowed(-2 - 1.5j, 2 - 1.5j, -1.2)  # of 2.267 mm radius: not a half circle
    lower = [*polyline(-35 - 15j, -15 - 15j, -15 - 1.5j, -2 - 1.5j), *notch]
    lower += polyline(2 - 1.5j, 15 - 1.5j, 15 - 15j, 35 - 15j, 35 + 0j)
    upper = [
        Segment(s.start.conjugate(), s.end.conjugate(), s.centre and s.centre.conjugate())
        for s in lower
    ]
    plate = drawn([*lower, *reverse(upper), *polyline(-35 + 15j, -35 - 15j)])
    found = recognise(plate)
    (hinge,) = found.hinges
    profile = profile_found(hinge)
    assert (hinge.shape, hinge.smooth, profile.symmetric) == ("profile", True, True)
    assert (profile.neck, profile.length) == pytest.approx((0.6, 4.0), abs=ROUND_OFF)
    radius = (2**2 + 1.2**2) / 2.4
    at = np.array([-1.7, -0.6, 0.3, 1.9])
    assert profile.height(at) == pytest.approx(
        2 * (1.5 - 1.2 + radius - np.sqrt(radius**2 - at**2)), abs=2e-4
    )
    assert hinge.deviation < 1e-3 and uncovered(plate, found) < OF_PLATE


def test_notches_of_unequal_radius_become_a_table_of_both_edges():
    lower = [*polyline(-35 - 15j, -4 - 15j, -4 - 4.2j), *bowed(-4 - 4.2j, 4 - 4.2j, -4.0)]
    lower += polyline(4 - 4.2j, 4 - 15j, 35 - 15j, 35 + 15j, 3 + 15j, 3 + 3.3j)
    plate = drawn(
        [
            *lower,
            *bowed(3 + 3.3j, -3 + 3.3j, -3.0),
            *polyline(-3 + 3.3j, -3 + 15j, -35 + 15j, -35 - 15j),
        ]
    )
    found = recognise(plate)
    (hinge,) = found.hinges
    profile = profile_found(hinge)
    assert (hinge.shape, profile.symmetric, len(found.bodies)) == ("profile", False, 2)
    assert profile.neck == pytest.approx(0.5, abs=1e-3)
    assert uncovered(plate, found) < OF_PLATE


def test_a_plate_without_hinges_a_web_beside_a_hole_and_a_tongue_stay_one_body():
    outline = rounded([-20 - 10j, 20 - 10j, 20 + 10j, -20 + 10j], [3.0, 0.0, 3.0, 0.0]).loop
    (body,) = recognise(drawn(outline)).bodies
    assert area(body.outside) == pytest.approx(800 - 2 * (1 - np.pi / 4) * 9)
    hole = reverse(
        disc(14 + 0j, 5.5).loop
    )  # 0.5 mm of metal beside it, which connects the body with itself
    found = recognise(drawn(outline, hole))
    assert (len(found.bodies), len(found.hinges)) == (1, 0)
    assert len(found.bodies[0].holes) == 1
    assert any(shapely.distance(face, shapely.Point(19.75, 0)) < 0.1 for face in found.slender)
    tongue = polyline(
        -20 - 10j,
        20 - 10j,
        20 - 0.2j,
        45 - 0.2j,
        45 + 0.2j,
        20 + 0.2j,
        20 + 10j,
        -20 + 10j,
        -20 - 10j,
    )
    found = recognise(drawn(tongue))
    assert (len(found.bodies), len(found.hinges)) == (1, 0)


def test_a_curved_strip_stays_a_part_of_a_body_and_is_named_as_slender():
    outer = bowed(-15 + 0.3j, 15 + 0.3j, -4.0)
    inner = bowed(-15 - 0.3j, 15 - 0.3j, -4.0)
    loop = [
        *polyline(-35 - 15j, -15 - 15j, -15 - 0.3j),
        *inner,
        *polyline(15 - 0.3j, 15 - 15j, 35 - 15j),
    ]
    loop += [*polyline(35 - 15j, 35 + 15j, 15 + 15j, 15 + 0.3j), *reverse(outer)]
    loop += polyline(-15 + 0.3j, -15 + 15j, -35 + 15j, -35 - 15j)
    found = recognise(drawn(loop))
    assert (len(found.bodies), len(found.hinges)) == (1, 0)
    assert found.slender


def test_thick_walls_of_a_frame_around_thin_leaves_are_no_hinges():
    """Walls of 10 mm are 25 times as thick as the leaves, and the blocks that they connect 4 times
    as wide.
    """
    layout = flexfem.load(ROOT / "geometry/xy-stage.toml").layout
    assert max(profile_found(hinge).neck for hinge in recognise(drawing_of(layout)).hinges) < 1.0


def test_a_part_ten_thousand_times_smaller_has_the_same_hinges():
    small = [
        Segment(1e-4 * s.start, 1e-4 * s.end)
        for s in bodies_with(-15 - 2j, -3 - 2j, -3 - 0.2j, 3 - 0.2j, 3 - 2j, 15 - 2j)
    ]
    (hinge,) = recognise(drawn(small)).hinges
    assert hinge.dimensions == pytest.approx({"length": 6e-4, "neck": 4e-5}, rel=1e-6)
