"""Finite elements of designs that a search proposes, on several meshes, by the workers that answer studies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.files.writing import digest
from flexfem.mechanism.keys import keys
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import levels
from flexfem.refused import ComputationFailed
from flexfem.study.answer import answer
from flexfem.study.columns import COUPLINGS, ERRORS, Rows
from flexfem.study.factors import Factor, columns_of
from flexfem.study.loaded import LoadedStudy, stage_of
from flexfem.study.plan import DriveQuestion, Sampling
from flexfem.study.workers import Failure, Workers, require_same_versions, versions_of
from flexfem.synthesis.requirements import SCATTERED, LoadedRequirements
from flexfem.synthesis.scatter import scattered_study, seed_of_others
from flexfem.synthesis.store import Store

FIXED = "thickness_mm"
SOLID = ((4, 2), (6, 3))  # triangles across a neck and layers, coarse to fine
SCATTER = (4, 6)  # triangles across a neck where nine necks scatter
LIMIT = 600.0  # s for one solution


class Meshed(NamedTuple):
    """What finite elements say of a design: columns by name on every mesh, coarse to fine, with their resolutions."""

    resolutions: tuple[int, ...]
    columns: list[dict[str, float]]


class Solve(NamedTuple):
    """One solution: a study and which of its designs."""

    study: LoadedStudy
    design: int

    @property
    def question(self) -> str:
        """Its hash, with the versions of all that decides the answer."""
        return digest([self.study.hash, self.design, dict(versions_of(True))])


class ProposedElements:
    """Finite elements for requirements; `pool` None solves one after the other in this process."""

    def __init__(
        self, loaded: LoadedRequirements, counts: Counter[str], pool: Workers | None = None, store: Store | None = None
    ) -> None:
        self.loaded, self.counts, self.pool, self.store = loaded, counts, pool, store or Store(None)
        self._counted = set[str]()

    @property
    def solid(self) -> bool:
        """Whether they are of three dimensions, as of a base stage with hinges corrected for its thickness."""
        return self.loaded.stage.model == "corrected"

    def of(self, values: Array, say: Callable[[str], object] = lambda text: None) -> Meshed:
        """The design of free dimensions `values` (d,) on every mesh. Raises ComputationFailed."""
        stage = stage_of(self.loaded.study, values)
        meshes: tuple[tuple[int, int], ...] = SOLID
        if self.solid:
            stage = stage.replace(model="plane_stress")
        else:
            meshes = tuple((level, 2) for level in levels(self.loaded.requirements.resolution))
        studies = [self._study(stage, *mesh) for mesh in meshes]
        rows = self._solved([Solve(study, 0) for study in studies], say)
        found = [dict(zip(study.outputs, row, strict=True)) for study, row in zip(studies, rows, strict=True)]
        return Meshed(tuple(mesh[0] for mesh in meshes), found)

    def scattered(self, values: Array, say: Callable[[str], object] = lambda text: None) -> list[Array] | None:
        """Couplings (3, checked) of a design whose nine necks scatter, of the first of the stages that no search sees.

        On each of the meshes of `SCATTER`; None where that is not asked.
        """
        of = self.loaded.requirements
        if of.tolerance is None or not of.tolerance.checked or not of.asked & {*SCATTERED} or self.solid:
            return None
        stage, found, seed = stage_of(self.loaded.study, values), list[Array](), seed_of_others(of.seed)
        for resolution in SCATTER:
            study = scattered_study(self._study(stage, resolution, 2), of.tolerance, of.tolerance.checked, seed)
            rows = np.array(self._solved([Solve(study, k) for k in range(of.tolerance.checked)], say))
            found.append(rows[:, [study.outputs.index(name) for name in COUPLINGS]].T)
        return found

    def _study(self, stage: Stage, resolution: int, layers: int) -> LoadedStudy:
        """A study of one design, the stage itself."""
        own = self.loaded.requirements
        factors = (Factor.model_validate({"key": FIXED, "values": [keys()[FIXED].value_in(stage)]}),)
        model = "three_dimensional" if self.solid else "verify" if own.asked & {*ERRORS} else "fe"
        changes = {"factor": factors, "sampling": Sampling(method="grid"), "model": model, "resolution": resolution}
        changes |= {"layers": layers, "bands": False, "links": False, "mobility": None}
        changes |= {"formula": own.paper_formula, "time_limit": LIMIT, "check": None}
        changes |= {"frequencies": None, "life": None, "drift": None, "drive": self._strokes} if self.solid else {}
        loaded = self.loaded.study
        study = loaded.study.model_copy(update=changes)
        return replace(loaded, study=study, stage=stage, columns=columns_of(factors), given=None)

    @property
    def _strokes(self) -> DriveQuestion | None:
        """The drive that is asked about without its actuators."""
        of = self.loaded.requirements.drive
        if of is None or of.stroke_um is None:
            return None
        return of.model_copy(update={"actuators": False})

    def _solved(self, tasks: Sequence[Solve], say: Callable[[str], object]) -> list[list[float]]:
        """Rows of outputs, in the order of the tasks; what is kept is not solved again."""
        questions = [task.question for task in tasks]
        name = "finite elements in three dimensions" if self.solid else "finite elements"
        self.counts[name] += len({*questions} - self._counted)
        self._counted |= {*questions}
        waiting = [k for k, question in enumerate(questions) if self.store.answer(question) is None]
        for done, (k, rows) in enumerate(self._found(tasks, waiting), 1):
            if isinstance(rows, Failure) or rows.status[0] != "ok":
                reason = rows.reason if isinstance(rows, Failure) else str(rows.reason[0])
                raise ComputationFailed(f"finite elements of a proposed design: {reason}")
            self.store.keep(questions[k], rows.values[0].tolist())
            say(f"finite elements: {done} of {len(waiting)} solutions")
        return [self.store.answer(question) for question in questions]

    def _found(self, tasks: Sequence[Solve], waiting: list[int]) -> Iterator[tuple[int, Rows | Failure]]:
        """Rows of the tasks that are waiting, by this process or by workers."""
        if self.pool is None:
            yield from ((k, answer(tasks[k].study, tasks[k].design, tasks[k].design + 1)) for k in waiting)
            return
        ahead = ((k, tasks[k], dict(versions_of(True))) for k in waiting)
        for (k, *_), rows in self.pool.results(solved, lambda: next(ahead, None), lambda task: LIMIT):
            yield k, rows


def solved(number: int, task: Solve, versions: Mapping[str, str]) -> Rows:
    """In a worker: the row of a solution. Raises BadInput where the versions are others."""
    require_same_versions(versions, True)
    return answer(task.study, task.design, task.design + 1)
