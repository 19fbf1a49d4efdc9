"""Static loads that a user states: on the output, and on named points, of which two make a pair
between two bodies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.files.refusals import nearest
from flexfem.mechanism.layout import Layout
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, FORCES, in_unit

Force: TypeAlias = tuple[float, float, float]
AtPoints: TypeAlias = Mapping[str, Sequence[float]] | Sequence[str]


class StatedLoad(NamedTuple):
    """A load by its parts.

    on_ports : (k,), on all ports of a layout, N and N mm.
    at_points : (points, 3), on the points, the output first.
    """

    on_ports: Array
    at_points: Array


def stated_load(
    layout: Layout, force: Force | None, force_at: AtPoints | None
) -> StatedLoad | None:
    """Return the load of `force` on the output and of `force_at` on named points; None without any.
    Raises BadInput.
    """
    if force is None and not force_at:
        return None
    found = loads_at_points(layout, force_at or ())
    if force is not None:
        found[0] += arguments.forces("force", force, 1)
    on_ports = np.zeros(len(layout.ports))
    on_ports[: found.size] = found.ravel()
    return StatedLoad(on_ports, found)


def required_load(
    layout: Layout,
    force: Force | None,
    force_at: AtPoints | None,
) -> StatedLoad:
    """Return a load as `stated_load`. Raises BadInput without a load, or for a load of zero."""
    found = stated_load(layout, force, force_at)
    if found is None or not np.any(found.on_ports):
        raise BadInput(
            "no load, expected force (N, N, N mm) on the output or force_at on named points, other "
            "than zero"
        )
    return found


def loads_at_points(layout: Layout, stated: AtPoints) -> Array:
    """Return loads (points, 3) from those by the names of points, or from texts NAME=FX,FY,M.
    Raises BadInput.
    """
    names = [name for name, _ in layout.points]
    found = np.zeros((len(names), len(FORCES)))
    for name, load in _named_loads(stated):
        if name not in names:
            raise BadInput(f"force_at {name!r}, expected the name of a point{nearest(name, names)}")
        found[names.index(name)] += arguments.forces(f"force_at {name}", load, 1)
    return found


def _named_loads(stated: AtPoints) -> list[tuple[str, Sequence[float]]]:
    """Return loads by the names of points; one text may be stated alone. Raises BadInput."""
    if isinstance(stated, Mapping):
        return list(stated.items())
    if isinstance(stated, str):
        return [_named_load(stated)]
    return [_named_load(text) for text in stated]


def _named_load(text: str) -> tuple[str, Sequence[float]]:
    """Return the name and the load of a text NAME=FX,FY,M, whose numbers may have units. Raises
    BadInput.
    """
    name, _, numbers = str(text).rpartition("=")
    parts = numbers.split(",")
    if not name or len(parts) != len(FORCES):
        raise BadInput(
            f"force_at {text!r}, expected NAME=FX,FY,M: a point, two forces in N and a moment in "
            "N mm"
        )
    try:
        load = [in_unit(part.strip(), unit) for part, unit in zip(parts, FORCES, strict=True)]
        return name.strip(), load
    except ValueError as error:
        raise BadInput(f"force_at {name}: {error}") from None


def held_ports(directions: Sequence[str] | None) -> tuple[int, ...]:
    """Return the held ports of the output: directions x, y or theta. Raises BadInput."""
    stated = [directions] if isinstance(directions, str) else list(directions or ())
    names = [name for text in stated for name in str(text).replace(",", " ").split()]
    for name in names:
        if name not in DIRECTIONS:
            raise BadInput(f"hold {name!r}, expected x, y or theta")
    return tuple(sorted({DIRECTIONS.index(name) for name in names}))
