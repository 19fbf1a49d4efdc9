"""The mesh of a plate is the drawn plate: exact edges, all hinges between their bodies, and nothing
else joined.
"""

from __future__ import annotations

import cmath
from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

import flexfem
import flexfem.fem.plate_mesh
from flexfem.fem.mesh import jacobians, nodes_on, scaled_jacobians
from flexfem.fem.plate_mesh import mesh_layout, plate_contours
from flexfem.fem.plate_symmetry import symmetry_of
from flexfem.fem.ports import plate_response
from flexfem.mechanism.hinge_place import end_lines, joint_polygon
from flexfem.mechanism.layout import Body, Joint, Layout, Patch
from flexfem.mechanism.outlines import Segment, area, disc, polyline, reverse
from flexfem.mechanism.plate import has_sharp_corner
from flexfem.mechanism.plate_checks import check_layout
from flexfem.mechanism.profiles import Circular, Elliptical, Leaf, profile_of
from flexfem.mechanism.tabulated import Tabulated
from flexfem.refused import BadInput, ComputationFailed

from ..tolerances import SOLVED

ROOT = Path(__file__).parents[2]
ON_CURVE = 1e-8  # mm; OpenCASCADE draws to its own tolerance
PARABOLAS = 2e-6  # relative area, in place of arcs
SYMMETRIC = (
    0.1 * SOLVED
)  # coupling of directions, relative; on meshes without symmetry it is 5e-7 to 8e-6

COARSE_PARABOLAS = 2e-4  # the same of 9 triangles around a hole
# of the compliance of a slender hinge: bodies contribute 2 % to bending and 4 % to the coupling
BEAM = 0.05
COARSE_MESH = (
    3e-3  # relative compliance on a mesh with 2 triangles across the necks, from that on a fine one
)


def box(x0, y0, x1, y1, turn=1.0):
    return tuple(
        polyline(*(complex(*z) * turn for z in ((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0))))
    )


def layout_of(bodies, hinges):
    return Layout(
        tuple(bodies), tuple(hinges), 7.0, 68e3, 0.29, 2.7e-9, 410.0, (("output", Patch(1, 0j)),)
    )


GROUND = Body("ground", box(0, -5, 10, 5), fixed=True, key="body[0]")
STAGE = Body("stage", box(20, -5, 33, 5), key="body[1]")
LEAF = Joint("leaf", (0, 1), 15 + 0j, 0.0, Leaf(0.4, 10.0, 0.5), 3.0, "hinge[0]")


def parallelogram():
    leaves = [
        Joint(f"leaf {k}", (0, 1), complex(5 + 24 * k, 8.5), np.pi / 2, Leaf(0.4, 17, 0.5), 3.0)
        for k in (0, 1)
    ]
    return layout_of(
        [Body("ground", box(0, -9, 36, 0), fixed=True), Body("stage", box(-2, 17, 34, 24))], leaves
    )


def area_of(mesh, *bodies):
    return float(jacobians(mesh)[np.isin(mesh.bodies, bodies), -1].sum() / 2)


def outer_sides(mesh):
    """Sides (k, 3) that belong to one triangle, ends, then middle."""
    t = mesh.triangles
    sides = np.concatenate([t[:, [0, 1, 3]], t[:, [1, 2, 4]], t[:, [2, 0, 5]]])
    count = Counter(side[2] for side in sides.tolist())
    return np.array([side for side in sides.tolist() if count[side[2]] == 1])


def test_notches_cut_into_a_bar_that_passes_through_two_hinges():
    """Three bodies drawn from hinge centre to hinge centre, and one of them clamped at its end, not
    fixed.
    """
    turn = cmath.exp(0.7j)
    neck = 0.6
    R = 3.0
    ends = ((0, 18), (18, 41), (41, 60))
    bodies = [
        Body(f"bar {k}", box(a, -4, b, 4, turn), clamped=(3,) if k == 0 else ())
        for k, (a, b) in enumerate(ends)
    ]
    hinges = [
        Joint(f"notch {k}", (k, k + 1), x * turn, 0.7, Circular(neck, R), 9.0)
        for k, x in enumerate((18, 41))
    ]
    mesh = mesh_layout(layout_of(bodies, hinges), 6)
    notch = 2 * R * neck + (4 - np.pi) * R**2
    assert area_of(mesh, *range(5)) == pytest.approx((60 - 4 * R) * 8 + 2 * notch, rel=PARABOLAS)
    assert (
        17 * 8 + 1.9 * notch < area_of(mesh, 1, 3, 4) < 17 * 8 + 2 * notch
    )  # needles belong to the outer bodies
    place = mesh.nodes @ [1, 1j] / turn
    np.testing.assert_allclose(place[nodes_on(mesh, "clamped")].real, 0, atol=ON_CURVE)
    for k, x in enumerate((18, 41)):
        np.testing.assert_allclose(place[nodes_on(mesh, f"neck {k}")].real, x, atol=ON_CURVE)
        assert len(mesh.edges[f"neck {k}"]) == 6
        assert np.ptp(place[nodes_on(mesh, f"neck {k}")].imag) == pytest.approx(neck)
    sides = place[outer_sides(mesh)]
    middle = sides[
        np.abs(sides.imag).max(axis=1) < neck / 2 + 0.9 * R
    ].ravel()  # without the free sides of the bars
    notched = middle[(middle.real > 1) & (middle.real < 59)]
    centres = np.where(notched.real < 30, 18, 41) + 1j * np.sign(notched.imag) * (neck / 2 + R)
    assert len(notched) > 200
    np.testing.assert_allclose(np.abs(notched - centres), R, atol=ON_CURVE)


