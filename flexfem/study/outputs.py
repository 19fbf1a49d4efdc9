"""The columns a study answers, in their order; units as in files."""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.units import unit_of

STIFFNESSES = ("kxx_n_per_mm", "kyy_n_per_mm", "ktt_n_mm_per_rad", "kxy_n_per_mm", "kxt_n", "kyt_n")
COUPLINGS = ("coupling_xy", "coupling_xt", "coupling_yt")
STRESSES = ("stress_x_mpa_per_um", "stress_y_mpa_per_um", "stress_theta_mpa_per_mrad")
RANGES = ("range_x_um", "range_y_um", "range_theta_mrad")
ENVELOPE = ("envelope_mm",)
TRAVELS = ("travel_x_um", "travel_y_um", "travel_theta_mrad")
ERRORS = ("error_x_percent", "error_y_percent", "error_theta_percent")
CROSSES = ("cross_x_percent", "cross_y_percent", "cross_theta_percent")
BANDS = ("band_x_percent", "band_y_percent", "band_theta_percent")
CROSS = {  # stiffnesses between two directions, and those along them
    "kxy_n_per_mm": ("kxx_n_per_mm", "kyy_n_per_mm"),
    "kxt_n": ("kxx_n_per_mm", "ktt_n_mm_per_rad"),
    "kyt_n": ("kyy_n_per_mm", "ktt_n_mm_per_rad"),
}
COMMON = (*STIFFNESSES, *COUPLINGS, *STRESSES, *RANGES, *ENVELOPE)

_ENTRIES = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))


def outputs_of(drive: bool, verify: bool, bands: bool) -> tuple[str, ...]:
    """Names of the output columns: travel with a drive, errors of a verification, their bands if wanted."""
    travel = TRAVELS if drive else ()
    errors = (*ERRORS, *CROSSES, *(BANDS if bands else ())) if verify else ()
    return (*COMMON, *travel, *errors)


def common_columns(stiffness: Array, stress: Array, yield_strength: Array, envelope: Array) -> Array:
    """Values (n, `COMMON`) of platform stiffnesses (n, 3, 3), stresses (n, 3) in MPa per mm and rad, and sizes (n,)."""
    entries = stiffness[:, *_ENTRIES]
    size = np.sqrt(np.abs(entries[:, :3]))
    coupling = entries[:, 3:] / (size[:, [0, 0, 1]] * size[:, [1, 2, 2]])
    reach = yield_strength[:, None] / stress
    per_unit, reach = stress * _factors(STRESSES), reach * _factors(RANGES)
    return np.concatenate([entries, coupling, per_unit, reach, envelope[:, None]], axis=1)


def travel_columns(travel: Array) -> Array:
    """Values (n, `TRAVELS`) of travels (n, 3), mm and rad."""
    return travel * _factors(TRAVELS)


def _factors(columns: tuple[str, ...]) -> Array:
    """What turns numbers in N, mm, MPa, rad into those of the columns (k,)."""
    return np.array([unit_of(column).factor for column in columns])
