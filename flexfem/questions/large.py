"""Effect of large displacements on a stage, and of the second-order terms of (16).

The load that holds the platform at a pose is computed by integrating the stiffness (16) of the
displaced stage along the path, without and with its second-order terms, by exact equilibrium of the
pseudo-rigid stage, and by nonlinear finite elements. Each is compared with its own linear solution,
so that the error of the hinge formulas cancels.

A mechanism is driven along one direction, or is under growing dead loads, with finite rotations:
beams and plane finite elements. Driven, the whole curve of force against displacement is followed,
also where it is not stable."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, ClassVar, Literal

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import displaced
from flexfem.analytic.plates import respond
from flexfem.arrays import Array
from flexfem.fem.nonlinear import equilibria, equilibrium, imposed
from flexfem.fem.response import Response
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.equations import PaperModel, stiffness
from flexfem.paper.equilibrium import at_pose, axis_poses, linear_errors, outwards, summed_loads
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import DEFAULT_FORMULA, analyse, assemble
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import plate_of
from flexfem.questions import warnings as warning
from flexfem.questions.bands import corner_bands, levels, percentages
from flexfem.questions.curve import NUMBERS, Traced, by_beams, by_elements, numbers_of
from flexfem.questions.plates import ON_MESHES, PEAK, model_of
from flexfem.questions.plates import solved as solved_plate
from flexfem.questions.setup import (
    Mesh,
    about,
    answer,
    for_mechanisms,
    mesh_of,
    meshed,
    on_meshes,
    solved,
)
from flexfem.refused import BadInput
from flexfem.results import SOLVED, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS, PLANES, UNITS, Direction, in_unit

AMPLITUDE = 0.5  # mm: ten times the workspace that examples/claims.py assumes
ROTATION = 0.02  # rad of rotation per mm of translation: 10 mrad with 500 um
RESOLUTION = (
    4  # with 8, compliances change by up to 0.09 % and the percentages here by 2.2e-4 points
)
STEPS = 20  # commands on either side of rest
ELEMENT_STEPS = np.array(
    [-20, -14, -8, -2, 0, 2, 8, 14, 20]
)  # steps at which finite elements are solved
STATED = np.array(
    [-20, -2, 2, 20]
)  # steps at which numbers are stated: a tenth of the amplitude and all of it
ROUND_OFF = (
    1e-12  # of the largest eigenvalue of a compliance, where motions of ports depend on each other
)
SLOPE_STEP = 1e-3  # of the amplitude, for central differences of the exact load
AMPLITUDES = (
    1e-9,
    1e3,
)  # mm: below there is only round-off; warnings report a stage that does not bear the largest
WITHOUT, TANGENT, EXACT, HELD, LOADED = range(5)  # positions on the axis "theory"
THEORIES = (
    "(16) without second-order terms",
    "(16)",
    "exact",
    "finite elements",
    "finite elements, same load",
)
UNSTABLE = "an equilibrium is not stable under dead loads"
SHARES = (0.25, 0.5, 0.75, 1.0)  # of the load on a mechanism
LINEAR = "linear"
BEAMS = "beams"
ELEMENTS = "finite elements"  # theories of a mechanism
PERCENT = Gate(
    1e-9, absolute=2e-3
)  # percentage points by which finite elements change with their mesh


class Large(Result):
    """Change of the tangent stiffness and errors of the linear position at large displacements, in
    per cent.
    """

    title = "large displacements"
    main = ("position", {})
    labels: ClassVar = {
        "theory": THEORIES,
        "at": tuple(f"{5 * k:+d} %" for k in STATED),
        "share": tuple(f"{5 * k:+d} %" for k in range(-STEPS, STEPS + 1)),
        "within": ("a tenth of the amplitudes", "the amplitudes"),
    }
    columns = ("theory",)
    figure = "paper.figures.large.large_figure"
    reading = (
        "each theory is compared with its own linear solution; position error: linear position "
        "under the load that holds the stage at the command, minus the command, in % of the "
        "command; across: the larger error of the other two directions, rotations multiplied by "
        "the lever; at: command in % of the amplitude",
    )
    amplitude = Quantity("amplitude", ("mm", "mm", "rad"), ("direction",))
    stiffness = Quantity(
        "change of the tangent stiffness", "percent", ("direction", "at", "theory"), PERCENT
    )
    error = Quantity(
        "error of the linear position along", "percent", ("direction", "at", "theory"), PERCENT
    )
    aside = Quantity(
        "error of the linear position across",
        "percent",
        ("direction", "at", "theory"),
        PERCENT,
        "all",
    )
    position = Quantity(
        "largest error of the linear position, all poses", "percent", ("within",), PERCENT
    )
    terms = Quantity(
        "change of the tangent compliance by second-order terms", "percent", ("within",), PERCENT
    )
    tangent = Quantity(
        "change of the tangent stiffness",
        "percent",
        ("direction", "share", "theory"),
        PERCENT,
        shown=False,
    )
    errors = Quantity(
        "error of the linear position",
        "percent",
        ("direction", "share", "theory", "component"),
        PERCENT,
        shown=False,
    )
    load = Quantity(
        "load that holds the platform",
        ("n", "n", "n_mm"),
        ("direction", "share", "theory", "component"),
        Gate(1.5e-5),
        "wrench",
        shown=False,
    )
    strain = Quantity(
        "largest strain of finite elements",
        "",
        ("direction", "share"),
        Gate(5e-3),
        "all",
        shown=False,
    )


class MechanismLarge(Result):
    """Displacement of the output under growing dead loads: linear, and with finite rotations by
    both models.
    """

    title = "large displacements"
    main = ("pose", {"load": "100 %"})
    labels: ClassVar = {"load": tuple(f"{100 * share:g} %" for share in SHARES)}
    reading = (
        "linear: the analytic network with rigid bodies, or finite elements of a plate without "
        "hinges; beams: the network with hinges as co-rotational beams; finite elements: plane, "
        "with finite rotations and elastic bodies",
        "the rotation is that of the rigid motion nearest to the motion of the contact",
    )
    force = Quantity("load on the output", "wrench", ("load", "direction"), SOLVED, "wrench")
    driving = Quantity(
        "force that drives the output",
        "wrench",
        ("load", "theory", "direction"),
        ON_MESHES,
        "wrench",
        note="with the output driven by the amplitude along one direction, the others free",
    )
    pose = Quantity(
        "displacement of the output", "motion", ("load", "theory", "direction"), ON_MESHES, "pose"
    )
    stiffness = Quantity(
        "tangent stiffness, other directions free",
        "stiffness",
        ("load", "theory", "direction"),
        ON_MESHES,
    )
    strain = Quantity("largest strain of finite elements", "", ("load",), PEAK, "all", shown=False)
    event_pose = Quantity(
        "displacement of the output at points of the curve",
        "motion",
        ("event", "theory", "direction"),
        ON_MESHES,
        "pose",
        note=(
            "limits of the force and of the displacement along the curve, positions without "
            "force, and buckling of what is not driven"
        ),
    )
    event_force = Quantity(
        "force that drives the output at points of the curve",
        "wrench",
        ("event", "theory", "direction"),
        ON_MESHES,
        "wrench",
    )
    event_pivots = Quantity(
        "negative pivots of the tangent stiffness at points of the curve",
        "",
        ("event", "theory"),
        shown=False,
    )
    curve_pose = Quantity(
        "displacement of the output along the curve",
        "motion",
        ("step", "theory", "direction"),
        ON_MESHES,
        "pose",
        shown=False,
    )
    curve_force = Quantity(
        "force that drives the output along the curve",
        "wrench",
        ("step", "theory", "direction"),
        ON_MESHES,
        "wrench",
        shown=False,
    )
    curve_pivots = Quantity(
        "negative pivots of the tangent stiffness along the curve",
        "",
        ("step", "theory"),
        shown=False,
        note="under the dead load: zero where the equilibrium is stable",
    )


@for_mechanisms(Large, MechanismLarge, only_for="force along")
def large(
    stage: Mechanism,
    *,
    amplitude: float | str = AMPLITUDE,
    along: Direction | None = None,
    force: tuple[float, float, float] | None = None,
    models: Literal["both", "analytic"] = "both",
    resolution: int | None = None,
    progress: Progress | None = None,
) -> Large | MechanismLarge:
    """Change of the tangent stiffness and error of the linear position of a stage or mechanism at
    large displacements.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    amplitude : float or str
        Largest displacement in X and Y, mm; in theta 0.02 rad for every mm. The output of a
        mechanism is driven by it along its softest translation, or turned by an angle with its
        unit, such as "5deg"; against it if negative.
    along : {"x", "y", "theta"}, optional
        Direction along which the output of a mechanism is driven, the others free; by default its
        softest translation.
    force : tuple of float, optional
        Largest load on the output of a mechanism, N and N mm, instead of the amplitude.
    models : {"both", "analytic"}
        "both" adds nonlinear finite elements to the pseudo-rigid stage.
    resolution : int, optional
        Triangles across every neck.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Large | MechanismLarge
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        large` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.large(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(float(found.at("error", direction="x", at="+100 %", theory="exact")), 3)  # per cent
    0.36
    """
    mesh = mesh_of(
        stage,
        models,
        resolution,
        None,
        4 if isinstance(stage, MechanismFile) else 2,
        usual=RESOLUTION,
    )
    if isinstance(stage, MechanismFile):
        return _of_mechanism(stage, force, amplitude, along, mesh, progress)
    if isinstance(amplitude, str):
        amplitude = _length(amplitude)
    largest = arguments.between("amplitude", amplitude, *AMPLITUDES) * np.array(
        [1.0, 1.0, ROTATION]
    )
    model = analyse(stage)
    paper = assemble(stage)
    lever = stage.chain.link_lengths[2]
    elements = None if mesh is None else solved(stage, mesh.resolution)
    warnings = warning.of_result(stage, model)
    if elements is not None:
        for direction, load in zip(
            DIRECTIONS, np.linalg.solve(elements.compliance, np.diag(largest)).T, strict=True
        ):
            highest = float(np.max(neck_stresses(stage, elements, load[None]).highest))
            warnings += warning.of_yield(
                highest, stage.material.yield_strength, f"largest command in {direction}"
            )
    boxes = [linear_errors(paper, share * largest, lever) for share in (STATED[2] / STEPS, 1.0)]
    paths = []
    for axis, direction in enumerate(DIRECTIONS):
        paths.append(_path(stage, paper, elements, axis, largest[axis]))
        if progress is not None:
            progress(f"along {direction}")
    values: dict[str, Any] = {name: np.array([path[name] for path in paths]) for name in paths[0]}
    errors = values["errors"][:, STEPS + STATED]
    across = np.array([np.delete(part, axis, axis=-1) for axis, part in enumerate(errors)])
    widest = np.argmax(np.abs(np.nan_to_num(across)), axis=-1)[..., None]
    values |= {
        "amplitude": largest,
        "stiffness": values["tangent"][:, STEPS + STATED],
        "error": np.array([part[..., axis] for axis, part in enumerate(errors)]),
        "aside": np.take_along_axis(across, widest, axis=-1)[..., 0],
        "position": [100 * float(box.position) for box in boxes],
        "terms": [100 * float(box.terms) for box in boxes],
    }
    settings = {
        "mobility": model.mobility,
        "formula": DEFAULT_FORMULA,
        "plane problem": PLANES[stage.model],
    }
    if elements is not None:
        settings |= meshed(mesh) | {"unknowns": elements.unknowns}
    return Large(about(stage), values, None, None, settings, list(dict.fromkeys(warnings)))


def _of_mechanism(
    mechanism: Mechanism,
    force: tuple[float, float, float] | None,
    amplitude: float | str,
    along: Direction | None,
    mesh: Mesh | None,
    progress: Progress | None,
) -> MechanismLarge:
    """Return the displacements under a load, or the curve of a driven output. Raises BadInput."""
    if force is None:
        return _driven(mechanism, amplitude, along, mesh, progress)
    if along is not None:
        raise BadInput("along and force, expected one of the two")
    return _loaded(mechanism, force, mesh, progress)


def _at_rest(mechanism: Mechanism, mesh: Mesh | None) -> Array:
    """Return the compliance (k, k) at rest by the analytic network, or by finite elements of a
    plate without hinges.
    """
    if mechanism.layout.joints:
        return respond(mechanism.layout).compliance
    assert mesh is not None
    return solved_plate(mechanism, mesh.resolution).compliance


def _loaded(
    mechanism: Mechanism,
    force: tuple[float, float, float],
    mesh: Mesh | None,
    progress: Progress | None,
) -> MechanismLarge:
    """Return the displacements under a growing dead load."""
    layout = mechanism.layout
    C = _at_rest(mechanism, mesh)
    loads = np.zeros((len(SHARES), len(C)))
    loads[:, :3] = np.outer(SHARES, arguments.forces("force", force, 1))
    poses = [loads @ C[:, :3]]
    tangents: list[Array] = [np.broadcast_to(C, (len(loads), *C.shape))]
    stable = True
    theories = [LINEAR]
    if layout.joints:
        found = displaced(layout, loads)
        poses.append(found.motions[:, :3])
        tangents.append(found.compliance)
        stable = bool(np.all(found.stable))
        theories.append(BEAMS)
    values = dict[str, Any]()
    bands = dict[str, Array]()
    if mesh is not None:
        steps = levels(mesh.resolution)
        each = on_meshes(
            steps, lambda level: equilibria(model_of(mechanism, level), loads), progress
        )
        poses.append(each[-1].pose[:, :3])
        tangents.append(each[-1].compliance)
        values["strain"] = each[-1].strain
        theories.append(ELEMENTS)
        sizes = np.array(steps, dtype=float)
        alike = {
            "pose": [one.pose[:, :3] for one in each],
            "stiffness": [_along(one.compliance) for one in each],
        }
        for name, parts in alike.items():
            bands[name] = np.full((len(SHARES), len(theories), 3), np.nan)
            bands[name][:, -1] = corner_bands(sizes, np.array(parts))
    values["force"] = loads[:, :3]
    values |= {
        "pose": np.stack(poses, axis=1),
        "stiffness": np.stack([_along(one) for one in tangents], axis=1),
    }
    ends = np.linalg.eigvalsh(tangents[-1])
    stable = stable and bool(np.all(ends[:, 0] > -ROUND_OFF * ends[:, -1]))
    warnings = [] if stable else [UNSTABLE]
    labels = {"theory": theories}
    return answer(MechanismLarge, mechanism, {}, mesh, {}, values, labels, bands, warnings=warnings)


def _driven(
    mechanism: Mechanism,
    amplitude: float | str,
    along: Direction | None,
    mesh: Mesh | None,
    progress: Progress | None,
) -> MechanismLarge:
    """Return the curve of the force that drives the output along one direction, the others free."""
    C = _at_rest(mechanism, mesh)
    port, size = _commanded(amplitude, along, C)
    motions = size * np.array(SHARES)
    traced = dict[str, Traced]()
    if mechanism.layout.joints:
        traced[BEAMS] = by_beams(mechanism.layout, port, motions)
    if mesh is not None:
        traced[ELEMENTS] = by_elements(mechanism, mesh, port, motions, progress)
    values, bands, labels = _of_curves(traced, C, port, motions)
    return answer(
        MechanismLarge,
        mechanism,
        {},
        mesh,
        {},
        values,
        labels,
        bands,
        warnings=_warned(traced, port, size),
    )


def _of_curves(
    traced: Mapping[str, Traced], compliance: Array, port: int, motions: Array
) -> tuple[dict[str, Array], dict[str, Array], dict[str, list[str]]]:
    """Return the values, bands and labels of curves along a port, nan beyond the end of a curve."""
    theories = [LINEAR, *traced]
    events = list(dict.fromkeys(label for one in traced.values() for label in one.events))
    steps = max(len(one.curve.points) for one in traced.values())
    at = {
        "share": np.full((len(SHARES), len(theories), NUMBERS), np.nan),
        "event": np.full((len(events), len(theories), NUMBERS), np.nan),
        "curve": np.full((steps, len(theories), NUMBERS), np.nan),
    }
    widths = {name: np.full_like(array, np.nan) for name, array in at.items()}
    pivots = {name: np.full(at[name].shape[:2], np.nan) for name in ("event", "curve")}
    strain = np.full(len(SHARES), np.nan)
    forces = motions / compliance[port, port]
    pushed = np.zeros((len(motions), 3))
    pushed[:, port] = forces
    at["share"][:, 0, :3] = pushed @ compliance[:3, :3]
    at["share"][:, 0, 3:6] = pushed
    at["share"][:, 0, 6:] = 1 / np.diag(compliance)[:3]
    for theory, (label, one) in enumerate(traced.items(), start=1):
        for number, point in enumerate(one.shares):
            at["share"][number, theory] = numbers_of(point)
            if label == ELEMENTS:
                strain[number] = point.strain
        widths["share"][: len(one.shares), theory] = one.share_bands
        for number, point in enumerate(one.curve.points):
            at["curve"][number, theory] = numbers_of(point)
            pivots["curve"][number, theory] = point.unstable
        for name, point in one.events.items():
            at["event"][events.index(name), theory] = numbers_of(point)
            pivots["event"][events.index(name), theory] = point.unstable
        for name, band in one.event_bands.items():
            widths["event"][events.index(name), theory] = band
    values = _named(at) | {f"{name}_pivots": array for name, array in pivots.items()}
    if ELEMENTS in traced:
        values["strain"] = strain
    if not events:
        values = {name: array for name, array in values.items() if not name.startswith("event")}
    bands = {name: array for name, array in _named(widths).items() if name in values}
    return (
        values,
        bands,
        {"theory": theories, "event": events, "step": [str(k) for k in range(steps)]},
    )


def _named(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Return arrays of `numbers_of` points by the names of their quantities."""
    pose = slice(0, 3)
    driving = slice(3, 6)
    stiffness = slice(6, 9)
    return {
        "pose": arrays["share"][..., pose],
        "driving": arrays["share"][..., driving],
        "stiffness": arrays["share"][..., stiffness],
        "event_pose": arrays["event"][..., pose],
        "event_force": arrays["event"][..., driving],
        "curve_pose": arrays["curve"][..., pose],
        "curve_force": arrays["curve"][..., driving],
    }


def _warned(traced: Mapping[str, Traced], port: int, size: float) -> list[str]:
    """Warn of unstable equilibria, of curves that end early, and of events that one theory alone
    has.
    """
    unit = "rad" if port == 2 else "mm"
    found = list[str]()
    for label, one in traced.items():
        points = one.curve.points
        unstable = [point.motions[port] for point in points if point.unstable]
        if unstable:
            between = f"from {unstable[0]:.4g} to {unstable[-1]:.4g} {unit}"
            found.append(
                f"{label}: {between} equilibria are not stable under the dead load: the mechanism "
                "snaps"
            )
        if any(name.startswith("buckling") for name in one.events):
            found.append(f"{label}: beyond buckling the curve is that without it, and not stable")
        if not one.curve.complete:
            reason = "no equilibrium is found beyond it"
            if label == ELEMENTS:
                reason += (
                    f", or the largest strain, {points[-1].strain:.2g} there, exceeds that of the "
                    "material law"
                )
            found.append(
                f"{label}: the curve ends at {points[-1].motions[port]:.4g} of {size:.4g} {unit}: "
                f"{reason}"
            )
    if len(traced) == 2:
        beams, elements = (set(one.events) for one in traced.values())
        if apart := sorted(beams ^ elements):
            found.append(f"beams and finite elements do not both find: {', '.join(apart)}")
    return found


def _commanded(
    amplitude: float | str, along: Direction | None, compliance: Array
) -> tuple[int, float]:
    """Return the port and the displacement, mm or rad, of an amplitude: an angle, or a length of
    the softest port.
    """
    if isinstance(amplitude, str) and not _is_length(amplitude):
        if along not in (None, "theta"):
            raise BadInput(
                f"amplitude {amplitude!r} along {along}, expected a length with its unit, such as "
                "3mm"
            )
        try:
            angle = in_unit(amplitude, UNITS["rad"])
        except ValueError:
            expected = "expected a length or an angle with its unit, such as 3mm or 5deg"
            raise BadInput(f"amplitude {amplitude!r}, {expected}") from None
        arguments.between("amplitude", abs(angle), 1e-9, 10.0, " rad")
        return 2, angle
    if along == "theta":
        raise BadInput(
            f"amplitude {amplitude!r} along theta, expected an angle with its unit, such as 5deg"
        )
    size = _length(amplitude) if isinstance(amplitude, str) else amplitude
    arguments.between(
        "amplitude", abs(size) if isinstance(size, int | float) else size, 1e-6, 1e4, " mm"
    )
    softest = int(np.argmax(np.diag(compliance)[:2]))
    return softest if along is None else DIRECTIONS.index(along), float(size)


def _is_length(text: str) -> bool:
    with suppress(ValueError):
        in_unit(text, UNITS["mm"])
        return True
    return False


def _length(text: str) -> float:
    """Return a length, mm, with its unit."""
    try:
        return in_unit(text, UNITS["mm"])
    except ValueError as error:
        raise BadInput(f"amplitude {error}") from None


def _along(compliance: Array) -> Array:
    """Stiffness (s, 3) along every direction of the output, the others free."""
    return np.asarray(1 / np.diagonal(compliance, axis1=1, axis2=2)[:, :3])


def _path(
    stage: Stage, paper: PaperModel, elements: Response | None, axis: int, end: float
) -> dict[str, Array]:
    """Return `tangent`, `errors`, `load` and `strain` of `Large` along an axis, other directions
    held at zero.
    """
    direction = DIRECTIONS[axis]
    lever = stage.chain.link_lengths[2]
    rest = stiffness(paper)
    step = SLOPE_STEP * end
    commanded = end * np.arange(-STEPS, STEPS + 1) / STEPS
    tangent = np.full((len(commanded), len(THEORIES)), np.nan)
    errors = np.full((*tangent.shape, 3), np.nan)
    loads = np.full((*tangent.shape, 3), np.nan)
    values = {
        "tangent": tangent,
        "errors": errors,
        "load": loads,
        "strain": np.full(len(commanded), np.nan),
    }

    def relative_errors(pose: Array, displacements: Array) -> Array:
        """Return errors (n, 3) in per cent of displacements (n,); zero at rest, since errors are of
        second order.
        """
        nonzero = displacements != 0
        percent = np.zeros_like(pose)
        percent[nonzero] = percentages(pose[nonzero], displacements[nonzero], direction, lever)
        return percent

    exact = at_pose(paper, axis_poses(commanded, axis))
    after, before = (
        at_pose(paper, axis_poses(commanded + side, axis)).load for side in (step, -step)
    )
    slopes = [state.stiffness()[..., axis] for state in (exact.without_terms, exact)] + [
        (after - before) / (2 * step)
    ]
    summed = summed_loads(paper, commanded, axis)
    for theory, load in enumerate((summed["without"], summed["tangent"], exact.load)):
        tangent[:, theory] = 100 * (slopes[theory][:, axis] / rest.K_uu[axis, axis] - 1)
        errors[:, theory] = relative_errors(
            load @ rest.C_uu - axis_poses(commanded, axis), commanded
        )
    loads[:, EXACT] = exact.load
    if elements is None:
        return values
    plate = plate_of(stage)
    C = elements.compliance
    places = STEPS + ELEMENT_STEPS
    held_load = np.zeros((len(ELEMENT_STEPS), 3))
    compliance = np.tile(C, (len(ELEMENT_STEPS), 1, 1))
    strain = np.zeros(len(ELEMENT_STEPS))
    for side in outwards(ELEMENT_STEPS):
        solution = imposed(elements.mesh, plate, axis_poses(commanded[places[side]], axis))
        held_load[side] = solution.load
        compliance[side] = solution.compliance
        strain[side] = solution.strain
    exact_load = exact.load[STEPS + STATED]
    pose = np.zeros((len(STATED), 3))
    for side in outwards(STATED):
        pose[side] = equilibrium(elements.mesh, plate, exact_load[side]).pose
    slope = np.linalg.inv(compliance)[:, axis, axis] / np.linalg.inv(C)[axis, axis]
    tangent[places, HELD] = 100 * (slope - 1)
    loads[places, HELD] = held_load
    values["strain"][places] = strain
    errors[places, HELD] = relative_errors(
        held_load @ C - axis_poses(commanded[places], axis), commanded[places]
    )
    errors[STEPS + STATED, LOADED] = relative_errors(exact_load @ C - pose, pose[:, axis])
    return values
