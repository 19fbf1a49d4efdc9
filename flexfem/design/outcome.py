"""From requirements to a record: search, proof, front, sensitivities, scatter, and the stage as a file."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from flexfem.analytic.model import best_model
from flexfem.arrays import Array
from flexfem.design import result as record
from flexfem.design.model import MISSED, ROUND_OFF, Model
from flexfem.design.proof import Proof, Proposal, ProposedElements, Store, mapped, proof, searched
from flexfem.design.requirements import SCATTERED, LoadedRequirements, Objective, Require, Tolerance
from flexfem.design.scatter import OTHERS, deviations
from flexfem.design.search import optimum
from flexfem.files.provenance import is_assumed
from flexfem.files.refusals import key_path, one_line, path_of
from flexfem.files.toml import LABEL_LENGTH
from flexfem.hinges.strength import required_law
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import of_heat
from flexfem.questions.drive import commanding, engaged_stiffness, push_spread
from flexfem.results import versions
from flexfem.study import columns as outputs
from flexfem.study.answer import answer_designs, with_warnings
from flexfem.study.factors import Factor, columns_of
from flexfem.study.findings import non_dominated
from flexfem.study.loaded import stage_of
from flexfem.units import unit_of

PLANE_ALONE = {
    *outputs.DRIVE_RANGES, *outputs.ENGAGED, *outputs.DRIFTS, *outputs.GRADIENTS, *outputs.FREQUENCIES, *outputs.ERRORS,
    *outputs.CROSSES, *outputs.BANDS,
}  # fmt: skip
SHOWN = 200  # steps of a history
ACTIVE = 1e-3  # part of its size within which a requirement is kept just so, at the optimum without steps
END = 1e-4  # of a range within which a dimension is at its end
DIFFERENCE = 1e-4  # of a dimension, by which sensitivities are found
FLAT = 1e-8  # sensitivity below which it is the round-off of a difference
KEPT = 1e-6  # part of an objective within which it is kept: room for programs at the end of a range
APART = 1e-3  # of the spans of a front, within which two designs are one
SHARED = 2000  # stages with scattered necks that the share is of


def designed(loaded: LoadedRequirements, elements: ProposedElements) -> record.Designed:
    """The best stage that meets requirements, or the one that misses least.

    Raises ComputationFailed where finite elements of a proposed design fail, BadInput where no design has an answer.
    """
    rounds, agreed = mapped(Model(loaded, counts=elements.counts, say=elements.say), elements)
    _, best, last = rounds[-1]
    model, of = rounds[-1].model, loaded.requirements
    elements.say("sensitivities")
    kept, stage, space = _requirements(rounds[-1]), made(loaded, last.values), model.space
    alternatives, front = list[record.SoleRelaxation](), list[record.FrontDesign]()
    if best.merit >= MISSED and any(each.verdict == "missed" for each in kept):
        alternatives = relaxations(replace(model, guard=0.0), last.values)
    if model.objectives > 1 and best.merit < MISSED:
        designs = front_of(model, best.relaxed, of.front, elements.store)
        front = [_front_design(model, proof(model, elements, each)) for each in designs]
    places = zip(space.names, space.listed, space.to_unit(best.relaxed[None])[0], strict=True)
    history = rounds[0].best.history
    shown = np.unique(np.linspace(0, len(history) - 1, min(SHOWN, len(history))).astype(int))
    assumed, not_stated = assumptions_of(loaded, stage)
    return record.Designed(
        name=of.name,
        file=str(loaded.path),
        base=of.stage,
        hash=stage.hash,
        seed=of.seed,
        accuracy_percent=of.accuracy_percent,
        design=space.named(last.values),
        relaxed=space.named(best.relaxed),
        stage=stage.to_toml(),
        feasible=all(each.verdict != "missed" for each in kept),
        agreed=agreed,
        objectives=[
            record.Goal(**_quantity(model, last, k, each), better="larger" if each.sign < 0 else "smaller")
            for k, each in enumerate(of.objective)
        ],
        requirements=kept,
        alternatives=alternatives,
        at_ends=[name for name, listed, u in places if not listed and not END < u < 1 - END],
        sensitivities=_sensitivities(model, last),
        rounds=[
            record.Round(
                design=space.named(each.best.values),
                gap_percent=100 * each.proof.gap,
                evaluations=each.best.history[-1][0],
            )
            for each in rounds
        ],
        front=front,
        scattered=_scattered(model, last),
        history=[record.Step(**dict(zip(record.Step.model_fields, history[k], strict=True))) for k in shown],
        evaluations=dict(sorted(elements.counts.items())),
        versions=versions(),
        warnings=_warnings(loaded, rounds, agreed),
        assumed=assumed,
        not_stated=not_stated,
    )


def made(loaded: LoadedRequirements, values: Array) -> Stage:
    """The stage of a design (d,), its free dimensions said to be designed; the other sources are the base's."""
    base, stage, of = loaded.stage, stage_of(loaded.study, values), loaded.requirements
    source = f"designed: {of.name}, seed {of.seed}"
    sources, members = dict(base.provenance), dict[str, list[int]]()
    for path in (path for column in loaded.columns for path in column.keys):
        *table, last = path_of(path)
        if isinstance(last, int):
            members.setdefault(key_path(tuple(table)), []).append(last)
        else:
            sources[path] = source
    for path, indices in members.items():  # one that is assumed in part goes on being assumed
        before = base.sources.get(path) or "not stated"
        lead = "assumed in part" if is_assumed(before) else "in part"
        sources[path] = f"{lead}: [{', '.join(map(str, sorted(indices)))}] {source}; the others {before}"
    provenance = {path: one_line(text, LABEL_LENGTH) for path, text in sources.items()}
    return stage.model_copy(update={"name": of.name, "provenance": provenance})


