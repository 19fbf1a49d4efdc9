"""The stress at one neck: by hand, by plane-stress finite elements of one hinge, and out of the
forces of a chain.
"""

from __future__ import annotations

import numpy as np
import pytest
from hinge_charts import SingleHinge, hinge_mesh

from flexfem.fem.elements import Plate, nodal_stress
from flexfem.fem.mesh import nodes_on
from flexfem.hinges.strength import Wrench, neck_stress, raised_in_plane
from flexfem.mechanism.stress_concentration import Concentration, concentration
from flexfem.paper.frames import Frames
from flexfem.paper.model import at_necks

from ..validation.fields import Support, edge_force, nearest_node, solve

# of a notch of circular arcs between blocks, which is no hyperbola; seen: 0.24 % in tension at 0.3
NEUBER = 0.005


def raised(radius: np.ndarray, neck: np.ndarray, pull: float = 0.0) -> Concentration:
    """Concentrations (3, 3) of one design in a plane with the stress `pull` of that along the neck
    across it.
    """
    return raised_in_plane(neck / radius, np.array(pull))


def single(moment: float, normal: float) -> Wrench:
    """One neck of nine loaded, by a platform displacement in y alone."""
    wrench = Wrench(*np.zeros((3, 3, 3, 3)))
    wrench.moment[1, 2, 1] = moment
    wrench.normal[1, 2, 1] = normal
    return wrench


def surface_stress(ratio: float) -> tuple[float, float]:
    """Stress at the root of a notch with R = E = b = 1 under a unit moment and a unit pull, by
    finite elements.
    """
    hinge = SingleHinge(ratio)
    plate = Plate(1.0, 0.29, 1.0)
    mesh = hinge_mesh(hinge, 4)
    high = 2 + ratio
    neck = nodes_on(mesh, "left")
    axis = nodes_on(mesh, "bottom")
    root = nearest_node(mesh, 0.0, ratio / 2)
    loads = (
        (
            lambda at, _: 12 / high**3 * at[..., ::-1] * [1.0, 0.0],
            [Support(axis, 0), Support(neck[:1], 1)],
        ),
        (lambda at, _: np.broadcast_to([1 / high, 0.0], at.shape), [Support(axis, 1)]),
    )
    found = []
    for traction, held in loads:
        force = edge_force(mesh, plate, mesh.edges["right"], traction)
        field = solve(mesh, plate, force, [Support(neck, 0), *held]).field
        found.append(abs(float(nodal_stress(mesh, plate, field)[root, 0, 0])))
    return found[0], found[1]


@pytest.mark.parametrize("ratio", [0.15, 0.3])
def test_bending_and_tension_of_one_neck_are_those_of_finite_elements(ratio: float) -> None:
    radius = 2.5
    b = 7.0
    bent, pulled = surface_stress(ratio)
    neck = np.full((3, 3), ratio * radius)
    radii = np.full((3, 3), radius)
    thickness = np.array(b)
    for wrench, expected in (
        (single(-3.0, 0.0), 3.0 * bent / (b * radius**2)),
        (single(0.0, 5.0), 5.0 * pulled / (b * radius)),
        (single(3.0, -5.0), 3.0 * bent / (b * radius**2) + 5.0 * pulled / (b * radius)),
    ):
        found = neck_stress(wrench, neck, thickness, raised(radii, neck)).max(axis=(0, 1))
        assert found[1] == pytest.approx(expected, rel=NEUBER)
        assert found[0] == found[2] == 0.0
    assert (
        bent * ratio**2 / 6 < 0.985 * pulled * ratio
    )  # tension concentrates more than bending: they are told apart


def test_the_hyperbolic_notch_in_numbers() -> None:
    """H. Neuber's two formulas, and that of shear, at t/2R = 1/4, worked out by hand: atan(1/2) =
    0.4636476.
    """
    found = concentration(np.array(0.5))
    assert found.bending == pytest.approx(0.5 / (3 * (0.5 - 0.75 * 0.4636476)), rel=1e-6)
    assert found.tension == pytest.approx(1.25 / (1.25 * 0.4636476 + 0.5), rel=1e-6)
    assert found.shear == pytest.approx(0.3125 / (3 * (1.25 * 0.4636476 - 0.5)), rel=1e-5)


def test_one_neck_by_hand_and_the_highest_of_all_counts() -> None:
    """6 M K_b / (b t^2) + N K_t / (b t) with t/R = 1/2: K_b = 1.09449, K_t = 1.15791."""
    neck = np.full((3, 3), 0.5)
    radius = np.full((3, 3), 1.0)
    neck[0, 0] = 1.0
    radius[0, 0] = 2.0  # twice as thick, another half as much moment: far less
    wrench = single(2.0, 3.0)
    wrench.moment[0, 0, 1] = -3.0
    found = neck_stress(wrench, neck, np.array(8.0), raised(radius, neck))[..., 1].max()
    assert found == pytest.approx(6 * 2 * 1.09449 / (8 * 0.25) + 3 * 1.15791 / (8 * 0.5), rel=1e-4)
    held = neck_stress(wrench, neck, np.array(8.0), raised(radius, neck, 0.3))[..., 1].max()
    assert held == pytest.approx(found * np.sqrt(0.79), rel=1e-12)  # zz = 0.3 xx: 1 - 0.3 + 0.09


def test_a_force_on_the_platform_bends_a_neck_by_its_arm_and_pulls_along_the_axis() -> None:
    """Unit force in x and y and unit moment at the centre, as columns; neck at (7, -4) with its
    axis at 30 degrees.
    """
    centres = np.zeros((3, 3, 2))
    centres[2, 1] = 7.0, -4.0
    axes = np.zeros((3, 3))
    axes[2, 1] = np.radians(30.0)
    found = at_necks(Frames(centres, axes), np.broadcast_to(np.eye(3), (3, 1, 3, 3)))
    np.testing.assert_allclose(found.moment[2, 1], [-4.0, -7.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(found.normal[2, 1], [0.8660254, 0.5, 0.0], atol=1e-7)
