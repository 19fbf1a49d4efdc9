"""Links as bars: closed forms for straight and circular ones, and the whole stage against finite
elements.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag

from flexfem.analytic.network import stiffness
from flexfem.arrays import inverse
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import Segment
from flexfem.paper.designs import stage_frames
from flexfem.paper.equations import freedoms_of
from flexfem.paper.links import bar_density, body_compliance
from flexfem.paper.model import analyse, hinge_compliance, network_of
from flexfem.paper.solutions import solved as solve_stage
from flexfem.paper.stage import Stage

ROOT = Path(__file__).parents[2]
QUADRATURE = 1e-10  # twelve Gauss points on smooth integrands
# calibrated hinges, bars and platform against finite elements on these stages: 1.1e-4 was seen
LINKED = 3e-4
SLIGHT = 1e-5  # of an arc of 1e4 mm: (37/1e4)^2, and (1e4/9)^3 times round-off in what cancels
RANDOM = 2e-3  # on stages of any size: 1.4e-3 was seen, from a sharp bend beside a deep notch
MESH = 2.5e-4  # of the compliance at resolution 6


def stage(name: str = "mobility6", **changes: object) -> Stage:
    data = tomllib.loads((ROOT / f"geometry/{name}.toml").read_text())
    for path, value in changes.items():
        table, key = path.split("__")
        (data[table] if table != "top" else data)[key] = value
    return Stage.model_validate(data)


def section(of: Stage) -> tuple[float, float, float]:
    E = of.material.youngs_modulus
    nu = of.material.poissons_ratio
    w = of.chain.link_width
    A = of.thickness * w
    return E * A * w**2 / 12, E * A, E / (2 * (1 + nu)) * A


def bar(of: Stage, segment: Segment) -> np.ndarray:
    return bar_density(of, of.elastic, segment)[0].sum(axis=0)


def test_a_straight_cantilever_that_ends_at_the_platform_is_timoshenkos():
    of = stage(material__poissons_ratio=0.29)
    length = 37.0
    EI, EA, GA = section(of)
    C = bar(of, Segment(-length + 0j, 0j))
    expected = [
        [length / EA, 0, 0],
        [0, length**3 / (3 * EI) + 1.2 * length / GA, length**2 / (2 * EI)],
        [0, length**2 / (2 * EI), length / EI],
    ]
    np.testing.assert_allclose(C, expected, rtol=QUADRATURE, atol=1e-18)


def test_a_sharp_bend_turns_under_a_moment_as_golovins_ring():
    """Timoshenko and Goodier, art. 29: 8 M (b^2 - a^2) / (E N) per rad."""
    of = stage()
    R = 5.6
    E = of.material.youngs_modulus * of.thickness
    a = R - of.chain.link_width / 2
    b = R + of.chain.link_width / 2
    N = (b**2 - a**2) ** 2 - (2 * a * b * np.log(b / a)) ** 2
    C = bar(of, Segment(R + 0j, R * np.exp(1j), 0j))
    assert C[2, 2] == pytest.approx(8 * (b**2 - a**2) / (E * N), rel=QUADRATURE)


def test_where_a_bend_is_slight_it_is_a_straight_beam_whichever_way_it_bends():
    of = stage(material__poissons_ratio=0.29)
    length = 37.0
    straight = bar(of, Segment(-length + 0j, 0j))
    for R in (1e4, -1e4):
        bent = bar(of, Segment(1j * R * (1 - np.exp(-1j * length / R)), 0j, 1j * R))
        np.testing.assert_allclose(bent[1:, 1:], straight[1:, 1:], rtol=SLIGHT)


@pytest.mark.parametrize("name", ["mobility3", "mobility6"])
def test_calibrated_hinges_and_elastic_links_are_nearly_the_finite_elements(name):
    of = stage(name)
    check_feasible(of)
    elements = np.diag(solve_stage(of, 6).compliance)
    np.testing.assert_allclose(
        np.diag(analyse(of, 21, "calibrated", links=True).compliance), elements, rtol=LINKED + MESH
    )


def test_lugs_around_a_small_hub_give_way_to_each_other():
    """Three twisting lugs turn what is around the hub, which each alone would do less of."""
    notches = {"base": (3.3, 1.7), "elbow": (3.5, 2.2), "platform": (3.9, 2.1)}
    of = stage(
        top__hinges={
            name: {"radius_mm": radius, "neck_mm": neck} for name, (radius, neck) in notches.items()
        },
        top__provenance={},
        chain__link_width_mm=10.3,
        chain__link_lengths_mm=[41.0, 38.0, 32.0],
        platform__radius_mm=16.0,
        platform__hub_radius_mm=4.3,
    )
    check_feasible(of)
    elements = np.diag(solve_stage(of, 6).compliance)
    uncoupled = block_diag(
        *(body_compliance(of)[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(3))
    )
    network = network_of(
        stage_frames(of), hinge_compliance(of, "calibrated"), freedoms_of(21), uncoupled
    )
    alone = np.diag(inverse(stiffness(network).matrix))
    np.testing.assert_allclose(
        np.diag(analyse(of, 21, "calibrated", links=True).compliance), elements, rtol=RANDOM
    )
    assert 1 - alone[2] / elements[2] > 2 * RANDOM
