"""Finite-element verification of designs, and output space mapping from the analytic model to finite elements.

Space mapping: Bandler et al., IEEE Trans. Microwave Theory Tech. 52 (2004) 337-361.
"""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import Array
from flexfem.design.model import MISSED, REFUSED_MERIT, Correction, Model, Say, correction_of, silent
from flexfem.design.requirements import SCATTERED, LoadedRequirements
from flexfem.design.scatter import CouplingQuantiles, coupling_quantiles
from flexfem.design.search import BestDesign, optimum
from flexfem.files.refusals import place_of
from flexfem.files.writing import digest, write_atomically
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.bands import corner_bands, levels, mesh_band, stress_bands
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS
from flexfem.study import columns as outputs
from flexfem.study.answer import extra_numbers, solved_values
from flexfem.study.loaded import LoadedStudy, designs_of, plate_of, stage_of
from flexfem.study.workers import Failure, Workers, versions_of

SOLID = ((4, 2), (6, 3))  # triangles across a neck and layers, coarse to fine
SCATTER = (4, 6)  # triangles across a neck for stages with scattered necks
BY_ELEMENTS, IN_THREE = "finite elements", "finite elements in three dimensions"  # keys of the counts
MODEL, BY_MESH = re.compile(rf"\.{ANALYTIC}(?=\.|$)"), f".{ELEMENTS.replace(' ', '_')}"  # in the path of a number
LIMIT = 600.0  # s for one mesh
LOCAL = 0.01  # gap between the models below which the next search is local to the last design
ROUNDS = 8  # at most
ROOM = (1.0, 0.1)  # parts of the accuracy added to the bands in the guards, tried in turn
ROUND_OFF_RATIO = 1e4  # round-off of finite elements over that of the model
CORNER_COLUMNS = {*outputs.DRIVE_RANGES, *outputs.ENGAGED, *outputs.DRIFTS, *outputs.GRADIENTS}
STRESS_COLUMNS = {*outputs.STRESSES, *outputs.RANGES, *outputs.life_columns((True, True, True))}

Row: TypeAlias = list[float] | Failure  # outputs of a study


class Store:
    """Cache of results as plain data by their inputs: one file each in a folder, so that an interrupted run can resume.

    Without a folder it is in memory. The versions of the code and its libraries are part of the inputs.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder, self._results = folder, dict[str, Any]()

    def get(self, inputs: Any) -> Any:
        """Return the stored result of some inputs, or None."""
        name = _name_of(inputs)
        if name not in self._results and self.folder is not None:
            with suppress(OSError, ValueError):
                self._results[name] = json.loads((self.folder / name).read_text())
        return self._results.get(name)

    def put(self, inputs: Any, result: Any) -> None:
        """Store a result; a folder that refuses files is reported when the final results are written."""
        name, content = _name_of(inputs), json.dumps(result).encode()
        self._results[name] = result
        if self.folder is not None:
            with suppress(BadInput):
                write_atomically(self.folder / name, lambda file: file.write(content), again=True)

    def cached(self, inputs: Any, counts: Counter[str], search: Callable[[], Any]) -> Any:
        """Return the result of `search`, stored or new; `counts` grow as in the search that made it."""
        if (stored := self.get(inputs)) is not None:
            counts.update(stored[1])
            return stored[0]
        before = counts.copy()
        found = search()
        self.put(inputs, [found, dict(counts - before)])
        return found

    def remove(self) -> None:
        """Remove the folder, after the final results are written."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def _name_of(inputs: Any) -> str:
    return f"{digest([inputs, dict(versions_of())])[:32]}.json"


def solved(loaded: LoadedStudy, stage: Stage | Mechanism) -> Row:
    """Return the outputs of a study by finite elements; of a mechanism, with their bands after them."""
    try:
        if isinstance(stage, Mechanism):
            return [float(each) for each in extra_numbers(loaded, stage).T.flat]
        check_feasible(stage)
        return [float(value) for value in solved_values(stage, loaded)]
    except (BadInput, ComputationFailed) as error:
        return Failure("failed", str(error))


