"""Natural frequencies and modes of a stage, with bands by meshes and layers, and the analytic models beside them.

In the plane the stage's own plane problem vibrates, its stacks engaged or not. In three dimensions both faces are free,
whatever plane problem the stage states, and modes out of the plane are found too.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import DEFAULT_FORMULA, ModelChoice, analyse, best_model
from flexfem.analytic.responses import dynamics, engaged
from flexfem.arrays import Array
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import StageMesh, build_mesh, mesh_sectors
from flexfem.fem.modes import Modes as ModesOfStructure
from flexfem.fem.modes import VibratingStructure, stage_modes, vibrating_structure
from flexfem.fem.modes import modes as modes_of
from flexfem.fem.response import stack_loads
from flexfem.fem.structure import layers_of, plate_of, sheet_of, structure
from flexfem.mechanism.bodies import (
    Payload,
    carried,
    carried_out_of_plane,
    drawn_inertia,
    hub_moments,
    mass_per_area,
    payload_matrix,
)
from flexfem.mechanism.drives import drive_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import located
from flexfem.questions import warnings as warning
from flexfem.questions.bands import CAUTIOUS, ORDER, SAFETY, Convergence, coarser, grid_convergence, levels
from flexfem.questions.dynamic_model import DynamicModel, reduced_dynamics
from flexfem.questions.setup import Answered, Models, about, answer, mesh_of, on_meshes, question
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, FRESH, SHEET, SOLID, Gate, Progress, Quantity, Result
from flexfem.units import DENSITY, UNITS

Drives: TypeAlias = Literal["disengaged", "engaged"]
BASES = ("x", "y", "theta")
ALL_BASES = (*BASES, "z", "tilt x", "tilt y")
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
HERTZ, KILOGRAM, INERTIA = UNITS["hz"].factor, UNITS["kg"].factor, UNITS["kg_mm2"].factor


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
    labels: ClassVar = {"base": BASES, "tilt": ("x", "y")}


class PlaneVibration(NamedTuple):
    """Structure and modes on the finest plane mesh."""

    structure: VibratingStructure
    modes: ModesOfStructure
    reduced: DynamicModel

    @property
    def mesh(self) -> StageMesh:
        """The mesh of the stage."""
        return self.modes.mesh

    @property
    def shapes(self) -> Array:
        """Displacements (k, n, 2) of the mesh's nodes in every mode of unit modal mass."""
        return np.array([self.modes.field(k) for k in range(len(self.modes.frequencies))])

    def write(self, path: Path) -> list[Path]:
        """Write the shapes as VTU, and state space and Craig-Bampton matrices as .npz and .mat; returns the paths."""
        paths = [path.with_suffix(ending) for ending in (".vtu", ".npz", ".mat")]
        write_vtu(self.mesh, paths[0], {f"mode {k}": field for k, field in enumerate(self.shapes, start=1)})
        for each in paths[1:]:
            self.reduced.write(each)
        return paths


