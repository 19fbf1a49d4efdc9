"""Links as beams: closed forms for straight and circular ones, and the whole stage against finite elements."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from flexfem.analytic.links import _strip, body_compliance, linked_compliance
from flexfem.analytic.model import analyse
from flexfem.design import Stage
from flexfem.layout.feasibility import check_feasible
from flexfem.layout.frames import CHAIN_TURN
from flexfem.layout.outline import Segment
from flexfem.verify.protocol import solve_stage

ROOT = Path(__file__).parents[2]
QUADRATURE = 1e-10  # twelve Gauss points on smooth integrands
LINKED = 2e-3  # calibrated hinges and beams against finite elements on these stages: 1.0e-3 and 1.5e-3 were seen
MESH = 2.5e-4  # of the compliance at resolution 6


def stage(name: str = "mobility6", **changes: object) -> Stage:
    data = tomllib.loads((ROOT / f"geometry/{name}.toml").read_text())
    for path, value in changes.items():
        table, key = path.split("__")
        (data[table] if table != "top" else data)[key] = value
    return Stage.model_validate(data)


def section(of: Stage) -> tuple[float, float, float]:
    E, nu, w = of.material.youngs_modulus, of.material.poissons_ratio, of.chain.link_width
    A = of.thickness * w
    return E * A * w**2 / 12, E * A, E / (2 * (1 + nu)) * A


def test_a_straight_cantilever_that_ends_at_the_platform_is_timoshenkos():
    of, length = stage(material__poissons_ratio=0.29), 37.0
    EI, EA, GA = section(of)
    C = _strip(of, Segment(-length + 0j, 0j))
    expected = [
        [length / EA, 0, 0],
        [0, length**3 / (3 * EI) + 1.2 * length / GA, length**2 / (2 * EI)],
        [0, length**2 / (2 * EI), length / EI],
    ]
    np.testing.assert_allclose(C, expected, rtol=QUADRATURE, atol=1e-18)


def test_a_thin_ring_segment_bends_like_a_curved_bar():
    of, R = stage(chain__link_width_mm=0.1), 50.0
    EI, _, _ = section(of)
    quarter = [Segment(R * np.exp(1j * a), R * np.exp(1j * b), 0j) for a, b in ((0.2, 1.0), (1.0, 0.2 + np.pi / 2))]
    C = sum(_strip(of, arc) for arc in quarter)
    assert C[2, 2] == pytest.approx(R * np.pi / 2 / EI, rel=1e-5)  # Winkler's bar is Euler's when w / R vanishes
    assert C[0, 0] + C[1, 1] == pytest.approx(R**3 * np.pi / 2 / EI, rel=1e-4)


def test_a_thick_bend_is_a_closed_form_of_winkler():
    of, R = stage(), 5.6
    w, E, b = of.chain.link_width, of.material.youngs_modulus, of.thickness
    e = R - w / np.log((R + w / 2) / (R - w / 2))
    C = _strip(of, Segment(R + 0j, R * np.exp(1j), 0j))
    assert C[2, 2] == pytest.approx(1.0 / (E * b * w * e), rel=QUADRATURE)  # one rad of M / (A e E)


def test_walking_a_strip_the_other_way_changes_nothing():
    of = stage()
    arc = Segment(6j + 12 * np.exp(0.3j), 6j + 12 * np.exp(1.1j), 6j)
    np.testing.assert_allclose(_strip(of, arc), _strip(of, arc.reversed()), rtol=QUADRATURE)


def test_chains_add_the_same_compliance_turned():
    first, second, _ = body_compliance(stage())
    c, s = np.cos(CHAIN_TURN), np.sin(CHAIN_TURN)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(R @ first @ R.T, second, rtol=1e-9, atol=1e-15)


def test_links_only_ever_soften_the_stage():
    for name in ("mobility3", "mobility6"):
        of = stage(name)
        more = linked_compliance(of, "calibrated") - analyse(of, 21, "calibrated").compliance
        assert np.linalg.eigvalsh(more).min() > 0
    assert np.linalg.eigvalsh(body_compliance(stage())[0]).min() > 0


def test_stiffer_material_leaves_the_share_of_the_links():
    soft, hard = (stage(material__youngs_modulus_gpa=E) for E in (70.0, 210.0))
    np.testing.assert_allclose(
        linked_compliance(soft, "calibrated"), 3 * linked_compliance(hard, "calibrated"), rtol=1e-12, atol=1e-16
    )


@pytest.mark.parametrize("name", ["mobility3", "mobility6"])
def test_calibrated_hinges_and_beams_are_nearly_the_finite_elements(name):
    of = stage(name)
    check_feasible(of)
    elements = np.diag(solve_stage(of, 6).response.compliance)
    np.testing.assert_allclose(np.diag(linked_compliance(of, "calibrated")), elements, rtol=LINKED + MESH)
