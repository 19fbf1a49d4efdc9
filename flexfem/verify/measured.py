"""Slopes that were measured, as a file states them."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from flexfem.arrays import Array
from flexfem.files import quantities
from flexfem.files.json_schema import Rule, beside, either, has, ruled
from flexfem.files.refusals import refusal
from flexfem.mechanism.dimensioned import Dimensioned

Spring: TypeAlias = Annotated[float, *quantities.above_zero(quantities.SPRING)]
Torsion: TypeAlias = Annotated[float, *quantities.above_zero(quantities.TORSION)]
MEASURED = (
    "Measured slopes, one or more, each with its standard deviation where that is known. They are compared with the "
    "reciprocal of the compliance: a push leaves the other directions free"
)


class Slopes(NamedTuple):
    """Measured slopes (3,) in x, y, theta and their standard deviations, nan where not given: N/mm, N mm/rad."""

    value: Array
    sd: Array


def _slope(key: str, description: str, example: float) -> Any:
    return Field(default=None, alias=key, description=description, examples=[example])


def _one_or_more(schema: Rule) -> None:
    slopes = [key for key in schema["properties"] if "_sd_" not in key]
    deviations = {key: [key.replace("_sd", "")] for key in schema["properties"] if "_sd_" in key}
    schema["allOf"] = [either(*map(has, slopes)), beside(deviations)]


class MeasuredSlopes(Dimensioned):
    """Measured slopes, N/mm and N mm/rad, one or more, each with its standard deviation if that is known."""

    model_config = ConfigDict(json_schema_extra=ruled(also=lambda schema: _one_or_more(schema)))

    kxx: Spring | None = _slope("kxx_n_per_mm", "Slope as pushed in x", 1480.0)
    kxx_sd: Spring | None = _slope("kxx_sd_n_per_mm", "Standard deviation of `kxx_n_per_mm`, less than it", 12.0)
    kyy: Spring | None = _slope("kyy_n_per_mm", "Slope as pushed in y", 1490.0)
    kyy_sd: Spring | None = _slope("kyy_sd_n_per_mm", "Standard deviation of `kyy_n_per_mm`, less than it", 12.0)
    ktt: Torsion | None = _slope("ktt_n_mm_per_rad", "Moment over rotation as pushed at the bar", 1.1e6)
    ktt_sd: Torsion | None = _slope(
        "ktt_sd_n_mm_per_rad", "Standard deviation of `ktt_n_mm_per_rad`, less than it", 1.5e4
    )

    @model_validator(mode="after")
    def _each_with_what_it_is_of(self) -> MeasuredSlopes:
        names = {"kxx": "n_per_mm", "kyy": "n_per_mm", "ktt": "n_mm_per_rad"}
        if all(getattr(self, name) is None for name in names):
            raise refusal(f"one or more of {', '.join(f'{name}_{unit}' for name, unit in names.items())}")
        for name, unit in names.items():
            value, sd = getattr(self, name), getattr(self, f"{name}_sd")
            if sd is not None and (value is None or sd >= value):
                least = "with it" if value is None else "larger than it"
                raise refusal(f"{name}_{unit} {least}", f"{name}_sd_{unit}")
        return self

    @property
    def slopes(self) -> Slopes:
        """Slopes and standard deviations, order x, y, theta."""
        found = [[getattr(self, f"{name}{end}") for name in ("kxx", "kyy", "ktt")] for end in ("", "_sd")]
        return Slopes(*np.array(found, dtype=float))
