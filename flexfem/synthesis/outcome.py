"""From requirements to a record: search, proof, prices, and the stage as a file."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from flexfem.analytic.model import best_model
from flexfem.arrays import Array
from flexfem.files.provenance import Doubts, is_assumed
from flexfem.files.refusals import key_path, path_of
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import of_heat
from flexfem.questions.drive import commanding, engaged_stiffness, push_spread
from flexfem.study.columns import BANDS, CROSSES, DRIFTS, DRIVE_RANGES, ENGAGED, ERRORS, FREQUENCIES, GRADIENTS
from flexfem.study.loaded import stage_of
from flexfem.synthesis.doubts import doubts_of
from flexfem.synthesis.elements import ProposedElements
from flexfem.synthesis.front import front, proven
from flexfem.synthesis.many import front_of_many, require_pymoo
from flexfem.synthesis.mapping import Mapped, Proof, mapped, quantities_of, round_off
from flexfem.synthesis.model import WORST, Model
from flexfem.synthesis.prices import Prices, prices, sensitivities
from flexfem.synthesis.relaxed import alternatives
from flexfem.synthesis.requirements import SCATTERED, LoadedRequirements
from flexfem.synthesis.result import (
    Checked,
    Designed,
    FrontDesign,
    Goal,
    Requirement,
    ScatteredCoupling,
    SoleRelaxation,
    Step,
    Turn,
    Verdict,
    finite,
)
from flexfem.synthesis.scatter import OTHERS
from flexfem.synthesis.scattered import ScatteredStages
from flexfem.synthesis.search import Say
from flexfem.verify.result import versions

PLANE_ALONE = (*DRIVE_RANGES, *ENGAGED, *DRIFTS, *GRADIENTS, *FREQUENCIES, *ERRORS, *CROSSES, *BANDS)
SHOWN = 200  # steps of a history


def designed(loaded: LoadedRequirements, elements: ProposedElements, say: Say = lambda text: None) -> Designed:
    """The best stage that meets requirements, or the one that misses least.

    Raises
    ------
    ComputationFailed : finite elements of a proposed design fail.   BadInput : pymoo is needed and not installed.
    """
    require_pymoo(loaded)
    model = Model(loaded, counts=elements.counts)
    found = mapped(model, elements, say)
    last, best = found.rounds[-1], found.optima[-1]
    reached = best.merit < WORST
    say("prices and sensitivities")
    costs = prices(found.model, best.relaxed)
    goals, kept = _goals(found, last), _kept(found, last, costs)
    stage = made(loaded, last.values)
    of = loaded.requirements
    missed = list[SoleRelaxation]()
    if not reached and any(each.verdict == "missed" for each in kept):
        missed += alternatives(found.model.changed(guard=None), last.values, of.seed)
    best_of_both = _front(found, elements, say) if model.objectives > 1 and reached else []
    return Designed(
        name=of.name,
        file=str(loaded.path),
        base=of.stage,
        hash=stage.hash,
        seed=of.seed,
        accuracy_percent=of.accuracy_percent,
        design=_named(loaded, last.values),
        relaxed=_named(loaded, best.relaxed),
        stage=stage.to_toml(),
        feasible=all(each.verdict != "missed" for each in kept),
        agreed=found.agreed,
        objectives=goals,
        requirements=kept,
        alternatives=missed,
        at_ends=costs.at_ends,
        sensitivities=_sensitivities(found.model, last),
        rounds=_turns(found),
        front=best_of_both,
        scattered=_scattered(loaded, last.scattered),
        history=_thinned(found.optima[0].history),
        evaluations=dict(sorted(elements.counts.items())),
        versions=versions(),
        warnings=_warnings(loaded, found, last),
        **_doubts(loaded, stage),
    )


def _turns(found: Mapped) -> list[Turn]:
    loaded = found.model.loaded
    return [
        Turn(design=_named(loaded, r.values), gap_percent=100 * r.gap, evaluations=o.history[-1][0])
        for r, o in zip(found.rounds, found.optima, strict=True)
    ]


def made(loaded: LoadedRequirements, values: Array) -> Stage:
    """The stage of a design (d,), its free dimensions said to be designed; the other sources are the base's."""
    base, stage = loaded.stage, stage_of(loaded.study, values)
    of = loaded.requirements
    said = f"designed: {of.name}, seed {of.seed}"
    sources = dict(base.provenance)
    own = base.sources
    for column in loaded.columns:
        for path in column.keys:
            place = path_of(path)
            if isinstance(place[-1], int):
                array = key_path(place[:-1])
                sources[array] = _of_array(own.get(array) or "not stated", sources.get(array), said, place[-1])
            else:
                sources[path] = said
    return stage.model_copy(update={"name": of.name, "provenance": sources})


