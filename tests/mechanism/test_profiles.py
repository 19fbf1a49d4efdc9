"""Hinge profiles against closed forms: beam integrals, edges, surface stress, triangle sizes, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BPoly

from flexfem.hinges.formulas import formula
from flexfem.hinges.shapes import SHAPE_FORMULAS
from flexfem.mechanism.profiles import (
    SHAPES,
    BadDimension,
    Bezier,
    Circular,
    Ellipse,
    Elliptical,
    Leaf,
    Parabolic,
    Profile,
    Segment,
    Tabulated,
    Vee,
    profile_of,
    shoulder,
)

TAPER = ((2.0, 1.0), (6.0, 1.8), (12.0, 3.0))  # a straight edge: h = 2 + 0.2 x from the middle of the table
UNEVEN = ((-4.0, 3.0), (-3.0, 0.5), (0.3, 0.7), (2.0, 0.55), (5.0, 2.5))  # unsymmetric, with two necks
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
)


def test_leaf_by_hand():
    C = Leaf(0.5, 20.0).compliance(2e5, 0.3, 10.0)
    assert C[0, 0] == pytest.approx(20 / (2e5 * 10 * 0.5), rel=1e-12)
    assert C[1, 1] == pytest.approx(20**3 / (2e5 * 10 * 0.125) + 1.2 * 20 / (2e5 / 2.6 * 10 * 0.5), rel=1e-12)
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
    known, size = SHAPE_FORMULAS[shape], 8.0 if shape == "leaf" else 1.5
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
    zero, first = (1 - 1 / 9) / 0.4, 25 * (1 - 1 / 3) - 25 * (1 - 1 / 9)
    assert C[2, 2] == pytest.approx(12 * zero, rel=1e-9)
    assert C[1, 2] == C[2, 1] == pytest.approx(-12 * first, rel=1e-9)


def test_a_v_of_three_rows_has_straight_edges():
    """By hand: the height is 1 + |x|, so the integral of 1 / h^3 is 1 - 1 / 36 and that of 1 / h is 2 ln 6."""
    E, b = 71700.0, 10.0
    vee = Tabulated(((-5.0, 6.0), (0.0, 1.0), (5.0, 6.0)))
    C = vee.compliance(E, 0.33, b)
    assert 1 / C[2, 2] == pytest.approx(61457.14, abs=0.01)
    assert C[0, 0] == pytest.approx(2 * np.log(6) / (E * b), rel=1e-12)
    bending = 12 * 2 * (np.log(6) - 2 * (1 - 1 / 6) + (1 - 1 / 36) / 2)  # x^2 / h^3 with x = h - 1
    assert C[1, 1] == pytest.approx((bending + 1.2 * 2.66 * 2 * np.log(6)) / (E * b), rel=1e-12)
    assert vee.with_neck(1.5).height(np.array([-2.5, 0, 5])) == pytest.approx([4.0, 1.5, 6.5])


def test_a_smooth_table_differs_from_straight_edges():
    """Three rows of a V by the monotone cubic: 22,775 N mm/rad."""
    C = Tabulated(((-5.0, 6.0), (0.0, 1.0), (5.0, 6.0)), smooth=True).compliance(71700.0, 0.33, 10.0)
    assert 1 / C[2, 2] == pytest.approx(22775, abs=1)


def test_another_neck_keeps_the_curve_of_a_table():
    x = np.array([-3.7, -1.0, 2.2])
    for table in (Tabulated(UNEVEN), Tabulated(UNEVEN, smooth=True)):
        assert table.with_neck(0.8).height(x) == pytest.approx(table.height(x) + 0.3, rel=1e-12)


def test_sharp_corners_of_a_table():
    """Each edge of the parabola 1 + x^2 / 20 turns by spacing / 20 at a row: by 1.4 and 5.7 degrees."""
    fine, coarse = (
        Tabulated(tuple((x, 1 + x**2 / 20) for x in np.arange(-8, 8.1, spacing).tolist())) for spacing in (0.5, 2.0)
    )
    assert not fine.sharp and coarse.sharp and not replace(coarse, smooth=True).sharp
    assert Tabulated(((-5.0, 6.0), (-4.0, 1.0), (4.0, 1.0), (5.0, 6.0))).sharp
    assert Tabulated(((0.0, 1.0), (4.0, 1.2), (8.0, 5.0)), smooth=True).sharp  # its low end meets a body
    assert not Tabulated(((0.0, 5.0), (1.0, 1.0), (4.0, 0.95), (8.0, 5.0)), smooth=True).sharp


def test_triangles_follow_every_neck_and_corner_of_a_table():
    """Two necks, 0.5 and 0.55 mm high, 5 mm apart, and a corner of 51 + 4 degrees at the first."""
    sizes = Tabulated(UNEVEN).sizes(8.0)

    def size_at(z: complex) -> float:
        return min(size for points, size, reach in sizes for point in points if abs(point - z) <= reach)

    assert size_at(-3.5) == pytest.approx(0.5 / 8)
    assert 0.55 / 8 / 2**0.5 < size_at(1.5) < 0.55 / 8
    assert size_at(-3.5 + 0.25j) == pytest.approx(0.5 / 64)


def test_the_section_of_a_table_is_at_a_row_or_well_between_two():
    for middle, expected in ((0.3, -0.2), (1.4, 0.9), (2.4, 0.0)):  # table from -4 to 5: its middle is 0.5
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
    assert table.compliance(1.0, 0.3, 1.0) == pytest.approx(parabola.compliance(1.0, 0.3, 1.0), rel=2e-3, abs=1e-9)
    step = Tabulated(((0, 3), (1, 3), (1.1, 0.5), (4, 0.5), (5, 2)), smooth=True)
    heights = step.height(np.linspace(-2.5, 2.5, 1001))
    assert (step.neck, heights.min(), heights.max()) == pytest.approx((0.5, 0.5, 3), rel=1e-12)
    assert step.height(np.array([-1.5, 1.0])) == pytest.approx([3.0, 0.5])


@pytest.mark.parametrize("profile", EACH, ids=repr)
def test_integrals_and_edges_follow_the_height(profile: Profile):
    half = profile.length / 2
    expected = sum(
        quad(lambda x: float(profile.height(np.array(x))) ** -3, a, b, epsrel=1e-11)[0]
        for a, b in zip(profile.breaks[:-1], profile.breaks[1:], strict=True)
    )
    assert profile.compliance(1.0, 0.3, 1.0)[2, 2] == pytest.approx(12 * expected, rel=1e-9)
    ends, on = [], []
    share = np.array([0.0, 0.3, 0.7, 1.0])
    for curve in profile.edge():
        z = curve.at(share) if isinstance(curve, Segment) else np.array(curve[:2])
        if isinstance(curve, Bezier):
            z = BPoly(np.array(curve.points)[:, None], [0, 1])(share)
        if isinstance(curve, Ellipse):
            a, b = profile.length / 2, profile.depth
            assert (abs(curve.major), curve.centre) == pytest.approx((max(a, b), 1j * (0.15 + b)))
        on, ends = [*on, *z], [*ends, z[0], z[-1]]
    assert np.imag(on) == pytest.approx(profile.height(np.real(on)) / 2, abs=1e-7)
    assert (ends[0].real, ends[-1].real) == pytest.approx((-half, half))
    assert ends[1:-1:2] == pytest.approx(ends[2::2], abs=1e-12)


def test_stress_by_hand():
    leaf, b = Leaf(0.5, 20.0), 10.0
    assert leaf.stress(np.array([3.0, 0, 0]), b) == pytest.approx(3 / 5)
    assert leaf.stress(np.array([[-3.0, 0, 7], [0, 2, 20]]), b) == pytest.approx([0.6 + 42 / 2.5, 6 * 40 / 2.5])
    assert Leaf(0.5, 0.2).stress(np.array([3.0, 4, 0]), b) == pytest.approx(np.hypot(3, 1.5 * 3**0.5 * 4) / 5)
    load = np.array([0, 1.0, 5.0])  # the moment vanishes at the far end
    assert Tabulated(TAPER).stress(load, 1.0) == pytest.approx(60)
    assert Tabulated(tuple((-x, h) for x, h in TAPER[::-1])).stress(load, 1.0) < 20
    held = Leaf(0.5, 0.2).stress(np.array([[3.0, 0, 1], [3, 4, 0]]), b, out_of_plane=0.3)  # plane strain
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
    for radius, a in ((4.0, 0.05), (0.8, 0.25)):  # Neuber's K of a = t / 2R is 1 + 2 a / 5, in tension 1 + 2 a / 3
        pull, moment = Circular(0.4, radius).stress(np.array([[1.0, 0, 0], [0, 0, 1.0]]), 2.0)
        assert (pull * 0.8, moment * 0.16 / 3) == pytest.approx((1 + 2 * a / 3, 1 + 0.4 * a), rel=0.02)


@pytest.mark.parametrize(
    "profile", [*EACH[:3], *EACH[5:7], Tabulated(((-1, 2), (0, 0.5), (1, 2), (4, 7)), smooth=True)], ids=repr
)
def test_root_radius(profile: Profile):
    x = np.array([-1e-3, 0, 1e-3]) if not isinstance(profile, Tabulated) else np.array([-2.5, -1.5, -0.5])
    curvature = np.polyfit(x, profile.height(x) / 2, 2)[0] * 2
    assert profile.root_radius == pytest.approx(1 / curvature, rel=1e-3)


@pytest.mark.parametrize("profile", EACH, ids=repr)
def test_sizes_resolve_the_neck(profile: Profile):
    sizes = profile.sizes(8.0)
    across = min(size for points, size, _ in sizes if all(abs(z.imag) < 1e-9 for z in points))
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
