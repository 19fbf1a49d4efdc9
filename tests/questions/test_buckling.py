"""Load factors of buckling under stated loads: Euler's columns, loads off the output, pairs, and
out of the plane.
"""

import numpy as np
import pytest

import flexfem

E = 70_000.0
B = 9.0
T = 0.4
L = 37.0  # MPa, mm
# N, by hand: I = 9 * 0.4^3 / 12 = 0.048 mm^4, E I = 3360 N mm^2, pi^2 E I / L^2 = 24.223 N
CLAMPED_FREE = 6.0558
GUIDED = 24.223
PINNED = 49.554
CLAMPED = 96.893
# of the load: the shear of a leaf and its division into eight beams; the mesh of finite elements
EULER = 1e-3
# N: k L tan(k L) = 1 at k L = 0.86033, where another leaf with E I / L holds the lower end
ON_A_LEAF = 1.8167
# N: k L tan(k L) = L / 6 mm at k L = 1.35453, of a leaf with a rigid piece of 6 mm on it
LONGER = 4.5031
# of the load: the band of finite elements out of the plane, and the shear of a thick column
SQUARE = 6e-3


def material():
    return {
        "name": "m",
        "youngs_modulus": E,
        "poissons_ratio": 0.29,
        "density": 2700.0,
        "yield_strength": 400.0,
    }


def leaf_between(name, first, second, start, neck=T):
    """A hinge of the length of all leaves from x = start to the right."""
    return {
        "name": name,
        "between": (first, second),
        "at": (start + L / 2, 0.0),
        "direction": 0.0,
        "shape": "leaf",
        "neck": neck,
        "length": L,
    }


def column(neck=T, thickness=B):
    """A leaf from a fixed body to the output."""
    return flexfem.Mechanism(
        name="column",
        thickness=thickness,
        material=material(),
        body=[
            {"name": "base", "path": [(-12, 0), (0, 0)], "width": 11, "fixed": True},
            {"name": "top", "path": [(L, 0), (L + 13, 0)], "width": 8},
        ],
        hinge=[leaf_between("leaf", "base", "top", 0.0, neck)],
        output={"body": "top", "at": (L, 0)},
    )


def two_columns():
    """Two leaves in one line, with a body between them that is the output, and a point at the free
    end.
    """
    return flexfem.Mechanism(
        name="two columns",
        thickness=B,
        material=material(),
        body=[
            {"name": "base", "path": [(-12, 0), (0, 0)], "width": 11, "fixed": True},
            {"name": "middle", "path": [(L, 0), (L + 6, 0)], "width": 8},
            {"name": "top", "path": [(2 * L + 6, 0), (2 * L + 15, 0)], "width": 8},
        ],
        hinge=[
            leaf_between("lower", "base", "middle", 0.0),
            leaf_between("upper", "middle", "top", L + 6),
        ],
        output={"body": "middle", "at": (L + 6, 0)},
        point=[{"name": "end", "body": "top", "at": (2 * L + 6, 0)}],
    )


@pytest.mark.parametrize(
    ("hold", "load"),
    [((), CLAMPED_FREE), (("theta",), GUIDED), (("y",), PINNED), (("y", "theta"), CLAMPED)],
    ids=["clamped and free", "guided", "clamped and pinned", "clamped at both ends"],
)
def test_beams_buckle_at_eulers_loads(hold, load):
    found = flexfem.buckling(
        column(), force=(-2.0, 0.0, 0.0), hold=hold, count=1, models="analytic"
    )
    assert 2.0 * found.factor[0, 0] == pytest.approx(load, rel=EULER)
    assert found.at("critical", point="output", direction="x") == pytest.approx(-load, rel=EULER)


@pytest.mark.parametrize(("hold", "load"), [((), CLAMPED_FREE), (("y",), PINNED)])
def test_plane_finite_elements_buckle_at_eulers_loads(hold, load):
    found = flexfem.buckling(
        column(),
        force=(-2.0, 0.0, 0.0),
        hold=hold,
        count=1,
        models="elements",
        plane=True,
        resolution=4,
    )
    assert 2.0 * found.factor[0, -1] == pytest.approx(load, rel=EULER)


