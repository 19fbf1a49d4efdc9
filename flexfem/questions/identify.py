"""Which neck offset and which soft fixture explain measured slopes, and whether these can tell them apart."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2

from flexfem import arguments
from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import CALIBRATED, at_rest, best_model, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import AnyArray, Array, inverse
from flexfem.files.provenance import doubts
from flexfem.hinges.formulas import formula as known
from flexfem.mechanism.designs import lower
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.fixture import IDEAL, Fixture, Measurement, measured_of, pushes_of
from flexfem.questions.setup import about, question
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import Gate, Quantity, Result
from flexfem.units import MICROMETRE

Unknown: TypeAlias = Literal["pole", "springs"]
POOR = 0.01  # chance below which a fit is none
SOFTEST = 10.0  # of a fixture over the stage, where it is softest
DEPENDENT = 1e4  # condition number of the sensitivities, each over its size, beyond which data do not tell two apart
AT_END = 1e-6  # of the range of a number: as near to its end as one gets
GRID = 161  # offsets at which the compliance is computed; a spline between them
FURTHEST = 0.5  # of the thinnest neck: offsets that are looked at
DEPENDENT_NUMBERS = 0.98  # correlation: a fifth of what either number does is not done by the other
RIGID = 1e-9  # of the stage's compliance: a fixture that adds no more is rigid but for round-off
MAP = 121  # points of the map of chi square along each axis
FITTED = Gate(1e-5, absolute=1e-9)  # by iterations
CAUSES = ("neither", "necks alone", "fixture alone")


class Identification(Result):
    """Offset of all necks and softness of the fixture that fit measured slopes, with intervals.

    The numbers of the fixture are, by label, `pole`: by how much its pole is softer than described; or `translation`
    and `rotation`: series compliances, mm/N and rad/(N mm).
    """

    title = "necks and fixture from measured slopes"
    columns = ("slope",)
    labels: ClassVar = {"slope": ("measured", "as drawn", "fitted"), "cause": CAUSES}
    figure = "experiment.identification_figure"
    slope = Quantity("slope", "stiffness", ("direction", "slope"), FITTED)
    sd = Quantity("standard deviation of the measured slope", "stiffness", ("direction",))
    stiffness = Quantity("stiffness of the fixture at the fit", "stiffness", ("direction",), FITTED)
    offset = Quantity("offset of all nine necks, positive wider", "um", gate=FITTED)
    offset_low = Quantity("its interval, from", "um", gate=FITTED)
    offset_high = Quantity("its interval, to", "um", gate=FITTED)
    fixture = Quantity("number of the fixture", "", ("number",), FITTED)
    fixture_low = Quantity("its interval, from", "", ("number",), FITTED)
    fixture_high = Quantity("its interval, to", "", ("number",), FITTED)
    chi_square = Quantity("chi square", gate=FITTED)
    dof = Quantity("degrees of freedom")
    condition = Quantity("condition number of the sensitivities", gate=FITTED)
    correlation = Quantity("correlation of offset and fixture", gate=FITTED)
    distinct = Quantity("the data tell both causes apart (1 or 0)")
    allowed = Quantity("allowed by the data (1 or 0)", "", ("cause",))
    cause_chi_square = Quantity("chi square of the best fit", "", ("cause",), FITTED)
    cause_offset = Quantity("offset of the necks", "um", ("cause",), FITTED)
    cause_fixture = Quantity("number of the fixture", "", ("cause", "number"), FITTED, shown=False)
    region_offset = Quantity("offsets of the map", "um", ("map x",), FITTED, shown=False)
    region_fixture = Quantity("numbers of the map", "", ("map y",), FITTED, shown=False)
    region_above = Quantity("chi square above its least", "", ("map x", "map y"), FITTED, "all", shown=False)
    region_limit = Quantity("joint limit of chi square", shown=False)
    finding: str = ""


class SlopeProblem(NamedTuple):
    """Slopes (m,) with standard deviations as a function of an offset, mm, and p numbers of the fixture, from 0 on.

    axes : (m,), directions.   stage : spline of the logarithm of the compliance (m,) that is read, without the fixture.
    fixture : (m, p), compliance that each number adds by 1.   ends : (1 + p, 2), of offset and numbers.
    """

    axes: AnyArray
    slope: Array
    sd: Array
    stage: CubicSpline
    fixture: Array
    ends: Array

    def slopes(self, x: Array) -> Array:
        """Slopes (..., m) for numbers (..., 1 + p)."""
        return np.asarray(1 / (np.exp(self.stage(x[..., 0])) + x[..., 1:] @ self.fixture.T))  # in series

    def left(self, x: Array) -> Array:
        """Slopes less the measured ones, over their standard deviations (..., m)."""
        return np.asarray((self.slopes(x) - self.slope) / self.sd)

    def gradient(self, x: Array) -> Array:
        """Derivatives (m, 1 + p) of `left` at numbers (1 + p,)."""
        per = -(self.slopes(x) ** 2) / self.sd
        offset = np.exp(self.stage(x[0])) * self.stage(x[0], 1)
        return np.asarray(per[:, None] * np.column_stack([offset, self.fixture]))


class Fit(NamedTuple):
    """Numbers (1 + p,) and their chi square."""

    x: Array
    chi_square: float


def fit(of: SlopeProblem, fixed: Mapping[int, float], near: Array | None = None) -> Fit:
    """The numbers of least chi square, some of them fixed; looked for `near` some (1 + p,) when these are known."""
    free = np.array([k for k in range(len(of.ends)) if k not in fixed], dtype=int)
    x = np.array([fixed.get(k, 0.0) for k in range(len(of.ends))])
    if not len(free):
        return Fit(x, float(np.sum(of.left(x) ** 2)))
    low, high = of.ends[free].T
    size = np.where(free == 0, np.ptp(of.ends[0]), high / SOFTEST)

    def at(part: Array) -> Array:
        x[free] = part * size
        return x

    starts = [np.where(free == 0, 0.0, share) for share in (0.02, 0.4)] if near is None else [near[free] / size]
    tried = [
        least_squares(
            lambda part: of.left(at(part)),
            np.clip(start, low / size, high / size),
            jac=lambda part: of.gradient(at(part))[:, free] * size,
            bounds=(low / size, high / size),
            **dict.fromkeys(("xtol", "ftol", "gtol"), 1e-12),
        )
        for start in starts
    ]
    best = min(tried, key=lambda each: float(each.cost))
    return Fit(at(best.x), 2 * float(best.cost))


def interval(of: SlopeProblem, best: Fit, k: int, level: float) -> tuple[float, float]:
    """The profile-likelihood interval of one number; inf where its end, or that of the offset, is the range's."""
    least, found = best.chi_square + float(chi2.ppf(level, 1)), list[float]()

    def above(value: float) -> float:
        return fit(of, {k: value}, best.x).chi_square - least

    for end, unlimited in zip(of.ends[k], (-np.inf, np.inf), strict=True):
        if k > 0 and end == 0 and above(0.0) <= 0:
            found.append(0.0)
        elif abs(end - best.x[k]) <= AT_END * np.ptp(of.ends[k]) or above(end) <= 0:
            found.append(unlimited)
        else:
            value = float(brentq(above, best.x[k], end, xtol=1e-8 * float(np.ptp(of.ends[k]))))
            offset = fit(of, {k: value}, best.x).x[0]
            bounded = np.min(np.abs(of.ends[0] - offset)) > AT_END * np.ptp(of.ends[0])
            found.append(value if bounded else unlimited)
    return found[0], found[1]


