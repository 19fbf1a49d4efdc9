"""`flexfem life`: cycles that the necks bear at an amplitude of the platform, and the amplitude for a wanted life."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import CALIBRATED, analyse, best_model
from flexfem.arrays import first_highest
from flexfem.hinges.strength import KEY, Basquin
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.units import STRESS
from flexfem.verify import warning
from flexfem.verify.corners import stress_bands
from flexfem.verify.errors import levels
from flexfem.verify.protocol import Solve
from flexfem.verify.result import OfStage, Record, Triple, about
from flexfem.verify.strained import Repeated, Strained, by_elements, by_model, factor_at, of_preloads

LEFT_OUT = (
    "a median of polished specimens: scatter, surface, size, residual stress, corrosion and stress across the plane "
    "are not in it"
)


class Law(Record):
    """Basquin's law and Walker's exponent, see `fatigue.Basquin`; `range_stated`: or the range is assumed."""

    coefficient: float
    exponent: float
    walker: float
    range: tuple[float, float]
    range_stated: bool
    source: str


class NeckLife(Record):
    """One neck, at the point of its surface that fails first.

    amplitude, mean : von Mises stress, the mean with its sign.   equivalent : fully reversed one of the same life, by
        the notch sensitivity.
    peak : largest magnitude at the neck.   cycles : None without end.
    """

    chain: int
    hinge: str
    amplitude: float
    mean: float
    equivalent: float
    peak: float
    cycles: float | None


class Witness(Record):
    """What one model says; necks chain by chain, `first` the place of the one that fails first.

    cycles : at the amplitude, and between `fewest` and `most` by the uncertainty of the stress alone.
    stress_error : from and to which part the true equivalent stress may be off; None where it is not known.
    largest : amplitude (3,) for the wanted life, mm, mm, rad, and `factor` over the given one; None without end.
    peak_at_largest : largest stress of any neck there.
    safety : yield strength over the largest stress of any neck.
    """

    model: str
    necks: list[NeckLife]
    first: int
    cycles: float | None
    fewest: float | None
    most: float | None
    stress_error: tuple[float, float] | None
    factor: float | None
    largest: Triple | None
    peak_at_largest: float | None
    safety: float


class Life(OfStage):
    """What `flexfem life` says; amplitude, mean (3,), mm, mm, rad; `wanted` in cycles.

    proportional : whether the mean grows with the amplitude for the wanted life.   left_out : of any life here.
    notch_sensitivity : q, by which `(1 + q (K - 1)) / K` of the stress at the notch counts for fatigue.
    elements : None where finite elements were not asked.
    """

    name: str
    material: str
    model: str
    yield_strength: float
    law: Law
    amplitude: Triple
    mean: Triple
    proportional: bool
    wanted: float
    notch_sensitivity: float
    analytic: Witness
    elements: Witness | None
    left_out: str


class Asked(NamedTuple):
    """What is asked of a motion, and the law of its material and where that comes from."""

    of: Repeated
    law: Basquin
    source: str


def source_in(stage: Stage) -> str:
    """Where a stage's own fatigue constants come from."""
    return stage.sources[KEY] or "not stated"


def life(stage: Stage, asked: Asked, resolution: int | None, solve: Solve) -> Life:
    """The life of a feasible stage, by the analytic model and, at a resolution, by finite elements.

    Raises BadInput, ComputationFailed as `model.analyse` and `solve`.
    """
    recalled = (key for key in stage.assumed if key.startswith("material."))
    warnings = [*warning.of_numbers(stage), *(f"{key} is {stage.sources[key]}" for key in recalled)]
    result = analyse(*(chosen := best_model(stage, warnings)))
    compared = chosen.formula == CALIBRATED  # off its chart nothing was
    above = warning.stress_above(chosen.formula, chosen.links, chosen.stage.model) if compared else None
    error = None if above is None else (1 / (1 + above[1] / 100) - 1, 1 / (1 + above[0] / 100) - 1)
    analytic = _witness(stage, chosen.name, by_model(chosen.stage, result, asked.of), asked, error)
    elements = None if resolution is None else _by_elements(stage, asked, resolution, solve)
    for said in (analytic, elements):
        warnings += [] if said is None else _warnings(stage, asked, said)
    motion = asked.of.motion
    end = np.abs(motion.mean) + np.abs(motion.amplitude)
    return Life(
        **about(stage),
        name=stage.name,
        material=stage.material.name,
        model=stage.model,
        yield_strength=stage.material.yield_strength,
        law=Law(**asked.law._asdict(), source=asked.source),
        amplitude=Triple.of(motion.amplitude),
        mean=Triple.of(motion.mean),
        proportional=motion.proportional,
        wanted=asked.of.wanted,
        notch_sensitivity=asked.of.sensitivity,
        analytic=analytic,
        elements=elements,
        left_out=LEFT_OUT,
        warnings=list(dict.fromkeys([*warnings, *warning.of_motion(stage, end, "farthest pose"), *of_preloads(stage)])),
    )


