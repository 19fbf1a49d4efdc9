"""Fatigue: cycles to failure of the hinges at an amplitude of the output, and the amplitude for a
wanted life.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from flexfem import arguments
from flexfem.analytic.strokes import Displaced
from flexfem.arrays import Array, Index
from flexfem.files.refusals import one_line, place_of
from flexfem.files.toml import read_csv
from flexfem.hinges import strength
from flexfem.hinges.strength import Basquin, BasquinFit, equivalent
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, Material, unlikely
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import finite, plates, setup
from flexfem.questions.bands import stress_bands
from flexfem.questions.plates import PEAK
from flexfem.questions.setup import DEFAULT, Analytic, ModelAnswer, Models, options
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, MAGNITUDE, SOLID, Gate, Progress, Quantity, Result
from flexfem.units import COMMANDS, short

LARGEST_FACTOR = 1e9  # largest multiple of the amplitude in the search for a life
LARGEST_POSE = 1e2  # mm, rad
LARGEST_LIFE = 1e12  # cycles; a thousand years at 30 Hz
HINGES = ("model", "hinge")
COLUMNS = ("stress_mpa", "cycles")
LEFT_OUT = (
    "life: median of polished specimens; it excludes scatter, surface, size, residual stress, "
    "corrosion and stress across the plane"
)
AT_THE_ENDS = "at the ends of the motion"


class CyclicMotion(NamedTuple):
    """Cyclic motion of the output.

    amplitude, mean : poses (3,), mm, mm, rad.
    proportional : whether the mean scales with the amplitude.   cycles : wanted life.
    sensitivity : to notches, 0 to 1.
    """

    amplitude: Array
    mean: Array
    proportional: bool
    cycles: float
    sensitivity: float = 1.0


def cyclic_motion(
    amplitude: Array, mean: Array | None, ratio: float, cycles: float, sensitivity: float = 1.0
) -> CyclicMotion:
    """Return a cyclic motion of amplitude (3,) about a mean (3,).

    ratio : of least to greatest displacement, where no mean is given; the mean then scales with the
    amplitude.
    """
    if mean is not None:
        return CyclicMotion(amplitude, mean, not mean.any(), cycles, sensitivity)
    mean = amplitude * (1.0 + ratio) / (1.0 - ratio)
    return CyclicMotion(amplitude, mean, True, cycles, sensitivity)


class StressCycles(NamedTuple):
    """Cyclic stress at p points; leading axes are designs.

    Stresses are von Mises stresses; the mean has the sign of the stress along the surface. The
    surface of a notch is free, so in plane stress the stress there is uniaxial and equals the
    highest principal stress in magnitude.

    hinge : (p,), number of the hinge of each point.   amplitude, mean : (..., p), MPa.
    counted : (..., p), share of the stress that counts for fatigue.
    """

    hinge: Index
    amplitude: Array
    mean: Array
    counted: Array

    def times(
        self,
        factor: float,
        proportional: bool,
    ) -> StressCycles:
        """Return the stress for a multiple of the amplitude; the mean scales only if proportional."""
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


def factor_at(
    stress: StressCycles,
    law: Basquin,
    life: float,
    proportional: bool,
) -> float:
    """Return the factor on the amplitude for a life, in cycles, of the first hinge.

    It is infinite if no stress is tensile.
    """
    target = float(law.amplitude(life))

    def excess(factor: float) -> float:
        return float(np.max(stress.times(factor, proportional).equivalent(law.walker))) - target

    if excess(LARGEST_FACTOR) < 0:
        return math.inf
    return float(brentq(excess, 0.0, LARGEST_FACTOR, xtol=1e-14, rtol=1e-13))


class WithLaw:
    """Basquin's law and the yield strength of a result, which its settings contain."""

    settings: dict[str, Any]

    @property
    def law(self) -> Basquin:
        """Basquin's law by which the lives are computed."""
        stored = dict(self.settings["law"])
        return Basquin(**stored | {"range": tuple(stored["range"])})

    @property
    def yield_strength(self) -> float:
        """Yield strength, MPa."""
        return float(self.settings["strength"]["yield"])


