"""A range of designs in, a row for each out: whatever the model, and whatever goes wrong."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from flexfem.analytic.model import analyse, hinge_compliances, in_range, unanswered
from flexfem.analytic.paper import freedoms_of, stage_freedoms
from flexfem.arrays import AnyArray, Array
from flexfem.clock import Limit
from flexfem.hinges.strength import KEY, required_law
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.feasibility import Broken, broken, check_feasible, conditions
from flexfem.mechanism.keys import keys
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study import drawn
from flexfem.study.designs import designs_of, refusals_of, stage_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.outputs import Rows, row_of, values_of
from flexfem.study.plan import Study
from flexfem.study.sampling import sample
from flexfem.verify.questions import Clock, ask_drift, ask_elements, ask_formulas, ask_solid
from flexfem.verify.strained import Repeated, of_preloads, scaled

UNMOVED = "actuator: the drive does not move the platform in three directions, or its preloads make a neck yield"
SINGULAR = "chain: singular to working precision at rest, by hinges in line or by necks that are too unlike"
BATCH = 4096  # analytic designs at a time, whatever is asked: bounds the memory
DRAWN = 512  # of them, where each is made a stage, which is kept until the batch is answered: 60 kB


def answer(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """Answer the designs from `start` up to `stop`."""
    if loaded.study.model == "analytic":
        ends = [*range(start, stop, DRAWN if drawn.drawn_one_by_one(loaded.study) else BATCH), stop]
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
        refused = [*broken(conditions(designs)), *unanswered(designs, study.formula, hinges), *_units(study, designs)]
        reason = _first([*_off_limits(loaded, values), *refused])
        reason = np.where(reason == "", refusals_of(loaded, values), reason)
        freedoms = stage_freedoms(designs.prismatic) if study.mobility is None else freedoms_of(study.mobility)
        stages = cache(lambda index: stage_of(loaded, values[index]))
        bodies = drawn.elastic_parts(loaded, stages, reason)
        found = ask_formulas(
            designs, hinges, freedoms, None if bodies is None else bodies.compliance, _repeated(loaded)
        )
        if study.driven:
            found = found._replace(drives=drawn.driven(loaded, stages, reason, designs, hinges, freedoms))
        if study.frequencies is not None:
            found = found._replace(frequencies=drawn.vibrating(loaded, stages, reason, designs, hinges, freedoms))
        if study.drift is not None:
            found = found._replace(drift=ask_drift(designs, hinges, freedoms, bodies))
        lost = np.isnan(found.stiffness[:, 0, 0])
        if found.drift is not None:
            lost |= np.isnan(found.drift.uniform).any(axis=1)
        reason[lost & (reason == "")] = SINGULAR
        if found.drives is not None:
            reason[np.isnan(found.drives.range).any(axis=1) & (reason == "")] = UNMOVED
        answers = values_of(found, study.rotation)
    answers[reason != ""] = np.nan
    return doubted(loaded, values, Rows(np.where(reason == "", "ok", "refused").astype(object), reason, answers))


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
    """Values (outputs,) of a feasible design, for models that mesh. Raises as `ask_elements`, or the formula."""
    study, clock = loaded.study, Clock(Limit(loaded.study.time_limit), False)
    predicted = analyse(stage, study.mobility, study.formula).stiffness if study.model == "verify" else None
    if study.model == "three_dimensional":
        found = ask_solid(stage, study.resolution, study.layers, clock)
    else:
        asked = drawn.payload(loaded), _repeated(loaded), study.driven, study.drift is not None
        found = ask_elements(stage, study.resolution, clock, predicted, study.bands, *asked)
        if found.drives is not None and np.isnan(found.drives.range).any():
            raise BadInput(UNMOVED)
    return np.asarray(values_of(found, study.rotation)[0])


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
