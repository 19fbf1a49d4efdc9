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
from flexfem.analytic.model import CALIBRATED, analyse, best_model, stiffness_with_necks
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import AnyArray, Array, inverse
from flexfem.files.refusals import place_of
from flexfem.hinges.formulas import formula as known
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
    finding = property(lambda of: of.notes[0], doc="What the data say.")


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
    free = np.setdiff1d(np.arange(len(of.ends)), list(fixed))
    x = np.array([fixed.get(k, 0.0) for k in range(len(of.ends))])
    if not len(free):
        return Fit(x, float(np.sum(of.left(x) ** 2)))
    size = np.where(free == 0, np.ptp(of.ends[0]), of.ends[free, 1] / SOFTEST)
    low, high = of.ends[free].T / size

    def at(part: Array) -> Array:
        x[free] = part * size
        return x

    def residuals(part: Array) -> Array:
        return of.left(at(part))

    def jacobian(part: Array) -> Array:
        return np.asarray(of.gradient(at(part))[:, free] * size)

    starts = [np.where(free == 0, 0.0, share) for share in (0.02, 0.4)] if near is None else [near[free] / size]
    exact: dict[str, float] = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-12)
    tried = [least_squares(residuals, np.clip(one, low, high), jacobian, (low, high), **exact) for one in starts]
    best = min(tried, key=lambda each: float(each.cost))
    return Fit(at(best.x), 2 * float(best.cost))


def interval(of: SlopeProblem, best: Fit, k: int, level: float) -> list[float]:
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
            from_ends = np.abs(of.ends[0] - fit(of, {k: value}, best.x).x[0])
            found.append(value if np.min(from_ends) > AT_END * np.ptp(of.ends[0]) else unlimited)
    return found


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
    level = arguments.between("confidence", confidence, 50.0, 99.9) / 100
    source, warnings = measured_of(measured), list(warning.of_stage(stage))
    place = source.name if isinstance(measured, Fixture | Measurement) else place_of(measured)
    problem, numbers, model = _problem(stage, source, place, unknown, warnings)
    best, count = fit(problem, {}), len(problem.ends)
    low, high = np.transpose([interval(problem, best, k, level) for k in range(count)])
    dropped = (range(count), range(1, count), range(1))  # for each of `CAUSES`
    alone = [fit(problem, dict.fromkeys(which, 0.0)) for which in dropped]
    more = [each.chi_square - best.chi_square for each in alone]
    allowed = [bool(one <= chi2.ppf(level, len(which))) for one, which in zip(more, dropped, strict=True)]
    rank, condition, correlation = sensitivity(problem, best.x)
    dof = len(problem.axes) - rank
    distinct = rank == count and not (allowed[1] and allowed[2]) and not unexplained(best.chi_square, dof)
    marks = np.array([best.x[:2], *(each.x[:2] for each in alone), low[:2], high[:2]])
    if abs(correlation) > DEPENDENT_NUMBERS:
        warnings.append(
            f"the correlation of offset and fixture is {correlation:+.4f}: small differences between the directions "
            "tell them apart, which errors of the model and unequal necks make as well"
        )
    drawn = problem.slopes(np.zeros(count))  # on a rigid fixture
    soft = problem.fixture @ best.x[1:]
    stiff = np.where(soft > RIGID / drawn, 1 / np.maximum(soft, 1e-300), np.inf)
    of_directions = np.full((5, 3), np.nan)
    of_directions[:, problem.axes] = problem.slope, drawn, problem.slopes(best.x), problem.sd, stiff
    sentence = finding(best, dof, alone[1].x[0], allowed, distinct)
    if sentence.startswith("Both") and numbers[0] == "pole" and low[1] <= 1 <= high[1]:
        sentence += " The pole as described is within its interval."
    return Identification(
        about(stage, files={"measured": source}),
        {
            "slope": of_directions[:3].T,
            "sd": of_directions[3],
            "stiffness": of_directions[4],
            **{"offset": best.x[0], "offset_low": low[0], "offset_high": high[0]},
            **{"fixture": best.x[1:], "fixture_low": low[1:], "fixture_high": high[1:]},
            "chi_square": best.chi_square,
            "dof": dof,
            "condition": condition,
            "correlation": correlation,
            "distinct": distinct,
            "allowed": allowed,
            "cause_chi_square": [each.chi_square for each in alone],
            "cause_offset": [each.x[0] for each in alone],
            "cause_fixture": [each.x[1:] for each in alone],
            **_region(problem, np.where(np.isinf(marks), np.nan, marks), best.chi_square),
            "region_limit": float(chi2.ppf(level, 2)),
        },
        axes={"number": numbers} | {axis: [str(k) for k in range(MAP)] for axis in ("map x", "map y")},
        settings={"measured": source.name, "analytic model": model, "confidence": f"{100 * level:g} %"},
        warnings=warnings,
        notes=[sentence, "intervals by profile likelihood; unlimited where the data set no end"],
    )