class Life(WithLaw, Result):
    """Cycles to failure of the hinges of a mechanism, and the amplitude for a wanted life."""

    kind_name = "mechanism_life"
    title = "fatigue life"
    main_result = ("life", {})
    figure = "life.life_figure"
    footnotes: ClassVar[tuple[str, ...]] = (
        "the output is moved in all three directions: one of amplitude zero is held",
        "the highest stress of a hinge in the mean pose counts as tension, which is conservative",
        "analytic, elastic bodies: linear theory; other models: at finite displacement",
    )
    life = Quantity("cycles until the first neck fails", "", ("model",), Gate(0.05, MAGNITUDE))
    safety = Quantity("yield strength over the highest stress", "", ("model",), PEAK)
    factor = Quantity("factor on the amplitude for the wanted life", "", ("model",), PEAK)
    peak_at_largest = Quantity("highest stress for the wanted life", "mpa", ("model",), PEAK)
    equivalent = Quantity("equivalent fully reversed stress", "mpa", HINGES, PEAK, "all")
    peak = Quantity("largest magnitude of the stress", "mpa", HINGES, PEAK, "all")
    amplitude = Quantity("amplitude of the stress", "mpa", HINGES, PEAK, "all", shown=False)
    mean = Quantity("mean of the stress", "mpa", HINGES, PEAK, "all", shown=False)
    cycles = Quantity(
        "cycles to failure of each neck", "", HINGES, Gate(0.05, MAGNITUDE), shown=False
    )
    largest = Quantity("amplitude for the wanted life", "motion", ("model", "direction"), PEAK)


