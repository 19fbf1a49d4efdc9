"""Natural frequencies of a mechanism by finite elements and analytic models, and the motion of its
output in every mode.

It vibrates at rest, or about the equilibrium under a load, preloads of actuators and residual
stress. Modes out of the plane are those of the whole plate in three dimensions.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.plates import modes as network_modes
from flexfem.analytic.preloaded import modes as beam_modes
from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.modes import Modes
from flexfem.fem.ports import plate_modes
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates, preloaded
from flexfem.questions.loads import AtPoints, stated_load
from flexfem.questions.mode_order import in_order, lowest_modes, shares_of_motion
from flexfem.questions.mode_shapes import unlike_models, what_moves
from flexfem.questions.plates import ElasticParts, Thickened, Values
from flexfem.questions.setup import (
    ELASTIC,
    LIFTED,
    Mesh,
    MeshFields,
    ModelAnswer,
    Models,
    answer,
    elements_through,
    options,
)
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import COARSE_MESHES, MAGNITUDE, SOLID, Gate, Progress, Quantity, Result
from flexfem.units import UNITS

Drives: TypeAlias = Literal["disengaged", "engaged"]
SOLID_RESOLUTION = 4  # triangles across every neck in three dimensions
MOST = 100  # modes
# relative difference of frequencies of one mode by the network of parts and by finite elements
ALIKE = 0.05
MOTION = Gate(1e-3, absolute=1e-4)


class MechanismModes(Result):
    """Natural frequencies of a mechanism with payload and actuators, and the motion of its output
    in every mode.
    """

    title = "natural modes"
    has_mesh_fields = True
    main_result = ("frequency", {})
    figure = "displaced.modes_figure"
    drawn_from_fields = True
    columns: ClassVar[tuple[str, ...]] = ("model", "direction", "motion")
    footnotes: ClassVar[tuple[str, ...]] = (
        "motion of the output: share of each direction in its square; rotations are multiplied "
        "by the lever",
        "a mode that hardly moves the output has no share; of modes with equal frequency, the "
        "first moves along x if possible",
        "more modes out of the plane than the first are computed with `--solid`; a payload is a "
        "flat body at mid-plane",
        "the mass of a hinge in the analytic models moves as in its static deflection between "
        "its two bodies: modes in which leaf springs vibrate are missing, and the numbers of "
        "higher modes differ from those of finite elements",
    )
    frequency = Quantity(
        "natural frequency", "hz", ("mode", "model"), Gate(COARSE_MESHES.relative, MAGNITUDE)
    )
    share = Quantity(
        "motion of the output by finite elements", "percents", ("mode", "direction"), MOTION, "all"
    )
    first_out_of_plane = Quantity(
        "first natural frequency out of the plane",
        "hz",
        gate=Gate(COARSE_MESHES.relative, MAGNITUDE),
    )
    tilt = Quantity(
        "motion of the output out of the plane", "percents", ("mode", "motion"), MOTION, "all"
    )
    labels: ClassVar = {"motion": LIFTED}


@options(not_for="payload tilting damping")
def modes(
    mechanism: Mechanism,
    *,
    count: int = 6,
    force: tuple[float, float, float] | None = None,
    force_at: AtPoints | None = None,
    payload: tuple[float, float] = (0.0, 0.0),
    tilting: float | None = None,
    drives: Drives = "disengaged",
    damping: float = 1.0,
    models: Models = "both",
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> MechanismModes:
    """Natural frequencies and modes of a mechanism with its payload, in the plane or in three
    dimensions.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    count : int
        Number of modes, from the lowest.
    force : tuple of float, optional
        Static load on the output of a mechanism, about whose equilibrium it vibrates: N, N, N mm.
    force_at : mapping of str to tuple of float, or sequence of str, optional
        Static loads at points of a mechanism by their names, N, N, N mm: NAME=FX,FY,M, repeated.
    payload : tuple of float
        Mass, kg, and moment of inertia about the platform's centre, kg mm^2, of a body on the
        platform. Of a stage file only.
    tilting : float, optional
        Moment of inertia of the payload about x and y, kg mm^2, in three dimensions; by default
        half of that about z (flat body). Of a stage file only.
    drives : {"disengaged", "engaged"}
        Engaged stacks stiffen the stage; they hold their strokes, and their mass is neglected.
    damping : float
        Damping of every mode, % of critical, in the reduced models; assumed. Of a stage file only.
    solid : bool
        The whole plate by finite elements in three dimensions; adds modes out of the plane.
    models : {"both", "analytic", "elements"}
        The models to compute.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    MechanismModes
        Of a stage file `NaturalModes`. Every number has the unit that its quantity declares: `unit`
        returns it, and `flexfem schema mechanism_modes` or `flexfem schema natural_modes` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> stage = flexfem.load("geometry/mobility6.toml")
    >>> found = flexfem.modes(stage, count=3, models="elements", resolution=4)
    >>> found.frequency[:, 0].round()  # Hz
    array([131., 131., 194.])
    """
    layers = elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    load = preloaded.preload_of(mechanism, stated_load(mechanism.layout, force, force_at))
    count = arguments.integer("count", count, MOST)
    asked = Vibrating(mechanism, count, _is_engaged(mechanism, drives), load)

    @cache
    def by_mesh(resolution: int, layers: int) -> ByMesh:
        return _by_mesh(asked, resolution, layers)

    def element_values(
        resolution: int,
        layers: int,
        thick: Thickened | None = None,
    ) -> Values:
        values = by_mesh(resolution, layers).values
        return values if thick is None else _thickened(asked, values, thick)

    def by_network(elastic: bool) -> Values:
        if load is not None and elastic:
            return {"frequency": np.array([])}  # beams have rigid bodies
        return {"frequency": _by_network(asked, plates.joined_parts(mechanism, elastic))}

    found = plates.by_models(mechanism, mesh, models, by_network, element_values, progress)
    if load is not None:
        found.pop(ELASTIC, None)
    order = lowest_modes(found, count)
    lifted = order >= count
    motion = dict[str, Array]()
    fields = None
    if mesh is not None:
        motion = _motion(list(found.values())[-1].values["share"][order], lifted, mesh)
        if not mesh.layers:
            fields = _fields(asked, mesh.resolution, by_mesh(mesh.resolution, 0).modes, order)
    first = _first_out_of_plane(asked, mesh, found)
    settings = dict[str, str]()
    if mechanism.layout.actuators:
        settings["actuators"] = drives
    if load is not None:
        settings["preload"] = preloaded.described(mechanism, load)
    notes = list[str]()
    if load is not None and SOLID in found:
        notes.append(preloaded.IN_THREE_DIMENSIONS)
    if fields is not None:
        words = _shapes_in_words(mechanism.layout, fields, order)
        notes += words
        notes += unlike_models(words) if len(found) > 1 else []
    return answer(
        MechanismModes,
        mechanism,
        in_order(found, order, count),
        mesh,
        settings,
        {**motion, **first.values},
        {"mode": _names(lifted, mesh is not None and mesh.layers > 0)},
        first.bands,
        warnings=first.warnings,
        notes=notes,
        fields=fields,
    )


class Vibrating(NamedTuple):
    """What is asked of a mechanism: its lowest modes, `most` of them, with engaged actuators or
    not.

    load : (k,), on the ports, about whose equilibrium it vibrates; None at rest.
    """

    mechanism: Mechanism
    most: int
    engaged: bool
    load: Array | None


class ByMesh(NamedTuple):
    """Frequencies and shares of the output on one mesh, and the modes of a plane one."""

    values: Values
    modes: Modes | None


class OutOfPlane(NamedTuple):
    """Values and bands of the first frequency out of the plane by quantity, and warnings."""

    values: dict[str, Array]
    bands: dict[str, float]
    warnings: list[str]


def _is_engaged(mechanism: Mechanism, drives: Drives) -> bool:
    """Whether actuators stiffen the mechanism. Raises BadInput without actuators."""
    if drives == "engaged" and not mechanism.layout.actuators:
        raise BadInput(f"{mechanism.origin}: drives 'engaged', expected at least one [[actuator]]")
    return drives == "engaged"


def _by_network(asked: Vibrating, parts: ElasticParts) -> Array:
    """Return frequencies (n,), rad/s, by the network of bodies and hinges, or of beams under a
    load.
    """
    layout = asked.mechanism.layout
    if asked.load is not None:
        return beam_modes(layout, asked.load, asked.engaged, parts.hinges)
    return network_modes(layout, parts.bodies, asked.engaged, parts.hinges)


def _by_mesh(
    asked: Vibrating,
    resolution: int,
    layers: int,
) -> ByMesh:
    """Return the modes on one mesh: in the plane, with layers then those out of it."""
    in_plane = _modes_of(asked, resolution, layers, False)
    parts = [_with_shares(asked, in_plane, False)]
    if layers:
        parts.append(_with_shares(asked, _modes_of(asked, resolution, layers, True), True))
    values = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return ByMesh(values, None if layers else in_plane.modes)


class PortModes(NamedTuple):
    """Modes by finite elements, and the unit loads (size, k) of ports on their unknowns."""

    modes: Modes
    ports: Array


def _modes_of(
    asked: Vibrating,
    resolution: int,
    layers: int,
    lifting: bool,
) -> PortModes:
    """Return one mode more than is asked for, so that a pair of equal frequency is whole.

    lifting : out of the plane, with layers.
    """
    more = asked.most + 1
    if asked.load is None:
        model = plates.factorised(asked.mechanism, resolution, layers, lifting)
        return PortModes(plate_modes(model, more, asked.engaged), model.ports)
    return PortModes(
        *preloaded.modes_under(
            asked.mechanism, asked.load, resolution, layers, lifting, more, asked.engaged
        )
    )


def _with_shares(
    asked: Vibrating,
    found: PortModes,
    lifting: bool,
) -> Values:
    """Return frequencies (modes,) and the shares (modes, 3) of directions in the motion of the
    output.
    """
    lever = asked.mechanism.layout.lever
    levers = np.where([False, lifting, True], lever, 1.0)  # z and tilts, or x, y and theta
    motion = found.modes.shapes.T @ found.ports[:, :3] * levers
    shares = shares_of_motion(found.modes.frequencies, motion)
    return {
        "frequency": found.modes.frequencies[: asked.most],
        "share": shares[: asked.most],
    }


def _thickened(
    asked: Vibrating,
    plane: Values,
    thick: Thickened,
) -> Values:
    """Return values of plane finite elements with the change of frequency by the thickness of
    hinges.
    """
    frequencies = plane["frequency"]
    ratios = ratios_by_thickness(
        frequencies, _by_network(asked, thick.plane), _by_network(asked, thick.solid)
    )
    nu = max(material.poissons_ratio for material in asked.mechanism.layout.materials)
    held = np.sqrt(1 / (1 - nu**2))  # of a leaf that vibrates in plane strain
    alone = 1.0  # one variant has plane stress
    if thick.share == 1:
        alone = 1 + (held - 1) / 2  # between plane strain and plane stress
    return plane | {"frequency": frequencies * np.where(np.isnan(ratios), alone, ratios)}


def ratios_by_thickness(
    frequencies: Array,
    plane: Array,
    solid: Array,
) -> Array:
    """Return the ratios (modes,) in three dimensions to plane stress of frequencies by finite
    elements.

    plane, solid : frequencies of the network of parts with hinges in plane stress and in three
    dimensions. The ratio is that of the nearest mode, and nan without one within `ALIKE`: hinges or
    bodies vibrate alone.
    """
    nearest = np.argmin(np.abs(frequencies[:, None] / plane - 1), axis=1)
    alike = np.abs(frequencies / plane[nearest] - 1) < ALIKE
    return np.where(alike, (solid / plane)[nearest], np.nan)


def _motion(
    share: Array,
    lifted: AnyArray,
    mesh: Mesh,
) -> dict[str, Array]:
    """Return the shares (modes, 3) of the output in the plane and, with layers, out of it."""
    values = {"share": np.where(lifted[:, None], np.nan, share)}
    if mesh.layers:
        values["tilt"] = np.where(lifted[:, None], share, np.nan)
    return values


def _names(lifted: AnyArray, in_depth: bool) -> list[str]:
    """Return the names of modes, in three dimensions with the plane that they are in."""
    if not in_depth:
        return [str(number + 1) for number in range(len(lifted))]
    return [
        f"{number} {'out of' if out else 'in'} the plane"
        for number, out in enumerate(lifted, start=1)
    ]


def _fields(
    asked: Vibrating,
    resolution: int,
    found: Modes | None,
    order: Index,
) -> MeshFields:
    """Return the shapes of plane modes, in the order of the table, on their mesh."""
    assert found is not None
    shapes = found

    def made() -> dict[str, Array]:
        return {f"mode {k}": shapes.field(number) for k, number in enumerate(order.tolist(), 1)}

    return MeshFields(plates.meshed(asked.mechanism, resolution), made)


def _shapes_in_words(
    layout: Layout,
    fields: MeshFields,
    order: Index,
) -> list[str]:
    """Return notes on what moves in every mode of plane finite elements, in an order."""
    shapes = list(fields.made().values())
    return [
        f"mode {number}: {what_moves(layout, fields.mesh, shapes[k])}"
        for number, k in enumerate(order.tolist(), start=1)
    ]


def _first_out_of_plane(
    asked: Vibrating, mesh: Mesh | None, found: Mapping[str, ModelAnswer]
) -> OutOfPlane:
    """Return the first natural frequency out of the plane, rad/s, of models in three dimensions."""
    if SOLID not in found or mesh is None:
        return OutOfPlane({}, {}, [])
    values, bands = found[SOLID]
    in_plane = float(values["frequency"][: asked.most].min())
    try:
        if mesh.layers:  # the modes from `most` on are out of the plane
            first = float(values["frequency"][asked.most])
            band = float(bands["frequency"][asked.most])
        elif asked.load is not None:
            first, band = preloaded.first_out_of_plane(asked.mechanism, asked.load)
        else:
            lifted = plates.lifted(asked.mechanism)
            first = lifted.frequency
            band = lifted.frequency_band
    except ComputationFailed as failure:
        return OutOfPlane({}, {}, [f"no frequency out of the plane: {failure}"])
    warnings = list[str]()
    if first < in_plane:
        hertz = UNITS["hz"].factor
        warnings.append(
            f"the lowest natural frequency is out of the plane, at {hertz * first:.5g} Hz, below "
            f"{hertz * in_plane:.5g} Hz in the plane"
        )
    return OutOfPlane(
        {"first_out_of_plane": np.array(first)}, {"first_out_of_plane": band}, warnings
    )
