"""What functions of the Python API are given, refused in one line when it is not what they take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array
from flexfem.refused import BadInput

LARGEST_FORCE = 1e9  # N, N mm; no stage of metal bears a millionth of it
LARGEST_DISPLACEMENT = 1e4  # mm, rad; no stage is larger
FINEST = 64  # triangles across a neck
MOST_LAYERS = 16  # in half the thickness


def vectors(what: str, values: ArrayLike, most: int | None = None, largest: float = np.inf) -> Array:
    """Finite numbers of shape (..., 3), with at most `most` axes and no larger than `largest`. Raises BadInput."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"{what}: expected numbers of shape (..., 3)") from None
    if found.shape[-1:] != (3,) or (most and found.ndim > most):
        raise BadInput(f"{what} of shape {found.shape}, expected ({'..., ' * (most is None)}3): x, y, theta")
    if not np.all(np.isfinite(found)):
        raise BadInput(f"{what}: expected finite numbers")
    if np.any(np.abs(found) > largest):
        raise BadInput(f"{what}: expected numbers within ±{largest:g}")
    return found


def integer(what: str, value: Any, most: int, least: int = 1) -> int:
    """An integer from `least` to `most`. Raises BadInput."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or not least <= value <= most:
        raise BadInput(f"{what} {value!r}, expected an integer from {least} to {most}")
    return int(value)


def resolution(value: Any, least: int = 2) -> int:
    """Triangles across every neck, `least` to `FINEST`. Raises BadInput."""
    return integer("resolution", value, FINEST, least)


def layers(value: Any, least: int = 1) -> int:
    """Layers in half the thickness, `least` to `MOST_LAYERS`. Raises BadInput."""
    return integer("layers", value, MOST_LAYERS, least)


def resolutions(values: Any) -> list[int]:
    """Resolutions, each as `resolution`. Raises BadInput."""
    if isinstance(values, str | bytes) or not isinstance(values, Sequence | np.ndarray):
        raise BadInput(f"resolutions {values!r}, expected three integers or more")
    return [resolution(value) for value in values]


def _number(what: str, value: Any, is_possible: Callable[[float], bool], expected: str) -> float:
    if not isinstance(value, Real) or isinstance(value, bool) or not is_possible(float(value)):
        raise BadInput(f"{what} {value!r}, expected a number {expected}")
    return float(value)


def positive(what: str, value: Any, most: float) -> float:
    """A number above zero and at most `most`. Raises BadInput."""
    return _number(what, value, lambda number: 0 < number <= most, f"above 0, at most {most:g}")


def between(what: str, value: Any, least: float, most: float, why: str = "") -> float:
    """A number from `least` to `most`. Raises BadInput that says `why`."""
    return _number(what, value, lambda number: least <= number <= most, f"from {least:g} to {most:g}{why}")


def forces(what: str, values: ArrayLike, most: int | None = None) -> Array:
    """Loads (..., 3) of at most `LARGEST_FORCE`. Raises BadInput."""
    return vectors(what, values, most, LARGEST_FORCE)


def poses(what: str, values: ArrayLike, most: int | None = None) -> Array:
    """Displacements (..., 3) of the platform of at most `LARGEST_DISPLACEMENT`. Raises BadInput."""
    return vectors(what, values, most, LARGEST_DISPLACEMENT)


def pair(what: str, values: Any, most: tuple[float, float], named: str) -> tuple[float, float]:
    """Two numbers from zero, each at most its own of `most`. Raises BadInput that says what they are `named`."""
    try:
        first, second = map(float, () if isinstance(values, str) else values)
    except (TypeError, ValueError):
        raise BadInput(f"{what} {values!r}, expected two numbers: {named}") from None
    if not (0 <= first <= most[0] and 0 <= second <= most[1]):
        expected = f"from 0 to {most[0]:g} and from 0 to {most[1]:g}"
        raise BadInput(f"{what} {first:g} {second:g}, expected two numbers {expected}: {named}")
    return first, second
