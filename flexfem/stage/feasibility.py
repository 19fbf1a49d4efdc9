"""Stage files of stages that can be made."""

from __future__ import annotations

from flexfem.files.toml import Path
from flexfem.stage.checks import check_closed_form as check_closed_form
from flexfem.stage.checks import check_feasible as check_feasible
from flexfem.stage.schema import Stage, load_stage


def load_feasible(path: Path) -> Stage:
    """Read a stage file and refuse what cannot be made. Raises BadInput, naming the file."""
    stage = load_stage(path)
    check_feasible(stage)
    return stage
