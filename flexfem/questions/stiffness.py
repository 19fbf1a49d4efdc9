"""A stage or mechanism at rest: stiffness, stress, range at yield, response to a load, and its
summary.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import compress
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import buckling_factors
from flexfem.analytic.preloaded import preloaded as beam_tangent
from flexfem.arrays import Array, free_stiffness, is_largest
from flexfem.fem.body_stress import moving_bodies
from flexfem.fem.elements import Plate, nodal_stress, von_mises
from flexfem.fem.response import Response, unit_response
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import AnalyticResult, ModelChoice, analyse
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import sheet_of
from flexfem.questions import finite, plates, preloaded, setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import SolidLevels, compliance_bands, levels, solid_bands, stress_bands
from flexfem.questions.loads import loads_at_points
from flexfem.questions.modes import modes
from flexfem.questions.plates import Responses, Values
from flexfem.questions.ranges import (
    RANGE,
    RANGE_FORCE,
    RANGE_LABELS,
    RANGE_LIMIT,
    described,
    ranges,
)
from flexfem.questions.reach import motion_by_strokes, reach
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
from flexfem.results import (
    ANALYTIC,
    COARSER,
    FRESH,
    SHEET,
    SOLVED,
    STRESS,
    Gate,
    Progress,
    Quantity,
    Result,
)
from flexfem.units import DIRECTIONS, PLANES, without_unit

UNDER_PRELOAD = (
    "the stiffness is that of small motions about the equilibrium under the preload; stress, "
    "ranges and buckling loads are not stated there"
)
LIMITS = ("range", "buckling_load")  # beginnings of the names of what `no_limits` leaves out
HINGES_ALONE = (
    "the analytic model does not hold there, and its stress and range at yield are those of "
    "hinges alone"
)
NEARLY_EQUAL = Gate(
    1.0, absolute=1e4
)  # of the place of a highest stress: another one may have nearly the same
HELD = "plane strain"  # label of the stiffer of the plane problems that bound three dimensions
MATRIX = ("model", "component", "direction")
NECKS = ("model", "chain", "hinge")
BY_DIRECTION = ("direction", "model")
HINGE = ("chain", "hinge")
UNIT_POSES = dict(zip(DIRECTIONS, np.eye(3), strict=True))


LIFTED_STIFFNESS = ("n_per_mm", "n_mm_per_rad", "n_mm_per_rad")
LIFTED_LABELS = {"out of plane": LIFTED}
LIFTED_FREE = Quantity(
    "stiffness out of the plane, its other directions free",
    LIFTED_STIFFNESS,
    ("out of plane",),
    COARSER,
    only="mechanism",
)


class Stiffness(Result):
    """Stiffness, stress per displacement and range at yield of a plate at rest, and its response to
    one load.
    """

    title = "stage at rest"
    main = ("free", {})
    labels: ClassVar = {**RANGE_LABELS, **LIFTED_LABELS}
    columns = ("direction", "out of plane")
    stiffness = Quantity("stiffness", "stiffness matrix", MATRIX, COARSER, "matrix")
    compliance = Quantity("compliance", "compliance matrix", MATRIX, COARSER, "matrix")
    held = Quantity(
        "stiffness, other directions held",
        "stiffness",
        ("model", "direction"),
        COARSER,
        repeated=True,
        note="K_ii, the diagonal of the stiffness matrix",
    )
    free = Quantity(
        "stiffness, other directions free",
        "stiffness",
        ("model", "direction"),
        COARSER,
        note="1 / C_ii, of the diagonal of the compliance matrix",
    )
    range = RANGE
    range_force = RANGE_FORCE
    range_limit = RANGE_LIMIT
    range_stress = Quantity(
        "highest hinge stress at the end of the range",
        "mpa",
        ("others", "sense", "hinge", "direction"),
        STRESS,
        "all",
        only="mechanism",
    )
    stress = Quantity(
        "highest hinge stress per displacement, other directions held",
        "stress per motion",
        (*NECKS, "direction"),
        STRESS,
        "all",
    )
    yield_range = Quantity(
        "displacement at first yield, other directions held, linear",
        "motion",
        ("model", "direction"),
        STRESS,
        note="by linear theory, without stretching of hinges and buckling",
    )
    free_yield_range = Quantity(
        "displacement at which the first hinge yields, other directions free, linear",
        "motion",
        ("model", "direction"),
        STRESS,
    )
    yield_force = Quantity(
        "force along the displacement at yield, linear", "wrench", ("model", "direction"), STRESS
    )
    buckling_load = Quantity(
        "load at which hinges buckle, by the analytic model",
        "wrench",
        ("others", "sense", "direction"),
        SOLVED,
        only="mechanism",
        note="by the tangent stiffness at rest, for a load on the output along one direction",
    )
    input_stiffness = Quantity(
        "stiffness at the actuator, output free",
        "n_per_um",
        ("actuator", "model"),
        COARSER,
        only="mechanism",
    )
    lifted_held = Quantity(
        "stiffness out of the plane, its other directions held",
        LIFTED_STIFFNESS,
        ("out of plane",),
        COARSER,
        only="mechanism",
    )
    lifted_free = LIFTED_FREE
    lifted_force = Quantity(
        "load on the output out of the plane",
        ("n", "n_mm", "n_mm"),
        ("out of plane",),
        only="mechanism",
    )
    lifted_pose = Quantity(
        "displacement by the load out of the plane",
        ("mm", "rad", "rad"),
        ("out of plane",),
        COARSER,
        "all",
        only="mechanism",
    )
    amplification = Quantity(
        "output motion per actuator opening, output free",
        ("", "", "rad_per_mm"),
        ("actuator", "model", "direction"),
        COARSER,
        "all",
        only="mechanism",
    )
    thickness = Quantity(
        "change of stiffness in three dimensions", "percents", ("direction",), only="stage"
    )
    force = Quantity("load on the output", "wrench", ("model", "direction"), COARSER, "wrench")
    pose = Quantity(
        "displacement under the load", "motion", ("model", "point", "direction"), COARSER, "pose"
    )
    reaction = Quantity(
        "reaction of the ground", "wrench", ("model", "direction"), COARSER, "wrench", only="stage"
    )
    energy = Quantity("strain energy", "n_mm", ("model",), COARSER)
    neck_stress = Quantity("neck stress under the load", "mpa", NECKS, STRESS, "all", only="stage")
    hinge_stress = Quantity(
        "hinge stress under the load", "mpa", NECKS, STRESS, "all", only="mechanism"
    )
    body_stress = Quantity(
        "highest stress of bodies under the load",
        "mpa",
        ("body", "model"),
        STRESS,
        "all",
        only="mechanism",
    )
    body_x = Quantity("at x", "mm", ("body", "model"), NEARLY_EQUAL, only="mechanism")
    body_y = Quantity("at y", "mm", ("body", "model"), NEARLY_EQUAL, only="mechanism")
    body_rate = Quantity(
        "highest stress of bodies per displacement, other directions held",
        "stress per motion",
        ("body", "model", "direction"),
        STRESS,
        "all",
        only="mechanism",
        note=(
            "not within three radii of the contact of the output, of an actuator or of a loaded "
            "point"
        ),
    )
    free_body_rate = Quantity(
        "highest stress of bodies per displacement, other directions free",
        "stress per motion",
        ("body", "model", "direction"),
        STRESS,
        "all",
        shown=False,
        only="mechanism",
    )
    yield_x = Quantity(
        "place of the first yield, x",
        "mm",
        ("model", "direction"),
        NEARLY_EQUAL,
        shown=False,
        only="mechanism",
    )
    yield_y = Quantity(
        "place of the first yield, y",
        "mm",
        ("model", "direction"),
        NEARLY_EQUAL,
        shown=False,
        only="mechanism",
    )
    point_load = Quantity("loads at points", "wrench", ("point", "direction"), only="mechanism")
    point_stress = Quantity(
        "von Mises stress at points under the load",
        "mpa",
        ("point", "model"),
        STRESS,
        "all",
        only="mechanism",
    )
    neck_height = Quantity(
        "distance of the highest stress from the mid-plane", "mm", NECKS, shown=False, only="stage"
    )
    band_plane = Quantity(
        "band of the compliance by the mesh in the plane",
        "compliance matrix",
        MATRIX,
        shown=False,
        only="stage",
    )
    band_thickness = Quantity(
        "band of the compliance by the layers",
        "compliance matrix",
        MATRIX,
        shown=False,
        only="stage",
    )
    hinge_rotation = Quantity(
        "rotational compliance of the hinges", "rad_per_n_mm", HINGE, shown=False, only="stage"
    )
    hinge_axial = Quantity(
        "axial compliance of the hinges", "mm_per_n", HINGE, shown=False, only="stage"
    )
    hinge_shear = Quantity(
        "shear compliance of the hinges", "mm_per_n", HINGE, shown=False, only="stage"
    )


class MechanismStiffness(Stiffness, mechanism=True):
    """The same of a mechanism, and its inputs."""

    title = "mechanism at rest"
    figure = "plate.load_figure"
    drawn_from_fields = True
    held = replace(
        Stiffness.held, compared=False
    )  # the error of the analytic models is that with the others free


class Summary(Result):
    """Stiffness, range at yield, force and stress by direction, first frequency and ranges of the
    drive.
    """

    title = "summary"
    main = ("free", {})
    labels: ClassVar = {**RANGE_LABELS, **LIFTED_LABELS}
    columns = ("direction", "out of plane")
    reading = (
        "range at yield: displacement at the first yield, in a hinge or a body, others held; "
        "force at yield: force along it; both by linear theory, without stretching of hinges and "
        "buckling",
        "others: the other two directions, held at zero or free",
    )
    stiffness = Quantity("stiffness, others held", "stiffness", BY_DIRECTION, COARSER)
    free = Quantity("stiffness, others free", "stiffness", BY_DIRECTION, COARSER)
    range = RANGE
    range_force = RANGE_FORCE
    range_limit = RANGE_LIMIT
    yield_range = Quantity("range at yield, linear, ±", "motion", BY_DIRECTION, STRESS)
    yield_force = Quantity("force at yield, linear", "wrench", BY_DIRECTION, STRESS)
    stress = Quantity(
        "hinge stress per displacement", "stress per motion", (*BY_DIRECTION, *HINGE), STRESS, "all"
    )
    thickness = Quantity("change of stiffness in 3D", "percent", ("direction",), only="stage")
    held_low = Quantity(
        "drive min, others held", "motion", ("direction",), SOLVED, "pose", beside="held_high"
    )
    held_high = Quantity(
        "drive max, others held", "motion", ("direction",), SOLVED, "pose", beside="held_low"
    )
    free_low = Quantity(
        "drive min, others free", "motion", ("direction",), SOLVED, "pose", beside="free_high"
    )
    free_high = Quantity(
        "drive max, others free", "motion", ("direction",), SOLVED, "pose", beside="free_low"
    )
    amplification = Quantity(
        "output motion per actuator opening",
        ("", "", "rad_per_mm"),
        BY_DIRECTION,
        COARSER,
        "all",
        only="mechanism",
    )
    frequency = Quantity(
        "first natural frequency in the plane", "hz", ("model",), FRESH, only="mechanism"
    )
    first_out_of_plane = Quantity(
        "first natural frequency out of the plane, in three dimensions",
        "hz",
        gate=COARSER,
        only="mechanism",
    )
    lifted_free = LIFTED_FREE
    input_stiffness = Quantity(
        "stiffness at the actuator, output free", "n_per_um", ("model",), COARSER, only="mechanism"
    )


class MechanismSummary(Summary, mechanism=True):
    """The same of a mechanism, with its input."""

    stiffness = replace(Summary.stiffness, compared=False)


@setup.options(
    not_for="analytic", only_for="plane force_at tangent out_of_plane force_out_of_plane no_limits"
)
def stiffness(
    stage: Mechanism,
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
    """Stiffness, stress and range at yield of a stage or mechanism, and response to a load or
    displacement.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    force : tuple of float, optional
        Load on the platform: N, N, N mm.
    displacement : tuple of float, optional
        Displacement at which the platform is held, instead of a load: mm, mm, rad.
    force_at : mapping of str to tuple of float, or sequence of str, optional
        Loads at points of a mechanism by their names, N, N, N mm, besides that on the output:
        NAME=FX,FY,M, repeated. Two opposite loads at two points are a pair between their bodies.
    tangent : bool
        Stiffness of a mechanism at the equilibrium under the load, instead of that at rest and the
        response to it.
    out_of_plane : bool
        Also the stiffness of the output of a mechanism out of the plane: along z, and tilt about x
        and y.
    force_out_of_plane : tuple of float, optional
        Load on the output of a mechanism out of the plane, whose displacement is computed: force
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
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        stiffness` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Notes
    -----
    The analytic stiffness is (18) of Yi et al., IEEE Trans. Robot. Autom. 19(4), 604-612 (2003).

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.stiffness(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(float(found.at("yield_range", direction="x")[0]), 3)  # mm
    0.641
    """
    mesh = plates.mesh_of(
        stage, models, resolution, setup.elements_through(solid, thickness_resolution)
    )
    load = _asked(stage.layout, force, displacement, force_at)
    is_lifted = out_of_plane or force_out_of_plane is not None
    if is_lifted and (models == "analytic" or stage.model != "three_dimensional"):
        raise BadInput(
            "out_of_plane, expected finite elements in three dimensions, without plane or models "
            "'analytic'"
        )
    if isinstance(stage, MechanismFile):
        preload = _preload(stage, load, tangent)
        if preload is not None:
            return _at_preload(
                stage,
                preload,
                load._replace(on_ports=None) if tangent else load,
                mesh,
                models,
                progress,
            )
    stated = warning.of_numbers(stage)
    network = (
        _network_of_stage(stage, analytic, models, stated) if isinstance(stage, Stage) else None
    )

    def of_network(elastic: bool) -> Values:
        if network is not None:
            return _values(stage, network.responses, load)
        assert isinstance(stage, MechanismFile)
        return _values(stage, plates.network(stage, elastic), load)

    def of_size(resolution: int, layers: int, thick: plates.Thickened | None = None) -> Values:
        values = _values(stage, plates.elements(stage, resolution, layers, thick), load)
        if isinstance(stage, Stage) and "force" in values:
            values |= _of_ground(stage, Mesh(resolution, layers), values["force"])
        return values

    found = plates.by_models(
        stage, mesh, models, of_network, of_size, progress, partial(_bands, stage)
    )
    parts = [_Part(warnings=stated)]
    if isinstance(stage, Stage):
        if mesh is not None:
            found = _with_bounds(stage, mesh, found)
        parts += [
            _of_stage(stage, mesh, network),
            _under_load(stage, found),
            _of_motions(stage, found),
        ]
    else:
        parts += [_soft_bodies(found), _body_yields(stage, mesh, found)]
        if not no_limits:
            parts += [_buckling(stage, found), _ranges(stage, mesh, found)]
        parts += [_under_load(stage, found), _beyond_linear(stage, found, load)]
        if is_lifted:
            parts.append(_lifted(stage, force_out_of_plane))
    last = list(found.values())[-1].values
    fields = None
    if mesh is not None and "force" in last:
        fields = _fields(
            stage, mesh, last, last["force"] if load.on_ports is None else load.on_ports
        )
    at_points = {} if load.at_points is None else {"point_load": load.at_points}
    return setup.answer(
        Stiffness, stage, found, mesh, fields=fields, **_joined([*parts, _Part(at_points)])
    )


class _Load(NamedTuple):
    """The load that is asked for: on the first ports (n,), or a displacement (3,) of the output
    that it causes.

    at_points : (points, 3), the part of the load that is stated at points.
    """

    on_ports: Array | None = None
    displacement: Array | None = None
    at_points: Array | None = None

    def of(self, stiffness: Array) -> Array | None:
        """Return the load (n,) on the first ports, for an output of stiffness (3, 3); None if no
        load is asked for.
        """
        return (
            self.on_ports
            if self.displacement is None
            else np.asarray(stiffness @ self.displacement)
        )


class _Part(NamedTuple):
    """A part of an answer: values and bands of all models by quantity, settings, warnings and
    notes.
    """

    values: Mapping[str, Any] = setup.NOTHING
    bands: Mapping[str, Any] = setup.NOTHING
    settings: Mapping[str, Any] = setup.NOTHING
    warnings: Sequence[str] = ()
    notes: Sequence[str] = ()


def _joined(parts: Sequence[_Part]) -> dict[str, Any]:
    """Return parts of an answer as arguments of `setup.answer`."""
    return {
        "values": {name: array for part in parts for name, array in part.values.items()},
        "bands": {name: array for part in parts for name, array in part.bands.items()},
        "settings": {name: text for part in parts for name, text in part.settings.items()},
        "warnings": [text for part in parts for text in part.warnings],
        "notes": [text for part in parts for text in part.notes],
    }


def _preload(mechanism: Mechanism, load: _Load, tangent: bool) -> Array | None:
    """Return the load (k,) at whose equilibrium the stiffness is asked for, None at rest. Raises
    BadInput.
    """
    if not tangent:
        return preloaded.preload_of(mechanism, None)
    if load.on_ports is None:
        raise BadInput("tangent, expected force or force_at, under which the stiffness is computed")
    on_ports = np.zeros(len(mechanism.layout.ports))
    on_ports[: len(load.on_ports)] = load.on_ports
    return mechanism.layout.preload + on_ports


def _at_preload(
    mechanism: Mechanism,
    preload: Array,
    load: _Load,
    mesh: Mesh | None,
    models: Models,
    progress: Progress | None,
) -> Stiffness:
    """Return the stiffness at the equilibrium under a preload (k,), and the displacement by a small
    load on it.
    """
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

    def of_size(resolution: int, layers: int, thick: plates.Thickened | None = None) -> Values:
        compliance = by_mesh(resolution, layers)
        return of_tangent(compliance if thick is None else compliance + thick.change(of_parts))

    found = dict[str, ModelAnswer]()
    if models != "elements" and layout.joints:
        found[ANALYTIC] = ModelAnswer(of_tangent(of_parts(plates.ElasticParts())))
    if mesh is not None:
        thickness = () if mesh.layers else plates.thickness_of(mechanism)
        found |= plates.by_elements(mesh, of_size, progress, thickness=thickness)
    settings = {"preload": preloaded.described(mechanism, preload)}
    notes = [
        UNDER_PRELOAD,
        *[preloaded.IN_THREE_DIMENSIONS] * (mesh is not None and mesh.layers > 0),
    ]
    return setup.answer(Stiffness, mechanism, found, mesh, settings, notes=notes)


def _lifted(mechanism: Mechanism, force: Sequence[float] | None = None) -> _Part:
    """Return the stiffness of the output out of the plane, and its displacement by a load (3,) if
    there is one.
    """
    try:
        found = plates.lifted(mechanism)
    except ComputationFailed as failure:
        return _Part(warnings=[f"no stiffness out of the plane: {failure}"])
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
    return _Part(values, bands)


class _StageNetwork(NamedTuple):
    """The analytic model of a stage, whose plane problem may differ from that of its file, and its
    solution.
    """

    chosen: ModelChoice
    result: AnalyticResult

    @property
    def responses(self) -> Responses:
        """Compliance and neck stress per load on the platform."""
        C = self.result.compliance
        return Responses(C, lambda loads: self.result.neck_stress(self.chosen.stage, loads @ C))


def _network_of_stage(
    stage: Stage, analytic: Analytic, models: Models, warnings: list[str]
) -> _StageNetwork | None:
    """Return the analytic model of a stage; append warnings of its charts. Without analytic models
    it is checked.
    """
    chosen = analytic.chosen(stage, warnings, models)
    return None if models == "elements" else _StageNetwork(chosen, analyse(*chosen))


def _of_stage(stage: Stage, mesh: Mesh | None, network: _StageNetwork | None) -> _Part:
    """Return what only the nine-hinge stage has: its formula, its chart of hinges, and the effect
    of its thickness.
    """
    values = dict[str, Array]()
    settings = dict[str, Any]()
    warnings = list[str]()
    notes = list[str]()
    if network is not None:
        result = network.result
        values |= {
            f"hinge_{name}": getattr(result.hinges, name) for name in ("rotation", "axial", "shear")
        }
        settings["analytic model"] = network.chosen.name
        notes.append(f"hinge formula {result.formula}: {FORMULAS[result.formula].source}")
        notes.append(warning.stress_accuracy(result.formula, result.links, result.plane))
        warnings += warning.of_result(network.chosen.stage, result)
    thickness = warning.stiffer_by_thickness(stage)
    if thickness is not None:
        values["thickness"] = thickness
    if mesh is not None:
        warnings += warning.held_faces(stage) if mesh.layers else warning.of_thickness(stage)
    return _Part(values, settings=settings, warnings=warnings, notes=notes)


def _of_ground(stage: Stage, mesh: Mesh, force: Array) -> Values:
    """Return the reaction of the ground on a stage under a load (3,), and where its necks are
    stressed most.
    """
    response = plates.solved(stage, *mesh)
    found: Values = {"reaction": force @ response.reactions}
    if mesh.layers:
        found["neck_height"] = neck_stresses(stage, response, force[None]).height[0]
    return found


def _of_motions(stage: Stage, found: Mapping[str, ModelAnswer]) -> _Part:
    """Warn of stages that leave small displacements, under the load or at the ends of the ranges at
    yield.
    """
    last = list(found.values())[-1].values
    poses = {"under this load": last["pose"]} if "pose" in last else {}
    for axis, unit in UNIT_POSES.items():
        poses[f"end of the range at yield in {axis}"] = last["yield_range"] * unit
    return _Part(
        warnings=[
            text for where, pose in poses.items() for text in warning.of_motion(stage, pose, where)
        ]
    )


def _soft_bodies(found: Mapping[str, ModelAnswer]) -> _Part:
    """Warn of directions in which the bodies, which the analytic model takes as rigid, are softer
    than the hinges.
    """
    if ELASTIC not in found:
        return _Part()
    rigid, elastic = (found[model].values["free"] for model in (ANALYTIC, ELASTIC))
    soft = ", ".join(compress(DIRECTIONS, rigid > 2 * elastic))
    return _Part(
        warnings=[f"in {soft}, bodies are more compliant than hinges: {HINGES_ALONE}"] * bool(soft)
    )


def _buckling(mechanism: Mechanism, found: Mapping[str, ModelAnswer]) -> _Part:
    """Return the loads at which hinges buckle by the analytic model, and warn of those below the
    forces at yield.
    """
    if ANALYTIC not in found:
        return _Part()
    loads = buckling_loads(mechanism.layout)
    return _Part(
        {"buckling_load": loads}, warnings=_of_buckling(loads, list(found.values())[-1].values)
    )


def _body_yields(
    mechanism: Mechanism, mesh: Mesh | None, found: Mapping[str, ModelAnswer]
) -> _Part:
    """Name the part that yields first by finite elements, and the corners near which no stress is
    stated.
    """
    last = list(found.values())[-1].values
    if mesh is None or "body_rate" not in last:
        return _Part()
    left_out = plates.left_out_corners(
        mechanism.layout, plates.meshed(mechanism, levels(mesh.resolution)[0])
    )
    return _Part(warnings=left_out, notes=[_first_yields(mechanism.layout, last)])


def _ranges(mechanism: Mechanism, mesh: Mesh | None, found: Mapping[str, ModelAnswer]) -> _Part:
    """Return the ranges at finite displacements, and name their limits."""
    if not mechanism.layout.joints:
        return _Part()
    try:
        reached = ranges(mechanism, mesh, found)
    except ComputationFailed as failure:
        return _Part(warnings=[f"no range at finite displacements: {failure}"])
    values = {
        "range": reached.array("displacement"),
        "range_force": reached.array("force"),
        "range_limit": np.moveaxis(reached.array("governing"), -1, 2),
        "range_stress": np.moveaxis(reached.array("stress") / mechanism.layout.hinge_shares, -1, 2),
    }
    bands = {
        "range": reached.array("displacement_band"),
        "range_force": reached.array("force_band"),
    }
    return _Part(values, bands, notes=described(mechanism.layout, reached))


def _under_load(plate: Mechanism, found: Mapping[str, ModelAnswer]) -> _Part:
    """Warn of stress beyond the yield strength under the load."""
    if "force" not in list(found.values())[-1].values:
        return _Part()
    stress = "neck_stress" if isinstance(plate, Stage) else "hinge_stress"
    return _Part(warnings=plates.over_yield(plate, found, stress, "under this load"))


def _beyond_linear(mechanism: Mechanism, found: Mapping[str, ModelAnswer], load: _Load) -> _Part:
    """Warn of a load or displacement at which linear theory is off by more than its band, by beams."""
    if "force" not in list(found.values())[-1].values or not mechanism.layout.joints:
        return _Part()
    if load.displacement is not None:
        applied = finite.by_pose(mechanism.layout, load.displacement)
    else:
        assert load.on_ports is not None
        applied = finite.by_loads(mechanism.layout, load.on_ports)
    relative = finite.relative_bands(list(found.values())[-1], "pose", "hinge_stress")
    changes = finite.changes(mechanism, None, [applied])
    return _Part(warnings=changes.warnings("under this load", None, *relative))


def _asked(
    layout: Layout,
    force: Sequence[float] | None,
    displacement: Sequence[float] | None,
    force_at: Mapping[str, Sequence[float]] | Sequence[str] | None,
) -> _Load:
    """Return the load that is asked for. Raises BadInput."""
    if displacement is not None:
        if force is not None:
            raise BadInput("force and displacement, expected one of the two")
        if force_at:
            raise BadInput("displacement and force_at, expected one of the two")
        return _Load(displacement=arguments.poses("displacement", displacement, 1))
    on_output = None if force is None else arguments.forces("force", force, 1)
    if not force_at:
        return _Load(on_output)
    at_points = loads_at_points(layout, force_at)
    on_ports = np.ravel(at_points).copy()
    if on_output is not None:
        on_ports[:3] += on_output
    return _Load(on_ports, at_points=at_points)


def _first_yields(layout: Layout, values: Values) -> str:
    """Return a note on the part that ends each range at yield, and its place."""
    names = [f"hinge {joint.name}" for joint in layout.joints]
    names += [f"body {layout.bodies[index].name}" for index in moving_bodies(layout)]
    stress = values["body_rate"] / layout.body_strengths[:, None]
    if "stress" in values:
        stress = np.concatenate([values["stress"] / layout.hinge_strengths[:, None], stress])
    parts = [
        f"{direction} {names[int(np.argmax(stress[:, axis]))]} at ({values['yield_x'][axis]:.4g}, "
        f"{values['yield_y'][axis]:.4g}) mm"
        for axis, direction in enumerate(DIRECTIONS)
    ]
    return f"first yield by finite elements, which ends the range at yield: {'; '.join(parts)}"


def buckling_loads(layout: Layout) -> Array:
    """Return loads (2 others held or free, 2 senses, 3), N and N mm, at which hinges buckle; nan
    where they do not.

    The other directions of the output are held, so that it keeps them, or free. The load is along
    one direction."""
    senses = np.eye(3, len(layout.ports))[None] * np.array([1.0, -1.0])[:, None, None]
    loads = senses.reshape(6, -1)
    factors = list[Array]()
    held = list[list[int]]([[1, 2], [0, 2], [0, 1]])
    free = list[list[int]]([[], [], []])
    for ports in (held, free):
        factors.append(buckling_factors(layout, loads, ports * 2).reshape(2, 3))
    found = np.array(factors) * np.array([1.0, -1.0])[:, None]
    return np.where(np.isfinite(found), found, np.nan)


def _of_buckling(loads: Array, values: Values) -> list[str]:
    """Warn of forces at yield, with the other directions held, at which hinges have buckled before."""
    found = dict[tuple[str, str], list[str]]()
    for axis, direction in enumerate(DIRECTIONS):
        at_yield = values["yield_force"][axis]
        for sense, (held, free) in zip("+-", np.abs(loads[:, :, axis].T), strict=True):
            if held < at_yield:
                text = f"at {_as_load(held, axis)} with the other directions held"
                text += f" and {_as_load(free, axis)} with them free" * bool(np.isfinite(free))
                text += f"; the linear force at yield is {_as_load(at_yield, axis)}"
                found.setdefault((direction, text), []).append(sense)
    return [
        "hinges buckle before they yield along "
        f"{'±' if len(senses) == 2 else senses[0]}{direction}: {text}"
        for (direction, text), senses in found.items()
    ]


def _as_load(value: float, axis: int) -> str:
    """Return a load with its unit: N, or N mm about theta."""
    return f"{value:.4g} {'N mm' if axis == 2 else 'N'}"


def at_rest(compliance: Array) -> dict[str, Array]:
    """Return the stiffness of the output from its compliance (3, 3)."""
    K = np.asarray(np.linalg.inv(compliance))
    K = (K + K.T) / 2
    return {"compliance": compliance, "stiffness": K, "held": np.diag(K), "free": free_stiffness(K)}


def of_ports(plate: Mechanism, response: Responses) -> dict[str, Any]:
    """Return the values at rest, for a mechanism with the inputs seen from its drives.

    The amplification is the motion of the output, which is free, per opening of one actuator.
    """
    C = response.compliance
    values: dict[str, Any] = at_rest(C[:3, :3])
    loads = values["stiffness"] @ np.eye(3, len(C))
    stress = np.moveaxis(response.stress(loads), 0, -1)
    shares = plates.shares_of_yield(plate, "stress")
    highest = np.moveaxis(response.stress(loads) * shares, 0, -1).reshape(-1, 3)
    alone = np.diag(values["free"]) @ np.eye(3, len(C))
    if stress.size:
        at_once = response.stress(alone) * shares
        by_itself = plate.material.yield_strength / np.max(at_once.reshape(3, -1), axis=1)
        values |= {"stress": stress, "free_yield_range": by_itself}
    if response.bodies is not None:
        found = response.bodies(loads)
        values["body_rate"] = found.highest.T
        values["free_body_rate"] = response.bodies(alone).highest.T
        hinges = [[joint.place.real, joint.place.imag] for joint in plate.layout.joints]
        highest = np.concatenate(
            [highest, (found.highest * plates.shares_of_yield(plate, "body_rate")).T]
        )
        first = np.argmax(highest, axis=0)
        at = np.array([[*hinges, *found.place[axis]][part] for axis, part in enumerate(first)])
        values |= {"yield_x": at[:, 0], "yield_y": at[:, 1]}
    if highest.size:
        reach = plate.material.yield_strength / np.max(highest, axis=0)
        values |= {"yield_range": reach, "yield_force": np.diag(values["stiffness"]) * reach}
    if isinstance(plate, MechanismFile) and (drives := plate.layout.drive_ports):
        motions = plates.amplification(plate.layout, C)
        values |= {"input_stiffness": 1 / np.diag(C)[drives], "amplification": motions}
    return values


def _values(plate: Mechanism, response: Responses, load: _Load) -> dict[str, Any]:
    """Return the values at rest, and those under the load if there is one."""
    values = of_ports(plate, response)
    C = response.compliance
    F = load.of(values["stiffness"])
    if F is not None:
        loads = np.zeros(len(C))
        loads[: len(F)] = F  # on the output, or on all points
        motions = C @ loads
        values |= {"force": loads[:3], "pose": motions, "energy": loads @ motions / 2}
        if isinstance(plate, MechanismFile):
            values["pose"] = motions[: 3 * len(plate.layout.points)].reshape(-1, 3)
        values["neck_stress" if isinstance(plate, Stage) else "hinge_stress"] = response.stress(
            loads
        )
        if response.bodies is not None:
            bodies = response.bodies(loads)
            if len(plate.layout.points) > 1 and response.points is not None:
                values["point_stress"] = response.points(loads)
            values |= {
                "body_stress": bodies.highest,
                "body_x": bodies.place[:, 0],
                "body_y": bodies.place[:, 1],
            }
    return values


def _bands(
    plate: Mechanism, sizes: Array, each: list[Values], ends: Sequence[Values]
) -> dict[str, Any]:
    if isinstance(plate, MechanismFile):
        return plates.value_bands(sizes, each, ends)
    solutions = np.array([one["compliance"] for one in each])
    parts = dict[str, Array]()
    if ends:
        solved = SolidLevels(solutions, *(one["compliance"] for one in ends))
        parts = dict(
            zip(("band_plane", "band_thickness"), solid_bands(solved, int(sizes[-1])), strict=True)
        )
    bands = sum(parts.values()) if ends else compliance_bands(sizes, solutions)
    if ends:
        return {"compliance": bands, **parts}
    stresses = np.array([one["stress"] for one in each])
    highest = np.max(stresses, axis=(1, 2))  # of each direction
    band = stress_bands(sizes, highest)
    return {
        "compliance": bands,
        "free": each[-1]["free"] * np.diag(bands) / np.diag(solutions[-1]),
        "stress": np.where(is_largest(stresses[-1], (0, 1)), band, np.nan),
        "yield_range": each[-1]["yield_range"] * band / highest[-1],
    }


def _with_bounds(stage: Stage, mesh: Mesh, found: dict[str, ModelAnswer]) -> dict[str, ModelAnswer]:
    """Add bands that follow from that of the compliance, and the plane problems between which three
    dimensions lie.
    """
    label, (values, bands) = found.popitem()
    widths = dict(bands)
    K = np.abs(values["stiffness"])
    C = bands["compliance"]
    parts = {name: widths.pop(name) for name in ("band_plane", "band_thickness") if name in widths}
    widths["stiffness"] = K @ C @ K  # dK = -K dC K
    widths["held"] = np.diag(widths["stiffness"])
    if "force" in values:
        widths["pose"] = C @ np.abs(values["force"])
    if mesh.layers:
        sheets = zip((SHEET, HELD), bounding(stage, plates.solved(stage, *mesh)), strict=True)
        found |= {name: ModelAnswer(dict(at_rest(compliance))) for name, compliance in sheets}
    return found | {label: ModelAnswer(values | parts, widths)}


def _fields(plate: Mechanism, mesh: Mesh, values: Values, loads: Array) -> MeshFields:
    """Return displacement, mm, and stress, MPa, at all nodes by values under loads (n,) on the
    first ports.

    There are none in fixed bodies.

    Those of a mechanism in three dimensions are on the coarsest mesh. Plane fields have the pose of
    the output."""
    size = mesh
    ratio = plate.layout.out_of_plane
    if isinstance(plate, MechanismFile) and mesh.layers:
        size = Mesh(levels(mesh.resolution)[0], mesh.layers)
    layers = plates.layers_of(plate, size.layers)
    meshed = (
        plates.meshed(plate, size.resolution)
        if isinstance(plate, MechanismFile)
        else plates.solved(plate, *size).mesh
    )

    def made() -> dict[str, Array]:
        whole = plates.solved(plate, *size).whole
        C = whole.compliance
        count = len(loads)
        at_points = C[:3, 3:count] @ loads[3:]
        on_output = np.linalg.solve(C[:3, :3], np.ravel(values["pose"])[:3] - at_points)
        force = np.concatenate([on_output, loads[3:]])
        part = whole.structure
        field = np.tensordot(force, whole.nodal[:count], axes=1)
        moving = np.unique(part.mesh.triangles)
        highest = np.zeros(field.shape[:-1])
        stress = nodal_stress(part.mesh, part.plate, field, moving, part.layers)
        highest[moving] = von_mises(stress, ratio).reshape(highest[moving].shape)
        found = {"displacement": field, "von_mises": highest}
        if part.layers is not None:
            found["stress"] = np.zeros((*highest.shape, 9))
            found["stress"][moving] = stress.reshape(*highest[moving].shape, 9)
        return found

    return MeshFields(meshed, made, layers.heights if layers else None)


def bounding(stage: Stage, response: Response) -> tuple[Array, Array]:
    """Return compliances (3, 3) in plane stress and in plane strain on the plane mesh of a
    response.
    """
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (unit_response(response.sectors, bound).compliance for bound in (plate, held))
    return soft, hard


def _ends(ends: Array) -> dict[str, Array]:
    """Return the ranges of the drive by the last model from the `ends` of `reach`, or from their
    bands.
    """
    return {
        f"{others}_{end}": np.where(np.abs(pose) < 1e-12, 0.0, pose)
        for others, by_end in zip(("held", "free"), ends[:, :, -1], strict=True)
        for end, pose in zip(("low", "high"), by_end, strict=True)
    }


def _material(plate: Mechanism) -> tuple[dict[str, Any], list[str]]:
    """Return the plane problem and the yield strength as settings, and the sources of the material
    as notes.
    """
    by_source = dict[str, list[str]]()
    for key in (key for key in plate.numbers if key.startswith("material")):
        name = without_unit(key.partition(".")[2]).replace("_", " ")
        by_source.setdefault(plate.sources[key] or "not stated", []).append(name)
    settings = {
        "plane problem": PLANES[plate.model],
        "yield strength": f"{plate.material.yield_strength:g} MPa",
    }
    return settings, [
        f"material ({', '.join(names)}): {source}" for source, names in by_source.items()
    ]


@setup.options(not_for="analytic", only_for="plane")
def summary(
    stage: Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> Summary:
    """Stiffness of a stage or mechanism, range and force at which the first neck yields, and range
    of its drive.

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
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        summary` lists it.

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
    mesh: dict[str, Any] = {
        "models": models,
        "resolution": resolution,
        "solid": solid,
        "thickness_resolution": thickness_resolution,
    }
    found = stiffness(stage, analytic=analytic, **mesh, progress=progress)
    settings, notes = _material(stage)
    settings = settings | found.settings
    notes = [*found.notes, *notes]
    warnings = list(found.warnings)
    parts: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    reached: Result | None = None
    values, bands = parts
    for target, source in zip(parts, found.internal, strict=True):
        names = source.keys() & {"free", "yield_range", "yield_force", "stress", "thickness"}
        target |= {name: np.moveaxis(source[name], -1, 0) for name in names}
        target |= {
            name: source[name] for name in ("range", "range_force", "range_limit") if name in source
        }
        if "stiffness" in source:
            target["stiffness"] = np.diagonal(source["stiffness"], axis1=1, axis2=2).T
        if (
            isinstance(stage, MechanismFile)
            and len(stage.layout.actuators) == 1
            and "amplification" in source
        ):
            target |= {
                "amplification": source["amplification"][0].T,
                "input_stiffness": source["input_stiffness"][0],
            }
    if isinstance(stage, MechanismFile):
        first = modes(stage, count=1, **mesh)
        values["frequency"] = first.internal.values["frequency"][0]
        bands |= {
            name: band[0] for name, band in first.internal.bands.items() if name == "frequency"
        }
        for target, source in zip(
            parts, (first.internal.values, first.internal.bands), strict=True
        ):
            target |= {name: source[name] for name in source if name == "first_out_of_plane"}
        warnings += first.warnings
        if "first_out_of_plane" in values:
            lifted = _lifted(stage)
            values |= {name: lifted.values[name] for name in lifted.values if name == "lifted_free"}
            bands |= {name: lifted.bands[name] for name in lifted.bands if name == "lifted_free"}
        if stage.layout.actuators:
            layers = setup.elements_through(solid, thickness_resolution)
            at = plates.mesh_of(stage, models, resolution, layers)
            reached = motion_by_strokes(stage, at, models)
            drive = (
                "drive min, max: range of the drive with all actuators "
                f"({reached.axes['model'][-1]})"
            )
            notes.append(f"{drive}; first frequency: without the actuators")
    else:
        settings = {"mobility": stage.mobility} | settings
        try:
            reached = reach(stage, models="analytic", analytic=analytic) if stage.actuator else None
        except ComputationFailed as failure:
            warnings.append(str(failure))
    if reached is not None:
        if isinstance(stage, Stage):
            notes.append("drive min, max: range of the drive")
        for target, source in zip(parts, reached.internal, strict=True):
            if "ends" in source:
                target |= _ends(source["ends"])
        warnings += reached.warnings
    kind = setup.kind_of(Summary, stage)
    return kind(found.about, values, bands, found.axes, settings, warnings, notes)