def checked_by(loaded: LoadedRequirements, names: frozenset[str]) -> record.Checked:
    """What the value of a quantity rests on, by all names that it uses."""
    of, solid = loaded.requirements, loaded.solid
    unchecked = PLANE_ALONE | {name for name in names if name.startswith(("life_", "safety_"))} if solid else set[str]()
    unchecked |= {*SCATTERED} if of.tolerance is None or not of.tolerance.checked or solid else set()
    if names & unchecked:
        return "analytic model alone"
    if not names & {*of.study.outputs, *outputs.ERRORS, *SCATTERED}:
        return "exact"  # mass and envelope of the drawing, dimensions themselves
    return "finite elements in three dimensions" if solid else "finite elements"


def _quantity(model: Model, of: Proof, place: int, asked: Objective | Require) -> dict[str, Any]:
    """The fields of `Stated`."""
    loaded = model.loaded
    names = loaded.requirements.names_of(asked.quantity)
    by, sampled = checked_by(loaded, names), bool(names & {*SCATTERED})
    spread = None
    if names & {*outputs.ENGAGED}:
        driven = commanding(best_model(stage_of(loaded.study, of.values), []))
        part = push_spread(driven) / engaged_stiffness(driven.system)
        columns = {name: np.full(2, value) for name, value in of.columns.items()}
        for name, share in zip(outputs.ENGAGED, part, strict=True):
            columns[name] *= (1 - share, 1 + share)
        spread = float(np.max(np.abs(model.quantities(columns)[:, place] - of.elements[place])))
    both = of.elements[place], of.uncorrected[place]
    value, uncorrected = (float(x) if abs(x) > of.round_off[place] else 0.0 for x in both)
    return {
        "name": asked.quantity,
        "label": asked.title,
        "value": value,
        "band": float(of.bands[place]) if sampled or by.startswith("finite") else None,
        "sampling": float(of.sampling[place]) if sampled else None,
        "uncorrected": uncorrected,
        "checked_by": by,
        "push_spread": spread,
    }


def _requirements(last: Proposal) -> list[record.Requirement]:
    proposing, model, kept = last.proposing, last.model, list[record.Requirement]()
    tight = 100 * np.minimum(proposing.guard, model.room / model.sizes)
    slack = proposing.margins(proposing.found(last.best.relaxed[None]))[0]
    for k, each in enumerate(model.loaded.requirements.require):
        about = _quantity(model, last.proof, model.objectives + k, each)
        value, band, size = about["value"], about["band"] or 0.0, float(model.sizes[k])
        margin = float(min(value - model.low[k], model.high[k] - value))
        verdict: record.Verdict = "met" if margin >= band else "within the band" if margin >= -band else "missed"
        requirement = record.Requirement(
            **about,
            at_least=each.at_least,
            at_most=each.at_most,
            size=size,
            margin=margin,
            margin_percent=100 * margin / size,
            band_percent=None if about["band"] is None else 100 * band / size,
            verdict=verdict,
            active=bool(abs(slack[k]) <= ACTIVE),
            tightened_percent=float(tight[k]),
        )
        kept.append(requirement)
    return kept


