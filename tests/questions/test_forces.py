"""Forces and moments through hinges and sections by statics, and strains of beams."""

import numpy as np
import pytest

import flexfem

E = 70_000.0
NU = 0.29
B = 5.0  # MPa, mm
WIDTH = 4.0  # mm, of a bar that lies along x from 30 to 90 mm
STATICS = 1e-8  # of a force: balance of finite elements
ROUND_OFF = 1e-6  # N and N mm, of forces that vanish
FREE_EDGE = (
    0.05  # of a stress: nodal means at fillets, whose second stress does not vanish in elements
)
SAME_PLACE = 0.01  # of a ratio of strains at one place of one mesh, at a fillet
PLACED = ("strain", "strain_x", "strain_y")
# By hand: a load of 3 N along x, -2 N along y and 25 N mm at (80, 0), of which the leaf has its
# centre at (20, 0)
AT_LEAF = [3.0, -2.0, 25.0 - 2.0 * 60.0]
AT_50 = [3.0, -2.0, 25.0 - 2.0 * 30.0]  # about (50, 0)


def bar(reversed_hinge=False):
    """A bar on one leaf from a fixed body at the left; loads act at small discs of it."""
    ends = ("base", "bar")
    return flexfem.Mechanism(
        name="bar",
        thickness=B,
        model="plane_stress",
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": NU,
            "density": 2700.0,
            "yield_strength": 400.0,
        },
        body=[
            {"name": "base", "path": [(-2, 0), (10, 0)], "width": 12, "fixed": True},
            {"name": "bar", "path": [(30, 0), (90, 0)], "width": WIDTH},
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ends[::-1] if reversed_hinge else ends,
                "at": (20, 0),
                "direction": np.pi if reversed_hinge else 0.0,
                "shape": "leaf",
                "neck": 1.0,
                "length": 20.0,
                "fillet": 0.5,
            }
        ],
        output={"body": "bar", "at": (80, 0), "contact": 1.0},
        point=[{"name": "middle", "body": "bar", "at": (60, 0), "contact": 1.0}],
    )


LOAD = {"force": (3.0, -2.0, 25.0)}
QUICK = {"resolution": 4}


@pytest.fixture(scope="module")
def found():
    edges = f"55,{-WIDTH / 2},55,{WIDTH / 2}"
    sections = ["50,-5,50,5", (70.0, 5.0, 70.0, -5.0), edges]
    return flexfem.forces(bar(), **LOAD, section=sections, **QUICK)


def test_forces_through_a_hinge_are_those_of_statics_in_all_models(found):
    for model in ("analytic", "elastic bodies", "finite elements"):
        np.testing.assert_allclose(
            found.at("force", section="leaf", model=model), AT_LEAF, rtol=STATICS
        )


@pytest.mark.slow
def test_a_hinge_that_is_described_from_its_other_side_has_the_same_tension_and_another_shear():
    other = flexfem.forces(bar(True), **LOAD, **QUICK)
    # the end at the base: forces on it are opposite, and so are the axes of the hinge; the moment
    # is that on the base
    expected = [AT_LEAF[0], AT_LEAF[1], -AT_LEAF[2]]
    for model in ("analytic", "finite elements"):
        np.testing.assert_allclose(
            other.at("force", section="leaf", model=model), expected, rtol=STATICS
        )


def test_forces_through_a_section_are_those_of_statics(found):
    """The line upwards has the output at its right: what acts on the left is the load itself, along
    x and along y.
    """
    up = found.at("force", section="(50, -5) to (50, 5)", model="finite elements")
    np.testing.assert_allclose(up, AT_50, rtol=STATICS)
    # the line downwards at x = 70 has the base at its right, the normal to the right is -x and the
    # line -y: the loads
    # -3 N and 2 N of the base on the rest are 3 N along the normal and -2 N along the line; moment
    # about (70, 0)
    down = found.at("force", section="(70, 5) to (70, -5)", model="finite elements")
    np.testing.assert_allclose(down, [3.0, -2.0, -(25.0 - 2.0 * 10.0)], rtol=STATICS)
    assert np.isnan(found.at("force", section="(50, -5) to (50, 5)", model="analytic")).all()


