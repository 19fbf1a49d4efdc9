"""Stage files of stages that can be made."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from flexfem.files.toml import Path
from flexfem.stage.checks import check_closed_form as check_closed_form
from flexfem.stage.checks import check_feasible as check_feasible
from flexfem.stage.schema import Stage, load_stage


def load_feasible(path: Path) -> Stage:
    """Read a stage file and refuse what cannot be made. Raises BadInput, naming the file."""
    stage = load_stage(path)
    check_feasible(stage)
    return stage


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Nothing: stages know their file. For callers that are yet to drop it."""
    yield
