"""Answers of designs, a row for each: whatever the model, and whatever goes wrong; and of the base stage."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import compress, pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np

import flexfem
from flexfem.analytic.elastic_bodies import body_compliance, edge_motions
from flexfem.analytic.model import analyse, hinge_compliances, in_range, invalid_hinges
from flexfem.analytic.paper import freedoms_of
from flexfem.analytic.responses import (
    LinkParts,
    WarmBodies,
    body_loads,
    drift,
    dynamics_of_designs,
    in_plane,
    link_parts,
    mass_matrix,
    rates_of,
)
from flexfem.analytic.responses import driven as driven_compliance
from flexfem.arrays import AnyArray, Array
from flexfem.fem.mesher import Limit, MeshTimeout
from flexfem.files.refusals import suggestion
from flexfem.files.toml import bad_key
from flexfem.hinges.strength import KEY, required_law
from flexfem.mechanism.bodies import Payload, body_moments, hub_moments
from flexfem.mechanism.drives import drive_of, drives_of
from flexfem.mechanism.feasibility import Broken, check_feasible, conditions
from flexfem.mechanism.keys import keys
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.batch import LOWEST, Clock, batch_at_rest, solved_design
from flexfem.questions.driven import drive_ranges, driven
from flexfem.questions.life import Repeated, of_preloads, repeated
from flexfem.questions.modes import payload_of
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.columns import Rows, failed_row, row_of, sizes_of, values_of
from flexfem.study.loaded import LoadedStudy, designs_of, judge, refusals_of, sample, stage_of
from flexfem.study.plan import Study, names_behind, names_in
from flexfem.units import DENSITY


class Moments(NamedTuple):
    """Area moments, mm^2 to mm^4, of n designs: bodies (n, 3 chains, 4 bodies, 4) and hub (n, 4)."""

    bodies: Array
    hub: Array


Stages = Callable[[int], Stage]
Found = TypeVar("Found")
Parts = TypeVar("Parts", WarmBodies, LinkParts, Moments)  # arrays by name


def drawn_one_by_one(study: Study) -> bool:
    """Whether a study of the analytic model makes a stage of every design."""
    return study.draws or study.links or study.frequencies is not None or bool(study.ask)


def _each(stages: Stages, reason: AnyArray, of: Callable[[Stage], Found]) -> dict[int, Found]:
    """What `of` finds of every design not refused so far, by its place; why one is refused goes to `reason`."""
    found = dict[int, Found]()
    for index in map(int, np.flatnonzero(reason == "")):
        try:
            found[index] = of(stages(index))
        except BadInput as refusal:
            reason[index] = str(refusal)
    return found


def _drawn(loaded: LoadedStudy, stages: Stages, reason: AnyArray, of: Callable[[Stage], Parts]) -> Parts:
    """What `of` finds of every design, its arrays stacked (n, ...); of the base stage where a design is refused."""
    found, places = _each(stages, reason, of), range(len(reason))
    others = [index for index in places if index not in found]
    found |= dict.fromkeys(others, of(loaded.stage)) if others else {}
    return type(found[0])(*map(np.stack, zip(*(found[index] for index in places), strict=True)))


def payload(loaded: LoadedStudy) -> Payload | None:
    """What the platform carries where natural frequencies are asked for, else None."""
    of = loaded.study.frequencies
    return None if of is None else payload_of(of.payload_kg, of.payload_kg_mm2)


FATIGUE = f"{KEY}: expected {UNLIKELY.format(*STRENGTHS, 'material.yield_strength_mpa')}"
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
        refused = [*_off_limits(loaded, values), *(each.broken for each in conditions(designs))]
        unlike = unlikely(designs.fatigue[:, 0], designs.yield_strength)
        refused += [*invalid_hinges(designs, study.formula, hinges), Broken(FATIGUE, unlike)]
        first = [np.array(each.reason, object) for each in refused]
        reason = np.select([each.where for each in refused], first, refusals_of(loaded, values))
        freedoms = freedoms_of(study.mobility, designs.prismatic)
        stages = cache(lambda index: stage_of(loaded, values[index]))
        drawn = partial(_drawn, loaded, stages, reason)
        if study.draws:
            _each(stages, reason, check_feasible)
        warm = drawn(partial(_warm_bodies, study)) if study.links else None
        model = hinges, freedoms
        found = batch_at_rest(designs, *model, None if warm is None else warm.compliance, _repeated(loaded))
        if study.driven:
            drive = drives_of(loaded.stage, designs, reason, stages)
            pushed = drawn(lambda stage: link_parts(stage, drive_of(stage).stacks)) if study.links else None
            drive.stiffness[reason != ""] = np.nan  # not asked: nan all through
            of = driven_compliance(designs.frames, *model, drive.stacks, pushed)
            drives = drive_ranges(designs, driven(of.compliance, drive), of.necks, drive)
            found = found._replace(drives=drives)
        if study.frequencies is not None:
            moments = drawn(lambda stage: Moments(body_moments(stage), hub_moments(stage)))
            elastic = drawn(lambda stage: link_parts(stage, body_loads(stage))) if study.links else None
            areal = designs.thickness * designs.density * DENSITY
            mass = mass_matrix(moments.bodies, moments.hub, areal, payload(loaded) or Payload())
            frequencies = dynamics_of_designs(designs.frames, *model, mass, elastic).frequencies[:, :LOWEST]
            found = found._replace(frequencies=np.asarray(frequencies))
        if study.drift is not None:
            pose = drift(designs, *model, *in_plane(designs), warm).pose
            found = found._replace(drift=rates_of(pose))
        lost = np.isnan(found.stiffness[:, 0, 0])
        if found.drift is not None:
            lost |= np.isnan(found.drift.uniform).any(axis=1)
        reason[lost & (reason == "")] = SINGULAR
        if found.drives is not None:
            reason[np.isnan(found.drives.range).any(axis=1) & (reason == "")] = UNMOVED
        answers = values_of(found, study.columns, study.rotation)
        asked = np.full((len(values), len(study.ask)), np.nan)
        for index, numbers in _each(stages, reason, partial(extra_numbers, loaded)).items() if study.ask else ():
            asked[index] = numbers
        answers = np.hstack([answers, asked])
    answers[reason != ""] = np.nan
    return with_reasons_in_doubt(
        loaded, values, Rows(np.where(reason == "", "ok", "refused").astype(object), reason, answers)
    )


def _warm_bodies(study: Study, stage: Stage) -> WarmBodies:
    """What the elastic bodies of a stage do; how heat bows their edges where a study asks for drift, else zero."""
    return WarmBodies(body_compliance(stage), np.zeros((3, 3, 3)) if study.drift is None else edge_motions(stage))


class NoSuchNumber(BadInput):
    """No question that a study asks has a number of this path for a stage."""


def extra_numbers(loaded: LoadedStudy, stage: Stage) -> list[float]:
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
            raise NoSuchNumber(f"ask: no number {path} of this stage and model{close}")
    return [found[path] for path in study.ask]


def require_extra_numbers(loaded: LoadedStudy) -> None:
    """Raise BadInput where a study asks for a number that the analytic model has not, as the base stage shows."""
    try:
        if loaded.study.ask and loaded.study.model == "analytic":
            extra_numbers(loaded, loaded.stage)
    except NoSuchNumber as error:
        raise bad_key(loaded.path, ("ask",), str(error)) from None
    except BadInput:  # what the base stage lacks, factors may set
        pass


def _repeated(loaded: LoadedStudy) -> Repeated | None:
    """What the platform repeats where lives are asked for, else None."""
    of = loaded.study.life
    if of is None:
        return None
    return repeated(np.array(of.amplitude), None, of.ratio, of.cycles, of.notch_sensitivity)


def solved_values(stage: Stage, loaded: LoadedStudy) -> Array:
    """Values (outputs,) of a feasible design, for models that mesh. Raises as `solved_design`, or the formula."""
    study, clock = loaded.study, Clock(Limit(loaded.study.time_limit), False)
    predicted = analyse(stage, study.mobility, study.formula).stiffness if study.model == "verify" else None
    if study.model == "three_dimensional":
        found = solved_design(stage, study.resolution, clock, layers=study.layers)
    else:
        asked = payload(loaded), _repeated(loaded), study.driven, study.drift is not None
        found = solved_design(stage, study.resolution, clock, predicted, study.bands, *asked)
        if found.drives is not None and np.isnan(found.drives.range).any():
            raise BadInput(UNMOVED)
    return np.array([*values_of(found, study.columns, study.rotation)[0], *extra_numbers(loaded, stage)])


def _solved_row(loaded: LoadedStudy, values: Array) -> Rows:
    """The row of the design whose factors take `values` (columns,), file units, whatever becomes of it."""
    (reason,) = refusals_of(loaded, values[None])
    try:
        if reason:
            raise BadInput(reason)
        stage = stage_of(loaded, values)
        check_feasible(stage)
        found = solved_values(stage, loaded)
        return with_reasons_in_doubt(loaded, values[None], row_of("ok", "", found))
    except BadInput as refusal:
        status, reason = "refused", str(refusal)
    except MeshTimeout as failure:
        status, reason = "time limit", str(failure)
    except (ComputationFailed, np.linalg.LinAlgError) as failure:
        status, reason = "failed", str(failure)
    return failed_row(len(loaded.outputs), status, reason)


def with_reasons_in_doubt(loaded: LoadedStudy, values: Array, rows: Rows) -> Rows:
    """The rows of designs (n, columns), with a reason where an answer is from a formula, or a life, out of range."""
    study, everywhere, flags = loaded.study, np.ones(len(values), dtype=bool), list[Broken]()
    if study.model not in ("fe", "three_dimensional"):
        with np.errstate(all="ignore"):
            inside = in_range(designs_of(loaded, values), study.formula).all(axis=(1, 2))
        flags.append(Broken(f"hinge formula {study.formula} outside its range of t/R", np.asarray(~inside)))
    if study.life is not None:
        cycles, safety = (rows.values[:, loaded.outputs.index(name)] for name in ("life_cycles", "safety_factor"))
        low, high = required_law(loaded.stage.material).range
        beyond, outside = np.asarray(safety < 1), np.asarray((cycles < low) | (cycles > high))
        flags.append(Broken("life by elastic stress, beyond yield", beyond))
        flags.append(Broken("life extrapolated, outside the cycles of Basquin's law", outside & ~beyond))
        flags += [Broken(text, everywhere) for text in of_preloads(loaded.stage)]
    if study.drift is not None:
        flags += [Broken(f"drift: {text}", everywhere) for text in warning.of_stacks(loaded.stage)]
    reason = rows.reason.astype(object)
    for text, where in flags:
        here = where & (rows.status == "ok")
        reason[here] = [f"{said}; {text}" if said else text for said in reason[here]]
    return rows._replace(reason=reason)


def _off_limits(loaded: LoadedStudy, values: Array) -> list[Broken]:
    """Values that no stage file can give."""
    return [
        Broken(f"{path}: a number no stage file can give", keys()[path].impossible(values[:, index]))
        for index, column in enumerate(loaded.columns)
        for path in column.keys
    ]


ROUND_OFF = 1e-10  # of the size of an output, which a factor changes by more


def nominal(loaded: LoadedStudy) -> dict[str, float]:
    """Outputs of the base stage by column, and the factors it has one value of; no outputs when it has no answer."""
    study = loaded.study.model_copy(update={"bands": False, "constraint": ()})
    alone, nothing = replace(loaded, study=study, columns=()), np.empty((1, 0))
    rows = answer_designs(alone, nothing) if study.model == "analytic" else _solved_row(alone, nothing[0])
    found = own_values(loaded)
    if rows.status[0] == "ok":
        found |= dict(zip(study.outputs, map(float, rows.values[0]), strict=True))
        columns = {name: np.array([value]) for name, value in found.items()}
        derived = judge(alone, columns, np.array([True])).derived
        found |= {name: float(value[0]) for name, value in derived.items() if np.isfinite(value[0])}
    return found


def own_values(loaded: LoadedStudy) -> dict[str, float]:
    """The base stage's values of the factors, in file units, by column; none where its keys differ."""
    values = {c.name: {keys()[path].value_in(loaded.stage) for path in c.keys} for c in loaded.columns}
    return {name: value for name, (value, *more) in values.items() if not more and value is not None}


