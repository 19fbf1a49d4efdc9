"""What a study file says of derived outputs, constraints and correlated factors."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import refusal
from flexfem.files.toml import Table
from flexfem.stage.schema import Label
from flexfem.study.expression import names_in

NAME = r"^[A-Za-z][A-Za-z0-9_]{0,59}$"


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
