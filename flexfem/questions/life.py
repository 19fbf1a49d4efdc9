"""Fatigue: cycles that the necks bear at an amplitude of the platform, and the amplitude for a wanted life."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from flexfem import arguments
from flexfem.analytic.model import CALIBRATED, AnalyticResult, analyse
from flexfem.arrays import Array, Index, is_largest
from flexfem.fem.elements import von_mises
from flexfem.fem.fields import notch_fields
from flexfem.fem.response import Response
from flexfem.fem.structure import out_of_plane_ratio_of
from flexfem.files.refusals import one_line, place_of
from flexfem.files.toml import read_csv
from flexfem.hinges import strength
from flexfem.hinges.strength import Basquin, BasquinFit, Wrench, equivalent
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.drives import contacts
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import located
from flexfem.questions import warnings as warning
from flexfem.questions.bands import levels, stress_bands
from flexfem.questions.setup import DEFAULT, Analytic, ModelAnswer, Models, answer, mesh_of, on_meshes, question, solved
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, ELEMENTS, STRESS, Gate, Progress, Quantity, Result
from flexfem.units import COMMANDS

LARGEST_FACTOR = 1e9  # by which an amplitude is multiplied in search of a life
LARGEST_POSE = 1e2  # mm, rad
LARGEST_LIFE = 1e12  # cycles; a thousand years at 30 Hz
NECK = ("model", "chain", "hinge")
COLUMNS = ["stress_mpa", "cycles"]
LEFT_OUT = (
    "life: a median of polished specimens; scatter, surface, size, residual stress, corrosion and stress across the "
    "plane are not in it"
)


class Repeated(NamedTuple):
    """What the platform repeats: amplitude and mean pose (3,), mm, mm, rad; whether the mean grows with it.

    wanted : life, cycles.   sensitivity : of notches, from 0 to 1.
    """

    amplitude: Array
    mean: Array
    proportional: bool
    wanted: float
    sensitivity: float = 1.0


def repeated(amplitude: Array, mean: Array | None, ratio: float, wanted: float, sensitivity: float = 1.0) -> Repeated:
    """A motion of an amplitude (3,) about a mean (3,), or with a ratio of its least to its greatest displacement."""
    if mean is None:
        return Repeated(amplitude, amplitude * (1.0 + ratio) / (1.0 - ratio), True, wanted, sensitivity)
    return Repeated(amplitude, mean, not mean.any(), wanted, sensitivity)


class Strained(NamedTuple):
    """Points at the necks: neck (p,), from 0 to 8, chain by chain; amplitude and mean (..., p) of the stress, MPa.

    counted : (..., p), part of the stress that counts for fatigue.   Leading axes are designs.
    Stress is von Mises', the mean with the sign of the stress along the surface. The surface of a notch is free, so
    that the stress there is uniaxial, and the highest principal stress in plane stress.
    """

    neck: Index
    amplitude: Array
    mean: Array
    counted: Array

    def times(self, factor: float, proportional: bool) -> Strained:
        """With the amplitude multiplied, the mean too or not."""
        mean = self.mean * factor if proportional else self.mean
        return self._replace(amplitude=factor * self.amplitude, mean=mean)

    def equivalent(self, walker: float | Array) -> Array:
        """Fully reversed amplitude (..., p) of the same life by Walker's exponent, or one a design (..., 1)."""
        return self.counted * equivalent(self.amplitude, self.mean, walker)

    @property
    def peak(self) -> Array:
        """Largest magnitude of the stress (..., p)."""
        return np.asarray(np.abs(self.mean) + self.amplitude)


def by_wrenches(designs: Designs, wrench: Wrench, of: Repeated) -> Strained:
    """Both sides of every neck of n designs, by what the necks carry (n, 3, 3, 3)."""
    bending, along = strength.surface_stress(wrench, designs.neck, designs.thickness, strength.stress_raised(designs))
    sides = np.stack([along + bending, along - bending], axis=3).reshape(len(along), 18, 3)
    part = strength.fatigue_fraction(designs.neck / designs.radius, of.sensitivity).reshape(-1, 9).repeat(2, axis=1)
    return Strained(np.repeat(np.arange(9), 2), np.abs(sides @ of.amplitude), sides @ of.mean, part)


def by_model(stage: Stage, result: AnalyticResult, of: Repeated) -> Strained:
    """Both sides of every neck, by the analytic model."""
    found = by_wrenches(lower(stage), Wrench(*(part[None] for part in result.wrench)), of)
    return Strained(found.neck, *(part[0] for part in found[1:]))


