"""Finite-element verification of designs, and output space mapping from the analytic model to
finite elements.

Space mapping: Bandler et al., IEEE Trans. Microwave Theory Tech. 52 (2004) 337-361.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import ROUND_OFF, Array
from flexfem.design.kind import kind_of
from flexfem.design.model import MISSED, Correction, Model, correction_of, silent
from flexfem.design.requirements import SCATTERED, LoadedRequirements
from flexfem.design.scatter import CouplingQuantiles, named
from flexfem.design.search import BestDesign, optimum, share_of_search
from flexfem.design.timing import CHECK, SEARCH, Timing
from flexfem.files.writing import digest, write_atomically
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate_checks import triangles_needed
from flexfem.questions.bands import corner_bands, levels, mesh_band, stress_bands
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, Progress
from flexfem.results import SOLID as SOLID_ELEMENTS
from flexfem.study import columns as outputs
from flexfem.study.loaded import LoadedStudy, mechanism_of
from flexfem.study.tables import DriveQuestion
from flexfem.study.workers import ExecutorWorkers, Failure, Workers, versions_of

SOLID = ((4, 2), (6, 3))  # triangles across a neck and layers, coarse to fine
SCATTER = (4, 6)  # triangles across a neck for stages with scattered necks
BAND = "band of {}"  # name of the band of a column
BY_ELEMENTS = "finite elements"
IN_THREE = "finite elements in three dimensions"  # keys of the counts
MODEL = re.compile(rf"\.{ANALYTIC}(?=\.|$)")  # in the path of a number
LIMIT = 600.0  # s for one mesh
# of a check of stiffness and modes on one processor, for a first guess of its time
SECONDS_PER_TRIANGLE = 4e-4
LOCAL = 0.01  # gap between the models below which the next search is local to the last design
ROUNDS = 8  # at most
ROOM = (1.0, 0.1)  # parts of the accuracy added to the bands in the guards, tried in turn
ROUND_OFF_RATIO = 1e4  # round-off of finite elements over that of the model
CORNER_COLUMNS = {*outputs.DRIVE_RANGES, *outputs.ENGAGED, *outputs.DRIFTS, *outputs.GRADIENTS}
STRESS_COLUMNS = {*outputs.STRESSES, *outputs.RANGES, *outputs.LIVES}

Row: TypeAlias = list[float] | Failure  # outputs of a study


def solved(loaded: LoadedStudy, mechanism: Mechanism) -> Row:
    """Return the outputs of a study by finite elements, with bands after them where they have
    some.
    """
    try:
        mechanism.check()
        return loaded.family.with_bands(mechanism)
    except (BadInput, ComputationFailed) as error:
        return Failure("failed", str(error))


@dataclass
class ElementSolver:
    """Finite-element solver of designs, in `workers` or else serially in this process.

    Solutions are kept in memory and, in files of a `folder`, for a run that was interrupted, with
    the versions of the code and its libraries."""

    loaded: LoadedRequirements
    counts: Counter[str]
    workers: Workers | ExecutorWorkers | None = None
    folder: Path | None = None
    say: Progress = silent
    _known: dict[str, list[float]] = field(default_factory=dict, init=False)

    @property
    def meshes(self) -> tuple[tuple[int, int], ...]:
        """Triangles across every neck, and layers, of each mesh, coarse to fine; only the finest
        where its numbers have bands.
        """
        resolution = self.loaded.requirements.resolution
        if self.loaded.family.has_bands:
            return ((resolution, 2),)
        return SOLID if self.loaded.solid else tuple((level, 2) for level in levels(resolution))

    def solve(self, values: Array) -> list[dict[str, float]]:
        """Return the columns of a design (d,) by name on each mesh. Raises ComputationFailed."""
        mechanism = mechanism_of(self.loaded, values)
        if self.loaded.solid:
            mechanism = mechanism.replace(model="plane_stress")
        studies = [self._study(*mesh) for mesh in self.meshes]
        names = studies[0].study.columns + self.loaded.study.ask
        if self.loaded.family.has_bands:
            names += tuple(map(BAND.format, names))
        rows = self._solved([(study, mechanism) for study in studies])
        return [dict(zip(names, row, strict=True)) for row in rows]

    def columns(self, values: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Return the columns of a design (d,) by name on the finest mesh, and the bands of those
        that are used.
        """
        *_, finest = by_mesh = self.solve(values)
        used = [name for name in finest if name in self.loaded.requirements.used]
        if self.loaded.family.has_bands:
            bands = {name: finest[BAND.format(name)] for name in used}
            return finest, {name: band for name, band in bands.items() if np.isfinite(band)}
        resolutions = np.array([resolution for resolution, _ in self.meshes], float)
        return finest, {
            n: column_band(n, resolutions, np.array([row[n] for row in by_mesh])) for n in used
        }

    def solve_scattered(
        self,
        values: Array,
        off: Array,
    ) -> list[Array]:
        """Return the couplings (3, stages) of a design with neck deviations `off` (stages, 3, 3),
        mm, on each mesh.
        """
        made, necks = kind_of(self.loaded).scattered(values, off)
        stages = [mechanism_of(made, each) for each in necks]
        couplings = list[Array]()
        for resolution in SCATTER:
            study = self._study(
                resolution, 2, dict.fromkeys(("drive", "frequencies", "life", "drift"))
            )
            rows = np.array(self._solved([(study, stage) for stage in stages]))
            couplings.append(rows[:, [study.outputs.index(name) for name in outputs.COUPLINGS]].T)
        return couplings

    def _study(
        self, resolution: int, layers: int, changes: Mapping[str, Any] = MappingProxyType({})
    ) -> LoadedStudy:
        """Return the study that solves a stage on one mesh, with other changes."""
        required = self.loaded.requirements
        settings: dict[str, Any] = {
            "model": self._model,
            "resolution": resolution,
            "layers": layers,
            "bands": False,
            "links": False,
            "mobility": None,
            "formula": required.paper_formula,
            "check": None,
            "time_limit": LIMIT,
            "ask": tuple(MODEL.sub(self._elements_in_path, path) for path in required.ask),
        }
        if self.loaded.solid:
            settings |= {
                "frequencies": None,
                "life": None,
                "drift": None,
                "drive": self._travel,
            }
        study = self.loaded.study.model_copy(update=settings | dict(changes))
        return replace(self.loaded, study=study)

    @property
    def _model(self) -> str:
        """Model of the studies."""
        if self.loaded.solid:
            return "three_dimensional"
        return "verify" if self.loaded.requirements.used & {*outputs.ERRORS} else "fe"

    @property
    def _elements_in_path(self) -> str:
        """The finite elements in the path of a number."""
        solid = self.loaded.base.model == "three_dimensional"
        return f".{(SOLID_ELEMENTS if solid else ELEMENTS).replace(' ', '_')}"

    @property
    def _travel(self) -> DriveQuestion | None:
        """The stroke that rotates base hinges only, without the actuators."""
        drive = self.loaded.requirements.drive
        if drive is None or drive.stroke_um is None:
            return None
        return drive.model_copy(update={"actuators": False})

    def _solved(self, tasks: list[tuple[LoadedStudy, Mechanism]]) -> list[list[float]]:
        """Return the rows of outputs of the tasks; tasks with a known or stored result are not
        solved again.
        """
        names = {id(task): _name_of(*task) for task in tasks}
        for name in names.values():
            self._recall(name)
        waiting = [task for task in tasks if names[id(task)] not in self._known]
        for done, (task, row) in enumerate(self._rows_of(waiting), 1):
            if isinstance(row, Failure):
                raise ComputationFailed(f"finite elements of a proposed design: {row.reason}")
            self._keep(names[id(task)], row)
            self.say(f"finite elements: {done} of {len(waiting)} solutions")
        self.counts[IN_THREE if self.loaded.solid else BY_ELEMENTS] = len(self._known)
        return [self._known[name] for name in names.values()]

    def _rows_of(
        self, tasks: list[tuple[LoadedStudy, Mechanism]]
    ) -> Iterable[tuple[Any, list[float] | Failure]]:
        """Yield tasks with their rows, in the order of completion."""
        if self.workers is None:
            return ((task, solved(*task)) for task in tasks)
        queue = iter(tasks)
        return self.workers.results(solved, lambda: next(queue, None), lambda task: LIMIT)

    def _recall(self, name: str) -> None:
        """Read the stored result of a task, where there is one."""
        if name not in self._known and self.folder is not None:
            with suppress(OSError, ValueError, RecursionError):  # no file, or a torn one
                self._known[name] = json.loads((self.folder / f"{name}.json").read_text())

    def _keep(
        self,
        name: str,
        row: list[float],
    ) -> None:
        """Keep the result of a task; a folder that refuses files is reported when the final results
        are written.
        """
        self._known[name] = row
        if self.folder is not None:
            with suppress(BadInput):
                path = self.folder / f"{name}.json"
                text = json.dumps(row)
                write_atomically(path, lambda file: file.write(text.encode()), again=True)


