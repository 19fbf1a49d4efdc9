"""Natural frequencies of a mechanism by finite elements and analytic models, and the motion of its
output in every mode.

It vibrates at rest, or about the equilibrium under a load, preloads of actuators and residual
stress. Modes out of the plane are those of the whole plate in three dimensions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.network import NetworkModes
from flexfem.analytic.plates import modes as network_modes
from flexfem.analytic.plates import moving_bodies
from flexfem.analytic.preloaded import modes as beam_modes
from flexfem.arrays import AnyArray, Array, Index
from flexfem.fem.mesh import PlaneMesh
from flexfem.fem.modes import Modes
from flexfem.fem.ports import plate_modes
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates, preloaded
from flexfem.questions.loads import AtPoints, stated_load
from flexfem.questions.mode_order import (
    LEAST_ALIKE,
    NONE,
    ModeRows,
    in_rows,
    likeness,
    lowest_modes,
    of_modes,
    shares_of_motion,
    side_by_side,
)
from flexfem.questions.mode_shapes import (
    motions_by_twists,
    motions_of_parts,
    names_of_bodies,
    network_fields,
    what_moves,
)
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
from flexfem.results import (
    ANALYTIC,
    COARSE_MESHES,
    ELEMENTS,
    MAGNITUDE,
    SOLID,
    Gate,
    Progress,
    Quantity,
    Result,
)
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
        "modes in one row have one shape: their modal assurance over the plate is above "
        f"{LEAST_ALIKE:g}, for close frequencies that of their groups; others are alone in a row",
        "the mass of a hinge in the analytic models moves as in its static deflection between "
        "its two bodies: they have no modes in which leaf springs vibrate",
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
    in_plane: bool = False,
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
    in_plane : bool
        Leave out the first frequency out of the plane of a mechanism, a third of the time of finite
        elements.
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

    @cache
    def by_network(elastic: bool) -> NetworkModes:
        return _by_network(asked, plates.joined_parts(mechanism, elastic))

    def element_values(
        resolution: int,
        layers: int,
        thick: Thickened | None = None,
    ) -> Values:
        values = by_mesh(resolution, layers).values
        return values if thick is None else _thickened(asked, values, thick)

    def network_values(elastic: bool) -> Values:
        if load is not None and elastic:
            return {"frequency": np.array([])}  # beams have rigid bodies
        return {"frequency": by_network(elastic).frequencies}

    found = plates.by_models(mechanism, mesh, models, network_values, element_values, progress)
    if load is not None:
        found.pop(ELASTIC, None)
    analytic = {name: by_network(name == ELASTIC) for name in (ANALYTIC, ELASTIC) if name in found}
    shapes = _shapes_on(mesh, mechanism, by_mesh)
    order = lowest_modes(found, count)
    rows = side_by_side(found, order, count, _alike(mechanism.layout, analytic, shapes))
    first = NOTHING_LIFTED if in_plane else _first_out_of_plane(asked, mesh, found)
    notes = _what_moves(mechanism.layout, analytic, shapes, rows)
    if load is not None and SOLID in found:
        notes.insert(0, preloaded.IN_THREE_DIMENSIONS)
    return answer(
        MechanismModes,
        mechanism,
        in_rows(found, rows),
        mesh,
        _settings(asked, drives),
        {**_motion(found, rows, mesh), **first.values},
        {"mode": _names(order >= count, mesh) + rows.alone},
        first.bands,
        warnings=first.warnings,
        notes=notes,
        fields=_fields(shapes, order),
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
    """Frequencies and shares of the output on one mesh, and displacements of its nodes.

    planar : (k, n, 2), of modes in the plane, or of the mid-plane (k, n, 3) with layers.
    lifted : (k, n, 3), with layers, of modes out of the plane.
    """

    values: Values
    planar: Array
    lifted: Array | None


class ModeShapes(NamedTuple):
    """ModeShapes of modes by finite elements, in the plane as of `ByMesh` and out of it.

    flat : with layers, those of plane finite elements on the same mesh.
    """

    mesh: PlaneMesh
    planar: Array
    lifted: Array | None
    flat: Array | None

    def field(self, number: int, count: int) -> Array:
        """Return the displacements of a mode; those from `count` on are out of the plane."""
        if number < count:
            return np.asarray(self.planar[number])
        assert self.lifted is not None
        return np.asarray(self.lifted[number - count])


class OutOfPlane(NamedTuple):
    """Values and bands of the first frequency out of the plane by quantity, and warnings."""

    values: dict[str, Array]
    bands: dict[str, float]
    warnings: list[str]


NOTHING_LIFTED = OutOfPlane({}, {}, [])


def _is_engaged(mechanism: Mechanism, drives: Drives) -> bool:
    """Whether actuators stiffen the mechanism. Raises BadInput without actuators."""
    if drives == "engaged" and not mechanism.layout.actuators:
        raise BadInput(f"{mechanism.origin}: drives 'engaged', expected at least one [[actuator]]")
    return drives == "engaged"


def _settings(asked: Vibrating, drives: Drives) -> dict[str, str]:
    """Return what is stated of the actuators and of the preload."""
    found = dict[str, str]()
    if asked.mechanism.layout.actuators:
        found["actuators"] = drives
    if asked.load is not None:
        found["preload"] = preloaded.described(asked.mechanism, asked.load)
    return found


def _by_network(asked: Vibrating, parts: ElasticParts) -> NetworkModes:
    """Return the modes of the network of bodies and hinges, or of beams under a load."""
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
    planar = _fields_of(in_plane.modes)
    values = _with_shares(asked, in_plane, False)
    if not layers:
        return ByMesh(values, planar, None)
    out_of_plane = _modes_of(asked, resolution, layers, True)
    lifted = _with_shares(asked, out_of_plane, True)
    both = {name: np.concatenate([values[name], lifted[name]]) for name in values}
    return ByMesh(both, planar, _fields_of(out_of_plane.modes))


def _fields_of(found: Modes) -> Array:
    """Return displacements (k, n, 2 or 3) of the nodes in all modes, with layers at mid-plane."""
    fields = [found.field(number) for number in range(len(found.frequencies))]
    return np.array([field if field.ndim == 2 else field[:, 0] for field in fields])


def _shapes_on(
    mesh: Mesh | None,
    mechanism: Mechanism,
    by_mesh: Callable[[int, int], ByMesh],
) -> ModeShapes | None:
    """Return the shapes on the finest mesh, with layers those with one of them."""
    if mesh is None:
        return None
    finest = by_mesh(mesh.resolution, min(mesh.layers, 1))
    flat = by_mesh(mesh.resolution, 0).planar if mesh.layers else None
    on = plates.meshed(mechanism, mesh.resolution)
    return ModeShapes(on, finest.planar, finest.lifted, flat)


def _alike(
    layout: Layout,
    analytic: Mapping[str, NetworkModes],
    shapes: ModeShapes | None,
) -> dict[str, Array]:
    """Return the likeness (m, k) of modes of models and those in the plane by finite elements."""
    if shapes is None:
        return {}
    found = dict[str, Array]()
    for name, modes in analytic.items():
        fields = network_fields(layout, shapes.mesh, _twists_of(layout, modes))
        found[name] = likeness(shapes.mesh, fields, shapes.planar)
    if shapes.flat is not None:
        found[ELEMENTS] = likeness(shapes.mesh, shapes.flat, shapes.planar)
    return found


def _twists_of(layout: Layout, found: NetworkModes) -> Array:
    """Return the twists (b, 3, modes) of the moving bodies at the origin."""
    rows = 3 * len(moving_bodies(layout))
    return found.motions[:rows].reshape(-1, 3, found.motions.shape[1])


def _what_moves(
    layout: Layout,
    analytic: Mapping[str, NetworkModes],
    shapes: ModeShapes | None,
    rows: ModeRows,
) -> list[str]:
    """Return notes on what moves in the mode of every row."""
    *others, last = rows.modes
    count = len(rows.modes[last]) - len(rows.alone)
    names = [*map(str, range(1, count + 1)), *rows.alone]
    found = list[str]()
    for row, name in enumerate(names):
        number = int(rows.modes[last][row])
        if number == NONE:
            model = next(label for label in others if rows.modes[label][row] != NONE)
            words = _by_twists(layout, analytic[model], int(rows.modes[model][row]))
        elif shapes is not None:
            words = _by_field(layout, shapes.mesh, shapes.field(number, count))
        elif number < len(analytic[last].frequencies):
            words = _by_twists(layout, analytic[last], number)
        else:
            break
        found.append(f"mode {name}: {words}")
    return found


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
        frequencies,
        _by_network(asked, thick.plane).frequencies,
        _by_network(asked, thick.solid).frequencies,
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
    found: Mapping[str, ModelAnswer],
    rows: ModeRows,
    mesh: Mesh | None,
) -> dict[str, Array]:
    """Return the shares (modes, 3) of the output in the plane and, with layers, out of it."""
    if mesh is None:
        return {}
    *_, last = found
    order = rows.modes[last]
    share = of_modes(found[last].values["share"], order)
    lifted = (order >= len(order) - len(rows.alone))[:, None]
    values = {"share": np.where(lifted, np.nan, share)}
    if mesh.layers:
        values["tilt"] = np.where(lifted, share, np.nan)
    return values


def _names(lifted: AnyArray, mesh: Mesh | None) -> list[str]:
    """Return the names of modes, in three dimensions with the plane that they are in."""
    if mesh is None or not mesh.layers:
        return [str(number + 1) for number in range(len(lifted))]
    return [
        f"{number} {'out of' if out else 'in'} the plane"
        for number, out in enumerate(lifted, start=1)
    ]


def _fields(shapes: ModeShapes | None, order: Index) -> MeshFields | None:
    """Return the shapes of modes in the plane, named by their rows, on their mesh.

    Of three dimensions they are those of the mid-plane; modes out of the plane are left out.
    """
    planar = dict[str, int]()
    for row, number in enumerate(order.tolist(), start=1):
        if number < len(order):
            planar[f"mode {row}"] = number
    if shapes is None or not planar:
        return None
    in_plane = shapes.planar[:, :, :2]
    return MeshFields(
        shapes.mesh,
        lambda: {name: in_plane[number] for name, number in planar.items()},
    )


def _by_field(
    layout: Layout,
    mesh: PlaneMesh,
    field: Array,
) -> str:
    """Return what moves in a mode of finite elements."""
    names = [*names_of_bodies(layout), *(joint.name for joint in layout.joints)]
    motions = motions_of_parts(mesh, [(number,) for number in range(len(names))], names, field)
    first = len(layout.bodies)
    moving = [
        motion
        for motion, body in zip(motions[:first], layout.bodies, strict=True)
        if not body.fixed
    ]
    return what_moves(moving, motions[first:])


def _by_twists(
    layout: Layout,
    found: NetworkModes,
    number: int,
) -> str:
    """Return what moves in a mode of an analytic model."""
    twists = _twists_of(layout, found)[:, :, number]
    return what_moves(motions_by_twists(layout, twists))


def _first_out_of_plane(
    asked: Vibrating, mesh: Mesh | None, found: Mapping[str, ModelAnswer]
) -> OutOfPlane:
    """Return the first natural frequency out of the plane, rad/s, of models in three dimensions."""
    if SOLID not in found or mesh is None:
        return NOTHING_LIFTED
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