def test_leaves_end_on_their_bodies():
    mesh = mesh_layout(parallelogram(), 4)
    leaf = 17 * 0.4 + (4 - np.pi) * 0.5**2
    assert area_of(mesh, 0, 1, 2, 3) == pytest.approx(36 * 9 + 36 * 7 + 2 * leaf, rel=PARABOLAS)
    for k in (0, 1):
        for label, body, y in ((f"end {k} near", 0, 0), (f"end {k} far", 1, 17)):
            on = nodes_on(mesh, label)
            middle = on[np.abs(mesh.nodes[on, 1] - y) < ON_CURVE]
            assert np.ptp(mesh.nodes[middle, 0]) > 0.4  # more than the leaf without fillets
            for part in (body, 2 + k):
                assert np.isin(on, mesh.triangles[mesh.bodies == part]).all()
    assert jacobians(mesh).min() > 0


def test_contours_are_exact_lines_and_arcs():
    outer, hole = plate_contours(parallelogram())
    assert Counter(segment.centre is None for segment in hole) == {True: 4, False: 4}
    assert {round(abs(s.start - s.centre), 9) for s in (*outer, *hole) if s.centre is not None} == {
        0.5
    }
    assert area(hole) == pytest.approx(-(17 * 23.6 - (4 - np.pi) * 0.5**2), rel=1e-12)
    assert area(outer) + area(hole) == pytest.approx(
        36 * 16 + 2 * (6.8 + (4 - np.pi) * 0.5**2), rel=1e-12
    )


def test_contours_of_other_curves_are_within_their_tolerance():
    profile = Elliptical(0.5, 10.0, 3.0)
    bodies = [
        GROUND._replace(holes=(tuple(s.reversed() for s in reversed(box(2, -1, 4, 2))),)),
        STAGE,
    ]
    outer, hole = plate_contours(layout_of(bodies, [LEAF._replace(profile=profile, cut=7.0)]))
    exact = 10 * 10 + 13 * 10 + 10 * 6.5 - np.pi * 5 * 3
    assert area(outer) == pytest.approx(exact, abs=1e-4 * 24)  # 24 mm of ellipses
    assert area(hole) == pytest.approx(-6)


def test_a_table_of_heights_is_meshed():
    profile = Tabulated(table=((0, 7.0), (4, 0.6), (6, 0.9), (10, 5.0)))
    mesh = mesh_layout(layout_of([GROUND, STAGE], [LEAF._replace(profile=profile)]), 4)
    x, weights = profile.quadrature
    assert area_of(mesh, 0, 1, 2) == pytest.approx(230 + weights @ profile.height(x), rel=1e-5)


TABLES = {
    "two necks": ((0, 7.0), (1, 0.6), (4.1, 0.9), (5.2, 0.62), (10, 5.0)),
    "steep flanks": ((0, 5.0), (0.01, 0.8), (9.7, 0.6), (10, 3.0)),
    "scan": tuple(
        (x / 20, 1 + (x - 90) ** 2 / 4e3 + 0.004 * np.sin(9.0 * x * x)) for x in range(201)
    ),
}
OUTLINE = 1e-10  # relative, of the area within straight lines; round-off is 1e-14
CUBICS = 2e-5  # relative area, of parabolas in place of cubics


@pytest.mark.parametrize("rows", TABLES.values(), ids=TABLES)
def test_rows_of_a_table_are_vertices_of_the_mesh(rows):
    """Joined by lines, so that the mesh has exactly the area of the trapezoids between the rows."""
    mesh = mesh_layout(
        layout_of([GROUND, STAGE], [LEAF._replace(profile=Tabulated(table=rows), cut=7.5)]), 4
    )
    x, h = np.array(rows).T
    bodies = 10 * 10 + 13 * 10
    assert area_of(mesh, 0, 1, 2) == pytest.approx(bodies + np.trapezoid(h, x), rel=OUTLINE)
    distance, _ = cKDTree(mesh.nodes).query(np.column_stack([10 + x, h / 2])[1:-1])
    assert distance.max() < ON_CURVE


@pytest.mark.parametrize("rows", TABLES.values(), ids=TABLES)
def test_drawn_polygons_have_the_rows_of_a_table(rows):
    x, h = np.array(rows).T
    drawn = joint_polygon(LEAF._replace(profile=Tabulated(rows)))
    assert drawn.area == pytest.approx(np.trapezoid(h, x), rel=OUTLINE)


