"""The requirements file: base stage, free dimensions, requirements and objectives."""

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
from flexfem.files.expressions import names_in
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import OF_THE_KEY, AnyNumber, AnyPositive, Limits, Percent, Scatter
from flexfem.files.refusals import KeyPath, problems_of, refusal, shown
from flexfem.files.tables import Label, Table
from flexfem.files.toml import PathLike, bad_key, validate
from flexfem.mechanism.keys import keys
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.questions.case import ELASTIC, FORMULA, FormulaName, Mobility
from flexfem.study import plan
from flexfem.study.answer import require_extra_numbers
from flexfem.study.columns import ERRORS
from flexfem.study.factors import MANY, NAMED, Column, Factor
from flexfem.study.loaded import LoadedStudy, base_stage, columns_of_file, is_fixed, require_key_values

MOST_STEPS = 100_000  # of one dimension
ROUND_OFF = 1e-9  # of a step
LARGEST = 1e30  # end of a requirement, in its unit; the smallest one is the inverse
FEWEST = 72  # stages: the maximum of fewer is below the 95 % quantile with a probability of 2.5 % or more
LEAST_CHECKED = 8  # stages: fewer do not show the scatter of the difference between model and finite elements
QUANTITY = "Arithmetic on columns and keys of the base file, as in studies"
MASS = ("mass_kg",)
DENSITY = "material.density_kg_m3"
SCATTERED = ("coupling_xy_95", "coupling_xt_95", "coupling_yt_95", "coupling_95")
SHARED = ("name", "stage", "ask", "formula", "mobility", "links", "drive", "frequencies", "life", "drift")  # of studies

End: TypeAlias = Annotated[float, Limits(OF_THE_KEY, ge=-LARGEST, le=LARGEST)]


def _without_keys_of_studies(schema: dict[str, Any]) -> None:
    """Remove the keys of a factor that a free dimension does not have."""
    for key in ("points", "distribution", "mean", "sd", "lower", "upper"):
        del schema["properties"][key]


class Free(Factor):
    """A free dimension, in a range or from a list of values; all numbers in the units of the stage file."""

    named: ClassVar[tuple[str, ...]] = (*NAMED, "step")

    model_config = ConfigDict(json_schema_extra=_without_keys_of_studies)

    label: Label | None = Field(default=None, examples=["all necks"])
    """Name in the output; by default the key"""
    values: tuple[AnyNumber, ...] | None = Field(
        default=None, min_length=1, max_length=MANY, examples=[[1.5, 2.0, 3.0]]
    )
    """Instead of `from` and `to`: the allowed values"""
    step: AnyPositive | None = Field(default=None, examples=[0.005])
    """Increment of the allowed values from `from` up to `to`; without it the dimension is continuous"""

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
                raise refusal(f"at most {length:g}, the length of the range", "step")
            if length / self.step > MOST_STEPS:
                raise refusal(f"at most {MOST_STEPS} steps in the range", "step")
        return self

    @property
    def allowed(self) -> Array:
        """The allowed values (k,), ascending; none for a continuous dimension."""
        if self.step is None or self.start is None or self.end is None:
            return np.sort(np.array(self.values or ()))
        steps = int(np.floor((self.end - self.start) / self.step + ROUND_OFF))
        return np.round(self.start + self.step * np.arange(steps + 1), 12)


class Require(Table):
    """A requirement: the limits between which an expression of columns and keys must lie."""

    quantity: plan.Expression = Field(description=QUANTITY, examples=["kxx_n_per_mm"])
    at_least: End | None = Field(default=None, description="Lower limit", examples=[100.0])
    at_most: End | None = Field(default=None, description="Upper limit; one or both are needed", examples=[150.0])
    label: Label | None = Field(default=None, examples=["stiffness in X"])
    """Name in the output"""

    @model_validator(mode="after")
    def _has_an_end(self) -> Require:
        plan.require_ends(self, "at_least", "at_most")
        for key, end in (("at_least", self.at_least), ("at_most", self.at_most)):
            if 0 < abs(end or 0.0) < 1 / LARGEST:
                raise refusal(f"zero, or a size of {1 / LARGEST:g} or more: margins are relative to it", key)
        return self

    @property
    def title(self) -> str:
        """The label, by default the expression."""
        return self.label or self.quantity


class Objective(Table):
    """A quantity to maximise or to minimise."""

    maximise: plan.Expression | None = Field(default=None, examples=["range_x_um"])
    """Expression to maximise"""
    minimise: plan.Expression | None = Field(default=None, examples=["envelope_mm"])
    """Instead of `maximise`: expression to minimise"""
    label: Label | None = Field(default=None, examples=["range at yield in X"])
    """Name in the output"""

    @model_validator(mode="after")
    def _has_one_direction(self) -> Objective:
        if (self.maximise is None) == (self.minimise is None):
            raise refusal("either maximise or minimise")
        return self

    @property
    def key(self) -> str:
        """Name of the key that is given."""
        return "minimise" if self.maximise is None else "maximise"

    @property
    def quantity(self) -> str:
        """The expression."""
        return self.maximise or self.minimise or ""

    @property
    def sign(self) -> float:
        """Factor that turns the objective into one to minimise."""
        return 1.0 if self.maximise is None else -1.0

    @property
    def title(self) -> str:
        """The label, by default the expression."""
        return self.label or self.quantity