class SolidVibration(NamedTuple):
    """Modes in the plane and out of it on the finest mesh.

    chosen : of every mode of the result, its kind, 0 or 1, and its number among those of that kind, from 0.
    """

    halves: tuple[ModesOfStructure, ModesOfStructure]
    chosen: list[tuple[int, int]]

    @property
    def mesh(self) -> StageMesh:
        """The whole stage in the plane."""
        return self.halves[0].mesh

    @property
    def heights(self) -> Array:
        """Heights (2 m - 1,), mm, of the nodes of `through`, from face to face."""
        half = self.halves[0].layers.heights
        return np.concatenate([-half[:0:-1], half])

    def field(self, number: int) -> Array:
        """Displacements (n, m, 3) of unit modal mass, from the mid-plane to the face, of a mode of the result, from 0.

        Notes
        -----
        Of modes in the plane u and v are even in z and w is odd; out of the plane u and v are odd and w is even.
        """
        kind, at = self.chosen[number]
        return self.halves[kind].field(at)

    def through(self, number: int) -> Array:
        """As `field`, from face to face (n, 2 m - 1, 3)."""
        half = self.field(number)
        sign = np.array([1.0, 1.0, -1.0]) * (-1.0 if self.chosen[number][0] else 1.0)
        return np.concatenate([sign * half[:, :0:-1], half], axis=1)

    def write(self, path: Path) -> list[Path]:
        """Write the shapes from face to face as VTU; returns the path."""
        path = path.with_suffix(".vtu")
        shapes = {f"mode {k + 1}": self.through(k) for k in range(len(self.chosen))}
        write_vtu(self.mesh, path, shapes, self.heights)
        return [path]


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
    in_depth = layers is not None
    if in_depth and models != "analytic" and resolution is None:
        resolution = SOLID_RESOLUTION
    mesh = mesh_of(models, resolution, layers)
    count = arguments.integer("count", count, MOST_SOLID if in_depth else MOST)
    load = _payload(payload, tilting, in_depth)
    ratio = arguments.positive("damping", damping, MOST_DAMPING) / 100
    if drives not in ("disengaged", "engaged"):
        raise BadInput(f"drives {drives!r}, expected disengaged or engaged")
    if drives == "engaged" and in_depth:
        raise BadInput("drives 'engaged' with layers, expected disengaged: stacks are of the plane")
    if drives == "engaged" and not stage.actuator:
        with located(stage):
            raise BadInput("no [[actuator]]: the stage has no drive to engage")
    warnings = list(warning.of_stage(stage))
    drawn = drawn_inertia(stage).matrix + payload_matrix(load)
    values = {"mass": drawn[0, 0], "inertia": drawn[2, 2], "hub_mass": hub_moments(stage)[0] * mass_per_area(stage)}
    rigid = {} if models == "elements" else analytic_frequencies(stage, load, drives, warnings)
    warnings += [ABOVE_THIRD] * (bool(rigid) and count > RIGID_MODES)
    elements, places, notes = dict[str, Answered](), list(range(count)), list[str]()
    axes: dict[str, Sequence[str]] = {"mode": [str(k + 1) for k in places]}
    fields: PlaneVibration | SolidVibration | None = None
    if mesh is not None and mesh.layers:
        elements, others, solid = _in_three_dimensions(stage, load, count, mesh.resolution, mesh.layers, progress)
        fields, values = solid, values | others
        places = [k for k, (kind, _) in enumerate(solid.chosen) if kind == 0]  # analytic models are plane
        axes = {"mode": [f"{k + 1} {KINDS[kind]}" for k, (kind, _) in enumerate(solid.chosen)], "base": ALL_BASES}
        warnings += [*warning.held_faces(stage), *([AT_ITS_PLACE] if any(load) else [])]
    elif mesh is not None:
        elements, others, plane = _in_plane(stage, load, drives, count, mesh.resolution, ratio, progress)
        fields, values, notes = plane, values | others, [plane.reduced.truncation_note]
        warnings += [*warning.of_thickness(stage), OUT_OF_PLANE, *[NO_STACKS] * (drives == "engaged")]
    found = {name: Answered({"frequency": _placed(each, places, count)}, {}) for name, each in rigid.items()} | elements
    said = f"{load.mass * KILOGRAM:g} kg, {load.inertia * INERTIA:g} kg mm^2" if any(load) else None
    settings = {"drives": drives, "payload": said}
    of = about(stage, drive=drives == "engaged")
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
    assert isinstance(found.fields, PlaneVibration)
    return found.fields.reduced


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


def _placed(values: Array, places: Sequence[int], count: int) -> Array:
    """The first values at places, nan elsewhere, where there are fewer, and where a model has no such freedom."""
    found = np.full(count, np.nan)
    for place, value in zip(places, values, strict=False):
        found[place] = value if np.isfinite(value) else np.nan
    return found


def analytic_frequencies(stage: Stage, payload: Payload, drives: Drives, warnings: list[str]) -> dict[str, Array]:
    """Natural frequencies (21,), rad/s, by the stage's own rigid model, the best of the same plane, and the best.

    inf for freedoms that a model does not have; why a model is replaced is added to `warnings`.
    """
    best, found = best_model(stage, warnings), {}
    for one in (ModelChoice(stage, None, DEFAULT_FORMULA, False), best._replace(stage=stage), best):
        result = analyse(*one)
        if drives == "engaged":
            drive = drive_of(stage)
            found[one.name] = engaged(dynamics(one.stage, result, payload, drive.stacks), drive.stiffness).frequencies
        else:
            found[one.name] = dynamics(one.stage, result, payload).frequencies
    return found


def vibrating(stage: Stage, mesh: StageMesh, payload: Payload, drives: Drives) -> VibratingStructure:
    """The stage as it vibrates, on one mesh. Raises BadInput for a model that is not plane."""
    of, pushes, rates = structure(mesh, plate_of(stage)), None, None
    if drives == "engaged":
        drive = drive_of(stage)
        pushes, rates = stack_loads(of, drive.stacks)[:, 3:], drive.stiffness
    return vibrating_structure(of, stage.material.density * DENSITY, carried(stage, payload), pushes, rates)


