"""What is read of a stage, and its stiffness as it was made."""

from __future__ import annotations

from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.verify.stage_report import StageReport, report_stage


def check(stage: Stage) -> StageReport:
    """Validate a stage file; show hinges, drive, mobility and where the numbers come from.

    Parameters
    ----------
    stage : Stage
        The stage.

    Raises
    ------
    BadInput
        The stage cannot be made.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    check_feasible(stage)
    return report_stage(stage)