@dataclass
class ElementSolver:
    """Finite-element solver of designs, in `workers` or else serially in this process."""

    loaded: LoadedRequirements
    counts: Counter[str]
    workers: Workers | None = None
    store: Store = field(default_factory=Store)
    say: Say = silent
    _counted: set[str] = field(default_factory=set, init=False)

    @property
    def meshes(self) -> tuple[tuple[int, int], ...]:
        """Triangles across every neck, and layers, of each mesh, coarse to fine; the finest of a mechanism."""
        resolution = self.loaded.requirements.resolution
        if isinstance(self.loaded.base, Mechanism):  # its questions have bands
            return ((resolution, 2),)
        return SOLID if self.loaded.solid else tuple((level, 2) for level in levels(resolution))

    def solve(self, values: Array) -> list[dict[str, float]]:
        """Return the columns of a design (d,) by name on each mesh. Raises ComputationFailed."""
        return [dict(zip(self.loaded.study.outputs, row, strict=False)) for row in self._rows(values)]

    def bands(self, values: Array) -> dict[str, float]:
        """Return the bands of the columns of a mechanism by name, where a column has one; none of a stage."""
        names = self.loaded.study.outputs if isinstance(self.loaded.base, Mechanism) else ()
        bands = zip(names, self._rows(values)[0][len(names) :], strict=True) if names else ()
        return {name: band for name, band in bands if np.isfinite(band)}

    def _rows(self, values: Array) -> list[list[float]]:
        """Return the rows of a design (d,) on each mesh."""
        stage = plate_of(self.loaded.study, values)
        stage = stage.replace(model="plane_stress") if self.loaded.solid else stage
        return self._solved([(self._study(*mesh), stage) for mesh in self.meshes])

    def solve_scattered(self, values: Array, off: Array) -> list[Array]:
        """Return the couplings (3, stages) of a design with neck deviations `off` (stages, 3, 3), mm, on each mesh."""
        stage, couplings = stage_of(self.loaded.study, values), list[Array]()
        hinges = [(k, n, (k + 1, name)) for k in range(3) for n, name in enumerate(HINGE_NAMES)]
        overrides = [{at: {"neck": stage.hinge(*at).neck + float(d[k, n])} for k, n, at in hinges} for d in off]
        for resolution in SCATTER:
            study = _with_changes(self._study(resolution, 2), dict.fromkeys(("drive", "frequencies", "life", "drift")))
            rows = np.array(self._solved([(study, stage.replace(override=override)) for override in overrides]))
            couplings.append(rows[:, [study.outputs.index(name) for name in outputs.COUPLINGS]].T)
        return couplings

    def _study(self, resolution: int, layers: int) -> LoadedStudy:
        """Return the study that solves a stage on one mesh."""
        required, solid = self.loaded.requirements, self.loaded.solid
        model = "three_dimensional" if solid else "verify" if required.used & {*outputs.ERRORS} else "fe"
        changes: dict[str, Any] = {"model": model, "resolution": resolution, "layers": layers, "bands": False}
        changes |= {"links": False, "mobility": None, "formula": required.paper_formula}
        changes |= {"time_limit": LIMIT, "check": None}
        changes["ask"] = tuple(MODEL.sub(BY_MESH, path) for path in required.ask)
        if solid:
            drive = required.drive if required.drive is not None and required.drive.stroke_um is not None else None
            drive = drive and drive.model_copy(update={"actuators": False})
            changes |= {"frequencies": None, "life": None, "drift": None, "drive": drive}
        return _with_changes(self.loaded.study, changes)

    def _solved(self, tasks: list[tuple[LoadedStudy, Stage | Mechanism]]) -> list[list[float]]:
        """Return the rows of outputs of the tasks; tasks with a stored result are not solved again."""
        inputs = {id(task): [task[0].study.model_dump(mode="json"), task[1].to_toml()] for task in tasks}
        self._counted |= {digest(plain) for plain in inputs.values()}
        self.counts[IN_THREE if self.loaded.solid else BY_ELEMENTS] = len(self._counted)
        waiting = [task for task in tasks if self.store.get(inputs[id(task)]) is None]
        queue = iter(waiting)
        rows: Iterable[tuple[Any, Row]] = ((task, solved(*task)) for task in waiting)
        if self.workers is not None:
            rows = self.workers.results(solved, lambda: next(queue, None), lambda task: LIMIT)
        for done, (task, row) in enumerate(rows, 1):
            if isinstance(row, Failure):
                raise ComputationFailed(f"finite elements of a proposed design: {row.reason}")
            self.store.put(inputs[id(task)], row)
            self.say(f"finite elements: {done} of {len(waiting)} solutions")
        return [self.store.get(plain) for plain in inputs.values()]


def _with_changes(study: LoadedStudy, changes: dict[str, Any]) -> LoadedStudy:
    return replace(study, study=study.study.model_copy(update=changes))