def _of_array(before: str, now: str | None, said: str, place: int) -> str:
    """The source of an array some members of which are designed; one that is assumed in part goes on being assumed."""
    lead = "assumed in part: " if is_assumed(before) else "in part "
    if now is not None and now.startswith(lead) and said in now:
        head, _, rest = now.partition(f"] {said}")
        return f"{head}, {place}] {said}{rest}"
    return f"{lead}[{place}] {said}; the others {before}"


def _named(loaded: LoadedRequirements, values: Array) -> dict[str, float]:
    return {column.name: float(value) for column, value in zip(loaded.columns, values, strict=True)}


def checked_by(model: Model, expression_names: frozenset[str], solid: bool) -> Checked:
    """What the value of a quantity rests on, by all names that it uses."""
    tolerance = model.loaded.requirements.tolerance
    unchecked = {*PLANE_ALONE} if solid else set[str]()
    unchecked |= {name for name in expression_names if name.startswith(("life_", "safety_")) and solid}
    unchecked |= {*SCATTERED} if tolerance is None or not tolerance.checked or solid else set()
    if expression_names & unchecked:
        return "analytic model alone"
    if not expression_names & ({*model.loaded.requirements.base, *ERRORS, *SCATTERED}):
        return "exact"  # mass and envelope of the drawing, dimensions themselves
    return "finite elements in three dimensions" if solid else "finite elements"


def _quantity(found: Mapped, of: Proof, place: int, text: str, label: str) -> dict[str, Any]:
    asked = found.model.loaded.requirements.names_of(text)
    by = checked_by(found.model, asked, found.model.loaded.stage.model == "corrected")
    sampled = bool(asked & {*SCATTERED})
    banded = by.startswith("finite") or sampled
    return {
        "name": text,
        "label": label,
        "value": float(of.elements[place]),
        "band": float(of.bands[place]) if banded else None,
        "sampling": float(of.sampling[place]) if sampled else None,
        "uncorrected": float(of.uncorrected[place]),
        "checked_by": by,
        "push_spread": _push_spread(found, of, place) if asked & {*ENGAGED} else None,
        "round_off": float(round_off(found.model, of)[place]),
    }


def _push_spread(found: Mapped, of: Proof, place: int) -> float:
    """By how much a quantity moves with engaged stiffness where the pushes of stacks spread otherwise."""
    stage = stage_of(found.model.loaded.study, of.values)
    model = commanding(best_model(stage, []))
    part = push_spread(model) / engaged_stiffness(model.of)
    ends = [of.columns | {n: of.columns[n] * (1 + s * p) for n, p in zip(ENGAGED, part, strict=True)} for s in (-1, 1)]
    return max(abs(float(quantities_of(found.model, end)[place] - of.elements[place])) for end in ends)


def _goals(found: Mapped, last: Proof) -> list[Goal]:
    of = found.model.loaded.requirements.objective
    return [
        Goal(**_quantity(found, last, k, each.quantity, each.said), better="larger" if each.sign < 0 else "smaller")
        for k, each in enumerate(of)
    ]


def _kept(found: Mapped, last: Proof, costs: Prices) -> list[Requirement]:
    model, kept = found.model.changed(guard=None), list[Requirement]()
    low, high = model.ends
    guard = np.zeros(len(low)) if found.model.guard is None else found.model.guard
    tight = np.minimum(guard, model.room / model.scales)
    for k, each in enumerate(model.loaded.requirements.require):
        about = _quantity(found, last, model.objectives + k, each.quantity, each.said)
        value, band, size = about["value"], about["band"] or 0.0, float(model.scales[k])
        margin = float(min(value - low[k], high[k] - value))
        verdict: Verdict = "met" if margin >= band else "within the band" if margin >= -band else "missed"
        kept.append(
            Requirement(
                **about,
                at_least=each.at_least,
                at_most=each.at_most,
                size=size,
                margin=margin,
                margin_percent=100 * margin / size,
                band_percent=None if about["band"] is None else 100 * band / size,
                verdict=verdict,
                active=costs.active[k],
                price_percent=finite(float(costs.price[k])),
                relax_to=value if verdict == "missed" else None,
                tightened_percent=100 * float(tight[k]),
            )
        )
    return kept


