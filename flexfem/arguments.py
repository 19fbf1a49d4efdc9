"""Checks of arguments of the Python API; each refuses an unusable value in one line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array
from flexfem.refused import BadInput, printed

LARGEST_FORCE = 1e9  # N, N mm; a metal stage yields far below a millionth of it
LARGEST_DISPLACEMENT = 1e4  # mm, rad; no stage is larger
FINEST = 64  # triangles across a neck
MOST_LAYERS = 16  # in half the thickness


def vectors(
    name: str, values: ArrayLike, max_dimensions: int | None = None, limit: float = np.inf
) -> Array:
    """Return finite vectors (..., 3) with at most `max_dimensions` axes and entries up to `limit`.
    Raises BadInput.
    """
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{name}: expected numbers of shape (..., 3)") from None
    if array.shape[-1:] != (3,) or (max_dimensions and array.ndim > max_dimensions):
        raise BadInput(
            f"{name} of shape {array.shape}, expected ({'..., ' * (max_dimensions is None)}3): x, "
            "y, theta"
        )
    if not np.all(np.isfinite(array)):
        raise BadInput(f"{name}: expected finite numbers")
    if np.any(np.abs(array) > limit):
        largest = array.flat[np.argmax(np.abs(array))]
        raise BadInput(f"{name} {largest:g}, expected numbers within ±{limit:g}")
    return array


def integer(
    name: str,
    value: Any,
    most: int,
    least: int = 1,
) -> int:
    """Return an integer from `least` to `most`. Raises BadInput."""
    if (
        not isinstance(value, int | np.integer)
        or isinstance(value, bool)
        or not least <= value <= most
    ):
        raise BadInput(f"{name} {printed(value)}, expected an integer from {least} to {most}")
    return int(value)


def resolution(value: Any, least: int = 2) -> int:
    """Return the number of triangles across every neck, `least` to `FINEST`. Raises BadInput."""
    return integer("resolution", value, FINEST, least)


def thickness_resolution(value: Any, least: int = 1) -> int:
    """Return the number of elements through half of the thickness, `least` to `MOST_LAYERS`. Raises
    BadInput.
    """
    return integer("thickness_resolution", value, MOST_LAYERS, least)


def resolutions(values: Any) -> list[int]:
    """Return resolutions, each checked by `resolution`. Raises BadInput."""
    if isinstance(values, str | bytes) or not isinstance(values, Sequence | np.ndarray):
        raise BadInput(f"resolutions {printed(values)}, expected three integers or more")
    return [resolution(value) for value in values]


def _number(
    name: str,
    value: Any,
    is_valid: Callable[[float], bool],
    expected: str,
) -> float:
    if not isinstance(value, Real) or isinstance(value, bool) or not is_valid(float(value)):
        raise BadInput(f"{name} {printed(value)}, expected a number {expected}")
    return float(value)


def positive(
    name: str,
    value: Any,
    most: float,
) -> float:
    """Return a number above zero and at most `most`. Raises BadInput."""
    return _number(name, value, lambda number: 0 < number <= most, f"above 0, at most {most:g}")


def between(
    name: str,
    value: Any,
    least: float,
    most: float,
    suffix: str = "",
) -> float:
    """Return a number from `least` to `most`. Raises BadInput, its text with a `suffix` such as the
    unit.
    """
    return _number(
        name, value, lambda number: least <= number <= most, f"from {least:g} to {most:g}{suffix}"
    )


forces = partial(vectors, limit=LARGEST_FORCE)
poses = partial(vectors, limit=LARGEST_DISPLACEMENT)


def pair(
    name: str,
    values: Any,
    most: tuple[float, float],
    meaning: str,
) -> tuple[float, float]:
    """Return two numbers from zero to `most`. Raises BadInput, its text with the `meaning` of the
    numbers.
    """
    try:
        first, second = map(float, () if isinstance(values, str) else values)
    except (TypeError, ValueError):
        raise BadInput(f"{name} {printed(values)}, expected two numbers: {meaning}") from None
    if not (0 <= first <= most[0] and 0 <= second <= most[1]):
        expected = f"from 0 to {most[0]:g} and from 0 to {most[1]:g}"
        raise BadInput(f"{name} {first:g} {second:g}, expected two numbers {expected}: {meaning}")
    return first, second
