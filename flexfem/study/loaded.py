"""A study with all that its file names: base stage, columns, table of designs."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from flexfem.analytic.responses import require_expansion
from flexfem.files.digest import digest
from flexfem.files.keypath import key_path
from flexfem.files.provenance import Doubts, is_assumed
from flexfem.files.refusals import shown
from flexfem.files.toml import bad_key, validate
from flexfem.hinges.strength import required_law
from flexfem.mechanism.keys import keys
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.questions import warnings as warning
from flexfem.refused import BadInput
from flexfem.study.columns import Column, acting, columns_of, with_mean
from flexfem.study.expression import names_in
from flexfem.study.given import Given, given_of
from flexfem.study.plan import Study
from flexfem.study.tables import EXTENSIBLE


@dataclass(frozen=True)
class LoadedStudy:
    """A study with its base stage read and found feasible, and its columns; `stem` names its results.

    `given` : the user's own table of designs, where the study samples from one.
    """

    path: Path
    study: Study
    stage: Stage
    columns: tuple[Column, ...]
    stem: str
    given: Given | None = None

    @property
    def count(self) -> int:
        """Number of designs."""
        return self.study.count if self.given is None else self.given.rows

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        return self.study.outputs

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths, of the stage and of the study, whose provenance says that they are assumed."""
        own = (key for key, source in self.study.provenance.items() if is_assumed(source))
        return (*(f"stage: {key}" for key in self._doubts.assumed), *(f"study: {key}" for key in own))

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Key paths of the numbers, of the stage and of the study, whose source is not stated."""
        stage = (f"stage: {key}" for key in self._doubts.not_stated)
        return (*stage, *(f"study: {key}" for key in self.study.not_stated))

    @property
    def stress_accuracy(self) -> str:
        """How far the highest neck stress, and what is found from it, may be off, in words."""
        study, plane = self.study, self.stage.model
        if study.model != "analytic":
            return f"neck stress by finite elements of resolution {study.resolution} is {study.stress_below}"
        said = warning.stress_accuracy(study.formula, study.links, plane)
        driven = warning.driven_accuracy(study.formula, study.links, plane)
        return f"{said}; in what the drive reaches, {driven}" if study.driven else said

    @property
    def _doubts(self) -> Doubts:
        """Those of the stage, its drive and expansions included where they are asked."""
        stage = self.stage
        asked = [stage.drive_doubts] if self.study.driven else []
        asked += [stage.heat_doubts] if self.study.drift is not None else []
        asked = asked or [Doubts([*stage.assumed], [*stage.not_stated])]
        return Doubts(*(list(dict.fromkeys(chain(*each))) for each in zip(*asked, strict=True)))

    @property
    def hash(self) -> str:
        """SHA-256 of all that answers depend on: no title, figure, provenance, path, nor how long one may take.

        How many designs there are counts only where it changes the first ones too; derived outputs, and constraints on
        outputs, are found from the answers.
        """
        unneeded = {"name", "stage", "factor", "figure", "provenance", "check", "time_limit", "output", "constraint"}
        content = self.study.model_dump(mode="json", exclude=unneeded)
        content |= {"stage": self.stage.hash, "draws": self.study.draws}
        if content["drive"] is not None and not content["drive"]["actuators"]:  # hashes older than the key stay
            del content["drive"]["actuators"]
        for key in ("frequencies", "life", "drift"):
            if content[key] is None:
                del content[key]
        if self.study.model != "three_dimensional":
            del content["layers"]
        if self.study.driven:
            content["stage"] = self.stage.drive_hash
        if self.study.drift is not None:
            content["drift"] = self.stage.heat_hash
        if self.given is not None:
            content["sampling"] = content["sampling"] | {"file": self.given.digest}
        if self.study.sampling.method in EXTENSIBLE:
            content["sampling"] = content["sampling"] | {"designs": None, "base": None}
        # a hinge with an override does not follow the factor of its like, though it may be as the others are
        followed = (o for o in self.stage.override if o.hinge or self.study.driven)
        content["override"] = sorted((*o.place, sorted(o.changes)) for o in followed)
        content["columns"] = [
            [name, keys, factor.model_dump(mode="json", exclude={"key", "keys", "label"})]
            for name, keys, factor in self.columns
        ]
        content["refused"] = [
            [self.study.in_full(each.value), each.least, each.most, each.said]
            for each in self.study.constraint
            if self.study.is_given(each.value)
        ]
        return digest(content)


def load_study(path: str | os.PathLike[str]) -> LoadedStudy:
    """Read a study file and its base stage.

    Raises
    ------
    BadInput
        As `toml.validate`, or the base stage cannot be read or made; one line naming file, line and key.
    """
    study = validate(Study, path)
    try:
        stage = load_feasible(os.path.normpath(Path(path).parent / study.stage))
    except BadInput as error:
        raise bad_key(path, ("stage",), f"stage = {shown(study.stage)}: {error}") from None
    require_model(path, study, stage)
    columns: list[Column] = []
    for index, factor in enumerate(study.factor):
        try:
            columns += [acting(with_mean(column, stage), stage, study.unasked) for column in columns_of([factor])]
        except BadInput as error:
            raise bad_key(path, ("factor", index), f"{key_path(('factor', index))}.{error}") from None
    loaded = LoadedStudy(Path(path), study, stage, tuple(columns), Path(path).stem, _given(path, study, columns))
    _require_key_values(loaded)
    return loaded


def require_model(path: str | os.PathLike[str], study: Study, stage: Stage) -> None:
    """Raise BadInput where the base stage is none for the model of the study, or has no drive that it asks for."""
    said = f"model = {shown(study.model)} on a stage with model = {shown(stage.model)}, expected"
    if study.model in ("fe", "verify") and stage.model == "corrected":
        raise bad_key(path, ("model",), f'{said} "analytic": the finite elements are plane')
    if study.model == "three_dimensional" and stage.model != "plane_stress":
        why = "it says how a stage is made plane, and here its faces are free"
        raise bad_key(path, ("model",), f"{said} a stage without one: {why}")
    if study.driven and not stage.actuator:
        raise bad_key(path, ("drive", "actuators"), "drive.actuators = true, expected a base stage with [[actuator]]")
    needs: dict[str, Callable[[], object]] = {
        "life": lambda: required_law(stage.material),
        "drift": lambda: require_expansion(stage, frame=True),
    }
    for key, require in needs.items():
        try:
            if getattr(study, key) is not None:
                require()
        except BadInput as error:
            raise bad_key(path, (key,), f"{key}, on the base stage: {error}") from None


def _given(path: str | os.PathLike[str], study: Study, columns: list[Column]) -> Given | None:
    """The table of designs that a study file names, read through; None where it names none."""
    if study.sampling.file is None:
        return None
    try:
        return given_of(Path(path).parent / study.sampling.file, columns)
    except BadInput as error:
        raise bad_key(path, ("sampling", "file"), f"sampling.file: {error}") from None


def _require_key_values(loaded: LoadedStudy) -> None:
    """Raise BadInput where an expression asks for a key that no factor sets and the stage leaves to a default."""
    study, set_by = loaded.study, {path for column in loaded.columns for path in column.keys}
    named = {*(column.name for column in loaded.columns), *study.every_output, *set_by}
    places = [(output.expression, ("output", k, "expression")) for k, output in enumerate(study.output)]
    places += [(constraint.value, ("constraint", k, "value")) for k, constraint in enumerate(study.constraint)]
    for expression, place in places:
        for name in names_in(expression):
            if name not in named and keys()[name].value_in(loaded.stage) is None:
                raise bad_key(loaded.path, place, f"{key_path(place)}: the stage has no {name} of its own")
