"""Fatigue: cycles to failure of the necks at an amplitude of the platform, and the amplitude for a
wanted life.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from flexfem import arguments
from flexfem.analytic.strokes import Displaced
from flexfem.arrays import Array, Index, is_largest
from flexfem.fem.elements import von_mises
from flexfem.fem.response import Response
from flexfem.files.refusals import one_line, place_of
from flexfem.files.toml import read_csv
from flexfem.hinges import strength
from flexfem.hinges.strength import Basquin, BasquinFit, Wrench, equivalent
from flexfem.mechanism.content import located
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, Material, unlikely
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.designs import Designs, lower
from flexfem.paper.fields import notch_fields
from flexfem.paper.model import CALIBRATED, AnalyticResult, analyse, stress_raised
from flexfem.paper.stage import Stage
from flexfem.questions import finite, plates, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import stress_bands
from flexfem.questions.setup import DEFAULT, Analytic, ModelAnswer, Models, for_mechanisms
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, ELEMENTS, SOLID, STRESS, Gate, Progress, Quantity, Result
from flexfem.units import COMMANDS, short

LARGEST_FACTOR = 1e9  # largest multiple of the amplitude in the search for a life
LARGEST_POSE = 1e2  # mm, rad
LARGEST_LIFE = 1e12  # cycles; a thousand years at 30 Hz
NECK = ("model", "chain", "hinge")
COLUMNS = ["stress_mpa", "cycles"]
LEFT_OUT = (
    "life: median of polished specimens; it excludes scatter, surface, size, residual stress, "
    "corrosion and stress across the plane"
)


class CyclicMotion(NamedTuple):
    """Cyclic motion of the platform: amplitude and mean pose (3,), mm, mm, rad.

    proportional : whether the mean scales with the amplitude.   cycles : wanted life.   sensitivity
    : notch, 0 to 1."""

    amplitude: Array
    mean: Array
    proportional: bool
    cycles: float
    sensitivity: float = 1.0


def cyclic_motion(
    amplitude: Array, mean: Array | None, ratio: float, cycles: float, sensitivity: float = 1.0
) -> CyclicMotion:
    """Return a cyclic motion of amplitude (3,) about a mean (3,), or with a ratio of least to
    greatest displacement.
    """
    if mean is None:
        return CyclicMotion(
            amplitude, amplitude * (1.0 + ratio) / (1.0 - ratio), True, cycles, sensitivity
        )
    return CyclicMotion(amplitude, mean, not mean.any(), cycles, sensitivity)


class StressCycles(NamedTuple):
    """Cyclic stress at p points: neck (p,), from 0 to 8, chain by chain; amplitude and mean (...,
    p), MPa.

    counted : (..., p), share of the stress that counts for fatigue.   Leading axes are designs.
    Stresses are von Mises stresses; the mean has the sign of the stress along the surface. The
    surface of a notch is free, so in plane stress the stress there is uniaxial and equals the
    highest principal stress in magnitude."""

    neck: Index
    amplitude: Array
    mean: Array
    counted: Array

    def times(self, factor: float, proportional: bool) -> StressCycles:
        """Return the stress for a multiple of the amplitude, whose mean scales only if
        proportional.
        """
        mean = self.mean * factor if proportional else self.mean
        return self._replace(amplitude=factor * self.amplitude, mean=mean)

    def equivalent(self, walker: float | Array) -> Array:
        """Fully reversed amplitude (..., p) of equal life by Walker's exponent, or by exponents
        (..., 1) of designs.
        """
        return self.counted * equivalent(self.amplitude, self.mean, walker)

    @property
    def peak(self) -> Array:
        """Largest magnitude of the stress (..., p)."""
        return np.asarray(np.abs(self.mean) + self.amplitude)


def by_wrenches(designs: Designs, wrench: Wrench, motion: CyclicMotion) -> StressCycles:
    """Return the stress at both sides of every neck of n designs from the wrenches (n, 3, 3, 3) of
    the necks.
    """
    bending, along = strength.surface_stress(
        wrench, designs.neck, designs.thickness, stress_raised(designs)
    )
    sides = np.stack([along + bending, along - bending], axis=3).reshape(len(along), 18, 3)
    part = (
        strength.fatigue_fraction(designs.neck / designs.radius, motion.sensitivity)
        .reshape(-1, 9)
        .repeat(2, axis=1)
    )
    return StressCycles(
        np.repeat(np.arange(9), 2), np.abs(sides @ motion.amplitude), sides @ motion.mean, part
    )


def by_model(stage: Stage, result: AnalyticResult, motion: CyclicMotion) -> StressCycles:
    """Return the stress at both sides of every neck by the analytic model."""
    cycles = by_wrenches(lower(stage), Wrench(*(part[None] for part in result.wrench)), motion)
    return StressCycles(cycles.neck, *(part[0] for part in cycles[1:]))


def by_elements(stage: Stage, response: Response, motion: CyclicMotion) -> StressCycles:
    """Return the stress at the nodes of every notch by plane finite elements."""
    out_of_plane = stage.layout.out_of_plane
    stiffness = np.linalg.inv(response.compliance)
    design = lower(stage)
    shares = strength.fatigue_fraction(design.neck[0] / design.radius[0], motion.sensitivity)
    loads = np.array([motion.amplitude, motion.mean]) @ stiffness.T
    notches = []
    for (chain, hinge), stress in notch_fields(stage, response, loads):
        amplitude, mean = von_mises(stress, out_of_plane)
        sign = np.sign(np.trace(stress[1], axis1=1, axis2=2))
        necks = np.full(len(mean), 3 * chain + hinge)
        notches.append(
            StressCycles(necks, amplitude, sign * mean, np.full(len(mean), shares[chain, hinge]))
        )
    return StressCycles(*(np.concatenate(column) for column in zip(*notches, strict=True)))


class Lives(NamedTuple):
    """Lives of n designs: cycles (n,) at the amplitude, largest amplitude (n, 3) for the wanted
    life, mm, mm, rad, and safety (n,), yield strength over the largest stress at a neck."""

    cycles: Array
    largest: Array
    safety: Array


def lives(
    cycles: StressCycles, fatigue: Array, yield_strength: Array, motion: CyclicMotion
) -> Lives:
    """Return the lives of n designs whose mean scales with the amplitude; fatigue (n, 3) as in
    `Designs.fatigue`.
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


