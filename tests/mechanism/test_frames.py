"""The skeleton against (19) to (21) walked link by link: both models stand on it, so neither would
see it wrong.

What is remembered of a stage is that stage's, and nobody can change it for the others.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from flexfem.arrays import direction
from flexfem.files.tables import memoized
from flexfem.paper.designs import stage_frames
from flexfem.paper.frames import CHAIN_TURN, frames
from flexfem.paper.stage import HINGE_NAMES, Stage

from ..conftest import StageMaker

ROUND_OFF = 1e-12  # mm or rad; lengths are around 30 mm, so this is a few thousand roundings
LENGTHS = np.array([31.0, 33.5, 25.0])
ANGLES = np.deg2rad([175.0, -85.0, 92.0])
SLANTED = np.deg2rad([[13.0, 201.0, 77.0], [-38.0, 164.0, 291.0], [np.nan, 3.0, np.nan]])
HEADINGS = np.array([ANGLES[0], ANGLES[0] + ANGLES[1], ANGLES[0] + ANGLES[1] + ANGLES[2]])
ALONG = np.array([[np.cos(a), np.sin(a)] for a in HEADINGS])


def rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def test_hinges_of_chain_one_in_closed_form() -> None:
    expected = [-(LENGTHS[k:] @ ALONG[k:]) for k in range(3)]
    np.testing.assert_allclose(frames(LENGTHS, ANGLES).centres[0], expected, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("chain", [1, 2])
def test_chains_are_chain_one_turned_by_120_degrees(chain: int) -> None:
    given = np.tile(SLANTED[0], (3, 1))  # the file gives an axis once, in the frame of chain 1
    placed = frames(LENGTHS, ANGLES, given)
    turn = rotation(chain * 2 * np.pi / 3)
    np.testing.assert_allclose(
        placed.centres[chain], placed.centres[0] @ turn.T, rtol=0, atol=ROUND_OFF
    )
    np.testing.assert_allclose(
        direction(placed.axes[chain]), direction(placed.axes[0]) @ turn.T, atol=ROUND_OFF
    )


@pytest.mark.parametrize("seed", range(5))
def test_necks_point_from_the_base_side_to_the_platform_side(seed: int) -> None:
    rng = np.random.default_rng(seed)
    placed = frames(LENGTHS, ANGLES, rng.uniform(-np.pi, np.pi, (3, 3)))
    for chain in range(3):
        e1, e2, e3 = ALONG @ rotation(chain * CHAIN_TURN).T
        base, elbow, platform = direction(placed.axes[chain])
        assert min(base @ e1, elbow @ (e1 + e2), platform @ (e2 + e3)) > 0


def test_frames_of_a_stage_take_each_axis_from_its_hinge_or_override(make_stage) -> None:
    stage = make_stage(
        {
            "hinges.elbow.axis_deg": 160.0,
            "override": [{"chain": 3, "hinge": "elbow", "axis_deg": 141.0}],
        }
    )
    axes = np.full((3, 3), np.nan)
    axes[:, HINGE_NAMES.index("elbow")] = np.deg2rad([160.0, 160.0, 141.0])
    expected = frames(np.array(stage.chain.link_lengths), np.array(stage.chain.joint_angles), axes)
    found = stage_frames(stage)
    np.testing.assert_array_equal(found.centres, expected.centres)
    np.testing.assert_array_equal(found.axes, expected.axes)


def test_what_was_computed_of_a_stage_is_not_computed_again_and_leaves_with_it(
    make_stage: StageMaker,
) -> None:
    asked = []

    @memoized
    def length(stage: Stage, chain: int, twice: bool = False) -> float:
        asked.append((stage, chain))
        return stage.chain.link_lengths[chain] * (2 if twice else 1)

    one = make_stage()
    other = make_stage()
    found = [
        length(one, 1),
        length(one, 2),
        length(one, 1),
        length(one, 1, twice=True),
        length(one, 1),
    ]
    assert found == [33.5, 25.0, 33.5, 67.0, 33.5] and len(asked) == 3
    length(other, 1)
    assert asked[-1][0] is other and len(asked) == 4
    length(one, 1)
    assert len(asked) == 4  # each stage keeps its own
    assert stage_frames(one) and stage_frames(other) and one == other
    sent = pickle.loads(pickle.dumps(one))
    assert sent == one and sent.origin == one.origin and set(vars(sent)) <= {*vars(one)} - {"kept"}