def relaxations(model: Model, near: Array) -> list[record.SoleRelaxation]:
    """For every requirement the smallest relaxation that is enough when the others are kept, by a search each."""
    found = list[record.SoleRelaxation]()
    for k, each in enumerate(model.loaded.requirements.require):
        alone = replace(model, yielding=k)
        best = optimum(alone, near)
        relax_to = percent = None
        if best.merit < MISSED:
            quantities = alone.found(best.values[None])
            relax_to, missed = float(quantities[0, model.objectives + k]), float(alone.wanted(quantities)[0])
            percent = 100 * missed if missed > ROUND_OFF else 0.0
        found.append(record.SoleRelaxation(requirement=each.title, relax_to=relax_to, percent=percent))
    return found


def front_of(model: Model, first: Array, count: int, store: Store) -> list[Array]:
    """Designs (d,) that no other beats in both objectives, from the best in the first to the best in the second.

    Notes
    -----
    The first objective is best while the second keeps a bound (Haimes, Lasdon, Wismer, IEEE Trans. Syst. Man Cybern. 1
    (1971) 296-297), in the middle of the widest gap so far; for every bound all is searched, because bodies that
    overlap part what can be made.
    """
    last = searched(replace(model, objective=1), first, store)
    if last.merit >= MISSED:
        return []
    designs = [_in_turn(model, each) for each in (optimum(model, first, False).values, last.values)]
    closed = set[float]()
    while len(designs) < count:
        designs = _best_of(model, designs)
        both = model.signed(model.found(np.array(designs)))
        span = np.ptp(both, axis=0)
        gaps = np.linalg.norm(np.diff(both, axis=0) / np.where(span > 0, span, 1.0), axis=1)
        bounds = (both[1:, 1] + both[:-1, 1]) / 2
        open_gaps = [k for k in np.argsort(-gaps) if float(bounds[k]) not in closed and gaps[k] > APART]
        if not open_gaps:
            break
        k = int(open_gaps[0])
        closed.add(float(bounds[k]))
        near = designs[k + 1]
        between = searched(replace(model, bounds={1: float(bounds[k])}), near, store)
        if between.merit < MISSED:
            designs.append(between.values)
        model.say(f"front: {len(designs)} of {count} designs, {model.counts['analytic']:,} by the analytic model")
    return _best_of(model, designs)


def _in_turn(model: Model, values: Array) -> Array:
    """The design (d,) beside `values` that is best in one objective after the other while the other is kept."""
    for k in range(model.objectives):
        own = model.signed(model.found(values[None]))[0]
        bounded = replace(model, objective=k, bounds={j: float(x + KEPT * abs(x)) for j, x in enumerate(own) if j != k})
        best = optimum(bounded, values, False)
        if best.merit < float(bounded.merit(bounded.found(values[None]))[0]):
            values = best.values
    return values


def _best_of(model: Model, designs: list[Array]) -> list[Array]:
    """Those of some designs that no other beats in both objectives, in the order of the first."""
    both = model.signed(model.found(np.array(designs)))
    different, first = np.unique(both, axis=0, return_index=True)
    return [designs[k] for k in first[non_dominated(-different)]]


def _front_design(model: Model, of: Proof) -> record.FrontDesign:
    k, margins = model.objectives, replace(model, guard=0.0).margins(of.elements[None])[0]
    return record.FrontDesign(
        design=model.space.named(of.values),
        values=of.elements[:k].tolist(),
        predicted=of.predicted[:k].tolist(),
        margins_percent=(100 * margins).tolist(),
        met=bool(np.all(margins >= -of.bands[k:] / model.sizes)),
        stage=made(model.loaded, of.values).to_toml(),
    )


def sensitivities(model: Model, values: Array) -> Array:
    """Change (d, q) of the quantities of a design in per cent for 1 % of each dimension; nan where lost.

    Central, and where one side has no answer, as at bodies that touch, by the other.
    """
    d, steps = len(values), np.diag(DIFFERENCE * values)
    around = model.found(np.vstack([values - steps, values + steps, values[None]]))
    below, above, own = around[:d], around[d : 2 * d], around[-1]
    with np.errstate(all="ignore"):
        both, up, down = (above - below) / 2, above - own, own - below
        slopes = np.where(np.isfinite(both), both, np.where(np.isfinite(up), up, down))
        found = slopes / (DIFFERENCE * own)
        return np.where(np.abs(found) < FLAT, 0.0, found)


def _sensitivities(model: Model, of: Proof) -> dict[str, dict[str, float | None]]:
    """By dimension and quantity; none of a quantity that its band does not tell from zero."""
    rows = np.where(np.abs(of.elements) <= of.bands, np.nan, sensitivities(model, of.values))
    names = model.loaded.requirements.quantities
    return {
        column.name: {n: float(x) if math.isfinite(x) else None for n, x in zip(names, row, strict=True)}
        for column, row in zip(model.loaded.columns, rows, strict=True)
    }