def factor_at(stress: StressCycles, law: Basquin, life: float, proportional: bool) -> float:
    """Return the factor on the amplitude for a life, in cycles, of the first neck; inf if no stress
    is tensile.
    """
    target = float(law.amplitude(life))

    def excess(factor: float) -> float:
        return float(np.max(stress.times(factor, proportional).equivalent(law.walker))) - target

    limited = excess(LARGEST_FACTOR) >= 0
    return (
        float(brentq(excess, 0.0, LARGEST_FACTOR, xtol=1e-14, rtol=1e-13)) if limited else math.inf
    )


class Life(Result):
    """Cycles to failure of the necks, and the amplitude for a wanted life."""

    title = "fatigue life"
    main = ("life", {})
    figure = "life.life_figure"
    life = Quantity("cycles until the first neck fails", "", ("model",), Gate(0.05))
    fewest = Quantity(
        "fewest cycles by the uncertainty of the stress", "", ("model",), Gate(0.1), only="stage"
    )
    most = Quantity(
        "most cycles by the uncertainty of the stress", "", ("model",), Gate(0.1), only="stage"
    )
    safety = Quantity("yield strength over the highest stress", "", ("model",), STRESS)
    factor = Quantity("factor on the amplitude for the wanted life", "", ("model",), STRESS)
    peak_at_largest = Quantity("highest stress at that amplitude", "mpa", ("model",), STRESS)
    equivalent = Quantity("equivalent fully reversed stress", "mpa", NECK, STRESS, "all")
    peak = Quantity("largest magnitude of the stress", "mpa", NECK, STRESS, "all")
    amplitude = Quantity("amplitude of the stress", "mpa", NECK, STRESS, "all", shown=False)
    mean = Quantity("mean of the stress", "mpa", NECK, STRESS, "all", shown=False)
    cycles = Quantity("cycles to failure of each neck", "", NECK, Gate(0.05), shown=False)
    largest = Quantity("amplitude for the wanted life", "motion", ("model", "direction"), STRESS)
    law: Basquin  # for figures, as is the yield strength, MPa
    yield_strength: float


