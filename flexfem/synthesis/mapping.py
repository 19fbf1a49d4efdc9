"""The model's optimum, finite elements of it, the model corrected by them, and again, until both agree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.files.digest import digest
from flexfem.files.refusals import place_of
from flexfem.refused import BadInput
from flexfem.sources import manifest
from flexfem.study.designs import designs_of
from flexfem.study.outputs import DRIFTS, DRIVE_RANGES, ENGAGED, GRADIENTS
from flexfem.study.versions import versions_of
from flexfem.synthesis import extra
from flexfem.synthesis.elements import ProposedElements
from flexfem.synthesis.model import WORST, Correction, Model, correction_of
from flexfem.synthesis.requirements import SCATTERED
from flexfem.synthesis.search import BestDesign, Say, optimum
from flexfem.verify.corners import corner_bands
from flexfem.verify.errors import mesh_band

ROUNDS = 8  # at most


class Proof(NamedTuple):
    """What finite elements say of a design, quantities in their order (q,).

    predicted : of the model as it was corrected when it proposed the design.   bands : by meshes.
    uncorrected : of the analytic model itself.   gap : largest difference of prediction and elements, over the sizes.
    corrections : that make the model agree here.   columns : by name, of the finite elements where they answer.
    """

    values: Array
    predicted: Array
    uncorrected: Array
    elements: Array
    bands: Array
    gap: float
    corrections: dict[str, Correction]
    columns: dict[str, float]


class Mapped(NamedTuple):
    """What the loop found: the model with its last corrections, every round, and the searches' answers."""

    model: Model
    rounds: list[Proof]
    optima: list[BestDesign]
    agreed: bool


def mapped(model: Model, elements: ProposedElements, say: Say = lambda text: None) -> Mapped:
    """Search, solve, correct, until the model agrees with finite elements at its optimum and all ends are kept there.

    Notes
    -----
    DesignSpace mapping of outputs: Bandler et al., IEEE Trans. Microwave Theory Tech. 52 (2004) 337-361.
    """
    accuracy = model.loaded.requirements.accuracy_percent / 100
    rounds, optima, near = list[Proof](), list[BestDesign](), None
    for _ in range(ROUNDS):
        best = _searched(model, elements, near, say)
        optima.append(best)
        rounds.append(proof(model, elements, best.values, say))
        near = best.values
        if rounds[-1].gap <= accuracy and (best.merit >= WORST or _kept(model, rounds[-1])):
            return Mapped(model.changed(corrections=rounds[-1].corrections), rounds, optima, True)
        guard = rounds[-1].bands[model.objectives :] / model.scales
        if model.space.continuous.any():
            guard = guard + accuracy
        guard = guard if model.guard is None else np.maximum(guard, model.guard)
        model = model.changed(corrections=rounds[-1].corrections, guard=guard)
    return Mapped(model, rounds, optima, False)


def _kept(model: Model, of: Proof) -> bool:
    """Whether finite elements, the band included, keep every end."""
    low, high = model.changed(guard=None).ends
    q, band = of.elements[model.objectives :], of.bands[model.objectives :]
    return bool(np.all((q - band >= low) & (q + band <= high)))


def _searched(model: Model, elements: ProposedElements, near: Array | None, say: Say) -> BestDesign:
    """The optimum of the model as it is, from what is kept where the same was searched before."""
    before, store = model.counts.copy(), elements.store
    question = digest([_content(model), None if near is None else near.tolist()])
    if (known := store.answer(question)) is not None:
        values, relaxed, merits, history, counted = known
        model.counts.update(counted)
        return BestDesign(np.array(values), np.array(relaxed), merits[0], merits[1], [tuple(each) for each in history])
    found = optimum(model, model.loaded.requirements.seed, near, say)
    if found.merit >= 100 * WORST:
        reason = model.found(found.values[None]).reason[0] or "its bodies cannot be drawn"
        raise BadInput(f"{place_of(model.loaded.path)}: no design of the free dimensions can be answered: {reason}")
    counted = dict(model.counts - before)
    merits = [found.merit, found.relaxed_merit]
    store.keep(question, [found.values.tolist(), found.relaxed.tolist(), merits, found.history, counted])
    return found


