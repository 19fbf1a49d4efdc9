"""The stiffness experiment: simulated, and what measured slopes say."""

from __future__ import annotations

from flexfem import arguments
from flexfem.analytic.model import DEFAULT_FORMULA
from flexfem.files.refusals import checked_path
from flexfem.hinges import formulas
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.reports.given import RESOLUTION, PathLike, finest_of, solver
from flexfem.verify import experiment as verify_experiment
from flexfem.verify import identify as verify_identify
from flexfem.verify.experiment import Experiment
from flexfem.verify.fixture import Fixture, Measurement, read_fixture, read_measured
from flexfem.verify.identified import Identification, Unknown


def experiment(
    stage: Stage,
    fixture: PathLike | Fixture,
    measured: PathLike | None = None,
    mobility: int | None = None,
    formula: str = DEFAULT_FORMULA,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Experiment:
    """Simulate the stiffness experiment of Section VI: pushes, readings, slopes with intervals, and Table II.

    Parameters
    ----------
    fixture : file of the set-up, see cases/README.md, or what is read from one.
    measured : file of measured slopes to compare; by default those of the fixture, where it has some.
    mobility, formula, links : of the model in the table, see `analyse`.
    resolution : of the finite elements that stand for the metal; None takes calibrated hinges and elastic links.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse` and `flexfem.solve`; a file cannot be used.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.experiment(flexfem.load("geometry/mobility6.toml"), "cases/fixture.toml", resolution=None)
    >>> round(found.alone["theta"].ratio, 2), round(found.alone["x"].ratio, 1)  # K_theta, K_xx: 31 % and 2.6 % softer
    (2.23, 37.5)
    """
    check_feasible(stage)
    formulas.formula(formula)
    finest = finest_of(resolution)
    of = fixture if isinstance(fixture, Fixture) else read_fixture(checked_path(fixture))
    slopes = None if measured is None else read_measured(checked_path(measured))
    solved = None if finest is None else solver()(stage, finest)
    return verify_experiment.experiment(stage, of, slopes, (mobility, formula, links), solved)


def identify(
    stage: Stage, measured: PathLike | Fixture | Measurement, unknown: Unknown | None = None, confidence: float = 95.0
) -> Identification:
    """Fit a common offset of the nine necks and a soft fixture to measured slopes, with intervals.

    Parameters
    ----------
    measured : file of measured slopes with standard deviations, with the set-up or without; or what is read from one.
    unknown : of the fixture: "pole", how much softer than described its pole is, or "springs", one in translation and
        one in rotation instead; None takes the pole where one is described.
    confidence : of the intervals, per cent, from 50 to 99.9.

    Raises
    ------
    BadInput
        The file cannot be used, or gives no slopes or standard deviations.
    """
    check_feasible(stage)
    if unknown not in (None, "pole", "springs"):
        raise BadInput(f"unknown {unknown!r}, expected pole or springs")
    given = measured if isinstance(measured, Fixture | Measurement) else read_measured(checked_path(measured))
    return verify_identify.identify(stage, given, unknown, arguments.between("confidence", confidence, 50.0, 99.9))