def by_elements(stage: Stage, response: Response, of: Repeated) -> Strained:
    """The nodes in every notch, by finite elements in the plane."""
    pull, stiffness, design = out_of_plane_ratio_of(stage), np.linalg.inv(response.compliance), lower(stage)
    part = strength.fatigue_fraction(design.neck[0] / design.radius[0], of.sensitivity)
    loads = np.array([of.amplitude, of.mean]) @ stiffness.T
    parts = []
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        amplitude, mean = von_mises(stress, pull)
        sign = np.sign(np.trace(stress[1], axis1=1, axis2=2))
        place = np.full(len(mean), 3 * chain + hinge)
        parts.append(Strained(place, amplitude, sign * mean, np.full(len(mean), part[chain, hinge])))
    return Strained(*(np.concatenate(column) for column in zip(*parts, strict=True)))


class Lives(NamedTuple):
    """Of n designs: cycles (n,) at the amplitude, the size (n, 3) of that for the wanted life, mm, mm, rad, and safety
    (n,), yield strength over the largest stress at a neck."""

    cycles: Array
    largest: Array
    safety: Array


def lives(of: Strained, fatigue: Array, yield_strength: Array, motion: Repeated) -> Lives:
    """Lives of n designs whose mean grows with the amplitude, by their constants (n, 3) as of `Designs.fatigue`."""
    coefficient, exponent, walker = fatigue.T
    law, highest = Basquin(coefficient, exponent), np.max(of.equivalent(walker[:, None]), axis=-1)
    factor = law.amplitude(motion.wanted) / highest
    return Lives(
        law.cycles(highest),
        factor[:, None] * np.abs(motion.amplitude),
        yield_strength / np.max(of.peak, axis=-1),
    )


def of_preloads(stage: Stage) -> list[str]:
    """Of preloads that stress the necks, which those of pairs do not: that no life counts them."""
    if all(len(contacts(stage, 1, k)) == 2 or not one.preload for k, one in enumerate(stage.actuator)):
        return []
    return ["the mean stress by preloads of single stacks is not in this life"]


def factor_at(of: Strained, law: Basquin, cycles: float, proportional: bool) -> float:
    """By what the amplitude may be multiplied for a life of `cycles` at the first neck; inf where none is pulled."""
    wanted = float(law.amplitude(cycles))
    if proportional:
        highest = float(np.max(of.equivalent(law.walker)))
        return wanted / highest if highest > 0 else float("inf")

    def beyond(factor: float) -> float:
        return float(np.max(of.times(factor, False).equivalent(law.walker))) - wanted

    end = 1.0
    while beyond(end) < 0 and end < LARGEST_FACTOR:
        end *= 2.0
    return float(brentq(beyond, 0.0, end, xtol=1e-14, rtol=1e-13)) if end < LARGEST_FACTOR else float("inf")


class Life(Result):
    """Cycles to failure of the necks, and the amplitude for a wanted life."""

    title = "fatigue life"
    figure = "experiment.life_figure"
    life = Quantity("cycles of the neck that fails first", "", ("model",), Gate(0.05))
    fewest = Quantity("cycles by the uncertainty of the stress, from", "", ("model",), Gate(0.1))
    most = Quantity("to", "", ("model",), Gate(0.1))
    safety = Quantity("yield strength over the highest stress", "", ("model",), STRESS)
    factor = Quantity("times the amplitude for the wanted life", "", ("model",), STRESS)
    peak_at_largest = Quantity("highest stress there", "mpa", ("model",), STRESS)
    equivalent = Quantity("fully reversed stress", "mpa", NECK, STRESS, "all", largest=("chain", "hinge"))
    peak = Quantity("largest magnitude of the stress", "mpa", NECK, STRESS, "all", largest=("chain", "hinge"))
    amplitude = Quantity("amplitude of the stress", "mpa", NECK, STRESS, "all", shown=False)
    mean = Quantity("mean of the stress", "mpa", NECK, STRESS, "all", shown=False)
    cycles = Quantity("cycles of each neck", "", NECK, Gate(0.05), shown=False)
    largest = Quantity("amplitude for the wanted life", "motion", ("model", "direction"), STRESS, prefixed=True)
    law: Basquin  # for figures, as is the yield strength, MPa
    yield_strength: float


