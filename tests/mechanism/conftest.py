"""The generic stages."""

from __future__ import annotations

import pytest

from flexfem.paper.stage import Stage

from ..conftest import UNLIKE, with_changes


@pytest.fixture(scope="session", params=["alike", "unlike"])
def stage(request: pytest.FixtureRequest) -> Stage:
    """The generic stage, and one with three hinges of different chains overridden."""
    return with_changes({} if request.param == "alike" else {"override": UNLIKE})