def _front(found: Mapped, elements: ProposedElements, say: Say) -> list[FrontDesign]:
    of = found.model.loaded.requirements
    search = front if found.model.objectives == 2 else front_of_many
    designs = search(found.model, found.optima[-1].relaxed, of.front, of.seed, say, elements.store)
    loaded = found.model.loaded
    return [
        FrontDesign(
            design=_named(loaded, one.values),
            values=one.elements.tolist(),
            predicted=one.predicted.tolist(),
            margins_percent=(100 * one.margins).tolist(),
            met=one.met,
            stage=made(loaded, one.values).to_toml(),
        )
        for one in proven(found.model, elements, designs, say)
    ]


def _sensitivities(model: Model, of: Proof) -> dict[str, dict[str, float | None]]:
    """By dimension and quantity; none of a quantity that its band does not tell from zero."""
    names, zero = model.loaded.requirements.quantities, np.abs(of.elements) <= of.bands
    rows = np.where(zero, np.nan, sensitivities(model, of.values))
    return {
        column.name: {name: finite(float(value)) for name, value in zip(names, row, strict=True)}
        for column, row in zip(model.loaded.columns, rows, strict=True)
    }


def _thinned(history: list[tuple[int, float | None, float]]) -> list[Step]:
    places = np.unique(np.linspace(0, len(history) - 1, min(SHOWN, len(history))).astype(int))
    return [Step(evaluations=history[k][0], objective=history[k][1], missed=history[k][2]) for k in places]


def _warnings(loaded: LoadedRequirements, found: Mapped, last: Proof) -> list[str]:
    said = []
    if not found.agreed:
        gap = 100 * last.gap
        still = f"model and finite elements still differ by {gap:.3g} %"
        if gap <= loaded.requirements.accuracy_percent:
            still = "a requirement is still not kept with its band, or within it where there is no room"
        said.append(f"after {len(found.rounds)} rounds {still}")
    said += doubts_of(loaded, last.values, last.columns)
    tolerance = loaded.requirements.tolerance
    if tolerance is not None and not tolerance.checked:
        said.append("coupling under tolerance is of the analytic model: tolerance.checked is 0")
    return said


def _scattered(loaded: LoadedRequirements, of: ScatteredStages | None) -> list[ScatteredCoupling]:
    """What couplings under tolerance rest on, of those that are asked."""
    tolerance = loaded.requirements.tolerance
    if tolerance is None or of is None:
        return []
    return [
        ScatteredCoupling(
            name=name,
            searched=float(of.searched[k]),
            searched_stages=tolerance.stages,
            others=float(of.others.value[k]),
            low=float(of.others.low[k]),
            high=float(of.others.high[k]),
            other_stages=OTHERS,
            checked_stages=tolerance.checked if of.fits else 0,
            factor=float(of.fits[-1].factor[k]) if of.fits else None,
            misfit=float(of.fits[-1].misfit[k]) if of.fits else None,
        )
        for k, name in enumerate(SCATTERED)
        if name in loaded.requirements.asked
    ]


def _doubts(loaded: LoadedRequirements, stage: Stage) -> dict[str, list[str]]:
    """Key paths, of the stage and of the requirements, that are assumed or whose source is not stated."""
    of, study = loaded.requirements, loaded.study.study
    asked = [stage.drive_doubts] if study.driven else []
    asked += [stage.heat_doubts] if study.drift is not None else []
    pairs = asked or [Doubts([*stage.assumed], [*stage.not_stated])]
    every = [list(dict.fromkeys(chain(*(each[k] for each in pairs)))) for k in range(2)]
    both = [[key for key in keys if study.drift is not None or not of_heat(key)] for keys in every]
    own = [key for key, source in of.provenance.items() if is_assumed(source)]
    return {
        "assumed": [*(f"stage: {key}" for key in both[0]), *(f"requirements: {key}" for key in own)],
        "not_stated": [*(f"stage: {key}" for key in both[1]), *(f"requirements: {key}" for key in of.not_stated)],
    }