@question
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
) -> Life:
    """Cycles to failure of the necks at an amplitude of the platform, and the amplitude for a wanted life.

    Parameters
    ----------
    amplitude : tuple of float
        Amplitude of the platform's pose about its mean: mm, mm, rad; the platform is held in all directions.
    mean : tuple of float, optional
        Mean of the pose: mm, mm, rad.
    ratio : float, optional
        Instead of a mean, least over greatest displacement, from -1 to 0.99; -1, the default, is fully reversed. The
        mean then grows with the amplitude for the wanted life.
    cycles : float
        The wanted life.
    fit : path, optional
        CSV file of S-N points with columns stress_mpa and cycles: takes the law fitted to them.
    law : Basquin or BasquinFit, optional
        Basquin's law instead of that of the material.
    notch_sensitivity : float
        q from 0 to 1: (1 + q (K - 1)) / K of the stress at a notch of concentration K counts for fatigue, all of it for
        yield.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> stage = flexfem.load("geometry/mobility6.toml").replace(material="al-2024-t4")
    >>> found = flexfem.life(stage, amplitude=(0.1, 0, 0), models="analytic")
    >>> f"{float(found.life[0]):.3g}"
    '1.03e+10'
    """
    check_feasible(stage)
    mesh = mesh_of(models, resolution, None)
    moved = checked_amplitude(amplitude)
    middle = None if mean is None else arguments.vectors("mean", mean, 1, LARGEST_POSE)
    if ratio is not None:
        arguments.between("ratio", ratio, -1, 0.99, ": least over greatest displacement")
    if middle is not None and ratio is not None:
        raise BadInput("mean and ratio, expected one of the two")
    wanted = arguments.positive("cycles", cycles, LARGEST_LIFE)
    sensitivity = arguments.between("notch_sensitivity", notch_sensitivity, 0, 1)
    taken, notes = _law(stage, fit, law)
    motion = repeated(moved, middle, -1.0 if ratio is None else float(ratio), wanted, sensitivity)
    recalled = (key for key in stage.assumed if key.startswith("material."))
    warnings = [*warning.of_numbers(stage), *(f"{key} is {stage.sources[key]}" for key in recalled)]
    found, name = dict[str, ModelAnswer](), None
    chosen = analytic.chosen(stage, warnings, models)
    if models != "elements":
        above = warning.stress_above(chosen.formula, chosen.links, chosen.stage.model)
        error = math.nan, math.nan  # how far the true stress may be off, from and to
        if above is not None and chosen.formula == CALIBRATED:  # off its chart nothing was compared
            error = 1 / (1 + above[1] / 100) - 1, 1 / (1 + above[0] / 100) - 1
        strained, name = by_model(chosen.stage, analyse(*chosen), motion), chosen.name
        found[ANALYTIC] = ModelAnswer(_answer(stage, strained, motion, taken, error))
    if mesh is not None:
        steps = levels(mesh.resolution)
        strains = on_meshes(steps, lambda step: by_elements(stage, solved(stage, step), motion), progress)
        highest = np.array([float(np.max(each.equivalent(taken.walker))) for each in strains])
        band = float(stress_bands(np.array(steps, dtype=float), highest))
        share = band / highest[-1] if highest[-1] > 0 else 0.0
        values = _answer(stage, strains[-1], motion, taken, (-share, share))
        bands = np.where(is_largest(values["equivalent"]), band, np.nan)
        found[ELEMENTS] = ModelAnswer(values, {"equivalent": bands})
    for model, one in found.items():
        warnings += _warnings(stage, motion, taken, model, one.values)
    end = np.abs(motion.mean) + np.abs(motion.amplitude)
    warnings += [*warning.of_motion(stage, end, "farthest pose"), *of_preloads(stage)]
    settings = {
        "material": stage.material.name,
        "amplitude": _pose(motion.amplitude),
        "about": _pose(motion.mean),
        "wanted cycles": f"{wanted:g}",
        "notch sensitivity": sensitivity,
        "analytic model": name,
    }
    result = answer(Life, stage, found, mesh, settings, warnings=warnings, notes=[*notes, LEFT_OUT])
    result.law, result.yield_strength = taken, stage.material.yield_strength
    return result


def checked_amplitude(amplitude: ArrayLike) -> Array:
    """An amplitude (3,) of the platform, mm, mm, rad. Raises BadInput for anything else, and for none at all."""
    moved = arguments.vectors("amplitude", amplitude, 1, LARGEST_POSE)
    if not moved.any():
        raise BadInput("amplitude: expected a motion, not zero in all directions")
    return moved


def _law(stage: Stage, fit: Path | None, law: Basquin | BasquinFit | None) -> tuple[Basquin, list[str]]:
    """Basquin's law, and what is to be said of it and of a fit. Raises BadInput."""
    if fit is not None and law is not None:
        raise BadInput("fit and law, expected one of the two")
    source, notes = "given in Python", list[str]()
    if fit is not None:
        points = _points(fit)
        try:
            law = strength.fit_basquin(*points)
        except BadInput as refusal:
            raise BadInput(f"{fit}: {refusal}") from None
        source, notes = f"fitted to the points of {fit}", [_fit_said(law)]
    if law is None:
        with located(stage):
            taken = strength.required_law(stage.material, ", or a fit of S-N points")
        source = stage.sources.get(strength.KEY) or "not stated"
    else:
        taken = strength.checked_law(law)
    if unlikely(taken.coefficient, stage.material.yield_strength):
        expected = UNLIKELY.format(*STRENGTHS, f"the yield strength of {stage.material.yield_strength:g} MPa")
        raise BadInput(f"law: coefficient {taken.coefficient:.4g} MPa, expected {expected}")
    (low, high), stated = taken.range, "" if taken.range_stated else ", assumed"
    rule = "Smith, Watson and Topper" if taken.walker == 0.5 else f"Walker, {taken.walker:g}"
    said = (
        f"Basquin's law with {taken.coefficient:g} MPa and {taken.exponent:g}, for {low:.4g} to {high:.4g} cycles"
        f"{stated}; mean stress by {rule}; {source}"
    )
    return taken, [said, *notes]


