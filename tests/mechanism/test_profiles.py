"""Hinge profiles against closed forms: beam integrals, edges, surface stress, triangle sizes,
refusals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BPoly

from flexfem.hinges.formulas import formula
from flexfem.hinges.shapes import SHAPE_FORMULAS
from flexfem.mechanism.edges import Bezier, Ellipse, mapped
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_shape import BadDimension
from flexfem.mechanism.profiles import (
    SHAPES,
    Circular,
    Elliptical,
    Leaf,
    Parabolic,
    Segment,
    Vee,
    profile_of,
)
from flexfem.mechanism.stress_concentration import shoulder
from flexfem.mechanism.tabulated import Tabulated

TAPER = (
    (2.0, 1.0),
    (6.0, 1.8),
    (12.0, 3.0),
)  # a straight edge: h = 2 + 0.2 x from the middle of the table
BOWED = (
    (-4.0, 2.0, 1.5),
    (-1.0, 0.4, 0.1),
    (0.5, 0.2, 0.5),
    (3.0, 1.0, 2.2),
)  # position, left and right edge
UNEVEN = (
    (-4.0, 3.0),
    (-3.0, 0.5),
    (0.3, 0.7),
    (2.0, 0.55),
    (5.0, 2.5),
)  # unsymmetric, with two necks
EACH = (
    Circular(0.4, 3.0),
    Elliptical(0.3, 10.0, 2.0),
    Elliptical(0.3, 4.0, 7.0),
    Leaf(0.5, 12.0),
    Leaf(0.5, 12.0, 0.8),
    Parabolic(0.2, 6.0, 2.5),
    Vee(0.6, np.deg2rad(70), 0.3, 2.0),
    Tabulated(TAPER),
    Tabulated(TAPER, smooth=True),
    Tabulated(UNEVEN),
    Tabulated(UNEVEN, smooth=True),
    Circular(0.4, 3.0, side="left"),
    Elliptical(0.3, 10.0, 2.0, side="right"),
    Leaf(0.5, 12.0, 0.8, side="right"),
    Leaf(0.5, 12.0, 0.8, flush=("first left", "second right")),
    Leaf(0.5, 12.0, 0.8, flush=("second right",)),
    Parabolic(0.2, 6.0, 2.5, side="left"),
    Vee(0.6, np.deg2rad(70), 0.3, 2.0, side="right"),
    Tabulated(BOWED),
    Tabulated(BOWED, smooth=True),
)
UNSYMMETRIC = [profile for profile in EACH if not profile.symmetric]


def test_leaf_by_hand():
    C = Leaf(0.5, 20.0).compliance(2e5, 0.3, 10.0)
    assert C[0, 0] == pytest.approx(20 / (2e5 * 10 * 0.5), rel=1e-12)
    assert C[1, 1] == pytest.approx(
        20**3 / (2e5 * 10 * 0.125) + 1.2 * 20 / (2e5 / 2.6 * 10 * 0.5), rel=1e-12
    )
    assert C[2, 2] == pytest.approx(12 * 20 / (2e5 * 10 * 0.125), rel=1e-12)


@pytest.mark.parametrize("neck", [1e-3, 0.2, 2.0])
def test_circle_is_that_of_the_hinge_formulas(neck: float):
    exact = formula("paros-weisbord").compliance(1.0, neck, 7.0, 6e4, 0.33)
    for profile in (Circular(neck, 1.0), Elliptical(neck, 2.0, 1.0)):
        found = np.diag(profile.compliance(6e4, 0.33, 7.0))
        assert found == pytest.approx([exact.axial, exact.shear, exact.rotation], rel=1e-9)


@pytest.mark.parametrize("shape", SHAPE_FORMULAS)
def test_closed_forms_of_other_shapes(shape: str):
    """With nu = -1 nothing shears."""
    known = SHAPE_FORMULAS[shape]
    size = 8.0 if shape == "leaf" else 1.5
    for ratio in known.valid:
        own = {"filleted": {"fillet": size}, "leaf": {}}.get(shape, {"depth": size})
        profile = profile_of(shape, {"length": 8.0, "neck": ratio * size} | own)
        axial, shear, rotation = np.diag(profile.compliance(3.0, -1.0, 2.0))
        expected = {"rotation": rotation, "axial": axial, "shear": shear}
        for freedom, function in known.functions.items():
            assert function(profile) / 6 == pytest.approx(expected[freedom], rel=1e-9)


def test_flanks_of_a_v():
    """They meet at the apex r (1 / sin(angle / 2) - 1) below a rounded root.

    From a sharp root int dx / h^3 is tan(angle / 2) (1 / t^2 - 1 / H^2) / 2 over both halves.
    """
    assert Vee(0.5, np.deg2rad(60), 1.0, 3.0).length == pytest.approx(8 / 3**0.5)
    C = Vee(0.6, np.deg2rad(70), 1e-6, 2.0).compliance(1.0, 0.3, 1.0)
    assert C[2, 2] == pytest.approx(6 * np.tan(np.deg2rad(35)) * (1 / 0.36 - 1 / 4.6**2), rel=1e-5)


def test_a_tapered_table_couples_force_and_moment():
    C = Tabulated(TAPER).compliance(1.0, -1.0, 1.0)
    zero = (1 - 1 / 9) / 0.4
    first = 25 * (1 - 1 / 3) - 25 * (1 - 1 / 9)
    assert C[2, 2] == pytest.approx(12 * zero, rel=1e-9)
    assert C[1, 2] == C[2, 1] == pytest.approx(-12 * first, rel=1e-9)


def test_a_v_of_three_rows_has_straight_edges():
    """By hand: the height is 1 + |x|, so the integral of 1 / h^3 is 1 - 1 / 36 and that of 1 / h is
    2 ln 6.
    """
    E = 71700.0
    b = 10.0
    vee = Tabulated(((-5.0, 6.0), (0.0, 1.0), (5.0, 6.0)))
    C = vee.compliance(E, 0.33, b)
    assert 1 / C[2, 2] == pytest.approx(61457.14, abs=0.01)
    assert C[0, 0] == pytest.approx(2 * np.log(6) / (E * b), rel=1e-12)
    bending = 12 * 2 * (np.log(6) - 2 * (1 - 1 / 6) + (1 - 1 / 36) / 2)  # x^2 / h^3 with x = h - 1
    assert C[1, 1] == pytest.approx((bending + 1.2 * 2.66 * 2 * np.log(6)) / (E * b), rel=1e-12)
    assert vee.with_neck(1.5).height(np.array([-2.5, 0, 5])) == pytest.approx([4.0, 1.5, 6.5])


def test_a_smooth_table_differs_from_straight_edges():
    """Three rows of a V by the monotone cubic: 22,775 N mm/rad."""
    C = Tabulated(((-5.0, 6.0), (0.0, 1.0), (5.0, 6.0)), smooth=True).compliance(
        71700.0, 0.33, 10.0
    )
    assert 1 / C[2, 2] == pytest.approx(22775, abs=1)


def test_another_neck_keeps_the_curve_of_a_table():
    x = np.array([-3.7, -1.0, 2.2])
    for table in (Tabulated(UNEVEN), Tabulated(UNEVEN, smooth=True)):
        assert table.with_neck(0.8).height(x) == pytest.approx(table.height(x) + 0.3, rel=1e-12)


def test_sharp_corners_of_a_table():
    """Each edge of the parabola 1 + x^2 / 20 turns by spacing / 20 at a row: by 1.4 and 5.7
    degrees.
    """
    fine, coarse = (
        Tabulated(tuple((x, 1 + x**2 / 20) for x in np.arange(-8, 8.1, spacing).tolist()))
        for spacing in (0.5, 2.0)
    )
    assert not fine.sharp and coarse.sharp and not replace(coarse, smooth=True).sharp
    assert Tabulated(((-5.0, 6.0), (-4.0, 1.0), (4.0, 1.0), (5.0, 6.0))).sharp
    assert Tabulated(
        ((0.0, 1.0), (4.0, 1.2), (8.0, 5.0)), smooth=True
    ).sharp  # its low end meets a body
    assert not Tabulated(((0.0, 5.0), (1.0, 1.0), (4.0, 0.95), (8.0, 5.0)), smooth=True).sharp


def test_triangles_follow_every_neck_and_corner_of_a_table():
    """Two necks, 0.5 and 0.55 mm high, 5 mm apart, and a corner of 51 + 4 degrees at the first."""
    sizes = Tabulated(UNEVEN).sizes(8.0)

    def size_at(z: complex) -> float:
        return min(
            size for points, size, reach in sizes for point in points if abs(point - z) <= reach
        )

    assert size_at(-3.5) == pytest.approx(0.5 / 8)
    assert 0.55 / 8 / 2**0.5 < size_at(1.5) < 0.55 / 8
    assert size_at(-3.5 + 0.25j) == pytest.approx(0.5 / 64)


def test_the_section_of_a_table_is_at_a_row_or_well_between_two():
    for middle, expected in (
        (0.3, -0.2),
        (1.4, 0.9),
        (2.4, 0.0),
    ):  # table from -4 to 5: its middle is 0.5
        table = Tabulated(
            (
                (-4.0, 3.0),
                (middle, 1.0),
                (5.0, 3.0),
            )
        )
        assert table.section == pytest.approx(expected)


def test_a_table_is_smooth_and_monotone():
    parabola = Parabolic(0.4, 6.0, 2.0)
    table = Tabulated.of(parabola.height, 6.0)
    assert table.compliance(1.0, 0.3, 1.0) == pytest.approx(
        parabola.compliance(1.0, 0.3, 1.0), rel=2e-3, abs=1e-9
    )
    step = Tabulated(((0, 3), (1, 3), (1.1, 0.5), (4, 0.5), (5, 2)), smooth=True)
    heights = step.height(np.linspace(-2.5, 2.5, 1001))
    assert (step.neck, heights.min(), heights.max()) == pytest.approx((0.5, 0.5, 3), rel=1e-12)
    assert step.height(np.array([-1.5, 1.0])) == pytest.approx([3.0, 0.5])


@pytest.mark.parametrize("profile", EACH, ids=repr)
def test_integrals_and_edges_follow_the_height(profile: Profile):
    expected = sum(
        quad(lambda x: float(profile.height(np.array(x))) ** -3, a, b, epsrel=1e-11)[0]
        for a, b in zip(profile.breaks[:-1], profile.breaks[1:], strict=True)
    )
    assert profile.compliance(1.0, 0.3, 1.0)[2, 2] == pytest.approx(12 * expected, rel=1e-9)
    for side, edge in zip((1, -1), profile.edges(), strict=True):
        assert_edge(profile, side, edge)


def assert_edge(profile, side, edge):
    """The edge has the ends of the profile, no gap, and half the height from the mid-line."""
    half = profile.length / 2
    ends = []
    on = []
    share = np.array([0.0, 0.3, 0.7, 1.0])
    for curve in edge:
        z = curve.at(share) if isinstance(curve, Segment) else np.array(curve[:2])
        if isinstance(curve, Bezier):
            z = BPoly(np.array(curve.points)[:, None], [0, 1])(share)
        if isinstance(curve, Ellipse):
            a = profile.length / 2
            b = profile.depth
            assert (abs(curve.major), curve.centre) == pytest.approx(
                (max(a, b), side * 1j * (0.15 + b))
            )
        on = [*on, *z]
        ends = [*ends, z[0], z[-1]]
    middle = profile.middle(np.real(on))
    height = profile.height(np.real(on))
    assert np.imag(on) == pytest.approx(middle + side * height / 2, abs=1e-7)
    assert (ends[0].real, ends[-1].real) == pytest.approx((-half, half))
    assert ends[1:-1:2] == pytest.approx(ends[2::2], abs=1e-12)


def test_stress_by_hand():
    leaf = Leaf(0.5, 20.0)
    b = 10.0
    assert leaf.stress(np.array([3.0, 0, 0]), b) == pytest.approx(3 / 5)
    assert leaf.stress(np.array([[-3.0, 0, 7], [0, 2, 20]]), b) == pytest.approx(
        [0.6 + 42 / 2.5, 6 * 40 / 2.5]
    )
    assert Leaf(0.5, 0.2).stress(np.array([3.0, 4, 0]), b) == pytest.approx(
        np.hypot(3, 1.5 * 3**0.5 * 4) / 5
    )
    load = np.array([0, 1.0, 5.0])  # the moment vanishes at the far end
    assert Tabulated(TAPER).stress(load, 1.0) == pytest.approx(60)
    assert Tabulated(tuple((-x, h) for x, h in TAPER[::-1])).stress(load, 1.0) < 20
    held = Leaf(0.5, 0.2).stress(
        np.array([[3.0, 0, 1], [3, 4, 0]]), b, out_of_plane=0.3
    )  # plane strain
    assert held == pytest.approx([0.79**0.5 * (0.6 + 6 / 2.5), (0.79 * 9 + 3 * 36) ** 0.5 / 5])
    assert leaf.stress(np.ones((2, 1, 3)), np.array([1.0, 2, 4])) == pytest.approx(
        np.broadcast_to(leaf.stress(np.ones(3), 1.0) / [1, 2, 4], (2, 3))
    )


def test_stress_is_raised_at_necks_and_fillets():
    """Norton's fit of Peterson's chart in bending at D = 3 d, 0.9072 (r / d)^(-1/3)."""
    for ratio in (4.0, 10.0, 18.0):
        assert shoulder(ratio)[1] == pytest.approx(0.9072 * ratio ** (1 / 3), rel=0.025)
    found = Leaf(0.5, 12.0, 0.05).stress(np.array([0, 0, 1.0]), 2.0)
    assert found == pytest.approx(12 * 0.9072 * 10 ** (1 / 3), rel=0.02)
    assert shoulder(1e-3) == pytest.approx((1, 1), abs=2e-3)
    for radius, a in (
        (4.0, 0.05),
        (0.8, 0.25),
    ):  # Neuber's K of a = t / 2R is 1 + 2 a / 5, in tension 1 + 2 a / 3
        pull, moment = Circular(0.4, radius).stress(np.array([[1.0, 0, 0], [0, 0, 1.0]]), 2.0)
        assert (pull * 0.8, moment * 0.16 / 3) == pytest.approx(
            (1 + 2 * a / 3, 1 + 0.4 * a), rel=0.02
        )


@pytest.mark.parametrize(
    "profile",
    [*EACH[:3], *EACH[5:7], Tabulated(((-1, 2), (0, 0.5), (1, 2), (4, 7)), smooth=True)],
    ids=repr,
)
def test_root_radius(profile: Profile):
    x = (
        np.array([-1e-3, 0, 1e-3])
        if not isinstance(profile, Tabulated)
        else np.array([-2.5, -1.5, -0.5])
    )
    curvature = np.polyfit(x, profile.height(x) / 2, 2)[0] * 2
    assert profile.root_radius == pytest.approx(1 / curvature, rel=1e-3)


@pytest.mark.parametrize("profile", EACH, ids=repr)
def test_sizes_resolve_the_neck(profile: Profile):
    sizes = profile.sizes(8.0)
    across = min(
        size
        for points, size, _ in sizes
        if all(abs(z.imag - profile.middle(np.array(z.real))) < 1e-9 for z in points)
    )
    assert across == pytest.approx(profile.neck / 8)
    assert all(size > profile.neck / 100 and reach > size / 2 for _, size, reach in sizes)


@pytest.mark.parametrize(
    ("shape", "dimensions", "key"),
    [
        ("square", {}, "shape"),
        ("circular", {"radius": 3.0}, "neck"),
        ("circular", {"radius": 3.0, "neck": 1.0, "depth": 2.0}, "depth"),
        ("circular", {"radius": -3.0, "neck": 1.0}, "radius"),
        ("leaf", {"length": np.inf, "neck": 1.0}, "length"),
        ("filleted", {"length": 4.0, "neck": 1.0, "fillet": 2.0}, "fillet"),
        ("v", {"angle": 3.2, "root_radius": 1.0, "depth": 2.0, "neck": 1.0}, "angle"),
        ("v", {"angle": 1.0, "root_radius": 9.0, "depth": 2.0, "neck": 1.0}, "depth"),
        ("profile", {"table": [[0, 1], [2, 1]]}, "table"),
        ("profile", {"table": [[0, 1], [2, 1], [1, 1]]}, "table"),
        ("profile", {"table": [[0, 1], [2, 1], [2, 4], [3, 4]]}, "table"),
        ("profile", {"table": [[0, 4], [2, 4], [2.0001, 1], [4, 1]], "smooth": True}, "table"),
        ("profile", {"table": [[0, 1], [2, 1, 1], [3, 4]]}, "table"),
        ("profile", {"table": [[0, 1, 1], [2, 1, -1], [3, 4, 1]]}, "table"),
        ("profile", {"table": [[0, 1], [2, 1], [3, 4]], "side": "left"}, "side"),
        ("circular", {"radius": 3.0, "neck": 1.0, "side": "upper"}, "side"),
        ("leaf", {"length": 4.0, "neck": 1.0, "flush": ["left"]}, "flush"),
        ("circular", {"radius": 3.0, "neck": 1.0, "flush": ["first left"]}, "flush"),
        ("leaf", {"length": 4.0, "neck": 1.0, "smooth": True}, "smooth"),
    ],
)
def test_refusals_name_the_key(shape: str, dimensions: dict[str, object], key: str):
    with pytest.raises(BadDimension, match=f"^{key}: expected ") as refused:
        profile_of(shape, dimensions)
    assert refused.value.key == key


def test_every_shape_is_made_from_its_keys():
    made = profile_of("v", {"angle": 1.0, "root_radius": 0.5, "depth": 2.0, "neck": 1.0})
    assert made == Vee(1.0, 1.0, 0.5, 2.0) and set(map(type, EACH)) == set(SHAPES.values())


def test_a_beam_off_the_axis_by_hand():
    """Height 0.5, mid-line m = 0.2 + 0.1 x over 10 mm: int m = 2, int x m = 0.1 10^3 / 12, int m^2
    = 0.4 + 10 / 12.
    """
    rows = [(x, 0.25 + 0.2 + 0.1 * x, 0.25 - 0.2 - 0.1 * x) for x in (-5.0, 1.0, 5.0)]
    C = profile_of("profile", {"table": rows}).compliance(2e5, 0.3, 10.0)
    EA = 2e5 * 10 * 0.5
    EI = 2e5 * 10 * 0.5**3 / 12
    shear = 1.2 * 2.6 * 10 / EA
    expected = [
        [10 / EA + (0.4 + 0.01 * 1000 / 12) / EI, -0.1 * 1000 / 12 / EI, 2 / EI],
        [-0.1 * 1000 / 12 / EI, 1000 / 12 / EI + shear, 0],
        [2 / EI, 0, 10 / EI],
    ]
    assert np.allclose(C, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_circular_notch_on_one_side_by_quadrature(side: str):
    """The straight edge is at half a neck from the axis, so that the mid-line rises by half of what
    the notch does.
    """
    t = 0.4
    R = 3.0
    sign = 1 if side == "left" else -1

    def height(x):
        return t + R - np.sqrt(R**2 - x**2)

    def middle(x):
        return sign * (R - np.sqrt(R**2 - x**2)) / 2

    def integral(of):
        return 2 * quad(lambda x: of(x) / height(x) ** 3, 0, R, epsrel=1e-11, limit=200)[0]

    profile = Circular(t, R, side=side)
    C = profile.compliance(1.0, -1.0, 12.0)
    axial = 2 * quad(lambda x: 1 / height(x), 0, R, epsrel=1e-11)[0] / 12
    assert C[0, 0] == pytest.approx(axial + integral(lambda x: middle(x) ** 2), rel=1e-8)
    assert C[0, 2] == C[2, 0] == pytest.approx(integral(middle), rel=1e-8)
    assert C[2, 2] == pytest.approx(integral(lambda x: 1.0), rel=1e-8)
    assert profile.least_cut == pytest.approx(2 * (t / 2 + R))


@pytest.mark.parametrize("profile", UNSYMMETRIC, ids=repr)
def test_a_mirror_image_has_the_opposite_coupling(profile: Profile):
    """So have sections that carry stress: pulling the mirror image and turning it back is the same."""
    flip = np.diag([1.0, -1.0, -1.0])
    other = profile.mirrored
    assert other.mirrored == profile != other
    C = profile.compliance(1.0, 0.3, 1.0)
    assert other.compliance(1.0, 0.3, 1.0) == pytest.approx(flip @ C @ flip, rel=1e-12, abs=1e-15)
    assert max(abs(C[0, 1:]) / np.sqrt(C[0, 0] * np.diag(C)[1:])) > 1e-3
    load = np.array([3.0, -1.0, 2.0])
    assert other.stress(flip @ load, 2.0) == pytest.approx(profile.stress(load, 2.0), rel=1e-12)
    assert other.edges()[0][0] == mapped(profile.edges()[1][0], lambda z: z.conjugate())


@pytest.mark.parametrize("smooth", [False, True])
def test_equal_sides_are_the_symmetric_table_to_the_last_digit(smooth: bool):
    whole = Tabulated(UNEVEN, smooth)
    halves = Tabulated(tuple((x, h / 2, h / 2) for x, h in UNEVEN), smooth)
    assert np.array_equal(halves.compliance(7e4, 0.3, 8.0), whole.compliance(7e4, 0.3, 8.0))
    assert halves.edges() == whole.edges() and halves.sizes(8.0) == whole.sizes(8.0)
    assert np.array_equal(halves.opened_before(0.3), whole.opened_before(0.3))


def test_a_scanned_neck_of_unequal_shifted_notches():
    """Circles of 1.506 and 1.679 mm, 0.157 mm apart along the axis, 0.01533 mm apart: that of their
    mean curvature.

    Paros and Weisbord: 2 E b t^2.5 / (9 pi sqrt(R)) with 2 / R = 1 / 1.506 + 1 / 1.679.
    """
    first = 1.506
    second = 1.679
    gap = 0.01533
    shift = 0.157
    apart = np.sqrt((first + second + gap) ** 2 - shift**2)
    share = (first + gap / 2) / (first + second + gap)
    x = 0.02 * np.sinh(np.linspace(-1, 1, 81) * np.arcsinh(70))
    left = apart * share - np.sqrt(first**2 - (x + shift * share) ** 2)
    right = apart * (1 - share) - np.sqrt(second**2 - (x - shift * (1 - share)) ** 2)
    scanned = Tabulated(
        tuple(zip(x.tolist(), left.tolist(), right.tolist(), strict=True)), smooth=True
    )
    radius = 2 / (1 / first + 1 / second)
    expected = 2 * 131e3 / 0.91 * 6.35 * gap**2.5 / (9 * np.pi * np.sqrt(radius))
    assert expected == pytest.approx(1.493, abs=1e-3)
    assert 1 / scanned.compliance(131e3 / 0.91, 0.3 / 0.7, 6.35)[2, 2] == pytest.approx(
        expected, rel=0.01
    )
    assert scanned.root_radius == pytest.approx(radius, rel=0.01)


def test_stress_of_a_notch_on_one_side():
    """A moment: the inner edge of a bar of mid-line curvature 1 / 2R, times Neuber's factor of two
    edges of 2 R.

    A pull: the straight edge bends, most where the height is 1.5 t, to 4 / 3 of the mean stress of
    the neck."""
    t = 0.1
    R = 5.0
    b = 2.0
    pull, moment = Circular(t, R, side="left").stress(np.array([[1.0, 0, 0], [0, 0, 1.0]]), b)
    assert moment * b * t**2 / 6 == pytest.approx(
        (1 + 0.4 * t / (4 * R)) * (1 + t / (6 * R)), rel=1e-3
    )
    assert pull * b * t == pytest.approx(4 / 3, rel=5e-3)


def test_fillets_on_one_side_raise_the_stress_of_this_edge_alone():
    leaf = Leaf(0.5, 12.0, 0.1, side="left")
    at = np.array([-5.95, 0.0, 5.95])
    left, right = (leaf.concentration(at, side) for side in (-1.0, 1.0))
    assert np.all(np.asarray(right) == 1.0)
    assert left.bending == pytest.approx([1.794, 1.0, 1.794], rel=5e-3)  # finite elements
    assert left.tension == pytest.approx([1.658, 1.0, 1.658], rel=0.015)


def test_a_leaf_that_is_flush_at_one_corner_has_three_fillets():
    """Each fillet adds r^2 (1 - pi / 4) to the area, and the mid-line at the bare corner rises by
    half a fillet.
    """
    t = 0.5
    span = 12.0
    r = 0.8
    leaf = Leaf(t, span, r, flush=("first right",))
    x, weights = leaf.quadrature
    assert float(weights @ leaf.height(x)) == pytest.approx(
        t * span + 3 * r**2 * (1 - np.pi / 4), rel=1e-9
    )
    assert leaf.height(np.array([-6.0, 6.0])) == pytest.approx([t + r, t + 2 * r])
    assert leaf.middle(np.array([-6.0, 0.0, 6.0])) == pytest.approx([r / 2, 0, 0])
    left, right = leaf.edges()
    assert [type(curve.centre) for curve in right] == [type(None), type(None), complex] and len(
        left
    ) == 4
    assert leaf.mirrored.flush == ("first left",)
    assert Leaf(t, span, r, flush=("first right", "second right")).compliance(
        1.0, 0.3, 1.0
    ) == pytest.approx(Leaf(t, span, r, side="left").compliance(1.0, 0.3, 1.0), rel=1e-12)
