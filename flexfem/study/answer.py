"""Answers of designs, a row for each: whatever the model, and whatever goes wrong; and of the base stage."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

import flexfem
from flexfem.analytic.elastic_bodies import body_compliance, edge_motions
from flexfem.analytic.model import analyse, hinge_compliances, in_range, unanswered
from flexfem.analytic.paper import Freedoms, freedoms_of
from flexfem.analytic.responses import ON_BODIES, LinkParts, WarmBodies, link_parts, on_bodies
from flexfem.arrays import AnyArray, Array
from flexfem.clock import Limit
from flexfem.files.refusals import suggestion
from flexfem.hinges.formulas import Compliance
from flexfem.hinges.strength import KEY, required_law
from flexfem.mechanism.bodies import Payload, body_moments, hub_moments
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.drives import drive_of, drives_of
from flexfem.mechanism.feasibility import Broken, check_feasible, conditions
from flexfem.mechanism.keys import keys
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.batch import (
    Clock,
    Moments,
    batch_at_rest,
    batch_drift,
    batch_drives,
    batch_frequencies,
    solved_design,
    solved_solid,
)
from flexfem.questions.driven import DriveRanges
from flexfem.questions.modes import payload_of
from flexfem.questions.strained import Repeated, of_preloads, scaled
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.columns import COUPLINGS, CROSS, Rows, row_of, values_of
from flexfem.study.factors import Factor, columns_of
from flexfem.study.loaded import LoadedStudy, designs_of, judge, refusals_of, sample, stage_of
from flexfem.study.plan import Sampling, Study, names_in

Stages = Callable[[int], Stage]


def drawn_one_by_one(study: Study) -> bool:
    """Whether a study of the analytic model makes a stage of every design."""
    return study.draws or study.links or study.frequencies is not None


def elastic_parts(loaded: LoadedStudy, stages: Stages, reason: AnyArray) -> WarmBodies | None:
    """Draw the designs not refused so far, where the study draws them; what their elastic bodies do, None without."""
    study, n = loaded.study, len(reason)
    bodies = WarmBodies(np.zeros((n, 9, 9)), np.zeros((n, 3, 3, 3)))

    def draw(index: int, stage: Stage) -> None:
        if study.draws:
            check_feasible(stage)
        if study.links:
            bodies.compliance[index] = body_compliance(stage)
        if study.links and study.drift is not None:
            bodies.edges[index] = edge_motions(stage)

    if study.draws or study.links:
        _each(stages, reason, draw)
    return bodies if study.links else None


def driven(
    loaded: LoadedStudy, stages: Stages, reason: AnyArray, designs: Designs, hinges: Compliance, freedoms: Freedoms
) -> DriveRanges:
    """What the drives of the designs do; reasons against their contacts and forces go to `reason`."""
    drive, elastic = drives_of(loaded.stage, designs, reason, stages), None
    if loaded.study.links:
        elastic = _no_parts(len(reason), len(drive.stacks))
        _each(stages, reason, lambda index, stage: _put(elastic, index, link_parts(stage, drive_of(stage).stacks)))
    drive.stiffness[reason != ""] = np.nan  # not asked: nan all through
    return batch_drives(designs, hinges, freedoms, drive, elastic)


def vibrating(
    loaded: LoadedStudy, stages: Stages, reason: AnyArray, designs: Designs, hinges: Compliance, freedoms: Freedoms
) -> Array:
    """Natural frequencies (n, 3), rad/s; every design is drawn, and reasons why it cannot be go to `reason`."""
    n, one = len(reason), [1.0, 0.0, 0.0, 1.0]
    moments = Moments(np.ones((n, 3, 4, 4)) * one, np.ones((n, 4)) * one)
    elastic = _no_parts(n, ON_BODIES) if loaded.study.links else None

    def draw(index: int, stage: Stage) -> None:
        moments.bodies[index], moments.hub[index] = body_moments(stage), hub_moments(stage)
        if elastic is not None:
            _put(elastic, index, link_parts(stage, on_bodies(stage)))

    _each(stages, reason, draw)
    return batch_frequencies(designs, hinges, freedoms, moments, payload(loaded) or Payload(), elastic)


def payload(loaded: LoadedStudy) -> Payload | None:
    """What the platform carries where natural frequencies are asked for, else None."""
    of = loaded.study.frequencies
    return None if of is None else payload_of(of.payload_kg, of.payload_kg_mm2)


def _no_parts(n: int, loads: int) -> LinkParts:
    """What elastic links add to the compliances of n designs, with so many loads on them: zero so far."""
    shapes = (9, 9), (3, 3, loads), (loads, loads)
    return LinkParts(*(np.zeros((n, *shape)) for shape in shapes))


def _each(stages: Stages, reason: AnyArray, draw: Callable[[int, Stage], None]) -> None:
    """Ask every design not refused so far; why one is refused goes to `reason`."""
    for index in map(int, np.flatnonzero(reason == "")):
        try:
            draw(index, stages(index))
        except BadInput as refusal:
            reason[index] = str(refusal)


def _put(parts: LinkParts, index: int, own: LinkParts) -> None:
    for all_of, one in zip(parts, own, strict=True):
        all_of[index] = one


UNMOVED = "actuator: the drive does not move the platform in three directions, or its preloads make a neck yield"
SINGULAR = "chain: singular to working precision at rest, by hinges in line or by necks that are too unlike"
BATCH = 4096  # analytic designs at a time, whatever is asked: bounds the memory
DRAWN = 512  # of them, where each is made a stage, which is kept until the batch is answered: 60 kB


def answer(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """Answer the designs from `start` up to `stop`."""
    if loaded.study.model == "analytic":
        ends = [*range(start, stop, DRAWN if drawn_one_by_one(loaded.study) else BATCH), stop]
        batches = [answer_designs(loaded, sample(loaded, *pair)) for pair in pairwise(ends)]
    else:
        batches = [_solved_row(loaded, values) for values in sample(loaded, start, stop)]
    if not batches:
        nothing = np.array([], dtype=object)
        return Rows(nothing, nothing, np.empty((0, len(loaded.outputs))))
    return Rows(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


def answer_designs(loaded: LoadedStudy, values: Array) -> Rows:
    """Answer by the analytic model the designs whose factors take `values` (n, columns), file units."""
    study = loaded.study
    with np.errstate(all="ignore"):  # an impossible design computes nonsense, and is refused
        designs = designs_of(loaded, values)
        hinges = hinge_compliances(designs, study.formula)
        refused = [
            *(each.broken for each in conditions(designs)),
            *unanswered(designs, study.formula, hinges),
            *_units(study, designs),
        ]
        reason = _first([*_off_limits(loaded, values), *refused])
        reason = np.where(reason == "", refusals_of(loaded, values), reason)
        freedoms = freedoms_of(study.mobility, designs.prismatic)
        stages = cache(lambda index: stage_of(loaded, values[index]))
        bodies = elastic_parts(loaded, stages, reason)
        found = batch_at_rest(
            designs, hinges, freedoms, None if bodies is None else bodies.compliance, _repeated(loaded)
        )
        if study.driven:
            found = found._replace(drives=driven(loaded, stages, reason, designs, hinges, freedoms))
        if study.frequencies is not None:
            found = found._replace(frequencies=vibrating(loaded, stages, reason, designs, hinges, freedoms))
        if study.drift is not None:
            found = found._replace(drift=batch_drift(designs, hinges, freedoms, bodies))
        lost = np.isnan(found.stiffness[:, 0, 0])
        if found.drift is not None:
            lost |= np.isnan(found.drift.uniform).any(axis=1)
        reason[lost & (reason == "")] = SINGULAR
        if found.drives is not None:
            reason[np.isnan(found.drives.range).any(axis=1) & (reason == "")] = UNMOVED
        answers = values_of(found, study.columns, study.rotation)
        answers = np.hstack([answers, _asked_of_each(loaded, stages, reason)])
    answers[reason != ""] = np.nan
    return doubted(loaded, values, Rows(np.where(reason == "", "ok", "refused").astype(object), reason, answers))


def _asked_of_each(loaded: LoadedStudy, stages: Stages, reason: AnyArray) -> Array:
    """Numbers of questions (n, asked) of the designs not refused so far, one after the other."""
    found = np.full((len(reason), len(loaded.study.ask)), np.nan)

    def ask(index: int, stage: Stage) -> None:
        found[index] = asked_numbers(loaded, stage)

    if loaded.study.ask:
        _each(stages, reason, ask)
    return found


def asked_numbers(loaded: LoadedStudy, stage: Stage) -> list[float]:
    """Numbers that questions answer of one stage, by the paths of the study. Raises BadInput, ComputationFailed."""
    from flexfem.questions.setup import Analytic

    study, found = loaded.study, dict[str, float]()
    models = {"analytic": "analytic", "verify": "both"}.get(study.model, "elements")
    given: dict[str, Any] = {"models": models}
    if models != "elements":
        given["analytic"] = Analytic(study.mobility, study.formula, study.links)
    if models != "analytic":
        given["resolution"] = study.resolution
    if study.model == "three_dimensional":
        given["layers"] = study.layers
    for name in dict.fromkeys(path.split(".")[0] for path in study.ask):
        question = getattr(flexfem, name)
        known = inspect.signature(question).parameters
        result = question(stage, **{key: value for key, value in given.items() if key in known})
        found |= {f"{name}.{number.path}": number.value * number.unit.factor for number in result.entries()}
    for path in study.ask:
        if path not in found:
            close = suggestion(path, found) or f", such as {next(iter(found))}"
            raise BadInput(f"ask: no number {path} of this stage and model{close}")
    return [found[path] for path in study.ask]


def _units(study: Study, designs: Designs) -> list[Broken]:
    """Fatigue constants and yield strengths, where lives are asked for, that no material has together."""
    if study.life is None:
        return []
    text = f"{KEY}: expected {UNLIKELY.format(*STRENGTHS, 'material.yield_strength_mpa')}"
    return [Broken(text, unlikely(designs.fatigue[:, 0], designs.yield_strength))]


def _repeated(loaded: LoadedStudy) -> Repeated | None:
    """What the platform repeats where lives are asked for, else None."""
    of = loaded.study.life
    if of is None:
        return None
    return Repeated(scaled(np.array(of.amplitude), None, of.ratio), of.cycles, of.notch_sensitivity)


def solved_values(stage: Stage, loaded: LoadedStudy) -> Array:
    """Values (outputs,) of a feasible design, for models that mesh. Raises as `solved_design`, or the formula."""
    study, clock = loaded.study, Clock(Limit(loaded.study.time_limit), False)
    predicted = analyse(stage, study.mobility, study.formula).stiffness if study.model == "verify" else None
    if study.model == "three_dimensional":
        found = solved_solid(stage, study.resolution, study.layers, clock)
    else:
        asked = payload(loaded), _repeated(loaded), study.driven, study.drift is not None
        found = solved_design(stage, study.resolution, clock, predicted, study.bands, *asked)
        if found.drives is not None and np.isnan(found.drives.range).any():
            raise BadInput(UNMOVED)
    return np.array([*values_of(found, study.columns, study.rotation)[0], *asked_numbers(loaded, stage)])


def _solved_row(loaded: LoadedStudy, values: Array) -> Rows:
    """The row of the design whose factors take `values` (columns,), file units, whatever becomes of it."""
    from flexfem.fem.gmsh_process import MeshTimeout

    (reason,) = refusals_of(loaded, values[None])
    try:
        if reason:
            raise BadInput(reason)
        stage = stage_of(loaded, values)
        check_feasible(stage)
        found = solved_values(stage, loaded)
        return doubted(loaded, values[None], row_of("ok", "", found))
    except BadInput as refusal:
        status, reason = "refused", str(refusal)
    except MeshTimeout as failure:
        status, reason = "time limit", str(failure)
    except (ComputationFailed, np.linalg.LinAlgError) as failure:
        status, reason = "failed", str(failure)
    return row_of(status, reason, np.full(len(loaded.outputs), np.nan))


def doubted(loaded: LoadedStudy, values: Array, rows: Rows) -> Rows:
    """The rows of designs (n, columns), with a reason where an answer is from a formula, or a life, out of range."""
    doubts = list[Broken]()
    if loaded.study.model not in ("fe", "three_dimensional"):
        with np.errstate(all="ignore"):
            inside = in_range(designs_of(loaded, values), loaded.study.formula).all(axis=(1, 2))
        doubts.append(Broken(f"hinge formula {loaded.study.formula} outside its range of t/R", np.asarray(~inside)))
    doubts += _lives_in_doubt(loaded, rows)
    if loaded.study.drift is not None:
        everywhere = np.ones(len(values), dtype=bool)
        doubts += [Broken(f"drift: {text}", everywhere) for text in warning.of_stacks(loaded.stage)]
    reason = rows.reason.astype(object)
    for text, where in doubts:
        here = where & (rows.status == "ok")
        reason[here] = [f"{said}; {text}" if said else text for said in reason[here]]
    return rows._replace(reason=reason)


def _lives_in_doubt(loaded: LoadedStudy, rows: Rows) -> list[Broken]:
    """Where a life is not what Basquin's law is for: beyond yield, or beyond the cycles it was fitted to."""
    if loaded.study.life is None:
        return []
    cycles, safety = (rows.values[:, loaded.outputs.index(name)] for name in ("life_cycles", "safety_factor"))
    (low, high), everywhere = required_law(loaded.stage.material).range, np.ones(len(cycles), dtype=bool)
    beyond, outside = safety < 1, (cycles < low) | (cycles > high)
    return [
        Broken("life by elastic stress, beyond yield", np.asarray(beyond)),
        Broken("life extrapolated, outside the cycles of Basquin's law", np.asarray(~beyond & outside)),
        *(Broken(text, everywhere) for text in of_preloads(loaded.stage)),
    ]


