"""Simulation of the stiffness experiment of Section VI: readings, slopes with intervals, and Table
II.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from flexfem.arrays import Array, inverse
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper import warnings as warning
from flexfem.paper.fixture import (
    Fixture,
    ForceSensor,
    Lvdt,
    MeasuredSlopes,
    Pushes,
    Run,
    fixture_of,
    measured_of,
    pushes_of,
)
from flexfem.paper.model import DEFAULT_FORMULA, AnalyticResult, analyse, best_model
from flexfem.paper.solutions import solved
from flexfem.paper.stage import Stage
from flexfem.questions.setup import Analytic, Mesh, Models, about, mesh_of, meshed, question
from flexfem.questions.warnings import of_yield
from flexfem.refused import ComputationFailed
from flexfem.results import COARSE_MESHES, SOLVED, Progress, Quantity, Result
from flexfem.units import DIRECTIONS, PLANES

PAPER = Analytic(formula=DEFAULT_FORMULA)
SOFTER = np.array(
    [2.6, 2.6, 31.0]
)  # per cent in x, y, theta by which Section VI measures less than its model
# relative difference of two stiffnesses above which a warning reports the coupling of directions
COUPLED = 1e-3
NOT_THE_PAPERS = (
    "The numbers of the paper's Table II are not available: no number here comes from it or "
    "confirms it."
)


class Experiment(Result):
    """Slopes of load over displacement: of the model, of the stage, simulated and measured."""

    title = "stiffness experiment"
    main_result = ("deviation", {})
    columns = ("source", "against", "part")
    labels: ClassVar = {
        "source": ("model", "stage", "simulated", "measured"),
        "against": ("stage", "simulated", "measured", "measured relative to stage"),
        "part": ("stage", "pole", "bar"),
    }
    figure = "paper.figures.experiment.experiment_figure"
    slope = Quantity(
        "slope of load over displacement", "stiffness", ("direction", "source"), COARSE_MESHES
    )
    deviation = Quantity(
        "deviation from the model", "percent", ("direction", "against"), COARSE_MESHES
    )
    share = Quantity(
        "share of the displacement reading", "percent", ("direction", "part"), COARSE_MESHES
    )
    low = Quantity(
        "simulated slope, low end of interval", "stiffness", ("direction",), COARSE_MESHES
    )
    high = Quantity("high end of interval", "stiffness", ("direction",), COARSE_MESHES)
    softer = Quantity("loss of apparent stiffness", "percent", ("direction",), COARSE_MESHES)
    spring = Quantity(
        "series spring that causes this loss", "stiffness", ("direction",), COARSE_MESHES
    )
    ratio = Quantity("spring over stage stiffness", "", ("direction",), COARSE_MESHES)
    pole = Quantity("stiffness of the pole", "stiffness", ("direction",), SOLVED)
    noiseless = Quantity(
        "slope without noise and steps", "stiffness", ("direction",), COARSE_MESHES, shown=False
    )
    intercept = Quantity(
        "load at zero displacement", "wrench", ("direction",), COARSE_MESHES, "all", shown=False
    )
    explained = Quantity(
        "stiffness before the loss", "stiffness", ("direction",), COARSE_MESHES, shown=False
    )
    measured_sd = Quantity(
        "standard deviation of the measured slope", "stiffness", ("direction",), shown=False
    )
    stroke = Quantity("commanded stroke", "mm", ("increment",), shown=False)
    load = Quantity(
        "load read",
        "wrench",
        ("direction", "repeat", "increment"),
        COARSE_MESHES,
        "all",
        shown=False,
    )
    displacement = Quantity(
        "displacement read",
        "motion",
        ("direction", "repeat", "increment"),
        COARSE_MESHES,
        "all",
        shown=False,
    )


class Slope(NamedTuple):
    """Slope, its confidence interval (nan if the readings give no bounded one), and force at zero
    displacement.
    """

    slope: float
    low: float
    high: float
    intercept: float


def slope_of(
    command: Array,
    force: Array,
    displacement: Array,
    confidence: float,
) -> Slope:
    """Return the slope of force (n,) over displacement (n,), both with errors, at known commands
    (n,), in any units.

    Notes
    -----
    A regression of one reading on the other is biased by the errors of the latter. The command is
    free of errors and serves as instrumental variable: K is the ratio of the slopes of both
    readings over the command, `K = b_F / b_q`. The interval is Fieller's: all K for which the slope
    of `F - K q` over the command does not differ from zero by Student's t with n - 2 degrees of
    freedom, `(b_F - K b_q)^2 <= t^2 (S_FF - 2 K S_Fq + K^2 S_qq) / ((n - 2) S_ss)`, where S are
    sums of squares and products of the residuals of both regressions. It is exact for normal errors
    of unknown variances that are independent between commands. E. C. Fieller, J. Roy. Statist. Soc.
    B 16, 175-185 (1954)."""
    s = command - np.mean(command)
    readings = np.stack([force, displacement])
    dof = len(command) - 2
    b = readings @ s / (s @ s)
    residuals = readings - np.mean(readings, axis=1, keepdims=True) - np.outer(b, s)
    S = stats.t.ppf((1 + confidence) / 2, dof) ** 2 / (dof * (s @ s)) * residuals @ residuals.T
    a = b[1] ** 2 - S[1, 1]
    half = b[0] * b[1] - S[0, 1]
    c = b[0] ** 2 - S[0, 0]
    slope = float(b[0] / b[1]) if b[1] else np.nan
    root = np.sqrt(max(half**2 - a * c, 0.0))
    low, high = ((half - root) / a, (half + root) / a) if a > 0 else (np.nan, np.nan)
    return Slope(
        slope, float(low), float(high), float(np.mean(force) - slope * np.mean(displacement))
    )


@question
def experiment(
    stage: Stage,
    fixture: Path,
    *,
    measured: Path | None = None,
    models: Models = "both",
    analytic: Analytic = PAPER,
    resolution: int | None = None,
    progress: Progress | None = None,
) -> Experiment:
    """Simulate the stiffness experiment of Section VI: readings, slopes with intervals (Figure 11),
    and Table II.

    Parameters
    ----------
    stage : Stage
        The stage.
    fixture : path or Fixture
        File of the set-up, see flexfem schema fixture.
    measured : path, optional
        File of measured slopes to compare; by default those of the fixture, if any.
    models : {"both", "analytic", "elements"}
        "analytic" uses calibrated hinges and elastic links instead of finite elements for the
        loaded stage.
    analytic : Analytic
        The model of the first column of the table; by default that of the paper.
    resolution : int, optional
        Triangles across every neck, from 2.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Experiment
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        experiment` lists it.

    Raises
    ------
    BadInput
        The stage cannot be made, or an option or a file is not valid.
    ComputationFailed
        The stage is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> stage = flexfem.load("geometry/mobility6.toml")
    >>> found = flexfem.experiment(stage, "cases/fixture.toml", models="analytic")
    >>> found.ratio.round(1)  # K_xx, K_yy and K_theta: 2.6 % and 31 % softer
    array([37.5, 37.5,  2.2])
    """
    check_feasible(stage)
    mesh = mesh_of(stage, models, resolution, None, least=2)
    set_up = fixture_of(fixture)
    others = {} if measured is None else {"measured": measured_of(measured)}
    warnings = [*warning.of_stage(stage), *warning.of_thickness(stage)]
    paper = analyse(stage, analytic.mobility, analytic.formula or DEFAULT_FORMULA, analytic.links)
    actual = _pushed_stage(stage, mesh, warnings)
    if mesh is not None and progress is not None:
        progress("the stage is solved")
    C = actual.compliance
    run = set_up.run
    pushes = pushes_of(set_up)
    readings = _readings(pushes, C, set_up)
    measurement = others.get("measured", set_up).measured
    shares = np.array(pushes.shares(C))
    slopes = _Slopes.of(paper, C, readings, measurement)
    if measurement is None:
        loss = _loss(slopes.modelled, slopes.modelled * (1 - SOFTER / 100))
        source = "the text of the paper"
    else:
        loss = _loss(1 / shares[0], slopes.measured)
        source = "the measured slopes"
    confidence = f"{run.confidence_percent:g} %"
    settings = {
        "fixture": set_up.name,
        "model": paper.name,
        "stage": actual.name,
        "confidence": confidence,
    }
    return Experiment(
        about(stage, files={"fixture": set_up, **others}),
        readings.values() | slopes.values() | loss | _of_fixture(shares) | {"stroke": run.strokes},
        axes={
            "repeat": [str(k + 1) for k in range(run.repeats)],
            "increment": [str(k) for k in range(run.increments + 1)],
        },
        settings=settings | meshed(mesh),
        warnings=warnings + _warnings(stage, set_up, pushes, C),
        notes=[
            f"loss of stiffness: from {source}",
            f"intervals of {confidence} by Fieller's theorem",
            NOT_THE_PAPERS,
        ],
    )


class _PushedStage(NamedTuple):
    """The stage that is pushed: name of its model, and compliance (3, 3)."""

    name: str
    compliance: Array


def _pushed_stage(
    stage: Stage,
    mesh: Mesh | None,
    warnings: list[str],
) -> _PushedStage:
    """Return the stage by finite elements, or by the best analytic model of the same plane."""
    if mesh is not None:
        solution = solved(stage, mesh.resolution)
        return _PushedStage(f"finite elements, {PLANES[stage.model]}", solution.compliance)
    best = analyse(*best_model(stage, warnings)._replace(stage=stage))
    return _PushedStage(best.name, best.compliance)


class _Readings(NamedTuple):
    """Simulated readings (3, repeats, n), and the slopes (3,) fitted to them, with intervals."""

    load: Array
    displacement: Array
    slope: Array
    low: Array
    high: Array
    intercept: Array

    def values(self) -> dict[str, Array]:
        """Return the quantities of a result."""
        found = self._asdict()
        del found["slope"]  # beside the others
        return found


def _readings(
    pushes: Pushes,
    C: Array,
    fixture: Fixture,
) -> _Readings:
    """Simulate the readings on a stage of compliance C (3, 3). Raises ComputationFailed."""
    load, displacement = simulated(pushes, C, fixture)
    lines = [
        _fitted_slope(fixture.run, *readings)
        for readings in zip(load, displacement, DIRECTIONS, strict=True)
    ]
    return _Readings(load, displacement, *np.transpose(lines))


class _Slopes(NamedTuple):
    """Slopes (3,) of the model, of the stage that is pushed, fitted to readings, and measured."""

    modelled: Array
    actual: Array
    fitted: Array
    measured: Array
    measured_sd: Array

    @classmethod
    def of(
        cls,
        paper: AnalyticResult,
        C: Array,
        readings: _Readings,
        measurement: MeasuredSlopes | None,
    ) -> _Slopes:
        """Return the slopes; nan where none are measured."""
        unknown = np.full(3, np.nan)
        measured, sd = (unknown, unknown) if measurement is None else measurement.slopes
        modelled = 1 / np.diag(paper.compliance)
        return cls(modelled, 1 / np.diag(C), readings.slope, measured, sd)

    def values(self) -> dict[str, Array]:
        """Return the quantities of a result: slopes, and their deviations in per cent."""
        deviations = [
            self.actual / self.modelled,
            self.fitted / self.modelled,
            self.measured / self.modelled,
            self.measured / self.actual,
        ]
        return {
            "slope": np.stack(self[:4], axis=1),
            "deviation": 100 * (np.stack(deviations, axis=1) - 1),
            "measured_sd": self.measured_sd,
        }


def _loss(reference: Array, apparent: Array) -> dict[str, Array]:
    """Return the loss from a stiffness (3,) to an apparent one, and the spring that explains it."""
    spring = spring_in_series(reference, apparent)
    return {
        "softer": 100 * (1 - apparent / reference),
        "spring": spring,
        "ratio": spring / reference,
        "explained": reference,
    }


def _of_fixture(shares: Array) -> dict[str, Array]:
    """Return what follows from the compliances (3 parts, 3) of stage, pole and bar in series."""
    total = np.sum(shares, axis=0)
    return {
        "share": 100 * (shares / total).T,
        "pole": 1 / np.where(shares[1] > 0, shares[1], np.nan),
        "noiseless": 1 / total,
    }


def spring_in_series(stage: ArrayLike, apparent: ArrayLike) -> Array:
    """Return K_f in `1/apparent = 1/stage + 1/K_f`, nan unless the apparent stiffness is below that
    of the stage.
    """
    with np.errstate(divide="ignore"):
        spring = 1 / (1 / np.asarray(apparent) - 1 / np.asarray(stage))
    return np.where(np.less(apparent, stage), spring, np.nan)


def simulated(
    pushes: Pushes,
    C: Array,
    fixture: Fixture,
) -> tuple[Array, Array]:
    """Return simulated readings (3, repeats, n) of load and displacement on a stage of compliance C
    (3, 3).
    """
    run = fixture.run
    rng = np.random.default_rng(fixture.run.seed)

    def read(values: Array, sensor: ForceSensor | Lvdt) -> Array:
        """Return the readings (k, repeats, n) of values (k, n), with the noise of the sensor,
        rounded to its steps.
        """
        noisy = values[:, None] + sensor.noise * rng.normal(
            size=(len(values), run.repeats, values.shape[1])
        )
        step = sensor.resolution
        return np.asarray(step * np.round(noisy / step)) if step > 0 else noisy

    force = pushes.force(C, run.strokes)
    loads = pushes.arm[:, None, None] * read(force, fixture.sensor)
    displacements = read(
        (pushes.stage(C) + pushes.pole + pushes.bar)[:, None] * force[pushes.push], fixture.lvdt
    )
    return loads, np.moveaxis(pushes.read(np.moveaxis(displacements, 0, -1)), -1, 0)


def _fitted_slope(
    run: Run,
    load: Array,
    displacement: Array,
    axis: str,
) -> Slope:
    """Return the slope of the readings (repeats, n) in a direction. Raises ComputationFailed if it
    may be zero.
    """
    for quantity, values in (("load", load), ("displacement", displacement)):
        if np.ptp(values) == 0:  # all readings are below half a step of the sensor
            raise ComputationFailed(
                f"the {quantity} reading in {axis} does not change with the stroke"
            )
    command = np.tile(run.strokes, run.repeats)
    found = slope_of(command, load.ravel(), displacement.ravel(), run.confidence_percent / 100)
    bounded = not np.isnan(found.low)
    if not (found.low if bounded else found.slope) > 0:
        ends = f" ({found.low:.3g} to {found.high:.3g})" if bounded else ""
        raise ComputationFailed(
            f"the slope in {axis}, {found.slope:.3g}{ends}, cannot be distinguished from zero: "
            "expected a stiffer pole and bar, less noise of lvdt and sensor, or more increments "
            "and repeats"
        )
    return found


def _warnings(
    stage: Stage,
    fixture: Fixture,
    pushes: Pushes,
    C: Array,
) -> list[str]:
    """Warn of sensor steps, of loads beyond the range or strength of the stage, and of slopes that
    are not K_ii.
    """
    best = analyse(*(chosen := best_model(stage, [])))
    messages = [
        f"{key}.noise_{unit} is below half of {key}.resolution_{unit}: sensor steps dominate the "
        "errors, and the intervals, which assume normal and independent errors, may be wrong"
        for key, sensor, unit in (("lvdt", fixture.lvdt, "um"), ("sensor", fixture.sensor, "n"))
        if sensor.noise < sensor.resolution / 2
    ]
    largest = pushes.load * pushes.force(C, fixture.run.strokes[-1:])
    for axis, pose in zip(DIRECTIONS, largest @ C.T, strict=True):
        where = f"the largest force in {axis}"
        highest = float(np.max(best.neck_stress(chosen.stage, pose)))
        messages += warning.of_motion(stage, pose, where)
        messages += of_yield(highest, stage.material.yield_strength, where)
    K = np.diag(inverse(C))
    free = 1 / np.diag(C)
    on_rigid_fixture = 1 / pushes.shares(C)[0]
    messages += [
        f"a force in {axis} leaves the other directions free and measures 1/C = {free[k]:.5g}, "
        f"not the diagonal term of the stiffness, {K[k]:.5g}"
        for k, axis in enumerate(DIRECTIONS)
        if abs(K[k] / free[k] - 1) > COUPLED
    ]
    return messages + [
        f"a force in {axis} also loads other directions, by its arm or the pole's offset: on a "
        f"rigid fixture the slope is {on_rigid_fixture[k]:.5g}, and 1/C is {free[k]:.5g}"
        for k, axis in enumerate(DIRECTIONS)
        if abs(on_rigid_fixture[k] / free[k] - 1) > COUPLED
    ]
