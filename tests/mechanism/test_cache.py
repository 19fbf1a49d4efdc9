"""What is remembered of a stage is that stage's, and nobody can change it for the others."""

from __future__ import annotations

import pickle

from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage import Stage

from ..conftest import StageMaker


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