def test_a_section_from_edge_to_edge_takes_all_of_the_material(found):
    """Without the nodes on the edges the moment was half of that of statics."""
    *_, edges = found.axes["section"]
    through = found.at("force", section=edges, model="finite elements")
    np.testing.assert_allclose(through, [3.0, -2.0, 25.0 - 2.0 * 25.0], rtol=STATICS)


@pytest.mark.slow
def test_a_pair_of_loads_loads_only_what_is_between_them():
    pair = {"force": (3.0, 0.0, 0.0), "force_at": {"middle": (-3.0, 0.0, 0.0)}}
    found = flexfem.forces(bar(), **pair, section=["50,-5,50,5", "70,-5,70,5"], **QUICK)
    forces = found.at("force", model="finite elements")
    np.testing.assert_allclose(forces[:2], 0.0, atol=ROUND_OFF)  # the leaf, and x = 50
    np.testing.assert_allclose(forces[2], [3.0, 0.0, 0.0], rtol=STATICS, atol=ROUND_OFF)


def test_the_strain_of_a_leaf_under_a_moment_is_that_of_bending():
    """By hand: 6 M / (E b t^2) = 6 * 400 / (70000 * 5 * 1) = 0.68571 % in a leaf 1 mm high."""
    found = flexfem.forces(bar(), force=(0.0, 0.0, 400.0), models="elements", **QUICK)
    leaf = {name: float(found.at(name, part="leaf", model="finite elements")) for name in PLACED}
    assert 0.68571 < leaf["strain"] < 1.3 * 0.68571  # a fillet of half the height raises it
    assert abs(leaf["strain_y"]) == pytest.approx(0.5, abs=0.15)
    assert 10.0 < leaf["strain_x"] < 30.0
    for part in ("leaf", "bar"):  # at free edges there is stress in one direction
        strain, stress = (
            float(found.at(name, part=part, model="finite elements"))
            for name in ("strain", "stress")
        )
        assert 1e-2 * strain * E == pytest.approx(stress, rel=FREE_EDGE)


@pytest.mark.slow
def test_plane_strain_lowers_the_strain_of_a_moment_by_the_square_of_poissons_ratio():
    """By hand: 1 - 0.29^2 = 0.9159 at a free edge, whatever the stress of plane strain is there."""
    strains = [
        float(
            flexfem.forces(one, force=(0.0, 0.0, 400.0), models="elements", **QUICK).strain[0, -1]
        )
        for one in (bar(), bar().replace(model="plane_strain"))
    ]
    assert strains[1] / strains[0] == pytest.approx(0.9159, rel=SAME_PLACE)


@pytest.mark.slow
def test_strain_in_three_dimensions_is_that_of_the_whole_plate():
    wide = bar().replace(model="three_dimensional", thickness=20.0)
    default, whole = (
        flexfem.forces(wide, force=(0.0, 0.0, 400.0), models="elements", solid=solid, **QUICK)
        for solid in (False, True)
    )
    value, expected = (
        float(one.at("strain", part="leaf", model="three dimensions")) for one in (default, whole)
    )
    band = float(default.band("strain", part="leaf", model="three dimensions"))
    assert abs(value - expected) < band < 0.15 * value


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("50,-5,50", "expected X1,Y1,X2,Y2"),
        ("50,-5,50,-5", "two different points"),
        ("50,-5,50,0", r"not \(50, 0\) in it"),
        ("50,20,70,20", "a line across a body"),
        ("50,-5,50,nan", "two different points"),
    ],
)
def test_sections_that_are_no_lines_across_a_body_are_refused(section, message):
    with pytest.raises(flexfem.BadInput, match=message):
        flexfem.forces(bar(), **LOAD, section=[section])