def test_lines_at_the_end_of_a_table_leave_its_edge_at_a_row():
    """Else a mesh edge would begin a little beside the corner. The row is 0.15 mm from the end, at
    half of 0.8 mm.
    """
    hinge = LEAF._replace(profile=Tabulated(((0, 5.0), (0.15, 0.8), (9, 0.6), (10, 3.0))))
    first, *_, last = end_lines(hinge, -1)
    for line, corner in ((first, 10.15 - 0.4j), (last, 10.15 + 0.4j)):
        assert abs((np.conj(line.end - line.start) * (corner - line.start)).imag) < ON_CURVE
        assert min(abs(corner - line.start), abs(corner - line.end)) < 0.03 * line.length


@pytest.mark.parametrize("rows", TABLES.values(), ids=TABLES)
def test_a_smooth_table_is_meshed_as_drawn(rows):
    mesh = mesh_layout(
        layout_of([GROUND, STAGE], [LEAF._replace(profile=Tabulated(rows, smooth=True), cut=7.5)]),
        4,
    )
    x, h = np.array(rows).T
    exact = 10 * 10 + 13 * 10 + PchipInterpolator(x, h).integrate(x[0], x[-1])
    assert area_of(mesh, 0, 1, 2) == pytest.approx(exact, rel=CUBICS)


def test_a_bump_between_samples_of_a_table_breaks_its_symmetry():
    plain = ((0, 5.0), (4, 0.6), (6, 0.6), (10, 5.0))
    bumpy = (*plain[:2], (5.02, 0.6), (5.03, 0.63), (5.04, 0.6), *plain[2:])
    found = [symmetry_of(halves_of(Tabulated(rows))) for rows in (plain, bumpy)]
    assert [len(moves) for moves in found] == [1, 0]


def halves_of(profile):
    """A hinge between two equal elastic bodies, without a symmetry about its axis."""
    right = box(20, -5, 30, 6)
    left = tuple(segment.reversed() for segment in reversed(mirrored(right)))
    return layout_of([Body("left", left), Body("right", right)], [LEAF._replace(profile=profile)])


def mirrored(loop):
    return [Segment(*(30 - z.conjugate() for z in segment[:2])) for segment in loop]


AROUND = GROUND._replace(outline=box(0, -5, 19, 5))
THIRD = Body("third", box(33, 0, 40, 3), key="body[2]")


@pytest.mark.parametrize(
    ("bodies", "hinge", "message"),
    [
        (
            [GROUND, STAGE, THIRD._replace(outline=box(30, 0, 40, 3))],
            LEAF,
            r"body\[1\]: overlaps third by 9 mm\^2",
        ),
        ([GROUND, STAGE, THIRD], LEAF, r"body\[1\]: touches third"),
        (
            [GROUND, STAGE, THIRD._replace(outline=box(34, 0, 40, 3))],
            LEAF,
            r"body\[2\]: .* to no other body",
        ),
        (
            [GROUND, STAGE._replace(outline=box(21, -5, 33, 5))],
            LEAF,
            r"hinge\[0\]: ends 1 mm before stage",
        ),
        (
            [GROUND, STAGE],
            LEAF._replace(heading=np.pi),
            r"hinge\[0\]: its axis points from stage to ground",
        ),
        (
            [GROUND._replace(outline=box(0, -0.6, 10, 5)), STAGE],
            LEAF,
            r"hinge\[0\]: is 1.4 mm high at ground",
        ),
        (
            [AROUND, STAGE._replace(outline=box(19, -5, 33, 5))],
            LEAF,
            r"hinge\[0\]: leaves ground and stage connected beside it, as its cut_mm is 3(?=, "
            "expected 10.2 or more)",
        ),
        ([AROUND, STAGE], LEAF._replace(cut=0.4, profile=Leaf(0.4, 10)), "along its side"),
        ([GROUND._replace(fixed=False), STAGE], LEAF, "no body is fixed"),
        (
            [GROUND._replace(outline=tuple(polyline(0, 10 + 5j, 10 - 5j, 5j, 0))), STAGE],
            LEAF,
            r"body\[0\]: self-inter",
        ),
    ],
)
def test_parts_that_are_not_connected_by_hinges_alone_are_refused(bodies, hinge, message):
    with pytest.raises(BadInput, match=message + r"[^\n]*, expected [^\n]*$"):
        check_layout(layout_of(bodies, [hinge]))


def test_grounds_apart_are_two_pieces_and_bodies_that_touch_are_found_in_the_mesh_too(monkeypatch):
    apart = THIRD._replace(outline=box(34, 0, 40, 3), fixed=True)
    assert area_of(mesh_layout(layout_of([GROUND, STAGE, apart], [LEAF]), 3), 2) == pytest.approx(
        18
    )
    monkeypatch.setattr(flexfem.fem.plate_mesh, "check_layout", lambda layout: None)
    with pytest.raises(
        ComputationFailed, match=r"joined without a hinge|connected to nothing|overlap"
    ):
        mesh_layout(layout_of([GROUND, STAGE._replace(outline=box(10, -5, 33, 5))], [LEAF]), 3)


