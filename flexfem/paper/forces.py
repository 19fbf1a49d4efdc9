"""The refusal of a question about the parts of a stage."""

from __future__ import annotations

from typing import Any

from flexfem.paper.stage import Stage
from flexfem.questions.forces import Forces
from flexfem.refused import BadInput


def forces(stage: Stage, **options: Any) -> Forces:
    """Refuse `flexfem.forces`: the finite elements of a stage have no bodies of their own."""
    raise BadInput(
        f"{stage.origin}: forces is for a mechanism file, not for a stage file; stiffness has the "
        "stress of necks"
    )
