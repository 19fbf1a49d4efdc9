"""`flexfem experiment`: the stiffness experiment of Section VI as it would go on a stage, and its Table II."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import DEFAULT_FORMULA, analyse, best_model
from flexfem.arrays import Array, inverse
from flexfem.files.provenance import doubts
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.refused import ComputationFailed
from flexfem.units import DIRECTIONS, PLANES, Direction
from flexfem.verify.fixture import Fixture, Measurement
from flexfem.verify.measured import Slopes
from flexfem.verify.protocol import Solved
from flexfem.verify.pushes import (
    Pushes,
    bar_share,
    force_of,
    pole_share,
    pushes_of,
    read,
    read_compliance,
    seen,
    stage_share,
)
from flexfem.verify.result import Matrix, OfStage, Record, about
from flexfem.verify.series import SpringAlone, springs_alone
from flexfem.verify.slopes import Slope, slope_of

COUPLED = 1e-3  # of a stiffness: what a push that leaves the other directions free misses of K_ii
NOT_THE_PAPERS = (
    "The numbers of the paper's Table II are not available: no number here is one of them, and no claim holds by it."
)


class Pushed(Record):
    """One push: readings by repeat and increment, and the slope with its interval, None where it has no end.

    stroke : (n,), mm, commanded.   load, displacement : (repeats, n), N and mm, or N mm and rad.
    slope, low, high, intercept, dof : see `slopes.slope_of`.   noiseless : the slope without noise and steps.
    share : of stage, pole and bar in the displacement that is read, per cent.
    """

    stroke: list[float]
    load: Matrix
    displacement: Matrix
    slope: float
    low: float | None
    high: float | None
    intercept: float
    dof: int
    noiseless: float
    share: dict[str, float]


class Row(Record):
    """One direction of Table II, N/mm or N mm/rad: model and metal as pushed, 1/C_ii, simulated, measured.

    deviation : of metal, simulated and measured from the model, `measured from metal`, per cent.
    """

    model: float
    metal: float
    simulated: float
    measured: float | None
    measured_sd: float | None
    deviation: dict[str, float]


class Experiment(OfStage):
    """What `flexfem experiment` answers; N, mm, rad.

    model, metal : which analytic model and what stands for the metal.   model_stiffness, metal_stiffness : (3, 3).
    confidence : of the intervals, per cent.   explained : whose deviations `alone` explains.
    """

    name: str
    fixture: str
    model: str
    metal: str
    model_stiffness: Matrix
    metal_stiffness: Matrix
    confidence: float
    pushed: dict[Direction, Pushed]
    table: dict[Direction, Row]
    explained: str
    alone: dict[Direction, SpringAlone]


class Readings(NamedTuple):
    """Readings (3, repeats, n) of load and displacement, N and mm, the third push N mm and rad."""

    load: Array
    displacement: Array


def experiment(
    stage: Stage,
    fixture: Fixture,
    measured: Fixture | Measurement | None = None,
    model: tuple[int | None, str, bool] = (None, DEFAULT_FORMULA, False),
    solved: Solved | None = None,
) -> Experiment:
    """Simulate the experiment on a feasible stage.

    Parameters
    ----------
    measured : whose slopes to compare, by default those of the fixture.
    model : mobility, formula, elastic links of the first column.
    solved : finite elements, the metal; None takes calibrated hinges and elastic links.

    Raises BadInput, ComputationFailed as `model.analyse`, and ComputationFailed where readings tell no slope.
    """
    found = analyse(stage, *model)
    warnings = [*warning.of_stage(stage), *warning.of_thickness(stage)]
    metal, C = metal_of(stage, solved, warnings)
    pushes = pushes_of(fixture)
    readings = simulated(pushes, C, fixture)
    pushed = {axis: _pushed(fixture, pushes, C, readings, k) for k, axis in enumerate(DIRECTIONS)}
    given = (measured or fixture).measured
    slopes = Slopes(np.full(3, np.nan), np.full(3, np.nan)) if given is None else given.slopes
    warnings += _of_run(stage, fixture, pushes, C) + _of_coupling(pushes, C)
    said = doubts([("", stage), ("fixture: ", fixture), *([("measured: ", measured)] if measured else [])])
    model_slopes = 1 / np.diag(found.compliance)
    return Experiment(
        **about(stage) | said._asdict(),
        name=stage.name,
        fixture=fixture.name,
        model=found.name,
        metal=metal,
        model_stiffness=found.stiffness.tolist(),
        metal_stiffness=inverse(C).tolist(),
        confidence=fixture.run.confidence_percent,
        pushed=pushed,
        table={
            axis: _row(float(model_slopes[k]), float(1 / C[k, k]), pushed[axis].slope, slopes, k)
            for k, axis in enumerate(DIRECTIONS)
        },
        explained="the paper's text" if given is None else "the measured slopes",
        alone=springs_alone(pushes, model_slopes, 1 / stage_share(pushes, C), None if given is None else slopes.value),
        warnings=list(dict.fromkeys(warnings)),
    )


def metal_of(stage: Stage, solved: Solved | None, warnings: list[str]) -> tuple[str, Array]:
    """What stands for the metal, and its compliance (3, 3); without finite elements the best model there is."""
    if solved is not None:
        return f"finite elements, {PLANES[stage.model]}", solved.response.compliance
    found = analyse(*best_model(stage, warnings)._replace(stage=stage))  # of one plane with finite elements
    return found.name, found.compliance


def simulated(of: Pushes, C: Array, fixture: Fixture) -> Readings:
    """Readings of the run on a stage of compliance C (3, 3), drawn from its seed."""
    run, noise = fixture.run, np.random.default_rng(fixture.run.seed)
    shape = (run.repeats, run.increments + 1)
    force = force_of(of, C, run.strokes)
    pushed = _sensed(force, fixture.sensor.noise, fixture.sensor.resolution, noise.normal(size=(3, *shape)))
    moved = seen(of, C)[:, None] * force[of.push]
    sensed = _sensed(moved, fixture.lvdt.noise, fixture.lvdt.resolution, noise.normal(size=(len(of.push), *shape)))
    return Readings(of.arm[:, None, None] * pushed, np.moveaxis(read(of, np.moveaxis(sensed, 0, -1)), -1, 0))


def _sensed(values: Array, sd: float, step: float, noise: Array) -> Array:
    """Values (k, n) as a sensor reads them, with standard normal numbers (k, repeats, n), rounded to its steps."""
    found = values[:, None] + sd * noise
    return np.asarray(step * np.round(found / step)) if step > 0 else found


def _pushed(fixture: Fixture, of: Pushes, C: Array, readings: Readings, k: int) -> Pushed:
    run, load, displacement = fixture.run, readings.load[k], readings.displacement[k]
    command = np.tile(run.strokes, run.repeats)
    found: Slope = slope_of(command, load.ravel(), displacement.ravel(), run.confidence_percent / 100)
    for what, values in (("load", load), ("displacement", displacement)):
        if np.ptp(values) == 0:  # all below half a step of the sensor
            raise ComputationFailed(f"the {what} read in {DIRECTIONS[k]} does not change with the stroke")
    lowest = found.slope if np.isnan(found.low) else found.low
    if not lowest > 0:
        ends = "" if np.isnan(found.low) else f" ({found.low:.3g} to {found.high:.3g})"
        raise ComputationFailed(
            f"the slope read in {DIRECTIONS[k]}, {found.slope:.3g}{ends}, cannot be told from zero: expected a stiffer "
            "pole and bar, less noise of lvdt and sensor, or more increments and repeats"
        )
    all_of_it = read_compliance(of, C)[k]
    parts = {"pole": pole_share(of)[k] / all_of_it, "bar": bar_share(of)[k] / all_of_it}
    return Pushed(
        stroke=run.strokes.tolist(),
        load=load.tolist(),
        displacement=displacement.tolist(),
        **found._asdict()
        | {name: value if np.isfinite(value) else None for name, value in (("low", found.low), ("high", found.high))},
        noiseless=float(1 / all_of_it),
        share={name: 100 * float(part) for name, part in ({"stage": 1 - sum(parts.values())} | parts).items()},
    )


def _row(model: float, metal: float, simulated: float, measured: Slopes, k: int) -> Row:
    value, sd = (None if np.isnan(each[k]) else float(each[k]) for each in measured)
    against: dict[str, tuple[float | None, float]] = {
        "metal": (metal, model),
        "simulated": (simulated, model),
        "measured": (value, model),
        "measured from metal": (value, metal),
    }
    deviation = {name: 100 * (of / base - 1) for name, (of, base) in against.items() if of is not None}
    return Row(model=model, metal=metal, simulated=simulated, measured=value, measured_sd=sd, deviation=deviation)


def _of_run(stage: Stage, fixture: Fixture, of: Pushes, C: Array) -> warning.Warnings:
    """Readings that say little, and pushes that the stage does not bear."""
    found, loads = [], of.load * force_of(of, C, fixture.run.strokes[-1:])
    best = analyse(*(chosen := best_model(stage, [])))
    for what, sensor, unit in (("lvdt", fixture.lvdt, "um"), ("sensor", fixture.sensor, "n")):
        if 0 < sensor.noise < sensor.resolution / 2 or (sensor.noise == 0 and sensor.resolution > 0):
            found.append(
                f"{what}.noise_{unit} is below half of {what}.resolution_{unit}: the readings step, and the intervals, "
                "which take errors as normal and independent, need not hold"
            )
    if fixture.lvdt.rotation == "one end":
        found.append('lvdt.rotation = "one end": the translation of the platform is read as rotation')
    for axis, load in zip(DIRECTIONS, loads, strict=True):
        where = f"the largest push in {axis}"
        found += warning.of_motion(stage, C @ load, where)
        found += warning.of_yield(
            float(np.max(best.neck_stress(chosen.stage, C @ load))), stage.material.yield_strength, where
        )
    return found


def _of_coupling(of: Pushes, C: Array) -> warning.Warnings:
    """Directions in which what is measured is not K_ii: others are free, and pushes have other components."""
    K, read = np.diag(inverse(C)), 1 / stage_share(of, C)
    free = [
        f"a push in {axis} leaves the other directions free and measures 1/C = {1 / C[k, k]:.5g}, not the diagonal "
        f"term of the stiffness, {K[k]:.5g}"
        for k, axis in enumerate(DIRECTIONS)
        if abs(K[k] * C[k, k] - 1) > COUPLED
    ]
    beside = [
        f"a push in {axis} is also one in other directions, by its arm or the pole's offset: on a rigid fixture the "
        f"slope is {read[k]:.5g}, where 1/C is {1 / C[k, k]:.5g}"
        for k, axis in enumerate(DIRECTIONS)
        if abs(read[k] * C[k, k] - 1) > COUPLED
    ]
    return free + beside