def test_triangles_in_an_arm_follow_its_width_and_not_that_of_its_body():
    corners = (0, 50, 50 + 23.5j, 80 + 23.5j, 80 + 26.5j, 50 + 26.5j, 50 + 50j, 50j, 0)
    tip = Body("tip", box(90, 20, 99, 30), fixed=True)
    hinge = LEAF._replace(place=85 + 25j, heading=np.pi)
    mesh = mesh_layout(
        layout_of([Body("arm", tuple(polyline(*corners))), tip], [hinge._replace(bodies=(1, 0))]), 8
    )
    x = mesh.nodes[mesh.triangles[:, :3], 0]
    arm = (mesh.bodies == 0) & (x.min(axis=1) > 55) & (x.max(axis=1) < 75)
    assert (
        area_of(mesh._replace(triangles=mesh.triangles[arm], bodies=mesh.bodies[arm]), 0)
        / arm.sum()
        < 0.5
    )  # mm^2


def moved(loop, factor, shift):
    return tuple(
        Segment(*(None if z is None else factor * z + shift for z in segment)) for segment in loop
    )


def round_hole(centre, radius):
    return tuple(reverse(disc(centre, radius).loop))


def relative(layout, mesh):
    """Compliance of the output and of ports, each relative to those on the diagonal, and its
    diagonal.
    """
    C = plate_response(layout, mesh).compliance
    return C / np.sqrt(np.outer(np.diag(C), np.diag(C))), np.diag(C)


@pytest.mark.parametrize(
    ("turns", "holes"), [(4, False), (3, False), (3, True), (4, True), (5, True), (2, True)]
)
def test_cyclic_plate_has_a_cyclic_mesh(turns, holes):
    """So that the stiffness couples no directions, also with holes at the centre, in every sector
    and in every foot.
    """
    about = 30 - 7j
    bodies = [Body("stage", tuple(disc(30 - 7j, 15.0).loop))]
    hinges = []
    ways = np.exp(1j * (0.3 + 2 * np.pi * np.arange(turns) / turns))
    if holes:
        around = (round_hole(about + 10 * way * np.exp(0.5j), 1.3) for way in ways)
        bodies[0] = bodies[0]._replace(holes=(round_hole(about, 5.0), *around))
    for k, way in enumerate(ways):
        foot = Body(f"foot {k}", moved(box(24, -6, 30, 9), way, about), clamped=(1,))
        bodies.append(
            foot._replace(holes=(round_hole(about + (27 + 3j) * way, 1.5),) if holes else ())
        )
        hinges.append(
            Joint(
                f"hinge {k}",
                (k + 1, 0),
                about + 19.25 * way,
                cmath.phase(-way),
                Leaf(0.7, 9.5, 0.5),
                3.0,
            )
        )
    of = layout_of(bodies, hinges)._replace(points=(("output", Patch(0, about)),))
    moves = symmetry_of(of)
    assert len(moves) == turns - 1
    assert [move(about) for move in moves] == pytest.approx([about] * (turns - 1), abs=1e-12)
    changed = of._replace(joints=(*hinges[:-1], hinges[-1]._replace(cut=3.1)))
    assert all(move.mirrored for move in symmetry_of(changed))
    C, principal = relative(of, mesh_layout(of, 2))
    assert np.abs(C[2, :2]).max() < SYMMETRIC
    if turns > 2:
        assert abs(C[0, 1]) < SYMMETRIC
        assert principal[0] == pytest.approx(principal[1], rel=SYMMETRIC)


def gripper(turn=1.0, neck=0.4):
    """Two jaws, each on two hinges, pushed apart by a slide on the mirror line, which a leaf on
    this line guides.
    """
    ground = Body("ground", box(-40, -14, 30, -3, turn), fixed=True)
    slide = Body("slide", box(-6, 20, 6, 36, turn), (round_hole(28j * turn, 3.0),))
    bodies = [ground, slide]
    hinges = [Joint("guide", (0, 1), 8.5j * turn, np.pi / 2, Leaf(0.4, 23.0, 0.5), 3.0)]
    for side, name in ((1, "right"), (-1, "left")):
        corners = [
            complex(side * x, y) * turn for x, y in ((12, 3), (20, 3), (23, 60), (16, 60), (12, 36))
        ]
        corners = corners[::side]
        jaw = Body(
            f"{name} jaw",
            tuple(polyline(*corners, corners[0])),
            (round_hole((side * 17 + 44j) * turn, 1.6),),
        )
        foot = Circular(0.5, 3.0)
        push = Leaf(neck if side > 0 else 0.4, 6.0, 0.3)
        hinges.append(
            Joint(f"{name} foot", (0, len(bodies)), side * 16 * turn, np.pi / 2, foot, 9.0)
        )
        hinges.append(
            Joint(
                f"{name} push",
                (1, len(bodies)),
                (side * 9 + 33j) * turn,
                0.0 if side > 0 else np.pi,
                push,
                3.0,
            )
        )
        bodies.append(jaw)
    hinges = [one._replace(heading=one.heading + cmath.phase(turn)) for one in hinges]
    return layout_of(bodies, hinges)._replace(points=(("output", Patch(1, 28j * turn, 4.0)),))