def _content(model: Model) -> Any:
    """All that a search depends on, as plain data."""
    own = {name: digits for name, digits in manifest().items() if name.startswith("synthesis/")}
    guard = None if model.guard is None else model.guard.tolist()
    state = [guard, sorted((k, list(v)) for k, v in model.corrections.items())]
    return [model.loaded.hash, state, own, dict(versions_of(True))]


def proof(model: Model, elements: ProposedElements, values: Array, say: Say = lambda text: None) -> Proof:
    """Finite elements of a design, and the corrections that make the model agree with them there."""
    columns, _ = model.columns(values[None])
    own = {name: float(column[0]) for name, column in columns.items()}
    meshed, scattered = elements.of(values, say), elements.scattered(values, say)
    by_mesh = [own | found for found in meshed.columns]
    corrections = {name: correction_of(own[name], value) for name, value in meshed.columns[-1].items() if name in own}
    quantities = np.array([_quantities(model, each) for each in by_mesh])
    bands = _bands(model, meshed.resolutions, quantities)
    if scattered is not None:
        some = _scatter_of_model(model, values)
        corrections |= {name: correction_of(some[name], scattered.columns[-1][name]) for name in SCATTERED}
        of_scatter = [_with(own | meshed.columns[-1], each, some) for each in scattered.columns]
        of_meshes = np.array([_quantities(model, each) for each in of_scatter])
        bands = np.maximum(bands, [_band(scattered.resolutions, each) for each in of_meshes.T])
        quantities[-1] = of_meshes[-1]
    predicted = model.found(values[None]).quantities[0]
    size = np.maximum(np.abs(quantities[-1]), np.concatenate([np.zeros(model.objectives), model.scales]))
    gap = float(np.max(np.abs(predicted - quantities[-1]) / np.where(size > 0, size, 1.0)))
    return Proof(values, predicted, _quantities(model, own), quantities[-1], bands, gap, corrections, by_mesh[-1])


def _quantities(model: Model, columns: Mapping[str, float]) -> Array:
    return np.asarray(model.quantities({name: np.array([value]) for name, value in columns.items()}, 1)[0])


def _bands(model: Model, resolutions: tuple[int, ...], values: Array) -> Array:
    """Half-widths (q,) by meshes of quantities (levels, q); of those of drives and drift by the order of corners."""
    of = model.loaded.requirements
    slow = [bool(of.names_of(text) & {*DRIVE_RANGES, *ENGAGED, *DRIFTS, *GRADIENTS}) for text in of.quantities]
    plain = np.array([_band(resolutions, each) for each in values.T])
    if not any(slow):
        return plain
    return np.where(slow, np.maximum(plain, corner_bands(np.array(resolutions, dtype=float), values)), plain)


def _band(resolutions: tuple[int, ...], values: Array) -> float:
    found = np.array(resolutions, dtype=float)
    return mesh_band(found, values) if np.ptp(values) > 0 else 0.0


def _scatter_of_model(model: Model, values: Array) -> dict[str, float]:
    """The 95 % couplings by the model of those scattered stages alone that finite elements solve."""
    tolerance = model.loaded.requirements.tolerance
    assert tolerance is not None
    deviations = extra.offsets(model.loaded.study, tolerance, model.loaded.requirements.seed, tolerance.checked)
    designs = designs_of(model.loaded.study, values[None])
    found = extra.scattered_coupling(model.loaded.study, designs, deviations)[0]
    return dict(zip(SCATTERED, map(float, found), strict=True))


def _with(columns: dict[str, float], scattered: Mapping[str, float], some: Mapping[str, float]) -> dict[str, float]:
    """Columns with the couplings of all scattered stages: the model's times what elements say of some over its own."""
    return columns | {name: columns[name] * scattered[name] / some[name] for name in SCATTERED}
