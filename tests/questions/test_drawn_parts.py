"""Numbers of the drawn parts: a hinge is all material within its length, a body the rest of its
outline.

Literals are those of NGSolve with polynomials of order 6 on a mesh of its own
(`benchmarks/ngsolve_mechanisms.py`)."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.fem.mesh import jacobians
from flexfem.fem.plate_bodies import hinge_compliances
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import forces_on_ports, thermal_response
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.questions.plates import factorised
from flexfem.questions.setup import ELASTIC
from flexfem.results import ANALYTIC, ELEMENTS

METAL = {
    "name": "own",
    "youngs_modulus_gpa": 71.7,
    "density_kg_m3": 2810,
    "yield_strength_mpa": 503,
}
EXPANDING = {"expansion_um_per_m_k": 23.6}
NOTCH = {"direction_deg": 90, "shape": "circular", "radius_mm": 3.5}
GUIDE = {
    "name": "unsymmetric guide",
    "model": "plane_strain",
    "thickness_mm": 7,
    "material": {**METAL, "poissons_ratio": 0.29, **EXPANDING},
    "frame": {"expansion_um_per_m_k": 12.0},
    "body": [
        {"name": "base", "fixed": True, "path_mm": [[-30, -34], [32, -34]], "width_mm": 8},
        {"name": "left", "path_mm": [[-20, -7.5], [-20, -26.5]], "width_mm": 8},
        {"name": "right", "path_mm": [[22, -7.5], [22, -26.5]], "width_mm": 8},
        {"name": "stage", "path_mm": [[-26, 0], [28, 0]], "width_mm": 8},
    ],
    "hinge": [
        {
            "name": "left low",
            "between": ["base", "left"],
            "at_mm": [-20, -26.5],
            "neck_mm": 0.9,
            **NOTCH,
        },
        {
            "name": "left high",
            "between": ["left", "stage"],
            "at_mm": [-20, -7.5],
            "neck_mm": 1.0,
            **NOTCH,
        },
        {
            "name": "right low",
            "between": ["base", "right"],
            "at_mm": [22, -26.5],
            "neck_mm": 0.8,
            **NOTCH,
        },
        {
            "name": "right high",
            "between": ["right", "stage"],
            "at_mm": [22, -7.5],
            "neck_mm": 0.6,
            **NOTCH,
        },
    ],
    "actuator": [
        {
            "name": "push",
            "between": ["ground", "left"],
            "at_mm": [[-60, -18], [-20, -18]],
            "contact_mm": 2.0,
            "stroke_um": 15,
            "stiffness_n_per_um": 30,
        }
    ],
    "output": {"body": "stage", "at_mm": [10, 2]},
}
LEAF = {
    "between": ["ground", "stage"],
    "direction_deg": 90,
    "shape": "leaf",
    "length_mm": 20,
    "neck_mm": 0.5,
}
LEAVES = {
    "name": "two leaves",
    "model": "plane_strain",
    "thickness_mm": 10,
    "material": {**METAL, "poissons_ratio": 0.33, **EXPANDING},
    "frame": {"expansion_um_per_m_k": 1.0},
    "body": [
        {"name": "ground", "fixed": True, "path_mm": [[-25, -5], [25, -5]], "width_mm": 10},
        {"name": "stage", "path_mm": [[-25, 25], [25, 25]], "width_mm": 10},
    ],
    "hinge": [
        {"name": name, "at_mm": [x, 10], "fillet_mm": 0.5, **LEAF}
        for name, x in (("a", -15), ("b", 15))
    ],
    "output": {"body": "stage", "at_mm": [0, 25]},
}
CLOSED_FORM = 1e-9  # relative: round-off of the network
BY_TRIANGLES = 3e-6  # relative: both finite elements on their finest meshes
SUBDIVIDED = 3e-4  # relative: triangles across the end of a hinge are divided into 256 parts
SAMPLED = 1e-4  # of the square of the radius: the slope of the edge is taken at 400 positions


@pytest.fixture(scope="module")
def guide():
    return MechanismFile.model_validate(GUIDE)


def test_plane_strain_drift_of_unequal_plate_and_frame():
    """25 mm above the ground: `a + nu (a - a_frame)` = 23.6 + 0.33 * 22.6 um/(m K), of which 590 is
    the plate's own.
    """
    found = flexfem.drift(MechanismFile.model_validate(LEAVES))
    assert found.at("pose", case="uniform", model=ANALYTIC, direction="y")[0] == pytest.approx(
        776.45e-6, CLOSED_FORM
    )
    np.testing.assert_allclose(
        found.at("pose", case="uniform", model=ELASTIC)[0, 1], 776.45e-6, rtol=1e-3
    )
    pose = found.at("pose", model=ELEMENTS)[:, 0]
    band = found.band("pose", model=ELEMENTS)[:, 0]
    independent = {
        (0, 1): 7.79726633e-4,
        (1, 0): -1.00531066e-2,
        (1, 2): 7.79700145e-4,
        (2, 1): 9.98248261e-3,
    }
    for where, wanted in independent.items():
        assert pose[where] == pytest.approx(wanted, rel=BY_TRIANGLES)
        assert abs(pose[where] - wanted) < band[where]
    for case, held in zip(
        ("uniform", "gradient in y"), (1.62042, 16.2042), strict=True
    ):  # E (a - a_frame), by y = 10
        stress = found.at("stress", case=case, model=ANALYTIC)
        assert np.all((stress > held) & (stress < 1.05 * held))
        assert np.all(found.at("stress", case=case, model=ELEMENTS) > held)
    free = flexfem.drift(
        MechanismFile.model_validate({**LEAVES, "model": "plane_stress"}), models="analytic"
    )
    assert free.at("pose", case="uniform", direction="y")[0] == pytest.approx(590e-6, CLOSED_FORM)


def test_plane_strain_of_a_plate_and_frame_that_expand_alike_is_free():
    alike = {**LEAVES, "frame": EXPANDING}
    strain = flexfem.drift(MechanismFile.model_validate(alike), models="analytic")
    stress = flexfem.drift(
        MechanismFile.model_validate({**alike, "model": "plane_stress"}), models="analytic"
    )
    np.testing.assert_allclose(strain.pose, stress.pose, rtol=CLOSED_FORM)
    assert np.max(strain.stress) == 0.0


def test_drift_stiffness_and_amplification_of_stout_notches_at_ground_are_within_their_bands(guide):
    """Corners of the lower notches held as ground: stiffness along y 7 bands, amplification 2.6
    bands off.
    """
    stiff = flexfem.stiffness(guide, models="elements")
    wanted = {
        "free": [138.63221, 35049.0, 37049395.0],
        "amplification": [2.1673186, -7.3867709e-4, -5.6333738e-5],
    }
    for name, values in wanted.items():
        off = np.abs(np.squeeze(stiff.at(name, model=ELEMENTS)) - values)
        assert np.all(off < np.squeeze(stiff.band(name, model=ELEMENTS)))
    warm = flexfem.drift(guide, models="elements")
    pose = warm.at("pose", model=ELEMENTS)[:, 0]
    band = warm.band("pose", model=ELEMENTS)[:, 0]
    independent = {
        (0, 0): 1.1723081e-4,
        (0, 1): 4.5781396e-4,
        (1, 0): -7.8365323e-3,
        (1, 1): 4.5646004e-3,
        (1, 2): 4.5644279e-4,
        (2, 0): -2.3316452e-3,
        (2, 1): -6.9998719e-3,
        (2, 2): -1.1985931e-5,
    }
    for where, value in independent.items():
        assert abs(pose[where] - value) < band[where]
    lengths = band * [
        1.0,
        1.0,
        guide.layout.lever,
    ]  # the worst component, with rotations at the lever, bounds a case
    np.testing.assert_allclose(lengths, lengths[:, [1, 2, 0]], rtol=CLOSED_FORM)


def test_the_mean_over_a_body_leaves_out_the_corners_of_its_hinges(guide):
    """Legs are rectangles of 12 by 8 mm between the ends of their notches: means of `y^2` and `x^2`
    there.
    """
    layout = guide.layout
    output = guide.layout.points[0][1]
    middles = {1: -20.0, 2: 22.0}
    points = tuple(
        (f"leg {leg}", output._replace(body=leg, point=x - 17j)) for leg, x in middles.items()
    )
    layout = layout._replace(points=points, actuators=())
    mesh = mesh_layout(layout, 6)
    x, y = mesh.nodes.T
    for forces, middle in zip(
        forces_on_ports(layout, mesh).reshape(2, 3, -1, 2), middles.values(), strict=True
    ):
        field = np.stack([(y + 17) ** 2, (x - middle) ** 2], axis=-1)
        mean = np.sum(forces * field, axis=(1, 2))
        np.testing.assert_allclose(mean[:2], [12**2 / 12, 8**2 / 12], rtol=SUBDIVIDED)


def test_a_hinge_reaches_to_its_end_at_ground_and_to_60_degrees_at_a_body(guide):
    """Both corners at 80 and at 60 degrees, with the triangles below them at 45 degrees, in radii
    of the notch.
    """
    layout = guide.layout
    R = 3.5
    mesh = mesh_layout(layout, 6)
    drawn = R * (0.9 + 2 * R) - np.pi * R**2 / 2
    chosen = mesh.bodies == len(layout.bodies)
    areas = jacobians(mesh)[chosen, -1] / 2
    at_ground = mesh.nodes[mesh.triangles[chosen, :3], 1].mean(axis=1) < -26.5
    for part, degrees in ((at_ground, 80.0), (~at_ground, 60.0)):
        a = np.deg2rad(degrees)
        width = 1 - np.sin(a)
        corner = np.cos(a) * (1 - np.sin(a) / 2) - (np.pi / 2 - a) / 2
        expected = drawn - 2 * R**2 * (corner + width**2 / 2)
        assert areas[part].sum() == pytest.approx(expected, abs=SAMPLED * R**2)


def test_equal_notches_at_ground_and_between_bodies_have_their_own_compliances():
    same = [{**hinge, "neck_mm": 0.9} for hinge in GUIDE["hinge"]]
    layout = MechanismFile.model_validate({**GUIDE, "hinge": same}).layout
    low, high, other_low, other_high = hinge_compliances(layout, mesh_layout(layout, 4))
    np.testing.assert_array_equal([low, high], [other_low, other_high])
    more = (
        np.diag(low) / np.diag(high) - 1
    )  # the corners at the end of the notch are a part of the one at ground
    assert np.all((more > 1e-6) & (more < 0.05))


def test_free_ground_and_plate_bow_alike_through_the_thickness_in_a_gradient():
    """Plate and ground of one expansion `a` are free of stress in a gradient. In three dimensions
    both bow by `a z^2 / 2` besides, 48 nm on average, so that neither moves against the other.
    """
    a = 23.6e-6
    guide = MechanismFile.model_validate({**GUIDE, "model": "three_dimensional"})
    plane, solid = (
        thermal_response(factorised(guide, 2, layers), a, a).motions[:3] for layers in (0, 1)
    )
    assert plane[0, 0] == pytest.approx(a * 1.0, rel=1e-5)  # of the middle of the stage, 1 mm off
    np.testing.assert_allclose(solid, plane, atol=1e-10)