def _answer(stage: Stage, of: Strained, motion: Repeated, law: Basquin, error: tuple[float, float]) -> dict[str, Any]:
    """The quantities of one model; the true stress may be off by `error`, from and to."""
    points, magnitudes = of.equivalent(law.walker), of.peak
    necks = [np.flatnonzero(of.neck == neck) for neck in range(9)]
    worst = np.array([here[int(np.argmax(points[here]))] for here in necks])
    stress, peak = points[worst], np.array([np.max(magnitudes[here]) for here in necks])
    highest, proportional = float(np.max(stress)), motion.proportional
    factor = factor_at(of, law, motion.wanted, proportional)
    endless = not np.isfinite(factor)
    found = {"amplitude": of.amplitude[worst], "mean": of.mean[worst], "equivalent": stress, "peak": peak}
    found["cycles"] = law.cycles(stress)
    most, fewest = (float(law.cycles(np.maximum(1 + each, 0.0) * highest)) for each in error)
    return {name: part.reshape(3, 3) for name, part in found.items()} | {
        "life": float(law.cycles(highest)),
        "fewest": fewest,
        "most": most,
        "safety": stage.material.yield_strength / float(np.max(peak)),
        "factor": factor,
        "peak_at_largest": math.nan if endless else float(np.max(of.times(factor, proportional).peak)),
        "largest": np.full(3, math.inf) if endless else factor * motion.amplitude,
    }


def _warnings(stage: Stage, motion: Repeated, law: Basquin, model: str, of: dict[str, Any]) -> list[str]:
    """Where a life is not what Basquin's law is for: beyond yield, and beyond the cycles that it was fitted to."""
    (low, high), limit, found = law.range, stage.material.yield_strength, list[str]()
    beyond = f"beyond the yield strength of {limit:.4g} MPa"
    if of["safety"] < 1.0:
        highest = f"{model}: the largest stress is {limit / of['safety']:.4g} MPa, {beyond}"
        found.append(f"{highest}: the life by elastic stress does not hold there")
    if of["peak_at_largest"] > limit:
        where = f"{model}: at the amplitude for {motion.wanted:g} cycles the largest stress is"
        found.append(f"{where} {of['peak_at_largest']:.4g} MPa, {beyond}: yield limits it")
    for what, cycles in ((f"{model}: the life", of["life"]), ("the wanted life", motion.wanted)):
        if np.isfinite(cycles) and not low <= cycles <= high:
            found.append(f"{what} of {cycles:.3g} cycles is extrapolated: the law is for {low:g} to {high:g}")
    return found


def _pose(values: Array) -> str:
    return ", ".join(f"{value * unit.factor:z.5g} {unit.plain}" for value, unit in zip(values, COMMANDS, strict=True))


def _fit_said(of: BasquinFit) -> str:
    """The fitted law with its intervals."""
    coefficient, exponent = (
        f"{of.confidence:g} % interval {ends[0]:.4g} to {ends[1]:.4g}"
        if ends
        else f"no interval: at {of.confidence:g} % life may not fall with stress"
        for ends in (of.coefficient_interval, of.exponent_interval)
    )
    return (
        f"fit through {of.points} points from {of.range[0]:.4g} to {of.range[1]:.4g} cycles, sigma_a = sigma'_f (2 N)"
        f"^b = A N^b: sigma'_f = {of.coefficient:.5g} MPa, {coefficient}; b = {of.exponent:.4g}, {exponent}; "
        f"A = {of.A:.5g} MPa; standard deviation of log10 N {of.scatter:.3g}"
    )


def _points(path: Path) -> tuple[list[float], list[float]]:
    """Stresses, MPa, and cycles of a CSV file of S-N points. Raises BadInput, naming file and line."""
    rows = read_csv(path, COLUMNS)
    for line, row in rows.items():
        for key, cell in row.items():
            try:
                possible = 0 < float(cell) < math.inf
            except ValueError:
                possible = False
            if not possible:
                raise BadInput(f"{place_of(path, line)}: {key} = {one_line(cell, 60)}, expected a number above 0")
    stress, cycles = ([float(row[key]) for row in rows.values()] for key in COLUMNS)
    return stress, cycles
