"""Natural frequencies and modes of a stage by meshes and layers beside analytic models, and its reduced dynamics.

In the plane the stage's own plane problem vibrates, stacks engaged or not; in three dimensions both faces are free.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import DEFAULT_FORMULA, ModelChoice, analyse, best_model
from flexfem.analytic.network import with_springs
from flexfem.analytic.responses import dynamics
from flexfem.arrays import Array
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.modes import Modes as ModesOfStructure
from flexfem.fem.modes import VibratingStructure, lowest, stage_modes, vibrating_structure
from flexfem.fem.modes import modes as modes_of
from flexfem.fem.response import stack_loads
from flexfem.fem.structure import layers_of, plate_of, sheet_of, structure
from flexfem.files.writing import replacing, write_atomically
from flexfem.mechanism import bodies
from flexfem.mechanism.bodies import Payload
from flexfem.mechanism.drives import StageDrive, drive_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import counted
from flexfem.questions import warnings as warning
from flexfem.questions.bands import CAUTIOUS, ORDER, SAFETY, Convergence, coarser, grid_convergence, levels
from flexfem.questions.setup import Mesh, ModelAnswer, Models, about, answer, mesh_of, on_meshes, question, sectors_of
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, FRESH, SHEET, SOLID, Gate, Progress, Quantity, Result
from flexfem.units import DENSITY, DIRECTIONS, FORCES, LENGTH, POSES, UNITS

Drives: TypeAlias = Literal["disengaged", "engaged"]
ALL_BASES = (*DIRECTIONS, "z", "tilt x", "tilt y")
KINDS = ("in plane", "out of plane")
SOLID_RESOLUTION = 4  # triangles across every neck in three dimensions
MOST, MOST_SOLID = 100, 40  # modes
MOST_DAMPING = 99.0  # % of critical
LARGEST_PAYLOAD = (1e4, 1e10)  # kg, kg mm^2; no stage of necks carries a hundredth of it
ROUND_OFF = 1e-9  # of a frequency
AGREED = 0.1  # relative, of the observed and the theoretical order
SAME_SHAPE = 0.7  # least overlap of two shapes that are called one: any turn of a pair of one frequency leaves as much
RIGID_MODES = 3  # the platform on its hinges; above them links swing and bend
ABOVE_THIRD = (
    "analytic frequencies above the third are not to be trusted: links swing and bend there. On 40 random stages, "
    "drives disengaged, those of elastic links were 0.8 to 28 % too low (half by more than 10 %), those of rigid links "
    "with calibrated hinges 5 to 163 % too high; the first three, by calibrated hinges, were within 0.11 % and 3.4 %"
)
OUT_OF_PLANE = (
    "motion in the plane only: modes in which the platform leaves the plane are not found here, and the lowest of them "
    "can lie below these"
)
NO_STACKS = "engaged stacks are springs without mass, and hold their strokes: their own mass is left out"
AT_ITS_PLACE = (
    "payload: its centre of mass at the platform's centre, in the mid-plane; mounted above it, it would couple motion "
    "in the plane and out of it, which is left out"
)
KILOGRAM, INERTIA = UNITS["kg"].factor, UNITS["kg_mm2"].factor


class NaturalModes(Result):
    """Natural frequencies, effective modal masses and the masses that vibrate."""

    title = "natural modes"
    columns = ("model", "base")
    figure = "modes.figures"
    drawn_from_fields = True
    reading = ("effective modal mass: for motion of the base, of the whole mass or moment of inertia",)
    frequency = Quantity("natural frequency", "hz", ("mode", "model"), Gate(FRESH.relative, 0.2))
    share = Quantity("effective modal mass", "percent", ("mode", "base"), Gate(1e-3, absolute=1e-6), "all")
    band_plane = Quantity("band by the mesh in the plane", "hz", ("mode",), Gate(0.2), shown=False)
    band_thickness = Quantity("band by the layers", "hz", ("mode",), Gate(0.2), shown=False)
    mass = Quantity("mass, pads, hub and payload too", "kg")
    inertia = Quantity("moment of inertia about the platform's centre", "kg_mm2")
    tilting_inertia = Quantity("moments of inertia about x and y", "kg_mm2", ("tilt",), FRESH)
    meshed_mass = Quantity("mass by the finite elements", "kg", gate=FRESH, shown=False)
    hub_mass = Quantity("mass of the hub", "kg")
    first_out_of_plane = Quantity("first natural frequency out of the plane", "hz", gate=Gate(FRESH.relative, 0.2))
    labels: ClassVar = {"base": DIRECTIONS, "tilt": ("x", "y")}


class Channels(NamedTuple):
    """Names and units of inputs or outputs."""

    names: tuple[str, ...]
    units: tuple[str, ...]


OUTPUTS = Channels(tuple(f"pose {name}" for name in DIRECTIONS), tuple(map(str, POSES)))


class StateSpace(NamedTuple):
    """`s' = A s + B u`, `y = C s + D u`: modal displacements and rates; D is what the modes left out do at rest."""

    A: Array
    B: Array
    C: Array
    D: Array


class CraigBampton(NamedTuple):
    """`M q'' + K q = L u` of pose x, y, theta and k modes with the platform held: (3 + k, 3 + k), (3 + k, inputs)."""

    stiffness: Array
    mass: Array
    loads: Array


class DynamicModel(NamedTuple):
    """How the pose of the platform answers loads on it and commands of an engaged drive, in mm, N, tonne, s and rad.

    frequencies : (k,), rad/s.   drive, read : (k, inputs) and (3, k), shapes at the inputs and of the pose.
    residual : (3, inputs), what the modes left out add at rest.   damping : of every mode, over critical; assumed.
    """

    frequencies: Array
    drive: Array
    read: Array
    residual: Array
    damping: float
    inputs: Channels
    craig_bampton: CraigBampton
    outputs: Channels = OUTPUTS

    @property
    def state_space(self) -> StateSpace:
        """As matrices of first order."""
        k, n = len(self.frequencies), self.drive.shape[1]
        rates = np.hstack([-np.diag(self.frequencies**2), -np.diag(2 * self.damping * self.frequencies)])
        A = np.vstack([np.eye(k, 2 * k, k), rates])
        C = np.hstack([self.read, np.zeros((3, k))])
        return StateSpace(A, np.vstack([np.zeros((k, n)), self.drive]), C, self.residual)

    @property
    def truncation(self) -> Array:
        """By how many per cent (k,) the lowest frequencies of the Craig-Bampton matrices are above `frequencies`."""
        from scipy.linalg import eigh

        squares = eigh(self.craig_bampton.stiffness, self.craig_bampton.mass, eigvals_only=True)
        return np.asarray(100 * (np.sqrt(squares[: len(self.frequencies)]) / self.frequencies - 1))

    @property
    def truncation_note(self) -> str:
        """The same in a sentence."""
        above, kept = self.truncation, counted(len(self.frequencies), "mode", "modes")
        return (
            f"K_cb and M_cb are truncated, {kept} with the platform held: by them as many lowest frequencies are "
            f"{max(above.min(), 0.0):.2g} to {above.max():.2g} % above those of all freedoms"
        )

    def response(self, frequencies: Array) -> Any:
        """Complex response (f, 3, inputs), pose per input, at frequencies (f,), rad/s."""
        w, own = np.asarray(frequencies, dtype=float)[:, None], self.frequencies
        gain = 1 / (own**2 - w**2 + 2j * self.damping * own * w)
        return np.einsum("ok,fk,ki->foi", self.read, gain, self.drive) + self.residual

    def arrays(self) -> dict[str, Any]:
        """All arrays by name, with names and units of inputs and outputs, for files."""
        found = self.state_space._asdict() | dict(zip(("K_cb", "M_cb", "L_cb"), self.craig_bampton, strict=True))
        others = {
            "frequencies_rad_per_s": self.frequencies,
            "damping_ratio": self.damping,
            "K_cb_above_percent": self.truncation,
            "K_cb_note": self.truncation_note,
            "inputs": self.inputs.names,
            "input_units": self.inputs.units,
            "outputs": self.outputs.names,
            "output_units": self.outputs.units,
            "units": "mm, N, tonne, s, rad",
        }
        return found | {name: np.array(each) for name, each in others.items()}

    def write(self, path: Path) -> None:
        """Write `arrays` by the file's extension, .npz or MATLAB's .mat. Raises BadInput."""
        if path.suffix not in (".npz", ".mat"):
            raise BadInput(f"{path}: extension {path.suffix!r}, expected .npz or .mat")
        arrays = self.arrays()
        if path.suffix == ".npz":
            write_atomically(path, lambda file: np.savez(file, **arrays))
            return
        from scipy.io import savemat

        texts = {name for name, value in arrays.items() if value.ndim and value.dtype.kind == "U"}  # cells of MATLAB
        with replacing(path) as temporary:
            savemat(temporary, arrays | {name: arrays[name].astype(object) for name in texts}, oned_as="column")


class Vibration(NamedTuple):
    """Mode shapes of unit modal mass on the finest mesh.

    shapes : (k, n, 2), or in three dimensions (k, n, m, 3) from face to face at `heights` (m,), mm.
    tilting : (k,), whether the platform leaves the plane.   reduced : in the plane.
    """

    mesh: StageMesh
    shapes: Array
    tilting: list[bool]
    heights: Array | None = None
    reduced: DynamicModel | None = None

    def write(self, path: Path) -> list[Path]:
        """Write the shapes as VTU, and matrices of the reduced dynamics as .npz and .mat; returns the paths."""
        paths = [path.with_suffix(ending) for ending in (".vtu", ".npz", ".mat")]
        fields = {f"mode {k}": field for k, field in enumerate(self.shapes, start=1)}
        write_vtu(self.mesh, paths[0], fields, self.heights)
        if self.reduced is None:
            return paths[:1]
        for each in paths[1:]:
            self.reduced.write(each)
        return paths


@question
def modes(
    stage: Stage,
    *,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    tilting: float | None = None,
    drives: Drives = "disengaged",
    damping: float = 1.0,
    models: Models = "both",
    resolution: int | None = None,
    layers: int | None = None,
    progress: Progress | None = None,
) -> NaturalModes:
    """Natural frequencies and modes of a stage with a payload, in the plane or in three dimensions.

    Parameters
    ----------
    count : int
        How many modes, from the lowest.
    payload : tuple of float
        Mass, kg, and moment of inertia about the platform's centre, kg mm^2, of what the platform carries there.
    tilting : float, optional
        Moment of inertia of the payload about x and y, kg mm^2, in three dimensions; by default half of the other, as
        of a flat body.
    drives : {"disengaged", "engaged"}
        Whether the stacks stiffen the stage; they hold their strokes, and their mass is left out.
    damping : float
        Damping of every mode, % of critical, in the reduced models; assumed.
    layers : int, optional
        Three dimensions with so many layers in half the thickness, from 3; also modes out of the plane.
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.modes(flexfem.load("geometry/mobility6.toml"), count=3, models="elements", resolution=4)
    >>> (found.frequency[:, 0] / 6.283185).round()  # Hz, of rad/s
    array([131., 131., 194.])
    """
    check_feasible(stage)
    mesh, in_depth = mesh_of(models, resolution, layers, usual_solid=SOLID_RESOLUTION), layers is not None
    count = arguments.integer("count", count, MOST_SOLID if in_depth else MOST)
    load = _payload(payload, tilting, in_depth)
    ratio = arguments.positive("damping", damping, MOST_DAMPING) / 100
    drive = None
    if drives == "engaged":
        if in_depth:
            raise BadInput("drives 'engaged' with layers, expected disengaged: stacks are of the plane")
        drive = drive_of(stage)
    warnings, notes = list(warning.of_stage(stage)), list[str]()
    drawn = bodies.drawn_inertia(stage) + load.matrix
    values = {
        "mass": drawn[0, 0],
        "inertia": drawn[2, 2],
        "hub_mass": bodies.hub_moments(stage)[0] * bodies.mass_per_area(stage),
    }
    rigid = {} if models == "elements" else _analytic(stage, load, drive, warnings)
    warnings += [ABOVE_THIRD] * (bool(rigid) and count > RIGID_MODES)
    elements, places = dict[str, ModelAnswer](), list(range(count))
    axes: dict[str, Sequence[str]] = {"mode": [str(k + 1) for k in places]}
    fields: Vibration | None = None
    if mesh is not None and mesh.layers:
        elements, others, fields = _in_three_dimensions(stage, load, count, mesh, progress)
        places = [k for k, tilting in enumerate(fields.tilting) if not tilting]  # analytic models are plane
        axes = {"mode": [f"{k} {KINDS[kind]}" for k, kind in enumerate(fields.tilting, start=1)], "base": ALL_BASES}
        values |= others
        warnings += [*warning.held_faces(stage), *([AT_ITS_PLACE] if any(load) else [])]
    elif mesh is not None:
        elements[ELEMENTS], others, fields = _in_plane(stage, load, drive, count, mesh.resolution, ratio, progress)
        values |= others
        notes = [fields.reduced.truncation_note] if fields.reduced else []
        warnings += [*warning.of_thickness(stage), OUT_OF_PLANE, *[NO_STACKS] * (drive is not None)]
    found = {name: ModelAnswer({"frequency": _placed(each, places, count)}) for name, each in rigid.items()} | elements
    said = f"{load.mass * KILOGRAM:g} kg, {load.inertia * INERTIA:g} kg mm^2" if any(load) else None
    settings = {"drives": drives, "payload": said}
    of = about(stage, drive=drive is not None)
    return answer(NaturalModes, of, found, mesh, settings, values, axes, warnings=warnings, notes=notes, fields=fields)


@question
def dynamic_model(
    stage: Stage,
    count: int = 12,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    damping: float = 1.0,
    resolution: int | None = None,
) -> DynamicModel:
    """Frequency response, state space and Craig-Bampton matrices of the platform under loads and strokes.

    Parameters
    ----------
    count : int
        How many modes are kept; what the others do at rest is added.
    payload, drives, damping
        As of `modes`.
    {shared}

    Notes
    -----
    R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313. Shapes and units of all matrices: `DynamicModel`.
    """
    found = modes(
        stage, count=count, payload=payload, drives=drives, damping=damping, models="elements", resolution=resolution
    )
    reduced: DynamicModel = found.fields.reduced
    return reduced


def _payload(payload: tuple[float, float], tilting: float | None, solid: bool) -> Payload:
    """The payload in inside units. Raises BadInput."""
    said = "mass (kg) and moment of inertia (kg mm^2)"
    mass, inertia = arguments.pair("payload", payload, LARGEST_PAYLOAD, said)
    if tilting is not None and not solid:
        raise BadInput("tilting without layers, expected both: modes are in the plane")
    flat = " kg mm^2: no body has less than a flat one, half of its moment of inertia about the normal"
    least, most = inertia / 2, LARGEST_PAYLOAD[1]
    diameter = least if tilting is None else arguments.between("tilting", tilting, least, most, flat)
    return payload_of(mass, inertia, diameter)


def payload_of(mass: float, inertia: float, tilting: float = 0.0) -> Payload:
    """A payload of so many kg and kg mm^2."""
    return Payload(mass / KILOGRAM, inertia / INERTIA, tilting / INERTIA)


def _placed(values: Array, places: list[int], count: int) -> Array:
    """The first values at places, nan elsewhere, where there are fewer, and where a model has no such freedom."""
    found, places = np.full(count, np.nan), places[: len(values)]
    found[places] = np.where(np.isfinite(values), values, np.nan)[: len(places)]
    return found


def _analytic(stage: Stage, payload: Payload, drive: StageDrive | None, warnings: list[str]) -> dict[str, Array]:
    """Natural frequencies (21,), rad/s, by the stage's own rigid model, the best of the same plane, and the best.

    inf for freedoms that a model does not have; why a model is replaced is added to `warnings`.
    """
    best, found = best_model(stage, warnings), {}
    for one in (ModelChoice(stage, None, DEFAULT_FORMULA, False), best._replace(stage=stage), best):
        if one.name in found:
            continue
        of = dynamics(one.stage, analyse(*one), payload, *(() if drive is None else (drive.stacks,)))
        if drive is not None:
            of = of._replace(compliance=with_springs(of.compliance, drive.stiffness))
        found[one.name] = of.frequencies
    return found


def vibrating(stage: Stage, mesh: StageMesh, payload: Payload, drive: StageDrive | None = None) -> VibratingStructure:
    """The stage as it vibrates, drive engaged or none, on one mesh. Raises BadInput for a model that is not plane."""
    of, pushes, rates = structure(mesh, plate_of(stage)), None, None
    if drive is not None:
        pushes, rates = stack_loads(of, drive.stacks)[:, 3:], drive.stiffness
    return vibrating_structure(of, stage.material.density * DENSITY, bodies.carried(stage, payload), pushes, rates)


def _in_plane(
    stage: Stage,
    payload: Payload,
    drive: StageDrive | None,
    count: int,
    resolution: int,
    damping: float,
    progress: Progress | None,
) -> tuple[ModelAnswer, dict[str, Any], Vibration]:
    """Modes on the finest of three plane meshes, and what has no axis of models."""

    def solve(level: int) -> tuple[VibratingStructure, ModesOfStructure]:
        of = vibrating(stage, build_mesh(stage, level), payload, drive)
        return of, modes_of(of, count)

    meshes = on_meshes(levels(resolution), solve, progress)
    of, found = meshes[-1]
    bands = _frequency_bands(resolution, [each.frequencies for _, each in meshes])
    values = {"share": _shares(found), "meshed_mass": found.total[0, 0]}
    shapes, reduced = np.array([found.field(k) for k in range(count)]), _reduced(of, found, damping, drive)
    fields = Vibration(of.structure.mesh, shapes, [False] * count, None, reduced)
    return ModelAnswer({"frequency": found.frequencies}, {"frequency": bands}), values, fields


def _shares(of: ModesOfStructure) -> Array:
    """Effective modal masses (k, 3), % of the whole mass or moment of inertia."""
    return 100 * of.participation**2 / np.diag(of.total)


def _in_three_dimensions(
    stage: Stage, payload: Payload, count: int, mesh: Mesh, progress: Progress | None
) -> tuple[dict[str, ModelAnswer], dict[str, Any], Vibration]:
    """The lowest modes of both kinds together; bands are shares of the frequency on the meshes that they are from."""
    plate, density = sheet_of(stage), stage.material.density * DENSITY
    loads = bodies.carried(stage, payload), bodies.carried_out_of_plane(stage, payload)

    def by_kind(kind: int) -> tuple[ModesOfStructure, Array]:
        """Modes of one kind, and their frequencies with both bands (3, k)."""

        def solve(level: int, number: int) -> ModesOfStructure:
            return stage_modes(
                sectors_of(stage, level), plate, layers_of(stage, number, kind == 1), density, loads[kind], count
            )

        by_mesh, (few, many) = coarser(lambda *sizes: solve(*sizes).frequencies, *mesh)
        of = solve(*mesh)
        plane = _frequency_bands(mesh.resolution, by_mesh) / by_mesh[-1]
        return of, of.frequencies * np.array([np.ones(count), plane, SAFETY * np.abs(many - few) / many])

    (flat, of_flat), (tilting, of_tilting) = on_meshes((0, 1), by_kind, progress)
    every = np.hstack([of_flat, of_tilting])
    order = np.argsort(every[0], kind="stable")[:count]
    frequency, plane, thickness = every[:, order]
    chosen = [divmod(int(k), count) for k in order]  # kind, and number among those of the kind
    shares = np.zeros((2 * count, len(ALL_BASES)))
    shares[:count, :3], shares[count:, 3:] = _shares(flat), _shares(tilting)
    values = {
        "share": shares[order],
        "band_plane": plane,
        "band_thickness": thickness,
        "tilting_inertia": np.diag(tilting.total)[1:],
        "meshed_mass": flat.total[0, 0],
        "first_out_of_plane": tilting.frequencies[0],
    }
    sheet = np.append(_in_plane_stress(stage, flat, loads[0], count), np.full(count, np.nan))
    models = {
        SHEET: ModelAnswer({"frequency": sheet[order]}),
        SOLID: ModelAnswer({"frequency": frequency}, {"frequency": plane + thickness}),
    }
    half, flips = flat.layers.heights, np.array([[1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])  # of u, v, w across the plane
    upper = np.array([(flat, tilting)[kind].field(k) for kind, k in chosen])
    lower = flips[[kind for kind, _ in chosen], None, None] * upper[:, :, :0:-1]
    shapes, heights = np.concatenate([lower, upper], axis=2), np.concatenate([-half[:0:-1], half])
    return models, values, Vibration(flat.mesh, shapes, [kind == 1 for kind, _ in chosen], heights)


def _in_plane_stress(stage: Stage, of: ModesOfStructure, load: Array, count: int) -> Array:
    """Frequencies (k,) in plane stress, on the same mesh, of the shapes that the mid-plane has, by overlap; or nan."""
    flat = vibrating_structure(structure(of.mesh, sheet_of(stage)), stage.material.density * DENSITY, load)
    solved, fields = modes_of(flat, count), [of.field(k)[flat.structure.free, 0, :2].ravel() for k in range(count)]
    middle = np.vstack([np.transpose(fields), of.shapes[0, -3:]])
    moved = flat.mass.loads(middle)
    overlap = np.abs(solved.shapes[0].T @ moved) / np.sqrt(np.sum(middle * moved, axis=0))
    return np.where(np.max(overlap, axis=0) > SAME_SHAPE, solved.frequencies[np.argmax(overlap, axis=0)], np.nan)


def _frequency_bands(resolution: int, frequencies: Sequence[Array]) -> Array:
    """Bands (k,) of frequencies (k,) on three meshes, coarse to fine."""
    steps = np.array(levels(resolution))
    return np.array([frequency_convergence(steps, each).band for each in np.transpose(frequencies)])


def frequency_convergence(resolutions: Array, values: Array) -> Convergence:
    """Grid convergence of a frequency, with a wider band unless the observed order is the theoretical one.

    Notes
    -----
    Necks converge by order four, free re-entrant corners of links by little more than one (1.09 at a right angle, twice
    the exponent of the displacement: M. L. Williams, J. Appl. Mech. 19 (1952) 526, recalled). Where links bend, above
    the third mode, corners take over as meshes get finer, and the order observed on coarse meshes is too high. The band
    is therefore at least `1.25 |e21| / (r21 - 1)`, by the order of a crack, one, which no corner falls below; and at
    least `3 |e21| / (r21^p - 1)` with the lesser p of the orders, W. L. Oberkampf, C. J. Roy, Verification and
    Validation in Scientific Computing (2010), section 8.6 (recalled). Where steps do not converge the larger counts.
    """
    found = grid_convergence(resolutions, values, round_off=ROUND_OFF)
    converging = found.verdict == "converging"
    if found.verdict == "round-off" or (converging and abs(found.observed / ORDER - 1) <= AGREED):
        return found
    steps = np.abs(np.diff(values[-3:]))
    step = steps[-1] if converging else steps.max()
    ratio, order = resolutions[-1] / resolutions[-2], min(found.order, ORDER)
    factor = max(CAUTIOUS / (ratio**order - 1), SAFETY / (ratio - 1))
    return found._replace(band=max(found.band, factor * float(step)))


def _reduced(of: VibratingStructure, modes: ModesOfStructure, damping: float, drive: StageDrive | None) -> DynamicModel:
    """The dynamics of a structure by some of its modes; the commands of an engaged drive are inputs, too."""
    size = of.structure.size
    loads = np.eye(size, 3, 3 - size)
    names, units = [f"load {name}" for name in DIRECTIONS], list(map(str, FORCES))
    if drive is not None:
        loads = np.hstack([loads, of.stack_loads @ (of.stack_stiffness[:, None] * drive.differential)])
        names += [f"stroke {name}" for name in drive.names]
        units += [str(LENGTH)] * len(drive.names)
    at_rest, shapes = of.space.solve(loads), modes.shapes[0]
    drives, read = shapes.T @ loads, shapes[-3:]
    residual = at_rest[-3:] - (read / modes.frequencies**2) @ drives
    reduced = _craig_bampton(of, at_rest[:, :3], loads, len(modes.frequencies))
    inputs = Channels(tuple(names), tuple(units))
    return DynamicModel(modes.frequencies, drives, read, residual, damping, inputs, reduced)


def _craig_bampton(of: VibratingStructure, static: Array, loads: Array, count: int) -> CraigBampton:
    """Reduce to the pose and `count` modes with the platform held; static (m, 3): what unit loads on it do.

    Notes
    -----
    With `X = K^-1 E` the constraint modes are `X (E' X)^-1`; the inverse of the stiffness with the platform held is
    `K^-1 - X (E' X)^-1 X'`. R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313.
    """
    from scipy.sparse.linalg import LinearOperator

    K_pose, size = np.linalg.inv((static[-3:] + static[-3:].T) / 2), len(static) - 3

    def held(b: Array) -> Array:
        whole = np.pad(b, ((0, 3), (0, 0)))
        return np.asarray((of.space.solve(whole) - static @ (K_pose @ (static.T @ whole)))[:-3])

    def inertia(b: Array) -> Array:
        return of.mass.loads(np.pad(b.reshape(size, -1), ((0, 3), (0, 0))))[:-3]

    squares, shapes = lowest(held, LinearOperator((size, size), matvec=inertia, dtype=float), count)
    shapes = shapes / np.sqrt(np.einsum("ik,ik->k", shapes, inertia(shapes)))
    T = np.hstack([static @ K_pose, np.pad(shapes, ((0, 3), (0, 0)))])
    T[-3:] = np.eye(3, 3 + count)
    K = np.zeros((3 + count, 3 + count))
    K[:3, :3], K[3:, 3:] = K_pose, np.diag(squares)
    return CraigBampton(K, T.T @ of.mass.loads(T), T.T @ loads)
