"""The model's optimum, finite elements of it, the model corrected by them, and again, until both agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.files.refusals import place_of
from flexfem.questions.bands import corner_bands, mesh_band, stress_bands
from flexfem.refused import BadInput
from flexfem.study.columns import DRIFTS, DRIVE_RANGES, ENGAGED, GRADIENTS, RANGES, STRESSES, lasting, round_off_of
from flexfem.study.workers import versions_of
from flexfem.synthesis.elements import SCATTER, ProposedElements
from flexfem.synthesis.model import WORST, Correction, Model, correction_of
from flexfem.synthesis.scattered import ScatteredStages, scattered_stages
from flexfem.synthesis.search import BestDesign, Say, optimum
from flexfem.synthesis.store import Store

ROUNDS = 8  # at most
ROOM = (1.0, 0.1)  # of the accuracy, that guards leave beside the bands, while any design is left
OF_CORNERS = {*DRIVE_RANGES, *ENGAGED, *DRIFTS, *GRADIENTS}
OF_STRESS = {*STRESSES, *RANGES, *lasting((True, True, True))}


class Proof(NamedTuple):
    """What finite elements say of a design, quantities in their order (q,).

    predicted : of the model as it was corrected when it proposed the design.   bands : by meshes and by sampling.
    uncorrected : of the analytic model itself.   gap : largest difference of prediction and elements, over the sizes.
    corrections, shifts : that make the model agree here.   sampling : part of the bands that is by sampling.
    columns : by name, of the finite elements where they answer.   scattered : of stages whose necks scatter, if asked.
    """

    values: Array
    predicted: Array
    uncorrected: Array
    elements: Array
    bands: Array
    gap: float
    corrections: dict[str, Correction]
    columns: dict[str, float]
    shifts: Mapping[str, float]
    sampling: Array
    scattered: ScatteredStages | None

    def correcting(self, model: Model) -> Model:
        """The model that agrees here."""
        return model.changed(corrections=self.corrections, shifts=self.shifts)


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
    rounds, optima, near, guards = list[Proof](), list[BestDesign](), None, list[Array | None]([None])
    for _ in range(ROUNDS):
        model, best = _guarded(model, guards, elements.store, near, say)
        optima.append(best)
        rounds.append(proof(model, elements, best.values, say))
        near = best.values
        side = -1.0 if model.guard is None and rounds[1:] else 1.0
        if rounds[-1].gap <= accuracy and (best.merit >= WORST or _kept(model, rounds[-1], side)):
            return Mapped(rounds[-1].correcting(model), rounds, optima, True)
        bands = rounds[-1].bands[model.objectives :] / model.scales
        if guards[0] is not None:
            bands = np.maximum(bands, guards[0] - (accuracy if model.space.continuous.any() else 0.0))
        guards = [bands, None] if not model.space.continuous.any() else [bands + k * accuracy for k in ROOM] + [None]
        model = rounds[-1].correcting(model)
    return Mapped(model, rounds, optima, False)


def _guarded(
    model: Model, guards: Sequence[Array | None], store: Store, near: Array | None, say: Say
) -> tuple[Model, BestDesign]:
    """The optimum with the widest of `guards` that leave a design, the last being none, and the model with it.

    Where there is none without guards either, it is that with the widest.
    """
    seed, model = model.loaded.requirements.seed, model.changed(guard=guards[0])
    widest = searched(model, seed, near, store, say)
    if widest.merit < WORST or len(guards) == 1:
        return model, widest
    without = model.changed(guard=None)
    found = searched(without, seed, widest.values, store, say)
    if found.merit >= WORST:
        return model, widest
    for guard in guards[1:-1]:
        narrower = model.changed(guard=guard)
        best = searched(narrower, seed, found.values, store, say)
        if best.merit < WORST:
            return narrower, best
    return without, found


def _kept(model: Model, of: Proof, side: float = 1.0) -> bool:
    """Whether finite elements keep every end by the band where there is room for it between two, or (-1) within it."""
    low, high = model.changed(guard=None).ends
    q, band = of.elements[model.objectives :], side * np.minimum(of.bands[model.objectives :], model.room)
    return bool(np.all((q - band >= low) & (q + band <= high)))


def searched(model: Model, seed: int, near: Array | None, store: Store, say: Say) -> BestDesign:
    """`search.optimum`, from what is kept where the same was searched before. Raises BadInput: none has an answer."""

    def search() -> list[Any]:
        of = optimum(model, seed, near, say)
        if of.merit >= 100 * WORST:
            reason = model.found(of.values[None]).reason[0] or "its bodies cannot be drawn"
            raise BadInput(f"{place_of(model.loaded.path)}: no design of the free dimensions can be answered: {reason}")
        return [of.values.tolist(), of.relaxed.tolist(), [of.merit, of.relaxed_merit], [*map(list, of.history)]]

    asked = [content(model), seed, None if near is None else near.tolist()]
    values, relaxed, merits, history = store.found(asked, model.counts, search)
    return BestDesign(np.array(values), np.array(relaxed), merits[0], merits[1], [tuple(each) for each in history])


def content(model: Model) -> Any:
    """All that a search depends on, as plain data."""
    guard = None if model.guard is None else model.guard.tolist()
    state = [guard, sorted((k, list(v)) for k, v in model.corrections.items()), sorted(model.shifts.items())]
    ends = [sorted(model.tightened.items()), model.objective, sorted(model.bounded.items())]
    return [model.loaded.hash, state, ends, dict(versions_of(True))]


def proof(model: Model, elements: ProposedElements, values: Array, say: Say = lambda text: None) -> Proof:
    """Finite elements of a design, and the corrections that make the model agree with them there."""
    meshed, scattered = elements.of(values, say), scattered_stages(model.loaded, elements, values, say)
    model = model.changed(shifts={} if scattered is None else scattered.shifts)
    columns, _ = model.columns(values[None])
    own = {name: float(column[0]) for name, column in columns.items()}
    found = meshed.columns[-1] | ({} if scattered is None else scattered.columns[-1])
    corrections = {name: correction_of(own[name], value) for name, value in found.items() if name in own}
    elastic = quantities_of(model, own | found)
    by_mesh = np.array([quantities_of(model, own | each) for each in meshed.columns])
    bands = _bands(model, meshed.resolutions, by_mesh)
    sampling = np.zeros(len(elastic))
    if scattered is not None:
        if scattered.fits:
            of_meshes = np.array([quantities_of(model, own | found | each) for each in scattered.columns])
            bands = np.maximum(bands, [_band(SCATTER, each) for each in of_meshes.T])
        ends = [quantities_of(model, own | found | each) for each in scattered.ends]
        sampling = np.max(np.abs(np.array(ends) - elastic), axis=0)
    predicted = model.found(values[None]).quantities[0]
    size = np.maximum(np.abs(elastic), np.concatenate([np.zeros(model.objectives), model.scales]))
    off = np.abs(predicted - elastic)
    zero = np.maximum(np.abs(elastic), off) <= bands  # an objective that meshes do not tell from zero, nor the model
    zero[model.objectives :] = False
    gap = float(np.max(np.where(zero, 0.0, off) / np.where(size > 0, size, 1.0)))
    about = corrections, own | found, model.shifts, sampling, scattered
    return Proof(values, predicted, quantities_of(model, own), elastic, bands + sampling, gap, *about)


def quantities_of(model: Model, columns: Mapping[str, float]) -> Array:
    """Quantities (q,) of one design by its columns."""
    return np.asarray(model.quantities({name: np.array([value]) for name, value in columns.items()}, 1)[0])


def round_off(model: Model, of: Proof) -> Array:
    """By how much quantities (q,) move with the round-off of columns that symmetry can make zero."""
    noise = round_off_of({name: np.array([value]) for name, value in of.columns.items()})
    moved = {name: of.columns[name] + float(size.max()) for name, size in noise.items() if name in of.columns}
    return np.abs(quantities_of(model, of.columns | moved) - of.elements)


def _bands(model: Model, resolutions: tuple[int, ...], values: Array) -> Array:
    """Half-widths (q,) by meshes of quantities (levels, q)."""
    of = model.loaded.requirements
    each = zip(of.quantities, values.T, strict=True)
    return np.array([quantity_band(of.names_of(text), resolutions, levels) for text, levels in each])


def quantity_band(columns: frozenset[str], resolutions: tuple[int, ...], values: Array) -> float:
    """Half-width by meshes of a quantity (levels,), coarse to fine: the largest by the columns that it uses."""
    bands = [_band(resolutions, values)]
    if len(resolutions) > 2:  # two in three dimensions
        ways = ((OF_CORNERS, corner_bands), (OF_STRESS, stress_bands))
        bands += [float(band(np.array(resolutions, dtype=float), values)) for own, band in ways if columns & own]
    return max(bands)


def _band(resolutions: tuple[int, ...], values: Array) -> float:
    found = np.array(resolutions, dtype=float)
    return mesh_band(found, values) if np.ptp(values) > 0 else 0.0
