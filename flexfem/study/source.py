"""The data of all figures of a study."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from flexfem.arrays import ROUND_OFF, Array, short_repr
from flexfem.refused import BadInput
from flexfem.results import thousands
from flexfem.study.collect import StudyTable
from flexfem.study.columns import LIVES, RANGES, STRESSES
from flexfem.study.loaded import LoadedStudy
from flexfem.study.names import axis_of, counted, model_words, sampling_words, sentence
from flexfem.study.plan import BAND
from flexfem.study.records import AxisText, Caption

LARGEST = 1e100  # largest drawn number, whose square and inverse square are finite
UNKNOWN = "no number"  # of a design with a result that lacks one of the numbers


@short_repr
class Source(NamedTuple):
    """Data of all figures: the study, its table, and the factors and outputs of the base stage by
    column.
    """

    loaded: LoadedStudy
    table: StudyTable
    nominal: Mapping[str, float]

    def quantity(self, name: str) -> AxisText:
        """Return name and unit of a column."""
        return axis_of(self.loaded, name)

    def column(self, name: str) -> Array:
        """Return the numbers (n,) of a column of the table, round-off as 0."""
        return self._cleared(name, self.table.columns[name])

    def drawable(self, name: str) -> Array:
        """Return the numbers (n,) of a column, nan where there is none that can be drawn."""
        values = self.column(name)
        sizes = np.abs(values)
        possible = (sizes == 0) | ((sizes >= 1 / LARGEST) & (sizes <= LARGEST))
        return np.where(possible, values, np.nan)

    def band_of(self, name: str) -> str:
        """Return the column of the band of a number, "" where there is none."""
        for band in (f"{name}{BAND}", name.replace("error_", "band_")):
            if band != name and band in self.table.columns:
                return band
        return ""

    def base_value(self, name: str) -> float | None:
        """Return the number of the base stage in a column, round-off as 0; None where it is not
        known.
        """
        value = float(self._cleared(name, np.asarray(self.nominal.get(name, np.nan))))
        return value if np.isfinite(value) else None

    def _cleared(
        self,
        name: str,
        values: Array,
    ) -> Array:
        return np.where(
            np.abs(values) <= ROUND_OFF * self.table.round_off_sizes.get(name, 0.0), 0.0, values
        )

    def caption(
        self,
        title: str,
        columns: Iterable[str],
        *lines: str,
    ) -> Caption:
        """Return the text above a figure of some columns."""
        loaded = self.loaded
        study = self.loaded.study
        table = self.table
        counts = table.counts | {"unfinished": loaded.count - len(table.design)}
        text = [
            f"Study: {study.name}. Base: {loaded.base.name}.",
            f"{model_words(loaded)}. {thousands(loaded.count)} designs "
            f"({sampling_words(loaded)}): {counted(counts)}.",
        ]
        if study.constraint:
            limits = "; ".join(
                f"{constraint.title} {constraint.expected}" for constraint in study.constraint
            )
            kept = thousands(int(table.kept.sum()))
            computed = thousands(int(table.ok.sum()))
            text.append(
                f"{kept} of {computed} designs with a result satisfy the constraints: {limits}."
            )
        text += [f"{warning}." for warning in table.warnings]
        if study.behind(columns) & {*STRESSES, *RANGES, *LIVES}:
            text.append(sentence(loaded.stress_accuracy))
        return Caption(title, [*text, *lines], *loaded.assumptions)

    def base_point(
        self,
        x: str,
        y: str,
    ) -> tuple[float, float] | None:
        """Return two numbers of the base stage, None where they are not known."""
        base_x = self.base_value(x)
        base_y = self.base_value(y)
        return None if base_x is None or base_y is None else (base_x, base_y)

    def refusal(
        self,
        kind: str,
        name: str,
        reason: str,
    ) -> BadInput:
        """Return the error that a figure of a column cannot be drawn."""
        return BadInput(f"{self.loaded.path}: {kind} of {name}: {reason}")
