"""The record of a design from its requirements: search, verification, front, sensitivities,
scatter, stage file.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.design import result as record
from flexfem.design.model import MISSED, ROUND_OFF, Model
from flexfem.design.proof import ElementSolver, Proof, Proposal, proof, space_mapping
from flexfem.design.requirements import SCATTERED, LoadedRequirements, Objective, Require, Tolerance
from flexfem.design.scatter import OTHERS, deviations
from flexfem.design.search import optimum
from flexfem.design.timing import Timing
from flexfem.files.provenance import is_assumed
from flexfem.files.refusals import key_path, one_line, path_of
from flexfem.files.tables import LABEL_LENGTH
from flexfem.mechanism.mechanism import Mechanism
from flexfem.results import versions
from flexfem.study import columns as outputs
from flexfem.study.answer import answer_designs
from flexfem.study.fronts import non_dominated
from flexfem.study.loaded import mechanism_of
from flexfem.study.names import asked, axis_of, factor
from flexfem.study.tables import Better

PLANE_ALONE = {
    *outputs.DRIVE_RANGES,
    *outputs.ENGAGED,
    *outputs.DRIFTS,
    *outputs.GRADIENTS,
    *outputs.FREQUENCIES,
    *outputs.ERRORS,
    *outputs.CROSSES,
    *outputs.BANDS,
}
DRAWN = {"envelope_mm"}  # of the drawing, of no model
SHOWN = 200  # steps of a history
ACTIVE = 1e-3  # largest relative margin of an active requirement, at the optimum without steps
END = 1e-4  # of a range within which a dimension is at its end
DIFFERENCE = 1e-4  # relative step of the finite differences for sensitivities
FLAT = 1e-8  # sensitivities below this are round-off of the differences
KEPT = 1e-6  # relative slack of an objective that is kept: SLSQP needs room at the end of a range
APART = 1e-3  # of the spans of a front: closer designs count as one
SHARED = 2000  # stages with scattered necks in the share


def designed(
    loaded: LoadedRequirements, solver: ElementSolver, timing: Timing | None = None
) -> record.Designed:
    """Return the best stage that meets the requirements, or the one with the least violation.

    Raises ComputationFailed when finite elements of a proposed design fail, BadInput when no design
    has a solution.
    """
    first = Model(loaded, counts=solver.counts, say=solver.say)
    rounds, agreed = space_mapping(first, solver, timing)
    _, best, last = rounds[-1]
    model = last.model
    required = loaded.requirements
    space = model.space
    solver.say("sensitivities")
    requirements = _requirements(rounds[-1])
    mechanism = designed_stage(loaded, last.values)
    feasible = all(each.verdict != "missed" for each in requirements)
    alternatives = list[record.SoleRelaxation]()
    if best.merit >= MISSED and not feasible:
        alternatives = relaxations(replace(model, guard=0.0), last.values)
    return record.Designed(
        name=required.name,
        file=str(loaded.path),
        base=required.mechanism,
        hash=mechanism.hash,
        seed=required.seed,
        accuracy_percent=required.accuracy_percent,
        design=space.named(last.values),
        units={column.name: factor(column).unit for column in loaded.columns},
        relaxed=space.named(best.relaxed),
        stage=mechanism.to_toml(),
        feasible=feasible,
        agreed=agreed,
        objectives=_objectives(last),
        requirements=requirements,
        alternatives=alternatives,
        at_ends=_at_ends(model, best.relaxed),
        sensitivities=_sensitivities(last),
        rounds=[_round(each) for each in rounds],
        front=_front(rounds[-1], solver),
        scattered=_scattered(last),
        history=_history(rounds[0]),
        evaluations=dict(sorted(solver.counts.items())),
        versions=dict(versions()),
        warnings=_warnings(loaded, rounds, agreed),
        **replace(loaded, base=mechanism).assumptions._asdict(),
    )


def _objectives(last: Proof) -> list[record.Goal]:
    goals = []
    for k, objective in enumerate(last.model.required.objective):
        better: Better = "larger" if objective.sign < 0 else "smaller"
        goals.append(record.Goal(**_quantity(last, k, objective), better=better))
    return goals


def _at_ends(model: Model, relaxed: Array) -> list[str]:
    """Return the dimensions with a range whose optimum without steps is at an end of it."""
    space = model.space
    places = zip(space.names, space.listed, space.to_unit(relaxed[None])[0], strict=True)
    return [name for name, listed, u in places if not listed and not END < u < 1 - END]


def _round(proposal: Proposal) -> record.Round:
    return record.Round(
        design=proposal.proof.model.space.named(proposal.best.values),
        gap_percent=100 * proposal.proof.gap,
        evaluations=proposal.best.history[-1][0],
    )


def _front(proposal: Proposal, solver: ElementSolver) -> list[record.FrontDesign]:
    """Return the front of two objectives, solved by finite elements; none without a feasible
    design.
    """
    model = proposal.proof.model
    if len(model.required.objective) == 1 or proposal.best.merit >= MISSED:
        return []
    designs = front_of(model, proposal.best.relaxed, model.required.front)
    return [_front_design(proof(model, solver, values)) for values in designs]


def _history(first: Proposal) -> list[record.Step]:
    """Return at most `SHOWN` steps of the first search."""
    history = first.best.history
    shown = np.linspace(0, len(history) - 1, min(SHOWN, len(history))).astype(int)
    steps = [history[k] for k in np.unique(shown)]
    return [
        record.Step(
            evaluations=n,
            objective=best,
            missed=missed,
        )
        for n, best, missed in steps
    ]


def designed_stage(loaded: LoadedRequirements, values: Array) -> Mechanism:
    """Return the mechanism of a design (d,); the provenance of its free dimensions is the design,
    else that of the base.
    """
    required = loaded.requirements
    source = f"designed: {required.name}, seed {required.seed}"
    sources = dict(loaded.base.provenance)
    members = dict[str, list[int]]()
    for path in loaded.family.set_paths:
        *table, last = path_of(path)
        if isinstance(last, int):
            members.setdefault(key_path(tuple(table)), []).append(last)
        else:
            sources[path] = source
    for path, indices in members.items():
        sources[path] = _source_of_array(loaded.base, path, indices, source)
    provenance = {path: one_line(text, LABEL_LENGTH) for path, text in sources.items()}
    changes = {"name": required.name, "provenance": provenance}
    return mechanism_of(loaded, values).model_copy(update=changes)


def _source_of_array(
    base: Mechanism,
    path: str,
    indices: list[int],
    source: str,
) -> str:
    """Return the source of an array some of whose members are designed; it stays assumed if other
    members still are.
    """
    before = base.sources.get(path) or "not stated"
    lead = "assumed in part" if is_assumed(before) else "in part"
    return f"{lead}: [{', '.join(map(str, sorted(indices)))}] {source}; the others {before}"


def title_of(loaded: LoadedRequirements, requested: Objective | Require) -> str:
    """Return the label of a quantity, without one that of the output that it names, or the meaning
    of the number that it is, or the expression.
    """
    required = loaded.requirements
    if requested.label is None and requested.quantity in required.ask:
        return asked(requested.quantity, loaded.base).name
    return required.title_of(requested)


def checked_by(loaded: LoadedRequirements, names: frozenset[str]) -> record.Checked:
    """Return the model that gives the value of a quantity, by all names that it uses."""
    required = loaded.requirements
    unchecked = set[str]()
    if loaded.solid:
        unchecked |= PLANE_ALONE
        unchecked |= {name for name in names if name.startswith(("life_", "safety_"))}
    if required.tolerance is None or not required.tolerance.checked or loaded.solid:
        unchecked |= {*SCATTERED}
    if names & unchecked:
        return "analytic model alone"
    if not names & {*required.outputs, *outputs.ERRORS, *SCATTERED} - DRAWN:
        return "exact"  # mass and envelope of the drawing, dimensions themselves
    return "finite elements in three dimensions" if loaded.solid else "finite elements"


def _quantity(
    verified: Proof,
    k: int,
    requested: Objective | Require,
) -> dict[str, Any]:
    """Return the fields of `DesignedQuantity` for the quantity with index `k`."""
    loaded = verified.model.loaded
    required = loaded.requirements
    quantity = requested.quantity
    names = required.names_of(quantity)
    by = checked_by(loaded, names)
    sampled = bool(names & {*SCATTERED})
    banded = sampled or by.startswith("finite")
    return {
        "name": quantity,
        "label": title_of(loaded, requested),
        "unit": axis_of(loaded, quantity).unit if quantity in names else "",
        "value": _without_round_off(verified, k, verified.elements),
        "band": float(verified.bands[k]) if banded else None,
        "sampling": float(verified.sampling[k]) if sampled else None,
        "uncorrected": _without_round_off(verified, k, verified.uncorrected),
        "checked_by": by,
        "push_spread": _push_spread(verified, k, names),
    }


def _without_round_off(
    verified: Proof,
    k: int,
    quantities: Array,
) -> float:
    value = float(quantities[k])
    return value if abs(value) > verified.round_off[k] else 0.0


def _push_spread(
    verified: Proof,
    k: int,
    names: frozenset[str],
) -> float | None:
    """Return the change of a quantity with the spread of actuator forces; None without engaged
    stiffness in it.
    """
    if not names & {*outputs.ENGAGED}:
        return None
    model = verified.model
    columns = {name: np.full(2, value) for name, value in verified.columns.items()}
    for name, share in model.kind.relative_spread(verified.values).items():
        columns[name] *= (1 - share, 1 + share)
    moved = model.quantities(columns)[:, k] - verified.elements[k]
    return float(np.max(np.abs(moved)))


def _requirements(last: Proposal) -> list[record.Requirement]:
    """Return the records of all requirements at the last design."""
    proposing = last.proposing
    model = last.proof.model
    records = list[record.Requirement]()
    slack = proposing.margins(proposing.evaluate(last.best.relaxed[None]))[0]
    for k, required in enumerate(model.required.require, start=len(model.signs)):
        fields = _quantity(last.proof, k, required)
        value = fields["value"]
        band = fields["band"] or 0.0
        size = float(model.sizes[k])
        margin = float(min(value - model.low[k], model.high[k] - value))
        requirement = record.Requirement(
            **fields,
            at_least=required.at_least,
            at_most=required.at_most,
            size=size,
            margin=margin,
            margin_percent=100 * margin / size,
            band_percent=None if fields["band"] is None else 100 * band / size,
            verdict="met" if margin >= band else "within the band" if margin >= -band else "missed",
            active=bool(abs(slack[k]) <= ACTIVE),
            tightened_percent=100
            * float(min(np.broadcast_to(proposing.guard, slack.shape)[k], model.room[k] / size)),
        )
        records.append(requirement)
    return records


def relaxations(model: Model, near: Array) -> list[record.SoleRelaxation]:
    """Return the smallest sufficient relaxation of each requirement alone, by one search each."""
    found = list[record.SoleRelaxation]()
    for k, requirement in enumerate(model.required.require, start=len(model.signs)):
        softened = replace(model, soft=k)
        best = optimum(softened, near)
        relax_to = None
        percent = None
        if best.merit < MISSED:
            quantities = softened.evaluate(best.values[None])
            relax_to = float(quantities[0, k])
            missed = float(softened.cost(quantities)[0])
            percent = 100 * missed if missed > ROUND_OFF else 0.0
        title = title_of(model.loaded, requirement)
        found.append(
            record.SoleRelaxation(
                requirement=title,
                relax_to=relax_to,
                percent=percent,
            )
        )
    return found


def front_of(
    model: Model,
    first: Array,
    count: int,
) -> list[Array]:
    """Return the designs (d,) of the Pareto front, from the best in the first objective to the best
    in the second.

    Notes
    -----
    The first objective is optimised under a bound on the second (epsilon-constraint method: Haimes,
    Lasdon, Wismer, IEEE Trans. Syst. Man Cybern. 1 (1971) 296-297) in the middle of the widest gap
    so far. Each search is global, because overlaps of bodies can divide the feasible region."""
    last = optimum(replace(model, objective=1), first)
    if last.merit >= MISSED:
        return []
    designs = [
        _improved_in_turn(model, end) for end in (optimum(model, first, False).values, last.values)
    ]
    closed = set[float]()
    while len(designs) < count:
        designs = _non_dominated(model, designs)
        both = model.signed(model.evaluate(np.array(designs)))
        span = np.ptp(both, axis=0)
        gaps = np.linalg.norm(np.diff(both, axis=0) / np.where(span > 0, span, 1.0), axis=1)
        bounds = (both[1:, 1] + both[:-1, 1]) / 2
        open_gaps = [
            k for k in np.argsort(-gaps) if float(bounds[k]) not in closed and gaps[k] > APART
        ]
        if not open_gaps:
            break
        k = int(open_gaps[0])
        closed.add(float(bounds[k]))
        between = optimum(replace(model, bounds={1: float(bounds[k])}), designs[k + 1])
        if between.merit < MISSED:
            designs.append(between.values)
        model.say(
            f"front: {len(designs)} of {count} designs, {model.counts['analytic']:,} analytic "
            "evaluations"
        )
    return _non_dominated(model, designs)


def _improved_in_turn(model: Model, values: Array) -> Array:
    """Return the design (d,) after local optimisation of each objective in turn while the others
    are kept.
    """
    for k in range(len(model.signs)):
        signed = model.signed(model.evaluate(values[None]))[0]
        others = {j: float(x + KEPT * abs(x)) for j, x in enumerate(signed) if j != k}
        bounded = replace(model, objective=k, bounds=others)
        best = optimum(bounded, values, False)
        if best.merit < float(bounded.merit(bounded.evaluate(values[None]))[0]):
            values = best.values
    return values


def _non_dominated(model: Model, designs: list[Array]) -> list[Array]:
    """Return the non-dominated designs, in the order of the first objective."""
    both = model.signed(model.evaluate(np.array(designs)))
    different, first = np.unique(both, axis=0, return_index=True)
    return [designs[k] for k in first[non_dominated(-different)]]


def _front_design(verified: Proof) -> record.FrontDesign:
    model = verified.model
    k = len(verified.model.signs)
    margins = replace(model, guard=0.0).margins(verified.elements[None])[0, k:]
    return record.FrontDesign(
        design=model.space.named(verified.values),
        values=verified.elements[:k].tolist(),
        predicted=verified.predicted[:k].tolist(),
        margins_percent=(100 * margins).tolist(),
        met=bool(np.all(margins >= -verified.bands[k:] / model.sizes[k:])),
        stage=designed_stage(model.loaded, verified.values).to_toml(),
    )


def sensitivities(model: Model, values: Array) -> Array:
    """Return the change (d, q) of the quantities in per cent for 1 % of each dimension; nan without
    a solution.

    Differences are central, or one-sided where one side has no solution, as at bodies that touch.
    """
    d = len(values)
    steps = np.diag(DIFFERENCE * values)
    rows = model.evaluate(np.vstack([values - steps, values + steps, values[None]]))
    below = rows[:d]
    above = rows[d : 2 * d]
    centre = rows[-1]
    with np.errstate(all="ignore"):
        both = (above - below) / 2
        up = above - centre
        down = centre - below
        slopes = np.where(np.isfinite(both), both, np.where(np.isfinite(up), up, down))
        relative = slopes / (DIFFERENCE * centre)
        return np.where(np.abs(relative) < FLAT, 0.0, relative)


def _sensitivities(verified: Proof) -> dict[str, dict[str, float | None]]:
    """Return sensitivities by dimension and quantity; None for a quantity that its band does not
    separate from zero.
    """
    model = verified.model
    rows = sensitivities(model, verified.values)
    rows[:, np.abs(verified.elements) <= verified.bands] = np.nan
    columns = ([float(x) if math.isfinite(x) else None for x in row] for row in rows)
    quantities = model.required.quantities
    return {
        n: dict(zip(quantities, row, strict=True))
        for n, row in zip(model.space.names, columns, strict=True)
    }


def _scattered(last: Proof) -> record.Scattered | None:
    """Return the effect of neck scatter on the design, None without a tolerance."""
    required = last.model.required
    couplings = last.scattered
    notes = list[str]()
    tolerance = required.tolerance
    if tolerance is None:
        return None
    for k, name in enumerate(SCATTERED):
        if couplings is not None and name in required.used:
            others, low, high = (values[k] for values in couplings[:3])
            text = (
                f"{name} of {OTHERS:,} stages outside the search, by the model: {others:.4g}, 95 "
                f"% interval {low:.4g} to {high:.4g}; of the {tolerance.stages:,} of the search: "
                f"{last.analytic[name]:.4g}"
            )
            solved = (
                f"; finite elements of {tolerance.checked}: {couplings.factors[-1, k]:.4f} times "
                "the model, within"
            )
            notes.append(
                text + (f"{solved} {couplings.misfit[k]:.2g}" if np.any(couplings.misfit) else "")
            )
    return record.Scattered(
        share=share_kept(last, tolerance),
        stages=SHARED,
        notes=notes,
    )


def share_kept(verified: Proof, tolerance: Tolerance) -> float:
    """Return the share of stages with scattered necks that keep every requirement, by the corrected
    model.

    Columns that the study does not compute, such as masses and couplings under tolerance, stay as
    in the design."""
    model = replace(verified.model, guard=0.0)
    loaded = verified.model.loaded
    off = deviations(tolerance, SHARED, (model.required.seed + 1) % 2**63)
    made, necks = model.kind.scattered(verified.values, off)
    rows = answer_designs(made, necks)
    by_name = model.corrected(dict(zip(loaded.outputs, rows.values.T, strict=True)))
    quantities = model.quantities(
        {n: np.full(SHARED, x) for n, x in verified.columns.items()} | by_name
    )
    return float(
        np.mean((rows.status == "ok") & np.all(model.margins(quantities) >= -ROUND_OFF, axis=1))
    )


def _warnings(
    loaded: LoadedRequirements,
    rounds: list[Proposal],
    agreed: bool,
) -> list[str]:
    """Return warnings on rounds without convergence, and those about the design."""
    last = rounds[-1].proof
    warnings = list[str]()
    if not agreed:
        still = f"model and finite elements still differ by {100 * last.gap:.3g} %"
        if 100 * last.gap <= loaded.requirements.accuracy_percent:
            still = "a requirement is still not met with its band"
        warnings.append(f"after {len(rounds)} rounds {still}")
    first_gap = rounds[0].proof.gap
    return [*warnings, *last.model.kind.warnings(last.values, last.columns, first_gap)]