def _by_elements(stage: Stage, asked: Asked, resolution: int, solve: Solve) -> Witness:
    """On three meshes; the band of the stress is that of the highest equivalent one."""
    steps = levels(resolution)
    found = [by_elements(stage, solve(stage, step).response, asked.of) for step in steps]
    highest = np.array([float(np.max(each.equivalent(asked.law.walker))) for each in found])
    band = stress_bands(np.array(steps, dtype=float), highest) / highest[-1] if highest[-1] > 0 else 0.0
    return _witness(stage, f"finite elements, resolution {resolution}", found[-1], asked, (-float(band), float(band)))


def _witness(stage: Stage, model: str, of: Strained, asked: Asked, error: tuple[float, float] | None) -> Witness:
    law, motion = asked.law, asked.of.motion
    necks = [_neck(of, law, k) for k in range(9)]
    (first,) = first_highest(np.array([each.equivalent for each in necks]))
    stress, cycles = necks[first].equivalent, necks[first].cycles
    bounds = (None, None) if error is None or cycles is None else tuple(_cycles(law, (1 + e) * stress) for e in error)
    factor = factor_at(of, law, asked.of.wanted, motion.proportional)
    endless = not np.isfinite(factor)
    return Witness(
        model=model,
        necks=necks,
        first=first,
        cycles=cycles,
        fewest=bounds[1],
        most=bounds[0],
        stress_error=error,
        factor=None if endless else factor,
        largest=None if endless else Triple.of(factor * motion.amplitude),
        peak_at_largest=None if endless else float(np.max(of.peak(factor, motion.proportional))),
        safety=stage.material.yield_strength / float(np.max(of.peak())),
    )


def _neck(of: Strained, law: Basquin, k: int) -> NeckLife:
    here = np.flatnonzero(of.neck == k)
    equivalent = of.equivalent(law.walker)[here]
    worst = here[int(np.argmax(equivalent))]
    highest = float(np.max(equivalent))
    return NeckLife(
        chain=k // 3 + 1,
        hinge=HINGE_NAMES[k % 3],
        amplitude=float(of.amplitude[worst]),
        mean=float(of.mean[worst]),
        equivalent=highest,
        peak=float(np.max(of.peak()[here])),
        cycles=_cycles(law, highest),
    )


def _cycles(law: Basquin, equivalent: float) -> float | None:
    """Cycles, None without end."""
    found = float(law.cycles(equivalent))
    return found if np.isfinite(found) else None


def _warnings(stage: Stage, asked: Asked, said: Witness) -> list[str]:
    """Where a life is not what Basquin's law is for: beyond yield, and beyond the cycles it was fitted to."""
    low, high = asked.law.range
    found = []
    if said.safety < 1.0:
        highest = stage.material.yield_strength / said.safety
        found.append(
            f"{said.model}: the largest stress is {highest:.4g} {STRESS}, beyond the yield strength of "
            f"{stage.material.yield_strength:.4g} {STRESS}: the life by elastic stress does not hold there"
        )
    largest = said.peak_at_largest
    if largest is not None and largest > stage.material.yield_strength:
        found.append(
            f"{said.model}: at the amplitude for {asked.of.wanted:g} cycles the largest stress is {largest:.4g} "
            f"{STRESS}, beyond the yield strength of {stage.material.yield_strength:.4g} {STRESS}: yield limits it"
        )
    for what, cycles in ((f"{said.model}: the life", said.cycles), ("the wanted life", asked.of.wanted)):
        if cycles is not None and not low <= cycles <= high:
            found.append(f"{what} of {cycles:.3g} cycles is extrapolated: the law is for {low:g} to {high:g}")
    return found
