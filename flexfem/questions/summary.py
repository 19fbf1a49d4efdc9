"""The summary of a mechanism: stiffness, range, motion by the actuators and first frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates, setup
from flexfem.questions.modes import modes
from flexfem.questions.plates import ON_MESHES, PEAK
from flexfem.questions.ranges import RANGE, RANGE_FORCE, RANGE_LABELS, RANGE_LIMIT
from flexfem.questions.reach import motion_by_strokes
from flexfem.questions.setup import DEFAULT, Analytic, Mesh, Models
from flexfem.questions.stiffness import LIFTED_FREE, LIFTED_LABELS, lifted_stiffness, stiffness
from flexfem.results import SOLVED, Arrays, Progress, Quantity, Result
from flexfem.units import COMPUTED_IN, in_words

BY_DIRECTION = ("direction", "model")
AT_FIRST_YIELD = "of a hinge or a body, by linear theory, without stretching of hinges and buckling"
NEGLIGIBLE = 1e-12  # mm, rad: round-off of an end of a range that is zero
# quantities of `stiffness` that a summary has by direction, then by model
OF_MODELS = {"free", "yield_range", "yield_force", "stress", "thickness"}
OF_RANGES = {"range", "range_force", "range_limit"}


class Summary(Result):
    """Stiffness, range, force and stress by direction, first frequency, motion by actuators."""

    kind_name = "mechanism_summary"
    title = "summary"
    main_result = ("free", {})
    labels: ClassVar = {**RANGE_LABELS, **LIFTED_LABELS}
    columns = ("direction", "out of plane")
    stiffness = Quantity(
        "stiffness, other directions held", "stiffness", BY_DIRECTION, ON_MESHES, compared=False
    )
    free = Quantity("stiffness, other directions free", "stiffness", BY_DIRECTION, ON_MESHES)
    range = RANGE
    range_force = RANGE_FORCE
    range_limit = RANGE_LIMIT
    yield_range = Quantity(
        "displacement at first yield, other directions held, linear",
        "motion",
        BY_DIRECTION,
        PEAK,
        note=AT_FIRST_YIELD,
        detail=True,
    )
    yield_force = Quantity(
        "force at first yield, other directions held, linear",
        "wrench",
        BY_DIRECTION,
        PEAK,
        note=AT_FIRST_YIELD,
        detail=True,
    )
    stress = Quantity(
        "highest hinge stress per displacement, other directions held",
        "stress per motion",
        (*BY_DIRECTION, "hinge"),
        PEAK,
        "all",
        detail=True,
    )
    held_low = Quantity(
        "range of the drive from, other directions held",
        "motion",
        ("direction",),
        SOLVED,
        "pose",
        beside="held_high",
    )
    held_high = Quantity(
        "range of the drive to, other directions held",
        "motion",
        ("direction",),
        SOLVED,
        "pose",
        beside="held_low",
    )
    free_low = Quantity(
        "range of the drive from, other directions free",
        "motion",
        ("direction",),
        SOLVED,
        "pose",
        beside="free_high",
    )
    free_high = Quantity(
        "range of the drive to, other directions free",
        "motion",
        ("direction",),
        SOLVED,
        "pose",
        beside="free_low",
    )
    amplification = Quantity(
        "output motion per actuator opening, output free",
        ("", "", "rad_per_mm"),
        BY_DIRECTION,
        ON_MESHES,
        "all",
        detail=True,
    )
    frequency = Quantity("first natural frequency in the plane", "hz", ("model",), ON_MESHES)
    first_out_of_plane = Quantity(
        "first natural frequency out of the plane, in three dimensions", "hz", gate=ON_MESHES
    )
    lifted_free = LIFTED_FREE
    input_stiffness = Quantity(
        "stiffness at the actuator, output free", "n_per_um", ("model",), ON_MESHES, detail=True
    )


class _Collected(NamedTuple):
    """Values and bands, and texts, of a summary."""

    arrays: Arrays
    settings: dict[str, Any]
    warnings: list[str]
    notes: list[str]


@setup.options(not_for="analytic")
def summary(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> Summary:
    """The main results: stiffness, range, motion by the actuators and first natural frequency.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    models : {"both", "analytic", "elements"}
        The models to compute.
    analytic : Analytic
        The analytic model. Of a stage file only.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    solid : bool
        The whole plate by finite elements in three dimensions.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Summary
        Of a stage file `StageSummary`. Every number has the unit that its quantity declares:
        `unit` returns it, and `flexfem schema mechanism_summary` or `flexfem schema summary`
        lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.summary(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> float(found.at("yield_range", direction="x", model="analytic").round(3))  # mm
    0.641
    """
    asked: dict[str, Any] = {
        "models": models,
        "resolution": resolution,
        "solid": solid,
        "thickness_resolution": thickness_resolution,
    }
    found = stiffness(mechanism, **asked, progress=progress)
    settings, notes = material_of(mechanism)
    collected = _Collected(
        at_rest_of(found.internal),
        settings | found.settings,
        [*found.warnings],
        [*found.notes, *notes],
    )
    _add_inputs(collected, mechanism, found.internal)
    _add_frequencies(collected, mechanism, asked)
    if mechanism.layout.actuators:
        layers = setup.elements_through(solid, thickness_resolution)
        mesh = plates.mesh_of(mechanism, models, resolution, layers)
        _add_reach(collected, mechanism, mesh, models)
    (values, bands), stated, warnings, notes = collected
    return Summary(found.about, values, bands, found.axes, stated, warnings, notes)


def material_of(mechanism: Mechanism) -> tuple[dict[str, Any], list[str]]:
    """Return as settings in what is computed and the yield strength, and as notes the sources of
    the material.
    """
    by_source = dict[str, list[str]]()
    for key in mechanism.numbers:
        if key.startswith("material"):
            name = in_words(key.partition(".")[2])
            by_source.setdefault(mechanism.sources[key] or "not stated", []).append(name)
    settings = {
        "computed in": COMPUTED_IN[mechanism.model],
        "yield strength": f"{mechanism.material.yield_strength:g} MPa",
    }
    notes = [f"material ({', '.join(names)}): {source}" for source, names in by_source.items()]
    return settings, notes


def at_rest_of(found: Arrays) -> Arrays:
    """Return what a summary takes from values and bands of `stiffness`, by direction, then by
    model.
    """
    return Arrays(_at_rest_of(found.values), _at_rest_of(found.bands))


def _at_rest_of(found: Mapping[str, Array]) -> dict[str, Array]:
    taken = {name: np.moveaxis(found[name], -1, 0) for name in found.keys() & OF_MODELS}
    taken |= {name: found[name] for name in found.keys() & OF_RANGES}
    if "stiffness" in found:
        taken["stiffness"] = np.diagonal(found["stiffness"], axis1=1, axis2=2).T
    return taken


def _add_inputs(
    collected: _Collected,
    mechanism: Mechanism,
    found: Arrays,
) -> None:
    """Add amplification and stiffness at the only actuator."""
    if len(mechanism.layout.actuators) != 1:
        return
    for target, source in zip(collected.arrays, found, strict=True):
        if "amplification" in source:
            target["amplification"] = source["amplification"][0].T
            target["input_stiffness"] = source["input_stiffness"][0]


def _add_frequencies(
    collected: _Collected,
    mechanism: Mechanism,
    asked: Mapping[str, Any],
) -> None:
    """Add the first frequency in the plane, and out of it with the stiffness there."""
    first = modes(mechanism, count=1, **asked)
    collected.warnings.extend(first.warnings)
    for target, source in zip(collected.arrays, first.internal, strict=True):
        if "frequency" in source:
            target["frequency"] = source["frequency"][0]
        if "first_out_of_plane" in source:
            target["first_out_of_plane"] = source["first_out_of_plane"]
    if "first_out_of_plane" in collected.arrays.values:
        lifted = lifted_stiffness(mechanism)
        if "lifted_free" in lifted.values:
            collected.arrays.values["lifted_free"] = lifted.values["lifted_free"]
            collected.arrays.bands["lifted_free"] = lifted.bands["lifted_free"]


def _add_reach(
    collected: _Collected, mechanism: Mechanism, mesh: Mesh | None, models: Models
) -> None:
    """Add the ranges of the output by the drive, and say of what they are."""
    reached = motion_by_strokes(mechanism, mesh, models)
    collected.notes.append(
        f"range of the drive ({reached.axes['model'][-1]}): with all actuators in place; natural "
        "frequencies: without the actuators"
    )
    collected.warnings.extend(reached.warnings)
    for target, source in zip(collected.arrays, reached.internal, strict=True):
        if "ends" in source:
            target |= ends_of(source["ends"])


def ends_of(ends: Array) -> dict[str, Array]:
    """Return the ranges of the drive by the last model from the `ends` of `reach`, or from their
    bands.
    """
    found = dict[str, Array]()
    for others, by_end in zip(("held", "free"), ends[:, :, -1], strict=True):
        for end, pose in zip(("low", "high"), by_end, strict=True):
            found[f"{others}_{end}"] = np.where(np.abs(pose) < NEGLIGIBLE, 0.0, pose)
    return found
