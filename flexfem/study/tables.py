"""What a study file says beside its factors: sampling, drive, derived outputs, constraints, correlations, figures."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import refusal
from flexfem.files.toml import Table
from flexfem.stage.schema import Label
from flexfem.study.expression import names_in

Method: TypeAlias = Literal["grid", "latin_hypercube", "sobol", "monte_carlo", "saltelli", "table"]
MOST = 10**9  # designs; a design and 100 columns are a kilobyte
FARTHEST = 1e5  # um, mrad: as of `flexfem life`
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


class Sampling(Table):
    """How designs are drawn: `designs` of them, or `base` * (factors + 2) for Saltelli's scheme, from a `seed`; or
    taken from a `file`."""

    method: Method
    file: Label | None = None
    designs: int | None = Field(default=None, ge=1, le=MOST)
    base: int | None = Field(default=None, ge=2, le=MOST)
    seed: int | None = Field(default=None, ge=0, lt=2**63)

    @model_validator(mode="after")
    def _keys_of_its_method(self) -> Sampling:
        size = {"saltelli": "base"}.get(self.method, "designs")
        wanted = {"grid": (), "table": ("file",)}.get(self.method, (size, "seed"))
        _require_keys(self, f'method = "{self.method}"', wanted, ("method",))
        if self.base is not None and self.base & (self.base - 1):
            raise refusal("a power of two", "base")
        if self.method in HELD and (self.designs or 0) > MOST_HELD:
            raise refusal(f'at most {MOST_HELD} with method = "{self.method}", which holds all in memory', "designs")
        return self


class Drive(Table):
    """Which drive a study asks about: the base stage's own actuators, or a stroke that turns the base hinges alone.

    actuators : ask about the actuators of the base stage.
    stroke_um, lever_arm_mm : of a piezo, and from the base hinge to where it pushes link 1, in units of the file.
    """

    actuators: bool = False
    stroke_um: float | None = Field(default=None, gt=0, le=1e6)
    lever_arm_mm: float | None = Field(default=None, gt=0, le=1e4)

    @model_validator(mode="after")
    def _asks_something(self) -> Drive:
        both = {"stroke_um": self.stroke_um, "lever_arm_mm": self.lever_arm_mm}
        missing = [key for key, value in both.items() if value is None]
        if len(missing) == 1:
            raise refusal(f"stroke_um and lever_arm_mm together: {missing[0]} is missing")
        if missing and not self.actuators:
            raise refusal("actuators = true, or stroke_um and lever_arm_mm")
        return self

    @property
    def rotation(self) -> float | None:
        """Largest rotation of a base hinge, rad; None where no stroke is given."""
        if self.stroke_um is None or self.lever_arm_mm is None:
            return None
        return 1e-3 * self.stroke_um / self.lever_arm_mm


class Frequencies(Table):
    """Natural frequencies of the platform in the plane are asked for, with a payload on it or without.

    payload_kg, payload_kg_mm2 : mass, and moment of inertia about the platform centre, in units of the file.
    """

    payload_kg: float = Field(default=0.0, ge=0, le=1e4)
    payload_kg_mm2: float = Field(default=0.0, ge=0, le=1e10)


class Drifting(Table):
    """Pose by a change of temperature, and the largest by its gradients, are asked for; it has no keys."""


class Lasting(Table):
    """Fatigue lives are asked for, at an amplitude of the platform, and the amplitude for a wanted life.

    amplitude_... : of the pose about its mean, in units of the file.   ratio : least over greatest displacement.
    cycles : the wanted life.   notch_sensitivity : see `fatigue.counted`.
    """

    amplitude_x_um: float = Field(default=0.0, ge=-FARTHEST, le=FARTHEST)
    amplitude_y_um: float = Field(default=0.0, ge=-FARTHEST, le=FARTHEST)
    amplitude_theta_mrad: float = Field(default=0.0, ge=-FARTHEST, le=FARTHEST)
    ratio: float = Field(default=-1.0, ge=-1, le=0.99)
    cycles: float = Field(default=1e6, gt=0, le=1e12)
    notch_sensitivity: float = Field(default=1.0, ge=0, le=1)

    @model_validator(mode="after")
    def _moves(self) -> Lasting:
        if not any(self.moved):
            raise refusal("amplitude_x_um, amplitude_y_um or amplitude_theta_mrad, other than zero")
        return self

    @property
    def amplitude(self) -> tuple[float, float, float]:
        """Amplitude of the pose, mm, mm, rad."""
        return 1e-3 * self.amplitude_x_um, 1e-3 * self.amplitude_y_um, 1e-3 * self.amplitude_theta_mrad

    @property
    def moved(self) -> tuple[bool, ...]:
        """Which directions the amplitude has."""
        return tuple(each != 0 for each in self.amplitude)


def _expression(text: str) -> str:
    try:
        names_in(text)
    except ValueError as error:
        raise refusal(str(error)) from None
    return text


Expression = Annotated[str, AfterValidator(_expression)]


class Output(Table):
    """A derived output: a column `name`, arithmetic on other columns and keys, shown with `label` and `unit`."""

    name: str = Field(pattern=NAME)
    expression: Expression
    label: Label | None = None
    unit: Label | None = None


class Constraint(Table):
    """Ends between which an expression of columns and keys must lie for a design to count."""

    value: Expression
    least: float | None = None
    most: float | None = None
    label: Label | None = None

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

    factors: tuple[Label, Label]
    coefficient: float = Field(gt=-1, lt=1)

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


class Figure(Table):
    """One figure: a map of `value` over `x` and `y`, `values` as histograms or Sobol indices, or a Pareto front."""

    kind: FigureKind
    title: Label | None = None
    x: Label | None = None
    y: Label | None = None
    value: Label | None = None
    values: tuple[Label, ...] | None = Field(default=None, min_length=1, max_length=12)
    x_better: Better = "larger"
    y_better: Better = "larger"
    drawn: int = Field(default=4, ge=1, le=12)

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
