"""Identify a neck offset and a soft fixture from measured slopes, and judge whether the data
distinguish them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2

from flexfem import arguments
from flexfem.arrays import AnyArray, Array, inverse
from flexfem.files.refusals import place_of
from flexfem.hinges.formulas import formula as known
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper import warnings as warning
from flexfem.paper.equations import freedoms_of
from flexfem.paper.fixture import IDEAL, Fixture, Measurement, measured_of, pushes_of
from flexfem.paper.links import body_compliance
from flexfem.paper.model import CALIBRATED, analyse, best_model, stiffness_with_necks
from flexfem.paper.stage import Stage
from flexfem.questions.setup import about, question
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import Gate, Quantity, Result
from flexfem.units import MICROMETRE

Unknown: TypeAlias = Literal["pole", "springs"]
POOR = 0.01  # probability of chi square below which a fit is rejected
SOFTEST = 10.0  # upper bound of the compliance of the fixture over that of the stage
# condition number of the normalized sensitivities above which data do not tell two numbers apart
DEPENDENT = 1e4
# of the range of a number: distance below which a value counts as the end of the range
AT_END = 1e-6
# number of offsets at which the compliance is computed; a spline interpolates between them
GRID = 161
FURTHEST = 0.5  # of the thinnest neck: largest offset
# correlation at which a fifth of the effect of either number is independent of the other
DEPENDENT_NUMBERS = 0.98
RIGID = 1e-9  # of the stage's compliance: a fixture that adds less is rigid up to round-off
MAP = 121  # points of the map of chi square along each axis
FITTED = Gate(1e-5, absolute=1e-9)  # for results of iterations
CAUSES = ("neither", "necks alone", "fixture alone")


class Identification(Result):
    """Offset of all necks and compliance of the fixture, fitted to measured slopes, with intervals.

    The numbers of the fixture are, by label, `pole`: compliance of the pole over that of its
    description; or `translation` and `rotation`: series compliances, mm/N and rad/(N mm)."""

    title = "neck offset and fixture from measured slopes"
    main_result = ("offset", {})
    columns = ("slope",)
    labels: ClassVar = {"slope": ("measured", "as drawn", "fitted"), "cause": CAUSES}
    figure = "paper.figures.identification.identification_figure"
    slope = Quantity("slope", "stiffness", ("direction", "slope"), FITTED)
    sd = Quantity("standard deviation of the measured slope", "stiffness", ("direction",))
    stiffness = Quantity("stiffness of the fixture at the fit", "stiffness", ("direction",), FITTED)
    offset = Quantity("offset of all nine necks, positive wider", "um", gate=FITTED)
    offset_low = Quantity("interval of the offset, from", "um", gate=FITTED)
    offset_high = Quantity("interval of the offset, to", "um", gate=FITTED)
    fixture = Quantity("parameter of the fixture", "", ("number",), FITTED)
    fixture_low = Quantity("interval of the parameter, from", "", ("number",), FITTED)
    fixture_high = Quantity("interval of the parameter, to", "", ("number",), FITTED)
    chi_square = Quantity("chi square", gate=FITTED)
    dof = Quantity("degrees of freedom")
    condition = Quantity("condition number of the sensitivities", gate=FITTED)
    correlation = Quantity("correlation of offset and fixture", gate=FITTED)
    distinct = Quantity("the data distinguish both causes (1 or 0)")
    allowed = Quantity("allowed by the data (1 or 0)", "", ("cause",))
    cause_chi_square = Quantity("chi square of the best fit", "", ("cause",), FITTED)
    cause_offset = Quantity("offset of the necks", "um", ("cause",), FITTED)
    cause_fixture = Quantity(
        "parameter of the fixture", "", ("cause", "number"), FITTED, shown=False
    )
    region_offset = Quantity("offsets in the map", "um", ("map x",), FITTED, shown=False)
    region_fixture = Quantity(
        "parameters of the fixture in the map", "", ("map y",), FITTED, shown=False
    )
    region_above = Quantity(
        "chi square above its minimum", "", ("map x", "map y"), FITTED, "all", shown=False
    )
    region_limit = Quantity("joint limit of chi square", shown=False)
    finding = property(lambda self: self.notes[0], doc="Conclusion drawn from the data.")


class SlopeProblem(NamedTuple):
    """Measured slopes (m,), standard deviations, and their model in an offset, mm, and p numbers >=
    0 of the fixture.

    axes : (m,), directions.   log_compliance : spline over the offset, of the compliance (m,) on a
    rigid fixture.
    added : (m, p), compliance that the fixture adds per unit of each number.   bounds : (1 + p, 2),
    of all unknowns x."""

    axes: AnyArray
    slope: Array
    sd: Array
    log_compliance: CubicSpline
    added: Array
    bounds: Array

    def slopes(self, x: Array) -> Array:
        """Return modelled slopes (..., m) for unknowns x (..., 1 + p)."""
        return np.asarray(
            1 / (np.exp(self.log_compliance(x[..., 0])) + x[..., 1:] @ self.added.T)
        )  # in series

    def residuals(self, x: Array) -> Array:
        """Return modelled less measured slopes over their standard deviations (..., m)."""
        return np.asarray((self.slopes(x) - self.slope) / self.sd)

    def chi_square(self, x: Array) -> Array:
        """Return the sum (...) of the squared residuals."""
        return np.asarray(np.sum(self.residuals(x) ** 2, axis=-1))

    def gradient(self, x: Array) -> Array:
        """Return the derivatives (m, 1 + p) of `residuals` at unknowns x (1 + p,)."""
        offset = np.exp(self.log_compliance(x[0])) * self.log_compliance(x[0], 1)
        return np.asarray(
            -(self.slopes(x) ** 2 / self.sd)[:, None] * np.column_stack([offset, self.added])
        )

    def fit(
        self,
        fixed: Mapping[int, float],
        near: Array | None = None,
    ) -> Array:
        """Return the x of least chi square with some unknowns fixed, starting from `near` (1 + p,)
        if that is given.
        """
        free = [k for k in range(len(self.bounds)) if k not in fixed]
        constant = np.array([fixed.get(k, 0.0) for k in range(len(self.bounds))])
        if not free:
            return constant
        scale = np.append(np.ptp(self.bounds[0]), self.bounds[1:, 1] / SOFTEST)[free]
        low, high = self.bounds[free].T / scale

        def whole(scaled: Array) -> Array:
            x = constant.copy()
            x[free] = scaled * scale
            return x

        def residuals(scaled: Array) -> Array:
            return self.residuals(whole(scaled))

        def jacobian(scaled: Array) -> Array:
            return np.asarray(self.gradient(whole(scaled))[:, free] * scale)

        starts = (
            [np.where(free, share, 0.0) for share in (0.02, 0.4)]
            if near is None
            else [near[free] / scale]
        )
        exact: dict[str, float] = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-12)
        fits = [
            least_squares(residuals, np.clip(start, low, high), jacobian, (low, high), **exact)
            for start in starts
        ]
        return whole(min(fits, key=lambda result: float(result.cost)).x)

    def interval(
        self,
        best: Array,
        k: int,
        level: float,
    ) -> list[float]:
        """Return the profile-likelihood interval of unknown k; infinite where it or the offset
        reaches its bounds.
        """
        limit = self.chi_square(best) + chi2.ppf(level, 1)
        ends = list[float]()
        size = np.ptp(self.bounds, axis=1)

        def above(value: float) -> float:
            return float(self.chi_square(self.fit({k: value}, best)) - limit)

        for bound, end in zip(self.bounds[k], (-np.inf, np.inf), strict=True):
            if k > 0 and bound == 0 and above(0.0) <= 0:
                end = 0.0
            elif abs(bound - best[k]) > AT_END * size[k] and above(bound) > 0:
                value = float(brentq(above, best[k], bound, xtol=1e-8 * float(size[k])))
                from_ends = np.abs(self.bounds[0] - self.fit({k: value}, best)[0])
                end = value if np.min(from_ends) > AT_END * size[0] else end
            ends.append(end)
        return ends

    def sensitivity(self, x: Array) -> tuple[int, float, float]:
        """Return rank and condition number of the sensitivities, and the correlation of x[0] and
        x[1]; or nan.
        """
        J = self.gradient(x)
        J = J / np.linalg.norm(J, axis=0)
        rank = int(np.linalg.matrix_rank(J, tol=1 / DEPENDENT))
        if rank < J.shape[1]:
            return rank, np.nan, np.nan
        covariance = np.linalg.inv(J.T @ J)
        correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
        return rank, float(np.linalg.cond(J)), float(correlation)

    def chi_square_map(self, marks: Array) -> tuple[Array, Array, Array]:
        """Return offsets (n,), the fixture's first number (n,), and chi square (n, n) minimized
        over the others.

        marks : (k, 2), points that the map must contain, nan for none; zero offset on a rigid
        fixture is always added."""
        shown = np.vstack([marks, np.zeros(2)])
        ends = self.bounds[:2]
        low = np.nanmin(shown, axis=0)
        high = np.nanmax(shown, axis=0)
        margin = 0.3 * (high - low)
        low = np.clip(low - margin, *ends.T)
        high = np.clip(high + margin, *ends.T)
        high = np.where(high - low > AT_END * np.ptp(ends, axis=1), high, ends[:, 1])
        offsets, numbers = np.linspace(low, high, MAP).T
        x = np.zeros((MAP, MAP, len(self.bounds)))
        x[..., 0] = offsets[:, None]
        x[..., 1] = numbers
        for column in range(
            2, len(self.bounds)
        ):  # a spring of a single direction fits it exactly or vanishes
            row = int(np.argmax(self.added[:, column - 1]))
            missing = 1 / self.slope[row] - np.exp(self.log_compliance(offsets))[:, row]
            x[..., column] = np.maximum(missing / self.added[row, column - 1], 0.0)[:, None]
        return offsets, numbers, self.chi_square(x)


@question
def identify(
    stage: Stage, measured: Path, *, unknown: Unknown | None = None, confidence: float = 95.0
) -> Identification:
    """Fit an offset of all necks and a soft fixture to measured slopes, and judge whether the data
    distinguish them.

    Parameters
    ----------
    stage : Stage
        The stage.
    measured : path, Fixture or Measurement
        File of measured slopes with standard deviations, with the set-up or alone.
    unknown : {"pole", "springs"}, optional
        Unknowns of the fixture: "pole" is the compliance of the pole, in bending and torsion, over
        the described one (0: rigid); "springs" are two, one in x and y and one in rotation; by
        default the pole if one is described.
    confidence : float
        Confidence level of the intervals, per cent, from 50 to 99.9.

    Returns
    -------
    Identification
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        identification` lists it.

    Raises
    ------
    BadInput
        The stage cannot be made, or an option or a file is not valid.
    ComputationFailed
        The stage is singular, or a mesh or a solution does not pass its checks.

    Notes
    -----
    Nonlinear least squares; chi square is the sum of squared deviations over the stated variances.
    Intervals are by profile likelihood: all values for which chi square, minimized over the other
    unknowns, exceeds its minimum by no more than the quantile of one degree of freedom. One cause
    alone is allowed if setting the other to zero raises chi square by no more than the quantile of
    as many degrees of freedom as unknowns were set to zero."""
    check_feasible(stage)
    level = arguments.between("confidence", confidence, 50.0, 99.9) / 100
    source = measured_of(measured)
    warnings = list(warning.of_stage(stage))
    place = source.name if isinstance(measured, Fixture | Measurement) else place_of(measured)
    problem, numbers, model = _problem(stage, source, place, unknown, warnings)
    fit = _fit(problem, level)
    rank, condition, correlation = problem.sensitivity(fit.best)
    dof = len(problem.axes) - rank
    told_apart = not (fit.allowed[1] and fit.allowed[2])
    distinct = rank == len(fit.best) and told_apart and not unexplained(fit.least, dof)
    if abs(correlation) > DEPENDENT_NUMBERS:
        warnings.append(
            f"the correlation of offset and fixture is {correlation:+.4f}: only small differences "
            "between the directions distinguish them, and errors of the model and unequal necks "
            "have the same effect"
        )
    sentence = conclusion(fit.least, dof, fit.alone[1, 0], fit.allowed, distinct)
    if sentence.startswith("Both") and numbers[0] == "pole" and fit.low[1] <= 1 <= fit.high[1]:
        sentence += " The pole as described is within the fitted interval."
    settings = {
        "measured": source.name,
        "analytic model": model,
        "confidence": f"{100 * level:g} %",
    }
    points = [str(k) for k in range(MAP)]
    judged = {
        "dof": dof,
        "condition": condition,
        "correlation": correlation,
        "distinct": distinct,
    }
    return Identification(
        about(stage, files={"measured": source}),
        _slopes_at(problem, fit.best) | fit.values() | judged | _region(problem, fit, level),
        axes={"number": numbers, "map x": points, "map y": points},
        settings=settings,
        warnings=warnings,
        notes=[sentence, "intervals by profile likelihood; unlimited where the data give no bound"],
    )


class _Fit(NamedTuple):
    """Unknowns (1 + p,) of the best fit, with their intervals, and fits of single causes.

    least : chi square of the best fit.   alone : (causes, 1 + p), in the order of `CAUSES`.
    by_cause : chi square (causes,) of these.   allowed : whether the data allow each cause.
    """

    best: Array
    low: Array
    high: Array
    least: float
    alone: Array
    by_cause: Array
    allowed: list[bool]

    def values(self) -> dict[str, Any]:
        """Return the quantities of a result."""
        return {
            "offset": self.best[0],
            "offset_low": self.low[0],
            "offset_high": self.high[0],
            "fixture": self.best[1:],
            "fixture_low": self.low[1:],
            "fixture_high": self.high[1:],
            "chi_square": self.least,
            "allowed": self.allowed,
            "cause_chi_square": self.by_cause,
            "cause_offset": self.alone[:, 0],
            "cause_fixture": self.alone[:, 1:],
        }


def _fit(problem: SlopeProblem, level: float) -> _Fit:
    """Return the best fit, its intervals at a level of confidence, and the fits of single causes."""
    best = problem.fit({})
    count = len(problem.bounds)
    low, high = np.transpose([problem.interval(best, k, level) for k in range(count)])
    zeroed = (range(count), range(1, count), range(1))  # unknowns set to zero, for each of `CAUSES`
    alone = np.array([problem.fit(dict.fromkeys(zeros, 0.0)) for zeros in zeroed])
    least = float(problem.chi_square(best))
    by_cause = problem.chi_square(alone)
    limits = [least + chi2.ppf(level, len(zeros)) for zeros in zeroed]
    allowed = [bool(by <= limit) for by, limit in zip(by_cause, limits, strict=True)]
    return _Fit(best, low, high, least, alone, by_cause, allowed)


def _slopes_at(problem: SlopeProblem, best: Array) -> dict[str, Any]:
    """Return measured and modelled slopes, and the stiffness of the fixture, by direction."""
    rigid = problem.slopes(np.zeros(len(best)))
    added = problem.added @ best[1:]
    stiffness = np.where(added > RIGID / rigid, 1 / np.maximum(added, 1e-300), np.inf)
    by_direction = np.full((5, 3), np.nan)
    by_direction[:, problem.axes] = (
        problem.slope,
        rigid,
        problem.slopes(best),
        problem.sd,
        stiffness,
    )
    return {"slope": by_direction[:3].T, "sd": by_direction[3], "stiffness": by_direction[4]}


def _region(
    problem: SlopeProblem,
    fit: _Fit,
    level: float,
) -> dict[str, Any]:
    """Return the map of chi square about the fits, and its joint limit at a level of confidence."""
    marks = np.array([fit.best, *fit.alone, fit.low, fit.high])[:, :2]
    finite = np.where(np.isinf(marks), np.nan, marks)
    offsets, fixtures, chi_squares = problem.chi_square_map(finite)
    return {
        "region_offset": offsets,
        "region_fixture": fixtures,
        "region_above": chi_squares - fit.least,
        "region_limit": float(chi2.ppf(level, 2)),
    }


def _problem(
    stage: Stage,
    measured: Fixture | Measurement,
    place: str,
    unknown: Unknown | None,
    warnings: list[str],
) -> tuple[SlopeProblem, list[str], str]:
    """Return the problem, labels of the fixture's numbers and the model's name; place: of the
    slopes, for errors.
    """
    value, sd = _checked_slopes(measured, place)
    axes = np.flatnonzero(~np.isnan(value))
    pushes = pushes_of(measured) if isinstance(measured, Fixture) else IDEAL
    offsets, C, model = _stages_with_offsets(stage, warnings)
    of_stage, pole, bar = pushes.shares(C)
    columns = _columns_of_fixture(pole, axes, unknown, place)
    rigid = (of_stage + bar)[:, axes]
    if not np.all(rigid > 0):
        raise ComputationFailed(
            f"{place}: a slope of this stage on a rigid fixture is not positive"
        )
    added = np.column_stack(list(columns.values())).astype(float)
    spline = CubicSpline(offsets, np.log(rigid))
    largest = SOFTEST / np.max(added / np.exp(spline(0.0))[:, None], axis=0)
    bounds = np.array([[offsets[0], offsets[-1]], *([0.0, end] for end in largest)])
    return SlopeProblem(axes, value[axes], sd[axes], spline, added, bounds), list(columns), model


def _checked_slopes(measured: Fixture | Measurement, place: str) -> tuple[Array, Array]:
    """Return measured slopes (3,) and their standard deviations. Raises BadInput without these."""
    assert measured.measured is not None, "of `measured_of`"
    value, sd = measured.measured.slopes
    keys = ("kxx_sd_n_per_mm", "kyy_sd_n_per_mm", "ktt_sd_n_mm_per_rad")
    missing = [
        f"measured.{key}"
        for key, slope, deviation in zip(keys, value, sd, strict=True)
        if np.isnan(deviation) and not np.isnan(slope)
    ]
    if missing:
        raise BadInput(f"{', '.join(missing)}: expected, because the intervals require it", place)
    return value, sd


def _columns_of_fixture(
    pole: Array, axes: AnyArray, unknown: Unknown | None, place: str
) -> dict[str, AnyArray]:
    """Return what each number of the fixture adds to the compliances of the slopes (m,), by name.

    pole : (3,), compliance of the described pole. Raises BadInput for a pole that is not described.
    """
    described = bool(np.any(pole[axes] > 0))
    if unknown == "pole" and not described:
        raise BadInput('unknown "pole", expected springs: these readings include no pole', place)
    columns: dict[str, AnyArray] = {"translation": axes < 2, "rotation": axes == 2}
    if described and unknown != "springs":
        columns = {"pole": pole[axes]}
    return {name: column for name, column in columns.items() if np.any(column)}


def _stages_with_offsets(stage: Stage, warnings: list[str]) -> tuple[Array, Array, str]:
    """Return neck offsets (n,), mm, the compliances (n, 3, 3) of stages with them, and the name of
    the best model.
    """
    chosen = best_model(stage, warnings)
    analyse(*chosen)  # refuses a stage without a solution at zero offset
    stage = chosen.stage
    formula = chosen.formula
    neck = stage.array("neck")
    radius = stage.array("radius")
    ends = FURTHEST * float(np.min(neck)) * np.array([-1.0, 1.0])
    if formula == CALIBRATED:
        low, high = known(formula).valid
        ends = np.clip(ends, np.max(low * radius - neck), np.min(high * radius - neck))
    offsets = np.linspace(ends[0], ends[1], GRID)
    bodies = body_compliance(stage)[None]
    K = stiffness_with_necks(stage, neck + offsets[:, None, None], formula, freedoms_of(21), bodies)
    kept = np.all(np.isfinite(K), axis=(1, 2))
    if np.count_nonzero(kept) < GRID // 4:
        raise ComputationFailed(f"stage {stage.name!r}: no model has a solution for other necks")
    return offsets[kept], inverse(K[kept]), chosen.name


def unexplained(chi_square: float, dof: int) -> bool:
    """Return whether chi square rejects the fit; without degrees of freedom, one is assumed."""
    return bool(chi2.sf(chi_square, max(dof, 1)) < POOR)


def conclusion(
    least: float,
    dof: int,
    offset: float,
    allowed: list[bool],
    distinct: bool,
) -> str:
    """State the conclusion; least : chi square of the best fit.   offset : of necks alone.
    allowed : of `CAUSES`.
    """
    neither, *causes = allowed
    necks = (
        f"ecks {abs(MICROMETRE.factor * offset):.3g} {MICROMETRE.plain} "
        f"{'wider' if offset > 0 else 'thinner'}"
    )
    if unexplained(least, dof):
        return (
            f"Necks and fixture together do not explain the data: chi square {least:.3g} at the "
            f"best fit, which by chance exceeds {chi2.isf(POOR, max(dof, 1)):.3g} once in "
            f"{1 / POOR:.0f}. Check the standard deviations, or look for another cause."
        )
    if distinct:
        return {
            (
                True,
                False,
            ): f"The necks explain the data: n{necks} than drawn. A soft fixture alone does not.",
            (False, True): "A soft fixture explains the data. A neck offset alone does not.",
            (
                False,
                False,
            ): "Both are needed: neither a neck offset nor a soft fixture alone explains the data.",
        }[causes[0], causes[1]]
    agreeing = {
        (
            True,
            True,
        ): f" Either cause alone agrees with the data: n{necks} than drawn, or a soft fixture.",
        (True, False): f" N{necks} than drawn agree with the data, a soft fixture alone does not.",
        (False, True): " A soft fixture alone agrees with the data, a neck offset alone does not.",
        (False, False): "",
    }[causes[0], causes[1]]
    if neither:
        agreeing = (
            " Neither is necessary: the stage as drawn on a rigid fixture agrees with the data."
        )
    return f"These data cannot distinguish the causes.{agreeing}"