def _first(refused: list[Broken]) -> AnyArray:
    """The first reason (n,) to refuse each design, "" for none."""
    first = np.zeros(refused[0].where.shape, dtype=np.int64)
    for place in reversed(range(len(refused))):
        first[refused[place].where] = place + 1
    return np.array(["", *(each.reason for each in refused)], dtype=object)[first]


def _off_limits(loaded: LoadedStudy, values: Array) -> list[Broken]:
    """Values that no stage file can give."""
    return [
        Broken(f"{path}: a number no stage file can give", keys()[path].impossible(values[:, index]))
        for index, column in enumerate(loaded.columns)
        for path in column.keys
    ]


ROUND_OFF = 1e-10  # of the size of an output, which a factor changes by more
FIXED = "thickness_mm"  # every stage gives it; the one factor of a study that varies nothing


def nominal(loaded: LoadedStudy) -> dict[str, float]:
    """Outputs of the base stage by column, and the factors it has one value of; no outputs when it has no answer."""
    factors = (Factor.model_validate({"key": FIXED, "values": [keys()[FIXED].value_in(loaded.stage)]}),)
    changes = {"factor": factors, "sampling": Sampling(method="grid"), "bands": False}
    study = loaded.study.model_copy(update=changes | {"correlation": (), "constraint": ()})
    alone = replace(loaded, study=study, columns=columns_of(factors), given=None)
    rows, found = answer(alone, 0, 1), own_values(loaded)
    if rows.status[0] == "ok":
        found |= dict(zip(study.outputs, map(float, rows.values[0]), strict=True))
        columns = {name: np.array([value]) for name, value in found.items()}
        columns[FIXED] = np.array([keys()[FIXED].value_in(loaded.stage)])
        derived = judge(alone, columns, np.array([True])).derived
        found |= {name: float(value[0]) for name, value in derived.items() if np.isfinite(value[0])}
    return found


