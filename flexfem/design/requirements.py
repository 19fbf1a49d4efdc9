"""The requirements file: base stage, free dimensions, requirements and objectives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from flexfem.arguments import FINEST
from flexfem.arrays import Array
from flexfem.files.provenance import Assumptions
from flexfem.files.quantities import OF_THE_KEY, AnyNumber, AnyPositive, Limits, Percent, Scatter
from flexfem.files.refusals import KeyPath, refusal, shown
from flexfem.files.tables import Label, Table
from flexfem.files.toml import PathLike, bad_key, validate
from flexfem.hinges.choice import CALIBRATED, DEFAULT_FORMULA, FORMULA, FormulaName, Mobility
from flexfem.mechanism.keys import keys
from flexfem.study.answer import require_extra_numbers
from flexfem.study.columns import ERRORS
from flexfem.study.factors import MANY, NAMED, Column, Factor
from flexfem.study.loaded import LoadedStudy, base_of
from flexfem.study.plan import Asked, Study
from flexfem.study.tables import Expression, Limited, Sampling

MOST_STEPS = 100_000  # of one dimension
ROUND_OFF = 1e-9  # of a step
LARGEST = 1e30  # end of a requirement, in its unit; the smallest one is the inverse
# stages: the maximum of fewer is below the 95 % quantile with a probability of 2.5 % or more
FEWEST = 72
# stages: fewer do not show the scatter of the difference between model and finite elements
LEAST_CHECKED = 8
QUANTITY = "Arithmetic on columns and keys of the base file, as in studies"
MASS = ("mass_kg",)
DENSITY = "material.density_kg_m3"
SCATTERED = ("coupling_xy_95", "coupling_xt_95", "coupling_yt_95", "coupling_95")

End: TypeAlias = Annotated[float, Limits(OF_THE_KEY, ge=-LARGEST, le=LARGEST)]


def _without_keys_of_studies(schema: dict[str, Any]) -> None:
    """Remove the keys of a factor that a free dimension does not have."""
    for key in ("points", "distribution", "mean", "sd", "lower", "upper"):
        del schema["properties"][key]


class Free(Factor):
    """A free dimension, in a range or from a list of values; all numbers in the units of the stage
    file.
    """

    named: ClassVar[tuple[str, ...]] = (*NAMED, "step")

    model_config = ConfigDict(json_schema_extra=_without_keys_of_studies)

    label: Label | None = Field(default=None, examples=["all necks"])
    """Name in the output; by default the key"""
    values: tuple[AnyNumber, ...] | None = Field(
        default=None, min_length=1, max_length=MANY, examples=[[1.5, 2.0, 3.0]]
    )
    """Instead of `from` and `to`: the allowed values"""
    step: AnyPositive | None = Field(default=None, examples=[0.005])
    """Increment of the allowed values from `from` up to `to`; without it the dimension is
    continuous
    """

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


class Require(Limited):
    """A requirement: the limits between which an expression of columns and keys must lie."""

    named: ClassVar[tuple[str, str]] = ("at_least", "at_most")

    quantity: Expression = Field(description=QUANTITY, examples=["kxx_n_per_mm"])
    at_least: End | None = Field(
        default=None,
        description="Lower limit",
        examples=[100.0],
    )
    at_most: End | None = Field(
        default=None, description="Upper limit; one or both are needed", examples=[150.0]
    )
    label: Label | None = Field(default=None, examples=["stiffness in x"])
    """Name in the output"""

    @model_validator(mode="after")
    def _ends_have_a_size(self) -> Require:
        for key, end in (("at_least", self.at_least), ("at_most", self.at_most)):
            if 0 < abs(end or 0.0) < 1 / LARGEST:
                raise refusal(
                    f"zero, or a size of {1 / LARGEST:g} or more: margins are relative to it", key
                )
        return self


class Objective(Table):
    """A quantity to maximise or to minimise."""

    maximise: Expression | None = Field(default=None, examples=["range_x_um"])
    """Expression to maximise"""
    minimise: Expression | None = Field(default=None, examples=["envelope_mm"])
    """Instead of `maximise`: expression to minimise"""
    label: Label | None = Field(default=None, examples=["range at yield in x"])
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


class Tolerance(Table):
    """Independent scatter of the widths of the nine necks."""

    neck_um: Scatter = Field(description="Standard deviation of every neck", examples=[5.0])
    stages: int = Field(
        default=4000,
        ge=FEWEST,
        le=20_000,
    )
    """Random stages in the search, the same for every design; the final couplings are those of
    100,000 other stages
    """
    checked: int = Field(
        default=0,
        ge=0,
        le=1024,
    )
    """Number of the other stages that finite elements solve; 0, or >= 8"""

    @model_validator(mode="after")
    def _checks_enough(self) -> Tolerance:
        if 0 < self.checked < LEAST_CHECKED:
            raise refusal(f"0, or at least {LEAST_CHECKED}", "checked")
        return self


class Requirements(Asked):
    """Contents of a requirements file."""

    kind: ClassVar[str] = "requirements file"
    array: ClassVar[str] = "free"
    subject: ClassVar[str] = "design"

    formula: FormulaName = Field(default=CALIBRATED, description=FORMULA)
    mobility: Mobility | None = Field(default=21, description="Mobility of the analytic model")
    paper_formula: FormulaName = DEFAULT_FORMULA
    """Formula of the model, with the stage's own mobility, whose errors are `error_x_percent` and
    the like
    """
    seed: int = Field(
        ge=0,
        lt=2**63,
        description="Seed of the search",
        examples=[2003],
    )
    accuracy_percent: Percent = 0.1
    """Required agreement of the corrected analytic model and finite elements at the optimum"""
    resolution: int = Field(
        default=8,
        ge=8,
        le=FINEST,
    )
    """Triangles across every neck, of the finest of three meshes"""
    front: int = Field(
        default=7, ge=3, le=50, description="With two objectives: number of designs of their front"
    )
    free: tuple[Free, ...] = Field(min_length=1, max_length=30)
    """Dimensions that may differ from the base stage; numbers in the unit of the key"""
    require: tuple[Require, ...] = Field(
        default=(), max_length=50, description="Requirements on the stage"
    )
    objective: tuple[Objective, ...] = Field(
        min_length=1, max_length=2, description="One or two objectives"
    )
    tolerance: Tolerance | None = None
    """Requests the share of stages that meet all requirements when their nine necks scatter, and
    the 95 % quantiles of the couplings: `coupling_95`, `coupling_xy_95`, `coupling_xt_95`,
    `coupling_yt_95` """

    @model_validator(mode="after")
    def _asks_of_mechanisms(self) -> Requirements:
        if self.ask and not self.on_mechanism:
            raise refusal("no ask in a design of a stage", "ask")
        return self

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Requirements:
        for index, (low, high) in enumerate(each.ends for each in self.require):
            least = low + 0.02 * self.accuracy_percent * max(abs(low), abs(high))
            if np.isfinite([low, high]).all() and high < least:
                expected = f">= {least:.6g}, with both limits twice accuracy_percent apart"
                raise refusal(expected, "require", index, "at_most")
        return self

    @property
    def known(self) -> tuple[str, ...]:
        """Names, besides those of factors, derived outputs and keys, that expressions may use."""
        others = () if self.on_mechanism else (*MASS, *ERRORS)
        return (*self.outputs, *others, *(() if self.tolerance is None else SCATTERED))

    @cached_property
    def study(self) -> Study:
        """The study of the free dimensions by the analytic model."""
        shared = {name: getattr(self, name) for name in Asked.model_fields if name != "provenance"}
        sampling = Sampling(
            method="sobol",
            designs=1,
            seed=0,
        )
        return Study.model_construct(
            **shared, model="analytic", sampling=sampling, factor=self.free
        )

    @property
    def expressions(self) -> dict[KeyPath, str]:
        """All expressions by their key paths, derived outputs first."""
        found = super().expressions | {
            ("require", k, "quantity"): each.quantity for k, each in enumerate(self.require)
        }
        return found | {
            ("objective", k, each.key): each.quantity for k, each in enumerate(self.objective)
        }

    @property
    def quantities(self) -> tuple[str, ...]:
        """Expressions of the objectives, then of the requirements."""
        return (
            *(each.quantity for each in self.objective),
            *(each.quantity for each in self.require),
        )

    @cached_property
    def used(self) -> frozenset[str]:
        """Names in the quantities and in the derived outputs that these use."""
        return self.names_of(*self.quantities)

    @property
    def unused_keys(self) -> frozenset[str]:
        """Key paths of material and frame on which no quantity depends."""
        return super().unused_keys - self.used - ({DENSITY} if self.used & {*MASS} else set())

    def title_of(self, requested: Objective | Require) -> str:
        """Return the label of a quantity; without one, that of the derived output that it names, or
        the expression.
        """
        labels = {output.name: output.label for output in self.output}
        return requested.label or labels.get(requested.quantity) or requested.quantity

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source; the accuracy and derived outputs need none."""
        return tuple(
            path for path in super().numbers if not path.startswith(("accuracy_percent", "output"))
        )