def _scattered(model: Model, last: Proof) -> record.Scattered | None:
    """What scatter of the nine necks does to the design; None where no tolerance is given."""
    requirements, of = model.loaded.requirements, last.scattered
    tolerance, notes = requirements.tolerance, list[str]()
    if tolerance is None:
        return None
    for k, name in enumerate(SCATTERED):
        if of is not None and name in requirements.used:
            text = (
                f"{name} of {OTHERS:,} stages that no search has seen, by the model: {of.others[k]:.4g}, 95 % interval "
                f"{of.low[k]:.4g} to {of.high[k]:.4g}; of the {tolerance.stages:,} searched {of.searched[k]:.4g}"
            )
            solved = f"; finite elements of {tolerance.checked}: {of.factors[-1, k]:.4f} times that, off by at most "
            notes.append(text + (f"{solved}{of.misfit[k]:.2g} in one" if np.any(of.misfit) else ""))
    return record.Scattered(share=share_kept(model, last, tolerance), stages=SHARED, notes=notes)


def share_kept(model: Model, of: Proof, tolerance: Tolerance) -> float:
    """Share of stages with scattered necks that keep every requirement, by the corrected model.

    What the model of a study does not answer, such as masses and couplings of all stages, is held as in the design.
    """
    study, stage = model.loaded.study, stage_of(model.loaded.study, of.values)
    off = deviations(tolerance, SHARED, (model.loaded.requirements.seed + 1) % 2**63).reshape(-1, 9)
    places = [(k, hinge) for k in (1, 2, 3) for hinge in HINGE_NAMES]
    columns = columns_of(Factor(key=f"override.{k}.{hinge}.neck_mm", values=(0.5,)) for k, hinge in places)
    necks = off + [stage.hinge(*place).neck for place in places]
    rows = answer_designs(replace(study, stage=stage, columns=columns), necks)
    found = dict(zip(study.outputs, rows.values.T, strict=True))
    quantities = model.quantities({n: np.full(SHARED, x) for n, x in of.columns.items()} | model.corrected(found))
    margins = replace(model, guard=0.0).margins(quantities)
    return float(np.mean((rows.status == "ok") & np.all(margins >= -ROUND_OFF, axis=1)))


def _warnings(loaded: LoadedRequirements, rounds: list[Proposal], agreed: bool) -> list[str]:
    """What to know of the result: rounds that end apart, answers out of their range, couplings that are not checked."""
    last, warnings = rounds[-1].proof, list[str]()
    of, columns = loaded.requirements, last.columns
    if not agreed:
        still = f"model and finite elements still differ by {100 * last.gap:.3g} %"
        if 100 * last.gap <= of.accuracy_percent:
            still = "a requirement is still not kept with its band, or within it where there is no room"
        warnings.append(f"after {len(rounds)} rounds {still}")
    row = outputs.row_of("ok", "", [columns[name] for name in loaded.study.outputs])
    reason = str(with_warnings(loaded.study, last.values[None], row).reason[0])
    warnings += reason.split("; ") if reason else []
    amplitudes = [name for name in outputs.LIFE_AMPLITUDES if name in columns and name in of.used]
    if of.life is not None and amplitudes:
        low, high = required_law(loaded.stage.material).range
        about, name = f"amplitudes for {of.life.cycles:g} cycles", amplitudes[0]
        if not low <= of.life.cycles <= high:
            warnings.append(f"{about} extrapolated, outside the {low:g} to {high:g} cycles of Basquin's law")
        own = abs(of.life.amplitude[outputs.LIFE_AMPLITUDES.index(name)]) * unit_of(name).factor
        if columns["safety_factor"] * own < columns[name]:  # mean and amplitude grow together
            warnings.append(f"{about} by elastic stress, beyond yield")
    if of.used & {*SCATTERED} and of.tolerance is not None and not of.tolerance.checked:
        warnings.append("coupling under tolerance is of the analytic model: tolerance.checked is 0")
    return warnings


def assumptions_of(loaded: LoadedRequirements, stage: Stage) -> tuple[list[str], list[str]]:
    """Key paths, of the stage and of the requirements, that are assumed, and those whose source is not stated."""
    of, study = loaded.requirements, replace(loaded.study, stage=stage)
    own = [key for key, source in of.provenance.items() if is_assumed(source)], of.not_stated
    warm = study.study.drift is not None
    asked = [[key for key in keys if key.startswith("stage: ") and (warm or not of_heat(key.removeprefix("stage: ")))]
             for keys in study.assumptions]  # fmt: skip
    assumed, not_stated = (
        [*of_stage, *(f"requirements: {key}" for key in keys)] for of_stage, keys in zip(asked, own, strict=True)
    )
    return assumed, not_stated
