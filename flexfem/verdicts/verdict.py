"""What the paper claims, and what comes out: every claim of a file measured, with a verdict and its numbers."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import DEFAULT_FORMULA, analyse
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.files.provenance import doubts
from flexfem.hinges.formulas import formulas
from flexfem.mechanism.designs import lower
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import error_bands, levels
from flexfem.refused import BadInput
from flexfem.verdicts.claims import Claim, LoadedClaims, load_claims
from flexfem.verdicts.ensemble import Population, Watch, answered, metal_of_stage, populate
from flexfem.verdicts.evidence import Evidence, Metal, ModelErrors, modelled
from flexfem.verdicts.measures import MEASURES
from flexfem.verdicts.records import ClaimsReport, EnsembleRange, EnsembleReport, Verdict
from flexfem.verdicts.shares import (
    Own,
    Ruling,
    StageShare,
    dependence_of,
    in_order,
    numbers_of,
    ruling,
    said_of,
    share_of,
)
from flexfem.verify.alternatives import alternatives
from flexfem.verify.protocol import Solve, solve_stage
from flexfem.verify.result import versions

Populate = Callable[[LoadedClaims], Population]
MOBILITIES = (3, 6)


class _Grounds:
    """What claims are held against: evidence on the stages of a file and over an ensemble, by hinge formula."""

    def __init__(self, loaded: LoadedClaims, solve: Solve, population: Population | None) -> None:
        self.loaded, self.solve, self.population = loaded, solve, population
        self.reference = functools.cache(self._reference)
        self.drawn = functools.cache(self._drawn)
        self.over = functools.cache(self._over)

    def _reference(self, formula: str) -> Evidence | None:
        """Evidence on the two stages of the file; None where the formula has no answer for them.

        Raises BadInput where the paper's formula has none.
        """
        sides = (self.loaded.three, self.loaded.six)
        try:
            three, six = (errors_of_model(*each, self.solve, formula) for each in zip(sides, MOBILITIES, strict=True))
        except BadInput:
            if formula == DEFAULT_FORMULA:
                raise
            return None
        return Evidence(three, six, self.loaded.claims.amplitude)

    def in_range(self, formula: str) -> bool:
        """Whether the formula is meant for the hinges of the two stages of the file."""
        return all(bool(answered(lower(side), formula)[0]) for side in (self.loaded.three, self.loaded.six))

    def _drawn(self, formula: str) -> tuple[Population, Evidence] | None:
        """The pairs of the ensemble that the formula has an answer for, with evidence on them; None where none has."""
        if self.population is None:
            return None
        sides = (self.population.three, self.population.six)
        rows = np.all([answered(side.designs, formula) for side in sides], axis=0)
        if not rows.any():
            return None
        those = self.population.of_rows(rows)
        three, six = modelled(those.three, 3, formula), modelled(those.six, 6, formula)
        return those, Evidence(three, six, self.loaded.claims.amplitude)

    def _over(self, measure: str, formula: str) -> Array | None:
        """Values (n, k) of the pairs of the ensemble; None where the formula has an answer for none."""
        drawn, of = self.drawn(formula), MEASURES[measure]
        return None if drawn is None else of.values(drawn[1].first(of.most))

    @property
    def doubts(self) -> str:
        """What is to be said of the dimensions of the two stages."""
        found = doubts([("", self.loaded.three), ("", self.loaded.six)])
        kinds = (("on assumed dimensions", found.assumed), ("on dimensions without a source", found.not_stated))
        return " and ".join(what for what, keys in kinds if keys)


def measure_claims(
    path: str | os.PathLike[str], solve: Solve = solve_stage, draw: Populate = populate
) -> list[Verdict]:
    """Measure every claim of a file, in its order. Raises BadInput, ComputationFailed."""
    return _verdicts(_grounds(load_claims(path), functools.cache(solve), draw))


def report_claims(
    path: str | os.PathLike[str], solve: Solve = solve_stage, watch: Watch = lambda done, of: None
) -> ClaimsReport:
    """Measure every claim of a file, and what else could explain those that do not come out.

    Raises BadInput, ComputationFailed.
    """
    loaded, solve = load_claims(path), functools.cache(solve)
    grounds = _grounds(loaded, solve, lambda loaded: populate(loaded, watch))
    found = doubts([("", loaded.three), ("", loaded.six), ("claims: ", loaded.claims)])
    sides = (loaded.three, loaded.six)
    return ClaimsReport(
        name=loaded.claims.name,
        file=str(path),
        verdicts=_verdicts(grounds),
        ensemble=_ensemble(grounds),
        alternatives=alternatives(*sides, solve),
        assumed=found.assumed,
        not_stated=found.not_stated,
        warnings=[f"stage {side.name!r}: {text}" for side in sides for text in warning.of_stage(side)],
        versions=versions(),
    )


def _grounds(loaded: LoadedClaims, solve: Solve, draw: Populate) -> _Grounds:
    return _Grounds(loaded, solve, None if loaded.claims.ensemble is None else draw(loaded))


def errors_of_model(stage: Stage, mobility: int, solve: Solve, formula: str = DEFAULT_FORMULA) -> ModelErrors:
    """Model and finite elements of one stage, n = 1, with the mesh band of their errors."""
    K, lever = analyse(stage, mobility, formula).stiffness, stage.chain.link_lengths[2]
    found = np.array([solve(stage, level).response.compliance for level in levels(RESOLUTION)])
    percent, band = error_bands(K, found, levels(RESOLUTION), lever)
    metal = Metal((stage,), lower(stage), body_compliance(stage)[None], found[-1][None])
    return ModelErrors(metal, mobility, formula, K[None], percent[None], band[None])


def _verdicts(grounds: _Grounds) -> list[Verdict]:
    return [_verdict(claim, grounds) for claim in grounds.loaded.claims.claim]


def _verdict(claim: Claim, grounds: _Grounds) -> Verdict:
    measure, on = MEASURES[claim.measure], grounds.reference(DEFAULT_FORMULA)
    assert on is not None
    values = measure.values(on)[0]
    found = measure.found(on, values) + (f", {grounds.doubts}" if grounds.doubts and measure.dimensional else "")
    about = {
        "id": claim.id,
        "statement": claim.statement,
        "where": claim.where,
        "reading": claim.reading,
        "values": values.tolist(),
        "missing": claim.missing,
        "argument": measure.argument if on.alike or not measure.symmetric else None,
    }
    if claim.missing is not None:
        return Verdict(**about, verdict="cannot be decided", found=f"{found}; missing: {claim.missing}")
    own: Ruling = "holds" if claim.holds(values[None])[0] else "does not hold"
    shares = _shares(claim, grounds, values) if measure.dimensional else []
    if not shares:
        alone = "; on these dimensions alone, with no ensemble of stages" if measure.dimensional else ""
        return Verdict(**about, verdict=own, found=found + alone)
    drawn, over = grounds.drawn(DEFAULT_FORMULA), grounds.over(claim.measure, DEFAULT_FORMULA)
    assert drawn is not None and over is not None
    names = tuple(each.said for each in grounds.loaded.columns)
    depends = dependence_of(claim, over, numbers_of(names, drawn[0]))
    said = said_of(shares, depends, over, measure.by_formula)
    return Verdict(**about, verdict=ruling(shares[0]), found=found, ensemble=said, shares=shares, depends=depends)


def _shares(claim: Claim, grounds: _Grounds, own: Array) -> list[StageShare]:
    """Shares by hinge formula, the paper's first; that alone where the values do not follow it. Empty without it."""
    measure, found = MEASURES[claim.measure], list[StageShare]()
    for formula in in_order(formulas()) if measure.by_formula else (DEFAULT_FORMULA,):
        over, share = grounds.over(claim.measure, formula), None
        if over is not None:
            values: Array | None = own
            if formula != DEFAULT_FORMULA:
                reference = grounds.reference(formula)
                values = None if reference is None else measure.values(reference)[0]
            share = share_of(claim, measure, over, Own(formula, values, grounds.in_range(formula)))
        if share is not None:
            found.append(share)
        elif formula == DEFAULT_FORMULA:
            return []
    return found


def _ensemble(grounds: _Grounds) -> EnsembleReport | None:
    population, ensemble = grounds.population, grounds.loaded.claims.ensemble
    if population is None or ensemble is None:
        return None
    numbers = numbers_of(tuple(each.said for each in grounds.loaded.columns), population)
    return EnsembleReport(
        drawn=population.drawn,
        infeasible=population.infeasible,
        off_chart=population.off_chart,
        judged=len(population.values),
        seed=ensemble.seed,
        ranges=[
            EnsembleRange(name=name, least=float(np.min(column)), most=float(np.max(column)))
            for name, column in numbers.items()
        ],
        metal_off=_metal_off(grounds),
    )


def _metal_off(grounds: _Grounds) -> float | None:
    """How far the errors of the file's own stages are from those on finite elements, percentage points."""
    on, sides = grounds.reference(DEFAULT_FORMULA), (grounds.loaded.three, grounds.loaded.six)
    metals = [metal_of_stage(side) for side in sides]
    assert on is not None
    off = [
        np.max(np.abs(modelled(metal, of.mobility, of.formula).percent - of.percent))
        for metal, of in zip(metals, (on.three, on.six), strict=True)
        if metal is not None
    ]
    return float(max(off)) if len(off) == len(sides) else None
