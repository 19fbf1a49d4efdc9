"""Finite elements of designs, and the loop of search, finite elements and correction until both models agree.

The corrections are output space mapping: Bandler et al., IEEE Trans. Microwave Theory Tech. 52 (2004) 337-361.
"""

from __future__ import annotations

import json
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
from flexfem.design.scatter import ScatteredStages, stated
from flexfem.design.search import BestDesign, optimum
from flexfem.files.refusals import place_of
from flexfem.files.writing import digest, write_atomically
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.bands import corner_bands, levels, mesh_band, stress_bands
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study import columns as outputs
from flexfem.study.answer import solved_values
from flexfem.study.loaded import LoadedStudy, designs_of, stage_of
from flexfem.study.workers import Failure, Workers, versions_of

SOLID = ((4, 2), (6, 3))  # triangles across a neck and layers, coarse to fine
SCATTER = (4, 6)  # triangles across a neck where nine necks scatter
BY_ELEMENTS, IN_THREE = "finite elements", "finite elements in three dimensions"  # what solutions count as
LIMIT = 600.0  # s for one mesh
LOCAL = 0.01  # gap of both models below which the next search is beside the last design alone
ROUNDS = 8  # at most
ROOM = (1.0, 0.1)  # of the accuracy, that guards leave beside the bands, while any design is left
OF_ELEMENTS = 1e4  # round-off of finite elements over that of the model
OF_CORNERS = {*outputs.DRIVE_RANGES, *outputs.ENGAGED, *outputs.DRIFTS, *outputs.GRADIENTS}
OF_STRESS = {*outputs.STRESSES, *outputs.RANGES, *outputs.life_columns((True, True, True))}

Row: TypeAlias = list[float] | Failure  # outputs of a study


class Store:
    """What is found, plain data by its question: a file each in a folder, so that a run that was stopped goes on.

    Without a folder it is kept in memory. The versions of all that decides an answer are part of its question.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder, self._found = folder, dict[str, Any]()

    def answer(self, question: Any) -> Any:
        """What is known, None else."""
        name = _name_of(question)
        if name not in self._found and self.folder is not None:
            with suppress(OSError, ValueError):
                self._found[name] = json.loads((self.folder / name).read_text())
        return self._found.get(name)

    def keep(self, question: Any, answer: Any) -> None:
        """Add an answer; a folder that takes no file is told of when the results are written."""
        name, content = _name_of(question), json.dumps(answer).encode()
        self._found[name] = answer
        if self.folder is not None:
            with suppress(BadInput):
                write_atomically(self.folder / name, lambda file: file.write(content), again=True)

    def searched(self, question: Any, counts: Counter[str], search: Callable[[], Any]) -> Any:
        """What `search`, or one before with this question, found; `counts` grow as in that search."""
        if (known := self.answer(question)) is not None:
            counts.update(known[1])
            return known[0]
        before = counts.copy()
        found = search()
        self.keep(question, [found, dict(counts - before)])
        return found

    def forget(self) -> None:
        """Remove the folder: the results are written."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def _name_of(question: Any) -> str:
    return f"{digest([question, dict(versions_of(True))])[:32]}.json"


def solved(loaded: LoadedStudy, stage: Stage) -> Row:
    """The outputs of a study for one stage, by finite elements."""
    try:
        check_feasible(stage)
        return [float(value) for value in solved_values(stage, loaded)]
    except (BadInput, ComputationFailed) as error:
        return Failure("failed", str(error))