def without_symmetry(layout, resolution, monkeypatch):
    with monkeypatch.context() as context:
        context.setattr(flexfem.fem.plate_mesh, "symmetry_of", lambda layout: [])
        return mesh_layout(layout, resolution)


@pytest.mark.parametrize("name", ["parallelogram", "rhombic-amplifier", "gripper"])
def test_mirrored_plate_has_a_mirrored_mesh(name, monkeypatch):
    """So that a force along the line moves nothing across it; the compliance is that of a mesh
    without symmetry.
    """
    layout = gripper() if name == "gripper" else flexfem.load(ROOT / f"geometry/{name}.toml").layout
    (move,) = symmetry_of(layout)
    assert move.mirrored
    assert move(3 + 4j) == pytest.approx(-3 + 4j, abs=1e-12)
    C, principal = relative(layout, mesh_layout(layout, 4))
    assert np.abs(C[1, [0, 2]]).max() < SYMMETRIC
    C, other = relative(layout, without_symmetry(layout, 4, monkeypatch))
    assert np.abs(C[1, [0, 2]]).max() > 10 * SYMMETRIC
    np.testing.assert_allclose(
        principal[:3], other[:3], rtol=2e-4
    )  # other triangles at necks and holes: up to 1.2e-4


@pytest.mark.parametrize(
    "profile", [Leaf(0.4, 8.0, 0.4), Circular(0.5, 2.5), Elliptical(0.5, 8.0, 2.0)]
)
@pytest.mark.parametrize("turn", [1.0, np.exp(0.3j)])
def test_a_hinge_across_the_mirror_line_is_divided_at_its_neck(profile, turn):
    """Every triangle outside the rigid ground has an image; only a hinge whose ends are alike is
    its own image.
    """
    shift = (300 - 40j) * turn
    ground = Body("ground", box(-30, -10, 50, 0), fixed=True)
    halves = [box(-25, 20, -profile.length / 2, 26), box(profile.length / 2, 20, 25, 26)]
    hinges = [Joint("middle", (1, 2), 23j, 0.0, profile, 6.0)]
    hinges += [
        Joint(f"leg {k}", (0, k + 1), x + 10j, np.pi / 2, Leaf(0.5, 20.0, 0.5), 3.0)
        for k, x in ((0, -20), (1, 20))
    ]
    bodies = [ground, Body("left", halves[0]), Body("right", halves[1])]
    bodies = [body._replace(outline=moved(body.outline, turn, shift)) for body in bodies]
    hinges = [
        one._replace(place=one.place * turn + shift, heading=one.heading + cmath.phase(turn))
        for one in hinges
    ]
    of = layout_of(bodies, hinges)
    (move,) = symmetry_of(of)
    mesh = mesh_layout(of, 4)
    z = mesh.nodes @ [1, 1j]
    triangles = mesh.triangles[mesh.bodies > 0]
    distance, image = cKDTree(mesh.nodes).query(np.column_stack([move(z).real, move(z).imag]))
    assert distance[triangles].max() < 2 * ON_CURVE
    assert {*map(frozenset, image[triangles].tolist())} == {*map(frozenset, triangles.tolist())}
    uneven = Tabulated(table=((0, 5.0), (2, 0.6), (8, 5.0)))
    assert symmetry_of(of._replace(joints=(hinges[0]._replace(profile=uneven), *hinges[1:]))) == []


def test_a_plate_with_one_neck_1_percent_wider_is_not_symmetric():
    layout = gripper(neck=0.404)
    assert symmetry_of(layout) == []
    C, _ = relative(layout, mesh_layout(layout, 4))
    assert np.abs(C[1, [0, 2]]).max() > 1e-4


def test_a_plate_that_cannot_be_meshed_with_symmetry_is_meshed_without(monkeypatch):
    run = flexfem.fem.plate_mesh.run_mesher

    def fails_with_moves(job, limit):
        if job.moves:
            raise ComputationFailed("gmsh: different number of points")
        return run(job, limit)

    _, without = relative(gripper(), without_symmetry(gripper(), 2, monkeypatch))
    monkeypatch.setattr(flexfem.fem.plate_mesh, "run_mesher", fails_with_moves)
    np.testing.assert_allclose(
        relative(gripper(), mesh_layout(gripper(), 2))[1], without, rtol=1e-5
    )  # noise of meshes


def shipped_parallelogram(**parameters):
    plate = flexfem.load(ROOT / "geometry/parallelogram.toml")
    return plate.replace(
        parameters={f"{name}_mm": value for name, value in parameters.items()}
    ).layout