def _name_of(loaded: LoadedStudy, mechanism: Mechanism) -> str:
    """Return the name under which the result of a task is kept."""
    study = loaded.study.model_dump(mode="json")
    return digest([study, mechanism.to_toml(), dict(versions_of())])


class Proof(NamedTuple):
    """Quantities (q,) of a design by finite elements and by the model, and the model corrected to
    agree with them.

    `predicted` is by the model with the corrections of the search, `uncorrected` without any.
    `bands` combine meshes and `sampling`. A quantity below `round_off` is zero by symmetry. `gap`
    is the largest difference between prediction and finite elements over the sizes. `columns` are
    by finite elements where available, `analytic` by the model."""

    values: Array
    predicted: Array
    uncorrected: Array
    elements: Array
    bands: Array
    sampling: Array
    round_off: Array
    gap: float
    model: Model
    columns: dict[str, float]
    analytic: dict[str, float]
    scattered: CouplingQuantiles | None


class Proposal(NamedTuple):
    """One round of space mapping: the model that proposed the best design, and its finite-element
    verification.
    """

    proposing: Model
    best: BestDesign
    proof: Proof


def space_mapping(
    model: Model, solver: ElementSolver, timing: Timing | None = None
) -> tuple[list[Proposal], bool]:
    """Search, solve and correct until model and finite elements agree at the optimum and all ends
    are kept there.

    Returns all rounds, and whether they converged. Requirements are tightened by the bands, and
    with continuous dimensions by the accuracy, as far as feasible designs remain. Raises BadInput
    when no design has a solution."""
    timing = timing or Timing()
    accuracy = model.required.accuracy_percent / 100
    tightening = _Tightening(model)
    rounds = list[Proposal]()
    near = None
    everywhere = True
    assumed = SECONDS_PER_TRIANGLE * triangles_needed(model.loaded.base.layout)
    for _ in range(ROUNDS):
        timing.starts(SEARCH, share=share_of_search(model))
        model, best = _guarded(model, tightening.guards, near, everywhere)
        timing.starts(CHECK, assumed)
        last = proof(model, solver, best.values)
        side = -1.0 if rounds and not np.any(model.guard) else 1.0
        rounds.append(Proposal(model, best, last))
        missed = best.merit >= MISSED
        if last.gap <= accuracy and (missed or keeps_ends(last, side)):
            timing.ends()
            return rounds, True
        near = best.values
        everywhere = last.gap > LOCAL or missed
        tightening.widen(last.bands)
        model = last.model
    timing.ends()
    return rounds, False


