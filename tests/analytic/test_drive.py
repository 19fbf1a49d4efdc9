"""The compliance of a driven stage against its joints: another route, with dependent joints and
moved contacts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.paper.contacts import placed_stack
from flexfem.paper.equations import chain_poses, freedoms_of, in_joint_order, mechanism, stiffness
from flexfem.paper.responses import driven, link_parts
from flexfem.paper.stage import load_stage

from ..tolerances import DENSE

GEOMETRY = Path(__file__).parents[2] / "geometry"
BODIES = ("frame", "link 1", "link 2", "platform")
PLACES = [  # carrier, pushed body, contact and direction in the frame of chain 1
    (0, 1, 43.0 - 36.5j, 1.4),
    (2, 1, 33.0 - 27.5j, -1.7),
    (1, 2, 15.0 - 20.0j, 0.4),
    (0, 2, 22.0 - 8.0j, 2.9),
    (0, 3, -3.0 + 17.0j, -1.2),
    (2, 3, 6.0 - 16.0j, 1.1),
]


def opening(frames, joints, displacement, chain, place):
    """How far a stack's two ends have moved apart along its line, from the finite motion of its two
    bodies.
    """
    carrier, pushed, point, direction = place
    spin = np.exp(2j * np.pi / 3 * chain)
    push = np.exp(1j * direction) * spin
    contact = point * spin
    at = chain_poses(frames, joints, displacement)
    rest = chain_poses(frames, joints, np.zeros_like(displacement))
    table = np.zeros(27)
    table[joints.slot] = displacement

    def moved(body):
        if body == 0:
            return contact
        turn = np.sum(table.reshape(3, 3, 3)[chain, :body, 0])
        if body == 3:
            x, y, _ = at.pose[chain]
            return x + 1j * y + contact * np.exp(1j * turn)
        end, was = (
            complex(*each.pivots[chain, body]) for each in (at, rest)
        )  # the next hinge sits on the body
        return end + (contact - was) * np.exp(1j * turn)

    return ((moved(pushed) - moved(carrier)) * np.conj(push)).real


def by_joints(frames, hinges, freedoms, places):
    """Compliance (3 + n, 3 + n): (17) with the openings beside the pose, by central differences of
    the joints.
    """
    of = mechanism(frames, hinges, freedoms)
    at = stiffness(of)
    independent = np.eye(of.joints.mobility)
    all_joints = in_joint_order(at.influence.G_p @ independent, independent, of.choice)
    rows = []
    step = 1e-6
    for chain, place in places:
        there, back = (
            [
                opening(frames, of.joints, sign * step * joint, chain, place)
                for joint in all_joints.T
            ]
            for sign in (1, -1)
        )
        rows.append((np.array(there) - np.array(back)) / (2 * step))
    G = np.vstack([at.influence.G_u, rows])
    return G @ at.C_aa @ G.T


@pytest.mark.parametrize("mobility", [3, 6, 12, 21])
def test_openings_and_poses_are_those_of_the_joints(generic, error, mobility):
    stage = load_stage(GEOMETRY / "mobility6.toml")
    frames, hinges = generic(7)
    places = [(chain, place) for chain in (0, 1, 2) for place in PLACES]
    stacks = tuple(
        placed_stack(stage, chain, (BODIES[carrier], BODIES[pushed]), point, direction)
        for chain, (carrier, pushed, point, direction) in places
    )
    found = driven(frames, hinges, freedoms_of(mobility), stacks).compliance
    assert error(found, by_joints(frames, hinges, freedoms_of(mobility), places)) < DENSE


def test_a_push_along_a_straight_link_stretches_it_between_the_two_stations():
    """Link 1 alone between frame and itself: a pull along it is borne by its strip from the base to
    the station.
    """
    stage = load_stage(GEOMETRY / "mobility3.toml")
    E, _ = stage.elastic
    near, far = (
        placed_stack(stage, 0, ("frame", "link 1"), complex(x, -32.0), np.pi) for x in (44.0, 36.0)
    )  # 8 mm apart along link 1, whose ends are at 52.5 and 25.5 mm
    D = link_parts(stage, (near, far)).motions
    area = stage.thickness * stage.chain.link_width
    assert D[4, 4] - D[3, 3] == pytest.approx(8.0 / (E * area), rel=DENSE)
