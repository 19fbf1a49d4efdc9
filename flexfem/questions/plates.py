"""Questions about any plate mechanism: at rest, errors of the analytic model, error budget, convergence, drive, reach.

Every number follows from the compliance between the ports of the mechanism and from the stress in its hinges, by the
analytic network with rigid bodies, the network of elastic parts, and finite elements in the plane or extruded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.plates import respond
from flexfem.arrays import Array, free_stiffness
from flexfem.fem.elements import Layers, mirrored, nodal_stress, von_mises
from flexfem.fem.mesh import LAYERS, StageMesh
from flexfem.fem.plate_bodies import body_compliances, hinge_compliances
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import PlateModel, PlateResponse, hinge_stress, plate_model
from flexfem.files.tables import once
from flexfem.mechanism.layout import ElasticBody, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.profiles import Leaf
from flexfem.questions import setup
from flexfem.questions import warnings as warning
from flexfem.questions.bands import (
    SAFETY,
    SolidLevels,
    coarser,
    compliance_bands,
    corner_bands,
    error_bands,
    error_matrix,
    levels,
    refined,
    refinements,
    solid_bands,
)
from flexfem.questions.setup import ModelAnswer, Models, mesh_of, on_meshes
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, COARSER, ELEMENTS, SOLID, STRESS, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

ELASTIC = "elastic bodies"  # label of the network of parts, each with the compliance by finite elements of it alone
ELASTIC_READ = f"{ELASTIC}: bodies and hinges by plane finite elements of each part, joined at rigid sections"
SOLID_RESOLUTION = 4  # in three dimensions; the plane compliance of leaf springs and notches is within 0.05 %
PART_RESOLUTION = 4  # of the finite elements of single parts
ROUND_OFF = 1e-9
PEAK_BAND = 0.01  # least relative band of a highest stress at resolution 8, see `value_bands`
PEAKS = ("stress", "hinge_stress", "yield_range", "yield_force")
MAGNITUDE = 0.9  # accepted change of a band relative to the larger of both: meshes without symmetry keep its magnitude
ON_MESHES, PEAK = COARSER._replace(band=MAGNITUDE), STRESS._replace(band=MAGNITUDE)
POINTS = ON_MESHES._replace(absolute=100 * COARSER.relative)  # percentage points of a command


class Responses(NamedTuple):
    """Response of one model to unit loads on the k ports: compliance (k, k) and stress in hinges.

    stress : function of loads (..., k), N and N mm, returns the highest stress (..., hinges), MPa.
    """

    compliance: Array
    stress: Callable[[Array], Array]


@once
def meshed(mechanism: Mechanism, resolution: int) -> StageMesh:
    """Mesh the plate."""
    return mesh_layout(mechanism.layout, resolution)


def layers_of(mechanism: Mechanism, number: int) -> Layers | None:
    """Return layers graded for the narrowest neck; None for number 0, in the plane."""
    layout = mechanism.layout
    necks = min((joint.profile.neck for joint in layout.joints), default=layout.thickness)
    return mirrored(layout.thickness, number, necks) if number else None


@once
def model_of(mechanism: Mechanism, resolution: int) -> PlateModel:
    """Factorise finite elements in the plane."""
    return plate_model(mechanism.layout, meshed(mechanism, resolution))


def factorised(mechanism: Mechanism, resolution: int, layers: int = 0, lifting: bool = False) -> PlateModel:
    """Factorise finite elements; those with layers are not kept, because they take gigabytes.

    lifting : for motion out of the plane, with layers.
    """
    through = layers_of(mechanism, layers)
    if through is None:
        return model_of(mechanism, resolution)
    return plate_model(mechanism.layout, meshed(mechanism, resolution), through.antisymmetric if lifting else through)


@once
def solved(mechanism: Mechanism, resolution: int) -> PlateResponse:
    """Solve plane finite elements for unit loads on all ports."""
    model = model_of(mechanism, resolution)
    return model.response(model.port_forces)


class ElasticParts(NamedTuple):
    """Elastic bodies and compliances (h, 3, 3) of hinges; without them bodies are rigid, and hinges beam integrals."""

    bodies: tuple[ElasticBody, ...] = ()
    hinges: Array | None = None


@once
def parts_of(mechanism: Mechanism, resolution: int = PART_RESOLUTION) -> ElasticParts:
    """Return the compliance of every moving body and every hinge by finite elements of it alone."""
    return parts_in(mechanism.layout, meshed(mechanism, resolution))


def parts_in(layout: Layout, mesh: StageMesh) -> ElasticParts:
    """Return the compliance of every moving body and every hinge by finite elements of it alone, on a mesh."""
    return ElasticParts(body_compliances(layout, mesh), hinge_compliances(layout, mesh))


def joined_parts(mechanism: Mechanism, elastic: bool) -> ElasticParts:
    """Return the parts of the analytic network, rigid bodies or elastic ones."""
    return parts_of(mechanism) if elastic else ElasticParts()


def stress_by(mechanism: Mechanism, wrenches: Array) -> Array:
    """Return the highest stress (..., hinges), MPa, of hinges under wrenches (..., hinges, 3)."""
    layout = mechanism.layout
    plate = layout.thickness, layout.out_of_plane
    return np.stack([one.profile.stress(wrenches[..., h, :], *plate) for h, one in enumerate(layout.joints)], axis=-1)


@once
def network(mechanism: Mechanism, elastic: bool = False) -> Responses:
    """Return the response of the analytic network with rigid bodies or with elastic parts."""
    parts = joined_parts(mechanism, elastic)
    found = respond(mechanism.layout, parts.bodies, hinges=parts.hinges)

    def stress(loads: Array) -> Array:
        return stress_by(mechanism, np.einsum("hck,...k->...hc", found.wrenches, loads))

    return Responses(found.compliance, stress)


def elements(mechanism: Mechanism, resolution: int, layers: int = 0) -> Responses:
    """Return the response of finite elements."""
    response = solid_response(mechanism, resolution, layers) if layers else solved(mechanism, resolution)
    return Responses(response.compliance, lambda loads: hinge_stress(response, loads))


def solid_response(mechanism: Mechanism, resolution: int, layers: int) -> PlateResponse:
    """Solve finite elements in three dimensions for unit loads on all ports."""
    model = factorised(mechanism, resolution, layers)
    return model.response(model.port_forces)


class FewAndMany(NamedTuple):
    """Values on the coarsest mesh with few and with many layers."""

    few: dict[str, Any]
    many: dict[str, Any]


Bands: TypeAlias = Callable[[Array, list[dict[str, Any]], FewAndMany | None], Mapping[str, Any]]
"""Function from the resolutions of three meshes, the values on them, and those with layers, to bands."""


def value_bands(sizes: Array, each: list[dict[str, Any]], ends: FewAndMany | None = None) -> dict[str, Any]:
    """Return the bands of values on three meshes of resolutions `sizes`, in three dimensions with those of layers.

    Highest stresses on three meshes can agree by chance. Their bands have a least value, which falls with the square of
    the resolution. `benchmarks/mechanism_bands.py` counts how many bands contain the values of a finer mesh.
    """
    found = {name: corner_bands(sizes, np.array([one[name] for one in each])) for name in each[0]}
    if ends is not None:
        found = {name: band + SAFETY * np.abs(ends.many[name] - ends.few[name]) for name, band in found.items()}
    least = PEAK_BAND * (8 / sizes[-1]) ** 2
    return found | {name: np.maximum(found[name], least * np.abs(each[-1][name])) for name in PEAKS if name in found}


def by_elements(
    mesh: setup.Mesh,
    solve: Callable[[int, int], dict[str, Any]],
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return the values of plane finite elements, of three dimensions if they are asked for, and their bands.

    solve : values with a resolution and a number of layers, 0 in the plane.

    Notes
    -----
    A value in three dimensions is that of the coarsest mesh with all layers, plus the change to the finest mesh with
    one layer: `v(coarse, layers) + v(fine, 1) - v(coarse, 1)`. So no fine mesh has many layers. On a stage with 24 leaf
    springs this is within 1e-5 of the compliance, and 0.5 % of the stress, of the finest mesh with three layers.
    """
    steps = levels(mesh.resolution)
    sizes, each = np.array(steps, dtype=float), on_meshes(steps, lambda level: solve(level, 0), progress)
    found = {ELEMENTS: ModelAnswer(each[-1], bands(sizes, each, None))}
    if mesh.layers:
        planes, (few, many) = coarser(solve, *mesh, progress)
        values = {name: planes[-1][name] + many[name] - planes[0][name] for name in many}
        found[SOLID] = ModelAnswer(values, bands(sizes, planes, FewAndMany(few, many)))
    return found