class _Tightening:
    """Guards (q,) of requirements, relative to their sizes, that are tried in turn."""

    def __init__(self, model: Model) -> None:
        self.accuracy = model.required.accuracy_percent / 100
        self.shares = ROOM if model.space.continuous.any() else (0.0,)  # of the accuracy
        self.sizes = model.sizes
        self.bands = np.zeros(len(model.sizes))
        self.guards = [self.bands]

    def widen(self, bands: Array) -> None:
        """Guard against the largest bands so far."""
        limited = self.sizes > 0
        relative = bands / np.where(limited, self.sizes, 1.0)
        self.bands = np.where(limited, np.maximum(self.bands, relative), 0.0)
        self.guards = [
            np.where(limited, self.bands + share * self.accuracy, 0.0) for share in self.shares
        ]
        self.guards.append(np.zeros(len(self.sizes)))


def _guarded(
    model: Model, guards: list[Array], near: Array | None, everywhere: bool
) -> tuple[Model, BestDesign]:
    """Return the optimum with the first of `guards` that leaves feasible designs, or else the
    first, and its model.
    """
    optima = list[tuple[Model, BestDesign]]()
    for guard in guards:
        guarded = replace(model, guard=guard)
        best = optimum(guarded, near, everywhere)
        optima.append((guarded, best))
        if best.merit < MISSED:
            break
        near = best.values
    else:
        return optima[0]
    return optima[-1]


def keeps_ends(verified: Proof, side: float = 1.0) -> bool:
    """Return whether finite elements keep every end by the band (limited to the room), or for -1
    within the band.
    """
    model = verified.model
    q = verified.elements
    band = side * np.minimum(verified.bands, model.room)
    return bool(np.all((q - band >= model.low) & (q + band <= model.high)))