@pytest.mark.parametrize(
    ("parameters", "resolution"),
    [
        ({"distance": 45}, 2),
        ({"distance": 40, "width": 0.1}, 2),
        ({"distance": 40, "width": 0.1}, 6),
    ],
)
def test_a_ground_that_is_narrow_beside_a_fillet_has_a_mesh_that_is_right(parameters, resolution):
    """Large triangles beside the fillet of the ground were folded; the mirror image remains exact."""
    layout = shipped_parallelogram(**parameters)
    mesh = mesh_layout(layout, resolution)
    assert scaled_jacobians(jacobians(mesh)).min() > 0.1
    C, principal = relative(layout, mesh)
    assert np.abs(C[1, [0, 2]]).max() < SYMMETRIC
    np.testing.assert_allclose(
        principal, relative(layout, mesh_layout(layout, 8))[1], rtol=COARSE_MESH
    )


@pytest.mark.parametrize("gap", [0.002, 0.05])
def test_triangles_between_two_holes_follow_the_gap(gap, monkeypatch):
    """Two holes beside each other, and one beside an edge: the compliance is that of a finer mesh,
    at once.
    """
    monkeypatch.setattr(flexfem.fem.plate_mesh, "ATTEMPTS", 1)
    holes = tuple(round_hole(centre, 1.5) for centre in (24, 27 + gap, 24 + (3.5 - gap) * 1j))
    layout = layout_of([GROUND, STAGE._replace(holes=holes)], [LEAF])
    mesh = mesh_layout(layout, 2)
    leaf = 10 * 0.4 + (4 - np.pi) * 0.5**2
    assert area_of(mesh, 0, 1, 2) == pytest.approx(
        100 + 130 + leaf - 3 * np.pi * 1.5**2, rel=COARSE_PARABOLAS
    )
    np.testing.assert_allclose(
        relative(layout, mesh)[1], relative(layout, mesh_layout(layout, 6))[1], rtol=COARSE_MESH
    )


@pytest.mark.parametrize(
    ("holes", "message"),
    [
        (
            [round_hole(24, 1.5), round_hole(27, 1.5)],
            r"is 0 mm wide between two holes near \(25.5, .*\)",
        ),
        (
            [round_hole(24, 1.5), round_hole(27.0004, 1.5)],
            r"is 0.0004 mm wide between two holes near \(25.5002, .*\)",
        ),
        (
            [round_hole(24 + 3.4996j, 1.5)],
            r"is 0.0004 mm wide between a hole and its edge near \(24, 4.9998\)",
        ),
        (
            [tuple(reverse(box(24, -4, 25, -4 + 1e-7)))],
            r"has a hole 1e-07 mm wide near \(24.5, -4\)",
        ),
    ],
)
def test_holes_that_touch_or_nearly_touch_are_refused_with_their_place(holes, message):
    with pytest.raises(BadInput, match=rf"^body\[1\]: {message} mm, expected at least 0.001 mm$"):
        check_layout(layout_of([GROUND, STAGE._replace(holes=tuple(holes))], [LEAF]))


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ((20 - 5j, 33 - 5j, 33 + 5j, 20 + 5j), None),
        ((20 - 5j, 33, 20 + 5j), None),  # a sharp tip is not narrow
        (
            (20 - 5j, 26 - 5j, 26 - 1e-4j, 33 - 1e-4j, 33, 26 + 1e-12j, 26 + 5j, 20 + 5j),
            r"is 0.0001 mm wide near",
        ),
        (
            (20 - 5j, 26 - 0.0002j, 33 - 5j, 33 + 5j, 26 + 0.0002j, 20 + 5j),
            r"is 0.00040\d* mm wide near \(26, 0\)",
        ),
        (
            (20 - 5j, 26 - 5j, 26 + 4j, 26.0001 + 4j, 26.0001 - 5j, 33 - 5j, 33 + 5j, 20 + 5j),
            r"has a slit 0.0001 mm",
        ),
    ],
)
def test_a_narrow_part_or_slit_of_an_outline_is_refused_with_its_place(corners, message):
    layout = layout_of(
        [GROUND, STAGE._replace(outline=tuple(polyline(*corners, corners[0])))], [LEAF]
    )
    if message is None:
        check_layout(layout)
        return
    with pytest.raises(BadInput, match=rf"^body\[1\]: {message}.* mm, expected at least 0.001 mm$"):
        check_layout(layout)


def test_a_leaf_too_slender_for_finite_elements_is_refused_with_a_neck_that_is_possible():
    def leaf(neck):
        return layout_of([GROUND, STAGE], [LEAF._replace(profile=Leaf(neck, 10, 0.5))])

    check_layout(leaf(0.00022))
    with pytest.raises(
        BadInput, match=r"^hinge\[0\]: finite elements need .* triangles.* as with 0.00019 mm or"
    ):
        check_layout(leaf(0.0001))