class MechanismLife(Life, mechanism=True):
    """Cycles to failure of the hinges of a mechanism, and the amplitude for a wanted life."""

    reading = (
        "the highest stress of a hinge in the mean pose counts as tension, which is conservative",
        "analytic, elastic bodies: linear theory; other models: at finite displacement",
    )


class Fatigue(NamedTuple):
    """A checked question: motion of the platform, Basquin's law, notes on its source, and the
    material.
    """

    motion: CyclicMotion
    law: Basquin
    notes: list[str]
    material: Material

    @property
    def settings(self) -> dict[str, str]:
        """Material and motion as settings of a result."""
        poses = {"amplitude": self.motion.amplitude, "about": self.motion.mean}
        texts = {
            name: ", ".join(
                f"{value * unit.factor:z.5g} {unit.plain}"
                for value, unit in zip(pose, COMMANDS, strict=True)
            )
            for name, pose in poses.items()
        }
        return {"material": self.material.name, **texts, "wanted cycles": short(self.motion.cycles)}

    def values(self, stress: StressCycles, *shape: int) -> dict[str, Any]:
        """Return the values of one model; shape : of those of necks."""
        motion = self.motion
        law = self.law
        equivalent = stress.equivalent(self.law.walker)
        peak = stress.peak
        necks = [np.flatnonzero(stress.neck == neck) for neck in np.unique(stress.neck)]
        critical = [points[np.argmax(equivalent[points])] for points in necks]
        by_neck = {
            "amplitude": stress.amplitude[critical],
            "mean": stress.mean[critical],
            "peak": np.array([np.max(peak[points]) for points in necks]),
            "equivalent": equivalent[critical],
            "cycles": law.cycles(equivalent[critical]),
        }
        factor = factor_at(stress, law, motion.cycles, motion.proportional)
        limited = np.isfinite(factor)
        return {name: values.reshape(shape) for name, values in by_neck.items()} | {
            "life": float(law.cycles(np.max(equivalent))),
            "safety": self.material.yield_strength / float(np.max(peak)),
            "factor": factor,
            "peak_at_largest": np.max(stress.times(factor, motion.proportional).peak)
            if limited
            else math.nan,
            "largest": factor * motion.amplitude if limited else np.full(3, math.inf),
        }

    def within(self, values: Mapping[str, Any], low: float, high: float) -> dict[str, Array]:
        """Return the fewest and most cycles for relative errors of the stress from `low` to `high`."""
        ends = np.maximum(1 + np.array([high, low]), 0.0) * np.max(values["equivalent"])
        return dict(zip(("fewest", "most"), self.law.cycles(ends), strict=True))

    @property
    def ends(self) -> Array:
        """The poses (2, 3) between which the platform moves."""
        return self.motion.mean + np.array([[1.0], [-1.0]]) * self.motion.amplitude

    def of_ports(
        self, response: plates.Responses, changes: Sequence[Displaced] | None = None
    ) -> dict[str, Any]:
        """Return the values of one model of a mechanism: linear theory, and changes at both ends of
        the motion.

        Stress that a finite displacement adds is that of stretched hinges, which has the same sign
        at both ends: it counts as mean stress. Stress that it takes away is taken from the
        amplitude."""
        poses = np.array([self.motion.amplitude, self.motion.mean])
        forces = poses @ np.linalg.inv(response.compliance[:3, :3])
        varying, constant = response.stress(forces @ np.eye(3, len(response.compliance)))
        if changes is not None:
            change = np.max([one.stress for one in changes], axis=0)
            constant = constant + np.maximum(change, 0.0)
            varying = np.maximum(varying + np.minimum(change, 0.0), 0.0)
        return self.values(
            StressCycles(np.arange(len(varying)), varying, constant, np.ones(len(varying))), -1
        )

    def warnings(self, models: Mapping[str, ModelAnswer]) -> list[str]:
        """Warn of lives outside the range of Basquin's law: above yield, or outside the fitted
        range of cycles.
        """
        low, high = self.law.range
        limit = self.material.yield_strength
        wanted = self.motion.cycles
        messages = []
        beyond = f"beyond the yield strength of {limit:.4g} MPa"
        for model, (values, _) in models.items():
            if values["safety"] < 1.0:
                highest = (
                    f"{model}: the largest stress is {limit / values['safety']:.4g} MPa, {beyond}"
                )
                messages.append(f"{highest}: the life by elastic stress is not valid")
            if values["peak_at_largest"] > limit:
                where = (
                    f"{model}: at the amplitude for {short(wanted)} cycles the largest stress is"
                )
                messages.append(
                    f"{where} {values['peak_at_largest']:.4g} MPa, {beyond}: yield limits the "
                    "amplitude"
                )
            for subject, cycles in (
                (f"{model}: the life", values["life"]),
                ("the wanted life", wanted),
            ):
                if np.isfinite(cycles) and not low <= cycles <= high:
                    extrapolated = f"is extrapolated: the law covers {short(low)} to {short(high)}"
                    messages.append(f"{subject} of {short(cycles, '.3g')} cycles {extrapolated}")
        return messages