def proof(
    model: Model,
    solver: ElementSolver,
    values: Array,
) -> Proof:
    """Verify a design (d,) by finite elements, and find the corrections that make the model agree
    with them there.

    The band of a quantity is its largest change where every column that it uses is at an end of its
    band.
    """
    solved_columns, widths = solver.columns(values)
    sampled = model.kind.quantiles(values, solver, model.counts)
    by_model = model.columns(values[None])[0]
    analytic = {name: float(column[0]) for name, column in by_model.items()}
    half_widths = dict[str, float]()
    uncorrected = analytic
    if sampled is not None:
        half_widths = named(sampled.half_widths)
        uncorrected = analytic | named(sampled.others)
        solved_columns = solved_columns | named(sampled.elements[-1])
        widths = widths | _widths_of_factors(sampled)
    found = _Columns(model, analytic | solved_columns)
    round_off = ROUND_OFF * found.effect(found.sizes)
    sampling = found.effect(half_widths)
    bands = np.maximum(found.effect(widths), ROUND_OFF_RATIO * round_off)
    predicted = model.quantities(model.corrected(by_model))[0]
    return Proof(
        values=values,
        predicted=predicted,
        uncorrected=_quantities(model, uncorrected),
        elements=found.quantities,
        bands=bands + sampling,
        sampling=sampling,
        round_off=round_off,
        gap=_gap(model, predicted, found.quantities, bands),
        model=replace(model, corrections=_corrections(analytic, solved_columns)),
        columns=found.columns,
        analytic=analytic,
        scattered=sampled,
    )


def _corrections(
    analytic: Mapping[str, float], elements: Mapping[str, float]
) -> dict[str, Correction]:
    """Return the corrections of the columns that both models give."""
    both = [name for name in elements if name in analytic]
    return {name: correction_of(analytic[name], elements[name]) for name in both}


def _widths_of_factors(sampled: CouplingQuantiles) -> dict[str, float]:
    """Return the mesh bands of couplings under tolerance, none without finite elements."""
    if len(sampled.factors) <= 1:
        return {}
    resolutions = np.array(SCATTER, float)
    by_name = zip(SCATTERED, sampled.elements.T, strict=True)
    return {name: mesh_band(resolutions, row, 0.0) for name, row in by_name}


def _quantities(model: Model, columns: Mapping[str, float]) -> Array:
    """Return the quantities (q,) of the columns of one design."""
    one = {name: np.array([value]) for name, value in columns.items()}
    return np.asarray(model.quantities(one)[0])


def _gap(
    model: Model,
    predicted: Array,
    elements: Array,
    bands: Array,
) -> float:
    """Return the largest difference between prediction and finite elements over the sizes."""
    size = np.maximum(np.abs(elements), model.sizes)
    difference = np.abs(predicted - elements)
    # objectives that neither meshes nor model distinguish from zero
    zero = np.maximum(np.abs(elements), difference) <= bands
    zero[len(model.signs) :] = False
    return float(np.max(np.where(zero, 0.0, difference) / np.where(size > 0, size, 1.0)))


class _Columns:
    """Columns of a verified design, and its quantities (q,)."""

    def __init__(
        self,
        model: Model,
        columns: dict[str, float],
    ) -> None:
        self.model = model
        self.columns = columns
        self.quantities = _quantities(model, columns)

    @property
    def sizes(self) -> Mapping[str, Array]:
        """Sizes of columns that symmetry can make zero, to which round-off is relative."""
        return outputs.sizes_of({name: np.array(value) for name, value in self.columns.items()})

    def effect(self, widths: Mapping[str, Any]) -> Array:
        """Return the largest change (q,) of each quantity with some columns at either end of their
        widths.
        """
        widths = {name: float(width) for name, width in widths.items() if name in self.columns}
        if not widths:
            return 0.0 * self.quantities
        slopes = []
        for alone in np.eye(len(widths)):
            falls = self._moved(widths, alone) < self._moved(widths, -alone)
            slopes.append(np.where(falls, -1, 1))
        ends = [
            [self._moved(widths, side * signs)[k] for side in (-1, 1)]
            for k, signs in enumerate(np.transpose(slopes))
        ]
        return np.asarray(np.max(np.abs(ends - self.quantities[:, None]), axis=1))

    def _moved(
        self,
        widths: Mapping[str, float],
        signs: Iterable[float],
    ) -> Array:
        """Return the quantities (q,) with columns moved by their widths times signs."""
        moved = {
            name: self.columns[name] + sign * width
            for (name, width), sign in zip(widths.items(), signs, strict=True)
        }
        return _quantities(self.model, self.columns | moved)


def column_band(
    name: str,
    resolutions: Array,
    values: Array,
) -> float:
    """Return the mesh band of a column (levels,), coarse to fine, by the rate at which such columns
    converge.
    """
    bands = [mesh_band(resolutions, values, 0.0)]
    if len(resolutions) > 2:  # there are two in three dimensions
        slow = ((CORNER_COLUMNS, corner_bands), (STRESS_COLUMNS, stress_bands))
        bands += [
            float(band(resolutions, values)) for converging, band in slow if name in converging
        ]
    return max(bands)
