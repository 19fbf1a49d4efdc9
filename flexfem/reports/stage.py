"""What is read of a stage, and its stiffness as it was made."""

from __future__ import annotations

from flexfem.files.refusals import checked_path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.reports.given import PathLike
from flexfem.verify.as_built import AsBuilt
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


def as_built(
    stage: Stage,
    necks: PathLike,
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
) -> AsBuilt:
    """The stiffness of a stage with its nine measured necks, and its scatter by that of the measurement.

    Parameters
    ----------
    necks : CSV file with columns chain, hinge, neck_um and, if known, sd_um; or TOML with these in [[neck]].
    mobility, formula, links : of the model, see `analyse`.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse`; the file cannot be used, or the stage not made with these necks.
    """
    from flexfem.analytic.model import choose, model_of
    from flexfem.verify import as_built as verify

    check_feasible(stage)
    asked, warnings = model_of(mobility, formula, links), list[str]()
    measured = verify.read_necks(checked_path(necks), stage)
    return verify.as_built(choose(stage, asked, warnings), measured, warnings)