def _hinge_bands(
    sizes: Array, each: list[plates.Values], ends: Sequence[plates.Values]
) -> dict[str, Array]:
    return {"equivalent": stress_bands(sizes, np.array([one["equivalent"] for one in each]))}


def _highest_bands(
    sizes: Array, each: list[plates.Values], ends: Sequence[plates.Values]
) -> dict[str, Array]:
    stresses = np.array([one["equivalent"] for one in each])
    band = stress_bands(sizes, np.max(stresses, axis=(1, 2)))
    return {"equivalent": np.where(is_largest(stresses[-1]), band, np.nan)}


@for_mechanisms(Life, MechanismLife, not_for="notch_sensitivity analytic", only_for="plane")
def life(
    stage: Mechanism,
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
    plane: bool = False,
    progress: Progress | None = None,
) -> Life | MechanismLife:
    """Cycles to failure of the hinges of a stage or mechanism at an amplitude, and the amplitude
    for a wanted life.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    amplitude : tuple of float
        Amplitude of the pose of the platform about its mean: mm, mm, rad; the pose is imposed in
        all directions.
    mean : tuple of float, optional
        Mean of the pose: mm, mm, rad.
    ratio : float, optional
        Ratio of least to greatest displacement, instead of a mean, from -1 to 0.99; by default -1,
        fully reversed. The mean then scales with the amplitude for the wanted life.
    cycles : float
        The wanted life.
    fit : path, optional
        CSV file of S-N points with columns stress_mpa and cycles, to which the law is fitted.
    law : Basquin or BasquinFit, optional
        Basquin's law instead of that of the material.
    notch_sensitivity : float
        Notch sensitivity q from 0 to 1: fatigue uses the share (1 + q (K - 1)) / K of the stress at
        a notch of concentration K, yield uses all of it. Of a stage file only.
    models : {"both", "analytic", "elements"}
        The models to compute.
    analytic : Analytic
        The analytic model. Of a stage file only.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Life | MechanismLife
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        life` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> stage = flexfem.load("geometry/mobility6.toml").replace(material="al-2024-t4")
    >>> found = flexfem.life(stage, amplitude=(0.1, 0, 0), models="analytic")
    >>> f"{float(found.life[0]):.3g}"
    '1.03e+10'
    """
    setup.require_hinges(stage, "whose fatigue life is computed", "a mechanism with hinges")
    mesh = plates.mesh_of(stage, models, resolution, None)
    pose = checked_amplitude(amplitude)
    about = None
    if mean is not None:
        about = arguments.vectors("mean", mean, 1, LARGEST_POSE)
    if ratio is not None:
        arguments.between("ratio", ratio, -1, 0.99, ": least over greatest displacement")
    if mean is not None and ratio is not None:
        raise BadInput("mean and ratio, expected one of the two")
    wanted = arguments.positive("cycles", cycles, LARGEST_LIFE)
    sensitivity = arguments.between("notch_sensitivity", notch_sensitivity, 0, 1)
    motion = cyclic_motion(
        pose, about, -1.0 if ratio is None else float(ratio), wanted, sensitivity
    )
    asked = Fatigue(motion, *_law(stage, fit, law), stage.material)
    found = dict[str, ModelAnswer]()
    warnings = list[str]()
    settings = dict[str, Any](asked.settings)
    notes = [*asked.notes, LEFT_OUT]
    if isinstance(stage, MechanismFile):
        changes = finite.changes(
            stage, mesh, [finite.by_pose(stage.layout, end) for end in asked.ends]
        )
        found = _of_mechanism(stage, asked, mesh, models, changes, progress)
        warnings = [*asked.warnings(found), *_beyond_linear(changes, mesh)]
        notes += changes.notes("at the ends of the motion", mesh)
    else:
        assumed = (key for key in stage.assumed if key.startswith("material."))
        warnings = [
            *warning.of_numbers(stage),
            *(f"{key} is {stage.sources[key]}" for key in assumed),
        ]
        chosen = analytic.chosen(stage, warnings, models)
        settings |= {
            "notch sensitivity": sensitivity,
            "analytic model": None if models == "elements" else chosen.name,
        }
        if models != "elements":
            excess = warning.stress_above(chosen.formula, chosen.links, chosen.stage.model)
            error = (math.nan, math.nan)
            if (
                excess is not None and chosen.formula == CALIBRATED
            ):  # outside its chart no comparison was made
                error = 1 / (1 + excess[1] / 100) - 1, 1 / (1 + excess[0] / 100) - 1
            values = asked.values(by_model(chosen.stage, analyse(*chosen), motion), 3, 3)
            found[ANALYTIC] = ModelAnswer(values | asked.within(values, *error))
        if mesh is not None:
            values, bands = plates.by_elements(
                mesh,
                lambda level, _: asked.values(
                    by_elements(stage, setup.solved(stage, level), motion), 3, 3
                ),
                progress,
                _highest_bands,
            )[ELEMENTS]
            share = np.nanmax(bands["equivalent"]) / np.max(values["equivalent"])
            found[ELEMENTS] = ModelAnswer(values | asked.within(values, -share, share), bands)
        farthest = np.abs(motion.mean) + np.abs(motion.amplitude)
        warnings += [*asked.warnings(found), *warning.of_motion(stage, farthest, "farthest pose")]
        warnings += preload_warnings(stage)
    kind: type[Life] = MechanismLife if isinstance(stage, MechanismFile) else Life
    result = setup.answer(kind, stage, found, mesh, settings, warnings=warnings, notes=notes)
    result.law = asked.law
    result.yield_strength = asked.material.yield_strength
    return result