def own_values(loaded: LoadedStudy) -> dict[str, float]:
    """The base stage's values of the factors, in file units, by column; none where its keys differ."""
    values = {c.name: {keys()[path].value_in(loaded.stage) for path in c.keys} for c in loaded.columns}
    return {name: value for name, (value, *more) in values.items() if not more and value is not None}


def unseen(loaded: LoadedStudy) -> list[str]:
    """Warnings on factors that change none of the outputs that a study shows or constrains, of all where it does not.

    Notes
    -----
    Found by the model itself: designs that differ in one factor alone, compared output by output. Finite elements mesh
    what a factor changes, and are not asked.
    """
    study = loaded.study
    if study.model != "analytic":
        return []
    named = {name for figure in study.figure for name, _ in figure.columns.values()}
    named |= {name for one in study.constraint for text in study.in_full(one.value) for name in names_in(text)}
    named = study.used_by(named)
    shown = [name for name in loaded.outputs if name in named] or list(loaded.outputs)
    found = []
    for name, changed in _changes(loaded).items():
        if changed is not None and not changed & set(shown):
            others = f"; it changes {', '.join(sorted(changed))} alone" if changed else ""
            found.append(f"factor {name} changes none of {', '.join(shown)} in this model{others}")
    return found


def _changes(loaded: LoadedStudy) -> dict[str, set[str] | None]:
    """Outputs that each factor changes, by column; None where it takes one value, or no pair of designs has answers."""
    some = sample(loaded, 0, min(loaded.count, 1000))
    bases = some[[0, len(some) // 2]][: 1 if loaded.study.links else 2]  # 0.1 s a design where links bend
    ends, n = (some.min(axis=0), some.max(axis=0)), len(loaded.columns)
    rows = [base for base in bases]
    rows += [np.where(np.arange(n) == k, end, base) for k in range(n) for base in bases for end in ends]
    free = loaded.study.model_copy(update={"check": "closed_form", "constraint": ()})
    answers = answer_designs(replace(loaded, study=free), np.array(rows)).values
    size = np.abs(answers)
    place = {name: index for index, name in enumerate(loaded.outputs)}
    for name, (one, other) in CROSS.items():  # zero by symmetry: small against what they couple
        size[:, place[name]] = np.sqrt(np.abs(answers[:, place[one]] * answers[:, place[other]]))
    size[:, [place[name] for name in COUPLINGS]] = 1.0
    found: dict[str, set[str] | None] = {}
    for k, column in enumerate(loaded.columns):
        first = len(bases) * (1 + 2 * k)
        pairs = [(base, first + 2 * base + end) for base in range(len(bases)) for end in (0, 1)]
        steps = [
            np.abs(answers[moved] - answers[base]) > ROUND_OFF * size[base]
            for base, moved in pairs
            if rows[base][k] != rows[moved][k] and np.isfinite(answers[[base, moved]]).all()
        ]
        found[column.name] = (
            {n for n, m in zip(loaded.outputs, np.any(steps, axis=0), strict=True) if m} if steps else None
        )
    return found
