"""Questions about any plate mechanism under mass, weight, heat and large loads: modes, gravity, drift, large."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from flexfem import arguments
from flexfem.analytic import plates as network
from flexfem.analytic.finite import displaced
from flexfem.arrays import Array
from flexfem.fem import ports as fem
from flexfem.fem.modes import Modes
from flexfem.fem.nonlinear import equilibria
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import corner_bands, levels
from flexfem.questions.plates import (
    ON_MESHES,
    PEAK,
    ROUND_OFF,
    SOLID_RESOLUTION,
    answer,
    by_models,
    factorised,
    joined_parts,
    meshed,
    model_of,
    stress_by,
)
from flexfem.questions.setup import MeshFields, ModelAnswer, Models, mesh_of, on_meshes
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, SOLID, SOLVED, Gate, Progress, Quantity, Result

GRAVITY = 9806.65  # mm/s^2, standard gravity
EQUAL = 1e-4  # relative difference of frequencies of modes that symmetry makes equal, on a mesh without symmetry
STILL = 1e-3  # motion of the output in a mode, relative to the largest of all modes, that counts as none
LIFTED = ("z", "tilt x", "tilt y")  # motions of the output out of the plane
CASES = ("uniform", "gradient in x", "gradient in y")
FRAME = "frame.expansion_um_per_m_k"
FRAME_ASSUMED = (
    f"{FRAME} is not stated: the frame is assumed to expand like the plate, so a uniform change causes no stress; "
    "state expansion_um_per_m_k under [frame], for example 12 for steel"
)


class MechanismModes(Result):
    """Natural frequencies of a mechanism with payload and actuators, and the motion of its output in every mode."""

    title = "natural modes"
    main = ("frequency", {})
    columns = ("model", "direction", "motion")
    reading = (
        "motion of the output: share of each direction in its square; rotations are multiplied by the lever",
        "a mode that hardly moves the output has no share; of modes with equal frequency, the first moves along x if "
        "one can",
        "modes out of the plane are computed with layers only; a payload is a flat body at mid-plane; the hinges of "
        "the analytic models have no mass: modes in which leaf springs vibrate are missing, and the numbers of higher "
        "modes differ from those of finite elements",
    )
    frequency = Quantity("natural frequency", "hz", ("mode", "model"), ON_MESHES)
    share = Quantity(
        "motion of the output by finite elements", "percents", ("mode", "direction"), Gate(1e-3, absolute=1e-4), "all"
    )
    tilt = Quantity(
        "motion of the output out of the plane", "percents", ("mode", "motion"), Gate(1e-3, absolute=1e-4), "all"
    )
    labels: ClassVar = {"motion": LIFTED}


def modes(
    mechanism: Mechanism,
    *,
    count: int = 6,
    drives: Literal["disengaged", "engaged"] = "disengaged",
    models: Models = "both",
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> MechanismModes:
    """See `flexfem.modes`."""
    mesh = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    engaged, solid = drives == "engaged", mesh is not None and mesh.layers > 0
    if engaged and not mechanism.layout.actuators:
        raise BadInput(f"{mechanism.origin}: drives 'engaged', expected at least one [[actuator]]")
    count, lever = arguments.integer("count", count, 100), mechanism.layout.lever
    kept = dict[str, Modes]()  # modes of the finest mesh, which is the last

    def by_network(elastic: bool) -> dict[str, Array]:
        parts = joined_parts(mechanism, elastic)
        found = network.modes(mechanism.layout, parts.bodies, engaged, parts.hinges)[:count]
        return {"frequency": np.pad(found, (0, count - len(found)), constant_values=np.nan)}

    def of_size(resolution: int, layers: int) -> dict[str, Array]:
        """Return frequencies and shares (modes, 3) of the output: in the plane, then with layers out of it."""
        parts = list[tuple[Array, Array]]()
        for lifting in (False, True)[: 2 if layers else 1]:
            found = fem.plate_modes(factorised(mechanism, resolution, layers, lifting), count + 1, engaged)
            kept["found"] = found.modes
            motion = found.ports[:, :3] * ([1.0, lever, lever] if lifting else [1.0, 1.0, lever])
            parts.append((found.modes.frequencies[:count], _shares(found.modes.frequencies, motion)[:count]))
        frequency, share = map(np.concatenate, zip(*parts, strict=True))
        return {"frequency": frequency, "share": share}

    answered = by_models(mesh, models, by_network, of_size, progress)
    order = np.argsort(answered[SOLID].values["frequency"], kind="stable")[:count] if solid else np.arange(count)
    lifted, planar = order >= count, np.flatnonzero(order < count)

    def placed(label: str, frequencies: Array) -> Array:
        """Return frequencies at their modes; models of the plane have no others."""
        if label == SOLID:
            return frequencies[order]
        at_modes = np.full(count, np.nan)
        at_modes[planar] = frequencies[: len(planar)]
        return at_modes

    found = {
        label: ModelAnswer(*({n: placed(label, part[n]) for n in part if n == "frequency"} for part in one))
        for label, one in answered.items()
    }
    names, values, fields = [str(k + 1) for k in range(count)], dict[str, Array](), None
    if mesh is not None:
        share = answered[SOLID if solid else ELEMENTS].values["share"][order]
        values["share"] = np.where(lifted[:, None], np.nan, share)
    if solid:
        names = [f"{k} {'out of' if out else 'in'} the plane" for k, out in enumerate(lifted, start=1)]
        values["tilt"] = np.where(lifted[:, None], share, np.nan)
    elif mesh is not None:
        shapes, plate = kept["found"], meshed(mechanism, mesh.resolution)
        fields = MeshFields(plate, lambda: {f"mode {k + 1}": shapes.field(k) for k in range(count)})
    settings = {"actuators": drives} if mechanism.layout.actuators else {}
    return answer(MechanismModes, mechanism, found, mesh, values, {"mode": names}, settings=settings, fields=fields)


def _shares(frequencies: Array, motion: Array) -> Array:
    """Return the shares (modes, 3), %, of directions in squared motions (modes, 3) of the output; nan without motion.

    Modes of equal frequency are combined to those of which the first alone moves along x, or else along y.
    """
    motion, starts = motion.copy(), np.flatnonzero(np.diff(frequencies) > EQUAL * frequencies[1:]) + 1
    for group in np.split(motion, starts):
        sizes = np.linalg.norm(group, axis=0)
        order = np.argsort(sizes < STILL * sizes.max(), kind="stable")
        group[:, order] = np.linalg.qr(group[:, order], mode="complete")[1]
    squares = motion**2
    whole = squares.sum(axis=1, keepdims=True)
    return 100 * squares / np.where(whole > STILL**2 * whole.max(), whole, np.nan)


class MechanismGravity(Result):
    """Displacement and hinge stress of an upright mechanism under its own weight, payload and actuators included."""

    title = "displacement under weight"
    main = ("pose", {})
    labels: ClassVar = {"motion": LIFTED}
    columns = ("direction", "motion")
    pose = Quantity("displacement", "motion", ("model", "point", "direction"), ON_MESHES, "pose", prefixed=True)
    sag = Quantity(
        "displacement of the output out of the plane of a horizontal plate", ("mm", "rad", "rad"), ("model", "motion"),
        ON_MESHES, "all", prefixed=True,
    )  # fmt: skip
    stress = Quantity("highest hinge stress", "mpa", ("model", "hinge"), PEAK, "all", largest=("hinge",))


def gravity(
    mechanism: Mechanism,
    *,
    angle: float = -90.0,
    models: Models = "both",
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> MechanismGravity:
    """See `flexfem.gravity`."""
    mesh = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    angle = arguments.between("angle", angle, -360.0, 360.0, " degrees")
    field = GRAVITY * np.array([[np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))]])
    points = 3 * len(mechanism.layout.points)

    def by_network(elastic: bool) -> dict[str, Array]:
        parts = joined_parts(mechanism, elastic)
        motions, wrenches = network.weighed(mechanism.layout, field, parts.bodies, hinges=parts.hinges)
        return {"pose": motions[:points, 0].reshape(-1, 3), "stress": stress_by(mechanism, wrenches[..., 0])}

    def of_size(resolution: int, layers: int) -> dict[str, Array]:
        response = fem.weight_of(factorised(mechanism, resolution, layers), field)
        pose, stress = response.motions[:points, 0].reshape(-1, 3), fem.hinge_stress(response, np.ones(1))
        if not layers:
            return {"pose": pose, "stress": stress}
        lifted = fem.weight_of(factorised(mechanism, resolution, layers, lifting=True), np.array([[-GRAVITY]]))
        return {"pose": pose, "stress": stress, "sag": lifted.motions[:, 0]}

    found = by_models(mesh, models, by_network, of_size, progress)
    return answer(MechanismGravity, mechanism, found, mesh, settings={"gravity": f"at {angle:g} degrees"})


class MechanismDrift(Result):
    """Displacement and stress of a mechanism per change of temperature."""

    title = "change of temperature"
    main_key = FRAME
    main = ("pose", {"case": "uniform"})
    labels: ClassVar = {"case": CASES}
    reading = ("uniform: per K; gradients: per K/mm about the origin, the same in the plate and in the ground",)
    pose = Quantity(
        "displacement", "motion", ("case", "point", "model", "direction"), ON_MESHES._replace(absolute=1e-8), "pose",
        prefixed=True,
    )  # fmt: skip
    stress = Quantity("highest hinge stress", "mpa", ("case", "model", "hinge"), PEAK, "all", largest=("hinge",))


def drift(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> MechanismDrift:
    """See `flexfem.drift`."""
    mesh, points = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION), 3 * len(mechanism.layout.points)
    plate, ground, warnings = mechanism.material.expansion, mechanism.frame.expansion, list[str]()
    if plate is None:
        raise BadInput(f"{mechanism.origin}: material.expansion_um_per_m_k is missing, expected um/(m K)")
    if ground is None:
        ground = plate
        warnings.append(FRAME_ASSUMED)

    lever = mechanism.layout.lever
    strains = max(plate, ground) * np.array([1.0, lever, lever])[:, None]  # free expansion by case

    def cleared(motions: Array, stress: Array) -> dict[str, Array]:
        """Return poses (cases, points, 3) and stresses (cases, hinges) without round-off."""
        pose, sizes = motions[:points].T.reshape(3, -1, 3), strains[:, None] * [lever, lever, 1.0]
        strained = mechanism.material.youngs_modulus * strains
        return {
            "pose": np.where(np.abs(pose) < ROUND_OFF * sizes, 0.0, pose),
            "stress": np.where(stress < ROUND_OFF * strained, 0.0, stress),
        }

    def by_network(elastic: bool) -> dict[str, Array]:
        parts = joined_parts(mechanism, elastic)
        motions, wrenches = network.warmed(mechanism.layout, plate, ground, parts.bodies, hinges=parts.hinges)
        return cleared(motions, stress_by(mechanism, np.moveaxis(wrenches, -1, 0)))

    def of_size(resolution: int, layers: int) -> dict[str, Array]:
        response = fem.warmed(factorised(mechanism, resolution, layers), plate, ground)
        return cleared(response.motions, fem.hinge_stress(response, np.eye(3)))

    found = by_models(mesh, models, by_network, of_size, progress)
    return answer(MechanismDrift, mechanism, found, mesh, warnings=warnings)


STEPS = (0.25, 0.5, 0.75, 1.0)
THEORIES = ("linear", "beams", "finite elements")
AMPLITUDE, LARGE_RESOLUTION = 0.5, 4  # mm, and triangles across a neck: as for stages


class MechanismLarge(Result):
    """Displacement of the output under growing dead loads: linear, and with finite rotations by both models."""

    title = "large displacements"
    main = ("pose", {})
    labels: ClassVar = {"load": tuple(f"{100 * share:g} %" for share in STEPS)}
    reading = (
        "linear: the analytic network with rigid bodies; beams: the same with hinges as co-rotational beams; finite "
        "elements: plane, with finite rotations and elastic bodies",
        "the rotation is that of the rigid motion nearest to the motion of the contact",
    )
    force = Quantity("load on the output", "wrench", ("load", "direction"), SOLVED, "wrench")
    pose = Quantity(
        "displacement of the output", "motion", ("load", "theory", "direction"), ON_MESHES, "pose", prefixed=True
    )
    stiffness = Quantity(
        "tangent stiffness, other directions free", "stiffness", ("load", "theory", "direction"), ON_MESHES
    )
    strain = Quantity("largest strain of finite elements", "", ("load",), PEAK, "all", shown=False)


def large(
    mechanism: Mechanism,
    *,
    force: tuple[float, float, float] | None = None,
    amplitude: float | None = None,
    models: Literal["both", "analytic"] = "both",
    resolution: int | None = None,
    progress: Progress | None = None,
) -> MechanismLarge:
    """See `flexfem.large`."""
    mesh, layout = mesh_of(models, resolution, None, usual=LARGE_RESOLUTION), mechanism.layout
    C = network.respond(layout).compliance
    if force is None:
        size = arguments.between("amplitude", AMPLITUDE if amplitude is None else amplitude, 1e-6, 1e4, " mm")
        softest = int(np.argmax(np.diag(C)[:2]))
        load = np.zeros(3)
        load[softest] = size / C[softest, softest]
    else:
        load = arguments.forces("force", force, 1)
    loads = np.zeros((len(STEPS), len(C)))
    loads[:, :3] = np.outer(STEPS, load)
    found = displaced(layout, loads)
    poses = [loads @ C[:, :3], found.motions[:, :3]]
    tangents = [np.broadcast_to(C, found.compliance.shape), found.compliance]
    values, bands = {"force": loads[:, :3]}, dict[str, Array]()
    if mesh is not None:
        steps = levels(mesh.resolution)
        each = on_meshes(steps, lambda level: equilibria(model_of(mechanism, level), loads), progress)
        poses.append(each[-1].pose[:, :3])
        tangents.append(each[-1].compliance)
        values["strain"] = each[-1].strain
        sizes = np.array(steps, dtype=float)
        alike = {"pose": [one.pose[:, :3] for one in each], "stiffness": [_along(one.compliance) for one in each]}
        for name, parts in alike.items():
            bands[name] = np.full((len(STEPS), len(THEORIES), 3), np.nan)
            bands[name][:, -1] = corner_bands(sizes, np.array(parts))
    values |= {"pose": np.stack(poses, axis=1), "stiffness": np.stack([_along(one) for one in tangents], axis=1)}
    stable = np.all(found.stable) and np.linalg.eigvalsh(tangents[-1])[:, 0].min() > 0
    warnings = [] if stable else ["an equilibrium is not stable under dead loads"]
    labels = {"theory": THEORIES[: len(poses)]}
    return answer(MechanismLarge, mechanism, {}, mesh, values, labels, bands, warnings=warnings)


def _along(compliance: Array) -> Array:
    """Stiffness (s, 3) along every direction of the output, the others free."""
    return np.asarray(1 / np.diagonal(compliance, axis1=1, axis2=2)[:, :3])