@pytest.mark.slow
@pytest.mark.parametrize(("hold", "load"), [(("theta",), GUIDED), (("y", "theta"), CLAMPED)])
def test_finite_elements_of_a_thin_leaf_with_a_guided_end_buckle_at_eulers_loads(hold, load):
    """The end of a leaf on an elastic body turns a little, in proportion to its thickness: 0.9 % of
    the load at 0.4.
    """
    thin = 0.03
    found = flexfem.buckling(
        column(thin),
        force=(-2.0, 0.0, 0.0),
        hold=hold,
        count=1,
        models="elements",
        plane=True,
        resolution=4,
    )
    assert 2.0 * found.factor[0, -1] == pytest.approx(load * (thin / T) ** 3, rel=EULER)


def test_a_load_on_a_point_is_not_a_load_on_the_output():
    by_output = flexfem.buckling(two_columns(), force=(-1.0, 0.0, 0.0), count=1, models="analytic")
    assert by_output.factor[0, 0] == pytest.approx(LONGER, rel=EULER)
    by_point = flexfem.buckling(
        two_columns(), force_at={"end": (-1.0, 0.0, 0.0)}, count=1, models="analytic"
    )
    assert by_point.factor[0, 0] < CLAMPED_FREE / 4


@pytest.mark.parametrize("models", ["analytic", pytest.param("elements", marks=pytest.mark.slow)])
def test_a_pair_of_loads_compresses_what_is_between_them_alone(models):
    pair = {"force": (1.0, 0.0, 0.0), "force_at": ["end=-1,0,0"]}
    options = {} if models == "analytic" else {"plane": True, "resolution": 4}
    found = flexfem.buckling(two_columns(), **pair, count=1, models=models, **options)
    softer = 1.0 if models == "analytic" else 0.995  # both ends of the middle are elastic
    assert found.factor[0, -1] == pytest.approx(
        softer * ON_A_LEAF, rel=EULER if models == "analytic" else 5e-3
    )


@pytest.mark.slow
def test_tension_does_not_buckle_a_leaf():
    found = flexfem.buckling(column(), force=(2.0, 0.0, 0.0), count=1, plane=True, resolution=4)
    assert np.isnan(found.factor).all()
    assert any("no buckling in the plane" in text for text in found.warnings)


@pytest.mark.slow
def test_a_square_column_buckles_at_one_load_in_and_out_of_the_plane():
    """The load acts at a point of the body, not at its centre, which would make the column longer
    by 18 %.
    """
    width = 2.0
    found = flexfem.buckling(
        column(width, width), force=(-1000.0, 0.0, 0.0), count=1, models="elements"
    )
    load = np.pi**2 * E * width**4 / 12 / (4 * L**2)
    assert 1000.0 * found.factor[0, -1] == pytest.approx(load, rel=SQUARE)
    assert 1000.0 * float(found.factor_out_of_plane) == pytest.approx(load, rel=SQUARE)


@pytest.mark.slow
def test_a_thin_plate_buckles_out_of_the_plane_first():
    """A leaf 0.4 mm high in a plate 0.2 mm thick: a quarter of the load in the plane, and a
    warning.
    """
    found = flexfem.buckling(column(T, T / 2), force=(-1.0, 0.0, 0.0), count=1, models="elements")
    in_plane = float(found.factor[0, -1])
    assert float(found.factor_out_of_plane) == pytest.approx(in_plane / 4, rel=SQUARE)
    assert any("out of the plane" in text for text in found.warnings)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "no load"),
        ({"force": (0.0, 0.0, 0.0)}, "no load"),
        ({"force_at": ["ende=1,0,0"]}, "did you mean"),
        ({"force": (1.0, 0.0, 0.0), "hold": ["z"]}, "hold 'z', expected x, y or theta"),
    ],
)
def test_loads_that_are_not_known_are_refused(options, message):
    with pytest.raises(flexfem.BadInput, match=message):
        flexfem.buckling(two_columns(), models="analytic", **options)
