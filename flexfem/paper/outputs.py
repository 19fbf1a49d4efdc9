"""Results of designs of the stage for studies, and the output columns that are computed from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.paper.driven import DriveRanges
from flexfem.paper.life import Lives
from flexfem.paper.responses import DriftRates
from flexfem.study import columns
from flexfem.units import unit_of


class ErrorPercentages(NamedTuple):
    """Error percentages of n designs for commands in x, y, theta, (n, 3) each.

    along : in the commanded direction.   across : largest in another direction.   bands : of
    `along`, if requested."""

    along: Array
    across: Array
    bands: Array | None


class DesignAnswers(NamedTuple):
    """Results of n designs; directions in the order x, y, theta.

    stiffness : (n, 3, 3), of the platform: N/mm, N, N mm.
    stress : (n, 3), highest neck stress per displacement, other directions held: MPa per mm, per
    rad.
    turning : (n, 3), largest rotation of a base hinge per displacement: rad per mm, per rad.
    yield_strength : (n,), MPa.   envelope : (n,), diameter, mm.

    Other fields are None unless requested: errors of the analytic model, ranges of the drives, the
    lowest natural frequencies (n, 3) in the plane, rad/s, fatigue lives, and thermal drift."""

    stiffness: Array
    stress: Array
    turning: Array
    yield_strength: Array
    envelope: Array
    errors: ErrorPercentages | None = None
    drives: DriveRanges | None = None
    frequencies: Array | None = None
    lives: Lives | None = None
    drift: DriftRates | None = None

    @property
    def coupling(self) -> Array:
        """Coupling `K_ij / sqrt(K_ii K_jj)` (n, 3) of x and y, x and theta, y and theta."""
        size = np.sqrt(np.abs(np.diagonal(self.stiffness, axis1=1, axis2=2)))
        first, second = np.triu_indices(3, 1)
        return np.asarray(self.stiffness[:, first, second] / (size[:, first] * size[:, second]))

    @property
    def range_at_yield(self) -> Array:
        """Displacement (n, 3), mm and rad, at which the first hinge yields, with the other
        directions held.
        """
        return self.yield_strength[:, None] / self.stress

    def travel(self, rotation: float) -> Array:
        """Return the displacement (n, 3), mm and rad, at which the first base hinge reaches
        `rotation`, rad.
        """
        return rotation / self.turning


def _stiffnesses(found: DesignAnswers) -> Array:
    return found.stiffness[:, (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]


def _engaged(found: DesignAnswers) -> Array:
    assert found.drives is not None
    return np.diagonal(found.drives.engaged, axis1=1, axis2=2)


def _drive_ranges(found: DesignAnswers) -> Array:
    assert found.drives is not None
    return found.drives.range


def _frequencies(found: DesignAnswers) -> Array:
    return np.asarray(found.frequencies)


def _lives(found: DesignAnswers) -> Array:
    assert found.lives is not None
    return np.column_stack([found.lives.cycles, found.lives.largest, found.lives.safety])


def _drifts(found: DesignAnswers) -> Array:
    assert found.drift is not None
    return found.drift.uniform


def _gradients(found: DesignAnswers) -> Array:
    assert found.drift is not None
    return found.drift.gradient


def _errors(found: DesignAnswers) -> Array:
    assert found.errors is not None
    return found.errors.along


def _crosses(found: DesignAnswers) -> Array:
    assert found.errors is not None
    return found.errors.across


def _bands(found: DesignAnswers) -> Array:
    assert found.errors is not None
    return np.asarray(found.errors.bands)


# values (n, columns) in internal units, by the names of the columns
VALUES: Mapping[tuple[str, ...], Callable[[DesignAnswers], Array]] = {
    columns.STIFFNESSES: _stiffnesses,
    columns.COUPLINGS: lambda found: found.coupling,
    columns.STRESSES: lambda found: found.stress,
    columns.RANGES: lambda found: found.range_at_yield,
    columns.ENVELOPE: lambda found: found.envelope[:, None],
    columns.DRIVE_RANGES: _drive_ranges,
    columns.ENGAGED: _engaged,
    columns.FREQUENCIES: _frequencies,
    columns.LIVES: _lives,
    columns.DRIFTS: _drifts,
    columns.GRADIENTS: _gradients,
    columns.ERRORS: _errors,
    columns.CROSSES: _crosses,
    columns.BANDS: _bands,
}


def values_of(
    found: DesignAnswers,
    names: Sequence[str],
    rotation: float | None,
) -> Array:
    """Return values (n, names) of output columns, in their units.

    rotation : largest one of a base hinge, rad, for travels; None without a stroke.
    """
    computed = {group: compute for group, compute in VALUES.items() if {*group} & {*names}}
    values = dict[str, Array]()
    for group, compute in computed.items():
        _add_columns(values, group, compute(found))
    if rotation is not None:
        _add_columns(values, columns.TRAVELS, found.travel(rotation))
    return np.stack([values[name] for name in names], axis=1)


def _add_columns(
    values: dict[str, Array],
    names: Sequence[str],
    numbers: Array,
) -> None:
    """Add numbers (n, names) in internal units to columns in their units."""
    for name, column in zip(names, numbers.T, strict=True):
        values[name] = column * unit_of(name).factor