class Proof(NamedTuple):
    """Quantities (q,) of a design by finite elements and by the model, and the corrections that make both agree.

    `predicted` is by the model with the corrections of the search, `uncorrected` without any. `bands` combine meshes
    and `sampling`. A quantity below `round_off` is zero by symmetry. `gap` is the largest difference between prediction
    and finite elements over the sizes. With `corrections` the model agrees with finite elements at this design.
    `columns` are by finite elements where available.
    """

    values: Array
    predicted: Array
    uncorrected: Array
    elements: Array
    bands: Array
    sampling: Array
    round_off: Array
    gap: float
    corrections: Mapping[str, Correction]
    columns: dict[str, float]
    scattered: CouplingQuantiles | None


class Proposal(NamedTuple):
    """One round of space mapping: the best design, the model that proposed it, and its finite-element verification."""

    proposing: Model
    best: BestDesign
    proof: Proof

    @property
    def model(self) -> Model:
        """The model with the corrections that make it agree with finite elements at the design."""
        return replace(self.proposing, corrections=self.proof.corrections)


def space_mapping(model: Model, solver: ElementSolver) -> tuple[list[Proposal], bool]:
    """Search, solve and correct until model and finite elements agree at the optimum and all ends are kept there.

    Returns all rounds, and whether they converged. Requirements are tightened by the bands, and with continuous
    dimensions by the accuracy, as far as feasible designs remain.
    """
    accuracy, stepped = model.loaded.requirements.accuracy_percent / 100, not model.space.continuous.any()
    room, unguarded = (0.0,) if stepped else ROOM, np.zeros(len(model.sizes))
    rounds, guards, bands = list[Proposal](), [unguarded], unguarded
    near, everywhere = None, True
    for _ in range(ROUNDS):
        model, best = _guarded(model, guards, solver.store, near, everywhere)
        last, near = proof(model, solver, best.values), best.values
        side = -1.0 if rounds and not np.any(model.guard) else 1.0
        rounds.append(Proposal(model, best, last))
        everywhere = last.gap > LOCAL or best.merit >= MISSED
        if last.gap <= accuracy and (best.merit >= MISSED or keeps_ends(model, last, side)):
            return rounds, True
        bands = np.maximum(bands, last.bands[model.objectives :] / model.sizes)
        guards = [*(bands + k * accuracy for k in room), unguarded]
        model = rounds[-1].model
    return rounds, False


def _guarded(
    model: Model, guards: list[Array], store: Store, near: Array | None, everywhere: bool
) -> tuple[Model, BestDesign]:
    """Return the optimum with the first of `guards` that leaves feasible designs, or else the first, and its model."""
    optima = list[tuple[Model, BestDesign]]()
    for guard in guards:
        guarded = replace(model, guard=guard)
        optima.append((guarded, searched(guarded, near, store, everywhere)))
        if optima[-1][1].merit < MISSED:
            return optima[-1]
        near = optima[-1][1].values
    return optima[0]


def keeps_ends(model: Model, verified: Proof, side: float = 1.0) -> bool:
    """Return whether finite elements keep every end by the band (limited to the room), or for -1 within the band."""
    q, band = verified.elements[model.objectives :], side * np.minimum(verified.bands[model.objectives :], model.room)
    return bool(np.all((q - band >= model.low) & (q + band <= model.high)))


def searched(model: Model, near: Array | None, store: Store, everywhere: bool = True) -> BestDesign:
    """Return `search.optimum`, from the store if possible. Raises BadInput when no design has a solution."""

    def search() -> list[Any]:
        best = optimum(model, near, everywhere)
        if best.merit >= REFUSED_MERIT:
            finite = np.isfinite(model.evaluate(best.values[None])).all()
            why = "its bodies cannot be drawn" if finite else "a quantity without a finite value"
            reason = model.columns(best.values[None])[1][0] or why
            raise BadInput(f"{place_of(model.loaded.path)}: no design of the free dimensions has a result: {reason}")
        return [best.values.tolist(), best.relaxed.tolist(), best.merit, [list(step) for step in best.history]]

    inputs = [inputs_of(model), None if near is None else near.tolist(), everywhere]
    values, relaxed, merit, history = store.cached(inputs, model.counts, search)
    return BestDesign(np.array(values), np.array(relaxed), merit, [tuple(step) for step in history])


def inputs_of(model: Model) -> list[Any]:
    """Return the inputs of a search besides the code, as plain data."""
    files = [model.loaded.requirements.model_dump(mode="json"), model.loaded.base.to_toml()]
    corrections = sorted((name, list(correction)) for name, correction in model.corrections.items())
    return [files, np.asarray(model.guard).tolist(), corrections, model.objective, sorted(model.bounds.items())]


