"""Results of designs by any model, one row each with its status, and results of the base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress, pairwise

import numpy as np

from flexfem.arrays import ROUND_OFF, Array, Index
from flexfem.files.toml import bad_key
from flexfem.meshing.process import MeshTimeout
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.batch import Batch
from flexfem.study.columns import Rows, row_of, sizes_of
from flexfem.study.judge import judge, refusals_of
from flexfem.study.loaded import LoadedStudy, base_factor_values, sample
from flexfem.study.numbers import NoSuchNumber
from flexfem.study.plan import Study

LOOKED_AT = 1000  # designs of a sample between whose extremes a factor is varied


def answer(
    loaded: LoadedStudy,
    start: int,
    stop: int,
) -> Rows:
    """Return the rows of the designs from `start` up to `stop`."""
    batch = loaded.family.batch
    step = max(stop - start, 1) if batch is None else batch.most
    ends = [*range(start, stop, step), stop]
    values = (sample(loaded, *pair) for pair in pairwise(ends))
    return joined(loaded, [answer_designs(loaded, each) for each in values])


def joined(loaded: LoadedStudy, batches: list[Rows]) -> Rows:
    """Join rows of designs."""
    if not batches:
        empty = np.array([], dtype=object)
        return Rows(empty, empty, np.empty((0, len(loaded.outputs))))
    return Rows(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


def answer_designs(loaded: LoadedStudy, values: Array) -> Rows:
    """Return the rows of the designs with factor values (n, columns), file units.

    The analytic model computes them at once where the mechanism offers it (`Family.batch`); other
    designs are computed one after the other.
    """
    batch = loaded.family.batch
    if batch is None:
        return joined(loaded, [_row(loaded, each) for each in values])
    return _batched_rows(loaded, batch, values)


def _batched_rows(
    loaded: LoadedStudy,
    batch: Batch,
    values: Array,
) -> Rows:
    """Return the rows of designs (n, columns) whose outputs a batch computes, all or some."""
    found = batch.rows(values, refusals_of(loaded, values))
    status = np.where(found.reasons == "", "ok", "refused").astype(object)
    reasons = found.reasons.astype(object)
    outputs = np.full((len(values), len(loaded.outputs)), np.nan)
    places = [loaded.outputs.index(name) for name in batch.outputs]
    outputs[:, places] = found.values
    rows = Rows(status, reasons, outputs)
    missing = [name for name in loaded.outputs if name not in batch.outputs]
    if missing:
        _ask_missing(loaded, values, rows, missing, np.flatnonzero(~found.left & (reasons == "")))
    outputs[status != "ok"] = np.nan
    rows = with_warnings(loaded, values, rows)
    for index in np.flatnonzero(found.left):
        alone = _row(loaded, values[index])
        for part, one in zip(rows, alone, strict=True):
            part[index] = one[0]
    return rows


def _ask_missing(
    loaded: LoadedStudy, values: Array, rows: Rows, missing: Sequence[str], designs: Index
) -> None:
    """Set outputs that a batch does not compute, or why there are none, in the rows of designs."""
    family = loaded.family
    places = [loaded.outputs.index(name) for name in missing]
    for index in designs:
        try:
            numbers = family.numbers(family.mechanism(values[index]), missing)
        except BadInput as refusal:
            rows.status[index] = "refused"
            rows.reason[index] = str(refusal)
        else:
            rows.values[index, places] = numbers[:, 0]


def _row(loaded: LoadedStudy, values: Array) -> Rows:
    """Return the row of the design with factor values (columns,), file units; errors become its
    status.
    """
    (reason,) = refusals_of(loaded, values[None])
    family = loaded.family
    try:
        if reason:
            raise BadInput(reason)
        design = family.mechanism(values)
        design.check()
        rows = row_of("ok", "", family.solved(design))
        return with_warnings(loaded, values[None], rows)
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


def with_warnings(
    loaded: LoadedStudy,
    values: Array,
    rows: Rows,
) -> Rows:
    """Return the rows of designs (n, columns) with warnings as reasons, such as a formula used
    outside its range.
    """
    reason = rows.reason.astype(object)
    for text, where in loaded.family.flags(values, rows):
        warned = where & (rows.status == "ok")
        reason[warned] = [f"{earlier}; {text}" if earlier else text for earlier in reason[warned]]
    return rows._replace(reason=reason)


def require_extra_numbers(loaded: LoadedStudy) -> None:
    """Raise BadInput where a study requests a number that its model does not give for the base
    stage.
    """
    try:
        loaded.family.numbers(loaded.base)
    except NoSuchNumber as error:
        raise bad_key(loaded.path, ("ask",), str(error)) from None
    except (BadInput, ComputationFailed):  # designs may have what the base stage lacks
        pass


def nominal(loaded: LoadedStudy) -> dict[str, float]:
    """Return outputs and factor values of the base by column; no outputs where they cannot be
    computed.
    """
    study = loaded.study.model_copy(update={"bands": False, "constraint": ()})
    base = replace(loaded, study=study, columns=())
    rows = answer_designs(base, np.empty((1, 0)))
    columns = {name: np.array([value]) for name, value in base_factor_values(loaded).items()}
    columns |= dict(zip(study.outputs, rows.values.T, strict=True))
    columns |= judge(base, columns, rows.status == "ok").derived
    return {name: float(value) for name, (value,) in columns.items() if np.isfinite(value)}


# effects of factors


def changed_outputs(loaded: LoadedStudy) -> dict[str, list[str]]:
    """Return the outputs that each factor changes, by column, without factors whose effect is not
    known.

    The analytic model computes a design of the sample, and the same with one factor after the other
    at its least and greatest value in the sample. In studies by finite elements only factors that
    leave their mesh and stiffness as they are can change nothing, such as a yield strength; of the
    others only those are known that leave the whole mechanism as it is, such as a parameter that no
    number of the file uses.
    """
    drawn = sample(loaded, 0, min(loaded.count, LOOKED_AT))
    varied = [index for index in range(len(loaded.columns)) if np.ptp(drawn[:, index]) > 0]
    study = loaded.study
    if study.model == "analytic":
        return _changed_by_model(loaded, study, drawn, varied)
    family = loaded.family
    checked = [index for index in varied if family.moves_no_mesh(loaded.columns[index])]
    analytic = study.model_copy(update={"model": "analytic", "bands": False})
    found = _changed_by_model(loaded, analytic, drawn, checked)
    for index in varied:
        if index not in checked and family.is_without_effect(*_ends(drawn, index)):
            found[loaded.columns[index].name] = []
    return found


def _ends(drawn: Array, column: int) -> Array:
    """Return a design of a sample (n, columns) with the least and the greatest value of a column,
    (2, columns).
    """
    ends = np.tile(drawn[len(drawn) // 2], (2, 1))
    ends[:, column] = drawn[:, column].min(), drawn[:, column].max()
    return ends


def _changed_by_model(
    loaded: LoadedStudy, study: Study, drawn: Array, checked: Sequence[int]
) -> dict[str, list[str]]:
    """Return the outputs of an analytic study that each of the `checked` columns changes in a
    sample, by column.
    """
    if not checked:
        return {}
    study = study.model_copy(update={"check": "closed_form", "constraint": ()})
    analytic = replace(loaded, study=study)
    ends = [_ends(drawn, index) for index in checked]
    values = answer_designs(analytic, np.vstack([drawn[len(drawn) // 2], *ends])).values
    before = values[0]
    after = values[1:].reshape(len(checked), 2, -1)
    known = np.isfinite(before).all() & np.isfinite(after).all(axis=2)
    moved = np.abs(after - before) > ROUND_OFF * _sizes(analytic.outputs, before)
    changed = (moved & known[..., None]).any(axis=1)
    return {
        loaded.columns[index].name: list(compress(analytic.outputs, changed[place]))
        for place, index in enumerate(checked)
        if known[place].all()
    }


def _sizes(outputs: Sequence[str], values: Array) -> Array:
    """Return the sizes (outputs,) to which round-off of one design is relative."""
    size = np.abs(values)
    for name, scale in sizes_of(dict(zip(outputs, values, strict=True))).items():
        if name in outputs:
            size[outputs.index(name)] = scale
    return np.asarray(size)


def factor_warnings(loaded: LoadedStudy, changes: dict[str, list[str]]) -> list[str]:
    """Return a warning for each factor that changes none of the requested numbers.

    These are the outputs in figures and constraints, or all outputs where there are none.

    Parameters
    ----------
    changes : from `changed_outputs`.
    """
    study = loaded.study
    figured = [name for figure in study.figure for name, _ in figure.columns.values()]
    limited = study.names_of(*(constraint.value for constraint in study.constraint))
    used = study.behind(figured) | limited
    numbers = [*study.columns, *study.ask]
    requested = [name for name in numbers if name in used] or numbers
    warnings = list[str]()
    for name, changed in changes.items():
        if not {*changed} & {*requested} and name not in used - {*figured}:
            others = f"; it changes {', '.join(changed)} only" if changed else ""
            warnings.append(f"factor {name} changes none of {', '.join(requested)}{others}")
    return warnings