def _of_mechanism(
    mechanism: Mechanism,
    asked: Fatigue,
    mesh: setup.Mesh | None,
    models: Models,
    changes: finite.Changes,
    progress: Progress | None,
) -> dict[str, ModelAnswer]:
    """Return the values of all models, those of finite elements at finite displacement, with bands."""

    def of_network(elastic: bool) -> plates.Values:
        return asked.of_ports(plates.network(mechanism, elastic))

    def of_size(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> plates.Values:
        label = SOLID if layers or thick is not None else ELEMENTS
        return asked.of_ports(
            plates.elements(mechanism, resolution, layers, thick), changes.of(label)
        )

    found = plates.by_models(mechanism, mesh, models, of_network, of_size, progress, _hinge_bands)
    for label, (values, bands) in found.items():
        if "equivalent" not in bands:
            continue
        error = (
            np.nan if changes.failure else np.max([one.stress for one in changes.errors()], axis=0)
        )
        found[label] = ModelAnswer(values, {**bands, "equivalent": bands["equivalent"] + error})
    return found


def _beyond_linear(changes: finite.Changes, mesh: setup.Mesh | None) -> list[str]:
    """Warn of numbers by linear theory, and of the amplitude for the wanted life, which is in
    proportion.
    """
    texts = changes.warnings("at the ends of the motion", mesh)
    if any(abs(one.stress) > finite.WORTH_A_WARNING for one in changes.each):
        texts.append(
            "the stress is not proportional to the amplitude, from which the amplitude for the "
            "wanted life is scaled: ask again with the latter as --amplitude"
        )
    return texts


def checked_amplitude(amplitude: ArrayLike) -> Array:
    """Return an amplitude (3,) of the platform, mm, mm, rad. Raises BadInput if it is invalid or
    zero.
    """
    pose = arguments.vectors("amplitude", amplitude, 1, LARGEST_POSE)
    if not pose.any():
        raise BadInput("amplitude: expected a motion, not zero in all directions")
    return pose


def _law(
    stage: Mechanism, fit: Path | None, law: Basquin | BasquinFit | None
) -> tuple[Basquin, list[str]]:
    """Return Basquin's law, and notes on its source and on the fit. Raises BadInput."""
    if fit is not None and law is not None:
        raise BadInput("fit and law, expected one of the two")
    source = "given in Python"
    notes = list[str]()
    if fit is not None:
        points = _read_points(fit)
        try:
            law = strength.fit_basquin(*points)
        except BadInput as error:
            raise BadInput(f"{fit}: {error}") from None
        source = f"fitted to the points of {fit}"
        notes = [_described_fit(law)]
    if law is None:
        with located(stage):
            chosen = strength.required_law(stage.material, ", or a fit of S-N points")
        source = stage.sources.get(strength.KEY) or "not stated"
    else:
        chosen = strength.checked_law(law)
    if unlikely(chosen.coefficient, stage.material.yield_strength):
        expected = UNLIKELY.format(
            *STRENGTHS, f"the yield strength of {stage.material.yield_strength:g} MPa"
        )
        raise BadInput(f"law: coefficient {chosen.coefficient:.4g} MPa, expected {expected}")
    rule = "Smith, Watson and Topper" if chosen.walker == 0.5 else f"Walker, {chosen.walker:g}"
    description = (
        f"Basquin's law, {chosen.coefficient:g} MPa, exponent {chosen.exponent:g}, for "
        f"{_of_cycles(chosen.range)}{'' if chosen.range_stated else ', assumed'}; mean stress by "
        f"{rule}; {source}"
    )
    return chosen, [description, *notes]


def _of_cycles(ends: tuple[float, float]) -> str:
    return f"{short(ends[0], '.4g')} to {short(ends[1], '.4g')} cycles"


def _described_fit(law: BasquinFit) -> str:
    """Describe a fitted law and its intervals."""
    coefficient, exponent = (
        f"{law.confidence:g} % interval {interval[0]:.4g} to {interval[1]:.4g}"
        if interval
        else f"no {law.confidence:g} % interval: life may not fall with stress"
        for interval in (law.coefficient_interval, law.exponent_interval)
    )
    return (
        f"fit through {law.points} points from {_of_cycles(law.range)}, sigma_a = sigma'_f (2 "
        f"N)^b = A N^b: sigma'_f = {law.coefficient:.5g} MPa, {coefficient}; b = "
        f"{law.exponent:.4g}, {exponent}; A = {law.A:.5g} MPa; standard deviation of log10 N "
        f"{law.scatter:.3g}"
    )


def _read_points(path: Path) -> Array:
    """Return stresses, MPa, and cycles (2, n) of a CSV file of S-N points. Raises BadInput, naming
    file and line.
    """
    rows = read_csv(path, COLUMNS)
    for (line, row), key in product(rows.items(), COLUMNS):
        with suppress(ValueError):
            if 0 < float(row[key]) < math.inf:
                continue
        raise BadInput(
            f"{place_of(path, line)}: {key} = {one_line(row[key], 60)}, expected a number above 0"
        )
    return np.array([[float(row[key]) for row in rows.values()] for key in COLUMNS])