def _in_plane(
    stage: Stage,
    payload: Payload,
    drives: Drives,
    count: int,
    resolution: int,
    damping: float,
    progress: Progress | None,
) -> tuple[dict[str, Answered], dict[str, Any], PlaneVibration]:
    """Modes on the finest of three plane meshes, and what has no axis of models."""

    def solve(level: int) -> tuple[VibratingStructure, ModesOfStructure]:
        of = vibrating(stage, build_mesh(stage, level), payload, drives)
        return of, modes_of(of, count)

    steps = levels(resolution)
    meshes = on_meshes(steps, solve, progress)
    of, found = meshes[-1]
    bands = frequency_bands(steps, [each.frequencies for _, each in meshes])
    reduced = reduced_dynamics(of, found, damping, drive_of(stage) if drives == "engaged" else None)
    values = {"share": 100 * found.participation**2 / np.diag(found.total), "meshed_mass": found.total[0, 0]}
    elements = Answered({"frequency": found.frequencies}, {"frequency": bands})
    return {ELEMENTS: elements}, values, PlaneVibration(of, found, reduced)


def _in_three_dimensions(
    stage: Stage, payload: Payload, count: int, resolution: int, layers: int, progress: Progress | None
) -> tuple[dict[str, Answered], dict[str, Any], SolidVibration]:
    """The lowest modes of both kinds together; bands are shares of the frequency on the meshes that they are from."""
    steps, plate, density = levels(resolution), sheet_of(stage), stage.material.density * DENSITY
    meshes = {level: mesh_sectors(stage, level) for level in steps}
    loads = carried(stage, payload), carried_out_of_plane(stage, payload)

    def half(kind: int) -> tuple[ModesOfStructure, Array, Array]:
        def solve(level: int, number: int) -> ModesOfStructure:
            return stage_modes(meshes[level], plate, layers_of(stage, number, kind == 1), density, loads[kind], count)

        by_mesh, (few, many) = coarser(lambda *sizes: solve(*sizes).frequencies, resolution, layers)
        of = solve(resolution, layers)
        plane = of.frequencies * frequency_bands(steps, by_mesh) / by_mesh[-1]
        return of, plane, of.frequencies * SAFETY * np.abs(many - few) / many

    halves = on_meshes((0, 1), half, progress)
    flat, tilting = halves[0][0], halves[1][0]
    every = np.concatenate([flat.frequencies, tilting.frequencies])
    chosen = [divmod(int(k), count) for k in np.argsort(every, kind="stable")][:count]
    frequency, plane, thickness = np.transpose(
        [(halves[kind][0].frequencies[k], halves[kind][1][k], halves[kind][2][k]) for kind, k in chosen]
    )
    sheet = _in_plane_stress(stage, flat, loads[0], count)
    share = np.zeros((count, len(ALL_BASES)))
    for number, (kind, k) in enumerate(chosen):
        of = halves[kind][0]
        share[number, 3 * kind : 3 * kind + 3] = 100 * of.participation[k] ** 2 / np.diag(of.total)
    values = {
        "share": share,
        "band_plane": plane,
        "band_thickness": thickness,
        "tilting_inertia": np.diag(tilting.total)[1:],
        "meshed_mass": flat.total[0, 0],
        "first_out_of_plane": tilting.frequencies[0],
    }
    models = {
        SHEET: Answered({"frequency": np.array([np.nan if kind else sheet[k] for kind, k in chosen])}, {}),
        SOLID: Answered({"frequency": frequency}, {"frequency": plane + thickness}),
    }
    return models, values, SolidVibration((flat, tilting), chosen)


def _in_plane_stress(stage: Stage, of: ModesOfStructure, load: Array, count: int) -> Array:
    """Frequencies (k,) in plane stress, on the same mesh, of the shapes that the mid-plane has, by overlap; or nan."""
    flat = vibrating_structure(structure(of.mesh, sheet_of(stage)), stage.material.density * DENSITY, load)
    solved = modes_of(flat, count)
    found = np.full(count, np.nan)
    for k in range(count):
        middle = np.concatenate([of.field(k)[flat.structure.free, 0, :2].ravel(), of.shapes[0, -3:, k]])
        moved = flat.inertia(middle[:, None])[:, 0]
        overlap = np.abs(solved.shapes[0].T @ moved) / np.sqrt(middle @ moved)
        best = int(np.argmax(overlap))
        if overlap[best] > SAME_SHAPE:
            found[k] = solved.frequencies[best]
    return found


def frequency_bands(resolutions: Sequence[int], frequencies: Sequence[Array]) -> Array:
    """Bands (k,) of frequencies (k,) on three meshes, coarse to fine."""
    return np.array([frequency_convergence(np.array(resolutions), each).band for each in np.transpose(frequencies)])


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
