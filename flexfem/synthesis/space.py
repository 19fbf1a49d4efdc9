"""The free dimensions as a unit cube and as the values that a shop can make."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.study.factors import Column
from flexfem.synthesis.tables import Free

WHOLE = 6  # dimensions up to which every combination of neighbours is looked at, beyond it pairs of them


class FreeDimension(NamedTuple):
    """One free dimension in file units.

    allowed : (k,) values that can be made, None where it is continuous.   listed : they are a list, no range.
    """

    name: str
    low: float
    high: float
    log: bool
    allowed: Array | None
    listed: bool

    def of_unit(self, u: Array) -> Array:
        """Values (n,) at places `u` (n,) from 0 to 1, those of a list each as likely."""
        if self.listed:
            assert self.allowed is not None
            return np.asarray(self.allowed[np.minimum((u * len(self.allowed)).astype(int), len(self.allowed) - 1)])
        if self.log:
            return np.asarray(self.low * (self.high / self.low) ** u)
        return np.asarray(self.low + (self.high - self.low) * u)

    def to_unit(self, x: Array) -> Array:
        """Places (n,) of values (n,)."""
        if self.listed:
            assert self.allowed is not None
            return (np.array([np.argmin(np.abs(self.allowed - each)) for each in x]) + 0.5) / len(self.allowed)
        if self.log:
            return np.asarray(np.log(x / self.low) / np.log(self.high / self.low))
        return np.asarray((x - self.low) / (self.high - self.low))

    def snapped(self, x: Array) -> Array:
        """The nearest values (n,) that can be made."""
        if self.allowed is None:
            return x
        places = np.clip(np.searchsorted(self.allowed, x), 1, max(len(self.allowed) - 1, 1))
        before, after = self.allowed[places - 1], self.allowed[min(1, len(self.allowed) - 1) and places]
        return np.where(x - before <= after - x, before, after)

    def beside(self, x: float) -> list[float]:
        """The value and those made next to it; of a continuous dimension the value alone."""
        if self.allowed is None:
            return [x]
        place = int(np.argmin(np.abs(self.allowed - x)))
        return [float(each) for each in self.allowed[max(place - 1, 0) : place + 2]]


class DesignSpace:
    """All free dimensions; designs are rows (n, d) of values in file units."""

    def __init__(self, columns: tuple[Column, ...]) -> None:
        self.dimensions = tuple(_dimension(column) for column in columns)

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.dimensions)

    @property
    def continuous(self) -> AnyArray:
        """Which (d,) take any value between their ends."""
        return np.array([each.allowed is None for each in self.dimensions])

    @property
    def listed(self) -> AnyArray:
        """Which (d,) take one of a list."""
        return np.array([each.listed for each in self.dimensions])

    def of_unit(self, u: Array) -> Array:
        """Designs (n, d) at places (n, d) from 0 to 1."""
        return np.column_stack([each.of_unit(u[:, k]) for k, each in enumerate(self.dimensions)])

    def to_unit(self, values: Array) -> Array:
        """Places (n, d) of designs (n, d)."""
        return np.column_stack([each.to_unit(values[:, k]) for k, each in enumerate(self.dimensions)])

    def snapped(self, values: Array) -> Array:
        """The nearest designs (n, d) that can be made."""
        return np.column_stack([each.snapped(values[:, k]) for k, each in enumerate(self.dimensions)])

    def neighbours(self, values: Array) -> Array:
        """Designs (n, d) one step away from `values` (d,) in any dimensions, in any two where there are many."""
        beside = [each.beside(float(x)) for each, x in zip(self.dimensions, values, strict=True)]
        if sum(len(each) > 1 for each in beside) <= WHOLE:
            return np.array(list(product(*beside)))
        found = [values]
        for i in range(self.size):
            for j in range(i):
                for a, b in product(beside[i], beside[j]):
                    found.append(np.where(np.arange(self.size) == i, a, np.where(np.arange(self.size) == j, b, values)))
        return np.unique(np.array(found), axis=0)


def _dimension(column: Column) -> FreeDimension:
    factor = column.factor
    assert isinstance(factor, Free)
    if factor.values is not None:
        return FreeDimension(column.name, min(factor.values), max(factor.values), False, factor.allowed, True)
    assert factor.start is not None and factor.end is not None
    allowed = factor.allowed
    high = factor.end if allowed is None else float(allowed[-1])
    return FreeDimension(column.name, factor.start, high, factor.scale == "log", allowed, False)