def unseen(loaded: LoadedStudy) -> list[str]:
    """Warnings on factors that change none of the outputs that a study shows or constrains, of all where it does not.

    Found by the model itself: designs that differ in one factor alone, compared output by output. Finite elements mesh
    what a factor changes, and are not asked.
    """
    study = loaded.study
    if study.model != "analytic":
        return []
    figured = {name for figure in study.figure for name, _ in figure.columns.values()}
    limited = {name for one in study.constraint for name in names_in(one.value)}
    named = names_behind(figured | limited, study.output)
    shown = [name for name in loaded.outputs if name in named] or list(loaded.outputs)
    found = []
    for name, changed in _changes(loaded).items():
        if not changed & set(shown):
            others = f"; it changes {', '.join(sorted(changed))} alone" if changed else ""
            found.append(f"factor {name} changes none of {', '.join(shown)} in this model{others}")
    return found


def _changes(loaded: LoadedStudy) -> dict[str, set[str]]:
    """Outputs that each factor changes, by column; without factors of one value, or of no pair of designs with answers.

    A design at the start and one in the middle of the sample, each with every factor at its least and its greatest.
    """
    some = sample(loaded, 0, min(loaded.count, 1000))
    bases = some[[0, len(some) // 2]][: 1 if loaded.study.links else 2]  # 0.1 s a design where links bend
    k = len(loaded.columns)
    moved = np.repeat(bases[:, None], 2 * k, axis=1).reshape(len(bases), k, 2, k)
    moved[:, range(k), :, range(k)] = np.stack([some.min(axis=0), some.max(axis=0)], axis=1)[:, None]
    free = loaded.study.model_copy(update={"check": "closed_form", "constraint": ()})
    answers = answer_designs(replace(loaded, study=free), np.vstack([bases, moved.reshape(-1, k)])).values
    own, others = answers[: len(bases), None, None], answers[len(bases) :].reshape(len(bases), k, 2, -1)
    size = np.abs(own)
    for name, part in sizes_of(dict(zip(loaded.outputs, np.moveaxis(own, -1, 0), strict=True))).items():
        if name in loaded.outputs:
            size[..., loaded.outputs.index(name)] = part
    answered = np.isfinite(own).all(axis=-1) & np.isfinite(others).all(axis=-1)
    tried = answered & (moved != bases[:, None, None]).any(axis=-1)
    changed = ((np.abs(others - own) > ROUND_OFF * size) & tried[..., None]).any(axis=(0, 2))
    return {
        column.name: set(compress(loaded.outputs, changed[index]))
        for index, column in enumerate(loaded.columns)
        if tried[:, index].any()
    }