def sensitivity(of: SlopeProblem, x: Array) -> tuple[int, float, float]:
    """How many combinations of the numbers the data depend on, condition number and correlation; nan where not all."""
    J = of.gradient(x)
    J = J / np.linalg.norm(J, axis=0)
    rank = int(np.linalg.matrix_rank(J, tol=1 / DEPENDENT))
    if rank < J.shape[1]:
        return rank, np.nan, np.nan
    covariance = np.linalg.inv(J.T @ J)
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    return rank, float(np.linalg.cond(J)), float(correlation)


class Alone(NamedTuple):
    """The best fit with one cause alone: its numbers, chi square, and whether the data allow it at the confidence."""

    numbers: Array
    chi_square: float
    allowed: bool


@question
def identify(
    stage: Stage, measured: Path, *, unknown: Unknown | None = None, confidence: float = 95.0
) -> Identification:
    """Fit an offset of all necks and a soft fixture to measured slopes, and say whether these can tell them apart.

    Parameters
    ----------
    measured : path, Fixture or Measurement
        File of measured slopes with standard deviations, with the set-up or alone.
    unknown : {"pole", "springs"}, optional
        Of the fixture: how many times softer than described its pole is, in bending and torsion alike (0: rigid), or in
        its place two springs, one in x and y and one in rotation; by default the pole where one is described.
    confidence : float
        Of the intervals, per cent, from 50 to 99.9.
    {shared}

    Notes
    -----
    Nonlinear least squares, chi square the sum of squared deviations over the variances as stated. Intervals are by
    profile likelihood: all values at which the best of the others takes chi square no further above its least than the
    quantile of one degree of freedom. A cause alone is allowed when chi square without the other is within the quantile
    of as many degrees as numbers were dropped.
    """
    check_feasible(stage)
    if unknown not in (None, "pole", "springs"):
        raise BadInput(f"unknown {unknown!r}, expected pole or springs")
    level = arguments.between("confidence", confidence, 50.0, 99.9) / 100
    given = measured_of(measured)
    warnings = list(warning.of_stage(stage))
    problem, nominal, columns, model = _problem(stage, given, unknown, warnings)
    best, count = fit(problem, {}), len(problem.ends)
    soft = problem.fixture @ best.x[1:]
    low, high = np.transpose([interval(problem, best, k, level) for k in range(count)])
    alone = []
    for dropped in (range(count), range(1, count), range(1)):
        one = fit(problem, dict.fromkeys(dropped, 0.0))
        allowed = one.chi_square - best.chi_square <= float(chi2.ppf(level, len(dropped)))
        alone.append(Alone(one.x, one.chi_square, bool(allowed)))
    rank, condition, correlation = sensitivity(problem, best.x)
    dof = len(problem.axes) - rank
    either = alone[1].allowed and alone[2].allowed
    distinct = rank == count and not either and not unexplained(best.chi_square, dof)
    marks = np.array([best.x[:2], *(each.numbers[:2] for each in alone), low[:2], high[:2]])
    region = _region(problem, np.where(np.isinf(marks), np.nan, marks), best.chi_square)
    if abs(correlation) > DEPENDENT_NUMBERS:
        warnings.append(
            f"the correlation of offset and fixture is {correlation:+.4f}: small differences between the directions "
            "tell them apart, which errors of the model and unequal necks make as well"
        )

    def spread(values: Array) -> Array:
        """Values (3,) of directions, nan where none was measured."""
        found = np.full(3, np.nan)
        found[problem.axes] = values
        return found

    stiff = np.where(soft > RIGID / nominal, 1 / np.maximum(soft, 1e-300), np.inf)
    within = columns[0] == "pole" and bool(low[1] <= 1 <= high[1])
    sentence = finding(best, dof, alone, distinct, within)
    said = doubts([("", stage), ("measured: ", given)])
    found = Identification(
        about(stage)._replace(assumed=said.assumed, not_stated=said.not_stated),
        {
            "slope": np.stack([spread(each) for each in (problem.slope, nominal, problem.slopes(best.x))], axis=1),
            "sd": spread(problem.sd),
            "stiffness": spread(stiff),
            **{"offset": best.x[0], "offset_low": low[0], "offset_high": high[0]},
            **{"fixture": best.x[1:], "fixture_low": low[1:], "fixture_high": high[1:]},
            "chi_square": best.chi_square,
            "dof": dof,
            "condition": condition,
            "correlation": correlation,
            "distinct": float(distinct),
            "allowed": [float(each.allowed) for each in alone],
            "cause_chi_square": [each.chi_square for each in alone],
            "cause_offset": [each.numbers[0] for each in alone],
            "cause_fixture": [each.numbers[1:] for each in alone],
            **dict(zip(("region_offset", "region_fixture", "region_above"), region, strict=True)),
            "region_limit": float(chi2.ppf(level, 2)),
        },
        axes={"number": columns} | {axis: [str(k) for k in range(MAP)] for axis in ("map x", "map y")},
        settings={"measured": given.name, "analytic model": model, "confidence": f"{100 * level:g} %"},
        warnings=warnings,
        notes=[sentence, "intervals by profile likelihood; unlimited where the data set no end"],
    )
    found.finding = sentence
    return found


