"""Results of designs by any model, one row each with its status, and results of the base stage."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import compress, pairwise
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np

import flexfem
from flexfem.analytic.network import Dynamics
from flexfem.arrays import ROUND_OFF, AnyArray, Array
from flexfem.fem.mesher import Limit, MeshTimeout
from flexfem.files.refusals import suggestion
from flexfem.files.toml import bad_key
from flexfem.hinges.strength import KEY, required_law
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.keys import LIFE_CONSTANTS, keys
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper import responses
from flexfem.paper.batch import LOWEST, batch_at_rest, solved_design
from flexfem.paper.driven import drive_ranges
from flexfem.paper.drives import drive_of, drives_of
from flexfem.paper.equations import freedoms_of, mobility
from flexfem.paper.feasibility import Broken, conditions
from flexfem.paper.links import body_compliance, edge_motions
from flexfem.paper.model import analyse, hinge_compliances, in_range, invalid_hinges
from flexfem.paper.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.driven import Driven
from flexfem.questions.life import CyclicMotion, cyclic_motion, preload_warnings
from flexfem.questions.modes import payload_of
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.columns import Rows, row_of, sizes_of, values_of
from flexfem.study.loaded import (
    LoadedStudy,
    designs_of,
    judge,
    plate_of,
    refusals_of,
    sample,
    stage_of,
)
from flexfem.study.plan import Study

Stages = Callable[[int], Stage]  # the stage of a design by its index
Result = TypeVar("Result")


def needs_stages(study: Study) -> bool:
    """Return whether the analytic model of a study needs a `Stage` of every design, not only its
    arrays.
    """
    return study.draws or study.links or study.frequencies is not None or bool(study.ask)


def for_stages(
    stages: Stages, reason: AnyArray, function: Callable[[Stage], Result]
) -> dict[int, Result]:
    """Return the results of a function of each stage not yet refused, by index; its refusals go to
    `reason`.
    """
    results = dict[int, Result]()
    for index in map(int, np.flatnonzero(reason == "")):
        try:
            results[index] = function(stages(index))
        except BadInput as refusal:
            reason[index] = str(refusal)
    return results


FATIGUE = f"{KEY}: expected {UNLIKELY.format(*STRENGTHS, 'material.yield_strength_mpa')}"
UNMOVED = (
    "actuator: the drive does not move the platform in three directions, or its preloads make a "
    "neck yield"
)
SINGULAR = (
    "chain: singular to working precision at rest: its hinges are in line, or its necks differ "
    "too much"
)
BATCH = 4096  # analytic designs at a time: bounds the memory
STAGES_BATCH = (
    512  # the same where every design needs a stage, which takes 60 kB until the batch is done
)


def answer(loaded: LoadedStudy, start: int, stop: int) -> Rows:
    """Return the rows of the designs from `start` up to `stop`."""
    ends = [*range(start, stop, STAGES_BATCH if needs_stages(loaded.study) else BATCH), stop]
    return joined(
        loaded, [answer_designs(loaded, sample(loaded, *pair)) for pair in pairwise(ends)]
    )


def joined(loaded: LoadedStudy, batches: list[Rows]) -> Rows:
    """Join rows of designs."""
    empty = np.array([], dtype=object)
    batches = batches or [Rows(empty, empty, np.empty((0, len(loaded.outputs))))]
    return Rows(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


def answer_designs(loaded: LoadedStudy, values: Array) -> Rows:
    """Return the rows of the designs with factor values (n, columns), file units.

    The analytic model of stages computes them at once; other models and mechanisms, one after the
    other."""
    study = loaded.study
    if study.model != "analytic" or isinstance(loaded.base, MechanismFile):
        return joined(loaded, [_solved_row(loaded, each) for each in values])
    with np.errstate(all="ignore"):  # numbers of impossible designs, which are refused
        designs = designs_of(loaded, values)
        hinges = hinge_compliances(designs, study.formula)
        freedoms = freedoms_of(study.mobility, designs.prismatic)
        doubtful = unlikely(designs.fatigue[:, 0], designs.yield_strength)
        limits = [
            (path, value)
            for column, value in zip(loaded.columns, values.T, strict=True)
            for path in column.keys
        ]
        refused = [
            Broken(
                f"{path}: outside the limits of a stage file", keys()[path].number.refuses(value)
            )
            for path, value in limits
        ]
        refused += [condition.broken for condition in conditions(designs)]
        refused += [*invalid_hinges(designs, study.formula, hinges), Broken(FATIGUE, doubtful)]
        reasons = [np.array(refusal.reason, object) for refusal in refused]
        reason = np.select(
            [refusal.where for refusal in refused], reasons, refusals_of(loaded, values)
        )
        stages = cache(lambda index: stage_of(loaded, values[index]))
        model = (hinges, freedoms)

        def stacked(function: Callable[[Stage], tuple[Array, ...]]) -> list[Array]:
            """Return the arrays (n, ...) of a function of every stage, with the base in place of
            refused designs.
            """
            results = for_stages(stages, reason, function)
            instead = function(loaded.stage) if len(results) < len(reason) else ()
            rows = (results.get(index, instead) for index in range(len(reason)))
            return [np.stack(arrays) for arrays in zip(*rows, strict=True)]

        def links_at(loads: Callable[[Stage], Any]) -> responses.LinkParts | None:
            """Return the parts of elastic links for loads on the bodies, None in a study with rigid
            links.
            """
            if not study.links:
                return None
            return responses.LinkParts(
                *stacked(lambda stage: responses.link_parts(stage, loads(stage)))
            )

        if study.draws:
            for_stages(stages, reason, check_feasible)
        payload, repeated = _questions(study)
        warm = None
        if study.links:
            motions = edge_motions if study.drift is not None else lambda stage: np.zeros((3, 3, 3))
            warm = responses.WarmBodies(
                *stacked(lambda stage: (body_compliance(stage), motions(stage)))
            )
        found = batch_at_rest(designs, *model, None if warm is None else warm.compliance, repeated)
        if study.driven:
            drive = drives_of(loaded.stage, designs, reason, stages)
            links = links_at(lambda stage: drive_of(stage).stacks)
            drive.stiffness[reason != ""] = np.nan  # makes all results of refused designs nan
            response = responses.driven(designs.frames, *model, drive.stacks, links)
            drives = drive_ranges(designs, Driven.of(response.compliance, drive), response.necks)
            found = found._replace(drives=drives)
        if payload is not None:
            (mass,) = stacked(lambda stage: (responses.mass_matrix(stage, payload),))
            links = links_at(responses.body_loads)
            compliance = responses.driven(
                designs.frames, *model, responses.body_loads(), links
            ).compliance
            dynamics = Dynamics(
                compliance, mass, responses.FREEDOMS if study.links else mobility(freedoms)
            )
            found = found._replace(frequencies=dynamics.frequencies[:, :LOWEST])
        if study.drift is not None:
            drift = responses.drift(designs, *model, *responses.in_plane(designs), warm).pose
            found = found._replace(drift=responses.rates_of(drift))
        singular = np.isnan(found.stiffness[:, 0, 0])
        if found.drift is not None:
            singular |= np.isnan(found.drift.uniform).any(axis=1)
        reason[singular & (reason == "")] = SINGULAR
        if found.drives is not None:
            reason[np.isnan(found.drives.range).any(axis=1) & (reason == "")] = UNMOVED
        extra = np.full((len(values), len(study.ask)), np.nan)
        for index, numbers in (
            for_stages(stages, reason, partial(extra_numbers, loaded)).items() if study.ask else ()
        ):
            extra[index] = numbers[:, 0]
        outputs = np.hstack([values_of(found, study.columns, study.rotation), extra])
    outputs[reason != ""] = np.nan
    status = np.where(reason == "", "ok", "refused").astype(object)
    return with_warnings(loaded, values, Rows(status, reason, outputs))


class NoSuchNumber(BadInput):
    """A study requests a number that no result about the stage has."""


def extra_numbers(loaded: LoadedStudy, stage: Mechanism) -> Array:
    """Return the numbers about one stage at the paths `study.ask`, and their bands, (asked, 2); nan
    without a band.

    Raises BadInput, ComputationFailed.
    """
    from flexfem.questions.setup import Analytic
    from flexfem.questions.stiffness import LIMITS

    study = loaded.study
    numbers = dict[str, tuple[float, float]]()
    models = {"analytic": "analytic", "verify": "both"}.get(study.model, "elements")
    settings: dict[str, Any] = {"models": models}
    if models != "elements" and not study.on_mechanism:
        settings["analytic"] = Analytic(study.mobility, study.formula, study.links)
    if models != "analytic":
        settings["resolution"] = study.resolution
    if study.model == "three_dimensional":
        settings |= {"solid": True, "thickness_resolution": study.layers}
    limits = tuple(f"stiffness.{name}" for name in LIMITS)
    if study.on_mechanism and not any(path.startswith(limits) for path in study.ask):
        settings["no_limits"] = True
    for name in dict.fromkeys(path.split(".")[0] for path in study.ask):
        question = getattr(flexfem, name)
        parameters = inspect.signature(question).parameters
        words = get_args(get_type_hints(question).get("models"))
        both = (
            {"models": "both"} if words and models not in words else {}
        )  # it has no finite elements alone
        result = question(
            stage, **{key: value for key, value in (settings | both).items() if key in parameters}
        )
        for entry in result.entries():
            numbers[f"{name}.{entry.path}"] = entry.value, entry.band
    for path in study.ask:
        if path not in numbers:
            close = suggestion(path, numbers) or f", such as {next(iter(numbers))}"
            raise NoSuchNumber(f"ask: no number {path} of this stage and model{close}")
    return np.array([numbers[path] for path in study.ask]).reshape(-1, 2)


def require_extra_numbers(loaded: LoadedStudy) -> None:
    """Raise BadInput where a study requests a number that its model does not give for the base
    stage.
    """
    try:
        if loaded.study.ask:
            extra_numbers(loaded, loaded.base)
    except NoSuchNumber as error:
        raise bad_key(loaded.path, ("ask",), str(error)) from None
    except (BadInput, ComputationFailed):  # designs may have what the base stage lacks
        pass


def _questions(study: Study) -> tuple[Payload | None, CyclicMotion | None]:
    """Return the payload where natural frequencies are requested, and the cyclic pose where lives
    are, else None.
    """
    table = study.frequencies
    life = study.life
    payload = None if table is None else payload_of(table.payload_kg, table.payload_kg_mm2)
    if life is None:
        return payload, None
    return payload, cyclic_motion(
        np.array(life.amplitude), None, life.ratio, life.cycles, life.notch_sensitivity
    )


def solved_values(stage: Stage, loaded: LoadedStudy) -> Array:
    """Return the outputs (outputs,) of a feasible design by finite elements. Raises as
    `solved_design`, `analyse`.
    """
    study = loaded.study
    limit = Limit(loaded.study.time_limit)
    predicted = (
        analyse(stage, study.mobility, study.formula).stiffness if study.model == "verify" else None
    )
    if study.model == "three_dimensional":
        found = solved_design(stage, study.resolution, limit, layers=study.layers)
    else:
        requested = *_questions(study), study.driven, study.drift is not None
        found = solved_design(stage, study.resolution, limit, predicted, study.bands, *requested)
        if found.drives is not None and np.isnan(found.drives.range).any():
            raise BadInput(UNMOVED)
    return np.array(
        [*values_of(found, study.columns, study.rotation)[0], *extra_numbers(loaded, stage)[:, 0]]
    )


def _solved_row(loaded: LoadedStudy, values: Array) -> Rows:
    """Return the row of the design with factor values (columns,), file units; errors become its
    status.
    """
    (reason,) = refusals_of(loaded, values[None])
    try:
        if reason:
            raise BadInput(reason)
        stage = plate_of(loaded, values)
        if isinstance(stage, MechanismFile):
            return row_of("ok", "", extra_numbers(loaded, stage)[:, 0])
        check_feasible(stage)
        return with_warnings(loaded, values[None], row_of("ok", "", solved_values(stage, loaded)))
    except BadInput as refusal:
        status = "refused"
        reason = str(refusal)
    except MeshTimeout as failure:
        status = "time limit"
        reason = str(failure)
    except (ComputationFailed, np.linalg.LinAlgError) as failure:
        status = "failed"
        reason = str(failure)
    return row_of(status, reason, np.full(len(loaded.outputs), np.nan))


def with_warnings(loaded: LoadedStudy, values: Array, rows: Rows) -> Rows:
    """Return the rows of designs (n, columns) with warnings as reasons, such as a formula used
    outside its range.
    """
    study = loaded.study
    everywhere = np.ones(len(values), dtype=bool)
    flags = list[Broken]()
    if study.model not in ("fe", "three_dimensional"):
        with np.errstate(all="ignore"):
            inside = in_range(designs_of(loaded, values), study.formula).all(axis=(1, 2))
        flags.append(
            Broken(f"hinge formula {study.formula} outside its range of t/R", np.asarray(~inside))
        )
    if study.life is not None:
        cycles, safety = (
            rows.values[:, loaded.outputs.index(name)] for name in ("life_cycles", "safety_factor")
        )
        low, high = required_law(loaded.stage.material).range
        yields = np.asarray(safety < 1)
        outside = np.asarray((cycles < low) | (cycles > high))
        flags.append(Broken("life from elastic stress, beyond yield", yields))
        flags.append(
            Broken("life extrapolated, outside the cycles of Basquin's law", outside & ~yields)
        )
        flags += [Broken(text, everywhere) for text in preload_warnings(loaded.stage)]
    if study.drift is not None:
        flags += [Broken(f"drift: {text}", everywhere) for text in warning.of_stacks(loaded.stage)]
    reason = rows.reason.astype(object)
    for text, where in flags:
        warned = where & (rows.status == "ok")
        reason[warned] = [f"{earlier}; {text}" if earlier else text for earlier in reason[warned]]
    return rows._replace(reason=reason)


def nominal(loaded: LoadedStudy) -> dict[str, float]:
    """Return outputs and factor values of the base stage by column; no outputs where they cannot be
    computed.
    """
    study = loaded.study.model_copy(update={"bands": False, "constraint": ()})
    base = replace(loaded, study=study, columns=())
    rows = answer_designs(base, np.empty((1, 0)))
    columns = {name: np.array([value]) for name, value in base_factor_values(loaded).items()}
    columns |= dict(zip(study.outputs, rows.values.T, strict=True))
    columns |= judge(base, columns, rows.status == "ok").derived
    return {name: float(value) for name, (value,) in columns.items() if np.isfinite(value)}


def base_factor_values(loaded: LoadedStudy) -> dict[str, float]:
    """Return the factor values of the base stage by column, file units, without factors whose keys
    differ there.
    """
    values = {
        c.name: {keys()[path].value_in(loaded.base) for path in c.keys} for c in loaded.columns
    }
    return {
        name: value for name, (value, *others) in values.items() if not others and value is not None
    }


LOOKED_AT = 1000  # designs of a sample between whose extremes a factor is varied
INELASTIC = frozenset(
    {"yield_strength", "density", "expansion", *LIFE_CONSTANTS}
)  # they leave the mesh as it is


def changed_outputs(loaded: LoadedStudy) -> dict[str, list[str]]:
    """Return the outputs that each factor changes, by column, without factors whose effect is not
    known.

    The analytic model computes a design of the sample, and the same with one factor after the other
    at its least and greatest value in the sample. In studies by finite elements only factors that
    leave their mesh and stiffness as they are can change nothing, such as a yield strength; the
    others are left out. Of a mechanism these are factors that leave the whole mechanism as it is,
    such as a parameter that no number of the file uses."""
    study = loaded.study
    drawn = sample(loaded, 0, min(loaded.count, LOOKED_AT))
    checked = [index for index, column in enumerate(loaded.columns) if np.ptp(drawn[:, index]) > 0]
    if study.model != "analytic" and study.on_mechanism:
        return {
            loaded.columns[index].name: []
            for index in checked
            if _is_without_effect(loaded, drawn, index)
        }
    if study.model != "analytic":
        attributes = [{keys()[path].attribute for path in column.keys} for column in loaded.columns]
        checked = [index for index in checked if attributes[index] <= INELASTIC]
        study = study.model_copy(update={"model": "analytic", "bands": False})
    if not checked:
        return {}
    study = study.model_copy(update={"check": "closed_form", "constraint": ()})
    ends = np.stack([drawn.min(axis=0), drawn.max(axis=0)])
    varied = np.tile(drawn[len(drawn) // 2], (1 + 2 * len(checked), 1))
    for place, index in enumerate(checked):
        varied[1 + 2 * place : 3 + 2 * place, index] = ends[:, index]
    alike = replace(loaded, study=study)
    values = answer_designs(alike, varied).values
    before = values[0]
    after = values[1:].reshape(len(checked), 2, -1)
    size = np.abs(before)
    for name, scale in sizes_of(dict(zip(alike.outputs, before, strict=True))).items():
        if name in alike.outputs:
            size[alike.outputs.index(name)] = scale
    known = np.isfinite(before).all() & np.isfinite(after).all(axis=2)
    changed = (np.abs(after - before) > ROUND_OFF * size) & known[..., None]
    return {
        loaded.columns[index].name: list(compress(alike.outputs, changed[place].any(axis=0)))
        for place, index in enumerate(checked)
        if known[place].all()
    }


def _is_without_effect(loaded: LoadedStudy, drawn: Array, column: int) -> bool:
    """Whether mechanisms with the least and the greatest value of a column are the same."""
    mechanisms = list[Mechanism]()
    for value in (drawn[:, column].min(), drawn[:, column].max()):
        values = drawn[len(drawn) // 2].copy()
        values[column] = value
        try:
            plate = plate_of(loaded, values)
        except BadInput:
            return False
        assert isinstance(plate, MechanismFile)
        mechanisms.append(plate)
    one, other = mechanisms
    return one.hash == other.hash and one.frame == other.frame and one.material == other.material


def factor_warnings(loaded: LoadedStudy, changes: dict[str, list[str]]) -> list[str]:
    """Return a warning for each factor that changes none of the requested numbers.

    These are the outputs in figures and constraints, or all outputs where there are none.

    Parameters
    ----------
    changes : from `changed_outputs`.
    """
    study = loaded.study
    figured = [name for figure in study.figure for name, _ in figure.columns.values()]
    used = study.behind(figured) | study.names_of(
        *(constraint.value for constraint in study.constraint)
    )
    requested = [name for name in loaded.outputs if name in used] or list(loaded.outputs)
    warnings = list[str]()
    for name, changed in changes.items():
        if not {*changed} & {*requested} and name not in used - {*figured}:
            others = f"; it changes {', '.join(changed)} only" if changed else ""
            warnings.append(f"factor {name} changes none of {', '.join(requested)}{others}")
    return warnings