@dataclass
class ProposedElements:
    """Finite elements of designs; without workers one after the other in this process."""

    loaded: LoadedRequirements
    counts: Counter[str]
    workers: Workers | None = None
    store: Store = field(default_factory=Store)
    say: Say = silent
    _counted: set[str] = field(default_factory=set, init=False)

    @property
    def meshes(self) -> tuple[tuple[int, int], ...]:
        """Triangles across every neck and layers, coarse to fine."""
        of = self.loaded
        return SOLID if of.solid else tuple((level, 2) for level in levels(of.requirements.resolution))

    def of(self, values: Array) -> list[dict[str, float]]:
        """Columns of a design (d,) by name on every mesh. Raises ComputationFailed."""
        stage = stage_of(self.loaded.study, values)
        stage = stage.replace(model="plane_stress") if self.loaded.solid else stage
        studies = [self._study(*mesh) for mesh in self.meshes]
        rows = self._solved([(study, stage) for study in studies])
        return [dict(zip(study.outputs, row, strict=True)) for study, row in zip(studies, rows, strict=True)]

    def scattered(self, values: Array, off: Array) -> list[Array]:
        """Couplings (3, stages) of a design whose necks deviate by `off` (stages, 3, 3), mm, on each mesh."""
        stage, found = stage_of(self.loaded.study, values), list[Array]()
        places = [(k, n, (k + 1, name)) for k in range(3) for n, name in enumerate(HINGE_NAMES)]
        necks = [{at: {"neck": stage.hinge(*at).neck + float(each[k, n])} for k, n, at in places} for each in off]
        for resolution in SCATTER:
            study = _with_changes(self._study(resolution, 2), dict.fromkeys(("drive", "frequencies", "life", "drift")))
            rows = np.array(self._solved([(study, stage.replace(override=each)) for each in necks]))
            found.append(rows[:, [study.outputs.index(name) for name in outputs.COUPLINGS]].T)
        return found

    def _study(self, resolution: int, layers: int) -> LoadedStudy:
        """What is asked of a stage on one mesh."""
        of, study = self.loaded.requirements, self.loaded.study
        model = "three_dimensional" if self.loaded.solid else "verify" if of.used & {*outputs.ERRORS} else "fe"
        changes: dict[str, Any] = {"model": model, "resolution": resolution, "layers": layers, "bands": False}
        changes |= {"links": False, "mobility": None, "formula": of.paper_formula, "time_limit": LIMIT, "check": None}
        if self.loaded.solid:
            drive = of.drive if of.drive is not None and of.drive.stroke_um is not None else None
            drive = drive and drive.model_copy(update={"actuators": False})
            changes |= {"frequencies": None, "life": None, "drift": None, "drive": drive}
        return _with_changes(study, changes)

    def _solved(self, tasks: list[tuple[LoadedStudy, Stage]]) -> list[list[float]]:
        """Rows of outputs, in the order of the tasks; what is known is not solved again."""
        questions = {id(task): _inputs_of(task) for task in tasks}
        self._counted |= {digest(question) for question in questions.values()}
        self.counts[IN_THREE if self.loaded.solid else BY_ELEMENTS] = len(self._counted)
        waiting = [task for task in tasks if self.store.answer(questions[id(task)]) is None]
        ahead = iter(waiting)
        rows: Iterable[tuple[Any, Row]] = ((task, solved(*task)) for task in waiting)
        if self.workers is not None:
            rows = self.workers.results(solved, lambda: next(ahead, None), lambda task: LIMIT)
        for done, (task, row) in enumerate(rows, 1):
            if isinstance(row, Failure):
                raise ComputationFailed(f"finite elements of a proposed design: {row.reason}")
            self.store.keep(questions[id(task)], row)
            self.say(f"finite elements: {done} of {len(waiting)} solutions")
        return [self.store.answer(question) for question in questions.values()]


def _with_changes(study: LoadedStudy, changes: dict[str, Any]) -> LoadedStudy:
    return replace(study, study=study.study.model_copy(update=changes))


def _inputs_of(task: tuple[LoadedStudy, Stage]) -> list[Any]:
    """A study and the stage that it is asked of, as plain data."""
    study, stage = task
    return [study.study.model_dump(mode="json"), stage.model_dump(mode="json")]