@dataclass(frozen=True, kw_only=True)
class LoadedRequirements(LoadedStudy):
    """Requirements with their feasible base, and the study of the free dimensions as columns with
    stars expanded.
    """

    requirements: Requirements

    @property
    def assumptions(self) -> Assumptions:
        """Key paths of the numbers of stage and requirements that are assumed or not stated."""
        return self.assumptions_with("requirements", self.requirements)

    @property
    def solid(self) -> bool:
        """Whether finite elements are in three dimensions, as for a base stage corrected for its
        thickness.
        """
        return self.base.model == "corrected"

    @property
    def base_values(self) -> Array:
        """The values (d,) of the base stage, clipped to the ranges of the dimensions."""
        return np.array([self._base_value(column) for column in self.columns])

    def _base_value(self, column: Column) -> float:
        factor = column.factor
        ends = factor.values or (factor.start or 0.0, factor.end or 0.0)
        of_base = [keys()[path].value_in(self.base) for path in column.keys]
        stated = [value for value in of_base if value is not None]
        return float(np.clip(np.mean(stated or ends[:1]), min(ends), max(ends)))


def load_requirements(path: PathLike) -> LoadedRequirements:
    """Read a requirements file and its base stage or mechanism.

    Raises BadInput, in one line with file, line and key, for an invalid file, and for an objective
    that no free dimension changes."""
    required = validate(Requirements, path)
    file = Path(path)
    family = base_of(path, required, required.study)
    derived = {output.name for output in required.output}
    for index, objective in enumerate(required.objective):
        names = required.names_of(objective.quantity) - derived
        if all(family.is_fixed(name) for name in names):
            given = f"objective[{index}].{objective.key} = {shown(objective.quantity)}, expected"
            raise bad_key(
                path,
                ("objective", index, objective.key),
                f"{given} a quantity that free dimensions change",
            )
    loaded = LoadedRequirements(
        path=file,
        study=required.study,
        base=family.base,
        columns=family.columns,
        stem=file.stem,
        requirements=required,
    )
    require_extra_numbers(loaded)
    return loaded
