"""A range of designs in, a row for each out: whatever the model, and whatever goes wrong."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np

from flexfem.analytic.drive import LinkParts, link_parts
from flexfem.analytic.dynamics import ON_BODIES, elastic_bodies
from flexfem.analytic.kinematics import Freedoms, freedoms_of, stage_freedoms
from flexfem.analytic.links import body_compliance
from flexfem.analytic.model import analyse, hinge_compliances, in_range, unanswered
from flexfem.analytic.notch import Compliance
from flexfem.arrays import AnyArray, Array
from flexfem.clock import Limit
from flexfem.refused import BadInput, ComputationFailed
from flexfem.stage.designs import Designs
from flexfem.stage.driven_designs import drives_of
from flexfem.stage.drives import StageDrive, drive_of
from flexfem.stage.feasibility import Broken, broken, check_feasible, conditions
from flexfem.stage.inertia import Payload, body_moments, hub_moments
from flexfem.stage.keys import keys
from flexfem.stage.schema import Stage
from flexfem.study.columns import Rows, row_of, values_of
from flexfem.study.designs import designs_of, refusals_of, stage_of
from flexfem.study.loaded import LoadedStudy
from flexfem.study.sampling import sample
from flexfem.verify.drive_ranges import DriveAnswers
from flexfem.verify.modes import payload_of
from flexfem.verify.questions import Clock, Moments, ask_drives, ask_elements, ask_formulas, ask_frequencies, ask_solid

UNMOVED = "actuator: the drive does not move the platform in three directions, or its preloads make a neck yield"
BATCH = 4096  # analytic designs at a time, whatever is asked: bounds the memory


def answer(loaded: LoadedStudy, start: int, stop: int, inside: bool = False) -> Rows:
    """Answer the designs from `start` up to `stop`.

    Parameters
    ----------
    inside : gmsh may run in this very process, one that can be killed; else meshes are made in a child process, which
        ends with the time limit.
    """
    if loaded.study.model == "analytic":
        ends = [*range(start, stop, BATCH), stop]
        batches = [answer_designs(loaded, sample(loaded, *pair)) for pair in pairwise(ends)]
    else:
        batches = [_solved_row(loaded, values, inside) for values in sample(loaded, start, stop)]
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
        refused = [*broken(conditions(designs)), *unanswered(designs, study.formula, hinges)]
        reason = _first([*_off_limits(loaded, values), *refused])
        reason = np.where(reason == "", refusals_of(loaded, values), reason)
        freedoms = stage_freedoms(designs.prismatic) if study.mobility is None else freedoms_of(study.mobility)
        bodies = _drawn(loaded, values, reason) if study.draws or study.links else None
        found = ask_formulas(designs, hinges, freedoms, bodies if study.links else None)
        if study.driven:
            found = found._replace(drives=_driven(loaded, values, reason, designs, hinges, freedoms))
        if study.frequencies is not None:
            found = found._replace(frequencies=_vibrating(loaded, values, reason, designs, hinges, freedoms))
        reason[np.isnan(found.stiffness[:, 0, 0]) & (reason == "")] = "chain: singular configuration at rest"
        if found.drives is not None:
            reason[np.isnan(found.drives.range).any(axis=1) & (reason == "")] = UNMOVED
        answers = values_of(found, study.rotation)
    answers[reason != ""] = np.nan
    return _doubted(loaded, values, Rows(np.where(reason == "", "ok", "refused").astype(object), reason, answers))


def _driven(
    loaded: LoadedStudy, values: Array, reason: AnyArray, designs: Designs, hinges: Compliance, freedoms: Freedoms
) -> DriveAnswers:
    """What the drives of the designs do; reasons against their contacts and forces go to `reason`."""
    stages = cache(lambda index: stage_of(loaded, values[index]))
    drive = drives_of(loaded.stage, designs, reason, stages)
    elastic = _link_parts(stages, reason, drive) if loaded.study.links else None
    drive.stiffness[reason != ""] = np.nan  # not asked: nan all through
    return ask_drives(designs, hinges, freedoms, drive, elastic)


def _vibrating(
    loaded: LoadedStudy, values: Array, reason: AnyArray, designs: Designs, hinges: Compliance, freedoms: Freedoms
) -> Array:
    """Natural frequencies (n, 3), rad/s; every design is drawn, and reasons why it cannot be go to `reason`."""
    n, links = len(values), loaded.study.links
    moments = Moments(np.ones((n, 3, 4, 4)) * [1.0, 0.0, 0.0, 1.0], np.ones((n, 4)) * [1.0, 0.0, 0.0, 1.0])
    shapes = (3, 3, 3), (3, 3, ON_BODIES), (ON_BODIES, ON_BODIES), (9, 9)
    elastic = LinkParts(*(np.zeros((n, *shape)) for shape in shapes)) if links else None
    for index in np.flatnonzero(reason == ""):
        try:
            stage = stage_of(loaded, values[index])
            moments.bodies[index], moments.hub[index] = body_moments(stage), hub_moments(stage)
            for all_of, one in zip(elastic or (), elastic_bodies(stage) if elastic else (), strict=True):
                all_of[index] = one
        except BadInput as refusal:
            reason[index] = str(refusal)
    return ask_frequencies(designs, hinges, freedoms, moments, _payload(loaded) or Payload(), elastic)


def _payload(loaded: LoadedStudy) -> Payload | None:
    """What the platform carries where natural frequencies are asked for, else None."""
    of = loaded.study.frequencies
    return None if of is None else payload_of(of.payload_kg, of.payload_kg_mm2)


def _link_parts(stages: Callable[[int], Stage], reason: AnyArray, drive: StageDrive) -> LinkParts:
    """What elastic links add to the compliances of n designs, one by one; zero for those refused."""
    n, stacks = len(reason), len(drive.stacks)
    shapes = (3, 3, 3), (3, 3, stacks), (stacks, stacks), (9, 9)
    found = LinkParts(*(np.zeros((n, *shape)) for shape in shapes))
    for index in np.flatnonzero(reason == ""):
        try:
            own = link_parts(stages(int(index)), drive_of(stages(int(index))).stacks)
        except BadInput as refusal:
            reason[index] = str(refusal)
            continue
        for all_of, one in zip(found, own, strict=True):
            all_of[index] = one
    return found


def solved_values(stage: Stage, loaded: LoadedStudy, inside: bool) -> Array:
    """Values (outputs,) of a feasible design, for models that mesh. Raises as `ask_elements`, or the formula."""
    study, clock = loaded.study, Clock(Limit(loaded.study.time_limit), inside)
    predicted = analyse(stage, study.mobility, study.formula).stiffness if study.model == "verify" else None
    if study.model == "three_dimensional":
        found = ask_solid(stage, study.resolution, study.layers, clock)
    else:
        found = ask_elements(stage, study.resolution, clock, predicted, study.bands, _payload(loaded))
    return np.asarray(values_of(found, study.rotation)[0])


def _solved_row(loaded: LoadedStudy, values: Array, inside: bool) -> Rows:
    """The row of the design whose factors take `values` (columns,), file units, whatever becomes of it."""
    from flexfem.fem.gmsh_process import MeshTimeout

    (reason,) = refusals_of(loaded, values[None])
    try:
        if reason:
            raise BadInput(reason)
        stage = stage_of(loaded, values)
        check_feasible(stage)
        found = solved_values(stage, loaded, inside)
        return _doubted(loaded, values[None], row_of("ok", "", found))
    except BadInput as refusal:
        status, reason = "refused", str(refusal)
    except MeshTimeout as failure:
        status, reason = "time limit", str(failure)
    except (ComputationFailed, np.linalg.LinAlgError) as failure:
        status, reason = "failed", str(failure)
    return row_of(status, reason, np.full(len(loaded.outputs), np.nan))


def _doubted(loaded: LoadedStudy, values: Array, rows: Rows) -> Rows:
    """The rows of designs (n, columns), with a reason where an answer is from a formula outside its range."""
    if loaded.study.model in ("fe", "three_dimensional"):
        return rows
    with np.errstate(all="ignore"):
        inside = in_range(designs_of(loaded, values), loaded.study.formula).all(axis=(1, 2))
    where = (rows.status == "ok") & ~inside
    text = f"hinge formula {loaded.study.formula} outside its range of t/R"
    return rows._replace(reason=np.where(where, text, rows.reason).astype(object))


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


def _drawn(loaded: LoadedStudy, values: Array, reason: AnyArray) -> Array:
    """Draw the designs not refused so far, one by one: reasons go to `reason`, bodies' compliances (n, 9, 9) back."""
    bodies = np.zeros((len(values), 9, 9))
    for index in np.flatnonzero(reason == ""):
        try:
            stage = stage_of(loaded, values[index])
            if loaded.study.draws:
                check_feasible(stage)
            if loaded.study.links:
                bodies[index] = body_compliance(stage)
        except BadInput as refusal:
            reason[index] = str(refusal)
    return bodies