def _problem(
    stage: Stage, measured: Fixture | Measurement, place: str, unknown: Unknown | None, warnings: list[str]
) -> tuple[SlopeProblem, list[str], str]:
    """The problem, names of the fixture's numbers, and of the analytic model; `place` is where the slopes are."""
    assert measured.measured is not None, "of `measured_of`"
    value, sd = measured.measured.slopes
    axes = np.flatnonzero(~np.isnan(value))
    keys = ("kxx_sd_n_per_mm", "kyy_sd_n_per_mm", "ktt_sd_n_mm_per_rad")
    if missing := [f"measured.{keys[k]}" for k in axes if np.isnan(sd[k])]:
        raise BadInput(f"{', '.join(missing)}: expected, for without it no interval can be given", place)
    pushes = pushes_of(measured) if isinstance(measured, Fixture) else IDEAL
    offsets, C, model = _stages(stage, warnings)
    own, pole, bar = pushes.shares(C)
    described = bool(np.any(pole[axes] > 0))
    if unknown == "pole" and not described:
        raise BadInput('unknown "pole", expected springs: no pole is in these readings', place)
    read = (own + bar)[:, axes]
    if not np.all(read > 0):
        raise ComputationFailed(f"{place}: a slope of this stage on a rigid fixture is not positive")
    spline = CubicSpline(offsets, np.log(read))
    adds = (
        {"pole": pole[axes]} if described and unknown != "springs" else {"translation": axes < 2, "rotation": axes == 2}
    )
    adds = {name: one for name, one in adds.items() if np.any(one)}
    fixture = np.column_stack(list(adds.values())).astype(float)
    most = SOFTEST / np.max(fixture / np.exp(spline(0.0))[:, None], axis=0)
    ends = np.array([[offsets[0], offsets[-1]], *([0.0, one] for one in most)])
    return SlopeProblem(axes, value[axes], sd[axes], spline, fixture, ends), list(adds), model


def _stages(stage: Stage, warnings: list[str]) -> tuple[Array, Array, str]:
    """Neck offsets (n,), mm, and the compliances (n, 3, 3) of stages with them, by the best model there is."""
    chosen = best_model(stage, warnings)
    analyse(*chosen)  # refuses a stage that has no answer itself
    stage, formula = chosen.stage, chosen.formula
    neck, radius = stage.array("neck"), stage.array("radius")
    ends = FURTHEST * float(np.min(neck)) * np.array([-1.0, 1.0])
    if formula == CALIBRATED:
        low, high = known(formula).valid
        ends = np.clip(ends, np.max(low * radius - neck), np.min(high * radius - neck))
    offsets = np.linspace(ends[0], ends[1], GRID)
    K = stiffness_with_necks(
        stage, neck + offsets[:, None, None], formula, freedoms_of(21), body_compliance(stage)[None]
    )
    kept = np.all(np.isfinite(K), axis=(1, 2))
    if np.count_nonzero(kept) < GRID // 4:
        raise ComputationFailed(f"stage {stage.name!r}: no model has an answer for other necks")
    return offsets[kept], inverse(K[kept]), chosen.name


def _region(of: SlopeProblem, marks: Array, least: float) -> dict[str, Array]:
    """Chi square above its least over the offset and the fixture's first number, the others at their best.

    marks : (n, 2), points that the map must show, nan for none; rest on a rigid fixture is always on it.
    """
    shown = np.vstack([marks, np.zeros(2)])
    low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    room = 0.3 * (high - low)
    low, high = np.clip(low - room, *of.ends[:2].T), np.clip(high + room, *of.ends[:2].T)
    high = np.where(high - low > AT_END * np.ptp(of.ends[:2], axis=1), high, of.ends[:2, 1])
    offsets, numbers = np.linspace(low, high, MAP).T
    x = np.zeros((MAP, MAP, len(of.ends)))
    x[..., 0], x[..., 1] = offsets[:, None], numbers
    for column in range(2, len(of.ends)):  # a spring that softens one direction alone: exact, or none
        row = int(np.argmax(of.fixture[:, column - 1]))
        wanted = (1 / of.slope[row] - np.exp(of.stage(offsets))[:, row]) / of.fixture[row, column - 1]
        x[..., column] = np.maximum(wanted, 0.0)[:, None]
    above = np.sum(of.left(x) ** 2, axis=-1) - least
    return {"region_offset": offsets, "region_fixture": numbers, "region_above": above}


def unexplained(chi_square: float, dof: int) -> bool:
    """Whether a fit is none: chance would hardly leave so much. Without one, one degree of freedom counts."""
    return bool(chi2.sf(chi_square, max(dof, 1)) < POOR)


def finding(best: Fit, dof: int, offset: float, allowed: list[bool], distinct: bool) -> str:
    """What the data say, in a sentence or two, by the offset of the necks alone and what is `allowed` of `CAUSES`."""
    um, (neither, by_necks, by_fixture) = MICROMETRE.factor, allowed
    necks = f"ecks {abs(um * offset):.3g} {MICROMETRE.plain} {'wider' if offset > 0 else 'thinner'} than drawn"
    if unexplained(best.chi_square, dof):
        usual = f"where chance goes beyond {chi2.isf(POOR, max(dof, 1)):.3g} once in {1 / POOR:.0f}"
        return (
            f"Nothing of this explains the data: chi square {best.chi_square:.3g} at the best fit, {usual}. "
            "Look at the standard deviations, or for another cause."
        )
    if distinct:
        return {
            (True, False): f"The necks explain the data: n{necks}, and no soft fixture alone does.",
            (False, True): "A soft fixture explains the data, and no neck offset alone does.",
            (False, False): "Both are needed: neither a neck offset nor a soft fixture alone explains the data.",
        }[by_necks, by_fixture]
    alike = {
        (True, True): f" N{necks} alone and a soft fixture alone both agree with them.",
        (True, False): f" N{necks} alone agree with them, a soft fixture alone does not.",
        (False, True): " A soft fixture alone agrees with them, no neck offset alone does.",
        (False, False): "",
    }[by_necks, by_fixture]
    nothing = " The data need neither: the stage as drawn on a rigid fixture agrees with them."
    return f"These data cannot tell them apart.{nothing if neither else alike}"
