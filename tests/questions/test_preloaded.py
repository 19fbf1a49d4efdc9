"""What forces of the stacks add to the stiffness of the platform: elastic joints against nonlinear
finite elements.

Motions of bodies are read with the weights of `fields.push_forces`; from them follows the opening g
of a stack. Constant forces N have the potential `-N g`; what it adds to the sparse tangent is of
low rank. As a link turns by theta, weights f read `-v theta^2/2`, v = sum f r, as if the link had
moved; it is taken out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag

import flexfem
from flexfem.fem.factor import Factoriser
from flexfem.fem.nonlinear import LargeStructure
from flexfem.fem.structure import structure
from flexfem.paper.commanding import commanding, driven_elements
from flexfem.paper.contacts import FOLLOWS
from flexfem.paper.drives import drive_of
from flexfem.paper.equilibrium import loaded, serial
from flexfem.paper.fields import push_forces
from flexfem.paper.frames import chain_rotation
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice
from flexfem.paper.stage import load_stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.questions.driven import DriveSystem

from ..tolerances import DENSE

NONE = np.zeros(3)
UNLIKE = [
    (
        "[provenance]",
        '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.7\n'
        '[[override]]\nchain = 3\nhinge = "base"\nneck_mm = 0.4\nradius_mm = 3.0\n'
        '[[override]]\nchain = 1\nhinge = "platform"\nneck_mm = 0.6\n'
        '[[actuator]]\nname = "single"\nbetween = ["link 1", "link 2"]\nhinge = "platform"\narm_mm = 12.0\n'
        'side = "right"\nstack = "AE0203D16"\npreload_n = 1.5\ntilt_deg = 12.0\n\n[provenance]',
    )
]


ITERATIONS = 25
CONVERGED = 1e-9  # root of energy of a Newton step, over that stored and that of the forces alone


def preloaded(of, stacks, force, follows):
    """Tangent compliance (3 + n, 3 + n) of pose and openings under forces (n,) of the stacks, N."""
    model = LargeStructure(of)
    ends = [[read_at(of, stack.chain, push) for push in stack.pushes] for stack in stacks]
    reads = np.concatenate([reads for pair in ends for _, reads, _ in pair]).T
    hub = np.eye(of.size, 3, 3 - of.size)
    motion = np.zeros(of.size)
    for _ in range(ITERATIONS):
        field = np.zeros_like(of.mesh.nodes)
        field[of.free] = motion[:-3].reshape(-1, 2)
        state = model.at(motion[-3:], field)
        g, H = openings(stacks, ends, reads.T @ motion, follows)
        held = model.internal(state)
        missing = reads @ (g @ force) - held.forces
        Z = Factoriser()(model.tangent(state))(np.column_stack([missing, hub, reads]))
        Q = -block_diag(*(N * each for N, each in zip(force, H, strict=True)))
        Z = Z - Z[:, 4:] @ np.linalg.solve(
            np.eye(len(Q)) + Q @ (reads.T @ Z[:, 4:]), Q @ (reads.T @ Z)
        )
        C = np.column_stack([hub, reads @ g]).T @ Z[:, 1:] @ block_diag(np.eye(3), g)
        if abs(Z[:, 0] @ missing) <= CONVERGED**2 * (
            held.energy + force**2 @ np.abs(np.diag(C)[3:])
        ):
            return (C + C.T) / 2
        motion = motion + Z[:, 0]
    raise AssertionError("no equilibrium")


def read_at(of, chain, push):
    """How the motion of a body at a push is read: place, complex, frame of chain 1, loads (3,
    unknowns), and v (3,).
    """
    if push.station is None:
        reads = np.zeros((3, of.size))
        if push.body:
            reads[:, -3:] = chain_rotation(chain).T
        return 0j, reads, np.zeros(3)
    starts = push.station.starts
    at = min(
        int(np.searchsorted(starts, push.station.middle, side="right")) - 1,
        len(push.station.path) - 1,
    )
    segment = push.station.path[at]
    c = complex(segment.at((push.station.middle - starts[at]) / segment.length))
    units = np.array([[1.0, 0.0, -c.imag], [0.0, 1.0, c.real], [0.0, 0.0, 1.0]])
    nodal = np.array([push_forces(of.mesh, chain, push._replace(wrench=unit)) for unit in units])
    middle = chain_rotation(chain)[:2, :2] @ (c.real, c.imag)
    return c, of.loads(nodal).T, np.einsum("knd,nd->k", nodal, of.mesh.nodes - middle)


def openings(stacks, ends, read, follows):
    """First (6n, n) and second derivatives (6, 6) of the openings by what is read (6n,), pushed
    body and carrier.
    """
    first = np.zeros((len(read), len(stacks)))
    second = []
    for j, (stack, (pushed, carrier)) in enumerate(zip(stacks, ends, strict=True)):
        order = (
            [3, 4, 5, 0, 1, 2] if follows == "pushed" else [0, 1, 2, 3, 4, 5]
        )  # the body with the pivot comes first
        on, along = (carrier, pushed) if follows == "pushed" else (pushed, carrier)
        mine = read[6 * j : 6 * j + 6][order]
        v = np.array([on[2], along[2]])
        turn = mine[[2, 5]]
        rates = np.eye(6)
        rates[:3, 2] += v[0] * turn[0]
        rates[3:, 5] += v[1] * turn[1]
        motion = mine + np.concatenate((v.T * turn**2 / 2).T)
        direction = stack.direction if follows == "pushed" else -stack.direction
        g, H = behind(on[0], along[0], motion, direction, stack.pivot(follows), stack.point)
        H = rates.T @ H @ rates
        H[2, 2] += g[:3] @ v[0]
        H[5, 5] += g[3:] @ v[1]
        first[6 * j + np.array(order), j] = rates.T @ g
        second.append(H[np.ix_(order, order)])
    return first, second


def behind(on, along, motion, direction, pivot, contact):
    """Derivatives (6,) and (6, 6) of how far the pivot, on one body, is behind a face of the other.

    `g = -m (x_on(pivot) - x_along(contact))`, m being the direction, turned with the other body.
    """

    def dot(a, b):
        return float((np.conj(a) * b).real)

    x = complex(*motion[:2])
    turn = motion[2]
    y = complex(*motion[3:5])
    spin = motion[5]
    r = np.exp(1j * turn) * (pivot - on)
    s = np.exp(1j * spin) * (contact - along)
    m = np.exp(1j * spin) * direction
    apart = on + x + r - along - y - s
    first = np.array([-m.real, -m.imag, dot(m, -1j * r), m.real, m.imag, dot(m, 1j * (apart + s))])
    H = np.zeros((6, 6))
    H[2, 2], H[2, 5], H[5, 5] = dot(m, r), -dot(m, r), dot(m, apart + s)
    H[0, 5] = m.imag
    H[1, 5] = -m.real
    H[3, 5] = -m.imag
    H[4, 5] = m.real
    return first, H + np.triu(H, 1).T


def changes(stage, forces, follows, resolution):
    """Relative changes (forces, disengaged and engaged, 3) of stiffness, by finite elements and by
    elastic joints.
    """
    drive = drive_of(stage)
    model = commanding(ModelChoice(stage, None, CALIBRATED, True))
    metal = driven_elements(stage, resolution)
    joints = serial(stage, model.result, drive.stacks, follows)
    found = np.zeros((2, len(forces), 2, 3))
    for i, force in enumerate(forces):
        C = preloaded(structure(metal.mesh, plate_of(stage)), drive.stacks, force, follows)
        of = loaded(joints, force, NONE)
        for j, stiff in enumerate((0 * drive.stiffness, drive.stiffness)):
            engaged = drive._replace(stiffness=stiff)
            K, K_rest = (
                np.diag(np.linalg.inv(DriveSystem.of(each, engaged).engaged))
                for each in (C, metal.system.C)
            )
            found[0, i, j] = K / K_rest - 1
            rest = np.diag(np.linalg.inv(DriveSystem.of(model.system.C, engaged).engaged))
            found[1, i, j] = np.diag(of.stiffness(stiff)) / rest - 1
    return found


@pytest.mark.parametrize("follows", [FOLLOWS[0], pytest.param(FOLLOWS[1], marks=pytest.mark.slow)])
def test_preloads_of_pairs_by_nonlinear_finite_elements(stage, follows):
    """Of forces that stay, +7 to -6 per cent; of stacks that hold their strokes, below 0.06 per
    cent.
    """
    elements, joints = changes(stage, [drive_of(stage).preload], follows, 3)
    np.testing.assert_allclose(joints[0, 0], elements[0, 0], rtol=5e-3)
    np.testing.assert_allclose(joints[0, 1], elements[0, 1], atol=5e-6)
    assert np.min(np.abs(elements[0, 0])) > 0.03
    assert np.all(np.sign(elements) == (1 if follows == "pushed" else -1))


@pytest.mark.slow
@pytest.mark.parametrize("follows", FOLLOWS)
def test_unlike_chains_and_unequal_forces_by_nonlinear_finite_elements(project, follows):
    """The necks are loaded and the stage has moved by 40 um: what hinges of finite length do is not
    in the joints.
    """
    stage = load_stage(project.edit("geometry/mobility6.toml", *UNLIKE))
    preload = drive_of(stage).preload
    forces = [preload, preload + np.random.default_rng(3).uniform(-2, 2, len(preload))]
    elements, joints = changes(stage, forces, follows, 4)
    np.testing.assert_allclose(joints[:, 0], elements[:, 0], rtol=3e-3)
    np.testing.assert_allclose(joints[:, 1], elements[:, 1], atol=2e-4)


def test_the_stiffness_by_the_forces_of_a_command_is_that_under_its_load(stage):
    """A load of 40 N, which the stacks mostly take: with it, not only with the forces that it gives
    the stacks.
    """
    load = np.array([40.0, -25.0, 300.0])
    model = commanding(ModelChoice(stage, 6, DEFAULT_FORMULA, False))
    drive = drive_of(stage)
    joints = serial(stage, model.result, drive.stacks, "pushed")
    own = flexfem.Analytic(mobility=6)
    found = flexfem.drive(
        stage, pose=(2e-3, 1e-3, 5e-5), load=tuple(load), models="analytic", analytic=own
    )
    force = found.at("force", criterion="least energy")
    with_load, without = (
        np.diag(loaded(joints, force, each).stiffness(drive.stiffness)) for each in (load, NONE)
    )
    state = "stack forces, least energy"
    np.testing.assert_allclose(found.at("stiffness", state=state), with_load, rtol=DENSE)
    assert np.max(np.abs(with_load / without - 1)) > 1e-6
