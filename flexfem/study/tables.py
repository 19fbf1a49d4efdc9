"""Tables of study files: sampling, outputs, constraints, correlations, figures, questions of a
stage.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from flexfem.arrays import AnyArray, Array
from flexfem.files import quantities
from flexfem.files.expressions import names_in
from flexfem.files.refusals import refusal
from flexfem.files.tables import Label, Table
from flexfem.study.factors import require_keys

Method: TypeAlias = Literal["grid", "latin_hypercube", "sobol", "monte_carlo", "saltelli", "table"]
MOST = 10**9  # designs; one design with 100 columns takes a kilobyte
MOST_HELD = 200_000  # designs of a Latin hypercube, which is held in memory
FigureKind: TypeAlias = Literal["map", "distribution", "sensitivity", "pareto"]
Better: TypeAlias = Literal["larger", "smaller"]
NAME = r"^[A-Za-z][A-Za-z0-9_]{0,59}$"
# required and optional keys
_KEYS_OF: dict[FigureKind, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "map": (("x", "y", "value"), ()),
    "distribution": (("values",), ()),
    "sensitivity": (("values",), ()),
    "pareto": (("x", "y"), ("x_better", "y_better", "drawn")),
}
# required keys of a method; it takes no others
_SAMPLING_KEYS: dict[Method, tuple[str, ...]] = {
    "grid": (),
    "table": ("file",),
    "saltelli": ("base", "seed"),
    "latin_hypercube": ("designs", "seed"),
    "sobol": ("designs", "seed"),
    "monte_carlo": ("designs", "seed"),
}


class Sampling(Table):
    """How designs are sampled: `designs` of them, or `base` * (factors + 2) for Saltelli's scheme,
    drawn from a `seed`; or all designs of a `file`."""

    method: Method = Field(examples=["sobol"])
    """`grid`, in which the last factor varies fastest; `latin_hypercube`; `sobol`; `monte_carlo`;
    `saltelli`, for sensitivity; or `table`, your own designs """
    file: Label | None = Field(default=None, examples=["designs.csv"])
    """With `table`: file of your own designs, CSV (commas, decimal points, at most 64 MiB) or
    Parquet (at most 2 GiB), relative to the study file. One row a design; one column a factor,
    named by its label or key, in file units. Factors then have neither values nor a range or
    distribution. An edited table makes another study """
    designs: int | None = Field(
        default=None,
        ge=1,
        le=MOST,
        examples=[256],
    )
    """Number of designs; at most 200000 of a `latin_hypercube`, which is held in memory. A larger
    number with `sobol`, `monte_carlo` or `saltelli` begins with the same designs, so finished parts
    stay valid. Not with a grid """
    base: int | None = Field(
        default=None,
        ge=2,
        le=MOST,
        examples=[64],
    )
    """With `saltelli`, instead of `designs`: a power of two; there are base × (factors + 2) designs
    """
    seed: int | None = Field(
        default=None,
        ge=0,
        lt=2**63,
        examples=[1],
    )
    """Seed of the random numbers"""

    @model_validator(mode="after")
    def _keys_fit_method(self) -> Sampling:
        require_keys(self, f'method = "{self.method}"', _SAMPLING_KEYS[self.method], ("method",))
        if self.base is not None and self.base & (self.base - 1):
            raise refusal("a power of two", "base")
        if self.method == "latin_hypercube" and (self.designs or 0) > MOST_HELD:
            raise refusal(
                f'at most {MOST_HELD} with method = "{self.method}", which holds all in memory',
                "designs",
            )
        return self


def _expression(text: str) -> str:
    try:
        names = names_in(text)
    except ValueError as error:
        raise refusal(str(error)) from None
    if not names:
        raise refusal("the name of a column or key, not numbers alone")
    return text


Expression = Annotated[str, AfterValidator(_expression), Field(json_schema_extra={"minLength": 1})]


class Output(Table):
    """A derived output: a column computed from other columns and keys, shown with `label` and
    `unit`.
    """

    name: str = Field(pattern=NAME, examples=["kxx_over_ktt"])
    """Name of its column"""
    expression: Expression = Field(examples=["kxx_n_per_mm / ktt_n_mm_per_rad"])
    """Arithmetic on columns and keys, with + - * / ** and brackets, abs, sqrt, exp, log, log10,
    min, max; names with spaces in backticks """
    label: Label | None = Field(default=None, examples=["Kxx over Ktt"])
    """Name in figures"""
    unit: Label | None = Field(default=None, examples=["rad/mm²"])
    """Unit in figures"""


def limits_text(least: float | None, most: float | None) -> str:
    """Return both limits as text."""
    return " and ".join(
        f"{word} {end:g}"
        for word, end in (("at least", least), ("at most", most))
        if end is not None
    )


class Limited(Table):
    """A table with a lower limit of an expression, an upper one, or both; `named` are their keys."""

    named: ClassVar[tuple[str, str]]

    @model_validator(mode="after")
    def _has_an_end(self) -> Self:
        least, most = self.named
        if getattr(self, least) is None and getattr(self, most) is None:
            raise refusal(f"{least}, {most} or both")
        low, high = self.ends
        if low > high:
            raise refusal(f">= {low:g}, the lower limit", most)
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Both limits, infinite where there is none."""
        low, high = (getattr(self, name) for name in self.named)
        return -np.inf if low is None else low, np.inf if high is None else high