def _problem(
    stage: Stage, measured: Fixture | Measurement, unknown: Unknown | None, warnings: list[str]
) -> tuple[SlopeProblem, Array, list[str], str]:
    """The problem, the slopes (m,) of the stage as drawn on a rigid fixture, names of the fixture's numbers, model."""
    if measured.measured is None:
        raise BadInput("no [measured] slopes, expected kxx_n_per_mm, kyy_n_per_mm or ktt_n_mm_per_rad", measured.name)
    value, sd = measured.measured.slopes
    axes = np.flatnonzero(~np.isnan(value))
    keys = ("kxx_sd_n_per_mm", "kyy_sd_n_per_mm", "ktt_sd_n_mm_per_rad")
    missing = [f"measured.{keys[k]}" for k in axes if np.isnan(sd[k])]
    if missing:
        raise BadInput(f"{', '.join(missing)}: expected, for without it no interval can be given", measured.name)
    pushes = pushes_of(measured) if isinstance(measured, Fixture) else IDEAL
    offsets, C, model = _stages(stage, warnings)
    own, pole, bar = pushes.shares(C)
    if unknown == "pole" and not np.any(pole[axes] > 0):
        raise BadInput('unknown "pole", expected springs: no pole is in these readings', measured.name)
    read = (own + bar)[:, axes]
    if not np.all(read > 0):
        raise ComputationFailed(f"{measured.name}: a slope of this stage on a rigid fixture is not positive")
    spline = CubicSpline(offsets, np.log(read))
    at = np.exp(spline(0.0))
    if unknown != "springs" and np.any(pole[axes] > 0):
        columns, fixture = ["pole"], pole[axes, None]
    else:
        springs = {name: part for name, part in (("translation", axes < 2), ("rotation", axes == 2)) if np.any(part)}
        columns, fixture = list(springs), np.column_stack(list(springs.values())).astype(float)
    most = SOFTEST / np.max(fixture / at[:, None], axis=0)
    ends = np.array([[offsets[0], offsets[-1]], *([0.0, one] for one in most)])
    return SlopeProblem(axes, value[axes], sd[axes], spline, fixture, ends), 1 / at, columns, model


