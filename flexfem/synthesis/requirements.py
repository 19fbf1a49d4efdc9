"""A requirements file: base stage, free dimensions, what is required of the stage, and what is to be best."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, ValidationError, model_validator

from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA
from flexfem.arrays import Array
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import either, ruled, says, when, without
from flexfem.files.refusals import problem_of, refusal, shown
from flexfem.files.toml import Label, bad_key, validate
from flexfem.files.writing import digest
from flexfem.mechanism.keys import keys, meant
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.refused import BadInput
from flexfem.study.columns import ERRORS
from flexfem.study.factors import Column, acting, columns_of
from flexfem.study.loaded import LoadedStudy, require_model
from flexfem.study.plan import Drifting, DriveQuestion, Frequencies, Lasting, Output, Study, names_in
from flexfem.synthesis.scatter import NeckScatter
from flexfem.synthesis.tables import Free, Objective, Require, Tolerance
from flexfem.verify.case import ELASTIC, FORMULA, FormulaName, Mobility

Accuracy: TypeAlias = Annotated[float, *quantities.above_zero(quantities.PER_CENT)]
MASS = ("mass_kg",)
DENSITY = "material.density_kg_m3"
SCATTERED = ("coupling_xy_95", "coupling_xt_95", "coupling_yt_95", "coupling_95")
SHARED = ("name", "stage", "formula", "mobility", "links", "drive", "frequencies", "life", "drift")  # with studies


class Requirements(Sourced):
    """What a requirements file says."""

    kind: ClassVar[str] = "requirements file"

    model_config = ConfigDict(
        json_schema_extra=ruled(when(says("links", True), either(without("mobility"), says("mobility", 21))))
    )

    name: Label = Field(description="Of the stage that is made, and title of figures", examples=["Long range"])
    stage: Label = Field(
        description="File of the base stage, relative to this one; what is not free is as there",
        examples=["stage.toml"],
    )
    formula: FormulaName = Field(default=CALIBRATED, description=FORMULA)
    paper_formula: FormulaName = Field(
        default=DEFAULT_FORMULA,
        description="Of the model whose `error_x_percent` and the like are asked, with the stage's own mobility",
    )
    mobility: Mobility | None = Field(default=21, description="Of the analytic model")
    links: bool = Field(default=False, description=f"{ELASTIC}; one design after the other, slower")
    seed: int = Field(ge=0, lt=2**63, description="What the search draws from", examples=[2003])
    accuracy_percent: Accuracy = Field(
        default=0.1,
        description="Within which the corrected analytic model and finite elements are to agree at the optimum",
    )
    resolution: int = Field(
        default=8, ge=8, le=64, description="Triangles across every neck, of the finest of three meshes"
    )
    front: int = Field(default=7, ge=3, le=50, description="With several objectives: designs of their front")
    free: tuple[Free, ...] = Field(
        min_length=1, max_length=30, description="What may differ from the base stage; numbers in the unit of the key"
    )
    require: tuple[Require, ...] = Field(default=(), max_length=50, description="What the stage must keep")
    objective: tuple[Objective, ...] = Field(min_length=1, max_length=4, description="What is to be best")
    output: tuple[Output, ...] = Field(
        default=(), max_length=50, description="A name for an expression, which requirements and objectives may use"
    )
    drive: DriveQuestion | None = Field(default=None, description="Asks how far a drive goes")
    frequencies: Frequencies | None = Field(
        default=None, description="Asks for natural frequencies in the plane; the table may be empty"
    )
    life: Lasting | None = Field(default=None, description="Asks for fatigue lives at an amplitude of the pose")
    drift: Drifting | None = Field(
        default=None, description="Asks for the drift with temperature; the table has no keys"
    )
    tolerance: Tolerance | None = Field(
        default=None,
        description="Asks for the couplings of stages whose nine necks scatter: `coupling_95`, `coupling_xy_95`, "
        "`coupling_xt_95`, `coupling_yt_95`",
    )

    @model_validator(mode="after")
    def _goes_together_as_a_study(self) -> Requirements:
        try:
            _ = self.study
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            path = (*first["loc"], *first.get("ctx", {}).get("at", ()))
            renamed = ("free" if part == "factor" else part for part in path)
            raise refusal(problem_of(first, {}).expected.replace("factor[", "free["), *renamed) from None
        return self

    @model_validator(mode="after")
    def _expressions_name_columns(self) -> Requirements:
        for index, free in enumerate(self.free):
            for column in columns_of([free]):
                if column.name in (*MASS, *ERRORS, *SCATTERED):
                    raise refusal(f"a name of its own, not {shown(column.name)} again", "free", index, "label")
        known = {*(column.name for column in columns_of(self.free)), *self.base, *MASS, *ERRORS}
        known |= {*SCATTERED} if self.tolerance is not None else set()
        for index, output in enumerate(self.output):
            if output.name in known or output.name in keys():
                raise refusal(f"a name of its own, not {shown(output.name)} again", "output", index, "name")
            _require_known(output.expression, known, "output", index, "expression")
            known.add(output.name)
        for index, require in enumerate(self.require):
            _require_known(require.quantity, known, "require", index, "quantity")
        for index, objective in enumerate(self.objective):
            key = "minimise" if objective.maximise is None else "maximise"
            _require_known(objective.quantity, known, "objective", index, key)
        return self

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Requirements:
        for index, each in enumerate(self.require):
            if each.at_least is None or each.at_most is None:
                continue
            apart = 0.02 * self.accuracy_percent * max(abs(each.at_least), abs(each.at_most))
            if each.at_most < each.at_least + apart:
                said = f">= {each.at_least + apart:.6g}, with both ends twice accuracy_percent apart"
                raise refusal(said, "require", index, "at_most")
        return self

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the columns that a study of the same tables has."""
        return self.study.outputs

    @cached_property
    def study(self) -> Study:
        """The study whose factors are the free dimensions. Raises ValidationError as of a study file."""
        content: dict[str, Any] = {name: getattr(self, name) for name in SHARED}
        factors = tuple(factor_of(free) for free in self.free)
        sampling = {"method": "sobol", "designs": 1, "seed": 0}
        return Study.model_validate(content | {"model": "analytic", "sampling": sampling, "factor": factors})

    @property
    def unasked(self) -> frozenset[str]:
        """Key paths that no answer which is asked for depends on: as of a study, but for what masses need."""
        return self.study.unasked - self.asked - ({DENSITY} if self.asked & {*MASS} else set())

    @property
    def quantities(self) -> tuple[str, ...]:
        """Expressions asked for: objectives, then requirements."""
        return (*(each.quantity for each in self.objective), *(each.quantity for each in self.require))

    @property
    def asked(self) -> frozenset[str]:
        """Names that the quantities use, through derived outputs too."""
        return frozenset(name for text in self.quantities for name in self.names_of(text))

    def names_of(self, expression: str) -> frozenset[str]:
        """Names that an expression uses, through derived outputs too."""
        return frozenset(_names([expression], {output.name: output.expression for output in self.output}))

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source: of what is asked, and not of how it is found."""
        own = ("accuracy_percent", "output")
        return tuple(path for path in super().numbers if not path.startswith(own))


def _overridden(column: Column, columns: Sequence[Column], stage: Stage) -> bool:
    """Whether other columns, each of one chain, set all that this one of all three chains sets."""
    alone = [key for each in columns for path in each.keys if (key := keys()[path]).table[:1] == ("override",)]
    by = {place for key in alone for place in key.places_in(stage)}
    own = [keys()[path] for path in column.keys]
    return not any(key in alone for key in own) and all(place in by for key in own for place in key.places_in(stage))


def factor_of(free: Free) -> Any:
    """A free dimension as a study takes it."""
    return free.model_dump(by_alias=True, exclude_unset=True, exclude={"step", "points"})


def _names(expressions: Any, derived: dict[str, str]) -> Iterator[str]:
    for text in expressions:
        for name in names_in(text):
            yield name
            yield from _names([derived[name]], derived) if name in derived else ()


def _require_known(expression: str, known: set[str], *at: str | int) -> None:
    for name in names_in(expression):
        if name not in known and name not in keys():
            said = f"columns and keys by name, not {shown(name)}{meant(name, sorted({*known, *keys()}))}"
            raise refusal(said, *at)


@dataclass(frozen=True)
class LoadedRequirements:
    """Requirements with their base stage read and found feasible.

    columns : the free dimensions.   study : of the analytic model, with these as factors.
    """

    path: Path
    requirements: Requirements
    stage: Stage
    columns: tuple[Column, ...]

    @cached_property
    def study(self) -> LoadedStudy:
        """What answers designs by the analytic model, none of them drawn."""
        return LoadedStudy(self.path, self.requirements.study, self.stage, self.columns, self.path.stem)

    @cached_property
    def scatter(self) -> NeckScatter | None:
        """Scatter of the nine necks, where a coupling under it is asked."""
        of = self.requirements
        if of.tolerance is None or not of.asked & {*SCATTERED}:
            return None
        return NeckScatter.of(self.study, of.tolerance, of.seed)

    @property
    def hash(self) -> str:
        """SHA-256 of all that a design depends on besides the code: no name, provenance, nor path."""
        of = self.requirements.model_dump(mode="json", exclude={"name", "stage", "provenance", "accuracy_percent"})
        return digest([of, self.study.hash, self.stage.hash])

    @property
    def own_values(self) -> Array:
        """The base stage's values (columns,), those outside the limits of a dimension brought within."""
        found = []
        for column in self.columns:
            factor = column.factor
            ends = factor.values or tuple(each for each in (factor.start, factor.end) if each is not None)
            own = [v for path in column.keys if (v := keys()[path].value_in(self.stage)) is not None]
            found.append(float(np.clip(np.mean(own) if own else ends[0], min(ends), max(ends))))
        return np.array(found)