class Constraint(Limited):
    """Limits of an expression of columns and keys that a feasible design must keep."""

    named: ClassVar[tuple[str, str]] = ("least", "most")

    value: Expression = Field(examples=["hinges.base.neck_mm / hinges.base.radius_mm"])
    """An expression. If it uses factors and keys only, a design outside the limits is `refused`
    before it is solved (not with `saltelli`). If it uses outputs, the design is solved, `feasible`
    is false in the table, and fronts and maps leave it out and state the number of such designs """
    least: quantities.Unlimited | None = Field(default=None, examples=[0.05])
    """Lower limit"""
    most: quantities.Unlimited | None = Field(default=None, examples=[0.2])
    """Upper limit"""
    label: Label | None = Field(default=None, examples=["t/R of the base hinges"])
    """Name in messages"""

    @property
    def title(self) -> str:
        """The label, by default the expression."""
        return self.label or self.value

    @property
    def expected(self) -> str:
        """The limits as text."""
        return limits_text(self.least, self.most)

    def broken(self, values: Array) -> AnyArray:
        """Return which values (n,) are outside the limits or not finite."""
        low, high = self.ends
        return np.asarray(~(np.isfinite(values) & (values >= low) & (values <= high)))


class Correlation(Table):
    """Spearman's rank correlation with which two factors are drawn."""

    factors: tuple[Label, Label] = Field(
        examples=[["neck of base", "radius of base"]], json_schema_extra={"uniqueItems": True}
    )
    """Columns of the two factors"""
    coefficient: Annotated[float, quantities.Limits(quantities.COUNT, gt=-1, lt=1)] = Field(
        examples=[0.6]
    )
    """Rank correlation (Spearman's)"""

    @model_validator(mode="after")
    def _factors_differ(self) -> Correlation:
        if self.factors[0] == self.factors[1]:
            raise refusal("a factor other than the first", "factors", 1)
        return self


def normal_correlation(columns: list[str], given: tuple[Correlation, ...]) -> Array:
    """Return the correlation matrix of the normal deviates of columns; their ranks have the `given`
    correlations.

    `r = 2 sin(pi rho / 6)` for a rank correlation: K. Pearson, On further methods of determining
    correlation (1907)."""
    matrix = np.eye(len(columns))
    for correlation in given:
        i, j = (columns.index(name) for name in correlation.factors)
        matrix[i, j] = matrix[j, i] = 2.0 * np.sin(np.pi * correlation.coefficient / 6.0)
    return matrix


class Figure(Table):
    """One figure: a map of `value` over `x` and `y`, `values` as histograms or Sobol indices, or a
    Pareto front.
    """

    kind: FigureKind = Field(examples=["pareto"])
    """`map` of an output over two factors, averaged in cells if other factors vary too;
    `distribution` or `sensitivity` of outputs, not with a grid; or `pareto`, the front of two
    columns """
    title: Label | None = Field(default=None, examples=["Stiffness against range"])
    """Title of the figure"""
    x: Label | None = Field(default=None, examples=["range_x_um"])
    """Column on the x axis; a factor in a map"""
    y: Label | None = Field(default=None, examples=["kxx_n_per_mm"])
    """Another column, on the y axis; a factor in a map"""
    value: Label | None = Field(default=None, examples=["kxx_n_per_mm"])
    """The output of a `map`"""
    values: tuple[Label, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=12,
        examples=[["kxx_n_per_mm", "range_x_um"]],
        json_schema_extra={"uniqueItems": True},
    )
    """Outputs of a `distribution` or `sensitivity`"""
    x_better: Better = "larger"
    """Which `x` is better, in a `pareto`"""
    y_better: Better = "larger"
    """Which `y` is better, in a `pareto`"""
    drawn: int = Field(
        default=4,
        ge=1,
        le=12,
    )
    """How many designs of the front are drawn beside a `pareto`"""

    @model_validator(mode="after")
    def _keys_fit_kind(self) -> Figure:
        required, optional = _KEYS_OF[self.kind]
        require_keys(self, f'kind = "{self.kind}"', required, ("kind", "title", *optional))
        if self.x is not None and self.x == self.y:
            raise refusal("a column other than x", "y")
        if self.values is not None and len(set(self.values)) < len(self.values):
            raise refusal("each column once", "values")
        return self

    @property
    def columns(self) -> dict[tuple[str | int, ...], tuple[str, bool]]:
        """Columns of the figure by their key path in its table, each with whether it must be an
        output.
        """
        columns: dict[tuple[str | int, ...], tuple[str, bool]] = {}
        for name in ("x", "y", "value"):
            column = getattr(self, name)
            if column is not None:
                columns[(name,)] = (column, name == "value")
        return columns | {
            ("values", index): (column, True) for index, column in enumerate(self.values or ())
        }

    @property
    def names(self) -> list[str]:
        """Names of the columns of the figure."""
        return [column for column, _ in self.columns.values()]


