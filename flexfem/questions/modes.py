"""Natural frequencies and modes of a stage by finite elements and analytic models, and its reduced
dynamics.

The plane problem is that of the stage, with stacks engaged or not; in three dimensions both faces
are free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.network import with_springs
from flexfem.analytic.plates import modes as network_modes
from flexfem.analytic.preloaded import modes as beam_modes
from flexfem.arrays import Array, Index, brief
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import Modes as ModesOfStructure
from flexfem.fem.modes import VibratingStructure, lowest, stage_modes, vibrating_structure
from flexfem.fem.modes import modes as modes_of
from flexfem.fem.ports import plate_modes
from flexfem.fem.structure import mass_of, structure
from flexfem.files.provenance import counted
from flexfem.files.writing import replacing, write_atomically
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper import bodies
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.fields import stack_loads
from flexfem.paper.model import DEFAULT_FORMULA, ModelChoice, analyse, best_model
from flexfem.paper.responses import dynamics
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, layers_of, plate_of, sheet_of
from flexfem.questions import plates, preloaded
from flexfem.questions import warnings as warning
from flexfem.questions.bands import CAUTIOUS, ORDER, SAFETY, Convergence, grid_convergence
from flexfem.questions.loads import AtPoints, stated_load
from flexfem.questions.setup import (
    ELASTIC,
    LIFTED,
    Mesh,
    MeshFields,
    ModelAnswer,
    Models,
    about,
    answer,
    elements_through,
    options,
    question,
    sectors_of,
)
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import (
    COARSER,
    FRESH,
    MAGNITUDE,
    SHEET,
    SOLID,
    Gate,
    Progress,
    Quantity,
    Result,
)
from flexfem.units import DENSITY, DIRECTIONS, FORCES, LENGTH, POSES, UNITS

Drives: TypeAlias = Literal["disengaged", "engaged"]
ALL_BASES = (*DIRECTIONS, *LIFTED)
KINDS = ("in plane", "out of plane")
SOLID_RESOLUTION = 4  # triangles across every neck in three dimensions
MOST = 100
MOST_SOLID = 40  # modes
MOST_DAMPING = 99.0  # % of critical
LARGEST_PAYLOAD = (1e4, 1e10)  # kg, kg mm^2; no stage with necks carries a hundredth of it
ROUND_OFF = 1e-9  # of a frequency
AGREED = 0.1  # relative difference up to which the observed order agrees with the theoretical one
# least overlap of identical shapes: any rotation within a pair of equal frequency keeps as much
SAME_SHAPE = 0.7
# relative difference of frequencies of modes that symmetry makes equal, on a mesh without symmetry
EQUAL = 1e-4
# motion of the output in a mode, relative to the largest of all modes, that counts as none
STILL = 1e-3
# relative difference of frequencies of one mode by the network of parts and by finite elements
ALIKE = 0.05
RIGID_MODES = 3  # modes of the platform on its hinges; in higher ones links swing and bend
ABOVE_THIRD = (
    "analytic frequencies above the third are not reliable: links swing and bend in these modes. "
    "On 40 random stages with disengaged drives, they were 0.8 to 28 % too low with elastic "
    "links (half of them by more than 10 %), and 5 to 163 % too high with rigid links and "
    "calibrated hinges. The error of the first three was at most 0.11 % with elastic and 3.4 % "
    "with rigid links"
)
OUT_OF_PLANE = (
    "modes in which the platform leaves the plane are not computed; the lowest of them can be "
    "below these modes"
)
NO_STACKS = (
    "engaged stacks are springs that hold their strokes; the mass of the stacks is neglected"
)
AT_ITS_PLACE = (
    "payload: its centre of mass is at the platform's centre, in the mid-plane; a payload above "
    "the mid-plane couples motion in and out of the plane, which is neglected"
)
LIFTED_GATE = Gate(COARSER.relative, MAGNITUDE)
MOTION = Gate(1e-3, absolute=1e-4)
KILOGRAM = UNITS["kg"].factor
INERTIA = UNITS["kg_mm2"].factor


class NaturalModes(Result):
    """Natural frequencies, effective modal masses and the masses that vibrate."""

    title = "natural modes"
    main = ("frequency", {})
    columns: ClassVar[tuple[str, ...]] = ("model", "base")
    figure = "modes.figures"
    drawn_from_fields = True
    reading: ClassVar[tuple[str, ...]] = (
        "effective modal mass: share of the whole mass or moment of inertia, for a motion of the "
        "base",
    )
    frequency = Quantity("natural frequency", "hz", ("mode", "model"), Gate(FRESH.relative, 0.2))
    share = Quantity(
        "effective modal mass", "percent", ("mode", "base"), Gate(1e-3, absolute=1e-6), "all"
    )
    band_plane = Quantity(
        "band by the mesh in the plane", "hz", ("mode",), Gate(0.2), shown=False, only="stage"
    )
    band_thickness = Quantity(
        "band by the layers", "hz", ("mode",), Gate(0.2), shown=False, only="stage"
    )
    mass = Quantity("mass, including pads, hub and payload", "kg", only="stage")
    inertia = Quantity("moment of inertia about the platform's centre", "kg_mm2", only="stage")
    tilting_inertia = Quantity(
        "moments of inertia about x and y", "kg_mm2", ("tilt",), FRESH, only="stage"
    )
    meshed_mass = Quantity(
        "mass by the finite elements", "kg", gate=FRESH, shown=False, only="stage"
    )
    hub_mass = Quantity("mass of the hub", "kg", only="stage")
    first_out_of_plane = Quantity(
        "first natural frequency out of the plane",
        "hz",
        gate=Gate(FRESH.relative, 0.2),
        uneven=LIFTED_GATE,
    )
    labels: ClassVar = {"base": DIRECTIONS, "tilt": ("x", "y")}


class MechanismModes(NaturalModes, mechanism=True):
    """Natural frequencies of a mechanism with payload and actuators, and the motion of its output
    in every mode.
    """

    columns = ("model", "direction", "motion")
    figure = ""
    reading = (
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
    share = Quantity(
        "motion of the output by finite elements",
        "percents",
        ("mode", "direction"),
        MOTION,
        "all",
        uneven=MOTION,
    )
    tilt = Quantity(
        "motion of the output out of the plane",
        "percents",
        ("mode", "motion"),
        MOTION,
        "all",
        uneven=MOTION,
    )
    labels: ClassVar = {"motion": LIFTED}


class Channels(NamedTuple):
    """Names and units of inputs or outputs."""

    names: tuple[str, ...]
    units: tuple[str, ...]


OUTPUTS = Channels(tuple(f"pose {name}" for name in DIRECTIONS), tuple(map(str, POSES)))


class StateSpace(NamedTuple):
    """`s' = A s + B u`, `y = C s + D u`, s: modal displacements and rates; D is the static part of
    omitted modes.
    """

    A: Array
    B: Array
    C: Array
    D: Array


class CraigBampton(NamedTuple):
    """`M q'' + K q = L u` of pose x, y, theta and k modes with the platform held: (3 + k, 3 + k),
    (3 + k, inputs).
    """

    stiffness: Array
    mass: Array
    loads: Array


@brief
class DynamicModel(NamedTuple):
    """Response of the platform's pose to loads on it and commands of an engaged drive, in mm, N,
    tonne, s and rad.

    frequencies : (k,), rad/s.   drive, read : (k, inputs) and (3, k), shapes at the inputs and of
    the pose.
    residual : (3, inputs), static part of omitted modes.   damping : of every mode, over critical;
    assumed."""

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
        """The model in state space."""
        k = len(self.frequencies)
        n = self.drive.shape[1]
        rates = np.hstack(
            [-np.diag(self.frequencies**2), -np.diag(2 * self.damping * self.frequencies)]
        )
        A = np.vstack([np.eye(k, 2 * k, k), rates])
        C = np.hstack([self.read, np.zeros((3, k))])
        return StateSpace(A, np.vstack([np.zeros((k, n)), self.drive]), C, self.residual)

    @property
    def truncation(self) -> Array:
        """Relative error (k,), per cent, of the lowest frequencies of the Craig-Bampton matrices,
        positive above.
        """
        from scipy.linalg import eigh

        squares = eigh(self.craig_bampton.stiffness, self.craig_bampton.mass, eigvals_only=True)
        return np.asarray(100 * (np.sqrt(squares[: len(self.frequencies)]) / self.frequencies - 1))

    @property
    def truncation_note(self) -> str:
        """The `truncation` in a sentence."""
        above = self.truncation
        kept = counted(len(self.frequencies), "mode", "modes")
        return (
            f"K_cb and M_cb are truncated to {kept} with the platform held: as many of their "
            f"lowest frequencies are {max(above.min(), 0.0):.2g} to {above.max():.2g} % above "
            "those of the full model"
        )

    def response(self, frequencies: Array) -> Any:
        """Return the complex response (f, 3, inputs), pose per input, at frequencies (f,), rad/s."""
        w = np.asarray(frequencies, dtype=float)[:, None]
        natural = self.frequencies
        gain = 1 / (natural**2 - w**2 + 2j * self.damping * natural * w)
        return np.einsum("ok,fk,ki->foi", self.read, gain, self.drive) + self.residual

    def arrays(self) -> dict[str, Any]:
        """Return all arrays for a file by name, with names and units of inputs and outputs."""
        matrices = self.state_space._asdict() | dict(
            zip(("K_cb", "M_cb", "L_cb"), self.craig_bampton, strict=True)
        )
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
        return matrices | {name: np.array(value) for name, value in others.items()}

    def write(self, path: Path) -> None:
        """Write `arrays` to a file of extension .npz or .mat (MATLAB). Raises BadInput for another
        extension.
        """
        if path.suffix not in (".npz", ".mat"):
            raise BadInput(f"{path}: extension {path.suffix!r}, expected .npz or .mat")
        arrays = self.arrays()
        if path.suffix == ".npz":
            write_atomically(path, lambda file: np.savez(file, **arrays))
            return
        from scipy.io import savemat

        texts = {
            name for name, value in arrays.items() if value.ndim and value.dtype.kind == "U"
        }  # cells of MATLAB
        with replacing(path) as temporary:
            savemat(
                temporary,
                arrays | {name: arrays[name].astype(object) for name in texts},
                oned_as="column",
            )


class Vibration(NamedTuple):
    """Mode shapes of unit modal mass on the finest mesh.

    shapes : (k, n, 2), or in three dimensions (k, n, m, 3) from face to face at `heights` (m,), mm.
    tilting : (k,), True if the platform leaves the plane.   reduced : in the plane.
    """

    mesh: StageMesh
    shapes: Array
    tilting: list[bool]
    heights: Array | None = None
    reduced: DynamicModel | None = None

    def write(self, path: Path) -> list[Path]:
        """Write the shapes as VTU, and matrices of the reduced dynamics as .npz and .mat; returns
        the paths.
        """
        paths = [path.with_suffix(suffix) for suffix in (".vtu", ".npz", ".mat")]
        fields = {f"mode {k}": field for k, field in enumerate(self.shapes, start=1)}
        write_vtu(self.mesh, paths[0], fields, self.heights)
        if self.reduced is None:
            return paths[:1]
        for file in paths[1:]:
            self.reduced.write(file)
        return paths


@options(not_for="payload tilting damping", only_for="plane force force_at")
def modes(
    stage: Mechanism,
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
) -> NaturalModes:
    """Natural frequencies and modes of a stage or mechanism with a payload, in the plane or in
    three dimensions.

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
    NaturalModes
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        natural_modes` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.modes(flexfem.load("geometry/mobility6.toml"), count=3, models="elements", resolution=4)
    >>> found.frequency[:, 0].round()  # Hz
    array([131., 131., 194.])
    """
    layers = elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(stage, models, resolution, layers, usual_solid=SOLID_RESOLUTION)
    if isinstance(stage, MechanismFile):
        load = preloaded.preload_of(stage, stated_load(stage.layout, force, force_at))
        return _of_mechanism(
            stage, arguments.integer("count", count, MOST), drives, mesh, models, progress, load
        )
    count = arguments.integer("count", count, MOST_SOLID if solid else MOST)
    carried = _payload(payload, tilting, solid)
    ratio = arguments.positive("damping", damping, MOST_DAMPING) / 100
    drive = None
    if drives == "engaged":
        if solid:
            raise BadInput(
                "drives 'engaged' with solid, expected disengaged: stacks act in the plane"
            )
        drive = drive_of(stage)
    warnings = [*warning.of_stage(stage), *warning.of_payload(stage, carried.mass)]
    notes = list[str]()
    mass_matrix = bodies.drawn_inertia(stage) + carried.matrix
    values = {
        "mass": mass_matrix[0, 0],
        "inertia": mass_matrix[2, 2],
        "hub_mass": bodies.hub_moments(stage)[0] * bodies.mass_per_area(stage),
    }
    found = dict[str, ModelAnswer]()
    if models != "elements":
        found = {
            name: ModelAnswer({"frequency": w})
            for name, w in _analytic(stage, carried, drive, warnings).items()
        }
        warnings += [ABOVE_THIRD] * (count > RIGID_MODES)
    axes: dict[str, Sequence[str]] = {"mode": [str(k + 1) for k in range(count)]}
    fields: Vibration | None = None
    if mesh is not None:
        elements, extra, fields = _by_elements(stage, carried, drive, count, mesh, ratio, progress)
        found = found | elements
        values = values | extra
        if fields.reduced is not None:
            notes = [fields.reduced.truncation_note]
            warnings += [
                *warning.of_thickness(stage),
                OUT_OF_PLANE,
                *[NO_STACKS] * (drive is not None),
            ]
        else:
            axes = {
                "mode": [f"{k} {KINDS[out]}" for k, out in enumerate(fields.tilting, start=1)],
                "base": ALL_BASES,
            }
            warnings += [*warning.held_faces(stage), *[AT_ITS_PLACE] * any(carried)]
    results = _sorted(found, _order(found, count), count)
    payload_text = (
        f"{carried.mass * KILOGRAM:g} kg, {carried.inertia * INERTIA:g} kg mm^2"
        if any(carried)
        else None
    )
    settings = {"drives": drives, "payload": payload_text}
    return answer(
        NaturalModes,
        about(stage, drive=drive is not None),
        results,
        mesh,
        settings,
        values,
        axes,
        warnings=warnings,
        notes=notes,
        fields=fields,
    )


def _of_mechanism(
    mechanism: Mechanism,
    count: int,
    drives: Drives,
    mesh: Mesh | None,
    models: Models,
    progress: Progress | None,
    load: Array | None,
) -> NaturalModes:
    """Return the modes at rest, or about the equilibrium under a load (k,) on the ports and
    residual stress.
    """
    layout = mechanism.layout
    engaged = drives == "engaged"
    if engaged and not layout.actuators:
        raise BadInput(f"{mechanism.origin}: drives 'engaged', expected at least one [[actuator]]")
    shapes = list[ModesOfStructure]()  # of the last, which is the finest mesh

    def of_parts(parts: plates.ElasticParts) -> Array:
        if load is not None:
            return beam_modes(layout, load, engaged, parts.hinges)
        return network_modes(layout, parts.bodies, engaged, parts.hinges)

    def of_network(elastic: bool) -> dict[str, Array]:
        if load is not None:
            return {"frequency": np.array([]) if elastic else of_parts(plates.ElasticParts())}
        return {"frequency": of_parts(plates.joined_parts(mechanism, elastic))}

    def of_size(
        resolution: int, layers: int, thick: plates.Thickened | None = None
    ) -> dict[str, Array]:
        """Return frequencies with the ratio by the thickness of hinges, and shares of the output."""
        values = by_mesh(resolution, layers)
        if thick is None:
            return values
        ratios = _by_thickness(values["frequency"], of_parts(thick.plane), of_parts(thick.solid))
        nu = max(material.poissons_ratio for material in layout.materials)
        held = np.sqrt(1 / (1 - nu**2))  # of a leaf that vibrates in plane strain
        alone = 1 + (held - 1) / 2 * (
            thick.share == 1
        )  # between plane strain and plane stress, which one variant has
        return values | {
            "frequency": values["frequency"] * np.where(np.isnan(ratios), alone, ratios)
        }

    @cache
    def by_mesh(resolution: int, layers: int) -> dict[str, Array]:
        """Return frequencies and shares (modes, 3) of the output: in the plane, then with layers
        out of it.
        """
        parts = list[tuple[Array, Array]]()
        for lifting in (False, True)[: 2 if layers else 1]:
            if load is None:
                model = plates.factorised(mechanism, resolution, layers, lifting)
                found = plate_modes(model, count + 1, engaged)
                ports = model.ports
            else:
                found, ports = preloaded.modes_under(
                    mechanism, load, resolution, layers, lifting, count + 1, engaged
                )
            shapes[:] = [found]
            motion = (
                found.shapes.T @ ports[:, :3] * np.where([False, lifting, True], layout.lever, 1.0)
            )
            parts.append((found.frequencies, _shares_of_motion(found.frequencies, motion)))
        frequency, share = (
            np.concatenate([each[:count] for each in part]) for part in zip(*parts, strict=True)
        )
        return {"frequency": frequency, "share": share}

    found = plates.by_models(mechanism, mesh, models, of_network, of_size, progress)
    if load is not None:
        found.pop(ELASTIC, None)
    order = _order(found, count)
    lifted = order >= count
    answers = _sorted(found, order, count)
    names = [str(k + 1) for k in range(count)]
    values = dict[str, Array]()
    fields = None
    if mesh is not None:
        share = list(found.values())[-1].values["share"][order]
        values["share"] = np.where(lifted[:, None], np.nan, share)
        if mesh.layers:
            names = [
                f"{k} {'out of' if out else 'in'} the plane"
                for k, out in enumerate(lifted, start=1)
            ]
            values["tilt"] = np.where(lifted[:, None], share, np.nan)
        else:
            plate = plates.meshed(mechanism, mesh.resolution)
            fields = MeshFields(
                plate, lambda: {f"mode {k + 1}": shapes[0].field(k) for k in range(count)}
            )
    settings: dict[str, str] = {"actuators": drives} if layout.actuators else {}
    bands = dict[str, float]()
    warnings = list[str]()
    notes = list[str]()
    if load is not None:
        settings["preload"] = preloaded.described(mechanism, load)
        notes += [preloaded.IN_THREE_DIMENSIONS] * (SOLID in found)
    if SOLID in found and mesh is not None:
        in_plane = float(found[SOLID].values["frequency"][:count].min())
        try:
            place = count if mesh.layers else None
            if load is not None and place is None:
                first, band = preloaded.first_out_of_plane(mechanism, load)
            else:
                first, band = _first_out_of_plane(mechanism, found[SOLID], place)
        except ComputationFailed as failure:
            warnings.append(f"no frequency out of the plane: {failure}")
        else:
            values["first_out_of_plane"] = np.array(first)
            bands["first_out_of_plane"] = band
            if first < in_plane:
                hertz = UNITS["hz"].factor
                lowest = f"at {hertz * first:.5g} Hz, below {hertz * in_plane:.5g} Hz in the plane"
                warnings.append(f"the lowest natural frequency is out of the plane, {lowest}")
    return answer(
        NaturalModes,
        mechanism,
        answers,
        mesh,
        settings,
        values,
        {"mode": names},
        bands,
        warnings=warnings,
        notes=notes,
        fields=fields,
    )


def _by_thickness(frequencies: Array, plane: Array, solid: Array) -> Array:
    """Return the ratios (modes,) in three dimensions to plane stress of frequencies by finite
    elements.

    plane, solid : frequencies of the network of parts with hinges in plane stress and in three
    dimensions; the ratio
        is that of the nearest mode, and nan without one within `ALIKE`: hinges or bodies vibrate
        alone.
    """
    nearest = np.argmin(np.abs(frequencies[:, None] / plane - 1), axis=1)
    alike = np.abs(frequencies / plane[nearest] - 1) < ALIKE
    return np.where(alike, (solid / plane)[nearest], np.nan)


def _first_out_of_plane(
    mechanism: Mechanism, found: ModelAnswer, place: int | None
) -> tuple[float, float]:
    """Return the first natural frequency out of the plane, rad/s, and its band.

    place : of this frequency in the values of a whole plate in three dimensions, None where they
    are in the plane. Raises ComputationFailed for too many unknowns."""
    if place is not None:
        return float(found.values["frequency"][place]), float(found.bands["frequency"][place])
    lifted = plates.lifted(mechanism)
    return lifted.frequency, lifted.frequency_band


def _shares_of_motion(frequencies: Array, motion: Array) -> Array:
    """Return the shares (modes, 3), %, of directions in squared motions (modes, 3) of the output;
    nan without motion.

    Modes of equal frequency are combined to those of which the first alone moves along x, or else
    along y."""
    motion = motion.copy()
    starts = np.flatnonzero(np.diff(frequencies) > EQUAL * frequencies[1:]) + 1
    for group in np.split(motion, starts):
        sizes = np.linalg.norm(group, axis=0)
        order = np.argsort(sizes < STILL * sizes.max(), kind="stable")
        group[:, order] = np.linalg.qr(group[:, order], mode="complete")[1]
    squares = motion**2
    whole = squares.sum(axis=1, keepdims=True)
    return 100 * squares / np.where(whole > STILL**2 * whole.max(), whole, np.nan)


@question
def dynamic_model(
    stage: Stage,
    count: int = 12,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    damping: float = 1.0,
    resolution: int | None = None,
) -> DynamicModel:
    """Frequency response, state space and Craig-Bampton matrices of the platform under loads and
    strokes.

    Parameters
    ----------
    stage : Stage
        The stage.
    count : int
        Number of modes that are kept; the static part of the others is added.
    payload, drives, damping
        See `modes`.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.

    Returns
    -------
    DynamicModel

    Raises
    ------
    BadInput
        The stage cannot be made, or an option or a file is not valid.
    ComputationFailed
        The stage is singular, or a mesh or a solution does not pass its checks.

    Notes
    -----
    R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313. Shapes and units of all matrices:
    `DynamicModel`."""
    found = modes(
        stage,
        count=count,
        payload=payload,
        drives=drives,
        damping=damping,
        models="elements",
        resolution=resolution,
    )
    reduced: DynamicModel = found.fields.reduced
    return reduced


def _payload(payload: tuple[float, float], tilting: float | None, solid: bool) -> Payload:
    """Return the payload in internal units. Raises BadInput."""
    expected = "mass (kg) and moment of inertia (kg mm^2)"
    mass, inertia = arguments.pair("payload", payload, LARGEST_PAYLOAD, expected)
    if tilting is not None and not solid:
        raise BadInput("tilting without solid, expected both: modes are in the plane")
    reason = " kg mm^2: a flat body has the least, half of its moment of inertia about the normal"
    least = inertia / 2
    most = LARGEST_PAYLOAD[1]
    tilting_inertia = (
        least if tilting is None else arguments.between("tilting", tilting, least, most, reason)
    )
    return payload_of(mass, inertia, tilting_inertia)


def payload_of(mass: float, inertia: float, tilting: float = 0.0) -> Payload:
    """Return a payload from its mass, kg, and moments of inertia about z and about x and y, kg
    mm^2.
    """
    return Payload(mass / KILOGRAM, inertia / INERTIA, tilting / INERTIA)


def _order(found: Mapping[str, ModelAnswer], count: int) -> Index:
    """Return which modes are the lowest (count,): in three dimensions those from `count` are out of
    the plane.
    """
    if SOLID not in found:
        return np.arange(count)
    return np.argsort(found[SOLID].values["frequency"], kind="stable")[:count]


def _sorted(found: Mapping[str, ModelAnswer], order: Index, count: int) -> dict[str, ModelAnswer]:
    """Return the frequencies in an order; models of the plane have none out of it."""
    planar = np.flatnonzero(order < count)

    def placed(label: str, part: Mapping[str, Array]) -> dict[str, Array]:
        """Place frequencies, in order, at their modes; freedoms without a frequency have nan."""
        if "frequency" not in part or label == SOLID:
            return {name: part[name][order] for name in part if name == "frequency"}
        column = np.full(count, np.nan)
        kept = part["frequency"][: len(planar)]
        column[planar[: len(kept)]] = np.where(np.isfinite(kept), kept, np.nan)
        return {"frequency": column}

    return {
        label: ModelAnswer(*(placed(label, part) for part in one)) for label, one in found.items()
    }


def _analytic(
    stage: Stage, payload: Payload, drive: ActuatorSet | None, warnings: list[str]
) -> dict[str, Array]:
    """Return frequencies (21,), rad/s, by the stage's rigid model, the best of its plane problem,
    and the best of all.

    Freedoms that a model lacks have inf. Reasons for replacing a model are added to `warnings`.
    """
    best = best_model(stage, warnings)
    frequencies = {}
    for choice in (
        ModelChoice(stage, None, DEFAULT_FORMULA, False),
        best._replace(stage=stage),
        best,
    ):
        if choice.name in frequencies:
            continue
        model = dynamics(
            choice.stage, analyse(*choice), payload, *(() if drive is None else (drive.stacks,))
        )
        if drive is not None:
            model = model._replace(compliance=with_springs(model.compliance, drive.stiffness))
        frequencies[choice.name] = model.frequencies
    return frequencies


def vibrating(
    stage: Stage, mesh: StageMesh, payload: Payload, drive: ActuatorSet | None = None
) -> VibratingStructure:
    """Return the vibrating stage on one mesh, with an engaged drive or none. Raises BadInput unless
    it is plane.
    """
    plate = structure(mesh, plate_of(stage))
    loads = None
    springs = None
    if drive is not None:
        loads = stack_loads(plate, drive.stacks)[:, 3:]
        springs = drive.stiffness
    mass = mass_of(plate, stage.material.density * DENSITY, bodies.carried(stage, payload))
    return vibrating_structure(mass, loads, springs)


def _shares(solution: ModesOfStructure) -> Array:
    """Return effective modal masses (k, 3), % of the total mass or moment of inertia."""
    return 100 * solution.participation**2 / np.diag(solution.total)


def _by_elements(
    stage: Stage,
    payload: Payload,
    drive: ActuatorSet | None,
    count: int,
    mesh: Mesh,
    damping: float,
    progress: Progress | None,
) -> tuple[dict[str, ModelAnswer], dict[str, Any], Vibration]:
    """Return frequencies, with layers in the plane and then out of it, values without an axis of
    models, and fields.
    """
    carried = bodies.carried(stage, payload), bodies.carried_out_of_plane(stage, payload)
    plate = sheet_of(stage)
    density = stage.material.density * DENSITY
    last = list[ModesOfStructure]()
    vibrated = list[VibratingStructure]()
    extra = dict[str, Any]()

    def of_size(resolution: int, layers: int) -> dict[str, Array]:
        if layers:
            last[:] = [
                stage_modes(
                    sectors_of(stage, resolution),
                    plate,
                    layers_of(stage, layers, out),
                    density,
                    carried[out],
                    count,
                )
                for out in (False, True)
            ]
        else:
            vibrated[:] = [vibrating(stage, build_mesh(stage, resolution), payload, drive)]
            last[:] = [modes_of(vibrated[0], count)]
        return {"frequency": np.concatenate([each.frequencies for each in last])}

    def bands(
        sizes: Array, each: list[plates.Values], ends: Sequence[plates.Values]
    ) -> dict[str, Array]:
        by_mesh = np.array([one["frequency"] for one in each])
        plane = np.array([frequency_convergence(sizes, values).band for values in by_mesh.T])
        if not ends:
            return {"frequency": plane}
        few, many = (one["frequency"] for one in ends)
        finest = np.concatenate([each.frequencies for each in last])
        extra["band_plane"] = (
            finest * plane / by_mesh[-1]
        )  # bands relative to the frequencies on these meshes
        extra["band_thickness"] = finest * SAFETY * np.abs(many - few) / many
        return {"frequency": extra["band_plane"] + extra["band_thickness"]}

    found = plates.by_elements(mesh, of_size, progress, bands, whole=True)
    if not mesh.layers:
        (finest,) = last
        (body,) = vibrated
        shapes = np.array([finest.field(k) for k in range(count)])
        reduced = _reduce(body, finest, damping, drive)
        values = {"share": _shares(finest), "meshed_mass": finest.total[0, 0]}
        return found, values, Vibration(body.structure.mesh, shapes, [False] * count, None, reduced)
    planar, tilting = last
    order = _order(found, count)
    shares = np.zeros((2 * count, len(ALL_BASES)))
    lifted = order >= count
    shares[:count, :3], shares[count:, 3:] = _shares(planar), _shares(tilting)
    values = {name: part[order] for name, part in (extra | {"share": shares}).items()} | {
        "tilting_inertia": np.diag(tilting.total)[1:],
        "meshed_mass": planar.total[0, 0],
        "first_out_of_plane": tilting.frequencies[0],
    }
    sheet = {SHEET: ModelAnswer({"frequency": _in_plane_stress(stage, planar, carried[0], count)})}
    half = planar.layers.heights
    mirror = np.where(lifted[:, None], -1.0, 1.0) * [1.0, 1.0, -1.0]  # of u, v, w
    upper = np.array([last[int(k >= count)].field(k % count) for k in order])
    lower = mirror[:, None, None] * upper[:, :, :0:-1]
    shapes = np.concatenate([lower, upper], axis=2)
    heights = np.concatenate([-half[:0:-1], half])
    return sheet | found, values, Vibration(planar.mesh, shapes, lifted.tolist(), heights)


def _in_plane_stress(stage: Stage, solid: ModesOfStructure, carried: Array, count: int) -> Array:
    """Return frequencies (k,) in plane stress on the same mesh of the modes shaped like the
    mid-plane, or nan.
    """
    mass = mass_of(
        structure(solid.mesh, sheet_of(stage)), stage.material.density * DENSITY, carried
    )
    sheet = vibrating_structure(mass)
    modes = modes_of(sheet, count)
    fields = np.transpose(
        [solid.field(k)[sheet.structure.free, 0, :2].ravel() for k in range(count)]
    )
    mid_plane = np.vstack([fields, solid.shapes[-3:]])
    inertia = sheet.mass.loads(mid_plane)
    overlap = np.abs(modes.shapes.T @ inertia) / np.sqrt(np.sum(mid_plane * inertia, axis=0))
    return np.where(
        np.max(overlap, axis=0) > SAME_SHAPE, modes.frequencies[np.argmax(overlap, axis=0)], np.nan
    )


def frequency_convergence(resolutions: Array, values: Array) -> Convergence:
    """Return the grid convergence of a frequency; the band is wider unless the observed order is
    the theoretical one.

    Notes
    -----
    Necks converge with order four, free re-entrant corners of links with little more than one (1.09
    at a right angle, twice the exponent of the displacement: M. L. Williams, J. Appl. Mech. 19
    (1952) 526, recalled). Above the third mode, where links bend, corners dominate on finer meshes,
    and the order observed on coarse meshes is too high. The band is therefore at least `1.25 |e21|
    / (r21 - 1)`, with order one of a crack, the lowest of any corner, and at least `3 |e21| /
    (r21^p - 1)` with the lesser p of the orders, W. L. Oberkampf, C. J. Roy, Verification and
    Validation in Scientific Computing (2010), section 8.6 (recalled). If steps do not converge, the
    larger one is used."""
    convergence = grid_convergence(resolutions, values, round_off=ROUND_OFF)
    converging = convergence.verdict == "converging"
    if convergence.verdict == "round-off" or (
        converging and abs(convergence.observed / ORDER - 1) <= AGREED
    ):
        return convergence
    steps = np.abs(np.diff(values[-3:]))
    step = steps[-1] if converging else steps.max()
    ratio = resolutions[-1] / resolutions[-2]
    order = min(convergence.order, ORDER)
    factor = max(CAUTIOUS / (ratio**order - 1), SAFETY / (ratio - 1))
    return convergence._replace(band=max(convergence.band, factor * float(step)))


def _reduce(
    body: VibratingStructure, modes: ModesOfStructure, ratio: float, drive: ActuatorSet | None
) -> DynamicModel:
    """Return the dynamics of a structure by some of its modes; inputs include the commands of an
    engaged drive.
    """
    size = body.structure.size
    loads = np.eye(size, 3, 3 - size)
    names = [f"load {name}" for name in DIRECTIONS]
    units = list(map(str, FORCES))
    if drive is not None:
        loads = np.hstack(
            [loads, body.stack_loads @ (body.stack_stiffness[:, None] * drive.differential)]
        )
        names += [f"stroke {name}" for name in drive.names]
        units += [str(LENGTH)] * len(drive.names)
    at_rest = body.space.solve(loads)
    shapes = modes.shapes
    drives = shapes.T @ loads
    poses = shapes[-3:]
    residual = at_rest[-3:] - (poses / modes.frequencies**2) @ drives
    reduced = _craig_bampton(body, at_rest[:, :3], loads, len(modes.frequencies))
    inputs = Channels(tuple(names), tuple(units))
    return DynamicModel(modes.frequencies, drives, poses, residual, ratio, inputs, reduced)


def _craig_bampton(
    body: VibratingStructure, static: Array, loads: Array, count: int
) -> CraigBampton:
    """Reduce to the pose and `count` modes with the platform held; static (m, 3): solution under
    unit loads on it.

    Notes
    -----
    With `X = K^-1 E` the constraint modes are `X (E' X)^-1`; the inverse of the stiffness with the
    platform held is `K^-1 - X (E' X)^-1 X'`. R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313.
    """
    from scipy.sparse.linalg import LinearOperator

    K_pose = np.linalg.inv((static[-3:] + static[-3:].T) / 2)
    size = len(static) - 3

    def held(b: Array) -> Array:
        load = np.pad(b, ((0, 3), (0, 0)))
        return np.asarray((body.space.solve(load) - static @ (K_pose @ (static.T @ load)))[:-3])

    def inertia(b: Array) -> Array:
        return body.mass.loads(np.pad(b.reshape(size, -1), ((0, 3), (0, 0))))[:-3]

    squares, shapes = lowest(held, LinearOperator((size, size), matvec=inertia, dtype=float), count)
    shapes = shapes / np.sqrt(np.einsum("ik,ik->k", shapes, inertia(shapes)))
    T = np.hstack([static @ K_pose, np.pad(shapes, ((0, 3), (0, 0)))])
    T[-3:] = np.eye(3, 3 + count)
    K = np.zeros((3 + count, 3 + count))
    K[:3, :3], K[3:, 3:] = K_pose, np.diag(squares)
    return CraigBampton(K, T.T @ body.mass.loads(T), T.T @ loads)
