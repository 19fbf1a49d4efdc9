"""Designs of a study: many at once as arrays, or one as a stage."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.refused import BadInput
from flexfem.stage.keys import Key, keys
from flexfem.stage.schema import CHAINS, HINGE_NAMES, Override, Stage
from flexfem.study.plan import LoadedStudy


class Designs(NamedTuple):
    """n designs in inside units (mm, MPa, rad), the leading axis.

    Attributes
    ----------
    thickness, youngs_modulus, poissons_ratio, yield_strength, link_width, platform_radius, hub_radius : (n,).
    link_lengths, joint_angles : (n, 3).
    radius, neck, axis : (n, 3 chains, 3 hinges); axis nan where the neck follows its link.
    prismatic : (3, 3), the same for all.
    """

    thickness: Array
    youngs_modulus: Array
    poissons_ratio: Array
    yield_strength: Array
    link_lengths: Array
    joint_angles: Array
    link_width: Array
    radius: Array
    neck: Array
    axis: Array
    platform_radius: Array
    hub_radius: Array
    prismatic: NDArray[np.bool_]


def designs_of(loaded: LoadedStudy, values: Array) -> Designs:
    """The designs whose factors take `values` (n, columns), file units; nothing is checked here."""
    base = _of_stage(loaded.stage)
    found = {name: np.repeat(np.asarray(array)[None], len(values), axis=0) for name, array in base.items()}
    for key, column in _settings(loaded):
        for field, place in key.places_in(loaded.stage):
            everywhere: tuple[slice | int, ...] = (slice(None), *place)
            found[field][everywhere] = key.unit * values[:, column]
    return Designs(**found, prismatic=loaded.stage.array("prismatic"))


def stage_of(loaded: LoadedStudy, values: Array) -> Stage:
    """The design whose factors take `values` (columns,), file units, as a stage.

    Raises
    ------
    BadInput : a value that no stage file can give; one line that begins with its key.
    """
    stage = loaded.stage
    for key, column in _settings(loaded):
        value = float(values[column])
        expected = key.expected(value)
        if expected is not None:
            raise BadInput(f"{key.path} = {value:g}, expected {expected}")
        stage = _with(stage, key, key.check.validate_python(value))
    return stage


def _settings(loaded: LoadedStudy) -> list[tuple[Key, int]]:
    """Every key set and the column that sets it, single hinges after the three they all are."""
    found = [(keys()[path], index) for index, column in enumerate(loaded.columns) for path in column.keys]
    return sorted(found, key=lambda setting: setting[0].table[:1] == ("override",))


def _of_stage(stage: Stage) -> dict[str, Array]:
    axes = [[stage.hinge(chain, name).axis for name in HINGE_NAMES] for chain in CHAINS]
    material, chain, platform = stage.material, stage.chain, stage.platform
    values = {
        "thickness": stage.thickness,
        "youngs_modulus": material.youngs_modulus,
        "poissons_ratio": material.poissons_ratio,
        "yield_strength": material.yield_strength,
        "link_lengths": chain.link_lengths,
        "joint_angles": chain.joint_angles,
        "link_width": chain.link_width,
        "radius": stage.array("radius"),
        "neck": stage.array("neck"),
        "axis": [[np.nan if axis is None else axis for axis in row] for row in axes],
        "platform_radius": platform.radius,
        "hub_radius": platform.hub_radius,
    }
    return {name: np.asarray(value, dtype=float) for name, value in values.items()}


def _with(stage: Stage, key: Key, value: float) -> Stage:
    """The stage with one number replaced; both are valid, so the result is."""
    if key.table[:1] == ("override",):
        return _with_override(stage, int(key.table[1]), key.table[2], key.attribute, value)
    replaced: Stage = _replaced(stage, (*key.table, key.attribute), key.element, value)
    return replaced


def _replaced(old: Any, path: tuple[str, ...], element: int | None, value: float) -> Any:
    if path:
        return old.model_copy(update={path[0]: _replaced(getattr(old, path[0]), path[1:], element, value)})
    return value if element is None else (*old[:element], value, *old[element + 1 :])


def _with_override(stage: Stage, chain: int, hinge: str, attribute: str, value: float) -> Stage:
    overrides = list(stage.override)
    for index, override in enumerate(overrides):
        if (override.chain, override.hinge) == (chain, hinge):
            overrides[index] = override.model_copy(update={attribute: value})
            break
    else:
        overrides.append(Override.from_names({"chain": chain, "hinge": hinge, attribute: value}))
    return stage.model_copy(update={"override": tuple(overrides)})
