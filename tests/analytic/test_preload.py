"""Internal forces in (16): against closed kinematics and energy, by hand, and against the loads of
the platform.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.hinges.chart import Compliance
from flexfem.paper.commanding import commanding
from flexfem.paper.contacts import FOLLOWS, placed_stack
from flexfem.paper.designs import stage_frames
from flexfem.paper.drives import drive_of
from flexfem.paper.equations import joints_of, stiffness
from flexfem.paper.equilibrium import loaded, serial, under_load
from flexfem.paper.model import ModelChoice, analyse, assemble
from flexfem.paper.stage import load_stage
from flexfem.refused import ComputationFailed

from ..tolerances import DENSE

GEOMETRY = Path(__file__).parents[2] / "geometry"
BODIES = ("frame", "link 1", "link 2", "platform")
PLACES = [  # chain, carrier, pushed body, contact, direction, ball and force
    (0, 0, 1, 43.0 - 36.5j, 1.4, 2.0, 31.0),
    (0, 0, 1, 43.0 - 27.5j, -1.74, 1.5, 44.0),
    (1, 2, 1, 33.0 - 27.5j, -1.7, 2.5, 27.0),
    (1, 1, 2, 15.0 - 20.0j, 0.4, 0.0, 12.0),
    (2, 0, 2, 22.0 - 8.0j, 2.9, 1.0, 19.0),
    (2, 3, 2, 28.0 - 16.0j, 1.1, 3.0, 23.0),
    (1, 0, 3, -3.0 + 17.0j, -1.2, 2.0, 16.0),
    (0, 2, 3, 6.0 - 16.0j, 1.1, 0.5, 9.0),
]
SPRINGS = np.array([4.1e3, 2.6e3, 0.0, 5.5e3, 1.3e3, 7.2e3, 3.3e3, 0.4e3])
LOAD = np.array([1.3, -0.7, 21.0])


@pytest.fixture(scope="module")
def stage():
    return load_stage(GEOMETRY / "mobility6.toml")


def unlike(stage):
    """The model of mobility six with hinges that all differ."""
    of = analyse(stage, 6)
    random = np.random.default_rng(7)
    rotation, axial = (
        each * random.uniform(0.6, 1.7, (3, 3)) for each in (of.hinges.rotation, of.hinges.axial)
    )
    return of._replace(hinges=Compliance(rotation, 40 * axial, of.hinges.shear))


def stacks_of(stage):
    return tuple(
        placed_stack(stage, chain, (BODIES[carrier], BODIES[pushed]), at, direction, ball)
        for chain, carrier, pushed, at, direction, ball, _ in PLACES
    )


def chain_energy(stage, hinges, chain, pose, slide, follows):
    """Energy of the springs of a chain, and the openings of its stacks: elbow by two circles, no
    joint Jacobians.
    """
    frames = stage_frames(stage)
    base, elbow, end = (complex(*point) for point in frames.centres[chain])
    spin = np.exp(2j * np.pi / 3 * chain)
    along = np.exp(1j * frames.axes[chain, 0])
    moved = complex(*pose[:2]) + end * np.exp(1j * pose[2])
    first = elbow - base + slide * along
    second = abs(end - elbow)
    reach = abs(moved - base)
    corner = np.arccos((abs(first) ** 2 + reach**2 - second**2) / (2 * abs(first) * reach))
    side = np.sign(((elbow - base) * np.conj(end - base)).imag)
    at = base + abs(first) * (moved - base) / reach * np.exp(1j * side * corner)
    one = np.angle((at - base) / first)
    two = np.angle((moved - at) / (end - elbow))
    turns = np.array([one, two - one, pose[2] - two])
    energy = np.sum(turns**2 / hinges.rotation[chain]) / 2 + slide**2 / hinges.axial[chain, 0] / 2
    put = (
        lambda z: z,
        lambda z: at + (z - elbow) * np.exp(1j * one),
        lambda z: at + (z - elbow) * np.exp(1j * two),
        lambda z: complex(*pose[:2]) + z * np.exp(1j * pose[2]),
    )
    openings = {}
    for j, (where, carrier, pushed, contact, direction, ball, _) in enumerate(PLACES):
        if where == chain:
            p = contact * spin
            n = np.exp(1j * direction) * spin
            body, pivot = (pushed, p - ball * n) if follows == "pushed" else (carrier, p)
            d = put[body](p + n) - put[body](p)
            openings[j] = (
                (put[pushed](p if follows == "pushed" else pivot) - put[carrier](pivot))
                * np.conj(d)
            ).real
    return energy, openings


def reduced(stage, hinges, pose, follows, stiff, held=None):
    """Least potential of springs and stacks at a pose, and the openings there; stacks have their
    force at `held`.
    """
    total = 0.0
    found = np.zeros(len(PLACES))
    for chain in range(3):

        def potential(slide, chain=chain):
            energy, openings = chain_energy(stage, hinges, chain, pose, slide, follows)
            for j, opening in openings.items():
                energy -= PLACES[j][-1] * opening
                energy += 0 if held is None else stiff[j] * (opening - held[j]) ** 2 / 2
            return energy

        best = 0.0
        step = 1e-4
        for _ in range(5):
            below, here, above = (potential(best + k * step) for k in (-1, 0, 1))
            best -= step / 2 * (above - below) / (above - 2 * here + below)
        total += potential(best)
        for j, opening in chain_energy(stage, hinges, chain, pose, best, follows)[1].items():
            found[j] = opening
    return total, found


@pytest.mark.parametrize("stiff", [SPRINGS, 0 * SPRINGS], ids=["engaged", "constant forces"])
@pytest.mark.parametrize("follows", FOLLOWS)
def test_exact_equilibrium_and_tangent_are_those_of_the_energy_in_closed_form(
    stage, follows, stiff
):
    """Single stacks of unlike forces between all kinds of bodies: necks are loaded and the stage
    has moved.
    """
    of = unlike(stage)
    force = np.array([place[-1] for place in PLACES])
    found = loaded(serial(stage, of, stacks_of(stage), follows), force, LOAD)
    assert np.max(np.abs(found.pose)) > 0.1
    _, held = reduced(stage, of.hinges, found.pose, follows, stiff)
    step = np.array([2e-4, 2e-4, 1e-5])

    def at(*signs):
        return reduced(stage, of.hinges, found.pose + step * np.array(signs), follows, stiff, held)[
            0
        ]

    eye = np.eye(3, dtype=int)
    slope = [(at(*e) - at(*-e)) / (2 * h) for e, h in zip(eye, step, strict=True)]
    np.testing.assert_allclose(slope, LOAD, rtol=1e-5)
    both = list(zip(eye, step, strict=True))
    K = [
        [
            (at(*(e + f)) - at(*(e - f)) - at(*(f - e)) + at(*(-e - f))) / (4 * g * h)
            for f, h in both
        ]
        for e, g in both
    ]
    size = np.sqrt(np.diag(K))
    np.testing.assert_allclose(
        found.stiffness(stiff) / np.outer(size, size), K / np.outer(size, size), atol=2e-6
    )


def test_platform_loads_alone_give_16(stage):
    of = unlike(stage)
    load = np.array([3.1, -1.7, 410.0])
    found = loaded(serial(stage, of, (), "pushed"), np.zeros(0), load)
    joints = assemble(stage, 6)._replace(springs=springs(of))
    exact = under_load(joints, load)
    np.testing.assert_allclose(found.pose, exact.pose, rtol=DENSE)
    K = stiffness(joints, exact.displacement, load).K_uu
    np.testing.assert_allclose(found.stiffness(np.zeros(0)), K, rtol=DENSE)
    assert np.max(np.abs(K / stiffness(joints).K_uu - 1)) > 0.01


def springs(of):
    joints = joints_of(of.freedoms)
    return 1 / np.stack(np.broadcast_arrays(*of.hinges), axis=-1).reshape(27)[joints.slot]


@pytest.mark.parametrize("name", ["mobility6", "mobility3"])
@pytest.mark.parametrize(
    "choice", [(None, "paros-weisbord", False), (21, "calibrated", True)], ids=["rigid", "elastic"]
)
def test_without_forces_it_is_the_stage_with_its_drive_engaged_and_disengaged(name, choice):
    stage = load_stage(GEOMETRY / f"{name}.toml")
    drive = drive_of(stage)
    one = commanding(ModelChoice(stage, *choice))
    found = loaded(serial(stage, one.result, drive.stacks, "pushed"), np.zeros(12), np.zeros(3))
    np.testing.assert_array_equal(found.pose, 0.0)
    for stiff, C in (
        (drive.stiffness, one.system.engaged),
        (0 * drive.stiffness, one.system.C[:3, :3]),
    ):
        np.testing.assert_allclose(found.stiffness(stiff) @ C, np.eye(3), atol=1e-8)


def test_forces_beyond_buckling_are_refused_or_called_unstable(stage):
    of = analyse(stage, 6)
    drive = drive_of(stage)
    serially = serial(stage, of, drive.stacks, "carrier")
    assert loaded(serially, 400 + 0 * drive.preload, np.zeros(3)).stable(0 * drive.stiffness)
    assert not loaded(serially, 2000 + 0 * drive.preload, np.zeros(3)).stable(0 * drive.stiffness)
    with pytest.raises(ComputationFailed, match="buckling"):
        loaded(serially, drive.preload, np.array([2e3, 0.0, 0.0]))