def test_a_poor_mesh_is_made_again_with_smaller_triangles_there_and_at_their_images(monkeypatch):
    """A folded triangle in the first mesh, as gmsh makes beside tight curves; the mirror image
    stays exact.
    """
    run = flexfem.fem.plate_mesh.run_mesher
    jobs = []
    layout = gripper()

    def folds_first(job, limit):
        jobs.append(job)
        arrays = run(job, limit)
        if len(jobs) == 1:
            arrays["nodes"][arrays["triangles"][40, 3]] = arrays["nodes"][
                arrays["triangles"][40, 2]
            ]
        return arrays

    expected = relative(layout, mesh_layout(layout, 2))[1]
    monkeypatch.setattr(flexfem.fem.plate_mesh, "run_mesher", folds_first)
    mesh = mesh_layout(layout, 2)
    first, second = jobs
    added = second.gradings[len(first.gradings) :]
    assert added and all(one.size < 0.5 * one.radius and len(one.points) == 2 for one in added)
    assert (
        first.divisions and not second.divisions
    )  # equal edges across a neck can keep its triangles flat
    C, principal = relative(layout, mesh)
    assert np.abs(C[1, [0, 2]]).max() < SYMMETRIC
    np.testing.assert_allclose(principal, expected, rtol=COARSE_MESH)


def test_a_plate_that_gmsh_cannot_mesh_is_meshed_with_smaller_triangles_by_another_algorithm(
    monkeypatch,
):
    run = flexfem.fem.plate_mesh.run_mesher
    layout = layout_of([GROUND, STAGE], [LEAF])

    def fails_at_first(job, limit):
        if job.algorithm == 6:
            raise ComputationFailed("gmsh: no mesh")
        return run(job, limit)

    expected = mesh_layout(layout, 3)
    monkeypatch.setattr(flexfem.fem.plate_mesh, "symmetry_of", lambda layout: [])
    monkeypatch.setattr(flexfem.fem.plate_mesh, "run_mesher", fails_at_first)
    mesh = mesh_layout(layout, 3)
    assert len(mesh.triangles) > len(expected.triangles)
    np.testing.assert_allclose(
        relative(layout, mesh)[1], relative(layout, expected)[1], rtol=COARSE_MESH
    )


def test_edges_of_smooth_tables_with_tight_turns_are_meshed():
    """The middle section ends where the edge turns within 0.01 mm."""
    rows = (
        (0, 0.55),
        (4.92, 6.79),
        (5.25, 3.15),
        (5.53, 6.08),
        (5.63, 0.76),
        (6.15, 1.21),
        (6.72, 0.68),
        (10, 0.35),
    )
    profile = Tabulated(table=rows, smooth=True)
    layout = layout_of([GROUND, STAGE], [LEAF._replace(profile=profile, cut=9.0)])
    mesh = mesh_layout(layout, 4)
    x, weights = profile.quadrature
    assert area_of(mesh, 0, 1, 2) == pytest.approx(
        230 + weights @ profile.height(x), rel=COARSE_PARABOLAS
    )
    np.testing.assert_allclose(
        relative(layout, mesh)[1], relative(layout, mesh_layout(layout, 8))[1], rtol=COARSE_MESH
    )


@pytest.mark.parametrize("hinge", [{"heading": 1.2e-6}, {"place": 15 + 7e-7j + 7e-7}])
def test_a_hinge_beside_its_bodies_by_rounded_coordinates_is_joined_to_them(hinge):
    """What `check` takes for joined, within 1e-6 mm, is one piece in the mesh and in the contours."""
    layout = layout_of([GROUND, STAGE], [LEAF._replace(**hinge)])
    straight = layout_of([GROUND, STAGE], [LEAF])
    np.testing.assert_allclose(
        relative(layout, mesh_layout(layout, 2))[1],
        relative(straight, mesh_layout(straight, 2))[1],
        rtol=COARSE_MESH,
    )
    assert len(plate_contours(layout)) == 1


def test_the_ends_of_no_leaf_reach_the_cusp_of_its_fillets():
    """A fillet ends upright at the end of its hinge; round-off of one leaf in a hundred put a
    needle between them.
    """
    rng = np.random.default_rng(3)
    for _ in range(500):
        sizes = {
            "neck": rng.uniform(0.2, 1),
            "length": rng.uniform(6, 30),
            "fillet": rng.uniform(0.1, 0.9),
        }
        hinge = Joint("leaf", (0, 1), 0j, 0.0, profile_of("leaf", sizes), 0.0)
        for side, rigid in product((-1, 1), (False, True)):
            assert len(end_lines(hinge, side, rigid)) == 3


def notched_guide(second="right"):
    """Two leaves and two legs with a notch on one side each, outwards, mirror images of each other
    unless told.
    """
    bodies = [Body("ground", box(-30, -10, 30, 0), fixed=True), Body("stage", box(-30, 20, 30, 26))]
    notches = [Circular(0.5, 4.0, side="left"), Circular(0.5, 4.0, side=second)]
    legs = [
        Joint(f"leg {k}", (0, 1), x + 10j, np.pi / 2, notch, 20.0)
        for k, (x, notch) in enumerate(zip((-20, 20), notches, strict=True))
    ]
    bodies[0] = bodies[0]._replace(outline=box(-30, -10, 30, 6))
    bodies[1] = bodies[1]._replace(outline=box(-30, 14, 30, 26))
    return layout_of(bodies, legs)