class Proof(NamedTuple):
    """What finite elements say of a design, quantities in their order (q,).

    `predicted` is by the model as it was corrected when it proposed the design, `uncorrected` by the analytic model
    itself; `bands` are by meshes and `sampling`; below `round_off` a quantity is zero by symmetry. `gap` is the largest
    difference of prediction and finite elements over the sizes; with `corrections` the model agrees here. `columns` are
    those of finite elements if any.
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
    scattered: ScatteredStages | None


class Proposal(NamedTuple):
    """One round of the loop: the best design, the model that proposed it, and what finite elements say of it."""

    proposing: Model
    best: BestDesign
    proof: Proof

    @property
    def model(self) -> Model:
        """The model that agrees with finite elements at the design."""
        return replace(self.proposing, corrections=self.proof.corrections)


def mapped(model: Model, elements: ProposedElements) -> tuple[list[Proposal], bool]:
    """Search, solve, correct, until the model agrees with finite elements at its optimum and all ends are kept there.

    Returns every round, and whether they came to agree. Requirements are tightened by the bands, and where dimensions
    are continuous by the accuracy, if any design is left.
    """
    accuracy, steps_alone = model.loaded.requirements.accuracy_percent / 100, not model.space.continuous.any()
    room, unguarded = (0.0,) if steps_alone else ROOM, np.zeros(len(model.sizes))
    rounds, guards, bands = list[Proposal](), [unguarded], unguarded
    near, everywhere = None, True
    for _ in range(ROUNDS):
        model, best = _guarded(model, guards, elements.store, near, everywhere)
        last, near = proof(model, elements, best.values), best.values
        side = -1.0 if rounds and not np.any(model.guard) else 1.0
        rounds.append(Proposal(model, best, last))
        everywhere = last.gap > LOCAL or best.merit >= MISSED
        if last.gap <= accuracy and (best.merit >= MISSED or is_kept(model, last, side)):
            return rounds, True
        bands = np.maximum(bands, last.bands[model.objectives :] / model.sizes)
        guards = [*(bands + k * accuracy for k in room), unguarded]
        model = rounds[-1].model
    return rounds, False


def _guarded(
    model: Model, guards: list[Array], store: Store, near: Array | None, everywhere: bool
) -> tuple[Model, BestDesign]:
    """The optimum with the widest of `guards` that leave a design, with the first where none does, and its model."""
    tried = list[tuple[Model, BestDesign]]()
    for guard in guards:
        guarded = replace(model, guard=guard)
        tried.append((guarded, searched(guarded, near, store, everywhere)))
        if tried[-1][1].merit < MISSED:
            return tried[-1]
        near = tried[-1][1].values
    return tried[0]


def is_kept(model: Model, of: Proof, side: float = 1.0) -> bool:
    """Whether finite elements keep every end by the band where there is room for it between two, or (-1) within it."""
    q, band = of.elements[model.objectives :], side * np.minimum(of.bands[model.objectives :], model.room)
    return bool(np.all((q - band >= model.low) & (q + band <= model.high)))


def searched(model: Model, near: Array | None, store: Store, everywhere: bool = True) -> BestDesign:
    """`search.optimum`, from what is kept where the same was searched before. Raises BadInput: none has an answer."""

    def search() -> list[Any]:
        of = optimum(model, near, everywhere)
        if of.merit >= REFUSED_MERIT:
            finite = np.isfinite(model.found(of.values[None])).all()
            why = "its bodies cannot be drawn" if finite else "a quantity without a finite value"
            reason = model.columns(of.values[None])[1][0] or why
            raise BadInput(f"{place_of(model.loaded.path)}: no design of the free dimensions can be answered: {reason}")
        return [of.values.tolist(), of.relaxed.tolist(), of.merit, [list(each) for each in of.history]]

    question = [question_of(model), None if near is None else near.tolist(), everywhere]
    values, relaxed, merit, history = store.searched(question, model.counts, search)
    return BestDesign(np.array(values), np.array(relaxed), merit, [tuple(each) for each in history])


def question_of(model: Model) -> list[Any]:
    """All that a search depends on besides the code, as plain data."""
    files = [file.model_dump(mode="json") for file in (model.loaded.requirements, model.loaded.stage)]
    corrections = sorted((name, list(each)) for name, each in model.corrections.items())
    return [files, np.asarray(model.guard).tolist(), corrections, model.objective, sorted(model.bounds.items())]


def proof(model: Model, elements: ProposedElements, values: Array) -> Proof:
    """Finite elements of a design (d,), and the corrections that make the model agree with them there."""
    meshed, scattered = elements.of(values), scattered_stages(model, elements, values)
    own = {name: float(column[0]) for name, column in model.columns(values[None])[0].items()}
    found = meshed[-1] | ({} if scattered is None else named(scattered.elements[-1]))

    def quantities(*columns: dict[str, float]) -> Array:
        """Quantities (q, sets) by columns that take the place of those found."""
        every = [own | found | each for each in columns]
        return model.quantities({name: np.array([each[name] for each in every]) for name in every[0]}).T

    resolutions, of = np.array([resolution for resolution, _ in elements.meshes], float), model.loaded.requirements
    by_mesh = zip(of.quantities, quantities(*meshed), strict=True)
    bands = np.array([quantity_band(of.names_of(text), resolutions, each) for text, each in by_mesh])
    (q,) = quantities({}).T
    columns = own | found
    vanishing = outputs.round_off_of({name: np.array(value) for name, value in columns.items()})
    moved = {name: columns[name] + float(step) for name, step in vanishing.items() if name in columns}
    round_off = np.abs(quantities(moved)[:, 0] - q)
    sampling = np.zeros(len(q))
    if scattered is not None:
        half = scattered.half_widths
        ends = quantities(*(named(scattered.elements[-1] + side * half) for side in (-1.0, 1.0)))
        sampling = np.max(np.abs(ends - q[:, None]), axis=1)
        if len(scattered.factors) > 1:
            scattering = quantities(*map(named, scattered.elements))
            bands = np.maximum(bands, [mesh_band(np.array(SCATTER, dtype=float), each, 0.0) for each in scattering])
    bands = np.maximum(bands, OF_ELEMENTS * round_off)
    predicted = model.found(values[None])[0]
    size = np.maximum(np.abs(q), np.concatenate([np.zeros(model.objectives), model.sizes]))
    off = np.abs(predicted - q)
    zero = np.maximum(np.abs(q), off) <= bands  # an objective that meshes do not tell from zero, nor the model
    zero[model.objectives :] = False
    return Proof(
        values=values,
        predicted=predicted,
        uncorrected=quantities(own if scattered is None else own | named(scattered.others))[:, 0],
        elements=q,
        bands=bands + sampling,
        sampling=sampling,
        round_off=round_off,
        gap=float(np.max(np.where(zero, 0.0, off) / np.where(size > 0, size, 1.0))),
        corrections={name: correction_of(own[name], value) for name, value in found.items() if name in own},
        columns=columns,
        scattered=scattered,
    )


def scattered_stages(model: Model, elements: ProposedElements, values: Array) -> ScatteredStages | None:
    """Couplings of a design (d,) whose nine necks scatter; None where that is not asked. Raises ComputationFailed."""
    scatter, of = model.scatter, model.loaded.requirements
    if scatter is None or of.tolerance is None:
        return None
    about = designs_of(model.loaded.study, values[None]), of.formula, of.mobility
    others = scatter.couplings(*about, scatter.others)
    model.counts["analytic with scattered necks"] += others.shape[-1]
    checked = 0 if model.loaded.solid else of.tolerance.checked
    meshes = elements.scattered(values, scatter.others[:checked]) if checked else []
    return stated(scatter.quantiles(*about)[0], others, meshes)


def named(couplings: Array) -> dict[str, float]:
    """Couplings under scatter (4,) by their columns."""
    return dict(zip(SCATTERED, map(float, couplings), strict=True))


def quantity_band(columns: frozenset[str], resolutions: Array, values: Array) -> float:
    """Half-width by meshes of a quantity (levels,), coarse to fine: the largest by the columns that it uses."""
    bands = [mesh_band(resolutions, values, 0.0)]
    if len(resolutions) > 2:  # two in three dimensions
        ways = ((OF_CORNERS, corner_bands), (OF_STRESS, stress_bands))
        bands += [float(band(resolutions, values)) for own, band in ways if columns & own]
    return max(bands)