class Tolerance(Table):
    """Independent scatter of the widths of the nine necks."""

    neck_um: Scatter = Field(description="Standard deviation of every neck", examples=[5.0])
    stages: int = Field(default=4000, ge=FEWEST, le=20_000)
    """Random stages in the search, the same for every design; the final couplings are those of 100,000 other stages"""
    checked: int = Field(default=0, ge=0, le=1024)
    """Number of the other stages that finite elements solve; 0, or >= 8"""

    @model_validator(mode="after")
    def _checks_enough(self) -> Tolerance:
        if 0 < self.checked < LEAST_CHECKED:
            raise refusal(f"0, or at least {LEAST_CHECKED}", "checked")
        return self


class Requirements(Sourced):
    """Contents of a requirements file."""

    kind: ClassVar[str] = "requirements file"

    name: Label = Field(description="Name of the designed stage, and title of figures", examples=["Long range"])
    stage: Label = Field(examples=["stage.toml"])
    """File of the base stage, relative to this one, with the values of all dimensions that are not free. It can be a
    mechanism file: free keys are then `parameters.NAME`, and quantities are numbers of `ask`"""
    ask: tuple[Label, ...] = Field(default=(), max_length=100, examples=[["stiffness.free.analytic.x"]])
    """On a mechanism, as in studies: columns by the path of a number in the JSON output of a command, for the analytic
    model. Finite elements give the same numbers of the designed mechanism"""
    formula: FormulaName = Field(default=CALIBRATED, description=FORMULA)
    paper_formula: FormulaName = DEFAULT_FORMULA
    """Formula of the model, with the stage's own mobility, whose errors are `error_x_percent` and the like"""
    mobility: Mobility | None = Field(default=21, description="Mobility of the analytic model")
    links: bool = Field(default=False, description=f"{ELASTIC}; one design after the other, slower")
    seed: int = Field(ge=0, lt=2**63, description="Seed of the search", examples=[2003])
    accuracy_percent: Percent = 0.1
    """Required agreement of the corrected analytic model and finite elements at the optimum"""
    resolution: int = Field(default=8, ge=8, le=FINEST)
    """Triangles across every neck, of the finest of three meshes"""
    front: int = Field(default=7, ge=3, le=50, description="With two objectives: number of designs of their front")
    free: tuple[Free, ...] = Field(min_length=1, max_length=30)
    """Dimensions that may differ from the base stage; numbers in the unit of the key"""
    require: tuple[Require, ...] = Field(default=(), max_length=50, description="Requirements on the stage")
    objective: tuple[Objective, ...] = Field(min_length=1, max_length=2, description="One or two objectives")
    output: tuple[plan.Output, ...] = Field(default=(), max_length=50)
    """A name for an expression, for use in requirements and objectives"""
    drive: plan.DriveQuestion | None = Field(default=None, description="Requests the range of a drive")
    frequencies: plan.Frequencies | None = None
    """Requests natural frequencies in the plane; the table may be empty"""
    life: plan.LifeTable | None = Field(default=None, description="Requests fatigue lives at an amplitude of the pose")
    drift: plan.DriftTable | None = None
    """Requests the drift with temperature; the table has no keys"""
    tolerance: Tolerance | None = None
    """Requests the share of stages that meet all requirements when their nine necks scatter, and the 95 % quantiles of
    the couplings: `coupling_95`, `coupling_xy_95`, `coupling_xt_95`, `coupling_yt_95`"""

    @model_validator(mode="after")
    def _keys_fit_the_base(self) -> Requirements:
        for key in ("tolerance", "paper_formula") if self.on_mechanism else ("ask",):
            if key in self.model_fields_set:
                base = "a mechanism, whose numbers are those of ask" if self.on_mechanism else "a stage"
                raise refusal(f"no {key} in a design of {base}", key)
        return self

    @model_validator(mode="after")
    def _is_a_valid_study(self) -> Requirements:
        try:
            _ = self.study
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            path = (*first["loc"], *first.get("ctx", {}).get("at", ()))
            renamed = ("free" if part == "factor" else part for part in path)
            raise refusal(problems_of(error)[0].expected.replace("factor[", "free["), *renamed) from None
        return self

    @model_validator(mode="after")
    def _expressions_name_columns(self) -> Requirements:
        columns = (*self.study.outputs, *(() if self.tolerance is None else SCATTERED))
        columns += () if self.on_mechanism else (*MASS, *ERRORS)
        known = plan.require_own_names("free", self.free, self.output, columns, SCATTERED)
        for path, expression in self.expressions.items():
            plan.require_known(expression, known, *path)
        return self

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Requirements:
        for index, (low, high) in enumerate((each.at_least, each.at_most) for each in self.require):
            if low is not None and high is not None:
                least = low + 0.02 * self.accuracy_percent * max(abs(low), abs(high))
                if high < least:
                    expected = f">= {least:.6g}, with both limits twice accuracy_percent apart"
                    raise refusal(expected, "require", index, "at_most")
        return self

    @property
    def on_mechanism(self) -> bool:
        """Whether free keys are parameters of a mechanism."""
        return plan.set_parameters(self.free)

    @cached_property
    def study(self) -> plan.Study:
        """The study whose factors are the free dimensions. Raises ValidationError like a study file."""
        shared = [name for name in SHARED if name in self.model_fields_set or not self.on_mechanism]
        content: dict[str, Any] = {name: getattr(self, name) for name in shared}
        options: dict[str, Any] = {"by_alias": True, "exclude_unset": True, "exclude": {"step", "points"}}
        factors = tuple(free.model_dump(**options) for free in self.free)
        sampling = {"method": "sobol", "designs": 1, "seed": 0}
        return plan.Study.model_validate(content | {"model": "analytic", "sampling": sampling, "factor": factors})

    @property
    def expressions(self) -> dict[KeyPath, str]:
        """All expressions by their key paths."""
        outputs: dict[KeyPath, str] = {("output", k, "expression"): o.expression for k, o in enumerate(self.output)}
        outputs |= {("require", k, "quantity"): each.quantity for k, each in enumerate(self.require)}
        return outputs | {("objective", k, each.key): each.quantity for k, each in enumerate(self.objective)}

    @property
    def quantities(self) -> tuple[str, ...]:
        """Expressions of the objectives, then of the requirements."""
        return (*(each.quantity for each in self.objective), *(each.quantity for each in self.require))

    @cached_property
    def used(self) -> frozenset[str]:
        """Names in the quantities and in the derived outputs that these use."""
        return self.names_of(*self.quantities)

    def title_of(self, requested: Objective | Require) -> str:
        """Return the title of a quantity; without its own label, label and unit of the derived output that it names."""
        output = next((each for each in self.output if each.name == requested.quantity), None)
        if requested.label or output is None or output.label is None:
            return requested.title
        return f"{output.label} ({output.unit})" if output.unit else output.label

    def names_of(self, *expressions: str) -> frozenset[str]:
        """Return the names in expressions and in the derived outputs that these use."""
        return plan.expanded_names((name for text in expressions for name in names_in(text)), self.output)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source; the accuracy and derived outputs need none."""
        return tuple(path for path in super().numbers if not path.startswith(("accuracy_percent", "output")))


@dataclass(frozen=True)
class LoadedRequirements:
    """Requirements with their feasible base, and the free dimensions as columns with stars expanded."""

    path: Path
    requirements: Requirements
    base: Stage | Mechanism
    columns: tuple[Column, ...]

    @cached_property
    def study(self) -> LoadedStudy:
        """The study that evaluates designs by the analytic model."""
        return LoadedStudy(self.path, self.requirements.study, self.base, self.columns, self.path.stem)

    @property
    def stage(self) -> Stage:
        """The base stage of a design that is not of a mechanism."""
        return self.study.stage

    @property
    def solid(self) -> bool:
        """Whether finite elements are in three dimensions, as for a base stage corrected for its thickness."""
        return self.base.model == "corrected"

    @property
    def base_values(self) -> Array:
        """The values (d,) of the base stage, clipped to the ranges of the dimensions."""
        values = []
        for column in self.columns:
            ends = column.factor.values or (column.factor.start or 0.0, column.factor.end or 0.0)
            of_stage = [v for path in column.keys if (v := keys()[path].value_in(self.base)) is not None]
            values.append(float(np.clip(np.mean(of_stage or ends[:1]), min(ends), max(ends))))
        return np.array(values)


def load_requirements(path: PathLike) -> LoadedRequirements:
    """Read a requirements file and its base stage or mechanism.

    Raises BadInput, in one line with file, line and key, for an invalid file, and for an objective that no free
    dimension changes.
    """
    required = validate(Requirements, path)
    stage = base_stage(path, required.study)
    unused = required.study.unused_keys - required.used - ({DENSITY} if required.used & {*MASS} else set())
    columns = columns_of_file(path, "free", required.free, stage, unused)
    require_key_values(path, required.expressions, columns, stage)
    derived = {output.name for output in required.output}
    for index, objective in enumerate(required.objective):
        if all(is_fixed(name, columns, stage) for name in required.names_of(objective.quantity) - derived):
            given = f"objective[{index}].{objective.key} = {shown(objective.quantity)}, expected"
            raise bad_key(path, ("objective", index, objective.key), f"{given} a quantity that free dimensions change")
    loaded = LoadedRequirements(Path(path), required, stage, columns)
    require_extra_numbers(loaded.study)
    return loaded