class DriveQuestion(Table):
    """Drive of the study: the actuators of the base stage, or a stroke that rotates the base hinges
    only.
    """

    actuators: bool = False
    """Adds outputs such as `drive_range_x_um` and `engaged_kxx_n_per_mm`, from the `[[actuator]]`
    tables of the base stage; not with `three_dimensional`. Factors can then set the numbers that an
    actuator states: `actuator.base.arm_mm`, or `override.2.actuator.base.preload_n` on one chain (a
    star for the chain). A change of the drive makes another study. Contacts on straight links are
    placed for all designs at once; with a bent link, or with `point_mm`, every geometry is drawn, 6
    ms each """
    stroke_um: quantities.CommandUm | None = Field(default=None, examples=[17.4])
    """Stroke of a piezo, for the travels. They depend on the base hinges only and are not the range
    of a drive
    """
    lever_arm_mm: quantities.Length | None = Field(default=None, examples=[10.0])
    """Distance from the base hinge to the contact of this piezo on link 1"""

    @model_validator(mode="after")
    def _asks_something(self) -> DriveQuestion:
        if (self.stroke_um is None) != (self.lever_arm_mm is None):
            missing = "stroke_um" if self.stroke_um is None else "lever_arm_mm"
            raise refusal(f"stroke_um and lever_arm_mm together: {missing} is missing")
        if self.stroke_um is None and not self.actuators:
            raise refusal("actuators = true, or stroke_um and lever_arm_mm")
        return self


class Frequencies(Table):
    """Natural frequencies of the platform in the plane, with or without a payload."""

    payload_kg: quantities.Kilograms = Field(default=0.0, examples=[0.2])
    """Mass of the payload, at the centre of the platform"""
    payload_kg_mm2: quantities.KilogramsMm2 = Field(default=0.0, examples=[40.0])
    """Moment of inertia of the payload about the centre of the platform"""


class DriftTable(Table):
    """Drift of the pose by a uniform change of temperature and by its gradients; the table has no
    keys.
    """


class LifeTable(Table):
    """Fatigue life at an amplitude of the pose about its mean, and the amplitude for a required
    life.
    """

    amplitude_x_um: quantities.Amplitude = Field(default=0.0, examples=[20.0])
    """Amplitude of the pose in x; at least one of the three amplitudes is needed"""
    amplitude_y_um: quantities.Amplitude = Field(default=0.0, examples=[20.0])
    """Amplitude of the pose in y"""
    amplitude_theta_mrad: quantities.Amplitude = Field(default=0.0, examples=[0.5])
    """Amplitude of the pose in theta"""
    ratio: Annotated[float, quantities.Limits(quantities.COUNT, ge=-1, le=0.99)] = -1.0
    """Ratio of the least to the greatest displacement"""
    cycles: quantities.Cycles = 1e6
    """The required life"""
    notch_sensitivity: Annotated[float, quantities.Limits(quantities.COUNT, ge=0, le=1)] = 1.0
    """Share of the stress concentration that is effective: 0 none, 1 all"""

    @model_validator(mode="after")
    def _has_an_amplitude(self) -> LifeTable:
        if not any(self.amplitude):
            raise refusal("amplitude_x_um, amplitude_y_um or amplitude_theta_mrad, other than zero")
        return self

    @property
    def amplitude(self) -> tuple[float, float, float]:
        """Amplitude of the pose, mm, mm, rad."""
        return (
            1e-3 * self.amplitude_x_um,
            1e-3 * self.amplitude_y_um,
            1e-3 * self.amplitude_theta_mrad,
        )
