"""What is remembered of a stage is that stage's, and nobody can change it for the others."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import pytest

from flexfem.mechanism.bodies import cut_angle, draw_sector, lug_side, necks
from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage import CHAINS, Stage

from ..conftest import UNLIKE, StageMaker

DRAWN: dict[str, Callable[[Stage], Any]] = {
    "frames": lambda stage: [part.tolist() for part in stage_frames(stage)],
    "necks": lambda stage: [necks(stage, chain) for chain in CHAINS],
    "lug": lambda stage: [lug_side(stage, chain, side) for chain in CHAINS for side in (1, -1)],
    "cut": cut_angle,
    "sector": lambda stage: [dict(draw_sector(stage, chain)) for chain in CHAINS],
}


@pytest.mark.parametrize("what", DRAWN)
def test_stages_taken_in_turns_do_not_mix(make_stage: StageMaker, what: str) -> None:
    """Each time against a stage of the same values that nothing is remembered of."""
    of = DRAWN[what]
    changes: list[dict[str, Any]] = [{}, {"override": UNLIKE}]
    one, other = (make_stage(each) for each in changes)
    for _ in range(2):
        for stage, each in ((one, changes[0]), (other, changes[1])):
            assert of(stage) == of(make_stage(each))
    assert of(one) != of(other)


def test_what_was_computed_of_a_stage_is_not_computed_again_and_leaves_with_it(make_stage: StageMaker) -> None:
    asked = []

    @once
    def length(stage: Stage, chain: int, twice: bool = False) -> float:
        asked.append((stage, chain))
        return stage.chain.link_lengths[chain] * (2 if twice else 1)

    one, other = make_stage(), make_stage()
    found = [length(one, 1), length(one, 2), length(one, 1), length(one, 1, twice=True), length(one, 1)]
    assert found == [33.5, 25.0, 33.5, 67.0, 33.5] and len(asked) == 3
    length(other, 1)
    assert asked[-1][0] is other and len(asked) == 4
    length(one, 1)
    assert len(asked) == 4  # each stage keeps its own
    assert stage_frames(one) and stage_frames(other) and one == other
    sent = pickle.loads(pickle.dumps(one))
    assert sent == one and sent.origin == one.origin and set(vars(sent)) <= {*vars(one)} - {"kept"}
