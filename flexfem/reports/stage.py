"""What is read of a stage and what its analytic model says at rest: hinges, stiffness, ranges, mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexfem import arguments
from flexfem.files.refusals import checked_path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.refused import BadInput
from flexfem.reports.given import RESOLUTION, PathLike, finest_of, solver

if TYPE_CHECKING:
    from flexfem.mechanism.stage import Stage
    from flexfem.verify.answers import MeshReport, StiffnessReport
    from flexfem.verify.as_built import AsBuilt
    from flexfem.verify.stage_report import StageReport
    from flexfem.verify.summary import Summary


def check(stage: Stage) -> StageReport:
    """What is read of a stage: hinges, mobility, where its numbers come from, warnings. Raises BadInput.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    from flexfem.verify.stage_report import report_stage

    check_feasible(stage)
    return report_stage(stage)


def stiffness(
    stage: Stage,
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = None,
) -> StiffnessReport:
    """Stiffness and compliance (3, 3) of the platform, and stress of the necks per displacement, by the analytic model.

    Arguments as of `analyse`; N, mm, rad and MPa, order x, y, theta. With a `resolution`, from 4, the stress by finite
    elements on three meshes too.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse` and `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.stiffness(flexfem.load("geometry/mobility6.toml"), mobility=21, formula="koster")
    >>> found.formula_in_range, found.stiffness.shape
    (True, (3, 3))
    """
    from flexfem.analytic.model import analyse, choose, model_of
    from flexfem.analytic.paper import freedoms_of
    from flexfem.verify.answers import report_stiffness

    check_feasible(stage)
    asked, finest, warnings = model_of(mobility, formula, links), finest_of(resolution, 4), list[str]()
    freedoms_of(mobility or 3)
    if links and mobility not in (None, 21):
        raise BadInput(f"links with mobility {mobility}, expected 21 or none: elastic links go with all freedoms")
    chosen = choose(stage, asked, warnings)
    result = analyse(*chosen)
    if finest is None:
        return report_stiffness(chosen.stage, result, None, warnings)
    from flexfem.verify import warning
    from flexfem.verify.summary import banded_stress

    warnings += warning.of_thickness(stage)
    return report_stiffness(chosen.stage, result, banded_stress(stage, finest, solver()), warnings)


def summary(stage: Stage, formula: str | None = None, elements: bool = False, resolution: int = RESOLUTION) -> Summary:
    """How far a stage may go in each direction before a neck yields, and the force that takes.

    Parameters
    ----------
    formula : of the hinges; None takes the calibrated one where it has a value.
    elements : also by finite elements, with so many triangles across every neck (`resolution`).

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse` and `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.summary(flexfem.load("geometry/mobility6.toml"))
    >>> round(found.analytic.limits["x"].range_at_yield, 3), found.analytic.limits["x"].hinge
    (0.641, 'elbow')
    """
    from flexfem.analytic.model import CALIBRATED
    from flexfem.hinges import formulas
    from flexfem.verify import summary as verify

    check_feasible(stage)
    formulas.formula(CALIBRATED if formula is None else formula)
    finest = arguments.resolution(resolution)
    return verify.summary(stage, formula, solver()(stage, finest) if elements else None)


def mesh(stage: Stage, path: PathLike, resolution: int = RESOLUTION) -> MeshReport:
    """Mesh a stage and write it with the groups stage, ground and hub.

    Parameters
    ----------
    path : ends in .msh, .vtu or .inp.   resolution : quadratic triangles across every neck.

    Raises
    ------
    BadInput
        The stage cannot be made or is not plane, or the file cannot be written.
    ComputationFailed
        The mesh does not pass its checks.
    """
    from flexfem.fem.export import check_format, write_mesh
    from flexfem.fem.response import plate_of
    from flexfem.fem.sectors import build_mesh
    from flexfem.files.writing import check_file
    from flexfem.verify.answers import report_mesh

    target, resolution = checked_path(path), arguments.resolution(resolution)
    check_feasible(stage)
    check_format(target)
    check_file(target)
    plate, made = plate_of(stage), build_mesh(stage, resolution)
    write_mesh(made, plate, target)
    return report_mesh(stage, made, resolution, str(target))


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