def proof(model: Model, solver: ElementSolver, values: Array) -> Proof:
    """Verify a design (d,) by finite elements, and find the corrections that make the model agree with them there."""
    by_mesh, scattered = solver.solve(values), verified_quantiles(model, solver, values)
    analytic = {name: float(column[0]) for name, column in model.columns(values[None])[0].items()}
    solved_columns = by_mesh[-1] | ({} if scattered is None else named(scattered.elements[-1]))
    columns = analytic | solved_columns

    def quantities(*replaced: dict[str, float]) -> Array:
        """Return the quantities (q, sets) with some columns replaced in each set."""
        sets = [columns | changed for changed in replaced]
        return model.quantities({name: np.array([each[name] for each in sets]) for name in columns}).T

    resolutions = np.array([resolution for resolution, _ in solver.meshes], float)
    required = model.loaded.requirements
    (q,) = quantities({}).T
    if widths := solver.bands(values):
        changed = quantities(*({name: columns[name] + band} for name, band in widths.items()))
        bands = np.sum(np.abs(changed - q[:, None]), axis=1)
    else:
        rows = zip(required.quantities, quantities(*by_mesh), strict=True)
        bands = np.array([quantity_band(required.names_of(text), resolutions, row) for text, row in rows])
    vanishing = outputs.round_off_of({name: np.array(value) for name, value in columns.items()})
    perturbed = {name: columns[name] + float(step) for name, step in vanishing.items() if name in columns}
    round_off = np.abs(quantities(perturbed)[:, 0] - q)
    sampling = np.zeros(len(q))
    if scattered is not None:
        half = scattered.half_widths
        ends = quantities(*(named(scattered.elements[-1] + side * half) for side in (-1.0, 1.0)))
        sampling = np.max(np.abs(ends - q[:, None]), axis=1)
        if len(scattered.factors) > 1:
            rows_of_meshes = quantities(*map(named, scattered.elements))
            bands = np.maximum(bands, [mesh_band(np.array(SCATTER, dtype=float), row, 0.0) for row in rows_of_meshes])
    bands = np.maximum(bands, ROUND_OFF_RATIO * round_off)
    predicted = model.evaluate(values[None])[0]
    size = np.maximum(np.abs(q), np.concatenate([np.zeros(model.objectives), model.sizes]))
    difference = np.abs(predicted - q)
    zero = np.maximum(np.abs(q), difference) <= bands  # objectives that neither meshes nor model distinguish from zero
    zero[model.objectives :] = False
    return Proof(
        values=values,
        predicted=predicted,
        uncorrected=quantities(analytic if scattered is None else analytic | named(scattered.others))[:, 0],
        elements=q,
        bands=bands + sampling,
        sampling=sampling,
        round_off=round_off,
        gap=float(np.max(np.where(zero, 0.0, difference) / np.where(size > 0, size, 1.0))),
        corrections={n: correction_of(analytic[n], value) for n, value in solved_columns.items() if n in analytic},
        columns=columns,
        scattered=scattered,
    )


def verified_quantiles(model: Model, solver: ElementSolver, values: Array) -> CouplingQuantiles | None:
    """Return the coupling quantiles of a design (d,), None if they are not requested. Raises ComputationFailed."""
    scatter, required = model.scatter, model.loaded.requirements
    if scatter is None or required.tolerance is None:
        return None
    design = designs_of(model.loaded.study, values[None]), required.formula, required.mobility
    others = scatter.couplings(*design, scatter.others)
    model.counts["analytic with scattered necks"] += others.shape[-1]
    checked = 0 if model.loaded.solid else required.tolerance.checked
    by_mesh = solver.solve_scattered(values, scatter.others[:checked]) if checked else []
    return coupling_quantiles(scatter.quantiles(*design)[0], others, by_mesh)


def named(couplings: Array) -> dict[str, float]:
    """Return couplings under scatter (4,) by their columns."""
    return dict(zip(SCATTERED, map(float, couplings), strict=True))


def quantity_band(columns: frozenset[str], resolutions: Array, values: Array) -> float:
    """Return the mesh band of a quantity (levels,), coarse to fine: the largest over the columns that it uses."""
    bands = [mesh_band(resolutions, values, 0.0)]
    if len(resolutions) > 2:  # there are two in three dimensions
        slow = ((CORNER_COLUMNS, corner_bands), (STRESS_COLUMNS, stress_bands))
        bands += [float(band(resolutions, values)) for converging, band in slow if columns & converging]
    return max(bands)
