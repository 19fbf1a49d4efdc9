"""In what share of an ensemble a claim holds, how sure that share is, and which dimension it goes with."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA
from flexfem.arrays import Array
from flexfem.mechanism.stage import HINGE_NAMES
from flexfem.verdicts.claims import Claim
from flexfem.verdicts.ensemble import Population
from flexfem.verdicts.measures import Measure
from flexfem.verify.result import Record

Ruling: TypeAlias = Literal["holds", "does not hold", "depends on the dimensions", "cannot be decided"]
CONFIDENCE = 0.95  # of the interval of a share
MOST = 0.95  # share of the stages in which a claim must hold to hold, and fail to fail
ROUND_OFF = 1e-5  # per cent: values below are zeros, of nearly straight chains too
MIDDLE = (0.05, 0.95)  # quantiles of what is said of holding stages, and of measured values


class StageShare(Record):
    """Of how many stages of an ensemble a claim holds, with one hinge formula.

    stages : with a value.   holding : of these.   share : the quotient.
    surely, perhaps : in how many it holds though, or if, every value is as far off as the metal's may be.
    low, high : ends of the confidence interval of the share, by `surely` at the low end and `perhaps` at the high end.
    reference : values of the two stages of the file, whether it holds there, and whether
        the formula is meant for them; none where it has no answer.
    """

    formula: str
    stages: int
    holding: int
    share: float
    surely: int
    perhaps: int
    low: float
    high: float
    reference: list[float]
    reference_holds: bool | None
    reference_in_range: bool


class Own(NamedTuple):
    """What the two stages of a file have with a hinge formula: values (k,) or None, whether it is meant for them."""

    formula: str
    values: Array | None
    in_range: bool


class Dependence(Record):
    """The number of the stages that tells best those in which a claim holds from those in which it fails.

    distance : largest difference of its distributions over the two, 0 to 1 (Kolmogorov and Smirnov).
    holding, failing : quantiles of `MIDDLE` over each of the two.   drawn : least and largest over all.
    """

    name: str
    distance: float
    holding: tuple[float, float]
    failing: tuple[float, float]
    drawn: tuple[float, float]


def binomial_interval(low: int, high: int, stages: int) -> tuple[float, float]:
    """Ends of the confidence interval of a share of which between `low` and `high` of some stages are known to have it.

    Notes
    -----
    The exact interval of C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404: it holds the share in no less than
    `CONFIDENCE` of ensembles, however few the stages are.
    """
    from scipy.stats import binomtest

    def ends(count: int) -> tuple[float, float]:
        found = binomtest(count, stages).proportion_ci(CONFIDENCE, method="exact")
        return float(found.low), float(found.high)

    return ends(low)[0], ends(high)[1]


def share_of(claim: Claim, measure: Measure, values: Array, own: Own) -> StageShare | None:
    """The share of a claim by the values (n, k) of an ensemble; None where no stage has a value."""
    known = values[np.all(np.isfinite(values), axis=-1)]
    if not len(known):
        return None
    holding = int(np.sum(claim.holds(known)))
    surely, perhaps = (int(np.sum(claim.holds(known, slack))) for slack in (-measure.slack, measure.slack))
    low, high = binomial_interval(surely, perhaps, len(known))
    return StageShare(
        formula=own.formula,
        stages=len(known),
        holding=holding,
        share=holding / len(known),
        surely=surely,
        perhaps=perhaps,
        low=low,
        high=high,
        reference=[] if own.values is None else own.values.tolist(),
        reference_holds=None if own.values is None else bool(claim.holds(own.values[None])[0]),
        reference_in_range=own.in_range,
    )


def ruling(share: StageShare) -> Ruling:
    """Verdict by the whole interval of a share, so that few stages cannot tip it."""
    if share.low >= MOST:
        return "holds"
    if share.high <= 1 - MOST:
        return "does not hold"
    both = share.surely > 0 and share.perhaps < share.stages  # it holds in some stages for sure, and fails in others
    return "depends on the dimensions" if both else "cannot be decided"


def dependence_of(claim: Claim, values: Array, numbers: dict[str, Array]) -> Dependence | None:
    """Which of the numbers, of n or more stages, tells best where a claim holds by the values (n, k) of the first n.

    None where it holds in all stages or in none: no number decides it there.
    """
    from scipy.stats import ks_2samp

    known = np.all(np.isfinite(values), axis=-1)
    holding = claim.holds(values) & known
    if not holding.any() or not numbers or np.array_equal(holding, known):
        return None
    split = {
        name: (column[: len(values)][holding], column[: len(values)][known & ~holding])
        for name, column in numbers.items()
    }
    distance = {name: float(ks_2samp(*parts).statistic) for name, parts in split.items()}
    name = max(distance, key=lambda each: distance[each])
    both = np.concatenate(split[name])
    inside, outside = (tuple(np.quantile(part, MIDDLE).tolist()) for part in split[name])
    drawn = (float(np.min(both)), float(np.max(both)))
    return Dependence(name=name, distance=distance[name], holding=inside, failing=outside, drawn=drawn)


def numbers_of(names: tuple[str, ...], population: Population) -> dict[str, Array]:
    """Numbers (n,) that the stages of an ensemble differ in, by name: its columns, and t/R where chains are alike."""
    found = {name: population.values[:, place] for place, name in enumerate(names)}
    sides = [of.designs for of in (population.three, population.six)]
    for position, hinge in enumerate(HINGE_NAMES) if all(designs.alike for designs in sides) else ():
        three, six = (designs.neck[:, 0, position] / designs.radius[:, 0, position] for designs in sides)
        if np.array_equal(three, six):
            found[f"t/R of the {hinge} hinges"] = six
        else:
            found |= {f"t/R of the {hinge} hinges of stage {side}": r for side, r in (("three", three), ("six", six))}
    return {name: column for name, column in found.items() if np.ptp(column) > 0}


def said_of(shares: list[StageShare], depends: Dependence | None, values: Array, by_formula: bool) -> str:
    """What an ensemble says of a claim, in a sentence; `values` (n, k) with the formula of the first share."""
    first, others, here = shares[0], shares[1:], shares[0].reference_holds
    with_formula = f" with hinge formula {first.formula}" if by_formula else ""
    parts = [
        f"holds in {_percent(first.share)} % of {first.stages} stages (95 % interval {_percent(first.low)} to"
        f" {_percent(first.high)} %){with_formula}, {_spread(values)}"
    ]
    if ruling(first) == "cannot be decided":
        parts.append("too few stages to decide")
    if depends is not None:
        holding, failing = (f"{low:.3g} to {high:.3g}" for low, high in (depends.holding, depends.failing))
        parts.append(f"{depends.name} decides most: {holding} where it holds, {failing} where not")
    if others:
        parts.append(f"with other formulas in {', '.join(_together(others))}")
        own = [f"{each.formula} ({_values(each)})" for each in others if each.reference_holds == (not here)]
        parts += [f"on the stages of the file it {'fails' if here else 'holds'} with {', '.join(own)}"] if own else []
    return "; ".join(parts)


def _spread(values: Array) -> str:
    low, high = np.nanquantile(values, MIDDLE)
    if np.nanmax(np.abs(values)) < ROUND_OFF:
        return f"every value below {ROUND_OFF:.0e} %"
    return f"values {low:.3g} to {high:.3g} % in nine of ten"


def _values(share: StageShare) -> str:
    low, high = f"{min(share.reference):.3g}", f"{max(share.reference):.3g}"
    off = "" if share.reference_in_range else ", t/R outside its range"
    return f"{low if low == high else f'{low} to {high}'} %{off}"


def _together(shares: list[StageShare]) -> list[str]:
    """Shares by formula, those that are alike together."""
    names: dict[str, list[str]] = {}
    for share in shares:
        names.setdefault(f"{_percent(share.share)} % of {share.stages}", []).append(share.formula)
    return [f"{said} ({', '.join(formulas)})" for said, formulas in names.items()]


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


def in_order(formulas: tuple[str, ...]) -> tuple[str, ...]:
    """The paper's formula first: the verdict is by it. The metal's own is none of a model to be judged."""
    return (DEFAULT_FORMULA, *(name for name in formulas if name not in (DEFAULT_FORMULA, CALIBRATED)))
