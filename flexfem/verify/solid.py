"""The stage in three dimensions, with the band of its mesh in the plane and of its layers, and what is said of it.

The material is the metal's own and both faces are free, whatever plane problem a stage's `model` says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from flexfem.analytic.model import analyse
from flexfem.arrays import Array, inverse
from flexfem.clock import Limit
from flexfem.fem.cyclic import cyclic_response
from flexfem.fem.mesh import TIME_LIMIT
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import plate_of
from flexfem.fem.sectors import mesh_sectors
from flexfem.fem.solid import layers_of, sheet_of
from flexfem.fem.solid_fields import NeckStress, solid_neck_stresses
from flexfem.fem.solid_response import SolidResponse, solid_response
from flexfem.stage.cache import once
from flexfem.stage.feasibility import check_feasible
from flexfem.stage.schema import Stage
from flexfem.verify import warning
from flexfem.verify.answers import UNITS, of_stage
from flexfem.verify.budget import Budget, ThreeDimensional
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.errors import ROUND_OFF, SAFETY, compliance_bands, error_matrix, levels
from flexfem.verify.result import Triple

RESOLUTION = 6  # triangles across every neck: with three layers within 0.1 % (benchmarks/solid.py)
LAYERS = 3  # in half the thickness
MODEL = "three_dimensional"


class SolidReport(NamedTuple):
    """Finite elements in three dimensions at rest and under one load (3,) in the plane.

    layers : in half the thickness.   heights : (layers + 1,), mm, their bounds above the mid-plane.
    stiffness, compliance : (3, 3), of the platform.   band_plane, band_thickness, band : (3, 3), half-widths of the
    uncertainty of the compliance, by the mesh of the plane, by the layers, and their sum.
    plane_stress, plane_strain : compliances (3, 3) of these on the same mesh of the plane: they bound it.
    displacement : (3,), of the platform.   reaction : (3,), of the ground.   energy : N mm.
    neck_stress, neck_height : (3 chains, 3 hinges), largest von Mises stress, MPa, and where: mm from the mid-plane.
    """

    file: str
    name: str
    units: str
    model: str
    resolution: int
    layers: int
    heights: Array
    triangles: int
    unknowns: int
    stiffness: Array
    compliance: Array
    band: Array
    band_plane: Array
    band_thickness: Array
    plane_stress: Array
    plane_strain: Array
    force: Array
    displacement: Array
    reaction: Array
    energy: float
    neck_stress: Array
    neck_height: Array
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class SolidBands(NamedTuple):
    """Half-widths (3, 3) of the uncertainty of a compliance, of every entry in its own unit."""

    plane: Array
    thickness: Array

    @property
    def total(self) -> Array:
        """Their sum: neither is known to take from the other."""
        return self.plane + self.thickness


def solve_solid(stage: Stage, resolution: int = RESOLUTION, layers: int = LAYERS) -> SolidResponse:
    """Mesh and solve a feasible stage in three dimensions. Raises BadInput, ComputationFailed."""
    return _solved(stage, resolution, layers)


@once
def _solved(stage: Stage, resolution: int, layers: int, limit: float | Limit = TIME_LIMIT) -> SolidResponse:
    check_feasible(stage)
    return solid_response(mesh_sectors(stage, resolution, limit), sheet_of(stage), layers_of(stage, layers))


@once
def solid_bands(stage: Stage, resolution: int, layers: int) -> SolidBands:
    """Bands of the compliance that `solve_solid` gives, by coarser meshes and fewer layers.

    Notes
    -----
    Three resolutions with one layer say what the mesh in the plane does, two numbers of layers on the coarsest of
    these what the layers do: the two errors hardly depend on each other, and the solutions cost less than the one
    they are of. So few layers show no order that could be trusted - uneven ones that are not graded for the necks have
    far less than theirs - and their band is the last change of all entries together, times `SAFETY`.
    """
    planes, counts = levels(resolution), levels(layers)
    meshed = np.array([solve_solid(stage, level, 1).compliance for level in planes])
    few, many = (solve_solid(stage, planes[0], count).compliance for count in counts[1:])
    return SolidBands(compliance_bands(np.array(planes), meshed), _last_change(few, many))


def _last_change(few: Array, many: Array) -> Array:
    """Half-widths (3, 3) by the change between two compliances: by the largest e of dC x = e C x, Cauchy-Schwarz."""
    size = np.sqrt(np.outer(np.diag(many), np.diag(many)))
    zero = np.maximum(np.abs(few), np.abs(many)) <= ROUND_OFF * size  # by symmetry
    change = float(np.max(np.abs(eigh(many - few, many, eigvals_only=True))))
    return np.where(zero, np.finfo(float).eps, SAFETY * change) * size


def bounding(stage: Stage, response: SolidResponse) -> tuple[Array, Array]:
    """Compliances (3, 3) of plane stress and of plane strain on the mesh of the plane of a response."""
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (cyclic_response(response.sectors, each).compliance for each in (plate, held))
    return soft, hard


def neck_stress_of(stage: Stage, response: SolidResponse, loads: Array) -> NeckStress:
    """Highest stress of every notch under loads (k, 3)."""
    return solid_neck_stresses(stage, sheet_of(stage), response, loads)


def report_solid(stage: Stage, response: SolidResponse, load: Array, resolution: int) -> SolidReport:
    """Finite elements in three dimensions under a load (3,), with what is to be known of that."""
    layers = response.layers
    bands, (soft, hard) = solid_bands(stage, resolution, layers.number), bounding(stage, response)
    necks, pose = neck_stress_of(stage, response, load[None]), response.compliance @ load
    doubts = warning.of_yield(float(necks.highest.max()), stage.material.yield_strength, "under this load")
    return SolidReport(
        **of_stage(stage),
        units=f"{UNITS}; stress MPa",
        model=MODEL,
        resolution=resolution,
        layers=layers.number,
        heights=layers.heights[::2],
        triangles=response.triangles,
        unknowns=response.unknowns,
        stiffness=inverse(response.compliance),
        compliance=response.compliance,
        band=bands.total,
        band_plane=bands.plane,
        band_thickness=bands.thickness,
        plane_stress=soft,
        plane_strain=hard,
        force=load,
        displacement=pose,
        reaction=load @ response.reactions,
        energy=float(load @ response.energy @ load / 2),
        neck_stress=necks.highest[0],
        neck_height=necks.height[0],
        warnings=[*doubts, *warning.of_motion(stage, pose, "under this load"), *held_faces(stage)],
    )


def held_faces(stage: Stage) -> list[str]:
    """That a stage whose model holds its faces has them free here."""
    if stage.model != "plane_strain":
        return []
    return ['model = "plane_strain" holds the faces of the stage; in three dimensions they are free']


BUDGET = (4, 3)  # resolution and layers: what three dimensions change hardly depends on the mesh in the plane


def measured(stage: Stage, found: Budget) -> Budget:
    """A budget with what three dimensions change, measured on the stage. Raises ComputationFailed.

    Notes
    -----
    The error in three dimensions less that of the stage's own plane problem on the same mesh of the plane, whose own
    error so cancels. The band is `SAFETY` times what the last step of the mesh and of the layers changed, one after the
    other as in `solid_bands`.
    """
    resolution, count = BUDGET
    coarse, medium, _ = levels(resolution)
    finest = _change(stage, resolution, count)
    steps = (
        _change(stage, resolution, 1) - _change(stage, medium, 1),
        _change(stage, coarse, count) - _change(stage, coarse, levels(count)[1]),
    )
    band = SAFETY * np.diag(np.abs(steps[0]) + np.abs(steps[1]))
    of_solid = ThreeDimensional(
        resolution=resolution,
        layers=count,
        unknowns=solve_solid(stage, resolution, count).unknowns,
        points={axis: Triple.of(finest[:, k]) for k, axis in enumerate(DIRECTIONS)},
        band=dict(zip(DIRECTIONS, band.tolist(), strict=True)),
    )
    return found.model_copy(update={"three_dimensional": of_solid})


def _change(stage: Stage, resolution: int, layers: int) -> Array:
    """Percentage points (3, 3), column j for command j, from the stage's own plane problem to three dimensions."""
    response, predicted = solve_solid(stage, resolution, layers), analyse(stage).stiffness
    plane, lever = cyclic_response(response.sectors, plate_of(stage)), stage.chain.link_lengths[2]
    solid, flat = (error_matrix(predicted, each.compliance, lever) for each in (response, plane))
    return np.asarray(solid - flat)