def _stages(stage: Stage, warnings: list[str]) -> tuple[Array, Array, str]:
    """Neck offsets (n,), mm, and the compliances (n, 3, 3) of stages with them, by the best model there is."""
    chosen = best_model(stage, warnings)
    stage, formula = chosen.stage, chosen.formula
    neck, radius = stage.array("neck"), stage.array("radius")
    ends = FURTHEST * float(np.min(neck)) * np.array([-1.0, 1.0])
    if formula == CALIBRATED:
        low, high = known(formula).valid
        ends = np.array([max(ends[0], np.max(low * radius - neck)), min(ends[1], np.min(high * radius - neck))])
    offsets = np.linspace(ends[0], ends[1], GRID)
    designs = lower(stage).repeated(GRID)
    designs.neck[:] += offsets[:, None, None]
    found = at_rest(designs, hinge_compliances(designs, formula), freedoms_of(21), body_compliance(stage)[None])
    kept = np.all(np.isfinite(found.stiffness), axis=(1, 2))
    if np.count_nonzero(kept) < GRID // 4:
        raise ComputationFailed(f"stage {stage.name!r}: no model has an answer for other necks")
    return offsets[kept], inverse(found.stiffness[kept]), chosen.name


def _region(of: SlopeProblem, marks: Array, least: float) -> tuple[Array, Array, Array]:
    """Chi square above its least over the offset and the fixture's first number, the others at their best.

    marks : (n, 2), points that the map must show, nan for none; rest on a rigid fixture is always on it.
    """
    spread = np.ptp(np.nan_to_num(np.vstack([marks, np.zeros(2)])), axis=0)
    low = np.nanmin(np.vstack([marks, np.zeros(2)]), axis=0) - 0.3 * spread
    high = np.nanmax(np.vstack([marks, np.zeros(2)]), axis=0) + 0.3 * spread
    low, high = np.clip(low, *of.ends[:2].T), np.clip(high, *of.ends[:2].T)
    high = np.where(high - low > AT_END * np.ptp(of.ends[:2], axis=1), high, of.ends[:2, 1])
    offsets, numbers = np.linspace(low, high, MAP).T
    x = np.zeros((MAP, MAP, len(of.ends)))
    x[..., 0], x[..., 1] = offsets[:, None], numbers
    for column in range(2, len(of.ends)):  # a spring that softens one direction alone: exact, or none
        row = int(np.argmax(of.fixture[:, column - 1]))
        wanted = (1 / of.slope[row] - np.exp(of.stage(offsets))[:, row]) / of.fixture[row, column - 1]
        x[..., column] = np.maximum(wanted, 0.0)[:, None]
    above = np.sum(of.left(x) ** 2, axis=-1) - least
    return offsets, numbers, above