class Fatigue(NamedTuple):
    """A checked question: motion of the output, Basquin's law, notes on its source, and the
    material.
    """

    motion: CyclicMotion
    law: Basquin
    notes: list[str]
    material: Material

    @property
    def settings(self) -> dict[str, Any]:
        """Material, motion and law as settings of a result."""
        return {
            "material": self.material.name,
            "amplitude": _as_text(self.motion.amplitude),
            "about": _as_text(self.motion.mean),
            "wanted cycles": short(self.motion.cycles),
            "law": self.law._asdict() | {"range": list(self.law.range)},
            "strength": {"yield": self.material.yield_strength},
        }

    def values(self, stress: StressCycles, *shape: int) -> dict[str, Any]:
        """Return the values of one model; shape : of those of hinges."""
        motion = self.motion
        equivalent = stress.equivalent(self.law.walker)
        factor = factor_at(stress, self.law, motion.cycles, motion.proportional)
        largest = np.full(3, math.inf)
        peak_at_largest = math.nan
        if np.isfinite(factor):
            largest = factor * motion.amplitude
            peak_at_largest = np.max(stress.times(factor, motion.proportional).peak)
        by_hinge = self._by_hinge(stress, equivalent)
        return {name: values.reshape(shape) for name, values in by_hinge.items()} | {
            "life": float(self.law.cycles(np.max(equivalent))),
            "safety": self.material.yield_strength / float(np.max(stress.peak)),
            "factor": factor,
            "peak_at_largest": peak_at_largest,
            "largest": largest,
        }

    def _by_hinge(
        self,
        stress: StressCycles,
        equivalent: Array,
    ) -> dict[str, Array]:
        """Return the values of every hinge, at its point of the shortest life."""
        hinges = [np.flatnonzero(stress.hinge == number) for number in np.unique(stress.hinge)]
        critical = [points[np.argmax(equivalent[points])] for points in hinges]
        peak = stress.peak
        return {
            "amplitude": stress.amplitude[critical],
            "mean": stress.mean[critical],
            "peak": np.array([np.max(peak[points]) for points in hinges]),
            "equivalent": equivalent[critical],
            "cycles": self.law.cycles(equivalent[critical]),
        }

    @property
    def ends(self) -> Array:
        """The poses (2, 3) between which the output moves."""
        return self.motion.mean + np.array([[1.0], [-1.0]]) * self.motion.amplitude

    def values_of_ports(
        self, response: plates.Responses, changes: Sequence[Displaced] | None = None
    ) -> dict[str, Any]:
        """Return the values of one model from its response to loads on the ports.

        changes : of linear theory by finite displacements, at both ends of the motion.

        Notes
        -----
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
        hinges = np.arange(len(varying))
        return self.values(StressCycles(hinges, varying, constant, np.ones(len(hinges))), -1)

    def warnings(self, models: Mapping[str, ModelAnswer]) -> list[str]:
        """Warn of lives outside the range of Basquin's law: above yield, or outside the fitted
        range of cycles.
        """
        messages = list[str]()
        for model, (values, _) in models.items():
            messages += self._above_yield(model, values)
            messages += self._extrapolated(f"{model}: the life", values["life"])
            messages += self._extrapolated("the wanted life", self.motion.cycles)
        return messages

    def _above_yield(
        self,
        model: str,
        values: Mapping[str, Any],
    ) -> list[str]:
        limit = self.material.yield_strength
        beyond = f"beyond the yield strength of {limit:.4g} MPa"
        messages = list[str]()
        if values["safety"] < 1.0:
            messages.append(
                f"{model}: the largest stress is {limit / values['safety']:.4g} MPa, {beyond}: the "
                "life by elastic stress is not valid"
            )
        if values["peak_at_largest"] > limit:
            messages.append(
                f"{model}: at the amplitude for {short(self.motion.cycles)} cycles the largest "
                f"stress is {values['peak_at_largest']:.4g} MPa, {beyond}: yield limits the "
                "amplitude"
            )
        return messages

    def _extrapolated(
        self,
        subject: str,
        cycles: float,
    ) -> list[str]:
        low, high = self.law.range
        if not np.isfinite(cycles) or low <= cycles <= high:
            return []
        return [
            f"{subject} of {short(cycles, '.3g')} cycles is extrapolated: the law covers "
            f"{short(low)} to {short(high)}"
        ]


def _as_text(pose: Array) -> str:
    parts = [
        f"{value * unit.factor:z.5g} {unit.plain}"
        for value, unit in zip(pose, COMMANDS, strict=True)
    ]
    return ", ".join(parts)


@options(not_for="notch_sensitivity analytic")
def life(
    mechanism: Mechanism,
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
) -> Life:
    """Cycles to failure of the hinges at an amplitude of the output, and the amplitude for a wanted
    life.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    amplitude : tuple of float
        Amplitude of the output about its mean along x, y and theta: mm, mm, rad. A direction of
        amplitude zero is held.
    mean : tuple of float, optional
        Mean position of the output: mm, mm, rad.
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
    Life
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        mechanism_life` lists it. Of a stage file a result of kind `life`.

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
    setup.require_hinges(mechanism, "whose fatigue life is computed", "a mechanism with hinges")
    mesh = plates.mesh_of(mechanism, models, resolution, None)
    motion = checked_motion(amplitude, mean, ratio, cycles, notch_sensitivity)
    asked = Fatigue(motion, *chosen_law(mechanism, fit, law), mechanism.material)
    commands = [finite.by_pose(mechanism.layout, end) for end in asked.ends]
    changes = finite.changes(mechanism, mesh, commands)

    def of_network(elastic: bool) -> plates.Values:
        return asked.values_of_ports(plates.network(mechanism, elastic))

    def on_mesh(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> plates.Values:
        label = SOLID if layers or thick is not None else ELEMENTS
        response = plates.elements(mechanism, resolution, layers, thick)
        return asked.values_of_ports(response, changes.of(label))

    by_model = plates.by_models(mechanism, mesh, models, of_network, on_mesh, progress, _bands)
    found = {label: _with_errors(one, changes) for label, one in by_model.items()}
    return setup.answer(
        Life,
        mechanism,
        found,
        mesh,
        asked.settings,
        warnings=[*asked.warnings(found), *_beyond_linear(changes, mesh)],
        notes=[*asked.notes, LEFT_OUT, *changes.notes(AT_THE_ENDS, mesh)],
    )


def _bands(
    sizes: Array, each: list[plates.Values], ends: Sequence[plates.Values]
) -> dict[str, Array]:
    return {"equivalent": stress_bands(sizes, np.array([one["equivalent"] for one in each]))}


def _with_errors(found: ModelAnswer, changes: finite.Changes) -> ModelAnswer:
    """Add the possible errors of finite displacements to the bands; no band where there are none."""
    if "equivalent" not in found.bands:
        return found
    error = np.nan
    if not changes.failure:
        error = np.max([one.stress for one in changes.errors()], axis=0)
    bands = {**found.bands, "equivalent": found.bands["equivalent"] + error}
    return found._replace(bands=bands)


def _beyond_linear(changes: finite.Changes, mesh: setup.Mesh | None) -> list[str]:
    """Warn of numbers by linear theory, and of the amplitude for the wanted life."""
    texts = changes.warnings(AT_THE_ENDS, mesh)
    if any(abs(one.stress) > finite.WORTH_A_WARNING for one in changes.each):
        texts.append(
            "the amplitude for the wanted life is scaled as if the stress were proportional to the "
            "amplitude, which it is not: ask again with that amplitude"
        )
    return texts


def checked_motion(
    amplitude: ArrayLike,
    mean: ArrayLike | None,
    ratio: float | None,
    cycles: float,
    notch_sensitivity: float,
) -> CyclicMotion:
    """Return the motion that the options of `life` describe. Raises BadInput."""
    pose = checked_amplitude(amplitude)
    about = None if mean is None else arguments.vectors("mean", mean, 1, LARGEST_POSE)
    if ratio is not None:
        arguments.between("ratio", ratio, -1, 0.99, ": least over greatest displacement")
        if about is not None:
            raise BadInput("mean and ratio, expected one of the two")
    wanted = arguments.positive("cycles", cycles, LARGEST_LIFE)
    sensitivity = arguments.between("notch_sensitivity", notch_sensitivity, 0, 1)
    return cyclic_motion(pose, about, -1.0 if ratio is None else float(ratio), wanted, sensitivity)


def checked_amplitude(amplitude: ArrayLike) -> Array:
    """Return an amplitude (3,) of the output, mm, mm, rad. Raises BadInput, also if it is zero."""
    pose = arguments.vectors("amplitude", amplitude, 1, LARGEST_POSE)
    if not pose.any():
        raise BadInput("amplitude: expected a motion, not zero in all directions")
    return pose


def chosen_law(
    mechanism: Mechanism, fit: Path | None, law: Basquin | BasquinFit | None
) -> tuple[Basquin, list[str]]:
    """Return Basquin's law, and notes on its source and on the fit. Raises BadInput."""
    if fit is not None and law is not None:
        raise BadInput("fit and law, expected one of the two")
    material = mechanism.material
    source = "given in Python"
    notes = list[str]()
    if fit is not None:
        law = _fitted(fit)
        source = f"fitted to the points of {fit}"
        notes = [_described_fit(law)]
    if law is None:
        with naming_place(mechanism):
            chosen = strength.required_law(material, ", or a fit of S-N points")
        source = mechanism.sources.get(strength.KEY) or "not stated"
    else:
        chosen = strength.checked_law(law)
    if unlikely(chosen.coefficient, material.yield_strength):
        compared = f"the yield strength of {material.yield_strength:g} MPa"
        expected = UNLIKELY.format(*STRENGTHS, compared)
        raise BadInput(f"law: coefficient {chosen.coefficient:.4g} MPa, expected {expected}")
    return chosen, [_described_law(chosen, source), *notes]


def _fitted(path: Path) -> BasquinFit:
    """Return the law fitted to the points of a file. Raises BadInput, which names the file."""
    points = _read_points(path)
    try:
        return strength.fit_basquin(*points)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None


def _described_law(law: Basquin, source: str) -> str:
    rule = "Smith, Watson and Topper" if law.walker == 0.5 else f"Walker, {law.walker:g}"
    assumed = "" if law.range_stated else ", assumed"
    return (
        f"Basquin's law, {law.coefficient:g} MPa, exponent {law.exponent:g}, for "
        f"{_of_cycles(law.range)}{assumed}; mean stress by {rule}; {source}"
    )


def _of_cycles(ends: tuple[float, float]) -> str:
    return f"{short(ends[0], '.4g')} to {short(ends[1], '.4g')} cycles"


def _described_fit(law: BasquinFit) -> str:
    """Describe a fitted law and its intervals."""
    coefficient = _described_interval(law, law.coefficient_interval)
    exponent = _described_interval(law, law.exponent_interval)
    return (
        f"fit through {law.points} points from {_of_cycles(law.range)}, sigma_a = sigma'_f (2 "
        f"N)^b = A N^b: sigma'_f = {law.coefficient:.5g} MPa, {coefficient}; b = "
        f"{law.exponent:.4g}, {exponent}; A = {law.A:.5g} MPa; standard deviation of log10 N "
        f"{law.scatter:.3g}"
    )


def _described_interval(law: BasquinFit, interval: tuple[float, float] | None) -> str:
    if interval is None:
        return f"no {law.confidence:g} % interval: life may not fall with stress"
    return f"{law.confidence:g} % interval {interval[0]:.4g} to {interval[1]:.4g}"


def _read_points(path: Path) -> Array:
    """Return stresses, MPa, and cycles (2, n) of a CSV file of S-N points.

    Raises BadInput, naming file and line.
    """
    rows = read_csv(path, [*COLUMNS])
    for (line, row), key in product(rows.items(), COLUMNS):
        with suppress(ValueError):
            if 0 < float(row[key]) < math.inf:
                continue
        raise BadInput(
            f"{place_of(path, line)}: {key} = {one_line(row[key], 60)}, expected a number above 0"
        )
    return np.array([[float(row[key]) for row in rows.values()] for key in COLUMNS])
