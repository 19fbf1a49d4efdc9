"""A study file: base stage, factors, sampling, and which model answers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, model_validator

from flexfem.analytic.model import DEFAULT_FORMULA
from flexfem.files import quantities
from flexfem.files.json_schema import ruled
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import refusal, shown
from flexfem.files.toml import Label
from flexfem.mechanism.keys import keys, meant
from flexfem.questions import warnings as warning
from flexfem.study.asked import Drifting, DriveQuestion, Frequencies, Lasting
from flexfem.study.columns import Factor, columns_of, unasked
from flexfem.study.expression import names_in
from flexfem.study.outputs import FEASIBLE, RESERVED, outputs_of
from flexfem.study.rules import APPLIES, require_correlated, require_sampled, require_shown, require_unlike, rules
from flexfem.study.tables import MOST, Constraint, Correlation, Figure, Output, Sampling
from flexfem.verify.case import ELASTIC, FORMULA, OF_MODEL, FormulaName, Mobility


class Study(Sourced):
    """What a study file says."""

    model_config = ConfigDict(json_schema_extra=ruled(*rules()))

    kind: ClassVar[str] = "study file"

    name: Label = Field(description="Title of figures", examples=["Stiffness against range at yield"])
    stage: Label = Field(description="File of the base stage, relative to the study's", examples=["stage.toml"])
    model: Literal["analytic", "fe", "verify", "three_dimensional"] = Field(
        description="What answers: `analytic`; `fe`, finite elements in the stage's plane model; "
        "`three_dimensional`, of the stage extruded; `verify`, the error percentages of the one against the other",
        examples=["analytic"],
    )
    formula: FormulaName = Field(default=DEFAULT_FORMULA, description=f"{FORMULA}; with `analytic` and `verify`")
    mobility: Mobility | None = Field(
        default=None, description=f"{OF_MODEL}; with `analytic` and `verify`", examples=[6]
    )
    links: bool = Field(default=False, description=f"{ELASTIC}, with `analytic`; one design after the other, slower")
    resolution: int = Field(
        default=4, ge=4, le=64, description="Triangles across every neck, with `fe`, `verify`, `three_dimensional`"
    )
    layers: int = Field(
        default=2,
        ge=1,
        le=16,
        description="In half the thickness, with `three_dimensional`: 2 is 0.2 % off on the reference stages, 2 s a "
        "design with alike chains, 6 s with unlike ones; 3 is 0.1 % off, 4 s and 10 s",
    )
    bands: bool = Field(
        default=True, description="Whether `verify` finds the mesh band of each percentage, from three meshes"
    )
    check: Literal["closed_form", "drawing"] | None = Field(
        default=None,
        description="Whether every design is drawn to see that no bodies overlap; by default `closed_form` with "
        "`analytic`, and what is meshed is always drawn",
    )
    time_limit: Annotated[float, *quantities.above_zero(quantities.TIME)] = Field(
        default=60.0,
        alias="time_limit_s",
        description="For one design of `fe`, `verify`, `three_dimensional` (meshing only); a worker that takes 10 s "
        "longer is killed and replaced, on this machine or of Dask. Counted from when the worker has loaded the "
        "design; time in which it, or the whole run, is stopped does not count",
    )
    sampling: Sampling = Field(description="Which designs. At most 10^9 of them")
    factor: tuple[Factor, ...] = Field(
        min_length=1, max_length=100, description="What differs between designs; numbers in the unit of the key"
    )
    correlation: tuple[Correlation, ...] = Field(
        default=(),
        max_length=500,
        description="Two factors that go together, by a Gaussian copula: every factor keeps its distribution. Not with "
        "`saltelli` (Sobol indices split the variance among independent factors), `grid` or `table`",
    )
    drive: DriveQuestion | None = Field(default=None, description="Asks how far a drive goes")
    frequencies: Frequencies | None = Field(
        default=None,
        description="Asks for natural frequencies in the plane, with a payload or without; the table may be empty. "
        "`material.density_kg_m3` is then a key that factors can set. Every design is drawn, some 5 ms each. Not with "
        "`three_dimensional`",
    )
    life: Lasting | None = Field(
        default=None,
        description="Asks for fatigue lives at an amplitude of the pose. The material needs fatigue constants, which "
        "factors can then set. Not with `three_dimensional`",
    )
    drift: Drifting | None = Field(
        default=None,
        description="Asks for the drift with temperature; the table has no keys. The stage must "
        "state both coefficients of expansion, which factors can then set: `material.expansion_um_per_m_k`, "
        "`frame.expansion_um_per_m_k`. With `links` every pad is drawn, up to 0.15 s a design more. Not with "
        "`three_dimensional`",
    )
    output: tuple[Output, ...] = Field(
        default=(), max_length=50, description="A derived output, found from the answers when the table is collected"
    )
    constraint: tuple[Constraint, ...] = Field(
        default=(), max_length=50, description="Ends for an expression, between which a design counts"
    )
    figure: tuple[Figure, ...] = Field(default=(), max_length=50, description="What `flexfem study plot` draws")

    @model_validator(mode="after")
    def _keys_of_its_model(self) -> Study:
        for name, field in type(self).model_fields.items():
            key = field.alias or name
            if name in self.model_fields_set and self.model not in APPLIES.get(key, (self.model,)):
                raise refusal(f'no {key} with model = "{self.model}"', key)
        if self.links and self.mobility != 21:
            raise refusal("mobility = 21 with it: elastic links go with all freedoms of the hinges", "links")
        if self.check == "closed_form" and self.model != "analytic":
            raise refusal("drawing: what is meshed is drawn first", "check")
        return self

    @model_validator(mode="after")
    def _drive_is_of_its_model(self) -> Study:
        if self.driven and self.model == "three_dimensional":
            expected = 'no actuators with model = "three_dimensional": a drive is solved in the plane'
            raise refusal(expected, "drive", "actuators")
        for index, factor in enumerate(self.factor):
            if not self.driven and any(keys()[path].of_drive for path in factor.paths):
                expected = "[drive] actuators = true with a number of an actuator: no other output depends on it"
                raise refusal(expected, "factor", index)
        return self

    @model_validator(mode="after")
    def _factors_fit(self) -> Study:
        require_sampled(self.factor, self.sampling.method)
        if self.sampling.method == "grid" and self.count > MOST:
            raise refusal(f"a grid of at most {MOST} designs, not {self.count}", "factor")
        if self.sampling.base is not None and self.count > MOST:
            raise refusal(f"base * (factors + 2) of at most {MOST}, not {self.count}", "sampling", "base")
        require_unlike(self.factor, self.outputs)
        return self

    @model_validator(mode="after")
    def _expressions_name_columns(self) -> Study:
        names = {column.name for column in columns_of(self.factor)}
        taken = {*RESERVED, FEASIBLE, *self.outputs, *names, *keys()}
        known = {*names, *self.outputs}
        for index, output in enumerate(self.output):
            if output.name in taken:
                raise refusal(f"a name of its own, not {shown(output.name)} again", "output", index, "name")
            _require_known(output.expression, known, "output", index, "expression")
            taken.add(output.name)
            known.add(output.name)
        for index, constraint in enumerate(self.constraint):
            _require_known(constraint.value, known, "constraint", index, "value")
            if self.sampling.method == "saltelli" and self.is_given(constraint.value):
                expected = 'an output in it with method = "saltelli": refused designs would make the factors dependent'
                raise refusal(expected, "constraint", index, "value")
        return self

    @model_validator(mode="after")
    def _what_is_shown_fits(self) -> Study:
        require_correlated(self.correlation, self.factor, self.sampling.method)
        require_shown(self.figure, self.factor, self.every_output, self.sampling.method)
        return self

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source, not those that only set up the computation."""
        return tuple(path for path in super().numbers if path != "time_limit_s")

    @property
    def count(self) -> int:
        """Number of designs."""
        columns = columns_of(self.factor)
        if self.sampling.method == "grid":
            return math.prod(column.factor.points or len(column.factor.values or ()) for column in columns)
        if self.sampling.base is not None:
            return self.sampling.base * (len(columns) + 2)
        return self.sampling.designs or 0

    @property
    def rotation(self) -> float | None:
        """How far a base hinge may turn, rad; None without a drive."""
        return None if self.drive is None else self.drive.rotation

    @property
    def driven(self) -> bool:
        """Whether it asks about the actuators of the base stage."""
        return self.drive is not None and self.drive.actuators

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        asked = self.rotation is not None, self.model == "verify", self.bands, self.driven
        moved = None if self.life is None else self.life.moved
        return outputs_of(*asked, self.frequencies is not None, moved, self.drift is not None)

    @property
    def unasked(self) -> frozenset[str]:
        """Key paths of material and frame that none of its answers depends on."""
        return unasked(self.frequencies is not None, self.life is not None, self.drift is not None)

    @property
    def stress_below(self) -> str:
        """By how much, at most, the highest neck stress is low by the mesh, in words; "" without one."""
        return "" if self.model == "analytic" else warning.stress_below(self.resolution)

    @property
    def every_output(self) -> tuple[str, ...]:
        """Names of the output columns and of the derived ones."""
        return (*self.outputs, *(output.name for output in self.output))

    def is_given(self, expression: str) -> bool:
        """Whether an expression needs no answer of the model: factors and keys alone."""
        derived = {output.name: output.expression for output in self.output}
        used = names_in(expression)
        return all(self.is_given(derived[name]) if name in derived else name not in self.outputs for name in used)

    def in_full(self, expression: str) -> list[str]:
        """An expression, and those of the derived outputs that it uses."""
        derived = {output.name: output.expression for output in self.output}
        used = (self.in_full(derived[name]) for name in names_in(expression) if name in derived)
        return [expression, *(text for each in used for text in each)]

    @property
    def draws(self) -> bool:
        """Whether the bodies of every design are drawn, to see that none overlap."""
        return (self.check or ("closed_form" if self.model == "analytic" else "drawing")) == "drawing"


def _require_known(expression: str, known: Iterable[str], *at: str | int) -> None:
    names = set(known)
    for name in names_in(expression):
        if name not in names and name not in keys():
            expected = f"columns and keys by name, not {shown(name)}{meant(name, sorted({*names, *keys()}))}"
            raise refusal(expected, *at)
