"""A study with its base and table of designs, as read from its file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from flexfem.arrays import Array
from flexfem.files.expressions import names_in
from flexfem.files.provenance import Assumptions, Sourced, is_assumed
from flexfem.files.refusals import key_path, shown
from flexfem.files.toml import PathLike, bad_key, read_toml, validate
from flexfem.files.writing import digest
from flexfem.mechanism.keys import keys
from flexfem.mechanism.loading import load
from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput
from flexfem.study import sampling
from flexfem.study.factors import Column
from flexfem.study.family import Family, family_of
from flexfem.study.plan import BASE_KEYS, EXTENSIBLE, Asked, Study
from flexfem.study.sampling import DesignTable, design_table_of

# keys of a study file on which its rows do not depend, or which `LoadedStudy.hash` treats alone
NOT_HASHED = {
    "name",
    "mechanism",
    "factor",
    "figure",
    "provenance",
    "check",
    "time_limit",
    "output",
    "constraint",
}
NAMES_OF_FACTOR = {"key", "keys", "label"}


@dataclass(frozen=True)
class LoadedStudy:
    """A study with its feasible base and its columns; `stem` names its results.

    `table` : the user's own table of designs, where the study has one.
    """

    path: Path
    study: Study
    base: Mechanism
    columns: tuple[Column, ...]
    stem: str
    table: DesignTable | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the content for a pickle, without the family, which is made again."""
        return {name: value for name, value in vars(self).items() if name != "family"}

    @cached_property
    def family(self) -> Family:
        """The designs of the study on its base."""
        return family_of(self.base, self.study, self.columns)

    @property
    def count(self) -> int:
        """Number of designs."""
        return self.study.count if self.table is None else self.table.rows

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        return self.study.outputs

    @property
    def assumptions(self) -> Assumptions:
        """Key paths of the numbers of stage and file that are assumed or not stated; those of drive
        and expansion only where the study uses them.
        """
        return self.assumptions_with("study", self.study)

    def assumptions_with(
        self,
        prefix: str,
        file: Sourced,
    ) -> Assumptions:
        """Return the assumptions of the base, and of the file with the questions."""
        of_base = self.family.assumptions
        of_file = Assumptions(
            [key for key, source in file.provenance.items() if is_assumed(source)],
            [*file.not_stated],
        )
        both = [
            [f"stage: {key}" for key in of_stage] + [f"{prefix}: {key}" for key in of_study]
            for of_stage, of_study in zip(of_base, of_file, strict=True)
        ]
        return Assumptions(*both)

    @property
    def stress_accuracy(self) -> str:
        """Text on the error of the highest neck stress and of quantities computed from it."""
        return self.family.accuracy

    @property
    def hash(self) -> str:
        """SHA-256 of all inputs of the rows: without titles, figures, provenance, paths and the
        time limit.

        The number of designs counts only where it changes the first designs too. Derived outputs,
        and constraints on outputs, are computed from the rows and do not count.
        """
        study = self.study
        content = study.model_dump(mode="json", exclude=NOT_HASHED)
        if self.table is not None:
            content["sampling"]["file"] = self.table.digest
        if study.sampling.method in EXTENSIBLE:
            content["sampling"] |= {"designs": None, "base": None}
        content |= self.family.identity
        content |= {"draws": study.draws, "columns": self._hashed_columns()}
        content["refused"] = self._hashed_refusals()
        return digest(content)

    def _hashed_columns(self) -> list[Any]:
        return [
            [
                column.name,
                column.keys,
                column.factor.model_dump(mode="json", exclude=NAMES_OF_FACTOR),
            ]
            for column in self.columns
        ]

    def _hashed_refusals(self) -> list[Any]:
        """Return the constraints that refuse designs, with the outputs and keys that they use."""
        study = self.study
        used = study.names_of(*(constraint.value for constraint in study.refusing))
        limits = [[each.value, each.least, each.most, each.title] for each in study.refusing]
        derived = [[each.name, each.expression] for each in study.output if each.name in used]
        fixed = sorted(name for name in used if self.family.is_fixed(name))
        numbers = [[name, keys()[name].value_in(self.base)] for name in fixed]
        return [*limits, *derived, *numbers]


def load_study(path: PathLike) -> LoadedStudy:
    """Read a study file and its base stage or mechanism.

    Raises BadInput as `toml.validate`, or for a base that cannot be read or made: one line with
    file, line, key.
    """
    study = validate(Study, path)
    family = base_of(path, study, study)
    table = None
    if study.sampling.file is not None:
        try:
            table = design_table_of(Path(path).parent / study.sampling.file, family.columns)
        except BadInput as error:
            raise bad_key(path, ("sampling", "file"), f"sampling.file: {error}") from None
    return LoadedStudy(Path(path), study, family.base, family.columns, Path(path).stem, table)


def base_of(
    path: PathLike,
    asked: Asked,
    study: Study,
) -> Family:
    """Return the family of the base that a file names, with the columns of its factors.

    Raises BadInput with file, line and key, also where an expression uses a key that the base
    leaves to a default.
    """
    base = base_mechanism(path, study)
    unvaried = family_of(base, study)
    columns = list[Column]()
    for index, factor in enumerate(asked.varied):
        try:
            columns += unvaried.columns_of(factor, asked.unused_keys)
        except BadInput as error:
            raise bad_key(path, (asked.array, index), f"{asked.array}[{index}].{error}") from None
    family = family_of(base, study, columns)
    for place, expression in asked.expressions.items():
        for name in names_in(expression):
            if family.is_fixed(name) and keys()[name].value_in(base) is None:
                raise bad_key(path, place, f"{key_path(place)}: the stage does not state {name}")
    return family


def base_mechanism(path: PathLike, study: Study) -> Mechanism:
    """Return the base that a study names. Raises BadInput where it does not suit the study."""
    stated = read_toml(path).data
    key = next(key for key in BASE_KEYS if key in stated)
    named = f"{key} = {shown(study.mechanism)}"
    try:
        base = load(os.path.normpath(Path(path).parent / study.mechanism))
    except BadInput as error:
        raise bad_key(path, (key,), f"{named}: {error}") from None
    misfit = family_of(base, study).misfit()
    if misfit is None:
        return base
    if misfit.key:
        raise bad_key(path, *misfit)
    raise bad_key(path, (key,), f"{named}, {misfit.text}")


def sample(
    loaded: LoadedStudy,
    start: int,
    stop: int,
) -> Array:
    """Return the factor values (stop - start, columns) of the designs from `start` up to `stop`, in
    file units.

    The last factor of a grid varies fastest. A sample of an `EXTENSIBLE` method begins with every
    smaller one.
    """
    first = max(start, 0)
    end = min(stop, loaded.count)
    return sampling.sample(loaded.study, loaded.columns, loaded.table, first, end)


def mechanism_of(loaded: LoadedStudy, values: Array) -> Mechanism:
    """Return the design with factor values (columns,), file units, without provenance.

    Raises BadInput for a value that no file can give, one line that begins with its key.
    """
    return loaded.family.mechanism(values)


def base_factor_values(loaded: LoadedStudy) -> Mapping[str, float]:
    """Return the factor values of the base by column, file units, without factors whose keys differ
    there.
    """
    found = dict[str, float]()
    for column in loaded.columns:
        values = {keys()[path].value_in(loaded.base) for path in column.keys}
        value = values.pop()
        if not values and value is not None:
            found[column.name] = value
    return found
