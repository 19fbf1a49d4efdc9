"""What a study file wants to see; no part of what the results depend on."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field, model_validator

from flexfem.files.refusals import refusal
from flexfem.files.toml import Table
from flexfem.stage.schema import Label

FigureKind: TypeAlias = Literal["map", "distribution", "sensitivity", "pareto"]
Better: TypeAlias = Literal["larger", "smaller"]
_KEYS_OF: dict[FigureKind, tuple[tuple[str, ...], tuple[str, ...]]] = {  # needed, possible
    "map": (("x", "y", "value"), ()),
    "distribution": (("values",), ()),
    "sensitivity": (("values",), ()),
    "pareto": (("x", "y"), ("x_better", "y_better", "drawn")),
}


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
        for name in needed:
            if name not in self.model_fields_set:
                raise refusal(f'{name} for kind = "{self.kind}"')
        for name in type(self).model_fields:
            if name in self.model_fields_set and name not in ("kind", "title", *needed, *possible):
                raise refusal(f'no {name} with kind = "{self.kind}"', name)
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
