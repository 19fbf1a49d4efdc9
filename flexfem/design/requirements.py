"""The requirements file: base stage, free dimensions, what is required of the stage, and what is to be best."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, ValidationError, model_validator

from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA
from flexfem.arguments import FINEST
from flexfem.arrays import Array
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import OF_THE_KEY
from flexfem.files.refusals import KeyPath, problem_of, refusal, shown
from flexfem.files.toml import Label, PathLike, Table, bad_key, validate
from flexfem.mechanism.keys import keys
from flexfem.mechanism.stage import Stage
from flexfem.questions.case import ELASTIC, FORMULA, FormulaName, Mobility
from flexfem.study import plan
from flexfem.study.columns import ERRORS
from flexfem.study.factors import MANY, NAMED, Column, Factor, Number, Step
from flexfem.study.loaded import LoadedStudy, base_stage, columns_of_file, is_fixed, require_key_values

MOST_STEPS = 100_000  # of one dimension
ROUND_OFF = 1e-9  # of a step
LARGEST = 1e30  # end of a requirement, in its unit; its inverse is the smallest
FEWEST = 72  # stages: all of fewer are below their 95 % value with a probability of 2.5 % or more
LEAST_CHECKED = 8  # stages: fewer do not show how model and finite elements differ from stage to stage
QUANTITY = "Arithmetic on columns and keys of the stage file, as in studies"
MASS = ("mass_kg",)
DENSITY = "material.density_kg_m3"
SCATTERED = ("coupling_xy_95", "coupling_xt_95", "coupling_yt_95", "coupling_95")
SHARED = ("name", "stage", "formula", "mobility", "links", "drive", "frequencies", "life", "drift")  # with studies

Scatter: TypeAlias = Annotated[float, *quantities.above_zero(quantities.TOLERANCE)]
End: TypeAlias = Annotated[float | None, Field(ge=-LARGEST, le=LARGEST, json_schema_extra=OF_THE_KEY)]
Accuracy: TypeAlias = Annotated[float, *quantities.above_zero(quantities.PER_CENT)]


def _without_keys_of_studies(schema: dict[str, Any]) -> None:
    """Leave out the keys of a factor that no free dimension takes."""
    for key in ("points", "distribution", "mean", "sd", "lower", "upper"):
        del schema["properties"][key]


class Free(Factor):
    """A dimension that is free between two ends, or one of a list; all numbers in the units of the stage file."""

    named: ClassVar[tuple[str, ...]] = (*NAMED, "step")

    model_config = ConfigDict(json_schema_extra=_without_keys_of_studies)

    label: Label | None = Field(default=None, examples=["all necks"])
    """How it is called in what is printed; by default the key"""
    values: tuple[Number, ...] | None = Field(default=None, min_length=1, max_length=MANY, examples=[[1.5, 2.0, 3.0]])
    """Instead of `from` and `to`: a list, of which it is one"""
    step: Step | None = Field(default=None, examples=[0.005])
    """It is `from` and a whole number of these, up to `to`; left out it is continuous"""

    @model_validator(mode="after")
    def _is_a_range_or_a_list(self) -> Free:
        if self.kind not in ("values", "range") or self.points is not None:
            raise refusal("from and to, or values")
        if self.step is None:
            return self
        if self.values is not None:
            raise refusal("no step with values", "step")
        if self.start is not None and self.end is not None:
            length = self.end - self.start
            if length < self.step:
                raise refusal(f"at most {length:g}, from end to end", "step")
            if length / self.step > MOST_STEPS:
                raise refusal(f"at most {MOST_STEPS} steps from end to end", "step")
        return self

    @property
    def allowed(self) -> Array:
        """The values (k,) that it may take, rising; none where it is continuous."""
        if self.step is None or self.start is None or self.end is None:
            return np.sort(np.array(self.values or ()))
        steps = int(np.floor((self.end - self.start) / self.step + ROUND_OFF))
        return np.round(self.start + self.step * np.arange(steps + 1), 12)


class Require(Table):
    """Ends between which a quantity, an expression of columns and keys, must lie."""

    quantity: plan.Expression = Field(description=QUANTITY, examples=["kxx_n_per_mm"])
    at_least: End = Field(default=None, description="The lower end", examples=[100.0])
    at_most: End = Field(default=None, description="The upper end; one of both or both", examples=[150.0])
    label: Label | None = Field(default=None, examples=["stiffness in X"])
    """How it is called in what is printed"""

    @model_validator(mode="after")
    def _has_an_end(self) -> Require:
        plan.require_ends(self, "at_least", "at_most")
        for key, end in (("at_least", self.at_least), ("at_most", self.at_most)):
            if 0 < abs(end or 0.0) < 1 / LARGEST:
                raise refusal(f"zero, or a size of {1 / LARGEST:g} or more: margins are in parts of it", key)
        return self

    @property
    def title(self) -> str:
        """The label, by default the expression."""
        return self.label or self.quantity


class Objective(Table):
    """A quantity that is to be as large, or as small, as can be."""

    maximise: plan.Expression | None = Field(default=None, examples=["range_x_um"])
    """An expression that is to be as large as can be"""
    minimise: plan.Expression | None = Field(default=None, examples=["envelope_mm"])
    """Instead: one that is to be as small as can be"""
    label: Label | None = Field(default=None, examples=["range at yield in X"])
    """How it is called in what is printed"""

    @model_validator(mode="after")
    def _goes_one_way(self) -> Objective:
        if (self.maximise is None) == (self.minimise is None):
            raise refusal("either maximise or minimise")
        return self

    @property
    def key(self) -> str:
        """Which of both keys it has."""
        return "minimise" if self.maximise is None else "maximise"

    @property
    def quantity(self) -> str:
        """The expression."""
        return self.maximise or self.minimise or ""

    @property
    def sign(self) -> float:
        """What turns its value into one that is to be small."""
        return 1.0 if self.maximise is None else -1.0

    @property
    def title(self) -> str:
        """The label, by default the expression."""
        return self.label or self.quantity


class Tolerance(Table):
    """Scatter of the nine necks about their widths, each by itself."""

    neck_um: Scatter = Field(description="Standard deviation of every neck", examples=[5.0])
    stages: int = Field(default=4000, ge=FEWEST, le=20_000)
    """How many the search draws for a coupling, the same for every design; what is stated is of 100,000 others"""
    checked: int = Field(default=0, ge=0, le=1024)
    """How many of the others finite elements solve; 0, or >= 8"""

    @model_validator(mode="after")
    def _checks_enough(self) -> Tolerance:
        if 0 < self.checked < LEAST_CHECKED:
            raise refusal(f"0, or at least {LEAST_CHECKED}", "checked")
        return self


class Requirements(Sourced):
    """What a requirements file says."""

    kind: ClassVar[str] = "requirements file"

    name: Label = Field(description="Of the stage that is made, and title of figures", examples=["Long range"])
    stage: Label = Field(examples=["stage.toml"])
    """File of the base stage, relative to this one; what is not free is as there"""
    formula: FormulaName = Field(default=CALIBRATED, description=FORMULA)
    paper_formula: FormulaName = DEFAULT_FORMULA
    """Of the model whose `error_x_percent` and the like are asked, with the stage's own mobility"""
    mobility: Mobility | None = Field(default=21, description="Of the analytic model")
    links: bool = Field(default=False, description=f"{ELASTIC}; one design after the other, slower")
    seed: int = Field(ge=0, lt=2**63, description="What the search draws from", examples=[2003])
    accuracy_percent: Accuracy = 0.1
    """Within which the corrected analytic model and finite elements are to agree at the optimum"""
    resolution: int = Field(default=8, ge=8, le=FINEST)
    """Triangles across every neck, of the finest of three meshes"""
    front: int = Field(default=7, ge=3, le=50, description="With two objectives: designs of their front")
    free: tuple[Free, ...] = Field(min_length=1, max_length=30)
    """What may differ from the base stage; numbers in the unit of the key"""
    require: tuple[Require, ...] = Field(default=(), max_length=50, description="What the stage must keep")
    objective: tuple[Objective, ...] = Field(min_length=1, max_length=2, description="What is to be best, one or two")
    output: tuple[plan.Output, ...] = Field(default=(), max_length=50)
    """A name for an expression, which requirements and objectives may use"""
    drive: plan.DriveQuestion | None = Field(default=None, description="Asks how far a drive goes")
    frequencies: plan.Frequencies | None = None
    """Asks for natural frequencies in the plane; the table may be empty"""
    life: plan.LifeTable | None = Field(default=None, description="Asks for fatigue lives at an amplitude of the pose")
    drift: plan.DriftTable | None = None
    """Asks for the drift with temperature; the table has no keys"""
    tolerance: Tolerance | None = None
    """Asks for the share of stages that keep all requirements when their nine necks scatter, and for the couplings of
    95 % of them: `coupling_95`, `coupling_xy_95`, `coupling_xt_95`, `coupling_yt_95`"""

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
        columns = (*self.study.outputs, *MASS, *ERRORS, *(() if self.tolerance is None else SCATTERED))
        known = plan.require_own_names("free", self.free, self.output, columns, SCATTERED)
        for place, expression in self.expressions.items():
            plan.require_known(expression, known, *place)
        return self

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Requirements:
        for index, each in enumerate(self.require):
            if each.at_least is not None and each.at_most is not None:
                least = each.at_least + 0.02 * self.accuracy_percent * max(abs(each.at_least), abs(each.at_most))
                if each.at_most < least:
                    expected = f">= {least:.6g}, with both ends twice accuracy_percent apart"
                    raise refusal(expected, "require", index, "at_most")
        return self

    @cached_property
    def study(self) -> plan.Study:
        """The study whose factors are the free dimensions. Raises ValidationError as of a study file."""
        content: dict[str, Any] = {name: getattr(self, name) for name in SHARED}
        options: dict[str, Any] = {"by_alias": True, "exclude_unset": True, "exclude": {"step", "points"}}
        factors = tuple(free.model_dump(**options) for free in self.free)
        sampling = {"method": "sobol", "designs": 1, "seed": 0}
        return plan.Study.model_validate(content | {"model": "analytic", "sampling": sampling, "factor": factors})

    @property
    def expressions(self) -> dict[KeyPath, str]:
        """Expressions by their key paths."""
        found: dict[KeyPath, str] = {("output", k, "expression"): each.expression for k, each in enumerate(self.output)}
        found |= {("require", k, "quantity"): each.quantity for k, each in enumerate(self.require)}
        return found | {("objective", k, each.key): each.quantity for k, each in enumerate(self.objective)}

    @property
    def quantities(self) -> tuple[str, ...]:
        """What is required or to be best: expressions of objectives, then of requirements."""
        return (*(each.quantity for each in self.objective), *(each.quantity for each in self.require))

    @cached_property
    def used(self) -> frozenset[str]:
        """Names that the quantities use, through derived outputs too."""
        return self.names_of(*self.quantities)

    def names_of(self, *expressions: str) -> frozenset[str]:
        """Names that expressions use, through derived outputs too."""
        return plan.expanded_names((name for each in expressions for name in plan.names_in(each)), self.output)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source: of what is asked, and not of how it is found."""
        own = ("accuracy_percent", "output")
        return tuple(path for path in super().numbers if not path.startswith(own))


@dataclass(frozen=True)
class LoadedRequirements:
    """Requirements with their base stage read and found feasible; the free dimensions as columns, stars expanded."""

    path: Path
    requirements: Requirements
    stage: Stage
    columns: tuple[Column, ...]

    @cached_property
    def study(self) -> LoadedStudy:
        """The study by which the analytic model answers designs."""
        return LoadedStudy(self.path, self.requirements.study, self.stage, self.columns, self.path.stem)

    @property
    def solid(self) -> bool:
        """Whether finite elements are of three dimensions, as of a base stage corrected for its thickness."""
        return self.stage.model == "corrected"

    @property
    def base_values(self) -> Array:
        """The values (d,) of the base stage, those outside the range of a dimension brought to its nearer end."""
        found = []
        for column in self.columns:
            ends = column.factor.values or (column.factor.start or 0.0, column.factor.end or 0.0)
            own = [v for path in column.keys if (v := keys()[path].value_in(self.stage)) is not None]
            found.append(float(np.clip(np.mean(own or ends[:1]), min(ends), max(ends))))
        return np.array(found)


def load_requirements(path: PathLike) -> LoadedRequirements:
    """Read a requirements file and its base stage.

    Raises BadInput for a file that is refused, and for objectives that no free dimension changes: one line with file,
    line and key.
    """
    found = validate(Requirements, path)
    stage = base_stage(path, found.study)
    unused = found.study.unused_keys - found.used - ({DENSITY} if found.used & {*MASS} else set())
    columns = columns_of_file(path, "free", found.free, stage, unused)
    require_key_values(path, found.expressions, columns, stage)
    derived = {output.name for output in found.output}
    for index, objective in enumerate(found.objective):
        if all(is_fixed(name, columns, stage) for name in found.names_of(objective.quantity) - derived):
            place = f"objective[{index}].{objective.key} = {shown(objective.quantity)}"
            raise bad_key(path, ("objective", index, objective.key), f"{place}, expected what a free dimension changes")
    return LoadedRequirements(Path(path), found, stage, columns)
