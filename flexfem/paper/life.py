"""Fatigue life of the necks of a stage at an amplitude of its platform."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, is_largest
from flexfem.fem.elements import von_mises
from flexfem.fem.response import Response
from flexfem.hinges import strength
from flexfem.hinges.strength import Basquin, BasquinFit, Wrench
from flexfem.paper import answers
from flexfem.paper import warnings as warning
from flexfem.paper.designs import Designs, design_arrays
from flexfem.paper.fields import notch_fields
from flexfem.paper.model import (
    CALIBRATED,
    AnalyticResult,
    ModelChoice,
    analyse,
    stress_raised,
)
from flexfem.paper.solutions import solved
from flexfem.paper.stage import Stage
from flexfem.questions import plates, setup
from flexfem.questions.bands import stress_bands
from flexfem.questions.life import (
    LEFT_OUT,
    CyclicMotion,
    Fatigue,
    StressCycles,
    WithLaw,
    checked_motion,
    chosen_law,
)
from flexfem.questions.setup import DEFAULT, Analytic, ModelAnswer, Models
from flexfem.results import ANALYTIC, ELEMENTS, STRESS, Gate, Progress, Quantity, Result

NECK = ("model", "chain", "hinge")


class StageLife(WithLaw, Result):
    """Cycles to failure of the necks, and the amplitude for a wanted life."""

    kind_name = "life"
    title = "fatigue life"
    main_result = ("life", {})
    figure = "life.life_figure"
    life = Quantity("cycles until the first neck fails", "", ("model",), Gate(0.05))
    fewest = Quantity("fewest cycles by the uncertainty of the stress", "", ("model",), Gate(0.1))
    most = Quantity("most cycles by the uncertainty of the stress", "", ("model",), Gate(0.1))
    safety = Quantity("yield strength over the highest stress", "", ("model",), STRESS)
    factor = Quantity("factor on the amplitude for the wanted life", "", ("model",), STRESS)
    peak_at_largest = Quantity("highest stress for the wanted life", "mpa", ("model",), STRESS)
    equivalent = Quantity("equivalent fully reversed stress", "mpa", NECK, STRESS, "all")
    peak = Quantity("largest magnitude of the stress", "mpa", NECK, STRESS, "all")
    amplitude = Quantity("amplitude of the stress", "mpa", NECK, STRESS, "all", shown=False)
    mean = Quantity("mean of the stress", "mpa", NECK, STRESS, "all", shown=False)
    cycles = Quantity("cycles to failure of each neck", "", NECK, Gate(0.05), shown=False)
    largest = Quantity("amplitude for the wanted life", "motion", ("model", "direction"), STRESS)


def by_wrenches(
    designs: Designs,
    wrench: Wrench,
    motion: CyclicMotion,
) -> StressCycles:
    """Return the stress at both sides of every neck of n designs.

    wrench : (n, 3, 3, 3), of the necks.
    """
    bending, along = strength.surface_stress(
        wrench, designs.neck, designs.thickness, stress_raised(designs)
    )
    sides = np.stack([along + bending, along - bending], axis=3).reshape(len(along), 18, 3)
    part = strength.fatigue_fraction(designs.neck / designs.radius, motion.sensitivity)
    counted = part.reshape(-1, 9).repeat(2, axis=1)
    necks = np.repeat(np.arange(9), 2)
    return StressCycles(necks, np.abs(sides @ motion.amplitude), sides @ motion.mean, counted)


def by_model(
    stage: Stage,
    result: AnalyticResult,
    motion: CyclicMotion,
) -> StressCycles:
    """Return the stress at both sides of every neck by the analytic model."""
    cycles = by_wrenches(
        design_arrays(stage), Wrench(*(part[None] for part in result.wrench)), motion
    )
    return StressCycles(cycles.hinge, *(part[0] for part in cycles[1:]))


def element_values(
    stage: Stage,
    response: Response,
    motion: CyclicMotion,
) -> StressCycles:
    """Return the stress at the nodes of every notch by plane finite elements."""
    out_of_plane = stage.layout.out_of_plane
    stiffness = np.linalg.inv(response.compliance)
    design = design_arrays(stage)
    shares = strength.fatigue_fraction(design.neck[0] / design.radius[0], motion.sensitivity)
    loads = np.array([motion.amplitude, motion.mean]) @ stiffness.T
    notches = list[StressCycles]()
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        amplitude, mean = von_mises(stress, out_of_plane)
        sign = np.sign(np.trace(stress[1], axis1=1, axis2=2))
        neck = np.full(len(mean), 3 * chain + hinge)
        counted = np.full(len(mean), shares[chain, hinge])
        notches.append(StressCycles(neck, amplitude, sign * mean, counted))
    return StressCycles(*(np.concatenate(column) for column in zip(*notches, strict=True)))


class Lives(NamedTuple):
    """Lives of n designs.

    cycles : (n,), at the amplitude.   largest : (n, 3), amplitude for the wanted life, mm, mm, rad.
    safety : (n,), yield strength over the largest stress at a neck.
    """

    cycles: Array
    largest: Array
    safety: Array


def lives(
    cycles: StressCycles, fatigue: Array, yield_strength: Array, motion: CyclicMotion
) -> Lives:
    """Return the lives of n designs whose mean scales with the amplitude.

    fatigue : (n, 3), as in `Designs.fatigue`.   yield_strength : (n,), MPa.
    """
    coefficient, exponent, walker = fatigue.T
    law = Basquin(coefficient, exponent)
    highest = np.max(cycles.equivalent(walker[:, None]), axis=-1)
    factor = law.amplitude(motion.cycles) / highest
    safety = yield_strength / np.max(cycles.peak, axis=-1)
    return Lives(law.cycles(highest), factor[:, None] * np.abs(motion.amplitude), safety)


def preload_warnings(stage: Stage) -> list[str]:
    """Warn that lives exclude preloads which stress the necks, those of single stacks."""
    unbalanced = any(actuator.preload and not actuator.pair for actuator in stage.actuator)
    return ["this life excludes the mean stress by preloads of single stacks"] * unbalanced


def life(
    stage: Stage,
    *,
    amplitude: tuple[float, float, float],
    mean: tuple[float, float, float] | None = None,
    ratio: float | None = None,
    cycles: float = 1e6,
    fit: Path | None = None,
    law: Basquin | BasquinFit | None = None,
    notch_sensitivity: float = 1.0,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    progress: Progress | None = None,
) -> StageLife:
    """Return the lives of the necks of a stage. Raises BadInput, ComputationFailed."""
    mesh = answers.mesh_of(stage, models, resolution)
    motion = checked_motion(amplitude, mean, ratio, cycles, notch_sensitivity)
    asked = Fatigue(motion, *chosen_law(stage, fit, law), stage.material)
    warnings = _of_numbers(stage)
    chosen = answers.chosen(stage, analytic, warnings, models)
    found = dict[str, ModelAnswer]()
    if models != "elements":
        found[ANALYTIC] = _by_model(asked, chosen)
    if mesh is not None:
        found[ELEMENTS] = _by_elements(asked, stage, mesh, progress)
    farthest = np.abs(motion.mean) + np.abs(motion.amplitude)
    warnings += asked.warnings(found)
    warnings += warning.of_motion(stage, farthest, "farthest pose")
    warnings += preload_warnings(stage)
    settings = asked.settings | {
        "notch sensitivity": motion.sensitivity,
        "analytic model": None if models == "elements" else chosen.name,
    }
    return setup.result_of(
        StageLife,
        answers.about(stage),
        found,
        mesh,
        settings,
        warnings=warnings,
        notes=[*asked.notes, LEFT_OUT],
    )


def _of_numbers(stage: Stage) -> list[str]:
    """Warn of numbers of the file that are implausible, and of assumed ones of the material."""
    assumed = [key for key in stage.assumed if key.startswith("material.")]
    return [*warning.of_numbers(stage), *(f"{key} is {stage.sources[key]}" for key in assumed)]


def _by_model(asked: Fatigue, chosen: ModelChoice) -> ModelAnswer:
    """Return the values of the analytic model, with the cycles by the error of its stress."""
    values = asked.values(by_model(chosen.stage, analyse(*chosen), asked.motion), 3, 3)
    excess = warning.stress_above(chosen.formula, chosen.links, chosen.stage.model)
    low = high = math.nan
    if excess is not None and chosen.formula == CALIBRATED:
        # outside the chart of the calibrated hinges no comparison was made
        least, most = excess
        low = 1 / (1 + most / 100) - 1
        high = 1 / (1 + least / 100) - 1
    return ModelAnswer(values | _within(asked.law, values, low, high))


def _by_elements(
    asked: Fatigue, stage: Stage, mesh: setup.Mesh, progress: Progress | None
) -> ModelAnswer:
    """Return the values of plane finite elements, with the cycles by the bands of their stress."""

    def on_mesh(resolution: int, _: int) -> plates.Values:
        return asked.values(element_values(stage, solved(stage, resolution), asked.motion), 3, 3)

    values, bands = answers.element_values(mesh, on_mesh, progress, _bands)[ELEMENTS]
    share = np.nanmax(bands["equivalent"]) / np.max(values["equivalent"])
    return ModelAnswer(values | _within(asked.law, values, -share, share), bands)


def _within(
    law: Basquin,
    values: Mapping[str, Any],
    low: float,
    high: float,
) -> dict[str, Array]:
    """Return the fewest and most cycles for relative errors of the stress from `low` to `high`."""
    ends = np.maximum(1 + np.array([high, low]), 0.0) * np.max(values["equivalent"])
    fewest, most = law.cycles(ends)
    return {"fewest": fewest, "most": most}


def _bands(
    sizes: Array, each: list[plates.Values], ends: Sequence[plates.Values]
) -> dict[str, Array]:
    """Return the band of the highest stress alone."""
    stresses = np.array([one["equivalent"] for one in each])
    band = stress_bands(sizes, np.max(stresses, axis=(1, 2)))
    return {"equivalent": np.where(is_largest(stresses[-1]), band, np.nan)}
