"""What a requirements file says beside its base stage: free dimensions, requirements, objectives, tolerance."""

from __future__ import annotations

from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from flexfem.arrays import Array
from flexfem.files import quantities
from flexfem.files.quantities import OF_THE_KEY, Rule, either, has, ruled, when, without
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label, Table
from flexfem.study.factors import MANY, Factor, Number, Step
from flexfem.study.plan import Expression

MOST_POINTS = 100_000  # of one dimension
ROUND_OFF = 1e-9  # of a step
FARTHEST = 1e30  # of an end, in its unit; and one over the least
Scatter: TypeAlias = Annotated[float, *quantities.above_zero(quantities.TOLERANCE)]
FEWEST = 72  # stages: of fewer, all are below their 95 % value with a probability of 2.5 % or more
LEAST_CHECKED = 8  # stages: fewer do not show how model and finite elements differ from stage to stage
QUANTITY = "Arithmetic on columns and keys of the stage file, as in studies"


def _of_studies_alone(schema: Rule) -> None:
    """Leave out the keys of a factor that no free dimension takes."""
    for key in ("points", "distribution", "mean", "sd", "lower", "upper"):
        del schema["properties"][key]


class Free(Factor):
    """A dimension that is free between two ends, or one of a list; all numbers in the units of the stage file."""

    named: ClassVar[tuple[str, ...]] = ("key", "keys", "label", "step")

    model_config = ConfigDict(
        json_schema_extra=ruled(
            when(has("key"), without("keys"), has("keys")),
            when(has("values"), without("from", "to", "scale", "step"), has("from", "to")),
            also=_of_studies_alone,
        )
    )

    label: Label | None = Field(
        default=None, description="How it is called in what is printed; by default the key", examples=["all necks"]
    )
    values: tuple[Number, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=MANY,
        description="Instead of `from` and `to`: a list, of which it is one",
        examples=[[1.5, 2.0, 3.0]],
    )
    step: Step | None = Field(
        default=None,
        description="It is `from` and a whole number of these, up to `to`; left out it is continuous",
        examples=[0.005],
    )

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
    """Ends between which a quantity, an expression of columns and keys, must lie."""

    model_config = ConfigDict(json_schema_extra=ruled(either(has("at_least"), has("at_most"))))

    quantity: Expression = Field(description=QUANTITY, examples=["kxx_n_per_mm"])
    at_least: float | None = Field(
        default=None,
        ge=-FARTHEST,
        le=FARTHEST,
        description="The lower end",
        examples=[100.0],
        json_schema_extra=OF_THE_KEY,
    )
    at_most: float | None = Field(
        default=None,
        ge=-FARTHEST,
        le=FARTHEST,
        description="The upper end; one of both or both",
        examples=[150.0],
        json_schema_extra=OF_THE_KEY,
    )
    label: Label | None = Field(
        default=None, description="How it is called in what is printed", examples=["stiffness in X"]
    )

    @model_validator(mode="after")
    def _has_an_end(self) -> Require:
        if self.at_least is None and self.at_most is None:
            raise refusal("at_least, at_most or both")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise refusal(f">= {self.at_least:g}, the least", "at_most")
        for key in ("at_least", "at_most"):
            if 0 < abs(getattr(self, key) or 0.0) < 1 / FARTHEST:
                raise refusal(f"zero, or a size of {1 / FARTHEST:g} or more: margins are in parts of it", key)
        return self

    @property
    def said(self) -> str:
        """What it limits, in the words of the file."""
        return self.label or self.quantity


class Objective(Table):
    """A quantity that is to be as large, or as small, as can be."""

    model_config = ConfigDict(json_schema_extra=ruled(when(has("maximise"), without("minimise"), has("minimise"))))

    maximise: Expression | None = Field(
        default=None, description="An expression that is to be as large as can be", examples=["range_x_um"]
    )
    minimise: Expression | None = Field(
        default=None, description="Instead: one that is to be as small as can be", examples=["envelope_mm"]
    )
    label: Label | None = Field(
        default=None, description="How it is called in what is printed", examples=["range at yield in X"]
    )

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
    """Scatter of the nine necks about their widths, each by itself: the largest coupling of 95 % of stages is asked."""

    neck_um: Scatter = Field(description="Standard deviation of every neck", examples=[5.0])
    stages: int = Field(
        default=4000, ge=FEWEST, le=20_000,
        description="How many the search draws, the same for every design; what is stated is of 100,000 others",
    )  # fmt: skip
    checked: int = Field(
        default=0, ge=0, le=1024, description="How many of the others finite elements solve; 0, or >= 8"
    )

    @model_validator(mode="after")
    def _checks_enough(self) -> Tolerance:
        if 0 < self.checked < LEAST_CHECKED:
            raise refusal(f"0, or at least {LEAST_CHECKED}", "checked")
        return self
