"""Vibration of a stage: frequencies by the analytic models, and modes by finite elements in the
plane and in three dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.analytic.network import Dynamics, with_springs
from flexfem.arrays import Array, Index
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import BODIES_OF_SECTOR, SECTORS, PlaneMesh
from flexfem.fem.modes import Modes, VibratingStructure, sector_modes, vibrating_structure
from flexfem.fem.modes import modes as modes_of
from flexfem.fem.structure import mass_of, structure
from flexfem.mechanism.layout import ActuatorSet, Payload
from flexfem.paper import answers, bodies
from flexfem.paper.contacts import LINKS, PLATFORM
from flexfem.paper.fields import stack_loads
from flexfem.paper.model import DEFAULT_FORMULA, ModelChoice, analyse, best_model
from flexfem.paper.reduced import DynamicModel, reduced_model
from flexfem.paper.responses import MOVING, dynamics
from flexfem.paper.solutions import sectors_of
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import build_mesh, layers_of, plate_of, sheet_of
from flexfem.questions.bands import CAUTIOUS, ORDER, SAFETY, Convergence, grid_convergence
from flexfem.questions.mode_order import likeness, lowest_modes
from flexfem.questions.mode_shapes import motions_of_parts, rigid_fields, what_moves
from flexfem.questions.plates import Values
from flexfem.questions.setup import Mesh, ModelAnswer
from flexfem.results import SHEET, Progress
from flexfem.units import DENSITY, UNITS

ROUND_OFF = 1e-9  # of a frequency
AGREED = 0.1  # relative difference up to which the observed order agrees with the theoretical one
# least overlap of identical shapes: any rotation within a pair of equal frequency keeps as much
SAME_SHAPE = 0.7
# moving bodies in the order of `dynamics`, with the numbers of their triangles
TRIANGLES = (
    tuple(BODIES_OF_SECTOR * sector + PLATFORM for sector in range(SECTORS)),
    *((BODIES_OF_SECTOR * sector + link,) for sector in range(SECTORS) for link in LINKS),
)
NAMES = (
    "platform (output)",
    *(f"link {link} of chain {sector + 1}" for sector in range(SECTORS) for link in LINKS),
)
KILOGRAM = UNITS["kg"].factor
INERTIA = UNITS["kg_mm2"].factor


class Vibration(NamedTuple):
    """Mode shapes of unit modal mass on the finest mesh.

    shapes : (k, n, 2), or in three dimensions (k, n, m, 3) from face to face at `heights` (m,), mm.
    tilting : (k,), True if the platform leaves the plane.   reduced : in the plane.
    """

    mesh: PlaneMesh
    shapes: Array
    tilting: list[bool]
    heights: Array | None = None
    reduced: DynamicModel | None = None

    @property
    def at_mid_plane(self) -> Array:
        """Displacements (k, n, 2), or of the mid-plane (k, n, 3), in all modes."""
        if self.heights is None:
            return self.shapes
        return np.asarray(self.shapes[:, :, len(self.heights) // 2])

    def likeness(self, of_model: Dynamics) -> Array:
        """Return the likeness (m, k) of modes of an analytic model and those in the plane."""
        motions = of_model.modes.motions
        twists = motions.reshape(MOVING, 3, motions.shape[1])
        planar = self.at_mid_plane[np.logical_not(self.tilting)]
        return likeness(self.mesh, rigid_fields(self.mesh, TRIANGLES, twists), planar)

    @property
    def words(self) -> list[str]:
        """What moves in every mode."""
        return [
            what_moves(motions_of_parts(self.mesh, TRIANGLES, NAMES, field))
            for field in self.at_mid_plane
        ]

    def write(self, path: Path) -> list[Path]:
        """Write the shapes as VTU, and matrices of the reduced dynamics as .npz and .mat; returns
        the paths.
        """
        paths = [path.with_suffix(suffix) for suffix in (".vtu", ".npz", ".mat")]
        self.write_vtu(paths[0])
        if self.reduced is None:
            return paths[:1]
        for file in paths[1:]:
            self.reduced.write(file)
        return paths

    def write_vtu(self, path: Path) -> None:
        """Write the shapes to this file as VTU."""
        fields = {f"mode {k}": field for k, field in enumerate(self.shapes, start=1)}
        write_vtu(self.mesh, path, fields, self.heights)


class Found(NamedTuple):
    """Frequencies by model, values that are of no model, and the modes on the finest mesh."""

    models: dict[str, ModelAnswer]
    values: dict[str, Any]
    vibration: Vibration


class VibratingStage(NamedTuple):
    """A stage with a payload and an engaged drive or none, and the number of its modes."""

    stage: Stage
    payload: Payload
    drive: ActuatorSet | None
    most: int

    @property
    def density(self) -> float:
        """Density of the material, tonne/mm^3."""
        return self.stage.material.density * DENSITY


def payload_of(
    mass: float,
    inertia: float,
    tilting: float = 0.0,
) -> Payload:
    """Return a payload from its mass, kg, and moments of inertia about z and about x and y, kg
    mm^2.
    """
    return Payload(mass / KILOGRAM, inertia / INERTIA, tilting / INERTIA)


def analytic_dynamics(asked: VibratingStage, warnings: list[str]) -> dict[str, Dynamics]:
    """Return the dynamics by the stage's rigid model, the best of its plane problem, and the best
    of all.

    Freedoms that a model lacks have infinite frequencies. Reasons for replacing a model are added
    to `warnings`.
    """
    stage = asked.stage
    best = best_model(stage, warnings)
    rigid = ModelChoice(stage, None, DEFAULT_FORMULA, False)
    found = dict[str, Dynamics]()
    for choice in (rigid, best._replace(stage=stage), best):
        if choice.name not in found:
            found[choice.name] = _dynamics_by(choice, asked)
    return found


def _dynamics_by(choice: ModelChoice, asked: VibratingStage) -> Dynamics:
    """Return the dynamics by one analytic model, with an engaged drive or none."""
    at_rest = analyse(*choice)
    if asked.drive is None:
        return dynamics(choice.stage, at_rest, asked.payload)
    model = dynamics(choice.stage, at_rest, asked.payload, asked.drive.stacks)
    driven = with_springs(model.compliance, asked.drive.stiffness)
    return model._replace(compliance=driven)


def vibrating(
    stage: Stage, mesh: PlaneMesh, payload: Payload, drive: ActuatorSet | None = None
) -> VibratingStructure:
    """Return the vibrating stage on one mesh, with an engaged drive or none. Raises BadInput unless
    it is plane.
    """
    plate = structure(mesh, plate_of(stage))
    mass = mass_of(plate, stage.material.density * DENSITY, bodies.carried(stage, payload))
    if drive is None:
        return vibrating_structure(mass)
    return vibrating_structure(mass, stack_loads(plate, drive.stacks)[:, 3:], drive.stiffness)


def _shares(solution: Modes) -> Array:
    """Return effective modal masses (k, 3), % of the total mass or moment of inertia."""
    return 100 * solution.participation**2 / np.diag(solution.total)


def in_plane(
    asked: VibratingStage,
    mesh: Mesh,
    damping: float,
    progress: Progress | None,
) -> Found:
    """Return the modes by plane finite elements, and the dynamics that they reduce to.

    damping : ratio of every mode to the critical one.
    """
    finest = list[tuple[VibratingStructure, Modes]]()

    def by_mesh(resolution: int, _: int) -> Values:
        plate_mesh = build_mesh(asked.stage, resolution)
        body = vibrating(asked.stage, plate_mesh, asked.payload, asked.drive)
        found = modes_of(body, asked.most)
        finest[:] = [(body, found)]
        return {"frequency": found.frequencies}

    def bands(
        sizes: Array,
        each: list[Values],
        _: Sequence[Values],
    ) -> dict[str, Array]:
        return {"frequency": _bands_on_meshes(sizes, each)}

    models = answers.element_values(mesh, by_mesh, progress, bands)
    ((body, found),) = finest
    shapes = np.array([found.field(k) for k in range(asked.most)])
    reduced = reduced_model(body, found, damping, asked.drive)
    values = {"share": _shares(found), "meshed_mass": found.total[0, 0]}
    tilting = [False] * asked.most
    return Found(models, values, Vibration(body.structure.mesh, shapes, tilting, None, reduced))


class Halves(NamedTuple):
    """Modes in the plane and out of it, of which half the thickness is solved."""

    even: Modes
    odd: Modes

    @property
    def frequencies(self) -> Array:
        """Frequencies (2 k,), rad/s, in the plane, then out of it."""
        return np.concatenate([self.even.frequencies, self.odd.frequencies])

    @property
    def shares(self) -> Array:
        """Effective modal masses (2 k, 6), %, of base motions in the plane and out of it."""
        count = len(self.even.frequencies)
        shares = np.zeros((2 * count, 6))
        shares[:count, :3] = _shares(self.even)
        shares[count:, 3:] = _shares(self.odd)
        return shares

    def shapes(self, order: Index) -> Array:
        """Displacements (modes, n, m, 3) of all nodes from face to face, of modes in an order."""
        count = len(self.even.frequencies)
        shapes = list[Array]()
        for number in order:
            half = self.odd if number >= count else self.even
            mirror = np.array([1.0, 1.0, -1.0])  # of u, v, w
            if number >= count:
                mirror = -mirror
            upper = half.field(number % count)
            shapes.append(np.concatenate([mirror * upper[:, :0:-1], upper], axis=1))
        return np.array(shapes)


def in_depth(
    asked: VibratingStage,
    mesh: Mesh,
    progress: Progress | None,
) -> Found:
    """Return the modes by finite elements in three dimensions, in the plane and out of it."""
    finest = list[Halves]()
    parts = dict[str, Array]()

    def by_mesh(resolution: int, layers: int) -> Values:
        finest[:] = [Halves(*(_half(asked, resolution, layers, odd) for odd in (False, True)))]
        return {"frequency": finest[0].frequencies}

    def bands(
        sizes: Array,
        each: list[Values],
        ends: Sequence[Values],
    ) -> dict[str, Array]:
        few, many = (one["frequency"] for one in ends)
        on_meshes = _bands_on_meshes(sizes, each) / each[-1]["frequency"]
        by_layers = SAFETY * np.abs(many - few) / many
        parts["band_plane"] = finest[0].frequencies * on_meshes
        parts["band_thickness"] = finest[0].frequencies * by_layers
        return {"frequency": parts["band_plane"] + parts["band_thickness"]}

    models = answers.element_values(mesh, by_mesh, progress, bands)
    (found,) = finest
    order = lowest_modes(models, asked.most)
    parts["share"] = found.shares
    values = {name: part[order] for name, part in parts.items()} | {
        "tilting_inertia": np.diag(found.odd.total)[1:],
        "meshed_mass": found.even.total[0, 0],
        "first_out_of_plane": found.odd.frequencies[0],
    }
    sheet = ModelAnswer({"frequency": _in_plane_stress(asked, found.even)})
    half = found.even.layers.heights
    heights = np.concatenate([-half[:0:-1], half])
    lifted = (order >= asked.most).tolist()
    vibration = Vibration(found.even.mesh, found.shapes(order), lifted, heights)
    return Found({SHEET: sheet, **models}, values, vibration)


def _half(
    asked: VibratingStage,
    resolution: int,
    layers: int,
    odd: bool,
) -> Modes:
    """Return the modes in the plane, or the `odd` ones out of it."""
    stage = asked.stage
    carried = bodies.carried_out_of_plane if odd else bodies.carried
    return sector_modes(
        sectors_of(stage, resolution),
        sheet_of(stage),
        layers_of(stage, layers, odd),
        asked.density,
        carried(stage, asked.payload),
        asked.most,
    )


def _in_plane_stress(asked: VibratingStage, solid: Modes) -> Array:
    """Return frequencies (k,) in plane stress on the same mesh of the modes shaped like the
    mid-plane, or nan.
    """
    plate = structure(solid.mesh, sheet_of(asked.stage))
    mass = mass_of(plate, asked.density, bodies.carried(asked.stage, asked.payload))
    sheet = vibrating_structure(mass)
    modes = modes_of(sheet, asked.most)
    mid_planes = [solid.field(k)[sheet.structure.free, 0, :2].ravel() for k in range(asked.most)]
    shapes = np.vstack([np.transpose(mid_planes), solid.shapes[-3:]])
    inertia = sheet.mass.loads(shapes)
    overlap = np.abs(modes.shapes.T @ inertia) / np.sqrt(np.sum(shapes * inertia, axis=0))
    alike = np.max(overlap, axis=0) > SAME_SHAPE
    return np.where(alike, modes.frequencies[np.argmax(overlap, axis=0)], np.nan)


def _bands_on_meshes(sizes: Array, each: list[Values]) -> Array:
    """Return the bands of frequencies by their values on three meshes."""
    by_mesh = np.array([one["frequency"] for one in each])
    return np.array([frequency_convergence(sizes, values).band for values in by_mesh.T])


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
