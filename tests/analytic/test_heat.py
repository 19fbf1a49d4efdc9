"""Chains that grow: their loops against displacements of warm bodies, and what closes them against
the least energy.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.hinges.chart import Compliance
from flexfem.paper.designs import design_arrays
from flexfem.paper.equations import freedoms_of
from flexfem.paper.links import _pad_motion
from flexfem.paper.model import hinge_compliance
from flexfem.paper.responses import drift, misfits

from ..tolerances import DENSE

NECKS = {
    (1, "base"): {"neck": 0.61},
    (2, "elbow"): {"neck": 0.72},
    (3, "platform"): {"radius": 1.9},
}
METAL = np.array([23.6e-6])
FRAME = np.array([9.3e-6])


@pytest.fixture(scope="module")
def unlike():
    return flexfem.load(Path(__file__).parents[2] / "geometry" / "mobility6.toml").replace(
        override=NECKS
    )


def test_loops_open_by_the_displacement_of_the_ground_in_a_warm_body(unlike):
    """Whatever lies between: `(af - as)` times z, z^2/2 and -i z^2/2 of x + iy, and the turn,
    carried to the centre.
    """
    design = design_arrays(unlike)
    found = misfits(design, METAL, FRAME)[0] / (FRAME - METAL)
    for chain in range(3):
        hinge = complex(*design.frames.centres[0, chain, 0])
        behind = design.radius[0, chain, 0] + unlike.chain.link_width
        z = hinge - behind * np.exp(1j * design.frames.axes[0, chain, 0])
        fields = (z, z**2 / 2, -1j * z**2 / 2)
        turns = (0.0, z.imag, -z.real)
        for case, (u, turn) in enumerate(zip(fields, turns, strict=True)):
            carried = u - 1j * turn * z
            wanted = [carried.real, carried.imag, turn]
            assert found[chain, :, case] == pytest.approx(wanted, rel=DENSE, abs=1e-10)


def test_joints_close_warm_loops_with_the_least_energy(unlike):
    """27 springs, six closures: the stationary point of energy under constraints, with Jacobians of
    its own.
    """
    design = design_arrays(unlike)
    hinges = hinge_compliance(unlike, "calibrated")
    found = drift(
        design, Compliance(*(part[None] for part in hinges)), freedoms_of(21), METAL, FRAME
    )
    gaps = misfits(design, METAL, FRAME)[0]
    centres, axes = design.frames
    G = np.zeros((3, 3, 9))
    for chain, hinge in np.ndindex(3, 3):
        x, y = centres[0, chain, hinge]
        angle = axes[0, chain, hinge]
        G[chain, :, 3 * hinge] = y, -x, 1.0
        G[chain, :2, 3 * hinge + 1] = np.cos(angle), np.sin(angle)
        G[chain, :2, 3 * hinge + 2] = -np.sin(angle), np.cos(angle)
    springs = np.stack(
        [1 / np.stack([hinges.rotation, hinges.axial, hinges.shear], axis=-1)]
    ).ravel()
    rows = np.zeros((9, 30))  # G_i q_i - U = -t_i
    for chain in range(3):
        rows[3 * chain : 3 * chain + 3, 9 * chain : 9 * chain + 9] = G[chain]
        rows[3 * chain : 3 * chain + 3, 27:] = -np.eye(3)
    whole = np.block([[np.diag(np.append(springs, np.zeros(3))), rows.T], [rows, np.zeros((9, 9))]])
    wanted = np.linalg.solve(whole, np.concatenate([np.zeros((30, 3)), -gaps.reshape(9, 3)]))
    assert found.pose[0] == pytest.approx(wanted[27:30], rel=1e-6, abs=1e-12)
    assert np.abs(wanted[27:30]).min() > 1e-6, "no component is zero by chance"
    assert found.reaction[0].reshape(9, 3) == pytest.approx(wanted[30:], rel=1e-4, abs=1e-6)
    assert np.abs(found.reaction[0].sum(axis=0)).max() < 1e-9


def test_an_edge_that_bows_takes_its_pad_along_by_the_mean_of_the_traction_on_it(unlike):
    """Of a strip with nu = 0, eta^2/2 has the mean w^2/24 under an even traction, and a strain
    moves nothing.

    With nu = 0.29 finite elements of such a strip, 1.5 widths long, give -0.0394 w, 0.0455 w^2,
    0.0319 w^2 and a turn of 0.01753 w; the notch of the pad is a width away and changes the first
    by 0.005 w, the others by 1 %."""
    even, found = (_pad_motion(unlike.hinge(1, "base"), 9.0, nu) for nu in (1e-9, 0.29))
    assert even[0] == pytest.approx([-0.0050 * 9, 81 / 24, 0.0], rel=0.04, abs=1e-9)
    assert found[0] == pytest.approx([-0.0444 * 9, 0.0455 * 81, 0.0], rel=0.015, abs=1e-9)
    assert found[1:, 2] == pytest.approx([0.0319 * 81, 0.01753 * 9], rel=0.015)
    assert found[1:, :2] == pytest.approx(np.zeros((2, 2)), abs=1e-6), "alike on both sides"


def test_drift_is_linear_in_both_coefficients_and_zero_where_they_are_the_same(unlike):
    design = design_arrays(unlike)
    hinges = Compliance(*(p[None] for p in hinge_compliance(unlike, "calibrated")))

    def found(metal, frame):
        return drift(design, hinges, freedoms_of(6), np.array([metal]), np.array([frame]))

    one = found(1e-5, 0.0)
    other = found(0.0, 1e-5)
    both = found(3e-5, 1e-5)
    assert both.pose == pytest.approx(3 * one.pose + other.pose, rel=DENSE)
    assert one.pose == pytest.approx(-other.pose, rel=DENSE)
    same = found(2e-5, 2e-5)
    assert np.all(same.pose == 0) and np.all(same.stress == 0), (
        "not round-off, which a table would print"
    )