def load_requirements(path: str | os.PathLike[str]) -> LoadedRequirements:
    """Read a requirements file and its base stage.

    Raises
    ------
    BadInput
        As `toml.validate`, or the base stage cannot be read, made or asked; one line naming file, line and key.
    """
    found = validate(Requirements, path)
    try:
        stage = load_feasible(os.path.normpath(Path(path).parent / found.stage))
    except BadInput as error:
        raise bad_key(path, ("stage",), f"stage = {shown(found.stage)}: {error}") from None
    require_model(path, found.study, stage)
    columns: list[Column] = []
    for index, free in enumerate(found.free):
        try:
            columns += [acting(column, stage, found.unasked) for column in columns_of([free])]
        except BadInput as error:
            raise bad_key(path, ("free", index), f"free[{index}].{error}") from None
    for index, free in enumerate(found.free):
        if all(_overridden(column, columns, stage) for column in columns_of([free])):
            said = f"free[{index}]: nothing follows it, expected a number that other free dimensions do not override"
            raise bad_key(path, ("free", index), said)
    loaded = LoadedRequirements(Path(path), found, stage, tuple(columns))
    set_by = {name for column in columns for name in column.keys}
    fixed = {*keys(), *(output.name for output in found.output)} - set_by
    for index, objective in enumerate(found.objective):
        if found.names_of(objective.quantity) <= fixed:
            key = "minimise" if objective.maximise is None else "maximise"
            said = f"objective[{index}].{key} = {shown(objective.quantity)}, expected what a free dimension changes"
            raise bad_key(path, ("objective", index, key), said)
    for index, require in enumerate(found.require):
        for name in names_in(require.quantity):
            if name in keys() and name not in set_by and keys()[name].value_in(stage) is None:
                raise bad_key(
                    path, ("require", index), f"require[{index}].quantity: the stage has no {name} of its own"
                )
    return loaded