def by_models(
    mesh: setup.Mesh | None,
    models: Models,
    of_network: Callable[[bool], dict[str, Any]],
    of_size: Callable[[int, int], dict[str, Any]],
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return the values of all requested models, with bands of finite elements.

    of_network : values with rigid bodies or, for True, with elastic parts.   of_size : see `by_elements`.
    """
    labels = {"elements": (), "analytic": (ANALYTIC,)}.get(models, (ANALYTIC, ELASTIC))
    found = {label: ModelAnswer(of_network(label == ELASTIC)) for label in labels}
    return found if mesh is None else found | by_elements(mesh, of_size, progress, bands)


def of_models(
    mechanism: Mechanism,
    mesh: setup.Mesh | None,
    models: Models,
    values: Callable[[Responses], dict[str, Any]],
    progress: Progress | None = None,
    bands: Bands = value_bands,
) -> dict[str, ModelAnswer]:
    """Return values that follow from the response to loads on the ports, by all requested models."""
    return by_models(
        mesh,
        models,
        lambda elastic: values(network(mechanism, elastic)),
        lambda *size: values(elements(mechanism, *size)),
        progress,
        bands,
    )


def at_rest(mechanism: Mechanism, response: Responses) -> dict[str, Any]:
    """Return stiffness, stress per displacement and range at yield of the output, and the inputs seen from the drives.

    The amplification is the motion of the output, which is free, per opening of one actuator.
    """
    C, drives = response.compliance[:3, :3], mechanism.layout.drive_ports
    K = np.asarray(np.linalg.inv(C))
    K = (K + K.T) / 2
    loads = np.zeros((3, len(response.compliance)))
    loads[:, :3] = K
    stress = response.stress(loads)  # (3 directions, hinges)
    reach = mechanism.material.yield_strength / np.max(stress, axis=1)
    values = {
        "compliance": C,
        "stiffness": K,
        "free": free_stiffness(K),
        "stress": stress.T,
        "yield_range": reach,
        "yield_force": np.diag(K) * reach,
    }
    if drives:
        opening = np.diag(response.compliance)[drives]
        values["input_stiffness"] = 1 / opening
        values["amplification"] = (response.compliance[:3, drives] / opening).T
    return values


class MechanismStiffness(Result):
    """Stiffness, stress per displacement, range at yield and inputs of a mechanism at rest; response to one load."""

    title = "mechanism at rest"
    main = ("free", {})
    figure, drawn_from_fields = "plate.load_figure", True
    stiffness = Quantity(
        "stiffness matrix", "stiffness matrix", ("model", "component", "direction"), ON_MESHES, "matrix"
    )
    compliance = Quantity(
        "compliance matrix", "compliance matrix", ("model", "component", "direction"), ON_MESHES, "matrix", shown=False
    )
    free = Quantity("stiffness, other directions free", "stiffness", ("model", "direction"), ON_MESHES)
    stress = Quantity(
        "highest hinge stress per displacement, other directions held", "stress per motion",
        ("model", "hinge", "direction"), PEAK, "all", largest=("hinge",),
    )  # fmt: skip
    yield_range = Quantity(
        "displacement at which the first hinge yields, other directions held", "motion", ("model", "direction"),
        PEAK, prefixed=True,
    )  # fmt: skip
    yield_force = Quantity("force along the displacement at yield", "wrench", ("model", "direction"), PEAK)
    input_stiffness = Quantity("stiffness at the actuator, output free", "n_per_um", ("actuator", "model"), ON_MESHES)
    amplification = Quantity(
        "output motion per actuator opening, output free", ("", "", "rad_per_mm"), ("actuator", "model", "direction"),
        ON_MESHES, "all",
    )  # fmt: skip
    force = Quantity("load on the output", "wrench", ("model", "direction"), ON_MESHES, "wrench")
    pose = Quantity("displacement under the load", "motion", ("model", "point", "direction"), ON_MESHES, "pose",
                    prefixed=True)  # fmt: skip
    energy = Quantity("strain energy", "n_mm", ("model",), ON_MESHES)
    hinge_stress = Quantity("hinge stress under the load", "mpa", ("model", "hinge"), PEAK, "all",
                            largest=("hinge",))  # fmt: skip


def stiffness(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    force: tuple[float, float, float] | None = None,
    displacement: tuple[float, float, float] | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> MechanismStiffness:
    """See `flexfem.stiffness`."""
    mesh = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    if force is not None and displacement is not None:
        raise BadInput("force and displacement, expected one of the two")
    load = None if force is None else arguments.forces("force", force, 1)
    held = None if displacement is None else arguments.poses("displacement", displacement, 1)

    def values(response: Responses) -> dict[str, Any]:
        found = at_rest(mechanism, response)
        F = load if held is None else found["stiffness"] @ held
        if F is not None:
            loads = np.concatenate([F, np.zeros(len(response.compliance) - 3)])
            poses = (response.compliance @ loads)[: 3 * len(mechanism.layout.points)].reshape(-1, 3)
            found |= {"force": F, "pose": poses, "energy": F @ poses[0] / 2, "hinge_stress": response.stress(loads)}
        return found

    def bands(sizes: Array, each: list[dict[str, Any]], ends: FewAndMany | None) -> dict[str, Any]:
        found, solutions = value_bands(sizes, each, ends), np.array([one["compliance"] for one in each])
        C = compliance_bands(sizes, solutions)
        if ends is not None:
            plane, through = solid_bands(SolidLevels(solutions, *(one["compliance"] for one in ends)), int(sizes[-1]))
            C = plane + through
        return found | {"compliance": C, "free": each[-1]["free"] * np.diag(C) / np.diag(each[-1]["compliance"])}

    found, fields = of_models(mechanism, mesh, models, values, progress, bands), None
    reference = list(found.values())[-1].values
    if mesh is not None and "force" in reference:
        fields = fields_under(mechanism, mesh, reference["force"])
    warnings = over_yield(mechanism, found, "hinge_stress", "this load") if "force" in reference else []
    return answer(MechanismStiffness, mechanism, found, mesh, fields=fields, warnings=warnings)


def fields_under(mechanism: Mechanism, mesh: setup.Mesh, force: Array) -> setup.MeshFields:
    """Return displacement and von Mises stress by finite elements under a load (3,) on the output, N and N mm.

    In three dimensions they are those of the coarsest mesh.
    """
    layers = layers_of(mechanism, mesh.layers)
    level = levels(mesh.resolution)[0] if layers else mesh.resolution

    def made() -> dict[str, Array]:
        response = solid_response(mechanism, level, mesh.layers) if layers else solved(mechanism, level)
        field, whole = np.tensordot(force, response.fields[:3], axes=1), response.model.structure
        moving, stress = np.unique(whole.mesh.triangles), np.zeros(field.shape[:-1])  # fixed bodies have none
        found = nodal_stress(whole.mesh, whole.plate, field, moving, whole.layers)
        stress[moving] = von_mises(found, mechanism.layout.out_of_plane).reshape(stress[moving].shape)
        return {"displacement": field, "von_mises": stress}

    return setup.MeshFields(meshed(mechanism, level), made, layers.heights if layers else None)


def answer(
    kind: type[setup.Kind],
    mechanism: Mechanism,
    models: Mapping[str, ModelAnswer],
    mesh: setup.Mesh | None,
    values: Mapping[str, Any] | None = None,
    axes: Mapping[str, Sequence[str]] | None = None,
    bands: Mapping[str, Any] | None = None,
    settings: Mapping[str, Any] | None = None,
    **texts: Any,
) -> setup.Kind:
    """Return the result of a question with the axes of a mechanism: its hinges, points and actuators."""
    layout = mechanism.layout
    labels: dict[str, Sequence[str]] = {
        "hinge": [joint.name for joint in layout.joints],
        "point": [name for name, _ in layout.points],
        "actuator": [actuator.name for actuator in layout.actuators],
    }
    labels |= {"model": tuple(models), **(axes or {})}
    stacked, widths = setup.stack_models(kind, models, labels) if models else ({}, {})
    values, widths = stacked | dict(values or {}), widths | dict(bands or {})
    settings = setup.meshed(mesh) | dict(settings or {})
    if {ELEMENTS, SOLID} & models.keys() and any("stress" in name for name in stacked):
        texts["warnings"] = [*texts.get("warnings", ()), *sharp_roots(layout)]
    texts["notes"] = [*texts.get("notes", ()), *([ELASTIC_READ] if ELASTIC in models else [])]
    return kind(setup.about(mechanism), values, widths, labels, settings, **texts)


def sharp_roots(layout: Layout) -> list[str]:
    """Warn of leaves without fillets, whose stress by finite elements is singular."""
    sharp = [joint.name for joint in layout.joints if isinstance(joint.profile, Leaf) and not joint.profile.fillet]
    named = ", ".join(sharp[:3]) + f" and {len(sharp) - 3} more" * (len(sharp) > 3)
    return [
        f"hinges without fillets ({named}): the stress of finite elements at their roots grows without limit as the "
        "mesh is refined, and the range at yield falls with it; state fillet_mm"
    ] * bool(sharp)


class MechanismErrors(Result):
    """Error of the finite-element displacement under the force that the analytic network predicts for a command."""

    title = "errors of the finite-element displacement"
    main = ("percent", {})
    labels: ClassVar = {"commanded": DIRECTIONS}
    reading = ("rotations are multiplied by the lever of the output",)
    percent = Quantity(
        "positioning error, % of the commanded motion", "percents", ("model", "commanded", "direction"), POINTS
    )
    stiffness = Quantity("stiffness", "stiffness", ("model", "direction"), ON_MESHES, shown=False)
    lever = Quantity("lever of the output: distance to its farthest hinge", "mm")


def verification(
    mechanism: Mechanism, *, resolution: int | None = None, progress: Progress | None = None
) -> MechanismErrors:
    """See `flexfem.verification`."""
    mesh = mesh_of("both", resolution, None)
    assert mesh is not None
    steps, lever = levels(mesh.resolution), mechanism.layout.lever
    C = np.array([one.compliance[:3, :3] for one in on_meshes(steps, lambda n: elements(mechanism, n), progress)])
    models = dict[str, ModelAnswer]()
    for label, elastic in ((ANALYTIC, False), (ELASTIC, True)):
        K = np.asarray(np.linalg.inv(network(mechanism, elastic).compliance[:3, :3]))
        values, bands = error_bands(K, C, steps, lever)
        models[label] = ModelAnswer({"percent": values.T, "stiffness": np.diag(K)}, {"percent": bands.T})
    return answer(MechanismErrors, mechanism, models, mesh, {"lever": lever})


SHARES = ("rigid bodies", "hinge formulas", "joining of parts", "three dimensions", "total")


class MechanismBudget(Result):
    """Shares of the error of the network with rigid bodies, which add up to the total."""

    title = "error budget"
    main = ("share", {"share": SHARES[-1]})
    labels: ClassVar = {"share": SHARES}
    reading = (
        "shares are % of the commanded motion, under the force of the network with rigid bodies",
        "rigid bodies: change by elastic bodies, from plane finite elements of each body",
        "hinge formulas: change from beam integrals to plane finite elements of each hinge",
        "joining of parts: change from parts with rigid end sections to plane finite elements of the whole mechanism",
    )
    share = Quantity("share of the error", "percents", ("share", "direction"), POINTS)


def budget(
    mechanism: Mechanism, *, resolution: int | None = None, plane: bool = False, progress: Progress | None = None
) -> MechanismBudget:
    """See `flexfem.budget`."""
    mesh = mesh_of("both", resolution, None)
    assert mesh is not None
    steps, lever = levels(mesh.resolution), mechanism.layout.lever
    parts = parts_of(mechanism, mesh.resolution)
    rigid, *changed = (
        respond(mechanism.layout, one.bodies, hinges=one.hinges).compliance[:3, :3]
        for one in (ElasticParts(), ElasticParts(parts.bodies), parts)
    )
    K = np.asarray(np.linalg.inv(rigid))
    C = np.array([one.compliance[:3, :3] for one in on_meshes(steps, lambda n: elements(mechanism, n), progress)])
    errors, bands = (np.diag(part) for part in error_bands(K, C, steps, lever))
    shares, widths = np.full((2, len(SHARES), 3), np.nan)
    reached = [np.zeros(3), *(np.diag(error_matrix(K, one, lever)) for one in changed), errors]
    shares[:3], shares[-1], widths[2], widths[-1] = np.diff(reached, axis=0), errors, bands, bands
    if not plane:
        coarse, (_, few, many) = levels(SOLID_RESOLUTION)[0], levels(LAYERS)
        by_layers = (elements(mechanism, coarse, n).compliance[:3, :3] for n in (0, few, many))
        flat, less, solid = (np.diag(error_matrix(K, compliance, lever)) for compliance in by_layers)
        shares[3], widths[3] = solid - flat, SAFETY * np.abs(solid - less)
        shares[-1], widths[-1] = shares[-1] + shares[3], bands + widths[3]
    return answer(MechanismBudget, mechanism, {}, mesh, {"share": shares}, bands={"share": widths})


class MechanismConvergence(Result):
    """Output compliance on meshes of increasing resolution, and its extrapolated limit."""

    title = "mesh convergence"
    main = ("extrapolated", {})
    along = Quantity("compliance along each direction", "compliance", ("mesh", "direction"), ON_MESHES)
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), ON_MESHES)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.5))
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05))


def converge(
    mechanism: Mechanism, *, resolutions: list[int] | None = None, progress: Progress | None = None
) -> MechanismConvergence:
    """See `flexfem.converge`."""
    steps = refinements((3, 4, 6, 8) if resolutions is None else resolutions)
    meshes = on_meshes(steps, lambda level: solved(mechanism, level), progress)
    found = refined(steps, np.array([np.diag(one.compliance)[:3] for one in meshes]))
    values = {"along": found.values["along"], "unknowns": [one.unknowns for one in meshes], **found.values}
    return answer(MechanismConvergence, mechanism, {}, None, values, found.labels, found.bands, notes=found.notes)


class MechanismDrive(Result):
    """Motion of a mechanism by its actuators, with all of them in place: transmission, range, losses, coupling."""

    title = "drive"
    main = ("motion", {})
    reading = ("all actuators are in place with their stiffness; a motion is that for the free stroke of one actuator",)
    motion = Quantity(
        "motion for the full free stroke", "motion", ("actuator", "point", "model", "direction"), ON_MESHES, "all",
        prefixed=True,
    )  # fmt: skip
    transmission = Quantity(
        "output motion per free stroke", ("", "", "rad_per_mm"), ("actuator", "model", "direction"), ON_MESHES, "all"
    )
    used = Quantity(
        "opening of the actuator over its free stroke", "percent", ("actuator", "model"), ON_MESHES,
        note="the rest of the stroke is lost to the elasticity of the actuator",
    )  # fmt: skip
    coupling = Quantity(
        "opening of the other actuators over the free stroke", "percent", ("actuator", "other", "model"),
        ON_MESHES, "all",
    )  # fmt: skip
    cross = Quantity(
        "cross motion of the output over its main translation", "percent", ("actuator", "model"),
        ON_MESHES._replace(absolute=5e-3), "all",
    )  # fmt: skip
    rotation = Quantity(
        "parasitic rotation of the output over its main translation", "rad_per_mm", ("actuator", "model"),
        ON_MESHES._replace(absolute=1e-6), "all",
    )  # fmt: skip
    force = Quantity("force of the actuator at full stroke", "n", ("actuator", "model"), ON_MESHES)
    stress = Quantity(
        "highest hinge stress at full stroke", "mpa", ("actuator", "model", "hinge"), PEAK, "all", largest=("hinge",)
    )
    engaged = Quantity(
        "stiffness of the output with all actuators", "stiffness", ("model", "direction"),
        ON_MESHES._replace(relative=1e-3),  # it has that of bodies at small contacts
    )  # fmt: skip


class Transfer(NamedTuple):
    """Linear response to free strokes s (a,) of all actuators in place.

    force : (a, a), N per mm of stroke.   motion : (p, 3, a), of the points.   opening : (a, a), of the actuators.
    engaged : (3, 3), stiffness of the output with all actuators.
    """

    force: Array
    motion: Array
    opening: Array
    engaged: Array


def transfer(mechanism: Mechanism, C: Array) -> Transfer:
    """Return the response to free strokes for a compliance (k, k) between the ports.

    Notes
    -----
    The force of an actuator is `F = k (s - q)` with its opening `q = C_aa F`, so that `F = (C_aa + 1 / k)^-1 s`.
    """
    drives = mechanism.layout.drive_ports
    if not drives:
        raise BadInput(f"{mechanism.origin}: no actuator, expected at least one [[actuator]]")
    flexible = C[np.ix_(drives, drives)] + np.diag(1 / mechanism.layout.stiffness_of_actuators)
    force = np.asarray(np.linalg.inv(flexible))
    coupled = C[:3, drives]
    engaged = np.asarray(np.linalg.inv(C[:3, :3] - coupled @ force @ coupled.T))
    motion = C[: 3 * len(mechanism.layout.points), drives] @ force
    return Transfer(force, motion.reshape(-1, 3, len(drives)), C[np.ix_(drives, drives)] @ force, engaged)


def drive(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> MechanismDrive:
    """See `flexfem.drive`."""
    mesh, actuators = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION), mechanism.layout.actuators
    strokes, drives = np.array([actuator.stroke for actuator in actuators]), mechanism.layout.drive_ports

    def values(response: Responses) -> dict[str, Any]:
        found = transfer(mechanism, response.compliance)
        output, own = found.motion[0].T, np.diag(found.opening)  # (a, 3)
        main = np.argmax(np.abs(output[:, :2]), axis=1)
        along, across = (np.take_along_axis(output, each[:, None], 1)[:, 0] for each in (main, 1 - main))
        forces = np.zeros((len(actuators), len(response.compliance)))
        forces[:, drives] = (found.force * strokes).T
        others = found.opening.T.copy()
        np.fill_diagonal(others, np.nan)
        moves = np.abs(along) > ROUND_OFF * np.max(np.abs(found.motion))
        with np.errstate(divide="ignore", invalid="ignore"):
            cross, rotation = (np.where(moves, part / along, np.nan) for part in (across, output[:, 2]))
        rotation[np.abs(rotation) * mechanism.layout.lever < ROUND_OFF] = 0.0
        cross[np.abs(cross) < ROUND_OFF], others[np.abs(others) < ROUND_OFF] = 0.0, 0.0
        return {
            "motion": np.moveaxis(found.motion * strokes, -1, 0),
            "transmission": output,
            "used": 100 * own,
            "coupling": 100 * others,
            "cross": 100 * cross,
            "rotation": rotation,
            "force": np.diag(found.force) * strokes,
            "stress": response.stress(forces),
            "engaged": np.diag(found.engaged),
        }

    def made() -> dict[str, Array]:
        assert mesh is not None
        response = solved(mechanism, mesh.resolution)
        loads = transfer(mechanism, response.compliance).force * strokes
        return {a.name: np.tensordot(loads[:, k], response.fields[drives], 1) for k, a in enumerate(actuators)}

    found, fields = of_models(mechanism, mesh, models, values, progress), None
    if mesh is not None and not mesh.layers:
        fields = setup.MeshFields(meshed(mechanism, mesh.resolution), made)
    labels = {"other": [actuator.name for actuator in actuators]}
    warnings = over_yield(mechanism, found, "stress", "full stroke")
    return answer(MechanismDrive, mechanism, found, mesh, None, labels, warnings=warnings, fields=fields)


def over_yield(mechanism: Mechanism, found: Mapping[str, ModelAnswer], stress: str, where: str) -> list[str]:
    """Warn of a highest stress above the yield strength; `stress` names the quantity, `where` the load."""
    highest = max(float(np.max(model.values[stress])) for model in found.values() if stress in model.values)
    return warning.of_yield(highest, mechanism.material.yield_strength, where)


class MechanismReach(Result):
    """Ends of the motion of the output by the strokes of all actuators, by direction."""

    title = "reach of the drive"
    main = ("ends", {"others": "free"})
    labels: ClassVar = {"others": ("free", "zero"), "end": ("low", "high")}
    reading = (
        "motion relative to zero strokes; others: the other two directions, free, or held at zero by at least three "
        "actuators",
    )
    ends = Quantity(
        "ends of the motion of the output", "motion", ("others", "end", "model", "direction"), ON_MESHES, "all",
        prefixed=True,
    )  # fmt: skip


def reach(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> MechanismReach:
    """See `flexfem.reach`."""
    from scipy.optimize import linprog  # takes longer to import than all modules of questions

    mesh = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    strokes = np.array([actuator.stroke for actuator in mechanism.layout.actuators])

    def values(response: Responses) -> dict[str, Any]:
        motion = transfer(mechanism, response.compliance).motion[0] * strokes  # (3, a), for full strokes
        ends = np.array([np.minimum(motion, 0).sum(axis=1), np.maximum(motion, 0).sum(axis=1)])
        scale, held = np.max(np.abs(motion), axis=1), np.zeros((2, 3))
        if len(strokes) < 3:
            return {"ends": np.stack([ends, np.full((2, 3), np.nan)])}
        for direction, (end, sign) in ((d, e) for d in range(3) for e in enumerate((1.0, -1.0))):
            others = [k for k in range(3) if k != direction and scale[k] > ROUND_OFF * np.max(scale)]
            rows = motion[others] / scale[others, None]
            solution = linprog(sign * motion[direction] / max(scale[direction], 1e-300), A_eq=rows if others else None,
                               b_eq=np.zeros(len(others)) if others else None, bounds=(0, 1))  # fmt: skip
            held[end, direction] = sign * solution.fun * scale[direction]
        return {"ends": np.stack([ends, held])}

    found = of_models(mechanism, mesh, models, values, progress)
    return answer(MechanismReach, mechanism, found, mesh)