def test_notches_on_one_side_have_the_symmetry_of_their_sides():
    """Facing outwards they are mirror images; both to the left they are not, nor are both turned
    the same way.
    """
    (move,) = symmetry_of(notched_guide())
    assert move.mirrored
    assert symmetry_of(notched_guide("left")) == []


def test_a_notch_on_one_side_is_meshed_on_its_side():
    """Straight edge 0.25 mm to the right of the axis, notch of 4 mm on the left: area 8 * 4.5 - pi
    4^2 / 2.
    """
    layout = notched_guide("left")
    mesh = mesh_layout(layout, 4)
    assert area_of(mesh, 0, 1, 2, 3) == pytest.approx(
        60 * 16 + 60 * 12 + 2 * (36 - 8 * np.pi), rel=PARABOLAS
    )
    x = mesh.nodes[np.unique(mesh.edges["neck 0"]), 0]
    assert (x.min(), x.max()) == pytest.approx((-20.25, -19.75), abs=ON_CURVE)
    assert mesh.nodes[np.unique(mesh.triangles[mesh.bodies == 2]), 0].max() == pytest.approx(
        -19.75, abs=ON_CURVE
    )
    polygon = joint_polygon(layout.joints[0])
    assert polygon.area == pytest.approx(36 - 8 * np.pi, rel=1e-3)
    assert polygon.bounds == pytest.approx((-24.25, 6, -19.75, 14))


@pytest.mark.parametrize("shape", ["parabolic", "profile"])
def test_finite_elements_of_an_unsymmetric_hinge_couple_as_its_beam(shape):
    """Slender, so that the coupling of a pull and a rotation is that of the mid-line; and it
    changes with the side.
    """
    notch = {"length": 16.0, "depth": 1.0, "neck": 0.4, "side": "left"}
    x = np.linspace(-8, 8, 33)
    rows = [(each, 0.2 + each**2 / 64, 0.2 - 0.01 * each) for each in x.tolist()]
    profile = profile_of(shape, notch if shape == "parabolic" else {"table": rows, "smooth": True})
    bodies = [Body("near", box(-40, -5, -8, 5), fixed=True), Body("far", box(8, -5, 40, 5))]
    found = []
    for each in (profile, profile.mirrored):
        layout = layout_of(bodies, [Joint("hinge", (0, 1), 0j, 0.0, each, 10.0)])
        found.append(plate_response(layout, mesh_layout(layout, 2)).compliance)
    beam = profile.compliance(68e3, 0.29, 7.0)
    assert np.diag(found[0])[2] == pytest.approx(beam[2, 2], rel=BEAM)
    assert found[0][0, 2] == pytest.approx(beam[0, 2], rel=BEAM)
    assert found[1][0, 2] == pytest.approx(-found[0][0, 2], rel=COARSE_MESH)


def flush_leaf(profile, widened=0.0):
    """A leaf along x whose right edge is the lower side of the ground, and of the stage unless this
    is wider.
    """
    ground = box(-20, -0.25, -6, 6)
    stage = box(6, -0.25 - widened, 20, 6)
    bodies = [Body("ground", ground, fixed=True), Body("stage", stage)]
    return layout_of(bodies, [Joint("leaf", (0, 1), 0j, 0.0, profile, 3.0)])


def test_a_flush_leaf_is_meshed_without_a_fillet_there_and_has_no_sharp_corner():
    """Areas by hand: both bodies, the leaf, and fillets of r^2 (1 - pi / 4) at the corners that
    have one.
    """
    fillet = 0.64 * (1 - np.pi / 4)
    for profile, fillets in (
        (Leaf(0.5, 12.0, 0.8, side="left"), 2),
        (Leaf(0.5, 12.0, 0.8, flush=("first right",)), 3),
    ):
        layout = flush_leaf(profile, 1.5 * (fillets - 2))
        check_layout(layout)
        expected = 14 * 6.25 + 14 * (6.25 + 1.5 * (fillets - 2)) + 12 * 0.5 + fillets * fillet
        assert area_of(mesh_layout(layout, 3), 0, 1, 2) == pytest.approx(expected, rel=PARABOLAS)
        assert not has_sharp_corner(layout, layout.joints[0])
    wider = flush_leaf(Leaf(0.5, 12.0, 0.8, side="left"), 0.5)
    assert has_sharp_corner(wider, wider.joints[0])
    bare = flush_leaf(Leaf(0.5, 12.0))
    assert has_sharp_corner(bare, bare.joints[0])
    strip = layout_of(
        [
            Body("ground", box(-20, -0.25, -6, 0.25), fixed=True),
            Body("stage", box(6, -0.25, 20, 0.25)),
        ],
        bare.joints,
    )
    assert not has_sharp_corner(strip, strip.joints[0])