def unexplained(chi_square: float, dof: int) -> bool:
    """Whether a fit is none: chance alone would hardly leave so much."""
    return dof > 0 and bool(chi2.sf(chi_square, dof) < POOR)


def finding(best: Fit, dof: int, alone: list[Alone], distinct: bool, pole: bool) -> str:
    """What the data say, in a sentence or two; `pole`: that as described is within its interval."""
    um, offset = MICROMETRE.factor, alone[1].numbers[0]
    necks = f"ecks {abs(um * offset):.3g} {MICROMETRE.plain} {'wider' if offset > 0 else 'thinner'} than drawn"
    neither, by_necks, by_fixture = (each.allowed for each in alone)
    if unexplained(best.chi_square, dof):
        usual = f"where chance goes beyond {chi2.isf(POOR, dof):.3g} once in {1 / POOR:.0f}"
        return (
            f"Nothing of this explains the data: chi square {best.chi_square:.3g} at the best fit, {usual}. "
            "Look at the standard deviations, or for another cause."
        )
    if not distinct:
        more = {
            (True, True): f" N{necks} alone and a soft fixture alone both agree with them.",
            (True, False): f" N{necks} alone agree with them, a soft fixture alone does not.",
            (False, True): " A soft fixture alone agrees with them, no neck offset alone does.",
        }.get((by_necks, by_fixture), "")
        nothing = " The data need neither: the stage as drawn on a rigid fixture agrees with them."
        return f"These data cannot tell them apart.{nothing if neither else more}"
    if by_necks:
        return f"The necks explain the data: n{necks}, and no soft fixture alone does."
    if by_fixture:
        return "A soft fixture explains the data, and no neck offset alone does."
    both = "Both are needed: neither a neck offset nor a soft fixture alone explains the data."
    return both + (" The pole as described is within its interval." if pole else "")
