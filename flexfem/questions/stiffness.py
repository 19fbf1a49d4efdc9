"""A mechanism at rest: stiffness, stress, range, and response to a load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import compress
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import buckling_factors
from flexfem.analytic.preloaded import preloaded as beam_tangent
from flexfem.arrays import Array, free_stiffness
from flexfem.fem.body_stress import moving_bodies
from flexfem.fem.elements import nodal_stress, von_mises
from flexfem.fem.response import Response
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import finite, plates, preloaded, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import levels
from flexfem.questions.loads import loads_at_points
from flexfem.questions.plates import ON_MESHES, PEAK, Responses, Values
from flexfem.questions.ranges import (
    RANGE,
    RANGE_FORCE,
    RANGE_LABELS,
    RANGE_LIMIT,
    described,
    ranges,
)
from flexfem.questions.setup import (
    DEFAULT,
    ELASTIC,
    LIFTED,
    Analytic,
    Mesh,
    MeshFields,
    ModelAnswer,
    Models,
)
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import ANALYTIC, MAGNITUDE, SOLVED, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

UNDER_PRELOAD = (
    "the stiffness is that of small motions about the equilibrium under the preload, where no "
    "stress, range or buckling load is stated"
)
LIMITS = ("range", "buckling_load")  # beginnings of the names of what `no_limits` leaves out
HINGES_ALONE = (
    "the analytic model does not hold there, and its stress and displacement at first yield are "
    "those of hinges alone"
)
# of the place of a highest stress: another one may have nearly the same
NEARLY_EQUAL = Gate(1.0, MAGNITUDE, 1e4)
MATRIX = ("model", "component", "direction")
HINGES = ("model", "hinge")
LIFTED_STIFFNESS = ("n_per_mm", "n_mm_per_rad", "n_mm_per_rad")
LIFTED_LABELS = {"out of plane": LIFTED}
LIFTED_FREE = Quantity(
    "stiffness out of the plane, its other directions free",
    LIFTED_STIFFNESS,
    ("out of plane",),
    ON_MESHES,
)
# directions that are held or free while the output is loaded along each direction
OTHERS_HELD: list[list[int]] = [[1, 2], [0, 2], [0, 1]]
OTHERS_FREE: list[list[int]] = [[], [], []]


class Stiffness(Result):
    """Stiffness, stress per displacement, range at yield and inputs of a mechanism at rest, and its
    response to one load.
    """

    kind_name = "mechanism_stiffness"
    has_mesh_fields = True
    title = "mechanism at rest"
    main_result = ("free", {})
    figure = "plate.load_figure"
    drawn_from_fields = True
    labels: ClassVar = {**RANGE_LABELS, **LIFTED_LABELS}
    columns = ("direction", "out of plane")
    stiffness = Quantity("stiffness", "stiffness matrix", MATRIX, ON_MESHES, "matrix", detail=True)
    compliance = Quantity(
        "compliance", "compliance matrix", MATRIX, ON_MESHES, "matrix", detail=True
    )
    # not compared: the error of the analytic models is that with the others free
    held = Quantity(
        "stiffness, other directions held",
        "stiffness",
        ("model", "direction"),
        ON_MESHES,
        repeated=True,
        note="K_ii, the diagonal of the stiffness matrix",
        compared=False,
    )
    free = Quantity(
        "stiffness, other directions free",
        "stiffness",
        ("model", "direction"),
        ON_MESHES,
        note="1 / C_ii, of the diagonal of the compliance matrix",
    )
    range = RANGE
    range_force = RANGE_FORCE
    range_limit = RANGE_LIMIT
    range_stress = Quantity(
        "highest hinge stress at the end of the range",
        "mpa",
        ("others", "sense", "hinge", "direction"),
        PEAK,
        "all",
        detail=True,
    )
    stress = Quantity(
        "highest hinge stress per displacement, other directions held",
        "stress per motion",
        (*HINGES, "direction"),
        PEAK,
        "all",
        detail=True,
    )
    yield_range = Quantity(
        "displacement at first yield, other directions held, linear",
        "motion",
        ("model", "direction"),
        PEAK,
        note="by linear theory, without stretching of hinges and buckling",
        detail=True,
    )
    free_yield_range = Quantity(
        "displacement at which the first hinge yields, other directions free, linear",
        "motion",
        ("model", "direction"),
        PEAK,
        detail=True,
    )
    yield_force = Quantity(
        "force at first yield, other directions held, linear",
        "wrench",
        ("model", "direction"),
        PEAK,
        detail=True,
    )
    buckling_load = Quantity(
        "load at which hinges buckle, by the analytic model",
        "wrench",
        ("others", "sense", "direction"),
        SOLVED,
        note="by the tangent stiffness at rest, for a load on the output along one direction",
        detail=True,
    )
    input_stiffness = Quantity(
        "stiffness at the actuator, output free",
        "n_per_um",
        ("actuator", "model"),
        ON_MESHES,
        detail=True,
    )
    lifted_held = Quantity(
        "stiffness out of the plane, its other directions held",
        LIFTED_STIFFNESS,
        ("out of plane",),
        ON_MESHES,
    )
    lifted_free = LIFTED_FREE
    lifted_force = Quantity(
        "load on the output out of the plane", ("n", "n_mm", "n_mm"), ("out of plane",)
    )
    lifted_pose = Quantity(
        "displacement by the load out of the plane",
        ("mm", "rad", "rad"),
        ("out of plane",),
        ON_MESHES,
        "all",
    )
    amplification = Quantity(
        "output motion per actuator opening, output free",
        ("", "", "rad_per_mm"),
        ("actuator", "model", "direction"),
        ON_MESHES,
        "all",
        detail=True,
    )
    force = Quantity("load on the output", "wrench", ("model", "direction"), ON_MESHES, "wrench")
    pose = Quantity(
        "displacement under the load", "motion", ("model", "point", "direction"), ON_MESHES, "pose"
    )
    energy = Quantity("strain energy", "n_mm", ("model",), ON_MESHES)
    hinge_stress = Quantity("hinge stress under the load", "mpa", HINGES, PEAK, "all")
    body_stress = Quantity(
        "highest stress of bodies under the load", "mpa", ("body", "model"), PEAK, "all"
    )
    body_x = Quantity("at x", "mm", ("body", "model"), NEARLY_EQUAL)
    body_y = Quantity("at y", "mm", ("body", "model"), NEARLY_EQUAL)
    body_rate = Quantity(
        "highest stress of bodies per displacement, other directions held",
        "stress per motion",
        ("body", "model", "direction"),
        PEAK,
        "all",
        note=(
            "not within three radii of the contact of the output, of an actuator or of a loaded "
            "point"
        ),
        detail=True,
    )
    free_body_rate = Quantity(
        "highest stress of bodies per displacement, other directions free",
        "stress per motion",
        ("body", "model", "direction"),
        PEAK,
        "all",
        shown=False,
    )
    yield_x = Quantity(
        "place of the first yield, x", "mm", ("model", "direction"), NEARLY_EQUAL, shown=False
    )
    yield_y = Quantity(
        "place of the first yield, y", "mm", ("model", "direction"), NEARLY_EQUAL, shown=False
    )
    point_load = Quantity("loads at points", "wrench", ("point", "direction"))
    point_stress = Quantity(
        "von Mises stress at points under the load", "mpa", ("point", "model"), PEAK, "all"
    )


class Load(NamedTuple):
    """The load that is asked for: on the first ports (n,), or by a displacement (3,) of the output.

    at_points : (points, 3), the part of the load that is stated at points.
    """

    on_ports: Array | None = None
    displacement: Array | None = None
    at_points: Array | None = None

    def of(self, stiffness: Array) -> Array | None:
        """Return the load (n,) on the first ports, for an output of stiffness (3, 3); None if no
        load is asked for.
        """
        if self.displacement is None:
            return self.on_ports
        return np.asarray(stiffness @ self.displacement)


class PartOfAnswer(NamedTuple):
    """A part of an answer: values and bands of all models by quantity, settings, warnings, notes."""

    values: Mapping[str, Any] = setup.NOTHING
    bands: Mapping[str, Any] = setup.NOTHING
    settings: Mapping[str, Any] = setup.NOTHING
    warnings: Sequence[str] = ()
    notes: Sequence[str] = ()


class _Asked(NamedTuple):
    """What is asked about a mechanism: the load, the mesh and the models."""

    mechanism: Mechanism
    load: Load
    mesh: Mesh | None
    models: Models
    progress: Progress | None


@setup.options(not_for="analytic")
def stiffness(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    force: tuple[float, float, float] | None = None,
    displacement: tuple[float, float, float] | None = None,
    force_at: Mapping[str, Sequence[float]] | Sequence[str] | None = None,
    tangent: bool = False,
    out_of_plane: bool = False,
    force_out_of_plane: tuple[float, float, float] | None = None,
    no_limits: bool = False,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> Stiffness:
    """Stiffness, stress and range of the output, and the response to a load or a displacement.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    force : tuple of float, optional
        Load on the output: N, N, N mm.
    displacement : tuple of float, optional
        Displacement at which the output is held, instead of a load: mm, mm, rad.
    force_at : mapping of str to tuple of float, or sequence of str, optional
        Loads at points by their names, N, N, N mm, besides that on the output:
        NAME=FX,FY,M, repeated. Two opposite loads at two points are a pair between their bodies.
    tangent : bool
        Stiffness at the equilibrium under the load, instead of that at rest and the
        response to it.
    out_of_plane : bool
        Also the stiffness of the output out of the plane: along z, and tilt about x
        and y.
    force_out_of_plane : tuple of float, optional
        Load on the output out of the plane, whose displacement is computed: force
        along z and moments about x and y, N, N mm, N mm.
    no_limits : bool
        Leave out buckling loads and the range at finite displacement of a mechanism, which take
        most of the time of the analytic model.
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
    Stiffness
        Of a stage file `StageStiffness`. Every number has the unit that its quantity declares:
        `unit` returns it, and `flexfem schema mechanism_stiffness` or `flexfem schema stiffness`
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
    >>> found = flexfem.stiffness(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(float(found.at("yield_range", direction="x")[0]), 3)  # mm
    0.641
    """
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    load = load_of(mechanism.layout, force, displacement, force_at)
    if force_out_of_plane is not None:
        out_of_plane = True
    if out_of_plane and (models == "analytic" or mechanism.model != "three_dimensional"):
        raise BadInput(
            "out_of_plane, expected finite elements in three dimensions, without plane or models "
            "'analytic'"
        )
    preload = _preload(mechanism, load, tangent)
    if preload is not None:
        small = load._replace(on_ports=None) if tangent else load
        return _at_preload(_Asked(mechanism, small, mesh, models, progress), preload)
    asked = _Asked(mechanism, load, mesh, models, progress)
    found = _by_models(asked)
    parts = [PartOfAnswer(warnings=warning.of_numbers(mechanism))]
    parts += [_soft_bodies(found), _body_yields(mechanism, mesh, found)]
    if not no_limits:
        parts += [_buckling(mechanism, found), _ranges(mechanism, mesh, found)]
    parts += [_under_load(mechanism, found), _beyond_linear(mechanism, found, load)]
    if out_of_plane:
        parts.append(lifted_stiffness(mechanism, force_out_of_plane))
    if load.at_points is not None:
        parts.append(PartOfAnswer({"point_load": load.at_points}))
    fields = _fields_of(asked, found)
    return setup.answer(Stiffness, mechanism, found, mesh, fields=fields, **joined(parts))


def load_of(
    layout: Layout,
    force: Sequence[float] | None,
    displacement: Sequence[float] | None,
    force_at: Mapping[str, Sequence[float]] | Sequence[str] | None = None,
) -> Load:
    """Return the load that is asked for. Raises BadInput."""
    if displacement is not None:
        if force is not None:
            raise BadInput("force and displacement, expected one of the two")
        if force_at:
            raise BadInput("displacement and force_at, expected one of the two")
        return Load(displacement=arguments.poses("displacement", displacement, 1))
    on_output = None if force is None else arguments.forces("force", force, 1)
    if not force_at:
        return Load(on_output)
    at_points = loads_at_points(layout, force_at)
    on_ports = np.ravel(at_points).copy()
    if on_output is not None:
        on_ports[:3] += on_output
    return Load(on_ports, at_points=at_points)


def joined(parts: Sequence[PartOfAnswer]) -> dict[str, Any]:
    """Return parts of an answer as arguments of `setup.answer`."""
    values = dict[str, Any]()
    bands = dict[str, Any]()
    settings = dict[str, Any]()
    for part in parts:
        values |= part.values
        bands |= part.bands
        settings |= part.settings
    return {
        "values": values,
        "bands": bands,
        "settings": settings,
        "warnings": [text for part in parts for text in part.warnings],
        "notes": [text for part in parts for text in part.notes],
    }


def last_of(found: Mapping[str, ModelAnswer]) -> Values:
    """Return the values of the last model, which is the most accurate one."""
    return list(found.values())[-1].values


# values of one model


def at_rest(compliance: Array) -> dict[str, Array]:
    """Return the stiffness of the output from its compliance (3, 3)."""
    K = np.asarray(np.linalg.inv(compliance))
    K = (K + K.T) / 2
    return {
        "compliance": compliance,
        "stiffness": K,
        "held": np.diag(K),
        "free": free_stiffness(K),
    }


def values_of_ports(mechanism: Mechanism, response: Responses) -> Values:
    """Return the values at rest, with the inputs seen from the drives.

    The amplification is the motion of the output, which is free, per opening of one actuator.
    """
    C = response.compliance
    values: Values = at_rest(C[:3, :3])
    values |= _yield_at_rest(mechanism, response, values)
    drives = mechanism.layout.drive_ports
    if drives:
        values["input_stiffness"] = 1 / np.diag(C)[drives]
        values["amplification"] = plates.amplification(mechanism.layout, C)
    return values


def _yield_at_rest(
    mechanism: Mechanism,
    response: Responses,
    rigid: Values,
) -> Values:
    """Return stress per displacement of the output along one direction, and the ranges at yield.

    rigid : values of `at_rest`.
    """
    count = len(response.compliance)
    strength = mechanism.material.yield_strength
    shares = plates.shares_of_yield(mechanism, "stress")
    held = rigid["stiffness"] @ np.eye(3, count)  # loads that move the output, the others held
    alone = np.diag(rigid["free"]) @ np.eye(3, count)  # the same, the others free
    stress = response.stress(held)
    values = Values()
    if stress.size:
        highest = np.max((response.stress(alone) * shares).reshape(3, -1), axis=1)
        values |= {"stress": np.moveaxis(stress, 0, -1), "free_yield_range": strength / highest}
    of_parts = np.moveaxis(stress * shares, 0, -1).reshape(-1, 3)
    if response.bodies is not None:
        of_bodies = response.bodies(held)
        values["body_rate"] = of_bodies.highest.T
        values["free_body_rate"] = response.bodies(alone).highest.T
        body_shares = plates.shares_of_yield(mechanism, "body_rate")
        of_parts = np.concatenate([of_parts, (of_bodies.highest * body_shares).T])
        places = _first_places(mechanism.layout, of_parts, of_bodies.place)
        values |= {"yield_x": places[:, 0], "yield_y": places[:, 1]}
    if of_parts.size:
        reach = strength / np.max(of_parts, axis=0)
        values |= {"yield_range": reach, "yield_force": rigid["held"] * reach}
    return values


def _first_places(
    layout: Layout,
    stress: Array,
    in_bodies: Array,
) -> Array:
    """Return the places (3, 2) of the highest stress for a displacement along each direction.

    stress : (hinges and moving bodies, 3).   in_bodies : places (3, bodies, 2).
    """
    hinges = [[joint.place.real, joint.place.imag] for joint in layout.joints]
    first = np.argmax(stress, axis=0)
    return np.array([[*hinges, *in_bodies[axis]][part] for axis, part in enumerate(first)])


def _values(
    mechanism: Mechanism,
    response: Responses,
    load: Load,
) -> Values:
    """Return the values at rest, and those under the load if there is one."""
    values = values_of_ports(mechanism, response)
    stated = load.of(values["stiffness"])
    if stated is not None:
        values |= _values_under(mechanism.layout, response, stated)
    return values


def _values_under(
    layout: Layout,
    response: Responses,
    stated: Array,
) -> Values:
    """Return the values under a load (n,) on the first ports: on the output, or on all points."""
    loads = np.zeros(len(response.compliance))
    loads[: len(stated)] = stated
    motions = response.compliance @ loads
    points = len(layout.points)
    values: Values = {
        "force": loads[:3],
        "pose": motions[: 3 * points].reshape(-1, 3),
        "energy": loads @ motions / 2,
        "hinge_stress": response.stress(loads),
    }
    if response.bodies is None:
        return values
    bodies = response.bodies(loads)
    values |= {
        "body_stress": bodies.highest,
        "body_x": bodies.place[:, 0],
        "body_y": bodies.place[:, 1],
    }
    if points > 1 and response.points is not None:
        values["point_stress"] = response.points(loads)
    return values


def _by_models(asked: _Asked) -> dict[str, ModelAnswer]:
    """Return the values of all models."""
    mechanism, load, mesh, models, progress = asked

    def values(response: Responses) -> Values:
        return _values(mechanism, response, load)

    return plates.of_models(mechanism, mesh, models, values, progress)


# under a preload


def _preload(
    mechanism: Mechanism,
    load: Load,
    tangent: bool,
) -> Array | None:
    """Return the load (k,) at whose equilibrium the stiffness is asked for, None at rest.

    Raises BadInput for a tangent without a load.
    """
    if not tangent:
        return preloaded.preload_of(mechanism, None)
    if load.on_ports is None:
        raise BadInput("tangent, expected force or force_at, under which the stiffness is computed")
    on_ports = np.zeros(len(mechanism.layout.ports))
    on_ports[: len(load.on_ports)] = load.on_ports
    return mechanism.layout.preload + on_ports


def _at_preload(asked: _Asked, preload: Array) -> Stiffness:
    """Return the stiffness at the equilibrium under a preload (k,), and the displacement by a small
    load on it.
    """
    mechanism, load, mesh, models, progress = asked
    layout = mechanism.layout

    def of_tangent(compliance: Array) -> Values:
        response = Responses(compliance, lambda loads: np.zeros((*loads.shape[:-1], 0)))
        values = _values(mechanism, response, load)
        values.pop("hinge_stress", None)
        return values

    def of_parts(parts: plates.ElasticParts) -> Array:
        return beam_tangent(layout, preload, parts.hinges).compliance

    @cache
    def by_mesh(resolution: int, layers: int) -> Array:
        return preloaded.compliance_under(mechanism, preload, resolution, layers)

    def on_mesh(
        resolution: int,
        layers: int,
        thick: plates.Thickened | None = None,
    ) -> Values:
        compliance = by_mesh(resolution, layers)
        if thick is not None:
            compliance = compliance + thick.change(of_parts)
        return of_tangent(compliance)

    found = dict[str, ModelAnswer]()
    if models != "elements" and layout.joints:
        found[ANALYTIC] = ModelAnswer(of_tangent(of_parts(plates.ElasticParts())))
    notes = [UNDER_PRELOAD]
    if mesh is not None:
        thickness = () if mesh.layers else plates.thickness_of(mechanism)
        found |= plates.element_values(mesh, on_mesh, progress, thickness=thickness)
        if mesh.layers:
            notes.append(preloaded.IN_THREE_DIMENSIONS)
    settings = {"preload": preloaded.described(mechanism, preload)}
    return setup.answer(Stiffness, mechanism, found, mesh, settings, notes=notes)


# parts of the answer


def lifted_stiffness(mechanism: Mechanism, force: Sequence[float] | None = None) -> PartOfAnswer:
    """Return the stiffness of the output out of the plane, and its displacement by a load (3,) if
    there is one.
    """
    try:
        found = plates.lifted(mechanism)
    except ComputationFailed as failure:
        return PartOfAnswer(warnings=[f"no stiffness out of the plane: {failure}"])
    free = 1 / np.diag(found.compliance)
    values = {"lifted_held": np.diag(found.stiffness), "lifted_free": free}
    bands = {
        "lifted_held": np.diag(found.stiffness_band),
        "lifted_free": free**2 * np.diag(found.compliance_band),
    }
    if force is not None:
        load = arguments.forces("force_out_of_plane", force, 1)
        values |= {"lifted_force": load, "lifted_pose": found.compliance @ load}
        bands["lifted_pose"] = found.compliance_band @ np.abs(load)
    return PartOfAnswer(values, bands)


def _soft_bodies(found: Mapping[str, ModelAnswer]) -> PartOfAnswer:
    """Warn of directions in which the bodies, which the analytic model takes as rigid, are softer
    than the hinges.
    """
    if ELASTIC not in found:
        return PartOfAnswer()
    rigid = found[ANALYTIC].values["free"]
    elastic = found[ELASTIC].values["free"]
    soft = ", ".join(compress(DIRECTIONS, rigid > 2 * elastic))
    if not soft:
        return PartOfAnswer()
    return PartOfAnswer(
        warnings=[f"in {soft}, bodies are more compliant than hinges: {HINGES_ALONE}"]
    )


def _body_yields(
    mechanism: Mechanism, mesh: Mesh | None, found: Mapping[str, ModelAnswer]
) -> PartOfAnswer:
    """Name the part that yields first by finite elements, and the corners near which no stress is
    stated.
    """
    last = last_of(found)
    if mesh is None or "body_rate" not in last:
        return PartOfAnswer()
    coarse = plates.meshed(mechanism, levels(mesh.resolution)[0])
    left_out = plates.left_out_corners(mechanism.layout, coarse)
    return PartOfAnswer(warnings=left_out, notes=[_first_yields(mechanism.layout, last)])


def _first_yields(layout: Layout, values: Values) -> str:
    """Return a note on the part that ends each range at yield, and its place."""
    names = [f"hinge {joint.name}" for joint in layout.joints]
    names += [f"body {layout.bodies[index].name}" for index in moving_bodies(layout)]
    stress = values["body_rate"] / layout.body_strengths[:, None]
    if "stress" in values:
        stress = np.concatenate([values["stress"] / layout.hinge_strengths[:, None], stress])
    texts = list[str]()
    for axis, direction in enumerate(DIRECTIONS):
        name = names[int(np.argmax(stress[:, axis]))]
        x = values["yield_x"][axis]
        y = values["yield_y"][axis]
        texts.append(f"along {direction} {name} at ({x:.4g}, {y:.4g}) mm")
    return f"first yield by finite elements and linear theory: {'; '.join(texts)}"


def _buckling(mechanism: Mechanism, found: Mapping[str, ModelAnswer]) -> PartOfAnswer:
    """Return the loads at which hinges buckle by the analytic model, and warn of those below the
    forces at yield.
    """
    if ANALYTIC not in found:
        return PartOfAnswer()
    loads = buckling_loads(mechanism.layout)
    warnings = _of_buckling(loads, last_of(found)["yield_force"])
    return PartOfAnswer({"buckling_load": loads}, warnings=warnings)


def buckling_loads(layout: Layout) -> Array:
    """Return loads (2 others held or free, 2 senses, 3), N and N mm, at which hinges buckle; nan
    where they do not.

    The other directions of the output are held, so that it keeps them, or free. The load is along
    one direction."""
    senses = np.array([1.0, -1.0])
    along = np.eye(3, len(layout.ports))[None] * senses[:, None, None]
    loads = along.reshape(6, -1)
    factors = list[Array]()
    for ports in (OTHERS_HELD, OTHERS_FREE):
        factors.append(buckling_factors(layout, loads, ports * 2).reshape(2, 3))
    found = np.array(factors) * senses[:, None]
    return np.where(np.isfinite(found), found, np.nan)


def _of_buckling(loads: Array, yield_force: Array) -> list[str]:
    """Warn of forces at yield (3,), with the other directions held, at which hinges have buckled
    before.

    loads : (2 others held or free, 2 senses, 3).
    """
    senses_of = dict[tuple[str, str], list[str]]()
    for axis, direction in enumerate(DIRECTIONS):
        at_yield = yield_force[axis]
        for sense, (held, free) in zip("+-", np.abs(loads[:, :, axis].T), strict=True):
            if held < at_yield:
                text = f"at {_as_load(held, axis)} with the other directions held"
                if np.isfinite(free):
                    text += f" and {_as_load(free, axis)} with them free"
                text += f"; the linear force at yield is {_as_load(at_yield, axis)}"
                senses_of.setdefault((direction, text), []).append(sense)
    warnings = list[str]()
    for (along, text), senses in senses_of.items():
        sign = "±" if len(senses) == 2 else senses[0]
        warnings.append(f"hinges buckle before they yield along {sign}{along}: {text}")
    return warnings


def _as_load(value: float, axis: int) -> str:
    """Return a load with its unit: N, or N mm about theta."""
    return f"{value:.4g} {'N mm' if axis == 2 else 'N'}"


def _ranges(
    mechanism: Mechanism, mesh: Mesh | None, found: Mapping[str, ModelAnswer]
) -> PartOfAnswer:
    """Return the ranges at finite displacements, and name their limits."""
    if not mechanism.layout.joints:
        return PartOfAnswer()
    try:
        reached = ranges(mechanism, mesh, found)
    except ComputationFailed as failure:
        return PartOfAnswer(warnings=[f"no range at finite displacements: {failure}"])
    stress = reached.array("stress") / mechanism.layout.hinge_shares
    values = {
        "range": reached.array("displacement"),
        "range_force": reached.array("force"),
        "range_limit": np.moveaxis(reached.array("governing"), -1, 2),
        "range_stress": np.moveaxis(stress, -1, 2),
    }
    bands = {
        "range": reached.array("displacement_band"),
        "range_force": reached.array("force_band"),
    }
    return PartOfAnswer(values, bands, notes=described(mechanism.layout, reached))


def _under_load(mechanism: Mechanism, found: Mapping[str, ModelAnswer]) -> PartOfAnswer:
    """Warn of stress beyond the yield strength under the load."""
    if "force" not in last_of(found):
        return PartOfAnswer()
    return PartOfAnswer(
        warnings=plates.over_yield(mechanism, found, "hinge_stress", "under this load")
    )


def _beyond_linear(
    mechanism: Mechanism, found: Mapping[str, ModelAnswer], load: Load
) -> PartOfAnswer:
    """Warn of a load or displacement at which linear theory is off by more than its band, by beams."""
    if "force" not in last_of(found) or not mechanism.layout.joints:
        return PartOfAnswer()
    if load.displacement is not None:
        applied = finite.by_pose(mechanism.layout, load.displacement)
    else:
        assert load.on_ports is not None
        applied = finite.by_loads(mechanism.layout, load.on_ports)
    relative = finite.relative_bands(list(found.values())[-1], "pose", "hinge_stress")
    changes = finite.changes(mechanism, None, [applied])
    return PartOfAnswer(warnings=changes.warnings("under this load", None, *relative))


# fields


def _fields_of(asked: _Asked, found: Mapping[str, ModelAnswer]) -> MeshFields | None:
    """Return the fields of finite elements under the load; none without either.

    In three dimensions they are on the coarsest mesh. Plane fields have the pose of the output.
    """
    mechanism, load, mesh, _, _ = asked
    last = last_of(found)
    if mesh is None or "force" not in last:
        return None
    loads = last["force"] if load.on_ports is None else load.on_ports
    size = mesh._replace(resolution=levels(mesh.resolution)[0]) if mesh.layers else mesh
    layers = plates.layers_of(mechanism, size.layers)

    def made() -> dict[str, Array]:
        whole = plates.solved(mechanism, *size).whole
        return fields_under(whole, np.ravel(last["pose"])[:3], loads, mechanism.layout.out_of_plane)

    heights = None if layers is None else layers.heights
    return MeshFields(plates.meshed(mechanism, size.resolution), made, heights)


def fields_under(
    whole: Response, pose: Array, loads: Array, out_of_plane: float
) -> dict[str, Array]:
    """Return displacement, mm, and stress, MPa, at all nodes; there are none in fixed bodies.

    pose : (3,), of the output under loads (n,) on the first ports.
    out_of_plane : share of the stress in the plane that is the stress out of it.
    """
    C = whole.compliance
    count = len(loads)
    at_points = C[:3, 3:count] @ loads[3:]
    on_output = np.linalg.solve(C[:3, :3], pose - at_points)
    force = np.concatenate([on_output, loads[3:]])
    part = whole.structure
    displacement = np.tensordot(force, whole.nodal[:count], axes=1)
    moving = np.unique(part.mesh.triangles)
    highest = np.zeros(displacement.shape[:-1])
    stress = nodal_stress(part.mesh, part.plate, displacement, moving, part.layers)
    highest[moving] = von_mises(stress, out_of_plane).reshape(highest[moving].shape)
    found = {"displacement": displacement, "von_mises": highest}
    if part.layers is not None:
        found["stress"] = np.zeros((*highest.shape, 9))
        found["stress"][moving] = stress.reshape(*highest[moving].shape, 9)
    return found
