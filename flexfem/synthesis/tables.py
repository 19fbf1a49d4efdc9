"""What a requirements file says beside its base stage: free dimensions, requirements, objectives, tolerance."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from flexfem.arrays import Array
from flexfem.files.refusals import refusal
from flexfem.files.toml import Table
from flexfem.stage.schema import Label
from flexfem.study.columns import Factor
from flexfem.study.tables import Expression

MOST_POINTS = 100_000  # of one dimension
ROUND_OFF = 1e-9  # of a step


class Free(Factor):
    """A dimension that is free between two ends, or one of a list; all numbers in the units of the stage file.

    step : it is `from` and a whole number of steps, up to `to`; None leaves it continuous.
    """

    named: ClassVar[tuple[str, ...]] = ("key", "keys", "label", "step")

    step: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _is_a_range_or_a_list(self) -> Free:
        if self.kind not in ("values", "range") or self.points is not None:
            raise refusal("from and to, or values")
        if self.step is None:
            return self
        if self.values is not None:
            raise refusal("no step with values", "step")
        if self.start is not None and self.end is not None and not (self.end - self.start) / self.step >= 1:
            raise refusal(f"at most {self.end - self.start:g}, from end to end", "step")
        if self.start is not None and self.end is not None and (self.end - self.start) / self.step > MOST_POINTS:
            raise refusal(f"at most {MOST_POINTS} steps from end to end", "step")
        return self

    @property
    def allowed(self) -> Array | None:
        """The values (k,) that it may take, rising; None where it is continuous."""
        if self.values is not None:
            return np.sort(np.array(self.values))
        if self.step is None:
            return None
        assert self.start is not None and self.end is not None
        steps = int(np.floor((self.end - self.start) / self.step + ROUND_OFF))
        return np.round(self.start + self.step * np.arange(steps + 1), 12)


class Require(Table):
    """Ends between which a quantity, an expression of columns and keys, must lie.

    label : how it is called in what is printed.
    """

    quantity: Expression
    at_least: float | None = None
    at_most: float | None = None
    label: Label | None = None

    @model_validator(mode="after")
    def _has_an_end(self) -> Require:
        if self.at_least is None and self.at_most is None:
            raise refusal("at_least, at_most or both")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise refusal(f">= {self.at_least:g}, the least", "at_most")
        return self

    @property
    def said(self) -> str:
        """What it limits, in the words of the file."""
        return self.label or self.quantity


class Objective(Table):
    """A quantity that is to be as large, or as small, as can be."""

    maximise: Expression | None = None
    minimise: Expression | None = None
    label: Label | None = None

    @model_validator(mode="after")
    def _goes_one_way(self) -> Objective:
        if (self.maximise is None) == (self.minimise is None):
            raise refusal("either maximise or minimise")
        return self

    @property
    def quantity(self) -> str:
        """The expression."""
        return self.maximise or self.minimise or ""

    @property
    def sign(self) -> float:
        """What turns its value into one that is to be small."""
        return 1.0 if self.maximise is None else -1.0

    @property
    def said(self) -> str:
        """What it is, in the words of the file."""
        return self.label or self.quantity


class Tolerance(Table):
    """Scatter of the nine necks about their widths, each by itself: the largest coupling of 95 % of stages is asked.

    neck_um : standard deviation.   stages : how many are drawn, the same for every design.
    checked : how many of them finite elements solve at the optimum.
    """

    neck_um: float = Field(gt=0, le=1000)
    stages: int = Field(default=64, ge=20, le=1024)
    checked: int = Field(default=0, ge=0, le=1024)
