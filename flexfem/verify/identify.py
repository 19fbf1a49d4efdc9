"""`flexfem identify`: which neck offset and which soft fixture explain measured slopes, and whether these can tell."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.stats import chi2

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import CALIBRATED, at_rest, best_model, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import Array, inverse
from flexfem.files.provenance import doubts
from flexfem.hinges.formulas import formula as known
from flexfem.mechanism.designs import lower
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.refused import BadInput, ComputationFailed
from flexfem.units import DIRECTIONS
from flexfem.verify.fixture import Fixture, Measurement
from flexfem.verify.identified import Alone, Identification, Region, Unknown, finding, unexplained
from flexfem.verify.pushes import IDEAL, pole_share, pushes_of, read_compliance
from flexfem.verify.result import about
from flexfem.verify.slope_fit import AT_END, SOFTEST, Estimate, Fit, SlopeProblem, fit, interval, rank_of, sensitivity

GRID = 161  # offsets at which the compliance is computed; a spline between them
FURTHEST = 0.5  # of the thinnest neck: offsets that are looked at
DEPENDENT = 0.98  # correlation: a fifth of what either number does is not done by the other
RIGID = 1e-9  # of the stage's compliance: a fixture that adds no more is rigid but for round-off
MAP = 121  # points of the map of chi square along each axis


def identify(
    stage: Stage, measured: Fixture | Measurement, unknown: Unknown | None = None, confidence: float = 95.0
) -> Identification:
    """Fit a common offset of the nine necks and the softness of the fixture to measured slopes.

    Parameters
    ----------
    measured : slopes with standard deviations, with or without the set-up that they were measured with.
    unknown : `pole`, how many times softer than described the pole of the set-up is, in bending and torsion alike
        (0: rigid); `springs`, in its place two springs, one in x and y and one in rotation. Default: the pole where one
        is described.
    confidence : of the intervals, per cent.

    Raises BadInput when no slopes or standard deviations are given, or no pole is described that could be unknown.

    Notes
    -----
    Nonlinear least squares, chi square the sum of squared deviations over the variances as stated. Intervals are by
    profile likelihood: all values at which the best of the others takes chi square no further above its least than the
    quantile of one degree of freedom. A cause alone is allowed when chi square without the other is within the quantile
    of as many degrees as numbers were dropped.
    """
    warnings = list(warning.of_stage(stage))
    problem, nominal, columns, model = _problem(stage, measured, unknown, warnings)
    of, best = [DIRECTIONS[k] for k in problem.axes], fit(problem, {})
    soft = problem.fixture @ best.x[1:]
    told = _told(problem, best, columns, confidence / 100)
    found = Identification(
        **about(stage) | doubts([("", stage), ("measured: ", measured)])._asdict(),
        name=stage.name,
        source=measured.name,
        model=model,
        confidence=confidence,
        unknown="pole" if "pole" in columns else "springs",
        measured=dict(zip(of, problem.slope.tolist(), strict=True)),
        sd=dict(zip(of, problem.sd.tolist(), strict=True)),
        nominal=dict(zip(of, nominal.tolist(), strict=True)),
        fitted=dict(zip(of, problem.slopes(best.x).tolist(), strict=True)),
        stiffness={axis: 1 / c if c > RIGID / k else None for axis, c, k in zip(of, soft, nominal, strict=True)},
        **told,
        finding="",
        warnings=[*warnings, *_of_dependence(told["correlation"])],
    )
    return found.model_copy(update={"finding": finding(found)})


def _told(of: SlopeProblem, best: Fit, columns: list[str], level: float) -> dict[str, Any]:
    """What the data tell of each number and of causes alone: fields of `Identification`."""
    count = len(of.ends)
    estimates = [interval(of, best, k, level) for k in range(count)]
    alone = [_alone(of, best, dropped, level) for dropped in (range(count), range(1, count), range(1))]
    condition, correlation = sensitivity(of, best.x)
    dof = len(of.axes) - (count if condition is not None else rank_of(of, best.x))
    either = alone[1].allowed and alone[2].allowed
    return {
        "offset": estimates[0],
        "fixture": dict(zip(columns, estimates[1:], strict=True)),
        "chi_square": best.chi_square,
        "dof": dof,
        "condition": condition,
        "correlation": correlation,
        **dict(zip(("neither", "necks_alone", "fixture_alone"), alone, strict=True)),
        "told_apart": condition is not None and not either and not unexplained(best.chi_square, dof),
        "region": _region(of, _marks(best, estimates, alone), best.chi_square, level),
    }


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
    pole = pole_share(pushes)
    if unknown == "pole" and not np.any(pole[axes] > 0):
        raise BadInput('unknown "pole", expected springs: no pole is in these readings', measured.name)
    bare = pushes._replace(pole=np.zeros_like(pushes.pole))
    offsets, C, model = _stages(stage, warnings)
    read = read_compliance(bare, C)[:, axes]
    if not np.all(read > 0):
        raise ComputationFailed(f"{measured.name}: a slope of this stage on a rigid fixture is not positive")
    spline = CubicSpline(offsets, np.log(read))
    at = np.exp(spline(0.0))
    if unknown != "springs" and np.any(pole[axes] > 0):
        columns, fixture = ["pole"], pole[axes, None]
    else:
        columns = [name for name, own in (("translation", axes < 2), ("rotation", axes == 2)) if np.any(own)]
        fixture = np.column_stack([own for own in (axes < 2, axes == 2) if np.any(own)]).astype(float)
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


def _alone(of: SlopeProblem, best: Fit, dropped: range, level: float) -> Alone:
    """The best fit with some numbers at zero."""
    one = fit(of, dict.fromkeys(dropped, 0.0))
    allowed = one.chi_square - best.chi_square <= float(chi2.ppf(level, len(dropped)))
    return Alone(numbers=one.x.tolist(), chi_square=one.chi_square, allowed=bool(allowed))


def _of_dependence(correlation: float | None) -> warning.Warnings:
    if correlation is None or abs(correlation) <= DEPENDENT:
        return []
    return [
        f"the correlation of offset and fixture is {correlation:+.4f}: small differences between the directions tell "
        "them apart, which errors of the model and unequal necks make as well"
    ]


def _marks(best: Fit, estimates: list[Estimate], alone: list[Alone]) -> Array:
    """Points (n, 2) of offset and first number of the fixture: best fit, causes alone, ends of the intervals."""
    ends = [[getattr(each, end) for each in estimates[:2]] for end in ("low", "high")]
    return np.array([best.x[:2], *(each.numbers[:2] for each in alone), *ends], dtype=float)


def _region(of: SlopeProblem, marks: Array, least: float, level: float) -> Region:
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
    return Region(
        offset=offsets.tolist(), fixture=numbers.tolist(), above=above.tolist(), limit=float(chi2.ppf(level, 2))
    )
