"""What a study file says beside its factors: sampling, derived outputs, constraints, correlations, figures."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias, get_args

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from flexfem.arrays import AnyArray, Array
from flexfem.files.quantities import (
    COUNT,
    OF_THE_KEY,
    Rule,
    both,
    either,
    has,
    keywords,
    only,
    ruled,
    says,
    when,
)
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label, Table
from flexfem.study.expression import names_in

Method: TypeAlias = Literal["grid", "latin_hypercube", "sobol", "monte_carlo", "saltelli", "table"]
MOST = 10**9  # designs; a design and 100 columns are a kilobyte
MOST_HELD = 200_000  # designs of a method that holds the whole sample in memory
HELD: tuple[Method, ...] = ("latin_hypercube",)
EXTENSIBLE: tuple[Method, ...] = ("sobol", "monte_carlo", "saltelli")  # more designs begin with the same ones
FigureKind: TypeAlias = Literal["map", "distribution", "sensitivity", "pareto"]
Better: TypeAlias = Literal["larger", "smaller"]
NAME = r"^[A-Za-z][A-Za-z0-9_]{0,59}$"
_KEYS_OF: dict[FigureKind, tuple[tuple[str, ...], tuple[str, ...]]] = {  # needed, possible
    "map": (("x", "y", "value"), ()),
    "distribution": (("values",), ()),
    "sensitivity": (("values",), ()),
    "pareto": (("x", "y"), ("x_better", "y_better", "drawn")),
}


def _require_keys(table: Table, choice: str, needed: tuple[str, ...], possible: tuple[str, ...]) -> None:
    """Refuse a table without a key that a choice needs, or with one that it has no use for."""
    for name in needed:
        if name not in table.model_fields_set:
            raise refusal(f"{name} for {choice}")
    for name in type(table).model_fields:
        if name in table.model_fields_set and name not in (*needed, *possible):
            raise refusal(f"no {name} with {choice}", name)


def _wanted(method: Method) -> tuple[str, ...]:
    """The keys that a method needs beside it; it takes no others."""
    size = {"saltelli": "base"}.get(method, "designs")
    return {"grid": (), "table": ("file",)}.get(method, (size, "seed"))


def _of_method(method: Method) -> Rule:
    held = [{"properties": {"designs": {"maximum": MOST_HELD}}}] if method in HELD else []
    return when(says("method", method), both(has(*_wanted(method)), only("method", *_wanted(method)), *held))


class Sampling(Table):
    """How designs are drawn: `designs` of them, or `base` * (factors + 2) for Saltelli's scheme, from a `seed`; or
    taken from a `file`."""

    model_config = ConfigDict(json_schema_extra=ruled(*(_of_method(method) for method in get_args(Method))))

    method: Method = Field(
        description="`grid`, of which the last factor counts fastest; `latin_hypercube`; `sobol`; `monte_carlo`; "
        "`saltelli`, for sensitivity; or `table`, your own designs",
        examples=["sobol"],
    )
    file: Label | None = Field(
        default=None,
        description="With `table`: your own designs, CSV (commas, points, at most 64 MiB) or Parquet (read one row "
        "group at a time), beside the study file; one row a design, one column a factor, named by its label or key, "
        "in file units. Factors then have a key alone. An edited table is another study",
        examples=["designs.csv"],
    )
    designs: int | None = Field(
        default=None,
        ge=1,
        le=MOST,
        description="How many, drawn by their number wherever that is; of a `latin_hypercube`, held in memory, at most "
        f"{MOST_HELD}. More designs of `sobol`, `monte_carlo` or `saltelli` begin with the same ones, and keep their "
        "parts. A grid has none",
        examples=[256],
    )
    base: int | None = Field(
        default=None,
        ge=2,
        le=MOST,
        description="With `saltelli`, instead: a power of two; there are base × (factors + 2) designs",
        examples=[64],
    )
    seed: int | None = Field(default=None, ge=0, lt=2**63, description="What designs are drawn from", examples=[1])

    @model_validator(mode="after")
    def _keys_of_its_method(self) -> Sampling:
        _require_keys(self, f'method = "{self.method}"', _wanted(self.method), ("method",))
        if self.base is not None and self.base & (self.base - 1):
            raise refusal("a power of two", "base")
        if self.method in HELD and (self.designs or 0) > MOST_HELD:
            raise refusal(f'at most {MOST_HELD} with method = "{self.method}", which holds all in memory', "designs")
        return self


def _expression(text: str) -> str:
    try:
        names_in(text)
    except ValueError as error:
        raise refusal(str(error)) from None
    return text


Expression = Annotated[str, AfterValidator(_expression), keywords(minLength=1)]


class Output(Table):
    """A derived output: a column `name`, arithmetic on other columns and keys, shown with `label` and `unit`."""

    name: str = Field(pattern=NAME, description="Of its column", examples=["kxx_over_ktt"])
    expression: Expression = Field(
        description="Arithmetic on columns and keys, with + - * / ** and brackets, abs, sqrt, exp, log, log10, min, "
        "max; names with blanks in backticks",
        examples=["kxx_n_per_mm / ktt_n_mm_per_rad"],
    )
    label: Label | None = Field(default=None, description="In figures", examples=["Kxx over Ktt"])
    unit: Label | None = Field(default=None, description="In figures", examples=["rad/mm²"])


class Constraint(Table):
    """Ends between which an expression of columns and keys must lie for a design to count."""

    model_config = ConfigDict(json_schema_extra=ruled(either(has("least"), has("most"))))

    value: Expression = Field(
        description="An expression. Of factors and keys alone: a design beyond the ends is `refused` before anything "
        "is solved (not with `saltelli`). Of outputs: it is answered, `feasible` is false in the table, and fronts "
        "and maps leave it out and count it",
        examples=["hinges.base.neck_mm / hinges.base.radius_mm"],
    )
    least: float | None = Field(
        default=None, description="The lower end", examples=[0.05], json_schema_extra=OF_THE_KEY
    )
    most: float | None = Field(default=None, description="The upper end", examples=[0.2], json_schema_extra=OF_THE_KEY)
    label: Label | None = Field(default=None, description="In messages", examples=["t/R of the base hinges"])

    @model_validator(mode="after")
    def _has_an_end(self) -> Constraint:
        if self.least is None and self.most is None:
            raise refusal("least, most or both")
        if self.least is not None and self.most is not None and self.least > self.most:
            raise refusal(f">= {self.least:g}, the least", "most")
        return self

    @property
    def said(self) -> str:
        """What it limits, in the words of the study."""
        return self.label or self.value

    @property
    def expected(self) -> str:
        """Between which ends, in words."""
        ends = (("at least", self.least), ("at most", self.most))
        return " and ".join(f"{word} {end:g}" for word, end in ends if end is not None)

    def broken(self, values: Array) -> AnyArray:
        """Which values (n,) are outside, those that are no finite number among them."""
        low = -np.inf if self.least is None else self.least
        high = np.inf if self.most is None else self.most
        return np.asarray(~(np.isfinite(values) & (values >= low) & (values <= high)))


class Correlation(Table):
    """Two factors, by their columns, and the rank correlation (Spearman's) that they are drawn with."""

    factors: tuple[Label, Label] = Field(
        description="Two columns",
        examples=[["neck of base", "radius of base"]],
        json_schema_extra={"uniqueItems": True},
    )
    coefficient: float = Field(
        gt=-1, lt=1, description="Their rank correlation (Spearman's)", examples=[0.6], json_schema_extra=COUNT
    )

    @model_validator(mode="after")
    def _of_two(self) -> Correlation:
        if self.factors[0] == self.factors[1]:
            raise refusal("another factor than the first", "factors", 1)
        return self


def normal_correlation(columns: list[str], given: tuple[Correlation, ...]) -> Array:
    """Correlation matrix of the normal deviates whose ranks are correlated as `given`; the others are independent.

    Notes
    -----
    `r = 2 sin(pi rho / 6)` for a rank correlation rho of two normal deviates: K. Pearson, On further methods of
    determining correlation (1907).
    """
    matrix = np.eye(len(columns))
    for each in given:
        one, other = (columns.index(name) for name in each.factors)
        matrix[one, other] = matrix[other, one] = 2.0 * np.sin(np.pi * each.coefficient / 6.0)
    return matrix


def _of_kind(kind: FigureKind) -> Rule:
    needed, possible = _KEYS_OF[kind]
    return when(says("kind", kind), both(has(*needed), only("kind", "title", *needed, *possible)))


class Figure(Table):
    """One figure: a map of `value` over `x` and `y`, `values` as histograms or Sobol indices, or a Pareto front."""

    model_config = ConfigDict(json_schema_extra=ruled(*(_of_kind(kind) for kind in get_args(FigureKind))))

    kind: FigureKind = Field(
        description="`map` of an output over two factors, in whose cells means over the other factors are; "
        "`distribution` and `sensitivity` of outputs, not of a grid; or `pareto`, the front of two columns",
        examples=["pareto"],
    )
    title: Label | None = Field(default=None, description="Of the figure", examples=["Stiffness against range"])
    x: Label | None = Field(default=None, description="Column, of a map a factor", examples=["range_x_um"])
    y: Label | None = Field(default=None, description="Another, of a map a factor", examples=["kxx_n_per_mm"])
    value: Label | None = Field(default=None, description="Of a map: the output", examples=["kxx_n_per_mm"])
    values: tuple[Label, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=12,
        description="Of a `distribution` or `sensitivity`: outputs",
        examples=[["kxx_n_per_mm", "range_x_um"]],
        json_schema_extra={"uniqueItems": True},
    )
    x_better: Better = Field(default="larger", description="Of a front: which `x` is wanted")
    y_better: Better = Field(default="larger", description="Of a front: which `y` is wanted")
    drawn: int = Field(default=4, ge=1, le=12, description="Of a front: how many designs are drawn beside it")

    @model_validator(mode="after")
    def _keys_of_its_kind(self) -> Figure:
        needed, possible = _KEYS_OF[self.kind]
        _require_keys(self, f'kind = "{self.kind}"', needed, ("kind", "title", *possible))
        if self.x is not None and self.x == self.y:
            raise refusal("another column than x", "y")
        if self.values is not None and len(set(self.values)) < len(self.values):
            raise refusal("no column twice", "values")
        return self

    @property
    def columns(self) -> dict[tuple[str | int, ...], tuple[str, bool]]:
        """Columns it shows by their key in the file, each with whether it must be an output (else a factor will do)."""
        found: dict[tuple[str | int, ...], tuple[str, bool]] = {}
        for name in ("x", "y", "value"):
            column = getattr(self, name)
            if column is not None:
                found[(name,)] = (column, name == "value")
        return found | {("values", index): (column, True) for index, column in enumerate(self.values or ())}
